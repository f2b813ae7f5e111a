"""A pressed face under another load or with another hardness, at next to no cost."""

import math
from dataclasses import dataclass, replace

import numpy as np

from capslip.contact.solvers.detail import FirstLoading
from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.patches import PatchedFace
from capslip.contact.solvers.pixels import alone_on, around_contact, points_alone
from capslip.contact.solvers.polonsky_keer import first_loading, press
from capslip.contact.solvers.pressed import Pressed
from capslip.contact.solvers.starts import Known, start_Pa

_TOLERANCE = 1e-5  # of a first loading, whose state is used for quotients alone
_ROUGHLY = 1e-4  # the same where only what touches is asked
_MOSTLY, _SPARE = 0.5, 2.0  # of the hardness: mean pressure; of the contact that load adds
_LEAST_PA = 1e-300  # stands for no pressure below a fraction
_LEFT, _LOOSEST, _FINEST = 1e-1, 1e-4, 1e-9  # of the loss, that gaps may be; tolerances below it


@dataclass(frozen=True)
class Nearby:
    """What slip asks of a face under a load: its approach, and one partial withdrawal."""

    approach_m: float
    withdrawal_m: float
    loss_J: float


def nearby(
    first: FirstLoading,
    pressed: Pressed,
    punch_Pa_per_m: np.ndarray,
    changes: list[tuple[float, float]],
    share: float,
    finest: int = 1,
) -> list[Nearby]:
    """Return the states of a face after other first loadings than the one that is known.

    The first is the known one itself. Solved on the points alone that touch under the greatest
    load, on the least hardness: otherwise no others do. Each change is one solution from the known
    pressures, and one of what is left when the share of the load is gone, whose loss follows as in
    `unloading.unload`.

    Parameters
    ----------
    first : FirstLoading
        The face before any load, with its hardness.
    pressed : Pressed
        Its state under the known load, from which it unloads.
    punch_Pa_per_m : float64, shape (ny, nx)
        dp/dd under that load.
    changes : list of (float, float)
        Factors on the load and on the hardness.
    share : float
        Of the load, between 0 and 1.
    finest : int
        Points along the side of a pixel that follow its slip, see `refinement`.

    Raises
    ------
    ContactError
        If a solution fails.
    """
    face, (touching, widest_Pa) = first.face, _touching(first, pressed, changes)
    alone = _alone(face, touching, finest)
    known_Pa, punch = (alone.gathered(one) for one in (pressed.pressure_Pa, punch_Pa_per_m))
    total_Pa = (1.0 - share) * pressed.load_N / face.pixel_area_m2
    above, end = Known(0.0, known_Pa), Known(pressed.approach_m, np.zeros(alone.shape))
    part = start_Pa(total_Pa, punch, above, end) / np.maximum(known_Pa, _LEAST_PA)
    found: list[Nearby] = []
    for of_load, of_hardness in [(1.0, 1.0), *changes]:
        face_i = replace(alone, hardness_Pa=face.hardness_Pa * of_hardness)
        begin_Pa, load_N = known_Pa * of_load, pressed.load_N * of_load
        if of_load > 1.0 and widest_Pa is not None:
            begin_Pa = alone.gathered(widest_Pa)
        state = press(face_i, load_N=load_N, tolerance=_TOLERANCE, start_Pa=begin_Pa)
        one, left_Pa = _unloaded(*first_loading(face_i, state), part, share)
        if not found:  # the others keep about the same part of their pressures
            part = left_Pa / np.maximum(state.pressure_Pa, _LEAST_PA)
        found.append(one)
    return found


def _touching(
    first: FirstLoading, pressed: Pressed, changes: list[tuple[float, float]]
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the points that may touch after any of the changes, bool, shape (ny, nx).

    Less hardness makes less touch than as much more load does. The approach grows by no more than
    the load, as more and more touches, and the gap of a point falls by no more than that. Where
    most of the load rests on points at the hardness, contact grows as the load, by the points that
    stand clear by least: twice as many are taken. Else also returns the pressures under the
    greatest load, roughly.
    """
    face, contact = first.face, pressed.pressure_Pa > 0.0
    most = max(load / hardness for load, hardness in (*changes, (1.0, 1.0)))
    if most == 1.0:
        return contact, None
    may_touch = (pressed.gap_m < (most - 1.0) * first.approach_m) & face.measured & ~contact
    if pressed.pressure_Pa[contact].mean() > _MOSTLY * face.hardness_Pa:
        gap_m = pressed.gap_m[may_touch]
        count = math.ceil(_SPARE * (most - 1.0) * np.count_nonzero(contact))
        if count < gap_m.size:
            may_touch &= pressed.gap_m <= np.partition(gap_m, count)[count]
        return contact | may_touch, None
    alone = _alone(face, contact | may_touch)
    begin_Pa = np.minimum(alone.gathered(pressed.pressure_Pa) * most, face.hardness_Pa)
    widest = press(alone, load_N=most * pressed.load_N, tolerance=_ROUGHLY, start_Pa=begin_Pa)
    widest_Pa = alone.spread(widest.pressure_Pa)
    return contact | (widest_Pa > 0.0), widest_Pa


def _alone(face: ElasticFace, points: np.ndarray, finest: int = 1) -> PatchedFace:
    """Return some points of a map alone, bool, shape (ny, nx); refined ones with a margin."""
    around = around_contact(face, points, finest)
    if around is not None and around.refinement > 1:
        return around  # a hill may touch between its pixels
    return alone_on(face, points, around)


def _unloaded(
    face: ElasticFace, state: Pressed, part: np.ndarray, share: float
) -> tuple[Nearby, np.ndarray]:
    """Return what a share of the load takes from an elastic face, and the pressures it leaves.

    What the state leaves of a gap between points that touch is taken for height: so its pressures
    are exact, and the loss, a small difference of two states, is that of a face all but the same.
    """
    at = np.flatnonzero(state.pressure_Pa)
    touching, pressure_Pa = points_alone(face, at), state.pressure_Pa[at]
    touching = replace(touching, depth_m=touching.depth_m - state.gap_m[at])
    gone = 1.0 - (1.0 - share) ** (2.0 / 3.0)  # of the approach, in a Hertz contact
    left = press(
        touching,
        load_N=(1.0 - share) * state.load_N,
        tolerance=max(min(_LOOSEST, _LEFT * gone**3 / 8.0), _FINEST),
        start_Pa=pressure_Pa * part[at],
    )
    open_m = np.where(left.pressure_Pa > 0.0, 0.0, np.maximum(left.gap_m, 0.0))
    loss_J = 4.0 * float(pressure_Pa @ open_m) * face.pixel_area_m2
    left_Pa = np.zeros(face.shape)
    left_Pa[at] = left.pressure_Pa
    return Nearby(state.approach_m, state.approach_m - left.approach_m, loss_J), left_Pa
