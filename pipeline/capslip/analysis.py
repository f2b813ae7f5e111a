"""The stages in order: height map, hills, caps, families, contact, slip, damping."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np

from capslip.caps.doubts import problems_of_bow, problems_of_caps, problems_of_families
from capslip.caps.families import Families, group_families
from capslip.caps.fit import fit_caps
from capslip.caps.fitting import fit_named
from capslip.caps.hills import Hills, find_hills
from capslip.caps.joining import join_faces
from capslip.caps.points import points_of_hills
from capslip.caps.table import CapTable
from capslip.contact.press import ContactState, press, press_for_depth
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.doubts import (
    doubts_of_contact,
    doubts_of_scan,
    doubts_of_settings,
    doubts_of_tilt,
)
from capslip.errors import ContactError, SettingsError
from capslip.problems import Problem
from capslip.sensitivity import FORCE_RATIO, Answers, Sensitivity, answers, sensitivity
from capslip.settings import Conditioning, Settings
from capslip.structure.beam import BeamMode
from capslip.structure.response import Damping, response
from capslip.structure.stiffness import stiffnesses
from capslip.surface.conditioning import Conditioned, condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.mating import mate as composite_of
from capslip.surface.mating import place
from capslip.surface.plausibility import doubts_of_holes

MAX_TURNS = 10  # of fit and contact
SETTLED = 1e-3  # of the preload: loads that move less in one turn have settled
CONDITIONING = Conditioning.__struct_fields__


@dataclass(frozen=True, eq=False)
class Analysis:
    """All that one analysis found; the stages that could not run are None."""

    surface: HeightMap
    settings: Settings
    conditioned: Conditioned
    hills: Hills
    caps: CapTable
    families: Families
    contact: ContactState | None
    slip: SlipCurve | None
    beam: BeamMode | None  # None where the settings give the two stiffnesses
    damping: Damping | None
    sensitivity: Sensitivity | None  # None without a usable cap, or where it was left out
    problems: tuple[Problem, ...]
    timings_s: dict[str, float]
    started: str

    @property
    def status(self) -> str:
        """Return "failed" with an error among the problems, "check" with a warning, or "ok"."""
        severities = {p.severity for p in self.problems}
        if "error" in severities:
            return "failed"
        return "check" if "warning" in severities else "ok"

    def summary(self) -> dict[str, Any]:
        """Return the dictionary of `summary.json`."""
        from capslip.summary import summarise

        return summarise(self)


Timed = Callable[..., Any]  # calls a function with what follows its name, and takes the time


def analyze(
    surface: HeightMap,
    settings: Settings | None = None,
    mate: HeightMap | None = None,
    sweeps: bool = True,
    judged: bool = True,
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
    sweeps : bool
        False leaves the sensitivity out, and with it the problems that it would find.
    judged : bool
        False leaves out how far a contact model that the settings force can be trusted.

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
    together = mate is not None and settings.mating.way == "together"
    if together and settings.contact.model == "boundary_elements":
        raise SettingsError(
            "contact.model: got boundary_elements with mating.way = together, which counts the "
            "caps of two maps; expected one map to press; set mating.way to composite"
        )
    started = datetime.now(UTC).isoformat(timespec="seconds")
    timings_s: dict[str, float] = {}

    def timed(stage: str, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        begin = time.perf_counter()
        result = function(*args, **options)
        timings_s[stage] = timings_s.get(stage, 0.0) + time.perf_counter() - begin
        return result

    conditioned, hills, caps, problems = _find_caps(surface, mate, settings, timed)
    grouping = settings.families
    caps, families = timed("families", group_families, caps, grouping.count, grouping.feature)
    notes: list[Problem] = []
    for face in (surface, mate):
        if face is not None:
            notes += [Problem("reader_note", "warning", note) for note in face.origin.notes]
            notes += doubts_of_scan(face)
    notes += doubts_of_settings(settings)
    problems = [*notes, *conditioned.problems, *problems, *problems_of_families(caps, families)]

    contact = slip = beam = damping = None
    try:
        if caps.usable.any():
            contact, caps = timed(
                "contact",
                press,
                caps,
                families,
                conditioned.surface,
                settings,
                hills.label if len(caps) == hills.n_hills else None,
                hills.noise_m,
                judged=judged,
            )
            problems += contact.problems
            if settings.conditioning.form == "none":
                problems += doubts_of_tilt(conditioned.surface, contact.approach_m)
            if settings.conditioning.form in ("plane", "none"):
                problems += problems_of_bow(caps, contact.approach_m)
            slip = timed(
                "slip",
                slip_curve,
                contact.curve,
                contact.preload_N,
                settings.material.friction_coefficient,
                contact.composite.kappa,
            )
            beam, modal, joint = timed("structure", stiffnesses, settings)
            damping = timed(
                "damping",
                response,
                slip,
                modal_stiffness_N_per_m=modal,
                joint_stiffness_N_per_m=joint,
                joints=settings.structure.joints,
            )
            problems += doubts_of_contact(
                caps,
                families,
                contact.contacts,
                contact.overlapping_pairs,
                contact.max_pressure_Pa,
                conditioned.surface.pixel_area_m2,
                damping,
                settings,
            )
    except ContactError as error:
        problems.append(Problem("contact_failed", "error", str(error)))
    swept = None
    if sweeps and caps.usable.any():
        swept = timed(
            "sensitivity",
            sensitivity,
            partial(_answer, mate),
            surface,
            settings,
            int(caps.usable.sum()),
            hills.pruning_height_m,
            with_contact=slip is not None,
        )
        problems += swept.problems
    return Analysis(
        surface=surface,
        settings=settings,
        conditioned=conditioned,
        hills=hills,
        caps=caps,
        families=families,
        contact=contact,
        slip=slip,
        beam=beam,
        damping=damping,
        sensitivity=swept,
        problems=tuple(problems),
        timings_s=timings_s,
        started=started,
    )


def _find_caps(
    surface: HeightMap, mate: HeightMap | None, settings: Settings, timed: Timed
) -> tuple[Conditioned, Hills, CapTable, list[Problem]]:
    """Run the stages from the height map, or two of them, to one table of caps."""
    options = {name: getattr(settings.conditioning, name) for name in CONDITIONING}
    conditioned = timed("condition", condition, surface, **options)
    if mate is None:
        return conditioned, *_hills_and_caps(conditioned.surface, settings, timed)
    second = timed("condition", condition, mate, **options)
    mating = settings.mating
    placement = timed(
        "mate",
        place,
        conditioned.surface,
        second.surface,
        mirror=mating.mirror,
        align=mating.align,
        offset_m=mating.offset_m,
        rotation_rad=mating.rotation_rad,
    )
    if mating.way == "composite":
        fit = {"robust": options["form_robust"], "floor": options["form_floor"]}
        conditioned = timed("mate", composite_of, conditioned, second, placement, **fit)
        return conditioned, *_hills_and_caps(conditioned.surface, settings, timed)
    hills, caps, problems = _hills_and_caps(conditioned.surface, settings, timed)
    _, other_caps, other_problems = _hills_and_caps(second.surface, settings, timed)
    caps = join_faces(caps, other_caps, placement.on_first, placement.rotation_rad)
    name = second.surface.origin.name
    for problem in (*second.problems, *other_problems):
        problems.append(replace(problem, message=f"{name}: {problem.message}"))
    return conditioned, hills, caps, problems


def _hills_and_caps(
    surface: HeightMap, settings: Settings, timed: Timed
) -> tuple[Hills, CapTable, list[Problem]]:
    hills = timed(
        "hills",
        find_hills,
        surface,
        settings.hills.material_ratio,
        settings.hills.separation,
        settings.hills.pruning_height_m,
        settings.hills.pruning_percent_Sz,
    )
    caps, moved = timed("caps", _fit, surface, hills, settings)
    problems = problems_of_caps(surface, hills, caps, settings.hills.material_ratio)
    if caps.usable.any():
        problems += doubts_of_holes(surface, 0.5 * float(np.median(caps.diameter_m[caps.usable])))
    if moved > SETTLED:
        message = f"the last turn of fit and contact still moved {moved:.1%} of the load"
        problems.append(Problem("fit_not_settled", "warning", message))
    return hills, caps, problems


def _fit(surface: HeightMap, hills: Hills, settings: Settings) -> tuple[CapTable, float]:
    """Fit the caps; where the fit wants it, each at the depth at which the preload compresses it.

    The fit takes depths, contact gives them: a cap is fitted down to a share of its compression
    a^2 / R, pressed again, and so on until the loads settle. A cap that does not touch keeps the
    depth that the fit chooses. Returns the share of the load that the last turn still moved, too.
    """
    share = fit_named(settings.caps.fit).compression_share
    points = points_of_hills(surface, hills)
    caps = fit_caps(surface, hills, settings.caps.fit, points=points)
    if share is None or settings.contact.model == "flat":
        return caps, 0.0
    load_N, moved = np.zeros(len(caps)), 0.0
    for _ in range(MAX_TURNS):
        if not caps.usable.any():
            return caps, 0.0
        try:
            pressed = press_for_depth(caps, surface.side_m, settings)
        except ContactError:
            return caps, 0.0  # the stage of contact says why
        before_N, load_N = load_N, np.nan_to_num(pressed.load_N)
        moved = float(np.abs(load_N - before_N).sum() / (2.0 * settings.contact.preload_N))
        if moved < SETTLED:
            break
        compression_m = pressed.contact_radius_m**2 / pressed.radius_m
        depth_m = np.where(load_N > 0.0, share * compression_m, np.nan)
        caps = fit_caps(surface, hills, settings.caps.fit, depth_m, points)
    return caps, moved


def _answer(
    mate: HeightMap | None, surface: HeightMap, settings: Settings, with_contact: bool
) -> Answers:
    """Run the stages as far as the sensitivity asks for."""

    def untimed(_: str, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        return function(*args, **options)

    conditioned, _, caps, _ = _find_caps(surface, mate, settings, untimed)
    caps, families = group_families(caps, settings.families.count, settings.families.feature)
    if not (with_contact and caps.usable.any()):
        return answers(families, None, None)
    try:
        contact, _ = press(caps, families, conditioned.surface, settings, judged=False)
        slip = slip_curve(
            contact.curve,
            contact.preload_N,
            settings.material.friction_coefficient,
            contact.composite.kappa,
        )
        energy_J = slip.energy_at_force_J(FORCE_RATIO * slip.total_slip_force_N)
    except ContactError:
        return answers(families, None, None)
    return answers(families, contact.approach_m, float(energy_J))
