"""Numbers in text: lines, separators and decimal marks, for the readers of text formats."""

import io
import re
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.stored import check_shape, read_head

COMMENT = (b"#", b"%", b"sep=")  # the last one says to a spreadsheet what separates
# A mark that parts no thousands: not three digits behind it, or not a number of 1 to 999 before
NO_GROUPS = {
    mark: re.compile(
        rb"%b(?:(?!\d{3}(?![\d,.eE]))|(?<!\b[1-9]%b)(?<!\b[1-9]\d%b)(?<!\b[1-9]\d\d%b))"
        % (4 * (re.escape(mark),))
    )
    for mark in (b",", b".")
}
BELOW_THOUSAND = re.compile(rb"(?<![^\s;])[+-]?\d{1,3}(?![^\s;])")  # and whole
LOOK_BYTES = 2**16  # enough for the comments and the first numbers
MAX_BYTES = 2**30
MAX_LINE_BYTES = 2**21  # 80,000 numbers of 25 letters: more is no row of a map


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of numbers of equal length.

    Attributes
    ----------
    values : shape (rows, columns)
        NaN where the text says nan or a field is empty.
    comments : tuple of str
        The lines before the numbers, without their comment signs.
    notes : tuple of str
        What was done beyond reading.
    """

    values: np.ndarray
    comments: tuple[str, ...]
    notes: tuple[str, ...]


def first_fields(path: Path, *, names: bool = False) -> int | None:
    """Count the fields of the first row of numbers; None if the file is no table of numbers.

    The row may follow comments and, with `names`, one line of column names. 0 where all fields are
    empty as far as one looks.
    """
    content = plain_lines(read_head(path, LOOK_BYTES))
    if b"\0" in content:
        return None
    start, first = _first_row(content, names)
    if first == len(content) > start:
        return 0
    row = _line_at(content, first)
    return len(_split(row)) if _is_row(row) else None


def read_table(path: Path, *, names: bool = False) -> Table:
    """Read a file of rows of numbers.

    Separators are tabs, semicolons, commas or blanks; the decimal mark is a point, or a comma
    where the separator is none. Between semicolons numbers may stand in quotes.

    Parameters
    ----------
    path : path
        The file: comments (lines that begin with # or %), then the rows.
    names : bool
        Whether a line of words (names of columns) may stand before the rows.

    Raises
    ------
    UnreadableFileError
        If a word stands where a number belongs, a row is shorter or longer than the others, the
        separator and the decimal mark cannot be told apart, or the file is too large.
    """
    content = read_text(path)
    start, _ = _first_row(content, names)
    before = content[:start].split(b"\n")[:-1]
    comments = tuple(decoded(line).lstrip("#% ").strip() for line in before)
    values, notes = parse_rows(content[start:], str(path), len(before))
    return Table(values, comments, notes)


def parse_rows(body: bytes, where: str, lines_before: int) -> tuple[np.ndarray, tuple[str, ...]]:
    """Turn lines into rows of numbers, with notes; errors as for `read_table`."""
    notes = []
    _check_lines(body, where, lines_before)
    if not body.endswith(b"\n"):
        notes.append("the last line has no end: the text may be truncated")
    _, start = _first_row(body, names=False)
    first = _line_at(body, start)
    if not first:
        raise UnreadableFileError(f"{where}: no numbers; expected rows of numbers; export it again")
    number = lines_before + body.count(b"\n", 0, start) + 1
    _check_first_row(first, where, number)
    separator, decimal_comma = _separator(body, first, where)
    empty = b" \n" if separator == b"\t" else None  # between tabs, tabs alone are a row
    lines_before += body[: -len(body.lstrip(empty))].count(b"\n")
    body = body.strip(empty) + b"\n"
    if len(_split(first)) > 2:  # one tab alone is no row, but an end that some programs write
        body = re.sub(rb"(?:\n *\t? *)+\Z", b"\n", body)
    if decimal_comma:
        notes.append(Statement("decimal commas were read as decimal points"))
        body = body.replace(b",", b".")
    if separator is not None:
        body = _fill_empty_fields(body, separator)
    check_shape((body.count(b"\n"), len(_split(first))), where)
    try:
        values = np.loadtxt(
            io.BytesIO(body),
            delimiter=None if separator is None else separator.decode(),
            comments=None,
            ndmin=2,
            encoding="latin-1",
        )
    except ValueError as error:
        raise UnreadableFileError(
            _fault(body, separator, where, lines_before, number, str(error))
        ) from error
    return values, tuple(notes)


def parse_numbers(content: bytes, where: str) -> np.ndarray:
    """Turn numbers between blanks, in lines of any length, into an array of shape (n,).

    Raises
    ------
    UnreadableFileError
        If a word is no number.
    """
    words = content.split()
    if not words:
        raise UnreadableFileError(f"{where}: no numbers; expected heights; export it again")
    try:
        return np.loadtxt(io.BytesIO(b"\n".join(words)), comments=None, ndmin=1, encoding="latin-1")
    except ValueError as error:
        at = next((i for i, word in enumerate(words) if not _is_number(word)), 0)
        raise UnreadableFileError(
            f"{where}: height {at + 1} of {len(words)} is {_shown(words[at])}; expected a number; "
            "correct it"
        ) from error


def read_text(path: Path) -> bytes:
    """Return the text of a file, its lines ended by a line feed.

    Raises
    ------
    UnreadableFileError
        If the file is too large or holds a zero byte.
    """
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise UnreadableFileError(
            f"{path}: {size} bytes of text; expected at most {MAX_BYTES}; convert it to HDF5"
        )
    content = plain_lines(path.read_bytes())
    at = content.find(b"\0")
    if at >= 0:
        raise UnreadableFileError(
            f"{path}: a zero byte at offset {at} of a text (UTF-16 without its mark?); expected "
            "numbers; save it as UTF-8, or copy the file again"
        )
    return content


def decoded(line: bytes) -> str:
    """Return text in UTF-8 or, failing that, Latin-1 (the micro sign of older programs)."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def plain_lines(content: bytes) -> bytes:
    """Return text in UTF-8 without its mark, lines ended by a line feed; UTF-16 by its mark.

    Quotes around cells between semicolons are left out; commas may stand in them anyway.
    """
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        content = content.decode("utf-16", "replace").encode()
    content = content.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return content.replace(b'"', b"") if b'";"' in content else content


def _check_lines(body: bytes, where: str, lines_before: int) -> None:
    """Refuse, before memory is taken, a line that is longer than any row of a map."""
    if len(body) <= MAX_LINE_BYTES:
        return
    ends = np.flatnonzero(np.frombuffer(body, np.uint8) == ord("\n"))
    sizes = np.diff(ends, prepend=-1, append=len(body)) - 1
    longest = int(np.argmax(sizes))
    if sizes[longest] > MAX_LINE_BYTES:
        raise UnreadableFileError(
            f"{where}: line {lines_before + longest + 1} has {int(sizes[longest])} bytes; expected "
            f"at most {MAX_LINE_BYTES}, a row of a map; write one row a line"
        )


def _line_at(content: bytes, start: int) -> bytes:
    end = content.find(b"\n", start)
    return content[start : len(content) if end < 0 else end].strip(b" ")


def _first_row(content: bytes, names: bool) -> tuple[int, int]:
    """Offsets of the rows, behind comments and a line of names, and of the first with a word."""
    start = at = 0
    while at < len(content):
        line = _line_at(content, at)
        fields = _fields(line)
        if fields and not line.lstrip().startswith(COMMENT):
            if not names or any(map(_is_number, fields)):
                return start, at
            names = False
        end = content.find(b"\n", at)
        at = len(content) if end < 0 else end + 1
        if fields:
            start = at
    return start, at


def _is_row(line: bytes) -> bool:
    fields = _fields(line)
    return bool(fields) and all(map(_is_number, fields))


def _fields(line: bytes) -> list[bytes]:
    """Return the first fields of a line, by whatever separates them."""
    return [field for field in re.split(rb"[\s;,]+", line, maxsplit=100)[:100] if field]


def _split(line: bytes) -> list[bytes]:
    """Fields of a line, by its strongest separator; a trailing one ends no field."""
    separator = b";" if b";" in line else b"\t" if _has_tabs(line) else None
    if separator is not None:
        return line.removesuffix(separator).split(separator)
    line = line.strip()
    words = line.split()
    if len(words) > 1 and not any(w.startswith(b",") or w.endswith(b",") for w in words[:-1]):
        return words
    return line.removesuffix(b",").split(b",") if b"," in line else words


def _has_tabs(row: bytes) -> bool:
    """Tell whether tabs separate: they stand between words, or beside the only number of a row."""
    return b"\t" in row.strip() or (b"\t" in row and _is_number(row))


def _check_first_row(line: bytes, where: str, number: int) -> None:
    """Refuse words before the numbers: what they say, such as a unit, would be lost."""
    words = _fields(line)
    if 2 * sum(map(_is_number, words)) <= len(words):
        first = re.split(rb"[;,\t]", line.strip(), maxsplit=1)[0]
        raise UnreadableFileError(
            f"{where}: line {number}, column 1: {_shown(first)}; expected rows of numbers alone; "
            "put # before lines that are no heights, and give as options what they say"
        )


def _separator(body: bytes, first: bytes, where: str) -> tuple[bytes | None, bool]:
    """Tell the separator (None: blanks), and whether commas are decimal marks."""
    commas = b"," in body
    points = commas and re.search(rb"\d\.|\.\d", body) is not None
    if b";" in body:
        separator = b";"
    elif _has_tabs(first):
        separator = b"\t"
    elif not commas:
        separator = None
    else:
        words = first.split()
        if len(words) == 1 or any(w.startswith(b",") or w.endswith(b",") for w in words):
            if not points and re.search(rb",[+-]?0\d", body):
                raise UnreadableFileError(_ambiguous(where, "0,05 may be one number or two"))
            if not points and len(words) > 1 and _may_be_decimal(body):
                raise UnreadableFileError(_ambiguous(where, "4,4, 9,3 may be two numbers or four"))
            if _may_be_thousands(body.replace(b",", b";"), b";", b"."):
                raise UnreadableFileError(_ambiguous(where, "1.234 may be 1.234 or 1234"))
            return b",", False
        if any(word.count(b",") > 1 for word in words):
            raise UnreadableFileError(_ambiguous(where, "commas and blanks both separate"))
        separator = None
    if not commas:
        if _may_be_thousands(body, separator, b"."):
            raise UnreadableFileError(_ambiguous(where, "1.234 may be 1.234 or 1234"))
        return separator, False
    if points:
        raise UnreadableFileError(_ambiguous(where, "points and commas stand inside numbers"))
    between = b"\\s" if separator is None else re.escape(separator)
    if re.search(rb",[^%s\n]*," % between, body):
        raise UnreadableFileError(_ambiguous(where, "several commas stand inside a number"))
    if _may_be_thousands(body, separator, b","):
        raise UnreadableFileError(_ambiguous(where, "1,234 may be 1.234 or 1234"))
    return separator, True


def _may_be_decimal(body: bytes) -> bool:
    """Tell whether commas beside a blank may separate, and the others be decimal marks."""
    if not re.search(rb"\d,\d", body):
        return False
    counts = set()
    for line in filter(None, map(bytes.strip, body.splitlines())):
        cells = re.split(rb"\s+,\s*|,\s+", line.removesuffix(b",").rstrip())
        counts.add(len(cells))
        if len(counts) > 1 or not all(map(_is_number, filter(None, cells))):
            return False  # as in columns that blanks fill up
    return True


def _may_be_thousands(body: bytes, separator: bytes | None, mark: bytes) -> bool:
    """Tell whether all marks may group digits: less than a thousand then stands without one."""
    if mark not in body or NO_GROUPS[mark].search(body) or not BELOW_THOUSAND.search(body):
        return False
    columns = zip_longest(*(line.split(separator) for line in body.splitlines()), fillvalue=b"")
    return any(
        any(mark in cell for cell in column) and any(map(BELOW_THOUSAND.search, column))
        for column in columns
    )


def _ambiguous(where: str, why: str) -> str:
    return (
        f"{where}: the decimal mark and the separator cannot be told apart ({why}); expected "
        "points in numbers, or commas in numbers and semicolons between them, and nothing between "
        "thousands; save it again"
    )


def _fill_empty_fields(body: bytes, separator: bytes) -> bytes:
    """Write nan into empty fields; a separator at the end of every line ends no field."""
    body = re.sub(rb"[ ]*" + re.escape(separator) + rb"[ ]*", separator, body)
    ends = body.count(separator + b"\n")
    if ends and ends == len(re.findall(rb"[^\n]\n", body)):
        body = body.replace(separator + b"\n", b"\n")
    body = body.replace(separator + b"\n", separator + b"nan\n")
    while separator * 2 in body:
        body = body.replace(separator * 2, separator + b"nan" + separator)
    return (b"nan" if body.startswith(separator) else b"") + body.replace(
        b"\n" + separator, b"\nnan" + separator
    )


def _fault(
    body: bytes, separator: bytes | None, where: str, lines_before: int, first: int, message: str
) -> str:
    """Say where the first fault of a table is, near the row that numpy's message names."""
    rows = [(n, line) for n, line in enumerate(body.split(b"\n"), lines_before + 1) if line.strip()]
    expected = len(next(line for n, line in rows if n == first).split(separator))
    named = re.search(r"\brow (\d+)", message)
    start = max(int(named.group(1)) - 2, 0) if named else 0
    for number, line in rows[start : start + 5]:
        fields = line.split(separator)
        for column, field in enumerate(fields, 1):
            if not _is_number(field):
                return (
                    f"{where}: line {number}, column {column}: {_shown(field)}; expected a number; "
                    "write nan for a non-measured point"
                )
        if len(fields) != expected:
            return (
                f"{where}: line {number} has {len(fields)} numbers; expected {expected} as in "
                f"line {first}; the file is truncated or no table"
            )
    return (
        f"{where}: not a table of numbers ({message[:100]}); expected rows of equal length; "
        "export it again"
    )


def _is_number(field: bytes) -> bool:
    try:
        float(field.replace(b",", b"."))
    except ValueError:
        return False
    return b"_" not in field


def _shown(word: bytes) -> str:
    return repr(decoded(word[:40]))
