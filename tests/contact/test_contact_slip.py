"""Slip, loop and energy against the paper's equations, published values and 50-digit arithmetic."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capslip.contact.bulk import bulk_compliance_m_per_N
from capslip.contact.curve import in_series
from capslip.contact.material import composite
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.models.caps import caps
from capslip.contact.models.families import families
from capslip.contact.models.flat import flat
from capslip.contact.models.interacting import interacting
from capslip.contact.models.mean_field import mean_field
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.errors import ContactError, SettingsError
from capslip.surface.heightmap import HeightMap

STEEL = composite((200e9, 200e9), (0.3, 0.3))
E, KAPPA = STEEL.E_star_Pa, STEEL.kappa
MU = 0.2
R_G, R_P = 23.8, 26.7
BULK = bulk_compliance_m_per_N((0.04, 0.06), E)


def at_approach(curve, approach_m, mu=MU, kappa=KAPPA):
    """Return the slip curve of a joint whose approach is given."""
    return SlipCurve(curve, float(curve.load_N(approach_m)), approach_m, mu, kappa)


def reference():
    return at_approach(families((5, 18), (R_G, R_P), (0.0, 2.4e-7), E), 2.5e-7)


def random_slip(seed, model="caps", mu=MU):
    rng = np.random.default_rng(seed)
    radius, depth = rng.uniform(1, 50, 9), rng.uniform(0, 4e-7, 9)
    curve = caps(radius, depth, E)
    if model == "mean_field":
        curve = mean_field(radius, depth, E, bulk_compliance_m_per_N((0.04, 0.06), E), 200.0)
    return slip_curve(curve, 200.0, mu, KAPPA)


def test_published_values():
    joint = reference()
    assert joint.preload_N == pytest.approx(460.4, abs=0.05)
    np.testing.assert_allclose(
        joint.curve.asperity_loads_N(2.5e-7), [89.35, 0.757], rtol=1e-4, atol=5e-4
    )
    np.testing.assert_allclose(joint.limits_m, [6.071e-8, 2.429e-9], rtol=2e-4)
    assert joint.total_slip_force_N == pytest.approx(92.1, abs=0.05)
    assert joint.tangential_stiffness_N_per_m == pytest.approx(3.89e9, rel=5e-4)
    assert joint.total_slip_displacement_m == pytest.approx(6.071e-8, rel=1e-4)
    displacement = [1e-9, 2.4286e-9, 5e-9, 1e-8, 2e-8, 4e-8, 6e-8]
    force = [3.694, 8.033, 13.53, 23.87, 43.01, 74.27, 91.96]
    energy = [2.728e-10, 5.471e-9, 3.488e-8, 1.0050e-7, 3.033e-7, 1.381e-6, 4.745e-6]
    # to the printed digits; two of them are printed rounded the other way
    np.testing.assert_allclose(joint.force_N(displacement), force, rtol=4e-4)
    np.testing.assert_allclose(joint.energy_J(displacement), energy, rtol=4e-4)


def equations_11_to_16(m, n, d, h, mu, delta):
    """T and W of two families as the paper writes them, with its errata, in 50 digits."""
    E_star, kappa = mp.mpf(E), mp.mpf(KAPPA)
    G_star = 4 * kappa / E_star
    T = W = mp.mpf(0)
    for count, radius, g in ((m, R_G, d), (n, R_P, d - h)):
        if count == 0 or g <= 0:
            continue
        a = mp.sqrt(mp.mpf(radius) * g)
        N = 4 * E_star * a**3 / (3 * mp.mpf(radius))
        limit = 3 * mu * N * G_star / (16 * a)
        q2 = max(1 - delta / limit, 0)
        T += count * mu * N * (1 - mp.sqrt(q2) ** 3)
        s = min(delta / limit, 1)
        bracket = 1 - mp.sqrt(q2) ** 5 - mp.mpf(5) / 6 * (1 - mp.sqrt(q2) ** 3) * (2 - s)
        W += count * 9 * mu**2 * N**2 * G_star / (10 * a) * bracket
        W += count * 4 * mu * N * max(delta - limit, 0)
    return T, W


@settings(max_examples=300, deadline=None, database=None)
@given(
    st.integers(0, 40),
    st.integers(0, 40),
    st.floats(-15, -3),
    st.one_of(st.just(0.0), st.floats(1e-6, 1.2)),
    st.floats(-14, 1),
    st.floats(0.01, 1.5),
)
def test_all_digits_of_two_families(m, n, log_d, h_share, log_s, mu):
    d = 10.0**log_d
    h = h_share * d
    if m == 0 and (n == 0 or h >= d):
        return
    joint = at_approach(families((m, n), (R_G, R_P), (0.0, h), E), d, mu)
    delta = 10.0**log_s * mu * KAPPA * d
    with mp.workdps(110):
        T, W = equations_11_to_16(m, n, mp.mpf(d), mp.mpf(h), mp.mpf(mu), mp.mpf(delta))
    assert joint.force_N(delta) == pytest.approx(float(T), rel=1e-13)
    assert joint.energy_J(delta) == pytest.approx(float(W), rel=1e-13)
    if 0.999 * joint.total_slip_force_N > T:
        assert joint.displacement_m(float(T)) == pytest.approx(delta, rel=1e-12)
        assert joint.energy_at_force_J(float(T)) == pytest.approx(float(W), rel=1e-11)


@pytest.mark.parametrize("s", [1e-14, 1e-10, 1e-6, 1e-3, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("d", [1e-15, 1e-9, 2.5e-7, 1e-3])
def test_all_digits_of_the_displacement_of_one_contact(s, d):
    joint = at_approach(families((1,), (R_G,), (0.0,), E), d)
    force = s * joint.total_slip_force_N
    with mp.workdps(50):
        load = mp.mpf(4) / 3 * mp.mpf(E) * mp.sqrt(mp.mpf(R_G)) * mp.mpf(d) ** mp.mpf("1.5")
        left = 1 - mp.mpf(force) / (mp.mpf(MU) * load)
        delta = mp.mpf(MU) * mp.mpf(KAPPA) * mp.mpf(d) * (1 - mp.cbrt(left) ** 2)
    assert joint.displacement_m(force) == pytest.approx(float(delta), rel=1e-13)


def test_energy_is_the_area_of_the_loop():
    for joint in (reference(), random_slip(1), random_slip(2, "mean_field")):
        for share in (0.02, 0.3, 1.0, 1.7):
            amplitude = share * joint.total_slip_displacement_m
            displacement, force = joint.loop(amplitude, 40001)
            area = np.trapezoid(force, displacement)
            assert area == pytest.approx(float(joint.energy_J(amplitude)), rel=1e-5)


def test_loop_is_masings():
    joint = reference()
    amplitude = 4e-8
    displacement, force = joint.loop(amplitude, 401)
    top = float(joint.force_N(amplitude))
    assert displacement[0] == displacement[-1] == amplitude
    assert displacement[200] == -amplitude
    np.testing.assert_allclose(force[[0, 200, 400]], [top, -top, top], rtol=1e-14)
    np.testing.assert_allclose(displacement[200:], -displacement[:201], atol=1e-22)
    np.testing.assert_allclose(force[200:], -force[:201], rtol=1e-12)
    # Eq. 5 for one Hertz contact
    one = at_approach(families((1,), (R_G,), (0.0,), E), 2.5e-7)
    displacement, force = one.loop(3e-8, 101)
    muN, limit = one.total_slip_force_N, one.total_slip_displacement_m
    T = force[:51]
    shares = 2 * (1 - (T[0] - T) / (2 * muN)) ** (2 / 3) - (1 - T[0] / muN) ** (2 / 3) - 1
    np.testing.assert_allclose(displacement[:51], limit * shares, atol=1e-13 * limit)


def test_phases_follow_the_families():
    joint = reference()
    limit_G, limit_P = joint.limits_m
    displacement = np.array([0.0, 0.99 * limit_P, 1.01 * limit_P, 0.99 * limit_G, 1.01 * limit_G])
    np.testing.assert_array_equal(joint.phase(displacement), ["GPS", "GPS", "PPS", "PPS", "TS"])
    unloaded = at_approach(joint.curve, 2e-7)
    assert np.isnan(unloaded.limits_m[1])
    assert unloaded.phase(1e-9) == "GPS"
    sunk = slip_curve(in_series(joint.curve, BULK), joint.preload_N, MU, KAPPA)
    for own, more in zip(joint.limits_m, sunk.limits_m, strict=True):
        force = joint.force_N(own)
        assert sunk.force_N(more) == pytest.approx(float(force), rel=1e-12)


def test_total_slip_and_beyond():
    for joint in (reference(), random_slip(3), random_slip(4, "mean_field")):
        limit, muN = joint.total_slip_displacement_m, joint.total_slip_force_N
        assert joint.displacement_m(muN) == pytest.approx(limit, rel=1e-9)
        np.testing.assert_allclose(joint.force_N(limit * np.array([1, 1.5, 10])), muN, rtol=1e-14)
        extra = joint.energy_J(3 * limit) - joint.energy_J(limit)
        assert extra == pytest.approx(4 * muN * 2 * limit, rel=1e-12)
        assert joint.energy_at_force_J(muN) == pytest.approx(joint.energy_J(limit), rel=1e-9)
        assert joint.displacement_m(1.01 * muN) == np.inf
        assert joint.energy_at_force_J(1.01 * muN) == np.inf
        assert joint.stiffness_N_per_m(1.1 * limit) == 0.0


def of_interacting_caps():
    curve = interacting([20.0, 30.0], [0.0, 1e-7], [0.0, 5e-3], [0.0, 0.0], E, 50.0)
    return slip_curve(curve, 50.0, MU, KAPPA)


def of_a_map():
    x_m = (np.arange(24) - 11.5) * 1e-4
    face = HeightMap(-(x_m**2 + x_m[:, None] ** 2) / 4.0, (1e-4, 1e-4))
    return slip_curve(boundary_elements(face, E, preload_N=1.0), 1.0, MU, KAPPA)


@pytest.mark.parametrize(
    "made",
    [
        reference,
        lambda: random_slip(3),
        lambda: random_slip(4, "mean_field"),
        of_interacting_caps,
        of_a_map,
        lambda: slip_curve(flat(46.0), 46.0, MU, KAPPA),
    ],
    ids=["families", "caps", "mean_field", "interacting", "boundary_elements", "flat"],
)
def test_the_displacement_of_a_force_that_nothing_holds_is_one(made):
    """It is infinite, and what is asked of it is what lies beyond total slip."""
    joint = made()
    muN = joint.total_slip_force_N
    delta = joint.displacement_m([0.5 * muN, 1.01 * muN])
    assert delta[1] == np.inf
    assert joint.force_N(delta)[1] == pytest.approx(muN, rel=1e-14)
    assert joint.energy_J(delta)[1] == np.inf
    assert joint.stiffness_N_per_m(delta)[1] == 0.0
    assert joint.phase(delta)[1] == "TS"
    for of in (joint.force_N, joint.energy_J, joint.stiffness_N_per_m, joint.phase):
        np.testing.assert_array_equal(of(delta)[0], of(delta[0]))
        assert of([]).shape == (0,)


def test_stiffness_is_the_slope_and_the_first_one_that_of_the_joint():
    for joint in (reference(), random_slip(5), random_slip(6, "mean_field")):
        delta = np.array([0.2, 0.5, 0.8]) * joint.total_slip_displacement_m
        step = 1e-6 * delta
        slope = (joint.force_N(delta + step) - joint.force_N(delta - step)) / (2 * step)
        np.testing.assert_allclose(joint.stiffness_N_per_m(delta), slope, rtol=1e-7)
        initial = joint.tangential_stiffness_N_per_m
        assert joint.stiffness_N_per_m(0.0) == pytest.approx(initial, rel=1e-14)
        assert joint.force_N(1e-22) / 1e-22 == pytest.approx(initial, rel=1e-9)


@settings(max_examples=60, deadline=None, database=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["caps", "mean_field"]))
def test_force_is_increasing_and_concave_and_energy_positive_and_continuous(seed, model):
    joint = random_slip(seed, model)
    delta = np.linspace(0, 1.2, 401)[1:] * joint.total_slip_displacement_m
    force = joint.force_N(delta)
    rise = np.diff(force)
    muN = joint.total_slip_force_N
    assert (rise >= -1e-13 * muN).all()
    assert (np.diff(rise) <= 1e-12 * muN).all()
    energy = joint.energy_J(delta)
    assert (energy > 0).all()
    assert (np.diff(energy) > 0).all()
    limits = joint.limits_m[np.isfinite(joint.limits_m)]
    below, above = joint.energy_J(limits * (1 - 1e-9)), joint.energy_J(limits * (1 + 1e-9))
    np.testing.assert_allclose(below, above, rtol=1e-7)


@settings(max_examples=60, deadline=None, database=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 10), st.floats(-0.3, 30))
def test_energy_at_given_force_ignores_a_spring_in_series(seed, mu_scale, share):
    joint = random_slip(seed)
    compliance = share / float(joint.curve.stiffness_N_per_m(joint.approach_m))
    other = slip_curve(in_series(joint.curve, compliance), 200.0, MU, KAPPA)
    force = np.geomspace(1e-12, 0.99, 30) * joint.total_slip_force_N
    energy = joint.energy_at_force_J(force)
    np.testing.assert_allclose(other.energy_at_force_J(force), energy, rtol=1e-11)
    displacement = other.displacement_m(force)
    np.testing.assert_allclose(other.energy_J(displacement), energy, rtol=1e-9)
    np.testing.assert_allclose(other.force_N(displacement), force, rtol=1e-12)
    np.testing.assert_allclose(
        displacement, joint.displacement_m(force) + KAPPA * compliance * force, rtol=1e-11
    )
    # friction scales forces and displacements alike, energies by its square
    slippery = random_slip(seed, mu=mu_scale * MU)
    delta = joint.displacement_m(force)
    np.testing.assert_allclose(slippery.force_N(mu_scale * delta), mu_scale * force, rtol=1e-12)
    np.testing.assert_allclose(
        slippery.energy_J(mu_scale * delta), mu_scale**2 * energy, rtol=1e-11
    )


def test_small_amplitudes_lose_energy_with_the_cube():
    joint = reference()
    delta = np.array([1e-22, 1e-18, 1e-14])
    ratio = joint.energy_J(delta) / delta**3
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-5)
    assert ratio[0] > 0


def test_order_of_caps_does_not_matter():
    rng = np.random.default_rng(9)
    radius, depth, order = rng.uniform(1, 50, 30), rng.uniform(0, 1e-6, 30), rng.permutation(30)
    delta = np.geomspace(1e-12, 1e-7, 20)
    one = slip_curve(caps(radius, depth, E), 500.0, MU, KAPPA)
    other = slip_curve(caps(radius[order], depth[order], E), 500.0, MU, KAPPA)
    np.testing.assert_allclose(one.energy_J(delta), other.energy_J(delta), rtol=1e-12)
    np.testing.assert_allclose(one.force_N(delta), other.force_N(delta), rtol=1e-12)


def test_many_sets_of_parameters_in_one_call():
    rng = np.random.default_rng(3)
    count = rng.integers(1, 40, (200, 1, 2))
    depth = np.stack([np.zeros((200, 1)), rng.uniform(0, 4e-7, (200, 1))], axis=-1)
    amplitude = np.geomspace(1e-11, 1e-7, 16)
    many = slip_curve(families(count, (R_G, R_P), depth, E), np.full((200, 1), 460.0), MU, KAPPA)
    energy = many.energy_J(amplitude)
    assert energy.shape == (200, 16)
    for i in (0, 77, 199):
        one = slip_curve(families(count[i, 0], (R_G, R_P), depth[i, 0], E), 460.0, MU, KAPPA)
        np.testing.assert_allclose(energy[i], one.energy_J(amplitude), rtol=1e-12)


def test_flat_is_coulombs_friction():
    joint = slip_curve(flat(460.0), 460.0, MU, KAPPA)
    assert joint.total_slip_displacement_m == 0.0
    assert joint.tangential_stiffness_N_per_m == np.inf
    np.testing.assert_array_equal(joint.displacement_m([1.0, 92.0]), 0.0)
    np.testing.assert_array_equal(joint.energy_at_force_J([1.0, 92.0]), 0.0)
    assert joint.displacement_m(93.0) == np.inf
    np.testing.assert_allclose(joint.energy_J([1e-9, 1e-6]), [4 * 92e-9, 4 * 92e-6])
    sunk = slip_curve(in_series(flat(460.0), BULK), 460.0, MU, KAPPA)
    limit = sunk.total_slip_displacement_m
    assert limit == pytest.approx(MU * KAPPA * BULK * 460.0)
    np.testing.assert_allclose(sunk.force_N(limit * np.array([0.5, 1, 2])), [46.0, 92.0, 92.0])
    np.testing.assert_allclose(
        sunk.energy_J(limit * np.array([0.5, 2])), [0.0, 4 * 92.0 * limit], atol=1e-20
    )
    np.testing.assert_array_equal(sunk.phase(limit * np.array([0.5, 2])), ["GPS", "TS"])


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("which", [0, 1, 2])
def test_bad_numbers_are_named(which, bad):
    numbers = [460.0, MU, KAPPA]
    numbers[which] = bad
    name = ("preload_N", "friction_coefficient", "kappa")[which]
    with pytest.raises(SettingsError, match=f"{name}: got {bad}"):
        slip_curve(reference().curve, *numbers)


def test_negative_amplitudes_are_refused():
    joint = reference()
    with pytest.raises(SettingsError, match="displacement_m: got -1e-09"):
        joint.force_N([1e-9, -1e-9])
    with pytest.raises(SettingsError, match="force_N: got nan"):
        joint.displacement_m(np.nan)
    with pytest.raises(SettingsError, match="n_points"):
        joint.loop(1e-9, 2)


def test_a_preload_beyond_hertz_is_refused():
    with pytest.raises(ContactError, match="wider than its asperity"):
        slip_curve(caps([1e-3], [0.0], E), 1e9, MU, KAPPA)


@pytest.mark.parametrize("radius_pixels", [2.6, 3.0, 4.0, 6.0])
def test_a_top_between_pixels_slips_as_far_as_its_sphere(radius_pixels):
    """The approach of a map counts from its highest pixel, which lies lower than the top."""
    y_m, x_m = (np.mgrid[-16:16, -16:16] + 0.5) * 1e-4
    face = HeightMap(-(x_m**2 + y_m**2) / (2 * 20.0), (1e-4, 1e-4))
    d_m = (radius_pixels * 1e-4) ** 2 / 20.0
    load_N = 4 / 3 * 110e9 * (radius_pixels * 1e-4) ** 3 / 20.0
    slip = slip_curve(boundary_elements(face, 110e9), load_N, 0.2, 1.2)
    assert slip.total_slip_displacement_m == pytest.approx(0.2 * 1.2 * d_m, rel=2e-3)
    assert 0.2 * 1.2 * float(slip.approach_m) < 0.992 * 0.2 * 1.2 * d_m
    assert float(slip.displacement_m(slip.total_slip_force_N)) == slip.total_slip_displacement_m
    shares = np.array([0.5, 0.99, 1.01])
    assert slip.phase(shares * slip.total_slip_displacement_m).tolist()[2] == "TS"
    assert "TS" not in slip.phase(shares[:2] * slip.total_slip_displacement_m).tolist()
    drop = 1.0 - (1.0 - shares[:2]) ** 1.5
    expected_N = 0.2 * load_N * drop
    np.testing.assert_allclose(
        slip.force_N(shares[:2] * slip.total_slip_displacement_m), expected_N, rtol=5e-3
    )
