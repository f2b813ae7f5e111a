"""What makes the numbers of an analysis doubtful, collected in the order of the stages."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from capslip.caps.doubts import leaves_peaks, plane_of, problems_of_bow, problems_of_families
from capslip.contact.bulk import problems_of_outline
from capslip.contact.doubts import (
    contact_doubts,
    material_doubts,
    problems_of_band,
    problems_of_first_touch,
    problems_of_floor,
    problems_of_hidden_tops,
    problems_of_preload,
    problems_of_share,
    problems_of_waves,
)
from capslip.contact.effects import with_effects
from capslip.contact.map_doubts import ASKED, BLUR, BLURRED
from capslip.contact.plastic_law import with_law
from capslip.contact.press import ContactState
from capslip.contact.relevance import as_read, still_doubtful
from capslip.contact.rung import resolved_share
from capslip.contact.slip import SlipCurve
from capslip.contact.solvers.unloading import SMALL_SLIP, UNRESOLVED
from capslip.contact.steepness import problems_of_steep_map
from capslip.next_steps import with_next_steps
from capslip.pressing import as_found
from capslip.problems import Effect, Problem, Severity
from capslip.result import Analysis
from capslip.setting_errors import changed
from capslip.settings import Settings
from capslip.stages import Face
from capslip.structure.answer import Answer
from capslip.structure.doubts import problems_of_structure
from capslip.surface.blocks import coarse_map, coarse_step
from capslip.surface.conditioning import Conditioned
from capslip.surface.doubts import (
    problems_of_points,
    problems_of_ripple,
    problems_of_scan,
    problems_of_seams,
    problems_of_tilt,
)
from capslip.surface.flatness import (
    BOWS,
    degree_taken_off,
    error_of_form_m,
    known_flatness_m,
    problems_of_fit,
    problems_of_flatness,
    problems_of_form,
    problems_of_scans,
)
from capslip.surface.heightmap import HeightMap, Statement
from capslip.surface.holes import problems_of_filling
from capslip.surface.resampling import problems_of_fewer_points
from capslip.surface.taken_form import problems_of_taken_form
from capslip.surface.waves import problems_of_filters
from capslip.units import off_by, percent, share_of

# Of what lies where nothing was measured, and of that alone
OF_VOIDS = ("hole_may_hide_hills", "outline_assumed", "contact_at_hole", "tops_in_holes")
# What only a scan reads
OF_A_SCAN = (
    *("reading", "instrument", "conditioning", "mating", "hills", "caps", "families.count"),
    *("families.feature", "contact.alignment", "contact.load_point_m", "run.sensitivity"),
    *("contact.alignment_stiffness_Nm_per_rad", "joint.non_measured"),
    *("contact.time_limit_s", "contact.solver_tolerance"),
)
FITS = ("conditioning.form_robust", "conditioning.form_floor")  # of a form
# What messages compare with; of a face that yielded it is what that recovers
APPROACH, RECOVERY = re.compile(r"\bthe approach(?= is |:)"), "the recovery on unloading"
SMALL = "small_slip_extrapolated"


def problems_of(face: Face, found: Analysis, mate: HeightMap | None) -> tuple[Problem, ...]:
    """Return what makes scans, settings, face, contact and answer doubtful, in this order.

    Parameters
    ----------
    face : Face
        The face that was analysed.
    found : Analysis
        What its stages found, with the problems of damping and answer alone.
    mate : HeightMap or None
        The other face, as measured.
    """
    before, contact = _before_contact(face, found, mate), found.contact
    if contact is None:  # without a single cap nothing was pressed: there is no answer
        before = [
            replace(one, severity="error") if one.code == "no_caps" else one for one in before
        ]
        problems = [*_less_voids(before, face, found.settings), *found.problems]
        return with_next_steps(problems, face.joint, found.settings, pressed=None)
    contact = replace(contact, problems=tuple(as_asked(contact.problems, found)))
    settings, surface = found.settings, face.conditioned.surface
    tolerance = settings.contact.tolerance
    doubtful = still_doubtful(found.caps, contact, surface, tolerance)
    certified = face.level is not None and face.level.missed_area_m2 == 0.0
    given = (contact, doubtful, face.families, surface.pixel_area_m2)
    under_load = contact_doubts(*given, cut_certified=certified)
    problems = [
        *as_read(before, contact, doubtful, tolerance, surface),
        *contact.problems,
        *problems_of_share(face.joint, contact),
        *problems_of_waves(face.joint, contact),
        *problems_of_first_touch(contact),
        *problems_of_filling(surface, contact.approach_m),
        *_of_hidden_tops(face, contact),
        *_of_outline(face),
        *problems_of_steep_map(contact, surface),
        *_of_levelling(face, contact, settings),
        *_of_ripple(contact, surface),
        *problems_of_filters(
            surface,
            face.conditioned.unfiltered_as_turned(),
            face.conditioned.with_short_waves_as_turned(),
            contact.approach_m,
        ),
        *problems_of_taken_form(
            surface, face.conditioned.with_form_as_turned(), contact.approach_m, settings
        ),
        *_of_fewer_points(contact, face.conditioned),
        *_of_optics(contact, settings),
        *_of_floor(contact, found.surface, mate, settings),
        *problems_of_band(found.caps, surface, face.hills.noise_m, settings.conditioning),
        *as_read(under_load, contact, doubtful, tolerance, surface),
        *found.problems,
    ]
    of_force = _of_small_slip(contact, found.answer, found.slip, tolerance)
    problems = [*(_less_note(problems) if of_force else problems), *of_force]
    caps = face.caps.with_columns(flags=doubtful.flags, contact_radius_m=doubtful.contact_radius_m)
    pressed = (caps, face.family_caps, face.conditioned, as_found(face, settings))
    problems = _naming_recovery(problems, contact)
    problems = _with_what_law_moves(_less_voids(problems, face, settings), found)
    problems = with_effects(problems, *pressed, contact, _share_asked(found))
    problems += _of_second_face(face, contact, settings)
    return with_next_steps(problems, face.joint, settings, pressed=contact.rung)


def problems_of_settings(settings: Settings, scanned: bool, mated: bool) -> list[Problem]:
    """Return which settings were given that nothing reads: someone expects them to do something.

    Parameters
    ----------
    settings : Settings
    scanned : bool
        Whether there is a scan; else families are given.
    mated : bool
        Whether there is a second face.
    """
    idle: list[tuple[Severity, list[str], str]] = []
    if not scanned:
        idle += [("info", changed(settings, OF_A_SCAN), "families are given, and no scan")]
    elif not mated:
        why = "there is no second face (--mate)"
        idle += [("warning", changed(settings, ["mating"]), why)]
        if settings.conditioning.form == "none":  # of a sum these fit the plane that is taken off
            why = "no form is taken off (conditioning.form = none)"
            idle += [("warning", changed(settings, FITS), why)]
    if scanned and settings.contact.alignment == "as_levelled":
        why = (
            "nothing turns about it (contact.alignment = as_levelled), and K and W do not depend "
            "on it; only how far off the resultant lies counts from there"
        )
        idle += [("warning", changed(settings, ["contact.load_point_m"]), why)]
    if settings.slip.normal_amplitude_ratio == 0.0:
        why = "the normal load is constant (slip.normal_amplitude_ratio = 0)"
        idle += [("warning", changed(settings, ["slip.normal_phase_rad"]), why)]
    return [
        Problem(
            "settings_ignored",
            severity,
            f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} not used: {why}",
        )
        for severity, names, why in idle
        if names
    ]


def as_asked(problems: Sequence[Problem], found: Analysis) -> list[Problem]:
    """Return the problems, those of a pressed map as they are at the force that is asked for.

    They were found at a quarter of mu N, and stay so where less is asked: `_of_small_slip` says
    what is left there. What is noted of small slip is noted once.
    """
    return _noted_once(_at_share_asked(problems, found))


def _noted_once(problems: list[Problem]) -> list[Problem]:
    """Return the problems with one note on small slip: where pixels end, and what they leave."""
    notes = [one for one in problems if (one.code, one.severity) == (SMALL, "info")]
    if len(notes) < 2:
        return problems
    message = "; ".join(dict.fromkeys(one.message for one in notes))
    effect = next((one.effect for one in notes if one.effect is not None), None)
    place = problems.index(notes[0])
    others = [one for one in problems[place:] if one not in notes]
    return [*problems[:place], replace(notes[0], message=message, effect=effect), *others]


def _at_share_asked(problems: Sequence[Problem], found: Analysis) -> list[Problem]:
    """Return the problems of a pressed map as they are at the force that is asked for."""
    errors, share = None if found.contact is None else found.contact.errors, _share_asked(found)
    if errors is None or errors.doubts_at is None or share <= ASKED:
        return list(problems)
    known, at_share = errors.doubts_at(ASKED), errors.doubts_at(share)
    if not any(one in known for one in problems):  # caps answer, or it was said of a patch
        return list(problems)
    place = next(i for i, one in enumerate(problems) if one in known)
    others = [one for one in problems if one not in known]
    return [*others[:place], *at_share, *others[place:]]


def _with_what_law_moves(problems: Sequence[Problem], found: Analysis) -> list[Problem]:
    """Return the problems, with what the plastic law moves at the force that is asked for."""
    errors = None if found.contact is None else found.contact.errors
    law, tolerance = None if errors is None else errors.law, found.settings.contact.tolerance
    return with_law(list(problems), law, _share_asked(found) or ASKED, tolerance)


def _share_asked(found: Analysis) -> float:
    """Return the force that is answered over that of gross slip, where there is one."""
    if found.answer is None or found.slip is None:
        return ASKED
    return found.answer.slip_force_N / float(found.slip.total_slip_force_N)


def _naming_recovery(problems: list[Problem], contact: ContactState) -> list[Problem]:
    """Return the problems of a face that yielded with its recovery named as such.

    The approach of the first loading, which terminal and report give beside it, is far greater.
    """
    if contact.first_loading_approach_m == contact.approach_m:
        return problems
    return [replace(one, message=APPROACH.sub(RECOVERY, one.message)) for one in problems]


def _less_voids(problems: list[Problem], face: Face, settings: Settings) -> list[Problem]:
    """Return the problems without those of holes and outline where no material is there.

    Between measured points that stand alone there is some, whatever the settings say.
    """
    if settings.joint.non_measured == "unknown" or face.conditioned.surface.filling is not None:
        return problems
    return [one for one in problems if one.code not in OF_VOIDS]


def _before_contact(face: Face, found: Analysis, mate: HeightMap | None) -> list[Problem]:
    """Return what makes scans, settings, hills, caps and families doubtful."""
    problems = []
    scans = [one for one in (found.surface, mate) if one is not None]
    for scan, tops in zip(scans, face.conditioned.tops_of_scans, strict=True):
        problems += _of_reader(scan)
        problems += [*problems_of_scan(scan, tops), *problems_of_points(scan)]
    problems += problems_of_preload(face.joint, found.settings)
    problems += material_doubts(found.settings.material)
    problems += problems_of_structure(found.settings.structure)
    problems += problems_of_settings(found.settings, scanned=True, mated=mate is not None)
    problems += [*face.conditioned.problems, *face.problems]
    on = plane_of(face.family_caps, face.caps)
    return problems + problems_of_families(face.family_caps, face.families, on)


def _of_reader(scan: HeightMap) -> list[Problem]:
    """Return the notes of the reader: what the file settles changes no status."""
    return [
        Problem("reader_note", "info" if isinstance(note, Statement) else "warning", note)
        for note in scan.origin.notes
    ]


def _of_hidden_tops(face: Face, contact: ContactState) -> list[Problem]:
    """Return whether holes hide tops that touch; not on two maps, each with its own caps."""
    if face.label is None:
        return []
    return problems_of_hidden_tops(contact, face.caps, face.conditioned.surface)


def _of_outline(face: Face) -> list[Problem]:
    """Return what the outline of the face was taken to be, where a usual hill lies outside."""
    hills = face.family_caps
    if not hills.usable.any():
        return []
    radius_m = 0.5 * float(np.median(hills.diameter_m[hills.usable]))
    return problems_of_outline(face.conditioned.surface, radius_m)


def _of_second_face(face: Face, contact: ContactState, settings: Settings) -> list[Problem]:
    """Return what is doubted of the second of two maps whose caps are counted together, by itself.

    What it moves is not known: the first map, on which that is tried, does not tell.
    """
    second = face.second
    if second is None:
        return []
    conditioned, caps = second.conditioned, second.caps
    beside = replace(face, conditioned=conditioned, caps=caps, family_caps=caps, second=None)
    problems = [*second.problems, *_of_outline(beside), *_of_levelling(beside, contact, settings)]
    if known_flatness_m(conditioned.surface, settings) is not None:  # of one instrument: said once
        problems = [one for one in problems if one.code not in BOWS]
    name = conditioned.surface.origin.name
    return [
        replace(one, message=f"{name}: {one.message}")
        for one in _less_voids(problems, beside, settings)
    ]


def _of_levelling(face: Face, contact: ContactState, settings: Settings) -> list[Problem]:
    """Return whether a tilt, a bow or seams that were left in decide what touches."""
    conditioning = settings.conditioning
    if contact.approach_m <= 0.0:
        return []  # a flat interface: nothing decides
    problems, seams = list[Problem](), face.conditioned.seams
    if seams is not None and not leaves_peaks(seams, face.family_caps):
        problems += problems_of_seams(seams, contact.approach_m)
    if conditioning.form == "none" and face.level is None:
        problems += problems_of_tilt(face.conditioned.surface, contact.approach_m)
    taken_off = degree_taken_off(conditioning)
    if taken_off <= 1:
        flatness_m = known_flatness_m(face.conditioned.surface, settings)
        problems += _of_bow(face, contact.approach_m, flatness_m)
        error_m = error_of_form_m(face.conditioned.surface, settings)
        problems += problems_of_scans(error_m, contact.approach_m)
    elif not conditioning.form_floor:
        level = face.level
        coarse = coarse_map(face.conditioned.surface) if level is None else level.coarse
        problems += problems_of_fit(coarse, contact.approach_m, taken_off)
    return problems


def _of_floor(
    contact: ContactState, scan: HeightMap, mate: HeightMap | None, settings: Settings
) -> list[Problem]:
    """Return whether load rests where a sensor ended; not on two maps, each with its own caps."""
    if mate is not None and settings.mating.way != "composite":
        return []
    return problems_of_floor(contact, scan, mate)


def _of_ripple(contact: ContactState, surface: HeightMap) -> list[Problem]:
    """Return whether a ripple decides; where caps answer, each averages over it."""
    if contact.rung.made_from != "map":
        return []
    return problems_of_ripple(surface, contact.approach_m)


def _of_fewer_points(contact: ContactState, conditioned: Conditioned) -> list[Problem]:
    """Return whether the map lacks waves that were measured; spheres keep their radii without."""
    if contact.rung.made_from != "map":
        return []
    measured = conditioned.measured_shape or conditioned.finest.shape
    return problems_of_fewer_points(conditioned.surface, conditioned.finer, measured)


def _of_optics(contact: ContactState, settings: Settings) -> list[Problem]:
    """Return that caps were fitted to a blurred map: its effect decides. Maps tell themselves."""
    period_m = settings.instrument.lateral_period_limit_m
    if period_m is None or contact.rung.made_from != "spheres":
        return []
    return [Problem(BLURRED, "warning", BLUR.format(period_m))]


def _of_bow(face: Face, approach_m: float, flatness_m: float | None) -> list[Problem]:
    """Return whether a bow decides that may be of the instrument, as far as its own is known."""
    if flatness_m is not None:
        return problems_of_flatness(flatness_m, approach_m)
    of_peaks = problems_of_bow(face.family_caps, approach_m)
    if of_peaks:
        return of_peaks
    if face.level is not None:
        return problems_of_form(face.level.coarse, approach_m)
    surface = face.conditioned.surface
    return problems_of_form(surface, approach_m, coarse_step(surface))


def _less_note(problems: list[Problem]) -> list[Problem]:
    """Return the problems without the note on small slip, where that asked for has a doubt."""
    return [one for one in problems if (one.code, one.severity) != (SMALL, "info")]


def _of_small_slip(
    contact: ContactState, answer: Answer | None, slip: SlipCurve | None, tolerance: float
) -> list[Problem]:
    """Return a doubt where the map knows less of the energy at the force asked for than it should.

    Or caps that answer because the finest detail of the map decides: their error falls with the
    force, too.
    Below a quarter of mu N what pixels, noise and detail leave is only noted where nobody asks for
    it. From a tenth of mu N on, detail that decides was measured, and from a quarter on what pixels
    leave: then what the pixels resolve is no second doubt.
    """
    if answer is None or slip is None:
        return []
    share = answer.slip_force_N / float(slip.total_slip_force_N)
    warned = {one.code for one in contact.problems if one.severity == "warning"}
    measured = any(one.code == "detail_decides" for one in contact.problems)
    said = SMALL in warned
    asked = f"asked for is {percent(share)} of the force at gross slip"
    left = 0.0 if contact.errors is None else contact.errors.energy_at(share)
    moved = share_of(left)
    falls = contact.errors is not None and contact.errors.energy_by_share
    least = resolved_share(contact)
    if falls and share < ASKED and left > tolerance and not said and "detail_decides" not in warned:
        message = (
            f"{asked}, where pixels, noise and detail of the map leave up to {off_by(left)} in "
            "the energy per cycle"
        )
        if least > 0.0:
            message += f"; below {percent(least)} of it less slips than the pixels resolve"
        return [Problem(SMALL, "warning", message, Effect(None, moved, moved))]
    if share >= least or (measured and share >= SMALL_SLIP) or (said and share >= ASKED):
        return []
    off = off_by(left) if left > UNRESOLVED else f"more than {percent(UNRESOLVED)}"
    message = (
        f"{asked}; below {percent(least)} of it less slips than the pixels of the map resolve: the "
        f"energy per cycle may be off by {off}"
    )
    effect = Effect(None, moved, moved) if left > tolerance else None
    return [Problem(SMALL, "warning", message, effect)]
