"""Many scans: one folder and one row a scan, no scan the end of the rest, nothing done twice."""

import json
import os
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from capslip.analysis import analyze
from capslip.disk import OURS
from capslip.errors import OutputError, SettingsError, check_call, check_kind, in_one_line, path_of
from capslip.output.folder import write
from capslip.output.overview import COLUMNS, Row, row_of, write_overview, write_table
from capslip.output.staging import (
    FAILURE,
    SUMMARY,
    check_folder,
    entries,
    is_whole,
    locked,
    named,
    new_folder,
    read_json,
    read_summary,
    recover,
)
from capslip.provenance import UNREAD, Seen, code_sha256, digest_of, is_as_seen, seen_of
from capslip.settings import Cluster, Settings, checked, load_settings
from capslip.sources import Scan, find_scans, replaced, tell_unlisted
from capslip.surface.readers.faces import load_faces
from capslip.workers import NO_LIMITS, Limits, Lost, cluster, crew, outcomes

OWN = frozenset({"batch.csv", "batch.parquet", "index.html", "scans"})
FAILURE_SCHEMA = "capslip/failure/1"
TABLE_SHARE = 0.05  # of the time may go into the table of what is done so far
LOOKING = 8  # threads that read what is there, which wait for the disk
AHEAD = 500  # scans that are looked for at a time, each of which takes some memory
TO_DO = "to do"
PICTURES = ("figures", "render", "meshes")  # settings of [run]
MAP_CHANGED = "what joint.pressure_map holds"  # under the same name
LOST = "process"  # the stage of what came back from no child


@dataclass(frozen=True)
class Options:
    """How a batch runs; none of it changes a number.

    Attributes
    ----------
    list_file : Path or None
        See `sources.py:find_scans`.
    recursive : bool
        Take the folders in a folder, too.
    shard : (int, int) or None
        Do the i-th of n parts, from 1, and leave the table to who collects. Several may run at
        once in one folder.
    look : {"dry_run", "collect"} or None
        Analyse nothing: only say what would be done, or make the table of what is there.
    retry_failed : bool
        Analyse again what failed; else it keeps its error while scan, settings, code and limits
        are the same, unless it could not be written.
    max_failures : int or None
        Stop after so many; the scans that are left are to do.
    limits : Limits
        Of each scan.
    scheduler : str, Cluster or None
        Address of a Dask scheduler whose workers do it, or jobs that are to be started; by default
        those of `settings.run.cluster`, if any.
    warn : callable, optional
        Told before the work whose results give way to those of other scans; by default `say` is.
    """

    list_file: Path | None = None
    recursive: bool = False
    shard: tuple[int, int] | None = None
    look: str | None = None
    retry_failed: bool = False
    max_failures: int | None = None
    limits: Limits = NO_LIMITS
    scheduler: str | Cluster | None = None
    warn: Callable[[str], None] | None = field(default=None, compare=False)


Work = Callable[[Scan, Path, str | None, bool], Row]


def analyse_scan(scan: Scan, folder: Path, command: str | None, retry_failed: bool) -> Row:
    """Read, analyse and write one scan; what goes wrong is written and returned, not raised."""
    stage, seen = "look", _seen(scan)
    try:
        if (done := _look_at(scan, folder, retry_failed).row) is not None:
            return done
        stage = "write"
        check_folder(folder, keep=(scan.path, scan.mate))  # before the work, which would be lost
        stage, started_s = "read", time.perf_counter()
        surface, mate = load_faces(scan.path, scan.mate, scan.settings.reading)
        timings_s = {"read": time.perf_counter() - started_s}
        stage = "analyse"
        analysis = analyze(surface, scan.settings, mate)
        stage = "write"
        # Nobody opens the pages of thousands of scans of which the numbers alone were wanted
        page = any(getattr(scan.settings.run, name) for name in PICTURES)
        return row_of(write(analysis, folder, command=command, timings_s=timings_s, page=page))
    except MemoryError:
        raise  # whoever set the limit notes it
    except Exception as error:
        return _fail(scan, folder, stage, in_one_line(error), seen, traceback.format_exc())


def run_batch(
    sources: Iterable[str],
    folder: Path,
    settings: Settings,
    say: Callable[[str], None],
    command: str | None = None,
    options: Options = Options(),
    work: Work = analyse_scan,
) -> list[Row]:
    """Analyse every scan of the sources, in child processes here or on a cluster.

    Parameters
    ----------
    sources : iterable of str
        Files, folders (all files in them, hidden ones left out) and globs.
    folder : Path
        Receives `batch.csv`, `index.html` and one folder a scan under `scans/`, with a result or
        a `failure.json`. A scan whose result stands there already, from the same bytes, settings
        and code, whole and with the pictures that are wanted, is not done again.
    settings : Settings
        For all scans.
    say : callable
        Told what is skipped and each finished scan.
    command : str, optional
        What was called, for the record.
    options : Options, optional
        How it runs.
    work : callable, optional
        Called in a child with scan, folder, command and whether to repeat what failed.

    Returns
    -------
    list of dict
        One row a scan, in the order of the names; a failed scan has status "failed" and its error;
        one with an error and another status lacks a part that no number depends on; one that was
        left, or only looked for and not there, has status "to do".

    Raises
    ------
    NothingToDoError
        If the sources hold no file.
    OutputError
        If the folder cannot be written, holds what no batch wrote, or another batch writes there.
    KeyboardInterrupt
        With what is done so far as its text; the table holds that, too.
    """
    settings, folder = checked(settings), path_of("folder", folder)
    check_call("say", say)
    check_kind("options", options, Options, "Options")
    if options.scheduler is None and settings.run.cluster.system is not None:
        options = replace(options, scheduler=settings.run.cluster)
    scans, skipped = find_scans(sources, settings, options.list_file, options.recursive, folder)
    if skipped:
        say("skipped: " + ", ".join(f"{count} {what}" for what, count in skipped.items()))
    if options.shard is not None:
        scans = scans[options.shard[0] - 1 :: options.shard[1]]
    with named(folder):
        _check_folder(folder)
    if options.look == "dry_run":
        looked = _look(scans, folder, options)
        return [_row(scan, there.row or _to_do(scan, folder, there)) for scan, there in looked]
    with _place(folder, shared=options.shard is not None):
        run = _Run(scans, folder, say, options)
        try:
            run.look()
            if options.look != "collect":
                run.analyse(work, command, settings.run.workers or os.cpu_count() or 1)
        except BaseException as error:
            run.write_table()
            if isinstance(error, KeyboardInterrupt):
                done = f"{len(run.rows)} of {len(scans)} scans are done"
                error.args = (f"interrupted; {done}; the same command goes on from there",)
            raise
        return run.finish()


class _Run:
    """One run of a batch: the rows so far, and the table of them."""

    def __init__(
        self, scans: list[Scan], folder: Path, say: Callable[[str], None], options: Options
    ) -> None:
        self.scans, self.folder, self.say, self.options = scans, folder, say, options
        self.rows: dict[Scan, Row] = {}
        self.failures = 0
        self.next_table_s = 0.0

    def look(self) -> None:
        """Note what is done already, before anything is written, and say what will be no more."""
        others: list[Scan] = []
        for scan, there in _look(self.scans, self.folder, self.options, mend=True):
            if there.row is not None:
                self.note(scan, there.row)
            elif self.options.look == "collect":
                self.rows[scan] = _row(scan, _to_do(scan, self.folder, there))
            elif there.differs:
                others.append(scan)
        if line := replaced(others, self.folder):
            (self.options.warn or self.say)(line)
        self.write_table()

    def analyse(self, work: Work, command: str | None, workers: int) -> None:
        """Analyse the rest; where it ends early, leave nothing half written."""
        started: dict[Scan, Seen] = {}

        def jobs() -> Iterator[tuple[Scan, Path, str | None, bool]]:
            for scan in self.scans:
                if scan not in self.rows:
                    started[scan] = _seen(scan)
                    home = scan.home(self.folder)
                    # a failure that is there was not taken for done
                    again = options.retry_failed or (home / FAILURE).is_file()
                    yield scan, home, command, again

        options = self.options
        try:
            with _executor(options, workers) as (executor, at_once):
                for (scan, home, *_), found in outcomes(
                    executor, work, jobs(), at_once, options.limits
                ):
                    seen = started.pop(scan)
                    if isinstance(found, Lost):
                        found = _fail(scan, home, LOST, found.reason, seen, limits=options.limits)
                    self.note(scan, found)
                    self.failures += self.rows[scan]["status"] == "failed"
                    if options.max_failures is not None and self.failures >= options.max_failures:
                        left = len(self.scans) - len(self.rows)
                        self.say(f"stopped after {self.failures} failures; {left} scans are left")
                        break
                    self.write_table_sometimes()
        finally:
            if options.scheduler is None:  # others finish what they began
                for scan in started:
                    _mend(scan.home(self.folder))

    def note(self, scan: Scan, row: Row) -> None:
        """Keep the row of a scan and tell it."""
        self.rows[scan] = row = _row(scan, row)
        outcome = row["error"] or row["status"]
        self.say(f"{len(self.rows)} of {len(self.scans)}: {scan.name}: {outcome}")

    def write_table_sometimes(self) -> None:
        """Write the table, as often as takes a small share of the time."""
        if time.monotonic() >= self.next_table_s:
            started_s = time.monotonic()
            with suppress(OSError):  # a full disk; that is told at the end
                self.write_table()
            took_s = time.monotonic() - started_s
            self.next_table_s = time.monotonic() + max(1.0, took_s / TABLE_SHARE)

    def write_table(self) -> None:
        """Write the table of what is done; shards leave it to who collects."""
        if self.options.shard is None:
            write_table([self.rows[scan] for scan in self.scans if scan in self.rows], self.folder)

    def finish(self) -> list[Row]:
        """Write table and page, and return the rows, with those of scans that are left."""
        rows = [self.rows.get(scan) or _row(scan, {"status": TO_DO}) for scan in self.scans]
        if self.options.shard is None:
            write_overview(rows, self.folder)
            tell_unlisted(self.scans, self.folder, self.say)
        return rows


@contextmanager
def _executor(options: Options, workers: int) -> Iterator[tuple[Executor, int]]:
    if options.scheduler is not None:
        with cluster(options.scheduler) as found:
            yield found
    else:
        with crew(workers) as executor:
            yield executor, workers


@contextmanager
def _place(folder: Path, shared: bool) -> Iterator[None]:
    """Keep other batches out of a folder; what an earlier one left half written goes."""
    with named(folder):
        (folder / "scans").mkdir(parents=True, exist_ok=True)
    with locked(folder, shared, wait_s=0.0):
        if not shared:
            recover(folder)
        yield


def _check_folder(folder: Path) -> None:
    if folder.absolute().exists() and not folder.is_dir():
        raise OutputError(f"output folder {folder}: is a file; choose another with --out")
    foreign = sorted({one.name for one in entries(folder)} - OWN) if folder.is_dir() else []
    if foreign:
        raise OutputError(
            f"output folder {folder}: holds {foreign[0]}, which no batch wrote; nothing was "
            "written; choose another with --out"
        )


@dataclass(frozen=True)
class _Found:
    """What is there of a scan."""

    row: Row | None = None  # of what would come out the same again; None: there is something to do
    differs: tuple[str, ...] = ()  # of what a result depends on, which is other now
    command: str | None = None  # by which it was made


def _look(
    scans: list[Scan], folder: Path, options: Options, mend: bool = False
) -> Iterator[tuple[Scan, _Found]]:
    """Give each scan with what is there of it."""

    def found(scan: Scan) -> _Found:
        try:
            return _look_at(scan, scan.home(folder), options.retry_failed, mend, options.limits)
        except (OSError, OutputError):
            return _Found()  # who does it says what is wrong

    with ThreadPoolExecutor(LOOKING) as pool:
        for first in range(0, len(scans), AHEAD):
            some = scans[first : first + AHEAD]
            yield from zip(some, pool.map(found, some), strict=True)


def _look_at(
    scan: Scan, home: Path, retry_failed: bool, mend: bool = True, limits: Limits = NO_LIMITS
) -> _Found:
    """Return what is there, with its row where that is a result or failure that stays the same."""
    if not home.is_dir():
        return _Found()
    if mend:
        _mend(home)
    summary, failure = read_summary(home), read_json(home / FAILURE)
    if summary is None and failure is None:
        return _Found()
    key = _key(scan)
    if failure is not None and not retry_failed and _stays(failure, key, limits):
        return _Found({"status": "failed", "error": str(failure.get("message"))})
    row = None if summary is None else _row_there(summary, key, home, scan.settings)
    if row is not None and retry_failed and row["status"] == "failed":
        row = None
    if row is not None or summary is None:
        return _Found(row)
    known = _key_of(summary)
    differs = tuple(name for name, of in key.items() if of != known[name])
    return _Found(None, differs, summary["provenance"].get("command"))


def _row_there(
    summary: dict[str, Any], key: dict[str, str | None], home: Path, wanted: Settings
) -> Row | None:
    """Return the row of a result that is whole, of the same key and has all that is wanted."""
    if _key_of(summary) != key or not is_whole(summary, home):
        return None
    missing = any(one["code"] == "output_missing" for one in summary["problems"])
    return None if missing or _lacking(home, wanted) else row_of(summary)


def _to_do(scan: Scan, folder: Path, there: _Found) -> Row:
    """Return the row of a scan without a result, and what differs where there is another one."""
    home, error = scan.home(folder), None
    if there.differs:
        differs = [f"other {name}" for name in there.differs]
        if "settings" in there.differs:
            differs += _differences(home, scan.settings)
        known = there.command and MAP_CHANGED not in differs
        by = f"; it counts with the options of `{there.command}`" if known else ""
        error = f"the result there is of {', '.join(differs)}{by}"
    elif (home / SUMMARY).is_file() and (lacking := _lacking(home, scan.settings)):
        error = f"the result there lacks pictures (made with {', '.join(lacking)})"
    return {"status": TO_DO, "error": error}


def _differences(home: Path, wanted: Settings) -> list[str]:
    """Return which settings of a result are others, with their value there and here."""
    try:
        there, here = load_settings(home / "settings.toml"), wanted
    except SettingsError:
        return []
    found = []
    for table, of in here.to_dict().items():
        then = there.to_dict().get(table, {})
        keys = [] if table == "run" else dict.fromkeys([*of, *then])
        pairs = ((key, then.get(key), of.get(key)) for key in keys)
        found += [f"{table}.{key} ({a} there, {b} here)" for key, a, b in pairs if a != b]
    given = set(there.run.given) ^ set(here.run.given)
    found = found or [f"{name} (given or not)" for name in sorted(given)]
    return found or ([MAP_CHANGED] if here.joint.pressure_map is not None else [])


def _stays(failure: dict[str, Any], key: dict[str, str | None], limits: Limits) -> bool:
    """Tell whether a failure is of the scan, or of limits that still hold; disks get room again."""
    if failure.get("key") != key or failure.get("stage") == "write":
        return False
    return failure.get("stage") != LOST or failure.get("limits") == asdict(limits)


def _key(scan: Scan) -> dict[str, str | None]:
    """Return what a result depends on."""
    return {
        "code": code_sha256(),
        "settings": scan.settings.sha256(),
        "scan": digest_of(scan.path),
        "mate": None if scan.mate is None else digest_of(scan.mate),
    }


def _seen(scan: Scan) -> Seen:
    """Return what tells later whether a file that a result is made of has changed."""
    files = (scan.path, scan.mate, scan.settings.joint.pressure_map)
    return seen_of(Path(path) for path in files if path is not None)


def _key_of(summary: dict[str, Any]) -> dict[str, str | None]:
    provenance, surface = summary["provenance"], summary["surface"] or {}
    return {
        "code": provenance.get("code_sha256"),
        "settings": provenance["settings_sha256"],
        "scan": surface.get("sha256"),
        "mate": (surface.get("mate") or {}).get("sha256"),
    }


def _lacking(home: Path, wanted: Settings) -> list[str]:
    """Return the options by which a result has no pictures that are wanted now."""
    try:
        then = load_settings(home / "settings.toml").run
    except SettingsError:
        return ["settings that cannot be read"]
    return [f"--no-{one}" for one in PICTURES if getattr(wanted.run, one) > getattr(then, one)]


def _mend(home: Path) -> None:
    """Finish or remove what a process that was ended left in the folder of a scan."""
    if home.is_dir() and any(home.glob(f"{OURS}*")):
        with locked(home):
            recover(home)
        with suppress(OSError):  # not empty
            home.rmdir()


def _fail(
    scan: Scan,
    home: Path,
    stage: str,
    message: str,
    seen: Seen,
    trace: str | None = None,
    limits: Limits = NO_LIMITS,
) -> Row:
    """Write `failure.json` in place of what was there, where that is possible; return the row."""
    key = _key(scan)  # taken before it is known whether that is what failed
    record = {
        "schema": FAILURE_SCHEMA,
        "scan": scan.name,
        "path": str(scan.path),
        "stage": stage,
        "message": message,
        "traceback": trace,
        "limits": asdict(limits),
        "key": key if is_as_seen(seen) else None,
    }
    text = json.dumps(record, indent=1, ensure_ascii=False) + "\n"
    with suppress(OSError, OutputError):
        _mend(home)
        if _gives_way(home, record, seen):
            with new_folder(home) as work:
                (work / FAILURE).write_bytes(text.encode("utf-8", "backslashreplace"))
    return {"status": "failed", "error": message}


def _gives_way(home: Path, failure: dict[str, Any], seen: Seen) -> bool:
    """Tell whether no result is there, or one that is known to be of something else by now."""
    if (summary := read_summary(home)) is None:
        return True
    key, away = failure["key"], any(digest_of(path).startswith(UNREAD) for path in seen)
    if key is None or away or failure["stage"] == "write":  # the next run may find it well
        return False
    return key != _key_of(summary) or not is_whole(summary, home)


def _row(scan: Scan, found: Row) -> Row:
    row: Row = dict.fromkeys(COLUMNS) | found
    mate = None if scan.mate is None else str(scan.mate)
    row.update(scan=scan.name, path=str(scan.path), mate=mate, group=scan.group)
    if "verdict" in found:
        row["folder"] = f"scans/{scan.name}"
    return row
