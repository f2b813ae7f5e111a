"""Figure of the sensitivity: every answer over cut, pruning, filter and levelling."""

from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.output.canvas import ACCENT, DPI, FAMILY_COLOUR, INK
from capslip.output.quantity import scaled
from capslip.sensitivity import ANSWERS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from capslip.result import Analysis
    from capslip.sensitivity import Sensitivity, Sweep

PANELS = (  # label, unit, and the answers of one row of panels with their colours
    ("caps", "", (("m", "G"), ("n", "P"))),
    ("h", "m", (("h_m", ""),)),
    ("radius", "m", (("radius_G_m", "G"), ("radius_P_m", "P"))),
    ("approach\nwith bulk", "m", (("approach_m", ""),)),
    ("W", "J", (("energy_J", ""),)),
)
STABLE = "#D9F0E3"


def sensitivity(analysis: "Analysis") -> "Figure | None":
    """Small multiples: a row for each answer, a column for each setting that was swept."""
    found: Sensitivity | None = analysis.sensitivity
    if found is None or not found.sweeps:
        return None
    panels = [panel for panel in PANELS if np.isfinite(_columns(found, panel[2])).any()]
    figure, grid = _grid(len(panels), len(found.sweeps))
    for row, (label, unit, answers) in zip(grid, panels, strict=True):
        for axes, sweep in zip(row, found.sweeps, strict=True):
            _draw(axes, found, sweep, unit, answers)
        _, prefixed = scaled(_columns(found, answers), unit)
        row[0].set_ylabel(f"{label} [{prefixed}]" if unit else label)
    grid[0, 0].set_title("Answers over the choices made", loc="left", fontsize=11, color=INK)
    for axes, sweep in zip(grid[-1], found.sweeps, strict=True):
        axes.set_xlabel(f"{sweep.name} [{sweep.unit}]" if sweep.unit else sweep.name)
        if sweep.labels:
            axes.set_xticks(sweep.value, [label.replace(" of", "\nof") for label in sweep.labels])
            axes.set_xlim(sweep.value[0] - 0.5, sweep.value[-1] + 0.5)
    _legend(figure)
    return figure


def _grid(n_rows: int, n_columns: int) -> "tuple[Figure, np.ndarray]":
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    size = (1.5 + 3.2 * n_columns, 1.2 + 1.45 * n_rows)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(n_rows, n_columns, sharex="col", sharey="row", squeeze=False)
    for axes in grid.flat:
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#E3E3E3", linewidth=0.6)
        axes.set_axisbelow(True)
    return figure, grid


def _columns(found: "Sensitivity", answers: tuple[tuple[str, str], ...]) -> np.ndarray:
    """All values of some answers, of every sweep."""
    which = [ANSWERS.index(name) for name, _ in answers]
    return np.concatenate([sweep.answer[:, which].ravel() for sweep in found.sweeps])


def _draw(
    axes: "Axes",
    found: "Sensitivity",
    sweep: "Sweep",
    unit: str,
    answers: tuple[tuple[str, str], ...],
) -> None:
    """One answer, or the same of both families: stable values filled, others hollow."""
    largest, one = np.nanmax(np.abs(_columns(found, answers))), np.ones(1)
    factor = float(scaled(largest * one, unit)[0][0] / largest) if unit and largest else 1.0
    which = [ANSWERS.index(name) for name, _ in answers]
    low, high = sweep.stable_from[which].max(), sweep.stable_to[which].min()
    axes.axvspan(low, high, color=STABLE, zorder=0)
    axes.axvline(sweep.value[sweep.chosen], color=ACCENT, linewidth=1.4, zorder=1)
    for i, (_, family) in zip(which, answers, strict=True):
        colour = FAMILY_COLOUR[family] if family else INK
        value = sweep.answer[:, i] * factor
        stable = (sweep.value >= sweep.stable_from[i]) & (sweep.value <= sweep.stable_to[i])
        axes.plot(sweep.value, value, color=colour, linewidth=1.0)
        for member, face in ((stable, colour), (~stable, "white")):
            axes.plot(
                sweep.value[member],
                value[member],
                "o",
                markersize=4.5,
                markeredgecolor=colour,
                markerfacecolor=face,
            )
        bar = float(found.error_bar[i]) * factor
        centre = value[sweep.chosen]
        if np.isfinite(bar + centre):
            at = sweep.value[sweep.chosen]
            axes.errorbar(at, centre, yerr=bar, color=ACCENT, capsize=3, linewidth=1.4, zorder=3)
    axes.margins(y=0.15)


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    dots: dict[str, Any] = {"marker": "o", "linestyle": "", "markersize": 5}
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=ACCENT, linewidth=1.4, label="chosen value, with the error bar"),
        Patch(color=STABLE, label="stable range"),
        Line2D([], [], color=INK, **dots, label="within the error bar"),
        Line2D([], [], color=INK, markerfacecolor="white", **dots, label="outside"),
        Line2D([], [], color=FAMILY_COLOUR["G"], **dots, label="G-caps"),
        Line2D([], [], color=FAMILY_COLOUR["P"], **dots, label="P-caps"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
