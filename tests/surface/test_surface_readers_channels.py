"""Files with several maps: the right one, by a name that it alone has, and in a unit of length."""

import struct
from pathlib import Path

import numpy as np
import pytest
from written import gwy_component, gwy_field, gwy_file

from capslip.errors import CapslipError, UncalibratedError, UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers import load_surface

CHANNELS = Path(__file__).parents[3] / "shared" / "scans" / "channels"
MAP = np.random.default_rng(3).normal(0.0, 1e-6, (6, 8))
SIZE_M = (12e-6, 8e-6)
shared = pytest.mark.skipif(not CHANNELS.is_dir(), reason="no folder shared/scans")


@pytest.fixture
def extra():
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)


# --- Gwyddion's own files ---


def titled(number, title, z=MAP, unit_xy="m", unit_z="m"):
    return gwy_component(f"/{number}/data", "o", gwy_field(z, unit_xy, unit_z, SIZE_M)) + (
        gwy_component(f"/{number}/data/title", "s", title.encode() + b"\0")
    )


def put(path, *components):
    path.write_bytes(gwy_file(*components))
    return path


OTHERS = (
    gwy_component("/0/data/visible", "b", b"\1")
    + gwy_component("/filename", "s", b"a.gwy\0")
    + gwy_component("/meta", "S", struct.pack("<I", 2) + b"a\0bc\0")
    + gwy_component("/bytes", "C", struct.pack("<I", 3) + b"abc")
)


@pytest.mark.usefixtures("extra")
def test_gwy_agrees_with_another_reader(tmp_path):
    from SurfaceTopography import open_topography

    path = put(tmp_path / "a.gwy", OTHERS, titled(0, "Height"))
    surface = load_surface(path)
    with open_topography(str(path)) as reader:
        other = reader.topography()
    np.testing.assert_array_equal(surface.height_m[::-1], np.asarray(other.heights()).T)
    np.testing.assert_allclose(surface.side_m[::-1], other.physical_sizes)
    assert surface.origin.notes == ()


@pytest.mark.parametrize(("word", "metres"), [("µm", 1e-6), ("nm", 1e-9), ("mm", 1e-3)])
def test_gwy_in_other_units_than_metres(tmp_path, word, metres):
    surface = load_surface(put(tmp_path / "a.gwy", titled(0, "z", MAP, word, word)))
    np.testing.assert_allclose(surface.height_m[::-1], MAP * metres, rtol=1e-15)
    np.testing.assert_allclose(surface.side_m, np.multiply(SIZE_M, metres), rtol=1e-12)


def test_gwy_without_units_asks_for_them(tmp_path):
    path = put(tmp_path / "a.gwy", titled(0, "z", 1e6 * MAP, "", ""))
    with pytest.raises(UncalibratedError, match="--unit"):
        load_surface(path)
    with pytest.raises(UncalibratedError, match="--lateral-unit"):
        load_surface(path, unit="um")
    surface = load_surface(path, unit="um", lateral_unit="m")
    np.testing.assert_allclose(surface.height_m[::-1], MAP, rtol=1e-15)


def test_what_lies_under_a_mask_is_non_measured_and_said(tmp_path):
    mask = np.zeros(MAP.shape)
    mask[0, 2:5] = 1.0
    component = gwy_component("/0/mask", "o", gwy_field(mask, "m", "", SIZE_M))
    surface = load_surface(put(tmp_path / "a.gwy", titled(0, "z"), component))
    assert np.argwhere(~surface.measured[::-1]).tolist() == [[0, 2], [0, 3], [0, 4]]
    assert "3 points (6.2 %) under the mask" in surface.origin.notes[0]
    assert not isinstance(surface.origin.notes[0], Statement)  # a mask may mark anything
    empty = gwy_component("/0/mask", "o", gwy_field(0.0 * mask, "m", "", SIZE_M))
    assert load_surface(put(tmp_path / "b.gwy", titled(0, "z"), empty)).origin.notes == ()


def test_maps_of_one_name_are_told_apart_and_the_choice_is_said(tmp_path):
    path = put(
        tmp_path / "a.gwy",
        titled(0, "Amplitude", unit_z="V"),
        titled(1, "Height"),
        titled(2, "Height", 2 * MAP),
    )
    first = load_surface(path)
    assert first.origin.dataset == "Height#1"
    assert "'Height#1' of the file was read, not Height#2" in first.origin.notes[0]
    assert not isinstance(first.origin.notes[0], Statement)  # they may be of two faces
    named = load_surface(path, dataset="Height#1")
    np.testing.assert_array_equal(first.height_m, named.height_m)
    assert named.origin.notes == ()
    second = load_surface(path, dataset="Height#2")
    np.testing.assert_allclose(second.height_m, 2 * first.height_m, rtol=1e-15)
    with pytest.raises(UnreadableFileError, match=r"2 channels 'Height'.*Height#1, Height#2"):
        load_surface(path, dataset="Height")
    with pytest.raises(UnreadableFileError, match="expected one of Amplitude, Height#1"):
        load_surface(path, dataset="Phase")
    with pytest.raises(UncalibratedError, match="'Amplitude' is in V"):
        load_surface(path, dataset="Amplitude")


def test_no_map_of_heights_is_an_error(tmp_path):
    with pytest.raises(UnreadableFileError, match="no map of heights among Amplitude"):
        load_surface(put(tmp_path / "a.gwy", titled(0, "Amplitude", unit_z="V")))
    with pytest.raises(UnreadableFileError, match="no map of heights among none"):
        load_surface(put(tmp_path / "b.gwy", OTHERS))


@pytest.mark.parametrize("at", [30, 150, -100, -9])
@pytest.mark.parametrize("change", ["remove", "insert"])
def test_a_byte_more_or_less_is_no_gwy_file(tmp_path, at, change):
    path = put(tmp_path / "a.gwy", titled(0, "Height"))
    content = path.read_bytes()
    changed = content[:at] + (b"" if change == "remove" else b"\0\0") + content[at + 1 :]
    path.write_bytes(changed)
    with pytest.raises(UnreadableFileError, match="damaged"):
        load_surface(path)


# --- files of instruments ---


@shared
@pytest.mark.usefixtures("extra")
@pytest.mark.scans
def test_an_instruments_tiff_reaches_its_reader():
    surface = load_surface(CHANNELS / "example_ps.tiff")
    assert surface.origin.file_format == "vendor"
    np.testing.assert_allclose(surface.side_m, (1e-6, 1e-6), rtol=1e-9)


@shared
@pytest.mark.usefixtures("extra")
@pytest.mark.scans
@pytest.mark.parametrize(
    ("name", "dataset", "words"),
    [
        ("di-1.di", "Height", "2 channels 'Height'.*Height#1, Height#2"),
        ("di-1.di", "Phase", "'Phase' is in no unit of length"),
        ("spot_1-1000nm.ibw", "PhaseTrace", "is in deg"),
        ("spot_1-1000nm.ibw", "NapPotentialTrace", "is in V"),
        ("spot_1-1000nm.ibw", "Height", "no channel 'Height'.*HeightTrace"),
    ],
)
def test_what_is_no_height_is_refused_in_one_line(name, dataset, words):
    with pytest.raises(CapslipError, match=words) as caught:
        load_surface(CHANNELS / name, dataset=dataset)
    assert "\n" not in str(caught.value)


@shared
@pytest.mark.usefixtures("extra")
@pytest.mark.scans
@pytest.mark.parametrize(
    ("name", "first", "other"),
    [("di-1.di", "Height#1", "Height#2"), ("spot_1-1000nm.ibw", "HeightTrace", "HeightRetrace")],
)
def test_the_default_channel_has_a_name_and_is_said(name, first, other):
    surface = load_surface(CHANNELS / name)
    assert surface.origin.dataset == first
    assert f"{first!r} of the file was read, not {other}" in surface.origin.notes[0]
    named = load_surface(CHANNELS / name, dataset=first)
    np.testing.assert_array_equal(surface.height_m, named.height_m)
    assert not np.array_equal(
        surface.height_m, load_surface(CHANNELS / name, dataset=other).height_m
    )


# --- factors of the heights ---

COUNTS = np.arange(12, dtype=float).reshape(3, 4)  # the first row is the top


def bcr(kind="bcrstm", **factors):
    head = {"fileformat": kind, "xpixels": 4, "ypixels": 3, "xlength": 8, "ylength": 9}
    text = "".join(f"{name} = {value}\n" for name, value in {**head, **factors}.items())
    dtype = "<i2" if kind == "bcrstm" else "<f4"
    return text.encode().ljust(2048) + COUNTS.astype(dtype).tobytes()


def opd(**factors):
    stored = np.array([4, 3, 4], "<u2").tobytes() + COUNTS[::-1].T.astype("<f4").tobytes()
    blocks = [("RAW_DATA", 3, stored), ("Pixel_size", 7, struct.pack("<f", 2e-6))]
    blocks += [(name, 7, struct.pack("<f", value)) for name, value in factors.items()]
    blocks.insert(0, ("Directory", 1, bytes(24 * (len(blocks) + 1))))
    heads = (struct.pack("<16shlH", n.encode(), kind, len(c), 0) for n, kind, c in blocks)
    return b"\1\0" + b"".join(heads) + b"".join(content for _, _, content in blocks[1:])


def metropro(scale=0.5, wavelength_m=4096e-9, obliquity=2.0):
    head = bytearray(834)
    struct.pack_into(">4sHI", head, 0, b"\x88\x1b\x03\x6f", 1, 834)
    struct.pack_into(">2HI", head, 68, 4, 3, 48)
    struct.pack_into(">2f", head, 164, scale, wavelength_m)
    struct.pack_into(">f", head, 176, obliquity)
    struct.pack_into(">f", head, 184, 2e-9)
    return bytes(head) + COUNTS.astype(">i4").tobytes()


@pytest.mark.usefixtures("extra")
@pytest.mark.parametrize(
    ("name", "content", "step_m"),
    [
        ("a.bcr", bcr(bit2nm=5), 5e-9),
        ("a.bcrf", bcr("bcrf"), 1e-9),
        ("a.bcrf", bcr("bcrf", bit2nm=0), 1e-9),
        ("a.opd", opd(Wavelength=600.0, Mult=2.0), 300e-9),
        ("a.opd", opd(Wavelength=600.0), 600e-9),
        ("a.dat", metropro(), 1e-9),
    ],
)
def test_heights_are_the_stored_numbers_times_their_factor(tmp_path, name, content, step_m):
    (tmp_path / name).write_bytes(content)
    surface = load_surface(tmp_path / name)
    np.testing.assert_allclose(surface.height_m, step_m * COUNTS[::-1], rtol=1e-6)


@pytest.mark.usefixtures("extra")
@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.bcr", bcr(bit2nm=0), "bit2nm is 0"),
        ("a.bcr", bcr(bit2nm=-5), "bit2nm is -5"),
        ("a.bcr", bcr(bit2nm="nan"), "bit2nm is nan"),
        ("a.bcr", bcr(), "bit2nm is missing"),
        ("a.opd", opd(Wavelength=-600.0, Mult=2.0), "Wavelength is -600"),
        ("a.opd", opd(Wavelength=np.inf, Mult=2.0), "Wavelength is inf"),
        ("a.opd", opd(Wavelength=0.0), "Wavelength is 0"),
        ("a.opd", opd(Wavelength=600.0, Mult=-2.0), "Mult is -2"),
        ("a.dat", metropro(scale=-0.5), "intf_scale_factor is -0.5"),
        ("a.dat", metropro(wavelength_m=0.0), "wavelength_in is 0"),
        ("a.dat", metropro(wavelength_m=-6e-7), "wavelength_in is -6e-07"),
        ("a.dat", metropro(obliquity=-1.0), "obliquity_factor is -1"),
    ],
)
def test_a_factor_of_the_heights_is_a_positive_number(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UnreadableFileError, match=f"{words}; expected a positive number"):
        load_surface(tmp_path / name)
