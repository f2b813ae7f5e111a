"""A smooth line through points, as figures draw it; without scipy, which loads as long as two."""

import numpy as np


def bent(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return a curve through points that rises and falls only where they do.

    Cubic between the points; the slope at each is a harmonic mean of those beside it, zero at a
    turn. Source: Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Points, x rising; a straight line joins only two.
    at : ndarray, shape (m,)
        Places between the first and the last.

    Returns
    -------
    ndarray, shape (m,)

    Examples
    --------
    >>> bent(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 2.0]), np.array([0.5, 1.5]))
    array([0.5, 1.5])
    """
    if len(x) < 3:
        return np.interp(at, x, y)
    step, rise = np.diff(x), np.diff(y) / np.diff(x)
    before, after = rise[:-1], rise[1:]
    near, far = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
    turns = before * after <= 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.where(turns, 0.0, (near + far) / (near / before + far / after))
    first = _end(step[0], step[1], rise[0], rise[1])
    slope = np.concatenate([[first], inner, [_end(step[-1], step[-2], rise[-1], rise[-2])]])
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(step) - 1)
    s = at - x[i]
    bend = (3.0 * rise[i] - 2.0 * slope[i] - slope[i + 1]) / step[i]
    twist = (slope[i] + slope[i + 1] - 2.0 * rise[i]) / step[i] ** 2
    return np.asarray(y[i] + s * (slope[i] + s * (bend + s * twist)))


def _end(step: float, beyond: float, rise: float, rise_beyond: float) -> float:
    """Return the slope at an end by three points, that of the last step at most threefold."""
    slope = ((2.0 * step + beyond) * rise - step * rise_beyond) / (step + beyond)
    if slope * rise <= 0.0:
        return 0.0
    if rise * rise_beyond <= 0.0 and abs(slope) > 3.0 * abs(rise):
        return 3.0 * rise
    return slope
