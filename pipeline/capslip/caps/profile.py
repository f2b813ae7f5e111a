"""How far the points of a hill lie from its sphere, and from a profile of fourth degree."""

import numpy as np

from capslip.caps.fitting import FitInput, Spheres
from capslip.caps.quadric import MIN_POINTS


def rms_from_sphere_m(given: FitInput, spheres: Spheres) -> np.ndarray:
    """Return the rms distance of the measured points within the depth from the sphere."""
    points, apex_m, radius_m = given.points, spheres.apex_m, spheres.radius_m
    level_m, rms_m = apex_m - given.body.depth_m, np.empty(points.n_hills)
    for hills, some in points.groups():
        high = points.z_m[some] >= np.repeat(level_m[hills], points.count[hills])
        chosen = some.start + np.flatnonzero(points.measured[some] & high)
        hill = points.hill[chosen].astype(np.intp)
        x_m, y_m = points.places_m(chosen)
        along_x_m, along_y_m = x_m - spheres.x_m[hill], y_m - spheres.y_m[hill]
        square_m2 = along_x_m**2 + along_y_m**2
        under_m = np.sqrt(np.maximum(radius_m[hill] ** 2 - square_m2, 0.0))
        sphere_m = apex_m[hill] - square_m2 / (radius_m[hill] + under_m)
        own, n = hill - hills.start, hills.stop - hills.start
        sums = np.bincount(own, (points.z_m[chosen] - sphere_m) ** 2, n)
        rms_m[hills] = np.sqrt(sums / np.maximum(np.bincount(own, minlength=n), 1))
    return rms_m


def quartic_profile(given: FitInput, spheres: Spheres) -> tuple[np.ndarray, np.ndarray]:
    """Return the quartic term of each hill's profile, and the rms distance of its points from it.

    The profile is a least-squares c0 + c1 t + c2 t^2 in the elliptic coordinate t, the square of
    the distance from the apex by the curvatures of the quadric, one at the fitted depth. So an
    ellipsoid has neither term nor residual. NaN where there are too few points.
    """
    points, quadric = given.points, given.body.quadric
    curvature_per_m = np.where(quadric.exists, quadric.curvature_per_m, 1.0 / spheres.radius_m)
    axis = np.stack((np.cos(quadric.orientation_rad), np.sin(quadric.orientation_rad)))
    axis = np.where(quadric.exists, axis, 0.5**0.5)
    with np.errstate(divide="ignore", invalid="ignore"):  # a hill of no depth
        scale = np.sqrt(0.5 * curvature_per_m / given.body.depth_m)
    quartic_m, residual_m = np.empty((2, points.n_hills))
    with np.errstate(divide="ignore"):
        reach_m = 1.0 / scale.min(axis=0)
    for hills, some in points.groups():
        # Most points lie farther off than any of an ellipse
        x_m, y_m = points.places_m(some)
        off_m = x_m - np.repeat(spheres.x_m[hills], points.count[hills])
        near = np.flatnonzero(np.abs(off_m) <= np.repeat(reach_m[hills], points.count[hills]))
        hill = points.hill[some][near].astype(np.intp) - hills.start
        along, across = off_m[near], y_m[near] - spheres.y_m[hills][hill]
        cos, sin = axis[:, hills]
        along, across = (
            cos[hill] * along + sin[hill] * across,
            cos[hill] * across - sin[hill] * along,
        )
        with np.errstate(invalid="ignore"):
            t = (scale[0, hills][hill] * along) ** 2 + (scale[1, hills][hill] * across) ** 2
        chosen = np.flatnonzero(points.measured[some][near] & (t <= 1.0))
        hill, t = hill[chosen], t[chosen]
        fall_m = spheres.apex_m[hills][hill] - points.z_m[some][near[chosen]]
        quartic_m[hills], residual_m[hills] = _through_falls(
            np.bincount(hill, minlength=hills.stop - hills.start), t, fall_m
        )
    return quartic_m, residual_m


def _through_falls(
    count: np.ndarray, t: np.ndarray, fall_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the quartic terms of profiles, and the rms distances of their points."""
    start, empty = np.cumsum(count) - count, count == 0

    def total(values: np.ndarray) -> np.ndarray:
        sums: np.ndarray = np.add.reduceat(values, start)
        sums[empty] = 0.0  # where reduceat gives the first element of the next hill
        return sums

    # One more point, of no weight: reduceat needs an element at every start
    columns = 2.0 * t - 1.0, 6.0 * t * (t - 1.0) + 1.0, fall_m
    first, second, fall_m = (np.append(one, 0.0) for one in columns)
    normal = np.empty((len(count), 3, 3))
    normal[:, 0, 0] = count
    normal[:, 0, 1] = normal[:, 1, 0] = total(first)
    normal[:, 0, 2] = normal[:, 2, 0] = total(second)
    normal[:, 1, 1], normal[:, 2, 2] = total(first**2), total(second**2)
    normal[:, 1, 2] = normal[:, 2, 1] = total(first * second)
    right = np.stack([total(fall_m), total(first * fall_m), total(second * fall_m)], axis=1)
    known = (count >= MIN_POINTS) & (np.linalg.matrix_rank(normal) == 3)
    c = np.full((3, len(count)), np.nan)
    c[:, known] = np.linalg.solve(normal[known], right[known][..., None])[..., 0].T
    constant, linear, square = (np.append(np.repeat(of_hill, count), 0.0) for of_hill in c)
    square_m2 = total((fall_m - (constant + linear * first + square * second)) ** 2)
    return 6.0 * c[2], np.sqrt(square_m2 / np.maximum(count, 1))
