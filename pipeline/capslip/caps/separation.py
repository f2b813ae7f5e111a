"""The change tree of the points above the cut: peaks, and the saddles over which hills join.

A hill is the set of points from which steepest ascent leads to the same peak (ISO 25178-2). Wolf's
pruning joins hills in the order of their saddles; the tree keeps all of these steps, so that the
hills at any pruning height follow from it without a second look at the points.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from capslip.surface.graph import Runs, connected_parts, ends
from capslip.surface.rows import BLOCK_POINTS


@dataclass(frozen=True, eq=False)
class ChangeTree:
    """Peaks and saddles of n points on m hills, which are numbered by falling height of the peak.

    Attributes
    ----------
    point : int64, shape (n,)
        Flat indices into the map, as given.
    hill : int32, shape (n,)
        Hill of each point, 0 ... m-1.
    peak_m : float64, shape (m,)
        Height of each peak.
    saddle_m : float64, shape (m,)
        Height at which the hill, with all lower ones that it took in above, meets one with a higher
        peak; -inf for the highest hill of a connected region.
    neighbour : int64, shape (m,)
        The hill on the other side of that saddle; the hill itself where there is none.
    """

    point: np.ndarray
    hill: np.ndarray
    peak_m: np.ndarray
    saddle_m: np.ndarray
    neighbour: np.ndarray

    @property
    def prominence_m(self) -> np.ndarray:
        """Height of each peak above its saddle, inf for the highest of a region, shape (m,)."""
        return self.peak_m - self.saddle_m

    def join(self, chosen: np.ndarray) -> np.ndarray:
        """Join the chosen hills to their neighbours; the highest of a region stays in any case.

        Parameters
        ----------
        chosen : bool, shape (m,)

        Returns
        -------
        int64, shape (m,)
            The hill that each hill then belongs to.
        """
        return ends(np.where(chosen, self.neighbour, np.arange(len(self.neighbour))))


def change_tree(point: np.ndarray, height_m: np.ndarray, shape: tuple[int, int]) -> ChangeTree:
    """Build the change tree of some points of a map, with eight neighbours each.

    No two points count as equally high: the first one is higher. A plateau thus needs no rule of
    its own; it may fall apart into hills, but these have no prominence.

    Parameters
    ----------
    point : int64, shape (n,)
        Flat indices of the points, rising, none on the edge of the map.
    height_m : float64, shape (n,)
        Their heights.
    shape : (int, int)
        Shape of the map.

    Returns
    -------
    ChangeTree

    Examples
    --------
    >>> z = np.zeros((3, 5))
    >>> z[1] = 0.0, 3.0, 1.0, 2.0, 0.0
    >>> tree = change_tree(np.flatnonzero(z), z[z > 0], z.shape)
    >>> tree.peak_m, tree.saddle_m, tree.neighbour
    (array([3., 2.]), array([-inf,   1.]), array([0, 0]))
    """
    lattice = _Lattice(point, height_m, shape)
    summit = ends(lattice.uphill())
    peak = np.flatnonzero(summit == np.arange(len(point), dtype=np.int32))
    peak = peak[np.argsort(-height_m[peak], kind="stable")]
    number = np.full(len(point), -1, dtype=np.int32)
    number[peak] = np.arange(len(peak))
    hill = summit
    for start in range(0, hill.size, BLOCK_POINTS):  # each makes a long index of its own
        part = slice(start, start + BLOCK_POINTS)
        hill[part] = number.take(summit[part])
    del number, summit
    first, second, saddle_m = lattice.passes(hill)
    saddle, across = _joined(len(peak), first, second)
    return ChangeTree(point, hill, height_m[peak], np.append(saddle_m, -np.inf)[saddle], across)


def region_tree(point: np.ndarray, height_m: np.ndarray, shape: tuple[int, int]) -> ChangeTree:
    """Return the tree of connected regions, each of them one hill.

    It is that of `change_tree` with all hills of a region joined; the parameters are the same.

    Examples
    --------
    >>> z = np.zeros((3, 6))
    >>> z[1] = 0.0, 2.0, 1.0, 0.0, 3.0, 0.0
    >>> tree = region_tree(np.flatnonzero(z), z[z > 0], z.shape)
    >>> tree.hill, tree.peak_m
    (array([1, 1, 0], dtype=int32), array([3., 2.]))
    """
    begin = np.flatnonzero(np.diff(point, prepend=-2) != 1)
    size = np.diff(begin, append=len(point))
    runs = Runs(point[begin], point[begin + size - 1], shape[1])
    region = np.repeat(connected_parts(begin.size, *runs.pairs()), size)
    n = int(region.max(initial=-1)) + 1
    peak_m, at = np.full(n, -np.inf), np.full(n, len(point))
    np.maximum.at(peak_m, region, height_m)
    highest = np.flatnonzero(height_m == peak_m[region])
    np.minimum.at(at, region[highest], highest)
    order = np.lexsort((at, -peak_m))
    number = np.empty(n, dtype=np.int32)
    number[order] = np.arange(n)
    return ChangeTree(point, number[region], peak_m[order], np.full(n, -np.inf), np.arange(n))


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Points of a map by place; of two equally high ones the first counts as higher."""

    point: np.ndarray  # (n,), rising
    height_m: np.ndarray  # (n,)
    shape: tuple[int, int]

    def _blocks(self) -> Iterator[tuple[slice, slice, int, int]]:
        """Yield points, those and what is around them, and place and size of a block of both.

        A block is of rows, one more on both sides, that stay in the cache.
        """
        (height, width) = self.shape
        n_rows = max(8, BLOCK_POINTS // width)
        for first in range(1, height - 1, n_rows):
            last = min(first + n_rows, height - 1)
            before, start, end, after = np.searchsorted(
                self.point,
                np.array(
                    [row * width for row in (first - 1, first, last, last + 1)],
                    dtype=self.point.dtype,
                ),
            )
            if start < end:
                some, around = slice(start, end), slice(before, after)
                yield some, around, (first - 1) * width, (last - first + 2) * width

    def uphill(self) -> np.ndarray:
        """Return the highest of each point and those around it, as a number of a point, (n,)."""
        uphill, width = np.empty(len(self.point), dtype=np.int32), self.shape[1]
        for some, around, origin, size in self._blocks():
            at, place = (self.point[part].astype(np.intp) - origin for part in (some, around))
            block_m = np.full(size, -np.inf)
            block_m[place] = self.height_m[around]
            number = np.empty(size, dtype=np.int32)
            number[place] = np.arange(around.start, around.stop, dtype=np.int32)
            before = -width - 1
            highest_m, best = block_m.take(at + before), np.full(at.size, before)
            for step in (-width, 1 - width, -1, 0, 1, width - 1, width, width + 1):
                height_m = block_m.take(at + step)
                np.putmask(best, height_m > highest_m, step)
                np.maximum(highest_m, height_m, out=highest_m)
            uphill[some] = number.take(at + best)
        return uphill

    def passes(self, hill: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return every two hills that touch and the height of the pass between, highest first.

        Of two neighbouring points on different hills the lower one makes a pass; the highest
        counts. Runs of points on one hill tell where there are any.
        """
        n_hills = np.int64(hill.max(initial=0)) + 1
        begin = np.flatnonzero((np.diff(self.point, prepend=-2) != 1) | (np.diff(hill, prepend=-1)))
        end = begin + np.diff(begin, append=len(hill)) - 1
        runs = Runs(self.point[begin], self.point[end], self.shape[1])
        one, other = runs.pairs()
        apart = hill[begin[one]] != hill[begin[other]]
        one, other = one[apart], other[apart]
        along = np.flatnonzero(runs.first[1:] == runs.last[:-1] + 1)  # the row goes on
        spots = [self._lower(begin[along + 1], end[along])]
        at_once = max(1, BLOCK_POINTS // 8)
        for first in range(0, one.size, at_once):
            some = slice(first, first + at_once)
            spots.append(self._between(runs, begin, end, one[some], other[some]))
        here, there = (
            hill[begin[np.append(ends, run)]] for ends, run in ((along + 1, one), (along, other))
        )
        pair = np.minimum(here, there) * n_hills + np.maximum(here, there)
        pair, spot = self._highest(pair, np.concatenate(spots))
        pass_m = self.height_m[spot]
        order = np.lexsort((spot, -pass_m))  # of equally high ones the first counts as higher
        return pair[order] // n_hills, pair[order] % n_hills, pass_m[order]

    def _lower(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return of two points the lower one; the later of equal ones is the first here."""
        return np.where(self.height_m[other] < self.height_m[one], other, one)

    def _between(
        self, runs: Runs, begin: np.ndarray, end: np.ndarray, one: np.ndarray, other: np.ndarray
    ) -> np.ndarray:
        """Return the passes of pairs of runs, the other in the row before: their places."""
        shift = runs.first[other] + runs.width - runs.first[one]  # from one's first to the other's
        start = np.maximum(shift - 1, 0)
        stop = np.minimum(shift + end[other] - begin[other] + 1, end[one] - begin[one])
        many = stop - start + 1
        ends = np.cumsum(many)
        mine = np.repeat(begin[one] + start - ends + many, many) + np.arange(ends[-1])
        beside = mine + np.repeat(begin[other] - begin[one] - shift, many) + [[-1], [0], [1]]
        known = (beside >= np.repeat(begin[other], many)) & (beside <= np.repeat(end[other], many))
        spot = self._lower(mine, np.where(known, beside, mine))
        height_m = np.where(known, self.height_m[spot], -np.inf)
        highest_m = np.maximum.reduceat(height_m.max(axis=0), ends - many)
        spot = np.where(height_m == np.repeat(highest_m, many), spot, len(self.point)).min(axis=0)
        return np.minimum.reduceat(spot, ends - many)

    def _highest(self, pair: np.ndarray, spot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return each pair once, rising, with its highest point; the first of equal ones."""
        if not pair.size:
            return pair, spot
        order = np.argsort(pair)
        pair, spot = pair[order], spot[order]
        begin = np.flatnonzero(np.diff(pair, prepend=-1))
        height_m = self.height_m[spot]
        highest_m = np.maximum.reduceat(height_m, begin)
        lower = height_m < np.repeat(highest_m, np.diff(begin, append=pair.size))
        spot[lower] = len(self.point)
        return pair[begin], np.minimum.reduceat(spot, begin)


def _joined(n_hills: int, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Join hills over the passes in turn; of the two peaks the lower one ends at this saddle.

    Returns the pass of each, -1 where there is none, and the hill on its other side. Each step
    needs the one before. Rounds of whole arrays need as many of them as hills wait for one another
    in a row, all of them in the worst case; this loop takes a microsecond a pass.
    """
    parent = list(range(n_hills))
    saddle, across = [-1] * n_hills, list(range(n_hills))
    for at, (a, b) in enumerate(zip(first.tolist(), second.tolist(), strict=True)):
        top_a, top_b = a, b
        while parent[top_a] != top_a:
            parent[top_a] = top_a = parent[parent[top_a]]
        while parent[top_b] != top_b:
            parent[top_b] = top_b = parent[parent[top_b]]
        if top_a < top_b:
            parent[top_b], saddle[top_b], across[top_b] = top_a, at, a
        elif top_b < top_a:
            parent[top_a], saddle[top_a], across[top_a] = top_b, at, b
    return np.array(saddle, dtype=np.int64), np.array(across, dtype=np.int64)
