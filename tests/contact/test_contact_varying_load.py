"""Slip under an oscillating normal load: closed forms, and springs followed step by step."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from test_contact_yielding_map import R_M, E, metal_unloading, sphere

from capslip.analysis import analyze_families, analyze_once
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.models.families import families
from capslip.contact.models.interacting import InteractingCurve, interacting
from capslip.contact.slip import slip_curve
from capslip.contact.varying_load import VaryingSlip, varying
from capslip.errors import SettingsError
from capslip.settings import SlipSettings, load_settings
from capslip.structure.jenkins import jenkins
from capslip.surface.readers import load_surface

FACE = Path(__file__).parents[2] / "sample_surfaces" / "paper_face_a.h5"

MU, KAPPA, PRELOAD_N = 0.2, 1.2143, 460.37
TWO = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
ONE = families(1, 1.0, 0, 109.89e9)
CONSTANT = slip_curve(TWO, PRELOAD_N, MU, KAPPA)
SHARES = np.array([0.1, 0.25, 0.5, 0.75])


def under(ratio, phase_rad=0.0, constant=CONSTANT):
    return varying(constant, SlipSettings(normal_amplitude_ratio=ratio, normal_phase_rad=phase_rad))


def brush(approach_m, gap_m, stiffness_N_per_m, displacement_m):
    """Return the force of springs that slip each by itself, over a history in small steps."""
    q = np.zeros_like(gap_m)
    force_N, last_m = [], displacement_m[0]
    for d, u in zip(approach_m, displacement_m, strict=True):
        p = stiffness_N_per_m * np.maximum(d - gap_m, 0.0)
        q = np.clip(q + stiffness_N_per_m / KAPPA * (u - last_m), -MU * p, MU * p)
        force_N.append(q.sum())
        last_m = u
    return np.array(force_N)


def springs():
    """Return gaps and stiffnesses of one Hertz contact, N = C d^1.5.

    The number of springs up to the gap g is 1.5 C g^0.5.
    """
    edges_m = 4e-7 * np.linspace(0, 1, 1001) ** 2
    stiffness_N_per_m = 1.5 * float(ONE.load_N(1.0)) * np.diff(edges_m**0.5)
    return (edges_m[1:] + edges_m[:-1]) / 2, stiffness_N_per_m


def test_a_constant_load_is_the_closed_form():
    steady = VaryingSlip(TWO, PRELOAD_N, CONSTANT.approach_m, MU, KAPPA, 0.0, 0.3)
    T = np.append(SHARES, [1e-5, 0.01, 0.99, 1.0]) * CONSTANT.total_slip_force_N
    np.testing.assert_allclose(steady.displacement_m(T), CONSTANT.displacement_m(T), rtol=2e-3)
    expected_J = CONSTANT.energy_at_force_J(T)
    np.testing.assert_allclose(steady.energy_at_force_J(T), expected_J, rtol=3e-3)
    assert varying(CONSTANT, SlipSettings()) is CONSTANT


@pytest.mark.parametrize("phase_rad", [0.0, math.pi])
def test_in_phase_nothing_slips_below_mu_times_the_normal_amplitude(phase_rad):
    slip = under(0.1, phase_rad)
    T = CONSTANT.total_slip_force_N
    assert slip.energy_at_force_J(0.0999 * T) < 1e-6 * CONSTANT.energy_at_force_J(0.0999 * T)
    assert not slip.energy_at_force_J(np.geomspace(1e-6, 0.09, 9) * T).any()  # rounding is none
    assert slip.energy_at_force_J(0.2 * T) > 0.3 * CONSTANT.energy_at_force_J(0.2 * T)
    assert slip.total_slip_force_N == pytest.approx(0.9 * T, rel=1e-12)


@pytest.mark.parametrize("n_P", [18, 1800])
@pytest.mark.parametrize(("ratio", "phase_rad"), [(0.01, 1.57), (0.1, 0.3), (0.05, 0.0)])
def test_where_a_family_slips_as_a_whole_the_answers_are_those_of_the_cycles(n_P, ratio, phase_rad):
    """The more caps it has, the steeper energy and displacement rise there."""
    many = families((5, n_P), (23.8, 26.7), (0.0, 2e-7), 109.89e9)
    slip = under(ratio, phase_rad, slip_curve(many, PRELOAD_N, MU, KAPPA))
    T = np.random.default_rng(n_P).uniform(0.02, 0.98, 40) * slip.total_slip_force_N
    cycles = [slip._cycle(share) for share in (T / slip.total_slip_force_N).tolist()]
    lost_J, moved_m = np.array([(W, np.ptp(U) / 2) for W, _, U in cycles]).T
    np.testing.assert_allclose(slip.displacement_m(T), moved_m, rtol=1e-3)
    atol_J = 1e-5 * lost_J.max()
    np.testing.assert_allclose(slip.energy_at_force_J(T), lost_J, rtol=3e-3, atol=atol_J)
    np.testing.assert_allclose(slip.force_N(slip.displacement_m(T)), T, rtol=1e-9)


def test_next_to_no_oscillation_changes_next_to_nothing():
    still = slip_curve(families((5, 180), (23.8, 26.7), (0.0, 2e-7), 109.89e9), 460.0, MU, KAPPA)
    T = np.linspace(0.05, 0.95, 60) * still.total_slip_force_N
    moved_J = under(1e-4, math.pi / 2, still).energy_at_force_J(T)
    np.testing.assert_allclose(moved_J, still.energy_at_force_J(T), rtol=5e-3)


@pytest.mark.parametrize("phase_rad", [0.0, 0.7, math.pi / 2, 2.0, -1.0])
def test_gross_slip_begins_where_the_ellipse_meets_the_limit_of_friction(phase_rad):
    slip = under(0.3, phase_rad)
    angle = np.linspace(0, 2 * np.pi, 100_001)
    load_N = PRELOAD_N * (1 + 0.3 * np.cos(angle - phase_rad))
    excess = np.abs(slip.total_slip_force_N * np.cos(angle)) - MU * load_N
    assert excess.max() == pytest.approx(0.0, abs=1e-7 * MU * PRELOAD_N)


def test_beyond_gross_slip_no_cycle_is_steady():
    slip = under(0.1, 0.7)
    limit_m = slip.total_slip_displacement_m
    limit_J = slip.energy_at_force_J(slip.total_slip_force_N)
    share = np.array([0.0, 0.5, 1.0, 1.0 + 1e-13, 1.0 + 1e-9, 1.5, 2.0])
    steady = [True] * 4 + [False] * 3
    energy_J, force_N = slip.energy_J(share * limit_m), slip.force_N(share * limit_m)
    assert np.isfinite(energy_J).tolist() == np.isfinite(force_N).tolist() == steady
    np.testing.assert_allclose(energy_J[2:4], limit_J, rtol=1e-12)
    np.testing.assert_allclose(energy_J[:4], slip.energy_at_force_J(force_N[:4]), rtol=1e-12)
    assert np.isnan(slip.loop(1.5 * limit_m, 21)).all()
    assert np.isfinite(slip.loop(limit_m, 21)).all()


def test_the_sense_of_the_phase_and_half_a_turn_change_nothing():
    T = SHARES * 0.9 * CONSTANT.total_slip_force_N
    one = under(0.2, 0.7).energy_at_force_J(T)
    np.testing.assert_allclose(under(0.2, 0.7 + math.pi).energy_at_force_J(T), one, rtol=5e-3)


@cache
def of_one_contact(ratio, phase_rad):
    """Return the slip of the contact of the springs, without and with a load that oscillates."""
    constant = slip_curve(ONE, float(ONE.load_N(2e-7)), MU, KAPPA)
    return constant, under(ratio, phase_rad, constant)


@pytest.mark.parametrize(("ratio", "phase_rad"), [(0.1, math.pi / 2), (0.3, 0.7), (0.25, 0.0)])
def test_against_springs_followed_step_by_step(ratio, phase_rad):
    """Springs of their own gaps, each with Coulomb's law: what the theorem is exact for."""
    gap_m, stiffness_N_per_m = springs()
    constant, slip = of_one_contact(ratio, phase_rad)
    T = 0.4 * float(constant.total_slip_force_N)
    displacement_m, _ = slip.loop(float(slip.displacement_m(T)), 241)
    steps = np.arange(0, 720, 0.1)  # three turns
    turns = np.interp(
        steps, np.arange(721), np.append(np.tile(displacement_m[:-1], 3), displacement_m[0])
    )
    wave = np.cos(2 * np.pi * steps / 240 - phase_rad)
    approach_m = ONE.approach_m(constant.preload_N * (1 + ratio * wave))
    force_N = brush(approach_m, gap_m, stiffness_N_per_m, turns)[-2401:]
    assert np.ptp(force_N) / 2 == pytest.approx(T, rel=1e-2)
    lost_J = np.sum((force_N[1:] + force_N[:-1]) / 2 * np.diff(turns[-2401:]))
    assert lost_J == pytest.approx(float(slip.energy_at_force_J(T)), rel=1e-2)


@pytest.mark.parametrize("share", [0.3, 0.9])
@pytest.mark.parametrize(("ratio", "phase_rad"), [(0.1, 0.7), (0.3, math.pi / 2), (0.2, 2.5)])
def test_a_joint_preloaded_and_then_sheared_settles_where_the_loop_is(ratio, phase_rad, share):
    """Moved as the loop says, springs that were preloaded first have its force, without offset."""
    gap_m, stiffness_N_per_m = springs()
    constant, slip = of_one_contact(ratio, phase_rad)
    T = share * slip.total_slip_force_N
    displacement_m, loop_N = slip.loop(float(slip.displacement_m(T)), 241)
    steps = np.arange(0, 720.01, 0.1)  # three turns
    turns = np.interp(
        steps, np.arange(721), np.append(np.tile(displacement_m[:-1], 3), displacement_m[0])
    )
    wave = np.cos(2 * np.pi * steps / 240 - phase_rad)
    first = np.linspace(0.0, 1.0, 100)
    wave = np.concatenate([first * wave[0], np.full(100, wave[0]), wave])
    moved_m = np.concatenate([np.zeros(100), first * turns[0], turns])
    approach_m = ONE.approach_m(constant.preload_N * (1 + ratio * wave))
    force_N = brush(approach_m, gap_m, stiffness_N_per_m, moved_m)[-2401::10]
    np.testing.assert_allclose(force_N, loop_N, atol=0.02 * T)
    assert loop_N.max() == -loop_N.min() == pytest.approx(T)


def test_a_loop_under_a_constant_load_is_that_of_masing():
    steady = VaryingSlip(TWO, PRELOAD_N, CONSTANT.approach_m, MU, KAPPA, 0.0, 0.3)
    amplitude_m = float(CONSTANT.displacement_m(0.6 * CONSTANT.total_slip_force_N))
    displacement_m, force_N = steady.loop(amplitude_m, 241)
    expected_m, expected_N = (one[:121][::-1] for one in CONSTANT.loop(amplitude_m, 241))
    got_N = np.interp(displacement_m[:121], expected_m, expected_N)
    np.testing.assert_allclose(force_N[:121], got_N, atol=5e-3 * force_N.max())


@pytest.mark.parametrize(
    ("phase_rad", "times"),
    [(0.0, (0.0, 0.69, 0.90, 0.96)), (math.pi / 2, (2.07, 1.21, 1.13, 1.075))],
)
def test_losses_of_a_tenth_more_and_less_load(phase_rad, times):
    T = SHARES * CONSTANT.total_slip_force_N
    got = under(0.1, phase_rad).energy_at_force_J(T) / CONSTANT.energy_at_force_J(T)
    np.testing.assert_allclose(got, times, atol=0.01)


def test_caps_that_act_on_one_another_are_solved_at_few_loads(monkeypatch):
    rng = np.random.default_rng(11)
    place_m = rng.uniform(0.0, 0.06, (2, 40))
    depth_m = rng.uniform(0.0, 3e-7, 40)
    curve = interacting(np.full(40, 20.0), depth_m, *place_m, 109.89e9)
    asked = []
    withdrawal_m = InteractingCurve.withdrawal_m
    monkeypatch.setattr(
        InteractingCurve,
        "withdrawal_m",
        lambda *given: asked.append(np.size(given[-1])) or withdrawal_m(*given),
    )
    slip = under(0.3, 0.7, slip_curve(curve, 300.0, MU, KAPPA))
    slip.energy_at_force_J(0.2 * slip.total_slip_force_N)
    assert sum(asked) < 3000  # of 70,000
    top_m = float(curve.approach_m(390.0))
    share = np.append(rng.uniform(0.0, 1.0, 200), [0.0, 1e-9, 1e-5, 1.0])
    exact_m = withdrawal_m(curve, top_m, 390.0 * share)
    found_m = slip._withdrawal_m(1.0 - np.cbrt(1.0 - share))
    np.testing.assert_allclose(found_m, exact_m, rtol=1e-6, atol=2e-7 * exact_m[-1])
    rounded_m = np.spacing(top_m)  # both are differences of approaches
    np.testing.assert_allclose(found_m[-3:-1], exact_m[-3:-1], rtol=1e-7, atol=rounded_m)


def test_the_cycles_of_a_curve_are_followed_once_for_all_coefficients(monkeypatch):
    """The interval of an answer asks for those of the joint at unit friction and kappa."""
    followed, cycle = [], VaryingSlip._cycle
    monkeypatch.setattr(
        VaryingSlip, "_cycle", lambda slip, *given: followed.append(1) or cycle(slip, *given)
    )
    curve = families((5, 18), (23.8, 26.7), (0.0, 2.4e-7), 109.89e9)
    oscillates = SlipSettings(normal_amplitude_ratio=0.31, normal_phase_rad=0.7)
    off = 1.0 + 2e-16  # as the load that an approach gives back
    one, other = (
        varying(slip_curve(curve, N, mu, kappa), oscillates)
        for N, mu, kappa in ((460.0, 0.2, 1.2), (460.0 * off, 1.0, 1.0))
    )
    force_N = np.geomspace(1e-3, 0.99, 20) * one.total_slip_force_N
    delta_m, energy_J = one.displacement_m(force_N), one.energy_at_force_J(force_N)
    n_followed = len(followed)
    assert n_followed > 0
    np.testing.assert_allclose(other.displacement_m(5.0 * force_N), delta_m / 0.24, rtol=1e-12)
    loss_J = energy_J / (0.2**2 * 1.2)
    np.testing.assert_allclose(other.energy_at_force_J(5.0 * force_N), loss_J, rtol=1e-11)
    assert len(followed) == n_followed
    more = varying(slip_curve(curve, 500.0, 0.2, 1.2), oscillates)
    assert (more.displacement_m(force_N) < delta_m).all()
    assert len(followed) > n_followed


@pytest.mark.long
def test_the_model_and_its_error_are_those_of_the_constant_load():
    face = load_surface(FACE)
    still, moved = (
        analyze_once(face, load_settings(overrides=more)).contact
        for more in ((), ("slip.normal_amplitude_ratio=0.1",))
    )
    assert moved.model == still.model == "interacting"
    assert moved.estimated_error == pytest.approx(still.estimated_error, rel=1e-9)


def test_an_analysis_answers_for_the_oscillating_load():
    given = {"m": 5, "n": 18, "radius_G_m": 23.8, "radius_P_m": 26.7, "h_m": 2.4e-7}
    chosen = (*(f"families.{name}={value}" for name, value in given.items()),)
    still, moved = (
        analyze_families(load_settings(overrides=(*chosen, *more)))
        for more in ((), ("slip.normal_amplitude_ratio=0.1", "slip.normal_phase_rad=1.5707963"))
    )
    assert moved.answer.energy_J / still.answer.energy_J == pytest.approx(1.21, abs=0.02)
    assert moved.answer.slip_force_N == pytest.approx(
        0.995**0.5 * still.answer.slip_force_N, rel=1e-2
    )
    names = [{one["name"] for one in each.summary()["assumed"]} for each in (still, moved)]
    assert names[0] - names[1] == {"normal load"}
    assert moved.damping.loss_factor[0] > still.damping.loss_factor[0]


def test_a_face_that_yields_has_felt_the_greatest_load_of_the_cycle():
    given = {"m": 5, "n": 18, "radius_G_m": 23.8, "radius_P_m": 26.7, "h_m": 2.4e-7}
    chosen = (*(f"families.{name}={value}" for name, value in given.items()),)
    chosen += ("material.hardness_Pa=5e6",)
    varied, once, less = (
        analyze_families(load_settings(overrides=(*chosen, *more)))
        for more in (
            ("contact.preload_N=460", "slip.normal_amplitude_ratio=0.5"),
            ("contact.preload_N=690",),
            ("contact.preload_N=460",),
        )
    )
    approach_m = np.linspace(0.7, 1.0, 5) * varied.slip.approach_m
    got, expected, other = (one.slip.curve.load_N(approach_m) for one in (varied, once, less))
    np.testing.assert_allclose(got, expected, rtol=1e-9)
    assert (np.abs(other / got - 1) > 0.01).any()


class OfMetal:
    """The unloading of a round contact with the pressures of metal, by Abel's integral."""

    def __init__(self, over_hardness, load_N, a_m):
        self.greatest_N = load_N
        self.withdrawn_m, self.drop_N, _ = metal_unloading(over_hardness, load_N, a_m)

    def approach_m(self, load_N):
        return self.withdrawn_m[-1] - self.withdrawal_m(0.0, self.greatest_N - load_N)

    def withdrawal_m(self, _, load_drop_N):
        return np.interp(load_drop_N, self.drop_N, self.withdrawn_m)


@pytest.mark.long
@pytest.mark.parametrize("over", [1.0, 2.0, 4.0])
def test_a_sphere_that_yields_loses_under_an_oscillating_load_what_finite_elements_say(over):
    """In phase as well it may lose more than as it was first loaded: a flat has let go of its edge.

    The greatest load of a cycle made the contact, and slip goes on where the mean has left it.
    """
    hardness, T = 1e9, MU * SHARES[1:]
    greatest_N = (over * hardness) ** 3 * np.pi**3 * R_M**2 / (6.0 * E**2)
    face = sphere(1e-5, 48, (3e-6, 0.0))
    curve = boundary_elements(face, E, preload_N=greatest_N, hardness_Pa=hardness)
    a_m = math.sqrt(curve.unloading(greatest_N).contact_area_m2 / math.pi)
    metal, solved = OfMetal(over, greatest_N, a_m), replace(curve, as_solved=True)
    wide = OfMetal(over, greatest_N, a_m * math.exp(curve.law(greatest_N).stiffness))
    first = OfMetal(over, greatest_N / 1.1, a_m / math.sqrt(1.1))
    for ratio, phase_rad in ((0.02, 0.0), (0.1, 0.0), (0.1, math.pi / 2), (0.2, 0.5)):
        N = greatest_N / (1.0 + ratio)
        got_J, known_J, answered_J, wide_J = (
            VaryingSlip(one, N, 0.0, MU, KAPPA, ratio, phase_rad).energy_at_force_J(T * N)
            for one in (solved, metal, curve, wide)
        )
        np.testing.assert_allclose(got_J[0], known_J[0], rtol=0.05)
        np.testing.assert_allclose(got_J[1:], known_J[1:], rtol=0.02)
        # Of contacts as wide as metal has them; where pixels resolve little it is told otherwise
        np.testing.assert_allclose(answered_J[1:], wide_J[1:], rtol=0.03)
    N = greatest_N / 1.1
    moved, still = (
        float(VaryingSlip(one, N, 0.0, MU, KAPPA, ratio, 0.0).energy_at_force_J(0.25 * MU * N))
        for one, ratio in ((metal, 0.1), (first, 1e-9))
    )
    assert (moved > still) == (over > 3.0)


def test_bad_settings_are_named():
    with pytest.raises(SettingsError, match="normal_amplitude_ratio"):
        load_settings(overrides=("slip.normal_amplitude_ratio=1.0",))
    with pytest.raises(SettingsError, match="constant normal load"):
        jenkins(under(0.1))
    with pytest.raises(SettingsError, match="force_N"):
        under(0.1).energy_at_force_J(-1.0)
