"""Heights at the points of another grid: a spline keeps crests, and makes none beside steps."""

import numpy as np
import pytest
from scipy import ndimage

from capslip.surface.heightmap import HeightMap
from capslip.surface.laying import on_more_points, smooth_between, straight_between
from capslip.surface.mating import composite_surface, place
from capslip.surface.noise import noise_left

D_M = 2e-5
SHAPE = (150, 200)
ALONG, ACROSS = np.array([0.3, 0.5]), np.eye(2)


def waves_m(x_m, y_m):
    """Waves of 7.5 to 25 pixels, rms 1e-6."""
    rng = np.random.default_rng(1)
    z_m = np.zeros(np.broadcast(x_m, y_m).shape)
    for length_m in np.geomspace(7.5 * D_M, 25 * D_M, 12):
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        along_m = x_m * np.cos(angle) + y_m * np.sin(angle)
        z_m += np.cos(2 * np.pi * along_m / length_m + phase)
    return 1e-6 * z_m / np.sqrt(6.0)


def face_of(height_m, shape, pixel_m):
    """Return a face whose frame has its origin in the middle."""
    y_m, x_m = ((np.arange(n) + 0.5 - n / 2) * pixel_m for n in shape)
    return HeightMap(height_m(x_m[None, :], y_m[:, None]), (pixel_m, pixel_m))


@pytest.mark.parametrize(
    ("offset_m", "rotation_rad", "pixel"),
    [
        ((0.3 * D_M, 0.3 * D_M), 0.0, 1.0),
        ((5e-5, -8e-5), np.radians(30.0), 1.0),
        ((0.0, 0.0), 0.0, 1.3),
        ((0.0, 0.0), 0.0, 2.0),
        ((0.0, 0.0), 0.0, 2.5),
    ],
)
def test_a_second_face_keeps_its_crests_between_its_points(offset_m, rotation_rad, pixel):
    """Straight lines took 5 to 13 % of the rms of these waves, a cubic one up to 2.6 %."""
    first = HeightMap(np.zeros(SHAPE), (D_M, D_M))
    second = face_of(waves_m, [round(1.6 * n / pixel) for n in SHAPE], pixel * D_M)
    laid = place(first, second, offset_m=offset_m, rotation_rad=rotation_rad)
    both = composite_surface(first, second, laid)
    cosine, sine = np.cos(rotation_rad), np.sin(rotation_rad)

    def true_m(x_m, y_m):
        x_m, y_m = x_m - offset_m[1], y_m - offset_m[0]
        return waves_m(-(cosine * x_m + sine * y_m), cosine * y_m - sine * x_m)

    expected = composite_surface(
        face_of(true_m, SHAPE, D_M), first, place(first, first)
    )  # levelled alike
    error_m = (both.height_m - expected.height_m)[4:-4, 4:-4]
    assert error_m.std() < {2.0: 0.002, 2.5: 0.01}.get(pixel, 0.0005) * 1e-6


def test_a_spline_goes_through_the_points_as_that_of_scipy_in_all_blocks():
    z = np.random.default_rng(0).standard_normal((400, 500))
    turn = np.array([[0.9, 0.3], [-0.3, 0.9]])
    found = smooth_between(z, turn, np.array([20.3, 140.1]), (400, 500))
    expected = ndimage.affine_transform(z, turn, (20.3, 140.1), order=5, cval=np.nan)
    inside = ndimage.affine_transform(np.pad(np.ones((360, 460)), 20), turn, (20.3, 140.1), order=1)
    there = inside == 1.0
    assert there.sum() > 1e5
    np.testing.assert_allclose(found[there], expected[there], atol=1e-5)
    quarter = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([0.0, 499.0]), (500, 400)
    np.testing.assert_array_equal(smooth_between(z, *quarter), z[:, ::-1].T)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_beside_a_step_no_edge_is_raised(axis, noise):
    """A spline overshoots by a tenth of the step, on which a face would bear."""
    z = np.zeros((60, 60))
    z[:, 30:] = -1.0
    z = (z if axis == 1 else z.T) + noise * np.random.default_rng(2).standard_normal((60, 60))
    found = smooth_between(z, ACROSS, ALONG, z.shape)
    free = ndimage.affine_transform(z, ACROSS, ALONG, mode="nearest")
    assert free.max() > 0.06
    assert np.nanmax(found) < 1e-12 + 8.0 * noise
    assert np.nanmin(found) > -1.0 - 1e-12 - 8.0 * noise


def test_beside_a_pit_nothing_stands_up_and_a_spike_keeps_what_it_had():
    z = np.zeros((40, 60))
    z[20, 30] = -1.0
    for sign in (1.0, -1.0):
        found = sign * smooth_between(sign * z, ACROSS, ALONG, z.shape)
        assert np.nanmax(found) < 1e-12
        assert np.nanmin(found) == pytest.approx(-0.7 * 0.5, abs=1e-9)  # as of the straight line
    free = ndimage.affine_transform(z, ACROSS, ALONG, mode="nearest")
    assert free.max() > 0.05


def test_points_that_are_not_measured_take_no_others_along():
    rng = np.random.default_rng(3)
    z = 1e6 * face_of(waves_m, SHAPE, D_M).height_m
    z[rng.random(SHAPE) < 0.05] = np.nan
    z[40:70, 50:90] = np.nan
    z[:, :7] = np.nan
    found = smooth_between(z, ACROSS, ALONG, SHAPE)
    straight = straight_between(z, ACROSS, ALONG, SHAPE)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(straight))
    y_m, x_m = ((np.arange(n) + 0.5 - n / 2 + at) * D_M for n, at in zip(SHAPE, ALONG, strict=True))
    true = 1e6 * waves_m(x_m[None, :], y_m[:, None])
    error, of_line = (one[4:-4, 12:-4] - true[4:-4, 12:-4] for one in (found, straight))
    assert np.nanstd(error) < 0.4 * np.nanstd(of_line)


def test_half_a_pixel_beyond_the_outermost_points_a_plane_goes_on():
    z = 1.0 + np.arange(12.0)[:, None] * np.ones(9)
    found = smooth_between(z, np.eye(2) * 0.5, np.array([-0.25, -0.25]), (24, 18))
    plane = 0.75 + 0.5 * np.arange(24.0)[:, None] * np.ones(18)
    np.testing.assert_allclose(found, plane, atol=1e-6)
    aside = smooth_between(z, ACROSS, np.array([0.7, 0.0]), (12, 9))
    np.testing.assert_array_equal(np.isnan(aside[:, 4]), [False] * 11 + [True])


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("lost", [False, True])
def test_waves_go_on_to_the_edge_of_a_map_and_of_its_holes(lost, turned):
    """As high as the outermost points they were up to a fifth of their rms off, for four lines."""
    points = 300, 400
    z = 1e6 * face_of(waves_m, SHAPE, D_M).height_m
    true = 1e6 * face_of(waves_m, points, 0.5 * D_M).height_m
    if lost:
        z[60:90, 80:120] = np.nan
    if turned:
        z, true, points = z.T, true.T, points[::-1]
    found = smooth_between(z, 0.5 * ACROSS, np.array([-0.25, -0.25]), points)
    found, true = (one.T if turned else one for one in (found, true))
    edges = (found - true)[:8], (found - true)[-8:], (found - true)[:, :8], (found - true)[:, -8:]
    assert max(np.sqrt(np.mean(one**2)) for one in edges) < 0.002
    if lost:
        around = (found - true)[112:188, 152:248]
        assert np.isnan(around[8:-8, 8:-8]).all()
        assert np.sqrt(np.nanmean(around**2)) < 0.005


def test_what_is_rough_and_what_a_pit_or_a_step_ends_goes_on_nowhere():
    """A line through two such points would rise beyond the edge, and the face would bear there."""
    rng = np.random.default_rng(24700)
    noise = rng.standard_normal(SHAPE)
    found = smooth_between(noise, 0.5 * ACROSS, np.array([-0.25, -0.25]), (300, 400))
    assert found[0].std() < 1.05 * noise[0].std()
    z = 1e6 * face_of(waves_m, SHAPE, D_M).height_m
    z[1, 20] -= 30.0
    z[:2, 60] -= 30.0
    z[:3, 90:110] += 30.0
    straight = straight_between(z, 0.5 * ACROSS, np.array([-0.25, -0.25]), (300, 400))
    found = smooth_between(z, 0.5 * ACROSS, np.array([-0.25, -0.25]), (300, 400))
    assert (found - straight)[:1].max() < 0.3


def test_a_map_of_few_points_is_laid():
    z = np.random.default_rng(24701).standard_normal((3, 4))
    found = smooth_between(z, 0.5 * ACROSS, np.array([-0.25, -0.25]), (6, 8))
    assert np.abs(found).max() < 2.0 * np.abs(z).max()


def test_a_face_on_more_points_has_its_waves_its_sides_and_the_noise_that_is_left():
    face, finer = (
        face_of(waves_m, n, size_m) for n, size_m in ((SHAPE, D_M), ((225, 300), D_M / 1.5))
    )
    found = on_more_points(face, (225, 300))
    assert found.side_m == pytest.approx(face.side_m, rel=1e-12)
    assert (found.height_m - finer.height_m)[6:-6, 6:-6].std() < 0.01e-6
    assert found.noise_m is None
    noise_m = 1e-9 * np.random.default_rng(4).standard_normal((400, 500))
    noisy = HeightMap(noise_m, (D_M, D_M), noise_m=1e-9)
    for shape in ((460, 1000), (400, 500)):
        found = on_more_points(noisy, shape)
        assert found.noise_m == pytest.approx(found.height_m.std(), rel=0.006)
    assert found is noisy


def test_noise_left_on_more_points_is_that_of_the_same_map_turned():
    """A third more rows, and the same number of columns: in each direction its own places."""
    height_m = np.random.default_rng(8).normal(0.0, 1e-8, (30, 44))
    rows = on_more_points(HeightMap(height_m, (2e-5, 1e-5), noise_m=1e-9), (40, 44))
    columns = on_more_points(HeightMap(height_m.T, (1e-5, 2e-5), noise_m=1e-9), (44, 40))
    assert rows.height_m == pytest.approx(columns.height_m.T, abs=1e-20)
    assert rows.noise_m == pytest.approx(columns.noise_m, rel=1e-12)
    places = np.arange(40)[:, None] * 0.75 - 0.125, np.arange(44.0)[None]
    left = noise_left(places, (0.0, 0.0))
    assert rows.noise_m == pytest.approx(1e-9 * left, rel=1e-12)
    assert 0.7 < left < 0.97
