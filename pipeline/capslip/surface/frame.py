"""The frame of a map: lines along its edges on which nothing was measured."""

from dataclasses import replace

import numpy as np

from capslip.surface.heightmap import HeightMap

LEAST_LINES = 3  # of a map


def without_frame(surface: HeightMap) -> HeightMap:
    """Return the least map that holds all measured points; its places count from its own corner.

    What looks at a map as far as it goes sees the face end there, and not at some distance within.
    The same map where it has no frame, or fewer than three lines within.

    Examples
    --------
    >>> framed = np.full((9, 8), np.nan)
    >>> framed[2:6, 1:7] = 0.0
    >>> without_frame(HeightMap(framed, (1e-4, 1e-4))).shape
    (4, 6)
    """
    rows, columns = surface.measured_window
    shape = rows.stop - rows.start, columns.stop - columns.start
    if shape == surface.shape or min(shape) < LEAST_LINES:
        return surface
    inner_m = np.ascontiguousarray(surface[rows, columns])
    inner_m.flags.writeable = False  # so it is held once
    return replace(surface, height_m=inner_m)


def frameless(
    surface: HeightMap, values: np.ndarray
) -> tuple[HeightMap, np.ndarray, tuple[float, float]]:
    """Return a map as of `without_frame`, what is known at its points, and where it begins, (x, y).

    Examples
    --------
    >>> framed = np.full((9, 8), np.nan)
    >>> framed[2:6, 1:7] = 0.0
    >>> inner, lost, begins_m = frameless(HeightMap(framed, (1e-4, 1e-4)), np.isnan(framed))
    >>> inner.shape == lost.shape, begins_m
    (True, (0.0001, 0.0002))
    """
    inner, (dy_m, dx_m) = without_frame(surface), surface.pixel_size_m
    if inner is surface:
        return surface, values, (0.0, 0.0)
    rows, columns = surface.measured_window
    return inner, values[rows, columns], (columns.start * dx_m, rows.start * dy_m)


def in_frame(inner_m: np.ndarray, surface: HeightMap, blank: float | bool = np.nan) -> np.ndarray:
    """Return what is known at the points within the frame of a map at the points of the map.

    Examples
    --------
    >>> framed = np.full((4, 5), np.nan)
    >>> framed[:3, 1:4] = 0.0
    >>> in_frame(np.ones((3, 3), dtype=int), HeightMap(framed, (1e-4, 1e-4)), 0)
    array([[0, 1, 1, 1, 0],
           [0, 1, 1, 1, 0],
           [0, 1, 1, 1, 0],
           [0, 0, 0, 0, 0]])
    """
    if inner_m.shape == surface.shape:
        return inner_m
    whole_m = np.full(surface.shape, blank, dtype=inner_m.dtype)
    whole_m[surface.measured_window] = inner_m
    return whole_m
