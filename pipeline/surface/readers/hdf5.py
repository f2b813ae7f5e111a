"""HDF5: the native height map, and any other dataset that the user names.

The native file holds the dataset `/height` (ny, nx), float32 or float64, NaN where non-measured,
with the attributes `unit`, `pixel_size` = [dy, dx] and `pixel_unit`.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import OutputError, SettingsError, UncalibratedError, UnreadableFileError
from pipeline.surface.heightmap import HeightMap
from pipeline.surface.readers.stored import METRES, Format, Stored, check_real, check_shape

MAGIC = b"\x89HDF\r\n\x1a\n"
VENDOR_EXTENSIONS = (".datx", ".nc")  # HDF5 inside, with a structure of their own


def write_hdf5(
    surface: HeightMap,
    path: str | Path,
    *,
    truth: dict[str, Any] | None = None,
    unit: str = "m",
    dtype: str = "float64",
) -> None:
    """Write a height map as a native HDF5 file.

    Parameters
    ----------
    surface : HeightMap
        What to write.
    path : path
        The file; an existing one is replaced.
    truth : dict, optional
        What is known of a synthetic surface, stored as JSON text in the dataset `/truth`.
    unit : {"m", "mm", "um", "nm"}
        Unit of the stored heights.
    dtype : {"float64", "float32"}
        float32 keeps 24 binary digits: choose a unit in which that is enough.

    Raises
    ------
    SettingsError
        If the unit or the data type is not one of these.
    OutputError
        If the file cannot be written.
    """
    import h5py

    if unit not in ("m", "mm", "um", "nm") or dtype not in ("float64", "float32"):
        raise SettingsError(
            f"{path}: unit {unit!r} and data type {dtype!r}; expected m, mm, um or nm, and "
            "float64 or float32"
        )
    heights = (surface.height_m / METRES[unit]).astype(dtype)
    try:
        with h5py.File(path, "w") as file:
            dataset = file.create_dataset(
                "height", data=heights, compression="gzip", compression_opts=6, shuffle=True
            )
            dataset.attrs["unit"] = unit
            dataset.attrs["pixel_size"] = surface.pixel_size_m
            dataset.attrs["pixel_unit"] = "m"
            if truth is not None:
                file["truth"] = json.dumps(truth)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error}); choose another folder") from error


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith(MAGIC) and path.suffix.lower() not in VENDOR_EXTENSIONS


def _read(path: Path, dataset: str | None) -> Stored:
    import h5py

    try:
        with h5py.File(path, "r") as file:
            return _stored(file, path, dataset)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        # each of these is what h5py raises on one kind of damaged bytes
        raise UnreadableFileError(
            f"{path}: damaged or truncated HDF5 file ({error}); expected a whole one; "
            "copy or export it again"
        ) from error


def _stored(file: Any, path: Path, name: str | None) -> Stored:
    import h5py

    chosen = file.get(name or "height")
    if not isinstance(chosen, h5py.Dataset):
        maps = _datasets(file)
        raise UnreadableFileError(
            f"{path}: no dataset {name or 'height'!r}; datasets with two axes: "
            f"{', '.join(maps) or 'none'}; add --dataset NAME"
        )
    what = f"{path}:{chosen.name}"
    if chosen.shape is None:
        raise UnreadableFileError(f"{what}: empty dataset; expected two axes (ny, nx)")
    check_shape(chosen.shape, what)
    check_real(chosen.dtype, what)
    pixel_size = chosen.attrs.get("pixel_size")
    return Stored(
        height=chosen[()],
        unit=_text(chosen.attrs.get("unit"), f"{what}: attribute unit"),
        pixel_size=None if pixel_size is None else _pair(pixel_size, what),
        lateral_unit=_text(chosen.attrs.get("pixel_unit"), f"{what}: attribute pixel_unit"),
    )


def _datasets(file: Any) -> list[str]:
    import h5py

    found: list[str] = []

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.ndim == 2:
            found.append(name)

    file.visititems(visit)
    return found


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
)
