"""The curve that figures draw through points, beside SciPy's."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from capslip.output.smooth import smooth


@pytest.mark.parametrize("seed", range(40))
def test_the_curve_is_that_of_scipy(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(3, 20))
    x = np.cumsum(random.uniform(0.01, 3.0, n))
    y = random.normal(size=n) if seed % 2 else np.cumsum(random.exponential(size=n))
    y[random.integers(0, n)] = y[0]  # equal neighbours, too
    at = np.concatenate([x, random.uniform(x[0], x[-1], 200)])
    np.testing.assert_allclose(
        smooth(x, y, at), PchipInterpolator(x, y)(at), rtol=1e-11, atol=1e-12
    )
