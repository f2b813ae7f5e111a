"""Bows that an instrument may make of a flat, as far as its flatness deviation says."""

from typing import TYPE_CHECKING

import numpy as np

from capslip.surface.heightmap import HeightMap

if TYPE_CHECKING:
    from capslip.settings import Settings


def known_flatness_m(surface: HeightMap, settings: "Settings") -> float | None:
    """Return the flatness deviation of a map, None where nobody says it.

    What is said is that of one scan. It is no chance: a sum of two has it twice.
    """
    given_m = settings.instrument.flatness_deviation_m
    return None if given_m is None else given_m * surface.faces


def bows_m(
    surface: HeightMap, flatness_m: float, x_m: np.ndarray, y_m: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return six bows of one height over a map: along x, along y and of a sphere, up and down.

    Parameters
    ----------
    surface : HeightMap
        Over which each bow rises or sinks by `flatness_m`.
    flatness_m : float
        Flatness deviation z_FLT (ISO 25178-600): the greatest difference of heights that the
        instrument shows of a flat.
    x_m, y_m : float64, of one shape
        Places where the bows are asked for, from the map's corner.

    Returns
    -------
    tuple of float64
        Heights, m, at the places.
    """
    height_m, width_m = (
        n * side_m for n, side_m in zip(surface.shape, surface.pixel_size_m, strict=True)
    )
    along_x, along_y = np.square(2.0 * x_m / width_m - 1.0), np.square(2.0 * y_m / height_m - 1.0)
    shapes = (along_x, along_y, 0.5 * (along_x + along_y))
    return tuple(sign * flatness_m * shape for shape in shapes for sign in (1.0, -1.0))
