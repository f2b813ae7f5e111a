"""What makes a height map doubtful before anything is computed from it."""

from typing import TYPE_CHECKING

import numpy as np

from capslip.errors import UnusableSurfaceError
from capslip.problems import Problem, Severity
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap, Heights, Tops
from capslip.surface.interpolated import pixels_apart
from capslip.surface.outliers import Outliers
from capslip.surface.ripple import find_ripple
from capslip.surface.rows import even_lines, row_blocks
from capslip.surface.seams import Seams, tilts_m
from capslip.surface.shifts import LEAST_OVERLAP
from capslip.surface.tops import clipped_points
from capslip.units import percent, readable

if TYPE_CHECKING:
    from capslip.surface.mating import Placement

MAX_STEEP_SHARE = 0.05
MAX_SZ_OVER_SQ = 30.0
SQUARE_WITHIN = 1e-3
MAX_PIXEL_RATIO = 10.0  # cm taken for mm; below, no unit explains it, and pixels are what they are
UNLIKE = 3.0  # of lengths along both axes: half way to the ten of another unit
SMALLEST_SZ_M = 1e-10  # an atom
LARGEST_SIDE_M = 1.0
LENGTHS_M = (
    1e-20,
    1e6,
)  # of heights and sides; beyond it powers of them leave the floating numbers
SAMPLED_LINES = 100
HIGHEST_SHARE = 0.10  # what the paper keeps: a spike up there is touched, or spoils a cap
# Of the rms slope of all: in waves, noise and caps alike, in any unit, that of the top is a third
WALLS = 0.25
VISIBLE_SHARE_OF_SQ = 0.01
MAX_OUTLIER_SHARE = 0.02
LIFTED = "lie on patches that are lifted as a whole: grains, chips or fringes miscounted"
LEAST_MATCH = 0.5  # of two faces that are laid on each other
LEAST_OF_SECOND = 0.03  # a face a hundred times as large as its mate may be in another unit
VISIBLE_RIPPLE = 0.02  # of the approach: its height
VISIBLE_FORM = 0.1  # of the approach: form that moves the peaks by more decides what touches


def refuse_absurd(surface: HeightMap) -> None:
    """Refuse lengths that no unit makes plausible, before a power of them overflows.

    Raises
    ------
    UnusableSurfaceError
        If the heights, their range or a side of the face are beyond 1e-20 to 1e6 m. Equal heights
        have a range of zero and are left to others.
    """
    low_m, high_m = LENGTHS_M
    lowest_m, highest_m = surface.bounds_m  # NaN without measured points
    for what, length_m in (
        ("heights of up to", max(abs(lowest_m), abs(highest_m))),
        ("a height range of", highest_m - lowest_m),
        ("a side of", min(surface.side_m)),
        ("a side of", max(surface.side_m)),
    ):
        if length_m > high_m or (0.0 < length_m < low_m):
            raise UnusableSurfaceError(
                f"{surface.origin.name}: {what} {length_m:.3g} m; expected {low_m:g} to "
                f"{high_m:g} m; check the units (--unit, --lateral-unit) and the code for missing "
                "data"
            )


def problems_of_scan(surface: HeightMap, tops: Tops | None) -> list[Problem]:
    """Return what makes the map as measured doubtful; levelling would hide a flat top.

    Parameters
    ----------
    surface : HeightMap
        As measured.
    tops : Tops or None
        What was put back of it, where that is known.

    Returns
    -------
    list of Problem
        `clipped` (warning) where points share the greatest height that are no step of many.
    """
    clipped = clipped_points(surface)
    if clipped is None:
        return []
    message = f"{clipped.size} points share the greatest height: the sensor cut the peaks off"
    if tops is None or tops.counts["restored"] == 0:
        message += ", and the caps are higher than they look"
    else:
        top = int(tops.up_m.argmax())
        message += (
            f"; {tops.counts['restored']} tops were put back as their flanks carry on, the highest "
            f"by {tops.up_m[top]:.3g} m with a standard error of {tops.height_se_m[top]:.2g} m"
        )
        message += f"; {tops.left} stay flat: their flanks do not tell" if tops.left else ""
    return [Problem("clipped", "warning", message)]


def problems_of_points(surface: HeightMap) -> list[Problem]:
    """Return whether most points of the map as measured were interpolated between the others."""
    apart = pixels_apart(surface)
    if max(apart) == 1:
        return []
    dy_m, dx_m = (n * size_m for n, size_m in zip(apart, surface.pixel_size_m, strict=True))
    lines = zip(apart, ("row", "column"), strict=True)
    measured = " and ".join(f"every {n}. {line}" for n, line in lines if n > 1)
    message = (
        f"{measured} was measured, and what lies between was interpolated: the map resolves no "
        f"more than one of pixels of {dy_m:.3g} x {dx_m:.3g} m (dy x dx)"
    )
    return [Problem("interpolated", "warning", message)]


def problems_of_map(surface: HeightMap, sq_m: float, sz_m: float) -> tuple[Problem, ...]:
    """Look for signs of a wrong unit, odd pixels and heights far from the rest.

    Parameters
    ----------
    surface : HeightMap
        Heights after conditioning.
    sq_m, sz_m : float
        Its root mean square height and height range.

    Returns
    -------
    tuple of Problem
        `slope_suspect` (error) where the height range exceeds the shorter side of the face, or
        (warning) where the rms slope or more than 5 % of all slopes exceed 1 (info where those of
        the highest tenth are far smaller: pits have walls, and are not touched), and
        `scale_suspect` (warning) where it is below the size of an atom or a side is longer than
        1 m: a wrong unit until proven otherwise. `outliers` where Sz/Sq exceeds 30: a warning
        where peaks, info where pits do it. `non_square_pixels` (info; warning from a ratio of 10
        on).
    """
    found = (
        _steep(surface, sz_m),
        _scale(surface, sz_m),
        _range(surface, sq_m, sz_m),
        _pixel(surface),
    )
    return tuple(problem for problem in found if problem is not None)


def problems_of_outliers(
    surface: HeightMap, sq_m: float, outliers: Outliers, kept: bool
) -> tuple[Problem, ...]:
    """Say how many points the outlier rule found, and whether they matter.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form, with the outliers or without.
    sq_m : float
        Its root mean square height.
    outliers : Outliers
        What the rule found.
    kept : bool
        Whether these points are still part of the map.

    Returns
    -------
    tuple of Problem
        None where nothing was found. `outliers_removed` is info; a warning above 2 % of the
        points, where the rule no longer speaks of exceptions, unless they are as errors of single
        points are: up and down alike, and each for itself. `spikes`, for points that were kept,
        is a warning where one lies in the highest 10 % (it is touched, or spoils a cap) or where
        together they can move the form by more than 1 % of Sq; else info.
    """
    if outliers.index.size == 0:
        return ()
    return (_kept(surface, sq_m, outliers) if kept else _removed(surface, outliers),)


def problems_of_tilt(surface: HeightMap, approach_m: float) -> list[Problem]:
    """Return whether a tilt was left in that decides what touches."""
    level, _ = remove_form(surface, "plane")
    tilt_m = float(np.ptp((surface.height_m - level.height_m)[surface.measured]))
    if tilt_m <= VISIBLE_FORM * approach_m:
        return []
    message = (
        f"the levelling decides which caps touch: nothing was taken off the face, and its "
        f"least-squares plane is tilted by {tilt_m:.3g} m, the approach is {approach_m:.3g} m. "
        "Where that is how the face lay under the instrument, conditioning.form = plane takes it "
        "off; where it is the face's own, as caps on one side tilt that plane, leave it"
    )
    return [Problem("tilt_left", "warning", message)]


def problems_of_seams(seams: Seams, approach_m: float) -> list[Problem]:
    """Return whether fields with straight seams lie on levels, or tilts, that may decide."""
    apart_m = max(seams.span_m, float(np.ptp(tilts_m(seams))))
    if apart_m <= VISIBLE_FORM * approach_m:
        return []
    message = (
        f"straight seams along rows or columns cut the map into {seams.offset_m.size} fields, on "
        f"levels up to {seams.span_m:.3g} m apart, or {apart_m:.3g} m with the tilts that steps "
        f"like these may come of; the approach is {approach_m:.3g} m. Where fields of view were "
        "stitched, their overlaps have to be matched again; where the steps are the face's own, "
        "leave them"
    )
    return [Problem("seams", "warning", message)]


def problems_of_ripple(surface: HeightMap, approach_m: float) -> list[Problem]:
    """Return whether a ripple runs through a map that may decide, and whose it may be."""
    ripple = find_ripple(surface)
    if ripple is None or 2.0 * ripple.amplitude_m <= VISIBLE_RIPPLE * approach_m:
        return []
    message = (
        f"a ripple {2.0 * ripple.amplitude_m:.2g} m high and {ripple.wavelength_m:.3g} m long runs "
        "through the map, too regular for a face: it may be of vibrations or fringes; the "
        f"approach is {approach_m:.3g} m"
    )
    return [Problem("ripple", "warning", message)]


def problems_of_mating(
    composite: HeightMap, placement: "Placement", first: HeightMap, second: HeightMap
) -> tuple[Problem, ...]:
    """Say what makes the composite surface doubtful.

    Parameters
    ----------
    composite : HeightMap
        From `composite_surface`.
    placement : Placement
        From `place`.
    first, second : HeightMap
        The faces. A frame of lines without any point is no part of one.

    Returns
    -------
    tuple of Problem
        `mating_unrelated` (warning) where the place was looked for and the match is below 0.5, or
        as good at another place;
        `mating_overlap` (warning) where less than half of the first face is covered, or hardly any
        of the second one covers it.
    """
    found = []
    match = placement.correlation
    if match is not None and match < LEAST_MATCH:
        found.append(
            Problem(
                "mating_unrelated",
                "warning",
                f"at the best place the faces match by {match:.2f} only (1: peaks lie in pits, 0: "
                "nothing to do with each other); the place is one of many; give mating.offset_m",
            )
        )
    elif match is not None and (other := placement.other) is not None:
        dy_m, dx_m = other.offset_m
        found.append(
            Problem(
                "mating_unrelated",
                "warning",
                f"the faces match by {match:.3f} where they were laid, and by "
                f"{other.correlation:.3f} at offset_m = [{dy_m:.3g}, {dx_m:.3g}], as along a lay: "
                "which is better is not sure; give mating.offset_m",
            )
        )
    both_m2 = composite.n_measured * composite.pixel_area_m2
    of_first, of_second = (both_m2 / one.measured_area_m2 for one in (first, second))
    message = ""
    if of_first < LEAST_OVERLAP:
        message = f"{percent(of_first)} of the first only; check mating.offset_m and mating.mirror"
    elif of_second < LEAST_OF_SECOND:
        message = f"{percent(of_second)} of the second only; check the lateral units"
    if message:
        found.append(Problem("mating_overlap", "warning", f"both faces are measured on {message}"))
    return tuple(found)


def sanity_line(surface: HeightMap, sq_m: float, sz_m: float) -> str:
    """Return one line by which a wrong unit or a damaged map is seen at a glance.

    Parameters
    ----------
    surface : HeightMap
        The map as it is analysed.
    sq_m, sz_m : float
        Root mean square height and height range after removal of the form.
    """
    ratio = f"{sz_m / sq_m:.3g}" if sq_m > 0.0 else "-"
    heights = readable(f"Sq {sq_m:.3g} m, Sz {sz_m:.3g} m")
    return f"{points_line(surface)}; {heights}, Sz/Sq {ratio}"


def points_line(surface: HeightMap) -> str:
    """Return what a map has, as read or as analysed: points, sides, unit, and what is missing."""
    (ny, nx), (dy_m, dx_m), (side_y_m, side_x_m) = (
        surface.shape,
        surface.pixel_size_m,
        surface.side_m,
    )
    square = "" if abs(dy_m / dx_m - 1.0) <= SQUARE_WITHIN else " (not square)"
    missing = 100.0 * (1.0 - surface.n_measured / surface.size)
    which = "" if surface.origin.dataset is None else f" of {surface.origin.dataset!r}"
    return (
        readable(f"{nx} x {ny} points of {dx_m:.4g} x {dy_m:.4g} m{square}, ")
        + readable(f"{side_x_m:.4g} x {side_y_m:.4g} m")
        + f"; heights{which} stored in {surface.origin.height_unit or 'an unnamed unit'}; "
        + f"{missing:.3g} % non-measured"
    )


def _steep(surface: HeightMap, sz_m: float) -> Problem | None:
    side_m = min(surface.side_m)
    advice = "check the units of heights and pixels (--unit, --lateral-unit)"
    if sz_m > side_m:
        return Problem(
            "slope_suspect",
            "error",
            f"the heights range over {sz_m:.3g} m on a face only {side_m:.3g} m wide: {advice}",
        )
    rms_slope, steep_share = _slopes(surface, surface.pixel_size_m)
    if not _is_steep(rms_slope, steep_share):
        return None
    message = f"rms slope {rms_slope:.2g}, {100 * steep_share:.1f} % of the slopes above 1"
    least_m = np.nanquantile(surface.height_m, 1.0 - HIGHEST_SHARE)
    highest_m = np.where(surface.height_m >= least_m, surface.height_m, np.nan)
    at_top = _slopes(highest_m, surface.pixel_size_m)
    if _is_steep(*at_top) or at_top[0] > WALLS * rms_slope:
        return Problem("slope_suspect", "warning", f"{message}: {advice}")
    message += f"; not so where the face is touched, in its highest {HIGHEST_SHARE:.0%}: deep walls"
    return Problem("slope_suspect", "info", message)


def _scale(surface: HeightMap, sz_m: float) -> Problem | None:
    side_m = max(surface.side_m)
    if 0.0 < sz_m < SMALLEST_SZ_M:
        what = f"the heights range over {sz_m:.3g} m, less than an atom"
    elif side_m > LARGEST_SIDE_M:
        what = f"the face is {side_m:.3g} m long"
    else:
        return None
    return Problem(
        "scale_suspect",
        "warning",
        f"{what}: check the units of heights and pixels (--unit, --lateral-unit)",
    )


def _removed(surface: HeightMap, outliers: Outliers) -> Problem:
    n = outliers.index.size
    share = n / (n + surface.n_measured)
    errors = outliers.both_ways and not outliers.know_of_each_other(surface.shape[1])
    many = share > MAX_OUTLIER_SHARE and not errors
    return Problem(
        "outliers_removed",
        "warning" if many else "info",
        f"{n} points ({100 * share:.2g} %) stand off all that is around them, "
        f"{np.count_nonzero(outliers.step_m > 0.0)} of them upwards, and were marked as "
        "non-measured"
        + (f"; {outliers.n_lifted} of them {LIFTED}" if outliers.n_lifted else "")
        + ("; as many stand off downwards, as far: errors, no burrs" if outliers.both_ways else "")
        + (": too many for spikes" if many else ""),
    )


def _kept(surface: HeightMap, sq_m: float, outliers: Outliers) -> Problem:
    n = outliers.index.size
    measured_m = surface.height_m[surface.measured]
    high_m = np.quantile(measured_m, 1.0 - HIGHEST_SHARE)
    n_high = np.count_nonzero(surface.height_m.reshape(-1)[outliers.index] >= high_m)
    # A least-squares plane follows a far point by at most 7 times its share of the points.
    moved_m = 7.0 * float(np.abs(outliers.step_m).sum()) / measured_m.size
    matters = n_high > 0 or moved_m > VISIBLE_SHARE_OF_SQ * sq_m
    return Problem(
        "spikes",
        "warning" if matters else "info",
        f"{n} points stand off all that is around them and were kept; {n_high} of them lie in the "
        f"highest {100 * HIGHEST_SHARE:.0f} %, and together they move the form by up to "
        f"{moved_m:.2g} m; conditioning.outliers = isolated removes them",
    )


def _range(surface: HeightMap, sq_m: float, sz_m: float) -> Problem | None:
    if sz_m <= MAX_SZ_OVER_SQ * sq_m:
        return None
    sum_m = sum(float(np.nansum(surface[rows])) for rows in row_blocks(surface.shape))
    peak_m = surface.bounds_m[1] - sum_m / surface.n_measured
    if peak_m > 0.5 * MAX_SZ_OVER_SQ * sq_m:
        severity: Severity = "warning"
        what = f"peaks stand {peak_m:.3g} m above the mean; they are touched first; look at the map"
    else:
        severity = "info"
        what = f"pits lie {sz_m - peak_m:.3g} m below the mean; no contact reaches them"
    return Problem(
        "outliers", severity, f"Sz/Sq = {sz_m / sq_m:.0f} (above {MAX_SZ_OVER_SQ:.0f}): {what}"
    )


def _pixel(surface: HeightMap) -> Problem | None:
    dy_m, dx_m = surface.pixel_size_m
    if abs(dy_m / dx_m - 1.0) <= SQUARE_WITHIN:
        return None
    message = f"pixels of {dy_m:.6g} x {dx_m:.6g} m (dy x dx) are not square; this is accounted for"
    if max(dy_m / dx_m, dx_m / dy_m) <= MAX_PIXEL_RATIO * (1.0 - SQUARE_WITHIN):
        return Problem("non_square_pixels", "info", message)
    return Problem("non_square_pixels", "warning", f"{message}; check both sizes")


def sizes_fit(surface: HeightMap) -> bool:
    """Tell whether the texture is about as long along both axes, as pixels of true sizes show it.

    Parameters
    ----------
    surface : HeightMap
        Heights after conditioning.
    """
    along_y_m, along_x_m = _half_lengths_m(surface)
    return 1.0 / UNLIKE < along_y_m / along_x_m < UNLIKE  # never with NaN


def _half_lengths_m(surface: HeightMap) -> tuple[float, float]:
    """Return over which lengths along y and x the correlation of heights falls to a half.

    There the mean square difference of heights is their variance. NaN along an axis on which that
    is less than a pixel, or more than half the map: then its size has no part in it.
    """
    height_m, found = surface.height_m, []
    variance_m2 = float(np.nanvar(height_m)) or 1.0  # a flat map has no length
    for axis, size_m in enumerate(surface.pixel_size_m):
        some = _some_lines(height_m.shape[1 - axis])
        lines = height_m[:, some] if axis == 0 else height_m[some].T
        lags, shares = [0], [0.0]
        while shares[-1] < 1.0 and (lag := max(lags[-1] + 1, lags[-1] * 5 // 4)) <= len(lines) // 2:
            square_m2 = np.square(lines[lag:] - lines[:-lag])
            known_m2 = square_m2[np.isfinite(square_m2)]
            lags.append(lag)
            shares.append(float(known_m2.mean()) / variance_m2 if known_m2.size else 0.0)
        is_seen = len(lags) > 2 and shares[-1] >= 1.0
        half = np.interp(1.0, shares[-2:], lags[-2:]) if is_seen else np.nan
        found.append(float(half) * size_m)
    return found[0], found[1]


def _some_lines(n: int) -> slice:
    return even_lines(n, n // SAMPLED_LINES)


def _is_steep(rms_slope: float, steep_share: float) -> bool:
    return rms_slope > 1.0 or steep_share > MAX_STEEP_SHARE


def _slopes(height_m: Heights, pixel_size_m: tuple[float, float]) -> tuple[float, float]:
    """Return the rms slope and the share of slopes above 1, on lines along both axes."""
    square_sum, steep, n = 0.0, 0, 0
    for axis, size_m in enumerate(pixel_size_m):
        some = _some_lines(height_m.shape[1 - axis])
        lines = height_m[:, some] if axis == 0 else height_m[some]
        slope = np.diff(lines, axis=axis).reshape(-1) / size_m
        slope = slope[~np.isnan(slope)]
        square_sum += float(np.einsum("i,i", slope, slope))
        steep += int(np.count_nonzero(np.abs(slope) > 1.0))
        n += slope.size
    return (float(np.sqrt(square_sum / n)), steep / n) if n else (0.0, 0.0)
