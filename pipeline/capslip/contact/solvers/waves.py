"""Small maps taken apart into waves and put together again, by products of matrices.

Of some dozens of points a side that takes half of the time of fast transforms, and a sixth of it
where they are a few: what a call costs is more than what it does.
"""

from functools import lru_cache

import numpy as np

MOST_BY_PRODUCTS = 48  # points along a side, up to which no transform is faster


@lru_cache(maxsize=256)
def real_waves(n: int, period: int, dtype: str) -> np.ndarray:
    """Return the real waves of a period at its first points, shape (period, n).

    The constant, then cosine and sine of each wave number; orthonormal over the whole period.

    Examples
    --------
    >>> waves = real_waves(5, 5, "float64")
    >>> bool(np.allclose(waves @ waves.T, np.eye(5)))
    True
    """
    row = np.arange(period)
    phase = 2 * np.pi / period * wave_of_row(period)[:, None] * np.arange(n)
    values = np.where(row[:, None] % 2 == 1, np.cos(phase), np.sin(phase)) * np.sqrt(2 / period)
    values[0] = np.sqrt(1 / period)
    if period % 2 == 0:
        values[-1] *= np.sqrt(0.5)
    waves = values.astype(dtype)
    waves.flags.writeable = False
    return waves


def wave_of_row(period: int) -> np.ndarray:
    """Return the wave number of each row of `real_waves`, shape (period,)."""
    return (np.arange(period) + 1) // 2


def of_real_waves(spectrum: np.ndarray, period: tuple[int, int]) -> np.ndarray:
    """Return the factors of real waves from those of a real transform that are even in both.

    Parameters
    ----------
    spectrum : ndarray, shape (py, px // 2 + 1)
        Real, as from `half_space.even_spectrum`.
    period : (int, int)
        (py, px).

    Returns
    -------
    ndarray, shape (py, px)
    """
    py, px = period
    return np.ascontiguousarray(spectrum[np.ix_(wave_of_row(py), wave_of_row(px))])


def apart(maps: np.ndarray, period: tuple[int, int]) -> np.ndarray:
    """Return the real waves in maps, shape (m, py, px), zero where they end before the period.

    Parameters
    ----------
    maps : ndarray, shape (m, ny, nx)
    period : (int, int)
        (py, px).
    """
    (ny, nx), (py, px), dtype = maps.shape[1:], period, maps.dtype.char
    return np.asarray(real_waves(ny, py, dtype) @ (maps @ real_waves(nx, px, dtype).T))


def together(waves: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return the first points of maps from their real waves, shape (m, ny, nx).

    Examples
    --------
    >>> one = np.arange(6.0).reshape(1, 2, 3)
    >>> bool(np.allclose(together(apart(one, (4, 5)), (2, 3)), one))
    True
    """
    (ny, nx), (py, px), dtype = shape, waves.shape[1:], waves.dtype.char
    return np.asarray((real_waves(ny, py, dtype).T @ waves) @ real_waves(nx, px, dtype))
