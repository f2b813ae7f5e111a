"""What the plastic law of a pressed map leaves open, beside that of finite elements for spheres."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from capslip.contact.bulk import bulk_of_face_m_per_N, share_of_contact
from capslip.contact.map_curve import BoundaryElementCurve
from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.pressed import Pressed
from capslip.problems import Effect, Problem, Severity
from capslip.units import percent

# One well resolved sphere, map over caps, by the greatest pressure p0 that it would have if it were
# elastic, over the hardness: `docs/theory.md`, section 5
OVER_HARDNESS = (0.795, 0.85, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 6.0)
# Sunk for good at most, over the radius of the contact and H / E*, which tells p0 / H from 1 on
SUNK = (0.0, 0.0435, 0.164, 0.429, 0.737, 1.066, 1.789, 2.59, 4.37, 8.66)
STIFFNESS = (1.0, 0.986, 0.973, 0.949, 0.928, 0.907, 0.895, 0.9, 0.912, 0.942, 0.964, 0.989, 1.0)
SHARES = (0.1, 0.25, 0.5, 0.75)  # of mu N
# Displacements beyond that of the stiffness, and energies, a row for each share of mu N
SHAPE = (
    (*(1.0,) * 5, 0.999, 0.996, 0.992, 0.989, 0.985, 0.984, 0.984, 0.984),
    (*(1.0,) * 5, 0.997, 0.989, 0.977, 0.968, 0.963, 0.962, 0.961, 0.96),
    (*(1.0,) * 4, 0.999, 0.992, 0.966, 0.944, 0.933, 0.928, 0.927, 0.926, 0.926),
    (*(1.0,) * 4, 0.997, 0.977, 0.934, 0.91, 0.899, 0.895, 0.894, 0.893, 0.892),
)
ENERGY = (
    (1.0, 1.014, 1.028, 1.056, 1.067, 1.041, 0.858, 0.591, 0.332, 0.112, 0.088, 0.087, 0.087),
    (1.0, 1.014, 1.028, 1.056, 1.068, 1.03, 0.809, 0.49, 0.278, 0.219, 0.208, 0.199, 0.199),
    (1.0, 1.014, 1.028, 1.054, 1.066, 0.998, 0.659, 0.452, 0.399, 0.377, 0.367, 0.357, 0.352),
    (1.0, 1.014, 1.028, 1.054, 1.057, 0.899, 0.64, 0.561, 0.534, 0.513, 0.501, 0.487, 0.481),
)
HALF_95 = 0.7  # of the logarithm from map to caps: the 90 % about its middle hold both


@dataclass(frozen=True)
class LawError:
    """By how much caps differ from the map that yields, in logarithms; made by `law_of_map`.

    The stiffness is that of the area of contact, and finite elements have that of caps. How a
    contact unloads they have between both, so of energies and shapes the middle counts.
    """

    stiffness: float
    shape: tuple[float, ...]  # of the displacement beyond that, at each of `shares`
    energy: tuple[float, ...]  # at each of `shares`
    shares: ClassVar[tuple[float, ...]] = SHARES  # of mu N

    def shift(self, share: float) -> tuple[float, float]:
        """Return by how much displacement and energy are expected to be greater, at a force."""
        shape, energy = self._at(share)
        return 0.5 * shape - self.stiffness, 0.5 * energy

    def half_95(self, share: float) -> np.ndarray:
        """Return what is left open on either side of that at 95 %, of causes by (2,)."""
        shape, energy = self._at(share)
        of_each = (self.stiffness, 0.0), (shape, 0.0), (0.0, energy)
        return HALF_95 * np.array(of_each)

    def errors(self, share: float) -> tuple[float, float]:
        """Return relative errors of stiffness and energy at a share of mu N: to what is expected.

        Those of where slip begins, which is the greatest of all secants but near full plasticity.
        """
        displacement, energy = self.shift(share)
        stiffness = max(self.stiffness, abs(displacement))
        return math.expm1(stiffness), abs(math.expm1(energy))

    def _at(self, share: float) -> tuple[float, float]:
        """Return shape and energy at a share of mu N, straight lines over its logarithm.

        Below a tenth the map loses as T^4, where flats let go, and caps as T^3.
        """
        at, known = math.log(share), np.log(SHARES)
        shape, energy = (float(np.interp(at, known, one)) for one in (self.shape, self.energy))
        rise = (self.energy[0] - self.energy[1]) / (known[1] - known[0])
        return shape, energy + max(rise, 0.0) * max(known[0] - at, 0.0)


def law_of_map(curve: BoundaryElementCurve, load_N: float) -> LawError | None:
    """Return what the plastic law of a map leaves open under its first load; None: nothing.

    The map clips pressures at the hardness. Finite elements of spheres yield below their surface
    before that (from p0 = 0.8 H on), are wider at the same load (Jackson and Green 2005, with whom
    Kogut and Etsion 2002 agree within 4 %), and unload more evenly (Etsion, Kligerman and Kadin
    2005). One sphere, solved as a map and as a cap, tells by how much, over p0 / H alone: H / E* of
    0.001 and 0.01 differ by 0.5 % in the stiffness. Each contact of a map counts by its own p0 / H,
    which its greatest pressure tells below the hardness, and beyond how far it has sunk for good.

    Parameters
    ----------
    curve : BoundaryElementCurve
        Of a first loading to this load, or of an elastic face.
        Where that holds the bulk sinking, its displacements move by the share of the contact.
    load_N : float
    """
    pressed, first = curve.pressed(load_N), curve.loaded_first_to(load_N)
    hardness_Pa = first.face.hardness_Pa
    if pressed.max_pressure_Pa <= OVER_HARDNESS[0] * hardness_Pa:
        return None
    over_hardness = _over_hardness(pressed, first.face, curve.solutions.face)
    load, radius = pressed.region_loads_N, np.sqrt(pressed.region_pixels)
    of_caps = radius / np.interp(over_hardness, OVER_HARDNESS, STIFFNESS)
    # Of a load a cap loses what it does however it yielded, so by that the contacts add up
    shape, energy = (
        tuple(
            -math.log(load @ np.interp(over_hardness, OVER_HARDNESS, one) / load.sum())
            for one in rows
        )
        for rows in (SHAPE, ENERGY)
    )
    share = of_contact(curve, load_N)
    stiffness = share * math.log(of_caps.sum() / radius.sum())
    return LawError(stiffness, tuple(share * one for one in shape), energy)


def of_contact(curve: BoundaryElementCurve, load_N: float) -> float:
    """Return the share of the contacts in the compliance of a map, see `share_of_contact`."""
    face, pressed = curve.solutions.face, curve.pressed(load_N)
    kept_m_per_N = bulk_of_face_m_per_N(face, face.E_star_Pa) + curve.compliance_m_per_N
    radius_m = np.sqrt(pressed.region_pixels * face.pixel_area_m2 / math.pi)
    own_N_per_m = 2.0 * face.E_star_Pa * float(radius_m.sum())
    return share_of_contact(curve, kept_m_per_N, load_N, own_N_per_m)


def _over_hardness(pressed: Pressed, before: ElasticFace, after: ElasticFace) -> np.ndarray:
    """Return p0 / H of each contact region, shape (n,)."""
    from scipy.ndimage import maximum

    number = np.arange(1, len(pressed.region_pixels) + 1)
    most_Pa = np.asarray(maximum(pressed.pressure_Pa, pressed.region, number))
    sunk_m = after.depth_m - before.depth_m  # both count from their own highest point
    sunk_m = sunk_m - np.min(sunk_m, where=before.measured, initial=np.inf)
    deepest_m = np.asarray(maximum(sunk_m, pressed.region, number))
    radius_m = np.sqrt(pressed.region_pixels * before.pixel_area_m2 / math.pi)
    relative = deepest_m * before.E_star_Pa / (before.hardness_Pa * radius_m)
    sunk = np.interp(relative, SUNK, OVER_HARDNESS[-len(SUNK) :])
    return np.where(most_Pa < before.hardness_Pa, most_Pa / before.hardness_Pa, sunk)


def with_law(
    problems: list[Problem], law: LawError | None, share: float, tolerance: float
) -> list[Problem]:
    """Return the problems, with what the plastic law moves in `yielded`.

    A warning by the stiffness, which is wrong one way. Of the energy laws of unloading differ, by a
    factor where all is plastic: that is no doubt about this face, and is in its interval.

    Parameters
    ----------
    problems : list of Problem
    law : LawError or None
        None: the model in use says by itself what it leaves.
    share : float
        Of mu N, that is asked for.
    tolerance : float
        Of the stiffness, beyond which that is a warning.
    """
    if law is None:
        return problems
    stiffness, energy = law.errors(share)
    severity: Severity = "warning" if stiffness > tolerance else "info"
    of_law = (
        f"metal yields below its surface before, and unloads more evenly, than a map whose "
        f"pressures end at the hardness: by finite elements of spheres that moves the stiffness by "
        f"{percent(stiffness)} and the energy at {percent(share)} of gross slip by "
        f"{percent(energy)}"
    )
    effect = Effect(stiffness, energy, energy)
    said = [one for one in problems if one.code == "yielded"]
    if not said:
        if severity == "info":
            return problems
        message = f"the greatest pressure is near the hardness; {of_law}"
        return [*problems, Problem("yielded", severity, message, effect)]
    return [
        replace(one, severity=severity, message=f"{one.message}; {of_law}", effect=effect)
        if one.code == "yielded"
        else one
        for one in problems
    ]
