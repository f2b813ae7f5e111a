"""One analysis: the stages, what makes their numbers doubtful, and the result."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import TypeVar

from capslip.caps.iso25178 import Iso25178
from capslip.contact.choice import contact_failed
from capslip.contact.curve import NormalCurve
from capslip.contact.doubts import material_doubts, problems_of_pressure
from capslip.contact.given import given_families, press_families
from capslip.contact.joint import Joint, has_area
from capslip.contact.map_doubts import BLURRED
from capslip.contact.press import ContactState
from capslip.contact.rung import resolved_share, rung
from capslip.contact.scans import joint_of_scans
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.contact.varying_load import greatest_over_mean, varying
from capslip.doubts import problems_of, problems_of_settings
from capslip.errors import ContactError, SettingsError, check_call
from capslip.pressing import can_be_pressed, estimate, press_face
from capslip.problems import Problem
from capslip.result import Analysis, JointOfScans, JointResult
from capslip.sensitivity import sensitivity
from capslip.settings import Settings, checked
from capslip.stages import Clock, Face, damp, find_face
from capslip.structure.answer import answer_to
from capslip.structure.band import band_of
from capslip.structure.band_state import Part
from capslip.structure.doubts import problems_of_damping, problems_of_structure
from capslip.structure.stiffness import is_given, structure_name
from capslip.surface.average import problems_of_places
from capslip.surface.heightmap import HeightMap, check_map, check_maps
from capslip.surface.readers.faces import check_reading

R = TypeVar("R", bound=JointResult)

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
        All defaults where absent. A material that is named fills in what nobody gave, as in a file.
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
        If a map is no HeightMap, nothing was measured, all heights are equal, or fewer than 9
        points lie above the cut.
    SettingsError
        If the settings are no Settings, progress is no function, a setting is of the wrong type or
        out of bounds, though its class takes it, or makes no sense for this map, `reading` says of
        it what it was not read with
        (`load_surface(path, **msgspec.structs.asdict(settings.reading))`), or boundary
        elements shall press two maps whose caps are counted together.

    Examples
    --------
    >>> from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
    >>> families = (CapFamily("G", 3, 24.0), CapFamily("P", 6, 24.0, 1e-7))
    >>> surface, _ = synthetic_surface(Scene((100, 150), (4e-4, 4e-4), families=families))
    >>> found = analyze(surface)
    >>> found.families.G.count, found.families.P.count
    (3, 6)
    """
    settings = checked(settings if settings is not None else Settings())
    check_call("progress", progress)
    clock = Clock(progress)
    face, found = _analyzed(surface, settings, mate, clock)
    found = _with_band(found, clock)
    if not settings.run.sensitivity or not face.caps.usable.any():
        return found
    with clock("sensitivity"):
        swept = sensitivity(
            surface,
            settings,
            mate,
            int(face.caps.usable.sum()),
            face.hills.pruning_height_m,
            with_contact=found.contact is not None,
        )
    doubts = swept.problems_for(found.contact.rung if found.contact is not None else None)
    return replace(found, sensitivity=swept, problems=(*found.problems, *doubts))


def _lacks_error(contact: ContactState, settings: Settings) -> bool:
    """Tell whether nobody has estimated the error of a model: one that was not chosen for it."""
    of_the_map = contact.errors is None and contact.rung.error is not None
    return settings.contact.model != "auto" or of_the_map


def analyze_once(surface: HeightMap, settings: Settings, mate: HeightMap | None = None) -> Analysis:
    """Run every stage once: neither the error of a forced model, nor the band or the sensitivity.

    Parameters and errors are those of `analyze`.
    """
    return _analyzed(surface, checked(settings), mate, Clock(), with_error=False)[1]


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
    settings = checked(settings)
    clock, started = Clock(), _now()
    families = given_families(settings)
    with clock("contact"):
        joint, contact = press_families(families, settings)
    curve = contact.curve_after(joint.preload_N * greatest_over_mean(settings.slip))
    problems = [*material_doubts(settings.material), *problems_of_structure(settings.structure)]
    problems += problems_of_settings(settings, scanned=False, mated=False)
    pressed = JointResult(
        settings=settings,
        joint=joint,
        families=families,
        contact=contact,
        slip=_sheared(curve, joint, contact.composite.kappa, settings, clock),
        problems=(*problems, *contact.problems, *problems_of_pressure(contact)),
        timings_s=clock.seconds,
        started=started,
    )
    return _with_band(_answered(pressed, clock), clock)


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
        If there are fewer than two scans, the area of the joint is not given, the normal load
        oscillates, or the contact model takes nothing from a scan.
    UnusableSurfaceError
        As for `analyze`, of any scan.
    """
    check_maps(surfaces)
    settings = checked(settings)
    check_scans(surfaces, settings)
    clock, started = Clock(), _now()
    with clock("scans"):
        scans = tuple(analyze(surface, settings) for surface in surfaces)
    found = JointOfScans(
        settings=settings,
        joint=replace(scans[0].joint, scan_area_m2=None),
        problems=(*problems_of_places(surfaces), *_of_scans(scans)),
        timings_s=clock.seconds,
        started=started,
        scans=scans,
    )
    parts = found.parts
    if not parts:
        return found
    joint = _joint(parts)
    curves = [part.joint.curve(part.contact) for part in parts]
    shares = [part.share for part in parts]
    each = [part.kappa for part in parts]
    curve, kappa = joint_of_scans(curves, joint.preload_N, shares, each)
    slip = _sheared(curve, joint, kappa, settings, clock)
    return _with_band(_answered(replace(found, joint=joint, slip=slip), clock), clock)


def _sheared(
    curve: NormalCurve, joint: Joint, kappa: float, settings: Settings, clock: Clock
) -> SlipCurve:
    friction = settings.material.friction_coefficient
    with clock("slip"):
        return varying(slip_curve(curve, joint.preload_N, friction, kappa), settings.slip)


def _answered(found: R, clock: Clock) -> R:
    """Return a result that has slip with damping and answer, and what makes these doubtful."""
    settings, slip = found.settings, found.slip
    assert slip is not None
    beam, damping = damp(slip, settings, clock, _resolved_from(found))
    doubts = problems_of_damping(damping, structure_name(settings), is_given(settings))
    answer, beyond = answer_to(settings.answer, slip, damping, has_area(settings))
    problems = (*found.problems, *doubts, *beyond)
    return replace(found, beam=beam, damping=damping, answer=answer, problems=problems)


def _resolved_from(found: JointResult) -> float:
    """Return the share of gross slip from which the maps of all parts resolve what slips."""
    return max((resolved_share(part.contact) for part in found.parts), default=0.0)


def _with_band(found: R, clock: Clock) -> R:
    """Return a result with the intervals of its answer, which need the errors of its models."""
    if found.damping is None:
        return found
    with clock("band"):
        band = band_of(found.answer, found.parts, found.damping, found.settings, found.noise_known)
    if band is not None:
        of_map = any(part.contact.rung.made_from == "map" for part in found.parts)
        band = replace(band, left_out=(*band.left_out, *_open(found.problems, of_map)))
    return replace(found, band=band)


def _open(problems: Sequence[Problem], of_map: bool) -> tuple[str, ...]:
    """Name the warnings whose effect no input of the interval holds: another face may be meant.

    Each once, whichever of several scans have it. And what filled points of a pressed map move,
    however little, as nothing else says so. The error of a map holds what a blur of its optics
    moves, that of caps does not.
    """
    codes = dict.fromkeys(
        one.code
        for one in problems
        if (one.severity == "warning" and one.effect is not None and not one.kind.in_interval)
        or (one.code == "points_filled" and of_map)
        or (one.code == BLURRED and one.severity == "warning" and not of_map)
    )
    return tuple(f"what {code} moves" for code in codes)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def check_scans(surfaces: Sequence[object], settings: Settings) -> None:
    """Refuse scans, or files of them, of which the settings make no joint: before any is read.

    Raises
    ------
    SettingsError
        As for `analyze_scans`.
    """
    if len(surfaces) < 2:
        raise SettingsError(f"scans: got {len(surfaces)}; expected two scans of one joint, or more")
    if not has_area(settings):
        raise SettingsError(
            f"joint.area_m2: got {len(surfaces)} scans of one joint, and not how large that is; "
            "expected joint.area_m2 (--area) or joint.pressure_map; capslip batch analyses each "
            "alone"
        )
    ratio = settings.slip.normal_amplitude_ratio
    if ratio > 0.0:
        raise SettingsError(
            f"slip.normal_amplitude_ratio: got {ratio:g} with {len(surfaces)} scans, which bear "
            "one pressure under the mean load alone; expected 0, or one scan"
        )
    model = settings.contact.model
    if model != "auto" and rung(model).made_from == "nothing":
        raise SettingsError(
            f"contact.model: got {model} with {len(surfaces)} scans, of which it takes nothing; "
            "expected a model of their caps or maps"
        )


def _joint(parts: Sequence[Part]) -> Joint:
    """Return the joint with all that was scanned of it."""
    joint, factor = parts[0].joint, 1.0 / parts[0].share
    return replace(
        joint,
        scan_area_m2=sum(part.joint.scan_area_m2 or 0.0 for part in parts),
        load_N=joint.load_N * factor,
        weight=joint.weight / factor,
        scan_load_N=joint.scan_load_N * factor,
    )


def _of_scans(scans: Sequence[Analysis]) -> list[Problem]:
    """Return the problems of several scans: each kind once, of the scan where it moves most.

    Its message says which scan that is and how many more have it, but where all say the same. Each
    scan keeps its own, see `scan_table`; what leaves one without an answer is told of each.
    """
    of_kind: dict[tuple[str, str, str, int], list[tuple[str, Problem]]] = {}
    for scan in scans:
        times: Counter[tuple[str, str]] = Counter()
        for problem in scan.problems:
            if problem.code in ASKED_OF_THE_JOINT:
                continue
            kind = problem.code, problem.severity
            which = scan.name if problem.severity == "error" else ""
            of_kind.setdefault((*kind, which, times[kind]), []).append((scan.name, problem))
            times[kind] += 1
    found: list[Problem] = []
    for alike in of_kind.values():
        name, worst = max(alike, key=lambda one: one[1].greatest_effect)
        if len(alike) < len(scans) or any(one != worst for _, one in alike):
            more = len(alike) - 1
            scans_too = f" (and {more} more {'scan' if more == 1 else 'scans'})" if more else ""
            worst = replace(worst, message=f"{name}{scans_too}: {worst.message}")
        found.append(worst)
    return found


def _analyzed(
    surface: HeightMap,
    settings: Settings,
    mate: HeightMap | None,
    clock: Clock,
    with_error: bool = True,
) -> tuple[Face, Analysis]:
    check_map("surface", surface)
    check_map("mate", surface if mate is None else mate)
    _check(settings, mate)
    for face_read in (surface,) if mate is None else (surface, mate):
        check_reading(face_read, settings.reading, alone=mate is None)
    started = _now()
    face = find_face(surface, settings, mate, clock)
    found = Analysis(
        surface=surface,
        settings=settings,
        joint=face.joint,
        conditioned=face.conditioned,
        level=face.level,
        hills=face.hills,
        caps=face.caps,
        families=face.families,
        iso25178=Iso25178(face.conditioned),
        mate=None if mate is None else mate.origin,
        problems=(),
        timings_s=clock.seconds,
        started=started,
    )
    try:
        if can_be_pressed(face, settings):
            contact, caps, slip = press_face(face, settings, clock)
            if with_error and _lacks_error(contact, settings):
                contact = estimate(face, contact, settings, clock)
            found = replace(found, contact=contact, caps=caps, slip=slip)
            found = _answered(found, clock)
    except ContactError as error:
        pressed = None if face.label is None else face.conditioned.surface
        failed = contact_failed(error, pressed, settings)
        found = replace(found, problems=(*found.problems, failed))
    with clock("effects"):  # of the doubts: it may press the map again, and is told by itself
        return face, replace(found, problems=problems_of(face, found, mate))


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
