"""A folder that is filled aside and then takes its place, so that a result is whole or not there.

`summary.json` moves last: it is the only sign of a finished result.
"""

import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from capslip.errors import OutputError
from capslip.result import SCHEMA

# Everything that an analysis leaves in its folder. A folder that holds more is not ours to replace.
FILES = frozenset(
    {
        "summary.json",
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
OURS = ".capslip."  # begins the names of folders that hold a result under way


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give a temporary folder that takes the place of `folder` when the block ends well.

    Raises
    ------
    OutputError
        If `folder` is a file, cannot be written, or holds files that no analysis wrote.
    """
    check_folder(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        stays = _stays(folder)
        place = folder if stays else folder.parent
        work = Path(tempfile.mkdtemp(prefix=OURS, dir=place))
    except OSError as error:
        raise OutputError(
            f"output folder {folder}: {error.strerror}; choose another with --out"
        ) from error
    try:
        work.chmod(0o777 & ~_umask())
        yield work
        if stays:
            _move_into(work, folder)
        else:
            _move(work, folder)
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise


def check_folder(folder: Path, keep: Iterable[str | Path | None] = ()) -> None:
    """Refuse a folder that cannot be replaced, or that holds a file to `keep`.

    Raises
    ------
    OutputError
        See `new_folder`.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"output folder {folder}: is a file; choose another with --out")
    if not folder.is_dir():
        return
    for path in keep:
        if path is not None and folder.resolve() in Path(path).resolve().parents:
            raise OutputError(
                f"output folder {folder}: holds {path}, which is to be read and would be "
                "replaced; nothing was written; choose another with --out"
            )
    names = {entry.name for entry in _entries(folder)}
    if not names:
        return
    foreign = sorted(names - FILES)
    if foreign or not _is_result(folder):
        found = foreign[0] if foreign else sorted(names)[0]
        raise OutputError(
            f"output folder {folder}: holds {found}, which is no earlier result of capslip; "
            "nothing was written; choose another with --out, or move that file away"
        )


def _is_result(folder: Path) -> bool:
    summary = read_summary(folder)
    return summary is not None and str(summary.get("schema")).startswith("capslip/")


def read_summary(folder: Path) -> dict[str, Any] | None:
    """Return the summary of a finished result, or None where there is none."""
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return summary if isinstance(summary, dict) and summary.get("schema") == SCHEMA else None


def _move(work: Path, folder: Path) -> None:
    old = work.with_name(work.name + ".old")
    if folder.exists():
        try:
            os.replace(folder, old)
        except OSError:  # mounted from the same disk, which does not show before
            _move_into(work, folder)
            return
    try:
        os.replace(work, folder)
    except BaseException:
        if old.exists():
            os.replace(old, folder)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _stays(folder: Path) -> bool:
    """Tell whether a folder has to be filled in its place: new, in use, or mounted."""
    if not folder.is_dir():
        return False
    here = Path.cwd()
    return (
        not _entries(folder)
        or folder.resolve() in (here, *here.parents)
        or os.path.ismount(folder)
        or not os.access(folder.parent, os.W_OK)
    )


def _entries(folder: Path) -> list[Path]:
    """List a folder without what an analysis that was killed may have left in it."""
    return [entry for entry in folder.iterdir() if not entry.name.startswith(OURS)]


def _move_into(work: Path, folder: Path) -> None:
    """Put one result in the place of another, file by file: while they move, there is no summary.

    An earlier result is put back if that fails.
    """
    old = Path(tempfile.mkdtemp(prefix=OURS, dir=folder))
    new = sorted(work.iterdir(), key=lambda one: one.name == "summary.json")
    moved = []
    try:
        for entry in sorted(_entries(folder), key=lambda one: one.name != "summary.json"):
            shutil.move(entry, old / entry.name)
        for entry in new:
            moved.append(folder / entry.name)
            shutil.move(entry, moved[-1])
    except BaseException:
        for entry in moved:
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink(missing_ok=True)
        for entry in sorted(old.iterdir(), key=lambda one: one.name == "summary.json"):
            shutil.move(entry, folder / entry.name)
        old.rmdir()
        raise
    work.rmdir()
    shutil.rmtree(old, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
