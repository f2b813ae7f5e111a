"""Changes of a face, or of its scan, that no scene holds; `x` is the severity."""

import math
from dataclasses import replace

import numpy as np

from capslip.studies.faces.finer import finer_places, finer_profile
from capslip.studies.faces.synthetic import Truth
from capslip.surface.heightmap import HeightMap


def with_lay(surface: HeightMap, truth: Truth, finer: int = 1, *, x: float, seed: int) -> HeightMap:
    """Add grooves of 2 mm along y of that rms height, with some randomness along x.

    The randomness is of the columns of the map, and has no wave shorter than two of them: `finer`
    tells how many points of the surface lie along the side of a pixel of that map.
    """
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    (ny, nx), (dy_m, dx_m) = (ny // finer, nx // finer), (finer * dy_m, finer * dx_m)
    drift = np.cumsum(np.random.default_rng(seed + 11).normal(0.0, 0.15, nx))

    def lay(times: int) -> np.ndarray:
        column, row = finer_places(nx, times), finer_places(ny, times)[:, None]
        phase = 2.0 * np.pi * column * dx_m / 2e-3 + finer_profile(drift, times)
        return np.asarray((1.0 + 0.3 * np.sin(row * dy_m / 7e-3)) * np.sin(phase))

    return replace(surface, height_m=surface.height_m + x * lay(finer) / lay(1).std())


def elongated(
    surface: HeightMap, truth: Truth, finer: int = 1, *, x: float, seed: int
) -> HeightMap:
    """Put ellipsoids of that ratio and of equal Gaussian curvature in place of the spheres."""
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    y_m, x_m = ((np.arange(ny) + 0.5) * dy_m)[:, None], (np.arange(nx) + 0.5) * dx_m
    height_m = np.full(surface.shape, truth.cut_height_m - 0.5e-6)
    caps = zip(truth.x_m, truth.y_m, truth.radius_m, truth.peak_height_m, strict=True)
    for number, (x0_m, y0_m, radius_m, peak_m) in enumerate(caps):
        angle = float(seed + number)
        along, across = math.cos(angle), math.sin(angle)
        u_m = along * (x_m - x0_m) + across * (y_m - y0_m)
        v_m = along * (y_m - y0_m) - across * (x_m - x0_m)
        fall_m = (u_m**2 / math.sqrt(x) + v_m**2 * math.sqrt(x)) / (2.0 * radius_m)
        np.maximum(height_m, peak_m - fall_m, out=height_m)
    return replace(surface, height_m=height_m)


def lowered(surface: HeightMap, truth: Truth, x: float, seed: int) -> HeightMap:
    """Lower what never touches, the floor between the caps, on one half of the face."""
    floor = surface.height_m <= surface.height_m.min() + 1e-9
    floor[:, : surface.shape[1] // 2] = False
    return replace(surface, height_m=surface.height_m - x * floor)


def clipped(surface: HeightMap, truth: Truth, x: float, seed: int) -> HeightMap:
    """Clip that share of the highest cap, as a sensor does: with noise of half a nanometre."""
    noise_m = np.random.default_rng(seed + 12).normal(0.0, 0.5e-9, surface.shape)
    top_m = truth.peak_height_m.max()
    limit_m = top_m - x * (top_m - truth.cut_height_m)
    return replace(surface, height_m=np.minimum(surface.height_m + noise_m, limit_m))


def quantised(surface: HeightMap, truth: Truth, x: float, seed: int) -> HeightMap:
    """Round to steps of that height."""
    return replace(surface, height_m=np.round(surface.height_m / x) * x)


def heights_misread(surface: HeightMap, truth: Truth, x: float, seed: int) -> HeightMap:
    """Take the heights for so many times what they are."""
    return replace(surface, height_m=x * surface.height_m)


def pixels_misread(surface: HeightMap, truth: Truth, x: float, seed: int) -> HeightMap:
    """Take the pixels for so many times what they are."""
    dy_m, dx_m = surface.pixel_size_m
    return replace(surface, pixel_size_m=(x * dy_m, x * dx_m))


def both_misread(surface: HeightMap, truth: Truth, x: float, seed: int) -> HeightMap:
    """Take heights and pixels for so many times what they are."""
    return pixels_misread(heights_misread(surface, truth, x, seed), truth, x, seed)


def dusty(surface: HeightMap, truth: Truth, x: float, seed: int) -> HeightMap:
    """Put three square grains of 0.5 um, so many pixels wide, on the face."""
    rng = np.random.default_rng(seed + 5)
    height_m, width = surface.height_m.copy(), int(x)
    ny, nx = surface.shape
    for _ in range(3):
        row, col = rng.integers(0, ny - width), rng.integers(0, nx - width)
        height_m[row : row + width, col : col + width] += 0.5e-6
    return replace(surface, height_m=height_m)
