"""What each command hands on, says and ends with, without the work between."""

import json
from contextlib import nullcontext
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from capslip.cli import main
from capslip.console import Progress, ending
from capslip.errors import ScanError, SettingsError
from capslip.options import settings_of
from capslip.output.staging import scans_replaced
from capslip.problems import Problem
from capslip.settings import load_settings
from capslip.summary import SCHEMA
from capslip.surface.heightmap import Origin

FAMILIES = ("families", "--m", "3", "--n", "2", "--radius-G", "24", "--radius-P", "26")
FAMILIES += ("--h", "1e-7", "--preload", "100", "--slip-force")


def run(*arguments):
    return CliRunner().invoke(main, [str(one) for one in arguments])


@pytest.mark.parametrize(
    ("option", "given", "setting", "value"),
    [
        ("preload", "3kN", "contact.preload_N", 3000.0),
        ("pressure", "2MPa", "contact.nominal_pressure_Pa", 2e6),
        ("area", "12cm2", "joint.area_m2", 1.2e-3),
        ("friction", 0.15, "material.friction_coefficient", 0.15),
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
    with pytest.raises(SettingsError, match=r"--pressure: got '2'; .* one of Pa, kPa, MPa"):
        settings_of(None, (), False, pressure="2")
    with pytest.raises(SettingsError, match="--area: got '12cm'"):
        settings_of(None, (), False, area="12cm")
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
    for name in ("scene.check_picture", "viewer.check_page"):
        monkeypatch.setattr(f"capslip.output.{name}", lambda *_: None)
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
    for given, shown in (((), DEFAULT), (options, look)):
        assert run("inspect", result, "--html", "a.html", *given).stdout == "a.html\n"
        assert drawn.pop() == ("write_viewer", result, Path("a.html"), shown)
    drawn.clear()
    ran = run("inspect", result, "--html", "a.html", "--screenshot", "a.png")
    assert [name for name, *_ in drawn] == ["save_picture", "write_viewer"]
    assert ran.stdout.splitlines() == ["a.png", "a.html"]


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (("--html", "a.x3p"), "a.x3p: got .x3p; expected .html or .htm"),
        (("--html", "absent/a.html"), "absent/a.html: No such file or directory; give"),
        (("--turntable", "a.jpg"), "a.jpg: got .jpg; expected .png or .gif"),
        (("--turntable", "absent/a.gif"), "absent/a.gif: no such folder"),
    ],
)
def test_inspect_refuses_a_place_before_anything_is_drawn(bad, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("capslip.output.scene.start_render", lambda *_, **__: pytest.fail("drawn"))
    for name in ("scene", "viewer"):
        monkeypatch.setattr(f"capslip.output.{name}.check_result", lambda _: True)
    ran = run("inspect", "a", "--screenshot", "s.png", *bad)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert ran.stderr.startswith(f"error: {said}")
    assert ran.stderr.count("\n") == 1


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


WRITTEN = {"verdict": "usable", "status": "ok", "problems": []}
AS_JSON = json.dumps(WRITTEN, indent=1) + "\n"


@pytest.fixture
def analysed(tmp_path, monkeypatch):
    """Stand for analysis and writing; note what these are given, and how they end."""
    asked = SimpleNamespace(problems=(), missing=None)
    result = SimpleNamespace(name="result", verdict="usable", status="ok")

    def run_one(face, settings, other, progress):
        assert isinstance(progress, Progress)
        asked.one = face.origin.path, settings, other and other.origin.path
        result.problems = asked.problems
        return result

    def run_several(faces, settings):
        asked.several = [one.origin.path for one in faces], settings
        result.problems = asked.problems
        return result

    def write(of, folder, *given, command=None, timings_s=None, export=None, renderer=None,
              progress, missing):  # fmt: skip
        command, timings_s, export = [*given, command, timings_s, export][:3]
        assert of is result
        assert isinstance(progress, Progress)
        assert missing.__func__ is Progress.missing
        if asked.missing is not None:
            missing("energy.png could not be drawn", asked.missing)
        asked.written = folder, command.split()[0], timings_s["read"] >= 0.0, export, renderer
        return WRITTEN

    monkeypatch.setattr("capslip.analysis.analyze", run_one)
    monkeypatch.setattr("capslip.analysis.analyze_scans", run_several)
    monkeypatch.setattr("capslip.output.folder.write", write)
    monkeypatch.setattr("capslip.output.folder.write_joint", write)
    monkeypatch.setattr("capslip.output.terminal.result_lines", lambda of: f"lines of {of.name}")
    monkeypatch.setattr("capslip.output.renderer.ready", lambda wanted: nullcontext(wanted))
    monkeypatch.chdir(tmp_path)
    for i, name in enumerate(("a", "b", "c")):
        np.save(f"{name}.npy", np.arange(12.0).reshape(3, 4) + (i > 0))  # b and c are alike
    return asked


def where(folder):
    return f"\nresults    {folder}\nreport     {folder}/report.html\n"


MANY = "usable with care: 1 is clipped (and {} more); next: scan again"


@pytest.mark.parametrize(
    ("before", "after", "status", "said"),
    [
        (MANY.format(1), MANY.format(3), "check", []),  # warnings of an export are told themselves
        ("usable", MANY.format(1), "check", [f"verdict    {MANY.format(1)}"]),
        ("usable", MANY.format(1), "ok",
         [f"verdict    {MANY.format(1)}", "status     check"]),
        (MANY.format(1), MANY.format(2), "ok", ["status     check"]),
    ],
)  # fmt: skip
def test_a_verdict_is_said_again_where_what_was_written_gave_it_another_reason(
    before, after, status, said
):
    printed = SimpleNamespace(verdict=before, status=status, problems=())
    summary = {"verdict": after, "status": "check", "problems": []}
    told = ending(printed, summary, Path("out"))
    assert told.splitlines() == ["", *said, "results    out", "report     out/report.html"]


def test_a_note_that_came_with_what_was_written_is_told():
    """Of an export: what stood before in the result is on the page, and a warning told itself."""
    known = SimpleNamespace(code="under_resolved")
    printed = SimpleNamespace(verdict="usable", status="ok", problems=(known,))
    problems = [
        {"code": "under_resolved", "severity": "info", "message": "few pixels"},
        {"code": "export_inexact", "severity": "info", "message": "law.py differs by 5 %, 2 µm"},
        {"code": "output_missing", "severity": "warning", "message": "no picture"},
    ]
    summary = {"verdict": "usable", "status": "ok", "problems": problems}
    told = ending(printed, summary, Path("out")).splitlines()
    assert told[1:-2] == ["note       export_inexact: law.py differs by 5 %, 2 um"]


SIZES = ("--unit", "um", "--lateral-unit", "um", "--pixel-size", "1", "2")
AREA = ("--area", "1cm2")  # of the joint of several scans


def test_one_scan_is_analysed_written_and_told(analysed):
    ran = run("analyze", "a.npy", *SIZES, "--mate", "b.npy", "--no-render", "--preload", "3")
    assert ran.exit_code == 0, ran.output
    face, settings, mate = analysed.one
    assert (Path(face).name, Path(mate).name) == ("a.npy", "b.npy")
    assert (settings.contact.preload_N, settings.reading.pixel_size) == (3.0, (1.0, 2.0))
    folder = Path("results/a")
    assert analysed.written == (folder, "capslip", True, None, False)
    assert ran.stdout == f"lines of result\n{where(folder)}"
    assert "reading a.npy" in ran.stderr
    told = run("analyze", "a.npy", *SIZES, "-o", "out", "--json", "--export", "jenkins")
    assert told.stdout == AS_JSON
    assert analysed.written == (Path("out"), "capslip", True, "jenkins", True)
    assert analysed.one[2] is None
    assert run("analyze", "a.npy", *SIZES, "-q").output == ""


def there(folder, **summary):
    """Leave what tells of which scans a result is."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    text = json.dumps({"schema": SCHEMA, "outputs": {"summary.json": ""}, **summary})
    (Path(folder) / "summary.json").write_text(text)


def warned(*arguments):
    ran = run("analyze", *arguments, *SIZES)
    assert ran.exit_code == 0, ran.output
    return [line for line in ran.stderr.splitlines() if line.startswith("warning: ")]


def test_the_result_of_another_scan_is_not_replaced_without_a_word(analysed):
    says = "warning: results/a holds a result of {}, which is replaced; see --out"
    of_b = sha256(Path("b.npy").read_bytes()).hexdigest()
    for surface, said in (
        ({"path": "da/a.npy", "sha256": "0"}, True),
        ({"path": "da/a.npy", "sha256": of_b}, True),
        ({"path": "a.npy", "sha256": "0"}, False),  # measured again
        ({"path": str(Path("a.npy").absolute()), "sha256": "0"}, False),
        ({"path": "moved.npy", "sha256": sha256(Path("a.npy").read_bytes()).hexdigest()}, False),
        ({"path": "a.npy", "sha256": "0", "dataset": "second"}, False),  # this one has no name
        ({"path": None, "sha256": None}, False),
        (None, False),
    ):
        there("results/a", surface=surface)
        expected = [says.format(surface["path"])] if said else []
        assert warned("a.npy", "-q") == expected, surface
        there("out", surface=surface)
        assert warned("a.npy", "-o", "out") == []


def test_a_result_of_other_scans_of_a_joint_is_not_replaced_without_a_word(analysed):
    scans = [{"path": one, "sha256": one} for one in ("b.npy", "a.npy")]
    there("results/a-and-1-more", surface=None, scans=scans)
    assert warned("a.npy", "b.npy", *AREA) == []
    scans += [{"path": one, "sha256": one} for one in ("d.npy", "e.npy")]
    there("results/a-and-1-more", surface=None, scans=scans)
    (line,) = warned("a.npy", "b.npy", *AREA)
    assert "results/a-and-1-more holds a result of d.npy and e.npy, which" in line
    there("out", surface=None, scans=scans)
    assert warned("a.npy", "b.npy", *AREA, "-o", "out") == []


def test_another_map_of_the_same_file_is_another_scan(tmp_path):
    there(tmp_path, surface={"path": "a.gwy", "sha256": "0", "dataset": "first"})
    for dataset, gone in (("first", []), ("second", ["a.gwy"]), (None, [])):
        origin = Origin(path="a.gwy", sha256="0", dataset=dataset)
        assert scans_replaced(tmp_path, [origin]) == gone


def test_several_scans_are_one_joint(analysed):
    ran = run("analyze", "a.npy", "b.npy", *SIZES, *AREA)
    assert ran.exit_code == 0, ran.output
    assert [Path(one).name for one in analysed.several[0]] == ["a.npy", "b.npy"]
    folder = Path("results/a-and-1-more")
    assert analysed.written == (folder, "capslip", True, None, None)
    assert ran.stdout == f"lines of result\n{where(folder)}"
    assert "analysing 2 scans" in ran.stderr
    ran = run(
        "analyze", "a.npy", "b.npy", *SIZES, *AREA, "-o", "out", "--json", "--export", "jenkins"
    )
    assert (ran.stdout, analysed.written[0]) == (AS_JSON, Path("out"))
    assert analysed.written[3] == "jenkins"
    assert run("analyze", "a.npy", "b.npy", *SIZES, *AREA, "-q").output == ""
    alike = run("analyze", "a.npy", "b.npy", "c.npy", *SIZES, *AREA)
    assert alike.exit_code == 2
    assert "c.npy: holds what " in alike.stderr
    mated = run("analyze", "a.npy", "b.npy", *SIZES, *AREA, "--mate", "c.npy")
    assert mated.exit_code == 2
    assert "--mate: got 2 scans" in mated.stderr


@pytest.mark.parametrize("scans", [("a.npy",), ("a.npy", "b.npy", *AREA)])
def test_an_error_in_a_result_or_a_part_that_is_missing_ends_with_its_code(scans, analysed):
    note = Problem("one_family", "info", "noted")
    analysed.problems = (note, Problem("no_caps", "error", "nothing stands"))
    ran = run("analyze", *scans, *SIZES, "-o", "out")
    assert ran.exit_code == 3
    (said,) = [line for line in ran.stderr.splitlines() if line.startswith("error: ")]
    assert said.startswith("error: a.npy: nothing" if len(scans) == 1 else "error: nothing stands")
    assert "; next: " in said
    assert said.endswith("; what was found before is in out")
    analysed.problems = (note, Problem("spikes", "warning", "so"))
    assert run("analyze", *scans, *SIZES).exit_code == 0
    for error, code in ((ScanError("no ink"), 3), (KeyError("ink"), 1)):
        analysed.missing = error
        ran = run("analyze", *scans, *SIZES, "-o", "out")
        assert ran.exit_code == code
        assert "energy.png could not be drawn; all numbers are in out" in ran.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--preload", "400N", "--set", "contact.preload_N=800"),
            "contact.preload_N: got 800 and 400.0; the last counts, 400.0",
        ),
        (
            ("--set", "slip.direction_rad=0", "--set", "slip.direction_rad=1"),
            "slip.direction_rad: got 0 and 1; the last counts, 1",
        ),
        (("--preload", "400N", "--set", "contact.preload_N=400"), None),
        (("--set", "slip.direction_rad=0", "--set", "contact.preload_N=1"), None),
    ],
)
def test_a_setting_that_is_given_twice_is_told_in_one_line(analysed, words, said):
    assert warned("a.npy", *words) == ([] if said is None else [f"warning: {said}"])
    asked = dict(zip(words[::2], words[1::2], strict=True))
    if "--preload" in asked:
        assert analysed.one[1].contact.preload_N == 400.0


def test_a_model_that_slips_as_a_whole_exports_no_sliders(analysed):
    ran = run("analyze", "a.npy", *SIZES, "--export", "jenkins", "--model", "flat")
    assert ran.exit_code == 2
    assert "contact.model is flat, which slips only as a whole" in ran.stderr
    assert run("analyze", "a.npy", *SIZES, "--export", "jenkins", "--model", "caps").exit_code == 0


def test_a_study_is_told_as_text_or_as_numbers(monkeypatch):
    asked, numbers = [], {"table1": [{"relative_error": -2e-3}, {"relative_error": 1e-3}]}
    numbers["errata"] = [1, 2, 3]
    studies = "capslip.studies"
    paper = f"{studies}.paper.reproduce.reproduce"
    monkeypatch.setattr(paper, lambda *of: asked.append(of) or numbers)
    monkeypatch.setattr(f"{studies}.bench.study.run_bench", lambda *of: asked.append(of) or [5])
    monkeypatch.setattr(f"{studies}.bench.study.bench_markdown", lambda of: f"| {of[0]} |")
    monkeypatch.setattr(f"{studies}.chart.study.chart", lambda *of: asked.append(of) or [6])
    monkeypatch.setattr(f"{studies}.limits.study.limits", lambda *of: asked.append(of) or [7])
    monkeypatch.setattr(f"{studies}.limits.text.limits_lines", lambda of: f"line {of[0]}")
    said = {
        "reproduce": "table 1    2 loads within 0.20 %\nerrata     3\n"
        "page       {0}/reproduce.html",
        "bench": "| 5 |",
        "chart": "chart      {0}/speed-accuracy.md",
        "limits": "line 7\nlimits           {0}/limits.md",
    }
    for command, text in said.items():
        for folder, options in ((f"results/{command}", ()), ("out", ("-o", "out"))):
            assert run(command, *options).stdout == f"{text.format(folder)}\n"
            assert asked[-1][0] == Path(folder)
        assert run(command, "--json").stdout[0] in "[{"
        assert run(command, "-q").stdout == ""
    assert run("chart", "--scans", "x", "-q").exit_code == 0
    assert asked[-1][1] == Path("x")
    assert run("limits", "--workers", "3", "-q").exit_code == 0
    assert asked[-1][2] == 3
