"""How fine a spline of a map must be to follow the slip of its contacts."""

import math

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
SMOOTH, _ORDER = 0.0055, 8
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
    if rough_m > SMOOTH * pressed.approach_m or _rings(noise_m2, pressed):
        return 1
    return min(_MOST_REFINED, int(np.ceil(_WIDE / across)))


def touches_between(face: ElasticFace, pressed: Pressed) -> np.ndarray:
    """Return the points off the contact in whose pixels a smooth face may touch nevertheless.

    There the gap is less than about them and, along each axis, so little that the parabola through
    three neighbours falls as much within the pixel; at an edge of the map, half a pixel of the way
    to the one neighbour. Twice that counts, as both axes may go together and the points that a
    refinement adds move the level: what is taken too many rests without pressure. Where a spline
    swings because of a pit, a step or a spike, none counts.

    Returns
    -------
    bool, shape (ny, nx)
    """
    gap_m, contact = pressed.gap_m, pressed.pressure_Pa > 0
    falls_m, least = np.zeros(gap_m.shape), face.measured & ~contact & (gap_m > 0)
    for axis in (0, 1):
        step_m = np.diff(gap_m, axis=axis)
        none = np.zeros_like(gap_m.take([0], axis=axis))
        before_m = np.concatenate((none, -step_m), axis=axis)  # how much higher the neighbours are
        after_m = np.concatenate((step_m, none), axis=axis)
        least &= (before_m >= 0) & (after_m >= 0)
        bend_m = np.maximum(before_m + after_m, np.finfo(float).tiny)
        fall_m = np.square(before_m - after_m) / (8 * bend_m)
        ends_m = np.moveaxis(fall_m, axis, 0)
        ends_m[[0, -1]] = 0.5 * np.moveaxis(before_m + after_m, axis, 0)[[0, -1]]
        falls_m += fall_m
    found = least & (gap_m < 2 * falls_m)
    return found & ~_swings(face, pressed) if found.any() else found


def _swings(face: ElasticFace, pressed: Pressed) -> np.ndarray:
    """Tell where a spline may swing because of what is off its neighbours, as `_rings` has it."""
    from scipy.ndimage import distance_transform_edt

    most_m = SMOOTH * pressed.approach_m
    # Along an edge of the map one axis knows it; in a corner of four pixels none does
    off_m = np.sqrt(np.fmax(*(white_m2(face.depth_m, _ORDER, axis) for axis in (0, 1))))
    rough = off_m > most_m
    if not rough.any():
        return rough
    pixels = math.log(off_m[rough].max() / most_m) / -math.log(_RINGING)
    return np.asarray(distance_transform_edt(~rough) <= pixels)


def _rings(square_m2: np.ndarray, pressed: Pressed) -> bool:
    """Tell whether a spline swings in a contact because of a pit or a step beside it.

    What is off its neighbours at one pixel, squared, makes a cubic spline swing about it, by 0.27
    of that less at each pixel further on.
    """
    from scipy.ndimage import distance_transform_edt

    contact, most_m = pressed.pressure_Pa > 0, SMOOTH * pressed.approach_m
    rough = (np.sqrt(square_m2) > most_m) & ~contact
    if not rough.any():
        return False
    pixels = distance_transform_edt(~contact)[rough]
    return bool((np.sqrt(square_m2[rough]) * _RINGING**pixels > most_m).any())
