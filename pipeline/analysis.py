"""The stages in order: height map, hills, caps, families, contact, slip, damping."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from pipeline.caps.families import Families, group_families
from pipeline.caps.fit import fit_caps
from pipeline.caps.hills import Hills, find_hills
from pipeline.caps.table import CapTable
from pipeline.contact.press import ContactState, press
from pipeline.contact.slip import SlipCurve, slip_curve
from pipeline.doubts import doubts_of_caps, doubts_of_contact
from pipeline.errors import ContactError
from pipeline.problems import Problem
from pipeline.settings import Settings
from pipeline.structure.beam import BeamMode
from pipeline.structure.response import Damping, response
from pipeline.structure.stiffness import stiffnesses
from pipeline.surface.conditioning import Conditioned, condition
from pipeline.surface.heightmap import HeightMap


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
            contact, caps = timed("contact", press, caps, families, surface.side_m, settings)
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
