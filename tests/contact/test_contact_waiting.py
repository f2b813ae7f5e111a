"""What boundary elements say while they follow slip, and to whom."""

import io
import re

import numpy as np
import pytest

from capslip import waiting
from capslip.compare.identification import friction_and_preload
from capslip.compare.model import JointModel
from capslip.console import Progress
from capslip.contact.models.families import families
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.contact.solvers.unloading import unload
from capslip.surface.heightmap import HeightMap


@pytest.fixture
def heard():
    """Collect what is said; afterwards nobody listens."""
    lines = []
    token = waiting.LISTENER.set(lines.append)
    yield lines
    waiting.LISTENER.reset(token)


def follow_slip(monkeypatch, step_s):
    """Follow the slip of a sphere by a clock on which each look takes the same time."""
    looks = iter(range(10_000))
    monkeypatch.setattr(waiting, "perf_counter", lambda: step_s * next(looks))
    y, x = np.mgrid[-20:20, -20:20] * 1e-5
    face = elastic_face(HeightMap(-(x**2 + y**2) / 2 / 0.5, (1e-5, 1e-5)), 110e9)
    return unload(face, press(face, load_N=0.2), 1e-7)


def test_slip_tells_how_many_loads_are_left(monkeypatch, heard):
    found = follow_slip(monkeypatch, 0.75)
    words = r"boundary elements: (\d+) of (\d+) loads, about (\d+) s left"
    told = [re.fullmatch(words, line).groups() for line in heard]
    done, of, left_s = np.array(told, dtype=float).T
    n_solved = len(found.solved_load_N) - 1
    assert len(told) >= 4
    assert set(np.diff(done)) <= {1.0, 2.0}  # after one second, which is two looks
    assert (done < of).all()
    assert of.max() <= n_solved
    # One look for each load; the first load is solved before, and one look is at the intervals.
    assert np.allclose(left_s * done / (of - done), 0.75 * done, atol=0.75 + 0.5 * done)


def test_what_takes_less_than_two_seconds_says_nothing(monkeypatch, heard):
    follow_slip(monkeypatch, 0.01)
    assert heard == []


def test_figures_say_how_many_are_left_once_they_take_longer(monkeypatch, heard, tmp_path):
    from capslip.output import folder

    monkeypatch.setattr(waiting, "perf_counter", iter(np.arange(0.0, 9.0, 2.25)).__next__)
    monkeypatch.setattr(folder.all_figures, "write_figure", lambda *_: None)
    said = []
    parts = folder._Parts(None, tmp_path, {}, said.append, lambda *_: None)
    parts.draw_figures(("a", "b", "c", "d", "e", "f"), tmp_path)
    assert said == ["drawing"]
    assert heard == [
        "drawing: 3 of 6 figures, about 2 s left",
        "drawing: 5 of 6 figures, about 1 s left",
    ]


def test_an_identification_says_how_many_preloads_and_fits_are_left(monkeypatch, heard):
    model = JointModel(lambda _: families(5, 23.8, 0, 109.89e9), 1.21, 1.8e8, 9.9e7, 2, trials=6)
    amplitude_m = model.gross_slip_amplitude_m(0.2, 460.0) * np.geomspace(0.1, 0.9, 6)
    measured = model.loss_factor(amplitude_m, 0.2, 460.0)
    looks = iter(range(10_000))
    monkeypatch.setattr(waiting, "perf_counter", lambda: 2.25 * next(looks))
    friction_and_preload(amplitude_m, measured, model, 460.0)
    assert heard[:5] == [
        f"identification: {done} of 6 preloads, about {2.25 * (6 - done):.0f} s left"
        for done in range(1, 6)
    ]
    assert all(re.fullmatch(r"identification: \d of \d fits, .*", line) for line in heard[5:])


@pytest.mark.parametrize(
    ("quiet", "terminal", "listens"),
    [(False, True, True), (True, True, False), (False, False, False)],
)
def test_a_command_listens_on_a_terminal_alone(quiet, terminal, listens, monkeypatch, heard):
    stream = io.StringIO()
    stream.isatty = lambda: terminal
    monkeypatch.setattr("sys.stderr", stream)
    say = Progress(quiet)
    assert waiting.LISTENER.get() is (say if listens else None)
