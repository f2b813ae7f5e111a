"""Maps of more points than were measured: what lies between those was interpolated."""

import numpy as np

from capslip.surface.heightmap import HeightMap
from capslip.surface.quantile import quantile
from capslip.surface.rows import even_lines

MOST_APART = 8  # measured points, in pixels
ORDERS = range(1, 6)  # of differences: copies vanish in the first, cubic splines in the fifth
QUIET = 5e-3  # mean squares where only interpolated points are met, over those elsewhere
LOUD, LOUD_SHARE = 10.0, 0.3  # rms of the quiet places, that this share of the loud ones exceeds
LEAST_OWN = 1e-2  # squares, over what lines share: cusps of balls on whole pixels have 1e-5
MOSTLY = 0.8  # of the greatest share of quiet places: as good as that
OUTERMOST = 0.99  # quantile at which differences are cut: spikes say nothing of it
CLOSE, CLOSE_ORDERS = (2, 3), (3, 7)  # pixels apart, of which no difference may vanish
UNEVEN = 0.25  # squares there: 0.002 to 0.24 where interpolated, 0.4 to 1 where measured
CLOSE_SAMPLED = 5_000
LEAST_LINES = 8 * MOST_APART
SAMPLED = 20_000  # points that are looked at, on lines across the whole map
LEAST_KNOWN = 300  # differences at one place of the cells: of fewer, chance makes quiet ones


def pixels_apart(surface: HeightMap) -> tuple[int, int]:
    """Return how many pixels the measured points lie apart along (y, x): 1 where all are measured.

    Between measured points an interpolated map is a polynomial of low degree, and its differences
    of a higher order vanish there, at the same places in each cell. Those of a measured map are
    alike everywhere, for noise and roughness know nothing of cells. What lines of a lay share is
    taken off first: it is as periodic, and measured.

    Between points two or three pixels apart no difference of a cubic misses all of them; but those
    of high order are far smaller at some places of a cell than at others. That counts where it is
    so along both axes: no lay, step or scan line has one distance both ways.

    Parameters
    ----------
    surface : HeightMap
        As measured, or with its form off.
    """
    if min(surface.shape) < LEAST_LINES:
        return 1, 1
    rows, columns = (even_lines(n, surface.size // SAMPLED) for n in surface.shape)
    lines_m = surface[:, columns], surface[rows].T
    apart_y, apart_x = (_apart(one_m) for one_m in lines_m)
    if min(apart_y, apart_x) == 1:
        close = _close([one_m[:, :: max(1, one_m.size // CLOSE_SAMPLED)] for one_m in lines_m])
        return max(apart_y, close), max(apart_x, close)
    return apart_y, apart_x


def _close(lines_m: list[np.ndarray]) -> int:
    """Return which of the close distances the places of cells are uneven at, along both axes."""
    uneven = np.ones(len(CLOSE), dtype=bool)
    for height_m in lines_m:
        if uneven.any():
            uneven &= _uneven(height_m)
    return CLOSE[int(uneven.argmax())] if uneven.any() else 1


def _uneven(height_m: np.ndarray) -> np.ndarray:
    """Tell of each width whether the places of its cells differ, the quietest from the loudest."""
    uneven = np.zeros(len(CLOSE), dtype=bool)
    least, most = CLOSE_ORDERS
    difference_m = np.diff(height_m, least - 1, axis=0)
    for _ in range(least, most + 1):
        difference_m = np.diff(difference_m, axis=0)
        known = np.isfinite(difference_m)
        n_known = known.sum(axis=1)
        shared_m = np.sum(difference_m, axis=1, where=known) / np.maximum(n_known, 1)
        size_m = np.abs(difference_m - shared_m[:, None])
        square_m2 = np.square(size_m).sum(axis=1, where=known)
        for i, apart in enumerate(CLOSE):
            every = [slice(at, None, apart) for at in range(apart)]
            n = [n_known[at].sum() for at in every]
            if uneven[i] or min(n) < LEAST_KNOWN:
                continue
            # Steps decide means, and heights in few digits medians
            if _differ([square_m2[at].sum() / n[at.start] for at in every]):
                uneven[i] = _differ([np.median(size_m[at][known[at]]) ** 2 for at in every])
    return uneven


def _differ(squares: list[float]) -> bool:
    return max(squares) > 0.0 and min(squares) < UNEVEN * max(squares)


def _apart(height_m: np.ndarray) -> int:
    """Return the distance of measured points along the first axis."""
    difference_m = height_m
    for order in ORDERS:
        difference_m = np.diff(difference_m, axis=0)
        own_m, known, shared_m = _own(difference_m)
        square, count = np.einsum("ij,ij->i", own_m, own_m), known.sum(axis=1)
        mean = square / np.maximum(count, 1)
        if mean.min() > QUIET * mean.max():
            continue  # no place is quiet where no line is
        every = np.arange(2, MOST_APART + 1)
        if mean.max() <= LEAST_OWN * shared_m.var():
            continue  # exact shapes share their edges
        quiet = np.array(
            [_quiet_share(own_m, known, square, count, apart) for apart in every.tolist()]
        )
        # Of a polynomial between points all such differences vanish that none of the points is in
        quiet[quiet * every < np.maximum(every - order, 1) - 0.5] = 0.0
        if quiet.any():  # a multiple of the distance meets the same points
            return int(np.argmax(quiet > MOSTLY * quiet.max())) + 2
    return 1


def _own(difference_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return differences without their greatest ones, and without what their lines share.

    Which of them are known, the others being zero, and what each line shares: its median, as the
    edges of exact caps lie in few lines, and in each of these at few points.
    """
    known = ~np.isnan(difference_m)
    most_m = quantile(np.abs(difference_m).reshape(-1), OUTERMOST)
    own_m = np.clip(difference_m, -most_m, most_m)
    in_order_m, count = np.sort(own_m, axis=1), np.maximum(known.sum(axis=1), 1)  # unknown: last
    middle = np.stack(((count - 1) // 2, count // 2), axis=1)
    shared_m = np.nan_to_num(np.take_along_axis(in_order_m, middle, axis=1).mean(axis=1))
    own_m -= shared_m[:, None]
    own_m[~known] = 0.0
    return own_m, known, shared_m


def _quiet_share(
    own_m: np.ndarray, known: np.ndarray, square: np.ndarray, count: np.ndarray, apart: int
) -> float:
    """Return at which share of the places of a cell the differences are quiet; 0: at none.

    `square` and `count` are sums over the lines of differences.
    """
    place = np.arange(len(count)) % apart
    n = np.bincount(place, count)
    if n.min() < LEAST_KNOWN:
        return 0.0
    mean = np.bincount(place, square) / n
    share = float(np.mean(mean <= QUIET * mean.max()))
    if share == 0.0 or mean.max() == 0.0:
        return 0.0
    at = slice(int(mean.argmax()), None, apart)
    stands_out = np.mean(own_m[at][known[at]] ** 2 > LOUD**2 * mean.min())
    return share if stands_out >= LOUD_SHARE else 0.0
