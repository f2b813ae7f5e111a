"""The cheapest contact model whose estimated error a scene allows."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.caps.families import Families
from capslip.caps.table import CapTable
from capslip.contact.curves import NormalCurve, bulk_compliance_m_per_N
from capslip.contact.interacting import InteractingCurve, interacting
from capslip.contact.ladder import RUNGS, normal_curve, reachable, without_bulk
from capslip.contact.material import Composite, composite
from capslip.contact.slip import slip_curve
from capslip.contact.unmodelled import unmodelled_area_m2
from capslip.errors import ContactError, UnusableSurfaceError
from capslip.problems import Problem
from capslip.settings import Settings
from capslip.surface.form import floor_slopes
from capslip.surface.heightmap import HeightMap

FORCE_SHARES = (0.1, 0.25, 0.5, 0.75)  # T / (mu N) at which the energies are compared
SHAPE_SHARE = 0.38  # of the rest of a profile that acts like an error of height, see Notes
LEAST_ERROR = 0.01  # of interacting spheres against boundary elements
BEYOND_SHARE = 0.05  # of the load, on contacts wider than their hills
DRAWS = 16
MOST_WIDE = 3.0  # in the logarithm of a radius
WITH_BULK = ("mean_field", "interacting")
BOUNDARY_ELEMENTS_S = 1.1e-6  # a point and binary digit of their number, on one core


@dataclass(frozen=True, eq=False)
class Choice:
    """The contact model for one face and load, made by `choose_model`."""

    model: str
    reason: str
    estimated_error: float | None  # of energy and stiffness, at 95 %; None: not known
    estimates: dict[str, float | None]  # of every rung that was tried
    use: np.ndarray  # (n,), the caps that can touch
    boundary_elements_s: float | None  # what they would take, where they are needed
    levelling: bool = False  # whether the levelling alone makes it doubtful

    @property
    def problem(self) -> Problem | None:
        """What makes a result of this choice doubtful."""
        if self.levelling:
            return Problem("levelling_decides", "warning", self.reason)
        if self.boundary_elements_s is None:
            return None
        return Problem("boundary_elements_needed", "warning", self.reason)


def choose_model(
    caps: CapTable,
    families: Families,
    surface: HeightMap,
    label: np.ndarray | None,
    noise_m: float,
    settings: Settings,
) -> Choice:
    """Choose the cheapest rung of the ladder whose estimated error is within the tolerance.

    The error of a rung is the greatest relative one of the energy of a cycle at four forces and of
    the stiffness. For a lower rung it is the difference to interacting caps plus their own error.

    Parameters
    ----------
    caps : CapTable
        Caps of the face, at least one of them usable.
    families : Families
        Their families.
    surface : HeightMap
        Heights after removal of the form, to see whether anything else touches.
    label : int, shape (ny, nx)
        The hills of the caps; 0 elsewhere. None where the caps are not those of one map: then
        nobody looks for what else touches.
    noise_m : float
        Standard deviation of the noise of the map.
    settings : Settings
        `material`, and `contact` with its tolerance.

    Returns
    -------
    Choice
        Where no rung is within the tolerance, the highest one, with the time that boundary
        elements would take, unless the levelling alone is the cause, which they share.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload.

    Notes
    -----
    A hill that deviates from its sphere by r changes its load like a height error of r averaged
    with the pressure of a flat punch over the contact, which grows with the load. Deviations that
    go with the direction have none, so r counts from the paraboloid of the hill's own curvatures.

    What the fit leaves is known with its sign: an apex and a volume that are right, and a term
    q (t^2 - 2/3 t) of the profile, t the depth over the fitted one z. At the share s of z in t that
    the contact reaches, load and stiffness of that hill are those of a sphere whose apex is higher
    by 8/15 q s^2 and the logarithm of whose radius is greater by (2/3 - 8/5 s) q / z. The change
    that all hills make together so is the error of shape. It is the first order alone, and counts
    twice: on hills of r^1.6 to r^4 the true error was 0.4 to 1 times that.

    Random errors are twice the standard deviation over faces whose caps were moved at random:
    heights and radii by their standard errors, and by what is left of the profile. The lowest such
    term, 20 t^3 - 30 t^2 + 12 t - 1, has a height error of sqrt(7) / 7 = 0.38 of its root mean
    square.

    The levelling is uncertain by the tilt between the plane taken off and that of the lowest third
    of the points, which peaks that are not balanced over the face do not pull.

    The last part is the change under another law between two contacts. None of these causes has to
    do with another, so their squares add. The error is not known where something else than the caps
    carries: if contacts overlap, are wider than their hills, or if the plane reaches points outside
    the hills.
    """
    joint = composite(settings.material.youngs_modulus_Pa, settings.material.poisson_ratio)
    ladder = _Ladder(caps, families, surface.side_m, joint, settings)
    use, curve = reachable(caps, surface.side_m, joint.E_star_Pa, settings.contact.preload_N)
    if not isinstance(curve, InteractingCurve):
        return _too_many(ladder, use, surface.shape)
    answers = {}
    for model in RUNGS:
        try:
            answers[model] = ladder.answers(ladder.curve(model, use))
        except ContactError:
            if model == RUNGS[-1]:
                raise
    doubt = ladder.doubt(use, curve, surface, label, noise_m)
    own, of_caps, of_tilt = None, math.inf, 0.0
    if doubt is None:
        try:
            at = answers["interacting"]
            of_caps = math.hypot(
                ladder.spread(use, at, noise_m),
                ladder.shape_error(use, curve, at),
                ladder.pair_error(use, at),
                LEAST_ERROR,
            )
            of_tilt = ladder.tilt_error(at, surface)
            own = math.hypot(of_caps, of_tilt)
        except (ContactError, UnusableSurfaceError):
            doubt = "caps that are moved within their errors have no solution"
    estimates: dict[str, float | None] = {}
    for model, numbers in answers.items():
        difference = np.abs(numbers / answers["interacting"] - 1.0).max()
        estimates[model] = None if own is None else float(difference) + own
    tolerance = settings.contact.tolerance
    for model, estimate in estimates.items():
        if estimate is not None and estimate <= tolerance:
            reason = f"the cheapest model within {tolerance:.2g}: its error is about {estimate:.2g}"
            return Choice(model, reason, estimate, estimates, use, None)
    if own is not None and of_caps <= tolerance:
        reason = (
            f"interacting caps may be off by {own:.2g}, more than {tolerance:.2g}: the plane of "
            "the lowest third of the points instead of what was taken off changes the answers by "
            f"{of_tilt:.2g}; where the caps lie tilts a least-squares plane, and "
            "conditioning.form_floor = true follows the floor between them, where there is one"
        )
        return Choice("interacting", reason, own, estimates, use, None, levelling=True)
    needed_s = boundary_elements_s(surface.shape)
    why = doubt or f"interacting caps may be off by {own:.2g}, more than {tolerance:.2g}"
    return Choice(
        "interacting",
        f"{why}; boundary elements are needed and take about {needed_s:.2g} s",
        own,
        estimates,
        use,
        needed_s,
    )


@dataclass(frozen=True, eq=False)
class _Ladder:
    caps: CapTable
    families: Families
    side_m: tuple[float, float]
    joint: Composite
    settings: Settings

    def curve(self, model: str, use: np.ndarray) -> NormalCurve:
        preload_N, E_star_Pa = self.settings.contact.preload_N, self.joint.E_star_Pa
        return normal_curve(model, self.caps, self.families, self.side_m, E_star_Pa, preload_N, use)

    def answers(self, curve: NormalCurve) -> np.ndarray:
        """Return the energies at four forces and the stiffness that slip would use."""
        preload_N, mu = self.settings.contact.preload_N, self.settings.material.friction_coefficient
        slip = slip_curve(curve, preload_N, mu, self.joint.kappa)
        energy_J = slip.energy_at_force_J(np.array(FORCE_SHARES) * slip.total_slip_force_N)
        if curve.model in WITH_BULK and not self.settings.contact.bulk:
            bulk_m_per_N = bulk_compliance_m_per_N(self.side_m, self.joint.E_star_Pa)
            curve, _ = without_bulk(curve, bulk_m_per_N, preload_N)
        stiffness = curve.stiffness_N_per_m(curve.approach_m(preload_N))
        return np.append(energy_J, stiffness)

    def spread(self, use: np.ndarray, answers: np.ndarray, noise_m: float) -> float:
        """Return twice the relative standard deviation of the answers that moved caps give."""
        caps = self.caps

        def used(values: np.ndarray) -> np.ndarray:
            return np.nan_to_num(values[use])  # a table that no fit made has no standard errors

        residual_m = np.sqrt(np.maximum(used(caps.profile_residual_m) ** 2 - noise_m**2, 0.0))
        shape_m = SHAPE_SHARE * residual_m
        depth_m = np.where(
            used(caps.fit_depth_m) > 0.0, caps.fit_depth_m[use], caps.cap_height_m[use]
        )
        height_m, ratio = np.zeros((2, len(caps)))
        height_m[use] = np.hypot(shape_m, used(caps.peak_height_se_m))
        ratio[use] = np.hypot(
            used(caps.radius_se_m) / caps.radius_m[use], shape_m / np.maximum(depth_m, shape_m)
        )
        draws = max(4, min(DRAWS, DRAWS * 100 // int(np.count_nonzero(use))))
        sign = np.random.default_rng(0).choice((-1.0, 1.0), (draws, 2, len(caps)))
        found = []
        for up, wide in sign:
            moved = caps.with_columns(
                peak_height_m=caps.peak_height_m + up * height_m,
                radius_m=caps.radius_m * np.exp(wide * ratio),
            )
            found.append(self.answers(self.interacting(use, moved)) / answers - 1.0)
        return float(2.0 * np.sqrt(np.mean(np.square(found), axis=0)).max())

    def shape_error(self, use: np.ndarray, curve: InteractingCurve, answers: np.ndarray) -> float:
        """Return twice the change of the answers with caps that follow the hills' profiles."""
        caps = self.caps
        load_N = curve.asperity_loads_N(curve.approach_m(self.settings.contact.preload_N))
        depth_m, quartic_m = caps.fit_depth_m[use], caps.quartic_m[use]
        share = (load_N / curve.coefficient) ** (2 / 3) / (2.0 * depth_m)
        known = np.isfinite(quartic_m * share)  # a table that no fit made has no profiles
        up_m, wide = np.zeros((2, len(caps)))
        up_m[use] = np.where(known, 8 / 15 * quartic_m * share**2, 0.0)
        # The first order would overflow far beyond the hill, which is doubted anyway
        first_order = (2 / 3 - 8 / 5 * share) * quartic_m / depth_m
        wide[use] = np.where(known, np.clip(first_order, -MOST_WIDE, MOST_WIDE), 0.0)
        moved = caps.with_columns(
            peak_height_m=caps.peak_height_m + up_m, radius_m=caps.radius_m * np.exp(wide)
        )
        return float(2.0 * np.abs(self.answers(self.interacting(use, moved)) / answers - 1.0).max())

    def tilt_error(self, answers: np.ndarray, surface: HeightMap) -> float:
        """Return the relative change of the answers where the floor levels the face."""
        if self.settings.conditioning.form == "none":
            return 0.0
        slope_y, slope_x = floor_slopes(surface)
        caps = self.caps
        peak_m = caps.peak_height_m - slope_y * caps.y_m - slope_x * caps.x_m
        _, curve = reachable(
            caps.with_columns(peak_height_m=peak_m),
            self.side_m,
            self.joint.E_star_Pa,
            self.settings.contact.preload_N,
        )
        return float(np.abs(self.answers(curve) / answers - 1.0).max())

    def pair_error(self, use: np.ndarray, answers: np.ndarray) -> float:
        """Return the relative change of the answers with another law between two contacts.

        The point load and Johnson's Eq. 3.42 err on either side, the latter further.
        """
        curve = self.interacting(use, self.caps, self.settings.contact.preload_N)
        return float(np.abs(self.answers(curve) / answers - 1.0).max())

    def doubt(
        self,
        use: np.ndarray,
        curve: InteractingCurve,
        surface: HeightMap,
        label: np.ndarray | None,
        noise_m: float,
    ) -> str | None:
        """Return why the error of interacting caps is not known, None where it is."""
        caps = self.caps
        approach_m = float(curve.approach_m(self.settings.contact.preload_N))
        if curve.overlapping_pairs(approach_m):
            return "contacts run together"
        load_N = curve.asperity_loads_N(approach_m)
        a_m = np.cbrt(0.75 * load_N * curve.radius_m / self.joint.E_star_Pa)
        beyond = a_m > 0.5 * caps.diameter_m[use]
        if load_N[beyond].sum() > BEYOND_SHARE * load_N.sum():
            return "contacts are wider than the hills that the caps were fitted to"
        top_m = float(caps.peak_height_m[use].max())
        if label is None:
            return None
        if unmodelled_area_m2(surface, label, curve, approach_m, top_m, noise_m) > 0.0:
            return "parts of the face that are no hills would touch"
        return None

    def interacting(
        self, use: np.ndarray, caps: CapTable, preload_N: float | None = None
    ) -> InteractingCurve:
        depth_m = caps.peak_height_m[use].max() - caps.peak_height_m[use]
        places = caps.x_m[use], caps.y_m[use]
        return interacting(caps.radius_m[use], depth_m, *places, self.joint.E_star_Pa, preload_N)


def _too_many(ladder: _Ladder, use: np.ndarray, shape: tuple[int, int]) -> Choice:
    """Return mean field, whose error nothing on the ladder tells."""
    ladder.answers(ladder.curve("mean_field", use))  # raises where they cannot carry the load
    needed_s = boundary_elements_s(shape)
    return Choice(
        "mean_field",
        f"{np.count_nonzero(use)} caps that can touch are too many to solve for every pair",
        None,
        {"mean_field": None},
        use,
        needed_s,
    )


def boundary_elements_s(shape: tuple[int, int]) -> float:
    """Return about how long boundary elements take on a grid, for one loss curve."""
    points = math.prod(shape)
    return BOUNDARY_ELEMENTS_S * points * math.log2(points)
