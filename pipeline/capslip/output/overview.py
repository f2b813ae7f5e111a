"""The results of many scans on one page and in one table."""

import base64
import csv
import io
import json
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from capslip.errors import printable
from capslip.output.lead import causes, moved_by
from capslip.output.rows import QUANTITIES, SCALES, value
from capslip.output.staging import write_file
from capslip.problems import KINDS
from capslip.structure.response import MOST_LOSS_FACTOR

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
    "first_loading_approach_m",
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
    "answer_total_loss_factor",
    "structure",
    "peak_loss_factor",
    "amplitude_at_peak_m",
    "gross_slip_amplitude_m",
    "verdict",
)
COLUMNS = ("scan", "status", "error", "path", "mate", "group", *RESULTS, "problems", "folder")
INDEX = {  # what the page shows, and its unit there
    "caps": "",
    "m": "",
    "n": "",
    "preload_N": "",
    "tangential_stiffness_N_per_m": "MN/m",
    "answer_energy_J": "nJ",
    "answer_joint_loss_factor": "",
    "answer_loss_factor": "",
    "gross_slip_amplitude_m": "µm",
}
COUNTS = ("caps", "m", "n")  # written whole, however many
SPREAD = (  # whose distributions the page shows
    "tangential_stiffness_N_per_m",
    "answer_energy_J",
    "answer_joint_loss_factor",
    "caps",
)
CURVES = {  # x and y, the unit of either, what they are called, up to where y is defined
    "damping": (
        *("amplitude_m", "loss_factor", "m", "", "loss factor of the structure"),
        *("the amplitude of the structure", MOST_LOSS_FACTOR),
    ),
    "slip": (
        *("force_N", "energy_J", "N", "J", "energy lost per cycle"),
        *("the tangential force on a joint", None),
    ),
}
POINTS = 24  # of a curve
FORMULA = tuple("=+-@\t\r")  # what a spreadsheet would compute begins with one of these

Row = dict[str, Any]


def row_of(summary: dict[str, Any]) -> Row:
    """Return the row of a result; who knows the scan adds its name and place.

    Beside the columns it has `causes`: severity, code and what is moved of at most three problems.
    """
    row: Row = dict.fromkeys(COLUMNS)
    row.update({name: value(summary, name) for name in RESULTS})
    row.update(status=summary["status"], error=error_of(summary))
    row["problems"] = " ".join(problem["code"] for problem in summary["problems"])
    row["causes"] = [[one["severity"], one["code"], moved_by(one)] for one in causes(summary)]
    return row


def error_of(summary: dict[str, Any]) -> str | None:
    """Return the problem that makes a result failed, or incomplete."""
    problems = summary["problems"]
    errors = [one["message"] for one in problems if one["severity"] == "error"]
    errors += [one["message"] for one in problems if one["code"] == "output_missing"]
    return printable(errors[0]) if errors else None


def write_table(rows: list[Row], folder: Path) -> None:
    """Write `batch.csv`, in SI units; text that a spreadsheet would compute gets an apostrophe."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows([_text(row[name]) for name in COLUMNS] for row in rows)
    write_file(folder / "batch.csv", text.getvalue().encode())


def write_overview(rows: list[Row], folder: Path) -> None:
    """Write table and page, and `batch.parquet` where pyarrow is installed."""
    write_table(rows, folder)
    write_file(folder / "index.html", _page(rows, folder).encode())
    with suppress(ImportError):
        import pyarrow
        from pyarrow import parquet

        columns = {name: [_plain(row[name]) for row in rows] for name in COLUMNS}
        sink = pyarrow.BufferOutputStream()
        parquet.write_table(pyarrow.table(columns), sink)
        write_file(folder / "batch.parquet", sink.getvalue().to_pybytes())


def _plain(cell: Any) -> Any:
    return printable(cell) if isinstance(cell, str) else cell


def _text(cell: Any) -> Any:
    """Return a cell as it is written: a number as it is, text so that it stays text.

    Examples
    --------
    >>> [_text(cell) for cell in (-1.5, "-1.5", "=cmd()", "a.h5", None)]
    [-1.5, "'-1.5", "'=cmd()", 'a.h5', None]
    """
    if not isinstance(cell, str):
        return cell
    return f"'{printable(cell)}" if cell.startswith(FORMULA) else printable(cell)


def _page(rows: list[Row], folder: Path) -> str:
    """Return the page; a script of its own writes the rows that are looked at."""
    import jinja2

    package = files("capslip.output")
    style, of_reports, script = (
        package.joinpath(name).read_text("utf-8")
        for name in ("overview.css", "report.css", "overview.js")
    )
    codes = sorted({cause[1] for row in rows for cause in row.get("causes") or ()})
    data = {
        "columns": [
            [
                QUANTITIES[name].label,
                _unit(name),
                SCALES.get(unit, 1.0),
                name in SPREAD,
                name in COUNTS,
            ]
            for name, unit in INDEX.items()
        ],
        "curves": [told for _, _, *told in CURVES.values()],
        "effects": {code: KINDS[code].effect for code in codes},
        "rows": [_seen(row, folder) for row in rows],
    }
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("capslip", "output"), autoescape=True, trim_blocks=True
    )
    return environment.get_template("index.html.j2").render(
        count=len(rows),
        style=of_reports + style,
        script=script,
        data=json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
    )


def _unit(name: str) -> str:
    return INDEX[name] or QUANTITIES[name].unit


def _seen(row: Row, folder: Path) -> list[Any]:
    """Return what the page knows of a scan, short: there are thousands of them."""
    curves, stamp = _pictured(folder / row["folder"] / "result.h5") if row["folder"] else ([], "")
    numbers = [
        row[name] if row[name] is None or name in COUNTS else float(f"{row[name]:.6g}")
        for name in INDEX
    ]
    texts = [printable(str(row[name] or "")) for name in ("scan", "group", "error")]
    return [
        row["status"],
        *texts,
        _link(row, folder),
        numbers,
        row.get("causes") or [],
        curves,
        stamp,
    ]


def _link(row: Row, folder: Path) -> str:
    """Return where a row leads: to the report of its scan, or to the folder that has none."""
    home = row["folder"] or ""
    page = f"{home}/report.html"
    return printable(page if home and (folder / page).is_file() else home)


def _pictured(path: Path) -> tuple[list[list[int]], str]:
    """Return curves (thousandths of decades, x then y) and the stamp of a result; less if lost."""
    import h5py

    curves: list[list[int]] = [[] for _ in CURVES]
    try:
        with h5py.File(path) as file:
            for at, (group, (x, y, *_)) in enumerate(CURVES.items()):
                if group in file:
                    curves[at] = _thousandths(file[f"{group}/{x}"][:], file[f"{group}/{y}"][:])
            stamp = file["surface/thumbnail_png"][:].tobytes()
    except (OSError, KeyError):
        return curves, ""
    return curves, base64.b64encode(stamp).decode()


def _thousandths(x: np.ndarray, y: np.ndarray) -> list[int]:
    """Return a curve as whole thousandths of decades, all x and then all y.

    Examples
    --------
    >>> _thousandths(np.array([0.0, 1e-6, 1e-5]), np.array([0.0, 0.02, np.nan]))
    [-6000, -1699]
    """
    known = np.isfinite(x) & np.isfinite(y) & (x > 0.0) & (y > 0.0)
    x, y = x[known], y[known]
    at = np.unique(np.linspace(0, len(x) - 1, min(POINTS, len(x))).round().astype(int))
    both = np.rint(1000.0 * np.log10(np.concatenate([x[at], y[at]])))
    return [int(value) for value in both]
