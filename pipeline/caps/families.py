"""Families of caps: the few that carry (G) and the many, lower ones that slip (P)."""

from dataclasses import dataclass

import numpy as np

from pipeline.caps.table import CapTable


@dataclass(frozen=True)
class Family:
    """Means over the caps of one family."""

    count: int
    radius_m: float
    diameter_m: float
    height_m: float  # df of Eq. 18
    peak_height_m: float


@dataclass(frozen=True)
class Families:
    """G-caps and P-caps; G is the higher family, `h_m` the difference of their peak heights.

    A family that does not exist is None, and so is h_m then.
    """

    G: Family | None
    P: Family | None
    separation: float | None  # |mean_G - mean_P| over the pooled spread; None for fewer than two

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


def group_families(caps: CapTable, count: str | int = "auto") -> tuple[CapTable, Families]:
    """Group the usable caps by peak height into one or two families.

    The split is the exact optimum of one-dimensional two-means (of all cuts of the sorted heights,
    the one with the least sum of squares within the families). With `count="auto"` two families are
    kept where the Bayesian information criterion of two normal distributions of equal width, one
    split parameter included, beats that of one.

    Parameters
    ----------
    caps : CapTable
        Fitted caps; those without a usable sphere belong to no family.
    count : {"auto", 1, 2}
        How many families to form. One family is called G.

    Returns
    -------
    CapTable, Families
        The table with its `family` column filled, and the means.
    """
    member = np.flatnonzero(caps.usable)
    member = member[np.argsort(caps.peak_height_m[member], kind="stable")]
    height_m = caps.peak_height_m[member]
    family = np.full(len(caps), "", dtype="<U1")
    n_low, separation = _split(height_m)
    if count == 1 or (count == "auto" and not _two_is_better(height_m, n_low)):
        n_low, separation = 0, None
    family[member[:n_low]] = "P"
    family[member[n_low:]] = "G"
    caps = caps.with_columns(family=family)
    return caps, Families(_family(caps, "G"), _family(caps, "P"), separation)


def _split(height_m: np.ndarray) -> tuple[int, float | None]:
    """Return the number of caps in the lower family of the best split, and how wide it is."""
    n = len(height_m)
    if n < 2 or height_m[0] == height_m[-1]:
        return 0, None
    within = _within(height_m)
    n_low = int(np.argmin(within)) + 1
    spread_m = np.sqrt(within[n_low - 1] / n)
    gap_m = height_m[n_low:].mean() - height_m[:n_low].mean()
    return n_low, float(gap_m / spread_m) if spread_m > 0.0 else None


def _within(height_m: np.ndarray) -> np.ndarray:
    """Sum of squares within the two parts, for every split after 1 ... n-1 sorted heights."""
    z = height_m - height_m.mean()
    n = np.arange(1, len(z))
    low, low2 = np.cumsum(z)[:-1], np.cumsum(z**2)[:-1]
    high2 = (z**2).sum() - low2
    return np.maximum(low2 - low**2 / n, 0) + np.maximum(high2 - low**2 / (len(z) - n), 0)


def _two_is_better(height_m: np.ndarray, n_low: int) -> bool:
    """Compare two equal-width normal families with one family, normal or uniform, by BIC.

    Classification likelihoods: the entropy of the shares pays back what the best split of a single
    family always gains. The uniform alternative is a continuum of heights. The two-family model
    has two parameters more, and its split is a choice among n - 1. Identical heights count as known
    to a millionth of the range, not to a perfect fit.
    """
    n = len(height_m)
    if n_low == 0 or n < 3:
        return False
    range_m = height_m[-1] - height_m[0]
    within = max(_within(height_m)[n_low - 1], n * (1e-6 * range_m) ** 2)
    total = ((height_m - height_m.mean()) ** 2).sum()
    normal = n * np.log(2 * np.pi * np.e)
    one = min(normal + n * np.log(total / n), 2 * n * np.log(range_m))
    share = np.array([n_low, n - n_low]) / n
    two = normal + n * np.log(within / n) - 2 * n * (share * np.log(share)).sum()
    return bool(one - two > 2 * np.log(n) + 2 * np.log(n - 1))


def _family(caps: CapTable, name: str) -> Family | None:
    member = caps.family == name
    if not member.any():
        return None
    return Family(
        count=int(member.sum()),
        radius_m=float(caps.radius_m[member].mean()),
        diameter_m=float(caps.diameter_m[member].mean()),
        height_m=float(caps.cap_height_m[member].mean()),
        peak_height_m=float(caps.peak_height_m[member].mean()),
    )
