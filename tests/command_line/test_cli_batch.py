"""Many scans: a bad one is named and never the end of the rest; done work is kept."""

import csv
import json
import os
import shutil
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from batch_cases import in_this_process, scan
from click.testing import CliRunner

from capslip import workers
from capslip.batch import analyse_scan, run_batch
from capslip.cli import main
from capslip.output import report
from capslip.output.staging import new_folder, read_summary
from capslip.settings import load_settings


@pytest.fixture(scope="module")
def batch(tmp_path_factory):
    folder = tmp_path_factory.mktemp("batch")
    scans = folder / "scans in"
    scans.mkdir()
    scan(scans / "one.h5", 1)
    scan(scans / "two.h5", 2)
    (scans / "bad.x3p").write_bytes(b"PK\x03\x04 not really")
    (scans / ".DS_Store").write_bytes(b"hidden")
    np.save(scans / "one.npy", np.zeros((3, 3)))  # no unit, and the stem of another
    arguments = ["batch", str(scans), "-o", str(folder / "out"), "--no-figures", "--no-render"]
    arguments += ["--model", "caps"]
    first = CliRunner().invoke(main, arguments)
    return folder, arguments, first


def rows(folder):
    with (folder / "out" / "batch.csv").open() as file:
        return {row["scan"]: row for row in csv.DictReader(file)}


@pytest.mark.long
def test_every_scan_has_a_row(batch):
    folder, _, first = batch
    assert first.exit_code == 3, first.output
    table = rows(folder)
    assert set(table) == {"one.h5", "one.npy", "two", "bad"}
    assert table["bad"]["status"] == "failed"
    assert "bad.x3p" in table["bad"]["error"]
    assert "--unit" in table["one.npy"]["error"]
    assert table["two"]["status"] in ("ok", "check")
    assert float(table["two"]["answer_joint_loss_factor"]) > 0
    assert "bad.x3p" in (folder / "out" / "index.html").read_text()
    assert first.stdout.splitlines()[-1] == f"page       {folder / 'out' / 'index.html'}"


@pytest.mark.usefixtures("here")
def test_two_folders_with_one_name_do_not_lose_a_result_without_a_word(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for seed, name in enumerate(("da", "db")):
        Path(name).mkdir()
        scan(Path(name, "face.h5"), seed)
    light = ("--no-figures", "--no-render", "--no-meshes", "--model", "caps", "-q")
    said = []
    for name in ("da", "da", "db", "db", "da"):
        ran = CliRunner().invoke(main, ["batch", name, *light])
        assert ran.exit_code == 0, ran.output
        said.append(ran.stderr)
    line = "warning: results/batch/scans/face holds a result of {}, which is replaced; see --out\n"
    to_b, to_a = (line.format(Path(name, "face.h5").absolute()) for name in ("da", "db"))
    assert said == ["", "", to_b, "", to_a]


@pytest.mark.usefixtures("here")
def test_done_work_is_kept_and_the_rest_done_again(batch):
    folder, arguments, _ = batch
    before = {
        path: path.stat().st_mtime_ns for path in (folder / "out" / "scans").glob("*/summary.json")
    }
    assert len(before) == 2
    old = rows(folder)
    assert CliRunner().invoke(main, arguments).exit_code == 3
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert rows(folder) == old
    # other settings are other work
    assert CliRunner().invoke(main, [*arguments, "--preload", "100"]).exit_code == 3
    assert all(path.stat().st_mtime_ns > time for path, time in before.items())
    assert rows(folder)["two"]["preload_N"] == "100.0"


@pytest.mark.usefixtures("here")
def test_all_good_scans_end_with_code_0(batch, tmp_path):
    folder, arguments, _ = batch
    (tmp_path / "in").mkdir()
    shutil.copy(folder / "scans in" / "two.h5", tmp_path / "in")
    ran = CliRunner().invoke(
        main, ["batch", str(tmp_path / "in" / "*.h5"), "-o", str(tmp_path / "out"), *arguments[4:]]
    )
    assert ran.exit_code == 0, ran.output


@pytest.mark.usefixtures("here")
def test_a_pressure_map_that_changed_is_named_and_done_again(batch, tmp_path):
    folder, arguments, _ = batch
    pressures, source = tmp_path / "p.csv", str(folder / "scans in" / "two.h5")
    pressures.write_text("pressure_Pa,area_m2\n1e6,2e-5\n")
    options = [*arguments[4:], "--set", f"joint.pressure_map={pressures}"]
    command = ["batch", source, "-o", str(tmp_path / "out"), *options]
    assert CliRunner().invoke(main, command).exit_code == 0
    pressures.write_text("pressure_Pa,area_m2\n3e6,2e-5\n")
    looked = CliRunner().invoke(main, [*command, "--dry-run"]).output
    assert "the result there is of other settings, what joint.pressure_map holds\n" in looked
    CliRunner().invoke(main, command)
    assert float(rows(tmp_path)["two"]["preload_N"]) == pytest.approx(60.0)


@pytest.mark.long
@pytest.mark.usefixtures("here")
def test_pictures_that_were_left_out_are_made_when_wanted(batch, tmp_path):
    folder, _, _ = batch
    (tmp_path / "in").mkdir()
    shutil.copy(folder / "scans in" / "two.h5", tmp_path / "in")
    source = ["batch", str(tmp_path / "in"), "-o", str(tmp_path / "out"), "--no-render"]
    assert CliRunner().invoke(main, [*source, "--no-figures"]).exit_code == 0
    summary = tmp_path / "out" / "scans" / "two" / "summary.json"
    assert CliRunner().invoke(main, source).exit_code == 0
    assert (summary.parent / "figures" / "height_map.png").is_file()
    written = summary.stat().st_mtime_ns
    assert CliRunner().invoke(main, [*source, "--no-figures"]).exit_code == 0
    assert summary.stat().st_mtime_ns == written


@pytest.mark.usefixtures("here")
def test_a_batch_of_numbers_alone_has_the_same_numbers_and_no_pages(batch, tmp_path):
    folder, arguments, _ = batch
    source, light = str(folder / "scans in" / "two.h5"), arguments[4:]
    found, files = [], []
    for name, options in (("with", ()), ("without", ("--no-meshes",))):
        out = tmp_path / name
        ran = CliRunner().invoke(main, ["batch", source, "-o", str(out), *light, *options])
        assert ran.exit_code == 0, ran.output
        files.append({one.name for one in (out / "scans" / "two").iterdir() if one.is_file()})
        found.append(read_summary(out / "scans" / "two"))
        for key in ("timings_s", "provenance", "outputs"):
            del found[-1][key]
    assert files[1] == {"summary.json", "result.h5", "caps.csv", "settings.toml"}
    assert files[0] - files[1] == {"report.html", "surface.vtu", "caps.vtu"}
    assert found[0] == found[1]


def again(*_):
    return {"status": "failed", "error": "done again"}


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("picture", ["figures", "render", "meshes"])
def test_either_kind_of_picture_that_is_wanted_is_made(batch, tmp_path, picture):
    folder, arguments, _ = batch
    source = str(folder / "scans in" / "two.h5")
    arguments = ["batch", source, "-o", str(tmp_path / "out"), *arguments[4:]]
    assert CliRunner().invoke(main, [*arguments, "--no-meshes"]).exit_code == 0
    assert not list((tmp_path / "out").glob("scans/two/*.vtu"))
    wanted = {"figures": "false", "render": "false", "meshes": "false", picture: "true"}
    texts = [f"run.{name}={value}" for name, value in wanted.items()]
    settings = load_settings(overrides=[*texts, "contact.model=caps"])
    (row,) = run_batch([source], tmp_path / "out", settings, lambda _: None, work=again)
    assert row["error"] == "done again"
    texts = [f"run.{name}=false" for name in wanted]
    settings = load_settings(overrides=[*texts, "contact.model=caps"])
    (row,) = run_batch([source], tmp_path / "out", settings, lambda _: None, work=again)
    assert row["error"] is None


@pytest.mark.usefixtures("here")
def test_an_analysis_that_fails_is_counted_and_keeps_its_numbers(batch, tmp_path):
    folder, arguments, _ = batch
    (tmp_path / "in").mkdir()
    shutil.copy(folder / "scans in" / "two.h5", tmp_path / "in")
    arguments = ["batch", str(tmp_path / "in"), "-o", str(tmp_path / "out"), *arguments[4:]]
    more = ["--preload", "1e9", "--set", "material.hardness_Pa=1e9"]  # more than all of it bears
    more += ["--model", "auto"]
    for _ in range(2):  # done, and found done
        ran = CliRunner().invoke(main, [*arguments, *more])
        assert ran.exit_code == 3
        assert "1 of 1 scans failed" in ran.stderr
        row = rows(tmp_path)["two"]
        assert row["status"] == "failed"
        assert row["caps"] == "3"
        assert "more than all of the face bears" in row["error"]
        assert row["folder"] == "scans/two"
        assert (tmp_path / "out" / "scans" / "two" / "summary.json").is_file()


def call(arguments, work, monkeypatch):
    """Call the command line with another function for the workers."""
    monkeypatch.setattr("capslip.batch.run_batch", partial(run_batch, work=work))
    return CliRunner().invoke(main, arguments)


def without_report(scan, folder, *others):
    def fail(*_):
        raise KeyError("no such colour")

    report.write_report = fail  # in the worker
    return analyse_scan(scan, folder, *others)


@pytest.mark.long
def test_a_result_that_lacks_a_part_keeps_its_row_and_is_told(batch, tmp_path, monkeypatch):
    folder, arguments, _ = batch
    source = str(folder / "scans in" / "two.h5")
    arguments = ["batch", source, "-o", str(tmp_path / "out"), *arguments[4:]]
    ran = call(arguments, without_report, monkeypatch)
    assert ran.exit_code == 1, ran.output
    assert "1 of 1 results lack a part" in ran.stderr
    row = rows(tmp_path)["two"]
    assert row["status"] == "check"
    assert row["error"] == "report.html could not be made: KeyError: 'no such colour'"
    assert row["problems"].split()[-1] == "output_missing"
    assert float(row["answer_joint_loss_factor"]) > 0
    # what is missing is made when it can be
    with in_this_process():
        ran = call(arguments, analyse_scan, monkeypatch)
    assert ran.exit_code == 0, ran.output
    assert (tmp_path / "out" / "scans" / "two" / "report.html").is_file()


def ends_its_worker(scan, folder, *others):
    if scan.name == "two":
        os._exit(1)
    return analyse_scan(scan, folder, *others)


@pytest.mark.long
def test_a_scan_that_kills_its_worker_is_named_and_the_only_one(batch, tmp_path, monkeypatch):
    _, arguments, _ = batch
    scans = tmp_path / "in"
    scans.mkdir()
    for seed, name in enumerate(("one", "two", "three", "four")):
        scan(scans / f"{name}.h5", seed)
    arguments = ["batch", str(scans), "-o", str(tmp_path / "out"), *arguments[4:]]
    arguments += ["--set", "run.workers=2"]
    ran = call(arguments, ends_its_worker, monkeypatch)
    assert ran.exit_code == 3, ran.output
    assert "1 of 4 scans failed" in ran.stderr
    table = rows(tmp_path)
    assert table["two"]["status"] == "failed"
    assert "was ended" in table["two"]["error"]
    assert {table[name]["status"] for name in ("one", "three", "four")} <= {"ok", "check"}
    before = (tmp_path / "out" / "scans" / "one" / "summary.json").stat().st_mtime_ns
    with in_this_process():
        assert call(arguments, analyse_scan, monkeypatch).exit_code == 3  # unless it is asked for
        assert call([*arguments, "--retry-failed"], analyse_scan, monkeypatch).exit_code == 0
    assert (tmp_path / "out" / "scans" / "one" / "summary.json").stat().st_mtime_ns == before


def dies_once(scan, folder, *others):
    mark = folder.parent.parent.parent / f"{scan.name}.died"
    if not mark.exists():
        mark.touch()
        os._exit(1)
    return analyse_scan(scan, folder, *others)


@pytest.mark.long
def test_a_scan_that_needs_the_machine_to_itself_gets_it(batch, tmp_path, monkeypatch):
    folder, arguments, _ = batch
    source = str(folder / "scans in" / "two.h5")
    ran = call(
        ["batch", source, "-o", str(tmp_path / "out"), *arguments[4:]], dies_once, monkeypatch
    )
    assert ran.exit_code == 0, ran.output
    assert (tmp_path / "two.died").exists()
    assert rows(tmp_path)["two"]["error"] == ""


def one_waits(scan, folder, *_):
    os.write(1, b"noise")
    os.write(2, b"noise")
    if scan.name == "two":
        with new_folder(folder):
            (folder.parent / "under way").touch()
            time.sleep(120)
    while not (folder.parent / "under way").exists():
        time.sleep(0.01)
    return {"status": "failed", "error": "quick"}


@pytest.mark.long
def test_an_interrupt_ends_the_workers_and_leaves_no_folder(batch, tmp_path, capfd):
    folder, _, _ = batch

    def interrupt(_):
        raise KeyboardInterrupt

    settings = load_settings(overrides=("run.workers=2",))
    sources = [str(folder / "scans in" / name) for name in ("one.h5", "two.h5")]
    started = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        run_batch(sources, tmp_path / "out", settings, interrupt, work=one_waits)
    assert time.monotonic() - started < 60
    assert not workers._children
    assert [entry.name for entry in (tmp_path / "out" / "scans").iterdir()] == ["under way"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.long
@pytest.mark.usefixtures("here")
def test_a_row_holds_the_numbers_of_the_summary(batch, tmp_path):
    folder, _, _ = batch
    source = str(folder / "scans in" / "two.h5")
    light = ("--no-figures", "--no-render")  # by the model of itself, whose interval is known
    ran = CliRunner().invoke(main, ["batch", source, "-o", str(tmp_path / "out"), *light])
    assert ran.exit_code == 0, ran.output
    row = rows(tmp_path)["two"]
    summary = json.loads((tmp_path / "out" / "scans" / "two" / "summary.json").read_text())
    assert summary["answer"]["interval"] is not None
    slip, damping, families = summary["slip"], summary["damping"], summary["families"]
    answer = summary["answer"]
    expected = {
        "caps": summary["hills"]["caps"],
        "m": families["m"],
        "n": families["n"],
        "h_m": families["h_m"],
        "radius_G_m": (families["G"] or {}).get("radius_m"),
        "radius_P_m": (families["P"] or {}).get("radius_m"),
        "model": summary["contact"]["model"],
        "preload_N": summary["contact"]["preload_N"],
        "nominal_pressure_Pa": summary["contact"]["nominal_pressure_Pa"],
        "coverage": summary["contact"]["coverage"],
        "approach_m": summary["contact"]["approach_m"],
        "first_loading_approach_m": summary["contact"]["first_loading_approach_m"],
        "contacts": summary["contact"]["contacts"],
        "tangential_stiffness_N_per_m": slip["tangential_stiffness_N_per_m"],
        "answer_force_N": answer["slip_force_N"],
        "answer_displacement_m": answer["displacement_m"],
        "answer_stiffness_N_per_m": answer["tangential_stiffness_N_per_m"],
        "answer_energy_J": answer["energy_J"],
        "answer_joint_loss_factor": answer["joint_loss_factor"],
        "answer_loss_factor": answer["loss_factor"],
        "answer_total_loss_factor": answer["total_loss_factor"],
        **{
            f"answer_{stem}_{end}{unit}": (answer["interval"] or {}).get(name, (None, None))[i]
            for name, stem, unit in (
                ("tangential_stiffness_N_per_m", "stiffness", "_N_per_m"),
                ("energy_J", "energy", "_J"),
                ("joint_loss_factor", "joint_loss_factor", ""),
                ("loss_factor", "loss_factor", ""),
            )
            for i, end in enumerate(("low", "high"))
        },
        "structure": damping["structure"],
        "peak_loss_factor": damping["peak_loss_factor"],
        "amplitude_at_peak_m": damping["amplitude_at_peak_m"],
        "gross_slip_amplitude_m": damping["gross_slip_amplitude_m"],
        "verdict": summary["verdict"],
        "problems": " ".join(one["code"] for one in summary["problems"]),
        "folder": "scans/two",
        "status": summary["status"],
        "error": None,
        "path": str(folder / "scans in" / "two.h5"),
        "mate": None,
        "group": None,
        "scan": "two",
    }
    assert row == {key: "" if one is None else str(one) for key, one in expected.items()}
    # What follows is what the test runner was called with: nothing, or its own arguments
    assert summary["provenance"]["command"].split()[0] == "capslip"
    assert 0 < summary["timings_s"]["read"] < summary["timings_s"]["total"] < 600


@pytest.mark.usefixtures("here")
def test_a_result_of_something_else_is_not_kept(batch, tmp_path):
    folder, arguments, _ = batch
    (tmp_path / "in").mkdir()
    face = shutil.copy(folder / "scans in" / "two.h5", tmp_path / "in")
    arguments = ["batch", str(face), "-o", str(tmp_path / "out"), *arguments[4:]]
    assert CliRunner().invoke(main, arguments).exit_code == 0
    path = tmp_path / "out" / "scans" / "two" / "summary.json"
    for change in ("bytes", "version", "settings"):
        if change == "bytes":
            scan(face, 7)
        elif change == "version":
            summary = json.loads(path.read_text())
            summary["provenance"]["version"] = "0.0.1"
            path.write_text(json.dumps(summary))
        else:
            arguments += ["--set", "material.friction_coefficient=0.3"]
        before = path.stat().st_mtime_ns
        assert CliRunner().invoke(main, arguments).exit_code == 0
        assert path.stat().st_mtime_ns > before, change


def test_a_folder_of_someone_else_is_refused(batch, tmp_path):
    folder, arguments, _ = batch
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("years of work")
    ran = CliRunner().invoke(
        main, ["batch", str(folder / "scans in"), "-o", str(tmp_path / "out"), *arguments[4:]]
    )
    assert ran.exit_code == 2
    assert "thesis.tex" in ran.stderr
    assert [entry.name for entry in (tmp_path / "out").iterdir()] == ["thesis.tex"]


def test_a_folder_that_cannot_be_made_is_told_as_by_the_other_commands(
    batch, tmp_path, monkeypatch
):
    folder, _, _ = batch
    face, out = str(folder / "scans in" / "two.h5"), "output folder"
    (tmp_path / "file").write_text("mine")
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    for at, says in (
        (tmp_path / "file", "is a file"),
        (tmp_path / "file" / "in", "Not a directory"),
        (tmp_path / ("y" * 300), "File name too long"),
        ("out", "No such file or directory"),
    ):
        told = [
            CliRunner().invoke(main, [one, face, "-o", str(at)]) for one in ("analyze", "batch")
        ]
        assert [one.exit_code for one in told] == [2, 2]
        line = f"error: {out} {at}: {says}; choose another with --out"
        assert told[1].stderr.splitlines() == [line]
        assert out in told[0].stderr
    ran = CliRunner().invoke(main, ["batch", face, "-o", "out", "--dry-run"])
    assert (ran.exit_code, ran.stderr.splitlines()) == (2, [line])
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_a_folder_in_which_nothing_can_be_made_is_told(batch, tmp_path, monkeypatch):
    folder, _, _ = batch
    mkdir = Path.mkdir

    def refused(path, *given, **how):
        if path.name == "scans":
            raise PermissionError(13, "Permission denied", str(path))
        mkdir(path, *given, **how)

    monkeypatch.setattr(Path, "mkdir", refused)
    ran = CliRunner().invoke(
        main, ["batch", str(folder / "scans in" / "two.h5"), "-o", str(tmp_path)]
    )
    assert ran.exit_code == 2
    says = f"output folder {tmp_path}: Permission denied; choose another with --out"
    assert ran.stderr.splitlines() == [f"error: {says}"]
