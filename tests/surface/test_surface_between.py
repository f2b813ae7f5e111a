"""What lies between the points of a face that is laid on others: how much of it is missed."""

import numpy as np
import pytest
from scipy import ndimage

from capslip.surface.heightmap import HeightMap
from capslip.surface.laying import between_points, on_more_points
from capslip.surface.mating import composite_surface, place

D_M = 2e-5
N = 256


def rough(hurst, shortest=2.0, seed=0):
    """Return a periodic face of rms 1 on N x N points, its shortest waves so many points long."""
    rng = np.random.default_rng(seed)
    waves = np.hypot(np.fft.fftfreq(N)[:, None], np.fft.rfftfreq(N)[None])
    size = np.maximum(waves, 1.0 / 40.0) ** -(1.0 + hurst)
    size[(waves > 1.0 / shortest) | (waves == 0.0)] = 0.0
    z = np.fft.irfft2(size * np.exp(2j * np.pi * rng.random(size.shape)), s=(N, N))
    return z / z.std()


def every_other(z):
    """Lay every other point of a face on all; return what it says of it, and what is true."""
    face = HeightMap(z[::2, ::2], (2 * D_M, 2 * D_M))
    grid = np.eye(2) / 2.0, np.zeros(2), (N - 1, N - 1)
    found = between_points(face, *grid)
    laid = ndimage.affine_transform(face.height_m, grid[0], output_shape=grid[2], order=5)
    return found, (laid - z[:-1, :-1])[20:-20, 20:-20].std()


@pytest.mark.parametrize("hurst", [0.5, 0.8, 1.0])
def test_of_rough_faces_about_as_much_is_missed_as_is_said(hurst):
    """A cubic and a quintic spline differ by an eighth of it: both miss the same."""
    found, missed = every_other(rough(hurst))
    assert found.missed_m() == pytest.approx(missed, rel=0.3)
    assert found.apart_m == 2 * D_M
    assert found.finer_m < 0.25 * missed


@pytest.mark.parametrize(("shortest", "most"), [(5.0, 0.02), (6.0, 4e-3), (8.0, 3e-4)])
def test_of_faces_without_short_waves_little_is(shortest, most):
    """No less than is missed, and no more than six times as much."""
    found, missed = every_other(rough(0.8, shortest))
    assert 0.4 * missed < found.missed_m() < 6.0 * missed
    assert found.missed_m() < most


@pytest.mark.parametrize("hurst", [0.8, 1.0])
def test_noise_that_is_known_is_nothing_that_lies_between(hurst):
    z = rough(hurst, 8.0)
    noisy = z + 0.2 * np.random.default_rng(3).standard_normal(z.shape)
    found = every_other(noisy)[0]
    assert 0.05 < found.missed_m() < 0.2  # no more than the noise itself
    assert found.missed_m(0.2) < 0.2 * found.missed_m()
    assert found.missed_m(0.3) == 0.0


def test_steps_and_spikes_are_nothing_that_lies_between():
    z = rough(0.8, 12.0)
    stepped = z.copy()
    stepped[100, 50], stepped[60:62, 200:202] = 50.0, -50.0
    before, after = (every_other(one)[0].missed_m() for one in (z, stepped))
    assert after < 5e-3 + 2.0 * before


def test_points_that_are_not_measured_are_left_out():
    z = rough(0.8)
    holed = z.copy()
    holed[30:90, 40:140] = np.nan
    whole, found = (every_other(one)[0].missed_m() for one in (z, holed))
    assert found == pytest.approx(whole, rel=0.1)
    none = between_points(HeightMap(z, (D_M, D_M)), np.eye(2), np.array([1e4 + 0.5, 0.0]), (20, 20))
    assert none.missed_m() == 0.0


def test_a_sum_knows_which_of_its_faces_were_laid():
    fine, coarse = (
        HeightMap(1e-7 * rough(0.8, seed=k)[::k, ::k], (k * D_M, k * D_M)) for k in (1, 2)
    )
    same = composite_surface(fine, fine, place(fine, fine))
    assert same.between == ()
    for first, second in ((fine, coarse), (coarse, fine)):
        both = composite_surface(first, second, place(first, second))
        assert [one.apart_m for one in both.between] == [2 * D_M]
    aside = place(fine, fine, offset_m=(0.3 * D_M, 0.0))
    assert [one.apart_m for one in composite_surface(fine, fine, aside).between] == [D_M]
    shape = (2 * N, N)
    assert len(on_more_points(fine, shape).between) == 1
