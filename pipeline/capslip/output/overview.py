"""The results of many scans on one page and in one table."""

import csv
import io
from contextlib import suppress
from pathlib import Path
from typing import Any

from capslip.errors import printable
from capslip.output.rows import QUANTITIES, Value, value
from capslip.output.staging import write_file

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
COLUMNS = ("scan", "status", "error", "path", "group", *RESULTS, "problems", "folder")
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
FORMULA = tuple("=+-@\t\r")  # what a spreadsheet would compute begins with one of these

Row = dict[str, Any]


def row_of(summary: dict[str, Any]) -> Row:
    """Return the row of a result; who knows the scan adds its name and place."""
    row: Row = dict.fromkeys(COLUMNS)
    row.update({name: value(summary, name) for name in RESULTS})
    row.update(status=summary["status"], error=error_of(summary))
    row["problems"] = " ".join(problem["code"] for problem in summary["problems"])
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
    write_file(folder / "index.html", _page(rows).encode())
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


def _page(rows: list[Row]) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("capslip", "output"), autoescape=True, trim_blocks=True
    )
    return environment.get_template("index.html.j2").render(
        rows=rows,
        heads=[QUANTITIES[name].label for name in INDEX],
        cells=[[_cell(row, name) for name in INDEX] for row in rows],
    )


def _cell(row: Row, name: str) -> str:
    return format(Value(row[name], QUANTITIES[name].unit, absent=""), INDEX[name])
