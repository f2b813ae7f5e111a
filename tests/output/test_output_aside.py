"""What a copy of the process does, and the smooth line of the figures."""

import os

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from capslip.output import aside
from capslip.output.aside import Aside
from capslip.output.bend import bent


@pytest.fixture(params=[1, 2])
def cores(request, monkeypatch):
    """Whether there is a core for a copy."""
    monkeypatch.setattr(aside, "cores", lambda: request.param)
    return request.param


def test_a_call_is_made_by_a_copy_where_there_is_a_core_for_it(cores):
    call = Aside(os.getpid)
    assert (call.wait() == os.getpid()) == (cores == 1)
    call.stop()


def test_what_a_call_raises_is_raised(cores):
    call = Aside(lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        call.wait()
    call.stop()


def test_a_copy_that_ends_without_an_answer_costs_none(cores):
    me = os.getpid()
    call = Aside(lambda: 6 * 7 if os.getpid() == me else os._exit(1))
    assert call.wait() == 42
    call.stop()
    call.stop()


@pytest.mark.parametrize("n", [2, 3, 4, 30])
@pytest.mark.parametrize("rises", [False, True])
def test_the_line_through_points_is_that_of_scipy(n, rises):
    rng = np.random.default_rng(n)
    for _ in range(50):
        x, y = np.cumsum(rng.random(n) + 0.01), rng.standard_normal(n)
        y = np.cumsum(np.abs(y)) if rises else y
        at = np.linspace(x[0], x[-1], 301)
        found = bent(x, y, at)
        np.testing.assert_allclose(found, PchipInterpolator(x, y)(at), atol=1e-9 * np.ptp(y))
        assert found.min() >= y.min() - 1e-12
        assert found.max() <= y.max() + 1e-12
