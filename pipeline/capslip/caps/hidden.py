"""Tops of hills that lie in holes of a map, by the flanks around them."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.caps.points import HillPoints
from capslip.caps.quadric import MIN_POINTS, fit_quadrics
from capslip.caps.spheres import RIDGE_RATIO, elliptic_factor
from capslip.surface.heightmap import HeightMap
from capslip.surface.holes import holes

LEAST_PIXELS = 1.5  # of the radius of a hole: smaller ones hide no more than pixels do
RIM = 3  # longer sides of pixels from what lies within a hole to what was measured
AROUND = 2.5, 1.5  # radii of a hole, within which its flanks are looked at: as many as tell
FLANK = 0.5  # of the relief around a hole: what is lower may be another hill, or a floor


@dataclass(frozen=True, eq=False)
class HiddenTops:
    """Tops that were not measured, shape (n,), as the flanks around them tell."""

    x_m: np.ndarray
    y_m: np.ndarray
    height_m: np.ndarray
    height_se_m: np.ndarray  # standard error, by the scatter of the flanks
    radius_m: np.ndarray  # that Hertz theory wants
    flank_m: np.ndarray  # radius of the disc about the hole that holds the flanks


def hidden_tops(surface: HeightMap) -> HiddenTops:
    """Find the tops that lie in holes, and higher than all that was measured around them.

    A hill that lost its top leaves its flanks: where what is highest around a hole lies on a
    quadric whose vertex is in the hole, there is a top. One that would rise more than all the
    relief that was seen is no more than a guess.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    """
    row, col, depth_m = _places(surface)
    flank_m = np.concatenate([around * depth_m for around in AROUND])
    row, col = (np.tile(one, len(AROUND)) for one in (row, col))
    some, points = _around(surface, row, col, flank_m)
    if points.n_hills == 0:
        return HiddenTops(*np.empty((6, 0)))
    dy_m, dx_m = surface.pixel_size_m
    flank_m, centre_m = flank_m[some], np.stack(((col + 0.5) * dx_m, (row + 0.5) * dy_m))[:, some]
    start = np.cumsum(points.count) - points.count
    top_m, least_m = (one.reduceat(points.z_m, start) for one in (np.maximum, np.minimum))
    flanks = fit_quadrics(points, top_m - FLANK * (top_m - least_m), np.stack((*centre_m, top_m)))
    large, small = flanks.curvature_per_m[::-1]
    with np.errstate(invalid="ignore"):  # a quadric without a vertex
        away_m = np.hypot(flanks.x_m - centre_m[0], flanks.y_m - centre_m[1])
        rise_m = flanks.z_m - top_m
        hidden = (rise_m > 0.0) & (rise_m <= top_m - least_m) & (away_m < flank_m)
        hidden &= large < RIDGE_RATIO * small
        at = surface.pixel_at(np.nan_to_num(flanks.x_m), np.nan_to_num(flanks.y_m))
        hidden &= ~surface.measured[at]
        radius_m = elliptic_factor(large / small) / np.sqrt(large * small)
        se_m = flanks.residual_m * flanks.height_gain(flanks.x_m, flanks.y_m)
    tops_m = flanks.x_m, flanks.y_m, flanks.z_m, se_m, radius_m, flank_m
    kept = _one_each(flanks.x_m, flanks.y_m, flank_m, hidden)
    return HiddenTops(*(one[kept] for one in tops_m))


def _one_each(
    x_m: np.ndarray, y_m: np.ndarray, flank_m: np.ndarray, hidden: np.ndarray
) -> list[int]:
    """Return which tops there are, each one once: of a long hole several places tell of it."""
    kept = list[int]()
    for k in np.flatnonzero(hidden).tolist():
        if (np.hypot(x_m[kept] - x_m[k], y_m[kept] - y_m[k]) > flank_m[kept]).all():
            kept.append(k)
    return kept


def _places(surface: HeightMap) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rows and columns of the middles of holes, and how far they are from what is not."""
    from scipy.ndimage import distance_transform_edt, find_objects, label, maximum_filter

    none = np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp), np.empty(0)
    if surface.complete:
        return none
    hole = holes(surface)
    inner = _inner(hole)
    if not inner.any():
        return none
    names, _ = label(inner, np.ones((3, 3)))
    found, least_m = list[np.ndarray](), LEAST_PIXELS * max(surface.pixel_size_m)
    # Around what is within holes alone: distances on the whole map cost as much as all caps
    around = [math.ceil(RIM * max(surface.pixel_size_m) / one) for one in surface.pixel_size_m]
    for name, within in enumerate(find_objects(names), start=1):
        top, left = (max(0, one.start - n) for one, n in zip(within, around, strict=True))
        down, right = (one.stop + n for one, n in zip(within, around, strict=True))
        window = np.s_[top:down, left:right]
        depth_m = distance_transform_edt(hole[window], sampling=surface.pixel_size_m)
        middle = (names[window] == name) & (depth_m >= least_m)
        row, col = np.nonzero(middle & (maximum_filter(depth_m, 3) == depth_m))
        found.append(np.stack((row + top, col + left, depth_m[row, col])))
    rows, cols, depth_m = np.concatenate(found, axis=1)
    row, col = rows.astype(np.intp), cols.astype(np.intp)
    taken, kept = np.zeros(surface.shape, dtype=bool), list[int]()
    order = np.lexsort((col, row, -depth_m))
    for k in order.tolist():  # the middle of a long hole is not one place
        if not taken[row[k], col[k]]:
            kept.append(k)
            taken[_window(surface, row[k], col[k], depth_m[k])] = True
    return row[kept], col[kept], depth_m[kept]


def _inner(hole: np.ndarray) -> np.ndarray:
    """Return which points of holes have none but such around them; beyond the map as well."""
    out = np.pad(hole, 1, constant_values=True)
    rows = out[:-2] & out[1:-1] & out[2:]
    return rows[:, :-2] & rows[:, 1:-1] & rows[:, 2:]


def _window(surface: HeightMap, row: int, col: int, radius_m: float) -> tuple[slice, slice]:
    """Return the rows and columns of the square about a place."""
    down, right = (int(radius_m / size_m) for size_m in surface.pixel_size_m)
    return (
        slice(max(0, row - down), row + down + 1),
        slice(max(0, col - right), col + right + 1),
    )


def _around(
    surface: HeightMap, row: np.ndarray, col: np.ndarray, flank_m: np.ndarray
) -> tuple[list[int], HillPoints]:
    """Return the places around which enough was measured, and the points there."""
    (dy_m, dx_m), some, found = surface.pixel_size_m, list[int](), [np.empty((4, 0))]
    for k, radius_m in enumerate(flank_m.tolist()):
        window = _window(surface, row[k], col[k], radius_m)
        z_m = surface[window]
        y, x = (np.arange(n) + one.start for n, one in zip(z_m.shape, window, strict=True))
        r_m = np.hypot((y[:, None] - row[k]) * dy_m, (x - col[k]) * dx_m)
        i, j = np.nonzero(np.isfinite(z_m) & (r_m <= radius_m))
        if i.size >= MIN_POINTS:
            found.append(np.stack((np.full(i.size, len(some)), y[i], x[j], z_m[i, j])))
            some.append(k)
    hill, rows, cols, height_m = np.concatenate(found, axis=1)
    place = hill.astype(np.intp)
    points = HillPoints(
        hill=place,
        row=rows,
        col=cols,
        z_m=height_m,
        measured=np.ones(hill.size, dtype=bool),
        limit=np.zeros(hill.size, dtype=np.uint8),
        count=np.bincount(place, minlength=len(some)),
        pixel_size_m=surface.pixel_size_m,
    )
    return some, points
