"""Places of caps on a synthetic face: at random, apart, and balanced about the middle."""

import numpy as np

from capslip.errors import SettingsError

PLACEMENT_TRIES = 20_000
SETTLING_STEPS = 500
GAP_MARGIN = 1.05  # of the gap, to which discs are pushed apart: then a later one keeps the gap


def free_places(
    rng: np.random.Generator,
    radius_m: np.ndarray,
    given: np.ndarray,
    gap_m: float,
    side_m: tuple[float, float],
) -> np.ndarray:
    """Draw a place for each disc, apart from all before it and inside the face.

    Parameters
    ----------
    rng : numpy.random.Generator
        Where the places come from.
    radius_m : array_like, shape (n,)
        Radii of the discs.
    given : array_like, shape (k, 3)
        x, y and radius of discs that have their place already.
    gap_m : float
        Least distance between discs, and from the edge.
    side_m : (float, float)
        Sides of the face along y and x.

    Returns
    -------
    float64, shape (n, 2)
        x and y of the middles.

    Raises
    ------
    SettingsError
        If no place is left.
    """
    taken = np.asarray(given, dtype=float).reshape(-1, 3)
    for disc_m in radius_m:
        place_m = _free_place(rng, float(disc_m), taken, gap_m, side_m)
        taken = np.vstack([taken, (*place_m, disc_m)])
    return taken[taken.shape[0] - len(radius_m) :, :2]


def _free_place(
    rng: np.random.Generator,
    disc_m: float,
    taken: np.ndarray,
    gap_m: float,
    side_m: tuple[float, float],
) -> tuple[float, float]:
    keep_m = disc_m + gap_m
    if 2.0 * keep_m < min(side_m):
        for _ in range(PLACEMENT_TRIES):
            x_m = rng.uniform(keep_m, side_m[1] - keep_m)
            y_m = rng.uniform(keep_m, side_m[0] - keep_m)
            apart_m = np.hypot(taken[:, 0] - x_m, taken[:, 1] - y_m) - taken[:, 2] - disc_m
            if (apart_m >= gap_m).all():
                return x_m, y_m
    raise SettingsError(
        f"scene: no place left for a disc of {2e3 * disc_m:.3g} mm with a gap of "
        f"{1e3 * gap_m:.3g} mm beside {len(taken)} others; lower gap_m, the counts or "
        "material_ratio, or try another seed"
    )


def balanced_places(
    place_m: np.ndarray,
    volume_m3: np.ndarray,
    radius_m: np.ndarray,
    given: np.ndarray,
    gap_m: float,
    side_m: tuple[float, float],
    moment_m4: np.ndarray,
) -> np.ndarray | None:
    """Move discs until their volumes have a given moment about the corner of the face.

    By turns all move together, which gives them the moment, and those that came too close to
    another or to the edge move apart.

    Parameters
    ----------
    place_m : float64, shape (n, 2)
        x and y to begin with.
    volume_m3, radius_m : float64, shape (n,)
        What each disc weighs, and how wide it is.
    given, gap_m, side_m
        As for `free_places`; the given discs do not move.
    moment_m4 : float64, shape (2,)
        Wanted sums of V x and of V y.

    Returns
    -------
    float64, shape (n, 2), or None
        None if the discs do not come to rest.
    """
    place_m, n = place_m.copy(), len(place_m)
    fixed = np.asarray(given, dtype=float).reshape(-1, 3)
    wide_m = np.concatenate([radius_m, fixed[:, 2]])
    touch_m = wide_m[:n, None] + wide_m
    share = np.full((n, len(wide_m)), 0.5)  # of the way apart: a given disc leaves it all
    share[:, n:] = 1.0
    own = np.eye(n, len(wide_m), dtype=bool)
    low_m = (radius_m + gap_m)[:, None]
    high_m = np.array(side_m[::-1]) - low_m
    for _ in range(SETTLING_STEPS):
        place_m += (moment_m4 - volume_m3 @ place_m) / volume_m3.sum()
        off_m = place_m[:, None] - np.vstack([place_m, fixed[:, :2]])
        apart_m = np.hypot(off_m[..., 0], off_m[..., 1])
        apart_m[own] = np.inf
        room_m = apart_m - touch_m
        if (room_m >= gap_m).all() and ((place_m >= low_m) & (place_m <= high_m)).all():
            return place_m
        way_m = share * np.maximum(GAP_MARGIN * gap_m - room_m, 0.0) / apart_m
        place_m += (way_m[..., None] * off_m).sum(axis=1)
        np.clip(place_m, low_m, high_m, out=place_m)
    return None
