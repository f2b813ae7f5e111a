"""How far an answer may be off: what is uncertain in it, propagated to every number of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from capslip.contact.accuracy import LEAST_ERROR, OF_STIFFNESS, PAIRS_SHARE
from capslip.contact.curve import NormalCurve
from capslip.contact.joint import Joint
from capslip.contact.press import ContactState
from capslip.contact.scans import curve_of_scans, kappa_of_scans
from capslip.errors import ContactError
from capslip.settings import Settings
from capslip.structure.answer import Answer, numbers_of_state
from capslip.structure.response import MOST_LOSS_FACTOR, Damping
from capslip.structure.sobol import scrambled_sobol

INSIDE = 0.90  # of what may be, in an interval
LOG2_POINTS = 8
NORMAL_95 = 1.96  # standard deviations on either side that hold 95 %
NODES = 5  # preloads that are solved where the preload is not certain
NODES_OF_PATCHES = 3  # the same, of a joint that is pressed unevenly
NODES_OF_HARDNESS = 3  # the same of the hardness, at the preload
OF_A_MAP = (-0.6, 0.0, 0.6)  # of either, as shares of the widest: about the ends of an interval
# The same of a hardness that moves little, as half the square of a logarithm is two percent there
HARDER, LITTLE = (0.0, 1.0), 0.2
YIELDS_LITTLE = 0.05  # of the contact area, that has yielded
COUNTED = ("tangential_stiffness_N_per_m", "energy_J", "joint_loss_factor", "loss_factor")
OF_BOTH = ("caps", "model", "scans", "direction")  # move displacement and energy by factors
OF_MODEL = "error of the model"  # in the list of what an interval leaves out
OF_LIGHT_DAMPING = ("loss_factor", "damping_ratio")
LEAST_SPREAD = 1e-9  # standard deviation of a logarithm that is more than rounding
LEAST_J = 1e-300  # stands for an energy of zero in a logarithm
STEP = 0.01  # of a displacement, for a slope
WHOLE = 0.99  # coverage from which a scan is taken for its joint


@dataclass(frozen=True)
class Band:
    """Intervals of an `Answer`, made by `band_of`."""

    interval: dict[str, tuple[float, float]]  # by the name of the number; infinite: no bound
    contributions: dict[str, dict[str, float]]  # share of each input in the variance of a number
    left_out: tuple[str, ...]  # what is uncertain by an amount that is not known


@dataclass(frozen=True, eq=False)
class Part:
    """What one scan of a joint says of it."""

    joint: Joint  # as it were if all of it were face as that of this scan
    contact: ContactState  # of the scan
    share: float  # of the joint, for which the scan stands


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
        where the model cannot carry a preload that may be, and where the normal load oscillates.

    Notes
    -----
    Every factor on displacement and energy is log-normal. Caps: covariance of the two over the
    caps moved at random. Model: the other causes of `error_of_caps` and the difference to
    interacting caps, each as it changes this state; the estimated error of a model without caps,
    and what few solved pressures leave of a joint of many, move either of the two alone, as nothing
    tells how they go together. Direction: what kappa is in all directions of slip, where that is
    beyond the tolerance. Friction mu, preload P, modulus (a factor c on E*) and hardness H follow
    from the curve: nothing but H / E* and N / E* counts in the shape of N(d), so with the share t =
    T / (mu P) at the load N = P / c and the hardness H / c of the curve as it was solved::

        delta = mu kappa e(N, H / c, t),  W = mu^2 kappa c L(N, H / c, t)

    with the withdrawal e and the loss integral L of the curve along which the face unloads from N,
    in logarithms one polynomial over N and, where the face yields, one over H. The level of the
    face stays that under its preload. On a joint that is pressed unevenly the caps are those of the
    patch that carries most. The inputs are drawn at 256 points of a scrambled Sobol sequence. The
    share of an input is its first-order Sobol index for the logarithm of the number, from an
    expansion in Hermite polynomials up to the second degree (Sudret, Reliab. Eng. Syst. Saf. 93
    (2008) 964); what is missing to 1 are interactions.

    Friction, preload, modulus and hardness are those of all scans, and so are the causes of the
    error of the model. Those of the caps are each scan's own. To these comes the scatter between k
    scans: the standard error of their mean, from the joint as it were without one of them, each in
    turn (jackknife, Efron and Stein, Ann. Stat. 9 (1981) 586)::

        C = (k - 1) / k sum_i (x_(-i) - mean)(x_(-i) - mean)^T,  x = (log delta or log T, log W)

    In the intervals it is drawn from Student's distribution of k - 1 degrees of freedom, which two
    scans make 3.8 times as wide as the normal one and three 1.8 times; in the shares from the
    normal one, as the variance of the other has no bound for up to three scans. It holds the caps'
    errors, too, so these count twice. That the scans are a part of a finite joint is not used.
    """
    if answer is None or not answer.displacement_m > 0.0:
        return None
    if settings.slip.normal_amplitude_ratio > 0.0:
        return None
    by_force = settings.answer.displacement_m is None
    state = _State(answer, by_force, tuple(parts), settings, noise_known)
    try:
        return _propagated(state, damping)
    except ContactError:
        return None


def _propagated(state: "_State", damping: Damping) -> Band | None:
    """Return the band of a state that moves; None where nothing is known to be uncertain."""
    material, contact = state.settings.material, state.settings.contact
    caps, model = _of_caps_and_model(state)
    spreads = {
        "caps": caps,
        "model": model,
        "scans": _of_scatter(state),
        "direction": _of_direction(state),
        "friction": np.array([[material.friction_spread / NORMAL_95]]),
        "preload": np.array([[contact.preload_spread / NORMAL_95]]),
        "modulus": np.array([[material.modulus_spread / NORMAL_95]]),
    }
    if state.yields:
        spreads["hardness"] = np.array([[material.hardness_spread / NORMAL_95]])
    uncertain = [name for name, spread in spreads.items() if spread.any()]
    left_out = _left_out(state)
    # What the direction of slip moves alone is no interval of a model whose error is not known
    if not uncertain or (uncertain == ["direction"] and OF_MODEL in left_out):
        return None
    normal = _drawn({name: len(spreads[name]) for name in uncertain})
    points = 2**LOG2_POINTS
    log = {name: np.zeros((points, len(spread))) for name, spread in spreads.items()}
    log |= {name: normal[name] @ spreads[name] for name in uncertain}
    given = {name: of[:, 0] for name, of in log.items() if name not in OF_BOTH}
    found, W = state.under(given)

    def numbers_with(scans: np.ndarray) -> dict[str, np.ndarray]:
        with np.errstate(over="ignore"):
            moved = np.exp(log["caps"] + log["model"] + log["direction"] + scans)
            other, energy_J = found * moved[:, 0], W * moved[:, 1]
        stays = state.answer.slip_force_N if state.by_force else state.answer.displacement_m
        T, delta = (stays, other) if state.by_force else (other, stays)
        energy_J = np.minimum(energy_J, 4.0 * T * delta)  # no cycle is larger than its rectangle
        numbers = numbers_of_state(T, delta, energy_J, damping).items()
        return {name: one for name, one in numbers if getattr(state.answer, name) is not None}

    kept = numbers_with(log["scans"])
    wide = kept
    if "scans" in uncertain:
        wide = numbers_with(_students(normal["scans"], len(state.parts)) @ spreads["scans"])
    return Band(
        {name: _interval(name, np.broadcast_to(one, points)) for name, one in wide.items()},
        {name: _contributions(kept[name], normal) for name in COUNTED if name in kept},
        left_out,
    )


def _left_out(state: "_State") -> tuple[str, ...]:
    parts, unknown = state.parts, []
    if any(part.contact.estimated_error is None for part in parts):
        unknown.append(OF_MODEL)
    if not state.noise_known and any(part.contact.rung.made_from == "map" for part in parts):
        unknown.append("noise of the map that pixels share")
    coverage = parts[0].joint.coverage
    if len(parts) == 1 and coverage is not None and coverage < WHOLE:
        unknown.append("scatter between scans")
    return tuple(unknown)


@dataclass(frozen=True, eq=False)
class _State:
    """The state that was answered for, of the joint and of the scans in it."""

    answer: Answer
    by_force: bool  # whether the slip force stays, or the displacement
    parts: tuple[Part, ...]
    settings: Settings
    noise_known: bool = False

    @property
    def preload_N(self) -> float:
        """Return that of the joint."""
        return self.parts[0].joint.preload_N

    @cached_property
    def kappa(self) -> float:
        """Return that of the joint."""
        contacts = [part.contact for part in self.parts]
        return kappa_of_scans(contacts, [part.share for part in self.parts])

    @property
    def yields(self) -> bool:
        """Tell whether a face has a first loading of its own."""
        return any(part.contact.first is not None for part in self.parts)

    def under(self, log: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return what does not stay (displacement or force) and the energy, each (n,).

        Parameters are the logarithms of factors, each (n,), by the name of the input. Infinite
        under a force above mu P.
        """
        friction = self.settings.material.friction_coefficient * np.exp(log["friction"])
        kappa, c = self.kappa, np.exp(log["modulus"])
        log_N = log["preload"] - log["modulus"]
        log_H = log.get("hardness", 0.0) - log["modulus"]
        nodes, weight = self._nodes(log_N, log_H)
        node_N = self.preload_N * np.exp(nodes[:, 0])
        curves = self.curves(np.exp(nodes))
        approach_m = [curve.approach_m(N) for curve, N in zip(curves, node_N, strict=True)]
        if self.by_force:
            whole = node_N
            share = self.answer.slip_force_N / friction
            share = share / (self.preload_N * np.exp(log["preload"]))
        else:
            pairs = zip(approach_m, curves, strict=True)
            whole = np.array([float(d - curve.touch_m) for d, curve in pairs])
            share = self.answer.displacement_m / (friction * kappa)
            share = share / np.exp(weight @ np.log(whole))
        most = 1.0 if self.by_force else np.inf  # a displacement beyond total slip has a force
        held = share <= most * (1.0 + 1e-12)
        share, place = np.unique(np.minimum(share, most), return_inverse=True)
        rows = [
            self.response(curve, float(d), share * one)
            for curve, d, one in zip(curves, approach_m, whole, strict=True)
        ]
        log_rows = np.log(np.maximum(rows, LEAST_J))[..., place]
        other, loss_J = np.exp(np.einsum("nk,kqn->qn", weight, log_rows))
        other = friction * other * (kappa if self.by_force else c)
        energy_J = friction**2 * kappa * c * loss_J
        return np.where(held, other, np.inf), np.where(held, energy_J, np.inf)

    def response(
        self, curve: NormalCurve, approach_m: Any, at: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return withdrawal and loss integral at load drops, or load drop and it at withdrawals."""
        if self.by_force:
            loss_J = curve.loss_integral_at_drop_J(approach_m, at)
            return curve.withdrawal_m(approach_m, at), loss_J
        return curve.load_drop_N(approach_m, at), curve.loss_integral_J(approach_m, at)

    def curves(self, factors: np.ndarray) -> list[NormalCurve]:
        """Return the curves along which the joint unloads.

        Parameters
        ----------
        factors : float64, shape (k, 2)
            On the preload and on the hardness.
        """
        found: dict[int, list[NormalCurve]] = {i: [] for i in range(len(factors))}
        as_found = [i for i, one in enumerate(factors) if (one == 1.0).all()]
        others = [i for i in found if i not in as_found]
        share = self.answer.slip_force_N / self.settings.material.friction_coefficient
        changes = [(float(N), float(hardness)) for N, hardness in factors[others]]
        for part in self.parts:
            states = []  # of each patch, by its place in the factors
            for contact in part.joint.loaded(part.contact):
                after = dict.fromkeys(as_found, contact.curve)
                if changes:
                    near = contact.curves_near(changes, share / self.preload_N)
                    after |= dict(zip(others, near, strict=True))
                loads_N = contact.preload_N * factors[:, 0]
                states.append(
                    {
                        i: replace(contact, curve=curve, preload_N=float(loads_N[i]))
                        for i, curve in after.items()
                    }
                )
            for i in found:
                joint = part.joint.under(self.preload_N * float(factors[i, 0]))
                found[i].append(joint.curve_of([of[i] for of in states]))
        shares = [part.share for part in self.parts]
        loads_N = self.preload_N * factors[:, 0]
        return [curve_of_scans(found[i], float(N), shares) for i, N in enumerate(loads_N)]

    def _nodes(self, log_N: np.ndarray, log_H: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return logarithms of factors on preload and hardness at which the curve is asked.

        Shape (k, 2), and the weights of the nodes, (n, k). What the two do together is left out.
        """
        even = all(part.joint.is_even for part in self.parts)
        count = NODES if even else NODES_OF_PATCHES
        loads = self._axis(float(np.abs(log_N).max()), count)
        weight = _weights(loads, log_N)
        nodes = np.column_stack((loads, np.zeros(len(loads))))
        if not self.yields or not log_H.any():
            return nodes, weight
        widest = float(np.abs(log_H).max())
        hard = self._axis(widest, NODES_OF_HARDNESS)
        yielded = max(part.contact.yielded_share for part in self.parts)
        if self._is_map and yielded <= YIELDS_LITTLE and widest <= LITTLE:
            hard = widest * np.array(HARDER)
        nodes = np.vstack((nodes, np.column_stack((np.zeros(len(hard)), hard)), np.zeros((1, 2))))
        weight = np.hstack((weight, _weights(hard, log_H), np.full((len(log_N), 1), -1.0)))
        nodes, place = np.unique(np.round(nodes, 12), axis=0, return_inverse=True)
        return nodes, weight @ np.eye(len(nodes))[place]

    @property
    def _is_map(self) -> bool:
        """Whether each node is a solution of a map."""
        return any(part.contact.rung.near is not None for part in self.parts)

    def _axis(self, widest: float, count: int) -> np.ndarray:
        """Return places up to the widest on either side."""
        if widest == 0.0:
            return np.zeros(1)
        if self._is_map:
            return widest * np.array(OF_A_MAP)
        return -widest * np.cos(np.pi * (np.arange(count) + 0.5) / count)


def _of_caps_and_model(state: _State) -> tuple[np.ndarray, np.ndarray]:
    """Return roots of the covariances of what is found and the energy, in their logarithms.

    Each scan at its own state: under the force or the displacement of a joint of its face alone.
    Errors of the caps of two scans have nothing in common, those of the model all.
    """
    caps, model = zip(*(_of_one(state, part) for part in state.parts), strict=True)
    if len(state.parts) == 1:
        return caps[0], model[0]
    share = np.array([part.share for part in state.parts])
    of_caps = [s * root for s, root in zip(share, caps, strict=True)]
    of_model = [math.sqrt(s) * root for s, root in zip(share, model, strict=True)]
    return _root(np.vstack(of_caps)), _root(np.vstack(of_model))


def _of_one(state: _State, part: Part) -> tuple[np.ndarray, np.ndarray]:
    moved, contact = part.contact.moved, part.contact
    friction = state.settings.material.friction_coefficient
    share = min(state.answer.slip_force_N / (friction * state.preload_N), 1.0)
    if moved is None:
        known = [one for one in (contact.errors, contact.patch_errors) if one is not None]
        of_each = np.array([(one.stiffness, one.energy_at(share)) for one in known]).reshape(-1, 2)
        return np.zeros((2, 2)), np.diag(np.linalg.norm(of_each, axis=0)) / NORMAL_95
    if state.by_force:
        at = state.answer.slip_force_N / (friction * state.preload_N) * contact.preload_N
    else:
        at = state.answer.displacement_m / (friction * contact.composite.kappa)

    def log_of(curve: NormalCurve) -> np.ndarray:
        """Return both logarithms, shape (2,), or (s, 2) of sets."""
        approach_m = curve.approach_m(contact.preload_N)
        return _log(state.response(curve, approach_m, np.asarray(at))).T

    log = log_of(moved.found)
    *random, by_shape = log_of(moved.moved) - log
    others = [2.0 * by_shape, PAIRS_SHARE * (log_of(moved.by_pairs) - log)]
    others += [] if moved.by_level is None else [log_of(moved.by_level) - log]
    # Of caps that yielded either of the two alone: nothing tells how they go together
    others += [log_of(contact.curve) - log, *np.diag((OF_STIFFNESS, 1.0)) * moved.of_unloading]
    others += [*np.diag(moved.of_profiles(share)), *(LEAST_ERROR * np.eye(2))]
    return _root(np.array(random) / math.sqrt(len(random))), _root(np.array(others) / NORMAL_95)


def _of_scatter(state: _State) -> np.ndarray:
    """Return a root of the covariance that the scatter between scans gives their mean."""
    parts, friction = state.parts, state.settings.material.friction_coefficient
    if len(parts) == 1:
        return np.zeros((2, 2))
    curves = [part.joint.curve(part.contact) for part in parts]
    share = np.array([part.share for part in parts])
    if state.by_force:  # that of total slip at most, which rounding must not pass
        at = min(state.answer.slip_force_N / friction, state.preload_N)
    else:
        at = state.answer.displacement_m / (friction * state.kappa)
    log = []
    for i in range(len(parts)):
        rest = np.delete(share, i) / np.delete(share, i).sum()
        curve = curve_of_scans([*curves[:i], *curves[i + 1 :]], state.preload_N, rest)
        approach_m = float(curve.approach_m(state.preload_N))
        log.append(_log(state.response(curve, approach_m, np.asarray(at))))
    change = np.array(log) - np.mean(log, axis=0)
    root = _root(math.sqrt((len(parts) - 1) / len(parts)) * change)
    return np.where(np.abs(root).max() > LEAST_SPREAD, root, 0.0)


def _of_direction(state: _State) -> np.ndarray:
    """Return a root of the covariance that an unknown direction of slip leaves.

    Of (a cos 2 phi, b cos 2 (phi - c)) over all phi; zero within the tolerance, as it is said.
    """
    slip, swings = state.settings.slip, np.zeros(2, dtype=complex)
    for part in state.parts:
        if part.contact.lay is not None:
            swings += part.share * np.array(part.contact.lay.left_open(slip.direction_rad))
    if np.abs(swings).max() <= state.settings.contact.tolerance:
        return np.zeros((2, 2))
    if not state.by_force:  # where the force goes with the displacement, and the energy with both
        curve = state.curves(np.ones((1, 2)))[0]
        e = state.answer.displacement_m
        e /= state.settings.material.friction_coefficient * state.kappa
        near = e * np.array([1.0 - STEP, 1.0 + STEP])
        log = _log(state.response(curve, float(curve.approach_m(state.preload_N)), near))
        slope = (log[:, 1] - log[:, 0]) / np.log(near[1] / near[0])
        swings = np.array([0.0, swings[1]]) - slope * swings[0]
    return np.array([swings.real, swings.imag]) / math.sqrt(2.0)


def _students(normal: np.ndarray, scans: int) -> np.ndarray:
    """Return normal numbers as those of Student's distribution with the same probability."""
    from scipy.special import ndtr, stdtrit

    return np.asarray(stdtrit(scans - 1, ndtr(normal)))


def _log(found: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    return np.log(np.maximum(found, LEAST_J))


def _root(changes: np.ndarray) -> np.ndarray:
    """Return two rows with the same sum of squares and products as many rows of two."""
    variance, axis = np.linalg.eigh(changes.T @ changes)
    return np.sqrt(np.maximum(variance, 0.0))[:, None] * axis.T


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


def _weights(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the weights (n, k) of Lagrange's polynomial through k nodes."""
    rest = np.eye(len(nodes), dtype=bool)
    ratio = (at[:, None, None] - nodes) / np.where(rest, 1.0, nodes[:, None] - nodes)
    return np.where(rest, 1.0, ratio).prod(axis=-1)


def _interval(name: str, values: np.ndarray) -> tuple[float, float]:
    """Return the interval of a number; infinite where there is no bound."""
    values = np.where(np.isnan(values), np.inf, values)
    if name in OF_LIGHT_DAMPING:
        most = MOST_LOSS_FACTOR / (1.0 if name == "loss_factor" else 2.0)
        values = np.where(values > most, np.inf, values)
    tail = 0.5 * (1.0 - INSIDE)
    low, high = np.quantile(values, (tail, 1.0 - tail), method="inverted_cdf")
    return float(low), float(high)


def _contributions(values: np.ndarray, normal: dict[str, np.ndarray]) -> dict[str, float]:
    """Return the first-order Sobol indices of log(values); none where a value is not bounded."""
    if values.ndim == 0 or not (np.isfinite(values) & (values > 0.0)).all():
        return {}
    log = np.log(values)
    if log.std() < LEAST_SPREAD:
        return {}
    terms = {name: np.hstack((z, (z * z - 1.0) / math.sqrt(2.0))) for name, z in normal.items()}
    basis = np.hstack((np.ones((len(log), 1)), *terms.values()))
    coefficient = np.linalg.lstsq(basis, log, rcond=None)[0]
    rest = float((log - basis @ coefficient).var())  # interactions, and higher degrees
    ends = np.cumsum([term.shape[1] for term in terms.values()])
    parts = [float((part**2).sum()) for part in np.split(coefficient[1:], ends[:-1])]
    return {name: part / (sum(parts) + rest) for name, part in zip(terms, parts, strict=True)}
