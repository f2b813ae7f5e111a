"""Heights of a map at the points of another grid, by a quintic spline or straight lines."""

import math
from dataclasses import replace

import numpy as np

from capslip.surface.between import Between
from capslip.surface.heightmap import HeightMap
from capslip.surface.noise import SPLINE_DEGREE, deviation_m, noise_laid, noise_of_map_m
from capslip.surface.rows import row_blocks

LEAST_MEASURED = 0.5
WHOLE_PIXELS = 1e-9
FILLED_RINGS = 16  # of points not measured: of what lies beyond, 0.43^16 reaches a spline
LEADING = 6  # differences from point to point that tell the next
UNLIKE = 4.0  # standard deviations: a difference that is more is of a step, a pit or a spike
ASKED = 1_000_000  # points, of which it is asked how differences lead on
ROUNDING = 1e-20  # of the squares of differences: what is led on to exactly leaves no more
FAR_FROM_STRAIGHT = 6.0  # rms of noise: white noise does not bend a spline so far
LOOKED_AT = 60_000  # points, at which splines are compared: 1 % of an rms
OF_NOISE = 250  # points along the sides of white noise, that tells to 1 % what it does to them
NEAR = 20  # points from its edges on
FROM_EDGES = 8  # points, within which splines differ because of an edge
OUTERMOST = 0.99  # quantile at which differences are cut


def straight_between(
    height_m: np.ndarray, matrix: np.ndarray, offset: np.ndarray, shape: tuple[int, int]
) -> np.ndarray:
    """Interpolate heights linearly.

    Parameters
    ----------
    height_m : float64, shape (ny, nx)
        NaN where not measured.
    matrix : ndarray, shape (2, 2)
        From rows and columns of the new grid to those of the map.
    offset : ndarray, shape (2,)
        Where the first point of the new grid lies, in rows and columns of the map.
    shape : (int, int)
        Of the new grid.

    Returns
    -------
    float64, of that shape
        Means of the measured points beside a place, NaN where these have less than half of the
        weight: half a pixel beyond the outermost points is as high as they are.
    """
    from scipy.ndimage import affine_transform

    measured = ~np.isnan(height_m)
    options = {
        "matrix": matrix,
        "offset": offset,
        "output_shape": shape,
        "order": 1,
        "mode": "grid-constant",
    }
    weight = affine_transform(measured.astype(np.float64), **options)
    laid_m: np.ndarray = affine_transform(np.where(measured, height_m, 0.0), **options)
    known = weight >= LEAST_MEASURED
    laid_m[~known] = np.nan
    np.divide(laid_m, weight, out=laid_m, where=known)
    return laid_m


def smooth_between(
    height_m: np.ndarray, matrix: np.ndarray, offset: np.ndarray, shape: tuple[int, int]
) -> np.ndarray:
    """Interpolate heights by a quintic spline.

    A straight line between two points cuts off the crest between them, and contacts are on crests.
    A cubic spline still misses 9 % of a wave of three points, this one 2 %.

    Parameters as of `straight_between`.

    Returns
    -------
    float64, of that shape
        NaN where `straight_between` has them. Points that are not measured are filled first, from
        those around them, and the spline goes on beyond the outermost points as their differences
        do, see `_filled`. Beside a step, where it overshoots by an eighth of the step, it is held
        between the straight line and what the points on either side lead to.
    """
    if on_points(matrix, offset):
        return straight_between(height_m, matrix, offset, shape)
    from scipy.ndimage import affine_transform, spline_filter

    measured = (~np.isnan(height_m)).view(np.uint8)
    far_m = FAR_FROM_STRAIGHT * noise_of_map_m(height_m)
    filled_m = _filled(np.pad(height_m, FILLED_RINGS, constant_values=np.nan))
    spline_m = spline_filter(filled_m, SPLINE_DEGREE, mode="mirror")
    laid_m = np.empty(shape)
    for rows in row_blocks(shape):
        first = offset + matrix[:, 0] * rows.start
        grid = {"matrix": matrix, "output_shape": (rows.stop - rows.start, shape[1])}
        within = {**grid, "offset": first + FILLED_RINGS, "mode": "nearest"}
        straight_m = affine_transform(filled_m, **within, order=1)
        some_m = affine_transform(spline_m, **within, order=SPLINE_DEGREE, prefilter=False)
        weight = affine_transform(
            measured, **grid, offset=first, order=1, mode="grid-constant", output=np.float64
        )
        some_m[weight < LEAST_MEASURED] = np.nan
        bent_m = some_m - straight_m
        row, col = np.nonzero(np.abs(bent_m) > far_m)
        if row.size:
            place = matrix @ np.stack((row, col)) + (first + FILLED_RINGS)[:, None]
            most_m = _most_bent(filled_m, place)
            some_m[row, col] = straight_m[row, col] + np.clip(bent_m[row, col], *most_m)
        laid_m[rows] = some_m
    return laid_m


def between_points(
    surface: HeightMap, matrix: np.ndarray, offset: np.ndarray, shape: tuple[int, int]
) -> Between | None:
    """Return how splines differ where a face is laid on other points, None on its own points.

    Parameters
    ----------
    surface : HeightMap
        The face, as it is laid.
    matrix, offset, shape
        As of `straight_between`.
    """
    if on_points(matrix, offset):
        return None
    rng = np.random.default_rng(0)
    point = np.arange(math.prod(shape))
    if point.size > LOOKED_AT:  # at random: a lattice may meet the same places between all points
        point = rng.choice(point, LOOKED_AT, replace=False)
    place = matrix @ np.unravel_index(point, shape) + offset[:, None]
    bends_m, finer_m = _differences_m(surface.height_m, place)
    on_noise = place % 1.0 + rng.integers(NEAR, OF_NOISE - NEAR, place.shape)
    of_noise = _differences_m(rng.standard_normal((OF_NOISE, OF_NOISE)), on_noise)
    apart_y, apart_x = 1.0 / np.linalg.norm(matrix, axis=0)
    pixels, scans = (float(apart_y), float(apart_x)), surface.scans_of_noise
    return Between(max(surface.pixel_size_m), bends_m, finer_m, of_noise, pixels, scans)


def _differences_m(height_m: np.ndarray, place: np.ndarray) -> tuple[float, float]:
    """Return the rms of a cubic spline less straight lines, and of a quintic one less that.

    At places, shape (2, n), of those far from edges and holes where some are. The greatest are cut:
    beside steps, spikes and pits splines are held.
    """
    from scipy.ndimage import map_coordinates, minimum_filter, spline_filter

    options = {"mode": "nearest", "prefilter": False}
    measured = ~np.isnan(height_m)
    far = minimum_filter(measured, 2 * FROM_EDGES + 1, mode="constant")
    for points in (far, measured):
        known = map_coordinates(points.astype(np.float64), place, order=1) == 1.0
        if known.any():
            break
    else:
        return 0.0, 0.0
    place, filled_m = place[:, known], _filled(height_m.copy())
    laid_m = [map_coordinates(filled_m, place, order=1, **options)]
    for degree in (3, SPLINE_DEGREE):
        spline_m = spline_filter(filled_m, degree, mode="mirror")
        laid_m.append(map_coordinates(spline_m, place, order=degree, **options))
    size_m = np.abs(np.diff(laid_m, axis=0))
    cut_m = np.minimum(size_m, np.quantile(size_m, OUTERMOST, axis=1)[:, None])
    bends_m, finer_m = np.sqrt(np.square(cut_m).mean(axis=1)).tolist()
    return bends_m, finer_m


def on_more_points(surface: HeightMap, shape: tuple[int, int]) -> HeightMap:
    """Return the same face, in the same frame, on a finer grid, with the noise that is left there.

    Parameters
    ----------
    surface : HeightMap
        Any.
    shape : (int, int)
        (ny, nx), no less than its own.
    """
    if shape == surface.shape:
        return surface
    share = np.array(surface.shape) / shape
    first = 0.5 * share - 0.5
    row, column = np.ogrid[: shape[0], : shape[1]]
    places = row * share[0] + first[0], column * share[1] + first[1]
    left = noise_laid(surface, places, (0.0, 0.0))
    size_y_m, size_x_m = share * surface.pixel_size_m
    between = between_points(surface, np.diag(share), first, shape)
    return replace(
        surface,
        height_m=smooth_between(surface.height_m, np.diag(share), first, shape),
        pixel_size_m=(size_y_m, size_x_m),
        noise_m=None if surface.noise_m is None else left * surface.noise_m,
        noise_scans=left**2 * surface.scans_of_noise,
        between=surface.between + ((between,) if between else ()),
    )


def on_points(matrix: np.ndarray, offset: np.ndarray) -> bool:
    """Tell whether each point of the new grid is one of the map, or of the map continued."""
    both = np.column_stack((matrix, offset))
    return bool(np.abs(both - np.round(both)).max() < WHOLE_PIXELS)


def _filled(height_m: np.ndarray) -> np.ndarray:
    """Fill what is not measured from its neighbours, ring by ring, in place; far away by zero.

    From each side as the last differences lead on; as high as the neighbour where one of these is
    unlike the others of the map, or not known.
    """
    from scipy.ndimage import binary_dilation

    known = ~np.isnan(height_m)
    led_on = [_leading(height_m if axis == 1 else height_m.T) for axis in (0, 1)]
    height_m[~known] = 0.0
    last = np.reshape(height_m.shape, (2, 1)) - 1
    behind = np.arange(1, LEADING + 2)
    for _ in range(FILLED_RINGS):
        ring = np.nonzero(binary_dilation(known) & ~known)
        if ring[0].size == 0:
            break
        sum_m, n = np.zeros(ring[0].size), np.zeros(ring[0].size)
        for step in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            ways = np.multiply.outer(step, behind)[:, :, None] + np.reshape(ring, (2, 1, -1))
            beside = tuple(np.clip(ways, 0, last[:, None]))
            z_m, there = height_m[beside], known[beside]
            over_m = z_m[:-1] - z_m[1:]
            weight, most_m = led_on[step[0] == 0]
            leads = (np.abs(over_m) <= most_m).all(axis=0) & there.all(axis=0)
            sum_m += np.where(there[0], z_m[0] + leads * (weight @ over_m), 0.0)
            n += there[0]
        height_m[ring] = sum_m / n
        known[ring] = True
    return height_m


def _leading(line_m: np.ndarray) -> tuple[np.ndarray, float]:
    """Return what the last differences along lines count in the next one, and the most of one.

    By least squares forth and back, after Burg (Childers, Modern Spectrum Analysis, IEEE 1978),
    which leads to nothing that grows: of a plane the last one counts whole, waves go on as they
    are, and what is rough from point to point is led on to nowhere.
    """
    line_m = line_m[:: max(1, line_m.size // ASKED)]
    over_m = np.diff(line_m, axis=1)
    size_m = np.abs(over_m[~np.isnan(over_m)])
    weight, most_m = np.zeros(LEADING), 0.0
    if size_m.size:
        most_m = UNLIKE * deviation_m(size_m)
    over_m[~(np.abs(over_m) <= most_m)] = np.nan
    forth_m = back_m = over_m
    least_m2 = ROUNDING * np.nansum(np.square(over_m))
    for n in range(LEADING):
        forth_m, back_m = forth_m[:, 1:], back_m[:, :-1]
        both = ~np.isnan(forth_m + back_m)
        one_m, other_m = forth_m[both], back_m[both]
        size_m2 = float(one_m @ one_m + other_m @ other_m)
        if size_m2 <= least_m2:
            break
        share = 2.0 * float(one_m @ other_m) / size_m2
        weight[:n] -= share * weight[:n][::-1]
        weight[n] = share
        forth_m, back_m = forth_m - share * back_m, back_m - share * forth_m
    return weight, most_m


def _most_bent(height_m: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return how far below and above the straight line heights may be at places, shape (2, n).

    Between two points of a crest the lines that the points on either side make meet above the
    straight line, and nothing smooth is higher. Both points must bend the same way: beside a step
    only one of them does, and in it they bend apart.
    """
    ny, nx = height_m.shape
    of_all_m = height_m.reshape(-1)
    row, col = (
        np.minimum(np.maximum(at.astype(np.intp), 1), n - 3)
        for at, n in zip(place, (ny, nx), strict=True)
    )
    at, share = row * nx + col, place - np.stack((row, col))
    most_m = np.zeros((2, at.size))
    for along, across, part, other in ((nx, 1, *share), (1, nx, *share[::-1])):
        for line, weight in ((at, 1.0 - other), (at + across, other)):
            z_m = [of_all_m[line + k * along] for k in (-1, 0, 1, 2)]
            bend_m = z_m[0] - 2.0 * z_m[1] + z_m[2], z_m[1] - 2.0 * z_m[2] + z_m[3]
            for side, sign in ((0, 1.0), (1, -1.0)):
                low_m, high_m = (np.maximum(sign * one_m, 0.0) for one_m in bend_m)
                most_m[side] -= sign * weight * np.minimum(part * low_m, (1.0 - part) * high_m)
    return most_m
