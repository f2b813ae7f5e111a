"""A height map on an elastic half-space, ready to be pressed, and the same on coarser grids."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from capslip.contact.solvers.half_space import HalfSpace
from capslip.contact.solvers.whiteness import white_m2
from capslip.errors import ContactError, SettingsError, UnusableSurfaceError
from capslip.surface.between import Between
from capslip.surface.blocks import means_of_blocks
from capslip.surface.heightmap import HeightMap
from capslip.surface.outline import window_of

MAX_POINTS = 16_000_000  # of a map
BYTES_PER_POINT = 200  # of memory that a solution takes at its peak
MOST_PRESSURE = 1e3  # mean over the modulus E*; long before, all of a face touches
_COARSEST = 48  # points along the shorter side at which nesting ends


@dataclass(frozen=True, eq=False)
class TakenNoise:
    """White noise that was taken off a face, see `denoising`, and what is left of it."""

    noise_m: float  # rms of a height
    left: np.ndarray  # share of its power in each wave of the face and as much beyond all its edges

    @property
    def left_m(self) -> float:
        """Rms of what is left."""
        return self.noise_m * float(np.sqrt(self.left.mean()))


@dataclass(frozen=True, eq=False)
class ElasticFace:
    """A height map on a half-space, ready to be pressed, made by `elastic_face`."""

    name: str
    depth_m: np.ndarray  # below the highest measured point; 0 at non-measured points
    measured: np.ndarray
    pixel_size_m: tuple[float, float]
    E_star_Pa: float
    half_space: HalfSpace
    hardness_Pa: float = field(default=np.inf, kw_only=True)  # greatest pressure that it bears
    before: "ElasticFace | None" = field(default=None, kw_only=True)  # a load, with its hardness
    taken: TakenNoise | None = field(default=None, kw_only=True)  # before it was pressed
    faces: float = field(default=1, kw_only=True)  # that it has the noise of, as variance
    between: tuple[Between, ...] = field(default=(), kw_only=True)  # see `HeightMap`

    @cached_property
    def coarser(self) -> "ElasticFace | None":
        """The same face on a grid of pixels twice as large, None where that is too coarse."""
        if min(self.shape) < 2 * _COARSEST:
            return None
        mean_m = coarse(self.known_m)
        measured = ~np.isnan(mean_m)
        depth_m = np.where(measured, mean_m, 0.0)
        dy_m, dx_m = self.pixel_size_m
        size_m = (2 * dy_m, 2 * dx_m)
        half_space = HalfSpace(depth_m.shape, size_m, self.E_star_Pa)
        return ElasticFace(
            *(self.name, depth_m, measured, size_m, self.E_star_Pa, half_space),
            hardness_Pa=self.hardness_Pa,
        )

    @cached_property
    def unmeasured(self) -> np.ndarray:
        """The non-measured points, as indices, growing."""
        return np.flatnonzero(~self.measured)

    @cached_property
    def measured_window(self) -> tuple[slice, slice]:
        """Rows and columns of the least rectangle that holds all measured points."""
        return window_of(self.unmeasured, self.shape)

    @property
    def known_m(self) -> np.ndarray:
        """The depths, NaN at non-measured points; not to be written to."""
        if not self.unmeasured.size:
            return self.depth_m
        return np.where(self.measured, self.depth_m, np.nan)

    def tilted(self, tilt_rad: tuple[float, float]) -> "ElasticFace":
        """Return the face with slopes in x and y added to its heights, in metres a metre."""
        if tilt_rad == (0.0, 0.0):
            return self
        x_m, y_m = self.places_m
        depth_m = self.depth_m - tilt_rad[0] * x_m - tilt_rad[1] * y_m
        depth_m -= np.min(depth_m, where=self.measured, initial=np.inf)
        turned = replace(self, depth_m=np.where(self.measured, depth_m, 0.0))
        vars(turned)["_white_m2"] = self._white_m2  # differences know no slope
        return turned

    def white_m2(self, order: int, axis: int) -> np.ndarray:
        """Return `whiteness.white_m2` of the depths, in single precision, found once.

        For all the slopes that the face has been given; not to be written to.
        """
        if (order, axis) not in self._white_m2:
            found = white_m2(self.known_m, order, axis)
            self._white_m2[order, axis] = found.astype(np.float32)
        return self._white_m2[order, axis]

    @cached_property
    def _white_m2(self) -> dict[tuple[int, int], np.ndarray]:
        return {}

    def lowered(self, deeper_m: np.ndarray) -> "ElasticFace":
        """Return the face with its points lower, of its shape; from its own first touch."""
        if not deeper_m.any():
            return self
        depth_m = self.depth_m + deeper_m
        depth_m -= np.min(depth_m, where=self.measured, initial=np.inf)
        return replace(self, depth_m=np.where(self.measured, depth_m, 0.0))

    def flattened(self, sunk_m: np.ndarray) -> "ElasticFace":
        """Return the elastic face that is left where points have sunk for good, shape (ny, nx).

        Where none has, points between its pixels may have: it keeps the face before the load, too.
        """
        before = self if np.isfinite(self.hardness_Pa) else None
        return replace(self.lowered(sunk_m), hardness_Pa=np.inf, before=before)

    @property
    def yielded(self) -> bool:
        """Whether a load has left flats on it."""
        return self.before is not None and self.depth_m is not self.before.depth_m

    @property
    def places_m(self) -> tuple[np.ndarray, np.ndarray]:
        """x, shape (1, nx), and y, shape (ny, 1), of the pixels' centres."""
        dy_m, dx_m = self.pixel_size_m
        ny, nx = self.shape
        return (np.arange(nx) + 0.5)[None, :] * dx_m, (np.arange(ny) + 0.5)[:, None] * dy_m

    def lattice(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows and columns of points, as flat indices, in the grid that they are of."""
        row, column = (
            np.rint(np.broadcast_to(at_m, self.shape).reshape(-1)[points] / size_m - 0.5)
            for at_m, size_m in zip(reversed(self.places_m), self.pixel_size_m, strict=True)
        )
        return row.astype(np.intp), column.astype(np.intp)

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx)."""
        return self.depth_m.shape[0], self.depth_m.shape[1]

    @property
    def pixel_area_m2(self) -> float:
        """Area of one pixel."""
        return self.pixel_size_m[0] * self.pixel_size_m[1]


def elastic_face(surface: HeightMap, E_star_Pa: float) -> ElasticFace:
    """Prepare a height map for contact.

    Parameters
    ----------
    surface : HeightMap
        Non-measured points never touch.
    E_star_Pa : float
        Composite modulus.

    Raises
    ------
    SettingsError
        If the modulus is not positive and finite.
    UnusableSurfaceError
        If nothing was measured.
    ContactError
        If the map has more than `MAX_POINTS` points, which need `BYTES_PER_POINT` bytes each.
    """
    if not 0 < E_star_Pa < np.inf:
        raise SettingsError(f"E_star_Pa: got {E_star_Pa:g}; expected a finite number > 0")
    name, n_points = surface.origin.name, surface.size
    if n_points > MAX_POINTS:
        factor = int(np.ceil(np.sqrt(n_points / MAX_POINTS)))
        raise ContactError(
            f"{name}: boundary elements on {n_points} points need "
            f"{n_points * BYTES_PER_POINT / 1e9:.1f} GB; expected at most {MAX_POINTS} points; "
            f"coarsen the map {factor} times"
        )
    measured = surface.measured
    if not measured.any():
        raise UnusableSurfaceError(f"{name}: all points are non-measured; expected heights")
    depth_m = np.where(measured, surface.bounds_m[1] - surface.height_m, 0.0)
    half_space = HalfSpace(surface.shape, surface.pixel_size_m, E_star_Pa)
    given = name, depth_m, measured, surface.pixel_size_m, E_star_Pa, half_space
    return ElasticFace(*given, faces=surface.scans_of_noise, between=surface.between)


def coarse(values: np.ndarray) -> np.ndarray:
    """Return the means of what is known over pixels twice as large, NaN where nothing is."""
    even = np.pad(values, [(0, n % 2) for n in values.shape], constant_values=np.nan)
    return means_of_blocks(even, 2, 1)


def finer(values: np.ndarray) -> np.ndarray:
    """Interpolate linearly to pixels half as large, shape (2 ny, 2 nx)."""
    for _ in range(2):
        edged = np.pad(values, ((1, 1), (0, 0)), mode="edge")
        near = 0.75 * values
        pairs = np.stack((near + 0.25 * edged[:-2], near + 0.25 * edged[2:]), axis=1)
        values = pairs.reshape(-1, values.shape[1]).T
    return values
