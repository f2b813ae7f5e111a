"""The height map: what every reader returns and every later stage takes."""

import math
from dataclasses import dataclass, field

import numpy as np

from capslip.errors import SettingsError, UnusableSurfaceError


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
    notes: tuple[str, ...] = ()  # what the reader did beyond reading, for the user


@dataclass(frozen=True, eq=False)
class Tops:
    """Tops of hills that were cut off, and put back or not, shape (n,): see `restore_tops`."""

    x_m: np.ndarray  # where they are highest
    y_m: np.ndarray
    radius_m: (
        np.ndarray
    )  # of the disc that has the area of what was put back, or holds what is flat
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
        """Return height_se_m, log_radius_se and the area of tops at places, zero elsewhere."""
        height_se_m, log_radius_se, area_m2 = np.zeros((3, *np.shape(x_m)))
        for i in range(self.x_m.size):
            away_m = np.hypot(x_m - self.x_m[i], y_m - self.y_m[i])
            here = away_m <= self.radius_m[i]
            height_se_m[here], log_radius_se[here] = self.height_se_m[i], self.log_radius_se[i]
            area_m2[here] = np.pi * self.radius_m[i] ** 2
        return height_se_m, log_radius_se, area_m2


@dataclass(frozen=True)
class Filling:
    """What was filled of a map whose measured points stood alone: see `fill_scattered`."""

    points: int  # that were filled
    missing: float  # share that they were of the points measured or filled
    way: str  # between measured points: "cubic", or "linear"
    error_m: float  # rms, where measured points are filled from others; their noise is part of it
    density_m2: float  # of the measured points, outside of holes

    def chance_to_miss(self, radius_m: float) -> float:
        """Return the chance that no measured point lies on a disc, where they are at random."""
        return math.exp(-math.pi * radius_m**2 * self.density_m2)


@dataclass(frozen=True)
class Rounding:
    """How the heights were stored, and what is left of it: see `smooth_steps`."""

    step_m: float  # of which the stored heights are multiples
    error_m: float  # of tops of hills, rms, after smoothing within half a step


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights on a rectangular grid of pixels, in metres.

    Parameters
    ----------
    height_m : array_like, shape (ny, nx)
        Heights, growing out of the material; NaN marks a non-measured point. Pixel (i, j) has
        its centre at x = (j + 0.5) dx, y = (i + 0.5) dy; x, y and the height are right-handed: with
        x to the right and the height towards the eye, y points up, and row 0 is the lowest.
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

    Raises
    ------
    UnusableSurfaceError
        If the array is not two-dimensional, has fewer than 3 points along an axis, or holds an
        infinite height.
    SettingsError
        If the pixel size is not two positive finite numbers.

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

    def __post_init__(self) -> None:
        height_m = np.ascontiguousarray(self.height_m, dtype=np.float64)
        name = self.origin.name
        if height_m.ndim != 2 or min(height_m.shape) < 3:
            raise UnusableSurfaceError(
                f"{name}: heights have shape {height_m.shape}; expected two axes of at least 3 "
                "points; choose the dataset that holds the height map"
            )
        if np.isinf(height_m).any():
            raise UnusableSurfaceError(
                f"{name}: {int(np.isinf(height_m).sum())} infinite heights; expected finite "
                "heights or NaN for non-measured points; mark them as non-measured"
            )
        try:
            dy_m, dx_m = (float(v) for v in self.pixel_size_m)
        except (TypeError, ValueError):
            raise SettingsError(
                f"{name}: pixel size {self.pixel_size_m!r}; expected two numbers (dy, dx) in metres"
            ) from None
        if not (0 < dy_m < np.inf and 0 < dx_m < np.inf):
            raise SettingsError(
                f"{name}: pixel size ({dy_m:g}, {dx_m:g}) m; expected two positive numbers (dy, dx)"
            )
        height_m.flags.writeable = False
        object.__setattr__(self, "height_m", height_m)
        object.__setattr__(self, "pixel_size_m", (dy_m, dx_m))

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx)."""
        return self.height_m.shape[0], self.height_m.shape[1]

    @property
    def measured(self) -> np.ndarray:
        """Mask of the measured points, bool, shape (ny, nx)."""
        return ~np.isnan(self.height_m)

    @property
    def n_measured(self) -> int:
        """Number of the measured points."""
        return self.height_m.size - int(np.count_nonzero(np.isnan(self.height_m)))

    @property
    def side_m(self) -> tuple[float, float]:
        """Lengths of the face along y and x."""
        return self.shape[0] * self.pixel_size_m[0], self.shape[1] * self.pixel_size_m[1]

    @property
    def pixel_area_m2(self) -> float:
        """Area of one pixel."""
        return self.pixel_size_m[0] * self.pixel_size_m[1]

    @property
    def measured_area_m2(self) -> float:
        """Area of the least rectangle that holds all measured points, holes in it included."""
        sides_m = 1.0
        for axis, pixel_m in enumerate(self.pixel_size_m):
            lines = np.flatnonzero(self.measured.any(axis=1 - axis))
            sides_m *= pixel_m * (int(lines[-1]) - int(lines[0]) + 1 if lines.size else 0)
        return sides_m
