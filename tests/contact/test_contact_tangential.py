"""The direct solution under shear against closed forms, dense matrices and the theorem."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.contact.material import composite
from capslip.contact.solvers.half_space import love_kernel
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.errors import ContactError, SettingsError
from capslip.studies.theorem import tangential
from capslip.studies.theorem.cerruti import ShearedHalfSpace, cerruti_kernels
from capslip.studies.theorem.tangential import shear
from capslip.surface.heightmap import HeightMap

MU = 0.2
TURNED = 0.6 + 0.8j  # a direction that is no axis of the map


def joint(nu):
    """Equal bodies of the same composite modulus, whatever Poisson's ratio."""
    return composite((2 * (1 - nu**2) * 110e9,) * 2, (nu, nu))


def pressed(surface, load_N):
    return press(elastic_face(surface, 110e9), load_N=load_N, tolerance=1e-11)


def sphere(n_radius=24, contact_m=2e-3, radius_m=20.0):
    """Face, load and contact radius, with `n_radius` pixels a contact radius."""
    dx, n = contact_m / n_radius, int(1.3 * n_radius)
    x = (np.arange(2 * n) - n + 0.5) * dx
    surface = HeightMap(-(x**2 + x[:, None] ** 2) / (2 * radius_m), (dx, dx))
    return surface, 4 / 3 * 110e9 * contact_m**3 / radius_m


def waves(shape=(72, 90), seed=5):
    """Face of several contacts on pixels that are not square."""
    from scipy.ndimage import gaussian_filter

    noise = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), 5)
    return HeightMap(4e-7 * noise / noise.std(), (1.2e-4, 1e-4))


def dense(surface, contact, nu):
    """Matrix of complex displacements under the real and the imaginary traction of each pixel."""
    j = joint(nu)
    xx, xy, yy = cerruti_kernels(surface.shape, surface.pixel_size_m, j.E_star_Pa, j.kappa)
    row, column = (index.flat[contact] for index in np.indices(surface.shape))
    dy, dx = row[:, None] - row, column[:, None] - column
    at = abs(dy), abs(dx)
    across = np.sign(dy) * np.sign(dx) * xy[at]
    return xx[at] + 1j * across, across + 1j * yy[at]


def test_kernels_are_the_integrals_over_a_pixel():
    from scipy.integrate import dblquad

    dy, dx, kappa = 2.0, 1.0, 1.2143
    kernels = cerruti_kernels((4, 5), (dy, dx), 110e9, kappa)
    # x^2/r^3, x y/r^3 and y^2/r^3 from the nearest to the farthest pixel
    for i, j in ((0, 1), (1, 0), (1, 1), (2, 3), (3, 4)):
        for kernel, power in zip(kernels, ((2, 0), (1, 1), (0, 2)), strict=True):
            own = power != (1, 1)

            def point(y, x, i=i, j=j, own=own, power=power):
                x, y = x - j * dx, y - i * dy
                r = np.hypot(x, y)
                return own / r + 2 * (kappa - 1) * x ** power[0] * y ** power[1] / r**3

            integral, _ = dblquad(point, -dx / 2, dx / 2, -dy / 2, dy / 2, epsabs=1e-12)
            assert kernel[i, j] == pytest.approx(integral / (np.pi * 110e9), rel=1e-9, abs=1e-24)


def test_kernels_far_away_and_without_poissons_effect():
    xx, xy, yy = cerruti_kernels((400, 300), (1.0, 1.0), 1.0, 1.2143)
    x, y = 299.0, 399.0
    r = np.hypot(x, y)
    for kernel, extra in ((xx, x * x), (xy, x * y), (yy, y * y)):
        own = 0 if kernel is xy else 1 / r
        assert kernel[-1, -1] == pytest.approx((own + 0.4286 * extra / r**3) / np.pi, rel=1e-5)
    xx, xy, yy = cerruti_kernels((5, 7), (1.2, 1.0), 1.0, 1.0)
    assert np.allclose(xx, love_kernel((5, 7), (1.2, 1.0), 1.0), rtol=1e-13)
    assert np.allclose(xx, yy, rtol=1e-13)
    assert not xy.any()


def test_displacement_is_the_dense_product_without_periodic_images():
    surface, j = waves((13, 17)), joint(0.3)
    q = np.random.default_rng(0).standard_normal((2, *surface.shape))
    by_x, by_y = dense(surface, np.arange(surface.height_m.size), 0.3)
    expected = (by_x @ q[0].ravel() + by_y @ q[1].ravel()).reshape(surface.shape)
    half_space = ShearedHalfSpace(surface.shape, surface.pixel_size_m, j.E_star_Pa, j.kappa)
    found = half_space.displacement_m(q[0] + 1j * q[1])
    assert np.allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    norm = np.linalg.norm(found) / np.linalg.norm(q)
    assert norm <= half_space.greatest_compliance_m_per_Pa


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_without_poissons_effect_the_theorem_is_exact(share):
    surface, load_N = waves(), 200.0
    loaded, lower = pressed(surface, load_N), pressed(surface, (1 - share) * load_N)
    assert len(loaded.region_loads_N) >= 5
    sheared = shear(loaded, joint(0.0), MU, share * MU * load_N * TURNED, tolerance=1e-11)
    withdrawn_m = loaded.approach_m - lower.approach_m
    assert sheared.displacement_m == pytest.approx(MU * withdrawn_m * TURNED, rel=1e-9)
    # By Betti's theorem, as in `unloading`
    dy_m, dx_m = surface.pixel_size_m
    gap_m = np.where(lower.pressure_Pa > 0, 0.0, lower.gap_m)
    loss_J = 4 * MU**2 * (loaded.pressure_Pa * gap_m).sum() * dy_m * dx_m
    assert 4 * sheared.work_J == pytest.approx(loss_J, rel=1e-7)
    difference_Pa = MU * (loaded.pressure_Pa - lower.pressure_Pa) * TURNED
    assert np.allclose(sheared.traction_Pa, difference_Pa, atol=1e-5 * np.abs(difference_Pa).max())


@pytest.mark.parametrize("share", [0.2, 0.6, 0.9])
def test_one_sphere_is_that_of_cattaneo_and_mindlin(share):
    # Their tractions have no y-component and so slip a little off their direction.
    n_radius, contact_m = 40, 2e-3
    surface, load_N = sphere(n_radius, contact_m)
    force_N = share * MU * load_N
    sheared = shear(pressed(surface, load_N), joint(0.3), MU, force_N)
    total_slip_m = MU * joint(0.3).kappa * contact_m**2 / 20.0
    rest = 1 - share
    assert sheared.displacement_m.real == pytest.approx(
        total_slip_m * (1 - rest ** (2 / 3)), rel=1.5e-3
    )
    stick_m = np.sqrt(np.count_nonzero(sheared.sticking) / np.pi) * contact_m / n_radius
    assert stick_m == pytest.approx(contact_m * rest ** (1 / 3), abs=0.5 * contact_m / n_radius)
    q = np.cbrt(rest)
    energy_J = 0.8 * MU * load_N * total_slip_m * (1 - q) ** 3 * (1 + 3 * q + q**2)
    assert 4 * sheared.work_J == pytest.approx(energy_J, rel=0.01)


@pytest.mark.parametrize("along", [1.0, 1j, TURNED])
@pytest.mark.parametrize("nu", [0.3, 0.45])
def test_an_ellipse_that_sticks_has_its_compliance_in_each_direction(along, nu):
    # Under q = T / (2 pi a b sqrt(1 - x^2/a^2 - y^2/b^2)) the whole ellipse moves by what its
    # centre does: the kernel over r, once around. Over that of kappa = 1, which the pixels share.
    a, b, dx = 2e-3, 2e-3 / 3, 2e-3 / 60
    x, y = (np.arange(132) - 65.5) * dx, (np.arange(48)[:, None] - 23.5) * dx
    pressure_Pa = np.where((x / a) ** 2 + (y / b) ** 2 < 1, 1e6, 0.0)
    load_N = float(pressure_Pa.sum() * dx**2)
    surface = HeightMap(np.zeros(pressure_Pa.shape), (dx, dx))
    punch = replace(pressed(surface, load_N), pressure_Pa=pressure_Pa, load_N=load_N)
    force_N = 0.02 * MU * load_N * along

    theta = np.linspace(0, 2 * np.pi, 4001)[:-1]
    weight = 1 / np.hypot(np.cos(theta) / a, np.sin(theta) / b)
    extra = 2 * (joint(nu).kappa - 1)
    xx = (weight * (1 + extra * np.cos(theta) ** 2)).sum() / weight.sum()
    yy = (weight * (1 + extra * np.sin(theta) ** 2)).sum() / weight.sum()

    found = shear(punch, joint(nu), MU, force_N)
    alone = shear(punch, joint(0.0), MU, force_N).displacement_m / along
    assert found.sticking.sum() == np.count_nonzero(pressure_Pa)
    expected = complex(xx * np.real(along), yy * np.imag(along)) * alone.real
    assert found.displacement_m == pytest.approx(expected, rel=5e-4)
    assert xx > 1.05 * yy


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_coulombs_law_with_dense_matrices(share):
    surface, load_N = waves(), 200.0
    loaded = pressed(surface, load_N)
    sheared = shear(loaded, joint(0.45), MU, share * MU * load_N * TURNED, tolerance=1e-9)
    contact = np.flatnonzero(loaded.pressure_Pa)
    q, bound = sheared.traction_Pa.flat[contact], MU * loaded.pressure_Pa.flat[contact]
    assert not np.delete(sheared.traction_Pa.ravel(), contact).any()
    assert np.abs(q).max() <= bound.max()
    assert (np.abs(q) <= bound * (1 + 1e-12)).all()
    dy_m, dx_m = surface.pixel_size_m
    assert q.sum() * dy_m * dx_m == pytest.approx(sheared.force_N, rel=1e-10)
    by_x, by_y = dense(surface, contact, 0.45)
    slip = sheared.displacement_m - (by_x @ q.real + by_y @ q.imag)
    assert np.allclose(slip, sheared.slip_m.flat[contact], atol=1e-12 * np.abs(slip).max())
    sticks = np.abs(q) < bound * (1 - 1e-9)
    delta_m = abs(sheared.displacement_m)
    assert 0 < sticks.sum() < len(sticks)
    assert (bound * np.abs(slip))[sticks].sum() <= 1e-7 * delta_m * bound.sum()
    along = slip * (q / np.abs(q)).conj()
    assert (bound * np.abs(along.imag))[~sticks].sum() <= 1e-6 * delta_m * bound.sum()
    assert (along.real[~sticks] >= -1e-6 * delta_m).all()


def test_turning_face_and_force_turns_the_answer():
    surface, load_N = waves(), 200.0
    dy_m, dx_m = surface.pixel_size_m
    turned = HeightMap(surface.height_m[::-1].T, (dx_m, dy_m))
    force_N = 0.5 * MU * load_N * TURNED
    one = shear(pressed(surface, load_N), joint(0.3), MU, force_N, tolerance=1e-10)
    other = shear(pressed(turned, load_N), joint(0.3), MU, 1j * force_N, tolerance=1e-10)
    assert other.displacement_m == pytest.approx(1j * one.displacement_m, rel=1e-8)
    assert other.work_J == pytest.approx(one.work_J, rel=1e-6)
    expected_Pa = 1j * one.traction_Pa[::-1].T
    assert np.allclose(other.traction_Pa, expected_Pa, atol=1e-4 * np.abs(expected_Pa).max())
    back = shear(pressed(surface, load_N), joint(0.3), MU, -force_N, tolerance=1e-10)
    assert back.displacement_m == pytest.approx(-one.displacement_m, rel=1e-8)
    # The face has no symmetry: at right angles it is another joint
    across = shear(pressed(surface, load_N), joint(0.3), MU, 1j * force_N)
    assert abs(across.displacement_m / (1j * one.displacement_m) - 1) > 1e-3


def test_the_work_is_what_the_displacement_says():
    # D = T delta - 2 * integral of delta dT, so 4 D is the area of Masing's loop
    surface, load_N = waves(), 200.0
    loaded, force_N = pressed(surface, load_N), 0.8 * MU * load_N
    nodes, weights = np.polynomial.legendre.leggauss(6)
    delta_m = [
        shear(loaded, joint(0.45), MU, force_N * (1 + t) / 2).displacement_m.real for t in nodes
    ]
    end = shear(loaded, joint(0.45), MU, force_N)
    work_J = force_N * (end.displacement_m.real - float(weights @ delta_m))
    assert end.work_J == pytest.approx(work_J, rel=2e-3)


@pytest.mark.parametrize(("nu", "enough"), [(0.0, 1e-6), (0.3, 1e-3)])
def test_a_cycle_in_steps_loses_four_times_the_first_work(nu, enough):
    surface, load_N = sphere()
    loaded, force_N = pressed(surface, load_N), 0.7 * MU * load_N
    first = shear(loaded, joint(nu), MU, force_N, tolerance=1e-10)
    state, work_J = first, 0.0
    for share in (0.5, 0.0, -0.5, -1.0, -0.5, 0.0, 0.5, 1.0):
        state = shear(loaded, joint(nu), MU, share * force_N, since=state, tolerance=1e-10)
        work_J += state.work_J
        if share == -1.0:
            assert state.displacement_m == pytest.approx(-first.displacement_m, rel=enough)
    assert work_J == pytest.approx(4 * first.work_J, rel=enough)
    assert state.displacement_m == pytest.approx(first.displacement_m, rel=enough)


def test_gross_slip_is_reached_and_not_passed():
    surface, load_N = waves(), 200.0
    loaded = pressed(surface, load_N)
    almost = shear(loaded, joint(0.0), MU, (1 - 1e-6) * MU * load_N)
    assert np.count_nonzero(almost.sticking) < 0.01 * np.count_nonzero(loaded.pressure_Pa)
    assert almost.displacement_m.real == pytest.approx(MU * loaded.approach_m, rel=1e-3)
    turned = shear(loaded, joint(0.3), MU, (1 - 1e-6) * MU * load_N)
    where = turned.traction_Pa != 0
    assert np.allclose(np.abs(turned.traction_Pa), MU * loaded.pressure_Pa, rtol=1e-2)
    assert np.abs(np.angle(turned.traction_Pa[where])).max() < 0.02
    for force_N in (MU * load_N, -2j * MU * load_N):
        with pytest.raises(ContactError, match="friction holds"):
            shear(loaded, joint(0.3), MU, force_N)


def test_nonsense_is_one_clear_error():
    surface, load_N = sphere(8)
    loaded = pressed(surface, load_N)
    for force_N in (np.nan, np.inf, complex(0, np.nan), 0.0):
        with pytest.raises(ContactError, match="friction holds"):
            shear(loaded, joint(0.3), MU, force_N)
    for mu in (0.0, -0.1, np.nan, np.inf):
        with pytest.raises(SettingsError, match="friction_coefficient"):
            shear(loaded, joint(0.3), mu, 1.0)
    with pytest.raises(SettingsError, match="tolerance"):
        shear(loaded, joint(0.3), MU, 1.0, tolerance=0.0)
    other = shear(pressed(*sphere(9)), joint(0.3), MU, 1.0)
    with pytest.raises(SettingsError, match="same pressed face"):
        shear(loaded, joint(0.3), MU, 1.0, since=other)
    near_slip = shear(loaded, joint(0.3), MU, 0.9 * MU * load_N)
    with pytest.raises(SettingsError, match="same pressed face"):
        shear(pressed(surface, load_N / 2), joint(0.3), MU, 1.0, since=near_slip)


def test_nothing_is_returned_without_a_certificate(monkeypatch):
    surface, load_N = sphere()
    loaded = pressed(surface, load_N)
    monkeypatch.setattr(tangential, "_MAX_ITERATIONS", 3)
    with pytest.raises(ContactError, match="Coulomb"):
        shear(loaded, joint(0.3), MU, 0.5 * MU * load_N)
