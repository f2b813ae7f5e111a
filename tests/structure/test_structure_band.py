"""The intervals of an answer against closed forms of one sphere, input by input."""

from dataclasses import replace
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from scipy.special import ndtri

from capslip.analysis import analyze_families, analyze_once
from capslip.contact.accuracy import MovedCaps
from capslip.contact.given import given_families, press_families
from capslip.contact.material import composite
from capslip.contact.models.boundary_elements import RUNG as BOUNDARY_ELEMENTS
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.models.caps import caps
from capslip.contact.part_of_joint import LeftOpen, Moved
from capslip.contact.plastic_law import LawError
from capslip.contact.rung import ModelError
from capslip.contact.scans import curve_of_scans, kappa_of_scans
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.yielding import YieldLaw
from capslip.contact.varying_load import varying
from capslip.settings import Question, load_settings
from capslip.structure import band as band_module
from capslip.structure import band_causes
from capslip.structure.answer import answer_to
from capslip.structure.band import band_of
from capslip.structure.band_causes import LEAST_ERROR, NORMAL_95, PAIRS_SHARE, Left
from capslip.structure.band_state import Part, State
from capslip.structure.response import response
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from scenes import caps_map

STEEL = composite((200e9, 200e9), (0.3, 0.3))
MU, N, R_M = 0.2, 100.0, 5.0
SMALL_M, H_PA = 0.01, 1e9  # a sphere that has yielded under N
Z_90 = 1.645  # standard deviations on either side that hold 90 %
K_M, K_S, JOINTS = 2e8, 1e8, 2
SPREADS = {
    "friction": "material.friction_spread",
    "preload": "contact.preload_spread",
    "modulus": "material.modulus_spread",
    "hardness": "material.hardness_spread",
}
OF_CURVE = ("preload", "modulus", "hardness")
OF_A_MAP = ("noise of the map that pixels share", "blur of the optics")  # that nobody says
ASKED = {"slip_force_N": 23.0, "displacement_m": 5e-9}
NUMBERS = ("tangential_stiffness_N_per_m", "energy_J", "joint_loss_factor", "loss_factor")


def sphere_states(T=None, delta=None, mu=MU, preload=N, E=1.0):
    """Slip force, displacement and energy of one sphere, as Mindlin and Deresiewicz wrote it."""
    d = (0.75 * preload / (E * STEEL.E_star_Pa * np.sqrt(R_M))) ** (2 / 3)
    limit = mu * STEEL.kappa * d
    if T is None:
        T = mu * preload * (1.0 - (1.0 - delta / limit) ** 1.5)
    q = (1.0 - T / (mu * preload)) ** (2 / 3)
    delta = limit * (1.0 - q)
    below = mu * preload * (delta - 0.4 * limit * (1.0 - q**2.5))
    return T, delta, 8.0 * below - 4.0 * T * delta


def numbers(T, delta, W):
    loss = JOINTS * W / (np.pi * K_M * (T / K_S) ** 2)
    return dict(zip(NUMBERS, (T / delta, W, W / (np.pi * T * delta), loss), strict=True))


def settings_of(question, more=(), **spreads):
    given = (
        *(f"contact.preload_N={N}", f"material.friction_coefficient={MU}", "families.m=1"),
        *(f"structure.modal_stiffness_N_per_m={K_M}", f"structure.joint_stiffness_N_per_m={K_S}"),
    )
    set_to = [f"{SPREADS[name]}={spread}" for name, spread in spreads.items()]
    if "hardness" in spreads:  # one that is not reached: these tests give what yields
        set_to.append("material.hardness_Pa=1e12")
    questions = [f"answer.{name}={float(value)!r}" for name, value in question.items()]
    return load_settings(
        overrides=(*given, f"families.radius_G_m={R_M}", *questions, *set_to, *more)
    )


def pressed(settings, change=lambda contact: contact):
    joint, contact = press_families(given_families(settings), settings)
    contact = change(contact)
    greatest = 1.0 + settings.slip.normal_amplitude_ratio
    slip = slip_curve(joint.curve(contact, greatest), joint.preload_N, MU, STEEL.kappa)
    slip = varying(slip, settings.slip)
    damping = response(slip, K_M, K_S, JOINTS)
    answer, _ = answer_to(settings.answer, slip, damping)
    return answer, (Part(joint, contact, 1.0),), damping, settings


def band(question, change=lambda contact: contact, **spreads):
    return band_of(*pressed(settings_of(question, **spreads), change))


@pytest.mark.parametrize("share", [0.02, 0.25, 0.6])
@pytest.mark.parametrize(
    ("name", "spread"), [("friction", 0.2), ("preload", 0.3), ("modulus", 0.1)]
)
@pytest.mark.parametrize("asked", ["slip_force_N", "displacement_m"])
def test_one_spread_of_one_sphere_moves_the_answer_as_in_closed_form(asked, name, spread, share):
    """Every number is monotone in each input, so its interval is what the ends of that give."""
    force, delta_m, _ = sphere_states(T=share * MU * N)
    value, short = (force, "T") if asked == "slip_force_N" else (delta_m, "delta")
    key = {"friction": "mu", "preload": "preload", "modulus": "E"}[name]
    middle = {"mu": MU, "preload": N, "E": 1.0}[key]
    found = band({asked: value}, **{name: spread})
    ends = [
        numbers(*sphere_states(**{short: value, key: middle * np.exp(z * spread / NORMAL_95)}))
        for z in (-Z_90, Z_90)
    ]
    for one in NUMBERS:
        low, high = sorted(end[one] for end in ends)
        width = max(np.log(high / low), 1e-6)
        assert abs(np.log(np.array(found.interval[one]) / (low, high))).max() < 0.02 * width, one
        moves = {name: pytest.approx(1.0, abs=0.01)} if high / low > 1.0 + 1e-6 else {}
        assert found.contributions[one] == moves, one
    assert found.left_out == ("error of the model",)


def test_shares_of_the_variance_are_those_of_the_exponents_at_small_slip():
    """W ~ T^3 mu^-1 N^(-4/3) E^(-2/3) and K ~ N^(1/3) E^(2/3) of one sphere for T << mu N."""
    spread = {"friction": 0.1, "preload": 0.08, "modulus": 0.12}
    found = band({"slip_force_N": 1e-3 * MU * N}, **spread)
    for name, exponents in (
        ("energy_J", (-1.0, -4 / 3, -2 / 3)),
        ("tangential_stiffness_N_per_m", (0.0, 1 / 3, 2 / 3)),
    ):
        parts = (np.array(exponents) * list(spread.values())) ** 2
        expected = dict(zip(spread, parts / parts.sum(), strict=True))
        assert found.contributions[name] == pytest.approx(expected, abs=2e-3)
        sd = np.sqrt(parts.sum()) / NORMAL_95
        low, high = found.interval[name]
        assert np.log(high / low) == pytest.approx(2.0 * Z_90 * sd, rel=0.04)


@pytest.mark.parametrize("asked", ["amplitude_m", "slip_force_N", "displacement_m"])
def test_a_beam_is_as_stiff_as_the_material_it_shares_with_the_joint(asked):
    """Its stiffnesses grow with the modulus, and with them the force at an amplitude."""
    settings = settings_of({"slip_force_N": 0.25 * MU * N}, modulus=0.1)
    beam = msgspec.structs.replace(load_settings().structure, beam=settings.structure.beam)
    T, delta_m, _ = sphere_states(T=0.25 * MU * N)
    value = {"amplitude_m": T / K_S, "slip_force_N": T, "displacement_m": delta_m}[asked]
    changes = {"structure": beam, "answer": Question(**{asked: value})}
    found = band_of(*pressed(msgspec.structs.replace(settings, **changes)))
    ends = []
    for z in (-Z_90, Z_90):
        c = np.exp(z * 0.1 / NORMAL_95)
        at = {"amplitude_m": {"T": c * T}, "slip_force_N": {"T": T}}.get(asked, {"delta": delta_m})
        force, moved_m, W = sphere_states(E=c, **at)
        v = force / (c * K_S)
        loss = JOINTS * W / (np.pi * c * K_M * v**2)
        total_m = v + JOINTS * K_S / K_M * moved_m
        ends.append({"energy_J": W, "slip_force_N": force, "amplitude_m": v, "loss_factor": loss})
        ends[-1] |= {"displacement_m": moved_m, "frequency_shift": np.sqrt(v / total_m) - 1.0}
    for name in ends[0]:
        low, high = sorted(end[name] for end in ends)
        assert found.interval[name] == pytest.approx((low, high), rel=4e-3), name
    width = np.log(found.interval["energy_J"][1] / found.interval["energy_J"][0])
    assert (width > 0.3) == (asked == "amplitude_m")  # W goes as T^3


def test_an_estimated_error_at_95_is_a_normal_one():
    question = {"slip_force_N": 0.25 * MU * N}
    found = band(question, lambda contact: replace(contact, errors=ModelError(0.1, 0.1)))
    W = numbers(*sphere_states(T=0.25 * MU * N))
    ends = np.exp(np.array([-1.0, 1.0]) * Z_90 * 0.1 / NORMAL_95)
    for name in ("tangential_stiffness_N_per_m", "energy_J", "loss_factor"):
        assert found.interval[name] == pytest.approx(W[name] * ends, rel=3e-3)
        assert found.contributions[name] == pytest.approx({"model": 1.0}, abs=1e-9)
    assert found.left_out == ()
    both = np.diff(np.log(found.interval["joint_loss_factor"]))[0]
    assert both == pytest.approx(np.sqrt(2.0) * 2.0 * Z_90 * 0.1 / NORMAL_95, rel=0.05)


def test_the_energy_has_the_error_of_the_force_that_was_asked_for():
    """A power between the forces at which it is known; below, it grows as the force falls."""
    known = ModelError(0.01, 0.4, ((0.1, 0.4), (0.4, 0.1), (1.0, 0.05)))
    for share, error in ((0.05, 0.8), (0.1, 0.4), (0.2, 0.2), (0.4, 0.1)):
        question = {"slip_force_N": share * MU * N}
        found = band(question, lambda contact: replace(contact, errors=known))
        low, high = found.interval["energy_J"]
        assert np.log(high / low) == pytest.approx(2.0 * Z_90 * error / NORMAL_95, rel=1e-2)


def test_no_interval_holds_more_energy_than_any_loop_encloses():
    """Between T and delta a loop loses 4 T delta at most: a loss factor of 4 / pi."""
    question = {"slip_force_N": 0.25 * MU * N}
    found = band(question, lambda contact: replace(contact, errors=ModelError(1e-6, 8.0)))
    T, delta, W = sphere_states(T=0.25 * MU * N)
    low, high = found.interval["energy_J"]
    assert high == pytest.approx(4.0 * T * delta, rel=1e-4)
    assert low == pytest.approx(W * np.exp(-Z_90 * 8.0 / NORMAL_95), rel=0.2)
    assert found.interval["joint_loss_factor"][1] == pytest.approx(4.0 / np.pi, rel=1e-4)


def test_up_to_a_force_of_which_nothing_is_known_an_energy_is_anything_in_its_rectangle():
    known = ModelError(1e-6, 0.1, unknown_to=0.25)
    for share in (0.1, 0.25, 0.26):
        question = {"slip_force_N": share * MU * N}
        found = band(question, lambda contact: replace(contact, errors=known))
        T, delta, W = sphere_states(T=share * MU * N)
        expected = W * np.exp(np.array([-1.0, 1.0]) * Z_90 * 0.1 / NORMAL_95)
        if share <= 0.25:
            expected = (0.0, 4.0 * T * delta)
            assert found.contributions["energy_J"] == {}
        assert found.interval["energy_J"] == pytest.approx(expected, rel=3e-3), share


def test_a_model_that_knows_its_stiffness_better_than_its_energy_says_both():
    question = {"slip_force_N": 0.25 * MU * N}
    errors = {"tangential_stiffness_N_per_m": 0.01, "energy_J": 0.4}
    known = ModelError(*errors.values())
    found = band(question, lambda contact: replace(contact, errors=known))
    for name, error in errors.items():
        low, high = found.interval[name]
        assert np.log(high / low) == pytest.approx(2.0 * Z_90 * error / NORMAL_95, rel=1e-2)


@pytest.mark.parametrize("question", [{"slip_force_N": 5.0}, {"displacement_m": 1e-8}])
def test_no_energy_is_larger_than_the_rectangle_of_its_cycle(question):
    """W <= 4 T delta, whatever a model may be off by: W / (2 pi U) is 4 / pi at most."""
    unsure = ModelError(0.1, 20.0)
    found = band(question, lambda contact: replace(contact, errors=unsure)).interval
    assert found["joint_loss_factor"][1] == pytest.approx(4.0 / np.pi)
    other = "displacement_m" if "slip_force_N" in question else "slip_force_N"
    kept, moved = *question.values(), found[other][1]
    assert 0.0 < found["energy_J"][1] <= 4.0 * kept * moved * (1.0 + 1e-12)


@pytest.mark.parametrize("asked", ["slip_force_N", "displacement_m"])
def test_moved_radii_and_another_model_go_into_their_own_shares(asked):
    """Under a small force a sphere has K ~ R^(1/3), W ~ R^(-1/3); at a displacement W ~ R^(2/3)."""
    s, model = 0.06, 0.18

    def moved(contact):
        radius_m = R_M * np.exp([[0.0], [s], [-s], [model]])
        found, at_random, other = (
            caps(radius_m[at], np.zeros_like(radius_m[at]), STEEL.E_star_Pa)
            for at in (0, [1, 2, 0], 3)
        )
        return replace(
            contact,
            errors=ModelError(0.5, 0.5),  # the worst of other states, not of this one
            moved=MovedCaps(found, at_random, other, None),
        )

    T, delta_m, _ = sphere_states(T=1e-3 * MU * N)
    value, of_energy = (T, -1 / 3) if asked == "slip_force_N" else (delta_m, 2 / 3)
    found = band({asked: value}, moved)
    for name, exponent in (("energy_J", of_energy), ("tangential_stiffness_N_per_m", 1 / 3)):
        of_caps = abs(exponent) * s
        of_model = np.hypot(PAIRS_SHARE * exponent * model, LEAST_ERROR) / NORMAL_95
        low, high = found.interval[name]
        assert np.log(high / low) == pytest.approx(
            2.0 * Z_90 * np.hypot(of_caps, of_model), rel=0.05
        )
        share = of_caps**2 / (of_caps**2 + of_model**2)
        assert found.contributions[name] == pytest.approx(
            {"caps": share, "model": 1.0 - share}, abs=0.02
        )


def test_what_may_be_beyond_total_slip_has_no_bound_and_no_shares():
    found = band({"slip_force_N": 0.9 * MU * N}, friction=0.4)
    low, high = found.interval["energy_J"]
    assert (np.isfinite(low), np.isfinite(high)) == (True, False)
    assert found.interval["tangential_stiffness_N_per_m"][0] == 0.0
    assert found.contributions["energy_J"] == {}


def test_a_displacement_beyond_total_slip_has_the_force_of_total_slip():
    """A friction that is lower by 3 standard deviations slides: T = mu N, T and mu known."""
    _, delta_m, _ = sphere_states(T=0.99 * MU * N)
    low, high = band({"displacement_m": delta_m}, friction=0.3).interval["slip_force_N"]
    assert low == pytest.approx(MU * N * np.exp(-Z_90 * 0.3 / NORMAL_95), rel=0.02)
    assert np.isfinite(high)


def under_a_wave(asked, value, ratio, phase_rad, mu=MU, preload=N, E=1.0, H=None):
    """Slip force, displacement and energy of one sphere whose load oscillates, solved anew."""
    radius_m, wave = R_M, (f"normal_amplitude_ratio={ratio}", f"normal_phase_rad={phase_rad}")
    if H is not None:  # flattened by the greatest load of the cycle, once
        law = YieldLaw(H * H_PA, E * STEEL.E_star_Pa, 0.3)
        (radius_m,), _ = law.flattened(np.array([(1.0 + ratio) * preload]), np.array([SMALL_M]))
    curve = caps(np.array([radius_m]), np.array([0.0]), E * STEEL.E_star_Pa)
    of_wave = load_settings(overrides=tuple(f"slip.{one}" for one in wave)).slip
    slip = varying(slip_curve(curve, preload, mu, STEEL.kappa), of_wave)
    if asked == "slip_force_N":
        return value, float(slip.displacement_m(value)), float(slip.energy_at_force_J(value))
    return float(slip.force_N(value)), value, float(slip.energy_J(value))


OF_WAVES = (("friction", 0.2), ("preload", 0.2), ("modulus", 0.1), ("hardness", 0.2))


@pytest.mark.long
@pytest.mark.parametrize(
    ("asked", "ratio", "phase_rad", "name", "spread"),
    [
        *(("displacement_m", 0.1, 0.0, *one) for one in OF_WAVES),
        *(("slip_force_N", 0.3, 1.2, *one) for one in OF_WAVES),
        ("slip_force_N", 0.1, 0.0, "hardness", 0.2),
        ("displacement_m", 0.2, 2.5, "preload", 0.2),
    ],
)
def test_under_a_load_that_oscillates_one_spread_moves_the_cycle(
    asked, ratio, phase_rad, name, spread
):
    """Its ends are those of the input, also where a face has felt the greatest load.

    To 4 % of the width, or 0.3 % where the number hardly moves, and is not monotone.
    """
    wave = (f"slip.normal_amplitude_ratio={ratio}", f"slip.normal_phase_rad={float(phase_rad)!r}")
    key = {"friction": "mu", "preload": "preload", "modulus": "E", "hardness": "H"}[name]
    ends = {"H": 1.0} if name == "hardness" else {}
    if ends:
        wave += (f"material.hardness_Pa={H_PA}", f"families.radius_G_m={SMALL_M}")
    T, delta_m, _ = under_a_wave("slip_force_N", 0.4 * MU * N, ratio, phase_rad, **ends)
    value = T if asked == "slip_force_N" else delta_m
    found = band_of(*pressed(settings_of({asked: value}, more=wave, **{name: spread})))
    middle = {"mu": MU, "preload": N}.get(key, 1.0)
    numbers_at = []
    for z in (-Z_90, Z_90):
        moved = {**ends, key: middle * np.exp(z * spread / NORMAL_95)}
        numbers_at.append(numbers(*under_a_wave(asked, value, ratio, phase_rad, **moved)))
    for one in NUMBERS:
        low, high = sorted(of[one] for of in numbers_at)
        width = max(np.log(high / low), 7.5e-2)
        assert abs(np.log(np.array(found.interval[one]) / (low, high))).max() < 0.04 * width, one


def test_below_the_force_of_a_wave_in_phase_nothing_is_lost_whatever_the_model_is_off_by():
    wave = ("slip.normal_amplitude_ratio=0.3",)

    def off(contact):
        return replace(contact, errors=ModelError(0.1, 0.4, unknown_to=0.25))

    for share, spread, least, most in ((0.2, 0.1, 0.0, 0.0), (0.31, 0.2, 0.0, 1e-9)):
        asked = {"slip_force_N": share * MU * N}
        found = band_of(*pressed(settings_of(asked, more=wave, friction=spread), off))
        low, high = found.interval["energy_J"]
        assert low == least
        assert (high > most) == (most > 0.0)
        low, high = np.array(found.interval["tangential_stiffness_N_per_m"])
        assert np.log(high / low) > Z_90 * 0.1  # of the stiffness it is off all the same


def test_next_to_no_wave_moves_no_interval():
    errors = {"friction": 0.1, "preload": 0.05, "modulus": 0.05}
    asked, wave = {"slip_force_N": 0.4 * MU * N}, ("slip.normal_amplitude_ratio=1e-6",)
    still, moved = (
        band_of(*pressed(settings_of(asked, more=more, **errors))) for more in ((), wave)
    )
    for name in NUMBERS:
        assert moved.interval[name] == pytest.approx(still.interval[name], rel=2e-3), name
        assert moved.contributions[name] == pytest.approx(still.contributions[name], abs=2e-3)


def test_nothing_uncertain_is_no_band():
    assert band({"slip_force_N": 5.0}) is None
    _, *rest = pressed(settings_of({"slip_force_N": 5.0}, friction=0.1))
    assert band_of(None, *rest) is None


def test_a_direction_alone_is_no_interval_of_a_model_whose_error_is_not_known():
    lay = SimpleNamespace(left_open=lambda direction_rad: (0.1, 0.2j))
    question = {"slip_force_N": 5.0}
    assert band(question, lambda contact: replace(contact, lay=lay)) is None
    given = band(question, lambda contact: replace(contact, lay=lay), friction=0.1)
    assert given.contributions["energy_J"].keys() == {"direction", "friction"}
    assert given.left_out == ("error of the model",)
    error = ModelError(1e-6, 1e-6)
    known = band(question, lambda contact: replace(contact, lay=lay, errors=error))
    assert known.contributions["energy_J"]["direction"] == pytest.approx(1.0, abs=1e-6)


def test_a_joint_of_three_areas_has_three_times_the_interval():
    settings = settings_of({}, friction=0.2, preload=0.1)
    answer, (part,), damping, _ = pressed(settings)
    joint, contact = part.joint, part.contact
    whole = replace(joint, preload_N=3.0 * N, weight=3.0 * joint.weight)
    slip = slip_curve(whole.curve(contact), 3.0 * N, MU, STEEL.kappa)
    question = msgspec.structs.replace(settings.answer, slip_force_N=3.0 * answer.slip_force_N)
    three = msgspec.structs.replace(settings, answer=question)
    tripled, _ = answer_to(question, slip, damping)
    one = band_of(answer, (part,), damping, settings)
    other = band_of(tripled, (replace(part, joint=whole),), damping, three)
    for name, factor in (("energy_J", 3.0), ("displacement_m", 1.0), ("joint_loss_factor", 1.0)):
        expected = factor * np.array(one.interval[name])
        assert other.interval[name] == pytest.approx(expected, rel=1e-9)


def test_patches_under_unlike_loads_move_each_by_its_own_closed_form():
    """Two spheres side by side, one under 0.4 of the load: forces and energies add."""
    loads_N, spread = np.array([N, 0.4 * N]), 0.2
    delta_m = sphere_states(T=0.2 * MU * N)[1]
    settings = settings_of({"displacement_m": delta_m}, preload=spread)
    _, (part,), _, _ = pressed(settings)
    joint = replace(part.joint, preload_N=loads_N.sum(), load_N=loads_N, weight=np.ones(2))
    slip = slip_curve(joint.curve(part.contact), joint.preload_N, MU, STEEL.kappa)
    damping = response(slip, K_M, K_S, JOINTS)
    answer, _ = answer_to(settings.answer, slip, damping)
    found = band_of(answer, (replace(part, joint=joint),), damping, settings)
    ends = []
    for factor in np.exp(np.array([-Z_90, Z_90]) * spread / NORMAL_95):
        T, _, W = zip(*(sphere_states(None, delta_m, MU, factor * one) for one in loads_N),
                      strict=True)  # fmt: skip
        ends.append(numbers(sum(T), delta_m, sum(W)))
    for name in NUMBERS:
        low, high = sorted(end[name] for end in ends)
        width = np.log(high / low)
        assert abs(np.log(np.array(found.interval[name]) / (low, high))).max() < 0.03 * width, name


@pytest.mark.parametrize("asked", ["slip_force_N", "displacement_m"])
def test_from_where_an_approach_counts_does_not_matter(asked):
    T, delta_m, _ = sphere_states(T=0.5 * MU * N)
    spreads = {"friction": 0.1, "preload": 0.1, "modulus": 0.1}

    def with_touch_at(depth_m):
        curve = caps(np.array([R_M]), np.array([depth_m]), STEEL.E_star_Pa)
        return lambda contact: replace(contact, curve=curve)

    question = {asked: T if asked == "slip_force_N" else delta_m}
    one, other = (band(question, with_touch_at(depth_m), **spreads) for depth_m in (0.0, 3e-7))
    for name in NUMBERS:
        assert other.interval[name] == pytest.approx(one.interval[name], rel=1e-6)


def test_a_map_is_followed_down_from_its_preload_alone():
    """Pressed as a map, a sphere has the band of a sphere, from three loads."""
    surface = caps_map([(5e-3, 5e-3, R_M, 0.0)], shape=(100, 100), floor_m=-1.0)
    curve = boundary_elements(surface, STEEL.E_star_Pa)

    def on_the_map(contact):
        return replace(contact, rung=BOUNDARY_ELEMENTS, curve=curve, errors=None)

    share = 0.5
    found = band({"slip_force_N": share * MU * N}, on_the_map, preload=0.2)
    ends = [
        sphere_states(T=share * MU * N, preload=N * np.exp(z * 0.2 / NORMAL_95))[2]
        for z in (Z_90, -Z_90)
    ]
    assert np.diff(np.log(found.interval["energy_J"])) == pytest.approx(
        np.diff(np.log(ends)), rel=0.05
    )
    assert list(curve.solutions.unloading) == [N]
    assert found.left_out == ("error of the model", *OF_A_MAP)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("seed", [38, 43])
def test_an_interval_of_the_load_knows_what_touches_under_more_of_it(seed):
    """On waves that are elastic: from less load alone more cannot be told."""
    waves = {"waviness_rms_m": 1e-7, "waviness_length_m": 4e-3, "floor_m": 0.0}
    surface, _ = synthetic_surface(Scene((200, 300), (2e-4, 2e-4), seed=seed, **waves))

    def under(load_N):
        return boundary_elements(surface, STEEL.E_star_Pa, preload_N=load_N, balanced=False)

    curve = under(N)
    found = band(
        {"slip_force_N": 0.25 * MU * N},
        lambda contact: replace(contact, rung=BOUNDARY_ELEMENTS, curve=curve, errors=None),
        preload=0.1,
    )
    ends_J = []
    for load_N in N * np.exp(np.array([Z_90, -Z_90]) * 0.1 / NORMAL_95):
        other = under(load_N).at_forces((0.25 * N / load_N, 0.75))
        ends_J.append(other.loss_integral_at_drop_J(other.approach_m(load_N), 0.25 * N))
    ends = np.log(MU**2 * STEEL.kappa * np.array(ends_J))
    off = np.abs(np.log(found.interval["energy_J"]) - ends)
    assert off.max() < 0.2 * np.ptp(ends)


def yielded_states(T=None, delta=None, mu=MU, preload=N, E=1.0, H=1.0):
    """Return the same of one sphere that its preload flattened, and that slips as Hertz's."""
    law = YieldLaw(H * H_PA, E * STEEL.E_star_Pa, 0.3)
    (flat_m,), _ = law.flattened(np.array([preload]), np.array([SMALL_M]))
    scale = np.sqrt(flat_m / R_M)  # R and E* enter as E* sqrt(R)
    return sphere_states(T, delta, mu, preload, E * scale)


@pytest.mark.parametrize("name", ["friction", "preload", "modulus", "hardness"])
@pytest.mark.parametrize("asked", ["slip_force_N", "displacement_m"])
def test_a_sphere_that_yields_is_loaded_anew_for_what_moves_it(asked, name):
    """The unloading curve of each preload, modulus and hardness is another one."""
    spread, share = 0.2, 0.25
    force, delta_m, _ = yielded_states(T=share * MU * N)
    value, short = (force, "T") if asked == "slip_force_N" else (delta_m, "delta")
    key = {"friction": "mu", "preload": "preload", "modulus": "E", "hardness": "H"}[name]
    middle = {"mu": MU, "preload": N}.get(key, 1.0)
    given = f"material.hardness_Pa={H_PA}", f"families.radius_G_m={SMALL_M}"
    settings = settings_of({asked: value}, more=given, **{name: spread})
    found = band_of(*pressed(settings))
    ends = [
        numbers(*yielded_states(**{short: value, key: middle * np.exp(z * spread / NORMAL_95)}))
        for z in (-Z_90, Z_90)
    ]
    for one in NUMBERS:
        low, high = sorted(end[one] for end in ends)
        width = max(np.log(high / low), 1e-3)
        assert abs(np.log(np.array(found.interval[one]) / (low, high))).max() < 0.03 * width, one
        moves = {name: pytest.approx(1.0, abs=0.01)} if high / low > 1.0 + 1e-6 else {}
        assert found.contributions[one] == moves, one


@pytest.mark.long
@pytest.mark.parametrize(
    ("hardness_Pa", "name", "spread"),
    [
        (1e12, "preload", 0.2),
        (1e12, "preload", 0.05),
        (4e7, "preload", 0.2),
        (4e7, "hardness", 0.2),
        (4e7, "hardness", 0.1),
    ],
)
def test_a_map_is_loaded_anew_to_what_it_may_bear_on_either_side(
    request, hardness_Pa, name, spread
):
    """Two hills, of which the lower one takes more of more load, or of less hardness.

    As solved: what metal does otherwise than a map is that of the known state on either side.
    """
    if hardness_Pa < 1e12:  # flats take many, and are as good on fewer
        request.getfixturevalue("fewer_points")
    hills = [(2.7e-3, 5e-3, 1.0, 0.0), (7.3e-3, 5e-3, 1.0, 3e-7)]
    surface = caps_map(hills, shape=(100, 100), floor_m=-1.0)

    def on_the_map(load_N, H_Pa):
        found = boundary_elements(surface, STEEL.E_star_Pa, preload_N=load_N, hardness_Pa=H_Pa)
        return replace(found, as_solved=True)

    def as_a_map(contact):
        curve = on_the_map(N, hardness_Pa)
        area = {
            "contact_area_m2": curve.pressed(N).contact_area_m2,
            "yielded_area_m2": curve.yielded_area_m2,
        }
        return replace(
            contact, rung=BOUNDARY_ELEMENTS, curve=curve, first=curve, errors=None, **area
        )

    drop_N = 0.25 * N
    given = settings_of({"slip_force_N": MU * drop_N}, **{name: spread})
    found = band_of(*pressed(given, as_a_map))
    ends_J = []
    for factor in np.exp(np.array([-Z_90, Z_90]) * spread / NORMAL_95):
        of_load, of_hardness = (factor, 1.0) if name == "preload" else (1.0, factor)
        curve = on_the_map(of_load * N, of_hardness * hardness_Pa)
        curve = curve.at_forces((drop_N / (of_load * N), 0.75))
        loss_J = curve.loss_integral_at_drop_J(curve.approach_m(of_load * N), drop_N)
        ends_J.append(MU**2 * STEEL.kappa * float(loss_J))
    low, high = sorted(ends_J)
    off = np.abs(np.log(np.array(found.interval["energy_J"]) / (low, high)))
    assert off.max() < max(0.035 * np.log(high / low), 0.01)  # the latter between solved loads


@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize(
    ("yielded_share", "spread", "solutions"), [(0.049, 0.1, 1), (0.051, 0.1, 2), (0.049, 0.2, 2)]
)
def test_a_hardness_that_moves_little_of_what_yields_little_costs_one_solution(
    monkeypatch, yielded_share, spread, solutions
):
    surface = caps_map([(5e-3, 5e-3, 1.0, 0.0)], shape=(100, 100), floor_m=-1.0)
    curve = boundary_elements(surface, STEEL.E_star_Pa, preload_N=N, hardness_Pa=4e7)
    area = {"contact_area_m2": 1e-6, "yielded_area_m2": yielded_share * 1e-6}
    known = {"rung": BOUNDARY_ELEMENTS, "curve": curve, "first": curve, "errors": None, **area}
    changes, anew = [], type(curve)._anew
    monkeypatch.setattr(type(curve), "_anew", lambda *of: changes.extend(of[2]) or anew(*of))
    band(
        {"slip_force_N": 0.25 * MU * N}, lambda contact: replace(contact, **known), hardness=spread
    )
    assert len(changes) == solutions


@pytest.mark.long
@pytest.mark.parametrize("hardness", [(), ("material.hardness_Pa=5e6",)])
@pytest.mark.parametrize("name", ["preload", "modulus"])
def test_a_joint_pressed_unevenly_is_followed_where_its_caps_start_to_touch(
    tmp_path, name, hardness
):
    """Against the curves of each state itself, as far out as the ends of an interval."""
    families = CapFamily("G", 3, 24.0), CapFamily("P", 6, 24.0, 1e-7)
    scene = Scene((100, 150), (4e-4, 4e-4), seed=0, families=families, noise_rms_m=1e-9)
    surface = synthetic_surface(scene)[0]
    area_m2, path = surface.measured_area_m2, tmp_path / "pressures.csv"
    rows = [f"{p},{w * area_m2!r}" for p, w in ((4e4, 2.0), (1e5, 1.0), (3e5, 0.5))]
    path.write_text("\n".join(("pressure_Pa,area_m2", *rows)), encoding="utf-8")
    given = ("contact.model=interacting", "contact.alignment=as_levelled", "hills.cut=fixed")
    asked = ("answer.slip_force_N=30", f"joint.pressure_map={path}")
    settings = load_settings(overrides=(*given, *asked, *hardness))
    found = analyze_once(surface, settings)
    state = State(found.answer, True, found.parts, settings)
    z = np.linspace(-Z_90, Z_90, 11) * 0.2 / NORMAL_95
    log = {of: z if of == name else 0.0 * z for of in ("friction", *OF_CURVE)}
    _, energy_J = state.under(log)
    N = log["preload"] - log["modulus"]
    states = np.exp(np.column_stack((N, -log["modulus"] if hardness else 0.0 * z)))
    drops_N = 30.0 / settings.material.friction_coefficient / np.exp(log["modulus"])
    expected = []
    for curve, load_N, drop_N in zip(
        state.curves(states), found.joint.preload_N * states[:, 0], drops_N, strict=True
    ):
        expected.append(float(curve.loss_integral_at_drop_J(curve.approach_m(load_N), drop_N)))
    log_W = np.log(np.array(expected) * np.exp(log["modulus"])) - np.log(expected[5])
    off = np.log(energy_J / found.answer.energy_J) - log_W
    assert np.ptp(log_W) > 0.2
    assert np.abs(off).max() < 0.06 * np.ptp(log_W)


@pytest.mark.parametrize(("model", "off"), [("families", 1e-6), ("interacting", 0.01)])
@pytest.mark.parametrize("asked", ["slip_force_N", "displacement_m"])
def test_a_preload_decides_which_of_few_caps_touch(model, off, asked):
    """Against an answer under each of many preloads, about which the near field is made anew."""
    given = ("material.friction_coefficient=0.2", f"answer.{asked}={ASKED[asked]}")
    if model == "families":
        made = {"m": 5, "n": 18, "radius_G_m": 23.8, "radius_P_m": 26.7, "h_m": 2.4e-7}
        given += tuple(f"families.{name}={value}" for name, value in made.items())

        def answered(*sets):
            return analyze_families(load_settings(overrides=(*given, *sets)))
    else:
        families = CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 2.4e-7)
        surface = synthetic_surface(Scene((100, 150), (4e-4, 4e-4), seed=1, families=families))[0]
        given += ("contact.model=interacting", "contact.alignment=as_levelled", "hills.cut=fixed")

        def answered(*sets):
            return analyze_once(surface, load_settings(overrides=(*given, *sets)))

    found = answered("contact.preload_N=460", "contact.preload_spread=0.2")
    state = State(found.answer, asked == "slip_force_N", found.parts, found.settings)
    z = np.linspace(-Z_90, Z_90, 9)
    log = dict.fromkeys(("friction", *OF_CURVE), 0.0 * z) | {"preload": z * 0.2 / NORMAL_95}
    other, energy_J = state.under(log)
    exact = [
        answered(f"contact.preload_N={float(460.0 * np.exp(one))!r}").answer
        for one in log["preload"]
    ]
    assert energy_J == pytest.approx([one.energy_J for one in exact], rel=off)
    name = "displacement_m" if asked == "slip_force_N" else "slip_force_N"
    assert other == pytest.approx([getattr(one, name) for one in exact], rel=off)
    assert np.ptp(np.log(energy_J)) > 0.5  # far from a line


def test_yielding_moves_the_interval_of_a_preload():
    """W ~ T^3 / (mu N E* a) under a small force, with a ~ N^(1/3) where elastic, else N^(1/2)."""
    more = f"material.hardness_Pa={H_PA / 50.0}", f"families.radius_G_m={SMALL_M}"
    question = {"slip_force_N": 1e-3 * MU * N}
    yields = band_of(*pressed(settings_of(question, more=more, preload=0.1)))
    elastic = band_of(*pressed(settings_of(question, preload=0.1)))
    width = [float(np.diff(np.log(one.interval["energy_J"]))[0]) for one in (yields, elastic)]
    assert width[1] == pytest.approx(4.0 / 3.0 * 2.0 * Z_90 * 0.1 / NORMAL_95, rel=0.04)
    assert width[0] == pytest.approx(1.5 * 2.0 * Z_90 * 0.1 / NORMAL_95, rel=0.04)


@pytest.mark.parametrize("of_contact", [1.0, 0.1])
def test_what_the_unloading_of_yielded_caps_leaves_moves_energy_and_stiffness(of_contact):
    """The stiffness by the share that the contact has of the compliance, with the bulk kept."""
    law = LawError(0.0, (0.0,) * 4, (-0.6,) * 4, (0.3,) * 4)

    def moved(contact):
        curve = contact.curve
        radius_m = np.repeat(curve.radius_m[None], 3, axis=0)
        same = caps(radius_m, 0.0 * radius_m, STEEL.E_star_Pa)
        given = MovedCaps(curve, same, curve, None, 0.6, of_contact=of_contact, law=law)
        return replace(contact, moved=given, errors=ModelError(0.1, 0.1))

    found = band({"slip_force_N": 0.25 * MU * N}, moved)
    of_energy = np.hypot(0.3, 0.06)
    each = ("energy_J", of_energy, -0.6), ("displacement_m", 0.06 * of_contact, 0.0)
    for name, half, shift in each:
        sd = np.hypot(half, LEAST_ERROR) / NORMAL_95
        low, high = np.log(np.array(found.interval[name]) / getattr(found_answer(), name))
        width = Z_90 * sd
        assert low == pytest.approx(shift - width, rel=0.05, abs=1e-3)
        # It holds what was answered
        assert high == pytest.approx(max(shift + width, 0.0), rel=0.05, abs=1e-3)
    of_law = found.contributions["energy_J"]["plastic_law"]
    assert of_law == pytest.approx((0.3 / of_energy) ** 2, abs=0.002)


def found_answer():
    answer, *_ = pressed(settings_of({"slip_force_N": 0.25 * MU * N}))
    return answer


def parts_of(radii_m, shares=None, error=0.0, kappa=None, **spreads):
    """Joints of 100 N on one sphere each, without any error but their scatter."""
    settings = settings_of({"slip_force_N": 0.25 * MU * N}, **spreads)
    shares = shares or [1.0 / len(radii_m)] * len(radii_m)
    parts = []
    for radius_m, share in zip(radii_m, shares, strict=True):
        one = msgspec.structs.replace(settings.families, radius_G_m=radius_m)
        changed = msgspec.structs.replace(settings, families=one)
        joint, contact = press_families(given_families(changed), changed)
        parts.append(Part(joint, replace(contact, errors=ModelError.of_either(error)), share))
    for i, one in enumerate(kappa or ()):
        directed = replace(parts[i].contact.composite, kappa=one)
        contact = replace(parts[i].contact, composite=directed)
        parts[i] = replace(parts[i], contact=contact)
    return parts, settings


def answer_of_parts(parts, settings, damping=None):
    curves = [part.joint.curve(part.contact) for part in parts]
    share, each = zip(*((part.share, part.contact.composite.kappa) for part in parts), strict=True)
    kappa = kappa_of_scans(curves, N, share, each)
    curve = curve_of_scans(curves, N, share, np.divide(each, kappa))
    slip = slip_curve(curve, N, MU, kappa)
    damping = damping or response(slip, K_M, K_S, JOINTS)
    return answer_to(settings.answer, slip, damping)[0], damping


def band_of_parts(radii_m, question=None, damping=None, **more):
    parts, settings = parts_of(radii_m, **more)
    if question is not None:
        settings = msgspec.structs.replace(settings, answer=Question(**question))
    answer, damping = answer_of_parts(parts, settings, damping)
    return band_of(answer, parts, damping, settings), answer


@pytest.mark.parametrize("asked", ["slip_force_N", "displacement_m"])
def test_two_scans_scatter_by_half_of_what_they_differ_with_one_degree_of_freedom(asked):
    """Standard error of the mean of two: half of their difference; t(0.95, 1) = 6.314."""
    T = 0.25 * MU * N
    value = T if asked == "slip_force_N" else sphere_states(T=T)[1]
    found, answer = band_of_parts([5.0, 5.1], {asked: value})
    one, other = (band_of_parts([R, R], {asked: value})[1] for R in (5.0, 5.1))
    assert found.contributions["energy_J"] == pytest.approx({"scans": 1.0}, abs=1e-6)
    for name in ("energy_J", "tangential_stiffness_N_per_m"):
        a, b, middle = (getattr(of, name) for of in (one, other, answer))
        half = 6.314 * 0.5 * abs(np.log(a / b))
        low, high = np.log(np.array(found.interval[name]) / middle)
        assert (-low, high) == pytest.approx((half, half), rel=0.15), name


def test_scans_of_a_larger_joint_scatter_by_what_their_contacts_let_expect(monkeypatch):
    """Equal ones by that alone, as three of four: t(0.95, 4) = 2.132; others by both squares."""
    nothing, stiffness, energy = Moved(0.0, 0.0), 0.06, 0.1
    left = LeftOpen(0.1, nothing, nothing, energy, stiffness, 0.0)
    monkeypatch.setattr(band_causes, "left_open", lambda joint, contact: left)
    for radii_m in ([5.0, 5.0], [5.0, 6.0]):
        found, answer = band_of_parts(radii_m)
        each = [band_of_parts([R, R])[1] for R in radii_m]
        for name, by_chance in (("energy_J", energy), ("tangential_stiffness_N_per_m", stiffness)):
            scatter = 0.5 * np.log(getattr(each[0], name) / getattr(each[1], name))
            half = 2.132 * np.sqrt(0.75 * by_chance**2 / 2.0 + 0.25 * scatter**2)
            low, high = np.log(np.array(found.interval[name]) / getattr(answer, name))
            assert (-low, high) == pytest.approx((half, half), rel=0.15), name


def test_all_that_may_be_uncertain_has_an_interval_together(monkeypatch):
    """Two columns each of caps, model, law, scans, part and direction, and four of the inputs."""
    two = np.diag([0.01, 0.01])
    for name in ("of_scatter", "of_direction"):
        monkeypatch.setattr(band_module, name, lambda state: two)
    monkeypatch.setattr(band_module, "of_parts", lambda state: (two, np.zeros(2)))
    monkeypatch.setattr(band_module, "of_caps_and_model", lambda state: Left(two, two, law=two))
    spreads, more = dict.fromkeys(SPREADS, 0.1), ("material.hardness_Pa=5e9",)
    answer, (part,), *rest = pressed(settings_of({"slip_force_N": 20.0 * MU}, more, **spreads))
    found = band_of(answer, [replace(part, share=0.5)] * 2, *rest)
    of_both = {"caps", "model", "plastic_law", "scans", "part_of_joint", "direction"}
    assert set(found.contributions["energy_J"]) == of_both | set(spreads)
    assert np.isfinite(found.interval["energy_J"]).all()


@pytest.mark.parametrize("asked", ["slip_force_N", "displacement_m"])
def test_scans_that_differ_in_kappa_alone_scatter_by_it(asked):
    """At one force of equal faces delta and W go as kappa; at one displacement as by Mindlin."""
    kappa = (0.9 * STEEL.kappa, 1.1 * STEEL.kappa)
    T, delta_m, _ = sphere_states(T=0.25 * MU * N)
    value = T if asked == "slip_force_N" else delta_m
    found, answer = band_of_parts([R_M, R_M], {asked: value}, kappa=kappa)
    each = [sphere_states(delta=answer.displacement_m * STEEL.kappa / k) for k in kappa]
    energies_J = [k / STEEL.kappa * W for k, (_, _, W) in zip(kappa, each, strict=True)]
    assert answer.slip_force_N == pytest.approx(np.mean([one[0] for one in each]), rel=1e-9)
    assert answer.energy_J == pytest.approx(np.mean(energies_J), rel=1e-9)
    if asked == "slip_force_N":
        off = {"energy_J": kappa, "tangential_stiffness_N_per_m": kappa}
    else:
        stiffness = [one[0] / delta_m for one in each]
        off = {"energy_J": energies_J, "tangential_stiffness_N_per_m": stiffness}
    for name, (a, b) in off.items():
        half = 6.314 * 0.5 * abs(np.log(a / b))
        low, high = np.log(np.array(found.interval[name]) / getattr(answer, name))
        assert (-low, high) == pytest.approx((half, half), rel=0.15), name


def test_scans_of_unlike_kappa_keep_their_sum_under_other_inputs():
    """Under another friction each has the force of Mindlin at one displacement, by its kappa."""
    kappa = (0.9 * STEEL.kappa, 1.1 * STEEL.kappa)
    delta_m = sphere_states(T=0.25 * MU * N)[1]
    parts, settings = parts_of([R_M, R_M], kappa=kappa, friction=0.2)
    settings = msgspec.structs.replace(settings, answer=Question(displacement_m=delta_m))
    answer, _ = answer_of_parts(parts, settings)
    factor = np.array([0.85, 1.0, 1.2])
    log = {"friction": np.log(factor), "preload": np.zeros(3), "modulus": np.zeros(3)}
    T, W = State(answer, False, tuple(parts), settings).under(log)
    for i, mu in enumerate(MU * factor):
        each = [sphere_states(delta=delta_m * STEEL.kappa / k, mu=mu) for k in kappa]
        assert T[i] == pytest.approx(np.mean([one[0] for one in each]), rel=1e-9)
        of = [k / STEEL.kappa * one[2] for k, one in zip(kappa, each, strict=True)]
        assert W[i] == pytest.approx(np.mean(of), rel=1e-9)


@pytest.mark.parametrize(("count", "quantile"), [(3, 2.920), (5, 2.132), (9, 1.860)])
def test_the_scatter_is_the_standard_error_of_the_mean_of_the_scans(count, quantile):
    """Of W at a displacement, which is the mean of the scans' own, to first order."""
    radii_m = 5.0 * np.exp(0.05 * np.random.default_rng(count).standard_normal(count))
    delta_m = sphere_states(T=0.25 * MU * N)[1]
    found, answer = band_of_parts(radii_m, {"displacement_m": delta_m})
    W = [band_of_parts([R, R], {"displacement_m": delta_m})[1].energy_J for R in radii_m]
    assert answer.energy_J == pytest.approx(np.mean(W), rel=1e-9)
    error = np.std(W, ddof=1) / np.sqrt(count) / np.mean(W)
    low, high = np.log(np.array(found.interval["energy_J"]) / answer.energy_J)
    assert (-low, high) == pytest.approx((quantile * error, quantile * error), rel=0.1)


def test_equal_scans_have_the_band_of_one_whose_model_errs():
    one, _ = band_of_parts([5.0], error=0.1)
    three, _ = band_of_parts([5.0] * 3, error=0.1)
    assert three.contributions["energy_J"] == pytest.approx({"model": 1.0}, abs=1e-9)
    for name in NUMBERS:
        assert three.interval[name] == pytest.approx(one.interval[name], rel=2e-2), name


def test_equal_scans_under_a_preload_that_is_not_certain_have_the_interval_of_a_sphere():
    found, _ = band_of_parts([R_M] * 3, preload=0.3)
    ends = [
        numbers(*sphere_states(T=0.25 * MU * N, preload=N * np.exp(z * 0.3 / NORMAL_95)))
        for z in (-Z_90, Z_90)
    ]
    for name in NUMBERS:
        low, high = sorted(end[name] for end in ends)
        off = np.abs(np.log(np.array(found.interval[name]) / (low, high)))
        assert off.max() < 0.03 * np.log(high / low), name


@pytest.mark.long
@pytest.mark.parametrize("count", [2, 5])
def test_nine_intervals_in_ten_hold_the_mean_of_what_the_scans_were_drawn_from(count):
    """Spheres of any radius, a joint of all of them: the truth is that of 400 of them."""
    s = 0.3
    quantiles = 5.0 * np.exp(s * ndtri((np.arange(400) + 0.5) / 400))
    parts, settings = parts_of(quantiles)
    truth, damping = answer_of_parts(parts, settings)  # which neither number reads
    rng, holds = np.random.default_rng(7), []
    for _ in range(100):
        radii_m = 5.0 * np.exp(s * rng.standard_normal(count))
        found, _ = band_of_parts(radii_m, damping=damping)
        for name in ("energy_J", "tangential_stiffness_N_per_m"):
            low, high = found.interval[name]
            holds.append(low <= getattr(truth, name) <= high)
    assert 0.85 <= np.mean(holds) <= 0.95
