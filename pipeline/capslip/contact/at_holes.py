"""Contacts of a pressed map that go on in a hole of it."""

import math

import numpy as np

from capslip.contact.solvers.pressed import Pressed
from capslip.surface.holes import HIDDEN
from capslip.surface.outline import between


def load_at_holes(pressed: Pressed, measured: np.ndarray) -> float:
    """Return the share of the load on contacts of which a part lies in a hole of the map.

    Such a part is farther from all measured points than a quarter of the radius of the contact, and
    at most half of that beside the contact.

    Parameters
    ----------
    pressed : Pressed
    measured : bool, shape (ny, nx)

    Examples
    --------
    The units of load and pixels do not matter; the second of two contacts goes on in a hole.

    >>> pressure_Pa = np.zeros((9, 30))
    >>> pressure_Pa[2:7, [2, 3, 4, 5, 6, 17, 18, 19, 20]] = 1.0
    >>> measured = np.ones((9, 30), dtype=bool)
    >>> measured[1:8, 21:28] = False
    >>> pressed = Pressed(45.0, 1.0, pressure_Pa, 0 * pressure_Pa, (1.0, 1.0), None)
    >>> round(load_at_holes(pressed, measured), 3)
    0.444
    """
    from scipy.ndimage import binary_dilation, distance_transform_edt, find_objects

    hole = between(measured)
    if not hole.any():
        return 0.0
    region, size_m, share = pressed.region, pressed.pixel_size_m, 0.0
    load_N, boxes = pressed.region_loads_N, find_objects(region)
    for k in np.unique(region[binary_dilation(hole, np.ones((3, 3)))]):
        if k == 0:
            continue
        radius_m = math.sqrt(pressed.region_pixels[k - 1] * math.prod(size_m) / math.pi)
        beside = [1 + math.ceil(radius_m / one_m) for one_m in size_m]
        at = tuple(
            slice(max(0, box.start - n), box.stop + n)
            for box, n in zip(boxes[k - 1], beside, strict=True)
        )
        unknown_m = distance_transform_edt(~measured[at], sampling=size_m)
        away_m = distance_transform_edt(region[at] != k, sampling=size_m)
        part_m = unknown_m[hole[at] & (away_m <= 0.5 * radius_m + max(size_m))]
        if part_m.max(initial=0.0) > max(HIDDEN * radius_m, *size_m):
            share += float(load_N[k - 1])
    return share / float(load_N.sum())
