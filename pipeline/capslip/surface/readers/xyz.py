"""XYZ: one point a line, in any order; complete, with holes, jittered, or a true point cloud."""

import re
from pathlib import Path

from capslip.errors import UnreadableFileError
from capslip.surface.readers.points import grid_points
from capslip.surface.readers.stored import Format, Request, Stored
from capslip.surface.readers.table import first_fields, read_table

OWN_EXTENSION = ".xyz"
NUMBER = re.compile(rb"\s*[-+]?\.?\d")
COLUMN_UNIT = re.compile(r"\b([xyz])\s*[\[(]\s*([^\])\s]+)\s*[\])]", re.IGNORECASE)


def _recognises(head: bytes, path: Path) -> bool:
    n_fields = first_fields(path, names=True)
    if path.suffix.lower() == OWN_EXTENSION:  # of a maker's format too, which begins with words
        return n_fields is not None or NUMBER.match(head) is not None
    return n_fields == 3


def _read(path: Path, request: Request) -> Stored:
    table = read_table(path, names=True)
    if table.values.shape[1] != 3:
        raise UnreadableFileError(
            f"{path}: {table.values.shape[1]} columns; expected three, x y z; leave the others out"
        )
    unit, lateral_unit = _units(table.comments, path)
    grid = grid_points(table.values, str(path), request.pixel_size_in(lateral_unit))
    notes = table.notes + grid.notes
    return Stored(grid.height, unit, grid.pixel_size, lateral_unit, notes, top_row_first=False)


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
