"""The change tree of the points above the cut: peaks, and the saddles over which hills join.

A hill is the set of points from which steepest ascent leads to the same peak (ISO 25178-2). Wolf's
pruning joins hills in the order of their saddles; the tree keeps all of these steps, so that the
hills at any pruning height follow from it without a second look at the points.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

BLOCK_POINTS = 40_000  # looked at together, which stay in the cache


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
        return _ends(np.where(chosen, self.neighbour, np.arange(len(self.neighbour))))


def change_tree(point: np.ndarray, height_m: np.ndarray, shape: tuple[int, int]) -> ChangeTree:
    """Build the change tree of some points of a map, with eight neighbours each.

    No two points count as equally high: the sorting decides. A plateau thus needs no rule of its
    own; it may fall apart into hills, but these have no prominence.

    Parameters
    ----------
    point : int64, shape (n,)
        Flat indices of the points, none on the edge of the map.
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
    order = _falling(height_m)
    n = len(point)
    rank = np.empty(n, dtype=np.int32)  # 0 is the highest
    rank[order] = np.arange(n, dtype=np.int32)
    by_place = np.argsort(point, kind="stable")
    lattice = _Lattice(point[by_place], rank[by_place], shape)
    uphill = lattice.uphill()
    summit = _ends(uphill)
    peak = np.flatnonzero(summit == np.arange(n))
    number = np.full(n, -1, dtype=np.int32)
    number[peak] = np.arange(len(peak))
    hill_of_rank = number[summit]
    saddle, across = _joined(len(peak), *lattice.passes(hill_of_rank))
    falling_m = np.append(height_m[order], -np.inf)
    return ChangeTree(point, hill_of_rank[rank], falling_m[peak], falling_m[saddle], across)


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Points of a map by place, each with its rank by height: who is beside whom."""

    point: np.ndarray  # (n,), rising
    rank: np.ndarray  # (n,)
    shape: tuple[int, int]

    def _blocks(self) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Yield some points, their places in a block of rows, and the ranks there, n elsewhere.

        A block has one row more on both sides, and stays in the cache.
        """
        (height, width), n = self.shape, len(self.point)
        n_rows = max(8, BLOCK_POINTS // width)
        for first in range(1, height - 1, n_rows):
            last = min(first + n_rows, height - 1)
            before, start, end, after = np.searchsorted(
                self.point, np.array((first - 1, first, last, last + 1)) * width
            )
            if start == end:
                continue
            origin = (first - 1) * width
            ranks = np.full((last - first + 2) * width, n, dtype=np.int32)
            ranks[self.point[before:after] - origin] = self.rank[before:after]
            yield slice(start, end), self.point[start:end] - origin, ranks

    def uphill(self) -> np.ndarray:
        """Return the highest rank around each rank, its own included, shape (n,)."""
        uphill, width = np.empty_like(self.rank), self.shape[1]
        for some, at, ranks in self._blocks():
            own = self.rank[some]
            least = own.copy()
            for step in (1, width - 1, width, width + 1):
                np.minimum(least, ranks[at - step], out=least)
                np.minimum(least, ranks[at + step], out=least)
            uphill[own] = least
        return uphill

    def passes(self, hill_of_rank: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return every two hills that touch and the rank of the pass between, highest pass first.

        Of two neighbouring points on different hills the lower one makes a pass; the highest
        counts.
        """
        n_hills = np.int64(hill_of_rank.max(initial=0)) + 1
        hills, width = np.append(hill_of_rank, np.int32(-1)), self.shape[1]
        pairs, passes = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int32)]
        for some, at, ranks in self._blocks():
            own = self.rank[some]
            hill = hill_of_rank[own]
            for step in (1, width - 1, width, width + 1):
                beside = ranks[at - step]
                other = hills[beside]
                meet = np.flatnonzero((other != hill) & (other >= 0))
                here, there = hill[meet].astype(np.int64), other[meet]
                pairs.append(np.minimum(here, there) * n_hills + np.maximum(here, there))
                passes.append(np.maximum(own[meet], beside[meet]))
        pair, rank = np.concatenate(pairs), np.concatenate(passes)
        if pair.size == 0:
            return pair, pair, rank
        order = np.argsort(pair)
        pair, rank = pair[order], rank[order]
        first = np.flatnonzero(np.diff(pair, prepend=-1))
        pair, rank = pair[first], np.minimum.reduceat(rank, first)
        order = np.argsort(rank, kind="stable")
        return pair[order] // n_hills, pair[order] % n_hills, rank[order]


def _falling(height_m: np.ndarray) -> np.ndarray:
    """Sort by falling height; equal heights stay in order, so that every machine does the same."""
    order = np.argsort(-height_m)
    if (np.diff(height_m[order]) == 0.0).any():
        order = np.argsort(-height_m, kind="stable")  # several times as slow
    return order


def _ends(pointer: np.ndarray) -> np.ndarray:
    """Follow every pointer to where it ends, doubling the stride each time."""
    while True:
        further = pointer[pointer]
        if np.array_equal(further, pointer):
            return pointer
        pointer = further


def _joined(
    n_hills: int, first: np.ndarray, second: np.ndarray, rank: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Join hills over the passes in turn; of the two peaks the lower one ends at this saddle.

    Each step needs the one before. Rounds of whole arrays need as many of them as hills wait for
    one another in a row, all of them in the worst case; this loop takes a microsecond a pass.
    """
    parent = list(range(n_hills))
    saddle, across = [-1] * n_hills, list(range(n_hills))
    for a, b, at in zip(first.tolist(), second.tolist(), rank.tolist(), strict=True):
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
