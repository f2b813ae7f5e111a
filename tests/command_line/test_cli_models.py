"""Every model end to end, and parts of a result that fail without taking the numbers along."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from capslip.cli import main
from capslip.console import EXIT_CODES
from capslip.contact.solvers import solutions
from capslip.errors import ContactError
from capslip.options import MODELS
from capslip.output import figures_contact, mesh, report
from check_result import defects
from scenes import caps_map


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def face(tmp_path_factory):
    """Two high and three low caps with pixels wide enough to be solved quickly."""
    high = [(6e-3, 5e-3, 10.0, 0.0), (22e-3, 13e-3, 10.0, 0.01e-6)]
    low = [(14e-3, 6e-3, 8.0, -0.2e-6), (24e-3, 5e-3, 8.0, -0.21e-6), (8e-3, 15e-3, 8.0, -0.19e-6)]
    surface = caps_map(high + low, (100, 150), (2e-4, 2e-4))
    path = tmp_path_factory.mktemp("models") / "face.h5"
    with h5py.File(path, "w") as file:
        file["height"] = surface.height_m
        file["height"].attrs.update(unit="m", pixel_size=[2e-4, 2e-4], pixel_unit="m")
    return path


@pytest.mark.long
@pytest.mark.parametrize("model", MODELS)
def test_every_model_leaves_a_whole_result(model, face, tmp_path):
    out = tmp_path / "out"
    light = ("--no-render",) if model == "auto" else ("--no-render", "--no-figures")
    ran = run("analyze", face, "--model", model, *light, "-o", out)
    assert ran.exit_code == 0, ran.output
    assert defects(out) == []
    summary = json.loads((out / "summary.json").read_text())
    assert summary["contact"]["model"] == (model if model != "auto" else "interacting")
    counted = "contact regions" if model == "boundary_elements" else "caps in contact"
    contacts = summary["contact"]["contacts"]
    assert f"on {contacts} {counted}," in ran.stdout
    assert f"<span>{counted}</span>" in (out / "report.html").read_text()
    with h5py.File(out / "result.h5") as file:
        approach_m, load_N = file["normal/approach_m"][:], file["normal/load_N"][:]
    assert load_N[0] == approach_m[0] == 0.0
    assert load_N[-1] == summary["contact"]["preload_N"]
    assert (np.diff(load_N) > 0).all()
    assert approach_m[-1] == pytest.approx(summary["contact"]["approach_m"], rel=1e-12)


@pytest.mark.long
@pytest.mark.parametrize(
    ("alignment", "solved_N", "figures"),
    [("as_levelled", [460.0], ()), ("balanced", [], ("--no-figures",))],
)
def test_the_normal_curve_of_boundary_elements_costs_no_solution(
    face, tmp_path, monkeypatch, alignment, solved_N, figures
):
    """Balanced, the one solution is that of the level; the direction of slip asks for half."""
    loads_N = []
    press = solutions.press

    def counted(*arguments, load_N=None, **options):
        loads_N.append(load_N)
        return press(*arguments, load_N=load_N, **options)

    monkeypatch.setattr(solutions, "press", counted)
    way = ("--model", "boundary_elements", "--set", f"contact.alignment={alignment}")
    ran = run("analyze", face, *way, "--no-render", *figures, "-o", tmp_path / "x")
    assert ran.exit_code == 0, ran.output
    assert loads_N == [*solved_N, 230.0]


@pytest.mark.long
@pytest.mark.parametrize(
    ("module", "name", "missing"),
    [
        (figures_contact, "_caps_alone", "normal_curve.png"),
        (report, "limits", "report.html"),
        (mesh, "cap_mesh", "caps.vtu"),
    ],
)
def test_a_part_that_fails_takes_no_number_along(
    module, name, missing, face, tmp_path, monkeypatch
):
    def fail(*_):
        raise KeyError("no such colour")

    monkeypatch.setattr(module, name, fail)
    out = tmp_path / "out"
    figures = ("--no-figures",) if missing == "report.html" else ()
    ran = run("analyze", face, "--no-render", *figures, "--json", "-o", out)
    assert ran.exit_code == 1
    errors = [line for line in ran.stderr.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1
    assert missing in errors[0]
    assert "no such colour" in errors[0]
    assert str(out) in errors[0]
    summary = json.loads((out / "summary.json").read_text())
    assert summary == json.loads(ran.stdout)
    assert summary["status"] == "check"
    said = [p["message"] for p in summary["problems"] if p["code"] == "output_missing"]
    assert len(said) == 1
    assert missing in said[0]
    assert summary["damping"]["peak_loss_factor"] > 0
    assert (out / "caps.csv").is_file()
    with h5py.File(out / "result.h5") as file:
        assert len(file["slip/energy_J"]) >= 64
    if missing != "report.html":
        assert "no such colour" in (out / "report.html").read_text()
        assert len(list((out / "figures").glob("*.png"))) >= 8


NO_SLIDERS = "jenkins: no slider stands for it; expected a constant normal load"


def no_sliders(_):
    raise ContactError(NO_SLIDERS)


@pytest.mark.parametrize("changed", [True, False])
def test_verdict_and_status_that_changed_while_writing_end_the_lines(
    changed, face, tmp_path, monkeypatch
):
    """What was printed before knew nothing of an export that could not be made."""
    if changed:
        monkeypatch.setattr("capslip.output.exports.jenkins.jenkins", no_sliders)
    words = [
        "--material",
        "steel",
        "--preload",
        "150N",
        "--set",
        "material.friction_coefficient=0.2",
    ]
    words += ["--export", "jenkins"]
    out = tmp_path / "out"
    ran = run("analyze", face, *words, "--no-render", "--no-figures", "-o", out)
    summary = json.loads((out / "summary.json").read_text())
    assert ran.exit_code == (3 if changed else 0)
    assert ("output_missing" in [one["code"] for one in summary["problems"]]) == changed
    lines = ran.stdout.splitlines()
    for word in ("verdict", "status"):
        said = [line for line in lines if line.startswith(f"{word:10} ")]
        assert len(said) == 1 + changed
        assert said[-1] == f"{word:10} {summary[word]}"
        assert len(set(said)) == len(said)  # the last is another one
    assert summary["status"] == ("check" if changed else "ok")
    last = [line.split(" ")[0] for line in lines[-4:]]
    assert last == (["verdict", "status"] if changed else last[:2]) + ["results", "report"]


def test_an_export_that_cannot_be_made_says_what_it_expects(face, tmp_path, monkeypatch):
    monkeypatch.setattr("capslip.output.exports.jenkins.jenkins", no_sliders)
    words = ["--export", "jenkins", "--json"]
    ran = run("analyze", face, *words, "--no-render", "--no-figures", "-o", tmp_path / "out")
    problems = json.loads(ran.stdout)["problems"]
    (said,) = [one for one in problems if one["code"] == "output_missing"]
    assert "expected a constant normal load" in said["message"]
    assert said["remedy"].startswith("Give what the message expects")
    meaning = dict(EXIT_CODES)[str(ran.exit_code)]  # of --help
    assert "--export" in meaning
    readme = " ".join((Path(__file__).parents[2] / "README.md").read_text("utf-8").split())
    assert f"`--export` that cannot be made of the scan, with code {ran.exit_code}." in readme


@pytest.mark.parametrize(
    ("first", "second", "code"),
    [(ContactError, OSError, 1), (OSError, ContactError, 1), (ContactError, ContactError, 3)],
)
def test_one_internal_error_among_the_missing_parts_decides(
    first, second, code, face, tmp_path, monkeypatch
):
    def failing(kind):
        def fail(*_):
            raise kind("torn")

        return fail

    monkeypatch.setattr(mesh, "write_meshes", failing(first))
    monkeypatch.setattr(report, "write_report", failing(second))
    light = ("--no-render", "--no-figures", "-q")
    ran = run("analyze", face, "--model", "families", *light, "-o", tmp_path / "out")
    assert ran.exit_code == code
    assert ("internal error" in ran.stderr) is (code == 1)


def test_no_half_picture_is_left(face, tmp_path, monkeypatch):
    def torn(name, analysis, folder):
        (folder / f"{name}.png").write_bytes(b"half")
        raise OSError("no space left")

    monkeypatch.setattr("capslip.output.figures.write_figure", torn)
    out = tmp_path / "out"
    ran = run("analyze", face, "--no-render", "-q", "-o", out)
    assert ran.exit_code == 1
    assert "no space left" in ran.stderr
    assert list((out / "figures").iterdir()) == []
    assert defects(out) == []


def test_an_export_that_cannot_be_is_refused_before_the_work(face, tmp_path):
    out = tmp_path / "out"
    ran = run("analyze", face, "--model", "flat", "--export", "jenkins", "-o", out)
    assert ran.exit_code == 2
    assert "analysing" not in ran.stderr
    assert [line[:23] for line in ran.stderr.splitlines()] == ["error: --export jenkins"]
    assert not out.exists()


@pytest.mark.parametrize(
    ("export", "reason"),
    [
        ("law", "it is a law under a constant pressure"),
        ("jenkins", "its sliders slip at a constant force"),
    ],
)
def test_an_export_of_a_load_that_oscillates_is_refused_before_the_work(
    export, reason, face, tmp_path
):
    out = tmp_path / "out"
    oscillates = ("--set", "slip.normal_amplitude_ratio=0.1")
    ran = run("analyze", face, *oscillates, "--export", export, "-o", out)
    assert ran.exit_code == 2
    assert ran.stderr.splitlines() == [
        f"error: --export {export}: {reason}; expected slip.normal_amplitude_ratio = 0"
    ]
    assert not out.exists()


@pytest.mark.long
def test_a_failed_analysis_is_written_and_ends_with_code_3(face, tmp_path):
    out = tmp_path / "out"
    more = ("--preload", "1e9", "--set", "material.hardness_Pa=1e9")  # more than all of it bears
    ran = run("analyze", face, *more, "--no-render", "--json", "-o", out)
    assert ran.exit_code == 3, ran.output
    assert "error: " in ran.stderr
    assert "Traceback" not in ran.stderr
    summary = json.loads((out / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert summary["hills"]["caps"] == 5
    assert defects(out) == ["status failed"]
    assert 'class="status failed"' in (out / "report.html").read_text()
