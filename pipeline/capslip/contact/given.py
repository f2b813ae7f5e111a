"""Families that are given, not counted on a scan: the paper's m, n, R and h under a preload."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from capslip.caps.families import Families, Family
from capslip.contact.curve import NormalCurve
from capslip.contact.families_accuracy import error_of_families
from capslip.contact.flattening import flattened_families, top_m
from capslip.contact.joint import Joint
from capslip.contact.map_doubts import ASKED
from capslip.contact.material import composite, yield_law
from capslip.contact.models.families import RUNG, contacts_of_families, curve_of
from capslip.contact.press import ContactState, problems_of_closing, refuse_more_than_all
from capslip.contact.rung import Contacts, ModelError
from capslip.contact.solvers.hertz import HertzCurve, contact_radius_m
from capslip.contact.solvers.yielding import YieldLaw
from capslip.contact.steepness import problems_of_steep_caps
from capslip.errors import SettingsError
from capslip.problems import Effect, Problem
from capslip.settings import Settings
from capslip.units import off_by, percent, share_of


def given_families(settings: Settings) -> Families:
    """Return the families of the settings, G with its peaks at zero.

    Raises
    ------
    SettingsError
        If m or a radius is missing, or h where there are P-caps.
    """
    given = settings.families
    if given.m is None or given.radius_G_m is None:
        raise SettingsError(
            "families: expected at least families.m and families.radius_G_m (--m, --radius-G)"
        )
    G = _family(given.m, given.radius_G_m, 0.0)
    if not given.n:
        return Families(G, None, (G,), None, None, 0.0, alike=False)
    if given.radius_P_m is None or given.h_m is None:
        raise SettingsError(
            f"families.n: got {given.n} P-caps; expected families.radius_P_m and families.h_m with "
            "them (--radius-P, --h)"
        )
    P = _family(given.n, given.radius_P_m, -given.h_m)
    return Families(G, P, (G, P), None, None, 0.0, alike=False)


def press_families(families: Families, settings: Settings) -> tuple[Joint, ContactState]:
    """Press given families with the preload, or to the approach that is given in its place.

    They are the contacts of the whole joint; nothing is known of places or of a scanned area.

    Raises
    ------
    SettingsError
        If the settings ask for what needs a scan, as another contact model does, or leave the load
        open.
    ContactError
        If the families cannot carry the load, or touch on more than the area that was given.
    """
    material = settings.material
    joint = composite(material.youngs_modulus_Pa, material.poisson_ratio)
    law, curve = yield_law(material), curve_of(families, joint.E_star_Pa)
    if settings.families.approach_m is not None:
        if law is not None:
            raise SettingsError(
                "families.approach_m: got an approach of families that yield, which is that of no "
                "elastic curve; expected contact.preload_N"
            )
        preload_N = float(curve.load_N(settings.families.approach_m))
    else:
        preload_N = _preload_N(settings)
    _refuse_what_needs_a_scan(settings)
    flat = flattened_families(families, law, joint.E_star_Pa, preload_N)
    curve = curve_of(flat, joint.E_star_Pa)
    approach_m = float(curve.approach_m(preload_N))
    found = contacts_of_families(flat, curve, approach_m, joint.E_star_Pa)
    errors, problems = _beside_the_area(found, curve, preload_N, settings)
    if found.count == 1:
        problems.append(Problem("one_contact", "warning", "one cap carries the whole preload"))
    each_N = curve.asperity_loads_N(approach_m)
    problems += _of_P(families, found.family[each_N > 0.0], approach_m)
    pressure_Pa, yielded_m2, left_m = found.max_pressure_Pa, None, None
    if law is not None and pressure_Pa is not None:
        pressure_Pa = min(pressure_Pa, law.hardness_Pa)
        before_m = np.array([getattr(families, name).radius_m for name in found.family])
        a_m = contact_radius_m(each_N, curve.radius_m, joint.E_star_Pa)
        yielded_m2 = float((curve.count * np.pi * a_m**2)[curve.radius_m > before_m].sum())
        left_m = top_m(families) - top_m(flat)
        problems += problems_of_steep_caps(a_m, before_m, curve.count * each_N)
    state = ContactState(
        rung=RUNG,
        model_reason="the families were given",
        errors=errors,
        moved=None,
        preload_N=preload_N,
        approach_m=approach_m,
        bulk_m=0.0,
        bulk=False,
        contacts=found.count,
        overlapping_pairs=0,
        stiffness_N_per_m=float(curve.stiffness_N_per_m(approach_m)),
        contact_area_m2=found.area_m2,
        max_pressure_Pa=pressure_Pa,
        use=np.zeros(0, dtype=bool),
        row_family=found.family,
        normal=curve,
        curve=curve,
        composite=joint,
        load_point_m=(math.nan, math.nan),
        eccentricity_m=None,
        tilt_rad=(0.0, 0.0),
        problems=tuple(problems),
        hardness_Pa=None if law is None else law.hardness_Pa,
        yielded_area_m2=yielded_m2,
        left_m=left_m,
        first=None if law is None else partial(_loaded_first, families, law, joint.E_star_Pa),
    )
    whole = (np.array([preload_N]), np.ones(1), preload_N)
    return Joint(settings.joint.area_m2, None, preload_N, *whole), state


def _preload_N(settings: Settings) -> float:
    """Return the preload of the joint, or what its nominal pressure makes on its area."""
    contact, area_m2 = settings.contact, settings.joint.area_m2
    if contact.nominal_pressure_Pa is None:
        return contact.preload_N
    if area_m2 is None:
        raise SettingsError(
            "contact.nominal_pressure_Pa: got a pressure on families without an area; expected "
            "joint.area_m2 with it"
        )
    return contact.nominal_pressure_Pa * area_m2


def _beside_the_area(
    found: Contacts, curve: HertzCurve, preload_N: float, settings: Settings
) -> tuple[ModelError | None, list[Problem]]:
    """Return what the families leave out, and whether the joint closes, where its area is known.

    Contacts of more than the area are refused.
    """
    area_m2 = settings.joint.area_m2
    if area_m2 is None:
        return None, []
    expected = f"on a joint of {area_m2:.3g} m2; expected less; check --area, preload and units"
    refuse_more_than_all(RUNG, preload_N, found, area_m2, expected)
    errors = error_of_families(curve, area_m2, preload_N, settings)
    return errors, problems_of_closing(found, area_m2) + _of_error(errors, settings)


def _of_error(errors: ModelError | None, settings: Settings) -> list[Problem]:
    if errors is None or errors.greatest_at(ASKED) <= settings.contact.tolerance:
        return []
    energy = errors.energy_at(ASKED)
    turn = "" if settings.contact.alignment == "as_levelled" else " and turn the face"
    message = (
        f"caps at random places on the area of the joint, which push each other apart{turn}, move "
        f"the stiffness by up to {off_by(errors.stiffness)} and the energy by up to "
        f"{off_by(energy)} from {percent(ASKED)} of gross slip on: families know no places"
    )
    moved = Effect(share_of(errors.stiffness), share_of(energy), share_of(energy))
    step = "capslip analyze a scan of the face, which shows where its caps stand"
    return [Problem("model_doubtful", "warning", message, moved, step)]


def _of_P(families: Families, touching: np.ndarray, approach_m: float) -> list[Problem]:
    """Return whether P-caps were given that touch nothing, as where h is in another unit."""
    if families.P is None or "P" in touching:
        return []
    message = (
        f"no P-cap touches under this preload: they lie {-families.P.peak_height_m:.3g} m below "
        f"the G-caps, and the faces approach by {approach_m:.3g} m"
    )
    return [Problem("P_not_in_contact", "info", message)]


def _refuse_what_needs_a_scan(settings: Settings) -> None:
    if settings.contact.model not in ("auto", RUNG.name):
        raise SettingsError(
            f"contact.model: got {settings.contact.model} for families; expected {RUNG.name} or "
            "auto: analyse a scan with another model"
        )
    if settings.joint.pressure_map is not None:
        raise SettingsError("joint.pressure_map: it needs a scan; expected joint.area_m2")
    if settings.contact.bulk:
        raise SettingsError(
            "contact.bulk: got true for families; expected false: what the half-space sinks by "
            "depends on the size of a scan"
        )


def _loaded_first(
    families: Families, law: YieldLaw, E_star_Pa: float, load_N: float, hardness_factor: float
) -> NormalCurve:
    """Return the curve of families that were loaded to another load, see `flattening`."""
    law = replace(law, hardness_Pa=law.hardness_Pa * hardness_factor)
    return curve_of(flattened_families(families, law, E_star_Pa, load_N), E_star_Pa)


def _family(count: int, radius_m: float, peak_height_m: float) -> Family:
    unknown = math.nan, math.nan  # diameter and height: of a cut, and there is none
    return Family(count, radius_m, radius_m, *unknown, peak_height_m, None, None)
