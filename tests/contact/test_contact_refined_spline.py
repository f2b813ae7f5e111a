"""A spline through few solutions: as near as asked, and close only where the function bends."""

import numpy as np
import pytest

from capslip.contact.solvers.refined_spline import refined_spline

START = np.linspace(0.0, 1.0, 9)


def kinked(x):
    return np.sqrt(1.0 + x) + np.abs(x - 0.3) ** 1.5


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_it_is_as_near_as_asked_and_close_at_the_kink(tolerance):
    spline = refined_spline(kinked, START, tolerance)
    x = np.linspace(0.0, 1.0, 1001)
    assert np.abs(spline(x) - kinked(x)).max() < tolerance * kinked(x).max()
    np.testing.assert_allclose(spline(spline.x), kinked(spline.x), rtol=1e-14)
    gap = np.diff(spline.x)
    near = np.abs(spline.x[1:] - 0.3) < 0.05
    assert gap[near].min() < 0.6 * gap[~near].max()


def test_a_cubic_needs_no_more_than_the_points_between():
    asked = []

    def cubic(x):
        asked.append(x.size)
        return 2.0 * x**3 - x

    refined_spline(cubic, START, 1e-12)
    assert asked == [9, 8]


def test_each_of_several_has_its_own_tolerance():
    def both(x):
        return np.stack((x, kinked(x)), axis=-1)

    strict, lax, first = (
        refined_spline(both, START, tolerance) for tolerance in ((1e-9, 1e-6), (1e-9, 1.0), 1e-9)
    )
    assert lax.x.size == 2 * START.size - 1 < strict.x.size < first.x.size
    np.testing.assert_allclose(strict(0.77), both(np.array(0.77)), rtol=1e-6)


def test_a_jump_ends_the_halving():
    spline = refined_spline(lambda x: (x > 1 / 3).astype(float), START, 1e-9)
    assert np.diff(spline.x).min() == pytest.approx(START[1] / 2**8)
