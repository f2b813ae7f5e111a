"""Interacting caps against equilibrium, the theorem, closed forms and boundary elements."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capslip.contact.bulk import bulk_compliance_m_per_N
from capslip.contact.curve import in_series
from capslip.contact.material import composite
from capslip.contact.models import interacting as model
from capslip.contact.models.caps import caps
from capslip.contact.models.interacting import interacting
from capslip.contact.models.mean_field import mean_field
from capslip.contact.slip import slip_curve
from capslip.errors import ContactError, SettingsError

STEEL = composite((200e9, 200e9), (0.3, 0.3))
E, KAPPA = STEEL.E_star_Pa, STEEL.kappa
MU = 0.2
FACE = (0.04, 0.06)

# A seeded face of 5 high and 18 low caps: x and y in mm, radius in m. The low ones (26.7 m) lie
# 0.24 um below. Boundary elements on its 600 x 400 height map at 460 N, with the theorem of
# Ciavarella and Jaeger, gave the approach, the contacts and, at T / mu N, displacement and energy.
FACE_CAPS = np.array(
    [
        (9.9428, 19.9754, 26.7),
        (35.4809, 3.9754, 26.7),
        (10.9880, 34.5592, 26.7),
        (6.8027, 7.4123, 26.7),
        (54.2097, 24.1440, 26.7),
        (22.9256, 20.3873, 26.7),
        (38.7935, 12.3605, 23.8),
        (39.1995, 20.4210, 26.7),
        (47.1038, 21.6686, 23.8),
        (55.9693, 9.9533, 26.7),
        (49.8360, 7.3778, 26.7),
        (28.2220, 12.4229, 26.7),
        (21.3233, 3.5738, 26.7),
        (27.8247, 26.4954, 26.7),
        (19.6703, 13.7908, 26.7),
        (4.3276, 31.5302, 26.7),
        (18.8207, 27.7218, 26.7),
        (43.3115, 4.3604, 26.7),
        (45.1770, 34.5351, 23.8),
        (55.0232, 33.8467, 26.7),
        (32.9737, 30.6965, 23.8),
        (12.2466, 3.3899, 23.8),
        (22.7157, 33.1707, 26.7),
    ]
)
BOUNDARY_ELEMENTS = {
    "approach_m": 3.04614e-07,
    "contacts": 10,
    "slip": [
        (0.10, 4.87199e-09, 3.99222e-09),
        (0.25, 1.32739e-08, 5.24139e-08),
        (0.50, 2.85681e-08, 2.63492e-07),
        (0.75, 4.62002e-08, 9.30153e-07),
    ],
}


def face_of_23(preload_N=None):
    x, y, radius = FACE_CAPS.T
    depth = np.where(radius > 25, 2.4e-7, 0.0)
    return interacting(radius, depth, x * 1e-3, y * 1e-3, E, preload_N)


def random_caps(rng, largest):
    """Draw 1 to `largest` caps on a face, their depths over up to three decades."""
    n = int(np.exp(rng.uniform(0, np.log(largest + 1))))
    radius = np.exp(rng.uniform(0, np.log(100), n))
    spread = 10 ** rng.uniform(-8, -5)
    depth = [
        10 ** rng.uniform(-8, -5, n),
        spread * rng.random(n),
        spread * np.abs(rng.normal(size=n)),
    ][rng.integers(3)]
    side = int(np.ceil(np.sqrt(n)))
    place = rng.permutation(side * side)[:n] if rng.random() < 0.5 else None
    if place is None:
        x, y = rng.random(n), rng.random(n)
    else:  # spaced out: the only way to bring many caps under load before two of them merge
        x = (place % side + 0.3 * rng.random(n)) / side
        y = (place // side + 0.3 * rng.random(n)) / side
    return radius, depth - depth.min(), x * FACE[1], y * FACE[0]


def misfit(curve, load):
    """Return the largest relative violation of the equilibrium under a load, and the approach."""
    d = float(curve.approach_m(load))
    N = curve.asperity_loads_N(d)
    r = np.hypot(curve.x_m[:, None] - curve.x_m, curve.y_m[:, None] - curve.y_m)
    np.fill_diagonal(r, np.inf)
    compression = np.cbrt(N / (4 / 3 * E * np.sqrt(curve.radius_m))) ** 2
    gap = compression + (N / (np.pi * E * r)).sum(axis=1) + curve.depth_m - d
    worst = max(np.abs(gap[N > 0]).max() / d, -gap.min() / (d + curve.depth_m.max()))
    return max(worst, abs(N.sum() / load - 1)), d


def solve_random_scenes(n_scenes, seed, largest=500):
    """Solve random scenes at loads from 1e-6 N to where caps merge; return the worst misfit.

    Each scene is solved at a random load, which is then lowered until no contacts overlap, and once
    more at the approach found.
    """
    rng = np.random.default_rng(seed)
    worst, slowest_s = 0.0, 0.0
    for _ in range(n_scenes):
        curve = interacting(*random_caps(rng, largest), E)
        load = 10 ** rng.uniform(-6, 5)
        while True:
            start = time.perf_counter()
            error, d = misfit(curve, load)
            slowest_s = max(slowest_s, time.perf_counter() - start)
            worst = max(worst, error)
            if load < 1e-6 or curve.overlapping_pairs(d) == 0:
                break
            load *= 0.1
        fresh = in_series(curve, 0.0)  # has not solved anything yet
        worst = max(worst, abs(float(fresh.load_N(d)) / load - 1))
    return worst, slowest_s


def test_random_scenes_reach_equilibrium():
    worst, _ = solve_random_scenes(300, seed=0, largest=150)
    assert worst < 1e-12


@pytest.mark.parametrize(("preload_N", "within"), [(None, 6e-4), (460.0, 1.5e-4)])
def test_boundary_elements_on_a_face_of_caps(preload_N, within):
    """As point loads, and with their near field; the least energies are those of some pixels."""
    joint = slip_curve(face_of_23(preload_N), 460.0, MU, KAPPA)
    assert joint.approach_m == pytest.approx(BOUNDARY_ELEMENTS["approach_m"], rel=within, abs=0.0)
    loads = joint.curve.asperity_loads_N(joint.approach_m)
    assert np.count_nonzero(loads) == BOUNDARY_ELEMENTS["contacts"]
    assert joint.curve.overlapping_pairs(joint.approach_m) == 0
    for share, displacement_m, energy_J in BOUNDARY_ELEMENTS["slip"]:
        force = share * joint.total_slip_force_N
        found_m, found_J = joint.displacement_m(force), joint.energy_at_force_J(force)
        assert found_m == pytest.approx(displacement_m, rel=within, abs=0.0)
        of_pixels = 1e-2 if share < 0.2 else 2.5e-3
        assert found_J == pytest.approx(energy_J, rel=of_pixels, abs=0.0)
        if share > 0.4 and preload_N is not None:
            assert found_J == pytest.approx(energy_J, rel=within, abs=0.0)


def test_two_equal_caps_in_closed_form():
    pair = interacting([20.0, 20.0], [0.0, 0.0], [0.0, 0.012], [0.0, 0.016], E)
    load = np.geomspace(1e-6, 1e3, 10)
    alone = caps([20.0], [0.0], E).approach_m(load / 2)
    np.testing.assert_allclose(
        pair.approach_m(load), alone + load / 2 / (np.pi * E * 0.02), rtol=1e-13
    )


@pytest.mark.parametrize("preload_N", [None, 460.0])
def test_the_shear_law_is_the_theorem(preload_N):
    for bulk in (0.0, -bulk_compliance_m_per_N(FACE, E)):
        joint = slip_curve(in_series(face_of_23(preload_N), bulk), 460.0, MU, KAPPA)
        d = joint.approach_m
        e = np.array([1e-3, 0.03, 0.2, 0.6, 0.9, 0.999, 1.0]) * d
        drop = 460.0 - joint.curve.load_N(d - e)
        np.testing.assert_allclose(joint.force_N(MU * KAPPA * e), MU * drop, rtol=1e-9)


@pytest.mark.parametrize("preload_N", [None, 460.0])
def test_energy_is_the_integral_of_the_force(preload_N):
    joint = slip_curve(face_of_23(preload_N), 460.0, MU, KAPPA)
    node, weight = np.polynomial.legendre.leggauss(20)
    for share in (0.05, 0.4, 1.0):
        delta = share * joint.total_slip_displacement_m
        edges = np.linspace(0, delta, 41)
        half = np.diff(edges)[:, None] / 2
        area = (half * weight * joint.force_N(edges[:-1, None] + half * (1 + node))).sum()
        expected = 8 * area - 4 * joint.force_N(delta) * delta
        assert joint.energy_J(delta) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("preload_N", [None, 460.0])
def test_many_points_of_one_joint_agree_with_their_inverse(preload_N):
    joint = slip_curve(face_of_23(preload_N), 460.0, MU, KAPPA)
    force = np.concatenate([np.geomspace(1e-14, 0.5, 40), 1 - np.geomspace(1e-9, 0.4, 20)])
    force *= joint.total_slip_force_N
    delta = joint.displacement_m(force)
    np.testing.assert_allclose(joint.force_N(delta), force, rtol=1e-12)
    np.testing.assert_allclose(joint.energy_J(delta), joint.energy_at_force_J(force), rtol=1e-11)
    small = joint.energy_J(np.array([1e-21, 1e-18, 1e-15])) / np.array([1e-63, 1e-54, 1e-45])
    np.testing.assert_allclose(small, small[0], rtol=1e-5)
    assert joint.displacement_m(joint.total_slip_force_N) == pytest.approx(
        joint.total_slip_displacement_m, rel=1e-12
    )
    beyond = joint.total_slip_displacement_m * np.array([1.0, 3.0])
    np.testing.assert_allclose(joint.force_N(beyond), joint.total_slip_force_N, rtol=1e-13)
    extra = 4 * joint.total_slip_force_N * (beyond[1] - beyond[0])
    assert np.diff(joint.energy_J(beyond))[0] == pytest.approx(extra, rel=1e-12)


@settings(max_examples=40, deadline=None, database=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_force_is_increasing_and_concave_and_energy_positive(seed, near):
    rng = np.random.default_rng(seed)
    given = random_caps(rng, 60)
    load = 10 ** rng.uniform(-6, 3)
    curve = interacting(*given, E, load if near else None)
    joint = slip_curve(curve, load, MU, KAPPA)
    delta = np.linspace(0, 1.2, 121) * joint.total_slip_displacement_m
    force, energy = joint.force_N(delta), joint.energy_J(delta)
    assert (np.diff(force) >= -1e-12 * joint.total_slip_force_N).all()
    assert (np.diff(energy) > 0).all()
    if curve.overlapping_pairs(joint.approach_m) == 0:
        assert (np.diff(force, 2) <= 1e-12 * joint.total_slip_force_N).all()


@settings(max_examples=40, deadline=None, database=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_energy_at_given_force_ignores_a_spring_in_series(seed, near):
    rng = np.random.default_rng(seed)
    given = random_caps(rng, 60)
    load = 10 ** rng.uniform(-3, 2)
    curve = interacting(*given, E, load if near else None)
    joint = slip_curve(curve, load, MU, KAPPA)
    compliance = rng.uniform(-0.3, 5) / float(curve.stiffness_N_per_m(joint.approach_m))
    other = slip_curve(in_series(curve, compliance), load, MU, KAPPA)
    force = np.geomspace(1e-9, 0.99, 12) * joint.total_slip_force_N
    energy = joint.energy_at_force_J(force)
    np.testing.assert_allclose(other.energy_at_force_J(force), energy, rtol=1e-12)
    displacement = joint.displacement_m(force) + KAPPA * compliance * force
    np.testing.assert_allclose(other.displacement_m(force), displacement, rtol=1e-11)
    np.testing.assert_allclose(other.force_N(displacement), force, rtol=1e-10)
    np.testing.assert_allclose(other.energy_J(displacement), energy, rtol=1e-9)


@settings(max_examples=40, deadline=None, database=None)
@given(st.integers(0, 2**32 - 1), st.floats(1e-2, 1e2), st.floats(1e-2, 1e2))
def test_scaling_of_lengths_and_modulus_and_order_of_caps(seed, scale, harder):
    rng = np.random.default_rng(seed)
    scene = random_caps(rng, 60)
    load = 10 ** rng.uniform(-3, 1)
    order = rng.permutation(len(scene[0]))
    one = interacting(*scene, E)
    d = float(one.approach_m(load))
    if one.overlapping_pairs(d) > 0:
        return
    other = interacting(*(scale * column[order] for column in scene), harder * E)
    assert other.approach_m(harder * scale**2 * load) == pytest.approx(scale * d, rel=1e-10)
    np.testing.assert_allclose(
        other.asperity_loads_N(other.approach_m(harder * scale**2 * load)),
        harder * scale**2 * one.asperity_loads_N(d)[order],
        rtol=1e-6,
        atol=1e-9 * harder * scale**2 * load,
    )


def test_distant_caps_do_not_interact():
    x, y, radius = FACE_CAPS.T
    depth = np.where(radius > 25, 2.4e-7, 0.0)
    alone = slip_curve(caps(radius, depth, E), 460.0, MU, KAPPA)
    delta = np.geomspace(1e-11, 5e-8, 8)
    errors = []
    for apart in (1.0, 1e3, 1e6):
        far = slip_curve(interacting(radius, depth, apart * x, apart * y, E), 460.0, MU, KAPPA)
        errors.append(
            [
                abs(far.approach_m / alone.approach_m - 1),
                np.abs(far.energy_J(delta) / alone.energy_J(delta) - 1).max(),
                np.abs(far.force_N(delta) / alone.force_N(delta) - 1).max(),
            ]
        )
    assert np.max(errors[2]) < 1e-6
    np.testing.assert_allclose(np.divide(errors[1], errors[2]), 1e3, rtol=0.05)


def test_mean_field_finds_the_approach_of_interacting_caps():
    radius = FACE_CAPS[:, 2]
    depth = np.where(radius > 25, 2.4e-7, 0.0)
    for load in (100.0, 460.0, 1000.0):
        sunk = mean_field(radius, depth, E, bulk_compliance_m_per_N(FACE, E), load).approach_m(load)
        assert sunk == pytest.approx(float(face_of_23().approach_m(load)), rel=0.03)


@pytest.mark.parametrize("preload_N", [None, 460.0])
def test_stiffness_is_the_slope_of_the_load(preload_N):
    for compliance in (0.0, 3e-10, -2e-11):
        curve = in_series(face_of_23(preload_N), compliance)
        d = float(curve.approach_m(460.0))
        step = 1e-5 * d
        slope = (curve.load_N(d + step) - curve.load_N(d - step)) / (2 * step)
        assert curve.stiffness_N_per_m(d) == pytest.approx(slope, rel=1e-6)
        here = curve.stiffness_N_per_m(0.8 * d)
        assert curve.stiffness_N_per_m(d, 0.2 * d) == pytest.approx(here, rel=1e-9)


@pytest.mark.parametrize("preload_N", [None, 460.0])
def test_a_whole_curve_is_solved_like_its_points(preload_N):
    curve = face_of_23(preload_N)
    load = np.append(0.0, np.geomspace(1e-6, 2000.0, 20))
    approach = curve.approach_m(load)
    assert approach[0] == 0.0
    np.testing.assert_allclose(curve.load_N(approach), load, rtol=1e-13)
    fresh = face_of_23(preload_N)
    np.testing.assert_allclose(fresh.load_N(approach), load, rtol=1e-11)
    np.testing.assert_allclose(approach[5], fresh.approach_m(load[5]), rtol=1e-13)
    np.testing.assert_array_equal(fresh.load_N([-1e-7, 0.0]), 0.0)
    drops = curve.load_drop_N(approach[10:], 1e-9)
    for d, drop in zip(approach[10:], drops, strict=True):
        assert curve.load_drop_N(d, 1e-9) == pytest.approx(drop, rel=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_many_loads_are_solved_together_like_each_alone(seed):
    """Up to loads at which contacts overlap, where there may be more than one equilibrium."""
    rng = np.random.default_rng(seed)
    caps_of_face = random_caps(rng, 80)
    load = 10 ** rng.uniform(-3, 4) * np.geomspace(1e-3, 1.0, 12)
    approach = interacting(*caps_of_face, E).approach_m(load)
    one_by_one = [float(interacting(*caps_of_face, E).approach_m(N)) for N in load]
    np.testing.assert_allclose(approach, one_by_one, rtol=1e-12)


def test_a_heavy_neighbour_pushes_a_cap_out_of_contact():
    # The small cap touches first; then the blunt one beside it takes over and sinks the surface.
    # While their contacts overlap the small one would grow as the load falls: it is sheared
    # backwards, and the energy stays positive.
    curve = interacting([1.0, 500.0], [0.0, 1e-9], [0.0, 1e-3], [0.0, 0.0], E)
    for load, small_carries in ((1e-3, True), (3.0, True), (10.0, False)):
        d = float(curve.approach_m(load))
        assert (curve.asperity_loads_N(d)[0] > 0) == small_carries
        joint = slip_curve(curve, load, MU, KAPPA)
        delta = np.linspace(0.01, 1.0, 50) * joint.total_slip_displacement_m
        assert (joint.energy_J(delta) > 0).all()
        assert (np.diff(joint.energy_J(delta)) > 0).all()
        assert joint.force_N(delta[-1]) == pytest.approx(joint.total_slip_force_N, rel=1e-12)


def test_overlapping_contacts_are_counted():
    R, r = 20.0, 1e-3
    pair = interacting([R, R, R], [0.0, 0.0, 1.0], [0.0, r, 0.5], [0.0, 0.0, 0.0], E)
    g = (r / 2) ** 2 / R
    N = float(caps([R], [0.0], E).load_N(g))
    assert pair.overlapping_pairs(pair.approach_m(2 * 0.99 * N)) == 0
    assert pair.overlapping_pairs(pair.approach_m(2 * 1.01 * N)) == 1
    hidden = interacting([R, R], [0.0, 5e-7], [0.0, r], [0.0, 0.0], E)
    assert hidden.overlapping_pairs(hidden.approach_m(20 * N)) == 1
    assert hidden.asperity_loads_N(hidden.approach_m(20 * N))[1] == 0


def test_phases_without_families():
    joint = slip_curve(face_of_23(), 460.0, MU, KAPPA)
    phase = joint.phase(np.array([1e-4, 0.5, 1.01]) * joint.total_slip_displacement_m)
    np.testing.assert_array_equal(phase, ["GPS", "PPS", "TS"])


def test_bad_scenes_are_named():
    one = np.ones(3)
    with pytest.raises(SettingsError, match=r"caps 0 and 2 are both at x = 1 m, y = 1 m"):
        interacting(one, 0 * one, [1, 2, 1], one, E)
    with pytest.raises(SettingsError, match="shapes"):
        interacting(one, 0 * one, one, [1, 2], E)
    with pytest.raises(SettingsError, match="not finite"):
        interacting(one, 0 * one, [1, 2, np.nan], one, E)
    with pytest.raises(SettingsError, match="radius_m"):
        interacting(-one, 0 * one, [1, 2, 3], one, E)
    with pytest.raises(SettingsError, match="E_star_Pa"):
        interacting(one, 0 * one, [1, 2, 3], one, -E)
    with pytest.raises(ContactError, match="no asperities"):
        interacting([], [], [], [], E)
    with pytest.raises(ContactError, match=r"3 caps need .* GB; .*mean_field"):
        interacting(one, 0 * one, [1, 2, 3], one, E, memory_limit_bytes=100)
    with pytest.raises(ContactError, match="wider than its asperity"):
        interacting(1e-3 * one, 0 * one, [1, 2, 3], one, E).approach_m(1e9)
    with pytest.raises(ContactError, match="fall with growing load"):
        in_series(face_of_23(), -1e-8).approach_m(460.0)


def test_what_was_asked_before_changes_no_answer():
    """A curve remembers the approaches of its loads; one in between moves none of them."""
    rng = np.random.default_rng(4)
    given = 20.0 * np.ones(9), 1e-7 * rng.random(9), *(0.03 * rng.random((2, 9))), 110e9
    curve = interacting(*given)
    first = [float(curve.approach_m(load_N)) for load_N in (40.0, 400.0)]
    assert first[0] < first[1]
    assert [float(curve.approach_m(load_N)) for load_N in (40.0, 400.0)] == first
    alone = [float(interacting(*given).approach_m(load_N)) for load_N in (40.0, 400.0)]
    assert first == pytest.approx(alone, rel=1e-12)
    np.testing.assert_allclose(curve.load_N(np.array(first)), (40.0, 400.0), rtol=1e-10)
    softer = in_series(curve, 1e-10)
    assert float(softer.approach_m(400.0)) == pytest.approx(first[1] + 4e-8, rel=1e-12)


def test_a_stiffness_that_was_asked_before_is_not_solved_again(monkeypatch):
    """That under the preload is asked for by slip, law and answers again and again."""
    solved = []
    solve = model.solve_coupled
    monkeypatch.setattr(model, "solve_coupled", lambda *given: solved.append(1) or solve(*given))
    curve = face_of_23(460.0)
    d = curve.approach_m(460.0)
    first = curve.stiffness_N_per_m(d)
    n_solved = len(solved)
    assert n_solved > 0
    assert curve.stiffness_N_per_m(d) == first
    assert len(solved) == n_solved
    first *= 2.0  # what was given away is the caller's
    assert curve.stiffness_N_per_m(d) == 0.5 * first
    assert curve.stiffness_N_per_m(d, 0.5 * d) < 0.5 * first
    assert len(solved) > n_solved
