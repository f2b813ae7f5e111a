"""The numbers of a result on disk: `result.h5`, `caps.csv`, `settings.toml`, `summary.json`."""

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from capslip.caps.table import UNITS
from capslip.output.staging import SUMMARY, summary_text
from capslip.output.thumbnail import thumbnail
from capslip.output.zones import write_zones, zones_of

if TYPE_CHECKING:
    from capslip.contact.press import ContactState
    from capslip.result import Analysis
    from capslip.settings import Settings

LOADS, FORCES = 80, 96  # points of the normal curve and of the slip curve


def write_result(analysis: "Analysis", folder: Path) -> None:
    """Write `result.h5`, `caps.csv` and `settings.toml`."""
    _write_hdf5(analysis, folder / "result.h5")
    columns = analysis.caps.columns()
    with (folder / "caps.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(_cells(column) for column in columns.values()), strict=True))
    write_settings(analysis.settings, folder)


def write_settings(settings: "Settings", folder: Path) -> None:
    """Write `settings.toml`, every setting as used."""
    (folder / "settings.toml").write_text(tomli_w.dumps(settings.to_dict()), "utf-8")


def write_summary(summary: dict[str, Any], folder: Path) -> None:
    """Write `summary.json`: the last file of a result, and the sign that it is complete."""
    (folder / SUMMARY).write_bytes(summary_text(summary))


def _cells(column: np.ndarray) -> list[str]:
    """Text that reads back to the same number; an absent number is an empty cell."""
    if column.dtype.kind == "f":
        return ["" if np.isnan(value) else repr(float(value)) for value in column]
    return [str(value) for value in column]


def _loads_N(contact: "ContactState") -> np.ndarray:
    """Return the loads of the normal curve; where each costs a solution, those at hand."""
    if contact.rung.solved_loads_N is not None:
        return contact.rung.solved_loads_N(contact.normal, contact.preload_N)
    return contact.preload_N * np.append(0.0, np.geomspace(1e-3, 1.0, LOADS))


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
        stamp = np.frombuffer(thumbnail(surface.height_m), dtype=np.uint8)
        write("surface/thumbnail_png", stamp, "")
        write("hills/labels", analysis.hills.label, "", **packed)
        for name, column in analysis.caps.columns().items():
            values = column
            if column.dtype.kind in "UO":
                values = np.array([str(word) for word in column], dtype=h5py.string_dtype())
            write(f"caps/{name}", values, UNITS[name])
        if analysis.contact is not None:
            load_N = _loads_N(analysis.contact)
            approach_m = np.asarray(analysis.contact.normal.approach_m(load_N))
            write("normal/approach_m", approach_m, "m")
            write("normal/load_N", load_N, "N")
            zones = zones_of(analysis, load_N, approach_m)
            if zones is not None:
                write_zones(zones, file.create_group("zones"))
        slip = analysis.slip
        if slip is not None:
            force_N = np.geomspace(1e-3, 1.0, FORCES) * slip.total_slip_force_N
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
