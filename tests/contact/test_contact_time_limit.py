"""contact.time_limit_s: it bounds every solution, counts for each preload, and leaves an error."""

from dataclasses import replace
from threading import Thread
from time import thread_time

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip import analyze, load_settings
from capslip.contact import map_accuracy, map_curve
from capslip.contact.models import boundary_elements as model
from capslip.contact.solvers import (
    detail,
    path,
    polonsky_keer,
    rough_inverse,
    solutions,
    steps,
    unloading,
)
from capslip.contact.solvers.closing import GivenLoad, GivenResultant
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.contact.solvers.tilting import press_balanced
from capslip.errors import ContactError, OutOfTimeError
from capslip.surface.heightmap import HeightMap

pytestmark = pytest.mark.usefixtures("fewer_points")  # of any face, time runs alike
E = 110e9
LOAD_N = 200.0
LATE = "contact.time_limit_s=12"  # by the clock below
SHARES = np.array([0.1, 0.25, 0.5, 0.75])


def wavy(seed=1, shape=(64, 72)):
    height_m = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), 5.0)
    return HeightMap(4e-7 * height_m / height_m.std(), (1e-4, 1e-4))


class Ticking:
    """A clock on which every look takes the same time."""

    def __init__(self, step_s):
        self.step_s, self.looks = step_s, 0

    def __call__(self):
        self.looks += 1
        return self.step_s * self.looks


@pytest.fixture
def slow(monkeypatch):
    """Let every iteration take two seconds of the processor."""
    clock = Ticking(2.0)
    monkeypatch.setattr(polonsky_keer, "thread_time", clock)
    return clock


@pytest.mark.parametrize("solve", [press, press_balanced])
@pytest.mark.parametrize(("limit_s", "most"), [(1e-3, 5.0), (12.0, 12.0)])
def test_a_solution_is_given_up_when_its_time_is_over(solve, limit_s, most, slow):
    with pytest.raises(OutOfTimeError, match=r"contact\.time_limit_s was over; allow more"):
        solve(elastic_face(wavy(), E), load_N=LOAD_N, time_limit_s=limit_s)
    assert slow.looks * slow.step_s == pytest.approx(most, abs=2 * slow.step_s)


def test_a_limit_that_is_not_reached_changes_nothing(slow):
    found = press(elastic_face(wavy(), E), load_N=LOAD_N, time_limit_s=1e4)
    free = press(elastic_face(wavy(), E), load_N=LOAD_N)
    assert np.array_equal(found.pressure_Pa, free.pressure_Pa)


def test_caps_stand_in_for_a_map_that_takes_too_long_and_say_so(slow):
    given = (f"contact.preload_N={LOAD_N}", "run.sensitivity=false", LATE)
    found = analyze(wavy(), load_settings(overrides=given))
    assert found.contact.rung.made_from == "spheres"
    said = {p.code: p for p in found.problems if p.severity == "warning"}
    assert "when contact.time_limit_s was over" in said["boundary_elements_needed"].message
    assert "contact.time_limit_s" in said["boundary_elements_needed"].advice  # not the map again


def test_boundary_elements_that_are_asked_for_fail_when_their_time_is_over(slow):
    given = (f"contact.preload_N={LOAD_N}", "contact.model=boundary_elements", LATE)
    found = analyze(wavy(), load_settings(overrides=given))
    assert found.summary()["status"] == "failed"
    said = {p.code: p for p in found.problems if p.severity == "error"}
    assert "when contact.time_limit_s was over" in said["contact_failed"].message


def test_the_limit_counts_for_each_preload(monkeypatch):
    """What the first one took is gone for it, whatever happens in between, and for it alone."""
    clock = Ticking(1.0)
    monkeypatch.setattr(solutions, "thread_time", clock)
    monkeypatch.setattr(model, "thread_time", clock)
    limit = {"time_limit_s": 60.0}
    curve = model.boundary_elements(wavy(), E, preload_N=LOAD_N, balanced=True, **limit)
    found = curve.solutions
    assert found.left_s(LOAD_N) == 59.0
    curve.unloading(LOAD_N)
    assert found.left_s(LOAD_N) == 58.0
    clock.looks += 1000
    assert found.left_s(LOAD_N) == 58.0
    assert found.left_s(0.9 * LOAD_N) == 60.0
    curve.pressed(0.9 * LOAD_N)
    assert (found.left_s(0.9 * LOAD_N), found.left_s(LOAD_N)) == (59.0, 58.0)


def test_the_work_of_other_threads_does_not_count():
    """Libraries of matrices have as many as there are cores: on 64 a minute would be a second."""

    def work():
        until_s = thread_time() + 0.3
        while thread_time() < until_s:
            pass

    found = model.boundary_elements(wavy(), E, time_limit_s=60.0).solutions
    with found.counted(LOAD_N):
        other = Thread(target=work)
        other.start()
        other.join()
    assert found.left_s(LOAD_N) > 59.8


def working(monkeypatch, setting_up_s, load_s):
    """Let the clock of a curve go on by its work alone: what comes before its loads, and each."""
    now = [0.0]

    class Timed(unloading.Path):
        def __init__(self, *given):
            super().__init__(*given)
            now[0] += setting_up_s

        def solve(self, odd):
            now[0] += load_s
            return super().solve(odd)

    monkeypatch.setattr(unloading, "Path", Timed)
    monkeypatch.setattr(unloading, "thread_time", lambda: now[0])
    return now


def followed(limit_s):
    face = elastic_face(wavy(), E)
    return unloading.unload(face, press(face, load_N=LOAD_N), 1e-6, time_limit_s=limit_s)


def test_what_comes_before_the_loads_below_a_preload_is_no_part_of_their_price(monkeypatch):
    """All of them fit in, however long the patches took: none is left out, and none is missed."""
    free = followed(np.inf)
    n_loads = len(free.solved_load_N) - 1  # the preload was solved before
    working(monkeypatch, 10.0, 1.0)
    found = followed(12.0 + n_loads)
    assert not found.cut_short
    assert np.array_equal(found.solved_load_N, free.solved_load_N)


@pytest.mark.parametrize("limit_s", [11.0, 16.0, 20.0])
def test_loads_end_with_their_time(monkeypatch, limit_s):
    now = working(monkeypatch, 10.0, 1.0)
    found = followed(limit_s)
    assert found.cut_short
    assert now[0] == max(limit_s, 15.0)  # five loads at least


def test_a_clock_that_has_not_moved_is_no_failure(monkeypatch):
    working(monkeypatch, 0.0, 0.0)
    assert not followed(10.0).cut_short


def test_the_load_at_an_approach_is_sought_within_one_limit(monkeypatch):
    """With a spring in series it takes several solutions, each of which had the whole limit."""
    monkeypatch.undo()  # more points take more of them
    found = model.boundary_elements(wavy(), E)
    soft = replace(found, compliance_m_per_N=2.0 / float(found.stiffness_N_per_m(4e-7)))

    def searched(limit_s):
        clock = Ticking(1.0)
        for room in (polonsky_keer, map_curve, solutions):
            monkeypatch.setattr(room, "thread_time", clock)
        fresh = solutions.Solutions(found.solutions.face, 1e-7, limit_s)
        curve = replace(soft, solutions=fresh)
        try:
            load_N = float(curve.load_N(1e-6))
            return load_N, clock.looks, curve.solutions
        except OutOfTimeError as error:
            return str(error), clock.looks, curve.solutions

    load_N, took_s, free = searched(np.inf)
    assert free.spent_s[load_N] == pytest.approx(took_s, abs=2.0)
    assert len(free.approach_m) > 2  # solutions, none of which takes half of it
    said, ended_s, _ = searched(0.7 * took_s)
    assert "contact.time_limit_s was over; allow more" in said
    # One that has begun has its least, and looks at the clock once more
    assert ended_s <= 0.7 * took_s + polonsky_keer._LEAST_S + 1.0
    assert searched(1.5 * took_s)[0] == load_N
    assert searched(1e-9)[1] < 0.5 * took_s  # the first has some seconds, and no other begins


@pytest.mark.parametrize("shares", [(), (0.2, 0.5)])
@pytest.mark.parametrize("refined", [False, True])
def test_a_load_below_a_preload_is_given_up_when_its_time_is_over(shares, refined, monkeypatch):
    """They ran without end, however small the limit was."""
    face = elastic_face(wavy(), E)
    pressed = press(face, load_N=LOAD_N)
    path_of, clock = unloading.Path.__init__, Ticking(2.0)

    def ready(self, *given):
        path_of(self, *given)
        if not refined:  # the way to the first load takes none of the time
            self.until_s, clock.looks = 12.0, 0
            for room in (polonsky_keer, path):
                monkeypatch.setattr(room, "thread_time", clock)

    monkeypatch.setattr(unloading.Path, "__init__", ready)
    if refined:
        for room in (polonsky_keer, path):
            monkeypatch.setattr(room, "thread_time", clock)
        monkeypatch.setattr(path, "refinement", lambda *_: 2)
    with pytest.raises(OutOfTimeError, match="was over; allow more"):
        unloading.unload(face, pressed, 1e-9, give_up_s=-1e9, force_shares=shares)
    assert clock.looks * 2.0 <= 12.0 + 5.0 + 4.0


def test_loads_that_were_solved_before_the_time_was_over_are_kept(monkeypatch):
    free, solve, solved = followed(np.inf), unloading.Path.solve, []

    def late(self, odd):
        if len(self.nodes) > 10:
            raise OutOfTimeError("late")
        solved.append(odd)
        return solve(self, odd)

    monkeypatch.setattr(unloading.Path, "solve", late)
    found = followed(np.inf)
    assert found.cut_short
    assert not free.cut_short
    assert len(found.solved_load_N) - 1 == len(solved) == 11
    assert len(free.solved_load_N) > 12


@pytest.mark.parametrize("seed", [1, 2])
def test_a_curve_that_is_cut_short_has_an_error_that_holds(seed):
    full, short = (
        model.boundary_elements(wavy(seed), E, time_limit_s=limit_s) for limit_s in (np.inf, 1e-9)
    )
    assert short.unloading(LOAD_N).cut_short
    assert not full.unloading(LOAD_N).cut_short
    errors, said = model.RUNG.error(short, LOAD_N, 0.05)
    assert errors.energy == max(short.unloading(LOAD_N).loss_error, map_accuracy.LEAST_ERROR)
    truth_J, found_J = (
        one.loss_integral_at_drop_J(float(one.approach_m(LOAD_N)), SHARES * LOAD_N)
        for one in (full, short)
    )
    assert (np.abs(found_J / truth_J - 1) < errors.energy).all()
    assert {p.code for p in said} <= {"loss_between_loads"}
    assert all("time_limit_s" in p.remedy for p in said)  # more time helps
    (late,) = (p for p in short.problems(LOAD_N) if p.code == "time_limit_reached")
    assert late.message.endswith("and what the finest detail of the map decides is not known")


@pytest.mark.parametrize(("limit_s", "spent_s"), [(32.0, 16.0), (1e3, None)])
def test_the_half_that_loads_leave_is_for_what_detail_decides(monkeypatch, limit_s, spent_s):
    """It was said to be over when half of it was, and nobody looked at the detail."""
    now = working(monkeypatch, 10.0, 1.0)
    monkeypatch.setattr(solutions, "thread_time", lambda: now[0])
    ends, path_at = [], detail.path_at

    def seen(*given, until_s, **more):
        ends.append(until_s)
        return path_at(*given, until_s=until_s, **more)

    monkeypatch.setattr(detail, "path_at", seen)
    curve = model.boundary_elements(wavy(), E, time_limit_s=limit_s)
    errors, said = model.RUNG.error(curve, LOAD_N, 0.05)
    assert curve.unloading(LOAD_N).cut_short == (spent_s is not None)
    assert ends  # the map without its detail was unloaded, too
    assert errors.doubts_at is not None
    assert "time_limit_reached" not in {p.code for p in said}
    late = [p for p in curve.problems(LOAD_N) if p.code == "time_limit_reached"]
    if spent_s is None:
        assert not late
        assert ends == len(ends) * [np.inf]
        return
    (one,) = late
    assert one.message.startswith("16 s of the 32 s of contact.time_limit_s were spent after 6 lo")
    assert "detail" not in one.message
    assert all(end_s - thread_time() <= limit_s - spent_s for end_s in ends)


def test_detail_for_which_the_half_that_is_left_is_too_short_is_said(monkeypatch):
    now = working(monkeypatch, 10.0, 1.0)
    monkeypatch.setattr(solutions, "thread_time", lambda: now[0])

    def late(*given, until_s, **more):
        raise OutOfTimeError("late")

    monkeypatch.setattr(detail, "path_at", late)
    curve = model.boundary_elements(wavy(), E, time_limit_s=32.0)
    errors, said = model.RUNG.error(curve, LOAD_N, 0.05)
    (one,) = (p for p in said if p.code == "time_limit_reached")
    assert one.message.startswith("32 s of contact.time_limit_s were over before the map was press")
    assert errors.energy >= curve.unloading(LOAD_N).loss_error


def test_where_there_was_time_for_all_loads_more_of_it_is_no_advice():
    """Single pixels let go between two loads of a contact of a few: smaller ones tell."""
    curve = model.boundary_elements(wavy(), E)
    found = replace(curve.unloading(LOAD_N), loss_error=0.2)
    curve.solutions.unloading[LOAD_N] = found
    _, said = model.RUNG.error(curve, LOAD_N, 0.05)
    (one,) = (p for p in said if p.code == "loss_between_loads")
    assert one.remedy == "Scan with smaller pixels, or ask at a greater force."
    assert f"20.0% between the {len(found.solved_load_N)} loads" in one.message


def test_detail_that_is_out_of_time_is_a_warning_and_leaves_the_error_between_loads(monkeypatch):
    monkeypatch.undo()  # on fewer points pixels leave more than is between loads

    def late(*given, **more):
        raise OutOfTimeError("late")

    monkeypatch.setattr(map_accuracy, "effect_of_detail", late)
    curve = model.boundary_elements(wavy(), E, time_limit_s=60.0)
    errors, said = model.RUNG.error(curve, LOAD_N, 0.05)
    assert errors.energy == max(curve.unloading(LOAD_N).loss_error, map_accuracy.LEAST_ERROR)
    assert [p.code for p in said] == ["time_limit_reached"]
    assert "60 s of contact.time_limit_s were over before" in said[0].message


def test_an_analysis_that_is_cut_short_has_an_interval():
    given = ("contact.model=boundary_elements", "contact.time_limit_s=1e-3")
    settings = load_settings(overrides=(f"contact.preload_N={LOAD_N}", *given))
    summary = analyze(wavy(), settings).summary()
    assert "time_limit_reached" in {p["code"] for p in summary["problems"]}
    assert summary["accuracy"]["estimated"] > 0.0
    assert summary["answer"]["interval"]["energy_J"][1] > summary["answer"]["energy_J"] > 0.0


@pytest.mark.parametrize("solve", [press, press_balanced])
@pytest.mark.parametrize("hardness_Pa", [np.inf, 4e8])
@pytest.mark.parametrize("after", [0, 3])
def test_a_solution_whose_numbers_are_lost_ends_at_once(solve, hardness_Pa, after, monkeypatch):
    """No comparison tells a NaN: it took all steps there are, or hung, or came out as found."""
    face = replace(elastic_face(wavy(), E), hardness_Pa=hardness_Pa)
    calls, inverse = [], rough_inverse.RoughInverse.pressure_Pa

    def lost(self, sinking_m, points):
        calls.append(len(points))
        found = inverse(self, sinking_m, points)
        return found * np.nan if len(calls) > after else found

    monkeypatch.setattr(rough_inverse.RoughInverse, "pressure_Pa", lost)
    with pytest.raises(ContactError, match="are no numbers any more; check heights"):
        solve(face, load_N=LOAD_N)
    assert len(calls) == after + 1


def test_a_step_that_cannot_be_brought_back_is_none_after_some_halves(monkeypatch):
    """Before a pressure of next to nothing is kept, it would be halved a thousand times."""
    tried, p = [], np.array([1.0, 1e-300])
    monkeypatch.setattr(steps, "bounded", lambda *_: tried.append(1))
    given = (p, np.arange(2), np.array([-1.0, 1.0]), 1.0, GivenLoad(1.0), np.inf)
    stepped, cut = steps._stepped(*given)
    assert np.array_equal(stepped, p)
    assert cut
    assert len(tried) == 60


def test_pressures_that_are_no_numbers_are_bounded_no_longer():
    class Lost(GivenLoad):
        turns = 0

        def less(self, pressure, points):
            return self

        def restored(self, pressure, points):
            Lost.turns += 1
            assert Lost.turns < 5, "it goes on"
            return pressure * np.nan

    pressure_Pa = np.array([1.0, 2.0, 3.0])
    assert np.isnan(steps.bounded(pressure_Pa, np.arange(3), Lost(7.0), 2.5)).any()


def test_pressures_that_no_closing_allows_are_told():
    """They were taken for numbers, which none is."""
    face = elastic_face(wavy(), E)
    none = GivenResultant(1e9, face.places_m, (1.0, 1.0))  # beside the map
    with pytest.raises(ContactError, match="no pressures up to the hardness have this load"):
        polonsky_keer.solve(face, none, 1e-7, np.ones(face.shape))


def test_no_solution_begins_when_the_time_of_several_is_over(monkeypatch):
    """Each may be found at once, without a step: none begins when the time is over."""
    monkeypatch.setattr(polonsky_keer, "thread_time", Ticking(2.0))
    face = elastic_face(wavy(), E)
    levelled = press(face, load_N=LOAD_N)
    state, _ = polonsky_keer.solve(
        face, GivenLoad(LOAD_N / face.pixel_area_m2), 1e-7, levelled.pressure_Pa, np.inf
    )
    assert state.fulfils(1e-7)
    with pytest.raises(OutOfTimeError, match="after 0 iterations"):
        polonsky_keer.solve(
            face, GivenLoad(LOAD_N / face.pixel_area_m2), 1e-7, levelled.pressure_Pa, 1.0
        )


def test_a_certificate_that_is_no_number_is_none():
    face = elastic_face(wavy(), E)
    found = press(face, load_N=LOAD_N)
    p = found.pressure_Pa
    state = polonsky_keer.State(
        p, found.gap_m, found.approach_m, (0.0, 0.0), np.flatnonzero(p), 0.0, 0.0
    )
    assert polonsky_keer.certified(face, state, LOAD_N, 1).load_N == LOAD_N
    for moments in ((np.nan, 0.0), (0.0, np.nan), (1e-8, 0.0)):
        with pytest.raises(ContactError, match="does not balance its load"):
            polonsky_keer.certified(face, state, LOAD_N, 1, moments)
