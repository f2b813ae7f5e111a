"""All timings, in one file and on one page."""

import json
import os
import tempfile
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Any

from capslip.studies.bench.boundary_elements import bench_boundary_elements
from capslip.studies.bench.hills import bench_hills
from capslip.studies.bench.timings import commands, contact, inspect_large, stages
from capslip.studies.clock import machine
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.studies.page import Row, table, write
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers.hdf5 import write_hdf5

SCHEMA = "capslip/bench/1"
REPEATS = 5
SHAPE = (800, 1200)
FINER = 10  # the pixels of the large result, along either axis
N_SETS = 100_000  # of parameters, of the families
LIBRARIES = (
    *("capslip", "numpy", "scipy", "scikit-image"),
    *("h5py", "matplotlib", "pyvista", "SurfaceTopography"),
)
# What times one stage more closely, and returns its table
STUDIES = {"hills": bench_hills, "boundary elements": bench_boundary_elements}


def run_bench(folder: str | Path) -> dict[str, Any]:
    """Time everything and write `bench.json` and `bench.md`.

    Parameters
    ----------
    folder : path
        Made where absent; files of the same names are replaced.

    Returns
    -------
    dict
        What `bench.json` holds: the machine, one row a timing, and what the other studies found.

    Raises
    ------
    OutputError
        If the folder cannot be made or written.
    CapslipError
        If a command that is timed fails.
    """
    write(folder, {})  # a folder that cannot be used is said before the work, not after
    with tempfile.TemporaryDirectory() as name:
        scan = Path(name) / "face.h5"
        write_hdf5(_face(), scan)
        timings = [
            *commands(scan, Path(name) / "result", REPEATS),
            *inspect_large(scan, Path(name) / "large", FINER, REPEATS),
            *stages(scan, REPEATS),
            *contact(REPEATS, N_SETS),
        ]
    load = getattr(os, "getloadavg", None)
    result = {
        "schema": SCHEMA,
        "machine": {
            **machine(*LIBRARIES),
            "load": None if load is None else round(load()[0], 1),
            "threads": os.environ.get("OPENBLAS_NUM_THREADS", "as the library chooses"),
        },
        "repeats": REPEATS,
        "timings": [asdict(timing) | {"missed": timing.missed} for timing in timings],
        "studies": {name: study() for name, study in STUDIES.items()},
    }
    text = json.dumps(result, indent=1, ensure_ascii=False, default=float) + "\n"
    write(folder, {"bench.json": text, "bench.md": bench_markdown(result)})
    return result


def bench_markdown(result: dict[str, Any]) -> str:
    """Return the page of a result of `run_bench`."""
    of = result["machine"]
    told = ("processor", "load", "system", "threads")
    libraries = ", ".join(f"{name} {of[name]}" for name in of if name not in told)
    lines = [
        "# Timings",
        "",
        f"{of['processor']}, load {of['load']} at the end; {of['system']}, {libraries}; "
        f"threads of the linear algebra: {of['threads']}.",
        "",
        f"Medians of {result['repeats']} turns, least and greatest in brackets. What is compared "
        "takes turns on the same data. A ratio above 1 means that capslip is the faster one. On a "
        "machine with other work the processor time is the better measure. Memory is the most that "
        "one process of a command held.",
    ]
    for group, rows in groupby(result["timings"], key=lambda row: row["group"]):
        head = (group, "by", "median", "processor", "memory", "goal", "ratio")
        lines += ["", table(head, map(_cells, rows))]
    for name, found in result["studies"].items():
        lines += ["", f"## {name}", "", found.rstrip()]
    return "\n".join(lines) + "\n"


def _cells(row: Row) -> tuple[str, ...]:
    span = f"{_text(row['least_s'])} to {_text(row['greatest_s'])}"
    return (
        row["what"],
        row["by"],
        f"{_text(row['median_s'])} ({span})",
        "" if row["processor_s"] is None else _text(row["processor_s"]),
        "" if row["peak_bytes"] is None else f"{row['peak_bytes'] / 1e9:.2g} GB",
        _goal(row),
        "" if row["by"] == "capslip" else f"{row['ratio']:.1f}",
    )


def _goal(row: Row) -> str:
    goals = [] if row["goal_s"] is None else [f"< {_text(row['goal_s'])}"]
    if row["goal_bytes"] is not None:
        goals.append(f"< {row['goal_bytes'] / 1e9:.2g} GB")
    return ", ".join(goals) + (" (missed)" if row["missed"] else "")


def _face() -> HeightMap:
    scene = Scene(
        shape=SHAPE,
        pixel_size_m=(0.04 / SHAPE[0], 0.06 / SHAPE[1]),
        seed=1,
        families=PAPER,
        gap_m=5e-4,
        waviness_rms_m=0.03e-6,
        noise_rms_m=2e-9,
        tilt=(2e-5, -3e-5),
        non_measured_fraction=0.005,
    )
    return synthetic_surface(scene)[0]


def _text(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 0.2 else f"{1e3 * seconds:.3g} ms"
