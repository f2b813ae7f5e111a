"""Timings of commands, stages and contact models, beside peers where they are installed.

What is compared takes turns on the same data in one run, so that whatever else the machine does
slows all of it alike. Every scene is seeded: the same work every time.
"""

import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from capslip.analysis import analyze
from capslip.caps.families import group_families
from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.contact.models.families import families
from capslip.contact.models.interacting import InteractingCurve, interacting
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.errors import CapslipError
from capslip.output.folder import write
from capslip.settings import CapSettings, load_settings
from capslip.studies.bench import peers
from capslip.studies.clock import clocks, in_turns
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface

E_STAR_PA, KAPPA, FRICTION, PRELOAD_N = 109.89e9, 1.2143, 0.2, 460.0
CAPSLIP = (sys.executable, "-m", "capslip")
# What runs a command and tells the most that it held: a process that a large one starts counts the
# memory of that one as its own, its children do not
WEIGH = """import resource, subprocess, sys
code = subprocess.call(sys.argv[1:], stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
sys.exit(code)"""
RSS_BYTES = 1 if sys.platform == "darwin" else 1024  # one of what getrusage counts
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
    peak_bytes: int | None = None  # the most that one of its processes held; None: not known
    goal_bytes: float | None = None

    @property
    def missed(self) -> bool:
        """Whether it took longer than its goal, or held more."""
        late = self.goal_s is not None and self.median_s > self.goal_s
        large = self.goal_bytes is not None and (self.peak_bytes or 0) > self.goal_bytes
        return late or large


def commands(scan: Path, out: Path, repeats: int) -> Iterator[Timing]:
    """Time whole processes, from their start."""
    whole = [*CAPSLIP, "analyze", str(scan), "-o", str(out)]
    turns = [(_run([*CAPSLIP, "--help"]), _run(whole, "status")) for _ in range(repeats)]
    # command, turn, (until the line, until the end, processor)
    help_s, analyze_s = np.array(turns).transpose(1, 0, 2)
    ny, nx = load_surface(scan).shape
    size = f"{nx} x {ny} points"
    for what, times_s, goal_s in (
        ("capslip --help", help_s[:, 1:], 0.4),
        (f"analyze, {size}: until the numbers", analyze_s[:, :1], 2.0),
        (f"analyze, {size}: all, with figures, report and render", analyze_s[:, 1:], 15.0),
    ):
        yield _timing("command", what, times_s, goal_s=goal_s)


def _run(command: list[str], until: str = "") -> tuple[float, float, float]:
    """Return the seconds until a line of stdout starts with a word, until the end, and worked."""
    seen_s = np.nan
    begin = clocks()
    with (
        tempfile.TemporaryFile("w+") as messages,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=messages, text=True) as process,
    ):
        for line in process.stdout or ():
            if np.isnan(seen_s) and line.startswith(until):
                seen_s = clocks()[0] - begin[0]
        process.wait()
        end_s, worked_s = clocks() - begin
        messages.seek(0)
        if process.returncode != 0 or np.isnan(seen_s):
            raise _failed(command, process.returncode, messages.read(), f" and a line {until!r}")
    return seen_s, float(end_s), float(worked_s)


def _failed(command: list[str], code: int, said: str, expected: str = "") -> CapslipError:
    text = f"bench: {' '.join(command)}: exit code {code}, expected 0{expected}"
    return CapslipError(f"{text}: {said.strip()[-300:]}")


def inspect_large(scan: Path, out: Path, finer: int, repeats: int) -> Iterator[Timing]:
    """Time and weigh the picture of a large result: that of a scan, each pixel `finer`^2 smaller.

    The result is a real one, of the caps that carry, but for its map: that and the labels of its
    hills are the analysed ones, repeated. What is read and drawn is as much as of any such map.
    """
    settings = load_settings(overrides=("contact.model='interacting'", "run.meshes=false"))
    analysis = analyze(load_surface(scan), settings)
    level = analysis.conditioned.surface
    dy_m, dx_m = level.pixel_size_m
    fine = HeightMap(
        _repeated(level.height_m.astype(np.float32), finer), (dy_m / finer, dx_m / finer)
    )
    large = replace(
        analysis,
        conditioned=replace(analysis.conditioned, surface=fine),
        hills=replace(analysis.hills, label=_repeated(analysis.hills.label, finer)),
    )
    write(large, out, figures=False, render=False, page=False)
    picture = [*CAPSLIP, "inspect", str(out), "--screenshot", str(out.with_suffix(".png"))]
    times_s = np.array([_run(picture) for _ in range(repeats)])
    ny, nx = fine.shape
    yield replace(
        _timing("command", f"inspect, {nx} x {ny} points: a picture", times_s[:, 1:], goal_s=5.0),
        peak_bytes=_peak_bytes(picture),
        goal_bytes=2e9,
    )


def _repeated(values: np.ndarray, times: int) -> np.ndarray:
    return values.repeat(times, axis=0).repeat(times, axis=1)


def _peak_bytes(command: list[str]) -> int:
    """Return the most memory that any one process of a command held at a time."""
    weigh = [sys.executable, "-P", "-c", WEIGH, *command]
    done = subprocess.run(weigh, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise _failed(command, done.returncode, done.stderr)
    return int(done.stdout) * RSS_BYTES


def stages(scan: Path, repeats: int) -> Iterator[Timing]:
    """Time each stage on one scan, beside its peers."""
    surface = load_surface(scan)
    level = condition(surface).surface
    hills = find_hills(level)
    caps = fit_caps(level, hills, CapSettings().fit)
    parts: tuple[tuple[str, Callable[[], Any], Peers], ...] = (
        ("load", lambda: load_surface(scan), {"h5py, dataset alone": lambda: peers.h5py(scan)}),
        (
            "condition (plane, spikes, checks)",
            lambda: condition(surface),
            {
                "scipy lstsq, plane alone": lambda: peers.lstsq(surface),
                "SurfaceTopography detrend": lambda: peers.detrend(surface),
            },
        ),
        (
            "hills (cut, separation, pruning)",
            lambda: find_hills(level),
            {"skimage watershed alone": lambda: peers.watershed(level)},
        ),
        (
            "caps (apex, sphere, errors, flags)",
            lambda: fit_caps(level, hills, CapSettings().fit),
            {"skimage regionprops_table": lambda: peers.regionprops(level)},
        ),
        ("families", lambda: group_families(caps), {}),
    )
    for what, function, beside in parts:
        yield from _in_turns("stage", what, function, beside, repeats)


def contact(repeats: int, n_sets: int) -> Iterator[Timing]:
    """Time the contact of caps, and the families of many sets of parameters."""
    few, many = _interacting(23), _interacting(500)
    joint = slip_curve(few, PRELOAD_N, FRICTION, KAPPA)
    rng = np.random.default_rng(3)
    count = np.stack([rng.integers(1, 12, n_sets), rng.integers(4, 73, n_sets)], axis=-1)
    depth_m = np.stack([np.zeros(n_sets), rng.uniform(0, 3e-7, n_sets)], axis=-1)
    sets = families(count[:, None], (23.8, 26.7), depth_m[:, None], E_STAR_PA)
    preloads_N: Any = np.full((n_sets, 1), PRELOAD_N)
    all_sets = slip_curve(sets, preloads_N, FRICTION, KAPPA)
    amplitude_m = np.geomspace(1e-10, 1e-7, 64)
    for what, function in (
        ("interacting, 23 caps: one preload", lambda: few.approach_m(PRELOAD_N)),
        ("interacting, 23 caps: slip curve and energy at 64 forces", lambda: _slip(joint)),
        ("interacting, 23 caps: slip limit of every cap", lambda: few.lift_off_m(joint.approach_m)),
        ("interacting, 500 caps: one preload", lambda: many.approach_m(PRELOAD_N)),
        (
            f"families: energy of {n_sets} sets at 64 displacements",
            lambda: all_sets.energy_J(amplitude_m),
        ),
    ):
        yield from _in_turns("contact", what, function, {}, repeats)


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


def _in_turns(
    group: str, what: str, function: Callable[[], Any], beside: Peers, repeats: int
) -> Iterator[Timing]:
    """Time a function and its peers; a peer that is not installed is left out."""
    functions = {"capslip": function}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the peers
        for name, make in beside.items():
            try:
                functions[name] = make()
            except ImportError:
                continue
        times_s, _ = in_turns(list(functions.values()), repeats, warm_up=1)
    own_s = float(np.median(times_s[:, 0, 0]))
    for i, name in enumerate(functions):
        yield _timing(group, what, times_s[:, i], name, own_s)


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
