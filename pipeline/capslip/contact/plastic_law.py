"""What the plastic law of a model leaves open, beside finite elements of spheres."""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from capslip.contact.bulk import bulk_of_face_m_per_N, share_of_contact
from capslip.contact.solvers.metal import OVER_HARDNESS
from capslip.contact.solvers.pressed import Pressed
from capslip.contact.solvers.withdrawn import withdrawn_together
from capslip.problems import Problem
from capslip.units import percent

if TYPE_CHECKING:
    from capslip.contact.map_curve import BoundaryElementCurve

# By the greatest pressure p0 that a contact would have if it were elastic, over the hardness, one
# well resolved sphere: its stiffness as a map whose pressures end at the hardness, over that of
# finite elements: `docs/theory.md`, section 5
MAP_AT = (0.795, 0.85, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 6.0)
STIFFNESS = (1.0, 0.986, 0.973, 0.949, 0.928, 0.907, 0.895, 0.9, 0.912, 0.942, 0.964, 0.989, 1.0)
# And the energies as it unloads by finite elements, over those of an elastic contact of the same
# load and radius: a row for each share of mu N, at each of `OVER_HARDNESS`
SHARES = (0.1, 0.25, 0.5, 0.75)
ENERGY = (
    (1.0, 0.972, 0.882, 0.764, 0.563, 0.389, 0.314, 0.193, 0.141, 0.121),
    (1.0, 0.967, 0.867, 0.745, 0.558, 0.49, 0.397, 0.274, 0.224, 0.204),
    (1.0, 0.957, 0.843, 0.724, 0.612, 0.564, 0.482, 0.387, 0.347, 0.344),
    (1.0, 0.942, 0.823, 0.73, 0.655, 0.612, 0.547, 0.478, 0.451, 0.468),
)
# Of what areas and unloading move, in logarithms, at 95 %: that metals harden, by a modulus of 2 %
# of Young's, moves the energies by a tenth of it
AREA_95, UNLOADING_95 = 0.7, 0.25
# Of the stiffness where all is plastic: the mean pressure is 2.7 to 2.9 Y there, and H 2.8 Y
HARD_95, HARD_AT = 0.025, (2.0, 4.0)
# By the finite elements of tops that are no spheres: the power of how blunt one is, and the p0 / H
# between which it comes in; of what that moves, in logarithms, at 95 %
BLUNT, BLUNT_AT, FORM_95 = 1.5, (0.85, 1.25), 1.0
MOST_BLUNT = 1.5  # how blunt one counts for at most there, or how pointed
# By how much more the rim of a blunt one loses than that, where metal has flattened its pressures
# and the bound has not yet: over the logarithm of how blunt it is, by p0 / H, at three quarters of
# mu N; the share of it at each of `SHARES`; and of what that moves, at 95 %
RIM_AT, RIM = (0.65, 0.8, 1.0, 1.1, 1.2), (0.0, 0.3, 0.54, 0.5, 0.0)
RIM_SHARES, RIM_95 = (0.0, 0.0, 0.6, 1.0), 0.5
_MOST_TOGETHER = 200  # contacts that are withdrawn together
# Of mu N, at which contacts of metal tell how the energy falls where pixels let go of nothing
SMALL_SHARES = (1e-3, 3e-3, 0.01, 0.02, 0.04, 0.07, 0.1, 0.14, 0.19, 0.25)
# Of the radius of a cap that has yielded: finite elements of others have 2 % more or less, those of
# `docs/theory.md` up to 1.8 % more
RADIUS_95 = 0.03
YIELDED_AT = (0.6, 1.0)  # p0 / H, between which that comes in
WIDER = "metal yields below its surface before its pressure is the hardness, and touches more"


@dataclass(frozen=True)
class LawError:
    """By how much finite elements of spheres differ from a model that yields, in logarithms.

    Made by `law_of_map` and `law_of_caps`.
    """

    stiffness: float  # where slip begins
    displacement: tuple[float, ...]  # beyond that, at each of `SHARES`
    energy: tuple[float, ...]  # at the same stiffness, at each of `SHARES`
    left_open: tuple[float, ...]  # of the energy, on either side at 95 %
    # Of displacement and energy, on either side at 95 %, by how wide what yielded is
    of_radius: tuple[tuple[float, ...], tuple[float, ...]] = ((0.0,) * len(SHARES),) * 2
    small_slip: tuple[float, ...] = ()  # logarithms of the energy at `SMALL_SHARES`, of any unit

    def small_energy(self, share: np.ndarray) -> np.ndarray:
        """Return the energies at small shares of mu N, of any unit, with a cube below the least."""
        within = np.log(np.maximum(share, SMALL_SHARES[0]))
        log = np.interp(within, np.log(SMALL_SHARES), self.small_slip)
        return np.asarray(np.exp(log) * np.minimum(share / SMALL_SHARES[0], 1.0) ** 3)

    def shift(self, share: float) -> tuple[float, float]:
        """Return by how much displacement and energy are expected to be greater, at a force.

        Of a wider contact, which is as much stiffer, both are less.
        """
        displacement, energy = (self._at(share, one) for one in (self.displacement, self.energy))
        return displacement - self.stiffness, energy - self.stiffness

    def half_95(self, share: float) -> np.ndarray:
        """Return what is left open on either side of that at 95 %, of causes by (2,)."""
        of_radius = [self._at(share, one) for one in self.of_radius]
        displacement = UNLOADING_95 * self._at(share, self.displacement)
        left_open = self._at(share, self.left_open)
        return np.array((of_radius, (displacement, 0.0), (0.0, left_open)))

    def errors(self, share: float) -> tuple[float, float]:
        """Return relative errors of stiffness and energy at a share of mu N: to what is expected.

        Those of where slip begins, which is the greatest of all secants but near full plasticity.
        """
        displacement, energy = self.shift(share)
        stiffness = max(abs(self.stiffness), abs(displacement))
        return math.expm1(stiffness), abs(math.expm1(energy))

    def _at(self, share: float, values: tuple[float, ...]) -> float:
        """Return a value at a share of mu N, a straight line over its logarithm."""
        return float(np.interp(math.log(share), np.log(SHARES), values))


def law_of_map(curve: "BoundaryElementCurve", load_N: float) -> LawError | None:
    """Return what metal does otherwise than a map under its first load, and what of it is open.

    None: nothing.

    The map clips pressures at the hardness. Finite elements of spheres yield below their surface
    before that, and are wider at the same load from p0 = 0.8 H on (Jackson and Green 2005, with
    whom Kogut and Etsion 2002 agree within 4 %, and those of `docs/theory.md` within 3 %). What
    that moves is found with the heaviest contacts, round, withdrawn together as they are and as
    wide as metal is. How they unload the map knows (`metal_pressure_Pa`), as well as finite
    elements of spheres know it of metal; tops that are blunter unload as those that have yielded
    more, by finite elements of such (`studies/plastic_tops.py`), pointed ones as less. Far into
    slip blunt ones lose more than that where the map still has their rim as it was solved: metal
    yields there well below the hardness.

    Parameters
    ----------
    curve : BoundaryElementCurve
        Of a first loading to this load, or of an elastic face.
        Where that holds the bulk sinking, its displacements move by the share of the contact.
    load_N : float
    """
    pressed = curve.pressed(load_N)
    over, blunt = pressed.over_hardness, pressed.blunt
    if over is None or blunt is None or (over <= OVER_HARDNESS[0]).all():
        return None
    share, each_N = of_contact(curve, load_N), pressed.region_loads_N
    each = pressed.sum_over_regions(pressed.pressure_Pa * over) / each_N
    radius_m = np.sqrt(pressed.region_pixels * math.prod(pressed.pixel_size_m) / math.pi)
    of_metal_m = radius_m / np.interp(each, MAP_AT, STIFFNESS)
    stiffness = share * math.log(of_metal_m.sum() / radius_m.sum())
    heavy = np.sort(np.argsort(-each_N, kind="stable")[:_MOST_TOGETHER])
    pair_per_m = _pairs_per_m(pressed, heavy) if heavy.size > 1 else None
    contacts = each[heavy], each_N[heavy]
    was, lost = withdrawn_together(*contacts, radius_m[heavy], SHARES, pair_per_m)
    both = tuple(sorted({*SHARES, *SMALL_SHARES}))
    moves, loses = withdrawn_together(*contacts, of_metal_m[heavy], both, pair_per_m)
    at, small_at = (np.searchsorted(both, one) for one in (SHARES, SMALL_SHARES))
    displacement, energy = share * np.log(moves[at] / was), np.log(loses[at] / lost)
    of_spheres = _energies(over, pressed.pressure_Pa)
    of_form = _energies(_as_it_unloads(over, blunt), pressed.pressure_Pa) - of_spheres
    of_rim = np.array(RIM_SHARES) * _of_rim(over, blunt, pressed.pressure_Pa)
    small = np.log(loses[small_at]) + np.interp(
        np.log(SMALL_SHARES), np.log(SHARES), of_form + of_rim
    )
    sure = np.interp(each, HARD_AT, (0.0, HARD_95)) @ each_N / each_N.sum()
    return LawError(
        stiffness,
        _each(displacement + stiffness),
        _each(energy + of_form + of_rim + stiffness),
        _each(
            np.linalg.norm((UNLOADING_95 * of_spheres, FORM_95 * of_form, RIM_95 * of_rim), axis=0)
        ),
        (_each(np.hypot(AREA_95 * displacement, sure)), _each(np.hypot(AREA_95 * energy, sure))),
        _each(small),
    )


def _pairs_per_m(pressed: Pressed, heavy: np.ndarray) -> np.ndarray:
    """Return by how much loads on contacts of a map sink it at the others, times E*, (n, n).

    As point loads that are as far apart as the loads of both are, as a root mean square: a ring is
    not where its middle is. So they always find a balance, as 1 / sqrt(d^2 + s_i^2 + s_j^2) with
    i = j is less than pi / 2 over the radius of an even contact, and positive definite.
    """
    dy_m, dx_m = pressed.pixel_size_m
    ny, nx = pressed.pressure_Pa.shape
    places_m = np.arange(nx) * dx_m, np.arange(ny)[:, None] * dy_m

    def mean(of: np.ndarray) -> np.ndarray:
        load_N = pressed.region_loads_N[heavy]
        return np.asarray(pressed.sum_over_regions(pressed.pressure_Pa * of)[heavy] / load_N)

    x_m, y_m = (mean(at) for at in places_m)
    reach_m2 = mean(sum(np.square(at) for at in places_m)) - x_m**2 - y_m**2
    reach_m2 += (dy_m**2 + dx_m**2) / 12.0  # of the pixels themselves
    apart_m2 = np.square(x_m[:, None] - x_m) + np.square(y_m[:, None] - y_m)
    apart_m2 += reach_m2[:, None] + reach_m2
    np.fill_diagonal(apart_m2, np.inf)
    return 1.0 / (math.pi * np.sqrt(apart_m2))


def _as_it_unloads(over: np.ndarray, blunt: np.ndarray) -> np.ndarray:
    """Return p0 / H of the sphere that unloads as a top does."""
    counts = np.clip(blunt, 1.0 / MOST_BLUNT, MOST_BLUNT)
    return np.asarray(over * counts ** np.interp(over, BLUNT_AT, (0.0, BLUNT)))


def _of_rim(over: np.ndarray, blunt: np.ndarray, pressure_Pa: np.ndarray) -> float:
    """Return how much more flattened rims lose at the last of `SHARES`, a logarithm."""
    touching = pressure_Pa > 0.0
    over, blunt, load = over[touching], blunt[touching], pressure_Pa[touching]
    each = np.interp(over, RIM_AT, RIM) * np.log(np.maximum(blunt, 1.0))
    return float(each @ load / load.sum())


def _energies(over: np.ndarray, pressure_Pa: np.ndarray) -> np.ndarray:
    """Return the logarithms of means of `ENERGY` over the pressures, one for each row."""
    touching = pressure_Pa > 0.0
    over, load = over[touching], pressure_Pa[touching]
    each = [np.interp(over, OVER_HARDNESS, row) @ load / load.sum() for row in ENERGY]
    return np.log(each)


def law_of_caps(
    over: np.ndarray,
    load_N: np.ndarray,
    radius_m: np.ndarray,
    pair_per_m: np.ndarray | None,
    withdrawal: np.ndarray,
) -> LawError | None:
    """Return what the unloading of caps that yielded leaves open, which is that of Hertz contacts.

    All are withdrawn together, see `withdrawn_together`: light ones, which have hardly yielded, are
    far into slip where the heavy ones begin, so the whole loses less otherwise than one cap does.

    Parameters
    ----------
    over : float64, shape (n,)
        p0 / H of the caps as they were before.
    load_N, radius_m : float64, shape (n,)
        What they carry, and how wide their contacts are.
    pair_per_m : float64, shape (n, n), or None
        Compliances between them, times E*.
    withdrawal : float64, shape (4,)
        That of the curve for slip at each of `SHARES` times E*, in N/m.
    """
    if (over[load_N > 0.0] <= OVER_HARDNESS[0]).all():
        return None
    unsure = np.interp(over, YIELDED_AT, (0.0, RADIUS_95))
    each = (np.zeros_like(over), radius_m), (over, radius_m), (over, radius_m * np.exp(unsure))
    found = [withdrawn_together(of, load_N, a_m, SHARES, pair_per_m) for of, a_m in each]
    hertz, metal, wide = (one for one, _ in found)
    displacement, wider = (
        np.log(np.maximum(withdrawal + one - hertz, 0.1 * withdrawal) / withdrawal)
        for one in (metal, wide)
    )
    of_hertz, energy, energy_wider = np.log([one for _, one in found])
    return LawError(
        0.0,
        _each(displacement),
        _each(energy - of_hertz),
        _each(np.abs(UNLOADING_95 * (energy - of_hertz))),
        (_each(displacement - wider), _each(energy - energy_wider)),
    )


def _each(values: np.ndarray) -> tuple[float, ...]:
    return tuple(values.tolist())


def of_contact(curve: "BoundaryElementCurve", load_N: float) -> float:
    """Return the share of the contacts in the compliance of a map, see `share_of_contact`."""
    face, pressed = curve.solutions.face, curve.pressed(load_N)
    kept_m_per_N = bulk_of_face_m_per_N(face, face.E_star_Pa) + curve.compliance_m_per_N
    radius_m = np.sqrt(pressed.region_pixels * face.pixel_area_m2 / math.pi)
    own_N_per_m = 2.0 * face.E_star_Pa * float(radius_m.sum())
    return share_of_contact(curve, kept_m_per_N, load_N, own_N_per_m)


def with_law(
    problems: list[Problem], law: LawError | None, share: float, tolerance: float
) -> list[Problem]:
    """Return the problems, with what the plastic law has moved of a map in `yielded`.

    Parameters
    ----------
    problems : list of Problem
    law : LawError or None
        What the answers hold of it; None: nothing.
    share : float
        Of mu N, that is asked for.
    tolerance : float
        Beyond which that is noted where the map itself has not yielded.
    """
    if law is None:
        return problems
    stiffness, energy = law.errors(share)
    of_law = (
        f"{WIDER}: by finite elements of spheres that moves the stiffness by "
        f"{percent(stiffness)} and the energy at {percent(share)} of gross slip by "
        f"{percent(energy)}, which the answers hold"
    )
    said = [one for one in problems if one.code == "yielded"]
    if not said:
        if max(stiffness, energy) <= tolerance:
            return problems
        message = f"the greatest pressure is near the hardness; {of_law}"
        return [*problems, Problem("yielded", "info", message)]
    return [
        replace(one, message=f"{one.message}; {of_law}") if one.code == "yielded" else one
        for one in problems
    ]
