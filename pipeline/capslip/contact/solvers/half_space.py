"""The elastic half-space under pressures that are uniform in each pixel of a rectangular map."""

import math
from functools import cached_property
from typing import Literal

import numpy as np

from capslip.contact.solvers.rough_inverse import RoughInverse, quick_shape

POINT_COST = 400  # of a transform, in products of two numbers
_WORKERS = 1
_FAR = 60  # pixels
_AT_ONCE = 100_000  # points of columns that are transformed at once along y: what fits the cache
_COLUMNS = 64  # that are in any case
_REPEATS = 1.125  # sides of a map after which changes of its pressures repeat
_BLOCK = 8  # pixels along the side of those between which that is mended


class HalfSpace:
    """Sinking of a half-space under a pressure map, and the rough inverse of it.

    The boundary is free: outside the map there is no pressure, and the map is not repeated. The
    kernel is Love's, its convolution is done with transforms of twice the map's size.

    Parameters
    ----------
    shape : (int, int)
        (ny, nx) of the maps.
    pixel_size_m : (float, float)
        (dy, dx).
    E_star_Pa : float
        Composite modulus.
    """

    def __init__(
        self, shape: tuple[int, int], pixel_size_m: tuple[float, float], E_star_Pa: float
    ) -> None:
        self.shape = shape
        self.quadrant = quadrant = love_kernel(shape, pixel_size_m, E_star_Pa)
        self.pixel_compliance_m_per_Pa = float(quadrant[0, 0])
        self._padded = padded_shape(shape)
        self._spectrum = even_spectrum(quadrant, self._padded)
        self._rough_spectrum = self._spectrum.astype(np.float32)
        whole = [(slice(None), *shape)]
        self._rough_inverse = RoughInverse(whole, quadrant, pixel_size_m, E_star_Pa)

    @cached_property
    def of_changes(self) -> "ChangedHalfSpace":
        """What finds the sinking under changes of pressures in less time."""
        return ChangedHalfSpace(self)

    @property
    def cost(self) -> int:
        """Work of one sinking, in products of two numbers."""
        return POINT_COST * self.shape[0] * self.shape[1]

    def sinking_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement into the half-space, shape (ny, nx)."""
        return self._convolved(pressure_Pa, self._spectrum)

    def sinking_roughly_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the same in single precision and half of the time: for small changes."""
        return self._convolved(pressure_Pa.astype(np.float32), self._rough_spectrum)

    def _convolved(self, pressure_Pa: np.ndarray, spectrum: np.ndarray) -> np.ndarray:
        return _convolved(pressure_Pa, spectrum, self._padded)

    def work(self, pressure_Pa: np.ndarray) -> tuple[float, None]:
        """Return the sum of pressures times their own sinking, roughly; that is not found here."""
        return _work(pressure_Pa.astype(np.float32), self._rough_spectrum, self._padded), None

    def pressure_Pa(self, sinking_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return roughly the pressures at points alone that make a displacement, shape (n,)."""
        return self._rough_inverse.pressure_Pa(sinking_m, points)


class ChangedHalfSpace:
    """Sinking of a map under changes of its pressures, from a third of the transforms' points.

    The map repeats soon after its end: pixels further apart than half of this are taken for nearer
    ones beyond the end. What that is off is smooth, and mended between blocks, from their centres.

    Parameters
    ----------
    half_space : HalfSpace
        Of the map.
    """

    change_error = 0.03  # of the sinking: on the least map from end to end, elsewhere a third

    def __init__(self, half_space: HalfSpace) -> None:
        self.shape, self.pressure_Pa = half_space.shape, half_space.pressure_Pa
        (ny, nx), quadrant = self.shape, half_space.quadrant
        least = 2 * _BLOCK  # beyond an end, so that what is off is smooth there, too
        py, px = (max(int(_REPEATS * n), n + least) for n in self.shape)
        self._padded = quick_shape((py, px))
        half = quadrant[: self._padded[0] // 2 + 1, : self._padded[1] // 2 + 1]
        self._spectrum = even_spectrum(half, self._padded).astype(np.float32)
        apart = np.arange(0, ny, _BLOCK), np.arange(0, nx, _BLOCK)
        taken = (np.minimum(each, q - each) for each, q in zip(apart, self._padded, strict=True))
        self._blocks = len(apart[0]), len(apart[1])
        off = quadrant[np.ix_(*apart)] - quadrant[np.ix_(*taken)]
        self._padded_blocks = padded_shape(self._blocks)
        self._off = even_spectrum(off, self._padded_blocks).astype(np.float32)

    def sinking_roughly_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement into the half-space in single precision, shape (ny, nx)."""
        p = pressure_Pa.astype(np.float32)
        sinking_m = _convolved(p, self._spectrum, self._padded)
        off_m = _convolved(self._sums(p), self._off, self._padded_blocks)
        sinking_m += off_m.repeat(_BLOCK, 0)[: self.shape[0]].repeat(_BLOCK, 1)[:, : self.shape[1]]
        return sinking_m

    def work(self, pressure_Pa: np.ndarray) -> tuple[float, None]:
        """Return the sum of pressures times their own sinking; that is not found here."""
        p = pressure_Pa.astype(np.float32)
        work = _work(p, self._spectrum, self._padded)
        return work + _work(self._sums(p), self._off, self._padded_blocks), None

    def _sums(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the sums over blocks."""
        (ny, nx), (n, m) = self.shape, self._blocks
        whole = np.zeros((n * _BLOCK, m * _BLOCK), dtype=np.float32)
        whole[:ny, :nx] = pressure_Pa
        rows = whole.reshape(n, _BLOCK, m * _BLOCK).sum(axis=1)
        return np.asarray(rows.reshape(n, m, _BLOCK).sum(axis=2))


def _convolved(
    pressure_Pa: np.ndarray, spectrum: np.ndarray, padded: tuple[int, int]
) -> np.ndarray:
    from scipy import fft

    (ny, nx), (py, px) = pressure_Pa.shape, padded
    rows = fft.rfft(pressure_Pa, n=px, axis=1, workers=_WORKERS)
    # Along y, the columns are padded, multiplied and cropped a few at a time: half of the
    # time and of the memory of one large transform.
    at_once = max(_COLUMNS, _AT_ONCE // py)
    for first in range(0, rows.shape[1], at_once):
        block = np.s_[:, first : first + at_once]
        columns = fft.fft(rows[block], n=py, axis=0, workers=_WORKERS)
        columns *= spectrum[block]
        columns = fft.ifft(columns, axis=0, workers=_WORKERS, overwrite_x=True)
        rows[block] = columns[:ny]
    sinking_m = fft.irfft(rows, n=px, axis=1, workers=_WORKERS, overwrite_x=True)
    return np.asarray(sinking_m[:, :nx])


def _work(pressure_Pa: np.ndarray, spectrum: np.ndarray, padded: tuple[int, int]) -> float:
    """Return the sum of pressures times their own sinking.

    By Parseval's theorem, in half of the time of a sinking.
    """
    from scipy import fft

    rows = fft.rfft(pressure_Pa, n=padded[1], axis=1, workers=_WORKERS)
    work, at_once = 0.0, max(_COLUMNS, _AT_ONCE // padded[0])
    for first in range(0, rows.shape[1], at_once):
        block = np.s_[:, first : first + at_once]
        columns = fft.fft(rows[block], n=padded[0], axis=0, workers=_WORKERS)
        work += work_of(columns, spectrum[block], padded, first)
    return work


def love_kernel(
    shape: tuple[int, int], pixel_size_m: tuple[float, float], E_star_Pa: float
) -> np.ndarray:
    """Return the sinking at every pixel's centre under unit pressure in the pixel (0, 0).

    The integral of 1 / (pi E* r) over the pixel (Love 1929; Johnson 1987, Eq. 3.25), in which
    F(x, y) = x asinh(y / |x|) + y asinh(x / |y|) is the primitive of 1/r in both directions.

    Parameters
    ----------
    shape : (int, int)
        (ny, nx).
    pixel_size_m : (float, float)
        (dy, dx).
    E_star_Pa : float
        Composite modulus.

    Returns
    -------
    ndarray, shape (ny, nx)
        Metres a pascal, for distances of 0 ... n - 1 pixels.

    Examples
    --------
    >>> kernel = love_kernel((3, 3), (1.0, 1.0), 1.0)
    >>> round(float(kernel[0, 0]), 6) == round(4 * math.log(1 + math.sqrt(2)) / math.pi, 6)
    True
    """
    y, x = ((np.arange(n + 1) - 0.5) * step for n, step in zip(shape, pixel_size_m, strict=True))
    x, y = x[None, :], y[:, None]
    corners = x * np.arcsinh(y / np.abs(x)) + y * np.arcsinh(x / np.abs(y))
    return np.asarray(np.diff(np.diff(corners, axis=0), axis=1) / (math.pi * E_star_Pa))


def love_kernel_at(
    offsets: tuple[np.ndarray, np.ndarray], pixel_size_m: tuple[float, float], E_star_Pa: float
) -> np.ndarray:
    """Return the same kernel at any distances, not only at whole pixels.

    From `_FAR` pixels on by the first terms of its series in pixel over distance, which leave
    1e-9 of it.

    Parameters
    ----------
    offsets : (ndarray, ndarray)
        Distances in y and x, in pixels.
    pixel_size_m, E_star_Pa
        As for `love_kernel`.
    """
    dy, dx = pixel_size_m
    y, x = offsets[0] * dy, offsets[1] * dx
    r2 = np.square(x) + np.square(y)
    near = r2 < (_FAR * max(dy, dx)) ** 2
    r2[near] = 1.0
    # 1/r and its second derivatives, averaged over the pixel
    second = dx**2 * (2 * x**2 - y**2) + dy**2 * (2 * y**2 - x**2)
    kernel = dx * dy * (1 + second / (24 * r2**2)) / np.sqrt(r2)
    y, x = y[near], x[near]
    corner = np.zeros(y.shape)
    for sign_y in (-1, 1):
        for sign_x in (-1, 1):
            b, a = y + sign_y * dy / 2, x + sign_x * dx / 2
            b, a = np.where(b == 0, 1e-300, b), np.where(a == 0, 1e-300, a)
            part = a * np.arcsinh(b / np.abs(a)) + b * np.arcsinh(a / np.abs(b))
            corner += sign_y * sign_x * part
    kernel[near] = corner
    return np.asarray(kernel / (math.pi * E_star_Pa))


def padded_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Return the shape to which maps are padded for a convolution that does not wrap around."""
    from scipy import fft

    py, px = (int(fft.next_fast_len(2 * n - 1, real=True)) for n in shape)
    return py, px


def work_of(
    waves: np.ndarray, spectrum: np.ndarray, padded: tuple[int, int], first: int = 0
) -> float:
    """Return the sum of pressures times their own sinking, from their transform.

    Parameters
    ----------
    waves : complex, shape (..., py, k)
        Some columns of the transform of real pressures.
    spectrum : ndarray, shape (py, k)
        From `even_spectrum`.
    padded : (int, int)
        From `padded_shape`.
    first : int
        Number of the first column.
    """
    twice = np.full(waves.shape[-1], 2 / math.prod(padded), dtype=np.float32)
    place = first + np.arange(len(twice))
    twice[2 * place % padded[1] == 0] /= 2  # the others stand for their conjugates, too
    return float(np.vdot(waves, waves * (spectrum * twice)).real)


def even_spectrum(
    quadrant: np.ndarray, padded: tuple[int, int], mirrored: Literal[1, -1] = 1
) -> np.ndarray:
    """Return the transform of a kernel from its values at distances of 0 ... n - 1 pixels.

    Parameters
    ----------
    quadrant : ndarray, shape (ny, nx)
        The kernel for x, y >= 0.
    padded : (int, int)
        From `padded_shape`.
    mirrored : {1, -1}
        What the kernel is multiplied with when x or y changes its sign. Both together leave it as
        it is, so its transform is real.
    """
    from scipy import fft

    ny, nx = quadrant.shape
    kernel = np.zeros(padded)
    kernel[:ny, :nx] = quadrant
    kernel[padded[0] - ny + 1 :, :nx] = mirrored * quadrant[:0:-1]
    kernel[:, padded[1] - nx + 1 :] = mirrored * kernel[:, nx - 1 : 0 : -1]
    return np.asarray(fft.rfft2(kernel, workers=_WORKERS).real.copy())
