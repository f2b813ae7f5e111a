"""Heights that were stored in steps, smoothed within what the rounding leaves open."""

import math
from dataclasses import replace

import numpy as np

from capslip.problems import Problem
from capslip.surface.filling import from_nearest
from capslip.surface.form import remove_form
from capslip.surface.frame import in_frame, without_frame
from capslip.surface.heightmap import HeightMap, Heights, Rounding
from capslip.surface.noise import mixed_difference, rms_of_noise_m
from capslip.surface.rows import even_lines

SAMPLED_LINES = 50  # along each axis
LEAST_EQUAL = 0.1  # of the neighbours: of fewer, steps are finer than what neighbours differ by
LEAST_LEVELS = 8  # of a relief: on fewer nobody sees what lies between
UNIFORM = 12.0**-0.5  # of a step: rms of what rounding does to a height
OFF_STEP = 0.01  # of a step, by which rounding of the numbers themselves moves heights
SPACINGS, TURNS = (2.0, 1.0), 20  # pixels of the filter, and how often each goes over the map
SMOOTH = 0.1  # of a step: what is left where a smooth face was rounded
ROUNDED = 0.5  # of a step: rounding alone shows no more noise where heights change
KEPT, FEWEST_STEPS = 0.10, 4  # share of the points above the cut, and steps that it has to span
MIN_POINTS = 9  # of a hill


def smooth_steps(surface: HeightMap) -> HeightMap:
    """Return a smooth face that would be stored as this one was, if there is one.

    Rounding is no roughness: each height is known to half a step, and where the lines between
    steps run smoothly, so did the face.

    Parameters
    ----------
    surface : HeightMap
        As measured: levelling hides that heights are multiples of a step.

    Returns
    -------
    HeightMap
        The same where heights are in no steps, in finer ones than neighbours differ by, or where
        noise or roughness is seen beside the rounding. Else with `rounding`, and no height moved by
        more than half a step; none at all on fewer than eight levels.

    Notes
    -----
    The filter B + B (1 - B), where B is a Gaussian, leaves every shape of the third degree as it
    is. It goes over the map again and again, wide and then narrow, and after each time heights
    return to within half a step of what is stored: projections in turn on two convex sets. The
    error is what the same does to the map that was found, rounded half a step aside: the mean over
    the upper half of each hill of the highest tenth, rms over these. On spheres it is 0.03 of a
    step or, where a hill shows few steps, 0.1: in the median 1.4 times what fitted apexes are off
    by, and 0.8 to 2.7 times on eight faces of ten. A point of the stored map is off by 0.29.

    Examples
    --------
    >>> y, x = np.mgrid[0:80, 0:90]
    >>> z = -1e-9 * ((x - 40.3) ** 2 + (y - 41.6) ** 2)
    >>> found = smooth_steps(HeightMap(np.round(z / 1e-7) * 1e-7, (1e-4, 1e-4)))
    >>> round(found.rounding.step_m * 1e9), bool(np.std(found.height_m - z) < 1e-8)
    (100, True)
    """
    inner = without_frame(surface)  # beyond what was measured the filter goes on as it does there
    found = _smoothed(inner)
    if found is inner:
        return surface
    height_m = in_frame(found.height_m, surface)
    return replace(surface, height_m=height_m, rounding=found.rounding)


def _smoothed(surface: HeightMap) -> HeightMap:
    step_m, levels = _step_m(surface)
    if step_m is not None and levels < LEAST_LEVELS:
        return replace(surface, rounding=Rounding(step_m, UNIFORM * step_m, smoothed=False))
    if step_m is None or _left_m(surface.height_m, surface.height_m) > ROUNDED * step_m:
        return surface
    height_m = _within(surface.height_m, step_m)
    if _left_m(height_m, surface.height_m) > SMOOTH * step_m:
        return surface
    aside_m = (np.floor(height_m / step_m) + 0.5) * step_m
    off_m = _within(aside_m, step_m) - height_m
    found = replace(surface, height_m=height_m)
    rounding = Rounding(step_m, _error_of_hills_m(found, off_m))
    return replace(found, rounding=rounding)


def _error_of_hills_m(surface: HeightMap, off_m: np.ndarray) -> float:
    """Return the rms over hills of what the upper half of their points is off on the mean."""
    from scipy.ndimage import label, mean, median

    level_m = remove_form(surface, "plane")[0].height_m
    high = level_m >= np.nanquantile(level_m, 1.0 - KEPT)
    hill, n = label(high)
    wide = np.flatnonzero(np.bincount(hill.reshape(-1), minlength=n + 1)[1:] >= MIN_POINTS) + 1
    middle_m = np.append(np.inf, median(level_m, hill, np.arange(1, n + 1)))
    upper = np.where(level_m >= middle_m[hill], hill, 0)
    each_m = mean(off_m, upper, wide) if wide.size else off_m[high]
    return float(np.sqrt(np.mean(np.square(each_m))))


def problems_of_rounding(surface: HeightMap) -> tuple[Problem, ...]:
    """Return `heights_in_steps` (warning) of a map in steps, smoothed within them where it can be.

    What the error moves decides later whether it stays a warning.
    """
    rounding = surface.rounding
    if rounding is None:
        return ()
    if rounding.smoothed:
        then = (
            "and show no noise beside; they were smoothed within half a step, after which tops of "
            f"hills are off by {rounding.error_m:.2g} m (rms)"
        )
    else:
        then = (
            "on so few levels that nobody sees what lies between: tops of hills are off by half a "
            "step"
        )
    message = f"heights are stored in steps of {rounding.step_m:.3g} m, {then}"
    return (Problem("heights_in_steps", "warning", message),)


def few_steps(surface: HeightMap) -> bool:
    """Tell whether the highest tenth, as the cut keeps it, spans fewer than four steps."""
    if surface.rounding is None:
        return False
    high_m, cut_m = np.nanquantile(surface.height_m, (1.0, 1.0 - KEPT))
    return bool(high_m - cut_m < FEWEST_STEPS * surface.rounding.step_m)


def _step_m(height_m: Heights) -> tuple[float | None, int]:
    """Return the step of which the heights are multiples, and on how many levels they lie.

    None where it is none that shows.
    """
    rows, columns = (even_lines(n, n // SAMPLED_LINES) for n in height_m.shape)
    lines_m = height_m[rows], height_m[:, columns].T  # grooves have equal heights along them
    beside_m = np.abs(np.concatenate([np.diff(one_m).reshape(-1) for one_m in lines_m]))
    beside_m = beside_m[~np.isnan(beside_m)]
    if np.count_nonzero(beside_m == 0.0) < LEAST_EQUAL * max(1, beside_m.size):
        return None, 0
    beside_m = beside_m[beside_m > 0.0]
    if not beside_m.size:
        return None, 0
    step_m = float(beside_m.min())
    some_m = np.concatenate([one_m.reshape(-1) for one_m in lines_m])
    level = (some_m - np.fmin.reduce(some_m)) / step_m
    level = level[~np.isnan(level)]
    whole = np.round(level)
    if np.abs(level - whole).max() > OFF_STEP:
        return None, 0
    return step_m, np.unique(whole).size


def _within(stored_m: np.ndarray, step_m: float) -> np.ndarray:
    """Return heights that the filter leaves nearly alone, half a step around the stored ones."""
    lost = np.isnan(stored_m)
    height_m, least_m, most_m = stored_m, stored_m - 0.5 * step_m, stored_m + 0.5 * step_m
    if lost.any():
        height_m = from_nearest(stored_m)
        least_m, most_m = np.where(lost, -np.inf, least_m), np.where(lost, np.inf, most_m)
    for spacing in SPACINGS:
        for _ in range(TURNS):
            height_m = np.clip(_filtered(height_m, spacing), least_m, most_m)
    return np.where(lost, np.nan, height_m)


def joined_rounding(first: Rounding | None, second: Rounding | None) -> Rounding | None:
    """Return the coarser steps of two maps, with the errors of both."""
    both = [one for one in (first, second) if one is not None]
    if not both:
        return None
    error_m = math.hypot(*(one.error_m for one in both))
    smoothed = all(one.smoothed for one in both)
    return Rounding(max(one.step_m for one in both), error_m, smoothed)


def _filtered(height_m: np.ndarray, spacing: float) -> np.ndarray:
    """Return B + B (1 - B) of heights; beyond its edges the map goes on, turned half around."""
    from scipy.ndimage import gaussian_filter

    reach = min(int(3.0 * spacing) + 1, *(n - 1 for n in height_m.shape))
    wide_m = np.pad(height_m, reach, mode="reflect", reflect_type="odd")
    mean_m = gaussian_filter(wide_m, spacing, truncate=3.0)
    mean_m += gaussian_filter(wide_m - mean_m, spacing, truncate=3.0)
    return np.asarray(mean_m[reach:-reach, reach:-reach])


def _left_m(height_m: np.ndarray, stored_m: np.ndarray) -> float:
    """Return the noise that is left around the lines between steps."""
    ny, nx = height_m.shape
    low, middle, high = slice(0, -2), slice(1, -1), slice(2, None)
    parts = {-1: low, 0: middle, 1: high}
    at_line = np.zeros((ny - 2, nx - 2), dtype=bool)
    for i, j in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        at_line |= stored_m[parts[i], parts[j]] != stored_m[middle, middle]
    return rms_of_noise_m(mixed_difference(lambda i, j: height_m[parts[i], parts[j]][at_line]))
