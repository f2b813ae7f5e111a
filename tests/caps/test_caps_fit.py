"""Caps: Eq. 18 on exact spheres, and what must not change them."""

import numpy as np
import pytest

from capslip import registry
from capslip.caps.fit import fit_caps
from capslip.caps.fits.equation18 import equation18_radius_m
from capslip.caps.hills import find_hills
from capslip.caps.table import CapFlag
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

FITS = registry.names("caps.fits")
CAPS = [(6e-3, 5e-3, 24.0, 0.0), (14e-3, 12e-3, 27.0, -1e-7), (24e-3, 8e-3, 25.0, -5e-8)]


def fitted(surface, fit="pinned", ratio=0.1):
    return fit_caps(surface, find_hills(surface, ratio), fit)


def by_x(table):
    order = np.argsort(table.x_m)
    return table.x_m[order], table.y_m[order], table.radius_m[order], table.peak_height_m[order]


def test_equation_18_is_exact_on_a_sphere():
    radius_m, cap_height_m = 26.7, np.geomspace(1e-12, 1e-2, 11)
    # D^2/4 = 2 R df - df^2
    diameter_m = 2 * np.sqrt(cap_height_m * (2 * radius_m - cap_height_m))
    assert equation18_radius_m(diameter_m, cap_height_m) == pytest.approx(radius_m, rel=1e-12)


def test_equation_18_gives_the_table_of_the_paper():
    assert equation18_radius_m(16e-3, 1.2e-6) == pytest.approx(26.67, abs=0.01)
    # the printed 17 mm does not give the printed 23.8 m, 18 mm does
    assert equation18_radius_m(17e-3, 1.7e-6) == pytest.approx(21.25, abs=0.01)
    assert equation18_radius_m(18e-3, 1.7e-6) == pytest.approx(23.82, abs=0.01)


@pytest.mark.parametrize("fit", FITS)
def test_three_spheres_are_found_where_they_are(fit):
    x, y, radius_m, peak_m = by_x(fitted(caps_map(CAPS), fit))
    assert len(x) == 3
    for i, (x0, y0, radius, peak) in enumerate(CAPS):
        assert x[i] == pytest.approx(x0, abs=1.5e-4)
        assert y[i] == pytest.approx(y0, abs=1.5e-4)
        assert radius_m[i] == pytest.approx(radius, rel=0.02)
        assert peak_m[i] == pytest.approx(peak, abs=2e-9)


@pytest.mark.parametrize("fit", FITS)
def test_rotation_by_90_degrees_turns_the_caps(fit):
    surface = caps_map(CAPS, pixel_size_m=(1e-4, 1.3e-4))
    turned = HeightMap(np.rot90(surface.height_m), surface.pixel_size_m[::-1])
    here, there = fitted(surface, fit), fitted(turned, fit)
    width_m = surface.shape[1] * surface.pixel_size_m[1]
    a = np.lexsort((here.y_m, here.x_m))
    b = np.lexsort((there.x_m, -there.y_m))
    assert there.x_m[b] == pytest.approx(here.y_m[a], rel=1e-9)
    assert width_m - there.y_m[b] == pytest.approx(here.x_m[a], rel=1e-9)
    assert there.radius_m[b] == pytest.approx(here.radius_m[a], rel=1e-9)


@pytest.mark.parametrize("fit", FITS)
def test_lengths_scale(fit):
    surface = caps_map(CAPS)
    lateral, vertical = 3.0, 7.0
    scaled = HeightMap(
        surface.height_m * vertical, tuple(lateral * p for p in surface.pixel_size_m)
    )
    here, there = fitted(surface, fit), fitted(scaled, fit)
    assert there.cap_height_m == pytest.approx(vertical * here.cap_height_m, rel=1e-9)
    # R = D^2/8df to parts in 1e14 for such flat caps
    assert there.radius_m == pytest.approx(lateral**2 / vertical * here.radius_m, rel=1e-6)


def test_adding_a_constant_moves_the_peaks_alone():
    surface = caps_map(CAPS)
    here = fitted(surface)
    there = fitted(HeightMap(surface.height_m + 5e-6, surface.pixel_size_m))
    assert there.peak_height_m == pytest.approx(here.peak_height_m + 5e-6, abs=1e-15)
    assert there.radius_m == pytest.approx(here.radius_m, rel=1e-8)


def test_noise_lifts_the_highest_point_but_not_the_pinned_apex():
    rng = np.random.default_rng(1)
    surface = caps_map(CAPS)
    noisy = HeightMap(surface.height_m + rng.normal(0, 4e-9, surface.shape), (1e-4, 1e-4))
    pinned, paper = fitted(noisy, "pinned"), fitted(noisy, "equation18")
    assert len(pinned) == len(paper) == 3
    truth_m = sorted(peak for *_, peak in CAPS)
    assert sorted(pinned.peak_height_m) == pytest.approx(truth_m, abs=1.5e-9)
    assert (np.sort(paper.peak_height_m) > np.array(truth_m) + 4e-9).all()
    assert np.sort(pinned.radius_m) == pytest.approx([24, 25, 27], rel=0.04)


def test_scattered_missing_points_do_not_shrink_the_caps():
    rng = np.random.default_rng(2)
    surface = caps_map(CAPS)
    height_m = np.where(rng.random(surface.shape) < 0.05, np.nan, surface.height_m)
    table = fitted(HeightMap(height_m, surface.pixel_size_m))
    assert np.sort(table.radius_m) == pytest.approx([24, 25, 27], rel=0.03)
    assert ((table.flags & CapFlag.non_measured) == 0).all()


def test_a_cap_cut_by_a_patch_says_so():
    surface = caps_map(CAPS)
    height_m = surface.height_m.copy()
    height_m[30:70, 40:52] = np.nan
    table = fitted(HeightMap(height_m, surface.pixel_size_m))
    order = np.argsort(table.x_m)
    assert [bool(f & CapFlag.non_measured) for f in table.flags[order]] == [True, False, False]


def test_cap_at_the_edge_keeps_its_row_and_says_so():
    table = fitted(caps_map([(0.0, 10e-3, 24.0, 0.0), (15e-3, 10e-3, 24.0, 0.0)]))
    assert len(table) == 2
    assert [bool(f & CapFlag.edge) for f in table.flags[np.argsort(table.x_m)]] == [True, False]


def test_clipped_sensor_is_a_plateau():
    surface = caps_map(CAPS)
    table = fitted(HeightMap(np.minimum(surface.height_m, -1.2e-7), surface.pixel_size_m))
    assert ((table.flags & CapFlag.plateau) != 0).any()


@pytest.mark.parametrize(("stretch", "turn"), [(1.0, 0.0), (1.3, 0.0), (1.3, 0.7)])
def test_the_profile_has_the_quartic_term_of_the_hill_in_any_direction(stretch, turn):
    x, y = np.meshgrid((np.arange(120) - 60.3) * 1e-4, (np.arange(120) - 59.8) * 1e-4)
    along = (np.cos(turn) * x + np.sin(turn) * y) / stretch
    across = (np.cos(turn) * y - np.sin(turn) * x) * stretch
    t = (along**2 + across**2) / 2.5e-3**2
    for quartic in (0.0, 0.3, -0.03):
        surface = HeightMap(-1e-7 * (t + quartic * t**2), (1e-4, 1e-4))
        caps = fit_caps(surface, find_hills(surface), "pinned")
        radius_m = np.sqrt(caps.radius_major_m * caps.radius_minor_m)
        at_depth = 2.0 * radius_m * caps.fit_depth_m / 2.5e-3**2  # t where the fit ends
        expected_m = pytest.approx(quartic * 1e-7 * at_depth**2, rel=0.02, abs=1e-13)
        assert caps.quartic_m == expected_m
        assert caps.profile_residual_m[0] < 1e-3 * caps.fit_depth_m[0]
