"""The level that a pressed face finds: the whole answer owes nothing to how the map lay."""

import json
from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import capslip
from capslip.analysis import analyze_once
from capslip.caps.fit import fit_caps
from capslip.contact.balanced import rebalanced
from capslip.contact.levelling import (
    UNSETTLED,
    TogetherError,
    _Search,
    find_level,
    turned,
)
from capslip.errors import ContactError
from capslip.settings import load_settings
from capslip.stages import Clock, find_face
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.blocks import block_means
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from scenes import REFERENCE, caps_map

pytestmark = pytest.mark.usefixtures("fewer_points")  # how a map lay is told on any of them
SHAPE, PIXEL_M = (160, 240), (2.5e-4, 2.5e-4)  # 40 mm x 60 mm
SHARES = np.array([0.1, 0.25, 0.5, 0.75])


def caps(n_G=5, n_P=12):
    """Caps of two families at places without any symmetry."""
    rng = np.random.default_rng(11)
    cells = rng.permutation(24)[: n_G + n_P]
    x_m = (cells % 6 + 0.5) * 1e-2 + rng.uniform(-1.5e-3, 1.5e-3, cells.size)
    y_m = (cells // 6 + 0.5) * 1e-2 + rng.uniform(-1.5e-3, 1.5e-3, cells.size)
    G = np.arange(cells.size) < n_G
    return list(zip(x_m, y_m, np.where(G, 24.0, 27.0), np.where(G, 0.0, -2.4e-7), strict=True))


@cache
def face():
    return caps_map(caps(), SHAPE, PIXEL_M, floor_m=-8e-7)


@cache
def waves():
    z = gaussian_filter(np.random.default_rng(3).standard_normal(SHAPE), 8.0)
    return HeightMap(4e-7 * z / z.std(), PIXEL_M)


@cache
def few_waves():
    """Every other row and column of the waves, to be pressed as a map again and again."""
    return HeightMap(waves().height_m[::2, ::2].copy(), (2.0 * PIXEL_M[0], 2.0 * PIXEL_M[1]))


def analyzed(surface, *overrides):
    return analyze_once(surface, load_settings(overrides=overrides))


@cache
def plain(of):
    return analyzed(of())


def answers(analysis):
    slip = analysis.slip
    energy_J = slip.energy_at_force_J(SHARES * slip.total_slip_force_N)
    contact = analysis.contact
    return np.array([*energy_J, contact.stiffness_N_per_m, contact.approach_m])


def tilt(analysis):
    return np.array(analysis.summary()["contact"]["tilt_rad"])


def same_families(one, other, rel=1e-3):
    a, b = one.families, other.families
    assert (a.m, a.n) == (b.m, b.n)
    assert (a.h_m is None) == (b.h_m is None)
    if a.h_m is not None:
        assert b.h_m == pytest.approx(a.h_m, rel=rel)


def same_answers(one, other, rel=1e-3):
    assert answers(other) == pytest.approx(answers(one), rel=rel)
    assert other.contact.contacts == one.contact.contacts
    assert one.level is not None
    assert other.level is not None
    same_families(one, other, rel)


# Relief is 0.8 um on caps and about 3 um on waves: up to ten times that across the face
@pytest.mark.parametrize("form", ["none", "plane"])
@pytest.mark.parametrize("across_m", [(8e-6, 0.0), (-2e-6, 3e-6), (0.0, -1e-7)])
def test_a_plane_added_to_a_map_of_caps_comes_out_as_tilt(across_m, form):
    slope = across_m[0] / 0.06, across_m[1] / 0.04
    added = turned(face(), slope, (0.0, 0.0))
    level, other = plain(face), analyzed(added, f"conditioning.form={form}")
    same_answers(level, other, 1e-6)
    if form == "none":
        flat = analyzed(face(), "conditioning.form=none")
        assert tilt(other) == pytest.approx(tilt(flat) - slope, abs=1e-12)


@pytest.mark.long
def test_a_plane_added_to_waves_changes_nothing():
    """Ten times their relief across the face."""
    added = turned(few_waves(), (-3e-5 / 0.06, 2e-5 / 0.04), (0.0, 0.0))
    same_answers(plain(few_waves), analyzed(added, "conditioning.form=none"), 1e-6)


@pytest.mark.long
@pytest.mark.parametrize("of", [face, few_waves])
def test_a_mirrored_and_a_transposed_map_give_the_same_answers(of):
    z_m = of().height_m
    pixel_m = of().pixel_size_m
    tilt_x, tilt_y = tilt(plain(of))
    ways = [(z_m[:, ::-1], (-tilt_x, tilt_y)), (z_m.T, (tilt_y, tilt_x))]
    if of is few_waves:  # both at once, as it is pressed as a map
        ways = [(z_m[:, ::-1].T, (tilt_y, -tilt_x))]
    for turned_m, expected in ways:
        other = analyzed(HeightMap(np.array(turned_m), pixel_m))
        same_answers(plain(of), other, 1e-6)
        assert tilt(other) == pytest.approx(expected, abs=1e-11)


@cache
def of_lengths(factor, seed):
    """Return what is found of waves that are larger in every direction, under the same stress."""
    z = gaussian_filter(np.random.default_rng(seed).standard_normal((80, 120)), 3.0)
    z *= 4e-7 / z.std()
    surface = HeightMap(factor * z, (5e-4 * factor, 5e-4 * factor))
    load = f"contact.preload_N={50.0 * factor**2!r}"
    return analyzed(surface, load, "contact.model=interacting")


@pytest.mark.parametrize(("times", "seed"), [(3.0, 6), (1e-3, 6), (1e3, 6)])
def test_all_lengths_times_a_number_change_no_decision(times, seed):
    """Under the load times its square: stiffness goes with it, energy with its cube."""
    one, other = of_lengths(1.0, seed), of_lengths(times, seed)
    power = np.array([3.0, 3.0, 3.0, 3.0, 1.0, 1.0])
    assert answers(other) / times**power == pytest.approx(answers(one), rel=1e-6)
    assert other.level.slope == pytest.approx(one.level.slope, rel=1e-6)
    assert other.level.hills.n_hills == one.level.hills.n_hills
    assert (other.families.m, other.families.n) == (one.families.m, one.families.n)


@pytest.mark.long
@pytest.mark.parametrize("of", [face, waves])
def test_caps_that_run_together_wait_for_no_rest_where_the_map_is_pressed(of):
    """Near their rest they stay where the map begins; far from it they are left. Neither counts."""
    load = "contact.preload_N=2e4"
    settings = load_settings(overrides=(load,))
    if of is face:
        level = find_level(of(), settings, needs_no_caps=True)
        assert level.given_up
        assert 0.0 < level.moved < 0.05
    else:
        with pytest.raises(TogetherError, match="run together"):
            find_level(of(), settings, needs_no_caps=True)
    waited = find_level(of(), settings)
    assert not waited.given_up
    assert waited.moved < UNSETTLED
    found = analyzed(of(), load)
    assert found.contact.model == "boundary_elements"
    assert found.contact.errors is not None  # by the free choice it is known at once
    with patch("capslip.stages.find_level", return_value=waited):
        known = analyzed(of(), load)
    assert answers(found) == pytest.approx(answers(known), rel=1e-3)
    if of is face:  # of waves no family is known
        same_families(known, found)


def test_points_that_never_touch_do_not_matter():
    z_m = face().height_m.copy()
    low = z_m < -7.9e-7
    low[:, SHAPE[1] // 2 :] = False
    assert low.mean() > 0.1
    z_m[low] -= 1e-6
    lowered = HeightMap(z_m, PIXEL_M)
    same_answers(plain(face), analyzed(lowered), 1e-6)
    held = [analyzed(s, "contact.alignment=as_levelled") for s in (face(), lowered)]
    moved = answers(held[1]) / answers(held[0]) - 1.0
    assert np.abs(moved).max() > 0.1  # as levelled, they do


@pytest.mark.long
@pytest.mark.parametrize(
    ("of", "rel", "ratio"), [(face, 1e-3, 0.05), (face, 1e-3, 0.3), (few_waves, 1e-2, 0.3)]
)
def test_the_cut_that_is_started_from_does_not_matter(of, rel, ratio):
    same_answers(plain(of), analyzed(of(), f"hills.material_ratio={ratio}"), rel)


PLACES_M = np.array([[0.012, 0.008], [0.05, 0.012], [0.028, 0.033]])
RADII_M = np.array([20.0, 24.0, 28.0])


@cache
def three():
    """Three spheres of their own heights."""
    spheres = zip(*PLACES_M.T, RADII_M, (0.0, -1e-7, -3e-7), strict=True)
    return caps_map(spheres, SHAPE, PIXEL_M, floor_m=-1e-6)


@pytest.mark.parametrize("offset", [(0.0, 0.0), (5e-3, -3e-3)])
def test_three_spheres_carry_what_statics_gives_them(offset):
    x_m, y_m = np.add((0.03, 0.02), offset)
    found = analyzed(
        *(three(), f"contact.load_point_m=[{x_m},{y_m}]", "contact.preload_N=100"),
        *("contact.model=interacting", "conditioning.form=none"),
    )
    # A sphere that is tilted touches beside its old apex: by its radius times the tilt
    touched_m = PLACES_M + RADII_M[:, None] * tilt(found)
    assert np.abs(touched_m - PLACES_M).max() > 1e-4
    arms = np.vstack((np.ones(3), (touched_m - (x_m, y_m)).T))
    share = np.linalg.solve(arms, [1.0, 0.0, 0.0])
    load_N = found.caps.load_N[found.caps.load_N > 0.0]
    assert np.sort(load_N) == pytest.approx(np.sort(100.0 * share), rel=1e-4)
    table = found.summary()["contact"]
    assert table["alignment"] == "balanced"
    assert table["load_point_m"] == pytest.approx([x_m, y_m])
    assert np.abs(table["eccentricity_m"]).max() < 1e-8


def test_lines_without_any_measured_point_move_neither_the_load_nor_the_answer():
    height_m = np.pad(face().height_m, ((40, 10), (0, 50)), constant_values=np.nan)
    found = analyzed(HeightMap(height_m, PIXEL_M))
    assert found.contact.load_point_m == pytest.approx((0.03, 0.02 + 40 * PIXEL_M[0]))
    # The outline of what was measured is summed over blocks, that of a whole map is closed
    assert answers(found) == pytest.approx(answers(plain(face)), rel=3e-3)


def test_a_block_on_a_larger_plate_is_loaded_in_its_middle_wherever_it_stands():
    ny, nx = SHAPE
    plate = HeightMap(np.zeros((ny + 60, nx + 80)), PIXEL_M)
    beside = load_settings(overrides=("mating.offset_m=[5e-3,-9e-3]",))
    found = analyze_once(plate, beside, face())
    assert found.contact.load_point_m == pytest.approx(
        (0.5 * plate.side_m[1] - 9e-3, 0.5 * plate.side_m[0] + 5e-3)
    )
    assert answers(found) == pytest.approx(answers(plain(face)), rel=3e-3)


def test_the_eccentricity_is_the_place_of_the_resultant():
    found = analyzed(face(), "contact.alignment=as_levelled")
    carrying = found.caps.load_N > 0.0
    load_N = found.caps.load_N[carrying]
    places = np.stack((found.caps.x_m, found.caps.y_m))[:, carrying]
    table = found.summary()["contact"]
    assert table["alignment"] == "as_levelled"
    assert table["tilt_rad"] == [0.0, 0.0]
    off_m = places @ load_N / load_N.sum() - (0.03, 0.02)
    assert table["eccentricity_m"] == pytest.approx(off_m, rel=1e-9)
    assert np.abs(off_m).max() > 1e-3
    balanced = plain(face).summary()["contact"]
    assert np.abs(balanced["eccentricity_m"]).max() < 1e-7
    across = np.abs(balanced["tilt_rad"]) @ (0.06, 0.04)
    assert balanced["tilt_across_face_m"] == pytest.approx(across)


def test_a_stiff_alignment_is_as_levelled_and_a_soft_one_balanced():
    at_25 = ("hills.material_ratio=0.25", "hills.cut=fixed", "contact.model=interacting")
    free, levelled = (
        analyzed(face(), *at_25, f"contact.alignment={way}") for way in ("balanced", "as_levelled")
    )
    soft, half, stiff = (
        analyzed(face(), *at_25, f"contact.alignment_stiffness_Nm_per_rad={stiffness}")
        for stiffness in ("1e0", "1e7", "1e14")
    )
    assert answers(soft) == pytest.approx(answers(free), rel=1e-4)
    assert answers(stiff) == pytest.approx(answers(levelled), rel=2e-3)
    assert np.abs(tilt(stiff)).max() < 1e-6 * np.abs(tilt(free)).max()
    assert 0.01 < np.hypot(*tilt(half)) / np.hypot(*tilt(free)) < 0.99
    # The moment of the contacts is that of the spring: N e = - K tilt, height up is depth less
    moment_Nm = 460.0 * np.array(half.contact.eccentricity_m)
    assert moment_Nm == pytest.approx(-1e7 * tilt(half), rel=1e-3)


@pytest.mark.parametrize(
    ("at_m", "side"),
    [([0.002, 0.02], "-x"), ([0.058, 0.02], "+x"), ([0.03, 0.001], "-y"), ([0.03, 0.039], "+y")],
)
def test_a_load_beside_all_peaks_tips_the_face_over(at_m, side):
    surface = three()
    if side == "+y":
        surface = HeightMap(surface.height_m[::-1].copy(), PIXEL_M)
    late = "contact.time_limit_s=1e-3"
    found = analyzed(surface, f"contact.load_point_m={at_m}", late)
    (problem,) = (p for p in found.problems if p.code == "tips_over")
    assert problem.severity == "error"
    assert found.status == "failed"
    assert found.contact is None
    assert f"on its {side} side" in problem.message


def test_a_load_that_compresses_nothing_finds_no_level():
    """Not even the peaks that rest move by a number."""
    settings = load_settings(overrides=("contact.preload_N=1e-30", "contact.model=caps"))
    with pytest.raises(ContactError, match=r"by less than numbers tell; check contact\.preload_N"):
        find_level(plain(face).conditioned.surface, settings)


def test_a_load_that_needs_more_than_the_face_finds_no_level_and_says_of_which_state_it_is():
    """Pressed as it lies such a face needs another area, which is told beside it."""
    settings = load_settings(overrides=("contact.preload_N=1e9", "contact.model=caps"))
    area = r"turned until balanced, its caps need a contact area of \S+ m2; expected less than its"
    with pytest.raises(ContactError, match=area):
        find_level(plain(face).conditioned.surface, settings)


def test_a_face_whose_hills_tip_over_rests_on_more_than_its_hills_where_there_is_time():
    found = analyzed(three(), "contact.load_point_m=[0.002,0.02]")
    (problem,) = (p for p in found.problems if p.code == "tips_over")
    assert problem.severity == "warning"
    assert found.contact.rung.made_from == "map"
    assert np.abs(found.contact.eccentricity_m).max() < 1e-6


@pytest.mark.long
def test_whether_caps_find_a_level_is_no_doubt_of_a_map_that_finds_its_balance():
    """Waves whose caps find a level or tip over by a hair: mirrored or scaled they are the same.

    Their map turns by less than a quarter of what their tops stand over the middle.
    """
    scene = Scene((30, 30), (4e-4, 4e-4), 14142, waviness_rms_m=3e-7, waviness_length_m=3e-3)
    surface, _ = synthetic_surface(scene)
    codes, energies_J = set(), []
    for height_m, scale in (
        (surface.height_m, 1.0),
        (surface.height_m[:, ::-1].copy(), 1.0),
        (surface.height_m.T.copy(), 1.0),
        (surface.height_m, 10.0),
    ):
        pixel_m = 4e-4 * scale
        given = f"contact.preload_N={60.0 * scale}", f"answer.slip_force_N={3.0 * scale}"
        found = analyze_once(
            HeightMap(height_m, (pixel_m, pixel_m)), load_settings(overrides=given)
        )
        assert found.contact.rung.made_from == "map"
        codes |= {one.code for one in found.problems}
        assert found.status == "ok", [one for one in found.problems if one.severity != "info"]
        energies_J.append(found.summary()["answer"]["energy_J"] / scale)
    assert codes & {"tips_over", "level_not_settled"}  # as notes
    assert energies_J == pytest.approx([energies_J[0]] * 4, rel=1e-5)


@pytest.mark.long
def test_two_mated_faces_balance_however_they_were_tilted():
    rng = np.random.default_rng(5)
    rough = HeightMap(2e-8 * gaussian_filter(rng.standard_normal(SHAPE), 6.0) * 20.0, PIXEL_M)
    tilted = turned(rough, (1e-4, -5e-5), (0.0, 0.0))
    one, other = (
        analyze_once(face(), load_settings(overrides=("conditioning.form=none",)), mate)
        for mate in (rough, tilted)
    )
    assert one.summary()["contact"]["alignment"] == "balanced"
    assert np.abs(one.contact.eccentricity_m).max() < 1e-6
    same_answers(one, other, 1e-5)  # 5e-6 or less, by the processor: how sums are rounded


def test_the_cut_that_is_fixed_stays_and_says_what_it_misses():
    found = analyzed(
        *(face(), "hills.cut=fixed", "contact.model=interacting"),
        *("hills.material_ratio=0.1", "contact.preload_N=1500"),
    )
    table = found.summary()["hills"]
    assert table["material_ratio"] == 0.1
    assert table["cut_certified"] is False
    assert "cut_too_high" in {p.code for p in found.problems}


@pytest.mark.parametrize("rise_m", [5e-8, 1.5e-7, -1e-7])
def test_families_survive_a_bow_that_the_contact_feels_and_the_face_is_told(rise_m):
    y, x = (np.linspace(-1.0, 1.0, n) for n in SHAPE)
    bowed = HeightMap(face().height_m + rise_m * (x**2 + 0.5 * y[:, None] ** 2), PIXEL_M)
    found = analyzed(bowed)
    same_families(plain(face), found, rel=2e-2)
    assert "bow_left" in {problem.code for problem in found.problems}
    assert found.contact.approach_m != pytest.approx(plain(face).contact.approach_m, rel=1e-3)


@pytest.mark.parametrize("rise_m", [0.0, 1.5e-7, -1e-7])
def test_peaks_whose_families_are_told_on_a_bent_plane_keep_the_bow(rise_m):
    y, x = (np.linspace(-1.0, 1.0, n) for n in SHAPE)
    bow_m = rise_m * (x**2 + 0.5 * y[:, None] ** 2)
    bowed = HeightMap(face().height_m + bow_m, PIXEL_M)
    found = find_face(bowed, load_settings(), None, Clock()).family_caps
    assert sorted(found.family.tolist()) == ["G"] * 5 + ["P"] * 12
    over_m = found.peak_height_m - bowed.height_m[bowed.pixel_at(found.x_m, found.y_m)]
    plane = np.column_stack((np.ones(len(found)), found.x_m, found.y_m))
    rest_m = over_m - plane @ np.linalg.lstsq(plane, over_m, rcond=None)[0]
    assert np.abs(rest_m).max() < 3e-9


def test_what_lies_below_all_that_touches_does_not_decide_the_noise():
    quiet = face()
    rough = np.random.default_rng(5).normal(0.0, 2e-8, SHAPE)
    low = quiet.height_m < np.quantile(quiet.height_m, 0.5)
    loud = HeightMap(np.where(low, quiet.height_m - 2e-7 + rough, quiet.height_m), PIXEL_M)
    one, other = (find_level(surface, load_settings()) for surface in (quiet, loud))
    assert one.hills.noise_m < 1e-12
    assert other.hills.noise_m < 1e-12
    assert other.hills.n_hills == one.hills.n_hills
    assert other.slope == pytest.approx(one.slope, rel=1e-6)


def test_a_search_that_only_pixels_keep_awake_ends_and_says_what_still_moves():
    # A thousand hills of few pixels: in every turn some pixel crosses the depth of its fit
    z = gaussian_filter(np.random.default_rng(8).standard_normal((300, 400)), 2.5)
    surface = HeightMap(2e-7 * z / z.std(), (2e-5, 2e-5))
    turns, press = [], _Search._press

    def counted(self, *given):
        turns.append(self.surface.shape == surface.shape)
        return press(self, *given)

    with patch.object(_Search, "_press", counted):
        level = find_level(surface, load_settings(overrides=("contact.preload_N=20",)))
    assert 0.0 < level.moved < UNSETTLED
    assert level.hills.n_hills > 500
    assert sum(turns) < 70  # 20 to 62 on such faces: which pixels cross is chance


@cache
def fine():
    """Return the same caps on a map that is levelled on a coarser one first."""
    return caps_map(caps(), (320, 480), (1.25e-4, 1.25e-4), floor_m=-8e-7)


@pytest.mark.parametrize("of", [face, fine, waves])
def test_turns_without_end_lead_to_the_same_loads_and_tilt(of):
    settings, at_m = load_settings(), (0.03, 0.02)
    level = find_level(of(), settings)
    surface, hills, caps = level.surface, level.hills, level.caps
    arm_m, use = np.column_stack((caps.x_m, caps.y_m)) - at_m, caps.usable

    def pressed_N(table):
        level_caps, pressed_m = rebalanced(table, table, use, at_m, settings)
        rise_m = level_caps.peak_height_m - table.peak_height_m
        turn = np.linalg.lstsq(arm_m[use], rise_m[use], rcond=None)[0]
        pressed_m = np.maximum(pressed_m, 0.0)
        return np.sqrt(table.radius_m[use]) * pressed_m**1.5, 0.5 * pressed_m, turn

    found_N, depth_m, turn = pressed_N(caps)
    assert np.abs(turn * (0.06, 0.04)).max() < 1e-15
    tilt = np.array(level.slope)
    for _ in range(10):
        all_m = np.full(len(caps), np.nan)
        all_m[use] = np.where(depth_m > 0.0, depth_m, np.nan)
        refitted = fit_caps(surface, hills, settings.caps.fit, all_m)
        load_N, depth_m, turn = pressed_N(refitted)
        surface, tilt = turned(surface, turn, at_m), tilt + turn
    assert np.abs(turn * (0.06, 0.04)).max() < 1e-13
    share, found = load_N / load_N.sum(), found_N / found_N.sum()
    assert 0.5 * np.abs(share - found).sum() < 1e-4
    assert np.abs((tilt - level.slope) * (0.06, 0.04)).max() < 1e-11


def test_block_means_keep_planes_and_mirrors():
    surface = turned(waves(), (1e-4, -2e-4), (0.03, 0.02))
    coarse = block_means(surface, 4)
    assert coarse.shape == (40, 60)
    assert coarse.pixel_size_m == pytest.approx((1e-3, 1e-3))
    level = block_means(waves(), 4)
    again = turned(level, (1e-4, -2e-4), (0.03, 0.02))
    assert coarse.height_m == pytest.approx(again.height_m, abs=1e-18)


def test_block_means_of_a_map_that_lacks_points_everywhere():
    surface = turned(waves(), (1e-4, -2e-4), (0.03, 0.02))
    lost = np.random.default_rng(0).random(surface.shape) < 0.1
    lost[:20, :20] = True
    lacking = replace(surface, height_m=np.where(lost, np.nan, surface.height_m))
    whole, coarse = block_means(surface, 20), block_means(lacking, 20)
    assert np.argwhere(~coarse.measured).tolist() == [[0, 0]]
    rest_m = (coarse.height_m - whole.height_m)[coarse.measured]
    assert np.abs(rest_m).max() < 0.1 * np.ptp(surface.height_m[20:40, 20:40])


@pytest.mark.skipif(not REFERENCE.is_dir(), reason="the reference faces are not at hand")
def test_the_reference_face_of_caps_with_all_defaults():
    truth = json.loads((REFERENCE / "truth_balanced.json").read_text())["caps"]
    found = capslip.analyze(load_surface(REFERENCE / "caps.h5"))
    families = found.families
    assert (families.m, families.n) == (5, 18)
    assert families.h_m == pytest.approx(2.4e-7, rel=0.01)
    assert families.G.radius_m == pytest.approx(23.8, rel=0.01)
    assert families.P.radius_m == pytest.approx(26.7, rel=0.01)
    assert found.contact.approach_m == pytest.approx(truth["approach_m"], rel=2e-3)
    assert found.contact.contacts == truth["contacts"]
    slip = found.slip
    for row in truth["slip"]:
        assert slip.energy_at_force_J(row["force_N"]) == pytest.approx(row["energy_J"], rel=0.01)
    as_it_lay = analyzed(load_surface(REFERENCE / "caps.h5"), "conditioning.form=none")
    assert tilt(as_it_lay) == pytest.approx(truth["tilt_rad"], abs=5e-9)
    assert answers(as_it_lay) == pytest.approx(answers(found), rel=1e-6)
