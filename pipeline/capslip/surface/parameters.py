"""Height parameters and texture of a map, in the words of ISO 25178-2."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from capslip.errors import UnusableSurfaceError
from capslip.surface.heightmap import HeightMap
from capslip.surface.rows import row_blocks

DECAY = 0.2  # of the autocorrelation: the value to which Sal and Str follow it (ISO 25178-3)
DIRECTIONS = 180  # classes of one degree
FIRST_LAGS = 32  # pixels around the middle in which the lobe of the autocorrelation is looked for


@dataclass(frozen=True, eq=False)
class SurfaceParameters:
    """Field parameters of a scale-limited surface (ISO 25178-2).

    Attributes
    ----------
    Sa_m, Sq_m : float
        Mean absolute and root mean square height.
    Ssk, Sku : float
        Skewness and kurtosis of the heights; NaN where all are equal.
    Sp_m, Sv_m, Sz_m : float
        Highest peak above the mean, deepest pit below it, and their sum.
    Sal_m : float
        Least distance at which the autocorrelation falls to 0.2; NaN where it does not.
    Str : float
        Sal over the greatest such distance: 1 is isotropic, 0 a lay; NaN where there is none.
    Std_rad : float
        Direction of the greatest angular power, from x towards y, in (-pi/2, pi/2]: in it the
        heights change most, and the lay is across. Steps of one degree; no meaning where Str is
        near 1.
    """

    Sa_m: float
    Sq_m: float
    Ssk: float
    Sku: float
    Sp_m: float
    Sv_m: float
    Sz_m: float
    Sal_m: float
    Str: float
    Std_rad: float


def surface_parameters(surface: HeightMap) -> SurfaceParameters:
    """Compute height parameters and texture of the measured points.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form; the mean is taken off.

    Raises
    ------
    UnusableSurfaceError
        If no point is measured.

    Notes
    -----
    Heights: sums over the measured points alone. The autocorrelation is that of the map continued
    periodically, each lag over the pairs that were both measured.

    Examples
    --------
    >>> x_m = (np.arange(400) + 0.5) * 1e-6
    >>> wave_m = np.tile(1e-6 * np.sin(2 * np.pi * x_m / 40e-6), (100, 1))
    >>> found = surface_parameters(HeightMap(wave_m, (1e-6, 1e-6)))
    >>> round(found.Sq_m * 1e6, 4), round(found.Sku, 4), found.Std_rad
    (0.7071, 1.5, 0.0)
    """
    n = surface.n_measured
    if n == 0:
        raise UnusableSurfaceError(
            f"{surface.origin.name}: all {surface.size} points are non-measured; expected heights"
        )
    mean_m = sum(float(block_m.sum()) for _, block_m in _blocks(surface)) / n
    (ny, nx), found = surface.shape, []
    waves_m = np.empty((ny, nx // 2 + 1), dtype=complex)
    for rows, block_m in _blocks(surface, mean_m):
        np.fft.rfft(block_m, out=waves_m[rows])
        found.append((*_power_sums(block_m.reshape(-1)), block_m.max(), -block_m.min()))
    *sums, highest_m, deepest_m = (list(one) for one in zip(*found, strict=True))
    sa_m, variance_m2, third_m3, fourth_m4 = (float(sum(one)) / n for one in sums)
    sp_m, sv_m = float(max(highest_m)), float(max(deepest_m))
    measured = None if surface.complete else surface.measured
    sal_m, aspect, std_rad = _texture(waves_m, measured, surface.shape, surface.pixel_size_m)
    rough = variance_m2 > 0.0
    return SurfaceParameters(
        Sa_m=sa_m,
        Sq_m=math.sqrt(variance_m2),
        Ssk=third_m3 / variance_m2**1.5 if rough else math.nan,
        Sku=fourth_m4 / variance_m2**2 if rough else math.nan,
        Sp_m=sp_m,
        Sv_m=sv_m,
        Sz_m=sp_m + sv_m,
        Sal_m=sal_m,
        Str=aspect,
        Std_rad=std_rad,
    )


def material_ratio_curve(surface: HeightMap, points: int = 501) -> tuple[np.ndarray, np.ndarray]:
    """Return the areal material ratio (Abbott) curve: shares from 0 to 1, and heights Smc(share).

    A share of the measured points lies at or above its height, as for the cut.
    """
    ratio = np.linspace(0.0, 1.0, points)
    height_m: np.ndarray = np.quantile(surface.height_m[surface.measured], 1.0 - ratio)
    return ratio, height_m


def _blocks(surface: HeightMap, mean_m: float = 0.0) -> Iterator[tuple[slice, np.ndarray]]:
    """Yield rows of heights about their mean, zero where they add nothing: not measured.

    What is done with some rows finds them in the cache, where a whole map is read again each time.
    """
    for rows in row_blocks(surface.shape):
        block_m = surface[rows] - mean_m
        block_m.reshape(-1)[surface.lost_in(rows)] = 0.0
        yield rows, block_m


def _power_sums(z: np.ndarray) -> tuple[float, float, float, float]:
    """Return the sums of |z|, z^2, z^3 and z^4."""
    square = z * z
    second, third, fourth = z @ z, square @ z, square @ square
    return float(np.abs(z, out=square).sum()), float(second), float(third), float(fourth)


def _texture(
    waves: np.ndarray,
    measured: np.ndarray | None,
    shape: tuple[int, int],
    pixel_size_m: tuple[float, float],
) -> tuple[float, float, float]:
    """Return Sal, Str and Std of heights about their mean, in any unit, zero at those not measured.

    `waves` are those of the rows; `measured` is None where all points are.

    Wiener and Khinchin: the autocorrelation is the transform of the power spectrum.
    """
    power = _power(waves)
    if not power.any():
        return math.nan, math.nan, math.nan
    std_rad = _direction(power, shape, pixel_size_m)
    lines, of_pairs = _lines(power), None
    if measured is not None:
        of_pairs = _lines(_power(np.fft.rfft(measured))) / len(measured)

    def correlation(n_rows: int) -> np.ndarray:
        sums = _sums(lines[:n_rows], shape[1])
        if of_pairs is not None:
            sums /= np.maximum(_sums(of_pairs[:n_rows], shape[1]), 1.0)
        return sums

    sal_m, longest_m = _decay(correlation, shape, pixel_size_m)
    return sal_m, sal_m / longest_m, std_rad


def _power(waves: np.ndarray) -> np.ndarray:
    """Return the squares of the amplitudes of the waves of a map, as of `rfft2`, from its rows'."""
    from scipy.fft import fft

    wave = fft(waves, axis=0, overwrite_x=True)
    power: np.ndarray = wave.real**2
    power += wave.imag**2
    return power


def _lines(power: np.ndarray) -> np.ndarray:
    """Return the waves along x of the sums of products at each lag of no negative y."""
    from scipy.fft import rfft

    lines: np.ndarray = rfft(power, axis=0)
    return np.conjugate(lines, out=lines)


def _sums(lines: np.ndarray, nx: int) -> np.ndarray:
    """Return these sums at all lags along x, times the number of rows.

    Power is real and, through the middle, its own mirror: lags (-y, -x) have the sums of (y, x).
    """
    from scipy.fft import irfft

    sums: np.ndarray = irfft(lines, n=nx, axis=1)
    return sums


def _direction(
    power: np.ndarray, shape: tuple[int, ...], pixel_size_m: tuple[float, float]
) -> float:
    """Return the direction of the greatest power, classes of one degree.

    Only waves within a circle, so that every direction has waves of the same lengths. Waves of
    rising and of falling phase lie mirrored, and so do their classes.
    """
    degrees = _classes(shape, pixel_size_m)
    of_class = np.bincount(degrees.reshape(-1), power.reshape(-1), DIRECTIONS + 1)
    # Along y, both of each pair of mirrored waves are there, else one
    twice = np.bincount(degrees[:, 0], power[:, 0], DIRECTIONS + 1)
    greatest = int(np.argmax((of_class - 0.5 * twice)[:DIRECTIONS]))
    return math.pi / DIRECTIONS * (greatest if greatest <= 90 else greatest - DIRECTIONS)


@lru_cache(maxsize=1)
def _classes(shape: tuple[int, ...], pixel_size_m: tuple[float, float]) -> np.ndarray:
    """Return the degree of each wave of `rfft2`; that of those that do not count is `DIRECTIONS`.

    The same for all maps of one size, of which a batch has many.
    """
    pairs = (shape[0] - 1) // 2
    fy_per_m = np.arange(shape[0] // 2 + 1)[:, None] / (shape[0] * pixel_size_m[0])
    fx_per_m = np.fft.rfftfreq(shape[1], pixel_size_m[1])[None, :]
    degrees = np.rint(np.arctan2(fy_per_m, fx_per_m) * (DIRECTIONS / math.pi)).astype(np.uint8)
    classes = np.concatenate([degrees, (DIRECTIONS - degrees[pairs:0:-1]) % DIRECTIONS])
    beyond = np.hypot(fy_per_m, fx_per_m) > 0.5 / max(pixel_size_m)
    classes[np.concatenate([beyond, beyond[pairs:0:-1]])] = DIRECTIONS
    classes[0, 0] = DIRECTIONS
    classes.setflags(write=False)
    return classes


def _decay(
    correlation: Callable[[int], np.ndarray],
    shape: tuple[int, int],
    pixel_size_m: tuple[float, float],
) -> tuple[float, float]:
    """Return the least and the greatest distance at which the lobe in the middle falls to 0.2.

    Straight between neighbouring points. NaN where it never does, or not within the map. The lobe
    is mostly small, and looked for in a frame around the middle that grows until it holds it, from
    the one that holds it along x; of `correlation`, not scaled, that takes as many rows of no
    negative y.
    """
    from scipy.ndimage import label

    reach, whole, along_x = FIRST_LAGS, False, correlation(1)[0, : shape[1] // 2 + 1]
    low = along_x <= DECAY * along_x[0]
    while reach < (int(np.argmax(low)) if low.any() else max(shape)):
        reach *= 2
    while not whole:
        lags = [np.arange(max(-(n // 2), -reach), min((n + 1) // 2, reach + 1)) for n in shape]
        whole = all(len(one) == n for one, n in zip(lags, shape, strict=True))
        at_lags = _lags(correlation(reach + 1), *lags)
        lobes = label(at_lags > DECAY)[0]
        lobe = lobes == lobes[int(-lags[0][0]), int(-lags[1][0])]
        ends = not any(line.any() for line in (lobe[0], lobe[-1], lobe[:, 0], lobe[:, -1]))
        if ends:
            break
        reach *= 2
    (y_m, x_m), found = (lag * size_m for lag, size_m in zip(lags, pixel_size_m, strict=True)), []
    for down, right in ((1, 0), (0, 1)):
        here, there = lobe[: len(y_m) - down, : len(x_m) - right], lobe[down:, right:]
        row, col = np.nonzero(here != there)
        one, next_one = at_lags[row, col], at_lags[row + down, col + right]
        share = (one - DECAY) / (one - next_one)
        up_m, along_m = down * share * pixel_size_m[0], right * share * pixel_size_m[1]
        found.append(np.hypot(y_m[row] + up_m, x_m[col] + along_m))
    distance_m = np.concatenate(found)
    if distance_m.size == 0:
        return math.nan, math.nan
    return float(distance_m.min()), float(distance_m.max()) if ends else math.nan


def _lags(half: np.ndarray, down: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the autocorrelation at rows and columns of lags, from its half of no negative y."""
    nx, above = half.shape[1], down < 0
    found = np.concatenate(
        [half[np.ix_(-down[above], -right % nx)], half[np.ix_(down[~above], right % nx)]]
    )
    return found / half[0, 0]
