"""Boundary elements against closed forms, dense oracles and other solvers."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from capslip.contact.curve import in_series
from capslip.contact.map_curve import _proportional
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.models.caps import caps
from capslip.contact.slip import slip_curve
from capslip.contact.solvers import elastic_face as elastic_faces
from capslip.contact.solvers import polonsky_keer
from capslip.contact.solvers.closing import GivenLoad
from capslip.contact.solvers.half_space import HalfSpace, love_kernel
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.contact.solvers.tilting import press_balanced
from capslip.errors import ContactError, SettingsError, UnusableSurfaceError
from capslip.surface.heightmap import HeightMap

E = 110e9
REFERENCE = Path(__file__).parents[2].parent / "shared" / "reference"


def sphere(n_radius, contact_m=2e-3, radius_m=20.0, ratio=1.0, margin=1.7):
    """Paraboloid with `n_radius` pixels (along x) a contact radius, its peak between pixels."""
    dx, dy = contact_m / n_radius, ratio * contact_m / n_radius
    nx, ny = int(margin * n_radius), int(margin * n_radius / ratio)
    y, x = (np.arange(-ny, ny + 1) + 0.21)[:, None] * dy, (np.arange(-nx, nx + 1) - 0.37) * dx
    height_m = -(x**2 + y**2) / (2 * radius_m)
    # The approach counts from the highest pixel, the closed form from the peak.
    return HeightMap(height_m, (dy, dx)), -height_m.max()


def hertz_load(contact_m=2e-3, radius_m=20.0):
    return 4 / 3 * E * contact_m**3 / radius_m


def rough(shape=(24, 30), seed=3, pixel_size_m=(1.2e-4, 1e-4), smooth=2.0):
    from scipy.ndimage import gaussian_filter

    noise = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), smooth)
    return HeightMap(2e-7 * noise / noise.std(), pixel_size_m)


def dense(surface):
    """Compliance matrix between all pixels, from the kernel alone."""
    kernel = love_kernel(surface.shape, surface.pixel_size_m, E)
    i, j = np.indices(surface.shape).reshape(2, -1)
    return kernel[np.abs(i[:, None] - i), np.abs(j[:, None] - j)]


def test_kernel_is_the_integral_over_a_pixel():
    from scipy.integrate import dblquad

    dy, dx = 2.0, 1.0
    kernel = love_kernel((4, 5), (dy, dx), E)
    for i, j in ((0, 1), (1, 0), (2, 3)):
        integral, _ = dblquad(
            lambda y, x, i=i, j=j: 1 / np.hypot(y - i * dy, x - j * dx),
            *(-dx / 2, dx / 2, -dy / 2, dy / 2),
            epsabs=1e-12,
        )
        assert kernel[i, j] == pytest.approx(integral / (np.pi * E), rel=1e-9)
    far = love_kernel((2000, 3), (1.0, 1.0), E)[-1, 0]
    assert far == pytest.approx(1 / (np.pi * E * 1999), rel=1e-6)


def test_sinking_is_the_dense_product_without_periodic_images():
    surface = rough((17, 23))
    pressure = np.random.default_rng(0).random(surface.shape)
    half_space = HalfSpace(surface.shape, surface.pixel_size_m, E)
    expected = (dense(surface) @ pressure.ravel()).reshape(surface.shape)
    assert np.allclose(half_space.sinking_m(pressure), expected, rtol=1e-12)


@pytest.mark.parametrize("ratio", [1.0, 0.8])
def test_hertz_at_64_pixels_a_contact_radius(ratio):
    surface, peak_m = sphere(64, ratio=ratio)
    pressed = press(elastic_face(surface, E), load_N=hertz_load())
    assert pressed.approach_m + peak_m == pytest.approx(2e-3**2 / 20.0, rel=5e-5)
    assert pressed.max_pressure_Pa == pytest.approx(
        1.5 * hertz_load() / (np.pi * 2e-3**2), rel=2e-4
    )
    assert pressed.contact_area_m2 == pytest.approx(np.pi * 2e-3**2, rel=0.02)
    assert pressed.pixels_across == pytest.approx(128, rel=0.02)  # of their longer sides


def test_two_caps_sink_each_other_like_distant_point_loads():
    dx, radius_m, distance_m = 5e-5, 20.0, 20e-3
    y, x = (np.arange(81) - 40.0)[:, None] * dx, np.arange(-40, 441) * dx
    one, other = x**2 + y**2, (x - distance_m) ** 2 + y**2
    load_N = hertz_load(1e-3)

    def pressed(r2, load_N):
        face = elastic_face(HeightMap(-r2 / (2 * radius_m), (dx, dx)), E)
        return press(face, load_N=load_N, tolerance=1e-9)

    # On the same grid, so that what the pixels cost a single contact drops out.
    both = pressed(np.minimum(one, other), 2 * load_N)
    added_m = both.approach_m - pressed(one, load_N).approach_m
    assert added_m == pytest.approx(load_N / (np.pi * E * distance_m), rel=2e-3)
    assert np.allclose(both.region_loads_N, load_N, rtol=1e-6)


def test_square_punch_has_the_published_stiffness():
    # N / d = pi E* C with the capacitance C of a square plate, 0.3667896 times its side
    # (Read, J. Comput. Phys. 133 (1997) 1, where lengths are such that a sphere's is its radius).
    surface = HeightMap(np.zeros((160, 160)), (1e-4, 1e-4))
    curve = boundary_elements(surface, E)
    expected = np.pi * E * 0.3667896 * 16e-3
    d = curve.approach_m(1e4)
    assert 1e4 / d == pytest.approx(expected, rel=4e-3)
    assert curve.stiffness_N_per_m(d) == pytest.approx(1e4 / d, rel=1e-5)
    assert curve.loss_integral_at_drop_J(d, 5e3) <= 1e-6 * 5e3 * d


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_dense_non_negative_least_squares_agrees(seed):
    from scipy.optimize import nnls

    surface = rough(seed=seed)
    height_m = surface.height_m.copy()
    height_m[np.random.default_rng(seed).random(surface.shape) < 0.3] = np.nan
    face = elastic_face(replace(surface, height_m=height_m), E)
    approach_m = 0.5 * face.depth_m.max()
    pressed = press(face, approach_m=approach_m, tolerance=1e-10)
    allowed = face.measured.ravel()
    # min p K p / 2 - p (d - depth), p >= 0, with K = L L^T
    factor = np.linalg.cholesky(dense(surface)[np.ix_(allowed, allowed)] * E)
    wanted = (approach_m - face.depth_m).ravel()[allowed]
    expected = nnls(factor.T, np.linalg.solve(factor, wanted))[0] * E
    assert 0.05 < (expected > 0).mean() < 0.95
    scale = expected.max()
    assert np.allclose(pressed.pressure_Pa.ravel()[allowed], expected, atol=1e-6 * scale, rtol=0)
    assert not pressed.pressure_Pa.ravel()[~allowed].any()


def test_certificate_holds_against_a_dense_computation():
    surface = rough((30, 28))
    face = elastic_face(surface, E)
    pressed = press(face, load_N=30.0, tolerance=1e-8)
    p = pressed.pressure_Pa.ravel()
    gap_m = dense(surface) @ p + face.depth_m.ravel() - pressed.approach_m
    assert p.sum() * face.pixel_area_m2 == pytest.approx(30.0, rel=1e-12)
    assert p.min() == 0.0
    assert gap_m[p == 0].min() > -1e-8 * pressed.approach_m
    assert np.abs(gap_m) @ p < 1e-8 * pressed.approach_m * p.sum()
    assert pressed.certificate.complementarity < 1e-8
    assert pressed.certificate.least_gap == pytest.approx(
        gap_m[p == 0].min() / pressed.approach_m, rel=1e-6
    )


def test_load_and_approach_control_are_inverse():
    face = elastic_face(rough((120, 130), smooth=5.0), E)
    for load_N in (1e-3, 1.0, 1e3, 1e6):
        pressed = press(face, load_N=load_N, tolerance=1e-9)
        back = press(face, approach_m=pressed.approach_m, tolerance=1e-9)
        assert back.load_N == pytest.approx(load_N, rel=1e-6)
    assert (pressed.pressure_Pa > 0).all()  # everything touches


def test_a_warm_start_changes_the_way_and_not_the_answer():
    face = elastic_face(rough((120, 130), smooth=5.0), E)
    near = press(face, load_N=101.0)
    cold = press(face, load_N=100.0, tolerance=1e-9)
    warm = press(face, load_N=100.0, tolerance=1e-9, start_Pa=near.pressure_Pa)
    assert warm.approach_m == pytest.approx(cold.approach_m, rel=1e-8)
    assert warm.certificate.iterations < cold.certificate.iterations


def test_invariances():
    surface = rough((60, 50))
    base = press(elastic_face(surface, E), load_N=20.0, tolerance=1e-9)
    dy, dx = surface.pixel_size_m
    turned = HeightMap(np.rot90(surface.height_m) + 1.0e-3, (dx, dy))
    again = press(elastic_face(turned, E), load_N=20.0, tolerance=1e-9)
    assert again.approach_m == pytest.approx(base.approach_m, rel=1e-7)
    assert np.allclose(again.pressure_Pa, np.rot90(base.pressure_Pa), rtol=1e-3, atol=1e-3)
    # All lengths three times as large: pressures stay, the load grows ninefold.
    large = HeightMap(3 * surface.height_m, (3 * dy, 3 * dx))
    scaled = press(elastic_face(large, E), load_N=180.0, tolerance=1e-9)
    assert scaled.approach_m == pytest.approx(3 * base.approach_m, rel=1e-9)


def test_slip_of_a_sphere_is_that_of_hertz():
    surface, peak_m = sphere(48)
    N0 = hertz_load()
    curve = boundary_elements(surface, E)
    slip = slip_curve(curve, N0, 0.2, 1.2)
    hertz = slip_curve(caps([20.0], [0.0], E), N0, 0.2, 1.2)
    share = np.array([0.1, 0.2, 0.4, 0.6, 0.8, 0.95])
    force_N = share * slip.total_slip_force_N
    assert np.allclose(slip.energy_at_force_J(force_N), hertz.energy_at_force_J(force_N), rtol=0.01)
    assert np.allclose(slip.displacement_m(force_N), hertz.displacement_m(force_N), rtol=5e-4)
    assert np.allclose(slip.force_N(slip.displacement_m(force_N)), force_N, rtol=1e-5)
    assert slip.tangential_stiffness_N_per_m == pytest.approx(
        hertz.tangential_stiffness_N_per_m, rel=5e-3
    )
    assert slip.limits_m == pytest.approx(slip.total_slip_displacement_m)
    assert slip.phase([0.5 * slip.limits_m[0], 1.1 * slip.limits_m[0]]).tolist() == ["GPS", "TS"]
    # The cubic law takes over where too few pixels slip.
    tiny = np.array([1e-6, 1e-5]) * N0
    energy_J = slip.energy_at_force_J(tiny)
    assert energy_J[1] / energy_J[0] == pytest.approx(1000, rel=1e-3)
    # Beyond total slip, Coulomb friction over all that is added.
    total_m = slip.total_slip_displacement_m
    more_J = slip.energy_J([1.5 * total_m, total_m])
    assert more_J[0] - more_J[1] == pytest.approx(4 * 0.2 * N0 * 0.5 * total_m, rel=1e-6)
    assert total_m == pytest.approx(0.24 * (2e-3**2 / 20.0 - peak_m), rel=2e-4)


@pytest.mark.long
def test_loss_needs_no_quadrature_and_agrees_with_gauss_points():
    curve = boundary_elements(rough((150, 180), smooth=14.0, pixel_size_m=(1e-4, 1e-4)), E)
    face, N0 = curve.solutions.face, 200.0  # wide enough that the map is not refined
    pressed = press(face, load_N=N0, tolerance=1e-9)
    d0 = float(curve.approach_m(N0))
    node, weight = np.polynomial.legendre.leggauss(12)
    for share in (0.2, 0.4, 0.7, 0.9):
        s = share * N0
        # 4 s e(s) - 8 * integral of e from 0 to s
        *inner, last = (
            press(face, load_N=N0 - drop, tolerance=1e-9) for drop in (*(s * (1 + node) / 2), s)
        )
        e = pressed.approach_m - np.array([state.approach_m for state in (*inner, last)])
        by_quadrature_J = 4 * s * e[-1] - 4 * s * float(weight @ e[:-1])
        from_two_states_J = 4 * face.pixel_area_m2 * float((last.gap_m * pressed.pressure_Pa).sum())
        assert from_two_states_J == pytest.approx(by_quadrature_J, rel=2e-3)
        assert curve.loss_integral_at_drop_J(d0, s) == pytest.approx(from_two_states_J, rel=0.02)
        assert curve.withdrawal_m(d0, s) == pytest.approx(e[-1], rel=1e-3)


@pytest.mark.long
def test_a_spring_in_series_changes_displacements_and_no_loss():
    curve = boundary_elements(rough((100, 100), smooth=6.0), E)
    d = float(curve.approach_m(50.0))
    stiffness = float(curve.stiffness_N_per_m(d))
    for c in (0.7 / stiffness, -0.2 / stiffness):
        sprung = in_series(curve, c)
        ds = float(sprung.approach_m(50.0))
        assert ds == pytest.approx(d + 50.0 * c)
        assert sprung.load_N(ds) == pytest.approx(50.0)
        assert sprung.load_N(0.7 * ds) == pytest.approx(
            float(curve.load_N(0.7 * ds - c * float(sprung.load_N(0.7 * ds)))), rel=1e-6
        )
        assert sprung.stiffness_N_per_m(ds) == pytest.approx(1 / (1 / stiffness + c))
        drop = np.array([1.0, 10.0, 40.0])
        assert np.allclose(
            sprung.loss_integral_at_drop_J(ds, drop), curve.loss_integral_at_drop_J(d, drop)
        )
        e = sprung.withdrawal_m(ds, drop)
        assert np.allclose(e, curve.withdrawal_m(d, drop) + c * drop)
        assert np.allclose(sprung.load_drop_N(ds, e), drop, rtol=1e-4)
        lift_off_m = curve.lift_off_m(d)
        with_spring_m = lift_off_m + c * curve.load_drop_N(d, lift_off_m)
        assert np.allclose(sprung.lift_off_m(ds), with_spring_m, rtol=1e-4)
    with pytest.raises(ContactError, match="keep the bulk term"):
        in_series(curve, -1.1 / stiffness).stiffness_N_per_m(d - 55.0 / stiffness)


@pytest.mark.parametrize("share", [-0.2, 3.0])
def test_the_load_at_an_approach_is_found_by_few_solutions(share):
    """A spring in series couples both: by a slope and a secant, no path of unloading."""
    curve = boundary_elements(rough((100, 100), smooth=6.0), E)
    found = in_series(curve, share * float(curve.approach_m(50.0)) / 50.0)
    approach_m = float(found.approach_m(40.0))
    fresh = in_series(boundary_elements(rough((100, 100), smooth=6.0), E), found.compliance_m_per_N)
    assert fresh.load_N(approach_m) == pytest.approx(40.0, rel=1e-6)
    assert len(fresh.solutions.approach_m) <= 12
    assert not fresh.solutions.unloading


def test_a_load_that_is_pressed_again_keeps_its_approach():
    """Few states are kept; one that is solved anew starts elsewhere, and ends within rounding."""
    curve = boundary_elements(rough((100, 100), smooth=6.0), E)
    first = curve.pressed(30.0)
    given_m = float(curve.approach_m(50.0))
    curve.approach_m(np.array([60.0, 55.0, 46.0, 45.0]))
    assert curve.pressed(30.0) is first
    again = curve.pressed(50.0)
    assert again.approach_m == pytest.approx(given_m, rel=1e-6)
    assert again.approach_m != given_m  # else nothing was tried
    assert float(curve.approach_m(50.0)) == given_m
    n_solved = len(curve.solutions.approach_m)
    assert curve.load_N(given_m) == 50.0
    curve.unloading(50.0)
    assert float(curve.approach_m(50.0)) == given_m
    assert curve.load_N(given_m) == 50.0
    assert n_solved == 6


@pytest.mark.parametrize("share", [-0.2, -0.4])
def test_a_load_is_found_to_what_the_solver_tells(share):
    """Where a spring takes much of the approach off, nothing of 1e-9 of the rest is known."""
    curve = boundary_elements(rough((100, 100), smooth=6.0), E)
    compliance_m_per_N = share * float(curve.approach_m(50.0)) / 50.0
    for load_N in (41.7, 43.0, 45.1):
        approach_m = float(in_series(curve, compliance_m_per_N).approach_m(load_N))
        rough_one = boundary_elements(rough((100, 100), smooth=6.0), E, tolerance=1e-4)
        found = in_series(rough_one, compliance_m_per_N)
        assert found.load_N(approach_m) == pytest.approx(load_N, rel=2e-3)
        assert len(rough_one.solutions.approach_m) <= 14


def test_many_loads_are_interpolated_between_solved_ones():
    curve = boundary_elements(rough((100, 100), smooth=6.0), E)
    load_N = np.append(0.0, np.geomspace(1.0, 200.0, 60))
    many_m = curve.approach_m(load_N)
    assert many_m[0] == 0.0
    fresh = boundary_elements(rough((100, 100), smooth=6.0), E)
    assert np.allclose(many_m[5::9], fresh.approach_m(load_N[5::9]), rtol=1e-3)


@pytest.mark.parametrize("name", ["caps", "wavy"])
def test_reference_faces(name):
    if not (REFERENCE / "truth.json").is_file():
        pytest.skip("the reference answers are not beside the project")
    import h5py

    truth = json.loads((REFERENCE / "truth.json").read_text(encoding="utf-8"))[name]
    with h5py.File(REFERENCE / truth["file"]) as file:
        surface = HeightMap(file["height"][:], tuple(file["height"].attrs["pixel_size"]))
    nu = truth["poisson_ratio"]
    curve = boundary_elements(surface, truth["E_star_Pa"])
    pressed = curve.pressed(truth["preload_N"])
    assert pressed.approach_m == pytest.approx(truth["approach_m"], rel=1e-6)
    assert len(pressed.region_loads_N) == truth["contacts"]
    kappa = (2 - nu) / (2 * (1 - nu))
    slip = slip_curve(curve, truth["preload_N"], truth["friction_coefficient"], kappa)
    for row in truth["slip"]:
        assert slip.displacement_m(row["force_N"]) == pytest.approx(row["displacement_m"], rel=5e-4)
        assert slip.energy_at_force_J(row["force_N"]) == pytest.approx(row["energy_J"], rel=5e-3)


def test_tamaas_agrees():
    pytest.importorskip("tamaas", reason="Tamaas is not installed here")
    from capslip.studies.bench import boundary_elements as bench

    surface = bench.seeded_face((160, 240))
    face = elastic_face(surface, bench.E_STAR_PA)
    expected_m = bench._certificate(face, bench._tamaas(surface))[0]
    pressed = press(face, load_N=bench.LOAD_N)
    assert pressed.approach_m == pytest.approx(expected_m, rel=1e-5)


def test_refusals(monkeypatch):
    surface = rough((60, 50))
    face = elastic_face(surface, E)
    for wrong in ({}, {"load_N": 1.0, "approach_m": 1e-9}, {"load_N": -1.0}, {"load_N": np.nan}):
        with pytest.raises(SettingsError):
            press(face, **wrong)
    with pytest.raises(SettingsError, match="solver_tolerance: got 0"):
        boundary_elements(surface, E, tolerance=0.5)
    with pytest.raises(SettingsError, match="E_star_Pa"):
        boundary_elements(surface, -1.0)
    with pytest.raises(UnusableSurfaceError, match="non-measured"):
        elastic_face(HeightMap(np.full((4, 4), np.nan), (1.0, 1.0)), E)
    with pytest.raises(ContactError, match="pixels; expected at least"):
        boundary_elements(surface, E).unloading(1e-6)
    monkeypatch.setattr(polonsky_keer, "_MAX_ITERATIONS", 2)
    with pytest.raises(ContactError, match="in 2 iterations: complementarity"):
        press(face, load_N=20.0)
    monkeypatch.setattr(elastic_faces, "MAX_POINTS", 1000)
    with pytest.raises(ContactError, match="coarsen the map 2 times"):
        elastic_face(surface, E)


def test_an_approach_that_is_lost_beside_the_heights_is_said_so():
    """Heights swallow what the points of a stiff face sink by."""
    face = elastic_face(rough(), 1e30)
    p = np.where(face.depth_m == 0.0, 1.0, 0.0)
    with pytest.raises(ContactError, match="the approach is less than numbers tell"):
        polonsky_keer._state(face, p, np.zeros(face.shape), GivenLoad(p.sum()))


@pytest.mark.parametrize("tilting", [False, True])
@pytest.mark.parametrize("load_N", [1e15, 1e29, 1e30])
def test_a_load_beyond_any_modulus_is_refused_before_it_overflows(load_N, tilting):
    face = elastic_face(rough(), E)
    with pytest.raises(ContactError, match="more than all of the face bears at 1000 times its mod"):
        press_balanced(face, load_N) if tilting else press(face, load_N=load_N)


@pytest.mark.long
def test_coarse_contacts_are_reported():
    coarse = boundary_elements(rough((120, 120), smooth=2.0), E)
    codes = {problem.code for problem in coarse.problems(100.0)}
    assert "under_resolved" in codes
    assert coarse.pressed(100.0).pixels_across < 10
    fine = {problem.code for problem in boundary_elements(sphere(30)[0], E).problems(hertz_load())}
    assert "under_resolved" not in fine


def test_a_coarser_face_has_the_means_of_the_known_points(monkeypatch):
    values = np.arange(42.0).reshape(6, 7)
    known = np.ones((6, 7), dtype=bool)
    known[:2, :2] = known[2, 2] = False
    size_m = (1e-5, 1e-5)
    face = replace(
        elastic_face(HeightMap(np.zeros((6, 7)), size_m), E), depth_m=values, measured=known
    )
    monkeypatch.setattr(elastic_faces, "_COARSEST", 3)
    mean, some = face.coarser.depth_m, face.coarser.measured
    assert mean.shape == some.shape == (3, 4)
    assert not some[0, 0]
    assert np.count_nonzero(some) == 11
    assert mean[0, 0] == 0.0
    assert mean[1, 1] == pytest.approx(values[2:4, 2:4][known[2:4, 2:4]].mean())
    assert mean[2, 3] == pytest.approx(values[4:6, 6].mean())


def test_between_rows_far_apart_nothing_leaves_them():
    """Where the last of the load goes over a long way, a force above mu N was read off once."""
    from capslip.contact.map_curve import _proportional

    withdrawal_m = np.array([1e-9, 2e-9, 2.3e-8, 2.8e-8, 4.1e-8])
    drop_N = np.array([1.0, 1.9, 6.6145, 6.6147, 6.6151])
    x = np.geomspace(1e-11, 4.1e-8, 400)
    y = _proportional(x, withdrawal_m, drop_N)
    assert (np.diff(y) > 0.0).all()
    assert y[-1] == pytest.approx(drop_N[-1], rel=1e-15)
    small = x < withdrawal_m[0]
    np.testing.assert_allclose(y[small], 1e9 * x[small], rtol=1e-12)
    cubic = _proportional(x, withdrawal_m, withdrawal_m**3, power=3)
    np.testing.assert_allclose(cubic, x**3, rtol=1e-12)


@pytest.mark.parametrize("power", [1, 3])
def test_between_solved_loads_a_power_law_holds_and_below_them_the_one_of_the_first(power):
    xs, ys = np.array([2.0, 8.0, 16.0]), np.array([5.0, 40.0, 50.0])
    x = np.array([0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 99.0])
    expected = [0.0, 5.0 / 2**power, 5.0, np.sqrt(5.0 * 40.0), 40.0, 50.0, 50.0]
    assert _proportional(x, xs, ys, power) == pytest.approx(expected, rel=1e-12)
