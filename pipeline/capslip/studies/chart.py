"""Speed against accuracy: every method on the same faces, against boundary elements."""

import csv
import json
import math
import platform
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from capslip.analysis import analyze_once
from capslip.errors import CapslipError, ContactError, OutputError
from capslip.result import Analysis
from capslip.settings import load_settings
from capslip.studies.chart_methods import Method, methods
from capslip.studies.chart_reference import (
    ENERGIES,
    QUANTITIES,
    Reference,
    numbers_of,
    reference,
)
from capslip.studies.scenes import Case, Face, cases, make_face, scan_cases
from capslip.surface.conditioning import condition

SCHEMA = "capslip/chart/1"
ENERGY = "energy"  # the worst of the four forces
CAP_QUANTITIES = ("m", "n", "h", "R_G", "R_P")
FRESH_SEEDS = (101, 102, 103, 104, 105)  # faces on which nothing was developed
QUICK_S = 0.5  # what takes less on the whole map is timed three times
Row = dict[str, Any]


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
    from capslip.studies.chart_figures import figures
    from capslip.studies.chart_text import chart_markdown

    begin = time.perf_counter()
    everything = cases() + (scan_cases(scans) if scans is not None else ())
    results = measure(everything, methods(), progress)
    results["honesty"]["fresh"] = honesty(FRESH_SEEDS, progress)
    results["seconds"] = time.perf_counter() - begin
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        table = {name: _rounded(part) for name, part in results.items() if name != "runs"}
        text = json.dumps(table, ensure_ascii=False, allow_nan=False)
        (folder / "speed-accuracy.json").write_text(text + "\n", encoding="utf-8")
        (folder / "speed-accuracy.md").write_text(chart_markdown(results), encoding="utf-8")
        _write_csv(folder / "speed-accuracy.csv", results["runs"])
        for name, figure in figures(results).items():
            figure.savefig(folder / f"{name}.png")
    except OSError as error:
        raise OutputError(
            f"output folder {folder}: {error.strerror}; choose another with --out"
        ) from error
    return results


def measure(
    what: Iterable[Case],
    how: Iterable[Method],
    progress: Callable[[str], None] = lambda message: None,
    with_peak: bool = True,
) -> dict[str, Any]:
    """Run methods on cases and compare them with the reference.

    Parameters
    ----------
    what, how
        Cases and methods.
    progress : callable, optional
        Called with one line for each face.
    with_peak : bool
        Whether the reference finds the peak of the loss factor, which takes most of its time.

    Returns
    -------
    dict
        `cases`, each with its reference; `runs`, one a method and case, with signed relative
        errors; `points`, one a method, with median and range of the absolute errors over the cases
        of each group; `pareto`, the points that no other beats in both; `honesty` of auto.
    """
    how = tuple(how)
    known: dict[tuple[Any, float], Reference | str] = {}
    found: list[Row] = []
    runs: list[Row] = []
    for case in what:
        progress(case.name)
        face = make_face(case)
        begin = time.perf_counter()
        key = (case.scene or case.path, case.preload_N)
        if key not in known:
            known[key] = _reference(face, case, with_peak)
        answer = known[key]
        found.append({**_about(case, face), "seconds": time.perf_counter() - begin})
        if isinstance(answer, str):
            found[-1]["no_reference"] = answer
            continue
        found[-1]["reference"] = asdict(answer)
        # What pixels cost is measured where the truth is known
        wanted = [method for method in how if case.group != "scan" or method.coarsening == 1]
        runs += [_run(method, case, face, answer) for method in wanted]
    points = _points(runs)
    return {
        "schema": SCHEMA,
        "machine": machine(),
        "cases": found,
        "runs": runs,
        "points": points,
        "pareto": {name: _pareto(points, name) for name in (*QUANTITIES, ENERGY)},
        "honesty": {"same": [run["auto"] for run in runs if run["auto"]]},
    }


def honesty(
    seeds: Iterable[int], progress: Callable[[str], None] = lambda message: None
) -> list[Row]:
    """Run the automatic choice on other faces; return its estimates beside the true errors."""
    auto = Method("auto", "default", ())
    known: dict[tuple[Any, float], Reference | str] = {}
    found = []
    for seed in seeds:
        progress(f"automatic choice, seed {seed}")
        for case in cases(seed):
            face = make_face(case)
            key = (case.scene, case.preload_N)
            if key not in known:
                known[key] = _reference(face, case, False)
            answer = known[key]
            if isinstance(answer, Reference):
                found.append({"seed": seed, **_run(auto, case, face, answer)["auto"]})
    return found


def machine() -> dict[str, str]:
    """Return processor, system and versions."""
    packages = ("capslip", "numpy", "scipy", "scikit-image")
    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        processor = f"{len(names)} x {names[0]}" if names else processor
    except OSError:
        pass  # not Linux
    versions = {name: metadata.version(name) for name in packages}
    return {
        "processor": processor,
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        **versions,
    }


def _overrides(case: Case) -> tuple[str, ...]:
    return (f"contact.preload_N={case.preload_N}",)


def _reference(face: Face, case: Case, with_peak: bool) -> Reference | str:
    """Return the reference, or why there is none."""
    level = condition(face.fine).surface
    try:
        return reference(level, load_settings(overrides=_overrides(case)), with_peak=with_peak)
    except ContactError as error:
        return str(error)


def _about(case: Case, face: Face) -> Row:
    return {
        "name": case.name,
        "group": case.group,
        "preload_N": case.preload_N,
        "noise_rms_m": case.noise_rms_m,
        "shape": list(face.measured.shape),
        "pixel_size_m": list(face.measured.pixel_size_m),
    }


def _run(method: Method, case: Case, face: Face, answer: Reference) -> Row:
    measured = face.measured
    overrides = (*_overrides(case), *method.overrides_on(measured.shape, measured.pixel_size_m))
    settings = load_settings(overrides=overrides)
    row: Row = {"case": case.name, "group": case.group, "line": method.line}
    row |= {"setting": method.setting, "auto": None, "problem": None}
    seconds: list[float] = []
    analysis: Analysis | None = None
    repeats = 3 if method.coarsening == 1 else 1
    while not seconds or (len(seconds) < repeats and seconds[0] < QUICK_S):
        begin = time.perf_counter()
        try:
            analysis = analyze_once(measured, settings)
        except CapslipError as error:
            row["problem"] = str(error)
        seconds.append(time.perf_counter() - begin)
    row["seconds"] = float(np.median(seconds))
    numbers = numbers_of(analysis) if analysis else dict.fromkeys(QUANTITIES)
    row["errors"] = _errors(numbers, answer.numbers)
    row["cap_errors"] = _cap_errors(analysis, face) if analysis else None
    if analysis and analysis.contact is None:
        row["problem"] = "; ".join(p.message for p in analysis.problems if p.severity != "info")
    if analysis and analysis.contact and method.line == "auto":
        row["auto"] = _auto(analysis, case, method, row["errors"], answer)
    return row


def _errors(numbers: dict[str, Any], truth: dict[str, Any]) -> Row:
    """Return signed relative errors of what the reference has; None where a method has none."""
    errors: Row = {
        name: None if numbers[name] is None else numbers[name] / truth[name] - 1.0
        for name in QUANTITIES
        if truth[name] is not None
    }
    energies = [errors[name] for name in ENERGIES if name in errors]
    if energies:
        errors[ENERGY] = None if None in energies else max(energies, key=abs)
    return errors


def _cap_errors(analysis: Analysis, face: Face) -> Row | None:
    """Compare counts, heights and radii of the families with those the face was made of."""
    truth = face.truth
    if truth is None or not (truth.family != "").all():
        return None
    families = analysis.families
    of = {name: truth.family == name for name in "GP"}
    peak_m = {name: truth.peak_height_m[mask].mean() for name, mask in of.items() if mask.any()}
    radius_m = {name: truth.radius_m[mask].mean() for name, mask in of.items() if mask.any()}
    errors: Row = dict.fromkeys(CAP_QUANTITIES)
    errors |= {"m": families.m - int(of["G"].sum()), "n": families.n - int(of["P"].sum())}
    if "P" in peak_m and families.h_m is not None:
        errors["h"] = float(families.h_m / (peak_m["G"] - peak_m["P"]) - 1.0)
    for name, family in (("G", families.G), ("P", families.P)):
        if family is not None and name in radius_m:
            errors[f"R_{name}"] = float(family.radius_m / radius_m[name] - 1.0)
    return errors


def _auto(analysis: Analysis, case: Case, method: Method, errors: Row, answer: Reference) -> Row:
    """Set the estimate of the automatic choice beside the true error.

    What the reference itself is unsure of is taken off first.
    """
    accuracy = analysis.summary()["accuracy"]
    without = errors.get("stiffness_without_bulk") is not None
    stiffness = "stiffness_without_bulk" if without else "stiffness"
    compared = (*ENERGIES, stiffness)
    known = all(errors.get(name) is not None for name in compared)
    return {
        "case": case.name,
        "group": case.group,
        "setting": method.setting,
        "model": analysis.contact.model if analysis.contact else None,
        "reason": accuracy["model_reason"],
        "requested": accuracy["requested"],
        "estimated": accuracy["estimated"],
        "true": max(max(0.0, abs(errors[name]) - answer.uncertainty[name]) for name in compared)
        if known
        else None,
        "problems": [p.code for p in analysis.problems],
    }


def _points(runs: list[Row]) -> list[Row]:
    """Collect median and range over the cases of each group, for each method."""
    methods_met = list(dict.fromkeys((run["line"], run["setting"]) for run in runs))
    points = []
    for line, setting in methods_met:
        mine = [run for run in runs if (run["line"], run["setting"]) == (line, setting)]
        point: Row = {"line": line, "setting": setting, "groups": {}}
        groups = {"all": [run for run in mine if run["group"] != "scan"]}
        for run in mine:
            groups.setdefault(run["group"], []).append(run)
        for group, members in groups.items():
            if members:
                point["groups"][group] = _statistics(members)
        points.append(point)
    return points


def _statistics(runs: list[Row]) -> Row:
    row: Row = {"seconds": _median_and_range([run["seconds"] for run in runs])}
    row["failed"] = sum(run["errors"]["approach"] is None for run in runs)
    for name in (*QUANTITIES, ENERGY):
        # A method without a number where the reference has one is infinitely wrong.
        errors = [run["errors"][name] for run in runs if name in run["errors"]]
        row[name] = _median_and_range([math.inf if e is None else abs(e) for e in errors])
    for name in CAP_QUANTITIES:
        known = [run["cap_errors"][name] for run in runs if run["cap_errors"]]
        row[name] = _median_and_range([abs(e) for e in known if e is not None])
    return row


def _median_and_range(values: list[float]) -> list[float | None] | None:
    """Return median, least and greatest; infinite ones as None."""
    if not values:
        return None
    numbers = (float(np.median(values)), min(values), max(values))
    return [float(x) if math.isfinite(x) else None for x in numbers]


def _pareto(points: list[Row], quantity: str) -> list[list[str]]:
    """Return line and setting of the points that no faster one equals in the median error."""
    known = []
    for point in points:
        group = point["groups"].get("all")
        if group and group[quantity] and group[quantity][0] is not None:
            known.append((group["seconds"][0], group[quantity][0], point))
    front, least = [], math.inf
    for _, error, point in sorted(known, key=lambda entry: entry[:2]):
        if error < least:
            least = error
            front.append([point["line"], point["setting"]])
    return front


def _write_csv(path: Path, runs: list[Row]) -> None:
    columns = ["case", "group", "line", "setting", "seconds"]
    errors = [*QUANTITIES, ENERGY]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*columns, *(f"error_{name}" for name in errors), *CAP_QUANTITIES])
        for run in runs:
            caps = run["cap_errors"] or {}
            row = [run[name] for name in columns]
            row += [run["errors"].get(name) for name in errors]
            row += [caps.get(name) for name in CAP_QUANTITIES]
            writer.writerow(_rounded(row))


def _rounded(value: Any) -> Any:
    """Return the same with four digits; no run repeats more of them."""
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value
