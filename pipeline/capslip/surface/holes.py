"""Holes of a map: what may stand where nothing was measured, or was filled."""

import numpy as np

from capslip.problems import Problem
from capslip.surface.doubts import HIGHEST_SHARE, VISIBLE_FORM
from capslip.surface.heightmap import HeightMap
from capslip.surface.outline import between

BLOCK_OVER_DISC = 0.1  # sides of the squares that a hole is looked at in, over a hill's radius
HIDDEN = 0.25  # of a contact's radius: what is farther from all measured points is not known
QUARTER = 0.25  # of what lies around a hole is lower than its rim
MISSED = 0.01  # of the hills of usual size, where points are measured here and there

TURNS = np.s_[::-1, ::-1], np.s_[::-1], np.s_[:, ::-1]  # half around, and turned over
UNLIKE = 0.5  # of the outside: one corner alone is unlike by twice its own area


def problems_of_holes(surface: HeightMap, hill_radius_m: float) -> tuple[Problem, ...]:
    """Say where a hole of the map may hide a hill that carries load.

    A hill of which no point was measured leaves no trace. It fits into a hole that holds a disc of
    its size. What lies beyond the measured points along both its row and its column is no hole, but
    outside of a face that is not rectangular.

    Parameters
    ----------
    surface : HeightMap
        The map whose hills were found.
    hill_radius_m : float
        Radius of the disc that a usual hill covers above the cut.

    Returns
    -------
    tuple of Problem
        `hole_may_hide_hills` (warning) where the largest disc in a hole is not smaller, or where
        points that stand alone miss one of such discs in a hundred.
    """
    filling = surface.filling
    if filling is not None and filling.chance_to_miss(hill_radius_m) > MISSED:
        message = (
            f"the measured points stand alone, {filling.density_m2 * 1e-6:.3g} of them a mm2: they "
            f"miss {filling.chance_to_miss(hill_radius_m):.1%} of hills with a disc of "
            f"{hill_radius_m:.3g} m radius, as a usual one has it; hills that carry load may lie "
            "between them, and are not counted; measure what is missing"
        )
        return (Problem("hole_may_hide_hills", "warning", message),)
    radius_m = 0.0
    if not surface.complete:
        radius_m = disc_within_m(holes(surface), surface, hill_radius_m)
    if radius_m == 0.0:
        return ()
    message = (
        f"a hole in the map holds a disc of {radius_m:.3g} m radius, a usual hill covers one of "
        f"{hill_radius_m:.3g} m: hills that carry load may lie in it, and are not counted"
    )
    return (Problem("hole_may_hide_hills", "warning", message),)


def problems_of_filling(surface: HeightMap, approach_m: float) -> list[Problem]:
    """Return that a map was filled between points that stand alone, and how well that is known.

    Parameters
    ----------
    surface : HeightMap
        The face, with its `filling`.
    approach_m : float
        Of the contact.

    Returns
    -------
    list of Problem
        `points_filled`: info, or a warning where the error of what was filled is more than a tenth
        of the approach.
    """
    filling = surface.filling
    if filling is None:
        return []
    message = (
        f"{filling.missing:.1%} of the points were missing here and there, and were filled by "
        f"{filling.way} interpolation between those measured; measured points that are left out "
        f"are filled with an rms error of {filling.error_m:.2g} m in the highest "
        f"{HIGHEST_SHARE:.0%}, and the approach is {approach_m:.3g} m"
    )
    decides = 0.0 < VISIBLE_FORM * approach_m < filling.error_m
    return [Problem("points_filled", "warning" if decides else "info", message)]


def holes(surface: HeightMap) -> np.ndarray:
    """Return which points are holes, shape (ny, nx): not measured, between two that are."""
    return between(surface.measured)


def outside_as_made(surface: HeightMap) -> bool:
    """Tell whether the outside of a face is that of a part as it is made: on both sides alike.

    A disc, a washer or a rectangle that lies askew goes into itself when its map is turned or
    turned over; a rectangle without one of its corners does not.
    """
    out = surface.outside[surface.measured_window]
    unlike = min(int(np.count_nonzero(out ^ out[turn])) for turn in TURNS)
    return unlike <= UNLIKE * int(np.count_nonzero(out))


def disc_within_m(mask: np.ndarray, surface: HeightMap, hill_radius_m: float) -> float:
    """Return the radius of the largest disc in a mask, its middle on the map; 0 below a hill's."""
    # Such a disc holds a square of half its radius as a whole, wherever the squares begin
    if not _blocks(mask, surface, 0.5 * hill_radius_m).any():
        return 0.0
    radius_m = float(depth_of_holes(surface, hill_radius_m, mask)[2].max(initial=0.0))
    return radius_m if radius_m >= hill_radius_m else 0.0


def depth_of_holes(
    surface: HeightMap, hill_radius_m: float, hole: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Return where something may stand in the holes of a map, and how far from what was measured.

    Parameters
    ----------
    surface : HeightMap
        With holes, or none.
    hill_radius_m : float
        Of the disc of a usual hill, by which the squares are chosen that are looked at.
    hole : bool, shape (ny, nx), optional
        Default: the `holes`.

    Returns
    -------
    x_m, y_m : float64, shape (n,)
        Centres of squares that lie in a hole as a whole.
    depth_m : float64, shape (n,)
        Of a disc about each of them, of which nothing was measured.
    rim_m : float64, shape (n,)
        Which three quarters of what was measured around the hole of each exceed; NaN where nothing.
    area_m2 : float
        Of one square.
    """
    from scipy.ndimage import distance_transform_edt

    hole = holes(surface) if hole is None else hole
    side_m = BLOCK_OVER_DISC * hill_radius_m
    blocks, steps = _blocks(hole, surface, side_m), _block_steps(surface, side_m)
    block_y_m, block_x_m = (
        step * size_m for step, size_m in zip(steps, surface.pixel_size_m, strict=True)
    )
    row, col = np.nonzero(blocks)
    # Between centres of blocks: half a block of that is measured
    to_centre_m = distance_transform_edt(blocks, sampling=(block_y_m, block_x_m))[row, col]
    depth_m = to_centre_m - 0.5 * min(block_y_m, block_x_m)
    place_m = (col + 0.5) * block_x_m, (row + 0.5) * block_y_m
    rim_m = _rims_m(blocks, surface.height_m[:: steps[0], :: steps[1]])[row, col]
    return *place_m, depth_m, rim_m, block_y_m * block_x_m


def _rims_m(blocks: np.ndarray, height_m: np.ndarray) -> np.ndarray:
    """Return the height that three quarters of what lies around the hole of each square exceed."""
    from scipy.ndimage import label, maximum_filter

    names, count = label(blocks, np.ones((3, 3)))
    around = np.where(np.isfinite(height_m), maximum_filter(names, 5), 0)
    rim = around > 0
    # All rims at once, sorted by hole and height: a map may have thousands of holes
    order = np.lexsort((height_m[rim], around[rim]))
    sorted_m, hole = height_m[rim][order], around[rim][order]
    first = np.searchsorted(hole, np.arange(1, count + 2))
    known = np.diff(first)
    place = first[:-1] + QUARTER * np.maximum(known - 1, 0)
    rims_m = np.full(count + 1, np.nan)
    if sorted_m.size:
        rims_m[1:] = np.where(
            known > 0, np.interp(place, np.arange(sorted_m.size), sorted_m), np.nan
        )
    rim_m: np.ndarray = rims_m[names]
    return rim_m


def _blocks(mask: np.ndarray, surface: HeightMap, side_m: float) -> np.ndarray:
    """Tell which blocks of a length of side lie in a mask as a whole."""
    step_y, step_x = _block_steps(surface, side_m)
    blocks = mask[::step_y, ::step_x].copy()
    rows = np.flatnonzero(blocks.any(axis=1))  # the others need no second look
    for first in rows * step_y:
        lines = mask[first : first + step_y].all(axis=0)
        starts = np.arange(0, lines.size, step_x)
        blocks[first // step_y] = np.minimum.reduceat(lines.view(np.uint8), starts).view(bool)
    return blocks


def _block_steps(surface: HeightMap, side_m: float) -> list[int]:
    return [max(1, int(side_m / size_m)) for size_m in surface.pixel_size_m]
