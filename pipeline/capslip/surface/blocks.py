"""Blocks of points: rows that stay in the cache, and sums over squares."""

from collections.abc import Iterator

import numpy as np

BLOCK_POINTS = 80_000  # looked at together: what is computed of them stays in the cache


def row_blocks(shape: tuple[int, ...]) -> Iterator[slice]:
    """Yield the rows of a map, some at a time.

    Examples
    --------
    >>> list(row_blocks((15, 8000)))
    [slice(0, 10, None), slice(10, 15, None)]
    """
    n_rows = max(1, BLOCK_POINTS // shape[1])
    for first in range(0, shape[0], n_rows):
        yield slice(first, min(first + n_rows, shape[0]))


def block_sums(values: np.ndarray, side: int) -> np.ndarray:
    """Return the sums over blocks of `side` x `side` points; what is left over falls away.

    Examples
    --------
    >>> block_sums(np.ones((5, 6)), 2)
    array([[4., 4., 4.],
           [4., 4., 4.]])
    """
    ny, nx = (n // side for n in values.shape)
    inner = values[: ny * side, : nx * side]
    sums: np.ndarray = inner.reshape(ny, side, nx, side).sum(axis=(1, 3))
    return sums
