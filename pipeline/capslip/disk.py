"""Files that are written whole or not at all, and disks that have no room for them."""

import errno
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

if TYPE_CHECKING:
    import h5py

OURS = ".capslip."  # begins every name that is there only while something is written
FULL = {errno.ENOSPC, errno.EDQUOT}  # the disk, or one's share of it


def is_full(error: BaseException) -> TypeGuard[OSError]:
    """Tell whether an error is that of a full disk."""
    return isinstance(error, OSError) and error.errno in FULL


def way_out(error: BaseException, other: str) -> str:
    """Return what to do where a file cannot be written: on a full disk another name is no help.

    Examples
    --------
    >>> way_out(OSError(errno.ENOSPC, "No space left on device"), "give another name")
    'make room on its disk, or give another name'
    >>> way_out(OSError(errno.EACCES, "Permission denied"), "give another name")
    'give another name'
    """
    return f"make room on its disk, or {other}" if is_full(error) else other


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file whole, or leave what is there as it is.

    Parameters
    ----------
    path : Path
        Of the file; one that is there is replaced, behind a link as well. What is no file, such as
        a pipe, is written to at once.
    write : callable
        Writes all of it to another path beside it, with the same ending.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    if path.exists() and not path.is_file():
        write(path)
        return
    whole = Path(os.path.realpath(path))
    with tempfile.TemporaryDirectory(prefix=OURS, dir=whole.parent) as work:
        unfinished = Path(work) / f"unfinished{path.suffix}"
        write(unfinished)
        os.replace(unfinished, whole)


@contextmanager
def hdf5_in_memory(path: Path, **options: Any) -> Iterator["h5py.File"]:
    """Open an HDF5 file in memory, and bring it to the disk at once where nothing fails.

    On a full disk HDF5 itself would end the process.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    import h5py

    with h5py.File(path, "w", driver="core", backing_store=False, **options) as file:
        yield file
        file.flush()
        path.write_bytes(file.id.get_file_image())
