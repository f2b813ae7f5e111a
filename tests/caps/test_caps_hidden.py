"""Tops of hills that lie in holes, by the flanks around them."""

import numpy as np
import pytest

from capslip.caps.hidden import hidden_tops
from capslip.surface.heightmap import HeightMap

DY_M, DX_M = 1.25e-4, 1e-4
SHAPE = 120, 200
TOP_M = 9.03e-3, 7.21e-3  # x, y
RADIUS_M, HEIGHT_M = 1.6, 2e-6  # a foot of 25 pixels along x, 20 along y
Y_M, X_M = ((np.arange(n) + 0.5) * size_m for n, size_m in zip(SHAPE, (DY_M, DX_M), strict=True))
Y_M = Y_M[:, None]


def hill(top_m=TOP_M, height_m=HEIGHT_M, radii_m=(RADIUS_M, RADIUS_M), floor_m=0.0):
    fall_m = (X_M - top_m[0]) ** 2 / radii_m[0] + (Y_M - top_m[1]) ** 2 / radii_m[1]
    return np.maximum(height_m - 0.5 * fall_m, floor_m)


def holed(height_m, at_m, half_m):
    """Return the map with a rectangle lost."""
    lost = (np.abs(X_M - at_m[0]) < half_m[0]) & (np.abs(Y_M - at_m[1]) < half_m[1])
    return HeightMap(np.where(lost, np.nan, height_m), (DY_M, DX_M))


def beside(x_m, y_m=0.0):
    return TOP_M[0] + x_m, TOP_M[1] + y_m


@pytest.mark.parametrize("half_m", [(3.5e-4, 3.5e-4), (8e-4, 8e-4), (1.2e-3, 6e-4)])
@pytest.mark.parametrize("off", [(0.0, 0.0), (0.7, -0.4), (-0.8, 0.8)])
def test_the_flanks_tell_place_height_and_radius_of_a_top_that_was_lost(half_m, off):
    at_m = beside(off[0] * half_m[0], off[1] * half_m[1])
    tops = hidden_tops(holed(hill(), at_m, half_m))
    assert tops.x_m == pytest.approx([TOP_M[0]], abs=1e-7)
    assert tops.y_m == pytest.approx([TOP_M[1]], abs=1e-7)
    assert tops.height_m == pytest.approx([HEIGHT_M], rel=1e-6)
    assert tops.radius_m == pytest.approx([RADIUS_M], rel=1e-5)
    assert tops.height_se_m[0] < 1e-6 * HEIGHT_M


def test_a_top_that_is_longer_than_wide_has_the_radius_that_hertz_theory_wants():
    tops = hidden_tops(holed(hill(radii_m=(3.2, 0.8)), TOP_M, (6e-4, 6e-4)))
    assert tops.radius_m == pytest.approx([1.6 * 1.081], rel=2e-3)


def test_what_is_ten_times_as_long_as_wide_is_no_top():
    assert hidden_tops(holed(hill(radii_m=(6.4, 0.6)), TOP_M, (4e-4, 4e-4))).x_m.size == 0


@pytest.mark.parametrize(
    "surface",
    [
        HeightMap(hill(), (DY_M, DX_M)),
        holed(hill(), beside(1.2e-3), (6e-4, 6e-4)),  # on the flank: the top was measured
        holed(hill(), (17e-3, 10e-3), (6e-4, 6e-4)),  # on the floor
        holed(-hill(), TOP_M, (6e-4, 6e-4)),  # of a hollow
        holed(hill(), TOP_M, (1e-4, 1.25e-4)),  # of two points along each side
        holed(hill(), beside(4.94e-2, 4.94e-2), (5e-2, 5e-2)),  # a corner: outside
    ],
)
def test_where_no_top_was_lost_there_is_none(surface):
    assert hidden_tops(surface).x_m.size == 0


def test_three_points_along_each_side_hide_a_top():
    assert hidden_tops(holed(hill(), TOP_M, (1.5e-4, 1.9e-4))).x_m.size == 1


def test_each_top_in_a_long_hole_is_told_once():
    """Its middle is a line, and from some places on it both tops are seen."""
    other_m = TOP_M[0] + 5.2e-3, TOP_M[1]
    both_m = np.maximum(hill(), hill(other_m, 1.8e-6))
    tops = hidden_tops(holed(both_m, beside(2.6e-3), (3.4e-3, 5e-4)))
    order = np.argsort(tops.x_m)
    assert tops.x_m[order] == pytest.approx([TOP_M[0], other_m[0]], abs=1e-6)
    assert tops.height_m[order] == pytest.approx([HEIGHT_M, 1.8e-6], rel=1e-3)


def test_holes_one_point_apart_are_two():
    other_m = TOP_M[0] + 3.0e-3, TOP_M[1]
    face_m = np.maximum(hill(), hill(other_m, 1.9e-6))
    lost = holed(face_m, beside(1.5e-3), (2.8e-3, 5e-4)).height_m.copy()
    between = np.argmin(np.abs(X_M - TOP_M[0] - 1.5e-3))
    lost[:, between] = face_m[:, between]
    tops = hidden_tops(HeightMap(lost, (DY_M, DX_M)))
    assert np.sort(tops.x_m) == pytest.approx([TOP_M[0], other_m[0]], abs=1e-6)


def test_a_wide_hole_is_told_by_what_is_near_it_where_higher_hills_stand_around():
    around = [(dx_m, dy_m) for dx_m in (-3.8e-3, 0.0, 3.8e-3) for dy_m in (-3.8e-3, 0.0, 3.8e-3)]
    others = [beside(*off_m) for off_m in around if off_m != (0.0, 0.0)]
    face_m = np.max([hill(), *(hill(at_m, 2.2e-6) for at_m in others)], axis=0)
    tops = hidden_tops(holed(face_m, TOP_M, (1.05e-3, 1.05e-3)))
    assert tops.height_m == pytest.approx([HEIGHT_M], rel=1e-3)


def test_a_rim_that_falls_less_than_the_top_would_rise_is_a_guess():
    """Of the flanks a ring of two points is left, the rest is outside of the face."""
    x_m, y_m = X_M - TOP_M[0], Y_M - TOP_M[1]
    r_m = np.hypot(x_m, y_m)
    for wide_m, told in ((3e-4, 0), (9e-4, 1)):
        ring = (r_m > 1e-3) & (r_m < 1e-3 + wide_m)
        surface = HeightMap(np.where(ring, hill(), np.nan), (DY_M, DX_M))
        assert hidden_tops(surface).x_m.size == told


def test_noise_of_the_flanks_is_in_the_standard_error_of_the_top():
    rng, off = np.random.default_rng(5), []
    for _ in range(40):
        noise_m = rng.normal(0.0, 2e-8, SHAPE)
        tops = hidden_tops(holed(hill() + noise_m, TOP_M, (8e-4, 8e-4)))
        at = np.hypot(tops.x_m - TOP_M[0], tops.y_m - TOP_M[1]) < 8e-4
        assert at.sum() == 1
        off.append(float(((tops.height_m - HEIGHT_M) / tops.height_se_m)[at][0]))
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 2.0
