"""NPY: one bare array of NumPy; unit and pixel size come from the user."""

import math
from pathlib import Path
from tokenize import TokenError

import numpy as np

from pipeline.errors import SettingsError, UnreadableFileError
from pipeline.surface.readers.stored import Format, Stored, check_real, check_shape

MAGIC = b"\x93NUMPY"


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith(MAGIC)


def _read(path: Path, dataset: str | None) -> Stored:
    if dataset is not None:
        raise SettingsError(
            f"{path}: --dataset {dataset} given, but an NPY file holds one array; leave it out"
        )
    with path.open("rb") as file:
        try:
            version = np.lib.format.read_magic(file)
            read_header = {
                (1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0,
            }[version]
            shape, _, dtype = read_header(file)
        except (ValueError, KeyError, TypeError, SyntaxError, EOFError, TokenError) as error:
            raise UnreadableFileError(
                f"{path}: damaged NPY header ({type(error).__name__}); expected "
                "version 1 or 2; save it again"
            ) from error
        check_shape(shape, str(path))
        check_real(dtype, str(path))
        expected = math.prod(shape) * dtype.itemsize
        got = path.stat().st_size - file.tell()
        if got < expected:
            raise UnreadableFileError(
                f"{path}: truncated: {got} bytes of data; expected {expected} for "
                f"{shape[0]} x {shape[1]} points; copy the file again"
            )
    return Stored(np.load(path, allow_pickle=False))


FORMAT = Format(
    name="npy",
    extensions=(".npy",),
    reader="built in",
    note="needs --unit, --pixel-size and --lateral-unit",
    recognises=_recognises,
    read=_read,
)
