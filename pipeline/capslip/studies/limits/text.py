"""The page of the limits study."""

from capslip.studies.limits.of_face import LEFT
from capslip.studies.page import Row, table

SPOKEN = ("told", "doubted", "warned")
OUTCOMES = ("right", "warned", "noted", "told", "doubted", "refused", "silent")
MEANING = (
    ("right", "right, and nothing of a warning said"),
    ("warned", "right, with a warning"),
    ("noted", "stiffness and energies right, m, n or the approach not, and a note says so"),
    ("told", "wrong, and a warning names the cause"),
    ("doubted", "wrong, with a warning, but none that names the cause"),
    ("refused", "no number, but a reason"),
    ("**silent**", "**wrong, and nothing said**"),
)
ESTIMATE_HEAD = ("method", "cases", "estimate too low", "median of estimate over error")
AXIS_HEAD = ("axis", "severity", "holds to", "breaks at", "silent", "says")
WARNING_HEAD = ("warning", "right", "alone there", "wrong", "alone there")


def limits_markdown(results: Row) -> str:
    """Return the page.

    Parameters
    ----------
    results : dict
        What `limits` returned.
    """
    parts = [
        "# Limits",
        "Where the method breaks, and what it says there. Written by `make limits`, which makes\n"
        "the faces, their truth and all numbers.",
        _how(results),
        table(("outcome", "meaning"), MEANING),
        _totals(results["totals"]),
        "Thresholds and warnings of the program were mended on these faces. The next table is of\n"
        f"fresh ones (seed {results['fresh']['seed']}): other places of the caps, other noise,\n"
        "waves, grooves and spikes of the same kinds, which nobody looked at before this run.",
        _totals(results["fresh"]["totals"]),
        "![error over severity](limits.png)",
        "## Breakdown points",
        "`holds to` is the last severity before the first at which any of the faces is wrong or\n"
        "refused; `says` are the commonest warnings where it is.",
    ]
    for method in results["totals"]:
        rows = [_axis_row(axis, method) for axis in results["axes"]]
        parts += [f"### {_capital(method)}", table(AXIS_HEAD, rows)]
    parts += ["## Silent failures"]
    for method in results["totals"]:
        mine = [run for run in results["silent"] if run["method"] == method]
        parts += _silent(_capital(method), mine)
    parts += _silent("Default, fresh faces", results["fresh"]["silent"])
    fresh = {"fresh faces": results["fresh"]["estimates"]["default"]}
    parts += [
        "## What the estimated error holds",
        "The program's own estimate of its error, against the greatest error of the stiffness and\n"
        "the energies; errors below 0.1 % count as 0.1 % and, in the median, below what the truth\n"
        "is unsure of as that. Without the axes on which the scan shows another face that is as\n"
        "good: wrong units, and a bow of the instrument.",
        _estimates({**results["estimates"], **fresh}),
    ]
    default = [run for run in results["runs"] if run["method"] == "default"]
    parts += [
        "## What the warnings cost and save",
        "Default: cases on which a warning stands, and those on which it stands alone. Alone on a\n"
        "right case it is the false alarm; alone on a wrong one it is all that keeps it from being"
        "\nsilent.",
        table(WARNING_HEAD, _warning_rows(default)),
    ]
    return "\n\n".join(parts) + "\n"


def limits_lines(results: Row) -> str:
    """Return the totals for a terminal, a line a method."""
    known = {**results["totals"], "fresh faces": results["fresh"]["totals"]["default"]}
    lines = [
        f"{method:<16} {total['cases']} cases: " + ", ".join(_shares(total))
        for method, total in known.items()
    ]
    return "\n".join(lines)


def _shares(total: Row) -> list[str]:
    counts, cases = total["outcomes"], max(total["cases"], 1)
    kinds = {
        "right": ("right",),
        "right with a warning": ("warned",),
        "wrong in m, n or approach alone with a note": ("noted",),
        "wrong with a warning": ("told", "doubted"),
        "refused": ("refused",),
        "silent": ("silent",),
    }
    return [
        f"{sum(counts.get(name, 0) for name in names) / cases:.1%} {kind}"
        for kind, names in kinds.items()
    ]


def _how(results: Row) -> str:
    n_cases = max(total["cases"] for total in results["totals"].values())
    return (
        f"{len(results['axes'])} axes, {n_cases} cases. Each face is known: the true\n"
        "answer is that of its true caps with elastic interaction or, where a face is more than\n"
        "separate caps, that of boundary elements on the face itself. The error is the greatest\n"
        "relative one of the approach without bulk sinking, the tangential stiffness, and the\n"
        "energy per cycle at T = 0.25, 0.5 and 0.75 mu N; on the axes `small force` and\n"
        "`gross slip` at the force named. An answer is wrong where the error exceeds "
        f"{results['breakdown_error']:.0%},\n"
        "or where m or n is not that of the face.\n\n"
        "A face is a function of place, and a scan its values at the centres of the pixels, with\n"
        "what the instrument makes of them. Caps, ellipsoids and the floor are their formulas;\n"
        "waves, roughness and the phase of a lay are the sums of sinusoids that their transforms\n"
        "hold, and end at waves of two pixels: what a spectrum has beyond its pixels shows in no\n"
        "scan, and a face with more of it is another face. Noise, spikes, grains, steps and lost\n"
        "points are of the instrument, not of the face. Boundary elements take the function on\n"
        f"half of the pixel or, where it leaves over {LEFT:.0%} in an energy, on a quarter. What\n"
        f"pixels leave is taken off the error first: {LEFT:.0%}{_most(results['unsure'])}."
    )


def _most(unsure: list[float]) -> str:
    """Return on how many of the faces that are pressed it is more, and how much at most."""
    more = sum(one > LEFT for one in unsure)
    return f", or up to {unsure[-1]:.1%} on {more / len(unsure):.0%} of these faces" if more else ""


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _totals(totals: Row) -> str:
    rows = [
        (
            method,
            total["cases"],
            *(total["outcomes"].get(name, 0) for name in OUTCOMES),
            f"{total['silent_share']:.1%}",
            f"{total['seconds_a_case']:.2g}",
        )
        for method, total in totals.items()
    ]
    return table(("method", "cases", *OUTCOMES, "silent share", "s a case"), rows)


def _estimates(estimates: Row) -> str:
    rows = [
        (method, found["cases"], f"{found['too_low_share']:.1%}", f"{found['median_ratio']:.2g}")
        for method, found in estimates.items()
        if found["cases"]
    ]
    return table(ESTIMATE_HEAD, rows)


def _axis_row(axis: Row, method: str) -> list[str]:
    found = axis["methods"][method]
    ends = (found["holds_to"], found["breaks_at"])
    says = ", ".join(f"`{code}` {count}" for code, count in found["says"]) or "-"
    return [
        axis["name"],
        axis["quantity"],
        *("-" if value is None else f"{value:.3g}" for value in ends),
        str(found["outcomes"].get("silent", 0)),
        says,
    ]


def _silent(title: str, runs: list[Row]) -> list[str]:
    lines = "\n".join(_silent_row(run) for run in runs) or "None."
    return [f"### {title}: {len(runs)}", lines]


def _silent_row(run: Row) -> str:
    error = "infinite" if run["error"] is None else f"{run['error']:.0%}"
    counts = "" if run["true_m"] is None else f"; m {run['m']}, n {run['n']}"
    if counts and (run["m"], run["n"]) != (run["true_m"], run["true_n"]):
        counts += f" (true {run['true_m']}, {run['true_n']})"
    return f"- {run['axis']}: {run['name']}: {run['worst']} off by {error}{counts}"


def _warning_rows(runs: list[Row]) -> list[list[str]]:
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
    return [[f"`{code}`", *map(str, count)] for code, count in ordered]
