"""The plane on which a face rests at vanishing load."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from capslip.caps.resting import resting_plane
from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap

PIXEL_M = (1e-4, 2e-4)


def waves(seed, shape=(121, 160)):
    scene = Scene(shape, PIXEL_M, seed=seed, waviness_rms_m=0.4e-6, waviness_length_m=2e-3)
    return synthetic_surface(scene)[0].height_m


def with_plane(height_m, slope_x, slope_y, pixel_size_m=PIXEL_M):
    ny, nx = height_m.shape
    y, x = np.ogrid[0:ny, 0:nx]
    plane_m = slope_x * (x + 0.5) * pixel_size_m[1] + slope_y * (y + 0.5) * pixel_size_m[0]
    return HeightMap(height_m + plane_m, pixel_size_m)


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_facet_of_the_convex_hull_over_the_load_point(seed):
    height_m = waves(seed)
    ny, nx = height_m.shape
    y_m, x_m = np.meshgrid(
        (np.arange(ny) + 0.5) * PIXEL_M[0], (np.arange(nx) + 0.5) * PIXEL_M[1], indexing="ij"
    )
    at_m = (0.4 * nx * PIXEL_M[1], 0.55 * ny * PIXEL_M[0])
    hull = ConvexHull(np.column_stack((x_m.ravel(), y_m.ravel(), 1e4 * height_m.ravel())))
    up = hull.equations[hull.equations[:, 2] > 1e-9]  # normal . point + offset <= 0
    over_m = -(up[:, 3] + up[:, :2] @ at_m) / up[:, 2] / 1e4
    facet = up[np.argmin(over_m)]
    plane = resting_plane(HeightMap(height_m, PIXEL_M), at_m, square=1)
    assert plane.height_m == pytest.approx(over_m.min(), rel=1e-9)
    assert np.array(plane.slope) == pytest.approx(-facet[:2] / facet[2] / 1e4, rel=1e-7)


@pytest.mark.long
@settings(deadline=None)  # of another load on the machine
@given(
    seed=st.integers(0, 5),
    slope_x=st.floats(-1e-3, 1e-3),
    slope_y=st.floats(-1e-3, 1e-3),
    square=st.sampled_from([1, 3, 5]),
)
def test_a_plane_added_to_the_map_is_added_to_it(seed, slope_x, slope_y, square):
    height_m = waves(seed)
    at_m = (0.012, 0.006)
    plain = resting_plane(HeightMap(height_m, PIXEL_M), at_m, square)
    tilted = resting_plane(with_plane(height_m, slope_x, slope_y), at_m, square)
    assert tilted.slope[0] - slope_x == pytest.approx(plain.slope[0], abs=1e-14)
    assert tilted.slope[1] - slope_y == pytest.approx(plain.slope[1], abs=1e-14)
    rise_m = slope_x * at_m[0] + slope_y * at_m[1]
    assert tilted.height_m - rise_m == pytest.approx(plain.height_m, abs=1e-16)


@pytest.mark.parametrize("shape", [(120, 160), (121, 161), (122, 162)])
def test_mirrored_and_transposed_maps_give_mirrored_and_transposed_planes(shape):
    height_m = waves(1, shape)
    plane = resting_plane(HeightMap(height_m, PIXEL_M))
    mirrored = resting_plane(HeightMap(height_m[:, ::-1].copy(), PIXEL_M))
    transposed = resting_plane(HeightMap(height_m.T.copy(), PIXEL_M[::-1]))
    assert mirrored.slope == pytest.approx((-plane.slope[0], plane.slope[1]), abs=1e-15)
    assert transposed.slope == pytest.approx(plane.slope[::-1], abs=1e-15)
    for other in (mirrored, transposed):
        assert other.height_m == pytest.approx(plane.height_m, abs=1e-18)


def test_it_lies_on_the_peaks_of_known_caps():
    scene = Scene((400, 600), (1e-4, 1e-4), families=(CapFamily("G", 6, 24.0),), tilt=(2e-5, -3e-5))
    surface, _ = synthetic_surface(scene)
    plane = resting_plane(surface)
    assert plane.slope == pytest.approx((-3e-5, 2e-5), abs=5e-9)  # 0.3 nm over the face


def test_no_spike_carries_the_face():
    height_m = waves(2)
    plane = resting_plane(HeightMap(height_m, PIXEL_M))
    spiked_m = height_m.copy()
    spiked_m[40, 70] += 1e-4
    spiked = resting_plane(HeightMap(spiked_m, PIXEL_M))
    assert np.array(spiked.slope) == pytest.approx(plane.slope, abs=1e-8)
    assert spiked.height_m == pytest.approx(plane.height_m, abs=1e-9)


def test_points_that_were_not_measured_hardly_move_it():
    height_m = waves(3)
    plane = resting_plane(HeightMap(height_m, PIXEL_M))
    lost_m = np.where(np.random.default_rng(0).random(height_m.shape) < 0.2, np.nan, height_m)
    lost = resting_plane(HeightMap(lost_m, PIXEL_M))
    assert lost.height_m == pytest.approx(plane.height_m, abs=2e-9)
    tilted = resting_plane(with_plane(lost_m, 1e-4, -2e-4))
    assert tilted.slope[0] - 1e-4 == pytest.approx(lost.slope[0], abs=1e-14)


def test_a_load_outside_the_measured_points_tips_it_over():
    height_m = waves(0).copy()
    height_m[:, 60:] = np.nan
    with pytest.raises(UnusableSurfaceError, match="tips over"):
        resting_plane(HeightMap(height_m, PIXEL_M), load_point_m=(1.6e-2, 6e-3))
    assert resting_plane(HeightMap(height_m, PIXEL_M)).load_point_m[0] == pytest.approx(6e-3)
    with pytest.raises(SettingsError, match="odd"):
        resting_plane(HeightMap(height_m, PIXEL_M), square=4)
