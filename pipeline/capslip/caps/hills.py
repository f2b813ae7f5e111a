"""Hills: the parts of the face that stand above the cut, separated where they run together.

The paper keeps the highest 10 % of the points (its section 3): the cut height is Smc(10 %) of the
areal material ratio curve, taken over the measured points alone; its hills are the connected
regions above the cut. On ground or worn faces one region holds many hills, so these are separated
by watershed, and Wolf's pruning joins again what no distinct saddle divides.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from capslip.caps.pruning import MIN_POINTS, Basins, automatic_pruning_m, change_of_count
from capslip.caps.separation import ChangeTree, change_tree, region_tree
from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.surface.form import ROUNDING
from capslip.surface.heightmap import HeightMap, Heights
from capslip.surface.heights import index_type
from capslip.surface.noise import noise_of_map_m
from capslip.surface.outline import between
from capslip.surface.rows import BLOCK_POINTS, row_blocks

NOISE_FACTOR = 5.0  # noise alone lifts a point this many standard deviations once in 3.5 million
SQUARES = (3, 5, 7, 9)  # points; wider ones fill the saddles of hills of usual size
MARGIN = SQUARES[-1] // 2  # of the frame of non-measured points
SAMPLES = 5000  # of the map, that tell about where the cut is
TOLD_APART = 0.01  # of the relief that is given: saddles from which on hills are told apart
QUIET = 0.02  # of the relief: what averaging should leave of NOISE_FACTOR times the noise


@dataclass(frozen=True, eq=False)
class Hills:
    """Labelled hills of one height map, the highest first.

    Attributes
    ----------
    label : int16 or int32, shape (ny, nx)
        1 ... n on the hills, 0 elsewhere and at non-measured points.
    parent_region : int32, shape (n,)
        Connected region that holds each hill, 1 ... n_regions.
    prominence_m : float64, shape (n,)
        Height of each peak above the saddle to a higher one; above the cut for the highest of a
        region. Of the averaged heights, see `square`.
    cut_height_m : float
        Smc(material ratio).
    kept_fraction : float
        Share of the measured points at or above the cut.
    n_regions : int
        Connected regions above the cut, fragments included.
    largest_region_share, largest_hill_share : float
        Points of the largest region, and of the largest hill, over all points above the cut.
    noise_m : float
        Standard deviation of the point-to-point noise.
    square : int
        Peaks and saddles are those of the mean heights over squares of so many points a side.
    pruning_height_m : float
        Least prominence of a hill beside a higher one; inf where regions were left whole.
    n_hills_half_pruning, n_hills_double_pruning : int
        Number of hills if the pruning height were halved, or doubled.
    rejected : dict
        Hills that carry no label, counted by reason.
    """

    label: np.ndarray
    parent_region: np.ndarray
    prominence_m: np.ndarray
    cut_height_m: float
    kept_fraction: float
    n_regions: int
    largest_region_share: float
    largest_hill_share: float
    noise_m: float
    square: int
    pruning_height_m: float
    n_hills_half_pruning: int
    n_hills_double_pruning: int
    rejected: dict[str, int]

    @property
    def n_hills(self) -> int:
        """Number of hills."""
        return len(self.parent_region)

    @property
    def pruning_sensitivity(self) -> float:
        """Greater relative change of the number of hills as the pruning is halved or doubled."""
        return change_of_count(self.n_hills_half_pruning, self.n_hills, self.n_hills_double_pruning)


def find_hills(
    surface: HeightMap,
    material_ratio: float = 0.10,
    separation: str = "watershed",
    pruning_height_m: float | None = None,
    pruning_percent_Sz: float | None = None,
    relief_m: float | None = None,
    noise_m: float | None = None,
) -> Hills:
    """Cut a height map and separate what stands above the cut into hills, with eight neighbours.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    material_ratio : float
        Share of the measured points to keep, in (0, 1).
    separation : {"watershed", "regions"}
        Hills by steepest ascent, pruned by saddle height, or connected regions as they are.
    pruning_height_m, pruning_percent_Sz : float, optional
        Least height of a peak above the saddle to a higher one, in metres or in per cent of the
        height range Sz. Give one of them at most. By default it is chosen from the map: the lowest
        height, from five times the noise up, at which the number of hills hardly depends on it.
    relief_m : float, optional
        Height that matters, such as the approach of the face. The noise is then averaged down to
        what does not matter against it, and hills are told apart from a hundredth of it on.
    noise_m : float, optional
        What `noise_of_map_m` returned for the map at any level, to save measuring it again.

    Returns
    -------
    Hills
        Hills of fewer than 9 points that have a higher neighbour belong to it. Others, and those
        that noise alone would raise above the cut, are counted in `rejected` and carry no label.

    Raises
    ------
    UnusableSurfaceError
        If no point is measured, all heights are equal, or fewer than 9 points lie above the cut.
    SettingsError
        If the separation is unknown, or the pruning is not positive or given twice.

    Notes
    -----
    Peaks and saddles are sought on heights averaged over a square of 3 x 3 points, up to 9 x 9
    where the noise asks for it; a single point that stands above all its neighbours counts as high
    as the highest of them. The cut, the labels' outline and all later stages see the heights as
    measured. Non-measured points carry no label, but hold a hill together where the mean around
    them, or the straight line across a patch of them, lies above the cut.

    Without `pruning_height_m` and `pruning_percent_Sz`, the pruning height starts at five standard
    deviations of the averaged noise, or 0.5 % of the relief (twice the median height above the cut)
    if that is more. It is doubled, up to a third of the relief, until half and double of it change
    the number of hills by less than 10 %. Where no height does, the lowest is taken, and
    `pruning_sensitivity` says how much the number depends on it.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[-50:51, -50:51] * 1e-4
    >>> hills = find_hills(HeightMap(-(x**2 + y**2) / 50, (1e-4, 1e-4)))
    >>> hills.n_hills, round(hills.kept_fraction, 2)
    (1, 0.1)
    """
    _check(separation, pruning_height_m, pruning_percent_Sz)
    name, n_measured = surface.origin.name, surface.n_measured
    if n_measured == 0:
        raise UnusableSurfaceError(
            f"{name}: all {surface.size} points are non-measured; expected heights; "
            "check the file's code for missing data"
        )
    point, (cut_m, middle_m) = highest_points(surface, n_measured, material_ratio)
    if point.size == n_measured and np.ptp(surface.bounds_m) == 0.0:
        raise UnusableSurfaceError(
            f"{name}: all {n_measured} measured heights are equal, as measured or less their form; "
            "expected a surface with relief; check the dataset and the unit"
        )
    if separation == "regions":
        pruning_height_m = math.inf
    elif pruning_percent_Sz is not None:
        pruning_height_m = pruning_percent_Sz / 100.0 * float(np.ptp(surface.bounds_m))
    least_m = None if relief_m is None else TOLD_APART * relief_m
    relief_m = relief_m or 2.0 * (middle_m - cut_m) or float(np.ptp(surface.bounds_m))  # a plateau
    if noise_m is None:
        noise_m = noise_of_map_m(surface)
    kept = point, n_measured, cut_m
    return _separate(surface, *kept, relief_m, pruning_height_m, least_m, noise_m)


def _check(
    separation: str, pruning_height_m: float | None, pruning_percent_Sz: float | None
) -> None:
    if separation not in ("watershed", "regions"):
        raise SettingsError(
            f"hills.separation: got {separation!r}; expected one of watershed, regions"
        )
    if pruning_height_m is not None and pruning_percent_Sz is not None:
        raise SettingsError(
            "hills: got both pruning_height_m and pruning_percent_Sz; give one of them, or none"
        )
    for name, value in (("height_m", pruning_height_m), ("percent_Sz", pruning_percent_Sz)):
        if value is not None and not 0.0 < value < math.inf:
            raise SettingsError(f"hills.pruning_{name}: got {value}; expected a positive number")


def highest_points(
    height_m: Heights, n_measured: int, material_ratio: float
) -> tuple[np.ndarray, list[float]]:
    """Return the points at or above the cut, rising, and the quantiles of it and of half of it.

    Parameters
    ----------
    height_m : float64, shape (ny, nx), or HeightMap
        Of which `n_measured` are known, one at least.
    n_measured : int
    material_ratio : float
        Share of them to keep, in (0, 1).

    Notes
    -----
    Some points tell about where the cut is, so that few are left to be sorted.
    """
    every = max(1, math.isqrt(height_m.size // SAMPLES))
    some_m = height_m[every // 2 :: every, every // 2 :: every].reshape(-1)
    some_m = some_m[~np.isnan(some_m)]
    level_m = -math.inf
    if some_m.size:
        nth = int(max(0.0, 0.98 - 1.05 * material_ratio) * (some_m.size - 1))
        level_m = float(np.partition(some_m, nth)[nth])
    ratios = np.array((1.0 - material_ratio, 1.0 - material_ratio / 2.0))
    place = ratios * (n_measured - 1)
    point, highest_m = _at_or_above(height_m, level_m)
    if n_measured - point.size > place[0]:  # they misled
        point, highest_m = _at_or_above(height_m, -math.inf)
    lower = place.astype(np.intp)
    first = lower - (n_measured - point.size)
    ranks = np.stack((first, np.minimum(first + 1, point.size - 1)))
    below_m, above_m = np.partition(highest_m, np.unique(ranks))[ranks]
    share, step_m = place - lower, above_m - below_m
    quantile_m = np.where(share < 0.5, below_m + share * step_m, above_m - (1.0 - share) * step_m)
    return point[highest_m >= quantile_m[0]], quantile_m.tolist()


def _at_or_above(height_m: Heights, level_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the points at or above a level, rising, and their heights."""
    points: list[np.ndarray] = []
    heights_m: list[np.ndarray] = []
    for rows in row_blocks(height_m.shape):
        some_m = height_m[rows].reshape(-1)
        point = np.flatnonzero(some_m >= level_m)
        heights_m.append(some_m[point])
        point += rows.start * height_m.shape[1]
        points.append(point.astype(index_type(height_m.size)))
    highest_m = np.concatenate(heights_m)
    del heights_m
    return np.concatenate(points), highest_m


def _separate(
    surface: HeightMap,
    point: np.ndarray,
    n_measured: int,
    cut_m: float,
    relief_m: float,
    pruning_m: float | None,
    least_m: float | None,
    noise_m: float,
) -> Hills:
    n_kept = point.size
    if n_kept < MIN_POINTS:
        raise UnusableSurfaceError(
            f"{surface.origin.name}: {n_kept} points lie above the cut at {cut_m:.3g} m; expected "
            f"at least {MIN_POINTS}; raise hills.material_ratio or use a finer scan"
        )
    lost = _lost_between(surface)
    square, noise_left_m = _square(noise_m, relief_m, n_measured / (n_measured + lost.size))
    build = region_tree if pruning_m == math.inf else change_tree
    tree, raw_m = _tree(surface, point, lost, cut_m, square, build)

    hill, m = tree.hill, len(tree.peak_m)
    if hill.size > n_kept:
        measured = ~np.isnan(raw_m)
        hill, raw_m = hill[measured], raw_m[measured]
    highest_m = np.full(m, -np.inf)
    np.maximum.at(highest_m, hill, raw_m)
    # A floor without noise lies at the cut but for rounding, and a plane that was taken off rounds:
    # it is no hill, unless nothing stands on it
    rounding_m = ROUNDING * float(np.ptp(surface.bounds_m))
    rounding_m = rounding_m if highest_m.max() > rounding_m else 0.0
    low = (highest_m < max(NOISE_FACTOR * noise_m, rounding_m)) & (
        tree.peak_m < max(NOISE_FACTOR * noise_left_m, rounding_m)
    )
    basins = Basins(tree, np.bincount(hill, minlength=m), low)
    if pruning_m is None and least_m is not None:
        pruning_m = max(least_m, NOISE_FACTOR * noise_left_m)
    elif pruning_m is None:
        pruning_m = automatic_pruning_m(basins, NOISE_FACTOR * noise_left_m, relief_m)

    group, keep, rejected = basins.pruned(pruning_m)
    few_bytes = np.int16 if np.count_nonzero(keep) < 2**15 else np.int32
    number = np.cumsum(keep, dtype=few_bytes) * keep
    label = np.zeros(surface.shape, dtype=few_bytes)
    label.reshape(-1)[point] = number[group][hill]
    region = tree.join(np.full(m, True))
    region_points = basins.points_of(region)
    return Hills(
        label=label,
        parent_region=np.cumsum(region_points > 0, dtype=np.int32)[region[keep]],
        prominence_m=np.clip(tree.prominence_m, 0.0, np.maximum(tree.peak_m, 0.0))[keep],
        cut_height_m=cut_m,
        kept_fraction=n_kept / n_measured,
        n_regions=int(np.count_nonzero(region_points)),
        largest_region_share=float(region_points.max() / n_kept),
        largest_hill_share=float(basins.points_of(group).max() / n_kept),
        noise_m=noise_m,
        square=square,
        pruning_height_m=pruning_m,
        n_hills_half_pruning=basins.count(0.5 * pruning_m),
        n_hills_double_pruning=basins.count(2.0 * pruning_m),
        rejected=rejected,
    )


def _lost_between(surface: HeightMap) -> np.ndarray:
    """Return the lost points over which a hill may go on: those that are not open to the edge."""
    if not surface.ends_within:
        return surface.lost
    is_open = surface.outside & ~between(surface.measured)
    return np.asarray(surface.lost[~is_open.reshape(-1)[surface.lost]])


def _square(noise_m: float, relief_m: float, measured_share: float) -> tuple[int, float]:
    """Choose the side of the averaging square; return it and the noise that it leaves."""
    for side in SQUARES:
        points = side * side * measured_share
        left_m = noise_m / math.sqrt(points)
        if points > 6.0 and NOISE_FACTOR * left_m <= QUIET * relief_m:
            break
    return side, left_m


def _lower_spikes(above_m: np.ndarray, point: np.ndarray) -> None:
    """Lower single points that exceed all eight neighbours to the highest of these, in place."""
    width, flat_m = above_m.shape[1], above_m.reshape(-1)
    around = (1, -1, width, -width, width + 1, -width - 1, width - 1, -width + 1)
    own_m = flat_m.take(point)
    for step in around:
        left = np.flatnonzero(~(flat_m.take(point + step) >= own_m))  # also beside a lost one
        point, own_m = point.take(left), own_m.take(left)
    around_m = flat_m.take(point - 1)
    for step in around:
        np.fmax(around_m, flat_m.take(point + step), out=around_m)
    flat_m[point] = np.fmin(own_m, around_m)


def _tree(
    surface: HeightMap,
    point: np.ndarray,
    lost: np.ndarray,
    cut_m: float,
    side: int,
    build: Callable[[np.ndarray, np.ndarray, tuple[int, int]], ChangeTree],
) -> tuple[ChangeTree, np.ndarray]:
    """Build the tree of the averaged heights; return it and the heights at its points.

    Non-measured points whose mean lies above the cut are in it too, with height NaN.
    """
    # A frame of non-measured points spares every later step the edge of the map.
    ny, nx = surface.shape
    width = nx + 2 * MARGIN
    framed, lost = (at + 2 * MARGIN * (at // nx) + MARGIN * (width + 1) for at in (point, lost))
    raw_m, mean_m, lost_m = _means(surface, cut_m, framed, lost, side)
    deep = np.isnan(lost_m)
    if deep.any():
        around = (framed, mean_m), (lost[~deep], lost_m[~deep])
        lost_m[deep] = _across(around, lost[deep], width)
    above = lost_m >= 0.0
    if above.any():
        place = np.searchsorted(framed, lost[above])
        framed = np.insert(framed, place, lost[above])
        below_m = np.nextafter(lost_m[above], -np.inf)  # what was measured counts as higher
        mean_m, raw_m = np.insert(mean_m, place, below_m), np.insert(raw_m, place, np.nan)
    return build(framed, mean_m, (ny + 2 * MARGIN, width)), raw_m


def _means(
    height_m: HeightMap, cut_m: float, point: np.ndarray, lost: np.ndarray, side: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return heights over the cut of points, their means over a square, and means at lost ones.

    Single points are lowered first; a mean is NaN where nothing was measured. Points rise, and
    count in the frame. Some rows at a time: what is computed stays in the cache.
    """
    halo, (ny, nx) = side // 2 + 1, height_m.shape
    width, n_rows = nx + 2 * MARGIN, max(8, BLOCK_POINTS // nx)
    raw_m, means_m = np.empty(len(point)), (np.empty(len(point)), np.empty(len(lost)))
    buffer_m = np.full((min(ny, n_rows) + 2 * halo, width), np.nan)
    known_points = np.append(np.nan, np.arange(1.0, side**2 + 1.0))  # by their number
    for first in range(0, ny, n_rows):
        last = min(first + n_rows, ny)
        bounds = (np.array((first, last)) + MARGIN) * width
        of_point, of_lost = (slice(*_places_in(at, bounds)) for at in (point, lost))
        if of_point.start == of_point.stop and of_lost.start == of_lost.stop:
            continue
        above_m = buffer_m[: last - first + 2 * halo]
        top, bottom = max(first - halo, 0), min(last + halo, ny)
        above_m[: top - first + halo] = above_m[bottom - first + halo :] = np.nan
        inner_m = above_m[top - first + halo : bottom - first + halo, MARGIN:-MARGIN]
        np.subtract(height_m[top:bottom], cut_m, out=inner_m)
        origin = (first - halo + MARGIN) * width
        around = slice(*_places_in(point, bounds + (halo - 1) * width * np.array((-1, 1))))
        _lower_spikes(above_m, point[around].astype(np.intp) - origin)
        raw_m[of_point] = above_m.reshape(-1)[point[of_point] - origin]
        unknown, inner_m = np.isnan(above_m[1:-1]), above_m[1:-1].copy()
        np.putmask(inner_m, unknown, 0.0)
        total_m, count = _column_sums(inner_m, side), _square_sums(~unknown, side)
        for mean_m, at, part in zip(means_m, (point, lost), (of_point, of_lost), strict=True):
            first = at[part].astype(np.intp) - (bounds[0] + side // 2)
            sum_m = total_m.take(first)
            for step in range(1, side):
                sum_m += total_m.take(first + step)
            mean_m[part] = sum_m / known_points.take(count.take(first))
    return raw_m, *means_m


def _places_in(rising: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Return where bounds would stand among rising numbers, which are not copied for it."""
    return np.searchsorted(rising, bounds.astype(rising.dtype))


def _column_sums(values: np.ndarray, side: int) -> np.ndarray:
    """Return the sums of so many points of each column, flattened; as many rows less."""
    rows = len(values) - side + 1
    down = values[:rows].copy()
    for step in range(1, side):
        down += values[step : step + rows]
    return down.reshape(-1)


def _square_sums(known: np.ndarray, side: int) -> np.ndarray:
    """Return the numbers of known points in squares, at their first column, flattened."""
    down = _column_sums(known.view(np.uint8), side)
    count = down[: down.size - side + 1].copy()
    for step in range(1, side):
        count += down[step : step + count.size]
    return count


def _across(
    around: tuple[tuple[np.ndarray, np.ndarray], ...], point: np.ndarray, width: int
) -> np.ndarray:
    """Bridge the inside of non-measured patches, along rows or columns, whichever is higher.

    Heights run straight from one side of a patch to the other; NaN where one side is the edge.
    What is around them are rising points with their heights.
    """

    def height_m(at: np.ndarray) -> np.ndarray:
        found_m = np.full(len(at), np.nan)
        for known, known_m in around:
            if known.size:
                place = np.minimum(np.searchsorted(known, at), known.size - 1)
                found_m = np.where(known[place] == at, known_m[place], found_m)
        return found_m

    bridge_m = np.full(len(point), np.nan)
    for step, order in ((1, np.arange(len(point))), (width, np.lexsort((point, point % width)))):
        line = point[order]
        begins = np.append(True, np.diff(line) != step)
        run, start = np.cumsum(begins) - 1, line[begins]
        length = np.bincount(run)
        before_m, after_m = height_m(start - step), height_m(start + step * length)
        share = ((line - start[run]) // step + 1) / (length + 1)[run]
        along_m = before_m[run] + share * (after_m - before_m)[run]
        bridge_m[order] = np.fmax(bridge_m[order], along_m)
    return bridge_m
