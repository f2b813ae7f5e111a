"""Lifted patches: a step up all around, and inside the face goes on as outside."""

import numpy as np

from capslip.surface.heightmap import HeightMap

FEWEST_POINTS = 3  # fewer are judged as spikes
MOST_ISLANDS = 5  # more are a texture
LONGEST = 3.0  # times the root of its points: a longer one is a ridge or a scratch
REACH = 2  # pixels around a patch that tell how the face goes on
REST_OVER_STEP = 0.125  # greatest, of what the same surface leaves inside and outside
POINTS_OVER_TERMS = 2.0  # least


def lifted_patches(
    surface: HeightMap, index: np.ndarray, island: np.ndarray, cliff_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the few patches that stand above their surroundings by one step.

    Parameters
    ----------
    surface : HeightMap
    index, island : int64, shape (n,)
        Places of the points of islands, and the number of the island of each: what hangs together
        without a cliff, and not with the rest.
    cliff_m : float
        The height difference of neighbours that counts as a cliff.

    Returns
    -------
    index : int64, shape (k,)
        Places of the points of patches.
    step_m : float64, shape (k,)
        How far its patch is lifted, for each.

    Notes
    -----
    One quadric and one step, z = q(x, y) + s inside, are fitted by least squares to an island of
    three points or more and to what is measured within two pixels around it. The island is a patch
    where s is a cliff and nothing inside or outside deviates by more than an eighth of it, unless
    it is as long as a ridge. A hill has a top of its own, on a flank a worn one, too; a flat grain
    of dust and a fringe miscounted by an interferometer have that of the face. A pillar on a level
    floor looks the same; where there are more than five islands of any size, they are the face's
    own, and none is a patch. What lies lower touches nothing, and may be a pit.

    Examples
    --------
    >>> y, x = np.mgrid[0:40, 0:60] - 20.0
    >>> z = -1e-10 * (x**2 + y**2)
    >>> z[10:14, 20:25] += 1e-6
    >>> at = np.flatnonzero(z > 1e-7)
    >>> index, step_m = lifted_patches(HeightMap(z, (1e-4, 1e-4)), at, 0 * at, 1e-7)
    >>> index.size, bool(np.allclose(step_m, 1e-6))
    (20, True)
    """
    found, steps_m = [np.empty(0, dtype=np.intp)], [np.empty(0)]
    numbers, points = np.unique(island, return_counts=True)
    for number in numbers[points >= FEWEST_POINTS] if numbers.size <= MOST_ISLANDS else []:
        inside = index[island == number]
        longest = max(np.ptp(inside // surface.shape[1]), np.ptp(inside % surface.shape[1])) + 1
        if longest > LONGEST * np.sqrt(inside.size):
            continue
        step_m = _step_m(surface, inside, index)
        if step_m > cliff_m:
            found.append(inside)
            steps_m.append(np.full(inside.size, step_m))
    return np.concatenate(found), np.concatenate(steps_m)


def _step_m(surface: HeightMap, inside: np.ndarray, islands: np.ndarray) -> float:
    """Return the step of an island, 0 where it has a shape of its own."""
    ny, nx = surface.shape
    row, col = np.divmod(inside, nx)
    away = np.arange(-REACH, REACH + 1)
    near_row = row[:, None, None] + away[:, None] + 0 * away
    near_col = col[:, None, None] + 0 * away[:, None] + away
    on_map = (near_row >= 0) & (near_row < ny) & (near_col >= 0) & (near_col < nx)
    near = np.unique((near_row * nx + near_col)[on_map])
    outside = near[~np.isnan(surface.at(near)) & ~np.isin(near, islands)]
    at = np.append(inside, outside)
    y, x = (place - place.mean() for place in np.divmod(at, nx))
    lifted = np.arange(at.size) < inside.size
    terms = np.stack((np.ones(at.size), y, x, y * y, x * y, x * x, lifted), axis=1)
    if at.size < POINTS_OVER_TERMS * terms.shape[1]:
        return 0.0
    height_m = surface.at(at) - surface.at(at).mean()
    fitted, _, rank, _ = np.linalg.lstsq(terms, height_m, rcond=None)
    rest_m = np.abs(height_m - terms @ fitted).max()
    step_m = float(fitted[-1])
    return step_m if rank == terms.shape[1] and rest_m <= REST_OVER_STEP * abs(step_m) else 0.0
