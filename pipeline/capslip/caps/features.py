"""Feature parameters of a map in the words of ISO 25178-2: its hills after Wolf pruning."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.caps.separation import change_tree
from capslip.errors import UnusableSurfaceError
from capslip.surface.heightmap import HeightMap
from capslip.surface.holes import holes

PRUNING_OF_SZ = 0.05  # ISO 25178-3
HIGHEST = 5  # peaks of S5p
AROUND = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


@dataclass(frozen=True, eq=False)
class FeatureParameters:
    """Hills of the whole map, after Wolf pruning at 5 % of Sz.

    A hill is closed where it does not touch the edge of the map or of what was measured; a hole
    between measured points is no edge. The parameters are those of the closed hills, NaN where
    there are none.

    Attributes
    ----------
    hills_at_5_percent, closed_hills : int
        How many there are.
    Spd_per_m2 : float
        Closed hills over the measured area.
    Spc_per_m : float
        Mean curvature of their peaks, -(z_xx + z_yy)/2 by differences of neighbouring points.
    S5p_m : float
        Mean height above the mean of the five highest peaks, or of all if they are fewer.
    Sha_m2 : float
        Mean area of a closed hill.
    """

    hills_at_5_percent: int
    closed_hills: int
    Spd_per_m2: float
    Spc_per_m: float
    S5p_m: float
    Sha_m2: float


def feature_parameters(surface: HeightMap) -> FeatureParameters:
    """Find the hills of a map by steepest ascent, prune them and measure the closed ones.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form. Of the map upside down these are the parameters of the
        dales: Svd, Svc, S5v and Sda.

    Raises
    ------
    UnusableSurfaceError
        If no point is measured.

    Examples
    --------
    >>> y, x = np.mgrid[0:200, 0:300] * 1e-6
    >>> waves_m = 1e-6 * np.cos(2 * np.pi * x / 1e-4) * np.cos(2 * np.pi * y / 1e-4)
    >>> found = feature_parameters(HeightMap(waves_m, (1e-6, 1e-6)))
    >>> found.hills_at_5_percent, found.closed_hills, round(found.Spc_per_m)
    (18, 4, 3947)
    """
    # A frame spares the tree the edge of the map
    framed_m = np.pad(surface.height_m, 1, constant_values=np.nan)
    flat_m, width = framed_m.reshape(-1), framed_m.shape[1]
    point = np.flatnonzero(~np.isnan(flat_m))
    if point.size == 0:
        raise UnusableSurfaceError(
            f"{surface.origin.name}: all {surface.size} points are non-measured; expected heights"
        )
    height_m = flat_m[point]
    tree = change_tree(point, height_m, framed_m.shape)
    m = len(tree.peak_m)
    group = tree.join(tree.prominence_m < PRUNING_OF_SZ * float(np.ptp(height_m)))
    hill = group[tree.hill]
    n_points = np.bincount(hill, minlength=m)

    outside = np.pad(~(surface.measured | holes(surface)), 1, constant_values=True).reshape(-1)
    at_edge = np.zeros(len(point), dtype=bool)
    for down, right in AROUND:
        at_edge |= outside[point + down * width + right]
    closed = n_points > 0
    found = int(np.count_nonzero(closed))
    closed[hill[at_edge]] = False

    at_peak = height_m == tree.peak_m[tree.hill]
    summit = np.empty(m, dtype=np.int64)
    summit[tree.hill[at_peak]] = point[at_peak]
    return FeatureParameters(
        hills_at_5_percent=found,
        closed_hills=int(np.count_nonzero(closed)),
        Spd_per_m2=np.count_nonzero(closed) / (point.size * surface.pixel_area_m2),
        Spc_per_m=_mean(_curvature_per_m(flat_m, width, summit[closed], surface.pixel_size_m)),
        S5p_m=_mean(tree.peak_m[closed][:HIGHEST] - height_m.mean()),
        Sha_m2=_mean(n_points[closed] * surface.pixel_area_m2),
    )


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else math.nan


def _curvature_per_m(
    flat_m: np.ndarray, width: int, at: np.ndarray, pixel_size_m: tuple[float, float]
) -> np.ndarray:
    """Return the mean curvature at those points that have measured neighbours on both sides."""
    bent = [
        (flat_m[at + step] - 2.0 * flat_m[at] + flat_m[at - step]) / size_m**2
        for step, size_m in zip((width, 1), pixel_size_m, strict=True)
    ]
    curvature_per_m = -0.5 * (bent[0] + bent[1])
    return curvature_per_m[~np.isnan(curvature_per_m)]
