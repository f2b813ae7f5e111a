"""Clusters of peak heights that are levels on a common plane, which is found with them.

A family is a set of peaks of one height, but heights count from a plane, and no plane that is
taken off a map beforehand is that of the families: least squares follows everything else on the
face, and a face that was pressed has turned until its moments balanced. So the plane is part of the
model: height = level of the family + slope . place + scatter, with the same slopes for all
families. Adding any plane to the map then moves nothing but the slopes.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from capslip.caps.clusters import (
    CLEAR_LOG_ODDS,
    CLEAR_SEPARATION,
    LEAST_INSIDE,
    LEAST_RANGE,
    MAX_CLUSTERS,
    Clusters,
    one_cluster,
    split_inside,
)
from capslip.caps.planes import Scaled, plane_slope

LEAST_BOWED = 12  # caps: fewer fix a bow and two levels, and say little else
BOW_ODDS = 5.0  # 150 to 1: planes come first


@dataclass(frozen=True, eq=False)
class Levels:
    """The best splits of n peaks into K = 1, 2, ... parallel planes.

    Attributes
    ----------
    clusters : Clusters
        Sizes, log evidence and separation of each K, as of numbers on a line. The sizes of K
        clusters are those of the caps sorted by `heights_m(K)`.
    slope : float64, shape (n_splits, 2)
        Slopes along x and y of the planes of each K.
    bow : float64, shape (3,)
        Terms of x^2, x y and y^2 that the planes bend by, all alike; zero unless the peaks leave no
        doubt about it.
    unit_m : float
        Height that counts as 1 in the evidence; 0 where the peaks lie in one plane, or fix none.
    """

    clusters: Clusters
    slope: np.ndarray
    bow: np.ndarray
    unit_m: float
    _place_m: np.ndarray
    _height_m: np.ndarray

    @property
    def log_evidence(self) -> float:
        """Density of the heights in metres, to compare others at these places; may be infinite."""
        if self.unit_m == 0.0:
            return math.inf
        per_m = (len(self._height_m) - 3) * math.log(self.unit_m)  # a plane is free
        return float(self.clusters.log_evidence.max()) - per_m

    def heights_m(self, count: int) -> np.ndarray:
        """Return the peaks' heights over a plane of `count` families through their middle."""
        rise_m = self._place_m @ self.slope[count - 1] + bow_terms(*self._place_m.T) @ self.bow
        heights_m: np.ndarray = self._height_m - (rise_m - rise_m.mean())
        return heights_m


def find_levels(x_m: np.ndarray, y_m: np.ndarray, height_m: np.ndarray) -> Levels:
    """Split peaks into one to four families on parallel planes.

    Parameters
    ----------
    x_m, y_m, height_m : ndarray, shape (n,)
        Places and heights of the peaks. Fewer than five, or peaks in a line, are one family.

    Returns
    -------
    Levels

    Notes
    -----
    The evidence is that of `cluster` with two unknowns more, in every model: slopes of a flat
    prior, integrated out. Over the caps' places P = [1, x, y], with V = 1 + ratio Z Z^T (Z tells
    the members of each family, ratio is one of `WIDTH_RATIOS2`), a family's normal heights have

        log p = -1/2 log |V| - 1/2 log |P^T V^-1 P| - (n - 3)/2 log rest + const,

    rest the weighted least sum of squares about a plane. As the slopes are in all models alike,
    they favour none. Which caps belong to which family has the prior of `cluster`: any of them, so
    that a plane that gathers caps by chance pays for its choice of them.

    The least sum of squares over planes and splits is sought by turns, the best split over a plane
    and the best plane of a split, from the least-squares plane and from planes through triplets of
    caps. Their choice depends on the places alone, and so nothing on how the map was levelled.

    The planes may all bend alike: three terms more, with the
    prior of unit information, the weight of one cap (Kass and Wasserman 1995), and only at odds of
    150 to 1. A bow of the order of the height between families hides them from any plane.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> x, y = rng.uniform(0.0, 0.06, 23), rng.uniform(0.0, 0.04, 23)
    >>> heights = np.where(np.arange(23) < 5, 2.4e-7, 0.0) + 1e-8 * rng.standard_normal(23)
    >>> levels = find_levels(x, y, heights + 1e-4 * x - 3e-4 * y)
    >>> levels.clusters.sizes[1], levels.slope[1].round(6)
    (array([18,  5]), array([ 0.0001, -0.0003]))
    """
    order = np.lexsort((y_m, x_m))  # the answer shall not depend on the order of the caps
    place_m = np.column_stack((x_m, y_m))
    scaled = Scaled.of(place_m[order], height_m[order])
    if scaled is None:
        slope = plane_slope(place_m, height_m)
        return Levels(one_cluster(len(x_m)), slope[None], np.zeros(3), 0.0, place_m, height_m)
    clusters, slopes = _on_planes(scaled)
    terms = bow_terms(*place_m[order].T)
    bow = _bow(scaled, terms, clusters, slopes)
    bent = Scaled.of(place_m[order], height_m[order] - terms @ bow) if bow.any() else None
    if bent is not None:
        scaled = bent
        clusters, slopes = _on_planes(scaled)
    clusters, slopes = _split_again(scaled, clusters, slopes)
    return Levels(clusters, scaled.in_metres(slopes), bow, scaled.height, place_m, height_m)


def bow_terms(x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Return x^2, x y and y^2, shape (n, 3)."""
    return np.column_stack((x_m**2, x_m * y_m, y_m**2))


def _clear(clusters: Clusters) -> bool:
    """Tell whether planes show two families or more without doubt."""
    evidence, separation = clusters.log_evidence, clusters.separation
    best = int(np.argmax(evidence))
    return best > 0 and bool(
        separation[best] >= CLEAR_SEPARATION and evidence[best] > evidence[0] + CLEAR_LOG_ODDS
    )


def _bow(scaled: Scaled, terms: np.ndarray, clusters: Clusters, slopes: np.ndarray) -> np.ndarray:
    """Return the bow of one family or of two on bent planes, zero unless it is far likelier.

    Where planes show clear families, the bow is sought beside these alone.
    """
    n = len(scaled.z)
    none = np.zeros(3)
    if n < LEAST_BOWED:
        return none
    unit = np.abs(terms - terms.mean(axis=0)).max(axis=0)
    flat = np.column_stack((np.ones(n), scaled.place))
    bent = (terms - terms.mean(axis=0)) / unit
    bent = _beside(bent, flat)
    if not _fixed(bent):
        return none
    curved = replace(scaled, place=np.column_stack((scaled.place, bent)))
    found = []
    for count in (1, 2):
        if count == 1:
            slope = np.linalg.lstsq(curved.place, scaled.z, rcond=None)[0]
            evidence = curved.log_evidence_of_normal
        else:
            clear = np.pad(slopes[1:2], ((0, 0), (0, 3)))
            slope, split = curved.best(clear if _clear(clusters) else curved.starts(), 2)
            # A row of three may be a level, or as much bow as one likes
            rank = np.argsort(scaled.z - curved.place @ slope, kind="stable")
            high = np.argsort(rank) >= split[0]
            if not _fixed(_beside(bent, np.column_stack((flat, high)))):
                continue
            evidence = curved.log_evidence_of_two(slope)
        found.append((evidence, slope[2:] * scaled.height / unit))
    evidence, bow = max(found, key=lambda one: one[0])
    return bow if evidence - clusters.log_evidence.max() >= BOW_ODDS else none


def _beside(bent: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return what is left of columns where the places fix others first."""
    rest: np.ndarray = bent - others @ np.linalg.lstsq(others, bent, rcond=None)[0]
    return rest


def _fixed(bent: np.ndarray) -> bool:
    """Tell whether the places fix a bow by what is left of its columns."""
    return bool(np.linalg.svd(bent, compute_uv=False)[-1] >= 1e-3)


def _on_planes(scaled: Scaled, most: int = MAX_CLUSTERS) -> tuple[Clusters, np.ndarray]:
    """Return the splits into families on parallel planes, `most` of them, and their slopes."""
    n = len(scaled.z)
    slopes, sizes, evidence = [np.zeros(2)], [np.array([n])], [scaled.log_evidence_of_one]
    for count in range(2, min(most, n - 3) + 1):
        planes = np.stack((slopes[-1], np.zeros(2)))
        slope, split = scaled.best_two if count == 2 else scaled.best(planes, count)
        if count == 2:
            evidence.append(scaled.log_evidence_of_two(slope))
        else:
            rank = np.argsort(scaled.z - scaled.place @ slope, kind="stable")
            evidence.append(float(scaled.log_evidence(rank, split[None])[0]))
        slopes.append(slope)
        sizes.append(split)
    separation = [
        scaled.separation(slope, split) for slope, split in zip(slopes, sizes, strict=True)
    ]
    return Clusters(tuple(sizes), np.array(evidence), np.array(separation)), np.array(slopes)


def _split_again(
    scaled: Scaled, clusters: Clusters, slopes: np.ndarray
) -> tuple[Clusters, np.ndarray]:
    """Return the splits and slopes, three families where one of two is two on its own plane.

    A few high peaks that are spread widely take the plane with them, and what lies below them does
    not look like levels on it. Planes on which the families would change places are left out.
    """
    if len(clusters.sizes) < 3:
        return clusters, slopes
    rank = np.argsort(scaled.z - scaled.place @ slopes[1], kind="stable")
    parts = np.split(rank, clusters.sizes[1][:1])
    inside, planes = [], []
    least = min(float(clusters.separation[2]), CLEAR_SEPARATION)
    for own, other in (parts, parts[::-1]):
        split, plane = one_cluster(len(own)), np.zeros(2)
        alone = None
        if len(own) >= LEAST_INSIDE and not clusters.separation[1] < least:
            alone = Scaled.of(scaled.place[own], scaled.z[own])
        wide = alone is not None and alone.height >= LEAST_RANGE and not alone.apart() < least
        if alone is not None and wide and alone.may_be_two:
            found, own_slopes = _on_planes(alone, most=2)
            plane = alone.in_metres(own_slopes)[min(1, len(own_slopes) - 1)]
            above = (scaled.z - scaled.place @ plane) * (1.0 if own is parts[1] else -1.0)
            split = found if above[own].min() > above[other].max() else split
        inside.append(split)
        planes.append(plane)
    clusters, split_part = split_inside(clusters, inside)
    if split_part is not None:
        slopes = np.concatenate((slopes[:2], planes[split_part][None], slopes[3:]))
    return clusters, slopes
