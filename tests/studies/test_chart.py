"""A small chart: the ladder is a ladder, the reference is certified, the choice is honest."""

import csv
import json
import math
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from capslip.settings import load_settings
from capslip.studies.chart import statistics, study
from capslip.studies.chart.figures import PICTURES, figures
from capslip.studies.chart.measure import measure
from capslip.studies.chart.methods import PAPER, methods
from capslip.studies.chart.reference import ENERGIES, QUANTITIES
from capslip.studies.chart.text import chart_markdown
from capslip.studies.faces.scenes import BLOCK, cases, make_face, scan_cases

LADDER = ("families", "caps", "mean_field", "interacting")
BOUNDARY = "boundary elements, by grid"
INTERACTING = "interacting, contact, watershed"
CAPS = (0, 3, 6)  # of the paper, equal ones, ones of all heights
WAVES = (8,)


@pytest.fixture(scope="module")
def results():
    wanted = {PAPER, *(f"{model}, contact, watershed" for model in LADDER)}
    small = [
        method
        for method in methods()
        if (method.line in wanted and method.setting == "1/1")
        or (method.line == "boundary elements, by grid" and method.coarsening < 4)
        or (method.line, method.setting) == ("auto", "5 %")
    ]
    everything = cases()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("capslip.studies.chart.measure.QUICK_S", 0.0)  # each is timed once
        return measure([half(everything[i]) for i in CAPS + WAVES], small, with_peak=False)


def half(case):
    """Return a case on half of the face, as loaded per cap; pixels of caps twice as wide."""
    scene, (ny, nx) = case.scene, case.scene.shape
    families = [replace(one, count=max(1, one.count // 2)) for one in scene.families]
    if len(families) > 4:  # each cap is a family of its own
        families = families[::2]
    small = replace(scene, shape=(ny // 2, nx), families=tuple(families))
    if case.group == "caps":  # whose contacts are some 60 pixels across
        pixel_m = tuple(2.0 * side_m for side_m in scene.pixel_size_m)
        small = replace(small, shape=(ny // 4, nx // 2), pixel_size_m=pixel_m)
    return replace(case, scene=small, preload_N=0.5 * case.preload_N)


def median(results, line, quantity, group="caps", setting="1/1"):
    for point in results["points"]:
        if (point["line"], point["setting"]) == (line, setting):
            return point["groups"][group][quantity][0]
    raise AssertionError(f"no point of {line} at {setting}")


def test_every_method_is_made_of_settings():
    found = methods()
    assert len(found) == len({(method.line, method.setting) for method in found})
    for method in found:
        load_settings(overrides=method.overrides_on((200, 300), (2e-4, 2e-4)))


def test_scenes_are_seeded_and_seen_through_larger_pixels():
    case = cases()[0]
    one, two = make_face(case), make_face(case)
    assert np.array_equal(one.measured.height_m, two.measured.height_m)
    assert one.fine.side_m == pytest.approx(one.measured.side_m)
    assert one.measured.pixel_size_m[0] == BLOCK * one.fine.pixel_size_m[0]
    assert one.measured.height_m.mean() == pytest.approx(one.fine.height_m.mean(), abs=1e-15)
    assert cases(1)[0].scene != case.scene
    assert len(cases()) >= 12


def test_noise_is_on_the_measured_map_alone():
    noisy = next(case for case in cases() if case.noise_rms_m == 5e-9)
    clean = next(c for c in cases() if c.scene == noisy.scene and not c.noise_rms_m)
    difference_m = make_face(noisy).measured.height_m - make_face(clean).measured.height_m
    assert difference_m.std() == pytest.approx(5e-9, rel=0.02)
    assert np.array_equal(make_face(noisy).fine.height_m, make_face(clean).fine.height_m)


@pytest.mark.long
def test_the_reference_is_certified(results):
    for case in results["cases"]:
        known = case["reference"]
        certificate = known["certificate"]
        assert abs(certificate["load_balance"]) < 1e-12
        assert certificate["least_gap"] > -1e-8
        assert certificate["least_pressure"] >= 0.0
        assert certificate["complementarity"] < 1e-8
        assert known["pixels_across"] > 10
        assert known["uncertainty"]["energy_0.5"] < 0.02


@pytest.mark.long
@pytest.mark.parametrize("quantity", ["energy_0.25", "energy_0.5", "approach", "stiffness"])
def test_no_rung_is_worse_than_the_one_below(results, quantity):
    errors = [median(results, f"{model}, contact, watershed", quantity) for model in LADDER]
    # What the reference is unsure of decides nothing
    unsure = max(case["reference"]["uncertainty"].get(quantity, 0.002) for case in results["cases"])
    for lower, higher in pairwise(errors):
        assert higher <= max(lower * (1 + 1e-6), unsure)
    assert errors[3] < 0.2 * errors[0]
    # Spheres are known better than pixels tell; boundary elements have those of the measured map
    assert median(results, BOUNDARY, quantity) <= max(errors[3], BLOCK * unsure)


@pytest.mark.long
@pytest.mark.parametrize("quantity", ["energy_0.1", "energy_0.5", "approach", "stiffness"])
def test_on_waves_boundary_elements_are_the_top_of_the_ladder(results, quantity):
    top, below = (median(results, line, quantity, "waves") for line in (BOUNDARY, INTERACTING))
    assert top < below


@pytest.mark.long
def test_interacting_caps_are_good_on_faces_of_caps(results):
    for quantity in ("energy_0.25", "energy_0.5", "stiffness"):
        assert median(results, INTERACTING, quantity) < 0.01
    assert median(results, PAPER, "energy_0.25") > 0.05


@pytest.mark.long
def test_a_coarser_grid_costs_boundary_elements_accuracy_and_saves_time(results):
    for quantity, sign in (("approach", 1), ("seconds", -1)):
        full, half = (median(results, BOUNDARY, quantity, "all", s) for s in ("1/1", "1/2"))
        assert sign * half > sign * full


@pytest.mark.long
def test_the_automatic_choice_is_honest(results):
    found = results["honesty"]["same"]
    assert len(found) == len(CAPS) + len(WAVES)
    for row in found:
        if row["estimated"] is None or row["estimated"] > row["requested"]:
            assert {"boundary_elements_needed", "levelling_decides"} & set(row["problems"])
        if row["estimated"] is not None:
            assert row["true"] <= row["estimated"]
    # caps or map: the choice goes on until the answer is within what was asked
    for row in found:
        assert row["estimated"] is not None
        assert row["estimated"] <= row["requested"]


@pytest.mark.long
def test_the_pareto_front_is_not_dominated(results):
    place = {
        (p["line"], p["setting"]): (
            p["groups"]["all"]["seconds"][0],
            p["groups"]["all"]["energy"][0] or math.inf,
        )
        for p in results["points"]
    }
    front = [tuple(pair) for pair in results["pareto"]["energy"]]
    for one in front:
        for other in place.values():
            assert not (other[0] < place[one][0] and other[1] < place[one][1])


def test_a_method_without_an_answer_counts_as_infinitely_wrong():
    assert statistics.median_and_range([math.inf, math.inf, 0.1]) == [None, 0.1, None]


@pytest.mark.long
def test_what_is_written(results, tmp_path):
    results = {**results, "seconds": 1.0}
    results["honesty"]["fresh"] = results["honesty"]["same"]
    json.dumps(results, allow_nan=False)
    (tmp_path / "runs.csv").write_text(study.runs_csv(results["runs"]), encoding="utf-8")
    with (tmp_path / "runs.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(results["runs"])
    assert {f"error_{name}" for name in (*QUANTITIES, *ENERGIES)} <= set(rows[0])
    page = chart_markdown(results)
    assert "None" not in page
    assert page.count("\n1. ") == 1
    assert page.count("\n5. ") == 1
    for name, figure in figures(results).items():
        figure.savefig(tmp_path / f"{name}.png", dpi=40)
        assert f"({name}.png)" in page


@pytest.mark.long
def test_names_of_points_do_not_overprint(results):
    """Settings that hardly differ have one name; the ends of a scale keep theirs."""
    (paper,) = (point for point in results["points"] if point["line"] == PAPER)

    def later(setting, times):
        group = paper["groups"]["all"]
        seconds = [times * group["seconds"][0], *group["seconds"][1:]]
        return paper | {"setting": setting, "groups": {"all": group | {"seconds": seconds}}}

    near, far = [later("1/2", 1.01), later("1/4", 1.02)], later("1/8", 3.0)
    more = results | {"points": [*results["points"], *near, far]}
    drawn = figures(more)
    for name in PICTURES:
        drawn[name].canvas.draw()
    for axes in (axes for name in PICTURES for axes in drawn[name].axes if axes.texts):
        texts = [text.get_text() for text in axes.texts]
        assert texts.count("1/8") == 1
        assert "1/1" in texts
        assert "1/4" not in texts
        boxes = [(text.get_ha(), text.get_window_extent()) for text in axes.texts]
        for (side, one), (other_side, other) in combinations(boxes, 2):
            assert side != other_side or not one.overlaps(other)


def test_scans_become_cases(scans):
    found = scan_cases(scans)
    assert len(found) >= 5
    face = make_face(found[0])
    assert max(face.measured.shape) <= 300
    assert face.truth is None
