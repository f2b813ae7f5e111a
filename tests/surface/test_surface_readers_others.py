"""Formats of other programs: grids of maps, meshes, text exports, Nanonis, TIFF of counts."""

import io
import struct
from pathlib import Path

import numpy as np
import pytest
import tifffile
from written import BARE, DX_UM, DY_UM, rows_of, writers

from capslip.errors import CapslipError, UncalibratedError, UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers import load_surface

SCANS = Path(__file__).parents[3] / "shared" / "scans"
MAP = np.random.default_rng(6).normal(size=(6, 8)).round(4)
LENGTHS = {"unit": "um", "lateral_unit": "um"}
HOLED = np.where(MAP[2, 3] == MAP, np.nan, MAP)
NY, NX = MAP.shape


def put(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def check(surface, z_um=HOLED, rtol=1e-12, file_format=None):
    np.testing.assert_allclose(1e6 * surface.height_m, z_um, rtol=rtol, atol=1e-12)
    np.testing.assert_allclose(surface.pixel_size_m, (1e-6 * DY_UM, 1e-6 * DX_UM), rtol=1e-6)
    assert file_format in (None, surface.origin.file_format)


# --- grids of maps ---

ESRI = f"ncols {NX}\nnrows {NY}\nxllcorner 5\nyllcorner 7\ndx {DX_UM}\ndy {DY_UM}\n"


@pytest.mark.parametrize(("line", "code"), [("", -9999), ("NODATA_value -1e30\n", -1e30)])
def test_esri_grid_has_its_top_row_first(tmp_path, line, code):
    body = rows_of(np.where(np.isnan(HOLED), code, HOLED)[::-1])
    check(load_surface(put(tmp_path / "a.asc", ESRI + line + body), **LENGTHS), file_format="esri")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (ESRI + "1 2 3\n", "3 numbers; expected 6 rows of 8"),
        (ESRI.replace("dx", "other") + "1 2 3\n", "does not say counts and cellsize"),
        (ESRI.replace(f"{NX}", "99999999"), "99999999 points"),
        (ESRI.replace("xllcorner 5", "xllcorner five") + "1\n", "xllcorner is b'five'"),
    ],
)
def test_odd_esri_grid_is_refused(tmp_path, content, words):
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(put(tmp_path / "a.asc", content), **LENGTHS)


ENDS = (0.0, DX_UM * (NX - 1), 0.0, DY_UM * (NY - 1), -3.0, 3.0)
BLANKED = np.where(np.isnan(HOLED), 1.70141e38, HOLED)
SURFER = {
    "text": f"DSAA\n{NX} {NY}\n{ENDS[0]} {ENDS[1]}\n{ENDS[2]} {ENDS[3]}\n-3 3\n".encode()
    + rows_of(BLANKED).encode(),
    "6": b"DSBB" + struct.pack("<2h6d", NX, NY, *ENDS) + BLANKED.astype("<f4").tobytes(),
    "7": b"DSRB"
    + struct.pack("<2i", 4, 2)
    + b"GRID"
    + struct.pack("<3i8d", 72, NY, NX, 0, 0, DX_UM, DY_UM, -3, 3, 0, 1.70141e38)
    + b"DATA"
    + struct.pack("<i", 8 * NX * NY)
    + BLANKED.astype("<f8").tobytes(),
}


@pytest.mark.parametrize("kind", SURFER)
def test_surfer_grids_begin_with_the_lowest_row(tmp_path, kind):
    surface = load_surface(put(tmp_path / "a.grd", SURFER[kind]), **LENGTHS)
    check(surface, rtol=1e-6 if kind == "6" else 1e-12, file_format="surfer")


@pytest.mark.parametrize(("version", "lost"), [(1, MAP[2, 3] <= MAP), (2, MAP[2, 3] == MAP)])
def test_a_surfer_7_grid_says_by_its_version_what_is_blank(tmp_path, version, lost):
    content = b"DSRB" + struct.pack("<2i", 4, version) + b"GRID"
    content += struct.pack("<3i8d", 72, NY, NX, 0, 0, DX_UM, DY_UM, -3, 3, 0, MAP[2, 3])
    content += b"DATA" + struct.pack("<i", 8 * MAP.size) + MAP.astype("<f8").tobytes()
    surface = load_surface(put(tmp_path / "a.grd", content), **LENGTHS)
    check(surface, np.where(lost, np.nan, MAP))


@pytest.mark.parametrize("kind", SURFER)
@pytest.mark.parametrize(
    "change", [lambda c: c[:-41], lambda c: c[:60] + c[101:], lambda c: c[:10]]
)
def test_a_surfer_grid_of_another_length_is_refused(tmp_path, kind, change):
    with pytest.raises(UnreadableFileError, match=r"Surfer|expected|numbers"):
        load_surface(put(tmp_path / "a.grd", change(SURFER[kind])), **LENGTHS)


# --- meshes and clouds ---


def corners():
    y, x = np.indices(MAP.shape)
    points = np.column_stack([DX_UM * x.ravel(), DY_UM * y.ravel(), MAP.ravel()])
    at = np.arange(MAP.size).reshape(MAP.shape)
    lower = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:]], -1).reshape(-1, 3)
    upper = np.stack([at[:-1, :-1], at[1:, 1:], at[1:, :-1]], -1).reshape(-1, 3)
    return points, np.vstack([lower, upper])


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.stl", {"binary": True}),
        ("a.stl", {"binary": False}),
        ("a.ply", {"binary": True}),
        ("a.ply", {"binary": False}),
        ("a.obj", {}),
    ],
)
def test_a_mesh_that_another_library_wrote(tmp_path, name, options):
    import meshio

    points, triangles = corners()
    meshio.Mesh(points, [("triangle", triangles)]).write(tmp_path / name, **options)
    surface = load_surface(tmp_path / name, **LENGTHS)
    check(surface, MAP, rtol=1e-6, file_format="mesh")
    assert "48 points of the mesh" in surface.origin.notes[0]
    assert all(isinstance(note, Statement) for note in surface.origin.notes)


@pytest.mark.parametrize("digits", [15, 28, 60])
def test_numbers_of_a_mesh_in_text_have_any_length(tmp_path, digits):
    points, triangles = corners()
    words = [" ".join(f"{v:.{digits}e}" for v in 1e-6 * point) for point in points]
    text = "".join(f"v {word}\n" for word in words)
    surface = load_surface(put(tmp_path / "a.obj", text.encode()), unit="m", lateral_unit="m")
    check(surface, MAP, file_format="mesh")
    loops = ("".join(f"vertex {words[i]}\n" for i in triangle) for triangle in triangles)
    facets = "".join(f"facet normal 0 0 1\nouter loop\n{s}endloop\nendfacet\n" for s in loops)
    text = f"solid a\n{facets}endsolid a\n"
    surface = load_surface(put(tmp_path / "a.stl", text.encode()), unit="m", lateral_unit="m")
    check(surface, MAP, file_format="mesh")


def pcd(data, body):
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\n"
        f"WIDTH {MAP.size}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {MAP.size}\nDATA {data}\n"
    )
    return head.encode() + body


def test_pcd_as_text_and_binary(tmp_path):
    points = np.column_stack([corners()[0], np.zeros(MAP.size)])
    text = pcd("ascii", rows_of(points).encode())
    kind = np.dtype([("xyz", "<f4", 3), ("rgb", "<u4")])
    packed = np.zeros(MAP.size, kind)
    packed["xyz"] = points[:, :3]
    for content in (text, pcd("binary", packed.tobytes())):
        check(load_surface(put(tmp_path / "a.pcd", content), **LENGTHS), MAP, rtol=1e-6)
    with pytest.raises(UnreadableFileError, match="binary_compressed; expected ascii"):
        load_surface(put(tmp_path / "a.pcd", pcd("binary_compressed", b"x")), **LENGTHS)


def test_ply_of_points_alone_with_more_columns(tmp_path):
    points = corners()[0]
    kind = np.dtype([("x", ">f8"), ("q", "u1"), ("y", ">f8"), ("z", ">f8")])
    packed = np.zeros(MAP.size, kind)
    packed["x"], packed["y"], packed["z"] = points.T
    head = (
        f"ply\nformat binary_big_endian 1.0\nelement vertex {MAP.size}\nproperty double x\n"
        "property uchar q\nproperty double y\nproperty double z\nend_header\n"
    )
    path = put(tmp_path / "a.ply", head.encode() + packed.tobytes())
    check(load_surface(path, **LENGTHS), MAP)
    with pytest.raises(UnreadableFileError, match="bytes of 48 points"):
        load_surface(put(path, path.read_bytes() + b"\0"), **LENGTHS)


def test_a_truncated_mesh_is_refused(tmp_path):
    import meshio

    points, triangles = corners()
    meshio.Mesh(points, [("triangle", triangles)]).write(tmp_path / "a.stl", binary=True)
    with pytest.raises(UnreadableFileError, match="where 70 facets take 3584"):
        load_surface(put(tmp_path / "a.stl", (tmp_path / "a.stl").read_bytes()[:-50]), **LENGTHS)


# --- text exports ---

KEYENCE = (
    '"Measurement date","2026/01/02"\n"Model","VK-X100"\n"Output image data","Height"\n'
    f'"Horizontal","{NX}"\n"Vertical","{NY}"\n"XY calibration","1000","nm/pixel"\n'
)


def keyence(z, unit='"Unit of height","um"\n'):
    body = "\n".join(",".join(f'"{v:.4f}"' for v in row) for row in z[::-1])
    return KEYENCE + unit + "\n" + body.replace("nan", "***") + "\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-8-sig"])
def test_keyence_csv(tmp_path, encoding):
    path = put(tmp_path / "a.csv", keyence(HOLED).encode(encoding))
    surface = load_surface(path)
    np.testing.assert_allclose(1e6 * surface.height_m, HOLED, rtol=1e-9)
    np.testing.assert_allclose(surface.pixel_size_m, (1e-6, 1e-6))
    assert surface.origin.file_format == "keyence"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_keyence_csv_with_a_long_header(tmp_path, encoding):
    long = '"Measurement data name","' + 40 * "top face of the joint " + '"\n"Scan mode","Fine"\n'
    path = put(tmp_path / "a.csv", (long + keyence(HOLED)).encode(encoding))
    surface = load_surface(path)
    np.testing.assert_allclose(1e6 * surface.height_m, HOLED, rtol=1e-9)
    assert surface.origin.file_format == "keyence"


def test_keyence_csv_without_the_unit_or_a_row(tmp_path):
    with pytest.raises(UncalibratedError, match="--unit"):
        load_surface(put(tmp_path / "a.csv", keyence(MAP, "")))
    with pytest.raises(UnreadableFileError, match="5 rows of 8 numbers; expected 6 rows of 8"):
        load_surface(put(tmp_path / "a.csv", keyence(MAP[1:])))


@pytest.mark.parametrize(
    "words",
    [
        ("Channel", "Width", "Height", "Value units"),
        ("Kanal", "Breite", "Höhe", "Werteinheiten"),
        ("Kanál", "Šířka", "Výška", "Jednotky hodnot"),
        ("チャンネル", "幅", "高さ", "値の単位"),
    ],
)
@pytest.mark.parametrize("comma", [False, True])
def test_gwyddion_ascii_in_any_language(tmp_path, words, comma):
    sizes = f"{DX_UM * NX:.2f}\N{NO-BREAK SPACE}µm", f"{DY_UM * NY:.2f} µm"
    values = ("z: of it", *sizes, "nm")
    text = "".join(f"# {w}: {v}\n" for w, v in zip(words, values, strict=True))
    text += rows_of(1e3 * MAP[::-1], "\t")
    surface = load_surface(put(tmp_path / "a.txt", text.replace(".", ",") if comma else text))
    check(surface, MAP, file_format="gwyddion")


def zygo_of(dat: bytes) -> bytes:
    """Write a binary MetroPro file as its text export, by the offsets of its manual."""
    nx, ny = struct.unpack_from(">2H", dat, 68)
    (n_bytes,) = struct.unpack_from(">I", dat, 72)
    scale, wavelength, _, obliquity, _, lateral = struct.unpack_from(">6f", dat, 164)
    (resolution,) = struct.unpack_from(">h", dat, 218)
    (sign,) = struct.unpack_from(">h", dat, 232)
    phase = np.frombuffer(dat, ">i4", nx * ny, len(dat) - n_bytes)
    lines = [
        "Zygo ASCII Data File - Format 2",
        '1 8 1 5 "date"',
        "0 0 0 0 0 0",
        f"0 0 {nx} {ny}",
        *('"comment"', '"serial"', '"part"'),
        f"0 {scale:.9g} {wavelength:.9g} 0 {obliquity:.9g} 0 {lateral:.9g} 0",
        '0 0 0 0 0 0 "lens"',
        "0 0 0 0 0 0 0 0 0 0",
        f"{resolution} 0 0 0 0 0 0 {sign} 0",
        *('0 ""', "1 0", '"zoom"', "#", "#"),
    ]
    body = "\n".join(" ".join(map(str, part)) for part in np.array_split(phase, len(phase) // 10))
    return ("\n".join(lines) + "\n" + body + "\n#\n").encode()


@pytest.mark.scans
@pytest.mark.skipif(not SCANS.is_dir(), reason="no folder shared/scans beside the project")
def test_zygo_text_is_the_binary_file(tmp_path):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    binary = SCANS / "conformance" / "zygo_metropro_phase_res1.dat"
    text = load_surface(put(tmp_path / "a.asc", zygo_of(binary.read_bytes())))
    other = load_surface(binary)
    np.testing.assert_allclose(text.height_m, other.height_m, rtol=1e-6)
    np.testing.assert_allclose(text.pixel_size_m, other.pixel_size_m, rtol=1e-6)
    assert text.origin.file_format == "zygo"


WYKO = (
    "Wyko ASCII Data File Format 0\t{0}\t1\nX Size\t4\nY Size\t3\n"
    "Block Name\tType\tLength\tValue\nPixel_size\t7\t4\t0.002\nWavelength\t7\t4\t632.8\n"
    "Mult\t7\t4\t2\nRAW_DATA\t3\t48\t\n1\t2\t3\n4\tBad\t6\n7\t8\t9\n10\t11\t12\n"
)


@pytest.mark.parametrize(("flag", "unit_m"), [(0, 632.8e-9 / 2), (1, 1e-9)])
def test_wyko_text_is_in_wavelengths_or_nm(tmp_path, flag, unit_m):
    surface = load_surface(put(tmp_path / "a.asc", WYKO.format(flag)))
    rows = np.array([[1, 4, 7, 10], [2, np.nan, 8, 11], [3, 6, 9, 12]])
    np.testing.assert_allclose(surface.height_m, unit_m * rows)
    np.testing.assert_allclose(surface.pixel_size_m, (2e-6, 2e-6))
    assert surface.origin.file_format == "wyko"
    assert surface.origin.notes == ()
    put(tmp_path / "b.asc", WYKO.format(flag) + "Intensity\t6\t24\t\n1\t2\t3\n")
    (note,) = load_surface(tmp_path / "b.asc").origin.notes
    assert note == "of several blocks, RAW_DATA was read"
    assert isinstance(note, Statement)


def test_wyko_text_is_as_another_reader_has_it(tmp_path):
    text = pytest.importorskip("SurfaceTopography.IO.Text", exc_type=ImportError)
    path = put(tmp_path / "a.asc", WYKO.format(0).replace("Bad", "5"))
    other = text.AscReader(str(path)).topography()
    surface = load_surface(path)
    # theirs is [x, y] in nm, with the lines for y, which the header counts as X
    np.testing.assert_allclose(surface.height_m, 1e-9 * other.heights())
    np.testing.assert_allclose(surface.pixel_size_m, 1e-9 * np.array(other.pixel_size))


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("X Size\t4", "X Size\t5", "12 heights; expected 5 lines of 3"),
        ("RAW_DATA", "Image", "no heights"),
        ("Wavelength\t7\t4\t632.8\n", "", "damaged header"),
        ("Format 0\t0\t1", "Format 0\t2\t1", "damaged header"),
        ("Mult\t7\t4\t2", "Mult\t7\t4\t0", "Mult is 0"),
        ("632.8", "1e999", "Wavelength is inf"),
        ("632.8", "-632.8", "Wavelength is -632.8; expected a positive number"),
        ("\t12\n", "\n", "11 heights"),
    ],
)
def test_a_damaged_wyko_text_is_refused(tmp_path, old, new, word):
    with pytest.raises(UnreadableFileError, match=word):
        load_surface(put(tmp_path / "a.asc", WYKO.format(0).replace(old, new)))


@pytest.mark.parametrize("factor", ["0", "-0.5", "nan", "inf"])
@pytest.mark.parametrize("at", [1, 2, 4])
def test_a_factor_of_zygo_text_is_a_positive_number(tmp_path, at, factor):
    writers()["zygo.txt"][0](tmp_path / "a.txt", MAP)
    lines = (tmp_path / "a.txt").read_text().split("\n")
    words = lines[7].split()
    words[at] = factor
    lines[7] = " ".join(words)
    name = {1: "scale factor", 2: "wavelength", 4: "obliquity factor"}[at]
    with pytest.raises(UnreadableFileError, match=f"{name} is {factor}; expected a positive"):
        load_surface(put(tmp_path / "a.txt", "\n".join(lines)))


def test_a_short_zygo_text_is_refused(tmp_path):
    content = b"Zygo ASCII Data File - Format 2\n1 2\n"
    with pytest.raises(UnreadableFileError, match="damaged header"):
        load_surface(put(tmp_path / "a.asc", content))


@pytest.mark.parametrize(
    ("names", "order"), [("x y z i", [0, 1, 2, 3]), ("i, z, y, x", [3, 2, 1, 0]), (None, None)]
)
def test_xyz_with_more_columns(tmp_path, names, order):
    columns = np.column_stack([corners()[0], np.arange(MAP.size)])
    path = tmp_path / ("a.txt" if names else "a.xyz")
    columns = columns if order is None else columns[:, order]
    text = (names + "\n" if names else "") + rows_of(columns)
    surface = load_surface(put(path, text), **LENGTHS)
    check(surface, MAP, file_format="xyz")
    (note,) = surface.origin.notes
    assert "of 4 were taken for x, y, z" in note
    assert isinstance(note, Statement) == (names is not None)


# --- Nanonis ---


def sxm(z, way="up", unit="m", direction="both", extra=0):
    lines = [
        *(":NANONIS_VERSION:", "2", ":SCAN_PIXELS:", f"       {NX}       {NY}"),
        *(":SCAN_RANGE:", f"  {1e-6 * DX_UM * NX:E}  {1e-6 * DY_UM * NY:E}"),
        *(":SCAN_DIR:", way, ":DATA_INFO:"),
        "\tChannel\tName\tUnit\tDirection\tCalibration\tOffset",
        f"\t14\tZ\t{unit}\t{direction}\t-3E-9\t0",
        *("\t0\tCurrent\tA\tboth\t1E-9\t0", "", ":SCANIT_END:", "", "", ""),
    ]
    first = 1e-6 * (z if way == "up" else z[::-1])
    maps = [first, first[:, ::-1]] if direction == "both" else [first]
    data = b"".join(part.astype(">f4").tobytes() for part in (*maps, first, first))
    return "\n".join(lines).encode() + b"\x1a\x04" + data + bytes(extra)


@pytest.mark.parametrize("way", ["up", "down"])
@pytest.mark.parametrize("dataset", ["Z forward", "Z backward"])
def test_nanonis_scans_lie_as_they_were_scanned(tmp_path, way, dataset):
    surface = load_surface(put(tmp_path / "a.sxm", sxm(HOLED, way)), dataset=dataset)
    check(surface, rtol=1e-6, file_format="sxm")


def test_nanonis_channels(tmp_path):
    surface = load_surface(put(tmp_path / "a.sxm", sxm(MAP)))
    assert "'Z forward' of the file was read, not Z backward" in surface.origin.notes[0]
    assert isinstance(surface.origin.notes[0], Statement)  # two ways over one face
    other = sxm(MAP).replace(b"Current\tA", b"Current\tm")
    several = load_surface(put(tmp_path / "b.sxm", other)).origin.notes[0]
    assert "not Z backward, Current forward, Current backward" in several
    assert not isinstance(several, Statement)
    with pytest.raises(UncalibratedError, match="'Current forward' is in A"):
        load_surface(tmp_path / "a.sxm", dataset="Current forward")
    with pytest.raises(UnreadableFileError, match="bytes were added"):
        load_surface(put(tmp_path / "b.sxm", sxm(MAP, extra=3)))
    with pytest.raises(UnreadableFileError, match="bytes were lost"):
        load_surface(put(tmp_path / "b.sxm", sxm(MAP)[:-1]))
    with pytest.raises(CapslipError, match="damaged header"):
        load_surface(put(tmp_path / "b.sxm", sxm(MAP).replace(b":SCAN_DIR:", b":SCAN_DOR:")))


def test_nanonis_numbers_are_read_in_the_order_of_bytes_that_the_header_says(tmp_path):
    """Read in the other order they were heights of up to 1e38 m."""

    def said(words, order=">f4"):
        head, sign, data = sxm(HOLED).partition(b"\x1a\x04")
        head = head.replace(b":SCAN_PIXELS:", f":SCANIT_TYPE:\n   {words}\n:SCAN_PIXELS:".encode())
        data = np.frombuffer(data, ">f4").astype(order).tobytes()
        return load_surface(put(tmp_path / "a.sxm", head + sign + data), dataset="Z forward")

    check(said("FLOAT            MSBFIRST"), rtol=1e-6, file_format="sxm")
    check(said("FLOAT            LSBFIRST", "<f4"), rtol=1e-6, file_format="sxm")
    with pytest.raises(UnreadableFileError, match="SCANIT_TYPE is INT MSBFIRST; expected FLOAT"):
        said("INT              MSBFIRST")


# --- NMS ---


def nms(tmp_path, z=MAP):
    writers()["a.nms"][0](tmp_path / "a.nms", z)
    return tmp_path / "a.nms"


def test_nms_agrees_with_another_reader(tmp_path):
    """But for the unit of its step, and for one count in 65,535 of the range."""
    library = pytest.importorskip("SurfaceTopography.IO.NMS", exc_type=ImportError)
    surface = load_surface(nms(tmp_path))
    other = library.NMSReader(str(tmp_path / "a.nms")).topography()
    assert other.unit == "µm"
    np.testing.assert_allclose(1e6 * surface.height_m, other.heights().T, rtol=0, atol=3e-4)
    np.testing.assert_allclose(surface.side_m[::-1], 1e-12 * np.array(other.physical_sizes))
    assert surface.origin.file_format == "nms"
    assert "which row is the top" in surface.origin.notes[-1]
    assert isinstance(surface.origin.notes[-1], Statement)


def test_ends_of_the_range_of_nms_are_heights_once_and_no_more(tmp_path):
    z = MAP.copy()
    z[1, 1:4] = z.min() - 1.0
    surface = load_surface(nms(tmp_path, z))
    assert np.isnan(surface.height_m[1, 1:4]).all()
    assert np.isnan(surface.height_m).sum() == 3
    assert "3 points with the count 0" in surface.origin.notes[0]
    assert not isinstance(surface.origin.notes[0], Statement)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda content: content[:-1], "bytes were lost"),
        (lambda content: content + b"x", "bytes were added"),
        (lambda content: content[:1380], "truncated NMS"),
        (lambda content: content[:1368] + bytes(100) + content[1368:], "bytes were added"),
        (lambda content: content[:8] + bytes(8) + content[16:], "two rising ranges"),
        (lambda content: content[:24] + b"\xff" * 8 + content[32:], "two rising ranges"),
    ],
)
def test_a_damaged_nms_is_refused(tmp_path, change, words):
    path = nms(tmp_path)
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(UnreadableFileError, match=words):
        load_surface(path)


# --- TIFF of counts ---


@pytest.mark.parametrize("dtype", ["u2", "i2"])
def test_whole_numbers_in_tiff_need_their_scale(tmp_path, dtype):
    counts = np.round(1000 * MAP + 20000).astype(dtype)
    file = io.BytesIO()
    tifffile.imwrite(file, counts[::-1])
    path = put(tmp_path / "a.tif", file.getvalue())
    with pytest.raises(UnreadableFileError, match=r"whole numbers.*reading\.scale"):
        load_surface(path, **BARE)
    check(load_surface(path, **BARE, scale=0.001), 0.001 * counts)


def test_a_scale_in_the_file_is_never_overridden(tmp_path):
    content = put(tmp_path / "a.sxm", sxm(MAP))
    with pytest.raises(UncalibratedError, match=r"reading\.scale.*never overridden"):
        load_surface(content, scale=2.0)
