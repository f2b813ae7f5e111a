"""Quadric surfaces by least squares, one a hill, all hills at once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from capslip.caps.points import HillPoints

MIN_POINTS = 9  # three more than the unknowns
MAX_INFLATION = 1e8  # of a coefficient's variance by the others: beyond, the points lie on a line
_POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))  # of u and v in z = sum c u^i v^j
# Where the sum of u^i v^j is among those of degree 0 to 4, the powers of v rising within each
_PLACE = np.array([[(i + j + k + m) * (i + j + k + m + 1) // 2 + j + m for k, m in _POWERS]
                   for i, j in _POWERS])  # fmt: skip


@dataclass(frozen=True, eq=False)
class Quadrics:
    """Surfaces z = c0 + c1 u + c2 v + c3 u^2 + c4 u v + c5 v^2 with (u, v) from `origin_m`, scaled.

    Shape (n,) unless said otherwise. What needs a vertex is NaN where there is none: too few
    points, points on a line, or a surface that does not curve downwards in all directions.
    """

    x_m: np.ndarray  # vertex
    y_m: np.ndarray
    z_m: np.ndarray
    points: np.ndarray  # number of points
    chosen: np.ndarray  # bool, shape (k,): which of the points of all hills they are
    spread_m2: np.ndarray  # square root of the determinant of their covariance
    residual_m: np.ndarray  # their standard deviation, six unknowns counted
    solved: np.ndarray  # whether there is a surface, with a vertex or without
    coefficients: np.ndarray  # (6, n), zero where there is none
    covariance: np.ndarray  # (n, 6, 6), for points of unit standard deviation
    origin_m: np.ndarray  # (3, n): x, y, z
    scale_m: np.ndarray

    @property
    def exists(self) -> np.ndarray:
        """Mask of the hills that have a vertex."""
        return np.isfinite(self.z_m)

    @cached_property
    def curvature_per_m(self) -> np.ndarray:
        """Principal curvatures, the smaller and the larger, shape (2, n)."""
        xx, xy, yy = _hessian(self.coefficients)
        mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
        large = np.where(self.exists, mean + half, 1.0)
        curvature = np.stack([(xx * yy - xy**2) / large, large]) / self.scale_m**2
        return np.where(self.exists, curvature, np.nan)

    @property
    def orientation_rad(self) -> np.ndarray:
        """Directions of the smaller curvature, from x towards y, shape (n,)."""
        xx, xy, yy = _hessian(self.coefficients)
        return np.where(self.exists, 0.5 * np.arctan2(-2.0 * xy, yy - xx), np.nan)

    @property
    def curvature_gain(self) -> np.ndarray:
        """Relative standard error of sqrt(k1 k2), see `height_gain`, 1/m, shape (n,)."""
        error = _error(self._slope_of_curvature, self.covariance)
        return np.where(self.exists, error, np.nan)

    def height_and_curvature_gain(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Covariance of a height and the logarithm of sqrt(k1 k2), for points of unit one, 1/m."""
        place, slope = self._powers_at(x_m, y_m), self._slope_of_curvature
        both = np.einsum("in,nij,jn->n", place, self.covariance, slope)
        return np.where(self.exists, both, np.nan)

    def height_m(self, count: np.ndarray, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Height of the surfaces at places that are sorted by hill, `count` of them on each."""

        def each(values: np.ndarray) -> np.ndarray:
            return values.repeat(count)

        c = self.coefficients
        u = (x_m - each(self.origin_m[0])) / each(self.scale_m)
        v = (y_m - each(self.origin_m[1])) / each(self.scale_m)
        height = (each(c[3]) * u + each(c[4]) * v + each(c[1])) * u
        height += (each(c[5]) * v + each(c[2])) * v
        height += each(c[0] + self.origin_m[2])
        return height

    def height_gain(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Return the standard error of the height at one place a hill, for points of unit one."""
        return _error(self._powers_at(x_m, y_m), self.covariance)

    def _powers_at(self, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
        """Return by how much each coefficient counts in the height at a place a hill, (6, n)."""
        u, v = (x_m - self.origin_m[0]) / self.scale_m, (y_m - self.origin_m[1]) / self.scale_m
        return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v])

    @property
    def _slope_of_curvature(self) -> np.ndarray:
        """Derivative of log sqrt(k1 k2) by the coefficients, (6, n); zero without a vertex."""
        xx, xy, yy = np.where(self.exists, _hessian(self.coefficients), 0.0)
        safe = np.where(self.exists, xx * yy - xy**2, 1.0)
        zero = np.zeros_like(safe)
        return np.stack([zero, zero, zero, -yy / safe, xy / safe, -xx / safe])


def fit_quadrics(
    points: HillPoints,
    level_m: np.ndarray,
    origin_m: np.ndarray,
    guide: Quadrics | None = None,
    noise_m: float = 0.0,
) -> Quadrics:
    """Fit a quadric to the measured points of each hill above a level.

    Parameters
    ----------
    points : HillPoints
        Points of all hills.
    level_m : float64, shape (n,)
        Level of each hill.
    origin_m : float64, shape (3, n)
        A point on each hill, from which coordinates count.
    guide : Quadrics, optional
        A first fit. Points then count as above the level where it is, not where they are: noise
        lifts as many points over a level as it pushes below, and those that it lifted alone would
        bias the fit. Hills for which it has no vertex are fitted without.
    noise_m : float
        Standard deviation of the noise about the guide.

    Notes
    -----
    The sums run over sorted points by `np.add.reduceat`. The vertex, the principal curvatures and
    their standard errors follow from the coefficients by first-order propagation.
    """
    n = points.n_hills
    count, scale_m = np.zeros(n, dtype=np.intp), np.empty(n)
    normal, right, square = np.empty((n, 6, 6)), np.empty((n, 6)), np.empty(n)
    chosen = np.zeros(points.z_m.size, dtype=bool)
    for hills, some in points.groups():
        at = _chosen(points, hills, some, level_m, guide, noise_m)
        chosen[at] = True
        of = points.count_of(at)[hills]
        # Coordinates of order one keep the normal equations well conditioned.
        unit_m = np.sqrt(points.pixel_area_m2 * np.maximum(of, 1) / np.pi)
        # One more point, of no weight: reduceat needs an element at every start.
        places = np.zeros((3, at.size + 1))
        for place, place_m, from_m in zip(
            places[:, :-1], (*points.places_m(at), points.z_m[at]), origin_m, strict=True
        ):
            np.subtract(place_m, from_m[hills].repeat(of), out=place)
        places[:2, :-1] /= unit_m.repeat(of)
        count[hills], scale_m[hills] = of, unit_m
        normal[hills], right[hills], square[hills] = _normal_equations(of, *places)
    many = np.maximum(count, 1)
    mean_u, mean_v = normal[:, 0, 1] / many, normal[:, 0, 2] / many
    spread = (normal[:, 0, 3] / many - mean_u**2) * (normal[:, 0, 5] / many - mean_v**2)
    spread -= (normal[:, 0, 4] / many - mean_u * mean_v) ** 2
    solvable, inverse = _inverse(normal, count >= MIN_POINTS)
    c = np.einsum("nij,nj->in", inverse, right)
    misfit = np.maximum(square - np.einsum("in,ni->n", c, right), 0.0)
    vertex_m = _vertex(solvable, c, origin_m, scale_m)
    return Quadrics(
        x_m=vertex_m[0],
        y_m=vertex_m[1],
        z_m=vertex_m[2],
        points=count,
        chosen=chosen,
        spread_m2=np.sqrt(np.maximum(spread, 0.0)) * scale_m**2,
        # The sum of squares cancels down to the rounding of the moments, 1e-8 of the heights.
        residual_m=np.sqrt(misfit / np.maximum(count - 6, 1)),
        solved=solvable,
        coefficients=c,
        covariance=inverse,
        origin_m=origin_m,
        scale_m=scale_m,
    )


def _chosen(
    points: HillPoints,
    hills: slice,
    some: slice,
    level_m: np.ndarray,
    guide: Quadrics | None,
    noise_m: float,
) -> np.ndarray:
    """Return the indices of the measured points above the level, by themselves or by the guide.

    Of some hills and their points.
    """
    reach_m = level_m if guide is None else level_m - 5.0 * noise_m
    high = points.z_m[some] >= np.repeat(reach_m[hills], points.count[hills])
    chosen = some.start + np.flatnonzero(points.measured[some] & high)
    if guide is None:
        return chosen
    count = points.count_of(chosen)
    guide_m = guide.height_m(count, *points.places_m(chosen))
    height_m = np.where(np.repeat(guide.exists, count), guide_m, points.z_m[chosen])
    return chosen[height_m >= np.repeat(level_m, count)]


def _normal_equations(
    count: np.ndarray, u: np.ndarray, v: np.ndarray, w: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return matrices (n, 6, 6), right-hand sides (n, 6) and the sums of the squares of w."""
    sums, start = np.empty((21, len(count))), np.cumsum(count) - count
    uu, uv, vv = u * u, u * v, v * v
    for out, one in zip((*sums[:5], sums[14]), (u, v, uu, uv, vv, w), strict=True):
        np.add.reduceat(one, start, out=out)
    moments = [(uu, u), (uu, v), (u, vv), (vv, v)]
    moments += [(uu, uu), (uu, uv), (uu, vv), (uv, vv), (vv, vv)]
    with_w = [(u, w), (v, w), (uu, w), (uv, w), (vv, w), (w, w)]
    product = np.empty_like(u)  # stays in the cache, which all of them would not
    for out, (one, other) in zip((*sums[5:14], *sums[15:]), moments + with_w, strict=True):
        np.add.reduceat(np.multiply(one, other, out=product), start, out=out)
    sums[:, count == 0] = 0.0  # where reduceat gives the first element of the next hill
    normal = np.concatenate((count[None], sums[:14]))[_PLACE].transpose(2, 0, 1)
    return normal, sums[14:20].T, sums[20]


def _inverse(normal: np.ndarray, enough: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which hills can be solved, and the inverse of their matrices, zero elsewhere."""
    # A trace of ridge keeps the inverse finite; where it matters the hill is dropped below.
    matrix = normal + 1e-14 * normal[:, :1, :1] * np.eye(6)
    solvable, inverse = enough, np.zeros_like(normal)
    try:
        inverse[solvable] = np.linalg.inv(matrix[solvable])
    except np.linalg.LinAlgError:  # points in few rows or columns meet a pivot of exactly zero
        solvable = enough & (np.linalg.slogdet(matrix)[0] != 0.0)
        inverse[solvable] = np.linalg.inv(matrix[solvable])
    inflation = np.einsum("nii,nii->ni", inverse, matrix)
    return solvable & (inflation < MAX_INFLATION).all(axis=1), inverse


def _hessian(c: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the second derivatives downwards, u u, u v and v v."""
    return -2.0 * c[3], -c[4], -2.0 * c[5]


def _vertex(
    enough: np.ndarray, c: np.ndarray, origin_m: np.ndarray, scale_m: np.ndarray
) -> np.ndarray:
    """Return x, y and z of the vertices, NaN where there is none."""
    xx, xy, yy = _hessian(c)
    mean, determinant = 0.5 * (xx + yy), xx * yy - xy**2
    exists = enough & (mean > 0.0) & (determinant > 1e-12 * mean**2)
    determinant = np.where(exists, determinant, np.nan)
    u, v = (yy * c[1] - xy * c[2]) / determinant, (xx * c[2] - xy * c[1]) / determinant
    z_m = origin_m[2] + c[0] + 0.5 * (c[1] * u + c[2] * v)
    return np.stack((origin_m[0] + scale_m * u, origin_m[1] + scale_m * v, z_m))


def _error(vector: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Return the standard error of vector . c for points of unit standard deviation."""
    return np.sqrt(np.maximum(np.einsum("in,nij,jn->n", vector, inverse, vector), 0.0))
