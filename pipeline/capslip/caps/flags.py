"""Flags of caps: what makes each doubtful."""

import numpy as np

from capslip.caps.fitting import FitInput, Spheres
from capslip.caps.points import LIMIT_EDGE, LIMIT_PATCH, HillPoints
from capslip.caps.quadric import MIN_POINTS
from capslip.caps.spheres import RIDGE_RATIO
from capslip.caps.table import CapFlag

NOISY_APEX_RATIO = 0.1  # noise over cap height
PLATEAU_SHARE = 0.01  # of a hill's points that share the greatest height; and more than four
OUTLIER_SPREADS = 5.0  # robust standard deviations of ln R, and a factor of three


def flags_of_caps(given: FitInput, spheres: Spheres, cap_height_m: np.ndarray) -> np.ndarray:
    """Return the `CapFlag` bits of each cap, uint16, shape (n,).

    Parameters
    ----------
    given, spheres
        What the fit got, and gave; a radius of NaN is that of a hill without a sphere.
    cap_height_m : float64, shape (n,)
        Height of each apex above the cut.
    """
    points, apexes, body = given.points, given.apexes, given.body
    few = points.count < MIN_POINTS
    uncertain_m = np.fmax(given.noise.rms_m, 2.0 * spheres.apex_se_m)
    conditions = {
        CapFlag.edge: _touching(points, LIMIT_EDGE),
        CapFlag.non_measured: _touching(points, LIMIT_PATCH),
        CapFlag.plateau: (apexes.ties > 4) & (apexes.ties > PLATEAU_SHARE * points.count),
        CapFlag.not_convex: np.isnan(spheres.radius_m),
        CapFlag.noisy_apex: uncertain_m > NOISY_APEX_RATIO * cap_height_m,
        CapFlag.apex_off_surface: ~spheres.on_surface,
        CapFlag.few_points: few,
        CapFlag.ridge: ~few & ~(np.nan_to_num(body.radius_ratio, nan=np.inf) <= RIDGE_RATIO),
        CapFlag.several_peaks: body.scattered,
        CapFlag.outlier: outliers(spheres.radius_m),
    }
    flags = np.zeros(points.n_hills, dtype=np.uint16)
    for name, condition in conditions.items():
        flags[condition] |= np.uint16(name.value)
    return flags


def outliers(radius_m: np.ndarray) -> np.ndarray:
    """Tell which radii lie far from the median, in their logarithm and by a robust spread."""
    known = np.isfinite(radius_m)
    if known.sum() < MIN_POINTS:
        return np.zeros(len(radius_m), dtype=bool)
    logarithm = np.log(np.where(known, radius_m, 1.0))
    distance = np.abs(logarithm - np.median(logarithm[known]))
    spread = 1.4826 * np.median(distance[known])
    return known & (distance > max(OUTLIER_SPREADS * spread, np.log(3.0)))


def _touching(points: HillPoints, limit: int) -> np.ndarray:
    return np.bincount(points.hill[(points.limit & limit) > 0], minlength=points.n_hills) > 0
