"""Where each interacting cap slips totally, against the state itself and plain caps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capslip.contact.bulk import bulk_compliance_m_per_N
from capslip.contact.curve import in_series
from capslip.contact.material import composite
from capslip.contact.models.caps import caps
from capslip.contact.models.families import families
from capslip.contact.models.interacting import interacting
from capslip.contact.slip import slip_curve
from scenes import in_filters

STEEL = composite((200e9, 200e9), (0.3, 0.3))
E, KAPPA = STEEL.E_star_Pa, STEEL.kappa
MU = 0.2
FACE = (0.04, 0.06)
BULK = bulk_compliance_m_per_N(FACE, E)


def random_face(seed, n=23):
    """Draw caps on a grid with some play, so that many touch before any contacts merge."""
    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(n)))
    place = np.arange(n)
    x_m = (place % side + 0.3 * rng.random(n)) / side * FACE[1]
    y_m = (place // side + 0.3 * rng.random(n)) / side * FACE[0]
    depth_m = rng.uniform(0, 3e-7, n)
    return rng.uniform(5, 40, n), depth_m - depth_m.min(), x_m, y_m


def crossing_by_bisection(curve, approach_m, high_m):
    """Withdrawal at which `lifted` turns true for each cap, from states alone."""
    lower, upper = np.zeros_like(high_m), high_m
    for _ in range(60):
        middle = (lower + upper) / 2
        lifted = np.diagonal(curve.lifted(approach_m, middle))
        lower, upper = np.where(lifted, lower, middle), np.where(lifted, middle, upper)
    return upper


@settings(max_examples=30, deadline=None, database=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 40),
    st.floats(-3, 3),
    st.sampled_from([0.0, 3e-10, -0.3]),
)
def test_lifted_turns_true_there(seed, n, log_load, spring):
    curve = interacting(*random_face(seed, n), E)
    load = 10.0**log_load
    if spring < 0:  # a share of what the contacts yield
        spring /= float(curve.stiffness_N_per_m(curve.approach_m(load)))
    curve = in_series(curve, spring)
    d = float(curve.approach_m(load))
    if curve.overlapping_pairs(d) > 0:
        return
    limit = curve.lift_off_m(d)
    touching = curve.asperity_loads_N(d) > 0
    np.testing.assert_array_equal(np.isfinite(limit), touching)
    for i in np.flatnonzero(touching):
        np.testing.assert_array_equal(
            curve.lifted(d, limit[i] * np.array([0.5, 1 - 1e-10, 1 + 1e-10, 1.5]))[:, i],
            [False, False, True, True],
        )
    assert not curve.lifted(d, 2 * d)[~touching].any()
    # The last one is total slip.
    assert np.nanmax(limit) == pytest.approx(d, rel=1e-12)


def test_bisection_of_the_state_finds_the_same():
    curve = in_series(interacting(*random_face(1), E), -0.5 * BULK)
    d = float(curve.approach_m(460.0))
    limit = curve.lift_off_m(d)
    touching = np.isfinite(limit)
    assert 5 < np.count_nonzero(touching) < 23
    high_m = np.full(23, d * (1 + 1e-9))
    found = crossing_by_bisection(curve, d, high_m)
    np.testing.assert_allclose(limit[touching], found[touching], rtol=1e-11)


def test_two_equal_caps_slip_together_at_the_approach():
    pair = interacting([20.0, 20.0, 20.0], [0.0, 0.0, 1e-3], [0.0, 0.02, 0.3], [0.0] * 3, E)
    d = float(pair.approach_m(200.0))
    np.testing.assert_allclose(pair.lift_off_m(d), [d, d, np.nan], rtol=1e-14)


def test_a_lower_cap_against_the_load_at_which_it_is_first_touched():
    # The theorem: sheared by e, the loads are those of the approach d - e.
    radius, depth, r = np.array([24.0, 27.0]), np.array([0.0, 2.4e-7]), 0.01
    pair = interacting(radius, depth, [0.0, r], [0.0, 0.0], E)
    # y = g_1 where only the first touches, and it sinks the surface under the second to its depth:
    # g - k g^1.5 / (pi E* r) = h
    k = 4 / 3 * E * np.sqrt(24.0) / (np.pi * E * r)
    touch = np.roots([-k, 1, 0, -depth[1]])  # in sqrt(g)
    g = min(root.real for root in touch if abs(root.imag) < 1e-12 and root.real > 0) ** 2
    d = float(pair.approach_m(250.0))
    assert pair.asperity_loads_N(d)[1] > 0
    np.testing.assert_allclose(pair.lift_off_m(d), [d, d - g], rtol=1e-11)


def test_distant_caps_have_the_limits_of_plain_caps_and_families():
    radius, depth = np.array([23.8] * 5 + [26.7] * 18), np.array([0.0] * 5 + [2.4e-7] * 18)
    _, _, x_m, y_m = random_face(4)
    for load in (100.0, 460.4):
        alone = slip_curve(caps(radius, depth, E), load, MU, KAPPA)
        two = slip_curve(families((5, 18), (23.8, 26.7), (0, 2.4e-7), E), load, MU, KAPPA)
        errors = []
        for apart in (1e4, 1e7):
            curve = interacting(radius, depth, apart * x_m, apart * y_m, E)
            limits_m = slip_curve(curve, load, MU, KAPPA).limits_m
            np.testing.assert_array_equal(np.isnan(limits_m), np.isnan(alone.limits_m))
            errors.append(np.nanmax(np.abs(limits_m / alone.limits_m - 1)))
        assert errors[1] < 1e-5
        assert errors[0] / errors[1] == pytest.approx(1e3, rel=0.05)
        np.testing.assert_allclose(limits_m[[0, 5]], two.limits_m, rtol=1e-5)


def test_a_spring_in_series_moves_the_limits_by_its_share_of_the_force():
    curve = interacting(*random_face(2), E)
    joint = slip_curve(curve, 460.0, MU, KAPPA)
    other = slip_curve(in_series(curve, -BULK), 460.0, MU, KAPPA)
    touching = np.isfinite(joint.limits_m)
    force_N = joint.force_N(joint.limits_m[touching])
    np.testing.assert_allclose(
        other.limits_m[touching], joint.limits_m[touching] - KAPPA * BULK * force_N, rtol=1e-10
    )
    np.testing.assert_array_equal(np.isfinite(other.limits_m), touching)


def test_phases_change_at_the_first_and_the_last_limit():
    joint = slip_curve(interacting(*random_face(3), E), 460.0, MU, KAPPA)
    first, last = np.nanmin(joint.limits_m), np.nanmax(joint.limits_m)
    displacement = np.array([first * (1 - 1e-9), first * (1 + 1e-9), 0.999 * last, 1.001 * last])
    np.testing.assert_array_equal(joint.phase(displacement), ["GPS", "PPS", "PPS", "TS"])


def test_many_approaches_and_none():
    curve = interacting(*random_face(5), E)
    d = curve.approach_m(np.array([[10.0, 100.0], [400.0, 900.0]]))
    limits_m = curve.lift_off_m(d)
    assert limits_m.shape == (2, 2, 23)
    np.testing.assert_allclose(limits_m[1, 0], curve.lift_off_m(d[1, 0]), rtol=1e-12)
    assert np.isnan(curve.lift_off_m(-1e-9)).all()


def test_a_cap_that_grows_at_first_has_no_limit():
    # Three heavy neighbours, their contacts almost merging, leave no room for a small one.
    angle = np.array([0, 2, 4]) * np.pi / 3
    x_m, y_m = np.append(np.cos(angle), 0) * 1.16e-2, np.append(np.sin(angle), 0) * 1.16e-2
    curve = interacting([500.0] * 3 + [1.0], [1e-9] * 3 + [0.0], x_m, y_m, E)
    d = float(curve.approach_m(3 * 4 / 3 * E * 1e-2**3 / 500.0))
    assert (curve.asperity_loads_N(d) > 0).all()
    np.testing.assert_array_equal(np.isnan(curve.lift_off_m(d)), [False, False, False, True])


def test_quick_enough_to_be_asked_for_always():
    curve = interacting(*random_face(6), E)
    d = float(curve.approach_m(2000.0))
    assert np.isfinite(curve.lift_off_m(d)).all()
    assert in_filters(lambda: curve.lift_off_m(d)) < 0.5
