"""A fleet of scans: nothing lost, nothing done twice, nothing left over, however it ends."""

import csv
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
import tracemalloc
from contextlib import closing
from pathlib import Path

import pytest
from batch_cases import in_this_process, scan
from click.testing import CliRunner
from fleet_cases import (
    LIGHT,
    batch,
    children_of,
    command,
    dask,
    disturb,
    fill,
    gone,
    left_over,
    listed,
    table,
)

from capslip import sources
from capslip.batch import Options, analyse_scan, run_batch
from capslip.cli import main
from capslip.output.staging import LOCK, OURS, read_summary, summary_text, with_digests
from capslip.settings import load_settings
from capslip.sources import find_scans
from capslip.studies.bench.fleet import nothing
from capslip.workers import Limits, jobs_of

SETTINGS = load_settings(
    overrides=("run.figures=false", "run.render=false", "run.workers=2", "contact.model=caps")
)


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    """Four good scans."""
    folder = tmp_path_factory.mktemp("fleet") / "in"
    fill(folder, 4, 0)
    return folder


@pytest.fixture(scope="module")
def undisturbed(scans):
    """Four scans, analysed in this process."""
    return made_in_one_process(scans)


MANY = 12  # that take both workers about a second, so that a signal comes in between


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """Many good scans, to be disturbed in."""
    folder = tmp_path_factory.mktemp("many") / "in"
    fill(folder, MANY, 0)
    return folder


@pytest.fixture(scope="module")
def many_undisturbed(many):
    """Return a folder of the many scans, analysed in this process."""
    return made_in_one_process(many)


def made_in_one_process(scans):
    out = scans.parent / "undisturbed"
    ran = run_here(scans, "-o", out)
    assert ran.exit_code == 0, ran.output
    return out


def run(*arguments):
    return CliRunner().invoke(main, ["batch", *LIGHT, *map(str, arguments)])


def run_here(*arguments):
    with in_this_process():
        return run(*arguments)


def rows(out):
    with (out / "batch.csv").open(encoding="utf-8") as file:
        return {row["scan"]: row for row in csv.DictReader(file)}


def api(scans, out, work=analyse_scan, say=lambda _: None, **options):
    return run_batch([str(scans)], out, SETTINGS, say, options=Options(**options), work=work)


def summaries(out):
    return {path: path.stat().st_mtime_ns for path in out.glob("scans/*/summary.json")}


# --- the same table, however it is made


@pytest.mark.long
def test_two_workers_make_the_same_table_to_the_bit(scans, undisturbed, tmp_path):
    assert run(scans, "-o", tmp_path / "out", "--workers", "2").exit_code == 0
    assert table(tmp_path / "out") == table(undisturbed)
    assert not left_over(tmp_path / "out")


@pytest.mark.usefixtures("here")
def test_shards_collected_make_the_same_table(scans, undisturbed, tmp_path):
    out = tmp_path / "out"
    for part in (2, 1, 3):
        assert run(scans, "-o", out, "--shard", f"{part}/3").exit_code == 0
        assert not (out / "batch.csv").exists()
    before = summaries(out)
    assert run(scans, "-o", out, "--collect").exit_code == 0
    assert table(out) == table(undisturbed)
    assert summaries(out) == before
    assert not left_over(out)


@pytest.mark.usefixtures("here")
def test_a_shard_that_is_missing_is_named(scans, tmp_path):
    out = tmp_path / "out"
    assert run(scans, "-o", out, "--shard", "1/2").exit_code == 0
    ran = run(scans, "-o", out, "--collect")
    assert ran.exit_code == 3
    assert "2 of 4 scans are still to be done" in ran.stderr
    assert [row["status"] for row in rows(out).values()].count("to do") == 2
    assert not any(row["error"] for row in rows(out).values() if row["status"] == "to do")


@pytest.mark.usefixtures("here")
def test_results_of_other_options_are_said_to_be_so(scans, tmp_path):
    out = tmp_path / "out"
    shard = (scans, "-o", out, "--shard", "1/1", "--preload", "7")
    assert run(*shard).exit_code == 0
    assert run(scans, "-o", out, "--collect").exit_code == 3
    for row in rows(out).values():
        assert "contact.preload_N (7.0 there, " in row["error"]
        assert "; it counts with the options of `capslip" in row["error"]
    assert run(scans, "-o", out, "--collect", "--preload", "7").exit_code == 0
    ran = run(scans, "-o", out, "--dry-run", "--preload", "7", "--figures")
    lacking = "lacks pictures (made with --no-figures)"
    assert ran.stdout.count(lacking) == len(rows(out))


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("text", ["0/2", "3/2", "2", "a/b"])
def test_a_shard_that_is_none_is_refused(scans, text):
    ran = run(scans, "--shard", text)
    assert ran.exit_code == 2
    assert "expected I/N" in ran.stderr


@pytest.mark.long
def test_dask_loses_nothing_where_a_worker_is_killed_and_names_a_scheduler_that_ends(
    many, many_undisturbed, tmp_path
):
    pytest.importorskip("distributed")
    with dask(tmp_path, workers=2) as (address, processes):

        def killing(server, out):
            process = subprocess.Popen(
                command(many, "-o", out, "--scheduler", address), stderr=subprocess.PIPE, text=True
            )
            assert f"1 of {MANY}" in process.stderr.readline()
            server.kill()
            _, told = process.communicate(timeout=120)
            return process.returncode, told

        code, told = killing(processes[1], tmp_path / "worker")
        assert code == 0, told
        assert table(tmp_path / "worker") == table(many_undisturbed)
        assert not left_over(tmp_path / "worker")
        out = tmp_path / "scheduler"
        code, told = killing(processes[0], out)
        assert code == 1
        assert told.splitlines()[-1].startswith("error: the scheduler of the cluster ended")
        assert "Traceback" not in told
        assert 1 <= len(rows(out)) < MANY
    assert run_here(many, "-o", out).exit_code == 0
    assert table(out) == table(many_undisturbed)
    assert not left_over(out)


JOBS = ("jobs=2", "processes=1", "memory_GB=4.294967296", "time_s=5400")


@pytest.mark.parametrize(
    ("system", "lines"),
    [
        ("slurm", ("#SBATCH --mem=4G", "#SBATCH -t 01:30:00", "#SBATCH -A p1")),
        ("pbs", ("#PBS -l select=1:ncpus=1:mem=4096MB", "#PBS -l walltime=01:30:00", "#PBS -A p1")),
    ],
)
def test_the_script_of_a_job_says_what_the_settings_say(system, lines, monkeypatch):
    pytest.importorskip("dask_jobqueue")
    dask = pytest.importorskip("dask")
    monkeypatch.setattr(shutil, "which", lambda name: f"/bin/{name}")
    texts = (f"system={system}", *JOBS, 'directives=["-A p1"]')
    settings = load_settings(overrides=tuple(f"run.cluster.{text}" for text in texts))
    loopback = dask.config.set({f"jobqueue.{system}.interface": "lo"})
    with loopback, closing(jobs_of(settings.run.cluster)) as jobs:
        script = jobs.job_script()
    assert set(lines) < set(script.splitlines())
    assert " -P -m distributed.cli.dask_worker " in script
    assert "--nthreads 1" in script


@pytest.mark.long
@pytest.mark.parametrize(
    ("system", "submit", "cancel", "told"),
    [("slurm", "sbatch", "scancel", "Submitted batch job "), ("pbs", "qsub", "qdel", "")],
)
def test_jobs_of_a_batch_system_make_the_same_table_and_end_with_it(
    scans, undisturbed, tmp_path, system, submit, cancel, told
):
    """The batch system is a stand-in that runs each job on this machine."""
    pytest.importorskip("dask_jobqueue")
    (tmp_path / "bin").mkdir()
    start = f'cp "$1" {tmp_path}/job.$$\nFLEET_MARK={tmp_path} setsid sh {tmp_path}/job.$$ '
    start += f'>/dev/null 2>&1 &\necho "{told}$!"\n'
    for name, text in ((submit, start), (cancel, 'kill -- -"$1"\n')):
        (tmp_path / "bin" / name).write_text("#!/bin/sh\n" + text)
        (tmp_path / "bin" / name).chmod(0o755)
    set_to = [f"--set=run.cluster.{text}" for text in (f"system={system}", *JOBS)]
    path = f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}"
    loopback = {f"DASK_JOBQUEUE__{system.upper()}__INTERFACE": "lo"}
    env = {**os.environ, **loopback, "PATH": path}
    ran = batch(scans, "-o", tmp_path / "out", *set_to, env=env)
    assert ran.returncode == 0, ran.stderr
    assert len(list(tmp_path.glob("job.*"))) >= 2
    assert table(tmp_path / "out") == table(undisturbed)
    end_s = time.monotonic() + 5.0
    while children_of(f"FLEET_MARK={tmp_path}") and time.monotonic() < end_s:
        time.sleep(0.1)
    assert not children_of(f"FLEET_MARK={tmp_path}")


def test_a_cluster_without_its_library_is_named(scans, tmp_path, monkeypatch):
    for name in ("dask_jobqueue", "dask_jobqueue.pbs"):
        monkeypatch.setitem(sys.modules, name, None)
    ran = run(scans, "-o", tmp_path / "out", "--set", "run.cluster.system=slurm")
    assert ran.exit_code == 2
    assert "needs the package dask-jobqueue" in ran.stderr


def test_a_machine_that_submits_no_jobs_is_named(scans, tmp_path, monkeypatch):
    pytest.importorskip("dask_jobqueue")
    monkeypatch.setenv("PATH", str(tmp_path))
    ran = run(scans, "-o", tmp_path / "out", "--set", "run.cluster.system=slurm")
    assert ran.exit_code == 2
    assert "sbatch is not on the path" in ran.stderr


def test_a_scheduler_that_does_not_answer_is_named(scans, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")

    def refuse(*_, **__):
        raise OSError("timed out")

    monkeypatch.setattr(distributed, "Client", refuse)
    ran = run(scans, "-o", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:1")
    assert ran.exit_code == 2
    assert "nothing answers" in ran.stderr


# --- bad scans, in many ways


def test_bad_scans_are_named_and_cost_no_other(tmp_path):
    bad = fill(tmp_path / "in", 9, 6)
    ran = run(*listed(tmp_path / "in"), "-o", tmp_path / "out", "--workers", "1")
    assert ran.exit_code == 3, ran.output
    found = rows(tmp_path / "out")
    assert {name for name, row in found.items() if row["status"] == "failed"} == bad
    assert len(summaries(tmp_path / "out")) == 3
    errors = [found[name]["error"] for name in sorted(bad)]
    for text, error in zip(
        ("damaged", "zero bytes", "no such file", "Input/output", "--unit", "equal"),
        errors,
        strict=True,
    ):
        assert text in error or text == "damaged", error
        assert "internal error" not in error
    for name in bad:
        record = json.loads((tmp_path / "out" / "scans" / name / "failure.json").read_text())
        assert record["message"] == found[name]["error"]
        assert record["stage"] in ("read", "analyse")
        assert "Traceback" in record["traceback"]
    assert not left_over(tmp_path / "out")


@pytest.mark.long
def test_names_of_odd_bytes_lines_and_formulas(tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    names = [b"caf\xe9.h5", b"=cmd().h5", b"two\nlines\x1b[2J.h5", b"-x.h5", b"y" * 240 + b".h5"]
    for seed, name in enumerate(names):
        scan(folder / "plain.h5", seed)
        (folder / "plain.h5").rename(os.fsdecode(bytes(folder) + b"/" + name))
    ran = batch(folder, "-o", "out", "--workers", "1", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "\x1b" not in ran.stdout + ran.stderr
    found = rows(tmp_path / "out")
    assert len(found) == len(names)
    assert {"'=cmd()", "'-x", "caf_", "two_lines_[2J"} < set(found)
    assert batch(folder, "-o", "out", "--json", cwd=tmp_path).returncode == 0


def hangs(scan, folder, *others):
    if scan.name == "scan0001":
        subprocess.Popen(["sleep", "60"])  # as the renderer of a result
        time.sleep(60)
    return analyse_scan(scan, folder, *others)


@pytest.mark.long
def test_a_scan_that_hangs_is_ended_with_what_it_started(scans, tmp_path, monkeypatch):
    monkeypatch.setenv("FLEET_MARK", str(tmp_path))
    found = api(scans, tmp_path / "out", work=hangs, limits=Limits(time_s=5.0))
    errors = {row["scan"]: row["error"] for row in found if row["error"]}
    assert errors == {"scan0001": "took longer than 5 s, which --timeout allows"}
    assert not children_of(f"FLEET_MARK={tmp_path}")


def takes_memory(scan, folder, *others):
    if scan.name == "scan0001":
        _ = bytearray(3_000_000_000)
    return analyse_scan(scan, folder, *others)


@pytest.mark.long
def test_a_scan_that_takes_too_much_memory_is_named(scans, tmp_path):
    found = api(scans, tmp_path / "out", work=takes_memory, limits=Limits(memory_bytes=10**9))
    errors = {row["scan"]: row["error"] for row in found if row["error"]}
    assert list(errors) == ["scan0001"]
    assert "memory" in errors["scan0001"].lower()


@pytest.mark.usefixtures("here")
def test_failures_are_kept_until_asked_for_or_changed(tmp_path):
    scan(tmp_path / "a.h5", 1)
    (tmp_path / "b.h5").write_bytes(b"torn")
    paths = [str(tmp_path / name) for name in ("a.h5", "b.h5")]

    def go(**options):
        told = []
        found = run_batch(
            paths, tmp_path / "out", SETTINGS, told.append, options=Options(**options)
        )
        return [row["status"] for row in found], told

    (first, second), _ = go()
    assert second == "failed"
    record = tmp_path / "out" / "scans" / "b" / "failure.json"
    written = record.stat().st_mtime_ns
    assert go()[0] == [first, "failed"]
    assert record.stat().st_mtime_ns == written
    assert go(retry_failed=True)[0] == [first, "failed"]
    assert record.stat().st_mtime_ns > written
    scan(tmp_path / "b.h5", 2)  # now whole
    assert "failed" not in go()[0]
    assert not record.exists()


@pytest.mark.usefixtures("here")
def test_a_scan_leaves_a_result_or_a_failure_and_never_both(tmp_path):
    path, home = tmp_path / "a.h5", tmp_path / "out" / "scans" / "a"
    scan(path, 1)
    whole, found = path.read_bytes(), []
    for content in (whole, b"torn", whole, None, b"torn"):
        path.unlink(missing_ok=True)
        if content is not None:
            path.write_bytes(content)
        scan(tmp_path / "b.h5", 2)  # else there would be nothing to do
        paths = [str(path), str(tmp_path / "b.h5")]
        row = run_batch(paths, tmp_path / "out", SETTINGS, lambda _: None)[0]
        found.append((row["status"], set(os.listdir(home)) & {"summary.json", "failure.json"}))
        assert (found[-1][1] == {"failure.json"}) == (set(os.listdir(home)) == {"failure.json"})
    result, failure = {"summary.json"}, {"failure.json"}
    status = found[0][0]
    assert status in ("ok", "check")
    assert found == [
        (status, result),
        ("failed", failure),
        (status, result),
        ("failed", result),  # of a scan that is away
        ("failed", failure),
    ]


@pytest.mark.long
def test_a_failure_of_a_limit_is_tried_again_under_another(tmp_path):
    scan(tmp_path / "a.h5", 1)

    def go(time_s):
        limits = Limits(time_s=time_s)
        return run_batch(
            [str(tmp_path / "a.h5")],
            tmp_path / "out",
            SETTINGS,
            print,
            options=Options(limits=limits),
        )[0]["status"]

    record = tmp_path / "out" / "scans" / "a" / "failure.json"
    assert go(0.001) == "failed"
    written = record.stat().st_mtime_ns
    assert go(0.001) == "failed"
    assert record.stat().st_mtime_ns == written
    assert go(None) != "failed"
    assert not record.exists()


@pytest.mark.long
def test_a_full_disk_is_named_and_the_same_command_goes_on(scans, undisturbed, tmp_path):
    most = 30_000  # bytes of a file, of which the result has more
    out = tmp_path / "out"
    ran = batch(
        scans,
        "-o",
        out,
        "--workers",
        "1",
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
    )
    assert ran.returncode == 3
    errors = [row["error"] for row in rows(out).values()]
    assert len(errors) == 4
    assert all(one.endswith("File too large") for one in errors), errors
    assert not left_over(out)
    assert run_here(scans, "-o", out).exit_code == 0
    assert table(out) == table(undisturbed)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--timeout", "-1"), "--timeout: got -1"),
        (("--timeout", "nan"), "--timeout: got nan"),
        (("--memory", "0"), "--memory: got 0"),
        (("--memory", "inf"), "--memory: got inf"),
        (("--collect", "--shard", "1/2"), "leave out --shard"),
        (("--collect", "--dry-run"), "--dry-run: writes nothing; leave out --collect"),
        (("--dry-run", "--collect"), "--dry-run: writes nothing; leave out --collect"),
    ],
)
def test_limits_that_make_no_sense_are_refused(scans, tmp_path, options, word):
    ran = run(scans, "-o", tmp_path / "out", *options)
    assert ran.exit_code == 2
    assert word in ran.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((), "no scan given"),
        (("in",), "no scan found in in; skipped: 1 folder (see --recursive)"),
        (("in/a.x3p",), "a.x3p is no file"),
    ],
)
def test_no_scan_is_named_with_what_was_skipped(tmp_path, monkeypatch, arguments, word):
    (tmp_path / "in" / "a.h5").mkdir(parents=True)  # a folder named like a scan
    monkeypatch.chdir(tmp_path)
    ran = run(*arguments, "-o", "out")
    assert ran.exit_code == 4
    assert word in ran.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("here")
def test_it_stops_after_as_many_failures_as_wanted(tmp_path):
    bad = fill(tmp_path / "in", 12, 6)
    ran = run(
        *listed(tmp_path / "in"), "-o", tmp_path / "out", "--workers", "1", "--max-failures", "2"
    )
    assert ran.exit_code == 3
    assert "stopped after 2 failures; 10 scans are left" in ran.stderr
    assert "2 of 12 scans failed; see batch.csv" in ran.stderr
    assert "10 of 12 scans are still to be done" in ran.stderr
    found = {name: row["status"] for name, row in rows(tmp_path / "out").items()}
    assert list(found.values()).count("to do") == 10
    assert {name for name, status in found.items() if status != "to do"} <= bad
    assert not left_over(tmp_path / "out")


# --- what is there already


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("change", ["truncated", "empty", "edited", "removed", "code"])
def test_a_result_that_is_not_whole_or_of_other_code_is_made_again(
    scans, undisturbed, tmp_path, change
):
    out = shutil.copytree(undisturbed, tmp_path / "out")
    home = out / "scans" / "scan0000"
    whole = table(out)
    summary = home / "summary.json"
    if change == "truncated":
        summary.write_bytes(summary.read_bytes()[:500])
    elif change == "empty":
        summary.write_bytes(b"")
    elif change == "edited":
        (home / "caps.csv").write_text("mine")
    elif change == "removed":
        (home / "report.html").unlink()
    else:
        found = read_summary(home)
        found["provenance"]["code_sha256"] = "0" * 64
        del found["outputs"]
        summary.unlink()
        summary.write_bytes(summary_text(with_digests(found, home)))
    before = summaries(out)
    ran = run(scans, "-o", out)
    assert ran.exit_code == 0, ran.output
    assert {path for path, time in summaries(out).items() if time != before[path]} == {summary}
    assert table(out) == whole
    assert (home / "report.html").is_file()
    assert (home / "caps.csv").read_text() != "mine"


@pytest.mark.usefixtures("here")
def test_what_an_earlier_run_left_half_written_locks_nobody_out(scans, tmp_path):
    out = tmp_path / "out"
    (out / "scans" / "scan0000" / f"{OURS}old").mkdir(parents=True)
    for name in (f"{OURS}batch.csv", LOCK):
        (out / name).write_text("half")
    assert run(scans, "-o", out).exit_code == 0
    assert not left_over(out)


@pytest.mark.usefixtures("here")
def test_two_batches_do_not_share_a_folder(scans, tmp_path):
    out, told = tmp_path / "out", []

    def say(_):
        if not told:
            told.append(run(scans, "-o", out, "--preload", "300"))

    api(scans, out, say=say)
    assert told[0].exit_code == 2
    assert "another run" in told[0].stderr
    assert {row["preload_N"] for row in rows(out).values()} == {"460.0"}


@pytest.mark.usefixtures("here")
def test_the_table_never_shrinks_while_a_batch_goes_on(scans, undisturbed, tmp_path):
    out, seen = shutil.copytree(undisturbed, tmp_path / "out"), []
    shutil.rmtree(out / "scans" / "scan0003")
    api(scans, out, say=lambda _: seen.append(len(rows(out))))
    assert min(seen) >= 3


def test_a_dry_run_writes_nothing_and_says_what_is_to_do(scans, undisturbed, tmp_path):
    ran = run(scans, "-o", tmp_path / "out", "--dry-run")
    assert ran.exit_code == 0
    assert ran.stdout.count("to do") == 4
    assert list(tmp_path.iterdir()) == []
    before = table(undisturbed)
    ran = run(scans, "-o", undisturbed, "--dry-run", "--preload", "300")
    assert ran.stdout.count("to do") == 4
    assert run(scans, "-o", undisturbed, "--dry-run").stdout.count("to do") == 0
    assert table(undisturbed) == before


@pytest.mark.usefixtures("here")
def test_a_dry_run_over_what_failed_names_it(tmp_path):
    (tmp_path / "b.h5").write_bytes(b"torn")
    assert run(tmp_path / "b.h5", "-o", tmp_path / "out").exit_code == 3
    ran = run(tmp_path / "b.h5", "-o", tmp_path / "out", "--dry-run")
    assert ran.exit_code == 0
    assert ran.stdout.startswith("failed  b  ")


def test_a_table_for_parquet_is_the_same(undisturbed):
    parquet = pytest.importorskip("pyarrow.parquet")
    found = parquet.read_table(undisturbed / "batch.parquet").to_pylist()
    assert [row["scan"] for row in found] == list(rows(undisturbed))
    for row, text in zip(found, rows(undisturbed).values(), strict=True):
        assert row["preload_N"] == float(text["preload_N"])
        assert row["answer_joint_loss_factor"] == float(text["answer_joint_loss_factor"])


# --- where scans come from


def test_what_is_skipped_is_said(scans, tmp_path):
    (tmp_path / "in" / "deep" / "er").mkdir(parents=True)
    (tmp_path / "in" / ".hidden.h5").write_bytes(b"x")
    (tmp_path / "in" / "README.md").write_text("about these scans")
    (tmp_path / "in" / "a.truth.JSON").write_text("{}")
    for seed, place in enumerate(("a.h5", "deep/a.h5", "deep/er/b.h5")):
        scan(tmp_path / "in" / place, seed)
    os.mkfifo(tmp_path / "in" / "pipe.h5")
    flat, skipped = find_scans([str(tmp_path / "in")], SETTINGS)
    assert [one.name for one in flat] == ["a"]
    assert skipped == {"hidden": 1, "folder (see --recursive)": 1, "no file": 1, "document": 2}
    deep, skipped = find_scans([str(tmp_path / "in")], SETTINGS, recursive=True)
    assert [one.name for one in deep] == ["in_a.h5", "deep_a.h5", "b"]
    ran = run(tmp_path / "in", "--recursive", "--dry-run", "-o", tmp_path / "in" / "out")
    assert "skipped: 1 hidden, 2 document, 1 no file" in ran.stderr


def test_a_scan_that_is_named_twice_is_one(tmp_path, monkeypatch):
    (tmp_path / "in").mkdir()
    scan(tmp_path / "in" / "a.h5", 1)
    (tmp_path / "list.txt").write_text("in/a.h5\n")
    monkeypatch.chdir(tmp_path)
    names = ["in", "./in/a.h5", "in/*.h5", str(tmp_path / "in" / "a.h5")]
    found, _ = find_scans(names, SETTINGS, tmp_path / "list.txt")
    assert [(one.path, one.name) for one in found] == [(tmp_path / "in" / "a.h5", "a")]


@pytest.mark.usefixtures("here")
def test_results_below_the_scans_are_no_scans(tmp_path):
    (tmp_path / "in").mkdir()
    scan(tmp_path / "in" / "a.h5", 1)
    for _ in range(2):
        ran = run(tmp_path / "in", "--recursive", "-o", tmp_path / "in" / "out")
        assert ran.exit_code == 0, ran.output
        assert list(rows(tmp_path / "in" / "out")) == ["a"]


@pytest.mark.usefixtures("here")
def test_a_list_gives_preload_mate_unit_and_group(tmp_path):
    for seed, name in enumerate(("a.h5", "b.h5")):
        scan(tmp_path / name, seed)
    (tmp_path / "list.csv").write_text(
        "scan,preload_N,group,mate\na.h5,300,left,\na.h5,100,left,\nb.h5,,right,a.h5\n"
    )
    ran = run("--list", tmp_path / "list.csv", "-o", tmp_path / "out")
    assert ran.exit_code == 0, ran.output
    found = list(rows(tmp_path / "out").values())
    assert sorted(row["preload_N"] for row in found) == ["100.0", "300.0", "460.0"]
    assert [row["group"] for row in found] == ["left", "left", "right"]
    assert {row["scan"] for row in found} == {"a.h5_100N", "a.h5_300N", "b"}
    assert [row["mate"] for row in found] == ["", "", str(tmp_path / "a.h5")]
    mated = read_summary(tmp_path / "out" / "scans" / "b")
    assert mated["surface"]["mate"]["path"] == str(tmp_path / "a.h5")
    # the mate is part of what a result depends on
    before = summaries(tmp_path / "out")
    assert run("--list", tmp_path / "list.csv", "-o", tmp_path / "out").exit_code == 0
    assert summaries(tmp_path / "out") == before
    scan(tmp_path / "a.h5", 7)
    assert run("--list", tmp_path / "list.csv", "-o", tmp_path / "out").exit_code == 0
    assert all(summaries(tmp_path / "out")[path] > time for path, time in before.items())


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("scan,preload\na.h5,3\n", "unknown column 'preload'"),
        ("scan,preload_N\na.h5,much\n", "preload_N"),
        ("scan,preload_N\na.h5,-3\n", "contact.preload_N"),
        ("scan,unit\na.h5,furlong\n", "reading.unit"),
        ("scan,preload_N,preload_N\na.h5,300,400\n", "more than one column 'preload_N'"),
        ("scan,preload_N\na.h5,1,500\n", "got 3 cells; expected 2"),
        ("scan,preload_N,group\na.h5,300\n", "got 2 cells; expected 3"),
        ("scan,preload_N\n,300\n", "got no scan"),
        ("scan;preload_N\na.h5;300\n", "with commas between them"),
        ("Scan,Preload_N\na.h5,300\n", "in this spelling"),
    ],
)
def test_a_list_that_makes_no_sense_is_refused(tmp_path, text, word):
    (tmp_path / "list.csv").write_text(text)
    ran = run("--list", tmp_path / "list.csv", "-o", tmp_path / "out")
    assert ran.exit_code == 2, ran.output
    assert word in ran.stderr


@pytest.mark.usefixtures("here")
def test_a_plain_list_names_a_scan_a_line(tmp_path):
    scan(tmp_path / "a b.h5", 1)
    (tmp_path / "list.txt").write_text("a b.h5\n\ngone.h5\n")
    ran = run("--list", tmp_path / "list.txt", "-o", tmp_path / "out")
    assert ran.exit_code == 3
    assert "no such file" in rows(tmp_path / "out")["gone"]["error"]


@pytest.mark.usefixtures("here")
def test_a_list_may_be_utf16_and_may_name_a_pipe(tmp_path):
    scan(tmp_path / "a.h5", 1)
    os.mkfifo(tmp_path / "pipe.h5")
    (tmp_path / "list.csv").write_text("scan,preload_N\na.h5,300\npipe.h5,300\n", "utf-16")
    for _ in range(2):  # what failed is looked at again
        ran = run("--list", tmp_path / "list.csv", "-o", tmp_path / "out", "--workers", "1")
        assert ran.exit_code == 3, ran.output
        assert rows(tmp_path / "out")["a"]["preload_N"] == "300.0"
        assert "is a pipe or a device" in rows(tmp_path / "out")["pipe"]["error"]
    (tmp_path / "list.csv").write_bytes(b"a.h5\n\0.h5\n")
    ran = run("--list", tmp_path / "list.csv", "-o", tmp_path / "out")
    assert ran.exit_code == 2
    assert "holds zero bytes" in ran.stderr


def test_names_are_unlike_and_quick_to_find():
    paths = [f"f{folder}/s{index % 2000}.h5" for folder in range(10) for index in range(2000)]
    paths += ["A/x.h5", "a/X.h5", "b/a/x.h5"]
    found = [sources.Scan(Path(path), SETTINGS) for path in paths]
    started_s = time.process_time()
    names = sources._names(found)
    assert time.process_time() - started_s < 3.0
    assert len({name.casefold() for name in names}) == len(paths)


@pytest.mark.long
def test_the_parent_keeps_little_of_each_scan(tmp_path):
    """So that a million of them fit: 10,000 are timed by the benchmark of batches."""
    peaks = []
    for count in (10, 260):
        for index in range(count):
            (tmp_path / f"{index:04d}.h5").touch()
        tracemalloc.start()
        paths = sorted(map(str, tmp_path.glob("*.h5")))
        found = run_batch(paths, tmp_path / f"out{count}", SETTINGS, lambda _: None, work=nothing)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert [row["status"] for row in found] == ["ok"] * count
    assert (peaks[1] - peaks[0]) / 250 < 10_000


# --- ends of all kinds


def slowness():
    """Return how much longer than its processor time work takes beside what else runs here."""
    wall_s, used_s = time.perf_counter(), time.process_time()
    while time.process_time() - used_s < 0.3:
        pass
    return (time.perf_counter() - wall_s) / (time.process_time() - used_s)


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_in_two_seconds_and_nothing_stays(
    many, many_undisturbed, tmp_path, number
):
    out, mark = tmp_path / "out", f"FLEET_MARK={tmp_path}"
    process = subprocess.Popen(
        command(many, "-o", out, "--workers", "2"),
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "FLEET_MARK": str(tmp_path)},
        # as from a terminal: what a shell starts behind itself ignores Ctrl-C
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert f"1 of {MANY}" in process.stderr.readline()
    process.send_signal(number)
    started_s = time.monotonic()
    _, told = process.communicate(timeout=60)
    assert time.monotonic() - started_s < 2.0 * slowness()
    assert process.returncode == 128 + number
    assert gone(mark, 0.0)
    done = len(summaries(out))
    assert 0 < done < MANY
    assert len(rows(out)) <= done  # one may have ended just as it was told to
    assert f"interrupted; {len(rows(out))} of {MANY} scans are done" in told
    assert not left_over(out)
    before = summaries(out)
    assert run_here(many, "-o", out).exit_code == 0
    assert table(out) == table(many_undisturbed)
    assert before.items() <= summaries(out).items()


@pytest.mark.long
def test_whatever_is_killed_the_table_is_that_of_an_undisturbed_run(
    many, many_undisturbed, tmp_path
):
    out = tmp_path / "out"
    disturb(out, [many], rounds=4, chance=random.Random(5), wait_s=(0.8, 2.0))
    ran = run_here(many, "-o", out, "--retry-failed")
    assert ran.exit_code == 0, ran.output
    assert table(out) == table(many_undisturbed)
    assert not left_over(out)
