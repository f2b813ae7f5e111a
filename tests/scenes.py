"""Scenes and places that several tests share."""

import time
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from capslip.surface.heightmap import HeightMap

PROJECT = Path(__file__).parents[1]
SCANS = PROJECT.parent / "shared" / "scans"
REFERENCE = PROJECT.parent / "shared" / "reference"


def sphere_height_m(x_m, y_m, centre, radius_m, peak_m):
    """Height of a sphere over (x, y), in the form that loses no digit."""
    r2 = (x_m - centre[0]) ** 2 + (y_m - centre[1]) ** 2
    return peak_m - r2 / (radius_m + np.sqrt(np.maximum(radius_m**2 - r2, 0.0)))


def caps_map(caps, shape=(200, 300), pixel_size_m=(1e-4, 1e-4), floor_m=-1e-6):
    """Height map of (x, y, R, peak) caps that stand on a floor."""
    ny, nx = shape
    y_m = ((np.arange(ny) + 0.5) * pixel_size_m[0])[:, None]
    x_m = ((np.arange(nx) + 0.5) * pixel_size_m[1])[None, :]
    height_m = np.full(shape, floor_m)
    for x, y, radius_m, peak_m in caps:
        height_m = np.maximum(height_m, sphere_height_m(x_m, y_m, (x, y), radius_m, peak_m))
    return HeightMap(height_m, pixel_size_m)


def noisy_waves(noise_m=0.0):
    """Map of waves of some 20 pixels, whose contacts are a few wide, with white noise on it."""
    z = gaussian_filter(np.random.default_rng(7).standard_normal((64, 64)), 4, mode="wrap")
    z *= 2e-4 * 5e-5 / np.sqrt(np.mean(np.gradient(z)[0] ** 2))
    z += noise_m * np.random.default_rng(8).standard_normal(z.shape)
    return HeightMap(z, (5e-5, 5e-5))


def in_filters(work):
    """Return how often a Gaussian filter of 1200 x 800 points fits into the time of `work`.

    Both in turn, in processor time, the least of five each: a slow or busy machine slows both.
    """
    z = np.random.default_rng(0).standard_normal((800, 1200))
    least_s = []
    for one in (work, lambda: gaussian_filter(z, 2.0)) * 5:
        begin_s = time.thread_time()
        one()
        least_s.append(time.thread_time() - begin_s)
    return min(least_s[::2]) / min(least_s[1::2])
