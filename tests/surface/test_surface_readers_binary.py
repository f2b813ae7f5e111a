"""Readers of binary formats: NPZ, SDF, MAT, TIFF and odd X3P archives."""

import io
import re
import struct
import time
import zipfile

import h5py
import numpy as np
import pytest
import tifffile
import x3pio
from PIL import Image
from scipy.io import savemat

from capslip.errors import UncalibratedError, UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers import FORMATS, load_surface
from capslip.surface.readers.stored import check_growth

MAP = np.random.default_rng(8).normal(size=(7, 9))
CALIBRATION = {"unit": "um", "pixel_size": (2.0, 1.0), "lateral_unit": "um"}


def loaded(path, **options):
    return load_surface(path, **CALIBRATION, **options).height_m * 1e6


# --- NPY in columns, NPZ ---


def test_npy_in_columns(tmp_path):
    np.save(tmp_path / "f.npy", np.asfortranarray(MAP))
    np.testing.assert_allclose(loaded(tmp_path / "f.npy"), MAP, rtol=1e-15)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_npz_by_name_or_alone(tmp_path, save):
    save(tmp_path / "one.npz", z=MAP)
    np.testing.assert_allclose(loaded(tmp_path / "one.npz"), MAP, rtol=1e-15)
    save(tmp_path / "two.npz", z=MAP, quality=MAP > 0)
    np.testing.assert_allclose(loaded(tmp_path / "two.npz", dataset="z"), MAP, rtol=1e-15)
    for name in (None, "height"):
        with pytest.raises(UnreadableFileError, match="arrays: z, quality; add --dataset"):
            loaded(tmp_path / "two.npz", dataset=name)


def test_npz_that_grows_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "bomb.npz", z=np.zeros((2000, 2000)))
    with pytest.raises(UnreadableFileError, match="unpack to 32000128"):
        loaded(tmp_path / "bomb.npz")


def test_growth_of_small_files_is_not_judged():
    check_growth(10, 1_000_000, "small")
    with pytest.raises(UnreadableFileError, match="unpack"):
        check_growth(10, 100_000_000, "large")


# --- SDF, binary ---

CODES = ("u1", "u2", "u4", "f4", "i1", "i2", "i4", "f8")


def sdf(raw, code, order="<", magic=b"bISO-1.0", extra=b"", compression=0):
    ny, nx = raw.shape
    counts = "II" if magic.endswith(b"2.0") else "HH"
    numbers = (nx, ny, 1e-6, 2e-6, 0.5e-9, -1.0, compression, code, 0)
    head = (
        magic + b"test      " + 2 * b"010120260000" + struct.pack(f"{order}{counts}4d3B", *numbers)
    )
    return head + extra + raw.astype(order + CODES[code]).tobytes()


SDF_2 = sdf(MAP, 7, magic=b"bISO-2.0")
HUGE_SDF = SDF_2[:42] + b"\xff" * 8 + SDF_2[50:]


@pytest.mark.parametrize("code", range(8))
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("magic", [b"bISO-1.0", b"bBCR-1.0", b"bISO-2.0"])
def test_every_data_type_of_sdf(tmp_path, code, order, magic):
    raw = np.round(10 * MAP + 60)
    (tmp_path / "s.sdf").write_bytes(sdf(raw, code, order, magic))
    surface = load_surface(tmp_path / "s.sdf")
    np.testing.assert_allclose(surface.height_m, 0.5e-9 * raw, rtol=1e-15)
    assert surface.pixel_size_m == (2e-6, 1e-6)
    assert any("big-endian" in note for note in surface.origin.notes) == (order == ">")
    assert all(isinstance(note, Statement) for note in surface.origin.notes)


@pytest.mark.parametrize(
    ("code", "bad"),
    [
        (1, 2**16 - 1),
        (2, 2**32 - 1),
        (3, np.finfo("f4").min),
        (4, -(2**7)),
        (5, -(2**15)),
        (6, -(2**31)),
        (7, np.finfo("f8").min),
        (7, np.nan),
    ],
)
def test_bad_values_of_sdf_are_non_measured(tmp_path, code, bad):
    raw = np.round(10 * MAP + 60)
    raw[3, 4] = bad
    (tmp_path / "s.sdf").write_bytes(sdf(raw, code))
    surface = load_surface(tmp_path / "s.sdf")
    assert np.argwhere(~surface.measured).tolist() == [[3, 4]]


def test_sdf_with_a_longer_header(tmp_path):
    (tmp_path / "s.sdf").write_bytes(sdf(MAP, 7, extra=struct.pack("<2I", 5, 1)))
    surface = load_surface(tmp_path / "s.sdf")
    np.testing.assert_allclose(surface.height_m, 0.5e-9 * MAP, rtol=1e-15)
    assert any("eight bytes" in note for note in surface.origin.notes)
    assert all(isinstance(note, Statement) for note in surface.origin.notes)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (sdf(MAP, 7)[:60], "expected a header of 81"),
        (sdf(MAP, 7)[:-1], "truncated: 584 bytes; expected 585"),
        (sdf(MAP, 7, compression=1), "Compression is 1"),
        (HUGE_SDF, "4294967295 x 4294967295 points"),
    ],
)
def test_odd_binary_sdf_is_refused(tmp_path, content, words):
    (tmp_path / "s.sdf").write_bytes(content)
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(tmp_path / "s.sdf")


# --- MAT ---


@pytest.mark.parametrize("dtype", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
@pytest.mark.parametrize("packed", [False, True])
def test_every_real_class_of_mat(tmp_path, dtype, packed):
    heights = (20 * MAP + 100).astype(dtype)
    others = {"word": "text", "cells": np.array([1, "a"], object), "c": 1j * MAP, "yes": MAP > 0}
    savemat(tmp_path / "m.mat", {**others, "z": heights}, do_compression=packed)
    np.testing.assert_allclose(loaded(tmp_path / "m.mat"), heights, rtol=1e-15)


def test_mat_by_name(tmp_path):
    savemat(
        tmp_path / "m.mat", {"z": MAP, "quality": MAP, "c": 1j * MAP, "cube": np.ones((2, 2, 2))}
    )
    np.testing.assert_allclose(loaded(tmp_path / "m.mat", dataset="z"), MAP, rtol=1e-15)
    for name, words in (
        (None, "matrices: z, quality; add --dataset"),
        ("height", "no variable 'height'"),
        ("c", "real numbers"),
        ("cube", "two axes"),
    ):
        with pytest.raises(UnreadableFileError, match=words):
            loaded(tmp_path / "m.mat", dataset=name)


def test_numbers_and_vectors_beside_the_only_map_are_not_asked_about(tmp_path):
    savemat(tmp_path / "m.mat", {"z": MAP, "step": 0.5, "x": np.arange(9.0)})
    np.testing.assert_allclose(loaded(tmp_path / "m.mat"), MAP, rtol=1e-15)


def test_mat_7_3_is_stored_in_columns(tmp_path):
    path = tmp_path / "m.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["z"] = MAP.T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    np.testing.assert_allclose(loaded(path), MAP, rtol=1e-15)


def test_mat_that_asks_for_too_much_is_refused(tmp_path):
    savemat(tmp_path / "m.mat", {"z": MAP})
    content = (tmp_path / "m.mat").read_bytes()
    shape = struct.pack("<2i", *MAP.shape)
    (tmp_path / "m.mat").write_bytes(content.replace(shape, struct.pack("<2i", 10**6, 10**6)))
    with pytest.raises(UnreadableFileError, match="1000000 x 1000000"):
        loaded(tmp_path / "m.mat")
    savemat(tmp_path / "m.mat", {"z": np.zeros((2000, 2000))}, do_compression=True)
    with pytest.raises(UnreadableFileError, match="unpack"):
        loaded(tmp_path / "m.mat")


# --- TIFF ---


@pytest.mark.parametrize("dtype", ["f4", "f8"])
@pytest.mark.parametrize("options", [{}, {"compression": "zlib"}, {"byteorder": ">"}])
def test_float_tiff(tmp_path, dtype, options):
    heights = MAP.astype(dtype)
    tifffile.imwrite(tmp_path / "t.tif", heights, **options)
    np.testing.assert_allclose(loaded(tmp_path / "t.tif")[::-1], heights, rtol=1e-15)
    with pytest.raises(UncalibratedError, match="--pixel-size"):
        load_surface(tmp_path / "t.tif", unit="um")


def test_no_data_value_of_tiff(tmp_path):
    heights = MAP.astype("f4")
    heights[1, 2] = -9999
    tifffile.imwrite(tmp_path / "t.tif", heights, extratags=[(42113, "s", 0, "-9999", True)])
    surface = load_surface(tmp_path / "t.tif", **CALIBRATION)
    assert np.argwhere(~surface.measured[::-1]).tolist() == [[1, 2]]
    assert "1 points with the file's no-data value -9999" in surface.origin.notes[0]
    assert isinstance(surface.origin.notes[0], Statement)


@pytest.mark.parametrize("code", ["-9999", "nan", "-1.7e308"])
@pytest.mark.parametrize("dtype", ["f4", "f8", "i2", "u2"])
def test_a_no_data_value_that_no_point_has_is_not_said(tmp_path, code, dtype):
    heights = np.round(100 * MAP).astype(dtype)
    if dtype[0] == "f":
        heights[1, 2] = np.nan
    options = {"photometric": "minisblack", "extratags": [(42113, "s", 0, code, True)]}
    tifffile.imwrite(tmp_path / "t.tif", heights, **options)
    surface = load_surface(tmp_path / "t.tif", **CALIBRATION, scale=1.0)
    np.testing.assert_allclose(1e6 * surface.height_m[::-1], heights, rtol=1e-12)
    assert surface.origin.notes == ()


def test_imagej_says_its_pixel_size(tmp_path):
    tifffile.imwrite(
        tmp_path / "t.tif",
        MAP.astype("f4"),
        imagej=True,
        resolution=(0.5, 0.25),
        metadata={"unit": "um"},
    )
    surface = load_surface(tmp_path / "t.tif", unit="nm")
    np.testing.assert_allclose(surface.pixel_size_m, (4e-6, 2e-6), rtol=1e-9)
    with pytest.raises(UncalibratedError, match="never overridden"):
        load_surface(tmp_path / "t.tif", unit="nm", pixel_size=(1, 1), lateral_unit="um")


@pytest.mark.parametrize(
    ("units", "pixel_size_m"),
    [
        ({"unit": "um", "yunit": "mm"}, (4e-3, 2e-6)),
        ({"unit": "mm", "yunit": "\\u00B5m"}, (4e-6, 2e-3)),
        ({"unit": "\\u00B5m", "yunit": "micron"}, (4e-6, 2e-6)),
    ],
)
def test_imagej_has_a_unit_for_y_where_it_is_another_one(tmp_path, units, pixel_size_m):
    path, image = tmp_path / "t.tif", MAP.astype("f4")
    tifffile.imwrite(path, image, imagej=True, resolution=(0.5, 0.25), metadata=units)
    surface = load_surface(path, unit="nm")
    np.testing.assert_allclose(surface.pixel_size_m, pixel_size_m, rtol=1e-9)


def test_y_of_imagej_is_a_length_where_x_is(tmp_path):
    path, image = tmp_path / "t.tif", MAP.astype("f4")
    tifffile.imwrite(path, image, imagej=True, metadata={"unit": "um", "yunit": "sec"})
    with pytest.raises(UncalibratedError, match="'sec'; expected a unit of length"):
        load_surface(path, unit="nm")
    tifffile.imwrite(path, image, imagej=True, metadata={"unit": "pixel", "yunit": "um"})
    with pytest.raises(UncalibratedError, match="--pixel-size"):
        load_surface(path, unit="nm")


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.ones((7, 9), "u2"), "uint16; expected float32"),
        (np.ones((2, 7, 9), "f4"), "2 pages"),
        (np.ones((7, 9, 3), "f4"), "pages|two axes"),
        (np.zeros((3000, 3000)), "unpack"),
    ],
)
def test_odd_tiff_is_refused(tmp_path, image, words):
    tifffile.imwrite(tmp_path / "t.tif", image, compression="zlib", photometric="minisblack")
    with pytest.raises(UnreadableFileError, match=words):
        loaded(tmp_path / "t.tif")


@pytest.mark.parametrize(
    "options", [{}, {"bigtiff": True}, {"rowsperstrip": 1}, {"tile": (16, 16)}]
)
def test_truncated_tiff_is_refused(tmp_path, options):
    """One line says so wherever it was cut: in the header, in a directory, its lists, the data."""
    path = tmp_path / "t.tif"
    tifffile.imwrite(path, np.tile(MAP, (8, 8)), **options)
    content = path.read_bytes()
    for keep in (6, 100, *range(150, 700, 30), 3000, len(content) - 1):
        path.write_bytes(content[:keep])
        with pytest.raises(UnreadableFileError, match=r"t\.tif: truncated: .*copy the file again"):
            loaded(path)


@pytest.mark.parametrize("compressed", [False, True])
def test_a_tiff_with_its_directory_behind_the_data_is_told_to_be_truncated(tmp_path, compressed):
    path = tmp_path / "t.tif"
    Image.fromarray(np.tile(MAP, (8, 8)).astype("f4")).save(
        path, compression="tiff_deflate" if compressed else None
    )
    content = path.read_bytes()
    assert loaded(path).size
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(UnreadableFileError, match=r"t\.tif: truncated: .*copy the file again"):
        loaded(path)


@pytest.mark.parametrize(
    ("tags", "name"),
    [
        ([(0x8050, "s", 0, "height", True)], "vendor"),  # JPK
        ([(50432, "I", 1, 0x0E031301, True)], "vendor"),  # Park Systems
        ([(270, "s", 0, "<TiffTagDescData/>", True)], "vendor"),  # Olympus LEXT
        ([(270, "s", 0, "a face", True)], "tiff"),
    ],
)
def test_a_plain_tiff_is_told_from_an_instruments_own(tmp_path, tags, name):
    path = tmp_path / "t.tif"
    tifffile.imwrite(path, MAP.astype("f4"), extratags=tags, description=None, metadata=None)
    head = path.read_bytes()[:512]
    assert next(row.name for row in FORMATS if row.recognises(head, path)) == name


def test_a_chain_of_directories_without_end_is_not_followed(tmp_path):
    """Two directories, each of which names the other as the next one."""
    directory = struct.pack("<H", 0)
    content = b"II*\0" + struct.pack("<I", 8) + directory + struct.pack("<I", 14)
    (tmp_path / "t.tif").write_bytes(content + directory + struct.pack("<I", 8))
    with pytest.raises(UnreadableFileError, match="3 directories"):
        loaded(tmp_path / "t.tif")


def test_a_mirrored_tiff_is_refused(tmp_path):
    tifffile.imwrite(tmp_path / "t.tif", MAP, extratags=[(274, "H", 1, 2, True)])
    with pytest.raises(UnreadableFileError, match="Orientation is 2; expected 1 or 4"):
        loaded(tmp_path / "t.tif")


# --- X3P archives ---


def x3p(path, rename=lambda name: name, change=lambda name, content: content, add=()):
    """Write an X3P file, with its entries renamed or changed, and others added."""
    packed = io.BytesIO()
    x3pio.write(packed, MAP, x_scale=1e-6, y_scale=2e-6)
    with zipfile.ZipFile(packed) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            new.writestr(rename(name), change(name, old.read(name)))
        for name, content in add:
            new.writestr(name, content)
    return path


def another_comment(name, content):
    return content.replace(b"</Record1>", b"</Record1><!-- later -->") if "xml" in name else content


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rename": lambda name: f"scan 1/{name}"}, "subfolder"),
        ({"add": [("__MACOSX/._main.xml", b"junk")]}, "not its own"),
        ({"add": [(".DS_Store", b"junk")]}, "not its own"),
        ({"change": another_comment}, "checksum"),
    ],
)
def test_odd_archive_is_refused_or_read_with_a_note(tmp_path, options, words):
    path = x3p(tmp_path / "odd.x3p", **options)
    with pytest.raises(UnreadableFileError, match=rf"{words}.*reading\.lenient = true"):
        load_surface(path)
    surface = load_surface(path, lenient=True)
    np.testing.assert_array_equal(surface.height_m, MAP)
    (note,) = surface.origin.notes
    assert words in note
    assert note.endswith("read anyway")


def test_lenient_reading_of_a_sound_file_notes_nothing(tmp_path):
    assert load_surface(x3p(tmp_path / "a.x3p"), lenient=True).origin.notes == ()


def entities(name, content):
    declared = b'?><!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>'
    return content.replace(b"?>", declared, 1) if name == "main.xml" else content


def huge(name, content):
    return content.replace(b"<SizeX>9<", b"<SizeX>1000000000000<") if "xml" in name else content


def without_increment(axis, data_type="D"):
    def change(name, content):
        if name != "main.xml":
            return b"no digest" if name.startswith("md5") else content
        before, tag, after = content.decode().partition(f"<{axis}>")
        after = re.sub("<Increment>.*?</Increment>", "", after, count=1)
        after = after.replace("<DataType>D<", f"<DataType>{data_type}<", 1)
        return (before + tag + after).encode()

    return change


@pytest.mark.parametrize("lenient", [False, True])
@pytest.mark.parametrize(("axis", "data_type"), [("CX", "D"), ("CY", "D"), ("CZ", "I")])
def test_an_axis_without_a_step_is_no_metre(tmp_path, axis, data_type, lenient):
    path = x3p(tmp_path / "a.x3p", change=without_increment(axis, data_type))
    with pytest.raises(UnreadableFileError, match=f"no Increment of the axis {axis}"):
        load_surface(path, lenient=lenient)


def test_heights_in_metres_need_no_step(tmp_path):
    surface = load_surface(x3p(tmp_path / "a.x3p", change=without_increment("CZ")), lenient=True)
    np.testing.assert_array_equal(surface.height_m, MAP)


def test_tags_that_no_map_needs_are_not_parsed(tmp_path):
    def change(name, content):
        tags = b"</Record1>" + 1_000_000 * b"<a/>"
        return content.replace(b"</Record1>", tags) if name == "main.xml" else content

    path = x3p(tmp_path / "a.x3p", change=change)
    started = time.process_time()
    with pytest.raises(UnreadableFileError, match="XML tags; expected at most 4126 for 9 x 7"):
        load_surface(path, lenient=True)
    assert time.process_time() - started < 1.0


@pytest.mark.parametrize("lenient", [False, True])
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"add": [("../../evil.bin", b"x")]}, "points out of the archive"),
        ({"add": [("/etc/evil", b"x")]}, "points out of the archive"),
        ({"add": [("zeros.bin", bytes(50_000_000))]}, "unpack to 50000000"),
        ({"change": entities}, "entities"),
        ({"change": huge}, "1000000000000 points|checksum"),
        ({"rename": lambda name: f"a/b/{name}" if name == "main.xml" else name}, "main.xml"),
        ({"rename": lambda name: "other.xml" if name == "main.xml" else name}, "0 files main.xml"),
    ],
)
def test_dangerous_archive_is_refused(tmp_path, options, words, lenient):
    path = x3p(tmp_path / "bad.x3p", **options)
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(path, lenient=lenient)
    assert list(tmp_path.iterdir()) == [path]


def test_root_without_namespace_is_read(tmp_path):
    def bare(name, content):
        if name != "main.xml":
            return b"no digest" if name.startswith("md5") else content
        return content.replace(b"<p:", b"<").replace(b"</p:", b"</")

    np.testing.assert_array_equal(load_surface(x3p(tmp_path / "n.x3p", change=bare)).height_m, MAP)
