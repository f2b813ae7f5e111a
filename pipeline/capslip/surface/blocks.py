"""Sums over square blocks of points: what a coarser look at a map is made of."""

import numpy as np


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
