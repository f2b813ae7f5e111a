"""The height map: what every reader returns and every later stage takes."""

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, fields
from functools import cached_property
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.errors import SettingsError, UnusableSurfaceError, check_kind, in_short, truth_of
from capslip.surface.between import Between
from capslip.surface.heights import SMALL, check_error, ends_m, lost_of, slopes_of, stored_of
from capslip.surface.outline import outside_of, window_of
from capslip.surface.rows import BLOCK_POINTS, row_blocks

OF_LOST = "measured_window", "outside", "ends_within"  # kept as long as the same points lack


@dataclass(frozen=True)
class Origin:
    """Where a height map came from, as far as it is known."""

    name: str = "surface"
    path: str | None = None
    sha256: str | None = None
    file_format: str | None = None
    height_unit: str | None = None  # as stored in the file, or as given by the user
    lateral_unit: str | None = None
    dataset: str | None = None  # which of several maps of the file was read
    read_with: tuple[tuple[str, object], ...] = ()  # what its reader was told, by its keywords
    notes: tuple[str, ...] = ()  # what the reader did beyond reading: doubts, or `Statement`
    mean_of: tuple[str, ...] = ()  # name and digest of each scan that an average is made of


class Statement(str):
    """A note of what a reader found settled in the file; every other note is a doubt."""

    __slots__ = ()


@dataclass(frozen=True, eq=False)
class Tops:
    """Tops of hills that were cut off, and put back or not, shape (n,): see `restore_tops`."""

    x_m: np.ndarray  # where they are highest
    y_m: np.ndarray
    radius_m: np.ndarray  # of the disc of the area that was put back, or about what is flat
    up_m: np.ndarray  # by how much they stand above what was measured; 0 where they stay flat
    height_se_m: np.ndarray  # standard errors
    log_radius_se: np.ndarray  # of the logarithm of the radius of curvature
    points: int  # that were clipped

    @property
    def left(self) -> int:
        """Number of those that stay flat."""
        return int(np.count_nonzero(self.up_m == 0.0))

    @property
    def counts(self) -> dict[str, int]:
        """How many points were clipped, and how many tops were put back or stay flat."""
        n = self.x_m.size
        return {"points": self.points, "restored": n - self.left, "left": self.left}

    def errors_at(
        self, x_m: np.ndarray, y_m: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return height_se_m, log_radius_se and the area of tops at places, zero elsewhere.

        Where tops of two faces meet, their errors add up as squares.
        """
        height_se_m, log_radius_se, area_m2 = np.zeros((3, *np.shape(x_m)))
        for i in range(self.x_m.size):
            away_m = np.hypot(x_m - self.x_m[i], y_m - self.y_m[i])
            here = away_m <= self.radius_m[i]
            height_se_m[here] = np.hypot(height_se_m[here], self.height_se_m[i])
            log_radius_se[here] = np.hypot(log_radius_se[here], self.log_radius_se[i])
            area_m2[here] = np.maximum(area_m2[here], np.pi * self.radius_m[i] ** 2)
        return height_se_m, log_radius_se, area_m2


@dataclass(frozen=True)
class Filling:
    """What was filled of a map whose measured points stood alone: see `fill_scattered`."""

    points: int  # that were filled
    missing: float  # share that they were of the points measured or filled
    way: str  # between measured points: "cubic", or "linear"
    error_m: float  # rms, where measured points are filled from others; their noise is part of it
    density_m2: float  # of the measured points, outside of holes
    measured: np.ndarray | None = field(default=None, repr=False, compare=False)  # shape (ny, nx)

    @property
    def step(self) -> dict[str, Any]:
        """What is recorded of it."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name != "measured"}

    def chance_to_miss(self, radius_m: float) -> float:
        """Return the chance that no measured point lies on a disc, where they are at random."""
        return math.exp(-math.pi * radius_m**2 * self.density_m2)


@dataclass(frozen=True)
class Rounding:
    """How the heights were stored, and what is left of it: see `smooth_steps`."""

    step_m: float  # of which the stored heights are multiples
    error_m: float  # of tops of hills, rms, after smoothing within half a step
    smoothed: bool = True  # not where there are too few steps


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights on a rectangular grid of pixels, in metres.

    Parameters
    ----------
    height_m : array_like, shape (ny, nx)
        Heights, growing out of the material; NaN marks a non-measured point. Pixel (i, j) has
        its centre at x = (j + 0.5) dx, y = (i + 0.5) dy; x, y and the height are right-handed: with
        x to the right and the height towards the eye, y points up, and row 0 is the lowest. Given
        as float32 they are kept so, and come out as float64 where they are asked for. What a mask
        hides was not measured. An array that can be written to is copied.
    pixel_size_m : (float, float)
        (dy, dx), both positive.
    origin : Origin, optional
        File, digest and units; only for the record.
    tops : Tops, optional
        What of the heights was put back, where that is known.
    filling : Filling, optional
        What of the heights was filled.
    rounding : Rounding, optional
        The steps in which heights were stored, where that was smoothed.
    noise_m : float, optional
        Measurement noise, rms of a height as stored, where the file says it: see `average`.
    form_error_m : float, optional
        Height of the bow that scans leave in their mean, a standard error: see `average`.
    faces : int
        How many faces it is the sum of: two are mated.
    noise_scans : float, optional
        Of how many scans its noise has the variance, as many as faces where that is not known:
        interpolation takes some off.
    between : tuple of Between
        What lies between the points of faces that were laid on others.
    floor_slope : (float, float), optional
        Slopes along y and x of the floor of the sum of two faces whose caps are counted together.
    void : bool
        Whether no material is where nothing was measured, as in a bolt hole.

    Notes
    -----
    One array holds what was stored; what is added to it, as a plane, is part of the map and costs
    no other array (`plus`). A large map computes heights where they are asked for:
    `surface[rows]`, `surface[row, column]`, `surface.at(index)`. `surface.height_m` are all of
    them, which few need; of a small map they are computed once.

    Raises
    ------
    UnusableSurfaceError
        If the array is not two-dimensional, has fewer than 3 points along an axis, or holds no
        real numbers or an infinite height.
    SettingsError
        If the pixel size is not two positive finite numbers, the noise no such one, the slopes of
        the floor not two finite ones, or another argument of the wrong type.

    Examples
    --------
    >>> surface = HeightMap(np.zeros((80, 120)), pixel_size_m=(2e-4, 5e-4))
    >>> surface.shape, surface.side_m
    ((80, 120), (0.016, 0.06))
    """

    height_m: np.ndarray
    pixel_size_m: tuple[float, float]
    origin: Origin = field(default_factory=Origin)
    tops: Tops | None = None
    filling: Filling | None = None
    rounding: Rounding | None = None
    noise_m: float | None = None
    form_error_m: float | None = None
    faces: int = 1
    floor_slope: tuple[float, float] | None = None
    void: bool = False
    noise_scans: float | None = None
    between: tuple[Between, ...] = ()
    _stored_m: np.ndarray = field(init=False, repr=False)  # float32 or float64
    lost: np.ndarray = field(init=False, repr=False)  # points not measured, counted row by row
    _added: "_Added | None" = field(init=False, repr=False)

    def __post_init__(self) -> None:
        given = self.__dict__.pop("height_m")
        self._check_kinds()
        name = self.origin.name
        stored_m = stored_of(given, name)
        if stored_m.ndim != 2 or min(stored_m.shape) < 3:
            raise UnusableSurfaceError(
                f"{name}: heights have shape {stored_m.shape}; expected two axes of at least 3 "
                "points; choose the dataset that holds the height map"
            )
        try:
            dy_m, dx_m = (float(v) for v in self.pixel_size_m)
        except (TypeError, ValueError):
            raise SettingsError(
                f"{name}: pixel size {in_short(repr(self.pixel_size_m))}; expected two numbers "
                "(dy, dx) in metres"
            ) from None
        if not (0 < dy_m < np.inf and 0 < dx_m < np.inf):
            raise SettingsError(
                f"{name}: pixel size ({dy_m:g}, {dx_m:g}) m; expected two positive numbers (dy, dx)"
            )
        check_error(name, "noise", self.noise_m)
        check_error(name, "form_error", self.form_error_m)
        if self.floor_slope is not None:
            self.__dict__["floor_slope"] = slopes_of(self.floor_slope, name)
        self._hold(stored_m, lost_of(stored_m, name), None)
        self.__dict__["pixel_size_m"] = (dy_m, dx_m)

    def _check_kinds(self) -> None:
        check_kind("origin", self.origin, Origin, "an Origin")
        for name, kind in (("tops", Tops), ("filling", Filling), ("rounding", Rounding)):
            check_kind(name, getattr(self, name), (kind, type(None)), f"{kind.__name__}, or None")
        check_kind("faces", self.faces, Integral, "a whole number")
        check_kind("noise_scans", self.noise_scans, (Real, type(None)), "a number, or None")
        check_kind("between", self.between, tuple, "a tuple of Between")
        truth_of("void", self.void)

    def _hold(self, stored_m: np.ndarray, lost: np.ndarray, added: "_Added | None") -> None:
        """Keep heights as they are stored, which points lack, and what is added to them.

        Heights of a small map are computed once, those of a large one where they are asked for.
        """
        same_lost = lost is self.__dict__.get("lost")
        self.__dict__.update(_stored_m=stored_m, lost=lost, _added=added)
        for name in ("height_m", "bounds_m", *(() if same_lost else OF_LOST)):
            self.__dict__.pop(name, None)
        if added is None and stored_m.dtype == np.float64:
            self.__dict__["height_m"] = stored_m

    if not TYPE_CHECKING:
        # Heights that are not kept. No property: that is the name of a field, which `replace` sets
        def __getattr__(self, name: str) -> np.ndarray:
            if name != "height_m":
                raise AttributeError(name)
            height_m = np.empty(self.shape)
            for rows in row_blocks(self.shape):
                self._computed_m(rows, slice(None), height_m[rows])
            height_m.flags.writeable = False
            if self.size <= SMALL:  # from here on instead of what was stored
                self.__dict__.update(height_m=height_m, _stored_m=height_m, _added=None)
            return height_m

    def __getitem__(self, at: Any) -> np.ndarray:
        """Return the heights of some points, float64: rows, or rows and columns of an array."""
        if "height_m" in self.__dict__ or self.size <= SMALL:
            some_m: np.ndarray = self.height_m[at]
            return some_m
        row, col = at if isinstance(at, tuple) else (at, slice(None))
        return self._computed_m(row, col)

    def __len__(self) -> int:
        return self.shape[0]

    def at(self, index: Any) -> np.ndarray:
        """Return the heights of points that are counted row by row."""
        if "height_m" in self.__dict__ or self.size <= SMALL:
            return self.height_m.reshape(-1)[index]
        index = np.asarray(index)
        height_m, every = np.empty(index.shape), index.reshape(-1)
        for first in range(0, every.size, BLOCK_POINTS):
            some = every[first : first + BLOCK_POINTS].astype(np.intp)
            row = some // self.shape[1]
            at = row, some - self.shape[1] * row
            height_m.reshape(-1)[first : first + some.size] = self._computed_m(*at)
        return height_m

    def lost_in(self, rows: slice) -> np.ndarray:
        """Return the points of some rows that were not measured, counted from the first of them."""
        if self.complete:
            return self.lost
        first, last = rows.start * self.shape[1], rows.stop * self.shape[1]
        return self.lost[slice(*np.searchsorted(self.lost, (first, last)))] - first

    def _computed_m(self, row: Any, col: Any, out: np.ndarray | None = None) -> np.ndarray:
        # In one order, whatever is asked for: a point has one height
        level_m = 0.0 if self._added is None else self._added.level_m
        height_m = np.subtract(self._stored_m[row, col], level_m, out=out, dtype=np.float64)
        if self._added is None:
            return height_m
        down = isinstance(col, slice) or (isinstance(row, slice) and np.ndim(col) > 0)

        def of_rows(values: np.ndarray) -> np.ndarray:
            some = values[row]
            return some[:, None] if down and some.ndim == 1 else some

        height_m += self._added.x_m[col]
        height_m += of_rows(self._added.y_m)
        for of_y, of_x in self._added.products:
            height_m += of_rows(of_y) * of_x[col]
        return height_m

    def plus(
        self,
        x_m: np.ndarray,
        y_m: np.ndarray,
        products: tuple[tuple[np.ndarray, np.ndarray], ...] = (),
        level_m: float = 0.0,
    ) -> "HeightMap":
        """Return the map with a surface added: x_m + y_m + products - level_m.

        What is stored stays as it is, and one.

        Parameters
        ----------
        x_m : float64, shape (nx,)
            What is added to columns.
        y_m : float64, shape (ny,)
            What is added to rows.
        products : tuple of (float64, float64)
            Of what is along y, shape (ny,), and along x, shape (nx,).
        level_m : float
            Taken off first, so that it costs no digits.
        """
        before = self._added
        if before is None:
            added = _Added(level_m, x_m, y_m, products)
        else:
            y_m = before.y_m + (y_m - level_m)
            added = _Added(before.level_m, before.x_m + x_m, y_m, (*before.products, *products))
        found = copy(self)
        found._hold(self._stored_m, self.lost, added)
        return found

    def without(self, index: np.ndarray) -> "HeightMap":
        """Return the map with points, counted row by row, that were not measured."""
        stored_m = self._stored_m.copy()
        stored_m.reshape(-1)[index] = np.nan
        stored_m.flags.writeable = False
        found = copy(self)
        found._hold(stored_m, np.union1d(self.lost, index).astype(self.lost.dtype), self._added)
        return found

    def as_void(self) -> "HeightMap":
        """Return the map of a face without material where nothing was measured.

        Where measured points stood alone, and the map was filled between them, there is some.
        """
        if self.complete or self.filling is not None:
            return self
        found = copy(self)
        found.__dict__["void"] = True
        for name in OF_LOST:
            found.__dict__.pop(name, None)
        return found

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx)."""
        return self._stored_m.shape[0], self._stored_m.shape[1]

    @property
    def size(self) -> int:
        """Number of points."""
        return self._stored_m.size

    @property
    def measured(self) -> np.ndarray:
        """Mask of the measured points, bool, shape (ny, nx)."""
        if self.complete:
            return np.broadcast_to(True, self.shape)
        measured = np.ones(self.shape, dtype=bool)
        measured.reshape(-1)[self.lost] = False
        return measured

    @property
    def complete(self) -> bool:
        """Whether all points were measured."""
        return self.lost.size == 0

    @cached_property
    def outside(self) -> np.ndarray:
        """Mask of the points outside of the face, bool, shape (ny, nx): see `outside_of`."""
        if self.complete:
            return np.broadcast_to(False, self.shape)
        return outside_of(self.measured, self.void, self.measured_window)

    def is_outside(self, row: np.ndarray, col: np.ndarray) -> np.ndarray:
        """Tell which pixels lie beyond the edge of the map, or outside of the face on it."""
        ny, nx = self.shape
        beyond = (row < 0) | (row >= ny) | (col < 0) | (col >= nx)
        if not self.ends_within:
            return np.asarray(beyond)
        return np.asarray(beyond | self.outside[np.clip(row, 0, ny - 1), np.clip(col, 0, nx - 1)])

    @cached_property
    def ends_within(self) -> bool:
        """Whether the face ends before its map does."""
        return not self.complete and bool(self.outside.any())

    @property
    def lost_inside(self) -> np.ndarray:
        """Points not measured that are no outside, counted row by row."""
        if not self.ends_within:
            return self.lost
        inside: np.ndarray = self.lost[~self.outside.reshape(-1)[self.lost]]
        return inside

    @cached_property
    def bounds_m(self) -> tuple[float, float]:
        """Least and greatest height; NaN where nothing was measured."""
        of_rows_m = np.array([ends_m(self[rows]) for rows in row_blocks(self.shape)])
        return float(np.fmin.reduce(of_rows_m[:, 0])), float(np.fmax.reduce(of_rows_m[:, 1]))

    @property
    def n_measured(self) -> int:
        """Number of the measured points."""
        return self.size - self.lost.size

    @property
    def side_m(self) -> tuple[float, float]:
        """Lengths of the face along y and x."""
        return self.shape[0] * self.pixel_size_m[0], self.shape[1] * self.pixel_size_m[1]

    def pixel_at(self, x_m: np.ndarray, y_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return row and column of the pixels that hold places, the nearest ones beyond the edge.

        Examples
        --------
        >>> HeightMap(np.zeros((4, 6)), (2e-4, 1e-4)).pixel_at(np.array([2.5e-4, 1.0]), np.zeros(2))
        (array([0, 0]), array([2, 5]))
        """
        (ny, nx), (dy_m, dx_m) = self.shape, self.pixel_size_m
        row, col = (y_m / dy_m).astype(np.intp), (x_m / dx_m).astype(np.intp)
        return np.clip(row, 0, ny - 1), np.clip(col, 0, nx - 1)

    @property
    def scans_of_noise(self) -> float:
        """Of how many scans its noise has the variance."""
        return float(self.faces if self.noise_scans is None else self.noise_scans)

    @property
    def pixel_area_m2(self) -> float:
        """Area of one pixel."""
        return self.pixel_size_m[0] * self.pixel_size_m[1]

    @cached_property
    def measured_window(self) -> tuple[slice, slice]:
        """Rows and columns of the least rectangle that holds all measured points.

        Examples
        --------
        >>> height_m = np.zeros((4, 6))
        >>> height_m[0], height_m[:, 4:] = np.nan, np.nan
        >>> HeightMap(height_m, (1e-4, 1e-4)).measured_window
        (slice(1, 4, None), slice(0, 4, None))
        """
        return window_of(self.lost, self.shape)

    @property
    def measured_area_m2(self) -> float:
        """Area of the least rectangle that holds all measured points, holes in it included."""
        rows, columns = self.measured_window
        return (rows.stop - rows.start) * (columns.stop - columns.start) * self.pixel_area_m2

    @property
    def centre_m(self) -> tuple[float, float]:
        """Centre (x, y) of that rectangle: of the map, but for lines that are empty to its edge."""
        (rows, columns), (dy_m, dx_m) = self.measured_window, self.pixel_size_m
        return 0.5 * (columns.start + columns.stop) * dx_m, 0.5 * (rows.start + rows.stop) * dy_m


@dataclass(frozen=True, eq=False)
class _Added:
    """What is added to stored heights wherever they are read."""

    level_m: float  # taken off first
    x_m: np.ndarray  # (nx,)
    y_m: np.ndarray  # (ny,)
    products: tuple[tuple[np.ndarray, np.ndarray], ...]  # of (ny,) and (nx,)


def check_map(name: str, surface: object) -> None:
    """Refuse an argument that is no map."""
    expected = (
        "a HeightMap; read a file with capslip.load_surface, make one of an array with "
        "capslip.HeightMap"
    )
    check_kind(name, surface, HeightMap, expected, UnusableSurfaceError)


def check_maps(scans: object) -> None:
    """Refuse an argument that is no list of maps."""
    check_kind("scans", scans, Sequence, "a list of HeightMaps", UnusableSurfaceError)
    assert isinstance(scans, Sequence)
    for i, one in enumerate(scans):
        check_map(f"scans[{i}]", one)


Heights = np.ndarray | HeightMap  # what gives some of its heights when it is asked for them
