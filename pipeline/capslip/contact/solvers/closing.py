"""What closes the equations of a pressed face: its approach, its load, or its load and moments."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

_MAX_TURNS = 60  # Newton steps that put the resultant into its place


class Closing(Protocol):
    """Which plane presses, and which pressures are allowed under it.

    A plane is (level, slope in x, slope in y): its height over the load point, and what is added to
    the heights of the map per metre.
    """

    def plane(self, pressure: np.ndarray, height_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the plane that fits the deformed heights under pressure best, shape (3,)."""

    def over(self, plane: np.ndarray) -> np.ndarray | float:
        """Return the height of a plane over all points, or the one that all have in common."""

    def projector(self, points: np.ndarray) -> "Projector":
        """Return what takes the directions that are not allowed out of values at these points."""

    def restored(self, pressure: np.ndarray, points: np.ndarray) -> np.ndarray | None:
        """Return the pressures, all > 0, moved onto load and moments; None if they cannot be."""

    def less(self, pressure: np.ndarray, points: np.ndarray) -> "Closing | None":
        """Return what is left for other points; None where these pressures carry too much."""

    def on_grid(self, places_m: tuple[np.ndarray, np.ndarray], area_ratio: float) -> "Closing":
        """Return the same for other points, x and y, and pixels `1 / area_ratio` times as large."""


class Projector(Protocol):
    """Takes out of values what load and moments forbid."""

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the rest."""


@dataclass(frozen=True)
class GivenApproach:
    """The plane is given, and every pressure allowed."""

    approach_m: float

    def plane(self, pressure: np.ndarray, height_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the given plane."""
        return np.array([self.approach_m, 0.0, 0.0])

    def over(self, plane: np.ndarray) -> float:
        """Return the level."""
        return float(plane[0])

    def projector(self, points: np.ndarray) -> Projector:
        """Return what changes nothing."""
        return lambda values: values

    def restored(self, pressure: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the pressures as they are."""
        return pressure

    def less(self, pressure: np.ndarray, points: np.ndarray) -> Closing:
        """Return the same."""
        return self

    def on_grid(self, places_m: tuple[np.ndarray, np.ndarray], area_ratio: float) -> Closing:
        """Return the same."""
        return self


@dataclass(frozen=True)
class GivenLoad:
    """The plane does not tilt, and the pressures have a given sum."""

    total_Pa: float

    def plane(self, pressure: np.ndarray, height_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the mean level, weighted with the pressure."""
        level_m = float(pressure @ height_m / pressure.sum()) if len(pressure) else 0.0
        return np.array([level_m, 0.0, 0.0])

    def over(self, plane: np.ndarray) -> float:
        """Return the level."""
        return float(plane[0])

    def projector(self, points: np.ndarray) -> Projector:
        """Return what takes the mean out."""
        return lambda values: values - values.sum() / values.size

    def restored(self, pressure: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the pressures times a factor."""
        return pressure * (self.total_Pa / pressure.sum())

    def less(self, pressure: np.ndarray, points: np.ndarray) -> Closing | None:
        """Return the rest of the load."""
        rest_Pa = self.total_Pa - float(pressure.sum())
        return GivenLoad(rest_Pa) if rest_Pa > 0 else None

    def on_grid(self, places_m: tuple[np.ndarray, np.ndarray], area_ratio: float) -> Closing:
        """Return the load on the other pixels."""
        return GivenLoad(self.total_Pa * area_ratio)


@dataclass(frozen=True, eq=False)
class GivenResultant:
    """The plane tilts until the resultant of the pressures has its size and its place.

    Level and slopes are the multipliers of three conditions, sum p = total, sum p x = total x_R and
    the same in y, on which gradients and directions are projected.

    Parameters
    ----------
    total_Pa : float
        Sum of the pressures.
    places_m : (ndarray, ndarray)
        x and y of all points: of a map, shapes (1, nx) and (ny, 1); else both (n,).
    resultant_m : (float, float)
        Where the resultant acts, (x, y).
    """

    total_Pa: float
    places_m: tuple[np.ndarray, np.ndarray]
    resultant_m: tuple[float, float]

    @cached_property
    def _arms_m(self) -> tuple[np.ndarray, np.ndarray]:
        """Distances in x and y of all points from where the resultant acts."""
        (x_m, y_m), (x_R, y_R) = self.places_m, self.resultant_m
        return x_m - x_R, y_m - y_R

    @cached_property
    def _length_m(self) -> float:
        """Length that makes places and slopes comparable to numbers and levels."""
        return float(max(np.abs(arm).max() for arm in self._arms_m))

    @cached_property
    def _shares(self) -> tuple[np.ndarray, np.ndarray]:
        """The arms in these lengths, each with one axis."""
        x, y = (arm.reshape(-1) / self._length_m for arm in self._arms_m)
        return x, y

    def _basis(self, points: np.ndarray) -> np.ndarray:
        x, y = self._shares
        row, column = np.divmod(points, x.size) if self._arms_m[0].ndim > 1 else (points, points)
        basis = np.ones((3, len(points)))
        basis[1], basis[2] = x[column], y[row]
        return basis

    def over(self, plane: np.ndarray) -> np.ndarray:
        """Return the height of a plane over all points."""
        (x_m, y_m), (level_m, slope_x, slope_y) = self._arms_m, plane
        return np.asarray((level_m + slope_x * x_m) + slope_y * y_m)

    def plane(self, pressure: np.ndarray, height_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the least-squares plane, weighted with the pressure."""
        basis = self._basis(points)
        weighted = basis * pressure
        fitted = _solved(_products(weighted, basis), weighted @ height_m)
        return fitted / (1.0, self._length_m, self._length_m)

    def projector(self, points: np.ndarray) -> Projector:
        """Return what takes the sum and both moments out."""
        basis = self._basis(points)
        value, vector = np.linalg.eigh(_products(basis, basis))
        known = value > 1e-12 * value[-1]
        inverse = (vector[:, known] / value[known]) @ vector[:, known].T
        return lambda values: values - (inverse @ (basis @ values)) @ basis

    def restored(self, pressure: np.ndarray, points: np.ndarray) -> np.ndarray | None:
        """Multiply the pressures with exp(a x + b y), which keeps their sign.

        The logarithm of their sum is convex in (a, b) and its gradient the resultant, so Newton's
        steps end wherever the resultant lies inside the hull of the points.
        """
        basis = self._basis(points)[1:]
        with np.errstate(divide="ignore"):  # what has grown too small for a number stays at none
            height = np.log(pressure / pressure.sum())
        weight, exponent, last = pressure / pressure.sum(), np.zeros(2), 0.0
        for _ in range(_MAX_TURNS):
            off = basis @ weight
            if np.abs(off).max() < 1e-15:
                break
            spread = _products(basis * weight, basis)
            step = -_solved(spread, off)
            if not np.abs(step).max() > 1e-15 * (1 + np.abs(exponent).max()):
                break
            factor = 1.0
            while True:
                tried = exponent + factor * step
                # Over the greatest product: over the greatest factor all of them may be too small
                power = height + tried @ basis
                top = float(power.max())
                grown = np.exp(power - top)
                value = top + float(np.log(grown.sum()))
                if value <= last + 1e-4 * factor * float(step @ off) + 1e-15:
                    break
                factor /= 2
                if factor < 1e-6:
                    return None
            exponent, last, weight = tried, value, grown / grown.sum()
        if not np.abs(basis @ weight).max() <= 1e-11:
            return None
        return np.asarray(self.total_Pa * weight)

    def less(self, pressure: np.ndarray, points: np.ndarray) -> Closing | None:
        """Return the rest of the resultant, which acts elsewhere."""
        rest_Pa = self.total_Pa - float(pressure.sum())
        if rest_Pa <= 0:
            return None
        _, x, y = self._basis(points) * self._length_m
        x_R, y_R = self.resultant_m
        place = x_R - float(pressure @ x) / rest_Pa, y_R - float(pressure @ y) / rest_Pa
        return GivenResultant(rest_Pa, self.places_m, place)

    def on_grid(self, places_m: tuple[np.ndarray, np.ndarray], area_ratio: float) -> Closing:
        """Return the resultant on the other pixels."""
        return GivenResultant(self.total_Pa * area_ratio, places_m, self.resultant_m)


def _products(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return `left @ right.T`, symmetric, of few long rows: one by one in half of the time."""
    return np.array([[one @ other for other in right] for one in left])


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve a small symmetric system, whose solution need not be unique."""
    value, vector = np.linalg.eigh(matrix)
    known = value > 1e-13 * value[-1]
    return np.asarray(vector @ np.where(known, vector.T @ right / np.where(known, value, 1.0), 0.0))
