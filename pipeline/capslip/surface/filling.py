"""Points that are missing here and there, filled from the ones around them."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from capslip.surface.frame import in_frame, without_frame
from capslip.surface.heightmap import Filling, HeightMap
from capslip.surface.outliers import stand_alone

LEFT_OUT = 5  # of so many measured points one is left out to see how well it is filled
HIGHEST_SHARE = 0.10  # of the measured points, in which the error counts: what is touched
FEWEST = 25  # points, of which every fifth tells an error
TRIED_POINTS = 40_000  # about the highest: enough to tell the error
BY_CHANCE = 1e-3  # of an empty disc anywhere on a map, below which it is a hole


def fill_scattered(surface: HeightMap) -> HeightMap:
    """Fill what is missing between points that stand alone.

    Most steps look at a point and its neighbours, and take a missing one for an exception. Where
    the points stand alone it is none: neither noise nor what hangs together can be seen there.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.

    Returns
    -------
    HeightMap
        The same where the points do not stand alone (`stand_alone`), so for holes of any size in a
        map that is whole around them, and where too few are measured. Else with the heights between
        them, and `filling`, which says what leaving out measured points tells of the error, rms
        over the highest tenth of the points.

    Notes
    -----
    Between the measured points go triangles (Delaunay), and over these planes, or the cubics of
    Clough and Tocher (1965), which carry slopes on. Both are tried on every fifth measured point,
    left out; planes are better on steps and rough faces, and cubics on smooth hills, whose tops
    planes cut off. A *hole* stays as it is: where points are missing at random, at a density of l,
    a disc of radius r about a point is empty by a chance of exp(-pi l r^2), so of N points one in a
    thousand maps has such a disc beyond ln(1000 N) = pi l r^2. What lies in one is missing for
    another cause.

    Examples
    --------
    >>> y, x = np.mgrid[0:60, 0:80]
    >>> z = 1e-9 * (x * y / 50 - (y - 30.0) ** 2)
    >>> lost = np.random.default_rng(0).random(z.shape) < 0.8
    >>> filled = fill_scattered(HeightMap(np.where(lost, np.nan, z), (1e-4, 1e-4)))
    >>> off = filled.height_m - z
    >>> bool(np.nanmax(np.abs(off[5:-5, 5:-5])) < 0.01 * np.ptp(z)), filled.filling.way
    (True, 'cubic')
    """
    inner = without_frame(surface)
    found = _filled(inner)
    if found is inner:
        return surface
    assert found.filling is not None
    filling = replace(found.filling, measured=surface.measured)
    return replace(surface, height_m=in_frame(found.height_m, surface), filling=filling)


def _filled(surface: HeightMap) -> HeightMap:
    if not stand_alone(surface.measured):
        return surface
    from scipy.spatial import Delaunay, QhullError

    lost = np.isnan(surface.height_m)
    row, col = np.nonzero(~lost)
    if row.size < FEWEST:
        return surface
    at, z_m = _places(row, col, surface), surface.height_m[row, col]
    between = _between_points(lost, surface.pixel_size_m)
    try:
        way, error_m = _least_error(at, z_m)
        row, col = np.nonzero(between)
        filled_m = _interpolated(way, Delaunay(at), z_m, _places(row, col, surface))
    except QhullError:  # the points lie on a line
        return surface
    height_m = surface.height_m.copy()
    height_m[row, col] = filled_m
    points = int(np.count_nonzero(~np.isnan(filled_m)))
    known = z_m.size / (z_m.size + int(np.count_nonzero(between)))
    density_m2 = known / surface.pixel_area_m2
    filling = Filling(points, points / (points + z_m.size), way, error_m, density_m2, ~lost)
    return replace(surface, height_m=height_m, filling=filling)


def filled_from_fewer(surface: HeightMap) -> Iterator[HeightMap]:
    """Return a filled map as it is without each fifth of its measured points in turn.

    By what their answers differ so much is known of them, see `standard_error`.

    Parameters
    ----------
    surface : HeightMap
        With `filling`, or without. Nothing is returned where it does not say which points of this
        grid were measured.

    Examples
    --------
    >>> z = 1e-9 * np.add.outer(np.arange(60.0), np.arange(80.0))
    >>> lost = np.random.default_rng(0).random(z.shape) < 0.8
    >>> filled = fill_scattered(HeightMap(np.where(lost, np.nan, z), (1e-4, 1e-4)))
    >>> [round(float(np.nanmax(np.abs(one.height_m - filled.height_m))), 15)
    ...  for one in filled_from_fewer(filled)]
    [0.0, 0.0, 0.0, 0.0, 0.0]
    """
    from scipy.spatial import Delaunay

    filling = surface.filling
    if filling is None or filling.measured is None or filling.measured.shape != surface.shape:
        return
    row, col = np.nonzero(filling.measured & surface.measured)
    at, z_m = _places(row, col, surface), surface.height_m[row, col]
    turn = np.arange(row.size) % LEFT_OUT
    for one in range(LEFT_OUT):
        out = turn == one
        again = surface.measured & ~filling.measured
        again[row[out], col[out]] = True
        to_row, to_col = np.nonzero(again)
        to = _places(to_row, to_col, surface)
        filled_m = _interpolated(filling.way, Delaunay(at[~out]), z_m[~out], to)
        height_m = surface.height_m.copy()
        height_m[again] = np.where(np.isnan(filled_m), height_m[again], filled_m)
        yield replace(surface, height_m=height_m)


def joined_filling(first: Filling | None, second: Filling | None) -> Filling | None:
    """Return that with the greater error, with the errors of both; its points are none.

    A hill is missed as easily as where the fewest points stand.
    """
    both = [one for one in (first, second) if one is not None]
    if not both:
        return None
    error_m = math.hypot(*(one.error_m for one in both))
    density_m2 = min(one.density_m2 for one in both)
    worse = max(both, key=lambda one: one.error_m)
    return replace(worse, error_m=error_m, density_m2=density_m2, measured=None)


def standard_error(change: np.ndarray) -> np.ndarray:
    """Return the standard errors of numbers by what they change without a part of what they are of.

    The jackknife: sqrt((g - 1) / g sum d^2) of the changes d without each of g parts in turn
    (Tukey, Ann. Math. Stat. 29 (1958) 614).

    Parameters
    ----------
    change : float64, shape (g, n)
        Of n numbers.

    Examples
    --------
    >>> sample = np.array([1.0, 2.0, 4.0, 7.0, 8.0])  # of its mean that is s / sqrt(g)
    >>> without = np.array([np.delete(sample, i).mean() for i in range(5)])
    >>> float(standard_error(without[:, None] - sample.mean())[0] - sample.std(ddof=1) / 5**0.5)
    0.0
    """
    parts = len(change)
    return np.asarray(np.sqrt((parts - 1) / parts * np.square(change).sum(axis=0)))


def _between_points(lost: np.ndarray, pixel_size_m: tuple[float, float]) -> np.ndarray:
    """Tell which missing points lie in no larger empty disc than chance leaves."""
    from scipy.ndimage import distance_transform_edt

    density_m2 = (1.0 - np.count_nonzero(lost) / lost.size) / math.prod(pixel_size_m)
    largest_m = math.sqrt(math.log(lost.size / BY_CHANCE) / (math.pi * density_m2))
    empty = distance_transform_edt(lost, sampling=pixel_size_m) > largest_m
    if not empty.any():
        return lost
    between: np.ndarray = distance_transform_edt(~empty, sampling=pixel_size_m) >= largest_m
    return lost & between


def _places(row: np.ndarray, col: np.ndarray, surface: HeightMap) -> np.ndarray:
    """Return (y, x) in pixels of equal sides, shape (k, 2)."""
    dy_m, dx_m = surface.pixel_size_m
    size_m = math.sqrt(dy_m * dx_m)
    return np.stack((row * (dy_m / size_m), col * (dx_m / size_m)), axis=1)


def _least_error(at: np.ndarray, z_m: np.ndarray) -> tuple[str, float]:
    """Return the way that fills measured points best, and what it leaves at the highest of them."""
    from scipy.spatial import Delaunay

    if z_m.size > TRIED_POINTS:
        away = np.abs(at - at[np.argmax(z_m)]).max(axis=1)
        near = away <= np.partition(away, TRIED_POINTS)[TRIED_POINTS]
        at, z_m = at[near], z_m[near]
    out = np.arange(z_m.size) % LEFT_OUT == LEFT_OUT // 2
    high = z_m[out] >= np.quantile(z_m, 1.0 - HIGHEST_SHARE)
    if not high.any():
        high[:] = True
    mesh = Delaunay(at[~out])
    errors_m = {}
    for way in ("cubic", "linear"):
        off_m = _interpolated(way, mesh, z_m[~out], at[out][high]) - z_m[out][high]
        errors_m[way] = math.sqrt(float(np.nanmean(off_m**2)))
    best = min(errors_m, key=errors_m.__getitem__)
    return best, errors_m[best]


def _interpolated(way: str, mesh: object, z_m: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return heights at places, NaN outside of the mesh."""
    from scipy.interpolate import CloughTocher2DInterpolator, LinearNDInterpolator

    of = CloughTocher2DInterpolator if way == "cubic" else LinearNDInterpolator
    # Heights of order one: the slopes are found to an absolute tolerance
    unit_m = float(np.ptp(z_m)) or 1.0
    found: np.ndarray = unit_m * of(mesh, z_m / unit_m)(at)
    return found


def from_nearest(height_m: np.ndarray) -> np.ndarray:
    """Return heights with the nearest one at each point that was not measured, if any one was."""
    lost = np.isnan(height_m)
    if not 0 < np.count_nonzero(lost) < lost.size:
        return height_m
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(lost, return_distances=False, return_indices=True)
    return np.asarray(height_m[tuple(nearest)])
