"""Readers of scan files: one file a format, and the registry that chooses between them."""

import hashlib
import re
from dataclasses import replace
from numbers import Real
from pathlib import Path

from capslip.errors import (
    CapslipError,
    SettingsError,
    UnreadableFileError,
    check_kind,
    check_text,
    path_of,
    printable,
    truth_of,
)
from capslip.provenance import is_fresh, sha256_of, state_of
from capslip.surface.heightmap import HeightMap, Origin
from capslip.surface.readers import (
    esri,
    gwy,
    gwyddion,
    hdf5,
    keyence,
    mat,
    mesh,
    nms,
    npy,
    packed,
    sdf,
    sur,
    surfer,
    sxm,
    text,
    tiff,
    vendor,
    wyko,
    x3p,
    xyz,
    zygo,
)
from capslip.surface.readers.marks import without_marks
from capslip.surface.readers.stored import (
    Calibration,
    Format,
    Request,
    Stored,
    calibrate,
    read_head,
)

FORMATS: tuple[Format, ...] = (  # asked in this order
    hdf5.FORMAT,
    npy.FORMAT,
    x3p.FORMAT,
    sdf.FORMAT,
    mat.FORMAT,
    tiff.FORMAT,
    gwy.FORMAT,
    sur.FORMAT,
    sxm.FORMAT,
    nms.FORMAT,
    zygo.FORMAT,
    wyko.FORMAT,
    surfer.FORMAT,
    esri.FORMAT,
    mesh.FORMAT,
    gwyddion.FORMAT,
    keyence.FORMAT,
    xyz.FORMAT,
    text.FORMAT,
    vendor.FORMAT,
)
HEAD_BYTES = 512
HELD_BYTES = 1 << 25  # of a file that is compared with itself; of larger ones the digests are
GAPS = re.compile(r"gap|depth", re.IGNORECASE)


def load_surface(
    path: str | Path,
    *,
    unit: str | None = None,
    lateral_unit: str | None = None,
    pixel_size: tuple[float, float] | None = None,
    dataset: str | None = None,
    scale: float | None = None,
    top_row_first: bool | None = None,
    invert: bool = False,
    lenient: bool = False,
) -> HeightMap:
    """Read a scan file as a height map in metres.

    The format is recognised by content. What the file does not say has to be given; what it does
    say is never overridden.

    Parameters
    ----------
    path : path
        The scan.
    unit : {"m", "cm", "mm", "um", "nm", "pm", "inch"}, optional
        Unit of the heights.
    lateral_unit : str, optional
        Unit of the pixel size, one of the same words.
    pixel_size : (float, float), optional
        (dy, dx) in `lateral_unit`, which then has to be given too. For a point cloud, which has
        no pixels of its own, the size of the cells of the grid.
    dataset : str, optional
        Name of the dataset (HDF5), array (NPZ), variable (MAT) or channel (vendor formats) that
        holds the heights.
    scale : float, optional
        Heights in `unit` a stored number, of a map whose file says no unit.
    top_row_first : bool, optional
        Whether y falls with the row, as in a picture; for formats that leave it open (HDF5, NPY,
        MAT, text matrices, tables of rows and columns), whose first row otherwise has the least y.
    invert : bool, optional
        The numbers grow into the material (gaps, depths): turn their sign.
    lenient : bool, optional
        Accept an X3P archive with its files in a subfolder, with entries that an archiver added,
        or with a wrong checksum. Each leniency used is said in `origin.notes`.

    Returns
    -------
    HeightMap
        float64, shape (ny, nx), NaN at non-measured points; y grows with the row in every format.
        `origin.notes` says what the reader did beyond reading.

    Raises
    ------
    UnreadableFileError
        If there is no such file, or it is not a height map in a known format, or is damaged.
    UncalibratedError
        If a unit or the pixel size is neither stored nor given, or contradicts the file.
    UnusableSurfaceError
        If the map has fewer than 3 points along an axis or holds an infinite height.
    SettingsError
        If an argument is of the wrong type, or a unit, pixel size or dataset that is given makes
        no sense.

    Examples
    --------
    >>> import numpy as np, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "heights.npy"
    ...     np.save(file, np.zeros((4, 5)))
    ...     surface = load_surface(file, unit="um", pixel_size=(0.5, 0.5), lateral_unit="m")
    >>> surface.shape, surface.pixel_size_m
    ((4, 5), (0.5, 0.5))
    """
    path = path_of("path", path)
    for name, word in (("unit", unit), ("lateral_unit", lateral_unit), ("dataset", dataset)):
        check_text(name, word)
    check_kind("scale", scale, (Real, type(None)), "a positive number, or None")
    invert, lenient = truth_of("invert", invert), truth_of("lenient", lenient)
    if top_row_first is not None:
        top_row_first = truth_of("top_row_first", top_row_first)
    request = Request(dataset, pixel_size, lateral_unit, lenient, scale)
    given = Calibration(unit, lateral_unit, pixel_size, scale, top_row_first, invert)
    try:
        if _head(path).startswith(packed.MAGIC):
            with packed.unpacked(path) as copy:
                return _of_copy(path, copy, request, given)
        return _loaded(path, path, request, given)
    except CapslipError as error:
        if str(error).isprintable():
            raise
        raise type(error)(printable(str(error))) from error


def _of_copy(path: Path, copy: Path, request: Request, given: Calibration) -> HeightMap:
    try:
        return _loaded(path, copy, request, given)
    except CapslipError as error:
        raise type(error)(str(error).replace(str(copy), str(path))) from error


def _loaded(path: Path, copy: Path, request: Request, given: Calibration) -> HeightMap:
    """Read a scan from where it lies, or from an unpacked copy."""
    head = _head(copy)
    before, seen = state_of(path), _seen(path)
    file_format = next(f for f in FORMATS if f.recognises(head, copy))
    if request.dataset is not None and not file_format.named:
        raise SettingsError(
            f"{path}: --dataset {request.dataset} given, but a file of the format "
            f"{file_format.name} holds one height map; leave it out"
        )
    stored = file_format.read(copy, request)
    if state_of(path) != before or (is_fresh(before) and _seen(path) != seen):
        # else the digest were that of other bytes than those read
        raise UnreadableFileError(f"{path}: changed while it was read; analyse it when it is whole")
    height, marks = without_marks(stored.height)
    notes = (*stored.notes, *marks, *_gaps(stored, given))
    origin = Origin(
        name=printable(copy.stem),
        path=str(path),
        sha256=seen if isinstance(seen, str) else hashlib.sha256(seen).hexdigest(),
        file_format=file_format.name,
        read_with=(*vars(given).items(), ("dataset", request.dataset)),
    )
    return calibrate(replace(stored, height=height, notes=notes), origin, given)


def _seen(path: Path) -> bytes | str:
    """Return all of a file, or the digest of a large one: to compare all of it is quicker."""
    return path.read_bytes() if path.stat().st_size <= HELD_BYTES else sha256_of(path)


def _gaps(stored: Stored, given: Calibration) -> tuple[str, ...]:
    """Say that a map sounds like one of gaps, which grow into the material."""
    name = stored.dataset or stored.column or ""
    if given.invert or not GAPS.search(name):
        return ()
    return (
        f"{name!r} sounds like gaps or depths, not heights, which grow out of the "
        "material; reading.invert = true turns them",
    )


def _head(path: Path) -> bytes:
    try:
        if path.is_dir():
            raise UnreadableFileError(f"{path}: is a folder; expected a scan file; name one in it")
        if path.exists() and not path.is_file():  # opening a pipe waits for whoever writes
            raise UnreadableFileError(
                f"{path}: is a pipe or a device, which is read once; expected a file; write the "
                "scan to one first"
            )
        head = read_head(path, HEAD_BYTES)
    except (FileNotFoundError, ValueError) as error:  # the latter of a zero byte in its name
        raise UnreadableFileError(f"{path}: no such file; check the path") from error
    except OSError as error:
        raise UnreadableFileError(f"{path}: cannot be read ({error.strerror})") from error
    if not head:
        raise UnreadableFileError(f"{path}: zero bytes; expected a scan; copy the file again")
    return head
