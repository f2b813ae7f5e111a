"""What a long calculation says while it runs, to whoever listens: nobody, unless a command does."""

from collections.abc import Callable
from contextvars import ContextVar
from time import perf_counter

LISTENER: ContextVar[Callable[[str], None] | None] = ContextVar("LISTENER", default=None)
_FIRST_S, _EVERY_S = 2.0, 1.0  # by the clock, before the first line and between two


class Waiting:
    """Tells of one calculation how much is done, and about how long the rest takes."""

    def __init__(self, what: str, unit: str) -> None:
        self.what, self.unit = what, unit
        self.begun_s = perf_counter()
        self.next_s = self.begun_s + _FIRST_S

    def tell(self, done: int, of: int) -> None:
        """Tell it, where somebody listens and the last line is old enough."""
        say, now_s = LISTENER.get(), perf_counter()
        if say is None or now_s < self.next_s or done >= of:
            return
        self.next_s = now_s + _EVERY_S
        left_s = (now_s - self.begun_s) * (of - done) / done
        say(f"{self.what}: {done} of {of} {self.unit}, about {left_s:.0f} s left")
