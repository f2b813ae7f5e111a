"""Meshes: geometry against closed forms, and the files."""

import numpy as np
import pytest

from capslip.output.mesh import cap_mesh, face_mesh, write_meshes
from capslip.output.vtu import write_vtu


def triangle_vectors(points, cells):
    a, b, c = (points[cells[:, i]] for i in range(3))
    return np.cross(b - a, c - a) / 2


def quad_area_xy(points, cells):
    x, y = points[cells, 0], points[cells, 1]
    return 0.5 * abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(1))


def test_face_points_are_the_pixel_centres():
    height_m = np.arange(12.0).reshape(3, 4) * 1e-6
    points, cells = face_mesh(height_m, (2e-3, 1e-3))
    assert len(cells) == 6
    np.testing.assert_allclose(points[0], (0.5e-3, 1e-3, 0.0))
    np.testing.assert_allclose(points[-1], (3.5e-3, 5e-3, 11e-6))
    np.testing.assert_array_equal(points[:, 2], height_m.ravel())


def test_non_measured_point_takes_its_four_cells_and_itself():
    height_m = np.zeros((6, 7))
    height_m[2, 3] = np.nan
    points, cells = face_mesh(height_m, (1.0, 1.0))
    assert len(cells) == 5 * 6 - 4
    assert len(points) == 6 * 7 - 1
    assert np.isfinite(points).all()
    assert quad_area_xy(points, cells).sum() == pytest.approx(5 * 6 - 4)


def test_nothing_measured_is_an_empty_mesh():
    points, cells = face_mesh(np.full((4, 4), np.nan), (1.0, 1.0))
    assert points.shape == (0, 3)
    assert cells.shape == (0, 4)


@pytest.mark.parametrize("shape", [(800, 1200), (4000, 30), (3, 20000), (641, 377)])
def test_thinned_face_is_bounded_and_keeps_area_and_heights(shape):
    height_m = np.random.default_rng(0).normal(size=shape)
    points, cells = face_mesh(height_m, (1e-3, 2e-3), max_cells=5000)
    assert 1000 < len(cells) <= 6000
    area = (shape[0] - 1) * 1e-3 * (shape[1] - 1) * 2e-3
    assert quad_area_xy(points, cells).sum() == pytest.approx(area)
    rows, cols = (
        np.rint(points[:, i] / size - 0.5).astype(int) for i, size in ((1, 1e-3), (0, 2e-3))
    )
    np.testing.assert_array_equal(points[:, 2], height_m[rows, cols])


@pytest.mark.parametrize(
    ("diameter", "height"), [(1.6e-2, 1.7e-6), (2.0, 0.5), (2.0, 1.0), (2.0, 1.5)]
)
def test_cap_points_lie_on_the_sphere_of_equation_18(diameter, height):
    radius = (diameter**2 / 4 + height**2) / (2 * height)
    points, cells, cap = cap_mesh(*(np.array([v]) for v in (3.0, -2.0, 7e-6, height, diameter)))
    x, y, z = (points - (3.0, -2.0, 7e-6)).T
    # x^2 + y^2 + (z + R)^2 = R^2 without its cancellation
    np.testing.assert_allclose(x**2 + y**2, -z * (2 * radius + z), rtol=1e-7, atol=1e-18)
    assert z.max() == 0.0
    assert z.min() == pytest.approx(-height, rel=1e-6)
    lowest = z <= z.min() * (1 - 1e-6)
    np.testing.assert_allclose(np.hypot(x, y)[lowest], diameter / 2)
    assert lowest.sum() == 48
    assert (cap == 0).all()
    vectors = triangle_vectors(points, cells)
    middle = points[cells].mean(axis=1) - (3.0, -2.0, 7e-6 - radius)
    assert ((vectors * middle).sum(axis=1) > 0).all()  # normals point out of the sphere
    n = 48
    polygon = n / 2 * np.sin(2 * np.pi / n) * diameter**2 / 4
    assert vectors[:, 2].sum() == pytest.approx(polygon, rel=1e-9)
    area = np.linalg.norm(vectors, axis=1).sum()
    assert area == pytest.approx(2 * np.pi * radius * height, rel=0.02)


@pytest.mark.parametrize("n", [1, 50, 3000])
def test_cap_cells_are_bounded_and_caps_do_not_share_points(n):
    rng = np.random.default_rng(n)
    columns = rng.uniform(1e-3, 2e-3, (5, n))
    points, cells, cap = cap_mesh(*columns, max_cells=20_000)
    assert len(cells) <= max(20_000, 6 * n)
    assert len(cells) >= 6 * n
    assert (cap[cells] == cap[cells[:, :1]]).all()
    top = np.full(n, -np.inf)
    np.maximum.at(top, cap, points[:, 2])
    np.testing.assert_allclose(top, columns[2])


def test_files_hold_the_caps_and_the_face(several, tmp_path):
    import meshio

    paths = write_meshes(several, tmp_path)
    assert sorted(path.name for path in paths) == ["caps.vtu", "surface.vtu"]
    face = meshio.read(tmp_path / "surface.vtu")
    surface = several.conditioned.surface
    np.testing.assert_array_equal(face.point_data["height_m"], face.points[:, 2])
    assert np.ptp(face.points[:, 0]) == pytest.approx(surface.side_m[1] - surface.pixel_size_m[1])
    assert len(face.points) == surface.measured.sum()

    mesh = meshio.read(tmp_path / "caps.vtu")
    caps = several.caps
    cap = mesh.cell_data["cap"][0]
    assert set(cap) == set(np.flatnonzero(caps.usable) + 1)
    np.testing.assert_allclose(mesh.cell_data["radius_m"][0], caps.radius_m[cap - 1])
    np.testing.assert_allclose(mesh.cell_data["load_N"][0], caps.load_N[cap - 1])
    code = mesh.cell_data["family"][0]
    np.testing.assert_array_equal(np.array(["", "P", "G"])[code], caps.family[cap - 1])
    lowest = np.full(len(caps), np.inf)
    np.minimum.at(lowest, mesh.point_data["cap"] - 1, mesh.point_data["height_m"])
    np.testing.assert_allclose(lowest, several.hills.cut_height_m, atol=1e-15)


def test_vtk_reads_what_was_written(tmp_path):
    import pyvista

    rng = np.random.default_rng(1)
    points = rng.standard_normal((30_000, 3))
    cells = rng.integers(len(points), size=(20_000, 4))
    on_points, on_cells = rng.standard_normal(len(points)), rng.integers(9, size=len(cells))
    write_vtu(tmp_path / "a.vtu", points, cells, {"height_m": on_points}, {"cap": on_cells})
    found = pyvista.read(tmp_path / "a.vtu")
    np.testing.assert_array_equal(found.points, points)
    np.testing.assert_array_equal(found.cells_dict[9], cells)
    np.testing.assert_array_equal(found.point_data["height_m"], on_points)
    np.testing.assert_array_equal(found.cell_data["cap"], on_cells)


def test_without_caps_only_the_face_is_written(none, tmp_path):
    assert [path.name for path in write_meshes(none, tmp_path)] == ["surface.vtu"]
