"""Sums and means over squares of points, and maps of fewer."""

from dataclasses import replace

import numpy as np

from capslip.surface.heightmap import HeightMap, Heights
from capslip.surface.rows import BLOCK_POINTS

COARSE_POINTS = 200  # along the shorter side of a coarse map


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


def means_of_blocks(
    values: Heights, side: int, least: float, corner: tuple[int, int] = (0, 0)
) -> np.ndarray:
    """Return the means over blocks of `side` x `side` points; what is left over falls away.

    Parameters
    ----------
    values : float64, shape (ny, nx), or HeightMap
        NaN where nothing is known, which does not count.
    side : int
        Points along a block.
    least : float
        Known points of a block, above 0; of fewer the mean is NaN.
    corner : (int, int)
        Row and column where the first block begins.

    Examples
    --------
    >>> means_of_blocks(np.array([[1.0, 2.0, 7.0], [np.nan, 3.0, 7.0]]), 2, 1)
    array([[2.]])
    """
    top, left = corner
    ny, nx = ((n - begin) // side for n, begin in zip(values.shape, corner, strict=True))
    total, known = np.empty((ny, nx)), np.full(ny * nx, float(side**2))
    first, columns = np.arange(0, nx * side, side), slice(left, left + nx * side)
    at_once = max(1, BLOCK_POINTS // (nx * side**2))
    for begin in range(0, ny, at_once):
        rows = slice(top + begin * side, top + min(begin + at_once, ny) * side)
        band = values[rows, columns].reshape(-1, side, nx * side)
        lost = np.flatnonzero(np.isnan(band))
        if lost.size:
            band = band.copy()
            band.reshape(-1)[lost] = 0.0
            block = lost // (nx * side**2) * nx + lost % (nx * side) // side + begin * nx
            np.subtract.at(known, block, 1.0)
        np.add.reduceat(band.sum(axis=1), first, axis=1, out=total[begin : begin + at_once])
    count = known.reshape(ny, nx)
    return np.asarray(total / np.where(count < least, np.nan, count))


def block_means(surface: HeightMap, step: int) -> HeightMap:
    """Return the means of square blocks; what is left over falls away on both sides.

    A block is measured where half of its points are: of large blocks nearly all lack some. Blocks
    of one point are the map itself.
    """
    if step == 1:
        return surface
    top, left = ((n % step) // 2 for n in surface.shape)
    height_m = means_of_blocks(surface, step, 0.5 * step**2, (top, left))
    dy_m, dx_m = surface.pixel_size_m
    return replace(surface, height_m=height_m, pixel_size_m=(step * dy_m, step * dx_m))


def coarse_map(surface: HeightMap) -> HeightMap:
    """Return the map on which a level is found first: itself, where it is small."""
    return block_means(surface, coarse_step(surface))


def coarse_step(surface: HeightMap) -> int:
    """Return the side of the blocks of which the coarse map has the means, in points."""
    return max(1, round(min(surface.shape) / COARSE_POINTS))


def few_lines(surface: HeightMap, lines: int, side: int = 1) -> HeightMap:
    """Return rows and columns of a map at even distances, at least so many where it has them.

    Of means of square blocks with so many points a side, see `block_means`, which are not computed
    elsewhere.

    Examples
    --------
    >>> few_lines(HeightMap(np.zeros((7, 10)), (1e-3, 1e-3)), 3).shape
    (4, 4)
    """
    step_y, step_x = (max(1, n // side // lines) for n in surface.shape)
    dy_m, dx_m = surface.pixel_size_m
    if side == 1:
        few_m = surface[::step_y, ::step_x]
    else:
        first = (
            np.arange((n % side) // 2, n - n % side, side)[::step]
            for n, step in zip(surface.shape, (step_y, step_x), strict=True)
        )
        of_blocks = np.ix_(*((at[:, None] + np.arange(side)).reshape(-1) for at in first))
        few_m = means_of_blocks(surface[of_blocks], side, 0.5 * side**2)
    pixel_size_m = (step_y * side * dy_m, step_x * side * dx_m)
    return replace(surface, height_m=few_m, pixel_size_m=pixel_size_m)
