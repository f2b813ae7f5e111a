"""Compiled loops: compiled at the first call, kept, known to one another, told of."""

import subprocess
import sys

import numpy as np

from capslip.compiled import compiled


@compiled
def squared(value):
    """Return a number times itself."""
    return value * value


@compiled
def sum_of_squares(values):
    """Return the sum of squares, by a function of this module."""
    total = 0.0
    for value in values:
        total += squared(value)
    return total


def test_a_loop_gives_what_numpy_gives_for_either_precision():
    values = np.random.default_rng(1).standard_normal(1000)
    assert np.isclose(sum_of_squares(values), np.sum(values**2), rtol=1e-13)
    single = values.astype(np.float32)
    assert np.isclose(sum_of_squares(single), np.sum(single.astype(float) ** 2), rtol=1e-6)


def test_it_keeps_its_name_and_its_words():
    assert (squared.__name__, squared.__doc__) == ("squared", "Return a number times itself.")


def test_division_by_zero_is_that_of_numpy():
    @compiled
    def over(one, other):
        return one / other

    assert over(1.0, 0.0) == np.inf


MODULE = """
from capslip.compiled import compiled

@compiled
def twice(value):
    return 2 * value

@compiled
def half(value):
    return value / 2
"""
CALL = """
import sys
sys.path.insert(0, {folder!r})
import loops
from capslip.waiting import LISTENER
assert "numba" not in sys.modules, "Numba is loaded before anything is called"
said = []
LISTENER.set(said.append)
assert loops.twice(2.5) == 5.0 and loops.half(5.0) == 2.5
print(sum(loops.twice._loop.stats.cache_hits.values()), *said)
"""


def test_loops_are_compiled_at_the_first_call_and_kept_and_who_waits_is_told_once(tmp_path):
    (tmp_path / "loops.py").write_text(MODULE)
    first, second = (
        subprocess.run(
            [sys.executable, "-c", CALL.format(folder=str(tmp_path))],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for _ in range(2)
    )
    assert first == "0 compiling the loops over points, once on this machine: some seconds"
    assert second == "1"


def test_a_loop_that_can_be_kept_nowhere_is_compiled_all_the_same():
    one_more = eval("lambda value: value + 1")  # of no file
    assert compiled(one_more)(1.5) == 2.5
