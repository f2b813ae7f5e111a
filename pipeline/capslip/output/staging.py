"""One way to write a result: whole or not there, and never over a file of someone else.

A result is made in a folder of its own inside its place, under a lock. When every file is on the
disk, that folder is renamed to `READY`: from then on the result is whole, and its files move to
their names, `summary.json` last, which is the only sign of a finished result. What was interrupted
before is thrown away, what was interrupted after is finished, by whoever writes there next. The
failure of a batch, `failure.json`, takes the place of a result in the same way.
"""

import errno
import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import msgspec

from capslip.disk import OURS, is_full
from capslip.errors import OutputError
from capslip.leftovers import is_leftover
from capslip.provenance import sha256_of
from capslip.summary import SCHEMA

if TYPE_CHECKING:
    from capslip.surface.heightmap import Origin

try:
    import fcntl
except ImportError:  # a system without these locks
    fcntl = None  # type: ignore[assignment]

SUMMARY, FAILURE = "summary.json", "failure.json"
# Everything that an analysis leaves in its folder, for results that do not list it themselves
FILES = frozenset(
    {
        SUMMARY,
        "result.h5",
        "caps.csv",
        "settings.toml",
        "report.html",
        "figures",
        "caps.vtu",
        "surface.vtu",
        "jenkins.csv",
        "law.csv",
        "law.h5",
        "law.json",
        "law.py",
        "law_abaqus.inp",
        "law_calculix.inp",
        "law_jenkins.csv",
    }
)
READY = f"{OURS}ready"
LOCK = f"{OURS}lock"
GONE = "gone.json"  # in READY: files of the earlier result that the new one has not
WAIT_S = 5.0  # for a lock
ROOM = 1 << 14  # bytes: of what is still to be noted beside a finished result
MOST_AT_ONCE = 8  # files that are brought to the disk
NO_SYNC = {errno.EINVAL, errno.ENOTSUP}  # of folders, on some file systems
NO_LOCKS = {errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOLCK}


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give a temporary folder whose files take their place in `folder` when the block ends well.

    The block writes `summary.json` or `failure.json`. A link is followed; what else appears in the
    folder meanwhile stays as it is, and so do leftovers of file managers.

    Raises
    ------
    OutputError
        If `folder` is a file, cannot be written, holds files that no analysis wrote, is being
        written by another process, if a file of a name that is needed appears meanwhile, or if the
        disk is full.
    """
    with named(folder):
        made = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
    try:
        with locked(folder):
            with named(folder):
                recover(folder)
                check_folder(folder)
                work = Path(tempfile.mkdtemp(prefix=OURS, dir=folder))
            try:
                yield work
                owned, made_here = _owned(folder), dict(_below(work))
                _refuse_clash(made_here, folder, owned)
                if gone := sorted(owned - set(made_here)):
                    (work / GONE).write_text(json.dumps(gone), encoding="utf-8")
                    made_here[GONE] = False
                # At once: each waits for the disk, which takes them together
                with ThreadPoolExecutor(MOST_AT_ONCE) as pool:
                    list(pool.map(_sync, (work, *(f"{work}/{name}" for name in made_here))))
                os.replace(work, folder / READY)
            except BaseException as error:
                shutil.rmtree(work, ignore_errors=True)
                if is_full(error):
                    raise OutputError(
                        f"output folder {folder}: {error.strerror}; nothing was written; make room "
                        "on its disk, or choose another with --out"
                    ) from error
                raise
            with named(folder):
                _put_in_place(folder)
    finally:
        if made:
            with suppress(OSError):  # not empty: there is a result in it
                folder.rmdir()


def check_folder(folder: Path, keep: Iterable[str | Path | None] = ()) -> None:
    """Refuse a folder that cannot be written, is of someone else, or holds a file to `keep`.

    Raises
    ------
    OutputError
        See `new_folder`.
    """
    with named(folder):
        if folder.exists() and not folder.is_dir():
            raise OutputError(f"output folder {folder}: is a file; choose another with --out")
        nearest = next(one for one in (folder, *folder.absolute().parents) if one.exists())
        if not os.access(nearest, os.W_OK | os.X_OK):
            raise OutputError(
                f"output folder {folder}: {nearest} cannot be written; choose another with --out"
            )
        if not folder.is_dir():
            return
        for path in keep:
            if path is not None and folder.resolve() in Path(path).resolve().parents:
                raise OutputError(
                    f"output folder {folder}: holds {path}, which is to be read and would be "
                    "replaced; nothing was written; choose another with --out"
                )
        foreign = _foreign(folder)
    if foreign is not None:
        raise OutputError(
            f"output folder {folder}: holds {foreign}, which is no earlier result of capslip; "
            "nothing was written; choose another with --out, or move that file away"
        )


def recover(folder: Path) -> None:
    """Finish the result that was whole when its process ended, and remove what was not.

    Called by who holds the lock of the folder.
    """
    if (folder / READY).is_dir():
        _put_in_place(folder)
    for entry in folder.glob(f"{OURS}*"):
        if entry.is_dir():
            shutil.rmtree(entry, ignore_errors=True)
        elif entry.name != LOCK:
            entry.unlink(missing_ok=True)


@contextmanager
def locked(folder: Path, shared: bool = False, wait_s: float = WAIT_S) -> Iterator[None]:
    """Keep other processes from writing in a folder; `shared` ones keep out only those that do not.

    Raises
    ------
    OutputError
        If another process still writes there after `wait_s`, or no file can be made there.
    """
    path, end_s = folder / LOCK, time.monotonic() + wait_s
    while (file := _take(path, shared)) is None:
        if time.monotonic() > end_s:
            raise OutputError(
                f"output folder {folder}: another run of capslip writes there; wait for its end, "
                "or choose another with --out"
            )
        time.sleep(0.05)
    try:
        yield
    finally:
        if not shared:
            path.unlink(missing_ok=True)
        file.close()


def _take(path: Path, shared: bool) -> IO[str] | None:
    """Open and lock a file; None where another process holds it."""
    with named(path.parent):
        file = path.open("a")
    try:
        if fcntl is not None:
            fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        if _is_at(file.fileno(), path):  # its last holder may just have removed it
            return file
    except OSError as error:
        if error.errno in NO_LOCKS:  # of the file system; results are whole all the same
            return file
        if not isinstance(error, BlockingIOError):
            file.close()
            raise
    file.close()
    return None


def _is_at(number: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(number), path.stat())
    except FileNotFoundError:
        return False


@contextmanager
def named(folder: Path) -> Iterator[None]:
    """Name the folder where the system refuses something."""
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"output folder {folder}: {error.strerror}; choose another with --out"
        ) from error


def check_room(folder: Path) -> None:
    """Raise the error of a full disk where there is hardly room for anything."""
    path = folder / f"{OURS}room"
    try:
        path.write_bytes(bytes(ROOM))
    finally:
        path.unlink(missing_ok=True)


def write_file(path: Path, data: bytes) -> None:
    """Write one file, whole or not at all."""
    part = path.with_name(OURS + path.name)
    with part.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(part, path)


def read_summary(folder: Path) -> dict[str, Any] | None:
    """Return the summary of a finished result, or None where there is none."""
    summary = read_json(folder / SUMMARY)
    return summary if summary is not None and summary.get("schema") == SCHEMA else None


def scans_replaced(folder: Path, origins: Iterable["Origin"]) -> list[str]:
    """Return the scans of the result in a folder that are none of those to be written there.

    A scan is the same by its path, or by its bytes where it was moved; it is one map of its file.
    """
    summary, new = read_summary(folder) or {}, list(origins)
    there = summary.get("scans") or [summary.get("surface") or {}]

    def is_in_new(scan: dict[str, Any]) -> bool:
        path, maps = Path(scan["path"]).resolve(), {None, scan.get("dataset")}
        return any(
            (one.sha256 == scan.get("sha256") or Path(one.path or "").resolve() == path)
            and (one.dataset in maps or len(maps) == 1)
            for one in new
        )

    return [scan["path"] for scan in there if scan.get("path") and not is_in_new(scan)]


def read_json(path: Path) -> dict[str, Any] | None:
    """Return the object in a JSON file, or None where there is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def summary_text(summary: dict[str, Any]) -> bytes:
    """Return the bytes of `summary.json`; what is no text in a path is escaped."""
    text = json.dumps(summary, ensure_ascii=False, allow_nan=False)  # with an indent: twice as slow
    try:
        return msgspec.json.format(text.encode(), indent=1) + b"\n"
    except UnicodeEncodeError:
        text = json.dumps(summary, indent=1, ensure_ascii=False) + "\n"
        return text.encode("utf-8", "backslashreplace")


def with_digests(summary: dict[str, Any], work: Path) -> dict[str, Any]:
    """Return a summary that lists the SHA-256 digest of every file of its result.

    That of `summary.json` itself is taken without its own line.
    """
    outputs = {name: sha256_of(work / name) for name in sorted(_files(work))}
    listed = {**summary, "outputs": outputs}
    own = hashlib.sha256(summary_text(listed)).hexdigest()
    return {**summary, "outputs": {**outputs, SUMMARY: own}}


def is_whole(summary: dict[str, Any], folder: Path) -> bool:
    """Tell whether every file of a result is there as it was written."""
    outputs = dict(summary.get("outputs") or {})
    own = outputs.pop(SUMMARY, None)
    if own != hashlib.sha256(summary_text({**summary, "outputs": outputs})).hexdigest():
        return False
    try:
        return all(sha256_of(folder / name) == digest for name, digest in outputs.items())
    except OSError:
        return False


def entries(folder: Path) -> list[Path]:
    """Return what somebody put in a folder."""
    names = (name for name in os.listdir(folder) if not name.startswith(OURS))
    return [folder / name for name in names if not is_leftover(name)]


def _put_in_place(folder: Path) -> None:
    """Move the files of READY to their names; called again, go on where it ended."""
    ready = folder / READY
    below = dict(_below(ready))
    last = next((name for name in (SUMMARY, FAILURE) if name in below), None)
    if last is not None:
        gone = json.loads((ready / GONE).read_text(encoding="utf-8")) if GONE in below else []
        if SUMMARY in (last, *gone):
            (folder / SUMMARY).unlink(missing_ok=True)
        folders = [folder]
        for name, is_folder in below.items():
            if is_folder:
                folders.insert(0, folder / name)
                folders[0].mkdir(exist_ok=True)
            elif name not in (last, GONE):
                os.replace(f"{ready}/{name}", f"{folder}/{name}")
        if gone:
            _remove(folder, gone)
        for path in folders:
            _sync(path)
        os.replace(ready / last, folder / last)
        _sync(folder)
    shutil.rmtree(ready, ignore_errors=True)


def _remove(folder: Path, names: list[str]) -> None:
    """Remove files of the earlier result, and its folders that the new one has not."""
    for name in names:
        (folder / name).unlink(missing_ok=True)
    ours = FILES | {Path(name).parts[0] for name in names}
    for entry in entries(folder):
        if entry.name in ours and entry.is_dir() and not (folder / READY / entry.name).is_dir():
            with suppress(OSError):  # not empty
                entry.rmdir()


def _refuse_clash(made: dict[str, bool], folder: Path, owned: set[str]) -> None:
    """Refuse to put a file where one of someone else appeared since the folder was checked."""
    for name, is_folder in made.items():
        place = folder / name
        fits = is_folder and place.is_dir() and not place.is_symlink()
        if os.path.lexists(place) and not fits and name not in owned:
            raise OutputError(
                f"output folder {folder}: {name} appeared while the analysis ran and is not ours "
                "to replace; nothing was written; move it away, or choose another with --out"
            )


def _owned(folder: Path) -> set[str]:
    """Return the files of the result that stands in a folder, paths in it with slashes."""
    own = {FAILURE} if str(_schema(folder / FAILURE)).startswith("capslip/") else set()
    schema = _schema(folder / SUMMARY)
    if schema == "" and (folder / "settings.toml").is_file():  # torn, beside what came before it
        schema = SCHEMA
    if not str(schema).startswith("capslip/"):
        return own
    listed = (read_summary(folder) or {}).get("outputs")
    known = (name for name in _files(folder) if name.partition("/")[0] in FILES)
    return own | set(listed or known)


def _schema(path: Path) -> str | None:
    """Return what a JSON file calls itself: nothing where it is torn, None where it is not ours."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        return None
    except ValueError:
        return ""
    return str(found.get("schema")) if isinstance(found, dict) else None


def _foreign(folder: Path) -> str | None:
    """Return the first entry that is no file of the result there."""
    owned = _owned(folder)
    for entry in sorted(entries(folder)):
        if entry.is_dir() and not entry.is_symlink():
            for inner in sorted(entries(entry)):
                if f"{entry.name}/{inner.name}" not in owned:
                    return f"{entry.name}/{inner.name}"
        elif entry.name not in owned:
            return entry.name
    return None


def _below(folder: str | Path, place: str = "") -> Iterator[tuple[str, bool]]:
    """Yield what lies below a folder, and whether it is a folder, which comes before what it has.

    Paths are from the folder on, with slashes.
    """
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda one: one.name):
            is_folder = entry.is_dir(follow_symlinks=False)
            yield place + entry.name, is_folder
            if is_folder:
                yield from _below(entry.path, f"{place}{entry.name}/")


def _files(folder: Path) -> Iterator[str]:
    """Yield the files of a folder and of those directly in it."""
    for entry in entries(folder):
        if entry.is_dir() and not entry.is_symlink():
            yield from (f"{entry.name}/{inner.name}" for inner in entries(entry))
        else:
            yield entry.name


def _sync(path: str | Path) -> None:
    """Bring a file, or the names in a folder, to the disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in NO_SYNC:
            raise
    finally:
        os.close(number)
