"""A call that a copy of this process makes while it goes on itself."""

import contextlib
import multiprocessing
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Generic, TypeVar

from capslip.output.renderer import cores

PATIENCE_S = 60.0  # with a copy: one that hangs costs no result
Found = TypeVar("Found")


class Aside(Generic[Found]):
    """One call on a second core, where there is one and the system can copy a process.

    Elsewhere, and where the copy gives no result, `wait` makes the call itself.

    Parameters
    ----------
    call : callable
        Without arguments; what it returns can be pickled, what else it does is lost.

    Examples
    --------
    >>> Aside(lambda: 6 * 7).wait()
    42
    """

    def __init__(self, call: Callable[[], Found]) -> None:
        self._call = call
        self._answer: Connection | None = None
        # Threads are not copied, and the locks that they hold stay locked
        if cores() < 2 or threading.active_count() > 1:
            return
        context = multiprocessing.get_context("fork")
        self._answer, answer = context.Pipe(duplex=False)
        self._process = context.Process(target=_answer, args=(call, answer), daemon=True)
        self._process.start()
        answer.close()

    def wait(self) -> Found:
        """Return what the call returns, or raise what it raises."""
        if self._answer is not None:
            with contextlib.suppress(EOFError, OSError):
                if self._answer.poll(PATIENCE_S):
                    found: Found = self._answer.recv()
                    return found
        return self._call()

    def stop(self) -> None:
        """End the copy, done or not."""
        if self._answer is not None:
            self._process.kill()
            self._process.join()
            self._answer.close()
            self._answer = None


def _answer(call: Callable[[], Found], answer: Connection) -> None:
    """Make the call in the copy; one that raises sends nothing, and is made again outside."""
    with contextlib.suppress(Exception, KeyboardInterrupt):
        answer.send(call())
