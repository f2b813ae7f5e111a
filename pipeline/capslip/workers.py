"""Jobs in worker processes: one that kills its worker is named, and costs no other job."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

Job = TypeVar("Job", bound=tuple[Any, ...])
Result = TypeVar("Result")


def outcomes(
    work: Callable[..., Result], jobs: Sequence[Job], workers: int, lost: Result
) -> Generator[tuple[Job, Result], None, None]:
    """Call `work(*job)` for every job in worker processes; give each as it ends.

    A worker that is killed or crashes takes its whole pool along. The jobs that were in work are
    then repeated one by one, each in a pool of its own, and the rest goes on in a new pool.

    Parameters
    ----------
    work : callable
        A function of a module, so that a new process can import it.
    jobs : sequence of tuple
        Its arguments.
    workers : int
        How many processes.
    lost : Result
        What is given for a job that ends its worker again when it is alone.
    """
    waiting = list(reversed(jobs))
    while waiting:
        running: dict[Future[Result], Job] = {}
        with _pool(min(workers, len(waiting))) as pool:
            try:
                while waiting or running:
                    while waiting and len(running) < workers:  # so that all of them are in work
                        running[pool.submit(work, *waiting[-1])] = waiting[-1]
                        waiting.pop()
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        result = future.result()
                        yield running.pop(future), result
            except BrokenProcessPool:
                pass
        for job in running.values():
            with _pool(1) as pool:
                try:
                    result = pool.submit(work, *job).result()
                except BrokenProcessPool:
                    result = lost
            yield job, result


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of new processes; an interrupt ends what they do, and waits for them."""
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), initializer=_begin_worker
    )
    try:
        yield pool
    except BaseException:
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _begin_worker() -> None:
    """Leave the terminal to the parent; end by an exception, so that folders under way go."""
    null = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):  # a library that writes to them would disturb the parent's output
        os.dup2(null, stream)
    os.close(null)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)


def _end(*_: object) -> None:
    raise SystemExit(1)
