"""The body of each hill: its points, its volume and its shape within the depth of a fit."""

from dataclasses import dataclass, replace

import numpy as np

from capslip.caps.apex import Apexes
from capslip.caps.noise import Noise
from capslip.caps.points import LIMIT_EDGE, LIMIT_HILL, LIMIT_PATCH, HillPoints, sums_by_hill
from capslip.caps.quadric import Quadrics, fit_quadrics

NEGLIGIBLE_NOISE = 1e-3  # of the depth of the fit
FILLED_ELLIPSE = 0.8  # share of the ellipse of their second moments that the points of a cap fill
DEEP_NOISE = 20.0  # standard deviations of the noise: depth that a fit takes where there is as much


@dataclass(frozen=True, eq=False)
class Body:
    """What of each hill lies within the depth of its fit, shape (n,)."""

    depth_m: np.ndarray
    volume_m3: np.ndarray
    at_edge: np.ndarray  # whether the edge of the face cuts it
    at_patch: np.ndarray  # whether non-measured points do
    beside_hills: np.ndarray  # share of its outline that lies along other hills
    scattered: np.ndarray  # whether its points lie in several places
    quadric: Quadrics
    scatter_m: np.ndarray  # standard deviation of its points that is fit for errors of means

    @property
    def radius_ratio(self) -> np.ndarray:
        """R1 / R2, NaN where the quadric has no vertex."""
        return self.quadric.curvature_per_m[1] / self.quadric.curvature_per_m[0]


def body_of_hills(
    cut_height_m: float,
    points: HillPoints,
    apexes: Apexes,
    noise: Noise,
    depth_m: np.ndarray,
    depth_share: float,
) -> Body:
    """Gather what lies within the depth of the fit, and put a quadric through it.

    Parameters
    ----------
    cut_height_m : float
        Below it there is no hill.
    points, apexes, noise
        Of the hills.
    depth_m : float64, shape (n,)
        Depth below the apex that is asked for; NaN where none is.
    depth_share : float
        Depth elsewhere, of the height of the cap; deeper where there is much noise.
    """
    noise_m = noise.rms_m
    depth_m = _depth_m(cut_height_m, apexes, noise_m, depth_m, depth_share)
    level_m = apexes.apex_m[2] - depth_m

    seen_m = np.maximum(level_m, apexes.floor_m)
    quadric = by_height = fit_quadrics(points, seen_m, apexes.apex_m)
    if noise_m > NEGLIGIBLE_NOISE * np.max(depth_m, initial=0.0):
        quadric = fit_quadrics(points, seen_m, apexes.apex_m, quadric, noise_m)
    whole = _lost_on_quadric(points, quadric, seen_m)
    filled, rise_m, at_edge, at_patch, beside_hills = _contents(whole, seen_m, level_m)
    filled_m2 = points.pixel_area_m2 * filled
    scattered = filled_m2 < FILLED_ELLIPSE * 4.0 * np.pi * by_height.spread_m2

    return Body(
        depth_m=depth_m,
        volume_m3=points.pixel_area_m2 * rise_m,
        at_edge=at_edge,
        at_patch=at_patch,
        beside_hills=beside_hills,
        scattered=scattered,
        quadric=quadric,
        scatter_m=np.fmax(quadric.residual_m, noise_m) * noise.inflation,
    )


def _lost_on_quadric(points: HillPoints, quadric: Quadrics, level_m: np.ndarray) -> HillPoints:
    """Return the points with those that stand in for lost ones on the quadric, where it is high.

    The mean of neighbours lies below the top between them: by 0.75 of what a sphere falls over a
    pixel along both axes, which took 5 % off radii on 25 points of which a fifth was lost. What
    measured points deviate from the quadric has no mean, so it takes nothing off the volume.
    """
    lost = np.flatnonzero(~points.measured)
    if not lost.size:
        return points
    hill = points.hill[lost]
    height_m = quadric.height_m(points.count_of(lost), *points.places_m(lost))
    high = quadric.exists[hill] & (height_m >= level_m[hill])
    z_m = points.z_m.copy()
    z_m[lost[high]] = height_m[high]
    return replace(points, z_m=z_m)


def _contents(
    points: HillPoints, seen_m: np.ndarray, level_m: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return what of each hill stands above levels, shape (n,).

    The number of points above the first, those that stand in for lost ones too; above the second
    the sum of their heights, whether the edge of the face or non-measured points are among them,
    and which share of the outline of as large a disc lies along other hills.
    """
    filled, rise_m, area = np.zeros((3, points.n_hills))
    cut = np.zeros((3, points.n_hills))  # points there
    for hills, some in points.groups():
        z_m, count = points.z_m[some], points.count[hills]
        seen = np.flatnonzero(z_m >= np.repeat(seen_m[hills], count))
        filled[hills] = points.count_of(some.start + seen)[hills]
        up_m = z_m - np.repeat(level_m[hills], count)
        above = np.flatnonzero(up_m > 0.0)
        limit, index = points.limit[some][above], some.start + above
        rise_m[hills] = sums_by_hill(up_m[above], points.count_of(index)[hills])
        for row, bit in zip(cut, (LIMIT_EDGE, LIMIT_PATCH, LIMIT_HILL), strict=True):
            row[hills] = points.count_of(index[(limit & bit) > 0])[hills]
        area[hills] = points.count_of(index)[hills]
    outline = 2.0 * np.sqrt(np.pi * np.maximum(area, 1.0))
    return filled, rise_m, cut[0] > 0, cut[1] > 0, cut[2] / outline


def _depth_m(
    cut_height_m: float,
    apexes: Apexes,
    noise_m: float,
    asked_m: np.ndarray,
    depth_share: float,
) -> np.ndarray:
    """Return the depths, between what noise and pixels allow and the cut."""
    height_m = np.fmax(apexes.apex_m[2] - cut_height_m, 0.0)
    noisy_m = np.minimum(DEEP_NOISE * noise_m, height_m - 3.0 * noise_m)
    own_m = np.maximum(depth_share * height_m, noisy_m)
    asked_m = np.maximum(asked_m, apexes.least_depth_m)
    return np.minimum(np.where(np.isnan(asked_m), own_m, asked_m), height_m)
