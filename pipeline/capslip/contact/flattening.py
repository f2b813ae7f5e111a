"""The caps after their first loading: those that yielded are flatter and lower, all are elastic."""

from dataclasses import replace
from typing import Any, cast

import numpy as np

from capslip.caps.families import Families, Family
from capslip.contact.bulk import bulk_of_face_m_per_N, without_bulk
from capslip.contact.curve import NormalCurve
from capslip.contact.rung import Rung, Scene
from capslip.contact.solvers.yielding import (
    FirstLoading,
    YieldLaw,
    first_loading,
    first_loading_at,
)
from capslip.errors import ContactError


def flattened(model: Rung, scene: Scene) -> Scene:
    """Return the scene that a model of spheres unloads: it was loaded to its preload once.

    Slip follows the curve along which the face unloads (`docs/theory.md`), and on that a cap that
    yielded is an elastic one with another radius and another peak. Each model shares the load in
    its own way, so each has its own scene: of families the families are flattened, else the caps.

    Parameters
    ----------
    model : Rung
        A model of the map itself, or of nothing, leaves the scene as it is.
    scene : Scene
        Before any load.

    Raises
    ------
    ContactError
        If no equilibrium is found, or a contact is wider than its asperity was before.
    """
    if scene.law is None or model.made_from != "spheres":
        return scene
    if model.knows_places:
        return _of_caps(model, scene)
    face = scene.law, scene.E_star_Pa, scene.preload_N
    return replace(scene, families=flattened_families(scene.families, *face))


def loaded_first(
    model: Rung,
    scene: Scene,
    known: dict[float, NormalCurve],
    bulk: bool,
    load_N: float,
    hardness_factor: float = 1.0,
    place_m: tuple[float, float] | None = None,
) -> NormalCurve:
    """Return the curve for slip of a face, after another first loading than its own.

    Its approach counts from the highest peak as it was before: the first touch is where flattening
    left that peak, see `touch_m`.

    Parameters
    ----------
    model : Rung
        One that knows yielding.
    scene : Scene
        Before any load; of spheres that yield.
    known : dict of float to NormalCurve
        By their load, what is known after other first loadings, with the bulk sinking where the
        model has one: at first the curve after its own, whose tilt is held on a map. A map begins
        at that under the next greater load, and what is found joins them.
    bulk : bool
        Whether the curve holds the bulk sinking, where the model has one.
    load_N : float
        Of the first loading.
    hardness_factor : float
        On the hardness.
    place_m : (float, float), optional
        Where this load is to act on a map, (x, y), which turns until it does.

    Raises
    ------
    ContactError
        If no equilibrium is found, or the bulk cannot be taken off.
    """
    if model.after is not None:
        near_N = min((N for N in known if load_N <= N), default=scene.preload_N)
        by = load_N / near_N, hardness_factor, place_m
        curve: Any = model.after(known[near_N], near_N, *by)
        if hardness_factor == 1.0:
            known[load_N] = curve
    else:
        assert scene.law is not None
        law = replace(scene.law, hardness_Pa=scene.law.hardness_Pa * hardness_factor)
        scene = replace(scene, preload_N=load_N, law=law)
        after = flattened(model, scene)
        curve = model.build(after)
        curve = replace(curve, depth_m=curve.depth_m + left_m(model, scene, after, curve))
    if bulk or not model.holds_bulk:
        return cast(NormalCurve, curve)
    bulk_m_per_N = bulk_of_face_m_per_N(scene.surface, scene.E_star_Pa)
    curve, is_left = without_bulk(curve, bulk_m_per_N, load_N)
    if is_left:
        raise ContactError(
            f"{model.name}: under {load_N:g} N the bulk sinking leaves nothing of the compliance, "
            "as it does under the preload; keep the bulk term (contact.bulk)"
        )
    return cast(NormalCurve, curve)


def left_m(model: Rung, before: Scene, after: Scene, curve: Any) -> float | None:
    """Return by how much nearer two faces are for good after their first loading.

    Parameters
    ----------
    model : Rung
        One that knows yielding.
    before, after : Scene
        Before any load, and as `flattened` gives it.
    curve : NormalCurve
        That of the model, along which the face unloads from its preload.

    Returns
    -------
    float or None
        None for a face that stays elastic, or a model of nothing.
    """
    if before.law is None or model.made_from == "nothing":
        return None
    if model.made_from == "spheres":
        return _top_m(model, before) - _top_m(model, after)
    return float(curve.first.of_face_m - curve.approach_m(before.preload_N))


def _top_m(model: Rung, scene: Scene) -> float:
    if model.knows_places:
        return float(scene.caps.peak_height_m[scene.use].max())
    return top_m(scene.families)


def top_m(families: Families) -> float:
    """Return the height of the higher family."""
    members = (families.G, families.P)
    return max(one.peak_height_m for one in members if one is not None)


def _of_caps(model: Rung, scene: Scene) -> Scene:
    caps, use = scene.caps, scene.use
    curve = model.build(scene)
    after = first_loading_at(
        np.column_stack((caps.x_m, caps.y_m))[use],
        *(scene.law, scene.radius_m, scene.depth_m, scene.E_star_Pa, scene.preload_N),
        compliance_m_per_N=getattr(curve, "pair_compliance_m_per_N", None),
        start_m=getattr(curve, "start_m", scene.start_m),
    )
    _refuse_wider(model.name, after, scene.radius_m, scene.preload_N)
    if (after.radius_m == scene.radius_m).all():
        return scene  # with its own start: where contacts run together there are several balances
    radius_m, peak_m = caps.radius_m.copy(), caps.peak_height_m.copy()
    radius_m[use] = after.radius_m
    peak_m[use] -= after.depth_m - scene.depth_m
    flat = caps.with_columns(radius_m=radius_m, peak_height_m=peak_m)
    return replace(scene, caps=flat, start_m=after.compression_m)


def flattened_families(
    families: Families, law: YieldLaw | None, E_star_Pa: float, preload_N: float
) -> Families:
    """Return the families after their first loading, each as a whole; see `flattened`."""
    members = [one for one in (families.G, families.P) if one is not None]
    if law is None or not members:
        return families
    peak_m = np.array([one.peak_height_m for one in members])
    radius_m, depth_m = np.array([one.radius_m for one in members]), peak_m.max() - peak_m
    count = np.array([float(one.count) for one in members])
    after = first_loading(law, radius_m, depth_m, E_star_Pa, preload_N, count=count)
    _refuse_wider("given families", after, radius_m, preload_N)
    lower_m = after.depth_m - depth_m
    flat = iter(zip(after.radius_m.tolist(), (peak_m - lower_m).tolist(), strict=True))

    def of(family: Family | None) -> Family | None:
        if family is None:
            return None
        radius_m, peak_m = next(flat)
        return replace(family, radius_m=radius_m, peak_height_m=peak_m)

    return replace(families, G=of(families.G), P=of(families.P))


def _refuse_wider(model: str, after: FirstLoading, radius_m: np.ndarray, load_N: float) -> None:
    """Refuse contacts that are wider than their asperities as these were before they yielded.

    The flattened ones have a radius at which any contact is narrow.
    """
    wide = (after.load_N > 0.0) & (after.width_m > radius_m)
    if not wide.any():
        return
    at = int(np.argmax(np.where(wide, after.width_m / radius_m, 0.0)))
    a_m = float(np.sqrt(after.width_m[at] * radius_m[at]))
    raise ContactError(
        f"{model}: a load of {load_N:g} N makes a contact wider than its asperity: of {a_m:.3g} m "
        f"on a radius of {radius_m[at]:.3g} m as it yields; expected less load or more hardness; "
        "check the units of load, hardness and radius"
    )
