"""What one turn of a face hands to the next: its points turned, depths for its fits, its doubt."""

import numpy as np

from capslip.caps.fitting import Spheres
from capslip.caps.points import HillPoints
from capslip.contact.solvers.yielding import FirstLoading

TOGETHER = 0.05  # of the load, on contacts that overlap: none of clean caps do
SAME_RELIEF = 1.09  # factor by which an approach may change without telling hills apart anew
MOST_COMPARED = 500  # contacts, those of the most load


def turn_points(points: HillPoints, slope: np.ndarray, at_m: tuple[float, float]) -> None:
    """Add a plane of slopes (x, y) that vanishes at a place (x, y), in place: they fill memory."""
    for _, some in points.groups():  # some at a time: what is computed stays small
        x_m, y_m = points.places_m(some)
        points.z_m[some] += slope[0] * (x_m - at_m[0]) + slope[1] * (y_m - at_m[1])


def deeper_fits(
    depth_m: np.ndarray | None, use: np.ndarray, own_m: np.ndarray, load_N: np.ndarray, part: float
) -> tuple[np.ndarray, float]:
    """Return the depths of the next fit, and their mean relative change by load.

    A cap that carries nothing has none; those without any so far change as a whole.
    """
    new_m = np.full(len(load_N), np.nan)
    new_m[use] = np.where(load_N[use] > 0.0, own_m, np.nan)
    if depth_m is None:
        return new_m, 1.0
    known, loaded = ~np.isnan(depth_m), load_N > 0.0
    change = np.abs(np.where(known, new_m / depth_m - 1.0, 1.0))[loaded]
    old_m = np.where(known, depth_m, new_m)
    return old_m + part * (new_m - old_m), float(np.average(change, weights=load_N[loaded]))


def run_together(spheres: Spheres, use: np.ndarray, pressed: FirstLoading) -> bool:
    """Tell whether so much of the load is on contacts that overlap that the caps do not hold."""
    a_m = np.sqrt(pressed.width_m * spheres.radius_m[use])
    return load_together(spheres.x_m[use], spheres.y_m[use], a_m, pressed.load_N) > TOGETHER


def load_together(
    x_m: np.ndarray, y_m: np.ndarray, radius_m: np.ndarray, load_N: np.ndarray
) -> float:
    """Return the share of the load on contacts that overlap another one; shape (n,) each.

    Examples
    --------
    >>> x_m, a_m = np.array([0.0, 1.0, 9.0]), np.array([0.8, 0.3, 1.0])
    >>> load_together(x_m, np.zeros(3), a_m, np.array([2.0, 1.0, 1.0]))
    0.75
    """
    on = np.argsort(-load_N, kind="stable")[:MOST_COMPARED]
    on = on[load_N[on] > 0.0]
    x_m, y_m, radius_m = x_m[on], y_m[on], radius_m[on]
    apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    np.fill_diagonal(apart_m, np.inf)
    together = (radius_m[:, None] + radius_m > apart_m).any(axis=1)
    return float(load_N[on][together].sum() / load_N.sum())


def same_relief_m(before_m: float | None, approach_m: float) -> float:
    """Return an approach, or that before if it is nearly the same: hills then stay as they are."""
    if before_m is None or not 1.0 / SAME_RELIEF < approach_m / before_m < SAME_RELIEF:
        return approach_m
    return before_m
