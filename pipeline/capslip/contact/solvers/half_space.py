"""The elastic half-space under pressures that are uniform in each pixel of a rectangular map."""

import math
from typing import Literal

import numpy as np

POINT_COST = 400  # of a transform, in products of two numbers
_WORKERS = 1
_FAR = 60  # pixels
_COLUMNS = 64  # transformed at once along y: what fits into the cache


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
        quadrant = love_kernel(shape, pixel_size_m, E_star_Pa)
        self.pixel_compliance_m_per_Pa = float(quadrant[0, 0])
        self._padded = padded_shape(shape)
        self._spectrum = even_spectrum(quadrant, self._padded)
        self._quick = quick_shape(shape)
        inverse = wave_numbers_per_m(self._quick, pixel_size_m) * (E_star_Pa / 2)
        self._rough_spectrum = self._spectrum.astype(np.float32)
        self._inverse = inverse.astype(np.float32)

    @property
    def cost(self) -> int:
        """Work of one sinking, in products of two numbers."""
        return POINT_COST * self.shape[0] * self.shape[1]

    def sinking_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement into the half-space, shape (ny, nx)."""
        return self._convolved(pressure_Pa, self._spectrum)

    def sinking_roughly_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the same in single precision and half of the time: for small changes."""
        rough = self._convolved(pressure_Pa.astype(np.float32), self._rough_spectrum)
        return rough.astype(float)

    def _convolved(self, pressure_Pa: np.ndarray, spectrum: np.ndarray) -> np.ndarray:
        from scipy import fft

        py, px = self._padded
        rows = fft.rfft(pressure_Pa, n=px, axis=1, workers=_WORKERS)
        # Along y, the columns are padded, multiplied and cropped a few at a time: half of the
        # time and of the memory of one large transform.
        for first in range(0, rows.shape[1], _COLUMNS):
            block = np.s_[:, first : first + _COLUMNS]
            columns = fft.fft(rows[block], n=py, axis=0, workers=_WORKERS)
            columns *= spectrum[block]
            columns = fft.ifft(columns, axis=0, workers=_WORKERS, overwrite_x=True)
            rows[block] = columns[: self.shape[0]]
        sinking_m = fft.irfft(rows, n=px, axis=1, workers=_WORKERS, overwrite_x=True)
        return np.asarray(sinking_m[:, : self.shape[1]])

    def pressure_Pa(self, sinking_m: np.ndarray) -> np.ndarray:
        """Return roughly the pressure that makes a displacement: E* |q| / 2 at wave number q.

        The map, with at most a few lines more, is taken as periodic, which is wrong at its edges
        and quick: only for use as a preconditioner.
        """
        from scipy import fft

        ny, nx = self.shape
        waves = fft.rfft2(sinking_m.astype(np.float32), s=self._quick, workers=_WORKERS)
        waves *= self._inverse
        pressure_Pa = fft.irfft2(waves, s=self._quick, workers=_WORKERS, overwrite_x=True)
        return np.asarray(pressure_Pa[:ny, :nx], dtype=float)


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


def quick_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Return the next shape whose transform is quick: sides of large prime factors are not."""
    from scipy import fft

    qy, qx = (int(fft.next_fast_len(n, real=True)) for n in shape)
    return qy, qx


def padded_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Return the shape to which maps are padded for a convolution that does not wrap around."""
    from scipy import fft

    py, px = (int(fft.next_fast_len(2 * n - 1, real=True)) for n in shape)
    return py, px


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


def wave_numbers_per_m(shape: tuple[int, int], pixel_size_m: tuple[float, float]) -> np.ndarray:
    """Return the wave numbers of a real transform, with half of the least in place of zero."""
    from scipy import fft

    (ny, nx), (dy_m, dx_m) = shape, pixel_size_m
    k_y, k_x = fft.fftfreq(ny, dy_m)[:, None], fft.rfftfreq(nx, dx_m)
    waves = 2 * np.pi * np.hypot(k_y, k_x)
    waves[0, 0] = np.pi / max(ny * dy_m, nx * dx_m)
    return np.asarray(waves)
