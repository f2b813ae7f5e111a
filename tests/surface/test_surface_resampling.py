"""Resampling: the same face on another grid."""

import numpy as np
import pytest

from capslip.errors import SettingsError
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.resampling import problems_of_resampling, resample

PIXEL_M = (60e-6, 50e-6)
NY, NX = 120, 180


def axes(shape, pixel_m):
    y, x = np.mgrid[: shape[0], : shape[1]]
    return (y + 0.5) * pixel_m[0], (x + 0.5) * pixel_m[1]


def waves(y, x, length_m):
    return np.sin(2 * np.pi * y / length_m) * np.cos(2 * np.pi * x / length_m)


@pytest.mark.parametrize("shape", [(60, 90), (80, 77), (240, 200), (120, 60), (41, 500)])
def test_the_face_keeps_its_size_and_its_heights(shape):
    surface = HeightMap(1.0 + waves(*axes((NY, NX), PIXEL_M), 3e-3), PIXEL_M)
    other = resample(surface, shape)
    assert other.shape == shape
    assert other.side_m == pytest.approx(surface.side_m, rel=1e-12)
    expected = 1.0 + waves(*axes(shape, other.pixel_size_m), 3e-3)
    # a Gaussian with a nesting index of two new pixels p takes 1 - 2^-((2 p / 3 mm)^2) of it
    lost = 1 - 2 ** -sum((2 * p / 3e-3) ** 2 for p in other.pixel_size_m)
    inner = np.s_[shape[0] // 6 : -shape[0] // 6, shape[1] // 6 : -shape[1] // 6]
    assert np.abs(other.height_m - expected)[inner].max() < lost + 4e-3


def test_the_same_grid_changes_nothing():
    z = np.random.default_rng(0).standard_normal((NY, NX))
    z[5:9, 7] = np.nan
    np.testing.assert_array_equal(resample(HeightMap(z, PIXEL_M), (NY, NX)).height_m, z)


def test_a_constant_stays_and_holes_are_not_filled():
    z = np.full((NY, NX), 0.7)
    z[30:60, 40:90] = np.nan
    for shape in ((60, 90), (200, 300)):
        other = resample(HeightMap(z, PIXEL_M), shape)
        np.testing.assert_allclose(other.height_m[other.measured], 0.7, rtol=1e-14)
        assert (~other.measured).mean() == pytest.approx(30 * 50 / (NY * NX), rel=0.1)
        y, x = axes(shape, other.pixel_size_m)
        deep = (y > 31.5 * 60e-6) & (y < 58.5 * 60e-6) & (x > 41.5 * 50e-6) & (x < 88.5 * 50e-6)
        assert not other.measured[deep].any()


@pytest.mark.parametrize("axis", [0, 1])
def test_waves_that_the_new_grid_cannot_show_do_not_come_back_as_long_ones(axis):
    length_m = 2.3 * PIXEL_M[axis]  # every fourth point alone would show it as a long wave
    wave = np.sin(2 * np.pi * axes((NY, NX), PIXEL_M)[axis] / length_m)
    coarse = resample(HeightMap(wave, PIXEL_M), (30, 45)).height_m[3:-3, 3:-3]
    assert np.abs(coarse).max() < 0.01
    assert np.abs(wave[2::4, 2::4]).max() > 0.9


def test_a_slope_stays_away_from_the_edge():
    y, x = axes((NY, NX), PIXEL_M)
    other = resample(HeightMap(3 * x - 2 * y, PIXEL_M), (50, 70))
    y, x = axes((50, 70), other.pixel_size_m)
    inner = np.s_[6:-6, 6:-6]
    np.testing.assert_allclose(other.height_m[inner], (3 * x - 2 * y)[inner], atol=1e-8)


@pytest.mark.parametrize(
    "shape", [(2, 50), (50,), (50.5, 40), (0, 0), (8 * NY + 1, NX), (10**9, 10**9)]
)
def test_impossible_grids_are_refused(shape):
    with pytest.raises(SettingsError, match="resample_to"):
        resample(HeightMap(np.zeros((NY, NX)), PIXEL_M), shape)


@pytest.mark.parametrize(
    ("shape", "said"),
    [((NY, NX), None), ((NY // 2, NX), None), ((NY, 2 * NX), "1 x 2 "), ((3 * NY, NX), "3 x 1 ")],
)
def test_points_that_nobody_measured_are_said_whatever_the_other_axis_has(shape, said):
    surface = HeightMap(np.random.default_rng(1).standard_normal((NY, NX)) * 1e-6, PIXEL_M)
    problems = problems_of_resampling(surface, resample(surface, shape))
    assert [p.code for p in problems] == ([] if said is None else ["resampled_finer"])
    assert all(p.message.startswith(said) for p in problems)
    told = [p for p in condition(surface, resample_to=shape).problems if p in problems]
    assert told == list(problems)
