"""The one clock of the studies, and the machine that it runs on."""

import os
import platform
import time
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np


def clocks() -> np.ndarray:
    """Return the time, and the processor time of this process and of children that have ended."""
    of_children = os.times()
    worked_s = time.process_time() + of_children.children_user + of_children.children_system
    return np.array([time.perf_counter(), worked_s])


def in_turns(
    functions: Sequence[Callable[[], Any]],
    turns: int,
    *,
    warm_up: int = 0,
    enough_s: float = np.inf,
) -> tuple[np.ndarray, list[Any]]:
    """Call functions in turns, so that whatever else the machine does slows all of them alike.

    Parameters
    ----------
    functions : sequence of callable
        What is compared.
    turns : int
        Calls of each that count.
    warm_up : int
        Calls of each before those.
    enough_s : float
        No further turn after one that took longer.

    Returns
    -------
    float64, shape (turns, functions, 2)
        Seconds of each call by the two clocks.
    list
        What each function returned in the last turn.

    Examples
    --------
    >>> times_s, found = in_turns([lambda: 1, lambda: 2], 3)
    >>> times_s.shape, found
    ((3, 2, 2), [1, 2])
    """
    times_s = []
    found: list[Any] = [None] * len(functions)
    for turn in range(-warm_up, turns):
        took_s = np.empty((len(functions), 2))
        for i, function in enumerate(functions):
            begin = clocks()
            found[i] = function()
            took_s[i] = clocks() - begin
        if turn >= 0:
            times_s.append(took_s)
            if took_s[:, 0].sum() > enough_s:
                break
    return np.array(times_s), found


def machine(*libraries: str) -> dict[str, str]:
    """Return processor, system and versions; "absent" for a library that is not installed."""
    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        processor = f"{len(names)} x {names[0]}" if names else processor
    except OSError:
        pass  # not Linux
    return {
        "processor": processor,
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        **{name: _version(name) for name in libraries},
    }


def _version(library: str) -> str:
    try:
        return metadata.version(library)
    except metadata.PackageNotFoundError:
        return "absent"
