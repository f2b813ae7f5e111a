"""NMS of NanoFocus confocal microscopes: a header of fixed places, counts of 16 bits, a picture.

The maker publishes no description. Two public readers (surfalize, SurfaceTopography) agree on every
place and on um for the heights. They differ in the unit of the step, which is nm: a field of 512
points would otherwise be 160 m wide. The range of the counts stands in the header.
"""

import struct
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.lengths import compared_length
from capslip.surface.readers.stored import Format, Request, Stored, check_shape

MAGIC, MAGIC_AT = b"OM_MS_", 32
RANGES_AT, RANGES = 8, struct.Struct("<2I2d")  # of the counts, of the heights in um
PLACE_AT, PLACE = 1352, struct.Struct("<2I")  # of the counts, and their size in bytes
GRID_AT, GRID = 1368, struct.Struct("<2I2d")  # points and steps in nm, along x, then y
COUNT_BYTES = 2
TURNED = Statement(
    "the format does not say which row is the top: the first one was taken for the lowest; "
    "reading.top_row_first = true says otherwise"
)


def _recognises(head: bytes, path: Path) -> bool:
    return head[MAGIC_AT:].startswith(MAGIC)


def _read(path: Path, request: Request) -> Stored:
    content = path.read_bytes()
    try:
        low, high, z_low, z_high = RANGES.unpack_from(content, RANGES_AT)
        start, size = PLACE.unpack_from(content, PLACE_AT)
        nx, ny, dx, dy = GRID.unpack_from(content, GRID_AT)
    except struct.error as error:
        raise UnreadableFileError(f"{path}: a truncated NMS file; copy it again") from error
    # NaN fails, too
    if start < GRID_AT + GRID.size or size != COUNT_BYTES or low >= high or not z_low < z_high:
        raise UnreadableFileError(
            f"{path}: counts of {size} bytes from {low} to {high} at offset {start}, heights from "
            f"{z_low:g} to {z_high:g}; expected counts of {COUNT_BYTES} bytes behind the header, "
            "and two rising ranges; export the scan as X3P"
        )
    check_shape((ny, nx), str(path))
    heights = start + COUNT_BYTES * nx * ny
    with_picture = heights + nx * ny  # of grey values
    expected = heights if len(content) <= heights else with_picture
    notes = compared_length(path, len(content), expected, request.lenient)
    counts = np.frombuffer(content, "<u2", nx * ny, start).reshape(ny, nx)
    height = z_low + (counts.astype(np.float64) - low) * ((z_high - z_low) / (high - low))
    return Stored(
        height=height,
        unit="um",
        pixel_size=(dy, dx),
        lateral_unit="nm",
        notes=(*notes, *_without_ends(height, counts, (low, high)), TURNED),
    )


def _without_ends(height: np.ndarray, counts: np.ndarray, ends: tuple[int, int]) -> list[str]:
    """Turn to NaN, with a note, what stands at an end of the range more often than its extreme."""
    notes = []
    for end in ends:
        marked = counts == end
        if np.count_nonzero(marked) > 1:
            height[marked] = np.nan
            notes.append(
                f"{np.count_nonzero(marked)} points with the count {end}, an end of the range, "
                "are non-measured"
            )
    return notes


FORMAT = Format(
    name="nms",
    extensions=(".nms",),
    reader="built in",
    note="NanoFocus, heights alone; reading.top_row_first where its first row is the top",
    recognises=_recognises,
    read=_read,
)
