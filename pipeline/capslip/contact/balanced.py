"""Caps pressed under a plane that may turn, and their heights over it."""

import math
from typing import Any

import numpy as np

from capslip.caps.table import CapTable
from capslip.contact.material import composite, yield_law
from capslip.contact.rung import pairs_in_balance, turning_stiffness
from capslip.contact.solvers.balance import Equilibrium
from capslip.contact.solvers.yielding import FirstLoading, first_loading, first_loading_at
from capslip.settings import Settings


def rebalanced(
    caps: CapTable,
    before: CapTable,
    use: np.ndarray,
    at_m: tuple[float, float],
    settings: Settings,
    start_m: np.ndarray | None = None,
) -> tuple[CapTable, np.ndarray]:
    """Return caps that changed at their heights over the plane that balances them.

    The compressions of those in use come with them.

    Parameters
    ----------
    caps : CapTable
        At their heights over the plane that balanced them before.
    before : CapTable
        The same caps before.
    use : bool, shape (n,)
        Those that may carry.
    at_m : (float, float)
        Load point (x, y).
    settings : Settings
        `material` and `contact`.
    start_m : float64, shape (m,), optional
        Compressions of those in use to start from.
    """
    held = (turning_stiffness(settings), np.zeros(2))
    if held[0] > 0.0:
        chosen = np.flatnonzero(use)
        arms_m = np.column_stack((caps.x_m, caps.y_m))[chosen] - at_m
        peak_m, radius_m = before.peak_height_m[chosen], before.radius_m[chosen]
        level = press_balanced(arms_m, peak_m, radius_m, settings, (math.inf, np.zeros(2)))
        held = (held[0], level.load_N @ arms_m)
    lying, rest = _balanced(caps, use, at_m, settings, held, start_m)
    return lying, rest.compression_m


def _balanced(
    caps: CapTable,
    use: np.ndarray,
    at_m: tuple[float, float],
    settings: Settings,
    held: tuple[float, np.ndarray],
    start_m: np.ndarray | None = None,
) -> tuple[CapTable, Equilibrium]:
    """Return caps at their heights over the plane that balances them, and how those in use rest.

    Parameters are those of `rebalanced`, and what holds the plane as of `press_balanced`.
    """
    chosen = np.flatnonzero(use)
    arm_m = np.column_stack((caps.x_m, caps.y_m)) - at_m
    peak_m, radius_m = caps.peak_height_m[chosen], caps.radius_m[chosen]
    start = None if start_m is None else (start_m, None)
    rest = press_balanced(arm_m[chosen], peak_m, radius_m, settings, held, start).rest
    up_m = arm_m @ np.array(rest.slope)
    return caps.with_columns(peak_height_m=caps.peak_height_m + up_m), rest


def levelled(
    caps: CapTable,
    use: np.ndarray,
    at_m: tuple[float, float],
    settings: Settings,
    at_ease_rad: tuple[float, float],
) -> tuple[CapTable, tuple[float, float]]:
    """Return caps over the plane that balances them under any preload, and its slopes (x, y).

    Against what holds it upright, which is at ease at other slopes on it.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload, or tip over.
    """
    stiffness = turning_stiffness(settings)
    held = stiffness, stiffness * np.array(at_ease_rad)
    lying, rest = _balanced(caps, use, at_m, settings, held)
    return lying, rest.slope


def press_balanced(
    arm_m: np.ndarray,
    peak_m: np.ndarray,
    radius_m: np.ndarray,
    settings: Settings,
    held: tuple[float, np.ndarray],
    start: tuple[np.ndarray, np.ndarray | None] | None = None,
    near: bool = True,
) -> FirstLoading:
    """Press caps under a plane that may turn.

    Parameters
    ----------
    arm_m : float64, shape (n, 2)
        Places (x, y) from the load point.
    peak_m, radius_m : float64, shape (n,)
        Heights of the peaks, and radii.
    settings : Settings
        `material` and `contact`.
    held : (float, float64 of shape (2,))
        Stiffness in N m/rad of what holds the plane upright, and with which moment it already does.
    start : (float64, float64 or None), optional
        Compressions and loads to start from, shape (n,) each.
    near : bool
        Whether they have their near field, too, unless contacts run together.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload.
    TipsOverError
        If the load point lies outside the hull of the places.
    """
    material, contact = settings.material, settings.contact
    E_star_Pa = composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa
    C = pairs_in_balance(arm_m, E_star_Pa, settings)
    depth_m = peak_m.max() - peak_m

    start_m, start_N = start or (None, None)
    face = yield_law(material), radius_m, depth_m, E_star_Pa, contact.preload_N
    given: dict[str, Any] = {
        "compliance_m_per_N": C,
        "start_m": start_m,
        "start_N": start_N,
        "arm": arm_m,
        "turning_stiffness": held[0],
        "moment_Nm": held[1],
    }
    return first_loading_at(arm_m, *face, **given) if near else first_loading(*face, **given)
