"""X3P (ISO 25178-72): the archive is judged here, its content is read by x3pio.

x3pio silently accepts files in a subfolder and what archivers add. Here those are refused, or
accepted with a note in the lenient mode, which also accepts a wrong checksum.
"""

import math
import re
import zipfile
import zlib
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.leftovers import is_leftover
from capslip.surface.readers.stored import (
    DAMAGED_ZIP,
    Format,
    Request,
    Stored,
    check_growth,
    check_shape,
    zip_holds,
)

MAGIC = b"PK\x03\x04"
MAIN = "main.xml"
MAX_MAIN_BYTES = 2**26
MAX_MAIN_TAGS = 2_200_000  # of the text form, which has two a point: about 6 s of the XML library
HEAD_TAGS, TAGS_A_POINT = 4000, 2
AXIS = re.compile(rb"<(?:\w+:)?(C[XYZ])\s*>(.*?)</(?:\w+:)?C[XYZ]\s*>", re.DOTALL)
SIZE = re.compile(rb"<(?:\w+:)?Size[XY]\s*>\s*(\d{1,10})\s*<")
INCREMENT = re.compile(rb"<(?:\w+:)?Increment\s*>\s*[^<\s]")
WHOLE = re.compile(rb"<(?:\w+:)?DataType\s*>\s*[IL]\s*<")
MAX_ENTRIES = 1000


def _recognises(head: bytes, path: Path) -> bool:
    if not head.startswith(MAGIC):
        return False
    return path.suffix.lower() == ".x3p" or zip_holds(
        path, lambda name: PurePosixPath(name).name == MAIN
    )


def _read(path: Path, request: Request) -> Stored:
    import x3pio

    notes = _archive_notes(path, request.lenient)
    try:
        try:
            stored = _stored(path, notes, verify=True)
        except x3pio.X3pChecksumError as error:
            if not request.lenient:
                raise UnreadableFileError(
                    f"{path}: {_one_line(error)}; expected the file as it was written; export it "
                    "again, or set reading.lenient = true to read it all the same"
                ) from error
            notes += (f"a checksum in the X3P archive is wrong ({_one_line(error)}); read anyway",)
            stored = _stored(path, notes, verify=False)
    except (
        x3pio.X3pError,
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        OSError,
        LookupError,
    ) as error:
        raise UnreadableFileError(
            f"{path}: not readable as X3P ({_one_line(error)}); expected ISO 25178-72; "
            "export it again, or convert it to HDF5"
        ) from error
    return stored


def _archive_notes(path: Path, lenient: bool) -> tuple[str, ...]:
    """Refuse an archive that is no X3P file; return a note for each leniency it needs."""
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            for entry in entries:
                _check_entry(entry, path)
            files = {_name(entry): entry for entry in entries if not _name(entry).endswith("/")}
            names = list(files)
            if len(set(map(_name, entries))) != len(entries) or len(entries) > MAX_ENTRIES:
                raise UnreadableFileError(
                    f"{path}: {len(entries)} entries in the archive, {len(names)} names of files; "
                    f"expected at most {MAX_ENTRIES}, each name once; export it again"
                )
            junk = [name for name in names if any(map(is_leftover, name.split("/")))]
            mains = [n for n in names if PurePosixPath(n).name == MAIN and n not in junk]
            if MAIN not in names and len(mains) != 1:
                raise UnreadableFileError(
                    f"{path}: {len(mains)} files {MAIN} in subfolders of the archive, none at its "
                    "top; expected one at the top; export it again"
                )
            main = MAIN if MAIN in names else mains[0]
            _check_main(archive, files[main], path)
    except DAMAGED_ZIP as error:
        raise UnreadableFileError(
            f"{path}: damaged or truncated archive ({_one_line(error)}); expected a whole X3P "
            "file; copy or export it again"
        ) from error
    leniencies = []
    if main != MAIN:
        leniencies.append(f"{MAIN} lies in a subfolder of the X3P archive ({main})")
    if junk:
        leniencies.append(f"the X3P archive holds files that are not its own ({junk[0]})")
    if leniencies and not lenient:
        raise UnreadableFileError(
            f"{path}: {'; '.join(leniencies)}; expected an archive as an instrument writes it; "
            "export it again, or set reading.lenient = true to read it all the same"
        )
    return tuple(f"{text}; read anyway" for text in leniencies)


def _check_entry(entry: zipfile.ZipInfo, path: Path) -> None:
    name = _name(entry)
    if name.startswith("/") or ":" in name or ".." in name.split("/"):
        raise UnreadableFileError(
            f"{path}: entry {name!r} points out of the archive; expected names inside it; "
            "do not trust this file"
        )
    if entry.flag_bits & 1:
        raise UnreadableFileError(
            f"{path}: entry {name!r} is encrypted; expected a plain X3P archive; export it again"
        )
    check_growth(entry.compress_size, entry.file_size, f"{path}: entry {name!r}")


def _check_main(archive: zipfile.ZipFile, main: zipfile.ZipInfo, path: Path) -> None:
    if main.file_size > MAX_MAIN_BYTES:
        raise UnreadableFileError(
            f"{path}: {MAIN} has {main.file_size} bytes; expected at most {MAX_MAIN_BYTES}; store "
            "the heights in binary form"
        )
    content = archive.read(main)
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise UnreadableFileError(
            f"{path}: {MAIN} declares a document type or XML entities; expected plain XML; "
            "do not trust this file"
        )
    sizes = [int(size) for size in SIZE.findall(content)][:2]
    most = min(MAX_MAIN_TAGS, HEAD_TAGS + TAGS_A_POINT * math.prod(sizes))
    n_tags = content.count(b"<")
    if n_tags > most:
        raise UnreadableFileError(
            f"{path}: {MAIN} has {n_tags} XML tags; expected at most {most} for "
            f"{' x '.join(map(str, sizes)) or 'no'} points; store the heights in binary form"
        )
    _check_axes(content, path)


def _check_axes(content: bytes, path: Path) -> None:
    """Refuse axes without a step, which x3pio takes for 1 m."""
    for axis, block in AXIS.findall(content):
        if INCREMENT.search(block) is None and (axis != b"CZ" or WHOLE.search(block)):
            raise UnreadableFileError(
                f"{path}: {MAIN} says no Increment of the axis {axis.decode()}; expected the step "
                "in metres; export it again"
            )


def _name(entry: zipfile.ZipInfo) -> str:
    return entry.filename.replace("\\", "/")


def _stored(path: Path, notes: tuple[str, ...], verify: bool) -> Stored:
    import x3pio

    info = x3pio.info(path, verify=verify)
    _check_kind(info, path)
    file = x3pio.read(path, verify=verify)
    # Heights are along the z axis of the file's own frame: a placement (offset, rotation) in a
    # wider frame shifts and turns the whole face and says nothing of its relief.
    header = info.header
    return Stored(
        height=np.asarray(file.layers[0].z, dtype=np.float64),
        unit="m",
        pixel_size=(header.y.increment, header.x.increment),
        lateral_unit="m",
        notes=notes,
        top_row_first=False,
    )


def _check_kind(info: Any, path: Path) -> None:
    if info.feature_type.value != "SUR":
        raise UnreadableFileError(
            f"{path}: feature type {info.feature_type.value}; expected SUR, a surface on a grid; "
            "export the height map, not a profile or a point cloud"
        )
    if info.layer_count != 1:
        raise UnreadableFileError(
            f"{path}: {info.layer_count} layers; expected one; export the layer to analyse alone"
        )
    if not (info.header.x.is_incremental and info.header.y.is_incremental):
        raise UnreadableFileError(
            f"{path}: x or y is stored point by point; expected a regular grid (incremental axes); "
            "resample the scan"
        )
    if info.header.z.increment < 0:
        raise UnreadableFileError(
            f"{path}: z increment {info.header.z.increment:g}; expected a positive one, heights "
            "that grow out of the material; export it again"
        )
    check_shape(info.shape, str(path))


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


FORMAT = Format(
    name="x3p",
    extensions=(".x3p",),
    reader="x3pio",
    note="ISO 25178-72, one surface on a regular grid; odd archives with reading.lenient",
    recognises=_recognises,
    read=_read,
)
