"""The caps that can touch below a load."""

from dataclasses import dataclass

import numpy as np

from capslip.caps.table import CapTable
from capslip.contact.bulk import bulk_of_face_m_per_N
from capslip.contact.models.interacting import InteractingCurve, interacting
from capslip.contact.models.mean_field import mean_field
from capslip.contact.solvers.hertz import HertzCurve
from capslip.contact.solvers.yielding import YieldLaw, first_loading, first_loading_at
from capslip.surface.heightmap import HeightMap

MAX_INTERACTING = 2000  # caps; the dense matrix of pairs then takes 32 MB
REACH_MARGIN = 0.25  # of the approach: caps a little deeper are kept too


@dataclass(frozen=True, eq=False)
class Reach:
    """The caps that can touch below a load, and their curve with interaction; see `reachable`.

    Where caps yield the curve is that of the flattened ones, and its approach counts from the
    highest peak as it was.
    """

    use: np.ndarray  # (n,), these and some a little lower; all usable ones without `pairs`
    mean: HertzCurve  # of all usable caps, with the interaction of the mean field
    pairs: InteractingCurve | None  # of those in use; None: too many to solve for every pair

    @property
    def curve(self) -> HertzCurve:
        """The better one of the two."""
        return self.mean if self.pairs is None else self.pairs


def reachable(
    caps: CapTable,
    surface: HeightMap,
    E_star_Pa: float,
    preload_N: float,
    law: YieldLaw | None = None,
) -> Reach:
    """Find the caps that can touch below a load.

    A cap touches only if it is higher than the approach, which counts from the highest peak. Where
    the approach of the chosen caps stays above all others, it is the approach of all.

    Parameters
    ----------
    caps : CapTable
        Caps of the face, at least one of them usable.
    surface : HeightMap
        The face.
    E_star_Pa, preload_N : float
        Composite modulus; load of the joint.
    law : YieldLaw, optional
        Of caps that yield.

    Raises
    ------
    ContactError
        If the caps cannot carry the preload.
    """
    depth_m = caps.peak_height_m[caps.usable].max() - caps.peak_height_m
    x_m, y_m, radius_m = caps.x_m, caps.y_m, caps.radius_m
    spheres = radius_m[caps.usable], depth_m[caps.usable]
    if law is not None:
        after = first_loading(law, *spheres, E_star_Pa, preload_N)
        spheres = after.radius_m, after.depth_m
    bulk_m_per_N = bulk_of_face_m_per_N(surface, E_star_Pa)
    mean = mean_field(*spheres, E_star_Pa, bulk_m_per_N, preload_N)
    approach_m, reach_m = float(mean.approach_m(preload_N)), 0.0
    near, pairs = caps.usable, None
    while approach_m > reach_m:
        reach_m = (1.0 + REACH_MARGIN) * approach_m
        near = caps.usable & (depth_m <= reach_m)
        if np.count_nonzero(near) > MAX_INTERACTING:
            return Reach(caps.usable, mean, None)
        spheres, places = (radius_m[near], depth_m[near]), (x_m[near], y_m[near])
        pairs = interacting(*spheres, *places, E_star_Pa, preload_N)
        if law is not None:
            after = first_loading_at(
                *(np.column_stack(places), law, *spheres, E_star_Pa, preload_N),
                compliance_m_per_N=pairs.pair_compliance_m_per_N,
                start_m=pairs.start_m,
            )
            spheres, start_m = (after.radius_m, after.depth_m), after.compression_m
            pairs = interacting(*spheres, *places, E_star_Pa, preload_N, start_m=start_m)
        approach_m = float(pairs.approach_m(preload_N))
    return Reach(near, mean, pairs)
