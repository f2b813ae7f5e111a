"""The stages: their clock, and the turns of fit and contact."""

import math
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip import pressing, stages
from capslip.analysis import analyze, analyze_once
from capslip.caps import doubts
from capslip.caps.fit import fit_caps
from capslip.contact.depth import press_for_depth
from capslip.contact.levelling import TogetherError
from capslip.errors import ContactError, TipsOverError, UnusableSurfaceError
from capslip.settings import load_settings
from capslip.stages import Clock, find_face
from capslip.surface.heightmap import HeightMap, Origin
from scenes import caps_map

PRELOAD_N = 80.0
PIXEL_M = 2e-4


def face(power=3.0, pixel_m=PIXEL_M):
    """Three equal hills that fall as r^power, and one too low to touch."""
    n = round(26e-3 / pixel_m)
    x_m = (np.arange(n) + 0.5) * pixel_m
    height_m = np.full((n, n), -0.6e-6)
    for x, y, top_m in ((7, 6.5, 0.0), (19, 7.5, 0.0), (6.5, 19, 0.0), (19.5, 18.5, -0.22e-6)):
        r_m = np.hypot(x_m - 1e-3 * x, x_m[:, None] - 1e-3 * y)
        height_m = np.maximum(height_m, top_m - 0.4e-6 * (r_m / 5e-3) ** power)
    return HeightMap(height_m, (pixel_m, pixel_m))


def settings(*more):
    as_levelled = ("conditioning.form=none", "contact.alignment=as_levelled")
    overrides = (f"contact.preload_N={PRELOAD_N}", *as_levelled, *more)
    return load_settings(overrides=("hills.material_ratio=0.35", "caps.fit=contact", *overrides))


def test_the_clock_adds_the_time_of_a_stage_even_where_it_fails():
    clock = Clock()
    with mock.patch("time.perf_counter", side_effect=[1.0, 3.5, 10.0, 10.25, 20.0, 21.0]):
        with clock("a"):
            pass
        with clock("b"):
            pass
        with pytest.raises(ValueError, match="it"), clock("a"):
            raise ValueError("it")
    assert clock.seconds == {"a": 3.5, "b": 0.25}


@pytest.mark.parametrize("preload_N", [PRELOAD_N, 2.5])
def test_loaded_caps_are_fitted_at_half_of_their_compression_and_others_at_half_height(preload_N):
    chosen = settings(f"contact.preload_N={preload_N}")
    spheres = face(2.0)
    found = find_face(spheres, chosen, None, Clock())
    assert found.problems == ()
    caps = found.caps
    pressed = press_for_depth(caps, spheres, chosen)
    loaded = pressed.load_N > 0.0
    assert loaded.tolist().count(True) == 3
    compression_m = pressed.contact_radius_m**2 / pressed.radius_m
    few = preload_N < 10.0  # points in the fit
    within = 0.02 if few else 2e-3
    assert caps.fit_depth_m[loaded] == pytest.approx(0.5 * compression_m[loaded], rel=within)
    first = fit_caps(spheres, found.hills, "contact")
    assert caps.fit_depth_m[~loaded] == pytest.approx(first.fit_depth_m[~loaded], rel=1e-12)
    assert not np.allclose(caps.fit_depth_m[loaded], first.fit_depth_m[loaded], rtol=0.05)


@pytest.mark.parametrize(
    ("swing_N", "turns", "moved"),
    # of 80 N, on two caps: 4 x swing / (2 x 80)
    [(0.0398, 2, None), (0.0402, 10, "0.1%"), (4.0, 10, "10.0%")],
)
def test_turns_end_where_a_thousandth_of_the_load_moves_or_after_ten(swing_N, turns, moved):
    calls = []

    def swings(caps, surface, _):
        calls.append(surface)
        load_N = np.array([40.0, 40.0, 0.0, np.nan]) + swing_N * (-1) ** len(calls) * np.array(
            [1.0, -1.0, 0.0, 0.0]
        )
        return caps.with_columns(load_N=load_N, contact_radius_m=np.full(4, 1e-3))

    with mock.patch.object(stages, "press_for_depth", swings):
        found = find_face(face(), settings(), None, Clock())
    assert len(calls) == turns
    said = [one.message for one in found.problems if one.code == "fit_not_settled"]
    assert said == (
        []
        if moved is None
        else [f"the last turn of fit and contact still moved {moved} of the load"]
    )


def test_a_fit_that_contact_cannot_settle_is_left_to_the_stage_of_contact():
    with mock.patch.object(stages, "press_for_depth", side_effect=ContactError("nothing")):
        found = find_face(face(), settings(), None, Clock())
    assert found.problems == ()
    np.testing.assert_array_equal(
        found.caps.radius_m, fit_caps(face(), found.hills, "contact").radius_m
    )


@pytest.mark.parametrize(
    ("more", "turns"),
    [
        (("contact.model=flat",), False),
        (("contact.model=caps",), True),
        (("contact.model=boundary_elements",), True),
        (("contact.model=auto",), True),
        (("caps.fit=pinned",), False),
    ],
)
def test_a_fit_is_pressed_where_it_wants_to_be_and_something_presses(more, turns):
    with mock.patch.object(stages, "press_for_depth", wraps=press_for_depth) as pressed:
        find_face(face(), settings(*more), None, Clock())
    assert (pressed.call_count > 1) == turns


def test_a_hole_is_compared_with_half_the_usual_diameter():
    with mock.patch.object(doubts, "problems_of_holes", return_value=()) as asked:
        found = find_face(face(), settings(), None, Clock())
    ((_, radius_m),) = (call.args for call in asked.call_args_list)
    assert radius_m == pytest.approx(0.5 * np.median(found.caps.diameter_m), rel=1e-12)


def test_what_is_wrong_with_the_second_face_is_told_under_its_name():
    first, second = face(), face(2.0)
    height_m = second.height_m.copy()
    height_m[height_m > -0.05e-6] = -0.05e-6  # clipped
    second = HeightMap(height_m, second.pixel_size_m, Origin(name="other"))
    found = find_face(first, settings("mating.way=together"), second, Clock())
    assert found.label is None
    assert len(found.caps) == 8
    told = [problem.message for problem in found.problems]
    assert any(message.startswith("other: ") for message in told), told


@pytest.mark.parametrize("way", ["together", "composite"])
def test_how_a_second_face_lies_is_recorded_and_doubted_whatever_is_made_of_both(way):
    first, second = face(), face(2.0)
    aside_m = 0.6 * first.side_m[1]
    laid = (f"mating.way={way}", f"mating.offset_m=[0,{aside_m}]")
    found = find_face(first, settings(*laid), second, Clock())
    step = found.conditioned.steps[-1]
    assert (step["step"], step["way"], step["offset_m"]) == ("mating", way, [0.0, aside_m])
    problems = [one for one in found.conditioned.problems if one.code == "mating_overlap"]
    assert [one.message for one in problems] == [
        "both faces are measured on 40 % of the first only; check mating.offset_m and mating.mirror"
    ]
    beside = (f"mating.way={way}", "mating.offset_m=[1,1]")
    with pytest.raises(UnusableSurfaceError, match=r"^surface and surface: 0 % of the first face"):
        find_face(first, settings(*beside), second, Clock())


@pytest.mark.parametrize("way", ["together", "composite"])
def test_faces_that_fit_nowhere_are_told_and_where_they_were_laid(way):
    rng = np.random.default_rng(1)
    one, other = (
        HeightMap(1e-6 * gaussian_filter(rng.standard_normal((90, 130)), 4.0), (PIXEL_M, PIXEL_M))
        for _ in range(2)
    )
    looked_for = (f"mating.way={way}", "mating.align=least_squares", "caps.fit=pinned")
    conditioned = find_face(one, settings(*looked_for), other, Clock()).conditioned
    assert [p.code for p in conditioned.problems if "mating" in p.code] == ["mating_unrelated"]
    assert 0.0 < conditioned.steps[-1]["correlation"] < 0.5
    assert conditioned.steps[-1]["offset_m"] != [0.0, 0.0]


def test_where_caps_of_both_are_counted_the_first_face_stays_as_it_is():
    first, second = face(), face(2.0)
    alone = find_face(first, settings(), None, Clock())
    found = find_face(first, settings("mating.way=together"), second, Clock())
    np.testing.assert_array_equal(
        found.conditioned.surface.height_m, alone.conditioned.surface.height_m
    )
    assert found.conditioned.second_m is None
    assert found.conditioned.sq_m == alone.conditioned.sq_m
    assert found.conditioned.problems == alone.conditioned.problems
    assert found.conditioned.steps[:-1] == alone.conditioned.steps


CAPS, MAP = "contact.model=caps", "contact.model=boundary_elements"
LATE = "contact.time_limit_s=1e-3"  # for the map itself
HELD = "contact.alignment_stiffness_Nm_per_rad=9.0"


@pytest.mark.parametrize(
    ("more", "answer", "codes"),
    [
        ((CAPS,), (0.0, 0.0), {}),
        ((CAPS, HELD), (0.0, 0.0), {}),
        ((MAP,), (0.0, 0.0), {}),
        (("contact.model=auto",), (0.0, 0.0), {}),
        # the last turn moved up to a hundredth of the load, or more
        ((CAPS,), (0.01, 0.0), {"level_not_settled": "warning"}),
        # contacts run together, and nobody waited for the last turns
        ((MAP,), (0.04, 0.0, True), {"level_not_settled": "warning"}),
        ((MAP,), TogetherError("far from it"), {}),
        ((CAPS,), (0.0101, 0.0), {"not_balanced": "warning"}),
        ((MAP,), (0.0101, 0.0), {}),
        ((CAPS,), (0.0, 1e-9), {"cut_too_high": "warning"}),
        ((CAPS,), (1e-9, 1e-9), {"level_not_settled": "warning", "cut_too_high": "warning"}),
        ((CAPS,), TipsOverError("tips_over: it falls"), {"tips_over": "error"}),
        ((MAP,), TipsOverError("tips_over: it falls"), {"tips_over": "info"}),
        ((), TipsOverError("tips_over: it falls"), {"tips_over": "warning"}),
        ((LATE,), TipsOverError("tips_over: it falls"), {"tips_over": "error"}),
        ((), ContactError("none"), {}),
        ((LATE,), ContactError("none"), {"not_balanced": "warning"}),
        ((CAPS,), ContactError("nothing carries"), {"not_balanced": "warning"}),
        ((MAP,), ContactError("nothing carries"), {}),
    ],
)
def test_a_level_is_taken_where_its_turns_settle(more, answer, codes):
    found = answer
    if isinstance(answer, tuple):
        moved, missed_area_m2, *given_up = answer
        found = SimpleNamespace(
            moved=moved,
            missed_area_m2=missed_area_m2,
            material_ratio=0.1,
            given_up=bool(given_up),
        )
    chosen = settings("contact.alignment=balanced", *more)
    with mock.patch.object(stages, "find_level", side_effect=[found]):
        level, problems = stages._levelled(face(), chosen, Clock())
    assert {problem.code: problem.severity for problem in problems} == codes
    taken = isinstance(answer, tuple) and (answer[0] <= 0.01 or found.given_up)
    assert level is (found if taken else None)


@pytest.mark.parametrize(
    "more",
    [
        (CAPS, "contact.alignment=as_levelled"),
        ("contact.model=families",),  # which know no places
        ("contact.model=flat",),
        (MAP, HELD),  # what holds the parts is at ease as they were levelled
    ],
)
def test_nothing_turns_where_nothing_can_or_shall(more):
    chosen = settings("contact.alignment=balanced", *more)
    with mock.patch.object(stages, "find_level", side_effect=AssertionError):
        assert stages._levelled(face(), chosen, Clock()) == (None, [])


@pytest.mark.parametrize(("cut", "ratio"), [("fixed", 0.35), ("certified", 0.10)])
def test_families_are_counted_above_the_papers_tenth_unless_the_cut_is_fixed(cut, ratio):
    assert stages._family_ratio(settings(f"hills.cut={cut}")) == ratio


@pytest.mark.parametrize("slope", [(0.0, 0.0), (3e-6, -2e-6), (-1e-6, 5e-6)])
def test_families_are_those_of_their_own_plane_whatever_the_level(slope):
    """Three caps and nine, 200 nm lower, on a face of 36 mm x 60 mm that is tilted."""
    places = [(6e-3 + 16e-3 * j, 6e-3 + 12e-3 * i) for i in range(3) for j in range(4)]
    low_m = np.where(np.isin(np.arange(12), (0, 6, 11)), 0.0, -2e-7)
    caps = [(x, y, 25.0, z) for (x, y), z in zip(places, low_m, strict=True)]
    surface = caps_map(caps, (180, 300), (2e-4, 2e-4), floor_m=-8e-7)
    y_m, x_m = np.ogrid[0.5:180, 0.5:300]
    tilted_m = surface.height_m + 2e-4 * (slope[0] * x_m + slope[1] * y_m)
    without_noise = SimpleNamespace(noise_m=0.0)
    tilted = HeightMap(tilted_m, (2e-4, 2e-4))
    level = SimpleNamespace(
        surface=tilted,
        coarse=stages.coarse_map(tilted),
        coarse_noise=SimpleNamespace(neighbours_m=0.0),
        hills_at_rest=None,
        slope=(0.0, 0.0),
        rest_slope=(1e-6, 0.5e-6),
        load_point_m=(0.03, 0.018),
        hills=without_noise,
    )
    plane, _, counted, families = stages._families(
        level, settings("hills.material_ratio=0.3", "hills.cut=fixed")
    )
    assert (families.m, families.n) == (3, 9)
    assert families.h_m == pytest.approx(2e-7, rel=1e-3)
    assert counted.family.tolist().count("G") == 3
    # over its own plane the face has the heights that it has without a tilt
    assert np.ptp(plane.height_m - surface.height_m) < 2e-9


@pytest.mark.parametrize(
    ("level", "model", "alignment"),
    [
        (None, "caps", "as_levelled"),
        (None, "auto", "as_levelled"),
        (None, "boundary_elements", "balanced"),  # which find their own balance
        ("level", "caps", "balanced"),
        ("level", "auto", "balanced"),
    ],
)
def test_caps_without_a_level_are_pressed_as_levelled(level, model, alignment):
    chosen = settings("contact.alignment=balanced", f"contact.model={model}")
    joint = SimpleNamespace(settings_of_scan=lambda given: given)
    # no label: caps of two maps, which are no map to press
    found = pressing.as_found(SimpleNamespace(level=level, joint=joint, label=None), chosen)
    assert found.contact.alignment == alignment
    assert found.contact.model == model


@pytest.mark.parametrize(
    ("limit_s", "alignment", "model"),
    [
        (60.0, "balanced", "boundary_elements"),
        (1e-3, "balanced", "auto"),
        (60.0, "as_levelled", "auto"),
    ],
)
def test_a_map_whose_caps_find_no_level_is_pressed_itself_where_there_is_time(
    limit_s, alignment, model
):
    chosen = settings(f"contact.alignment={alignment}", f"contact.time_limit_s={limit_s}")
    joint = SimpleNamespace(settings_of_scan=lambda given: given)
    conditioned = SimpleNamespace(surface=face())
    lost = SimpleNamespace(level=None, joint=joint, label=np.ones((1, 1)), conditioned=conditioned)
    found = pressing.as_found(lost, chosen)
    assert found.contact.model == model
    balanced_by_itself = model == "boundary_elements"
    assert found.contact.alignment == ("balanced" if balanced_by_itself else "as_levelled")


@pytest.mark.long
def test_a_map_that_stands_in_for_caps_without_a_level_has_its_error_and_its_interval():
    with mock.patch("capslip.stages.find_level", side_effect=ContactError("no level")):
        found = analyze(face(), load_settings(overrides=(f"contact.preload_N={PRELOAD_N}",)))
    assert "find no level" in found.contact.model_reason
    (said,) = (one for one in found.contact.problems if one.code == "caps_not_pressed")
    assert said.message.startswith("the caps find no level: m, n, R and h describe the caps")
    assert 0.0 < found.contact.estimated_error < 0.2
    assert found.band.left_out == ("noise of the map that pixels share", "blur of the optics")


@pytest.mark.parametrize("model", ["flat", "boundary_elements", "caps"])
def test_only_a_model_of_caps_fails_on_a_face_without_any(model):
    noise_m = 1e-6 * np.random.default_rng(1).standard_normal((60, 80))
    overrides = (f"contact.model={model}", "contact.preload_N=3e4")
    found = analyze_once(HeightMap(noise_m, (4e-4, 4e-4)), load_settings(overrides=overrides))
    assert not found.caps.usable.any()
    of_caps = model == "caps"
    assert (found.status == "failed", found.answer is None) == (of_caps, of_caps)
    severity = {problem.code: problem.severity for problem in found.problems}["no_caps"]
    assert severity == ("error" if of_caps else "info")


def test_a_face_that_tips_over_is_not_pressed_and_that_is_said_once():
    """No hill holds a load that acts beside all of them."""
    load_point = ("contact.alignment=balanced", "contact.load_point_m=[25e-3, 12e-3]")
    found = analyze_once(face(2.0), settings("contact.model=caps", *load_point))
    assert found.caps.usable.any()
    assert found.contact is None
    assert [one.code for one in found.problems if one.severity == "error"] == ["tips_over"]


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("model", ["caps", "boundary_elements"])
def test_a_scan_that_yields_has_felt_the_greatest_load_of_the_cycle(model):
    chosen = (f"contact.model={model}", "material.hardness_Pa=2.5e6")
    few = face(2.0, 2.0 * PIXEL_M)

    def curve(load_N, *more):
        given = settings(*chosen, f"contact.preload_N={load_N}", *more)
        found = find_face(few, given, None, Clock())
        return pressing.press_face(found, given, Clock())[2].curve

    varied, once, less = curve(60.0, "slip.normal_amplitude_ratio=0.5"), curve(90.0), curve(60.0)
    shares = np.array([0.25, 0.5, 0.75])
    got, expected, other = (
        one.load_N(float(one.approach_m(60.0)) - shares * 2e-8) for one in (varied, once, less)
    )
    np.testing.assert_allclose(got, expected, rtol=5e-4)
    assert (np.abs(other / got - 1.0) > 0.004).all()


@pytest.mark.parametrize(
    ("model", "usable", "asked"),
    [("auto", [True], 2), ("auto", [False], 1), ("interacting", [True], 1)],
)
def test_caps_stand_in_for_a_map_that_fails_where_the_choice_was_free(
    monkeypatch, model, usable, asked
):
    """The second attempt knows why the first one failed; else the failure is told as it is."""
    calls = []

    def press(*given, map_failure="", at_ease_rad):
        calls.append((map_failure, at_ease_rad))
        if map_failure:
            return "contact", "caps"
        raise ContactError("no solution")

    monkeypatch.setattr(pressing, "press", press)
    found = SimpleNamespace(
        level=SimpleNamespace(slope=(2e-6, -3e-6)),
        joint=SimpleNamespace(settings_of_scan=lambda given: given),
        caps=SimpleNamespace(usable=np.array(usable)),
        hills=SimpleNamespace(noise_m=0.0),
        conditioned=SimpleNamespace(surface=face()),
        families=None,
        label="hills of one map",
    )
    chosen = settings(f"contact.model={model}")
    if asked == 1:
        with pytest.raises(ContactError, match=r"^no solution$"):
            pressing._pressed(found, chosen)
    else:
        assert pressing._pressed(found, chosen) == ("contact", "caps")
    # What holds the parts is at ease as they were levelled
    assert calls == [("", (-2e-6, 3e-6)), ("no solution", (-2e-6, 3e-6))][:asked]


@pytest.mark.parametrize("alignment", ["balanced", "as_levelled"])
@pytest.mark.parametrize("load_N", [100.0, 10.0])
def test_a_lighter_patch_lies_as_the_heaviest_does(alignment, load_N):
    """No other plane counts where that was balanced; as levelled, it is as unsure as ever."""
    chosen = settings(f"contact.alignment={alignment}", "contact.preload_N=100")
    joint = SimpleNamespace(settings_of_scan=lambda given: given)
    found = SimpleNamespace(level="level", joint=joint)
    patch = SimpleNamespace(preload_N=load_N, bulk=True)
    given = pressing._settings_of(found, patch, chosen, "interacting")
    assert (given.contact.model, given.contact.preload_N) == ("interacting", load_N)
    assert given.contact.bulk  # as it was kept
    stays = alignment == "balanced" and load_N == 100.0
    assert given.contact.alignment == ("balanced" if stays else "as_levelled")
    turned = alignment == "balanced" and load_N < 100.0
    assert given.conditioning.form == ("none" if turned else chosen.conditioning.form)


CURVES = " of a processor a curve of the map, of which it takes 1 to 10"
OR_MORE = ", or more where much of it touches, up to about {} s"


@pytest.mark.parametrize(
    ("curve_s", "limit_s", "said"),
    [
        (4.98, 49.0, ", about 5 s" + CURVES),
        (4.98, math.inf, ", about 5 s" + CURVES),
        (1.08, 10.0, ", about 1.1 s" + CURVES),  # 9 s in all
        # 33 s, of a face of which 95 % touch
        (1.08, 60.0, ", about 1.1 s" + CURVES + OR_MORE.format(60)),
        (0.15, 60.0, ""),
        (None, 60.0, ""),
    ],
)
def test_the_time_that_is_told_of_a_map_is_that_of_one_curve_and_says_so(curve_s, limit_s, said):
    told = []
    clock = Clock(told.append)
    for _ in range(2):
        with clock("contact", curve_s, limit_s):
            pass
    assert told == [f"analysing: contact{said}"]
