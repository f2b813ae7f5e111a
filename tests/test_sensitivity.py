"""Sensitivity: the stable ranges of answers that are known to be stable there."""

import math
from dataclasses import fields
from types import SimpleNamespace
from unittest import mock

import msgspec
import numpy as np
import pytest

from capslip.analysis import analyze
from capslip.caps.families import group_families
from capslip.caps.table import CapTable
from capslip.contact.models import boundary_elements, families, interacting
from capslip.errors import ContactError
from capslip.output.figures_sensitivity import sensitivity as figure_of
from capslip.pressing import press_face
from capslip.sensitivity import ANSWERS, Answers, answers_of, sensitivity
from capslip.settings import settings_from
from capslip.stages import Clock, find_face
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from scenes import REFERENCE, caps_map

SMALL = HeightMap(np.random.default_rng(0).normal(size=(40, 60)), (1e-4, 1e-4))
STEADY = np.array([5.0, 18.0, 2.4e-7, 23.8, 26.7, 3e-7, 1e-7])
NO_ERROR = np.full(len(ANSWERS), np.nan)
AS_LEVELLED = {"contact": {"alignment": "as_levelled"}, "run": {"sensitivity": True}}


def swept_by(answer, surface, settings, n_caps, pruning_m):
    """Sweep with the answers of a function in place of those of the stages."""

    def answers_of(surface, settings, other, with_contact):
        return answer(surface, settings, with_contact)

    with mock.patch("capslip.sensitivity.answers_of", answers_of):
        return sensitivity(surface, settings, None, n_caps, pruning_m, True)


def cut_of(settings):
    return settings.hills.material_ratio


def swept(value_of, surface=SMALL, error=NO_ERROR, tables=None):
    def answer(_, settings, with_contact):
        return Answers(value_of(settings), error)

    return swept_by(answer, surface, settings_from(tables or {}), 23, math.inf)


def with_W(energy_J):
    value = STEADY.copy()
    value[ANSWERS.index("energy_J")] = energy_J
    return value


def test_an_answer_is_stable_from_where_it_settles_to_where_it_leaves():
    found = swept(lambda s: with_W(1e-7 if 0.05 < cut_of(s) < 0.16 else 2e-7))
    cut = found.sweeps[0]
    assert (cut.stable_from[-1], cut.stable_to[-1]) == pytest.approx((6.0, 15.0))
    assert (cut.stable_from[0], cut.stable_to[0]) == pytest.approx((2.0, 30.0))
    assert "W stable from 6 to 15 %" in cut.sentence
    assert found.problems_for() == ()


def test_a_value_that_comes_back_ends_the_stable_range_all_the_same():
    found = swept(lambda s: with_W(2e-7 if cut_of(s) == 0.20 else 1e-7))
    assert found.sweeps[0].stable_to[-1] == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("cut", "wrong", "holds"),
    [
        (0.08, (0.04, 0.12), True),  # two steps away on either side
        (0.08, (0.06,), False),
        (0.08, (0.10,), False),
        (0.02, (0.06, 0.30), True),  # the first has one neighbour, as has the last
        (0.02, (0.04,), False),
        (0.30, (0.20,), True),
        (0.30, (0.25,), False),
    ],
)
def test_an_answer_holds_that_bears_one_step_to_either_side(cut, wrong, holds):
    found = swept(
        lambda s: with_W(2e-7 if cut_of(s) in wrong else 1e-7),
        tables={"hills": {"material_ratio": cut}},
    )
    assert found.sweeps[0].holds.tolist() == [True] * 6 + [holds]


def test_no_filter_is_longer_than_the_shorter_side():
    surface = HeightMap(np.random.default_rng(0).normal(size=(20, 60)), (1e-4, 1e-4))
    tables = {"conditioning": {"s_filter_nesting_index_m": 1.5e-3}}
    sweep = next(
        one
        for one in swept(lambda _: STEADY, surface, tables=tables).sweeps
        if one.name == "filter"
    )
    assert sweep.value == pytest.approx([0.0, 750.0, 1500.0])  # not 3 mm, on 2 mm


def test_an_answer_that_one_step_moves_is_a_problem():
    found = swept(lambda s: with_W(1e-6 * cut_of(s)))
    (problem,) = found.problems_for()
    assert (problem.code, problem.severity) == ("sensitive_to_cut", "warning")
    assert "decides on W: from 8 to 12 %" in problem.message
    assert "W stable at 10 % alone" in problem.message


@pytest.mark.parametrize(
    ("moved", "answering", "severities"),
    [  # of the cut and of the levelling
        ("energy_J", families, ("warning", "warning")),
        ("energy_J", interacting, ("warning", "warning")),
        ("approach_m", interacting, ("warning", "warning")),
        ("energy_J", boundary_elements, ("info", "warning")),
        ("m", families, ("warning", "warning")),
        ("m", interacting, ("info", "info")),
        ("radius_P_m", interacting, ("info", "info")),
        ("m", boundary_elements, ("info", "info")),
        ("h_m", None, ("warning", "warning")),
    ],
)
def test_what_the_model_that_answers_does_not_read_is_no_warning(moved, answering, severities):
    """Families are read by one model alone, and the map is neither cut nor pruned."""

    def value_of(settings):
        value = STEADY.copy()
        value[ANSWERS.index(moved)] *= (
            1.0 + 10.0 * cut_of(settings) + settings.conditioning.form_floor
        )
        return value

    found = swept(value_of).problems_for(answering and answering.RUNG)
    said = {problem.code: problem.severity for problem in found}
    assert (said["sensitive_to_cut"], said["sensitive_to_levelling"]) == severities


def test_the_error_bar_is_two_standard_errors_or_the_tolerance():
    error = NO_ERROR.copy()
    error[2] = 1e-8

    def answer(settings):
        value = STEADY.copy()
        value[2] *= 1.0 + 0.5 * (cut_of(settings) - 0.10)  # 5 % at 20 %
        return value

    by_error = swept(answer, error=error)
    assert by_error.error_bar[2] == pytest.approx(2e-8)
    assert by_error.sweeps[0].stable_to[2] == pytest.approx(25.0)
    by_tolerance = swept(answer, tables={"contact": {"tolerance": 0.03}})
    assert by_tolerance.error_bar[2] == pytest.approx(0.03 * 2.4e-7)
    assert by_tolerance.sweeps[0].stable_to[2] == pytest.approx(15.0)


def test_the_counts_and_h_have_the_errors_of_the_families():
    heights = np.concatenate((np.linspace(0.0, 1.0, 9), np.linspace(1.6, 2.6, 12)))
    columns = {field.name: np.ones(21) for field in fields(CapTable)}
    columns |= {"flags": np.zeros(21, np.uint16), "peak_height_m": heights}
    caps = CapTable(**columns)
    families = group_families(caps, 2)[1]
    face = SimpleNamespace(families=families)
    with mock.patch("capslip.sensitivity.find_face", return_value=face):
        found = answers_of(SMALL, settings_from({}), None, False)
    assert families.count_se > 0.0
    assert found.standard_error[:3].tolist() == [
        families.count_se,
        families.count_se,
        families.h_se_m,
    ]
    assert np.isnan(found.standard_error[3:]).all()
    assert found.value[:3].tolist() == [families.m, families.n, families.h_m]


def test_the_energy_is_that_at_half_the_force_of_total_slip():
    face = caps_map([(8e-3, 8e-3, 24.0, 0.0), (2e-2, 1e-2, 24.0, 0.0)])
    settings = settings_from({"contact": {"model": "caps", "alignment": "as_levelled"}})
    found = find_face(face, settings, None, Clock())
    contact, _, slip = press_face(found, settings, Clock())
    value = dict(zip(ANSWERS, answers_of(face, settings, None, True).value, strict=True))
    assert value["approach_m"] == contact.approach_m
    expected_J = slip.energy_at_force_J(0.5 * slip.total_slip_force_N)
    assert value["energy_J"] == pytest.approx(float(expected_J))
    assert value["radius_G_m"] == found.families.G.radius_m


@pytest.mark.long
def test_a_run_that_fails_is_no_answer_and_ends_the_range():
    def fails_at_15(surface, settings, other, clock):
        if cut_of(settings) == 0.15:
            raise ContactError("nothing carries the load")
        return find_face(surface, settings, other, clock)

    face = caps_map([(8e-3, 8e-3, 24.0, 0.0), (2e-2, 1e-2, 24.0, 0.0)])
    with mock.patch("capslip.sensitivity.find_face", fails_at_15):
        found = sensitivity(face, settings_from({}), None, 2, math.inf, with_contact=False)
    cut = found.sweeps[0]
    assert np.isnan(cut.answer[6]).all()
    known = np.isfinite(cut.answer[cut.chosen])
    assert known.any()
    assert cut.stable_to[known] == pytest.approx(12.0)


def test_nothing_found_anywhere_says_nothing():
    found = swept(lambda _: np.full(7, np.nan))
    assert (found.problems_for(), found.sweeps) == ((), ())
    assert figure_of(SimpleNamespace(sensitivity=found)) is None


@pytest.mark.parametrize("cut", [0.10, 0.07, 0.5])
def test_the_chosen_cut_is_among_the_swept(cut):
    sweep = swept(lambda _: STEADY, tables={"hills": {"material_ratio": cut}}).sweeps[0]
    assert sweep.value[sweep.chosen] == pytest.approx(100 * cut)
    assert (np.diff(sweep.value) > 0).all()


class Pruned(msgspec.Struct):
    material_ratio: float = 0.10
    pruning_height_m: float | None = None
    pruning_percent_Sz: float | None = 5.0


def test_the_pruning_is_swept_around_the_height_that_was_used():
    asked = []

    def answer(_, settings, with_contact):
        asked.append(settings.hills)
        moved = settings.hills.pruning_height_m == pytest.approx(2e-8)
        return Answers(with_W(2e-7 if moved else 1e-7), NO_ERROR)

    settings = msgspec.structs.replace(settings_from({}), hills=Pruned())
    found = swept_by(answer, SMALL, settings, 23, 1e-8)
    pruning = found.sweeps[1]
    assert pruning.value == pytest.approx([2.5, 5.0, 10.0, 20.0])  # nm
    assert pruning.stable_to[-1] == pytest.approx(10.0)
    assert [problem.code for problem in found.problems_for()] == ["sensitive_to_pruning"]
    for hills in asked:  # one of the two ways to say it, never both
        assert (hills.pruning_height_m is None) == (hills.pruning_percent_Sz is not None)


@pytest.mark.parametrize(
    ("index_m", "expected_um"),
    [(None, [0, 400, 800]), (1e-3, [0, 500, 1000, 2000]), (7e-4, [0, 700, 1400])],
)
def test_the_filter_goes_from_none_to_more_and_never_below_four_pixels(index_m, expected_um):
    asked = []

    def answer(_, settings, with_contact):
        asked.append(settings.conditioning.s_filter_nesting_index_m)
        return Answers(STEADY, NO_ERROR)

    tables = {} if index_m is None else {"conditioning": {"s_filter_nesting_index_m": index_m}}
    found = swept_by(answer, SMALL, settings_from(tables), 23, math.inf)
    sweep = next(sweep for sweep in found.sweeps if sweep.name == "filter")
    assert sweep.value == pytest.approx(expected_um)
    assert sweep.value[sweep.chosen] == pytest.approx((index_m or 0.0) * 1e6)
    assert None in asked
    assert 0.0 not in asked


@pytest.mark.parametrize("form", ["plane", "quadratic", "none"])
@pytest.mark.parametrize("floor", [False, True])
def test_the_face_is_levelled_the_other_way(form, floor):
    asked = []

    def answer(_, settings, with_contact):
        asked.append((settings.conditioning.form, settings.conditioning.form_floor))
        moved = asked[-1] != (form, floor)
        return Answers(with_W(2e-7 if moved else 1e-7), NO_ERROR)

    tables = {"conditioning": {"form": form, "form_floor": floor}}
    found = swept_by(answer, SMALL, settings_from(tables), 23, math.inf)
    other = ("plane", floor) if form == "none" else (form, not floor)
    assert set(asked) == {(form, floor), other}
    assert asked.count(other) == 1  # one run: the sweep has little time
    (problem,) = found.problems_for()
    assert (problem.code, problem.severity) == ("sensitive_to_levelling", "warning")
    assert problem.message.startswith("the levelling decides on W: a tilt of some nm")
    assert "or a bow, decides which caps touch" in problem.message  # no tilt, in balance
    sweep = found.sweeps[-1]
    labels = ("no form removed", "plane")
    if form != "none":
        labels = (f"least-squares {form}", f"{form} of the lowest third")
    energies = "2e-07 J / 1e-07 J" if floor and form != "none" else "1e-07 J / 2e-07 J"
    assert sweep.sentence in problem.message
    assert sweep.sentence == (
        f"levelling, {' / '.join(labels)}: m 5, n 18, h 2.4e-07 m, R_G 23.8 m, R_P 26.7 m, "
        f"approach with bulk 3e-07 m, W {energies}."
    )
    plain = found.to_dict()[sweep.setting]
    assert plain["value"] == labels
    assert plain["chosen"] == labels[sweep.chosen]
    assert plain["stable_to"]["energy_J"] == plain["chosen"]


def test_levelling_that_moves_nothing_is_no_problem():
    found = swept(lambda _: STEADY)
    assert found.problems_for() == ()
    assert found.sweeps[-1].name == "levelling"
    assert found.sweeps[-1].holds.all()


@pytest.mark.parametrize(
    ("options", "codes"),
    [
        ({}, {"sensitive_to_levelling"}),
        ({"form": "quadratic"}, {"sensitive_to_levelling"}),
        ({"form": "none"}, {"sensitive_to_levelling", "tilt_left"}),
    ],
)
def test_caps_on_one_side_name_the_levelling(options, codes):
    """Six spheres on a flat floor, the lower three on one side: h is 240 nm."""
    places_m = ((10, 10), (30, 12), (50, 10), (12, 30), (32, 30), (50, 28))
    caps = [
        (1e-3 * x, 1e-3 * y, 24.0, -2.4e-7 if i > 2 else 0.0) for i, (x, y) in enumerate(places_m)
    ]
    face = caps_map(caps, (200, 300), (2e-4, 2e-4), floor_m=-8e-7)
    found = analyze(face, settings_from({"conditioning": options, **AS_LEVELLED}))
    said = {problem.code: problem.message for problem in found.problems}
    assert codes <= set(said)
    assert found.status == "check"
    if "tilt_left" in codes:  # here the floor is level, and taking the plane off is the error
        assert "the levelling decides" in said["tilt_left"]
        assert "leave it" in said["tilt_left"]
        assert found.families.h_m == pytest.approx(2.4e-7, rel=1e-3)


@pytest.mark.long
@pytest.mark.skipif(not REFERENCE.is_dir(), reason="the reference faces are not at hand")
def test_the_reference_face_of_caps_names_the_levelling():
    """5 G-caps and 18 P-caps; the plane is tilted by 0.2 um, and 11 of the 18 are left."""
    found = analyze(load_surface(REFERENCE / "caps.h5"), settings_from(AS_LEVELLED))
    assert "sensitive_to_levelling" in {problem.code for problem in found.problems}


@pytest.mark.parametrize(
    ("model", "n_caps", "used"),
    [
        ("auto", 23, "interacting"),
        ("auto", 100, "interacting"),
        ("auto", 101, "mean_field"),
        ("interacting", 100, "interacting"),
        ("interacting", 101, "mean_field"),
        ("boundary_elements", 23, "interacting"),
        ("families", 900, "families"),
    ],
)
def test_all_runs_use_one_cheap_model(model, n_caps, used):
    models = set()

    def answer(_, settings, with_contact):
        models.add(settings.contact.model)
        return Answers(STEADY, NO_ERROR)

    swept_by(answer, SMALL, settings_from({"contact": {"model": model}}), n_caps, math.inf)
    assert models == {used}


def test_a_coarser_map_is_used_where_it_gives_the_same_answers():
    y, x = np.mgrid[0:500, 0:601]
    height_m = 1e-6 * x - 2e-6 * y
    height_m[10, 10] = np.nan
    height_m[20:22, 20:22] = np.nan
    height_m[30, 30] = height_m[30, 31] = height_m[31, 30] = np.nan
    fine = HeightMap(height_m, (1e-4, 2e-4))
    seen = []

    def answer(surface, _, with_contact):
        seen.append(surface)
        return Answers(STEADY, NO_ERROR)

    swept_by(answer, fine, settings_from({}), 23, math.inf)
    coarse = seen[1]
    assert [surface.shape for surface in seen] == [(500, 601)] + [(250, 300)] * (len(seen) - 1)
    assert coarse.pixel_size_m == pytest.approx((2e-4, 4e-4))
    assert coarse.height_m[50, 50] == pytest.approx(1e-6 * 100.5 - 2e-6 * 100.5)
    assert coarse.height_m[5, 5] == pytest.approx(-32e-6 / 3.0)  # of three
    assert coarse.height_m[15, 15] == pytest.approx(-31e-6)  # of one point alone
    assert (~coarse.measured).sum() == 1

    seen.clear()

    def answer_of_the_grid(surface, _, with_contact):
        seen.append(surface)
        return Answers(with_W(1e-7 * surface.pixel_size_m[0]), NO_ERROR)

    swept_by(answer_of_the_grid, fine, settings_from({}), 23, math.inf)
    assert sum(surface.shape == (250, 300) for surface in seen) == 1


@pytest.mark.long
def test_a_face_of_caps_is_stable_and_its_figure_is_drawn():
    scene = Scene(
        shape=(400, 600),
        pixel_size_m=(1e-4, 1e-4),
        seed=2,
        families=(CapFamily("G", 2, 23.8), CapFamily("P", 9, 26.7, 2.4e-7)),
        floor_m=4e-7,
        noise_rms_m=1e-9,
    )
    face, _ = synthetic_surface(scene)

    found = sensitivity(face, settings_from({}), None, 11, math.inf, with_contact=True)
    for sweep in found.sweeps:
        assert sweep.holds.all(), sweep.sentence
    cut = found.sweeps[0]
    assert (cut.stable_from <= 8).all()
    assert (cut.stable_to >= 12).all()
    assert cut.answer[cut.chosen, :2] == pytest.approx([2, 9])
    assert cut.answer[cut.chosen, 2] == pytest.approx(2.4e-7, rel=0.02)

    plain = found.to_dict()["hills.material_ratio"]
    assert plain["stable_to"]["m"] >= 12
    assert plain["m"][cut.chosen] == 2

    figure = figure_of(SimpleNamespace(sensitivity=found))
    panels = [axes for axes in figure.axes if axes.lines]
    assert len(panels) == 5 * len(found.sweeps)
    assert panels[0].get_ylabel() == "caps"
    figure.canvas.draw()


def test_no_sweep_no_figure():
    assert figure_of(SimpleNamespace(sensitivity=None)) is None
