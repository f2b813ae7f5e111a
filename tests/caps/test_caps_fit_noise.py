"""Caps: accuracy under noise, and error bars that hold the truth."""

import numpy as np
import pytest
from scipy import ndimage

from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.caps.noise import noise_on_hills
from capslip.caps.points import points_of_hills
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

CAPS = [
    (6e-3, 5e-3, 24.0, 0.0),
    (14e-3, 12e-3, 27.0, -3e-8),
    (24e-3, 8e-3, 25.0, -2e-8),
    (6e-3, 15e-3, 26.0, -1e-8),
    (22e-3, 16e-3, 23.0, -2.5e-8),
]
PIXEL_M = 1e-4
SMALLEST_CAP_M = 6e-8  # height of the lowest of them above the cut


def noise(rng, shape, rms_m, correlation_px):
    white = rng.standard_normal(shape)
    if correlation_px:
        white = ndimage.gaussian_filter(white, correlation_px, mode="wrap")
    return rms_m * white / white.std()


def scene(seed, rms_m, correlation_px=0.0, lost=0.02, tilt=0.0):
    """Caps at places and with radii that vary from seed to seed, and their surface."""
    rng = np.random.default_rng(seed)
    caps = [
        (x + rng.uniform(0, PIXEL_M), y + rng.uniform(0, PIXEL_M), R * rng.uniform(0.9, 1.1), z)
        for x, y, R, z in CAPS
    ]
    surface = caps_map(caps)
    height_m = surface.height_m + noise(rng, surface.shape, rms_m, correlation_px)
    height_m = height_m + tilt * (np.arange(surface.shape[1]) + 0.5) * PIXEL_M
    height_m[rng.random(surface.shape) < lost] = np.nan
    return caps, HeightMap(height_m, surface.pixel_size_m)


def errors(fit, n_seeds, **options):
    """Relative errors of R and errors of the apex, with their standard errors: shape (k, 4)."""
    rows = []
    for seed in range(n_seeds):
        caps, surface = scene(seed, **options)
        table = fit_caps(surface, find_hills(surface, separation="regions"), fit)
        for x, y, radius_m, peak_m in caps:
            i = int(np.argmin(np.hypot(table.x_m - x, table.y_m - y)))
            rows.append(
                (
                    table.radius_m[i] / radius_m - 1,
                    table.radius_se_m[i] / radius_m,
                    table.peak_height_m[i] - peak_m,
                    table.peak_height_se_m[i],
                )
            )
    return np.array(rows)


@pytest.mark.parametrize("fit", ["equation18", "pinned", "least_squares", "contact"])
def test_clean_caps_are_within_two_per_cent(fit):
    radius, _, apex_m, _ = errors(fit, 4, rms_m=0.0, lost=0.0).T
    assert np.abs(radius).max() < 0.02
    if fit != "equation18":
        assert np.abs(radius).max() < 0.002
        assert np.abs(apex_m).max() < 1e-12


@pytest.mark.parametrize("fit", ["pinned", "least_squares", "contact"])
def test_caps_with_a_tenth_of_their_height_as_noise_are_within_five_per_cent(fit):
    radius, _, apex_m, _ = errors(fit, 8, rms_m=0.1 * SMALLEST_CAP_M).T
    assert np.sqrt(np.mean(radius**2)) < 0.025
    assert np.abs(radius).mean() < 0.02
    assert np.abs(apex_m).max() < 0.05 * SMALLEST_CAP_M


@pytest.mark.long
@pytest.mark.parametrize("fit", ["pinned", "least_squares"])
@pytest.mark.parametrize(
    ("share", "correlation_px"), [(0.01, 0.0), (0.1, 0.0), (0.03, 1.0), (0.1, 0.5)]
)
def test_intervals_hold_the_truth(fit, share, correlation_px):
    radius, radius_se, apex_m, apex_se_m = errors(
        fit, 24, rms_m=share * SMALLEST_CAP_M, correlation_px=correlation_px
    ).T
    for error, standard_error in ((radius, radius_se), (apex_m, apex_se_m)):
        assert 0.9 <= np.mean(np.abs(error) < 1.96 * standard_error) <= 0.995
        # nor are they merely wide
        assert 0.5 < np.std(error / standard_error) < 1.3


def test_a_tilt_moves_the_apex_and_leaves_the_radius():
    slope = 1e-6
    _, level = scene(3, 2e-10)
    caps, tilted = scene(3, 2e-10, tilt=slope)
    hills = find_hills(level)
    here, there = fit_caps(level, hills, "least_squares"), fit_caps(tilted, hills, "least_squares")
    order = np.array([np.argmin(np.hypot(here.x_m - x, here.y_m - y)) for x, y, *_ in caps])
    radius_m = np.array([cap[2] for cap in caps])
    assert there.radius_m[order] == pytest.approx(radius_m, rel=0.01)
    assert (there.x_m - here.x_m)[order] == pytest.approx(slope * radius_m, rel=0.02)


@pytest.mark.parametrize("correlation_px", [0.0, 0.5, 1.0])
def test_noise_is_measured_white_or_correlated(correlation_px):
    _, surface = scene(0, 5e-9, correlation_px)
    measured = noise_on_hills(surface, points_of_hills(surface, find_hills(surface)))
    assert measured.rms_m == pytest.approx(5e-9, rel=0.1)
    # a filter of weights w raises the error of means by sum w / sqrt(sum w^2) along each axis
    weights = np.eye(1, 33, 16)[0]
    if correlation_px:
        weights = ndimage.gaussian_filter1d(weights, correlation_px)
    inflation = weights.sum() ** 2 / (weights**2).sum()
    assert measured.inflation == pytest.approx(inflation, rel=0.15)


def test_a_smooth_face_has_no_noise():
    rng = np.random.default_rng(0)
    height_m = noise(rng, (200, 300), 4e-7, 15.0)
    surface = HeightMap(height_m, (PIXEL_M, PIXEL_M))
    measured = noise_on_hills(surface, points_of_hills(surface, find_hills(surface)))
    assert measured.rms_m < 1e-3 * 4e-7
    assert measured.inflation == pytest.approx(1.0)
