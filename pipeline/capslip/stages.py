"""The stages in order, from the height map to the damping, each timed under its own name.

surface -> condition -> (mate) -> hills -> caps -> families -> contact -> slip -> damping
"""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from capslip.caps.below import caps_below_cut, family_below_cut, with_families
from capslip.caps.doubts import plane_of, problems_of_caps
from capslip.caps.families import Families, FamilySurface, group_families, surface_of_families
from capslip.caps.fit import fit_caps, fit_spheres
from capslip.caps.fitting import fit_named
from capslip.caps.hills import Hills, find_hills
from capslip.caps.joining import join_faces
from capslip.caps.levels import bow_terms
from capslip.caps.points import points_of_hills
from capslip.caps.table import CapTable
from capslip.contact.choice import map_for_auto
from capslip.contact.depth import press_for_depth
from capslip.contact.joint import Joint, joint_of
from capslip.contact.levelling import UNSETTLED, Level, TogetherError, find_level, turned
from capslip.contact.rung import made_from, rung
from capslip.contact.slip import SlipCurve
from capslip.errors import ContactError, TipsOverError
from capslip.problems import Problem, Severity
from capslip.settings import Conditioning, Settings
from capslip.structure.beam import BeamMode
from capslip.structure.response import Damping, response
from capslip.structure.stiffness import stiffnesses
from capslip.surface.blocks import coarse_map
from capslip.surface.conditioning import Conditioned, condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.mating import Placement, mate, place

MAX_TURNS = 10  # of fit and contact
SETTLED = 1e-3  # of the preload: loads that move less in one turn have settled
FAMILY_RATIO = 0.10  # of the points, above which the paper counts its caps
FAMILY_TURNS = 4  # of the families and their plane
# Across the face, of the height of the caps; the next turn is a hundredth of it on the same hills
FAMILY_SETTLED = 1e-2
TIMES, TOLD_s = 10, 2.0  # curves of a map that a contact may take; a time that is worth telling
OF_HOLES = "hole_may_hide_hills"
CONDITIONING = Conditioning.__struct_fields__


class Clock:
    """Seconds spent in each stage, summed by its name; each is told as it begins first."""

    def __init__(self, progress: Callable[[str], None] = lambda _: None) -> None:
        self.seconds: dict[str, float] = {}
        self.progress = progress

    @contextmanager
    def __call__(
        self, stage: str, curve_s: float | None = None, limit_s: float = math.inf
    ) -> Iterator[None]:
        """Add the time inside the `with` block to a stage; of a map that of one curve is expected.

        How often it is pressed is not known before: without its detail, on fewer pixels, at another
        level or bow. Eight real scans took 0.9 to 8.3 times one curve; one of which nearly all
        touches 30 times, until its limit was over. Both are of the processor, which others may use.
        """
        if stage not in self.seconds:
            about = ""
            if curve_s is not None and TIMES * curve_s > TOLD_s:
                about = (
                    f", about {curve_s:.2g} s of a processor a curve of the map, of which it takes "
                    f"1 to {TIMES}"
                )
                if TIMES * curve_s < limit_s < math.inf:
                    about += f", or more where much of it touches, up to about {limit_s:g} s"
            self.progress(f"analysing: {stage}{about}")
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begin


@dataclass(frozen=True, eq=False)
class Face:
    """One joint face, or two that are mated, before slip.

    Where it was balanced, the hills and caps are those that the pressed face touches with; the
    families come from caps of their own, on the plane on which they are levels.
    """

    joint: Joint  # of which the face is a part
    conditioned: Conditioned  # with the surface at the level at which it is pressed
    level: Level | None  # None: as levelled
    hills: Hills
    caps: CapTable
    families: Families
    label: np.ndarray | None  # the caps' hills; None where the caps are those of two maps
    family_caps: CapTable
    problems: tuple[Problem, ...]
    second: "SecondFace | None" = None  # where the caps are those of two maps


@dataclass(frozen=True, eq=False)
class SecondFace:
    """The second of two maps whose caps are counted together, as it is by itself."""

    conditioned: Conditioned
    caps: CapTable
    problems: tuple[Problem, ...]  # of its holes: what they may hide is not told by the first


def find_face(
    surface: HeightMap, settings: Settings, other: HeightMap | None, clock: Clock
) -> Face:
    """Run the stages from one height map, or two, to caps in their families.

    Parameters
    ----------
    surface : HeightMap
        The map as measured.
    settings : Settings
        All of an analysis.
    other : HeightMap or None
        The other face, as measured; `settings.mating` says how it is laid on the first.
    clock : Clock
        Takes the time.
    """
    if other is None:
        return _one_map(_conditioned(surface, settings, clock), settings, clock)
    first, second = (_conditioned(one, settings, clock) for one in (surface, other))
    way, form = settings.mating.way, settings.conditioning
    with clock("mate"):
        placement = _placed(first, second, settings)
        fit = {"robust": form.form_robust, "floor": form.form_floor}
        mated = mate(first, second, placement, way=way, **fit)
    if way == "composite":
        return _one_map(mated, settings, clock)
    return _two_maps(mated, (first, second), placement, settings, clock)


def levelled_anew(face: Face, joint: Joint, settings: Settings) -> Face | None:
    """Return a balanced face that finds its level once more, under another load of its scan.

    With the cut and the caps of that: what hardly touched under its own load was fitted to the
    depth of that, and what lies low was cut off. Nobody asks for their families there.

    Returns
    -------
    Face or None
        None where it finds none, or something holds it upright: that is at ease as levelled.
    """
    if settings.contact.alignment_stiffness_Nm_per_rad > 0.0 or face.level is None:
        return None
    settings = joint.settings_of_scan(settings)
    level, _ = _levelled(face.conditioned.surface, settings, Clock())
    if level is None or level.given_up or not level.caps.usable.any():
        return None
    conditioned = replace(face.conditioned, surface=level.surface)
    found = replace(face, joint=joint, conditioned=conditioned, level=level, hills=level.hills)
    return replace(found, caps=level.caps, label=level.hills.label)


def damp(
    slip: SlipCurve, settings: Settings, clock: Clock, resolved_from: float = 0.0
) -> tuple[BeamMode | None, Damping]:
    """Return the mode of the beam, where the settings have one, and the damping of the mode.

    `resolved_from` is the share of gross slip from which the slip is known.
    """
    with clock("structure"):
        beam, modal_N_per_m, joint_N_per_m = stiffnesses(settings)
    with clock("damping"):
        damping = response(
            slip,
            modal_stiffness_N_per_m=modal_N_per_m,
            joint_stiffness_N_per_m=joint_N_per_m,
            joints=settings.structure.joints,
            resolved_from=resolved_from,
        )
    return beam, damping


def _conditioned(surface: HeightMap, settings: Settings, clock: Clock) -> Conditioned:
    options = {name: getattr(settings.conditioning, name) for name in CONDITIONING}
    with clock("condition"):
        return condition(surface, noise_m=settings.instrument.noise_m, **options)


def _placed(first: Conditioned, second: Conditioned, settings: Settings) -> Placement:
    names = "mirror", "align", "offset_m", "rotation_rad"
    options = {name: getattr(settings.mating, name) for name in names}
    return place(first.surface, second.surface, **options)


def _one_map(conditioned: Conditioned, settings: Settings, clock: Clock) -> Face:
    conditioned = _with_voids(conditioned, settings)
    joint = joint_of(settings, conditioned.surface)
    settings = joint.settings_of_scan(settings)
    level, problems = _levelled(conditioned.surface, settings, clock)
    if level is None:
        hills, caps, doubts = _hills_and_caps(conditioned.surface, settings, clock)
        caps, families = _grouped(caps, settings, clock)
        ratio = settings.hills.material_ratio
        with clock("doubts"):
            problems += [*doubts, *_below_cut(conditioned.surface, families, ratio, settings)]
        found = (hills, caps, families, hills.label, caps)
        return Face(joint, conditioned, None, *found, tuple(problems))
    step = {"step": "level", "tilt_rad": list(level.slope), "load_point_m": level.load_point_m}
    # From here on one map does: nobody holds the other
    conditioned = conditioned.turned(level.surface, level.slope, level.load_point_m, step)
    with clock("families"):
        plane, hills, family_caps, families = _families(level, settings)
        caps = with_families(level.caps, level.surface, hills.label, family_caps)
    ratio = _family_ratio(settings)
    with clock("doubts"):
        below = _below_cut(plane, families, ratio, settings, own_plane=True)
        problems += below or caps_below_cut(caps, families, ratio)
        on = plane_of(family_caps, caps)
        problems += problems_of_caps(plane, hills, family_caps, ratio, on)
    found = (level.hills, caps, families, level.hills.label, family_caps)
    return Face(joint, conditioned, level, *found, tuple(problems))


def _with_voids(conditioned: Conditioned, settings: Settings) -> Conditioned:
    """Return the map with its holes as holes of the face, where the settings say so."""
    if settings.joint.non_measured == "unknown":
        return conditioned
    return replace(conditioned, surface=conditioned.surface.as_void())


def _levelled(
    surface: HeightMap, settings: Settings, clock: Clock
) -> tuple[Level | None, list[Problem]]:
    """Return the level of a face that turns, None where it does not or cannot."""
    contact, from_map = settings.contact, made_from(settings) == "map"
    turns = contact.model == "auto" or rung(contact.model).knows_places
    if contact.alignment == "as_levelled" or not turns:
        return None, []
    if from_map and contact.alignment_stiffness_Nm_per_rad > 0.0:
        return None, []  # what holds the parts is at ease as they were levelled
    needs_no_caps = from_map or map_for_auto(surface, settings) is not None
    try:
        with clock("level"):
            level = find_level(surface, settings, needs_no_caps)
        if level.moved > UNSETTLED and not level.given_up:
            raise ContactError(
                f"the face finds no level: the last turn still moved {level.moved:.1%} of the load"
            )
    except TipsOverError as error:
        severity: Severity = "error"
        if needs_no_caps:  # the map may rest on more than its hills
            severity = "info" if from_map else "warning"
        return None, [Problem("tips_over", severity, str(error).removeprefix("tips_over: "))]
    except (ContactError, TogetherError) as error:
        if needs_no_caps:
            return None, []
        message = f"{error}; the face is pressed as it was levelled, and its level decides"
        return None, [Problem("not_balanced", "warning", message)]
    problems = []
    if level.moved > 0.0:
        message = (
            f"the last turn of level, fit and contact still moved {level.moved:.2%} of the load"
        )
        problems.append(Problem("level_not_settled", "warning", message))
    if level.missed_area_m2 > 0.0:
        message = (
            f"{level.missed_area_m2:.3g} m2 below the cut at {level.material_ratio:.0%} stand in "
            "the pressed plane, and no cap stands for them"
        )
        problems.append(Problem("cut_too_high", "warning", message))
    return level, problems


def _families(level: Level, settings: Settings) -> tuple[HeightMap, Hills, CapTable, Families]:
    """Find the families on their own plane: the cut follows that plane, and it the caps above it.

    So neither the level of the map nor that of the pressed face decides which caps are counted. The
    plane bends where the peaks leave no doubt; the caps that are returned keep that bow.
    """
    coarse, bow, at_m = level.coarse, np.zeros(3), level.load_point_m
    slope = np.array(level.rest_slope) + level.slope
    noise_m, ratio = level.coarse_noise.neighbours_m, _family_ratio(settings)
    # The search for the level began with the same cut of the same map
    known = level.hills_at_rest if ratio == settings.hills.material_ratio else None
    found: FamilySurface | None
    for _ in range(FAMILY_TURNS):
        plane, bent = turned(coarse, -slope, at_m, -bow), bow
        hills, caps = _counted(plane, settings, noise_m, ratio, known)
        known = None
        found = surface_of_families(caps, at_m)
        turn, bend = found.slope, found.bow
        if found.count == 1 and not bow.any() and not bend.any() and 2.0 * ratio < 1.0:
            # A bow may keep the lower caps below the cut, and what is left looks like one family.
            _, deeper_caps = _counted(plane, settings, noise_m, 2.0 * ratio)
            deeper = surface_of_families(deeper_caps, at_m)
            turn, bend = deeper.slope if deeper.bow.any() else turn, deeper.bow
        slope, bow = slope + turn, bow + bend
        settled_m = FAMILY_SETTLED * float(caps.cap_height_m.max(initial=0.0))
        settled = not bend.any() and np.abs(turn * coarse.side_m[::-1]).max() <= settled_m
        if settled:
            break
    if not (settled and coarse is level.surface):
        found = None  # that is of fewer points
        plane, bent = turned(level.surface, -slope, at_m, -bow), bow
        hills, caps = _counted(plane, settings, level.hills.noise_m)
    grouping = settings.families
    caps, families = group_families(caps, grouping.count, grouping.feature, True, found)
    up_m = bow_terms(caps.x_m - at_m[0], caps.y_m - at_m[1]) @ bent
    return plane, hills, caps.with_columns(peak_height_m=caps.peak_height_m + up_m), families


def _below_cut(
    plane: HeightMap,
    families: Families,
    ratio: float,
    settings: Settings,
    own_plane: bool = False,
) -> list[Problem]:
    """Return whether a deeper cut shows a second family; a coarse map tells."""
    grouping = settings.families

    def counted(deeper: float) -> Families:
        _, caps = _counted(coarse_map(plane), settings, None, deeper)
        return group_families(caps, grouping.count, grouping.feature, own_plane)[1]

    return family_below_cut(families, ratio, counted)


def _counted(
    surface: HeightMap,
    settings: Settings,
    noise_m: float | None,
    material_ratio: float | None = None,
    known: Hills | None = None,
) -> tuple[Hills, CapTable]:
    if known is None:
        chosen, ratio = settings.hills, material_ratio or _family_ratio(settings)
        pruning = (chosen.pruning_height_m, chosen.pruning_percent_Sz)
        known = find_hills(surface, ratio, chosen.separation, *pruning, noise_m=noise_m)
    return known, fit_spheres(surface, known, settings.caps.fit).counted


def _family_ratio(settings: Settings) -> float:
    """Return the material ratio above which caps are counted: the paper's, unless one is fixed."""
    return settings.hills.material_ratio if settings.hills.cut == "fixed" else FAMILY_RATIO


def _two_maps(
    mated: Conditioned,
    faces: tuple[Conditioned, Conditioned],
    placement: Placement,
    settings: Settings,
    clock: Clock,
) -> Face:
    """Count the caps of both maps, as the paper does, each with the doubts of its own map."""
    mated = _with_voids(mated, settings)
    first, second = (_with_voids(one, settings) for one in faces)
    joint = joint_of(settings, first.surface)
    settings = joint.settings_of_scan(settings)
    hills, caps, problems = _hills_and_caps(first.surface, settings, clock)
    _, other_caps, other_problems = _hills_and_caps(second.surface, settings, clock)
    of_holes = tuple(one for one in other_problems if one.code == OF_HOLES)
    beside = SecondFace(second, other_caps, of_holes)
    caps = join_faces(caps, other_caps, placement.on_first, placement.rotation_rad)
    name = second.surface.origin.name
    for problem in (*second.problems, *other_problems):
        if problem.code != OF_HOLES:
            problems.append(replace(problem, message=f"{name}: {problem.message}"))
    caps, families = _grouped(caps, settings, clock)
    return Face(joint, mated, None, hills, caps, families, None, caps, tuple(problems), beside)


def _grouped(caps: CapTable, settings: Settings, clock: Clock) -> tuple[CapTable, Families]:
    with clock("families"):
        return group_families(caps, settings.families.count, settings.families.feature)


def _hills_and_caps(
    surface: HeightMap, settings: Settings, clock: Clock
) -> tuple[Hills, CapTable, list[Problem]]:
    chosen = settings.hills
    with clock("hills"):
        pruning = (chosen.pruning_height_m, chosen.pruning_percent_Sz)
        hills = find_hills(surface, chosen.material_ratio, chosen.separation, *pruning)
    with clock("caps"):
        caps, moved = _fitted(surface, hills, settings)
    with clock("doubts"):
        problems = problems_of_caps(surface, hills, caps, chosen.material_ratio)
    if moved > SETTLED:
        message = f"the last turn of fit and contact still moved {moved:.1%} of the load"
        problems.append(Problem("fit_not_settled", "warning", message))
    return hills, caps, problems


def _fitted(surface: HeightMap, hills: Hills, settings: Settings) -> tuple[CapTable, float]:
    """Fit the caps; where the fit wants it, each at the depth at which the preload compresses it.

    The fit takes depths, contact gives them: a cap is fitted down to a share of its compression
    a^2 / R, pressed again, and so on until the loads settle. A cap that does not touch keeps the
    depth that the fit chooses. Returns the share of the load that the last turn still moved, too.
    """
    share = fit_named(settings.caps.fit).compression_share
    points = points_of_hills(surface, hills)
    caps = fit_caps(surface, hills, settings.caps.fit, points=points)
    if share is None or made_from(settings) == "nothing":
        return caps, 0.0
    load_N, moved = np.zeros(len(caps)), 0.0
    for _ in range(MAX_TURNS):
        if not caps.usable.any():
            return caps, 0.0
        try:
            pressed = press_for_depth(caps, surface, settings)
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
