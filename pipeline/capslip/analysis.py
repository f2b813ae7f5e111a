"""One analysis: the stages, what makes their numbers doubtful, and the result."""

from dataclasses import replace
from datetime import UTC, datetime

from capslip.caps.table import CapTable
from capslip.doubts import (
    doubts_of_bow,
    doubts_of_contact,
    doubts_of_families,
    doubts_of_settings,
)
from capslip.errors import ContactError, SettingsError
from capslip.problems import Problem
from capslip.result import Analysis
from capslip.sensitivity import sensitivity
from capslip.settings import Settings
from capslip.stages import Clock, Face, damp, find_face, press_face
from capslip.surface.doubts import problems_of_scan, problems_of_tilt
from capslip.surface.heightmap import HeightMap


def analyze(
    surface: HeightMap, settings: Settings | None = None, mate: HeightMap | None = None
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
    """
    settings = settings if settings is not None else Settings()
    analysis = analyze_once(surface, settings, mate)
    if not analysis.caps.usable.any():
        return analysis
    clock = Clock()
    with clock("sensitivity"):
        swept = sensitivity(
            surface,
            settings,
            mate,
            int(analysis.caps.usable.sum()),
            analysis.hills.pruning_height_m,
            with_contact=analysis.slip is not None,
        )
    return replace(
        analysis,
        sensitivity=swept,
        problems=(*analysis.problems, *swept.problems),
        timings_s={**analysis.timings_s, **clock.seconds},
    )


def analyze_once(
    surface: HeightMap, settings: Settings, mate: HeightMap | None = None, *, judged: bool = True
) -> Analysis:
    """Run every stage once, without the sensitivity; parameters and errors as for `analyze`."""
    _check(settings, mate)
    started = datetime.now(UTC).isoformat(timespec="seconds")
    clock = Clock()
    face = find_face(surface, settings, mate, clock)
    problems = _before_contact(surface, mate, face, settings)
    caps = face.caps
    contact = slip = beam = damping = None
    try:
        if caps.usable.any():
            contact, caps, slip = press_face(face, settings, clock, judged=judged)
            problems += contact.problems
            problems += _of_levelling(face, caps, contact.approach_m, settings)
            beam, damping = damp(slip, settings, clock)
            problems += doubts_of_contact(
                caps,
                face.families,
                contact.contacts,
                contact.overlapping_pairs,
                contact.max_pressure_Pa,
                face.conditioned.surface.pixel_area_m2,
                damping,
                settings,
            )
    except ContactError as error:
        problems.append(Problem("contact_failed", "error", str(error)))
    return Analysis(
        surface=surface,
        settings=settings,
        conditioned=face.conditioned,
        hills=face.hills,
        caps=caps,
        families=face.families,
        contact=contact,
        slip=slip,
        beam=beam,
        damping=damping,
        sensitivity=None,
        problems=tuple(problems),
        timings_s=clock.seconds,
        started=started,
    )


def _check(settings: Settings, mate: HeightMap | None) -> None:
    two_maps = mate is not None and settings.mating.way == "together"
    if two_maps and settings.contact.model == "boundary_elements":
        raise SettingsError(
            "contact.model: got boundary_elements with mating.way = together, which counts the "
            "caps of two maps; expected one map to press; set mating.way to composite"
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
    problems += doubts_of_settings(settings)
    problems += [*face.conditioned.problems, *face.problems]
    return problems + doubts_of_families(face.caps, face.families)


def _of_levelling(
    face: Face, caps: CapTable, approach_m: float, settings: Settings
) -> list[Problem]:
    """Return whether a tilt or a bow that was left in decides what touches."""
    if approach_m == 0.0:
        return []  # a flat interface: it touches everywhere
    form = settings.conditioning.form
    problems = problems_of_tilt(face.conditioned.surface, approach_m) if form == "none" else []
    return problems + (doubts_of_bow(caps, approach_m) if form in ("plane", "none") else [])
