"""ESRI ASCII grid: counts, corner and cell size, then rows from the top (north) down.

What GIS and image programs export. It knows no units.
"""

import re
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.readers.stored import Format, Request, Stored, check_shape
from capslip.surface.readers.table import parse_numbers, read_text

START = re.compile(rb"\s*ncols\s+\d+", re.IGNORECASE)
LINE = re.compile(rb"[ \t]*([a-z_]+)[ \t]+(\S+)[ \t]*(?:\n|$)", re.IGNORECASE)
NO_DATA = -9999.0  # where the file does not say another


def _recognises(head: bytes, path: Path) -> bool:
    return START.match(head) is not None


def _read(path: Path, request: Request) -> Stored:
    content = read_text(path)
    fields: dict[str, float] = {}
    at = len(content) - len(content.lstrip())
    while match := LINE.match(content, at):
        name = match.group(1).decode().lower()
        try:
            fields[name] = float(match.group(2))
        except ValueError:
            raise UnreadableFileError(
                f"{path}: header field {name} is {match.group(2)[:40]!r}; expected a number; "
                "export it again"
            ) from None
        at = match.end()
    missing = [name for name in ("ncols", "nrows") if name not in fields]
    dy, dx = (fields.get(name, fields.get("cellsize", 0.0)) for name in ("dy", "dx"))
    counts = [fields[name] for name in fields if name in ("ncols", "nrows")]
    if missing or not (dx > 0 and dy > 0) or not all(0 < n < 2**31 for n in counts):
        said = " and ".join(missing) or "counts and cellsize"
        raise UnreadableFileError(
            f"{path}: the header does not say {said}; expected ncols, nrows and cellsize; export "
            "it again"
        )
    shape = int(fields["nrows"]), int(fields["ncols"])
    check_shape(shape, str(path))
    z = parse_numbers(content[at:], str(path))
    if z.size != shape[0] * shape[1]:
        raise UnreadableFileError(
            f"{path}: {z.size} numbers; expected {shape[0]} rows of {shape[1]} as the header says; "
            "copy or export it again"
        )
    z = z.reshape(shape)
    blank = z == fields.get("nodata_value", NO_DATA)
    return Stored(np.where(blank, np.nan, z), pixel_size=(dy, dx), top_row_first=True)


FORMAT = Format(
    name="esri",
    extensions=(".asc", ".grd"),
    reader="built in",
    note="ESRI ASCII grid; needs --unit and --lateral-unit",
    recognises=_recognises,
    read=_read,
)
