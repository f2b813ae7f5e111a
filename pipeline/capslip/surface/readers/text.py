"""Text matrices and CSV: one row of the map a line; unit and pixel size come from the user."""

from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.readers.arrays import is_list
from capslip.surface.readers.stored import Format, Request, Stored
from capslip.surface.readers.table import first_fields, read_table

OWN_EXTENSIONS = (".csv", ".tsv")  # of no other text format: what is wrong in them is said here
LABELS = 8  # measured heights do not rise in as many equal steps


def _recognises(head: bytes, path: Path) -> bool:
    return path.suffix.lower() in OWN_EXTENSIONS or first_fields(path) is not None


def _read(path: Path, request: Request) -> Stored:
    table = read_table(path)
    rows, columns = table.values.shape
    if is_list((rows, columns)):
        raise UnreadableFileError(
            f"{path}: {rows} rows of {columns} numbers are a list, not a map; expected a matrix, "
            "or three columns x y z; leave the other columns out"
        )
    _refuse_labels(table.values, path)
    return Stored(table.values, notes=table.notes)


def _refuse_labels(values: np.ndarray, path: Path) -> None:
    """Refuse row and column labels (indices, positions), which would pass for heights."""
    if min(values.shape) < 4:
        return
    for axis, lines in enumerate(("column", "row")):  # of positions, without any across it
        first, *others = values.T if axis == 0 else values
        if (
            len(first) >= LABELS
            and _evenly_stepped(first)
            and not any(map(_evenly_stepped, others))
        ):
            shown = ", ".join(f"{value:g}" for value in first[:4])
            raise UnreadableFileError(
                f"{path}: the first {lines} ({shown}, ...) looks like positions, not heights; "
                "expected heights alone; save the matrix without labels"
            )
    across, down = values[0, 1:], values[1:, 0]
    whole = np.arange(values.shape[1])
    if (
        np.array_equal(values[0], whole)
        or np.array_equal(across, whole[:-1])
        or (_evenly_rising(across) and _evenly_rising(down) and not _evenly_rising(values[1, 1:]))
    ):
        raise UnreadableFileError(
            f"{path}: the first row ({', '.join(f'{v:g}' for v in values[0, :4])}, ...) looks like "
            "labels of the columns, not heights; expected heights alone; save the matrix without "
            "labels"
        )


def _evenly_stepped(values: np.ndarray) -> bool:
    return _evenly_rising(values) or _evenly_rising(-values)


def _evenly_rising(values: np.ndarray) -> bool:
    steps = np.diff(values)
    return bool(steps[0] > 0 and np.allclose(steps, steps[0], rtol=1e-3, atol=0.0))


FORMAT = Format(
    name="text",
    extensions=(".csv", ".tsv", ".txt", ".asc", ".dat"),
    reader="built in",
    note="matrix of numbers; needs --unit, --pixel-size and --lateral-unit",
    recognises=_recognises,
    read=_read,
)
