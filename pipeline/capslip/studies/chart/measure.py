"""Run the methods on the faces and compare each number with that of the reference."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from capslip.analysis import analyze_once
from capslip.errors import CapslipError, ContactError
from capslip.result import Analysis
from capslip.settings import Settings, load_settings
from capslip.studies.chart.methods import AUTO, Method
from capslip.studies.chart.reference import (
    ENERGIES,
    QUANTITIES,
    Reference,
    numbers_of,
    reference,
)
from capslip.studies.chart.statistics import CAP_QUANTITIES, ENERGY, pareto, points_of
from capslip.studies.clock import clocks, in_turns, machine
from capslip.studies.faces.scenes import Case, Face, cases, make_face
from capslip.studies.page import Row
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap

SCHEMA = "capslip/chart/2"
ALIGNMENTS = ("balanced", "as_levelled")
QUICK_S = 0.5  # what takes less on the whole map is timed three times
LIBRARIES = ("capslip", "numpy", "scipy", "scikit-image")


def run_face(surface: HeightMap, settings: Settings) -> Analysis | str:
    """Analyse one face without sensitivity and estimate; return why not where it fails."""
    try:
        return analyze_once(surface, settings)
    except CapslipError as error:
        return str(error)


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
        `cases`, each with its references; `runs`, one a method and case, with signed relative
        errors; `points`, one a method, with median and range of the absolute errors over the cases
        of each group; `pareto`, the points that no other beats in both; `honesty` of auto.
    """
    how = tuple(how)
    found: list[Row] = []
    runs: list[Row] = []
    for case, face, answers, seconds in _references(what, ALIGNMENTS, with_peak, progress):
        found.append({**_about(case, face), "seconds": seconds})
        if isinstance(answers, str):
            found[-1]["no_reference"] = answers
            continue
        found[-1]["reference"] = asdict(answers["balanced"])
        found[-1]["reference_as_levelled"] = asdict(answers["as_levelled"])
        # What pixels cost is measured where the truth is known
        wanted = [method for method in how if case.group != "scan" or method.coarsening == 1]
        runs += [_run(method, case, face, answers) for method in wanted]
    points = points_of(runs)
    return {
        "schema": SCHEMA,
        "machine": machine(*LIBRARIES),
        "cases": found,
        "runs": runs,
        "points": points,
        "pareto": {name: pareto(points, name) for name in (*QUANTITIES, ENERGY)},
        "honesty": {"same": [run["auto"] for run in runs if run["auto"]]},
    }


def honesty(seeds: Iterable[int], progress: Callable[[str], None]) -> list[Row]:
    """Run the automatic choice on other faces; return its estimates beside the true errors."""
    auto = Method(AUTO, "default", ())
    found = []
    for seed in seeds:
        progress(f"automatic choice, seed {seed}")
        for case, face, answers, _ in _references(cases(seed), ("balanced",), with_peak=False):
            if not isinstance(answers, str):
                found.append({"seed": seed, **_run(auto, case, face, answers)["auto"]})
    return found


def _references(
    what: Iterable[Case],
    alignments: tuple[str, ...],
    with_peak: bool,
    progress: Callable[[str], None] = lambda message: None,
) -> Iterator[tuple[Case, Face, dict[str, Reference] | str, float]]:
    """Yield each case, its face, its references (or why there are none), and the seconds of that.

    Each method is compared with the one of its own alignment. Cases that differ in the noise alone
    share theirs.
    """
    known: dict[tuple[Any, float], dict[str, Reference] | str] = {}
    for case in what:
        progress(case.name)
        face = make_face(case)
        begin = clocks()
        key = (case.scene or case.path, case.preload_N)
        if key not in known:
            known[key] = _pressed(face, case, alignments, with_peak)
        yield case, face, known[key], float((clocks() - begin)[0])


def _overrides(case: Case) -> tuple[str, ...]:
    return (f"contact.preload_N={case.preload_N}",)


def _pressed(
    face: Face, case: Case, alignments: tuple[str, ...], with_peak: bool
) -> dict[str, Reference] | str:
    """Return the reference of each alignment, or why there is none."""
    surface, found = condition(face.fine).surface, {}
    for alignment in alignments:
        settings = load_settings(overrides=(*_overrides(case), f"contact.alignment={alignment}"))
        try:
            found[alignment] = reference(surface, settings, with_peak=with_peak)
        except ContactError as error:
            return f"{alignment}: {error}"
    return found


def _about(case: Case, face: Face) -> Row:
    return {
        "name": case.name,
        "group": case.group,
        "preload_N": case.preload_N,
        "noise_rms_m": case.noise_rms_m,
        "shape": list(face.measured.shape),
        "pixel_size_m": list(face.measured.pixel_size_m),
    }


def _run(method: Method, case: Case, face: Face, answers: dict[str, Reference]) -> Row:
    measured = face.measured
    overrides = (*_overrides(case), *method.overrides_on(measured.shape, measured.pixel_size_m))
    settings = load_settings(overrides=overrides)
    answer = answers[settings.contact.alignment]
    turns = 3 if method.coarsening == 1 else 1
    run = [lambda: run_face(method.scan_of(measured), settings)]
    times_s, (analysis,) = in_turns(run, turns, enough_s=QUICK_S)
    row: Row = {"case": case.name, "group": case.group, "line": method.line}
    row |= {"setting": method.setting, "auto": None, "problem": None}
    row["seconds"] = float(np.median(times_s[:, 0, 1]))  # of the processor
    if isinstance(analysis, str):
        errors = _errors(dict.fromkeys(QUANTITIES), answer.numbers)
        return row | {"problem": analysis, "errors": errors, "cap_errors": None}
    row["errors"] = _errors(numbers_of(analysis), answer.numbers)
    row["cap_errors"] = _cap_errors(analysis, face)
    if analysis.contact is None:
        row["problem"] = "; ".join(p.message for p in analysis.problems if p.severity != "info")
    elif method.line == AUTO:
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
