"""Height maps that are too large to be copied: heights are computed where they are asked for."""

import tracemalloc

import numpy as np
import pytest

from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.heights import SMALL

SIDE, PIXEL_M = 1500, (1e-5, 2e-5)


@pytest.fixture(scope="module")
def stored_m():
    """Make a tilted map in single precision, with noise, spikes and missing points."""
    along, rng = np.arange(SIDE) * 0.01, np.random.default_rng(0)
    waves_m = 1e-6 * np.sin(along)[:, None] * np.cos(1.3 * along) + 1e-5 * along
    z_m = (waves_m + 1e-9 * rng.standard_normal(waves_m.shape)).astype(np.float32)
    z_m.reshape(-1)[rng.choice(z_m.size, 40, replace=False)] += 3e-6
    z_m[700:710, 300] = np.nan
    return z_m


def test_what_is_added_is_there_however_heights_are_asked_for(stored_m):
    rng = np.random.default_rng(1)
    x_m, y_m, of_y, of_x = 1e-6 * rng.standard_normal((4, SIDE))
    level_m = float(stored_m[0, 0])
    surface = HeightMap(stored_m, PIXEL_M).plus(x_m, y_m, ((of_y, of_x),), level_m)
    surface = surface.plus(-2.0 * x_m, y_m)
    assert surface.size > SMALL
    whole_m = surface.height_m
    expected = stored_m.astype(float) - level_m - x_m + 2.0 * y_m[:, None] + np.outer(of_y, of_x)
    np.testing.assert_allclose(whole_m, expected, rtol=0.0, atol=1e-20)
    index = rng.choice(surface.size, 1000)
    rows, row, col = slice(20, 90), index // SIDE, index % SIDE
    np.testing.assert_array_equal(surface[rows], whole_m[rows])
    np.testing.assert_array_equal(surface[rows, 5::7], whole_m[rows, 5::7])
    np.testing.assert_array_equal(surface[row, col], whole_m[row, col])
    np.testing.assert_array_equal(surface.at(index), whole_m.reshape(-1)[index])
    assert surface.bounds_m == (np.nanmin(whole_m), np.nanmax(whole_m))


def test_points_that_lack_are_known_without_the_heights(stored_m):
    surface = HeightMap(stored_m, PIXEL_M)
    gone = np.array([3, 5 * SIDE + 2])
    less = surface.without(gone)
    for one, lost in ((surface, []), (less, gone)):
        expected = np.isnan(stored_m)
        expected.reshape(-1)[lost] = True
        np.testing.assert_array_equal(np.isnan(one.height_m), expected)
        np.testing.assert_array_equal(one.measured, ~expected)
        np.testing.assert_array_equal(one.lost, np.flatnonzero(expected))
        assert one.n_measured == np.count_nonzero(~expected)
        assert not one.complete
    assert HeightMap(np.zeros((4, 5)), PIXEL_M).complete


def test_a_large_map_is_conditioned_without_a_copy_in_double_precision(stored_m):
    """What is held at most: the map less its outliers as it is stored, and some rows."""
    surface = HeightMap(stored_m, PIXEL_M)
    condition(HeightMap(stored_m[:100], PIXEL_M))  # imports
    tracemalloc.start()
    found = condition(surface)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.removed_m.shape[1] == 40
    assert most < 1.9 * stored_m.nbytes


def test_a_map_keeps_its_heights_and_leaves_those_of_the_caller_alone():
    given_m = np.arange(20.0).reshape(4, 5)
    expected_m = given_m.copy()
    for heights_m in (given_m, given_m[:, ::-1][:, ::-1], given_m[:], given_m.astype(np.float32)):
        surface = HeightMap(heights_m, PIXEL_M)
        heights_m[0, 0] = 7.0  # as a loop does that adds to its array
        np.testing.assert_array_equal(surface.height_m, expected_m)
        heights_m[0, 0] = 0.0
    given_m.flags.writeable = False
    assert HeightMap(given_m, PIXEL_M).height_m is given_m  # nobody can: no copy


@pytest.mark.parametrize("stored", [np.float64, np.float32, np.int16])
def test_what_a_mask_hides_was_not_measured(stored):
    masked = np.ma.masked_equal(np.array([[1, 2, 3], [4, -99, 6], [7, 8, 9]], stored), -99)
    surface = HeightMap(masked, PIXEL_M)
    assert surface.lost.tolist() == [4]
    assert surface.bounds_m == (1.0, 9.0)


@pytest.mark.parametrize(
    "heights", [np.ones((4, 4)) * 1j, np.zeros((4, 4), "M8[s]"), [[1.0, 2.0], [3.0]], "heights"]
)
def test_what_is_no_table_of_real_numbers_is_refused(heights):
    with pytest.raises(UnusableSurfaceError, match="no real numbers on a grid"):
        HeightMap(heights, PIXEL_M)


def test_what_was_measured_lies_within_its_rectangle():
    height_m = np.full((12, 17), np.nan)
    height_m[[3, 8], [15, 4]] = 0.0
    surface = HeightMap(height_m, (2.0, 1.0))
    assert surface.measured_window == np.s_[3:9, 4:16]
    assert surface.measured_area_m2 == 6 * 2.0 * 12
    assert surface.centre_m == (10.0, 12.0)
    nothing = HeightMap(np.full((12, 17), np.nan), (2.0, 1.0))
    assert nothing.measured_area_m2 == 0.0


@pytest.mark.parametrize(
    "slope",
    [
        (np.nan, 0.0),
        (0.0, np.inf),
        (1e-3,),
        (1e-3, 0.0, 0.0),
        "ab",
        ("a", 0.0),
        1e-3,
        np.ones((2, 2)),
    ],
    ids=str,
)
def test_a_floor_without_two_finite_slopes_is_refused(slope):
    """Slopes of the floor were taken as they came, a text or NaN too."""
    with pytest.raises(
        SettingsError, match=r"surface: floor_slope: got .*; expected two"
    ) as raised:
        HeightMap(np.zeros((4, 5)), (1e-4, 1e-4), floor_slope=slope)
    assert "\n" not in str(raised.value)
    for sound in (np.array([1e-3, -2e-3]), [np.float32(1), 0], (0.0, 0.0), None):
        held = HeightMap(np.zeros((4, 5)), (1e-4, 1e-4), floor_slope=sound).floor_slope
        assert held == (None if sound is None else tuple(map(float, sound)))


@pytest.mark.parametrize("noise_m", [0.0, -1e-9, np.nan, np.inf])
def test_a_noise_that_is_no_positive_number_is_refused(noise_m):
    with pytest.raises(SettingsError, match=r"surface: noise of \S+ m; expected a positive number"):
        HeightMap(np.zeros((4, 5)), (1e-4, 1e-4), noise_m=noise_m)
    assert HeightMap(np.zeros((4, 5)), (1e-4, 1e-4), noise_m=2e-9).noise_m == 2e-9
