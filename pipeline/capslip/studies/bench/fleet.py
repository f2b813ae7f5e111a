"""Benchmark of batches: what a scan costs, and what many of them cost beside the analysis.

`python -m capslip.studies.bench.fleet` prints the tables of docs/scaling.md, in some minutes.
"""

import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path

import numpy as np

from capslip.analysis import analyze
from capslip.batch import Options, analyse_scan, run_batch
from capslip.output.folder import write
from capslip.output.overview import Row, write_overview
from capslip.output.staging import read_summary
from capslip.settings import load_settings
from capslip.sources import Scan
from capslip.studies.clock import clocks
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.studies.page import table
from capslip.surface.readers import load_surface
from capslip.surface.readers.hdf5 import write_hdf5

SIDES_M = (0.04, 0.06)
SHAPES = {(100, 150): 12, (800, 1200): 6}  # and how many scans of each
RATED = 40  # scans of which some a second are done
FEW = 4  # scans with pictures, which take seconds
MANY = (1_000, 10_000)
WAYS = {
    "numbers": ("run.figures=false", "run.render=false", "run.meshes=false"),
    "and meshes, report": ("run.figures=false", "run.render=false"),
    "and figures": ("run.render=false",),
    "and render": (),
}


@dataclass
class _Cost:
    """Seconds on the clock and of the processor, children included."""

    seconds: np.ndarray = field(default_factory=lambda: np.zeros(2))


@contextmanager
def _cost() -> Iterator[_Cost]:
    cost, before = _Cost(), clocks()
    yield cost
    cost.seconds = clocks() - before


def nothing(scan: Scan, home: Path, command: str | None, retry_failed: bool) -> Row:
    """Stand in for an analysis."""
    return {"status": "ok"}


def bench_fleet() -> str:
    """Time batches with one child.

    Returns
    -------
    str
        Tables: processor and clock time a scan by what is written; where it goes, stage by stage;
        what reading and writing take of it; how many scans a second some workers do; and what a
        scan costs beside its analysis, in batches of 1,000 and 10,000.
    """
    with tempfile.TemporaryDirectory() as name:
        of_scans, of_stages, of_numbers, rates = [], [], [], []
        for shape, count in SHAPES.items():
            scans = Path(name) / f"{shape[1]} x {shape[0]}"
            _write_scans(scans, shape, count)
            for way, overrides in WAYS.items():
                few = count if way == next(iter(WAYS)) else FEW
                out = Path(name) / "out" / scans.name / way
                of_scans.append((scans.name, way, *_per_scan(scans, out, overrides, few)))
            of_stages += _stages(scans.name, Path(name) / "out" / scans.name / way)
            of_numbers.append((scans.name, *_of_numbers(scans)))
            rates.append((scans.name, *_rates(shape, Path(name) / f"of {scans.name}")))
        beside = _beside(Path(name))
    return "\n\n".join(
        (
            table(("map", "written", "processor ms", "clock ms", "first, processor ms"), of_scans),
            table(("map", "stage", "clock ms"), of_stages),
            table(("map", "read ms", "analyse ms", "write ms"), of_numbers),
            table(("map", "workers", "scans/s", "of as many times one"), rates),
            table(("scans", "what", "found"), beside),
        )
    )


def _write_scans(folder: Path, shape: tuple[int, int], count: int) -> None:
    folder.mkdir(parents=True)
    pixel_size_m = (SIDES_M[0] / shape[0], SIDES_M[1] / shape[1])
    face = Scene(
        shape=shape, pixel_size_m=pixel_size_m, seed=1, families=PAPER, gap_m=5e-4, noise_rms_m=2e-9
    )
    surface, _ = synthetic_surface(face)
    rng = np.random.default_rng(1)
    for index in range(count):
        height_m = surface.height_m + rng.normal(0.0, 1e-9, shape)
        write_hdf5(replace(surface, height_m=height_m), folder / f"{index:04d}.h5")


def _per_scan(scans: Path, out: Path, overrides: tuple[str, ...], few: int) -> tuple[str, ...]:
    """Return processor and clock time of one more scan, and processor time of the first one."""
    settings = load_settings(overrides=("run.workers=1", *overrides))
    paths, seconds = sorted(map(str, scans.iterdir())), []
    for count in (1, few):
        with _cost() as cost:
            run_batch(paths[:count], out / str(count), settings, lambda _: None, work=analyse_scan)
        seconds.append(cost.seconds)
    clock_s, worked_s = (seconds[1] - seconds[0]) / (few - 1)
    first_s = seconds[0][1]
    return f"{1e3 * worked_s:.0f}", f"{1e3 * clock_s:.0f}", f"{1e3 * first_s:.0f}"


def _of_numbers(scans: Path) -> tuple[str, ...]:
    """Return processor times of reading, analysing and writing the numbers, in a warm process."""
    settings = load_settings(overrides=WAYS["numbers"])
    worked_s = []
    with tempfile.TemporaryDirectory() as out:
        for path in sorted(scans.iterdir()):
            times_s = [time.process_time()]
            surface = load_surface(path)
            times_s.append(time.process_time())
            analysis = analyze(surface, settings)
            times_s.append(time.process_time())
            write(analysis, Path(out) / path.stem, page=False)
            worked_s.append(np.diff([*times_s, time.process_time()]))
    return tuple(f"{1e3 * each:.1f}" for each in np.median(worked_s[1:], axis=0))


def _rates(shape: tuple[int, int], folder: Path) -> tuple[str, ...]:
    """Return scans a second of all cores once each has done one, and what share that is."""
    scans, workers, per_s = folder / "rated", os.cpu_count() or 1, []
    _write_scans(scans, shape, RATED)
    for count in (1, workers):
        done_s = _done_s(scans, folder / f"by {count}", count)
        per_s.append((len(done_s) - count) / (done_s[-1] - done_s[count - 1]))
    return str(workers), f"{per_s[1]:.1f}", f"{per_s[1] / per_s[0] / workers:.0%}"


def _done_s(scans: Path, out: Path, workers: int) -> list[float]:
    """Return when each scan of a folder was done."""
    settings = load_settings(overrides=(f"run.workers={workers}", *WAYS["numbers"]))
    done_s: list[float] = []
    run_batch([str(scans)], out, settings, lambda _: done_s.append(time.perf_counter()))
    return done_s


def _stages(name: str, out: Path) -> list[tuple[str, str, str]]:
    """Return the median time of each stage in the results of a batch."""
    found = [read_summary(path.parent) for path in out.glob("*/scans/*/summary.json")]
    times_s = [one["timings_s"] for one in found if one is not None]
    stages = {stage: [one[stage] for one in times_s if stage in one] for stage in times_s[0]}
    return [(name, stage, f"{1e3 * np.median(each):.1f}") for stage, each in stages.items()]


def _beside(folder: Path) -> list[tuple[str, str, str]]:
    rows = []
    settings = load_settings(overrides=("run.workers=1",))
    empty = folder / "empty"
    empty.mkdir()
    for count in MANY:
        for index in range(count):
            (empty / f"{index:05d}.h5").touch()
        worked_s = []
        for few in (1, count):
            paths = sorted(map(str, empty.iterdir()))[:few]
            with _cost() as cost:
                found = run_batch(
                    paths, folder / f"no{few}{count}", settings, lambda _: None, work=nothing
                )
            assert all(row["status"] == "ok" for row in found)
            worked_s.append(cost.seconds[1])
        each_ms = 1e3 * (worked_s[1] - worked_s[0]) / (count - 1)
        peak_MB = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        with _cost() as cost:
            write_overview(found, folder)
        size_MB = (folder / "index.html").stat().st_size / 1e6
        text = f"{count:,}"
        rows += [
            (text, "overhead a scan, processor", f"{each_ms:.2f} ms"),
            (text, "greatest memory of the parent", f"{peak_MB:.0f} MB"),
            (text, "tables and page, written once", f"{cost.seconds[1]:.2f} s, {size_MB:.1f} MB"),
        ]
    return [*rows, _resumed(folder)]


def _resumed(folder: Path) -> tuple[str, str, str]:
    """Return what it costs to find that a scan is done, of the last maps that were analysed."""
    shape = next(iter(SHAPES))
    scans = sorted(map(str, (folder / f"{shape[1]} x {shape[0]}").iterdir()))
    way, overrides = next(iter(WAYS.items()))
    out = folder / "out" / f"{shape[1]} x {shape[0]}" / way / str(len(scans))
    settings = load_settings(overrides=("run.workers=1", *overrides))
    with _cost() as cost:
        run_batch(scans, out, settings, lambda _: None, options=Options(look="collect"))
    each_ms = 1e3 * cost.seconds[1] / len(scans)
    return str(len(scans)), "a scan that is done already, processor", f"{each_ms:.1f} ms"


if __name__ == "__main__":
    this = import_module("capslip.studies.bench.fleet")  # the name by which children know it
    sys.stdout.write(this.bench_fleet() + "\n")
