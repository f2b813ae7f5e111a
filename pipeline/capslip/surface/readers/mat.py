"""MAT: a named variable of MATLAB, versions 5 to 7.3; unit and pixel size come from the user.

Version 7.3 is HDF5. The older ones are read here (MAT-File Format, MathWorks, chapter 1): a header
of 128 bytes, then elements of a tag (type, bytes) and data, packed by zlib or not.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.readers.arrays import stored_array
from capslip.surface.readers.choice import shown
from capslip.surface.readers.hdf5_items import (
    MAX_ITEMS,
    check_inside,
    item_of,
    names_of_maps,
)
from capslip.surface.readers.lengths import check_length
from capslip.surface.readers.stored import (
    Format,
    Request,
    Stored,
    check_growth,
    check_real,
    check_shape,
)

MAGIC_HDF5 = b"MATLAB 7.3 MAT-file"
HEADER_BYTES = 128
LOOK_BYTES = 4096  # of a packed variable: its name and shape
MATRIX, PACKED = 14, 15
NUMBERS = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
REAL_CLASSES = range(6, 16)  # double, single and the integers; not cell, struct, char, sparse
COMPLEX, LOGICAL = 0x800, 0x200


@dataclass(frozen=True)
class _Variable:
    """A variable of a file of version 5: where it lies and what its head says."""

    name: str
    shape: tuple[int, ...]
    is_real: bool
    start: int  # of the values' element, from the start of the content
    content: bytes
    packed: bool


def _recognises(head: bytes, path: Path) -> bool:
    # The text may be another one; version and byte order may not.
    return head.startswith(b"MATLAB ") or head[124:128] in (b"\x00\x01IM", b"\x01\x00MI")


def _read(path: Path, request: Request) -> Stored:
    with path.open("rb") as file:
        in_hdf5 = file.read(len(MAGIC_HDF5)) == MAGIC_HDF5
    lengths = check_length(path, request.lenient) if in_hdf5 else ()
    name, array = (_read_hdf5 if in_hdf5 else _read_5)(path, request.dataset)
    stored = stored_array(array, f"{path}:{name}", request)
    return replace(stored, dataset=name, notes=lengths + stored.notes)


def _read_5(path: Path, dataset: str | None) -> tuple[str, np.ndarray]:
    content = path.read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None:
        raise UnreadableFileError(
            f"{path}: damaged MAT header at offset 126; expected IM or MI; save the file again"
        )
    try:
        variables = {v.name: v for v in _variables(content, order)}
        maps = [name for name, v in variables.items() if v.is_real and _is_map(v.shape)]
        chosen = variables[_choose(dataset, maps, list(variables), path)]
        what = f"{path}:{chosen.name}"
        if not chosen.is_real:
            raise UnreadableFileError(
                f"{what}: not a full matrix of real numbers; expected one; choose the variable "
                "that holds the heights"
            )
        check_shape(chosen.shape, what)
        return chosen.name, _values(chosen, order, what)
    except (struct.error, zlib.error, ValueError) as error:
        raise UnreadableFileError(
            f"{path}: damaged or truncated MAT file ({' '.join(str(error).split())}); expected a "
            "whole one; save it again"
        ) from error


def _variables(content: bytes, order: str) -> Iterator[_Variable]:
    """Yield the variables of a file; struct.error, zlib.error, ValueError where it is damaged."""
    place = HEADER_BYTES
    while place < len(content):
        kind, size = struct.unpack_from(f"{order}2I", content, place)
        place += 8
        if kind not in (MATRIX, PACKED) or place + size > len(content):
            raise ValueError(f"no variable at offset {place - 8}")
        element = content[place : place + size]
        place += size
        packed = kind == PACKED
        head = zlib.decompressobj().decompress(element, LOOK_BYTES) if packed else element
        yield _variable(head, element, packed, order)


def _variable(head: bytes, element: bytes, packed: bool, order: str) -> _Variable:
    at = 8 if packed else 0  # the packed bytes begin with the tag of the matrix
    _, start, _, at = _element(head, at, order)
    (flags,) = struct.unpack_from(f"{order}I", head, start)
    _, start, size, at = _element(head, at, order)
    shape = struct.unpack_from(f"{order}{size // 4}i", head, start)
    _, start, size, at = _element(head, at, order)
    name = head[start : start + size].decode("latin-1")
    is_real = flags & 0xFF in REAL_CLASSES and not flags & (COMPLEX | LOGICAL)
    return _Variable(name, shape, is_real, at, element, packed)


def _element(content: bytes, at: int, order: str) -> tuple[int, int, int, int]:
    """Return type, start and size of the data of an element, and where the next one begins."""
    kind, size = struct.unpack_from(f"{order}2I", content, at)
    if kind >> 16:  # a short element: size and type share four bytes, four of data follow
        return kind & 0xFFFF, at + 4, min(kind >> 16, 4), at + 8
    return kind, at + 8, size, at + 8 + -(-size // 8) * 8


def _values(variable: _Variable, order: str, what: str) -> np.ndarray:
    n_points = math.prod(variable.shape)
    content = variable.content
    if variable.packed:
        most = variable.start + 8 + 8 * n_points
        check_growth(len(content), most, what)
        content = zlib.decompressobj().decompress(content, most + 8)
    kind, start, size, _ = _element(content, variable.start, order)
    if kind not in NUMBERS:
        raise ValueError(f"values of type {kind}")
    dtype = np.dtype(order + NUMBERS[kind])
    if size != n_points * dtype.itemsize or start + size > len(content):
        raise ValueError(
            f"{min(size, len(content) - start)} bytes of values, expected "
            f"{n_points * dtype.itemsize}"
        )
    values = np.frombuffer(content, dtype, n_points, start)
    return values.reshape(variable.shape, order="F")


def _read_hdf5(path: Path, dataset: str | None) -> tuple[str, np.ndarray]:
    import h5py

    try:
        with h5py.File(path, "r") as file:
            maps = [
                name
                for name in names_of_maps(file)
                if "/" not in name and file[name].dtype.kind in "fiu" and _is_map(file[name].shape)
            ]
            names = [*maps, *(n for n in islice(file, MAX_ITEMS) if n not in maps)]
            name = _choose(dataset, maps, names, path)
            chosen = item_of(file, name, str(path))
            what = f"{path}:{name}"
            if not isinstance(chosen, h5py.Dataset):
                raise UnreadableFileError(
                    f"{what}: no matrix; expected one; choose the variable that holds the heights"
                )
            check_inside(chosen, what)
            check_shape(chosen.shape or (), what)
            check_real(chosen.dtype, what)
            check_growth(chosen.id.get_storage_size(), chosen.nbytes, what)
            return name, np.asarray(chosen[()]).T  # MATLAB stores columns
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        # each of these is what h5py raises on one kind of damaged bytes
        raise UnreadableFileError(
            f"{path}: damaged or truncated MAT file ({' '.join(str(error).split())}); expected a "
            "whole one; save it again"
        ) from error


def _is_map(shape: tuple[int, ...]) -> bool:
    """Say whether a matrix may be a map or points; numbers and vectors beside it are none."""
    return len(shape) == 2 and min(shape) >= 3


def _choose(dataset: str | None, maps: list[str], names: list[str], path: Path) -> str:
    if dataset is None and len(maps) == 1:
        return maps[0]
    if dataset is None or dataset not in names:
        raise UnreadableFileError(
            f"{path}: {'no variable ' + repr(dataset) if dataset else 'several matrices or none'}; "
            f"matrices: {shown(maps)}; add --dataset NAME"
        )
    return dataset


FORMAT = Format(
    name="mat",
    extensions=(".mat",),
    reader="built in, h5py",
    note="version 5 to 7.3; needs --unit, --pixel-size, --lateral-unit; variable with --dataset",
    recognises=_recognises,
    read=_read,
    named=True,
)
