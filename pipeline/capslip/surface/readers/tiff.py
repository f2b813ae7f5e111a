"""Float TIFF, read by tifffile. Only ImageJ's own words on units count as such.

The resolution tags of other programs tell the size of a print, so they are left alone.
"""

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from capslip.errors import ScanError, UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.lengths import check_length
from capslip.surface.readers.stored import (
    Format,
    Request,
    Stored,
    check_growth,
    check_real,
    check_shape,
    in_one_unit,
    is_length,
)

MAGICS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
IMAGE_DESCRIPTION = 270
# Private tags of makers, whose own readers take the file: Park Systems (magic), JPK (version of its
# format, name of a channel), and a word in the description of Olympus LEXT
PARK_MAGIC, JPK_TAGS, LEXT_WORD = 50432, (0x8000, 0x8050), "TiffTagDescData"
TAG_BYTES = {False: 12 + 4, True: 20 + 8}  # with the place of the next directory
MAX_PAGES = 64  # looked at for them
GDAL_NODATA = 42113
ORIENTATION, TOP_LEFT, BOTTOM_LEFT = 274, 1, 4


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith(MAGICS) and not _is_instruments_own(path)


def _is_instruments_own(path: Path) -> bool:
    """Say whether an instrument wrote the file: its heights are then no plain picture."""
    import logging

    import tifffile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL + 1)
    try:
        check_length(path, lenient=True)
        with tifffile.TiffFile(path) as file:
            pages: list[Any] = list(islice(file.pages, MAX_PAGES))
            for tags in (page.tags for page in pages):
                if PARK_MAGIC in tags or any(tag in tags for tag in JPK_TAGS):
                    return True
                if LEXT_WORD in str(tags.valueof(IMAGE_DESCRIPTION, default="")):
                    return True
    except Exception:  # tifffile raises errors of every kind on damaged bytes
        return False
    return False


def _read(path: Path, request: Request) -> Stored:
    import logging

    import tifffile

    check_length(path, request.lenient)
    # What tifffile logs of a damaged file is said by the error below, or does not matter here.
    logging.getLogger("tifffile").setLevel(logging.CRITICAL + 1)
    try:
        with tifffile.TiffFile(path) as file:
            return _stored(file, path, request.scale is not None)
    except ScanError:
        raise
    except Exception as error:  # tifffile raises errors of every kind on damaged bytes
        raise UnreadableFileError(
            f"{path}: damaged, truncated or unsupported TIFF file ({type(error).__name__}: "
            f"{' '.join(str(error).split())[:200]}); expected plain numbers; "
            "export it again"
        ) from error


def _stored(file: Any, path: Path, has_scale: bool) -> Stored:
    if len(file.pages) != 1:
        raise UnreadableFileError(
            f"{path}: {len(file.pages)} pages; expected one; export the height map alone"
        )
    page = file.pages[0]
    check_shape(page.shape, str(path))
    if page.dtype is None or (page.dtype.kind != "f" and not has_scale):
        raise UnreadableFileError(
            f"{path}: data type {page.dtype}; expected float32 or float64: whole numbers hide a "
            "scale factor; export the heights as float, or give reading.scale, the height in "
            "--unit of one count"
        )
    check_real(page.dtype, str(path))
    size = path.stat().st_size
    for offset, count in zip(page.dataoffsets, page.databytecounts, strict=True):
        if offset + count > size:
            raise UnreadableFileError(
                f"{path}: truncated: data up to offset {offset + count}, but {size} bytes; "
                "copy the file again"
            )
    check_growth(sum(page.databytecounts), page.nbytes, str(path))
    heights = np.array(page.asarray(), dtype=np.float64)
    notes = (*_bytes_behind(page, size), *_mask_no_data(heights, page, path))
    pixel_size, unit = _imagej_pixel_size(file, page, path)
    return Stored(
        heights, None, pixel_size, unit, notes, top_row_first=_is_top_row_first(page, path)
    )


def _bytes_behind(page: Any, size: int) -> tuple[str, ...]:
    """Say that bytes follow all that the directory names: they may have slipped in before it."""
    pairs = zip(page.dataoffsets, page.databytecounts, strict=True)
    ends = [offset + count for offset, count in pairs]
    ends += [tag.valueoffset + tag.valuebytecount for tag in page.tags]
    ends += [tag.offset + TAG_BYTES[page.parent.is_bigtiff] for tag in page.tags]
    left = size - max(ends)
    return (f"{left} bytes of the file belong to no tag: it may be damaged",) if left > 0 else ()


def _is_top_row_first(page: Any, path: Path) -> bool:
    """Judge by the tag Orientation (TIFF 6.0, section 8); without it the first row is the top."""
    tag = page.tags.get(ORIENTATION)
    place = 1 if tag is None else int(tag.value)
    if place not in (TOP_LEFT, BOTTOM_LEFT):
        raise UnreadableFileError(
            f"{path}: tag Orientation is {place}; expected {TOP_LEFT} or {BOTTOM_LEFT}, the first "
            "column on the left; export it without mirroring or turning"
        )
    return place == TOP_LEFT


def _mask_no_data(heights: np.ndarray, page: Any, path: Path) -> tuple[str, ...]:
    tag = page.tags.get(GDAL_NODATA)
    if tag is None:
        return ()
    try:
        code = float(str(tag.value).strip("\0 "))
    except ValueError:
        raise UnreadableFileError(
            f"{path}: tag {GDAL_NODATA} (no data) is {str(tag.value)[:40]!r}; expected a number; "
            "export it again"
        ) from None
    if np.isnan(code):  # as such points are anyway
        return ()
    if page.dtype.kind in "iu" and not _holds(page.dtype, code):
        return ()  # as of -9999 among counts: no point can have it
    with np.errstate(over="ignore"):  # of float64 in a map of float32
        marked = heights == np.float64(np.asarray(code, dtype=page.dtype))
    if not marked.any():
        return ()
    heights[marked] = np.nan
    count = int(marked.sum())
    said = f"{count} points with the file's no-data value {code:g} are non-measured"
    return (Statement(said),)


def _holds(dtype: np.dtype[Any], code: float) -> bool:
    """Tell whether a type of whole numbers has a number."""
    ends = np.iinfo(dtype)
    return code.is_integer() and ends.min <= code <= ends.max


def _imagej_pixel_size(
    file: Any, page: Any, path: Path
) -> tuple[tuple[float, float] | None, str | None]:
    """Return the pixel size (dy, dx) and its unit, where ImageJ wrote a unit of length.

    That of y stands beside that of x where it is another one.
    """
    said = file.imagej_metadata or {}
    unit, unit_y = (
        str(said.get(name, said.get("unit", ""))).replace("\\u00B5", "µ")
        for name in ("unit", "yunit")
    )
    if not is_length(unit):
        return None, None
    tags = [page.tags.get(name) for name in ("YResolution", "XResolution")]
    if None in tags or any(not tag.value[0] for tag in tags):
        return None, None
    dy, dx = (tag.value[1] / tag.value[0] for tag in tags)
    return in_one_unit((dy, dx), (unit_y, unit), str(path))


FORMAT = Format(
    name="tiff",
    extensions=(".tif", ".tiff"),
    reader="tifffile",
    note="one page of float32 or float64; needs --unit, --pixel-size and --lateral-unit",
    recognises=_recognises,
    read=_read,
)
