"""Patches around the contacts against the whole map, and refined maps against finer ones."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.ndimage import binary_dilation, gaussian_filter

from capslip.contact.map_accuracy import PIXELS_95
from capslip.contact.solvers import patches as patching
from capslip.contact.solvers import path as following
from capslip.contact.solvers import refinement as refining
from capslip.contact.solvers import unloading
from capslip.contact.solvers.closing import GivenLoad
from capslip.contact.solvers.half_space import (
    HalfSpace,
    even_spectrum,
    love_kernel,
    love_kernel_at,
    padded_shape,
)
from capslip.contact.solvers.metal import first_loading
from capslip.contact.solvers.patched_half_space import PatchedHalfSpace, node_counts
from capslip.contact.solvers.patches import patched
from capslip.contact.solvers.path import FINEST, Path
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.contact.solvers.refinement import refinement
from capslip.contact.solvers.unloading import unload
from capslip.surface.heightmap import HeightMap

E = 110e9
LOAD_N = 100.0


def waves(shape, smooth, seed=1, pixel_size_m=(1e-4, 1.2e-4), noise_m=0.0):
    rng = np.random.default_rng(seed)
    height_m = gaussian_filter(rng.standard_normal(shape), smooth)
    height_m *= 4e-7 / height_m.std()
    return HeightMap(height_m + noise_m * rng.standard_normal(shape), pixel_size_m)


def loss_J(found, shares):
    drop_N = np.array(shares) * found.load_N
    return np.interp(drop_N, found.load_drop_N, found.loss_J / found.load_drop_N**3) * drop_N**3


def withdrawal_m(found, shares):
    return np.interp(np.array(shares) * found.load_N, found.load_drop_N, found.withdrawal_m)


def test_kernel_at_any_distance_is_that_of_pixels_and_of_their_mean():
    sizes = (2.0, 1.0)
    kernel = love_kernel((300, 300), sizes, E)
    i, j = (np.array(at, dtype=float) for at in np.mgrid[0:300:7, 0:300:11])
    assert np.allclose(love_kernel_at((i, j), sizes, E), kernel[::7, ::11], rtol=1e-8, atol=0)
    # Between pixels: the mean of 1/r over a pixel, here by Gauss points.
    node, weight = np.polynomial.legendre.leggauss(12)
    for di, dj in ((3.3, 0.4), (0.7, 5.1), (40.2, 80.9)):
        y, x = di * 2.0 + node[:, None] * 1.0, dj + node * 0.5
        mean = float((weight[:, None] * weight / 4 / np.hypot(y, x)).sum()) * 2.0
        found = love_kernel_at((np.array([di]), np.array([dj])), sizes, E)[0]
        assert found == pytest.approx(mean / (np.pi * E), rel=1e-8)


@pytest.mark.parametrize("shape", [(1, 1), (2, 1), (1, 3), (3, 4)])
def test_a_spectrum_is_that_of_its_kernel_however_narrow_the_box(shape):
    quadrant, padded = np.random.default_rng(1).random(shape), padded_shape(shape)
    kernel = np.fft.irfft2(even_spectrum(quadrant, padded), padded)
    for i in range(1 - shape[0], shape[0]):
        for j in range(1 - shape[1], shape[1]):
            assert kernel[i, j] == pytest.approx(quadrant[abs(i), abs(j)], rel=1e-12)


@pytest.mark.parametrize(
    ("shape", "size_m"),
    [((220, 260), (1e-4, 1.2e-4)), ((30, 300), (8e-4, 1e-4)), ((960, 20), (1e-4, 16e-4))],
)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_sinking_on_patches_is_that_of_the_map(seed, shape, size_m):
    """However long the pixels; with distances in them, not in metres, up to 6e-4 off at 16 to 1."""
    rng = np.random.default_rng(seed)
    size_m, sides_m = np.array(size_m), np.multiply(shape, size_m)
    at_m = np.moveaxis(np.indices(shape), 0, 2) * size_m
    contact = np.zeros(shape, dtype=bool)
    for _ in range(8):
        centre_m, radius_m = rng.uniform(1e-3, sides_m - 1e-3), rng.uniform(1e-4, 14e-4)
        contact |= np.hypot(*np.moveaxis(at_m - centre_m, 2, 0)) < radius_m
    face = elastic_face(HeightMap(np.zeros(shape), tuple(size_m)), E)
    patches = patched(face, contact)
    pressure_Pa = np.where(contact, rng.random(shape), 0.0)
    expected_m = patches.gathered(face.half_space.sinking_m(pressure_Pa))
    found_m = patches.half_space.sinking_m(patches.gathered(pressure_Pa))
    assert np.abs(found_m / expected_m - 1).max() < 3e-7
    assert patches.half_space.count > 1
    # Symmetric, as a compliance is.
    other = rng.random(patches.shape)
    one = patches.gathered(pressure_Pa)
    assert one @ patches.half_space.sinking_m(other) == pytest.approx(other @ found_m, rel=1e-9)
    # Nothing is lost, nothing counts twice.
    assert np.array_equal(patches.spread(one), pressure_Pa)


@pytest.mark.parametrize("side", [(1, 1), (7, 4), (20, 31), (48, 30), (49, 30), (90, 64)])
def test_sinking_on_one_patch_is_the_sum_over_its_points(side):
    """By products of matrices where it is small, by transforms where not."""
    ny, nx = side
    boxes, sizes_m = np.array([[5, 3, 5 + ny, 3 + nx]]), (1e-4, 1.2e-4)
    patch = PatchedHalfSpace(boxes, node_counts(boxes, sizes_m), sizes_m, E)
    pressure_Pa = np.random.default_rng(1).random(side)
    kernel, (i, j) = love_kernel(side, sizes_m, E), np.indices(side)
    at = np.random.default_rng(2).integers((ny, nx), size=(5, 2))
    expected_m = [(kernel[np.abs(i - y), np.abs(j - x)] * pressure_Pa).sum() for y, x in at]
    found = [
        one(pressure_Pa.reshape(-1)).reshape(side)[tuple(at.T)]
        for one in (patch.sinking_m, patch.sinking_roughly_m)
    ]
    assert found[0] == pytest.approx(expected_m, rel=1e-12)
    assert found[1] == pytest.approx(expected_m, rel=1e-5)


def test_places_of_the_points_are_those_of_the_map():
    face = elastic_face(waves((90, 70), 5.0), E)
    contact = press(face, load_N=20.0).pressure_Pa > 0
    x_m, y_m = face.places_m
    everywhere = [np.broadcast_to(place, face.shape) for place in (x_m, y_m)]
    for k in (1, 3):
        patches = patched(face, contact, k)
        for found, place in zip(patches.places_m, everywhere, strict=True):
            mean = patches.spread(found)
            inside = mean > 0
            assert np.allclose(mean[inside], place[inside])


@pytest.mark.parametrize("noise_m", [0.0, 4e-9])
def test_slip_on_patches_is_that_of_the_map(noise_m, monkeypatch):
    face = elastic_face(waves((200, 240), 14.0, noise_m=noise_m), E)
    monkeypatch.setattr(refining, "WIDE_ENOUGH", 0.0)
    pressed = press(face, load_N=LOAD_N)
    sinking, on_map = HalfSpace.sinking_m, []

    def counted(self, pressure_Pa):
        on_map.append(pressure_Pa.size)
        return sinking(self, pressure_Pa)

    monkeypatch.setattr(HalfSpace, "sinking_m", counted)
    found = unload(face, pressed, 1e-7)
    assert len(on_map) == 1  # what the whole map says at the end
    assert 0 < found.patch_error < 1e-6
    expected = unload(face, pressed, 1e-7, on_patches=False)
    shares = (0.05, 0.1, 0.25, 0.5, 0.75, 0.95)
    assert np.allclose(loss_J(found, shares), loss_J(expected, shares), rtol=1e-3)
    assert np.allclose(withdrawal_m(found, shares), withdrawal_m(expected, shares), rtol=1e-4)
    assert found.stiffness_N_per_m == pytest.approx(expected.stiffness_N_per_m, rel=1e-6)
    assert np.allclose(found.region_lift_off_m, expected.region_lift_off_m, rtol=0.02, atol=1e-10)


def test_patches_that_leave_out_too_much_are_noticed(monkeypatch):
    face = elastic_face(waves((100, 100), 8.0), E)
    pressed = press(face, load_N=LOAD_N)
    monkeypatch.setattr(refining, "WIDE_ENOUGH", 0.0)
    monkeypatch.setattr(unloading, "PATCH_ERROR", 0.0)
    found = unload(face, pressed, 1e-7)
    assert found.patch_error == 0.0  # the map itself was solved
    expected = unload(face, pressed, 1e-7, on_patches=False)
    assert np.array_equal(found.loss_J, expected.loss_J)


def test_patches_whose_error_is_no_number_leave_out_too_much(monkeypatch):
    face = elastic_face(waves((100, 100), 8.0), E)
    pressed = press(face, load_N=LOAD_N)
    known = unloading.Path.patch_error
    monkeypatch.setattr(
        unloading.Path, "patch_error", lambda path: np.nan if path.patches else known(path)
    )
    found = unload(face, pressed, 1e-7)
    assert found.patch_error == 0.0  # the map itself was solved
    assert np.isfinite(found.loss_J).all()


def test_contact_all_over_the_map_needs_no_patches():
    face = elastic_face(waves((60, 60), 8.0), E)
    assert patched(face, np.ones(face.shape, dtype=bool)) is None


def test_refined_hertz_contact_slips_as_the_closed_form():
    # Twelve pixels across, where the pixels themselves leave 5 to 25 % in the energy.
    from capslip.contact.models.caps import caps

    contact_m, radius_m = 2e-3, 20.0
    dx = contact_m / 6
    y, x = (np.arange(-12, 13) + 0.21)[:, None] * dx, (np.arange(-12, 13) - 0.37) * dx
    face = elastic_face(HeightMap(-(x**2 + y**2) / (2 * radius_m), (dx, dx)), E)
    load_N = 4 / 3 * E * contact_m**3 / radius_m
    pressed = press(face, load_N=load_N)
    assert refinement(face, pressed) == 7
    found = unload(face, pressed, 1e-7)
    assert found.refinement >= 6
    hertz = caps([radius_m], [0.0], E)
    shares = np.array([0.1, 0.25, 0.5, 0.75])
    expected_J = hertz.loss_integral_at_drop_J(contact_m**2 / radius_m, shares * load_N)
    assert np.allclose(loss_J(found, shares), expected_J, rtol=0.02)
    coarse = unload(face, pressed, 1e-7, on_patches=False)
    assert abs(loss_J(coarse, [0.1])[0] / expected_J[0] - 1) > 0.02


def test_gaps_left_under_the_preload_are_heights_so_that_its_state_is_exact(monkeypatch):
    """And as close a state tells nothing more, in twice the iterations."""
    face = elastic_face(waves((100, 120), 8.0), E)
    pressed, shares = press(face, load_N=LOAD_N), (0.03, 0.1, 0.25, 0.5, 0.75)
    found = Path(face, pressed, 1e-7, True)
    monkeypatch.setattr(following, "_OFF", FINEST)
    monkeypatch.setattr(following, "_ROUGHLY", 1e-7)  # of the punch
    closer = Path(face, pressed, 1e-7, True)
    assert found.patches.refinement > 1
    p = found.pressed.pressure_Pa
    gap_m = found.face.half_space.sinking_m(p) + found.face.depth_m - found.pressed.approach_m
    assert np.abs(gap_m).max() < 1e-14 * found.pressed.approach_m
    iterations = [path.pressed.certificate.iterations for path in (found, closer)]
    assert iterations[0] < 0.8 * iterations[1]
    assert found.stiffness_N_per_m == pytest.approx(closer.stiffness_N_per_m, rel=1e-4)
    for share in shares:
        one, other = found.at(share), closer.at(share)
        assert one.withdrawal_m == pytest.approx(other.withdrawal_m, rel=1e-5)
        assert one.region_loss_J.sum() == pytest.approx(other.region_loss_J.sum(), rel=2e-4)


@pytest.mark.long
@pytest.mark.parametrize(
    ("most", "largest", "ratio"),
    [(1, 0.5, 1.0), (6, 0.03, 1.0), (1, 0.5, 16.0), (6, 0.03, 1 / 8)],
)
def test_what_pixels_leave_at_small_slip_is_stated(most, largest, ratio, monkeypatch):
    """Spheres of 24 pixels across of any sides, wherever their apex lies between the pixels."""
    from capslip.contact.models.caps import caps

    monkeypatch.setattr(refining, "_MOST_REFINED", most)
    contact_m, radius_m = 2e-3, 20.0
    dy, dx = sides_m = contact_m / 12 * np.sqrt((ratio, 1 / ratio))
    load_N = 4 / 3 * E * contact_m**3 / radius_m
    hertz = caps([radius_m], [0.0], E)
    shares = np.array([0.1, 0.25, 0.5])
    expected_J = hertz.loss_integral_at_drop_J(contact_m**2 / radius_m, shares * load_N)
    within = np.zeros(3)
    for y0, x0 in np.random.default_rng(3).uniform(-0.5, 0.5, (8, 2)):
        at_y, at_x = (np.arange(-n, n + 1) for n in (3 + contact_m // sides_m).astype(int))
        y, x = (at_y + y0)[:, None] * dy, (at_x + x0) * dx
        face = elastic_face(HeightMap(-(x**2 + y**2) / (2 * radius_m), (dy, dx)), E)
        found = unload(face, press(face, load_N=load_N), 1e-7)
        off = np.abs(loss_J(found, shares) / expected_J - 1)
        left = [PIXELS_95[share] * found.pixel_error(share * load_N) for share in shares.tolist()]
        within += off <= np.maximum(left, found.loss_error)
        assert left[0] < largest * max(ratio, 1 / ratio)
        assert np.all(np.diff(left) < 0.0)
    assert np.all(within >= 7)


@pytest.mark.parametrize("seed", [1, 2])
def test_coarse_smooth_map_slips_as_the_fine_one(seed):
    fine = waves((400, 480), 32.0, seed, (5e-5, 6e-5))
    height_m = fine.height_m
    middle_m = height_m[1::4, 1::4] + height_m[2::4, 1::4] + height_m[1::4, 2::4]
    coarse = HeightMap((middle_m + height_m[2::4, 2::4]) / 4, (2e-4, 2.4e-4))
    shares, found = (0.1, 0.25, 0.5, 0.75), []
    for surface in (fine, coarse):
        face = elastic_face(surface, E)
        pressed = press(face, load_N=LOAD_N)
        one = unload(face, pressed, 1e-7)
        # All that is solved is told in the approach of the map.
        assert one.solved_approach_m[-1] == pressed.approach_m
        found.append(one)
    assert found[0].refinement == 1 < found[1].refinement
    assert np.allclose(loss_J(found[1], shares), loss_J(found[0], shares), rtol=0.02)


@pytest.mark.parametrize(
    ("ratio", "points"), [(1.0, 6), (1.0 + 1e-9, 6), (2.0 - 1e-9, 3), (2.0, 3), (2.5, 3), (8.0, 1)]
)
def test_points_of_a_refined_map_are_no_longer_along_the_shorter_side_of_its_pixels(ratio, points):
    contact = np.zeros((40, 50), dtype=bool)
    contact[10:20, 5:30] = True
    for size_m, per_pixel in (
        ((1e-4 * ratio, 1e-4), (6, points)),
        ((1e-4, 1e-4 * ratio), (points, 6)),
    ):
        patches = patched(elastic_face(HeightMap(np.zeros((40, 50)), size_m), E), contact, 6)
        assert patches.per_pixel == per_pixel
        assert patches.refinement == 6
        assert np.multiply(patches.pixel_size_m, per_pixel) == pytest.approx(size_m, abs=0.0)
        values = np.random.default_rng(1).random((40, 50))
        inside = patches.spread(np.ones(patches.shape)) > 0
        assert np.allclose(patches.spread(patches.gathered(values)), np.where(inside, values, 0.0))


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("cap", [False, True])
@pytest.mark.parametrize("ratio", [4, 8, 16])
def test_a_sphere_of_long_pixels_slips_as_theory_has_it(ratio, cap, axis):
    """Contacts of 19, 9 and 5 lines; caps end two or more beside them, above a floor.

    With as many points along both sides, or none, W at a quarter of mu N is up to 13 % off.
    """
    radius_m, dx_m, load_N, shares = 20.0, 1e-4, 400.0, np.array([0.25, 0.5, 0.75])
    a_m = (3 * load_N * radius_m / (4 * E)) ** (1 / 3)
    lines = 6 * a_m / (ratio * dx_m)
    y_m = (np.arange(int(lines)) - 0.5 * lines + 0.3) * ratio * dx_m
    x_m = (np.arange(6 * int(a_m / dx_m)) - 3 * a_m / dx_m + 0.2) * dx_m
    height_m = -(y_m[:, None] ** 2 + x_m**2) / (2 * radius_m)
    if cap:
        height_m = np.maximum(height_m, -1.6 * a_m**2 / radius_m)
    size_m = (ratio * dx_m, dx_m)
    if axis == 1:
        height_m, size_m = height_m.T, size_m[::-1]
    face = elastic_face(HeightMap(height_m, size_m), E)
    found = unload(face, press(face, load_N=load_N), 1e-8)
    d_m, left = a_m**2 / radius_m, (1 - shares) ** (2 / 3)
    known_J = 8 * load_N * d_m * (0.6 * (1 - left**2.5) - shares * (1 + left) / 2)
    assert np.abs(loss_J(found, shares) / known_J - 1).max() < (0.03 if ratio == 16 else 0.005)


def test_noisy_maps_are_not_refined():
    face = elastic_face(waves((100, 120), 6.0, noise_m=3e-8), E)
    pressed = press(face, load_N=LOAD_N)
    assert pressed.pixels_across < 35
    assert refinement(face, pressed) == 1


def test_a_patched_face_is_pressed_to_the_same_state():
    face = elastic_face(waves((150, 160), 10.0), E)
    pressed = press(face, load_N=LOAD_N, tolerance=1e-9)
    patches = patched(face, pressed.pressure_Pa > 0)
    again = press(
        patches, load_N=LOAD_N, tolerance=1e-9, start_Pa=patches.gathered(pressed.pressure_Pa)
    )
    assert again.approach_m == pytest.approx(pressed.approach_m, rel=1e-7)
    assert np.allclose(
        patches.spread(again.pressure_Pa),
        pressed.pressure_Pa,
        atol=1e-4 * pressed.max_pressure_Pa,
    )
    assert GivenLoad(1.0).on_grid(patches.places_m, 4.0).total_Pa == 4.0


def test_refined_heights_go_on_to_the_edge_of_the_map():
    # A paraboloid that peaks at a corner: a cubic spline has it exactly, and beyond the last point.
    dy, dx = 2e-4, 3e-4
    y_m, x_m = (np.arange(40)[:, None] + 0.5) * dy, (np.arange(50) + 0.5) * dx
    face = elastic_face(HeightMap(-(y_m**2 + x_m**2) / 40, (dy, dx)), E)
    contact = np.zeros(face.shape, dtype=bool)
    contact[:6, :8] = contact[-5:, -7:] = True
    patches = patched(face, contact, 4)
    expected_m = (patches.places_m[0] ** 2 + patches.places_m[1] ** 2) / 40
    assert np.allclose(patches.depth_m, expected_m - expected_m.min(), rtol=0, atol=1e-15)


@pytest.mark.parametrize("axis", [0, 1])
def test_rough_heights_go_on_half_as_far_as_their_points(axis):
    """Further beyond the outermost ones the spline through these grooves rises by all of them."""
    line_m = 1e-7 * np.random.default_rng(2).standard_normal(40)
    height_m = np.broadcast_to(line_m, (30, 40)) if axis else np.tile(line_m[:, None], (1, 30))
    face = elastic_face(HeightMap(height_m, (1e-4, 1e-4)), E)
    contact = np.zeros(face.shape, dtype=bool)
    contact[:6, :6] = contact[-5:, -6:] = True
    patches = patched(face, contact, 2)
    place = patches.places_m[1 - axis] / 1e-4
    spline = make_interp_spline(np.arange(40), line_m)
    first_m, last_m = (patches.depth_m[np.isclose(place, at)] for at in (0.25, 39.75))
    apart_m = spline(39.125) - spline(-0.125)
    np.testing.assert_allclose(first_m - last_m[0], apart_m, rtol=1e-5)


def test_refined_heights_end_with_the_face_as_with_the_map():
    """Also where there is noise, of which what goes on beyond the last points would make more."""
    surface = waves((40, 50), 3.0, noise_m=2e-8)
    contact = np.zeros(surface.shape, dtype=bool)
    contact[:6, :8] = contact[-5:, -7:] = True
    frame = ((3, 6), (4, 2))
    around_m = np.pad(surface.height_m, frame, constant_values=np.nan)
    face, within = (
        elastic_face(one, E) for one in (surface, HeightMap(around_m, surface.pixel_size_m))
    )
    whole, part = patched(face, contact, 4), patched(within, np.pad(contact, frame), 4)
    row, column = np.divmod(whole.parent, 50)
    expected = {}
    for i, pixel in enumerate(zip(row + 3, column + 4, strict=True)):
        expected.setdefault(pixel, []).append(whole.depth_m[i])
    found = {}
    for i in np.flatnonzero(part.measured):
        found.setdefault(divmod(int(part.parent[i]), 56), []).append(part.depth_m[i])
    assert found.keys() == expected.keys()
    for pixel, depths_m in expected.items():
        assert sorted(found[pixel]) == pytest.approx(sorted(depths_m), abs=1e-16)


@pytest.mark.parametrize(
    ("pixels", "depth_m", "refined"), [(8, 1e-4, False), (30, 1e-4, True), (8, 1e-8, True)]
)
def test_no_spline_swings_into_a_contact_from_a_pit_beside_it(pixels, depth_m, refined):
    y, x = np.mgrid[-48:48, -48:48] * 1e-4
    height_m = -(x**2 + y**2) / (2 * 20.0)
    plain = press(elastic_face(HeightMap(height_m, (1e-4, 1e-4)), 110e9), load_N=5.0)
    edge = 48 + np.flatnonzero(plain.pressure_Pa[48, 48:]).max()
    height_m = height_m.copy()
    height_m[48, edge + pixels] -= depth_m
    face = elastic_face(HeightMap(height_m, (1e-4, 1e-4)), 110e9)
    pressed = press(face, load_N=5.0)
    assert (refinement(face, pressed) > 1) == refined
    stiffness = unload(face, pressed, 1e-8).stiffness_N_per_m
    assert stiffness == pytest.approx(1.5 * 5.0 / pressed.approach_m, rel=0.03)


def test_contacts_too_wide_for_the_finest_spline_are_refined_as_far_as_there_is_room(monkeypatch):
    face = elastic_face(waves((100, 100), 8.0), E)
    pressed = press(face, load_N=LOAD_N)
    finest = refining.refinement(face, pressed)
    assert finest > 2
    n_points = patched(face, pressed.pressure_Pa > 0).depth_m.size
    monkeypatch.setattr(patching, "_MOST_POINTS", 5 * n_points)
    found = unload(face, pressed, 1e-7)
    assert 1 < found.refinement < finest


def test_a_refined_contact_along_the_edge_of_the_map_is_followed_to_its_end(monkeypatch):
    """The outermost row bears a tail that its pixels have shorter than their parts: W 5 % off."""
    y, x = (np.arange(60)[:, None] + 0.5) * 5e-5, (np.arange(480) + 0.5) * 5e-5
    apex_beyond_a_corner = HeightMap(
        -((x - 26e-3) ** 2) / 4e3 - (y + 4e-4) ** 2 / 8.0, (5e-5, 5e-5)
    )
    face = elastic_face(apex_beyond_a_corner, E)
    pressed = press(face, load_N=20.0)
    found = Path(face, pressed, 1e-7, on_patches=True)
    monkeypatch.setattr(patching, "_MARGIN", 60)
    whole = Path(face, pressed, 1e-7, on_patches=True)
    assert found.patches.refinement == whole.patches.refinement > 1
    assert len(found.patches.parent) < 0.8 * len(whole.patches.parent)
    assert found.n_points == whole.n_points
    of_both_J = [float(path.at(0.1).region_loss_J.sum()) for path in (found, whole)]
    assert of_both_J[0] == pytest.approx(of_both_J[1], rel=1e-6)


def test_a_contact_in_the_outermost_rows_alone_is_refined_and_slips_as_on_finer_pixels():
    """One axis alone knows how smooth the face is there; W at 0.25 mu N 9 % off without."""
    found = []
    for n, size_m in ((1, 1e-4), (4, 2.5e-5)):
        y, x = (np.arange(30 * n)[:, None] + 0.5) * size_m, (np.arange(240 * n) + 0.5) * size_m
        height_m = -((x - 26e-3) ** 2) / 4e3 - (y + 4e-4) ** 2 / 8.0
        face = elastic_face(HeightMap(height_m, (size_m, size_m)), E)
        pressed = press(face, load_N=5.0)
        found.append(Path(face, pressed, 1e-7, on_patches=True))
    assert not found[0].map_pressed.pressure_Pa[2:].any()
    assert found[0].patches.refinement > 1
    assert found[0].stiffness_N_per_m == pytest.approx(found[1].stiffness_N_per_m, rel=2e-3)
    of_both_J = [float(path.at(0.25).region_loss_J.sum()) for path in found]
    assert of_both_J[0] == pytest.approx(of_both_J[1], rel=0.01)


@pytest.mark.parametrize("shape", [(30, 40), (3, 40), (2, 9), (9, 1)])
def test_what_was_lost_goes_on_as_what_is_beside_it(shape):
    rng = np.random.default_rng(4)
    y, x = np.indices(shape)
    plane_m = 1e-6 + 3e-8 * x - 2e-8 * y
    measured = rng.random(shape) < 0.8
    measured[0, 0], measured[10:16, 20:25] = True, False
    if min(shape) > 2:
        filled_m = patching._filled(np.where(measured, plane_m, 0.0), measured)
        assert np.abs(filled_m - plane_m).max() < 1e-11
    smooth_m = 1e-7 * gaussian_filter(rng.standard_normal(shape), 5.0)
    lost_m = np.where(measured, smooth_m, 1.0)
    filled_m = patching._filled(lost_m, measured)
    assert np.array_equal(filled_m[measured], smooth_m[measured])
    assert np.abs(filled_m).max() < 3.0 * np.abs(smooth_m).max()
    mirrored_m = patching._filled(lost_m[::-1, ::-1], measured[::-1, ::-1])[::-1, ::-1]
    np.testing.assert_allclose(mirrored_m, filled_m, rtol=0.0, atol=1e-9 * np.ptp(smooth_m))


def test_far_from_all_that_is_known_the_nearest_stands_for_what_was_lost():
    measured = np.zeros((5, 40), dtype=bool)
    measured[:, :3] = True
    filled_m = patching._filled(np.where(measured, np.arange(40.0), np.nan), measured)
    assert np.allclose(filled_m[:, 3:11], np.arange(3.0, 11.0), rtol=1e-3)
    assert (filled_m[:, 11:] == 2.0).all()


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 5])
def test_points_that_were_lost_beside_contacts_hardly_move_the_slip(seed):
    """A map with them was not refined: its energies were off by 1 to 33 %."""
    whole, load_N = waves((60, 70), smooth=5.0, seed=seed), 20.0
    touches = press(elastic_face(whole, E), load_N=load_N).pressure_Pa > 0
    lost = np.random.default_rng(seed).random(whole.shape) < 0.1
    lost &= ~binary_dilation(touches, np.ones((3, 3)))
    energies = []
    for height_m in (whole.height_m, np.where(lost, np.nan, whole.height_m)):
        for way in (1, -1):
            face = elastic_face(HeightMap(height_m[:, ::way].copy(), whole.pixel_size_m), E)
            state = press(face, load_N=load_N, tolerance=1e-9)
            assert refinement(face, state) >= 6
            energies.append(loss_J(unload(face, state, 1e-7), (0.25, 0.5, 0.75)))
    there, back, of_lost, of_lost_back = energies
    np.testing.assert_allclose(back, there, rtol=1e-3)
    np.testing.assert_allclose(of_lost_back, of_lost, rtol=1e-3)
    np.testing.assert_allclose(of_lost, there, rtol=5e-3)


@pytest.mark.parametrize("seed", [1, 11])
def test_single_points_that_were_lost_in_contacts_are_known_to_a_smooth_face(seed):
    """As holes that bear nothing they moved the energy at a quarter by up to 27 %."""
    whole, load_N = waves((60, 70), smooth=5.0, seed=seed), 20.0
    lost = np.random.default_rng(seed).random(whole.shape) < 0.02
    energies, stiffness = [], []
    for height_m in (whole.height_m, np.where(lost, np.nan, whole.height_m)):
        face = elastic_face(HeightMap(height_m, whole.pixel_size_m), E)
        found = unload(face, press(face, load_N=load_N, tolerance=1e-9), 1e-7)
        assert found.refinement >= 6
        energies.append(loss_J(found, (0.25, 0.5, 0.75)))
        stiffness.append(found.stiffness_N_per_m)
    np.testing.assert_allclose(energies[1], energies[0], rtol=0.01)
    assert stiffness[1] == pytest.approx(stiffness[0], rel=1e-3)


def test_points_lie_between_others_where_no_wider_hole_is():
    measured = np.ones((9, 11), dtype=bool)
    single = [(4, 2), (2, 6), (2, 7), (2, 8), (6, 4)]  # a point, a line, and one beside a hole
    for y, x in single:
        measured[y, x] = False
    measured[6:8, 5:8] = False
    measured[:, 10] = False  # an edge has others on one side alone
    assert [tuple(one) for one in np.argwhere(patching._lost_singly(measured))] == sorted(single)


@pytest.mark.long
def test_between_refined_patches_fewer_nodes_tell_the_same_slip(monkeypatch):
    """What each contact does to the others is smooth, and hardly goes as the load does."""
    face = replace(elastic_face(waves((200, 240), 5, seed=4), 115e9), hardness_Pa=1e8)
    face, pressed = first_loading(face, press(face, load_N=60.0, tolerance=1e-8))
    assert face.yielded
    found = []
    monkeypatch.setattr(patching, "_MOST_NODES", 0)
    monkeypatch.setattr(patching, "_MOST_ROUGHLY", 100_000)
    for error in (patching._ROUGHLY, patching.KERNEL_ERROR):
        monkeypatch.setattr(patching, "_ROUGHLY", error)
        path = Path(face, pressed, 1e-8, True)
        assert path.patches is not None
        assert path.patches.refinement > 1
        loss_J = [path.at(share).region_loss_J.sum() for share in (0.1, 0.25, 0.75)]
        found.append((path.patches.half_space.n_nodes, path.stiffness_N_per_m, *loss_J))
    (few, *slips), (many, *exact) = found
    assert few < 0.5 * many
    assert path.patches.half_space.count > 2
    assert slips == pytest.approx(exact, rel=1e-3)
    assert slips[0] == pytest.approx(exact[0], rel=3e-5)
