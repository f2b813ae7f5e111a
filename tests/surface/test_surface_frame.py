"""A frame of lines without any point changes nothing of what is found within."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip.surface.conditioning import condition
from capslip.surface.filling import fill_scattered
from capslip.surface.form import remove_form
from capslip.surface.frame import frameless, in_frame, without_frame
from capslip.surface.heightmap import HeightMap
from capslip.surface.outliers import find_outliers
from capslip.surface.rounding import smooth_steps

SHAPE, PIXEL_M = (90, 120), (1e-4, 1.2e-4)
# Two of them as wide on either side, of rows or of columns alone
WAYS = [
    ((5, 0), (0, 0)),
    ((0, 2), (7, 1)),
    ((40, 60), (90, 20)),
    ((3, 3), (0, 0)),
    ((0, 0), (4, 4)),
]


def waves_m(seed, rms_m=2e-7):
    z = gaussian_filter(np.random.default_rng(seed).standard_normal(SHAPE), 6.0)
    return rms_m * z / z.std()


def framed(height_m, way):
    return HeightMap(np.pad(height_m, way, constant_values=np.nan), PIXEL_M)


def within(values, way):
    return values[tuple(slice(a, a + n) for (a, _), n in zip(way, SHAPE, strict=True))]


@pytest.mark.parametrize("way", WAYS)
def test_steps_are_smoothed_as_without_it(way):
    """The filter goes on beyond the last point as it does at the edge of a map."""
    stored_m = np.round(waves_m(21010) / 6e-8) * 6e-8
    bare, found = smooth_steps(HeightMap(stored_m, PIXEL_M)), smooth_steps(framed(stored_m, way))
    assert np.abs(bare.height_m - stored_m).max() > 1e-8
    np.testing.assert_array_equal(within(found.height_m, way), bare.height_m)
    assert found.rounding == bare.rounding
    assert found.n_measured == bare.n_measured


@pytest.mark.parametrize("way", WAYS)
def test_spikes_beside_it_are_found_as_at_an_edge(way):
    rng = np.random.default_rng(21011)
    height_m = waves_m(21012) + 1e-9 * rng.standard_normal(SHAPE)
    edge = np.zeros(SHAPE, dtype=bool)
    edge[0, 3::9] = edge[-1, 5::9] = edge[4:-4:9, 0] = edge[6:-4:9, -1] = True
    height_m[edge] += 3e-6
    bare = find_outliers(HeightMap(height_m, PIXEL_M))
    found = find_outliers(framed(height_m, way))
    np.testing.assert_array_equal(bare.index, np.flatnonzero(edge))
    mask = np.zeros(framed(height_m, way).shape, dtype=bool)
    mask.reshape(-1)[found.index] = True
    np.testing.assert_array_equal(within(mask, way), edge)
    np.testing.assert_array_equal(found.step_m, bare.step_m)


@pytest.mark.parametrize("way", WAYS)
def test_points_that_stand_alone_are_filled_as_without_it(way):
    """How many there are on an area is that of the face, not that of the map."""
    height_m = waves_m(21013)
    height_m[np.random.default_rng(21014).random(SHAPE) < 0.7] = np.nan
    bare, found = (
        fill_scattered(HeightMap(height_m, PIXEL_M)),
        fill_scattered(framed(height_m, way)),
    )
    np.testing.assert_array_equal(within(found.height_m, way), bare.height_m)
    assert found.filling == bare.filling
    np.testing.assert_array_equal(within(found.filling.measured, way), bare.filling.measured)


@pytest.mark.parametrize("void", [False, True])
@pytest.mark.parametrize("way", WAYS)
def test_single_points_at_its_rim_are_lost_as_at_the_edge_of_a_map(way, void):
    height_m = waves_m(21015)
    height_m[np.random.default_rng(21016).random(SHAPE) < 0.3] = np.nan
    height_m[:20, :30] = np.nan
    height_m[0, -1] = height_m[-1, 0] = 0.0  # what was measured reaches all four edges
    bare, found = HeightMap(height_m, PIXEL_M), framed(height_m, way)
    bare, found = (one.as_void() if void else one for one in (bare, found))
    np.testing.assert_array_equal(within(found.outside, way), bare.outside)
    assert found.outside.sum() - bare.outside.sum() == found.size - bare.size


def test_a_map_without_a_point_is_outside_as_a_whole():
    assert HeightMap(np.full(SHAPE, np.nan), PIXEL_M).outside.all()


def test_a_map_that_has_none_or_next_to_nothing_within_stays():
    for surface in (
        HeightMap(waves_m(0), PIXEL_M),
        HeightMap(np.full(SHAPE, np.nan), PIXEL_M),
        framed(np.zeros((2, 50)), ((9, 9), (9, 9))),
    ):
        assert without_frame(surface) is surface
        inner, values, begins_m = frameless(surface, surface.measured)
        assert inner is surface
        assert values.shape == surface.shape
        assert begins_m == (0.0, 0.0)
        np.testing.assert_array_equal(in_frame(surface.height_m, surface), surface.height_m)
    assert without_frame(framed(np.zeros((3, 50)), ((9, 9), (9, 9)))).shape == (3, 50)


def test_what_was_found_within_lies_at_its_place():
    surface = framed(waves_m(1), ((4, 0), (7, 9)))
    inner, values, begins_m = frameless(surface, surface.height_m)
    np.testing.assert_array_equal(values, inner.height_m)
    assert begins_m == pytest.approx((7 * 1.2e-4, 4 * 1e-4), rel=1e-12)
    whole = in_frame(inner.height_m, surface)
    np.testing.assert_array_equal(whole, surface.height_m)
    assert in_frame(np.ones(inner.shape, dtype=bool), surface, False).sum() == inner.size
    level = remove_form(surface, "plane")[0]
    assert without_frame(level).shape == SHAPE


@pytest.mark.parametrize("way", WAYS)
def test_a_conditioned_map_in_steps_is_that_without_it(way):
    stored_m = np.round(waves_m(21017) / 3e-8) * 3e-8
    stored_m[0, 40] += 9e-6
    bare, found = condition(HeightMap(stored_m, PIXEL_M)), condition(framed(stored_m, way))
    off_m = within(found.surface.height_m, way) - bare.surface.height_m
    assert np.nanmax(np.abs(off_m)) < 1e-6 * bare.sq_m
    assert found.removed_m[2] == pytest.approx(bare.removed_m[2], rel=1e-5)
