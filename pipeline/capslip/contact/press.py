"""The face under its preload: the normal curve that the settings ask for, and its state."""

from dataclasses import dataclass

import numpy as np

from capslip.caps.families import Families
from capslip.caps.table import CapTable
from capslip.contact.boundary_elements import BoundaryElementCurve, boundary_elements
from capslip.contact.curves import NormalCurve, bulk_compliance_m_per_N
from capslip.contact.interacting import InteractingCurve
from capslip.contact.ladder import normal_curve, reachable, without_bulk
from capslip.contact.material import Composite, composite
from capslip.contact.model_choice import choose_model
from capslip.errors import ContactError
from capslip.problems import Problem
from capslip.settings import Settings
from capslip.surface.heightmap import HeightMap

WITH_BULK = ("mean_field", "interacting", "boundary_elements")


@dataclass(frozen=True, eq=False)
class ContactState:
    """The face under its preload."""

    model: str
    model_reason: str
    estimated_error: float | None  # of energy and stiffness; None: not known
    preload_N: float
    approach_m: float  # from first touch, half-space bulk term included where the model has one
    bulk_m: float  # that term at the preload; 0 where the model has none
    bulk: bool  # whether the curve below holds the bulk term
    contacts: int
    overlapping_pairs: int  # of contacts: where there are any, the caps do not hold
    stiffness_N_per_m: float  # of the curve that slip uses
    contact_area_m2: float | None
    max_pressure_Pa: float | None
    use: np.ndarray  # (n,), the caps that are rows of the curve; none for a model without caps
    normal: NormalCurve  # the whole curve N(d)
    curve: NormalCurve  # the one that slip uses, with or without the bulk term as chosen
    composite: Composite
    problems: tuple[Problem, ...]

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
    *,
    judged: bool = True,
) -> tuple[ContactState, CapTable]:
    """Choose the normal curve and press the face with the preload.

    Parameters
    ----------
    caps : CapTable
        Caps of the face, at least one of them usable.
    families : Families
        Their families, for the model of that name.
    surface : HeightMap
        Heights after removal of the form; its sides give the bulk sinking of the half-space.
    settings : Settings
        `material` and `contact`.
    label : int, shape (ny, nx), optional
        The hills of the caps, for the choice of the model.
    noise_m : float
        Standard deviation of the noise of the map, for the choice of the model.
    judged : bool
        Whether to estimate the error of a model that the settings force, which takes far longer
        than to press it.

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
    E_star_Pa, preload_N = joint.E_star_Pa, settings.contact.preload_N
    model: str = settings.contact.model
    reason, error = "chosen in the settings", None
    use, problems = caps.usable, []
    if model == "auto":
        choice = choose_model(caps, families, surface, label, noise_m, settings)
        model, reason, error, use = choice.model, choice.reason, choice.estimated_error, choice.use
        problems += [] if choice.problem is None else [choice.problem]
    elif judged and model != "boundary_elements":
        error, doubts = _doubt_of_rung(model, caps, families, surface, label, noise_m, settings)
        problems += doubts

    normal: NormalCurve
    if model == "boundary_elements":
        normal = boundary_elements(surface, E_star_Pa, settings.contact.solver_tolerance)
    else:
        normal = normal_curve(model, caps, families, surface.side_m, E_star_Pa, preload_N, use)
    approach_m = float(normal.approach_m(preload_N))
    curve, bulk_m, bulk = normal, 0.0, settings.contact.bulk
    if model in WITH_BULK:
        bulk_m_per_N = bulk_compliance_m_per_N(surface.side_m, E_star_Pa)
        bulk_m = bulk_m_per_N * preload_N
        if not bulk:
            curve, bulk = without_bulk(normal, bulk_m_per_N, preload_N)
        if bulk and not settings.contact.bulk:
            message = (
                f"the bulk sinking of the half-space, {bulk_m:.3g} m, leaves "
                f"nothing of the approach of {approach_m:.3g} m or of its compliance: it was kept, "
                "so stiffness and displacement hold it; the contact is spread over the face, or "
                "lies near its edges"
            )
            problems.append(Problem("bulk_kept", "warning", message))

    overlaps, area_m2, pressure_Pa = 0, None, None
    load_N = np.full(len(caps), np.nan)
    if isinstance(normal, BoundaryElementCurve):
        pressed = normal.pressed(preload_N)
        contacts = len(pressed.region_loads_N)
        area_m2, pressure_Pa = pressed.contact_area_m2, pressed.max_pressure_Pa
        problems += normal.problems(preload_N)
    else:
        one_N = normal.asperity_loads_N(approach_m)
        touching = one_N > 0.0
        contacts = int(normal.count[touching].sum())
        if model == "families":
            for name, N in zip("GP", one_N, strict=False):
                load_N[caps.family == name] = N
        elif model != "flat":
            load_N[caps.usable] = 0.0
            load_N[use] = one_N
        if model != "flat":
            a_m = np.cbrt(3.0 * one_N * normal.radius_m / (4.0 * E_star_Pa))
            area_m2 = float((normal.count * np.pi * a_m**2).sum())
            pressure_Pa = float((1.5 * one_N[touching] / (np.pi * a_m[touching] ** 2)).max())
        if isinstance(normal, InteractingCurve):
            overlaps = normal.overlapping_pairs(approach_m)
    face_m2 = surface.side_m[0] * surface.side_m[1]
    if area_m2 is not None and area_m2 > face_m2:
        raise ContactError(
            f"{model}: {preload_N:g} N need a contact area of {area_m2:.3g} m2; expected less than "
            f"the face's {face_m2:.3g} m2; check preload and units"
        )
    state = ContactState(
        model=model,
        model_reason=reason,
        estimated_error=error,
        preload_N=preload_N,
        approach_m=approach_m,
        bulk_m=bulk_m,
        bulk=bulk,
        contacts=contacts,
        overlapping_pairs=int(overlaps),
        stiffness_N_per_m=float(curve.stiffness_N_per_m(curve.approach_m(preload_N))),
        contact_area_m2=area_m2,
        max_pressure_Pa=pressure_Pa,
        use=use if model not in ("flat", "boundary_elements") else np.zeros(len(caps), dtype=bool),
        normal=normal,
        curve=curve,
        composite=joint,
        problems=tuple(problems),
    )
    return state, _loaded(caps, load_N, E_star_Pa)


def _doubt_of_rung(
    model: str,
    caps: CapTable,
    families: Families,
    surface: HeightMap,
    label: np.ndarray | None,
    noise_m: float,
    settings: Settings,
) -> tuple[float | None, list[Problem]]:
    """Return the estimated error of a model that the settings force, and whether it is too great.

    None where it is not known: for `flat`, which has no caps, and where interacting caps, against
    which the lower rungs are measured, cannot carry the load.
    """
    if model == "flat":
        message = (
            "a flat interface loses nothing below total slip: its damping is none of the face, and "
            "its error is not known; contact.model = auto presses the caps"
        )
        return None, [Problem("model_doubtful", "warning", message)]
    try:
        choice = choose_model(caps, families, surface, label, noise_m, settings)
        estimate, why = choice.estimates.get(model), ""
    except ContactError as failure:
        estimate, why = None, f" ({failure})"
    tolerance = settings.contact.tolerance
    if estimate is not None and estimate <= tolerance:
        return estimate, []
    off = (
        f"not known{why}"
        if estimate is None
        else f"about {estimate:.2g}, more than {tolerance:.2g}"
    )
    message = (
        f"the error of {model} is {off}; contact.model = auto takes the cheapest model that is "
        f"within {tolerance:.2g}"
    )
    return estimate, [Problem("model_doubtful", "warning", message)]


def press_for_depth(caps: CapTable, side_m: tuple[float, float], settings: Settings) -> CapTable:
    """Fill in the loads and contact radii that decide at which depth a cap is fitted.

    Interacting caps, those alone that can touch; the mean field where they are too many.

    Parameters
    ----------
    caps : CapTable
        Caps of one face, at least one of them usable.
    side_m : (float, float)
        Sides (ly, lx) of the face.
    settings : Settings
        `material` and `contact`.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload.
    """
    joint = composite(settings.material.youngs_modulus_Pa, settings.material.poisson_ratio)
    preload_N = settings.contact.preload_N
    use, curve = reachable(caps, side_m, joint.E_star_Pa, preload_N)
    load_N = np.where(caps.usable, 0.0, np.nan)
    load_N[use] = curve.asperity_loads_N(curve.approach_m(preload_N))
    return _loaded(caps, load_N, joint.E_star_Pa)


def _loaded(caps: CapTable, load_N: np.ndarray, E_star_Pa: float) -> CapTable:
    a_m = np.cbrt(3.0 * load_N * caps.radius_m / (4.0 * E_star_Pa))
    return caps.with_columns(load_N=load_N, contact_radius_m=a_m)
