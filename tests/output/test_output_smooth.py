"""Curves of figures between their points."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from capslip.output.smooth import monotone_cubic


@pytest.mark.parametrize("kind", ["any", "rising", "plateaus"])
def test_it_is_the_interpolation_of_fritsch_and_butland(kind):
    rng = np.random.default_rng(7)
    for n in range(3, 30):
        x, y = np.cumsum(rng.uniform(0.1, 1.0, n)), rng.normal(size=n)
        y = {"any": y, "rising": np.sort(y), "plateaus": np.round(y)}[kind]
        at = np.linspace(x[0] - 0.05, x[-1] + 0.05, 101)
        expected = PchipInterpolator(x, y)(at)
        np.testing.assert_allclose(monotone_cubic(x, y, at), expected, rtol=0, atol=1e-12)


def test_between_two_points_it_is_straight():
    np.testing.assert_allclose(
        monotone_cubic(np.array([1.0, 3.0]), np.array([4.0, 0.0]), np.array([1.5, 2.0])),
        [3.0, 2.0],
    )
