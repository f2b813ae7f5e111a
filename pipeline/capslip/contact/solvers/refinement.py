"""How fine a spline of a map must be to follow the slip of its contacts."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.patches import MOST_OF_ROUGH, Spline
from capslip.contact.solvers.pressed import Pressed, hardly_yields

# Pixels across a contact, see `Pressed.pixels_across`: the map is refined where they are fewer than
# the first, to the second; then the energy at a tenth of mu N is off by 1 %, and not by 2 to 9.
WIDE_ENOUGH, _WIDE = 35, 75
_MOST_REFINED = 6
_OF_FLATS = 2  # times as many where a load has left flats: next to nothing of their edges lets go
# Pixels in contact: of fewer, as much finer a spline as has no more points there than six a side of
# these have. Energy at a tenth of mu N is right to 1 % in the median then, of six a side to 10 %
_FEW_PIXELS = 280
# Of the variance that differences of half the order find, what those of the whole one do: 1 of
# noise, 0.93 of a random walk from pixel to pixel, less of all that is smoother; halfway
_AS_NOISE = 0.965
_HARDLY_NOISE = 0.1  # the same, up to which next to none is: the fifth degree swings with noise
# Over the median of the roughness: the greatest of up to 3,000 points in contact is at most 5.6 on
# rough faces; of a step it has no bound
_STANDS_OFF = 10.0
_SWING = 2.0  # of the roughness, that a spline may swing: the greatest of many pixels is at 4.5
# What a map that may be refined has of white noise at most, of the approach, and the order of the
# differences that know it: waves of 4 pixels, which a spline follows to 1 %, give them 0.14
SMOOTH, _ORDER = 0.0055, 8
_SMOOTH_OF_FLATS = 0.03  # the same where flats are: these do not care what was there before
_RINGING = 2.0 - math.sqrt(3.0)  # how a cubic spline's swing falls from pixel to pixel
_OF_FIFTH = 0.430575  # the same of a spline of the fifth degree
# What a spline may swing at the end of a smooth contact, of the step there from pixel to pixel
_OF_STEP = 0.05
_SEEN = 8  # pixels beside a contact, beyond which nothing makes a spline swing there


def refinement(face: ElasticFace, pressed: Pressed) -> int:
    """Return how many points along the longer side of a pixel follow the slip of a contact.

    One where the contacts are wide enough, or a spline does not know what lies between the pixels:
    where a pit or step in or beside them makes it swing, and where heights are as noise is.

    Where a load has left flats, whose edges it would round, the face before that load counts.
    """
    finer = _OF_FLATS if _has_flats(face, pressed) else 1
    across = pressed.pixels_across / finer
    if across >= WIDE_ENOUGH:
        return 1
    shape = _roughness(face, pressed)
    face = face.before or face
    if not shape.smooth and (
        math.isinf(shape.most_m)
        or _rings(shape.noise_m2, pressed, shape.most_m)
        or _noise_share(face, pressed) > _AS_NOISE
    ):
        return 1
    most = MOST_OF_ROUGH
    if shape.smooth:
        n_pixels = int(np.count_nonzero(pressed.pressure_Pa))
        most = int(_MOST_REFINED * finer * math.sqrt(max(_FEW_PIXELS / n_pixels, 1.0)))
    return min(most, int(np.ceil(_WIDE / across)))


def spline_of(face: ElasticFace, pressed: Pressed) -> Spline:
    """Return the degree of the spline that knows best what lies between the pixels of contacts.

    The fifth follows waves of 5 to 8 pixels ten times closer than the third does, which leaves up
    to 6 % in the energy at a tenth of mu N on contacts of few of them. It swings further with noise
    (13 times as much half a pixel beyond the last one, the third 4 times) and beside what is not
    smooth: there, beside lost points, and where a load has left flats, the third.
    """
    from scipy.ndimage import maximum_filter

    if _has_flats(face, pressed):
        return "third"
    window = face.measured_window  # a margin that was not measured is an edge as that of the map
    if not face.measured[window].all():
        near = maximum_filter(pressed.pressure_Pa[window] > 0, 2 * _SEEN + 1)
        if not face.measured[window][near].all():
            return "third"
    shape = _roughness(face, pressed)
    most_m = shape.most_m * _OF_FIFTH / _RINGING  # as much beside a contact as lets it be refined
    if not shape.smooth or _rings(shape.noise_m2, pressed, most_m, _OF_FIFTH):
        return "third"
    return "fifth" if _noise_share(face, pressed) <= _HARDLY_NOISE else "third"


class _Roughness(NamedTuple):
    """What white noise in the heights could be, and what a spline may swing in the contacts."""

    noise_m2: np.ndarray  # (ny, nx), the mean of the axes that know it; NaN in corners of the map
    greater_m2: np.ndarray  # (ny, nx), the greater of them
    smooth: bool
    most_m: float  # infinite where no axis knows a contact, or a step stands off all else


def _has_flats(face: ElasticFace, pressed: Pressed) -> bool:
    """Tell whether a load has left flats that bear more than next to nothing of it."""
    before = face.before
    return before is not None and not hardly_yields(pressed, before.hardness_Pa)


def _roughness(face: ElasticFace, pressed: Pressed) -> _Roughness:
    """Return it of a face as it was before it yielded."""
    smooth = _SMOOTH_OF_FLATS if _has_flats(face, pressed) else SMOOTH
    if face.before is not None:  # its approach was what is left, and by how much it lost height
        lost_m = np.max(face.before.depth_m - face.depth_m, where=face.measured, initial=0.0)
        pressed = replace(pressed, approach_m=pressed.approach_m + lost_m)
        face = face.before
    # Where a depth was lost none of them counts: there a refined face goes on smoothly
    contact = pressed.pressure_Pa > 0
    # Along an edge of the map one axis knows it, and contacts there are the narrowest of all
    axes_m2 = [face.white_m2(_ORDER, axis) for axis in (0, 1)]
    greater_m2, less_m2 = np.fmax(*axes_m2), np.fmin(*axes_m2)
    noise_m2 = 0.5 * (greater_m2 + less_m2)
    rough_m, smooth_m = _rms_m(noise_m2, contact), smooth * pressed.approach_m
    step_m = pressed.approach_m / (0.5 * pressed.pixels_across)  # at the end of a Hertz contact
    if (rough_m <= smooth_m or _beside_edges_m(face, contact) <= smooth_m) and (
        not _rings(noise_m2, pressed, smooth_m)
        or _swing_m(face, pressed) <= max(smooth_m, _OF_STEP * step_m)
    ):
        return _Roughness(noise_m2, greater_m2, True, smooth_m)
    inside = contact & np.isfinite(noise_m2)
    if inside.any() and noise_m2[inside].max() > _STANDS_OFF**2 * np.median(noise_m2[inside]):
        rough_m = math.inf
    return _Roughness(noise_m2, greater_m2, False, max(smooth_m, _SWING * rough_m))


def _beside_edges_m(face: ElasticFace, contact: np.ndarray) -> float:
    """Return the roughness by differences of half the order, which end before a hill does."""
    axes_m2 = (face.white_m2(_ORDER // 2, axis) for axis in (0, 1))
    return _rms_m(np.fmax(*axes_m2), contact)


def _rms_m(square_m2: np.ndarray, contact: np.ndarray) -> float:
    """Return the root of the mean over the contact, where it is known; infinite where nowhere."""
    inside = contact & np.isfinite(square_m2)
    return math.sqrt(square_m2[inside].mean()) if inside.any() else math.inf


def _noise_share(face: ElasticFace, pressed: Pressed) -> float:
    """Return how much the heights about the contacts change from pixel to pixel as noise does.

    What differences of the whole order find of the variance that those of half of it do.

    All differences count that a contact takes part in: those about its highest points alone would
    be greater, the more so the lower their order.
    """
    from scipy.ndimage import binary_dilation

    short_m2 = long_m2 = 0.0
    for axis, shape in ((0, (_ORDER + 1, 1)), (1, (1, _ORDER + 1))):
        of_short, of_long = (face.white_m2(order, axis) for order in (_ORDER, _ORDER // 2))
        near = binary_dilation(pressed.pressure_Pa > 0, np.ones(shape))
        near &= np.isfinite(of_short) & np.isfinite(of_long)
        short_m2 += float(of_short[near].sum())
        long_m2 += float(of_long[near].sum())
    return short_m2 / long_m2 if long_m2 > 0.0 else 0.0


def touches_between(face: ElasticFace, pressed: Pressed) -> np.ndarray:
    """Return the points off the contact in whose pixels a refined face may touch nevertheless.

    There the gap is less than about them and, along each axis, so little that the parabola through
    three neighbours falls as much within the pixel; at an edge of what was measured, half a pixel
    of the way to the one neighbour. Twice that counts, as both axes may go together and the points
    that a refinement adds move the level: what is taken too many rests without pressure. Where a
    spline swings because of a pit, a step or a spike, by more than a part of how the hill bends,
    none counts.

    Returns
    -------
    bool, shape (ny, nx)
    """
    gap_m, contact = pressed.gap_m, pressed.pressure_Pa > 0
    falls_m, bends_m, least = *np.zeros((2, *gap_m.shape)), face.measured & ~contact & (gap_m > 0)
    known_m = gap_m if face.measured.all() else np.where(face.measured, gap_m, np.nan)
    for axis in (0, 1):
        step_m = np.diff(known_m, axis=axis)
        none = np.full_like(known_m.take([0], axis=axis), np.nan)
        before_m = np.concatenate((none, -step_m), axis=axis)  # how much higher the neighbours are
        after_m = np.concatenate((step_m, none), axis=axis)
        ends = np.isnan(before_m) | np.isnan(after_m)
        before_m, after_m = np.nan_to_num(before_m), np.nan_to_num(after_m)
        least &= (before_m >= 0) & (after_m >= 0)
        bend_m = np.maximum(before_m + after_m, np.finfo(float).tiny)
        bends_m += 0.5 * bend_m
        falls_m += np.where(ends, 0.5 * bend_m, np.square(before_m - after_m) / (8 * bend_m))
    found = np.nonzero(least & (gap_m < 2 * falls_m))
    touches = np.zeros(gap_m.shape, dtype=bool)
    if found[0].size:
        shape = _roughness(face, pressed)
        may_swing_m = np.maximum(shape.most_m, _OF_STEP * bends_m[found])
        touches[found] = _swings_m(shape, found) <= may_swing_m
    return touches


def _swings_m(shape: _Roughness, at: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return by how much a spline swings at pixels, shape (n,), see `_rings`.

    Because of the pixel about each that makes it swing the most there.
    """
    off_m = np.sqrt(np.nan_to_num(shape.greater_m2))
    off_m[off_m <= shape.most_m] = 0.0
    along = np.arange(-_SEEN, _SEEN + 1)
    around = sliding_window_view(np.pad(off_m, _SEEN), (along.size, along.size))[at]
    return (around * _RINGING ** np.hypot(along[:, None], along)).max(axis=(1, 2))


def _rings(
    square_m2: np.ndarray, pressed: Pressed, most_m: float, ringing: float = _RINGING
) -> bool:
    """Tell whether a spline swings by more in a contact because of a pit or a step beside it.

    What is off its neighbours at one pixel, squared, makes a cubic spline swing about it, by 0.27
    of that less at each pixel further on.
    """
    from scipy.ndimage import distance_transform_edt

    contact = pressed.pressure_Pa > 0
    rough = (np.sqrt(square_m2) > most_m) & ~contact
    if not rough.any():
        return False
    pixels = distance_transform_edt(~contact)[rough]
    return bool((np.sqrt(square_m2[rough]) * ringing**pixels > most_m).any())


def _swing_m(face: ElasticFace, pressed: Pressed) -> float:
    """Return by how much a spline swings in contacts that are smooth up to what is beside them.

    The second derivatives of a cubic spline, times the square of a pixel, are sqrt(3) times the sum
    of the second differences b, each times (-r)^k with its distance of k pixels, r = 2 - sqrt(3).
    So at the end of a contact those beside it add as much of what they differ from the last one in
    it, and between two pixels a spline is an eighth of that away.
    """
    contact, known_m, most_m = pressed.pressure_Pa > 0, face.known_m, 0.0
    k = np.arange(1, _SEEN + 1)
    weight = math.sqrt(3.0) * (-_RINGING) ** k
    for axis in (0, 1):
        if contact.shape[axis] < 3:
            continue
        # The ends of a map go on as they are
        around = [(1, 1) if one == axis else (0, 0) for one in (0, 1)]
        bend_m = np.pad(np.diff(known_m, 2, axis), around, mode="edge")
        along = np.moveaxis(bend_m, axis, 0), np.moveaxis(contact, axis, 0)
        for way in (1, -1):
            b_m, touches = (one[::way] for one in along)
            last, line = np.nonzero(touches[:-1] & ~touches[1:])
            beside = np.minimum(last[:, None] + k, len(b_m) - 1)
            more_m = b_m[beside, line[:, None]] - b_m[last, line][:, None]
            swing_m = np.abs(np.nan_to_num(more_m) @ weight)
            most_m = max(most_m, float(swing_m.max(initial=0.0)) / 8.0)
    return most_m
