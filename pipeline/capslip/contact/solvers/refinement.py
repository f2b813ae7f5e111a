"""How fine a spline of a map must be to follow the slip of its contacts."""

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.polonsky_keer import Pressed
from capslip.contact.solvers.whiteness import white_m2

# Pixels across a contact, see `Pressed.pixels_across`: the map is refined where they are fewer than
# the first, to the second; then the energy at a tenth of mu N is off by 1 %, and not by 2 to 9.
_WIDE_ENOUGH, _WIDE = 35, 75
_MOST_REFINED = 6
# What a map that may be refined has of white noise at most, of the approach, and the order of the
# differences that know it: waves of 4 pixels, which a spline follows to 1 %, give them 0.14
_SMOOTH, _ORDER = 0.0055, 8
_RINGING = 0.27  # 2 - sqrt(3): how a cubic spline's swing falls from pixel to pixel


def refinement(face: ElasticFace, pressed: Pressed) -> int:
    """Return how many points along the side of a pixel follow the slip of a contact.

    One where the contacts are wide enough, or the map is rough from pixel to pixel: then no spline
    knows what lies between the pixels.
    """
    across = pressed.pixels_across
    if across >= _WIDE_ENOUGH:
        return 1
    noise_m2 = 0.5 * (white_m2(face.depth_m, _ORDER, 0) + white_m2(face.depth_m, _ORDER, 1))
    inside = (pressed.pressure_Pa > 0) & np.isfinite(noise_m2)
    rough_m = np.sqrt(noise_m2[inside].mean()) if inside.any() else np.inf
    if rough_m > _SMOOTH * pressed.approach_m or _rings(noise_m2, pressed):
        return 1
    return min(_MOST_REFINED, int(np.ceil(_WIDE / across)))


def _rings(square_m2: np.ndarray, pressed: Pressed) -> bool:
    """Tell whether a spline swings in a contact because of a pit or a step beside it.

    What is off its neighbours at one pixel, squared, makes a cubic spline swing about it, by 0.27
    of that less at each pixel further on.
    """
    from scipy.ndimage import distance_transform_edt

    contact, most_m = pressed.pressure_Pa > 0, _SMOOTH * pressed.approach_m
    rough = (np.sqrt(square_m2) > most_m) & ~contact
    if not rough.any():
        return False
    pixels = distance_transform_edt(~contact)[rough]
    return bool((np.sqrt(square_m2[rough]) * _RINGING**pixels > most_m).any())
