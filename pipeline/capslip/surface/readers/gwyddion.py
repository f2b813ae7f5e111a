"""Gwyddion ASCII: a text matrix whose header gives sizes, units and, at times, a scale factor.

Two headers exist. One says `h=... w=...`, `pixel size=... m`, `data unit=...` and
`height conversion factor (-> m)=...`: the numbers are no lengths until multiplied by that factor.
The other is a comment: `# Width: ... um`, `# Height: ... um`, `# Value units: m`, the sizes being
those of the whole field; its words are in the language of the program, their order is not.
"""

import re
from pathlib import Path

from capslip.errors import UnreadableFileError
from capslip.surface.readers.stored import Format, Request, Stored, check_shape, in_one_unit
from capslip.surface.readers.table import decoded, parse_rows, plain_lines, read_text

SIZES = re.compile(rb"[ \t]*h[ \t]*=[ \t]*(\d{1,9})[ \t]+w[ \t]*=[ \t]*(\d{1,9})[ \t]*[\r\n]")
# Whatever the words: a name, two lengths and a unit, in this order
CHANNEL = re.compile(
    rb"#[^:\r\n]+:[^\r\n]*[\r\n]+"
    + 2 * rb"#[^:\r\n]+:\s*[\d.,]+(?:[eE][-+]?\d+)?\s*[^\d\s][^\r\n]*[\r\n]+"
    + rb"(?:#[^:\r\n]+:\s*\S{0,12}\s*[\r\n]+)?"
)
OF_PLACE = ("channel", "width", "height", "value units")
MAX_HEADER_LINES = 50
FACTOR = re.compile(r"height conversion factor\s*\(\s*->\s*(\S+?)\s*\)")


def _recognises(head: bytes, path: Path) -> bool:
    head = plain_lines(head)
    return bool(SIZES.match(head) or CHANNEL.match(head))


def _read(path: Path, request: Request) -> Stored:
    content = read_text(path)
    commented = content.startswith(b"#")
    fields: dict[str, str] = {}
    start = lines = 0
    while start < len(content) and lines < MAX_HEADER_LINES:
        end = content.find(b"\n", start)
        line = decoded(content[start : len(content) if end < 0 else end]).strip()
        if line and (not line.startswith("#") if commented else "=" not in line):
            break
        found = _fields(line.lstrip("# "), ":" if commented else "=")
        if commented and len(fields) < len(OF_PLACE):
            found = {OF_PLACE[len(fields)]: value for value in found.values()}
        fields.update(found)
        start = len(content) if end < 0 else end + 1
        lines += 1
    sizes = SIZES.match(content)
    if sizes:
        expected = int(sizes.group(1)), int(sizes.group(2))
        check_shape(expected, str(path))
    values, notes = parse_rows(content[start:], str(path), lines)
    ny, nx = values.shape
    if not sizes:
        width, unit = _length(fields, "width", path)
        height, unit_y = _length(fields, "height", path)
        pixel = in_one_unit((height / ny, width / nx), (unit_y, unit), str(path))
        return Stored(values, fields.get("value units"), *pixel, notes=notes, top_row_first=True)
    if (ny, nx) != expected:
        raise UnreadableFileError(
            f"{path}: {ny} rows of {nx} numbers; expected {expected[0]} rows of {expected[1]} as "
            "the header says; the file is truncated: copy or export it again"
        )
    size, lateral_unit = _length(fields, "pixel size", path)
    unit = fields.get("data unit")
    factor_name = next((name for name in fields if FACTOR.match(name)), None)
    if factor_name is not None:
        values *= _positive(fields[factor_name], factor_name, path)
        match = FACTOR.match(factor_name)
        unit = match.group(1) if match else None
    return Stored(values, unit, (size, size), lateral_unit, notes=notes, top_row_first=True)


def _fields(line: str, sign: str) -> dict[str, str]:
    name, _, value = line.rpartition(sign) if sign == "=" else line.partition(sign)
    return {name.strip().lower(): value.strip()} if name else {}


def _length(fields: dict[str, str], name: str, path: Path) -> tuple[float, str | None]:
    if name not in fields:
        raise UnreadableFileError(
            f"{path}: the header does not say {name!r}; expected a length; export it again"
        )
    number, *words = fields[name].split(maxsplit=1) or [""]
    unit = " ".join(words)
    return _positive(number.replace(",", "."), name, path), unit.strip() or None


def _positive(text: str, name: str, path: Path) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise UnreadableFileError(
            f"{path}: header says {name}={text[:40]!r}; expected a positive number; export it again"
        )
    return value


FORMAT = Format(
    name="gwyddion",
    extensions=(".txt",),
    reader="built in",
    note="Gwyddion ASCII matrix with its header: sizes, units, height conversion factor",
    recognises=_recognises,
    read=_read,
)
