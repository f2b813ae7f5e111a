"""The stages in order, from the height map to the damping, each timed under its own name.

surface -> condition -> (mate) -> hills -> caps -> families -> contact -> slip -> damping
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from capslip.caps.doubts import problems_of_caps
from capslip.caps.families import Families, group_families
from capslip.caps.fit import fit_caps
from capslip.caps.fitting import fit_named
from capslip.caps.hills import Hills, find_hills
from capslip.caps.joining import join_faces
from capslip.caps.points import points_of_hills
from capslip.caps.table import CapTable
from capslip.contact.choice import estimate_error
from capslip.contact.depth import press_for_depth
from capslip.contact.press import ContactState, press
from capslip.contact.rung import rung
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.errors import ContactError
from capslip.problems import Problem
from capslip.settings import Conditioning, Settings
from capslip.structure.beam import BeamMode
from capslip.structure.response import Damping, response
from capslip.structure.stiffness import stiffnesses
from capslip.surface.conditioning import Conditioned, condition
from capslip.surface.doubts import problems_of_holes
from capslip.surface.heightmap import HeightMap
from capslip.surface.mating import Placement, mate, place

MAX_TURNS = 10  # of fit and contact
SETTLED = 1e-3  # of the preload: loads that move less in one turn have settled
CONDITIONING = Conditioning.__struct_fields__


class Clock:
    """Seconds spent in each stage, summed by its name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time inside the `with` block to a stage."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begin


@dataclass(frozen=True, eq=False)
class Face:
    """One joint face, or two that are mated, before it is pressed."""

    conditioned: Conditioned
    hills: Hills
    caps: CapTable
    families: Families
    label: np.ndarray | None  # the caps' hills; None where the caps are those of two maps
    problems: tuple[Problem, ...]


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
    with clock("condition"):
        conditioned = _conditioned(surface, settings)
    if other is None:
        return _one_map(conditioned, settings, clock)
    with clock("condition"):
        second = _conditioned(other, settings)
    with clock("mate"):
        placement = _placed(conditioned, second, settings)
    if settings.mating.way == "composite":
        with clock("mate"):
            fit = {
                "robust": settings.conditioning.form_robust,
                "floor": settings.conditioning.form_floor,
            }
            conditioned = mate(conditioned, second, placement, **fit)
        return _one_map(conditioned, settings, clock)
    return _two_maps(conditioned, second, placement, settings, clock)


def press_face(
    face: Face, settings: Settings, clock: Clock
) -> tuple[ContactState, CapTable, SlipCurve]:
    """Press a face with its preload, and shear it.

    Returns
    -------
    ContactState, CapTable, SlipCurve
        The state under the preload; the caps with their loads; the slip curve.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload within the validity of the model.
    """
    with clock("contact"):
        contact, caps = press(
            face.caps,
            face.families,
            face.conditioned.surface,
            settings,
            face.label,
            face.hills.noise_m,
        )
    with clock("slip"):
        slip = slip_curve(
            contact.curve,
            contact.preload_N,
            settings.material.friction_coefficient,
            contact.composite.kappa,
        )
    return contact, caps, slip


def estimate(
    face: Face, settings: Settings, clock: Clock
) -> tuple[float | None, tuple[Problem, ...]]:
    """Return the estimated error of a model that the settings force, and whether it is too great.

    It takes far longer than to press the face; the automatic choice has its estimate already.
    """
    with clock("accuracy"):
        return estimate_error(
            face.caps,
            face.families,
            face.conditioned.surface,
            face.label,
            face.hills.noise_m,
            settings,
        )


def damp(slip: SlipCurve, settings: Settings, clock: Clock) -> tuple[BeamMode | None, Damping]:
    """Return the mode of the beam, where the settings have one, and the damping of the mode."""
    with clock("structure"):
        beam, modal_N_per_m, joint_N_per_m = stiffnesses(settings)
    with clock("damping"):
        damping = response(
            slip,
            modal_stiffness_N_per_m=modal_N_per_m,
            joint_stiffness_N_per_m=joint_N_per_m,
            joints=settings.structure.joints,
        )
    return beam, damping


def _conditioned(surface: HeightMap, settings: Settings) -> Conditioned:
    options = {name: getattr(settings.conditioning, name) for name in CONDITIONING}
    return condition(surface, **options)


def _placed(first: Conditioned, second: Conditioned, settings: Settings) -> Placement:
    mating = settings.mating
    return place(
        first.surface,
        second.surface,
        mirror=mating.mirror,
        align=mating.align,
        offset_m=mating.offset_m,
        rotation_rad=mating.rotation_rad,
    )


def _one_map(conditioned: Conditioned, settings: Settings, clock: Clock) -> Face:
    hills, caps, problems = _hills_and_caps(conditioned.surface, settings, clock)
    caps, families = _grouped(caps, settings, clock)
    return Face(conditioned, hills, caps, families, hills.label, tuple(problems))


def _two_maps(
    first: Conditioned, second: Conditioned, placement: Placement, settings: Settings, clock: Clock
) -> Face:
    """Count the caps of both maps, as the paper does."""
    hills, caps, problems = _hills_and_caps(first.surface, settings, clock)
    _, other_caps, other_problems = _hills_and_caps(second.surface, settings, clock)
    caps = join_faces(caps, other_caps, placement.on_first, placement.rotation_rad)
    name = second.surface.origin.name
    for problem in (*second.problems, *other_problems):
        problems.append(replace(problem, message=f"{name}: {problem.message}"))
    caps, families = _grouped(caps, settings, clock)
    return Face(first, hills, caps, families, None, tuple(problems))


def _grouped(caps: CapTable, settings: Settings, clock: Clock) -> tuple[CapTable, Families]:
    with clock("families"):
        return group_families(caps, settings.families.count, settings.families.feature)


def _hills_and_caps(
    surface: HeightMap, settings: Settings, clock: Clock
) -> tuple[Hills, CapTable, list[Problem]]:
    chosen = settings.hills
    with clock("hills"):
        hills = find_hills(
            surface,
            chosen.material_ratio,
            chosen.separation,
            chosen.pruning_height_m,
            chosen.pruning_percent_Sz,
        )
    with clock("caps"):
        caps, moved = _fitted(surface, hills, settings)
    problems = problems_of_caps(surface, hills, caps, chosen.material_ratio)
    if caps.usable.any():
        hill_m = 0.5 * float(np.median(caps.diameter_m[caps.usable]))
        problems += problems_of_holes(surface, hill_m)
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
    if share is None or not _has_contacts(settings):
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


def _has_contacts(settings: Settings) -> bool:
    model = settings.contact.model
    return model == "auto" or rung(model).made_from != "nothing"
