"""The greatest steps and bends of a map, of which no closer look finds greater ones."""

import numpy as np
import pytest

from capslip.surface.heightmap import HeightMap
from capslip.surface.steps import greatest_steps_m


def greatest(height_m):
    return greatest_steps_m(HeightMap(height_m, (1e-4, 1e-4))).max(axis=1)


@pytest.mark.parametrize("rim", [1, 2, 4, 9])
@pytest.mark.parametrize("sides", [(1, 1), (1, 0), (0, 1)])
def test_a_rim_of_lost_points_hides_no_spike(rim, sides):
    height_m = np.random.default_rng(1).normal(0.0, 1e-9, (30, 40))
    height_m[12, 17] += 1e-6
    step_m, bend_m = greatest(height_m)
    assert step_m > 0.9e-6
    assert bend_m > 1.8e-6
    around = [(rim * one, rim * one) for one in sides]
    found = greatest(np.pad(height_m, around, constant_values=np.nan))
    assert (found >= (step_m, bend_m)).all()


def test_rows_without_a_measured_point_have_no_step():
    """More of them than are looked at together."""
    height_m = np.full((900, 200), np.nan)
    height_m[-3:] = 1e-3
    assert (greatest(height_m) == 0.0).all()


@pytest.mark.parametrize("level_m", [0.0, 1e-3])
def test_steps_beside_lost_points_count_at_most_twice(level_m):
    """They stand for the point before them: a smooth map stays smooth, however high it lies."""
    height_m = level_m + 1e-9 * np.arange(1200.0).reshape(30, 40) % 7e-9
    height_m[9:14, 3:30] = height_m[:3] = np.nan
    assert (greatest(height_m) < 1e-7).all()
