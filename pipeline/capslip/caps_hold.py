"""Whether the caps of a pressed face are all that touches, where it bears another load."""

import numpy as np

from capslip.contact.certificate import certify_cut
from capslip.contact.material import yield_law
from capslip.contact.press import ContactState
from capslip.contact.reach import reachable
from capslip.errors import ContactError
from capslip.settings import Settings
from capslip.stages import Face


def caps_hold(face: Face, contact: ContactState, load_N: float, settings: Settings) -> bool:
    """Tell whether the caps of a pressed face are all that touches under another load.

    Nothing below the plane does. What reaches above it is sunk by the contacts, or is not: so the
    cut was found, see `certify_cut`. The caps of two maps have no place that could be looked at.
    """
    caps, surface = face.caps, face.conditioned.surface
    E_star_Pa, law = contact.composite.E_star_Pa, yield_law(settings.material)
    try:
        reach = reachable(caps, surface, E_star_Pa, load_N, law)
        approach_m = float(reach.curve.approach_m(load_N))
    except ContactError:
        return False
    each_N = reach.curve.asperity_loads_N(approach_m)
    loaded = each_N > 0.0
    touching = np.flatnonzero(reach.use)[loaded]
    if contact.rung.knows_places and not contact.use[touching].all():
        return False
    if reach.pairs is not None and reach.pairs.overlapping_pairs(approach_m):
        return False  # what lies between them touches
    plane_m = float(caps.peak_height_m[caps.usable].max()) - approach_m
    if plane_m >= face.hills.cut_height_m:
        return True
    if face.label is None:
        return False
    spheres = np.stack([caps.x_m[touching], caps.y_m[touching], reach.curve.radius_m[loaded]])
    of_face = surface, face.label, plane_m, spheres
    return certify_cut(*of_face, each_N[loaded], E_star_Pa, face.hills.noise_m) == 0.0
