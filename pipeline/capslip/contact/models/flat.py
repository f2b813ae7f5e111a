"""The perfectly plane interface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.rung import Contacts, Rung, Scene
from capslip.errors import ContactError, SettingsError


@dataclass(frozen=True, eq=False)
class FlatCurve:
    """A perfectly plane interface under uniform pressure, see `flat`."""

    preload_N: float
    compliance_m_per_N: float = 0.0
    model: str = "flat"

    def __post_init__(self) -> None:
        if self.compliance_m_per_N < 0:
            raise ContactError(
                f"flat: the compliance in series is {self.compliance_m_per_N:g} m/N; expected >= 0:"
                " a plane interface has none that could be taken away"
            )

    @property
    def touch_m(self) -> np.ndarray:
        """All points touch at once."""
        return np.zeros(())

    def load_N(self, approach_m: ArrayLike) -> np.ndarray:
        """N(d); without a spring in series, the preload as soon as the faces touch."""
        d = np.asarray(approach_m, dtype=float)
        if self.compliance_m_per_N > 0:
            return np.maximum(d, 0) / self.compliance_m_per_N
        return np.where(d >= 0, self.preload_N, 0.0)

    def approach_m(self, load_N: ArrayLike) -> np.ndarray:
        """d(N), zero without a spring in series."""
        return self.compliance_m_per_N * np.asarray(load_N, dtype=float)

    def stiffness_N_per_m(self, approach_m: ArrayLike, withdrawal_m: ArrayLike = 0.0) -> np.ndarray:
        """N'(d - e), infinite without a spring in series, zero where the faces are apart."""
        load, e = self._load_and(approach_m, withdrawal_m)
        c = self.compliance_m_per_N
        return np.where((load > 0) & (e <= c * load), 1 / c if c > 0 else np.inf, 0.0)

    def load_drop_N(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """N(d) - N(d - e): all of the load as soon as e exceeds the spring's share."""
        load, e = self._load_and(approach_m, withdrawal_m)
        c = self.compliance_m_per_N
        return np.where(e > c * load, load, e / c if c > 0 else 0.0)

    def withdrawal_m(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Withdrawal, the spring's share alone."""
        _, drop = self._load_and(approach_m, load_drop_N)
        return self.compliance_m_per_N * drop

    def loss_integral_J(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Zero up to total slip, then 4 N a unit of withdrawal."""
        load, e = self._load_and(approach_m, withdrawal_m)
        return 4 * load * np.maximum(e - self.compliance_m_per_N * load, 0)

    def loss_integral_at_drop_J(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Zero: a plane interface sticks as a whole up to total slip."""
        return 0 * self._load_and(approach_m, load_drop_N)[1]

    def lift_off_m(self, approach_m: ArrayLike) -> np.ndarray:
        """Withdrawal of total slip."""
        return (self.compliance_m_per_N * self.load_N(approach_m))[..., None]

    def lifted(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Whether the face has lost its load."""
        load, e = self._load_and(approach_m, withdrawal_m)
        return (e >= self.compliance_m_per_N * load)[..., None]

    def _load_and(self, approach_m: ArrayLike, other: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        load, array = np.broadcast_arrays(self.load_N(approach_m), np.asarray(other, dtype=float))
        return load, array


def flat(preload_N: float) -> FlatCurve:
    """Return the normal curve of the perfectly plane interface: the paper's point of comparison.

    The pressure is uniform, p = N / A, so no point slips before the shear stress of the section
    exceeds mu p, and then all points slip at once: no displacement and no loss below mu N, Coulomb
    friction at it. This is the baseline of Peyret et al. (2010), without the elastic section around
    the interface: with the parabolic shear stress of a beam's section slip begins in its middle at
    2/3 mu N already.

    A plane interface has no compliance of its own. Put one in series where it is wanted, as in
    `in_series(flat(N), bulk_compliance_m_per_N(...))`.

    Parameters
    ----------
    preload_N : float
        The load, which the approach (always zero) cannot tell.

    Examples
    --------
    >>> plane = flat(460.0)
    >>> plane.loss_integral_at_drop_J(0.0, [100.0, 400.0])
    array([0., 0.])
    """
    if not 0 < preload_N < np.inf:
        raise SettingsError(f"preload_N: got {preload_N:g}; expected a finite number > 0")
    return FlatCurve(float(preload_N))


def _build(scene: Scene) -> FlatCurve:
    return flat(scene.preload_N)


def _contacts(scene: Scene, curve: FlatCurve, approach_m: float) -> Contacts:
    return Contacts(1, np.full(len(scene.caps), np.nan), np.array([""]))


RUNG = Rung(
    name="flat",
    label="flat",
    cost=0,
    made_from="nothing",
    automatic=False,
    holds_bulk=False,
    leaves_out="The interface is taken as perfectly plane: no energy is lost below gross slip.",
    colour="#999999",
    build=_build,
    contacts=_contacts,
    knows_places=False,
    doubt="a flat interface loses nothing below gross slip: its damping is none of the face, and "
    "its error is not known; contact.model = auto presses the caps",
)
