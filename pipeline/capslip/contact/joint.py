"""The joint that a scan stands for: the share of the load that the scan carries, and the whole.

A scan under a pressure gives a law per area. The joint is the sum of patches of such a law under
one tangential displacement: the one place where results of the scan become those of the joint.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import msgspec
import numpy as np

from capslip.contact.curve import NormalCurve
from capslip.contact.material import composite
from capslip.contact.press import ContactState
from capslip.contact.pressure_map import classes_of_pressure, read_pressure_map
from capslip.contact.scaled import ScaledCurve, with_ratio
from capslip.contact.solvers.elastic_face import MOST_PRESSURE
from capslip.contact.time_needed import boundary_elements_s
from capslip.contact.uneven import PatchedCurve, scaled_between, seen, side_by_side, standing_for
from capslip.errors import ContactError, SettingsError
from capslip.settings import Settings
from capslip.surface.heightmap import HeightMap
from capslip.surface.waves import long_waves_m

# Pressures, of a model that solves each of them on the map; and the fewest, where time is short
MAX_SOLVED, FEWEST_SOLVED = 8, 2
# Nominal, that the faces of a joint hardly bear: those under a bolt bear some 20 MPa
BEYOND_JOINTS_PA = 50e6


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
    most_solved: int = MAX_SOLVED  # loads, of a model that solves each of them on the map
    long_waves_m: float = 0.0  # by how much waves stand out of the scan that are longer, rms

    @property
    def nominal_pressure_Pa(self) -> float | None:
        """Preload over area."""
        return None if self.area_m2 is None else self.preload_N / self.area_m2

    @property
    def coverage(self) -> float | None:
        """Area of the scan over that of the joint that bears load: for no other it stands."""
        return None if self.scan_area_m2 is None else float(1.0 / self.weight.sum())

    @property
    def is_even(self) -> bool:
        """Whether all of the joint is under one pressure."""
        return len(self.load_N) == 1

    @property
    def is_scan(self) -> bool:
        """Whether the scan is all of the joint."""
        return np.array_equal(self.weight, [1.0])

    def under(self, preload_N: float) -> "Joint":
        """Return the same joint under another preload, spread over it in the same way."""
        factor = preload_N / self.preload_N
        load_N, scan_load_N = self.load_N * factor, self.scan_load_N * factor
        return replace(self, preload_N=preload_N, load_N=load_N, scan_load_N=scan_load_N)

    def settings_of_scan(self, settings: Settings) -> Settings:
        """Return the settings under which the scan is pressed; every load has its share of time."""
        contact = msgspec.structs.replace(
            settings.contact,
            preload_N=self.scan_load_N,
            nominal_pressure_Pa=None,
            time_limit_s=settings.contact.time_limit_s / min(len(self.load_N), self.most_solved),
        )
        return msgspec.structs.replace(settings, contact=contact)

    def curve(
        self, contact: ContactState, greatest: float = 1.0, kappa: float | None = None
    ) -> NormalCurve:
        """Return the normal curve of the joint from that of its scan, for slip.

        After a first loading to `greatest` times the preload, which counts where the face yields.
        With a kappa, or its own, see `curve_of`.
        """
        return self.curve_of(self.loaded(contact, greatest), kappa)

    def kappa(self, contact: ContactState) -> float:
        """Return kappa of the joint from that of its scan, see `kappa_of`."""
        if contact.kappa_along is None:
            return contact.composite.kappa
        return self.kappa_of(self.loaded(contact))

    def loaded(self, contact: ContactState, greatest: float = 1.0) -> list[ContactState]:
        """Return the state of each patch after its own first loading, at its own level.

        One for all where they are elastic, lie alike and have one kappa. Where each load is a
        solution of the map, those of few patches stand for many, and those that are too light for
        the pixels of the map are left out, see `curve_of`.
        """
        solves = contact.rung.solved_loads_N is not None
        differ = contact.at_level is not None or contact.kappa_along is not None
        if self.is_even or (contact.first is None and not solves and not differ):
            return [replace(contact, curve=contact.curve_after(greatest * contact.preload_N))]
        load_N = self.load_N
        if solves and len(load_N) > self.most_solved:
            load_N = standing_for(load_N, self.weight, self.most_solved)
            load_N[-1] = self.scan_load_N  # it is known there
        states: list[ContactState] = []
        for N in sorted(load_N.tolist(), reverse=True):
            try:
                patch = contact.of_patch(N) if differ and states else contact
                curve = patch.curve_after(greatest * N)
                if solves:
                    seen(curve, N)  # a map may have too few pixels
            except ContactError:
                if not (solves and states):
                    raise
                break
            states.append(replace(patch, curve=curve, preload_N=N))
        return states[::-1]

    def kappa_of(self, patches: Sequence[ContactState]) -> float:
        """Return kappa of the joint from those of its patches: their stiffnesses add up.

        sum w_k K_k / sum w_k K_k / kappa_k, so that the stiffness of its curve is the normal one.
        """
        kappa = [patch.composite.kappa for patch in patches]
        if len(set(kappa)) == 1:
            return kappa[0]
        K = []
        for ratio in ([1.0] * len(kappa), kappa):
            curve = self._together(patches, ratio)
            assert isinstance(curve, PatchedCurve)
            K.append(float(curve.stiffness_N_per_m(curve.preload_approach_m)))
        return K[0] / K[1]

    def curve_of(self, patches: Sequence[ContactState], kappa: float | None = None) -> NormalCurve:
        """Return the normal curve of the joint from the curves of what `loaded` gives.

        Each patch slips with its own kappa, see `with_ratio`; that of the joint may be any, and is
        that of `kappa_of` where none is given.
        """
        whole = self.kappa_of(patches) if kappa is None else kappa
        return self._together(patches, [patch.composite.kappa / whole for patch in patches])

    def _together(self, patches: Sequence[ContactState], ratio: Sequence[float]) -> NormalCurve:
        """Return the normal curve of the joint, whose kappa is that of each patch over its ratio.

        Of patches that are not among these the curve is that of the nearest by factors.
        """
        curves = [with_ratio(one.curve, r) for one, r in zip(patches, ratio, strict=True)]
        if patches[0].rung.made_from == "nothing":  # it carries one load, however that is spread
            load_N, weight = [self.scan_load_N], [self.preload_N / self.scan_load_N]
            return curve_of_joint(curves[0], np.array(load_N), np.array(weight))
        if self.is_even or (len(curves) == 1 and patches[0].rung.solved_loads_N is None):
            return curve_of_joint(curves[0], self.load_N, self.weight)
        if len(curves) < len(self.load_N):
            at_N = np.array([patch.preload_N for patch in patches])
            curves = scaled_between(curves, at_N, self.load_N)
        return side_by_side(curves, self.load_N, self.weight)


def knowing_levels(contact: ContactState, anew: Callable[[float], ContactState]) -> ContactState:
    """Return a scan that knows how it lies under the other pressures of its joint.

    Parameters
    ----------
    contact : ContactState
        At the level of its own load.
    anew : callable
        Presses it at the level of another load, N. A map that turns knows it by itself.
    """

    @cache
    def at_level(load_N: float) -> ContactState | None:
        try:
            if contact.turned is not None:
                return contact.under(load_N, contact.turned(load_N))
            return anew(load_N)
        except ContactError:
            return None

    return replace(contact, at_level=at_level)


def joint_of(settings: Settings, surface: HeightMap) -> Joint:
    """Return the joint that the settings describe and the scan is a part of.

    The nominal pressure acts on the rectangle that was scanned, holes in it included: a point that
    was not measured is face all the same. Lines without any measured point are none. Of a large map
    fewer pressures are solved, so that each has the time that it takes.

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
    fit_in = contact.time_limit_s / boundary_elements_s(surface.shape)
    most_solved = int(min(max(fit_in, FEWEST_SOLVED), MAX_SOLVED))
    # Of a scan that is its joint nobody asks for longer ones
    long_m = long_waves_m(surface) if weight.sum() > 1.0 else 0.0
    found = Joint(area_m2, scan_m2, preload_N, load_N, weight, scan_load_N, most_solved, long_m)
    if contact.bulk and not found.is_scan:
        raise SettingsError(
            "contact.bulk: got true with a joint that is larger than its scan; the bulk sinking of "
            "the scan is not that of the joint; leave it to the structure (contact.bulk = false)"
        )
    _check_pressure(scan_load_N / scan_m2, settings)
    return found


def is_loaded(settings: Settings) -> bool:
    """Tell whether somebody gave the load of the joint; else it is that of the demonstration."""
    contact = settings.contact
    if settings.joint.pressure_map is not None or contact.nominal_pressure_Pa is not None:
        return True
    return settings.families.approach_m is not None or settings.is_given("contact.preload_N")


def has_area(settings: Settings) -> bool:
    """Tell whether somebody gave the area of the joint; else it is that of the scan."""
    return settings.joint.area_m2 is not None or settings.joint.pressure_map is not None


def _check_pressure(pressure_Pa: float, settings: Settings) -> None:
    """Refuse a mean pressure on the scan that no solid of such a modulus can be under."""
    material = settings.material
    E_star_Pa = composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa
    if not pressure_Pa <= MOST_PRESSURE * E_star_Pa:
        nobodys = (
            f"nobody gave the load, and the {settings.contact.preload_N:g} N of the demonstration "
            "are too much for so small a scan: give --area and --pressure of the joint; else "
        )
        nobodys = "" if is_loaded(settings) else nobodys
        raise SettingsError(
            f"load out of range: got {pressure_Pa:.3g} Pa on the scan with a modulus E* "
            f"of {E_star_Pa:.3g} Pa; expected a pressure far below the modulus; {nobodys}look at "
            "the units of the scan, the load, joint.area_m2 and material.youngs_modulus_Pa"
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
    return side_by_side((curve,) * len(weight), load_N, weight)
