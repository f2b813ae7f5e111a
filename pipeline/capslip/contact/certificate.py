"""What stands in the pressed plane though no cap stands for it.

Two stages ask. Whether a cut went deep enough: noise is then no proof that something stands in the
way. And whether caps are all that touches: then any doubt counts.
"""

import math
from itertools import product

import numpy as np

from capslip.contact.models.interacting import InteractingCurve
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.surface.blocks import means_of_blocks
from capslip.surface.heightmap import HeightMap
from capslip.surface.rows import BLOCK_POINTS, row_blocks

BLOCKS = 100  # along the shorter side of the map, over which heights are averaged
NOISE_SPREADS = 2.0  # standard deviations of a mean height that may hide a contact
CERTAIN_SPREADS = 5.0  # by which one of many hills that all but touch is not there by chance
MODEL_ERROR = 0.02  # of the sinking: what point loads may be off
NEAR = 1.5  # contact radii within which the shape of a cap is the fit's matter, not the cut's
RESOLVED = 20.0  # pixels, from which radius on what rises between them carries next to nothing
TINY_M = 1e-30  # in place of no bend at all
AT_ONCE = 2_000_000  # pairs of a block and a contact


def certify_cut(
    surface: HeightMap,
    label: np.ndarray,
    plane_m: float,
    caps_m: np.ndarray,
    load_N: np.ndarray,
    E_star_Pa: float,
    noise_m: float = 0.0,
) -> float:
    """Return the area outside the hills that stands above the deformed surface of contact.

    Where there is any, the cut was too high for it.

    Parameters
    ----------
    surface : HeightMap
        Heights in the frame in which the pressed plane is level.
    label : int, shape (ny, nx)
        Hills, 1 ... n; 0 outside.
    plane_m : float
        Height of the plane: that of the peaks less how far it has come down.
    caps_m : float64, shape (3, m)
        x, y and radius of the caps that carry load.
    load_N : float64, shape (m,)
        Their loads, positive.
    E_star_Pa : float
        Composite modulus.
    noise_m : float
        Standard deviation of the noise, point by point.

    Returns
    -------
    float
        In m2; zero where the cut went deep enough.

    Notes
    -----
    Heights are averaged over squares of a hundredth of the shorter side, and one is outside the
    hills where most of its middle is: one point, or four. The plane follows the surface that sinks
    around each contact as around a Hertz contact (Johnson 1985, Eq. 3.42), so a mean height z is in
    the way where z - plane > sum N_i f(a_i / r_i) / (pi E* r_i). It is evaluated only where z
    stands above the plane. Within 1.5 contact radii the surface belongs to that contact.
    """
    side, (top, left) = _squares(surface.shape)
    dy_m, dx_m = surface.pixel_size_m
    contacts = np.vstack((caps_m[:2], np.cbrt(0.75 * load_N * caps_m[2] / E_star_Pa), load_N))
    mean_m = means_of_blocks(surface, side, side**2 // 2 + 1, (top, left))
    n_rows, n_cols = mean_m.shape
    on_hill = sum(
        (label[top + i :: side, left + j :: side][:n_rows, :n_cols] > 0).astype(np.int8)
        for i, j in product(((side - 1) // 2, side // 2), repeat=2)
    )
    mean_m[on_hill >= 2] = np.nan
    beyond_m = NOISE_SPREADS * noise_m / side
    near_m = NEAR * contacts[2]
    excess_m = _excess(surface, mean_m, plane_m + beyond_m, contacts, E_star_Pa, near_m)
    return float(np.count_nonzero(excess_m > 0.0) * (side**2 * dy_m * dx_m))


def unmodelled_area_m2(
    surface: HeightMap,
    label: np.ndarray,
    curve: InteractingCurve,
    approach_m: float,
    peak_height_m: float,
    noise_m: float,
    half_axis_m: np.ndarray | None = None,
) -> float:
    """Return the area that the pressed plane may reach outside the hills, or does beside contacts.

    A cap stands for its hill, and the fit answers for how well. Not so far beside the contact: a
    burr or another top on the flank touches where no fit looks, and carries little, but a small
    contact slips first.

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
        Standard deviation of the noise, point by point: it may hide that something touches.
    half_axis_m : float64, shape (m,), optional
        The longer one of each contact that carries load; by default contacts are circles.

    Returns
    -------
    float
        Zero where only caps touch, as far as noise lets one see.
    """
    side, _ = _squares(surface.shape)
    plane_m = peak_height_m - approach_m
    load_N = curve.asperity_loads_N(approach_m)
    at = load_N > 0.0
    a_m = contact_radius_m(load_N[at], curve.radius_m[at], curve.E_star_Pa)
    contacts = np.vstack((curve.x_m[at], curve.y_m[at], a_m, load_N[at]))
    near_m = NEAR * (a_m if half_axis_m is None else half_axis_m)
    spread_m, n = noise_m / side, 0
    for on_hills, least_m, beside_m in (
        (False, plane_m - NOISE_SPREADS * spread_m, None),
        (True, plane_m + CERTAIN_SPREADS * spread_m, near_m),
    ):
        mean_m = _means_of(surface, label, on_hills, least_m)
        excess_m = _excess(surface, mean_m, least_m, contacts, curve.E_star_Pa, beside_m)
        n += int(np.count_nonzero(excess_m > 0.0))
    if n > 0:
        return float(n * side**2 * surface.pixel_area_m2)
    return _tops_above_m2(surface, contacts, near_m, plane_m, approach_m, curve.E_star_Pa, noise_m)


def hertz_over_point_load(rho: np.ndarray) -> np.ndarray:
    """Return the sinking around a Hertz contact over that around a point load, N / (pi E* r).

    Johnson's Eq. 3.42 with rho = a / r (1.18 at the rim of the contact, 1.02 at r = 2 a):

    3 / (4 rho^3) [(2 rho^2 - 1) asin(rho) + rho sqrt(1 - rho^2)], which cancels for small rho;
    there 1 + rho^2 / 10 + 9 rho^4 / 280 serves.
    """
    rho = np.minimum(rho, 1)  # beyond, the contacts overlap
    wide = np.where(rho > 0.03, rho, 1)
    exact = (2 * wide**2 - 1) * np.arcsin(wide) + wide * np.sqrt(1 - wide**2)
    return np.where(rho > 0.03, 0.75 * exact / wide**3, 1 + rho**2 / 10 + 9 * rho**4 / 280)


def _squares(shape: tuple[int, int]) -> tuple[int, tuple[int, int]]:
    """Return the side of squares of points, and row and column where the first of them begins.

    What is left over falls away on both sides alike, so that a mirrored map has the same squares:
    along a side of odd length no even squares do.
    """
    side = max(1, min(shape) // BLOCKS)
    if any(n % 2 for n in shape):
        side -= 1 - side % 2
    top, left = ((n % side + n % side % 2 * side) // 2 for n in shape)
    return side, (top, left)


def _excess(
    surface: HeightMap,
    mean_m: np.ndarray,
    plane_m: float,
    contacts: np.ndarray,
    E_star_Pa: float,
    near_m: np.ndarray | None,
) -> np.ndarray:
    """Return by how much the blocks that stand above the plane do so where it is sunk.

    Of the mean heights of all blocks. The contacts, shape (4, m), are x, y, radius and load. What
    is to be proven lies beyond the error of the model, and farther from every contact than its
    `near_m`; None where any doubt counts.
    """
    side, (top, left) = _squares(surface.shape)
    dy_m, dx_m = surface.pixel_size_m
    error = 0.0 if near_m is None else MODEL_ERROR
    reach_m = mean_m - plane_m
    row, col = np.nonzero(reach_m > 0.0)  # False where nothing was measured
    x_m, y_m = (left + (col + 0.5) * side) * dx_m, (top + (row + 0.5) * side) * dy_m
    place_m = np.stack([x_m, y_m])
    return _beyond_sunk(reach_m[row, col], place_m, contacts, E_star_Pa, near_m, error)


def _beyond_sunk(
    reach_m: np.ndarray,
    place_m: np.ndarray,
    contacts: np.ndarray,
    E_star_Pa: float,
    near_m: np.ndarray | None,
    error: float,
) -> np.ndarray:
    """Return by how much what reaches above the plane at places, (2, n), does so where it sinks."""
    a_m, load_N = contacts[2:]
    excess_m = np.full(reach_m.size, -np.inf)
    for part in np.array_split(np.arange(reach_m.size), 1 + reach_m.size * a_m.size // AT_ONCE):
        r_m = np.hypot(*(place_m[:, part, None] - contacts[:2, None]))
        beside = near_m is None or (r_m >= near_m).all(axis=1)
        r_m = np.maximum(r_m, a_m)  # within a contact at least as at its rim
        # Point loads sink the surface less than contacts do, and most places are past even them.
        least_m = (load_N / r_m).sum(axis=1) / (math.pi * E_star_Pa)
        left = (reach_m[part] > least_m) & beside
        share_N_per_m = load_N * hertz_over_point_load(a_m / r_m[left]) / r_m[left]
        sunk_m = share_N_per_m.sum(axis=1) * (1.0 + error) / (math.pi * E_star_Pa)
        excess_m[part[left]] = reach_m[part[left]] - sunk_m
    return excess_m


def _tops_above_m2(
    surface: HeightMap,
    contacts: np.ndarray,
    near_m: np.ndarray,
    plane_m: float,
    approach_m: float,
    E_star_Pa: float,
    noise_m: float,
) -> float:
    """Return the area of pixels that do not reach the plane, and beside which the face does.

    As far below it as another hill as round as the widest contact rises from an outermost pixel,
    two contact radii beside its top, to the edge of the face.
    """
    pixels_wide = float(contacts[2].max()) / max(surface.pixel_size_m)
    if pixels_wide >= RESOLVED:
        return 0.0
    certain_m = plane_m + CERTAIN_SPREADS * noise_m
    least_m = plane_m - min(1.0, 2.0 / pixels_wide) * approach_m
    place_m, height_m, top_m = _tops(surface, least_m)
    place_m, height_m, top_m = (one[..., top_m > certain_m] for one in (place_m, height_m, top_m))
    face = place_m, contacts, E_star_Pa, near_m + math.hypot(*surface.pixel_size_m), MODEL_ERROR
    beside_m, of_pixel_m = (_beyond_sunk(one - certain_m, *face) for one in (top_m, height_m))
    above = (beside_m > 0.0) & (of_pixel_m <= 0.0)
    return float(np.count_nonzero(above) * surface.pixel_area_m2)


def _tops(surface: HeightMap, least_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places, (2, n), and heights of pixels, and how high the face stands beside them.

    Of those that are higher than `least_m` and than their neighbours: along each axis as high as
    the parabola through them, at an edge of the face as that is half a pixel further.
    """
    index, nx = [], surface.shape[1]
    for rows in row_blocks(surface.shape):
        index.append(np.flatnonzero(surface[rows] > least_m) + rows.start * nx)
    row, col = np.divmod(np.concatenate(index), nx)
    height_m = top_m = surface[row, col]
    for axis in (1, 0):
        beside, beyond = [], []
        for step in (-1, 1):
            place = [row, col]
            place[axis] = place[axis] + step
            beyond.append(surface.is_outside(*place))
            place[axis] = np.where(beyond[-1], place[axis] - step, place[axis])
            beside.append(height_m - surface[tuple(place)])
        down_m, up_m = beside
        rise_m = np.square(down_m - up_m) / (8.0 * np.maximum(down_m + up_m, TINY_M))
        at_edge, inward = beyond[0] | beyond[1], np.where(beyond[0], 1, -1)
        rise_m[at_edge] = _rise_to_edge_m(
            surface, row[at_edge], col[at_edge], axis, inward[at_edge]
        )
        top_m = top_m + rise_m
        highest = (down_m >= 0.0) & (up_m >= 0.0)  # False beside what was not measured
        row, col, height_m, top_m = (one[highest] for one in (row, col, height_m, top_m))
    dy_m, dx_m = surface.pixel_size_m
    return np.stack(((col + 0.5) * dx_m, (row + 0.5) * dy_m)), height_m, top_m


def _rise_to_edge_m(
    surface: HeightMap, row: np.ndarray, col: np.ndarray, axis: int, inward: np.ndarray
) -> np.ndarray:
    """Return how much higher the edge of the face is than the outermost points, on a parabola."""
    points, last = [], surface.shape[axis] - 1
    for n in (0, 1, 2):
        place = [row, col]
        place[axis] = np.clip(place[axis] + n * inward, 0, last)
        points.append(surface[tuple(place)])
    outermost_m, next_m, third_m = points
    return np.asarray(0.5 * (outermost_m - next_m) + 0.375 * (outermost_m - 2.0 * next_m + third_m))


def _means_of(surface: HeightMap, label: np.ndarray, on_hills: bool, least_m: float) -> np.ndarray:
    """Mean heights of what lies on hills or outside, NaN where that has no point above a height.

    Without such a point the mean is not high either.
    """
    side, (top, left) = _squares(surface.shape)
    n_rows, n_cols = (
        (n - begin) // side for n, begin in zip(surface.shape, (top, left), strict=True)
    )
    mean_m, inside = np.full((n_rows, n_cols), np.nan), np.arange(side)
    # What falls away on the sides lies in a square more on each
    high = np.zeros((n_rows + 2, n_cols + 2), dtype=bool)
    for block in row_blocks(surface.shape):
        above = np.flatnonzero((surface[block] > least_m) & ((label[block] > 0) == on_hills))
        row, col = np.divmod(above, surface.shape[1])
        high[(row + block.start - top) // side + 1, (col - left) // side + 1] = True
    row, col = np.nonzero(high[1:-1, 1:-1])
    for some in np.array_split(np.arange(row.size), 1 + row.size * side**2 // BLOCK_POINTS):
        points = (
            top + row[some, None, None] * side + inside[:, None],
            left + col[some, None, None] * side + inside,
        )
        heights_m = np.where((label[points] > 0) == on_hills, surface[points], np.nan)
        mean_m[row[some], col[some]] = _known_means(heights_m)
    return mean_m


def _known_means(points_m: np.ndarray) -> np.ndarray:
    """Mean heights of squares of points, NaN where half of them or more are not known."""
    known = ~np.isnan(points_m)
    count = known.sum(axis=(1, 2))
    mean_m = np.where(known, points_m, 0.0).sum(axis=(1, 2)) / np.maximum(count, 1)
    return np.asarray(np.where(count > 0.5 * np.prod(points_m.shape[1:]), mean_m, np.nan))
