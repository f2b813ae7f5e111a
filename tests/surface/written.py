"""One map written in every format that can be written here, as that format lays it out."""

import io
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from capslip.surface.heightmap import HeightMap
from capslip.surface.readers.hdf5 import write_hdf5

DY_UM, DX_UM = 2.0, 1.0
BARE = {"unit": "um", "pixel_size": (DY_UM, DX_UM), "lateral_unit": "um"}


def writers() -> dict[str, tuple[Callable[[Path, np.ndarray], Any], dict[str, Any]]]:
    """Return how to write heights in um, y growing with the row, and what else has to be said.

    The key is the name of the file.
    """
    heights = {"unit": "um"}
    return {
        "a.h5": (_native, {}),
        "a.npy": (np.save, BARE),
        "a.npz": (lambda path, z: np.savez(path, z=z), BARE),
        "five.mat": (_mat, BARE),
        "seven.mat": (_mat_7_3, BARE),
        "a.x3p": (_x3p, {}),
        "a.tif": (lambda path, z: _tiff(path, z[::-1], 1), BARE),
        "bottom.tif": (lambda path, z: _tiff(path, z, 4), BARE),
        "binary.sdf": (_sdf_binary, {}),
        "text.sdf": (_sdf_text, {}),
        "a.csv": (lambda path, z: np.savetxt(path, z, delimiter=","), BARE),
        "sized.txt": (_gwyddion_sized, {}),
        "commented.txt": (_gwyddion_commented, {}),
        "a.xyz": (_xyz, {**heights, "lateral_unit": "um"}),
        "a.asc": (_esri, {**heights, "lateral_unit": "um"}),
        "a.grd": (_surfer, {**heights, "lateral_unit": "um"}),
        "a.ply": (_ply, {**heights, "lateral_unit": "um"}),
        "up.sxm": (lambda path, z: _sxm(path, z, "up"), {}),
        "down.sxm": (lambda path, z: _sxm(path, z[::-1], "down"), {}),
        "a.nms": (_nms, {}),
        "zygo.txt": (_zygo, {}),
        "wyko.asc": (_wyko, {}),
        "keyence.csv": (_keyence, {}),
        "a.gwy": (_gwy, {}),
        "a.sur": (_sur, {}),
    }


def _native(path: Path, z: np.ndarray) -> None:
    write_hdf5(HeightMap(1e-6 * z, (1e-6 * DY_UM, 1e-6 * DX_UM)), path)


def _mat(path: Path, z: np.ndarray) -> None:
    from scipy.io import savemat

    savemat(path, {"z": z})


def _mat_7_3(path: Path, z: np.ndarray) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        file["z"] = z.T
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))


def _x3p(path: Path, z: np.ndarray) -> None:
    import x3pio

    x3pio.write(path, 1e-6 * z, x_scale=1e-6 * DX_UM, y_scale=1e-6 * DY_UM)


def _tiff(path: Path, z: np.ndarray, orientation: int) -> None:
    import tifffile

    tifffile.imwrite(path, z, extratags=[(274, "H", 1, orientation, True)])


def _sdf_binary(path: Path, z: np.ndarray) -> None:
    counts = z.shape[1], z.shape[0]
    head = b"bISO-1.0" + b"capslip   " + 2 * b"010120260000"
    head += struct.pack("<HH4d3B", *counts, 1e-6 * DX_UM, 1e-6 * DY_UM, 1e-6, -1.0, 0, 7, 0)
    path.write_bytes(head + z.astype("<f8").tobytes())


def _sdf_text(path: Path, z: np.ndarray) -> None:
    fields = (
        f"NumPoints = {z.shape[1]}\nNumProfiles = {z.shape[0]}\nXscale = {1e-6 * DX_UM}\n"
        f"Yscale = {1e-6 * DY_UM}\nZscale = 1e-6\nZresolution = 0\nCompression = 0\n"
        "DataType = 7\nCheckType = 0\n"
    )
    path.write_text(f"aISO-1.0\nManufacID = capslip\n{fields}*\n{rows_of(z)}*\n")


def _gwyddion_sized(path: Path, z: np.ndarray) -> None:
    # This header knows one pixel size, so rows are doubled to keep the face.
    z = np.repeat(z[::-1], int(DY_UM / DX_UM), axis=0)
    head = f"h={len(z)} w={z.shape[1]}\npixel size={DX_UM} um\ndata unit=um\n"
    path.write_text(head + rows_of(z))


def _gwyddion_commented(path: Path, z: np.ndarray) -> None:
    height, width = z.shape[0] * DY_UM, z.shape[1] * DX_UM
    head = f"# Channel: z\n# Width: {width} µm\n# Height: {height} µm\n# Value units: µm\n"
    path.write_text(head + rows_of(z[::-1]), encoding="utf-8")


def _esri(path: Path, z: np.ndarray) -> None:
    head = f"ncols {z.shape[1]}\nnrows {z.shape[0]}\ndx {DX_UM}\ndy {DY_UM}\n"
    path.write_text(head + rows_of(z[::-1]))


def _surfer(path: Path, z: np.ndarray) -> None:
    x_end, y_end = DX_UM * (z.shape[1] - 1), DY_UM * (z.shape[0] - 1)
    head = f"DSAA\n{z.shape[1]} {z.shape[0]}\n0 {x_end}\n0 {y_end}\n-9 9\n"
    path.write_text(head + rows_of(z))


def _ply(path: Path, z: np.ndarray) -> None:
    y, x = np.indices(z.shape)
    points = np.column_stack([DX_UM * x.ravel(), DY_UM * y.ravel(), z.ravel()])
    names = "".join(f"property double {axis}\n" for axis in "xyz")
    head = f"ply\nformat ascii 1.0\nelement vertex {z.size}\n{names}end_header\n"
    path.write_text(head + rows_of(points))


def _sxm(path: Path, z: np.ndarray, way: str) -> None:
    ny, nx = z.shape
    head = (
        f":NANONIS_VERSION:\n2\n:SCAN_PIXELS:\n {nx} {ny}\n:SCAN_RANGE:\n"
        f" {1e-6 * DX_UM * nx} {1e-6 * DY_UM * ny}\n:SCAN_DIR:\n{way}\n:DATA_INFO:\n"
        "\tChannel\tName\tUnit\tDirection\n\t14\tZ\tm\tforward\n:SCANIT_END:\n\n\n"
    )
    path.write_bytes(head.encode() + b"\x1a\x04" + (1e-6 * z).astype(">f4").tobytes())


def _nms(path: Path, z: np.ndarray) -> None:
    low = float(z.min())
    step = 2.0 ** np.ceil(np.log2(np.ptp(z) / 65535))  # so that heights in such steps are exact
    counts = np.rint((z - low) / step)
    head = bytearray(3468)
    struct.pack_into("<4I2d9s", head, 0, 2, 1, 0, 65535, low, low + 65535 * step, b"OM_MS_2.0")
    struct.pack_into("<2I", head, 1352, len(head), 2)
    struct.pack_into("<2I2d", head, 1368, z.shape[1], z.shape[0], 1e3 * DX_UM, 1e3 * DY_UM)
    path.write_bytes(bytes(head) + counts.astype("<u2").tobytes() + bytes(z.size))


def _zygo(path: Path, z: np.ndarray) -> None:
    z = np.repeat(z[::-1], int(DY_UM / DX_UM), axis=0)
    step_m = 2e-13  # half of a wavelength in 4096 parts
    lines = [
        *("Zygo ASCII Data File - Format 2", '1 8 1 5 "date"', "0 0 0 0 0 0"),
        f"0 0 {z.shape[1]} {len(z)}",
        *('"comment"', '"serial"', '"part"'),
        f"0 0.5 {2 * 4096 * step_m} 0 1 0 {1e-6 * DX_UM} 0",
        *('0 0 0 0 0 0 "lens"', "0 0 0 0 0 0 0 0 0 0", "0 0 0 0 0 0 0 0 0"),
        *('0 ""', "1 0", '"zoom"', "#", "#"),
    ]
    phases = np.round(1e-6 * z / step_m).astype(int)
    path.write_text("\n".join(lines) + "\n" + rows_of(phases) + "#\n")


def _wyko(path: Path, z: np.ndarray) -> None:
    lines = [
        "Wyko ASCII Data File Format 0\t0\t1",
        *(f"X Size\t{z.shape[1]}", f"Y Size\t{len(z)}", "Block Name\tType\tLength\tValue"),
        *(f"Pixel_size\t7\t4\t{1e-3 * DX_UM}", "Wavelength\t7\t4\t632.8", "Mult\t7\t4\t2"),
        *(f"Aspect\t7\t4\t{DY_UM / DX_UM}", "Title\t5\t20\ta face", "RAW_DATA\t3\t48\t"),
    ]
    path.write_text("\n".join(lines) + "\n" + rows_of(1e3 * z.T / (632.8 / 2)))


def _keyence(path: Path, z: np.ndarray) -> None:
    z = np.repeat(z[::-1], int(DY_UM / DX_UM), axis=0)
    head = (
        f'"Horizontal","{z.shape[1]}"\n"Vertical","{len(z)}"\n'
        f'"XY calibration","{1e3 * DX_UM}","nm/pixel"\n"Unit of height","um"\n\n'
    )
    path.write_bytes((head + rows_of(z, ",")).encode("utf-16"))


def _xyz(path: Path, z: np.ndarray) -> None:
    y, x = np.indices(z.shape)
    np.savetxt(path, np.column_stack([DX_UM * x.ravel(), DY_UM * y.ravel(), z.ravel()]))


def rows_of(z: np.ndarray, separator: str = " ") -> str:
    """Return rows of numbers with all their digits."""
    file = io.StringIO()
    np.savetxt(file, z, fmt="%.17g", delimiter=separator)
    return file.getvalue()


def gwy_component(name: str, kind: str, value: bytes) -> bytes:
    """Return a component of a Gwyddion object (Gwyddion user guide, Gwyddion native format)."""
    return name.encode() + b"\0" + kind.encode() + value


def gwy_object(name: str, *components: bytes) -> bytes:
    """Return a Gwyddion object."""
    content = b"".join(components)
    return name.encode() + b"\0" + struct.pack("<I", len(content)) + content


def gwy_field(z: np.ndarray, unit_xy: str, unit_z: str, size: tuple[float, float]) -> bytes:
    """Return a data field, the top row first; `size` is (height, width)."""

    def si_unit(word: str) -> bytes:
        return gwy_object("GwySIUnit", gwy_component("unitstr", "s", word.encode() + b"\0"))

    ny, nx = z.shape
    return gwy_object(
        "GwyDataField",
        gwy_component("xres", "i", struct.pack("<i", nx)),
        gwy_component("yres", "i", struct.pack("<i", ny)),
        gwy_component("xreal", "d", struct.pack("<d", size[1])),
        gwy_component("yreal", "d", struct.pack("<d", size[0])),
        gwy_component("si_unit_xy", "o", si_unit(unit_xy)),
        gwy_component("si_unit_z", "o", si_unit(unit_z)),
        gwy_component("data", "D", struct.pack("<I", z.size) + z.astype("<f8").tobytes()),
    )


def gwy_file(*components: bytes) -> bytes:
    """Return a Gwyddion file."""
    return b"GWYP" + gwy_object("GwyContainer", *components)


def _gwy(path: Path, z: np.ndarray) -> None:
    size = 1e-6 * DY_UM * z.shape[0], 1e-6 * DX_UM * z.shape[1]
    field = gwy_field(1e-6 * z[::-1], "m", "m", size)
    path.write_bytes(
        gwy_file(
            gwy_component("/0/data", "o", field), gwy_component("/0/data/title", "s", b"Height\0")
        )
    )


def sur_header(z_counts: np.ndarray, step_um: float) -> bytes:
    """Return the 512 bytes before the counts of a SUR file, in um (Digital Surf)."""
    ny, nx = z_counts.shape
    text = "<12s4H30s30s5H8xH4i I3f".replace(" ", "")
    head = struct.pack(
        text,
        b"DIGITAL SURF",
        *(0, 1, 1, 2),
        b"height",
        b"test",
        *(0, 0, 0, 0, 0),
        32,
        int(z_counts.min()),
        int(z_counts.max()),
        nx,
        ny,
        nx * ny,
        DX_UM,
        DY_UM,
        step_um,
    )
    words = (b"X", b"Y", b"Z", *(6 * (b"um",)))
    head += b"".join(word.ljust(16, b"\0") for word in words)
    return (head + struct.pack("<3f", 1, 1, 1)).ljust(512, b"\0")


def _sur(path: Path, z: np.ndarray) -> None:
    step_um = 2.0**-20
    counts = np.round(z[::-1] / step_um).astype("<i4")
    path.write_bytes(sur_header(counts, step_um) + counts.tobytes())
