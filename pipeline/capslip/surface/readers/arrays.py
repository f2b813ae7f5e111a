"""Bare arrays: a map, or a list of points x, y, z that only looks like one."""

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.points import grid_points
from capslip.surface.readers.stored import Request, Stored

LIST_COLUMNS, LIST_ASPECT = 8, 50  # fewer columns and longer than this is a list, no matrix


def is_list(shape: tuple[int, int]) -> bool:
    """Say whether so many rows of so few numbers are a list of something, and no map.

    Examples
    --------
    >>> is_list((13284, 3)), is_list((300, 6)), is_list((100, 6)), is_list((300, 8))
    (True, False, False, False)
    """
    rows, columns = shape
    return columns < LIST_COLUMNS and rows > LIST_ASPECT * columns


def stored_array(array: np.ndarray, what: str, request: Request) -> Stored:
    """Take an array without units for what it is: a map, or points.

    Parameters
    ----------
    array : shape (ny, nx), or (n, 3) or (3, n) of many points
        As the file has it.
    what : str
        File and name of the array, for errors.
    request : Request
        Its pixel size is that of the cells of a point cloud.

    Raises
    ------
    UnreadableFileError
        If the array is a list of anything but three numbers, or of points that are no surface.
    """
    turned = not is_list((array.shape[0], array.shape[1]))
    if turned and not is_list((array.shape[1], array.shape[0])):
        return Stored(array)
    points = np.asarray(array.T if turned else array, dtype=np.float64)
    if points.shape[1] != 3:
        raise UnreadableFileError(
            f"{what}: {array.shape[0]} x {array.shape[1]} numbers are a list, not a map; expected "
            "a matrix of heights, or three columns x y z; leave the other columns out"
        )
    taken = f"the array of {array.shape[0]} x {array.shape[1]} numbers was taken for points x, y, z"
    grid = grid_points(points, f"{what}: {taken}", request.pixel_size_in(None))
    note = Statement(f"{taken}; --unit is that of z, --lateral-unit that of x and y")
    return Stored(
        grid.height,
        pixel_size=grid.pixel_size,
        notes=(note, *grid.notes),
        top_row_first=False,
    )
