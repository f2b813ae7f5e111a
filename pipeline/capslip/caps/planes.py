"""Heights of peaks over planes of free slopes: the best splits into levels, and their evidence."""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from capslip.caps.clusters import (
    CLEAR_LOG_ODDS,
    WIDTH_RATIOS2,
    separation_of,
    splits_of_rows,
)
from capslip.caps.simplex import Vertex, minimum

LEAST_CAPS = 5  # fewer fix a plane and two levels, and say nothing else
TRIPLETS = 400  # of caps through which planes are laid to start from
STARTS = 5  # of them, the best, that are followed
SAMPLE = 200  # caps that judge them
MAX_TURNS = 20  # of plane and split
FEW_TURNS = 3  # of them for more than two families
EXACT = 1e-13  # sum of squares of heights that range over one: less is rounding
ROUNDING = 1e-12  # of planes through points whose heights range over one
LOG_SHAPES = math.log(4.0)  # of one family, at equal odds
ROUNDED = 8.0  # last digits of a height, of which its distance from a plane is made


def plane_slope(place: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the slopes of the least-squares plane, the smallest where places do not fix them."""
    if len(z) == 0:
        return np.zeros(2)
    slope: np.ndarray = np.linalg.lstsq(place - place.mean(axis=0), z - z.mean(), rcond=1e-9)[0]
    return slope


def centred(z: np.ndarray) -> np.ndarray:
    """Return numbers without their mean."""
    about: np.ndarray = z - z.mean()
    return about


@dataclass(frozen=True, eq=False)
class Scaled:
    """Places and heights of order one, the heights over the least-squares plane."""

    place: np.ndarray  # (n, 2), of mean zero
    z: np.ndarray  # (n,), of mean zero
    slope_m: np.ndarray  # of the plane that was taken off
    unit: float  # slope of 1 here, in metres over metres
    height: float  # in metres, of 1 here

    @classmethod
    def of(cls, place_m: np.ndarray, height_m: np.ndarray) -> "Scaled | None":
        """Return None for fewer than five caps, caps in a line, or all of them in one plane.

        Equal heights, as steps of a coarse sensor make them, are in one but for rounding.
        """
        if len(height_m) < LEAST_CAPS:
            return None
        centred_m = place_m - place_m.mean(axis=0)
        size = np.linalg.svd(centred_m, compute_uv=False)
        if size[1] <= 1e-6 * size[0]:
            return None
        slope_m = plane_slope(place_m, height_m)
        z_m = centred(height_m) - centred_m @ slope_m
        height, length = float(np.ptp(z_m)), float(size[0]) / math.sqrt(len(height_m))
        rounding = ROUNDED * np.finfo(float).eps * float(np.abs(height_m).max())
        if height <= max(1e-12 * float(np.ptp(height_m)), rounding):
            return None
        return cls(centred_m / length, z_m / height, slope_m, height / length, height)

    def in_metres(self, slope: np.ndarray) -> np.ndarray:
        """Return slopes in metres over metres, of the planes on which heights were given."""
        metres: np.ndarray = slope * self.unit + self.slope_m
        return metres

    def starts(self) -> np.ndarray:
        """Return slopes of planes to start from: least squares, and through triplets of caps."""
        n, free = self.place.shape
        if math.comb(n, 3) <= TRIPLETS and free == 2:
            tuples = np.array(list(combinations(range(n), 3)))
        else:
            tuples = np.random.default_rng(0).integers(n, size=(4 * TRIPLETS, free + 1))
        edge = self.place[tuples[:, 1:]] - self.place[tuples[:, :1]]
        area = _determinant(edge)
        # Caps on a lattice make triangles that only rounding tells apart
        wide = np.argsort(-np.abs(area).round(9), kind="stable")[:TRIPLETS]
        wide = wide[np.abs(area[wide]) > 1e-6]
        rise = self.z[tuples[wide, 1:]] - self.z[tuples[wide, :1]]
        slope = np.linalg.solve(edge[wide], rise[..., None])[..., 0]
        return np.concatenate((np.zeros((1, free)), slope))

    def best(self, planes: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return slopes and sizes of the least sum of squares within `count` families."""
        if len(planes) > STARTS + 1:
            every = max(1, len(self.z) // SAMPLE)
            rest = np.sort(self.z[::every] - planes @ self.place[::every].T, axis=1)
            within = np.maximum(_least_within(rest), EXACT)
            planes = planes[np.lexsort((self._steep(planes), within))[:STARTS]]
        n, todo = self.place.shape[0], np.arange(len(planes))
        slope, within = planes.copy(), np.full(len(planes), np.inf)
        split = np.empty((len(planes), count), dtype=np.intp)
        groups = np.full((len(planes), n), count)
        for _ in range(MAX_TURNS if count == 2 else FEW_TURNS):
            rest = self.z - slope[todo] @ self.place.T
            rank = np.argsort(rest, axis=1, kind="stable")
            row = np.arange(todo.size)[:, None]
            split[todo] = _best_splits(rest[row, rank], count)
            group = np.empty(rank.shape, dtype=np.intp)
            ends = np.cumsum(split[todo], axis=1)
            group[row, rank] = (np.arange(n) >= ends[:, :-1, None]).sum(axis=1)
            changed = (group != groups[todo]).any(axis=1)
            todo, group = todo[changed], group[changed]
            if not todo.size:
                break
            groups[todo], last = group, within[todo]
            member = (group[:, None] == np.arange(count)[:, None]).astype(float)
            slope[todo], within[todo] = self._parallel(member, split[todo])
            todo = todo[within[todo] < last * (1.0 - 1e-9)]
            if not todo.size:
                break
        least = max(EXACT, float(within.min()) * (1.0 + 1e-9))
        best = int(np.argmin(np.where(within <= least, self._steep(slope), np.inf)))
        return slope[best], split[best]

    def _steep(self, slope: np.ndarray) -> np.ndarray:
        """Return how far planes turn from the one that heights were given on, to nine digits.

        Of caps in rows of three several splits may be exact; then the least turn counts.
        """
        return np.hypot(*self.in_metres(slope[:, :2]).T).round(9 + int(-math.log10(self.unit)))

    def _parallel(self, member: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return slopes of the parallel planes that fit groups best, and the sums of squares left.

        Of s splits, shapes (s, free) and (s,): members of each of k groups, shape (s, k, n), and
        their sizes.
        """
        columns = np.column_stack((self.place, self.z))
        mean = member @ columns / size[..., None]
        centred = columns - member.transpose(0, 2, 1) @ mean
        place, z = centred[..., :-1], centred[..., -1:]
        normal = place.transpose(0, 2, 1) @ place
        diagonal = np.diagonal(normal, axis1=1, axis2=2)
        fixed = _determinant(normal) > 1e-9 * diagonal.prod(axis=1)
        slopes = np.zeros(diagonal.shape)
        right = place.transpose(0, 2, 1) @ z
        slopes[fixed] = np.linalg.solve(normal[fixed], right[fixed])[..., 0]
        rest = (z - place @ slopes[..., None])[..., 0]
        return slopes, np.square(rest).sum(axis=1)

    def separation(self, slope: np.ndarray, split: np.ndarray) -> float:
        """Return that of families on parallel planes."""
        n, count = len(self.z), len(split)
        separation = separation_of(centred(np.sort(self.z - self.place @ slope)), split)
        # Two degrees of freedom more are lost to the slopes
        lost = math.sqrt((n - count - 2) / (n - count)) if n > count + 2 else 1.0
        return separation * lost

    @cached_property
    def best_two(self) -> tuple[np.ndarray, np.ndarray]:
        """Slopes and sizes of the best two families."""
        return self.best(self.starts(), 2)

    def apart(self) -> float:
        """Return the separation of two families."""
        return self.separation(*self.best_two)

    @cached_property
    def log_factorial(self) -> np.ndarray:
        """Log of 0!, 1!, ... n!."""
        return np.append(0.0, np.cumsum(np.log(np.arange(1.0, len(self.z) + 1.0))))

    def log_evidence_of_two(self, slope: np.ndarray) -> float:
        """Log evidence of two families on planes of one slope, whichever caps are the higher."""
        low = np.arange(1, len(self.z))
        rank = np.argsort(self.z - self.place @ slope, kind="stable")
        each = self.log_evidence(rank, np.column_stack((low, len(self.z) - low)))
        return float(np.logaddexp.reduce(each))

    def log_evidence(self, rank: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Log evidence of normal families, for each split of the caps in the order of `rank`."""
        n, count, log_factorial = len(self.z), sizes.shape[-1], self.log_factorial
        bent = self.place.shape[1] - 2
        columns = np.column_stack((np.ones(n), self.place, self.z))[rank]
        total = np.concatenate((np.zeros((1, columns.shape[1])), np.cumsum(columns, axis=0)))
        ends = np.cumsum(sizes, axis=-1)
        sums = total[ends] - total[ends - sizes]  # (n_splits, K, 4)
        outer = np.einsum("ski,skj->skij", sums, sums)
        square = columns.T @ columns
        ratio, odds = np.array(WIDTH_RATIOS2 if count > 1 else [(0.0, 1.0)]).T[..., None]
        weight = ratio[..., None] / (1.0 + ratio[..., None] * sizes)
        M = square - np.einsum("rsk,skij->rsij", weight, outer)
        log_det = np.linalg.slogdet(M[..., :3, :3])[1]
        rest = M[..., -1, -1] - _explained(M, 3)
        if bent:  # a prior of the weight of one cap
            rest = (rest + n * (M[..., -1, -1] - _explained(M, 3 + bent))) / (1.0 + n)
            log_det += bent * math.log(1.0 + n)
        rest = np.maximum(rest, 1e-13 * square[-1, -1])
        log_widths = np.log1p(ratio[..., None] * sizes).sum(axis=-1) + log_det
        log_shapes = np.log(odds) - 0.5 * log_widths - 0.5 * (n - 3) * np.log(rest)
        log_members = log_factorial[n] - log_factorial[sizes].sum(axis=-1)
        log_sizes = log_factorial[n - 1] - log_factorial[count - 1] - log_factorial[n - count]
        constant = math.lgamma(0.5 * (n - 3)) - math.log(2.0) - 0.5 * (n - 3) * math.log(math.pi)
        log_odds = log_factorial[count] - log_members - log_sizes
        evidence: np.ndarray = np.logaddexp.reduce(log_shapes, axis=0) + constant + log_odds
        return evidence

    @cached_property
    def log_evidence_of_normal(self) -> float:
        """Log evidence of one family of normal heights."""
        n = len(self.z)
        return float(self.log_evidence(np.arange(n), np.array([[n]]))[0])

    @property
    def log_evidence_of_one(self) -> float:
        """Log evidence of one family, of any of four shapes, at equal odds.

        Two of them end at a plane that touches three caps, one lies between two planes that touch
        four: the sharp edges decide, and the evidence is the integral over the cone of planes that
        leave these caps on the right side. With c as the sum of the rows A of the touching caps
        with weights q, that is (n - 4)! rest^-(n - 3) / (|det A| prod n q) for the exponential ones
        and (n - 4)! / n! range^-(n - 3) / (|det A| prod q) for the uniform one.
        """
        n, log_factorial, shapes = len(self.z), self.log_factorial, [self.log_evidence_of_normal]
        places = np.column_stack((np.ones(n), self.place))
        mean = np.array([1.0, 0.0, 0.0])
        corners = np.column_stack((np.ones(3), 10.0 * np.eye(3, 2) * np.abs(places).max()))
        corners[2, 1:] = -corners[0, 1], -corners[1, 2]
        rows = np.concatenate((places, corners))
        for z in (self.z, -self.z):
            height = np.append(z, np.full(3, -1e6))
            edge = minimum(rows, height, mean, np.arange(n, n + 3), ROUNDING)
            rest = float((places @ edge.unknowns - z).sum())
            if rest <= ROUNDING:  # heights range over one: on regular lattices no plane was found
                continue
            shapes.append(
                log_factorial[n - 4] - (n - 3) * math.log(rest) - self._log_cone(rows, edge, n)
            )
        between = np.concatenate((np.insert(places, 3, 0.0, 1), np.insert(-places, 3, 1.0, 1)))
        height = np.append(self.z, -self.z)
        slab = minimum(
            between, height, np.array([0.0, 0.0, 0.0, 1.0]), self._radon(places), ROUNDING
        )
        shapes.append(
            (log_factorial[n - 4] - log_factorial[n])
            - (n - 3) * math.log(slab.unknowns[3])
            - self._log_cone(between, slab, 1)
        )
        return float(np.logaddexp.reduce(shapes) - LOG_SHAPES)

    @property
    def may_be_two(self) -> bool:
        """Whether two families may be far likelier than one: its other shapes but add to that."""
        one = self.log_evidence_of_normal - LOG_SHAPES
        gain = self.log_evidence_of_two(self.best_two[0]) - one - math.log(2.0)
        return gain >= CLEAR_LOG_ODDS

    def _log_cone(self, rows: np.ndarray, vertex: Vertex, n: int) -> float:
        """Log of |det A| prod n q; a cap that all but leaves the cone is stopped by others."""
        least = 0.5 / len(self.z)
        weight = n * np.maximum(vertex.weight, least)
        return float(np.linalg.slogdet(rows[vertex.basis])[1] + np.log(weight).sum())

    def _radon(self, places: np.ndarray) -> np.ndarray:
        """Return four caps, each as the lower or the upper side of a slab, to start from."""
        n = len(places)
        x, y = self.place.T
        four = [int(np.argmax(x)), int(np.argmin(x)), int(np.argmax(y)), int(np.argmin(y))]
        if len(set(four)) < 4 or np.linalg.matrix_rank(places[four]) < 3:
            four = self._apart(places)
        dependency = np.linalg.svd(places[four].T)[2][-1]
        return np.array(four) + np.where(dependency > 0, 0, n)

    def _apart(self, places: np.ndarray) -> list[int]:
        """Return four caps that do not lie on one line, unless all do: a row of them may."""
        distance, four = np.abs(self.place).sum(axis=1), [int(np.argmin(self.place[:, 0]))]
        for _ in range(2):
            base = np.linalg.qr(places[four].T)[0]
            rest = places - (places @ base) @ base.T
            four.append(int(np.argmax(np.square(rest).sum(axis=1))))
        distance[four] = -1.0
        return [*four, int(np.argmax(distance))]


def _determinant(matrix: np.ndarray) -> np.ndarray:
    """Return that of each matrix; of two columns, as most are, without a call for each."""
    if matrix.shape[-1] > 2:
        return np.asarray(np.linalg.det(matrix))
    (a, b), (c, d) = matrix.transpose(1, 2, 0)
    return np.asarray(a * d - b * c)


def _explained(M: np.ndarray, unknowns: int) -> np.ndarray:
    """Return the sum of squares that so many unknowns explain, of moments (..., k, k)."""
    cross = M[..., :unknowns, -1]
    solved = np.linalg.solve(M[..., :unknowns, :unknowns], cross[..., None])[..., 0]
    return np.asarray((cross * solved).sum(axis=-1))


def _best_splits(z: np.ndarray, count: int) -> np.ndarray:
    """Return the sizes of the clusters of each row of sorted numbers, shape (s, count)."""
    if count > 2:
        return splits_of_rows(z - z.mean(axis=1, keepdims=True), count)[-1]
    low = 1 + np.argmax(_between(z), axis=1)
    return np.column_stack((low, z.shape[1] - low))


def _least_within(z: np.ndarray) -> np.ndarray:
    """Least sum of squares of two clusters of each row of sorted numbers."""
    z = z - z.mean(axis=1, keepdims=True)
    least: np.ndarray = (z**2).sum(axis=1) - _between(z).max(axis=1)
    return least


def _between(z: np.ndarray) -> np.ndarray:
    """Return the sums of squares between the two clusters of each split of rows, (s, n - 1)."""
    n = z.shape[1]
    low = np.cumsum(z - z.mean(axis=1, keepdims=True), axis=1)[:, :-1]
    size = np.arange(1.0, n)
    between: np.ndarray = low**2 * (1.0 / size + 1.0 / (n - size))  # both sums cancel
    return between
