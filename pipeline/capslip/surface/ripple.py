"""A ripple of one wavelength that runs through a map: of an instrument more likely than of a face.

Vibrations while a map was scanned, and what is left of fringes, lay a wave on it that is as regular
as a clock. Grooves are not: their wavelengths scatter, and their spectrum is a ridge, not a line.
Lattices are, and have lines in three directions and more.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap

SIDE = 256  # points of the square in the middle that is looked at: a ripple is everywhere
LEAST_SIDE = 32
LEAST_KNOWN = 0.5  # of its points
LEAST_WAVES = 5.0  # along it: of fewer nobody can tell how regular they are
SHARP = 10.0  # times the power of all around a line; of random faces and rows it is 6 at most
# Lattices of spheres, dimples or pyramids are as regular, and of the face: so many lines more, that
# stand off half as much, are half as high, and have directions of their own by so many radians
LATTICE, APART_RAD = 2, 0.26
LINE, AROUND = 2, 6  # half widths of a line, with a Hann window, and of what it is compared with
MOST_M = 5e-8  # amplitude, a tenth of a wave of light: instruments leave less, feed marks are more
MOST_OF_RELIEF = 0.4  # of Sq of the square: beyond, it is the relief of the face


@dataclass(frozen=True)
class Ripple:
    """A wave of one length, and its periods a row and a column."""

    amplitude_m: float  # up to 28 % low, where it lies between lines of the spectrum
    per_row: float  # >= 0
    per_column: float  # >= 0 where there is none a row
    wavelength_m: float


def find_ripple(surface: HeightMap) -> Ripple | None:
    """Find the line in the spectrum of a map that stands off most, None where none does.

    Parameters
    ----------
    surface : HeightMap
        Any form. Of a large one the middle is looked at, at all of its pixels.

    Examples
    --------
    >>> y, x = np.mgrid[:200, :300]
    >>> face_m = 1e-6 * np.cos(y / 60.0) * np.cos(x / 50.0)
    >>> ripple_m = 1e-8 * np.cos(2.0 * np.pi * (0.1 * y + 0.0625 * x))
    >>> ripple = find_ripple(HeightMap(face_m + ripple_m, (1e-5, 1e-5)))
    >>> f"{ripple.amplitude_m:.1e} m, every {1e6 * ripple.wavelength_m:.0f} um"
    '1.0e-08 m, every 85 um'
    >>> find_ripple(HeightMap(face_m, (1e-5, 1e-5))) is None
    True
    """
    middle = tuple(slice(max(0, (n - SIDE) // 2), (n + SIDE) // 2) for n in surface.shape)
    square = HeightMap(np.asarray(surface[middle[0], middle[1]], float), surface.pixel_size_m)
    if min(square.shape) < LEAST_SIDE or square.n_measured <= LEAST_KNOWN * square.size:
        return None
    over_m, (ny, nx) = _over_a_plane_m(square), square.shape
    window = np.outer(np.hanning(ny + 2)[1:-1], np.hanning(nx + 2)[1:-1])
    power_m2 = np.abs(np.fft.fft2(over_m * window * (2.0 / window.sum()))) ** 2
    i, j = _sharpest_line(power_m2)
    amplitude_m, most_m = float(np.sqrt(power_m2[i, j])), MOST_OF_RELIEF * float(over_m.std())
    if i == j == 0 or amplitude_m > min(MOST_M, most_m):
        return None
    per_row, per_column = float(np.fft.fftfreq(ny)[i]), float(np.fft.fftfreq(nx)[j])
    if (per_row, per_column) < (0.0, 0.0):  # both stand for it, and rounding says which was found
        per_row, per_column = 0.0 - per_row, 0.0 - per_column
    dy_m, dx_m = surface.pixel_size_m
    wavelength_m = 1.0 / float(np.hypot(per_row / dy_m, per_column / dx_m))
    return Ripple(amplitude_m, per_row, per_column, wavelength_m)


def without_ripple(surface: HeightMap, ripple: Ripple) -> HeightMap:
    """Return a map less what its spectrum holds beside the line of a ripple."""
    over_m = _over_a_plane_m(surface)
    wave, inside = np.fft.rfft2(over_m), np.zeros((), dtype=bool)
    for way in (1.0, -1.0):
        rows, columns = (
            _beside(way * per_point, n)
            for n, per_point in zip(over_m.shape, (ripple.per_row, ripple.per_column), strict=True)
        )
        inside = inside | rows[:, None] & columns[: wave.shape[1]]
    ripple_m = np.fft.irfft2(np.where(inside, wave, 0.0), s=over_m.shape)
    return replace(surface, height_m=surface.height_m - ripple_m)


def _beside(per_point: float, n: int) -> np.ndarray:
    """Return which of n frequencies belong to a line; 1 period a point is the same as none."""
    away = np.abs(np.fft.fftfreq(n) - per_point)
    return np.asarray(np.minimum(away, 1.0 - away) < (LINE + 1.0) / min(n, SIDE))


def _over_a_plane_m(surface: HeightMap) -> np.ndarray:
    """Return heights over their least-squares plane, 0 where none was measured."""
    return np.nan_to_num(remove_form(surface, "plane")[0].height_m)


def _sharpest_line(power: np.ndarray) -> tuple[int, int]:
    """Return where a line stands off most, (0, 0) where none is sharp."""
    from scipy.ndimage import maximum_filter

    ny, nx = power.shape
    waves = np.hypot(ny * np.fft.fftfreq(ny)[:, None], nx * np.fft.fftfreq(nx))
    highest = power == maximum_filter(power, 2 * AROUND + 1, mode="wrap")
    row, col = np.nonzero(highest & (waves >= LEAST_WAVES) & (power > 0.0))
    if row.size == 0:
        return 0, 0
    down, right = (one.ravel() for one in np.mgrid[-AROUND : AROUND + 1, -AROUND : AROUND + 1])
    beside = np.maximum(np.abs(down), np.abs(right)) > LINE
    rows, cols = row[:, None] + down[beside], col[:, None] + right[beside]
    stands_off = power[row, col] / power[rows % ny, cols % nx].max(axis=1)
    best = int(np.argmax(stands_off))
    at = power[row, col]
    others = (stands_off > 0.5 * SHARP) & (at >= 0.25 * at[best])
    angle = np.arctan2(np.fft.fftfreq(ny)[row], np.fft.fftfreq(nx)[col])
    lattice = _directions(angle[others], angle[best]) >= LATTICE
    return (int(row[best]), int(col[best])) if stands_off[best] > SHARP and not lattice else (0, 0)


def _directions(angle: np.ndarray, but: float) -> int:
    """Count the directions of some angles, but for one, modulo half a turn."""
    found = [but]
    for one in angle.tolist():
        if all(abs(math.remainder(one - other, math.pi)) > APART_RAD for other in found):
            found.append(one)
    return len(found) - 1
