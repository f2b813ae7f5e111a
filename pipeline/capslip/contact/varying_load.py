"""Slip under a normal load that oscillates with the tangential force, from the normal curve.

The traction of an uncoupled contact is a sum over the loads s at which the contact was as large as
it was then: q = sum of tau(s) dp(s) with |tau| <= mu (Jaeger 1998; Barber, Davies and Hills 2011).
So the state is one function tau(s), 0 < s < P, from which

    Q = integral of tau ds,    U = kappa integral of tau (d approach / ds) ds

With growing load new levels take the slope dQ/dP as long as it is below mu, and nothing slips;
with falling load the uppermost levels leave. What is then missing in Q is made up by slip from the
edge inwards, which turns the uppermost levels to +mu or -mu. At constant load this is the theorem
of Cattaneo, Mindlin and Jaeger, and `slip_curve` its closed form. Losses of a Hertz contact of this
kind: Putignano, Ciavarella and Barber, J. Mech. Phys. Solids 59 (2011) 2442.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.curve import NormalCurve
from capslip.contact.slip import SlipCurve, check_one_amplitude
from capslip.contact.solvers.refined_spline import refined_spline
from capslip.errors import SettingsError

if TYPE_CHECKING:
    from capslip.settings import SlipSettings

STEPS = 240  # of one cycle: W to 2e-4 of itself
FOLLOWED = 512  # cycles that are kept: as many as one curve asks for, and others ask again
# Forces at which cycles are followed first; between them displacement and W^(1/3), both over the
# force, are interpolated, to so much of their greatest
NODES, INTERPOLATED = 36, 1e-4
HALVINGS = 50  # of a step between two of these, where the force is sought
ROUNDING = 1e-12  # of force times way, below which an energy is none
ROUNDED = 1.0 + 1e-12  # of a limit: up to there it is beyond by rounding alone
LEAST_SHARE = 1e-4  # of the force at gross slip: below it W is in proportion to T^3 or T^2
WITHDRAWN = 1e-7  # of the withdrawal at no load, to which it is known at any load
LOADS, SMALL_DROPS = 64, 24  # at which it is solved first
# Of a curve, by its load and cycle: the interval of an answer asks for the cycles of the joint
_known: WeakKeyDictionary[NormalCurve, dict[tuple[Any, ...], Any]] = WeakKeyDictionary()


def greatest_over_mean(settings: "SlipSettings") -> float:
    """Return the greatest load of a cycle over the preload."""
    return 1.0 + settings.normal_amplitude_ratio


def share_at_gross_slip(ratio: float, phase_rad: float) -> float:
    """Return the force at gross slip over mu times the preload: 1 at constant load."""
    r, c = ratio, abs(math.cos(phase_rad))
    return math.sqrt(1.0 - r * r * (1.0 - c * c)) - r * c


def varying(slip: SlipCurve, settings: "SlipSettings") -> SlipCurve:
    """Return the slip of a joint whose normal load oscillates as the settings say, if it does.

    Parameters
    ----------
    slip : SlipCurve
        At constant load.
    settings : SlipSettings
        `normal_amplitude_ratio` of the normal load's amplitude to its mean, at most 0.9, and
        `normal_phase_rad` by which it lags the tangential force.
    """
    if settings.normal_amplitude_ratio == 0.0:
        return slip
    return VaryingSlip(
        slip.curve,
        slip.preload_N,
        slip.approach_m,
        slip.friction_coefficient,
        slip.kappa,
        settings.normal_amplitude_ratio,
        settings.normal_phase_rad,
    )


@dataclass(frozen=True, eq=False)
class VaryingSlip(SlipCurve):
    """Slip of a joint under N (1 + ratio cos(wt - phase)) and T cos(wt), in the steady cycle.

    Displacements are half of what the joint moves to and fro, forces the amplitude T. The other
    properties (stiffness before any slip, limits of each row) are those at the mean load.
    """

    normal_amplitude_ratio: float = 0.0
    normal_phase_rad: float = 0.0

    @property
    def total_slip_force_N(self) -> Any:
        """The greatest T at which |Q| stays below mu P all the time."""
        return self.friction_coefficient * self.preload_N * self._most

    @property
    def total_slip_displacement_m(self) -> Any:
        """Amplitude of the displacement at that force."""
        return float(self._table[1, -1])

    def displacement_m(self, force_N: ArrayLike) -> np.ndarray:
        """delta(T): half of the way to and fro; infinite beyond gross slip."""
        return self._at(force_N, 1)

    def energy_at_force_J(self, force_N: ArrayLike) -> np.ndarray:
        """W of one cycle of Q over U; infinite beyond gross slip."""
        return self._at(force_N, 2) ** 3

    def force_N(self, displacement_m: ArrayLike) -> np.ndarray:
        """T(delta), the inverse of `displacement_m`; NaN beyond gross slip."""
        force_N, delta_m, _ = self._table
        wanted = np.asarray(displacement_m, dtype=float)
        inside = np.clip(wanted, delta_m[0], delta_m[-1])
        above = np.clip(np.searchsorted(delta_m, inside), 1, len(delta_m) - 1)
        T = self.total_slip_force_N
        low, high = np.log(force_N[above - 1] / T), np.log(force_N[above] / T)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            less = T * np.exp(middle) * self._over_force_at(middle)[..., 0] < inside
            low, high = np.where(less, middle, low), np.where(less, high, middle)
        found = np.where(inside < delta_m[-1], T * np.exp(0.5 * (low + high)), force_N[-1])
        found = np.where(wanted < delta_m[0], wanted * force_N[0] / delta_m[0], found)
        return np.asarray(np.where(wanted <= delta_m[-1] * ROUNDED, found, np.nan))

    def energy_J(self, displacement_m: ArrayLike) -> np.ndarray:
        """W of one cycle over delta; NaN beyond gross slip."""
        force_N = self.force_N(displacement_m)
        steady = np.isfinite(force_N)
        return np.where(steady, self.energy_at_force_J(np.where(steady, force_N, 0.0)), np.nan)

    def loop(self, amplitude_m: float, n_points: int = 201) -> tuple[np.ndarray, np.ndarray]:
        """Return displacement and force once around the steady cycle of one amplitude.

        Displacements from the preloaded joint: the middle of the way to and fro is beside zero.
        NaN beyond gross slip.
        """
        check_one_amplitude(amplitude_m)
        share = float(self.force_N(amplitude_m)) / self.total_slip_force_N
        _, force_N, displacement_m = self._cycle(share, n_points - 1)
        return displacement_m, force_N

    @property
    def _most(self) -> float:
        """The force at gross slip over mu times the preload."""
        return share_at_gross_slip(self.normal_amplitude_ratio, self.normal_phase_rad)

    @cached_property
    def _top(self) -> tuple[float, float]:
        """The greatest load of the cycle, and its approach: all else is counted down from there."""
        greatest_N = self.preload_N * (1.0 + self.normal_amplitude_ratio)
        return greatest_N, float(self.curve.approach_m(greatest_N))

    @cached_property
    def _withdrawal_m(self) -> Callable[[np.ndarray], np.ndarray]:
        """Withdrawal from the top over u = 1 - (1 - drop / greatest load)^(1/3).

        All cycles together ask at some 60,000 loads, each of them one solution for caps that act
        on one another. In u it is smooth up to no load.
        """
        greatest_N, top_m = self._top

        def solved_m(u: np.ndarray) -> np.ndarray:
            return np.asarray(self.curve.withdrawal_m(top_m, greatest_N * (1.0 - (1.0 - u) ** 3)))

        u = np.linspace(0.0, 1.0, LOADS + 1)
        # The energy of little slip is a small difference
        u = np.union1d(u, np.geomspace(1e-6, u[1], SMALL_DROPS))
        return refined_spline(solved_m, u, WITHDRAWN)

    @cached_property
    def _over_force(self) -> Any:
        """What `_cycles` gives, found once for all coefficients of friction and kappas."""
        found = _known.setdefault(self.curve, {})
        load = f"{self.preload_N:.12g}"  # what an approach gives back is off by rounding
        cycle = load, self.normal_amplitude_ratio, self.normal_phase_rad
        if cycle not in found:
            found[cycle] = replace(self, friction_coefficient=1.0, kappa=1.0)._cycles()
        return found[cycle]

    def _over_force_at(self, log_share: np.ndarray) -> np.ndarray:
        """Return displacement and root of the energy over the force, shape (..., 2)."""
        mu, kappa = self.friction_coefficient, self.kappa
        return np.asarray(self._over_force(log_share) * (kappa, np.cbrt(kappa / mu)))

    def _cycles(self) -> Any:
        """Return displacement and root of the energy, both over the force.

        A spline, (2,), over the logarithm of the share of gross slip: over the force these bend
        least, but where a contact slips as a whole.
        """
        T = self.total_slip_force_N
        share = np.append(np.geomspace(LEAST_SHARE, 0.9, NODES), 1.0 - np.geomspace(0.09, 1e-6, 16))
        share = np.append(share, 1.0)
        # in phase nothing slips below mu times the normal amplitude, and the loss grows from there
        kink = self.normal_amplitude_ratio / self._most
        if LEAST_SHARE < kink < 1.0:
            beyond = np.append(0.0, np.geomspace(1e-3, 0.5, 16))
            share = np.union1d(share, kink + (1.0 - kink) * beyond)

        def solved(log_share: np.ndarray) -> np.ndarray:
            rows = []
            for share in np.minimum(np.exp(log_share), 1.0).tolist():
                W, _, U = self._cycle(share)
                rows.append((np.ptp(U) / 2.0 / (share * T), np.cbrt(W) / (share * T)))
            return np.array(rows)

        return refined_spline(solved, np.log(share), INTERPOLATED, monotone=True)

    @cached_property
    def _table(self) -> np.ndarray:
        """Force, displacement and root of the energy over the forces of the table, (3, n)."""
        force_N = np.minimum(np.exp(self._over_force.x), 1.0) * self.total_slip_force_N
        return np.vstack((force_N, force_N * self._over_force_at(self._over_force.x).T))

    def _at(self, force_N: ArrayLike, row: int) -> np.ndarray:
        T = np.asarray(force_N, dtype=float)
        if not (T >= 0).all():
            raise SettingsError(f"force_N: got {T.min():g}; expected amplitudes >= 0")
        table = self._table
        first, last = table[0, 0], table[0, -1]
        inside = np.clip(T, first, last)
        share = inside / self.total_slip_force_N
        value = inside * self._over_force_at(np.log(share))[..., row - 1]
        value = np.where(first > T, value * T / first, value)
        return np.asarray(np.where(last * ROUNDED >= T, value, np.inf))

    def _cycle(self, share: float, steps: int = STEPS) -> tuple[float, np.ndarray, np.ndarray]:
        """Return the energy of the steady cycle, and force and displacement around it.

        At a share of the force at gross slip.
        """
        cycle = self._most * share, self.normal_amplitude_ratio, self.normal_phase_rad
        Q, step, low, high, change = _history(*cycle, steps)
        N, mu = self.preload_N, self.friction_coefficient
        edges = np.unique(np.concatenate([low, high]))
        greatest_N, _ = self._top
        drop_N = np.clip(greatest_N - edges * N, 0.0, greatest_N)
        below_m = self._withdrawal_m(1.0 - np.cbrt(1.0 - drop_N / greatest_N))
        rise = change * (
            below_m[np.searchsorted(edges, low)] - below_m[np.searchsorted(edges, high)]
        )
        U = self.kappa * mu * np.cumsum(np.bincount(step, rise, minlength=Q.size))
        Q, U = mu * N * Q[-steps - 1 :], U[-steps - 1 :]
        W = float(((Q[1:] + Q[:-1]) / 2 * np.diff(U)).sum())
        return W if ROUNDING * Q[0] * np.ptp(U) < W else 0.0, Q, U


@lru_cache(maxsize=FOLLOWED)
def _history(
    force: float, ratio: float, phase_rad: float, steps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Follow tau(s) through two periods, with the preload and mu as units: no curve is in it.

    Returns the force at each step, and for each change its step, the levels between which, and by
    how much. The levels are a stack of pieces (upper end, tau), the uppermost last.
    """
    angle = 2 * np.pi * np.arange(2 * steps + 1) / steps  # the second period is steady
    P = np.minimum(1.0 + ratio * np.cos(angle - phase_rad), 1.0 + ratio)
    # Preloaded before it is sheared: deep levels, which never slip, keep tau = 0 for good
    Q = np.append(0.0, force * np.cos(angle))
    pieces: list[tuple[float, float]] = [(1.0, 0.0)]
    changes: list[tuple[int, float, float, float]] = [(0, 0.0, 1.0, 0.0)]
    load, now = 1.0, 0.0
    for k, (wanted_load, wanted) in enumerate(zip(P.tolist(), Q[1:].tolist(), strict=True), 1):
        if wanted_load > load:
            tau = min(max((wanted - now) / (wanted_load - load), -1.0), 1.0)
            pieces.append((wanted_load, tau))
            changes.append((k, load, wanted_load, tau))
            now += tau * (wanted_load - load)
        while pieces[-1][0] > wanted_load:
            high, tau = pieces.pop()
            low = max(pieces[-1][0] if pieces else 0.0, wanted_load)
            changes.append((k, low, high, -tau))
            now -= tau * (high - low)
            if low == wanted_load and not (pieces and pieces[-1][0] == low):
                pieces.append((low, tau))
        load = wanted_load
        full = math.copysign(1.0, wanted - now)
        edge = load
        while pieces and abs(wanted - now) > 1e-14 * load:
            high, tau = pieces.pop()
            low = pieces[-1][0] if pieces else 0.0
            if tau != full:
                low = max(low, high - (wanted - now) / (full - tau))
                changes.append((k, low, high, full - tau))
                now += (full - tau) * (high - low)
                if low > (pieces[-1][0] if pieces else 0.0):
                    pieces.append((low, tau))
            edge = low
        if edge < load:
            pieces.append((load, full))
    step, low_, high_, change = zip(*changes, strict=True)
    return Q, np.array(step), np.array(low_), np.array(high_), np.array(change)
