"""What preconditions the pressing of maps: symmetric, positive, and near the inverse."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.contact.solvers import pixels, rough_inverse
from capslip.contact.solvers.half_space import ChangedHalfSpace, HalfSpace, love_kernel
from capslip.contact.solvers.patches import PatchedFace, patched
from capslip.contact.solvers.pixels import around_contact, in_contact_alone
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.surface.heightmap import HeightMap

SHAPE, SIZE_M, E = (23, 34), (1e-4, 1.5e-4), 110e9


def matrix_m_per_Pa(points):
    """Return the sinking of points under unit pressures on each of them, from the kernel."""
    row, column = np.unravel_index(points, SHAPE)
    kernel = love_kernel(SHAPE, SIZE_M, E)
    return kernel[np.abs(row[:, None] - row), np.abs(column[:, None] - column)]


def some_points(share):
    return np.flatnonzero(np.random.default_rng(3).random(SHAPE) < share)


def inverse_on(points):
    """Return the rough inverse as a matrix, column by column."""
    half_space = HalfSpace(SHAPE, SIZE_M, E)
    return np.array([half_space.pressure_Pa(unit, points) for unit in np.eye(len(points))]).T


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 1.0])
def test_the_rough_inverse_is_symmetric_and_positive(share):
    inverse = inverse_on(some_points(share))
    scale = np.abs(inverse).max()
    np.testing.assert_allclose(inverse, inverse.T, atol=1e-5 * scale)
    assert np.linalg.eigvalsh(inverse + inverse.T).min() > 0.0


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_products_of_matrices_invert_as_transforms_do(share, monkeypatch):
    points = some_points(share)
    found = inverse_on(points)
    monkeypatch.setattr(rough_inverse, "MOST_BY_PRODUCTS", 0)
    np.testing.assert_allclose(inverse_on(points), found, atol=1e-5 * np.abs(found).max())


@pytest.mark.parametrize(("share", "most"), [(0.05, 2.5), (0.3, 5.0), (1.0, 3.0)])
def test_the_rough_inverse_makes_the_iteration_short(share, most):
    """Its steps go with the root of the condition, which without it is 3, 15 and 47."""
    points = some_points(share)
    product = inverse_on(points) @ matrix_m_per_Pa(points)
    eigenvalue = np.linalg.eigvals(product).real
    condition = eigenvalue.max() / eigenvalue.min()
    assert condition < most


def test_the_work_of_pressures_is_that_of_their_sinking():
    """For one map, for patches that see each other, and for odd and even transforms."""
    rng = np.random.default_rng(5)
    for shape in ((23, 34), (40, 63), (1, 9)):
        half_space, p = HalfSpace(shape, SIZE_M, E), rng.normal(size=shape)
        work, _ = half_space.work(p)
        assert work == pytest.approx(float((p * half_space.sinking_m(p)).sum()), rel=1e-5)
    y, x = np.mgrid[:90, :120]
    contact = ((y - 20) ** 2 + (x - 25) ** 2 < 60) | ((y - 60) ** 2 + (x - 90) ** 2 < 90)
    patches = patched(elastic_face(HeightMap(0.0 * x, SIZE_M), E), contact)
    assert isinstance(patches, PatchedFace)
    p = rng.normal(size=patches.shape)
    work, _ = patches.half_space.work(p)
    assert work == pytest.approx(float(p @ patches.half_space.sinking_m(p)), rel=1e-4)


@pytest.mark.parametrize("share", [0.05, 0.6])
def test_points_of_a_face_work_as_they_do_on_it(share):
    """Few points that are left of those of a matrix, which knows the sinking of all of them."""
    face = elastic_face(HeightMap(np.zeros((60, 80)), SIZE_M), E)
    contact = np.zeros(face.shape, dtype=bool)
    contact[5:15, 5:20] = np.random.default_rng(1).random((10, 15)) < share
    whole = around_contact(face, contact)
    on_contact = whole.gathered(contact.astype(float)) > 0
    few = in_contact_alone(whole, np.where(np.cumsum(on_contact) > 3, on_contact, 0.0))
    assert len(few.depth_m) < len(whole.depth_m)
    p = np.random.default_rng(5).normal(size=few.shape)
    work, sinking_m = few.half_space.work(p)
    assert work == pytest.approx(float(p @ few.half_space.sinking_m(p)), rel=1e-5)
    if sinking_m is not None:
        np.testing.assert_allclose(sinking_m, few.half_space.sinking_m(p), rtol=1e-3)


@pytest.mark.parametrize("shape", [(1, 50000), (9, 6000), (224, 225), (300, 500)])
def test_changes_of_pressures_sink_as_on_the_whole_map_but_for_their_error(shape):
    """Changes that leave the load as it is, as steps do, and such from one end to the other."""
    half_space = HalfSpace(shape, SIZE_M, E)
    changes = ChangedHalfSpace(half_space)
    rng = np.random.default_rng(7)
    scattered = rng.normal(size=shape) * (rng.random(shape) < 0.2)
    ends = np.zeros(shape)
    ends[:, :3], ends[:, -3:] = 1.0, -1.0
    for p in (scattered - scattered.mean(), ends):
        exact_m = half_space.sinking_m(p)
        off_m = changes.sinking_roughly_m(p) - exact_m
        assert np.linalg.norm(off_m) < changes.change_error * np.linalg.norm(exact_m)
        work = float((p * exact_m).sum())
        assert changes.work(p)[0] == pytest.approx(work, rel=changes.change_error)
        assert changes.work(p)[0] == pytest.approx(
            float((p * changes.sinking_roughly_m(p)).sum()), rel=1e-4
        )


@pytest.mark.parametrize("hardness_Pa", [np.inf, 2e8])
def test_a_large_map_is_solved_as_a_small_one_is(monkeypatch, hardness_Pa):
    """Looks at the whole map between steps on some of its points end in the same state."""
    rng = np.random.default_rng(11)
    waves = np.fft.rfft2(rng.normal(size=(180, 300)))
    n = np.hypot(np.fft.fftfreq(180, 1 / 180)[:, None], np.fft.rfftfreq(300, 1 / 300))
    height_m = np.fft.irfft2(waves / np.maximum(n, 6.0) ** 1.8, s=(180, 300))
    surface = HeightMap(2e-7 * height_m / height_m.std(), (1e-6, 1e-6))
    found = []
    for large in (pixels._LARGE, 10**9):
        monkeypatch.setattr(pixels, "_LARGE", large)
        face = replace(elastic_face(surface, E), hardness_Pa=hardness_Pa)
        found.append(press(face, load_N=0.1, tolerance=1e-8))
    some, whole = found
    assert some.certificate.complementarity < 1e-8
    assert some.certificate.least_gap > -1e-8
    assert some.approach_m == pytest.approx(whole.approach_m, rel=1e-7)
    off_Pa = np.abs(some.pressure_Pa - whole.pressure_Pa)
    assert off_Pa.sum() < 1e-4 * whole.pressure_Pa.sum()
