"""Where the method breaks, and what it says there: every axis is driven until nothing is left."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from capslip.studies.limits.axes import axes
from capslip.studies.limits.figure import limits_figure
from capslip.studies.limits.measure import measure
from capslip.studies.limits.text import limits_markdown
from capslip.studies.page import png, write

FRESH_SEED = 560


def limits(
    folder: str | Path,
    progress: Callable[[str], None] = lambda message: None,
    workers: int = 1,
) -> dict[str, Any]:
    """Drive all axes until the method breaks; write `limits.json`, `limits.md` and `limits.png`.

    The program learned from its silent failures on these faces, so the default settings are tried
    on fresh ones, too: other faces and noise of the same kinds.

    Parameters
    ----------
    folder : path
        Made where absent; files of the same names are replaced.
    progress : callable, optional
        Told how many cases are done, and about how long the others take.
    workers : int
        Processes; 0: one a core. The rows are those of one, in the same order.

    Returns
    -------
    dict
        What the JSON file holds.

    Raises
    ------
    OutputError
        If the folder cannot be made or written.
    """
    write(folder, {})  # a folder that cannot be used is said before the work, not after
    workers = workers or os.cpu_count() or 1
    results = measure(axes(), progress=progress, workers=workers)
    fresh = measure(
        axes(FRESH_SEED), ("default",), lambda line: progress(f"fresh faces, {line}"), workers
    )
    kept = ("totals", "estimates", "silent")
    results["fresh"] = {"seed": FRESH_SEED, **{key: fresh[key] for key in kept}}
    results["seconds"] += fresh["seconds"]
    text = json.dumps(results, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    picture = png(limits_figure(results))
    page = limits_markdown(results)
    write(folder, {"limits.json": text, "limits.md": page, "limits.png": picture})
    return results
