"""The ladder of normal curves from the same caps, each rung dearer and nearer to the truth."""

import numpy as np

from capslip.caps.families import Families
from capslip.caps.table import CapTable
from capslip.contact import curves
from capslip.contact.curves import NormalCurve
from capslip.contact.flat import flat
from capslip.contact.interacting import interacting
from capslip.errors import ContactError, SettingsError

RUNGS = ("families", "caps", "mean_field", "interacting")
MAX_INTERACTING = 2000  # caps; the dense matrix of pairs then takes 32 MB
REACH_MARGIN = 0.25  # of the approach: caps a little deeper are kept too


def normal_curve(
    model: str,
    caps: CapTable,
    families: Families,
    side_m: tuple[float, float],
    E_star_Pa: float,
    preload_N: float,
    use: np.ndarray | None = None,
) -> NormalCurve:
    """Build the normal curve of one rung, or of `flat`.

    Parameters
    ----------
    model : {"flat", "families", "caps", "mean_field", "interacting"}
        Name of the model.
    caps : CapTable
        Caps of the face, at least one of them usable.
    families : Families
        Their families.
    side_m : (float, float)
        Sides (ly, lx) of the face.
    E_star_Pa, preload_N : float
        Composite modulus; load of the joint.
    use : bool, shape (n,), optional
        The caps to take, the usable ones by default. The highest usable one must be among them.
    """
    use = caps.usable if use is None else use
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
    if model == "interacting":
        return interacting(radius_m, depth_m, caps.x_m[use], caps.y_m[use], E_star_Pa)
    raise SettingsError(f"contact.model: got {model!r}; expected flat or one of {', '.join(RUNGS)}")


def reachable(
    caps: CapTable, side_m: tuple[float, float], E_star_Pa: float, preload_N: float
) -> tuple[np.ndarray, NormalCurve]:
    """Find the caps that can touch below a load, and their curve with interaction.

    A cap touches only if it is higher than the approach, which counts from the highest peak. Where
    the approach of the chosen caps stays above all others, it is the approach of all.

    Parameters
    ----------
    caps, side_m, E_star_Pa, preload_N
        As for `normal_curve`.

    Returns
    -------
    bool, shape (n,), and NormalCurve
        These caps and some a little lower. Where they are too many to solve for every pair, all
        usable ones, and the curve is that of the mean field.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload.
    """
    depth_m = caps.peak_height_m[caps.usable].max() - caps.peak_height_m
    x_m, y_m, radius_m = caps.x_m, caps.y_m, caps.radius_m
    mean: NormalCurve = curves.mean_field(
        radius_m[caps.usable], depth_m[caps.usable], E_star_Pa, side_m, preload_N
    )
    approach_m, reach_m, curve = float(mean.approach_m(preload_N)), 0.0, mean
    while approach_m > reach_m:
        reach_m = (1.0 + REACH_MARGIN) * approach_m
        near = caps.usable & (depth_m <= reach_m)
        if np.count_nonzero(near) > MAX_INTERACTING:
            return caps.usable, mean
        curve = interacting(radius_m[near], depth_m[near], x_m[near], y_m[near], E_star_Pa)
        approach_m = float(curve.approach_m(preload_N))
    return near, curve


def without_bulk(
    curve: NormalCurve, bulk_m_per_N: float, preload_N: float
) -> tuple[NormalCurve, bool]:
    """Take the bulk sinking out of a curve, unless nothing would be left of its compliance.

    Returns
    -------
    NormalCurve, bool
        The curve, and whether it still holds the bulk term.
    """
    rest = curves.in_series(curve, -bulk_m_per_N)
    try:
        # The compliance falls with the load: what holds at the preload holds below it.
        approach_m = rest.approach_m(preload_N)
        stiffness_N_per_m = rest.stiffness_N_per_m(approach_m)
        left = bool(approach_m > rest.touch_m and stiffness_N_per_m > 0.0)
    except ContactError:
        left = False
    return (rest, False) if left else (curve, True)
