"""Noise of the heights on the hills, white or correlated over a few points."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.caps.hills import highest_points
from capslip.caps.points import HillPoints
from capslip.surface.heightmap import HeightMap
from capslip.surface.noise import mixed_difference, on_lattice, rms_of_noise_m

SAMPLES = 8000  # stencils at each spacing: the median is then good to 1 %
SPACINGS = (1, 2, 4, 8)
HIGHEST = 0.1  # share of the points of a face that rests, of which its noise is taken
LEVELLED = 2.5  # growth from one spacing to the next below which the noise counts as seen in full


@dataclass(frozen=True)
class Noise:
    """Noise of the heights.

    Attributes
    ----------
    rms_m : float
        Standard deviation.
    inflation : float
        Standard error of a mean of many neighbouring points, over that for white noise.
    neighbours_m : float
        What neighbouring points show of it: of white noise, all.
    """

    rms_m: float
    inflation: float
    neighbours_m: float


def noise_on_hills(surface: HeightMap, points: HillPoints) -> Noise:
    """Measure the noise by second mixed differences at growing spacings.

    The stencil (1 -2 1) x (1 -2 1) is blind to any quadratic surface, and passes white noise 36
    times in variance, at any spacing of its points. Correlated noise it sees in full once the
    spacing exceeds the correlation length; a smooth surface that is not quadratic it sees growing
    as the fourth power of the spacing. So the answer is that of the spacing at which growth ends;
    where it does not end, the surface is smooth at all of them, and the first one holds the noise.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    points : HillPoints
        Points of the hills; stencils are centred on them, and dropped where they meet
        non-measured points.

    Notes
    -----
    Medians hold against rims and spikes. With the correlation r(i, j) = r(i) r(j) the stencil at
    spacing k passes (6 - 8 r(k) + 2 r(2k))^2, which gives r(k) from r(2k), down from the spacing
    at which it vanishes; the inflation is the sum 1 + 2 r(1) + 2 r(2) + ...
    """
    every = math.ceil(math.sqrt(max(1.0, points.hill.size / SAMPLES)))
    rows, cols = (on_lattice(np.arange(n), n, every) for n in surface.shape)
    some = np.flatnonzero(rows[points.row] & cols[points.col])
    return noise_at(surface, *(at[some].astype(np.intp) for at in (points.row, points.col)))


def noise_at_rest(surface: HeightMap, rest_slope: tuple[float, float]) -> Noise:
    """Return the noise of the highest tenth of a face as it rests.

    No level, no cut and no point that lies below all that touches decides it.
    """
    shape, share = surface.shape, HIGHEST
    every = max(1, math.isqrt(int(math.prod(shape) * share / SAMPLES)))
    row, col = (np.flatnonzero(on_lattice(np.arange(n), n, every)) for n in shape)
    (dy_m, dx_m), (slope_x, slope_y) = surface.pixel_size_m, rest_slope
    height_m = surface[np.ix_(row, col)] - slope_x * dx_m * col
    height_m -= (slope_y * dy_m * row)[:, None]
    known = height_m.size - int(np.count_nonzero(np.isnan(height_m)))
    point = np.zeros(0, dtype=np.intp)
    if known:
        point, _ = highest_points(height_m, known, share)
    return noise_at(surface, row[point // col.size], col[point % col.size])


def noise_at(surface: HeightMap, row: np.ndarray, col: np.ndarray) -> Noise:
    """Measure the noise about some points of a map, given by row and column."""
    seen_m: list[float] = []
    for spacing in SPACINGS:
        seen_m.append(_seen_m(surface, row, col, spacing))
        if len(seen_m) > 1 and seen_m[-1] <= LEVELLED * seen_m[-2]:
            return Noise(max(seen_m[-2:]), _inflation(seen_m), seen_m[0])
    return Noise(seen_m[0], 1.0, seen_m[0])


def _inflation(seen_m: list[float]) -> float:
    correlation = [0.0]
    for finer_m in seen_m[-2::-1]:
        share = finer_m / max(seen_m[-2], seen_m[-1], 1e-300)
        correlation.insert(0, min(max((6.0 + 2.0 * correlation[0] - 6.0 * share) / 8.0, 0.0), 1.0))
    lags = np.arange(1, SPACINGS[len(seen_m) - 1])
    between = np.interp(lags, SPACINGS[: len(seen_m)], correlation)
    return float(1.0 + 2.0 * between.sum())


def _seen_m(surface: HeightMap, row: np.ndarray, col: np.ndarray, spacing: int) -> float:
    ny, nx = surface.shape
    inside = (row >= spacing) & (row < ny - spacing) & (col >= spacing) & (col < nx - spacing)
    centre = row[inside] * nx + col[inside]
    difference_m = mixed_difference(lambda i, j: surface.at(centre + spacing * (i * nx + j)))
    return rms_of_noise_m(difference_m)
