"""Resampling: the same face on another grid."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from capslip.errors import SettingsError
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.resampling import (
    finer_than,
    problems_of_fewer_points,
    problems_of_resampling,
    resample,
)

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


@pytest.mark.parametrize(
    ("shape", "finer"),
    [
        ((NY, NX), None),
        ((2 * NY, NX), None),
        ((NY // 2, NX), (NY, NX)),
        ((NY - 1, NX), (NY, NX)),
        ((NY // 3, NX), (2 * NY // 3, NX)),
        ((NY // 3, NX // 4), (2 * NY // 3, NX // 2)),
        ((NY // 4, NX // 2), (NY // 2, NX)),
        ((2 * NY, NX // 3), (2 * NY, 2 * NX // 3)),
    ],
)
def test_fewer_points_are_held_against_those_measured_or_twice_as_many_a_side(shape, finer):
    z = np.random.default_rng(1).standard_normal((NY, NX)) * 1e-6
    z[5:9, 7] = np.nan
    surface = condition(HeightMap(z, PIXEL_M)).surface
    found = finer_than(resample(surface, shape), surface)
    told = condition(HeightMap(z, PIXEL_M), resample_to=shape).finer
    problems = problems_of_fewer_points(resample(surface, shape), found, surface.shape)
    if finer is None:
        assert found is told is None
        assert problems == []
        return
    expected = resample(surface, finer)
    for one in (found, told):
        assert one.pixel_size_m == pytest.approx(expected.pixel_size_m, rel=1e-12)
        np.testing.assert_array_equal(one.height_m, expected.height_m)
    (problem,) = problems
    assert problem.message.startswith("resampled to {} x {} points".format(*shape))
    of = "" if finer == (NY, NX) else f" of {NY} x {NX}"
    against = "against {} x {}".format(*finer)
    assert problem.message.endswith(f"{against}{of} that were measured")


@pytest.mark.parametrize("void", [False, True])
def test_a_finer_map_lies_as_its_face_was_turned(void):
    """Turned twice, about other places; without voids of its own where the face has none."""
    z = 1e-6 * waves(*axes((NY, NX), PIXEL_M), 2e-3)
    z[50:70, 80:99] = np.nan
    shape = NY // 2, NX // 2
    face = condition(HeightMap(z, PIXEL_M), resample_to=shape)
    if void:
        face = replace(face, surface=face.surface.as_void())
    assert face.finer_as_turned().void == void
    for slope, at_m in (((3e-4, -2e-4), (1e-3, 2e-3)), ((-1e-4, 5e-4), (0.0, 4e-3))):
        y, x = axes(shape, face.surface.pixel_size_m)
        added_m = slope[0] * (x - at_m[0]) + slope[1] * (y - at_m[1])
        surface = replace(face.surface, height_m=face.surface.height_m + added_m)
        face = face.turned(surface, slope, at_m, {"step": "level"})
    other = resample(face.finer_as_turned(), shape)
    np.testing.assert_array_equal(other.measured, face.surface.measured)
    between_m = (other.height_m - face.surface.height_m)[6:-6, 6:-6]
    beside_hole = ~np.isfinite(between_m)  # where a slope leaks, as at an edge
    far = ~binary_dilation(beside_hole, iterations=6)
    assert far.mean() > 0.8
    assert np.ptp(between_m[far]) < 1e-3 * np.ptp(added_m)


def test_a_map_that_was_not_resampled_is_its_finest():
    surface = HeightMap(1e-6 * waves(*axes((NY, NX), PIXEL_M), 2e-3), PIXEL_M)
    whole, fewer = condition(surface), condition(surface, resample_to=(NY // 2, NX // 2))
    assert whole.finer_as_turned() is None
    assert whole.finest is whole.surface
    np.testing.assert_array_equal(fewer.finest.height_m, whole.surface.height_m)
