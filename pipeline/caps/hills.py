"""Hills: the parts of the face that stand above the cut.

The paper keeps the highest 10 % of the points (its section 3): the cut height is Smc(10 %) of the
areal material ratio curve, taken over the measured points alone.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.errors import UnusableSurfaceError
from pipeline.surface.heightmap import HeightMap

MIN_POINTS = 9  # a sphere and a tilt have five unknowns; fewer points than this say nothing
NOISE_FACTOR = 5.0  # noise alone lifts a point this many standard deviations once in 3.5 million


@dataclass(frozen=True, eq=False)
class Hills:
    """Labelled hills of one height map.

    Attributes
    ----------
    label : int32, shape (ny, nx)
        1 ... n on the hills, 0 elsewhere.
    cut_height_m : float
        Smc(material ratio).
    kept_fraction : float
        Share of the measured points at or above the cut.
    n_regions : int
        Connected regions above the cut, fragments included.
    largest_region_share : float
        Points of the largest region over all points above the cut.
    noise_m : float
        Standard deviation of the point-to-point noise.
    rejected : dict
        Regions that are no hills, counted by reason.
    """

    label: np.ndarray
    cut_height_m: float
    kept_fraction: float
    n_regions: int
    largest_region_share: float
    noise_m: float
    rejected: dict[str, int]

    @property
    def n_hills(self) -> int:
        """Number of hills."""
        return int(self.label.max(initial=0))


def find_hills(surface: HeightMap, material_ratio: float = 0.10) -> Hills:
    """Cut a height map and separate what stands above the cut into 8-connected hills.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    material_ratio : float
        Share of the measured points to keep, in (0, 1).

    Returns
    -------
    Hills
        Regions of fewer than 9 points, and regions that noise alone would raise above the cut, are
        counted in `rejected` and carry no label.

    Raises
    ------
    UnusableSurfaceError
        If no point is measured, all heights are equal, or fewer than 9 points lie above the cut.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[-50:51, -50:51] * 1e-4
    >>> hills = find_hills(HeightMap(-(x**2 + y**2) / 50, (1e-4, 1e-4)))
    >>> hills.n_hills, round(hills.kept_fraction, 2)
    (1, 0.1)
    """
    heights_m = surface.height_m[surface.measured]
    name = surface.origin.name
    if heights_m.size == 0:
        raise UnusableSurfaceError(
            f"{name}: all {surface.height_m.size} points are non-measured; expected heights; "
            "check the file's code for missing data"
        )
    if heights_m.min() == heights_m.max():
        raise UnusableSurfaceError(
            f"{name}: all {heights_m.size} measured heights equal {heights_m[0]:g} m; expected a "
            "surface with relief; check the dataset and the unit"
        )
    return _label(surface, heights_m, material_ratio)


def _label(surface: HeightMap, heights_m: np.ndarray, material_ratio: float) -> Hills:
    from scipy import ndimage

    cut_m = float(np.quantile(heights_m, 1.0 - material_ratio))
    above = surface.height_m >= cut_m  # False on NaN
    n_kept = int(above.sum())
    if n_kept < MIN_POINTS:
        raise UnusableSurfaceError(
            f"{surface.origin.name}: {n_kept} points lie above the cut at {cut_m:.3g} m; expected "
            f"at least {MIN_POINTS}; raise hills.material_ratio or use a finer scan"
        )
    region = np.empty(above.shape, dtype=np.int32)
    n_regions = ndimage.label(above, structure=np.ones((3, 3)), output=region)
    inside = region[above]
    points = np.bincount(inside, minlength=n_regions + 1)
    top_m = np.full(n_regions + 1, -np.inf)
    np.maximum.at(top_m, inside, surface.height_m[above])

    noise_m = _noise(surface.height_m)
    few = points < MIN_POINTS
    low = ~few & (top_m - cut_m < NOISE_FACTOR * noise_m)
    few[0] = low[0] = False
    keep = ~(few | low)
    keep[0] = False
    new_label = np.where(keep, np.cumsum(keep), 0).astype(np.int32)
    counts = {"too_few_points": int(few.sum()), "within_noise": int(low.sum())}
    return Hills(
        label=new_label[region],
        cut_height_m=cut_m,
        kept_fraction=n_kept / heights_m.size,
        n_regions=int(n_regions),
        largest_region_share=float(points[1:].max() / n_kept),
        noise_m=noise_m,
        rejected={reason: count for reason, count in counts.items() if count},
    )


def _noise(height_m: np.ndarray) -> float:
    """Return the standard deviation of white noise, from the median of the second mixed difference.

    The stencil (1 -2 1) x (1 -2 1) is blind to any quadratic surface; white noise comes out of it
    36 times in variance. The median holds against steps and spikes. Points beside non-measured
    ones drop out.
    """
    rows = height_m[:-2] - 2 * height_m[1:-1] + height_m[2:]
    both = rows[:, :-2] - 2 * rows[:, 1:-1] + rows[:, 2:]
    both = np.abs(both[~np.isnan(both)])
    return float(np.median(both) / (0.6744897501960817 * 6.0)) if both.size else 0.0
