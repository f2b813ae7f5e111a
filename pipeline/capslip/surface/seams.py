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
CLEAR = 4.0  # times what 95 % of all lines jump by: 6 standard deviations of normal jumps
LEAST_LINES = 32  # along an axis, and from one seam to the next: closer ones are a lay
LEAST_POINTS = 8  # of a part of a line, that tell its jump
MOST_POINTS = 80  # of these that are looked at: a median of so many scatters by a seventh of them
ALONE = 0.5  # of a jump, that others so close may have: rims of hills jump by a little
NEIGHBOUR = 0.8  # of a jump, that those beside it may have: half of it, and noise
# Of the squares of all jumps, that no levels of fields explain, where most seams do not jump:
# around a corner of four fields jumps sum to zero. Where hills meet in a straight valley one jumps
# alone, of which a quarter is left, or two do, of which an eighth is; of tilted fields all jump
MOST_LEFT = 0.1
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
        offset_m = _offsets_m(level_m, self.rows, self.columns)
        return slope, self.offset_m if offset_m is None else offset_m

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
    over a part of a line takes noise and hills off, and is compared with all other lines: a lay
    along an axis jumps everywhere, a seam stands off, alone.

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
    if offset_m is None or np.ptp(offset_m) <= ROUNDING * np.ptp(surface.bounds_m):
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
    square = np.array(parts, dtype=float) ** 2
    known = np.isfinite(square)
    counts = np.maximum(known.sum(axis=0), 1)
    jump_m = np.sqrt(np.where(known, square, 0.0).sum(axis=0) / counts)
    usual_m = max(float(np.quantile(jump_m, 0.95)), least_m)
    beside_m = np.maximum(np.append(0.0, jump_m[:-1]), np.append(jump_m[1:], 0.0))
    clear = (jump_m > CLEAR * usual_m) & (beside_m < NEIGHBOUR * jump_m)
    at, height_m = np.flatnonzero(clear) + 2, jump_m[clear]  # the first jump is into the third
    near = np.abs(at[:, None] - at) < LEAST_LINES
    alone = (near & (height_m > ALONE * height_m[:, None])).sum(axis=1) == 1
    inside = (at >= LEAST_LINES // 2) & (at <= n - LEAST_LINES // 2)
    return np.asarray(at[alone & inside])


def _offsets_m(height_m: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray | None:
    """Return the offsets of fields from the jumps over all seams, with a mean of zero.

    None where a few seams jump by what no levels of fields explain.
    """
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
    of_fields, jumps_m = np.array(pairs), np.array(jump_m)
    offset_m = np.linalg.lstsq(of_fields, jumps_m, rcond=None)[0]
    left_m, high_m = jumps_m - of_fields @ offset_m, np.abs(jumps_m[1:])
    few = high_m.size and np.median(high_m) < ALONE * high_m.max()
    if few and left_m @ left_m > MOST_LEFT * (jumps_m @ jumps_m):
        return None
    return np.asarray(offset_m.reshape(shape))
