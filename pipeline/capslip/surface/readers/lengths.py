"""How long a maker's file should be by its own header.

Bytes that were lost or slipped in on the way shift every height behind them, and the library reads
on. Where header and length have to agree, they are compared first. They need not in files of AFM
makers inside TIFF, of which the chain of directories is checked, in DATX and OPDX (the library
follows offsets or blocks and fails where these lead nowhere), nor in VK4, ZON, MNT and PLUX
(archives with checksums, or offsets).
"""

import re
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.readers.stored import check_shape

LOOK_BYTES = 2**17  # the header of the longest kind
DI_DATA = re.compile(rb"\\Data offset: (\d{1,12})\s+\\Data length: (\d{1,12})")
HDF5_MAGIC, HDF5_PLACES = b"\x89HDF\r\n\x1a\n", (0, 512, 1024, 2048, 4096)
AL3D_TAG, AL3D_FIRST = 52, 17
IBW_LABEL = 32
MAX_DIRECTORIES, MAX_TAGS = 1000, 4000
TIFF_PLACES = {273, 279, 324, 325}  # tags: offsets and sizes of strips, and of tiles
TIFF_BYTES = {3: 2, 4: 4, 16: 8}  # of their types
PLU_UNDEFINED = np.float32(1000001.0)


def check_length(path: Path, lenient: bool) -> tuple[str, ...]:
    """Compare the length of a file with what its header says; return notes.

    Raises
    ------
    UnreadableFileError
        If bytes are missing, or, unless `lenient`, there are too many, or a checksum is wrong.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(LOOK_BYTES)
    for magic, count in _KINDS.items():
        if head.startswith(magic) if isinstance(magic, bytes) else path.suffix.lower() in magic:
            try:
                expected = count(head, path, size)
            except (struct.error, ValueError, KeyError, IndexError, OSError) as error:
                raise UnreadableFileError(
                    f"{path}: damaged header ({' '.join(str(error).split())[:200]}); expected the "
                    "sizes of what follows; copy or export it again"
                ) from error
            return compared_length(path, size, expected, lenient)
    return ()


def compared_length(
    path: Path | str, size: int, expected: int | None, lenient: bool
) -> tuple[str, ...]:
    """Refuse a file shorter or longer than its header says; longer and `lenient`: a note."""
    if expected is None or size == expected:
        return ()
    said = f"the file has {size} bytes, but its header describes {expected}"
    if lenient and size > expected:
        return (f"{said}; read anyway",)
    instead = "" if size < expected else ", or set reading.lenient = true to read it all the same"
    raise UnreadableFileError(
        f"{path}: {said}: bytes were {'lost' if size < expected else 'added'}; copy or export it "
        f"again{instead}"
    )


def _hdf5(head: bytes, path: Path, size: int) -> int | None:
    """Return the end of the file by its superblock (HDF5 file format, section II.A)."""
    at = next((at for at in HDF5_PLACES if head[at:].startswith(HDF5_MAGIC)), None)
    if at is None:
        return None
    version = head[at + 8]
    place, sizes = {0: (40, 13), 1: (44, 13), 2: (28, 9), 3: (28, 9)}[version]
    if head[at + sizes] != 8:  # bytes of an offset; others are hardly written
        return None
    return int(struct.unpack_from("<Q", head, at + place)[0])


def _nanoscope(head: bytes, path: Path, size: int) -> int | None:
    places = [(int(at), int(length)) for at, length in DI_DATA.findall(head)]
    return max((at + length for at, length in places), default=None)


def _opd(head: bytes, path: Path, size: int) -> int:
    name, _, directory, _ = struct.unpack_from("<16shiH", head, 2)
    if not name.startswith(b"Directory") or directory % 24 or directory > len(head):
        raise ValueError("no directory of blocks")
    return 2 + sum(struct.unpack_from("<i", head, 2 + 18 + at)[0] for at in range(0, directory, 24))


def _frt(head: bytes, path: Path, size: int) -> int:
    (n_blocks,) = struct.unpack_from("<H", head, 16)
    at = 18
    with path.open("rb") as file:
        for _ in range(n_blocks):
            file.seek(at)
            at += 6 + int(struct.unpack("<HI", file.read(6))[1])
    return at


def _al3d(head: bytes, path: Path, size: int) -> int:
    tags: dict[str, str] = {}
    n_tags = 2
    while len(tags) < n_tags:
        place = AL3D_FIRST + AL3D_TAG * len(tags)
        tag = head[place : place + AL3D_TAG]
        if tag[50:] != b"\r\n":
            raise ValueError(f"no tag at offset {place}")
        key, value = (part.partition(b"\0")[0].decode("latin-1") for part in (tag[:20], tag[20:50]))
        tags[key or f"empty {len(tags)}"] = value
        if key == "TagCount":
            n_tags = min(2 + int(value), 1000)
    rows, columns = int(tags["Rows"]), int(tags["Cols"])
    depth = int(tags["DepthImageOffset"]) + rows * (-(-4 * columns // 8) * 8)
    texture = int(tags.get("TextureImageOffset", "0"))
    if texture == 0:
        return depth
    if texture != depth and texture > int(tags["DepthImageOffset"]):
        raise ValueError(f"heights end at {depth}, the picture begins at {texture}")
    planes = int(tags.get("NumberOfPlanes", "1"))
    return max(depth, texture + planes * rows * (-(-columns // 8) * 8))


def _metropro(head: bytes, path: Path, size: int) -> int:
    (header,) = struct.unpack_from(">I", head, 6)
    width, height, n_buckets = struct.unpack_from(">HHH", head, 52)
    (phase,) = struct.unpack_from(">I", head, 72)
    return int(header) + 2 * width * height * n_buckets + int(phase)


def _plu(head: bytes, path: Path, size: int) -> int | None:
    """Check the range that follows the heights of each layer; more may follow the last."""
    n_layers, n_images = head[489], head[492]
    at = 500
    with path.open("rb") as file:
        for _ in range(n_layers):
            file.seek(at)
            rows, columns = struct.unpack("<II", file.read(8))
            check_shape((rows, columns), str(path))
            z = np.frombuffer(file.read(4 * rows * columns), "<f4")
            said = np.frombuffer(file.read(8), "<f4")
            if z.size < rows * columns or said.size < 2:
                return int(at + 16 + 4 * rows * columns)
            z = z[z != PLU_UNDEFINED]
            ends = np.array([z.min(), z.max()]) if z.size else said
            if not (abs(said) == PLU_UNDEFINED).all() and not np.allclose(said, ends, rtol=1e-4):
                raise ValueError(f"no range of the heights at offset {at + 8 + 4 * rows * columns}")
            at += 16 + rows * columns * (4 + 3 * n_images)
    return None


def _igor(head: bytes, path: Path, size: int) -> int | None:
    """Check what a wave of Igor Pro has: a checksum, and labels in fields of 32 bytes.

    Makers add data of their own behind it, so its end says nothing.
    """
    order = "<" if head[0] else ">"
    (version,) = struct.unpack_from(f"{order}h", head)
    if version != 5:
        return None
    if sum(struct.unpack_from(f"{order}192h", head)) & 0xFFFF:
        raise ValueError("wrong checksum")
    wave, *others = struct.unpack_from(f"{order}15I", head, 4)
    formula, note, unit, *more = others
    units, labels = sum(more[:4]), sum(more[4:8])
    start = 64 + wave + formula + note + unit + units
    with path.open("rb") as file:
        file.seek(start)
        fields = file.read(min(labels, LOOK_BYTES))
    if start + labels > size or len(fields) % IBW_LABEL:
        raise ValueError(f"labels up to offset {start + labels}, but {size} bytes")
    for at in range(0, len(fields), IBW_LABEL):
        field = fields[at : at + IBW_LABEL]
        if field.rstrip(b"\0").find(b"\0") >= 0 or not field.rstrip(b"\0").isascii():
            raise ValueError(f"no label at offset {start + at}: bytes were lost or added before it")
    return None


def _tiff(head: bytes, path: Path, size: int) -> None:
    """Check the chain of directories, along which the library walks without end.

    Where a list of offsets is cut off, the library takes its tag for missing, which is why these
    lists are checked, too.
    """
    order = "<" if head.startswith(b"II") else ">"
    big = head[2:4] in (b"+\0", b"\0+")
    count, entry, pointer = ("Q", 20, "Q") if big else ("H", 12, "I")
    inline = struct.calcsize(pointer)

    def said(letters: str, at: int) -> tuple[int, ...]:
        end = at + struct.calcsize(order + letters)
        if end > size:
            raise UnreadableFileError(
                f"{path}: truncated: its directory up to offset {end} or more, but {size} bytes; "
                "copy the file again"
            )
        file.seek(at)
        return struct.unpack(order + letters, file.read(end - at))

    seen: set[int] = set()
    with path.open("rb") as file:
        (at,) = said(pointer, 8 if big else 4)
        while at:
            (n_tags,) = said(count, at)
            if at in seen or len(seen) >= MAX_DIRECTORIES or n_tags > MAX_TAGS:
                raise ValueError(f"{len(seen) + 1} directories, one of {n_tags} tags")
            seen.add(at)
            tags = at + struct.calcsize(count)
            for place in range(tags, tags + entry * n_tags, entry):
                tag, kind, n, start = said(f"HH{pointer}{pointer}", place)
                n_bytes = n * TIFF_BYTES.get(kind, 0)
                if tag in TIFF_PLACES and n_bytes > inline:
                    said("B", start + n_bytes - 1)
            (at,) = said(pointer, tags + entry * n_tags)


# By the first bytes of the file, or by its extension where it has none of its own
_KINDS: dict[bytes | tuple[str, ...], Callable[[bytes, Path, int], int | None]] = {
    (".plu", ".apx"): _plu,
    b"II*\0": _tiff,
    b"MM\0*": _tiff,
    b"II+\0": _tiff,
    b"MM\0+": _tiff,
    HDF5_MAGIC: _hdf5,
    b"MATLAB 7.3 MAT": _hdf5,
    b"\\*": _nanoscope,
    b"\x01\x00Directory": _opd,
    b"FRTM_GLIDERV1": _frt,
    b"AliconaImaging": _al3d,
    b"\x88\x1b\x03\x6f": _metropro,
    b"\x88\x1b\x03\x70": _metropro,
    b"\x88\x1b\x03\x71": _metropro,
    b"\x05\x00": _igor,
    b"\x00\x05": _igor,
}
