"""Wyko's text export (Vision): a header of names and values, then a line of heights a column.

Each line of the block holds one x, from the lower edge up, as in the maker's binary format. Where
the second number behind the title is 1, heights are in nm, else in wavelengths over `Mult`; the
pixel is in mm along x, and `Aspect` times that along y. The maker does not publish the format: this
is what Gwyddion 2 makes of it. SurfaceTopography 1.27 has the same numbers and units, and alone
knows of heights in nm; it takes the lines for y, against the header, which counts them as X.
"""

from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.stored import Format, Request, Stored, check_positive, check_shape
from capslip.surface.readers.table import decoded, parse_numbers, read_text

MAGIC = b"Wyko ASCII Data File Format 0\t"
HEIGHTS = ("RAW_DATA", "RAW DATA", "OPD", "SAMPLE_DATA")  # names of their block
IN_NM = {"0": False, "1": True}


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith(MAGIC)


def _read(path: Path, request: Request) -> Stored:
    title, _, rest = read_text(path).partition(b"\n")
    given: dict[str, str] = {}
    while True:
        line, end, rest = rest.partition(b"\n")
        name, *words = (one.strip() for one in decoded(line).split("\t"))
        if name in HEIGHTS or not end:
            break
        if words:  # name and value, or name, type, length and value
            given[name] = words[-1]
    if name not in HEIGHTS:
        raise UnreadableFileError(
            f"{path}: no heights; expected one of {', '.join(HEIGHTS)}; the file is truncated, or "
            "was exported without them"
        )
    try:
        nx, ny = int(given["X Size"]), int(given["Y Size"])
        in_nm = IN_NM[decoded(title).split("\t")[1].strip()]
        mult, aspect = (
            check_positive(given.get(name, "1"), name, str(path)) for name in ("Mult", "Aspect")
        )
        unit_m = 1e-9
        if not in_nm:
            unit_m *= check_positive(given["Wavelength"], "Wavelength", str(path)) / mult
        dx_m = 1e-3 * float(given["Pixel_size"])
        dy_m = dx_m * aspect
    except (IndexError, KeyError, ValueError) as error:
        raise UnreadableFileError(
            f"{path}: damaged header ({type(error).__name__}: {error}); expected X Size, Y Size, "
            "Pixel_size, Wavelength and 0 or 1 behind the title; export it again"
        ) from error
    check_shape((ny, nx), str(path))
    values, others = _block(rest, nx, path)
    if values.size != nx * ny:
        raise UnreadableFileError(
            f"{path}: {values.size} heights; expected {nx} lines of {ny} as the header says; copy "
            "or export it again"
        )
    notes = (Statement(f"of several blocks, {name} was read"),) if others else ()
    z_m = unit_m * values.reshape(nx, ny).T
    return Stored(z_m, "m", (dy_m, dx_m), "m", notes=notes, top_row_first=False)


def _block(rest: bytes, nx: int, path: Path) -> tuple[np.ndarray, bool]:
    """Return the heights of as many lines as there are columns, and whether more follows."""
    lines = rest.split(b"\n", nx)
    content = b"\n".join(lines[:nx]).replace(b"Bad", b"nan")
    return parse_numbers(content, str(path)), any(line.strip() for line in lines[nx:])


FORMAT = Format(
    name="wyko",
    extensions=(".asc", ".txt"),
    reader="built in",
    note="text export of Vision; nm, or wavelengths with the header's factor",
    recognises=_recognises,
    read=_read,
)
