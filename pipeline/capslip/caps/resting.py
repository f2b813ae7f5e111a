"""The plane on which a face rests at vanishing load: three points carry it.

A rigid plane that is laid on a face under a load point sinks and turns until it rests on three
points around that one: the facet of the upper convex hull of the heights that the line of action
passes through. It is a property of the face and not of the frame it was measured in: any plane
that is added to the map is added to it.
"""

from dataclasses import dataclass

import numpy as np

from capslip.caps.simplex import minimum
from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.surface.heightmap import HeightMap
from capslip.surface.rows import row_blocks

SQUARE = 3  # points, over which heights are averaged
FEW = 2000  # squares that are looked at first
NEAR = 0.01  # of the height range: squares so little below the plane are looked at with those above
MAX_FRAMES = 50  # levels that the heights are averaged in; two or three do
BELOW = 1e7  # height ranges: depth of the corners to start from
ROUNDING = 1e-12  # of the height range: a point so little above the plane lies on it


@dataclass(frozen=True)
class RestingPlane:
    """A plane over the face.

    Attributes
    ----------
    height_m : float
        At the load point.
    slope : (float, float)
        Along x and y.
    load_point_m : (float, float)
        Place (x, y) of the load.
    """

    height_m: float
    slope: tuple[float, float]
    load_point_m: tuple[float, float]


def resting_plane(
    surface: HeightMap, load_point_m: tuple[float, float] | None = None, square: int = SQUARE
) -> RestingPlane:
    """Find the plane on which the face rests under a load of no size.

    Parameters
    ----------
    surface : HeightMap
        A map without outliers; its form and level do not matter.
    load_point_m : (float, float), optional
        Place (x, y) of the line of action; the centre of what was measured by default.
    square : int
        Side of the squares of points over which heights are averaged, odd; see `Hills.square`.

    Returns
    -------
    RestingPlane

    Raises
    ------
    SettingsError
        If the square is not odd.
    UnusableSurfaceError
        If the load point lies outside the measured points, and the face tips over.

    Notes
    -----
    The corners are found among the mean heights of adjoining squares, the highest point of each
    left out, so that no spike carries the face, and squares with fewer than half of their points
    too. The lowest plane at the load point above all of them is a linear programme in three
    unknowns; the simplex method solves it: of the three corners of a triangle around the load
    point, the one that has to go is replaced by the point that stands highest above the plane,
    until none does. Which point of a square is its highest depends on the level, so the
    squares are averaged again in the frame of the plane that was found, until it stays. That makes
    the answer covariant: a plane added to the map comes out added, to rounding.
    Few squares give a first plane; then only those are looked at of which a point stands above it,
    or little below: until the plane has fallen by as much, these are all that can stop it.

    Examples
    --------
    >>> y, x = np.mgrid[0:90, 0:120] * 1e-4
    >>> height_m = 1e-6 - ((x - 2e-3) ** 2 + (y - 2e-3) ** 2) / 40
    >>> for place in ((1e-2, 2e-3), (6e-3, 8e-3)):
    ...     hill = 1e-6 - ((x - place[0]) ** 2 + (y - place[1]) ** 2) / 40
    ...     height_m = np.maximum(height_m, hill)
    >>> plane = resting_plane(HeightMap(height_m + 2e-4 * x, (1e-4, 1e-4)))
    >>> bool(np.allclose(plane.slope, (2e-4, 0.0), atol=1e-6))
    True
    """
    if square < 1 or square % 2 == 0:
        raise SettingsError(f"square: got {square}; expected an odd number of points")
    at_m = surface.centre_m if load_point_m is None else load_point_m
    squares = _Squares.of(surface, at_m, square)
    if squares.index.size < 3:  # hardly any square has points enough
        squares = _Squares.of(surface, at_m, 1)
    slope, n, range_m = squares.slope(), squares.index.size, float(np.ptp(surface.bounds_m))
    found, some, margin_m, scanned = None, np.arange(0, n, max(1, n // FEW)), NEAR * range_m, None
    corners_m = squares.outline_m()
    for _ in range(MAX_FRAMES):
        found = _facet(*squares.places_m(some), squares.heights_m(slope, some), range_m)
        if found is None and some.size < n:
            some = np.arange(n)
            continue
        if found is None:
            break
        corner, (level_m, turn_x, turn_y) = found
        corner, slope = some[corner], slope + np.array([turn_x, turn_y])
        plane_m = level_m + corners_m @ slope
        if scanned is None or (plane_m < scanned - margin_m).any():
            near, scanned = squares.above(slope, level_m - margin_m), plane_m
        highest_m = squares.heights_m(slope, near).max(initial=-np.inf)
        rounding_m = ROUNDING * max(range_m, abs(level_m))
        if highest_m <= squares.heights_m(slope, corner).min() + rounding_m:
            break
        some = np.union1d(near, corner)  # whatever stands above the plane is among them
    if found is None:
        raise UnusableSurfaceError(
            f"{surface.origin.name}: the load point x = {at_m[0]:g} m, y = {at_m[1]:g} m lies "
            "outside the measured points, and the face tips over; expected points on all sides of "
            "it; move contact.load_point_m"
        )
    return RestingPlane(float(level_m), (float(slope[0]), float(slope[1])), at_m)


@dataclass(frozen=True, eq=False)
class _Squares:
    """Squares of points with points enough; places count from the load point."""

    surface: HeightMap
    square: int
    corner: tuple[int, int]  # row and column of the first point
    x_axis_m: np.ndarray  # (columns, square) places of the points
    y_axis_m: np.ndarray  # (rows, square)
    index: np.ndarray  # of each square, counted row by row

    @classmethod
    def of(cls, surface: HeightMap, at_m: tuple[float, float], square: int) -> "_Squares":
        (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
        # What is left over falls away on both sides alike, so that a mirrored map is the same.
        rows, cols = (n // square - n % square % 2 for n in (ny, nx))
        if min(rows, cols) < 1:
            square, rows, cols = 1, ny, nx
        top, left = (ny - rows * square) // 2, (nx - cols * square) // 2
        y_m = ((np.arange(rows * square) + top + 0.5) * dy_m - at_m[1]).reshape(rows, square)
        x_m = ((np.arange(cols * square) + left + 0.5) * dx_m - at_m[0]).reshape(cols, square)
        index = np.arange(rows * cols)
        if not surface.complete:
            measured = surface.measured.view(np.uint8)
            inner = measured[top : top + rows * square, left : left + cols * square]
            corners = np.ndindex(square, square)
            count = sum(inner[i::square, j::square].astype(np.int32) for i, j in corners)
            index = np.flatnonzero(count > 0.5 * square**2)
        return cls(surface, square, (top, left), x_m, y_m, index)

    def places_m(self, some: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray]:
        """Return the middles (x, y) of some squares."""
        row, col = np.divmod(self.index[some], len(self.x_axis_m))
        return self.x_axis_m.mean(axis=1)[col], self.y_axis_m.mean(axis=1)[row]

    def slope(self) -> np.ndarray:
        """Return the slopes of a plane through the middles of some squares, to start from."""
        some = slice(None, None, max(1, self.index.size // 2000))
        row, col = np.divmod(self.index[some], len(self.x_axis_m))
        middle, (top, left) = self.square // 2, self.corner
        height_m = self.surface[top + row * self.square + middle, left + col * self.square + middle]
        known = ~np.isnan(height_m)
        if np.count_nonzero(known) < 3:
            return np.zeros(2)
        places = np.column_stack((*self.places_m(some), np.ones(row.size)))
        fitted: np.ndarray = np.linalg.lstsq(places[known], height_m[known], rcond=None)[0]
        return fitted[:2]

    def outline_m(self) -> np.ndarray:
        """Return the places (x, y) of the four corners."""
        x_m, y_m = (axis_m.reshape(-1)[[0, -1]] for axis_m in (self.x_axis_m, self.y_axis_m))
        return np.array([(x, y) for x in x_m for y in y_m])

    def above(self, slope: np.ndarray, level_m: float) -> np.ndarray:
        """Return squares of which a point stands above a plane, `level_m` at the load point."""
        side, (top, left), n = self.square, self.corner, self.x_axis_m.size
        down_m = level_m + slope[1] * self.y_axis_m.reshape(-1)
        across_m, found = slope[0] * self.x_axis_m.reshape(-1), [np.empty(0, dtype=np.intp)]
        for rows in row_blocks((down_m.size, n)):
            points_m = self.surface[top + rows.start : top + rows.stop, left : left + n] - across_m
            high = np.flatnonzero(np.fmax.reduce(points_m, axis=1) > down_m[rows])
            row, col = np.nonzero(points_m[high] > down_m[rows][high, None])
            found.append((high[row] + rows.start) // side * len(self.x_axis_m) + col // side)
        square = np.unique(np.concatenate(found))
        return np.flatnonzero(np.isin(self.index, square, assume_unique=True))

    def heights_m(self, slope: np.ndarray, some: np.ndarray) -> np.ndarray:
        """Return mean heights above a plane through the load point, highest points left out."""
        side, (top, left) = self.square, self.corner
        row, col = np.divmod(self.index[some], len(self.x_axis_m))
        down_m, across_m = slope[1] * self.y_axis_m, slope[0] * self.x_axis_m

        total, known, highest = np.zeros((3, row.size))
        highest.fill(-np.inf)
        for i, j in np.ndindex(side, side):
            height_m = self.surface[top + row * side + i, left + col * side + j]
            height_m -= across_m[col, j] + down_m[row, i]
            measured = ~np.isnan(height_m)
            known += measured
            np.add(total, height_m, out=total, where=measured)
            np.fmax(highest, height_m, out=highest)
        return (total - highest) / np.maximum(known - 1.0, 1.0) if side > 1 else total


def _facet(
    x_m: np.ndarray, y_m: np.ndarray, height_m: np.ndarray, range_m: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the corners of the facet of the upper hull over the origin, and its plane.

    The plane is (height at the origin, slope along x, along y). None where the origin lies outside.
    `range_m` is that of the heights of the whole face.
    """
    n = height_m.size
    if n < 3:
        return None
    # Three corners far away and far below, to start from: none stays where another can replace it.
    reach_m = float(np.hypot(x_m, y_m).max())
    angle = 2.0 * np.pi * np.arange(3) / 3.0
    x = np.append(x_m / reach_m, 10.0 * np.cos(angle))
    y = np.append(y_m / reach_m, 10.0 * np.sin(angle))
    base_m = float(height_m.mean())
    z = np.append(height_m - base_m, np.full(3, -BELOW * range_m))
    places = np.column_stack((np.ones(n + 3), x, y))
    origin = np.array([1.0, 0.0, 0.0])
    found = minimum(places, z, origin, np.arange(n, n + 3), ROUNDING * range_m)
    if (found.basis >= n).any():
        return None
    level_m, slope_x, slope_y = found.unknowns
    return found.basis, np.array([level_m + base_m, slope_x / reach_m, slope_y / reach_m])
