"""The limits study: no case of a small run fails without a word."""

import ast
import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import capslip
from capslip.analysis import analyze_once
from capslip.caps.table import CapFlag
from capslip.contact.rung import load_point_m
from capslip.contact.solvers import refinement
from capslip.errors import SettingsError
from capslip.problems import Problem
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import synthetic_surface
from capslip.studies.limits.axes import axes as made_axes
from capslip.studies.limits.case import Axis, clean
from capslip.studies.limits.known import slip_of_true_caps
from capslip.studies.limits.measure import BREAKDOWN, _estimates, _severities, measure
from capslip.studies.limits.study import FRESH_SEED, limits
from capslip.studies.limits.tries import harmless_faces, scattered_face

axes = cache(made_axes)  # which lays many faces to find how they tilt
DOCS = Path(__file__).parents[2] / "docs"
SOURCE = Path(capslip.__file__).parent
# What stands in the braces of the codes that are put together
BRACES = {
    "caps_{flag.name}": [flag.name for flag in CapFlag],
    "sensitive_to_{sweep.name.split()[0]}": ["cut", "pruning", "filter", "levelling"],
}
TOO_DEAR = ("many pixels",)
SPARSE = ("scattered missing points",)  # of which only the first face is cheap
DEAR = (
    "wavy faces",
    "self-affine faces",
    "roughness",
    "grinding lay",
    "elongated caps",
    "high load",
)
DEAREST = ("grinding lay", "high load")  # the more, the dearer


def thinned(axis):
    """One case about where things go wrong, and one where nothing is left: not the dearest face."""
    cases = axis.cases
    early = 4 if axis.name in DEAREST else 2
    middle, last = cases[len(cases) // early], cases[-3 if axis.name in SPARSE else -2]
    return replace(axis, cases=(middle,) if axis.name in DEAR else (middle, last))


@pytest.fixture(scope="module")
def found():
    """On half as many points across a contact: no error is as small as what that changes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(refinement, "_WIDE", 0.5 * refinement._WIDE)
        return measured_thinned()


def measured_thinned():
    return measure([thinned(axis) for axis in axes() if axis.name not in TOO_DEAR], ("default",))


def test_at_least_400_cases_on_16_axes():
    everything = axes()
    assert len({axis.name for axis in everything}) == len(everything) >= 16
    assert sum(len(axis.cases) for axis in everything) >= 400
    for axis in everything:
        assert all(case.axis == axis.name for case in axis.cases)
        names = [case.name for case in axis.cases]
        assert len(set(names)) == len(names)


def codes_of_the_program():
    """All codes of problems, from the source: the first argument wherever one is made."""
    codes = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
                continue
            if node.func.id not in ("Problem", "doubt"):  # `doubt` collects them in doubts.py
                continue
            match node.args[0]:
                case ast.Constant(value=code):
                    codes.add(code)
                case ast.JoinedStr():
                    text = ast.unparse(node.args[0])[2:-1]
                    codes |= {f"{text.split('{')[0]}{word}" for word in BRACES[text]}
    return codes


def test_the_codes_that_name_a_cause_are_those_of_the_program():
    known = codes_of_the_program()
    assert {"families_doubtful", "caps_edge", "sensitive_to_cut", "slope_suspect"} <= known
    for axis in axes():
        assert set(axis.codes) <= known, axis.name


@pytest.mark.long
def test_another_seed_gives_other_faces_of_the_same_kinds():
    ours, theirs, others = axes(), made_axes(0), axes(1)
    for i, (axis, same, other) in enumerate(zip(ours, theirs, others, strict=True)):
        assert (axis.name, axis.codes) == (other.name, other.codes)
        if axis.name != "levelling":  # how far the places tilt a plane is up to them
            assert [case.severity for case in axis.cases] == [c.severity for c in other.cases]
        if axis.name in TOO_DEAR:
            continue
        # Most axes begin with the same faces: each is looked at on every other axis
        one, two, three = (of.cases[i % 2] for of in (axis, same, other))
        np.testing.assert_array_equal(scan_of(one), scan_of(two))
        assert (scan_of(one) != scan_of(three)).mean() > 0.01


@pytest.mark.parametrize("seed", [470002, 13204004, 13269005])
def test_a_face_whose_caps_do_not_all_reach_the_cut_is_drawn_again(seed):
    face = scattered_face(2.2e-8, seed)
    _, truth = synthetic_surface(face)
    assert truth.peak_height_m.min() > truth.cut_height_m
    assert face == scattered_face(2.2e-8, seed)
    beyond = scattered_face(1e-6, seed)  # of a spread at which none is made, it is said
    with pytest.raises(SettingsError, match="would not reach the cut"):
        synthetic_surface(beyond)


made = cache(synthetic_surface)  # most axes change the same few faces


def scan_of(case):
    scan, truth = made(case.scene)
    for change in (case.face_change, case.scan_change):
        scan = scan if change is None else change(scan, truth)
    return scan.height_m


def test_a_code_that_is_said_twice_is_as_severe_as_it_is_once():
    twice = [Problem("small_slip_extrapolated", one, "so") for one in ("warning", "info")]
    for said in (twice, twice[::-1]):
        assert _severities(said) == {"small_slip_extrapolated": "warning"}


@pytest.mark.long
def test_no_silent_failure(found):
    assert found["silent"] == []


@pytest.mark.long
def test_every_case_has_a_truth_and_an_outcome(found):
    assert {run["outcome"] for run in found["runs"]} <= {
        "right",
        "warned",
        "noted",
        "told",
        "doubted",
        "refused",
    }


def test_harmless_faces_are_right_and_nothing_is_said():
    first = next(axis for axis in axes() if axis.name == "gross slip")
    harmless = replace(first, cases=first.cases[: len(harmless_faces(0))])
    for run in measure([harmless], ("default",))["runs"]:
        assert run["outcome"] == "right", run
        assert run["error"] < 0.02


def test_no_energy_beyond_gross_slip_is_right():
    axis = next(axis for axis in axes() if axis.name == "gross slip")
    beyond = next(case for case in axis.cases if case.shares[0] > 1.0)
    assert [run["outcome"] for run in measure([replace(axis, cases=(beyond,))], ("default",))[
        "runs"]] == ["right"]  # fmt: skip


def test_the_truth_does_not_see_the_scan():
    for scene, _ in harmless_faces(0).values():
        spoilt = replace(scene, noise_rms_m=1e-7, tilt=(1e-3, 0.0), non_measured_fraction=0.1)
        face, truth = synthetic_surface(clean(spoilt))
        expected, _ = synthetic_surface(scene)
        np.testing.assert_array_equal(face.height_m, expected.height_m)
        assert truth.peak_height_m.max() == pytest.approx(face.height_m.max(), abs=1e-9)


def test_a_wrong_answer_without_a_word_is_called_silent():
    """Heights 1.5 times too great on a face without blemish: nothing can tell."""
    axis = next(axis for axis in axes() if axis.name == "heights in a wrong unit")
    case = replace(axis.cases[2], scan_change=lambda surface, truth: stretched(surface, 1.5))
    result = measure([replace(axis, cases=(case,))], ("default",))
    run = result["runs"][0]
    assert run["error"] > BREAKDOWN
    assert run["outcome"] == "silent"
    assert result["totals"]["default"]["silent_share"] == 1.0
    assert result["silent"][0]["name"] == case.name
    assert result["estimates"]["default"]["cases"] == 0  # no model can know the unit

    result = measure([replace(axis, cases=(case,), misread=False)], ("default",))
    run, held = result["runs"][0], result["estimates"]["default"]
    worst = max(abs(error) for name, error in run["errors"].items() if name != "approach")
    assert held == {
        "cases": 1,
        "too_low_share": 1.0,
        "median_ratio": pytest.approx(run["estimate"] / worst),
    }


def test_no_estimate_is_blamed_for_what_the_truth_is_unsure_of():
    """Nor excused by it: an error that is left when it is taken off counts as it is."""
    axis = Axis("waves", "", (), lambda seed, value: (), ())
    row = {"method": "default", "axis": "waves", "estimate": 0.012, "unsure": 0.01}
    errors = (0.0, 0.0005, 0.006, 0.02, 0.012)
    rows = [row | {"errors": {"stiffness": -one, "approach": 1.0}} for one in errors]
    held = _estimates(rows, "default", [axis])
    assert held == {"cases": 5, "too_low_share": 0.2, "median_ratio": pytest.approx(1.2)}
    sure = [one | {"unsure": None} for one in rows]
    held = _estimates(sure, "default", [axis])
    assert held == {"cases": 5, "too_low_share": 0.2, "median_ratio": pytest.approx(2.0)}


@pytest.mark.long
def test_rows_of_two_processes_are_those_of_one():
    axis = next(axis for axis in axes() if axis.name == "gross slip")
    few = [replace(axis, cases=axis.cases[:2])]
    told = []
    alone, shared = measure(few, ("default",)), measure(few, ("default",), told.append, workers=2)
    assert [run["name"] for run in alone["runs"]] == [case.name for case in few[0].cases]
    for one, other in zip(alone["runs"], shared["runs"], strict=True):
        assert one.pop("seconds") > 0.0
        assert other.pop("seconds") > 0.0
        assert one == other
    assert told[-1] == "2 of 2 cases, 0 silent"


def stretched(surface, factor):
    return replace(surface, height_m=factor * surface.height_m)


@pytest.mark.long
def test_the_files(tmp_path, monkeypatch):
    few = [
        replace(axis, cases=axis.cases[-1:])
        for axis in axes()
        if axis.name in ("gross slip", "low load")
    ]
    asked = []

    def some(seed=0):
        asked.append(seed)
        return tuple(few)

    monkeypatch.setattr("capslip.studies.limits.study.axes", some)
    results = limits(tmp_path)
    assert json.loads((tmp_path / "limits.json").read_text(encoding="utf-8")) == results
    page = (tmp_path / "limits.md").read_text(encoding="utf-8")
    for axis in few:
        assert f"| {axis.name} |" in page
    assert (tmp_path / "limits.png").stat().st_size > 10_000
    assert asked == [0, FRESH_SEED]
    n_cases = sum(len(axis.cases) for axis in few)
    assert results["fresh"]["totals"]["default"]["cases"] == n_cases
    assert "fresh faces" in page
    held = results["fresh"]["estimates"]["default"]
    row = f"| fresh faces | {held['cases']} | {held['too_low_share']:.1%} |"
    assert row in page


def test_committed_numbers():
    committed = json.loads((DOCS / "limits.json").read_text(encoding="utf-8"))
    total = committed["totals"]["default"]
    assert total["cases"] >= 400
    assert total["silent_share"] < 0.02
    assert {axis["name"] for axis in committed["axes"]} == {axis.name for axis in axes()}
    fresh = committed["fresh"]
    assert fresh["seed"] == FRESH_SEED
    assert fresh["totals"]["default"]["cases"] >= 400
    assert fresh["totals"]["default"]["silent_share"] < 0.02
    page = (DOCS / "limits.md").read_text(encoding="utf-8")
    for run in committed["silent"] + fresh["silent"]:
        assert run["name"] in page
    assert math.isfinite(committed["seconds"])


def test_the_true_answer_is_that_of_the_spheres_wherever_the_face_is_turned_to():
    """A slope s moves the top of a sphere by R s along and by R s^2 / 2 up: the same spheres."""
    case = next(case for axis in axes() if axis.name == "small force" for case in axis.cases)
    face, truth = synthetic_surface(clean(case.scene), case.name)
    settings = load_settings(overrides=("contact.preload_N=460",))
    slope = 4e-6
    turned = replace(
        truth,
        x_m=truth.x_m + truth.radius_m * slope,
        peak_height_m=truth.peak_height_m + slope * truth.x_m + 0.5 * truth.radius_m * slope**2,
    )
    energy_J = []
    for one in (truth, turned):
        _, slip = slip_of_true_caps(one, face, settings, 460.0)
        energy_J.append(slip.energy_at_force_J(np.array([0.1, 0.5]) * slip.total_slip_force_N))
    assert energy_J[1] == pytest.approx(energy_J[0], rel=1e-5)


@pytest.mark.long
def test_three_true_caps_nearly_on_one_line_are_balanced():
    """A turn moves their places more than their loads: turn after turn swung to 10 % in energy."""
    (axis,) = (one for one in axes(260) if one.name == "few caps")
    (case,) = (one for one in axis.cases if one.name == "3 caps, 100 N")
    face, truth = synthetic_surface(clean(case.scene), case.name)
    settings = load_settings(overrides=("contact.preload_N=100",))
    curve, slip = slip_of_true_caps(truth, face, settings, 100.0)
    load_N = curve.asperity_loads_N(float(curve.approach_m(100.0)))
    at_m = load_point_m(face, settings)
    moment_Nm = load_N @ (np.column_stack((curve.x_m, curve.y_m)) - at_m)
    assert np.abs(moment_Nm).max() < 1e-9
    found = analyze_once(face, settings).slip
    force_N = np.array([0.25, 0.75]) * slip.total_slip_force_N
    assert found.energy_at_force_J(force_N) == pytest.approx(
        slip.energy_at_force_J(force_N), rel=1e-3
    )
