"""Bytes lost or slipped in: refused wherever the header says how long the file is."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from fuzz_readers import OF_KNOWN_LENGTH, changed_in_silence
from written import sur_header, writers

from capslip.errors import UncalibratedError, UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers import load_surface

SCANS = Path(__file__).parents[3] / "shared" / "scans"
KNOWN = (
    "channels/di-1.di",
    "channels/spot_1-1000nm.ibw",
    "channels/al3d-1.al3d",
    "laser_textured_grooves_leica_dcm3d.plu",
    "milled_like_arcs_1.opd",
    "plate_30x60mm_missing27pct.frt",
    "polished_disc_with_tracks.sur",
    "conformance/zygo_metropro_phase_res1.dat",
)
MAP = np.random.default_rng(5).normal(size=(6, 8))


@pytest.mark.scans
@pytest.mark.skipif(not SCANS.is_dir(), reason="no folder shared/scans beside the project")
@pytest.mark.parametrize("name", KNOWN)
def test_no_byte_more_or_less_changes_a_map_in_silence(name, tmp_path):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    path = tmp_path / Path(name).name
    assert changed_in_silence(path, (SCANS / name).read_bytes(), 40, len(name), {}) == []


@pytest.mark.parametrize("name", OF_KNOWN_LENGTH)
def test_no_byte_more_or_less_changes_a_built_in_format_in_silence(name, tmp_path):
    write, given = writers()[name]
    write(tmp_path / name, MAP)
    content = (tmp_path / name).read_bytes()
    assert changed_in_silence(tmp_path / name, content, 60, len(name), given) == []


@pytest.mark.parametrize("name", ["a.h5", "a.npy", "seven.mat", "binary.sdf", "a.nms"])
def test_bytes_behind_the_end_are_read_over_when_asked_to(name, tmp_path):
    write, given = writers()[name]
    write(tmp_path / name, MAP)
    sound = load_surface(tmp_path / name, **given)
    with (tmp_path / name).open("ab") as file:
        file.write(b"more")
    with pytest.raises(UnreadableFileError, match=r"bytes were added.*reading\.lenient"):
        load_surface(tmp_path / name, **given)
    surface = load_surface(tmp_path / name, **given, lenient=True)
    np.testing.assert_array_equal(surface.height_m, sound.height_m)
    assert "read anyway" in " ".join(surface.origin.notes)


# --- SUR ---


def compressed(counts, n_streams=3):
    head = sur_header(counts, 2.0**-20).replace(b"DIGITAL SURF", b"DSCOMPRESSED")
    parts = [part.tobytes() for part in np.array_split(counts.astype("<i4").ravel(), n_streams)]
    streams = [zlib.compress(part) for part in parts]
    sizes = [size for pair in zip(parts, streams, strict=True) for size in map(len, pair)]
    return head + struct.pack(f"<{1 + len(sizes)}I", n_streams, *sizes) + b"".join(streams)


def changed(content, at, packed):
    return content[:at] + packed + content[at + len(packed) :]


COUNTS = np.round(MAP * 2**20).astype(int)
PLAIN = sur_header(COUNTS, 2.0**-20) + COUNTS.astype("<i4").tobytes()


@pytest.mark.parametrize("n_streams", [1, 3])
def test_compressed_sur_is_the_plain_one(tmp_path, n_streams):
    (tmp_path / "plain.sur").write_bytes(PLAIN)
    (tmp_path / "packed.sur").write_bytes(compressed(COUNTS, n_streams))
    plain, packed = (load_surface(tmp_path / f"{name}.sur") for name in ("plain", "packed"))
    np.testing.assert_array_equal(plain.height_m, packed.height_m)
    np.testing.assert_allclose(plain.height_m[::-1], 1e-6 * COUNTS / 2**20, rtol=1e-6)
    assert packed.origin.notes == ()


@pytest.mark.parametrize("turned", range(4))
@pytest.mark.parametrize("blanks", [False, True])
def test_sur_agrees_with_another_reader(tmp_path, turned, blanks):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    from SurfaceTopography import open_topography

    content = changed(PLAIN, 290, struct.pack("<H", turned))
    if blanks:
        blank = struct.pack("<i", COUNTS.min() - 2)
        content = changed(changed(content, 86, struct.pack("<H", 1)), 512 + 4 * 11, blank)
    (tmp_path / "a.sur").write_bytes(content)
    surface = load_surface(tmp_path / "a.sur")
    with open_topography(str(tmp_path / "a.sur")) as reader:
        other = reader.topography()
    heights_um = np.ma.filled(np.ma.asarray(other.heights()), np.nan).T
    np.testing.assert_allclose(1e6 * surface.height_m[::-1], heights_um, rtol=1e-6)
    assert np.count_nonzero(~surface.measured) == blanks


def test_sur_may_give_the_sides_in_two_units(tmp_path):
    (tmp_path / "a.sur").write_bytes(PLAIN)
    one_unit = load_surface(tmp_path / "a.sur").pixel_size_m
    at = 132 + 16 * 4  # behind the words of the axes and the unit of steps along x
    assert PLAIN[at : at + 2] == b"um"
    (tmp_path / "a.sur").write_bytes(changed(PLAIN, at, b"mm"))
    two_units = load_surface(tmp_path / "a.sur").pixel_size_m
    np.testing.assert_allclose(two_units, (1e3 * one_unit[0], one_unit[1]), rtol=1e-12)


@pytest.mark.parametrize("blank", ["", "  "])
def test_an_empty_unit_of_sur_is_a_missing_one(tmp_path, blank):
    (tmp_path / "a.sur").write_bytes(PLAIN)
    um = load_surface(tmp_path / "a.sur")
    word = blank.encode().ljust(16, b"\0")
    (tmp_path / "a.sur").write_bytes(changed(PLAIN, 180 + 16 * 2, word))  # of the heights
    with pytest.raises(UncalibratedError, match=r"does not say the unit of its heights.*--unit"):
        load_surface(tmp_path / "a.sur")
    nm = load_surface(tmp_path / "a.sur", unit="nm")
    np.testing.assert_allclose(nm.height_m, 1e-3 * um.height_m)
    assert nm.pixel_size_m == um.pixel_size_m
    (tmp_path / "a.sur").write_bytes(changed(PLAIN, 180, 2 * word))  # of both sides
    with pytest.raises(UncalibratedError, match="but not its unit; add --lateral-unit"):
        load_surface(tmp_path / "a.sur")
    mm = load_surface(tmp_path / "a.sur", lateral_unit="mm")
    np.testing.assert_allclose(mm.pixel_size_m, 1e3 * np.array(um.pixel_size_m))


@pytest.mark.scans
@pytest.mark.skipif(not SCANS.is_dir(), reason="no folder shared/scans beside the project")
def test_plu_whose_range_was_never_set_is_read(tmp_path):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    name = "laser_textured_grooves_leica_dcm3d.plu"
    content = (SCANS / name).read_bytes()
    end = 508 + 4 * int(np.prod(struct.unpack_from("<II", content, 500)))
    unset = changed(content, end, struct.pack("<2f", -1000001.0, 1000001.0))
    (tmp_path / name).write_bytes(unset)
    np.testing.assert_array_equal(
        load_surface(tmp_path / name).height_m, load_surface(SCANS / name).height_m
    )


def test_a_profile_is_refused_as_one(tmp_path):
    library = pytest.importorskip("SurfaceTopography", reason="extra `vendor`")
    profile = library.UniformLineScan(MAP[0], 8.0, unit="um")
    profile.to_netcdf(str(tmp_path / "a.nc"))
    with pytest.raises(UnreadableFileError, match="a profile along one axis"):
        load_surface(tmp_path / "a.nc")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (PLAIN[:300], "expected a header of 512"),
        (PLAIN[:-1], "has 703 bytes, but its header describes 704: bytes were lost"),
        (PLAIN + b"\0", "bytes were added.*reading.lenient"),
        (changed(PLAIN, 98, b"\x08\0"), "8 bits a point"),
        (changed(PLAIN, 108, b"\xff\xff\xff\x7f" * 2), "2147483647 x 2147483647 points"),
        (changed(PLAIN, 18, b"\x01\0"), "object of kind 1"),
        (compressed(COUNTS)[:-3], "damaged or truncated compressed"),
        (compressed(COUNTS)[:520] + b"\0" + compressed(COUNTS)[520:], "compressed heights"),
    ],
)
def test_odd_sur_is_refused(tmp_path, content, words):
    (tmp_path / "a.sur").write_bytes(content)
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(tmp_path / "a.sur")


def test_bytes_behind_the_heights_can_be_tolerated(tmp_path):
    (tmp_path / "a.sur").write_bytes(PLAIN + b"\0")
    surface = load_surface(tmp_path / "a.sur", lenient=True)
    assert "705 bytes, but its header describes 704; read anyway" in surface.origin.notes[0]
    assert not isinstance(surface.origin.notes[0], Statement)
