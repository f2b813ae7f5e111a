"""XYZ: one point a line, in any order; complete, with holes, jittered, or a true point cloud.

A line of names may say that the columns are others: row, column and height, say.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.points import grid_indices, grid_points, step_of_indices
from capslip.surface.readers.stored import Format, Request, Stored
from capslip.surface.readers.table import (
    Table,
    decoded,
    first_fields,
    plain_lines,
    read_table,
)
from capslip.units import METRES, SPELLINGS

OWN_EXTENSION = ".xyz"
NUMBER = re.compile(rb"\s*[-+]?\.?\d")
# A line of words with x, y and z among them
NAMED = re.compile(
    rb"^" + b"".join(rb"(?=[^\n\d]*\b%c\b)" % axis for axis in b"xyz") + rb"[^\n\d]*$",
    re.IGNORECASE | re.MULTILINE,
)
AXES = ("x", "y", "z")
HEIGHTS = ("height", "heights", "elevation")  # words for z
COLUMNS = ("col", "cols", "column", "columns")
ROWS = ("row", "rows", "line", "lines")
COUNTED = ((COLUMNS, ROWS), (("j",), ("i",)))  # words for x and y
PIXELS = ("px", "pixel", "pixels")  # units of what counts them
# A row or column called an index: `Row Index`, `row_idx`, `col_px`
INDEX = re.compile(
    rf"(?<!\w)({'|'.join(COLUMNS + ROWS)}|[ij])[ _]+(?:index|idx|number|no|px|pixels?)(?!\w)",
    re.IGNORECASE,
)
CELL = re.compile(r"[;,\t]")  # ends one where names stand between what also parts numbers
UNITS = "|".join(map(re.escape, (*METRES, *SPELLINGS)))
# A word with its unit, if it has one: `x [mm]`, `x (mm)`, `x/mm`, `x_mm`
WORD = re.compile(
    rf"(?<!\w)(\w+?)(?:\s*[\[(]([^\])]{{0,99}})[\])]|(?:\s*/\s*|_)({UNITS})(?!\w)|(?!\w))"
)
LEAD = re.compile(r"^\w\w[\w ]*:")  # as in `columns: x y z`
Z = re.compile(r"\bz(?:\b|_)", re.IGNORECASE)
SHOWN = 60  # letters of a line


@dataclass(frozen=True)
class _Words:
    """The words of a line, in lower case, as x, y and z where they mean these.

    `units` holds the unit of each word, or nothing; `by_row` says that x is a column, and y a row;
    `written` are the words as they stand.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    by_row: bool
    written: tuple[str, ...]


@dataclass(frozen=True)
class _Order:
    """Where x, y and z stand in a row of numbers; `by_row` as that of `_Words`."""

    places: tuple[int, ...]
    by_row: bool = False


def _recognises(head: bytes, path: Path) -> bool:
    n_fields = first_fields(path, names=True)
    if path.suffix.lower() == OWN_EXTENSION:  # of a maker's format too, which begins with words
        return n_fields is not None or NUMBER.match(head) is not None
    if n_fields is None or n_fields < 3:
        return False
    lines = plain_lines(head)
    if n_fields == 3 or NAMED.search(lines) is not None:
        return True
    texts = list(map(decoded, lines.split(b"\n")))
    named = bool(_orders(list(map(_words, texts)), n_fields))
    return named or any(_is_unclear(text, n_fields) for text in texts)


def _read(path: Path, request: Request) -> Stored:
    table = read_table(path, names=True)
    columns = table.values.shape[1]
    order = _order(table.comments, columns, path)
    points, more = _points(table, order, path)
    unit, lateral_unit = _units(table.comments, order, path)
    notes = table.notes + more
    by_row = order is not None and order.by_row
    top_row_first = None if by_row else False  # rows lie as those of a matrix
    column = _height_column(table.comments, order, columns)
    if by_row and (lateral_unit in PIXELS or (lateral_unit is None and _are_indices(points))):
        grid = grid_indices(points, str(path))
        notes += grid.notes
        return Stored(grid.height, unit, notes=notes, top_row_first=top_row_first, column=column)
    grid = grid_points(points, str(path), request.pixel_size_in(lateral_unit))
    notes += grid.notes
    pixels = grid.pixel_size, lateral_unit
    return Stored(grid.height, unit, *pixels, notes, top_row_first, column=column)


def _are_indices(points: np.ndarray) -> bool:
    """Tell whether rows and columns are counted; in other steps they are lengths."""
    return all(step_of_indices(points[:, axis]) == 1 for axis in (0, 1))


def _points(table: Table, order: _Order | None, path: Path) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the columns x y z: by their names where a line before the numbers has them."""
    columns = table.values.shape[1]
    if columns < 3 or (columns > 3 and order is None and path.suffix.lower() != OWN_EXTENSION):
        raise UnreadableFileError(
            f"{path}: {columns} columns; expected three, x y z, or a line with their names; leave "
            "the others out"
        )
    places = (0, 1, 2) if order is None else order.places
    empty = np.isnan(table.values).all(axis=1)  # what spreadsheets add above and below
    points = table.values[~empty][:, list(places)]
    notes = _other_orders(table.comments, columns) if order is None else ()
    by_row = order is not None and order.by_row
    if columns == len(AXES) and not by_row:
        return points, notes
    meanings = "column, row, height" if by_row else "x, y, z"
    taken = f"columns {_shown(places)} of {columns} were taken for {meanings}"
    return points, (taken if order is None else Statement(taken), *notes)


def _order(comments: tuple[str, ...], columns: int, path: Path) -> _Order | None:
    """Return where x, y and z stand by the lines that name the columns; None without one."""
    for line in comments:
        if _is_unclear(line, columns):
            raise UnreadableFileError(
                f"{path}: {line[:SHOWN]!r} names the columns; expected x, y, z, or row, column, "
                "height, each once, with its unit as in row_mm; correct the line"
            )
    orders = _orders(list(map(_words, comments)), columns)
    for other in orders:
        if other != orders[-1]:
            raise UnreadableFileError(
                f"{path}: x, y, z are columns {_told(other)} by one line of names and "
                f"{_told(orders[-1])} by another; expected one order; correct one line"
            )
    return orders[-1] if orders else None


def _height_column(comments: tuple[str, ...], order: _Order | None, columns: int) -> str | None:
    """Return how the column of the heights is called: by the name one sees whether it is depths."""
    for words in map(_words, comments):
        if order is not None and order in _orders([words], columns):
            return words.written[order.places[2]]
        if order is None and len(words.names) == columns and words.names[:2] == AXES[:2]:
            return words.written[2]  # another word than z, in its place
    return None


def _is_unclear(line: str, columns: int) -> bool:
    """Tell whether a line names rows and columns, but not so that each column has one meaning."""
    words = _words(line)
    sizes = {len(CELL.split(line)), *([len(words.names)] if columns == len(AXES) else [])}
    if columns not in sizes or _orders([words], columns):
        return False
    heads = [name.partition("_")[0] for name in words.names]  # of row_pos, too
    if any(map(str.isdigit, heads)) or (set(AXES) <= set(heads) and not words.by_row):
        return False
    has_height = any(head == "z" or head in HEIGHTS for head in heads)
    if words.by_row or _as_axes(heads)[1]:
        return has_height or columns == len(AXES)  # above a matrix it is a remark
    counted = {word for pair in COUNTED for words in pair for word in words}
    places = [head for head in heads if head in counted or head in AXES[:2]]
    return has_height and len(places) > 1 and not counted.isdisjoint(places)


def _orders(lines: list[_Words], columns: int) -> list[_Order]:
    """Return where x, y and z stand in each line with one name a column.

    Without one, in each that begins with the three and goes on, with names of no columns.
    """
    lines = [one for one in lines if all(one.names.count(axis) == 1 for axis in AXES)]
    lines = [one for one in lines if not any(map(str.isdigit, one.names))]
    whole = [one for one in lines if len(one.names) == columns]
    more = [one for one in lines if len(one.names) > columns and set(one.names[:3]) == set(AXES)]
    return [_Order(tuple(map(one.names.index, AXES)), one.by_row) for one in whole or more]


def _other_orders(comments: tuple[str, ...], columns: int) -> tuple[str, ...]:
    """Say which lines seem to name x and y in other places than they were taken from."""
    notes = []
    for line in comments:
        names = [name.partition("_")[0] for name in _words(line).names]  # of x_pos, too
        heads, by_row = _as_axes(names)
        order = [head for head in heads if head in AXES]
        if any(map(str.isdigit, heads)) or not {"x", "y"} <= set(order):
            continue
        other = heads[:2] != ("x", "y") if len(heads) == columns else order != sorted(order)
        # Heights over x and y are a remark
        if (other or by_row) and (len(heads) == columns or Z.search(line)):
            notes.append(
                f"{line[:SHOWN]!r} was not understood as names of columns: columns 1, 2, 3 were "
                "taken for x, y, z"
            )
    return tuple(notes)


def _words(line: str) -> _Words:
    """Return the words of a line, each with its unit or nothing; beside x and y a height is z."""
    line = INDEX.sub(r"\1 [px]", LEAD.sub("", line, count=1))
    found = WORD.findall(line)
    units = tuple((bracket or unit).strip() for _, bracket, unit in found)
    names, by_row = _as_axes([name.lower() for name, _, _ in found])
    if "z" not in names and {"x", "y"} <= set(names):
        names = tuple("z" if name in HEIGHTS else name for name in names)
    if by_row and "z" not in names and len(names) == len(CELL.split(line)) == 3:
        names = tuple(name if name in AXES else "z" for name in names)  # it is no other thing
    return _Words(names, units, by_row, tuple(name for name, _, _ in found))


def _as_axes(names: list[str]) -> tuple[tuple[str, ...], bool]:
    """Return names with a column as x and a row as y where no x and y are, and whether that is so.

    i and j count rows and columns where nothing else is called so; else they count points.
    """
    for columns, rows in COUNTED if not {"x", "y"} <= set(names) else ():
        across, down = ([name for name in names if name in words] for words in (columns, rows))
        if len(across) == len(down) == 1:
            axes = {across[0]: "x", down[0]: "y"}
            return tuple(axes.get(name, name) for name in names), True
    return tuple(names), False


def _shown(places: tuple[int, ...]) -> str:
    return ", ".join(str(place + 1) for place in places)


def _told(order: _Order) -> str:
    return _shown(order.places) + (", y as a row," if order.by_row else "")


def _units(
    comments: tuple[str, ...], order: _Order | None, path: Path
) -> tuple[str | None, str | None]:
    """Return the units of z and of x and y where a line of names has them: `x [mm]`."""
    by_row = order is not None and order.by_row
    units = {
        axis: unit
        for words in map(_words, comments)
        if words.by_row == by_row
        for axis, unit in zip(words.names, words.units, strict=True)
        if axis in AXES and len(unit.split()) == 1
    }
    if units.get("x") != units.get("y"):
        raise UnreadableFileError(
            f"{path}: x in {units.get('x')}, y in {units.get('y')}; expected one unit; convert one"
        )
    return units.get("z"), units.get("x")


FORMAT = Format(
    name="xyz",
    extensions=(".xyz", ".txt", ".csv", ".asc"),
    reader="built in",
    note="three columns x y z, or row column height; needs --unit and --lateral-unit",
    recognises=_recognises,
    read=_read,
)
