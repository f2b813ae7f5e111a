"""The numbers of a result on disk: `result.h5`, `caps.csv`, `settings.toml`, `summary.json`."""

import csv
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from capslip.disk import hdf5_in_memory
from capslip.output.arrays import UNITS, Tables, table_of
from capslip.output.datasets import write_attribute, write_dataset
from capslip.output.staging import SUMMARY, summary_text
from capslip.output.thumbnail import thumbnail
from capslip.output.zones import hill_loads_N, write_zones, zones_of

if TYPE_CHECKING:
    from capslip.result import Analysis
    from capslip.settings import Settings


BLOCK = 1 << 20  # bytes by which a file in memory grows


def write_result(analysis: "Analysis", folder: Path) -> None:
    """Write `result.h5`, `caps.csv` and `settings.toml`."""
    columns = analysis.caps.columns()
    _write_hdf5(analysis, table_of(columns), folder / "result.h5")
    with (folder / "caps.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(_cells(column) for column in columns.values()), strict=True))
    write_settings(analysis.settings, folder)


def write_settings(settings: "Settings", folder: Path) -> None:
    """Write `settings.toml`, every setting as used."""
    (folder / "settings.toml").write_text(_toml(settings), "utf-8")


@lru_cache(4)
def _toml(settings: "Settings") -> str:
    """Return settings as text; those of a batch are the same for many scans."""
    return tomli_w.dumps(settings.to_dict())


def write_summary(summary: dict[str, Any], folder: Path) -> None:
    """Write `summary.json`: the last file of a result, and the sign that it is complete."""
    (folder / SUMMARY).write_bytes(summary_text(summary))


def _cells(column: np.ndarray) -> list[str]:
    """Text that reads back to the same number; an absent number is an empty cell."""
    if column.dtype.kind == "f":
        return ["" if value != value else repr(value) for value in column.tolist()]  # NaN
    return [str(value) for value in column]


def _write_hdf5(analysis: "Analysis", caps: np.ndarray, path: Path) -> None:
    from h5py import h5g

    surface = analysis.conditioned.surface
    with hdf5_in_memory(path, block_size=BLOCK) as file:
        packed = {"chunks": True, "compression": "gzip", "compression_opts": 1, "shuffle": True}
        of_surface, of_hills = (h5g.create(file.id, name) for name in (b"surface", b"hills"))
        # Not packed: noise hardly gets smaller, in fifteen times the time
        height_m = surface.height_m
        height = write_dataset(of_surface, "height_m", height_m.astype(np.float32), "m")
        write_attribute(height, "pixel_size_m", surface.pixel_size_m)
        write_attribute(height, "pixel_size", surface.pixel_size_m)
        write_attribute(height, "pixel_unit", "m")
        for name in ("noise_m", "noise_scans", "form_error_m"):
            if (known := getattr(surface, name)) is not None:
                write_attribute(height, name, known)
        second_m = analysis.conditioned.second_m
        if second_m is not None:
            second_m = second_m.astype(np.float32)
            write_dataset(of_surface, "second_height_m", second_m, "m")
        stamp = np.frombuffer(thumbnail(height_m), dtype=np.uint8)
        write_dataset(of_surface, "thumbnail_png", stamp, "")
        label = analysis.hills.label
        narrow = np.min_scalar_type(-int(label.max(initial=1)))  # packed in a third of the time
        write_dataset(of_hills, "labels", label.astype(narrow), "", **packed)
        found = Tables(analysis)
        normal = found.normal_curve
        stages = {"caps": caps, "normal": normal, "slip": found.slip}
        for stage, table in {**stages, "damping": found.damping}.items():
            if not len(table) and stage != "caps":
                continue  # no such stage; no caps are a table with all columns
            group = h5g.create(file.id, stage.encode())
            for name in table.dtype.names or ():
                write_dataset(group, name, table[name], UNITS[name])
        hill_N = hill_loads_N(analysis)
        if hill_N is not None:
            write_dataset(of_hills, "load_N", hill_N, "N")
        if analysis.contact is not None:
            zones = zones_of(analysis, normal["load_N"], normal["approach_m"])
            if zones is not None:
                write_zones(zones, h5g.create(file.id, b"zones"))
