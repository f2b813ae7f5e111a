"""The areal Gaussian filter."""

import math
from dataclasses import replace

import numpy as np

from capslip.errors import SettingsError
from capslip.surface.heightmap import HeightMap

# The weight exp(-pi (r / (alpha L))^2), alpha = sqrt(ln 2 / pi), halves a wave of length L.
SIGMA_PER_NESTING_INDEX = math.sqrt(math.log(2.0) / 2.0) / math.pi  # 0.18739
MIN_PIXELS = 4.0  # below, weights sampled pixel by pixel no longer halve that wave (at 3: 0.56)
REACH_SIGMA = 6.0  # weights beyond are below 2e-8
BLOCK_POINTS = 65536


def gaussian_s_filter(surface: HeightMap, nesting_index_m: float) -> HeightMap:
    """Take off the short waves with the areal Gaussian filter of ISO 16610-61.

    Parameters
    ----------
    surface : HeightMap
        Pixels need not be square.
    nesting_index_m : float
        The wavelength that is halved in amplitude.

    Returns
    -------
    HeightMap
        The weights are those of the measured points alone, made to sum to one (normalised
        convolution): a constant stays constant up to the edge and around holes. Non-measured
        points stay non-measured.

    Raises
    ------
    SettingsError
        If the nesting index is below four pixels, where the grid no longer carries the weights,
        or exceeds the shorter side of the face.
    """
    _check(surface, nesting_index_m, "s")
    height_m = smooth(surface, nesting_index_m, nesting_index_m)
    return replace(surface, height_m=height_m, noise_m=None)  # of which less is left


def gaussian_l_filter(surface: HeightMap, nesting_index_m: float) -> HeightMap:
    """Take off the long waves: what `gaussian_s_filter` of this nesting index would leave.

    Parameters and errors as there.
    """
    _check(surface, nesting_index_m, "l")
    long_m = smooth(surface, nesting_index_m, nesting_index_m)
    return replace(surface, height_m=np.subtract(surface.height_m, long_m, out=long_m))


def long_waves_at(
    surface: HeightMap, unfiltered: HeightMap, x_m: np.ndarray, y_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return heights and mean curvatures of what `gaussian_l_filter` took off, at places.

    Parameters
    ----------
    surface, unfiltered : HeightMap
        After the filter and before it, on the same points.
    x_m, y_m : float64, shape (n,)
        Places.

    Returns
    -------
    float64, shape (n,), twice
        Heights, m, and the mean of the curvatures along both axes, 1/m; NaN where not measured.
    """
    long_m, (dy_m, dx_m) = unfiltered.height_m - surface.height_m, surface.pixel_size_m
    rows, cols = surface.pixel_at(x_m, y_m)
    y, x = np.clip(rows, 1, long_m.shape[0] - 2), np.clip(cols, 1, long_m.shape[1] - 2)
    twice_m = 2.0 * long_m[y, x]
    along_y_per_m = (long_m[y - 1, x] - twice_m + long_m[y + 1, x]) / dy_m**2
    along_x_per_m = (long_m[y, x - 1] - twice_m + long_m[y, x + 1]) / dx_m**2
    return long_m[rows, cols], 0.5 * (along_y_per_m + along_x_per_m)


def blurred(
    height_m: np.ndarray,
    measured: np.ndarray,
    pixel_size_m: tuple[float, float],
    period_m: float,
) -> np.ndarray:
    """Return heights as an instrument shows them that halves waves of a period.

    Parameters
    ----------
    height_m : float64, shape (ny, nx)
        Heights.
    measured : bool, shape (ny, nx)
        Points that count.
    pixel_size_m : tuple of float
        (dy, dx).
    period_m : float
        Lateral period limit D_LIM (ISO 25178-600) of a Gaussian transfer; of few pixels, too.

    Returns
    -------
    float64, shape (ny, nx)
        Gaussian regression of the first order, as in ISO 16610-31: a plane stays what it is up to
        the edge and around holes, where a mean would lower or lift all slopes. Non-measured points
        keep what they had.

    Notes
    -----
    The weights are exp(-s^2) I_n(s^2), with the standard deviation s in pixels and the modified
    Bessel function: their variance is s^2 on any grid, where that of a Gaussian sampled every pixel
    is half of it at 0.4 pixels (Lindeberg, IEEE Trans. PAMI 12 (1990) 234).
    """
    from scipy.ndimage import correlate1d
    from scipy.special import ive

    weights = []
    for size_m in pixel_size_m:
        variance = (SIGMA_PER_NESTING_INDEX * period_m / size_m) ** 2
        reach = math.ceil(REACH_SIGMA * math.sqrt(variance)) + 2
        away = np.arange(-reach, reach + 1)
        weights.append([ive(np.abs(away), variance) * away**power for power in range(3)])

    def summed(array: np.ndarray, along_y: int, along_x: int) -> np.ndarray:
        lines = correlate1d(array, weights[0][along_y], 0, mode="constant")
        return np.asarray(correlate1d(lines, weights[1][along_x], 1, mode="constant"))

    known = measured.astype(float)
    level_m = float(np.mean(height_m, where=measured)) if measured.any() else 0.0
    rest_m = np.where(measured, height_m - level_m, 0.0)
    powers = ((0, 0), (1, 0), (0, 1))
    sides = np.stack([summed(rest_m, *one) for one in powers], axis=-1)
    weight = {(i, j): summed(known, i, j) for i in range(3) for j in range(3 - i)}
    found_m = np.where(measured, level_m + sides[..., 0] / np.where(measured, weight[0, 0], 1.0), 0)
    first = np.hypot(weight[1, 0], weight[0, 1])
    at_edge = measured & (first > 1e-12)
    matrix = [[weight[a + c, b + d][at_edge] for c, d in powers] for a, b in powers]
    fitted = np.linalg.pinv(np.moveaxis(np.array(matrix), -1, 0), hermitian=True)
    found_m[at_edge] = level_m + np.einsum("nj,nj->n", fitted[:, 0], sides[at_edge])
    return np.where(measured, found_m, height_m)


def _check(surface: HeightMap, nesting_index_m: float, which: str) -> None:
    shortest_m = MIN_PIXELS * max(surface.pixel_size_m)
    longest_m = min(surface.side_m)
    if not shortest_m <= nesting_index_m <= longest_m:
        raise SettingsError(
            f"conditioning.{which}_filter_nesting_index_m: got {nesting_index_m:g}; expected "
            f"{MIN_PIXELS:g} pixels ({shortest_m:g} m) to the shorter side ({longest_m:g} m)"
        )


def smooth(surface: HeightMap, nesting_index_y_m: float, nesting_index_x_m: float) -> np.ndarray:
    """Return the Gaussian-weighted means of the measured heights, NaN where none was measured.

    Parameters
    ----------
    surface : HeightMap
        Any.
    nesting_index_y_m, nesting_index_x_m : float
        Wavelengths that are halved along each axis; 0 leaves that axis as it is.

    Returns
    -------
    float64, shape (ny, nx)
        Heights.

    Notes
    -----
    Sums of weights and of weighted heights go through the Fourier transform together, as imaginary
    and real part: the transfer function is real and keeps them apart. It takes one axis after the
    other, a few lines at a time.
    """
    measured = surface.measured
    level_m = float(np.mean(surface.height_m, where=measured)) if measured.any() else 0.0
    both = np.zeros(surface.shape, dtype=np.complex128)
    np.subtract(surface.height_m, level_m, out=both.real, where=measured)
    # In units of the greatest height, so that rounding of the weights does not reach the heights.
    unit_m = float(max(both.real.max(), -both.real.min())) or 1.0
    both.real /= unit_m
    both.imag = measured
    for lines, size_m, index_m in (
        (both, surface.pixel_size_m[1], nesting_index_x_m),
        (both.T, surface.pixel_size_m[0], nesting_index_y_m),
    ):
        if index_m > 0.0:
            _convolve(lines, SIGMA_PER_NESTING_INDEX * index_m / size_m)
    smooth_m = np.full(surface.shape, np.nan)
    np.divide(both.real, both.imag, out=smooth_m, where=measured)
    smooth_m *= unit_m
    smooth_m += level_m
    return smooth_m


def _convolve(lines: np.ndarray, sigma: float) -> None:
    """Convolve every row with a Gaussian, in place; what lies beyond the ends counts as zero."""
    from scipy import fft

    n = lines.shape[1]
    n_padded = fft.next_fast_len(n + math.ceil(REACH_SIGMA * sigma))
    distance = np.minimum(np.arange(n_padded), n_padded - np.arange(n_padded))
    weight = np.exp(-0.5 * (distance / sigma) ** 2)
    transfer = fft.fft(weight / weight.sum()).real
    n_rows = max(1, BLOCK_POINTS // n_padded)
    for first in range(0, len(lines), n_rows):
        rows = slice(first, first + n_rows)
        wave = fft.fft(lines[rows], n_padded, axis=1)
        wave *= transfer
        lines[rows] = fft.ifft(wave, axis=1, overwrite_x=True)[:, :n]
