"""SUR of Digital Surf (MountainsMap and instruments that write it), plain and compressed.

A header of 512 bytes, a comment and a private zone, then whole numbers row by row from the top
(MountainsMap reference guide, "Format of SUR files"). Compressed: the number of streams, the raw
and packed size of each, then the streams (zlib).
"""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.readers.lengths import compared_length
from capslip.surface.readers.stored import (
    Format,
    Request,
    Stored,
    check_growth,
    check_shape,
    in_one_unit,
)

PLAIN, COMPRESSED = b"DIGITAL SURF", b"DSCOMPRESSED"
HEADER_BYTES = 512
SURFACE = 2  # kind of object
MAX_STREAMS = 1024
# How heights are turned: not, upside down, and both mirrored as well (along x, along y)
NOT_TURNED, TURNED, TURNED_X, TURNED_Y = range(4)


@dataclass(frozen=True)
class _Header:
    """What the 512 bytes say, checked."""

    kind: int
    n_objects: int
    has_blanks: bool
    dtype: np.dtype
    lowest: int
    shape: tuple[int, int]
    step: tuple[float, float, float]  # z, y, x
    units: tuple[str, str, str]
    turned: int
    start: int


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith((PLAIN, COMPRESSED))


def _read(path: Path, request: Request) -> Stored:
    content = path.read_bytes()
    header = _header(content, path)
    if header.kind != SURFACE:
        raise UnreadableFileError(
            f"{path}: object of kind {header.kind}; expected {SURFACE}, a surface; export the "
            "height map alone"
        )
    ny, nx = header.shape
    n_bytes = ny * nx * header.dtype.itemsize
    notes: tuple[str, ...] = ()
    if content.startswith(COMPRESSED):
        data, end = _unpacked(content, header.start, n_bytes, path)
    else:
        data, end = content[header.start : header.start + n_bytes], header.start + n_bytes
    if header.n_objects > 1:
        notes = (f"the first of {header.n_objects} maps of the file was read",)
    else:
        notes = compared_length(path, len(content), end, request.lenient)
    if len(data) < n_bytes:
        raise UnreadableFileError(
            f"{path}: truncated: {len(data)} bytes of heights; expected {n_bytes} for {ny} x {nx} "
            "points; copy the file again"
        )
    counts = np.frombuffer(data, header.dtype, ny * nx).reshape(header.shape)
    z = counts * header.step[0]
    if header.has_blanks:
        z[counts == header.lowest - 2] = np.nan
    if header.turned != NOT_TURNED:
        z = -z
    z = {TURNED_X: z[:, ::-1], TURNED_Y: z[::-1]}.get(header.turned, z)
    unit_z, unit_y, unit_x = header.units
    pixel = in_one_unit(header.step[1:], (unit_y, unit_x), str(path))
    return Stored(z, unit_z, *pixel, notes, top_row_first=True)


def _header(content: bytes, path: Path) -> _Header:
    if len(content) < HEADER_BYTES:
        raise UnreadableFileError(
            f"{path}: {len(content)} bytes; expected a header of {HEADER_BYTES}; the file is "
            "truncated: copy it again"
        )
    _, n_objects, _, kind = struct.unpack_from("<4H", content, 12)
    (special,) = struct.unpack_from("<H", content, 86)
    (bits,) = struct.unpack_from("<H", content, 98)
    lowest, _, nx, ny, n_points = struct.unpack_from("<5i", content, 100)
    dx, dy, dz = struct.unpack_from("<3f", content, 120)
    words = [_word(content[at : at + 16]) for at in range(180, 276, 16)]
    (turned,) = struct.unpack_from("<H", content, 290)
    comment, private = struct.unpack_from("<2H", content, 334)
    check_shape((ny, nx), str(path))
    problem = None
    if bits not in (16, 32):
        problem = f"{bits} bits a point; expected 16 or 32"
    elif n_points != nx * ny:
        problem = f"{n_points} points; expected {nx} x {ny}"
    elif not 0.0 < dz < np.inf:
        problem = f"a height step of {dz:g}; expected a positive number"
    elif turned not in range(4):
        problem = f"inversion {turned}; expected 0 to 3"
    if problem:
        raise UnreadableFileError(f"{path}: the header says {problem}; export it again")
    return _Header(
        kind=kind,
        n_objects=n_objects,
        has_blanks=special == 1,
        dtype=np.dtype("<i2" if bits == 16 else "<i4"),
        lowest=lowest,
        shape=(ny, nx),
        step=(float(dz), float(dy), float(dx)),
        units=(words[2], words[1], words[0]),  # of the steps; those of the axes follow
        turned=turned,
        start=HEADER_BYTES + comment + private,
    )


def _word(field: bytes) -> str:
    """Return a unit; older files have the micro sign of MS-DOS."""
    return field.partition(b"\0")[0].replace(b"\xe6", b"\xb5").decode("latin-1").strip()


def _unpacked(content: bytes, start: int, n_bytes: int, path: Path) -> tuple[bytes, int]:
    """Return the heights of a compressed file, and where the last stream ends."""
    parts, total = [], 0
    try:
        (n_streams,) = struct.unpack_from("<I", content, start)
        if n_streams > MAX_STREAMS:
            raise ValueError(f"{n_streams} streams")
        sizes = struct.unpack_from(f"<{2 * n_streams}I", content, start + 4)
        at = start + 4 + 8 * n_streams
        for raw, packed in zip(sizes[::2], sizes[1::2], strict=True):
            check_growth(packed, raw, str(path))
            total += raw
            if total > n_bytes or at + packed > len(content):
                raise ValueError(f"{total} bytes of heights in {len(content)} bytes")
            part = zlib.decompressobj().decompress(content[at : at + packed], raw + 1)
            if len(part) != raw:
                raise ValueError(f"a stream of {len(part)} bytes; expected {raw}")
            parts.append(part)
            at += packed
    except (struct.error, zlib.error, ValueError) as error:
        raise UnreadableFileError(
            f"{path}: damaged or truncated compressed heights ({' '.join(str(error).split())}); "
            "copy or export it again"
        ) from error
    return b"".join(parts), at


FORMAT = Format(
    name="sur",
    extensions=(".sur",),
    reader="built in",
    note="Digital Surf, one surface, plain or compressed",
    recognises=_recognises,
    read=_read,
)
