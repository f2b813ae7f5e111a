"""Where a pressed map still touches at falling loads, and which contact regions carry them."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.contact.solvers.path import Path

LOADS = 33  # from zero to the preload, evenly in their power 2/3


@dataclass(frozen=True, eq=False)
class LettingGo:
    """What is left of contact and loads, made by `letting_go`; k loads, n regions, p pixels.

    Regions and pixels, in their flat order, are those that touch on the map under the preload.
    """

    load_N: np.ndarray  # (k,), of the face, growing from zero to the preload
    region_share: np.ndarray  # (k, n), load of each region over that under the preload
    first: np.ndarray  # (p,), row of the least of the loads under which each pixel touches


def letting_go(path: Path) -> LettingGo:
    """Return what is left at many loads, most of them between those that were solved.

    The pressures are those that a solution there would begin with, see `starts.start_Pa`: at the
    solved loads they are exact, and anywhere they sum to the load. A refined pixel touches where
    half of its points do.
    """
    state, face = path.map_pressed, path.face
    load_N = state.load_N * np.linspace(0.0, 1.0, LOADS) ** 1.5
    region_N = state.region_loads_N
    share = np.zeros((LOADS, len(region_N)), dtype=np.float32)
    share[-1] = 1.0
    pixel, of = np.unique(face.parent, return_inverse=True)
    first = np.full(face.map_shape, LOADS - 1, dtype=np.uint8).reshape(-1)
    for row in range(LOADS - 2, 0, -1):
        pressure_Pa = path.start_Pa(load_N[row])
        left = path.region_loads_N(pressure_Pa) / path.region_load_N
        # Refined contacts share the load a little differently from those of the map
        share[row, path.left] = left * load_N[row] / (left @ region_N[path.left])
        points = np.bincount(of, weights=pressure_Pa > 0.0)
        first[pixel[2 * points >= math.prod(face.per_pixel)]] = row
    return LettingGo(load_N, share, first[state.region.reshape(-1) > 0])
