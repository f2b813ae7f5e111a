"""The loads that decide at which depth a cap is fitted."""

import numpy as np

from capslip.caps.table import CapTable
from capslip.contact.material import composite, yield_law
from capslip.contact.reach import reachable
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.settings import Settings
from capslip.surface.heightmap import HeightMap


def press_for_depth(caps: CapTable, surface: HeightMap, settings: Settings) -> CapTable:
    """Fill in the loads and contact radii that decide at which depth a cap is fitted.

    Interacting caps, those alone that can touch; the mean field where they are too many.

    Parameters
    ----------
    caps : CapTable
        Caps of one face, at least one of them usable.
    surface : HeightMap
        The face.
    settings : Settings
        `material` and `contact`.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload.
    """
    material, preload_N = settings.material, settings.contact.preload_N
    E_star_Pa = composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa
    reach = reachable(caps, surface, E_star_Pa, preload_N, yield_law(material))
    load_N, radius_m = np.where(caps.usable, 0.0, np.nan), caps.radius_m.copy()
    load_N[reach.use] = reach.curve.asperity_loads_N(reach.curve.approach_m(preload_N))
    radius_m[reach.use] = reach.curve.radius_m
    a_m = contact_radius_m(load_N, radius_m, E_star_Pa)
    return caps.with_columns(load_N=load_N, contact_radius_m=a_m)
