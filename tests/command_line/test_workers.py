"""Calls in child processes: warm, apart from each other, and each with its outcome."""

import operator
import os
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future
from types import SimpleNamespace

import pytest
from fleet_cases import children_of, gone

from capslip import workers
from capslip.errors import CapslipError
from capslip.settings import Cluster
from capslip.workers import Limits, Lost, crew, outcomes


def every(work, jobs, n_workers=1, **limits):
    with crew(n_workers) as pool:
        found = list(outcomes(pool, work, jobs, n_workers, Limits(**limits)))
    assert not workers._children
    return dict(found)


def own_number(_):
    os.write(1, b"noise")
    return os.getpid()


def test_a_child_stays_for_the_next_call_and_is_not_this_process():
    found = every(own_number, [(i,) for i in range(5)])
    assert len(set(found.values())) == 1
    assert os.getpid() not in found.values()


def meet(folder, mine, other):
    """Wait for a call that runs at the same time."""
    (folder / mine).touch()
    end_s = time.monotonic() + 30
    while not (folder / other).exists():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.01)
    return True


def test_as_many_run_at_once_as_there_are_workers(tmp_path):
    found = every(meet, [(tmp_path, "a", "b"), (tmp_path, "b", "a")], n_workers=2)
    assert all(found.values())


def divide(value):
    return 1 / value


def test_what_raises_is_lost_and_the_rest_is_not():
    found = every(divide, [(1,), (0,), (2,)])
    assert (found[1,], found[2,]) == (1.0, 0.5)
    assert "ZeroDivisionError" in found[0,].reason


@pytest.mark.filterwarnings("error")  # of a thread that ends with an exception
@pytest.mark.parametrize("time_s", [threading.TIMEOUT_MAX, 1e10, 1e300])
def test_a_time_that_no_thread_can_wait_is_a_limit_that_never_ends_a_call(monkeypatch, time_s):
    waits, timer = [], threading.Timer

    def remembered(wait_s, stop):
        waits.append(wait_s)
        return timer(wait_s, stop)

    monkeypatch.setattr(threading, "Timer", remembered)
    assert every(divide, [(2,)], time_s=time_s) == {(2,): 0.5}
    assert waits == [threading.TIMEOUT_MAX]


def test_one_byte_is_too_little_for_any_call():
    (lost,) = every(divide, [(2,)], memory_bytes=1).values()
    assert "out of memory" in lost.reason


class Nowhere:
    """Names a function that no module holds."""

    def __reduce__(self):
        return operator.attrgetter("no_such_function"), (None,)


def test_what_cannot_be_loaded_there_is_lost():
    (lost,) = every(divide, [(Nowhere(),)]).values()
    assert "no_such_function" in lost.reason


def die_first(folder, name):
    mark = folder / name
    if not mark.exists():
        mark.touch()
        os._exit(1)
    return "second"


@pytest.mark.long
def test_a_call_that_ends_its_child_is_repeated_once(tmp_path):
    assert every(die_first, [(tmp_path, "a"), (tmp_path, "b")], n_workers=2) == {
        (tmp_path, "a"): "second",
        (tmp_path, "b"): "second",
    }


def always_die(_):
    os._exit(1)


@pytest.mark.long
def test_a_call_that_ends_its_child_twice_is_lost():
    (lost,) = every(always_die, [(1,)]).values()
    assert "was ended" in lost.reason
    assert "machine to itself" in lost.reason


def test_time_counts_from_the_call_not_from_the_start_of_the_child():
    found = every(time.sleep, [(0.01,), (60,), (0.02,)], time_s=0.3)
    assert [isinstance(one, Lost) for one in found.values()] == [False, True, False]
    assert "--timeout" in found[60,].reason


def test_jobs_are_taken_as_they_are_needed():
    taken = []

    def jobs():
        for value in range(1, 100):
            taken.append(value)
            yield (value,)

    with crew(2) as pool:
        found = outcomes(pool, divide, jobs(), 2)
        for _ in range(3):
            next(found)
        assert len(taken) <= 5


def test_an_end_in_the_middle_ends_the_children():
    started_s = time.monotonic()
    with crew(2) as pool:
        found = outcomes(pool, time.sleep, [(0.0,), (60,), (60,)], 2)
        next(found)
    assert time.monotonic() - started_s < 10
    assert not workers._children


def test_a_child_ends_with_its_parent_however_that_ends(tmp_path):
    code = (
        "import os; from capslip.workers import NO_LIMITS, in_child\n"
        "in_child(os.system, ('touch begun; exec sleep 60',), NO_LIMITS)"
    )
    mark = f"FLEET_MARK={tmp_path}"
    environment = {**os.environ, "FLEET_MARK": str(tmp_path)}
    parent = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, env=environment)
    end_s = time.monotonic() + 30
    while not (tmp_path / "begun").exists() and time.monotonic() < end_s:
        time.sleep(0.05)
    assert len(children_of(mark)) >= 3  # with what the child started
    parent.kill()
    parent.wait()
    assert gone(mark, 5.0)


class AtOnce(Executor):
    """Runs each call when it is given, and remembers how many were."""

    def __init__(self):
        self.given = []

    def submit(self, function, /, *arguments):
        assert function is workers.in_child
        self.given.append(arguments)
        found = Future()
        try:
            found.set_result(function(*arguments))
        except Exception as error:
            found.set_exception(error)
        return found


def test_what_ended_its_child_is_repeated_last_with_the_machine_to_itself(monkeypatch):
    ends = {1: [Lost("ended", again=True), Lost("ended", again=True)]}
    ends |= {2: [Lost("ended", again=True), "second"], 3: [Lost("too slow")], 4: ["first"]}
    monkeypatch.setattr(workers, "in_child", lambda work, job, limits: ends[job[0]].pop(0))
    executor, limits = AtOnce(), Limits(3.0)
    found = dict(outcomes(executor, divide, [(i,) for i in (1, 2, 3, 4)], 4, limits))
    again = Lost("ended, also when it had the machine to itself")
    assert found == {(1,): again, (2,): "second", (3,): Lost("too slow"), (4,): "first"}
    assert set(list(found)[-2:]) == {(1,), (2,)}
    assert executor.given[:4] == [(divide, (i,), limits) for i in (1, 2, 3, 4)]
    assert {job for _, job, _ in executor.given[4:]} == {(1,), (2,)}
    assert len(executor.given) == 6


class Waits(AtOnce):
    """Ends one call at a time, the last that was given first."""

    def __init__(self):
        super().__init__()
        self.most, self.open = 0, []

    def submit(self, function, /, *arguments):
        self.open.append(found := Future())
        self.most = max(self.most, len(self.open))
        return found


@pytest.mark.parametrize("at_once", [1, 3])
def test_no_more_calls_are_under_way_than_were_allowed(at_once, monkeypatch):
    executor = Waits()

    def first_done(running, return_when):
        one = executor.open.pop()
        one.set_result("done")
        return SimpleNamespace(done={one})

    monkeypatch.setattr(workers, "wait", first_done)
    jobs = [(i,) for i in range(7)]
    found = dict(outcomes(executor, divide, jobs, at_once))
    assert found == dict.fromkeys(jobs, "done")
    assert executor.most == at_once


def test_a_scheduler_that_cancels_its_calls_has_ended():
    class Cancels(AtOnce):
        def submit(self, function, /, *arguments):
            found = Future()
            found.cancel()
            found.set_running_or_notify_cancel()
            return found

    with pytest.raises(CapslipError, match="scheduler of the cluster ended"):
        list(outcomes(Cancels(), divide, [(1,)], 1))


@pytest.mark.parametrize(("cores", "at_once"), [((4, 2), 200), ((100, 50), 300)])
def test_a_cluster_has_two_calls_for_each_core_under_way_and_enough_for_those_to_come(
    cores, at_once, monkeypatch
):
    closed = []
    client = SimpleNamespace(
        ncores=lambda: dict(enumerate(cores)),
        get_executor=lambda pure: ("executor", pure),
        close=lambda timeout: closed.append(timeout),
    )
    asked = []
    distributed = SimpleNamespace(Client=lambda *at, **of: asked.append((at, of)) or client)
    monkeypatch.setitem(sys.modules, "distributed", distributed)
    with workers.cluster("tcp://x") as found:
        assert closed == []
    assert found == (("executor", False), at_once)
    assert asked == [(("tcp://x",), {"timeout": "10s", "set_as_default": False})]
    assert closed == [1]
    jobs = SimpleNamespace(scheduler_address="tcp://y", close=lambda: closed.append("jobs"))
    jobs.adapt = lambda **of: asked.append(of)
    monkeypatch.setattr(workers, "jobs_of", lambda wanted: jobs)
    with workers.cluster(Cluster(system="slurm", jobs=30, processes=8)) as found:
        assert found == (("executor", False), 2 * 30 * 8)
    assert asked[1] == {"minimum_jobs": 30, "maximum_jobs": 30}
    assert asked[2][0] == ("tcp://y",)
    assert closed[1:] == [1, "jobs"]
