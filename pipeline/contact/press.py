"""The face under its preload: the normal curve that the settings ask for, and its state."""

from dataclasses import dataclass

import numpy as np

from pipeline.caps.families import Families
from pipeline.caps.table import CapTable
from pipeline.contact import curves
from pipeline.contact.curves import NormalCurve
from pipeline.contact.flat import flat
from pipeline.contact.interacting import InteractingCurve, interacting
from pipeline.contact.material import Composite, composite
from pipeline.errors import ContactError
from pipeline.settings import Settings

REACH_MARGIN = 0.25  # of the approach: caps a little deeper are tried too
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


def press(
    caps: CapTable, families: Families, side_m: tuple[float, float], settings: Settings
) -> tuple[ContactState, CapTable]:
    """Choose the normal curve and press the face with the preload.

    Parameters
    ----------
    caps : CapTable
        Caps of the face, at least one of them usable.
    families : Families
        Their families, for the model of that name.
    side_m : (float, float)
        Sides (ly, lx) of the face, for the bulk sinking of the half-space.
    settings : Settings
        `material` and `contact`.

    Returns
    -------
    ContactState, CapTable
        The state under preload, and the table with its loads and contact radii.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload within the validity of the model.
    """
    material = composite(settings.material.youngs_modulus_Pa, settings.material.poisson_ratio)
    E_star_Pa, preload_N = material.E_star_Pa, settings.contact.preload_N
    model, reason = _choose_model(settings.contact.model, int(caps.usable.sum()))
    normal = _normal_curve(model, side_m, caps, families, E_star_Pa, preload_N)
    approach_m = float(normal.approach_m(preload_N))
    overlaps = normal.overlapping_pairs(approach_m) if isinstance(normal, InteractingCurve) else 0
    curve, without_m, bulk = normal, approach_m, settings.contact.bulk
    if model in ("interacting", "mean_field"):
        bulk_m_per_N = curves.bulk_compliance_m_per_N(side_m, E_star_Pa)
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
        if area_m2 > side_m[0] * side_m[1]:
            raise ContactError(
                f"{model}: {preload_N:g} N need a contact area of {area_m2:.3g} m2; expected less "
                f"than the face's {side_m[0] * side_m[1]:.3g} m2; check preload and units"
            )
        pressure_Pa = float((1.5 * load_N[touching] / (np.pi * a_m[touching] ** 2)).max())
    state = ContactState(
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
    return state, _with_loads(caps, state)


def press_for_depth(caps: CapTable, side_m: tuple[float, float], settings: Settings) -> CapTable:
    """Fill in the loads and contact radii that decide at which depth a cap is fitted.

    Interacting caps, those alone that the face can reach; the mean field where they are too many.

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
    material = composite(settings.material.youngs_modulus_Pa, settings.material.poisson_ratio)
    E_star_Pa, preload_N = material.E_star_Pa, settings.contact.preload_N
    usable = np.flatnonzero(caps.usable)
    depth_m = caps.peak_height_m[usable].max() - caps.peak_height_m[usable]
    radius_m, x_m, y_m = caps.radius_m[usable], caps.x_m[usable], caps.y_m[usable]
    curve: NormalCurve = curves.mean_field(radius_m, depth_m, E_star_Pa, side_m, preload_N)
    approach_m, reach_m = float(curve.approach_m(preload_N)), 0.0
    near = np.ones(len(usable), dtype=bool)
    while approach_m > reach_m:  # a cap touches only where the approach exceeds its depth
        reach_m = (1.0 + REACH_MARGIN) * approach_m
        candidates = depth_m <= reach_m
        if np.count_nonzero(candidates) > MAX_INTERACTING:
            break
        near = candidates
        curve = interacting(radius_m[near], depth_m[near], x_m[near], y_m[near], E_star_Pa)
        approach_m = float(curve.approach_m(preload_N))
    load_N = np.full(len(caps), np.nan)
    load_N[usable] = 0.0
    load_N[usable[near]] = curve.asperity_loads_N(approach_m)
    a_m = np.cbrt(3.0 * load_N * caps.radius_m / (4.0 * E_star_Pa))
    return caps.with_columns(load_N=load_N, contact_radius_m=a_m)


def _normal_curve(
    model: str,
    side_m: tuple[float, float],
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
        return curves.mean_field(radius_m, depth_m, E_star_Pa, side_m, preload_N)
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
