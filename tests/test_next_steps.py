"""The next step of a problem can be taken, and was not taken already."""

import re
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import capslip
from capslip.analysis import analyze, analyze_once
from capslip.contact.choice import ONE_MAP, WHY, contact_failed
from capslip.contact.rung import rung
from capslip.contact.solvers import polonsky_keer
from capslip.contact.time_needed import boundary_elements_s, more_time
from capslip.errors import BothFailError
from capslip.next_steps import OF_THE_LOAD, OF_THE_PARTS, PRESSED, with_next_steps
from capslip.problems import KINDS, Problem
from capslip.settings import load_settings
from capslip.surface.heightmap import Origin

OF_CAPS = ("not_spherical", "caps_several_peaks", "no_caps", "not_balanced", "few_contacts_in_scan")


def steps(needed=None, model="auto", is_scan=True, pressed="interacting"):
    problems = [Problem(code, "warning", "so") for code in (*OF_CAPS, *OF_THE_PARTS)]
    if needed is not None:
        problems.append(Problem("boundary_elements_needed", "warning", "so", step=needed))
    settings = load_settings(overrides=(f"contact.model={model}",))
    answers = None if pressed is None else rung(pressed)
    found = with_next_steps(problems, SimpleNamespace(is_scan=is_scan), settings, answers)
    assert [one.code for one in found] == [one.code for one in problems]
    return {one.code: one.remedy for one in found}


@pytest.mark.parametrize("model", ["auto", "interacting"])
def test_where_the_map_may_be_pressed_all_steps_are_those_of_their_kind(model):
    assert steps(model=model) == {c: KINDS[c].remedy for c in (*OF_CAPS, *OF_THE_PARTS)}


@pytest.mark.parametrize("instead", [WHY, ONE_MAP])
def test_where_the_map_fails_or_there_is_none_the_other_step_is_left_or_that_to_a_map(instead):
    found = steps(needed=instead)
    assert found["not_spherical"] == found["not_balanced"] == instead
    assert found["caps_several_peaks"] == "--set hills.pruning_height_m=..., lower"
    assert found["no_caps"] == "--set hills.material_ratio=0.2"
    assert found["few_contacts_in_scan"] == KINDS["few_contacts_in_scan"].remedy
    assert not any("--model boundary_elements" in step for step in found.values())


def test_a_map_that_there_was_no_time_for_is_a_step():
    found = steps(needed=None)
    problem = Problem("boundary_elements_needed", "warning", "no time")
    settings = load_settings()
    (one,) = with_next_steps([problem], SimpleNamespace(is_scan=True), settings, rung("caps"))
    assert one.remedy == found["not_spherical"].rstrip(".") == "--model boundary_elements"


def step_of(code, *overrides, pressed="interacting"):
    problem = Problem(code, KINDS[code].severities[0], "so")
    answers = None if pressed is None else rung(pressed)
    settings = load_settings(overrides=overrides)
    (one,) = with_next_steps([problem], SimpleNamespace(is_scan=True), settings, answers)
    return one.remedy


def test_no_step_is_what_the_settings_have_done_already():
    assert "conditioning.outliers=isolated" not in step_of("outliers")
    assert "--set conditioning.outliers=isolated" in step_of(
        "outliers", "conditioning.outliers=none"
    )
    assert "separation" not in step_of("connected_network")
    assert "--set hills.pruning_height_m" in step_of("connected_network")
    as_regions = step_of("connected_network", "hills.separation=regions")
    assert as_regions == "--set hills.separation=watershed; or --model boundary_elements."
    assert step_of("connected_network", pressed="boundary_elements") == PRESSED


@pytest.mark.parametrize("model", ["interacting", "caps", "mean_field", "boundary_elements"])
def test_a_model_that_was_forced_and_fails_gives_way_to_the_choice(model):
    forced = step_of("contact_failed", f"contact.model={model}", pressed=None)
    assert forced.startswith("--model auto")
    assert step_of("contact_failed", pressed=None) == KINDS["contact_failed"].remedy


@pytest.mark.parametrize(
    ("model", "step"),
    [("boundary_elements", WHY), ("auto", WHY), ("caps", "--model boundary_elements.")],
)
def test_where_nothing_was_pressed_the_map_failed_if_it_was_asked_for(model, step):
    assert steps(model=model, pressed=None)["not_spherical"] == step


@pytest.mark.parametrize("model", ["auto", "boundary_elements"])
def test_a_map_that_answers_is_not_to_be_pressed_once_more(model):
    found = steps(model=model, pressed="boundary_elements")
    assert found["not_spherical"] == PRESSED
    assert found["no_caps"] == "--set hills.material_ratio=0.2"
    assert found["bulk_kept"] == KINDS["bulk_kept"].remedy


def test_the_bulk_of_a_scan_is_not_kept_in_a_larger_joint():
    larger, whole = steps(is_scan=False), steps()
    for code, step in OF_THE_PARTS.items():
        assert larger[code] == step
        assert "contact.bulk" not in step
        assert whole[code] == KINDS[code].remedy
    assert larger["not_spherical"] == whole["not_spherical"]


@pytest.mark.parametrize(
    ("side", "limit_s", "step"),
    [
        (64, 1e-3, 10.0),  # less would do for the estimate, and not for contacts that are refined
        (64, 12.0, 120.0),
        (1000, 1e-3, 44.0),
        (1000, 60.0, 600.0),
        (1000, 600.0, 6000.0),
        (1000, 720.0, 7200.0),
    ],
)
def test_a_map_that_was_cut_short_gets_time_enough_by_its_size_and_what_it_had(side, limit_s, step):
    assert more_time((side, side), limit_s) == f"--set contact.time_limit_s={step:g}"


@pytest.mark.long
def test_a_curve_that_was_cut_short_is_whole_within_the_time_that_it_is_told_to_take():
    words = "contact.model=boundary_elements", "contact.preload_N=3"
    late = load_settings(overrides=(*words, "contact.time_limit_s=1e-3"))
    found = {one.code: one.remedy for one in analyze(rough_face(), late).problems}
    assert found["time_limit_reached"] == "--set contact.time_limit_s=10"
    assert found["loss_between_loads"] == "--set contact.time_limit_s=10"
    enough = load_settings(overrides=(*words, "contact.time_limit_s=10"))
    found = {one.code: one.remedy for one in analyze(rough_face(), enough).problems}
    assert "time_limit_reached" not in found
    assert "contact.time_limit_s" not in found.get("loss_between_loads", "")


def test_a_failure_that_knows_its_step_keeps_it_and_so_do_those_that_ask_for_the_map():
    own = "--set contact.time_limit_s=14"
    failed = Problem("contact_failed", "error", "so", step=own)
    other, more = (Problem(one, "warning", "so") for one in ("not_spherical", "not_balanced"))
    several = Problem("caps_several_peaks", "warning", "so")
    for model in ("auto", "boundary_elements", "interacting"):
        settings = load_settings(overrides=(f"contact.model={model}",))
        given = [failed, other, more, several]
        _, *found = with_next_steps(given, SimpleNamespace(is_scan=True), settings, None)
        assert [one.remedy for one in found] == [
            own,
            KINDS["not_balanced"].remedy.replace("--model boundary_elements", own).rstrip("."),
            f"--set hills.pruning_height_m=..., lower; or {own}",
        ]
        asked = with_next_steps([failed], SimpleNamespace(is_scan=True), settings, None)
        assert [one.remedy for one in asked] == [own]


@pytest.mark.parametrize("pressed", [None, "boundary_elements"])
def test_under_a_load_that_no_joint_bears_and_nobody_gave_the_joint_comes_first(pressed):
    """A yielding face, other units or more time are steps for a load that one has."""
    others = ("not_spherical", "time_limit_reached")
    loads = [
        Problem(code, KINDS[code].severities[-1], "so", step="--set contact.time_limit_s=14")
        for code in OF_THE_LOAD
    ]
    problems = [*loads, *(Problem(code, "warning", "so") for code in others)]
    known = Problem("preload_of_demonstration", "warning", "so")
    answers = None if pressed is None else rung(pressed)

    def found(given):
        joint = SimpleNamespace(is_scan=True)
        return with_next_steps(given, joint, load_settings(), answers)

    (first, *rest), without = found([known, *problems]), found(problems)
    assert "--area" in first.remedy
    assert "--pressure" in first.remedy
    assert {one.remedy for one in rest[: len(loads)]} == {first.remedy}
    assert [one.remedy for one in rest[len(loads) :]] == [
        one.remedy for one in without[len(loads) :]
    ]
    assert not any("--area" in one.remedy for one in without)


def rough_face():
    """Return a face whose caps are not enough."""
    z = gaussian_filter(np.random.default_rng(3).standard_normal((64, 64)), 1.5, mode="wrap")
    return capslip.HeightMap(1e-7 * z / z.std(), (1e-5, 1e-5))


@pytest.mark.long
@pytest.mark.parametrize(
    ("preload_N", "code"), [(3.0, "boundary_elements_needed"), (80.0, "contact_failed")]
)
def test_a_map_without_time_gets_enough(preload_N, code):
    """Where caps answer, and where they cannot; what it is told to take is taken and answers."""
    words = (f"contact.preload_N={preload_N}",)
    late = load_settings(overrides=(*words, "contact.time_limit_s=1e-3"))
    short = analyze_once(closing_face(), late)
    (one,) = [problem for problem in short.problems if problem.code == code]
    assert "s, more than 0.001 s of contact.time_limit_s" in one.message
    step = re.match(r"--set (contact\.time_limit_s=[\d.]+)", one.remedy)
    assert ("check the load" in one.remedy) == (code == "contact_failed")
    asked = [problem.remedy for problem in short.problems if problem.code == "not_spherical"]
    assert asked in ([one.remedy.partition(";")[0]], [])
    enough = analyze_once(closing_face(), load_settings(overrides=(*words, step[1])))
    assert enough.contact.model == "boundary_elements"
    assert "time_limit_reached" not in {problem.code for problem in enough.problems}


@pytest.mark.parametrize(
    ("more", "of_map", "step"),
    [
        ("contact.tolerance=0.05", "the map, pressed in their place, fails as well, as 3000 N ",
         "Check the load"),
        ("contact.time_limit_s=1e-3", "the map was not pressed, as boundary elements take ",
         "--set contact.time_limit_s=10; or check the load"),
    ],
)  # fmt: skip
def test_caps_and_map_that_both_fail_say_why_once_each(more, of_map, step):
    given = load_settings(overrides=("contact.preload_N=3000", more))
    (one,) = [p for p in analyze_once(closing_face(), given).problems if p.code == "contact_failed"]
    assert one.message.startswith("the caps (interacting) fail, as 3000 N need a contact area of ")
    assert one.message.count("interacting") == 1
    assert f"; {of_map}" in one.message
    assert "use mean_field" not in one.message
    assert one.remedy.startswith(step)


@pytest.mark.parametrize(
    ("of_map", "step"),
    [
        ("face: 9 points need 2 GB; expected at most 4 points; coarsen the map 3 times",
         "Coarsen the map 3 times; or check the load, --area and units."),
        ("face: 9 N are more than it bears; expected less than 4 N; check preload and units", None),
        ("face: 3 pixels; expected 9; use a finer map or a contact model of caps", None),
        ("face: no solution when contact.time_limit_s was over; allow more",
         "--set contact.time_limit_s=600"),
    ],
)  # fmt: skip
def test_what_a_map_lacks_where_caps_fail_as_well_is_the_next_step(of_map, step):
    failure = BothFailError("mean_field: no cap bears 9 N; expected more; check units", of_map)
    surface = capslip.HeightMap(rough_face().height_m, (1e-5, 1e-5), Origin(name="face"))
    found = contact_failed(failure, surface, load_settings())
    assert found.step == step
    assert found.message.startswith("the caps (mean_field) fail, as no cap bears 9 N, expected ")
    assert "face:" not in found.message
    assert "check" not in found.message


@pytest.mark.parametrize("limit_s", [12.0, 1e-3])
def test_a_map_that_was_out_of_time_gets_ten_times_as_much(limit_s, monkeypatch):
    ticks = count(step=2.0)
    monkeypatch.setattr(polonsky_keer, "thread_time", lambda: next(ticks))
    words = ("contact.model=boundary_elements", "contact.preload_N=0.1")
    late = load_settings(overrides=(*words, f"contact.time_limit_s={limit_s}"))
    (one,) = [p for p in analyze_once(rough_face(), late).problems if p.code == "contact_failed"]
    assert "contact.time_limit_s was over" in one.message
    least_s = boundary_elements_s((64, 64))
    expected_s = max(10.0 * max(limit_s, least_s), 10.0)
    assert one.remedy.startswith("--set contact.time_limit_s=")
    assert float(one.remedy.partition("=")[2]) == pytest.approx(expected_s, rel=0.05)


def closing_face():
    """Return a rough face, flat enough to close under 30 MPa."""
    z = gaussian_filter(np.random.default_rng(3).standard_normal((64, 64)), 3, mode="wrap")
    return capslip.HeightMap(2e-8 * z / z.std(), (1e-5, 1e-5))


@pytest.mark.parametrize("share", [1.0, 3.0])
def test_in_an_analysis(share):
    surface = closing_face()
    area_m2 = share * surface.measured_area_m2
    given = ("contact.model=boundary_elements", "contact.nominal_pressure_Pa=3e7")
    given += (f"joint.area_m2={area_m2!r}", "contact.alignment=as_levelled")
    found = analyze_once(surface, load_settings(overrides=given))
    of_bulk = [one for one in found.problems if one.code in OF_THE_PARTS]
    assert len(of_bulk) == 1
    assert ("contact.bulk=true" in of_bulk[0].remedy) == (share == 1.0)


def test_a_map_of_few_points_in_contact_is_not_named_as_the_next_step():
    given = ("contact.preload_N=1e-6", "contact.alignment=as_levelled")
    found = analyze_once(closing_face(), load_settings(overrides=given))
    (needed,) = (one for one in found.problems if one.code == "boundary_elements_needed")
    assert "but fail" in needed.message
    assert not any("--model boundary_elements" in one.remedy for one in found.problems)
