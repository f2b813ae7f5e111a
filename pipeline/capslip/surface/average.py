"""Several scans of one place: their mean, and what they differ by, which is noise."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.problems import Problem
from capslip.surface.blocks import means_of_blocks
from capslip.surface.doubts import HIGHEST_SHARE, refuse_absurd
from capslip.surface.filling import from_nearest
from capslip.surface.flatness import mean_form_m
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap, check_maps
from capslip.surface.noise import MEDIAN_OF_NORMAL, deviation_m, white_noise_of_scans_m
from capslip.surface.repeats import lines_of, refuse_shared
from capslip.surface.shifts import match_by_shift
from capslip.units import percent

BLOCKS = (16, 4, 1)  # pixels along each side, over which heights are averaged to find the place
LEAST_BLOCKS = 8  # along each side of a map that tells a place
MAX_STEPS, LONGEST_STEP = 20, 2.0  # blocks
SAMPLES = 200_000  # points that a place is fitted to
FAR = 6.0  # standard deviations: points farther off have no say in a fit
SAME_PIXEL, ROUNDING = 1e-3, 1e-7  # relative
LEAST_OVERLAP, LEAST_MATCH = 0.5, 0.5
MOST_TURNED_PIXELS = 1.0  # at a corner
SPIKE, MOST_SPIKES = 10.0, 0.01  # standard deviations, and share of the points: more are no spikes
MOST_BLOCKS, BETTER = 128, 0.3  # along the longer side, where a place is looked for everywhere
COARSE_BLOCKS, SAME_PLACE = 48, 0.98  # along the shorter side; correlation
RIM, EDGE, LEAST_PLACED = 8, 2, 30  # pixels: added to a map for splines, badly known, along a side
HIDDEN, MAX_PLACED = 0.1, 4  # a move that changes less than this share of the noise is left
PLANE, FORM, MOVE, PLACE = slice(0, 3), slice(3, 6), slice(6, 8), slice(6, 9)  # columns of a fit


@dataclass(frozen=True, eq=False)
class Average:
    """The mean of several scans of one place.

    Attributes
    ----------
    surface : HeightMap
        On the pixels of the first scan that all have; the `noise_m` and `form_error_m` left in it.
    noise_m : float
        Measurement noise N_M of one scan (ISO 25178-600): rms of what a height changes by from
        scan to scan, over the highest tenth of the points.
    white_m : float or None
        The part of it that changes from pixel to pixel; None where too few neighbours are measured.
    everywhere_m : float
        As `noise_m`, over all points.
    bow_m : float
        Rms of the forms of second degree that scans differ by, which are no part of the noise.
    moved_pixels : tuple of (float, float)
        (dy, dx) by which each scan lies off the first.
    spikes : int
        Heights of single scans that were left out, since the others do not have them.
    scans_a_point : float
        Harmonic mean, over the highest tenth of the points, of how many scans each one has: the
        noise of the mean is that of a scan over the root of it.
    fewer : int
        Points of the mean that not all scans have.
    """

    surface: HeightMap
    noise_m: float
    white_m: float | None
    everywhere_m: float
    bow_m: float
    moved_pixels: tuple[tuple[float, float], ...]
    spikes: int
    scans_a_point: float
    fewer: int


@dataclass(frozen=True, eq=False)
class _Apart:
    """What a scan has over the first one, on the pixels of both."""

    height_m: np.ndarray  # where the first one has its pixels, without plane and form over it
    form_m: np.ndarray  # of the second degree
    noise_m: np.ndarray  # of both
    moved_pixels: tuple[float, float]
    turn_rad: float
    kept: tuple[float, float]  # of white noise: its variance, and that of its mixed differences


def average(scans: Sequence[HeightMap]) -> Average:
    """Average scans of one place, and tell noise from face by what changes between them.

    Parameters
    ----------
    scans : sequence of HeightMap
        As measured, two at least, of a part that was not touched between them. They may lie aside
        by less than half of their sides, also by fractions of a pixel, and be levelled differently.

    Raises
    ------
    SettingsError
        If there are fewer than two, their pixels differ, or two hold the same heights or a scan.
    UnusableSurfaceError
        If one is no HeightMap, or scans do not show one place, are turned by more than a pixel at a
        corner, or have less than half of their points in common.

    Notes
    -----
    Where one scan is z(x), another is z(x - m) with a plane, a form of the second degree and noise
    added. What they differ by, less these and less ``-m . grad z - turn (x dz/dy - y dz/dx)``, all
    fitted by least squares, is the noise of both: the subtraction technique (Haitjema and Morel
    2005, Noise bias removal in profile measurements, Measurement 38). Each scan is shifted by whole
    pixels and loses its plane over the first. Where what is left of the move, half a pixel at most,
    and of the turn changes its heights by more than a tenth of the noise, it is interpolated by
    splines of the fifth degree until it does not; its spikes and holes stay at their pixels. Half a
    pixel along both sides leaves 0.70 of the variance of white noise: that is counted in the noise
    of a scan, and not in that of the mean, which is what is left over the root of n, or of fewer
    where scans have holes.

    Examples
    --------
    >>> y, x = np.mgrid[0:60, 0:80]
    >>> face_m = 1e-6 * np.sin(x / 6.0) * np.cos(y / 7.0)
    >>> noise_m = 1e-8 * np.random.default_rng(0).standard_normal((2, 60, 80))
    >>> found = average([HeightMap(face_m + one_m, (1e-4, 1e-4)) for one_m in noise_m])
    >>> round(found.noise_m * 1e9), round(found.surface.noise_m * 1e9)
    (10, 7)
    """
    _check(scans)
    shifts = np.array([(0, 0), *(_shift(scans[0], other) for other in scans[1:])])
    for _ in range(MAX_PLACED):
        first_m, *others_m = _in_common(scans, shifts)
        apart = [
            _apart(first_m, one_m, shift, scans[0].pixel_size_m)
            for one_m, shift in zip(others_m, shifts[1:], strict=True)
        ]
        nearer = np.rint([(0, 0), *(one.moved_pixels for one in apart)]).astype(int)
        if np.abs(nearer - shifts).max() <= 1:
            break
        shifts = nearer
    level_m = np.stack([first_m, *(one.height_m for one in apart)])
    noise_m = np.stack([0.0 * first_m, *(one.noise_m for one in apart)])  # over that of the first
    face_m2 = _face_m2(HeightMap(first_m, scans[0].pixel_size_m))
    for scan, one in zip(scans[1:], apart, strict=True):
        _check_place(scans[0], scan, face_m2, one)
    _refuse_copies(scans, noise_m)
    spikes = _leave_out_spikes(level_m, noise_m)
    form_m, error_m = mean_form_m([one.form_m for one in apart])
    origin = replace(scans[0].origin, mean_of=tuple(x for one in scans for x in lines_of(one)))
    mean_m = _mean_m(level_m) + form_m  # which has no step where some scans end
    mean = replace(scans[0], height_m=mean_m, form_error_m=error_m, origin=origin)
    height_m = remove_form(mean, "plane")[0].height_m
    high = height_m >= np.nanquantile(height_m, 1.0 - HIGHEST_SHARE)
    known, kept = np.isfinite(height_m), np.mean([(1.0, 1.0), *(one.kept for one in apart)], axis=0)
    count = np.count_nonzero(~np.isnan(level_m), axis=0)
    fewer = int(np.count_nonzero(known & (count < len(scans))))
    if kept[0] < 1.0:
        for here in (high, known):
            here[:EDGE] = here[-EDGE:] = here[:, :EDGE] = here[:, -EDGE:] = False
    left_m, one_m, white_m = _left_and_of_one_m(noise_m, high, kept)
    scans_a_point = float(1.0 / np.mean(1.0 / count[high])) if high.any() else float(len(scans))
    return Average(
        surface=replace(mean, noise_m=left_m / math.sqrt(scans_a_point) or None),
        noise_m=one_m,
        white_m=white_m,
        everywhere_m=_left_and_of_one_m(noise_m, known, kept)[1],
        bow_m=math.sqrt(np.mean([np.var(one.form_m) for one in apart])),
        moved_pixels=((0.0, 0.0), *(one.moved_pixels for one in apart)),
        spikes=spikes,
        scans_a_point=scans_a_point,
        fewer=fewer,
    )


def problems_of_places(scans: Sequence[HeightMap]) -> tuple[Problem, ...]:
    """Return `scans_of_one_place` (warning) where two scans of a joint look like one place of it.

    Means over blocks are compared, less a form of the fourth degree, which another place may share.
    """
    coarse = [_coarse(one, max(1, min(one.shape) // COARSE_BLOCKS)) for one in scans]
    for (one, first_m), (other, second_m) in combinations(zip(scans, coarse, strict=True), 2):
        match = _correlation(first_m, second_m)
        if match > SAME_PLACE:
            message = (
                f"{one.origin.name} and {other.origin.name} match by {match:.3f} (1: the same): "
                "they look like one place that was scanned twice, and count as two of the joint"
            )
            return (Problem("scans_of_one_place", "warning", message),)
    return ()


def _coarse(scan: HeightMap, block: int) -> np.ndarray:
    dy_m, dx_m = scan.pixel_size_m
    means = HeightMap(means_of_blocks(scan, block, 1), (block * dy_m, block * dx_m))
    try:
        return remove_form(means, "polynomial", degree=4)[0].height_m
    except UnusableSurfaceError:  # too few were measured
        return np.full(means.shape, np.nan)


def _correlation(first_m: np.ndarray, other_m: np.ndarray) -> float:
    """Return the correlation of two maps where both are known, 0 where it says nothing."""
    if first_m.shape != other_m.shape:
        return 0.0
    both = ~np.isnan(first_m) & ~np.isnan(other_m)
    off_m = [one[both] - one[both].mean() for one in (first_m, other_m) if both.any()]
    size = math.sqrt(math.prod(float(np.square(one).sum()) for one in off_m))
    return float(off_m[0] @ off_m[1]) / size if off_m and size > 0.0 else 0.0


def _check(scans: Sequence[HeightMap]) -> None:
    check_maps(scans)
    if len(scans) < 2:
        raise SettingsError(f"scans: got {len(scans)}; expected two of one place, or more")
    first = scans[0]
    for one in scans:
        refuse_absurd(one)
    for other in scans[1:]:
        if not np.allclose(other.pixel_size_m, first.pixel_size_m, rtol=SAME_PIXEL, atol=0.0):
            (dy_m, dx_m), (first_dy_m, first_dx_m) = other.pixel_size_m, first.pixel_size_m
            raise SettingsError(
                f"{other.origin.name}: pixels of {dy_m:g} x {dx_m:g} m, and of {first_dy_m:g} x "
                f"{first_dx_m:g} m in {first.origin.name}; expected scans of one setting"
            )
    refuse_shared(scans)


def _in_common(scans: Sequence[HeightMap], shifts: np.ndarray) -> list[np.ndarray]:
    """Return the heights of scans, shifted so against the first, at the places that all have."""
    shapes = np.array([one.shape for one in scans])
    windows = _windows(shapes, shifts)
    heights_m = [one.height_m[window] for one, window in zip(scans, windows, strict=True)]
    if (heights_m[0].shape < LEAST_OVERLAP * shapes.max(axis=0)).any():
        names = " and ".join(one.origin.name for one in scans)
        raise UnusableSurfaceError(
            f"{names}: less than {percent(LEAST_OVERLAP)} of the rows or columns are in all of "
            "them; expected scans of one place"
        )
    return heights_m


def _shift(first: HeightMap, other: HeightMap) -> np.ndarray:
    """Return by how many whole pixels (dy, dx) a scan lies off the first.

    The nearest place that matches; where one farther off matches much better, that one.
    """
    nearest = _nearest(first, other, np.zeros(2))
    shortest = min(*first.shape, *other.shape)
    block = max(1, min(max(first.shape) // MOST_BLOCKS, shortest // LEAST_BLOCKS))
    first_m, other_m = (_coarse(one, block) for one in (first, other))
    if not (np.nan_to_num(first_m).any() and np.nan_to_num(other_m).any()):
        return nearest  # too few were measured, or nothing stands out
    match = match_by_shift(first_m, -other_m)
    best = np.array(np.unravel_index(np.argmax(match), match.shape))
    here = match[tuple(-np.rint(nearest / block).astype(int))]
    if not match[tuple(best)] > max(here + BETTER, LEAST_MATCH):
        return nearest
    best = np.where(best < first_m.shape, best, best - match.shape)
    return _nearest(first, other, -block * best.astype(float))


def _nearest(first: HeightMap, other: HeightMap, moved: np.ndarray) -> np.ndarray:
    """Return as `_shift` what is found from a place on, on ever finer maps.

    A step that leaves no overlap ends it: what is left then matches or not.
    """
    for block in BLOCKS:
        shapes = np.array([first.shape, other.shape]) // block
        if shapes.min() < LEAST_BLOCKS:
            continue
        coarse_m, other_m = (means_of_blocks(one, block, 1) for one in (first, other))
        size_m = (first.pixel_size_m[0] * block, first.pixel_size_m[1] * block)
        for _ in range(MAX_STEPS):
            shift = np.rint(moved / block).astype(int)
            here, there = _windows(shapes, np.array([(0, 0), shift]))
            if min(coarse_m[here].shape) < LEAST_BLOCKS:
                return shift * block
            first_m, second_m = coarse_m[here], other_m[there]
            fit = _fit(second_m - first_m, _columns(first_m, second_m, size_m))
            moved = block * (shift - np.clip(fit[MOVE], -LONGEST_STEP, LONGEST_STEP))
            if (np.rint(moved / block) == shift).all():
                break
    return np.rint(moved).astype(int)


def _windows(shapes: np.ndarray, shifts: np.ndarray) -> list[tuple[slice, ...]]:
    """Return where each of some maps, shifted so against the first, has the points of them all."""
    start = (-shifts).max(axis=0)
    stop = np.maximum((shapes - shifts).min(axis=0), start)
    return [tuple(map(slice, start + shift, stop + shift)) for shift in shifts]


def _columns(
    first_m: np.ndarray, other_m: np.ndarray, pixel_size_m: tuple[float, float]
) -> list[np.ndarray]:
    """Return what scans differ by beside noise, shapes as of heights or broadcast to it.

    A plane, a form of the second degree, a move by one pixel along y and x, and a turn.
    """
    y, x = np.ix_(*(np.linspace(-1.0, 1.0, n) for n in first_m.shape))
    plane = [np.ones((1, 1)), y, x]
    over_m = other_m - first_m
    level_m = other_m - sum(
        share * one for share, one in zip(_fit(over_m, plane), plane, strict=True)
    )
    # Slopes of the face: not of a spike, or of a step where one of them was not measured
    mean_m = _mean_m(np.stack([first_m, level_m]))
    far = ~_near_noise(level_m - first_m) & ~np.isnan(over_m)
    along_y, along_x = np.gradient(from_nearest(np.where(far, np.nan, mean_m)))
    half = [0.5 * (n - 1) for n in first_m.shape]
    square = pixel_size_m[1] / pixel_size_m[0]
    turn = half[1] * x * square * along_y - half[0] * y / square * along_x
    return [*plane, y * y, y * x, x * x, along_y, along_x, turn]


def _fit(over_m: np.ndarray, columns: Sequence[np.ndarray]) -> np.ndarray:
    """Fit columns to what a scan has over the first, one number each; far points have no say."""
    every = max(1, math.isqrt(over_m.size // SAMPLES))
    lines = slice(every // 2, None, every)
    sampled = [np.broadcast_to(one, over_m.shape)[lines, lines].reshape(-1) for one in columns]
    matrix = np.stack(sampled, axis=1)
    over_m = over_m[lines, lines].reshape(-1)
    good = np.isfinite(matrix).all(axis=1) & np.isfinite(over_m)
    scale = np.sqrt(np.square(matrix[good]).sum(axis=0))
    scale[scale == 0.0] = 1.0
    fit = np.zeros(scale.size)
    for _ in range(2):
        if not good.any():
            break
        fit = np.linalg.lstsq(matrix[good] / scale, over_m[good], rcond=None)[0] / scale
        good[good] = _near(np.abs(over_m - matrix @ fit)[good])
    return fit


def _near_noise(noise_m: np.ndarray) -> np.ndarray:
    """Tell which points of a map are known and no farther off than noise is."""
    near = ~np.isnan(noise_m)
    if near.any():
        near[near] = _near(np.abs(noise_m[near]))
    return near


def _near(off_m: np.ndarray) -> np.ndarray:
    """Tell which points are no farther off than noise is."""
    near: np.ndarray = off_m <= FAR * deviation_m(off_m)
    return near


def _apart(
    first_m: np.ndarray, other_m: np.ndarray, shift: np.ndarray, pixel_size_m: tuple[float, float]
) -> _Apart:
    here_m, fitted = other_m, np.zeros(3)
    for placed in range(1 + MAX_PLACED):
        over_m, columns = here_m - first_m, _columns(first_m, here_m, pixel_size_m)
        fit = _fit(over_m, columns)
        parts_m = [share * one for share, one in zip(fit, columns, strict=True)]
        plane_m, form_m, lies_m = (np.asarray(sum(parts_m[some])) for some in (PLANE, FORM, PLACE))
        noise_m = over_m - sum(parts_m)
        near = _near_noise(noise_m)
        fitted = fitted + fit[PLACE]
        seen = np.square(lies_m[near]).sum() > HIDDEN**2 * np.square(noise_m[near]).sum()
        if placed == MAX_PLACED or not seen or min(first_m.shape) < LEAST_PLACED:
            break
        if placed == 0:
            level_m, expected_m = other_m - plane_m, first_m + form_m + lies_m
            smooth_m = _smooth(level_m, expected_m, near)
            own_m = level_m - smooth_m  # spikes and holes stay at their pixels
        here_m = own_m + _placed(smooth_m, fitted, pixel_size_m)
    dy, dx = shift - fitted[:2]
    return _Apart(
        height_m=here_m - plane_m - form_m,
        form_m=form_m,
        noise_m=noise_m,
        moved_pixels=(float(dy), float(dx)),
        turn_rad=float(fitted[2]),
        kept=_kept(fitted[:2]) if here_m is not other_m else (1.0, 1.0),
    )


def _smooth(level_m: np.ndarray, expected_m: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return heights that can be interpolated: without the holes, and the spikes of either scan."""
    smooth_m = np.where(np.isnan(level_m), expected_m, level_m)
    far = ~near & ~np.isnan(level_m + expected_m)
    around_m = from_nearest(np.where(far, np.nan, smooth_m))
    spike = far & (np.abs(expected_m - around_m) < np.abs(level_m - around_m))  # in this scan
    smooth_m[spike] = expected_m[spike]
    return np.where(np.isnan(smooth_m), around_m, smooth_m)


def _placed(
    height_m: np.ndarray, fitted: np.ndarray, pixel_size_m: tuple[float, float]
) -> np.ndarray:
    """Return the heights of a scan at the pixels of the first, off which it lies as was fitted."""
    from scipy.ndimage import affine_transform

    along_y, along_x, turn_rad = fitted
    square = pixel_size_m[1] / pixel_size_m[0]
    matrix = np.array([[1.0, -turn_rad * square], [turn_rad / square, 1.0]])
    centre = 0.5 * (np.array(height_m.shape) - 1.0)
    offset = centre - matrix @ centre - (along_y, along_x)
    wide_m = np.pad(height_m, RIM, "reflect", reflect_type="odd")  # slopes go on beyond its end
    placed_m: np.ndarray = affine_transform(
        wide_m, matrix, offset + RIM, output_shape=height_m.shape, order=5, mode="nearest"
    )
    return placed_m


def _kept(move: np.ndarray) -> tuple[float, float]:
    """Return what splines leave of white noise: its variance, and that of mixed differences."""
    from scipy.ndimage import shift

    point = np.zeros(64)
    point[32] = 1.0
    weights = [shift(point, by, order=5) for by in move]
    variance = math.prod(float(one @ one) for one in weights)
    return variance, math.prod(float(np.square(np.diff(one, 2)).sum()) / 6.0 for one in weights)


def _face_m2(face: HeightMap) -> float:
    """Return the variance of the heights of a face, less a form of the second degree."""
    if not face.measured.any():
        return 0.0
    return float(np.nanmean(np.square(remove_form(face, "quadratic")[0].height_m)))


def _refuse_copies(scans: Sequence[HeightMap], noise_m: np.ndarray) -> None:
    """Refuse scans of which any two hold the same heights, or the same seven digits of them."""
    ranges_m = [np.ptp(np.nanquantile(one.height_m, (0.01, 0.99))) for one in scans]
    each = zip(scans, noise_m, ranges_m, strict=True)
    for (one, one_m, range_m), (other, other_m, _) in combinations(each, 2):
        if np.fmax.reduce(np.abs(other_m - one_m), axis=None) <= ROUNDING * range_m:
            raise SettingsError(
                f"{one.origin.name} and {other.origin.name}: hold the same heights; expected two "
                "scans of one place"
            )


def _check_place(first: HeightMap, other: HeightMap, face_m2: float, one: _Apart) -> None:
    """Refuse a scan of another place, and one that is turned."""
    names = f"{first.origin.name} and {other.origin.name}"
    off_m = np.abs(one.noise_m[~np.isnan(one.noise_m)])
    noise_m2 = 0.5 * float(np.mean(np.square(off_m[_near(off_m)]))) if off_m.size else math.inf
    if noise_m2 > (1.0 - LEAST_MATCH) * face_m2:
        raise UnusableSurfaceError(
            f"{names}: less than {percent(LEAST_MATCH)} of the variance of their heights is in "
            "both; expected scans of one place, by one instrument and without moving the part"
        )
    corner = 0.5 * math.hypot(*first.side_m) / min(first.pixel_size_m)
    if abs(one.turn_rad) * corner > MOST_TURNED_PIXELS:
        raise UnusableSurfaceError(
            f"{names}: turned by {abs(one.turn_rad):.2g} rad against each other, which moves a "
            f"corner by {abs(one.turn_rad) * corner:.2g} pixels; expected scans without moving the "
            "part"
        )


def _leave_out_spikes(level_m: np.ndarray, noise_m: np.ndarray) -> int:
    """Make non-measured, in both, what one scan has and the others have not; return how many.

    Of two scans nobody knows which one is right, and both lose it.
    """
    apart_m = np.where(np.isnan(noise_m[0]), level_m, noise_m)  # also where the first has a hole
    some = np.count_nonzero(~np.isnan(apart_m), axis=0) >= 2
    off_m = np.abs(apart_m[:, some] - np.nanmedian(apart_m[:, some], axis=0))
    if not (off_m > 0.0).any():
        return 0
    spike = off_m > SPIKE * np.median(off_m[off_m > 0.0]) / MEDIAN_OF_NORMAL
    if spike.mean() > MOST_SPIKES:
        return 0
    for heights_m in (level_m, noise_m):
        heights_m[:, some] = np.where(spike, np.nan, heights_m[:, some])
    return int(np.count_nonzero(spike))


def _mean_m(level_m: np.ndarray) -> np.ndarray:
    """Return means of the scans, of which half at least measured a point."""
    known = ~np.isnan(level_m)
    count = known.sum(axis=0)
    total_m = np.where(known, level_m, 0.0).sum(axis=0)
    enough = 2 * count >= len(level_m)
    return np.divide(total_m, count, out=np.full(count.shape, np.nan), where=enough)


def _rms_m(noise_m: np.ndarray, here: np.ndarray) -> float:
    """Return the noise of one scan, from what they change by where all measured."""
    variance_m2 = np.var(noise_m[:, here], axis=0, ddof=1)
    variance_m2 = variance_m2[~np.isnan(variance_m2)]
    return math.sqrt(np.mean(variance_m2)) if variance_m2.size else 0.0


def _left_and_of_one_m(
    noise_m: np.ndarray, here: np.ndarray, kept: np.ndarray
) -> tuple[float, float, float | None]:
    """Return what splines left of the noise of one scan, all of it, and its white part if known."""
    left_m, white_m = _rms_m(noise_m, here), white_noise_of_scans_m(noise_m, here)
    if white_m is None:
        return left_m, left_m, None
    white_m /= math.sqrt(kept[1])
    return left_m, math.sqrt(left_m**2 + (1.0 - kept[0]) * white_m**2), white_m
