"""The picture of the limits study."""

import math
from typing import TYPE_CHECKING

from capslip.output.canvas import ACCENT, FAMILY_COLOUR, INK, blank
from capslip.studies.page import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 6
LOWEST, HIGHEST = 1e-4, 1e2  # relative errors shown; what lies outside is drawn on the frame
COLOUR = {
    "default": ACCENT,
    "as levelled": FAMILY_COLOUR[""],
    "the paper's way": FAMILY_COLOUR["P"],
}
SILENT = FAMILY_COLOUR["G"]


def limits_figure(results: Row) -> "Figure":
    """Return one small chart an axis: error over severity, and what was said.

    Parameters
    ----------
    results : dict
        What `measure` returned.
    """
    n_rows = math.ceil(len(results["axes"]) / COLUMNS)
    figure, first = blank("", 3.0 * COLUMNS, 2.4 * n_rows + 0.8)
    first.remove()
    grid = figure.subplots(n_rows, COLUMNS, squeeze=False).ravel()
    for axes, axis in zip(grid, results["axes"], strict=False):
        runs = [run for run in results["runs"] if run["axis"] == axis["name"]]
        _chart(axes, axis, runs, results["breakdown_error"])
    for axes in grid[len(results["axes"]) :]:
        axes.remove()
    for method, colour in COLOUR.items():
        for filled, text in ((True, "nothing said"), (False, "a warning, or no number")):
            face = colour if filled else "none"
            grid[0].plot([], [], "o", color=colour, mfc=face, label=f"{method}: {text}")
    grid[0].plot([], [], "X", color=SILENT, label="silent failure")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    figure.suptitle(
        "Relative error over severity; on the upper frame: no number, or m and n wrong",
        color=INK,
    )
    return figure


def _chart(axes: "Axes", axis: Row, runs: list[Row], limit: float) -> None:
    axes.set_title(axis["name"], loc="left", fontsize=9, color=INK)
    axes.axhspan(limit, HIGHEST, color="#F4F4F4", zorder=0)
    position = {severity: i for i, severity in enumerate(axis["severities"])}
    for run in runs:
        if run["outcome"] == "no truth":
            continue
        colour = SILENT if run["outcome"] == "silent" else COLOUR.get(run["method"], INK)
        quiet = run["outcome"] in ("right", "silent")
        x = position[run["severity"]] + (0.12 if run["method"] == "default" else -0.12)
        axes.plot(
            x,
            _shown(run),
            "X" if run["outcome"] == "silent" else "o",
            color=colour,
            mfc=colour if quiet else "none",
            ms=6 if run["outcome"] == "silent" and run["method"] == "default" else 4,
            clip_on=False,
        )
    step = math.ceil(len(position) / 6)
    axes.set_xticks(range(0, len(position), step), [f"{s:.3g}" for s in axis["severities"][::step]])
    axes.set(yscale="log", ylim=(LOWEST, HIGHEST))
    axes.set_xlabel(axis["quantity"], fontsize=7)
    axes.tick_params(labelsize=7)
    axes.spines[["top", "right"]].set_visible(False)


def _shown(run: Row) -> float:
    wrong_counts = run["true_m"] is not None and (run["m"], run["n"]) != (
        run["true_m"],
        run["true_n"],
    )
    if run["error"] is None or wrong_counts:
        return HIGHEST
    return float(min(max(abs(run["error"]), LOWEST), HIGHEST))
