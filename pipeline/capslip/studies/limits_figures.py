"""The pictures and the page of the limits study."""

import math
from typing import TYPE_CHECKING, Any

from capslip.output.canvas import ACCENT, FAMILY_COLOUR, INK, blank

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 6
LOWEST, HIGHEST = 1e-4, 1e2  # relative errors shown; what lies outside is drawn on the frame
COLOUR = {"default": ACCENT, "the paper's way": FAMILY_COLOUR["P"]}
SILENT = FAMILY_COLOUR["G"]
SPOKEN = ("told", "doubted", "warned")
OUTCOMES = ("right", "warned", "told", "doubted", "refused", "silent")
TOTALS_HEAD = (
    "| method | cases | " + " | ".join(OUTCOMES) + " | silent share | s a case |",
    "| --- | " + "--- | " * (len(OUTCOMES) + 2) + "--- |",
)
Row = dict[str, Any]


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


def limits_markdown(results: Row) -> str:
    """Return the page.

    Parameters
    ----------
    results : dict
        What `measure` returned.
    """
    limit = results["breakdown_error"]
    lines = [
        "# Limits",
        "",
        "Where the method breaks, and what it says there. Written by `make limits`, which makes",
        "the faces, their truth and all numbers.",
        "",
        f"{len(results['axes'])} axes, {_cases(results)} cases. Each face is known: the true",
        "answer is that of its true caps with elastic interaction or, where a face is more than",
        "separate caps, that of boundary elements on the clean map. The error is the greatest",
        "relative one of the approach without bulk sinking, the tangential stiffness, and the",
        "energy per cycle at T = 0.25, 0.5 and 0.75 mu N; on the axes `small force` and",
        f"`gross slip` at the force named. An answer is wrong where the error exceeds {limit:.0%},",
        "or where m or n is not that of the face. What boundary elements are themselves unsure of",
        "is taken off first: pixels leave 4 to 16 % in W(0.25) of wavy and rough faces.",
        "",
        "| outcome | meaning |",
        "| --- | --- |",
        "| right | right, and nothing of a warning said |",
        "| warned | right, with a warning |",
        "| told | wrong, and a warning names the cause |",
        "| doubted | wrong, with a warning, but none that names the cause |",
        "| refused | no number, but a reason |",
        "| **silent** | **wrong, and nothing said** |",
        "",
        *TOTALS_HEAD,
        *_totals_rows(results["totals"]),
        "",
        "Thresholds and warnings of the program were mended on these faces. The next table is of",
        f"fresh ones (seed {results['fresh']['seed']}): other places of the caps, other noise,",
        "waves, grooves and spikes of the same kinds, on which no mend was judged.",
        "",
        *TOTALS_HEAD,
        *_totals_rows(results["fresh"]["totals"]),
    ]
    lines += ["", "![error over severity](limits.png)", "", "## Breakdown points", ""]
    lines += [
        "`holds to` is the last severity before the first at which any of the faces is wrong or",
        "refused; `says` are the commonest warnings where it is.",
    ]
    for method in results["totals"]:
        lines += ["", f"### {method[0].upper()}{method[1:]}", ""]
        lines += ["| axis | severity | holds to | breaks at | silent | says |"]
        lines += ["| --- | --- | --- | --- | --- | --- |"]
        lines += [_axis_row(axis, method) for axis in results["axes"]]
    lines += ["", "## Silent failures", ""]
    for method in results["totals"]:
        mine = [run for run in results["silent"] if run["method"] == method]
        lines += [f"### {method[0].upper()}{method[1:]}: {len(mine)}", ""]
        lines += [_silent_row(run) for run in mine]
        lines += [""] if mine else ["None.", ""]
    mine = results["fresh"]["silent"]
    lines += [f"### Default, fresh faces: {len(mine)}", ""]
    lines += [_silent_row(run) for run in mine]
    lines += [""] if mine else ["None.", ""]
    lines += ["## What the warnings cost and save", ""]
    lines += [
        "Default: cases on which a warning stands, and those on which it stands alone. Alone on a",
        "right case it is the false alarm; alone on a wrong one it is all that keeps it from being",
        "silent.",
        "",
        "| warning | right | alone there | wrong | alone there |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines += _warning_rows([run for run in results["runs"] if run["method"] == "default"])
    return "\n".join([*lines, ""])


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


def _cases(results: Row) -> int:
    return int(max(total["cases"] for total in results["totals"].values()))


def _axis_row(axis: Row, method: str) -> str:
    found = axis["methods"][method]
    holds, breaks = (
        "-" if value is None else f"{value:.3g}"
        for value in (found["holds_to"], found["breaks_at"])
    )
    says = ", ".join(f"`{code}` {count}" for code, count in found["says"]) or "-"
    silent = found["outcomes"].get("silent", 0)
    return f"| {axis['name']} | {axis['quantity']} | {holds} | {breaks} | {silent} | {says} |"


def _totals_rows(totals: Row) -> list[str]:
    rows = []
    for method, total in totals.items():
        counts = " | ".join(str(total["outcomes"].get(name, 0)) for name in OUTCOMES)
        rows.append(
            f"| {method} | {total['cases']} | {counts} | {total['silent_share']:.1%} | "
            f"{total['seconds_a_case']:.2g} |"
        )
    return rows


def _warning_rows(runs: list[Row]) -> list[str]:
    """Count on how many right and wrong cases each warning stands, and stands alone."""
    counts: dict[str, list[int]] = {}
    for run in runs:
        if run["outcome"] not in SPOKEN:
            continue
        warnings = [code for code, severity in run["problems"].items() if severity != "info"]
        first = 0 if run["outcome"] == "warned" else 2
        for code in warnings:
            count = counts.setdefault(code, [0, 0, 0, 0])
            count[first] += 1
            count[first + 1] += len(warnings) == 1
    ordered = sorted(counts.items(), key=lambda item: (-item[1][1], -item[1][0], item[0]))
    return [f"| `{code}` | {' | '.join(map(str, count))} |" for code, count in ordered]


def _silent_row(run: Row) -> str:
    error = "infinite" if run["error"] is None else f"{run['error']:.0%}"
    counts = "" if run["true_m"] is None else f"; m {run['m']}, n {run['n']}"
    if counts and (run["m"], run["n"]) != (run["true_m"], run["true_n"]):
        counts += f" (true {run['true_m']}, {run['true_n']})"
    return f"- {run['axis']}: {run['name']}: {run['worst']} off by {error}{counts}"
