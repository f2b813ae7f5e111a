"""Hills of any shape, with no more around them than a fit asks for."""

from types import SimpleNamespace

import numpy as np

from capslip.caps.points import points_of_hills
from capslip.surface.heightmap import HeightMap


def hills_of(height_m, label, cut_m=0.0, pixel_m=(1.0, 1.0)):
    """Return a map, its hills, numbered as in `label`, and their points."""
    surface = HeightMap(height_m, pixel_m)
    label = np.asarray(label).astype(np.int32)
    hills = SimpleNamespace(label=label, n_hills=int(label.max()), cut_height_m=cut_m)
    return surface, hills, points_of_hills(surface, hills)


def bowl_m(shape, centre_m, radius_m, pixel_m=(1.0, 1.0)):
    """Return a paraboloid of a radius, upside down, with its apex at (y, x) and at zero."""
    y, x = (np.mgrid[: shape[0], : shape[1]] + 0.5) * np.array(pixel_m)[:, None, None]
    return -((y - centre_m[0]) ** 2 + (x - centre_m[1]) ** 2) / (2.0 * radius_m)
