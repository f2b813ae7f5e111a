"""A function that costs a solution at each point, interpolated from as few as that takes."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline, PchipInterpolator

_HALVINGS = 8  # of an interval at most: where the slope jumps, nothing is smooth enough


def refined_spline(
    solved: Callable[[np.ndarray], np.ndarray],
    points: np.ndarray,
    tolerance: ArrayLike,
    monotone: bool = False,
) -> "CubicSpline | PchipInterpolator":
    """Return a cubic spline through solutions that lie close where the function bends.

    Halfway between all points the function is solved as well; where the spline before was off
    there, or next to it, both halves are halved again. So what is left is some powers of a half of
    the tolerance, but where single contacts touch or let go.

    Parameters
    ----------
    solved : callable
        The function, of shape (n,) or (n, k) at n points that grow.
    points : float64, shape (n,)
        From which to begin, growing, at least 4.
    tolerance : float or float64, shape (k,)
        Of the greatest absolute value of each of the k.
    monotone : bool
        Whether it rises and falls with the solutions alone, where slopes jump, too.

    Examples
    --------
    >>> kinked = refined_spline(lambda x: x + np.abs(x - 0.3) ** 1.5, np.linspace(0, 1, 9), 1e-4)
    >>> [round(float(kinked(x)), 4) for x in (0.05, 0.31, 0.9)]
    [0.175, 0.311, 1.3648]
    >>> kinked.x.size
    47
    """
    from scipy.interpolate import CubicSpline, PchipInterpolator

    spline = PchipInterpolator if monotone else CubicSpline
    values, low, high = solved(points), points[:-1], points[1:]
    for _ in range(_HALVINGS):
        if low.size == 0:
            break
        middle = (low + high) / 2.0
        found = solved(middle)
        off = np.abs(spline(points, values)(middle) - found)
        order = np.argsort(np.append(points, middle))
        points = np.append(points, middle)[order]
        values = np.concatenate((values, found))[order]
        poor = (
            (off > np.multiply(tolerance, np.abs(values).max(axis=0)))
            .reshape(middle.size, -1)
            .any(axis=1)
        )
        beside = high[:-1] == low[1:]  # a middle may lie where two errors cancel
        poor = poor | np.append(poor[1:] & beside, False) | np.append(False, poor[:-1] & beside)
        edges = np.stack((low[poor], middle[poor], high[poor]))
        low, high = edges[:2].T.ravel(), edges[1:].T.ravel()
    return spline(points, values)
