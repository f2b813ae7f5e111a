"""The stages in order: height map, hills, caps, families, contact, slip, damping."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from pipeline.caps.families import Families, group_families
from pipeline.caps.fit import fit_caps
from pipeline.caps.hills import Hills, find_hills
from pipeline.caps.table import CapTable
from pipeline.contact import curves
from pipeline.contact.curves import NormalCurve
from pipeline.contact.flat import flat
from pipeline.contact.interacting import InteractingCurve, interacting
from pipeline.contact.material import Composite, composite
from pipeline.contact.slip import SlipCurve, slip_curve
from pipeline.doubts import doubts_of_caps, doubts_of_contact
from pipeline.errors import ContactError
from pipeline.problems import Problem
from pipeline.settings import Settings
from pipeline.structure.beam import BeamMode, beam_mode
from pipeline.structure.response import Damping, response
from pipeline.surface.conditioning import Conditioned, condition
from pipeline.surface.heightmap import HeightMap

MAX_INTERACTING = 2000  # caps; the dense matrix of pairs then takes 32 MB


@dataclass(frozen=True, eq=False)
class ContactState:
    """The face under its preload."""

    model: str
    model_reason: str
    preload_N: float
    approach_m: float  # from first touch, half-space bulk term included where the model has one
    approach_without_bulk_m: float
    bulk: bool  # whether the curve below holds the bulk term
    contacts: int
    overlapping_pairs: int  # of contacts: where there are any, the caps do not hold
    stiffness_N_per_m: float  # of the curve that slip uses
    contact_area_m2: float | None
    max_pressure_Pa: float | None
    load_N: np.ndarray  # of one asperity a row of the curve
    normal: NormalCurve  # the whole curve N(d)
    curve: NormalCurve  # the one that slip uses, with or without the bulk term as chosen
    composite: Composite


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
    problems: tuple[Problem, ...]
    timings_s: dict[str, float]
    started: str

    @property
    def status(self) -> str:
        """Return "ok", or "check" where a problem of at least a warning stands."""
        return "check" if any(p.severity != "info" for p in self.problems) else "ok"

    def summary(self) -> dict[str, Any]:
        """Return the dictionary of `summary.json`."""
        from pipeline.summary import summarise

        return summarise(self)


def analyze(surface: HeightMap, settings: Settings | None = None) -> Analysis:
    """Run every stage on one height map.

    Parameters
    ----------
    surface : HeightMap
        The map as measured.
    settings : Settings, optional
        All defaults where absent.

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
        If a setting makes no sense for this map.
    """
    settings = settings if settings is not None else Settings()
    started = datetime.now(UTC).isoformat(timespec="seconds")
    timings_s: dict[str, float] = {}

    def timed(stage: str, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        begin = time.perf_counter()
        result = function(*args, **options)
        timings_s[stage] = time.perf_counter() - begin
        return result

    conditioned = timed(
        "condition",
        condition,
        surface,
        form=settings.conditioning.form,
        s_filter_nesting_index_m=settings.conditioning.s_filter_nesting_index_m,
    )
    hills = timed("hills", find_hills, conditioned.surface, settings.hills.material_ratio)
    caps = timed("caps", fit_caps, conditioned.surface, hills, settings.caps.fit)
    caps, families = timed("families", group_families, caps, settings.families.count)
    problems = [*conditioned.problems, *doubts_of_caps(conditioned.surface, hills, caps, families)]

    contact = slip = beam = damping = None
    try:
        if caps.usable.any():
            contact = timed("contact", _press, surface, caps, families, settings)
            caps = _with_loads(caps, contact)
            slip = timed(
                "slip",
                slip_curve,
                contact.curve,
                contact.preload_N,
                settings.material.friction_coefficient,
                contact.composite.kappa,
            )
            beam, modal, joint = timed("structure", _stiffnesses, settings)
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
                damping,
                settings,
            )
    except ContactError as error:
        problems.append(Problem("contact_failed", "error", str(error)))
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
        problems=tuple(problems),
        timings_s=timings_s,
        started=started,
    )


def _press(
    surface: HeightMap, caps: CapTable, families: Families, settings: Settings
) -> ContactState:
    """Choose the normal curve and press the face with the preload."""
    material = composite(settings.material.youngs_modulus_Pa, settings.material.poisson_ratio)
    E_star_Pa, preload_N = material.E_star_Pa, settings.contact.preload_N
    model, reason = _choose_model(settings.contact.model, int(caps.usable.sum()))
    normal = _normal_curve(model, surface, caps, families, E_star_Pa, preload_N)
    approach_m = float(normal.approach_m(preload_N))
    overlaps = normal.overlapping_pairs(approach_m) if isinstance(normal, InteractingCurve) else 0
    curve, without_m, bulk = normal, approach_m, settings.contact.bulk
    if model in ("interacting", "mean_field"):
        bulk_m_per_N = curves.bulk_compliance_m_per_N(surface.side_m, E_star_Pa)
        without_m -= bulk_m_per_N * preload_N
        if not bulk:
            curve, bulk = _without_bulk(normal, bulk_m_per_N, preload_N)
    slip_approach_m = curve.approach_m(preload_N)
    load_N = curve.asperity_loads_N(slip_approach_m)
    touching = load_N > 0.0
    area_m2 = pressure_Pa = None
    if model != "flat":
        a_m = np.cbrt(3.0 * load_N * curve.radius_m / (4.0 * E_star_Pa))
        area_m2 = float((curve.count * np.pi * a_m**2).sum())
        pressure_Pa = float((1.5 * load_N[touching] / (np.pi * a_m[touching] ** 2)).max())
    return ContactState(
        model=model,
        model_reason=reason,
        preload_N=preload_N,
        approach_m=approach_m,
        approach_without_bulk_m=without_m,
        bulk=bulk,
        contacts=int(curve.count[touching].sum()),
        overlapping_pairs=int(overlaps),
        stiffness_N_per_m=float(curve.stiffness_N_per_m(slip_approach_m)),
        contact_area_m2=area_m2,
        max_pressure_Pa=pressure_Pa,
        load_N=load_N,
        normal=normal,
        curve=curve,
        composite=material,
    )


def _normal_curve(
    model: str,
    surface: HeightMap,
    caps: CapTable,
    families: Families,
    E_star_Pa: float,
    preload_N: float,
) -> NormalCurve:
    """Build the normal curve of a model from the usable caps."""
    use = caps.usable
    radius_m = caps.radius_m[use]
    depth_m = caps.peak_height_m[use].max() - caps.peak_height_m[use]
    if model == "flat":
        return flat(preload_N)
    if model == "families":
        members = [family for family in (families.G, families.P) if family is not None]
        top_m = members[0].peak_height_m
        return curves.families(
            [family.count for family in members],
            [family.radius_m for family in members],
            [top_m - family.peak_height_m for family in members],
            E_star_Pa,
        )
    if model == "caps":
        return curves.caps(radius_m, depth_m, E_star_Pa)
    if model == "mean_field":
        return curves.mean_field(radius_m, depth_m, E_star_Pa, surface.side_m, preload_N)
    return interacting(radius_m, depth_m, caps.x_m[use], caps.y_m[use], E_star_Pa)


def _without_bulk(
    curve: NormalCurve, bulk_m_per_N: float, preload_N: float
) -> tuple[NormalCurve, bool]:
    """Take the bulk sinking out of the curve, unless nothing would be left of its compliance."""
    rest = curves.in_series(curve, -bulk_m_per_N)
    try:
        # The compliance falls with the load: what holds at the preload holds below it.
        rest.stiffness_N_per_m(rest.approach_m(preload_N))
    except ContactError:
        return curve, True
    return rest, False


def _choose_model(model: str, n_caps: int) -> tuple[str, str]:
    if model != "auto":
        return model, "chosen in the settings"
    if n_caps == 1:
        return "caps", "one cap has no neighbour to interact with"
    if n_caps <= MAX_INTERACTING:
        return "interacting", f"elastic interaction decides which of {n_caps} caps touch"
    return "mean_field", f"{n_caps} caps are too many to solve for every pair"


def _with_loads(caps: CapTable, contact: ContactState) -> CapTable:
    """Fill the columns of load and contact radius from the state under preload."""
    load_N = np.full(len(caps), np.nan)
    if contact.model == "families":
        for name, one_N in zip("GP", contact.load_N, strict=False):
            load_N[caps.family == name] = one_N
    elif contact.model != "flat":
        load_N[caps.usable] = contact.load_N
    a_m = np.cbrt(3.0 * load_N * caps.radius_m / (4.0 * contact.composite.E_star_Pa))
    return caps.with_columns(load_N=load_N, contact_radius_m=a_m)


def _stiffnesses(settings: Settings) -> tuple[BeamMode | None, float, float]:
    """Return the stiffnesses K_m and K_s, as given or of the beam."""
    structure = settings.structure
    modal, joint = structure.modal_stiffness_N_per_m, structure.joint_stiffness_N_per_m
    if modal is not None and joint is not None:
        return None, modal, joint
    beam = beam_mode(
        length_m=structure.beam.length_m,
        width_m=structure.beam.width_m,
        thickness_m=structure.beam.thickness_m,
        density_kg_per_m3=structure.beam.density_kg_per_m3,
        youngs_modulus_Pa=settings.material.youngs_modulus_Pa[0],
        poisson_ratio=settings.material.poisson_ratio[0],
        joint_position_m=structure.beam.joint_position_m,
        theory=structure.beam.theory,
    )
    return beam, beam.modal_stiffness_N_per_m, beam.joint_stiffness_N_per_m
