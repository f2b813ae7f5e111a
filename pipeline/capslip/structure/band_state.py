"""A joint as it would answer under other inputs: friction, preload, modulus and hardness."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from capslip.contact.curve import NormalCurve
from capslip.contact.joint import Joint
from capslip.contact.press import ContactState
from capslip.contact.scans import curve_of_scans, kappa_of_scans
from capslip.contact.slip import slip_curve
from capslip.contact.varying_load import (
    ROUNDED,
    greatest_over_mean,
    share_at_gross_slip,
    varying,
)
from capslip.settings import Settings
from capslip.structure.answer import Answer

NODES = 5  # states that are solved along what is not certain, odd: the one as found is among them
NODES_OF_PATCHES = 3  # of joints that are pressed unevenly: each costs as much as all patches
# Few contacts, or families, touch in turn: straight lines between more states follow that
FEW, NODES_OF_FEW, NODES_OF_FEW_IN_PATCHES = 50, 17, 9  # the last under a varying load as well
OF_A_MAP = (-0.6, 0.0, 0.6)  # the same, as shares of the widest: about the ends of an interval
# The same of a hardness that moves little, as half the square of a logarithm is two percent there
HARDER, LITTLE = (0.0, 1.0), 0.2
YIELDS_LITTLE = 0.05  # of the contact area, that has yielded
LEAST_J, NO_LOSS_J = 1e-300, 1e-290  # stands for an energy of zero in a logarithm, and is one


Response = Callable[[NormalCurve, Any, Any], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Part:
    """What one scan of a joint says of it."""

    joint: Joint  # as it were if all of it were face as that of this scan
    contact: ContactState  # of the scan
    share: float  # of the joint, for which the scan stands

    @cached_property
    def kappa(self) -> float:
        """Return that of such a joint."""
        return self.joint.kappa(self.contact)


@dataclass(frozen=True, eq=False)
class State:
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
    def as_found(self) -> list[NormalCurve]:
        """Return the curves of the joint as it were if all of it were face as in each scan."""
        return [part.joint.curve(part.contact, self.greatest) for part in self.parts]

    @property
    def greatest(self) -> float:
        """Return the greatest load of a cycle over the preload."""
        return greatest_over_mean(self.settings.slip)

    @cached_property
    def kappa(self) -> float:
        """Return that of the joint."""
        shares, each = [part.share for part in self.parts], [part.kappa for part in self.parts]
        return kappa_of_scans(self.as_found, self.preload_N, shares, each)

    @property
    def ratio(self) -> list[float]:
        """Return that of kappa of each scan to that of the joint."""
        return [part.kappa / self.kappa for part in self.parts]

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
        if self.by_force:
            asked = self.of_the_beam(log)[1] * self.answer.slip_force_N / friction
            held = asked <= self._most_share * self.preload_N * np.exp(log["preload"]) * ROUNDED
        else:  # beyond total slip it has a force, too
            asked = self.answer.displacement_m / (friction * kappa)
            held = np.ones(asked.shape, dtype=bool)
        read = self._of_one_curve if self._has_one_curve(log) else self._of_nodes
        other, loss_J = read(log, asked)
        other = friction * other * (kappa if self.by_force else c)
        energy_J = friction**2 * kappa * c * loss_J
        return np.where(held, other, np.inf), np.where(held, energy_J, np.inf)

    def _has_one_curve(self, log: dict[str, np.ndarray]) -> bool:
        """Tell whether few contacts of one curve answer, and under loads that differ."""
        if self.yields or not self._touch_in_turn or len(self.parts) > 1 or self.greatest > 1.0:
            return False
        return self.parts[0].joint.is_even and bool((log["preload"] != log["modulus"]).any())

    def _of_one_curve(
        self, log: dict[str, np.ndarray], asked: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what `response` says of the curve under the load of each point."""
        curve, c = self.as_found[0], np.exp(log["modulus"])
        load_N = self.preload_N * np.exp(log["preload"]) / c
        at = np.minimum(asked / c, load_N) if self.by_force else asked
        return self.response(curve, curve.approach_m(load_N), at)

    def _of_nodes(
        self, log: dict[str, np.ndarray], asked: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the same between the states of nodes, at equal shares of what each bears."""
        nodes, weight = self._nodes(log)
        node_N = self.preload_N * np.exp(nodes[:, 0])
        curves = self.curves(np.exp(nodes))
        approach_m = [curve.approach_m(N) for curve, N in zip(curves, node_N, strict=True)]
        if self.by_force:
            whole = node_N
            share = np.minimum(asked / (self.preload_N * np.exp(log["preload"])), self._most_share)
        else:
            pairs = zip(approach_m, curves, strict=True)
            whole = np.array([float(d - curve.touch_m) for d, curve in pairs])
            share = asked / np.exp(weight @ np.log(whole))
        share, place = np.unique(share, return_inverse=True)
        rows = [
            self.response(curve, float(d), share * one)
            for curve, d, one in zip(curves, approach_m, whole, strict=True)
        ]
        log_rows = np.log(np.maximum(rows, LEAST_J))[..., place]
        other, loss_J = np.exp(np.einsum("nk,kqn->qn", weight, log_rows))
        nothing = (self.greatest > 1.0) & (loss_J < NO_LOSS_J)  # of a cycle in which nothing slips
        return other, np.where(nothing, 0.0, loss_J)

    def of_the_beam(self, log: dict[str, np.ndarray]) -> tuple[Any, Any]:
        """Return the factors of its modulus on the stiffnesses of the structure, and on the force.

        Of a beam alone, whose force follows from the amplitude where that was asked for.
        """
        if self.settings.structure.modal_stiffness_N_per_m is not None:
            return 1.0, 1.0
        c = np.exp(log["modulus"])
        return c, 1.0 if self.settings.answer.amplitude_m is None else c

    def response(
        self, curve: NormalCurve, approach_m: Any, at: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return withdrawal and loss integral at load drops, or load drop and it at withdrawals.

        Under a load that oscillates what a steady cycle has in their place, one approach at a time.
        """
        if self.greatest == 1.0:
            return self.at_constant_load(curve, approach_m, at)
        load_N = float(curve.load_N(approach_m))
        slip = varying(slip_curve(curve, load_N, 1.0, 1.0), self.settings.slip)
        if self.by_force:
            return slip.displacement_m(at), slip.energy_at_force_J(at)
        return slip.force_N(at), slip.energy_J(at)

    def at_constant_load(
        self, curve: NormalCurve, approach_m: Any, at: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the same as if the load did not oscillate."""
        return (at_force if self.by_force else at_displacement)(curve, approach_m, at)

    @property
    def _most_share(self) -> float:
        """Return the share of mu N at gross slip, 1 unless the load oscillates."""
        slip = self.settings.slip
        return share_at_gross_slip(slip.normal_amplitude_ratio, slip.normal_phase_rad)

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
            for contact in part.joint.loaded(part.contact, self.greatest):
                after = dict.fromkeys(as_found, contact.curve)
                if changes:
                    near = contact.curves_near(changes, share / self.preload_N, self.greatest)
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
                found[i].append(joint.curve_of([of[i] for of in states], part.kappa))
        shares = [part.share for part in self.parts]
        loads_N = self.preload_N * factors[:, 0]
        return [
            curve_of_scans(found[i], float(N), shares, self.ratio) for i, N in enumerate(loads_N)
        ]

    def _nodes(self, log: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return logarithms of factors on preload and hardness at which the curve is asked.

        Shape (k, 2), and the weights of the nodes, (n, k). What counts is N / c and H / c. Along a
        line in their plane the answer moves from one place to another, and lines add up.
        """
        softer = -log["modulus"]
        N, none = log["preload"] + softer, np.zeros(len(softer))
        lines = [((1.0, 0.0), none, N)]
        if self.yields and self._is_map and log["preload"].any():  # of few solutions each counts
            lines.append(((0.0, 1.0), none, log["hardness"] + softer))
        elif self.yields:  # what the modulus moves is taken off the first line, and has its own
            lines = [((1.0, 0.0), softer, N), ((1.0, 1.0), none, softer)]
            lines.append(((0.0, 1.0), none, log["hardness"]))
        nodes, weight = [np.zeros((1, 2))], [np.ones((len(softer), 1))]
        for direction, start, end in lines:
            if (start != end).any():
                at = self._axis(float(np.abs((start, end)).max()), direction[0] == 0.0)
                nodes.append(np.outer(at, direction))
                # At one displacement some nodes may lose energy, others nothing
                kinks = self._touch_in_turn or (self.greatest > 1.0 and not self.by_force)
                weights = _straight if kinks else _weights
                weight.append(weights(at, end) - weights(at, start))
        found, place = np.unique(np.round(np.vstack(nodes), 12), axis=0, return_inverse=True)
        return found, np.hstack(weight) @ np.eye(len(found))[place]

    @property
    def _is_map(self) -> bool:
        """Whether each node is a solution of a map."""
        return any(part.contact.rung.near is not None for part in self.parts)

    @property
    def _touch_in_turn(self) -> bool:
        """Whether a face of caps has so few contacts, or families, that each counts."""
        contacts = [part.contact for part in self.parts]
        few = any(min(one.contacts, len(one.row_family)) < FEW for one in contacts)
        return few and not self._is_map

    def _axis(self, widest: float, of_hardness: bool) -> np.ndarray:
        """Return places up to the widest on either side, zero among them."""
        if not self._is_map:
            even = all(part.joint.is_even for part in self.parts)
            if self._touch_in_turn:
                one_by_one = even and self.greatest == 1.0  # else each takes many solutions
                count = NODES_OF_FEW if one_by_one else NODES_OF_FEW_IN_PATCHES
                return np.linspace(-widest, widest, count)
            count = NODES if even else NODES_OF_PATCHES
            return -widest * np.cos(np.pi * (np.arange(count) + 0.5) / count)
        yielded = max(part.contact.yielded_share for part in self.parts)
        little = of_hardness and yielded <= YIELDS_LITTLE and widest <= LITTLE
        return widest * np.array(HARDER if little else OF_A_MAP)


def at_force(curve: NormalCurve, approach_m: Any, drop_N: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return withdrawal and loss integral."""
    loss_J = curve.loss_integral_at_drop_J(approach_m, drop_N)
    return curve.withdrawal_m(approach_m, drop_N), loss_J


def at_displacement(
    curve: NormalCurve, approach_m: Any, withdrawal_m: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Return load drop and loss integral."""
    loss_J = curve.loss_integral_J(approach_m, withdrawal_m)
    return curve.load_drop_N(approach_m, withdrawal_m), loss_J


def _straight(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the weights (n, k) of straight lines between k growing nodes."""
    return np.array([np.interp(at, nodes, one) for one in np.eye(len(nodes))]).T


def _weights(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the weights (n, k) of Lagrange's polynomial through k nodes."""
    rest = np.eye(len(nodes), dtype=bool)
    ratio = (at[:, None, None] - nodes) / np.where(rest, 1.0, nodes[:, None] - nodes)
    return np.where(rest, 1.0, ratio).prod(axis=-1)
