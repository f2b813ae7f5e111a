"""Patches of one scan under unlike pressures, where each pressure is a solution of the map."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from contact_cases import E_STAR_PA, state_of

import capslip
from capslip.analysis import analyze_once
from capslip.contact import joint
from capslip.contact.models.boundary_elements import RUNG, boundary_elements
from capslip.contact.models.caps import caps
from capslip.contact.models.families import families
from capslip.contact.press import ContactState
from capslip.contact.slip import slip_curve
from capslip.contact.solvers import solutions
from capslip.contact.uneven import scaled_between, side_by_side, standing_for
from capslip.contact.uneven_accuracy import error_of_patches, problems_of_patches
from capslip.errors import ContactError
from capslip.structure import band_state
from capslip.units import percent
from scenes import noisy_waves

SPHERE = families((1, 0), (20.0, 20.0), (0.0, 0.0), E_STAR_PA)
MANY = caps(np.full(200, 2.0), np.linspace(0.0, 4e-6, 200), E_STAR_PA)


def pressed(tmp_path, pressures_Pa, *overrides, noise_m=0.0, points=44):
    path = tmp_path / "pressures.csv"
    path.write_text("pressure_Pa,area_m2\n" + "".join(f"{p!r},1e-5\n" for p in pressures_Pa))
    given = ("contact.model=boundary_elements", f"joint.pressure_map={path}", *overrides)
    whole = noisy_waves(noise_m)
    part = replace(whole, height_m=whole.height_m[:points, :points].copy())
    return analyze_once(part, capslip.load_settings(overrides=given))


def said(found):
    return [one for one in found.problems if one.code == "pressures_interpolated"]


@pytest.mark.parametrize("at_N", [[3.0], [1.0, 64.0], [0.5, 2.0, 9.0, 64.0]])
def test_a_sphere_under_any_other_load_is_a_sphere(at_N):
    load_N = np.array([0.01, 0.4, 2.9])
    found = scaled_between([SPHERE] * len(at_N), np.array(at_N), load_N)
    for N, one in zip(load_N, found, strict=True):
        d = SPHERE.approach_m(N)
        e = np.array([0.01, 0.3, 0.9]) * d
        assert one.approach_m(N) == pytest.approx(d, rel=1e-12)
        for name in ("load_drop_N", "stiffness_N_per_m", "loss_integral_J"):
            expected = getattr(SPHERE, name)(d, e)
            np.testing.assert_allclose(getattr(one, name)(d, e), expected, rtol=1e-9)


def test_a_known_load_keeps_its_curve_and_others_follow_their_neighbours():
    at_N = np.geomspace(50.0, 5000.0, 9)
    load_N = np.array([at_N[3], 1.2 * at_N[3], 0.8 * at_N[0]])
    known, near, below = scaled_between([MANY] * 9, at_N, load_N)
    for N, one, off in zip(load_N, (known, near, below), (1e-9, 0.05, 0.15), strict=True):
        d, drop_N = float(MANY.approach_m(N)), np.array([0.25, 0.6]) * N
        assert float(one.approach_m(N)) == pytest.approx(d, rel=off)
        at = float(one.approach_m(N))
        for name in ("withdrawal_m", "loss_integral_at_drop_J"):
            expected = getattr(MANY, name)(d, drop_N)
            np.testing.assert_allclose(getattr(one, name)(at, drop_N), expected, rtol=off)


def test_each_patch_takes_the_curve_of_the_nearest_known_load():
    """Of two curves that have nothing in common, by the ratio of loads."""
    soft, stiff = families((1, 0), (5.0, 5.0), (0.0, 0.0), E_STAR_PA), SPHERE
    found = scaled_between([soft, stiff], np.array([1.0, 100.0]), np.array([9.0, 11.0]))
    assert [one.curve for one in found] == [soft, stiff]


def test_patches_of_a_map_slip_as_far_as_a_top_between_its_pixels():
    """Its approach counts from the highest pixel, and its load is gone further below."""
    y_m, x_m = (np.mgrid[-16:16, -16:16] + 0.5) * 1e-4
    face = capslip.HeightMap(-(x_m**2 + y_m**2) / 40.0, (1e-4, 1e-4))
    load_N, weight = np.array([1.0, 0.7]) * 4 / 3 * E_STAR_PA * 3e-4**3 / 20, np.array([1.0, 2.0])
    curves = [boundary_elements(face, E_STAR_PA) for _ in load_N]
    slips = [slip_curve(curve, N, 0.2, 1.2) for curve, N in zip(curves, load_N, strict=True)]
    uneven = side_by_side(curves, load_N, weight)
    found = slip_curve(uneven, float(load_N @ weight), 0.2, 1.2)
    total_m = slips[0].total_slip_displacement_m
    assert found.total_slip_displacement_m == pytest.approx(total_m, rel=1e-9)
    delta_m = np.array([0.3, 0.9, 0.99, 1.0, 1.5]) * total_m
    for name, off in (("force_N", 1e-4), ("energy_J", 5e-4)):
        expected = sum(
            w * getattr(one, name)(delta_m) for one, w in zip(slips, weight, strict=True)
        )
        np.testing.assert_allclose(getattr(found, name)(delta_m), expected, rtol=off)


def joint_under(*loads_N):
    load_N = np.array(loads_N)
    return joint.Joint(1.0, 1.0, float(load_N.sum()), load_N, np.ones(len(load_N)), 9.0)


def test_where_no_pressure_has_a_curve_of_its_own_nothing_is_solved_for_another():
    """One alone, though its pixels be too few for the slip, or elastic caps under any."""
    caps_state = state_of(rung=replace(RUNG, solved_loads_N=None), preload_N=9.0, curve=SPHERE)
    (one,) = joint_under(3.0, 8.0, 9.0).loaded(caps_state)
    assert (one.preload_N, one.curve) == (9.0, SPHERE)

    def fails(*_):
        raise ContactError("too few pixels")

    blind = SimpleNamespace(approach_m=fails)
    (one,) = joint_under(9.0).loaded(state_of(rung=RUNG, preload_N=9.0, curve=blind))
    assert (one.preload_N, one.curve) == (9.0, blind)


def test_the_heaviest_patch_must_be_followed_and_one_of_spheres_is_no_guess():
    def refuses(load_N, _):
        if load_N < 2.0 or rung is not RUNG:
            raise ContactError("too few pixels")
        return SPHERE

    def loaded(*loads_N):
        state = state_of(rung=rung, preload_N=9.0, curve=SPHERE, first=refuses)
        return [one.preload_N for one in joint_under(*loads_N).loaded(state)]

    rung = RUNG
    assert loaded(1.0, 3.0, 8.0) == [3.0, 8.0]
    many_N = np.linspace(1.0, 8.0, 20)
    few_N = np.append(standing_for(many_N, np.ones(20), 8)[:-1], 9.0)
    assert few_N[0] < 2.0
    assert loaded(*many_N) == pytest.approx(few_N[few_N >= 2.0])
    with pytest.raises(ContactError):
        loaded(1.0, 1.5)
    rung = replace(RUNG, solved_loads_N=None)
    with pytest.raises(ContactError):
        loaded(3.0, 8.0)


def test_each_heap_of_loads_is_stood_for_by_its_middle_and_the_greatest_by_itself():
    load_N, weight = np.array([10.2, 1.0, 99.0, 10.0, 1.02, 100.0, 10.1, 1.01]), np.ones(8)
    assert standing_for(load_N, weight, 3).tolist() == [1.01, 10.1, 100.0]
    assert standing_for(load_N, weight, 1).tolist() == [100.0]
    weight[1] = 9.0
    assert standing_for(load_N, weight, 3).tolist() == [1.0, 10.1, 100.0]


def test_more_loads_are_solved_where_more_is_borne():
    load_N = np.geomspace(1.0, 100.0, 41)
    few = [standing_for(load_N, load_N**power, 8) for power in (-2.0, 0.0, 2.0)]
    light = [np.count_nonzero(one < 10.0) for one in few]
    assert light == sorted(light, reverse=True)
    assert light[0] > light[1] > light[2] >= 0


def test_a_load_that_slips_first_is_not_left_to_heavy_ones():
    """It bears a thousandth of all, and what is lost at small forces is its own."""
    load_N = np.append(np.linspace(50.0, 100.0, 30), 0.5)
    assert standing_for(load_N, np.ones(31), 3)[0] == 0.5


def test_the_lightest_take_no_solution_from_what_bears_the_load():
    """Loads over nine decades, of which the lower six bear a thousandth of all."""
    heavy_N, light_N = np.geomspace(0.1, 100.0, 60), np.geomspace(1e-7, 0.1, 60, endpoint=False)
    assert light_N.sum() < 2e-3 * heavy_N.sum()
    found = standing_for(np.append(light_N, heavy_N), np.ones(120), 8)
    assert np.count_nonzero(found > 0.1) >= 6
    assert found[0] > 1e-3


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("yields", [False, True])
def test_few_solved_pressures_stand_for_many(tmp_path, monkeypatch, yields):
    """At one level: where each finds its own, what moves between two of them is chance as well."""
    solved, solve = {}, ContactState.curve_after

    def once(contact, load_N, hardness_factor=1.0):
        at = load_N, hardness_factor
        if at not in solved:
            solved[at] = solve(contact, *at)
        return solved[at]

    monkeypatch.setattr(ContactState, "curve_after", once)  # of one map, at one level
    pressures_Pa = np.linspace(0.2e6, 1e6, 8).tolist()
    monkeypatch.setattr(joint, "MAX_SOLVED", 6)
    given = ("contact.alignment=as_levelled", *(("material.hardness_Pa=4e8",) if yields else ()))
    few = pressed(tmp_path, pressures_Pa, *given, points=64)
    monkeypatch.setattr(joint, "MAX_SOLVED", 8)
    every = pressed(tmp_path, pressures_Pa, *given, points=64)
    assert not said(every)
    (note,) = said(few)
    assert "the map was solved 6 times for 8 pressures of the joint" in note.message
    force_N = np.array([0.25, 0.5, 0.75]) * every.slip.total_slip_force_N
    off = few.slip.energy_at_force_J(force_N) / every.slip.energy_at_force_J(force_N) - 1.0
    assert np.abs(off).max() < min(0.05, note.effect.energy)
    assert few.slip.tangential_stiffness_N_per_m == pytest.approx(
        every.slip.tangential_stiffness_N_per_m, rel=0.005
    )
    assert few.slip.total_slip_force_N == pytest.approx(every.slip.total_slip_force_N, rel=1e-12)


def test_patches_too_light_for_the_pixels_are_scaled_and_said(tmp_path):
    """Of a noisy map. What they carry is not lost, and slips at any force."""
    heavy = pressed(tmp_path, [1e6], noise_m=2e-9)
    found = pressed(tmp_path, [1e6, 10.0, 1e3], noise_m=2e-9)
    (note,) = said(found)
    assert "the map was solved once for 3 pressures" in note.message
    assert "patches under less than 100 % of the greatest" in note.message
    assert found.slip.total_slip_force_N == pytest.approx(
        1.00101 * heavy.slip.total_slip_force_N, rel=1e-9
    )
    delta_m = 0.5 * heavy.slip.total_slip_displacement_m
    added_N = float(found.slip.force_N(delta_m) - heavy.slip.force_N(delta_m))
    assert added_N == pytest.approx(0.2 * (1e3 + 10.0) * 1e-5, rel=0.02)
    # Their stiffness, and they were taken for spheres, may be missing as a whole
    light = (1e-3) ** (1 / 3) + (1e-5) ** (1 / 3)
    assert note.effect.tangential_stiffness == pytest.approx(np.log1p(light), rel=1e-3)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize(
    ("hardness", "noise_m"), [((), 0.0), (("material.hardness_Pa=4e8",), 0.0), ((), 2e-9)]
)
def test_an_interval_of_few_solved_pressures_follows_the_preload(
    tmp_path, monkeypatch, hardness, noise_m
):
    """At a hundredth more of it as if that had been given; noise is pressed as it is.

    At the level that was found, which an interval holds.
    """
    monkeypatch.setattr(joint, "MAX_SOLVED", 2)
    at, answers = np.linspace(0.7e6, 1e6, 3), []
    for factor in (1.0, 1.01):
        given = ("answer.slip_force_N=4.3", "contact.alignment=as_levelled", *hardness)
        answers.append(pressed(tmp_path, (factor * at).tolist(), *given, noise_m=noise_m))
    state = band_state.State(answers[0].answer, True, answers[0].parts, answers[0].settings)
    log = dict.fromkeys(("friction", "modulus", "hardness"), np.zeros(2))
    delta_m, energy_J = state.under({**log, "preload": np.log([1.0, 1.01])})
    for i, one in enumerate(answers):
        assert delta_m[i] == pytest.approx(one.answer.displacement_m, rel=2e-3)
        assert energy_J[i] == pytest.approx(one.answer.energy_J, rel=0.02)


def patches_of(loads_N, rung=RUNG):
    return [SimpleNamespace(preload_N=N, rung=rung) for N in loads_N]


class Uneven:
    """A joint whose answers depend on which of its patches were solved."""

    most_solved = joint.MAX_SOLVED

    def __init__(self, load_N, answers):
        self.load_N, self.weight = np.array(load_N), np.ones(len(load_N))
        self.preload_N, self.scan_load_N, self.answers = sum(load_N), max(load_N), answers

    def kappa_of(self, patches):
        return 1.2

    def curve_of(self, patches, kappa):
        K, *W = self.answers[tuple(one.preload_N for one in patches)]
        return SimpleNamespace(
            approach_m=lambda N: 0.0,
            stiffness_N_per_m=lambda d: K,
            loss_integral_at_drop_J=lambda d, drop_N: np.array(W),
        )


def said_of(joint, patches, tolerance):
    return problems_of_patches(joint, patches, error_of_patches(joint, patches), tolerance)


def test_what_moves_without_each_of_the_solutions_but_the_greatest_is_said():
    """The root of the sum of squares, of which most is chance; of two forces the worse."""
    of = Uneven([1, 2, 3, 4, 6, 8], {
        (1, 2, 4, 6, 8): np.ones(5),
        (2, 4, 6, 8): np.ones(5),
        (1, 4, 6, 8): (1.03, 1.0, 0.91, 1.0, 1.01),
        (1, 2, 6, 8): (1.0, 0.99, 1.12, 1.0, 0.95),
        (1, 2, 4, 8): (0.96, 1.0, 1.0, 1.02, 0.88),
    })  # fmt: skip
    W = 0.6 * np.sqrt(0.01**2 + 0.05**2 + 0.12**2)
    (one,) = said_of(of, patches_of([1, 2, 4, 6, 8]), W + 1e-9)
    assert one.severity == "info"
    assert "solved 5 times for 6 pressures" in one.message
    assert "the stiffness by 3 %" in one.message
    assert f"the energy by {percent(W)} at a quarter of mu N and by 19 % at a tenth" in one.message
    assert "too few pixels" not in one.message
    assert (one.effect.tangential_stiffness, one.effect.energy) == pytest.approx((0.03, W))
    (strict,) = said_of(of, patches_of([1, 2, 4, 6, 8]), W - 1e-9)
    assert strict.severity == "warning"


def test_of_very_few_solutions_what_moves_most_at_any_force_counts_twice():
    """One difference may vanish by chance; so few are solved where time is short for more."""
    of = Uneven([1, 2, 3], {(1, 3): np.ones(5), (3,): (1.02, 1.0, 0.97, 1.0, 1.01)})
    of.most_solved = 2
    left = error_of_patches(of, patches_of([1, 3]))
    assert left.stiffness == pytest.approx(0.02)
    assert [left.energy_at(share) for share in (0.1, 0.25, 1.0)] == pytest.approx([0.06] * 3)


@pytest.mark.parametrize(("seconds", "count"), [(600.0, 8), (50.0, 7), (21.0, 3), (1.0, 2)])
def test_of_a_large_map_as_many_pressures_are_solved_as_there_is_time_for(seconds, count):
    """No fewer than two; each has its share of the time."""
    settings = capslip.load_settings(overrides=(f"contact.time_limit_s={seconds}",))
    large = SimpleNamespace(
        measured_area_m2=1.0, shape=(1500, 1000), pixel_area_m2=1.0, side_m=(1.0, 1.0)
    )
    found = joint.joint_of(settings, large)
    assert joint.boundary_elements_s(large.shape) == pytest.approx(6.77, abs=0.01)
    assert found.most_solved == count
    uneven = replace(found, load_N=np.arange(1.0, 20.0), weight=np.ones(19))
    limit_s = uneven.settings_of_scan(settings).contact.time_limit_s
    assert limit_s == pytest.approx(seconds / count)
    assert uneven.under(2.0 * uneven.preload_N).most_solved == count


def test_less_is_known_of_the_energy_the_smaller_the_force():
    of = Uneven([1, 2, 3], {(2, 3): np.ones(5), (3,): (1.0, 1.0, 1.16, 1.1, 1.0)})
    left = error_of_patches(of, patches_of([2, 3]))
    light = 1 / 6  # what the patch bears whose pixels are too few
    assert left.stiffness == pytest.approx(light)
    expected = np.array([2.0, 1.0, 1.0, 1.0]) * (np.array([0.2, 0.2, 0.06, 0.06]) + light)
    assert [left.energy_at(share) for share in (0.05, 0.1, 0.25, 0.9)] == pytest.approx(expected)


def test_light_patches_count_as_what_they_carry():
    of = Uneven([1.0, 2.0, 3.0, 4.0], dict.fromkeys([(3.0, 4.0), (4.0,)], np.ones(5)))
    (one,) = said_of(of, patches_of([3.0, 4.0]), 0.05)
    assert one.severity == "warning"
    assert one.effect.energy == one.effect.tangential_stiffness == pytest.approx(0.3)
    assert "30 % of the preload rests on patches under less than 75 % of" in one.message
    of.weight = np.array([6.0, 2.0, 1.0, 1.0])  # scans, of 17 N in all
    of.preload_N = 17.0
    (one,) = said_of(of, patches_of([3.0, 4.0]), 0.05)
    assert one.effect.energy == pytest.approx(10.0 / 17.0)


def test_patches_below_the_least_of_enough_solutions_are_not_too_light():
    """They follow from heavier ones as these from each other, and that is all that is said."""
    few = np.arange(2.0, 10.0)
    answers = {tuple(few): np.ones(5)}
    answers |= {tuple(np.delete(few, i)): np.ones(5) for i in range(7)}
    (one,) = said_of(Uneven([1.0, *few], answers), patches_of(few), 0.05)
    assert one.severity == "info"
    assert max(one.effect.energy, one.effect.tangential_stiffness) < 1e-5
    assert "too few pixels" not in one.message


def test_nothing_is_said_where_every_pressure_has_its_curve():
    of = Uneven([1.0, 2.0], {})
    assert said_of(of, patches_of([1.0, 2.0]), 0.05) == []
    any_load = replace(RUNG, solved_loads_N=None)
    assert said_of(of, patches_of([2.0], any_load), 0.05) == []


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("hardness", [(), ("material.hardness_Pa=4e8",)])
def test_a_light_patch_whose_slip_there_was_no_time_to_follow_says_so(
    tmp_path, monkeypatch, hardness
):
    """The heaviest does not know: it had time enough; the worst of the others is said."""
    left = {1.0: 0.0, 0.5: 0.4, 0.25: 0.2}
    followed = solutions.unload

    def short(face, pressed, *given, **more):
        share = round(pressed.load_N / heaviest_N, 2)
        done = followed(face, pressed, *given, **more)
        return replace(done, cut_short=share < 1.0, loss_error=left.get(share, 0.0))

    heaviest_N = 1e6 * (44 * 5e-5) ** 2
    monkeypatch.setattr(solutions, "unload", short)
    found = pressed(tmp_path, [2.5e5, 5e5, 1e6], *hardness)
    assert found.contact.preload_N == pytest.approx(heaviest_N)
    (one,) = (one for one in found.problems if one.code == "time_limit_reached")
    assert one.severity == "warning"
    assert one.effect.energy == 0.4
    assert one.message.startswith(f"under {0.5 * heaviest_N:.3g} N on the scan, ")


def test_patches_are_pressed_to_the_approach_of_their_own_load():
    load_N = np.array([1.0, 8.0])
    whole = side_by_side([SPHERE, SPHERE], load_N, np.array([1.0, 2.0]))
    np.testing.assert_allclose(whole.patch_approach_m, SPHERE.approach_m(load_N), rtol=1e-12)
    assert whole.preload_approach_m == whole.patch_approach_m[1]
