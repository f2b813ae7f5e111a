"""What makes the contact under the preload doubtful, and what of the material it leaves out."""

import math
from typing import Any

import numpy as np

from capslip.caps.families import Families
from capslip.caps.hidden import hidden_tops
from capslip.caps.table import DOUBTFUL, CapTable
from capslip.contact.accuracy import BEYOND_SHARE
from capslip.contact.joint import BEYOND_JOINTS_PA, Joint, is_loaded
from capslip.contact.material import dundurs_beta
from capslip.contact.part_of_joint import Moved, few_contacts, left_open, long_waves
from capslip.contact.press import ContactState
from capslip.contact.solvers.hertz import coefficient_of
from capslip.contact.solvers.yielding import HARDNESS_PER_YIELD
from capslip.contact.steepness import problems_of_steep_caps
from capslip.materials import MATERIALS
from capslip.problems import Effect, Problem
from capslip.settings import Conditioning, Material, Settings
from capslip.surface.heightmap import HeightMap
from capslip.surface.spectrum import carried_waves_m
from capslip.surface.tops import floor_points
from capslip.units import percent

MIN_PIXELS_ACROSS = 4.0  # of the contacts that carry the lighter half of the load
COUPLED = 0.25  # of the friction that pressure alone uses up: |beta| / mu
LARGE_FRICTION = 1.5
FIRST_SHARE, FIRST_TOUCH = 0.01, 0.25  # of the load, and of the approach up to there
LARGER = 1.01  # coverage from which a scan is larger than its joint: more than rounding
FEW_IN_SCAN = 25  # contacts of a scan that stands for a larger joint: W some 26 % off by chance
FLOOR_SHARE = 0.005  # of the load: 6 % of it there made W(0.1 mu N) 2.2 times as large
LONG_WAVES = 0.1  # of the approach: rms of waves that leave the loss by patches over 10 % too low
ELASTIC_STRAIN = 0.03  # of E*: the greatest pressure at which the hardest steels stay elastic
LEAST_YIELDED = 0.005  # of the contact area: less is no whole percent
TWO_SIDED = 2.0  # standard errors that a height may be off by
HIDDEN_LOAD = 0.01  # of the load: hills that would carry less are not noted
FIRST_YIELD = 1.6  # greatest pressure of a Hertz contact over the yield stress, where it yields


def material_doubts(material: Material) -> list[Problem]:
    """Return what in the material is hardly meant, or beyond what the slip curve describes."""
    found: list[Problem] = []
    beta = dundurs_beta(material.youngs_modulus_Pa, material.poisson_ratio)
    used = abs(beta) / material.friction_coefficient
    if used > COUPLED:
        message = (
            f"Dundurs' beta of the two materials is {beta:.2g}: pressure alone shears such "
            f"contacts, by about {used:.0%} of their friction, which the slip curve leaves out "
            "(exact only at beta = 0, equal materials)"
        )
        found.append(Problem("materials_coupled", "warning", message))
    if material.friction_coefficient > LARGE_FRICTION:
        message = (
            f"material.friction_coefficient is {material.friction_coefficient:g}; dry engineering "
            f"faces have 0.05 to {LARGE_FRICTION:g}"
        )
        found.append(Problem("friction_suspect", "warning", message))
    return found


def problems_of_preload(joint: Joint, settings: Settings) -> list[Problem]:
    """Return whether a load that nobody gave presses the joint as none is pressed.

    A field of view of a millimetre under a load that would suit a whole face: none of the numbers
    is that of a joint.
    """
    pressure_Pa = joint.nominal_pressure_Pa
    if is_loaded(settings) or pressure_Pa is None or pressure_Pa <= BEYOND_JOINTS_PA:
        return []
    of = "scan" if joint.is_scan else "joint"
    message = (
        f"nobody gave the load: the {joint.preload_N:g} N of the demonstration on the "
        f"{joint.area_m2:.3g} m2 of the {of} are {pressure_Pa:.3g} Pa, more than the "
        f"{BEYOND_JOINTS_PA:.2g} Pa that faces of joints bear; a scan is a part of its joint, and "
        "carries its share of the load alone"
    )
    return [Problem("preload_of_demonstration", "warning", message)]


def problems_of_share(joint: Joint, contact: ContactState) -> list[Problem]:
    """Return whether a scan is as large as its joint at most, and holds enough contacts for it.

    Each part of a face touches with its own highest hills, and the fewer these are, the more the
    whole loses beside its parts (`docs/theory.md`, section 6).
    """
    found: list[Problem] = []
    if joint.coverage is not None and joint.coverage > LARGER:
        message = (
            f"the scan is {joint.coverage:.3g} times as large as its joint, which is a part of it "
            "then: the unit of the area, or the pixel size, may be wrong"
        )
        found.append(Problem("scan_larger_than_joint", "warning", message))
    few, left = few_contacts(joint, contact), left_open(joint, contact)
    if few is None or left is None or few <= 1.0 / math.sqrt(FEW_IN_SCAN):
        return found
    with_few, light = f"{contact.contacts} {contact.rung.contact_name}", contact.light
    if light is not None:
        with_few += f", with {light.contacts} under {light.preload_N:.3g} N on the scan"
    message = (
        f"the scan is {percent(left.coverage)} of its joint and touches with {with_few}: which "
        f"these are is chance, and moves the energy by some {left.energy_by_chance:.0%}"
    )
    if left.by_choice.energy > 0.0:
        message += (
            f"; beside a joint of such patches the face in one piece {_as_it_is(left.by_choice)}"
        )
    by_chance = Moved(left.stiffness_by_chance, left.energy_by_chance)
    moved = _effect(*(max(pair) for pair in zip(left.by_choice, by_chance, strict=True)))
    return [*found, Problem("few_contacts_in_scan", "warning", message, moved)]


def problems_of_waves(joint: Joint, contact: ContactState) -> list[Problem]:
    """Return whether a scan that stands for a larger joint shows waves that it does not hold.

    Of a wave longer than itself a scan shows a bow; where that is as much as a tenth of the
    approach, the crests of the face carry more than a joint of equal patches knows
    (`docs/theory.md`, section 6).
    """
    share, left = long_waves(joint, contact), left_open(joint, contact)
    if share is None or left is None or share <= LONG_WAVES:
        return []
    high = f"{share:.0f} times" if share >= 10.0 else f"{share:.0%} of"
    message = (
        f"the scan is {percent(left.coverage)} of its joint, and waves of its length and longer "
        f"stand {joint.long_waves_m:.2g} m (rms) out of its spectrum, {high} the approach: the "
        "face seems to go on in longer and higher ones, which patches of equal pressure leave out; "
        f"with them it {_as_it_is(left.by_waves)}"
    )
    return [Problem("waves_longer_than_scan", "warning", message, _effect(*left.by_waves))]


def _as_it_is(moved: Moved) -> str:
    """Say how a face is beside a joint of patches like its scan."""
    times = math.exp(moved.energy)
    return (
        f"is about {-math.expm1(-moved.stiffness):.0%} less stiff and loses some {times:.2g} times "
        "as much"
    )


def _effect(stiffness: float, energy: float) -> Effect:
    """Return what a joint that is so much softer, and loses so much more, is off by."""
    return Effect(-math.expm1(-stiffness), math.expm1(energy), math.expm1(energy - stiffness))


def contact_doubts(
    contact: ContactState,
    caps: CapTable,
    families: Families,
    pixel_area_m2: float,
    cut_certified: bool,
) -> list[Problem]:
    """Return what makes the contact doubtful.

    Parameters
    ----------
    contact : ContactState
        The face under its preload.
    caps : CapTable
        With the loads and contact radii of that state; NaN for a model without caps.
    families : Families
        Their families.
    pixel_area_m2 : float
        Of the map that the caps were fitted to.
    cut_certified : bool
        Whether nothing below the cut is known to touch.
    """
    return [
        *_which_caps_touch(contact, caps, families),
        *_beyond_the_caps(contact, caps, cut_certified),
        *_under_resolved(caps, pixel_area_m2),
        *_on_flagged_caps(caps),
        *_steep(contact, caps),
        *problems_of_pressure(contact),
    ]


def _loads_N(caps: CapTable) -> np.ndarray:
    return np.where(caps.load_N > 0, caps.load_N, 0.0)


def _which_caps_touch(contact: ContactState, caps: CapTable, families: Families) -> list[Problem]:
    found: list[Problem] = []
    loaded = caps.load_N > 0
    if contact.contacts == 1 and loaded.any():
        found.append(Problem("one_contact", "warning", "one cap carries the whole preload"))
    if families.P is not None and loaded.any() and not loaded[caps.family == "P"].any():
        message = "no P-cap touches under this preload"
        found.append(Problem("P_not_in_contact", "info", message))
    return found


def _beyond_the_caps(contact: ContactState, caps: CapTable, cut_certified: bool) -> list[Problem]:
    """Return whether contacts overlap, or leave the part of a hill that its cap describes."""
    found: list[Problem] = []
    if contact.overlapping_pairs:
        message = (
            f"{contact.overlapping_pairs} pairs of contacts overlap: the caps do not hold at this "
            "preload"
        )
        found.append(Problem("contacts_merge", "warning", message))
    load_N = _loads_N(caps)
    loaded = load_N > 0
    if not loaded.any():
        return found
    beyond = loaded & (caps.contact_radius_m > 0.5 * caps.diameter_m)
    if beyond.any():
        much = load_N[beyond].sum() > BEYOND_SHARE * load_N.sum()
        message = f"{int(beyond.sum())} contacts are wider than the hill that the cap was fitted to"
        found.append(Problem("contact_beyond_cap", "warning" if much else "info", message))
    depth_m = 0.5 * caps.contact_radius_m**2 / caps.radius_m
    deep = loaded & (depth_m > 1.001 * caps.cap_height_m)  # no fit goes below the cut
    low = loaded & (caps.cap_height_m < 0.1 * np.nanmax(caps.cap_height_m))
    if not cut_certified and (load_N[deep].sum() > 0.05 * load_N.sum() or low.any()):
        message = (
            "the contact reaches down to the cut: hills below it may touch too, and caps are "
            "fitted too shallow; raise hills.material_ratio"
        )
        found.append(Problem("contact_reaches_below_cut", "warning", message))
    return found


def problems_of_band(
    caps: CapTable, surface: HeightMap, noise_m: float, filters: Conditioning
) -> list[Problem]:
    """Return whether half of the load rests on contacts narrower than any wave the map carries.

    Where the pixel is what limits the waves, that is said of the contacts' pixels.

    Parameters
    ----------
    caps : CapTable
        With loads and contact radii.
    surface : HeightMap
        The conditioned map.
    noise_m : float
        Standard deviation of its point-to-point noise.
    filters : Conditioning
        What was filtered off.
    """
    diameter_m = caps.contact_diameter_m
    if diameter_m is None:
        return []
    nesting_m = filters.s_filter_nesting_index_m
    shortest_m = carried_waves_m(surface, noise_m, nesting_m, enough_m=diameter_m)[0]
    if diameter_m >= shortest_m or shortest_m <= 2.0 * max(surface.pixel_size_m):
        return []
    why = f"shorter waves drown in its noise of {noise_m:.2g} m a point"
    if nesting_m is not None and shortest_m == nesting_m:
        why = "shorter ones were filtered off"
    message = (
        f"half of the load rests on contacts of at most {diameter_m:.3g} m across; the shortest "
        f"wave that the map carries is {shortest_m:.3g} m: {why}"
    )
    return [Problem("contacts_outside_band", "info", message)]


def _under_resolved(caps: CapTable, pixel_area_m2: float) -> list[Problem]:
    diameter_m = caps.contact_diameter_m
    if diameter_m is None:
        return []
    across = diameter_m / math.sqrt(pixel_area_m2)
    if across >= MIN_PIXELS_ACROSS:
        return []
    message = (
        f"half of the load rests on contacts of at most {across:.2g} pixels across: a "
        "dozen points or fewer; check units, or use a finer scan"
    )
    return [Problem("contact_under_resolved", "warning", message)]


def problems_of_first_touch(contact: ContactState) -> list[Problem]:
    """Return whether the approach is that of the highest points, which hardly carry.

    A Hertz contact bears the first hundredth of its load within a twentieth of its approach.
    """
    if contact.yielded_area_m2 or contact.rung.made_from == "nothing":
        return []  # unloading begins from contacts that were pressed flat
    curve, load_N = contact.normal, FIRST_SHARE * contact.preload_N
    bulk_m_per_N, approach_m = contact.bulk_m / contact.preload_N, contact.approach_m
    solved = contact.rung.solved_loads_N
    if solved is None:
        first_m = float(curve.approach_m(load_N))
    else:  # by the loads that are known, between which a power law holds
        loads_N = solved(curve, contact.preload_N)[1:]
        if loads_N.size == 0 or loads_N[0] > load_N:
            return []
        at_m = [float(curve.approach_m(one)) for one in loads_N]
        first_m = float(np.exp(np.interp(math.log(load_N), np.log(loads_N), np.log(at_m))))
    share = (first_m - bulk_m_per_N * load_N) / (approach_m - contact.bulk_m)
    if not FIRST_TOUCH < share < 1.0:
        return []
    message = (
        f"{share:.0%} of the approach of {approach_m:.3g} m is passed before {FIRST_SHARE:.0%} of "
        "the preload is carried: it counts from the highest points, grains and spikes among them; "
        "stiffness and energy do not"
    )
    return [Problem("first_touch_decides", "info", message)]


def problems_of_floor(
    contact: ContactState, scan: HeightMap, mate: HeightMap | None = None
) -> list[Problem]:
    """Return whether load rests where a sensor ended below, and the face may lie deeper.

    Caps of one face do not read what lies so deep. Where heights of two faces were added, peaks of
    one may stand over the floor of the other, so much of which bears as there is of it at most.
    """
    shares = []
    if mate is not None:
        floors = [(one, floor_points(one)) for one in (scan, mate)]
        shares = [(at, at.size / one.n_measured) for one, at in floors if at is not None]
    elif contact.rung.made_from == "map":
        curve: Any = contact.normal
        pressure_Pa = curve.pressed(contact.preload_N).pressure_Pa
        # On another grid than the scan's nobody can tell
        at = floor_points(scan) if pressure_Pa.shape == scan.shape else None
        if at is not None:
            shares = [(at, float(pressure_Pa.ravel()[at].sum() / pressure_Pa.sum()))]
    which = "up to " if mate is not None else ""
    return [
        Problem(
            "load_on_floor",
            "warning",
            f"{at.size} points share the least height, below which the sensor may have ended: "
            f"{which}{percent(share)} of the preload rests there, where the face may lie deeper",
        )
        for at, share in shares
        if share > FLOOR_SHARE
    ]


def _on_flagged_caps(caps: CapTable) -> list[Problem]:
    load_N = _loads_N(caps)
    share = load_N[(caps.flags & DOUBTFUL) != 0].sum() / max(load_N.sum(), 1e-300)
    if share <= 0.2:
        return []
    which = {flag: load_N[(caps.flags & flag) != 0].sum() > 0.0 for flag in DOUBTFUL}
    names = ", ".join(str(flag.name) for flag, loaded in which.items() if loaded)
    message = f"{share:.0%} of the preload rests on flagged caps ({names})"
    return [Problem("load_on_doubtful_caps", "warning", message)]


def problems_of_hidden_tops(
    contact: ContactState, caps: CapTable, surface: HeightMap
) -> list[Problem]:
    """Return whether tops that would touch lie in holes of the map, by the flanks around them.

    Parameters
    ----------
    contact : ContactState
        The face under its preload.
    caps : CapTable
        At their heights over the face as it was pressed.
    surface : HeightMap
        That face.
    """
    if contact.rung.made_from == "nothing" or not caps.usable.any():
        return []
    tops = hidden_tops(surface)
    approach_m = contact.approach_without_bulk_m or contact.approach_m
    plane_m = float(caps.peak_height_m[caps.usable].max()) - approach_m
    up_m = np.maximum(tops.height_m + TWO_SIDED * tops.height_se_m - plane_m, 0.0)
    load_N = float(coefficient_of(tops.radius_m, contact.composite.E_star_Pa) @ up_m**1.5)
    if load_N <= HIDDEN_LOAD * contact.preload_N:
        return []
    message = (
        f"holes of the map took the tops of hills ({int(np.count_nonzero(up_m))}): by their flanks "
        f"these stand up to {up_m.max():.2g} m above the plane that the contact reaches, and carry "
        "load"
    )
    return [Problem("tops_in_holes", "warning", message)]


def _steep(contact: ContactState, caps: CapTable) -> list[Problem]:
    if contact.hardness_Pa is None:
        return []
    return problems_of_steep_caps(caps.contact_radius_m, caps.radius_m, _loads_N(caps))


def problems_of_pressure(contact: ContactState) -> list[Problem]:
    """Return how much has yielded or, where nothing was said of that, what would have."""
    pressure_Pa, hardness_Pa = contact.max_pressure_Pa, contact.hardness_Pa
    if pressure_Pa is None:
        return []
    if hardness_Pa is not None:
        if contact.yielded_share == 0.0:
            return []
        share = contact.yielded_share
        most = f"{share:.0%}" if share >= LEAST_YIELDED else f"less than {percent(LEAST_YIELDED)}"
        message = (
            f"{most} of the contact area has yielded at a hardness of "
            f"{hardness_Pa / 1e9:.3g} GPa; slip follows the curve along which the face unloads"
        )
        return [Problem("yielded", "info", message)]
    soft, E_star_Pa = MATERIALS["steel"], contact.composite.E_star_Pa
    if pressure_Pa > ELASTIC_STRAIN * E_star_Pa:
        message = (
            f"the greatest contact pressure {pressure_Pa:.3g} Pa is more than {ELASTIC_STRAIN:.0%} "
            f"of the modulus E* of {E_star_Pa:.3g} Pa, which no engineering metal bears: without a "
            "hardness stiffness and energy are those of an elastic face, as no metal is, and not "
            "to be used"
        )
        return [Problem("pressure_beyond_elastic", "error", message)]
    if pressure_Pa > FIRST_YIELD * soft.softest_yield_stress_Pa:
        message = (
            f"the greatest contact pressure {pressure_Pa / 1e6:.4g} MPa is more than the "
            f"{FIRST_YIELD * soft.softest_yield_stress_Pa / 1e6:.4g} MPa that a soft structural "
            f"steel bears elastically, {FIRST_YIELD:g} times its yield stress"
        )
        # A face that bears its hardness at most has as many times the area at most
        off = pressure_Pa / (HARDNESS_PER_YIELD * soft.softest_yield_stress_Pa) - 1.0
        if off <= 0.0:
            return [Problem("pressure_beyond_elastic", "warning", message)]
        message += f": as soft a face moves the stiffness by up to {off:.0%}, the energy as well"
        return [Problem("pressure_beyond_elastic", "warning", message, Effect(off, off, off))]
    return []
