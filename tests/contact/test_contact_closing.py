"""What closes the equations: planes, projections and resultants, against their definitions."""

import numpy as np
import pytest

from capslip.contact.solvers.closing import GivenApproach, GivenLoad, GivenResultant

SHAPE, SIZE_M = (7, 11), (3e-4, 2e-4)
X_M, Y_M = (np.arange(11)[None] + 0.5) * 2e-4, (np.arange(7)[:, None] + 0.5) * 3e-4
EVERYWHERE = [np.broadcast_to(one, SHAPE).ravel() for one in (X_M, Y_M)]
POINTS = np.flatnonzero(np.random.default_rng(1).random(77) < 0.5)
PRESSURE = np.random.default_rng(2).random(POINTS.size) + 0.1
AT_M = tuple(one[POINTS] for one in EVERYWHERE)
RESULTANT_M = (1.3e-3, 0.9e-3)
GIVEN = GivenResultant(40.0, (X_M, Y_M), RESULTANT_M)
# Points of a part of the map, each with a place of its own
ALONE = GivenResultant(40.0, AT_M, RESULTANT_M)


def of(closing):
    """Return the points as a closing counts them."""
    return POINTS if closing is GIVEN else np.arange(POINTS.size)


def moments(pressure):
    return np.array([pressure.sum(), *(pressure @ one_m for one_m in AT_M)])


@pytest.mark.parametrize("closing", [GIVEN, ALONE])
def test_a_plane_is_found_as_it_is_and_lies_over_the_load_point(closing):
    plane = np.array([2e-7, 3e-5, -4e-5])
    height_m = plane[0] + sum(
        slope * (one_m - place_m)
        for slope, one_m, place_m in zip(plane[1:], AT_M, RESULTANT_M, strict=True)
    )
    assert closing.plane(PRESSURE, height_m, of(closing)) == pytest.approx(plane, rel=1e-9)
    assert closing.over(plane).ravel()[of(closing)] == pytest.approx(height_m, rel=1e-9)
    # The residual of other heights has neither sum nor moments under the pressures
    rough_m = np.random.default_rng(3).random(POINTS.size)
    fitted = closing.over(closing.plane(PRESSURE, rough_m, of(closing))).ravel()[of(closing)]
    assert np.abs(moments(PRESSURE * (rough_m - fitted))).max() < 1e-12


@pytest.mark.parametrize("closing", [GIVEN, ALONE])
def test_what_is_projected_has_neither_sum_nor_moments(closing):
    project = closing.projector(of(closing))
    left = project(PRESSURE)
    assert np.abs(moments(left)).max() < 1e-12
    assert project(left) == pytest.approx(left, abs=1e-12)  # once is enough
    assert left @ (PRESSURE - left) == pytest.approx(0.0, abs=1e-12)  # the nearest of them


@pytest.mark.parametrize("closing", [GIVEN, ALONE])
def test_pressures_are_moved_onto_load_and_place_by_an_exponential(closing):
    moved = closing.restored(PRESSURE, of(closing))
    x_R, y_R = RESULTANT_M
    assert moments(moved) == pytest.approx([40.0, 40.0 * x_R, 40.0 * y_R], rel=1e-9)
    assert moved.min() > 0.0
    basis = np.stack((np.ones(POINTS.size), *AT_M), axis=1)
    grown = np.log(moved / PRESSURE)
    assert basis @ np.linalg.lstsq(basis, grown)[0] == pytest.approx(grown, abs=1e-9)
    assert closing.restored(moved, of(closing)) == pytest.approx(moved, rel=1e-9)


@pytest.mark.parametrize("others", [1e-2, 1e-6, 1e-9, 1e-13])
def test_a_resultant_beside_the_one_point_that_bears_is_reached(others):
    """What the other points bear must grow by many powers of ten, and full steps go too far."""
    pressure, middle = np.full(POINTS.size, others), POINTS.size // 2
    pressure[middle] = 1.0
    near_m = (AT_M[0][middle] + 1e-4, AT_M[1][middle] + 5e-5)
    for x_R, y_R in (near_m, RESULTANT_M, (2.0999e-3, 1.0e-3)):
        moved = GivenResultant(40.0, (X_M, Y_M), (x_R, y_R)).restored(pressure, POINTS)
        assert moments(moved) == pytest.approx([40.0, 40.0 * x_R, 40.0 * y_R], rel=1e-12)


@pytest.mark.parametrize("others", [1e-300, 1e-320, 0.0])
def test_pressures_that_have_all_but_vanished_leave_no_pressures_that_are_no_numbers(others):
    """Growing them to one end of the map, nothing is left of any product with them."""
    pressure, middle = np.full(POINTS.size, others), POINTS.size // 2
    pressure[AT_M[0] > 1.9e-3] = 0.0
    pressure[middle] = 1.0
    near_m = (AT_M[0][middle] + 1e-4, AT_M[1][middle] + 5e-5)
    for place_m in (near_m, RESULTANT_M):
        moved = GivenResultant(40.0, (X_M, Y_M), place_m).restored(pressure, POINTS)
        assert moved is None or moments(moved) == pytest.approx(
            [40.0, 40.0 * place_m[0], 40.0 * place_m[1]], rel=1e-9
        )
    # Those of a few points bear it: the others stay without
    few = np.where(np.arange(POINTS.size) % 2 == 0, 1e-300 * PRESSURE, 0.0)
    moved = GIVEN.restored(few, POINTS)
    assert moments(moved) == pytest.approx(
        [40.0, 40.0 * RESULTANT_M[0], 40.0 * RESULTANT_M[1]], rel=1e-9
    )
    assert np.array_equal(moved > 0.0, few > 0.0)


def test_no_pressures_have_their_resultant_beside_all_of_their_points():
    beside = GivenResultant(40.0, (X_M, Y_M), (2.15e-3, 0.9e-3))
    assert beside.restored(PRESSURE, POINTS) is None
    # just within the last column, which bears next to all of it
    within = GivenResultant(40.0, (X_M, Y_M), (2.05e-3, 0.9e-3))
    assert within.restored(PRESSURE, POINTS) @ AT_M[0] == pytest.approx(40.0 * 2.05e-3, rel=1e-9)


def test_points_in_one_row_bear_a_resultant_in_it():
    row = np.arange(2 * 11, 3 * 11)
    given = GivenResultant(40.0, (X_M, Y_M), (RESULTANT_M[0], float(Y_M[2, 0])))
    moved = given.restored(np.ones(11), row)
    assert (moved.sum(), moved @ X_M[0]) == pytest.approx((40.0, 40.0 * RESULTANT_M[0]), rel=1e-9)
    assert GIVEN.restored(np.ones(11), row) is None


@pytest.mark.parametrize("closing", [GIVEN, ALONE])
def test_what_some_points_bear_is_left_to_the_others(closing):
    first = of(closing)[:5]
    rest = closing.less(PRESSURE[:5], first)
    assert rest.total_Pa == pytest.approx(40.0 - PRESSURE[:5].sum())
    for one_m, place_m, left_m in zip(AT_M, RESULTANT_M, rest.resultant_m, strict=True):
        together = rest.total_Pa * left_m + PRESSURE[:5] @ one_m[:5]
        assert together == pytest.approx(40.0 * place_m, rel=1e-12)
    for little in (GIVEN, GivenLoad(40.0)):
        assert little.less(np.full(5, 7.99), POINTS[:5]).total_Pa == pytest.approx(0.05)
    for too_much in (8.0, 8.1):
        assert closing.less(np.full(5, too_much), first) is None
        assert GivenLoad(40.0).less(np.full(5, too_much), first) is None
    assert GivenLoad(40.0).less(PRESSURE[:5], first).total_Pa == pytest.approx(rest.total_Pa)


def test_pixels_half_as_wide_bear_the_same_load_at_the_same_place():
    finer = GIVEN.on_grid((X_M[:, :3], Y_M[:2]), 4.0)
    assert (finer.total_Pa, finer.resultant_m) == (160.0, RESULTANT_M)
    assert finer.over(np.zeros(3)).shape == (2, 3)


def test_without_a_tilt_the_level_is_the_mean_under_the_pressures():
    given, height_m = GivenLoad(40.0), np.random.default_rng(3).random(POINTS.size)
    level = given.plane(PRESSURE, height_m, POINTS)
    assert level == pytest.approx([np.average(height_m, weights=PRESSURE), 0.0, 0.0])
    assert given.over(level) == level[0]
    assert given.projector(POINTS)(PRESSURE).sum() == pytest.approx(0.0, abs=1e-12)
    moved = given.restored(PRESSURE, POINTS)
    assert moved == pytest.approx(PRESSURE * (40.0 / PRESSURE.sum()))
    assert given.plane(PRESSURE[:0], height_m[:0], POINTS[:0]) == pytest.approx(np.zeros(3))


def test_under_a_given_approach_every_pressure_is_allowed():
    given = GivenApproach(2e-7)
    assert given.over(given.plane(PRESSURE, PRESSURE, POINTS)) == 2e-7
    assert given.plane(PRESSURE, PRESSURE, POINTS)[1:].tolist() == [0.0, 0.0]
    for found in (given.projector(POINTS)(PRESSURE), given.restored(PRESSURE, POINTS)):
        assert np.array_equal(found, PRESSURE)
    assert given.less(PRESSURE, POINTS) is given.on_grid((X_M, Y_M), 4.0) is given
