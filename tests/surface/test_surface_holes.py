"""Holes of the map: said where a hill may lie in them, silent where none can."""

from dataclasses import replace

import numpy as np
import pytest

from capslip import load_settings
from capslip.analysis import analyze_once as analyze
from capslip.surface.heightmap import Filling, HeightMap
from capslip.surface.holes import (
    depth_of_holes,
    outside_as_made,
    problems_of_holes,
)
from capslip.surface.outline import between
from scenes import caps_map

PIXEL_M = (2e-4, 1e-4)
Y_M, X_M = (np.arange(150)[:, None] + 0.5) * 2e-4, (np.arange(400) + 0.5) * 1e-4


def without(lost):
    height_m = np.zeros((150, 400))
    height_m[lost] = np.nan
    return HeightMap(height_m, PIXEL_M)


def disc(x_m, y_m, radius_m):
    return np.hypot(X_M - x_m, Y_M - y_m) < radius_m


@pytest.mark.parametrize("place_m", [(0.02, 0.015), (0.02, 0.0)])  # inside, and cut by the edge
def test_a_hole_hides_hills_from_the_size_of_a_hill_on(place_m):
    found = problems_of_holes(without(disc(*place_m, 3.5e-3)), 3e-3)
    assert [(one.code, one.severity) for one in found] == [("hole_may_hide_hills", "warning")]
    assert problems_of_holes(without(disc(*place_m, 2.9e-3)), 3e-3) == ()


@pytest.mark.parametrize(("hill_m", "hides"), [(2.4e-3, True), (2.6e-3, False)])
def test_a_hole_is_seen_point_by_point_where_hills_are_small(hill_m, hides):
    """Five by five points: a disc of three pixels but for the half of one that is measured."""
    height_m = np.zeros((20, 20))
    height_m[7:12, 3:8] = np.nan
    found = problems_of_holes(HeightMap(height_m, (1e-3, 1e-3)), hill_m)
    assert bool(found) == hides


@pytest.mark.parametrize("hill_m", [1e-3, 2e-3, 3e-3])
def test_a_smaller_disc_of_places_is_left_to_a_larger_hill(hill_m):
    """Centres of discs of radius r within one of radius D fill one of D - r; the rim is as high."""
    map_with_hole = without(disc(0.02, 0.015, 5e-3))
    height_m = map_with_hole.height_m + 1e-6 * (X_M > 0.021)
    x_m, y_m, depth_m, rim_m, area_m2 = depth_of_holes(HeightMap(height_m, PIXEL_M), 2e-3)
    there = depth_m >= hill_m
    assert area_m2 * there.sum() == pytest.approx(np.pi * (5e-3 - hill_m) ** 2, rel=0.1)
    assert np.hypot(x_m - 0.02, y_m - 0.015)[there].max() == pytest.approx(5e-3 - hill_m, abs=2e-4)
    assert rim_m[there] == pytest.approx(0.0)  # more than a quarter of it is low


def test_three_quarters_of_what_lies_around_a_hole_exceed_its_rim():
    """Two holes, and one at the edge, each by the heights within two squares of its own."""
    height_m = np.random.default_rng(4).normal(size=(40, 60))
    lost = [np.s_[5:8, 10:13], np.s_[20:25, 30:38], np.s_[0:4, 50:60]]
    for one in lost:
        height_m[one] = np.nan
    surface = HeightMap(height_m, (1e-4, 1e-4))
    x_m, y_m, _, rim_m, area_m2 = depth_of_holes(surface, 1e-3, np.isnan(height_m))
    assert area_m2 == pytest.approx(1e-8)
    assert len(x_m) == sum(height_m[one].size for one in lost)
    row, col = (np.floor(one / 1e-4).astype(int) for one in (y_m, x_m))
    for rows, cols in lost:
        near = np.s_[max(rows.start - 2, 0) : rows.stop + 2, cols.start - 2 : cols.stop + 2]
        own = (row >= rows.start) & (row < rows.stop) & (col >= cols.start) & (col < cols.stop)
        assert rim_m[own] == pytest.approx(np.nanquantile(height_m[near], 0.25), rel=1e-12)


def test_a_narrow_hole_hides_no_hill_however_long():
    assert problems_of_holes(without((np.abs(Y_M - 0.015) < 2.5e-3) & (X_M > 1e-3)), 3e-3) == ()


def test_what_lies_around_a_round_face_is_no_hole():
    face = disc(0.02, 0.015, 0.0148)
    assert problems_of_holes(without(~face), 1e-3) == ()
    assert problems_of_holes(without(~face | disc(0.02, 0.015, 2e-3)), 1e-3)


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_scattered_points_hide_nothing(share):
    lost = np.random.default_rng(1).random((150, 400)) < share
    assert problems_of_holes(without(lost), 1e-3) == ()


def test_a_hidden_cap_is_not_passed_over():
    caps = [(0.006 + 0.008 * i, 0.006 + 0.009 * j, 20.0, 0.0) for i in range(3) for j in range(2)]
    surface = caps_map(caps, (200, 300), (1e-4, 1e-4), -0.4e-6)
    settings = load_settings(overrides=("contact.preload_N=60",))
    height_m = surface.height_m.copy()
    y_m, x_m = np.ogrid[0.5:200, 0.5:300]
    height_m[np.hypot(1e-4 * x_m - 0.014, 1e-4 * y_m - 0.006) < 4.1e-3] = np.nan
    analysis = analyze(HeightMap(height_m, (1e-4, 1e-4)), settings)
    assert analysis.caps.usable.sum() == 5
    assert "hole_may_hide_hills" in {problem.code for problem in analysis.problems}
    whole = analyze(surface, settings)
    assert "hole_may_hide_hills" not in {problem.code for problem in whole.problems}


OBLIQUE = {
    "turned half around": np.abs(X_M - 0.02 - 0.5 * (Y_M - 0.015)) < 0.01,  # a parallelogram
    "turned over left to right": np.abs(X_M - 0.02) < 0.004 + 0.4 * Y_M,
    "turned over top to bottom": np.abs(Y_M - 0.015) < 0.003 + 0.28 * X_M,
}


@pytest.mark.parametrize("way", OBLIQUE)
def test_a_part_that_goes_into_itself_in_one_way_alone_is_as_it_was_made(way):
    assert outside_as_made(without(~OBLIQUE[way]))
    assert not outside_as_made(without(X_M / 0.04 + Y_M / 0.03 < 0.5))  # one corner


@pytest.mark.parametrize("share", [0.05, 0.3, 0.7, 0.95])
@pytest.mark.parametrize("shape", [(1, 9), (7, 1), (12, 17), (30, 8)])
def test_a_hole_lies_between_measured_points_of_its_row_or_its_column(share, shape):
    for seed in range(5):
        measured = np.random.default_rng(seed).random(shape) < share
        measured[:, : seed * shape[1] // 9] = False  # open to an edge
        before, after = (
            [np.logical_or.accumulate(measured[turn], axis=axis)[turn] for axis in (0, 1)]
            for turn in (np.s_[:, :], np.s_[::-1, ::-1])
        )
        expected = ~measured & ((before[0] & after[0]) | (before[1] & after[1]))
        assert np.array_equal(between(measured), expected)


@pytest.mark.parametrize("n_columns", [5, 9])
def test_the_middle_of_a_slit_is_half_its_width_from_what_was_measured(n_columns):
    slit = np.zeros((150, 400), bool)
    slit[:, 200 : 200 + n_columns] = True
    x_m, _, depth_m, _, area_m2 = depth_of_holes(without(slit), 1e-4, slit)
    assert area_m2 == pytest.approx(2e-4 * 1e-4)  # each pixel is looked at
    half_m = 0.5 * n_columns * 1e-4
    np.testing.assert_allclose(depth_m, half_m - abs(x_m - 2e-2 - half_m), rtol=1e-9)


def test_the_face_ends_at_what_is_open_to_the_edge_and_at_holes_where_nothing_is():
    margin, hole, single = (np.zeros((150, 400), bool) for _ in range(3))
    margin[:, :1] = margin[-5:] = True  # one line is enough
    hole[40:60, 100:103] = True
    single[70, 200], single[90:92, 300], single[0, 399] = True, True, True  # and in a corner
    face = without(margin | hole | single)
    assert face.ends_within
    assert np.array_equal(face.outside, margin)
    assert np.array_equal(face.lost_inside, np.flatnonzero(hole | single))
    of_void = face.as_void()
    assert np.array_equal(of_void.outside, margin | hole)
    assert np.array_equal(of_void.lost_inside, np.flatnonzero(single))
    turned = of_void.plus(np.arange(400.0), np.arange(150.0))
    assert np.array_equal(turned.outside, margin | hole)
    spiked = of_void.without(np.arange(300, 400))  # a corner of the first row
    assert np.array_equal(spiked.outside, margin | hole | (Y_M < 2e-4) & (X_M > 0.03))
    for whole in (without(np.zeros((150, 400), bool)), without(single)):
        assert not whole.as_void().ends_within
        assert not whole.as_void().outside.any()


def test_pixels_are_outside_beyond_the_map_and_where_the_face_ended_before():
    margin = np.zeros((150, 400), bool)
    margin[:, 390:] = True
    rows, columns = np.array([0, -1, 149, 150, 7, 7]), np.array([0, 5, 389, 5, 390, 400])
    expected = [False, True, False, True, True, True]
    assert without(margin).is_outside(rows, columns).tolist() == expected
    assert without(~margin & margin).is_outside(rows, columns).tolist() == [
        *expected[:4],
        False,
        True,
    ]


def test_a_map_that_was_filled_between_points_that_stand_alone_has_no_voids():
    hole = disc(0.02, 0.015, 3e-3)
    filled = replace(without(hole), filling=Filling(9, 0.5, "linear", 1e-9, 1e6))
    assert without(hole).as_void().outside.any()
    assert not filled.as_void().outside.any()
