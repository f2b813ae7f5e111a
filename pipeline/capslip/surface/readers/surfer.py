"""Surfer grids of Golden Software: text (DSAA), binary of version 6 (DSBB) and 7 (DSRB).

Nodes from the lowest y up, as published in Surfer's help ("Surfer 6 and 7 grid file format"). They
know no units.
"""

import struct
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.readers.stored import Format, Request, Stored, check_shape
from capslip.surface.readers.table import parse_numbers, read_text

TEXT, BINARY_6, BINARY_7 = b"DSAA", b"DSBB", b"DSRB"
BLANK = 1.70141e38  # and beyond
GRID, DATA = b"GRID", b"DATA"
GRID_LAYOUT = struct.Struct("<2i8d")


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith((TEXT, BINARY_6, BINARY_7))


def _read(path: Path, request: Request) -> Stored:
    with path.open("rb") as file:
        kind = file.read(4)
    read = {TEXT: _text, BINARY_6: _binary_6, BINARY_7: _binary_7}[kind]
    try:
        z, step = read(path)
    except (struct.error, ValueError, OverflowError) as error:
        raise UnreadableFileError(
            f"{path}: damaged or truncated Surfer grid ({' '.join(str(error).split())}); copy or "
            "export it again"
        ) from error
    return Stored(z, pixel_size=step, top_row_first=False)


def _text(path: Path) -> tuple[np.ndarray, tuple[float, float]]:
    numbers = parse_numbers(read_text(path)[len(TEXT) :], str(path))
    if numbers.size < 8:
        raise ValueError(f"{numbers.size} numbers")
    nx, ny, *ends = numbers[:8]
    return _grid(numbers[8:], (int(ny), int(nx)), ends, path)


def _binary_6(path: Path) -> tuple[np.ndarray, tuple[float, float]]:
    content = path.read_bytes()
    nx, ny, *ends = struct.unpack_from("<2h6d", content, 4)
    _check_size(len(content), 56 + 4 * nx * ny)
    return _grid(np.frombuffer(content, "<f4", offset=56), (ny, nx), ends, path)


def _binary_7(path: Path) -> tuple[np.ndarray, tuple[float, float]]:
    content = path.read_bytes()
    sections: dict[bytes, tuple[int, int]] = {}
    at = 0
    while at + 8 <= len(content) and len(sections) < 100:
        name, size = content[at : at + 4], struct.unpack_from("<i", content, at + 4)[0]
        if size < 0 or at + 8 + size > len(content):
            raise ValueError(f"section {name!r} of {size} bytes at offset {at}")
        sections.setdefault(name, (at + 8, size))
        at += 8 + size
    if at != len(content) or GRID not in sections or DATA not in sections:
        raise ValueError(f"no sections GRID and DATA up to offset {at} of {len(content)}")
    ny, nx, _, _, dx, dy, *_, turned, blank = GRID_LAYOUT.unpack_from(content, sections[GRID][0])
    if turned != 0:
        raise UnreadableFileError(f"{path}: a grid turned by {turned:g}; expected 0; resample it")
    check_shape((ny, nx), str(path))
    start, size = sections[DATA]
    _check_size(size, 8 * nx * ny)
    z = np.frombuffer(content, "<f8", nx * ny, start).reshape(ny, nx)
    (version,) = struct.unpack_from("<i", content, sections[BINARY_7][0])
    blanked = z >= blank if version == 1 else z == blank  # and what lies above is a height in 2
    return np.where(blanked | (z >= BLANK), np.nan, z), (dy, dx)


def _grid(
    values: np.ndarray, shape: tuple[int, int], ends: list[float], path: Path
) -> tuple[np.ndarray, tuple[float, float]]:
    """Return the nodes of a grid between the ends of x and y."""
    check_shape(shape, str(path))
    ny, nx = shape
    if values.size != nx * ny or min(shape) < 2:
        raise ValueError(f"{values.size} heights for {ny} x {nx} nodes")
    z = values.reshape(shape).astype(np.float64)
    x_low, x_high, y_low, y_high = ends[:4]
    step = (y_high - y_low) / (ny - 1), (x_high - x_low) / (nx - 1)
    return np.where(z >= 0.999 * BLANK, np.nan, z), (float(step[0]), float(step[1]))


def _check_size(got: int, expected: int) -> None:
    if got != expected:
        raise ValueError(f"{got} bytes, where the header describes {expected}")


FORMAT = Format(
    name="surfer",
    extensions=(".grd",),
    reader="built in",
    note="Surfer grids, text and binary; needs --unit and --lateral-unit",
    recognises=_recognises,
    read=_read,
)
