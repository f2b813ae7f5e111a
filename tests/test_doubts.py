"""Which doubts are asked of a face, from how it was levelled and what is asked for."""

from dataclasses import replace
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip import doubts
from capslip.analysis import analyze, analyze_once
from capslip.contact.rung import ModelError
from capslip.problems import Effect, Problem
from capslip.settings import Settings, load_settings
from capslip.surface.doubts import problems_of_tilt
from capslip.surface.flatness import bow_left, problems_of_flatness
from capslip.surface.heightmap import HeightMap
from capslip.units import off_by, share_of
from scenes import PROJECT, caps_map

ASKED = {
    "problems_of_seams": "seams",
    "problems_of_tilt": "tilt",
    "problems_of_bow": "bow of peaks",
    "problems_of_form": "bow of heights",
    "problems_of_fit": "bow of the form",
    "problems_of_flatness": "bow of the instrument",
}


SMALL = "small_slip_extrapolated"
FLATNESS = "instrument.flatness_deviation_m"
PRESSED = HeightMap(np.zeros((3, 4)), (1e-4, 1e-4))


def asked_of(
    form, level=None, approach_m=1e-6, peaks=(), flatness_m=None, seams="known", floor="false"
):
    """Return which doubts are asked after a form was removed, each of which says its name."""
    face = SimpleNamespace(
        level=level,
        family_caps=None,
        conditioned=SimpleNamespace(surface=PRESSED, seams=seams and "seams"),
    )
    known = () if flatness_m is None else (f"{FLATNESS}={flatness_m}",)
    form, _, degree = form.partition(" ")
    known += (f"conditioning.form_degree={degree}",) if degree else ()
    forms = f"conditioning.form={form}", f"conditioning.form_floor={floor}"
    chosen = load_settings(overrides=(*forms, *known))
    answers = {name: mock.Mock(return_value=[word]) for name, word in ASKED.items()}
    answers["problems_of_bow"].return_value = list(peaks)
    answers["leaves_peaks"] = mock.Mock(return_value=seams == "of the floor")
    with mock.patch.multiple(
        doubts, coarse_step=lambda _: 3, coarse_map=lambda _: "few", **answers
    ):
        found = doubts._of_levelling(face, SimpleNamespace(approach_m=approach_m), chosen)
    return found, {name: one.call_args for name, one in answers.items() if one.called}


@pytest.mark.parametrize(
    ("form", "level", "expected"),
    [
        ("none", None, ["seams", "tilt", "bow of heights"]),
        ("none", "level", ["seams", "bow of heights"]),  # found its own tilt
        ("plane", None, ["seams", "bow of heights"]),
        ("plane", "level", ["seams", "bow of heights"]),
        ("quadratic", None, ["seams", "bow of the form"]),
        ("quadratic", "level", ["seams", "bow of the form"]),
    ],
)
def test_a_tilt_or_a_bow_that_was_taken_off_is_not_asked_about(form, level, expected):
    level = level and SimpleNamespace(coarse="coarse")
    found, asked = asked_of(form, level)
    assert found == expected
    if "problems_of_form" in asked:
        seen = mock.call("coarse", 1e-6) if level else mock.call(PRESSED, 1e-6, 3)
        assert asked["problems_of_form"] == seen
    assert asked_of(form, level, approach_m=0.0) == ([], {})  # a flat interface: nothing decides


@pytest.mark.parametrize(
    ("form", "degree"),
    [("plane", None), ("polynomial 1", None), ("quadratic", 2), ("sphere", 2), ("cylinder", 2),
     ("polynomial 2", 2), ("polynomial 5", 5)],
)  # fmt: skip
def test_a_form_that_takes_bows_off_is_asked_what_it_made_of_the_floor(form, degree):
    """The bow of the instrument went with it; one that was fitted to the floor leaves none."""
    level = SimpleNamespace(coarse="coarse")
    for given in ({"peaks": ["bow of peaks"]}, {"flatness_m": 2e-7}):
        found, asked = asked_of(form, level, **given)
        assert (found == ["seams", "bow of the form"]) == (degree is not None)
        if degree:
            assert asked["problems_of_fit"] == mock.call("coarse", 1e-6, degree)
    assert asked_of(form)[1].get("problems_of_fit") == (degree and mock.call("few", 1e-6, degree))
    assert "bow of the form" not in asked_of(form, floor="true")[0]


@pytest.mark.parametrize("seams", [None, "of the floor"])
def test_no_seams_or_those_of_the_floor_alone_are_not_asked_about(seams):
    assert asked_of("quadratic", seams=seams)[0] == ["bow of the form"]


def test_a_bow_is_told_by_the_instrument_before_the_peaks_before_the_heights():
    assert asked_of("plane", peaks=["bow of peaks"])[0] == ["seams", "bow of peaks"]
    found, asked = asked_of("plane", peaks=["bow of peaks"], flatness_m=2e-7)
    assert found == ["seams", "bow of the instrument"]
    assert asked["problems_of_flatness"] == mock.call(2e-7, 1e-6)


def test_a_bow_of_the_instrument_is_twice_in_the_sum_of_two_scans():
    one, none = (load_settings(overrides=sets) for sets in ((f"{FLATNESS}=2e-7",), ()))
    both = replace(PRESSED, faces=2)
    assert doubts.known_flatness_m(PRESSED, one) == 2e-7
    assert doubts.known_flatness_m(both, one) == 4e-7
    assert doubts.known_flatness_m(both, none) is None
    off = load_settings(overrides=(f"{FLATNESS}=2e-7", "conditioning.form=quadratic"))
    assert doubts.known_flatness_m(PRESSED, off) is None  # the form took it off


@pytest.mark.parametrize("first_m", [None, 1.51e-6])
def test_problems_of_a_face_that_yielded_name_what_it_recovers(first_m):
    tilted = HeightMap(np.arange(12.0).reshape(3, 4) * 1e-6, (1e-4, 1e-4))
    problems = [
        bow_left("the peaks lie on a bow", 5.15e-6, 4.99e-7),
        *problems_of_flatness(1e-6, 4.99e-7),
        *problems_of_tilt(tilted, 4.99e-7),
        Problem("waves_longer_than_scan", "warning", "out of its spectrum, 20% of the approach: x"),
    ]
    elastic = SimpleNamespace(approach_m=4.99e-7, first_loading_approach_m=4.99e-7)
    assert len(problems) == 4
    assert doubts._naming_recovery(problems, elastic) == problems
    assert all("the approach" in one.message for one in problems)
    yielded = SimpleNamespace(approach_m=4.99e-7, first_loading_approach_m=first_m)
    said = [one.message for one in doubts._naming_recovery(problems, yielded)]
    assert all("the approach" not in one for one in said)
    assert all("the recovery on unloading is 4.99e-07 m" in one for one in said[:3])
    assert said[3] == "out of its spectrum, 20% of the recovery on unloading: x"


def test_what_lies_outside_is_compared_with_half_the_usual_diameter():
    hills = SimpleNamespace(
        usable=np.array([True, True, False, True]), diameter_m=np.array([2.0, 6.0, 90.0, 4.0])
    )
    face = SimpleNamespace(family_caps=hills, conditioned=SimpleNamespace(surface="pressed"))
    with mock.patch.object(doubts, "problems_of_outline", return_value=["said"]) as asked:
        assert doubts._of_outline(face) == ["said"]
        hills.usable = np.zeros(4, dtype=bool)
        assert doubts._of_outline(face) == []
    asked.assert_called_once_with("pressed", 2.0)


@pytest.mark.parametrize(
    ("share", "least", "errors", "doubted"),
    [
        (0.05, 0.1, None, True),
        (0.1, 0.1, None, False),  # what pixels resolve begins there
        (0.15, 0.1, None, False),
        (0.15, 0.1, 0.06, True),  # pixels resolve it, and leave more than the tolerance
        (0.15, 0.1, 0.04, False),
        (0.25, 0.1, 0.3, False),  # from a quarter on the estimate itself says it
        (0.5, None, 0.3, False),  # a model without pixels
        (0.15, None, None, False),
        (0.15, None, 0.06, True),  # caps in place of a map, whose error falls with the force, too
        (0.15, None, 0.04, False),
    ],
)
def test_small_slip_is_doubted_where_pixels_leave_more_than_was_asked(
    share, least, errors, doubted
):
    rung = SimpleNamespace(least_share=least and (lambda curve, load_N: least))
    known = errors and ModelError(0.01, errors, ((0.1, errors), (0.25, errors)))
    contact = SimpleNamespace(rung=rung, normal=None, errors=known, preload_N=100.0, problems=())
    answer = SimpleNamespace(slip_force_N=20.0 * share)
    slip = SimpleNamespace(total_slip_force_N=20.0)
    found = doubts._of_small_slip(contact, answer, slip, 0.05)
    assert [one.code for one in found] == ["small_slip_extrapolated"] * doubted
    note = Problem("small_slip_extrapolated", "info", "the energy may be off by more than 5 %")
    other = Problem("under_resolved", "info", "few pixels")
    assert doubts._less_note([note, other, *found]) == [other, *found]  # one doubt, not two
    contact.errors = ModelError.of_either(0.3)  # at all forces, which its own warning says
    contact.rung.least_share = None
    assert doubts._of_small_slip(contact, answer, slip, 0.05) == []
    assert doubts._of_small_slip(contact, None, slip, 0.05) == []  # beyond gross slip
    assert doubts._of_small_slip(contact, None, None, 0.05) == []


@pytest.mark.parametrize(
    ("share", "expected"),
    [
        (0.1, ["a", "at 0.25", "b"]),
        (0.25, ["a", "at 0.25", "b"]),
        (0.5, ["a", "at 0.5", "b"]),
        (None, ["a", "at 0.25", "b"]),
    ],
)
def test_what_a_map_leaves_is_told_at_the_force_that_is_asked_for(share, expected):
    """Whoever asks at a greater force, as was advised, is not told of a quarter again."""

    def at(asked):
        return (Problem("detail_decides", "warning", f"at {asked}"),)

    first, last = (Problem("yielded", "info", name) for name in "ab")
    errors = ModelError(0.01, 0.3, doubts_at=at)
    answer = None if share is None else SimpleNamespace(slip_force_N=20.0 * share)
    slip = SimpleNamespace(total_slip_force_N=20.0)
    found = SimpleNamespace(contact=SimpleNamespace(errors=errors), answer=answer, slip=slip)
    said = doubts.as_asked([first, *at(0.25), last], found)
    assert [one.message for one in said] == expected
    of_caps = [first, Problem("detail_decides", "warning", "at 0.25; so caps answer")]
    assert doubts.as_asked(of_caps, found) == of_caps
    found.contact.errors = ModelError(0.01, 0.3)
    assert doubts.as_asked([*at(0.25)], found) == [*at(0.25)]


def test_small_slip_is_noted_once():
    """With where pixels end and what they leave; a warning stands for itself."""
    effect = Effect(None, 0.14, 0.14)
    first, last = (Problem("yielded", "info", name) for name in "ab")
    ends = Problem("small_slip_extrapolated", "info", "below 4.6 % of it")
    left = Problem("small_slip_extrapolated", "info", "at 10 % of it", effect)
    found = SimpleNamespace(contact=None, answer=None, slip=None)
    for notes in ((ends, left), (left, ends)):
        said = doubts.as_asked([first, notes[0], last, notes[1]], found)
        message = "; ".join(one.message for one in notes)
        assert said == [first, replace(ends, message=message, effect=effect), last]
    assert doubts.as_asked([first, ends, ends], found) == [first, ends]
    warned = replace(left, severity="warning")
    assert doubts.as_asked([warned, ends, first], found) == [warned, ends, first]


TURNED, LAGS = "mating.rotation_rad=0.1", "slip.normal_phase_rad=1"
NO_FORM = "conditioning.form=none"
LOPSIDED = [(8e-3, 6e-3, 20.0, 0.0), (2.6e-2, 8e-3, 20.0, 2e-8), (1.4e-2, 1.8e-2, 25.0, -2e-8)]
LEVELLED, BESIDE = "contact.alignment=as_levelled", "contact.load_point_m=[1mm,2mm]"
ROBUST, FLOOR = "conditioning.form_robust=true", "conditioning.form_floor=true"
OF_A_SCAN = ("reading.invert=true", "hills.cut=fixed", "families.count=2", "run.sensitivity=true")
OF_A_JOINT = ("contact.preload_N=5", "slip.direction_rad=1", "run.figures=false", "families.m=3")


@pytest.mark.parametrize(
    ("words", "scanned", "mated", "said"),
    [
        ((TURNED, "mating.mirror=y"), True, False, ["warning mating.mirror, mating.rotation_rad"]),
        ((TURNED,), True, True, []),
        ((TURNED,), False, False, ["info mating.rotation_rad"]),
        ((NO_FORM, ROBUST), True, False, ["warning conditioning.form_robust"]),
        ((NO_FORM, FLOOR), True, False, ["warning conditioning.form_floor"]),
        ((NO_FORM, FLOOR), True, True, []),  # fits the plane of the sum
        ((FLOOR,), True, False, []),
        ((NO_FORM,), True, False, []),
        ((LEVELLED, BESIDE), True, False, ["warning contact.load_point_m"]),
        ((LEVELLED, BESIDE), True, True, ["warning contact.load_point_m"]),
        ((LEVELLED,), True, False, []),
        ((BESIDE,), True, False, []),
        ((LAGS,), True, False, ["warning slip.normal_phase_rad"]),
        ((LAGS,), False, False, ["warning slip.normal_phase_rad"]),
        ((LAGS, "slip.normal_amplitude_ratio=0.1"), False, False, []),
        (OF_A_SCAN, True, False, []),
        (
            OF_A_SCAN,
            False,
            False,
            ["info reading.invert, hills.cut, families.count, run.sensitivity"],
        ),
        (OF_A_JOINT, False, False, []),
    ],
)
def test_settings_that_nothing_reads_are_named(words, scanned, mated, said):
    found = doubts.problems_of_settings(load_settings(overrides=words), scanned, mated)
    heads = [f"{one.severity} {one.message}".partition(" not used")[0] for one in found]
    assert heads == [f"{one} {'are' if ', ' in one else 'is'}" for one in said]


def test_a_load_point_under_which_nothing_turns_moves_the_told_distance_alone():
    """As its message says; the face that turns is another one."""
    surface = caps_map(LOPSIDED, (120, 180), (2e-4, 2e-4))
    level, beside, turned = (
        analyze_once(surface, load_settings(overrides=("contact.model=interacting", *words)))
        for words in ((LEVELLED,), (LEVELLED, BESIDE), ("contact.load_point_m=[15mm,13mm]",))
    )
    (said,) = [one for one in beside.problems if one.code == "settings_ignored"]
    assert "only how far off the resultant lies counts from there" in said.message
    stiffness = [one.slip.tangential_stiffness_N_per_m for one in (level, beside, turned)]
    assert stiffness[1] == stiffness[0] != stiffness[2]
    moved_m = np.subtract(level.contact.eccentricity_m, beside.contact.eccentricity_m)
    assert moved_m == pytest.approx(np.subtract((1e-3, 2e-3), level.contact.load_point_m))


@pytest.mark.parametrize("scanned", [True, False])
def test_defaults_that_are_written_out_are_not_given(scanned):
    for settings in (load_settings(PROJECT / "configs" / "default.toml"), Settings()):
        assert doubts.problems_of_settings(settings, scanned, mated=False) == []


@pytest.mark.long
def test_a_forced_map_says_what_its_error_leaves_at_the_force_that_is_asked_for():
    """A sphere at four times its hardness, at a tenth of mu N: pixels tell nothing of the energy.

    The error of a forced model is found last: the doubt said "more than 5 %", without an effect.
    """
    y_m, x_m = (np.mgrid[-20:20, -20:20] + 0.5) * 2e-6
    sphere = HeightMap(-(x_m**2 + y_m**2) / (2 * 4e-3), (2e-6, 2e-6))
    given = ("material.hardness_Pa=5e7", "contact.preload_N=0.02", "answer.slip_force_N=0.0004")
    chosen, forced = (
        analyze(sphere, load_settings(overrides=(*given, f"contact.model={model}")))
        for model in ("auto", "boundary_elements")
    )
    assert chosen.contact.model == forced.contact.model
    known, said = (
        {(one.severity, one.message, one.effect) for one in found.problems if one.code == SMALL}
        for found in (chosen, forced)
    )
    assert said == known
    left = forced.contact.errors.energy_at(0.1)
    assert left > 1.0
    (asked,) = (one for one in said if one[1].startswith("asked for is 10 %"))
    assert off_by(left) in asked[1]
    assert asked[2].energy == pytest.approx(share_of(left))


@pytest.mark.long
def test_a_forced_map_says_what_the_map_says_that_was_chosen():
    """A rough one: beside what decides it, the doubt of a model without an error stood as well."""
    rng = np.random.default_rng(7)
    waves = gaussian_filter(rng.normal(size=(90, 120)), 3, mode="wrap")
    height_m = 2e-7 * waves / waves.std() + 1e-8 * rng.normal(size=waves.shape)
    rough = HeightMap(height_m, (1e-5, 1e-5))
    given = ("material.hardness_Pa=2e9", "contact.preload_N=2")
    chosen, forced = (
        analyze(rough, load_settings(overrides=(*given, f"contact.model={model}")))
        for model in ("auto", "boundary_elements")
    )
    assert chosen.contact.model == forced.contact.model
    of_choice = {one for one in chosen.problems if one.code == "caps_not_pressed"}
    assert {one.code for one in chosen.problems if one.severity == "warning"} == {"detail_decides"}
    assert set(forced.problems) == set(chosen.problems) - of_choice
