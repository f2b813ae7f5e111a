"""What of a hill lies within the depth of its fit, and the sphere of that volume: closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hill_cases import bowl_m, hills_of

from capslip.caps.apex import find_apexes
from capslip.caps.body import body_of_hills
from capslip.caps.noise import Noise
from capslip.caps.spheres import (
    elliptic_factor,
    lattice_error,
    radius_by_quadric,
    spheres_by_volume,
)

SILENT = Noise(0.0, 1.0, 0.0)
PIXEL_M = (0.5, 2.0)


def body_of(height_m, cut_m, noise=SILENT, depth_m=np.nan, share=0.5, apexes=None):
    """Return the body of one hill, all that is above a cut, and its points."""
    surface, hills, points = hills_of(height_m, height_m >= cut_m, cut_m, PIXEL_M)
    apexes = apexes or find_apexes(surface, hills, points, SILENT)
    return body_of_hills(cut_m, points, apexes, noise, np.array([depth_m]), share), points


def apexes(height_m, least_m=0.0, floor_m=-1.0):
    """Return an apex so far above a cut at -1 over the middle of the map."""
    return SimpleNamespace(
        apex_m=np.array([[40.0], [20.0], [height_m - 1.0]]),
        least_depth_m=np.array([least_m]),
        floor_m=np.array([floor_m]),
    )


@pytest.mark.parametrize(
    ("height_m", "noise_m", "asked_m", "least_m", "depth_m"),
    [
        (1.0, 0.0, np.nan, 0.1, 0.5),  # the share of the fit
        (1.0, 0.0, 0.2, 0.1, 0.2),
        (1.0, 0.0, 0.05, 0.1, 0.1),  # never shallower than the crown
        (1.0, 0.0, 3.0, 0.1, 1.0),  # nor deeper than the cut
        (1.0, 0.0, 0.2, 7.0, 1.0),
        (1.0, 0.02, np.nan, 0.1, 0.5),
        (1.0, 0.03, np.nan, 0.1, 0.6),  # twenty spreads of the noise
        (1.0, 0.1, np.nan, 0.1, 0.7),  # or three of them above the cut
        (1.0, 0.1, 0.2, 0.1, 0.2),
        (1.0, 0.5, np.nan, 0.1, 0.5),
        (0.0, 0.1, np.nan, 0.1, 0.0),  # an apex no higher than the cut
        (-1.0, 0.1, np.nan, 0.1, 0.0),
        (-1.0, 0.1, 0.3, 0.1, 0.0),
    ],
)
def test_the_depth_lies_between_the_crown_and_the_cut(height_m, noise_m, asked_m, least_m, depth_m):
    bowl = bowl_m((80, 40), (20.0, 40.0), 80.0, PIXEL_M)
    given = apexes(height_m, least_m)
    found, _ = body_of(bowl, -1.0, Noise(noise_m, 1.0, noise_m), asked_m, apexes=given)
    assert found.depth_m[0] == pytest.approx(depth_m)


def test_the_body_of_a_paraboloid():
    """R1 = 120 along x, R2 = 60 along y: a volume of pi t^2 sqrt(R1 R2)."""
    y, x = (np.mgrid[:120, :40] + 0.5) * np.array(PIXEL_M)[:, None, None]
    height_m = -((y - 30.3) ** 2) / 120.0 - (x - 40.9) ** 2 / 240.0
    body, points = body_of(height_m, -6.0, depth_m=3.0)
    assert body.depth_m[0] == 3.0
    assert body.volume_m3[0] == pytest.approx(np.pi * 9.0 * np.sqrt(60.0 * 120.0), rel=2e-3)
    assert body.radius_ratio[0] == pytest.approx(2.0)
    assert body.quadric.points[0] == np.count_nonzero(height_m >= -3.0)
    assert not (body.at_edge | body.at_patch | (body.beside_hills > 0) | body.scattered).any()
    radius_m, error, _ = radius_by_quadric(body, np.array([40.9]), np.array([30.3]))
    assert radius_m[0] == pytest.approx(elliptic_factor(2.0) * np.sqrt(60.0 * 120.0))
    assert error[0] == pytest.approx(
        radius_m[0] * body.quadric.curvature_gain[0] * body.scatter_m[0]
    )
    assert points.count[0] > body.quadric.points[0]


@pytest.mark.parametrize(("floor_m", "seen_m"), [(-5.0, -3.0), (-2.0, -2.0)])
def test_the_quadric_sees_no_deeper_than_what_noise_leaves_whole(floor_m, seen_m):
    height_m = bowl_m((120, 40), (30.3, 40.9), 60.0, PIXEL_M)
    given = apexes(1.0, floor_m=floor_m)
    body, _ = body_of(height_m, -6.0, depth_m=3.0, apexes=given)
    assert body.quadric.points[0] == np.count_nonzero(height_m >= seen_m)
    assert body.volume_m3[0] == pytest.approx(np.maximum(height_m + 3.0, 0.0).sum())


@pytest.mark.parametrize(("noise_m", "most"), [(0.0, 2e-3), (1e-3, 5e-3)])
def test_points_lost_at_random_take_nothing_off_a_hill_of_few_points(noise_m, most):
    """Of some 60 points: the mean of the neighbours of a lost one lies below a top between them."""
    rng, ratio = np.random.default_rng(2), []
    for _ in range(40):
        height_m = bowl_m((80, 30), 20.0 + rng.random(2) * np.array([0.5, 2.0]), 60.0, PIXEL_M)
        height_m += noise_m * rng.standard_normal(height_m.shape)
        few = np.where(rng.random(height_m.shape) < 0.2, np.nan, height_m)
        given = Noise(noise_m, 1.0, noise_m)
        whole, lost = (body_of(one, -2.0, given, 0.15)[0] for one in (height_m, few))
        mean_m = [one.volume_m3[0] / (np.pi * one.depth_m[0] ** 2) for one in (whole, lost)]
        ratio.append(mean_m[1] / mean_m[0])
    assert np.mean(ratio) == pytest.approx(1.0, abs=most)


@pytest.mark.parametrize(("share", "more"), [(0.9e-3, 1), (1.1e-3, 0)])
def test_noise_of_a_thousandth_of_the_depth_asks_for_a_guide(share, more):
    """A point above the level that lies below it by the quadric counts without one."""
    height_m = bowl_m((120, 40), (30.25, 41.0), 60.0, PIXEL_M)
    count = np.count_nonzero(height_m >= -3.001)
    height_m.flat[np.argmin(np.abs(height_m + 3.03))] = -3.0
    body, _ = body_of(height_m, -6.0, Noise(3.001 * share, 1.0, 3.001 * share), 3.001)
    assert body.quadric.points[0] == count + more


def test_the_scatter_is_that_of_the_points_or_of_the_noise():
    height_m = bowl_m((120, 40), (30.3, 40.9), 60.0, PIXEL_M)
    body, _ = body_of(height_m, -6.0, Noise(0.01, 3.0, 0.01), 3.0)
    assert body.scatter_m[0] == pytest.approx(0.03)
    rough_m = 0.05 * np.random.default_rng(1).choice([-1.0, 1.0], height_m.shape)
    body, _ = body_of(height_m + rough_m, -6.0, Noise(0.01, 3.0, 0.01), 3.0)
    assert body.scatter_m[0] == pytest.approx(0.15, rel=0.02)


def given(volume_m3, depth_m, edge=False, patch=False, quadric=True, noise_m=0.0, **changed):
    """Return what a fit by volume asks for, of one hill in the middle of a map of 20 by 80."""
    known = {"apex_se_m": 0.0, "scatter_m": 0.0, "edge_of_face": False, "ratio": 1.0, "pixel_m2": 1}
    known |= {"beside_hills": 0.0} | changed
    curvature = np.array([[0.01], [0.01 * known["ratio"]]]) if quadric else np.full((2, 1), np.nan)
    shape = SimpleNamespace(
        exists=np.array([quadric]),
        curvature_per_m=curvature,
        curvature_gain=np.array([0.5]),
        height_and_curvature_gain=lambda x_m, y_m: np.array([0.3]),
        x_m=np.array([known.get("x_m", 40.0)]),
        y_m=np.array([known.get("y_m", 10.0)]),
    )
    body = SimpleNamespace(
        depth_m=np.array([depth_m]),
        volume_m3=np.array([volume_m3]),
        at_edge=np.array([edge]),
        at_patch=np.array([patch]),
        beside_hills=np.array([known["beside_hills"]]),
        quadric=shape,
        scatter_m=np.array([known["scatter_m"]]),
        radius_ratio=curvature[1] / curvature[0],
    )
    apexes = SimpleNamespace(
        apex_m=np.array([[known.get("x_m", 40.0)], [known.get("y_m", 10.0)], [0.0]]),
        apex_se_m=np.array([known["apex_se_m"]]),
        on_surface=np.array([True]),
    )
    return SimpleNamespace(
        body=body,
        apexes=apexes,
        noise=Noise(noise_m, 1.0, noise_m),
        surface=SimpleNamespace(
            pixel_area_m2=known["pixel_m2"],
            pixel_size_m=(known["pixel_m2"] ** 0.5,) * 2,
            side_m=(20.0, 80.0),
            ends_within=False,
        ),
        edge_of_face=known["edge_of_face"],
    )


def sphere(*args, **changed):
    found = spheres_by_volume(given(*args, **changed))
    return found.radius_m[0], found.radius_se_m[0]


def test_a_sphere_has_the_volume_of_its_hill():
    """V = pi t^2 (R - t / 3), and pi R sigma^2 more under noise."""
    t, R = 0.7, 5.0
    volume_m3 = np.pi * t**2 * (R - t / 3.0)
    assert sphere(volume_m3, t)[0] == pytest.approx(R)
    assert sphere(volume_m3, t, noise_m=0.2)[0] == pytest.approx(
        (R - t / 3.0) * t**2 / (t**2 + 0.04) + t / 3.0
    )
    assert sphere(volume_m3, t, ratio=4.0)[0] == pytest.approx(R * elliptic_factor(4.0))
    assert sphere(volume_m3, t, ratio=40.0)[0] == pytest.approx(R * elliptic_factor(40.0))
    assert sphere(volume_m3, t, ratio=400.0)[0] == pytest.approx(R * elliptic_factor(100.0))
    assert sphere(volume_m3, t, ratio=4.0, edge=True, quadric=False)[0] == pytest.approx(R)
    assert np.isnan(sphere(volume_m3, 0.0)[0])


@pytest.mark.parametrize(("pixel_m2", "points"), [(0.01, None), (1e4, 1.0)])
def test_the_error_of_a_radius_is_that_of_apex_and_pixels(pixel_m2, points):
    t, R = 0.7, 5.0
    points = points or 2.0 * np.pi * R * t / pixel_m2
    radius_m, error_m = sphere(
        np.pi * t**2 * (R - t / 3.0), t, apex_se_m=0.3, scatter_m=0.2, pixel_m2=pixel_m2, ratio=4.0
    )
    apex = 2.0 / t * np.sqrt(0.3**2 - 0.2**2 / points)
    pixels = 0.1028 * (points / np.pi) ** -1.25  # 8 / sqrt(pi) (2 pi)^-5/2 sqrt(5.08)
    assert error_m == pytest.approx(radius_m * np.hypot(apex, pixels), rel=1e-3)
    assert radius_m == pytest.approx(R * elliptic_factor(4.0))


@pytest.mark.parametrize("power", [0, 1])
@pytest.mark.parametrize("pixel_m", [(1.0, 1.0), (0.5, 1.5), (2.0, 1.0)])
def test_sums_over_pixels_miss_discs_that_lie_anywhere_by_as_much_as_is_said(power, pixel_m):
    """Discs of many sizes, as the error of one size goes up and down with it."""
    (dy, dx), rng, off = pixel_m, np.random.default_rng(0), []
    y, x = (step * (np.arange(-40, 41)) for step in pixel_m)
    for _ in range(4000):
        rho = rng.uniform(6.0, 10.0)
        r2 = (y[:, None] - dy * rng.uniform()) ** 2 + (x - dx * rng.uniform()) ** 2
        inside = r2[r2 < rho**2] / rho**2
        found = ((1.0 - inside) ** power).sum() * dy * dx / (np.pi * rho**2 / (power + 1))
        said = lattice_error(np.array([np.pi * rho**2 / (dy * dx)]), pixel_m, power)
        off.append((found - 1.0) / said[0])
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=0.08)


@pytest.mark.parametrize("R", [0.3, 5.0])
def test_the_edge_counts_for_spheres_of_any_size(R):
    t = 0.1
    volume_m3 = np.pi * t**2 * (R - t / 3.0)
    radius_m, _ = sphere(volume_m3, t, edge=True, edge_of_face=True, y_m=0.0)
    assert radius_m == pytest.approx(1.2 * R)


@pytest.mark.parametrize(
    ("limit", "depth_m", "cut"),
    [(1, 0.9, (1, 0, 0)), (2, 0.9, (0, 1, 0)), (4, 0.9, (0, 0, 1)), (7, 0.1, (0, 0, 0))],
)
def test_one_point_on_an_edge_or_beside_a_patch_or_a_hill_counts(limit, depth_m, cut):
    """If it lies within the depth; the point is half a unit below the apex."""
    height_m = bowl_m((120, 40), (30.3, 40.9), 60.0, PIXEL_M)
    surface, hills, points = hills_of(height_m, height_m >= -1.0, -1.0, PIXEL_M)
    limits = np.zeros_like(points.limit)
    limits[np.argmin(np.abs(points.z_m + 0.5))] = limit
    points = replace(points, limit=limits)
    apexes = find_apexes(surface, hills, points, SILENT)
    body = body_of_hills(-1.0, points, apexes, SILENT, np.array([depth_m]), 0.5)
    assert (body.at_edge[0], body.at_patch[0], body.beside_hills[0] > 0) == cut


def test_a_cap_that_is_cut_has_the_radius_of_its_quadric():
    """By a patch, or an edge that is not that of the face; without a quadric never."""
    t, R = 0.7, 5.0
    whole = (np.pi * t**2 * (R - t / 3.0), t)
    by_quadric = (100.0, 100.0 * 0.5 * 0.25)
    for cut in ({"patch": True}, {"edge": True}, {"patch": True, "edge_of_face": True}):
        assert sphere(*whole, **cut, scatter_m=0.25) == pytest.approx(by_quadric)
        assert sphere(*whole, **cut, quadric=False)[0] == pytest.approx(R)
    assert sphere(*whole, edge=True, edge_of_face=True)[0] == pytest.approx(R)  # too far away


@pytest.mark.parametrize(
    ("beside_hills", "part"), [(0.0, 0.0), (0.1, 0.0), (0.15, 0.5), (0.2, 1.0), (0.7, 1.0)]
)
def test_the_more_other_hills_cut_a_cap_the_more_its_quadric_counts(beside_hills, part):
    """Which is that of a radius of 100; no more than twice that by volume is taken of it."""
    t = 0.7
    for R, most in ((80.0, 100.0), (5.0, 10.0)):
        volume_m3 = np.pi * t**2 * (R - t / 3.0)
        radius_m, _ = sphere(volume_m3, t, beside_hills=beside_hills)
        assert radius_m == pytest.approx((1.0 - part) * R + part * most)
        assert sphere(volume_m3, t, beside_hills=1.0, quadric=False)[0] == pytest.approx(R)


def test_the_share_beside_hills_is_that_of_a_chord():
    """Two equal paraboloids meet in a chord: of the outline it is sin(u) / pi at a cos(u)."""
    y_m, x_m = np.mgrid[:300, :400] + 0.5
    a, c = 80.0, 50.0
    height_m = 1.0 - (np.minimum(abs(x_m - 150.0), abs(x_m - 150.0 - 2 * c)) ** 2) / a**2
    height_m -= (y_m - 150.0) ** 2 / a**2
    label = np.where(height_m > 0.0, np.where(x_m < 150.0 + c, 1, 2), 0)
    surface, hills, points = hills_of(height_m, label)
    apexes = find_apexes(surface, hills, points, SILENT)
    body = body_of_hills(0.0, points, apexes, SILENT, np.full(2, 0.999), 0.5)
    area_m2 = np.count_nonzero(label == 1)
    expected = 2.0 * np.sqrt(a**2 - c**2) / (2.0 * np.sqrt(np.pi * area_m2))
    assert body.beside_hills == pytest.approx([expected, expected], rel=0.02)


@pytest.mark.parametrize(
    ("place", "factor"),
    [
        ({"y_m": 0.0}, 1.2),
        ({"y_m": 20.0}, 1.2),
        ({"x_m": 0.0}, 1.2),
        ({"x_m": 80.0}, 1.2),
        ({"x_m": 80.0, "y_m": 20.0}, 1.0 + 0.2 * 2**0.5),
        ({"y_m": 10.0}, 1.0),
        # half of sqrt(2 R t) inside, and half of that of the quadric outside
        ({"y_m": 20.0 - 0.5 * 7**0.5}, 1.0 + 0.2 * 0.5**2.2),
        ({"x_m": 0.5 * 7**0.5}, 1.0 + 0.2 * 0.5**2.2),
        ({"y_m": -0.5 * 140**0.5}, 1.0 + 0.2 * (1.0 + 2.8 * 0.5)),
        ({"x_m": 80.0 + 0.5 * 140**0.5}, 1.0 + 0.2 * (1.0 + 2.8 * 0.5)),
    ],
)
def test_a_cap_that_the_edge_of_the_face_cuts_loads_more_than_its_volume(place, factor):
    t, R = 0.7, 5.0
    radius_m, _ = sphere(np.pi * t**2 * (R - t / 3.0), t, edge=True, edge_of_face=True, **place)
    assert radius_m == pytest.approx(R * factor)
