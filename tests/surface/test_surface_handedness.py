"""One convention for all readers: y grows with the row, and the face is not seen in a mirror."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import netcdf_file
from written import BARE, DX_UM, DY_UM, writers

from capslip.cli import main
from capslip.errors import UncalibratedError, UnreadableFileError
from capslip.surface.mating import composite_surface, place
from capslip.surface.readers import load_surface

CHANNELS = Path(__file__).parents[3] / "shared" / "scans" / "channels"
NAMES = list(writers())
# An F, which looks like itself in no mirror and after no turn; in steps that every format holds.
LETTER = np.array(
    [[1, 0, 0, 0, 0], [1, 0, 0, 0, 0], [1, 1, 1, 0, 0], [1, 0, 0, 0, 0], [1, 1, 1, 1, 0]]
)
Z_UM = np.kron(LETTER, np.ones((2, 3))) + np.arange(150).reshape(10, 15) / 1024


def written(path, z_um=Z_UM):
    write, given = writers()[path.name]
    write(path, z_um)
    return load_surface(path, **given)


def on_one_grid(surface):
    """Return the map on the grid of `Z_UM`; one format knows no pixels that are not square."""
    z_um = 1e6 * surface.height_m
    return z_um[:: round(z_um.shape[0] / Z_UM.shape[0])]


@pytest.mark.parametrize("name", NAMES)
def test_every_format_gives_the_same_array(name, tmp_path):
    surface = written(tmp_path / name)
    np.testing.assert_allclose(on_one_grid(surface), Z_UM, rtol=0, atol=1e-6)
    np.testing.assert_allclose(surface.side_m, (1e-5 * DY_UM, 1.5e-5 * DX_UM), rtol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_a_face_and_its_print_in_another_format_mate(name, tmp_path):
    """What was pressed off a face is its height with the other sign, turned over about y."""
    face = written(tmp_path / "a.h5")
    print_of_it = written(tmp_path / name, -Z_UM[:, ::-1])
    both = composite_surface(face, print_of_it, place(face, print_of_it))
    if print_of_it.shape == face.shape:
        assert np.abs(both.height_m).max() < 1e-11
    else:
        assert np.std(both.height_m) < 0.3 * np.std(face.height_m)
    wrong = composite_surface(face, written(tmp_path / name, -Z_UM[::-1, ::-1]), place(face, face))
    assert np.std(wrong.height_m) > 3.0 * np.std(both.height_m)


@pytest.mark.long
def test_mate_gives_one_composite_whatever_the_formats(tmp_path):
    """Through the command line: the worn print of a face, in formats of both directions."""
    y, x = np.mgrid[:40, :60]
    z_um = np.sin(x / 7) * np.cos(y / 5) + 0.5 * np.sin((x + 2 * y) / 11)
    mate_um = -z_um[:, ::-1] + 0.2 * np.exp(-((x - 20) ** 2 + (y - 12) ** 2) / 60)
    writers()["a.h5"][0](tmp_path / "face.h5", z_um)
    found = {}
    for name in ("a.h5", "a.x3p", "up.sxm", "down.sxm", "a.gwy", "a.sur", "commented.txt"):
        writers()[name][0](tmp_path / name, mate_um)
        out = tmp_path / f"{name} out"
        arguments = ["analyze", str(tmp_path / "face.h5"), "--mate", str(tmp_path / name)]
        options = ["--preload", "1e-4", "--no-figures", "--no-render", "--no-sensitivity"]
        ran = CliRunner().invoke(main, [*arguments, "-o", str(out), *options, "--json"])
        assert (out / "summary.json").is_file(), ran.output
        surface = json.loads((out / "summary.json").read_text())["surface"]
        found[name] = surface["sq_m"], surface["sz_m"]
    for name, values in found.items():
        assert values == pytest.approx(found["a.h5"], rel=1e-4), name


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "five.mat", "seven.mat", "a.csv"])
def test_a_bare_matrix_can_be_said_to_begin_at_the_top(name, tmp_path):
    write, given = writers()[name]
    write(tmp_path / name, Z_UM[::-1])
    surface = load_surface(tmp_path / name, **given, top_row_first=True)
    np.testing.assert_allclose(1e6 * surface.height_m, Z_UM, rtol=1e-12)


@pytest.mark.parametrize(("name", "said"), [("a.x3p", True), ("a.tif", False), ("a.xyz", True)])
def test_where_the_format_says_which_row_is_first_nobody_else_does(name, said, tmp_path):
    write, given = writers()[name]
    write(tmp_path / name, Z_UM)
    with pytest.raises(UncalibratedError, match=r"reading\.top_row_first.*never overridden"):
        load_surface(tmp_path / name, **given, top_row_first=said)


def test_gaps_are_turned_into_heights(tmp_path):
    np.save(tmp_path / "gap.npy", 3.0 - Z_UM)
    surface = load_surface(tmp_path / "gap.npy", **BARE, invert=True)
    np.testing.assert_allclose(1e6 * surface.height_m, Z_UM - 3.0, rtol=1e-12)


@pytest.mark.skipif(not CHANNELS.is_dir(), reason="no folder shared/scans beside the project")
@pytest.mark.scans
def test_a_wave_lies_as_its_own_scaling_says(tmp_path):
    """An Igor wave gives y of its points itself; the same points as XYZ are the same face."""
    igor2 = pytest.importorskip("igor2.binarywave", reason="extra `vendor`", exc_type=ImportError)
    path = CHANNELS / "spot_1-1000nm.ibw"
    wave = igor2.load(str(path))["wave"]
    z = wave["wData"][:, :, 0]
    step_x, step_y = wave["wave_header"]["sfA"][:2]
    assert step_x > 0
    assert step_y > 0
    x, y = np.meshgrid(step_x * np.arange(len(z)), step_y * np.arange(z.shape[1]), indexing="ij")
    np.savetxt(tmp_path / "same.xyz", np.column_stack([x.ravel(), y.ravel(), z.ravel()]))
    points = load_surface(tmp_path / "same.xyz", unit="m", lateral_unit="m")
    np.testing.assert_allclose(load_surface(path).height_m, points.height_m, rtol=1e-12)


@pytest.mark.parametrize("axes", ["xy", "yx"])
@pytest.mark.parametrize("way_x", [1, -1])
@pytest.mark.parametrize("way_y", [1, -1, 0])
def test_netcdf_lies_as_its_own_coordinates_say(tmp_path, way_y, way_x, axes):
    """The same points as XYZ are the same face; without coordinates the first row is the top."""
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    ny, nx = Z_UM.shape
    x, y = DX_UM * np.arange(nx)[::way_x], DY_UM * np.arange(ny)[:: way_y or -1]
    z = Z_UM[:: way_y or -1, ::way_x]
    with netcdf_file(str(tmp_path / "a.nc"), "w") as file:
        for name, values, size in (("x", x, DX_UM * nx), ("y", y, DY_UM * ny)):
            file.createDimension(name, len(values))
            axis = file.createVariable(name, "f8", (name,))
            axis[:] = values if way_y or name == "x" else 0.0
            axis.length, axis.unit = size, "um"
        file.createVariable("heights", "f8", tuple(axes))[:] = z.T if axes == "xy" else z
    points = np.column_stack([np.tile(x, ny), np.repeat(y, nx), z.ravel()])
    np.savetxt(tmp_path / "same.xyz", points)
    surface = load_surface(tmp_path / "a.nc", unit="um", lateral_unit="um")
    same = load_surface(tmp_path / "same.xyz", unit="um", lateral_unit="um")
    np.testing.assert_allclose(surface.height_m, same.height_m, rtol=1e-12)
    np.testing.assert_allclose(surface.height_m, 1e-6 * Z_UM, rtol=1e-12)
    np.testing.assert_allclose(surface.pixel_size_m, same.pixel_size_m, rtol=1e-12)
    with pytest.raises(UncalibratedError, match=r"reading\.top_row_first.*never overridden"):
        load_surface(tmp_path / "a.nc", top_row_first=way_y == 1)


def test_netcdf_without_coordinates_has_its_top_first(tmp_path):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    with netcdf_file(str(tmp_path / "a.nc"), "w") as file:
        for name, count in zip("xy", Z_UM.T.shape, strict=True):
            file.createDimension(name, count)
        file.createVariable("heights", "f8", ("x", "y"))[:] = Z_UM[::-1].T
    np.testing.assert_allclose(1e6 * load_surface(tmp_path / "a.nc", **BARE).height_m, Z_UM)


@pytest.mark.parametrize("axes", ["xy", "yx"])
@pytest.mark.parametrize("square", [False, True])
def test_the_mask_of_netcdf_lies_as_its_heights_do(tmp_path, axes, square):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    z = Z_UM[:, :10] if square else Z_UM
    lost = np.zeros(z.shape, bool)
    lost[1, 7] = True
    with netcdf_file(str(tmp_path / "a.nc"), "w") as file:
        for name, count in zip("yx", z.shape, strict=True):
            file.createDimension(name, count)
        for name, kind, values in (("heights", "f8", z), ("mask", "i4", lost)):
            stored = values.T if axes == "xy" else values
            file.createVariable(name, kind, tuple(axes))[:] = stored[::-1, ::-1]
    surface = load_surface(tmp_path / "a.nc", **BARE)
    np.testing.assert_allclose(1e6 * surface.height_m[:, ::-1], np.where(lost, np.nan, z))


@pytest.mark.parametrize(
    ("axes", "mask"),
    [("xx", None), ("yy", None), ("x", None), ("tyx", None), ("yx", "xy"), ("xy", "yx")],
)
def test_netcdf_whose_heights_lie_along_other_axes_is_refused(tmp_path, axes, mask):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    with netcdf_file(str(tmp_path / "a.nc"), "w") as file:
        for name, count in (("t", 1), ("x", 10), ("y", 10)):
            file.createDimension(name, count)
        for name, along in (("heights", axes), ("mask", mask)):
            if along:
                stored = file.createVariable(name, "f8", tuple(along))
                stored[:] = np.eye(10) if len(along) > 1 else 1.0
    words = rf"heights \({', '.join(axes)}\).*expected heights \(y, x\) or \(x, y\)"
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(tmp_path / "a.nc", **BARE)
