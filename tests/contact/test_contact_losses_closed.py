"""The tables of losses in closed form: powers, cubics and Hertz contacts, to rounding."""

import numpy as np
import pytest

from capslip.contact.solvers.hertz import load_drop_of_asperity, loss_of_asperity
from capslip.contact.solvers.losses import (
    _cubic,
    apart,
    losses,
    rates_per_m,
    region_losses,
)

ONE = np.ones(())


def power_law(power, c_0, s_N):
    """Return withdrawals and losses where the secant compliance grows by some power of the force.

    L = 4 s x - 8 integral of x ds with x = (c_0 + s^p) s: 4 s^(p+2) p / (p + 2).
    """
    return (c_0 + s_N**power) * s_N, 4.0 * power / (power + 2.0) * s_N ** (power + 2.0)


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_a_power_is_met_exactly_between_the_loads_and_the_first_one_below_them_too(power):
    """Below the first load slip begins with the power 1, which leaves a loss as the cube."""
    s_N, c_0 = np.array([0.1, 0.2, 0.5, 0.8, 1.0]), 0.7
    x_m, loss_J = power_law(power, c_0, s_N)
    found, carries = losses(1.0 / c_0, s_N, x_m, loss_J)
    assert carries.all()
    assert found.slope == pytest.approx((power + 2.0) / power, rel=1e-9)
    assert found.offs() == pytest.approx(0.0, abs=1e-3)  # of the points between
    table_m, table_N, table_J = found.table()
    between = table_N >= (0.0 if power == 1.0 else s_N[0])
    assert between.sum() > 4 * 50
    exact_m, exact_J = power_law(power, c_0, table_N[between])
    assert table_m[between] == pytest.approx(exact_m, rel=1e-12)
    assert table_J[between] == pytest.approx(exact_J, rel=1e-12)


def test_below_the_first_load_the_loss_goes_to_the_cube_of_the_force():
    """As a contact begins to slip: x - c_0 s as s^2."""
    s_N, c_0 = np.array([0.1, 0.2, 0.5, 1.0]), 0.7
    found, _ = losses(1.0 / c_0, s_N, *power_law(2.0, c_0, s_N))
    table_m, table_N, table_J = found.table()
    least = table_N < 1e-3 * s_N[0]
    assert least.sum() > 10
    assert table_m[0] == pytest.approx(1e-5 * table_m[-1], rel=0.1)
    slopes = np.diff(np.log(table_J[least])) / np.diff(np.log(table_N[least]))
    assert slopes == pytest.approx(3.0, abs=0.01)
    assert (table_m[least] / table_N[least]) == pytest.approx(c_0, rel=1e-3)


def test_loads_at_which_nothing_slips_or_compliance_falls_carry_no_loss():
    s_N, c_0 = np.array([0.05, 0.1, 0.2, 0.5, 0.8, 1.0]), 0.7
    x_m, loss_J = power_law(1.0, c_0, s_N)
    x_m[0] = c_0 * s_N[0] * (1.0 + 1e-10)  # rounding
    x_m[2] = (c_0 + 0.9) * s_N[2]  # more than at the next two
    loss_J[3] = 0.0
    found, carries = losses(1.0 / c_0, s_N, x_m, loss_J)
    assert carries.tolist() == [False, True, False, False, True, True]
    assert found.end == (1.0, x_m[-1])
    assert np.exp(found.log_loss) == pytest.approx(loss_J[[1, 4, 5]])


def test_a_cubic_is_one_of_its_values_and_slopes():
    z = np.array([1.0, 3.0, 3.5])
    value, slope = z**3 - 2.0 * z, 3.0 * z**2 - 2.0
    for k in (0, 1):
        at, values, slopes = _cubic(z, value, slope, k)
        assert (at[0], at[-1]) == (z[k], pytest.approx(z[k + 1] - (z[k + 1] - z[k]) / len(at)))
        assert values == pytest.approx(at**3 - 2.0 * at, rel=1e-12)
        assert slopes == pytest.approx(3.0 * at**2 - 2.0, rel=1e-12)


def test_rates_of_regions_in_contact_and_after():
    """Of a Hertz contact 1 / its compression; of one that let go the withdrawal at which it did."""
    x_m, compression_m = np.array([0.1, 0.4, 0.9]), np.array([1.0, 0.5])
    share = np.maximum(1.0 - x_m[:, None] / compression_m, 0.0) ** 1.5
    gap_m = np.maximum(x_m[:, None] - compression_m, 0.0)
    expected = np.tile(1.0 / compression_m, (3, 1))
    assert rates_per_m(x_m, share, gap_m) == pytest.approx(expected, rel=1e-12)
    more = rates_per_m(x_m, np.array([[1.0 + 1e-9, 0.0]] * 3), np.array([[0.0, 1.0]] * 3))
    assert more[:, 0].tolist() == [0.0] * 3  # none carries more than before
    assert more[:, 1] == pytest.approx(1e6 / x_m)  # a gap as wide as the withdrawal


def test_regions_that_are_hertz_contacts_have_their_losses_at_every_load():
    load_N, compression_m, length = np.array([1.0, 3.0]), np.array([1.0, 0.6]), (1.0, 2.0)
    x_m = np.array([0.05, 0.2, 0.5, 0.7, 1.0])
    rate = np.tile(1.0 / compression_m, (5, 1))
    unit = loss_of_asperity(ONE, ONE, x_m[:, None] * rate)
    found = region_losses(load_N, rate[0], x_m, rate, load_N * length * unit)
    assert found.offs() == pytest.approx(0.0, abs=1e-9)
    table_m, table_N, table_J = found.table()
    assert (table_m[0], table_m[-1]) == pytest.approx((1e-5, 1.0))
    t = table_m[:, None] / compression_m
    assert table_N == pytest.approx(load_drop_of_asperity(load_N, ONE, t).sum(axis=1), rel=1e-9)
    exact_J = (load_N * length * loss_of_asperity(ONE, ONE, t)).sum(axis=1)
    assert table_J == pytest.approx(exact_J, rel=1e-9)
    assert table_N[-1] == pytest.approx(load_N.sum())


@pytest.mark.parametrize("factor", [1.0, 1.1, 0.9])
def test_two_tables_are_apart_by_twice_what_they_differ_by(factor):
    s_N = np.geomspace(1e-4, 1.0, 300)
    one = s_N, s_N, s_N**3
    other = s_N, s_N, s_N**3 * np.where(s_N > 0.3, factor, 1.0)
    assert apart(other, one, 0.05) == pytest.approx(2.0 * abs(factor - 1.0), abs=1e-9)
    assert apart(one, other, 0.05) == pytest.approx(2.0 * abs(1.0 / factor - 1.0), abs=1e-9)
    late = s_N, s_N, s_N**3 * np.where(s_N > 0.97, 2.0, 1.0)  # beyond what is compared
    assert apart(one, late, 0.05) == pytest.approx(0.0, abs=1e-9)
    early = s_N, s_N, s_N**3 * np.where(s_N < 0.04, 2.0, 1.0)
    assert apart(one, early, 0.05) == pytest.approx(0.0, abs=1e-9)
