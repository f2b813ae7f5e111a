"""Height maps that yield: a dense solution, closed forms, caps, and two real scans."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.optimize import lsq_linear

from capslip import load_settings, load_surface
from capslip.analysis import analyze_once
from capslip.contact.map_accuracy import error_of_map
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.metal import _of_metal, first_loading
from capslip.contact.solvers.path import Path
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.contact.solvers.refinement import refinement
from capslip.contact.solvers.sinking import sunk_in
from capslip.contact.solvers.tilting import press_balanced
from capslip.contact.solvers.yielding import YieldLaw
from capslip.errors import ContactError, SettingsError
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from scenes import SCANS

E, R_M = 115e9, 2e-3


def sphere(pixel_m, n=128, off=(0.0, 0.0)):
    y_m, x_m = (np.mgrid[-n // 2 : n // 2, -n // 2 : n // 2] + 0.5) * pixel_m
    r2_m2 = (x_m - off[0]) ** 2 + (y_m - off[1]) ** 2
    return HeightMap(-r2_m2 / (2 * R_M), (pixel_m, pixel_m))


def rough(n, seed, pixel_m=1e-6, height_m=1e-7, width=1.5):
    waves = gaussian_filter(np.random.default_rng(seed).normal(size=(n, n)), width, mode="wrap")
    return HeightMap(height_m * waves / waves.std(), (pixel_m, pixel_m))


def soft(surface, hardness):
    return replace(elastic_face(surface, E), hardness_Pa=hardness)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("hardness", [2e9, 4e9, 7e9])
def test_pressures_are_those_of_a_dense_solution_within_the_same_bounds(seed, hardness):
    face = soft(rough(12, seed), hardness)
    approach_m = 2.5e-7
    found = press(face, approach_m=approach_m, tolerance=1e-9)
    units = np.eye(144).reshape(144, 12, 12)
    C = np.array([face.half_space.sinking_m(unit).ravel() for unit in units])
    # the least of p C p / 2 - p (d - depth): a least-squares problem with C = L L^T
    L = np.linalg.cholesky(0.5 * (C + C.T) * 1e18)
    right = np.linalg.solve(L, (approach_m - face.depth_m.ravel()) * 1e9)
    dense = lsq_linear(L.T, right, (0.0, hardness / 1e9), tol=1e-15, max_iter=500).x * 1e9
    assert found.max_pressure_Pa == hardness
    assert found.pressure_Pa.ravel() == pytest.approx(dense, abs=2e-4 * hardness)


def test_flats_are_followed_more_finely_than_the_hills_on_which_a_load_left_them():
    """A spline would round their edges: it follows the hills, and these are loaded once more."""
    refined = []
    for hardness in (np.inf, 20e9, 2e9):
        face = soft(rough(96, 1), hardness)  # its greatest pressure would be 10 GPa
        pressed = press(face, load_N=0.2, tolerance=1e-8)
        refined.append(refinement(*first_loading(face, pressed)))
    assert refined[:2] == [2, 2]
    assert refined[2] > 2


@pytest.mark.long
@pytest.mark.parametrize("balanced", [False, True])
def test_refined_flats_are_those_of_the_load_on_finer_pixels(balanced):
    """Where points yield they bear what metal does, and elastic pressures hold the flats there."""
    hardness, load_N = 1e9, 0.7
    face = soft(rough(64, 0, width=4), hardness)
    if balanced:
        pressed = press_balanced(face, load_N, (29e-6, 34e-6), tolerance=1e-8)
        face = face.tilted(pressed.tilt_rad)
    else:
        pressed = press(face, load_N=load_N, tolerance=1e-8)
    path = Path(*first_loading(face, pressed), 1e-8, True)
    assert path.patches is not None
    assert path.patches.refinement > 1
    refined, p_Pa = path.face, path.pressed.pressure_Pa
    assert np.isinf(refined.hardness_Pa)
    assert p_Pa.sum() * refined.pixel_area_m2 == pytest.approx(load_N, rel=1e-9)
    assert path.pressed.max_pressure_Pa == hardness
    of_map_Pa = pressed.pressure_Pa[pressed.pressure_Pa > 0]  # pixels at the rims bear less
    assert 0.0 < path.pressed.yielded.mean() - np.mean(of_map_Pa == hardness) < 0.1
    again = press(refined, load_N=load_N, tolerance=1e-8)  # elastic, and from no start
    assert np.abs(again.pressure_Pa - p_Pa).sum() < 1e-3 * p_Pa.sum()


def metal_unloading(over_hardness, load_N, a_m):
    """Return withdrawals, load drops and losses of a round contact with the pressures of metal.

    Flat punches of all radii c <= a, 2 E* c dd each: Abel's equation gives the withdrawal where the
    contact has the radius c as (2 / E*) integral from c to a of p r dr / sqrt(r^2 - c^2), and the
    loss is L = 8 integral(F de) - 4 F e.
    """
    c = np.sin(np.linspace(0.5 * np.pi, 0.0, 401))
    u = np.linspace(0.0, 1.0, 2001)  # r^2 = c^2 + (1 - c^2) u^2
    place = np.maximum((1.0 - c[:, None] ** 2) * (1.0 - u**2), 0.0)
    p = 1.5 * np.sqrt(place) * _of_metal(np.full(place.shape, over_hardness), place)
    at = np.linspace(0.0, 1.0, 20001)
    mean = np.trapezoid(1.5 * np.sqrt(at) * _of_metal(np.full(at.shape, over_hardness), at), at)
    p_Pa = load_N / (np.pi * a_m**2) * p / mean
    e_m = 2.0 * a_m / E * np.sqrt(1.0 - c**2) * np.trapezoid(p_Pa, u, axis=1)
    between_m = 0.5 * (c[1:] + c[:-1]) * a_m
    drop_N = np.append(0.0, np.cumsum(2.0 * E * between_m * np.diff(e_m)))
    stored_J = np.append(0.0, np.cumsum(0.5 * (drop_N[1:] + drop_N[:-1]) * np.diff(e_m)))
    return e_m, drop_N, 8.0 * stored_J - 4.0 * drop_N * e_m


def test_below_its_first_load_a_map_is_as_stiff_as_its_unloading_says():
    """Where a round contact has shrunk to the radius c it is a punch, 2 E* c.

    Finer points that were loaded to the lesser load alone had forgotten the greater one.
    """
    hardness, over = 1e9, 2.0
    load_N = (over * hardness) ** 3 * np.pi**3 * R_M**2 / (6.0 * E**2)
    curve = boundary_elements(sphere(1e-5, 48, (3e-6, 0.0)), E, preload_N=load_N, hardness_Pa=1e9)
    assert curve.unloading(load_N).refinement > 1
    share = np.array([1.0 - 1e-9, 0.8, 0.5])
    K = curve.stiffness_N_per_m(curve.approach_m(np.append(1.0, share) * load_N))
    e_m, drop_N, _ = metal_unloading(over, load_N, 1.0)
    c = np.diff(drop_N) / np.diff(e_m) / (2.0 * E)
    known = np.interp((1.0 - share) * load_N, 0.5 * (drop_N[1:] + drop_N[:-1]), c)
    assert K[1:] / K[0] == pytest.approx(known, rel=0.01)
    further_m = curve.withdrawal_m(curve.approach_m(load_N), 0.2 * load_N)
    half_m = curve.withdrawal_m(curve.approach_m(load_N), 0.5 * load_N)
    again = curve.stiffness_N_per_m(curve.approach_m(0.8 * load_N), half_m - further_m)
    assert again == pytest.approx(K[3], rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize(
    ("load_N", "pixel_m", "off_m"),
    [(2.0, 4e-6, (0.0, 0.0)), (2.0, 1e-5, (3e-6, 1e-6))],
)
def test_the_energy_of_a_fully_plastic_sphere_of_few_pixels_is_the_closed_form(
    load_N, pixel_m, off_m
):
    """Six to fourteen pixels along its radius: on these alone W is far off at half of mu N.

    At a tenth its edge lets go of less than any points follow: that is told otherwise.
    """
    hardness = 2e8
    surface = sphere(pixel_m, 64, off_m)
    curve = boundary_elements(surface, E, preload_N=load_N, hardness_Pa=hardness)
    both = [one.unloading(load_N) for one in (replace(curve, as_solved=True), curve)]
    a_m = np.sqrt(load_N / hardness / np.pi)
    errors, _ = error_of_map(curve, load_N, 0.05)
    _, drop_N, loss_J = metal_unloading(9.0, load_N, a_m)
    for share, most in ((0.1, np.inf), (0.25, 0.05), (0.5, 0.02), (0.75, 0.02)):
        known_J = np.interp(share * load_N, drop_N, loss_J)
        as_solved, answered = (
            abs(
                np.interp(np.log(share * load_N), np.log(one.load_drop_N), np.log(one.loss_J))
                - np.log(known_J)
            )
            for one in both
        )
        assert as_solved < most
        assert answered < min(most + 0.01, errors.energy_at(share))


@pytest.mark.parametrize("balanced", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_a_loaded_map_is_in_equilibrium_and_unloads_from_where_it_is(balanced, seed):
    face, load_N, hardness = soft(rough(96, seed, width=4), 1e9), 1.5, 1e9
    if balanced:
        point_m = 44e-6, 51e-6
        pressed = press_balanced(face, load_N, point_m, tolerance=1e-8)
        face = face.tilted(pressed.tilt_rad)
        assert pressed.resultant_m == pytest.approx(point_m, rel=1e-6)
    else:
        pressed = press(face, load_N=load_N, tolerance=1e-8)
    p, gap_m, d = pressed.pressure_Pa, pressed.gap_m, pressed.approach_m
    assert p.sum() * face.pixel_area_m2 == pytest.approx(load_N, rel=1e-12)
    assert (p.min(), p.max()) == (0.0, hardness)
    sinking_m = face.half_space.sinking_m(p)
    assert gap_m == pytest.approx(sinking_m + face.depth_m - d, abs=1e-9 * d)
    assert gap_m[p == 0].min() >= -1e-8 * d
    assert gap_m[p == hardness].max() <= 1e-5 * d
    assert gap_m[p == hardness].min() < -1e-2 * d
    between = (p > 0) & (p < hardness)
    assert (p[between] @ np.abs(gap_m[between])) / p.sum() < 1e-8 * d

    left, under = first_loading(face, pressed)
    assert np.isinf(left.hardness_Pa)
    assert left.depth_m.min() == 0.0
    assert (under.yielded == (p == hardness)).all()
    # Each contact keeps its load and its edge, and the gaps between them stay as they were
    assert ((under.pressure_Pa > 0) == (p > 0)).all()
    assert under.region_loads_N == pytest.approx(pressed.region_loads_N, rel=1e-12)
    p, sinking_m = under.pressure_Pa, face.half_space.sinking_m(under.pressure_Pa)
    assert under.gap_m == pytest.approx(
        np.where(under.yielded, gap_m.clip(0.0), gap_m), abs=1e-9 * d
    )
    assert under.gap_m == pytest.approx(sinking_m + left.depth_m - under.approach_m, abs=1e-9 * d)
    again = press(left, load_N=load_N, tolerance=1e-8)  # elastic, and from no start at all
    assert again.approach_m == pytest.approx(under.approach_m, rel=1e-5)
    assert again.pressure_Pa == pytest.approx(p, abs=0.02 * hardness)
    assert np.abs(again.pressure_Pa - p).sum() < 1e-4 * p.sum()


def test_what_has_yielded_is_known_where_the_slip_of_pixels_is_followed(monkeypatch):
    monkeypatch.setattr("capslip.contact.solvers.path.refinement", lambda *_: 1)
    curve = boundary_elements(rough(96, 1), E, preload_N=0.2, hardness_Pa=2e9)
    unloading = curve.unloading(0.2)
    assert unloading.refinement == 1
    assert unloading.max_pressure_Pa == curve.pressed(0.2).max_pressure_Pa == 2e9
    assert 0.0 < unloading.yielded_area_m2 == pytest.approx(curve.yielded_area_m2, rel=1e-12)


@pytest.mark.parametrize(("across", "balanced"), [(1.2, True), (2.0, False)])
def test_a_contact_yields_between_its_pixels_though_none_of_them_does(across, balanced):
    """Hertz's greatest pressure is 1.3 times the hardness, the greatest of a pixel is below it."""
    pixel_m = 1e-5
    a_m = 0.5 * across * pixel_m
    load_N = 4.0 * E * a_m**3 / (3.0 * R_M)
    hardness = 1.5 * load_N / (np.pi * a_m**2) / 1.3
    found, whole_m = [], 24 * pixel_m
    for finer in (1, 5):
        y_m, x_m = (np.mgrid[: 24 * finer, : 24 * finer] + 0.5) * pixel_m / finer - 0.5 * whole_m
        surface = HeightMap(-(x_m**2 + y_m**2) / (2 * R_M), (pixel_m / finer, pixel_m / finer))
        curve = boundary_elements(
            surface, E, preload_N=load_N, hardness_Pa=hardness, balanced=balanced
        )
        if finer > 1:
            curve = curve.at_forces((0.25, 0.5, 0.75))
        # As the map has it; what metal does otherwise is told with fewer points of a coarse one
        answered, curve = curve, replace(curve, as_solved=True)
        d = curve.approach_m(load_N)
        drops_N = np.array([0.25, 0.5, 0.75]) * load_N
        found.append([one.loss_integral_at_drop_J(d, drops_N) for one in (curve, answered)])
        if finer == 1:
            assert curve.pressed(load_N).max_pressure_Pa < hardness
            elastic = boundary_elements(surface, E, preload_N=load_N, balanced=balanced)
            of_hertz = elastic.loss_integral_at_drop_J(elastic.approach_m(load_N), drops_N)
    assert found[0][0] == pytest.approx(found[1][0], rel=0.03)
    assert found[0][1] == pytest.approx(found[1][1], rel=0.08)
    assert np.abs(of_hertz / found[1][0] - 1.0).max() > 0.1  # yielding is seen


def test_a_hardness_that_is_not_reached_changes_nothing():
    """Finite elements yield from 0.57 H on, the map's contacts are as elastic ones up to 0.6 H."""
    face = rough(96, 5, width=4)
    curves = [
        boundary_elements(face, E, preload_N=0.01, hardness_Pa=hardness, balanced=balanced)
        for balanced in (False, True)
        for hardness in (np.inf, 1e13)
    ]
    for elastic, hard in (curves[:2], curves[2:]):
        a, b = elastic.pressed(0.01), hard.pressed(0.01)
        assert b.pressure_Pa == pytest.approx(a.pressure_Pa, abs=1e-12 * a.max_pressure_Pa)
        assert b.approach_m == pytest.approx(a.approach_m, rel=1e-12)
        assert (elastic.yielded_area_m2, hard.yielded_area_m2) == (None, 0.0)


@pytest.mark.parametrize(("load_N", "pixel_m"), [(2.0, 1e-6), (8.0, 2e-6), (40.0, 4e-6)])
def test_a_fully_plastic_sphere_unloads_as_the_pressures_of_metal_do(load_N, pixel_m):
    """40 N are 12500 pixels at the hardness, and no other."""
    hardness = 2e8
    curve = boundary_elements(sphere(pixel_m, 160), E, preload_N=load_N, hardness_Pa=hardness)
    area_m2 = curve.pressed(load_N).contact_area_m2
    assert area_m2 == pytest.approx(load_N / hardness, rel=3e-3)
    assert curve.yielded_area_m2 == pytest.approx(area_m2, rel=0.05)
    a_m = np.sqrt(load_N / hardness / np.pi)
    approach_m = curve.approach_m(load_N)
    e_m, drop_N, _ = metal_unloading(9.0, load_N, a_m)
    assert drop_N[-1] == pytest.approx(load_N, rel=1e-3)  # all of the pressures
    assert approach_m == pytest.approx(e_m[-1], rel=0.01)
    known = np.array([0.25, 0.5, 0.75, 0.95]) * e_m[-1]
    found_N = curve.load_drop_N(approach_m, known)
    assert found_N == pytest.approx(np.interp(known, e_m, drop_N), rel=0.01)
    assert curve.stiffness_N_per_m(approach_m) == pytest.approx(2 * E * a_m, rel=5e-3)


@pytest.mark.parametrize(
    ("load_N", "hardness", "pixel_m", "off"),
    # from elastic over first yield to fully plastic: what Hertz unloading and the cap's law share
    [(0.5, 1e9, 0.5e-6, 0.01), (2.0, 1e9, 0.8e-6, 0.08), (8.0, 1e9, 1e-6, 0.12),
     (40.0, 1e9, 2e-6, 0.04), (2.0, 2e8, 1.3e-6, 0.005), (100.0, 2e8, 7e-6, 0.005)],
)  # fmt: skip
def test_a_cap_and_the_map_of_its_sphere_are_equally_stiff(load_N, hardness, pixel_m, off):
    curve = boundary_elements(sphere(pixel_m, 160), E, preload_N=load_N, hardness_Pa=hardness)
    curve = curve.at_forces((0.25, 0.75))  # the stiffness under the preload is asked for alone
    law, N, radius_m = YieldLaw(hardness, E, 0.3), np.array([load_N]), np.array([R_M])
    a_m = np.sqrt(N / (np.pi * law.mean_pressure_Pa(N, radius_m)))[0]
    found = curve.stiffness_N_per_m(curve.approach_m(load_N))
    assert 2 * E * a_m == pytest.approx(found, rel=off)
    flat_m, _ = law.flattened(N, radius_m)
    over = curve.pressed(
        load_N
    ).over_hardness.max()  # metal recovers less than a cap, by up to 0.82
    recovers = np.interp(over, [0.6, 2.0, 5.0], [1.0, 0.9, 0.82])
    assert curve.approach_m(load_N) == pytest.approx(recovers * a_m**2 / flat_m[0], rel=0.1)


def test_a_map_that_cannot_bear_the_load_is_refused():
    face = soft(rough(24, 0), 1e8)
    most_N = 1e8 * 24**2 * 1e-12
    for refused in (press, press_balanced):
        with pytest.raises(ContactError, match="hardness of 1e\\+08 Pa"):
            refused(face, load_N=1.001 * most_N)
    assert press(face, load_N=0.999 * most_N, tolerance=1e-5).max_pressure_Pa == 1e8
    with pytest.raises(SettingsError, match="preload_N"):
        boundary_elements(rough(24, 0), E, hardness_Pa=1e8)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("alignment", ["balanced", "as_levelled"])
def test_an_analysis_slips_along_the_unloading_of_the_map(alignment):
    hardness, load_N = 1e9, 0.75
    surface = rough(48, 7, width=6)
    settings = load_settings(
        overrides=(
            "contact.model=boundary_elements",
            f"contact.preload_N={load_N}",
            f"contact.alignment={alignment}",
            f"material.hardness_Pa={hardness}",
            "conditioning.outliers=none",
        )
    )
    analysis = analyze_once(surface, settings)
    contact = analysis.contact
    assert contact is not None, [p.message for p in analysis.problems]
    assert contact.max_pressure_Pa == hardness
    assert load_N / hardness < contact.contact_area_m2 < 2 * load_N / hardness
    assert 0.2 < contact.yielded_area_m2 / contact.contact_area_m2 < 1.0
    slip = slip_curve(contact.curve, load_N, 0.2, contact.composite.kappa)
    assert slip.total_slip_displacement_m == analysis.slip.total_slip_displacement_m
    assert "yielded" in {p.code for p in analysis.problems}
    # It came as far as the face that bears no more than its hardness and sinks as metal does, and
    # recovers less
    face = elastic_face(analysis.conditioned.surface, contact.composite.E_star_Pa)
    face = replace(face, hardness_Pa=hardness).tilted(contact.tilt_rad)
    first = press(face, load_N=load_N, tolerance=1e-6)
    assert first.approach_m < contact.first_loading_approach_m < 1.05 * first.approach_m

    def again(face, near):
        return press(face, load_N=load_N, tolerance=1e-6, start_Pa=near.pressure_Pa)

    pressed, sunk = sunk_in(face, first, again)
    came_m = pressed.approach_m + (face.depth_m + sunk.deeper_m).min()
    assert contact.first_loading_approach_m == pytest.approx(came_m, rel=1e-4)
    assert contact.approach_m < 0.8 * first.approach_m
    # Loaded anew it is held as it was balanced, so the same load gives the same curve
    energy_J = [
        float(slip_curve(curve, load_N, 0.2, contact.composite.kappa).energy_at_force_J(0.1))
        for curve in (contact.curve, contact.curve_after(load_N, 1.0 + 1e-9))
    ]
    assert energy_J[1] == pytest.approx(energy_J[0], rel=1e-2)
    half = contact.curve_after(0.5 * load_N)
    assert half.yielded_area_m2 < contact.yielded_area_m2
    # The next begins at the least known load that is greater
    anew = "capslip.contact.models.boundary_elements.loaded_anew"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(anew, lambda first, pressed, *_: pytest.fail(f"{pressed.load_N:g}"))
        with pytest.raises(pytest.fail.Exception, match=f"^{0.5 * load_N:g}$"):
            contact.curve_after(0.4 * load_N)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "stiffness"),
    [("milled_like_arcs_1.opd", 1.2e13), ("ski_base_stone_ground_alicona.x3p", 6.45e12)],
)
def test_with_a_hardness_a_real_face_hardly_depends_on_its_pixels(name, stiffness):
    """Unloading stiffness per area at 2 MPa, as measured and smoothed by two pixels."""
    if not (SCANS / name).is_file():
        pytest.skip("needs the real scans")
    surface = condition(load_surface(SCANS / name)).surface
    known = surface.measured
    weight = gaussian_filter(known.astype(float), 2.0)
    height_m = gaussian_filter(np.where(known, surface.height_m, 0.0), 2.0)
    height_m = np.where(known, height_m / np.maximum(weight, 1e-9), np.nan)
    face_m2 = surface.side_m[0] * surface.side_m[1]
    load_N, found = 2e6 * face_m2, []
    for one in (surface, replace(surface, height_m=height_m)):
        curve = boundary_elements(one, 109.9e9, 1e-6, preload_N=load_N, hardness_Pa=1e9)
        curve = curve.at_forces((0.25, 0.75))  # the stiffness under the preload is asked for alone
        pressed = curve.pressed(load_N)
        assert pressed.max_pressure_Pa == 1e9
        assert pressed.contact_area_m2 == pytest.approx(load_N / 1e9, rel=0.1)
        found.append(float(curve.stiffness_N_per_m(curve.approach_m(load_N))) / face_m2)
    assert found[0] == pytest.approx(stiffness, rel=0.05)
    assert 0.7 < found[1] / found[0] < 1.0
