"""What a mate of coarse points misses is in the errors of the pressed sum, and only that."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.contact.map_accuracy import error_of_map
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.surface.heightmap import HeightMap
from capslip.surface.mating import composite_surface, place

D_M, SHAPE, LOAD_N, E_STAR_PA = 2e-5, (100, 140), 10.0, 110e9
SHARES = (0.1, 0.25, 0.5)


def face(seed, hurst, shortest, rms_m, every=1):
    """Return a face with waves up to so many points of D_M, measured at each or every other."""
    rng = np.random.default_rng(seed)
    waves = np.hypot(np.fft.fftfreq(256)[:, None], np.fft.rfftfreq(256)[None])
    size = np.maximum(waves, 1.0 / 40.0) ** -(1.0 + hurst)
    size[(waves > 1.0 / shortest) | (waves == 0.0)] = 0.0
    z = np.fft.irfft2(size * np.exp(2j * np.pi * rng.random(size.shape)), s=(256, 256))
    z = rms_m / z.std() * z[: SHAPE[0] + 20, : SHAPE[1] + 20]
    return HeightMap(z[::every, ::every], (every * D_M, every * D_M))


def pressed(second, offset_m):
    first = face(1, 0.8, 8.0, 1e-7)
    both = composite_surface(first, second, place(first, second, offset_m=offset_m))
    return boundary_elements(both, E_STAR_PA), both


def losses_J(curve):
    approach_m = curve.approach_m(LOAD_N)
    return curve.loss_integral_at_drop_J(approach_m, np.array(SHARES) * LOAD_N)


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 3, 4])
def test_a_rough_face_of_coarse_points_is_doubted_as_much_as_it_is_off(seed):
    true, _ = pressed(face(seed, 0.8, 2.0, 2e-7), (0.0, 0.0))
    found, _ = pressed(face(seed, 0.8, 2.0, 2e-7, 2), (-0.5 * D_M, 0.5 * D_M))
    stated, said = error_of_map(found, LOAD_N, 0.05)
    assert "mate_coarse" in {one.code for one in said}
    off = np.abs(np.log(losses_J(found) / losses_J(true)))
    assert off.max() > 0.05
    assert (off < [stated.energy_at(share) for share in SHARES]).all()
    assert stated.stiffness < 0.5 * stated.energy_at(0.25)


@pytest.mark.long
def test_a_smooth_face_of_coarse_points_is_doubted_as_if_it_were_measured():
    curve, both = pressed(face(5, 0.8, 9.0, 2e-7, 2), (-0.5 * D_M, 0.5 * D_M))
    assert both.between
    alone = boundary_elements(replace(both, between=()), E_STAR_PA)
    (stated, said), (before, of_map) = (error_of_map(c, LOAD_N, 0.05) for c in (curve, alone))
    assert said == of_map
    assert stated.stiffness == pytest.approx(before.stiffness, rel=0.05)
    assert stated.energy_at(0.25) == pytest.approx(before.energy_at(0.25), rel=0.2)
