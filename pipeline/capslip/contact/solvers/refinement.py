"""How fine a spline of a map must be to follow the slip of its contacts."""

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.polonsky_keer import Pressed

# Pixels across a contact, see `Pressed.pixels_across`: the map is refined where they are fewer than
# the first, to the second; then the energy at a tenth of mu N is off by 1 %, and not by 2 to 9.
_WIDE_ENOUGH, _WIDE = 35, 75
_MOST_REFINED = 6
# Roughness between neighbouring pixels of a map that may be refined, of the approach
_SMOOTH = 0.01
_RINGING = 0.27  # 2 - sqrt(3): how a cubic spline's swing falls from pixel to pixel


def refinement(face: ElasticFace, pressed: Pressed) -> int:
    """Return how many points along the side of a pixel follow the slip of a contact.

    One where the contacts are wide enough, or the map is rough from pixel to pixel: then no spline
    knows what lies between the pixels.
    """
    across = pressed.pixels_across
    if across >= _WIDE_ENOUGH:
        return 1
    # What half of the pixels say of the others; a spline through all of them is far nearer.
    depth_m = face.depth_m
    inside = np.zeros(face.shape, dtype=bool)
    inside[3:-3, 3:-3] = (pressed.pressure_Pa > 0)[3:-3, 3:-3]
    off_m = np.zeros(face.shape)
    for axis in (0, 1):
        near, far = (np.roll(depth_m, n, axis) + np.roll(depth_m, -n, axis) for n in (1, 3))
        off_m += np.square(depth_m - (9 * near - far) / 16)
    rough_m = np.sqrt(off_m[inside].mean()) if inside.any() else np.inf
    if rough_m > _SMOOTH * pressed.approach_m or _rings(off_m, pressed):
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
    for edge in (np.s_[:3], np.s_[-3:]):  # where the neighbours are those of the other side
        rough[edge] = rough[:, edge] = False
    if not rough.any():
        return False
    pixels = distance_transform_edt(~contact)[rough]
    return bool((np.sqrt(square_m2[rough]) * _RINGING**pixels > most_m).any())
