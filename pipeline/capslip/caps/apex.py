"""The apex of each hill, which noise does not lift."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from capslip.caps.hills import Hills
from capslip.caps.noise import Noise
from capslip.caps.points import HillPoints, sums_by_hill
from capslip.caps.quadric import Quadrics, fit_quadrics
from capslip.surface.heightmap import HeightMap
from capslip.surface.rows import BLOCK_POINTS

CROWN_POINTS = 25  # highest points from which the apex is taken where there is no noise
FEW_POINTS = 2 * CROWN_POINTS  # within a depth that says how the height falls
MAX_DOUBLINGS = 60  # of the depth within which points are counted
CROWN_NOISE = 10.0  # depth, in standard deviations of the noise, from which it is taken otherwise
LIFTED = 4.0  # standard deviations that the highest point of many may stand above the surface


@dataclass(frozen=True, eq=False)
class Apexes:
    """Apexes of all hills; shape (n,) unless said otherwise, NaN for a hill without points."""

    highest_m: np.ndarray  # (3, n): x, y and z of the highest point
    highest_se_m: np.ndarray  # by how much noise and pixels may misplace its height
    ties: np.ndarray  # number of points that share its height
    apex_m: np.ndarray  # (3, n): vertex of the quadric, or what stands in for it
    apex_se_m: np.ndarray  # standard error of its height
    on_surface: np.ndarray  # whether it is the vertex
    least_depth_m: np.ndarray  # depth of the crown, the shallowest that can be fitted
    floor_m: np.ndarray  # level below which noise takes points away from the hill
    at_cut: np.ndarray  # whether the crown would have been deeper than that level


def find_apexes(
    surface: HeightMap,
    hills: Hills,
    points: HillPoints,
    noise: Noise,
    depth_m: np.ndarray | None = None,
) -> Apexes:
    """Find the apexes by a quadric through the crown of each hill.

    The crown is as deep as noise demands, and as shallow as pixels allow: on a hill that is no
    paraboloid a deeper one would shift the apex. The vertex must lie on the hill, and no farther
    than the depth of the crown from the highest point. Where it does not, as on a slope that the
    edge cuts, the apex is where the quadric is highest among the points of the crown, or the
    highest point itself where there is no quadric or no noise.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    hills : Hills
        Labelled hills of the same map.
    points : HillPoints
        Their points.
    noise : Noise
        What `noise_on_hills` returned.
    depth_m : float64, shape (n,), optional
        Depth of the fit, NaN where none is asked for. Within it the points are counted that say how
        far the height falls from one to the next; else over the whole hill, and the cut has a say.
    """
    count = points.count
    many = np.maximum(count, 1)
    highest_m, ties = _first_highest(points.count, points.hill, points.places_m, points.z_m)
    height_m = np.fmax(highest_m[2] - hills.cut_height_m, 0.0)
    floor_m = _floor_m(hills.cut_height_m, height_m, noise.rms_m)
    # On a sphere the height falls by equal amounts from point to point.
    per_point_m = height_m / many
    if depth_m is not None:
        within_m = _fall_per_point_m(points, highest_m[2], np.minimum(depth_m, height_m))
        per_point_m = np.where(np.isnan(within_m), per_point_m, within_m)
    crown_m = np.maximum(CROWN_NOISE * noise.rms_m, CROWN_POINTS * per_point_m)
    seen_m = np.maximum(crown_m, (CROWN_NOISE + LIFTED) * noise.rms_m)
    level_m = np.maximum(highest_m[2] - seen_m, floor_m)
    crown = fit_quadrics(points, level_m, highest_m)
    if noise.rms_m > 0.0:
        level_m = np.where(crown.exists, np.fmax(crown.z_m - crown_m, floor_m), level_m)
        crown = fit_quadrics(points, level_m, highest_m, crown, noise.rms_m)
    on_surface = on_hill(surface, hills, crown)
    on_surface[on_surface] = np.abs(crown.z_m - highest_m[2])[on_surface] <= seen_m[on_surface]
    highest_se_m = noise.rms_m * np.sqrt(2.0 * np.log(np.maximum(count, 2))) + per_point_m
    apex_m = np.where(on_surface, np.stack([crown.x_m, crown.y_m, crown.z_m]), highest_m)
    fitted = on_surface
    slope = crown.solved & ~on_surface
    if noise.rms_m > 0.0 and slope.any():
        summit_m = _summit(points, crown)
        slope &= np.abs(summit_m[2] - highest_m[2]) <= seen_m
        apex_m = np.where(slope, summit_m, apex_m)
        fitted = on_surface | slope
    scatter_m = np.fmax(crown.residual_m, noise.rms_m) * noise.inflation
    gain = crown.height_gain(apex_m[0], apex_m[1])
    return Apexes(
        highest_m=highest_m,
        highest_se_m=highest_se_m,
        ties=ties,
        apex_m=apex_m,
        apex_se_m=np.where(fitted, scatter_m * gain, highest_se_m),
        on_surface=on_surface,
        least_depth_m=crown_m,
        floor_m=floor_m,
        at_cut=highest_m[2] - seen_m < floor_m,
    )


def limited_by_cut(apex_m: np.ndarray, cut_height_m: float, noise_m: float) -> np.ndarray:
    """Tell whose crown would be deeper than the cut leaves it, on a map of so much more noise.

    For sure: the highest points are taken to stand as far above the apexes as they may.

    Examples
    --------
    >>> limited_by_cut(np.array([4e-8, 8e-8]), 2e-8, 3e-9)
    array([ True, False])
    """
    highest_m = apex_m + LIFTED * noise_m
    floor_m = _floor_m(cut_height_m, np.maximum(highest_m - cut_height_m, 0.0), noise_m)
    below: np.ndarray = highest_m - (CROWN_NOISE + LIFTED) * noise_m < floor_m
    return below


def _floor_m(cut_height_m: float, height_m: np.ndarray, noise_m: float) -> np.ndarray:
    """Return the level below which noise takes points away from hills of so much height."""
    return cut_height_m + np.minimum(3.0 * noise_m, 0.3 * height_m)


def _fall_per_point_m(points: HillPoints, highest_m: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
    """Return t^2 / (2 V), V the sum of the heights above a depth t; NaN where none is given.

    That is t over the number of points within on a paraboloid, but hardly depends on where the
    lattice lies. The depth is doubled where it holds few points.
    """
    depth_m, volume_m = depth_m.copy(), np.empty(points.n_hills)
    for hills, some in points.groups():
        z_m, count = points.z_m[some], points.count[hills]
        for _ in range(MAX_DOUBLINGS):
            rise_m = z_m - np.repeat(highest_m[hills] - depth_m[hills], count)
            above = np.flatnonzero(rise_m > 0.0)
            within = points.count_of(some.start + above)[hills]
            few = within < np.minimum(FEW_POINTS, count)
            few &= np.isfinite(depth_m[hills])
            if not few.any():
                break
            depth_m[hills] = np.where(few, 2.0 * depth_m[hills], depth_m[hills])
        volume_m[hills] = sums_by_hill(rise_m[above], within)
    return depth_m**2 / (2.0 * np.where(volume_m > 0.0, volume_m, np.nan))


def on_hill(surface: HeightMap, hills: Hills, quadric: Quadrics) -> np.ndarray:
    """Tell whether each vertex exists and lies over its own hill, or over a hole in the map."""
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    row, col = quadric.y_m / dy_m, quadric.x_m / dx_m  # NaN where there is none
    inside = (row >= 0.0) & (row < ny) & (col >= 0.0) & (col < nx)
    at = tuple(np.where(inside, place, 0.0).astype(np.intp) for place in (row, col))
    own = hills.label[at] == np.arange(1, len(row) + 1)
    return inside & (own | (np.isnan(surface[at]) & ~surface.is_outside(*at)))


def _summit(points: HillPoints, quadric: Quadrics) -> np.ndarray:
    """Return x, y, z where each quadric is highest among the points it was fitted to."""
    summit_m = np.full((3, points.n_hills), np.nan)
    for hills, some in points.groups():
        chosen = some.start + np.flatnonzero(quadric.chosen[some])
        count, hill = points.count_of(chosen), points.hill[chosen].astype(np.intp) - hills.start
        x_m, y_m = points.places_m(chosen)
        places_m = partial(_taken, x_m, y_m)
        z_m = quadric.height_m(count, x_m, y_m)
        summit_m[:, hills] = _first_highest(count[hills], hill, places_m, z_m)[0]
    return summit_m


def _taken(x_m: np.ndarray, y_m: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return x_m[at], y_m[at]


def _first_highest(
    count: np.ndarray,
    hill: np.ndarray,
    places_m: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    z_m: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return x, y, z of the first highest point of each hill, and how many are as high."""
    n, some = len(count), count > 0
    highest_m = np.full((3, n), np.nan)
    if some.any():
        highest_m[2, some] = np.maximum.reduceat(z_m, (np.cumsum(count) - count)[some])
    found = [np.empty(0, dtype=np.intp)]
    for first in range(0, z_m.size, BLOCK_POINTS):
        part = slice(first, first + BLOCK_POINTS)
        found.append(first + np.flatnonzero(z_m[part] == highest_m[2].take(hill[part])))
    at = np.concatenate(found)[::-1]
    highest_m[0, hill[at]], highest_m[1, hill[at]] = places_m(at)
    return highest_m, np.bincount(hill[at], minlength=n)
