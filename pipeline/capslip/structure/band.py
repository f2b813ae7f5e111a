"""How far an answer may be off: what is uncertain in it, propagated to every number of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from capslip.contact.part_of_joint import WHOLE
from capslip.errors import ContactError
from capslip.settings import Settings
from capslip.structure.answer import Answer, numbers_of_state
from capslip.structure.band_causes import (
    LEAST_SPREAD,
    NORMAL_95,
    degrees_of_freedom,
    of_caps_and_model,
    of_direction,
    of_parts,
    of_scatter,
)
from capslip.structure.band_state import Part, State
from capslip.structure.response import MOST_LOSS_FACTOR, Damping
from capslip.structure.sobol import scrambled_sobol

INSIDE = 0.90  # of what may be, in an interval
LOG2_POINTS = 8
UNKNOWN = 1e-6  # of the number that was answered: nobody knows an end below
COUNTED = ("tangential_stiffness_N_per_m", "energy_J", "joint_loss_factor", "loss_factor")
# They move displacement and energy by factors
OF_BOTH = ("caps", "model", "plastic_law", "scans", "part_of_joint", "direction")
OF_MODEL = "error of the model"  # in the list of what an interval leaves out
MOST = {  # of what is defined as long as a mode is lightly damped
    "loss_factor": MOST_LOSS_FACTOR,
    "damping_ratio": MOST_LOSS_FACTOR / 2.0,
    "total_loss_factor": MOST_LOSS_FACTOR,
}


@dataclass(frozen=True)
class Band:
    """Intervals of an `Answer`, made by `band_of`."""

    interval: dict[str, tuple[float, float]]  # by the name of the number; infinite: no bound
    contributions: dict[str, dict[str, float]]  # share of each input in the variance of a number
    left_out: tuple[str, ...]  # what is uncertain by an amount that is not known


def band_of(
    answer: Answer | None,
    parts: Sequence[Part],
    damping: Damping,
    settings: Settings,
    noise_known: bool = False,
) -> Band | None:
    """Return the 90 % intervals of an answer, and which input contributes how much to them.

    Parameters
    ----------
    answer : Answer or None
        To the question of the settings.
    parts : sequence of Part
        One for each scan, with the estimated error of its model and its caps moved within their
        errors; their shares sum to 1.
    damping : Damping
        Of the structure; its stiffnesses count.
    settings : Settings
        The question, and the spreads of friction, preload, moduli and hardness.
    noise_known : bool
        Whether the measurement noise of all scans is: else it is named among what is left out.

    Returns
    -------
    Band or None
        None where there is no answer, where nothing moves, where nothing is known to be uncertain,
        and where the model cannot carry a preload that may be.

    Notes
    -----
    Every factor on displacement and energy is log-normal. Caps: covariance of the two over the
    caps moved at random. Model: the other causes of `error_of_caps`, each as it changes this state.
    Plastic law: what is open of how contacts that yielded unload, see `law_of_map`.
    What interacting caps answer otherwise than the model in use is known: it is what the interval
    lies about, which holds the answer, too. The estimated error of a model without caps,
    and what few solved pressures leave of a joint of many, move either of the two alone, as nothing
    tells how they go together. Part: what one scan leaves open of a larger joint by the number of
    its contacts, and by waves that it does not hold, see `left_open`. Direction: what kappa is in
    all directions of slip, where that is beyond the tolerance. Friction mu, preload P, modulus (a
    factor c on E*) and hardness H follow from the curve: nothing but H / E* and N / E* counts in
    the shape of N(d), so with the share t = T / (mu P) at the load N = P / c and the hardness H / c
    of the curve as it was solved::

        delta = mu kappa e(N, H / c, t),  W = mu^2 kappa c L(N, H / c, t)

    with the withdrawal e and the loss integral L of the curve along which the face unloads from N,
    in logarithms sums of polynomials, or of straight lines where few contacts touch in turn, along
    the lines on which preload, modulus and hardness move (N, H); or of the one elastic curve
    itself. A beam is of the same material: c is on its stiffnesses, and on the force of an
    amplitude. The level of the face stays that under its preload. On a joint that is pressed
    unevenly caps and model are those of its patches, see `band_causes`. The inputs are drawn at 256
    points of a scrambled Sobol sequence. The share of an input is its first-order Sobol index for
    the logarithm of the number, from an expansion in Hermite polynomials up to the second degree
    (Sudret, Reliab. Eng. Syst. Saf. 93 (2008) 964); what is missing to 1 are interactions, and
    steps that no parabola follows.

    Friction, preload, modulus and hardness are those of all scans, and so are the causes of the
    error of the model. Those of the caps are each scan's own. To these comes the scatter between k
    scans: the standard error of their mean, from the joint as it were without one of them, each in
    turn (jackknife, Efron and Stein, Ann. Stat. 9 (1981) 586)::

        C = (k - 1) / k sum_i (x_(-i) - mean)(x_(-i) - mean)^T,  x = (log delta or log T, log W)

    In the intervals it is drawn from Student's distribution of k - 1 degrees of freedom, which two
    scans make 3.8 times as wide as the normal one and three 1.8 times; in the shares from the
    normal one, as the variance of the other has no bound for up to three scans. Of scans that are
    parts of their joint, what their contacts let expect of C counts as that of three scans more.
    It holds the caps' errors, too, so these count twice. That the scans are a part of a finite
    joint is not used.
    """
    if answer is None or not answer.displacement_m > 0.0:
        return None
    by_force = settings.answer.displacement_m is None
    state = State(answer, by_force, tuple(parts), settings, noise_known)
    try:
        return _propagated(state, damping)
    except ContactError:
        return None


def _propagated(state: State, damping: Damping) -> Band | None:
    """Return the band of a state that moves; None where nothing is known to be uncertain."""
    material, contact = state.settings.material, state.settings.contact
    left = of_caps_and_model(state)
    of_part, less = of_parts(state)
    spreads = {
        "caps": left.caps,
        "model": left.model,
        "plastic_law": left.law,
        "scans": of_scatter(state),
        "part_of_joint": of_part,
        "direction": of_direction(state),
        "friction": np.array([[material.friction_spread / NORMAL_95]]),
        "preload": np.array([[contact.preload_spread / NORMAL_95]]),
        "modulus": np.array([[material.modulus_spread / NORMAL_95]]),
    }
    if state.yields:
        spreads["hardness"] = np.array([[material.hardness_spread / NORMAL_95]])
    uncertain = [name for name, spread in spreads.items() if spread.any()]
    left_out = _left_out(state)
    # What these move alone is no interval of a model whose error is not known
    if not uncertain or (set(uncertain) <= {"part_of_joint", "direction"} and OF_MODEL in left_out):
        return None
    normal = _drawn({name: len(spreads[name]) for name in uncertain})
    points = 2**LOG2_POINTS
    log = {name: np.zeros((points, len(spread))) for name, spread in spreads.items()}
    log |= {name: normal[name] @ spreads[name] for name in uncertain}
    given = {name: of[:, 0] for name, of in log.items() if name not in OF_BOTH}
    found, W = state.under(given)
    stiffer, more = state.of_the_beam(given)

    def numbers_with(scans: np.ndarray) -> dict[str, np.ndarray]:
        with np.errstate(over="ignore"):
            of_all = sum(log[name] for name in OF_BOTH if name != "scans")
            moved = np.exp(of_all + scans + left.shift + less)
            other, energy_J = found * moved[:, 0], W * np.where(W == 0.0, 1.0, moved[:, 1])
        delta_m, force_N = state.answer.displacement_m, more * state.answer.slip_force_N
        T, delta = (force_N, other) if state.by_force else (other, delta_m)
        energy_J = np.minimum(energy_J, 4.0 * T * delta)  # no cycle is larger than its rectangle
        numbers = numbers_of_state(T, delta, energy_J, damping, stiffer).items()
        return {name: one for name, one in numbers if getattr(state.answer, name) is not None}

    kept = numbers_with(log["scans"])
    wide = kept
    if "scans" in uncertain:
        wide = numbers_with(
            _students(normal["scans"], degrees_of_freedom(state)) @ spreads["scans"]
        )
    return Band(
        {
            name: _with(getattr(state.answer, name), _interval(name, np.broadcast_to(one, points)))
            for name, one in wide.items()
        },
        {name: _contributions(kept[name], normal) for name in COUNTED if name in kept},
        left_out,
    )


def _left_out(state: State) -> tuple[str, ...]:
    parts, unknown = state.parts, []
    if any(part.contact.estimated_error is None for part in parts):
        unknown.append(OF_MODEL)
    if not state.noise_known and any(part.contact.rung.made_from == "map" for part in parts):
        unknown.append("noise of the map that pixels share")
    blur_known = state.settings.instrument.lateral_period_limit_m is not None
    if not blur_known and any(part.contact.rung.made_from == "map" for part in parts):
        unknown.append("blur of the optics")
    coverage = parts[0].joint.coverage
    if len(parts) == 1 and coverage is not None and coverage < WHOLE:
        unknown.append("scatter between scans")
    return tuple(unknown)


def _students(normal: np.ndarray, freedom: int) -> np.ndarray:
    """Return normal numbers as those of Student's distribution with the same probability."""
    from scipy.special import ndtr, stdtrit

    return np.asarray(stdtrit(freedom, ndtr(normal)))


def _drawn(columns: dict[str, int]) -> dict[str, np.ndarray]:
    """Return independent normal numbers for each input, (POINTS, columns)."""
    drawn = _normal_numbers(sum(columns.values()))
    ends = np.cumsum(list(columns.values()))
    return dict(zip(columns, np.split(drawn, ends[:-1], axis=1), strict=True))


@cache
def _normal_numbers(columns: int) -> np.ndarray:
    """Return the same numbers for every answer, (POINTS, columns)."""
    from scipy.special import ndtri

    drawn: np.ndarray = ndtri(scrambled_sobol(columns, LOG2_POINTS))
    drawn.flags.writeable = False
    return drawn


def _interval(name: str, values: np.ndarray) -> tuple[float, float]:
    """Return the interval of a number; infinite where there is no bound."""
    values = np.where(np.isnan(values), np.inf, values)
    values = np.where(values > MOST.get(name, np.inf), np.inf, values)
    tail = 0.5 * (1.0 - INSIDE)
    at = [math.ceil(share * values.size) - 1 for share in (tail, 1.0 - tail)]
    low, high = np.partition(values.reshape(-1), at)[at]  # one of them each, as some are infinite
    return float(low), float(high)


def _with(value: float, interval: tuple[float, float]) -> tuple[float, float]:
    """Return an interval that holds the number that was answered.

    Its lower end is zero where it would be less than a millionth of that: an error of so many
    factors is that of a model, and the digits of such an end say nothing.
    """
    low = min(value, interval[0])
    return 0.0 if 0.0 < low < UNKNOWN * value else low, max(value, interval[1])


def _contributions(values: np.ndarray, normal: dict[str, np.ndarray]) -> dict[str, float]:
    """Return the first-order Sobol indices of log(values); none where a value is not bounded."""
    if values.ndim == 0 or not (np.isfinite(values) & (values > 0.0)).all():
        return {}
    log = np.log(values)
    if log.std() < LEAST_SPREAD:
        return {}
    if len(normal) == 1:
        return dict.fromkeys(normal, 1.0)
    terms = {name: np.hstack((z, (z * z - 1.0) / math.sqrt(2.0))) for name, z in normal.items()}
    basis = np.hstack((np.ones((len(log), 1)), *terms.values()))
    coefficient = np.linalg.lstsq(basis, log, rcond=None)[0]
    rest = float((log - basis @ coefficient).var())  # interactions, and higher degrees
    ends = np.cumsum([term.shape[1] for term in terms.values()])
    parts = [float((part**2).sum()) for part in np.split(coefficient[1:], ends[:-1])]
    return {name: part / (sum(parts) + rest) for name, part in zip(terms, parts, strict=True)}
