"""Whether anything that was measured stands in the pressed plane."""

import math

import numpy as np
import pytest

from capslip.contact.certificate import certify_cut
from capslip.surface.heightmap import HeightMap

E_STAR_PA = 109.89e9
PIXEL_M = (1e-4, 1e-4)
SHAPE = (400, 600)
RADIUS_M, LOAD_N = 25.0, 200.0
CONTACT_M = (0.015, 0.02)
A_M = float(np.cbrt(0.75 * LOAD_N * RADIUS_M / E_STAR_PA))  # 3.2 mm
COMPRESSION_M = A_M**2 / RADIUS_M


def axes():
    y, x = np.ogrid[0 : SHAPE[0], 0 : SHAPE[1]]
    return (x + 0.5) * PIXEL_M[1], (y + 0.5) * PIXEL_M[0]


def sphere(x_m, y_m, peak_m, radius_m=RADIUS_M):
    x, y = axes()
    return peak_m - ((x - x_m) ** 2 + (y - y_m) ** 2) / (2 * radius_m)


def certify(height_m, label, noise_m=0.0):
    caps_m = np.array([[CONTACT_M[0]], [CONTACT_M[1]], [RADIUS_M]])
    surface = HeightMap(height_m, PIXEL_M)
    load_N = np.array([LOAD_N])
    return certify_cut(surface, label, -COMPRESSION_M, caps_m, load_N, E_STAR_PA, noise_m)


def one_cap(floor_m=-2e-6):
    """Return a sphere that is pressed until the plane is its compression below its apex."""
    height_m = np.maximum(sphere(*CONTACT_M, 0.0), floor_m)
    return height_m, (height_m > -1e-6).astype(np.int32)


def sinking(r_m):
    """Johnson 3.42 at r > a, from its own closed form."""
    rho = A_M / r_m
    asin, root = math.asin(rho), math.sqrt(1 / rho**2 - 1)
    return COMPRESSION_M / math.pi * ((2 - 1 / rho**2) * asin + root)


def test_a_lone_sphere_certifies_itself():
    assert certify(*one_cap()) == 0.0


@pytest.mark.parametrize(("share", "holds"), [(1.0, True), (1.05, False)])
def test_another_peak_is_in_the_way_once_it_stands_above_the_sunk_surface(share, holds):
    """By more than the 2 % that point loads may be off; not where it is a hill of its own."""
    height_m, label = one_cap()
    peak_m = share * sinking(0.025) - COMPRESSION_M  # 25 mm away
    hill_m = sphere(0.04, 0.02, peak_m, 60.0)
    height_m = np.maximum(height_m, hill_m)
    excess_m = peak_m + COMPRESSION_M - 1.02 * sinking(0.025)
    area_m2 = certify(height_m, label)
    assert (area_m2 == 0.0) == holds
    assert holds or area_m2 == pytest.approx(2.0 * math.pi * 60.0 * excess_m, rel=0.5)
    label[hill_m > -1e-6] = 2
    assert certify(height_m, label) == 0.0


def test_noise_is_no_hill_and_lost_points_are_none_either():
    height_m, label = one_cap(floor_m=-COMPRESSION_M - 1e-9)
    rng = np.random.default_rng(0)
    noisy_m = height_m + 2e-8 * rng.standard_normal(SHAPE)
    assert certify(noisy_m, label, noise_m=2e-8) == 0.0
    lost_m = np.where(rng.random(SHAPE) < 0.1, np.nan, noisy_m)
    assert certify(lost_m, label, noise_m=2e-8) == 0.0
    lost_m = np.where(np.arange(SHAPE[1]) < 300, lost_m, np.nan)
    assert certify(lost_m, label, noise_m=2e-8) == 0.0
