"""Connected parts of what touches: points of a map joined along their rows, and rows to rows."""

from dataclasses import dataclass

import numpy as np

from capslip.surface.rows import BLOCK_POINTS


@dataclass(frozen=True, eq=False)
class Runs:
    """Points that follow one another along the rows of a map, each run of them as one.

    Places count row by row. At least one point lies between the last of a row and the first of the
    next, so that no run goes on.
    """

    first: np.ndarray
    last: np.ndarray
    width: int  # of a row, with that point

    def holding(self, place: np.ndarray) -> np.ndarray:
        """Return the runs that hold some places."""
        return np.searchsorted(self.first, place, "right") - 1

    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Return all pairs of runs that touch from row to row, diagonals included."""
        start = np.searchsorted(self.last, self.first - self.width - 1)
        stop = np.searchsorted(self.first, self.last - self.width + 1, "right")
        count = np.maximum(stop - start, 0)
        one = np.repeat(np.arange(count.size), count)
        other = np.repeat(start - np.cumsum(count) + count, count) + np.arange(one.size)
        return one, other


def connected_parts(n: int, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the part of each of n nodes, 0 ... numbered by the first node of each.

    Parameters
    ----------
    n : int
    one, other : int, shape (m,)
        Nodes that are joined.

    Notes
    -----
    Of two parts that are joined the one with the later first node hangs itself on the other; each
    round leaves half of them at most. `scipy.sparse.csgraph` does the same and takes longer to load
    than a map to analyse.

    Examples
    --------
    >>> connected_parts(5, np.array([4, 3]), np.array([1, 0]))
    array([0, 1, 2, 0, 1])
    """
    root = np.arange(n)
    while one.size:
        one, other = root[one], root[other]
        apart = one != other
        one, other = one[apart], other[apart]
        np.minimum.at(root, np.maximum(one, other), np.minimum(one, other))
        root = ends(root)
    number = np.cumsum(root == np.arange(n)) - 1
    parts: np.ndarray = number[root]
    return parts


def ends(pointer: np.ndarray) -> np.ndarray:
    """Follow every pointer to where it ends, doubling the stride each time.

    Examples
    --------
    >>> ends(np.array([0, 0, 1, 3]))
    array([0, 0, 0, 3])
    """
    while True:
        further = np.empty_like(pointer)
        for first in range(0, pointer.size, BLOCK_POINTS):  # each makes a long index of its own
            part = slice(first, first + BLOCK_POINTS)
            further[part] = pointer.take(pointer[part])
        if np.array_equal(further, pointer):
            return pointer
        pointer = further
