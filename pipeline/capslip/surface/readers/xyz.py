"""XYZ: one point a line, in any order; complete, with holes, jittered, or a true point cloud."""

import re
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.readers.points import grid_points
from capslip.surface.readers.stored import Format, Request, Stored
from capslip.surface.readers.table import Table, first_fields, plain_lines, read_table

OWN_EXTENSION = ".xyz"
NUMBER = re.compile(rb"\s*[-+]?\.?\d")
# A line of words with x, y and z among them
NAMED = re.compile(
    rb"^" + b"".join(rb"(?=[^\n\d]*\b%c\b)" % axis for axis in b"xyz") + rb"[^\n\d]*$",
    re.IGNORECASE | re.MULTILINE,
)
COLUMN_NAME = re.compile(r"([A-Za-z]\w*)(?:\s*[\[(][^\])]*[\])])?")
COLUMN_UNIT = re.compile(r"\b([xyz])\s*[\[(]\s*([^\])\s]+)\s*[\])]", re.IGNORECASE)


def _recognises(head: bytes, path: Path) -> bool:
    n_fields = first_fields(path, names=True)
    if path.suffix.lower() == OWN_EXTENSION:  # of a maker's format too, which begins with words
        return n_fields is not None or NUMBER.match(head) is not None
    return n_fields == 3 or (
        n_fields is not None and n_fields > 3 and NAMED.search(plain_lines(head)) is not None
    )


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
    if columns == 3:
        return points, ()
    return points, (f"columns {_shown(places)} of {columns} were taken for x, y, z",)


def _named_places(comments: tuple[str, ...], columns: int, path: Path) -> list[int]:
    """Return where x, y and z stand by the lines that name every column; empty without one."""
    lines = ([name.lower() for name in COLUMN_NAME.findall(line)] for line in comments)
    named = [
        [names.index(axis) for axis in "xyz"]
        for names in lines
        if len(names) == columns and all(names.count(axis) == 1 for axis in "xyz")
    ]
    for other in named:
        if other != named[-1]:
            raise UnreadableFileError(
                f"{path}: x, y, z are columns {_shown(other)} by one line of names and "
                f"{_shown(named[-1])} by another; expected one order; correct one line"
            )
    return named[-1] if named else []


def _shown(places: list[int]) -> str:
    return ", ".join(str(place + 1) for place in places)


def _units(comments: tuple[str, ...], path: Path) -> tuple[str | None, str | None]:
    """Return the units of z and of x and y where a line of names has them: `x [mm]`."""
    units: dict[str, str] = {}
    for line in comments:
        units.update((axis.lower(), unit) for axis, unit in COLUMN_UNIT.findall(line))
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
