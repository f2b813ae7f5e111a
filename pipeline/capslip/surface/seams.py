"""Seams: straight lines along which the heights jump, as where fields of view were stitched."""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from capslip.errors import UnusableSurfaceError
from capslip.surface.form import floor_slopes
from capslip.surface.heightmap import HeightMap
from capslip.surface.noise import some_lines

PARTS = 4  # of a line: fields above and below one another jump by different heights
CLEAR = 3.0  # times what 95 % of all lines jump by: 4.6 standard deviations of normal parts
LEAST_LINES = 32  # along an axis, and from one seam to the next: closer ones are a lay
LEAST_POINTS = 8  # of a part of a line, that tell its jump
MOST_POINTS = 80  # of these that are looked at: a median of so many scatters by a seventh of them
ALONE = 0.5  # of a jump, that others so close may have: rims of hills jump by a little
# Times what 95 % of all lines jump by, for a second part: the rim of a hill, or a straight valley
# between some, is in one part of a line alone
COMMON = 2.0
OF_STEP = np.array([-0.5, 1.0, -0.5])  # what lines jump by about a step of one
REACH = 4  # lines on either side of a step that tell what it has beside them; 6 and 8 tell no more
FURTHER = 8  # lines on either side that tell a step from a bend
# Of bends, in pixels from the middle between the lines that a step parts: they lie on no line
PLACES = np.linspace(-1.0, 1.0, 9)
# Times what the best bend explains, that a step must: there are more bends, and of weak steps noise
# lets the best of them explain up to 2 % more
AS_GOOD = 0.98
SIGMA_SHARE = 0.68  # of normal numbers lie within a standard deviation
OUTLYING = 3.0  # standard deviations, to which what is usual is cut: rims of hills are not
RIDGE = 1e-3  # of their square, that no neighbour tells: few lines say how alike they are
ROUNDING = 1e-6  # of the height range: what lines of a plane floor jump by
# Overlaps are a tenth of a field wide and more: what is left of a step where fields meet may come
# of a tilt that lifts their far sides ten times as high
RISE_OVER_STEP = 10.0


@dataclass(frozen=True, eq=False)
class Seams:
    """Fields that seams bound, and by how much each lies above the mean of all."""

    surface: HeightMap
    rows: np.ndarray  # (r + 2,), the first row of each field, with 0 and ny
    columns: np.ndarray  # (c + 2,)
    offset_m: np.ndarray  # (r + 1, c + 1)

    @property
    def span_m(self) -> float:
        """Height of the highest field over the lowest one."""
        return float(np.ptp(self.offset_m))

    @cached_property
    def tilts(self) -> tuple[np.ndarray, np.ndarray]:
        """Slopes (y, x) of the fields, shape (2, r + 1, c + 1), and their levels without these.

        See `tilts_m`, for which they are found once: their sum is as large as the map.
        """
        surface, slope = self.surface, np.zeros((2, *self.offset_m.shape))
        dy_m, dx_m = surface.pixel_size_m
        for i, j, rows, columns in self.blocks:
            field_m = surface[rows.start : rows.stop, columns.start : columns.stop]
            with suppress(UnusableSurfaceError):
                slope[:, i, j] = floor_slopes(HeightMap(field_m, (dy_m, dx_m)))
        sizes_m = tuple(
            size_m * np.diff(edges)
            for size_m, edges in zip(surface.pixel_size_m, self._measured, strict=True)
        )
        area_m2 = np.outer(*sizes_m).reshape(-1)
        slope -= np.average(slope.reshape(2, -1), axis=1, weights=area_m2)[:, None, None]
        rise_m = np.abs(slope[0]) * sizes_m[0][:, None] + np.abs(slope[1]) * sizes_m[1]
        most_m = float(rise_m.max())
        slope *= min(1.0, RISE_OVER_STEP * self.span_m / most_m) if most_m > 0.0 else 1.0
        level_m = surface.height_m - self.over(slope)
        return slope, _offsets_m(level_m, self.rows, self.columns)

    @property
    def _measured(self) -> list[np.ndarray]:
        """Rows and columns as far as they were measured: a margin is of no field."""
        window = self.surface.measured_window
        of_axes = zip((self.rows, self.columns), window, strict=True)
        return [np.clip(edges, one.start, one.stop) for edges, one in of_axes]

    @property
    def blocks(self) -> list[tuple[int, int, slice, slice]]:
        """Row and column of each field among the others, and its points."""
        of_rows, of_columns = self._measured
        return [
            (i, j, slice(*rows), slice(*columns))
            for i, rows in enumerate(pairwise(of_rows))
            for j, columns in enumerate(pairwise(of_columns))
        ]

    def over(self, slope: np.ndarray) -> np.ndarray:
        """Return planes of slopes (y, x) about the middles of the fields, shape (ny, nx)."""
        dy_m, dx_m = self.surface.pixel_size_m
        tilt_m = np.zeros(self.surface.shape)
        for i, j, rows, columns in self.blocks:
            y_m = dy_m * (np.arange(rows.start, rows.stop) - 0.5 * (rows.start + rows.stop - 1))
            x_m = dx_m * (
                np.arange(columns.start, columns.stop) - 0.5 * (columns.start + columns.stop - 1)
            )
            tilt_m[rows, columns] = slope[0, i, j] * y_m[:, None] + slope[1, i, j] * x_m
        return tilt_m


def find_seams(surface: HeightMap) -> Seams | None:
    """Find straight seams along rows and columns, None where there are none.

    A smooth surface goes on from two lines to the next two: what it jumps by between two lines is
    the difference of their heights less the mean of those before and behind. The median of that
    over a part of a line takes noise and hills off. Of that is taken what the jumps of the lines
    beside let one expect, and what is left is compared with all other lines: a lay along an axis
    jumps everywhere, a seam stands off, alone and in more than one part. Where an edge begins, the
    slope or the curvature changes at a line, which makes lines jump, too: a seam is what a step
    explains better than these.

    Parameters
    ----------
    surface : HeightMap
        Any form.

    Returns
    -------
    Seams or None
        Offsets of the fields by least squares over all seams between two of them.

    Examples
    --------
    >>> y, x = np.mgrid[:80, :120] * 1e-5
    >>> one_field = np.where((y < 4e-4) & (x < 7e-4), 3e-8, 0.0)
    >>> seams = find_seams(HeightMap(1e-3 * x**2 + one_field, (1e-5, 1e-5)))
    >>> seams.rows.tolist(), seams.columns.tolist(), round(1e9 * seams.span_m, 3)
    ([0, 40, 80], [0, 70, 120], 30.0)
    """
    y, x = surface.measured_window
    of_rows, of_columns = (some_lines(one, PARTS * MOST_POINTS) for one in (x, y))
    rows = y.start + _seams_along(surface[y, of_rows], surface.bounds_m)
    columns = x.start + _seams_along(surface[of_columns, x].T, surface.bounds_m)
    if not rows.size and not columns.size:
        return None
    ny, nx = surface.shape
    rows, columns = np.array([0, *rows, ny]), np.array([0, *columns, nx])
    offset_m = _offsets_m(surface.height_m, rows, columns)
    # Edges of hills along a line may jump where the fields beside them lie on one level
    if np.ptp(offset_m) <= ROUNDING * np.ptp(surface.bounds_m):
        return None
    return Seams(surface, rows, columns, offset_m)


def levels_m(seams: Seams) -> np.ndarray:
    """Return how high the fields lie at all points of their map, shape (ny, nx)."""
    sizes = np.diff(seams.rows), np.diff(seams.columns)
    return np.repeat(np.repeat(seams.offset_m, sizes[0], axis=0), sizes[1], axis=1)


def tilts_m(seams: Seams) -> np.ndarray:
    """Return how high the fields lie where their floors are tilted, too, shape (ny, nx).

    Against the mean of all, and by no more than errors of the overlaps that left these steps may
    have done. On the levels that leave no steps then.
    """
    slope, offset_m = seams.tilts
    return np.asarray(seams.over(slope) + levels_m(replace(seams, offset_m=offset_m)))


def _jumps_m(lines_m: np.ndarray) -> np.ndarray:
    """Return the medians of the jumps from lines to the next, from the second on, shape (n - 3,).

    NaN where too few points of a line, shape (n, points), are known.
    """
    step_m = lines_m[1:] - lines_m[:-1]
    jump_m = step_m[:-2] + step_m[2:]
    jump_m *= -0.5
    jump_m += step_m[1:-1]
    jump_m.sort(axis=1)  # unknown ones last; far quicker than to part them at two places
    n_known, some_lost = np.full(len(jump_m), jump_m.shape[1]), np.isnan(jump_m[:, -1])
    n_known[some_lost] = np.count_nonzero(np.isfinite(jump_m[some_lost]), axis=1)
    line = np.arange(len(jump_m))
    low_m, high_m = jump_m[line, (n_known - 1) // 2], jump_m[line, n_known // 2]
    return np.where(n_known >= LEAST_POINTS, 0.5 * (low_m + high_m), np.nan)


def _seams_along(lines_m: np.ndarray, bounds_m: tuple[float, float]) -> np.ndarray:
    """Return the lines, shape (n, points), that begin a field."""
    n, n_points = lines_m.shape
    if n < LEAST_LINES or n_points < PARTS * LEAST_POINTS:
        return np.zeros(0, dtype=int)
    lowest_m, highest_m = bounds_m
    least_m, parts = ROUNDING * (highest_m - lowest_m), []
    for part in range(PARTS):
        # One point that does not divide is of two parts, so that a mirrored map has the same
        a, b = part * n_points // PARTS, -(-(part + 1) * n_points // PARTS)
        # From the middle of all heights: what float32 rounds off is a tenth of the least jump
        part_m = np.empty_like(lines_m[:, a:b], dtype=np.float32)  # turned as few bytes, later
        np.subtract(lines_m[:, a:b], 0.5 * (lowest_m + highest_m), out=part_m, casting="same_kind")
        parts.append(_jumps_m(np.ascontiguousarray(part_m)))
    return _stand_off(np.array(parts, dtype=float), least_m) + 2  # the first is into the third


def _stand_off(jump_m: np.ndarray, least_m: float) -> np.ndarray:
    """Return the lines that jump by more than the others, and alone, of parts (parts, n).

    The strongest one first: it is taken off before the others are looked at again, as what it jumps
    by would hide weaker ones in what is usual.
    """
    edge = LEAST_LINES // 2 - 2
    is_open = np.zeros(jump_m.shape[1], dtype=bool)
    is_open[edge : is_open.size - edge] = True
    found, left_m = list[int](), jump_m
    while is_open.any():
        step_m, unsure_m = _sharpened(left_m, left_m, least_m)
        line = int(np.argmax(np.where(is_open, _rms(step_m / unsure_m), 0.0)))
        if not is_open[line]:  # none jumps at all
            break
        rest_m = left_m - _of_step(step_m[:, line], line, is_open.size)
        step_m, unsure_m = _sharpened(left_m, rest_m, least_m)
        beside_m, _ = _sharpened(rest_m, rest_m, least_m)
        usual = max(float(np.quantile(_rms(beside_m / unsure_m), 0.95)), 1.0)
        of_parts = np.abs(step_m[:, line] / unsure_m[:, line])
        of_parts = np.sort(of_parts[np.isfinite(of_parts)])
        if _rms(of_parts) <= CLEAR * usual:
            break
        near = slice(max(line - LEAST_LINES + 1, 0), line + LEAST_LINES)
        is_common = of_parts.size == 1 or of_parts[-2] > COMMON * usual
        is_alone = _rms(beside_m[:, near]).max() < ALONE * _rms(step_m[:, line])
        if is_common and is_alone and not _is_bend(left_m, rest_m, line, least_m):
            found.append(line)
            left_m = rest_m
        is_open[near] = False
    return np.sort(np.array(found, dtype=int))


def _sharpened(
    jump_m: np.ndarray, usual_m: np.ndarray, least_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return by which steps parts (parts, n) jump beside what their neighbours let one expect.

    And the standard deviation of that. Both are of generalised least squares: a step makes the
    lines about it jump, too, by known shares, and the usual jumps, of a surface that waves or lines
    that are noisy, are alike from one line to the next. NaN at the ends of what is known.
    """
    step_m, unsure_m = np.full(jump_m.shape, np.nan), np.ones(jump_m.shape)
    n, (variance_m2, covariance) = jump_m.shape[1], _usual(usual_m, REACH, least_m)
    if variance_m2 == 0.0:
        return step_m, unsure_m
    for reach in range(REACH, 0, -1):  # fewer beside lines that are lost
        width = 2 * reach + 1
        of_step = np.zeros(width)
        of_step[reach - 1 : reach + 2] = OF_STEP
        weight = np.linalg.solve(covariance[:width, :width], of_step)
        told, inner = float(weight @ of_step), np.s_[:, reach : n - reach]
        seen_m = np.array([np.correlate(part_m, weight / told, "valid") for part_m in jump_m])
        new = np.isnan(step_m[inner]) & np.isfinite(seen_m)
        step_m[inner][new], unsure_m[inner][new] = seen_m[new], np.sqrt(variance_m2 / told)
    return step_m, unsure_m


def _usual(usual_m: np.ndarray, reach: int, least_m: float) -> tuple[float, np.ndarray]:
    """Return the variance of the usual jumps, 0 of none, and how alike they are within a reach.

    The latter has the shape (2 reach + 1, 2 reach + 1).
    """
    known, lags = np.isfinite(usual_m), np.arange(2 * reach + 1)
    if not known.any():
        return 0.0, np.eye(lags.size)
    most_m = OUTLYING * np.quantile(np.abs(usual_m[known]), SIGMA_SHARE)
    usual_m = np.clip(np.where(known, usual_m, 0.0), -most_m, most_m)
    n = usual_m.shape[1]
    alike_m2 = np.array([(usual_m[:, k:] * usual_m[:, : n - k]).sum() for k in lags]) / known.sum()
    alike_m2[0] += RIDGE * alike_m2[0] + least_m**2
    if alike_m2[0] == 0.0:
        return 0.0, np.eye(lags.size)
    return float(alike_m2[0]), (alike_m2 / alike_m2[0])[np.abs(lags[:, None] - lags)]


def _is_bend(jump_m: np.ndarray, usual_m: np.ndarray, line: int, least_m: float) -> bool:
    """Return whether a kink, or the onset of a curvature, explains more than a step at a line.

    Of the squares of parts (parts, n) about it, by generalised least squares as in `_sharpened`. A
    bend lies at one place of all parts, as a step does.
    """
    _, covariance = _usual(usual_m, FURTHER, least_m)
    of_steps, of_bends = np.zeros(len(PLACES) - len(PLACES) // 2), np.zeros(2 * len(PLACES))
    for part_m in jump_m:
        for reach in range(FURTHER, 0, -1):  # fewer beside lines that are lost
            about_m, width = part_m[line - reach : line + reach + 1], 2 * reach + 1
            if np.isfinite(about_m).all():
                shapes = np.vstack(_shapes(reach))
                weight = np.linalg.solve(covariance[:width, :width], shapes.T)
                explained = (about_m @ weight) ** 2 / (shapes.T * weight).sum(axis=0)
                of_steps += explained[: of_steps.size]
                of_bends += explained[of_steps.size :]
                break
    return bool(of_steps.max() < AS_GOOD * of_bends.max())


def _shapes(reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what lines jump by about steps, and about kinks and then onsets of curvature.

    A step is a slope from a kink to one that takes it back a line further: where a map was
    resampled, it may lie up to half a line off, and then takes two.
    """
    beyond = np.arange(2 * reach + 4) - (reach + 1.5) - PLACES[:, None]
    kink, onset = (np.clip(beyond, 0.0, None) ** power for power in (1, 2))
    half = len(PLACES) // 2
    step = kink[:-half] - kink[half:]
    return -0.5 * np.diff(step, 3, axis=1), -0.5 * np.diff(np.vstack([kink, onset]), 3, axis=1)


def _of_step(step_m: np.ndarray, line: int, n: int) -> np.ndarray:
    """Return what n lines jump by about steps of parts at one of them, shape (parts, n)."""
    jump_m = np.zeros((step_m.size, n))
    jump_m[:, line - 1 : line + 2] = np.nan_to_num(step_m)[:, None] * OF_STEP
    return jump_m


def _rms(parts: np.ndarray) -> np.ndarray:
    """Return the root mean square over the parts that are known, 0 where none is."""
    known = np.isfinite(parts)
    square = np.where(known, parts, 0.0) ** 2
    return np.asarray(np.sqrt(square.sum(axis=0) / np.maximum(known.sum(axis=0), 1)))


def _offsets_m(height_m: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the offsets of fields from the jumps over all seams, with a mean of zero."""
    shape = len(rows) - 1, len(columns) - 1
    field = np.arange(shape[0] * shape[1]).reshape(shape)
    pairs, jump_m = [np.ones(field.size)], [0.0]
    for z, fields, lines, others in (
        (height_m.T, field, rows, columns),
        (height_m, field.T, columns, rows),
    ):
        for i, (first, last) in enumerate(pairwise(lines)):
            for j, seam in enumerate(others[1:-1]):
                (jump,) = _jumps_m(z[seam - 2 : seam + 2, first:last])
                if np.isfinite(jump):
                    pairs.append(np.zeros(field.size))
                    pairs[-1][[fields[i, j], fields[i, j + 1]]] = -1.0, 1.0
                    jump_m.append(float(jump))
    offset_m = np.linalg.lstsq(np.array(pairs), np.array(jump_m), rcond=None)[0]
    return np.asarray(offset_m.reshape(shape))
