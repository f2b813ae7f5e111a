"""The Sobol points: those of SciPy, and even in every direction."""

import numpy as np
import pytest
from scipy.stats import qmc

from capslip.structure.sobol import MOST_DIMENSIONS, scrambled_sobol


@pytest.mark.parametrize("dimensions", range(1, MOST_DIMENSIONS + 1))
def test_the_points_are_those_of_scipy(dimensions):
    expected = qmc.Sobol(dimensions, rng=0).random_base2(9)
    assert np.array_equal(scrambled_sobol(dimensions, 9), expected)


def test_each_half_of_each_axis_holds_half_of_the_points():
    points = scrambled_sobol(MOST_DIMENSIONS, 8)
    assert ((points > 0.5).sum(axis=0) == 128).all()


@pytest.mark.parametrize("dimensions", [0, MOST_DIMENSIONS + 1])
def test_more_dimensions_than_are_known_are_refused(dimensions):
    with pytest.raises(ValueError, match="expected 1 to 16"):
        scrambled_sobol(dimensions, 4)
