"""The chart in words and tables, as Markdown."""

import statistics
from itertools import product
from typing import Any

from capslip.studies.chart.methods import (
    AUTO,
    AUTO_DEFAULT,
    BEST,
    BOUNDARY,
    BY_FILTER,
    BY_GRID,
    CAPS,
    COARSENINGS,
    FITS,
    FLAT,
    GRID,
    MEAN,
    MODELS,
    PAPER,
    SEPARATIONS,
)
from capslip.studies.chart.reference import FORCE_SHARES
from capslip.studies.faces.scenes import BLOCK
from capslip.studies.page import Row, table

TABLE = (
    ("approach_without_bulk", "approach"),
    ("stiffness_without_bulk", "stiffness"),
    ("energy_0.1", "W(0.1)"),
    ("energy_0.25", "W(0.25)"),
    ("energy_0.5", "W(0.5)"),
    ("energy_0.75", "W(0.75)"),
    ("peak_loss_factor", "peak η"),
)
HOW = (
    "Every face is made on a fine grid (1200 x 800 points). The reference presses that face "
    "with boundary elements, turned until it balances about its centre, and once more as levelled: "
    "each method is compared with the one of its own alignment (the paper's way as levelled). The "
    "energies follow by Betti's theorem from solutions on patches around the contacts; one state "
    "on the whole map proves them. The methods see the map of an instrument with pixels four times "
    "as large (300 x 200 points), with noise or without, and do the whole of "
    "`capslip.analyze` but the sweeps and the judgement of a forced model. Seconds are "
    "processor time, so that other work on the machine does not count, in the median of three "
    "runs where one takes less than half a second. Errors are relative; "
    "where a method gives no answer, it counts as infinitely wrong. Rows give medians over "
    "all seeded faces; ranges are in the pictures and the files."
)


def chart_markdown(results: dict[str, Any]) -> str:
    """Return the page of the chart."""
    of = results["machine"]
    versions = ", ".join(f"{name} {of[name]}" for name in of if name not in ("processor", "system"))
    parts = [
        "# Speed against accuracy",
        f"Written by `make chart` in {results['seconds'] / 60:.0f} minutes on {of['processor']}, "
        f"{of['system']}; {versions}. All numbers: `speed-accuracy.json`, `speed-accuracy.csv`.",
        "## What to use when",
        *[f"{i}. {line}" for i, line in enumerate(_advice(results), start=1)],
        "![speed against accuracy](speed-accuracy.png)",
        "## How it was measured",
        HOW,
        _certificates(results),
        "![energy](speed-accuracy-energy.png)",
        "![others](speed-accuracy-others.png)",
        "The Pareto front of W(0.25), all seeded faces:",
        _front(results, "energy_0.25"),
        "![fits](speed-accuracy-fits.png)",
        "## All methods on the whole map",
        _table(results, "1/1"),
        "## Coarser maps",
        _grids(results),
        "## Families",
        "![families](speed-accuracy-caps.png)",
        "## The automatic choice",
        _honesty(results),
        "![honesty](speed-accuracy-honesty.png)",
        "## Cases",
        _cases(results),
    ]
    if any(case["group"] == "scan" for case in results["cases"]):
        parts += ["## Real scans", _scans(results)]
    return "\n\n".join(parts) + "\n"


def _advice(results: dict[str, Any]) -> list[str]:
    """Return five lines, with the numbers of this run."""
    get = _Lookup(results["points"])

    def percent(line: str, quantity: str, group: str = "all", setting: str = "1/1") -> str:
        return _percent(get(line, quantity, group, setting))

    def seconds(line: str, setting: str = "1/1") -> str:
        return _seconds(get(line, "seconds", "all", setting))

    pixels = [case["reference"]["pixels_across"] for case in results["cases"] if _known(case)]
    across = statistics.median(pixels) / BLOCK
    auto = [row for row in results["honesty"]["same"] if row["setting"] == AUTO_DEFAULT]
    on_the_map = sum(row["model"] == GRID.name for row in auto)
    return [
        f"Start with `--model auto` ({seconds(AUTO, AUTO_DEFAULT)} an analysis). It says how far "
        f"its result can be trusted, and takes boundary elements where caps are not enough "
        f"({on_the_map} of these {len(auto)} faces).",
        f"On faces of clear caps interacting caps ({seconds(BEST)}) are enough: off by "
        f"{percent(BEST, 'energy_0.25', 'caps')} in the energy W at a quarter of the force of "
        f"gross slip, by {percent(BEST, 'stiffness_without_bulk', 'caps')} in the stiffness.",
        f"On wavy, ground or rough faces interacting caps are off by "
        f"{percent(BEST, 'energy_0.25', 'waves')} at a quarter and "
        f"{percent(BEST, 'energy_0.1', 'waves')} at a tenth of that force in the median and by far "
        "more on single faces, `--model boundary_elements` "
        f"({seconds(BY_GRID)}) by {percent(BY_GRID, 'energy_0.25', 'waves')} and "
        f"{percent(BY_GRID, 'energy_0.1', 'waves')}: take it where W must be right, on the finest "
        "map there is, as pixels limit it at small forces.",
        f"The paper's way ({seconds(PAPER)}) is off by {percent(PAPER, 'energy_0.25')} in W, by "
        f"{percent(PAPER, 'stiffness_without_bulk')} in the stiffness; single caps without "
        f"interaction by {percent(CAPS, 'energy_0.25')} and "
        f"{percent(CAPS, 'stiffness_without_bulk')}; `mean_field` mends the stiffness "
        f"({percent(MEAN, 'stiffness_without_bulk')}). Take them for many variants, not for a "
        "prediction.",
        f"Noise: W is off by {percent(BEST, 'energy_0.25', 'noise')} with interacting caps, by "
        f"{percent(BY_GRID, 'energy_0.25', 'noise')} with boundary elements on the noisy map, by "
        f"{percent(BY_FILTER, 'energy_0.25', 'noise', '10 pixels')} after an S-filter of 10 "
        f"pixels. Pixels: half of these {across:.0f} across a contact will do with interacting "
        f"caps ({percent(BEST, 'energy_0.25', 'all', '1/2')}), a quarter will not "
        f"({percent(BEST, 'energy_0.25', 'all', '1/4')}).",
    ]


def _certificates(results: dict[str, Any]) -> str:
    """Tell how good the references are, and what they are unsure of."""
    cases = [case for case in results["cases"] if _known(case)]
    certificate = [case["reference"]["certificate"] for case in cases]
    return (
        f"Worst certificate of the {len(cases)} references: load balance "
        f"{max(c['load_balance'] for c in certificate):.1g}, penetration "
        f"{max(0.0, *(-c['least_gap'] for c in certificate)):.1g} of the approach, tension "
        f"{max(0.0, *(-c['least_pressure'] for c in certificate)):.1g} of the mean pressure, "
        f"complementarity {max(c['complementarity'] for c in certificate):.1g}, moments "
        f"{max(abs(m) for c in certificate for m in c['moments']):.1g} of load times side. Pixels "
        "limit the "
        "energy at small forces, where less than one pixel around each contact slips: the median "
        "uncertainty of the reference is "
        + ", ".join(_uncertainties(cases))
        + ". Beyond it stands the theorem itself: against a direct solution with Cerruti's kernel "
        "at ν = 0.3 the energy is off by 0.6 % in the median and 3.9 % at worst on faces of caps, "
        "by 2.6 and 11 % on wavy faces; the sign depends on the direction of the force, and the "
        "mean over two directions is within 1.1 % (`theory.md`, section 13)."
    )


def _known(case: Row) -> bool:
    return "reference" in case


def _uncertainties(cases: list[Row]) -> list[str]:
    """Return the median uncertainty of each energy of the reference."""
    found = []
    for share in FORCE_SHARES:
        of_all = [case["reference"]["uncertainty"][f"energy_{share:g}"] for case in cases]
        found.append(f"{_percent(statistics.median(of_all))} at {share:g} μN")
    return found


class _Lookup:
    """Medians by line, quantity, group and setting."""

    def __init__(self, points: list[Row]) -> None:
        self.groups = {(p["line"], p["setting"]): p["groups"] for p in points}

    def __call__(
        self, line: str, quantity: str, group: str = "all", setting: str = "1/1"
    ) -> float | None:
        found = self.groups.get((line, setting), {}).get(group, {}).get(quantity)
        return found[0] if found else None


def _table(results: dict[str, Any], setting: str) -> str:
    get = _Lookup(results["points"])
    lines = [PAPER, *(", ".join(combination) for combination in product(MODELS, FITS, SEPARATIONS))]
    keys = [(FLAT.name, "any"), *((line, setting) for line in lines)]
    keys += [(AUTO, s) for line, s in get.groups if line.startswith(AUTO)]
    keys += [key for key in get.groups if key[0].startswith(BOUNDARY) or "filter" in key[0]]
    rows = []
    for line, own in keys:
        group = get.groups.get((line, own), {}).get("all")
        if group is None:
            continue
        name = line if own == setting else f"{line}: {own}"
        cells = [name, _seconds(group["seconds"][0]), str(group["failed"])]
        rows.append(cells + [_percent(get(line, quantity, "all", own)) for quantity, _ in TABLE])
    return table(("method", "seconds", "no answer", *(label for _, label in TABLE)), rows)


def _front(results: dict[str, Any], quantity: str) -> str:
    """Name the points that no other beats in both time and median error."""
    get = _Lookup(results["points"])
    rows = [
        (
            f"{line}: {setting}",
            _seconds(get(line, "seconds", "all", setting)),
            _percent(get(line, quantity, "all", setting)),
        )
        for line, setting in results["pareto"][quantity]
    ]
    return table(("method", "seconds", "W(0.25)"), rows)


def _grids(results: dict[str, Any]) -> str:
    get = _Lookup(results["points"])
    settings = ["1/1", *(f"1/{c}" for c in COARSENINGS)]
    rows = [
        (line, *(_percent(get(line, "energy_0.25", "all", s)) for s in settings))
        for line in (PAPER, CAPS, BEST, BY_GRID)
    ]
    return table(("energy at 0.25 μN", *settings), rows)


def _honesty(results: dict[str, Any]) -> str:
    rows = []
    for source, name in (("same", "of this chart"), ("fresh", "fresh, of other seeds")):
        tried = results["honesty"].get(source, [])
        known = [row for row in tried if row["estimated"] is not None and row["true"] is not None]
        above = sum(row["true"] > row["estimated"] for row in known)
        models = [row["model"] for row in tried]
        chosen = ", ".join(f"{m} {models.count(m)}" for m in dict.fromkeys(models))
        share = f"{above} ({above / len(known):.0%})" if known else "none"
        rows.append((name, len(tried), len(known), share, chosen))
    return (
        "Its estimate is one for the greatest error of the energy at four forces and of the "
        "stiffness, at 95 %. True errors are counted beyond the uncertainty of the reference.\n\n"
    ) + table(("faces", "analyses", "estimate given", "true error above it", "chosen"), rows)


def _scans(results: dict[str, Any]) -> str:
    """Tell what the methods say of scans, of which nobody knows more than boundary elements."""
    runs = {(run["case"], run["line"], run["setting"]): run for run in results["runs"]}
    rows = []
    for case in results["cases"]:
        if case["group"] != "scan":
            continue
        cells = [case["name"], "no reference", *[""] * 6]
        if _known(case):
            cells = [case["name"], *_contacts(case)]
            for quantity in ("energy_0.25", "stiffness"):
                for line in (PAPER, BEST):
                    error = runs[case["name"], line, "1/1"]["errors"].get(quantity)
                    cells.append(_percent(None if error is None else abs(error)))
            auto = runs[case["name"], AUTO, AUTO_DEFAULT]["auto"]
            cells.append(_percent(auto["estimated"] if auto else None))
        rows.append(cells)
    head: tuple[str, ...] = (
        "scan",
        "contacts",
        "pixels across",
        "W(0.25): paper's way",
        "interacting caps",
    )
    head += ("stiffness: paper's way", "interacting caps", "estimate of auto")
    return (
        "Form and outliers off, at most 300 points along the longer side; the reference presses "
        "that same map. Where it has no answer, the contacts have too few pixels.\n\n"
    ) + table(head, rows)


def _cases(results: dict[str, Any]) -> str:
    rows = [
        (case["name"], *_contacts(case), f"{case['seconds']:.1f} s")
        if _known(case)
        else (case["name"], "", "", case["no_reference"])
        for case in results["cases"]
        if case["group"] != "scan"
    ]
    return table(("case", "contacts", "pixels across", "reference"), rows)


def _contacts(case: Row) -> tuple[str, str]:
    known = case["reference"]
    return str(known["contacts"]), f"{known['pixels_across']:.0f}"


def _percent(value: float | None) -> str:
    if value is None:
        return "none"
    return f"{100 * value:.2g} %" if value < 1.0 else f"{value:.2g} x"


def _seconds(value: float | None) -> str:
    if value is None:
        return "none"
    return f"{1e3 * value:.0f} ms" if value < 1.0 else f"{value:.1f} s"
