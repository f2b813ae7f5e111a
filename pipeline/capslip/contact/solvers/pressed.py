"""The state of a pressed height map, and how well it fulfils the conditions of contact."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

_HARDLY = 0.01  # of a load, on points at their hardness: these are the last to let go


@dataclass(frozen=True)
class Certificate:
    """How well a solution fulfils the conditions of contact, from its pressures alone.

    Lengths are relative to the approach, pressures to the mean pressure in the contact.
    """

    load_balance: float  # |sum of p dA - N| / N; zero for a given approach
    least_gap: float  # over all points without pressure: below zero is penetration
    least_pressure: float  # below zero is tension
    complementarity: float  # sum of p |gap| / sum of p; where it yields, of a gap above zero
    iterations: int  # on the finest grid
    moments: tuple[float, float] = (0.0, 0.0)  # left over in x and y, over load times side


@dataclass(frozen=True, eq=False)
class Pressed:
    """A face under load, as `press` found it; arrays of shape (ny, nx)."""

    load_N: float
    approach_m: float
    pressure_Pa: np.ndarray  # zero where there is no contact
    gap_m: np.ndarray  # up to rounding and tolerance zero in contact; 0 at non-measured points
    pixel_size_m: tuple[float, float]
    certificate: Certificate
    tilt_rad: tuple[float, float] = (0.0, 0.0)  # slopes in x and y that balance added to the map
    turns: bool = False  # whether the face turned freely, so that the resultant is where it must be
    yielded: np.ndarray | None = None  # where a first load left the hardness; None: it was not yet
    over_hardness: np.ndarray | None = None  # see `metal_pressure_Pa`
    blunt: np.ndarray | None = None  # the same
    bounded_Pa: float | None = None  # the greatest pressure then, at most the hardness

    @property
    def resultant_m(self) -> tuple[float, float]:
        """Where the resultant of the pressures acts, (x, y) in the map."""
        dy_m, dx_m = self.pixel_size_m
        ny, nx = self.pressure_Pa.shape
        over_x, over_y = self.pressure_Pa.sum(axis=0), self.pressure_Pa.sum(axis=1)
        x_m = float(over_x @ (np.arange(nx) + 0.5)) * dx_m / float(over_x.sum())
        y_m = float(over_y @ (np.arange(ny) + 0.5)) * dy_m / float(over_y.sum())
        return x_m, y_m

    @property
    def contact_area_m2(self) -> float:
        """Area of the pixels in contact."""
        dy_m, dx_m = self.pixel_size_m
        return float(np.count_nonzero(self.pressure_Pa) * dy_m * dx_m)

    @property
    def max_pressure_Pa(self) -> float:
        """Greatest pressure of any pixel; of metal the one under which it yielded."""
        return float(self.pressure_Pa.max()) if self.bounded_Pa is None else self.bounded_Pa

    @cached_property
    def region(self) -> np.ndarray:
        """Number of the contact region of each pixel (8-connected), 0 without contact."""
        from scipy.ndimage import label

        return np.asarray(label(self.pressure_Pa > 0, structure=np.ones((3, 3)))[0])

    @property
    def region_loads_N(self) -> np.ndarray:
        """Load of each contact region, shape (n,)."""
        return self.sum_over_regions(self.pressure_Pa)

    @cached_property
    def region_pixels(self) -> np.ndarray:
        """Pixels of each contact region, shape (n,)."""
        return np.bincount(self.region.ravel())[1:]

    @property
    def pixels_across(self) -> float:
        """Pixels across the median unit of load: the diameter of the circle of its region's area.

        In their longer sides. Half of the load rests on regions that are smaller than this.
        """
        order = np.argsort(self.region_pixels)
        share = np.cumsum(self.region_loads_N[order])
        middle = min(int(np.searchsorted(share, 0.5 * share[-1])), len(order) - 1)
        shorter_m, longer_m = sorted(self.pixel_size_m)
        area = self.region_pixels[order[middle]] * shorter_m / longer_m
        return float(np.sqrt(4 / np.pi * area))

    def sum_over_regions(self, density: np.ndarray) -> np.ndarray:
        """Integrate an array (ny, nx) over each contact region, shape (n,)."""
        dy_m, dx_m = self.pixel_size_m
        return np.bincount(self.region.ravel(), weights=density.ravel())[1:] * (dy_m * dx_m)


@dataclass(frozen=True, eq=False)
class State:
    """Pressures, gaps and approach, and how far they are from contact."""

    pressure_Pa: np.ndarray
    gap_m: np.ndarray
    approach_m: float  # from first touch under the tilt
    tilt_rad: tuple[float, float]  # slopes in x and y added to the map
    contact: np.ndarray  # flat indices of the pixels under pressure
    least_gap: float
    complementarity: float

    def fulfils(self, tolerance: float) -> bool:
        """Whether gaps under pressure and penetration are within the tolerance."""
        return self.complementarity <= tolerance and self.least_gap >= -tolerance

    @property
    def touches_nowhere(self) -> bool:
        """Whether nothing is under pressure, and nothing should be."""
        return self.contact.size == 0 and self.least_gap >= 0


def hardly_yields(pressed: Pressed, hardness_Pa: float) -> bool:
    """Tell whether next to none of a load rests on points at a hardness, or that have yielded."""
    pressure_Pa = pressed.pressure_Pa
    at_most = pressure_Pa >= hardness_Pa
    if pressed.yielded is not None:
        at_most |= pressed.yielded
    return float(pressure_Pa[at_most].sum()) <= _HARDLY * float(pressure_Pa.sum())
