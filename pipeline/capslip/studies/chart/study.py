"""Speed against accuracy: every method on the same faces, against boundary elements."""

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from capslip.studies.chart.figures import figures
from capslip.studies.chart.measure import honesty, measure
from capslip.studies.chart.methods import methods
from capslip.studies.chart.reference import QUANTITIES
from capslip.studies.chart.statistics import CAP_QUANTITIES, ENERGY
from capslip.studies.chart.text import chart_markdown
from capslip.studies.clock import clocks
from capslip.studies.faces.scenes import cases, scan_cases
from capslip.studies.page import Row, png, write

FRESH_SEEDS = (101, 102, 103, 104, 105)  # faces on which nothing was developed


def chart(
    folder: str | Path,
    scans: str | Path | None = None,
    progress: Callable[[str], None] = lambda message: None,
) -> dict[str, Any]:
    """Measure every method on every face; write `speed-accuracy.json`, `.csv`, `.md` and pictures.

    Parameters
    ----------
    folder : path
        Made where absent; files of the same names are replaced.
    scans : path, optional
        Folder of real scans; what cannot be read there is left out.
    progress : callable, optional
        Called with one line for each face.

    Returns
    -------
    dict
        What the JSON file holds, and `runs`, the rows of the CSV file.

    Raises
    ------
    OutputError
        If the folder cannot be made or written.
    """
    write(folder, {})  # a folder that cannot be used is said before the work, not after
    begin = clocks()
    everything = cases() + (scan_cases(scans) if scans is not None else ())
    results = measure(everything, methods(), progress)
    results["honesty"]["fresh"] = honesty(FRESH_SEEDS, progress)
    results["seconds"] = float((clocks() - begin)[0])
    kept = {name: _rounded(part) for name, part in results.items() if name != "runs"}
    files: dict[str, str | bytes] = {
        "speed-accuracy.json": json.dumps(kept, ensure_ascii=False, allow_nan=False) + "\n",
        "speed-accuracy.md": chart_markdown(results),
        "speed-accuracy.csv": runs_csv(results["runs"]),
    }
    write(folder, files | {f"{name}.png": png(figure) for name, figure in figures(results).items()})
    return results


def runs_csv(runs: list[Row]) -> str:
    """Return the rows of all runs, with four digits."""
    columns = ["case", "group", "line", "setting", "seconds"]
    errors = [*QUANTITIES, ENERGY]
    file = io.StringIO()
    writer = csv.writer(file)
    writer.writerow([*columns, *(f"error_{name}" for name in errors), *CAP_QUANTITIES])
    for run in runs:
        caps = run["cap_errors"] or {}
        row = [run[name] for name in columns]
        row += [run["errors"].get(name) for name in errors]
        row += [caps.get(name) for name in CAP_QUANTITIES]
        writer.writerow(_rounded(row))
    return file.getvalue()


def _rounded(value: Any) -> Any:
    """Return the same with four digits; no run repeats more of them."""
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value
