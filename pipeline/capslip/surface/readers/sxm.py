"""Nanonis scans (.sxm): a header of `:KEY:` lines, then channels of float32, big-endian as a rule.

Each channel holds one map, or two: forward, and backward with its columns mirrored (Nanonis user
manual, "File formats"). A scan that went up has its lowest line first.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capslip.errors import UncalibratedError, UnreadableFileError, in_short
from capslip.surface.heightmap import Statement
from capslip.surface.readers.choice import choose, note_of_choice, unique_names
from capslip.surface.readers.lengths import compared_length
from capslip.surface.readers.stored import Format, Request, Stored, check_shape, is_length

MAGIC = b":NANONIS_VERSION:"
END, SIGN = b":SCANIT_END:", b"\x1a\x04"
MAX_HEADER_BYTES = 2**20
NUMBERS = {"FLOAT MSBFIRST": ">f4", "FLOAT LSBFIRST": "<f4"}  # by SCANIT_TYPE


@dataclass(frozen=True)
class _Map:
    """One map of a channel: its name, unit, place and whether its columns are mirrored."""

    name: str
    unit: str
    place: int
    mirrored: bool


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith(MAGIC)


def _read(path: Path, request: Request) -> Stored:
    content = path.read_bytes()
    end = content.find(END, 0, MAX_HEADER_BYTES)
    start = content.find(SIGN, max(end, 0), max(end, 0) + 64)
    if end < 0 or start < 0:
        raise UnreadableFileError(
            f"{path}: the header has no end; expected {END.decode()} and the sign of the data; "
            "copy the file again"
        )
    fields = _fields(content[:end].decode("latin-1"))
    try:
        nx, ny = (int(word) for word in fields["SCAN_PIXELS"][0].split())
        width, height = (float(word) for word in fields["SCAN_RANGE"][0].split())
        direction = fields["SCAN_DIR"][0].strip().lower()
        maps = _maps(fields["DATA_INFO"])
        written = fields.get("SCANIT_TYPE", ["FLOAT MSBFIRST"])[0].upper()
    except (KeyError, ValueError, IndexError) as error:
        raise UnreadableFileError(
            f"{path}: damaged header ({type(error).__name__}: {error}); expected SCAN_PIXELS, "
            "SCAN_RANGE, SCAN_DIR and DATA_INFO; copy the file again"
        ) from error
    check_shape((ny, nx), str(path))
    numbers = NUMBERS.get(" ".join(written.split()))
    if numbers is None:
        raise UnreadableFileError(
            f"{path}: SCANIT_TYPE is {in_short(written.strip())}; expected FLOAT MSBFIRST or FLOAT "
            "LSBFIRST; export it again"
        )
    data = start + len(SIGN)
    expected = data + 4 * nx * ny * len(maps)
    notes = compared_length(path, len(content), expected, request.lenient)
    names = unique_names([one.name for one in maps])
    heights = [at for at, one in enumerate(maps) if is_length(one.unit)]
    chosen = choose(request.dataset, names, heights, path)
    choice = note_of_choice(request.dataset, names, heights)
    if len({maps[at].name.rpartition(" ")[0] for at in heights}) == 1:  # two ways over one face
        choice = tuple(map(Statement, choice))
    one = maps[chosen]
    if chosen not in heights:
        raise UncalibratedError(
            f"{path}: channel {names[chosen]!r} is in {one.unit}; expected heights in a unit of "
            "length; choose another one with --dataset"
        )
    z = np.frombuffer(content, numbers, nx * ny, data + 4 * nx * ny * one.place).reshape(ny, nx)
    return Stored(
        z[:, ::-1] if one.mirrored else z,
        one.unit,
        (height / ny, width / nx),
        "m",
        (*notes, *choice),
        top_row_first=direction != "up",
        dataset=names[chosen],
    )


def _fields(header: str) -> dict[str, list[str]]:
    """Return the lines that follow each `:KEY:`."""
    fields: dict[str, list[str]] = {}
    lines: list[str] = []
    for line in header.splitlines():
        if line.startswith(":") and line.rstrip().endswith(":"):
            lines = fields.setdefault(line.strip().strip(":"), [])
        elif line.strip():
            lines.append(line)
    return fields


def _maps(rows: list[str]) -> list[_Map]:
    """Return the maps that the table of channels describes, in the order of their data."""
    maps: list[_Map] = []
    for row in rows[1:]:  # the first names the columns: Channel, Name, Unit, Direction, ...
        _, name, unit, direction = row.split()[:4]
        ways = ("forward", "backward") if direction.lower() == "both" else (direction.lower(),)
        for way in ways:
            maps.append(_Map(f"{name} {way}", unit, len(maps), way == "backward"))
    return maps


FORMAT = Format(
    name="sxm",
    extensions=(".sxm",),
    reader="built in",
    note="Nanonis scans; channel with --dataset, as in 'Z forward'",
    recognises=_recognises,
    read=_read,
    named=True,
)
