"""The law per area is the theorem per area: closed forms of equal spheres, and slip curves."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.contact.joint import Joint
from capslip.contact.material import composite
from capslip.contact.models.caps import caps
from capslip.contact.models.families import families
from capslip.contact.rung import rung
from capslip.contact.scaled import ScaledCurve
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.contact.solvers.yielding import YieldLaw
from capslip.errors import ContactError
from capslip.structure import beds
from capslip.structure.band_state import Part
from capslip.structure.interpolation import LawTables, tables_of
from capslip.structure.law import SCATTERS, SHARES, SHARES_OF_SCANS, law
from capslip.structure.law import _patch as of_factor

AREA_M2, MU, LOAD_N = 2.4e-3, 0.2, 460.0
STEEL = composite((200e9, 200e9), (0.3, 0.3))
RADIUS_M, COUNT = 25.0, 7


def part_of(curve, name="families", joint=None, hardness=None, after=None, share=1.0, kappa=None):
    """Return a part; its kappa may be a function of the load."""
    along, kappa = (kappa, kappa(LOAD_N)) if callable(kappa) else (None, kappa)
    state = SimpleNamespace(
        curve=curve,
        curve_after=after or (lambda load_N: curve),
        at_level=None,  # it lies alike under all pressures
        lacks_level=lambda _: False,
        hardness_Pa=hardness,
        rung=replace(rung(name), least_share=None, at_forces=None),  # its curve is one of caps
        composite=STEEL if kappa is None else replace(STEEL, kappa=kappa),
        bulk=False,
        model=curve.model,
        estimated_error=0.03,
    )

    def of_patch(load_N):
        own = state.composite if along is None else replace(STEEL, kappa=along(load_N))
        changed = {"curve": state.curve_after(load_N), "composite": own}
        return SimpleNamespace(**(vars(state) | changed))

    state.of_patch = of_patch
    whole = np.array([LOAD_N]), np.ones(1)
    joint = joint or Joint(AREA_M2, AREA_M2, LOAD_N, *whole, LOAD_N)
    return Part(joint, state, share)


def law_of(curve, *about, holds=None, **more):
    return law([part_of(curve, *about, **more)], MU, holds)


@pytest.fixture(scope="module")
def of_spheres():
    return law_of(families(COUNT, RADIUS_M, 0.0, STEEL.E_star_Pa))


def mindlin(p, delta, radius_m=RADIUS_M):
    """Return d, k_n, tau and w per area of equal spheres: Hertz, and Mindlin and Deresiewicz."""
    N = p * AREA_M2 / COUNT
    a = np.cbrt(3 * N * radius_m / (4 * STEEL.E_star_Pa))
    d = a**2 / radius_m
    T = MU * N * (1 - np.maximum(1 - delta / (MU * STEEL.kappa * d), 0) ** 1.5)
    q = np.cbrt(1 - T / (MU * N)) ** 2  # 1 - delta / delta_lim
    # Mindlin and Deresiewicz 1953, with k_t = 2 E* a / kappa
    limit = MU * STEEL.kappa * d
    share = T / (MU * N)
    W = 4 * MU * N * limit * (0.6 * (1 - (1 - share) ** (5 / 3)) - 0.5 * share * (1 + q)) * 2
    per_area = COUNT / AREA_M2
    return d, 2 * STEEL.E_star_Pa * a * per_area, T * per_area, W * per_area


def test_equal_spheres_have_closed_forms(of_spheres):
    found = of_spheres
    p = found.pressure_Pa[:, None]
    d, k_n, tau, w = mindlin(p, found.displacement_m)
    np.testing.assert_allclose(found.closure_m, d[:, 0], rtol=1e-12)
    np.testing.assert_allclose(found.normal_stiffness_Pa_per_m, k_n[:, 0], rtol=1e-12)
    np.testing.assert_allclose(
        found.tangential_stiffness_Pa_per_m, k_n[:, 0] / STEEL.kappa, rtol=1e-12
    )
    np.testing.assert_allclose(found.shear_Pa, tau, rtol=1e-10)
    # The closed form cancels at small slip
    some = tau[0] > 0.1 * MU * p[0]
    np.testing.assert_allclose(found.loss_J_per_m2[:, some], w[:, some], rtol=1e-9)
    assert found.pressure_Pa[0] == pytest.approx(0.01 * LOAD_N / AREA_M2)
    assert found.pressure_Pa[-1] == pytest.approx(np.sqrt(10.0) * LOAD_N / AREA_M2)
    at = found.at_scan_pressure
    assert found.pressure_Pa[at] == pytest.approx(LOAD_N / AREA_M2, rel=1e-12)


CURVES = {
    "spheres": families(COUNT, RADIUS_M, 0.0, STEEL.E_star_Pa),
    "two families": families((5, 18), (23.8, 26.7), (0, 2.4e-7), STEEL.E_star_Pa),
    "many heights": caps(
        np.full(200, 5e-3),
        -np.random.default_rng(3).exponential(1e-6, 200),
        STEEL.E_star_Pa,
    ),
}


@cache
def elastic_law(name):
    """Return the law of a curve as it is, which several tests compare with."""
    return law_of(CURVES[name])


@pytest.mark.parametrize("name", CURVES)
def test_tables_give_any_pressure_and_displacement(name):
    curve, found = CURVES[name], elastic_law(name)
    tables = LawTables(found.tables())
    pressures = np.exp(np.random.default_rng(100).uniform(*np.log(found.range_Pa), 40))
    for p in pressures:
        slip = slip_curve(ScaledCurve(curve, 1 / AREA_M2), p, MU, STEEL.kappa)
        delta = np.geomspace(0.05, 3.0, 60) * slip.total_slip_displacement_m
        np.testing.assert_allclose(tables.shear_Pa(delta, p), slip.force_N(delta), rtol=4e-3)
        np.testing.assert_allclose(-tables.shear_Pa(-delta, p), slip.force_N(delta), rtol=4e-3)
        np.testing.assert_allclose(tables.loss_J_per_m2(delta, p), slip.energy_J(delta), rtol=0.05)
        touch_m = float(slip.curve.touch_m)
        assert tables.closure_m(p) == pytest.approx(slip.approach_m - touch_m, rel=1e-4)
        stiffness = float(slip.curve.stiffness_N_per_m(slip.approach_m))
        assert tables.normal_stiffness_Pa_per_m(p) == pytest.approx(stiffness, rel=3e-3)
    assert found.shear_error < 4e-3
    assert found.loss_error < 0.05


def test_one_kind_of_sphere_between_the_points(of_spheres):
    tables = LawTables(of_spheres.tables())
    p = np.geomspace(*of_spheres.range_Pa, 50)[:, None]
    d = mindlin(p, 0.0)[0]
    delta = np.linspace(0.1, 0.999, 40) * MU * STEEL.kappa * d
    _, k_n, tau, w = mindlin(p, delta)
    np.testing.assert_allclose(tables.shear_Pa(delta, p), tau, rtol=3e-4)
    np.testing.assert_allclose(tables.loss_J_per_m2(delta, p), w, rtol=2e-3)
    np.testing.assert_allclose(
        tables.tangential_stiffness_Pa_per_m(p), k_n / STEEL.kappa, rtol=1e-3
    )
    small = tables.loss_J_per_m2(1e-6 * d, p) / tables.loss_J_per_m2(1e-7 * d, p)
    np.testing.assert_allclose(small, 1e3, rtol=1e-3)
    for outside in (0.9 * p.min(), 1.1 * p.max()):
        with pytest.raises(ValueError, match="pressure_Pa: got"):
            tables.shear_Pa(1e-9, outside)


def test_elements_of_each_pressure_are_the_backbone(of_spheres):
    found = of_spheres
    for i, elements in enumerate(found.elements):
        delta = found.displacement_m[i, found.displacement_m[i] >= elements.smallest_displacement_m]
        k = slice(-len(delta), None)
        force, energy = elements.force_N(delta), elements.energy_J(delta)
        np.testing.assert_allclose(energy, found.loss_J_per_m2[i, k], rtol=0.02)
        np.testing.assert_allclose(force, found.shear_Pa[i, k], rtol=0.005)
        k_t = found.tangential_stiffness_Pa_per_m[i]
        assert elements.stiffness_N_per_m.sum() == pytest.approx(k_t, rel=1e-9)
        assert elements.slip_force_N.sum() == pytest.approx(MU * found.pressure_Pa[i], rel=1e-9)


def test_pressures_end_at_the_cut():
    curve = CURVES["two families"]
    closure_m = elastic_law("two families").closure_m
    most = 1.0001 * elastic_law("two families").pressure_Pa[-2] * AREA_M2 / LOAD_N
    found = law_of(curve, holds=lambda factor: factor < most)
    np.testing.assert_array_equal(found.closure_m, closure_m[:-1])
    assert "no cap of the curve" in found.ends
    shallow = law_of(
        curve, holds=lambda _: False
    )  # the pressure of the scan is answered for elsewhere
    assert shallow.pressure_Pa[-1] == pytest.approx(LOAD_N / AREA_M2)


def test_the_law_does_not_know_the_size_of_the_joint(of_spheres):
    joint = Joint(1.0, AREA_M2, 5e5, np.array([LOAD_N]), np.array([1 / AREA_M2]), LOAD_N)
    found = law_of(CURVES["spheres"], joint=joint)
    np.testing.assert_allclose(found.loss_J_per_m2, of_spheres.loss_J_per_m2, rtol=1e-14)


def test_without_an_area_there_is_no_law():
    whole = np.array([LOAD_N]), np.ones(1)
    with pytest.raises(ContactError, match="scanned area"):
        law_of(CURVES["spheres"], joint=Joint(None, None, LOAD_N, *whole, LOAD_N))


def test_a_map_is_solved_under_few_pressures():
    """Spheres taken for solutions: the cubic between ten pressures is that of the curve."""
    found = law_of(CURVES["spheres"], name="boundary_elements")
    assert len(found.pressure_Pa) == 10
    assert "10 pressures" in found.ends
    steps = np.diff(np.log(found.pressure_Pa))
    np.testing.assert_allclose(steps / steps[2], [0.5, 0.5, *[1.0] * 5, 0.5, 0.5])
    tables = LawTables(found.tables())
    p = np.geomspace(*found.range_Pa, 30)[:, None]
    d = mindlin(p, 0.0)[0]
    delta = np.linspace(0.1, 0.999, 30) * MU * STEEL.kappa * d
    np.testing.assert_allclose(tables.shear_Pa(delta, p), mindlin(p, delta)[2], rtol=1e-3)
    np.testing.assert_allclose(tables.loss_J_per_m2(delta, p), mindlin(p, delta)[3], rtol=5e-3)


def test_a_pressure_that_cannot_be_followed_between_two_others_is_left_out(monkeypatch):
    """The pressures beside it are those that there were."""
    patch, scan_Pa = of_factor, LOAD_N / AREA_M2

    def fails(part, factor, mu):
        if factor < 0.13 and factor != pytest.approx(0.1):
            raise ContactError("too few pixels touch")
        return patch(part, factor, mu)

    monkeypatch.setattr("capslip.structure.law._patch", fails)
    found = law_of(CURVES["spheres"], name="boundary_elements")
    assert found.pressure_Pa[:2] / scan_Pa == pytest.approx([0.1, 10**-0.8])
    assert len(found.pressure_Pa) == 9


def sliding(p, delta, radius_m):
    """Return what `mindlin` does, beyond total slip as well."""
    d, k_n, tau, w = mindlin(p, delta, radius_m)
    beyond = np.maximum(delta - MU * STEEL.kappa * d, 0.0)
    return d, k_n, tau, w + 4 * MU * p * beyond


@pytest.mark.parametrize("share", [(0.5, 0.5), (0.3, 0.7)])
def test_the_law_of_two_scans_is_their_mean_in_closed_form(share):
    """Also where the spheres of one scan slip as a whole and those of the other one stick."""
    radii = (25.0, 4.0)
    pair = [families(COUNT, one, 0.0, STEEL.E_star_Pa) for one in radii]
    found = law([part_of(one, share=s) for one, s in zip(pair, share, strict=True)], MU)
    p, delta = found.pressure_Pa[:, None], found.displacement_m
    one, two = (sliding(p, delta, radius_m) for radius_m in radii)
    _, k_n, tau, w = (share[0] * a + share[1] * b for a, b in zip(one, two, strict=True))
    off = [np.abs(a - b) / np.sqrt(2.0) for a, b in zip(one, two, strict=True)]
    some = delta[0] > 0.05 * delta[0, -1]  # the closed form cancels at small slip
    assert (delta[0] > MU * STEEL.kappa * one[0][0]).any()
    for name, expected, scatter in (
        ("normal_stiffness_Pa_per_m", k_n[:, 0], off[1][:, 0]),
        ("tangential_stiffness_Pa_per_m", k_n[:, 0] / STEEL.kappa, off[1][:, 0] / STEEL.kappa),
        ("shear_Pa", tau, off[2]),
    ):
        np.testing.assert_allclose(getattr(found, name), expected, rtol=1e-9)
        np.testing.assert_allclose(found.scatter[SCATTERS[name]], scatter, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(found.loss_J_per_m2[:, some], w[:, some], rtol=1e-8)
    scatter = found.scatter["loss_scatter_J_per_m2"][:, some]
    np.testing.assert_allclose(scatter, off[3][:, some], rtol=1e-6)
    d = 1.0 / (share[0] / one[0] + share[1] / two[0])  # all k_n are as one power of p
    np.testing.assert_allclose(found.closure_m, d[:, 0], rtol=1e-9)
    assert found.pressure_Pa[found.at_scan_pressure] == pytest.approx(LOAD_N / AREA_M2)
    assert (found.scans, found.area_m2) == (2, 2 * AREA_M2)

    tables = tables_of(found.tables())
    p = np.exp(np.random.default_rng(102).uniform(*np.log(found.range_Pa), 30))[:, None]
    limit_m = MU * STEEL.kappa * sliding(p, 0.0, min(radii))[0]
    delta = np.linspace(0.05, 1.5, 40) * limit_m
    each = [sliding(p, delta, radius_m) for radius_m in radii]
    tau, w = (sum(s * one[i] for s, one in zip(share, each, strict=True)) for i in (2, 3))
    np.testing.assert_allclose(tables.shear_Pa(delta, p), tau, rtol=5e-3)
    np.testing.assert_allclose(tables.loss_J_per_m2(delta, p), w, rtol=0.02)
    assert (found.shear_error < 0.01, found.loss_error < 0.02) == (True, True)


def closure_of(curves, share, p):
    """Return the closure of patches that bear one pressure: the integral of dp / k_n."""
    t = np.linspace(0.0, 1.0, 4001)[1:]
    N = p * AREA_M2 * t**3
    each = (curve.stiffness_N_per_m(curve.approach_m(N)) for curve in curves)
    k_n = sum(s * one for s, one in zip(share, each, strict=True))
    return np.trapezoid(np.append(0.0, 3.0 * N[-1] * t**2 / k_n), np.append(0.0, t))


def test_the_law_of_scans_of_unlike_kappa_is_the_mean_of_what_each_does_under_its_own():
    pair, share, kappa = (CURVES["spheres"], CURVES["two families"]), (0.3, 0.7), (1.5, 1.1)
    each = zip(pair, share, kappa, strict=True)
    found = law([part_of(one, share=s, kappa=k) for one, s, k in each], MU)
    tables = tables_of(found.tables())
    for i, p in enumerate(found.pressure_Pa):
        slips = [
            slip_curve(ScaledCurve(one, 1 / AREA_M2), float(p), MU, k)
            for one, k in zip(pair, kappa, strict=True)
        ]
        whole_m = max(slip.total_slip_displacement_m for slip in slips)
        K = [float(slip.curve.stiffness_N_per_m(slip.approach_m)) for slip in slips]
        delta = found.displacement_m[i]
        assert delta[-1] == pytest.approx(whole_m, rel=1e-9)
        assert found.closure_m[i] == pytest.approx(closure_of(pair, share, p), rel=5e-4)
        assert tables.closure_m(p) == pytest.approx(closure_of(pair, share, p), rel=1e-3)
        assert found.normal_stiffness_Pa_per_m[i] == pytest.approx(np.dot(share, K), rel=1e-9)
        k_t = np.dot(share, np.divide(K, kappa))
        assert found.tangential_stiffness_Pa_per_m[i] == pytest.approx(k_t, rel=1e-9)
        tau, w = (
            sum(s * getattr(slip, of)(delta) for s, slip in zip(share, slips, strict=True))
            for of in ("force_N", "energy_J")
        )
        np.testing.assert_allclose(found.shear_Pa[i], tau, rtol=1e-9)
        np.testing.assert_allclose(found.loss_J_per_m2[i], w, rtol=1e-6)
        some = tau > 0.1 * MU * p
        np.testing.assert_allclose(tables.shear_Pa(delta, p)[some], tau[some], rtol=4e-3)
        np.testing.assert_allclose(tables.loss_J_per_m2(delta, p)[some], w[some], rtol=0.05)
        assert tables.total_slip_displacement_m(p) == pytest.approx(whole_m, rel=1e-3)
        assert tables.tangential_stiffness_Pa_per_m(p) == pytest.approx(k_t, rel=3e-3)
    assert (found.shear_error < 4e-3, found.loss_error < 0.05) == (True, True)
    assert found.kappa == pytest.approx(
        found.normal_stiffness_Pa_per_m[found.at_scan_pressure]
        / found.tangential_stiffness_Pa_per_m[found.at_scan_pressure]
    )


@pytest.mark.long
@pytest.mark.parametrize("other", ["two families", "many heights"])
def test_scans_close_together_as_their_stiffness_says(other):
    """Not as the softest of them: then dp over the closure would be its stiffness alone."""
    pair, share = (CURVES["spheres"], CURVES[other]), (0.4, 0.6)
    found = law([part_of(one, share=s) for one, s in zip(pair, share, strict=True)], MU)
    tables, k_n = tables_of(found.tables()), found.normal_stiffness_Pa_per_m
    secant = np.diff(found.pressure_Pa) / np.diff(found.closure_m)
    assert (k_n[:-1] < secant).all()
    assert (secant < k_n[1:]).all()
    for p, closure_m in zip(found.pressure_Pa, found.closure_m, strict=True):
        assert closure_m == pytest.approx(closure_of(pair, share, p), rel=5e-4)
    p = np.geomspace(1.02 * found.range_Pa[0], 0.98 * found.range_Pa[1], 40)
    rise_m = tables.closure_m(1.01 * p) - tables.closure_m(0.99 * p)
    np.testing.assert_allclose(0.02 * p / rise_m, tables.normal_stiffness_Pa_per_m(p), rtol=0.02)
    assert tables.closure_m(found.pressure_Pa) == pytest.approx(found.closure_m, rel=1e-3)
    assert tables.closure_m(p.reshape(8, 5)).shape == (8, 5)
    with pytest.raises(ValueError, match="pressure_Pa: got"):
        tables.closure_m(0.9 * found.range_Pa[0])


@pytest.mark.long
def test_scans_that_yield_close_together_from_where_they_are_unloaded():
    """Each pressure from a bed of its own; here all stiffnesses are as one power of the load."""
    hard = CURVES["spheres"]
    parts = [
        part_of(after(LOAD_N), hardness=1e9, after=after, share=0.3),
        part_of(hard, hardness=1e9, after=lambda _: hard, share=0.7),
    ]
    found = law(parts, MU)
    tables = tables_of(found.tables())
    between_Pa = np.geomspace(*found.range_Pa, 30)
    for p, closure_m, off in (
        (found.pressure_Pa, found.closure_m, 1e-7),
        (between_Pa, tables.closure_m(between_Pa), 5e-3),
    ):
        soft, stiff = (mindlin(p, 0.0, one)[0] for one in (flat_m(p * AREA_M2), RADIUS_M))
        np.testing.assert_allclose(closure_m, 1.0 / (0.3 / soft + 0.7 / stiff), rtol=off)


def test_the_mean_of_scans_is_as_good_between_two_pressures_as_one_of_them():
    """Lower caps touch somewhere between: an interpolation over pressure would smear that."""
    pair, share = (CURVES["two families"], CURVES["many heights"]), (0.4, 0.6)
    found = law([part_of(one, share=s) for one, s in zip(pair, share, strict=True)], MU)
    assert (found.shear_error < 4e-3, found.loss_error < 0.05) == (True, True)
    tables = tables_of(found.tables())
    for p in np.exp(np.random.default_rng(103).uniform(*np.log(found.range_Pa), 20)):
        slips = [slip_curve(ScaledCurve(one, 1 / AREA_M2), p, MU, STEEL.kappa) for one in pair]
        delta = np.geomspace(0.05, 1.5, 30) * slips[0].total_slip_displacement_m
        tau, w = (
            sum(s * getattr(slip, of)(delta) for s, slip in zip(share, slips, strict=True))
            for of in ("force_N", "energy_J")
        )
        np.testing.assert_allclose(tables.shear_Pa(delta, p), tau, rtol=4e-3)
        np.testing.assert_allclose(tables.loss_J_per_m2(delta, p), w, rtol=0.05)


@pytest.mark.long
def test_a_hardness_that_nothing_reaches_leaves_one_curve_for_all_pressures():
    curve = CURVES["two families"]
    found = law_of(curve, hardness=1e12)
    assert found.has_beds_alone
    assert (found.loss_error < 0.05, found.halfway) == (True, False)
    elastic, hard = (tables_of(one.tables()) for one in (elastic_law("two families"), found))
    p = np.geomspace(*found.range_Pa, 30)[:, None]
    delta = np.linspace(0.05, 1.5, 30) * elastic.total_slip_displacement_m(p)
    np.testing.assert_allclose(hard.loss_J_per_m2(delta, p), elastic.loss_J_per_m2(delta, p), 1e-9)
    assert not law_that_yields().has_beds_alone


@pytest.mark.long
@pytest.mark.parametrize("hardness", [None, 1e9])
def test_equal_scans_have_the_law_of_one_and_no_scatter(hardness):
    make = after if hardness else (lambda _: CURVES["two families"])
    alone = law_that_yields() if hardness else law_of(make(LOAD_N))
    parts = [part_of(make(LOAD_N), hardness=hardness, after=make, share=1 / 3)] * 3
    found = law(parts, MU)
    of_one = np.isin(SHARES_OF_SCANS, SHARES)
    same = np.isin(np.round(np.log(found.pressure_Pa), 9), np.round(np.log(alone.pressure_Pa), 9))
    assert same.sum() == len(alone.pressure_Pa)
    for name in (*SCATTERS, "displacement_m", "closure_m", "total_slip_displacement_m"):
        values = getattr(found, name)[same]
        values = values if values.ndim == 1 else values[:, of_one]
        np.testing.assert_allclose(values, getattr(alone, name), rtol=1e-7)
    for name, column in SCATTERS.items():
        assert (found.scatter[column] <= 1e-7 * getattr(found, name)).all()
    assert alone.scatter == {}


def test_scans_that_are_higher_by_a_shift_have_the_law_of_one():
    """Nothing tells at which height a scan lies."""
    higher = families((5, 18), (23.8, 26.7), (1e-7, 3.4e-7), STEEL.E_star_Pa)
    alone, share = elastic_law("two families"), (0.3, 0.7)
    pair = (CURVES["two families"], higher)
    found = law([part_of(one, share=s) for one, s in zip(pair, share, strict=True)], MU)
    for name in ("closure_m", "normal_stiffness_Pa_per_m", "total_slip_displacement_m"):
        np.testing.assert_allclose(getattr(found, name), getattr(alone, name), rtol=1e-6)
    p = np.geomspace(*found.range_Pa, 30)
    of_both, of_one = (tables_of(one.tables()).closure_m(p) for one in (found, alone))
    np.testing.assert_allclose(of_both, of_one, rtol=1e-6)


SHARP_M, YIELDS = 2e-3, YieldLaw(1e9, STEEL.E_star_Pa, 0.3)


def flat_m(load_N):
    """Radii to which equal sharp spheres are flattened under loads on them all."""
    one_N = np.asarray(load_N) / COUNT
    return YIELDS.flattened(one_N, np.full(one_N.shape, SHARP_M))[0]


def after(load_N):
    return families(COUNT, float(flat_m(load_N)), 0.0, STEEL.E_star_Pa)


@cache
def law_that_yields():
    return law_of(after(LOAD_N), hardness=1e9, after=after)


@pytest.mark.long
@pytest.mark.parametrize("name", ["families", "boundary_elements"])
def test_each_pressure_of_a_face_that_yields_has_its_own_unloading(name):
    found = law_that_yields()
    if name != "families":
        found = law_of(after(LOAD_N), name, hardness=1e9, after=after)
    p = found.pressure_Pa[:, None]
    radius_m = flat_m(p * AREA_M2)
    assert radius_m[-1] > 1.5 * radius_m[0] >= 1.5 * SHARP_M
    d, k_n, tau, w = mindlin(p, found.displacement_m, radius_m)
    np.testing.assert_allclose(found.closure_m, d[:, 0], rtol=1e-9)
    np.testing.assert_allclose(found.normal_stiffness_Pa_per_m, k_n[:, 0], rtol=1e-9)
    np.testing.assert_allclose(found.shear_Pa, tau, rtol=1e-9)
    some = tau[0] > 0.1 * MU * p[0]
    np.testing.assert_allclose(found.loss_J_per_m2[:, some], w[:, some], rtol=1e-8)

    # Between the points, below all, and beyond total slip
    tables = tables_of(found.tables())
    p = np.exp(np.random.default_rng(101).uniform(*np.log(found.range_Pa), 50))[:, None]
    radius_m = flat_m(p * AREA_M2)
    limit_m = MU * STEEL.kappa * mindlin(p, 0.0, radius_m)[0]
    np.testing.assert_allclose(tables.total_slip_displacement_m(p), limit_m, rtol=5e-3)
    delta = np.linspace(0.05, 0.95, 40) * limit_m
    _, k_n, tau, w = mindlin(p, delta, radius_m)
    np.testing.assert_allclose(tables.normal_stiffness_Pa_per_m(p), k_n, rtol=5e-3)
    np.testing.assert_allclose(tables.shear_Pa(delta, p), tau, rtol=5e-3)
    np.testing.assert_allclose(tables.shear_Pa(-delta, p), -tau, rtol=5e-3)
    np.testing.assert_allclose(tables.loss_J_per_m2(delta, p), w, rtol=0.02)
    np.testing.assert_allclose(tables.shear_Pa(3.0 * limit_m, p), MU * p, rtol=1e-12)
    more = tables.loss_J_per_m2(3.0 * limit_m, p) - tables.loss_J_per_m2(2.0 * limit_m, p)
    np.testing.assert_allclose(more, 4 * MU * p * limit_m, rtol=1e-9)
    small = [tables.loss_J_per_m2(share * limit_m, p) for share in (1e-5, 1e-6)]
    np.testing.assert_allclose(small[0] / small[1], 1e3, rtol=1e-9)
    assert (found.shear_error < 0.02, found.loss_error < 0.05) == (True, True)
    with pytest.raises(ValueError, match="pressure_Pa: got"):
        tables.loss_J_per_m2(1e-9, 1.1 * found.range_Pa[1])

    # The curve that the pressure of the scan left would be far off at the ends
    _, _, _, as_flat = mindlin(found.range_Pa[0], 1e-9, float(flat_m(LOAD_N)))
    _, _, _, own = mindlin(found.range_Pa[0], 1e-9, float(flat_m(found.range_Pa[0] * AREA_M2)))
    assert as_flat > 1.4 * own


@pytest.mark.long
def test_no_bed_of_a_law_is_found_twice(monkeypatch):
    """Those of all pressures are asked for at each turn that adds some, and in the end."""
    asked, found_bed = [], beds._from_touch
    monkeypatch.setattr(beds, "_from_touch", lambda *a: asked.append(a) or found_bed(*a))
    found = law_of(after(LOAD_N), hardness=1e9, after=after)
    assert len(asked) >= found.pressure_Pa.size
    assert len({(p.tobytes(), z.tobytes(), K.tobytes()) for p, z, K in asked}) == len(asked)


def test_pressures_that_a_face_cannot_bear_end_the_law():
    def fails(load_N):
        if load_N > 1.5 * LOAD_N:
            raise ContactError("too much")
        return after(load_N)

    found = law_of(after(LOAD_N), hardness=1e9, after=fails)
    assert found.pressure_Pa[-1] < 1.5 * LOAD_N / AREA_M2
    assert "too much" in found.ends


def test_a_map_whose_contacts_only_grow_in_number_lets_them_go_at_shares_of_its_pressure():
    """So a face at its hardness: twice the load, twice as many of the same contacts."""
    curve = families((5, 18), (23.8, 26.7), (0.0, 1.2e-7), STEEL.E_star_Pa)

    def more(load_N):
        return ScaledCurve(curve, load_N / LOAD_N)

    found = law_of(curve, "boundary_elements", hardness=1e9, after=more)
    assert (found.halfway, found.shear_error < 5e-3, found.loss_error < 0.05) == (True, True, True)
    tables = tables_of(found.tables())
    for p in np.sqrt(found.pressure_Pa[1:] * found.pressure_Pa[:-1]):
        slip = slip_curve(ScaledCurve(more(p * AREA_M2), 1 / AREA_M2), float(p), MU, STEEL.kappa)
        delta = np.linspace(0.01, 0.95, 30) * slip.total_slip_displacement_m
        np.testing.assert_allclose(tables.shear_Pa(delta, p), slip.force_N(delta), rtol=5e-3)
        np.testing.assert_allclose(tables.loss_J_per_m2(delta, p), slip.energy_J(delta), rtol=0.05)


def test_what_lies_between_solutions_is_not_known_where_none_can_be_solved_halfway():
    def fails(load_N):
        found.append(load_N)
        if load_N > LOAD_N or load_N < 0.5 * LOAD_N or np.min(np.abs(load_N / known_N - 1)) > 1e-6:
            raise ContactError("cannot be followed")
        return after(load_N)

    known_N, found = LOAD_N * 10 ** np.array([-0.2, -0.1, 0.0]), []
    three = law_of(after(LOAD_N), "boundary_elements", hardness=1e9, after=fails)
    assert len(three.pressure_Pa) == 3
    assert np.isclose(np.array(found) / LOAD_N, 10**-0.05).any()  # it was asked for
    assert np.isinf([three.shear_error, three.loss_error, three.stiffness_error]).all()


def test_each_interval_of_a_map_is_compared_in_the_way_that_tells_more_of_it():
    """Below the load of the scan one curve serves all; above, there are more of the same contacts.

    One way for all intervals is off by more than half of w in some of them.
    """
    curve = families((5, 18), (23.8, 26.7), (0.0, 1.2e-7), STEEL.E_star_Pa)

    def first_one_then_more(load_N):
        return ScaledCurve(curve, max(load_N / LOAD_N, 1.0))

    found = law_of(curve, "boundary_elements", hardness=1e9, after=first_one_then_more)
    assert (found.halfway, found.shear_error < 5e-3, found.loss_error < 0.05) == (True, True, True)
    tables = tables_of(found.tables())
    p = found.pressure_Pa
    for share in (0.25, 0.5, 0.75):
        for one in (p[:-1] ** (1.0 - share) * p[1:] ** share).tolist():
            of_load = ScaledCurve(first_one_then_more(one * AREA_M2), 1 / AREA_M2)
            slip = slip_curve(of_load, one, MU, STEEL.kappa)
            delta = np.linspace(0.1, 0.95, 30) * slip.total_slip_displacement_m
            some = slip.force_N(delta) > 0.1 * MU * one
            w = slip.energy_J(delta)[some]
            np.testing.assert_allclose(tables.loss_J_per_m2(delta, one)[some], w, rtol=0.05)


def test_the_stiffness_before_slip_between_two_pressures_of_a_map_is_off_by_no_more_than_said():
    """A power 0.7 of the load below, which no straight line over the closure follows."""
    curve = families((5, 18), (23.8, 26.7), (0.0, 1.2e-7), STEEL.E_star_Pa)

    def stiffer(load_N):
        return ScaledCurve(curve, (load_N / LOAD_N) ** 0.7)

    found = law_of(stiffer(LOAD_N), "boundary_elements", hardness=1e9, after=stiffer)
    tables, p = tables_of(found.tables()), np.sqrt(found.pressure_Pa[1:] * found.pressure_Pa[:-1])
    exact = [
        slip_curve(
            ScaledCurve(stiffer(one * AREA_M2), 1 / AREA_M2), one, MU, STEEL.kappa
        ).tangential_stiffness_N_per_m
        for one in p.tolist()
    ]
    off = np.abs(tables.tangential_stiffness_Pa_per_m(p) / exact - 1.0).max()
    assert 1e-3 < off <= found.stiffness_error < 20.0 * off


def test_caps_that_touch_between_two_pressures_of_a_map_stay_at_their_load():
    """Each pressure has a bed of its own, here the same one; its second family touches at 149 N."""
    curve = families((5, 18), (23.8, 26.7), (0.0, 1.2e-7), STEEL.E_star_Pa)
    found = law_of(curve, "boundary_elements", hardness=1e9, after=lambda load_N: curve)
    assert (found.halfway, found.shear_error < 5e-3, found.loss_error < 0.05) == (True, True, True)
    tables = tables_of(found.tables())
    for p in np.sqrt(found.pressure_Pa[1:] * found.pressure_Pa[:-1]):
        slip = slip_curve(ScaledCurve(curve, 1 / AREA_M2), float(p), MU, STEEL.kappa)
        delta = np.linspace(0.1, 0.95, 30) * slip.total_slip_displacement_m
        np.testing.assert_allclose(tables.shear_Pa(delta, p), slip.force_N(delta), rtol=5e-3)
        some = slip.force_N(delta) > 0.1 * MU * p
        w = slip.energy_J(delta)
        np.testing.assert_allclose(tables.loss_J_per_m2(delta, p)[some], w[some], rtol=0.05)


def test_pressures_whose_slip_cannot_be_followed_begin_the_law(monkeypatch):
    """As where too few pixels touch: what is above them is as it would be."""
    whole = law_of(CURVES["spheres"], name="boundary_elements")
    energy_J = SlipCurve.energy_J

    def followed(slip, displacement_m):
        if slip.preload_N < 1.01 * whole.pressure_Pa[1]:
            raise ContactError("too few pixels")
        return energy_J(slip, displacement_m)

    monkeypatch.setattr(SlipCurve, "energy_J", followed)
    found = law_of(CURVES["spheres"], name="boundary_elements")
    same = [0, *range(2, len(found.pressure_Pa))]  # but the one halfway from the new least
    assert found.pressure_Pa[same] == pytest.approx(whole.pressure_Pa[2:], rel=1e-12)
    assert found.loss_J_per_m2[same] == pytest.approx(whole.loss_J_per_m2[2:], rel=1e-12)
    assert found.pressure_Pa[1] ** 2 == pytest.approx(np.prod(whole.pressure_Pa[2:4]))
    assert "too few pixels" in found.ends
    assert "too few pixels" not in whole.ends


def in_a_direction(load_N):
    """Kappa of slip in a direction, as contacts grow or more of them join."""
    return STEEL.kappa * (load_N / LOAD_N) ** 0.03


def slid(p, delta, radius_m=RADIUS_M):
    """Return k_t, tau and w per area of equal spheres whose kappa goes with the load."""
    kappa = in_a_direction(p * AREA_M2)
    of_one = STEEL.kappa / kappa
    _, k_n, tau, w = mindlin(p, delta * of_one, radius_m)
    return k_n[:, 0] / kappa[:, 0], tau, w / of_one


@pytest.mark.long
@pytest.mark.parametrize("scans", [1, 2])
@pytest.mark.parametrize("yields", [False, True])
def test_each_pressure_slips_with_the_kappa_of_its_own_contacts(yields, scans):
    """In a direction of slip it is another one where other contacts touch."""
    given = {"hardness": 1e9, "after": after} if yields else {}
    curve = after(LOAD_N) if yields else CURVES["spheres"]
    part = part_of(curve, kappa=in_a_direction, share=1.0 / scans, **given)
    found = law([part] * scans, MU)
    tables, radius_m = tables_of(found.tables()), SHARP_M if yields else RADIUS_M
    between_Pa = np.sqrt(found.pressure_Pa[1:] * found.pressure_Pa[:-1])
    for p, off in ((found.pressure_Pa[:, None], 2e-3), (between_Pa[:, None], 0.02)):
        radius_m = flat_m(p * AREA_M2) if yields else RADIUS_M
        delta = np.array([0.1, 0.3, 0.6]) * tables.total_slip_displacement_m(p)
        k_t, tau, w = slid(p, delta, radius_m)
        np.testing.assert_allclose(
            tables.tangential_stiffness_Pa_per_m(p)[:, 0], k_t, rtol=min(off, 4e-3)
        )
        np.testing.assert_allclose(tables.shear_Pa(delta, p), tau, rtol=min(off, 4e-3))
        np.testing.assert_allclose(tables.loss_J_per_m2(delta, p), w, rtol=off)
    p = found.pressure_Pa[:, None]
    k_t, tau, w = slid(p, found.displacement_m, flat_m(p * AREA_M2) if yields else RADIUS_M)
    np.testing.assert_allclose(found.tangential_stiffness_Pa_per_m, k_t, rtol=1e-9)
    np.testing.assert_allclose(found.shear_Pa, tau, rtol=1e-9)
    some = tau[0] > 0.1 * MU * p[0]
    np.testing.assert_allclose(found.loss_J_per_m2[:, some], w[:, some], rtol=1e-6)
    assert found.kappa == pytest.approx(STEEL.kappa, rel=1e-12)
    for i, elements in enumerate(found.elements):
        assert elements.stiffness_N_per_m.sum() == pytest.approx(k_t[i], rel=2e-3)
