"""Blocks of points: rows that stay in the cache, sums and means over squares."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from capslip.surface.heightmap import HeightMap

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


def block_means(surface: HeightMap, step: int) -> HeightMap:
    """Return the means of square blocks; what is left over falls away on both sides.

    A block is measured where half of its points are: of large blocks nearly all lack some.
    """
    ny, nx = (n // step for n in surface.shape)
    top, left = ((n % step) // 2 for n in surface.shape)
    inner = surface.height_m[top : top + ny * step, left : left + nx * step]
    total_m, points = np.empty((ny, nx)), np.full(ny * nx, float(step**2))
    bands, first = inner.reshape(ny, step, nx * step), np.arange(0, nx * step, step)
    at_once = max(1, BLOCK_POINTS // (nx * step**2))
    for begin in range(0, ny, at_once):
        band_m = bands[begin : begin + at_once]
        lost = np.flatnonzero(np.isnan(band_m))
        if lost.size:
            band_m = band_m.copy()
            band_m.reshape(-1)[lost] = 0.0
            block = lost // (nx * step**2) * nx + lost % (nx * step) // step + begin * nx
            np.subtract.at(points, block, 1.0)
        np.add.reduceat(band_m.sum(axis=1), first, axis=1, out=total_m[begin : begin + at_once])
    count = points.reshape(ny, nx)
    height_m = total_m / np.where(count < 0.5 * step**2, np.nan, count)
    dy_m, dx_m = surface.pixel_size_m
    return replace(surface, height_m=height_m, pixel_size_m=(step * dy_m, step * dx_m))


def few_lines(surface: HeightMap, lines: int) -> HeightMap:
    """Return rows and columns of a map at even distances, at least so many where it has them.

    Examples
    --------
    >>> few_lines(HeightMap(np.zeros((7, 10)), (1e-3, 1e-3)), 3).shape
    (4, 4)
    """
    step_y, step_x = (max(1, n // lines) for n in surface.shape)
    dy_m, dx_m = surface.pixel_size_m
    few_m = surface.height_m[::step_y, ::step_x]
    return replace(surface, height_m=few_m, pixel_size_m=(step_y * dy_m, step_x * dx_m))
