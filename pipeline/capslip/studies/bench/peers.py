"""What is timed beside the stages: other packages that do a part of the same work.

Each function prepares the work and returns it; ImportError where the package is not installed.
"""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from capslip.surface.heightmap import HeightMap


def h5py(scan: Path) -> Callable[[], Any]:
    """Return what reads the heights alone with h5py."""
    from h5py import File

    def read() -> Any:
        with File(scan) as file:
            return file["height"][...]

    return read


def lstsq(surface: HeightMap) -> Callable[[], Any]:
    """Return what fits a plane with scipy, and no more."""
    from scipy.linalg import lstsq

    def level() -> Any:
        y, x = np.nonzero(surface.measured)
        columns = np.stack([np.ones(len(x)), x, y], axis=1)
        z_m = surface.height_m[y, x]
        return z_m - columns @ lstsq(columns, z_m)[0]

    return level


def detrend(surface: HeightMap) -> Callable[[], Any]:
    """Return what removes the plane with SurfaceTopography."""
    topography = importlib.import_module("SurfaceTopography").Topography
    height_m = np.ma.masked_invalid(surface.height_m)
    return lambda: topography(height_m, surface.side_m).detrend("height").heights()


def watershed(surface: HeightMap) -> Callable[[], Any]:
    """Return what floods the points above the cut with scikit-image."""
    from skimage import segmentation

    above = _above(surface)
    filled_m = np.where(above, surface.height_m, 0.0)
    return lambda: segmentation.watershed(-filled_m, mask=above, connectivity=2)


def regionprops(surface: HeightMap) -> Callable[[], Any]:
    """Return what measures connected regions with scikit-image."""
    from skimage.measure import label, regionprops_table

    labels = label(_above(surface), connectivity=2)
    wanted = ("area", "centroid", "equivalent_diameter_area", "intensity_max")
    return lambda: regionprops_table(labels, surface.height_m, properties=wanted)


def _above(surface: HeightMap) -> np.ndarray:
    return np.asarray(surface.height_m >= np.nanquantile(surface.height_m, 0.9))
