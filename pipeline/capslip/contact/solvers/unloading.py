"""A pressed height map that is unloaded step by step: load, withdrawal and what a cycle loses."""

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise
from time import thread_time
from typing import NamedTuple

import numpy as np

from capslip.contact.solvers.letting_go import LettingGo, letting_go
from capslip.contact.solvers.losses import (
    RIGID,
    Losses,
    RegionLosses,
    apart,
    losses,
    region_losses,
)
from capslip.contact.solvers.noise import loss_noise_per_m
from capslip.contact.solvers.patches import PatchedFace, Spline
from capslip.contact.solvers.path import CLOSEST, Node, Path
from capslip.contact.solvers.polonsky_keer import ElasticFace, Pressed
from capslip.errors import ContactError, OutOfTimeError
from capslip.waiting import Waiting

# Of the preload, and so of mu N: forces below are not what a joint is asked for, and the loss there
# is as good as `smallest_drop_N` says
SMALL_SLIP = 0.1
TOLERANCE = 0.003  # aimed at for the loss between the solved loads, of which 0.005 is asked
MAX_SOLUTIONS = 50
_FIRST, _FEWEST = 9, 5  # solutions before the first look at the accuracy; where time is short
_LEAST_S = 1e-6  # that one of them takes, whatever the clock says
_SMALLEST, _LARGEST = 0.007, 0.985  # their withdrawals, as shares of that of a single Hertz contact
_MOST_REGIONS = 300  # that are interpolated each by itself: more are no Hertz contacts
_LEAST_PIXELS = 10  # of a region on average: smaller ones are none either
_ORDER = 1.3  # of the error in the width of an interval: three of four points are better than that
PATCH_ERROR = 1e-5  # of what patches leave out, over the approach, see `Unloading`
_ENOUGH = 8  # pixels in contact, times points along a side of each: of fewer caps know more
_STEPS = 0.01  # aimed at for what single pixels that let go may do to the loss, see `_steps`
_OF_PIXELS = 0.2  # the same of one of many patches, over what pixels leave, where that is more
UNRESOLVED = 0.05  # relative error of the loss from which it is not to be trusted


@dataclass(frozen=True, eq=False)
class Unloading:
    """What happens below one preload, made by `unload`.

    The three columns of the table belong together and grow; below the first row the load drop is
    linear in the withdrawal and the loss cubic.
    """

    load_N: float
    approach_m: float  # of the refined map, where it is refined
    stiffness_N_per_m: float  # at the preload
    withdrawal_m: np.ndarray  # (n,); at the last nothing touches any more
    load_drop_N: np.ndarray  # (n,); the last is the preload
    loss_J: np.ndarray  # (n,), 4 * integral of s (e - s) N''(d - s)
    region_lift_off_m: np.ndarray  # of each contact region, by its number in the pressed face
    solved_load_N: np.ndarray  # growing
    solved_approach_m: np.ndarray
    loss_error: float  # expected between the solved loads from a tenth of the preload on, relative
    smallest_drop_N: float  # below it the loss may be off by more than 5 %: too few pixels slip
    refinement: int = 1  # points along the longer side of a pixel of the map, that were solved
    spline: Spline = "third"  # of what lies between these pixels
    # Worst gap off the contact that patches leave out, over the approach, at preload and below it:
    # what the whole map says of their solutions; 0 where the map itself was solved or refined.
    patch_error: float = 0.0
    cut_short: bool = False  # whether the time was over before the loss was settled
    spent_s: float = 0.0  # of the processor for the preload, with what came before
    unknown_to_N: float = 0.0  # load drop up to which nothing is known of the loss but its bounds
    # Load drops, growing, and what pixels leave in the loss at each, relative, shape (2, k)
    of_pixels: np.ndarray = field(default_factory=lambda: np.ones((2, 1)))
    # The same of white noise of one metre, see `loss_noise_per_m`
    of_noise: np.ndarray = field(default_factory=lambda: np.array([[1.0], [0.0]]))
    # Where it still touches, and what bears the load; None of one of many patches
    letting_go: LettingGo | None = None
    # Under the preload, of the points that were solved; the last of those at their hardness
    contact_area_m2: float = 0.0
    max_pressure_Pa: float = 0.0
    yielded_area_m2: float = 0.0

    def pixel_error(self, load_drop_N: float) -> float:
        """Return what pixels leave in the loss at a load drop, a power between those solved."""
        return math.exp(float(np.interp(math.log(load_drop_N), *np.log(self.of_pixels))))

    def noise_per_m(self, load_drop_N: float) -> float:
        """Return what white noise of one metre does to the loss at a load drop, relative."""
        drop_N, of_noise = self.of_noise
        return float(np.interp(math.log(load_drop_N), np.log(drop_N), of_noise))


def unload(
    face: ElasticFace,
    pressed: Pressed,
    tolerance: float,
    *,
    time_limit_s: float = math.inf,
    give_up_s: float = math.inf,
    on_patches: bool = True,
    punch_Pa_per_m: np.ndarray | None = None,
    around: PatchedFace | None = None,
    force_shares: tuple[float, ...] = (),
    as_pixels: bool = False,
) -> Unloading:
    """Solve a pressed face at falling loads, as many as the loss between them needs.

    The loss integral of a load drop s follows from the two states at its ends alone,

        L = 4 * integral of (p_0 gap_1 - p_1 gap_0) dA,

    because L = 8 [U_0 - U_1 - s (d_0 + d_1) / 2] with U = integral of d dN, which is the elastic
    and potential energy of the pressures, and Betti's theorem. No difference of large numbers is
    left, and no integral over the load: p_1 is nowhere without p_0, so every term is positive.

    For the same reason all of it is solved on patches around the contacts (`patched`), from the
    preload on, and refined by a cubic spline where the contacts are narrow (`refinement`).

    Between solved loads the loss is interpolated: that of the face, whose slopes are known as well,
    or that of each contact region as a Hertz contact (`losses`). A load that is left out tells what
    the intervals beside it may be off: that decides between the two. Where few pixels let go in an
    interval, what they may do is more (`_steps`). The worst interval is halved.

    Parameters
    ----------
    face : ElasticFace
        The face.
    pressed : Pressed
        Its state under the preload.
    tolerance : float
        Of each solution, see `press`.
    time_limit_s : float
        Of the processor: where all the loads are expected to take longer, as many as there is time
        for, at least `_FEWEST`; the error to be expected between them is that of so few.
    give_up_s : float
        Of the processor: a solution that is not found by then is given up. One of the first
        loads that is leaves no slip; a later one ends the loads.
    on_patches : bool
        Whether to leave out what does not touch; else every solution is one of the whole map.
    punch_Pa_per_m : float64, shape (ny, nx), optional
        dp/dd under the preload, where it is known.
    around : PatchedFace, optional
        What `around_contact` finds around the contact under the preload, where it is known.
    force_shares : tuple of float, optional
        Of mu N, growing: what happens at other forces is not asked for. These loads alone are
        solved, not as many as it takes between them.
    as_pixels : bool
        Whether single pixels that let go may do as much between the loads as pixels leave there
        anyway: of one of many patches, whose energies are summed.

    Raises
    ------
    ContactError
        If the contact has too few pixels, or a solution fails.
    """
    begin_s = thread_time()
    if force_shares:
        until_s, known = begin_s + give_up_s, (punch_Pa_per_m, around)
        path, error = path_at(
            face, pressed, tolerance, force_shares, *known, math.inf, until_s=until_s
        )
        _refuse_few(path)
        return replace(_tabulated(path, cut_short=False), patch_error=error)
    given = (punch_Pa_per_m, around, math.inf, begin_s + give_up_s)
    path = Path(face, pressed, tolerance, on_patches, *given)
    _refuse_few(path)
    cut_short = _followed(path, begin_s, time_limit_s, as_pixels)
    error = path.patch_error()
    if not error <= PATCH_ERROR:  # not seen yet
        spent_s = thread_time() - begin_s
        return unload(
            face,
            pressed,
            tolerance,
            time_limit_s=max(time_limit_s - spent_s, 0.0),
            give_up_s=max(give_up_s - spent_s, 0.0),
            on_patches=False,
            as_pixels=as_pixels,
        )
    shown = None if as_pixels else letting_go(path)
    return replace(_tabulated(path, cut_short), patch_error=error, letting_go=shown)


def _refuse_few(path: Path) -> None:
    """Refuse a contact of too few pixels to follow its slip."""
    n_pixels = int(np.count_nonzero(path.map_pressed.pressure_Pa))
    points = 1 if path.patches is None else path.patches.refinement
    if n_pixels * points < _ENOUGH:
        raise ContactError(
            f"{path.map.name}: the contact under {path.pressed.load_N:g} N has {n_pixels} pixels; "
            f"expected at least {_ENOUGH} to follow its slip, or fewer of a smooth map; use a "
            "finer map or a contact model of caps"
        )


def path_at(
    face: ElasticFace,
    pressed: Pressed,
    tolerance: float,
    shares: tuple[float, ...],
    punch_Pa_per_m: np.ndarray | None = None,
    around: PatchedFace | None = None,
    most: float = math.inf,
    until_s: float = math.inf,
    other: bool = False,
) -> tuple[Path, float]:
    """Return the solutions where shares of the load are gone, growing, and the patches' error.

    On the map itself where that would be too great. Parameters are those of `unload`, and the most
    points that a refinement may put along the longer side of a pixel; when, by `thread_time`, a
    solution is given up; and whether what lies between smooth pixels is another guess.
    """
    for on_patches, known in ((True, (punch_Pa_per_m, around)), (False, (None, None))):
        path = Path(face, pressed, tolerance, on_patches, *known, most, until_s, other)
        for share in shares:
            path.at(share)
        error = path.patch_error()
        if error <= PATCH_ERROR:
            break
    return path, error


def _followed(path: Path, begin_s: float, time_limit_s: float, as_pixels: bool) -> bool:
    """Solve as many loads as the loss between them needs; return whether time was too short.

    What was done before the first of them, since `begin_s`, none of the others takes again.
    """
    waiting = Waiting("boundary elements", "loads")
    first, last = (float(np.log(t / (1 - t))) for t in (_SMALLEST, _LARGEST))
    ready_s = thread_time()
    path.solve(first)
    took_s = max(thread_time() - ready_s, _LEAST_S)
    fit_in = (time_limit_s - (ready_s - begin_s)) / took_s
    n_first = _FIRST if fit_in >= _FIRST else max(_FEWEST, int(fit_in))
    for odd in np.linspace(first, last, n_first)[1:].tolist():
        path.solve(odd)
        waiting.tell(len(path.nodes), n_first)
    while len(path.nodes) < MAX_SOLUTIONS:
        intervals = [each for each in _between(path, as_pixels)[1] if each.width > CLOSEST]
        wide = [each for each in intervals if each.excess > 1]
        waiting.tell(len(path.nodes), min(len(path.nodes) + len(wide), MAX_SOLUTIONS))
        if not wide and len(path.nodes) >= _FIRST:
            break
        worst, now_s = max(wide or intervals), thread_time()
        if now_s - begin_s + (now_s - ready_s) / len(path.nodes) > time_limit_s:
            return True
        try:
            path.solve((worst.low + worst.high) / 2)
        except OutOfTimeError:  # those that are there have their error
            return True
    return False


class _Interval(NamedTuple):
    """Two neighbouring solved loads; the greatest one is the one to halve."""

    excess: float  # error over what is allowed
    error: float  # relative, of the loss
    low: float
    high: float

    @property
    def width(self) -> float:
        """Return how far the withdrawals of its ends are apart, over that of the last contact."""
        return float(np.diff(1 / (1 + np.exp(-np.array([self.low, self.high]))))[0])


def _between(
    path: Path, as_pixels: bool = False
) -> tuple[Losses | RegionLosses, list[_Interval], float]:
    """Return the better one of two ways to interpolate, its errors, and where pixels resolve it."""
    ways, smallest_N = _ways(path)
    found, intervals = min(ways, key=lambda way: max(way[1]))
    return found, _with_steps(path, intervals, as_pixels), smallest_N


def _ways(path: Path) -> tuple[list[tuple[Losses | RegionLosses, list[_Interval]]], float]:
    """Return the ways to interpolate, one or two, and from which load drop pixels resolve it."""
    nodes = [*path.nodes, path.end]
    x_m = np.array([node.withdrawal_m for node in nodes])
    drop_N = path.pressed.load_N - np.array([node.load_N for node in nodes])
    loss_J = np.array([node.region_loss_J for node in nodes])
    of_face, carries = losses(path.stiffness_N_per_m, drop_N, x_m, loss_J.sum(axis=1))
    pixel_error = np.array([node.pixel_error for node in nodes])
    trusted = pixel_error <= UNRESOLVED
    smallest_N = _where_trusted(drop_N, pixel_error)
    # Places on a scale on which the loss is a power
    more = np.maximum(x_m / drop_N * path.stiffness_N_per_m - 1, RIGID)
    at = np.maximum.accumulate(np.log(more)) + 1e-9 * np.arange(len(x_m))
    ways: list[tuple[Losses | RegionLosses, list[_Interval]]]
    ways = [(of_face, _intervals(path, of_face, carries, at))]
    # Regions follow from the loads that pixels resolve, and say nothing below the least of them.
    resolved_N = drop_N[trusted].min(initial=np.inf)
    unlike = path.n_regions > min(_MOST_REGIONS, path.n_points / _LEAST_PIXELS)
    if not unlike and resolved_N <= SMALL_SLIP * path.pressed.load_N:
        rates = path.rates_per_m(nodes)
        known = (x_m[trusted], rates[trusted], loss_J[trusted])
        of_regions = region_losses(path.region_load_N, path.slope_per_m, *known)
        ways.append((of_regions, _intervals(path, of_regions, trusted, at)))
    return ways, smallest_N


def _where_trusted(drop_N: np.ndarray, pixel_error: np.ndarray) -> float:
    """Return the load drop at which the error that pixels leave falls to `UNRESOLVED`."""
    trusted = pixel_error <= UNRESOLVED
    if not trusted.any():
        return float(drop_N[-1])
    k = int(np.argmax(trusted))
    if k == 0 or not np.isfinite(pixel_error[k - 1]):
        return float(drop_N[k])
    errors = np.log(pixel_error[[k, k - 1]])
    return float(np.exp(np.interp(math.log(UNRESOLVED), errors, np.log(drop_N[[k, k - 1]]))))


def _intervals(
    path: Path, found: Losses | RegionLosses, carries: np.ndarray, at: np.ndarray
) -> list[_Interval]:
    """Return the intervals between solved loads with the errors to be expected in them.

    The error of a load that is left out belongs to an interval of both widths beside it.
    """
    error = np.zeros(len(at))  # of the interval that begins at each place
    known = np.flatnonzero(carries)
    for low, middle, high, off in zip(known, known[1:], known[2:], found.offs(), strict=False):
        width = at[high] - at[low]
        for first, last in ((low, middle), (middle, high)):
            share = (at[last] - at[first]) / width
            error[first:last] = np.maximum(error[first:last], off * share**_ORDER)
    pairs = zip(pairwise(path.nodes), error.tolist(), strict=False)
    return [
        _Interval(one / max(TOLERANCE, high.pixel_error), one, low.odd, high.odd)
        for (low, high), one in pairs
    ]


def _with_steps(path: Path, intervals: list[_Interval], as_pixels: bool) -> list[_Interval]:
    """Return the intervals with the errors that single pixels may make.

    None is halved for them below `SMALL_SLIP`: there they say what is not resolved.
    """
    found = []
    for pair, each in zip(pairwise(path.nodes), intervals, strict=True):
        step = _steps(path, *pair)
        asked = path.pressed.load_N - pair[1].load_N > SMALL_SLIP * path.pressed.load_N
        most = max(_STEPS, _OF_PIXELS * pair[1].pixel_error) if as_pixels else _STEPS
        excess = max(each.excess, step / most) if asked else each.excess
        found.append(_Interval(excess, max(each.error, step), each.low, each.high))
    return found


def _steps(path: Path, low: Node, high: Node) -> float:
    """Return by how much the loss between two loads may be off by pixels that let go, relative.

    Fewer and fewer pixels hold, so x(s) is convex and lies below its chord, by an area J that is
    known, 8 J = L_2 - L_1 - 4 s_1 s_2 (c_2 - c_1), with c = x / s. At a load between it lies below
    by 0 to 2 J / (s_2 - s_1), as the one pixel lets go that bends it, and the loss follows, to
    within 4 s J / (s_2 - s_1). Of n pixels that let go anywhere, the root of n is left of that.
    """
    preload_N = path.pressed.load_N
    s_1, s_2 = preload_N - low.load_N, preload_N - high.load_N
    L_1, L_2 = low.region_loss_J.sum(), high.region_loss_J.sum()
    area = L_2 - L_1 - 4 * (s_1 * high.withdrawal_m - s_2 * low.withdrawal_m)  # 8 J
    if area <= RIGID * preload_N * path.pressed.approach_m:
        return 0.0
    refined = 1 if path.patches is None else path.patches.refinement
    n_pixels = max((len(low.contact) - len(high.contact)) / refined, 1.0)
    loss = np.sqrt(L_1 * L_2)
    most = 0.5 * area * np.sqrt(s_1 * s_2) / (s_2 - s_1)
    return float(min(most / max(loss * np.sqrt(n_pixels), most), 1.0))


def _lift_offs_m(path: Path) -> np.ndarray:
    """Return at which withdrawal each region has lost its compression, t = 1."""
    nodes = [*path.nodes, path.end]
    x = np.append(0.0, [node.withdrawal_m for node in nodes])
    rate = np.concatenate((path.slope_per_m[None], path.rates_per_m(nodes)))
    lifted = x[:, None] * rate >= 1
    lifted[-1] = True  # at the end all have, whatever rounding says
    after = np.argmax(lifted, axis=0)
    region = np.arange(path.n_regions)
    (low, high), (x_low, x_high) = (rate[[after - 1, after], region], x[[after - 1, after]])
    # x (low + slope (x - x_low)) = 1
    slope = (high - low) / (x_high - x_low)
    start = low - slope * x_low
    root = np.sqrt(np.maximum(start**2 + 4 * slope, 0.0))
    return np.asarray(np.clip(2 / (start + root), x_low, x_high))


def _unknown_to_N(path: Path, intervals: list[_Interval]) -> float:
    """Return the load drop up to which no pixel lets go, or single ones may make all of the loss.

    What slips within pixels until then nobody sees: the loss is anything up to its rectangle.
    """
    preload_N, pairs = path.pressed.load_N, zip(path.nodes[1:], intervals, strict=True)
    if not any(np.isfinite(node.pixel_error) for node in path.nodes):
        return preload_N
    return max((preload_N - high.load_N for high, each in pairs if each.error >= 1.0), default=0.0)


def _of_pixels(path: Path) -> np.ndarray:
    """Return the solved load drops, growing, and the errors that pixels leave in the loss there."""
    errors = np.array([node.pixel_error for node in path.nodes])
    drops_N = path.pressed.load_N - np.array([node.load_N for node in path.nodes])
    known = (errors > 0.0) & np.isfinite(errors)
    return np.stack((drops_N[known], errors[known])) if known.any() else np.ones((2, 1))


def _tabulated(path: Path, cut_short: bool) -> Unloading:
    """Return what was found in one table, so that whatever is asked later is found in it.

    Below the forces that joints are asked for, intervals that are off by more than `UNRESOLVED` are
    no error between the loads but the end of what pixels resolve.
    """
    pressed = path.pressed
    found, intervals, smallest_N = _between(path)
    x, drop_N, loss_J = found.table()
    of_all_m = np.zeros(len(path.map_pressed.region_pixels))
    of_all_m[path.left] = _lift_offs_m(path)
    drop_of = {node.odd: pressed.load_N - node.load_N for node in path.nodes}
    least_N = SMALL_SLIP * pressed.load_N
    asked = [drop_of[each.high] > least_N for each in intervals]
    ends_N = [drop_of[each.high] for each in intervals if each.error > UNRESOLVED]
    smallest_N = max([smallest_N, *(end_N for end_N in ends_N if end_N <= least_N)])
    errors = [each.error for each, used in zip(intervals, asked, strict=True) if used]
    if cut_short:  # what each way expects of itself is too little where loads are few
        tables = [way.table() for way, _ in _ways(path)[0]]
        errors.append(apart(tables[0], tables[-1], least_N))
    # In the approach of the map, which the preload has as well
    left = [(node.load_N, 1 - node.withdrawal_m / pressed.approach_m) for node in path.nodes]
    solved = np.array(sorted([*left, (pressed.load_N, 1.0)])) * (1, path.map_pressed.approach_m)
    yielded = 0 if pressed.yielded is None else np.count_nonzero(pressed.yielded)
    return Unloading(
        load_N=pressed.load_N,
        approach_m=pressed.approach_m,
        stiffness_N_per_m=path.stiffness_N_per_m,
        withdrawal_m=x,
        load_drop_N=drop_N,
        loss_J=loss_J,
        region_lift_off_m=of_all_m,
        solved_load_N=solved[:, 0],
        solved_approach_m=solved[:, 1],
        loss_error=max(errors, default=0.0),
        smallest_drop_N=smallest_N,
        refinement=1 if path.patches is None else path.patches.refinement,
        spline="third" if path.patches is None else path.patches.spline,
        cut_short=cut_short,
        unknown_to_N=_unknown_to_N(path, intervals),
        of_pixels=_of_pixels(path),
        of_noise=loss_noise_per_m(path),
        contact_area_m2=path.n_points * path.face.pixel_area_m2,
        max_pressure_Pa=pressed.max_pressure_Pa,
        yielded_area_m2=yielded * path.face.pixel_area_m2,
    )
