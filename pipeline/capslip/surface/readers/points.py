"""From points to a grid: exact where the points lie on one, by the mean of each cell if not."""

from dataclasses import dataclass

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.stored import check_shape

MAX_OFFSET = 0.35  # pixels; a point farther from its node may belong to the next one
NOTED_OFFSET = 0.01  # pixels; less is the rounding of printed coordinates
MIN_FILLED = 0.2  # of the nodes; a grid emptier than this is the rounding of scattered points
POINTS_A_CELL = 4.0  # leaves 2 % of the cells of randomly scattered points empty
MAX_CELLS_A_POINT = 100.0  # more is a mistaken cell size, or a stray point far away
MAX_EMPTY = 0.75  # of the cells of a point cloud whose cell size was not given
MAX_COUNT = 1e9  # rows or columns: more are none
LEAST_CELLS = 3  # along an axis of a height map


@dataclass(frozen=True, eq=False)
class Grid:
    """Points brought to a grid.

    Attributes
    ----------
    height : shape (ny, nx)
        y grows with the row, x with the column; NaN where there is no point.
    pixel_size : (float, float)
        (dy, dx) in the unit of the points.
    notes : tuple of str
        What was done beyond sorting the points into their places.
    """

    height: np.ndarray
    pixel_size: tuple[float, float]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Places along one axis: the node of each point, and how far off it lies (in pixels)."""

    step: float
    index: np.ndarray
    count: int
    offset: float


def grid_points(
    points: np.ndarray, where: str, cell_size: tuple[float, float] | None = None
) -> Grid:
    """Bring points to a grid.

    Points on a regular grid keep their heights, in whatever order they come; missing ones are
    non-measured. Points up to 0.35 pixels off a grid are put to its nodes, with a note. Others
    are a cloud: each cell takes the mean of its points, empty cells stay non-measured, and a note
    says so.

    Parameters
    ----------
    points : shape (n, 3)
        x, y, z; a z of NaN is a non-measured point.
    where : str
        The file, for errors.
    cell_size : (float, float), optional
        (dy, dx) of the cells of a cloud; without it a square with four points on average.

    Raises
    ------
    UnreadableFileError
        If a coordinate is not finite, there are too few points, they lie on a line, two points at
        one place have different heights, or the points of a cloud fill too few cells.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(4.0), 0.5 * np.arange(3.0))
    >>> points = np.column_stack([x.ravel(), y.ravel(), np.arange(12.0)])
    >>> grid_points(points[::-1], "points").height
    array([[ 0.,  1.,  2.,  3.],
           [ 4.,  5.,  6.,  7.],
           [ 8.,  9., 10., 11.]])
    """
    _check(points, where)
    x, y = (np.ascontiguousarray(points[:, axis]) for axis in (0, 1))
    across, down = _nodes(x), _nodes(y)
    if across is not None and down is not None:
        n_nodes = across.count * down.count
        if len(points) >= MIN_FILLED * n_nodes:
            grid = _on_nodes(points, across, down, where)
            if grid is not None:
                return grid
    return _by_cells(points, where, cell_size)


def grid_indices(points: np.ndarray, where: str) -> Grid:
    """Put points whose x and y count columns and rows to their places, whichever number is first.

    Parameters, what is returned and errors are those of `grid_points`; the pixel size is in counts.

    Raises
    ------
    UnreadableFileError
        If columns or rows are not counted in whole steps, or there are more than 100 a point.

    Examples
    --------
    >>> j, i = np.meshgrid(np.arange(1.0, 5.0), np.arange(1.0, 4.0))
    >>> points = np.column_stack([j.ravel(), i.ravel(), np.arange(12.0)])
    >>> grid_indices(points[points[:, 2] != 5.0], "points").height
    array([[ 0.,  1.,  2.,  3.],
           [ 4., nan,  6.,  7.],
           [ 8.,  9., 10., 11.]])
    """
    _check(points, where)
    across, down = (
        _counted(points[:, axis], name, where) for axis, name in enumerate(("columns", "rows"))
    )
    if across.count * down.count > MAX_CELLS_A_POINT * len(points):
        raise UnreadableFileError(
            f"{where}: {len(points)} points in {down.count} rows and {across.count} columns; "
            f"expected at most {MAX_CELLS_A_POINT:g} places a point; cut stray points off"
        )
    grid = _on_nodes(points, across, down, where)
    assert grid is not None  # places that share a node are one
    return grid


def step_of_indices(values: np.ndarray) -> int:
    """Return the whole step in which values count, from whatever number on; 0 if they do not."""
    counts = values - values.min()
    if not counts.max() < MAX_COUNT or (counts % 1.0).any():
        return 0
    return int(np.gcd.reduce(np.unique(counts.astype(np.int64))))


def _counted(values: np.ndarray, name: str, where: str) -> _Nodes:
    step = step_of_indices(values)
    if step == 0:
        raise UnreadableFileError(
            f"{where}: {name} are in pixels, but not in whole steps; expected whole numbers; "
            "name the unit of what they are"
        )
    index = ((values - values.min()) / step).astype(np.int64)
    return _Nodes(float(step), index, int(index.max()) + 1, 0.0)


def _check(points: np.ndarray, where: str) -> None:
    if len(points) < 9:
        raise UnreadableFileError(
            f"{where}: {len(points)} points; expected at least 9, three along x and along y; "
            "export the whole scan"
        )
    bad = ~np.isfinite(points[:, :2]).all(axis=1) | np.isinf(points[:, 2])
    if bad.any():
        row = int(np.argmax(bad))
        raise UnreadableFileError(
            f"{where}: point {row + 1} is {_place(points[row])}; expected finite numbers, or nan "
            "as the height of a non-measured point; correct it"
        )
    for axis, name in enumerate("xy"):
        if np.ptp(points[:, axis]) == 0:
            raise UnreadableFileError(
                f"{where}: all points have {name} = {points[0, axis]:g}; expected a surface; "
                "export the whole scan"
            )


def _nodes(values: np.ndarray) -> _Nodes | None:
    """Find equally spaced nodes near which all values lie; None if there are none.

    Sorted, the values of a grid fall into bunches. The gaps between bunches differ from those
    inside by the largest ratio between consecutive sizes of gaps.
    """
    ordered = np.sort(values)
    gaps = np.diff(ordered)
    extent = ordered[-1] - ordered[0]
    noise = 1e-9 * extent + 1e-14 * max(abs(ordered[0]), abs(ordered[-1]))
    sizes = np.sort(np.maximum(gaps, noise))
    low = len(sizes) // 3  # a grid has at least three points a row: a third of the gaps are inside
    ratios = sizes[low + 1 : -1] / sizes[low:-2]
    if ratios.size == 0:
        return None
    jump = low + int(np.argmax(ratios))
    threshold = np.sqrt(sizes[jump] * sizes[jump + 1])
    starts = np.concatenate([[0], np.flatnonzero(gaps > threshold) + 1])
    counts = np.diff(np.append(starts, len(ordered)))
    centres = np.add.reduceat(ordered, starts) / counts
    between = np.diff(centres)
    if len(centres) < 3:
        return None
    step = float(np.median(between))
    place = np.concatenate([[0.0], np.cumsum(np.maximum(np.rint(between / step), 1.0))])
    step, first = np.polyfit(place, centres, 1, w=np.sqrt(counts))
    position = (values - first) / step
    index = np.rint(position)
    offset = float(np.abs(position - index).max())
    if not offset <= MAX_OFFSET:
        return None
    index -= index.min()
    return _Nodes(float(step), index.astype(np.int64), int(index.max()) + 1, offset)


def _on_nodes(points: np.ndarray, across: _Nodes, down: _Nodes, where: str) -> Grid | None:
    """Put points to the nodes of a grid; None if two places share a node."""
    shape = (down.count, across.count)
    check_shape(shape, where)
    node = down.index * across.count + across.index
    shared = np.bincount(node, minlength=shape[0] * shape[1])[node] > 1
    notes: list[str] = []
    if shared.any():
        kept, notes = _without_duplicates(points[shared], where)
        if len(kept) != len(np.unique(node[shared])):
            return None
    height = np.full(shape, np.nan)
    height.flat[node] = points[:, 2]
    offset = max(across.offset, down.offset)
    if offset > NOTED_OFFSET:
        notes.append(
            f"points lie up to {100 * offset:.0f} % of a pixel off a regular grid; each height "
            "was put to the nearest node"
        )
    return Grid(height, (down.step, across.step), tuple(notes))


def _by_cells(points: np.ndarray, where: str, cell_size: tuple[float, float] | None) -> Grid:
    """Average the points of a cloud in cells."""
    points, notes = _without_duplicates(points, where)
    measured = points[~np.isnan(points[:, 2])]
    if len(measured) < 9:
        raise UnreadableFileError(
            f"{where}: {len(measured)} points with a height; expected at least 9; "
            "export the whole scan"
        )
    low = measured[:, :2].min(axis=0)
    extent_x, extent_y = np.ptp(measured[:, :2], axis=0)
    square = float(np.sqrt(POINTS_A_CELL * extent_x / len(measured) * extent_y))
    dy, dx = cell_size or (square, square)
    if not (dx > 0 and dy > 0):
        raise UnreadableFileError(
            f"{where}: the points lie on a line; expected a surface; export the whole scan"
        )
    ny, nx = (int(np.ceil(max(n, 0.5))) for n in (extent_y / dy, extent_x / dx))
    if ny * nx > MAX_CELLS_A_POINT * len(measured):
        raise UnreadableFileError(
            f"{where}: {len(measured)} points in {ny} x {nx} cells of {dy:.4g} x {dx:.4g}; "
            f"expected at most {MAX_CELLS_A_POINT:g} cells a point; give a larger --pixel-size, or "
            "cut stray points off"
        )
    if min(ny, nx) < LEAST_CELLS:
        raise UnreadableFileError(
            f"{where}: {len(measured)} points lie in {ny} x {nx} cells of {dy:.4g} x {dx:.4g}; "
            f"expected at least {LEAST_CELLS} along x and along y; give a smaller --pixel-size"
        )
    check_shape((ny, nx), where)
    i = np.minimum(((measured[:, 1] - low[1]) / dy).astype(np.int64), ny - 1)
    j = np.minimum(((measured[:, 0] - low[0]) / dx).astype(np.int64), nx - 1)
    cell = i * nx + j
    counts = np.bincount(cell, minlength=ny * nx)
    sums = np.bincount(cell, weights=measured[:, 2], minlength=ny * nx)
    filled = counts > 0
    height = np.full(ny * nx, np.nan)
    height[filled] = sums[filled] / counts[filled]
    empty = 1.0 - float(filled.mean())
    said = (
        f"a cloud of {len(measured)} points off any regular grid, resampled to {ny} x {nx} cells "
        f"of {dy:.4g} x {dx:.4g} in the unit of x and y (the mean of each cell): "
        f"{counts[filled].min()} to {counts.max()} points a filled cell, "
        f"{counts[filled].mean():.1f} on average; "
        f"{100 * empty:.1f} % of the cells are empty and stay non-measured"
    )
    if cell_size is None and empty > MAX_EMPTY:
        raise UnreadableFileError(
            f"{where}: {said}; expected points that cover a rectangle; cut stray points off, or "
            "choose the cells with --pixel-size DY DX"
        )
    return Grid(height.reshape(ny, nx), (dy, dx), (*notes, said))


def _without_duplicates(points: np.ndarray, where: str) -> tuple[np.ndarray, list[str]]:
    """Merge equal points, with a note; refuse two heights at one place."""
    points = points[np.lexsort((points[:, 2], points[:, 1], points[:, 0]))]
    again = (points[1:, :2] == points[:-1, :2]).all(axis=1)
    if not again.any():
        return points, []
    z, z_before = points[1:, 2], points[:-1, 2]
    contradictory = again & (z != z_before) & ~(np.isnan(z) & np.isnan(z_before))
    if contradictory.any():
        row = int(np.argmax(contradictory))
        raise UnreadableFileError(
            f"{where}: two heights at x = {points[row, 0]:.9g}, y = {points[row, 1]:.9g}: "
            f"{points[row, 2]:.9g} and {points[row + 1, 2]:.9g} "
            f"({int(contradictory.sum())} such places); expected one; keep one of them"
        )
    return points[np.concatenate([[True], ~again])], [
        Statement(f"{int(again.sum())} points that repeat another one were merged with it")
    ]


def _place(point: np.ndarray) -> str:
    return f"({', '.join(f'{value:g}' for value in point)})"
