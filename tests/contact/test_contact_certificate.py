"""Whether anything that was measured stands in the pressed plane."""

import math

import numpy as np
import pytest

from capslip.contact import certificate
from capslip.contact.certificate import certify_cut, hertz_over_point_load, unmodelled_area_m2
from capslip.contact.models.interacting import interacting
from capslip.surface.heightmap import HeightMap

E_STAR_PA = 109.89e9
PIXEL_M = (1e-4, 1e-4)
SHAPE = (400, 600)
RADIUS_M, LOAD_N = 25.0, 200.0
CONTACT_M = (0.015, 0.02)
A_M = float(np.cbrt(0.75 * LOAD_N * RADIUS_M / E_STAR_PA))  # 3.2 mm
COMPRESSION_M = A_M**2 / RADIUS_M


def axes():
    y, x = np.ogrid[0 : SHAPE[0], 0 : SHAPE[1]]
    return (x + 0.5) * PIXEL_M[1], (y + 0.5) * PIXEL_M[0]


def sphere(x_m, y_m, peak_m, radius_m=RADIUS_M):
    x, y = axes()
    return peak_m - ((x - x_m) ** 2 + (y - y_m) ** 2) / (2 * radius_m)


def certify(height_m, label, noise_m=0.0):
    caps_m = np.array([[CONTACT_M[0]], [CONTACT_M[1]], [RADIUS_M]])
    surface = HeightMap(height_m, PIXEL_M)
    load_N = np.array([LOAD_N])
    return certify_cut(surface, label, -COMPRESSION_M, caps_m, load_N, E_STAR_PA, noise_m)


def one_cap(floor_m=-2e-6):
    """Return a sphere that is pressed until the plane is its compression below its apex."""
    height_m = np.maximum(sphere(*CONTACT_M, 0.0), floor_m)
    return height_m, (height_m > -1e-6).astype(np.int32)


def sinking(r_m):
    """Johnson 3.42 at r > a, from its own closed form."""
    rho = A_M / r_m
    asin, root = math.asin(rho), math.sqrt(1 / rho**2 - 1)
    return COMPRESSION_M / math.pi * ((2 - 1 / rho**2) * asin + root)


def test_a_lone_sphere_certifies_itself():
    assert certify(*one_cap()) == 0.0


@pytest.mark.parametrize(("share", "holds"), [(1.0, True), (1.05, False)])
def test_another_peak_is_in_the_way_once_it_stands_above_the_sunk_surface(share, holds):
    """By more than the 2 % that point loads may be off; not where it is a hill of its own."""
    height_m, label = one_cap()
    peak_m = share * sinking(0.025) - COMPRESSION_M  # 25 mm away
    hill_m = sphere(0.04, 0.02, peak_m, 60.0)
    height_m = np.maximum(height_m, hill_m)
    excess_m = peak_m + COMPRESSION_M - 1.02 * sinking(0.025)
    area_m2 = certify(height_m, label)
    assert (area_m2 == 0.0) == holds
    assert holds or area_m2 == pytest.approx(2.0 * math.pi * 60.0 * excess_m, rel=0.5)
    label[hill_m > -1e-6] = 2
    assert certify(height_m, label) == 0.0


def test_noise_is_no_hill_and_lost_points_are_none_either():
    height_m, label = one_cap(floor_m=-COMPRESSION_M - 1e-9)
    rng = np.random.default_rng(0)
    noisy_m = height_m + 2e-8 * rng.standard_normal(SHAPE)
    assert certify(noisy_m, label, noise_m=2e-8) == 0.0
    lost_m = np.where(rng.random(SHAPE) < 0.1, np.nan, noisy_m)
    assert certify(lost_m, label, noise_m=2e-8) == 0.0
    lost_m = np.where(np.arange(SHAPE[1]) < 300, lost_m, np.nan)
    assert certify(lost_m, label, noise_m=2e-8) == 0.0


def areas_m2(height_m, label, x_m, y_m):
    """Return what stands outside the hills for both questions; places count from the middle."""
    surface = HeightMap(np.ascontiguousarray(height_m), PIXEL_M)
    middle_x_m, middle_y_m = surface.centre_m
    at_m = x_m + middle_x_m, y_m + middle_y_m
    radius_m, load_N = np.array([20.0, 25.0, 30.0]), np.array([1e-2, 2e-2, 3e-2])
    missed_m2 = certify_cut(surface, label, 3e-7, np.array([*at_m, radius_m]), load_N, E_STAR_PA)
    curve = interacting(radius_m, [0.0, 1e-9, 2e-9], *at_m, E_STAR_PA)
    approach_m = float(curve.approach_m(6e-2))
    return missed_m2, unmodelled_area_m2(surface, label, curve, approach_m, 1e-6, 0.0)


@pytest.mark.parametrize("shape", [(200, 246), (406, 512), (403, 512), (311, 352)])
def test_a_map_that_lies_another_way_is_as_high(shape):
    """Whether squares have a middle point or none, and whatever they leave over."""
    rng = np.random.default_rng(1)
    height_m = 1e-6 * rng.standard_normal(shape)
    label = (height_m + 1e-6 * rng.standard_normal(shape) > 1e-6).astype(np.int32)
    x_m, y_m = (rng.uniform(-0.5, 0.5, 3) * n * PIXEL_M[0] for n in shape[::-1])
    as_is_m2 = areas_m2(height_m, label, x_m, y_m)
    assert min(as_is_m2) > 0.0
    for turn, at_m in (
        (np.fliplr, (-x_m, y_m)),
        (np.flipud, (x_m, -y_m)),
        (np.transpose, (y_m, x_m)),
    ):
        assert areas_m2(turn(height_m), turn(label), *at_m) == pytest.approx(as_is_m2, rel=1e-9)


@pytest.mark.parametrize("rho", [0.005, 0.02, 0.029, 0.031, 0.1, 0.5, 1.0])
def test_a_contact_sinks_the_surface_as_johnson_has_it(rho):
    """The series of the arc sine, term by term, needs no difference of small numbers."""
    asin_terms = [math.comb(2 * k, k) / (4**k * (2 * k + 1)) for k in range(400)]
    root_terms = [math.comb(2 * k, k) / (4**k * (1 - 2 * k)) for k in range(400)]
    # 3 / (4 rho^3) [(2 rho^2 - 1) asin(rho) + rho sqrt(1 - rho^2)], powers of rho^2 from the first
    powers = [
        2.0 * asin_terms[k] - asin_terms[k + 1] + root_terms[k + 1] for k in range(399)
    ]  # that of rho is asin_0 - root_0 = 0
    exact = 0.75 * math.fsum(p * rho ** (2 * k) for k, p in enumerate(powers))
    within = 1e-3 if rho == 1.0 else 1e-9  # the series ends there as slowly as a root
    assert hertz_over_point_load(np.array([rho]))[0] == pytest.approx(exact, rel=within)


PARABOLOID = 6e-6, 4e-6  # pixel size (dy, dx)


def paraboloid(row, column, shape=(12, 17)):
    """Return a face that is as high as 1 um at a place in pixels, which may be off the map."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    return 1e-6 - 2e-8 * (y - row) ** 2 - 1e-8 * (x - column) ** 2


@pytest.mark.parametrize(("row", "column"), [(5.3, 8.4), (5.0, 7.0), (1.4, 15.3), (9.7, 1.2)])
def test_between_its_pixels_a_face_is_as_high_as_its_parabola(row, column):
    height_m = paraboloid(row, column)
    place_m, pixel_m, top_m = certificate._tops(HeightMap(height_m, PARABOLOID), -1.0)
    assert top_m == pytest.approx([1e-6], rel=1e-12)
    assert pixel_m == pytest.approx([height_m.max()], rel=1e-12)
    near = np.rint(row) + 0.5, np.rint(column) + 0.5
    assert place_m[::-1, 0] == pytest.approx(np.multiply(near, PARABOLOID), rel=1e-12)


@pytest.mark.parametrize(
    ("off_row", "off_column"), [(-3, 8.4), (14, 3.2), (5.3, -2), (4.1, 19), (-3, -2)]
)
def test_beyond_the_outermost_pixels_a_face_goes_on_to_the_edge_of_the_map(off_row, off_column):
    """Half a pixel, along the parabola through the last three."""
    height_m = paraboloid(off_row, off_column)
    _, pixel_m, top_m = certificate._tops(HeightMap(height_m, PARABOLOID), -1.0)
    around_m = np.pad(height_m, ((2, 0), (1, 3)), constant_values=np.nan)  # as the face ends there
    assert certificate._tops(HeightMap(around_m, PARABOLOID), -1.0)[2] == pytest.approx(top_m)
    at_edge = [
        np.clip(place, -0.5, n - 0.5)
        for place, n in zip((off_row, off_column), height_m.shape, strict=True)
    ]
    rest = at_edge[0] - off_row, at_edge[1] - off_column
    assert top_m == pytest.approx([1e-6 - 2e-8 * rest[0] ** 2 - 1e-8 * rest[1] ** 2], rel=1e-9)
    assert pixel_m == pytest.approx([height_m.max()], rel=1e-12)


def test_tops_are_as_high_as_is_asked_and_have_measured_neighbours():
    height_m = np.maximum(paraboloid(4.2, 3.1), paraboloid(7.3, 12.4) - 3e-7)
    face = HeightMap(height_m, PARABOLOID)
    assert sorted(certificate._tops(face, 0.0)[2]) == pytest.approx([7e-7, 1e-6], rel=1e-12)
    assert certificate._tops(face, 8e-7)[2] == pytest.approx([1e-6], rel=1e-12)
    height_m[4, 4] = np.nan
    assert certificate._tops(HeightMap(height_m, PARABOLOID), 0.0)[2] == pytest.approx([7e-7])
    level = HeightMap(np.zeros((5, 6)), PARABOLOID)  # as high as its neighbours, nowhere higher
    assert certificate._tops(level, -1.0)[2] == pytest.approx(np.zeros(30))
