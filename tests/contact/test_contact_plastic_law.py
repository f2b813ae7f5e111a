"""The plastic law of a pressed map and of caps, against finite elements of one sphere."""

import math
from functools import cache

import numpy as np
import pytest

from capslip.analysis import analyze
from capslip.contact.material import composite
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.plastic_law import (
    SHARES,
    UNLOADING_95,
    LawError,
    law_of_caps,
    law_of_map,
    with_law,
)
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.hertz import HertzCurve
from capslip.contact.solvers.yielding import YieldLaw
from capslip.problems import Problem
from capslip.settings import load_settings
from capslip.surface.heightmap import HeightMap

R_M, PIXEL_M, POINTS, A_M, MU = 8e-3, 1e-6, 61, 12e-6, 0.2
STEEL = composite((200e9, 200e9), (0.3, 0.3))
E = STEEL.E_star_Pa


def sphere():
    at_m = np.square((np.arange(POINTS) - POINTS // 2 + 0.3) * PIXEL_M)
    return HeightMap(-(at_m[:, None] + at_m) / (2 * R_M), (PIXEL_M, PIXEL_M))


def pressed(over_hardness):
    """Return load, hardness and flattened radius of a cap of 12 pixels, by its elastic p0 / H."""
    a_m = A_M
    for _ in range(60):
        load_N = np.array([4 * E * a_m**3 / (3 * R_M)])
        hardness_Pa = float(1.5 * load_N[0] / (math.pi * a_m**2)) / over_hardness
        flat_m, _ = YieldLaw(hardness_Pa, E, 0.3).flattened(load_N, np.array([R_M]))
        a_m *= A_M / (0.75 * load_N[0] * flat_m[0] / E) ** (1 / 3)
    return float(load_N[0]), hardness_Pa, float(flat_m[0])


@cache
def analysis_of(load_N, hardness_Pa, *more):
    given = (
        f"contact.preload_N={load_N}",
        f"material.friction_coefficient={MU}",
        "material.youngs_modulus_Pa=[200e9,200e9]",
        "material.poisson_ratio=[0.3,0.3]",
        "contact.model=boundary_elements",
        "contact.bulk=true",
        "contact.alignment=as_levelled",
        "conditioning.form=none",
        *(() if hardness_Pa is None else (f"material.hardness_Pa={hardness_Pa}",)),
        *more,
    )
    return analyze(sphere(), load_settings(overrides=given))


# By finite elements of a sphere, over a Hertz contact of the same load and radius: W at 0.25, 0.5
# and 0.75 mu N, and how much displacement there is beyond that of the stiffness at 0.25
FINITE_ELEMENTS = {
    0.839: ((0.867, 0.843, 0.823), 0.88),
    1.244: ((0.558, 0.612, 0.655), 0.56),
    1.961: ((0.397, 0.482, 0.547), 0.35),
    3.931: ((0.224, 0.347, 0.451), 0.19),
}


@pytest.mark.parametrize("over_hardness", FINITE_ELEMENTS)
def test_the_interval_of_a_map_that_yields_holds_finite_elements(over_hardness):
    load_N, hardness_Pa, flat_m = pressed(over_hardness)
    found = analysis_of(load_N, hardness_Pa)
    cap = HertzCurve("caps", np.ones(1), np.array([flat_m]), np.zeros(1), E)
    slip = slip_curve(cap, load_N, MU, STEEL.kappa)
    (of_W, *_), of_displacement = FINITE_ELEMENTS[over_hardness]
    T = found.answer.slip_force_N
    stuck_m = T / slip.tangential_stiffness_N_per_m
    K = T / (stuck_m + of_displacement * (float(slip.displacement_m(T)) - stuck_m))
    W = of_W * float(slip.energy_at_force_J(T))
    for name, value in (("tangential_stiffness_N_per_m", K), ("energy_J", W)):
        low, high = found.band.interval[name]
        assert low <= value <= high, name
        assert high / low < 2.5
    assert found.band.contributions["energy_J"]["plastic_law"] > 0.1
    said = [one for one in found.problems if one.code == "yielded"]
    K_of_map = float(found.answer.tangential_stiffness_N_per_m)
    warned = bool(said) and said[0].severity == "warning"
    assert warned == (K / K_of_map > 1.05)


@pytest.mark.parametrize("over_hardness", FINITE_ELEMENTS)
def test_a_map_that_yields_loses_what_finite_elements_do(over_hardness):
    """Of contacts of the radius that it has."""
    load_N, hardness_Pa, _ = pressed(over_hardness)
    curve = boundary_elements(sphere(), E, preload_N=load_N, hardness_Pa=hardness_Pa)
    slip = slip_curve(curve, load_N, MU, STEEL.kappa)
    a_m = slip.tangential_stiffness_N_per_m * STEEL.kappa / (2.0 * E)
    flat_m = 4.0 * E * a_m**3 / (3.0 * load_N)
    hertz = HertzCurve("caps", np.ones(1), np.array([flat_m]), np.zeros(1), E)
    T = MU * load_N * np.array((0.25, 0.5, 0.75))
    of_hertz_J = slip_curve(hertz, load_N, MU, STEEL.kappa).energy_at_force_J(T)
    off = slip.energy_at_force_J(T) / of_hertz_J / FINITE_ELEMENTS[over_hardness][0] - 1.0
    assert np.abs(off)[1:].max() < 0.05
    assert abs(off[0]) < 0.12


def test_at_a_given_displacement_force_and_energy_move_as_the_curve_does():
    load_N, hardness_Pa, _ = pressed(1.961)
    asked = analysis_of(load_N, hardness_Pa)
    e_m, T = asked.answer.displacement_m, asked.answer.slip_force_N
    found = analysis_of(load_N, hardness_Pa, f"answer.displacement_m={e_m}")
    stiffer = math.exp(asked.contact.errors.law.stiffness)
    low, high = found.band.interval["slip_force_N"]
    assert found.answer.slip_force_N == pytest.approx(T, rel=1e-6)
    assert T < stiffer * T <= 1.05 * high  # nearly all sticks yet
    low, high = found.band.interval["energy_J"]
    assert low <= stiffer * asked.answer.energy_J <= high


def test_a_map_that_stays_elastic_answers_as_it_did():
    load_N, _, _ = pressed(0.5)
    elastic, hard = (analysis_of(load_N, one) for one in (None, 1e10))
    assert hard.contact.errors.law is None
    assert hard.band.interval == elastic.band.interval
    assert "plastic_law" not in hard.band.contributions["energy_J"]
    assert hard.contact.errors == elastic.contact.errors
    assert "yielded" not in {one.code for one in hard.problems}
    assert "face with its hardness" in hard.verdict or "usable with care" in hard.verdict


def test_where_all_is_plastic_the_areas_agree_and_a_part_of_the_logarithm_is_open():
    load_N, hardness_Pa, _ = pressed(8.0)
    curve = boundary_elements(sphere(), E, preload_N=load_N, hardness_Pa=hardness_Pa)
    law = law_of_map(curve, load_N)
    assert abs(law.stiffness) < 0.003
    for share, ratio in zip(SHARES, (0.121, 0.204, 0.344, 0.468), strict=True):
        assert law.shift(share) == (-law.stiffness, -law.stiffness)
        assert law.half_95(share)[2, 1] == pytest.approx(-UNLOADING_95 * math.log(ratio), abs=0.02)


def test_caps_that_yielded_are_expected_to_lose_what_finite_elements_do():
    """Each by its own p0 / H, and by the load on it."""
    over, load_N = np.array((0.3, 1.244)), np.array((3.0, 1.0))
    assert law_of_caps(over[:1], load_N[:1], 1.0) is None
    law = law_of_caps(over, load_N, 0.5)
    (at_a_quarter, at_a_half, _), beyond = FINITE_ELEMENTS[1.244]
    for share, ratio in ((0.25, at_a_quarter), (0.5, at_a_half)):
        assert law.shift(share)[1] == pytest.approx(math.log(0.75 + 0.25 * ratio), abs=1e-3)
    of_hertz = 1.5 * (1.0 - 0.75 ** (2.0 / 3.0)) / 0.25  # displacement over that of the stiffness
    of_one = (1.0 + beyond * (of_hertz - 1.0)) / of_hertz
    expected = 0.5 * math.log(0.75 + 0.25 * of_one)
    assert law.shift(0.25)[0] == pytest.approx(expected, abs=3e-4)


def test_contacts_count_each_by_its_own_pressure():
    """Of two spheres, one far below yield, half the load is as unsure as of the other alone."""
    load_N, hardness_Pa, _ = pressed(1.4)
    curve = boundary_elements(sphere(), E, preload_N=load_N, hardness_Pa=hardness_Pa)
    one = law_of_map(curve, load_N)
    wide = HeightMap(np.hstack((sphere().height_m, sphere().height_m / 4.0)), (PIXEL_M, PIXEL_M))
    both = boundary_elements(wide, E, preload_N=2 * load_N, hardness_Pa=hardness_Pa)
    assert 0.0 < law_of_map(both, 2 * load_N).stiffness < one.stiffness


def test_it_is_said_where_it_counts():
    law = LawError(0.1, (0.0,) * 4, (0.0,) * 4, (0.4, 0.2, 0.1, 0.1), "it touches more")
    yielded = Problem("yielded", "info", "72% has yielded")
    other = Problem("one_contact", "warning", "one")
    for tolerance, severity in ((0.1, "warning"), (0.2, "info")):
        first, said = with_law([other, yielded], law, 0.25, tolerance)
        assert (first, said.severity) == (other, severity)
        assert said.effect.tangential_stiffness == pytest.approx(math.expm1(0.1))
        assert said.effect.energy == pytest.approx(-math.expm1(-0.1))
        assert "by 11 %" in said.message
    assert with_law([other], law, 0.25, 0.2) == [other]
    (_, near) = with_law([other], law, 0.25, 0.1)
    assert "near the hardness" in near.message
    assert with_law([other, yielded], None, 0.25, 0.01) == [other, yielded]
