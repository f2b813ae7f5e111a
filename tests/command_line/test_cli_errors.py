"""Bad input: one clear line, the right exit code, nothing written."""

import errno
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from capslip.cli import main
from capslip.output import report, tables
from capslip.output.staging import FILES

# The small face has one cap, which balances under no load beside it
ONE_CAP = ("--preload", "0.1", "--set", "contact.alignment=as_levelled")


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        return CliRunner().invoke(main, [str(a) for a in arguments])

    return call


def native(path, height, **attributes):
    with h5py.File(path, "w") as file:
        file["height"] = height
        file["height"].attrs.update(attributes)
    return path


def hill(shape=(40, 60)):
    y, x = np.mgrid[: shape[0], : shape[1]]
    return -((x - 30.0) ** 2 + (y - 20.0) ** 2) * 1e-3


KNOWN = {"unit": "um", "pixel_size": [50.0, 50.0], "pixel_unit": "um"}


def one_line(result, code, *words):
    assert result.exit_code == code, result.output
    lines = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1, result.stderr
    for word in words:
        assert word in lines[0]
    assert "Traceback" not in result.output


def test_no_such_file(run, tmp_path):
    one_line(run("analyze", "nothing.h5"), 3, "nothing.h5", "no such file")
    assert list(tmp_path.iterdir()) == []


def test_not_a_height_map(run, tmp_path):
    (tmp_path / "notes.h5").write_text("dear diary")
    one_line(run("analyze", "notes.h5"), 3, "notes.h5")
    assert not (tmp_path / "results").exists()


def test_no_unit(run, tmp_path):
    native(tmp_path / "a.h5", hill(), pixel_size=[50.0, 50.0], pixel_unit="um")
    one_line(run("analyze", "a.h5"), 3, "a.h5", "--unit")


def test_no_pixel_size(run, tmp_path):
    native(tmp_path / "a.h5", hill(), unit="um")
    one_line(run("analyze", "a.h5"), 3, "a.h5", "--pixel-size")


def test_all_points_non_measured(run, tmp_path):
    native(tmp_path / "a.h5", np.full((40, 60), np.nan), **KNOWN)
    one_line(run("analyze", "a.h5"), 3, "non-measured")
    assert not (tmp_path / "results" / "a").exists()


def test_constant_map(run, tmp_path):
    native(tmp_path / "a.h5", np.full((40, 60), 3.0), **KNOWN)
    one_line(run("analyze", "a.h5"), 3, "equal")


def test_fewer_than_nine_points_above_the_cut(run, tmp_path):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    one_line(
        run("analyze", "a.h5", "--set", "hills.material_ratio=0.001"), 3, "points lie above the cut"
    )


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("contact.preload_N=nan", ["contact.preload_N", "nan"]),
        ("contact.preload_N=-5", ["contact.preload_N", "-5"]),
        ("material.friction_coefficient=-0.2", ["friction_coefficient", "-0.2"]),
        ("contact.preloadN=5", ["contact.preloadN", "did you mean contact.preload_N?"]),
        ("hils.material_ratio=0.1", ["hils", "did you mean hills?"]),
        (
            "material.friction=0.1",
            ["did you mean material.friction_coefficient or material.friction_spread?"],
        ),
        (  # of another table
            "contact.hardness=1e9",
            ["did you mean material.hardness_Pa or material.hardness_spread? (known here: model"],
        ),
        (
            "material.hardness_spread=0.1",
            ["settings: material.hardness_spread: got 0.1 without a hardness", "material.preset"],
        ),
        ("contact.hardness_Pa=1e9", ["did you mean material.hardness_Pa? (known here: model"]),
        ("joint.width_m=0.1", ["did you mean structure.beam.width_m?"]),
        ("preload=5", ["did you mean contact.preload_N or contact.preload_spread?"]),
        ("material.youngs_modulus_Pa=210e9", ["youngs_modulus_Pa", "expected a list, [a, b]"]),
        ("joint.area_m2=12cm2x", ["joint.area_m2: got '12cm2x'; ", "(m2, cm2, ", "as in 12cm2"]),
        ("structure.beam.length_m=1km", ["length_m: got '1km'; expected a number in m, or one"]),
        ("contact.model=hertz", ["contact.model", "hertz", "interacting"]),
        ("contact.zebra=5", ["unknown setting contact.zebra (known here: model"]),
        ("nonsense", ["nonsense", "table.key=value"]),
        ("contact.preload_N=1e300", ["contact.preload_N", "1e+300", "1e+30"]),
        ("contact.preload_N=1e30", ["out of range", "Pa on the scan", "units"]),
        ("contact.preload_N=2e14", ["out of range", "Pa on the scan", "units"]),
        ("contact.nominal_pressure_Pa=1e20", ["out of range", "1e+20 Pa"]),
        ("joint.area_m2=1e-30", ["out of range", "joint.area_m2"]),
        ("material.youngs_modulus_Pa=[1e-20,1e-20]", ["out of range", "5.49e-21 Pa"]),
        ("material.youngs_modulus_Pa=[1e300,1e300]", ["youngs_modulus_Pa", "1e+300"]),
        ("contact.solver_tolerance=1e-11", ["contact.solver_tolerance", "1e-11"]),
        ("contact.solver_tolerance=0.005", ["contact.solver_tolerance", "0.005"]),
        ("slip.direction_rad=90", ["slip.direction_rad: got 90; expected a number <= 6.283"]),
        ("slip.direction_rad=-6.3", ["slip.direction_rad: got -6.3; expected a number >= -6.283"]),
        ("slip.normal_phase_rad=1e300", ["slip.normal_phase_rad: got 1e+300", "<= 6.283"]),
        ("slip.normal_phase_rad=-45.0", ["slip.normal_phase_rad: got -45.0", ">= -6.283"]),
        ("mating.rotation_rad=6.3", ["mating.rotation_rad: got 6.3", "<= 6.283"]),
        ("mating.rotation_rad=-180", ["mating.rotation_rad: got -180", ">= -6.283"]),
        (  # a word of a terminal that is not UTF-8
            "reading.dataset=\udcb5m",
            [r"settings: reading.dataset: got '\udcb5m'; expected a text; write it in UTF-8"],
        ),
        ("reading.unit=\udcb5m", [r"reading.unit: got '\udcb5m'; expected a text"]),
        ("run.cluster.directives=[\ud800]", ["run.cluster.directives: got", "expected a text"]),
        ("joint.pressure_map=caf\udce9.csv", ["joint.pressure_map: got", "expected a text"]),
    ],
)
def test_settings(run, tmp_path, override, words):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    one_line(run("analyze", "a.h5", "--set", override), 2, *words)
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.h5"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("analyze",), ["SURFACE"]),
        (("analyze", "a.h5", "--modle", "caps"), ["--modle", "'--model'"]),
        (("analyze", "a.h5", "--model", "hertz"), ["--model", "hertz", "interacting"]),
        (("analyze", "a.h5", "--pixel-size", "1"), ["--pixel-size"]),
        (
            ("analyze", "a.h5", "--export", "law", "--export", "jenkins"),
            ["--export: got law and jenkins; expected one"],
        ),
        (("analyse", "a.h5"), ["analyse", "capslip --help"]),
        (("--fast", "analyze", "a.h5"), ["--fast"]),
        (("limits", "--workers", "-1"), ["--workers", "-1"]),
    ],
)
def test_words_that_no_command_takes(run, tmp_path, arguments, words):
    """As any other error: one line and nothing else."""
    ran = CliRunner().invoke(main, arguments, prog_name="capslip")
    one_line(ran, 2, *words, " --help)")
    assert ran.output.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_without_a_command_there_is_the_help(run):
    assert run().output.startswith("Usage: ")
    assert run("analyze", "--help").exit_code == 0


def test_filters_that_leave_nothing(run, tmp_path):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    filters = ("s_filter_nesting_index_m=1e-3", "l_filter_nesting_index_m=5e-4")
    sets = [word for name in filters for word in ("--set", f"conditioning.{name}")]
    one_line(run("analyze", "a.h5", *sets), 2, "s_filter_nesting_index_m", "0.0005", "nothing")


@pytest.mark.parametrize("factor", [1e300, 1e160, 1e-160, 1e-300])
def test_heights_that_no_unit_makes_plausible(run, tmp_path, factor):
    native(tmp_path / "a.h5", hill() * factor, **KNOWN)
    result = run("analyze", "a.h5")
    one_line(result, 3, "a: heights of up to", "--unit")
    assert "RuntimeWarning" not in result.stderr


def test_a_pixel_that_no_unit_makes_plausible(run, tmp_path):
    native(tmp_path / "a.h5", hill(), **KNOWN | {"pixel_size": [50.0, 1e300]})
    one_line(run("analyze", "a.h5"), 3, "a: a side of", "--lateral-unit")


def test_settings_file_that_is_no_toml(run, tmp_path):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    (tmp_path / "c.toml").write_text("[contact\n")
    one_line(run("analyze", "a.h5", "-c", "c.toml"), 2, "c.toml", "TOML")


def test_a_folder_of_someone_else_is_refused(run, tmp_path):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("years of work")
    one_line(run("analyze", "a.h5", "-o", "out"), 2, "out", "thesis.tex")
    assert [entry.name for entry in (tmp_path / "out").iterdir()] == ["thesis.tex"]


def test_a_report_of_someone_else_is_refused(run, tmp_path):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.html").write_text("mine")
    one_line(run("analyze", "a.h5", "-o", "out"), 2, "out", "report.html", "no earlier result")
    assert (tmp_path / "out" / "report.html").read_text() == "mine"


def test_a_summary_beside_foreign_files_is_refused(run, tmp_path):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    light = ("--no-figures", "--no-render", *ONE_CAP)
    assert run("analyze", "a.h5", "-o", "out", *light).exit_code == 0
    (tmp_path / "out" / "notes.txt").write_text("mine")
    one_line(run("analyze", "a.h5", "-o", "out", *light), 2, "notes.txt")
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"


@pytest.mark.long
def test_an_earlier_result_is_replaced_whole(run, tmp_path):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    light = ("--no-render", "--no-figures")
    assert run("analyze", "a.h5", "-o", "out", "--no-render", *ONE_CAP).exit_code == 0
    assert list((tmp_path / "out" / "figures").glob("*.png"))
    assert run("analyze", "a.h5", "-o", "out", *ONE_CAP, *light).exit_code == 0
    assert not list((tmp_path / "out" / "figures").glob("*.png"))
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.h5", "out"]


def test_the_current_folder_takes_a_result_and_the_next_one(run, tmp_path, monkeypatch):
    face = native(tmp_path / "a.h5", hill(), **KNOWN)
    light = ("--no-render", "--no-figures", *ONE_CAP)
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path / "out")
    for extra in ((), ("--set", "material.friction_coefficient=0.3")):
        ran = run("analyze", face, "-o", ".", *light, *extra)
        assert ran.exit_code == 0, ran.output
        names = sorted(entry.name for entry in Path.cwd().iterdir())
        assert set(names) <= FILES
        assert {"summary.json", "result.h5", "caps.csv"} <= set(names)
    assert "friction_coefficient = 0.3" in Path("settings.toml").read_text()
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.h5", "out"]


def test_a_scan_inside_the_output_folder_is_kept(run, tmp_path):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    light = ("--no-render", "--no-figures", *ONE_CAP)
    assert run("analyze", "a.h5", "-o", "out", *light).exit_code == 0
    before = (tmp_path / "out" / "result.h5").read_bytes()
    again = ("analyze", "out/result.h5", "--dataset", "/surface/height_m", *light)
    one_line(run(*again, "-o", "out"), 2, "out", "result.h5", "would be replaced")
    one_line(run("analyze", "a.h5", "--mate", "out/result.h5", "-o", "out", *light), 2, "replaced")
    assert (tmp_path / "out" / "result.h5").read_bytes() == before
    assert run(*again, "-o", "other").exit_code == 0


def test_a_full_disk_is_told_with_what_to_do_and_no_error_of_the_program(
    run, tmp_path, monkeypatch
):
    native(tmp_path / "a.h5", hill(), **KNOWN)
    light = ("--no-render", "--no-figures", *ONE_CAP)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(report, "write_report", full)
    ran = run("analyze", "a.h5", "-o", "out", *light)
    one_line(ran, 1, "report.html", "No space left", "make room", "all numbers are in out")
    assert "internal" not in ran.stderr
    assert (tmp_path / "out" / "summary.json").is_file()
    monkeypatch.setattr(tables, "write_summary", full)
    ran = run("analyze", "a.h5", "-o", "new", *light)
    one_line(ran, 2, "output folder new: No space left", "nothing was written; make room")


def test_an_interrupt_ends_with_130_and_leaves_nothing(run, tmp_path, monkeypatch):
    native(tmp_path / "a.h5", hill(), **KNOWN)

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(tables, "write_summary", interrupt)
    one_line(run("analyze", "a.h5", "-o", "out", "--no-render", "--no-figures"), 130, "interrupted")
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.h5"]


def test_nothing_to_do(run, tmp_path):
    (tmp_path / "empty").mkdir()
    one_line(run("batch", "empty", "-o", "out"), 4, "empty")
    assert not (tmp_path / "out").exists()
