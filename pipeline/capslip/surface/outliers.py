"""Outliers: points that stand off their neighbours, not points that stand off the mean."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from capslip.surface.frame import without_frame
from capslip.surface.graph import Runs, connected_parts
from capslip.surface.heightmap import HeightMap
from capslip.surface.lifted import lifted_patches
from capslip.surface.quantile import quantile
from capslip.surface.rows import even_lines, row_blocks
from capslip.surface.small_spikes import find_small_spikes
from capslip.surface.steps import greatest_steps_m

STEP_QUANTILE = 0.90
CLIFF_OVER_STEP = 8.0  # white noise: 13 standard deviations of a step
ROUNDING = 1e-9  # of the greatest height: smaller steps are no roughness but rounding
MAX_POINTS = 8  # of an island; nine are the fewest that make a hill
MAX_CODE_SHARE = 0.01  # of the points, for an island of one stored height
MAX_SPIKE_POINTS = 2
MIN_RING_POINTS = 5
GAP_OVER_RING = 4.0
FEWEST_DOWN = 5  # of errors that point both ways: fewer may be pits
SAMPLED_LINES = 100
LEAST_WHOLE = 0.02  # of the measured points inside: those with eight measured neighbours
NEAREST = 8  # measured points around one that stands alone
NEIGHBOURS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
TWO_AWAY = tuple(one for one in product(range(-2, 3), repeat=2) if one != (0, 0))


@dataclass(frozen=True, eq=False)
class Outliers:
    """Points that the rule takes for errors of the measurement.

    Attributes
    ----------
    index : int64, shape (n,)
        Places in the flattened map, ascending.
    step_m : float64, shape (n,)
        Height of each above what lies around it; negative for pits.
    n_lifted : int
        How many of them lie on patches that are lifted, see `lifted_patches`.
    """

    index: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    step_m: np.ndarray = field(default_factory=lambda: np.empty(0))
    n_lifted: int = 0

    @property
    def both_ways(self) -> bool:
        """Whether as many stand off downwards as upwards, and as far.

        Errors of the measurement do, burrs only stand up: five at least point down, no more than by
        two standard deviations of a fair coin point up, and none twice as far as the deepest.
        """
        n, n_down = self.step_m.size, int(np.count_nonzero(self.step_m < 0.0))
        if n_down < FEWEST_DOWN or n - 2 * n_down > 2.0 * math.sqrt(n):
            return False
        return bool(self.step_m.max() <= -2.0 * self.step_m.min())

    def know_of_each_other(self, nx: int) -> bool:
        """Whether those that touch stand off the same way rather than opposite ways, in rows of nx.

        Errors of single points are as often alike as not, whatever their number: more of the same
        way, by two standard deviations, are parts of things that are wider than a pixel.
        """
        width, up = nx + 1, self.step_m > 0.0  # an empty column: the ends of two rows do not touch
        place = self.index + self.index // nx
        beside = place[:, None] + np.array((1, width - 1, width, width + 1))
        at = np.minimum(np.searchsorted(place, beside), place.size - 1)
        one, neighbour = np.nonzero(place[at] == beside)
        unlike = int(np.count_nonzero(up[one] != up[at[one, neighbour]]))
        return one.size - 2 * unlike > 2.0 * math.sqrt(one.size)


def stand_alone(measured: np.ndarray) -> bool:
    """Tell whether the measured points of a map stand alone.

    Of those inside, fewer than one in fifty has its eight neighbours: where points are missing at
    random, that is from 40 % on. Most measured points around a hole have them all.

    Parameters
    ----------
    measured : bool, shape (ny, nx)

    Examples
    --------
    >>> measured = np.ones((50, 50), dtype=bool)
    >>> measured[:, ::2] = False
    >>> stand_alone(measured), stand_alone(measured[:, 1::2])
    (True, False)
    """
    some = measured[even_lines(len(measured), len(measured) // SAMPLED_LINES)]
    n_lost = some.size - int(np.count_nonzero(some))
    # A missing point has eight neighbours: fewer cannot touch that many of the measured ones
    if 8 * n_lost < (1.0 - LEAST_WHOLE) * (some.size - n_lost):
        return False
    lost = ~measured
    (ny, nx), beside = (n - 2 for n in lost.shape), lost[1:-1, 1:-1].copy()
    n_inside = beside.size - np.count_nonzero(beside)
    for down, right in NEIGHBOURS:
        beside |= lost[1 + down : 1 + down + ny, 1 + right : 1 + right + nx]
    n_whole = beside.size - np.count_nonzero(beside)
    return bool(n_whole < LEAST_WHOLE * n_inside)


def find_outliers(surface: HeightMap, stored: HeightMap | None = None) -> Outliers:
    """Find spikes and bad codes.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form, non-measured points NaN.
    stored : HeightMap, optional
        The same map as stored, where a code has one value; without it, `surface`.

    Returns
    -------
    Outliers
        Empty where there are none.

    Notes
    -----
    A cliff is a height difference of neighbours of more than 8 times the one that 90 % of all
    neighbours stay below. A part is a set of points that hang together without a cliff, diagonals
    included. An island is a part of at most 8 points, or one of up to 1 % of all points that has
    one stored height throughout. An island of one or two points is a *spike* if it stands above or
    below all its measured neighbours, at least five, by more than 4 times the range of their
    heights, highest and lowest left out; where an edge of the map leaves it fewer than five,
    those two pixels away count, too. An island beside a non-measured point is a *bad
    code* if it stands outside the heights of the rest of the face, other such islands left out, by
    more than the range of these; a map without roughness gives no scale for that. What was found
    is no neighbour any more, and the others are judged again. So a cap three pixels wide, a ridge,
    the corner of a step and a rough patch stay: each has a neighbour of about its own height, or
    neighbours that differ among themselves as it does from them.

    Where the measured points stand alone (`stand_alone`), no part is: the eight measured points
    that are nearest are the neighbours there, each point is an island, and a bad code has to be the
    least or the greatest height.

    A few larger parts that are lifted as a whole are outliers, too; see `lifted_patches`.

    On slopes the steps between neighbours are large, and spikes below a cliff are looked for in
    what a plane leaves; see `find_small_spikes`.

    Examples
    --------
    >>> z = 1e-9 * np.random.default_rng(0).standard_normal((50, 60))
    >>> z[20, 30] = z[40, 10] = z[40, 11] = 1e-6
    >>> find_outliers(HeightMap(z, (1e-4, 1e-4))).index
    array([1230, 2410, 2411])
    """
    inner, stored = without_frame(surface), without_frame(stored or surface)
    found = _found(inner, stored)
    if inner is surface:
        return found
    rows, columns = surface.measured_window
    row, col = np.divmod(found.index, inner.shape[1])
    return replace(found, index=(row + rows.start) * surface.shape[1] + col + columns.start)


def _found(surface: HeightMap, stored: HeightMap) -> Outliers:
    if stand_alone(surface.measured):
        return _of_lone_points(surface, stored.height_m.reshape(-1))
    lowest_m, highest_m = surface.bounds_m
    cliff_m = CLIFF_OVER_STEP * _usual_step(surface)
    rough = cliff_m > ROUNDING * max(highest_m, -lowest_m)
    cliff_m = max(cliff_m, ROUNDING * max(highest_m, -lowest_m))
    step_m, bend_m = greatest_steps_m(surface)
    index, island = _islands(surface, cliff_m, step_m)
    off_m, n_lifted = np.empty(0), 0
    if index.size:
        part, part_of = index, island
        few = _few_or_of_one_height(island, stored.at(index))
        index, island = index[few], np.unique(island[few], return_inverse=True)[1]
        if index.size:
            outlier, off_m = _judge(surface, index, island, rough)
            index, off_m = index[outlier], off_m[outlier]
        if rough:
            left = ~np.isin(part, index)
            patch, step_m = lifted_patches(surface, part[left], part_of[left], cliff_m)
            index, off_m, n_lifted = np.append(index, patch), np.append(off_m, step_m), patch.size
    if rough:
        small, small_off_m = find_small_spikes(surface, index, float(bend_m.max()))
        index, off_m = np.append(index, small), np.append(off_m, small_off_m)
        order = np.argsort(index)
        index, off_m = index[order], off_m[order]
    return Outliers(index, off_m, n_lifted)


def _of_lone_points(surface: HeightMap, stored_m: np.ndarray) -> Outliers:
    """Return the outliers of points that stand alone."""
    from scipy.spatial import KDTree

    z_m, (dy_m, dx_m), nx = surface.height_m.reshape(-1), surface.pixel_size_m, surface.shape[1]
    found, off_m = _codes_of_lone_points(z_m, stored_m)
    while True:
        index = np.flatnonzero(~np.isnan(z_m))
        index = index[~np.isin(index, found)]
        if index.size <= NEAREST:
            break
        at_m = np.stack((index // nx * dy_m, index % nx * dx_m), axis=1)
        _, near = KDTree(at_m).query(at_m, NEAREST + 1)
        own_m, ring_m = z_m[index], np.sort(z_m[index[near[:, 1:]]], axis=1)
        step_m = np.abs(ring_m - own_m[:, None]).reshape(-1)
        cliff_m = CLIFF_OVER_STEP * quantile(step_m, STEP_QUANTILE)
        cliff_m = max(cliff_m, ROUNDING * float(np.abs(own_m).max()))
        beyond_m = np.maximum(own_m - ring_m[:, -1], ring_m[:, 0] - own_m)
        first_m, last_m = ring_m[:, 1], ring_m[:, -2]
        new = beyond_m > np.maximum(cliff_m, GAP_OVER_RING * (last_m - first_m))
        if not new.any():
            break
        found = np.append(found, index[new])
        off_m = np.append(off_m, (own_m - 0.5 * (first_m + last_m))[new])
    order = np.argsort(found)
    return Outliers(found[order], off_m[order])


def _codes_of_lone_points(z_m: np.ndarray, stored_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return bad codes among points that stand alone, and their step."""
    found, off_m = np.empty(0, dtype=np.intp), np.empty(0)
    for extreme in (np.fmin, np.fmax):
        code = stored_m == extreme.reduce(stored_m)
        rest_m = z_m[~code & ~np.isnan(z_m)]
        if not rest_m.size or np.count_nonzero(code) > MAX_CODE_SHARE * rest_m.size:
            continue
        lowest_m, highest_m = rest_m.min(), rest_m.max()
        beyond_m = z_m[code] - np.clip(z_m[code], lowest_m, highest_m)
        if np.abs(beyond_m).min() > highest_m - lowest_m:
            found, off_m = np.append(found, np.flatnonzero(code)), np.append(off_m, beyond_m)
    return found, off_m


def _usual_step(z: HeightMap) -> float:
    """Height difference that 90 % of the neighbours stay below, along the rougher axis."""
    usual_m = 0.0
    for axis in (0, 1):
        some = even_lines(z.shape[1 - axis], z.shape[1 - axis] // SAMPLED_LINES)
        lines = z[:, some] if axis == 0 else z[some]
        step_m = np.diff(lines, axis=axis)
        np.abs(step_m, out=step_m)
        usual_m = max(usual_m, quantile(step_m.reshape(-1), STEP_QUANTILE))  # not if that is NaN
    return usual_m


def _islands(z: HeightMap, cliff_m: float, step_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return place, ascending, and number of its island for every point of an island.

    Points without a cliff to any neighbour are joined along their rows, and these runs to those of
    the next row; the few points at a cliff are joined to each other and to the runs.
    """
    shore = _at_cliff(z, cliff_m, step_m)
    lost = z.lost
    none = np.empty(0, dtype=np.intp)
    if not shore.size and not lost.size:
        return none, none
    runs = _runs_between(z.shape, np.union1d(shore, lost) if shore.size else lost)
    n_runs = runs.first.size
    if n_runs + shore.size == 0:
        return none, none
    size = np.append(runs.last - runs.first + 1, np.ones(shore.size, dtype=np.intp))

    member, beside = _neighbours(shore, z.shape)
    joined = np.abs(z.at(beside) - z.at(shore)[member]) <= cliff_m
    member, beside = member[joined], beside[joined]
    place = np.minimum(np.searchsorted(shore, beside), shore.size - 1)
    holding = runs.holding(beside + beside // z.shape[1])
    node = np.where(shore[place] == beside, n_runs + place, holding)
    one, other = runs.pairs()
    pairs = np.append(one, n_runs + member), np.append(other, node)
    part = connected_parts(size.size, *pairs)
    points = np.bincount(part, size)
    aside = np.flatnonzero(part != np.argmax(points))
    if not aside.size:
        return none, none
    first = np.append(runs.first - runs.first // runs.width, shore)[aside]
    index = np.repeat(first - np.cumsum(size[aside]) + size[aside], size[aside])
    index += np.arange(index.size)
    of_index = np.repeat(part[aside], size[aside])
    order = np.argsort(index)
    index, of_index = index[order], of_index[order]
    island = (points <= max(MAX_POINTS, MAX_CODE_SHARE * points.sum()))[of_index]
    return index[island], np.unique(of_index[island], return_inverse=True)[1]


def _few_or_of_one_height(island: np.ndarray, stored_m: np.ndarray) -> np.ndarray:
    """Tell for each point whether its island has few points or one stored height throughout."""
    points = np.bincount(island)
    lowest_m, highest_m = np.full(points.size, np.inf), np.full(points.size, -np.inf)
    np.minimum.at(lowest_m, island, stored_m)
    np.maximum.at(highest_m, island, stored_m)
    few: np.ndarray = ((points <= MAX_POINTS) | (lowest_m == highest_m))[island]
    return few


def _runs_between(shape: tuple[int, int], left_out: np.ndarray) -> Runs:
    """Return the runs between some points that are left out, as if every row had one more such."""
    (ny, nx), width = shape, shape[1] + 1
    ends = np.append(left_out + left_out // nx, np.arange(1, ny + 1) * width - 1)
    ends.sort()
    begin = np.append(-1, ends[:-1]) + 1
    some = begin < ends
    return Runs(begin[some], ends[some] - 1, width)


def _at_cliff(z: HeightMap, cliff_m: float, step_m: np.ndarray) -> np.ndarray:
    """Return the places, rising, of the points that have a cliff to one of their eight neighbours.

    Most blocks of rows have no step as great, `step_m`, and are left at once.
    """
    found = []
    low, every, high = slice(None, -1), slice(None), slice(1, None)
    for rows, greatest_m in zip(row_blocks(z.shape), step_m, strict=True):
        if greatest_m <= cliff_m:
            continue
        block_m = z[rows.start : rows.stop + 1]  # one row more than a block
        at_cliff = np.zeros(block_m.shape, dtype=bool)
        for one, other in (
            ((every, low), (every, high)),
            ((low, every), (high, every)),
            ((low, low), (high, high)),
            ((low, high), (high, low)),
        ):
            cliff = np.abs(block_m[other] - block_m[one]) > cliff_m
            at_cliff[one] |= cliff
            at_cliff[other] |= cliff
        found.append(np.flatnonzero(at_cliff) + rows.start * z.shape[1])
    return np.unique(np.concatenate(found)) if found else np.empty(0, dtype=np.intp)


def _neighbours(
    index: np.ndarray, shape: tuple[int, ...], offsets: Sequence[tuple[int, ...]] = NEIGHBOURS
) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of point (its number in `index`) and neighbour (its place in the map)."""
    down, right = np.array(offsets).T
    row, col = index[:, None] // shape[1] + down, index[:, None] % shape[1] + right
    inside = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    return np.nonzero(inside)[0], (row * shape[1] + col)[inside]


def _judge(
    surface: HeightMap, index: np.ndarray, island: np.ndarray, rough: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return which points of islands are outliers, and how far each stands off what is around it.

    An outlier is no neighbour: each that is found sets its neighbours free, and they are judged
    again. Those of too few neighbours are judged last, by what is two pixels away.
    """
    n = int(island.max()) + 1
    n_points = np.bincount(island, minlength=n)
    own_m = surface.at(index)
    centre_m = np.bincount(island, own_m, minlength=n) / n_points
    ring, beside, open_ = _rings(surface, index, island)
    beside_m = surface.at(beside)
    outlier, middle_m, wider = np.zeros(n, dtype=bool), np.zeros(n), False
    while True:
        n_ring = np.bincount(ring, minlength=n)
        spike = ~outlier & (n_ring >= MIN_RING_POINTS) & (n_points <= MAX_SPIKE_POINTS)
        end = np.cumsum(n_ring)[spike]
        start = end - n_ring[spike]
        first, last = beside_m[start + 1], beside_m[end - 2]
        middle_m[spike] = 0.5 * (first + last)
        above_m, below_m = centre_m[spike] - beside_m[end - 1], beside_m[start] - centre_m[spike]
        spike[spike] = np.maximum(above_m, below_m) > GAP_OVER_RING * (last - first)

        code = open_ & ~outlier & ~spike & rough
        if code.any():
            aside = (outlier | spike | code)[island]
            lowest_m, highest_m = surface.without(index[aside]).bounds_m
            off_m = centre_m - np.clip(centre_m, lowest_m, highest_m)
            code &= np.abs(off_m) > highest_m - lowest_m
            middle_m[code] = centre_m[code] - off_m[code]
        new = spike | code
        outlier |= new
        if not new.any():
            few = ~outlier & ~open_ & (n_points <= MAX_SPIKE_POINTS) & (n_ring < MIN_RING_POINTS)
            if wider or not few.any():
                return outlier[island], own_m - middle_m[island]
            wider, of_few, enough = True, few[island], ~few[ring]
            more, further, _ = _rings(surface, index[of_few], island[of_few], TWO_AWAY)
            ring, beside = np.append(ring[enough], more), np.append(beside[enough], further)
            order = np.lexsort((surface.at(beside), ring))
            ring, beside = ring[order], beside[order]
            beside_m = surface.at(beside)
        place = np.minimum(np.searchsorted(index, beside), index.size - 1)
        gone = (index[place] == beside) & outlier[island[place]]
        ring, beside, beside_m = ring[~gone], beside[~gone], beside_m[~gone]


def _rings(
    surface: HeightMap,
    index: np.ndarray,
    island: np.ndarray,
    offsets: Sequence[tuple[int, ...]] = NEIGHBOURS,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what is around the islands.

    Pairs of island and measured point beside it, by island and then by height, and which islands
    have a non-measured point beside them.
    """
    member, beside = _neighbours(index, surface.shape, offsets)
    around = island[member]
    missing = np.isnan(surface.at(beside))
    open_ = np.bincount(around[missing], minlength=int(island.max()) + 1) > 0
    place = np.minimum(np.searchsorted(index, beside), index.size - 1)
    keep = ~missing & ~((index[place] == beside) & (island[place] == around))
    # A point beside two of an island counts once.
    ring, beside = np.unique(np.stack((around[keep], beside[keep])), axis=1)
    order = np.lexsort((surface.at(beside), ring))
    return ring[order], beside[order], open_
