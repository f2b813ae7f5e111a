"""Slip, loop and energy of one joint under constant load, from its normal curve alone."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.curve import NormalCurve, withdrawal_to_lift_m
from capslip.errors import ContactError, SettingsError, in_short

TINY_M = 1e-300  # beyond total slip of a plane interface, which has no displacement before it


@dataclass(frozen=True, eq=False)
class SlipCurve:
    """The tangential behaviour of a joint under constant normal load, made by `slip_curve`.

    T(delta) = mu [N(d) - N(d - delta / (mu kappa))] with the normal curve N, and the cycle follows
    by Masing's rule (Eqs. 3-16 of the paper, for one Hertz contact and for two families). Forces
    and displacements are amplitudes, so not negative; all methods take arrays.
    """

    curve: NormalCurve
    preload_N: Any  # floats, or arrays for a curve of many sets of parameters
    approach_m: Any
    friction_coefficient: Any
    kappa: float

    @property
    def total_slip_force_N(self) -> Any:
        """T = mu N: no equilibrium above it."""
        return self.friction_coefficient * self.preload_N

    @cached_property
    def total_slip_displacement_m(self) -> Any:
        """Displacement at which the last contact slips as a whole."""
        to_lift_m = withdrawal_to_lift_m(self.curve, self.approach_m, self.preload_N)
        return _plain(self._scale * to_lift_m)

    @property
    def tangential_stiffness_N_per_m(self) -> Any:
        """dT/d delta before any slip: N'(d) / kappa."""
        return _plain(self.curve.stiffness_N_per_m(self.approach_m) / self.kappa)

    @cached_property
    def limits_m(self) -> np.ndarray:
        """Displacement at which each row slips as a whole: delta_lim of Eq. 8 for each family.

        NaN for rows that carry nothing, and for interacting caps that have none, see `lift_off_m`.
        """
        return np.asarray(self._scale)[..., None] * self.curve.lift_off_m(self.approach_m)

    @property
    def _scale(self) -> Any:
        return self.friction_coefficient * self.kappa

    def force_N(self, displacement_m: ArrayLike) -> np.ndarray:
        """T(delta) of first loading; mu N beyond total slip."""
        e = self._withdrawn_m(displacement_m)
        return self.friction_coefficient * self.curve.load_drop_N(self.approach_m, e)

    def displacement_m(self, force_N: ArrayLike) -> np.ndarray:
        """delta(T) of first loading; infinite above mu N, where nothing holds the force."""
        drop, held = self._load_drop(force_N)
        delta = self._scale * self.curve.withdrawal_m(self.approach_m, drop)
        return np.where(held, delta, np.inf)

    def energy_J(self, displacement_m: ArrayLike) -> np.ndarray:
        """W of one cycle between -delta and delta, beyond total slip as well."""
        e = self._withdrawn_m(displacement_m)
        energy_J: np.ndarray = self._energy_scale * self.curve.loss_integral_J(self.approach_m, e)
        endless = np.isposinf(np.asarray(displacement_m, dtype=float))
        return np.where(endless, np.inf, energy_J) if endless.any() else energy_J

    def energy_at_force_J(self, force_N: ArrayLike) -> np.ndarray:
        """W of one cycle between -T and T; infinite above mu N."""
        drop, held = self._load_drop(force_N)
        loss = self.curve.loss_integral_at_drop_J(self.approach_m, drop)
        return np.where(held, self._energy_scale * loss, np.inf)

    def stiffness_N_per_m(self, displacement_m: ArrayLike) -> np.ndarray:
        """dT/d delta on first loading; zero beyond total slip."""
        e = self._withdrawn_m(displacement_m)
        return self.curve.stiffness_N_per_m(self.approach_m, e) / self.kappa

    def loop(self, amplitude_m: float, n_points: int = 201) -> tuple[np.ndarray, np.ndarray]:
        """Return displacement and force once around the cycle, from tip to tip and back.

        Masing: each branch is the first loading at twice the scale, turned at the tip (Eqs. 5, 6).

        Parameters
        ----------
        amplitude_m : float
            Largest displacement.
        n_points : int
            Length of the arrays; the points are denser at the tips, the last one is the first.
        """
        check_one_amplitude(amplitude_m)
        if n_points < 3:
            raise SettingsError(f"n_points: got {n_points}; expected at least 3")
        angle = np.linspace(0, 2 * np.pi, n_points)
        back = angle > np.pi
        # 1 - cos in the form 2 sin^2, so that the first points do not cancel
        from_tip = 2 * amplitude_m * np.where(back, np.cos(angle / 2), np.sin(angle / 2)) ** 2
        force = self.force_N(amplitude_m) - 2 * self.force_N(from_tip / 2)
        displacement = amplitude_m - from_tip
        sign = np.where(back, -1, 1)
        return sign * displacement, sign * force

    def phase(self, displacement_m: ArrayLike) -> np.ndarray:
        """Return "GPS", "PPS" or "TS": none, some or all asperities slip as a whole (Sec. 2.3)."""
        e = self._withdrawn_m(displacement_m)
        some = self.curve.lifted(self.approach_m, e).any(axis=-1)
        total = e >= self.total_slip_displacement_m / self._scale
        return np.where(total, "TS", np.where(some, "PPS", "GPS"))

    def _withdrawn_m(self, displacement_m: ArrayLike) -> np.ndarray:
        """Return how far the curve is withdrawn; of no end of slip, beyond total slip."""
        e: np.ndarray = _amplitude("displacement_m", displacement_m) / self._scale
        if np.isposinf(e).any():
            beyond = np.maximum(2.0 * self.total_slip_displacement_m / self._scale, TINY_M)
            e = np.where(np.isposinf(e), beyond, e)
        return e

    @property
    def _energy_scale(self) -> Any:
        return self.friction_coefficient**2 * self.kappa

    def _load_drop(self, force_N: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        force = _amplitude("force_N", force_N)
        held = force <= self.total_slip_force_N
        return np.where(held, force, 0) / self.friction_coefficient, held


def slip_curve(
    curve: NormalCurve, preload_N: float, friction_coefficient: float, kappa: float
) -> SlipCurve:
    """Return the tangential behaviour of a joint that carries a constant normal load.

    Exact for uncoupled half-spaces (equal materials, or Dundurs' beta = 0) at constant normal load,
    without rotation, in one direction. Poisson's effect in three dimensions, at nu = 0.3, changes
    the displacement by 1 to 5 % and the energy by up to 4 % on round caps, 11 % on waves; which way
    depends on the direction of the force (`capslip.studies.theorem.errors`), of which kappa may be
    (`contact.direction`).
    Multicontact models of this kind describe the elastic response of real interfaces, but not
    their dissipation quantitatively (Bureau, Caroli and Baumberger 2003).

    Parameters
    ----------
    curve : NormalCurve
        From any rung. A curve of many sets of parameters gives a slip curve of
        as many: preload, friction coefficient and results then are arrays.
    preload_N : float
        Normal load of the joint.
    friction_coefficient : float
        mu.
    kappa : float
        E* G* / 4, see `composite`; or that of a direction of slip.

    Raises
    ------
    SettingsError
        If a number is not positive and finite.
    ContactError
        If the curve cannot carry the load, or was made for another one (`flat`).

    Examples
    --------
    >>> from capslip.contact.models.families import families
    >>> curve = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> slip = slip_curve(curve, 460.37, 0.2, 1.2143)
    >>> [round(float(T), 2) for T in slip.force_N([5e-9, 6e-8])]
    [13.53, 91.96]
    >>> slip.phase([1e-9, 5e-9, 1e-7])
    array(['GPS', 'PPS', 'TS'], dtype='<U3')
    """
    for name, value in (
        ("preload_N", preload_N),
        ("friction_coefficient", friction_coefficient),
        ("kappa", kappa),
    ):
        number = _numbers(name, value)
        if not number.size or not np.all((number > 0) & (number < np.inf)):
            raise SettingsError(f"{name}: got {in_short(str(value))}; expected a finite number > 0")
    approach_m = _plain(curve.approach_m(preload_N))
    carried = curve.load_N(approach_m)
    if not np.all(np.abs(carried - preload_N) <= 1e-9 * np.abs(preload_N)):
        raise ContactError(
            f"{curve.model}: the curve carries {carried} N at its approach for {preload_N} N; "
            "expected the same load; give the model the preload of the joint"
        )
    return SlipCurve(curve, preload_N, approach_m, friction_coefficient, kappa)


def check_one_amplitude(amplitude_m: float) -> None:
    """Refuse the amplitude of a cycle that is none."""
    array = _numbers("amplitude_m", amplitude_m)
    if array.ndim or not 0 <= array < np.inf:
        raise SettingsError(
            f"amplitude_m: got {in_short(str(amplitude_m))}; expected one finite number >= 0"
        )


def _numbers(name: str, values: ArrayLike) -> np.ndarray:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise SettingsError(f"{name}: got {in_short(repr(values))}; expected numbers") from None


def _amplitude(name: str, values: ArrayLike) -> np.ndarray:
    array = _numbers(name, values)
    if not (array >= 0).all():
        raise SettingsError(f"{name}: got {array.min():g}; expected amplitudes >= 0")
    return array


def _plain(value: Any) -> Any:
    """Return a float where there is only one set of parameters."""
    return float(value) if np.ndim(value) == 0 else value
