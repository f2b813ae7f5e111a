"""Tops of hills that a sensor cut off, put back as their flanks carry on."""

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from capslip.surface.heightmap import HeightMap, Heights, Tops
from capslip.surface.noise import SAMPLES, noise_of_map_m
from capslip.surface.rows import even_lines, row_blocks

CLIPPED_POINTS = 9  # that share the greatest height
LEAST_FLAT = 4  # points of a place: fewer are a pixel that noise lifted
LEAST_SEEN = 1_000  # points of a map whose noise tells a floor: on fewer, rims of caps look like it
LEAST_NOISE = 1e-4  # of the height of a flank: a map of less was computed, not measured
FIRST_RING, WIDER, WIDEST = 0.1, 1.4, 3.0  # widths of a flank, over the radius of what it holds
LEAST_POINTS = 24  # of a flank
MOST_POINTS = 2_500  # of them that are fitted
CELLS = 6  # of a flank that deviate by themselves where its points go together
POWERS = [(d - j, j) for d in range(5) for j in range(d + 1)]  # of u and v, up to the fourth degree
QUADRIC, QUARTIC = 6, 15  # of them
UNCERTAIN = 0.5  # of its height above the bound: standard error of a top that is better left flat
ROUNDING = 1e-9  # of the range of heights
FRAYED = 2.0  # standard deviations of the noise below the bound from which points are fitted
WORST_CONDITION = 1e12  # of the normal equations: beyond, points lie on a line
BELOW = 0.1  # share of the points that may stand below the bound: those of the rim


@dataclass(frozen=True, eq=False)
class _Surface:
    """z = sum of c u^i v^j over (u, v) = (x, y) from a place, scaled, by least squares."""

    place_m: tuple[float, float]
    scale_m: float
    c: np.ndarray  # (k,)
    covariance: np.ndarray  # (k, k), that of the correlated points included
    common_m2: float  # variance that neighbours share: what the hill itself deviates by

    def terms(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        u, v = (x_m - self.place_m[0]) / self.scale_m, (y_m - self.place_m[1]) / self.scale_m
        powers = POWERS[: self.c.size]
        return np.stack([u**i * v**j for i, j in powers])

    def spread(self, gradient: np.ndarray) -> float:
        """Return the standard error of what has that gradient over the coefficients."""
        return math.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0))

    @property
    def determinant(self) -> float:
        """Of the second derivatives, 0 where it does not curve downwards in all directions."""
        xx, xy, yy = 2.0 * self.c[3], self.c[4], 2.0 * self.c[5]
        return float(xx * yy - xy**2) if xx < 0.0 and yy < 0.0 and xx * yy > xy**2 else 0.0

    @property
    def log_radius_se(self) -> float:
        """Standard error of the logarithm of sqrt(R1 R2)."""
        xx, xy, yy = 2.0 * self.c[3], self.c[4], 2.0 * self.c[5]
        slope = np.array([0.0, 0.0, 0.0, yy, -xy, xx]) / self.determinant
        return self.spread(slope)


def clipped_points(surface: HeightMap) -> np.ndarray | None:
    """Return the index of the points that share the greatest height, None where that is no limit.

    Nine points at least, and four times as many as at the next height: else heights come in steps.

    Parameters
    ----------
    surface : HeightMap
        As measured: levelling hides a flat top.
    """
    top_m, nx = surface.bounds_m[1], surface.shape[1]
    found = [
        np.flatnonzero(surface[rows] == top_m) + rows.start * nx
        for rows in row_blocks(surface.shape)
    ]
    index = np.concatenate(found)  # none where nothing was measured
    if index.size < CLIPPED_POINTS:
        return None
    height_m = surface.height_m.reshape(-1)
    below_m = np.fmax.reduce(height_m, where=height_m < top_m, initial=-np.inf)
    if index.size <= 4 * np.count_nonzero(height_m == below_m):
        return None
    return index if np.isfinite(below_m) else None


def floor_points(surface: HeightMap) -> np.ndarray | None:
    """Return the index of the points that share the least height, None where that is no limit.

    Told as by `clipped_points`, where the other points have noise: a floor that was designed lies
    at one height as well.
    """
    index = clipped_points(replace(surface, height_m=-surface.height_m))
    if index is None or surface.n_measured < LEAST_SEEN:
        return None
    others = surface.without(index)
    least_m = LEAST_NOISE * float(np.ptp(others.bounds_m))
    seen = noise_of_map_m(others.height_m) > max(_step_m(others.height_m), least_m)
    return index if seen else None


def restore_tops(surface: HeightMap) -> HeightMap:
    """Put back the tops that the range of the sensor cut off, as the flanks around them carry on.

    A clipped height is no height but a bound. Through the flank around each clipped place goes a
    quadric by least squares; it stands in for the place where it curves downwards and does not lie
    below the bound. The flank is as wide as makes the error of the top least: where it leaves the
    hill, for a floor or another hill, the misfit grows.

    Parameters
    ----------
    surface : HeightMap
        The map as measured.

    Returns
    -------
    HeightMap
        The same where nothing was clipped. Else with `tops`: what was put back, the standard errors
        of it, and how many clipped places are left. All are left where no noise is seen, for want
        of it or as heights are stored in steps: there a worn plateau, too, lies at one height.

    Notes
    -----
    The residuals of the flank are taken for noise, point by point, as far as neighbours have
    nothing in common, and for the share that they have in common as those of 16 cells. To the error
    of the top comes by how much the next narrower flank moves it.
    """
    index = clipped_points(surface)
    if index is None:
        return surface
    from scipy.ndimage import binary_dilation, find_objects, label  # takes as long as all else

    mask = np.zeros(surface.shape, dtype=bool)
    mask.reshape(-1)[index] = True
    around = np.ones((3, 3))  # noise frays the rim of a place: what is that near is part of it
    places = np.where(mask, label(binary_dilation(mask, around), around)[0], 0)
    height_m, noise_m = surface.height_m.copy(), noise_of_map_m(surface.height_m)
    step_m = _step_m(surface)
    rows = []
    for number, box in enumerate(find_objects(places), start=1):
        place = _place(surface, places, number, box)
        seen = noise_m > max(step_m, LEAST_NOISE * float(np.ptp(place.z_m[place.flank])))
        top = _top(place, noise_m) if seen else None
        if top is not None:
            height_m[place.wide][place.own] = place.bound_m + np.maximum(top.up_m, 0.0)
            rows.append(top.row)
        elif place.x_m.size >= LEAST_FLAT:
            rows.append(place.as_it_was)
    x_m, y_m, radius_m, up_m, height_se_m, log_radius_se = np.array(rows).reshape(-1, 6).T
    tops = Tops(x_m, y_m, radius_m, up_m, height_se_m, log_radius_se, index.size)
    return replace(surface, height_m=height_m, tops=tops)


def without_lost_tops(surface: HeightMap) -> HeightMap:
    """Return the map less those tops whose points are not measured any more, or lie beside it."""
    tops = surface.tops
    if tops is None:
        return surface
    side_y_m, side_x_m = surface.side_m
    inside = (tops.x_m >= 0.0) & (tops.x_m < side_x_m) & (tops.y_m >= 0.0) & (tops.y_m < side_y_m)
    there = inside & surface.measured[surface.pixel_at(tops.x_m, tops.y_m)]
    columns = {one.name: getattr(tops, one.name) for one in fields(Tops)}
    kept: dict[str, Any] = {
        name: of[there] for name, of in columns.items() if isinstance(of, np.ndarray)
    }
    return replace(surface, tops=replace(tops, **kept))


def joined_tops(first: Tops | None, second: Tops | None) -> Tops | None:
    """Return the tops of two maps in one frame, None where neither has any."""
    if first is None or second is None:
        return first or second
    both: dict[str, Any] = {}
    for name in (one.name for one in fields(Tops)):
        of_each = getattr(first, name), getattr(second, name)
        both[name] = sum(of_each) if name == "points" else np.concatenate(of_each)
    return Tops(**both)


@dataclass(frozen=True, eq=False)
class _Place:
    """A place that was clipped, and what is around it; heights of shape (ny, nx) in a window."""

    wide: tuple[slice, slice]  # the window
    z_m: np.ndarray
    own: np.ndarray  # which points are the place
    flank: np.ndarray  # which are measured and nearer to it than to another
    away_m: np.ndarray  # their distance from it
    x_m: np.ndarray  # of the points of the place
    y_m: np.ndarray
    radius_m: float  # of the disc of its area
    reach_m: float  # how far the window goes beyond
    pixel_size_m: tuple[float, float]

    @property
    def bound_m(self) -> float:
        """The height at which it was clipped."""
        return float(self.z_m[self.own][0])

    @property
    def as_it_was(self) -> tuple[float, ...]:
        """Row of `Tops` of a place that stays flat.

        A paraboloid with the slope s of the flank at the rim of a place of radius r is s r / 2
        higher: that the true top is as uncertain as twice that says nothing of what it is.
        """
        rim = self.flank & (self.away_m <= 2.0 * max(self.pixel_size_m))
        slope = np.mean((self.bound_m - self.z_m[rim]) / self.away_m[rim]) if rim.any() else 0.0
        at = float(self.x_m.mean()), float(self.y_m.mean())
        around_m = float(np.hypot(self.x_m - at[0], self.y_m - at[1]).max())
        return (*at, around_m, 0.0, float(slope) * self.radius_m, 1.0)


def _place(surface: HeightMap, places: np.ndarray, number: int, box: tuple[slice, slice]) -> _Place:
    from scipy.ndimage import distance_transform_edt

    dy_m, dx_m = surface.pixel_size_m
    n = int(np.count_nonzero(places[box] == number))
    radius_m = math.sqrt(n * surface.pixel_area_m2 / math.pi)
    reach_m = WIDEST * radius_m + 4.0 * max(dy_m, dx_m)
    more_y, more_x = (math.ceil(reach_m / size_m) for size_m in (dy_m, dx_m))
    wide = (
        slice(max(0, box[0].start - more_y), box[0].stop + more_y),
        slice(max(0, box[1].start - more_x), box[1].stop + more_x),
    )
    near, z_m = places[wide], surface.height_m[wide]
    own = near == number
    away_m = distance_transform_edt(~own, sampling=(dy_m, dx_m))
    flank = (near == 0) & ~np.isnan(z_m)
    others = (near > 0) & ~own
    if others.any():
        flank &= away_m < distance_transform_edt(~others, sampling=(dy_m, dx_m))
    row, col = np.nonzero(own)
    x_m, y_m = (wide[1].start + col + 0.5) * dx_m, (wide[0].start + row + 0.5) * dy_m
    size = surface.pixel_size_m
    return _Place(wide, z_m, own, flank, away_m, x_m, y_m, radius_m, reach_m, size)


@dataclass(frozen=True, eq=False)
class _Top:
    """What stands over the points of a place, and its row of `Tops`."""

    up_m: np.ndarray
    row: tuple[float, ...]


def _top(place: _Place, noise_m: float) -> _Top | None:
    """Return what the flanks of a place carry on to, None where they do not tell."""
    best, least_m, before_m = None, math.inf, math.nan
    width_m = max(FIRST_RING * place.radius_m, 2.0 * max(place.pixel_size_m))
    while width_m <= place.reach_m:
        near_by = place.flank & (place.away_m <= width_m)
        width_m *= WIDER
        found = _through(place, near_by, QUADRIC, noise_m)
        if found is None or found.determinant == 0.0:
            continue
        up_m = found.c @ found.terms(place.x_m, place.y_m)
        top = int(np.argmax(up_m))
        moved_m = 0.0 if math.isnan(before_m) else up_m[top] - before_m
        before_m = float(up_m[top])
        at = place.x_m[top], place.y_m[top]
        if found.spread(found.terms(*at)) > least_m:
            continue
        freer = _through(place, near_by, QUARTIC, noise_m)
        if freer is None:
            continue
        own_se_m, freer_se_m = (one.spread(one.terms(*at)) for one in (found, freer))
        shape_m2 = float(freer.c @ freer.terms(*at) - up_m[top]) ** 2 - freer_se_m**2
        se_m = math.sqrt(own_se_m**2 + found.common_m2 + moved_m**2 + max(shape_m2, 0.0))
        if se_m < least_m:
            best, least_m = (found, up_m, top), se_m
    if best is None:
        return None
    found, up_m, top = best
    highest_m = float(up_m[top])
    if not least_m <= UNCERTAIN * highest_m or np.mean(up_m < -2.0 * least_m) > BELOW:
        return None
    at = float(place.x_m[top]), float(place.y_m[top])
    log_radius_se = max(found.log_radius_se, least_m / highest_m)
    return _Top(up_m, (*at, place.radius_m, highest_m, least_m, log_radius_se))


def _through(place: _Place, flank: np.ndarray, n_terms: int, noise_m: float) -> _Surface | None:
    """Return the surface through a flank, heights from the bound; None of too few points.

    Points that noise could have lifted to the bound are left out, by where the surface is: those
    that it did lift are missing there.
    """
    row, col = np.nonzero(flank)
    every = max(1, math.isqrt(row.size // MOST_POINTS))
    some = (row % every == 0) & (col % every == 0)
    row, col = row[some], col[some]
    up_m = place.z_m[row, col] - place.bound_m
    dy_m, dx_m = place.pixel_size_m
    at_m = (place.wide[1].start + col + 0.5) * dx_m, (place.wide[0].start + row + 0.5) * dy_m
    found = _least_squares(*at_m, up_m, (row, col), every, n_terms)
    if found is None or noise_m == 0.0:
        return found
    below = found.c @ found.terms(*at_m) < -FRAYED * noise_m
    x_m, y_m = (one[below] for one in at_m)
    return _least_squares(x_m, y_m, up_m[below], (row[below], col[below]), every, n_terms)


def _least_squares(
    x_m: np.ndarray,
    y_m: np.ndarray,
    up_m: np.ndarray,
    at: tuple[np.ndarray, np.ndarray],
    every: int,
    n_terms: int,
) -> _Surface | None:
    """Return the surface through points of a lattice; None of too few, or of points on a line."""
    if x_m.size < LEAST_POINTS:
        return None
    place_m = float(x_m.mean()), float(y_m.mean())
    scale_m = math.hypot(float(x_m.std()), float(y_m.std()))
    blank = _Surface(place_m, scale_m, np.zeros(n_terms), np.zeros((n_terms, n_terms)), 0.0)
    terms = blank.terms(x_m, y_m)
    normal = terms @ terms.T
    if np.linalg.cond(normal) > WORST_CONDITION:
        return None
    inverse = np.linalg.inv(normal)
    c = inverse @ (terms @ up_m)
    rest_m = up_m - c @ terms
    variance_m2 = float(rest_m @ rest_m) / (rest_m.size - n_terms)
    row, col = (one // every - one.min() // every for one in at)
    grid_m = np.full((row.max() + 1, col.max() + 1), np.nan)
    grid_m[row, col] = rest_m
    pairs = [(one[:, 1:] * one[:, :-1]).ravel() for one in (grid_m, grid_m.T)]
    beside_m2 = np.concatenate(pairs)
    known = np.isfinite(beside_m2)
    common_m2 = float(beside_m2[known].mean()) if known.any() else variance_m2
    common_m2 = min(max(common_m2, 0.0), variance_m2)
    each_m2 = variance_m2 - common_m2 + common_m2 * max(rest_m.size / CELLS, 1.0)
    return replace(blank, c=c, covariance=inverse * each_m2, common_m2=common_m2)


def _step_m(height_m: Heights) -> float:
    """Return the least step between heights that differ by more than rounding, on a lattice."""
    every = max(1, math.isqrt(height_m.size // SAMPLES))
    rows, columns = (even_lines(n, every) for n in height_m.shape)
    known_m = np.unique(height_m[rows, columns])
    known_m = known_m[~np.isnan(known_m)]
    steps_m = np.diff(known_m)
    steps_m = steps_m[steps_m > ROUNDING * np.ptp(known_m)] if steps_m.size else steps_m
    return float(steps_m.min(initial=math.inf))
