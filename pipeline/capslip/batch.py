"""Many scans: worker processes, one folder and one row a scan, no scan the end of the rest."""

import csv
import glob
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec

import capslip
from capslip.errors import NothingToDoError, OutputError, SettingsError, in_one_line
from capslip.output.folder import write
from capslip.output.rows import QUANTITIES, Value, value
from capslip.output.staging import read_summary
from capslip.settings import Settings, load_settings
from capslip.surface.readers import load_surface, sha256_of
from capslip.workers import outcomes

RESULTS = (  # columns of numbers, by their names in the one table of quantities
    "caps",
    "m",
    "n",
    "h_m",
    "radius_G_m",
    "radius_P_m",
    "model",
    "preload_N",
    "nominal_pressure_Pa",
    "coverage",
    "approach_m",
    "contacts",
    "tangential_stiffness_N_per_m",
    "answer_force_N",
    "answer_displacement_m",
    "answer_stiffness_N_per_m",
    "answer_stiffness_low_N_per_m",
    "answer_stiffness_high_N_per_m",
    "answer_energy_J",
    "answer_energy_low_J",
    "answer_energy_high_J",
    "answer_joint_loss_factor",
    "answer_joint_loss_factor_low",
    "answer_joint_loss_factor_high",
    "answer_loss_factor",
    "answer_loss_factor_low",
    "answer_loss_factor_high",
    "structure",
    "peak_loss_factor",
    "amplitude_at_peak_m",
    "gross_slip_amplitude_m",
    "verdict",
)
COLUMNS = ("scan", "status", "error", "path", *RESULTS, "problems", "folder")
INDEX = {  # what the page shows, and how it is written
    "caps": "",
    "m": "",
    "n": "",
    "h_m": ".4g µm",
    "tangential_stiffness_N_per_m": ".4g MN/m",
    "answer_joint_loss_factor": ".3g %",
    "structure": "",
    "peak_loss_factor": ".3g %",
    "amplitude_at_peak_m": ".3g µm",
}
OWN = frozenset({"batch.csv", "index.html", "scans"})
ENDED = (
    "the process that analysed this scan was ended, also when it had the machine to itself (out "
    "of memory, or a crash in a library)"
)

Found = tuple[dict[str, Any] | None, str | None]  # summary and error of one scan


def analyse_scan(scan: Path, folder: Path, settings: Settings, command: str | None) -> Found:
    """Read, analyse and write one scan; what goes wrong is returned, not raised."""
    from capslip.analysis import analyze

    try:
        started_s = time.perf_counter()
        surface = load_surface(scan, **msgspec.structs.asdict(settings.reading))
        read_s = time.perf_counter() - started_s
        analysis = analyze(surface, settings)
        summary = write(analysis, folder, command=command, timings_s={"read": read_s})
    except Exception as error:
        return None, in_one_line(error)
    return summary, _error(summary)


def _error(summary: dict[str, Any]) -> str | None:
    """Return the problem that makes a result failed, or incomplete."""
    problems = summary["problems"]
    errors = [one["message"] for one in problems if one["severity"] == "error"]
    errors += [one["message"] for one in problems if one["code"] == "output_missing"]
    return errors[0] if errors else None


def run_batch(
    sources: Iterable[str],
    folder: Path,
    settings: Settings,
    say: Callable[[str], None],
    command: str | None = None,
    work: Callable[[Path, Path, Settings, str | None], Found] = analyse_scan,
) -> list[dict[str, Any]]:
    """Analyse every scan of the sources, in worker processes.

    Parameters
    ----------
    sources : iterable of str
        Files, folders (all files in them, hidden ones left out) and globs.
    folder : Path
        Receives `batch.csv`, `index.html` and one folder a scan under `scans/`. A scan whose result
        stands there already, from the same bytes, settings and version, with the pictures that
        are wanted, is not done again.
    settings : Settings
        For all scans.
    say : callable
        Told each finished scan.
    command : str, optional
        What was called, for the record.
    work : callable, optional
        Called in a worker with scan, folder, settings and command.

    Returns
    -------
    list of dict
        One row a scan, in the order of the names; a failed scan has status "failed" and its error;
        one with an error and another status lacks a part that no number depends on.

    Raises
    ------
    NothingToDoError
        If the sources hold no file.
    OutputError
        If the folder holds anything that no batch wrote.
    """
    scans = _find(sources)
    _check_folder(folder)
    (folder / "scans").mkdir(parents=True, exist_ok=True)
    places = dict(zip(scans, _names(scans), strict=True))
    workers = settings.run.workers or os.cpu_count() or 1
    rows: dict[Path, dict[str, Any]] = {}

    def note(scan: Path, found: Found) -> None:
        rows[scan] = _row(scan, places[scan], *found)
        _write_table([rows[one] for one in scans if one in rows], folder)
        outcome = rows[scan]["error"] or rows[scan]["status"]
        say(f"{len(rows)} of {len(scans)}: {places[scan]}: {outcome}")

    with ThreadPoolExecutor(workers) as pool:  # reading and hashing, which wait for the disk
        old = pool.map(lambda scan: _done(scan, folder / "scans" / places[scan], settings), scans)
        jobs = []
        for scan, summary in zip(scans, old, strict=True):
            if summary is None:
                jobs.append((scan, folder / "scans" / places[scan], settings, command))
            else:
                note(scan, (summary, _error(summary)))
    lost: Found = (None, ENDED)
    with closing(outcomes(work, jobs, workers, lost)) as found_later:
        for (scan, *_), found in found_later:
            note(scan, found)
    table = [rows[scan] for scan in scans]
    _write_index(table, folder)
    return table


def _find(sources: Iterable[str]) -> list[Path]:
    found: set[Path] = set()
    for source in sources:
        path = Path(source)
        if path.is_dir():
            found.update(entry for entry in path.iterdir() if entry.is_file())
        elif path.is_file():
            found.add(path)
        else:
            found.update(Path(hit) for hit in glob.glob(source, recursive=True))
    scans = sorted(path for path in found if path.is_file() and not path.name.startswith("."))
    if not scans:
        raise NothingToDoError(
            f"no scan found in {', '.join(sources)}; expected files, a folder with files, or a glob"
        )
    return scans


def _names(scans: list[Path]) -> list[str]:
    """One name a scan: the stem, or as much of the path as it takes to tell the scans apart."""
    names = [scan.stem for scan in scans]
    for longer in (lambda p: p.name, lambda p: f"{p.parent.name}_{p.name}"):
        names = [
            name if names.count(name) == 1 else longer(scan)
            for scan, name in zip(scans, names, strict=True)
        ]
    return [
        name if names.count(name) == 1 else f"{index:04d}_{name}"
        for index, name in enumerate(names, start=1)
    ]


def _check_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"output folder {folder}: is a file; choose another with --out")
    foreign = sorted({e.name for e in folder.iterdir()} - OWN) if folder.is_dir() else []
    if foreign:
        raise OutputError(
            f"output folder {folder}: holds {foreign[0]}, which no batch wrote; nothing was "
            "written; choose another with --out"
        )


def _done(scan: Path, folder: Path, settings: Settings) -> dict[str, Any] | None:
    """Return the summary of a finished result that would come out the same again."""
    summary = read_summary(folder)
    return summary if summary and _same(summary, folder, scan, settings) else None


def _same(summary: dict[str, Any], folder: Path, scan: Path, settings: Settings) -> bool:
    """Tell whether a result came from the same bytes, settings and version, with all pictures."""
    provenance = summary["provenance"]
    return (
        provenance["version"] == capslip.__version__
        and provenance["settings_sha256"] == settings.sha256()
        and summary["surface"]["sha256"] == sha256_of(scan)
        and not any(one["code"] == "output_missing" for one in summary["problems"])
        and _has_pictures(folder, settings)
    )


def _has_pictures(folder: Path, settings: Settings) -> bool:
    """Tell whether the pictures that are wanted now were wanted then, too."""
    try:
        then = load_settings(folder / "settings.toml").run
    except SettingsError:
        return False
    wanted = settings.run
    return (then.figures or not wanted.figures) and (then.render or not wanted.render)


def _row(
    scan: Path, place: str, summary: dict[str, Any] | None, error: str | None
) -> dict[str, Any]:
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row.update(scan=place, status="failed", error=error, path=str(scan))
    if summary is not None:
        row.update({name: value(summary, name) for name in RESULTS})
        problems = " ".join(problem["code"] for problem in summary["problems"])
        row.update(status=summary["status"], problems=problems, folder=f"scans/{place}")
    return row


def _write_table(rows: list[dict[str, Any]], folder: Path) -> None:
    partial = folder / ".batch.csv"
    with partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    os.replace(partial, folder / "batch.csv")


def _write_index(rows: list[dict[str, Any]], folder: Path) -> None:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("capslip", "output"), autoescape=True, trim_blocks=True
    )
    page = environment.get_template("index.html.j2").render(
        rows=rows,
        heads=[QUANTITIES[name].label for name in INDEX],
        cells=[[_cell(row, name) for name in INDEX] for row in rows],
    )
    (folder / "index.html").write_text(page, encoding="utf-8")


def _cell(row: dict[str, Any], name: str) -> str:
    return format(Value(row[name], QUANTITIES[name].unit, absent=""), INDEX[name])
