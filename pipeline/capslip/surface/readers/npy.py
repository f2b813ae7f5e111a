"""NPY and NPZ: bare arrays of NumPy; unit and pixel size come from the user."""

import math
import warnings
import zipfile
from dataclasses import replace
from pathlib import Path
from tokenize import TokenError
from typing import IO

import numpy as np

from capslip.errors import SettingsError, UnreadableFileError
from capslip.surface.readers.arrays import stored_array
from capslip.surface.readers.choice import shown
from capslip.surface.readers.lengths import compared_length
from capslip.surface.readers.stored import (
    DAMAGED_ZIP,
    Format,
    Request,
    Stored,
    check_growth,
    check_real,
    check_shape,
    zip_holds,
)

MAGIC = b"\x93NUMPY"
ZIP_MAGIC = b"PK\x03\x04"


def _recognises(head: bytes, path: Path) -> bool:
    if head.startswith(MAGIC):
        return True
    if not head.startswith(ZIP_MAGIC):
        return False
    return path.suffix.lower() == ".npz" or zip_holds(path, lambda name: name.endswith(".npy"))


def _read(path: Path, request: Request) -> Stored:
    with path.open("rb") as file:
        if file.read(len(MAGIC)) == MAGIC:
            if request.dataset is not None:
                raise SettingsError(
                    f"{path}: --dataset {request.dataset} given, but an NPY file holds one array; "
                    "leave it out"
                )
            file.seek(0)
            array, notes = _array(file, path.stat().st_size, str(path), request.lenient)
            stored = stored_array(array, str(path), request)
            return replace(stored, notes=(*notes, *stored.notes))
    try:
        with zipfile.ZipFile(path) as archive:
            member = _member(archive, path, request.dataset)
            what = f"{path}:{member.filename}"
            check_growth(member.compress_size, member.file_size, what)
            with archive.open(member) as file:
                array, _ = _array(file, member.file_size, what, request.lenient)
        name = member.filename.removesuffix(".npy")
        return replace(stored_array(array, what, request), dataset=name)
    except DAMAGED_ZIP as error:
        raise UnreadableFileError(
            f"{path}: damaged NPZ archive ({' '.join(str(error).split())}); expected a whole one; "
            "save it again"
        ) from error


def _member(archive: zipfile.ZipFile, path: Path, dataset: str | None) -> zipfile.ZipInfo:
    arrays = {
        info.filename.removesuffix(".npy"): info
        for info in archive.infolist()
        if info.filename.endswith(".npy")
    }
    if dataset is None and len(arrays) == 1:
        return next(iter(arrays.values()))
    if dataset is None or dataset not in arrays:
        raise UnreadableFileError(
            f"{path}: {'no array ' + repr(dataset) if dataset else 'several arrays or none'}; "
            f"arrays: {shown(list(arrays))}; add --dataset NAME"
        )
    return arrays[dataset]


def _array(
    file: IO[bytes], size: int, what: str, lenient: bool
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the array of an open NPY file of `size` bytes, with notes."""
    try:
        version = np.lib.format.read_magic(file)
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of headers that Python 2 wrote
            shape, in_columns, dtype = read_header(file)
    except (ValueError, KeyError, TypeError, SyntaxError, EOFError, TokenError) as error:
        raise UnreadableFileError(
            f"{what}: damaged NPY header ({type(error).__name__}); expected version 1 or 2; "
            "save it again"
        ) from error
    check_shape(shape, what)
    check_real(dtype, what)
    expected = math.prod(shape) * dtype.itemsize
    got = size - file.tell()
    if got < expected:
        raise UnreadableFileError(
            f"{what}: truncated: {got} bytes of data; expected {expected} for "
            f"{shape[0]} x {shape[1]} points; copy the file again"
        )
    notes = compared_length(what, size, file.tell() + expected, lenient)
    flat = np.frombuffer(file.read(expected), dtype=dtype)
    return flat.reshape(shape, order="F" if in_columns else "C"), notes


FORMAT = Format(
    name="npy",
    extensions=(".npy", ".npz"),
    reader="built in",
    note="NumPy arrays; needs --unit, --pixel-size, --lateral-unit; NPZ with --dataset",
    recognises=_recognises,
    read=_read,
    named=True,
)
