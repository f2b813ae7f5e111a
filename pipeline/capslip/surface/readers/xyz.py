"""XYZ: one point a line, in any order; complete, with holes, jittered, or a true point cloud."""

import re
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.points import grid_points
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
UNITS = "|".join(map(re.escape, (*METRES, *SPELLINGS)))
# A word with its unit, if it has one: `x [mm]`, `x (mm)`, `x/mm`, `x_mm`
WORD = re.compile(
    rf"(?<!\w)(\w+?)(?:\s*[\[(]([^\])]{{0,99}})[\])]|(?:\s*/\s*|_)({UNITS})(?!\w)|(?!\w))"
)
LEAD = re.compile(r"^\w\w[\w ]*:")  # as in `columns: x y z`
Z = re.compile(r"\bz(?:\b|_)", re.IGNORECASE)
SHOWN = 60  # letters of a line


def _recognises(head: bytes, path: Path) -> bool:
    n_fields = first_fields(path, names=True)
    if path.suffix.lower() == OWN_EXTENSION:  # of a maker's format too, which begins with words
        return n_fields is not None or NUMBER.match(head) is not None
    if n_fields is None or n_fields < 3:
        return False
    lines = plain_lines(head)
    names = [_names(decoded(line)) for line in lines.split(b"\n")]
    return n_fields == 3 or NAMED.search(lines) is not None or bool(_orders(names, n_fields))


def _read(path: Path, request: Request) -> Stored:
    table = read_table(path, names=True)
    points, more = _points(table, path)
    unit, lateral_unit = _units(table.comments, path)
    grid = grid_points(points, str(path), request.pixel_size_in(lateral_unit))
    notes = table.notes + more + grid.notes
    return Stored(grid.height, unit, grid.pixel_size, lateral_unit, notes, top_row_first=False)


def _points(table: Table, path: Path) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the columns x y z: by their names where a line before the numbers has them."""
    columns = table.values.shape[1]
    named = _named_places(table.comments, columns, path)
    if columns < 3 or (columns > 3 and not named and path.suffix.lower() != OWN_EXTENSION):
        raise UnreadableFileError(
            f"{path}: {columns} columns; expected three, x y z, or a line with their names; leave "
            "the others out"
        )
    places = named or [0, 1, 2]
    empty = np.isnan(table.values).all(axis=1)  # what spreadsheets add above and below
    points = table.values[~empty][:, places]
    notes = () if named else _other_orders(table.comments, columns)
    if columns == 3:
        return points, notes
    taken = f"columns {_shown(places)} of {columns} were taken for x, y, z"
    return points, (Statement(taken) if named else taken, *notes)


def _named_places(comments: tuple[str, ...], columns: int, path: Path) -> list[int]:
    """Return where x, y and z stand by the lines that name the columns; empty without one."""
    named = _orders(list(map(_names, comments)), columns)
    for other in named:
        if other != named[-1]:
            raise UnreadableFileError(
                f"{path}: x, y, z are columns {_shown(other)} by one line of names and "
                f"{_shown(named[-1])} by another; expected one order; correct one line"
            )
    return named[-1] if named else []


def _orders(lines: list[list[str]], columns: int) -> list[list[int]]:
    """Return where x, y and z stand in each line with one name a column.

    Without one, in each that begins with the three and goes on, with names of no columns.
    """
    lines = [names for names in lines if all(names.count(axis) == 1 for axis in AXES)]
    lines = [names for names in lines if not any(map(str.isdigit, names))]
    whole = [names for names in lines if len(names) == columns]
    more = [names for names in lines if len(names) > columns and set(names[:3]) == set(AXES)]
    return [[names.index(axis) for axis in AXES] for names in whole or more]


def _other_orders(comments: tuple[str, ...], columns: int) -> tuple[str, ...]:
    """Say which lines seem to name x and y in other places than they were taken from."""
    notes = []
    for line in comments:
        heads = [name.partition("_")[0] for name in _names(line)]  # of x_pos, too
        order = [head for head in heads if head in AXES]
        if any(map(str.isdigit, heads)) or not {"x", "y"} <= set(order):
            continue
        other = heads[:2] != ["x", "y"] if len(heads) == columns else order != sorted(order)
        if other and (len(heads) == columns or Z.search(line)):  # heights over x and y are a remark
            notes.append(
                f"{line[:SHOWN]!r} was not understood as names of columns: columns 1, 2, 3 were "
                "taken for x, y, z"
            )
    return tuple(notes)


def _words(line: str) -> list[tuple[str, str]]:
    """Return the words of a line, each with its unit or nothing; beside x and y a height is z."""
    found = [
        (name.lower(), (bracket or unit).strip())
        for name, bracket, unit in WORD.findall(LEAD.sub("", line, count=1))
    ]
    names = {name for name, _ in found}
    if "z" in names or not {"x", "y"} <= names:
        return found
    return [("z" if name in HEIGHTS else name, unit) for name, unit in found]


def _names(line: str) -> list[str]:
    return [name for name, _ in _words(line)]


def _shown(places: list[int]) -> str:
    return ", ".join(str(place + 1) for place in places)


def _units(comments: tuple[str, ...], path: Path) -> tuple[str | None, str | None]:
    """Return the units of z and of x and y where a line of names has them: `x [mm]`."""
    units = {
        axis: unit
        for line in comments
        for axis, unit in _words(line)
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
    note="three columns x y z; needs --unit and --lateral-unit",
    recognises=_recognises,
    read=_read,
)
