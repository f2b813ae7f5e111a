"""A curve through points that bends between them and nowhere overshoots."""

import numpy as np


def smooth(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return a monotone curve through points, as `scipy.interpolate.PchipInterpolator`.

    Cubics with the slopes of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5, 1984), which need
    no solution of a system; to load that module takes longer than to draw the figures.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        At least three points, x increasing.
    at : ndarray, shape (m,)
        Where the curve is wanted.

    Returns
    -------
    ndarray, shape (m,)

    Examples
    --------
    >>> smooth(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 1.0]), np.array([0.5, 1.5]))
    array([0.6875, 1.    ])
    """
    step, rise = np.diff(x), np.diff(y) / np.diff(x)
    before, after = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
    turns = rise[1:] * rise[:-1] <= 0.0
    first, second = (np.where(turns, 1.0, one) for one in (rise[:-1], rise[1:]))
    slope = np.zeros_like(y)
    slope[1:-1] = np.where(turns, 0.0, (before + after) / (before / first + after / second))
    slope[0] = _end_slope(step[:2], rise[:2])
    slope[-1] = _end_slope(step[:-3:-1], rise[:-3:-1])
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(step) - 1)
    t = (at - x[i]) / step[i]
    bend = 3.0 * rise[i] - 2.0 * slope[i] - slope[i + 1]
    twist = slope[i] + slope[i + 1] - 2.0 * rise[i]
    curve: np.ndarray = y[i] + step[i] * t * (slope[i] + t * (bend + t * twist))
    return curve


def _end_slope(step: np.ndarray, rise: np.ndarray) -> float:
    """Return the slope at an end by three points, no steeper than a monotone curve may be."""
    slope = ((2.0 * step[0] + step[1]) * rise[0] - step[0] * rise[1]) / (step[0] + step[1])
    if slope * rise[0] <= 0.0:
        return 0.0
    if rise[0] * rise[1] <= 0.0 and abs(slope) > 3.0 * abs(rise[0]):
        return float(3.0 * rise[0])
    return float(slope)
