"""How much white noise would change a map as it changes from pixel to pixel."""

import math

import numpy as np

MEDIAN = 0.4549  # of the squares of a normal distribution, over its variance


def white_m2(heights_m: np.ndarray, order: int, axis: int) -> np.ndarray:
    """Return the variance of the noise that differences of an even order would come from.

    White noise of variance v has differences of order k of variance v (2 k)! / (k!)^2; a shape
    that is smooth from pixel to pixel has next to none of a high order.

    Parameters
    ----------
    heights_m : float64, shape (ny, nx)
        Heights or depths, m.
    order : int
        Even.
    axis : int
        Along which the differences are taken.

    Returns
    -------
    float64, shape (ny, nx)
        m^2 at the middle of each difference; NaN where it leaves the map or meets a NaN.
    """
    if heights_m.shape[axis] <= order:
        return np.full(heights_m.shape, np.nan)
    half = order // 2
    differences_m = np.diff(heights_m, order, axis)
    variance_m2 = np.full(heights_m.shape, np.nan)
    inner = [slice(half, -half) if one == axis else slice(None) for one in (0, 1)]
    variance_m2[*inner] = np.square(differences_m) / math.comb(2 * order, order)
    return variance_m2
