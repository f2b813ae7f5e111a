"""The joint that a scan stands for: the share of the load that the scan carries, and the whole.

A scan under a pressure gives a law per area. The joint is the sum of patches of such a law under
one tangential displacement: the one place where results of the scan become those of the joint.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.curve import NormalCurve
from capslip.contact.material import composite
from capslip.contact.press import ContactState
from capslip.contact.pressure_map import classes_of_pressure, read_pressure_map
from capslip.contact.rung import rung
from capslip.contact.scaled import ScaledCurve
from capslip.contact.solvers.elastic_face import MOST_PRESSURE
from capslip.errors import ContactError, SettingsError
from capslip.settings import Material, Settings
from capslip.surface.heightmap import HeightMap

MAX_SOLVED = 8  # pressures, of a model that solves each of them on the map
LEAST_SHARE = 1e-5  # of the withdrawal at total slip that the table of uneven patches resolves


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint as patches of one scan.

    Every patch is `weight` scans large, each of them under `load_N`: an area without pressure
    carries nothing and is no patch.
    """

    area_m2: float | None  # None: neither given nor scanned
    scan_area_m2: float | None  # None: no scan
    preload_N: float  # of the joint
    load_N: np.ndarray  # (k,), of the scan, for each patch
    weight: np.ndarray  # (k,), area of the patch over that of the scan
    scan_load_N: float  # under which the scan is pressed: that of the greatest pressure

    @property
    def nominal_pressure_Pa(self) -> float | None:
        """Preload over area."""
        return None if self.area_m2 is None else self.preload_N / self.area_m2

    @property
    def coverage(self) -> float | None:
        """Area of the scan over that of the joint."""
        if self.area_m2 is None or self.scan_area_m2 is None:
            return None
        return self.scan_area_m2 / self.area_m2

    @property
    def is_even(self) -> bool:
        """Whether all of the joint is under one pressure."""
        return len(self.load_N) == 1

    def under(self, preload_N: float) -> "Joint":
        """Return the same joint under another preload, spread over it in the same way."""
        factor = preload_N / self.preload_N
        return Joint(
            *(self.area_m2, self.scan_area_m2, preload_N),
            *(self.load_N * factor, self.weight, self.scan_load_N * factor),
        )

    def settings_of_scan(self, settings: Settings) -> Settings:
        """Return the settings under which the scan is pressed; every load has its share of time."""
        contact = msgspec.structs.replace(
            settings.contact,
            preload_N=self.scan_load_N,
            nominal_pressure_Pa=None,
            time_limit_s=settings.contact.time_limit_s / len(self.load_N),
        )
        return msgspec.structs.replace(settings, contact=contact)

    def curve(self, contact: ContactState, greatest: float = 1.0) -> NormalCurve:
        """Return the normal curve of the joint from that of its scan, for slip.

        After a first loading to `greatest` times the preload, which counts where the face yields.
        """
        return self.curve_of(self.loaded(contact, greatest))

    def loaded(self, contact: ContactState, greatest: float = 1.0) -> list[ContactState]:
        """Return the state of each patch after its own first loading; one for all where elastic."""
        if contact.first is None or self.is_even:
            return [replace(contact, curve=contact.curve_after(greatest * contact.preload_N))]
        return [
            replace(contact, curve=contact.curve_after(greatest * N), preload_N=N)
            for N in self.load_N.tolist()
        ]

    def curve_of(self, patches: Sequence[ContactState]) -> NormalCurve:
        """Return the normal curve of the joint from the curves of what `loaded` gives."""
        curves = [patch.curve for patch in patches]
        if patches[0].rung.made_from == "nothing":  # it carries one load, however that is spread
            load_N, weight = [self.scan_load_N], [self.preload_N / self.scan_load_N]
            return curve_of_joint(curves[0], np.array(load_N), np.array(weight))
        if len(curves) == 1:
            return curve_of_joint(curves[0], self.load_N, self.weight)
        return _side_by_side(curves, self.load_N, self.weight)


def joint_of(settings: Settings, surface: HeightMap) -> Joint:
    """Return the joint that the settings describe and the scan is a part of.

    The nominal pressure acts on the rectangle that was scanned, holes in it included: a point that
    was not measured is face all the same. Lines without any measured point are none.

    Parameters
    ----------
    settings : Settings
        `joint` and `contact`.
    surface : HeightMap
        As it is pressed, so after trimming.

    Raises
    ------
    SettingsError
        If the pressure map cannot be used, the normal load oscillates on one of unlike pressures,
        the bulk term shall stay, which is that of the scan, or load, area and modulus do not
        belong together.
    """
    contact, joint = settings.contact, settings.joint
    scan_m2 = surface.measured_area_m2
    if joint.pressure_map is not None:
        pressure_Pa, patch_m2 = read_pressure_map(joint.pressure_map)
        class_Pa, class_m2 = classes_of_pressure(pressure_Pa, patch_m2)
        solves = contact.model != "auto" and rung(contact.model).solved_loads_N is not None
        if solves and len(class_Pa) > MAX_SOLVED:
            raise SettingsError(
                f"joint.pressure_map: got {len(class_Pa)} different pressures with contact.model = "
                f"{contact.model}, which solves the whole map for each; expected at most "
                f"{MAX_SOLVED}; take contact.model = auto, or fewer pressures"
            )
        ratio = settings.slip.normal_amplitude_ratio
        if ratio > 0.0 and len(class_Pa) > 1:
            raise SettingsError(
                f"slip.normal_amplitude_ratio: got {ratio:g} with a joint.pressure_map of unlike "
                "pressures, whose spread is known under the mean load alone; expected 0, or one "
                "pressure"
            )
        area_m2, preload_N = float(patch_m2.sum()), float(pressure_Pa @ patch_m2)
        load_N, weight = class_Pa * scan_m2, class_m2 / scan_m2
        scan_load_N = float(pressure_Pa.max() * scan_m2)
    else:
        area_m2 = scan_m2 if joint.area_m2 is None else joint.area_m2
        preload_N = contact.preload_N
        if contact.nominal_pressure_Pa is not None:
            preload_N = contact.nominal_pressure_Pa * area_m2
        load_N, weight = np.array([preload_N * (scan_m2 / area_m2)]), np.array([area_m2 / scan_m2])
        scan_load_N = float(load_N[0])
    if contact.bulk and not np.array_equal(weight, [1.0]):
        raise SettingsError(
            "contact.bulk: got true with a joint that is larger than its scan; the bulk sinking of "
            "the scan is not that of the joint; leave it to the structure (contact.bulk = false)"
        )
    _check_pressure(scan_load_N / scan_m2, settings.material)
    return Joint(area_m2, scan_m2, preload_N, load_N, weight, scan_load_N)


def _check_pressure(pressure_Pa: float, material: Material) -> None:
    """Refuse a mean pressure on the scan that no solid of such a modulus can be under."""
    E_star_Pa = composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa
    if not pressure_Pa <= MOST_PRESSURE * E_star_Pa:
        raise SettingsError(
            f"load out of range: got {pressure_Pa:.3g} Pa on the scan with a modulus E* "
            f"of {E_star_Pa:.3g} Pa; expected a pressure far below the modulus; look at the units "
            "of the scan, the load, joint.area_m2 and material.youngs_modulus_Pa"
        )


def curve_of_joint(curve: NormalCurve, load_N: np.ndarray, weight: np.ndarray) -> NormalCurve:
    """Return the normal curve of many scans side by side, each under its own load.

    Parameters
    ----------
    curve : NormalCurve
        Of the scan. Where loading is elastic one curve serves every load, whatever came before.
    load_N : ndarray, shape (k,)
        Loads > 0 of the scan in each patch.
    weight : ndarray, shape (k,)
        How many scans make the patch, any number > 0.

    Examples
    --------
    >>> from capslip.contact.models.families import families
    >>> one = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> two = curve_of_joint(one, np.array([460.0]), np.array([2.0]))
    >>> [round(float(N), 1) for N in (one.load_N(2.5e-7), two.load_N(2.5e-7))]
    [460.4, 920.8]
    """
    if np.array_equal(weight, [1.0]):
        return curve
    if len(load_N) == 1:
        return ScaledCurve(curve, float(weight[0]))
    return _side_by_side((curve,) * len(weight), load_N, weight)


def _side_by_side(
    curves: Sequence[NormalCurve], load_N: np.ndarray, weight: np.ndarray
) -> NormalCurve:
    # One by one, so that a curve that solves its loads interpolates none
    pairs = zip(curves, load_N, strict=True)
    approach_m = np.array([float(curve.approach_m(N)) for curve, N in pairs])
    return PatchedCurve(tuple(curves), approach_m, weight)


@dataclass(frozen=True, eq=False)
class PatchedCurve:
    """Patches that are pressed unevenly and move together: N(D) = sum_k w_k N_k(d_k - (D_0 - D)).

    A patch that carries less lies lower, so this is a normal curve as any other: the approach D
    counts as that of the patch that is pressed deepest, and is D_0 under the preload. Under
    shear all patches share one withdrawal e, and T = mu sum_k w_k [N_k(d_k) - N_k(d_k - e)], which
    is what the theorem gives for each patch under the common displacement mu kappa e.

    What happens below the preload is summed once, at some withdrawals, and interpolated in between
    (to 5e-4, where a contact lets go): so withdrawals from any other approach than D_0 are refused.

    Made by `curve_of_joint`, of one curve for all patches.
    """

    curves: tuple[NormalCurve, ...]  # (k,)
    patch_approach_m: np.ndarray  # (k,), under the preload
    weight: np.ndarray  # (k,)
    compliance_m_per_N: float = 0.0  # none in series with the whole

    @property
    def model(self) -> str:
        """Name of the model, of each where they differ."""
        return ", ".join(dict.fromkeys(curve.model for curve in self.curves))

    @property
    def preload_approach_m(self) -> float:
        """D_0, that of the patch that is pressed deepest."""
        return float(self.patch_approach_m[self._deepest])

    @property
    def touch_m(self) -> np.ndarray:
        """Approach of first touch."""
        return np.asarray(self.curves[self._deepest].touch_m)

    def load_N(self, approach_m: ArrayLike) -> np.ndarray:
        """N(D)."""
        below_m = self.preload_approach_m - np.asarray(approach_m, dtype=float)
        return np.asarray(sum(w * one.load_N(d - below_m) for one, d, w in self._patches))

    def approach_m(self, load_N: ArrayLike) -> np.ndarray:
        """D(N) of loads up to the preload.

        Raises
        ------
        ContactError
            If a load exceeds it.
        """
        # What a map lets go until it lifts off is its load to one in a hundred thousand alone
        preload_N = float(self.load_N(self.preload_approach_m))
        drop_N = preload_N - np.asarray(load_N, dtype=float)
        if (drop_N < -1e-9 * preload_N).any():
            raise ContactError(
                f"{self.model}: got a load of {np.max(load_N):g} N on a joint of unevenly pressed "
                f"patches; expected at most its preload, {preload_N:g} N"
            )
        drop_N = np.where(drop_N < 1e-9 * preload_N, 0.0, drop_N)
        return np.asarray(self.preload_approach_m - self._withdrawal_m(drop_N))

    def stiffness_N_per_m(self, approach_m: ArrayLike, withdrawal_m: ArrayLike = 0.0) -> np.ndarray:
        """N'(D - e)."""
        return self._sum("stiffness_N_per_m", approach_m, withdrawal_m)

    def load_drop_N(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """N(D) - N(D - e)."""
        self._check(approach_m)
        return self._at(withdrawal_m, 1, power=1)

    def withdrawal_m(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Withdrawal for a load drop of at most N(D)."""
        self._check(approach_m)
        return self._withdrawal_m(np.asarray(load_drop_N, dtype=float))

    def loss_integral_J(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """4 * integral of s (e - s) N''(D - s)."""
        self._check(approach_m)
        known_m, known_N, _ = self._below
        beyond_m = np.maximum(np.asarray(withdrawal_m, dtype=float) - known_m[-1], 0.0)
        return self._at(withdrawal_m, 2, power=3) + 4.0 * known_N[-1] * beyond_m

    def loss_integral_at_drop_J(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Return the same at given load drop."""
        return self.loss_integral_J(approach_m, self.withdrawal_m(approach_m, load_drop_N))

    def lift_off_m(self, approach_m: ArrayLike) -> np.ndarray:
        """Withdrawal at which each row of the scan loses its load, patch by patch."""
        self._check(approach_m)
        rows = [one.lift_off_m(d) for one, d, _ in self._patches]
        return np.concatenate(rows, axis=-1)

    def lifted(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Whether each row of the scan had a load and has lost it, patch by patch."""
        self._check(approach_m)
        rows = [one.lifted(d, withdrawal_m) for one, d, _ in self._patches]
        return np.concatenate(rows, axis=-1)

    @property
    def _patches(self) -> Iterator[tuple[NormalCurve, float, float]]:
        """Yield curve, approach under the preload, and weight of each patch."""
        return zip(self.curves, self.patch_approach_m, self.weight, strict=True)

    @cached_property
    def _deepest(self) -> int:
        """Return the patch that is the last to lose its load."""
        touch_m = [float(curve.touch_m) for curve in self.curves]
        return int(np.argmax(self.patch_approach_m - touch_m))

    @cached_property
    def _below(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return withdrawals from the preload, with their load drops and loss integrals."""
        share = np.geomspace(LEAST_SHARE, 0.5, 140)
        share = np.concatenate([share, 1.0 - np.geomspace(0.49, 1e-6, 60), [1.0]])
        e = share * (self.preload_approach_m - float(self.touch_m))
        drop_N, loss_J = np.zeros(e.shape), np.zeros(e.shape)
        for one, d, w in self._patches:  # both of one patch share what its curve solves
            drop_N += w * one.load_drop_N(d, e)
            loss_J += w * one.loss_integral_J(d, e)
        return e, drop_N, loss_J

    @cached_property
    def _ratios(self) -> Any:
        """Return load drop over e and loss over e^3, as a smooth function of log e."""
        from scipy.interpolate import PchipInterpolator

        e, drop_N, loss_J = self._below
        return PchipInterpolator(np.log(e), np.stack([e, drop_N / e, loss_J / e**3], axis=1))

    def _at(self, withdrawal_m: ArrayLike, column: int, power: int) -> np.ndarray:
        """Return a column of the table at any withdrawal up to the last, or at that."""
        known_m = self._below[0]
        e = np.minimum(np.asarray(withdrawal_m, dtype=float), known_m[-1])
        ratio = self._ratios(np.log(np.maximum(e, known_m[0])))[..., column]
        return np.asarray(ratio * e**power)

    def _withdrawal_m(self, drop_N: np.ndarray) -> np.ndarray:
        """Return the inverse of the interpolated load drop, which grows with the withdrawal."""
        known_m, known_N, _ = self._below
        first = np.clip(np.searchsorted(known_N, drop_N) - 1, 0, len(known_m) - 2)
        low, high = known_m[first], known_m[first + 1]
        for _ in range(60):
            middle = 0.5 * (low + high)
            above = self._at(middle, 1, power=1) > drop_N
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        linear = drop_N <= known_N[0]
        return np.where(linear, drop_N * (known_m[0] / known_N[0]), 0.5 * (low + high))

    def _sum(self, method: str, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Sum a method of the patches' curves under the preload."""
        self._check(approach_m)
        return np.asarray(
            sum(w * getattr(one, method)(d, withdrawal_m) for one, d, w in self._patches)
        )

    def _check(self, approach_m: ArrayLike) -> None:
        if np.any(np.asarray(approach_m) != self.preload_approach_m):
            raise ContactError(
                f"{self.model}: unevenly pressed patches are withdrawn from their preload alone; "
                f"got an approach of {np.max(approach_m):g} m; expected "
                f"{self.preload_approach_m:g} m"
            )
