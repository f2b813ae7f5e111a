"""The scans of a batch: from files, folders, globs and lists, each with a name of its own."""

import codecs
import csv
import glob
import hashlib
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

from capslip.errors import NothingToDoError, SettingsError, check_kind, texts_of
from capslip.leftovers import is_leftover
from capslip.output.staging import FAILURE, SUMMARY, read_json, read_summary, scans_replaced
from capslip.provenance import UNREAD, digest_of
from capslip.settings import Settings, settings_from
from capslip.surface.heightmap import Origin

MOST_BYTES = 120  # of a name; file systems take 255, and names of files in it follow
SETTING = {"preload_N": "contact.preload_N", "unit": "reading.unit"}  # of one scan, in a list
# In a folder of scans no reader takes such a file; named for itself, it is refused with a word
NO_SCANS = {".html", ".json", ".md", ".pdf", ".py", ".toml", ".yaml", ".yml"}
TEXTS = ("group", *SETTING)  # in a list, what is no path
LIST = ("scan", "mate", *TEXTS)


@dataclass(frozen=True)
class Scan:
    """One scan of a batch.

    Attributes
    ----------
    path : Path
        The file.
    settings : Settings
        Those of all scans, with what the list says of this one.
    mate : Path or None
        The other face.
    group : str or None
        A word for the table, such as the joint that the face belongs to.
    name : str
        Of its folder and its row.
    """

    path: Path
    settings: Settings
    mate: Path | None = None
    group: str | None = None
    name: str = ""

    @property
    def digest(self) -> str:
        """Tells it from every other one."""
        parts = (self.path, self.mate, self.group, self.settings.sha256())
        return hashlib.sha256(os.fsencode("\n".join(map(str, parts)))).hexdigest()[:8]

    def home(self, folder: Path) -> Path:
        """Return where its result is, in the folder of a batch."""
        return folder.absolute() / "scans" / self.name


def find_scans(
    sources: Iterable[str],
    settings: Settings,
    list_file: Path | None = None,
    recursive: bool = False,
    leave_out: Path | None = None,
) -> tuple[list[Scan], Counter[str]]:
    """Find the scans of a batch.

    Parameters
    ----------
    sources : iterable of str
        Files, folders and globs. Hidden files of a folder are left out, and leftovers of file
        managers. A file that is not there is a scan that fails, if there is another one.
    settings : Settings
        Of all scans.
    list_file : Path, optional
        One path a line, or CSV with the column scan and any of mate, group, preload_N and unit;
        an empty cell leaves the setting as it is. Paths are relative to the list.
    recursive : bool, optional
        Take the folders in a folder, too, but for hidden ones and results.
    leave_out : Path, optional
        A folder that is not searched: that of the results. A scan that has one there keeps its
        name.

    Returns
    -------
    list of Scan
        In the order of their paths, each with a name that is a file name on any system.
    Counter
        What was skipped, and how often.

    Raises
    ------
    NothingToDoError
        If no file is found.
    SettingsError
        If the list cannot be read, or says what makes no sense.
    """
    sources = texts_of("sources", sources)
    check_kind("settings", settings, Settings, "Settings; make them with capslip.load_settings")
    skipped: Counter[str] = Counter()
    paths = _paths(sources, recursive, leave_out, skipped)
    named = chain(
        (Scan(path.absolute(), settings) for path in paths),
        () if list_file is None else _listed(list_file, settings),
    )
    real = cache(os.path.realpath)  # of folders: a link to a file is a scan with a name of its own
    once: dict[Scan, Scan] = {}
    for scan in named:
        once.setdefault(replace(scan, path=Path(real(scan.path.parent), scan.path.name)), scan)
    found = list(once.values())
    if not any(os.path.isfile(scan.path) for scan in found):
        told = ", ".join([*sources, *([str(list_file)] if list_file else [])])
        passed = "".join(f"; skipped: {count} {what}" for what, count in skipped.items())
        passed += "".join(f"; {scan.path} is no file" for scan in found[:1])
        raise NothingToDoError(
            f"no scan {f'found in {told}{passed}' if told else 'given'}; expected files, a folder "
            "with files, a glob or a list"
        )
    keys = {one: one.sha256() for one in {scan.settings for scan in found}}
    scans = sorted(found, key=lambda scan: (scan.path, str(scan.mate), keys[scan.settings]))
    pairs = zip(scans, _names(scans, leave_out), strict=True)
    return [replace(one, name=name) for one, name in pairs], skipped


def replaced(scans: Iterable[Scan], folder: Path) -> str | None:
    """Say whose results in the folder of a batch give way to those of these scans.

    None where each has what is there of itself, by its path or by its bytes, or cannot be read, so
    that what is there stays.
    """
    gone = {scan.name: path for scan in scans if (path := _other(scan, folder)) is not None}
    for name, path in gone.items():
        first = f"{folder / 'scans' / name} holds a result of {path}"
        if len(gone) == 1:
            return f"{first}, which is replaced; see --out"
        return f"{first}, and so on: results of {len(gone)} other scans are replaced; see --out"
    return None


def tell_unlisted(scans: Iterable[Scan], folder: Path, say: Callable[[str], None]) -> None:
    """Say of how many other scans the folder of a batch holds results, which its table leaves out.

    A table lists the scans of one call, and tells it apart from what was there by nothing.
    """
    own = {scan.home(folder).name for scan in scans}
    others = sorted(
        home.name
        for home in (folder / "scans").iterdir()
        if home.name not in own and any((home / name).is_file() for name in (SUMMARY, FAILURE))
    )
    if not others:
        return
    of = f"another scan ({others[0]})"
    if len(others) > 1:
        of = f"{len(others)} other scans ({others[0]} and so on)"
    say(
        f"{folder} holds what came of {of}, which batch.csv and index.html do not list; to list "
        "all, name the sources of all with --collect"
    )


def _other(scan: Scan, folder: Path) -> str | None:
    """Return the path of another scan whose result has the place of this one's."""
    home = scan.home(folder)
    origin = Origin(path=str(scan.path), dataset=scan.settings.reading.dataset)
    if not scans_replaced(home, [origin]):
        return None
    digest = digest_of(scan.path)  # of what was moved; looked for last, as it takes longest
    gone = scans_replaced(home, [replace(origin, sha256=digest)])
    return gone[0] if gone and not digest.startswith(UNREAD) else None


def _paths(
    sources: Iterable[str], recursive: bool, leave_out: Path | None, skipped: Counter[str]
) -> Iterator[Path]:
    for source in sources:
        if os.path.isdir(source):
            yield from _in_folder(source, recursive, leave_out, skipped)
        elif glob.has_magic(source) and not os.path.lexists(source):
            for hit in glob.iglob(source, recursive=True):
                if is_leftover(os.path.basename(hit)):
                    skipped["hidden"] += 1
                elif os.path.isfile(hit):
                    yield Path(hit)
                else:
                    skipped["no file"] += 1
        else:
            yield Path(source)


def _in_folder(
    folder: str, recursive: bool, leave_out: Path | None, skipped: Counter[str]
) -> Iterator[Path]:
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda one: one.name):
            if entry.name.startswith(".") or is_leftover(entry.name):
                skipped["hidden"] += 1
            elif os.path.isfile(entry.path):  # entry.is_file() raises on a link to itself
                if os.path.splitext(entry.name)[1].lower() in NO_SCANS:
                    skipped["document"] += 1
                else:
                    yield Path(entry.path)
            elif not entry.is_dir(follow_symlinks=False):
                skipped["no file"] += 1
            elif not recursive:
                skipped["folder (see --recursive)"] += 1
            elif os.path.isfile(os.path.join(entry.path, "summary.json")):
                skipped["result"] += 1
            elif leave_out is not None and Path(entry.path).resolve() == leave_out.resolve():
                skipped["folder of this batch"] += 1
            else:
                yield from _in_folder(entry.path, recursive, leave_out, skipped)


def _is_remark(line: str, folder: Path) -> bool:
    """Tell whether a line of a list names no scan; a scan may well be called #1.sur."""
    return line.startswith("#") and not (folder / line.partition(",")[0].strip()).exists()


def _listed(list_file: Path, settings: Settings) -> Iterator[Scan]:
    try:
        content = list_file.read_bytes()
    except OSError as error:
        raise SettingsError(f"{list_file}: {error.strerror}; give a list of scans") from error
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        lines = content.decode("utf-16", "replace").splitlines()
    else:
        lines = content.decode("utf-8-sig", "surrogateescape").splitlines()
    lines = [line for line in lines if line.replace(",", "").strip()]
    lines = [line for line in lines if not _is_remark(line, list_file.parent)]
    if any("\0" in line for line in lines):
        raise SettingsError(f"{list_file}: holds zero bytes; expected text; save it as UTF-8")
    columns = _columns(lines[0], list_file) if lines else []
    if not columns:
        for line in map(str.strip, lines):
            yield Scan((list_file.parent / line).absolute(), settings)
        return
    known: dict[tuple[str | None, ...], Settings] = {}
    for row in csv.reader(lines[1:]):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(columns):  # such as 1,500 for 1500
            raise SettingsError(
                f"{list_file}: {row[0]}: got {len(row)} cells; expected {len(columns)}, as many as "
                "there are columns; put a cell with a comma in quotes"
            )
        cells = {name: cell.strip() or None for name, cell in zip(columns, row, strict=True)}
        given = dict.fromkeys(LIST) | cells
        given |= {name: _as_text(cell) for name, cell in given.items() if cell and name in TEXTS}
        if given["scan"] is None:
            raise SettingsError(f"{list_file}: {','.join(row)}: got no scan; expected its path")
        own = tuple(given[name] for name in SETTING)
        if own not in known:
            known[own] = _with(settings, given, f"{list_file}: {given['scan']}")
        mate = (list_file.parent / given["mate"]).absolute() if given["mate"] else None
        path = (list_file.parent / given["scan"]).absolute()
        yield Scan(path, known[own], mate, given["group"])


def _as_text(cell: str) -> str:
    """Return the text of a cell that may have been no UTF-8, which only names of files may be."""
    stored = cell.encode("utf-8", "surrogateescape")
    try:
        return stored.decode()
    except UnicodeDecodeError:
        return stored.decode("latin-1")


def _columns(head: str, list_file: Path) -> list[str]:
    """Return the columns of a list, none where its first line is a scan."""
    columns = [one.strip().strip('"') for one in head.split(",")]
    if "scan" in columns:
        for name in columns:
            if name not in LIST or columns.count(name) > 1:
                what = "unknown" if name not in LIST else "more than one"
                raise SettingsError(
                    f"{list_file}: {what} column {name!r}; expected some of {', '.join(LIST)}"
                )
        return columns
    words = (one.strip(' "') for one in re.split("[,;\t]", head.casefold()))
    if any(one in ("scan", "preload_n") for one in words):
        raise SettingsError(
            f"{list_file}: begins with {head!r}; expected a path a line, or columns named "
            f"{', '.join(LIST)}, in this spelling, with commas between them"
        )
    return []


def _with(settings: Settings, given: dict[str, str | None], where: str) -> Settings:
    """Return settings with what a list says of one scan."""
    tables: dict[str, Any] = settings.to_dict()
    for column, setting in SETTING.items():
        value: Any = given[column]
        if value is None:
            continue
        table, key = setting.split(".")
        if column == "preload_N":
            try:
                value = float(value)
            except ValueError:
                raise SettingsError(f"{where}: {column}: got {value!r}; expected a force") from None
            tables["run"]["given"] = [*tables["run"]["given"], setting]
        tables.setdefault(table, {})[key] = value
    return settings_from(tables, where)


def _names(scans: list[Scan], folder: Path | None = None) -> list[str]:
    """One name a scan: the stem, or as much of the path as it takes to tell the scans apart.

    A scan whose result is in the folder under a name keeps that, whichever others come.
    """

    @cache
    def owner(name: str) -> str | None:
        return None if folder is None else _path_of(folder / "scans" / name)

    names = [_plain(scan.path.stem) for scan in scans]
    more = (_with_mate, _with_preload, _with_group, _with_unit, _with_all, _with_digest)
    for longer in (_with_ending, _with_folder, *more):
        pairs = list(zip(names, scans, strict=True))
        count = Counter(name.casefold() for name in names)
        same = Counter((name, scan.path) for name, scan in pairs)
        names = [
            name
            if count[name.casefold()] == 1
            or (same[name, scan.path] == 1 and str(scan.path) == owner(name))
            else longer(scan)
            for name, scan in pairs
        ]
    return names


def _path_of(home: Path) -> str | None:
    """Return the scan of the result or failure in a folder, or None where there is none."""
    summary, failure = read_summary(home), read_json(home / FAILURE)
    path: str | None = ((summary or {}).get("surface") or failure or {}).get("path")
    return path


def _with_ending(scan: Scan) -> str:
    return _plain(scan.path.name)


def _with_folder(scan: Scan) -> str:
    return _plain(f"{scan.path.parent.name}_{scan.path.name}")


def _with_mate(scan: Scan) -> str:
    own = scan.path.name
    return _plain(own if scan.mate is None else f"{own}_{scan.mate.stem}")


def _with_preload(scan: Scan) -> str:
    return f"{_with_mate(scan)}_{scan.settings.contact.preload_N:g}N"


def _with_group(scan: Scan) -> str:
    return _joined(_with_mate(scan), scan.group)


def _with_unit(scan: Scan) -> str:
    return _joined(_with_mate(scan), scan.settings.reading.unit)


def _with_all(scan: Scan) -> str:
    return _joined(_with_preload(scan), scan.group, scan.settings.reading.unit)


def _joined(*parts: str | None) -> str:
    return _plain("_".join(part for part in parts if part is not None))


def _with_digest(scan: Scan) -> str:
    return f"{_with_ending(scan)}_{scan.digest}"


def _plain(text: str) -> str:
    """Return a name that any system takes: printable, not hidden, not too long."""
    name = "".join(one if one.isprintable() and one not in '<>:"/\\|?*' else "_" for one in text)
    name = f"_{name[1:]}" if name.startswith(".") else name
    if len(name.encode()) <= MOST_BYTES:
        return name
    digest = hashlib.sha256(os.fsencode(text)).hexdigest()[:8]
    return f"{name.encode()[:MOST_BYTES].decode('utf-8', 'ignore')}_{digest}"
