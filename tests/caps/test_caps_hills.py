"""The cut and the regions above it."""

import numpy as np
import pytest

from capslip.caps.hills import _square, find_hills
from capslip.errors import UnusableSurfaceError
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

CAPS = [(6e-3, 5e-3, 24.0, 0.0), (14e-3, 12e-3, 27.0, -1e-7), (24e-3, 8e-3, 25.0, -5e-8)]


def test_the_cut_keeps_its_share_of_the_measured_points_only():
    rng = np.random.default_rng(0)
    height_m = rng.normal(size=(200, 300))
    height_m[:100] = np.nan
    hills = find_hills(HeightMap(height_m, (1e-5, 1e-5)), 0.1)
    assert hills.cut_height_m == np.quantile(height_m[100:], 0.9)
    assert hills.kept_fraction == pytest.approx(0.1, abs=1e-4)


def test_regions_are_eight_connected():
    height_m = np.zeros((40, 40))
    height_m[5:10, 5:10] = 1.0
    height_m[10:15, 10:15] = 1.0  # touches the first by a corner
    height_m[30:35, 30:35] = 1.0
    hills = find_hills(HeightMap(height_m, (1.0, 1.0)), 75 / 1600, separation="regions")
    assert (hills.n_regions, hills.n_hills) == (2, 2)
    assert hills.label[7, 7] == hills.label[12, 12] != hills.label[32, 32]
    assert hills.largest_region_share == pytest.approx(50 / 75)


def test_fragments_are_counted_not_lost():
    rng = np.random.default_rng(3)
    surface = caps_map(CAPS)
    hills = find_hills(
        HeightMap(surface.height_m + rng.normal(0, 3e-9, surface.shape), (1e-4, 1e-4))
    )
    assert hills.n_hills == 3
    assert hills.n_regions == 3 + sum(hills.rejected.values())


def test_white_noise_is_measured_as_such():
    rng = np.random.default_rng(4)
    surface = caps_map(CAPS)
    noisy = HeightMap(surface.height_m + rng.normal(0, 3e-9, surface.shape), (1e-4, 1e-4))
    assert find_hills(surface).noise_m < 1e-12
    assert find_hills(noisy).noise_m == pytest.approx(3e-9, rel=0.02)


def test_half_and_double_the_pruning_are_counted_as_they_would_be():
    height_m = np.random.default_rng(5).normal(size=(150, 200)).cumsum(0).cumsum(1)
    surface = HeightMap(height_m - height_m.mean(), (1e-5, 1e-5))
    counts = [find_hills(surface, 0.4, pruning_height_m=p).n_hills for p in (2.0, 4.0, 6.0, 8.0)]
    assert counts[0] > counts[1] > counts[2] > counts[3]
    hills = find_hills(surface, 0.4, pruning_height_m=4.0)
    assert (hills.n_hills_half_pruning, hills.n_hills_double_pruning) == (counts[0], counts[3])


@pytest.mark.parametrize(
    ("noise", "share", "side"),
    [(0.0119, 1.0, 3), (0.0121, 1.0, 5), (0.0199, 1.0, 5), (0.0201, 1.0, 7), (0.0, 0.6, 5)],
)
def test_the_square_leaves_five_deviations_of_noise_within_a_fiftieth_of_the_relief(
    noise, share, side
):
    found, left_m = _square(noise, 1.0, share)
    assert found == side
    assert left_m == pytest.approx(noise / side)


@pytest.mark.parametrize(
    ("height_m", "ratio", "message"),
    [
        (np.full((20, 20), np.nan), 0.1, "all 400 points are non-measured"),
        (np.full((20, 20), 3.0), 0.1, "all 400 measured heights are equal, "),
        (np.arange(400.0).reshape(20, 20), 0.01, "4 points lie above the cut"),
    ],
)
def test_what_cannot_be_cut_is_refused(height_m, ratio, message):
    with pytest.raises(UnusableSurfaceError, match=message):
        find_hills(HeightMap(height_m, (1.0, 1.0)), ratio)


@pytest.mark.parametrize("slope", [0.0, 1e-6, 3.3e-5, 1e-3])
def test_a_floor_at_the_cut_is_no_hill_by_the_rounding_of_a_plane(slope):
    """Caps on less than the share that is kept: the floor without noise lies at the cut."""
    small = [(x_m, y_m, 0.1 * radius_m, peak_m) for x_m, y_m, radius_m, peak_m in CAPS]
    surface = caps_map(small)
    y_m, x_m = 1e-4 * np.indices(surface.shape)
    plane_m = slope * (x_m - 0.7 * y_m)
    rounded = HeightMap((surface.height_m + plane_m) - plane_m, surface.pixel_size_m)
    assert np.ptp(rounded.height_m - surface.height_m) < 1e-19
    hills = find_hills(rounded, 0.2)
    assert hills.kept_fraction >= 0.2
    assert hills.n_hills == 3
