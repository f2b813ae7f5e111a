"""What a result was made with: digests of files and of this package, versions of libraries."""

import hashlib
import time
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGE = Path(__file__).parent
SOURCES = {".py", ".toml", ".j2"}
FRESH_S = 60.0  # since the last change of a file; the system brings changes to the disk in half
UNREAD = "unread: "  # begins what stands for a digest, before the reason
LIBRARIES = ("numpy", "scipy", "h5py", "matplotlib", "vtk")  # of numbers, files and pictures

Seen = dict[Path, tuple[tuple[int, ...], str | None]]


def sha256_of(path: Path) -> str:
    """Return the SHA-256 digest of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest_of(path: Path) -> str:
    """Return the digest of a file, or in its place why there is none."""
    try:
        # a pipe would be waited for
        return sha256_of(path) if path.is_file() or not path.exists() else f"{UNREAD}no file"
    except OSError as error:
        return f"{UNREAD}{error.strerror}"


def state_of(path: Path) -> tuple[int, ...]:
    """Return what changes with a file; nothing where it is gone."""
    try:
        found = path.stat()
    except OSError:
        return ()
    return found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


def is_fresh(state: tuple[int, ...]) -> bool:
    """Tell whether a file may have changed without a trace in its times, which then are too coarse.

    The system notes a change by way of mapped memory once until it wrote that to the disk.
    """
    return not state or abs(time.time() - 1e-9 * state[2]) < FRESH_S


def seen_of(paths: Iterable[Path]) -> Seen:
    """Return what tells later whether files have changed: states, and digests of fresh ones.

    Examples
    --------
    >>> before = seen_of([Path(__file__)])
    >>> is_as_seen(before)
    True
    """
    states = {path: state_of(path) for path in paths}
    return {path: (of, digest_of(path) if is_fresh(of) else None) for path, of in states.items()}


def is_as_seen(files: Seen) -> bool:
    """Tell whether files are, and have been all the time, as they were seen."""
    return all(
        digest in (None, digest_of(path)) and state == state_of(path)
        for path, (state, digest) in files.items()
    )


@cache
def code_sha256() -> str:
    """Return the digest of the sources of this package: other formulas, other results."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*")):
        if path.suffix in SOURCES:
            digest.update(f"{path.relative_to(PACKAGE).as_posix()} {sha256_of(path)}\n".encode())
    return digest.hexdigest()


@cache
def libraries() -> str:
    """Return the libraries that are installed, with their versions."""
    found = []
    for name in LIBRARIES:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return ", ".join(found)
