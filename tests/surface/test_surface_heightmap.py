"""Height maps that are too large to be copied: heights are computed where they are asked for."""

import tracemalloc

import numpy as np
import pytest

from capslip.surface.conditioning import condition
from capslip.surface.heightmap import SMALL, HeightMap

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
