"""The plastic law of a pressed map and of caps, against finite elements of one sphere."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from test_contact_yielding_map import E as E_OF_METAL
from test_contact_yielding_map import metal_unloading

from capslip.analysis import analyze
from capslip.contact.material import composite
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.models.interacting import interacting
from capslip.contact.plastic_law import (
    ENERGY,
    RADIUS_95,
    SHARES,
    UNLOADING_95,
    LawError,
    _pairs_per_m,
    law_of_caps,
    law_of_map,
    with_law,
)
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.hertz import HertzCurve
from capslip.contact.solvers.metal import OVER_HARDNESS, parts_of
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.contact.solvers.withdrawn import withdrawn_together
from capslip.contact.solvers.yielding import YieldLaw
from capslip.problems import Problem
from capslip.settings import load_settings
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Scene, synthetic_surface
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


@pytest.mark.long
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
    assert pytest.approx(float(found.answer.tangential_stiffness_N_per_m), rel=0.05) == K
    assert pytest.approx(float(found.answer.energy_J), rel=0.15) == W
    assert {one.severity for one in said} <= {"info"}


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.mark.long
def test_a_map_that_stays_elastic_answers_as_it_did():
    load_N, _, _ = pressed(0.5)
    elastic, hard = (analysis_of(load_N, one) for one in (None, 1e10))
    assert hard.contact.errors.law is None
    assert hard.band.interval == elastic.band.interval
    assert "plastic_law" not in hard.band.contributions["energy_J"]
    assert hard.contact.errors == elastic.contact.errors
    assert "yielded" not in {one.code for one in hard.problems}
    assert "face with its hardness" in hard.verdict or "usable with care" in hard.verdict


@pytest.mark.long
def test_where_all_is_plastic_the_areas_agree_and_a_part_of_the_logarithm_is_open():
    load_N, hardness_Pa, _ = pressed(8.0)
    curve = boundary_elements(sphere(), E, preload_N=load_N, hardness_Pa=hardness_Pa)
    law = law_of_map(curve, load_N)
    assert abs(law.stiffness) < 0.003
    for share, ratio in zip(SHARES, (0.121, 0.204, 0.344, 0.468), strict=True):
        assert law.shift(share) == (-law.stiffness, -law.stiffness)
        assert law.half_95(share)[2, 1] == pytest.approx(-UNLOADING_95 * math.log(ratio), abs=0.02)


def law_alone(over, load_N, radius_m):
    """Return the law of caps that do not sink each other, whose curve is that of Hertz contacts."""
    withdrawal, _ = withdrawn_together(np.zeros_like(over), load_N, radius_m, SHARES)
    return law_of_caps(over, load_N, radius_m, None, withdrawal)


@pytest.mark.parametrize("over_hardness", FINITE_ELEMENTS)
def test_a_cap_that_yielded_is_expected_to_lose_what_finite_elements_do(over_hardness):
    """And so are two equal ones, whatever their size; one that stays elastic is Hertz's."""
    over, load_N, radius_m = np.array([over_hardness, 0.0]), np.array([3.0, 0.0]), np.ones(2)
    assert law_alone(0.5 * over / over_hardness, load_N, radius_m) is None
    law = law_alone(over, load_N, radius_m)
    of_energy, beyond = FINITE_ELEMENTS[over_hardness]
    for share, ratio in zip((0.25, 0.5, 0.75), of_energy, strict=True):
        assert law.shift(share)[1] == pytest.approx(math.log(ratio), rel=0.06)
        assert law.half_95(share)[2, 1] == pytest.approx(-UNLOADING_95 * law.shift(share)[1])
    of_hertz = 1.5 * (1.0 - 0.75 ** (2.0 / 3.0)) / 0.25  # displacement over that of the stiffness
    of_one = (1.0 + beyond * (of_hertz - 1.0)) / of_hertz
    assert law.shift(0.25)[0] == pytest.approx(math.log(of_one), abs=3e-3)
    again = law_alone(over[[0, 0]], 7.0 * load_N[[0, 0]], 2.0 * radius_m)
    assert np.array((again.energy, again.displacement)) == pytest.approx(
        np.array((law.energy, law.displacement)), abs=1e-6
    )


def test_a_wider_contact_is_stiffer_and_loses_less():
    """Of one: K as its radius, W as N^2 / (E* a)."""
    law = law_alone(np.array([1.5]), np.ones(1), np.ones(1))
    stiffer, less = law.half_95(0.1)[0]
    assert less == pytest.approx(RADIUS_95, rel=1e-3)
    assert stiffer == pytest.approx(RADIUS_95, rel=1e-3)
    assert law.shift(0.1)[0] == pytest.approx(law.displacement[0])
    none = law_alone(np.array([0.5, 0.7]), np.ones(2), np.ones(2)).half_95(0.1)[0]
    assert 0.0 < none[0] < 0.25 * RADIUS_95


UNLIKE = (
    (np.array((1.45, 1.3, 0.8, 0.5, 0.2)), np.array((9.0, 7.0, 2.0, 0.4, 0.05))),
    (np.array((3.4, 1.8, 1.5)), np.array((70.0, 16.0, 8.0))),
)


@pytest.mark.parametrize(("over", "load_N"), UNLIKE)
def test_unlike_contacts_of_metal_are_withdrawn_by_the_same(over, load_N):
    """Against each contact's own pressures by Abel's integral, and all of their sum looked up."""
    a_m = 1e-3 * np.cbrt(load_N)
    each = [
        metal_unloading(max(o, OVER_HARDNESS[0]), N, a)
        for o, N, a in zip(over, load_N, a_m, strict=True)
    ]
    x_m = np.linspace(0.0, max(e_m[-1] for e_m, *_ in each), 20001)
    drop_N = sum(np.interp(x_m, e_m, drop) for e_m, drop, _ in each)
    loss_J = sum(
        np.interp(x_m, e_m, loss) + 4.0 * np.maximum(x_m - e_m[-1], 0.0) * drop[-1]
        for e_m, drop, loss in each
    )
    withdrawal, loss = withdrawn_together(over, load_N, a_m, SHARES)
    at = np.array(SHARES) * load_N.sum()
    assert withdrawal / E_OF_METAL == pytest.approx(np.interp(at, drop_N, x_m), rel=2e-3)
    assert loss / E_OF_METAL == pytest.approx(np.interp(at, drop_N, loss_J), rel=0.01)
    # At the same share of its own load each would lose far less than finite elements say
    law = law_alone(over, load_N, a_m)
    of_each = [
        law_alone(*(np.array([v]) for v in one)) for one in zip(over, load_N, a_m, strict=True)
    ]
    own = [0.0 if one is None else one.shift(0.25)[1] for one in of_each]
    assert abs(law.shift(0.25)[1] - math.log(load_N @ np.exp(own) / load_N.sum())) > 0.1


def test_elastic_contacts_that_sink_each_other_are_those_of_interacting_caps():
    rng = np.random.default_rng(3)
    x_m, y_m = rng.uniform(0.0, 0.03, (2, 12))
    depth_m, radius_m = np.append(0.0, rng.uniform(0.0, 3e-7, 11)), rng.uniform(5.0, 30.0, 12)
    curve = interacting(radius_m, depth_m, x_m, y_m, E)
    d = curve.approach_m(300.0)
    load_N = curve.asperity_loads_N(d)
    a_m = np.cbrt(0.75 * load_N * radius_m / E)
    pair_per_m = E * curve.pair_compliance_m_per_N
    withdrawal, loss = withdrawn_together(np.zeros(12), load_N, a_m, SHARES, pair_per_m)
    drop_N = np.array(SHARES) * 300.0
    assert withdrawal / E == pytest.approx(curve.withdrawal_m(d, drop_N), rel=1e-4)
    assert loss / E == pytest.approx(curve.loss_integral_at_drop_J(d, drop_N), rel=2e-3)


@pytest.mark.long
def test_a_map_of_unlike_spheres_loses_what_contacts_of_metal_lose_together():
    """One heavy contact that has yielded and two light ones, each of the area that the map has."""
    pixel_m, a_m = 1e-6, 20e-6
    y_m, x_m = (np.mgrid[:100, :200] + 0.3) * pixel_m
    at_m = np.array(((50e-6, 45e-6, 0.0), (60e-6, 120e-6, 22e-9), (30e-6, 170e-6, 26e-9)))
    spheres = [-(np.square(y_m - y) + np.square(x_m - x)) / (2 * R_M) - h for y, x, h in at_m]
    surface = HeightMap(np.max(spheres, axis=0), (pixel_m, pixel_m))
    load_N = 4.0 * E * a_m**3 / (3.0 * R_M)
    hardness_Pa = 1.5 * load_N / (math.pi * a_m**2) / 1.4
    found = boundary_elements(surface, E, preload_N=load_N, hardness_Pa=hardness_Pa)
    curve = replace(found, as_solved=True)
    pressed_map = curve.pressed(load_N)
    each_N = pressed_map.region_loads_N
    over = (
        pressed_map.sum_over_regions(pressed_map.pressure_Pa * pressed_map.over_hardness) / each_N
    )
    assert each_N.size == 3
    assert over.max() > 1.0
    assert np.median(over) < 0.8
    x_m, y_m = (
        pressed_map.sum_over_regions(pressed_map.pressure_Pa * one) / each_N for one in (x_m, y_m)
    )
    apart_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    np.fill_diagonal(apart_m, np.inf)
    radius_m = pixel_m * np.sqrt(pressed_map.region_pixels / math.pi)
    given = over, each_N, radius_m, (0.25, 0.5, 0.75), 1.0 / (math.pi * apart_m)
    _, loss = withdrawn_together(*given)
    drop_N = np.array((0.25, 0.5, 0.75)) * load_N
    of_map_J = curve.loss_integral_at_drop_J(curve.approach_m(load_N), drop_N)
    assert loss / E == pytest.approx(of_map_J, rel=0.06)
    of_hertz = withdrawn_together(np.zeros(3), *given[1:])[1]
    assert (of_hertz / E > 1.1 * of_map_J).all()


@pytest.mark.long
@pytest.mark.parametrize("model", ["interacting", "caps"])
def test_the_interval_of_caps_that_yield_lies_where_metal_loses(model):
    """Whoever chose the caps: less energy than that of Hertz contacts, and as much as is stated."""
    scene = Scene(shape=(100, 150), pixel_size_m=(4e-4, 4e-4), families=PAPER, seed=1)
    surface, _ = synthetic_surface(scene)
    given = "material.hardness_Pa=5e6", f"contact.model={model}"
    found = analyze(surface, load_settings(overrides=given))
    law = found.contact.moved.law
    share = found.answer.slip_force_N / float(found.slip.total_slip_force_N)
    less, (*_, (_, half)) = law.shift(share)[1], law.half_95(share)
    assert -0.3 < less < -0.05
    assert half == pytest.approx(UNLOADING_95 * abs(less))
    low, high = found.band.interval["energy_J"]
    of_hertz_J = found.answer.energy_J
    if model == "interacting":
        assert low < math.exp(less) * of_hertz_J < high
        assert low < math.exp(less - 0.8 * half) * of_hertz_J
        assert high == of_hertz_J
    assert found.band.contributions["energy_J"]["plastic_law"] > 0.1


@pytest.mark.long
def test_contacts_count_each_by_its_own_pressure():
    """Of two spheres, one far below yield, half the load is as unsure as of the other alone."""
    load_N, hardness_Pa, _ = pressed(1.4)
    curve = boundary_elements(sphere(), E, preload_N=load_N, hardness_Pa=hardness_Pa)
    one = law_of_map(curve, load_N)
    wide = HeightMap(np.hstack((sphere().height_m, sphere().height_m / 4.0)), (PIXEL_M, PIXEL_M))
    both = boundary_elements(wide, E, preload_N=2 * load_N, hardness_Pa=hardness_Pa)
    assert 0.0 < law_of_map(both, 2 * load_N).stiffness < one.stiffness


def test_it_is_said_what_the_answers_hold_of_it():
    law = LawError(0.1, (0.0,) * 4, (0.0,) * 4, (0.4, 0.2, 0.1, 0.1))
    yielded = Problem("yielded", "info", "72% has yielded")
    other = Problem("one_contact", "warning", "one")
    for tolerance in (0.1, 0.2):
        first, said = with_law([other, yielded], law, 0.25, tolerance)
        assert (first, said.severity) == (other, "info")
        assert said.message.startswith("72% has yielded; ")
        assert "stiffness by 11 %" in said.message
        assert "energy at 25 % of gross slip by 9.5 %, which the answers hold" in said.message
    assert with_law([other], law, 0.25, 0.2) == [other]
    (_, near) = with_law([other], law, 0.25, 0.1)
    assert near.severity == "info"
    assert "near the hardness" in near.message
    assert with_law([other, yielded], None, 0.25, 0.01) == [other, yielded]


# Elastic tops r^n: pressures whose mean, weighed by them, is 0.75 p0 of a sphere of this p0 / H,
# over that of the sphere whose heights have the same rms in the contact
TOPS = {
    1: math.log(2.0) / 0.75 / (8.0 * math.sqrt(3.0) / math.pi / math.sqrt(18.0)),
    2: 1.0,
    4: (64.0 / (15.0 * math.pi) * 1.25 / 1.2 / 0.75)
    / (8.0 * math.sqrt(3.0) / math.pi * math.sqrt(4.0 / 45.0)),
}


def top_of(power, E_over_H):
    """Return a top 40 pixels wide and as high as its contact there, with a load and a hardness."""
    at = np.abs((np.arange(64) - 31.6) / 20.0)
    r = np.hypot(at[:, None], at)
    return HeightMap(-PIXEL_M * r**power, (PIXEL_M, PIXEL_M)), E / E_over_H


@pytest.mark.long
@pytest.mark.parametrize("power", TOPS)
def test_how_blunt_a_top_is_tells_the_closed_form(power):
    surface, hardness_Pa = top_of(power, {1: 40.0, 2: 30.0, 4: 15.0}[power])
    face = elastic_face(surface, E)
    state = press(face, approach_m=PIXEL_M * {1: 1.57, 2: 2.0, 4: 8 / 3}[power], tolerance=1e-8)
    parts = parts_of(replace(face, hardness_Pa=1e3 * E), state)
    assert parts.blunt == pytest.approx([TOPS[power]], rel=0.03)
    # It yields: a blunter top is expected to lose less than the map says, a pointed one more
    load_N = state.load_N
    curve = boundary_elements(surface, E, preload_N=load_N, hardness_Pa=hardness_Pa)
    law = law_of_map(curve, load_N)
    over = curve.pressed(load_N).over_hardness.max()
    assert over > 1.2
    alike = np.log([np.interp(over, OVER_HARDNESS, row) for row in ENERGY])
    of_form = np.array(law.energy) - np.array(law.displacement)
    if power == 2:
        assert np.abs(of_form).max() < 0.02
        assert law.left_open == pytest.approx(-UNLOADING_95 * alike, rel=0.02)
    else:
        assert (np.sign(of_form) == (1 if power == 1 else -1)).all()
        assert np.abs(of_form).min() > 0.02
        assert (law.left_open > -UNLOADING_95 * alike).all()


@pytest.mark.parametrize("pixels", [1.2, 1.6, 2.5])
def test_few_pixels_do_not_tell_how_blunt_a_sphere_is(pixels):
    """They seemed anything from a third to three, wherever the pixels lie."""
    a_m = pixels * PIXEL_M
    load_N = 4.0 * E * a_m**3 / (3.0 * R_M)
    hardness_Pa = 1.5 * load_N / (math.pi * a_m**2) / 0.9
    for aside in ((0.0, 0.0), (0.5, 0.5), (0.5, 0.1), (0.3, 0.2)):
        y_m, x_m = (np.square((np.arange(15) - 7 + one) * PIXEL_M) for one in aside)
        surface = HeightMap(-(y_m[:, None] + x_m) / (2 * R_M), (PIXEL_M, PIXEL_M))
        face = elastic_face(surface, E)
        state = press(face, load_N=load_N, tolerance=1e-8)
        found = parts_of(replace(face, hardness_Pa=hardness_Pa), state)
        assert found.blunt == pytest.approx(np.ones(1), abs=0.15), aside


@pytest.mark.long
def test_what_areas_move_counts_as_contacts_are_withdrawn_together():
    """Light contacts that have not yielded lose most: wider heavy ones leave them less to lose."""
    load_N, hardness_Pa, _ = pressed(1.4)
    tops = [sphere().height_m, sphere().height_m / 2.0 - 1.2e-8, sphere().height_m / 3.0 - 1.5e-8]
    surface = HeightMap(np.hstack(tops), (PIXEL_M, PIXEL_M))
    curve = boundary_elements(surface, E, preload_N=1.5 * load_N, hardness_Pa=hardness_Pa)
    law = law_of_map(curve, 1.5 * load_N)
    displacement, energy = law.shift(0.25)
    assert law.stiffness > 0.0
    assert displacement < 0.0
    assert energy < 1.2 * displacement
    of_radius = law.half_95(0.25)[0]
    assert of_radius == pytest.approx(0.7 * np.abs((displacement, energy)), rel=0.05)


def nested(n=41):
    """Return a round top within a ring, and two ridges side by side."""
    y, x = (np.mgrid[:n, :n] - (n - 1) / 2) * PIXEL_M
    r = np.hypot(x, y)
    ring = -np.minimum(np.square(r), np.square(r - 12 * PIXEL_M)) / 1e-3
    ridges = -np.square(np.abs(x) - 4 * PIXEL_M) / 1e-3 - np.square(y) / 5e-2
    return {"ring": ring, "ridges": ridges}


@pytest.mark.long
@pytest.mark.parametrize(("name", "load_N", "off"), [("ring", 0.1, 0.05), ("ridges", 0.06, 0.3)])
def test_contacts_one_within_another_sink_each_other_as_their_half_space_does(name, load_N, off):
    """By their middles a ring is where what it surrounds is, and ridges bear as points do."""
    surface = HeightMap(nested()[name], (PIXEL_M, PIXEL_M))
    curve = boundary_elements(surface, E, preload_N=load_N, hardness_Pa=3e8)
    state = curve.pressed(load_N)
    assert len(state.region_loads_N) == 2
    found = _pairs_per_m(state, np.arange(2))
    one = np.where(state.region == 1, state.pressure_Pa, 0.0)
    sunk_m = curve.solutions.face.half_space.sinking_m(one)
    beside = state.sum_over_regions(state.pressure_Pa * sunk_m)[1] / state.region_loads_N.prod()
    assert found[0, 1] == found[1, 0] == pytest.approx(E * beside, rel=off)
    law = law_of_map(curve, load_N)
    assert 0.0 < law.stiffness < 0.12
    assert np.isfinite([*law.shift(0.25), *law.half_95(0.25).ravel()]).all()
