"""The face under its preload: the normal curve that the settings ask for, and its state."""

from dataclasses import dataclass

import numpy as np

from capslip.caps.families import Families
from capslip.caps.table import CapTable
from capslip.contact.accuracy import MovedCaps
from capslip.contact.bulk import bulk_compliance_m_per_N, without_bulk
from capslip.contact.choice import choose_model
from capslip.contact.curve import NormalCurve
from capslip.contact.material import Composite, composite
from capslip.contact.rung import Rung, Scene, rung
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.errors import ContactError
from capslip.problems import Problem
from capslip.settings import Settings
from capslip.surface.heightmap import HeightMap


@dataclass(frozen=True, eq=False)
class ContactState:
    """The face under its preload."""

    rung: Rung
    model_reason: str
    estimated_error: float | None  # of energy and stiffness, at 95 %; None: not known
    moved: MovedCaps | None  # a part of it; None: not known, or the caps were not pressed
    preload_N: float
    approach_m: float  # from first touch, half-space bulk term included where the model has one
    bulk_m: float  # that term at the preload; 0 where the model has none
    bulk: bool  # whether the curve below holds the bulk term
    contacts: int
    overlapping_pairs: int  # of contacts: where there are any, the caps do not hold
    stiffness_N_per_m: float  # of the curve that slip uses
    contact_area_m2: float | None
    max_pressure_Pa: float | None
    use: np.ndarray  # (n,), the caps that the curve is made from; none for a model without caps
    row_family: np.ndarray  # "G", "P" or "" for each row of the curve
    normal: NormalCurve  # the whole curve N(d)
    curve: NormalCurve  # the one that slip uses, with or without the bulk term as chosen
    composite: Composite
    load_point_m: tuple[float, float]  # place (x, y) of the line of action
    eccentricity_m: tuple[float, float] | None  # of the resultant of the contacts, from there
    tilt_rad: tuple[float, float]  # slopes (x, y) that the model itself added to the map
    problems: tuple[Problem, ...]

    @property
    def model(self) -> str:
        """Name of the contact model."""
        return self.rung.name

    @property
    def approach_without_bulk_m(self) -> float | None:
        """Approach less the bulk term; None where that would be negative."""
        rest_m = self.approach_m - self.bulk_m
        return rest_m if rest_m >= 0.0 else None


def press(
    caps: CapTable,
    families: Families,
    surface: HeightMap,
    settings: Settings,
    label: np.ndarray | None = None,
    noise_m: float = 0.0,
    map_failure: str = "",
) -> tuple[ContactState, CapTable]:
    """Choose the normal curve and press the face with the preload.

    Parameters
    ----------
    caps : CapTable
        Caps of the face, at least one of them usable.
    families : Families
        Their families.
    surface : HeightMap
        Heights after removal of the form; its sides give the bulk sinking of the half-space.
    settings : Settings
        `material` and `contact`.
    label : int, shape (ny, nx), optional
        The hills of the caps, for the choice of the model.
    noise_m : float
        Standard deviation of the noise of the map, for the choice of the model.
    map_failure : str
        Why the map itself cannot be pressed, for the choice of the model.

    Returns
    -------
    ContactState, CapTable
        The state under preload, and the table with its loads and contact radii. Both are NaN where
        the model has no caps.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload within the validity of the model.
    """
    joint = composite(settings.material.youngs_modulus_Pa, settings.material.poisson_ratio)
    preload_N = settings.contact.preload_N
    use, reason, error, moved, problems = caps.usable, "chosen in the settings", None, None, []
    if settings.contact.model == "auto":
        choice = choose_model(caps, families, surface, label, noise_m, settings, map_failure)
        use, reason, error, moved = choice.use, choice.reason, choice.estimated_error, choice.moved
        model = rung(choice.model)
        problems += [] if choice.problem is None else [choice.problem]
    else:
        model = rung(settings.contact.model)
    scene = Scene.of(caps, families, surface, settings, use)
    normal: NormalCurve = model.build(scene)
    approach_m = float(normal.approach_m(preload_N))
    curve, bulk_m, bulk = normal, 0.0, settings.contact.bulk
    if model.holds_bulk:
        bulk_m_per_N = bulk_compliance_m_per_N(surface.side_m, joint.E_star_Pa)
        bulk_m = bulk_m_per_N * preload_N
        if not bulk:
            curve, bulk = without_bulk(normal, bulk_m_per_N, preload_N)
            problems += [_bulk_kept(bulk_m, approach_m)] if bulk else []
    found = model.contacts(scene, normal, approach_m)
    if settings.contact.model == "auto" and model.error is not None:
        error, doubts = model.error(normal, preload_N, settings.contact.tolerance)
        problems += doubts
    face_m2 = surface.side_m[0] * surface.side_m[1]
    if found.area_m2 is not None and found.area_m2 > face_m2:
        raise ContactError(
            f"{model.name}: {preload_N:g} N need a contact area of {found.area_m2:.3g} m2; "
            f"expected less than the face's {face_m2:.3g} m2; check preload and units"
        )
    eccentricity_m = None
    if found.resultant_m is not None:
        x_m, y_m = np.subtract(found.resultant_m, scene.load_point_m).tolist()
        eccentricity_m = (x_m, y_m)
    state = ContactState(
        rung=model,
        model_reason=reason,
        estimated_error=error,
        moved=moved,
        preload_N=preload_N,
        approach_m=approach_m,
        bulk_m=bulk_m,
        bulk=bulk,
        contacts=found.count,
        overlapping_pairs=found.overlapping_pairs,
        stiffness_N_per_m=float(curve.stiffness_N_per_m(curve.approach_m(preload_N))),
        contact_area_m2=found.area_m2,
        max_pressure_Pa=found.max_pressure_Pa,
        use=use & (model.made_from == "spheres"),
        row_family=found.family,
        normal=normal,
        curve=curve,
        composite=joint,
        load_point_m=scene.load_point_m,
        eccentricity_m=eccentricity_m,
        tilt_rad=found.tilt_rad,
        problems=(*problems, *found.problems),
    )
    a_m = contact_radius_m(found.load_N, caps.radius_m, joint.E_star_Pa)
    return state, caps.with_columns(load_N=found.load_N, contact_radius_m=a_m)


def _bulk_kept(bulk_m: float, approach_m: float) -> Problem:
    message = (
        f"the bulk sinking of the half-space, {bulk_m:.3g} m, leaves "
        f"nothing of the approach of {approach_m:.3g} m or of its compliance: it was kept, "
        "so stiffness and displacement hold it; the contact is spread over the face, or "
        "lies near its edges"
    )
    return Problem("bulk_kept", "warning", message)
