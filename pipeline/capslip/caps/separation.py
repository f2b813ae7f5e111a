"""The change tree of the points above the cut: peaks, and the saddles over which hills join.

A hill is the set of points from which steepest ascent leads to the same peak (ISO 25178-2). Wolf's
pruning joins hills in the order of their saddles; the tree keeps all of these steps, so that the
hills at any pruning height follow from it without a second look at the points.
"""

from dataclasses import dataclass

import numpy as np


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
    map_of_ranks = np.full(shape[0] * shape[1], n, dtype=np.int32)
    map_of_ranks[point] = rank

    uphill = np.empty(n, dtype=np.int32)  # of each rank, the highest rank around it
    uphill[rank] = _least_around(map_of_ranks.reshape(shape)).reshape(-1)[point]
    summit = _ends(uphill)
    peak = np.flatnonzero(summit == np.arange(n))
    number = np.full(n, -1, dtype=np.int32)
    number[peak] = np.arange(len(peak))
    hill = number[summit][rank]
    saddle, across = _joined(len(peak), *_passes(point, hill, map_of_ranks, shape[1]))
    falling_m = np.append(height_m[order], -np.inf)
    return ChangeTree(point, hill, falling_m[peak], falling_m[saddle], across)


def _least_around(values: np.ndarray) -> np.ndarray:
    """Return the least of each value and its eight neighbours; on the frame, of fewer."""
    rows = values.copy()
    np.minimum(rows[:, :-1], values[:, 1:], out=rows[:, :-1])
    np.minimum(rows[:, 1:], values[:, :-1], out=rows[:, 1:])
    least = rows.copy()
    np.minimum(least[:-1], rows[1:], out=least[:-1])
    np.minimum(least[1:], rows[:-1], out=least[1:])
    return least


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


def _passes(
    point: np.ndarray, hill: np.ndarray, map_of_ranks: np.ndarray, width: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return every two hills that touch and the rank of the pass between them, highest pass first.

    Of two neighbouring points on different hills the lower one makes a pass; the highest counts.
    """
    n_hills = np.int64(hill.max(initial=0)) + 1
    map_of_hills = np.full(map_of_ranks.size, -1, dtype=np.int32)
    map_of_hills[point] = hill
    pairs, passes = [], []
    for step in (1, width - 1, width, width + 1):
        other = map_of_hills[point - step]
        at = np.flatnonzero((other != hill) & (other >= 0))
        here, there = hill[at].astype(np.int64), other[at]
        pairs.append(np.minimum(here, there) * n_hills + np.maximum(here, there))
        passes.append(np.maximum(map_of_ranks[point[at]], map_of_ranks[point[at] - step]))
    pair, rank = np.concatenate(pairs), np.concatenate(passes)
    if pair.size == 0:
        return pair, pair, rank
    order = np.argsort(pair)
    pair, rank = pair[order], rank[order]
    first = np.flatnonzero(np.diff(pair, prepend=-1))
    pair, rank = pair[first], np.minimum.reduceat(rank, first)
    order = np.argsort(rank, kind="stable")
    return pair[order] // n_hills, pair[order] % n_hills, rank[order]


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
