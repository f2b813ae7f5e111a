"""Contacts near one another against closed forms, energies, the theorem and boundary elements."""

import mpmath as mp
import numpy as np
import pytest

from capslip.contact.certificate import hertz_over_point_load
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.models.interacting import interacting
from capslip.contact.solvers.hertz import loss_of_asperity
from capslip.contact.solvers.near_field import SMALL, carrying, near_field
from capslip.contact.solvers.shear import lift_off
from capslip.surface.heightmap import HeightMap

E = 110e9


def unlike(seed=1):
    """Return twelve caps near one another, five of which carry, as point loads too; preload."""
    rng = np.random.default_rng(seed)
    x_m, y_m = rng.uniform(0.0, 0.05, (2, 12))
    given = rng.uniform(5.0, 20.0, 12), rng.uniform(0.0, 4e-7, 12), x_m, y_m, E
    return interacting(*given, 100.0), interacting(*given), 100.0


def loads(curve, load_N):
    g = np.maximum(curve._compression(curve.approach_m(load_N)), 0.0)
    return g, curve.coefficient * g**1.5


@pytest.mark.parametrize("rho", [1e-3, 0.04, 0.3, 0.49])
def test_two_equal_caps_sink_one_another_by_the_closed_form(rho):
    R, r = 20.0, 0.02
    a = rho * r
    N = 4 * E * a**3 / (3 * R)
    pair = interacting([R, R], [0.0, 0.0], [0.0, r], [0.0, 0.0], E, preload_N=2 * N)
    share = 1.0 + 4 / 15 * rho**2 - 2 / np.pi * rho**3
    sunk = N / (np.pi * E * r) * share
    assert pair.approach_m(2 * N) - a**2 / R == pytest.approx(sunk, rel=1e-9, abs=0.0)


@pytest.mark.parametrize(("R", "higher_m"), [((20.0, 20.0), 0.0), ((12.0, 40.0), 3e-8)])
@pytest.mark.parametrize("load_N", [400.0, 800.0])
def test_two_caps_sink_one_another_as_boundary_elements_say(R, higher_m, load_N):
    """What each sinks by beyond its own compression, under the loads that the map shows."""
    r, pixel_m = 0.01, 1.25e-4
    ny, nx = 120, 200
    x, y = (np.arange(nx) + 0.5) * pixel_m, (np.arange(ny) + 0.5)[:, None] * pixel_m
    at = 0.5 * nx * pixel_m + np.array([-0.5, 0.5]) * r
    top_m = np.array([higher_m, 0.0])
    square = (x - at[:, None, None]) ** 2 + (y - 0.5 * ny * pixel_m) ** 2
    z = (top_m[:, None, None] - square / (2.0 * np.array(R)[:, None, None])).max(axis=0)
    curve = boundary_elements(HeightMap(z, (pixel_m,) * 2), E, preload_N=load_N, balanced=False)
    pressed = curve.pressed(load_N)
    left = x < 0.5 * nx * pixel_m
    p_Pa = pressed.pressure_Pa
    N = np.array([p_Pa[:, left].sum(), p_Pa[:, ~left].sum()]) * pixel_m**2
    k = 4 / 3 * E * np.sqrt(R)
    g = (N / k) ** (2 / 3)
    level_m = pressed.approach_m + top_m.max() - z.max()
    found = (level_m - g - (top_m.max() - top_m)) * np.pi * E * r / N[::-1]
    near = near_field(at, np.zeros(2), np.sqrt(R * g), E)
    said = 1.0 + sum(near.sunk_m(k, N, g)) * np.pi * E * r / N[::-1]
    a = np.sqrt(R * g)
    assert 0.3 * r < a.sum() < r
    assert found == pytest.approx(said, abs=5e-3)
    if load_N == 800.0:  # the free surface around the other one, and a point load, say otherwise
        of_hertz = hertz_over_point_load(a[::-1] / r)
        assert np.abs(found - of_hertz).max() > 8e-3


def test_what_contacts_sink_by_is_the_gradient_of_its_energy():
    curve, _, load_N = unlike()
    (_, N), k, near = loads(curve, load_N), curve.coefficient, curve.near

    def energy_J(N):
        by_width, by_slope = near.sunk_m(k, N, (N / k) ** (2 / 3))
        return N @ (3 / 8 * by_width + by_slope / 3)

    sunk_m = sum(near.sunk_m(k, N, (N / k) ** (2 / 3)))
    for i in np.flatnonzero(N):
        step_N = 1e-4 * N[i] * (np.arange(len(N)) == i)
        slope = (energy_J(N + step_N) - energy_J(N - step_N)) / (2.0 * step_N[i])
        assert slope == pytest.approx(sunk_m[i], rel=1e-7, abs=1e-5 * np.abs(sunk_m).max())


def test_a_change_is_the_difference_of_two_states_and_a_small_one_keeps_all_digits():
    curve, _, load_N = unlike()
    (g, N), k, near = loads(curve, load_N), curve.coefficient, curve.near
    less_m = 0.7 * g
    less_N = k * less_m**1.5
    change = near.changed_m(k, 0.5 * (N + less_N), 0.5 * (g + less_m), N - less_N, g - less_m)
    apart = np.subtract(near.sunk_m(k, N, g), near.sunk_m(k, less_N, less_m))
    assert np.array(change) == pytest.approx(apart, rel=1e-10, abs=1e-22)
    slope = near.changed_m(k, N, g, 1.5 * k * np.sqrt(g) * 1e-25, np.full(len(g), 1e-25) * (g > 0))
    step = near.changed_m(k, N, g, 1.5 * k * np.sqrt(g) * 1e-12, np.full(len(g), 1e-12) * (g > 0))
    assert 1e13 * np.array(slope) == pytest.approx(np.array(step), rel=1e-12, abs=0.0)


def test_what_loads_sink_by_is_the_change_from_no_load_on():
    curve, _, load_N = unlike()
    (g, N), k = loads(curve, load_N), curve.coefficient
    change = curve.near.changed_m(k, 0.5 * N, 0.5 * g, N, g)
    assert np.array(curve.near.sunk_m(k, N, g)) == pytest.approx(np.array(change), rel=1e-13)


def test_few_that_carry_among_many_sink_them_alike():
    rng = np.random.default_rng(3)
    n = SMALL + 26  # of fewer all rows are taken at once
    x_m, y_m = rng.uniform(0.0, 0.1, (2, n))
    near, k = near_field(x_m, y_m, np.zeros(n), E), np.full(n, 4e11)
    few = np.where(np.arange(n) % 9 == 0, 1e-7, 0.0)
    assert carrying(few).size == 10
    many = np.where(few > 0.0, few, 1e-30)  # all at once
    assert np.array(near.sunk_m(k, k * few**1.5, few)) == pytest.approx(
        np.array(near.sunk_m(k, k * many**1.5, many)), rel=1e-9
    )


def test_all_is_in_equilibrium_and_the_slope_is_that_of_the_curve():
    curve, _, load_N = unlike()
    d = float(curve.approach_m(load_N))
    g, N = loads(curve, load_N)
    sunk_m = curve.pair_compliance_m_per_N @ N + sum(curve.near.sunk_m(curve.coefficient, N, g))
    gap_m = g + sunk_m + curve.depth_m - d
    assert np.abs(gap_m[N > 0]).max() < 1e-13 * d
    assert gap_m.min() > -1e-13 * d
    e = 1e-5 * d
    slope = (curve.load_N(d + e) - curve.load_N(d - e)) / (2.0 * e)
    assert curve.stiffness_N_per_m(d) == pytest.approx(slope, rel=1e-7, abs=0.0)
    e = 0.4 * d
    slope = np.diff(curve.load_drop_N(d, e * np.array([1.0 - 1e-5, 1.0 + 1e-5])))[0] / (2e-5 * e)
    assert curve.stiffness_N_per_m(d, e) == pytest.approx(slope, rel=1e-6, abs=0.0)


def test_the_load_drop_is_the_theorem_and_the_energy_its_area():
    curve, _, load_N = unlike()
    d = float(curve.approach_m(load_N))
    node, weight = np.polynomial.legendre.leggauss(40)
    for share in (1e-3, 0.1, 0.5, 0.9, 1.2):
        e = share * d
        drop_N = float(curve.load_drop_N(d, e))
        assert drop_N == pytest.approx(load_N - float(curve.load_N(d - e)), rel=1e-10, abs=0.0)
        edges = np.linspace(0.0, e, 41)
        half = np.diff(edges)[:, None] / 2.0
        area = (half * weight * curve.load_drop_N(d, edges[:-1, None] + half * (1 + node))).sum()
        loss_J = float(curve.loss_integral_J(d, e))
        assert loss_J == pytest.approx(8.0 * area - 4.0 * drop_N * e, rel=1e-8, abs=0.0)
        if share < 1.0:
            assert float(curve.withdrawal_m(d, drop_N)) == pytest.approx(e, rel=1e-10, abs=0.0)
            at_drop_J = float(curve.loss_integral_at_drop_J(d, drop_N))
            assert at_drop_J == pytest.approx(loss_J, rel=1e-10, abs=0.0)
    g = curve._compression(d)
    alone_J = loss_of_asperity(curve.coefficient, g, curve._withdrawn(g, 1e-3 * d)).sum()
    assert abs(alone_J / float(curve.loss_integral_J(d, 1e-3 * d)) - 1.0) > 1e-4


def test_a_tiny_slip_keeps_all_digits_of_its_energy():
    """W goes with the cube of the displacement, however small it is."""
    curve, _, load_N = unlike()
    d = curve.approach_m(load_N)
    e = float(d) * np.array([1e-13, 1e-10])
    loss = curve.loss_integral_J(d, e) / e**3
    assert loss[0] == pytest.approx(loss[1], rel=1e-6, abs=0.0)


def test_a_contact_lifts_off_where_it_has_slipped_by_its_compression():
    curve, _, load_N = unlike()
    g, _ = loads(curve, load_N)
    on = np.flatnonzero(g > 0)
    C = curve.pair_compliance_m_per_N[np.ix_(on, on)]
    e, x = lift_off(curve.coefficient[on], C, g[on], curve.near.of(on))
    known = np.isfinite(e)
    assert known.sum() == 5
    assert x.diagonal()[known] == pytest.approx(g[on][known], rel=1e-9, abs=0.0)
    d = curve.approach_m(load_N)
    assert curve.lift_off_m(d)[on][known] == pytest.approx(e[known], rel=1e-12, abs=0.0)
    for at, i in zip(e[known], on[known], strict=True):
        assert curve.lifted(d, at * (1 + 1e-9))[i]
        assert not curve.lifted(d, at * (1 - 1e-9))[i]


def test_many_loads_at_once_are_those_one_by_one():
    curve, _, _ = unlike()
    load_N = np.linspace(1.0, 100.0, 20)
    one_by_one = [float(unlike()[0].approach_m(N)) for N in load_N.tolist()]
    assert curve.approach_m(load_N) == pytest.approx(one_by_one, rel=1e-12, abs=0.0)


def test_far_apart_it_is_gone():
    given = [20.0, 10.0], [0.0, 1e-8], [0.0, 10.0], [0.0, 3.0], E
    near, points = interacting(*given, 100.0), interacting(*given)
    assert near.near is not None
    assert float(near.approach_m(100.0)) == pytest.approx(
        float(points.approach_m(100.0)), rel=1e-8, abs=0.0
    )


def test_contacts_that_run_together_act_as_point_loads():
    given = [20.0, 20.0], [0.0, 0.0], [0.0, 5e-3], [0.0, 0.0], E
    assert interacting(*given, 460.0).near is None
    curve, points = interacting(*given, 50.0), interacting(*given)
    assert curve.near is not None
    assert curve.approach_m(50.0) != points.approach_m(50.0)
    for load_N in (5e3, 5e5):
        assert curve.overlapping_pairs(float(curve.approach_m(load_N))) == 1
        assert float(curve.approach_m(load_N)) == pytest.approx(float(points.approach_m(load_N)))


@pytest.mark.parametrize(("a_m", "held"), [(1e-3, True), (3e-3, False), (0.0, True)])
def test_a_peak_inside_a_contact_or_two_that_run_together_have_none(a_m, held):
    x_m, other_m = np.array([0.0, 5e-3, 0.1]), 2.5e-3
    assert (near_field(x_m, 0 * x_m, np.array([a_m, other_m, 0.0]), E) is not None) == held
    inside = near_field(x_m / 3.0, 0 * x_m, np.array([0.0, other_m, 0.0]), E)
    assert inside is None
    nobody = near_field(x_m * 1e-6, 0 * x_m, np.zeros(3), E)
    assert nobody is not None


@pytest.mark.parametrize("rho", [1e-3, 0.02, 0.04, 0.3, 0.49])
def test_the_free_surface_around_a_hertz_contact_sinks_as_johnson_says(rho):
    with mp.workdps(40):  # Eq. 3.42a over that of a point load
        exact = (2 * mp.mpf(rho) ** 2 - 1) * mp.asin(rho) + mp.mpf(rho) * mp.sqrt(
            1 - mp.mpf(rho) ** 2
        )
        factor = 3 * exact / (4 * mp.mpf(rho) ** 3)
    assert hertz_over_point_load(np.array(rho)) == pytest.approx(float(factor), rel=1e-9, abs=0.0)
