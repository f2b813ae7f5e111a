"""From slip in the joints to the loss factor of one mode, over its amplitude."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.slip import SlipCurve
from capslip.errors import SettingsError

MOST_LOSS_FACTOR = 0.3  # of a mode that is lightly damped
LEAST_DIP = 0.02  # of a maximum, by which the loss factor falls before it rises to a greater one
Peak = tuple[float, float]  # amplitude and loss factor


def lightly_damped(loss_factor: float) -> float | None:
    """Return a loss factor that is one; None where the mode is no longer lightly damped."""
    return loss_factor if loss_factor <= MOST_LOSS_FACTOR else None


@dataclass(frozen=True, eq=False)
class Damping:
    """Damping and softening of one mode; arrays of one shape (n,), over `amplitude_m`.

    Beyond `gross_slip_amplitude_m` there is no steady cycle under a given force: every array but
    `amplitude_m` holds NaN there.
    """

    amplitude_m: np.ndarray  # v at mid-span, without the displacement of the joints
    total_amplitude_m: np.ndarray  # v with the displacement of the joints: what a sensor sees
    force_N: np.ndarray  # shear force T in one joint
    displacement_m: np.ndarray  # slip displacement of one joint
    energy_J: np.ndarray  # lost per cycle in all joints
    loss_factor: np.ndarray
    damping_ratio: np.ndarray
    frequency_ratio: np.ndarray  # to the frequency with rigid joints
    peak_loss_factor: float
    amplitude_at_peak_m: float | None  # None: no loss below gross slip
    first_peak_loss_factor: float | None  # of a maximum before the greatest one; None: of no such
    amplitude_at_first_peak_m: float | None
    peak_at_gross_slip: bool  # the loss factor still grows where gross slip begins
    gross_slip_amplitude_m: float
    modal_stiffness_N_per_m: float
    joint_stiffness_N_per_m: float
    joints: int

    @property
    def total_loss_factor(self) -> np.ndarray:
        """Loss factor of the whole, over `total_amplitude_m`: what a decay or a resonance shows."""
        return self.loss_factor * self.frequency_ratio**2


def response(
    slip: SlipCurve,
    modal_stiffness_N_per_m: float,
    joint_stiffness_N_per_m: float,
    joints: int,
    amplitude_m: ArrayLike | None = None,
    resolved_from: float = 0.0,
) -> Damping:
    """Compute loss factor, damping ratio and frequency of one mode over its amplitude.

    The amplitude v is the displacement at mid-span of the structure with rigid joints, F / K_m, so
    that the shear force in a joint is T = K_s v. With F in phase in every joint::

        W = n_j W(delta(T)),  eta = W / (2 pi W_ext),  W_ext = K_m v^2 / 2,  xi = eta / 2
        v_total = F / K_m + n_j r delta(T),  r = K_s / K_m,  f / f_0 = sqrt(v / v_total)

    The joints move the mid-span by n_j r delta, as the force F does the work T delta in each of
    them; the loop of F over v_total therefore has the area W.

    Parameters
    ----------
    slip : SlipCurve
        Slip curve of one joint.
    modal_stiffness_N_per_m : float
        K_m, of the mode with rigid joints, for displacement at mid-span.
    joint_stiffness_N_per_m : float
        K_s, shear force in one joint per displacement at mid-span.
    joints : int
        Number n_j of equal joints in which the energy is lost.
    amplitude_m : array_like, shape (n,), optional
        Amplitudes v, positive. By default 1e-3 to 1 of the gross-slip amplitude, spaced
        logarithmically, and the neighbourhood of the peak.
    resolved_from : float, optional
        Share of gross slip, 0 to 1, below which nobody knows what slips: no maximum lies there.

    Returns
    -------
    Damping
        Arrays over the amplitudes. The peak is that of the whole range up to gross slip that is
        resolved, whatever amplitudes are asked for.

    Raises
    ------
    SettingsError
        If a stiffness or an amplitude is not positive and finite, or there is no joint.

    Notes
    -----
    Eqs. 17, 19 and 20 of Peyret, Chevallier and Dion, Int. J. Appl. Mech. 8 (2016) 1650097. W_ext
    leaves out the energy stored in the joints. The loss factor of the whole, over F v_total / 2, is
    the smaller `Damping.total_loss_factor`. At small amplitudes W grows as v^3, so the
    loss factor as v; xi = eta / 2 holds for light damping.

    Examples
    --------
    >>> from capslip.contact.models.families import families
    >>> from capslip.contact.slip import slip_curve
    >>> curve = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> damping = response(slip_curve(curve, 460.4, 0.2, 1.2143), 1.8e8, 9.9e7, joints=2)
    >>> print(f"{damping.peak_loss_factor:.4f} at {damping.amplitude_at_peak_m:.2e} m")
    0.0204 at 9.30e-07 m
    """
    for name, value in (
        ("modal_stiffness_N_per_m", modal_stiffness_N_per_m),
        ("joint_stiffness_N_per_m", joint_stiffness_N_per_m),
    ):
        if not 0 < value < math.inf:
            raise SettingsError(
                f"structure: {name}: got {value:g}; expected a positive finite number"
            )
    if isinstance(joints, bool) or not isinstance(joints, int | np.integer) or joints < 1:
        raise SettingsError(f"structure: joints: got {joints!r}; expected an integer of at least 1")
    mode = _Mode(slip, float(modal_stiffness_N_per_m), float(joint_stiffness_N_per_m), int(joints))
    gross_slip_m = float(slip.total_slip_force_N / joint_stiffness_N_per_m)
    grid_m = np.geomspace(1e-3 * gross_slip_m, gross_slip_m, 73)
    over_grid = mode.states(grid_m)
    peak, first = mode.find_peaks(over_grid, resolved_from * gross_slip_m)
    if amplitude_m is None:
        states = over_grid
        if peak is not None and peak[0] >= grid_m[0]:
            near_m = np.geomspace(peak[0] / 1.2, min(1.2 * peak[0], gross_slip_m), 16)
            near_m = np.append(near_m[near_m >= grid_m[0]], peak[0])
            states = np.hstack((over_grid, mode.states(near_m)))
            states = states[:, np.unique(states[0], return_index=True)[1]]
    else:
        wanted_m = np.atleast_1d(np.asarray(amplitude_m, dtype=float))
        if wanted_m.ndim != 1:
            raise SettingsError(
                f"structure: amplitude_m: got an array of shape {wanted_m.shape}; expected one axis"
            )
        bad_m = wanted_m[~((wanted_m > 0) & (wanted_m < np.inf))]
        if bad_m.size:
            raise SettingsError(
                f"structure: amplitude_m: got {bad_m[0]:g} ({bad_m.size} of {wanted_m.size} "
                "values); expected positive finite numbers"
            )
        states = np.full((3, wanted_m.size), np.nan)
        states[0], steady = wanted_m, wanted_m <= gross_slip_m
        states[:, steady] = mode.states(wanted_m[steady])
    return mode.damping(states, peak, first, gross_slip_m)


def total_loss(
    slip: SlipCurve,
    modal_stiffness_N_per_m: float,
    joint_stiffness_N_per_m: float,
    joints: int,
    amplitude_m: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what `response` gives as total amplitude and loss factor, and the frequency ratio.

    Each of shape (n,), at amplitudes of which none is beyond gross slip. The peak is not looked
    for, which takes longer than the rest.
    """
    mode = _Mode(slip, modal_stiffness_N_per_m, joint_stiffness_N_per_m, joints)
    found = mode.damping(mode.states(amplitude_m), None, None, float(amplitude_m[-1]))
    return found.total_amplitude_m, found.total_loss_factor, found.frequency_ratio


@dataclass(frozen=True)
class _Mode:
    slip: SlipCurve
    K_m: float
    K_s: float
    n_j: int

    def force_N(self, amplitude_m: np.ndarray) -> np.ndarray:
        # The product may exceed mu N0 by rounding where gross slip begins.
        return np.minimum(self.K_s * amplitude_m, self.slip.total_slip_force_N)

    def states(self, amplitude_m: np.ndarray) -> np.ndarray:
        """Return amplitude, displacement of one joint, and energy lost in all, shape (3, n)."""
        T_N = self.force_N(amplitude_m)
        delta_m, energy_J = self.slip.displacement_m(T_N), self.slip.energy_at_force_J(T_N)
        return np.stack((amplitude_m, delta_m, self.n_j * energy_J))

    def loss_factor(self, amplitude_m: np.ndarray, energy_J: np.ndarray) -> np.ndarray:
        return np.asarray(energy_J / (math.pi * self.K_m * amplitude_m) / amplitude_m)

    def _loss_factor(self, amplitude_m: np.ndarray) -> np.ndarray:
        energy_J = self.n_j * self.slip.energy_at_force_J(self.force_N(amplitude_m))
        return self.loss_factor(amplitude_m, energy_J)

    def find_peaks(
        self, over_grid: np.ndarray, resolved_from_m: float
    ) -> tuple[Peak | None, Peak | None]:
        """Return the highest loss factor, looking between the grid points too, and the first.

        That is the first maximum before the greatest. None where none is, and neither below the
        amplitude from which slip is resolved.
        """
        over_grid = over_grid[:, over_grid[0] >= min(resolved_from_m, over_grid[0, -1])]
        grid_m, loss = over_grid[0], self.loss_factor(*over_grid[[0, 2]])
        if not loss.max() > 0:
            return None, None
        first, fine_m, fine = None, grid_m, loss
        least_m = max(1e-9 * grid_m[-1], resolved_from_m)
        if fine.size == 1:  # all that is resolved lies beyond the last point of the grid but one
            fine_m = np.geomspace(min(least_m, grid_m[0]), grid_m[0], 25)
            fine = self._loss_factor(fine_m)
        # Families that barely touch may peak below the grid.
        while fine[0] == fine.max() and fine_m[0] > least_m:
            fine_m = np.geomspace(max(fine_m[0] / 10, resolved_from_m), fine_m[1], 25)
            fine = self._loss_factor(fine_m)
        peak = self._highest(fine_m, int(np.argmax(fine)))
        so_far = np.maximum.accumulate(loss)
        fallen = np.flatnonzero((loss < (1.0 - LEAST_DIP) * so_far) & (grid_m < peak[0]))
        if fallen.size and (i := int(np.argmax(loss[: fallen[0]]))) > 0:
            first = self._highest(grid_m, i)  # else it may fall from below the grid on
        return peak, first

    def _highest(self, grid_m: np.ndarray, i: int) -> Peak:
        """Return amplitude and value of the highest loss factor beside a point of a grid."""
        is_last = i == len(grid_m) - 1
        for _ in range(6):  # each turn looks eight times closer
            grid_m = np.geomspace(grid_m[max(i - 1, 0)], grid_m[min(i + 1, len(grid_m) - 1)], 17)
            loss = self._loss_factor(grid_m)
            i = int(np.argmax(loss))
            if is_last and (np.diff(loss) > 0.0).all() and np.diff(loss[-3:], 2)[0] > 0.0:
                break  # it grows ever faster up to the end
        return float(grid_m[i]), float(loss[i])

    def damping(
        self, states: np.ndarray, peak: Peak | None, first: Peak | None, gross_slip_m: float
    ) -> Damping:
        """Return the damping over states as `states` gives them; NaN where there is none."""
        v_m, delta_m, energy_J = states
        steady = np.where(v_m <= gross_slip_m, 1.0, np.nan)
        loss_factor = self.loss_factor(v_m, energy_J)
        v_total_m = v_m + self.n_j * self.K_s / self.K_m * delta_m
        peak_m, peak_loss = peak or (None, 0.0)
        first_m, first_loss = first or (None, None)
        return Damping(
            amplitude_m=v_m,
            total_amplitude_m=v_total_m,
            force_N=self.force_N(v_m) * steady,
            displacement_m=delta_m,
            energy_J=energy_J,
            loss_factor=loss_factor,
            damping_ratio=loss_factor / 2,
            frequency_ratio=np.sqrt(v_m / v_total_m),
            peak_loss_factor=peak_loss,
            first_peak_loss_factor=first_loss,
            amplitude_at_first_peak_m=first_m,
            amplitude_at_peak_m=peak_m,
            peak_at_gross_slip=peak_m == gross_slip_m,
            gross_slip_amplitude_m=gross_slip_m,
            modal_stiffness_N_per_m=self.K_m,
            joint_stiffness_N_per_m=self.K_s,
            joints=self.n_j,
        )
