"""A face free to tilt under its load: balance, invariance under what a tilt must not feel."""

import json
import pathlib
from dataclasses import replace

import numpy as np
import pytest

from capslip.analysis import analyze_once
from capslip.contact.models.boundary_elements import RUNG, boundary_elements
from capslip.contact.slip import slip_curve
from capslip.contact.solvers import elastic_face as faces
from capslip.contact.solvers import polonsky_keer
from capslip.contact.solvers.detail import FORCE_SHARES, _loss_J
from capslip.contact.solvers.path import Path
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.contact.solvers.tilting import press_balanced
from capslip.errors import ContactError, SettingsError
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface

E = 110e9
PIXEL_M = (2.5e-4, 2e-4)
SHAPE = (80, 130)
LOAD_N = 100.0
REFERENCE = pathlib.Path(__file__).parents[2].parent / "shared" / "reference"


def waves(seed, smooth=5.0, non_measured=0.0):
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(seed)
    noise = gaussian_filter(rng.standard_normal(SHAPE), smooth)
    height_m = 4e-7 * noise / noise.std()
    height_m[rng.random(SHAPE) < non_measured] = np.nan
    return HeightMap(height_m, PIXEL_M)


def moments(face, pressed, point_m):
    """Moments about the load point over load times side, from the pressures alone."""
    p, (x_m, y_m) = pressed.pressure_Pa, face.places_m
    sides_m = SHAPE[1] * PIXEL_M[1], SHAPE[0] * PIXEL_M[0]
    return [
        float((p * (place - at)).sum() / p.sum()) / side
        for place, at, side in zip((x_m, y_m), point_m, sides_m, strict=True)
    ]


@pytest.mark.parametrize("point_m", [(13e-3, 10e-3), (6e-3, 14e-3), (25e-3, 1e-3)])
@pytest.mark.parametrize(("seed", "smooth", "non_measured"), [(1, 8.0, 0.0), (2, 1.0, 0.3)])
def test_balanced_and_in_contact_wherever_the_load_acts(seed, smooth, non_measured, point_m):
    face = elastic_face(waves(seed, smooth, non_measured), E)
    pressed = press_balanced(face, LOAD_N, point_m)
    assert np.abs(moments(face, pressed, point_m)).max() < 1e-9
    assert np.abs(pressed.certificate.moments).max() < 1e-9
    # The tilt held: the same state, without one more step.
    held = face.tilted(pressed.tilt_rad)
    again = press(held, load_N=LOAD_N, start_Pa=pressed.pressure_Pa)
    assert again.certificate.iterations == 0
    assert again.approach_m == pytest.approx(pressed.approach_m, rel=1e-9)
    # Contact with the tilted map, from a sinking computed here.
    p = pressed.pressure_Pa
    gap_m = held.half_space.sinking_m(p) + held.depth_m - pressed.approach_m
    assert gap_m[(p == 0) & held.measured].min() > -1e-7 * pressed.approach_m
    assert float((p * np.abs(gap_m)).sum() / p.sum()) < 1e-7 * pressed.approach_m


@pytest.mark.parametrize("seed", [4, 6])
def test_contacts_that_end_at_the_edge_lose_what_they_do_on_a_quarter_of_the_pixel(seed):
    """From a quarter of mu N on; 30 and 15 % less where a refined map keeps the tilt of its pixels.

    Its contacts reach half a pixel further, and would turn the face.
    """
    shape, sizes = (24, 200), {"roughness_rms_m": 4e-7, "roughness_length_m": 4e-3}
    scene, load_N, lost_J = Scene(shape, (4e-4, 4e-4), seed=seed, **sizes), 60.0, []
    for finer in (1, 4):
        surface = synthetic_surface(scene, finer=finer)[0]
        curve = boundary_elements(surface, E, preload_N=load_N, balanced=True)
        found = curve.at_forces(FORCE_SHARES).unloading(load_N)
        assert found.refinement > 1
        lost_J.append(_loss_J(found)[1:])
    assert lost_J[0] == pytest.approx(lost_J[1], rel=0.05)


def test_refined_patches_turn_until_their_resultant_is_at_the_load_point():
    surface, point_m, load_N = waves(2, 5.0), (10e-3, 8e-3), 100.0
    face = elastic_face(surface, E)
    pressed = press_balanced(face, load_N, point_m)
    held = face.tilted(pressed.tilt_rad)
    path = Path(held, pressed, 1e-7, on_patches=True)
    assert path.patches.refinement > 1
    p = path.pressed.pressure_Pa
    at_m = [float(p @ place) / float(p.sum()) for place in path.face.places_m]
    assert at_m == pytest.approx(point_m, rel=1e-9)
    gap_m = path.face.half_space.sinking_m(p) + path.face.depth_m - path.pressed.approach_m
    assert np.abs(gap_m).max() < 1e-6 * path.pressed.approach_m
    as_levelled = press(held, load_N=load_N, start_Pa=pressed.pressure_Pa)
    kept = Path(held, as_levelled, 1e-7, on_patches=True)
    at_m = [float(kept.pressed.pressure_Pa @ place) for place in kept.face.places_m]
    assert np.abs(np.array(at_m) / kept.pressed.pressure_Pa.sum() - point_m).max() > 1e-6


def test_tilt_is_the_one_at_which_fixed_planes_balance():
    from scipy.optimize import root

    face = elastic_face(waves(3, 8.0), E)
    point_m = 13e-3, 10e-3

    def off(tilt_urad):
        tilt_rad = float(tilt_urad[0]) * 1e-6, float(tilt_urad[1]) * 1e-6
        return moments(face, press(face.tilted(tilt_rad), load_N=LOAD_N, tolerance=1e-9), point_m)

    found = root(off, [0.0, 0.0], tol=1e-8, options={"eps": 1e-8})  # steps above the rounding
    assert np.abs(off(found.x)).max() < 1e-9
    pressed = press_balanced(face, LOAD_N, point_m, tolerance=1e-9)
    assert np.allclose(np.array(pressed.tilt_rad) * 1e6, found.x, atol=1e-4)


def test_no_plane_in_the_map_and_no_start_moves_the_answer():
    surface = waves(4)
    face = elastic_face(surface, E)
    base = press_balanced(face, LOAD_N)
    x_m, y_m = face.places_m
    sides = SHAPE[1] * PIXEL_M[1], SHAPE[0] * PIXEL_M[0]
    relief_m = float(np.ptp(surface.height_m))
    for across in ((10, 0), (-7, 7), (0, -10)):
        slopes = [share * relief_m / side for share, side in zip(across, sides, strict=True)]
        plane_m = slopes[0] * x_m + slopes[1] * y_m
        tilted = press_balanced(
            elastic_face(HeightMap(surface.height_m + plane_m, PIXEL_M), E), LOAD_N
        )
        assert tilted.approach_m == pytest.approx(base.approach_m, rel=1e-9)
        assert np.allclose(
            tilted.pressure_Pa, base.pressure_Pa, atol=1e-6 * base.max_pressure_Pa, rtol=0
        )
        assert np.allclose(np.add(tilted.tilt_rad, slopes), base.tilt_rad, atol=1e-12)
        started = press_balanced(face, LOAD_N, start_tilt_rad=(slopes[0], slopes[1]))
        assert started.approach_m == pytest.approx(base.approach_m, rel=1e-6)
        assert np.allclose(started.tilt_rad, base.tilt_rad, atol=1e-11)


def test_points_that_never_touch_do_not_count():
    surface = waves(5)
    base = press_balanced(elastic_face(surface, E), LOAD_N)
    pitted_m = surface.height_m - np.where(surface.height_m < 0, 1e-6, 0) * np.linspace(0, 1, 130)
    pitted = press_balanced(elastic_face(HeightMap(pitted_m, PIXEL_M), E), LOAD_N)
    assert pitted.approach_m == pytest.approx(base.approach_m, rel=1e-6)
    assert np.allclose(pitted.tilt_rad, base.tilt_rad, atol=1e-11)


@pytest.mark.parametrize("turn", [np.rot90, np.fliplr, np.flipud, np.transpose])
def test_rotated_face_rotated_answer(turn):
    surface = waves(6)
    base = press_balanced(elastic_face(surface, E), LOAD_N)
    sizes = PIXEL_M if turn in (np.fliplr, np.flipud) else PIXEL_M[::-1]
    turned = press_balanced(elastic_face(HeightMap(turn(surface.height_m), sizes), E), LOAD_N)
    assert turned.approach_m == pytest.approx(base.approach_m, rel=1e-6)
    assert np.allclose(
        turned.pressure_Pa, turn(base.pressure_Pa), atol=1e-6 * base.max_pressure_Pa, rtol=0
    )
    x, y = base.tilt_rad
    expected = {
        np.rot90: (y, -x),
        np.fliplr: (-x, y),
        np.flipud: (x, -y),
        np.transpose: (y, x),
    }[turn]
    assert np.allclose(turned.tilt_rad, expected, atol=1e-11)


def test_balance_costs_less_than_a_third_more_than_a_plane_that_is_held(monkeypatch):
    from capslip.contact.solvers.half_space import HalfSpace

    sinking, points = HalfSpace.sinking_m, []

    def counted(self, pressure_Pa):
        points.append(pressure_Pa.size)
        return sinking(self, pressure_Pa)

    monkeypatch.setattr(HalfSpace, "sinking_m", counted)
    held, free = 0, 0
    for seed in range(6):
        face = elastic_face(waves(seed), E)
        points.clear()
        press(face, load_N=LOAD_N)
        held += sum(points)
        points.clear()
        press_balanced(face, LOAD_N)
        free += sum(points)
    assert free < 1.33 * held


def test_what_holds_the_parts_is_at_ease_where_they_were_though_the_map_is_turned():
    slope_rad, stiffness = (3e-6, -2e-6), 1e6
    surface = waves(7)
    given = {"rotational_stiffness_Nm_per_rad": stiffness}
    base = press_balanced(elastic_face(surface, E), LOAD_N, **given)
    face = elastic_face(surface, E).tilted(slope_rad)
    at_ease = press_balanced(face, LOAD_N, at_ease_rad=(-3e-6, 2e-6), **given)
    assert np.add(at_ease.tilt_rad, slope_rad) == pytest.approx(base.tilt_rad, rel=1e-4)
    assert at_ease.resultant_m == pytest.approx(base.resultant_m, rel=1e-6)
    as_turned = press_balanced(face, LOAD_N, **given)
    assert np.hypot(*np.subtract(as_turned.resultant_m, base.resultant_m)) > 1e-4


@pytest.mark.long
def test_a_map_of_which_caps_found_the_level_is_held_from_where_it_was_levelled():
    """Moments K theta / N off the load point, with the whole tilt; craters are no caps."""
    y_m, x_m = 4e-4 * (np.indices((100, 150)) + 0.5)
    height_m = np.full(x_m.shape, -1e-6)
    for x0_m, y0_m, top_m in (
        (10e-3, 9e-3, 0.0),
        (29e-3, 12e-3, 0.0),
        (50e-3, 10e-3, -1.2e-7),
        (13e-3, 31e-3, 2e-8),
        (33e-3, 29e-3, 0.0),
        (48e-3, 30e-3, -1e-7),
    ):
        square_m2 = (x_m - x0_m) ** 2 + (y_m - y0_m) ** 2
        hill_m = top_m - square_m2 / 50.0 - 1.5e-7 * np.exp(-square_m2 / 1e-6)
        height_m = np.maximum(height_m, hill_m)
    held = ("contact.preload_N=500", "contact.alignment_stiffness_Nm_per_rad=1e6")
    analysis = analyze_once(HeightMap(height_m, (4e-4, 4e-4)), load_settings(overrides=held))
    assert analysis.contact.rung.made_from == "map"
    assert analysis.level is not None
    tilt_rad = np.array(analysis.summary()["contact"]["tilt_rad"])
    assert np.hypot(*analysis.level.slope) > 1e-7
    off_m = np.array(analysis.contact.eccentricity_m)
    assert off_m == pytest.approx(-1e6 * tilt_rad / 500.0, rel=1e-3)


def test_rotational_stiffness_leads_from_balanced_to_levelled():
    face = elastic_face(waves(7), E)
    point_m = np.array([13e-3, 10e-3])
    last_m = -1.0
    for stiffness in (0.0, 1e2, 1e4, 1e5, 1e6, 1e9, np.inf):
        pressed = press_balanced(face, LOAD_N, rotational_stiffness_Nm_per_rad=stiffness)
        off_m = np.array(pressed.resultant_m) - point_m
        if 0 < stiffness < np.inf:
            # The resultant lies where the tilt puts it, or the tilt is the one that puts it there.
            tilt_rad = -LOAD_N * off_m / stiffness
            assert np.allclose(pressed.tilt_rad, tilt_rad, rtol=1e-4, atol=1e-12)
        assert np.linalg.norm(off_m) > last_m - 1e-8
        last_m = float(np.linalg.norm(off_m))
    levelled = press(face, load_N=LOAD_N)
    assert pressed.tilt_rad == (0.0, 0.0)
    assert pressed.approach_m == levelled.approach_m


@pytest.mark.parametrize("stiffness", [1e-6, 1e-2, 1.0, 1e2, 1e8])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_few_tops_balance_with_what_holds_them_however_stiff_that_is(seed, stiffness):
    """A rough face on one top or three: its tilt says little of where its resultant lies."""
    from scipy.ndimage import gaussian_filter

    noise = gaussian_filter(np.random.default_rng(seed).standard_normal((48, 64)), 2, mode="wrap")
    face = elastic_face(HeightMap(1e-6 * noise / noise.std(), (2e-5, 2e-5)), E)
    point_m, load_N, at_ease_rad = (6e-4, 5e-4), 0.2, (1e-5, -2e-5)
    given = {"rotational_stiffness_Nm_per_rad": stiffness, "at_ease_rad": at_ease_rad}
    found = press_balanced(face, load_N, point_m, **given)
    turned_rad = np.subtract(found.tilt_rad, at_ease_rad)
    moment_Nm = load_N * np.subtract(found.resultant_m, point_m) + stiffness * turned_rad
    assert np.abs(moment_Nm).max() < 1e-6 * load_N * 64 * 2e-5
    held = press(face.tilted(found.tilt_rad), load_N=load_N)
    assert held.approach_m == pytest.approx(found.approach_m, rel=1e-5)
    np.testing.assert_allclose(held.resultant_m, found.resultant_m, rtol=1e-4)
    at_ease = press(face.tilted(at_ease_rad), load_N=load_N)
    arms_m = [np.linalg.norm(np.subtract(one.resultant_m, point_m)) for one in (found, at_ease)]
    assert arms_m[0] <= 1.0001 * arms_m[1]
    if stiffness == 1e-6:
        free = press_balanced(face, load_N, point_m)
        np.testing.assert_allclose(found.tilt_rad, free.tilt_rad, rtol=1e-2)
    if stiffness == 1e8:
        np.testing.assert_allclose(found.tilt_rad, at_ease_rad, rtol=1e-6)


def test_tips_over_names_the_side():
    surface = waves(8)
    face = elastic_face(surface, E)
    sides = (((-1e-3, 1e-2), "small x"), ((2.7e-2, 1e-2), "great x"), ((1e-2, 2.1e-2), "great y"))
    for point_m, side in sides:
        with pytest.raises(ContactError, match=f"tips_over.*side at {side}"):
            press_balanced(face, LOAD_N, point_m)
    half_m = surface.height_m.copy()
    half_m[:, 60:] = np.nan
    with pytest.raises(ContactError, match=r"tips_over.*side at great x"):
        press_balanced(elastic_face(HeightMap(half_m, PIXEL_M), E), LOAD_N)
    line_m = np.where(np.arange(130) == 65, surface.height_m, np.nan)
    with pytest.raises(ContactError, match=r"tips_over.*on one line"):
        press_balanced(elastic_face(HeightMap(line_m, PIXEL_M), E), LOAD_N)
    for wrong in ({"load_N": 0.0}, {"load_N": 1.0, "rotational_stiffness_Nm_per_rad": -1.0}):
        with pytest.raises(SettingsError, match="expected"):
            press_balanced(face, **wrong)
    with pytest.raises(SettingsError, match="tolerance"):
        press_balanced(face, 1.0, tolerance=0.5)


@pytest.mark.parametrize("name", ["caps", "wavy"])
def test_reference_faces_free_to_tilt(name):
    if not (REFERENCE / "truth_balanced.json").is_file():
        pytest.skip("the reference answers are not beside the project")
    import h5py

    truth = json.loads((REFERENCE / "truth_balanced.json").read_text(encoding="utf-8"))[name]
    given = json.loads((REFERENCE / "truth.json").read_text(encoding="utf-8"))[name]
    with h5py.File(REFERENCE / given["file"]) as file:
        surface = HeightMap(file["height"][:], tuple(file["height"].attrs["pixel_size"]))
    N0, nu, mu = given["preload_N"], given["poisson_ratio"], given["friction_coefficient"]
    curve = boundary_elements(surface, given["E_star_Pa"], preload_N=N0, balanced=True)
    pressed = curve.pressed(N0)
    assert np.allclose(curve.tilt_rad, truth["tilt_rad"], rtol=1e-5)
    assert pressed.approach_m == pytest.approx(truth["approach_m"], rel=1e-6)
    assert len(pressed.region_loads_N) == truth["contacts"]
    slip = slip_curve(curve, N0, mu, (2 - nu) / (2 * (1 - nu)))
    for row in truth["slip"]:
        assert slip.displacement_m(row["force_N"]) == pytest.approx(row["displacement_m"], rel=5e-4)
        assert slip.energy_at_force_J(row["force_N"]) == pytest.approx(row["energy_J"], rel=5e-3)


@pytest.mark.long
@pytest.mark.scans
def test_a_real_face_balances_with_a_soft_hold(scans):
    """On few contacts a solution leaves more of its resultant than it may: it is put in place."""
    stiffness, surface = 0.01, load_surface(scans / "milled_like_arcs_1.opd")
    given = ("contact.nominal_pressure_Pa=2e6", "joint.area_m2=0.02", "material.preset=steel")
    given += (f"contact.alignment_stiffness_Nm_per_rad={stiffness}",)
    overrides = (*given, "contact.model=boundary_elements")
    contact = analyze_once(surface, load_settings(overrides=overrides)).contact
    assert contact is not None
    assert contact.model == "boundary_elements"
    off_m = np.array(contact.eccentricity_m)
    turned_rad = -contact.preload_N * off_m / stiffness
    np.testing.assert_allclose(
        np.subtract(contact.tilt_rad, contact.at_ease_rad), turned_rad, rtol=1e-3
    )


@pytest.mark.parametrize("of_load", [0.7, 0.1])
def test_another_load_turns_a_map_from_the_known_one_and_from_no_coarse_points(
    monkeypatch, of_load
):
    """It finds the state of that load all the same, at its own level."""
    scene = Scene((240, 240), (5e-5, 5e-5), 3, waviness_rms_m=2e-7, waviness_length_m=2e-3)
    surface, point_m = synthetic_surface(scene)[0], (5e-3, 7e-3)
    more = {"hardness_Pa": 1e9, "balanced": True, "load_point_m": point_m}
    known = boundary_elements(surface, E, preload_N=LOAD_N, **more)
    alone = boundary_elements(surface, E, preload_N=of_load * LOAD_N, **more)
    assert np.hypot(*np.subtract(alone.tilt_rad, known.tilt_rad)) > 1e-7
    monkeypatch.setattr(polonsky_keer, "_nested", None)
    after = RUNG.after(known, LOAD_N, of_load, 1.0, point_m)
    assert np.allclose(after.tilt_rad, alone.tilt_rad, atol=1e-4 * np.hypot(*alone.tilt_rad))
    one, other = (curve.pressed(of_load * LOAD_N) for curve in (after, alone))
    assert one.approach_m == pytest.approx(other.approach_m, rel=1e-5)
    assert one.resultant_m == pytest.approx(point_m, rel=1e-8)
    assert after.first.approach_m == pytest.approx(alone.first.approach_m, rel=1e-5)
    assert after.yielded_area_m2 == pytest.approx(alone.yielded_area_m2, rel=0.01)
    assert one.pressure_Pa == pytest.approx(other.pressure_Pa, abs=0.01 * other.pressure_Pa.max())


def test_what_changes_from_pixel_to_pixel_is_found_once_whatever_slope_a_face_has(monkeypatch):
    surface = waves(2, 1.0, 0.02)
    face = elastic_face(surface, E)
    tilt_rad = (3e-4, -2e-4)
    (ny, nx), (dy_m, dx_m) = SHAPE, PIXEL_M
    plane_m = tilt_rad[0] * np.arange(nx) * dx_m + tilt_rad[1] * np.arange(ny)[:, None] * dy_m
    other = elastic_face(HeightMap(surface.height_m + plane_m, PIXEL_M), E)
    for order in (4, 8):
        for axis in (0, 1):
            found = face.tilted(tilt_rad).white_m2(order, axis)
            np.testing.assert_allclose(found, other.white_m2(order, axis), rtol=1e-3, atol=1e-24)
    changed = replace(face, depth_m=2.0 * face.depth_m)  # as a filter changes it
    np.testing.assert_allclose(changed.white_m2(8, 0), 4.0 * face.white_m2(8, 0), rtol=1e-5)
    monkeypatch.setattr(faces, "white_m2", None)
    again = face.tilted(tilt_rad).flattened(np.zeros(SHAPE)).before or face.tilted(tilt_rad)
    np.testing.assert_array_equal(again.white_m2(8, 1), face.white_m2(8, 1))
