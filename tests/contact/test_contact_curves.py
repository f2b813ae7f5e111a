"""Normal curves against the paper's tables, closed forms and 50-digit arithmetic."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capslip.contact.bulk import bulk_compliance_m_per_N, bulk_of_face_m_per_N
from capslip.contact.curve import in_series
from capslip.contact.material import composite
from capslip.contact.models.caps import caps
from capslip.contact.models.families import families
from capslip.contact.models.flat import flat
from capslip.contact.models.mean_field import mean_field
from capslip.contact.solvers.hertz import load_drop_of_asperity, loss_of_asperity
from capslip.errors import ContactError, SettingsError
from capslip.surface.heightmap import HeightMap

STEEL = composite((200e9, 200e9), (0.3, 0.3))
E = STEEL.E_star_Pa
R_G, R_P = 23.8, 26.7
FACE = (0.04, 0.06)
BULK_M_PER_N = bulk_compliance_m_per_N(FACE, E)

# m, n, delta_n and h in 1e-7 m, printed load: Table 1 of the paper
TABLE_1 = [
    (5, 18, 2.5, 2.4, 460),
    (5, 4, 2.5, 2.4, 450),
    (5, 9, 2.5, 2.4, 454),
    (5, 36, 2.5, 2.4, 474),
    (5, 72, 2.5, 2.4, 501),
    (1, 18, 2.5, 2.4, 103),
    (3, 18, 2.5, 2.4, 282),
    (8, 18, 2.5, 2.4, 728),
    (11, 18, 2.5, 2.4, 997),
    (5, 18, 2.7, 2.4, 572),
    (5, 18, 2.9, 2.4, 710),
    (5, 18, 3.1, 2.4, 869),
    (3, 18, 2.3, 2.2, 250),
    (7, 18, 2.7, 2.6, 716),
]


def two(m=5.0, n=18.0, h=2.4e-7):
    return families((m, n), (R_G, R_P), (0.0, h), E)


def exact_load(curve, approach):
    """N(d) of a sum of Hertz contacts in 50 digits."""
    total = mp.mpf(0)
    for count, radius, depth in zip(curve.count, curve.radius_m, curve.depth_m, strict=True):
        g = max(approach - mp.mpf(float(depth)), 0)
        total += mp.mpf(float(count)) * mp.sqrt(mp.mpf(float(radius))) * g ** mp.mpf("1.5")
    return total * 4 / 3 * mp.mpf(curve.E_star_Pa)


def exact_loss_integral(curve, approach, withdrawal):
    """8 * integral of the load drop - 4 e * load drop, in 50 digits."""

    def integral(d):
        total = mp.mpf(0)
        for count, radius, depth in zip(curve.count, curve.radius_m, curve.depth_m, strict=True):
            g = max(d - mp.mpf(float(depth)), 0)
            total += mp.mpf(float(count)) * mp.sqrt(mp.mpf(float(radius))) * g ** mp.mpf("2.5")
        return total * 4 / 3 * mp.mpf(curve.E_star_Pa) * 2 / 5

    load, left = exact_load(curve, approach), exact_load(curve, approach - withdrawal)
    area = load * withdrawal - integral(approach) + integral(approach - withdrawal)
    return 8 * area - 4 * withdrawal * (load - left)


def hertz_curves():
    """Draw sums of Hertz contacts with some contact, and their approach."""
    depth = st.one_of(st.just(0.0), st.floats(1e-16, 2e-3))
    family = st.tuples(st.integers(0, 80), st.floats(1e-2, 1e3), depth)
    return st.tuples(
        st.lists(family, min_size=0, max_size=4),
        st.floats(0.1, 100.0),
        st.integers(1, 20),
        st.floats(1e-15, 1e-3),
    ).map(
        lambda drawn: (
            families(*zip((drawn[2], drawn[1], 0.0), *drawn[0], strict=True), E),
            drawn[3],
        )
    )


@pytest.mark.parametrize(("m", "n", "delta_n", "h", "printed_N"), TABLE_1)
def test_table_1_of_the_paper(m, n, delta_n, h, printed_N):
    load = two(m, n, h * 1e-7).load_N(delta_n * 1e-7)
    assert load == pytest.approx(printed_N, rel=1.2e-3)


@settings(max_examples=200, deadline=None, database=None)
@given(hertz_curves(), st.floats(-14, 1))
def test_all_digits_of_load_drop_and_loss(drawn, exponent):
    curve, approach = drawn
    withdrawal = 10.0**exponent * approach
    with mp.workdps(50):
        d, e = mp.mpf(approach), mp.mpf(withdrawal)
        drop = exact_load(curve, d) - exact_load(curve, d - e)
        with mp.workdps(120):
            loss = exact_loss_integral(curve, d, e)
        assert curve.load_N(approach) == pytest.approx(float(exact_load(curve, d)), rel=1e-13)
        assert curve.load_drop_N(approach, withdrawal) == pytest.approx(float(drop), rel=1e-13)
        assert curve.loss_integral_J(approach, withdrawal) == pytest.approx(float(loss), rel=1e-13)


@settings(max_examples=200, deadline=None, database=None)
@given(hertz_curves(), st.floats(-14, 0), st.sampled_from([0.0, 1e-12, 1e-9]))
def test_inverses_to_the_digits_their_condition_leaves(drawn, exponent, compliance):
    curve, approach = drawn
    load = float(curve.load_N(approach))
    curve = in_series(curve, compliance)
    pressed = curve.approach_m(load)
    assert pressed == pytest.approx(approach + compliance * load, rel=1e-13)
    drop = 10.0**exponent * load
    withdrawal = curve.withdrawal_m(pressed, drop)
    stiffness = float(curve.stiffness_N_per_m(pressed, withdrawal))
    tolerance = 1e-13 * drop + 1e-15 * stiffness * pressed
    assert curve.load_drop_N(pressed, withdrawal) == pytest.approx(drop, abs=tolerance, rel=0)
    assert withdrawal <= pressed * (1 + 1e-15)
    there = curve.loss_integral_at_drop_J(pressed, drop)
    if drop < 0.999 * load:
        assert there == pytest.approx(float(curve.loss_integral_J(pressed, withdrawal)), rel=1e-11)


@settings(max_examples=100, deadline=None, database=None)
@given(hertz_curves(), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_scaling_of_lengths_and_modulus(drawn, scale, harder):
    curve, d = drawn
    wide = families(curve.count, scale * curve.radius_m, scale * curve.depth_m, harder * E)
    e = 0.3 * d
    for power, one, other in [
        (2, curve.load_N(d), wide.load_N(scale * d)),
        (1, curve.stiffness_N_per_m(d), wide.stiffness_N_per_m(scale * d)),
        (2, curve.load_drop_N(d, e), wide.load_drop_N(scale * d, scale * e)),
        (3, curve.loss_integral_J(d, e), wide.loss_integral_J(scale * d, scale * e)),
    ]:
        assert other == pytest.approx(float(one) * harder * scale**power, rel=1e-9)


def test_one_contact_is_sheared_alike_in_both_directions():
    k, g, x = 2.0, np.array([3.0, 3.0, -1.0]), np.array([1.0, 7.0, 1.0])
    drop, loss = load_drop_of_asperity(k, g, x), loss_of_asperity(k, g, x)
    np.testing.assert_array_equal(load_drop_of_asperity(k, g, -x), -drop)
    np.testing.assert_array_equal(loss_of_asperity(k, g, -x), loss)
    np.testing.assert_allclose(drop, [k * (3**1.5 - 2**1.5), k * 3**1.5, 0.0], rtol=1e-15)
    assert loss[2] == 0.0


def test_stiffness_is_the_slope_of_the_load():
    curve, d, step = two(), 3e-7, 1e-12
    slope = (curve.load_N(d + step) - curve.load_N(d - step)) / (2 * step)
    assert curve.stiffness_N_per_m(d) == pytest.approx(slope, rel=1e-6)
    assert curve.stiffness_N_per_m(d, 0.9e-7) == pytest.approx(curve.stiffness_N_per_m(2.1e-7))


def test_families_are_caps_that_are_equal():
    radius, depth = [R_G] * 5 + [R_P] * 18, [0.0] * 5 + [2.4e-7] * 18
    shuffled = np.random.default_rng(0).permutation(23)
    each = caps(np.array(radius)[shuffled], np.array(depth)[shuffled], E)
    d = np.geomspace(1e-10, 1e-6, 40)
    np.testing.assert_allclose(each.load_N(d), two().load_N(d), rtol=1e-13)
    np.testing.assert_allclose(each.approach_m(d * 1e9), two().approach_m(d * 1e9), rtol=1e-13)
    np.testing.assert_allclose(
        each.asperity_loads_N(3e-7),
        two().asperity_loads_N(3e-7)[(np.array(depth)[shuffled] > 0).astype(int)],
    )


def test_families_are_sorted_and_count_from_the_highest():
    given_order = families((18, 5), (R_P, R_G), (2.4e-7, 0.0), E)
    np.testing.assert_array_equal(given_order.count, [5, 18])
    swapped = families((5, 18), (R_G, R_P), (0.0, -2.4e-7), E)
    np.testing.assert_array_equal(swapped.count, [18, 5])
    np.testing.assert_array_equal(swapped.depth_m, [0.0, 2.4e-7])
    assert swapped.load_N(1e-7) == caps([R_P] * 18, [0.0] * 18, E).load_N(1e-7)


def test_an_absent_family_carries_nothing_and_is_not_touched():
    low = two(m=0)
    assert low.touch_m == 2.4e-7
    assert low.load_N(2.4e-7) == 0.0
    assert low.approach_m(low.load_N(2.5e-7)) == pytest.approx(2.5e-7, rel=1e-13)
    assert two(n=0).load_N(2.5e-7) == pytest.approx(5 * 89.35026, rel=1e-6)


def test_sets_of_parameters_broadcast():
    h = np.array([0.0, 1e-7, 2.4e-7])
    many = families((5, 18), (R_G, R_P), np.stack([0 * h, h], axis=-1)[:, None, :], E)
    d, e = np.geomspace(1e-8, 1e-6, 7), 3e-8
    assert many.load_N(d).shape == (3, 7)
    for i in range(3):
        one = two(h=h[i])
        np.testing.assert_array_equal(many.load_N(d)[i], one.load_N(d))
        np.testing.assert_array_equal(many.loss_integral_J(d, e)[i], one.loss_integral_J(d, e))
        np.testing.assert_allclose(many.approach_m(460.0)[i, 0], one.approach_m(460.0), rtol=1e-15)


@pytest.mark.parametrize("sides", [(1.0, 1.0), (2.0, 3.0), (3.0, 2.0), (1.0, 50.0)])
def test_bulk_sinking_of_a_rectangle_by_quadrature(sides):
    # Mean over pairs of points of 1 / (pi r), with the density of differences of two points
    b, a = sides

    def density(x, y):
        return 4 * (a - x) * (b - y) / (a * b) ** 2 / mp.pi

    def along(angle):
        corner = min(a / mp.cos(angle), b / mp.sin(angle))
        return mp.quad(lambda r: density(r * mp.cos(angle), r * mp.sin(angle)), [0, corner])

    expected = mp.quad(along, [0, mp.atan2(b, a), mp.pi / 2])
    assert bulk_compliance_m_per_N(sides, 1.0) == pytest.approx(float(expected), rel=1e-12)


def outlined(inside, points=400):
    """Return a square face of side 2 of which a part was measured."""
    y, x = (np.mgrid[:points, :points] + 0.5) * 2 / points - 1
    height_m = np.where(inside(x, y), 0.0, np.nan)
    return HeightMap(height_m, (2 / points, 2 / points))


def test_bulk_of_a_disc_is_that_of_even_pressure_on_a_circle():
    # Mean sinking 16 p a / (3 pi E*): Johnson (1987), Eq. 3.29, over the circle
    disc = outlined(lambda x, y: x**2 + y**2 < 1)
    assert bulk_of_face_m_per_N(disc, 2.0) == pytest.approx(16 / (3 * np.pi**2 * 2.0), rel=3e-3)
    # less than that of its square by what the corners take
    square = bulk_compliance_m_per_N((2, 2), 2.0)
    assert bulk_of_face_m_per_N(disc, 2.0) == pytest.approx(1.142 * square, rel=3e-3)


def test_bulk_of_a_washer_is_known_by_its_discs():
    # Even pressure 1 on a ring: all pairs of the disc, less those with the hole in it
    inner = 0.5

    def sinking(radius, at):  # of a disc under unit pressure, at a distance from its middle
        if at <= radius:
            return 4 * radius / mp.pi * mp.ellipe((at / radius) ** 2)
        m = (radius / at) ** 2
        return 4 * at / mp.pi * (mp.ellipe(m) - (1 - m) * mp.ellipk(m))

    def over_ring(radius):
        return mp.quad(lambda r: 2 * mp.pi * r * sinking(radius, r), [inner, 1])

    area = mp.pi * (1 - inner**2)
    expected = (over_ring(1) - over_ring(inner)) / area**2
    ring = outlined(lambda x, y: (x**2 + y**2 < 1) & (x**2 + y**2 > inner**2))
    assert bulk_of_face_m_per_N(ring, 1.0) == pytest.approx(float(expected), rel=3e-3)


def test_points_lost_here_and_there_leave_the_bulk():
    lost = np.random.default_rng(0).random((400, 400)) < 0.3
    some = outlined(lambda x, y: ~lost)
    whole = bulk_compliance_m_per_N((2, 2), 1.0)
    assert bulk_of_face_m_per_N(some, 1.0) == pytest.approx(whole, rel=3e-3)
    part = outlined(lambda x, y: (x > -0.5) & (np.abs(y) < 0.25))  # a rectangle on a larger map
    assert bulk_of_face_m_per_N(part, 1.0) == pytest.approx(
        bulk_compliance_m_per_N((0.5, 1.5), 1.0), rel=1e-12
    )
    one = outlined(lambda x, y: (x > -0.999) | (y > -0.999))  # as good as the closed form
    assert bulk_of_face_m_per_N(one, 1.0) == pytest.approx(whole, rel=1e-3)


def test_bulk_factor_of_published_faces_and_of_thin_strips():
    assert bulk_compliance_m_per_N((1, 1), 1.0) == pytest.approx(0.946, abs=5e-4)
    assert bulk_compliance_m_per_N((2, 3), 1.0) * 6**0.5 == pytest.approx(0.937, abs=5e-4)
    t = 1e-9  # 2/pi [ln(2 L / w) + 1/2] / L for a strip of length L = 1 and width w
    strip = 2 * (np.log(2 / t) + 0.5) / np.pi
    assert bulk_compliance_m_per_N((t, 1.0), 1.0) == pytest.approx(strip, rel=1e-8)


def test_mean_field_adds_the_sinking_less_each_contacts_own_share():
    radius, depth = [R_G] * 5 + [R_P] * 18, [0.0] * 5 + [2.4e-7] * 18
    plain, sunk = (
        caps(radius, depth, E),
        mean_field(radius, depth, E, BULK_M_PER_N, 100.0),
    )
    share = 1 - 1 / np.sqrt(5)  # only the five high caps touch under 100 N
    loads = np.array([1.0, 100.0, 460.0, 2000.0])
    more = share * BULK_M_PER_N * loads
    np.testing.assert_allclose(sunk.approach_m(loads), plain.approach_m(loads) + more, rtol=1e-13)
    np.testing.assert_allclose(sunk.load_N(sunk.approach_m(loads)), loads, rtol=1e-12)


def test_one_cap_has_no_field_to_sink_in():
    assert mean_field([R_G], [0.0], E, BULK_M_PER_N, 10.0).compliance_m_per_N == 0.0


def test_taking_the_bulk_away_again_restores_the_curve():
    bulk = BULK_M_PER_N
    sunk = in_series(two(), bulk)
    assert in_series(sunk, -bulk).approach_m(460.0) == two().approach_m(460.0)


def test_a_bulk_that_the_contacts_do_not_have_cannot_be_taken():
    compliance = -1.01 / two().stiffness_N_per_m(2.5e-7)
    curve = in_series(two(), compliance)
    assert curve.approach_m(10.0) > 0
    with pytest.raises(ContactError, match=r"fall with growing load; expected more than"):
        curve.approach_m(float(two().load_N(2.5e-7)))
    with pytest.raises(ContactError, match="flat"):
        in_series(flat(460.0), -1e-12)


@pytest.mark.parametrize("compliance", [0.0, 2e-10])
def test_flat_loses_nothing_below_total_slip(compliance):
    plane = in_series(flat(460.0), compliance)
    d = plane.approach_m(460.0)
    assert d == 460.0 * compliance
    drops = np.array([0.0, 1.0, 459.0, 460.0])
    np.testing.assert_array_equal(plane.loss_integral_at_drop_J(d, drops), 0.0)
    np.testing.assert_allclose(plane.withdrawal_m(d, drops), compliance * drops)
    np.testing.assert_allclose(plane.load_drop_N(d, d + np.array([1e-9, 1.0])), 460.0)
    np.testing.assert_allclose(plane.loss_integral_J(d, d + 1e-9), 4 * 460.0 * 1e-9, rtol=1e-6)
    np.testing.assert_array_equal(plane.load_N(d), 460.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((5, 18), (0.0, R_P), (0, 0), E), "radius_m: got 0"),
        (((5, 18), (-1.0, R_P), (0, 0), E), "radius_m: got -1"),
        (((5, 18), (R_G, np.nan), (0, 0), E), "radius_m: got nan"),
        (((5, -1), (R_G, R_P), (0, 0), E), "count: got -1"),
        (((5, 18), (R_G, R_P), (0, np.inf), E), "depth_m: got inf"),
        (((5, 18), (R_G, R_P), (0, 0), 0.0), "E_star_Pa: got 0"),
        (((5, 18), (R_G, R_P), (0, 0), -E), "E_star_Pa: got -"),
    ],
)
def test_bad_values_are_named(arguments, message):
    with pytest.raises(SettingsError, match=message):
        families(*arguments)


@pytest.mark.parametrize("preload_N", [0.0, -1.0, np.nan])
def test_bad_preloads_are_named(preload_N):
    with pytest.raises(SettingsError, match="preload_N: got"):
        flat(preload_N)
    with pytest.raises(SettingsError, match="preload_N: got"):
        mean_field([1.0], [0.0], E, BULK_M_PER_N, preload_N)


def test_a_load_that_is_lost_beside_the_depths_is_named():
    with pytest.raises(ContactError, match="no cap bears 1e-30 N"):
        mean_field([1.0], [1e-8], E, BULK_M_PER_N, 1e-30)


def test_bad_faces_are_named():
    with pytest.raises(SettingsError, match="side_m"):
        bulk_compliance_m_per_N((0.0, 1.0), E)


def test_no_asperity_is_an_error():
    with pytest.raises(ContactError, match="no asperities"):
        caps([], [], E)
    with pytest.raises(ContactError, match="no asperities"):
        two(m=0, n=0)


@pytest.mark.parametrize("load_N", [-1.0, np.nan, [1.0, -1.0]])
def test_negative_loads_are_refused(load_N):
    with pytest.raises(SettingsError, match="load_N: got"):
        two().approach_m(load_N)


def test_a_contact_wider_than_its_asperity_is_an_error():
    curve = caps([1e-3, 1e-3], [0.0, 1e-4], E)
    bound = float(curve.load_N(1e-3))
    assert curve.approach_m(0.999 * bound) < 1e-3
    with pytest.raises(ContactError, match=r"wider than its asperity; expected less than"):
        curve.approach_m(1.001 * bound)
