"""What each command hands on, says and ends with, without the work between."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from capslip.cli import main
from capslip.errors import SettingsError
from capslip.options import settings_of
from capslip.settings import load_settings

FAMILIES = ("families", "--m", "3", "--n", "2", "--radius-G", "24", "--radius-P", "26")
FAMILIES += ("--h", "1e-7", "--preload", "100", "--slip-force")


def run(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


@pytest.mark.parametrize(
    ("option", "given", "setting", "value"),
    [
        ("preload", "3kN", "contact.preload_N", 3000.0),
        ("material", "brass", "material.preset", "brass"),
        ("model", "flat", "contact.model", "flat"),
        ("amplitude", "0.5um", "answer.amplitude_m", 5e-7),
        ("slip_force", "2kN", "answer.slip_force_N", 2000.0),
        ("displacement", "10nm", "answer.displacement_m", 1e-8),
        ("dataset", "a b", "reading.dataset", "a b"),
        ("unit", "um", "reading.unit", "um"),
        ("sensitivity", True, "run.sensitivity", True),
        ("sensitivity", False, "run.sensitivity", False),
        ("figures", False, "run.figures", False),
        ("render", False, "run.render", False),
        ("meshes", False, "run.meshes", False),
        ("workers", 3, "run.workers", 3),
    ],
)
def test_an_option_is_one_setting_and_no_other(option, given, setting, value):
    found = settings_of(None, (), False, **{option: given})
    table, key = setting.split(".")
    assert getattr(getattr(found, table), key) == value
    literal = {True: "true", False: "false"}.get(value, value) if value in (0, 1) else value
    assert found == load_settings(overrides=(f"{setting}={literal}",))


def test_options_that_go_together_are_their_settings():
    given = {"m": 4, "n": 3, "radius_g": 20.0, "radius_p": 30.0, "h": 2e-7, "approach": 1e-6}
    found = settings_of(None, (), False, **given).families
    assert (found.m, found.n, found.radius_G_m, found.radius_P_m) == (4, 3, 20.0, 30.0)
    assert (found.h_m, found.approach_m) == (2e-7, 1e-6)
    found = settings_of(None, (), False, lateral_unit="mm", pixel_size=(1.0, 2.0), unit="nm")
    assert (found.reading.lateral_unit, found.reading.pixel_size) == ("mm", (1.0, 2.0))
    assert settings_of(None, (), False, preload=None) == load_settings()


def test_an_option_in_a_wrong_unit_is_named_as_it_was_written():
    with pytest.raises(SettingsError, match="--slip-force: got '3um'"):
        settings_of(None, (), False, slip_force="3um")
    with pytest.raises(SettingsError, match=r"families\.m: got nan"):
        settings_of(None, (), False, m=float("nan"))


def test_families_answer_and_fail_beyond_gross_slip(tmp_path):
    ran = run(*FAMILIES, "5N")
    assert ran.exit_code == 0, ran.output
    assert "answer     at slip force 5 N" in ran.stdout
    assert not any(tmp_path.iterdir())
    failed = run(*FAMILIES, "25N")
    assert failed.exit_code == 3
    assert failed.stderr.startswith("error: got slip force 25 N")
    assert "what was found before" not in failed.stderr
    written = run(*FAMILIES, "25N", "-o", tmp_path / "out")
    assert written.exit_code == 3
    assert f"; what was found before is in {tmp_path / 'out'}" in written.stderr
    assert (tmp_path / "out" / "summary.json").is_file()
    assert run(*FAMILIES, "5N", "-q").output == ""
    assert run(*FAMILIES, "5N", "--json").stdout.startswith("{")


def test_a_traceback_is_shown_where_it_was_asked_for(monkeypatch):
    def fails(_):
        raise ValueError("torn")

    monkeypatch.setattr("capslip.analysis.analyze_families", fails)
    assert "Traceback" not in run(*FAMILIES, "5N").stderr
    told = run(*FAMILIES, "5N", "-v")
    assert told.exit_code == 1
    assert "Traceback" in told.stderr


@pytest.fixture
def drawn(monkeypatch):
    calls = []
    monkeypatch.setattr("capslip.output.scene.look_of", lambda **given: tuple(given.items()))
    for name in ("scene.save_picture", "scene.show", "viewer.write_viewer"):

        def call(*given, name=name):
            calls.append((name.partition(".")[2], *given))

        monkeypatch.setattr(f"capslip.output.{name}", call)
    return calls


DEFAULT = (("colour", "family"), ("load", 1.0), ("force", None), ("mate", False))


def test_inspect_draws_what_was_asked_for_or_opens_a_window(drawn):
    result = Path("results/a")
    assert run("inspect", result).exit_code == 0
    assert drawn == [("show", result, DEFAULT)]
    drawn.clear()
    options = ("--colour", "load", "--load", "0.5", "--force", "0.25", "--mate")
    look = (("colour", "load"), ("load", 0.5), ("force", 0.25), ("mate", True))
    ran = run("inspect", result, "--screenshot", "a.png", "--turntable", "a.gif", *options)
    assert drawn == [("save_picture", result, Path(name), look) for name in ("a.png", "a.gif")]
    assert ran.stdout.splitlines() == ["a.png", "a.gif"]
    drawn.clear()
    assert run("inspect", result, "--html", "a.html").stdout == "a.html\n"
    assert drawn == [("write_viewer", result, Path("a.html"))]
    drawn.clear()
    ran = run("inspect", result, "--html", "a.html", "--screenshot", "a.png")
    assert [name for name, *_ in drawn] == ["save_picture", "write_viewer"]
    assert ran.stdout.splitlines() == ["a.png", "a.html"]


@pytest.mark.parametrize("left_out", [None, "3 caps have no sphere"])
def test_an_export_says_where_it_is_and_what_it_leaves_out(left_out, monkeypatch):
    asked = []
    monkeypatch.setattr(
        "capslip.output.convert.export_result",
        lambda *given: asked.append(given) or (Path("a.stl"), left_out),
    )
    ran = run("export", "results/a", "--to", "stl", "-o", "b.stl")
    assert asked == [(Path("results/a"), "stl", Path("b.stl"))]
    assert (ran.exit_code, ran.stdout) == (0, "a.stl\n")
    assert ran.stderr == ("" if left_out is None else f"warning: {left_out}\n")


def test_a_comparison_is_of_what_was_given_and_written_where_it_was_asked(monkeypatch):
    asked, wrote = [], []
    monkeypatch.setattr("capslip.compare.compare_result", lambda *given: asked.append(given) or 7)
    monkeypatch.setattr("capslip.compare.lines", lambda found: [f"found {found}"])
    monkeypatch.setattr("capslip.compare.to_dict", lambda found: {"found": found})
    monkeypatch.setattr("capslip.compare.write_comparison", lambda *given: wrote.append(given))
    ran = run("compare", "a", "--assembly", "b.csv", "--monolithic", "c.csv", "--identify")
    assert asked == [(Path("a"), Path("b.csv"), Path("c.csv"), True)]
    assert (ran.stdout, wrote) == ("found 7\n", [])
    assert ran.stderr.endswith("comparing a with b.csv\n")
    ran = run("compare", "a", "--assembly", "b.csv", "-o", "out", "-q")
    assert asked[1:] == [(Path("a"), Path("b.csv"), None, False)]
    assert (ran.output, wrote) == ("", [(7, Path("out"))])
    ran = run("compare", "a", "--assembly", "b.csv", "-o", "out")
    assert ran.stdout == "found 7\npicture    out/compare.png\n"
    assert '"found": 7' in run("compare", "a", "--assembly", "b.csv", "--json", "-q").stdout
