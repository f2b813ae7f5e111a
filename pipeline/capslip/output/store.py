"""Results on disk: tables, settings and the summary, written whole or not at all."""

import csv
import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.caps.table import UNITS
from capslip.errors import OutputError
from capslip.result import SCHEMA

if TYPE_CHECKING:
    from capslip.contact.press import ContactState
    from capslip.result import Analysis

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


def check_folder(folder: Path, keep: Iterable[Path | None] = ()) -> None:
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
        if path is not None and folder.resolve() in path.resolve().parents:
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


def write_result(analysis: "Analysis", folder: Path) -> None:
    """Write `result.h5`, `caps.csv` and `settings.toml`."""
    import tomli_w

    _write_hdf5(analysis, folder / "result.h5")
    columns = analysis.caps.columns()
    with (folder / "caps.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(_cells(column) for column in columns.values()), strict=True))
    (folder / "settings.toml").write_text(tomli_w.dumps(analysis.settings.to_dict()), "utf-8")


def write_summary(summary: dict[str, Any], folder: Path) -> None:
    """Write `summary.json`: the last file of a result, and the sign that it is complete."""
    text = json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    (folder / "summary.json").write_text(text, encoding="utf-8")


def _cells(column: np.ndarray) -> list[str]:
    """Text that reads back to the same number; an absent number is an empty cell."""
    if column.dtype.kind == "f":
        return ["" if np.isnan(value) else repr(float(value)) for value in column]
    return [str(value) for value in column]


def _loads_N(contact: "ContactState") -> np.ndarray:
    """Return the loads of the normal curve; for boundary elements those that are solved already."""
    from capslip.contact.models.boundary_elements import BoundaryElementCurve

    if isinstance(contact.normal, BoundaryElementCurve):
        return contact.normal.solved_loads_N(contact.preload_N)
    return contact.preload_N * np.append(0.0, np.geomspace(1e-3, 1.0, 80))


def _write_hdf5(analysis: "Analysis", path: Path) -> None:
    import h5py

    surface = analysis.conditioned.surface
    with h5py.File(path, "w") as file:

        def write(name: str, values: Any, unit: str, **options: Any) -> Any:
            dataset = file.create_dataset(name, data=values, **options)
            dataset.attrs["unit"] = unit
            return dataset

        packed = {"chunks": True, "compression": "gzip", "compression_opts": 1, "shuffle": True}
        height = write("surface/height_m", surface.height_m.astype(np.float32), "m", **packed)
        height.attrs["pixel_size_m"] = surface.pixel_size_m
        height.attrs["pixel_size"] = surface.pixel_size_m
        height.attrs["pixel_unit"] = "m"
        write("hills/labels", analysis.hills.label, "", **packed)
        for name, column in analysis.caps.columns().items():
            values = column
            if column.dtype.kind in "UO":
                values = np.array([str(word) for word in column], dtype=h5py.string_dtype())
            write(f"caps/{name}", values, UNITS[name])
        if analysis.contact is not None:
            load_N = _loads_N(analysis.contact)
            write("normal/approach_m", analysis.contact.normal.approach_m(load_N), "m")
            write("normal/load_N", load_N, "N")
        slip = analysis.slip
        if slip is not None:
            force_N = np.geomspace(1e-3, 1.0, 96) * slip.total_slip_force_N
            write("slip/force_N", force_N, "N")
            write("slip/displacement_m", slip.displacement_m(force_N), "m")
            write("slip/energy_J", slip.energy_at_force_J(force_N), "J")
        damping = analysis.damping
        if damping is not None:
            write("damping/amplitude_m", damping.amplitude_m, "m")
            write("damping/force_N", damping.force_N, "N")
            write("damping/loss_factor", damping.loss_factor, "1")
            write("damping/damping_ratio", damping.damping_ratio, "1")
            write("damping/frequency_ratio", damping.frequency_ratio, "1")
