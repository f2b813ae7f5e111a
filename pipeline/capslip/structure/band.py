"""How far an answer may be off: what is uncertain in it, propagated to every number of it."""

import math
from dataclasses import dataclass, replace

import numpy as np

from capslip.contact.accuracy import LEAST_ERROR
from capslip.contact.curve import NormalCurve
from capslip.contact.joint import Joint
from capslip.contact.press import ContactState
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
NODES_OF_A_MAP = 2  # of either, where each is a solution of the whole map
COUNTED = ("tangential_stiffness_N_per_m", "energy_J", "joint_loss_factor", "loss_factor")
OF_LIGHT_DAMPING = ("loss_factor", "damping_ratio")
LEAST_SPREAD = 1e-9  # standard deviation of a logarithm that is more than rounding
LEAST_J = 1e-300  # stands for an energy of zero in a logarithm


@dataclass(frozen=True)
class Band:
    """Intervals of an `Answer`, made by `band_of`."""

    interval: dict[str, tuple[float, float]]  # by the name of the number; infinite: no bound
    contributions: dict[str, dict[str, float]]  # share of each input in the variance of a number
    left_out: tuple[str, ...]  # what is uncertain by an amount that is not known


def band_of(
    answer: Answer | None,
    joint: Joint,
    contact: ContactState,
    damping: Damping,
    settings: Settings,
) -> Band | None:
    """Return the 90 % intervals of an answer, and which input contributes how much to them.

    Parameters
    ----------
    answer : Answer or None
        To the question of the settings.
    joint : Joint
        Of which the face is a part.
    contact : ContactState
        Of the face, with its estimated error and its caps moved within their errors.
    damping : Damping
        Of the structure; its stiffnesses count.
    settings : Settings
        The question, and the spreads of friction, preload, moduli and hardness.

    Returns
    -------
    Band or None
        None where there is no answer, where nothing moves, where nothing is known to be uncertain,
        where the model cannot carry a preload that may be, and where the normal load oscillates.

    Notes
    -----
    Every factor on displacement and energy is log-normal. Caps: covariance of the two over the
    caps moved at random. Model: the other causes of `error_of_caps` and the difference to
    interacting caps, each as it changes this state; the estimated error of a model without caps
    moves either of the two alone, as nothing tells how they go together. Friction mu, preload P,
    modulus (a factor c on E*) and hardness H follow from the curve: nothing but H / E* and N / E*
    counts in the shape of N(d), so with the share t = T / (mu P) at the load N = P / c and the
    hardness H / c of the curve as it was solved::

        delta = mu kappa e(N, H / c, t),  W = mu^2 kappa c L(N, H / c, t)

    with the withdrawal e and the loss integral L of the curve along which the face unloads from N,
    in logarithms one polynomial over N and, where the face yields, one over H. The level of the
    face stays that under its preload. On a joint that is pressed unevenly the caps are those of the
    patch that carries most. The inputs are drawn at 256 points of a scrambled Sobol sequence. The
    share of an input is its first-order Sobol index for the logarithm of the number, from an
    expansion in Hermite polynomials up to the second degree (Sudret, Reliab. Eng. Syst. Saf. 93
    (2008) 964); what is missing to 1 are interactions.
    """
    if answer is None or not answer.displacement_m > 0.0:
        return None
    if settings.slip.normal_amplitude_ratio > 0.0:
        return None
    state = _State(answer, settings.answer.displacement_m is None, joint, contact, settings)
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
        "friction": np.array([[material.friction_spread / NORMAL_95]]),
        "preload": np.array([[contact.preload_spread / NORMAL_95]]),
        "modulus": np.array([[material.modulus_spread / NORMAL_95]]),
    }
    if state.contact.first is not None:
        spreads["hardness"] = np.array([[material.hardness_spread / NORMAL_95]])
    uncertain = [name for name, spread in spreads.items() if spread.any()]
    if not uncertain:
        return None
    normal = _drawn({name: len(spreads[name]) for name in uncertain})
    points = 2**LOG2_POINTS
    log = {name: np.zeros((points, len(spread))) for name, spread in spreads.items()}
    log |= {name: normal[name] @ spreads[name] for name in uncertain}
    given = {name: of[:, 0] for name, of in log.items() if name not in ("caps", "model")}
    found, W = state.under(given)
    moved = np.exp(log["caps"] + log["model"])
    found, W = found * moved[:, 0], W * moved[:, 1]
    stays = state.answer.slip_force_N if state.by_force else state.answer.displacement_m
    T, delta = (stays, found) if state.by_force else (found, stays)
    numbers = numbers_of_state(T, delta, W, damping)
    kept = {name: one for name, one in numbers.items() if getattr(state.answer, name) is not None}
    return Band(
        {name: _interval(name, np.broadcast_to(one, points)) for name, one in kept.items()},
        {name: _contributions(kept[name], normal) for name in COUNTED if name in kept},
        _left_out(state.contact),
    )


def _left_out(contact: ContactState) -> tuple[str, ...]:
    unknown = ("error of the model",) if contact.estimated_error is None else ()
    return (*unknown, "noise of the map") if contact.rung.made_from == "map" else unknown


@dataclass(frozen=True, eq=False)
class _State:
    """The state that was answered for, of the joint and of the scan in it."""

    answer: Answer
    by_force: bool  # whether the slip force stays, or the displacement
    joint: Joint
    contact: ContactState
    settings: Settings

    def under(self, log: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return what does not stay (displacement or force) and the energy, each (n,).

        Parameters are the logarithms of factors, each (n,), by the name of the input. Infinite
        under a force above mu P.
        """
        friction = self.settings.material.friction_coefficient * np.exp(log["friction"])
        kappa, c = self.contact.composite.kappa, np.exp(log["modulus"])
        log_N = log["preload"] - log["modulus"]
        log_H = log.get("hardness", 0.0) - log["modulus"]
        nodes, weight = self._nodes(log_N, log_H)
        node_N = self.joint.preload_N * np.exp(nodes[:, 0])
        curves = [
            self._curve(N, factor) for N, factor in zip(node_N, np.exp(nodes[:, 1]), strict=True)
        ]
        approach_m = [curve.approach_m(N) for curve, N in zip(curves, node_N, strict=True)]
        if self.by_force:
            whole = node_N
            share = self.answer.slip_force_N / friction
            share = share / (self.joint.preload_N * np.exp(log["preload"]))
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
        self, curve: NormalCurve, approach_m: float, at: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return withdrawal and loss integral at load drops, or load drop and it at withdrawals."""
        if self.by_force:
            loss_J = curve.loss_integral_at_drop_J(approach_m, at)
            return curve.withdrawal_m(approach_m, at), loss_J
        return curve.load_drop_N(approach_m, at), curve.loss_integral_J(approach_m, at)

    def _curve(self, preload_N: float, hardness_factor: float) -> NormalCurve:
        """Return the curve along which the joint unloads from a preload."""
        joint = self.joint.under(preload_N)
        after = self.contact.curve_after(joint.scan_load_N, hardness_factor)
        return joint.curve(replace(self.contact, curve=after))

    def _nodes(self, log_N: np.ndarray, log_H: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return logarithms of factors on preload and hardness at which the curve is asked.

        Shape (k, 2), and the weights of the nodes, (n, k). What the two do together is left out.
        """
        count = NODES if self.joint.is_even else NODES_OF_PATCHES
        loads = self._axis(float(np.abs(log_N).max()), count)
        weight = _weights(loads, log_N)
        nodes = np.column_stack((loads, np.zeros(len(loads))))
        if self.contact.first is None or not log_H.any():
            return nodes, weight
        hard = self._axis(float(np.abs(log_H).max()), NODES_OF_HARDNESS)
        nodes = np.vstack((nodes, np.column_stack((np.zeros(len(hard)), hard)), np.zeros((1, 2))))
        weight = np.hstack((weight, _weights(hard, log_H), np.full((len(log_N), 1), -1.0)))
        nodes, place = np.unique(np.round(nodes, 12), axis=0, return_inverse=True)
        return nodes, weight @ np.eye(len(nodes))[place]

    def _axis(self, widest: float, count: int) -> np.ndarray:
        if widest == 0.0:
            return np.zeros(1)
        if self.contact.rung.solved_loads_N is not None:
            return np.linspace(-widest, 0.0, NODES_OF_A_MAP)
        return -widest * np.cos(np.pi * (np.arange(count) + 0.5) / count)


def _of_caps_and_model(state: _State) -> tuple[np.ndarray, np.ndarray]:
    """Return roots of the covariances of what is found and the energy, in their logarithms."""
    moved, contact = state.contact.moved, state.contact
    if moved is None:
        return np.zeros((2, 2)), (contact.estimated_error or 0.0) / NORMAL_95 * np.eye(2)
    friction = state.settings.material.friction_coefficient
    if state.by_force:
        at = state.answer.slip_force_N / (friction * state.joint.preload_N) * contact.preload_N
    else:
        at = state.answer.displacement_m / (friction * contact.composite.kappa)

    def log_of(curve: NormalCurve) -> np.ndarray:
        approach_m = float(curve.approach_m(contact.preload_N))
        found = state.response(curve, approach_m, np.asarray(at))
        return np.log(np.maximum(found, LEAST_J))

    log = log_of(moved.found)
    random = np.array([log_of(curve) - log for curve in moved.at_random])
    others = [2.0 * (log_of(moved.by_shape) - log), log_of(moved.by_pairs) - log]
    others += [] if moved.by_level is None else [log_of(moved.by_level) - log]
    others += [log_of(contact.curve) - log, np.array([0.0, moved.of_unloading])]
    others += [*(LEAST_ERROR * np.eye(2))]
    return _root(random / math.sqrt(len(random))), _root(np.array(others) / NORMAL_95)


def _root(changes: np.ndarray) -> np.ndarray:
    """Return two rows with the same sum of squares and products as many rows of two."""
    variance, axis = np.linalg.eigh(changes.T @ changes)
    return np.sqrt(np.maximum(variance, 0.0))[:, None] * axis.T


def _drawn(columns: dict[str, int]) -> dict[str, np.ndarray]:
    """Return independent normal numbers for each input, (POINTS, columns)."""
    from scipy.special import ndtri

    drawn = ndtri(scrambled_sobol(sum(columns.values()), LOG2_POINTS))
    ends = np.cumsum(list(columns.values()))
    return dict(zip(columns, np.split(drawn, ends[:-1], axis=1), strict=True))


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
