"""Calls in child processes: a scan that crashes, hangs or takes all memory costs no other scan.

Each thread of an executor, here or on another machine, has a child that stays warm from call to
call. A child ends with what it started when its time is up, and when its parent ends, however that
ends: its pipe closes then.
"""

import contextlib
import logging
import os
import pickle
import queue
import shlex
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

from capslip.errors import CapslipError, SettingsError, in_one_line
from capslip.settings import Cluster

Job = TypeVar("Job", bound=tuple[Any, ...])
STARTED = b"started\n"  # said by a child when it has loaded what a call needs
MANY = 2  # calls under way for each core of a cluster, so that none waits for the next
LEAST = 200  # also where most workers have yet to come
# A child takes scan after scan: glibc keeps what it frees, instead of having the system clear every
# array again, which is a tenth of the time; arrays of more than 33 MB still go back at once
KEEPS = {"MALLOC_MMAP_THRESHOLD_": "33000000", "MALLOC_TRIM_THRESHOLD_": "200000000"}
_mine = threading.local()
_children: set["_Child"] = set()


@dataclass(frozen=True)
class Limits:
    """What one call may take.

    Attributes
    ----------
    time_s : float or None
        After so long the child is ended.
    memory_bytes : int or None
        Memory that the child cannot go beyond.
    """

    time_s: float | None = None
    memory_bytes: int | None = None


NO_LIMITS = Limits()


@dataclass(frozen=True)
class Lost:
    """What is returned for a call that did not come back, with the reason in one line."""

    reason: str
    again: bool = False  # whether it may do better with the machine to itself


ENDED = "the process that analysed this scan was ended (out of memory, or a crash in a library)"


@contextmanager
def crew(workers: int) -> Iterator[Executor]:
    """Give threads whose calls by `outcomes` run in a child each; all end with the block."""
    pool = ThreadPoolExecutor(workers)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        end = threading.Thread(target=pool.shutdown)  # when all calls have ended
        end.start()
        while end.is_alive():
            _end_children()
            end.join(0.02)
        _end_children()


@contextmanager
def cluster(wanted: str | Cluster) -> Iterator[tuple[Executor, int]]:
    """Give the workers behind a Dask scheduler, and how many calls to keep under way.

    Parameters
    ----------
    wanted : str or Cluster
        Address of the scheduler; or the jobs whose scheduler and workers are started, and end with
        the block.

    Raises
    ------
    SettingsError
        If Dask is not installed, or nothing answers there.
    """
    if isinstance(wanted, Cluster):
        with closing(jobs_of(wanted)) as jobs:
            jobs.adapt(minimum_jobs=wanted.jobs, maximum_jobs=wanted.jobs)  # ended ones come again
            with cluster(jobs.scheduler_address) as (executor, _):
                yield executor, max(LEAST, MANY * wanted.jobs * wanted.processes)
        return
    address = wanted
    try:
        from distributed import Client
    except ImportError as error:
        raise SettingsError(
            "--scheduler: needs the package distributed; pip install 'capslip[fleet]'"
        ) from error
    for name in ("distributed", "distributed.client", "distributed.utils"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what goes wrong is said once, below
    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise SettingsError(f"--scheduler {address}: nothing answers there: {error}") from error
    try:
        cores = sum(client.ncores().values())
        yield client.get_executor(pure=False), max(LEAST, MANY * cores)
    finally:
        client.close(timeout=1)


def jobs_of(wanted: Cluster) -> Any:
    """Return the dask-jobqueue cluster of some jobs; its `job_script()` is what is submitted.

    What is not in `[run.cluster]` is taken from Dask's own `jobqueue.yaml`.

    Raises
    ------
    SettingsError
        If dask-jobqueue is not installed, or the command that submits jobs is not there.
    """
    try:
        from dask_jobqueue.pbs import PBSCluster
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError as error:
        raise SettingsError(
            "run.cluster: needs the package dask-jobqueue; pip install 'capslip[fleet]'"
        ) from error
    system, submit = {"slurm": (SLURMCluster, "sbatch"), "pbs": (PBSCluster, "qsub")}[
        wanted.system or ""
    ]
    if shutil.which(submit) is None:  # else it would wait for jobs for ever
        raise SettingsError(
            f"run.cluster.system: got {wanted.system!r}; {submit} is not on the path; start the "
            "batch where jobs are submitted"
        )
    minutes, seconds = divmod(round(wanted.time_s), 60)
    return system(
        cores=wanted.processes,
        processes=wanted.processes,  # one thread each, whose calls run in a child
        memory=f"{round(1e9 * wanted.memory_GB)}B",
        walltime=f"{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}",
        job_extra_directives=list(wanted.directives),
        job_name="capslip",
        python=f"{shlex.quote(sys.executable)} -P",  # runs no module of the folder it starts in
        scheduler_options={"dashboard_address": ":0"},
    )


def outcomes(
    executor: Executor,
    work: Callable[..., Any],
    jobs: Iterable[Job],
    at_once: int,
    limits: Limits = Limits(),
) -> Iterator[tuple[Job, Any]]:
    """Call `work(*job)` for every job, each in a child of a thread; give each as it ends.

    A call that ends its child is repeated once, when it has the executor to itself.

    Parameters
    ----------
    executor : Executor
        Any: threads here, or those of a cluster.
    work : callable
        A function of a module, so that a new process can import it.
    jobs : iterable of tuple
        Its arguments; taken as they are needed.
    at_once : int
        How many calls are under way together.
    limits : Limits, optional
        Of each call.

    Yields
    ------
    (job, result)
        The result is `Lost` for a call that took too long, raised, or ended its child twice.

    Raises
    ------
    CapslipError
        If the executor gives up: the scheduler of a cluster ended.
    """
    alone: list[Job] = []
    for job, result in _in_turn(executor, work, jobs, at_once, limits):
        if isinstance(result, Lost) and result.again:
            alone.append(job)
        else:
            yield job, result
    for job, result in _in_turn(executor, work, alone, 1, limits):
        if isinstance(result, Lost) and result.again:
            result = Lost(f"{result.reason}, also when it had the machine to itself")
        yield job, result


def _in_turn(
    executor: Executor,
    work: Callable[..., Any],
    jobs: Iterable[Job],
    at_once: int,
    limits: Limits,
) -> Iterator[tuple[Job, Any]]:
    waiting, running = iter(jobs), dict[Future[Any], Job]()
    while True:
        for job in islice(waiting, at_once - len(running)):
            running[executor.submit(in_child, work, job, limits)] = job
        if not running:
            return
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            if future.cancelled():
                raise CapslipError(
                    "the scheduler of the cluster ended; the same command goes on from what is done"
                )
            error = future.exception()
            result = future.result() if error is None else Lost(in_one_line(error))
            yield running.pop(future), result


def in_child(work: Callable[..., Any], arguments: tuple[Any, ...], limits: Limits) -> Any:
    """Call `work(*arguments)` in the child of this thread; `Lost` where the child ends."""
    child: _Child | None = getattr(_mine, "child", None)
    if child is None or child.memory_bytes != limits.memory_bytes or not child.is_alive():
        if child is not None:
            child.end()
        child = _mine.child = _Child(limits.memory_bytes)
    return child.call(work, arguments, limits.time_s)


def _end_children() -> int:
    """End all children; return how many there were."""
    ended = 0
    while _children:
        with contextlib.suppress(KeyError):
            _children.pop().end()
            ended += 1
    return ended


class _Child:
    """A process that waits for calls, in a group with what it starts."""

    def __init__(self, memory_bytes: int | None) -> None:
        self.memory_bytes = memory_bytes
        path = os.pathsep.join(one for one in sys.path if one)
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "capslip.workers", str(memory_bytes or 0)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env={"OPENBLAS_NUM_THREADS": "1", **KEEPS, **os.environ, "PYTHONPATH": path},
        )
        _children.add(self)

    def is_alive(self) -> bool:
        """Tell whether the process still waits for calls."""
        return self.process.poll() is None

    def end(self) -> None:
        """End the process and what it started."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            with contextlib.suppress(OSError):
                pipe.close()  # type: ignore[union-attr]
        _children.discard(self)

    def call(
        self, work: Callable[..., Any], arguments: tuple[Any, ...], time_s: float | None
    ) -> Any:
        """Call a function there; `Lost` where the process ends before it returns."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        too_slow = threading.Event()

        def stop() -> None:
            too_slow.set()
            self.end()

        longest_s = threading.TIMEOUT_MAX  # that a thread can wait: centuries
        timer = None if time_s is None else threading.Timer(min(time_s, longest_s), stop)
        try:
            pickle.dump(pickle.dumps((work, arguments)), self.process.stdin)
            self.process.stdin.flush()
            if self.process.stdout.readline() != STARTED:
                raise EOFError
            if timer is not None:
                timer.daemon = True
                timer.start()
            returned, result = pickle.load(self.process.stdout)
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):
            self.end()
            if too_slow.is_set():
                return Lost(f"took longer than {time_s:g} s, which --timeout allows")
            return Lost(ENDED, again=True)
        finally:
            if timer is not None:
                timer.cancel()
        if not returned:
            raise result
        return result


def main(memory_bytes: int) -> None:
    """Take calls from stdin until it closes, and return their results on stdout."""
    calls, results = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    null = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):  # a library that writes to them would disturb the results
        os.dup2(null, stream)
    os.close(null)
    if memory_bytes:
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, most))
    waiting: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(calls, waiting), daemon=True).start()
    while True:
        returned: tuple[bool, Any]
        try:
            work, arguments = _load(waiting.get())
            results.write(STARTED)
            results.flush()
            returned = True, work(*arguments)
        except Exception as error:
            returned = False, error
        pickle.dump(returned, results)
        results.flush()


def _load(call: bytes) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """Return function and arguments of a call; where they cannot be loaded, one that says so."""
    try:
        work, arguments = pickle.loads(call)
    except Exception as error:
        return _raise, (error,)
    return work, arguments


def _raise(error: Exception) -> None:
    raise error


def _listen(calls: Any, waiting: "queue.SimpleQueue[bytes]") -> None:
    """Pass calls on; where they end, the parent has ended, and so does all that was started."""
    with contextlib.suppress(EOFError, OSError):
        while True:
            waiting.put(pickle.load(calls))
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    main(int(sys.argv[1]))
