"""What the plastic law of a pressed map leaves open: one sphere against the law of caps."""

import math
from functools import cache

import numpy as np
import pytest

from capslip.analysis import analyze
from capslip.contact.material import composite
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.plastic_law import SHARES, LawError, law_of_map, with_law
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


@pytest.mark.parametrize("over_hardness", [1.1, 1.4, 4.0])
def test_the_interval_of_a_map_that_yields_holds_the_caps_of_finite_elements(over_hardness):
    load_N, hardness_Pa, flat_m = pressed(over_hardness)
    found = analysis_of(load_N, hardness_Pa)
    cap = HertzCurve("caps", np.ones(1), np.array([flat_m]), np.zeros(1), E)
    slip = slip_curve(cap, load_N, MU, STEEL.kappa)
    T = found.answer.slip_force_N
    K, W = T / float(slip.displacement_m(T)), float(slip.energy_at_force_J(T))
    low, high = found.band.interval["tangential_stiffness_N_per_m"]
    assert low <= K <= high
    assert found.answer.tangential_stiffness_N_per_m < K or over_hardness > 2.0
    low, high = found.band.interval["energy_J"]
    assert low <= W <= high
    # Of a sphere of many pixels the law is what is open
    assert found.band.contributions["energy_J"]["plastic_law"] > 0.9
    (said,) = (one for one in found.problems if one.code == "yielded")
    assert said.severity == (
        "warning" if K / found.answer.tangential_stiffness_N_per_m > 1.05 else "info"
    )
    assert said.effect.energy == said.effect.loss_factor
    # To the caps in the stiffness, half way in the energy
    middle = math.sqrt(W / found.answer.energy_J)
    assert abs(middle - 1.0) == pytest.approx(said.effect.energy, abs=0.06 * middle)


def test_at_a_given_displacement_force_and_energy_move_as_the_curve_does():
    load_N, hardness_Pa, flat_m = pressed(1.4)
    e_m = analysis_of(load_N, hardness_Pa).answer.displacement_m
    found = analysis_of(load_N, hardness_Pa, f"answer.displacement_m={e_m}")
    cap = HertzCurve("caps", np.ones(1), np.array([flat_m]), np.zeros(1), E)
    slip = slip_curve(cap, load_N, MU, STEEL.kappa)
    T = float(slip.force_N(e_m))
    low, high = found.band.interval["slip_force_N"]
    assert found.answer.slip_force_N < T <= high
    low, high = found.band.interval["energy_J"]
    assert low <= float(slip.energy_at_force_J(T)) <= high


def test_a_map_that_stays_elastic_answers_as_it_did():
    load_N, _, _ = pressed(0.5)
    elastic, hard = (analysis_of(load_N, one) for one in (None, 1e10))
    assert hard.contact.errors.law is None
    assert hard.band.interval == elastic.band.interval
    assert "plastic_law" not in hard.band.contributions["energy_J"]
    assert hard.contact.errors == elastic.contact.errors
    assert "yielded" not in {one.code for one in hard.problems}
    assert "face with its hardness" in hard.verdict or "usable with care" in hard.verdict


def test_where_all_is_plastic_the_areas_agree_and_the_energies_are_those_of_flat_punches():
    """W over that of Hertz, by Abel's equation: 0.199, 0.352 and 0.481 at these forces."""
    load_N, hardness_Pa, _ = pressed(8.0)
    curve = boundary_elements(sphere(), E, preload_N=load_N, hardness_Pa=hardness_Pa)
    law = law_of_map(curve, load_N)
    assert abs(law.stiffness) < 0.003
    for share, ratio in zip(SHARES[1:], (0.199, 0.352, 0.4815), strict=True):
        assert law.shift(share)[1] == pytest.approx(-0.5 * math.log(ratio), abs=0.01)
    assert law.shift(0.02)[1] == pytest.approx(-0.5 * math.log(0.0183), abs=0.1)


def test_contacts_count_each_by_its_own_pressure():
    """Of two spheres, one far below yield, half the load is as unsure as of the other alone."""
    load_N, hardness_Pa, _ = pressed(1.4)
    curve = boundary_elements(sphere(), E, preload_N=load_N, hardness_Pa=hardness_Pa)
    one = law_of_map(curve, load_N)
    wide = HeightMap(np.hstack((sphere().height_m, sphere().height_m / 100.0)), (PIXEL_M, PIXEL_M))
    both = boundary_elements(wide, E, preload_N=2 * load_N, hardness_Pa=hardness_Pa)
    assert 0.0 < law_of_map(both, 2 * load_N).stiffness < one.stiffness


def test_it_is_said_where_it_counts():
    law = LawError(0.1, (0.0, 0.02, 0.04, 0.06), (0.4, 0.2, 0.1, 0.1))
    yielded = Problem("yielded", "info", "72% has yielded")
    other = Problem("one_contact", "warning", "one")
    for tolerance, severity in ((0.1, "warning"), (0.2, "info")):
        first, said = with_law([other, yielded], law, 0.25, tolerance)
        assert (first, said.severity) == (other, severity)
        assert said.effect.tangential_stiffness == pytest.approx(math.expm1(0.1))
        assert said.effect.energy == pytest.approx(math.expm1(0.1))
        assert "by 11 %" in said.message
    assert with_law([other], law, 0.25, 0.2) == [other]
    (_, near) = with_law([other], law, 0.25, 0.1)
    assert "near the hardness" in near.message
    assert with_law([other, yielded], None, 0.25, 0.01) == [other, yielded]
