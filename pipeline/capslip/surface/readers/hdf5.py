"""HDF5: the native height map, and any other dataset that the user names.

The native file holds the dataset `/height` (ny, nx), float32 or float64, NaN where non-measured,
with the attributes `unit`, `pixel_size` = [dy, dx] and `pixel_unit`.
"""

import json
import math
import mmap
import os
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from capslip.disk import hdf5_in_memory, is_full, write_whole
from capslip.errors import (
    OutputError,
    SettingsError,
    UncalibratedError,
    UnreadableFileError,
    printable,
)
from capslip.surface.heightmap import HeightMap, Statement
from capslip.surface.readers.arrays import stored_array
from capslip.surface.readers.choice import shown
from capslip.surface.readers.hdf5_items import check_inside, item_of, names_of_maps
from capslip.surface.readers.lengths import check_length
from capslip.surface.readers.stored import (
    Format,
    Request,
    Stored,
    check_growth,
    check_real,
    check_shape,
)
from capslip.units import METRES

MAGIC = b"\x89HDF\r\n\x1a\n"
BLOCK = 1 << 24  # bytes that are searched at a time
UNIT_WORDS = (b"unit\0", b"pixel_unit\0")  # names of attributes; each ends as the first one
HEAP = b"GCOL\x01\0\0\0"  # where HDF5 keeps strings of free length
VARIABLE_LENGTH = 9  # class of a data type
MAX_WORD_BYTES = 1024
ERRORS = "noise_m", "form_error_m"  # attributes, where they are known
MEAN_OF, MAX_SCANS, MAX_LINE_BYTES = b"mean_of\0", 4096, 1 << 14
VENDOR_EXTENSIONS = (".datx", ".nc")  # HDF5 inside, with a structure of their own


def write_hdf5(
    surface: HeightMap,
    path: str | Path,
    *,
    truth: dict[str, Any] | None = None,
    mean_of: Sequence[str] = (),
    unit: str = "m",
    dtype: str = "float64",
) -> None:
    """Write a height map as a native HDF5 file.

    Parameters
    ----------
    surface : HeightMap
        What to write.
    path : path
        The file; an existing one is replaced by a whole one or not at all.
    truth : dict, optional
        What is known of a synthetic surface, stored as JSON text in the dataset `/truth`.
    mean_of : sequence of str
        The scans whose mean it is, for the record: the attribute `mean_of`.
    unit : {"m", "mm", "um", "nm"}
        Unit of the stored heights.
    dtype : {"float64", "float32"}
        float32 keeps 24 binary digits: choose a unit in which that is enough.

    Raises
    ------
    SettingsError
        If the unit or the data type is not one of these.
    OutputError
        If the file cannot be written; what was there before stays.
    """
    if unit not in ("m", "mm", "um", "nm") or dtype not in ("float64", "float32"):
        raise SettingsError(
            f"{path}: unit {unit!r} and data type {dtype!r}; expected m, mm, um or nm, and "
            "float64 or float32"
        )
    heights = (surface.height_m / METRES[unit]).astype(dtype)

    def written(unfinished: Path) -> None:
        with hdf5_in_memory(unfinished) as file:
            dataset = file.create_dataset(
                "height", data=heights, compression="gzip", compression_opts=6, shuffle=True
            )
            dataset.attrs["unit"] = unit
            dataset.attrs["pixel_size"] = surface.pixel_size_m
            dataset.attrs["pixel_unit"] = "m"
            for name in ERRORS:
                if (error_m := getattr(surface, name)) is not None:
                    dataset.attrs[name] = error_m
            if mean_of:
                dataset.attrs["mean_of"] = list(map(printable, mean_of))
            if truth is not None:
                file["truth"] = json.dumps(truth)

    place = Path(os.path.realpath(path))  # a link stays one
    try:
        write_whole(place, written)
    except OSError as error:
        step = f"make room on the disk of {place.parent}, or " if is_full(error) else ""
        raise OutputError(
            f"{path}: cannot be written ({error.strerror or error}); nothing was written; "
            f"{step}choose another folder"
        ) from error


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith(MAGIC) and path.suffix.lower() not in VENDOR_EXTENSIONS


def _read(path: Path, request: Request) -> Stored:
    import h5py

    lengths = check_length(path, request.lenient)
    try:
        with h5py.File(path, "r") as file:
            chosen = _chosen(file, path, request.dataset)
            scans = _n_scans(chosen)
            _check_strings(path, _beside(chosen, path.stat().st_size), scans)
            stored = _stored(chosen, path, request)
            if scans:
                lines = filter(None, (_line(one) for one in chosen.attrs["mean_of"]))
                stored = replace(stored, mean_of=tuple(lines))
            return replace(stored, notes=lengths + stored.notes)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        # each of these is what h5py raises on one kind of damaged bytes
        raise UnreadableFileError(
            f"{path}: damaged or truncated HDF5 file ({error}); expected a whole one; "
            "copy or export it again"
        ) from error


def _beside(dataset: Any, n_bytes: int) -> list[tuple[int, int]]:
    """Return from where to where a file holds anything but the heights."""
    spans: list[tuple[int, int]] = []
    if dataset.chunks:
        dataset.id.chunk_iter(lambda one: spans.append((one.byte_offset, one.size)))
    elif (start := dataset.id.get_offset()) is not None:
        spans.append((start, dataset.id.get_storage_size()))
    beside, at = [], 0
    for start, size in sorted(spans):
        if start > at:
            beside.append((at, start))
        at = max(at, start + size)
    return [*beside, (at, n_bytes)]


def _n_scans(dataset: Any) -> int:
    """Return how many scans an average names; 0 where it names none, or in no way of ours."""
    if "mean_of" not in dataset.attrs:
        return 0
    held = dataset.attrs.get_id("mean_of")
    known = held.dtype.kind == "O" and len(held.shape) == 1 and held.shape[0] <= MAX_SCANS
    return int(held.shape[0]) if known else 0


def _check_strings(path: Path, beside: list[tuple[int, int]], scans: int) -> None:
    """Refuse damaged strings of free length: the HDF5 library loops or takes gigabytes over them.

    The bytes beside the heights are looked at as they lie in the file: the heaps that hold such
    strings, and the attributes `unit`, `pixel_unit` and, where an average names scans, `mean_of`
    (format specification 3.0, III.E and IV.A.2.m).
    """
    with (
        path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
    ):
        for at in _places(content, UNIT_WORDS[0], beside):
            for name in UNIT_WORDS:
                start = at + len(UNIT_WORDS[0]) - len(name)
                here = start >= 0 and content[start : start + len(name)] == name
                if here and _is_endless(content, start, len(name)):
                    raise _damaged_strings(path, start)
        for at in _places(content, MEAN_OF, beside) if scans else ():
            if _is_endless(content, at, len(MEAN_OF), scans, MAX_LINE_BYTES):
                raise _damaged_strings(path, at)
        for at in _places(content, HEAP, beside):
            place, end = at + 16, at + int.from_bytes(content[at + 8 : at + 16], "little")
            while place + 16 <= min(end, len(content)):
                index, size = struct.unpack_from("<H6xQ", content, place)
                # Object 0 is the free rest, its own 16 bytes included; others are padded to 8.
                step = size if index == 0 else 16 + -(-size // 8) * 8
                if step < 16 or place + step > end:
                    raise _damaged_strings(path, place)
                place += step


def _places(content: mmap.mmap, word: bytes, within: list[tuple[int, int]]) -> Iterator[int]:
    for start, end in within:
        for first in range(start, end, BLOCK):  # bytes are searched ten times as fast as maps
            block = content[first : min(first + BLOCK + len(word) - 1, end)]
            at = block.find(word)
            while at >= 0:
                yield first + at
                at = block.find(word, at + 1)


def _is_endless(
    content: mmap.mmap, at: int, name_size: int, count: int = 1, most: int = MAX_WORD_BYTES
) -> bool:
    """Say whether the attribute with its name at `at` is strings of free, absurd length."""
    for start, versions in ((at - 8, (1, 2)), (at - 9, (3,))):
        if start < 0 or content[start] not in versions:
            continue
        sizes = struct.unpack_from("<3H", content, start + 2)  # of the name, type and space
        if sizes[0] != name_size:
            continue
        name, kind, space = (-(-n // 8) * 8 for n in sizes) if content[start] == 1 else sizes
        value, step = at + name + kind + space, 16  # a length, and where in which heap it lies
        end = value + step * (count - 1) + 4
        if end <= len(content) and content[at + name] & 0x0F == VARIABLE_LENGTH:
            lengths = (content[i : i + 4] for i in range(value, end, step))
            return max(int.from_bytes(one, "little") for one in lengths) > most
    return False


def _damaged_strings(path: Path, offset: int) -> UnreadableFileError:
    return UnreadableFileError(
        f"{path}: damaged HDF5 file at offset {offset} (a string); expected a whole one; "
        "copy or export it again"
    )


def _chosen(file: Any, path: Path, name: str | None) -> Any:
    """Return the dataset that is asked for, none of whose numbers were read."""
    import h5py

    chosen = item_of(file, name or "height", str(path))
    if not isinstance(chosen, h5py.Dataset):
        raise UnreadableFileError(
            f"{path}: no dataset {name or 'height'!r}; datasets with two axes: "
            f"{shown(names_of_maps(file))}; add --dataset NAME"
        )
    what = f"{path}:{name or 'height'}"
    if chosen.shape is None:
        raise UnreadableFileError(f"{what}: empty dataset; expected two axes (ny, nx)")
    check_inside(chosen, what)
    check_shape(chosen.shape, what)
    check_real(chosen.dtype, what)
    check_growth(chosen.id.get_storage_size(), chosen.nbytes, what)
    return chosen


def _stored(chosen: Any, path: Path, request: Request) -> Stored:
    name = request.dataset
    what = f"{path}:{name or 'height'}"
    pixel_size = _attribute(chosen, "pixel_size", what)
    height, notes = _unpacked(chosen, what)
    word = "units" if "unit" not in chosen.attrs else "unit"
    unit = _text(_attribute(chosen, word, what), f"{what}: attribute {word}")
    lateral_unit = _text(_attribute(chosen, "pixel_unit", what), f"{what}: attribute pixel_unit")
    noise_m, form_error_m = (
        _number(_attribute(chosen, name, what), f"{what}: attribute {name}") for name in ERRORS
    )
    stored = (
        stored_array(height, what, request)
        if pixel_size is None
        else Stored(height, pixel_size=_pair(pixel_size, what))
    )
    stored = replace(stored, unit=unit, lateral_unit=lateral_unit, dataset=name)
    stored = replace(stored, noise_m=noise_m, form_error_m=form_error_m)
    return replace(stored, notes=stored.notes + notes)


def _unpacked(dataset: Any, what: str) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the heights of packed counts, with notes: h = scale_factor counts + add_offset.

    The attributes are those of the netCDF conventions (CF 1.11, sections 2.5.1 and 8.1).
    """
    raw = dataset[()]
    notes: tuple[str, ...] = ()
    marked = np.zeros(raw.shape, dtype=bool)
    for name in ("_FillValue", "missing_value"):
        code = _number(_attribute(dataset, name, what), f"{what}: attribute {name}")
        if code is not None and not np.isnan(code):
            here = raw == np.asarray(code).astype(raw.dtype)
            if here.any():
                said = f"{int(here.sum())} points with the {name} {code:g} are non-measured"
                notes += (Statement(said),)
            marked |= here
    scale, offset = (
        _number(_attribute(dataset, name, what), f"{what}: attribute {name}")
        for name in ("scale_factor", "add_offset")
    )
    if scale is not None or offset is not None:
        scale, offset = 1.0 if scale is None else scale, offset or 0.0
        raw = scale * raw.astype(np.float64) + offset
        said = f"heights are {scale:g} times the stored numbers plus {offset:g}, as it says"
        notes += (Statement(said),)
    if marked.any():
        raw = np.where(marked, np.nan, raw)
    return raw, notes


def _number(value: Any, what: str) -> float | None:
    if value is None:
        return None
    number = np.asarray(value)
    if number.size != 1 or number.dtype.kind not in "fiu":
        raise UncalibratedError(f"{what}: got {value!r}; expected one number; correct the file")
    return float(number.reshape(()))


def _attribute(dataset: Any, name: str, what: str) -> Any:
    """Return an attribute, or None; refuse one that is too large before it is read."""
    if name not in dataset.attrs:
        return None
    held = dataset.attrs.get_id(name)
    n_bytes = math.prod(held.shape or ()) * held.dtype.itemsize
    if n_bytes > MAX_WORD_BYTES or (name == "pixel_size" and held.dtype.kind == "O"):
        raise UncalibratedError(
            f"{what}: attribute {name} has {n_bytes} bytes of type {held.dtype}; expected "
            "pixel_size = two numbers [dy, dx] and units = a word; correct the file"
        )
    return dataset.attrs[name]


def _text(value: Any, what: str) -> str | None:
    if value is None:
        return None
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if not isinstance(value, str):
        raise UncalibratedError(
            f"{what}: got {value!r}; expected a word (m, mm, um, nm); correct the file"
        )
    return value


def _line(value: Any) -> str | None:
    """Return a text that is for the record, or None."""
    value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return value if isinstance(value, str) else None


def _pair(value: Any, what: str) -> tuple[float, float]:
    pair = np.asarray(value)
    if pair.shape != (2,) or pair.dtype.kind not in "fiu":
        raise UncalibratedError(
            f"{what}: attribute pixel_size is {value!r}; expected two numbers [dy, dx]; "
            "correct the file"
        )
    return float(pair[0]), float(pair[1])


FORMAT = Format(
    name="hdf5",
    extensions=(".h5", ".hdf5"),
    reader="built in",
    note="dataset /height with unit, pixel_size, pixel_unit; others with --dataset",
    recognises=_recognises,
    read=_read,
    named=True,
)
