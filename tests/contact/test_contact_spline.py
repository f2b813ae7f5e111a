"""What lies between the pixels of a smooth map, and half a pixel beyond its last ones."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.contact.map_accuracy import error_of_map
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.solvers import detail
from capslip.contact.solvers.metal import first_loading
from capslip.contact.solvers.patches import patched
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.contact.solvers.refinement import spline_of
from capslip.surface.heightmap import HeightMap

E, PIXEL_M, FINER = 110e9, 1e-4, 8


def wave_m(shape, of_pixels, phase, finer=1):
    """Return a wave across both axes, at the centres of pixels."""
    y, x = (np.arange(n * finer)[:, None] + 0.5 for n in shape)
    k = 2.0 * np.pi / (of_pixels * finer)
    return np.cos(k * y + phase[0]) + np.cos(k * x.T + phase[1])


def left_m(spline, of_pixels, phase, beyond):
    """Return the rms that a spline leaves of a wave, between its pixels or beyond the last."""
    shape = (24, 30)
    face = elastic_face(HeightMap(wave_m(shape, of_pixels, phase), (PIXEL_M, PIXEL_M)), E)
    contact = np.ones(shape, dtype=bool)
    found = patched(face, contact, FINER, ways=[np.array([[0, 0, *shape]])], spline=spline)
    height_m = -found.depth_m.reshape([n * FINER for n in shape])
    off_m = height_m - wave_m(shape, of_pixels, phase, FINER)
    inside = np.zeros(off_m.shape, dtype=bool)
    edge = 4 * FINER
    inside[edge:-edge, edge:-edge] = True
    off_m -= off_m[inside].mean()  # depths count from the highest point
    last = np.zeros(off_m.shape, dtype=bool)
    last[edge:-edge, : FINER // 4] = True
    return float(np.sqrt(np.mean(off_m[last if beyond else inside] ** 2)))


PHASES = [(0.3, phase) for phase in np.linspace(0.0, 2.0 * np.pi, 9)[:-1]]


@pytest.mark.parametrize("of_pixels", [6.0, 8.0])
def test_the_fifth_degree_follows_waves_far_closer_than_the_third(of_pixels):
    third, fifth = (
        left_m(spline, of_pixels, PHASES[1], beyond=False) for spline in ("third", "fifth")
    )
    print(third, fifth)
    assert fifth < 0.3 * third


@pytest.mark.parametrize("of_pixels", [6.0, 8.0])
def test_beyond_the_last_pixels_the_mean_of_both_is_nearer_than_the_third(of_pixels):
    third, mean = (
        np.array([left_m(spline, of_pixels, phase, beyond=True) for phase in PHASES])
        for spline in ("third", "fifth")
    )
    print(np.sqrt(np.mean(third**2)), np.sqrt(np.mean(mean**2)))
    assert np.sqrt(np.mean(mean**2)) < 0.6 * np.sqrt(np.mean(third**2))


def rough(seed, finer=1):
    """Return a map of 40 waves of 5.5 to 12 pixels, on pixels as much finer."""
    rng, n = np.random.default_rng(seed), 40
    of_pixels = rng.uniform(5.5, 12.0, n)
    way, phase = rng.uniform(0.0, 2.0 * np.pi, (2, n))
    y, x = ((np.arange(m * finer) + 0.5) / finer for m in (48, 64))
    k = 2.0 * np.pi / of_pixels
    phases = zip(k * np.cos(way), k * np.sin(way), phase, strict=True)
    height_m = sum(np.cos(kx * x + ky * y[:, None] + at) for kx, ky, at in phases)
    return HeightMap(4e-7 / np.sqrt(n / 2) * height_m, (2e-4 / finer, 2e-4 / finer))


def energies_J(surface, load_N, scan=None):
    curve = scan or boundary_elements(surface, E, preload_N=load_N).at_forces(detail.FORCE_SHARES)
    return detail._loss_J(curve.unloading(load_N))


@pytest.mark.long
@pytest.mark.parametrize("seed", [8, 10, 12])
def test_contacts_of_few_pixels_slip_as_those_of_finer_ones(seed):
    scan = boundary_elements(rough(seed), E, preload_N=200.0)
    assert scan.unloading(200.0).spline == "fifth"
    off = energies_J(None, 200.0, scan) / energies_J(rough(seed, 4), 200.0) - 1.0
    assert (np.abs(off) < (0.05, 0.02, 0.02, 0.01)).all()
    stated, _ = error_of_map(scan, 200.0, 0.05)
    assert (np.abs(off) <= [stated.energy_at(share) for share in detail.FORCE_SHARES]).all()


@pytest.mark.long
def test_a_hill_that_touches_beyond_the_last_pixels_alone_is_in_the_stated_error():
    """It bears a thousandth of the load, and makes a fifth of what is lost at a tenth of mu N."""
    scan = boundary_elements(rough(7), E, preload_N=40.0)
    off = energies_J(None, 40.0, scan) / energies_J(rough(7, 4), 40.0) - 1.0
    assert abs(off[0]) > 0.1
    stated, _ = error_of_map(scan, 40.0, 0.05)
    errors = np.array([stated.energy_at(share) for share in detail.FORCE_SHARES])
    assert (np.abs(off) <= 1.05 * errors).all()


def pressed_waves(change=lambda height_m, contact: height_m, hardness_Pa=np.inf, finer=1):
    surface = rough(8, finer)
    contact = press(elastic_face(surface, E), load_N=200.0).pressure_Pa > 0.0
    height_m = change(surface.height_m.copy(), contact)
    face = elastic_face(HeightMap(height_m, surface.pixel_size_m), E)
    face = replace(face, hardness_Pa=hardness_Pa)
    pressed = press(face, load_N=200.0)
    return (face, pressed) if np.isinf(hardness_Pa) else first_loading(face, pressed)


def beside(height_m, contact, value_m):
    """Change one height four pixels before the contact that lies furthest along the columns."""
    y, x = max(np.argwhere(contact).tolist(), key=lambda at: at[1])
    height_m[y, x - 4] = value_m(height_m[y, x - 4])
    return height_m


def test_a_smooth_map_has_the_fifth_degree_between_its_pixels():
    assert spline_of(*pressed_waves()) == "fifth"


def test_with_noise_and_beside_a_lost_point_a_pit_and_flats_it_is_the_third():
    """The fifth swings further, and knows no edge of a flat."""
    noise_m = 1e-9 * np.random.default_rng(1).standard_normal((144, 192))
    assert spline_of(*pressed_waves(lambda z, _: z + noise_m, finer=3)) == "third"
    assert spline_of(*pressed_waves(finer=3)) == "fifth"
    lost = pressed_waves(lambda z, contact: beside(z, contact, lambda _: np.nan))
    assert spline_of(*lost) == "third"
    pit = pressed_waves(lambda z, contact: beside(z, contact, lambda height: height - 1e-6))
    assert spline_of(*pit) == "third"
    assert spline_of(*pressed_waves(hardness_Pa=1e8)) == "third"
