"""To another grid over the same face, without aliasing."""

from dataclasses import replace

import numpy as np

from capslip.errors import SettingsError
from capslip.problems import Problem
from capslip.surface.filters import smooth
from capslip.surface.heightmap import HeightMap

LEAST_MEASURED = 0.5
MAX_FINER = 8  # new points a stored one, along an axis: interpolation adds nothing to see
FINER = 1.1  # points for each measured one along an axis, from which on they are said
MAX_POINTS = 2**28  # as in a file
COMPARED = 2  # times as many points a side, at most, of a map that fewer are held against


def resample(surface: HeightMap, shape: tuple[int, int]) -> HeightMap:
    """Resample a height map to `shape` points over the same face.

    Parameters
    ----------
    surface : HeightMap
        Pixels need not be square; form removed, so that the filter bends nothing at the edge.
    shape : (int, int)
        (ny, nx), at least 3 each.

    Returns
    -------
    HeightMap
        Along an axis that gets coarser, a Gaussian with a nesting index of two new pixels takes
        off first what the new grid cannot show. Heights are then interpolated linearly between the
        measured points beside a new one; where these have less than half of the weight, the new
        point is non-measured.

    Raises
    ------
    SettingsError
        If the shape is not two whole numbers of at least 3, or has more than 8 points for one of
        the scan along an axis, or more than 2^28.

    Examples
    --------
    >>> y, x = np.mgrid[0:40, 0:60]
    >>> coarse = resample(HeightMap(1e-6 * x, (1e-4, 1e-4)), (20, 30))
    >>> coarse.pixel_size_m, round(float(coarse.height_m[5, 15]) * 1e6, 6)
    ((0.0002, 0.0002), 30.5)
    """
    if len(shape) != 2 or any(n != int(n) or n < 3 for n in shape):
        raise SettingsError(
            f"conditioning.resample_to: got {shape!r}; expected two whole numbers of at least 3"
        )
    most = [MAX_FINER * n for n in surface.shape]
    if shape[0] > most[0] or shape[1] > most[1] or shape[0] * shape[1] > MAX_POINTS:
        raise SettingsError(
            f"conditioning.resample_to: got {shape[0]} x {shape[1]} points for a scan of "
            f"{surface.shape[0]} x {surface.shape[1]}; expected at most {most[0]} x {most[1]}, and "
            f"{MAX_POINTS} in all; interpolation shows nothing that was not measured"
        )
    side_y_m, side_x_m = surface.side_m
    size_m = side_y_m / shape[0], side_x_m / shape[1]
    index_m = [
        2.0 * new_m if n < n_old else 0.0
        for new_m, n, n_old in zip(size_m, shape, surface.shape, strict=True)
    ]
    z = smooth(surface, *index_m) if any(index_m) else surface.height_m.copy()
    z[~surface.measured] = 0.0
    for axis, n in enumerate(shape):
        z = _along(z, axis, n)
    weight = surface.measured.astype(np.float64)  # after the heights, for less memory at a time
    for axis, n in enumerate(shape):
        weight = _along(weight, axis, n)
    known = weight >= LEAST_MEASURED
    z = np.divide(z, weight, out=np.full(weight.shape, np.nan), where=known)
    return replace(surface, height_m=z, pixel_size_m=size_m, noise_m=None)


def problems_of_resampling(measured: HeightMap, surface: HeightMap) -> tuple[Problem, ...]:
    """Return whether a resampled map has points that nobody measured."""
    pixels = zip(measured.pixel_size_m, surface.pixel_size_m, strict=True)
    along_y, along_x = (own_m / new_m for own_m, new_m in pixels)
    if max(along_y, along_x) < FINER:
        return ()
    message = (
        f"{along_y:.3g} x {along_x:.3g} points (along y and x) stand for one that was measured: "
        "what lies between is interpolated, and the stated errors take it for measured"
    )
    return (Problem("resampled_finer", "warning", message),)


def finer_than(surface: HeightMap, measured: HeightMap) -> HeightMap | None:
    """Return the map that a resampled one is held against, None where it has no fewer points.

    Parameters
    ----------
    surface : HeightMap
        After `resample`.
    measured : HeightMap
        Before.

    Returns
    -------
    HeightMap or None
        The points that were measured; where these are more than twice as many a side, twice as many
        as the surface has. More would cost what fewer points are to save, and of all waves that
        were taken off those nearest to what is left move most.

    Examples
    --------
    >>> measured = HeightMap(np.zeros((40, 90)), (1e-4, 1e-4))
    >>> finer_than(resample(measured, (20, 30)), measured).shape
    (40, 60)
    """
    own, points = measured.shape, surface.shape
    shape = tuple(
        n if n > own_n else min(COMPARED * n, own_n) for n, own_n in zip(points, own, strict=True)
    )
    if not any(n < own_n for n, own_n in zip(points, own, strict=True)):
        return None
    return measured if shape == own else resample(measured, (shape[0], shape[1]))


def problems_of_fewer_points(
    surface: HeightMap, finer: HeightMap | None, measured: tuple[int, int]
) -> list[Problem]:
    """Return that a map has fewer points than one that was finer, where it has.

    And how many were measured, where that one has fewer of them, too.
    """
    if finer is None:
        return []
    (ny, nx), (finer_ny, finer_nx) = surface.shape, finer.shape
    of_measured = "that were measured"
    if finer.shape != measured:
        of_measured = f"of {measured[0]} x {measured[1]} {of_measured}"
    message = (
        f"resampled to {ny} x {nx} points, which takes short waves off, against "
        f"{finer_ny} x {finer_nx} {of_measured}"
    )
    return [Problem("resampled_coarser", "warning", message)]


def _along(z: np.ndarray, axis: int, n: int) -> np.ndarray:
    """Interpolate linearly at the centres of n new pixels along one axis."""
    n_old = z.shape[axis]
    place = np.clip((np.arange(n) + 0.5) * (n_old / n) - 0.5, 0.0, n_old - 1.0)
    lower = np.minimum(place.astype(np.intp), n_old - 2)
    share = (place - lower)[:, None] if axis == 0 else place - lower
    below = np.take(z, lower, axis)
    below *= 1.0 - share
    above = np.take(z, lower + 1, axis)
    above *= share
    below += above
    return below
