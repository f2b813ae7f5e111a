"""Scenes and places that several tests share."""

from pathlib import Path

import numpy as np

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
