"""Clusters of numbers on a line: the best split into one, two or more, and the odds of each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

# Variance of the means over that within, before the numbers are seen, and its odds
WIDTH_RATIOS2 = ((50.0, 4 / 7), (5e3, 2 / 7), (5e5, 1 / 7))
MAX_CLUSTERS = 4
CLEAR_SEPARATION = 5.0  # spreads between clusters that leave no doubt
CLEAR_LOG_ODDS = 3.0  # 20 to 1
LEAST_RANGE = 1e-3  # of that of all numbers: less in a cluster is rounding
LEAST_INSIDE = 5  # numbers of a cluster that may be two: fewer fix no width of their own
MAX_EDGES = 400  # places to cut that three clusters and more are searched over


@dataclass(frozen=True, eq=False)
class Clusters:
    """The best splits of n sorted numbers into K = 1, 2, ... clusters.

    Attributes
    ----------
    sizes : tuple of int64 arrays
        Item K - 1 holds the sizes of K clusters, the lowest numbers first.
    log_evidence : float64, shape (n_splits,)
        Natural log of the probability of the numbers, given K clusters. Differences are log odds.
    separation : float64, shape (n_splits,)
        Least distance of neighbouring means over the pooled standard deviation; NaN for one
        cluster and for clusters of one number each, infinite where those of each are equal. For
        three of which two have a width of their own, see `split_inside`, over that width.
    """

    sizes: tuple[np.ndarray, ...]
    log_evidence: np.ndarray
    separation: np.ndarray


def cluster(values: np.ndarray) -> Clusters:
    """Split numbers into one to four clusters, exactly.

    The split is that of the least sum of squares within the clusters: of all contiguous splits of
    the sorted numbers for two; by dynamic programming for more, over at most 400 places to cut.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite numbers, **sorted**. Equal numbers, or fewer than two, are one cluster.

    Returns
    -------
    Clusters

    Notes
    -----
    The evidence is a marginal likelihood, which small n needs: no parameter is fitted. Place and
    width have the prior 1/width in every model. One cluster may be normal, uniform or exponential
    to either side, at equal odds, because the tail of a skewed shape is no cluster of its own. K
    clusters are normal, of one width w, their means scattered with one of `WIDTH_RATIOS2` w^2 as
    variance, their sizes any at equal odds, a given number in any of them. All integrals have
    closed forms. Three may also be two of which one is two of another width, see `split_inside`.

    Examples
    --------
    >>> two = cluster(np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 5.0, 5.1, 5.3]))
    >>> two.sizes[1], bool(two.log_evidence[1] - two.log_evidence[0] > 3.0)
    (array([6, 3]), True)
    """
    found = _of_one_width(values)
    if len(found.sizes) < 3:
        return found
    least = LEAST_RANGE * (values[-1] - values[0])
    inside = [
        _of_one_width(part) if part[-1] - part[0] >= least else one_cluster(len(part))
        for part in np.split(values, found.sizes[1][:1])
    ]
    return split_inside(found, inside)[0]


def one_cluster(n: int) -> Clusters:
    """Return what n numbers are that nothing tells apart."""
    return Clusters((np.array([n]),), np.zeros(1), np.full(1, np.nan))


def split_inside(found: Clusters, inside: Sequence[Clusters]) -> tuple[Clusters, int | None]:
    """Take as three clusters two of which one is two again, where that is far likelier.

    Clusters of one width are blind to two that lie close beside a third that is widely spread. So
    the split in two of the numbers in one of the two, with a width of its own, is asked as well:
    with e the evidence, e(3) = e(2) e(2 inside) / e(1 inside) / 2, as either of both may be two.

    Parameters
    ----------
    found : Clusters
        Of all numbers.
    inside : sequence of two Clusters
        Of the numbers in the lower and in the upper of the best two.

    Returns
    -------
    Clusters, int or None
        The splits, and which of the two is split in them again: 0 the lower, None for neither.
    """
    evidence, separation, best = found.log_evidence.copy(), found.separation.copy(), None
    sizes = list(found.sizes)
    for i, part in enumerate(inside):
        if len(part.sizes) < 2 or part.sizes[0][0] < LEAST_INSIDE:
            continue
        gain = float(part.log_evidence[1] - part.log_evidence[0]) - math.log(2.0)
        apart = min(float(found.separation[1]), float(part.separation[1]))
        if gain < CLEAR_LOG_ODDS or apart < min(separation[2], CLEAR_SEPARATION):
            continue
        if evidence[2] >= found.log_evidence[1] + gain:
            continue
        best, evidence[2], separation[2] = i, found.log_evidence[1] + gain, apart
        other = found.sizes[1][1 - i]
        sizes[2] = np.array([*part.sizes[1], other] if i == 0 else [other, *part.sizes[1]])
    return Clusters(tuple(sizes), evidence, separation), best


def _of_one_width(values: np.ndarray) -> Clusters:
    """Split sorted numbers into clusters of one width."""
    n = len(values)
    if n < 2 or values[0] == values[-1]:
        return one_cluster(n)
    z = (values - values[0]) / (values[-1] - values[0])
    z -= z.mean()
    log_factorial = np.append(0.0, np.cumsum(np.log(np.arange(1.0, n + 1.0))))
    low = np.arange(1, n)
    splits_in_two = np.column_stack((low, n - low))
    best = int(np.argmin(within_of(z, splits_in_two)))
    sizes = [np.array([n]), splits_in_two[best], *splits(z, min(MAX_CLUSTERS, n))]
    one, _, *more = (_log_normal(z, split[None, :], log_factorial)[0] for split in sizes)
    one = np.logaddexp.reduce([one, *_log_other_shapes(z, log_factorial)]) - math.log(4.0)
    two = np.logaddexp.reduce(_log_normal(z, splits_in_two, log_factorial))
    return Clusters(
        sizes=tuple(sizes),
        log_evidence=np.array([one, two, *more]),
        separation=np.array([separation_of(z, split) for split in sizes]),
    )


def _sums(z: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Add up the clusters of each split, shape of `sizes`."""
    ends = np.cumsum(sizes, axis=-1)
    total = np.append(0.0, np.cumsum(z))
    return total[ends] - total[ends - sizes]


def within_of(z: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Sum of squares within the clusters of each split, sizes of shape (n_splits, K)."""
    within = (z**2).sum() - (_sums(z, sizes) ** 2 / sizes).sum(axis=-1)
    return np.where(within > 1e-13 * (z**2).sum(), within, 0.0)  # below is rounding


def splits(z: np.ndarray, most: int) -> list[np.ndarray]:
    """Sizes of the best split into 3, ... `most` clusters, by dynamic programming."""
    return [split[0] for split in splits_of_rows(z[None], most)]


def splits_of_rows(z: np.ndarray, most: int) -> list[np.ndarray]:
    """Return the same of rows of sorted numbers: sizes of shape (n_rows, 3), ... (n_rows, most)."""
    n_rows, n = z.shape
    edges, first, last = _edges(n)
    sums = np.zeros((2, n_rows, n + 1))
    np.cumsum((z, z * z), axis=2, out=sums[..., 1:])
    total, square = sums[..., edges]
    cost = np.full((n_rows, len(edges), len(edges)), np.inf)
    mean_part = (total[:, last] - total[:, first]) ** 2 / (edges[last] - edges[first])
    cost[:, first, last] = square[:, last] - square[:, first] - mean_part
    least, each = cost[:, 0], np.arange(n_rows)  # of the numbers up to each edge
    origins, splits = [], []
    for count in range(2, most + 1):
        through = least[:, :, None] + cost
        origins.append(np.argmin(through, axis=1))
        least = through.min(axis=1)
        if count > 2:
            cuts = [np.full(n_rows, len(edges) - 1)]
            for origin in reversed(origins):
                cuts.insert(0, origin[each, cuts[0]])
            splits.append(np.diff(edges[np.stack(cuts, axis=1)], axis=1, prepend=0))
    return splits


@lru_cache(maxsize=8)
def _edges(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places to cut n numbers, and all pairs of a lower one with a higher."""
    edges = np.unique(np.linspace(0, n, min(n, MAX_EDGES) + 1).astype(int))
    return (edges, *np.triu_indices(len(edges), 1))


def _log_normal(z: np.ndarray, sizes: np.ndarray, log_factorial: np.ndarray) -> np.ndarray:
    """Log evidence of normal clusters of one width, for each split; sizes (n_splits, K).

    Means and width integrated out; times the odds of these sizes and of these members. The K!
    ways to name the clusters are one split.
    """
    n, count = len(z), sizes.shape[-1]
    mean, within = _sums(z, sizes) / sizes, within_of(z, sizes)
    log_shapes = []
    for ratio, odds in WIDTH_RATIOS2 if count > 1 else [(0.0, 1.0)]:
        weight = sizes / (1.0 + ratio * sizes)
        centre = (weight * mean).sum(axis=-1, keepdims=True) / weight.sum(axis=-1, keepdims=True)
        rest = within + (weight * (mean - centre) ** 2).sum(axis=-1)
        log_widths = np.log1p(ratio * sizes).sum(axis=-1) + np.log(weight.sum(axis=-1))
        log_shapes.append(math.log(odds) - 0.5 * log_widths - 0.5 * (n - 1) * np.log(rest))
    log_members = log_factorial[n] - log_factorial[sizes].sum(axis=-1)
    log_sizes = log_factorial[n - 1] - log_factorial[count - 1] - log_factorial[n - count]
    constant = math.lgamma(0.5 * (n - 1)) - math.log(2.0) - 0.5 * (n - 1) * math.log(math.pi)
    log_odds = log_factorial[count] - log_members - log_sizes
    return np.logaddexp.reduce(log_shapes, axis=0) + constant + log_odds


def _log_other_shapes(z: np.ndarray, log_factorial: np.ndarray) -> tuple[float, float, float]:
    """Log evidence of one exponential tail upwards, one downwards, and one uniform shape."""
    n = len(z)
    constant = log_factorial[n - 2] - np.log(n)
    upwards = constant - (n - 1) * np.log((z - z[0]).sum())
    downwards = constant - (n - 1) * np.log((z[-1] - z).sum())
    uniform = -np.log(n * (n - 1.0)) - (n - 1) * np.log(z[-1] - z[0])
    return float(upwards), float(downwards), float(uniform)


def separation_of(z: np.ndarray, sizes: np.ndarray) -> float:
    """Least distance of neighbouring clusters over the pooled spread; NaN where there is none."""
    count = len(sizes)
    if count in (1, len(z)):
        return float("nan")
    variance = float(within_of(z, sizes[None, :])[0]) / (len(z) - count)
    distance = float(np.diff(_sums(z, sizes) / sizes).min())
    return distance / np.sqrt(variance) if variance > 0.0 else float("inf")
