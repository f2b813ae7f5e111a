"""Run the methods on the cases, and see whether they are wrong and what is said then."""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np

from capslip.analysis import analyze
from capslip.errors import CapslipError, ContactError
from capslip.problems import Problem, Severity
from capslip.result import Analysis
from capslip.settings import Settings, load_settings
from capslip.studies.clock import clocks
from capslip.studies.faces.synthetic import synthetic_surface
from capslip.studies.limits.case import Axis, Case
from capslip.studies.limits.known import Known, energy_names, known_answers
from capslip.studies.limits.of_face import OfFace
from capslip.studies.page import Row
from capslip.surface.heightmap import HeightMap
from capslip.workers import Lost, crew, outcomes

SCHEMA = "capslip/limits/1"
TELL_EVERY_S = 10.0  # how many cases are to come
BREAKDOWN = 0.10  # relative error at which a method counts as broken
PAPER_CONFIG = Path(__file__).parents[4] / "configs" / "peyret2016.toml"
METHODS: dict[str, tuple[Path | None, tuple[str, ...]]] = {
    "default": (None, ()),
    "as levelled": (None, ("contact.alignment=as_levelled",)),
    "the paper's way": (PAPER_CONFIG, ()),
}
COUNT_CODES = (
    "families_doubtful",
    "more_than_two_families",
    "family_below_cut",
    "hills_too_small",
    "caps_not_pressed",
)
FIRST_CODE = "first_touch_decides"  # where the approach alone is wrong
LEAST_ERROR = 1e-3  # what is smaller counts as much: nobody asks how far off an estimate of it is
SILENT_KEYS = ("method", "axis", "name", "error", "worst", "m", "n", "true_m", "true_n")


def run_face(scan: HeightMap, settings: Settings) -> Analysis:
    """Analyse one face with all that the program does."""
    return analyze(scan, settings)


def measure(
    what: Iterable[Axis],
    methods: Iterable[str] = tuple(METHODS),
    progress: Callable[[str], None] = lambda message: None,
    workers: int = 1,
) -> dict[str, Any]:
    """Run the methods on the cases of some axes, in so many processes, or in this one.

    An answer is wrong where its greatest relative error exceeds 10 % (approach, stiffness, energies
    at the forces of the case), or where m or n is not that of the face. The outcome of a case is

    right
        and nothing of at least a warning was said; an energy that has no bound, beyond gross slip,
        is right where none is given,
    warned
        right, but a warning was given,
    told
        wrong, and a warning names the cause,
    noted
        stiffness and energies are right, m, n or the approach alone is wrong, and what is noted of
        the hills, the families or of first touch says so without being a warning,
    doubted
        wrong, and there is a warning, but none that names the cause,
    refused
        no number was given, but a reason,
    silent
        wrong, and nothing was said.

    Returns
    -------
    dict
        `runs`, one for each case and method; `axes` with the breakdown point of each method;
        `totals`; how the `estimates` of the model's error held; how `unsure` the truths of faces
        are that are pressed, growing; and the names of the `silent` ones.
    """
    begin = clocks()
    methods, what = tuple(methods), tuple(what)
    jobs = [(i, axis, methods) for axis in what for i in range(len(axis.cases))]
    rows_of = _rows_of(jobs, progress, workers)
    runs: list[Row] = []
    found_axes: list[Row] = []
    for axis in what:
        rows = [row for i in range(len(axis.cases)) for row in rows_of[axis.name, i]]
        runs += rows
        found_axes.append(_about(axis, rows, methods))
    return {
        "schema": SCHEMA,
        "breakdown_error": BREAKDOWN,
        "seconds": float((clocks() - begin)[0]),
        "totals": {method: _totals(runs, method) for method in methods},
        "estimates": {method: _estimates(runs, method, what) for method in methods},
        "axes": found_axes,
        "unsure": sorted(row["unsure"] for row in runs if row["unsure"] is not None),
        "silent": [
            {key: row[key] for key in SILENT_KEYS} for row in runs if row["outcome"] == "silent"
        ],
        "runs": runs,
    }


def _rows_of(
    jobs: list[tuple[int, Axis, tuple[str, ...]]], progress: Callable[[str], None], workers: int
) -> dict[tuple[str, int], list[Row]]:
    """Return the rows of each case, by its axis and place there; tell how many are to come."""
    begin_s = told_s = time.monotonic()
    rows_of: dict[tuple[str, int], list[Row]] = {}
    for (axis_name, place), rows in _run_all(jobs, workers):
        rows_of[axis_name, place] = rows
        now_s = time.monotonic()
        if now_s - told_s >= TELL_EVERY_S or len(rows_of) == len(jobs):
            told_s, left = now_s, len(jobs) - len(rows_of)
            left_s = (now_s - begin_s) / len(rows_of) * left
            silent = sum(row["outcome"] == "silent" for found in rows_of.values() for row in found)
            said = f"{len(rows_of)} of {len(jobs)} cases, {silent} silent"
            progress(f"{said}, about {left_s:.0f} s left" if left else said)
    return rows_of


def _run_all(
    jobs: list[tuple[int, Axis, tuple[str, ...]]], workers: int
) -> Iterator[tuple[tuple[str, int], list[Row]]]:
    """Give the rows of each case as it ends, with its axis and place there."""
    if workers == 1:
        solved: dict[Any, OfFace] = {}
        for i, axis, methods in jobs:
            yield (axis.name, i), _run_case(axis, axis.cases[i], methods, solved)
        return
    by_place = ((axis.name, i, axis.codes, axis.cases[i], methods) for i, axis, methods in jobs)
    with crew(workers) as executor:
        for (name, i, *_), rows in outcomes(executor, _run_alone, by_place, workers):
            if isinstance(rows, Lost):
                raise CapslipError(f"limits: {name}, case {i}: {rows.reason}")
            yield (name, i), rows


def _run_alone(
    name: str, place: int, codes: tuple[str, ...], case: Case, methods: tuple[str, ...]
) -> list[Row]:
    """Run one case in a process of its own: an axis holds functions that do not travel."""
    axis = Axis(name, "", (), lambda seed, value: (), codes)
    return _run_case(axis, case, methods, {})


def _run_case(
    axis: Axis, case: Case, methods: tuple[str, ...], solved: dict[Any, OfFace]
) -> list[Row]:
    scan, truth = synthetic_surface(case.scene, case.name)
    if case.face_change is not None:
        scan = case.face_change(scan, truth, 1)
    if case.scan_change is not None:
        scan = case.scan_change(scan, truth)
    known: dict[str, Known | str] = {}
    rows = []
    for method in methods:
        alignment = _settings(case, method).contact.alignment
        if alignment not in known:
            known[alignment] = _known(case, alignment, solved)
        answer = known[alignment]
        if isinstance(answer, str):
            rows.append(_row(axis, case, method, outcome="no truth", reason=answer))
            continue
        rows.append(_run(axis, case, method, scan, answer, _settings(case, method)))
    return rows


def _known(case: Case, alignment: str, solved: dict[Any, OfFace]) -> Known | str:
    """Return the truth, or why there is none."""
    overrides = (f"contact.preload_N={case.preload_N!r}", f"contact.alignment={alignment}")
    try:
        return known_answers(case, load_settings(overrides=overrides), solved)
    except ContactError as error:
        return str(error)


def _settings(case: Case, method: str) -> Settings:
    path, overrides = METHODS[method]
    preload = f"contact.preload_N={case.preload_N!r}"
    return load_settings(path, (*overrides, preload, *case.overrides))


def _run(
    axis: Axis, case: Case, method: str, scan: HeightMap, known: Known, settings: Settings
) -> Row:
    begin = clocks()
    try:
        analysis = run_face(scan, settings)
    except CapslipError as error:
        return _row(axis, case, method, outcome="refused", reason=str(error))
    seconds = float((clocks() - begin)[0])
    problems = _severities(analysis.problems)
    m, n = analysis.families.m, analysis.families.n
    row = _row(axis, case, method, seconds=seconds, problems=problems, m=m, n=n)
    row["estimate"] = None if analysis.contact is None else analysis.contact.estimated_error
    if known.counts is not None:
        row["true_m"], row["true_n"] = known.counts
    given = _numbers(analysis, case.shares)
    bounded = [name for name in energy_names(case.shares) if math.isfinite(known.values[name])]
    if given is None or not all(math.isfinite(given[name]) for name in bounded):
        row["outcome"] = "refused"
        said = "; ".join(p.message for p in analysis.problems if p.severity != "info")
        row["reason"] = said or "the joint slides as a whole: the energy of a cycle has no bound"
        return row
    errors = _errors(given, known)
    row["unsure"] = known.uncertainty or None
    row["errors"] = {name: _plain(error) for name, error in errors.items()}
    row["worst"] = max(errors, key=lambda name: abs(errors[name]))
    greatest = abs(errors[row["worst"]])
    row["error"] = _plain(greatest)
    right_counts = known.counts is None or known.counts == (m, n)
    wrong = greatest > BREAKDOWN or not right_counts
    named = any(code in axis.codes for code in _warnings(row))
    noted = False
    rest = max(abs(error) for name, error in errors.items() if name != "approach")
    if rest <= BREAKDOWN:  # what no other answer reads is only noted: the approach, and m and n
        counts_noted = right_counts or any(one in problems for one in (*axis.codes, *COUNT_CODES))
        first_noted = greatest <= BREAKDOWN or FIRST_CODE in problems
        noted = counts_noted and first_noted
    if wrong:
        row["outcome"] = "noted" if noted else "silent"
        if analysis.status != "ok":
            row["outcome"] = "told" if named or noted else "doubted"
    else:
        row["outcome"] = "right" if analysis.status == "ok" else "warned"
    return row


def _row(axis: Axis, case: Case, method: str, **found: Any) -> Row:
    row: Row = dict.fromkeys(
            (*("outcome", "error", "worst", "errors", "unsure", "estimate"),
         *("m", "n", "true_m", "true_n", "reason"))
    )  # fmt: skip
    row["seconds"] = None
    row |= {"axis": axis.name, "name": case.name, "severity": case.severity, "method": method}
    return row | {"problems": {}} | found


def _errors(given: dict[str, float], known: Known) -> dict[str, float]:
    """Return signed relative errors, less what the truth itself is unsure of."""
    errors = {}
    for name, true in known.values.items():
        if not math.isfinite(true):  # an energy beyond gross slip, where none should be given
            errors[name] = math.inf if math.isfinite(given[name]) else 0.0
            continue
        error = given[name] / true - 1.0 if true else math.inf  # full contact loses nothing
        rest = max(0.0, abs(error) - known.uncertainty)
        errors[name] = math.copysign(rest, error)
    return errors


def _numbers(analysis: Analysis, shares: tuple[float, ...]) -> dict[str, float] | None:
    """Return what is compared; None where the caps did not carry the preload."""
    contact, slip = analysis.contact, analysis.slip
    if contact is None or slip is None:
        return None
    energies_J = slip.energy_at_force_J(np.array(shares) * slip.total_slip_force_N)
    return {
        "approach": contact.approach_m - contact.bulk_m,
        "stiffness": float(slip.tangential_stiffness_N_per_m),
        **dict(zip(energy_names(shares), energies_J.tolist(), strict=True)),
    }


def _about(axis: Axis, rows: list[Row], methods: tuple[str, ...]) -> Row:
    severities = list(dict.fromkeys(case.severity for case in axis.cases))
    found: Row = {"name": axis.name, "quantity": axis.quantity, "severities": severities}
    found |= {"logarithmic": axis.logarithmic, "methods": {}}
    for method in methods:
        mine = [row for row in rows if row["method"] == method]
        broken = [
            severity
            for severity in severities
            if any(_broken(row) for row in mine if row["severity"] == severity)
        ]
        first = severities.index(broken[0]) if broken else None
        beyond = [row for row in mine if _broken(row)]
        said = Counter(
            code
            for row in beyond
            for code, severity in row["problems"].items()
            if severity != "info"
        )
        found["methods"][method] = {
            "breaks_at": None if first is None else severities[first],
            "holds_to": severities[-1]
            if first is None
            else (severities[first - 1] if first else None),
            "says": [[code, count] for code, count in said.most_common(4)],
            "outcomes": dict(Counter(row["outcome"] for row in mine)),
        }
    return found


def _severities(problems: Iterable[Problem]) -> dict[str, str]:
    """Return how severe each code is where it is most: one may be said twice, of other forces."""
    mildest_first = sorted(problems, key=lambda one: get_args(Severity).index(one.severity))
    return {one.code: one.severity for one in mildest_first}


def _warnings(row: Row) -> list[str]:
    return [code for code, severity in row["problems"].items() if severity != "info"]


def _broken(row: Row) -> bool:
    return row["outcome"] in ("told", "doubted", "noted", "silent", "refused")


def _totals(runs: list[Row], method: str) -> Row:
    mine = [row for row in runs if row["method"] == method]
    outcomes = Counter(row["outcome"] for row in mine)
    known = len(mine) - outcomes["no truth"]
    return {
        "cases": known,
        "outcomes": dict(outcomes),
        "silent_share": outcomes["silent"] / max(known, 1),
        "seconds_a_case": float(
            np.median([row["seconds"] for row in mine if row["seconds"]] or [0])
        ),
    }


def _estimates(runs: list[Row], method: str, what: Iterable[Axis]) -> Row:
    """Return how often a model's estimate is less than its error in stiffness or energy.

    And the median of their ratio. There an error counts as at least what the truth is unsure of:
    below that nobody knows how far too great an estimate is.
    """
    known = {axis.name for axis in what if not axis.misread}
    too_low, ratios = [], []
    for row in runs:
        mine = row["method"] == method and row["axis"] in known
        if mine and row["estimate"] is not None and row["errors"]:
            errors = [error for name, error in row["errors"].items() if name != "approach"]
            if None not in errors:
                error = max(LEAST_ERROR, *map(abs, errors))
                too_low.append(row["estimate"] < error)
                ratios.append(row["estimate"] / max(error, row["unsure"] or 0.0))
    if not ratios:
        return {"cases": 0, "too_low_share": None, "median_ratio": None}
    return {
        "cases": len(ratios),
        "too_low_share": float(np.mean(too_low)),
        "median_ratio": float(np.median(ratios)),
    }


def _plain(number: float) -> float | None:
    """Return a number that JSON knows."""
    return float(number) if math.isfinite(number) else None
