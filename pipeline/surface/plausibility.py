"""What makes a height map doubtful before anything is computed from it."""

import numpy as np

from pipeline.problems import Problem
from pipeline.surface.heightmap import HeightMap

MAX_STEEP_SHARE = 0.05
MAX_SZ_OVER_SQ = 30.0
SQUARE_WITHIN = 1e-3
SPIKE_OVER_ROUGHNESS = 20.0
SPIKE_OVER_SQ = 0.1


def doubts_of_surface(surface: HeightMap, sq_m: float, sz_m: float) -> tuple[Problem, ...]:
    """Look for signs of a wrong unit, outliers and odd pixels.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    sq_m, sz_m : float
        Its root mean square height and height range.

    Returns
    -------
    tuple of Problem
        `slope_suspect` (error) where the height range exceeds the shorter side of the face, or
        (warning) where the rms slope or more than 5 % of all slopes exceed 1: a wrong unit until
        proven otherwise. `outliers` (warning) where Sz/Sq exceeds 30. `spikes` (warning) counts
        single points far above or below all four neighbours. `non_square_pixels` (info).
    """
    steep, spikes = _slopes(surface), _spikes(surface, sq_m)
    found = (
        _unit(surface, sz_m, *steep),
        _outliers(sq_m, sz_m),
        _isolated(spikes),
        _pixel(surface),
    )
    return tuple(problem for problem in found if problem is not None)


def _unit(surface: HeightMap, sz_m: float, rms_slope: float, steep_share: float) -> Problem | None:
    side_m = min(surface.side_m)
    advice = "check the units of heights and pixels (--unit, --lateral-unit)"
    if sz_m > side_m:
        return Problem(
            "slope_suspect",
            "error",
            f"the heights range over {sz_m:.3g} m on a face only {side_m:.3g} m wide: {advice}",
        )
    if rms_slope > 1.0 or steep_share > MAX_STEEP_SHARE:
        return Problem(
            "slope_suspect",
            "warning",
            f"rms slope {rms_slope:.2g}, {100 * steep_share:.1f} % of the slopes above 1: {advice}",
        )
    return None


def _outliers(sq_m: float, sz_m: float) -> Problem | None:
    if sz_m <= MAX_SZ_OVER_SQ * sq_m:
        return None
    return Problem(
        "outliers",
        "warning",
        f"Sz/Sq = {sz_m / sq_m:.0f} (above {MAX_SZ_OVER_SQ:.0f}): single heights far from the rest "
        "pull the form and the first touch; look at the map, mark bad points as non-measured",
    )


def _isolated(n_spikes: int) -> Problem | None:
    if n_spikes == 0:
        return None
    return Problem(
        "spikes",
        "warning",
        f"{n_spikes} single points stand far above or below all their neighbours; they were kept; "
        "mark them as non-measured or use an S-filter",
    )


def _pixel(surface: HeightMap) -> Problem | None:
    dy_m, dx_m = surface.pixel_size_m
    if abs(dy_m / dx_m - 1.0) <= SQUARE_WITHIN:
        return None
    return Problem(
        "non_square_pixels",
        "info",
        f"pixels of {dy_m:.6g} x {dx_m:.6g} m (dy x dx) are not square; this is accounted for",
    )


def _slopes(surface: HeightMap) -> tuple[float, float]:
    """Return the rms slope and the share of slopes above 1, x and y together."""
    square_sum, steep, n = 0.0, 0, 0
    for axis, size_m in enumerate(surface.pixel_size_m):
        slope = np.diff(surface.height_m, axis=axis).reshape(-1)
        slope = slope[~np.isnan(slope)] / size_m
        square_sum += float(slope @ slope)
        steep += int(np.count_nonzero(np.abs(slope) > 1.0))
        n += slope.size
    return (float(np.sqrt(square_sum / n)), steep / n) if n else (0.0, 0.0)


def _spikes(surface: HeightMap, sq_m: float) -> int:
    """Count the points that stand off all four neighbours by far more than the roughness."""
    z = surface.height_m
    centre = z[1:-1, 1:-1]
    around = (z[:-2, 1:-1], z[2:, 1:-1], z[1:-1, :-2], z[1:-1, 2:])
    # fmax and fmin look past a non-measured neighbour; a point without neighbours gives NaN.
    highest = np.fmax(np.fmax(around[0], around[1]), np.fmax(around[2], around[3]))
    lowest = np.fmin(np.fmin(around[0], around[1]), np.fmin(around[2], around[3]))
    step_m = np.abs(np.diff(z[:: max(1, z.shape[0] // 100)], axis=1))
    step_m = step_m[~np.isnan(step_m)]
    if step_m.size == 0:
        return 0
    least_m = max(SPIKE_OVER_ROUGHNESS * float(np.median(step_m)), SPIKE_OVER_SQ * sq_m)
    return int(np.count_nonzero((centre - highest > least_m) | (lowest - centre > least_m)))
