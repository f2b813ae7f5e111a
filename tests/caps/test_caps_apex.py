"""The apex of a hill: depth of its crown, what stands in for a vertex, and their errors."""

from types import SimpleNamespace

import numpy as np
import pytest
from hill_cases import bowl_m, hills_of

from capslip.caps.apex import find_apexes, on_hill
from capslip.caps.noise import Noise

SILENT = Noise(0.0, 1.0, 0.0)
PIXEL_M = (0.5, 2.0)


def within(height_m, lowest_m):
    return height_m >= lowest_m


def test_without_noise_the_apex_is_the_vertex_between_the_points():
    height_m = bowl_m((40, 20), (9.8, 20.7), 50.0, PIXEL_M) + 7.0
    surface, hills, points = hills_of(height_m, height_m > 6.0, 6.0, PIXEL_M)
    found = find_apexes(surface, hills, points, SILENT)
    assert found.apex_m[:, 0] == pytest.approx([20.7, 9.8, 7.0], rel=1e-9)
    assert found.on_surface.all()
    highest = np.unravel_index(np.argmax(height_m), height_m.shape)
    assert found.highest_m[:, 0] == pytest.approx(
        [(highest[1] + 0.5) * 2.0, (highest[0] + 0.5) * 0.5, height_m.max()]
    )
    fall_m = (height_m.max() - 6.0) / points.count[0]
    assert found.highest_se_m[0] == pytest.approx(fall_m)
    assert found.least_depth_m[0] == pytest.approx(25.0 * fall_m)
    assert found.floor_m[0] == 6.0


@pytest.mark.parametrize(("noise_m", "above_m"), [(0.05, 0.15), (0.0999, 0.2997), (0.2, 0.3)])
def test_noise_takes_points_away_up_to_three_spreads_above_the_cut(noise_m, above_m):
    """And up to three tenths of the height: the highest point is 1 above a cut at 6."""
    height_m = bowl_m((40, 40), (20.5, 20.5), 100.0) + 7.0
    found = find_apexes(*hills_of(height_m, height_m > 6.0, 6.0), Noise(noise_m, 1.0, noise_m))
    assert found.floor_m[0] == pytest.approx(6.0 + above_m)
    assert found.least_depth_m[0] == pytest.approx(10.0 * noise_m)
    n = np.count_nonzero(height_m > 6.0)
    assert found.highest_se_m[0] == pytest.approx(noise_m * np.sqrt(2.0 * np.log(n)) + 1.0 / n)


@pytest.mark.parametrize(("spreads", "at_cut"), [(16.99, True), (17.01, False)])
def test_a_crown_of_fourteen_spreads_may_reach_down_to_three_above_the_cut(spreads, at_cut):
    height_m = bowl_m((40, 40), (20.5, 20.5), 100.0) + 7.0
    given = hills_of(height_m, height_m > 6.0, 6.0)
    assert find_apexes(*given, Noise(1.0 / spreads, 1.0, 1.0 / spreads)).at_cut[0] == at_cut


@pytest.mark.parametrize(("count", "at_cut"), [(24, True), (25, False)])
def test_a_crown_has_twenty_five_points(count, at_cut):
    height_m = -np.arange(49.0).reshape(7, 7) / 64.0
    found = find_apexes(*hills_of(height_m, height_m > -count / 64.0, -1.0), SILENT)
    assert found.at_cut[0] == at_cut


def test_one_point_is_as_uncertain_as_two():
    height_m = np.zeros((5, 5))
    height_m[2, 2] = 1.0
    found = find_apexes(*hills_of(height_m, height_m > 0.5), Noise(0.01, 1.0, 0.01))
    assert found.highest_se_m[0] == pytest.approx(0.01 * np.sqrt(2.0 * np.log(2.0)) + 1.0)
    assert found.apex_se_m[0] == found.highest_se_m[0]


def test_a_hill_without_points_has_no_apex():
    height_m = bowl_m((20, 20), (10.2, 9.7), 50.0)
    given = hills_of(height_m, 2 * within(height_m, -0.5), -0.5)
    for noise in (SILENT, Noise(0.01, 1.0, 0.01)):
        found = find_apexes(*given, noise)
        assert np.isnan(found.apex_m[:, 0]).all()
        assert found.ties.tolist() == [0, 1]
        assert found.on_surface.tolist() == [False, True]
        assert found.apex_m[:2, 1] == pytest.approx([9.7, 10.2], rel=1e-9)


def test_of_points_that_are_as_high_the_first_is_the_highest():
    height_m = np.minimum(bowl_m((15, 15), (7.5, 7.5), 50.0), -0.05)
    found = find_apexes(*hills_of(height_m, np.ones((15, 15)), -2.0), SILENT)
    ties = np.argwhere(height_m == height_m.max())
    assert found.ties[0] == len(ties) == 21
    assert found.highest_m[:, 0].tolist() == [ties[0][1] + 0.5, ties[0][0] + 0.5, height_m.max()]


def fall_per_point_m(depth_m, height_m, cut_m):
    """Return what the depth of the crown, 25 points deep, says of it."""
    given = hills_of(height_m, within(height_m, cut_m), cut_m, PIXEL_M)
    found = find_apexes(*given, SILENT, np.array([depth_m]))
    assert found.least_depth_m == pytest.approx(25.0 * found.highest_se_m)
    return found.highest_se_m[0]


def test_a_depth_says_how_the_height_falls_within():
    """A sharp tip on a flat dome: t^2 / 2V, of the tip alone where that holds fifty points."""
    tip_m, dome_m = (bowl_m((160, 60), (40.25, 61.0), r, PIXEL_M) for r in (30.0, 300.0))
    height_m = np.maximum(tip_m, dome_m - 1.0)
    for depth_m in (0.7, 1.5):
        volume = np.maximum(height_m - height_m.max() + depth_m, 0.0).sum()
        expected_m = depth_m**2 / (2.0 * volume)
        assert fall_per_point_m(depth_m, height_m, -3.0) == pytest.approx(expected_m)
    # on a paraboloid that is the area of a pixel over 2 pi R
    assert fall_per_point_m(0.7, height_m, -3.0) == pytest.approx(1 / (60.0 * np.pi), rel=0.02)
    # a depth of few points is doubled until it holds fifty
    few, many = (np.count_nonzero(height_m > height_m.max() - t) for t in (0.2, 0.4))
    assert few < 50 <= many
    assert fall_per_point_m(0.1, height_m, -3.0) == fall_per_point_m(0.4, height_m, -3.0)
    assert fall_per_point_m(0.2, height_m, -3.0) != fall_per_point_m(0.8, height_m, -3.0)
    # and on a hill of fewer points until it holds them all
    few_m = np.array([0.0, -0.3, -0.5, -0.9])
    given = hills_of(np.tile(few_m, (3, 1)), np.ones((3, 4)), -1.0)
    found = find_apexes(*given, SILENT, np.array([0.26]))
    assert found.highest_se_m[0] == pytest.approx(1.04**2 / (6.0 * (few_m + 1.04).sum()))
    # none deeper than the cut, and none at all: over the whole hill
    assert fall_per_point_m(9.0, height_m, -3.0) == fall_per_point_m(
        float(height_m.max()) + 3.0, height_m, -3.0
    )
    whole_m = (height_m.max() + 3.0) / np.count_nonzero(height_m >= -3.0)
    assert fall_per_point_m(np.nan, height_m, -3.0) == pytest.approx(whole_m)


@pytest.mark.parametrize(("lost", "found"), [(2.0, True), (4.0, False)])
def test_a_vertex_over_a_hole_counts_up_to_the_depth_of_the_crown(lost, found):
    """Without a disc of radius r the vertex is r^2 / 2R above the highest point.

    The crown has 25 points, so it is as deep as those of a disc of 2.8 pixels.
    """
    height_m = bowl_m((41, 41), (20.5, 20.5), 200.0)
    hole = within(height_m, -(lost**2) / 400.0)
    height_m[hole] = np.nan
    label = within(np.nan_to_num(height_m, nan=-9.0), -0.4)
    apexes = find_apexes(*hills_of(height_m, label, -0.4), SILENT)
    assert apexes.on_surface[0] == found
    assert apexes.apex_m[2, 0] == (pytest.approx(0.0, abs=1e-12) if found else np.nanmax(height_m))


def slope(lift_m):
    """Make a face that rises to its edge, and a point of it that noise has lifted above that."""
    y, x = (np.mgrid[:21, :30] + 0.5) / 30.0
    height_m = x - 4.0 * (y - 0.35) ** 2
    height_m[15, 20] = height_m.max() + lift_m
    return hills_of(height_m, within(height_m, 0.3), 0.3)


def test_on_a_slope_the_apex_is_where_its_quadric_is_highest():
    found = find_apexes(*slope(0.01), Noise(0.02, 1.0, 0.02))
    assert not found.on_surface[0]
    assert found.highest_m[:2, 0].tolist() == [20.5, 15.5]
    assert found.apex_m[:2, 0] == pytest.approx([29.5, 10.5])
    assert found.apex_m[2, 0] == pytest.approx(29.5 / 30.0, abs=0.01)
    assert 0.0 < found.apex_se_m[0] < 0.02
    # without noise the highest point is what it is, and so is one that no noise explains
    for lift_m, noise in ((0.01, SILENT), (0.5, Noise(0.02, 1.0, 0.02))):
        found = find_apexes(*slope(lift_m), noise)
        assert np.array_equal(found.apex_m, found.highest_m)
        assert np.array_equal(found.apex_se_m, found.highest_se_m)


def test_the_error_of_an_apex_is_that_of_a_quadric_over_its_disc():
    """Of N points in a disc the height in its middle has a variance of 4 / N."""
    height_m = bowl_m((121, 121), (60.5, 60.5), 1000.0)
    given = hills_of(height_m, within(height_m, -1.6), -1.6)
    noise_m = 0.08
    found = find_apexes(*given, Noise(noise_m, 3.0, noise_m))
    n = np.count_nonzero(height_m >= -10.0 * noise_m)
    assert found.apex_se_m[0] == pytest.approx(3.0 * noise_m * 2.0 / np.sqrt(n), rel=0.01)
    # scatter that is not known as noise counts where it is larger
    rough_m = 5e-4 * np.random.default_rng(2).choice([-1.0, 1.0], (121, 121))
    rough = find_apexes(*hills_of(height_m + rough_m, given[1].label, -1.6), Noise(1e-9, 1.0, 1e-9))
    assert rough.least_depth_m[0] == pytest.approx(25.0 / (2.0 * np.pi * 1000.0), rel=0.1)
    assert rough.apex_se_m[0] == pytest.approx(5e-4 * 2.0 / np.sqrt(25.0), rel=0.3)


def test_a_vertex_is_on_the_hill_by_its_pixel():
    label = np.zeros((4, 6), dtype=int)
    label[0, 0], label[3, 5], label[2, 2], label[2, 3] = 1, 1, 1, 2
    height_m = np.zeros((4, 6))
    height_m[1, 1] = np.nan
    surface, hills, _ = hills_of(height_m, label, pixel_m=PIXEL_M)
    for x_m, y_m, expected in (
        (0.0, 0.0, True),
        (-1e-9, 0.0, False),
        (0.0, -1e-9, False),
        (11.999, 1.999, True),
        (12.0, 1.9, False),
        (11.9, 2.0, False),
        (5.9, 1.4, True),
        (6.1, 1.4, False),  # the other hill
        (5.9, 0.9, False),  # none
        (3.9, 0.9, True),  # a hole
        (4.1, 0.9, False),
        (np.nan, np.nan, False),
    ):
        vertex = SimpleNamespace(
            x_m=np.array([x_m, 7.0]),
            y_m=np.array([y_m, 1.2]),
        )
        assert on_hill(surface, hills, vertex).tolist() == [expected, True], (x_m, y_m)
