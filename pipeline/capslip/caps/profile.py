"""How far the points of a hill lie from its sphere, and from a profile of fourth degree."""

import numpy as np

from capslip.caps.fitting import FitInput, Spheres
from capslip.caps.quadric import MIN_POINTS


def rms_from_sphere_m(given: FitInput, spheres: Spheres) -> np.ndarray:
    """Return the rms distance of the measured points within the depth from the sphere."""
    points, apex_m, radius_m = given.points, spheres.apex_m, spheres.radius_m
    level_m = apex_m - given.body.depth_m
    chosen = np.flatnonzero(points.measured & (points.z_m >= np.repeat(level_m, points.count)))
    hill = points.hill[chosen]
    along_x_m, along_y_m = (
        points.x_m[chosen] - spheres.x_m[hill],
        points.y_m[chosen] - spheres.y_m[hill],
    )
    square_m2 = along_x_m**2 + along_y_m**2
    under_m = np.sqrt(np.maximum(radius_m[hill] ** 2 - square_m2, 0.0))
    sphere_m = apex_m[hill] - square_m2 / (radius_m[hill] + under_m)
    sums = np.bincount(hill, (points.z_m[chosen] - sphere_m) ** 2, points.n_hills)
    count = np.bincount(hill, minlength=points.n_hills)
    return np.sqrt(sums / np.maximum(count, 1))


def quartic_profile(given: FitInput, spheres: Spheres) -> tuple[np.ndarray, np.ndarray]:
    """Return the quartic term of each hill's profile, and the rms distance of its points from it.

    The profile is a least-squares c0 + c1 t + c2 t^2 in the elliptic coordinate t, the square of
    the distance from the apex by the curvatures of the quadric, one at the fitted depth. So an
    ellipsoid has neither term nor residual. NaN where there are too few points.
    """
    points, quadric = given.points, given.body.quadric
    curvature_per_m = np.where(quadric.exists, quadric.curvature_per_m, 1.0 / spheres.radius_m)
    cos, sin = np.cos(quadric.orientation_rad), np.sin(quadric.orientation_rad)
    cos, sin = np.where(quadric.exists, (cos, sin), 0.5**0.5)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.sqrt(0.5 * curvature_per_m / given.body.depth_m)
        reach_m = (1.0 + 1e-9) / scale.min(axis=0)
    x_m, y_m = (
        place_m - np.repeat(apex_m, points.count)
        for place_m, apex_m in ((points.x_m, spheres.x_m), (points.y_m, spheres.y_m))
    )
    near = x_m**2 + y_m**2 <= np.repeat(reach_m**2, points.count)
    chosen = np.flatnonzero(points.measured & near)
    hill, x_m, y_m = points.hill[chosen], x_m[chosen], y_m[chosen]
    along, across = cos[hill] * x_m + sin[hill] * y_m, cos[hill] * y_m - sin[hill] * x_m
    with np.errstate(invalid="ignore"):  # a hill of no depth
        t = (scale[0][hill] * along) ** 2 + (scale[1][hill] * across) ** 2
    within = np.flatnonzero(t <= 1.0)
    chosen, hill, t = chosen[within], hill[within], t[within]
    fall_m = spheres.apex_m[hill] - points.z_m[chosen]
    count = np.bincount(hill, minlength=points.n_hills)
    start, empty = np.cumsum(count) - count, count == 0

    def total(values: np.ndarray) -> np.ndarray:
        sums: np.ndarray = np.add.reduceat(np.append(values, 0.0), start)
        sums[empty] = 0.0  # where reduceat gives the first element of the next hill
        return sums

    basis = np.stack([np.ones_like(t), 2.0 * t - 1.0, 6.0 * t * (t - 1.0) + 1.0])
    _, first, second = basis
    normal = np.empty((points.n_hills, 3, 3))
    normal[:, 0, 0] = count
    normal[:, 0, 1] = normal[:, 1, 0] = total(first)
    normal[:, 0, 2] = normal[:, 2, 0] = total(second)
    normal[:, 1, 1], normal[:, 2, 2] = total(first**2), total(second**2)
    normal[:, 1, 2] = normal[:, 2, 1] = total(first * second)
    right = np.stack([total(fall_m), total(first * fall_m), total(second * fall_m)], axis=1)
    known = (count >= MIN_POINTS) & (np.linalg.matrix_rank(normal) == len(basis))
    c = np.full((3, points.n_hills), np.nan)
    c[:, known] = np.linalg.solve(normal[known], right[known][..., None])[..., 0].T
    square_m2 = total((fall_m - (c[:, hill] * basis).sum(axis=0)) ** 2)
    return 6.0 * c[2], np.sqrt(square_m2 / np.maximum(count, 1))
