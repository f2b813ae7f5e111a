"""Quadrics against least squares by the library, one hill at a time."""

import numpy as np
import pytest
from hill_cases import hills_of

from capslip.caps.quadric import fit_quadrics

PIXEL_M = (0.7, 1.3)
# Of each: height, slopes along x and y, second derivatives xx, xy, yy
CAPS = [(5.0, 0.02, -0.01, -0.03, 0.01, -0.05), (7.0, -0.01, 0.03, -0.06, -0.02, -0.02)]


def scene():
    """Two hills with noise, the second and the third label; nothing carries the first."""
    rng = np.random.default_rng(5)
    y, x = (np.mgrid[:20, :40] + 0.5) * np.array(PIXEL_M)[:, None, None]
    label = np.zeros((20, 40), dtype=int)
    label[3:15, 2:17], label[5:18, 22:37] = 2, 3
    height_m = 0.02 * rng.standard_normal(label.shape)
    for number, (c, a, b, xx, xy, yy), x0 in zip((2, 3), CAPS, (12.0, 38.0), strict=True):
        u, v = x - x0, y - 7.0
        sphere = c + a * u + b * v + 0.5 * xx * u**2 + xy * u * v + 0.5 * yy * v**2
        height_m += np.where(label == number, sphere, 0.0)
    height_m[8, 9], label[8, 9] = np.nan, 0  # stands in, but is not fitted to
    return hills_of(height_m, label, pixel_m=PIXEL_M)


ORIGIN_M = np.array([[0.0, 11.0, 39.0], [0.0, 6.0, 8.0], [0.0, 4.0, 8.0]])


def by_library(points, hill, level_m):
    """Coefficients of 1, u, v, u^2, uv, v^2 from the origin, covariance, residual and places."""
    here = (points.hill == hill) & points.measured & (points.z_m >= level_m)
    u, v, w = (
        place[here] - ORIGIN_M[i, hill]
        for i, place in enumerate((*points.places_m(slice(None)), points.z_m))
    )
    basis = np.stack([np.ones_like(u), u, v, u**2, u * v, v**2], axis=1)
    c, (square,), *_ = np.linalg.lstsq(basis, w, rcond=None)
    return c, np.linalg.inv(basis.T @ basis), np.sqrt(square / (len(u) - 6)), (u, v)


def geometric_curvature(c):
    return np.sqrt(4.0 * c[3] * c[5] - c[4] ** 2)


@pytest.mark.parametrize("hill", [1, 2])
@pytest.mark.parametrize("level_m", [-np.inf, 4.0])
def test_a_quadric_is_that_of_least_squares(hill, level_m):
    points = scene()[2]
    found = fit_quadrics(points, np.full(3, level_m), ORIGIN_M)
    c, covariance, residual_m, (u, v) = by_library(points, hill, level_m)
    if np.isinf(level_m):
        assert len(u) == points.count[hill] - (hill == 1)
    assert found.points[hill] == len(u)
    assert found.residual_m[hill] == pytest.approx(residual_m, rel=1e-6)
    hessian = np.array([[2 * c[3], c[4]], [c[4], 2 * c[5]]])
    vertex = np.linalg.solve(hessian, -c[1:3])
    vertex_m = [found.x_m[hill], found.y_m[hill], found.z_m[hill]] - ORIGIN_M[:, hill]
    assert vertex_m == pytest.approx([*vertex, c[0] + 0.5 * c[1:3] @ vertex], rel=1e-8)
    values, directions = np.linalg.eigh(-hessian)
    assert found.curvature_per_m[:, hill] == pytest.approx(values, rel=1e-8)
    angle = np.arctan2(directions[1, 0], directions[0, 0])
    assert np.sin(found.orientation_rad[hill] - angle) == pytest.approx(0.0, abs=1e-8)
    assert found.spread_m2[hill] == pytest.approx(np.sqrt(np.linalg.det(np.cov(u, v, ddof=0))))
    assert found.solved[hill]
    assert found.exists[hill]

    # errors, for points of unit standard deviation
    step = 1e-6 * np.eye(6) * np.abs(c)
    slope = [(geometric_curvature(c + s) - geometric_curvature(c - s)) / 2e-6 for s in step]
    slope /= np.abs(c) * geometric_curvature(c)
    gain = np.sqrt(slope @ covariance @ slope)
    assert found.curvature_gain[hill] == pytest.approx(gain, rel=1e-6)
    places = np.array([[0.0, 0.0, 0.0], [0.0, 14.0, 41.0], [0.0, 3.0, 9.5]])  # x and y of each
    p, q = places[1:, hill] - ORIGIN_M[:2, hill]
    basis = np.array([1.0, p, q, p * p, p * q, q * q])
    at = places[1:, :]
    assert found.height_gain(*at)[hill] == pytest.approx(
        np.sqrt(basis @ covariance @ basis), rel=1e-8
    )
    height_m = found.height_m(np.eye(3, dtype=int)[hill], at[0, [hill]], at[1, [hill]])
    assert height_m == pytest.approx(ORIGIN_M[2, hill] + basis @ c, rel=1e-9)


def test_a_hill_without_points_has_no_quadric():
    found = fit_quadrics(scene()[2], np.full(3, -np.inf), ORIGIN_M)
    assert found.points[0] == 0
    assert found.exists.tolist() == found.solved.tolist() == [False, True, True]
    assert found.spread_m2[0] == found.residual_m[0] == 0.0
    assert np.isnan([found.x_m[0], *found.curvature_per_m[:, 0], found.curvature_gain[0]]).all()
    assert np.isfinite(found.height_m(np.array([1, 0, 0]), np.zeros(1), np.zeros(1)))


@pytest.mark.parametrize(("count", "solved"), [(8, False), (9, True)])
def test_nine_points_make_a_quadric(count, solved):
    label = np.zeros((5, 5))
    label.flat[[0, 2, 4, 6, 12, 18, 20, 22, 24][:count]] = 1
    y, x = np.mgrid[:5, :5]
    _, _, points = hills_of(-((x - 2.0) ** 2) - (y - 2.0) ** 2, label)
    found = fit_quadrics(points, np.full(1, -np.inf), np.zeros((3, 1)))
    assert found.solved.tolist() == found.exists.tolist() == [solved]


@pytest.mark.parametrize(("xx", "xy", "yy"), [(-1, 2, -1), (1, 0, -1), (1, 0, 1), (-1, 1, -1)])
def test_what_does_not_curve_downwards_everywhere_has_no_vertex(xx, xy, yy):
    y, x = np.mgrid[:9, :9] - 4.0
    _, _, points = hills_of(0.5 * xx * x**2 + xy * x * y + 0.5 * yy * y**2, np.ones((9, 9)))
    found = fit_quadrics(points, np.full(1, -np.inf), np.zeros((3, 1)))
    assert found.solved.all()
    assert not found.exists.any()
    assert np.isnan([found.z_m, found.orientation_rad]).all()


@pytest.mark.parametrize(("noise_m", "count"), [(0.029, 20), (0.031, 21)])
def test_points_count_by_the_guide_from_five_spreads_below(noise_m, count):
    """Of 21 points above a level one is 0.15 below it now, and another from far below above it."""
    y, x = np.mgrid[:9, :9] - 4.0
    height_m = -0.1 * (x**2 + y**2)
    level_m, origin_m = np.full(1, -0.55), np.zeros((3, 1))
    guide = fit_quadrics(hills_of(height_m, np.ones((9, 9)))[2], level_m, origin_m)
    height_m = height_m.copy()
    height_m[2, 3] -= 0.2
    height_m[4, 8] += 1.5
    points = hills_of(height_m, np.ones((9, 9)))[2]
    assert guide.points[0] == fit_quadrics(points, level_m, origin_m).points[0] == 21
    assert fit_quadrics(points, level_m, origin_m, guide, noise_m).points[0] == count


def test_where_the_guide_has_no_vertex_points_count_by_themselves():
    y, x = np.mgrid[:9, :9] - 4.0
    level_m, origin_m = np.full(1, -0.55), np.zeros((3, 1))
    saddle = fit_quadrics(hills_of(x * y, np.ones((9, 9)))[2], np.full(1, -99.0), origin_m)
    assert saddle.solved.all()
    points = hills_of(-0.1 * (x**2 + y**2), np.ones((9, 9)))[2]
    assert fit_quadrics(points, level_m, origin_m, saddle, 1.0).points[0] == 21
