"""The small commands."""

import json
import os
import re

import click
import msgspec
import numpy as np
import pytest
from click.testing import CliRunner

import capslip
from capslip.cli import _command_line, main
from capslip.errors import SettingsError
from capslip.options import above_zero, preload_in_N, shard_of
from capslip.units import METRES, readable
from scenes import PROJECT

FACE_A, FACE_B = (PROJECT / "sample_surfaces" / f"paper_face_{x}.h5" for x in "ab")


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_formats_lists_every_reader():
    listed = run("formats")
    assert listed.exit_code == 0, listed.output
    for name in ("hdf5", "npy", "x3p", "vendor"):
        assert name in listed.stdout


@pytest.mark.parametrize("text", ["1/1", "1/8", "2/8", "8/8"])
def test_a_shard_is_one_of_so_many_parts(text):
    assert "/".join(map(str, shard_of(text))) == text


@pytest.mark.parametrize(
    "text", ["0/3", "4/3", "0/0", "a/3", "3/a", "3", "/3", "3/", "1.5/2", "-1/2"]
)
def test_what_is_no_part_is_no_shard(text):
    with pytest.raises(SettingsError, match=f"got {text}; expected I/N"):
        shard_of(text)


@pytest.mark.parametrize("value", [0.0, -1.0, float("inf"), float("nan")])
def test_a_limit_is_a_finite_number_above_zero_or_none(value):
    assert above_zero(None, "--timeout") is None
    assert above_zero(1e-3, "--timeout") == 1e-3
    with pytest.raises(SettingsError, match=f"--timeout: got {value:g}"):
        above_zero(value, "--timeout")


@pytest.mark.parametrize("option", ["--load", "--force"])
@pytest.mark.parametrize("share", [-0.1, 1.5, "nan", "-NaN"])
def test_no_more_than_the_preload_and_the_force_at_gross_slip_is_looked_at(option, share, tmp_path):
    ran = run("inspect", tmp_path, option, share)
    assert ran.exit_code == 2
    assert ran.stderr.startswith(
        f"error: Invalid value for '{option}': {share} is not in the range"
    )
    assert "0.0<=x<=1.0" in ran.stderr
    assert ran.stderr.count("\n") == 1


def test_every_range_of_an_option_is_one_that_nan_is_outside_of():
    ranges = {
        option.type
        for command in main.commands.values()
        for option in command.params
        if isinstance(option.type, click.FloatRange)
    }
    assert ranges
    for one in ranges:
        assert one.convert("0.5", None, None) == 0.5
        with pytest.raises(click.BadParameter, match="nan is not in the range"):
            one.convert("nan", None, None)


def test_init_config_writes_the_defaults_once(tmp_path):
    path = tmp_path / "mine.toml"
    assert run("init-config", path).exit_code == 0
    assert capslip.load_settings(path) == capslip.Settings()
    again = run("init-config", path)
    assert again.exit_code == 2
    assert "exists already" in again.stderr


def test_init_config_on_a_full_disk_leaves_nothing(tmp_path, half_written):
    half_written("write_bytes")
    ran = run("init-config", tmp_path / "mine.toml")
    assert ran.exit_code == 2
    assert (
        "mine.toml: No space left on device; make room on its disk, or give another" in ran.stderr
    )
    assert list(tmp_path.iterdir()) == []


def keys_of(kind, path=()):
    """Yield every setting as table and name."""
    for field in msgspec.structs.fields(kind):
        if isinstance(field.type, type) and issubclass(field.type, msgspec.Struct):
            yield from keys_of(field.type, (*path, field.name))
        else:
            yield ".".join(path), field.name


def test_the_written_file_names_every_setting_and_nothing_else(tmp_path):
    assert run("init-config", tmp_path / "mine.toml").exit_code == 0
    text = (tmp_path / "mine.toml").read_text()
    assert text == (PROJECT / "configs" / "default.toml").read_text()
    named, table = {}, ""
    for line in text.splitlines():
        if head := re.match(r"\[([a-z.]+)\]", line):
            table = head[1]
        elif one := re.match(r"(?:# )?(\w+) = (.*?)(?:  +#.*)?$", line):
            named[table, one[1]] = one[2]
    assert set(named) == set(keys_of(capslip.Settings))
    for (table, key), given in named.items():  # those that are commented out are valid, too
        if "modal" in key or "joint_stiffness" in key:
            continue  # go together
        capslip.load_settings(overrides=(f"{table}.{key}={given}",))


def test_a_setting_that_is_no_more_is_unknown(tmp_path):
    (tmp_path / "old.toml").write_text('[run]\nlog_level = "info"\n')
    ran = run("analyze", FACE_A, "-c", tmp_path / "old.toml")
    assert ran.exit_code == 2
    assert (
        "unknown setting run.log_level (known here: workers, sensitivity, figures, render, meshes, "
        "cluster, given)"
    ) in ran.stderr


def test_an_option_comes_before_set_and_set_before_the_file(tmp_path):
    (tmp_path / "c.toml").write_text(
        "[contact]\npreload_N = 50\ntolerance = 0.2\n[material]\nfriction_coefficient = 0.4\n"
    )
    sets = ("--set", "contact.preload_N=100", "--set", "contact.tolerance=0.1")
    options = ("--preload", "200", "--material", "brass")
    light = ("--no-figures", "--no-render", "--model", "families", "-q", "-o", tmp_path / "x")
    ran = run("analyze", FACE_A, "-c", tmp_path / "c.toml", *sets, *options, *light)
    assert ran.exit_code == 0, ran.output
    settings = capslip.load_settings(tmp_path / "x" / "settings.toml")
    assert (settings.contact.preload_N, settings.contact.tolerance) == (200.0, 0.1)
    assert settings.material.friction_coefficient == 0.4
    assert settings.material.youngs_modulus_Pa == (97e9, 97e9)
    assert settings.contact.model == "families"
    assert not settings.run.figures
    assert not settings.run.render
    said = "warning: contact.preload_N: got 100 and 200.0; the last counts, 200.0\n"
    assert (ran.stdout, ran.stderr) == ("", said)


@pytest.mark.long
def test_a_material_that_is_named_beats_what_the_file_says_of_another(tmp_path):
    light = ("--no-figures", "--no-render", "--no-meshes", "--model", "families", "-q")
    for name, options in {
        "steel": ("--preload", "300", "--material", "steel"),
        "again": ("-c", tmp_path / "steel" / "settings.toml", "--material", "aluminium"),
        "alone": ("--preload", "300", "--material", "aluminium"),
    }.items():
        assert run("analyze", FACE_A, *light, *options, "-o", tmp_path / name).exit_code == 0
    again, alone = (tmp_path / name / "summary.json" for name in ("again", "alone"))
    again, alone = (json.loads(path.read_text()) for path in (again, alone))
    for part in ("contact", "slip", "answer", "damping", "verdict"):
        assert again[part] == alone[part]
    digests = {one["provenance"]["settings_sha256"] for one in (again, alone)}
    assert len(digests) == 1


OWN = {
    "youngs_modulus_Pa": (1e11, 2e11),
    "poisson_ratio": (0.1, 0.2),
    "yield_stress_Pa": 5e8,
    "hardness_Pa": 3e9,
}


def test_own_values_win_where_they_are_said_with_the_material_and_give_way_to_a_later_one(tmp_path):
    path = tmp_path / "c.toml"
    values = {key: list(of) if isinstance(of, tuple) else of for key, of in OWN.items()}
    of_both = "friction_coefficient = 0.4\nhardness_spread = 0.1\n"
    for own in ("", *(f"{key} = {value}\n" for key, value in values.items())):
        path.write_text(f'[material]\npreset = "steel"\n{own}{of_both}')
        key = own.partition(" ")[0]
        if own:
            assert getattr(capslip.load_settings(path).material, key) == OWN[key]
        for other in ("material.friction_coefficient=0.4", "contact.preload_N=460"):
            assert capslip.load_settings(path, (other,)).material == (
                capslip.load_settings(path).material
            )
        named = ("material.preset=brass",)
        brass = ("material.friction_coefficient=0.4", "material.hardness_spread=0.1", *named)
        assert (
            capslip.load_settings(path, named).material
            == capslip.load_settings(overrides=brass).material
        )
        for mine in (f"material.{one}={value}" for one, value in values.items()):
            assert (
                capslip.load_settings(path, (mine, *named)).material
                == capslip.load_settings(overrides=(*brass, mine)).material
            )


def test_a_material_that_is_named_is_given_though_the_file_said_that_it_was_not(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text(
        "[material]\nyoungs_modulus_Pa = [200e9, 200e9]\nfriction_coefficient = 0.2\n"
        "[run]\ngiven = []\n"
    )
    found = capslip.load_settings(path, ("material.preset=steel",))
    assert found.material.youngs_modulus_Pa == (210e9, 210e9)
    assert found.run.given == ("material.youngs_modulus_Pa", "material.poisson_ratio")
    assert capslip.load_settings(path, ("contact.tolerance=0.1",)).run.given == ()
    path.write_text("material = 3\n")
    with pytest.raises(SettingsError, match="material is no table"):
        capslip.load_settings(path, ("material.preset=steel",))


WRONG = ("[[1]]", "'x y'", "1.5", "-3", "true", "[1,2,3]", "1979-05-27")
OF_THE_PROGRAM = re.compile(r"[`|]|\b(null|float|int|bool|str|array|object|tuple|None)\b")


@pytest.mark.parametrize("key", [".".join(key) for key in keys_of(capslip.Settings)])
def test_a_wrong_value_of_any_setting_is_told_in_plain_words(key):
    refused = 0
    for value in WRONG:
        try:
            capslip.load_settings(overrides=(f"{key}={value}",))
        except SettingsError as error:
            said = str(error)
            assert key.split(".")[0] in said
            assert "\n" not in said
            assert "expected" in said
            assert not OF_THE_PROGRAM.search(said.partition("expected")[2]), said
            refused += 1
    assert refused > 0


@pytest.mark.parametrize("unit", METRES)
def test_every_unit_of_a_reader_is_an_option_and_a_setting(unit, tmp_path):
    np.save(tmp_path / "a.npy", np.full((4, 4), 2.0))
    capslip.load_settings(overrides=(f"reading.unit={unit}", f"reading.lateral_unit={unit}"))
    given = {"unit": unit, "lateral_unit": unit, "pixel_size": (1.0, 2.0)}
    surface = capslip.load_surface(tmp_path / "a.npy", **given)
    assert surface.height_m[0, 0] == pytest.approx(2 * METRES[unit])
    assert surface.pixel_size_m == pytest.approx((METRES[unit], 2 * METRES[unit]))
    options = ("--unit", unit, "--lateral-unit", unit, "--pixel-size", "1", "2")
    ran = run("analyze", tmp_path / "a.npy", "--preload", "1e-20", *options)
    assert ran.exit_code == 3  # read, and found to be of no use
    assert "Invalid value" not in ran.stderr


@pytest.mark.long
def test_reproduce_writes_table_1(tmp_path):
    assert run("reproduce", "-o", tmp_path / "r", "-q").exit_code == 0
    table = json.loads((tmp_path / "r" / "reproduce.json").read_text())["table1"]
    assert len(table) == 14
    for row in table:
        assert row["computed_N"] == pytest.approx(row["printed_N"], rel=1.2e-3)


@pytest.mark.long
def test_caps_of_both_faces_count_together(tmp_path):
    light = ("--no-figures", "--no-render", "--json", "--set", "mating.way=together")
    ran = run("analyze", FACE_A, "--mate", FACE_B, "-o", tmp_path / "both", *light)
    assert ran.exit_code == 0, ran.output
    families = json.loads(ran.stdout)["families"]
    assert (families["m"], families["n"]) == (5, 18)


@pytest.mark.long
def test_export_writes_jenkins_elements(tmp_path):
    light = ("--no-figures", "--no-render", "-q")
    ran = run("analyze", FACE_A, "-o", tmp_path / "a", "--export", "jenkins", *light)
    assert ran.exit_code == 0, ran.output
    lines = (tmp_path / "a" / "jenkins.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines if line[0].isdigit()]
    assert sum(float(slip_N) for _, slip_N in rows) == pytest.approx(92.0, rel=1e-6)


def test_the_recorded_command_is_the_one_that_was_called(monkeypatch):
    monkeypatch.setattr("sys.argv", ["/somewhere/capslip", "analyze", "a face.h5", "--quiet"])
    assert _command_line() == "capslip analyze a face.h5 --quiet"


@pytest.mark.parametrize(("text", "force_N"), [("10kN", 1e4), ("460", 460.0), ("2.5 N", 2.5)])
def test_a_preload_may_have_its_unit(text, force_N):
    assert preload_in_N(text) == force_N


def test_a_preload_in_a_unit_that_is_none_is_said():
    with pytest.raises(SettingsError, match="--preload: got '3 bar'"):
        preload_in_N("3 bar")


@pytest.mark.parametrize("command", ["bench", "chart", "limits"])
def test_a_study_says_that_its_folder_cannot_be_used_before_the_work(
    tmp_path, monkeypatch, command
):
    def works(*_args, **_options):
        raise AssertionError("the work has begun")

    for name in ("bench.study.commands", "chart.study.measure", "limits.study.measure"):
        monkeypatch.setattr(f"capslip.studies.{name}", works)
    (tmp_path / "file").write_text("")
    (tmp_path / "locked").mkdir()
    known = os.access

    def access(path, how, **options):
        return known(path, how, **options) and not ("locked" in str(path) and how == os.W_OK)

    monkeypatch.setattr(os, "access", access)
    for folder in ("file", "file/in", "locked"):
        told = run(command, "--out", tmp_path / folder)
        assert told.exit_code == 2, told.output
        assert told.stderr.count("\n") == 1
        assert "choose another with --out" in told.stderr
    told = run(command, "--out", tmp_path / "new")  # the other way about: a good folder goes on
    assert "the work has begun" in told.stderr


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("1e-12 m", "1 pm"),
        ("9.9e-13 m", "9.9e-13 m"),  # less than the least prefix
        ("9.9e11 Pa", "990 GPa"),
        ("1e12 Pa", "1e12 Pa"),  # more than the greatest
        ("1.5 N", "1.5 N"),
        ("999.9 N", "999.9 N"),
        ("1000 N", "1 kN"),
        ("1500 N", "1.5 kN"),
        ("0.999 m", "999 mm"),
        ("1e-3 m2", "10 cm2"),
        ("9e-4 m2", "900 mm2"),
        ("5e-10 m2", "500 um2"),
    ],
)
def test_a_quantity_is_read_with_the_prefix_of_its_size(written, read):
    assert readable(f"found {written}.") == f"found {read}."
