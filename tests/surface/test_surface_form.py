"""The F-operator: what is form goes, all of it, and nothing else."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap
from scenes import in_filters

PIXEL_M = (60e-6, 50e-6)
NY, NX = 120, 170
ROW, COL = np.mgrid[:NY, :NX]
Y, X = (ROW + 0.5) * PIXEL_M[0], (COL + 0.5) * PIXEL_M[1]
POLYNOMIALS = [("plane", 1), ("quadratic", 2), ("polynomial", 4), ("polynomial", 10)]


def rough(seed=0, rms_m=1e-7):
    return rms_m * np.random.default_rng(seed).standard_normal((NY, NX))


def holes(seed=1, share=0.2):
    missing = np.random.default_rng(seed).random((NY, NX)) < share
    missing[:40, :90] = True
    return missing


def polynomial(degree, seed=2):
    v, u = Y / Y.max(), X / X.max()
    rng = np.random.default_rng(seed)
    terms = [v**i * u**j for i in range(degree + 1) for j in range(degree + 1 - i)]
    return 3e-3 + 1e-5 * sum(rng.uniform(-1, 1) * term for term in terms)


def sphere(radius_m, centre_m=(4e-3, 3e-3)):
    """Upper side of a sphere, falling from its top; a negative radius gives a bowl."""
    r2 = (X - centre_m[0]) ** 2 + (Y - centre_m[1]) ** 2
    return -np.sign(radius_m) * r2 / (abs(radius_m) + np.sqrt(radius_m**2 - r2))


def cylinder(radius_m, axis_rad, tilt=0.0):
    """Upper side of a cylinder, its axis tilted out of the plane: by intersecting the body."""
    axis = np.array([np.cos(axis_rad), np.sin(axis_rad), tilt])
    axis /= np.linalg.norm(axis)
    point = np.stack((X - 4e-3, Y - 3e-3, np.zeros_like(X)))
    # |p + z e - ((p + z e).u) u|^2 = R^2, the higher root for z
    along = np.tensordot(axis, point, 1)
    a = 1 - axis[2] ** 2
    b = -2 * along * axis[2]
    c = (point**2).sum(axis=0) - along**2 - radius_m**2
    return (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)


def residual(z, kind, **options):
    return remove_form(HeightMap(z, PIXEL_M), kind, **options)[0].height_m


def options_of(kind, degree):
    return {"degree": degree} if kind == "polynomial" else {}


@pytest.mark.parametrize(("kind", "degree"), POLYNOMIALS)
@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("robust", [False, True])
def test_a_polynomial_is_removed_to_the_last_digits(kind, degree, masked, robust):
    z = polynomial(degree)
    if masked:
        z[holes()] = np.nan
    left = residual(z, kind, robust=robust, **options_of(kind, degree))
    assert np.nanmax(np.abs(left)) < 1e-14 * 3e-3 * 10
    np.testing.assert_array_equal(np.isnan(left), np.isnan(z))


@pytest.mark.parametrize(("kind", "degree"), POLYNOMIALS)
@pytest.mark.parametrize("masked", [False, True])
def test_polynomial_is_that_of_dense_least_squares(kind, degree, masked):
    z = rough(3) + polynomial(4, seed=5)
    if masked:
        z[holes()] = np.nan
    v, u = 2 * Y / Y.max() - 1, 2 * X / X.max() - 1
    legendre = [
        np.polynomial.legendre.legval(u, np.eye(11)[i])
        * np.polynomial.legendre.legval(v, np.eye(11)[j])
        for i in range(degree + 1)
        for j in range(degree + 1 - i)
    ]
    matrix, known = np.stack(legendre, axis=-1), ~np.isnan(z)
    solution = np.linalg.lstsq(matrix[known], z[known], rcond=None)[0]
    found = residual(z, kind, **options_of(kind, degree))
    np.testing.assert_allclose(found, z - matrix @ solution, atol=1e-14)


@pytest.mark.parametrize(("kind", "degree"), POLYNOMIALS)
@pytest.mark.parametrize("robust", [False, True])
def test_adding_a_polynomial_changes_nothing(kind, degree, robust):
    z = rough()
    z[holes()] = np.nan
    options = {"robust": robust, **options_of(kind, degree)}
    bare, bent = (residual(z + more, kind, **options) for more in (0.0, polynomial(degree)))
    # the robust fit stops where its spread settles to 1e-4
    np.testing.assert_allclose(bent, bare, atol=1e-10 if robust else 1e-13)


@pytest.mark.parametrize("radius_m", [9e-3, 0.1, 24.0, -0.1])
@pytest.mark.parametrize("masked", [False, True])
def test_a_sphere_is_removed_and_its_radius_told(radius_m, masked):
    z = sphere(radius_m) + 0.01
    if masked:
        z[holes()] = np.nan
    level, form = remove_form(HeightMap(z, PIXEL_M), "sphere")
    assert np.nanmax(np.abs(level.height_m)) < 1e-13
    assert form.radius_m == pytest.approx(radius_m, rel=1e-6)


@pytest.mark.parametrize("radius_m", [9e-3, 0.1, 24.0])
@pytest.mark.parametrize(("axis_rad", "tilt"), [(0.0, 0.0), (0.7, 0.05), (1.6, -0.2), (2.8, 0.0)])
def test_a_cylinder_is_removed_and_its_axis_told(radius_m, axis_rad, tilt):
    level, form = remove_form(HeightMap(cylinder(radius_m, axis_rad, tilt), PIXEL_M), "cylinder")
    assert np.abs(level.height_m).max() < 1e-13
    assert form.radius_m == pytest.approx(radius_m, rel=1e-6)
    assert form.axis_rad == pytest.approx(axis_rad, abs=1e-6)


@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
def test_a_plane_is_a_sphere_and_a_cylinder_too(kind):
    level, form = remove_form(HeightMap(2e-3 * X - 1e-3 * Y, PIXEL_M), kind)
    assert np.abs(level.height_m).max() < 1e-15
    assert form.radius_m is None or abs(form.radius_m) > 1e6


@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
def test_sphere_and_cylinder_are_those_of_a_general_least_squares_solver(kind):
    from scipy.optimize import least_squares

    z = (sphere(0.05) if kind == "sphere" else cylinder(0.05, 0.4)) + rough(1, 1e-6)
    z[holes()] = np.nan
    known = ~np.isnan(z)

    def off(p):
        if kind == "sphere":
            model = sphere(p[0], (1e-3 * p[1], 1e-3 * p[2])) + 1e-3 * p[3]
        else:
            middle = 1e-3 * (p[3] + p[4] * (X * np.cos(p[1]) + Y * np.sin(p[1])))
            across = -X * np.sin(p[1]) + Y * np.cos(p[1]) - 1e-3 * p[2]
            model = middle + np.sqrt(p[0] ** 2 - across**2) - p[0]
        return 1e6 * (z - model)[known]

    start = [0.05, 4.0, 3.0, 0.0] if kind == "sphere" else [0.05, 0.4, 1.0, 50.0, 0.0]
    solved = least_squares(off, start, x_scale=[0.01, 1, 1, 1, 1][: len(start)], xtol=1e-14)
    level, form = remove_form(HeightMap(z, PIXEL_M), kind)
    assert np.nansum((1e6 * level.height_m) ** 2) == pytest.approx(2 * solved.cost, rel=1e-7)
    assert form.radius_m == pytest.approx(solved.x[0], rel=1e-4)


@pytest.mark.parametrize(
    ("kind", "body"),
    [("plane", polynomial(1)), ("quadratic", polynomial(2)), ("sphere", sphere(0.1))],
)
def test_the_robust_form_is_not_drawn_by_peaks_and_outliers(kind, body):
    rng = np.random.default_rng(8)
    z = body + rough(9, 1e-8)
    peaks = np.zeros_like(z)
    for _ in range(8):
        y, x = rng.uniform(0.5e-3, 6.5e-3), rng.uniform(4.5e-3, 8e-3)
        peaks = np.maximum(peaks, 5e-7 - ((X - x) ** 2 + (Y - y) ** 2) / (2 * 0.8))
    z += peaks
    assert 0.05 < (peaks > 0).mean() < 0.35
    z.reshape(-1)[rng.choice(z.size, 300, replace=False)] += 5e-6
    floor = (peaks == 0) & (np.abs(z - body) < 1e-6)
    plain, robust = (residual(z, kind, robust=r) - (z - body) for r in (False, True))
    assert np.abs(plain[floor]).max() > 1e-7
    assert np.abs(robust[floor]).max() < 1e-8


def test_turning_the_face_turns_the_result():
    z = rough(4) + polynomial(2)
    z[holes()] = np.nan
    for kind in ("plane", "quadratic", "sphere", "cylinder"):
        turned = remove_form(HeightMap(np.rot90(z), PIXEL_M[::-1]), kind)[0].height_m
        np.testing.assert_allclose(turned, np.rot90(residual(z, kind)), atol=1e-13)


def test_a_high_level_costs_no_digits():
    z = rough(5, 1e-9)
    np.testing.assert_allclose(residual(z + 0.05, "plane"), residual(z, "plane"), atol=2e-17)


def test_a_small_measured_part_far_off_the_middle_is_well_conditioned():
    z = polynomial(2) + rough(6, 1e-12)
    z[5:, :] = np.nan
    z[:, :160] = np.nan
    assert np.nanstd(residual(z, "quadratic")) < 1.1e-12


def test_none_leaves_the_map_as_it_is():
    surface = HeightMap(rough() + 3.0, PIXEL_M)
    level, form = remove_form(surface, "none")
    assert level is surface
    assert (form.kind, form.degree, form.radius_m) == ("none", None, None)


@pytest.mark.parametrize("kind", ["quadratic", "sphere", "cylinder"])
@pytest.mark.parametrize("keep", [np.s_[0:0], np.s_[3:5, 3:5]])
def test_too_few_measured_points_are_refused(kind, keep):
    z = np.full((NY, NX), np.nan)
    z[keep] = rough()[keep]
    with pytest.raises(UnusableSurfaceError, match=r"non-measured|along a line"):
        residual(z, kind)


@pytest.mark.parametrize("keep", [np.s_[7], np.s_[:, 9]])
def test_points_along_a_line_fix_no_form(keep):
    z = np.full((NY, NX), np.nan)
    z[keep] = rough()[keep]
    for kind in ("plane", "quadratic"):
        with pytest.raises(UnusableSurfaceError, match="along a line"):
            residual(z, kind)


def test_points_along_a_diagonal_fix_no_plane():
    z = np.full((50, 50), np.nan)
    np.fill_diagonal(z, 1e-6)
    with pytest.raises(UnusableSurfaceError, match="along a line"):
        remove_form(HeightMap(z, PIXEL_M))


@pytest.mark.parametrize(
    ("kind", "degree", "words"),
    [
        ("cubic", None, "cubic"),
        ("polynomial", None, "form_degree"),
        ("polynomial", 0, "form_degree"),
        ("polynomial", 11, "1 to 10"),
        ("plane", 2, "leave it out"),
    ],
)
def test_impossible_forms_are_refused(kind, degree, words):
    with pytest.raises(SettingsError, match=words):
        residual(rough(), kind, degree=degree)


@pytest.mark.parametrize("kind", ["plane", "sphere"])
@pytest.mark.parametrize("robust", [False, True])
def test_memory_stays_below_six_maps(kind, robust):
    z = np.random.default_rng(0).standard_normal((400, 600)) * 1e-7
    z[::7, ::3] = np.nan
    surface = HeightMap(z, PIXEL_M)
    remove_form(surface, kind, robust=robust)
    tracemalloc.start()
    remove_form(surface, kind, robust=robust)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 6 * z.nbytes


def test_a_plane_is_removed_quickly():
    z = np.random.default_rng(0).standard_normal((800, 1200)) * 1e-7
    surface = HeightMap(z, PIXEL_M)
    assert in_filters(lambda: remove_form(surface)) < 0.5


def test_the_lowest_third_is_the_floor_under_hills_on_one_side():
    """Flanks cover more than half of the face: the robust plane follows them, too."""
    scene = Scene(
        (200, 300),
        (2e-4, 2e-4),
        seed=14,
        families=(CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 0.24e-6)),
        balanced=False,
    )
    face, _ = synthetic_surface(scene)
    tilted = synthetic_surface(replace(scene, tilt=(2e-5, -3e-5), noise_rms_m=1e-9))[0]
    for kind in ("plane", "quadratic"):
        off_m = {
            fit: float(np.ptp(remove_form(face, kind, **{fit: True})[0].height_m - face.height_m))
            for fit in ("robust", "floor")
        }
        assert off_m["robust"] > 1e-8
        assert off_m["floor"] < 1e-12
        level, form = remove_form(tilted, kind, floor=True)
        assert (form.floor, form.robust) == (True, False)
        floor_m = level.height_m[face.height_m == face.height_m.min()]
        assert floor_m.std() == pytest.approx(1e-9, rel=0.1)
    holed = face.height_m.copy()
    holed[50:60, 70:90] = np.nan
    level, _ = remove_form(replace(face, height_m=holed), floor=True)
    assert np.isnan(level.height_m).sum() == 200
    assert np.nanmax(np.abs(np.diff(level.height_m - holed))) < 1e-15
