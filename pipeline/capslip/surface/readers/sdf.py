"""SDF (ISO 25178-71): text (aISO, aBCR) and binary (bISO, bBCR), versions 1.0 and 2.0.

Lengths are in metres: heights are the stored numbers times `Zscale`. Row i of the map is profile i
of the file. Binary data are little-endian; a big-endian file is told by its header, which makes
sense in one order only.
"""

import re
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.lengths import compared_length
from capslip.surface.readers.stored import Format, Request, Stored, check_shape
from capslip.surface.readers.table import decoded, parse_numbers, read_text

MAGIC = re.compile(rb"[ab](ISO|BCR)-\d\.\d")
VERSIONS = ("0.0", "1.0", "2.0")
DATA_TYPES = ("u1", "u2", "u4", "f4", "i1", "i2", "i4", "f8")
FIELDS = "NumPoints NumProfiles Xscale Yscale Zscale Zresolution Compression DataType CheckType"
SANE_SCALE_M = (1e-15, 1e3)  # of a header read in the right byte order
PRINTED = 1e-5  # relative: a text may write a real marker in six digits
EXTRA_WORDS = (5, 1)  # eight bytes that the software of one maker adds to the header


@dataclass(frozen=True)
class _Header:
    """What both forms say, checked."""

    shape: tuple[int, int]
    pixel_size_m: tuple[float, float]
    z_scale_m: float
    data_type: int


def _recognises(head: bytes, path: Path) -> bool:
    return MAGIC.match(head) is not None


def _read(path: Path, request: Request) -> Stored:
    with path.open("rb") as file:
        magic = file.read(8)
    if magic[5:].decode("latin-1") not in VERSIONS:
        raise UnreadableFileError(
            f"{path}: SDF version {decoded(magic)}; expected one of {', '.join(VERSIONS)}; "
            "export it in version 1.0"
        )
    header, raw, notes = _binary(path, request.lenient) if magic.startswith(b"b") else _text(path)
    with np.errstate(invalid="ignore", over="ignore"):  # odd NaN; infinity is refused later
        heights_m = raw.reshape(header.shape) * header.z_scale_m
    return Stored(heights_m, "m", header.pixel_size_m, "m", notes=notes, top_row_first=False)


def _binary(path: Path, lenient: bool) -> tuple[_Header, np.ndarray, tuple[str, ...]]:
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(128)
        counts = "II" if head[5:8] == b"2.0" else "HH"
        layouts = [struct.Struct(f"{order}8x10x12x12x{counts}4d3B") for order in "<>"]
        start = layouts[0].size
        if len(head) < start:
            raise UnreadableFileError(
                f"{path}: {size} bytes; expected a header of {start}; the file is truncated: "
                "copy it again"
            )
        little, big = (layout.unpack_from(head) for layout in layouts)
        swapped = not _sane(little) and _sane(big)
        header = _header(dict(zip(FIELDS.split(), big if swapped else little, strict=True)), path)
        dtype = np.dtype((">" if swapped else "<") + DATA_TYPES[header.data_type])
        n_points = header.shape[0] * header.shape[1]
        notes: list[str] = []  # by magic, sane scales and exact length
        if swapped:
            notes.append(Statement("the SDF file is big-endian, against its standard"))
        expected = start + n_points * dtype.itemsize
        if size == expected + 8 and struct.unpack_from("<2I", head, start) == EXTRA_WORDS:
            notes.append(Statement("the SDF header has eight bytes more than its standard says"))
            start, expected = start + 8, expected + 8
        if size < expected:
            raise UnreadableFileError(
                f"{path}: truncated: {size} bytes; expected {expected} for {header.shape[0]} x "
                f"{header.shape[1]} points; copy the file again"
            )
        notes += compared_length(path, size, expected, lenient)
        file.seek(start)
        raw = np.frombuffer(file.read(n_points * dtype.itemsize), dtype)
    with np.errstate(invalid="ignore"):  # odd NaN
        heights = raw.astype(np.float64)
    bad = _bad_value(dtype)
    if bad is not None:
        heights[raw == bad] = np.nan
    return header, heights, tuple(notes)


def _text(path: Path) -> tuple[_Header, np.ndarray, tuple[str, ...]]:
    records = re.split(rb"\n[ \t]*\*[ \t]*(?=\n|$)", read_text(path), maxsplit=2)
    lines = [line for line in decoded(records[0]).split("\n")[1:] if line.strip()]
    fields = {name.strip(): value.strip() for name, _, value in (s.partition("=") for s in lines)}
    known = {name.lower(): name for name in FIELDS.split()}
    header = _header({known.get(name.lower(), name): v for name, v in fields.items()}, path)
    if len(records) < 2:
        raise UnreadableFileError(
            f"{path}: no line with an asterisk after the header; expected one, then the heights; "
            "the file is truncated: copy it again"
        )
    content = re.sub(rb"(?i)\bBAD\b", b"nan", records[1])
    raw = parse_numbers(content, str(path))
    expected = header.shape[0] * header.shape[1]
    if raw.size != expected:
        raise UnreadableFileError(
            f"{path}: {raw.size} heights; expected {expected} for {header.shape[0]} profiles of "
            f"{header.shape[1]} points; the file is truncated or damaged: copy it again"
        )
    dtype = np.dtype(DATA_TYPES[header.data_type])
    bad = _bad_value(dtype)
    if bad is not None:
        raw[np.isclose(raw, bad, rtol=PRINTED if dtype.kind == "f" else 0.0, atol=0.0)] = np.nan
    ended = len(records) > 2
    return (
        header,
        raw,
        () if ended else ("the heights have no end sign: the text may be truncated",),
    )


def _header(fields: dict[str, object], path: Path) -> _Header:
    """Check the fields of a header, numbers or text."""

    def number(name: str) -> float:
        try:
            return float(str(fields[name]))
        except (KeyError, ValueError):
            raise UnreadableFileError(
                f"{path}: header field {name} is {str(fields.get(name, 'missing'))[:40]!r}; "
                "expected a number; export it again"
            ) from None

    for name in ("Compression", "CheckType"):
        if number(name) != 0:
            raise UnreadableFileError(
                f"{path}: header field {name} is {number(name):g}; expected 0, plain data; "
                "export it without"
            )
    for name in ("NumProfiles", "NumPoints", "Xscale", "Yscale", "Zscale"):
        whole = name.startswith("Num")
        if not 0 < number(name) < np.inf or (whole and number(name) % 1):
            raise UnreadableFileError(
                f"{path}: header field {name} is {number(name):g}; expected a positive "
                f"{'count' if whole else 'length in metres'}; export it again"
            )
    if number("DataType") not in range(len(DATA_TYPES)):
        raise UnreadableFileError(
            f"{path}: header field DataType is {number('DataType'):g}; expected 0 to "
            f"{len(DATA_TYPES) - 1}; export it again"
        )
    shape = int(number("NumProfiles")), int(number("NumPoints"))
    check_shape(shape, str(path))
    pixel_size_m = number("Yscale"), number("Xscale")
    return _Header(shape, pixel_size_m, number("Zscale"), int(number("DataType")))


def _sane(values: tuple[float, ...]) -> bool:
    """Say whether a binary header makes sense in the byte order it was read in."""
    return all(SANE_SCALE_M[0] < scale < SANE_SCALE_M[1] for scale in values[2:5])


def _bad_value(dtype: np.dtype) -> float | None:
    """Return the number that marks a non-measured point."""
    if dtype.kind == "f":
        return np.finfo(dtype).min
    if dtype.kind == "i":
        return np.iinfo(dtype).min
    return np.iinfo(dtype).max if dtype.itemsize > 1 else None  # all 256 values of u1 are heights


FORMAT = Format(
    name="sdf",
    extensions=(".sdf",),
    reader="built in",
    note="ISO 25178-71 and its BCR forerunner, text and binary",
    recognises=_recognises,
    read=_read,
)
