"""Keyence's CSV: lines of a name and its value, then rows of heights, the top row first.

`***` marks a non-measured point. The header says the counts of rows and columns, the step between
points with its unit and, in some programs, the unit of the heights; what it does not say has to be
given.
"""

import csv
import re
from pathlib import Path

from capslip.errors import UnreadableFileError
from capslip.surface.readers.stored import (
    Format,
    Request,
    Stored,
    check_shape,
    is_length,
    read_head,
)
from capslip.surface.readers.table import decoded, parse_rows, plain_lines, read_text

MAX_HEADER_LINES = 100
HEADER_BYTES = 4096
WORDS = re.compile(
    rb'^"?(horizontal|vertical|xy.?calibration|measurement data|output image data)'
    rb'"?\s*[,;\t]',
    re.IGNORECASE | re.MULTILINE,
)
BLANK = re.compile(rb'"?\*+"?')
STEP = ("xy calibration", "xy-calibration", "xycalibration", "calibration")
UNIT = ("unit of height", "height unit", "unit")


def _recognises(head: bytes, path: Path) -> bool:
    if path.suffix.lower() == ".csv":  # long names of programs and parts come first
        head = read_head(path, HEADER_BYTES)
    return len(WORDS.findall(plain_lines(head))) >= 2


def _read(path: Path, request: Request) -> Stored:
    content = read_text(path)
    fields: dict[str, list[str]] = {}
    start = lines = 0
    while start < len(content) and lines < MAX_HEADER_LINES:
        end = content.find(b"\n", start)
        end = len(content) if end < 0 else end
        words = _words(decoded(content[start:end]))
        if words and (_is_number(words[0]) or re.fullmatch(r"\*+", words[0])):
            break
        if words and words[0]:
            fields[words[0].lower()] = words[1:]
        start, lines = end + 1, lines + 1
    body = BLANK.sub(b"nan", content[start:]).replace(b'"', b"")
    values, notes = parse_rows(body, str(path), lines)
    expected = tuple(_count(fields, name) for name in ("vertical", "horizontal"))
    if None not in expected and values.shape != expected:
        raise UnreadableFileError(
            f"{path}: {values.shape[0]} rows of {values.shape[1]} numbers; expected {expected[0]} "
            f"rows of {expected[1]} as the header says; copy or export it again"
        )
    check_shape(values.shape, str(path))
    step, lateral_unit = _step(fields)
    unit = next((fields[name][0] for name in UNIT if fields.get(name)), None)
    return Stored(
        values,
        unit if unit is not None and is_length(unit) else None,
        None if step is None else (step, step),
        lateral_unit,
        notes,
        top_row_first=True,
    )


def _step(fields: dict[str, list[str]]) -> tuple[float | None, str | None]:
    """Return the step between points, from `XY calibration, 277.4, nm/pixel`."""
    for name in STEP:
        words = fields.get(name, [])
        if words and _is_number(words[0]):
            unit = words[1].partition("/")[0].strip() if len(words) > 1 else ""
            return float(words[0].replace(",", ".")), unit or None
    return None, None


def _count(fields: dict[str, list[str]], name: str) -> int | None:
    words = fields.get(name, [])
    return int(words[0]) if words and words[0].isdecimal() else None


def _words(line: str) -> list[str]:
    separator = next((mark for mark in (";", "\t") if mark in line), ",")
    return [word.strip() for word in next(csv.reader([line], delimiter=separator), [])]


def _is_number(word: str) -> bool:
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True


FORMAT = Format(
    name="keyence",
    extensions=(".csv",),
    reader="built in",
    note="Keyence's CSV with its header; *** is non-measured",
    recognises=_recognises,
    read=_read,
)
