"""The elastic half-space under pressures that are uniform in each pixel of a rectangular map."""

import math

import numpy as np

_WORKERS = 2  # threads of a transform; more gain little
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
        from scipy import fft

        ny, nx = self.shape = shape
        dy_m, dx_m = pixel_size_m
        quadrant = love_kernel(shape, pixel_size_m, E_star_Pa)
        self.pixel_compliance_m_per_Pa = float(quadrant[0, 0])
        self._padded = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in shape)
        kernel = np.zeros(self._padded)
        kernel[:ny, :nx] = quadrant
        kernel[1 - ny :, :nx] = quadrant[:0:-1]
        kernel[:, 1 - nx :] = kernel[:, nx - 1 : 0 : -1]
        # The kernel is even, so its transform is real.
        self._spectrum = fft.rfft2(kernel, workers=_WORKERS).real.copy()
        self._inverse = np.hypot(
            2 * np.pi * fft.fftfreq(ny, dy_m)[:, None], 2 * np.pi * fft.rfftfreq(nx, dx_m)
        )
        self._inverse[0, 0] = min(self._inverse[0, 1], self._inverse[1, 0]) / 2
        self._inverse *= E_star_Pa / 2

    def sinking_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement into the half-space, shape (ny, nx)."""
        from scipy import fft

        py, px = self._padded
        rows = fft.rfft(pressure_Pa, n=px, axis=1, workers=_WORKERS)
        # Along y, the columns are padded, multiplied and cropped a few at a time: half of the
        # time and of the memory of one large transform.
        for first in range(0, rows.shape[1], _COLUMNS):
            block = np.s_[:, first : first + _COLUMNS]
            columns = fft.fft(rows[block], n=py, axis=0, workers=_WORKERS)
            columns *= self._spectrum[block]
            columns = fft.ifft(columns, axis=0, workers=_WORKERS, overwrite_x=True)
            rows[block] = columns[: self.shape[0]]
        sinking_m = fft.irfft(rows, n=px, axis=1, workers=_WORKERS, overwrite_x=True)
        return np.asarray(sinking_m[:, : self.shape[1]])

    def pressure_Pa(self, sinking_m: np.ndarray) -> np.ndarray:
        """Return roughly the pressure that makes a displacement: E* |q| / 2 at wave number q.

        The map is taken as periodic, which is wrong at its edges and quick: only for use as a
        preconditioner.
        """
        from scipy import fft

        waves = fft.rfft2(sinking_m, workers=_WORKERS)
        waves *= self._inverse
        return np.asarray(fft.irfft2(waves, s=self.shape, workers=_WORKERS, overwrite_x=True))


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
