"""Folders of small scans, good and bad, and ways to run a batch on them as a process."""

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from batch_cases import scan

from capslip.output.staging import is_whole, read_summary

LIGHT = ("--no-figures", "--no-render", "--model", "caps")
KINDS = 6  # of bad scans


def fill(folder, n_scans, n_bad):
    """Write scans of which some are bad in six ways; return the names of the bad ones."""
    folder.mkdir(parents=True)
    scan(folder / "first.h5", 100)
    bad = set()
    for index in range(n_scans):
        path = folder / f"scan{index:04d}.h5"
        if index >= n_bad:
            scan(path, 101 + index)
            continue
        bad.add(path.stem)
        spoil(path, folder / "first.h5", index % KINDS)
    (folder / "first.h5").unlink()
    return bad


def spoil(path, good, kind):
    """Write one bad scan: torn, empty, gone, unreadable, without a unit, or flat."""
    if kind == 0:
        path.write_bytes(good.read_bytes()[:1000])
    elif kind == 1:
        path.write_bytes(b"")
    elif kind == 2:
        os.mkfifo(path.with_suffix(".fifo"))  # is no file, and would be waited for
        path.with_suffix(".fifo").unlink()
        path.symlink_to("nowhere")
    elif kind == 3:
        path.symlink_to("/proc/self/mem")  # every read is an input/output error
    elif kind == 4:
        np.save(path.with_suffix(".npy"), np.zeros((30, 40)))
        path.with_suffix(".npy").rename(path)
    else:
        shutil.copy(good, path)
        import h5py

        with h5py.File(path, "r+") as file:
            file["height"][...] = 1.0


def command(*arguments):
    return [sys.executable, "-P", "-m", "capslip", "batch", *LIGHT, *map(str, arguments)]


def batch(*arguments, **options):
    return subprocess.run(
        command(*arguments), capture_output=True, text=True, check=False, timeout=600, **options
    )


def listed(folder):
    """Write a list of all files of a folder, those that lead nowhere, too."""
    path = folder.with_suffix(".txt")
    path.write_text("".join(f"{one}\n" for one in sorted(folder.iterdir())))
    return ["--list", path]


def table(out):
    return (Path(out) / "batch.csv").read_bytes()


def left_over(out):
    return [path for path in Path(out).rglob("*") if path.name.startswith(".")]


def children_of(text):
    """Return the processes whose environment holds a text: what a marked one started, too."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != os.getpid():
            try:
                line = (entry / "environ").read_bytes()
                state = (entry / "stat").read_text().rpartition(")")[2].split()[0]
            except OSError:
                continue
            if text.encode() in line and state != "Z":
                found.append(int(entry.name))
    return found


def gone(text, within_s):
    """Wait until no process of a mark is left."""
    end_s = time.monotonic() + within_s
    while children_of(text) and time.monotonic() < end_s:
        time.sleep(0.02)
    return not children_of(text)


@contextmanager
def dask(folder, workers=2, mark=""):
    """Run a scheduler and workers on loopback; give the address and the processes of all."""
    from distributed import Client

    python = [sys.executable, "-P", "-m"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    quiet["env"] = {**os.environ, "FLEET_MARK": str(mark)}
    file = str(folder / "scheduler.json")
    host, known = ["--host", "127.0.0.1", "--no-dashboard"], ["--scheduler-file", file]
    alone = ["--nthreads", "1", "--no-nanny", "--local-directory", str(folder)]
    processes = [
        subprocess.Popen(
            [*python, "distributed.cli.dask_scheduler", *host, *known, "--port", "0"], **quiet
        )
    ]
    try:
        end_s = time.monotonic() + 60
        while not os.path.exists(file) and time.monotonic() < end_s:
            time.sleep(0.05)
        for _ in range(workers):
            processes.append(
                subprocess.Popen(
                    [*python, "distributed.cli.dask_worker", *host, *known, *alone], **quiet
                )
            )
        with Client(scheduler_file=file, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
            address = client.scheduler.address
        yield address, processes
    finally:
        for process in processes:
            with_kill(process)


def with_kill(process):
    if process.poll() is None:
        process.send_signal(signal.SIGKILL)
    process.wait()


def done(out):
    """Return the whole results of a batch, each with the time at which it was written."""
    found = {}
    for path in Path(out).glob("scans/*/summary.json"):
        summary = read_summary(path.parent)
        if summary is not None and is_whole(summary, path.parent):
            found[path] = path.stat().st_mtime_ns
    return found


def disturb(out, sources, rounds, chance, wait_s, n_on_dask=0):
    """Run a batch again and again while it, or a process that it needs, is killed.

    In the last rounds a Dask scheduler and two workers on loopback do the work, and one of them, or
    what they started, may be the one that is killed. What was done before has to stay as it is.
    """
    for number in range(rounds):
        before = done(out)
        if number < rounds - n_on_dask:
            _kill_one(out, [*sources, "--workers", "2"], [], chance, wait_s)
        else:
            with tempfile.TemporaryDirectory() as name, dask(Path(name), mark=out) as cluster:
                address, processes = cluster
                _kill_one(out, [*sources, "--scheduler", address], processes, chance, wait_s)
        assert gone(f"FLEET_MARK={out}", 2.0), "a process outlives the batch"
        assert before.items() <= done(out).items(), "a result was lost, or made twice"


def _kill_one(out, arguments, servers, chance, wait_s):
    """Kill a batch, or one of the processes it needs and then the batch."""
    process = subprocess.Popen(
        command(*arguments, "-o", out),
        env={**os.environ, "FLEET_MARK": str(out)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    time.sleep(chance.uniform(*wait_s))
    victims = [one for one in children_of(f"FLEET_MARK={out}") if one != process.pid]
    kill_batch = chance.random() < (0.3 if servers else 0.5) or not victims
    victim = process.pid if kill_batch else chance.choice(victims)
    with suppress(ProcessLookupError):
        os.kill(victim, signal.SIGKILL)
    if not kill_batch:
        time.sleep(chance.uniform(*wait_s))
        process.kill()
    process.wait(30)


def soak_fleet(folder, n_scans=500, n_bad=38, rounds=50):
    """Analyse many scans, some bad, undisturbed and disturbed; return what was not as it should."""
    wrong, bad = [], fill(folder / "in", n_scans, n_bad)
    sources = listed(folder / "in")
    ran = batch(*sources, "-o", folder / "undisturbed")
    results = {path.parent.name for path in folder.glob("undisturbed/scans/*/summary.json")}
    failures = {path.parent.name for path in folder.glob("undisturbed/scans/*/failure.json")}
    found = len(results), len(failures), ran.returncode
    if found != (n_scans - n_bad, n_bad, 3) or failures != bad:
        wrong.append(f"results, failures and exit code {found}")
    disturb(folder / "out", sources, rounds, random.Random(1), (0.5, 6.0), n_on_dask=rounds // 2)
    batch(*sources, "-o", folder / "out", "--retry-failed")
    if table(folder / "out") != table(folder / "undisturbed"):
        wrong.append(f"another table after {rounds} kills")
    wrong += [f"left over: {path}" for path in left_over(folder / "out")]
    return wrong
