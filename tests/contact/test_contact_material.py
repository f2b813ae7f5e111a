"""Composite constants against closed forms."""

import math

import pytest

from capslip.contact.material import composite, dundurs_beta
from capslip.errors import SettingsError


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.3, 0.49])
def test_equal_bodies_have_the_closed_form_of_kappa(nu):
    pair = composite((7e10, 7e10), (nu, nu))
    assert pair.kappa == pytest.approx((2 - nu) / (2 * (1 - nu)), rel=1e-15)
    assert pair.E_star_Pa == pytest.approx(7e10 / (2 * (1 - nu**2)), rel=1e-15)


def test_steel_has_the_published_kappa():
    assert composite((2e11, 2e11), (0.3, 0.3)).kappa == pytest.approx(1.2143, abs=5e-5)


def test_a_rigid_body_adds_no_compliance():
    pair = composite((7e10, 1e30), (0.3, 0.1))
    assert pair.E_star_Pa == pytest.approx(7e10 / 0.91, rel=1e-12)
    assert pair.G_star_m2_per_N == pytest.approx(1.7 * 2.6 / 7e10, rel=1e-12)


def test_order_of_bodies_does_not_matter():
    assert composite((7e10, 2e11), (0.33, 0.3)) == composite((2e11, 7e10), (0.3, 0.33))


@pytest.mark.parametrize("E", [0.0, -1.0, math.inf, math.nan])
def test_a_bad_modulus_is_named(E):
    with pytest.raises(SettingsError, match=r"youngs_modulus_Pa: got .*expected"):
        composite((2e11, E), (0.3, 0.3))


@pytest.mark.parametrize("nu", [0.5, -1.0, 0.7, math.nan])
def test_a_bad_poisson_ratio_is_named(nu):
    with pytest.raises(SettingsError, match=r"poisson_ratio: got .*expected -1 < nu < 0\.5"):
        composite((2e11, 2e11), (0.3, nu))


def test_dundurs_beta_vanishes_where_nothing_couples():
    assert dundurs_beta((210e9, 70e9), (0.4999999, 0.4999999)) == pytest.approx(0.0, abs=1e-6)
    assert dundurs_beta((200e9, 3e9), (0.3, 0.4)) == -dundurs_beta((3e9, 200e9), (0.4, 0.3))
    # Against a rigid body (1 - 2 nu) / (2 (1 - nu)), Johnson 1987, Sec. 5.1.
    assert dundurs_beta((3e9, 1e30), (0.25, 0.3)) == pytest.approx(1 / 3)
