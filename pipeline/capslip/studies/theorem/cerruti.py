"""The elastic half-space under shear tractions that are uniform in each pixel of a map."""

import numpy as np

from capslip.contact.solvers.half_space import even_spectrum, padded_shape
from capslip.contact.solvers.rough_inverse import wave_numbers_per_m


class ShearedHalfSpace:
    """Tangential displacement of a half-space under a traction map, and the rough inverse of it.

    Vectors in the surface are complex numbers, x + i y. The boundary is free: outside the map there
    is no traction, and the map is not repeated.

    Parameters
    ----------
    shape : (int, int)
        (ny, nx) of the maps.
    pixel_size_m : (float, float)
        (dy, dx).
    E_star_Pa, kappa : float
        Composite modulus, and tangential over normal compliance, see `material.composite`.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        pixel_size_m: tuple[float, float],
        E_star_Pa: float,
        kappa: float,
    ) -> None:
        self.shape = shape
        self._padded = padded_shape(shape)
        xx, xy, yy = cerruti_kernels(shape, pixel_size_m, E_star_Pa, kappa)
        self.pixel_compliance_m_per_Pa = float(xx[0, 0])
        self._xx = even_spectrum(xx, self._padded)
        self._xy = even_spectrum(xy, self._padded, mirrored=-1)
        self._yy = even_spectrum(yy, self._padded)
        self._inverse = wave_numbers_per_m(shape, pixel_size_m) * (E_star_Pa / (2 * kappa))
        # No map is displaced further: the greatest eigenvalue of the 2 x 2 spectrum
        half_trace, half_difference = (self._xx + self._yy) / 2, (self._xx - self._yy) / 2
        greatest = half_trace + np.hypot(half_difference, self._xy)
        self.greatest_compliance_m_per_Pa = float(greatest.max())

    def displacement_m(self, traction_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement u_x + i u_y under q_x + i q_y, both of shape (ny, nx)."""
        from scipy import fft

        ny, nx = self.shape
        x, y = fft.rfft2(np.stack((traction_Pa.real, traction_Pa.imag)), s=self._padded)
        waves = np.stack((self._xx * x + self._xy * y, self._xy * x + self._yy * y))
        u_x, u_y = fft.irfft2(waves, s=self._padded, overwrite_x=True)[:, :ny, :nx]
        return np.asarray(u_x + 1j * u_y)

    def traction_Pa(self, displacement_m: np.ndarray) -> np.ndarray:
        """Return roughly the traction that makes a displacement: E* |k| / (2 kappa) at wave k.

        Periodic, and with the mean of the compliances along and across a wave: only for use as a
        preconditioner.
        """
        from scipy import fft

        pair = np.stack((displacement_m.real, displacement_m.imag))
        x, y = fft.irfft2(self._inverse * fft.rfft2(pair), s=self.shape)
        return np.asarray(x + 1j * y)


def cerruti_kernels(
    shape: tuple[int, int], pixel_size_m: tuple[float, float], E_star_Pa: float, kappa: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the displacement at every pixel's centre under unit traction in the pixel (0, 0).

    Cerruti's solution for a force Q_x on the surface (Johnson 1987, Eq. 3.75 at z = 0), summed over
    two bodies without elastic coupling, is

        u_x = Q_x / (pi E*) [1/r + 2 (kappa - 1) x^2 / r^3]
        u_y = Q_x / (pi E*)        2 (kappa - 1) x y / r^3

    because sum of (1 - nu) / (2 G) = 1 / E* and sum of nu / (2 G) = 2 (kappa - 1) / E*. Its mean
    over all directions is kappa / (pi E* r), which is what the theorem of `slip` takes it for. The
    integrals over the pixel follow from the primitives in both directions

        x^2 / r^3:  y asinh(x / |y|)        y^2 / r^3:  x asinh(y / |x|)        x y / r^3:  -r

    of which the first two add up to that of 1/r, Love's.

    Parameters
    ----------
    shape : (int, int)
        (ny, nx).
    pixel_size_m : (float, float)
        (dy, dx).
    E_star_Pa, kappa : float
        Composite modulus, and tangential over normal compliance.

    Returns
    -------
    tuple of ndarray, shape (ny, nx)
        u_x under q_x, u_y under q_x (and u_x under q_y), u_y under q_y in metres a pascal, for
        distances of 0 ... n - 1 pixels. The one in the middle is odd in x and in y.

    Examples
    --------
    >>> xx, xy, yy = cerruti_kernels((3, 3), (1.0, 1.0), 1.0, 1.2143)
    >>> bool(xx[0, 1] > yy[0, 1] and xy[0, 1] == 0)
    True
    """
    y, x = ((np.arange(n + 1) - 0.5) * step for n, step in zip(shape, pixel_size_m, strict=True))
    x, y = x[None, :], y[:, None]
    along_x = _over_pixels(y * np.arcsinh(x / np.abs(y)))
    along_y = _over_pixels(x * np.arcsinh(y / np.abs(x)))
    across = _over_pixels(-np.hypot(x, y))
    # A pixel's own shear in y is zero by symmetry; rounding must not break it.
    across[0, :] = across[:, 0] = 0.0
    extra, unit = 2 * (kappa - 1), 1 / (np.pi * E_star_Pa)
    love = along_x + along_y
    return unit * (love + extra * along_x), unit * extra * across, unit * (love + extra * along_y)


def _over_pixels(primitive: np.ndarray) -> np.ndarray:
    return np.asarray(np.diff(np.diff(primitive, axis=0), axis=1))
