"""The areal Gaussian filters, on measured points alone."""

import tracemalloc

import numpy as np
import pytest

from capslip.errors import SettingsError
from capslip.surface.filters import (
    SIGMA_PER_NESTING_INDEX,
    blurred,
    gaussian_l_filter,
    gaussian_s_filter,
)
from capslip.surface.heightmap import HeightMap
from scenes import in_filters

PIXEL_M = (60e-6, 50e-6)
NY, NX = 120, 170


def axes(shape=(NY, NX), pixel_m=PIXEL_M):
    y, x = np.mgrid[: shape[0], : shape[1]]
    return (y + 0.5) * pixel_m[0], (x + 0.5) * pixel_m[1]


def rough(seed=0, rms_m=1e-7):
    return rms_m * np.random.default_rng(seed).standard_normal((NY, NX))


def holes(seed=1, share=0.2):
    missing = np.random.default_rng(seed).random((NY, NX)) < share
    missing[:40, :90] = True
    return missing


def test_sigma_is_that_of_the_standard():
    assert pytest.approx(0.1874, abs=5e-5) == SIGMA_PER_NESTING_INDEX
    # transmission of a Gaussian of that width at a wave as long as the nesting index
    assert np.exp(-2 * (np.pi * SIGMA_PER_NESTING_INDEX) ** 2) == pytest.approx(0.5, rel=1e-14)


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("index_m", [0.3e-3, 1e-3, 7e-3])
def test_s_filter_leaves_a_constant_alone(masked, index_m):
    z = np.full((NY, NX), 0.0123)
    if masked:
        z[holes()] = np.nan
    smooth = gaussian_s_filter(HeightMap(z, PIXEL_M), index_m).height_m
    np.testing.assert_allclose(smooth, z, rtol=1e-15)


@pytest.mark.parametrize("index_m", [0.25e-3, 1e-3])
def test_s_filter_leaves_a_slope_alone_away_from_the_edge(index_m):
    y, x = axes()
    z = 1e-4 * x - 2e-4 * y
    smooth = gaussian_s_filter(HeightMap(z, PIXEL_M), index_m).height_m
    middle = np.s_[40:80, 40:130]
    np.testing.assert_allclose(smooth[middle], z[middle], atol=1e-13)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0, 4.0])
def test_filters_part_waves_as_the_standard_says(axis, ratio):
    index_m = 0.8e-3
    wave = np.cos(2 * np.pi * (axes((160, 160))[axis] - 4e-3) / (ratio * index_m))
    middle = np.s_[60:100, 60:100]
    surface = HeightMap(wave, PIXEL_M)
    expected = 0.5 ** (1 / ratio**2)
    short, long = (f(surface, index_m).height_m for f in (gaussian_l_filter, gaussian_s_filter))
    np.testing.assert_allclose(long[middle], expected * wave[middle], atol=2e-6)
    np.testing.assert_allclose(short[middle], (1 - expected) * wave[middle], atol=2e-6)


@pytest.mark.parametrize("pixels", [4.0, 6.0, 10.0])
def test_the_shortest_nesting_indices_still_halve_their_wave(pixels):
    x = axes((120, 120), (50e-6, 50e-6))[1]
    wave = np.cos(2 * np.pi * x / (pixels * 50e-6))
    smooth = gaussian_s_filter(HeightMap(wave, (50e-6, 50e-6)), pixels * 50e-6).height_m
    middle = np.s_[50:70, 50:70]
    np.testing.assert_allclose(smooth[middle], 0.5 * wave[middle], atol=3e-3)


def test_filters_ignore_what_was_not_measured():
    z = rough(8)
    z[holes()] = np.nan
    smooth = gaussian_s_filter(HeightMap(z, PIXEL_M), 0.5e-3).height_m
    np.testing.assert_array_equal(np.isnan(smooth), np.isnan(z))
    y, x = axes()
    sigma_m = SIGMA_PER_NESTING_INDEX * 0.5e-3
    for i, j in ((80, 100), (0, 169), (41, 3), (119, 90)):
        weight = np.exp(-((y - y[i, j]) ** 2 + (x - x[i, j]) ** 2) / (2 * sigma_m**2))
        weight[np.isnan(z)] = 0
        if not np.isnan(z[i, j]):
            expected = np.nansum(weight * z) / weight.sum()
            assert smooth[i, j] == pytest.approx(expected, rel=1e-5, abs=1e-13)
    rest = gaussian_l_filter(HeightMap(z, PIXEL_M), 0.5e-3).height_m
    np.testing.assert_allclose(rest + smooth, z, atol=1e-20)


def test_other_side_of_the_map_has_no_say():
    z = rough(2)
    other = z.copy()
    other[:, -5:] += 1e-3
    near = [gaussian_s_filter(HeightMap(h, PIXEL_M), 1e-3).height_m[:, :5] for h in (z, other)]
    np.testing.assert_allclose(near[1], near[0], atol=1e-3 * 1e-10)


@pytest.mark.parametrize("which", [gaussian_s_filter, gaussian_l_filter])
@pytest.mark.parametrize("index_m", [0.0, -1e-3, 2e-4, 1.0, np.nan, np.inf])
def test_a_nesting_index_the_grid_cannot_show_is_refused(which, index_m):
    with pytest.raises(SettingsError, match=r"nesting_index_m: got .* 4 pixels"):
        which(HeightMap(rough(), PIXEL_M), index_m)


def test_filter_is_quick_and_small():
    z = np.random.default_rng(0).standard_normal((800, 1200)) * 1e-7
    z[np.random.default_rng(1).random(z.shape) < 0.05] = np.nan
    surface = HeightMap(z, PIXEL_M)
    assert in_filters(lambda: gaussian_s_filter(surface, 8e-3)) < 9.0
    tracemalloc.start()
    gaussian_s_filter(surface, 8e-3)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 6 * z.nbytes


@pytest.mark.parametrize("period_pixels", [1.5, 3.0, 6.0])
def test_a_blur_takes_of_a_wave_what_optics_of_that_period_take(period_pixels):
    """Its curvature falls by half its variance a pixel, on however few pixels that is."""
    _, x = axes()
    dx_m = PIXEL_M[1]
    period_m, everywhere = period_pixels * dx_m, np.ones((NY, NX), dtype=bool)
    for waves in (8, 14):
        height_m = 1e-7 * np.cos(2.0 * np.pi * waves * x / (NX * dx_m))
        inside = np.s_[:, 30:-30]
        found_m = blurred(height_m, everywhere, PIXEL_M, period_m)
        taken = 1.0 - np.ptp(found_m[inside]) / np.ptp(height_m[inside])
        of_period = waves / (NX * dx_m) * period_m
        assert taken == pytest.approx(1.0 - 0.5 ** (of_period**2), rel=0.04)


def test_a_blur_leaves_a_plane_up_to_the_edge_and_around_holes():
    y, x = axes()
    plane_m, missing = 3e-5 * x - 1e-5 * y, holes()
    for measured in (np.ones((NY, NX), dtype=bool), ~missing):
        height_m = np.where(measured, plane_m, np.nan)
        found_m = blurred(height_m, measured, PIXEL_M, 4.0 * PIXEL_M[1])
        np.testing.assert_allclose(found_m[measured], plane_m[measured], rtol=0.0, atol=1e-18)
        assert np.isnan(found_m[~measured]).all()


def test_a_lone_point_keeps_its_height_under_a_blur():
    measured = np.zeros((9, 9), dtype=bool)
    measured[4, 4] = True
    found_m = blurred(np.full((9, 9), 2e-7), measured, PIXEL_M, 4.0 * PIXEL_M[1])
    assert found_m[4, 4] == pytest.approx(2e-7, rel=1e-12)
