"""The automatic choice: no model that is too rough, none dearer than needed, no false promise."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from capslip.analysis import analyze
from capslip.caps.families import group_families
from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.caps.table import CapFlag
from capslip.contact.accuracy import LEAST_ERROR
from capslip.contact.bulk import without_bulk
from capslip.contact.certificate import unmodelled_area_m2
from capslip.contact.choice import Choice, choose_model, estimate_error
from capslip.contact.material import composite
from capslip.contact.models.caps import caps as caps_curve
from capslip.contact.models.interacting import interacting
from capslip.contact.press import _by_detail
from capslip.contact.rung import ModelError, Scene, ladder
from capslip.contact.slip import slip_curve
from capslip.contact.time_needed import boundary_elements_s
from capslip.errors import ContactError
from capslip.problems import Problem
from capslip.settings import load_settings
from capslip.studies.chart.reference import ENERGIES, numbers_of, reference
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from scenes import caps_map

E_STAR_PA = composite((200e9, 200e9), (0.3, 0.3)).E_star_Pa
PIXEL_M = (2e-4, 2e-4)
SHAPE = (200, 300)
RUNGS = [rung.name for rung in ladder() if rung.automatic]
# (x, y, R, peak) on a face of 60 mm x 40 mm; the last two lie too low to touch
SPREAD = [
    (0.010, 0.010, 20.0, 0.50e-6),
    (0.030, 0.012, 24.0, 0.46e-6),
    (0.050, 0.010, 18.0, 0.48e-6),
    (0.012, 0.030, 22.0, 0.44e-6),
    (0.048, 0.031, 25.0, 0.47e-6),
    (0.030, 0.030, 20.0, 0.10e-6),
    (0.020, 0.022, 20.0, 0.05e-6),
]


TIME = 60.0  # for the map itself


def scene(
    caps, preload_N=100.0, tolerance=0.05, floor_m=-1e-6, ratio=0.10, time_limit_s=1e-3, **columns
):
    surface = caps_map(caps, SHAPE, PIXEL_M, floor_m)
    hills = find_hills(surface, ratio)
    table, families = group_families(fit_caps(surface, hills, "pinned"))
    table = table.with_columns(**columns)
    overrides = (f"contact.preload_N={preload_N}", f"contact.tolerance={tolerance}")
    overrides += (f"contact.time_limit_s={time_limit_s}",)
    # the map is level as it is
    overrides += ("conditioning.form=none", "contact.alignment=as_levelled")
    return table, families, surface, hills.label, hills.noise_m, load_settings(overrides=overrides)


def answers(curve, settings):
    slip = slip_curve(curve, settings.contact.preload_N, 0.2, 1.2143)
    return slip.energy_at_force_J(np.array([0.1, 0.25, 0.5, 0.75]) * slip.total_slip_force_N)


def test_one_cap_needs_no_neighbours():
    *given, settings = scene([(0.03, 0.02, 20.0, 0.5e-6)], 20.0)
    with_bulk = msgspec.structs.replace(settings.contact, bulk=True)
    choice = choose_model(*given, msgspec.structs.replace(settings, contact=with_bulk))
    assert choice.model == RUNGS[0]
    assert choice.estimated_error < 0.02
    assert choice.problem is None


@pytest.mark.parametrize("tolerance", [0.015, 0.05, 0.2, 0.9])
def test_the_chosen_rung_is_within_its_estimate_and_no_lower_one_promises_as_much(tolerance):
    given = scene(SPREAD, tolerance=tolerance)
    table, families, surface, _, _, settings = given
    choice = choose_model(*given)
    pressed = Scene.of(table, families, surface, settings, table.usable)
    energies = {
        rung.name: answers(rung.build(pressed), settings) for rung in ladder() if rung.automatic
    }
    error = np.abs(energies[choice.model] / energies["interacting"] - 1.0).max()
    assert error <= choice.estimated_error <= tolerance
    lower = RUNGS[: RUNGS.index(choice.model)]
    assert all(choice.estimates[model] > tolerance for model in lower)


# Ten equal spheres whose peaks differ by a tenth of what 1 N compresses them
LIGHT = [
    (0.006 + 0.012 * i, 0.010 + 0.020 * j, 15.0, 0.5e-6 + 0.3e-9 * ((3 * i + 5 * j) % 5 - 2) / 2)
    for i in range(5)
    for j in range(2)
]


def test_a_rung_whose_approach_alone_is_beyond_the_tolerance_is_not_taken():
    """Stiffness and energies do not tell equal spheres, which share a light load equally, apart.

    The approach counts from the highest, which bears more.
    """
    given = scene(LIGHT, preload_N=1.0)
    choice, settings = choose_model(*given), given[-1]
    pressed = Scene.of(*given[:3], settings, given[0].usable)
    approach_m = {
        rung.name: float(rung.build(pressed).approach_m(1.0)) for rung in ladder() if rung.automatic
    }
    assert choice.estimates["families"] < 0.04  # of stiffness and energies
    assert approach_m["families"] < 0.94 * approach_m["interacting"]
    assert choice.model not in ("families", "interacting")
    assert approach_m[choice.model] == pytest.approx(approach_m["interacting"], rel=0.05)
    forced = msgspec.structs.replace(settings.contact, model="families")
    estimate, _, doubts = estimate_error(
        *given[:-1], msgspec.structs.replace(settings, contact=forced)
    )
    assert estimate == choice.estimates["families"]
    (doubt,) = doubts
    assert doubt.code == "model_doubtful"
    assert "in the approach" in doubt.message


def test_a_dearer_rung_is_taken_as_the_tolerance_falls():
    chosen = [choose_model(*scene(SPREAD, tolerance=t)).model for t in (0.9, 0.2, 0.05, 0.015)]
    rungs = [RUNGS.index(model) for model in chosen]
    assert rungs == sorted(rungs)
    assert rungs[0] < rungs[-1]


def test_caps_that_cannot_touch_are_left_out_and_change_nothing():
    given = scene(SPREAD, ratio=0.14)
    choice = choose_model(*given)
    caps = given[0]
    assert len(caps) == 7
    assert choice.use.sum() == 5
    approach = []
    for use in (choice.use, caps.usable):
        depth_m = caps.peak_height_m[use].max() - caps.peak_height_m[use]
        curve = interacting(caps.radius_m[use], depth_m, caps.x_m[use], caps.y_m[use], E_STAR_PA)
        approach.append(float(curve.approach_m(100.0)))
    assert approach[0] == pytest.approx(approach[1], rel=1e-12)


def test_uncertain_caps_make_an_uncertain_result():
    certain = choose_model(*scene(SPREAD))
    n = len(scene(SPREAD)[0])
    unsure = choose_model(*scene(SPREAD, peak_height_se_m=np.full(n, 10e-9)))
    assert unsure.estimated_error > 5 * certain.estimates["interacting"]
    assert unsure.model == "interacting"
    assert unsure.problem.code == "boundary_elements_needed"
    assert unsure.boundary_elements_s > 0.1
    rough = choose_model(*scene(SPREAD, profile_residual_m=np.full(n, 10e-9)))
    assert rough.estimated_error > 5 * certain.estimates["interacting"]


def test_noise_is_no_error_of_shape():
    table, *rest = scene(SPREAD)
    rough = table.with_columns(profile_residual_m=np.full(len(table), 10e-9))
    surface, label, _, settings = rest[1:]
    choice = choose_model(rough, rest[0], surface, label, 10e-9, settings)
    assert choice.estimates["interacting"] < 0.02


def hills_of_power(power, stretch=1.0):
    """Four equal hills that fall as r^power, on a floor: no error of one is undone by another."""
    x_m = (np.arange(200) + 0.5) * 1.3e-4
    height_m = np.full((200, 200), -0.6e-6)
    for x, y in ((7, 6.5), (19, 7.5), (6.5, 19), (19.5, 18.5)):
        r_m = np.hypot((x_m - 1e-3 * x) / stretch, (x_m[:, None] - 1e-3 * y) * stretch)
        height_m = np.maximum(height_m, -0.4e-6 * (r_m / 5e-3) ** power)
    return HeightMap(height_m, (1.3e-4, 1.3e-4))


def estimate_and_error(surface):
    """Return what interacting caps promise, and their error beyond that of the reference."""
    overrides = ("contact.preload_N=80", "contact.model=interacting", "conditioning.form=none")
    settings = load_settings(overrides=overrides)
    analysis = analyze(surface, settings)
    truth, found = reference(surface, settings, with_peak=False), numbers_of(analysis)
    errors = {
        name: abs(found[name] / truth.numbers[name] - 1.0) - truth.uncertainty[name]
        for name in (*ENERGIES, "stiffness_without_bulk")
    }
    return analysis.contact.estimated_error, max(errors.values())


@pytest.mark.long
@pytest.mark.parametrize("power", [1.6, 2.5, 3.0])
def test_a_shape_that_all_hills_share_is_part_of_the_error(power):
    estimate, error = estimate_and_error(hills_of_power(power))
    assert 0.05 < error <= estimate


def test_spheres_are_within_their_least_error_of_the_map_pressed():
    estimate, error = estimate_and_error(hills_of_power(2.0))
    assert error <= estimate < 1.1 * LEAST_ERROR


@pytest.mark.parametrize("stretch", [1.2, 1.3])  # principal radii of 2.1 and 2.9 to one
def test_ellipsoids_have_no_error_of_shape(stretch):
    estimate, error = estimate_and_error(hills_of_power(2.0, stretch))
    assert error <= estimate < 0.02


def with_caps_at_one_end():
    # all caps at one end of a flat floor: the least-squares plane tilts towards them
    places = [(0.006 + 0.011 * i, 0.006 + 0.0093 * j) for i in range(3) for j in range(4)]
    caps = [(x, y, 20.0, -0.1e-6 * (x > 0.02)) for x, y in places]
    return caps_map(caps, SHAPE, PIXEL_M, -0.5e-6)


def levelled_by(robust, *settings):
    settings += (f"conditioning.form_robust={robust}", "contact.preload_N=300")
    found = analyze(with_caps_at_one_end(), load_settings(overrides=settings))
    shares = np.array([0.25, 0.5, 0.75])
    return found, found.slip.energy_at_force_J(shares * found.slip.total_slip_force_N)


def test_the_tilt_of_the_levelling_is_part_of_the_error():
    tilted, energy_J = levelled_by("false", "contact.alignment=as_levelled")
    level, true_J = levelled_by("true", "contact.alignment=as_levelled")
    error = np.abs(energy_J / true_J - 1.0).max()
    assert 0.1 < error <= tilted.contact.estimated_error
    assert level.contact.estimated_error < 0.05
    # boundary elements would press the same tilted map
    codes = {problem.code for problem in tilted.problems}
    assert "levelling_decides" in codes
    assert "boundary_elements_needed" not in codes


def test_the_levelling_of_a_face_that_balances_is_no_part_of_the_error():
    load_point = "contact.load_point_m=[0.017,0.02]"  # among the caps
    (tilted, energy_J), (level, other_J) = (levelled_by(r, load_point) for r in ("false", "true"))
    assert energy_J == pytest.approx(other_J, rel=1e-6)
    assert tilted.contact.estimated_error == pytest.approx(level.contact.estimated_error, rel=1e-3)
    assert tilted.contact.estimated_error < 0.05
    assert "levelling_decides" not in {problem.code for problem in tilted.problems}


def test_where_caps_are_not_enough_the_map_is_pressed_if_there_is_time():
    n = len(scene(SPREAD)[0])
    unsure = {"peak_height_se_m": np.full(n, 10e-9)}
    needed_s = boundary_elements_s(SHAPE)
    assert choose_model(*scene(SPREAD, time_limit_s=TIME)).model in RUNGS
    for caps, columns in ((SPREAD, unsure), (SPREAD[:5], {"preload_N": 3000.0, "floor_m": 0.3e-6})):
        late = choose_model(*scene(caps, time_limit_s=0.99 * needed_s, **columns))
        in_time = choose_model(*scene(caps, time_limit_s=1.01 * needed_s, **columns))
        assert (late.model, in_time.model) == ("interacting", "boundary_elements")
        limit = f"more than {0.99 * needed_s:g} s of contact.time_limit_s"
        assert limit in late.problem.message
        assert f"take about {needed_s:.2g} s" in late.problem.message
        assert in_time.problem.code == "caps_not_pressed"
        assert not in_time.use.any()


def test_caps_that_cannot_carry_the_load_leave_it_to_the_map():
    given = scene(SPREAD, time_limit_s=TIME)
    none = given[0].with_columns(flags=np.full(len(given[0]), CapFlag.not_convex, dtype=np.uint16))
    choice = choose_model(none, *given[1:])
    assert choice.model == "boundary_elements"
    assert "no cap stands above the cut" in choice.reason
    late = scene(SPREAD)
    with pytest.raises(ContactError, match="no cap stands"):
        choose_model(none, *late[1:])


def test_contacts_that_run_together_are_not_promised_anything():
    near = [(0.028, 0.02, 20.0, 0.5e-6), (0.031, 0.02, 20.0, 0.5e-6)]
    table, families, surface, label, noise_m, settings = scene(
        [near[0], (0.05, 0.02, 20.0, 0.5e-6)]
    )
    moved = table.with_columns(x_m=np.array([0.028, 0.031]))
    choice = choose_model(moved, families, surface, label, noise_m, settings)
    assert choice.estimated_error is None
    assert "run together" in choice.problem.message
    two_maps = choose_model(moved, families, surface, None, noise_m, settings)
    assert two_maps.problem.code == "boundary_elements_needed"
    assert two_maps.problem.advice.startswith("--set mating.way=composite")  # one map to press


def test_contacts_wider_than_their_hills_are_not_promised_anything():
    choice = choose_model(*scene(SPREAD[:5], preload_N=3000.0, floor_m=0.3e-6))
    assert choice.estimated_error is None
    assert choice.problem.code == "boundary_elements_needed"


def test_a_face_that_touches_beside_its_hills_is_not_promised_anything():
    given = list(scene(SPREAD[:5]))
    assert choose_model(*given).estimated_error is not None
    given[3] = np.where(given[3] == given[3][49, 51], 0, given[3])  # one hill was not recognised
    choice = choose_model(*given)
    assert choice.estimated_error is None
    assert "no hills" in choice.reason


def test_unmodelled_area_is_that_of_a_plateau_above_the_plane():
    caps, _, surface, _, _, _ = scene(SPREAD[:1], 20.0)
    label = (surface.height_m > -1e-6).astype(int)
    curve = interacting(caps.radius_m, [0.0], caps.x_m, caps.y_m, E_STAR_PA)
    approach_m = float(curve.approach_m(20.0))
    area = (surface, label, curve, approach_m, float(caps.peak_height_m[0]))
    assert unmodelled_area_m2(*area, 0.0) == 0.0

    def with_plateau(level_m):
        height_m = surface.height_m.copy()
        height_m[150:160, 200:220] = level_m
        return replace(surface, height_m=height_m)

    as_high = with_plateau(caps.peak_height_m[0])
    assert unmodelled_area_m2(as_high, *area[1:], 0.0) == pytest.approx(200 * 4e-8)
    lower = with_plateau(caps.peak_height_m[0] - 2 * approach_m)
    assert unmodelled_area_m2(lower, *area[1:], 0.0) == 0.0
    # Noise of that size may hide that it touches
    assert unmodelled_area_m2(lower, *area[1:], 2 * approach_m) > 0.0


@pytest.mark.parametrize(("outside", "found"), [(18, False), (19, True)])
def test_a_block_of_which_half_lies_on_hills_is_not_asked(outside, found):
    """Blocks of 6 x 6 points, one of them above the plane."""
    height_m = np.full((600, 606), -1.0)
    height_m[300:306, 12:18] = 1e-6
    label = np.zeros(height_m.shape, dtype=int)
    label[300:306, 12:18] = np.where(np.arange(36) < 36 - outside, 1, 0).reshape(6, 6)
    surface = HeightMap(height_m, (1e-4, 2e-4))
    curve = interacting([20.0], [0.0], [0.1], [0.05], E_STAR_PA)
    area_m2 = unmodelled_area_m2(surface, label, curve, 1e-7, 0.0, 0.0)
    assert area_m2 == pytest.approx(36 * 2e-8 * found)


def test_the_bulk_term_stays_where_nothing_would_be_left():
    alone = caps_curve([20.0], [0.0], E_STAR_PA)
    approach_m = float(alone.approach_m(100.0))
    rest, with_bulk = without_bulk(alone, 0.1 * approach_m / 100.0, 100.0)
    assert not with_bulk
    assert float(rest.approach_m(100.0)) == pytest.approx(0.9 * approach_m)
    for share in (0.8, 1.5):  # beyond 2/3 the stiffness of a Hertz contact would be negative
        kept, with_bulk = without_bulk(alone, share * approach_m / 100.0, 100.0)
        assert with_bulk
        assert kept is alone


def test_boundary_elements_take_longer_on_finer_grids():
    assert boundary_elements_s((400, 600)) > 4 * boundary_elements_s((200, 300))


@pytest.mark.parametrize("softer", [1.0, 1e-6])  # 300 N and 0.3 mN
@pytest.mark.parametrize("rim", [1.02, 1.05, 1.2])
def test_the_flank_beside_a_contact_does_not_touch(rim, softer):
    """Outside its contact a pressed sphere gapes (Hertz), however close its hill ends there."""
    x0_m, y0_m, radius_m, top_m = SPREAD[0]
    surface = caps_map(SPREAD[:1], SHAPE, PIXEL_M, -1e-6)
    curve = interacting([radius_m], [0.0], [x0_m], [y0_m], softer * E_STAR_PA)
    approach_m = float(curve.approach_m(softer * 300.0))
    a_m = float(np.sqrt(approach_m * radius_m))
    y_m, x_m = ((np.arange(n) + 0.5) * 2e-4 for n in SHAPE)
    r_m = np.hypot(x_m - x0_m, y_m[:, None] - y0_m)
    hill = (r_m <= rim * a_m).astype(int)
    assert unmodelled_area_m2(surface, hill, curve, approach_m, top_m, 0.0) == 0.0
    smaller = (r_m <= 0.7 * a_m).astype(int)
    assert unmodelled_area_m2(surface, smaller, curve, approach_m, top_m, 0.0) > 0.0


def test_what_touches_on_a_hill_far_beside_its_contact_is_no_cap_s():
    """Not within 1.5 half-axes, which the fit answers for, nor where noise alone may reach."""
    x0_m, y0_m, radius_m, top_m = SPREAD[0]
    surface = caps_map(SPREAD[:1], SHAPE, PIXEL_M, -1e-6)
    hill = (surface.height_m > -1e-6).astype(int)
    curve = interacting([radius_m], [0.0], [x0_m], [y0_m], E_STAR_PA)
    approach_m = float(curve.approach_m(20.0))
    a_m = float(np.sqrt(approach_m * radius_m))
    row, col = int(y0_m / 2e-4) // 2 * 2, int((x0_m + 2.0 * a_m) / 2e-4) // 2 * 2
    block = np.s_[row : row + 2, col : col + 2]  # of the means that are asked
    height_m = surface.height_m.copy()
    height_m[block] = top_m
    burr = replace(surface, height_m=height_m)

    def area_m2(face, noise_m=0.0, half_axis_m=None):
        given = (face, hill, curve, approach_m, top_m, noise_m)
        return unmodelled_area_m2(*given, half_axis_m)

    assert hill[block].all()
    assert area_m2(surface) == 0.0
    assert area_m2(burr) == pytest.approx(4 * 4e-8)
    assert area_m2(burr, half_axis_m=np.array([1.2 * a_m])) == pytest.approx(4 * 4e-8)
    assert area_m2(burr, half_axis_m=np.array([1.4 * a_m])) == 0.0
    assert area_m2(burr, 0.1 * approach_m) == pytest.approx(4 * 4e-8)
    assert area_m2(burr, 0.5 * approach_m) == 0.0


@pytest.mark.long
def test_a_burr_on_the_flank_of_a_hill_is_not_missed():
    """It carries 1 % of the load, and 13 % of the energy at a quarter of gross slip."""
    tops = (*SPREAD[:1], (0.030, 0.0055, 24.0, 0.46e-6), *SPREAD[2:5], (0.03, 0.03, 20.0, 0.42e-6))

    def energy_J(n, **contact):
        shape, pixel_m = (160 * n, 240 * n), (2.5e-4 / n, 2.5e-4 / n)
        surface = caps_map(tops, shape, pixel_m, -1e-6)
        y_m = (np.arange(shape[0]) + 0.5) * pixel_m[0]
        with_burr_m = surface.height_m + 0.3e-6 * np.exp(-((y_m[:, None] / 1.5e-3) ** 2))
        overrides = (f"contact.{name}={value}" for name, value in contact.items())
        settings = load_settings(overrides=("contact.preload_N=1000", *overrides))
        analysis = analyze(replace(surface, height_m=with_burr_m), settings)
        assert analysis.status == "ok"
        return analysis.answer.energy_J

    assert energy_J(1) == pytest.approx(energy_J(2, model="boundary_elements"), rel=0.02)


@pytest.mark.parametrize(("at_a_quarter", "answers"), [(0.61, False), (0.9, True)])
def test_caps_answer_for_a_map_where_they_know_more_from_a_quarter_of_gross_slip_on(
    at_a_quarter, answers
):
    """Of a tenth a map of metal knows next to nothing, and nobody doubts it for that alone."""
    of_caps = ModelError(0.22, 1.23, ((0.1, 0.86), (0.5, 0.86), (1.0, 0.12)))
    given = {}, np.zeros(0, dtype=bool), 0.1
    caps = Choice("interacting", "", 1.23, *given, errors=of_caps)
    whole = Choice("boundary_elements", "", None, *given, of_the_map=True, caps=caps)
    of_map = ModelError(0.06, 1.41, ((0.1, 1.41), (0.25, at_a_quarter), (1.0, 0.05)))
    error = _by_detail(of_map, (Problem("detail_decides", "warning", ""),))
    assert whole.caps_within(error) == (caps if answers else None)
    one_error = replace(whole, caps=replace(caps, errors=None))
    assert one_error.caps_within(1.24) == one_error.caps
    assert one_error.caps_within(1.23) is None


@pytest.mark.long
@pytest.mark.scans
def test_a_real_map_of_metal_is_not_lost_to_caps_that_know_less(scans):
    """Its caps touch wider than any hardness holds: they failed, and knew 4 to 7 times less."""
    whole = load_surface(scans / "ski_base_stone_ground_alicona.x3p")
    part = HeightMap(np.array(whole.height_m[300:500, 300:500]), whole.pixel_size_m)
    given = ("contact.nominal_pressure_Pa=2e6", "material.preset=steel")
    found = analyze(part, load_settings(overrides=given))
    assert found.contact.rung.made_from == "map"
    assert found.status == "check"
    assert found.contact.errors.stiffness < 0.1
