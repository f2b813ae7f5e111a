"""Timings of commands, stages and contact models, beside peers where they are installed.

What is compared takes turns on the same data in one run, so that whatever else the machine does
slows all of it alike. Every scene is seeded: the same work every time.
"""

import importlib
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from capslip.caps.families import group_families
from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.contact.models.families import families
from capslip.contact.models.interacting import InteractingCurve, interacting
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.errors import CapslipError, OutputError
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from capslip.surface.readers.hdf5 import write_hdf5
from capslip.surface.synthetic import CapFamily, Scene, synthetic_surface

SCHEMA = "capslip/bench/1"
REPEATS = 5
SHAPE = (800, 1200)
N_SETS = 100_000  # of parameters, of the families
E_STAR_PA, KAPPA, FRICTION, PRELOAD_N = 109.89e9, 1.2143, 0.2, 460.0
LIBRARIES = ("numpy", "scipy", "scikit-image", "h5py", "matplotlib", "pyvista", "SurfaceTopography")
# Module, function and arguments of the studies that time or try one stage more closely.
STUDIES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("bench_hills", "bench_hills", {"repeats": 5}),
    ("bench_boundary_elements", "bench", {}),
    ("fuzz_readers", "fuzz_readers", {"n_mutants": 300}),
)
Peers = dict[str, Callable[[], Callable[[], Any]]]  # what prepares a peer, and returns it


@dataclass(frozen=True)
class Timing:
    """Seconds that one thing took, over several turns."""

    group: str  # "command", "stage" or "contact"
    what: str
    by: str  # "capslip", or the peer
    median_s: float
    least_s: float
    greatest_s: float
    processor_s: float | None  # median too, of all threads and child processes; None: not known
    ratio: float  # median over that of capslip
    goal_s: float | None = None  # none for what has no goal


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
    folder = Path(folder)
    _write(folder, {})  # a folder that cannot be used is said before the work, not after
    with tempfile.TemporaryDirectory() as name:
        scan = Path(name) / "face.h5"
        write_hdf5(_face(), scan)
        timings = [*_commands(scan, Path(name) / "result"), *_stages(scan), *_contact()]
    result = {
        "schema": SCHEMA,
        "machine": _machine(),
        "repeats": REPEATS,
        "timings": [asdict(timing) for timing in timings],
        "studies": {study[0]: _study(*study) for study in STUDIES},
    }
    text = json.dumps(result, indent=1, ensure_ascii=False, default=float) + "\n"
    _write(folder, {"bench.json": text, "bench.md": bench_markdown(result)})
    return result


def bench_markdown(result: dict[str, Any]) -> str:
    """Return the page of a result of `run_bench`."""
    machine = result["machine"]
    libraries = ", ".join(f"{name} {version}" for name, version in machine["libraries"].items())
    lines = [
        "# Timings",
        "",
        f"{machine['cpu']}, {machine['cores']} cores, load {machine['load']} at the end; "
        f"{machine['platform']}, Python {machine['python']}, {libraries}; "
        f"threads of the linear algebra: {machine['threads']}.",
        "",
        f"Medians of {result['repeats']} turns, least and greatest in brackets. What is compared "
        "takes turns on the same data. A ratio above 1 means that capslip is the faster one. On a "
        "machine with other work the processor time is the better measure.",
    ]
    group = None
    for row in result["timings"]:
        if row["group"] != group:
            group = row["group"]
            head = f"| {group} | by | median | processor | goal | ratio |"
            lines += ["", head, "| --- " * 6 + "|"]
        goal = "" if row["goal_s"] is None else f"< {_text(row['goal_s'])}"
        ratio = "" if row["by"] == "capslip" else f"{row['ratio']:.1f}"
        span = f"{_text(row['least_s'])} to {_text(row['greatest_s'])}"
        median = f"{_text(row['median_s'])} ({span})"
        processor = "" if row["processor_s"] is None else _text(row["processor_s"])
        lines.append(f"| {row['what']} | {row['by']} | {median} | {processor} | {goal} | {ratio} |")
    for name, found in result["studies"].items():
        text = found if isinstance(found, str) else _table(found)
        lines += ["", f"## {name}", "", *text.rstrip().splitlines()]
    return "\n".join(lines) + "\n"


def _face() -> HeightMap:
    scene = Scene(
        shape=SHAPE,
        pixel_size_m=(0.04 / SHAPE[0], 0.06 / SHAPE[1]),
        seed=1,
        families=(CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 0.24e-6)),
        gap_m=5e-4,
        waviness_rms_m=0.03e-6,
        noise_rms_m=2e-9,
        tilt=(2e-5, -3e-5),
        non_measured_fraction=0.005,
    )
    return synthetic_surface(scene)[0]


def _commands(scan: Path, out: Path) -> Iterator[Timing]:
    """Time whole processes, from their start."""
    capslip = [sys.executable, "-m", "capslip"]
    analyze = [*capslip, "analyze", str(scan), "-o", str(out)]
    turns = [(_run([*capslip, "--help"]), _run(analyze, "status")) for _ in range(REPEATS)]
    # command, turn, (until the line, until the end, processor)
    help_s, analyze_s = np.array(turns).transpose(1, 0, 2)
    size = f"{SHAPE[1]} x {SHAPE[0]} points"
    for what, times_s, goal_s in (
        ("capslip --help", help_s[:, 1:], 0.4),
        (f"analyze, {size}: until the numbers", analyze_s[:, :1], 2.0),
        (f"analyze, {size}: all, with figures, report and render", analyze_s[:, 1:], 15.0),
    ):
        yield _timing("command", what, times_s, goal_s=goal_s)


def _run(command: list[str], until: str = "") -> tuple[float, float, float]:
    """Return the seconds until a line of stdout starts with a word, until the end, and worked."""
    seen_s = np.nan
    begin = _clocks()
    with (
        tempfile.TemporaryFile("w+") as messages,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=messages, text=True) as process,
    ):
        for line in process.stdout or ():
            if np.isnan(seen_s) and line.startswith(until):
                seen_s = time.perf_counter() - begin[0]
        process.wait()
        end_s, worked_s = _clocks() - begin
        messages.seek(0)
        if process.returncode != 0 or np.isnan(seen_s):
            raise CapslipError(
                f"bench: {' '.join(command)}: exit code {process.returncode}, expected 0 and a "
                f"line {until!r}: {messages.read().strip()[-300:]}"
            )
    return seen_s, float(end_s), float(worked_s)


def _clocks() -> np.ndarray:
    """Return the time, and the processor time of this process and of those that have ended."""
    of_children = os.times()
    worked_s = time.process_time() + of_children.children_user + of_children.children_system
    return np.array([time.perf_counter(), worked_s])


def _stages(scan: Path) -> Iterator[Timing]:
    surface = load_surface(scan)
    level = condition(surface).surface
    hills = find_hills(level)
    caps = fit_caps(level, hills, "pinned")
    stages: tuple[tuple[str, Callable[[], Any], Peers], ...] = (
        ("load", lambda: load_surface(scan), {"h5py, dataset alone": lambda: _h5py(scan)}),
        (
            "condition (plane, spikes, checks)",
            lambda: condition(surface),
            {
                "scipy lstsq, plane alone": lambda: _lstsq(surface),
                "SurfaceTopography detrend": lambda: _detrend(surface),
            },
        ),
        (
            "hills (cut, separation, pruning)",
            lambda: find_hills(level),
            {"skimage watershed alone": lambda: _watershed(level)},
        ),
        (
            "caps (apex, sphere, errors, flags)",
            lambda: fit_caps(level, hills, "pinned"),
            {"skimage regionprops_table": lambda: _regionprops(level)},
        ),
        ("families", lambda: group_families(caps), {}),
    )
    for what, function, peers in stages:
        yield from _in_turns("stage", what, function, peers)


def _contact() -> Iterator[Timing]:
    few, many = _interacting(23), _interacting(500)
    joint = slip_curve(few, PRELOAD_N, FRICTION, KAPPA)
    rng = np.random.default_rng(3)
    count = np.stack([rng.integers(1, 12, N_SETS), rng.integers(4, 73, N_SETS)], axis=-1)
    depth_m = np.stack([np.zeros(N_SETS), rng.uniform(0, 3e-7, N_SETS)], axis=-1)
    sets = families(count[:, None], (23.8, 26.7), depth_m[:, None], E_STAR_PA)
    preloads_N: Any = np.full((N_SETS, 1), PRELOAD_N)
    all_sets = slip_curve(sets, preloads_N, FRICTION, KAPPA)
    amplitude_m = np.geomspace(1e-10, 1e-7, 64)
    for what, function in (
        ("interacting, 23 caps: one preload", lambda: few.approach_m(PRELOAD_N)),
        ("interacting, 23 caps: slip curve and energy at 64 forces", lambda: _slip(joint)),
        ("interacting, 23 caps: slip limit of every cap", lambda: few.lift_off_m(joint.approach_m)),
        ("interacting, 500 caps: one preload", lambda: many.approach_m(PRELOAD_N)),
        (
            f"families: energy of {N_SETS} sets at 64 displacements",
            lambda: all_sets.energy_J(amplitude_m),
        ),
    ):
        yield from _in_turns("contact", what, function, {})


def _interacting(n: int) -> InteractingCurve:
    """Return seeded caps on a grid with some play, so that no contacts merge."""
    rng = np.random.default_rng(2)
    side = int(np.ceil(np.sqrt(n)))
    place = np.arange(n)
    x_m, y_m = (
        length_m * (cell + 0.3 * rng.random(n)) / side
        for length_m, cell in ((0.06, place % side), (0.04, place // side))
    )
    radius_m = rng.uniform(20, 30, n) * 23 / n
    return interacting(radius_m, rng.uniform(0, 3e-7, n), x_m, y_m, E_STAR_PA)


def _slip(joint: SlipCurve) -> None:
    force_N = np.geomspace(1e-3, 1.0, 64) * joint.total_slip_force_N
    joint.displacement_m(force_N)
    joint.energy_at_force_J(force_N)


def _h5py(scan: Path) -> Callable[[], Any]:
    import h5py

    def read() -> Any:
        with h5py.File(scan) as file:
            return file["height"][...]

    return read


def _lstsq(surface: HeightMap) -> Callable[[], Any]:
    from scipy.linalg import lstsq

    def level() -> Any:
        y, x = np.nonzero(surface.measured)
        columns = np.stack([np.ones(len(x)), x, y], axis=1)
        z_m = surface.height_m[y, x]
        return z_m - columns @ lstsq(columns, z_m)[0]

    return level


def _detrend(surface: HeightMap) -> Callable[[], Any]:
    topography = importlib.import_module("SurfaceTopography").Topography
    height_m = np.ma.masked_invalid(surface.height_m)
    return lambda: topography(height_m, surface.side_m).detrend("height").heights()


def _watershed(surface: HeightMap) -> Callable[[], Any]:
    from skimage.segmentation import watershed

    above = _above(surface)
    filled_m = np.where(above, surface.height_m, 0.0)
    return lambda: watershed(-filled_m, mask=above, connectivity=2)


def _regionprops(surface: HeightMap) -> Callable[[], Any]:
    from skimage.measure import label, regionprops_table

    labels = label(_above(surface), connectivity=2)
    wanted = ("area", "centroid", "equivalent_diameter_area", "intensity_max")
    return lambda: regionprops_table(labels, surface.height_m, properties=wanted)


def _above(surface: HeightMap) -> np.ndarray:
    return np.asarray(surface.height_m >= np.nanquantile(surface.height_m, 0.9))


def _in_turns(
    group: str,
    what: str,
    function: Callable[[], Any],
    peers: Peers,
) -> Iterator[Timing]:
    """Time a function and its peers; a peer that is not installed is left out."""
    functions = {"capslip": function}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the peers
        for name, make in peers.items():
            try:
                functions[name] = make()
            except ImportError:
                continue
        times_s = np.empty((REPEATS + 1, len(functions), 2))
        for turn in times_s:  # the first one warms up
            for i, one in enumerate(functions.values()):
                begin = _clocks()
                one()
                turn[i] = _clocks() - begin
    own_s = float(np.median(times_s[1:, 0, 0]))
    for i, name in enumerate(functions):
        yield _timing(group, what, times_s[1:, i], name, own_s)


def _timing(
    group: str,
    what: str,
    times_s: np.ndarray,
    by: str = "capslip",
    own_s: float | None = None,
    goal_s: float | None = None,
) -> Timing:
    """Summarise turns: one column of times, and one of processor times where they are known."""
    median_s = np.median(times_s, axis=0).tolist()
    return Timing(
        group=group,
        what=what,
        by=by,
        median_s=median_s[0],
        least_s=float(times_s[:, 0].min()),
        greatest_s=float(times_s[:, 0].max()),
        processor_s=median_s[1] if len(median_s) > 1 else None,
        ratio=1.0 if own_s is None else median_s[0] / own_s,
        goal_s=goal_s,
    )


def _study(module: str, function: str, arguments: dict[str, Any]) -> Any:
    """Run another study; return its text, or a list of plain rows."""
    try:
        run = getattr(importlib.import_module(f"capslip.studies.{module}"), function)
    except ImportError as error:
        return f"Not run: {error}."
    found = run(**arguments)
    return found if isinstance(found, str) else [_plain(row) for row in found]


def _plain(row: Any) -> Any:
    return asdict(row) if is_dataclass(row) and not isinstance(row, type) else row


def _machine() -> dict[str, Any]:
    information = Path("/proc/cpuinfo")
    models = []
    if information.exists():
        lines = information.read_text(encoding="utf-8").splitlines()
        models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    load = getattr(os, "getloadavg", None)
    return {
        "cpu": models[0] if models else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": None if load is None else round(load()[0], 1),
        "platform": platform.platform(),
        "python": platform.python_version(),
        "threads": os.environ.get("OPENBLAS_NUM_THREADS", "as the library chooses"),
        "libraries": {name: _version(name) for name in LIBRARIES},
    }


def _write(folder: Path, texts: dict[str, str]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(
            f"output folder {folder}: {error.strerror}; choose another with --out"
        ) from error


def _version(library: str) -> str:
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "absent"


def _text(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 0.2 else f"{1e3 * seconds:.3g} ms"


def _table(rows: list[dict[str, Any]]) -> str:
    """Return plain rows as a table; numbers with four digits."""
    if not rows:
        return "Nothing."
    cells = [
        [f"{value:.4g}" if isinstance(value, float) else str(value) for value in row.values()]
        for row in rows
    ]
    lines = [list(rows[0]), ["---"] * len(rows[0]), *cells]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
