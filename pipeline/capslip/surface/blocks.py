"""Sums and means over squares of points, and maps of fewer."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from capslip.surface.heightmap import HeightMap, Heights
from capslip.surface.rows import BLOCK_POINTS, even_lines

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
    rows, columns = (
        np.arange(begin, n + 1, side) for n, begin in zip(values.shape, corner, strict=True)
    )
    return _means_between(values, rows, columns, least)


def _means_between(
    values: Heights, rows: np.ndarray, columns: np.ndarray, least: float | None = None
) -> np.ndarray:
    """Return the means of blocks between rows and between columns, NaN of too few known points.

    Of less than half of a block where nothing is said.
    """
    high, wide, nx = np.diff(rows), np.diff(columns), columns.size - 1
    total, known = np.empty((high.size, nx)), np.outer(high, wide).astype(np.float64)
    left, first = int(columns[0]), columns[:-1] - columns[0]
    n_columns = int(columns[-1]) - left
    block_of = np.repeat(np.arange(nx), wide)
    enough = 0.5 * known if least is None else np.full(known.shape, least)
    same = bool((high == high[:1]).all())
    at_once = max(1, BLOCK_POINTS // max(1, n_columns * int(high.max(initial=1))))
    for begin in range(0, high.size, at_once):
        edges = rows[begin : begin + at_once + 1]
        top = int(edges[0])
        band = values[top : int(edges[-1]), left : left + n_columns]
        lost = np.flatnonzero(np.isnan(band))
        if lost.size:
            band = band.copy()
            band.reshape(-1)[lost] = 0.0
            row = np.searchsorted(edges - top, lost // n_columns, side="right") - 1
            np.subtract.at(known, (row + begin, block_of[lost % n_columns]), 1.0)
        if same:  # three times as fast
            part = band.reshape(-1, int(high[0]), n_columns).sum(axis=1)
        else:
            part = np.add.reduceat(band, edges[:-1] - top, axis=0)
        np.add.reduceat(part, first, axis=1, out=total[begin : begin + at_once])
    return np.asarray(total / np.where(known < enough, np.nan, known))


def symmetric_edges(n: int, side: int) -> np.ndarray:
    """Return where blocks of `side` lines, or one or two more, begin, and where the last one ends.

    Mirrored, they are the same. An odd number of lines has an odd number of blocks.

    Examples
    --------
    >>> symmetric_edges(12, 4)
    array([ 0,  4,  8, 12])
    >>> symmetric_edges(13, 4)
    array([ 0,  4,  9, 13])
    """
    count = max(1, n // side)
    count -= n % 2 == 1 and count % 2 == 0
    first = np.arange(count // 2 + 1)
    low = (2 * first * n + count) // (2 * count)  # to the nearest line
    return np.concatenate((low, n - low[: (count + 1) // 2][::-1]))


def block_means(surface: HeightMap, step: int) -> HeightMap:
    """Return the means of blocks of `step` points a side, or one or two more: all points count.

    A block is measured where half of its points are: of large blocks nearly all lack some. Blocks
    of one point are the map itself. A mirrored map has the same blocks.
    """
    if step == 1:
        return surface
    rows, columns = (symmetric_edges(n, step) for n in surface.shape)
    height_m = _means_between(surface, rows, columns)
    dy_m, dx_m = (length_m / n for length_m, n in zip(surface.side_m, height_m.shape, strict=True))
    return replace(surface, height_m=height_m, pixel_size_m=(dy_m, dx_m))


def coarse_map(surface: HeightMap) -> HeightMap:
    """Return the map on which a level is found first: itself, where it is small."""
    return block_means(surface, coarse_step(surface))


def coarse_step(surface: HeightMap) -> int:
    """Return the side of the blocks of which the coarse map has the means, in points."""
    return max(1, round(min(surface.shape) / COARSE_POINTS))


def few_lines(surface: HeightMap, lines: int, side: int = 1) -> HeightMap:
    """Return rows and columns of a map at even distances, about so many or more where it has them.

    Of means of blocks with so many points a side, see `block_means`, which are not computed
    elsewhere. A mirrored map has the same lines.

    Examples
    --------
    >>> few_lines(HeightMap(np.zeros((7, 10)), (1e-3, 1e-3)), 3).shape
    (4, 4)
    """
    few_y, few_x = (_few_blocks(n, side, lines) for n in surface.shape)
    few_m = surface[np.ix_(few_y.line, few_x.line)]
    if side > 1:
        few_m = _means_between(few_m, few_y.edge, few_x.edge)
    dy_m, dx_m = surface.pixel_size_m
    return replace(surface, height_m=few_m, pixel_size_m=(few_y.apart * dy_m, few_x.apart * dx_m))


class _Few(NamedTuple):
    """Some blocks of lines."""

    line: np.ndarray  # all lines of these blocks
    edge: np.ndarray  # where each block begins among them, and where the last one ends
    apart: float  # lines from one block to the next


def _few_blocks(n: int, side: int, count: int) -> _Few:
    edge = symmetric_edges(n, side)
    size, n_blocks = np.diff(edge), edge.size - 1
    chosen = even_lines(n_blocks, n_blocks // count)
    is_chosen = np.zeros(n_blocks, dtype=bool)
    is_chosen[chosen] = True
    line = np.flatnonzero(np.repeat(is_chosen, size))
    of_few = np.concatenate(([0], np.cumsum(size[chosen])))
    return _Few(line, of_few, chosen.step * n / n_blocks)
