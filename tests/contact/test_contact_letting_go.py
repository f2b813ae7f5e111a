"""What is left of contacts and their loads below a preload, against closed forms and solutions."""

import numpy as np
import pytest

from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.solvers import path
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

E_STAR_PA = 1.1e11


def contact_in(pixel_m, radius_m, load_N):
    """Return unloading and state of one sphere, and the distances of its pixels in contact."""
    n = 2 * int(6e-4 / pixel_m / 2) + 1
    surface = caps_map(
        [(0.5 * n * pixel_m, 0.5 * n * pixel_m, radius_m, 0.0)], (n, n), (pixel_m, pixel_m)
    )
    curve = boundary_elements(surface, E_STAR_PA)
    pressed, unloading = curve.pressed(load_N), curve.unloading(load_N)
    row, col = np.nonzero(pressed.region)
    return unloading, pixel_m * np.hypot(row - n // 2, col - n // 2)


@pytest.mark.parametrize(("pixel_m", "refined"), [(1e-5, False), (4e-5, True)])
def test_a_pixel_of_a_sphere_lets_go_where_the_radius_of_the_contact_passes_it(pixel_m, refined):
    unloading, r_m = contact_in(pixel_m, 2.0, 2.0)
    assert (unloading.refinement > 1) == refined
    left = unloading.letting_go
    a_m = (0.75 * left.load_N * 2.0 / E_STAR_PA) ** (1 / 3)
    assert len(left.first) == len(r_m)
    inside = r_m < a_m[-2]
    assert inside.sum() >= 20
    off = np.maximum(r_m - a_m[left.first], a_m[left.first - 1] - r_m)[inside]
    assert off.max() < 0.5 * pixel_m
    assert (left.first >= 1).all()
    np.testing.assert_allclose(left.region_share[:, 0], left.load_N / 2.0, rtol=1e-5)


@pytest.fixture(scope="module")
def rough():
    """Waves whose contacts run together, solved on the pixels of the map alone."""
    rng = np.random.default_rng(7)
    per_pixel = np.hypot(np.fft.fftfreq(160)[:, None], np.fft.rfftfreq(160))
    spectrum = np.fft.rfft2(rng.normal(size=(160, 160))) * np.maximum(per_pixel, 0.03) ** -3.0
    height_m = np.fft.irfft2(spectrum, (160, 160))
    surface = HeightMap(3e-7 * height_m / height_m.std(), (5e-5, 5e-5))
    curve, load_N = boundary_elements(surface, E_STAR_PA), 600.0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(path, "refinement", lambda *_: 1)
        assert len(curve.pressed(load_N).region_loads_N) == 30
        curve.unloading(load_N)
    return curve, load_N


def test_the_loads_of_the_regions_are_the_load_of_the_face(rough):
    curve, load_N = rough
    left, pressed = curve.unloading(load_N).letting_go, curve.pressed(load_N)
    np.testing.assert_allclose(left.region_share @ pressed.region_loads_N, left.load_N, rtol=1e-5)
    assert left.load_N[0] == 0.0
    assert left.load_N[-1] == load_N
    assert (left.region_share[0] == 0.0).all()
    assert (left.region_share[-1] == 1.0).all()


@pytest.mark.parametrize(("row", "off"), [(30, 0.01), (25, 0.02), (20, 0.07), (13, 0.07)])
def test_what_is_left_is_what_a_solution_finds(rough, row, off):
    curve, load_N = rough
    left, pressed = curve.unloading(load_N).letting_go, curve.pressed(load_N)
    own = curve.solutions.press(float(left.load_N[row]))
    touches, at = left.first <= row, pressed.region > 0
    assert np.count_nonzero(own.pressure_Pa[~at]) == 0
    expected = own.pressure_Pa[at] > 0.0
    assert (touches != expected).sum() < off * expected.sum()
    expected_N = np.bincount(pressed.region[at], own.pressure_Pa[at])[1:]
    expected_N *= np.prod(own.pixel_size_m)
    found_N = left.region_share[row] * pressed.region_loads_N
    np.testing.assert_allclose(found_N, expected_N, atol=5e-4 * left.load_N[row])
