"""What a copy of the process does."""

import os
import time

import pytest

from capslip.output import aside
from capslip.output.aside import Aside


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


def test_a_copy_that_hangs_costs_none(cores, monkeypatch):
    monkeypatch.setattr(aside, "PATIENCE_S", 0.2)
    me = os.getpid()
    call = Aside(lambda: 6 * 7 if os.getpid() == me else time.sleep(60))
    assert call.wait() == 42
    call.stop()
