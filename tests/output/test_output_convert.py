"""The face in files of other programs: read back, by other readers, to the numbers of the result.

VTK reads what VTK can; X3P and CSV go through the readers of scans; OBJ is read line by line.
"""

import errno
import json
import os

import h5py
import numpy as np
import output_cases
import pytest
from click.testing import CliRunner

from capslip import registry
from capslip.cli import main
from capslip.errors import OutputError, SettingsError
from capslip.output.convert import FOLDER, export_result
from capslip.output.tables import write_result, write_summary
from capslip.surface.readers import load_surface

SINGLE = 1e-7  # of 32 bits


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("result") / "lap"
    folder.mkdir()
    analysis = output_cases.several()  # a corner of its face is not measured
    write_result(analysis, folder)
    write_summary(analysis.summary(), folder)
    return folder


@pytest.fixture(scope="module")
def stored(result):
    with h5py.File(result / "result.h5") as file:
        height = file["surface/height_m"]
        return height[:].astype(float), tuple(height.attrs["pixel_size_m"])


def through_vtk(path):
    import pyvista

    return pyvista.read(path)


def through_lines(path):
    """Read corners and faces of an OBJ file as its definition has them."""
    import pyvista

    rows = [line.split() for line in path.read_text("utf-8").splitlines()]
    points = np.array([row[1:4] for row in rows if row and row[0] == "v"], dtype=float)
    faces = np.array([row[1:] for row in rows if row and row[0] == "f"], dtype=int) - 1
    cells = np.hstack([np.full((len(faces), 1), faces.shape[1]), faces])
    return pyvista.PolyData(points, cells)


def through_xml(path):
    """Read an XDMF file as its definition has it: numbers as text below named items."""
    from xml.etree import ElementTree

    import pyvista

    grid = ElementTree.parse(path).getroot().find(".//Grid")
    items = [grid.find(f"{name}/DataItem") for name in ("Geometry", "Topology", "Attribute")]
    points, cells, height_m = (
        np.array(item.text.split(), dtype=float).reshape(
            [int(n) for n in item.get("Dimensions").split()]
        )
        for item in items
    )
    np.testing.assert_array_equal(height_m.ravel(), points[:, 2])
    cells = np.hstack([np.full((len(cells), 1), 4), cells]).astype(int)
    return pyvista.PolyData(points, cells)


READ = {
    "vtu": (through_vtk, 1e-15),
    "ply": (through_vtk, SINGLE),  # VTK keeps single precision of it
    "stl": (through_vtk, SINGLE),
    "obj": (through_lines, 1e-15),
    "xdmf": (through_xml, 1e-15),
}


def test_every_format_is_read_back_by_a_test():
    assert set(registry.names(FOLDER)) == {*READ, "x3p", "csv", "gwy"}


@pytest.mark.long
@pytest.mark.parametrize("name", READ)
def test_a_mesh_reads_back_to_the_same_face(name, result, stored, tmp_path):
    height_m, (dy_m, dx_m) = stored
    read, within = READ[name]
    path, left_out = export_result(result, name, tmp_path / f"a.{name}")
    assert left_out is None
    mesh = read(path)
    x_m, y_m, z_m = np.asarray(mesh.points, dtype=float).T
    row, col = np.rint(y_m / dy_m - 0.5).astype(int), np.rint(x_m / dx_m - 0.5).astype(int)
    np.testing.assert_allclose(x_m, (col + 0.5) * dx_m, rtol=within)
    np.testing.assert_allclose(y_m, (row + 0.5) * dy_m, rtol=within)
    np.testing.assert_allclose(z_m, height_m[row, col], rtol=within)
    assert len(set(zip(row.tolist(), col.tolist(), strict=True))) == np.isfinite(height_m).sum()
    surface = mesh.extract_surface(algorithm=None) if name == "vtu" else mesh
    measured = np.isfinite(height_m)
    full = measured[1:, 1:] & measured[1:, :-1] & measured[:-1, 1:] & measured[:-1, :-1]
    assert surface.n_cells == full.sum() * (2 if name == "stl" else 1)
    assert surface.area == pytest.approx(full.sum() * dy_m * dx_m, rel=1e-4)
    normals = surface.compute_normals(
        cell_normals=True, point_normals=False, consistent_normals=False
    )
    assert normals.cell_data["Normals"][:, 2].min() > 0.9  # out of the material


@pytest.mark.parametrize("name", ["x3p", "csv", "gwy"])
def test_a_map_reads_back_to_the_same_map(name, result, stored, tmp_path):
    height_m, pixel_size_m = stored
    path, left_out = export_result(result, name, tmp_path / f"a.{name}", max_cells=10)
    assert left_out is None  # a map is whole, whatever its size
    again = load_surface(path)  # which asks for no unit
    np.testing.assert_array_equal(again.height_m, height_m)
    np.testing.assert_allclose(again.pixel_size_m, pixel_size_m, rtol=1e-12)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["x3p", "gwy"])
def test_another_library_reads_the_same_map(name, result, stored, tmp_path):
    """SurfaceTopography has readers of its own for both."""
    topography = pytest.importorskip("SurfaceTopography")
    height_m, (dy_m, dx_m) = stored
    path, _ = export_result(result, name, tmp_path / f"a.{name}")
    found = topography.open_topography(str(path)).topography()
    assert found.unit == "m"
    ny, nx = height_m.shape
    assert found.physical_sizes == pytest.approx((nx * dx_m, ny * dy_m))
    again_m = np.ma.filled(np.ma.masked_invalid(found.heights()), np.nan).T  # x first
    np.testing.assert_array_equal(again_m[:: -1 if name == "gwy" else 1], height_m)


def test_a_larger_face_is_thinned_and_that_is_said(result, stored, tmp_path):
    height_m, (dy_m, dx_m) = stored
    path, left_out = export_result(result, "vtu", tmp_path / "a.vtu", max_cells=500)
    x_m, y_m, z_m = through_vtk(path).points.T
    row, col = np.rint(y_m / dy_m - 0.5).astype(int), np.rint(x_m / dx_m - 0.5).astype(int)
    np.testing.assert_array_equal(z_m, height_m[row, col])
    ny, nx = height_m.shape
    assert f"of {ny} x {nx} points" in left_out


def test_the_command_names_its_file(result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, ["export", str(result), "--to", "ply"])
    assert (done.exit_code, done.stdout.strip(), done.stderr) == (0, "lap.ply", "")
    assert [path.name for path in tmp_path.iterdir()] == ["lap.ply"]


def test_nothing_is_written_over_and_nothing_is_left_behind(result, tmp_path):
    path = tmp_path / "a.x3p"
    path.write_text("mine", "utf-8")
    with pytest.raises(OutputError, match="exists already"):
        export_result(result, "x3p", path)
    assert path.read_text("utf-8") == "mine"
    with pytest.raises(OutputError, match=r"got \.stl; expected \.x3p"):
        export_result(result, "x3p", tmp_path / "a.stl")
    with pytest.raises(OutputError, match="no such folder"):
        export_result(result, "x3p", tmp_path / "none" / "a.x3p")
    with pytest.raises(SettingsError, match="expected one of csv, gwy, obj"):
        export_result(result, "dxf", tmp_path / "a.dxf")
    assert [one.name for one in tmp_path.iterdir()] == ["a.x3p"]


@pytest.mark.parametrize(
    ("number", "step"),
    [
        (errno.EDQUOT, "make room on its disk, or give another name"),
        (errno.EIO, "give another name"),
    ],
)
def test_a_full_disk_is_told_as_one(result, tmp_path, monkeypatch, number, step):
    def half(_, path):
        path.write_bytes(b"half")
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("capslip.output.formats.csv.write", half)
    with pytest.raises(OutputError) as error:
        export_result(result, "csv", tmp_path / "a.csv")
    assert str(error.value) == f"{tmp_path / 'a.csv'}: {os.strerror(number)}; {step}"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", ["empty", "batch", "none.h5", "other.h5", "text.h5"])
def test_a_wrong_place_is_one_clear_line(wrong, tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "batch").mkdir()
    (tmp_path / "batch" / "batch.csv").write_text("scan\n", "utf-8")
    (tmp_path / "text.h5").write_text(json.dumps({}), "utf-8")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["z"] = np.zeros(3)
    done = CliRunner().invoke(main, ["export", str(tmp_path / wrong), "--to", "stl"])
    assert done.exit_code not in (0, 1)
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("error: ")
    assert "expected the folder that" in line


def test_a_result_of_several_scans_is_told_to_have_no_face(tmp_path):
    (tmp_path / "summary.json").write_text(json.dumps({"scans": [{}, {}]}), "utf-8")
    for command in (["export", "--to", "stl"], ["inspect", "--screenshot", "picture.png"]):
        done = CliRunner().invoke(main, [command[0], str(tmp_path), *command[1:]])
        assert done.exit_code == 2
        (line,) = done.stderr.strip().splitlines()
        assert line.startswith(f"error: {tmp_path}: a result without a face")
        assert line.endswith("of one scan")


def test_a_face_without_neighbouring_points_has_no_mesh(result, tmp_path):
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "result.h5").write_bytes((result / "result.h5").read_bytes())
    with h5py.File(broken / "result.h5", "r+") as file:
        file["surface/height_m"][:, ::2] = np.nan
    with pytest.raises(OutputError, match="no four neighbouring points"):
        export_result(broken, "stl", tmp_path / "a.stl")


@pytest.mark.filterwarnings("ignore")
def test_gwyddion_gets_the_map_its_mask_and_the_hills(result, stored, tmp_path):
    """Another library's reader: columns first, the top row last."""
    topography = pytest.importorskip("SurfaceTopography")
    height_m, (dy_m, dx_m) = stored
    path, _ = export_result(result, "gwy", tmp_path / "a.gwy")
    face = topography.read_topography(path)
    again_m = np.ma.filled(face.heights(), np.nan).T[::-1]
    np.testing.assert_array_equal(again_m, height_m)
    ny, nx = height_m.shape
    assert face.unit == "m"
    assert face.physical_sizes == pytest.approx((nx * dx_m, ny * dy_m))
    with h5py.File(result / "result.h5") as file:
        label = file["hills/labels"][:]
    content = path.read_bytes()
    of_hills = content[content.index(b"/1/data\0") :]
    at = of_hills.index(b"data\0D", 8) + 10
    values = np.frombuffer(of_hills[at : at + 8 * label.size], "<f8").reshape(label.shape)
    np.testing.assert_array_equal(values[::-1], label)
