"""What preconditions the pressing of maps: symmetric, positive, and near the inverse."""

import numpy as np
import pytest

from capslip.contact.solvers.half_space import HalfSpace, love_kernel
from capslip.contact.solvers.patches import PatchedFace, patched
from capslip.contact.solvers.pixels import around_contact, in_contact_alone
from capslip.contact.solvers.polonsky_keer import elastic_face
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
