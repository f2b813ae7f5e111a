"""Many scans: one process and one folder a scan, one row a scan, no scan the end of the rest."""

import csv
import glob
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import tomli_w

import capslip
from capslip.errors import NothingToDoError, OutputError, SettingsError
from capslip.output import store
from capslip.settings import Settings, load_settings
from capslip.surface.readers import sha256_of

COLUMNS = (
    "scan",
    "status",
    "error",
    "path",
    "caps",
    "m",
    "n",
    "h_m",
    "radius_G_m",
    "radius_P_m",
    "model",
    "preload_N",
    "approach_m",
    "contacts",
    "tangential_stiffness_N_per_m",
    "peak_loss_factor",
    "amplitude_at_peak_m",
    "gross_slip_amplitude_m",
    "problems",
    "folder",
)
OWN = frozenset({"batch.csv", "index.html", "scans"})


def run_batch(
    sources: Iterable[str],
    folder: Path,
    settings: Settings,
    say: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Analyse every scan of the sources, each in a process of its own.

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
    rows: dict[Path, dict[str, Any]] = {}
    workers = settings.run.workers or os.cpu_count() or 1
    with tempfile.TemporaryDirectory() as temporary:
        config = Path(temporary) / "settings.toml"
        config.write_text(tomli_w.dumps(settings.to_dict()), encoding="utf-8")
        with ThreadPoolExecutor(workers) as pool:
            futures = {
                pool.submit(_one, scan, folder / "scans" / place, config, settings): scan
                for scan, place in places.items()
            }
            try:
                for done in as_completed(futures):
                    scan = futures[done]
                    rows[scan] = {**done.result(), "scan": places[scan]}
                    _write_table([rows[s] for s in scans if s in rows], folder)
                    outcome = rows[scan]["error"] or rows[scan]["status"]
                    say(f"{len(rows)} of {len(scans)}: {places[scan]}: {outcome}")
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
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


def _one(scan: Path, folder: Path, config: Path, settings: Settings) -> dict[str, Any]:
    """Analyse one scan in a process of its own, so that nothing it does can harm another."""
    summary = store.read_summary(folder)
    if summary is None or not _same(summary, folder, scan, settings):
        command = [sys.executable, "-m", "capslip", "analyze", str(scan), "--json", "--quiet"]
        process = subprocess.run(
            [*command, "--config", str(config), "--out", str(folder)],
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            check=False,
        )
        error = _last_line(process) if process.returncode != 0 else None
        if not process.stdout:
            return _row(scan, folder, None, error)
        # A failed analysis leaves what it found before, and says so with its exit code.
        return _row(scan, folder, json.loads(process.stdout), error)
    errors = [one["message"] for one in summary["problems"] if one["severity"] == "error"]
    return _row(scan, folder, summary, errors[0] if errors else None)


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


def _last_line(process: subprocess.CompletedProcess[str]) -> str:
    lines = [line for line in process.stderr.splitlines() if line.startswith("error: ")]
    if lines:
        return lines[-1].removeprefix("error: ")
    if process.returncode < 0:
        return f"the process was ended by signal {-process.returncode} (out of memory?)"
    return f"exit code {process.returncode}"


def _row(
    scan: Path, folder: Path, summary: dict[str, Any] | None, error: str | None
) -> dict[str, Any]:
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row.update(status="failed", error=error, path=str(scan))
    if summary is None:
        return row
    families, contact = summary["families"], summary["contact"]
    slip, damping = summary["slip"], summary["damping"]
    row.update(
        status=summary["status"],
        caps=summary["hills"]["caps"],
        m=families["m"],
        n=families["n"],
        h_m=families["h_m"],
        radius_G_m=(families["G"] or {}).get("radius_m"),
        radius_P_m=(families["P"] or {}).get("radius_m"),
        model=contact["model"],
        preload_N=contact["preload_N"],
        approach_m=contact["approach_m"],
        contacts=contact["contacts"],
        tangential_stiffness_N_per_m=slip["tangential_stiffness_N_per_m"],
        peak_loss_factor=damping["peak_loss_factor"],
        amplitude_at_peak_m=damping["amplitude_at_peak_m"],
        gross_slip_amplitude_m=damping["gross_slip_amplitude_m"],
        problems=" ".join(problem["code"] for problem in summary["problems"]),
        folder=f"scans/{folder.name}",
    )
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
    page = environment.get_template("index.html.j2").render(rows=rows)
    (folder / "index.html").write_text(page, encoding="utf-8")
