"""Spikes that the slopes of a smooth face hide: points that stand off what a plane leaves."""

import math
from dataclasses import dataclass, replace

import numpy as np

from capslip.surface.graph import connected_parts
from capslip.surface.heightmap import HeightMap, Heights
from capslip.surface.noise import on_lattice
from capslip.surface.quantile import quantile
from capslip.surface.rows import BLOCK_POINTS

LINES = ((0, 1), (1, 0), (1, 1), (1, -1))
X, Y = LINES[:1], LINES[1:2]
NEXT, FRAME = 8, 2  # neighbours, the first of those around; how far these reach
AROUND = sorted(
    ((i, j) for i in range(-FRAME, FRAME + 1) for j in range(-FRAME, FRAME + 1) if i or j),
    key=lambda step: max(map(abs, step)),
)
SAMPLES = 10_000
USUAL_QUANTILE = 0.90
OVER_USUAL = 40.0  # scans of real faces, grooves and edges included, have no such point below 61
OVER_STEP = 1.5  # of neighbours: less moves no answer, and is what smoothed steps leave
GAP_OVER_RING = 8.0
CLEAR = 0.25  # of what it stands off: least distance from each height around it
FLANK = 1.9  # times as far the other way: what stands off only because its neighbour does
LIKE = 0.55  # of what a crowded spike stands off: what stands off as much is another
LEAST_OFF = 0.5  # of the gate, along the line of two spikes side by side
MIN_RING_POINTS = 6  # three more than a plane needs
ON_A_LINE = 0.5  # determinant of the places of a ring: whole numbers off a line give more
ALWAYS = 2  # points of a group: no part of a hill that the map resolves
# Shapes of 1, 2, 3 ... points that hang together, diagonals included, on squares
SHAPES = (1, 4, 20, 110, 638, 3832, 23592, 147941)
UNLIKELY = 0.01  # groups of a size on a map, below which chance put none of them
ROUNDING = 1e-9


def find_small_spikes(
    surface: HeightMap, known: np.ndarray, bend_m: float = math.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Find the spikes that are lower than the usual steps of a slope are times eight.

    Parameters
    ----------
    surface : HeightMap
    known : int64, shape (k,)
        Places of the outliers that were found before.
    bend_m : float
        None along a row or column is greater, see `greatest_steps_m`.

    Returns
    -------
    index : int64, shape (n,)
        Places of the spikes in the flattened map.
    off_m : float64, shape (n,)
        Height of each over the plane through what is around it.

    Notes
    -----
    What a point stands off is told along the four lines through it: its height above the middle of
    its two neighbours there, which no slope changes. On faces that a map resolves the least of the
    four is a trifle: neither a rim, nor a ridge, nor a step has it. Points that stand off along any
    line by more than 40 times what 90 % of all points do along each are grouped where they touch
    and have the same sign. A group is a spike if all of it stands off the plane through the points
    around it by more than 8 times the range of what these leave, highest and lowest left out, and
    by more than 1.5 times the usual step of neighbours, and a quarter of that from the highest of
    them (for pits, the lowest): on a cliff the plane itself is steep. So a cone three pixels wide
    stays: its flank is no plane. What was found is put on its plane, the others are judged again.

    Groups of one or two points count. A share p of spikes at random puts a p^k N groups of k points
    side by side, with a the number of their shapes (1, 4, 20, 110 ...); where that is no less than
    0.01, and they are no more than that by three standard deviations, larger ones count, too: up to
    eight points.
    """
    none = np.empty(0, dtype=np.intp), np.empty(0)
    usual_m, step_m = _usual(surface)
    if not usual_m > ROUNDING * max(map(abs, surface.bounds_m)):
        return none
    gate_m = max(OVER_USUAL * usual_m, OVER_STEP * step_m)
    if bend_m <= gate_m or (not known.size and not _may_hold_some(surface, gate_m)):
        return none
    left, n = _Left.of(surface, known), surface.n_measured - known.size
    most = ALWAYS
    found, off_m = none
    while True:
        new, new_off_m, size = _groups(left, gate_m, most > ALWAYS)
        expected = _by_chance(n, (known.size + found.size) / n)
        most = int(np.max(np.flatnonzero(expected >= UNLIKELY), initial=ALWAYS - 1)) + 1
        number = np.bincount(size, minlength=len(SHAPES) + 1)[1:] / np.arange(1, len(SHAPES) + 1)
        likely = number <= expected + 3.0 * np.sqrt(expected) + 1.0
        taken = (size <= ALWAYS) | ((size <= most) & likely[size - 1])
        if not taken.any():
            return found, off_m
        new, new_off_m = new[taken], new_off_m[taken]
        found, off_m = np.append(found, left.on_map(new)), np.append(off_m, new_off_m)
        left = left.put(new, left.at(new) - new_off_m)


@dataclass(frozen=True, eq=False)
class _Left:
    """A map in a frame of non-measured points, of which some have other heights.

    A copy of a large map would be the most that its analysis holds.
    """

    surface: HeightMap
    index: np.ndarray  # rising, of the points with other heights, counted in the frame
    height_m: np.ndarray

    @classmethod
    def of(cls, surface: HeightMap, lost: np.ndarray) -> "_Left":
        """Return a map less some points, in any order."""
        left = cls(surface, np.empty(0, dtype=np.intp), np.empty(0))
        row, col = np.divmod(lost, surface.shape[1])
        index = (row + FRAME) * left.shape[1] + col + FRAME
        return left.put(index, np.full(lost.size, np.nan))

    def put(self, index: np.ndarray, height_m: np.ndarray) -> "_Left":
        """Return it with other heights at some points."""
        index, first = np.unique(np.append(index, self.index), return_index=True)
        return replace(self, index=index, height_m=np.append(height_m, self.height_m)[first])

    @property
    def shape(self) -> tuple[int, int]:
        ny, nx = self.surface.shape
        return ny + 2 * FRAME, nx + 2 * FRAME

    def on_map(self, index: np.ndarray) -> np.ndarray:
        """Return the places on the map of points inside the frame."""
        row, col = np.divmod(index, self.shape[1])
        return (row - FRAME) * self.surface.shape[1] + col - FRAME

    def __getitem__(self, rows: slice) -> np.ndarray:
        """Return the heights of some rows."""
        (ny, _), nx = self.surface.shape, self.shape[1]
        block_m = np.full((rows.stop - rows.start, nx), np.nan)
        first, last = max(rows.start, FRAME), min(rows.stop, ny + FRAME)
        inner_m = self.surface[first - FRAME : last - FRAME]
        block_m[first - rows.start : last - rows.start, FRAME:-FRAME] = inner_m
        some = slice(*np.searchsorted(self.index, (rows.start * nx, rows.stop * nx)))
        block_m.reshape(-1)[self.index[some] - rows.start * nx] = self.height_m[some]
        return block_m

    def at(self, index: np.ndarray) -> np.ndarray:
        """Return the heights of some points, counted in the frame."""
        (ny, nx), width = self.surface.shape, self.shape[1]
        row, col = index // width - FRAME, index % width - FRAME
        inside = (row >= 0) & (row < ny) & (col >= 0) & (col < nx)
        height_m = np.full(index.shape, np.nan)
        height_m[inside] = self.surface.at(row[inside] * nx + col[inside])
        if self.index.size:
            place = np.minimum(np.searchsorted(self.index, index), self.index.size - 1)
            other = self.index[place] == index
            height_m[other] = self.height_m[place[other]]
        return height_m


def _may_hold_some(surface: HeightMap, gate_m: float) -> bool:
    """Tell whether a map may hold a spike: not one whose points are all inside, and stand off less.

    Rims and ridges stand off along some lines only.
    """
    (ny, nx), every = surface.shape, slice(None)
    if not surface.complete or _at_gate(surface[every, :: nx - 1], gate_m, Y).size:
        return True
    index = _at_gate(surface, gate_m, X)
    inside = (index >= nx) & (index < (ny - 1) * nx)
    off_m = np.abs(_least(_stand_off(surface, index[inside])))
    return bool(not inside.all() or (off_m > LEAST_OFF * gate_m).any())


def _by_chance(n: int, share: float) -> np.ndarray:
    """Return how many groups of 1, 2, 3 ... points chance makes of a share of n points."""
    return np.array([n * shapes * share ** (k + 1) for k, shapes in enumerate(SHAPES)])


def _stand_off(z: HeightMap | _Left, index: np.ndarray) -> np.ndarray:
    """Return heights of inner points above the middle of two neighbours, along lines, (4, k)."""
    return _off_and_across(z, index)[0]


def _off_and_across(z: HeightMap | _Left, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the same, and what lies after less what lies before the points, both (4, k)."""
    along = np.array([i * z.shape[1] + j for i, j in LINES])[:, None]
    near_m = z.at(np.concatenate((index[None], index + along, index - along)))
    own_m, after_m, before_m = near_m[0], near_m[1:5], near_m[5:]
    return own_m - 0.5 * (after_m + before_m), after_m - before_m


def _least(off_m: np.ndarray) -> np.ndarray:
    """Return the least of what points stand off along their lines, 0 where signs differ."""
    low_m, high_m = np.fmin.reduce(off_m), np.fmax.reduce(off_m)
    return np.where(low_m > 0.0, low_m, np.where(high_m < 0.0, high_m, 0.0))


def _usual(z: HeightMap) -> tuple[float, float]:
    """Return the least that 90 % of some points stand off by, and the step from one to the next.

    Of the slopes along four lines the second greatest counts: a spike spoils the greatest.
    """
    every = max(1, math.isqrt(z.size // SAMPLES))
    row, col = (np.arange(1, n - 1) for n in z.shape)
    row = row[on_lattice(row, z.shape[0], every)]
    col = col[on_lattice(col, z.shape[1], every)]
    index = (row[:, None] * z.shape[1] + col).reshape(-1)
    off_m, across_m = _off_and_across(z, index)
    whole = ~np.isnan(off_m).any(axis=0)
    if not whole.any():
        return 0.0, 0.0
    if not whole.all():
        off_m, across_m = (np.compress(whole, one_m, axis=1) for one_m in (off_m, across_m))
    slope_m = np.abs(across_m)
    high_m, low_m = (of(slope_m[:2], slope_m[2:]) for of in (np.maximum, np.minimum))
    # The second greatest: the lesser of two that are the greater of a pair, or beside the greatest
    second_m = np.minimum(*high_m), np.where(high_m[0] > high_m[1], *low_m)
    slope_m = 0.5 * np.maximum(*second_m)
    usual_m = quantile(np.abs(_least(off_m)), USUAL_QUANTILE)
    return usual_m, quantile(slope_m, USUAL_QUANTILE)


def _at_gate(z: Heights | _Left, gate_m: float, lines: tuple[tuple[int, int], ...]) -> np.ndarray:
    """Return places, rising, of points that stand off by half a gate along one of some lines.

    One of two spikes side by side stands off by half its height along the line of both.
    """
    (ny, nx), found = z.shape, []
    n_rows = max(8, BLOCK_POINTS // nx)
    for i, j in lines:
        left, right = abs(j), nx - abs(j)
        for first in range(i, ny - i, n_rows):
            last = min(first + n_rows, ny - i)
            block_m, n = z[first - i : last + i], last - first
            twice_m = block_m[:n, left - j : right - j] + block_m[2 * i :, left + j : right + j]
            twice_m -= 2.0 * block_m[i : i + n, left:right]
            high_m = np.fmax.reduce(twice_m, axis=None)
            if max(high_m, -np.fmin.reduce(twice_m, axis=None)) <= gate_m:
                continue
            row, col = np.nonzero(np.abs(twice_m) > gate_m)
            found.append((row + first) * nx + col + left)
    return np.unique(np.concatenate(found)) if found else np.empty(0, dtype=np.intp)


def _groups(z: _Left, gate_m: float, crowded: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places of points in groups that stand off, by how much, and the groups' sizes.

    Crowded spikes stand in each other's rings, and are left out of them.
    """
    index = _at_gate(z, gate_m, LINES if crowded else LINES[:2])
    nx = z.shape[1]
    off_m = _stand_off(z, index)
    alone = index[np.abs(_least(off_m)) > gate_m]  # stand off in every direction: in no ring
    off_m = np.where(np.isnan(off_m), 0.0, off_m)
    most_m = np.take_along_axis(off_m, np.abs(off_m).argmax(axis=0)[None], axis=0)[0]
    steep = np.abs(most_m) > gate_m
    index, most_m = index[steep], most_m[steep]
    up = most_m > 0.0
    if not index.size:
        return index, np.empty(0), index
    down, right = np.array(AROUND).T
    beside = index[:, None] + down * nx + right
    place = np.minimum(np.searchsorted(index, beside), index.size - 1)
    known = index[place] == beside
    other = known & (up[place] != up[:, None])
    far_m = np.abs(most_m)
    flank = (other & (far_m[place] >= FLANK * far_m[:, None]))[:, :NEXT].any(axis=1)
    mate = known & (up[place] == up[:, None]) & ~flank[place] & ~flank[:, None]
    one, neighbour = np.nonzero(mate[:, :NEXT])
    group = connected_parts(index.size, one, place[one, neighbour])
    ring = ~np.isnan(z.at(beside)) & ~np.isin(beside, alone)
    ring &= ~(known & (group[place] == group[:, None]))
    if crowded:
        ring &= ~known | (far_m[place] < LIKE * far_m[:, None])
    size = np.bincount(group)[group]
    small = (size <= len(SHAPES)) & ~flank
    group = np.unique(group[small], return_inverse=True)[1]
    of, at = _rings(group, beside[small], ring[small])
    enough = np.bincount(of, minlength=int(group.max(initial=-1)) + 1) >= MIN_RING_POINTS
    number = np.cumsum(enough) - 1
    small[small] = enough[group]
    at, of, group = at[enough[of]], number[of[enough[of]]], number[group[enough[group]]]
    if not at.size:
        return at, np.empty(0), at
    off_m = _off_ring(z, gate_m, (index[small], group), (at, of))
    fine = (np.bincount(group, np.isnan(off_m)) == 0)[group]
    return index[small][fine], off_m[fine], size[small][fine]


def _rings(
    group: np.ndarray, beside: np.ndarray, free: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of group and free point around it: next to it, where these are enough."""
    pairs = []
    for reach in (NEXT, len(AROUND)):
        member, neighbour = np.nonzero(free[:, :reach])
        pairs.append(np.unique(np.stack((group[member], beside[member, neighbour])), axis=1))
    (next_of, next_at), (of, at) = pairs
    few = np.bincount(next_of, minlength=int(group.max(initial=-1)) + 1) < MIN_RING_POINTS
    keep, more = ~few[next_of], few[of]
    return np.append(next_of[keep], of[more]), np.append(next_at[keep], at[more])


def _off_ring(
    z: _Left,
    gate_m: float,
    points: tuple[np.ndarray, np.ndarray],
    ring: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return heights of points over the plane of the ring of their group, NaN for what is none.

    `points` and `ring` are places, and the number of the group of each.
    """
    (index, group), (at, of), nx = points, ring, z.shape[1]
    own_m, ring_m = z.at(index), z.at(at)
    plane = _planes(z, at, of)
    end = np.cumsum(np.bincount(of))
    begin = np.append(0, end[:-1])
    rest_m = ring_m - _on_plane(plane, at, of, nx)
    rest_m, ring_m = rest_m[np.lexsort((rest_m, of))], ring_m[np.lexsort((ring_m, of))]
    off_m = own_m - _on_plane(plane, index, group, nx)
    range_m = (rest_m[end - 2] - rest_m[begin + 1])[group]
    beyond_m = np.maximum(off_m - rest_m[end - 1][group], rest_m[begin][group] - off_m)
    # On a cliff the plane is as steep: what is no part of one is beyond the heights, too
    up_m, down_m = own_m - ring_m[end - 1][group], ring_m[begin][group] - own_m
    clear = np.where(off_m > 0.0, up_m, down_m) > CLEAR * np.abs(off_m)
    fine = (beyond_m > GAP_OVER_RING * range_m) & (np.abs(off_m) > gate_m) & clear
    return np.where(fine, off_m, np.nan)


def _planes(z: _Left, at: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Return level, slopes along y and x, and the place (y, x) they count from, of some planes.

    Each goes through the points of a ring by least squares; NaN where these lie on a line.
    """
    (row, col), height_m = np.divmod(at, z.shape[1]), z.at(at)
    n_ring = np.bincount(of)
    plane = np.full((5, n_ring.size), np.nan)
    plane[3], plane[4] = (np.bincount(of, place) / n_ring for place in (row, col))
    y, x = row - plane[3][of], col - plane[4][of]
    terms = np.ones_like(y), y, x
    matrix = np.array([[np.bincount(of, one * other) for one in terms] for other in terms])
    right_m = np.array([np.bincount(of, one * height_m) for one in terms])
    enough = matrix[1, 1] * matrix[2, 2] - matrix[1, 2] ** 2 > ON_A_LINE
    matrix, right_m = np.moveaxis(matrix, -1, 0)[enough], right_m.T[enough]
    plane[:3, enough] = np.linalg.solve(matrix, right_m[..., None])[..., 0].T
    return plane


def _on_plane(plane: np.ndarray, at: np.ndarray, of: np.ndarray, nx: int) -> np.ndarray:
    """Return the heights of planes at places."""
    level_m, down, right, row, col = plane[:, of]
    height_m: np.ndarray = level_m + down * (at // nx - row) + right * (at % nx - col)
    return height_m
