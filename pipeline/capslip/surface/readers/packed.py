"""Scans packed by gzip, unpacked for their reader."""

import gzip
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from capslip.errors import UnreadableFileError
from capslip.surface.readers.stored import check_growth

MAGIC = b"\x1f\x8b"
MAX_BYTES = 2**32
CHUNK_BYTES = 2**20


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """Yield the path of a copy that is not packed, under the same name without `.gz`.

    Raises
    ------
    UnreadableFileError
        If the file is damaged, or grows as no measured heights do.
    """
    name = path.name[:-3] if path.suffix.lower() == ".gz" else path.name
    with tempfile.TemporaryDirectory(prefix="capslip-") as folder:
        copy = Path(folder) / (name or "scan")
        packed_bytes, size = path.stat().st_size, 0
        try:
            with gzip.open(path) as source, copy.open("wb") as target:
                while chunk := source.read(CHUNK_BYTES):
                    size += len(chunk)
                    check_growth(packed_bytes, size, str(path))
                    if size > MAX_BYTES:
                        raise UnreadableFileError(
                            f"{path}: unpacks to more than {MAX_BYTES} bytes; unpack it first"
                        )
                    target.write(chunk)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise UnreadableFileError(
                f"{path}: damaged or truncated gzip file ({error}); expected a whole one; copy it "
                "again"
            ) from error
        yield copy
