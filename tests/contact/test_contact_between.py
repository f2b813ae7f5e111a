"""Where a smooth map may touch between its pixels."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.contact.certificate import hertz_over_point_load, unmodelled_area_m2
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.models.interacting import interacting
from capslip.contact.solvers.detail import FORCE_SHARES, _loss_J
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.contact.solvers.refinement import touches_between
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap

PIXEL_M, RADIUS_M = 2e-4, 1.0


def pressed_beside(top_m, place):
    """Press a sphere of 20 m, with the top of a small one `top_m` over the plane beside it."""
    row, col = np.mgrid[0:60, 0:60]
    wide_m = -(PIXEL_M**2) * ((row - 40) ** 2 + (col - 40) ** 2) / (2 * 20.0)
    face = elastic_face(HeightMap(wide_m, (PIXEL_M, PIXEL_M)), 110e9)
    pressed = press(face, load_N=20.0)
    small_m = PIXEL_M**2 * ((row - place[0]) ** 2 + (col - place[1]) ** 2) / (2 * RADIUS_M) - top_m
    gap_m = np.where(np.hypot(row - place[0], col - place[1]) < 8, small_m, pressed.gap_m)
    return face, replace(pressed, gap_m=gap_m)


@pytest.mark.parametrize("place", [(12.5, 12.5), (12.4, 10.0), (-0.5, 20.0), (20.3, -0.4)])
def test_a_top_between_the_pixels_is_found_where_it_touches(place):
    found = np.argwhere(touches_between(*pressed_beside(0.2e-9, place)))
    assert len(found) >= 1
    assert (np.abs(found - place) <= 0.5).all()


@pytest.mark.parametrize("place", [(-0.5, 20.0), (20.3, -0.4), (59.4, 30.0), (30.2, 59.5)])
@pytest.mark.parametrize("top_m", [0.2e-9, -50e-9])
def test_the_edge_of_what_was_measured_is_the_edge_of_a_map(place, top_m):
    """Round parts lie in a rim of lost points: what lies there does not touch first."""
    face, pressed = pressed_beside(top_m, place)
    found = touches_between(face, pressed)
    assert found.any() == (top_m > 0)

    def rimmed(values, fill):
        return np.pad(values, ((2, 3), (1, 4)), constant_values=fill)

    around = elastic_face(HeightMap(rimmed(-face.depth_m, np.nan), (PIXEL_M, PIXEL_M)), 110e9)
    state = replace(
        pressed,
        gap_m=rimmed(pressed.gap_m, -1e-7),  # of nothing, less the approach
        pressure_Pa=rimmed(pressed.pressure_Pa, 0.0),
    )
    assert np.array_equal(touches_between(around, state), rimmed(found, False))


@pytest.mark.parametrize("place", [(12.5, 12.5), (12.0, 10.0), (-0.5, 20.0)])
def test_none_is_found_that_stays_far_from_touching(place):
    assert not touches_between(*pressed_beside(-50e-9, place)).any()


def area_m2(top_m, place, noise_m=0.0, load_N=20.0, lost=None):
    """Ask the same of a cap of 20 m, with such a top over the plane as it sinks there."""
    row, col = np.mgrid[0:60, 0:60]
    centre_m = 40.5 * PIXEL_M
    curve = interacting([20.0], [0.0], [centre_m], [centre_m], 110e9)
    approach_m = float(curve.approach_m(load_N))
    contact_m = np.sqrt(20.0 * approach_m)
    away_m = PIXEL_M * np.hypot(place[0] - 40, place[1] - 40)
    sunk_m = load_N / (np.pi * 110e9 * away_m) * hertz_over_point_load(contact_m / away_m)
    wide_m = -(PIXEL_M**2) * ((row - 40) ** 2 + (col - 40) ** 2) / (2 * 20.0)
    squares = PIXEL_M**2 * ((row - place[0]) ** 2 + (col - place[1]) ** 2)
    small_m = sunk_m - approach_m + top_m - squares / (2 * RADIUS_M)
    height_m = np.where(np.hypot(row - place[0], col - place[1]) < 8, small_m, wide_m)
    if lost is not None:
        height_m[lost] = np.nan
    surface = HeightMap(height_m, (PIXEL_M, PIXEL_M))
    hill = np.ones(surface.shape, dtype=int)
    return unmodelled_area_m2(surface, hill, curve, approach_m, 0.0, noise_m)


@pytest.mark.parametrize("place", [(12.5, 12.5), (12.4, 10.0), (-0.5, 20.0), (20.3, -0.4)])
def test_caps_are_not_all_that_touches_where_a_top_between_the_pixels_does(place):
    assert 1 <= round(area_m2(1e-9, place) / PIXEL_M**2) <= 4
    assert area_m2(-1e-9, place) == 0.0
    assert area_m2(1e-9, place, noise_m=1e-9) == 0.0  # which may be all of it


def test_a_top_beside_lost_points_is_not_known():
    assert area_m2(1e-9, (12.4, 10.0), lost=(12, 11)) == 0.0


def test_tops_between_pixels_are_not_asked_for_beside_wide_contacts(monkeypatch):
    place = (-0.5, 20.0)
    assert area_m2(1e-9, place) > 0.0
    assert area_m2(7e-9, place, load_N=500.0) == 0.0
    monkeypatch.setattr("capslip.contact.certificate.RESOLVED", 40.0)
    assert area_m2(7e-9, place, load_N=500.0) > 0.0


def test_a_sphere_alone_touches_nowhere_beside_its_contact():
    assert not touches_between(*pressed_beside(-1.0, (200.0, 200.0))).any()


@pytest.mark.parametrize("pixels", [4, 12])
def test_none_is_taken_from_a_spline_that_swings_about_a_pit(pixels):
    face, pressed = pressed_beside(0.2e-9, (20.3, 10.4))
    depth_m = face.depth_m.copy()
    depth_m[20, 10 + pixels] += 1e-6
    pitted = replace(face, depth_m=depth_m)
    assert touches_between(pitted, pressed).any() == (pixels > 10)


@pytest.mark.long
def test_a_hill_that_no_pixel_touches_loses_its_energy():
    """Against the waves on half of the pixel, at a tenth and a quarter of mu N."""
    scene = Scene((100, 150), (4e-4, 4e-4), seed=7, roughness_rms_m=2e-7, roughness_length_m=2e-3)
    lost_J = []
    for finer in (1, 2):
        curve = boundary_elements(synthetic_surface(scene, finer=finer)[0], 110e9, preload_N=300.0)
        curve = curve.at_forces(FORCE_SHARES) if finer > 1 else curve
        lost_J.append(_loss_J(curve.unloading(300.0))[:2])
    assert lost_J[0] == pytest.approx(lost_J[1], rel=0.02)  # 23 and 7 % less without that hill


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 12])
def test_a_hill_beside_the_foot_of_another_touches_between_its_pixels(seed):
    """Kinks where hills meet are a few pixels away: without that hill W is 17 to 60 % less."""
    rng = np.random.default_rng(seed)
    places_m, top_m = rng.uniform(2e-3, 18e-3, (2, 14, 1, 1)), rng.normal(0.0, 1.5e-8, (14, 1, 1))
    lost_J = []
    for finer in (1, 4):
        y_m, x_m = (np.mgrid[: 100 * finer, : 150 * finer] + 0.5) * 2e-4 / finer
        hills_m = top_m - ((x_m - 1.5 * places_m[0]) ** 2 + (y_m - places_m[1]) ** 2) / (2 * 2.0)
        surface = HeightMap(hills_m.max(axis=0), (2e-4 / finer, 2e-4 / finer))
        curve = boundary_elements(surface, 110e9, preload_N=4.0)
        curve = curve.at_forces(FORCE_SHARES) if finer > 1 else curve
        lost_J.append(_loss_J(curve.unloading(4.0))[:2])
    assert lost_J[0] == pytest.approx(lost_J[1], rel=0.04)


def approach_of_spheres(off_pixels, finer=1):
    """Press 16 spheres of 0.1 m so that a = 2 pixels, apexes off the nearest centre along both."""
    pixel_m, radius_m, E_star_Pa = 1e-4, 0.1, 110e9
    pixels = (np.arange(80 * finer) + 0.5) / finer - 0.5
    along_m = (pixels % 20 - 10 + off_pixels) * pixel_m
    height_m = -(along_m[:, None] ** 2 + along_m**2) / (2 * radius_m)
    curve = boundary_elements(HeightMap(height_m, (pixel_m / finer,) * 2), E_star_Pa)
    load_N = 16 * 4 * E_star_Pa * (2 * pixel_m) ** 3 / (3 * radius_m)
    return curve, load_N, float(curve.approach_m(load_N))


@pytest.mark.parametrize(("off_pixels", "noted"), [(0.5, True), (0.0, False)])
def test_a_face_that_stands_higher_between_its_pixels_is_noted_with_how_much(off_pixels, noted):
    """Apexes amid four pixels stand dx^2 / 4 R above them, a sixteenth of a^2 / R."""
    curve, load_N, approach_m = approach_of_spheres(off_pixels)
    _, _, true_m = approach_of_spheres(off_pixels, finer=5)
    said = [one for one in curve.problems(load_N) if one.code == "first_touch_decides"]
    assert [one.severity for one in said] == ["info"] * noted
    assert (approach_m < 0.96 * true_m) == noted
    higher_m = curve.unloading(load_N).approach_m - approach_m
    assert approach_m + higher_m == pytest.approx(true_m, rel=0.01)
    assert not noted or f"{higher_m:.2g} m higher" in said[0].message
