"""Where the method breaks, and what it says there: every axis is driven until nothing is left."""

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from capslip.analysis import analyze
from capslip.contact.bulk import bulk_compliance_m_per_N, without_bulk
from capslip.contact.material import composite
from capslip.contact.models.interacting import interacting
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.errors import CapslipError, ContactError, OutputError
from capslip.result import Analysis
from capslip.settings import Settings, load_settings
from capslip.studies.chart_reference import reference
from capslip.studies.limits_axes import axes
from capslip.studies.limits_cases import Axis, Case, Row, clean
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap
from capslip.surface.synthetic import Truth, synthetic_surface

SCHEMA = "capslip/limits/1"
BREAKDOWN = 0.10  # relative error at which a method counts as broken
CUBIC_BELOW = 1e-3  # share of total slip below which the energy follows the cube of the force
PAPER_CONFIG = Path(__file__).parents[2] / "configs" / "peyret2016.toml"
METHODS: dict[str, Path | None] = {"default": None, "the paper's way": PAPER_CONFIG}
FRESH_SEED = 11  # of faces on which no threshold of the program was ever judged
SILENT_KEYS = ("method", "axis", "name", "error", "worst", "m", "n", "true_m", "true_n")


@dataclass(frozen=True)
class Known:
    """The true answers of a case; NaN where there is none."""

    values: dict[str, float]
    uncertainty: dict[str, float]  # relative, of each
    counts: tuple[int, int] | None  # m and n, None where the face has no families
    pressure_Pa: float | None = None  # greatest true pressure, where the truth is caps


@dataclass
class _Answers:
    """Truths that several cases share."""

    by_boundary_elements: dict[Any, Any] = field(default_factory=dict)


def limits(
    folder: str | Path, progress: Callable[[str], None] = lambda message: None
) -> dict[str, Any]:
    """Drive all axes until the method breaks; write `limits.json`, `limits.md` and `limits.png`.

    The program learned from its silent failures on these faces, so the default settings are tried
    on fresh ones, too: other faces and noise of the same kinds.

    Parameters
    ----------
    folder : path
        Made where absent; files of the same names are replaced.
    progress : callable, optional
        Called with one line for each axis.

    Returns
    -------
    dict
        What the JSON file holds.

    Raises
    ------
    OutputError
        If the folder cannot be made or written.
    """
    from capslip.studies.limits_figures import limits_figure, limits_markdown

    results = measure(axes(), progress=progress)
    fresh = measure(axes(FRESH_SEED), ("default",), lambda line: progress(f"fresh faces, {line}"))
    results["fresh"] = {"seed": FRESH_SEED, "totals": fresh["totals"], "silent": fresh["silent"]}
    results["seconds"] += fresh["seconds"]
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(results, indent=1, ensure_ascii=False, allow_nan=False)
        (folder / "limits.json").write_text(text + "\n", encoding="utf-8")
        (folder / "limits.md").write_text(limits_markdown(results), encoding="utf-8")
        limits_figure(results).savefig(folder / "limits.png")
    except OSError as error:
        raise OutputError(f"output folder {folder}: {error.strerror}; choose another") from error
    return results


def measure(
    what: Iterable[Axis],
    methods: Iterable[str] = tuple(METHODS),
    progress: Callable[[str], None] = lambda message: None,
) -> dict[str, Any]:
    """Run the methods on the cases of some axes.

    An answer is wrong where its greatest relative error exceeds 10 % (approach, stiffness, energies
    at the forces of the case), or where m or n is not that of the face. The outcome of a case is

    right
        and nothing of at least a warning was said,
    warned
        right, but a warning was given,
    told
        wrong, and a warning names the cause,
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
        `totals`; and the names of the `silent` ones.
    """
    begin = time.perf_counter()
    methods = tuple(methods)
    answers = _Answers()
    runs: list[Row] = []
    found_axes: list[Row] = []
    for axis in what:
        started = time.perf_counter()
        rows = [row for case in axis.cases for row in _run_case(axis, case, methods, answers)]
        runs += rows
        found_axes.append(_about(axis, rows, methods))
        silent = [row["method"] for row in rows if row["outcome"] == "silent"]
        said = ", ".join(f"{silent.count(method)} silent ({method})" for method in methods)
        took_s = time.perf_counter() - started
        progress(f"{axis.name}: {len(axis.cases)} cases, {said}, {took_s:.0f} s")
    return {
        "schema": SCHEMA,
        "breakdown_error": BREAKDOWN,
        "seconds": time.perf_counter() - begin,
        "totals": {method: _totals(runs, method) for method in methods},
        "axes": found_axes,
        "silent": [
            {key: row[key] for key in SILENT_KEYS} for row in runs if row["outcome"] == "silent"
        ],
        "runs": runs,
    }


def _run_case(axis: Axis, case: Case, methods: tuple[str, ...], answers: _Answers) -> list[Row]:
    settings = load_settings(overrides=_overrides(case))
    try:
        known = _known(case, settings, answers)
    except ContactError as error:
        return [
            _row(axis, case, method, outcome="no truth", reason=str(error)) for method in methods
        ]
    scan, truth = synthetic_surface(case.scene, case.name)
    if case.face_change is not None:
        scan = case.face_change(scan, truth)
    if case.scan_change is not None:
        scan = case.scan_change(scan, truth)
    overrides = _overrides(case)
    if case.yield_share is not None and known.pressure_Pa is not None:
        yield_Pa = known.pressure_Pa / (1.6 * case.yield_share)
        overrides = (*overrides, f"material.yield_stress_Pa={yield_Pa!r}")
    return [_run(axis, case, method, scan, known, overrides) for method in methods]


def _overrides(case: Case) -> tuple[str, ...]:
    return (f"contact.preload_N={case.preload_N!r}", *case.overrides)


def _run(
    axis: Axis,
    case: Case,
    method: str,
    scan: HeightMap,
    known: Known,
    overrides: tuple[str, ...],
) -> Row:
    begin = time.perf_counter()
    try:
        analysis = analyze(scan, load_settings(METHODS[method], overrides))
    except CapslipError as error:
        return _row(axis, case, method, outcome="refused", reason=str(error))
    seconds = time.perf_counter() - begin
    problems = {p.code: p.severity for p in analysis.problems}
    m, n = analysis.families.m, analysis.families.n
    row = _row(axis, case, method, seconds=seconds, problems=problems, m=m, n=n)
    if known.counts is not None:
        row["true_m"], row["true_n"] = known.counts
    given = _numbers(analysis, case.shares)
    if given is None or not all(math.isfinite(given[name]) for name in _energies(case.shares)):
        row["outcome"] = "refused"
        said = "; ".join(p.message for p in analysis.problems if p.severity != "info")
        row["reason"] = said or "the joint slides as a whole: the energy of a cycle has no bound"
        return row
    errors = _errors(given, known)
    if case.yield_share is not None:
        errors["elastic"] = max(0.0, case.yield_share - 1.0)
    row["errors"] = {name: _plain(error) for name, error in errors.items()}
    row["worst"] = max(errors, key=lambda name: abs(errors[name]))
    greatest = abs(errors[row["worst"]])
    row["error"] = _plain(greatest)
    right_counts = known.counts is None or known.counts == (m, n)
    wrong = greatest > BREAKDOWN or not right_counts
    named = any(code in axis.codes for code in _warnings(row))
    if wrong:
        doubted = "doubted" if analysis.status != "ok" else "silent"
        row["outcome"] = "told" if named else doubted
    else:
        row["outcome"] = "right" if analysis.status == "ok" else "warned"
    return row


def _row(axis: Axis, case: Case, method: str, **found: Any) -> Row:
    row: Row = dict.fromkeys(
        ("outcome", "error", "worst", "errors", "m", "n", "true_m", "true_n", "reason", "seconds")
    )
    row |= {"axis": axis.name, "name": case.name, "severity": case.severity, "method": method}
    return row | {"problems": {}} | found


def _energies(shares: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(f"energy at {share:g} mu N" for share in shares)


def _errors(given: dict[str, float], known: Known) -> dict[str, float]:
    """Return signed relative errors, less what the truth itself is unsure of."""
    errors = {}
    for name, true in known.values.items():
        if not math.isfinite(true):  # an energy beyond gross slip, where none should be given
            errors[name] = math.inf if math.isfinite(given[name]) else 0.0
            continue
        error = given[name] / true - 1.0 if true else math.inf  # full contact loses nothing
        rest = max(0.0, abs(error) - known.uncertainty.get(name, 0.0))
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
        **dict(zip(_energies(shares), energies_J.tolist(), strict=True)),
    }


def _known(case: Case, settings: Settings, answers: _Answers) -> Known:
    """Return the truth: that of the true caps where the face has nothing else, or of the face."""
    scene = clean(case.scene)
    caps_alone = case.face_change is None and not scene.caps and not scene.waviness_rms_m
    face, truth = synthetic_surface(scene, case.name)
    counts = None
    if truth.family.size and (truth.family != "").all():
        counts = (int((truth.family == "G").sum()), int((truth.family == "P").sum()))
    if caps_alone and not scene.roughness_rms_m:
        known = _known_of_caps(case, truth, face, settings, counts)
        if known is not None:
            return known
    key = (scene, case.face_change, case.preload_N)
    if key not in answers.by_boundary_elements:
        if case.face_change is not None:
            face = case.face_change(face, truth)
        level, _ = remove_form(face, "plane")
        answers.by_boundary_elements[key] = reference(level, settings, with_peak=False)
    found = answers.by_boundary_elements[key]
    names = {"approach": "approach_without_bulk", "stiffness": "stiffness_without_bulk"}
    if found.numbers["stiffness_without_bulk"] is None:
        names = {"approach": "approach_without_bulk", "stiffness": "stiffness"}
    names |= {
        ours: f"energy_{share:g}"
        for ours, share in zip(_energies(case.shares), case.shares, strict=True)
    }
    return Known(
        values={ours: found.numbers[theirs] for ours, theirs in names.items()},
        uncertainty={ours: found.uncertainty.get(theirs, 0.0) for ours, theirs in names.items()},
        counts=counts,
    )


def _known_of_caps(
    case: Case,
    truth: Truth,
    face: HeightMap,
    settings: Settings,
    counts: tuple[int, int] | None,
) -> Known | None:
    """Return the answers of the true caps; None where their contacts merge."""
    material, preload_N = settings.material, case.preload_N
    joint = composite(material.youngs_modulus_Pa, material.poisson_ratio)
    depth_m = truth.peak_height_m.max() - truth.peak_height_m
    curve = interacting(truth.radius_m, depth_m, truth.x_m, truth.y_m, joint.E_star_Pa)
    approach_m = float(curve.approach_m(preload_N))
    if curve.overlapping_pairs(approach_m):
        return None
    load_N = curve.asperity_loads_N(approach_m)
    a_m = contact_radius_m(load_N, curve.radius_m, joint.E_star_Pa)
    touching = load_N > 0.0
    bulk_m_per_N = bulk_compliance_m_per_N(face.side_m, joint.E_star_Pa)
    rest, _ = without_bulk(curve, bulk_m_per_N, preload_N)
    slip = slip_curve(rest, preload_N, material.friction_coefficient, joint.kappa)
    # Far below total slip the cube law holds: an answer that does not hang on small differences.
    shares = np.array(case.shares)
    solved = np.maximum(shares, CUBIC_BELOW)
    energies_J = slip.energy_at_force_J(solved * slip.total_slip_force_N) * (shares / solved) ** 3
    return Known(
        values={
            "approach": approach_m - bulk_m_per_N * preload_N,
            "stiffness": float(slip.tangential_stiffness_N_per_m),
            **dict(zip(_energies(case.shares), energies_J.tolist(), strict=True)),
        },
        uncertainty={},
        counts=counts,
        pressure_Pa=float((1.5 * load_N[touching] / (np.pi * a_m[touching] ** 2)).max()),
    )


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


def _warnings(row: Row) -> list[str]:
    return [code for code, severity in row["problems"].items() if severity != "info"]


def _broken(row: Row) -> bool:
    return row["outcome"] in ("told", "doubted", "silent", "refused")


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


def _plain(number: float) -> float | None:
    """Return a number that JSON knows."""
    return float(number) if math.isfinite(number) else None
