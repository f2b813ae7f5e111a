"""Readers: units, refusals, round trips."""

import contextlib
import errno
import hashlib
import os
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import x3pio

from capslip.errors import (
    CapslipError,
    OutputError,
    SettingsError,
    UncalibratedError,
    UnreadableFileError,
    UnusableSurfaceError,
)
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import FORMATS, load_surface
from capslip.surface.readers.hdf5 import write_hdf5

HEIGHTS = np.random.default_rng(5).standard_normal((20, 30))
CALIBRATION = {"unit": "um", "pixel_size": (1.0, 2.0), "lateral_unit": "mm"}


def write(path, data=HEIGHTS, name="height", **attributes):
    with h5py.File(path, "w") as file:
        file.create_dataset(name, data=data).attrs.update(attributes)
    return path


def native(path, data=HEIGHTS, **changes):
    attributes = {"unit": "um", "pixel_size": [2e-3, 1e-3], "pixel_unit": "m", **changes}
    return write(path, data, **{k: v for k, v in attributes.items() if v is not None})


@pytest.fixture
def npy(tmp_path):
    np.save(tmp_path / "bare.npy", HEIGHTS)
    return tmp_path / "bare.npy"


@pytest.mark.parametrize("unit", ["m", "mm", "um", "nm"])
def test_hdf5_round_trip_keeps_heights_holes_and_pixels(tmp_path, unit):
    heights = 1e-6 * HEIGHTS
    heights[3, 4:9] = np.nan
    write_hdf5(HeightMap(heights, (2e-4, 1e-4)), tmp_path / "map.h5", unit=unit)
    back = load_surface(tmp_path / "map.h5")
    np.testing.assert_allclose(back.height_m, heights, rtol=1e-15)
    assert back.pixel_size_m == (2e-4, 1e-4)
    assert back.origin.height_unit == unit


def test_float32_in_nm_is_exact_on_eighths(tmp_path):
    heights_nm = np.round(8e3 * HEIGHTS) / 8
    write_hdf5(HeightMap(heights_nm * 1e-9, (1, 1)), tmp_path / "m.h5", unit="nm", dtype="float32")
    with h5py.File(tmp_path / "m.h5") as file:
        np.testing.assert_array_equal(file["height"][()], heights_nm)


def test_origin_says_where_the_map_came_from(tmp_path):
    path = native(tmp_path / "face.h5")
    origin = load_surface(path).origin
    assert (origin.name, origin.path, origin.file_format) == ("face", str(path), "hdf5")
    assert origin.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (origin.height_unit, origin.lateral_unit) == ("um", "m")


def test_format_is_told_by_content_not_by_name(tmp_path):
    native(tmp_path / "face.x3p")
    assert load_surface(tmp_path / "face.x3p").origin.file_format == "hdf5"


@pytest.mark.parametrize(
    ("word", "metres"),
    [("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("µm", 1e-6), ("nm", 1e-9), ("inch", 0.0254)],
)
def test_units_scale_heights_and_pixels(npy, word, metres):
    surface = load_surface(npy, unit=word, pixel_size=(3.0, 2.0), lateral_unit=word)
    np.testing.assert_allclose(surface.height_m, HEIGHTS * metres, rtol=1e-15)
    np.testing.assert_allclose(surface.pixel_size_m, (3.0 * metres, 2.0 * metres), rtol=1e-15)


@pytest.mark.parametrize(
    ("given", "option"),
    [
        ({}, "--unit"),
        ({"unit": "um"}, "--pixel-size DY DX --lateral-unit"),
        ({"unit": "um", "pixel_size": (1, 2)}, "--lateral-unit"),
        ({"pixel_size": (1, 2), "lateral_unit": "mm"}, "--unit"),
    ],
)
def test_bare_array_is_refused_with_the_option_to_add(npy, given, option):
    with pytest.raises(UncalibratedError, match=option) as caught:
        load_surface(npy, **given)
    assert str(npy) in str(caught.value)


@pytest.mark.parametrize(
    "given",
    [
        {"unit": "mm"},
        {"lateral_unit": "mm"},
        {"pixel_size": (1.0, 2.0), "lateral_unit": "mm"},
        {"pixel_size": (2.0, 1.0), "lateral_unit": "um"},
    ],
)
def test_what_contradicts_the_file_is_refused(tmp_path, given):
    with pytest.raises(UncalibratedError, match="never overridden"):
        load_surface(native(tmp_path / "face.h5"), **given)


def test_what_agrees_with_the_file_is_accepted(tmp_path):
    path = native(tmp_path / "face.h5")
    same = load_surface(path, unit="µm", pixel_size=(2.0, 1.0), lateral_unit="mm")
    assert same.pixel_size_m == load_surface(path).pixel_size_m


def test_missing_attributes_are_filled_by_the_user(tmp_path):
    path = native(tmp_path / "face.h5", unit=None, pixel_unit=None)
    surface = load_surface(path, unit="nm", lateral_unit="mm")
    np.testing.assert_allclose(surface.height_m, HEIGHTS * 1e-9)
    np.testing.assert_allclose(surface.pixel_size_m, (2e-6, 1e-6))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({**CALIBRATION, "unit": "furlong"}, "--unit furlong"),
        ({**CALIBRATION, "lateral_unit": "px"}, "--lateral-unit px"),
        ({**CALIBRATION, "pixel_size": (0.0, 1.0)}, "--pixel-size"),
        ({**CALIBRATION, "pixel_size": (1.0, float("nan"))}, "--pixel-size"),
        ({**CALIBRATION, "pixel_size": (1.0,)}, "--pixel-size"),
        ({**CALIBRATION, "dataset": "z"}, "--dataset"),
    ],
)
def test_senseless_options_are_named(npy, given, words):
    with pytest.raises(SettingsError, match=words):
        load_surface(npy, **given)


def test_other_hdf5_is_read_by_dataset(tmp_path):
    path = write(tmp_path / "other.h5", name="scan/z")
    with pytest.raises(UnreadableFileError, match="scan/z"):
        load_surface(path, **CALIBRATION)
    surface = load_surface(path, dataset="scan/z", **CALIBRATION)
    np.testing.assert_allclose(surface.height_m, HEIGHTS * 1e-6)
    assert surface.pixel_size_m == (1e-3, 2e-3)


@pytest.mark.parametrize(
    ("attributes", "error", "words"),
    [
        ({"unit": None}, UncalibratedError, "--unit"),
        ({"pixel_size": None}, UncalibratedError, "--pixel-size"),
        ({"pixel_unit": None}, UncalibratedError, "--lateral-unit"),
        ({"unit": "rad"}, UncalibratedError, "rad"),
        ({"unit": 3}, UncalibratedError, "expected a word"),
        ({"pixel_size": [np.nan, 1.0]}, UnreadableFileError, "nan"),
        ({"pixel_size": [1.0, 0.0]}, UnreadableFileError, "positive"),
        ({"pixel_size": [1.0, 2.0, 3.0]}, UncalibratedError, "two numbers"),
        ({"pixel_size": "wide"}, UncalibratedError, "two numbers"),
        ({"data": HEIGHTS.astype(complex)}, UnreadableFileError, "complex128"),
        ({"data": HEIGHTS[None]}, UnreadableFileError, "two axes"),
        ({"data": HEIGHTS[0]}, UnreadableFileError, "two axes"),
        ({"data": b"heights"}, UnreadableFileError, "two axes"),
        ({"data": HEIGHTS[:2]}, UnusableSurfaceError, "at least 3"),
        ({"data": np.full((4, 4), np.inf)}, UnusableSurfaceError, "infinite"),
    ],
)
def test_odd_hdf5_is_refused(tmp_path, attributes, error, words):
    with pytest.raises(error, match=words) as caught:
        load_surface(native(tmp_path / "odd.h5", **attributes))
    assert "\n" not in str(caught.value)


def test_size_is_checked_before_memory_is_taken(tmp_path):
    with h5py.File(tmp_path / "huge.h5", "w") as file:
        file.create_dataset("height", (200_000, 200_000), dtype="f4", chunks=True)
    with pytest.raises(UnreadableFileError, match="200000 x 200000"):
        load_surface(tmp_path / "huge.h5")


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (HEIGHTS.astype(complex), "complex128"),
        (np.array([["a", "b"]] * 3), "<U1"),
        (np.array([[None] * 3] * 3, dtype=object), "object"),
        (HEIGHTS[0], "two axes"),
        (HEIGHTS[None], "two axes"),
    ],
)
def test_odd_npy_is_refused(tmp_path, array, words):
    np.save(tmp_path / "odd.npy", array)
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(tmp_path / "odd.npy", **CALIBRATION)


@pytest.mark.parametrize("keep", [20, 80, 2000, -8])
def test_truncated_npy_is_refused(npy, keep):
    npy.write_bytes(npy.read_bytes()[:keep])
    with pytest.raises(UnreadableFileError, match=r"truncated|damaged"):
        load_surface(npy, **CALIBRATION)


def test_no_file_folder_and_zero_bytes(tmp_path):
    with pytest.raises(UnreadableFileError, match="no such file"):
        load_surface(tmp_path / "absent.h5")
    with pytest.raises(UnreadableFileError, match="folder"):
        load_surface(tmp_path)
    with pytest.raises(UnreadableFileError, match="no such file"):
        load_surface("zero\0byte.h5")
    os.mkfifo(tmp_path / "pipe.h5")  # opening it would wait for ever, as reading /dev/zero would
    for path in (tmp_path / "pipe.h5", "/dev/zero"):
        with pytest.raises(UnreadableFileError, match="is a pipe or a device"):
            load_surface(path)
    (tmp_path / "empty.h5").touch()
    with pytest.raises(UnreadableFileError, match="zero bytes"):
        load_surface(tmp_path / "empty.h5")


def test_x3p_rows_run_along_y(tmp_path):
    heights = 1e-6 * HEIGHTS
    heights[2, 3] = np.nan
    x3pio.write(tmp_path / "map.x3p", heights, x_scale=1e-6, y_scale=2e-6)
    surface = load_surface(tmp_path / "map.x3p")
    np.testing.assert_array_equal(surface.height_m, heights)
    assert surface.pixel_size_m == (2e-6, 1e-6)


def test_x3p_without_a_height_map_is_refused(tmp_path):
    x3pio.write(tmp_path / "profile.x3p", HEIGHTS[0], x_scale=1e-6)
    x3pio.write(tmp_path / "layers.x3p", np.stack([HEIGHTS] * 2), x_scale=1e-6, y_scale=1e-6)
    x3pio.write_points(tmp_path / "points.x3p", np.zeros((5, 3)))
    for name, words in (("profile", "PRF"), ("layers", "2 layers"), ("points", "PCL")):
        with pytest.raises(UnreadableFileError, match=words):
            load_surface(tmp_path / f"{name}.x3p")


@pytest.mark.parametrize("damage", ["length", "heap"])
def test_damaged_strings_do_not_hang_the_hdf5_library(tmp_path, damage):
    path = native(tmp_path / "face.h5")
    content = bytearray(path.read_bytes())
    if damage == "length":
        at = content.index(b"unit\0\0\0\0")
        at = content.index((2).to_bytes(4, "little"), at + 24)
        content[at : at + 4] = b"\xff\xff\xff\xff"
    else:
        at = content.index(b"GCOL") + 16
        content[at : at + 16] = bytes(16)
    path.write_bytes(content)
    started = time.process_time()
    with pytest.raises(UnreadableFileError, match="damaged HDF5 file at offset"):
        load_surface(path)
    assert time.process_time() - started < 1.0


def test_unwritten_dataset_is_no_map(tmp_path):
    with h5py.File(tmp_path / "sparse.h5", "w") as file:
        file.create_dataset("height", (4000, 4000), dtype="f8", chunks=True)
    with pytest.raises(UnreadableFileError, match="unpack"):
        load_surface(tmp_path / "sparse.h5")


@pytest.mark.parametrize("kind", ["h5", "x3p"])
@pytest.mark.parametrize("seed", range(12))
def test_damaged_bytes_give_an_error_of_ours_or_a_map(tmp_path, kind, seed):
    path = tmp_path / f"map.{kind}"
    if kind == "h5":
        write_hdf5(HeightMap(HEIGHTS, (1, 1)), path)
    else:
        x3pio.write(path, HEIGHTS, x_scale=1e-6, y_scale=1e-6)
    content = bytearray(path.read_bytes())
    rng = np.random.default_rng(seed)
    if seed % 3 == 0:
        content = content[: rng.integers(9, len(content))]
    else:
        at = rng.integers(0, len(content) - 16)
        content[at : at + 16] = rng.bytes(16)
    path.write_bytes(bytes(content))
    with contextlib.suppress(CapslipError):  # any other error is a crash
        assert load_surface(path).height_m.ndim == 2


def test_writing_refuses_unknown_units_and_folders(tmp_path):
    surface = HeightMap(HEIGHTS, (1, 1))
    with pytest.raises(SettingsError, match="parsec"):
        write_hdf5(surface, tmp_path / "a.h5", unit="parsec")
    with pytest.raises(OutputError, match="cannot be written"):
        write_hdf5(surface, tmp_path / "absent" / "a.h5")


@pytest.mark.parametrize("reason", [errno.ENOSPC, errno.EIO])
def test_a_map_that_finds_no_room_leaves_what_was_there(reason, tmp_path, monkeypatch):
    path, there, write_bytes = tmp_path / "a.h5", HeightMap(HEIGHTS, (1, 1)), Path.write_bytes
    write_hdf5(there, path)
    before = path.read_bytes()

    def half(file, data):
        write_bytes(file, data[: len(data) // 2])
        raise OSError(reason, os.strerror(reason))

    monkeypatch.setattr(Path, "write_bytes", half)
    room = f"make room on the disk of {tmp_path}, or " if reason == errno.ENOSPC else ""
    for name in ("a.h5", "new.h5"):
        with pytest.raises(OutputError) as told:
            write_hdf5(HeightMap(2.0 * HEIGHTS, (1, 1)), tmp_path / name)
        assert str(told.value) == (
            f"{tmp_path / name}: cannot be written ({os.strerror(reason)}); nothing was written; "
            f"{room}choose another folder"
        )
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_map_is_written_where_a_link_leads(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "a.h5").symlink_to(tmp_path / "far" / "b.h5")
    write_hdf5(HeightMap(HEIGHTS, (1, 1)), tmp_path / "a.h5")
    assert (tmp_path / "a.h5").is_symlink()
    assert np.array_equal(load_surface(tmp_path / "far" / "b.h5").height_m, HEIGHTS)


def test_formats_names_every_reader():
    assert " ".join(row.name for row in FORMATS) == (
        "hdf5 npy x3p sdf mat tiff gwy sur sxm nms zygo wyko surfer esri mesh gwyddion keyence xyz "
        "text vendor"
    )
    assert all(row.extensions and row.note for row in FORMATS)


def test_registry_imports_no_reading_library():
    code = (
        "import sys, capslip.surface.readers; "
        "heavy = ('h5py', 'x3pio', 'tifffile', 'SurfaceTopography', 'scipy'); "
        "print([m for m in heavy if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    assert done.stderr == ""


def test_without_the_extra_the_error_names_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    (tmp_path / "scan.opd").write_bytes(b"\x01\x00Directory")
    with pytest.raises(UnreadableFileError, match=r"capslip\[vendor\].*convert"):
        load_surface(tmp_path / "scan.opd")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"hello\nno map here\n", "not a height map"),
        (bytes(2 * 100 * 100), "not a height map|damaged"),
        (b"\x89PNG\r\n\x1a\n", "a picture, whose grey values"),
        (b"BM" + bytes(100), "a picture, whose grey values"),
        (b"\xff\xd8\xff\xe0" + bytes(100), "a picture, whose grey values"),
        (b"PK\x03\x04" + bytes(100), "a sheet of an office program; unpack it"),
        (b"\xd0\xcf\x11\xe0" + bytes(600), "a sheet of an office program"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 1\n", "git lfs pull"),
    ],
)
def test_what_is_no_height_map_is_refused(tmp_path, content, words):
    pytest.importorskip(
        "SurfaceTopography", reason="needs the extra `vendor`", exc_type=ImportError
    )
    (tmp_path / "thing.dat").write_bytes(content)
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(tmp_path / "thing.dat")
