"""Comparison with a measurement: shares, misfit and identification on curves of known truth."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from capslip.compare.comparison import _bands, compare
from capslip.compare.identification import _bound, _Search, friction_and_preload
from capslip.compare.measurement import Measurement
from capslip.compare.model import STEP_OF_A_MAP, TRIALS_OF_A_MAP, JointModel
from capslip.compare.uncertainty import holding, of_least_squares
from capslip.contact.models.families import families
from capslip.contact.slip import slip_curve
from capslip.errors import ContactError, SettingsError
from capslip.settings import SlipSettings
from capslip.structure.response import response

KAPPA, K_M, K_S, JOINTS = 1.2142857, 1.8e8, 9.9e7, 2
MU, PRELOAD_N, NOISE = 0.2, 460.0, 0.05
TWO = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
ONE = families(5, 23.8, 0, 109.89e9)


def joints(curve):
    return joints_of(lambda preload_N: curve)


def joints_of(curve):
    return JointModel(curve, KAPPA, K_M, K_S, JOINTS)


class Everywhere(JointModel):
    """Has a coarse curve at every preload."""

    def unit_curve(self, preload_N, points=800):
        if points == 800:
            return super().unit_curve(preload_N, points)
        return joints(TWO).unit_curve(preload_N, points)


class Remembering(JointModel):
    """Keeps the curves that every search looks at."""

    @lru_cache(maxsize=1000)  # noqa: B019
    def unit_curve(self, preload_N, points=800):
        return super().unit_curve(preload_N, points)


def noisy(model, amplitude_m, seed, added=0.0):
    noise = np.exp(NOISE * np.random.default_rng(seed).standard_normal(len(amplitude_m)))
    return Measurement(amplitude_m, model.loss_factor(amplitude_m, MU, PRELOAD_N) * noise + added)


@pytest.fixture(scope="module")
def model():
    return Remembering(lambda preload_N: TWO, KAPPA, K_M, K_S, JOINTS)


@pytest.fixture
def gross_m(model):
    return model.gross_slip_amplitude_m(MU, PRELOAD_N)


@pytest.mark.parametrize("curve", [ONE, TWO], ids=["one", "two"])
@pytest.mark.parametrize(("mu", "preload_N"), [(0.2, 460.0), (0.07, 900.0)])
def test_model_is_the_response_over_the_total_amplitude(curve, mu, preload_N):
    model = joints(curve)
    slip = slip_curve(curve, preload_N, mu, KAPPA)
    v_m = np.geomspace(1e-6, 1, 301) * slip.total_slip_force_N / K_S
    direct = response(slip, K_M, K_S, JOINTS, v_m)
    expected = direct.loss_factor * direct.frequency_ratio**2
    got = model.loss_factor(direct.total_amplitude_m, mu, preload_N)
    np.testing.assert_allclose(got, expected, rtol=5e-3)
    assert np.median(np.abs(got / expected - 1)) < 1e-6
    gross_m = model.gross_slip_amplitude_m(mu, preload_N)
    assert gross_m == pytest.approx(direct.total_amplitude_m[-1], rel=1e-12)
    assert np.isnan(model.loss_factor(np.array([1.001 * gross_m]), mu, preload_N)).all()


def test_loss_over_total_amplitude_is_the_area_of_the_loop(model):
    # W / (2 pi F v_total / 2) with F = K_m v, written out
    slip = slip_curve(TWO, PRELOAD_N, MU, KAPPA)
    v_m = 4e-7
    T_N = K_S * v_m
    total_m = v_m + JOINTS * K_S / K_M * float(slip.displacement_m(T_N))
    lost_J = JOINTS * float(slip.energy_at_force_J(T_N))
    expected = lost_J / (np.pi * K_M * v_m * total_m)
    got = model.loss_factor(np.array([total_m]), MU, PRELOAD_N)[0]
    assert got == pytest.approx(expected, rel=1e-4)


def test_plane_interface_loses_nothing_below_gross_slip(model, gross_m):
    plane = model.plane()
    v_m = np.geomspace(1e-3, 0.9, 9) * MU * PRELOAD_N / K_S
    assert (plane.loss_factor(v_m, MU, PRELOAD_N) == 0).all()
    assert plane.gross_slip_amplitude_m(MU, PRELOAD_N) == pytest.approx(MU * PRELOAD_N / K_S)
    assert plane.gross_slip_amplitude_m(MU, PRELOAD_N) < gross_m


def test_perfect_data_have_no_misfit(model, gross_m):
    v_m = np.geomspace(1e-2, 0.9, 30) * gross_m
    found = compare(Measurement(v_m, model.loss_factor(v_m, MU, PRELOAD_N)), model, MU, PRELOAD_N)
    assert [band.points for band in found.bands] == [10, 10, 10]
    assert all(band.rms_log_ratio < 1e-12 for band in found.bands)
    assert any("no monolithic beam" in remark for remark in found.remarks)
    assert found.identified is None


@pytest.mark.parametrize("mu", [MU, 0.07])
def test_exact_data_of_the_model_have_the_energy_that_its_joints_lose(model, mu):
    """The joints move, so that the force is less than K_m times the amplitude that is seen."""
    slip = slip_curve(TWO, PRELOAD_N, mu, KAPPA)
    direct = response(slip, K_M, K_S, JOINTS, np.geomspace(1e-6, 1, 60) * mu * PRELOAD_N / K_S)
    v_m, eta = direct.total_amplitude_m, direct.loss_factor * direct.frequency_ratio**2
    found = compare(Measurement(v_m, eta), model, mu, PRELOAD_N)
    np.testing.assert_allclose(found.joint_energy_J, direct.energy_J, rtol=1e-4)
    assert v_m[-1] > 1.05 * direct.amplitude_m[-1]  # else it would be no matter


def test_beyond_gross_slip_no_energy_is_known(model, gross_m):
    """Nothing says there with which force the joints move."""
    v_m = np.array([0.5, 0.99, 1.01, 2.0]) * gross_m
    found = compare(Measurement(v_m, np.full(4, 1e-2)), model, MU, PRELOAD_N)
    assert np.isfinite(found.joint_energy_J).tolist() == [True, True, False, False]


def test_misfit_by_band_counts_factor_and_scatter(model, gross_m):
    v_m = np.geomspace(1e-2, 0.9, 30) * gross_m
    factor = np.repeat([2.0, 1.0, 0.5], 10)
    measured = Measurement(v_m, model.loss_factor(v_m, MU, PRELOAD_N) / factor)
    found = compare(measured, model, MU, PRELOAD_N)
    biases = [band.bias_log_ratio for band in found.bands]
    np.testing.assert_allclose(biases, np.log([2.0, 1.0, 0.5]), atol=1e-9)
    np.testing.assert_allclose([band.rms_log_ratio for band in found.bands], np.abs(biases))


def test_misfit_by_band_tells_scatter_from_bias(model, gross_m):
    # thirds of three decades: their borders belong to the greater amplitudes
    v_m = np.array([1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0]) * 9e-4 * gross_m
    factor = np.array([2.0, 0.5, 2.0, 2.0, 4.0, 1.0, 1.0])
    measured = Measurement(v_m, model.loss_factor(v_m, MU, PRELOAD_N) / factor)
    found = compare(measured, model, MU, PRELOAD_N)
    assert [band.points for band in found.bands] == [2, 2, 3]
    ln2 = np.log(2.0)
    biases = [band.bias_log_ratio for band in found.bands]
    np.testing.assert_allclose(biases, [0.0, ln2, 2 * ln2 / 3], atol=1e-9)
    rms = [band.rms_log_ratio for band in found.bands]
    np.testing.assert_allclose(rms, [ln2, ln2, 2 * ln2 / np.sqrt(3)], rtol=1e-9)


def test_an_amplitude_between_two_bands_counts_with_the_greater():
    v_m = np.array([1.0, 2.0, 4.0, 8.0])
    np.testing.assert_array_equal(np.geomspace(1.0, 8.0, 4), v_m)
    assert [band.points for band in _bands(v_m, np.ones(4))] == [1, 1, 2]


def test_gross_slip_itself_has_a_loss_factor(model):
    for mu in np.linspace(0.05, 0.9, 60):
        gross_m = model.gross_slip_amplitude_m(mu, PRELOAD_N)
        assert np.isfinite(model.loss_factor(np.array([gross_m]), mu, PRELOAD_N)).all()


def test_intrinsic_loss_is_subtracted_inside_its_range_alone(model, gross_m):
    v_m = np.geomspace(1e-2, 0.9, 20) * gross_m
    joint = model.loss_factor(v_m, MU, PRELOAD_N)
    slope = 2e-4
    line = 1e-3 + slope * np.log(v_m)  # straight over ln v, as the interpolation supposes
    line -= line.min() - 1e-3
    monolithic = Measurement(v_m[[3, 9, 15]], line[[3, 9, 15]])
    found = compare(Measurement(v_m, joint + line), model, MU, PRELOAD_N, monolithic)
    inside = slice(3, 16)
    np.testing.assert_allclose(found.joint_loss_factor[inside], joint[inside], rtol=1e-9)
    assert np.isnan(found.joint_loss_factor[[0, 1, 2, 16, 17, 18, 19]]).all()
    assert sum(band.points for band in found.bands) == 13
    assert any("7 of 20 points" in r and "not extrapolated" in r for r in found.remarks)


def test_points_without_a_share_of_the_joints_are_left_out_and_said(model, gross_m):
    v_m = np.geomspace(1e-2, 0.9, 20) * gross_m
    # one point loses exactly as much, three lose less
    measured = Measurement(v_m, np.where(np.arange(20) < 4, [1e-3] + 19 * [1e-4], 1e-2))
    monolithic = Measurement(v_m[[0, -1]], np.array([1e-3, 1e-3]))
    found = compare(measured, model, MU, PRELOAD_N, monolithic)
    assert np.isnan(found.joint_loss_factor[:4]).all()
    assert np.isnan(found.joint_energy_J[:4]).all()
    assert any("4 of 20 points lose no more" in remark for remark in found.remarks)


def test_points_beyond_gross_slip_are_said(model, gross_m):
    v_m = np.geomspace(0.1, 2.0, 20) * gross_m
    found = compare(Measurement(v_m, np.full(20, 0.01)), model, MU, PRELOAD_N)
    beyond = int((v_m > gross_m).sum())
    assert np.isnan(found.model_loss_factor).sum() == beyond
    assert any(f"{beyond} of 20 points lie beyond gross slip" in r for r in found.remarks)


def test_points_without_a_share_are_not_counted_beyond_gross_slip(model, gross_m):
    v_m = np.array([0.5, 0.8, 1.2, 1.5]) * gross_m
    monolithic = Measurement(v_m[:3], np.full(3, 1e-4))
    found = compare(Measurement(v_m, np.full(4, 0.01)), model, MU, PRELOAD_N, monolithic)
    assert any("1 of 4 points lie beyond gross slip" in remark for remark in found.remarks)
    assert any("1 of 4 points lie outside" in remark for remark in found.remarks)


def test_curves_are_those_of_the_model_of_the_plane_and_of_the_monolithic_beam(model, gross_m):
    v_m = np.geomspace(1e-2, 0.9, 20) * gross_m
    monolithic = Measurement(v_m[[0, 9]], np.array([1e-3, 3e-3]))
    found = compare(Measurement(v_m, np.full(20, 0.01)), model, MU, PRELOAD_N, monolithic)
    at_m = found.curve_amplitude_m
    np.testing.assert_allclose(at_m[[0, -1]], v_m[[0, -1]], rtol=1e-12)
    np.testing.assert_array_equal(found.curve_model, model.loss_factor(at_m, MU, PRELOAD_N))
    np.testing.assert_array_equal(found.curve_plane[at_m < MU * PRELOAD_N / K_S], 0.0)
    inside = (at_m > v_m[0]) & (at_m < v_m[9])
    share = np.log(at_m / v_m[0]) / np.log(v_m[9] / v_m[0])
    np.testing.assert_allclose(found.curve_intrinsic[inside], (1e-3 + 2e-3 * share)[inside])
    assert np.isnan(found.curve_intrinsic[at_m > v_m[9]]).all()
    assert (
        compare(Measurement(v_m, np.full(20, 0.01)), model, MU, PRELOAD_N).curve_intrinsic == 0
    ).all()


@pytest.mark.long
def test_truth_lies_inside_the_error_bars(model, gross_m):
    v_m = np.geomspace(0.02, 0.95, 25) * gross_m
    off = []
    for seed in range(20):
        # started from values that are wrong by a lot
        found = compare(noisy(model, v_m, seed), model, 0.35, 700.0, identify=True).identified
        assert found.distinguishable
        assert found.at_bound is None
        assert found.rms_log_ratio < 2 * NOISE
        off.append(
            (
                np.log(found.friction_coefficient / MU) / found.friction_coefficient_log_std,
                np.log(found.preload_N / PRELOAD_N) / found.preload_log_std,
            )
        )
    inside = (np.abs(off) < 2).mean(axis=0)
    assert (inside >= 0.9).all()
    # and the bars are not simply wide
    assert (np.std(off, axis=0) > 0.6).all()


@pytest.mark.long
def test_uncertainty_is_the_spread_over_repeated_measurements(model, gross_m):
    v_m = np.geomspace(0.3, 0.9, 15) * gross_m
    fits = [
        compare(noisy(model, v_m, seed), model, MU, PRELOAD_N, identify=True).identified
        for seed in range(12)
    ]
    spread = np.std([np.log(fit.friction_coefficient) for fit in fits])
    claimed = np.mean([fit.friction_coefficient_log_std for fit in fits])
    assert 0.6 < spread / claimed < 1.6


@pytest.mark.long
def test_monolithic_share_does_not_bias_the_identification(model, gross_m):
    v_m = np.geomspace(0.05, 0.95, 25) * gross_m
    monolithic = Measurement(v_m[[0, -1]] * [0.9, 1.1], np.array([2e-3, 2e-3]))
    measured = noisy(model, v_m, 7, added=2e-3)
    found = compare(measured, model, MU, PRELOAD_N, monolithic, identify=True).identified
    alone = compare(noisy(model, v_m, 7), model, MU, PRELOAD_N, identify=True).identified
    assert found.friction_coefficient == pytest.approx(alone.friction_coefficient, rel=1e-4)
    assert found.preload_N == pytest.approx(alone.preload_N, rel=1e-4)


def test_one_family_at_small_amplitudes_tells_one_combination():
    # eta = C v / (mu N0^(4/3)) there: delta_lim goes with mu N0^(2/3), T with delta N0^(1/3).
    # A tenth of the shear, so that the compliance of the joint adds no second dependence on N0.
    model = replace(joints(ONE), joint_stiffness_N_per_m=K_S / 10)
    gross_m = model.gross_slip_amplitude_m(MU, PRELOAD_N)
    v_m = np.geomspace(1e-4, 1e-2, 25) * gross_m
    found = compare(noisy(model, v_m, 3), model, MU, PRELOAD_N, identify=True)
    fit = found.identified
    assert not fit.distinguishable
    assert abs(fit.correlation) > 0.98
    assert fit.exponent == pytest.approx(4 / 3, rel=0.02)
    got = np.log(fit.friction_coefficient / MU) + 4 / 3 * np.log(fit.preload_N / PRELOAD_N)
    assert abs(got) < 0.05
    assert fit.exponent_log_std < 2 * NOISE
    assert fit.preload_log_std > 10 * fit.exponent_log_std
    assert any("cannot tell" in remark for remark in found.remarks)


def test_a_curve_that_the_model_cannot_reach_ends_at_a_bound(model, gross_m):
    v_m = np.geomspace(0.05, 0.9, 12) * gross_m
    measured = Measurement(v_m, 1e-9 * np.ones(12))
    found = compare(measured, model, MU, PRELOAD_N, identify=True)
    assert found.identified.at_bound is not None
    assert any("do not hold" in remark for remark in found.remarks)


def test_uncertainty_is_that_of_linear_least_squares():
    jacobian = np.random.default_rng(5).normal(size=(9, 2)) * [3.0, 0.5]
    covariance = 0.7 / (9 - 2) * np.linalg.inv(jacobian.T @ jacobian)
    found, condition = of_least_squares(jacobian, 0.7)
    log_std, correlation, exponent = found.log_std[:2], found.correlation, found.exponent
    np.testing.assert_allclose(log_std, np.sqrt(np.diag(covariance)), rtol=1e-12)
    assert correlation == pytest.approx(covariance[0, 1] / log_std.prod(), rel=1e-12)
    assert condition == pytest.approx(np.linalg.cond(jacobian), rel=1e-12)
    # of all ln mu + p ln N0 the one with the least variance
    variance = [
        np.array([1.0, p]) @ covariance @ [1.0, p] for p in exponent + np.array([0.0, -1e-3, 1e-3])
    ]
    assert variance[0] < min(variance[1:])
    assert variance[0] == pytest.approx(covariance[0, 0] * (1 - correlation**2), rel=1e-9)
    assert variance[0] == pytest.approx(found.log_std[2] ** 2, rel=1e-9)


def test_what_is_identified_has_the_misfit_that_is_given(model, gross_m):
    v_m = np.geomspace(0.1, 0.95, 5) * gross_m  # as few points as are taken
    measured = noisy(model, v_m, 1)
    found = compare(measured, model, MU, PRELOAD_N, identify=True)
    fit = found.identified
    best = model.loss_factor(v_m, fit.friction_coefficient, fit.preload_N)
    misfit = np.log(best / measured.loss_factor)
    assert fit.rms_log_ratio == pytest.approx(np.sqrt(np.mean(misfit**2)), rel=1e-6)
    assert fit.points == 5
    at_m = found.curve_amplitude_m
    expected = model.loss_factor(at_m, fit.friction_coefficient, fit.preload_N)
    np.testing.assert_array_equal(found.curve_identified, expected)


def test_correlated_values_are_not_told_apart_whatever_the_condition_number():
    model = joints(ONE)
    v_m = np.geomspace(0.01, 0.8, 25) * model.gross_slip_amplitude_m(MU, PRELOAD_N)
    fit = compare(noisy(model, v_m, 3), model, MU, PRELOAD_N, identify=True).identified
    assert abs(fit.correlation) > 0.98
    assert fit.condition_number < 100
    assert not fit.distinguishable


@pytest.mark.parametrize(
    ("x", "words"),
    [
        ((1.0, 5.0), None),
        ((0.0, 5.0), "greatest amplitude"),
        ((10.0, 5.0), "far above"),
        ((1.0, 3.0), "preload"),
        ((1.0, 7.0), "preload"),
    ],
)
def test_bounds_are_named(x, words):
    found = _bound(np.array(x), np.array([[0.0, 3.0], [10.0, 7.0]]))
    assert found is None if words is None else words in found


@pytest.mark.parametrize(("most_N", "reached"), [(600.0, True), (400.0, False)])
def test_the_search_ends_where_the_caps_carry_no_more(most_N, reached):
    def curve(preload_N):
        if preload_N > most_N:
            raise ContactError("too much")
        return ONE

    v_m = np.geomspace(0.02, 0.95, 25) * joints(ONE).gross_slip_amplitude_m(MU, PRELOAD_N)
    measured = noisy(joints(ONE), v_m, 0)
    model = JointModel(curve, KAPPA, K_M, K_S, JOINTS)
    found = compare(measured, model, MU, 200.0, identify=True).identified
    assert (found.at_bound is None) == reached
    if reached:
        assert abs(np.log(found.preload_N / PRELOAD_N)) < 3 * found.preload_log_std
    else:
        assert 0.96 * most_N < found.preload_N <= most_N
    with pytest.raises(ContactError):
        compare(measured, model, MU, 2 * most_N, identify=True)


def failing(from_N, to_N):
    def curve(preload_N):
        if from_N < preload_N < to_N:
            raise ContactError("no level")
        return ONE

    return JointModel(curve, KAPPA, K_M, K_S, JOINTS)


@pytest.mark.parametrize(
    ("fails_N", "reached"), [((0.0, 300.0), True), ((0.0, 600.0), False), ((500.0, 600.0), False)]
)
def test_the_search_ends_where_the_caps_find_no_level_under_less(fails_N, reached):
    v_m = np.geomspace(0.02, 0.95, 25) * joints(ONE).gross_slip_amplitude_m(MU, PRELOAD_N)
    measured, model = noisy(joints(ONE), v_m, 0), failing(*fails_N)
    found = compare(measured, model, MU, 900.0, identify=True).identified
    assert (found.at_bound is None) == reached
    if reached:
        assert abs(np.log(found.preload_N / PRELOAD_N)) < 3 * found.preload_log_std
    else:
        assert fails_N[1] <= found.preload_N < 1.04 * fails_N[1]


def rough_curve(preload_N):
    """Return a curve whose radii jump from one preload to the next, as on a map."""
    jump = np.exp(0.02 * np.random.default_rng(int(1e6 * preload_N)).standard_normal(2))
    return families((5, 18), (23.8 * jump[0], 26.7 * jump[1]), (0, 1e-7), 109.89e9)


@pytest.mark.long
def test_uncertainty_holds_the_truth_where_the_curve_jumps_with_the_preload():
    model = JointModel(rough_curve, KAPPA, K_M, K_S, JOINTS, trials=24, step=2e-2, is_rough=True)
    off, log_std = [], []
    for N in (200.0, 250.0, 300.0, 400.0, 630.0, 1000.0):
        v_m = np.geomspace(0.05, 0.95, 15) * model.gross_slip_amplitude_m(0.3, N)
        measured = Measurement(v_m, model.loss_factor(v_m, 0.3, N))
        one = compare(measured, model, MU, PRELOAD_N, identify=True).identified
        off.append(np.log([one.friction_coefficient / 0.3, one.preload_N / N]))
        log_std.append([one.friction_coefficient_log_std, one.preload_log_std])
        assert one.at_bound is None
        assert one.exponent_log_std <= 1.01 * max(log_std[-1])
    off = np.array(off) / log_std
    assert (np.abs(off) < 2.5).all()
    assert (np.abs(off) > 0.8).any(axis=0).all()  # and the bars are not simply wide


def alike_at_powers_of_two(preload_N):
    """Return a face that at twice the preload and half the friction does what it did.

    Forces and approaches go with the preload there: R by its inverse, h in proportion. In between
    the second family lies lower than that.
    """
    by = preload_N / PRELOAD_N
    h_m = 2.4e-7 * by * (1.0 + 0.2 * abs(np.sin(np.pi * np.log2(by))))
    return families((5, 18), (23.8 / by, 26.7 / by), (0, h_m), 109.89e9)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_uncertainty_holds_other_preloads_that_fit_as_well(seed):
    model = joints_of(alike_at_powers_of_two)
    v_m = np.geomspace(0.05, 0.95, 25) * model.gross_slip_amplitude_m(MU, PRELOAD_N)
    measured = noisy(model, v_m, seed)
    at_twice = model.loss_factor(v_m, MU / 2, 2 * PRELOAD_N)
    np.testing.assert_allclose(at_twice, model.loss_factor(v_m, MU, PRELOAD_N), rtol=1e-6)
    found = compare(measured, model, MU, 700.0, identify=True)
    fit = found.identified
    # each of these is as much the truth as the others
    for power in (-1, 0, 1, 2):
        mu, N0 = MU / 2.0**power, PRELOAD_N * 2.0**power
        assert abs(np.log(fit.friction_coefficient / mu)) < 2 * fit.friction_coefficient_log_std
        assert abs(np.log(fit.preload_N / N0)) < 2 * fit.preload_log_std
        assert fit.alike_N[0] < 1.01 * N0
        assert fit.alike_N[1] > 0.99 * N0
    # all share mu N0, and the data fix that
    assert fit.exponent == pytest.approx(1.0, abs=0.01)
    got = np.log(fit.friction_coefficient * fit.preload_N / (MU * PRELOAD_N))
    assert abs(got) < 3 * fit.exponent_log_std
    assert fit.exponent_log_std < NOISE
    assert not fit.distinguishable
    assert any("other preloads from" in remark for remark in found.remarks)


def test_one_valley_is_as_wide_as_least_squares_have_it():
    """Of a parabola every preload that was tried is as far away as it fits less well."""
    jacobian = np.random.default_rng(6).normal(size=(12, 2)) * [3.0, 0.5]
    of_points, _ = of_least_squares(jacobian, 0.7)
    log_N0 = np.linspace(-3, 3, 13) * of_points.log_std[1]
    log_mu = of_points.correlation * of_points.log_std[0] / of_points.log_std[1] * log_N0
    apart = np.column_stack([log_mu, log_N0])
    k = np.linalg.norm(apart @ jacobian.T, axis=1) / np.sqrt(0.7 / 10)
    held, wider = holding(of_points, apart / np.maximum(k, 1.0)[:, None], np.zeros((2, 2)))
    np.testing.assert_allclose(held.log_std, of_points.log_std, rtol=1e-9)
    assert held.correlation == of_points.correlation
    assert not wider


@pytest.mark.parametrize("slope", [-1.0, -0.3, 0.4])
def test_others_that_fit_as_well_tell_how_friction_and_preload_go_together(slope):
    """Along one line ln mu = slope ln N0, which is far longer than the points leave beside it."""
    jacobian = np.random.default_rng(7).normal(size=(12, 2)) * 1e3
    of_points, condition = of_least_squares(jacobian, 1.0)
    assert condition == pytest.approx(np.linalg.cond(jacobian))
    apart = np.outer([-2.0, -1.0, 0.5, 1.0], [slope, 1.0])
    found, wider = holding(of_points, apart, np.zeros((2, 2)))
    assert wider
    np.testing.assert_allclose(found.log_std[:2], [abs(2.0 * slope), 2.0], rtol=1e-3)
    assert found.log_std[2] < 1e-2
    assert found.exponent == pytest.approx(-slope)
    assert found.correlation == pytest.approx(np.sign(slope), abs=1e-3)


def test_the_preload_that_was_given_is_among_those_that_are_tried():
    """Of a map that pixels decide all others may be off, though one step away."""

    def curve(preload_N):
        return ONE if np.isclose(preload_N, PRELOAD_N, rtol=1e-9) else rough_curve(preload_N)

    of_a_map = {"trials": TRIALS_OF_A_MAP, "step": STEP_OF_A_MAP, "is_rough": True}
    model = JointModel(curve, KAPPA, K_M, K_S, JOINTS, **of_a_map)
    v_m = np.geomspace(0.05, 0.95, 15) * model.gross_slip_amplitude_m(0.3, PRELOAD_N)
    measured = Measurement(v_m, model.loss_factor(v_m, 0.3, PRELOAD_N))
    found = compare(measured, model, MU, PRELOAD_N, identify=True).identified
    assert found.preload_N == pytest.approx(PRELOAD_N, rel=1e-9)
    assert found.friction_coefficient == pytest.approx(0.3, rel=1e-3)
    assert found.rms_log_ratio < 1e-3


def test_one_preload_of_many_that_finds_no_level_does_not_end_the_search():
    failed = []

    def curve(preload_N):
        if preload_N != PRELOAD_N and int(1e6 * preload_N) % 9 == 0:
            failed.append(preload_N)
            raise ContactError("no level")
        return TWO

    model = JointModel(curve, KAPPA, K_M, K_S, JOINTS, trials=0, step=2e-2, is_rough=True)
    v_m = np.geomspace(0.05, 0.95, 15) * joints(TWO).gross_slip_amplitude_m(MU, PRELOAD_N)
    measured = Measurement(v_m, joints(TWO).loss_factor(v_m, MU, PRELOAD_N))
    bounds = np.array([[0.0, np.log(200.0)], [10.0, np.log(900.0)]])
    search = _Search(v_m, measured.loss_factor, model, bounds)
    x = search.scanned(np.log([350.0, 500.0]), 0.2)
    search.near(x)
    assert failed
    assert np.exp(x[1]) == pytest.approx(PRELOAD_N, rel=0.01)


@pytest.mark.parametrize("one_of", [3, 7, 9])
def test_preloads_that_find_no_level_do_not_end_a_search_along_slopes(one_of):
    failed = []

    def curve(preload_N):
        if preload_N != PRELOAD_N and int(1e6 * preload_N) % one_of == 0:
            failed.append(preload_N)
            raise ContactError("no level")
        return TWO

    v_m = np.geomspace(0.05, 0.95, 15) * joints(TWO).gross_slip_amplitude_m(MU, PRELOAD_N)
    measured = Measurement(v_m, joints(TWO).loss_factor(v_m, MU, PRELOAD_N))
    # every preload that is looked over has an answer, so that only the search meets one without
    coarse = Everywhere(curve, KAPPA, K_M, K_S, JOINTS)
    found = compare(measured, coarse, MU, PRELOAD_N, identify=True).identified
    assert failed
    assert found.at_bound is None
    assert found.preload_N == pytest.approx(PRELOAD_N, rel=1e-3)
    assert found.friction_coefficient == pytest.approx(MU, rel=1e-3)
    search = (np.array([0.2, np.log(PRELOAD_N)]), np.array([[0.0, np.log(200.0)], [10.0, 7.0]]))
    of_some = _Search(v_m, measured.loss_factor, joints_of(curve), search[1]).slopes(search[0])
    of_all = _Search(v_m, measured.loss_factor, joints(TWO), search[1]).slopes(search[0])
    np.testing.assert_allclose(of_some, of_all, rtol=2e-2)  # differences over other steps


def test_a_face_that_carries_no_preload_from_which_to_begin_is_said_in_one_line():
    asked = []

    class Later(Everywhere):
        def unit_curve(self, preload_N, points=800):
            asked.append(points)
            if points == 800 and 100 in asked:
                raise ContactError("no level")
            return super().unit_curve(preload_N, points)

    v_m = np.geomspace(0.05, 0.95, 15) * joints(TWO).gross_slip_amplitude_m(MU, PRELOAD_N)
    measured = Measurement(v_m, joints(TWO).loss_factor(v_m, MU, PRELOAD_N))
    model = Later(lambda preload_N: TWO, KAPPA, K_M, K_S, JOINTS)
    with pytest.raises(ContactError, match="carries none of the 2 preloads from which to begin"):
        friction_and_preload(v_m, measured.loss_factor, model, PRELOAD_N)


def test_too_few_points_are_refused(model):
    measured = Measurement(np.array([1e-7, 2e-7, 4e-7]), np.array([1e-3, 2e-3, 3e-3]))
    with pytest.raises(SettingsError, match="3 points"):
        compare(measured, model, MU, PRELOAD_N, identify=True)


def of_pixels(model, share):
    """Return the model with a least share of mu N that goes with the preload, as of pixels."""
    return replace(model, least_share=lambda preload_N: share * (preload_N / PRELOAD_N) ** 0.1)


@pytest.mark.long
def test_what_the_model_does_not_resolve_is_left_out_of_the_fit(model, gross_m):
    """As if it had not been measured: in what is found, in its uncertainty, and it is said."""
    v_m = np.geomspace(0.01, 0.95, 25) * gross_m
    known = of_pixels(model, 0.1)
    unlike = np.where(v_m < known.resolved_from_m(MU, PRELOAD_N), 2.0, 1.0)
    measured = Measurement(v_m, noisy(model, v_m, 5).loss_factor * unlike)
    found = compare(measured, known, MU, PRELOAD_N, identify=True)
    fit, n = found.identified, found.identified.unresolved
    assert known.resolved_from_m(MU, PRELOAD_N) == pytest.approx(0.1 * gross_m, rel=0.1)
    assert fit.resolved_from_m == known.resolved_from_m(fit.friction_coefficient, fit.preload_N)
    assert v_m[n - 1] < fit.resolved_from_m <= v_m[n]
    assert fit.points == 25 - n
    of_rest = Measurement(v_m[n:], measured.loss_factor[n:])
    alone = compare(of_rest, model, MU, PRELOAD_N, identify=True).identified
    assert fit == replace(alone, unresolved=n, resolved_from_m=fit.resolved_from_m)
    assert abs(np.log(fit.friction_coefficient / MU)) < 3 * fit.friction_coefficient_log_std
    assert any(f"{n} of 25 points lie below" in one for one in found.remarks)
    of_all = compare(measured, model, MU, PRELOAD_N, identify=True)
    assert of_all.identified.points == 25
    assert of_all.identified.rms_log_ratio > 2 * fit.rms_log_ratio
    assert not any("resolve" in one for one in of_all.remarks)


def test_what_the_model_does_not_resolve_is_left_out_of_the_misfit(model, gross_m):
    v_m = np.geomspace(0.01, 0.95, 25) * gross_m
    known = of_pixels(model, 0.1)
    from_m = known.resolved_from_m(MU, PRELOAD_N)
    wrong = np.where(v_m < from_m, 3.0, 1.0)
    measured = Measurement(v_m, model.loss_factor(v_m, MU, PRELOAD_N) * wrong)
    found, n = compare(measured, known, MU, PRELOAD_N), int((v_m < from_m).sum())
    assert 5 < n < 20
    np.testing.assert_array_equal(found.left_out, v_m < from_m)
    assert sum(band.points for band in found.bands) == 25 - n
    assert all(band.bias_log_ratio in (None, pytest.approx(0, abs=1e-9)) for band in found.bands)
    assert sum(f"{n} of 25 points lie below" in one for one in found.remarks) == 1
    assert not compare(measured, model, MU, PRELOAD_N).left_out.any()


@pytest.mark.long
def test_which_points_are_resolved_is_asked_of_what_is_found(model, gross_m):
    """Those given are wrong here, and leave out too few or too many."""
    v_m = np.geomspace(0.02, 0.6, 25) * gross_m
    for mu, preload_N in ((0.05, 200.0), (MU, PRELOAD_N), (0.8, 1200.0)):
        measured = noisy(model, v_m, 2)
        found = compare(measured, of_pixels(model, 0.1), mu, preload_N, identify=True).identified
        assert found.unresolved == (v_m < found.resolved_from_m).sum() > 0
        assert found.resolved_from_m > 1.2 * 0.1 * v_m[-1]  # it is of gross slip, not of these


@pytest.mark.parametrize("resolved", [5, 4, 0])
def test_fewer_than_five_points_that_are_resolved_are_refused(model, gross_m, resolved):
    known = of_pixels(model, 0.5)
    from_m = known.resolved_from_m(MU, PRELOAD_N)
    v_m = np.append(np.geomspace(0.01, 0.7, 12 - resolved), np.linspace(1.1, 1.9, resolved))
    measured = Measurement(v_m * from_m, model.loss_factor(v_m * from_m, MU, PRELOAD_N))
    if resolved == 5:
        assert compare(measured, known, MU, PRELOAD_N, identify=True).identified.points == 5
        return
    with pytest.raises(SettingsError, match=r"of 12 points lie above .* expected at least 5"):
        compare(measured, known, MU, PRELOAD_N, identify=True)


def test_a_plane_interface_has_no_misfit_and_nothing_to_identify(model, gross_m):
    v_m = np.geomspace(0.05, 0.9, 12) * gross_m
    measured = Measurement(v_m, np.full(12, 1e-3))
    found = compare(measured, model.plane(), MU, PRELOAD_N)
    assert [band.points for band in found.bands] == [0, 0, 0]
    assert any("loses nothing" in remark for remark in found.remarks)
    with pytest.raises(SettingsError, match="loses nothing"):
        compare(measured, model.plane(), MU, PRELOAD_N, identify=True)


def test_points_at_which_the_model_loses_nothing_are_counted(model, gross_m):
    """Under a normal load that oscillates small amplitudes lose nothing, and great ones do."""
    load = SlipSettings(normal_amplitude_ratio=0.3)
    oscillating = JointModel(model.curve, KAPPA, K_M, K_S, JOINTS, normal_load=load)
    v_m = np.geomspace(0.02, 2.0, 40) * gross_m
    known = oscillating.loss_factor(v_m, MU, PRELOAD_N)
    none, some = int((known == 0).sum()), int((known > 0).sum())
    assert min(none, some) >= 5
    monolithic = Measurement(v_m[[0, -2]], np.full(2, 1e-5))  # the last point has no share
    found = compare(Measurement(v_m, np.full(40, 1e-2)), oscillating, MU, PRELOAD_N, monolithic)
    assert sum(band.points for band in found.bands) == some
    remark = next(one for one in found.remarks if "loses nothing" in one)
    assert f"nothing at {none} of {none + some} points below gross slip" in remark
    assert f"of the other {some} alone" in remark
    with pytest.raises(SettingsError, match="nothing at some amplitudes"):
        compare(Measurement(v_m, np.full(40, 1e-2)), oscillating, MU, PRELOAD_N, identify=True)


@pytest.mark.parametrize(
    ("amplitude_m", "loss_factor"),
    [([], []), ([1e-7], [1e-3, 2e-3]), ([0.0], [1e-3]), ([1e-7], [np.nan]), ([1e-7], [-1e-3])],
)
def test_measurements_are_positive_and_paired(amplitude_m, loss_factor):
    with pytest.raises(SettingsError, match="measurement"):
        Measurement(np.array(amplitude_m), np.array(loss_factor))


def test_measurements_are_sorted():
    measured = Measurement(np.array([3e-7, 1e-7]), np.array([3e-3, 1e-3]))
    assert measured.amplitude_m.tolist() == [1e-7, 3e-7]
    assert measured.loss_factor.tolist() == [1e-3, 3e-3]


@pytest.mark.long
@pytest.mark.parametrize(("factor", "missed"), [(30.0, True), (1.5, False)])
def test_points_that_the_model_misses_by_a_factor_identify_nothing(model, gross_m, factor, missed):
    v_m = np.geomspace(0.05, 0.9, 20) * gross_m
    loss_factor = model.loss_factor(v_m, MU, PRELOAD_N)
    wild = loss_factor * factor ** np.resize([1.0, -1.0], 20)  # no curve goes through these
    found = compare(Measurement(v_m, wild), model, MU, PRELOAD_N, identify=True)
    said = [one for one in found.remarks if "nothing is identified" in one]
    assert len(said) == missed
    assert not missed or "by a factor of 30 (rms)" in said[0]
