"""X3P (ISO 25178-72), read by x3pio."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import SettingsError, UnreadableFileError
from pipeline.surface.readers.stored import Format, Stored, check_shape

MAGIC = b"PK\x03\x04"


def _recognises(head: bytes, path: Path) -> bool:
    if not head.startswith(MAGIC):
        return False
    if path.suffix.lower() == ".x3p":
        return True
    try:
        with zipfile.ZipFile(path) as archive:
            return "main.xml" in archive.namelist()
    except (zipfile.BadZipFile, OSError):
        return False


def _read(path: Path, dataset: str | None) -> Stored:
    import x3pio

    if dataset is not None:
        raise SettingsError(
            f"{path}: --dataset {dataset} given, but an X3P file holds one height map; leave it out"
        )
    try:
        info = x3pio.info(path)
        _check(info, path)
        file = x3pio.read(path)
    except (x3pio.X3pError, zipfile.BadZipFile, EOFError) as error:
        raise UnreadableFileError(
            f"{path}: not readable as X3P ({_one_line(error)}); expected ISO 25178-72 with "
            "main.xml at the top of the archive; export it again, or convert it to HDF5"
        ) from error
    # Heights are along the z axis of the file's own frame: a placement (offset, rotation) in a
    # wider frame shifts and turns the whole face and says nothing of its relief.
    header = info.header
    return Stored(
        height=np.asarray(file.layers[0].z, dtype=np.float64),
        unit="m",
        pixel_size=(header.y.increment, header.x.increment),
        lateral_unit="m",
    )


def _check(info: Any, path: Path) -> None:
    if info.feature_type.value != "SUR":
        raise UnreadableFileError(
            f"{path}: feature type {info.feature_type.value}; expected SUR, a surface on a grid; "
            "export the height map, not a profile or a point cloud"
        )
    if info.layer_count != 1:
        raise UnreadableFileError(
            f"{path}: {info.layer_count} layers; expected one; export the layer to analyse alone"
        )
    if not (info.header.x.is_incremental and info.header.y.is_incremental):
        raise UnreadableFileError(
            f"{path}: x or y is stored point by point; expected a regular grid (incremental axes); "
            "resample the scan"
        )
    check_shape(info.shape, str(path))


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


FORMAT = Format(
    name="x3p",
    extensions=(".x3p",),
    reader="x3pio",
    note="ISO 25178-72, one surface on a regular grid",
    recognises=_recognises,
    read=_read,
)
