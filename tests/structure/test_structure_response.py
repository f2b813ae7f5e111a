"""Loss factor and softening of one mode against closed forms and the loop of the structure."""

import numpy as np
import pytest

from capslip.contact.models.families import families
from capslip.contact.models.flat import flat
from capslip.contact.slip import slip_curve
from capslip.errors import SettingsError
from capslip.structure.response import response

K_M, K_S = 1.8e8, 1.0e8


def test_one_contact_in_closed_form(spheres):
    limit_N, limit_m = 92.0, 6e-8
    damping = response(spheres((limit_N, limit_m)), K_M, K_S, 2)
    T = np.minimum(K_S * damping.amplitude_m / limit_N, 1.0)
    q = np.cbrt(1 - T)
    lost_J = 0.8 * limit_N * limit_m * (1 - q) ** 3 * (1 + 3 * q + q**2)
    expected = 2 * lost_J / (np.pi * K_M * damping.amplitude_m**2)
    np.testing.assert_allclose(damping.loss_factor, expected, rtol=1e-6)
    np.testing.assert_array_equal(damping.damping_ratio, damping.loss_factor / 2)
    v_total_m = damping.amplitude_m + 2 * K_S / K_M * limit_m * (1 - q**2)
    np.testing.assert_allclose(damping.total_amplitude_m, v_total_m, rtol=1e-9)
    np.testing.assert_allclose(
        damping.frequency_ratio, np.sqrt(damping.amplitude_m / v_total_m), rtol=1e-9
    )
    # (1 - 5 q^2) near total slip: the loss factor grows up to gross slip.
    assert damping.peak_at_gross_slip
    assert damping.amplitude_at_peak_m == damping.gross_slip_amplitude_m == limit_N / K_S
    assert damping.peak_loss_factor == pytest.approx(
        1.6 * limit_N * limit_m / (np.pi * K_M * (limit_N / K_S) ** 2), rel=1e-12
    )


@pytest.mark.parametrize("joints", [1, 2, 5])
@pytest.mark.parametrize("share", [0.1, 0.6, 1.0])
def test_loop_of_the_structure_loses_what_the_joints_lose(slip, joints, share):
    v_m = share * slip.total_slip_force_N / K_S
    damping = response(slip, K_M, K_S, joints, [v_m])
    F_N = K_M * v_m
    # Masing: the unloading branch is the first loading, twice as large.
    phi = np.linspace(0, np.pi, 4001)
    swing_N = F_N * (1 - np.cos(phi)) / 2  # half of the force withdrawn so far
    first_m = swing_N / K_M + joints * K_S / K_M * slip.displacement_m(swing_N * K_S / K_M)
    unloading_m = damping.total_amplitude_m[0] - 2 * first_m
    force_N = F_N - 2 * swing_N
    area_J = -2 * np.trapezoid(unloading_m, force_N)
    # Both branches are point-symmetric: the loop holds twice what lies above the diagonal.
    assert unloading_m[-1] == pytest.approx(-unloading_m[0], rel=1e-9)
    assert area_J == pytest.approx(damping.energy_J[0], rel=2e-4)
    assert damping.energy_J[0] == pytest.approx(
        joints * slip.energy_J(slip.displacement_m(np.array(damping.force_N[0]))), rel=1e-9
    )


def test_small_amplitudes_follow_the_cube(slip):
    gross_m = slip.total_slip_force_N / K_S
    v_m = gross_m * np.geomspace(1e-9, 1e-6, 13)
    damping = response(slip, K_M, K_S, 2, v_m)
    slope = np.diff(np.log(damping.loss_factor)) / np.diff(np.log(v_m))
    np.testing.assert_allclose(slope, 1.0, atol=1e-3)
    initial = 1 / (1 + 2 * K_S**2 / K_M / slip.stiffness_N_per_m(0.0))
    np.testing.assert_allclose(damping.frequency_ratio, np.sqrt(initial), rtol=1e-4)


def test_default_amplitudes(slip):
    damping = response(slip, K_M, K_S, 2)
    v_m, gross_m = damping.amplitude_m, damping.gross_slip_amplitude_m
    assert len(v_m) >= 64
    assert (np.diff(v_m) > 0).all()
    assert v_m[0] == pytest.approx(1e-3 * gross_m, rel=1e-12)
    assert v_m[-1] == gross_m
    assert np.isfinite(damping.loss_factor).all()
    assert damping.amplitude_at_peak_m in v_m
    assert damping.loss_factor.max() == pytest.approx(damping.peak_loss_factor, rel=1e-9)
    assert (np.diff(damping.frequency_ratio) < 0).all()


def test_default_amplitudes_lie_close_about_the_peak():
    """Sixteen steps from a sixth below the peak to a fifth above it, beside those of the range."""
    damping = response(Hump(3.3), K_M, K_S, 1)
    peak_m, gross_m = damping.amplitude_at_peak_m, damping.gross_slip_amplitude_m
    near_m = np.geomspace(peak_m / 1.2, 1.2 * peak_m, 16)
    range_m = np.geomspace(1e-3 * gross_m, gross_m, 73)
    every_m = np.unique([*near_m, *range_m, peak_m])
    np.testing.assert_allclose(damping.amplitude_m, every_m, rtol=1e-12)
    # never beyond gross slip, where there is no cycle
    assert response(Hump(130.0), K_M, K_S, 1).amplitude_m[-1] == gross_m


class Hump:
    """Loss factor in proportion to T / (1 + (T / T0)^4), so highest at T0 / 3^(1/4)."""

    total_slip_force_N = 100.0

    def __init__(self, T0_N):
        self.T0_N = T0_N

    def displacement_m(self, force_N):
        return 1e-9 * force_N

    def energy_at_force_J(self, force_N):
        return 1e-10 * force_N**3 / (1 + (force_N / self.T0_N) ** 4)


@pytest.mark.parametrize("T0_N", [70.0, 3.3, 0.2, 0.138, 1e-3, 1e-5])
def test_peak_between_grid_points(T0_N):
    damping = response(Hump(T0_N), K_M, K_S, 1)
    v_m = T0_N / 3**0.25 / K_S
    assert damping.amplitude_at_peak_m == pytest.approx(v_m, rel=4e-7)  # 0.1 / 8^6
    assert damping.peak_loss_factor == pytest.approx(
        0.75e-10 * K_S**3 * v_m / (np.pi * K_M), rel=1e-9
    )
    assert not damping.peak_at_gross_slip
    lowest_m = damping.amplitude_m[0]
    assert lowest_m == pytest.approx(1e-3 * damping.gross_slip_amplitude_m, rel=1e-12)
    assert (damping.amplitude_at_peak_m in damping.amplitude_m) == (v_m > lowest_m)


class Humps(Hump):
    """Two of them, far apart: the loss factor is the sum, and so has two maxima."""

    def __init__(self, low_N, high_N, share):
        self.low, self.high, self.share = Hump(low_N), Hump(high_N), share

    def energy_at_force_J(self, force_N):
        return self.share * self.low.energy_at_force_J(force_N) + self.high.energy_at_force_J(
            force_N
        )


@pytest.mark.parametrize("share", [8.0, 16.0, 24.0])
def test_the_first_maximum_stands_beside_the_greatest(share):
    """The rise of the greater hump moves the first maximum up a little."""
    damping = response(Humps(0.9, 30.0, share), K_M, K_S, 1)
    alone = response(Hump(0.9), K_M, K_S, 1)
    assert damping.amplitude_at_peak_m == pytest.approx(30.0 / 3**0.25 / K_S, rel=1e-3)
    first_m = damping.amplitude_at_first_peak_m
    assert first_m == pytest.approx(alone.amplitude_at_peak_m, rel=0.15)
    near_m = first_m * np.array([0.98, 1.0, 1.02])
    assert np.argmax(response(Humps(0.9, 30.0, share), K_M, K_S, 1, near_m).loss_factor) == 1
    assert damping.first_peak_loss_factor < damping.peak_loss_factor
    assert damping.first_peak_loss_factor > share * alone.peak_loss_factor


@pytest.mark.parametrize("share", [0.2, 60.0])
def test_one_maximum_or_the_greatest_first_is_no_other(share):
    """A small hump is a shoulder of the greater one; a greater hump is the first itself."""
    for curve in (Humps(0.9, 30.0, share), Hump(3.3), Hump(0.2), Hump(1e-5), Dry()):
        damping = response(curve, K_M, K_S, 1)
        assert damping.first_peak_loss_factor is None
        assert damping.amplitude_at_first_peak_m is None


def test_what_is_not_resolved_is_no_maximum():
    """Neither before the greatest nor as the greatest, on the grid or below it."""
    curve = Humps(0.9, 30.0, 16.0)
    whole = response(curve, K_M, K_S, 1)
    first = whole.amplitude_at_first_peak_m / whole.gross_slip_amplitude_m
    for share, is_seen in ((0.8 * first, True), (1.2 * first, False)):
        found = response(curve, K_M, K_S, 1, resolved_from=share)
        assert (found.amplitude_at_first_peak_m is not None) == is_seen
        assert found.peak_loss_factor == whole.peak_loss_factor
    hump = Hump(1e-3)
    for curve, share in ((Humps(0.9, 30.0, 60.0), 0.1), (hump, 1e-4), (hump, 0.95), (hump, 1.0)):
        found = response(curve, K_M, K_S, 1, resolved_from=share)
        gross_m = found.gross_slip_amplitude_m
        seen_m = gross_m * np.geomspace(share, 1.0, 2000)
        seen = response(curve, K_M, K_S, 1, seen_m).loss_factor
        assert found.amplitude_at_peak_m >= (1.0 - 1e-12) * share * gross_m
        assert found.peak_loss_factor == pytest.approx(seen.max(), rel=1e-5)
        assert response(curve, K_M, K_S, 1).peak_loss_factor > 1.5 * seen.max()


class Dry:
    """Loss in proportion to the force: the loss factor rises to the smallest amplitude."""

    total_slip_force_N = 100.0

    def displacement_m(self, force_N):
        return 1e-9 * force_N

    def energy_at_force_J(self, force_N):
        return 1e-10 * force_N


def test_a_loss_factor_that_rises_to_zero_ends_the_search():
    damping = response(Dry(), K_M, K_S, 1)
    assert 1e-11 < damping.amplitude_at_peak_m / damping.gross_slip_amplitude_m <= 1e-9


class Held(Hump):
    """Loses nothing below a force of 2 N, like a joint that first has to come loose."""

    def energy_at_force_J(self, force_N):
        return np.where(force_N < 2.0, 0.0, super().energy_at_force_J(force_N))


def test_a_joint_that_loses_nothing_at_first_has_its_peak():
    held, free = (response(kind(20.0), K_M, K_S, 1) for kind in (Held, Hump))
    assert (held.loss_factor == 0.0).any()
    assert held.amplitude_at_peak_m == pytest.approx(free.amplitude_at_peak_m, rel=1e-6)
    assert held.peak_loss_factor == pytest.approx(free.peak_loss_factor, rel=1e-9)


def test_soft_structures_and_small_amplitudes_are_structures(slip):
    soft = response(slip, 0.5, 0.5, 1, [0.5])
    assert np.isfinite(soft.total_amplitude_m).all()
    assert soft.loss_factor[0] == pytest.approx(soft.energy_J[0] / (np.pi * 0.5 * 0.25), rel=1e-12)


def test_structure_stands_in_the_answer(slip):
    damping = response(slip, K_M, K_S, 3)
    found = (damping.modal_stiffness_N_per_m, damping.joint_stiffness_N_per_m, damping.joints)
    assert found == (K_M, K_S, 3)


def test_peak_does_not_depend_on_the_amplitudes_asked_for(slip):
    asked = response(slip, K_M, K_S, 2, 1e-12)
    assert asked.peak_loss_factor == response(slip, K_M, K_S, 2).peak_loss_factor
    assert asked.loss_factor.shape == (1,)


def test_no_number_beyond_gross_slip(slip):
    gross_m = slip.total_slip_force_N / K_S
    damping = response(slip, K_M, K_S, 2, gross_m * np.array([0.5, 1.0, 1 + 1e-12, 3.0]))
    for name, value in vars(damping).items():
        if isinstance(value, np.ndarray) and name != "amplitude_m":
            np.testing.assert_array_equal(np.isnan(value), [False, False, True, True], err_msg=name)


def test_nothing_lost_before_gross_slip(one_slider):
    damping = response(one_slider, K_M, K_S, 2)
    assert (damping.loss_factor == 0).all()
    assert damping.peak_loss_factor == 0
    assert damping.amplitude_at_peak_m is None
    assert not damping.peak_at_gross_slip
    assert (damping.frequency_ratio < 1).all()


def test_gross_slip_amplitude_itself_has_a_number():
    # K_s (mu N / K_s) rounds to more than mu N for some K_s, where the slip curve has no answer.
    slip = slip_curve(families((5,), (23.8,), (0,), 109.89e9), 460.4, 0.2, 1.2143)
    for K_s in np.linspace(0.9e8, 1.1e8, 101):
        damping = response(slip, K_M, K_s, 2, slip.total_slip_force_N / K_s)
        assert np.isfinite(damping.loss_factor).all()
        assert np.isfinite(damping.frequency_ratio).all()


def test_plane_interface_loses_nothing():
    damping = response(slip_curve(flat(460.0), 460.0, 0.2, 1.2143), K_M, K_S, 2)
    assert (damping.loss_factor == 0).all()
    assert (damping.frequency_ratio == 1).all()
    assert damping.amplitude_at_peak_m is None


def test_reference_joint():
    # delta, T and W of the paper's reference set, computed twice independently.
    delta_m = np.array([1e-9, 2.4286e-9, 5e-9, 1e-8, 2e-8, 4e-8, 6e-8])
    force_N = np.array([3.694, 8.033, 13.53, 23.87, 43.01, 74.27, 91.96])
    energy_J = np.array([2.728e-10, 5.471e-9, 3.488e-8, 1.0050e-7, 3.033e-7, 1.381e-6, 4.745e-6])
    curve = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    slip = slip_curve(curve, curve.load_N(2.5e-7), 0.2, 1.2143)
    force_at_delta_N = slip.force_N(delta_m)
    np.testing.assert_allclose(force_at_delta_N, force_N, rtol=5e-4)
    damping = response(slip, K_M, K_S, 1, force_at_delta_N / K_S)
    np.testing.assert_allclose(damping.displacement_m, delta_m, rtol=1e-9)
    np.testing.assert_allclose(damping.energy_J, energy_J, rtol=5e-4)
    np.testing.assert_allclose(
        damping.loss_factor, energy_J / (np.pi * K_M * (force_N / K_S) ** 2), rtol=2e-3
    )


def test_loss_scales_with_the_structure(slip):
    one = response(slip, K_M, K_S, 1)
    three = response(slip, K_M, K_S, 3)
    np.testing.assert_allclose(three.loss_factor, 3 * one.loss_factor, rtol=1e-12)
    # A joint that is loaded twice as much by the same v reaches everything at half of it.
    twice = response(slip, K_M, 2 * K_S, 1)
    np.testing.assert_allclose(twice.amplitude_m, one.amplitude_m / 2, rtol=1e-6)
    np.testing.assert_allclose(twice.loss_factor, 4 * one.loss_factor, rtol=1e-5)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"modal_stiffness_N_per_m": 0.0}, "modal_stiffness_N_per_m: got 0"),
        ({"modal_stiffness_N_per_m": np.inf}, "modal_stiffness_N_per_m: got inf"),
        ({"joint_stiffness_N_per_m": -1.0}, "joint_stiffness_N_per_m: got -1"),
        ({"joint_stiffness_N_per_m": np.nan}, "joint_stiffness_N_per_m: got nan"),
        ({"joints": 0}, "joints: got 0"),
        ({"joints": 1.5}, "joints: got 1.5"),
        ({"joints": True}, "joints: got True"),
        ({"amplitude_m": [1e-8, 0.0]}, "amplitude_m: got 0 "),
        ({"amplitude_m": [-1e-8, np.nan]}, "2 of 2 values"),
        ({"amplitude_m": np.inf}, "amplitude_m: got inf"),
        ({"amplitude_m": [[1e-8]]}, "shape"),
    ],
)
def test_bad_input(spheres, change, text):
    good = {"modal_stiffness_N_per_m": K_M, "joint_stiffness_N_per_m": K_S, "joints": 2}
    with pytest.raises(SettingsError, match=text):
        response(spheres((92.0, 6e-8)), **{**good, **change})
