"""A smooth curve through points, for figures: cubic pieces that stay between their ends."""

import numpy as np


def monotone_cubic(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Interpolate by cubic pieces that rise or fall no further than the points do.

    The slope at a point is the weighted harmonic mean of those on both sides, or 0 where these
    differ in sign (Fritsch and Butland 1984, SIAM J. Sci. Stat. Comput. 5, 300); it is what
    `scipy.interpolate.PchipInterpolator` returns, which takes as long to load as two figures to
    draw.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Rising; of two points alone the curve is a straight line.
    y : ndarray, shape (n,)
    at : ndarray
        Where to interpolate; the outer pieces go on beyond the ends.

    Returns
    -------
    ndarray, shape of `at`

    Examples
    --------
    >>> monotone_cubic(np.arange(4.0), np.array([0.0, 0.0, 1.0, 1.0]), np.array([0.5, 1.5]))
    array([0. , 0.5])
    """
    h = np.diff(x)
    s = np.diff(y) / h
    if len(s) == 1:
        return np.asarray(y[0] + s[0] * (at - x[0]))
    slope = np.zeros(len(x))
    bent = np.flatnonzero(s[:-1] * s[1:] > 0.0)
    before, after = h[bent] + 2.0 * h[bent + 1], 2.0 * h[bent] + h[bent + 1]
    slope[bent + 1] = (before + after) / (before / s[bent] + after / s[bent + 1])
    slope[0] = _end(h[0], h[1], s[0], s[1])
    slope[-1] = _end(h[-1], h[-2], s[-1], s[-2])
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(h) - 1)
    t = (at - x[i]) / h[i]
    left, right = slope[i] * h[i], slope[i + 1] * h[i]
    rise = s[i] * h[i]
    cubic = left + right - 2.0 * rise
    return np.asarray(y[i] + t * (left + t * (rise - left - cubic + t * cubic)))


def _end(h: float, h_next: float, s: float, s_next: float) -> float:
    """Return the slope at an end: that of the parabola, kept from turning back."""
    slope = ((2.0 * h + h_next) * s - h * s_next) / (h + h_next)
    if slope * s <= 0.0:
        return 0.0
    return 3.0 * s if s * s_next <= 0.0 and abs(slope) > abs(3.0 * s) else slope
