"""Caps: standard errors of apex and radius from pixels and noise, and depths for the noise."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.caps.noise import noise_on_hills
from capslip.caps.points import points_of_hills
from capslip.surface.heightmap import HeightMap
from scenes import caps_map, sphere_height_m

RADIUS_M, PIXEL_M = 25.0, 1e-4


def one_cap(rng, across, noise=0.0, radius_m=RADIUS_M, pixel_m=PIXEL_M):
    """Make a cap `across` pixels in radius at a random place, cut at its height.

    Noise is a share of its height. Points above the cut are those of the sphere without noise.
    """
    side = 2 * across + 9
    y, x = (np.mgrid[:side, :side] + 0.5) * pixel_m
    centre = (side / 2 + rng.uniform(-0.5, 0.5, 2)) * pixel_m
    height_m = sphere_height_m(x, y, centre, radius_m, 0.0)
    a_m = across * pixel_m
    cap_m = a_m**2 / (radius_m + np.sqrt(radius_m**2 - a_m**2))
    hills = replace(
        find_hills(caps_map([(6e-3, 5e-3, 24.0, 0.0)])),
        label=(height_m > -cap_m).astype(np.int32),
        cut_height_m=-cap_m,
        noise_m=0.0,
    )
    height_m = height_m + noise * cap_m * rng.standard_normal(height_m.shape)
    return HeightMap(height_m, (pixel_m, pixel_m)), hills, cap_m


def found(fit, across, n, **options):
    """Relative errors of R, their standard errors, the same of the apex, correlation: (5, n)."""
    rows = []
    for seed in range(n):
        surface, hills, _ = one_cap(np.random.default_rng(seed), across, **options)
        caps = fit_caps(surface, hills, fit)
        rows.append(
            (
                caps.radius_m[0] / RADIUS_M - 1,
                caps.radius_se_m[0] / RADIUS_M,
                caps.peak_height_m[0],
                caps.peak_height_se_m[0],
                caps.peak_radius_correlation[0],
            )
        )
    return np.array(rows).T


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("across", [6, 20, 60])
def test_without_noise_the_error_is_that_of_the_pixels(across):
    # Lattice points in a circle: the relative error falls as its radius to the power -1.5
    radius, radius_se, apex_m, apex_se_m, _ = found("equation18", across, 40)
    assert 0.8 < rms(radius) / rms(radius_se) < 1.5
    assert 0.4 < rms(apex_m) / rms(apex_se_m) < 1.0
    # Sums over a paraboloid: to the power -2.5, and up and down with the radius
    radius, radius_se, apex_m, _, _ = found("pinned", across, 40)
    assert 0.4 < rms(radius) / rms(radius_se) < 1.6
    assert rms(apex_m) < 1e-15


def test_noise_lifts_the_highest_point_by_no_more_than_its_error():
    radius, radius_se, apex_m, apex_se_m, correlation = found("equation18", 25, 40, noise=0.03)
    assert (apex_m > 0.0).all()
    assert 0.35 < rms(apex_m) / rms(apex_se_m) < 1.0
    assert 0.35 < rms(radius) / rms(radius_se) < 1.0
    # df alone makes it, but for what the pixels do to D
    assert (correlation < -0.99).all()


@pytest.mark.long
@pytest.mark.parametrize("fit", ["pinned", "least_squares"])
def test_noise_that_lifts_an_apex_makes_it_sharper(fit):
    """A quadric through all of a disc: apex and fall err by -sqrt(3) / 2 together."""
    radius, _, apex_m, _, correlation = found(fit, 25, 200, noise=0.08)
    together = np.corrcoef(apex_m, np.log1p(radius))[0, 1]
    assert correlation == pytest.approx(np.full(200, -np.sqrt(0.75)), abs=0.06)
    # A coefficient from 200 pairs errs by (1 - r^2) / sqrt(200), three times that is asked for
    assert together == pytest.approx(correlation.mean(), abs=3.0 * 0.25 / np.sqrt(200))


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_another_hill_within_the_depth_takes_nothing_from_a_radius(noise):
    """Two spheres side by side: beyond the valley between them the volume of one ends."""
    apart_m, depth_m = 2.6e-3, 1e-7  # the valley lies at a third of the depth
    caps = [(5e-3, 5e-3, RADIUS_M, 0.0), (5e-3 + apart_m, 5e-3, RADIUS_M, 0.0)]
    surface = caps_map(caps, shape=(100, 130))
    noisy = np.random.default_rng(1).normal(0.0, noise * depth_m, surface.shape)
    surface = HeightMap(surface.height_m + noisy, surface.pixel_size_m)
    hills = find_hills(surface, 0.3, pruning_height_m=0.5 * apart_m**2 / 8.0 / RADIUS_M)
    assert hills.n_hills == 2
    found = fit_caps(surface, hills, "pinned", np.full(2, depth_m))
    assert found.fit_depth_m == pytest.approx(np.full(2, depth_m))
    off = found.radius_m / RADIUS_M - 1.0
    assert np.abs(off).max() < 1e-3 + 3.0 * found.radius_se_m.max() / RADIUS_M
    assert (found.radius_se_m < 0.03 * RADIUS_M).all()


def test_a_deep_cap_is_a_sphere_and_no_paraboloid():
    """V = pi t^2 (R - t/3): at t = R/5 the last term is 7 % of R."""
    height_m = one_cap(np.random.default_rng(0), 150, radius_m=2e-3, pixel_m=1e-5)
    caps = fit_caps(*height_m[:2], "pinned", np.array([4e-4]))
    assert caps.fit_depth_m[0] == pytest.approx(4e-4)
    assert caps.radius_m[0] == pytest.approx(2e-3, rel=0.01)


def test_a_depth_has_the_points_and_the_noise_that_an_apex_needs():
    surface, hills, cap_m = one_cap(np.random.default_rng(2), 30)
    shallow = fit_caps(surface, hills, "pinned", np.full(1, 1e-6 * cap_m))
    count = np.count_nonzero(hills.label)
    assert shallow.fit_depth_m[0] == pytest.approx(25.0 / count * cap_m, rel=0.01)
    surface, hills, cap_m = one_cap(np.random.default_rng(2), 30, noise=0.02)
    rms_m = noise_on_hills(surface, points_of_hills(surface, hills)).rms_m
    shallow = fit_caps(surface, hills, "pinned", np.full(1, 1e-6 * cap_m))
    assert shallow.fit_depth_m[0] == pytest.approx(10.0 * rms_m, rel=1e-9)


def test_where_no_vertex_is_on_the_hill_the_error_is_that_of_its_highest_point():
    surface, hills, _ = one_cap(np.random.default_rng(3), 30)
    ny, nx = surface.shape
    y, x = np.mgrid[:ny, :nx]
    ring = np.where(np.hypot(y - ny / 2, x - nx / 2) < 12, 0, hills.label)
    caps = fit_caps(surface, replace(hills, label=ring), "pinned")
    top_m = surface.height_m[ring > 0].max()
    assert caps.peak_height_m[0] == top_m
    fall_m = (top_m - hills.cut_height_m) / np.count_nonzero(ring)
    assert caps.peak_height_se_m[0] == pytest.approx(fall_m, rel=1e-6)
