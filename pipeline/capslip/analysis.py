"""One analysis: the stages, what makes their numbers doubtful, and the result."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime

from capslip.caps.doubts import problems_of_bow, problems_of_families
from capslip.caps.iso25178 import Iso25178
from capslip.contact.doubts import (
    contact_doubts,
    material_doubts,
    problems_of_band,
    problems_of_first_touch,
    problems_of_pressure,
    problems_of_share,
    problems_of_waves,
)
from capslip.contact.effects import with_effects
from capslip.contact.given import given_families, press_families
from capslip.contact.joint import Joint
from capslip.contact.levelling import coarse_map
from capslip.contact.press import ContactState
from capslip.contact.relevance import as_read, still_doubtful
from capslip.contact.rung import rung
from capslip.contact.scans import curve_of_scans, kappa_of_scans
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.contact.varying_load import varying
from capslip.errors import ContactError, SettingsError
from capslip.problems import Problem
from capslip.result import Analysis, JointOfScans, JointResult
from capslip.sensitivity import sensitivity
from capslip.settings import Settings
from capslip.stages import (
    Clock,
    Face,
    as_found,
    can_be_pressed,
    damp,
    estimate,
    find_face,
    press_face,
)
from capslip.structure.answer import Answer, answer_to
from capslip.structure.band import Part, band_of, band_of_scans
from capslip.structure.doubts import problems_of_damping, problems_of_structure
from capslip.structure.stiffness import is_given, structure_name
from capslip.surface.doubts import problems_of_form, problems_of_scan, problems_of_tilt
from capslip.surface.heightmap import HeightMap

GIVEN = ("m", "n", "radius_G_m", "radius_P_m", "h_m", "approach_m")  # of families, without a scan
ASKED_OF_THE_JOINT = ("beyond_gross_slip", "not_lightly_damped", "peak_at_gross_slip")


def analyze(
    surface: HeightMap,
    settings: Settings | None = None,
    mate: HeightMap | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Analysis:
    """Run every stage on one face, or on two that are mated.

    Parameters
    ----------
    surface : HeightMap
        The map as measured.
    settings : Settings, optional
        All defaults where absent.
    mate : HeightMap, optional
        The other face, as measured; `settings.mating` says how it is laid on the first.
    progress : callable, optional
        Told which stage begins, and about how long the map takes where it may be pressed.

    Returns
    -------
    Analysis
        Where no usable cap is found, or the caps cannot carry the preload, the later stages are
        None and a problem says why.

    Raises
    ------
    UnusableSurfaceError
        If nothing was measured, all heights are equal, or fewer than 9 points lie above the cut.
    SettingsError
        If a setting makes no sense for this map, or boundary elements shall press two maps whose
        caps are counted together.

    Examples
    --------
    >>> from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
    >>> families = (CapFamily("G", 3, 24.0), CapFamily("P", 6, 24.0, 1e-7))
    >>> surface, _ = synthetic_surface(Scene((100, 150), (4e-4, 4e-4), families=families))
    >>> found = analyze(surface)
    >>> found.families.G.count, found.families.P.count
    (3, 6)
    """
    settings = settings if settings is not None else Settings()
    clock = Clock(progress)
    face, analysis = _analyzed(surface, settings, mate, clock)
    if not face.caps.usable.any():
        return analysis
    problems = analysis.problems
    contact = analysis.contact
    if contact is not None and _lacks_error(contact, settings):
        contact, doubts = estimate(face, contact, settings, clock)
        problems = (*problems, *(doubt for doubt in doubts if doubt not in problems))
    band = None
    if contact is not None and analysis.damping is not None:
        with clock("band"):
            band = band_of(analysis.answer, face.joint, contact, analysis.damping, settings)
    analysis = replace(analysis, contact=contact, band=band, problems=problems)
    if not settings.run.sensitivity:
        return analysis
    with clock("sensitivity"):
        swept = sensitivity(
            surface,
            settings,
            mate,
            int(face.caps.usable.sum()),
            face.hills.pruning_height_m,
            with_contact=contact is not None,
        )
    return replace(analysis, sensitivity=swept, problems=(*problems, *swept.problems))


def _of_small_slip(
    contact: ContactState, answer: Answer | None, slip: SlipCurve
) -> tuple[Problem, ...]:
    """Return a doubt where less slips under the force asked for than the model resolves."""
    if answer is None or contact.rung.least_share is None:
        return ()
    share = answer.slip_force_N / float(slip.total_slip_force_N)
    least = contact.rung.least_share(contact.normal, contact.preload_N)
    if share >= least:
        return ()
    message = (
        f"asked for is {share:.2g} of the force at total slip; below {least:.2g} less slips than "
        "the pixels of the map resolve: the energy per cycle may be off by more than 5 %"
    )
    return (Problem("small_slip_extrapolated", "warning", message),)


def _lacks_error(contact: ContactState, settings: Settings) -> bool:
    """Tell whether nobody has estimated the error of a model: one that was not chosen for it."""
    of_the_map = contact.estimated_error is None and contact.rung.error is not None
    return settings.contact.model != "auto" or of_the_map


def analyze_once(surface: HeightMap, settings: Settings, mate: HeightMap | None = None) -> Analysis:
    """Run every stage once: neither the error of a forced model, nor the band or the sensitivity.

    Parameters and errors are those of `analyze`.
    """
    return _analyzed(surface, settings, mate, Clock())[1]


def analyze_families(settings: Settings) -> JointResult:
    """Run the stages from given families on: m, n, R and h in the settings, and no scan.

    Parameters
    ----------
    settings : Settings
        `families.m` and so on; the contact model is that of the families, whatever they say.

    Raises
    ------
    SettingsError
        If the families are not given, or only in part.
    ContactError
        If they cannot carry the preload.

    Examples
    --------
    >>> from capslip.settings import load_settings
    >>> given = {"m": 5, "n": 18, "radius_G_m": 23.8, "radius_P_m": 26.7, "h_m": 2.4e-7}
    >>> sets = (f"families.{name}={value}" for name, value in given.items())
    >>> settings = load_settings(overrides=(*sets, "families.approach_m=2.5e-7"))
    >>> found = analyze_families(settings)
    >>> print(f"{found.joint.preload_N:.1f} N")
    460.4 N
    """
    clock, started = Clock(), datetime.now(UTC).isoformat(timespec="seconds")
    families = given_families(settings)
    with clock("contact"):
        joint, contact = press_families(families, settings)
    friction, kappa = settings.material.friction_coefficient, contact.composite.kappa
    greatest_N = joint.preload_N * (1.0 + settings.slip.normal_amplitude_ratio)
    slip = slip_curve(contact.curve_after(greatest_N), joint.preload_N, friction, kappa)
    slip = varying(slip, settings.slip)
    beam, damping = damp(slip, settings, clock)
    answer, beyond = answer_to(settings.answer, slip, damping)
    with clock("band"):
        band = band_of(answer, joint, contact, damping, settings)
    problems = [
        *material_doubts(settings.material),
        *problems_of_structure(settings.structure),
        *problems_of_pressure(contact),
        *problems_of_damping(damping, structure_name(settings), is_given(settings)),
        *beyond,
    ]
    return JointResult(
        settings=settings,
        joint=joint,
        families=families,
        contact=contact,
        slip=slip,
        beam=beam,
        damping=damping,
        answer=answer,
        band=band,
        problems=tuple(problems),
        timings_s=clock.seconds,
        started=started,
    )


def analyze_scans(surfaces: Sequence[HeightMap], settings: Settings) -> JointOfScans:
    """Run every stage on several scans of one joint, and answer for the joint of their patches.

    Every scan bears the nominal pressure of the joint and stands for a share of it that is its
    share of what was scanned; all have one tangential displacement.

    Parameters
    ----------
    surfaces : sequence of HeightMap
        The maps as measured, two at least.
    settings : Settings
        With the area of the joint, `joint.area_m2` or `joint.pressure_map`.

    Returns
    -------
    JointOfScans
        A scan that finds no slip curve leaves the joint to the others, and an error among the
        problems.

    Raises
    ------
    SettingsError
        If there are fewer than two scans, the area of the joint is not given, or the contact model
        takes nothing from a scan.
    UnusableSurfaceError
        As for `analyze`, of any scan.
    """
    _check_scans(surfaces, settings)
    clock, started = Clock(), datetime.now(UTC).isoformat(timespec="seconds")
    with clock("scans"):
        scans = tuple(analyze(surface, settings) for surface in surfaces)
    problems, slip, beam, damping, answer, band = _of_scans(scans), None, None, None, None, None
    parts, joint = _parts(scans)
    if parts:
        curves = [part.joint.curve(part.contact) for part in parts]
        contacts, shares = [part.contact for part in parts], [part.share for part in parts]
        friction, kappa = settings.material.friction_coefficient, kappa_of_scans(contacts, shares)
        with clock("slip"):
            curve = curve_of_scans(curves, joint.preload_N, shares)
            slip = varying(slip_curve(curve, joint.preload_N, friction, kappa), settings.slip)
        beam, damping = damp(slip, settings, clock)
        answer, beyond = answer_to(settings.answer, slip, damping)
        problems += problems_of_damping(damping, structure_name(settings), is_given(settings))
        problems += beyond
        with clock("band"):
            band = band_of_scans(answer, parts, damping, settings)
    return JointOfScans(
        settings=settings,
        joint=joint,
        families=None,
        contact=None,
        slip=slip,
        beam=beam,
        damping=damping,
        answer=answer,
        band=band,
        problems=tuple(problems),
        timings_s=clock.seconds,
        started=started,
        scans=scans,
    )


def _check_scans(surfaces: Sequence[HeightMap], settings: Settings) -> None:
    if len(surfaces) < 2:
        raise SettingsError(f"scans: got {len(surfaces)}; expected two scans of one joint, or more")
    if settings.joint.area_m2 is None and settings.joint.pressure_map is None:
        raise SettingsError(
            f"joint.area_m2: got {len(surfaces)} scans of one joint, and not how large that is; "
            "expected joint.area_m2 or joint.pressure_map; capslip batch analyses each alone"
        )
    model = settings.contact.model
    if model != "auto" and rung(model).made_from == "nothing":
        raise SettingsError(
            f"contact.model: got {model} with {len(surfaces)} scans, of which it takes nothing; "
            "expected a model of their caps or maps"
        )


def _parts(scans: Sequence[Analysis]) -> tuple[tuple[Part, ...], Joint]:
    """Return what each scan with a slip curve says of the joint, and the joint with all of them."""
    known = [(scan.joint, scan.contact) for scan in scans if scan.contact and scan.slip]
    area_m2 = [joint.scan_area_m2 or 0.0 for joint, _ in known]
    parts = tuple(
        Part(joint, contact, one_m2 / sum(area_m2))
        for (joint, contact), one_m2 in zip(known, area_m2, strict=True)
    )
    if not parts:
        return (), replace(scans[0].joint, scan_area_m2=None)
    joint, factor = parts[0].joint, 1.0 / parts[0].share
    return parts, replace(
        joint,
        scan_area_m2=sum(area_m2),
        load_N=joint.load_N * factor,
        weight=joint.weight / factor,
        scan_load_N=joint.scan_load_N * factor,
    )


def _of_scans(scans: Sequence[Analysis]) -> list[Problem]:
    """Return the problems of several scans: those of all once, the others with their scan."""
    found: list[Problem] = []
    for scan in scans:
        for problem in scan.problems:
            if problem.code in ASKED_OF_THE_JOINT:
                continue
            if not all(problem in other.problems for other in scans):
                message = f"{scan.name}: {problem.message}"
                found.append(replace(problem, message=message))
            elif problem not in found:
                found.append(problem)
    return found


def _analyzed(
    surface: HeightMap, settings: Settings, mate: HeightMap | None, clock: Clock
) -> tuple[Face, Analysis]:
    _check(settings, mate)
    started = datetime.now(UTC).isoformat(timespec="seconds")
    face = find_face(surface, settings, mate, clock)
    problems = _before_contact(surface, mate, face, settings)
    caps = face.caps
    contact = slip = beam = damping = answer = None
    try:
        if can_be_pressed(face, settings):
            contact, caps, slip = press_face(face, settings, clock)
            pressed, tolerance = face.conditioned.surface, settings.contact.tolerance
            doubtful = still_doubtful(caps, contact, pressed, tolerance)
            problems = as_read(problems, contact, doubtful, tolerance)
            problems += [*contact.problems, *problems_of_share(face.joint, contact)]
            problems += problems_of_waves(face.joint, contact, pressed)
            problems += problems_of_first_touch(contact)
            problems += _of_levelling(face, contact, settings)
            problems += problems_of_band(
                *(caps, face.conditioned.surface, face.hills.noise_m, settings.conditioning)
            )
            beam, damping = damp(slip, settings, clock)
            found = contact_doubts(
                contact,
                doubtful,
                face.families,
                pressed.pixel_area_m2,
                cut_certified=face.level is not None and face.level.missed_area_m2 == 0.0,
            )
            problems += as_read(found, contact, doubtful, tolerance)
            problems += problems_of_damping(damping, structure_name(settings), is_given(settings))
            answer, beyond = answer_to(settings.answer, slip, damping)
            problems += [*beyond, *_of_small_slip(contact, answer, slip)]
            problems = with_effects(
                *(problems, face.caps.with_columns(flags=doubtful.flags), face.family_caps),
                face.conditioned,
                as_found(face, settings),
            )
    except ContactError as error:
        problems.append(Problem("contact_failed", "error", str(error)))
    return face, Analysis(
        surface=surface,
        settings=settings,
        joint=face.joint,
        conditioned=face.conditioned,
        level=face.level,
        hills=face.hills,
        caps=caps,
        families=face.families,
        contact=contact,
        slip=slip,
        beam=beam,
        damping=damping,
        answer=answer,
        band=None,
        sensitivity=None,
        iso25178=Iso25178(face.conditioned),
        mate=None if mate is None else mate.origin,
        problems=tuple(problems),
        timings_s=clock.seconds,
        started=started,
    )


def _check(settings: Settings, mate: HeightMap | None) -> None:
    given = [name for name in GIVEN if getattr(settings.families, name) is not None]
    if given:
        raise SettingsError(
            f"families.{given[0]}: got families together with a scan, which are counted on it; "
            "leave them out, or take capslip families"
        )
    model = settings.contact.model
    two_maps = mate is not None and settings.mating.way == "together"
    if two_maps and model != "auto" and rung(model).made_from == "map":
        raise SettingsError(
            f"contact.model: got {model} with mating.way = together, which counts the caps of two "
            "maps; expected one map to press; set mating.way to composite"
        )


def _before_contact(
    surface: HeightMap, mate: HeightMap | None, face: Face, settings: Settings
) -> list[Problem]:
    """Return what makes scans, settings, hills, caps and families doubtful."""
    problems = []
    for scan in (surface, mate):
        if scan is not None:
            problems += [Problem("reader_note", "warning", note) for note in scan.origin.notes]
            problems += problems_of_scan(scan)
    problems += material_doubts(settings.material)
    problems += problems_of_structure(settings.structure)
    problems += [*face.conditioned.problems, *face.problems]
    return problems + problems_of_families(face.family_caps, face.families)


def _of_levelling(face: Face, contact: ContactState, settings: Settings) -> list[Problem]:
    """Return whether a tilt or a bow that was left in decides what touches."""
    form = settings.conditioning.form
    if contact.approach_m <= 0.0:
        return []  # a flat interface: nothing decides
    problems = []
    if form == "none" and face.level is None:
        problems += problems_of_tilt(face.conditioned.surface, contact.approach_m)
    if form in ("plane", "none"):
        bow = problems_of_bow(face.family_caps, contact.approach_m)
        coarse = coarse_map(face.conditioned.surface)
        problems += bow or problems_of_form(coarse, contact.approach_m)
    return problems
