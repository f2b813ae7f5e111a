"""The answer to the question asked, against closed forms and against the whole curves."""

import math

import msgspec
import numpy as np
import pytest

from capslip.contact.joint import curve_of_joint
from capslip.contact.material import composite
from capslip.contact.models.families import families
from capslip.contact.models.flat import flat
from capslip.contact.models.interacting import interacting
from capslip.contact.slip import slip_curve
from capslip.errors import SettingsError
from capslip.settings import Question, load_settings
from capslip.structure.answer import answer_to
from capslip.structure.response import response
from capslip.units import in_si

STEEL = composite((200e9, 200e9), (0.3, 0.3))
MU, N = 0.2, 120.0
K_M, K_S, JOINTS = 2e8, 1e8, 2


def sphere(preload_N=N, weight=1.0):
    curve = families((1,), (5.0,), (0.0,), STEEL.E_star_Pa)
    whole = curve_of_joint(curve, np.array([preload_N]), np.array([weight]))
    return slip_curve(whole, preload_N * weight, MU, STEEL.kappa)


def pair():
    places = ([0.01, 0.03, 0.05], [0.01, 0.02, 0.01])
    curve = interacting([20.0, 22.0, 25.0], [0.0, 2e-8, 6e-8], *places, STEEL.E_star_Pa, N)
    whole = curve_of_joint(curve, np.array([N]), np.array([3.7]))
    return slip_curve(whole, 3.7 * N, MU, STEEL.kappa)


def ask(slip, K_m=K_M, K_s=K_S, **question):
    return answer_to(Question(**question), slip, response(slip, K_m, K_s, JOINTS))


@pytest.mark.parametrize("share", [1e-3, 0.1, 0.25, 0.5, 0.9, 1.0])
def test_one_sphere_answers_as_mindlin_wrote_it(share):
    slip = sphere()
    T, most_N = share * MU * N, MU * N
    limit_m = 1.5 * most_N / slip.tangential_stiffness_N_per_m
    q = (1.0 - share) ** (2.0 / 3.0)
    delta_m = limit_m * (1.0 - q)
    # The first loading encloses the complement of 2/5 (1 - q^5/2) of the rectangle
    below_J = most_N * (delta_m - 0.4 * limit_m * (1.0 - q**2.5))
    W_J, U_J = 8.0 * below_J - 4.0 * T * delta_m, 0.5 * T * delta_m
    answer, problems = ask(slip, slip_force_N=T)
    assert problems == ()
    assert answer.displacement_m == pytest.approx(delta_m, rel=1e-9)
    assert answer.tangential_stiffness_N_per_m == pytest.approx(T / delta_m, rel=1e-9)
    assert answer.energy_J == pytest.approx(W_J, rel=1e-5 if share < 0.01 else 1e-9)
    assert answer.joint_loss_factor == pytest.approx(W_J / (2.0 * math.pi * U_J), rel=1e-5)


def test_a_force_and_the_displacement_it_gives_are_one_state():
    slip = pair()
    by_force, _ = ask(slip, slip_force_N=0.4 * slip.total_slip_force_N)
    by_displacement, _ = ask(slip, displacement_m=by_force.displacement_m)
    by_amplitude, _ = ask(slip, amplitude_m=by_force.amplitude_m)
    for name in by_force.__dataclass_fields__:
        for other in (by_displacement, by_amplitude):
            assert getattr(other, name) == pytest.approx(getattr(by_force, name), rel=1e-10), name


def test_an_amplitude_is_answered_as_on_the_curve_over_amplitudes():
    slip = pair()
    v_m = 0.6 * slip.total_slip_force_N / K_S
    answer, _ = ask(slip, amplitude_m=v_m)
    curve = response(slip, K_M, K_S, JOINTS, [v_m])
    assert answer.loss_factor == pytest.approx(float(curve.loss_factor[0]), rel=1e-12)
    assert answer.damping_ratio == pytest.approx(float(curve.damping_ratio[0]), rel=1e-12)
    assert answer.total_amplitude_m == pytest.approx(float(curve.total_amplitude_m[0]), rel=1e-12)
    assert answer.frequency_shift == pytest.approx(float(curve.frequency_ratio[0]) - 1.0, rel=1e-9)
    total = float(curve.total_loss_factor[0])
    assert answer.total_loss_factor == pytest.approx(total, rel=1e-12)
    # What is lost over 2 pi of the energy that the force stores in all that it moves
    stored_J = 0.5 * K_M * v_m * answer.total_amplitude_m
    assert total == pytest.approx(float(curve.energy_J[0]) / (2.0 * math.pi * stored_J), rel=1e-9)
    assert answer.energy_J * JOINTS == pytest.approx(float(curve.energy_J[0]), rel=1e-12)
    assert answer.slip_force_N == pytest.approx(float(curve.force_N[0]), rel=1e-12)


def test_nothing_asked_is_a_quarter_of_total_slip():
    answer, _ = ask(sphere())
    assert answer.slip_force_N == pytest.approx(0.25 * MU * N, rel=1e-12)


def test_the_answer_of_a_larger_joint_goes_with_its_area():
    (one, _), (three, _) = ask(sphere()), ask(sphere(weight=3.0))
    for name in ("slip_force_N", "tangential_stiffness_N_per_m", "energy_J"):
        assert getattr(three, name) == pytest.approx(3.0 * getattr(one, name), rel=1e-12)
    for name in ("displacement_m", "joint_loss_factor"):
        assert getattr(three, name) == pytest.approx(getattr(one, name), rel=1e-12)


def at_gross_slip(slip, name):
    return {
        "amplitude_m": MU * N / K_S,
        "slip_force_N": MU * N,
        "displacement_m": float(slip.total_slip_displacement_m),
    }[name]


@pytest.mark.parametrize("name", ["amplitude_m", "slip_force_N", "displacement_m"])
def test_beyond_gross_slip_there_is_an_error_and_no_number(name):
    slip = sphere()
    most = at_gross_slip(slip, name)
    assert ask(slip, **{name: most})[0] is not None
    answer, problems = ask(slip, **{name: 1.001 * most})
    assert answer is None
    assert [(one.code, one.severity) for one in problems] == [("beyond_gross_slip", "error")]
    assert f"{1.001 * most:.4g}" in problems[0].message
    # an option, which takes units
    assert problems[0].step.endswith("; or --area ..., where the joint is larger than the scan")
    # the joint itself moves by another length than its structure
    assert (" m of the structure on " in problems[0].message) == (name == "amplitude_m")


@pytest.mark.parametrize(
    ("name", "beyond", "says"),
    [
        (
            "slip_force_N",
            1e-3,
            "got slip force {0} N, 1 mN too much; the joint slips as a whole from {0} N",
        ),
        ("slip_force_N", 0.02, "got slip force 24.02 N; the joint"),  # four digits tell them apart
        ("displacement_m", 2e-13, " nm, 2e-13 m too much; the joint"),
        ("displacement_m", 2e-9, " nm; the joint"),
        (
            "amplitude_m",
            4e-12,
            "240 nm, 4 pm too much; the joint slips as a whole from 240 nm of the",
        ),
    ],
)
def test_what_is_just_beyond_gross_slip_says_by_how_much(name, beyond, says):
    slip = sphere()
    most = at_gross_slip(slip, name)
    _, (problem,) = ask(slip, **{name: most + beyond})
    assert says.format(f"{most:.4g}") in problem.text


def test_a_mode_that_is_not_lightly_damped_has_no_loss_factor_and_its_joint_has_one():
    slip = sphere()
    # eta = n W / (pi K_m v^2), so the modal stiffness sets it
    T = 0.5 * MU * N
    v, W = T / K_S, float(slip.energy_at_force_J(T))
    for eta, defined in ((0.29, True), (0.31, False)):
        answer, _ = ask(slip, K_m=JOINTS * W / (math.pi * v * v * eta), slip_force_N=T)
        assert (answer.loss_factor is not None, answer.damping_ratio is not None) == (defined,) * 2
        assert answer.joint_loss_factor == pytest.approx(W / (math.pi * T * answer.displacement_m))
        # Joints that soft store most of the energy, and of all of it little is lost
        total = eta * v / answer.total_amplitude_m
        assert total < 0.1
        assert answer.total_loss_factor == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize(("share", "defined"), [(0.99, True), (1.01, False)])
def test_where_too_much_of_all_energy_is_lost_the_whole_has_no_loss_factor_either(share, defined):
    # Half of the load on many spheres that just touch: at gross slip the joint itself has a loss
    # factor of 0.74, a single sphere of 0.25
    curve = families((1, 400), (5.0, 5.0), (0.0, 5e-7), STEEL.E_star_Pa)
    preload_N = 2.0 * float(curve.load_N(5e-7))
    slip = slip_curve(curve, preload_N, MU, STEEL.kappa)
    T = MU * preload_N
    v, W = T / K_S, float(slip.energy_at_force_J(T))
    delta = float(slip.displacement_m(T))
    # n W / (pi K_m v v_total) = 0.3 of it, with v_total = v + n K_s delta / K_m
    K_m = (JOINTS * W / (math.pi * 0.3 * share) - JOINTS * K_S * delta * v) / v**2
    assert K_m > 0.0
    answer, _ = ask(slip, K_m=K_m, slip_force_N=T)
    assert (answer.total_loss_factor is not None) == defined
    assert answer.loss_factor is None


def test_a_plane_interface_is_rigid_and_loses_nothing():
    slip = slip_curve(flat(N), N, MU, STEEL.kappa)
    answer, _ = ask(slip)
    assert (answer.tangential_stiffness_N_per_m, answer.joint_loss_factor) == (None, None)
    assert (answer.energy_J, answer.loss_factor, answer.frequency_shift) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.5um", "m", 0.5e-6),
        ("0.5 µm", "m", 0.5e-6),
        ("10nm", "m", 10e-9),
        ("1e-3 mm", "m", 1e-6),
        ("20N", "N", 20.0),
        ("1.5 kN", "N", 1500.0),
        ("3mN", "N", 3e-3),
        ("2MPa", "Pa", 2e6),
        ("3 bar", "Pa", 3e5),
        ("2N/mm²", "Pa", 2e6),
        ("12 cm2", "m2", 1.2e-3),
        ("12cm²", "m2", 1.2e-3),
        ("7µm2", "m2", 7e-12),
    ],
)
def test_a_number_with_its_unit_is_read(text, unit, value):
    assert in_si(text, unit, "--it") == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("text", ["0.5", "um", "0.5 N", "-1um", "0um", "1..2um", "1 um um", ""])
def test_a_number_without_a_length_is_refused_in_one_line(text):
    with pytest.raises(SettingsError, match="expected a number > 0 and its unit") as error:
        in_si(text, "m", "--amplitude")
    assert str(error.value).startswith(f"--amplitude: got {text!r}; ")


def test_two_questions_are_refused():
    with pytest.raises(SettingsError, match=r"got amplitude_m and slip_force_N; expected one"):
        load_settings(overrides=("answer.amplitude_m=1e-7", "answer.slip_force_N=2"))
    assert msgspec.to_builtins(load_settings().answer) == dict.fromkeys(Question.__struct_fields__)
