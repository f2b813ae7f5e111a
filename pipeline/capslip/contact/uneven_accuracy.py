"""What a joint that is pressed unevenly is unsure of: between few solutions, and where it is light.

A map resolves the less of its contacts, the lighter it is pressed: what is known of the patch that
bears most says too little of a joint whose load rests on lighter ones.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.curve import NormalCurve
from capslip.contact.joint import Joint
from capslip.contact.press import ContactState
from capslip.contact.rung import ModelError
from capslip.contact.uneven import PatchedCurve
from capslip.problems import Effect, Problem, Severity
from capslip.units import percent

SHARES = (0.1, 0.25, 0.5, 0.75, 1.0)  # of mu N, at which the error of the energy is found
ASKED = 0.25  # of these, at which it warns
FEW = 0.05  # of stiffness and energy: no more may rest on patches whose error is not found
NOT_KNOWN = ModelError(1.0, 1.0)
NEAR_SMALL = (0.1, 0.15, 0.25, 0.35)  # of mu N: a tenth, a quarter, and what is near them
MOST_MISSING = 0.9  # of an answer: beyond an order of magnitude none is known anyway
LEAST_LEFT = 1e-6  # no more than rounding; powers lie between the errors, and none through zero
# Over what moves without each of few solutions, of the stiffness, the energy at a tenth of mu N and
# from a quarter on: 95 % of answers are within
LEFT_95 = 0.6, 1.25, 0.6
# The same of fewer solutions than that, where time was short for more: of the energy at any force,
# times what moves most at one of them, as a single difference may be small by chance
FEW_SOLVED, LEFT_BY_FEW = 7, (1.0, 2.0, 2.0)
LEAST_SLIP, LEAST_ERROR = 1e-3, 1e-9  # that have a logarithm


def error_of_patches(joint: Joint, patches: Sequence[ContactState]) -> ModelError | None:
    """Return what it leaves that few patches were solved on the map for all the pressures, at 95 %.

    From what the answers move by where each of the solutions but the greatest is left out, and of
    the energy at any force near the one that is named: one difference alone may vanish by chance.
    What single contacts and pixels do to each of them is chance, so the root of the sum of their
    squares counts. Of patches that are too light to be followed, what is solved for heavier ones
    tells next to nothing: all that goes with them of stiffness and energy may be missing, and no
    less than what they carry.

    Parameters
    ----------
    joint : Joint
    patches : sequence of ContactState
        What `Joint.loaded` gives.

    Returns
    -------
    ModelError or None
        None where every pressure has its own curve.
    """
    count = len(patches)
    if patches[0].rung.solved_loads_N is None or count >= len(joint.load_N):
        return None
    kappa = joint.kappa_of(patches)
    curve = joint.curve_of(patches, kappa)
    whole = stiffness_and_energies(curve, joint.preload_N, NEAR_SMALL)
    others = [[*patches[:i], *patches[i + 1 :]] for i in range(count - 1)]
    curves = [joint.curve_of(rest, kappa) for rest in others]
    fewer = [stiffness_and_energies(one, joint.preload_N, NEAR_SMALL) for one in curves]
    moved = np.array(fewer).reshape(-1, len(whole)) / whole - 1.0
    together, factors = np.sqrt(np.square(moved).sum(axis=0)), LEFT_95
    if joint.most_solved < FEW_SOLVED:
        together[1:], factors = together[1:].max(), LEFT_BY_FEW
    of_light = _of_light(joint, curve, patches)
    K, small_W, W = (
        max(factor * float(one.max()) + float(light.max()), LEAST_LEFT)
        for factor, one, light in zip(
            factors, np.split(together, (1, 3)), np.split(of_light, (1, 3)), strict=True
        )
    )
    energy = max(small_W, W)
    return ModelError(K, energy, ((NEAR_SMALL[0], energy), (NEAR_SMALL[2], W), (1.0, W)))


def problems_of_patches(
    joint: Joint, patches: Sequence[ContactState], error: ModelError | None, tolerance: float
) -> list[Problem]:
    """Return what that error is, and whether it is beyond the one that was asked for."""
    if error is None:
        return []
    times = "once" if len(patches) == 1 else f"{len(patches)} times"
    K, small_W, W = error.stiffness, error.energy, error.energy_at(NEAR_SMALL[2])
    message = (
        f"the map was solved {times} for {len(joint.load_N)} pressures of the joint: "
        f"that may move the stiffness by {percent(K)}, the energy by {percent(W)} at a quarter of "
        f"mu N and by {percent(small_W)} at a tenth"
    )
    if (share := _too_light(joint, patches)) > 0.0:
        of_greatest = percent(patches[0].preload_N / joint.scan_load_N)
        message += (
            f"; {percent(share)} of the preload rests on patches under less than {of_greatest} of "
            "the greatest pressure, whose contacts have too few pixels to be followed"
        )
    severity: Severity = "warning" if max(K, W) > tolerance else "info"
    return [Problem("pressures_interpolated", severity, message, Effect(K, W, W))]


def problems_of_levels(
    joint: Joint, contact: ContactState, patches: Sequence[ContactState]
) -> list[Problem]:
    """Return whether patches of a joint find no level, and lie as the scan under the greatest."""
    lost_N = [N for N in (one.preload_N for one in patches[:-1]) if contact.lacks_level(N)]
    if not lost_N:
        return []
    of_greatest = percent(max(lost_N) / joint.scan_load_N)
    light = _no_heavier(joint, max(lost_N))
    share = percent(float((joint.load_N * joint.weight)[light].sum()) / joint.preload_N)
    message = (
        f"no level is found under {of_greatest} of the greatest pressure and less, where {share} "
        "of the preload rests: there the face lies as under the greatest, which decides"
    )
    return [Problem("not_balanced", "warning", message)]


def lightest(
    joint: Joint, curve: NormalCurve, patches: Sequence[ContactState]
) -> ContactState | None:
    """Return the lightest patch that counts, whose errors are to be found.

    Parameters
    ----------
    joint : Joint
    curve : NormalCurve
        What `Joint.curve_of` gives of it.
    patches : sequence of ContactState
        What `Joint.loaded` gives; the last is the heaviest, whose errors are known.

    Returns
    -------
    ContactState or None
        None where no more than a twentieth of stiffness and energy rests on lighter patches than
        the heaviest, or its errors are not known.
    """
    heaviest = patches[-1]
    if heaviest.errors is None or not isinstance(curve, PatchedCurve):
        return None
    known = [patch.preload_N for patch in patches[:-1]]
    if heaviest.rung.solved_loads_N is None:  # any load is as good
        lighter = joint.load_N < (1.0 - 1e-9) * heaviest.preload_N
        known = np.sort(joint.load_N[lighter]).tolist()
    stiffness, energy, _ = shares_of_patches(joint, curve, (ASKED,))
    load_N = next((N for N in known if _rests_on(joint, N, stiffness, energy[0]) > FEW), None)
    if load_N is None:
        return None
    return heaviest.of_patch(load_N)


def error_of_joint(
    joint: Joint,
    curve: NormalCurve,
    heaviest: ContactState,
    light: ContactState,
    doubts: Sequence[Problem],
    tolerance: float,
) -> tuple[ModelError, tuple[Problem, ...], np.ndarray]:
    """Return the errors of a joint, and what takes them beyond the tolerance where it is lighter.

    Patches differ in their load alone, so their errors go the same way: each counts by its share of
    the stiffness, and of the energy under the slip of the joint. They are known of the heaviest
    patch and of the lightest that counts; between, they are a power of the load.

    Parameters
    ----------
    joint : Joint
    curve : NormalCurve
        What `Joint.curve_of` gives of it.
    heaviest : ContactState
        With its errors, and the problems that it has.
    light : ContactState
        What `lightest` gives, with its errors.
    doubts : sequence of Problem
        What that says.
    tolerance : float
        Relative.

    Returns
    -------
    ModelError, tuple of Problem, ndarray of shape (k,)
        Beyond the tolerance, what the lighter one says takes the place of problems with the same
        code. And the shares of the patches in the energy at a quarter of mu N.
    """
    problems, known = heaviest.problems, heaviest.errors
    assert known is not None
    assert isinstance(curve, PatchedCurve)
    stiffness, energy, slipped = shares_of_patches(joint, curve, SHARES)
    place = between_loads(joint, heaviest, light)
    ends = light.errors or NOT_KNOWN, known
    by_share = [
        (share, float(f @ power_between(place, *([end.energy_at(t) for t in at] for end in ends))))
        for share, f, at in zip(SHARES, energy, slipped.tolist(), strict=True)
    ]
    K = float(stiffness @ power_between(place, *(end.stiffness for end in ends)))
    greatest = max(error for _, error in by_share)
    # The plastic law of the heaviest: contacts of a rough face hardly bear more under more load
    found = ModelError(K, greatest, tuple(by_share), known.unknown_to, known.law)
    W, asked = found.energy_at(ASKED), energy[SHARES.index(ASKED)]
    if max(K, W) <= tolerance:
        return found, problems, asked
    of_K, of_W = (float(one @ _no_heavier(joint, light.preload_N)) for one in (stiffness, asked))
    under = (
        f"under {light.preload_N:.3g} N on the scan, and patches that bear no more have "
        f"{percent(of_K)} of the stiffness of the joint and {percent(of_W)} of its energy at "
        f"{percent(ASKED)} of mu N, "
    )
    said = [
        replace(one, message=under + one.message, effect=_of_joint(one.effect, K, W))
        for one in doubts
        if one.severity == "warning"
    ]
    again = {one.code for one in said}
    return found, (*(one for one in problems if one.code not in again), *said), asked


def stiffness_and_energies(
    curve: NormalCurve, preload_N: float, shares: Sequence[float]
) -> np.ndarray:
    """Return the stiffness, and what goes with the energies at shares of mu N, (1 + s,)."""
    d, drop_N = curve.approach_m(preload_N), np.array(shares) * preload_N
    return np.append(curve.stiffness_N_per_m(d), curve.loss_integral_at_drop_J(d, drop_N))


def error_against(state: ContactState, other: ContactState) -> ModelError | None:
    """Return the error of a pressed face by that of a dearer model under the same load.

    What lies between their answers and what that leaves open itself; None where nobody knows that.
    """
    if other.errors is None:
        return None
    N, shares = state.preload_N, SHARES[:-1]
    answers, others = (stiffness_and_energies(one.curve, N, shares) for one in (state, other))
    K, *W = np.abs(np.log(others) - np.log(answers)).tolist()
    W.append(W[-1])  # at gross slip as before it: a map may not be followed until nothing touches
    by_share = tuple(
        (at, one + other.errors.energy_at(at)) for at, one in zip(SHARES, W, strict=True)
    )
    return ModelError(K + other.errors.stiffness, max(error for _, error in by_share), by_share)


def by_energy(
    joint: Joint, contact: ContactState, of_state: Callable[[ContactState], float]
) -> float:
    """Return a number of a face for its joint: the mean over patches, by the energy of each.

    It is a power of the load between the heaviest patch and the lightest that counts.
    """
    heavy, light = of_state(contact), contact.light
    if light is None:
        return heavy
    assert contact.energy_share is not None
    place = between_loads(joint, contact, light)
    return float(contact.energy_share @ power_between(place, of_state(light), heavy))


def between_loads(joint: Joint, heaviest: ContactState, light: ContactState) -> np.ndarray:
    """Return where the load of each patch is between those of two, 0 to 1 by its logarithm."""
    span = math.log(heaviest.preload_N / light.preload_N)
    return np.asarray(np.clip(np.log(joint.load_N / light.preload_N) / span, 0.0, 1.0))


def power_between(place: np.ndarray, of_light: ArrayLike, of_heavy: ArrayLike) -> np.ndarray:
    """Return errors between those of two loads, (k,): a power of the load."""
    low, high = (np.log(np.maximum(one, LEAST_ERROR)) for one in (of_light, of_heavy))
    return np.asarray(np.exp((1.0 - place) * low + place * high))


def _of_joint(effect: Effect | None, K: float, W: float) -> Effect:
    """Return what a doubt of the lighter patch moves, and no more than all moves of the joint."""
    if effect is None:
        return Effect(K, W, W)
    moved = (effect.tangential_stiffness, effect.energy, effect.loss_factor)
    return Effect(*(one and min(one, most) for one, most in zip(moved, (K, W, W), strict=True)))


def out_of_time(patches: Sequence[ContactState]) -> list[Problem]:
    """Return the worst of what short time left of the slip of lighter patches than the heaviest.

    That one says itself what is left of it.
    """
    late: list[Problem] = []
    for patch in patches[:-1]:
        if patch.rung.solved_loads_N is None or patch.rung.problems is None:
            continue
        under = f"under {patch.preload_N:.3g} N on the scan, "
        late += [
            replace(one, message=under + one.message)
            for one in patch.rung.problems(patch.curve, patch.preload_N)
            if one.code == "time_limit_reached"
        ]
    return [max(late, key=lambda one: one.greatest_effect)] if late else []


def _too_light(joint: Joint, patches: Sequence[ContactState]) -> float:
    """Return the share of the preload on patches that are lighter than all that was followed.

    None where all was that should be: they follow from heavier ones, as these do from each other.
    """
    if len(patches) >= min(joint.most_solved, len(joint.load_N)):
        return 0.0
    light = joint.load_N < (1.0 - 1e-9) * patches[0].preload_N
    return float((joint.load_N * joint.weight)[light].sum()) / joint.preload_N


def _of_light(joint: Joint, curve: NormalCurve, patches: Sequence[ContactState]) -> np.ndarray:
    """Return what such patches leave of stiffness and energies near a tenth and a quarter of mu N.

    As logarithms, as which intervals take them.
    """
    if (carried := _too_light(joint, patches)) == 0.0:
        return np.zeros(1 + len(NEAR_SMALL))
    if not isinstance(curve, PatchedCurve):
        return np.full(1 + len(NEAR_SMALL), carried)
    stiffness, energy, _ = shares_of_patches(joint, curve, NEAR_SMALL)
    light = joint.load_N < (1.0 - 1e-9) * patches[0].preload_N
    missing = np.array([stiffness, *energy])[:, light].sum(axis=1)
    return np.maximum(-np.log1p(-np.minimum(missing, MOST_MISSING)), carried)


def _rests_on(joint: Joint, most_N: float, stiffness: np.ndarray, energy: np.ndarray) -> float:
    """Return the share of stiffness or energy, the greater, of patches up to a load."""
    light = _no_heavier(joint, most_N)
    return float(max(stiffness @ light, energy @ light))


def _no_heavier(joint: Joint, most_N: float) -> np.ndarray:
    """Tell which patches bear no more than a load."""
    return np.asarray(joint.load_N <= most_N * (1.0 + 1e-9))


def shares_of_patches(
    joint: Joint, curve: PatchedCurve, of_force: Sequence[float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return shares of the patches: of the stiffness (k,), of the energy and of their own mu N.

    The latter two where the joint bears shares of its own mu N, (s, k).
    """
    d_0 = curve.preload_approach_m
    e = curve.withdrawal_m(d_0, np.array(of_force) * joint.preload_N)
    rows = []
    for one, N, d, weight in zip(
        curve.curves, joint.load_N, curve.patch_approach_m, curve.weight, strict=True
    ):
        slipped = np.clip(one.load_drop_N(d, e) / N, LEAST_SLIP, 1.0)
        K, loss_J = one.stiffness_N_per_m(d), one.loss_integral_J(d, e)
        rows.append((weight * float(K), weight * loss_J, slipped))
    K, loss_J, slipped = (np.array(column) for column in zip(*rows, strict=True))
    return K / K.sum(), (loss_J / loss_J.sum(axis=0)).T, slipped.T
