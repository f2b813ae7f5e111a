"""What a batch keeps, says and ends with, part by part and without an analysis."""

import csv
import hashlib
import json
import os
import sys
import threading
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import tomli_w
from batch_cases import in_this_process
from click.testing import CliRunner

from capslip import batch
from capslip.batch import LOST, Options, _Found, run_batch
from capslip.cli import main
from capslip.errors import OutputError, UnreadableFileError
from capslip.output.overview import COLUMNS
from capslip.output.staging import READY, new_folder, summary_text, with_digests
from capslip.provenance import code_sha256
from capslip.settings import load_settings
from capslip.sources import Scan
from capslip.summary import SCHEMA
from capslip.surface.readers import faces
from capslip.workers import NO_LIMITS, Limits, Lost

SETTINGS = load_settings(overrides=("run.workers=2",))
OK = {"status": "ok", "error": None, "verdict": "usable"}
CHECK = OK | {"status": "check"}
FAILED = {"status": "failed", "error": "said"}
LACKS = OK | {"error": "no picture"}
TO_DO = {"status": "to do", "error": None}


def ended(rows, monkeypatch, *options):
    """Run the command on rows that are there already; return how it ended, and what was asked."""
    asked = {}

    def found(sources, folder, settings, say, command, options):
        assert callable(say)
        assert command == "capslip batch in"
        asked.update(sources=sources, folder=folder, settings=settings, options=options)
        return [{"scan": f"s{i}"} | row for i, row in enumerate(rows)]

    monkeypatch.setattr(batch, "run_batch", found)
    monkeypatch.setattr(sys, "argv", ["/bin/capslip", "batch", "in"])
    return CliRunner().invoke(main, ["batch", "in", *options]), asked


LEFT, BAD, PART = "are still to be done", "scans failed; see batch.csv", "results lack a part"


@pytest.mark.parametrize(
    ("rows", "options", "code", "said"),
    [
        ([OK, CHECK], (), 0, []),
        ([OK, FAILED, FAILED], (), 3, [f"2 of 3 {BAD}"]),
        ([TO_DO, OK], ("--collect",), 3, [f"1 of 2 scans {LEFT}"]),
        ([TO_DO, FAILED, OK], ("--collect",), 3, [f"1 of 3 scans {LEFT}", f"1 of 3 {BAD}"]),
        ([TO_DO, FAILED, LACKS], ("--dry-run",), 0, [f"1 of 3 scans {LEFT}", f"1 of 3 {BAD}"]),
        ([OK, LACKS, OK], (), 1, [f"1 of 3 {PART}"]),
        ([LACKS, FAILED], (), 3, [f"1 of 2 {BAD}"]),
        ([LACKS, TO_DO], (), 3, [f"1 of 2 scans {LEFT}"]),
    ],
)
def test_a_batch_ends_with_the_code_of_its_worst_row(rows, options, code, said, monkeypatch):
    ran, _ = ended(rows, monkeypatch, *options)
    assert ran.exit_code == code, ran.output
    warned = [line for line in ran.stderr.splitlines() if line.startswith("warning: ")]
    assert len(warned) == len(said)
    assert all(text in line for text, line in zip(said, warned, strict=True))
    lines = [f"{one['status']:7} s{i}  {one['error'] or ''}".rstrip() for i, one in enumerate(rows)]
    assert ran.stdout.splitlines() == lines


def test_the_page_of_a_batch_is_named_where_there_is_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for out, options in (("out", ("-o", "out")), ("results/batch", ())):
        assert ended([OK], monkeypatch, *options)[0].stdout.splitlines() == ["ok      s0"]
        Path(out).mkdir(parents=True)
        (Path(out) / "index.html").touch()
        ran, asked = ended([OK], monkeypatch, *options)
        assert ran.stdout.splitlines()[1:] == ["", f"page       {Path(out) / 'index.html'}"]
        assert asked["folder"] == Path(out)


def test_every_option_of_a_batch_comes_to_its_place(monkeypatch):
    options = ("--list", "l.txt", "--recursive", "--timeout", "5", "--memory", "2.5")
    options += ("--shard", "2/3", "--retry-failed", "--max-failures", "4", "--scheduler", "tcp://x")
    _, asked = ended([], monkeypatch, *options, "--workers", "7", "--preload", "3N")
    assert asked["options"] == Options(
        list_file=Path("l.txt"),
        recursive=True,
        shard=(2, 3),
        look=None,
        retry_failed=True,
        max_failures=4,
        limits=Limits(5.0, 2_500_000_000),
        scheduler="tcp://x",
    )
    assert asked["sources"] == ("in",)
    assert (asked["settings"].run.workers, asked["settings"].contact.preload_N) == (7, 3.0)
    assert ended([], monkeypatch)[1]["options"] == Options()
    for look in ("dry_run", "collect"):
        _, asked = ended([], monkeypatch, f"--{look.replace('_', '-')}")
        assert asked["options"] == Options(look=look)


@pytest.mark.parametrize(("given", "most_bytes"), [("1e300", 10**18), ("1e-10", 1), ("4e-9", 4)])
def test_any_memory_is_a_limit_however_much_or_little(monkeypatch, given, most_bytes):
    _, asked = ended([], monkeypatch, "--memory", given)
    assert asked["options"].limits == Limits(None, most_bytes)


def test_rows_are_numbers_on_request_and_warnings_are_never_silent(monkeypatch):
    ran, _ = ended([OK, FAILED], monkeypatch, "--json")
    assert [row["status"] for row in json.loads(ran.stdout)] == ["ok", "failed"]
    ran, _ = ended([OK, FAILED], monkeypatch, "-q")
    assert (ran.exit_code, ran.stdout) == (3, "")
    assert "1 of 2 scans failed" in ran.stderr


def scans_of(folder, n):
    folder.mkdir()
    for i in range(n):
        (folder / f"s{i}.h5").write_bytes(b"no scan")
    return [str(folder)]


def quick(scan, home, command, again):
    """Stand for an analysis."""
    assert (home.name, command, again) == (scan.name, None, False)
    return {"status": "failed" if scan.name in ("s1", "s2") else "ok", "error": None}


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("most", "n_rows"), [(None, 5), (3, 5), (2, 3), (1, 2)])
def test_a_batch_stops_at_the_failures_that_are_too_many(most, n_rows, tmp_path):
    told = []
    settings = load_settings(overrides=("run.workers=1",))
    options = Options(max_failures=most)
    sources = scans_of(tmp_path / "in", 5)
    rows = run_batch(sources, tmp_path / "out", settings, told.append, None, options, quick)
    assert [row["scan"] for row in rows] == [f"s{i}" for i in range(5)]
    done = ["ok", "failed", "failed", "ok", "ok"][:n_rows]
    assert [row["status"] for row in rows] == [*done, *["to do"] * (5 - n_rows)]
    with (tmp_path / "out" / "batch.csv").open() as file:
        assert [row["status"] for row in csv.DictReader(file)] == [row["status"] for row in rows]
    stopped = f"stopped after {most} failures; {5 - n_rows} scans are left"
    assert (stopped in told) == (n_rows < 5)
    assert told[:2] == ["1 of 5: s0: ok", "2 of 5: s1: failed"]


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("asked", "cores", "n"), [(2, 3, 2), (0, 3, 3), (0, None, 1)])
def test_a_batch_has_the_workers_that_were_asked_for_or_one_a_core(
    asked, cores, n, tmp_path, monkeypatch
):
    crews = []
    crew = batch.crew
    monkeypatch.setattr(batch, "crew", lambda workers: crews.append(workers) or crew(workers))
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    settings = load_settings(overrides=(f"run.workers={asked}",))
    sources = scans_of(tmp_path / "in", 2)
    rows = run_batch(sources, tmp_path / "out", settings, lambda _: None, work=quick)
    assert [row["status"] for row in rows] == ["ok", "failed"]
    assert crews == [n]


def test_one_part_of_a_batch_is_every_third_scan_and_writes_no_table(tmp_path, monkeypatch):
    turn, done = threading.Lock(), []

    def call(work, arguments, limits):
        with turn:
            done.append(arguments[0].name)
            return work(*arguments)

    monkeypatch.setattr("capslip.workers.in_child", call)
    sources, out = scans_of(tmp_path / "in", 7), tmp_path / "out"
    parts = []
    for part in (1, 2, 3):
        options = Options(shard=(part, 3))
        rows = run_batch(sources, out, SETTINGS, lambda _: None, None, options, quick)
        parts.append([row["scan"] for row in rows])
    assert parts == [["s0", "s3", "s6"], ["s1", "s4"], ["s2", "s5"]]
    assert sorted(done) == sorted(f"s{i}" for i in range(7))
    assert not (out / "batch.csv").exists()
    assert not (out / "index.html").exists()


def there(out, name, path, sha256, **more):
    """Leave what tells of which scan a result is; its settings are others."""
    home = out / "scans" / name
    home.mkdir(parents=True, exist_ok=True)
    surface = {"path": str(path), "sha256": sha256, **more}
    summary = {"schema": SCHEMA, "provenance": {"settings_sha256": "0"}, "surface": surface}
    (home / "summary.json").write_text(json.dumps(summary))


def warned(sources, out, settings=SETTINGS, **options):
    """Return what a batch warns of, and says, before its first scan is done."""
    warnings, said = [], []
    options = Options(warn=warnings.append, **options)
    run_batch(sources, out, settings, said.append, None, options, lambda *_: FAILED)
    return warnings, said


NO_SCAN = hashlib.sha256(b"no scan").hexdigest()


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("path", "sha256", "more", "others"),
    [
        ("da/s0.h5", "0", {}, True),
        ("in/s0.h5", "0", {}, False),  # measured again
        ("moved.h5", NO_SCAN, {}, False),
        ("in/s0.h5", NO_SCAN, {"dataset": "second"}, False),  # this one has no name
    ],
)
def test_the_result_of_another_scan_gives_way_to_none_without_a_word(
    path, sha256, more, others, tmp_path
):
    sources, out = scans_of(tmp_path / "in", 2), tmp_path / "out"
    path = tmp_path / path
    there(out, "s0", path, sha256, **more)
    line = f"{out / 'scans' / 's0'} holds a result of {path}, which is replaced; see --out"
    assert warned(sources, out)[0] == ([line] if others else [])
    for look in ("dry_run", "collect"):  # which replace nothing
        assert warned(sources, out, look=look)[0] == []
    told = []
    run_batch(sources, out, SETTINGS, told.append, work=lambda *_: FAILED)
    assert told[: len(told) - 2] == ([line] if others else [])


@pytest.mark.usefixtures("here")
def test_results_of_many_other_scans_give_way_with_one_line(tmp_path):
    sources, out = scans_of(tmp_path / "in", 3), tmp_path / "out"
    for i in range(3):
        there(out, f"s{i}", tmp_path / f"da/s{i}.h5", str(i))
    first = f"{out / 'scans' / 's0'} holds a result of {tmp_path / 'da/s0.h5'}"
    line = f"{first}, and so on: results of 3 other scans are replaced; see --out"
    assert warned(sources, out)[0] == [line]
    warnings, said = warned(sources, out, shard=(1, 3))  # its own alone
    assert warnings == [f"{first}, which is replaced; see --out"]
    assert not any("replaced" in one for one in said)


@pytest.mark.usefixtures("here")
def test_results_that_the_table_leaves_out_are_counted(tmp_path):
    """Two calls with other scans each: the second table forgets the first ones."""
    out, told = tmp_path / "out", []

    def done(*sources, **options):
        told.clear()
        run_batch(sources, out, SETTINGS, told.append, None, Options(**options), lambda *_: FAILED)
        with (out / "batch.csv").open(newline="") as file:
            return [row["scan"] for row in csv.DictReader(file)]

    scans_of(tmp_path / "in", 3)
    scans = [str(tmp_path / "in" / f"s{i}.h5") for i in range(3)]
    for i, name in ((1, "summary.json"), (2, "failure.json")):
        (out / "scans" / f"s{i}").mkdir(parents=True)
        (out / "scans" / f"s{i}" / name).write_text("{}")
    (out / "scans" / "empty").mkdir()
    assert done(scans[0], scans[1]) == ["s0", "s1"]
    line = f"{out} holds what came of another scan (s2), which batch.csv and index.html do not list"
    assert told[-1] == f"{line}; to list all, name the sources of all with --collect"
    assert done(scans[0]) == ["s0"]
    assert told[-1] == line.replace("another scan (s2)", "2 other scans (s1 and so on)") + (
        "; to list all, name the sources of all with --collect"
    )
    for options in ({"look": "collect"}, {}):
        assert done(*scans, **options) == ["s0", "s1", "s2"]
        assert not any("holds what came" in one for one in told)
    assert done(scans[0], shard=(1, 1)) == ["s0", "s1", "s2"]  # which writes none
    assert not any("holds what came" in one for one in told)


def test_a_dry_run_says_that_nothing_was_done(monkeypatch, tmp_path):
    (tmp_path / "index.html").write_text("older")
    ran, _ = ended([TO_DO, FAILED], monkeypatch, "--dry-run", "-o", str(tmp_path))
    assert "index.html" not in ran.stdout  # it does not show what was asked
    assert ran.stderr.splitlines() == [
        "warning: 1 of 2 scans are still to be done; nothing was done",
        "warning: 1 of 2 scans failed; see batch.csv; --retry-failed does them again",
    ]


@pytest.mark.usefixtures("here")
def test_another_map_of_the_same_file_gives_way_with_a_word(tmp_path):
    sources, out = scans_of(tmp_path / "in", 1), tmp_path / "out"
    there(out, "s0", tmp_path / "in" / "s0.h5", NO_SCAN, dataset="first")
    for dataset, n in (("first", 0), ("second", 1)):
        settings = load_settings(overrides=(f"reading.dataset={dataset}",))
        assert len(warned(sources, out, settings)[0]) == n


@pytest.mark.usefixtures("here")
def test_what_cannot_be_read_replaces_nothing(tmp_path):
    sources, out = scans_of(tmp_path / "in", 1), tmp_path / "out"
    there(out, "away", tmp_path / "da" / "away.h5", "0")
    assert warned([*sources, str(tmp_path / "in" / "away.h5")], out)[0] == []


def test_a_warning_of_a_batch_is_never_silent(monkeypatch, capsys):
    _, asked = ended([OK], monkeypatch, "-q")
    asked["options"].warn("another scan")
    assert capsys.readouterr().err == "warning: another scan\n"


KEY = {"code": "c", "settings": "s", "scan": "1", "mate": None}


@pytest.mark.parametrize(
    ("changes", "limits", "stays"),
    [
        ({}, NO_LIMITS, True),
        ({}, Limits(5.0), True),  # it failed of itself
        ({"stage": "write"}, NO_LIMITS, False),
        ({"key": KEY | {"scan": "2"}}, NO_LIMITS, False),
        ({"stage": LOST}, NO_LIMITS, True),
        ({"stage": LOST}, Limits(5.0), False),
        ({"stage": LOST, "limits": asdict(Limits(5.0))}, Limits(5.0), True),
        ({"stage": LOST, "limits": asdict(Limits(5.0))}, Limits(5.0, 10**9), False),
    ],
)
def test_a_failure_stays_while_what_made_it_is_the_same(changes, limits, stays):
    failure = {"stage": "analyse", "key": KEY, "limits": asdict(NO_LIMITS)} | changes
    assert batch._stays(failure, KEY, limits) == stays


@pytest.fixture
def scan(tmp_path):
    (tmp_path / "a.h5").write_bytes(b"no scan")
    return Scan(tmp_path / "a.h5", SETTINGS, group="left", name="a")


def test_what_failed_is_written_with_all_that_tells_when_to_try_again(scan, tmp_path):
    home = tmp_path / "out" / "scans" / "a"
    for stage in ("read", "analyse"):  # the second one over the first
        row = batch._fail(scan, home, stage, "said", batch._seen(scan), "trace", Limits(5.0))
        assert row == {"status": "failed", "error": "said"}
        assert json.loads((home / "failure.json").read_text()) == {
            "schema": "capslip/failure/1",
            "scan": "a",
            "path": str(tmp_path / "a.h5"),
            "stage": stage,
            "message": "said",
            "traceback": "trace",
            "limits": {"time_s": 5.0, "memory_bytes": None},
            "key": batch._key(scan),
        }
    assert [one.name for one in home.iterdir()] == ["failure.json"]


def fails(files, happens):
    """Return what stands for reading: something happens to files, and it fails."""

    def read(path, **_):
        happens(files)
        raise UnreadableFileError("torn")

    return read


def nothing(_):
    pass


def replaced(path):
    path.with_name("new").write_bytes(b"whole")
    os.replace(path.with_name("new"), path)


def age(*paths):
    for path in paths:
        os.utime(path, (1e9, 1e9))


@pytest.fixture(params=["fresh", "old"])
def mated(request, tmp_path):
    """Return a scan with all files that a scan may have, and these files."""
    paths = [tmp_path / name for name in ("a.h5", "b.h5", "p.csv")]
    for path in paths:
        path.write_bytes(b"no scan")
    if request.param == "old":
        age(*paths)
    settings = load_settings(overrides=(f"joint.pressure_map={paths[2]}",))
    return Scan(paths[0], settings, paths[1], name="a"), paths


@pytest.mark.parametrize("which", [0, 1, 2])
def test_what_is_replaced_while_it_is_read_is_read_again(mated, which, tmp_path, monkeypatch):
    (scan, paths), home = mated, tmp_path / "out" / "scans" / "a"
    assert set(batch._seen(scan)) == set(paths)
    monkeypatch.setattr(faces, "load_surface", fails(paths[which], replaced))
    row = {"status": "failed", "error": "torn"}
    assert batch.analyse_scan(scan, home, None, False) == row
    assert json.loads((home / "failure.json").read_text())["key"] is None
    assert batch._look_at(scan, home, False) == _Found()
    monkeypatch.setattr(faces, "load_surface", fails(None, nothing))
    assert batch.analyse_scan(scan, home, None, False) == row
    assert batch._look_at(scan, home, False) == _Found(row)  # as it is whole and failed


@pytest.mark.parametrize("happens", [replaced, nothing])
def test_what_is_replaced_while_its_process_ends_is_read_again(happens, tmp_path, monkeypatch):
    sources, asked = scans_of(tmp_path / "in", 2), []

    def lost(executor, work, jobs, *_):
        for job in jobs:
            happens(job[0].path)
            yield job, Lost("too slow")

    def work(scan, *_):
        asked.append(scan.name)
        return {"status": "ok", "error": None}

    monkeypatch.setattr(batch, "outcomes", lost)
    rows = run_batch(sources, tmp_path / "out", SETTINGS, lambda _: None, work=work)
    assert [row["error"] for row in rows] == ["too slow"] * 2
    monkeypatch.undo()
    with in_this_process():
        run_batch(sources, tmp_path / "out", SETTINGS, lambda _: None, work=work)
    assert sorted(asked) == (["s0", "s1"] if happens is replaced else [])


def result_of(of, home, **other):
    """Write what stands for a result, of the scan or of something else; return what is there."""
    key = batch._key(of) | other
    with new_folder(home) as work:
        (work / "figures").mkdir()
        for name in ("caps.csv", "report.html", "settings.toml", "figures/height_map.png"):
            (work / name).write_text("old")
        summary = RESULT | {
            "schema": SCHEMA,
            "provenance": {"code_sha256": key["code"], "settings_sha256": key["settings"]},
            "surface": {"sha256": key["scan"], "mate": {"sha256": key["mate"]}},
        }
        (work / "summary.json").write_bytes(summary_text(with_digests(summary, work)))
    return contents(home)


def contents(home):
    return {one.relative_to(home).as_posix(): one.read_bytes() for one in home.rglob("*.*")}


@pytest.mark.parametrize("other", ["code", "settings", "scan", "mate"])
@pytest.mark.parametrize("stage", ["read", "analyse", LOST])
def test_a_failure_takes_the_place_of_a_result_of_something_else(mated, other, stage, tmp_path):
    (scan, _), home = mated, tmp_path / "out" / "scans" / "a"
    result_of(scan, home, **{other: "z"})
    batch._fail(scan, home, stage, "torn", batch._seen(scan))
    assert set(os.listdir(home)) == {"failure.json"}
    result_of(scan, home)  # and the other way round
    assert "failure.json" not in os.listdir(home)


def test_a_failure_takes_the_place_of_a_result_that_is_not_whole(scan, tmp_path):
    home = tmp_path / "out" / "scans" / "a"
    result_of(scan, home)
    (home / "caps.csv").write_text("edited")
    batch._fail(scan, home, "read", "torn", batch._seen(scan))
    assert set(os.listdir(home)) == {"failure.json"}


@pytest.mark.parametrize("stays", ["same", "disk full", *("a.h5", "b.h5", "p.csv"), "replaced"])
def test_a_result_that_may_still_be_wanted_stays_alone(mated, stays, tmp_path):
    """As that of a scan on a disk that is away for a while."""
    (scan, paths), home = mated, tmp_path / "out" / "scans" / "a"
    there, seen = result_of(scan, home, **({} if stays == "same" else {"code": "z"})), None
    if stays == "replaced":
        seen = batch._seen(scan)
        replaced(paths[0])
    elif stays.endswith(("h5", "csv")):
        (tmp_path / stays).unlink()
    stage = "write" if stays == "disk full" else "read"
    row = batch._fail(scan, home, stage, "torn", seen or batch._seen(scan))
    assert row == {"status": "failed", "error": "torn"}
    assert contents(home) == there


def test_a_failure_touches_no_file_of_someone_else(scan, tmp_path):
    home = tmp_path / "out" / "scans" / "a"
    there = result_of(scan, home, code="z")
    (home / "thesis.tex").write_text("years")
    batch._fail(scan, home, "read", "torn", batch._seen(scan))
    assert contents(home) == there | {"thesis.tex": b"years"}


def test_a_result_whose_process_ended_on_its_last_steps_is_no_failure(scan, tmp_path):
    home = tmp_path / "out" / "scans" / "a"
    there = result_of(scan, home)
    names = os.listdir(home)
    (home / READY).mkdir()
    for name in names:
        os.replace(home / name, home / READY / name)
    batch._fail(scan, home, LOST, "too slow", batch._seen(scan))
    assert contents(home) == there


def test_what_a_result_depends_on_is_the_same_of_a_scan_and_of_its_summary(scan, tmp_path):
    (tmp_path / "b.h5").write_bytes(b"another")
    scan = Scan(scan.path, SETTINGS, tmp_path / "b.h5")
    key = batch._key(scan)
    assert key == {
        "code": code_sha256(),
        "settings": SETTINGS.sha256(),
        "scan": hashlib.sha256(b"no scan").hexdigest(),
        "mate": hashlib.sha256(b"another").hexdigest(),
    }
    mate = {"path": "b.h5", "sha256": key["mate"]}
    provenance = {"code_sha256": key["code"], "settings_sha256": key["settings"]}
    surface = {"sha256": key["scan"], "mate": mate}
    assert batch._key_of({"provenance": provenance, "surface": surface}) == key
    alone = {"provenance": provenance, "surface": surface | {"mate": None}}
    assert batch._key_of(alone) == key | {"mate": None}
    without = batch._key_of({"provenance": provenance, "surface": None})
    assert without == key | {"scan": None, "mate": None}


def written(home, *texts):
    home.mkdir(parents=True, exist_ok=True)
    settings = load_settings(overrides=texts)
    (home / "settings.toml").write_text(tomli_w.dumps(settings.to_dict()))
    return settings


def test_what_differs_of_a_result_that_is_there_is_said(scan, tmp_path):
    home = tmp_path / "out" / "scans" / "a"
    other = ("contact.preload_N=7", "hills.material_ratio=0.2", "run.workers=5")
    written(home, *other)
    wanted = load_settings(overrides=("contact.preload_N=9", "material.hardness_Pa=1e9"))
    said = [
        "contact.preload_N (7.0 there, 9.0 here)",
        "material.hardness_Pa (None there, 1000000000.0 here)",
    ]
    found = batch._differences(home, wanted)
    assert set(said) < set(found)
    assert [one.partition(" ")[0] for one in found if one not in said] == ["hills.material_ratio"]
    preload_N = SETTINGS.contact.preload_N
    written(home, f"contact.preload_N={preload_N}")
    assert batch._differences(home, SETTINGS) == ["contact.preload_N (given or not)"]
    assert batch._differences(tmp_path / "none", SETTINGS) == []
    there = _Found(None, ("scan", "settings"), "capslip batch x")
    assert batch._to_do(scan, tmp_path / "out", there) == {
        "status": "to do",
        "error": "the result there is of other scan, other settings, contact.preload_N (given or "
        "not); it counts with the options of `capslip batch x`",
    }
    there = _Found(None, ("code",), None)
    error = "the result there is of other code"
    assert batch._to_do(scan, tmp_path / "out", there)["error"] == error
    assert batch._to_do(scan, tmp_path / "out", _Found()) == TO_DO


@pytest.mark.parametrize("picture", ["figures", "render", "meshes"])
def test_a_result_lacks_the_pictures_that_were_left_out_and_are_wanted(picture, scan, tmp_path):
    home = tmp_path / "out" / "scans" / "a"
    none = tuple(f"run.{one}=false" for one in ("figures", "render", "meshes"))
    written(home, *none)
    wanted = load_settings(overrides=(*none, f"run.{picture}=true"))
    assert batch._lacking(home, wanted) == [f"--no-{picture}"]
    assert batch._lacking(home, load_settings(overrides=none)) == []
    written(home, *none, f"run.{picture}=true")
    assert batch._lacking(home, wanted) == []
    (home / "summary.json").touch()
    said = batch._to_do(scan, tmp_path / "out", _Found())["error"]
    others = [f"--no-{one}" for one in ("figures", "render", "meshes") if one != picture]
    assert said == f"the result there lacks pictures (made with {', '.join(others)})"


def test_a_row_is_of_its_scan_and_names_a_folder_where_there_is_a_result(scan):
    known = {"scan": "a", "path": str(scan.path), "group": "left"}
    of_result = batch._row(scan, CHECK | {"scan": "old name", "caps": 3})
    assert of_result == dict.fromkeys(COLUMNS) | CHECK | known | {"caps": 3, "folder": "scans/a"}
    assert batch._row(scan, FAILED) == dict.fromkeys(COLUMNS) | FAILED | known


@pytest.mark.usefixtures("here")
def test_who_analyses_is_told_the_command_and_whether_to_repeat(tmp_path):
    asked = []

    def work(scan, home, command, again):
        asked.append((scan.name, home, command, again))
        return {"status": "ok"}

    sources, out = scans_of(tmp_path / "in", 2), tmp_path / "out"
    failed = Scan(tmp_path / "in" / "s1.h5", SETTINGS, name="s1")
    batch._fail(failed, out / "scans" / "s1", "write", "disk full", batch._seen(failed))
    run_batch(sources, out, SETTINGS, lambda _: None, "capslip batch x", work=work)
    homes = [out.absolute() / "scans" / name for name in ("s0", "s1")]
    again = ("s1", homes[1], "capslip batch x", True)  # as it was not taken for done
    assert sorted(asked) == [("s0", homes[0], "capslip batch x", False), again]


def test_what_would_be_done_is_looked_for_some_at_a_time_and_in_order(tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "AHEAD", 2)
    sources, out = scans_of(tmp_path / "in", 5), tmp_path / "out"
    options = Options(look="dry_run")
    rows = run_batch(sources, out, SETTINGS, lambda _: None, options=options, work=None)
    assert [(row["scan"], row["status"]) for row in rows] == [(f"s{i}", "to do") for i in range(5)]
    assert not out.exists()


def test_a_foreign_folder_is_refused_before_it_is_looked_at(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").touch()
    sources, options = scans_of(tmp_path / "in", 1), Options(look="dry_run")
    with pytest.raises(OutputError, match=r"thesis\.tex, which no batch wrote"):
        run_batch(sources, tmp_path / "out", SETTINGS, print, options=options, work=None)


def test_leftovers_of_file_managers_are_no_foreign_files(tmp_path):
    sources, out = scans_of(tmp_path / "in", 1), tmp_path / "out"
    out.mkdir()
    for name in (".DS_Store", "Thumbs.db", "desktop.ini", ".~lock.batch.csv#", "~$batch.xlsx"):
        (out / name).touch()
    options = Options(look="dry_run")
    (row,) = run_batch(sources, out, SETTINGS, print, options=options, work=None)
    assert row["status"] == "to do"
    assert len(list(out.iterdir())) == 5


def test_a_folder_of_a_scan_that_cannot_be_used_is_told_before_the_work(scan, monkeypatch):
    home = scan.path.parent / "out" / "scans" / "a"
    there = result_of(scan, home, code="z")
    (home / "thesis.tex").write_text("years")
    monkeypatch.setattr(batch, "load_faces", lambda *_: pytest.fail("read"))
    row = batch.analyse_scan(scan, home, None, False)
    assert row["status"] == "failed"
    assert "thesis.tex, which is no earlier result" in row["error"]
    assert contents(home) == there | {"thesis.tex": b"years"}


RESULT = {"status": "ok", "problems": [], "provenance": {"command": "capslip batch x"}}
FAILURE = {"stage": "analyse", "message": "torn", "limits": asdict(NO_LIMITS)}


@pytest.mark.parametrize(
    ("there", "failure", "whole", "again", "found"),
    [
        ({}, None, True, False, _Found(OK)),
        ({}, None, True, True, _Found(OK)),  # which did not fail
        ({"status": "failed"}, None, True, False, _Found(FAILED)),
        ({"status": "failed"}, None, True, True, _Found(None, (), "capslip batch x")),
        ({}, None, False, False, _Found(None, (), "capslip batch x")),
        ({"problems": [{"code": "output_missing"}]}, None, True, False,
         _Found(None, (), "capslip batch x")),
        ({"key": {"code": "z"}}, None, True, False, _Found(None, ("code",), "capslip batch x")),
        ({"key": {"scan": "z", "mate": "y"}}, None, True, False,
         _Found(None, ("scan", "mate"), "capslip batch x")),
        (None, FAILURE, True, False, _Found({"status": "failed", "error": "torn"})),
        (None, FAILURE, True, True, _Found()),
        (None, FAILURE | {"key": None}, True, False, _Found()),
        ({}, FAILURE, True, False, _Found({"status": "failed", "error": "torn"})),
        ({}, FAILURE | {"key": None}, True, False, _Found(OK)),
        (None, None, True, False, _Found()),
    ],
)  # fmt: skip
def test_what_is_there_of_a_scan(there, failure, whole, again, found, scan, tmp_path, monkeypatch):
    key, home = batch._key(scan), tmp_path / "out" / "scans" / "a"
    written(home, "run.figures=false", "run.render=false", "run.meshes=false")
    summary = None if there is None else RESULT | there
    failure = failure and {"key": key} | failure
    monkeypatch.setattr(batch, "read_summary", lambda of: summary if of == home else None)
    monkeypatch.setattr(batch, "read_json", lambda path: failure)
    monkeypatch.setattr(batch, "is_whole", lambda of, at: (of, at) == (summary, home) and whole)
    monkeypatch.setattr(batch, "_key_of", lambda of: key | of.get("key", {}))
    rows = {"ok": OK, "failed": FAILED}
    monkeypatch.setattr(batch, "row_of", lambda of: rows[of["status"]])
    none = tuple(f"run.{one}=false" for one in ("figures", "render", "meshes"))
    scan = replace(scan, settings=load_settings(overrides=none))
    key |= batch._key(scan)
    assert batch._look_at(scan, home, again) == found
