"""What a face is between the points of its map, where random numbers at these points make it."""

import math

import numpy as np


def finer_places(n: int, times: int) -> np.ndarray:
    """Return the centres of pixels so many times as small, in pixels from the first centre.

    Examples
    --------
    >>> finer_places(2, 2).tolist()
    [-0.25, 0.25, 0.75, 1.25]
    """
    return (np.arange(n * times) + 0.5) / times - 0.5


def finer_waves(waves_m: np.ndarray, times: int) -> np.ndarray:
    """Return the waves of a map at the centres of pixels so many times as small.

    They are what their transform says, the sum of its sinusoids, whose period is the map: no wave
    is shorter than two pixels, and none is added.

    Parameters
    ----------
    waves_m : float64, shape (ny, nx)
    times : int
        Points along the side of a pixel.

    Returns
    -------
    float64, shape (times ny, times nx)

    Examples
    --------
    >>> wave = np.cos(2 * np.pi * np.arange(8) / 8)[None, :] * np.ones((6, 1))
    >>> fine = finer_waves(wave, 3)
    >>> bool(np.allclose(fine[0], np.cos(2 * np.pi * finer_places(8, 3) / 8)))
    True
    """
    if times == 1:
        return waves_m  # to the last digit
    for axis in (0, 1):
        waves_m = _along(np.moveaxis(waves_m, axis, 0), times)
        waves_m = np.moveaxis(waves_m, 0, axis)
    return np.ascontiguousarray(waves_m)


def _along(values: np.ndarray, times: int) -> np.ndarray:
    """Return the same along the first axis, more than one time: zeros behind the transform."""
    from scipy import fft

    n = len(values)
    waves = fft.rfft(values, axis=0)
    if n % 2 == 0:  # the last is both ends of the spectrum, of which one is kept
        waves[-1] *= 0.5
    shift = finer_places(n, times)[0] / n
    waves = waves * np.exp(2j * math.pi * shift * np.arange(len(waves)))[:, None]
    return times * np.asarray(fft.irfft(waves, n=n * times, axis=0))


def finer_profile(values: np.ndarray, times: int) -> np.ndarray:
    """Return a profile that does not close at the centres of pixels so many times as small.

    It is the sum of the cosines through its points, mirrored at the edges of the map.

    Parameters
    ----------
    values : float64, shape (n,)
    times : int
        Points along the side of a pixel.

    Returns
    -------
    float64, shape (times n,)
    """
    if times == 1:
        return values
    both = np.concatenate((values, values[::-1]))
    return _along(both[:, None], times)[: len(values) * times, 0]
