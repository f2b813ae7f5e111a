"""The error of interacting caps, cause by cause, in closed form for one cap and for two."""

from dataclasses import replace

import numpy as np
import pytest
from contact_cases import E_STAR_PA, scene_of, table
from scipy.ndimage import gaussian_filter

from capslip.analysis import analyze
from capslip.caps.spheres import elliptic_factor
from capslip.caps.table import CapFlag
from capslip.contact import accuracy
from capslip.contact.accuracy import LEAST_ERROR, answers, error_of_caps
from capslip.contact.bulk import bulk_compliance_m_per_N
from capslip.contact.curve import in_series
from capslip.contact.material import composite
from capslip.contact.models.caps import caps as caps_curve
from capslip.contact.models.interacting import RUNG
from capslip.contact.profiles import Profiles
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

PRELOAD_N, SIDE_M = 50.0, (0.04, 0.06)
FACE = HeightMap(np.zeros((20, 30)), (2e-3, 2e-3))
APPROACH_M = (0.75 * PRELOAD_N / E_STAR_PA / np.sqrt(20.0)) ** (2 / 3)  # of one cap of 20 m


def settings(*more):
    as_levelled = ("conditioning.form=none", "contact.alignment=as_levelled")
    overrides = (f"contact.preload_N={PRELOAD_N}", *as_levelled, *more)
    return load_settings(overrides=overrides)


WITH_BULK = settings("contact.bulk=true")  # what holds the bulk term keeps it: Hertz for one cap


def estimate(caps, noise_m=0.0, label=None, chosen=WITH_BULK, face=FACE):
    scene = replace(scene_of(caps, PRELOAD_N, SIDE_M), surface=face)
    curve = RUNG.build(scene)
    found = answers(curve, RUNG.holds_bulk, FACE, chosen)
    return error_of_caps(scene, curve, found, label, noise_m, chosen)


def beside_the_least(error):
    """Return the error without the part that spheres always have."""
    assert error.doubt is None
    assert error.of_caps >= LEAST_ERROR
    return np.sqrt(error.of_caps**2 - LEAST_ERROR**2)


def one_cap(**columns):
    return table([0.03], [0.02], [20.0], [0.0], **{n: [value] for n, value in columns.items()})


def test_the_answers_are_four_energies_of_mindlins_loop_and_the_slope_of_hertz():
    curve = caps_curve([20.0], [0.0], E_STAR_PA)
    kappa = composite((200e9, 200e9), (0.3, 0.3)).kappa
    mu = WITH_BULK.material.friction_coefficient
    q = np.cbrt(1.0 - np.array([0.1, 0.25, 0.5, 0.75]))
    slip_m = mu * kappa * APPROACH_M
    energy_J = 0.8 * mu * PRELOAD_N * slip_m * (1.0 - q) ** 3 * (1.0 + 3.0 * q + q**2)
    expected = [*energy_J, 1.5 * PRELOAD_N / APPROACH_M]
    assert answers(curve, False, FACE, WITH_BULK) == pytest.approx(expected, rel=1e-9)


def test_the_errors_by_the_force_are_those_of_the_answers():
    lone = estimate(one_cap(radius_se_m=1.0))
    assert [at for at, _ in lone.errors.energy_by_share] == [0.1, 0.25, 0.5, 0.75, 1.0]
    of_lone = [lone.errors.stiffness, *(one for _, one in lone.errors.energy_by_share)]
    assert of_lone == pytest.approx([2.0 / 3.0 * 0.05] * 6, rel=0.1)  # as R^(1/3), or its inverse
    hardly_touches = 0.95 * APPROACH_M
    two = estimate(
        table(
            [0.01, 0.05], [0.02] * 2, [20.0] * 2, [0.0, hardly_touches],
            peak_height_se_m=[0.01 * APPROACH_M] * 2,
        )
    )  # fmt: skip
    energies = [one for _, one in two.errors.energy_by_share]
    assert energies == sorted(energies, reverse=True)
    assert energies[0] > 2.0 * energies[2] > 0.0
    assert max(energies[0], two.errors.stiffness) <= two.errors.energy == two.total


def test_the_stiffness_is_that_of_slip_without_the_bulk_term_or_with_it():
    alone = caps_curve([20.0], [0.0], E_STAR_PA)
    sunk = in_series(alone, bulk_compliance_m_per_N(SIDE_M, E_STAR_PA))
    plain = answers(alone, False, FACE, settings())
    assert answers(sunk, True, FACE, settings()) == pytest.approx(plain, rel=1e-9)
    with_it = answers(sunk, True, FACE, WITH_BULK)
    assert with_it[:4] == pytest.approx(plain[:4], rel=1e-9)
    kept = 1.0 / (1.0 / plain[4] + bulk_compliance_m_per_N(SIDE_M, E_STAR_PA))
    assert with_it[4] == pytest.approx(kept, rel=1e-9)
    assert answers(sunk, False, FACE, settings()) == pytest.approx(with_it, rel=1e-9)


def test_a_perfect_sphere_has_the_error_of_spheres():
    error = estimate(one_cap())
    assert (error.of_caps, error.of_levelling) == (pytest.approx(LEAST_ERROR, rel=1e-9), 0.0)
    assert error.total == pytest.approx(LEAST_ERROR, rel=1e-9)


@pytest.mark.parametrize("quartic_share", [0.1, -0.1])
@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_the_error_of_shape_of_one_cap_is_a_third_of_that_of_its_radius(share, quartic_share):
    """Under a given load stiffness grows as R^(1/3), energy at a share of the force falls so."""
    z_m = APPROACH_M / (2.0 * share)
    wider = (2 / 3 - 8 / 5 * share) * quartic_share
    error = estimate(one_cap(fit_depth_m=z_m, quartic_m=quartic_share * z_m))
    expected = 2.0 * (np.exp(abs(wider) / 3.0) - 1.0)
    assert beside_the_least(error) == pytest.approx(expected, rel=1e-6)


def test_the_error_of_shape_is_bounded_and_unknown_profiles_have_none():
    error = estimate(one_cap(fit_depth_m=1e-3 * APPROACH_M, quartic_m=APPROACH_M))
    assert beside_the_least(error) == pytest.approx(2.0 * (np.exp(1.0) - 1.0), rel=1e-6)
    unknown = estimate(one_cap(fit_depth_m=np.nan, quartic_m=np.nan))
    assert beside_the_least(unknown) == pytest.approx(0.0, abs=1e-6)


def fitted(fall_m, noise_m, n=40, side=30):
    """Return the quartic terms of hills of one fall over t, each of `side`^2 noisy points."""
    t = (np.arange(side**2) + 0.5) / side**2
    noise = np.random.default_rng(0).normal(0.0, noise_m, (n, len(t)))
    return np.polyfit(t, (fall_m(t) + noise).T, 2)[0]


@pytest.mark.parametrize(("of_own", "least", "most"), [(0.0, 0.0, 0.3), (2.0, 0.6, 1.0)])
def test_of_a_quartic_term_counts_what_noise_does_not_make(of_own, least, most):
    """Of paraboloids next to nothing, of hills that share twice the standard error nearly all."""
    n, points, noise_m, z_m = 40, 900, 5e-9, 3e-7
    of_noise_m = 6.0 * np.sqrt(5.0 / points) * noise_m
    own_m = of_own * of_noise_m
    quartic_m = fitted(lambda t: z_m * t + own_m * (t**2 - t), noise_m)
    assert np.sqrt(np.mean((quartic_m - own_m) ** 2)) == pytest.approx(of_noise_m, rel=0.2)
    radius_m = points * FACE.pixel_area_m2 / (2.0 * np.pi * z_m)
    at = np.linspace(0.0, 0.05, n)
    columns = {"fit_depth_m": np.full(n, z_m), "quartic_m": quartic_m}
    hills = table(at, at, np.full(n, radius_m), np.zeros(n), **columns)
    scene = scene_of(hills, PRELOAD_N, SIDE_M)
    scene = replace(scene, surface=FACE)
    share = accuracy._own_share(scene, quartic_m / z_m, noise_m)
    assert (share >= least).all()
    assert (share <= most).all()
    assert (accuracy._own_share(scene, quartic_m / z_m, 0.0) == 1.0).all()


@pytest.mark.parametrize("quartic_share", [0.5, -0.5])
def test_a_higher_apex_of_one_of_two_caps_changes_what_both_carry(quartic_share):
    """Far from each other, one cap raised by 8/15 q s^2, at the share where no radius changes."""
    both_m = (0.75 * PRELOAD_N / E_STAR_PA / (np.sqrt(20.0) + np.sqrt(5.0))) ** (2 / 3)
    s = 5 / 12
    z_m = both_m / (2.0 * s)
    q_m = quartic_share * z_m
    far = table(
        *([1e3, 2e3], [0.0, 0.0], [20.0, 5.0], [0.0, 0.0]),
        fit_depth_m=[z_m, z_m],
        quartic_m=[q_m, 0.0],
    )
    depth_m = np.array([0.0, 8 / 15 * q_m * s**2])
    moved = caps_curve([20.0, 5.0], depth_m - depth_m.min(), E_STAR_PA)
    before = answers(caps_curve([20.0, 5.0], [0.0] * 2, E_STAR_PA), False, SIDE_M, WITH_BULK)
    change = np.abs(answers(moved, False, SIDE_M, WITH_BULK) / before - 1.0).max()
    assert beside_the_least(estimate(far)) == pytest.approx(2.0 * change, rel=1e-3)


def test_the_random_error_of_one_cap_is_two_thirds_of_that_of_its_radius():
    error = estimate(one_cap(radius_se_m=0.03 * 20.0))
    assert beside_the_least(error) == pytest.approx(2.0 * 0.03 / 3.0, rel=0.01)
    # one cap stands where it stands
    high = estimate(one_cap(peak_height_se_m=1e-8))
    assert beside_the_least(high) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("over_radius", [1e2, 1e4, 1e200])
def test_a_radius_that_nobody_knows_errs_by_a_bounded_factor(over_radius):
    """Its logarithm is moved by 3, and the answers by a third of that."""
    error = estimate(one_cap(radius_se_m=over_radius * 20.0))
    assert np.exp(1.0) - 1.0 < beside_the_least(error) <= 2.0 * (np.exp(1.0) - 1.0) * (1 + 1e-9)


@pytest.mark.parametrize(
    ("columns", "noise_m", "ratio"),
    [
        ({"profile_residual_m": 0.1e-6, "fit_depth_m": 1e-6}, 0.0, 0.38 * 0.1),
        ({"profile_residual_m": 0.1e-6, "fit_depth_m": 1e-6}, 0.06e-6, 0.38 * 0.08),
        ({"profile_residual_m": 0.1e-6, "fit_depth_m": 1e-6}, 0.1e-6, 0.0),
        ({"profile_residual_m": 0.1e-6, "fit_depth_m": 1e-6}, 0.2e-6, 0.0),
        ({"profile_residual_m": 0.1e-6, "fit_depth_m": np.nan, "cap_height_m": 2e-6}, 0.0, 0.019),
        ({"profile_residual_m": np.nan, "radius_se_m": np.nan}, 0.0, 0.0),
        ({"profile_residual_m": 0.1e-6, "fit_depth_m": 1e-6, "radius_se_m": 20 * 0.05}, 0.0,
         np.hypot(0.038, 0.05)),
    ],
)  # fmt: skip
def test_what_is_left_of_a_profile_beyond_noise_is_an_error_of_the_radius(columns, noise_m, ratio):
    error = estimate(one_cap(**columns), noise_m)
    assert beside_the_least(error) == pytest.approx(2.0 * ratio / 3.0, rel=0.02, abs=1e-6)


@pytest.mark.parametrize(
    ("known_m", "shown_m", "shared_m"),
    [
        (None, 0.0, 0.0),
        (0.05e-6, 0.0, 0.05e-6),
        (0.05e-6, 0.03e-6, 0.04e-6),
        (0.05e-6, 0.045e-6, 0),
    ],
)
def test_a_known_noise_that_the_hills_do_not_show_moves_a_cap_by_itself(known_m, shown_m, shared_m):
    given = () if known_m is None else (f"instrument.noise_m={known_m}",)
    cap, chosen = one_cap(fit_depth_m=1e-6), settings("contact.bulk=true", *given)
    error = estimate(cap, shown_m, chosen=chosen)
    assert beside_the_least(error) == pytest.approx(2.0 * shared_m / 1e-6 / 3.0, rel=0.02, abs=1e-6)
    # of the height by as much: of two caps the one that stands higher bears more
    two = {"profile_residual_m": [0.0, 0.0], "fit_depth_m": [1.0, 1.0]}
    pair = table([0.02, 0.04], [0.02, 0.02], [20.0, 20.0], [0.0, 0.0], **two)
    same = table(
        [0.02, 0.04], [0.02, 0.02], [20.0, 20.0], [0.0, 0.0], peak_height_se_m=[shared_m] * 2, **two
    )
    moved = beside_the_least(estimate(pair, shown_m, chosen=chosen))
    assert moved == pytest.approx(beside_the_least(estimate(same, shown_m)), rel=1e-4, abs=1e-9)


@pytest.mark.long
def test_an_interval_holds_the_face_below_known_noise_that_neighbours_share():
    """Smooth on a hill, it moved W of these faces by 12 %, and 1.5 % was said."""
    inside = 0
    for seed in range(5):
        rng = np.random.default_rng(seed)
        places = [(5e-3 + 7e-3 * i, 5e-3 + 7e-3 * j) for i in range(3) for j in range(3)]
        spheres = [(x, y, rng.uniform(1.0, 3.0), -rng.uniform(0, 2e-7)) for x, y in places]
        clean = caps_map(spheres, (120, 120), (2e-4, 2e-4), floor_m=-1.5e-6)
        shared = gaussian_filter(rng.standard_normal((120, 120)), 4.0, mode="wrap")
        noisy = HeightMap(clean.height_m + 5e-9 * shared / shared.std(), (2e-4, 2e-4))
        sets = ("contact.preload_N=40", "instrument.noise_m=5e-9")
        truth = analyze(clean, load_settings(overrides=sets[:1])).answer.energy_J
        low_J, high_J = analyze(noisy, load_settings(overrides=sets)).band.interval["energy_J"]
        inside += low_J <= truth <= high_J
    assert inside >= 4


@pytest.mark.parametrize(("of_own", "least", "most"), [(0.0, 0.0, 0.12), (0.5, 0.45, 0.55)])
def test_of_the_rests_of_profiles_counts_what_noise_does_not_make(of_own, least, most):
    """Of paraboloids next to nothing, though half of them have more than noise makes on average."""
    n, points, noise_m, z_m = 40, 900, 5e-9, 3e-7
    chance = np.random.default_rng(0).normal(0.0, np.sqrt(2.0 / points), n)
    rest_m = noise_m * np.sqrt(1.0 + of_own**2 + (1.0 + of_own**2) * chance)
    radius_m = points * FACE.pixel_area_m2 / (2.0 * np.pi * z_m)
    at = np.linspace(0.0, 0.05, n)
    columns = {"fit_depth_m": np.full(n, z_m), "profile_residual_m": rest_m}
    hills = table(at, at, np.full(n, radius_m), np.zeros(n), **columns)
    scene = replace(scene_of(hills, PRELOAD_N, SIDE_M), surface=FACE)
    own = accuracy._own_residual_m(scene, noise_m) / noise_m
    assert least <= own.min() <= own.max() <= most
    assert accuracy._own_residual_m(scene, 0.0) == pytest.approx(rest_m)


@pytest.mark.parametrize("noise_m", [3e-23, 1e-75])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_rounding_alone_is_a_noise_that_hides_no_rest(n, noise_m):
    """Of one hill that sixteen digits know its error was no number."""
    rest_m, at = np.array([1.45e-11, 1.3e-11, 0.0])[:n], np.linspace(0.0, 0.05, n)
    columns = {"fit_depth_m": np.full(n, 3e-7), "profile_residual_m": rest_m}
    hills = table(at, at, np.full(n, 20.0), np.zeros(n), **columns)
    scene = replace(scene_of(hills, PRELOAD_N, SIDE_M), surface=FACE)
    assert accuracy._own_residual_m(scene, noise_m) == pytest.approx(rest_m, rel=1e-6, abs=1e-20)


def test_what_heights_and_radii_err_by_together_is_drawn_together():
    """Errors of n caps with the correlation of the table; shapes have nothing in common."""
    n = 100
    at = np.linspace(0.001, 0.039, n)
    columns = {"peak_height_se_m": np.full(n, 2e-9), "radius_se_m": np.full(n, 0.06)}
    columns |= {"peak_radius_correlation": np.full(n, -0.8), "fit_depth_m": np.full(n, 1e-7)}
    for rest_m in (0.0, 4e-9):
        of_shape_m = 0.38 * rest_m
        caps = table(at, at, np.full(n, 2.0), np.zeros(n), **columns, profile_residual_m=rest_m)
        own_m = np.full(n, rest_m)
        up_m, wide = accuracy._at_random(scene_of(caps, PRELOAD_N, SIDE_M), own_m)
        assert up_m.std() == pytest.approx(np.hypot(2e-9, of_shape_m), rel=0.01)
        assert wide.std() == pytest.approx(np.hypot(0.03, of_shape_m / 1e-7), rel=0.05)
        assert np.mean(up_m * wide) == pytest.approx(-0.8 * 2e-9 * 0.03, rel=0.08)


def test_a_profile_that_is_all_rest_changes_a_radius_by_no_more_than_e():
    error = estimate(one_cap(profile_residual_m=1e-3, fit_depth_m=1e-6))
    assert beside_the_least(error) <= 2.0 * (np.exp(1 / 3) - 1.0) * (1 + 1e-9)
    assert beside_the_least(error) > 1.0 - np.exp(-1 / 3)


@pytest.mark.parametrize("cause", ["peak_height_se_m", "profile_residual_m"])
def test_heights_err_by_their_errors_and_by_the_share_of_the_rest(cause):
    """Two caps far apart, moved up or down at random: half of the draws move them alike."""
    far = table([1e3, 2e3], [0.0, 0.0], [20.0, 20.0], [0.0, 0.0], **{cause: [4e-8, 4e-8]})
    up_m = 4e-8 * (0.38 if cause == "profile_residual_m" else 1.0)
    before = answers(caps_curve([20.0] * 2, [0.0] * 2, E_STAR_PA), False, SIDE_M, WITH_BULK)
    apart = caps_curve([20.0] * 2, [0.0, 2.0 * up_m], E_STAR_PA)
    change = answers(apart, False, SIDE_M, WITH_BULK) / before - 1.0
    expected = 2.0 * np.abs(change).max() * np.sqrt(0.5)
    assert beside_the_least(estimate(far)) == pytest.approx(expected, rel=0.25)


def test_many_caps_are_moved_less_often_but_err_alike():
    """Independent errors of many caps average out as one over the root of their number."""
    rng = np.random.default_rng(3)
    errors = []
    for n in (4, 400):
        x_m, y_m = 1e3 * rng.uniform(size=(2, n))
        caps = table(x_m, y_m, np.full(n, 20.0), np.zeros(n), radius_se_m=np.full(n, 6.0))
        errors.append(beside_the_least(estimate(caps)))
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.6)


@pytest.mark.parametrize("distance_m", [4e-3, 6e-3, 2e-2])
def test_the_error_of_the_pair_law_of_two_caps(distance_m):
    """Half of what point loads alone would change the stiffness by, of D = d_H(N / 2) + sunk."""
    pair = table([0.02, 0.02 + distance_m], [0.02, 0.02], [20.0, 20.0], [0.0, 0.0])
    half_m = APPROACH_M / 2.0 ** (2 / 3)
    compliance = half_m / (1.5 * PRELOAD_N / 2.0)
    C = 1.0 / (np.pi * E_STAR_PA * distance_m)
    rho = np.sqrt(half_m * 20.0) / distance_m
    slope = 1.0 + 5 / 3 * 4 / 15 * rho**2 - 2.0 * 2.0 / np.pi * rho**3  # grow as N^(5/3) and N^2
    of_stiffness = (compliance + C * slope) / (compliance + C) - 1.0
    error = estimate(pair)
    assert error.errors.stiffness == pytest.approx(
        np.hypot(LEAST_ERROR, 0.5 * of_stiffness), rel=1e-4
    )


@pytest.mark.parametrize(
    ("load_share", "over", "doubted"),
    [(1.0, 0.999, False), (1.0, 1.001, True), (0.049, 2.0, False), (0.051, 2.0, True)],
)
def test_a_twentieth_of_the_load_may_be_on_contacts_wider_than_their_hills(
    load_share, over, doubted
):
    """Two caps far apart; the second carries that share of the load, or there is one."""
    share = np.array([load_share, 1.0 - load_share])[: 1 + (load_share < 1.0)]
    compression_m = APPROACH_M * share ** (2 / 3)
    a_m = np.sqrt(20.0 * compression_m)
    n = len(share)
    caps = table(
        1e3 * np.arange(n),
        np.zeros(n),
        np.full(n, 20.0),
        compression_m,
        diameter_m=[2.0 * a_m[0] / over, 1.0][:n],
    )
    error = estimate(caps)
    assert (error.doubt is not None) == doubted
    assert error.doubt is None or "wider than the hills" in error.doubt
    assert (error.total is None) == doubted


def test_causes_add_as_squares():
    both = replace(estimate(one_cap()), of_caps=0.3, of_levelling=0.4)
    assert both.total == pytest.approx(0.5)
    columns = {"fit_depth_m": APPROACH_M, "quartic_m": 0.1 * APPROACH_M}
    shape = beside_the_least(estimate(one_cap(**columns)))
    random = beside_the_least(estimate(one_cap(radius_se_m=0.6)))
    together = beside_the_least(estimate(one_cap(**columns, radius_se_m=0.6)))
    assert together == pytest.approx(np.hypot(shape, random), rel=0.01)


@pytest.mark.parametrize(("caps", "draws"), [(2, 16), (100, 16), (200, 8), (600, 4)])
def test_many_caps_are_moved_less_often(caps, draws):
    """Sixteen faces of up to a hundred caps, as many caps of more, and four faces at least."""
    places = np.linspace(0.001, 0.039, caps)
    scene = scene_of(table(places, places, np.ones(caps), np.zeros(caps)), PRELOAD_N, SIDE_M)
    up_m, wide = accuracy._at_random(scene, 0.0)
    assert up_m.shape == wide.shape == (draws, caps)


@pytest.mark.parametrize("ratio", [1.0, 8.0, 40.0])
def test_a_hill_at_the_edge_may_miss_the_factor_of_its_ellipse(ratio):
    """One cap alone: energy at a share of mu N and stiffness follow R^(-1/3) and R^(1/3)."""
    radii = {"radius_major_m": 20.0 * np.sqrt(ratio), "radius_minor_m": 20.0 / np.sqrt(ratio)}
    inside = estimate(one_cap(**radii))
    assert inside.of_caps == pytest.approx(LEAST_ERROR, rel=1e-9)
    cut = beside_the_least(estimate(one_cap(flags=np.uint16(CapFlag.edge), **radii)))
    factor = elliptic_factor(ratio)
    both = np.array([factor, 1.0 / factor]) ** (1 / 3) - 1.0
    greatest, least = 2.0 * np.abs(both).max(), 2.0 * np.abs(both).min()
    assert least - 1e-9 <= cut <= greatest + 1e-9


def test_a_ridge_without_end_has_no_radius():
    ridge = np.uint16(CapFlag.ridge)
    endless = estimate(one_cap(flags=ridge, radius_major_m=np.nan, radius_minor_m=np.nan))
    assert endless.of_caps > 0.3
    seen = estimate(one_cap(flags=ridge, radius_major_m=80.0, radius_minor_m=5.0))
    assert seen.of_caps == pytest.approx(LEAST_ERROR, rel=1e-9)


def test_a_contact_that_ends_at_the_edge_of_the_map_is_none_of_a_cap():
    label = np.ones(FACE.shape, dtype=int)
    y_m, x_m = 2e-3 * (np.indices(FACE.shape) + 0.5)

    def on_its_hill(caps):
        square_m2 = (x_m - caps.x_m) ** 2 + (y_m - caps.y_m) ** 2
        face = replace(FACE, height_m=-square_m2 / (2.0 * caps.radius_m))
        return estimate(caps, label=label, face=face)

    assert on_its_hill(one_cap()).doubt is None
    a_m = np.sqrt(20.0 * APPROACH_M)
    at_edge = table([0.5 * a_m], [0.02], [20.0], [0.0])
    assert "edge of the map" in on_its_hill(at_edge).doubt
    assert estimate(at_edge).doubt is None  # of caps without a map nobody knows its edge


def test_long_contacts_that_cross_run_together():
    caps = table([0.028, 0.032], [0.02, 0.02], [20.0, 20.0], [0.0, 0.0])
    assert estimate(caps).doubt is None
    long = caps.with_columns(
        radius_major_m=np.full(2, 200.0),
        radius_minor_m=np.full(2, 5.0),
    )
    assert estimate(long).doubt == "long contacts run together"
    side_by_side = long.with_columns(orientation_rad=np.full(2, np.pi / 2))
    assert estimate(side_by_side).doubt is None


def test_the_level_of_two_faces_is_as_uncertain_whichever_comes_first():
    """The floor of the first alone tilted the caps of both: 0.4 one way, 0.14 the other."""
    first, second = (
        synthetic_surface(
            Scene((120, 160), (1e-4, 1e-4), seed, waviness_rms_m=3e-7, waviness_length_m=1.5e-3)
        )[0]
        for seed in (6, 7)
    )
    settings = load_settings(overrides=["contact.preload_N=50", "mating.way=together"])
    found = []
    for one, other in ((first, second), (second, first)):
        contact = analyze(one, settings, mate=other).contact
        by_level_J, found_J = (
            curve.loss_integral_at_drop_J(curve.approach_m(50.0), np.array([5.0, 12.5, 25.0]))
            for curve in (contact.moved.by_level, contact.moved.found)
        )
        found.append(by_level_J / found_J)
    assert np.abs(found[0] - 1.0).max() > 0.02
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6)


@pytest.mark.parametrize("kept", [True, False])
def test_what_profiles_change_of_the_stiffness_is_told_of_the_one_that_is_answered(
    kept, monkeypatch
):
    """A change of the compliance below the contacts counts over that with the bulk, or without."""
    chosen = WITH_BULK if kept else settings()
    caps, label = one_cap(), np.ones(FACE.shape, dtype=int)
    y_m, x_m = 2e-3 * (np.indices(FACE.shape) + 0.5)
    face = replace(FACE, height_m=-((x_m - 0.03) ** 2 + (y_m - 0.02) ** 2) / (2.0 * 20.0))
    alone = estimate(caps, label=label, chosen=chosen, face=face)
    changed = np.append(np.zeros(4), 0.1)  # of 1 / K with the bulk
    monkeypatch.setattr(
        accuracy,
        "profiles",
        lambda *_: Profiles(np.full(1, np.nan), np.full(1, np.nan), changed),
    )
    found = estimate(caps, label=label, chosen=chosen, face=face)
    whole = RUNG.build(replace(scene_of(caps, PRELOAD_N, SIDE_M), surface=FACE))
    K = float(whole.stiffness_N_per_m(whole.approach_m(PRELOAD_N)))
    rest = 1.0 - K * bulk_compliance_m_per_N(SIDE_M, E_STAR_PA)
    assert alone.moved.by_profile[-1] == 0.0
    assert found.moved.by_profile[-1] == pytest.approx(0.1 if kept else 0.1 / rest, rel=1e-6)
