"""Interpolated maps tell their points; measured ones, however smooth, are not taken for them."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, zoom

from capslip.surface.heightmap import HeightMap
from capslip.surface.interpolated import pixels_apart

SHAPE = (120, 192)
ROW, COLUMN = np.mgrid[: SHAPE[0], : SHAPE[1]]


def waves_m(width=6.0, seed=3, noise_m=0.0):
    rng = np.random.default_rng(seed)
    z = gaussian_filter(rng.standard_normal(SHAPE), width)
    return 3e-7 * z / z.std() + rng.normal(0.0, noise_m, SHAPE)


def found(height_m):
    return pixels_apart(HeightMap(height_m, (1e-4, 1e-4)))


def finer(height_m, times, order):
    """Interpolate in cells, so that places are at the same distances from the points."""
    return zoom(height_m, times, order=order, grid_mode=True, mode="nearest")


@pytest.mark.parametrize(
    ("order", "every"), [(0, 2), (0, 5), (1, 2), (1, 3), (1, 7), (3, 4), (3, 6)]
)
@pytest.mark.parametrize("noise_m", [0.0, 5e-9])
def test_interpolated_maps_tell_their_points(order, every, noise_m):
    """Copies, straight lines and cubic splines between points that bear noise of their own."""
    points_m = waves_m(noise_m=noise_m)[::every, ::every]
    assert found(finer(points_m, every, order)) == (every, every)


@pytest.mark.parametrize("every", [2, 3, 4])
@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("on_points", [False, True])
def test_a_map_that_is_as_rough_as_its_points_is_interpolated(every, order, on_points):
    points_m = waves_m(width=1.0)[::every, ::every]
    sizes = [(n * every - every + 1) / n if on_points else every for n in points_m.shape]
    rough_m = zoom(points_m, sizes, order=order, grid_mode=not on_points, mode="nearest")
    assert all(one > 1 and one % every == 0 for one in found(rough_m))


@pytest.mark.parametrize("every", [2, 3])
@pytest.mark.parametrize("on_points", [False, True])
@pytest.mark.parametrize("noise_m", [2e-10, 5e-9])
def test_cubic_splines_between_close_points_tell_them(every, on_points, noise_m):
    """No difference misses all knots of such a spline: cells of the map know them all the same."""
    points_m = waves_m(noise_m=noise_m)[::every, ::every]
    sizes = [(n * every - every + 1) / n if on_points else every for n in points_m.shape]
    smooth_m = zoom(points_m, sizes, order=3, grid_mode=not on_points, mode="nearest")
    assert all(one > 1 and one % every == 0 for one in found(smooth_m))  # or cells of several


def test_a_pattern_along_one_axis_is_of_the_scan():
    """Rows that go to and fro a pixel apart, or every third of which is noisier, were measured."""
    fro_m = waves_m(width=2.0)
    fro_m[::2] = np.roll(fro_m[::2], 1, axis=1)
    assert found(fro_m) == (1, 1)
    noisy_m = waves_m(noise_m=5e-9)
    assert found(np.where(ROW % 3 == 0, noisy_m, waves_m())) == (1, 1)


@pytest.mark.parametrize("noise_m", [0.0, 5e-9])
def test_one_axis_alone_may_be_interpolated(noise_m):
    points_m = waves_m(noise_m=noise_m)[:, ::2]
    rows_m = [np.interp(np.arange(192), np.arange(0, 192, 2), row) for row in points_m]
    assert found(np.array(rows_m)) == (1, 2)
    assert found(np.array(rows_m).T.copy()) == (2, 1)


def test_lost_points_a_tilt_and_the_digits_of_a_file_change_nothing():
    z = finer(waves_m()[::4, ::4], 4, 1)
    tilted_m = (z + 1e-8 * COLUMN - 3e-8 * ROW).astype(np.float32).astype(float)
    tilted_m[np.random.default_rng(5).random(SHAPE) < 0.2] = np.nan
    assert found(tilted_m) == (4, 4)


def exact_caps(x_px, y_px, radius_px, floor):
    """Return the highest of paraboloids at these places, over a floor, in pixels."""
    row, column = np.mgrid[:107, : int(x_px[-1]) + 35]
    z = np.full(row.shape, floor)
    for x in x_px:
        for y in y_px:
            z = np.maximum(z, -((column - x) ** 2) - (row - y) ** 2)
    return z / (2.0 * radius_px)


def cusps_m(every_y, every_x, radius_m, on_m=1e-4):
    """Return what a ball leaves that cuts at every so many rows and columns."""
    y, x = ROW % every_y - 0.5 * every_y, COLUMN % every_x - 0.5 * every_x
    return radius_m - np.sqrt(radius_m**2 - on_m**2 * (y**2 + x**2))


def staggered_m(every_y, every_x, off_y, radius_m, on_m=1e-4):
    """Return the same of rows that are half a step apart."""
    found_m = []
    for row in (0, 1):
        y = (ROW + off_y + row * every_y) % (2 * every_y) - every_y
        x = (COLUMN + 0.5 * row * every_x) % every_x - 0.5 * every_x
        found_m.append(radius_m - np.sqrt(radius_m**2 - on_m**2 * (y**2 + x**2)))
    return np.minimum(*found_m)


@pytest.mark.parametrize(
    "height_m",
    [
        2e-4 * exact_caps((35.0, 114.0), (25.0, 74.0), 1.5e4, -22.5),
        2e-4 * exact_caps((33.0, 99.0, 165.0), (16.5, 52.5, 88.5), 5e3, -7.5),
        1e-7 * np.maximum(-9.0, -((ROW % 60 - 29.5) ** 2) - (COLUMN % 48 - 23.5) ** 2),
        cusps_m(8, 10, 5.0),
        staggered_m(10, 11, 0.5, 0.05),
        staggered_m(8, 11, 0.3, 5.0),
        cusps_m(7, 8, 0.5),
        -cusps_m(5, 5, 0.05),
        ((ROW % 8 - 4.0) ** 2 + (COLUMN % 7 - 3.5) ** 2) * 1e-8,
    ],
)
def test_exact_shapes_on_whole_pixels_are_not_interpolated(height_m):
    """Their differences vanish but for their edges, which lie at few lines, or at the same ones."""
    assert found(height_m) == (1, 1)
    assert found(height_m + 1e-8 * np.arange(height_m.shape[1])) == (1, 1)


@pytest.mark.parametrize(
    "height_m",
    [
        waves_m(),
        waves_m(width=2.0),
        waves_m(noise_m=1e-8),
        np.random.default_rng(1).normal(0.0, 1e-8, SHAPE),
        np.round(waves_m() / 1e-9) * 1e-9,
        np.round(waves_m() / 1e-7) * 1e-7,
        waves_m() + 5e-9 * (COLUMN % 4 == 0),  # a pattern of the sensor
        waves_m() + 1e-6 * (np.random.default_rng(2).random(SHAPE) < 1e-3),  # spikes
        np.maximum(-1e-7, 2e-7 - ((ROW - 60) ** 2 + (COLUMN - 90) ** 2) * 1e-10),  # a sphere
        np.maximum(-1e-6, -((ROW - 60) ** 2 + (COLUMN % 96 - 48) ** 2) * 1e-9) / 3.0,  # all digits
        np.where(COLUMN > 90, 0.0, 1e-6) + waves_m(noise_m=2e-10),  # a step
        1e-9 * COLUMN + 2e-9 * ROW,
        np.zeros(SHAPE),
        np.full(SHAPE, np.nan),
        finer(waves_m()[:8, :8], 3, 1),  # too small to tell
    ],
)
def test_measured_points_are_all_points(height_m):
    assert found(height_m) == (1, 1)
