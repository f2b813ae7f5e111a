"""Tables of caps and states made by hand, which several tests of contact share."""

from dataclasses import fields, replace

import numpy as np

from capslip.caps.families import group_families
from capslip.caps.table import CapTable
from capslip.contact.material import composite
from capslip.contact.press import ContactState
from capslip.contact.rung import Scene
from capslip.surface.heightmap import HeightMap

E_STAR_PA = composite((200e9, 200e9), (0.3, 0.3)).E_star_Pa


def table(x_m, y_m, radius_m, peak_height_m, **columns):
    """Perfect spheres on hills far wider and deeper than their contacts."""
    n = len(x_m)
    every = {field.name: np.zeros(n) for field in fields(CapTable)}
    every |= {"x_m": x_m, "y_m": y_m, "radius_m": radius_m, "peak_height_m": peak_height_m}
    every |= {"diameter_m": np.ones(n), "cap_height_m": np.ones(n), "fit_depth_m": np.ones(n)}
    every |= {"family": np.full(n, "G"), "flags": np.zeros(n, np.uint16)}
    return CapTable(**{name: np.asarray(column) for name, column in (every | columns).items()})


def scene_of(caps, preload_N, side_m=(0.04, 0.06)):
    """Return the caps, all of them in use, on a flat face."""
    face = HeightMap(np.zeros((20, 30)), (side_m[0] / 20, side_m[1] / 30))
    families = group_families(caps)[1]
    middle_m = (0.5 * side_m[1], 0.5 * side_m[0])
    held = (middle_m, np.inf)
    return Scene(caps, families, face, E_STAR_PA, preload_N, caps.usable, 1e-7, *held)


def state_of(**known):
    """Return a state of which nothing else is known."""
    empty = ContactState(**dict.fromkeys((f.name for f in fields(ContactState)), None))
    return replace(empty, **known)
