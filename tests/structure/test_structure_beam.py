"""The first bending mode against closed forms and an independent collocation."""

import numpy as np
import pytest
from scipy.linalg import eig

from capslip.errors import SettingsError
from capslip.structure.beam import beam_mode

STEEL = {"youngs_modulus_Pa": 200e9, "density_kg_per_m3": 7850.0, "poisson_ratio": 0.3}
BEAM = {"length_m": 0.4, "width_m": 0.06, "thickness_m": 0.04, **STEEL}
UNIT_N_PER_M = 200e9 * 0.06 * 0.04**3 / 12 / 0.4**3  # EI / L^3


def chebyshev(n):
    """Points on [-1, 1] and the matrix that differentiates there."""
    x = np.cos(np.pi * np.arange(n + 1) / n)
    c = np.ones(n + 1)
    c[[0, n]] = 2
    c *= (-1.0) ** np.arange(n + 1)
    difference = x[:, None] - x
    matrix = np.outer(c, 1 / c) / (difference + np.eye(n + 1))
    return x, matrix - np.diag(matrix.sum(axis=1))


def collocated_mode(rotary, shear, n=30):
    """Timoshenko equations for unit length and EI: b^2, psi, shear and matrix on the points."""
    x, derivative = chebyshev(n)
    derivative = 2 * derivative  # unit length
    one, zero = np.eye(n + 1), np.zeros((n + 1, n + 1))
    force = np.hstack([derivative, -one]) / shear
    left = -np.vstack([derivative @ force, np.hstack([zero, derivative @ derivative]) + force])
    right = np.block([[one, zero], [zero, rotary * one]])
    for row in (0, n, n + 1, 2 * n + 1):  # w = psi = 0 at the clamps
        left[row], right[row] = 0, 0
        left[row, row] = 1
    value, vector = eig(left, right)
    real = np.isfinite(value) & (np.abs(value.imag) < 1e-6 * np.abs(value)) & (value.real > 1e-3)
    first = np.flatnonzero(real)[np.argmin(value[real].real)]
    mode = vector[:, first].real / vector[n // 2, first].real
    return value[first].real, mode[n + 1 :], force @ mode, derivative, x / 2


def test_euler_bernoulli_numbers():
    mode = beam_mode(**BEAM, theory="euler_bernoulli")
    wave_number = 4.730040744862704  # first root of cos x cosh x = 1
    mass_kg_per_m = 7850 * 0.06 * 0.04
    expected_Hz = wave_number**2 / (2 * np.pi) * np.sqrt(UNIT_N_PER_M / (mass_kg_per_m * 0.4))
    assert mode.frequency_Hz == pytest.approx(expected_Hz, rel=1e-13)
    assert mode.zero_moment_position_m / 0.4 == pytest.approx(0.22416, abs=5e-6)
    assert mode.modal_stiffness_N_per_m / UNIT_N_PER_M == pytest.approx(198.46, abs=5e-3)
    assert mode.joint_stiffness_N_per_m / UNIT_N_PER_M == pytest.approx(111.3, abs=0.05)
    assert mode.quasi_static_ratio == pytest.approx(1.16, abs=5e-3)
    assert mode.joint_position_m == mode.zero_moment_position_m
    assert abs(mode.joint_moment_N) < 1e-12 * mode.joint_stiffness_N_per_m * 0.4


@pytest.mark.parametrize("slenderness", [2, 5, 10, 50])
@pytest.mark.parametrize("shear_correction", [None, 0.4])
def test_timoshenko_against_collocation(slenderness, shear_correction):
    rotary = 1 / (12 * slenderness**2)
    shear = rotary * 2.6 / (shear_correction or 13 / 15.3)
    b2, psi, force, derivative, x = collocated_mode(rotary, shear)
    mode = beam_mode(
        length_m=1.0,
        width_m=0.1,
        thickness_m=1 / slenderness,
        shear_correction=shear_correction,
        joint_position_m=0.5 + x[4],
        **STEEL,
    )
    EI = 200e9 * 0.1 / slenderness**3 / 12
    mass_kg_per_m = 7850 * 0.1 / slenderness
    omega2 = b2 * EI / mass_kg_per_m
    assert mode.frequency_Hz == pytest.approx(np.sqrt(omega2) / (2 * np.pi), rel=1e-8)
    # The strain energy of the mode is K_m / 2: another integral than that of the mass.
    weight = np.linalg.solve(
        np.vander(2 * x, increasing=True).T,
        [(1 - (-1) ** (k + 1)) / (k + 1) / 2 for k in range(len(x))],
    )
    strain = weight @ ((derivative @ psi) ** 2 + shear * force**2)
    assert mode.modal_stiffness_N_per_m / EI == pytest.approx(strain, rel=1e-6)
    assert mode.joint_stiffness_N_per_m / EI == pytest.approx(abs(force[4]), rel=1e-7)
    moment = (derivative @ psi)[4]
    assert mode.joint_moment_N / EI == pytest.approx(moment, rel=1e-7)


@pytest.mark.parametrize("slenderness", [1e2, 1e4, 1e7])
def test_euler_bernoulli_is_the_thin_limit(slenderness):
    sizes = {**BEAM, "thickness_m": 0.4 / slenderness}
    thick, thin = beam_mode(**sizes), beam_mode(**sizes, theory="euler_bernoulli")
    for name in vars(thin):
        if name != "joint_moment_N":
            assert getattr(thick, name) == pytest.approx(
                getattr(thin, name), rel=30 / slenderness**2 + 1e-12
            )


def test_quasi_static_shear_of_a_thick_beam():
    mode = beam_mode(**BEAM)
    shear_modulus_Pa, area_m2 = 200e9 / 2.6, 0.06 * 0.04
    compliance = 1 / (192 * UNIT_N_PER_M) + 0.4 / (4 * 13 / 15.3 * shear_modulus_Pa * area_m2)
    expected = mode.joint_stiffness_N_per_m / (0.5 / compliance)
    assert mode.quasi_static_ratio == pytest.approx(expected, rel=1e-12)


def test_lengths_rescale():
    small, large = (
        beam_mode(**BEAM),
        beam_mode(**{**BEAM, "length_m": 4.0, "width_m": 0.6, "thickness_m": 0.4}),
    )
    assert large.frequency_Hz == pytest.approx(small.frequency_Hz / 10, rel=1e-12)
    assert large.modal_stiffness_N_per_m == pytest.approx(
        10 * small.modal_stiffness_N_per_m, rel=1e-12
    )
    assert large.zero_moment_position_m == pytest.approx(
        10 * small.zero_moment_position_m, rel=1e-12
    )


def test_mirrored_joint_and_clamp():
    left = beam_mode(**BEAM, joint_position_m=0.05)
    right = beam_mode(**BEAM, joint_position_m=0.35)
    assert right.joint_stiffness_N_per_m == pytest.approx(left.joint_stiffness_N_per_m, rel=1e-12)
    assert right.joint_moment_N == pytest.approx(left.joint_moment_N, rel=1e-12)
    assert left.joint_moment_N > 0 > beam_mode(**BEAM, joint_position_m=0.19).joint_moment_N
    # Each half of the vibrating mass pulls at its clamp; the modal stiffness is less than that.
    clamp = beam_mode(**BEAM, joint_position_m=1e-12)
    assert 2 * clamp.joint_stiffness_N_per_m > clamp.modal_stiffness_N_per_m


@pytest.mark.parametrize("position_m", [0.01, 0.09, 0.199])
def test_shear_force_is_the_slope_of_the_moment(position_m):
    def at(x_m):
        return beam_mode(**BEAM, theory="euler_bernoulli", joint_position_m=x_m)

    step_m = 1e-5
    slope = (at(position_m + step_m).joint_moment_N - at(position_m - step_m).joint_moment_N) / (
        2 * step_m
    )
    assert at(position_m).joint_stiffness_N_per_m == pytest.approx(abs(slope), rel=1e-6)
    assert at(position_m).joint_position_m == position_m


def test_bounds_of_the_material_themselves():
    # an auxetic body has a shear modulus above E / 2, and all of a section may carry shear
    auxetic = beam_mode(**{**BEAM, "poisson_ratio": -0.3}, shear_correction=1.0)
    usual = beam_mode(**BEAM, shear_correction=1.0)
    assert usual.frequency_Hz < auxetic.frequency_Hz
    thin = beam_mode(**BEAM, theory="euler_bernoulli")
    assert auxetic.frequency_Hz < thin.frequency_Hz


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"length_m": 0.0}, "length_m: got 0"),
        ({"width_m": -1.0}, "width_m: got -1"),
        ({"thickness_m": np.inf}, "thickness_m: got inf"),
        ({"youngs_modulus_Pa": np.nan}, "youngs_modulus_Pa: got nan"),
        ({"density_kg_per_m3": 0.0}, "density_kg_per_m3: got 0"),
        ({"length_m": 0.07}, "at least twice the thickness"),
        ({"poisson_ratio": 0.5}, "poisson_ratio: got 0.5"),
        ({"shear_correction": 0.0}, "shear_correction: got 0"),
        ({"shear_correction": 1.2}, "shear_correction: got 1.2"),
        ({"theory": "plate"}, "theory: got 'plate'"),
        ({"joint_position_m": 0.4}, "between 0 and 0.4 m"),
        ({"joint_position_m": -0.1}, "between 0 and 0.4 m"),
        ({"joint_position_m": np.nan}, "joint_position_m: got nan"),
        ({"joint_position_m": 0.2}, "shear force of the mode vanishes"),
    ],
)
def test_bad_input(change, text):
    with pytest.raises(SettingsError, match=text):
        beam_mode(**{**BEAM, **change})
