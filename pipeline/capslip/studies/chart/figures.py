"""Pictures of the chart of speed against accuracy."""

from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.caps.fitting import fit_named
from capslip.output.canvas import INK, blank
from capslip.studies.chart.methods import (
    AS_LEVELLED,
    AUTO,
    BOUNDARY,
    CHOSEN,
    FITS,
    GRID,
    LADDER,
    MODELS,
    PAPER,
    SEPARATIONS,
)
from capslip.studies.page import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

# After Okabe and Ito; told apart in grey by the markers too.
COLOUR = {
    PAPER: "#D55E00",
    AUTO: "#000000",
    **{rung.name: rung.colour for rung in LADDER},
    GRID.label: GRID.colour,
}
MARKER = {name: fit_named(name).marker for name in FITS}
TICKS_S = (0.01, 0.02, 0.05, 0.1)
STYLE = {"by tolerance": "--", "by filter": ":", AS_LEVELLED: "-."}
NAME_DECADES = (0.09, 0.12)  # what a name beside a point takes of the axes of seconds and errors
LABELLED = (MODELS[-1], BOUNDARY, AUTO, PAPER)  # lines whose points are named
TITLES = {
    "energy": "energy W, worst of four forces",
    "energy_0.1": "energy W at T = 0.1 μN",
    "energy_0.25": "energy W at T = 0.25 μN",
    "energy_0.5": "energy W at T = 0.5 μN",
    "energy_0.75": "energy W at T = 0.75 μN",
    "stiffness": "tangential stiffness, with the bulk term",
    "stiffness_without_bulk": "tangential stiffness, without the bulk term",
    "approach": "approach, with the bulk term",
    "approach_without_bulk": "approach, without the bulk term",
    "peak_loss_factor": "peak loss factor",
}
PICTURES = {
    "speed-accuracy": ("energy_0.25", "stiffness_without_bulk"),
    "speed-accuracy-energy": ("energy_0.1", "energy_0.25", "energy_0.5", "energy_0.75"),
    "speed-accuracy-others": (
        "approach",
        "approach_without_bulk",
        "stiffness",
        "peak_loss_factor",
    ),
}


def figures(results: dict[str, Any]) -> "dict[str, Figure]":
    """Draw all pictures of the chart, by the names of their files."""
    drawn = {name: _panels(results, quantities) for name, quantities in PICTURES.items()}
    drawn["speed-accuracy-fits"] = _fits(results)
    drawn["speed-accuracy-caps"] = _caps(results)
    drawn["speed-accuracy-honesty"] = _honesty(results)
    return drawn


def _panels(results: dict[str, Any], quantities: tuple[str, ...]) -> "Figure":
    """Draw error over seconds, one panel a quantity."""
    rows = (len(quantities) + 1) // 2
    n_cases = len({run["case"] for run in results["runs"] if run["group"] != "scan"})
    title = (
        f"Error against boundary elements on the fine face, over {n_cases} seeded cases: median, "
        "and the range from least to greatest (faint)"
    )
    figure = _sheet(results, 1.6 + 4.6 * rows, title)
    panels = figure.subplots(rows, 2, squeeze=False).ravel()
    for axes, quantity in zip(panels, quantities, strict=True):
        _panel(axes, results, quantity)
    label = "small: other fits and separations, whole map"
    panels[0].plot([], [], "o", color="#777777", markersize=3.5, label=label)
    handles = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles[label] = handle
    figure.legend(
        handles=list(handles.values()),
        labels=list(handles),
        loc="outside lower center",
        ncols=4,
        fontsize=8.5,
    )
    return figure


def _panel(axes: "Axes", results: dict[str, Any], quantity: str) -> None:
    lines: dict[str, list[Row]] = {}
    for point in results["points"]:
        if "all" in point["groups"]:
            lines.setdefault(point["line"], []).append(point)
    for line, points in lines.items():
        _line(axes, line, points, quantity)
    front = [tuple(pair) for pair in results["pareto"][quantity]]
    best = sorted(
        _place(point, quantity)
        for points in lines.values()
        for point in points
        if (point["line"], point["setting"]) in front
    )
    if best:
        axes.plot(
            *np.array(best).T,
            color="#F0E442",
            linewidth=6,
            marker="o",
            markersize=9,
            zorder=0.5,
            label="Pareto front of all methods",
        )
        axes.set(xscale="log", yscale="log", ylim=(1e-5, 5.0))
    axes.set_xlabel("processor seconds of one analysis")
    axes.set_ylabel(f"relative error of the {TITLES[quantity]}", fontsize=8.5)
    _plain(axes)
    uncertainty = _uncertainty(results, quantity)
    if uncertainty:
        label = "median uncertainty of the reference"
        axes.axhspan(1e-9, uncertainty, color="#EFEFEF", zorder=0, label=label)


def _line(axes: "Axes", line: str, points: list[Row], quantity: str) -> None:
    """Draw one method: a point a setting, joined where they are a scale."""
    name, _, rest = line.partition(", ")
    fit, _, separation = rest.partition(", ")
    drawn = [point for point in points if _place(point, quantity)[1] is not None]
    if not drawn:
        return
    if fit in FITS and (fit, separation) != CHOSEN:
        if drawn[0]["setting"] == "1/1":
            seconds, error = _place(drawn[0], quantity)
            axes.plot([seconds], [error or np.nan], "o", color=COLOUR[name], markersize=3.5)
        return
    x, y = np.array([_place(point, quantity) for point in drawn], dtype=float).T
    axes.plot(
        x,
        y,
        color=COLOUR[name],
        marker={BOUNDARY: "*", PAPER: "X", AUTO: "P"}.get(name, "o"),
        markersize=8,
        linewidth=1.4,
        linestyle=STYLE.get(rest, "-"),
        label=line,
    )
    if name in LABELLED and rest not in STYLE:
        ranges = np.array([point["groups"]["all"][quantity] for point in drawn], dtype=float)
        greatest = np.where(np.isnan(ranges[:, 2]), 1e3, ranges[:, 2])
        axes.vlines(x, ranges[:, 1], greatest, color=COLOUR[name], linewidth=0.8, alpha=0.35)
        _name_points(axes, drawn, quantity, COLOUR[name])


def _name_points(axes: "Axes", points: list[Row], quantity: str, colour: str) -> None:
    """Write the setting beside each point, where other lines have none and no name stands yet."""
    below = points[0]["line"].startswith(MODELS[-1])
    for point in [points[0], points[-1], *points[1:-1]]:  # the ends say what lies between them
        seconds, error = _place(point, quantity)
        place = seconds, error or np.nan
        if any(_overprints(text.xy, place) for text in _names(axes, below)):
            continue
        axes.annotate(
            point["setting"],
            place,
            (-4, -9) if below else (4, 4),
            textcoords="offset points",
            ha="right" if below else "left",
            fontsize=6.5,
            color=colour,
        )


def _names(axes: "Axes", below: bool) -> "list[Annotation]":
    """Return the names that are written on the same side of their points."""
    from matplotlib.text import Annotation

    side = "right" if below else "left"
    names = (text for text in axes.texts if isinstance(text, Annotation))
    return [text for text in names if text.get_horizontalalignment() == side]


def _overprints(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Tell whether the names of two points would lie on each other, in decades of both axes."""
    apart = np.abs(np.log10(np.array(one) / np.array(other)))
    return bool((apart < NAME_DECADES).all())


def _fits(results: dict[str, Any]) -> "Figure":
    """Draw the models over the grid, one panel a fit and separation."""
    title = (
        "Every model, fit and separation over the grid: large point the whole map, then 1/2, 1/4, "
        "1/8 of its points along each axis; medians"
    )
    figure = _sheet(results, 7.0, title)
    panels = figure.subplots(len(SEPARATIONS), len(FITS), sharex=True, sharey=True)
    quantity = "energy_0.25"
    for row, separation in zip(panels, SEPARATIONS, strict=True):
        for axes, fit in zip(row, FITS, strict=True):
            for model in MODELS:
                points = [
                    point
                    for point in results["points"]
                    if point["line"] == f"{model}, {fit}, {separation}"
                    and _place(point, quantity)[1] is not None
                ]
                if points:
                    x, y = np.array([_place(point, quantity) for point in points], dtype=float).T
                    axes.plot(x, y, "o-", color=COLOUR[model], markersize=5, label=model)
                    axes.plot(x[0], y[0], "o", color=COLOUR[model], markersize=9)
            axes.set(xscale="log", yscale="log", title=f"{fit}, {separation}")
            axes.xaxis.set_minor_formatter("")
            axes.set_xticks(TICKS_S, [f"{1e3 * seconds:g} ms" for seconds in TICKS_S])
            _plain(axes)
        row[0].set_ylabel(f"relative error of the {TITLES[quantity]}", fontsize=8.5)
    for axes in panels[-1]:
        axes.set_xlabel("processor time of one analysis")
    handles, labels = panels[-1, -1].get_legend_handles_labels()
    figure.legend(handles=handles, labels=labels, loc="outside lower center", ncols=4)
    return figure


def _place(point: Row, quantity: str) -> tuple[float, float | None]:
    group = point["groups"]["all"]
    return group["seconds"][0], (group[quantity] or [None])[0]


def _uncertainty(results: dict[str, Any], quantity: str) -> float | None:
    """Return the median uncertainty of the reference, where it states one."""
    values = [
        case["reference"]["uncertainty"][quantity]
        for case in results["cases"]
        if "reference" in case and quantity in case["reference"]["uncertainty"]
    ]
    return float(np.median(values)) if values else None


def _caps(results: dict[str, Any]) -> "Figure":
    """Draw the errors of m, n, h and the radii by fit and separation."""
    title = (
        "Families found on faces of caps (blue) and on the same with noise (vermilion): median and "
        "range"
    )
    figure = _sheet(results, 5.0, title)
    names = {
        "m": "|error of m|, caps",
        "n": "|error of n|, caps",
        "h": "relative error of h",
        "R_G": "relative error of R, G-caps",
        "R_P": "relative error of R, P-caps",
    }
    panels = figure.subplots(1, len(names))
    wanted = [(fit, separation) for fit in FITS for separation in SEPARATIONS]
    by_line = {p["line"]: p for p in reversed(results["points"]) if p["setting"] == "1/1"}
    for axes, (quantity, label) in zip(panels, names.items(), strict=True):
        for row, (fit, separation) in enumerate(wanted):
            point = by_line.get(f"{MODELS[0]}, {fit}, {separation}")
            for group, colour, shift in (("caps", "#0072B2", -0.15), ("noise", "#D55E00", 0.15)):
                values = (point or {}).get("groups", {}).get(group, {}).get(quantity)
                if values:
                    middle, low, high = values
                    axes.plot([low, high], [row + shift] * 2, "-", color=colour, linewidth=1)
                    axes.plot(middle, row + shift, MARKER[fit], color=colour, markersize=6)
        axes.set_xlabel(label, fontsize=9)
        axes.set_yticks(range(len(wanted)))
        axes.set_yticklabels([f"{f}, {s}" for f, s in wanted] if axes is panels[0] else [])
        axes.set_xscale("symlog", linthresh=1.0 if quantity in "mn" else 1e-3)
        axes.set_xlim(0.0, 30.0 if quantity in "mn" else 1.0)
        axes.invert_yaxis()
        _plain(axes)
    return figure


def _honesty(results: dict[str, Any]) -> "Figure":
    """Draw the true error of the automatic choice over its estimate."""
    figure, axes = blank("Automatic choice: true error over estimated error", 8.5, 6.5)
    marks = {"caps": "o", "waves": "^", "noise": "s", "scan": "D"}
    for source, colour in (("same", "#0072B2"), ("fresh", "#D55E00")):
        for group, marker in marks.items():
            rows = [
                row
                for row in results["honesty"].get(source, [])
                if row["group"] == group and row["true"] is not None and row["estimated"]
            ]
            if rows:
                axes.plot(
                    [row["estimated"] for row in rows],
                    [max(row["true"], 1e-4) for row in rows],
                    marker,
                    color=colour,
                    alpha=0.7,
                    markersize=6,
                    label=f"{group}, {'these faces' if source == 'same' else 'fresh faces'}",
                )
    axes.plot([1e-4, 10], [1e-4, 10], "-", color=INK, linewidth=1.0, label="true = estimated")
    axes.axvline(0.05, color="#999999", linestyle=":", label="default tolerance")
    axes.set(xscale="log", yscale="log", xlim=(1e-3, 10), ylim=(1e-4, 10))
    axes.set_xlabel("estimated error (95 %)")
    axes.set_ylabel("true error of energy and stiffness, the worst of five")
    axes.legend(fontsize=8, loc="upper left")
    return figure


def _sheet(results: dict[str, Any], height: float, title: str) -> "Figure":
    """Return an empty figure for panels; its title ends with the machine and the versions."""
    figure, first = blank("", 13.0, height)
    first.remove()
    of = results["machine"]
    versions = ", ".join(f"{name} {of[name]}" for name in ("python", "numpy", "scipy", "capslip"))
    text = f"{title}\n{of['processor']}, {of['system']}; {versions}"
    figure.suptitle(text, fontsize=9.5, color=INK)
    return figure


def _plain(axes: "Axes") -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#E3E3E3", linewidth=0.6)
