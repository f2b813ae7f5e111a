"""Height parameters and texture of a map, in the words of ISO 25178-2."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.errors import UnusableSurfaceError
from capslip.surface.heightmap import HeightMap
from capslip.surface.spectrum import Spectrum, line_spectrum

DECAY = 0.2  # of the autocorrelation: the value to which Sal and Str follow it (ISO 25178-3)
DIRECTIONS = 180  # classes of one degree


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
    along_x, along_y : Spectrum
        Power spectra of the rows and of the columns.
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
    along_x: Spectrum
    along_y: Spectrum


def surface_parameters(surface: HeightMap) -> SurfaceParameters:
    """Compute height parameters, texture and spectra of the measured points.

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
    periodically, each lag over the pairs that were both measured. Spectra: see
    `line_spectrum`.

    Examples
    --------
    >>> x_m = (np.arange(400) + 0.5) * 1e-6
    >>> wave_m = np.tile(1e-6 * np.sin(2 * np.pi * x_m / 40e-6), (100, 1))
    >>> found = surface_parameters(HeightMap(wave_m, (1e-6, 1e-6)))
    >>> round(found.Sq_m * 1e6, 4), round(found.Sku, 4), found.Std_rad
    (0.7071, 1.5, 0.0)
    """
    measured = surface.measured
    if not measured.any():
        raise UnusableSurfaceError(
            f"{surface.origin.name}: all {measured.size} points are non-measured; expected heights"
        )
    height_m = surface.height_m - surface.height_m[measured].mean()
    sa_m, sq_m, ssk, sku = _moments(height_m[measured])
    sp_m, sv_m = float(np.nanmax(height_m)), -float(np.nanmin(height_m))
    dy_m, dx_m = surface.pixel_size_m
    sal_m, aspect, std_rad = _texture(height_m, measured, (dy_m, dx_m))
    return SurfaceParameters(
        Sa_m=sa_m,
        Sq_m=sq_m,
        Ssk=ssk,
        Sku=sku,
        Sp_m=sp_m,
        Sv_m=sv_m,
        Sz_m=sp_m + sv_m,
        Sal_m=sal_m,
        Str=aspect,
        Std_rad=std_rad,
        along_x=line_spectrum(height_m, dx_m),
        along_y=line_spectrum(height_m.T, dy_m),
    )


def material_ratio_curve(surface: HeightMap, points: int = 501) -> tuple[np.ndarray, np.ndarray]:
    """Return the areal material ratio (Abbott) curve: shares from 0 to 1, and heights Smc(share).

    A share of the measured points lies at or above its height, as for the cut.
    """
    ratio = np.linspace(0.0, 1.0, points)
    height_m: np.ndarray = np.quantile(surface.height_m[surface.measured], 1.0 - ratio)
    return ratio, height_m


def _moments(height_m: np.ndarray) -> tuple[float, float, float, float]:
    """Return Sa, Sq, Ssk and Sku of heights about their mean."""
    largest_m = float(np.abs(height_m).max()) or 1.0
    z = height_m / largest_m  # fourth powers of nanometres would lose digits
    square = z * z
    n, variance = z.size, float(square.mean())
    ssk = sku = math.nan
    if variance > 0.0:
        ssk = float(square @ z) / n / variance**1.5
        sku = float(square @ square) / n / variance**2
    return float(np.abs(z).mean()) * largest_m, math.sqrt(variance) * largest_m, ssk, sku


def _texture(
    height_m: np.ndarray, measured: np.ndarray, pixel_size_m: tuple[float, float]
) -> tuple[float, float, float]:
    """Return Sal, Str and Std of heights about their mean."""
    shape, whole = height_m.shape, bool(measured.all())
    power = np.abs(np.fft.rfft2(height_m if whole else np.where(measured, height_m, 0.0))) ** 2
    if not power.any():
        return math.nan, math.nan, math.nan
    std_rad = _direction(power, shape, pixel_size_m)
    correlation = np.fft.irfft2(power, s=shape)
    if not whole:
        pairs = np.fft.irfft2(np.abs(np.fft.rfft2(measured)) ** 2, s=shape)
        correlation /= np.maximum(pairs, 1.0)
    correlation /= correlation[0, 0]
    sal_m, longest_m = _decay(np.fft.fftshift(correlation), pixel_size_m)
    return sal_m, sal_m / longest_m, std_rad


def _direction(
    power: np.ndarray, shape: tuple[int, ...], pixel_size_m: tuple[float, float]
) -> float:
    """Return the direction of the greatest power, classes of one degree.

    Only waves within a circle, so that every direction has waves of the same lengths.
    """
    fy_per_m = np.fft.fftfreq(shape[0], pixel_size_m[0])[:, None]
    fx_per_m = np.fft.rfftfreq(shape[1], pixel_size_m[1])[None, :]
    inside = np.hypot(fy_per_m, fx_per_m) <= 0.5 / max(pixel_size_m)
    inside[0, 0] = False
    angle = np.arctan2(fy_per_m, fx_per_m)[inside]  # of half the plane: -90 to 90 degrees
    number = np.rint(angle * (DIRECTIONS / math.pi)).astype(np.int64) % DIRECTIONS
    halves = np.ones(len(fx_per_m[0]))
    halves[0] = 0.5  # along y, both of each pair of mirrored waves are there, else one
    of_class = np.bincount(number, (power * halves)[inside], minlength=DIRECTIONS)
    degrees = int(np.argmax(of_class))
    return math.pi / DIRECTIONS * (degrees if degrees <= 90 else degrees - DIRECTIONS)


def _decay(correlation: np.ndarray, pixel_size_m: tuple[float, float]) -> tuple[float, float]:
    """Return the least and the greatest distance at which the lobe in the middle falls to 0.2.

    Straight between neighbouring points. NaN where it never does, or not within the map.
    """
    from scipy.ndimage import label

    middle = [n // 2 for n in correlation.shape]
    lobes = label(correlation > DECAY)[0]
    lobe = lobes == lobes[middle[0], middle[1]]
    y_m, x_m = np.meshgrid(
        *(
            (np.arange(n) - n // 2) * size_m
            for n, size_m in zip(lobe.shape, pixel_size_m, strict=True)
        ),
        indexing="ij",
    )
    found = []
    for here, there in ((np.s_[:-1, :], np.s_[1:, :]), (np.s_[:, :-1], np.s_[:, 1:])):
        at = lobe[here] != lobe[there]
        fall = correlation[here][at] - correlation[there][at]
        share = (correlation[here][at] - DECAY) / fall
        crossing = [z[here][at] + share * (z[there][at] - z[here][at]) for z in (y_m, x_m)]
        found.append(np.hypot(*crossing))
    distance_m = np.concatenate(found)
    if distance_m.size == 0:
        return math.nan, math.nan
    frame = (lobe[0], lobe[-1], lobe[:, 0], lobe[:, -1])
    ends = not any(line.any() for line in frame)
    return float(distance_m.min()), float(distance_m.max()) if ends else math.nan
