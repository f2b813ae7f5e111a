"""What lies outside the hills of a face and would touch, though no cap stands for it."""

import math

import numpy as np

from capslip.contact.models.interacting import InteractingCurve, hertz_over_point_load
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.surface.blocks import block_sums
from capslip.surface.heightmap import HeightMap

BLOCKS = 100  # along the shorter side of the map, over which heights are averaged
NOISE_SPREADS = 2.0  # standard deviations of a mean height that may hide a contact
AT_ONCE = 2_000_000  # pairs of a block and a contact


def unmodelled_area_m2(
    surface: HeightMap,
    label: np.ndarray,
    curve: InteractingCurve,
    approach_m: float,
    peak_height_m: float,
    noise_m: float,
) -> float:
    """Return the area outside the hills that the pressed plane would reach.

    Every contact sinks the surface around it as a Hertz contact does, which close to its rim is up
    to 18 % more than under a point load. Where the map stands higher than the plane after that,
    something carries that the caps do not.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    label : int, shape (ny, nx)
        0 outside the hills.
    curve : InteractingCurve
        Of the caps on these hills.
    approach_m : float
        Its approach under the load.
    peak_height_m : float
        Height of the highest cap, from which the approach counts.
    noise_m : float
        Standard deviation of the noise, point by point.

    Returns
    -------
    float
        Zero where only caps touch, as far as noise lets one see.
    """
    side = max(1, min(surface.shape) // BLOCKS)
    dy_m, dx_m = surface.pixel_size_m
    free = surface.measured & (label == 0)
    count = block_sums(free.astype(float), side)
    height_m = np.full(count.shape, -np.inf)
    known = count > 0.5 * side**2
    height_m[known] = block_sums(np.where(free, surface.height_m, 0.0), side)[known] / count[known]
    height_m += NOISE_SPREADS * noise_m / side

    reach_m = height_m - (peak_height_m - approach_m)  # over the plane, before the face sinks
    row, col = np.nonzero(reach_m > 0.0)
    x_m, y_m = (col + 0.5) * side * dx_m, (row + 0.5) * side * dy_m
    load_N = curve.asperity_loads_N(approach_m)
    at = load_N > 0.0
    touching = 0
    for part in np.array_split(np.arange(row.size), 1 + row.size * int(at.sum()) // AT_ONCE):
        r_m = np.hypot(x_m[part, None] - curve.x_m[at], y_m[part, None] - curve.y_m[at])
        a_m = contact_radius_m(load_N[at], curve.radius_m[at], curve.E_star_Pa)
        r_m = np.maximum(r_m, a_m)  # within a contact at least as at its rim
        share_N = load_N[at] * hertz_over_point_load(a_m / r_m) / r_m
        sinking_m = share_N.sum(axis=1) / (math.pi * curve.E_star_Pa)
        touching += int((reach_m[row[part], col[part]] > sinking_m).sum())
    return touching * side**2 * dy_m * dx_m
