"""Noise of heights by a stencil that is blind to any quadratic surface.

Two places ask, and need not hear the same. The search for hills asks before there are hills, of the
map as a whole, rims and floor included: what could noise alone raise above the cut? The fit asks on
the hills alone, where noise may differ from that of the floor, and of noise that is correlated over
several points, which only stencils of wider spacing see (`capslip.caps.noise`).
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from capslip.surface.between import Between
from capslip.surface.filters import REACH_SIGMA, SIGMA_PER_NESTING_INDEX
from capslip.surface.heightmap import HeightMap, Heights

if TYPE_CHECKING:
    from capslip.settings import Settings

MEDIAN_OF_NORMAL = 0.6744897501960817  # of |x| for a standard normal x
NORMAL_95 = 1.96  # 95 % of |x| over the standard deviation
SAMPLES = 60_000  # of the whole map: enough for the median
SPLINE_DEGREE = 5  # by which maps are laid on other points
SPLINE_REACH = 48  # coefficients beyond are below 1e-16
FINER = 1.1  # pixels smaller by less need no smoothing first, and no other points
SHARES = 1025  # of a pixel, between which what is left is interpolated: off by less than 1e-6
AS_SAID = 0.8  # of the noise that is known, that a map shows at least where it is white
ENOUGH = 100  # differences between neighbours, of which a median says something


def mixed_difference(height_m: Callable[[int, int], np.ndarray]) -> np.ndarray:
    """Return the second mixed difference, (1 -2 1) x (1 -2 1), of heights about some points.

    It is blind to any quadratic surface, and passes white noise 36 times in variance.

    Parameters
    ----------
    height_m : callable
        Takes steps along y and x, each -1, 0 or 1, and gives the heights there, one a point.

    Examples
    --------
    >>> int(mixed_difference(lambda i, j: np.array((i * j) ** 2)))
    4
    """
    before, middle, after = (
        height_m(-1, step) - 2.0 * height_m(0, step) + height_m(1, step) for step in (-1, 0, 1)
    )
    difference_m: np.ndarray = before - 2.0 * middle + after
    return difference_m


def rms_of_noise_m(difference_m: np.ndarray) -> float:
    """Return the standard deviation of white noise from mixed differences; NaN are left out.

    It follows from their median, which holds against steps, rims and spikes.
    """
    difference_m = np.abs(difference_m[~np.isnan(difference_m)])
    if difference_m.size == 0:
        return 0.0
    return float(np.median(difference_m)) / (6.0 * MEDIAN_OF_NORMAL)


def deviation_m(off_m: np.ndarray) -> float:
    """Return the standard deviation that lengths |x| tell, whatever the outermost of them are.

    By their median or by 95 % of them, the greater: of rounded heights half may be exact.
    """
    of_most_m = float(np.quantile(off_m, 0.95)) / NORMAL_95
    return max(float(np.median(off_m)) / MEDIAN_OF_NORMAL, of_most_m)


def noise_of_map_m(height_m: Heights) -> float:
    """Return the standard deviation of the white noise of a map, shape (ny, nx), from a lattice."""
    every = max(1, math.isqrt(height_m.size // SAMPLES))
    row, col = (np.arange(1, n - 1) for n in height_m.shape)
    row, col = (
        at[on_lattice(at, n, every)] for at, n in zip((row, col), height_m.shape, strict=True)
    )
    lines_m = [height_m[row + i] for i in (-1, 0, 1)]  # whole rows, which is faster than points
    return rms_of_noise_m(mixed_difference(lambda i, j: lines_m[i + 1][:, col + j]))


def white_noise_of_scans_m(noise_m: np.ndarray, here: np.ndarray) -> float | None:
    """Return the part of the noise of one scan that changes from pixel to pixel, where it tells.

    Parameters
    ----------
    noise_m : ndarray, shape (n, ny, nx)
        What each of several scans of one place has over one height map, NaN where not measured.
    here : ndarray of bool, shape (ny, nx)
        The points that are asked.
    """
    own_m = noise_m - noise_m.mean(axis=0)
    ny, nx = here.shape

    def around(i: int, j: int) -> np.ndarray:
        heights_m: np.ndarray = own_m[:, 1 + i : ny - 1 + i, 1 + j : nx - 1 + j]
        return heights_m[:, here[1:-1, 1:-1]]

    n, difference_m = len(noise_m), mixed_difference(around)
    if np.count_nonzero(~np.isnan(difference_m)) < ENOUGH:
        return None
    return math.sqrt(n / (n - 1.0)) * rms_of_noise_m(difference_m)


@dataclass(frozen=True)
class ScanNoise:
    """The noise of a map before filters and resampling, of which these leave a part."""

    shape: tuple[int, int]
    pixel_size_m: tuple[float, float]
    noise_m: float | None  # as the file says
    scans: float
    white: float  # share of its variance that changes from pixel to pixel

    @classmethod
    def of(cls, surface: HeightMap, given_m: float | None) -> "ScanNoise":
        """Return that of a map, of which somebody may say another noise than its file.

        What the map shows of white noise is the most that it has; the rest is shared by neighbours.
        """
        known_m, white = surface.noise_m if given_m is None else given_m, 1.0
        if known_m is not None:
            seen = noise_of_map_m(surface) / known_m
            white = 1.0 if seen >= AS_SAID else seen**2
        of = surface.shape, surface.pixel_size_m, surface.noise_m
        return cls(*of, surface.scans_of_noise, white)

    def left_in(self, made: HeightMap, nesting_index_m: float | None = None) -> HeightMap:
        """Return what was made of the map with its noise: by an S-filter, on as many points.

        A sum with weights w leaves sum w^2 of the variance of white noise. What neighbours share
        counts as it was: nobody knows over how many points.
        """
        left = 1.0
        for n_old, n, size_m in zip(self.shape, made.shape, self.pixel_size_m, strict=True):
            pixels = (nesting_index_m or 0.0) / size_m, 2.0 * n_old / n if n < n_old else 0.0
            left *= _left_along(n_old, n, SIGMA_PER_NESTING_INDEX * math.hypot(*pixels))
        left = self.white * left + 1.0 - self.white
        noise_m = None if self.noise_m is None else math.sqrt(left) * self.noise_m
        return replace(made, noise_m=noise_m, noise_scans=left * self.scans)


def _left_along(n_old: int, n: int, sigma: float) -> float:
    """Return what a Gaussian, then straight lines to n of so many points, leave of a variance."""
    reach = math.ceil(REACH_SIGMA * sigma) + 1
    weight = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sigma, 1e-3)) ** 2)
    weight /= weight.sum()
    if n == n_old:
        return float(weight @ weight)
    place = np.clip((np.arange(n) + 0.5) * (n_old / n) - 0.5, 0.0, n_old - 1.0)
    beyond = place - np.floor(place)
    beside = 2.0 * beyond * (1.0 - beyond)
    return float(np.mean((1.0 - beside) * (weight @ weight) + beside * (weight[1:] @ weight[:-1])))


def noise_laid(
    surface: HeightMap, place: Iterable[np.ndarray], nesting_index: Iterable[float]
) -> float:
    """Return `noise_left` of a map that is laid; all of it where a filter took off the white one.

    What neighbours share a spline keeps.
    """
    return 1.0 if surface.scans_of_noise < surface.faces else noise_left(place, nesting_index)


def noise_left(place: Iterable[np.ndarray], nesting_index: Iterable[float]) -> float:
    """Return the rms left of white noise of rms 1 that is smoothed, then laid along a spline.

    Weights w of a sum leave the root of sum w^2. The quintic spline through heights is a sum of
    B-splines, whose coefficients are the heights convolved with the inverse of what the B-splines
    are at whole pixels (Unser, IEEE Signal Processing Magazine 16 (1999) 22): at a place it weighs
    six of them.

    Parameters
    ----------
    place : iterable of ndarray
        Where it is interpolated along each axis, in pixels; their shapes broadcast.
    nesting_index : iterable of float
        Of the Gaussian along each axis, in pixels; 0 leaves that axis as it is.

    Examples
    --------
    >>> points, middles = np.array([3.0]), np.array([0.5])
    >>> round(noise_left((points, points), (0.0, 0.0)), 12)
    1.0
    >>> round(noise_left((middles, middles), (0.0, 0.0)), 3)  # a mean of the four leaves 0.5
    0.836
    """
    coefficient, between = _coefficients(), np.linspace(0.0, 1.0, SHARES)
    of_six = [_b_spline(between + 2.0 - n) for n in range(6)]
    left = np.ones(1)
    for at, index in zip(place, nesting_index, strict=True):
        sigma = SIGMA_PER_NESTING_INDEX * index
        reach = math.ceil(REACH_SIGMA * sigma) + 1
        weight = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sigma, 1e-3)) ** 2)
        weight = np.convolve(weight / weight.sum(), coefficient)
        shared = [weight[n:] @ weight[: weight.size - n] for n in range(6)]
        square = sum(
            one * other * shared[abs(i - j)]
            for i, one in enumerate(of_six)
            for j, other in enumerate(of_six)
        )
        left = left * np.interp(at - np.floor(at), between, square)
    return round(math.sqrt(left.mean()), 12)  # of whole pixels all, exactly


def noise_spectrum(faces: Iterable[Between], scans: float, shape: tuple[int, int]) -> np.ndarray:
    """Return the power of the noise of a sum in each wave of a cosine transform, of mean 1.

    That of faces on their own points is white; the noise of one that was laid has the waves that
    its spline follows, and others by the share in which points at all places alias them.

    Parameters
    ----------
    faces : iterable of Between
        Those that were laid.
    scans : float
        Of how many scans the noise of the sum has the variance.
    shape : (int, int)
        Of the transform.
    """
    power, white = np.zeros(shape), scans
    for one in faces:
        of_y, of_x = (_transfer(n, apart) for n, apart in zip(shape, one.pixels, strict=True))
        laid = one.scans * np.outer(of_y, of_x)
        power += laid
        white -= float(laid.mean())
    power += max(white, 0.0)
    return np.asarray(power / power.mean())


def _transfer(n: int, apart: float) -> np.ndarray:
    """Return the power that a quintic spline through white noise has in each of n waves.

    Points closer than those they are laid on are smoothed first, over a nesting index of two.
    """
    k = np.pi * np.arange(n) / n
    power = np.zeros(n)
    for turn in 2.0 * np.pi * np.arange(-2, 3):
        wave = (k + turn) * apart
        one = np.sinc(wave / (2.0 * np.pi)) ** 6 / _at_pixels(wave)
        if apart < 1.0 / FINER:
            one *= np.exp(-0.5 * (2.0 * SIGMA_PER_NESTING_INDEX * (k + turn)) ** 2)
        power += np.square(one)
    return apart * power


def _coefficients() -> np.ndarray:
    """Return the coefficients of the spline through a single height, by their Fourier series."""
    n = 4 * SPLINE_REACH
    turn = 2.0 * np.pi * np.arange(n // 2 + 1) / n
    around: np.ndarray = np.fft.irfft(1.0 / _at_pixels(turn), n)
    return np.roll(around, SPLINE_REACH)[: 2 * SPLINE_REACH + 1]


def _at_pixels(wave: np.ndarray) -> np.ndarray:
    """Return the Fourier series of what that B-spline is at whole pixels, by radians a pixel."""
    return np.asarray((66.0 + 52.0 * np.cos(wave) + 2.0 * np.cos(2.0 * wave)) / 120.0)


def _b_spline(x: np.ndarray) -> np.ndarray:
    """Return the B-spline of the fifth degree about zero."""
    far = np.abs(x)
    found: np.ndarray = sum(
        (-1) ** k * math.comb(6, k) * np.maximum(3.0 - k - far, 0.0) ** 5 for k in range(3)
    )
    return found / 120.0


def on_lattice(place: np.ndarray, n: int, every: int) -> np.ndarray:
    """Tell which of rows or columns 0 ... n - 1 lie on a lattice; the mirrored map has the same."""
    chosen: np.ndarray = np.minimum(place, n - 1 - place) % every == 0
    return chosen


def some_lines(window: slice, count: int) -> np.ndarray:
    """Return about so many or more rows or columns of a window, all of few; mirrored, the same.

    Examples
    --------
    >>> some_lines(slice(2, 12), 4)
    array([ 2,  4,  6,  7,  9, 11])
    """
    n = window.stop - window.start
    at = np.arange(n)
    return np.asarray(window.start + at[on_lattice(at, n, max(1, n // count))])


def known_noise_m(surface: HeightMap, settings: "Settings") -> float | None:
    """Return the measurement noise of a map: as somebody says, else as its file does, or None.

    What is said is that of one scan, before filters; a sum of two has that of both. What filters,
    resampling and interpolation take off either is taken off.
    """
    given_m = settings.instrument.noise_m
    return surface.noise_m if given_m is None else given_m * math.sqrt(surface.scans_of_noise)
