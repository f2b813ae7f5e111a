"""What hills have beside their caps, against contacts in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from contact_cases import E_STAR_PA, scene_of, table
from scipy.integrate import quad
from scipy.optimize import brentq

import capslip
from capslip.contact.models.interacting import RUNG
from capslip.contact.profiles import profiles
from capslip.settings import settings_from
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap

RADIUS_M, PRELOAD_N, PIXELS_M = 20.0, 50.0, (1.6e-4, 2e-4)
SHARES = (0.1, 0.25, 0.5, 0.75)
CONTACT_M = np.cbrt(0.75 * PRELOAD_N * RADIUS_M / E_STAR_PA)
APPROACH_M = CONTACT_M**2 / RADIUS_M
PLACE_M = 0.0123, 0.0087  # between the pixels


def profile(height_m, noise_m=0.0, place_m=PLACE_M, margin=0, **columns):
    """Return what is found of one cap on a map of it and of something else."""
    columns = {"profile_residual_m": 0.01 * APPROACH_M} | columns
    columns = {name: [value] for name, value in columns.items()}
    caps = table([place_m[0]], [place_m[1]], [RADIUS_M], [1e-6], **columns)
    row, col = np.mgrid[:100, :120] + 0.5
    y_m, x_m = row * PIXELS_M[0], col * PIXELS_M[1]
    heights_m = 1e-6 + height_m(x_m - place_m[0], y_m - place_m[1])
    face = HeightMap(np.pad(heights_m, margin, constant_values=np.nan), PIXELS_M)
    move_m = margin * np.array(PIXELS_M)
    caps = caps.with_columns(x_m=caps.x_m + move_m[1], y_m=caps.y_m + move_m[0])
    scene = replace(scene_of(caps, PRELOAD_N, (0.02, 0.024)), surface=face)
    return profiles(scene, RUNG.build(scene), SHARES, noise_m)


def cap(x_m, y_m, radius_m=RADIUS_M):
    return -(x_m**2 + y_m**2) / (2.0 * radius_m)


def test_a_cap_has_nothing_beside_it():
    found = profile(cap)
    assert abs(found.up_m[0]) < 1e-5 * APPROACH_M
    assert abs(found.log_radius[0]) < 1e-5
    assert np.abs(found.change).max() < 1e-4


def test_a_sphere_that_is_higher_and_wider_is_found_as_that():
    wider = 1e-3
    found = profile(lambda x, y: 1e-9 + cap(x, y, RADIUS_M * (1.0 + wider)))
    assert found.up_m[0] == pytest.approx(1e-9, rel=1e-3)
    assert found.log_radius[0] == pytest.approx(wider, rel=2e-3)
    # As R^(-1/3), and as R^(1/3), under a given load
    assert found.change == pytest.approx([-wider / 3.0] * 4 + [wider / 3.0], rel=0.08)


def test_of_an_ellipse_the_mean_curvature_is_that_of_its_cap():
    """Hertz: a cap of radii 40 and 20 m loads like a sphere of their mean over F2^3."""
    from capslip.caps.spheres import elliptic_factor

    long_m, short_m, turn = 40.0, 20.0, 0.7
    scale = RADIUS_M / (np.sqrt(long_m * short_m) * float(elliptic_factor(long_m / short_m)))

    def ellipse(x, y):
        u, v = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
        return -(u**2 / long_m + v**2 / short_m) / (2.0 * scale)

    known = {"radius_major_m": long_m, "radius_minor_m": short_m, "orientation_rad": turn}
    assert np.abs(profile(ellipse, **known).change).max() < 1e-4
    assert np.abs(profile(ellipse, **{**known, "orientation_rad": -turn}).change).max() > 0.01


def sneddon(quartic_per_m3):
    """Return d(N) of a paraboloid less a quartic: powers n of the profile, by Sneddon (1965)."""

    def approach_m(load_N):
        def too_wide(a):
            of_load = 2.0 / 3.0 * a**3 / RADIUS_M - 32.0 / 15.0 * quartic_per_m3 * a**5
            return 2.0 * E_STAR_PA * of_load - load_N

        a = brentq(too_wide, 0.0, 3.0 * CONTACT_M, xtol=1e-15, rtol=1e-14)
        return a**2 / RADIUS_M - 8.0 / 3.0 * quartic_per_m3 * a**4

    return approach_m


@pytest.mark.parametrize("share", [0.02, -0.02])
def test_a_quartic_changes_the_answers_as_sneddons_contact_does(share):
    """To first order: a term of a fiftieth of the depth at the edge of the contact."""
    quartic_per_m3 = share * CONTACT_M**2 / (2.0 * RADIUS_M) / CONTACT_M**4
    found = profile(lambda x, y: cap(x, y) + quartic_per_m3 * (x**2 + y**2) ** 2)
    assert found.up_m[0] < 0.0 if share > 0.0 else found.up_m[0] > 0.0

    def answers(quartic):
        d = sneddon(quartic)
        losses = []
        for s in np.array(SHARES) * PRELOAD_N:
            mean = quad(lambda drop: d(PRELOAD_N - drop), 0.0, s, epsrel=1e-10)[0] / s
            losses.append(4.0 * s * (2.0 * mean - d(PRELOAD_N) - d(PRELOAD_N - s)))
        step = 1e-4 * PRELOAD_N
        slope = (d(PRELOAD_N + step) - d(PRELOAD_N - step)) / (2.0 * step)
        return np.array([*losses, 1.0 / slope])

    exact = answers(quartic_per_m3) / answers(0.0) - 1.0
    assert np.abs(exact[0]) > 0.009
    assert found.change == pytest.approx(exact, rel=0.1)


def test_what_noise_hides_or_nobody_measured_is_not_told_nor_that_spheres_are_spheres():
    noise_m = 0.01 * APPROACH_M

    def noisy(x, y):
        return cap(x, y) + np.random.default_rng(1).normal(0.0, noise_m, x.shape)

    assert profile(noisy, noise_m=noise_m) is None
    assert profile(noisy, noise_m=0.5 * noise_m) is not None
    assert profile(cap, profile_residual_m=5e-5 * APPROACH_M) is None
    assert profile(cap, profile_residual_m=np.nan) is not None

    def with_a_hole(x, y):
        return np.where(np.hypot(x, y) < 3e-4, np.nan, 1.1 * cap(x, y))

    found = profile(with_a_hole)
    assert np.isnan([found.up_m[0], found.log_radius[0]]).all()
    assert (found.change == 0.0).all()


def test_waves_of_a_few_pixels_are_not_taken_for_noise_nor_what_lies_beside_a_contact():
    noise_m = 0.01 * APPROACH_M

    def waves(x, y):
        return cap(x, y) + noise_m * np.sin(x / PIXELS_M[1]) * np.cos(y / PIXELS_M[1])

    assert profile(waves, noise_m=noise_m) is not None

    def rough_beside(x, y):
        noise = np.random.default_rng(1).normal(0.0, APPROACH_M, x.shape)
        return cap(x, y) + (np.hypot(x, y) > 2.0 * CONTACT_M) * noise

    assert profile(rough_beside, noise_m=noise_m) is not None


@pytest.mark.parametrize("beyond", [-1, 1])
@pytest.mark.parametrize(("axis", "far"), [(0, False), (0, True), (1, False), (1, True)])
def test_a_contact_is_known_to_the_last_points_of_the_map(axis, far, beyond):
    """Its outermost places, at 0.978 of its radius, are a little within the last points or past."""
    side_m = (120 * PIXELS_M[1], 100 * PIXELS_M[0])[axis]
    pixel_m = PIXELS_M[1 - axis]
    to_edge_m = 0.978 * CONTACT_M + (0.5 - 0.1 * beyond) * pixel_m
    place_m = list(PLACE_M)
    place_m[axis] = side_m - to_edge_m if far else to_edge_m
    for margin in (0, 3):
        found = profile(cap, place_m=place_m, margin=margin)
        assert np.isnan(found.up_m[0]) == (beyond > 0)


@pytest.mark.parametrize(
    ("seed", "length", "load_N"),
    [
        (3048, 7.2, 5e-3),
        (3049, 13.9, 2e-3),
        (3052, 9.6, 4e-3),
        (3055, 9.6, 4e-3),
        (3027, 7.2839, 1.318e-3),  # waves that lower differences take for noise
    ],
)
def test_narrow_hills_of_waves_are_off_by_no_more_than_is_said(seed, length, load_N):
    """Their caps are fitted to all of a hill, and rest on its top alone."""
    shape, pixel_m = (60, 60), 1e-5
    scene = Scene(
        shape, (pixel_m, pixel_m), seed=seed, waviness_rms_m=1e-8, waviness_length_m=length * 1e-5
    )
    contact = {"alignment": "as_levelled", "bulk": True, "preload_N": load_N}

    def analysis(model, finer):
        given = {"contact": contact | {"model": model}, "conditioning": {"form": "none"}}
        return capslip.analyze(synthetic_surface(scene, finer=finer)[0], settings_from(given))

    found, true = analysis("interacting", 1), analysis("boundary_elements", 5)
    force_N = np.array(SHARES) * found.slip.total_slip_force_N
    off = found.slip.energy_at_force_J(force_N) / true.slip.energy_at_force_J(force_N) - 1.0
    assert 0.02 < np.abs(off).max() < found.contact.errors.energy < 0.2
