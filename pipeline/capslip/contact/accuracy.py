"""How far interacting caps may be from the face that they stand for."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from capslip.caps.spheres import LONGEST, elliptic_factor
from capslip.caps.table import CapFlag, CapTable
from capslip.contact.bulk import bulk_of_face_m_per_N, share_of_contact, without_bulk
from capslip.contact.certificate import unmodelled_area_m2
from capslip.contact.curve import NormalCurve
from capslip.contact.material import composite
from capslip.contact.models.interacting import InteractingCurve
from capslip.contact.moved import moved_caps
from capslip.contact.outlines import outlines
from capslip.contact.plastic_law import SHARES, LawError, law_of_caps
from capslip.contact.profiles import profiles
from capslip.contact.reach import reachable
from capslip.contact.rung import ModelError, Scene
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.errors import ContactError, UnusableSurfaceError
from capslip.settings import Settings
from capslip.surface.form import floor_slopes
from capslip.surface.heightmap import HeightMap
from capslip.surface.noise import known_noise_m

FORCE_SHARES = (0.1, 0.25, 0.5, 0.75)  # T / (mu N) at which the energies are compared
SHAPE_SHARE = 0.38  # of the rest of a profile that acts like an error of height, see Notes
QUARTIC_SE = 6.0 * math.sqrt(5.0)  # of q, over that of the mean of as many points
LEAST_ERROR = 0.001  # of interacting spheres against boundary elements, on faces of 60 caps
PAIRS_SHARE = 0.5  # of what point loads alone would change: a tenth to seven tenths were seen
BEYOND_SHARE = 0.05  # of the load, on contacts wider than their hills
CUT_SHARE = 0.02  # of the load, beyond the edge of the face; at 4 % energies are 6 % off
# Of stiffness and energy of caps that have yielded: maps that sink as deep, and are as wide as
# finite elements, have K 4 to 6 % and W 1 to 10 % less than is expected
YIELDED_STIFFNESS = YIELDED_ENERGY = 0.1
DRAWS = 16
MOST_WIDE = 3.0  # in the logarithm of a radius
SHOWN = 0.8  # of a known noise: what shows so much of it may as well be all
TINY_M = 1e-30  # a length that is none


@dataclass(frozen=True, eq=False)
class MovedCaps:
    """Interacting caps, and what they could be as well, cause by cause, see `error_of_caps`.

    Curves as slip uses them, with the bulk sinking or without.
    """

    found: NormalCurve
    # Sets of caps: moved at random by one standard deviation; the last one as they are on profiles
    # as measured, which is half of an error at 95 %
    moved: NormalCurve
    by_pairs: NormalCurve  # with point loads alone between contacts: twice an error at 95 %
    by_level: NormalCurve | None  # levelled by the floor: the same; None where the face balances
    yielded: float = 0.0  # share of the load on caps that have
    whole: NormalCurve | None = None  # that of `found` with the bulk sinking
    # What profiles below contacts change of the `answers` beyond that: half of an error at 95 %
    by_profile: np.ndarray = field(default_factory=lambda: np.zeros(len(FORCE_SHARES) + 1))
    of_contact: float = 1.0  # share of the contact in the compliance, with the bulk that is kept
    law: LawError | None = None  # how caps that yielded unload otherwise; None: none has

    def of_profiles(self, share: float) -> tuple[float, float]:
        """Return relative errors of stiffness and energy at a share of mu N, at 95 %, by them."""
        *energies, stiffness = 2.0 * self.by_profile
        return float(stiffness), float(np.interp(share, FORCE_SHARES, energies))


@dataclass(frozen=True)
class CapsError:
    """The relative error of interacting caps at 95 %, by its causes; see `error_of_caps`."""

    doubt: str | None  # why it is not known
    of_caps: float = math.inf  # that of the caps themselves, and of the law between them
    of_levelling: float = 0.0
    moved: MovedCaps | None = None
    errors: ModelError | None = None  # the same by the force at which energies are compared
    without_noise: float = math.inf  # what would be left of it all on a map without noise

    @property
    def of_noise(self) -> float:
        """What the noise of the map makes of the error; 0 where nobody asked."""
        total = self.total or 0.0
        return math.sqrt(max(total**2 - self.without_noise**2, 0.0))

    @property
    def total(self) -> float | None:
        """None where it is not known."""
        return None if self.doubt is not None else math.hypot(self.of_caps, self.of_levelling)


def answers(
    curve: NormalCurve, holds_bulk: bool, surface: HeightMap, settings: Settings
) -> np.ndarray:
    """Return what the error counts in: the energies at four forces and the stiffness of slip.

    Parameters
    ----------
    curve : NormalCurve
        The whole normal curve of a model.
    holds_bulk : bool
        Whether it holds the bulk sinking of the half-space.
    surface : HeightMap
        The face.
    settings : Settings
        `material` and `contact`.
    """
    used = _as_slip_uses(curve, surface, settings) if holds_bulk else curve
    return answers_of(curve, used, settings)


def answers_of(
    curve: NormalCurve,
    used: NormalCurve,
    settings: Settings,
    shares: Sequence[float] = FORCE_SHARES,
) -> np.ndarray:
    """Return the `answers` of a curve, given the one that slip uses of it, too.

    Parameters
    ----------
    curve : NormalCurve
        The whole normal curve.
    used : NormalCurve
        The same with the bulk sinking, or without, as slip uses it.
    settings : Settings
        `material` and `contact`.
    shares : sequence of float, optional
        T / (mu N) at which the energies are asked, k of them.

    Returns
    -------
    float64, shape (k + 1, ...)
        The energies, and the stiffness of slip; with the sets of the curve behind.
    """
    material, preload_N = settings.material, settings.contact.preload_N
    joint = composite(material.youngs_modulus_Pa, material.poisson_ratio)
    slip = slip_curve(curve, preload_N, material.friction_coefficient, joint.kappa)
    force_N = np.array(shares) * slip.total_slip_force_N
    stiffness = used.stiffness_N_per_m(used.approach_m(preload_N))
    energy_J = slip.energy_at_force_J(force_N.reshape(-1, *np.ones(stiffness.ndim, dtype=int)))
    return np.concatenate((energy_J, stiffness[None]))


def _as_slip_uses(curve: NormalCurve, surface: HeightMap, settings: Settings) -> NormalCurve:
    """Return a curve that holds the bulk sinking with it or without, as the settings say."""
    if settings.contact.bulk:
        return curve
    material = settings.material
    E_star_Pa = composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa
    bulk_m_per_N = bulk_of_face_m_per_N(surface, E_star_Pa)
    return without_bulk(curve, bulk_m_per_N, settings.contact.preload_N)[0]


def error_of_caps(
    scene: Scene,
    curve: InteractingCurve,
    found: np.ndarray,
    label: np.ndarray | None,
    noise_m: float,
    settings: Settings,
) -> CapsError:
    """Estimate the error of interacting caps against the face itself.

    Parameters
    ----------
    scene : Scene
        With the caps that can touch in use.
    curve : InteractingCurve
        Of these caps.
    found : float64, shape (5,)
        Its `answers`.
    label : int, shape (ny, nx)
        The hills of the caps; 0 elsewhere. None where the caps are not those of one map: then
        nobody looks for what else touches.
    noise_m : float
        Standard deviation of the noise of the map.
    settings : Settings
        `conditioning`, `material` and `contact`.

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
    twice: on hills of r^1.6 to r^4 the true error was 0.4 to 1 times that. Noise makes a q as well,
    on the n points of a paraboloid, evenly spread over t, with a standard error of 6 sqrt(5 / n)
    times its own, as q / 6 is the coefficient of Legendre's second polynomial on 0 <= t <= 1. What
    it does to the fit is in the standard errors of the cap, so its square is taken off q^2.

    Random errors are twice the standard deviation over faces whose caps were moved at random:
    heights and radii by their standard errors, and by what is left of the profile. The lowest such
    term, 20 t^3 - 30 t^2 + 12 t - 1, has a height error of sqrt(7) / 7 = 0.38 of its root mean
    square. Known noise of which the hills show less is smooth on them: it moves an apex by itself,
    and the radius by its part of the fitted depth.

    Where the map is as smooth as one whose contacts a spline follows, what lies below the contacts
    is known as well as the map knows it, see `profiles`: the nearest spheres to that stand in for
    those of the quartic terms, and what it changes of the answers load by load counts where it is
    more, twice too, as it is the first order again.

    As levelled, the level is uncertain by the tilt between the plane taken off and that of the
    lowest third of the points, which peaks that are not balanced over the face do not pull; where
    caps of two faces are counted together, of the points of their sum. A
    balanced face has no such doubt: moved caps are balanced anew.

    Then there is the law between two contacts: half of what point loads alone would change. Where
    caps have yielded they unload as Hertz contacts, and metal otherwise, see `law_of_caps`. None of
    these causes has to do with another, so their squares add.

    Beyond the tolerance, caps are moved again by no more than what noise has not done: that alone
    pressing the map instead would mend, as its contacts average over no more points than fits do.

    The error is not known where something else than the caps carries: if contacts overlap, are
    wider than their hills, or if the plane reaches points outside the hills or far beside their
    contacts.
    """
    doubt = _doubt(scene, curve, label, noise_m)
    if doubt is not None:
        return CapsError(doubt)
    try:
        own_m, of_shape = _own_residual_m(scene, noise_m), _of_shape(scene, curve, noise_m)
        by_profile = np.zeros(len(found))
        if label is not None and (seen := profiles(scene, curve, FORCE_SHARES, noise_m)):
            both = zip((seen.up_m, seen.log_radius), of_shape, strict=True)
            up, wide = (np.where(np.isnan(one), other, one) for one, other in both)
            of_whole = curve.stiffness_N_per_m(curve.approach_m(scene.preload_N))
            answered = np.append(np.ones(len(FORCE_SHARES)), found[-1] / float(of_whole))
            of_shape, by_profile = (up, wide), seen.change * answered
        up_m, wide = _at_random(scene, own_m, shared_m=_shared_noise_m(scene, noise_m, settings))
        more = np.vstack((up_m, of_shape[0])), np.vstack((wide, of_shape[1]))
        curves: list[NormalCurve] = [
            moved_caps(scene, curve, *more, settings),
            replace(curve, near=None, _equilibrium={}),
        ]
        tilted = _of_level(scene, settings)
        curves += [] if tilted is None else [tilted]
        used, change = _used_and_changes(curves, scene, found, settings)
        change[1] *= PAIRS_SHARE
        *at_random, by_shape = change[0]
        at_random_rms = _rms(at_random)
        of_random = 2.0 * float(at_random_rms.max())
        of_shapes = np.maximum(np.abs(by_shape), np.abs(by_profile))
        each = (of_shapes, *change[1:], np.zeros(1))
        shape, pairs, level = (float(np.abs(one).max()) for one in each[:3])
        as_found = _as_slip_uses(curve, scene.surface, settings)
        of_contact = _of_contact(scene, curve, as_found)
        yielded, law = _of_yield(scene, curve, as_found)
        unloading = 0.0 if law is None else max(law.errors(one)[1] for one in FORCE_SHARES)
        besides = 2.0 * shape, pairs, unloading, LEAST_ERROR
        of_caps = without_noise = math.hypot(of_random, *besides)
        by_level = None if tilted is None else used[-1]
        beyond = np.sqrt(np.square(of_shapes) - np.square(by_shape))
        given = as_found, used[0], used[1], by_level, yielded, curve, beyond, of_contact, law
        moved = MovedCaps(*given)
        by_answer = np.vstack((2.0 * at_random_rms, 2.0 * of_shapes, *change[1:]))
        of_all = math.hypot(of_random, 2.0 * shape, pairs, LEAST_ERROR, level)
        errors = _by_share(np.linalg.norm(by_answer, axis=0), moved, of_all, law)
        if math.hypot(of_caps, level) > settings.contact.tolerance:
            own = _at_random(scene, own_m, _not_of_noise(scene, own_m, noise_m))
            left = moved_caps(scene, curve, *own, settings)
            own_change = _used_and_changes([left], scene, found, settings)[1][0]
            without_noise = math.hypot(2.0 * float(_rms(own_change).max()), *besides)
        return CapsError(None, of_caps, level, moved, errors, math.hypot(without_noise, level))
    except (ContactError, UnusableSurfaceError):
        return CapsError("caps that are moved within their errors have no solution")


def _of_contact(scene: Scene, curve: InteractingCurve, used: NormalCurve) -> float:
    """Return the share of the contacts in the compliance that slip uses, see `share_of_contact`."""
    kept_m_per_N = bulk_of_face_m_per_N(scene.surface, scene.E_star_Pa)
    kept_m_per_N += used.compliance_m_per_N - curve.compliance_m_per_N
    load_N = curve.asperity_loads_N(curve.approach_m(scene.preload_N))
    a_m = contact_radius_m(load_N, curve.radius_m, scene.E_star_Pa)
    own_N_per_m = 2.0 * scene.E_star_Pa * float(a_m.sum())
    return share_of_contact(used, kept_m_per_N, scene.preload_N, own_N_per_m)


def _rms(changes: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """Return the root mean square over the first axis."""
    return np.asarray(np.sqrt(np.mean(np.square(changes), axis=0)))


def _by_share(
    by_answer: np.ndarray, moved: MovedCaps, of_all: float, law: LawError | None
) -> ModelError:
    """Return the errors by share of mu N, of each the greatest from there on.

    `by_answer`, shape (5,), is what caps, pairs and levelling leave in each of the `answers`; the
    greatest of all stays what the causes together, each where it is worst, may do.
    """
    *energies, stiffness = np.hypot(by_answer, LEAST_ERROR).tolist()
    stiffness = math.hypot(stiffness, YIELDED_STIFFNESS * moved.of_contact * moved.yielded)
    greatest = [max(energies[i:]) for i in range(len(energies))]
    by_share = (*zip(FORCE_SHARES, greatest, strict=True), (1.0, greatest[-1]))
    return ModelError(stiffness, of_all, by_share, law=law)


def _doubt(
    scene: Scene, curve: InteractingCurve, label: np.ndarray | None, noise_m: float
) -> str | None:
    """Return why the error of interacting caps is not known, None where it is."""
    caps, use = scene.caps, scene.use
    approach_m = float(curve.approach_m(scene.preload_N))
    if curve.overlapping_pairs(approach_m):
        return "contacts run together"
    load_N = curve.asperity_loads_N(approach_m)
    a_m = contact_radius_m(load_N, curve.radius_m, scene.E_star_Pa)
    beyond = a_m > 0.5 * caps.diameter_m[use]
    if load_N[beyond].sum() > BEYOND_SHARE * load_N.sum():
        return "contacts are wider than the hills that the caps were fitted to"
    drawn = outlines(caps, use, load_N, a_m, scene.surface)
    if drawn.crossing_pairs:
        return "long contacts run together"
    if label is None:
        return None
    if drawn.beyond_share > CUT_SHARE:
        beyond = f"{drawn.beyond_share:.0%} of the contact would lie beyond the edge of the map"
        return f"{beyond}, or of the face on it" if scene.surface.ends_within else beyond
    top_m = float(caps.peak_height_m[use].max())
    face = scene.surface, label, curve, approach_m, top_m, noise_m
    if unmodelled_area_m2(*face, drawn.half_axis_m) > 0.0:
        return "parts of the face that are no hills, or lie on their flanks, would touch"
    return None


def _at_random(
    scene: Scene,
    own_m: np.ndarray,
    of_errors: np.ndarray | float = 1.0,
    shared_m: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much caps are higher and, in logarithms, wider at random within their errors.

    Shape (draws, n) each, over the caps in use, whose profiles leave `own_m` of their own; their
    standard errors count for a share, and noise that the points of a hill share in full.
    """
    caps, use = scene.caps, scene.use

    def used(values: np.ndarray) -> np.ndarray:
        return np.nan_to_num(values[use])  # a table that no fit made has no standard errors

    shape_m = np.hypot(SHAPE_SHARE * own_m, shared_m)
    depth_m = np.where(used(caps.fit_depth_m) > 0.0, caps.fit_depth_m[use], caps.cap_height_m[use])
    height_se_m, radius_se = (
        of_errors * used(caps.peak_height_se_m),
        of_errors * used(caps.radius_se_m) / caps.radius_m[use],
    )
    height_m = np.hypot(shape_m, height_se_m)
    radius_se = np.minimum(radius_se, MOST_WIDE)  # of a fit that says nothing the factor overflows
    ratio = np.hypot(radius_se, shape_m / np.maximum(depth_m, shape_m))
    ratio = np.hypot(ratio, _unseen_ellipse(caps)[use])
    both_m = used(caps.peak_radius_correlation) * height_se_m * radius_se
    with_height = np.divide(both_m, height_m, out=np.zeros_like(height_m), where=height_m > 0.0)
    alone = np.sqrt(np.maximum(ratio**2 - with_height**2, 0.0))
    draws = max(4, min(DRAWS, DRAWS * 100 // int(np.count_nonzero(use))))
    sign = np.random.default_rng(0).choice((-1.0, 1.0), (draws, 2, len(caps)))[..., use]
    return sign[:, 0] * height_m, sign[:, 0] * with_height + sign[:, 1] * alone


def _shared_noise_m(scene: Scene, noise_m: float, settings: Settings) -> float:
    """Return what of a known noise does not show on the hills: neighbours share it there."""
    known_m = known_noise_m(scene.surface, settings)
    if known_m is None or noise_m > SHOWN * known_m:
        return 0.0
    return math.sqrt(known_m**2 - noise_m**2)


def _own_residual_m(scene: Scene, noise_m: float) -> np.ndarray:
    """Return what of the rms rests of the profiles is the hills' own, not noise; shape (n,).

    The square of a rest of noise alone has the standard error sqrt(2 / n) of its own; what of it
    lies above sigma^2 by chance is told from hills that differ by what all of them show.
    """
    rest_m2 = np.nan_to_num(scene.caps.profile_residual_m[scene.use]) ** 2 - noise_m**2
    variance = 2.0 * noise_m**4 / _points(scene)
    known = np.isfinite(variance) & (variance > 0.0) & (rest_m2 > -(noise_m**2))
    if np.count_nonzero(known) > 1:
        least, found = float(variance[known].min()), rest_m2[known]
        weight = least / variance[known]
        mean = float(weight @ found / weight.sum())
        # Variance between hills, by moments (DerSimonian and Laird, Control. Clin. Trials 7 (1986))
        excess = float(weight @ (found - mean) ** 2) - (found.size - 1.0) * least
        between = max(excess, 0.0) / (weight.sum() - float(weight @ weight) / weight.sum())
        rest_m2[known] = mean + between / (between + variance[known]) * (found - mean)
    return np.sqrt(np.maximum(rest_m2, 0.0))


def _not_of_noise(scene: Scene, own_m: np.ndarray, noise_m: float) -> np.ndarray:
    """Return which share of the standard errors noise has not made, shape (n,).

    They grow with the scatter of the points, whosever it is, and noise misplaces no apex by more
    than itself. Those of tops that were put back have causes of their own.
    """
    noise_m = noise_m if scene.surface.tops is None else 0.0
    height_se_m = np.nan_to_num(scene.caps.peak_height_se_m[scene.use])
    most_m = np.maximum(np.hypot(own_m, noise_m), height_se_m)
    of_noise = noise_m / np.maximum(most_m, TINY_M)
    return np.asarray(np.sqrt(1.0 - of_noise**2))


def _points(scene: Scene) -> np.ndarray:
    """Return how many points the caps in use were fitted to, shape (n,)."""
    area_m2 = 2.0 * np.pi * scene.radius_m * scene.caps.fit_depth_m[scene.use]
    return np.asarray(area_m2 / scene.surface.pixel_area_m2)


def _unseen_ellipse(caps: CapTable) -> np.ndarray:
    """Return the logarithm by which radii may miss the factor of an ellipse.

    The fit leaves it out where the edge cuts a hill: nobody saw the ellipse whole. Of a ridge that
    is longer than any ellipse that is taken for one, it may be anything.
    """
    known = np.isfinite(caps.radius_major_m) & (caps.radius_minor_m > 0.0)
    flat_m, steep_m = (
        np.where(known, one_m, 1.0) for one_m in (caps.radius_major_m, caps.radius_minor_m)
    )
    ratio = np.where(known, flat_m / steep_m, LONGEST)
    ridge = ((caps.flags & CapFlag.ridge) != 0) & (ratio >= LONGEST)
    missed = np.log(elliptic_factor(np.clip(ratio, 1.0, LONGEST)))
    return np.where((known & ((caps.flags & CapFlag.edge) != 0)) | ridge, missed, 0.0)


def _of_shape(
    scene: Scene, curve: InteractingCurve, noise_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the same, shape (n,), for caps that follow the hills' profiles."""
    caps, use = scene.caps, scene.use
    load_N = curve.asperity_loads_N(curve.approach_m(scene.preload_N))
    depth_m, quartic_m = caps.fit_depth_m[use], caps.quartic_m[use]
    a_m = contact_radius_m(load_N, curve.radius_m, scene.E_star_Pa)
    share = a_m**2 / scene.radius_m / (2.0 * depth_m)
    quartic_m = quartic_m * _own_share(scene, quartic_m / depth_m, noise_m)
    known = np.isfinite(quartic_m * share)  # a table that no fit made has no profiles
    up_m = np.where(known, 8 / 15 * quartic_m * share**2, 0.0)
    # The first order would overflow far beyond the hill, which is doubted anyway
    first_order = (2 / 3 - 8 / 5 * share) * quartic_m / depth_m
    return up_m, np.where(known, np.clip(first_order, -MOST_WIDE, MOST_WIDE), 0.0)


def _own_share(scene: Scene, quartic: np.ndarray, noise_m: float) -> np.ndarray:
    """Return what of the quartic terms, over the fitted depths, is the hills' own; shape (n,)."""
    depth_m = scene.caps.fit_depth_m[scene.use]
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.square(QUARTIC_SE * noise_m / depth_m) / _points(scene)
        known = np.isfinite(quartic) & (variance > 0.0) & np.isfinite(variance)
        more = (np.square(quartic) / variance - 1.0)[known].sum() / (1.0 / variance[known]).sum()
        return np.where(known, max(more, 0.0) / (max(more, 0.0) + variance), 1.0)


def _of_yield(
    scene: Scene, curve: InteractingCurve, used: NormalCurve
) -> tuple[float, LawError | None]:
    """Return the share of the load on caps that have yielded, and what their unloading leaves."""
    if scene.law is None:
        return 0.0, None
    preload_N, E_star_Pa = scene.preload_N, scene.E_star_Pa
    load_N = curve.asperity_loads_N(curve.approach_m(preload_N))
    yielded = scene.law.yielded(load_N, scene.radius_m)
    most_Pa = np.cbrt(6.0 * load_N * (E_star_Pa / scene.radius_m) ** 2) / math.pi
    a_m = contact_radius_m(load_N, curve.radius_m, E_star_Pa)
    pair_per_m = E_star_Pa * curve.pair_compliance_m_per_N
    withdrawal_m = used.withdrawal_m(used.approach_m(preload_N), np.array(SHARES) * preload_N)
    contacts = most_Pa / scene.law.hardness_Pa, load_N, a_m, pair_per_m
    law = law_of_caps(*contacts, E_star_Pa * withdrawal_m)
    return float(load_N[yielded].sum() / load_N.sum()), law


def _of_level(scene: Scene, settings: Settings) -> NormalCurve | None:
    """Return the curve where the floor levels the face, None where its contacts do."""
    if settings.conditioning.form == "none" or settings.contact.alignment == "balanced":
        return None
    slope_y, slope_x = scene.surface.floor_slope or floor_slopes(scene.surface)
    caps = scene.caps
    peak_m = caps.peak_height_m - slope_y * caps.y_m - slope_x * caps.x_m
    tilted = caps.with_columns(peak_height_m=peak_m)
    face = scene.surface, scene.E_star_Pa, scene.preload_N, scene.law
    return reachable(tilted, *face).curve


def _used_and_changes(
    curves: list[NormalCurve], scene: Scene, found: np.ndarray, settings: Settings
) -> tuple[list[NormalCurve], list[np.ndarray]]:
    """Return what slip uses of curves with interaction, and their relative change of answers.

    Shape (5,), or (s, 5) of sets.
    """
    used = [_as_slip_uses(one, scene.surface, settings) for one in curves]
    pairs = zip(curves, used, strict=True)
    return used, [answers_of(*pair, settings).T / found - 1.0 for pair in pairs]
