"""Families of caps: the few that carry (G) and the many, lower ones that slip (P)."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from capslip.caps.clusters import CLEAR_LOG_ODDS, CLEAR_SEPARATION, Clusters, cluster
from capslip.caps.levels import Levels, find_levels
from capslip.caps.planes import LEAST_CAPS
from capslip.caps.table import CapFlag, CapTable

Feature = Literal["peak_height", "cap_height", "diameter", "radius"]
MIN_SEPARATION = 4.0  # pooled spreads; nearer, one cap in forty is on the wrong side
CLEAR_OVER_FIT = 3.0  # standard errors of h by the fits
ALIKE_LEVEL = 0.01  # of the chi-square test that the peaks are equally high
ODD = CapFlag.outlier | CapFlag.ridge | CapFlag.apex_off_surface  # their heights fix no plane


@dataclass(frozen=True)
class Family:
    """The caps of one family.

    Standard errors are those of the mean, from the spread within the families, pooled; None where
    no family has two caps.
    """

    count: int
    radius_m: float  # (mean sqrt(R))^2: the sphere that has the family's mean normal curve
    mean_radius_m: float
    diameter_m: float
    height_m: float  # df of Eq. 18
    peak_height_m: float
    radius_se_m: float | None
    peak_height_se_m: float | None


@dataclass(frozen=True)
class Families:
    """G-caps and P-caps; G is the higher family, `h_m` the difference of their peak heights.

    A family that does not exist is None, and so is h_m then.

    Attributes
    ----------
    G, P : Family or None
        The higher family, and the lower.
    levels : tuple of Family
        As many families as the caps support, the highest first: G and P, or more than two.
    separation : float or None
        Distance of the two families over the pooled spread, also of the two that were not taken;
        infinite where the caps of each are alike. None for fewer than three caps, or equal ones.
    log_odds : float or None
        Natural log of the odds of the number of families that the caps support, against the best
        other number; negative where the likelier families overlap too much to be told apart.
    count_se : float
        Standard error of m and of n: caps between the families may belong to either. About a
        quarter too low, because the split itself makes the families look narrow.
    alike : bool
        Whether all peaks are equally high as far as their standard errors let one see.
    h_fit_se_m : float
        Standard error of h that the fits of the peaks leave; 0 where it is not known.
    """

    G: Family | None
    P: Family | None
    levels: tuple[Family, ...]
    separation: float | None
    log_odds: float | None
    count_se: float
    alike: bool
    h_fit_se_m: float = 0.0

    @property
    def count(self) -> int:
        """Number of families: 0, 1 or 2."""
        return (self.G is not None) + (self.P is not None)

    @property
    def m(self) -> int:
        """Number of G-caps."""
        return self.G.count if self.G else 0

    @property
    def n(self) -> int:
        """Number of P-caps."""
        return self.P.count if self.P else 0

    @property
    def h_m(self) -> float | None:
        """Height of the G-peaks above the P-peaks."""
        return self.G.peak_height_m - self.P.peak_height_m if self.G and self.P else None

    @property
    def h_se_m(self) -> float | None:
        """Standard error of h."""
        if not self.G or not self.P:
            return None
        if self.G.peak_height_se_m is None or self.P.peak_height_se_m is None:
            return None
        return float(np.hypot(self.G.peak_height_se_m, self.P.peak_height_se_m))

    @property
    def clear(self) -> bool:
        """Whether the caps leave no doubt about the number of families that was taken.

        It needs odds of 20 to 1 and, for two, families that are five spreads apart, and more than
        what the fits of the peaks leave open; for one, that no split in two is as wide as families
        are: heights that are spread evenly split into halves of 3.5 spreads. Or peaks that are
        alike, and so one family, however few they are.
        """
        if self.alike and self.count == len(self.levels) == 1:
            return True
        if self.log_odds is None:
            return self.count < 2
        width = self.separation or 0.0
        apart = width < MIN_SEPARATION if self.count < 2 else width >= CLEAR_SEPARATION
        if self.h_m is not None and self.h_m < CLEAR_OVER_FIT * self.h_fit_se_m:
            return False
        return apart and self.log_odds >= CLEAR_LOG_ODDS and self.count == len(self.levels)


@dataclass(frozen=True, eq=False)
class FamilySurface:
    """The surface on which families are levels, made by `surface_of_families`."""

    slope: np.ndarray  # (2,), along x and y
    bow: np.ndarray  # (3,), terms of x^2, x y and y^2
    count: int  # of families
    levels: Levels | None = None  # of these caps, by their number in the table
    caps: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def levels_of(self, caps: CapTable, usable: np.ndarray) -> Levels:
        """Return the levels of some caps of the table, found anew where they are others."""
        if self.levels is not None and np.array_equal(self.caps, usable):
            return self.levels
        return _levels_of(caps, usable)


def group_families(
    caps: CapTable,
    count: str | int = "auto",
    feature: Feature = "peak_height",
    own_plane: bool = False,
    known: FamilySurface | None = None,
) -> tuple[CapTable, Families]:
    """Group the usable caps into one or two families by one of their features.

    The split is exact and the number of families follows from the evidence, see `cluster`. Two are
    taken where they are likelier than one and at least four pooled spreads apart; more than two are
    named in `levels` where the odds are 20 to 1 and each is five spreads from the next, but G and P
    remain the best split in two: that is what the two-height model needs. Peaks that differ by no
    more than their standard errors are one family, whatever the odds.

    Parameters
    ----------
    caps : CapTable
        Fitted caps; those without a usable sphere belong to no family.
    count : {"auto", 1, 2}
        How many families to form. One family is called G.
    feature : {"peak_height", "cap_height", "diameter", "radius"}
        The column that is grouped. G is the family of the higher peaks, whatever the feature.
    own_plane : bool
        Whether peak heights are levels on a common plane that is found with them, see
        `find_levels`, so that a plane added to the map moves nothing. It takes five caps.
    known : FamilySurface, optional
        What `surface_of_families` returned for the same table: its levels are found already, unless
        odd caps were left out.

    Returns
    -------
    CapTable, Families
        The table with its `family` column filled, and the families.

    Notes
    -----
    The radius of a family is the one whose normal curve is the sum over its caps. From
    N = 4/3 E* sum sqrt(R_i) (d - h_i)^1.5 (Eq. 9) it follows that sqrt(R) is the mean of sqrt(R_i),
    exactly for equal heights. With a spread s of the heights that has nothing to do with the radii,
    the family carries 3/8 (s / x)^2 of the load too little, x being the approach beyond its mean
    peak: 0.4 % where x is ten spreads, 4 % where it is three.
    """
    usable = np.flatnonzero(caps.usable)
    levels = None
    if own_plane and feature == "peak_height" and usable.size >= LEAST_CAPS:
        levels = _levels_of(caps, usable) if known is None else known.levels_of(caps, usable)
        found = levels.clusters
        alike = _alike(_on_plane(caps, usable, levels, 1), usable, free=3)
    else:
        found = cluster(np.sort(getattr(caps, f"{feature}_m")[usable]))
        alike = feature == "peak_height" and _alike(caps, usable)
    supported, log_odds = _supported(found, alike)
    wanted = min(supported, 2) if count == "auto" else min(int(count), len(found.sizes))

    def grouped(number: int) -> tuple[CapTable, np.ndarray, np.ndarray]:
        table = caps if levels is None else _on_plane(caps, usable, levels, number)
        order = np.argsort(getattr(table, f"{feature}_m")[usable], kind="stable")
        member = usable[order]
        return table, member, _in_groups(table, member, found.sizes[number - 1])

    table, member, group = grouped(wanted)
    family = np.full(len(caps), "", dtype="<U1")
    family[member] = np.array(["G", "P"])[group]
    taken = _families(table, member, group)
    return caps.with_columns(family=family), Families(
        G=taken[0] if taken else None,
        P=taken[1] if len(taken) > 1 else None,
        levels=taken if supported == wanted else _families(*grouped(supported)),
        separation=float(found.separation[1]) if len(found.sizes) > 2 else None,
        log_odds=log_odds,
        count_se=_count_se(getattr(table, f"{feature}_m")[member], group),
        alike=alike,
        h_fit_se_m=_error_of_fits_m(caps.peak_height_se_m[member], group),
    )


def surface_of_families(caps: CapTable, at_m: tuple[float, float]) -> FamilySurface:
    """Return the surface on which families are levels, and their number.

    Odd caps are left out where five others are there: one at an edge whose apex was not found tilts
    the plane, and the cut along it. Slopes and bow are zero for fewer than five usable caps.

    Parameters
    ----------
    caps : CapTable
        As for `group_families`.
    at_m : (float, float)
        Place (x, y) of these slopes, from which coordinates count.
    """
    usable = np.flatnonzero(caps.usable & ((caps.flags & ODD) == 0))
    if usable.size < LEAST_CAPS:
        usable = np.flatnonzero(caps.usable)
    if usable.size < LEAST_CAPS:
        return FamilySurface(np.zeros(2), np.zeros(3), 1)
    levels = _levels_of(caps, usable, at_m)
    alike = _alike(_on_plane(caps, usable, levels, 1), usable, free=3)
    count = _supported(levels.clusters, alike)[0]
    return FamilySurface(levels.slope[count - 1], levels.bow, count, levels, usable)


def _levels_of(
    caps: CapTable, usable: np.ndarray, at_m: tuple[float, float] = (0.0, 0.0)
) -> Levels:
    x_m, y_m = caps.x_m[usable] - at_m[0], caps.y_m[usable] - at_m[1]
    return find_levels(x_m, y_m, caps.peak_height_m[usable])


def _on_plane(caps: CapTable, usable: np.ndarray, levels: Levels, number: int) -> CapTable:
    """Return the caps with heights over the plane of so many families."""
    peak_m = np.full(len(caps), np.nan)
    peak_m[usable] = levels.heights_m(number)
    return caps.with_columns(peak_height_m=peak_m)


def _supported(found: Clusters, alike: bool) -> tuple[int, float | None]:
    """Return the number of families that the caps support, and its log odds.

    The odds know the scatter of the heights alone: they may split what only noise or rounding
    tells apart.
    """
    evidence, separation = found.log_evidence, found.separation
    if len(evidence) < 2:
        return 1, None  # also of no caps at all
    if alike:
        return 1, float(evidence[0] - evidence[1])
    best = 2 if evidence[1] > evidence[0] and separation[1] >= MIN_SEPARATION else 1
    # Three and more are fragments of two unless they are far apart
    numbers = [1, 2, *(np.flatnonzero(separation[2:] >= CLEAR_SEPARATION) + 3)]
    for count in numbers[2:]:
        if evidence[count - 1] - evidence[: count - 1].max() >= CLEAR_LOG_ODDS:
            best = int(count)
    rivals = [evidence[count - 1] for count in numbers if count != best]
    return best, float(evidence[best - 1] - max(rivals))


def _alike(caps: CapTable, member: np.ndarray, free: int = 1) -> bool:
    """Tell whether the peaks differ by no more than chance, given their standard errors.

    A chi-square test of equal heights, of which `free` unknowns were fitted. Where noise is a
    visible part of a cap, equal within the errors says nothing; and an error far above the usual
    one is that of a hill that is no sphere, not of noise, and excuses no other height.
    """
    from scipy.special import chdtrc

    peak_m, error_m = caps.peak_height_m[member], caps.peak_height_se_m[member]
    noisy = (caps.flags[member] & CapFlag.noisy_apex) != 0
    if member.size <= free or noisy.any() or not (error_m > 0.0).all():
        return False
    error_m = np.minimum(error_m, 2.0 * np.median(error_m))
    weight = (error_m.min() / error_m) ** 2
    deviation = (peak_m - np.average(peak_m, weights=weight)) / error_m
    return bool(chdtrc(member.size - free, deviation @ deviation) >= ALIKE_LEVEL)


def _in_groups(caps: CapTable, member: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Give each member the number of its group, 0 for the group with the highest peaks."""
    group = np.repeat(np.arange(len(sizes)), sizes)
    peak_sum_m = np.bincount(group, caps.peak_height_m[member], minlength=len(sizes))
    rank = np.argsort(np.argsort(-peak_sum_m / np.maximum(sizes, 1), kind="stable"))
    numbered: np.ndarray = rank[group]
    return numbered


def _families(caps: CapTable, member: np.ndarray, group: np.ndarray) -> tuple[Family, ...]:
    """Return the families, the highest first."""
    if member.size == 0:
        return ()
    size = np.bincount(group)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(group, values[member]) / size

    def standard_error(values: np.ndarray) -> list[float | None]:
        spread = _pooled_spread(values[member], group)
        return [None if spread is None else float(spread / np.sqrt(n)) for n in size]

    same_curve_m = mean(np.sqrt(caps.radius_m)) ** 2
    columns = zip(
        size.tolist(),
        same_curve_m.tolist(),
        mean(caps.radius_m).tolist(),
        mean(caps.diameter_m).tolist(),
        mean(caps.cap_height_m).tolist(),
        mean(caps.peak_height_m).tolist(),
        standard_error(caps.radius_m),
        standard_error(caps.peak_height_m),
        strict=True,
    )
    return tuple(Family(*row) for row in columns)


def _pooled_spread(values: np.ndarray, group: np.ndarray) -> float | None:
    """Return the standard deviation within the groups; None where no group has two members."""
    size = np.bincount(group)
    freedom = len(values) - len(size)
    if freedom <= 0:
        return None
    deviation = values - (np.bincount(group, values) / size)[group]
    return float(np.sqrt(deviation @ deviation / freedom))


def _error_of_fits_m(error_m: np.ndarray, group: np.ndarray) -> float:
    """Return the standard error of the difference of two means, from those of their members."""
    size = np.bincount(group, minlength=2)
    square_m2 = np.bincount(group, np.nan_to_num(error_m) ** 2, minlength=2)
    return float(np.sqrt((square_m2 / np.maximum(size, 1) ** 2).sum()))


def _count_se(values: np.ndarray, group: np.ndarray) -> float:
    """Return the standard error of the sizes of two normal groups of one width.

    The odds that a member at x belongs to the first of the two are n_1 / n_2 times
    exp[(mean_1 - mean_2) (x - middle) / spread^2].
    """
    size = np.bincount(group, minlength=2)
    spread = _pooled_spread(values, group)
    if not size.all() or not spread:
        return 0.0
    first, second = np.bincount(group, values) / size
    middle = (first + second) / 2.0
    log_odds = np.log(size[0] / size[1]) + (first - second) * (values - middle) / spread**2
    share = 1.0 / (1.0 + np.exp(np.clip(log_odds, -700.0, 700.0)))
    return float(np.sqrt((share * (1.0 - share)).sum()))
