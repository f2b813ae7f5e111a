"""A pressed face under another load or with another hardness, at next to no cost."""

from dataclasses import dataclass, replace

import numpy as np

from capslip.contact.solvers.detail import FirstLoading
from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.metal import first_loading
from capslip.contact.solvers.patches import PatchedFace
from capslip.contact.solvers.pixels import SINGLE, alone_on, around_contact, points_alone
from capslip.contact.solvers.polonsky_keer import press
from capslip.contact.solvers.pressed import Pressed, hardly_yields
from capslip.contact.solvers.sinking import Sunk, sunk_in
from capslip.contact.solvers.starts import Known, start_Pa

_MOSTLY, _SPARE = 0.5, 2.0  # of the hardness: mean pressure; of the contact that load adds
_MOST_LOOKS = 4  # at what more load makes touch
_LEAST_PA = 1e-300  # stands for no pressure below a fraction
_LEFT, _LOOSEST, _FINEST = 5e-2, 1e-4, 1e-9  # of the loss, that gaps may be; tolerances below it
_OF_FLATS = 0.3  # of such a tolerance, where flats are: they lose less than a Hertz contact


@dataclass(frozen=True)
class Nearby:
    """What slip asks of a face under a load: its approach, and one partial withdrawal."""

    approach_m: float
    share: float  # of the load, that is gone
    withdrawal_m: float  # then
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

    Solved on the points alone that touch under the greatest load, on the least hardness: otherwise
    no others do. Each change is one solution from the known pressures, and one of what is left when
    the share of the load is gone, whose loss follows as in `unloading.unload`.

    Where hardly a point yields, the face comes back to the known state as more load goes: then this
    is the partial withdrawal, of another share, whose loss follows from the two without a solution.

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
        Points along the longer side of a pixel that follow its slip, see `refinement`.

    Raises
    ------
    ContactError
        If a solution fails.
    """
    face = first.sunk
    # Two solutions make a loss; of the approach only the elastic part is withdrawn
    counts = min(pressed.approach_m / first.approach_m, 1.0)
    yields = not np.isinf(face.hardness_Pa)
    tolerance = max(0.5 * counts * _enough(share, yields), _FINEST)
    most = max(load / hardness for load, hardness in (*changes, (1.0, 1.0)))
    alone, widest = _reached(first, pressed, punch_Pa_per_m, most, tolerance)
    if finest > 1:
        alone, widest = _alone(face, _touching(pressed, alone, widest), tolerance, finest), None
    known_Pa, gap_m, punch = (
        alone.gathered(one) for one in (pressed.pressure_Pa, pressed.gap_m, punch_Pa_per_m)
    )
    total_Pa = (1.0 - share) * pressed.load_N / face.pixel_area_m2
    above, end = Known(0.0, known_Pa), Known(pressed.approach_m, np.zeros(alone.shape))
    part = start_Pa(total_Pa, punch, above, end) / np.maximum(known_Pa, _LEAST_PA)
    area_m2 = face.pixel_area_m2
    known = None
    if first.deeper is not None:
        deeper_m, contact = (
            alone.gathered(one) for one in (first.deeper.deeper_m, first.deeper.contact)
        )
        known = replace(first.deeper, deeper_m=deeper_m, contact=contact)
    found: list[Nearby] = []
    for of_load, of_hardness in changes:
        face_i = replace(alone, hardness_Pa=face.hardness_Pa * of_hardness)
        state = widest
        if state is None or (of_load, of_hardness) != (most, 1.0):
            begin_Pa = _begin_Pa(face, known_Pa, punch, of_load, of_hardness)
            load_N = of_load * pressed.load_N
            state = press(
                face_i, load_N=load_N, tolerance=tolerance, start_Pa=begin_Pa, sinks_once=True
            )
        sunk_i, state, lower_m = _sunk_in(face_i, state, known, tolerance)
        elastic, loaded = first_loading(sunk_i, state)
        comes_back = finest == 1 and of_load > 1.0 and hardly_yields(pressed, face.hardness_Pa)
        if comes_back and hardly_yields(state, face_i.hardness_Pa):
            lost = float(loaded.pressure_Pa @ gap_m - known_Pa @ loaded.gap_m)
            back_m, loss_J = state.approach_m + lower_m - first.approach_m, 4.0 * lost * area_m2
            found.append(Nearby(loaded.approach_m, 1.0 - 1.0 / of_load, back_m, loss_J))
            continue
        one, left_Pa = _unloaded(elastic, loaded, part, share)
        part = left_Pa / np.maximum(state.pressure_Pa, _LEAST_PA)  # about the same after another
        found.append(one)
    return found


def _sunk_in(
    alone: PatchedFace, state: Pressed, known: Sunk | None, tolerance: float
) -> tuple[ElasticFace, Pressed, float]:
    """Return points alone, sunk as deep as metal does under another load, and their state.

    They lie lower by what is known already. And how much lower they first touch.
    """
    as_found = alone
    if known is not None:
        as_found = replace(alone, depth_m=alone.depth_m - known.deeper_m)

    def again(face: ElasticFace, near: Pressed) -> Pressed:
        return press(
            face,
            load_N=state.load_N,
            tolerance=tolerance,
            start_Pa=near.pressure_Pa,
            sinks_once=True,
        )

    found, sunk = sunk_in(as_found, state, again, known)
    if sunk is None or found is state:
        return alone, state, 0.0
    lower_m = float((as_found.depth_m + sunk.deeper_m).min())
    return as_found.lowered(sunk.deeper_m), found, lower_m


def loaded_anew(
    first: FirstLoading,
    pressed: Pressed,
    punch_Pa_per_m: np.ndarray,
    change: tuple[float, float],
    tolerance: float,
    time_limit_s: float,
) -> tuple[ElasticFace, Pressed, Sunk | None]:
    """Return a face with another hardness, and its state under another first load, on all points.

    And how much deeper its contacts sink, see `sunk_in`.

    Under no more load for the hardness no other points touch: then it is solved on these alone
    before, so that what is left for the whole map is next to nothing.

    Parameters
    ----------
    first, pressed, punch_Pa_per_m
        As for `nearby`.
    change : (float, float)
        Factors on the load and on the hardness.
    tolerance, time_limit_s
        As for `polonsky_keer.press`.

    Raises
    ------
    ContactError
        If a solution fails.
    """
    of_load, of_hardness = change
    load_N, hardness_Pa = of_load * pressed.load_N, of_hardness * first.face.hardness_Pa
    face = replace(first.face, hardness_Pa=hardness_Pa)
    sunk = first.sunk
    begin_Pa = _begin_Pa(sunk, pressed.pressure_Pa, punch_Pa_per_m, of_load, of_hardness)
    if of_load <= of_hardness:
        alone = replace(_alone(sunk, pressed.pressure_Pa > 0.0, tolerance), hardness_Pa=hardness_Pa)
        start_Pa = alone.gathered(begin_Pa)
        left = press(alone, load_N=load_N, tolerance=tolerance, start_Pa=start_Pa, sinks_once=True)
        begin_Pa = alone.spread(left.pressure_Pa)

    def again(face: ElasticFace, near: Pressed | None = None) -> Pressed:
        return press(
            face,
            load_N=load_N,
            tolerance=tolerance,
            start_Pa=begin_Pa if near is None else near.pressure_Pa,
            time_limit_s=time_limit_s,
        )

    return face, *sunk_in(face, again(first.lowered(face)), again, first.deeper)


def _reached(
    first: FirstLoading,
    pressed: Pressed,
    punch_Pa_per_m: np.ndarray,
    most: float,
    tolerance: float,
) -> tuple[PatchedFace, Pressed | None]:
    """Return the points that may touch under the greatest load, and their state under it.

    Less hardness makes less touch than as much more load does. More load closes gaps as a punch
    does that sinks as far as the contact is stiff; but where points yield, contact grows as the
    load, by those that stand clear by least. Twice as many are taken of either; what penetrates of
    the map all the same, too.
    """
    face, touching = first.sunk, pressed.pressure_Pa > 0.0
    if most == 1.0:
        return _alone(face, touching, tolerance), None
    may_touch = face.measured & ~touching
    gap_m, number = pressed.gap_m[may_touch], _SPARE * (most - 1.0) * np.count_nonzero(touching)
    closes_m = np.partition(gap_m, int(number))[int(number)] if number < gap_m.size else np.inf
    if not _mostly_yields(face, pressed.pressure_Pa):
        more_N = _SPARE * (most - 1.0) * pressed.load_N
        further_m = more_N / (float(punch_Pa_per_m.sum()) * face.pixel_area_m2)
        sunk = face.half_space.sinking_roughly_m(punch_Pa_per_m)[may_touch]
        closes_m = np.maximum(further_m * (1.0 - sunk), closes_m)
    touching[may_touch] = gap_m <= closes_m
    begin_Pa = _begin_Pa(face, pressed.pressure_Pa, punch_Pa_per_m, most)
    around = around_contact(face, touching, single=tolerance >= SINGLE)
    for _ in range(_MOST_LOOKS):
        alone = alone_on(face, touching, around)
        start = alone.gathered(begin_Pa)
        load_N = most * pressed.load_N
        widest = press(alone, load_N=load_N, tolerance=tolerance, start_Pa=start, sinks_once=True)
        begin_Pa = alone.spread(widest.pressure_Pa)
        gap_m = face.half_space.sinking_roughly_m(begin_Pa) + face.depth_m - widest.approach_m
        missed = (gap_m < -tolerance * widest.approach_m) & face.measured & ~touching
        if not missed.any():
            break
        touching |= missed
        if around is not None:
            missed.reshape(-1)[around.parent] = False
        if around is None or missed.any():
            around = around_contact(face, touching, single=tolerance >= SINGLE)
    return alone, widest


def _begin_Pa(
    face: ElasticFace,
    known_Pa: np.ndarray,
    punch_Pa_per_m: np.ndarray,
    of_load: float,
    of_hardness: float = 1.0,
) -> np.ndarray:
    """Return pressures near those of a state, from the known ones.

    What yields stays at its hardness, and the others carry the rest, as a punch; where most yields,
    all change alike.
    """
    hardness_Pa = face.hardness_Pa * of_hardness
    if _mostly_yields(face, known_Pa):
        return np.minimum(known_Pa * of_load, hardness_Pa)
    held = known_Pa >= face.hardness_Pa
    begin_Pa = np.where(held, hardness_Pa, known_Pa)
    punch = np.where(held, 0.0, punch_Pa_per_m)
    further_m = (of_load * float(known_Pa.sum()) - float(begin_Pa.sum())) / float(punch.sum())
    return np.asarray(np.clip(begin_Pa + further_m * punch, 0.0, hardness_Pa))


def _mostly_yields(face: ElasticFace, pressure_Pa: np.ndarray) -> bool:
    """Tell whether most of a load rests on points at the hardness."""
    return float(pressure_Pa[pressure_Pa > 0.0].mean()) > _MOSTLY * face.hardness_Pa


def _touching(pressed: Pressed, alone: PatchedFace, widest: Pressed | None) -> np.ndarray:
    """Return what touches under the known load or the greatest one, bool, shape (ny, nx)."""
    touching = pressed.pressure_Pa > 0.0
    return touching if widest is None else touching | (alone.spread(widest.pressure_Pa) > 0.0)


def _alone(face: ElasticFace, points: np.ndarray, tolerance: float, finest: int = 1) -> PatchedFace:
    """Return some points of a map alone, bool, shape (ny, nx); refined ones with a margin."""
    around = around_contact(face, points, finest, tolerance >= SINGLE)
    if around is not None and around.refinement > 1:
        return around  # a hill may touch between its pixels
    return alone_on(face, points, around)


def _enough(share: float, flats: bool = False) -> float:
    """Return the tolerance that tells the loss where a share of a load goes."""
    gone = 1.0 - (1.0 - share) ** (2.0 / 3.0)  # of the approach, in a Hertz contact
    enough = min(_LOOSEST, _LEFT * gone**3 / 8.0) * (_OF_FLATS if flats else 1.0)
    return max(enough, _FINEST)


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
    left = press(
        touching,
        load_N=(1.0 - share) * state.load_N,
        tolerance=_enough(share, face.yielded),
        start_Pa=pressure_Pa * part[at],
        sinks_once=True,
    )
    open_m = np.where(left.pressure_Pa > 0.0, 0.0, np.maximum(left.gap_m, 0.0))
    loss_J = 4.0 * float(pressure_Pa @ open_m) * face.pixel_area_m2
    left_Pa = np.zeros(face.shape)
    left_Pa[at] = left.pressure_Pa
    return Nearby(state.approach_m, share, state.approach_m - left.approach_m, loss_J), left_Pa
