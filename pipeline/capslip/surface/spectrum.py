"""Power spectrum of the lines of a map, and the waves that it can carry."""

from dataclasses import dataclass

import numpy as np

from capslip.surface.heightmap import HeightMap
from capslip.surface.noise import some_lines

LEAST_OF_A_LINE = 0.5  # measured share; a line with less has no spectrum
BLOCK_LINES = 64
SAMPLED_LINES = 64  # by which the noise is held against the heights
CLASSES_A_DECADE = 10
ABOVE_NOISE = 2.0  # measured density over that of the noise where heights are as strong as noise


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power spectral density of the profiles along one axis, averaged over all lines.

    Attributes
    ----------
    frequency_per_m : float64, shape (k,)
        Waves a metre, rising, above 0.
    density_m3 : float64, shape (k,)
        Its integral over the frequency is the mean square height of the lines about their means.
        NaN where no line was measured.
    """

    frequency_per_m: np.ndarray
    density_m3: np.ndarray

    def smoothed(self) -> "Spectrum":
        """Return means over classes of ten to the decade, which hold one frequency at least."""
        number = np.floor(
            CLASSES_A_DECADE * np.log10(self.frequency_per_m / self.frequency_per_m[0])
        )
        _, number = np.unique(number, return_inverse=True)
        count = np.bincount(number)
        means = [
            np.bincount(number, one) / count for one in (self.frequency_per_m, self.density_m3)
        ]
        return Spectrum(*means)


def line_spectrum(height_m: np.ndarray, pixel_m: float) -> Spectrum:
    """Compute the spectrum along the rows of an array.

    Parameters
    ----------
    height_m : ndarray, shape (lines, n)
        NaN marks a non-measured point.
    pixel_m : float
        Distance between the points of a line.

    Notes
    -----
    W(f) = 2 dx |sum w z exp(-2 pi i f x)|^2 / sum w^2, with a Hann window w and the mean of each
    line taken off. A gap in a line is bridged straight; a line of which less than half was
    measured is left out.

    Examples
    --------
    >>> noise_m = np.random.default_rng(0).normal(0.0, 1e-9, (200, 400))
    >>> white = line_spectrum(noise_m, 1e-6)
    >>> bool(abs(white.density_m3.mean() / (2 * 1e-18 * 1e-6) - 1.0) < 0.02)
    True
    """
    n = height_m.shape[1]
    frequency_per_m = np.fft.rfftfreq(n, pixel_m)[1:]
    known = ~np.isnan(height_m)
    enough = known.mean(axis=1) >= LEAST_OF_A_LINE
    if not enough.any():
        return Spectrum(frequency_per_m, np.full(n // 2, np.nan))
    line_m, known = np.ascontiguousarray(height_m[enough]), known[enough]
    if not known.all():
        at, gap = np.flatnonzero(known), np.flatnonzero(~known)
        line_m.reshape(-1)[gap] = np.interp(gap, at, line_m.reshape(-1)[at])
    line_m -= line_m.mean(axis=1, keepdims=True)
    window = np.hanning(n + 1)[:-1]
    power = np.zeros(n // 2 + 1)
    for first in range(0, len(line_m), BLOCK_LINES):  # what is computed stays in the cache
        wave = np.fft.rfft(window * line_m[first : first + BLOCK_LINES])
        power += (wave.real**2 + wave.imag**2).sum(axis=0)
    power *= 2.0 * pixel_m / (window @ window) / len(line_m)
    if n % 2 == 0:
        power[-1] *= 0.5  # the one frequency that is its own mirror
    return Spectrum(frequency_per_m, power[1:])


def carried_waves_m(
    surface: HeightMap,
    noise_m: float,
    s_filter_nesting_index_m: float | None = None,
    l_filter_nesting_index_m: float | None = None,
    enough_m: float = 0.0,
) -> tuple[float, float]:
    """Return the shortest and the longest wave that a map carries.

    Parameters
    ----------
    surface : HeightMap
        Heights after conditioning.
    noise_m : float
        Standard deviation of the point-to-point noise, white: a density of 2 noise^2 dx.
    s_filter_nesting_index_m, l_filter_nesting_index_m : float, optional
        Of the filters that took waves off.
    enough_m : float
        A wave as short is short enough: one axis that carries it answers for both.

    Returns
    -------
    shortest_m : float
        The greatest of two pixels, the S-filter's nesting index and the wave from which on down the
        heights are weaker than the noise, on both axes.
    longest_m : float
        The lesser of the shorter side of what was measured and the L-filter's nesting index.
    """
    y, x = surface.measured_window
    shortest_m = max(2.0 * max(surface.pixel_size_m), s_filter_nesting_index_m or 0.0)
    if noise_m > 0.0:
        drowned_m = []
        rows, columns = (some_lines(one, SAMPLED_LINES) for one in (y, x))
        for lines_m, pixel_m in zip(
            (surface[rows, x], surface[y, columns].T), surface.pixel_size_m[::-1], strict=True
        ):
            seen = line_spectrum(lines_m, pixel_m).smoothed()
            above = seen.density_m3 >= ABOVE_NOISE * 2.0 * noise_m**2 * pixel_m
            if above.any():
                last = int(np.flatnonzero(above)[-1])
                if last < len(above) - 1:
                    drowned_m.append(1.0 / float(seen.frequency_per_m[last]))
            if not drowned_m or drowned_m[0] <= enough_m:
                break
        if len(drowned_m) == 2:
            shortest_m = max(shortest_m, min(drowned_m))
    sides_m = (
        n * size_m
        for n, size_m in zip(
            (y.stop - y.start, x.stop - x.start), surface.pixel_size_m, strict=True
        )
    )
    return shortest_m, min(*sides_m, l_filter_nesting_index_m or np.inf)
