"""How far points lie from their sphere, against known distances."""

from types import SimpleNamespace

import numpy as np
import pytest

from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.caps.profile import quartic_profile, rms_from_sphere_m
from capslip.surface.heightmap import HeightMap

RADIUS_M = np.array([2.0, 5.0])
X_M, Y_M, APEX_M = np.array([0.3, 4.0]), np.array([-0.2, 1.0]), np.array([0.0, 1.0])
DEPTH_M = np.array([0.1, 0.2])


def given(off_m, measured=None):
    """Points of two hills, each off its sphere by so much."""
    n = len(off_m)
    hill = np.repeat([0, 1], n // 2)
    rng = np.random.default_rng(1)
    along, across = rng.uniform(-0.3, 0.3, (2, n))
    square = along**2 + across**2
    sphere_m = APEX_M[hill] - RADIUS_M[hill] + np.sqrt(RADIUS_M[hill] ** 2 - square)
    x_m, y_m = X_M[hill] + along, Y_M[hill] + across
    points = SimpleNamespace(
        hill=hill,
        n_hills=2,
        count=np.bincount(hill),
        groups=lambda: (
            (slice(i, i + 1), slice(*np.searchsorted(hill, (i, i + 1)))) for i in (0, 1)
        ),
        measured=np.ones(n, dtype=bool) if measured is None else measured,
        places_m=lambda some: (x_m[some], y_m[some]),
        z_m=sphere_m + off_m,
    )
    quadric = SimpleNamespace(
        exists=np.array([False, False]),
        curvature_per_m=np.full((2, 2), np.nan),
        orientation_rad=np.zeros(2),
    )
    body = SimpleNamespace(depth_m=DEPTH_M, quadric=quadric)
    spheres = SimpleNamespace(x_m=X_M, y_m=Y_M, apex_m=APEX_M, radius_m=RADIUS_M)
    return SimpleNamespace(points=points, body=body), spheres


def test_the_residual_is_the_rms_distance_of_the_points():
    off_m = np.tile([1e-3, -1e-3, 3e-3, -3e-3], 10)
    assert rms_from_sphere_m(*given(off_m)) == pytest.approx(np.sqrt(5.0) * 1e-3, rel=1e-9)
    of_one = np.where(np.arange(40) < 20, 2e-3, 0.0)
    assert rms_from_sphere_m(*given(of_one)) == pytest.approx([2e-3, 0.0], abs=1e-12)


def test_points_that_stand_in_or_lie_below_the_depth_do_not_count():
    off_m, measured = np.zeros(40), np.ones(40, dtype=bool)
    off_m[0], measured[0] = 0.05, False
    off_m[1], off_m[21] = -0.11, -0.3  # deeper than the fit
    assert rms_from_sphere_m(*given(off_m, measured)) == pytest.approx(0.0, abs=1e-12)
    assert rms_from_sphere_m(*given(off_m)) == pytest.approx([0.05 / np.sqrt(19), 0], abs=1e-12)


def test_a_point_at_the_depth_of_the_fit_counts():
    known, spheres = given(np.zeros(40))
    points, off_m = known.points, 0.125
    known.body.depth_m, spheres.apex_m = np.full(2, off_m), np.zeros(2)
    points.z_m = np.where(np.arange(40) % 20 == 0, -off_m, -1.0)
    x_m, y_m = X_M[points.hill], Y_M[points.hill]
    points.places_m = lambda some: (x_m[some], y_m[some])
    assert rms_from_sphere_m(known, spheres) == pytest.approx(off_m, rel=1e-12)


def test_without_a_quadric_the_profile_is_that_of_the_sphere():
    """Z = R - sqrt(R^2 - r^2) = r^2 / 2R + (r^2 / 2R)^2 / 2R + ...: t goes by the depth."""
    quartic_m, rest_m = quartic_profile(*given(np.zeros(400)))
    assert quartic_m == pytest.approx(DEPTH_M**2 / (2.0 * RADIUS_M), rel=0.1)
    assert (rest_m < 2e-2 * quartic_m).all()


def test_a_known_rest_of_the_profile():
    """Points off by turns, whatever their distance: no polynomial of three terms takes that up."""
    off_m = np.tile([1e-3, -1e-3], 4000)
    _, rest_m = quartic_profile(*given(off_m))
    assert rest_m == pytest.approx(1e-3, rel=0.02)


def test_eight_points_are_too_few_for_a_profile():
    # on hills of radii of 2 and 5 the depths lie at r = 0.63 and 1.4: all points are within
    assert np.isnan(quartic_profile(*given(np.zeros(16)))).all()
    assert np.isfinite(quartic_profile(*given(np.zeros(18)))).all()


def test_the_residual_of_a_face_is_that_of_its_hill():
    """A hill that falls as r^3, against the sphere that was fitted, point by point."""
    x_m = (np.arange(120) + 0.5) * 1e-4
    r_m = np.hypot(x_m - 6.1e-3, x_m[:, None] - 5.8e-3)
    surface = HeightMap(-0.5e-6 * (r_m / 5e-3) ** 3, (1e-4, 1e-4))
    caps = fit_caps(surface, find_hills(surface, 0.5), "pinned")
    from_apex2 = (x_m - caps.x_m) ** 2 + (x_m[:, None] - caps.y_m) ** 2
    sphere_m = caps.peak_height_m - caps.radius_m + np.sqrt(caps.radius_m**2 - from_apex2)
    within = surface.height_m >= caps.peak_height_m - caps.fit_depth_m
    expected_m = np.sqrt(np.mean((surface.height_m - sphere_m)[within] ** 2))
    assert expected_m > 1e-9
    assert caps.residual_m[0] == pytest.approx(expected_m, rel=1e-3)
