"""Loops over points, compiled by Numba when they are first called.

What NumPy does well with whole arrays stays its own. A loop is compiled where each step needs the
one before (hills that grow together), or where many passes over a map become one.
"""

from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from typing import Any, Generic, ParamSpec, TypeVar

from capslip.waiting import LISTENER

_Given = ParamSpec("_Given")
_Returned = TypeVar("_Returned")


class compiled(Generic[_Given, _Returned]):
    """A function of arrays and numbers that is compiled for the types it is called with.

    The machine code is kept beside its module, or in the user's cache where that cannot be
    written, as long as the module does not change: a compiled function may call compiled functions
    of its own module, none of another. `NUMBA_DISABLE_JIT=1` runs them uncompiled, for a debugger.

    Examples
    --------
    >>> import numpy as np
    >>> @compiled
    ... def total(values):
    ...     total = 0.0
    ...     for value in values:
    ...         total += value
    ...     return total
    >>> total(np.arange(4.0))
    6.0
    """

    def __init__(self, function: Callable[_Given, _Returned]) -> None:
        self._function = function
        update_wrapper(self, function)

    def __call__(self, *given: _Given.args, **named: _Given.kwargs) -> _Returned:
        """Call the compiled function."""
        return self._loop(*given, **named)

    @cached_property
    def _loop(self) -> Any:
        from numba import njit  # a quarter of a second that help and readers do not wait for

        _tell_of_compiling()
        try:
            return njit(cache=True, error_model="numpy")(self._function)
        except RuntimeError:  # nowhere to keep it: each process compiles its own
            return njit(error_model="numpy")(self._function)

    @property
    def _numba_type_(self) -> Any:
        """What Numba takes this one for where another compiled function calls it."""
        return self._loop._numba_type_


@cache
def _tell_of_compiling() -> None:
    """Say, once, to whoever waits that loops are compiled: it happens once on a machine."""
    from numba.core import event

    class Compiling(event.Listener):
        said = False

        def on_start(self, event: Any) -> None:
            say = LISTENER.get()
            if say is not None and not self.said:
                self.said = True
                say("compiling the loops over points, once on this machine: some seconds")

        def on_end(self, event: Any) -> None:
            """Nothing is said at the end."""

    event.register("numba:compile", Compiling())
