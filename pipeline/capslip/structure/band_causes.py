"""What each cause of an error leaves of an answer: roots of covariances, in logarithms.

Of what is found, displacement or force, and of the energy.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from capslip.contact.accuracy import LEAST_ERROR, PAIRS_SHARE, YIELDED_ENERGY, YIELDED_STIFFNESS
from capslip.contact.curve import NormalCurve
from capslip.contact.part_of_joint import LeftOpen, left_open
from capslip.contact.press import ContactState
from capslip.contact.scans import curve_of_scans
from capslip.contact.uneven import PatchedCurve
from capslip.contact.uneven_accuracy import between_loads, power_between
from capslip.structure.band_state import LEAST_J, Part, Response, State, at_displacement, at_force

NORMAL_95 = 1.96  # standard deviations on either side that hold 95 %
LEAST_SPREAD = 1e-9  # standard deviation of a logarithm that is more than rounding
# Of a logarithm: an energy that may be off by as much is anything from nothing to its rectangle
ANY = 1e4
STEP = 0.01  # of a displacement, for a slope
# Scans more, as which what their contacts let expect of the scatter between scans counts: on eight
# real scans cut in parts it was one to three times as much
EXPECTED = 3
MOST_SHARE = 0.9  # of mu N of a joint of patches, above which its slopes tell nothing of it


@dataclass(frozen=True, eq=False)
class Left:
    """What caps and model leave of what is found and of the energy, in their logarithms."""

    caps: np.ndarray  # (r, 2), a root of the covariance
    model: np.ndarray  # (r, 2), the same
    # (2,), by which interacting caps, or finite elements of what yields, answer otherwise than the
    # model in use: no chance is in that
    shift: np.ndarray = field(default_factory=lambda: np.zeros(2))
    # (r, 2), a root as above, of how what yielded unloads
    law: np.ndarray = field(default_factory=lambda: np.zeros((2, 2)))


def of_caps_and_model(state: State) -> Left:
    """Return what caps and model leave.

    Each scan at its own state: under the force or the displacement of a joint of its face alone.
    Errors of the caps of two scans have nothing in common, those of model and law all.
    """
    each = [_of_one(state, part) for part in state.parts]
    if len(each) == 1:
        return each[0]
    share = np.array([part.share for part in state.parts])
    of_caps = [s * one.caps for s, one in zip(share, each, strict=True)]
    of_model, of_law = (
        _root(np.vstack([math.sqrt(s) * one for s, one in zip(share, roots, strict=True)]))
        for roots in ([one.model for one in each], [one.law for one in each])
    )
    shift = share @ np.array([one.shift for one in each])
    return Left(_root(np.vstack(of_caps)), of_model, shift, of_law)


def _of_one(state: State, part: Part) -> Left:
    contact, light = part.contact, part.contact.light
    friction = state.settings.material.friction_coefficient
    share = min(state.answer.slip_force_N / (friction * state.preload_N), 1.0)
    if contact.moved is None or (light is not None and light.moved is None):
        known = [one for one in (contact.errors, contact.patch_errors) if one is not None]
        energy = [ANY if share <= one.unknown_to else one.energy_at(share) for one in known]
        of_each = np.array([[one.stiffness for one in known], energy])
        solved = np.diag(np.linalg.norm(of_each, axis=1))
        shift, of_law = _of_law(state, contact, share)
        return Left(np.zeros((2, 2)), _root(solved / NORMAL_95), shift, _root(of_law / NORMAL_95))
    if light is not None:
        e = state.answer.displacement_m / (friction * part.kappa)
        return _of_uneven(state, part, light, share, e)
    e = state.answer.displacement_m / (friction * contact.composite.kappa)
    at = state.answer.slip_force_N / (friction * state.preload_N) * contact.preload_N
    if not state.by_force and state.greatest == 1.0:
        at = e
    elif not state.by_force:  # at constant load e may be beyond total slip
        d = contact.curve.approach_m(contact.preload_N)
        at = float(contact.curve.withdrawal_m(d, share * contact.preload_N))
    return _of_moved(contact, share, at, state.at_constant_load, _of_law(state, contact, share))


def _of_law(state: State, contact: ContactState, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what the plastic law moves beside the answer, shape (2,), and leaves at 95 %, (r, 2).

    That of a map is in its answer already. At a given displacement the force goes as that is moved
    at a given force, and the energy with both.
    """
    shift, left = _law_at_force(contact, share)
    if state.by_force or not left.size:
        return shift, left
    e = state.answer.displacement_m / (
        state.settings.material.friction_coefficient * contact.composite.kappa
    )
    near = e * np.array([1.0 - STEP, 1.0 + STEP])
    log = _log(state.response(contact.curve, contact.curve.approach_m(contact.preload_N), near))
    slope = (log[:, 1] - log[:, 0]) / np.log(near[1] / near[0])
    at_displacement_of = np.vstack((-slope, (0.0, 1.0)))
    return shift @ at_displacement_of, left @ at_displacement_of


def _law_at_force(contact: ContactState, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the same at a given share of mu N."""
    of = contact.errors if contact.moved is None else contact.moved
    law = None if of is None else of.law
    if law is None:
        return np.zeros(2), np.zeros((0, 2))
    shift = np.zeros(2) if contact.moved is None else np.array(law.shift(share))
    return shift, law.half_95(share)


def _of_moved(
    contact: ContactState,
    share: float,
    at: float,
    response: Response,
    of_law: tuple[np.ndarray, np.ndarray],
) -> Left:
    """Return what caps and model leave where the caps were moved, by a response at a place."""
    moved = contact.moved
    assert moved is not None

    def log_of(curve: NormalCurve) -> np.ndarray:
        """Return both logarithms, shape (2,), or (s, 2) of sets."""
        approach_m = curve.approach_m(contact.preload_N)
        return _log(response(curve, approach_m, np.asarray(at))).T

    log = log_of(moved.found)
    *random, by_shape = log_of(moved.moved) - log
    others = [2.0 * by_shape, PAIRS_SHARE * (log_of(moved.by_pairs) - log)]
    others += [] if moved.by_level is None else [log_of(moved.by_level) - log]
    others += [*np.diag(moved.of_profiles(share)), *(LEAST_ERROR * np.eye(2))]
    # Heavy caps that sink deeper leave light ones more: softer, and less is lost
    of_yield = YIELDED_STIFFNESS * moved.of_contact, -YIELDED_ENERGY
    others += [moved.yielded * np.array(of_yield)]
    shift, left_open = of_law
    return Left(
        _root(np.array(random) / math.sqrt(len(random))),
        _root(np.array(others) / NORMAL_95),
        log - log_of(contact.curve) + shift,
        _root(left_open / NORMAL_95),
    )


def _of_uneven(state: State, part: Part, light: ContactState, share: float, e: float) -> Left:
    """Return the same of a joint whose patches are pressed unevenly, and have one withdrawal.

    What they leave of a withdrawal e_k and a loss L_k, each under its own drop t_k of its load, is
    known of the heaviest and of the lightest that counts, of which it is a power of the load, and
    goes together: a_k and l_k, say. Where all have one withdrawal e, and e_k is no more than that
    of total slip, drops and losses of the w_k scans in all patches add up to::

        dT = - sum_k w_k e_k K_k a_k,  dL = sum_k w_k [L_k l_k - 4 e_k (t_k - e_k K_k) a_k]

    with the stiffness K_k = dt_k/de that is left. At a given force e moves by -dT / (dT/de).
    """
    joint, curve = part.joint, part.joint.curve(part.contact)
    assert isinstance(curve, PatchedCurve)
    D = curve.preload_approach_m
    if state.by_force:
        e = float(curve.withdrawal_m(D, min(share, MOST_SHARE) * joint.preload_N))
    patches = zip(curve.curves, curve.patch_approach_m, joint.load_N, strict=True)
    columns = [_slipped(*patch, e) for patch in patches]
    e_k, drop_N, left_N_per_m, own_J, loss_J = np.array(columns).T
    place, w = between_loads(joint, part.contact, light), joint.weight
    ends = []
    for one in (light, part.contact):
        at = int(np.abs(joint.load_N - one.preload_N).argmin())
        of_load = drop_N[at] / joint.load_N[at]
        of_law = _law_at_force(one, of_load)
        ends.append(_of_moved(one, of_load, drop_N[at], at_force, of_law))
    T, K, L = w @ drop_N, w @ left_N_per_m, w @ loss_J
    of_heavy = float(place @ (w * loss_J) / L)

    def of_joint(a: np.ndarray, energy: np.ndarray) -> np.ndarray:
        dT = (-w * e_k * left_N_per_m) @ a
        dL = (w * own_J) @ energy - (4.0 * w * e_k * (drop_N - e_k * left_N_per_m)) @ a
        if not state.by_force:
            return np.array([dT / T, dL / L])
        de = -dT / K
        return np.array([de / e, (dL + 4.0 * (T - e * K) * de) / L])

    def together(low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return a root of the joint from those of the ends, which patches have in common."""
        spread = [np.sqrt(np.square(root).sum(axis=0)) for root in (low, high)]
        a_k, l_k = (power_between(place, *both) for both in np.transpose(spread))
        counts = math.sqrt(1.0 - of_heavy), math.sqrt(of_heavy)
        rows = [
            count * root / np.where(one > 0.0, one, 1.0)
            for count, root, one in zip(counts, (low, high), spread, strict=True)
        ]
        return _root(np.array([of_joint(a * a_k, energy * l_k) for a, energy in np.vstack(rows)]))

    shift = ends[0].shift + place[:, None] * (ends[1].shift - ends[0].shift)
    light_end, heavy_end = ends
    return Left(
        together(light_end.caps, heavy_end.caps),
        together(light_end.model, heavy_end.model),
        of_joint(*shift.T),
        together(light_end.law, heavy_end.law),
    )


def _slipped(
    curve: NormalCurve, approach_m: float, load_N: float, e: float
) -> tuple[float, float, float, float, float]:
    """Return withdrawal, drop, stiffness left and loss of a patch up to its total slip, and loss.

    The last where the joint is withdrawn by e, beyond total slip or not.
    """
    drop_N, loss_J = (float(one) for one in at_displacement(curve, approach_m, np.asarray(e)))
    if drop_N < load_N:
        return e, drop_N, float(curve.stiffness_N_per_m(approach_m, e)), loss_J, loss_J
    whole_m, own_J = (float(one) for one in at_force(curve, approach_m, np.asarray(load_N)))
    return whole_m, load_N, 0.0, own_J, loss_J


def of_scatter(state: State) -> np.ndarray:
    """Return a root of the covariance that the scatter between scans gives their mean.

    Few scans tell little of how they scatter: what their contacts let expect counts as so many.
    """
    parts, friction = state.parts, state.settings.material.friction_coefficient
    if len(parts) == 1:
        return np.zeros((2, 2))
    share = np.array([part.share for part in parts])
    if state.by_force:  # that of total slip at most, which rounding must not pass
        at = min(state.answer.slip_force_N / friction, state.preload_N)
    else:
        at = state.answer.displacement_m / (friction * state.kappa)
    log = []
    for i in range(len(parts)):
        others = [k for k in range(len(parts)) if k != i]
        curves, ratio = [state.as_found[k] for k in others], [state.ratio[k] for k in others]
        rest = share[others] / share[others].sum()
        curve = curve_of_scans(curves, state.preload_N, rest, ratio)
        approach_m = float(curve.approach_m(state.preload_N))
        log.append(_log(state.response(curve, approach_m, np.asarray(at))))
    change = np.array(log) - np.mean(log, axis=0)
    root = _root(math.sqrt((len(parts) - 1) / len(parts)) * change)
    expected = _by_chance(state)
    if expected is not None:
        freedom = degrees_of_freedom(state)
        weight = np.sqrt(np.array([freedom - EXPECTED, EXPECTED]) / freedom)
        root = _root(np.vstack([weight[0] * root, weight[1] * expected]))
    return np.where(np.abs(root).max() > LEAST_SPREAD, root, 0.0)


def degrees_of_freedom(state: State) -> int:
    """Return those of the scatter between scans, with what their contacts let expect."""
    known = all(left is not None for _, left in _each_left_open(state))
    return len(state.parts) - 1 + (EXPECTED if known else 0)


def of_parts(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return what scans leave open of a joint that they are a part of: a root, and a shift.

    What is by chance that of one scan is left to the scatter between them, where there are several.
    """
    known = [(share, one) for share, one in _each_left_open(state) if one is not None]
    if not known:
        return np.zeros((2, 2)), np.zeros(2)
    moved, of_bulk = np.zeros((2, 2)), 0.0
    for share, one in known:
        moved += share * np.array([one.by_choice, one.by_waves])
        of_bulk += share * one.stiffness_by_bulk
    root = _as_asked(state, np.vstack([moved, [of_bulk, 0.0]]))
    by_chance = _by_chance(state)
    if len(state.parts) == 1 and by_chance is not None:
        root = np.vstack([root, by_chance])
    return _root(root), _as_asked(state, moved.sum(axis=0))


def of_direction(state: State) -> np.ndarray:
    """Return a root of the covariance that an unknown direction of slip leaves.

    Of (a cos 2 phi, b cos 2 (phi - c)) over all phi; zero within the tolerance, as it is said.
    """
    slip, swings = state.settings.slip, np.zeros(2, dtype=complex)
    for part in state.parts:
        if part.contact.lay is not None:
            swings += part.share * np.array(part.contact.lay.left_open(slip.direction_rad))
    if np.abs(swings).max() <= state.settings.contact.tolerance:
        return np.zeros((2, 2))
    swings = _as_asked(state, swings)
    # A face that lies another way has other rows of the same covariance, and the same root
    return _root(np.array([swings.real, swings.imag]) / math.sqrt(2.0))


def _by_chance(state: State) -> np.ndarray | None:
    """Return a root of what chance lets expect of the mean of all scans, by their contacts.

    None where they are no parts of their joint.
    """
    each = _each_left_open(state)
    known = [
        share * np.array([one.stiffness_by_chance, one.energy_by_chance])
        for share, one in each
        if one is not None
    ]
    if len(known) < len(each):
        return None
    return _as_asked(state, np.diag(np.linalg.norm(known, axis=0)))


def _each_left_open(state: State) -> list[tuple[float, LeftOpen | None]]:
    """Return the share of each scan, and what it leaves open of the joint."""
    return [(part.share, left_open(part.joint, part.contact)) for part in state.parts]


def _as_asked(state: State, moved: np.ndarray) -> np.ndarray:
    """Return what moves displacement and energy under a force, (..., 2), for what is asked.

    At a given displacement that is what a smaller one has on the same curve, and the energy with
    it: force and energy.
    """
    if state.by_force:
        return moved
    curve = state.curves(np.ones((1, 2)))[0]
    e = state.answer.displacement_m
    e /= state.settings.material.friction_coefficient * state.kappa
    near = e * np.array([1.0 - STEP, 1.0 + STEP])
    log = _log(state.response(curve, float(curve.approach_m(state.preload_N)), near))
    slope = (log[:, 1] - log[:, 0]) / np.log(near[1] / near[0])
    return np.asarray([0.0, 1.0] * moved - slope * moved[..., :1])


def _log(found: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    return np.log(np.maximum(found, LEAST_J))


def _root(changes: np.ndarray) -> np.ndarray:
    """Return two rows with the same sum of squares and products as many rows of two."""
    variance, axis = np.linalg.eigh(changes.T @ changes)
    return np.sqrt(np.maximum(variance, 0.0))[:, None] * axis.T
