"""CSV with a line of names, x, y and z in metres, one point a line; nan where none is measured."""

import csv
from pathlib import Path

from capslip.output.convert import Face

WHOLE = True
NAMES = ("x [m]", "y [m]", "z [m]")


def write(face: Face, path: Path) -> None:
    """Write the face."""
    x_m = face.x_m.tolist()
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(NAMES)
        for y_m, row_m in zip(face.y_m.tolist(), face.height_m.tolist(), strict=True):
            writer.writerows((x, y_m, z) for x, z in zip(x_m, row_m, strict=True))
