"""The stencil of the noise: what it is blind to, what it passes, and its median."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.settings import Settings, load_settings
from capslip.surface.filters import gaussian_l_filter, gaussian_s_filter
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap
from capslip.surface.mating import composite_surface, place
from capslip.surface.noise import (
    known_noise_m,
    mixed_difference,
    noise_of_map_m,
    rms_of_noise_m,
)
from capslip.surface.resampling import resample


def on_map(height_m, step):
    """Differences about all inner points of a map."""
    (ny, nx), k = height_m.shape, step
    return mixed_difference(
        lambda i, j: height_m[k + k * i : ny - k + k * i, k + k * j : nx - k + k * j]
    )


@pytest.mark.parametrize("step", [1, 3])
def test_no_quadratic_surface_is_seen(step):
    y, x = np.mgrid[:12, :15].astype(float)
    quadratic = 3 + 2 * x - y + 5 * x**2 - 4 * x * y + 7 * y**2
    assert (on_map(quadratic, step) == 0.0).all()
    assert (on_map(quadratic + x**2 * y**2, step) == 4.0 * step**4).all()


@pytest.mark.parametrize("step", [1, 2])
def test_white_noise_passes_36_times_in_variance(step):
    white = np.random.default_rng(0).standard_normal((800, 900))
    assert on_map(white, step).var() == pytest.approx(36.0, rel=0.02)
    assert rms_of_noise_m(on_map(white, step)) == pytest.approx(1.0, rel=0.01)


def test_spikes_steps_and_missing_points_do_no_harm():
    rng = np.random.default_rng(1)
    height_m = 1e-9 * rng.standard_normal((400, 600))
    height_m[:, 300:] += 1e-5
    height_m[rng.random(height_m.shape) < 0.002] = 1e-3
    height_m[50:90, 100:200] = np.nan
    assert noise_of_map_m(height_m) == pytest.approx(1e-9, rel=0.05)


@pytest.mark.parametrize("shape", [(1, 1), (2, 40), (40, 2), (1, 40), (40, 1)])
def test_a_map_too_narrow_for_the_stencil_has_no_noise(shape):
    assert noise_of_map_m(np.random.default_rng(2).random(shape)) == 0.0
    assert noise_of_map_m(np.full((9, 9), np.nan)) == 0.0


FLAT = HeightMap(np.zeros((40, 50)), (1e-4, 1e-4))
NOISY = replace(FLAT, noise_m=3e-9)


@pytest.mark.parametrize(
    ("change", "noise_m"),
    [
        (lambda one: one, 3e-9),
        (lambda one: remove_form(one, "quadratic")[0], 3e-9),
        (lambda one: gaussian_l_filter(one, 1e-3), 3e-9),  # leaves what pixels do not share
        (lambda one: gaussian_s_filter(one, 1e-3), None),  # leaves less
        (lambda one: resample(one, (20, 25)), None),
        (lambda one: composite_surface(one, replace(one, noise_m=4e-9), place(one, one)), 5e-9),
        (lambda one: composite_surface(one, FLAT, place(one, FLAT)), None),
    ],
)
def test_the_noise_of_a_map_stays_where_its_heights_keep_it(change, noise_m):
    found = change(NOISY)
    assert found.noise_m == (None if noise_m is None else pytest.approx(noise_m))
    assert known_noise_m(found, Settings()) == found.noise_m
    assert change(FLAT).noise_m is None
    given = load_settings(overrides=("instrument.noise_m=1e-9",))
    assert known_noise_m(found, given) == 1e-9  # as somebody says
