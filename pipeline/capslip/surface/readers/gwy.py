"""Gwyddion's own files (.gwy): channels with units, and masks.

An object is a name, the number of its bytes and its components; a component is a name, a letter for
its type and a value (Gwyddion user guide, "Gwyddion native format"). Numbers are little-endian,
heights in the unit of the channel, rows from the top down.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capslip.errors import UncalibratedError, UnreadableFileError
from capslip.surface.readers.choice import choose, note_of_choice, unique_names
from capslip.surface.readers.stored import Format, Request, Stored, check_shape, is_length

MAGIC = b"GWYP"
SIZES = {"b": 1, "c": 1, "i": 4, "q": 8, "d": 8}
NUMBERS = {"i": "<i", "q": "<q", "d": "<d"}
MAX_BYTES = 2**32  # of an object, by the format
MAX_COMPONENTS = 100_000
DATA, TITLE, MASK = (re.compile(rf"/(\d+)/{name}") for name in ("data", "data/title", "mask"))


@dataclass(frozen=True)
class _Part:
    """A component: what its value is and where it lies."""

    name: str
    kind: str
    start: int
    end: int
    count: int = 1


@dataclass(frozen=True)
class _Field:
    """A channel or a mask."""

    shape: tuple[int, int]
    size: tuple[float, float]
    unit: str | None
    lateral_unit: str | None
    start: int


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith(MAGIC)


def _read(path: Path, request: Request) -> Stored:
    content = path.read_bytes()
    try:
        return _stored(content, path, request.dataset)
    except (struct.error, ValueError, KeyError, IndexError) as error:
        raise UnreadableFileError(
            f"{path}: damaged or truncated Gwyddion file ({' '.join(str(error).split())}); "
            "expected a whole one; save it again"
        ) from error


def _stored(content: bytes, path: Path, dataset: str | None) -> Stored:
    fields: dict[int, _Part] = {}
    masks: dict[int, _Part] = {}
    titles: dict[int, str] = {}
    for part in _parts(content, *_object(content, len(MAGIC), len(content))[1:]):
        for pattern, found in ((DATA, fields), (MASK, masks)):
            match = pattern.fullmatch(part.name)
            if match and part.kind == "o":
                found[int(match.group(1))] = part
        match = TITLE.fullmatch(part.name)
        if match and part.kind == "s":
            titles[int(match.group(1))] = _text(content, part)
    numbers = sorted(fields)
    names = unique_names([titles.get(number) for number in numbers])
    maps = [_field(content, fields[number], path) for number in numbers]
    heights = [at for at, one in enumerate(maps) if one.unit is None or is_length(one.unit)]
    chosen = choose(dataset, names, heights, path)
    field, what = maps[chosen], f"{path}: channel {names[chosen]!r}"
    if chosen not in heights:
        raise UncalibratedError(
            f"{what} is in {field.unit}; expected heights in a unit of length; choose another one "
            "with --dataset"
        )
    z = np.frombuffer(content, "<f8", field.shape[0] * field.shape[1], field.start)
    z = z.reshape(field.shape).copy()
    notes = note_of_choice(dataset, names, heights)
    if numbers[chosen] in masks:
        mask = _field(content, masks[numbers[chosen]], path)
        if mask.shape != field.shape:
            raise UnreadableFileError(
                f"{what}: mask of {mask.shape} points; expected {field.shape}; save it again"
            )
        marked = np.frombuffer(content, "<f8", z.size, mask.start).reshape(z.shape) > 0.5
        z[marked] = np.nan
        share = 100.0 * float(marked.mean())
        if marked.any():
            notes += (
                f"{int(marked.sum())} points ({share:.1f} %) under the mask of the channel are "
                "non-measured; remove the mask in Gwyddion if it marks something else",
            )
    dy, dx = (side / n for side, n in zip(field.size, field.shape, strict=True))
    return Stored(
        z,
        field.unit,
        (dy, dx),
        field.lateral_unit,
        notes,
        top_row_first=True,
        dataset=names[chosen] if len(names) > 1 else None,
    )


def _object(content: bytes, start: int, end: int) -> tuple[str, int, int]:
    """Return name, start and end of an object that fills its place exactly."""
    name_end = content.index(b"\0", start, min(end, start + 256))
    (size,) = struct.unpack_from("<I", content, name_end + 1)
    first = name_end + 5
    if first + size != end:
        raise ValueError(f"an object of {size} bytes in a place of {end - first}")
    return content[start:name_end].decode("utf-8", "replace"), first, end


def _parts(content: bytes, start: int, end: int) -> Iterator[_Part]:
    """Yield the components of an object; those inside other objects are left alone."""
    for _ in range(MAX_COMPONENTS):
        if start == end:
            return
        name_end = content.index(b"\0", start, end)
        name = content[start:name_end].decode("utf-8", "replace")
        kind = chr(content[name_end + 1])
        at, count = name_end + 2, 1
        if kind.lower() in SIZES:
            if kind.isupper():
                (count,) = struct.unpack_from("<I", content, at)
                at += 4
            stop = at + count * SIZES[kind.lower()]
        elif kind in "so":
            stop = _end_of(content, at, kind, end)
        elif kind in "SO":
            (count,) = struct.unpack_from("<I", content, at)
            at += 4
            stop = at
            for _ in range(min(count, end - at)):
                stop = _end_of(content, stop, kind.lower(), end)
        else:
            raise ValueError(f"component of type {kind!r} at offset {name_end + 1}")
        if stop > end:
            raise ValueError(f"component at offset {start} ends at {stop}, its object at {end}")
        yield _Part(name, kind, at, stop, count)
        start = stop
    raise ValueError(f"more than {MAX_COMPONENTS} components")


def _end_of(content: bytes, at: int, kind: str, end: int) -> int:
    name_end = content.index(b"\0", at, end)
    if kind == "s":
        return name_end + 1
    return name_end + 5 + int(struct.unpack_from("<I", content, name_end + 1)[0])


def _field(content: bytes, part: _Part, path: Path) -> _Field:
    name, start, end = _object(content, part.start, part.end)
    if name != "GwyDataField":
        raise ValueError(f"{part.name} is a {name[:40]}, not a GwyDataField")
    parts = {item.name: item for item in _parts(content, start, end)}

    def number(key: str) -> float:
        return float(struct.unpack_from(NUMBERS[parts[key].kind], content, parts[key].start)[0])

    shape = int(number("yres")), int(number("xres"))
    check_shape(shape, str(path))
    data = parts["data"]
    if data.kind != "D" or data.count != shape[0] * shape[1]:
        raise ValueError(f"{data.count} heights for {shape[0]} x {shape[1]} points")
    size = number("yreal"), number("xreal")
    units = [_unit(content, parts.get(f"si_unit_{axis}")) for axis in ("z", "xy")]
    return _Field(shape, size, units[0], units[1], data.start)


def _unit(content: bytes, part: _Part | None) -> str | None:
    """Return a unit as the file has it, None where it has an empty word or nothing."""
    if part is None or part.kind != "o":
        return None
    _, start, end = _object(content, part.start, part.end)
    words = [_text(content, p) for p in _parts(content, start, end) if p.name == "unitstr"]
    return (words[0].strip() or None) if words else None


def _text(content: bytes, part: _Part) -> str:
    return content[part.start : part.end - 1].decode("utf-8", "replace")


FORMAT = Format(
    name="gwy",
    extensions=(".gwy",),
    reader="built in",
    note="Gwyddion's channels with units and masks; channel with --dataset",
    recognises=_recognises,
    read=_read,
    named=True,
)
