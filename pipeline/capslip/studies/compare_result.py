"""A finished result against measured curves: reading, comparing, writing."""

import csv
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from capslip.caps.families import group_families
from capslip.caps.table import CapFlag, CapTable
from capslip.contact.curve import NormalCurve
from capslip.contact.material import composite
from capslip.contact.press import press
from capslip.errors import OutputError, UnreadableFileError
from capslip.output.store import read_summary
from capslip.settings import Settings, load_settings
from capslip.structure.compare import Comparison, JointModel, Measurement, compare
from capslip.structure.stiffness import stiffnesses
from capslip.surface.heightmap import HeightMap

SCHEMA = "capslip/compare/1"
AMPLITUDES = {"amplitude_m": 1.0, "amplitude_mm": 1e-3, "amplitude_um": 1e-6, "amplitude_nm": 1e-9}
LOSSES = {  # each as a loss factor: eta = 2 xi
    "loss_factor": 1.0,
    "loss_factor_percent": 1e-2,
    "damping_ratio": 2.0,
    "damping_ratio_percent": 2e-2,
}
GREATEST_AMPLITUDE_M = 0.1
GREATEST_LOSS_FACTOR = 1.0


def compare_result(
    result: str | Path,
    assembly: str | Path,
    monolithic: str | Path | None = None,
    identify: bool = False,
) -> Comparison:
    """Compare a folder that `analyze` left with a measured curve.

    Parameters
    ----------
    result : path
        Folder with `settings.toml`, `summary.json` and `result.h5`.
    assembly, monolithic : path
        CSV files of two columns, see `load_measurement`.
    identify : bool
        Also fit friction coefficient and preload.

    Raises
    ------
    UnreadableFileError
        If a file is missing or damaged, or the result holds no joint.
    SettingsError
        If too few points are left to identify anything.
    """
    measured = load_measurement(assembly)
    intrinsic = load_measurement(monolithic, distinct=True) if monolithic is not None else None
    model, settings = load_model(result)
    return compare(
        measured,
        model,
        settings.material.friction_coefficient,
        settings.contact.preload_N,
        intrinsic,
        identify,
    )


def load_measurement(path: str | Path, distinct: bool = False) -> Measurement:
    """Read a damping curve: a header of two names with units, then one line an amplitude.

    Parameters
    ----------
    path : path
        CSV, separated by commas. One column is `amplitude_m`, `amplitude_mm`, `amplitude_um` or
        `amplitude_nm`; the other `loss_factor`, `damping_ratio`, or one of them in per cent
        (`loss_factor_percent`). The amplitude is that of the displacement at mid-span.
    distinct : bool
        Refuse an amplitude that stands twice, as a curve to be interpolated must.

    Raises
    ------
    UnreadableFileError
        If a name or a value is not what it must be; the message names file, line and column.
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, strict=True)
            lines = [(reader.line_num, row) for row in reader if row]
    except OSError as error:
        raise UnreadableFileError(f"{path}: {error.strerror}; give a CSV file") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise UnreadableFileError(f"{path}: not a CSV file in UTF-8: {error}") from error
    if not lines:
        raise UnreadableFileError(
            f"{path}: is empty; expected a header such as amplitude_um,loss_factor and values"
        )
    header = [name.strip() for name in lines[0][1]]
    factors = _factors(path, lines[0][0], header)
    rows = [_row(path, line, header, cells) for line, cells in lines[1:]]
    if len(rows) < 2:
        raise UnreadableFileError(f"{path}: {len(rows)} lines of values; expected at least 2")
    values = np.array(rows) * factors
    kinds = [name in AMPLITUDES for name in header]
    amplitude_m, loss_factor = values[:, kinds.index(True)], values[:, kinds.index(False)]
    for column, array, most, unit, advice in (
        (header[kinds.index(True)], amplitude_m, GREATEST_AMPLITUDE_M, " m", "check its unit"),
        (
            header[kinds.index(False)],
            loss_factor,
            GREATEST_LOSS_FACTOR,
            " as a loss factor",
            "if the values are per cent, name the column so (loss_factor_percent)",
        ),
    ):
        high = np.flatnonzero(array > most)
        if high.size:
            raise UnreadableFileError(
                f"{path}, line {lines[1 + high[0]][0]}, column {column}: got {array[high[0]]:g}"
                f"{unit}; expected at most {most:g}; {advice}"
            )
    if distinct:
        order = np.argsort(amplitude_m, kind="stable")
        again = np.flatnonzero(np.diff(amplitude_m[order]) == 0)
        if again.size:
            line = lines[1 + order[again[0] + 1]][0]
            raise UnreadableFileError(
                f"{path}, line {line}, column {header[kinds.index(True)]}: an amplitude that "
                "stands twice; expected one value an amplitude, to interpolate between them"
            )
    return Measurement(amplitude_m, loss_factor)


def _factors(path: Path, line: int, header: list[str]) -> np.ndarray:
    """Return what brings each column to m or to a loss factor."""
    known = AMPLITUDES | LOSSES
    for i, name in enumerate(header, 1):
        if name not in known:
            raise UnreadableFileError(
                f"{path}, line {line}, column {i}: unknown name {name!r}; expected one of "
                f"{', '.join(AMPLITUDES)} and one of {', '.join(LOSSES)}"
            )
    if len(header) != 2 or sum(name in AMPLITUDES for name in header) != 1:
        raise UnreadableFileError(
            f"{path}, line {line}: got the columns {', '.join(header)}; expected one amplitude and "
            "one loss factor or damping ratio"
        )
    return np.array([known[name] for name in header])


def _row(path: Path, line: int, header: list[str], cells: list[str]) -> list[float]:
    if len(cells) != 2:
        raise UnreadableFileError(
            f"{path}, line {line}: got {len(cells)} values; expected 2, separated by a comma, "
            "with a point in decimal numbers"
        )
    values = []
    for name, cell in zip(header, cells, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not 0 < value < math.inf:
            raise UnreadableFileError(
                f"{path}, line {line}, column {name}: got {cell.strip()!r}; expected a finite "
                "number > 0; leave the line out if nothing was measured"
            )
        values.append(value)
    return values


def load_model(result: str | Path) -> tuple[JointModel, Settings]:
    """Build the model of a result's joints from its table of caps and its settings."""
    import h5py

    folder = Path(result)
    summary = read_summary(folder)
    if summary is None:
        raise UnreadableFileError(
            f"{folder}: holds no finished result; expected a folder that capslip analyze wrote"
        )
    if summary["contact"]["model"] is None:
        raise UnreadableFileError(
            f"{folder}: this analysis found no joint to compare (see its problems)"
        )
    settings = load_settings(folder / "settings.toml")
    try:
        with h5py.File(folder / "result.h5") as file:
            columns = {name: dataset[()] for name, dataset in file["caps"].items()}
            height = file["surface/height_m"]
            surface = HeightMap(height[()], tuple(height.attrs["pixel_size_m"]))
    except (OSError, KeyError) as error:
        raise UnreadableFileError(
            f"{folder / 'result.h5'}: cannot be read ({error}); run the analysis again"
        ) from error
    columns["family"] = columns["family"].astype(str)
    columns["flags"] = np.array(
        [sum(CapFlag[word] for word in words.decode().split()) for words in columns["flags"]],
        dtype=np.uint16,
    )
    caps, families = group_families(CapTable(**columns), settings.families.count)

    def curve(preload_N: float) -> NormalCurve:
        contact = msgspec.structs.replace(settings.contact, preload_N=preload_N)
        changed = msgspec.structs.replace(settings, contact=contact)
        return press(caps, families, surface, changed)[0].curve

    _, modal, joint = stiffnesses(settings)
    material = settings.material
    kappa = composite(material.youngs_modulus_Pa, material.poisson_ratio).kappa
    return JointModel(curve, kappa, modal, joint, settings.structure.joints), settings


def to_dict(found: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON holds it: plain numbers, absent ones null."""
    identified = None
    if found.identified is not None:
        identified = {
            name: value if not isinstance(value, float) or math.isfinite(value) else None
            for name, value in asdict(found.identified).items()
        }
    return {
        "schema": SCHEMA,
        "friction_coefficient": found.friction_coefficient,
        "preload_N": found.preload_N,
        "points": {
            "amplitude_m": found.amplitude_m.tolist(),
            "measured_loss_factor": found.measured_loss_factor.tolist(),
            "intrinsic_loss_factor": _with_null(found.intrinsic_loss_factor),
            "joint_loss_factor": _with_null(found.joint_loss_factor),
            "joint_energy_J": _with_null(found.joint_energy_J),
            "model_loss_factor": _with_null(found.model_loss_factor),
        },
        "bands": [asdict(band) for band in found.bands],
        "identified": identified,
        "remarks": list(found.remarks),
    }


def _with_null(values: np.ndarray) -> list[float | None]:
    return [float(value) if math.isfinite(value) else None for value in values]


def write_comparison(found: Comparison, folder: str | Path) -> None:
    """Write `compare.json` and `compare.png`; raises OutputError where that is impossible."""
    from capslip.output.figures_compare import comparison

    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        comparison(found).savefig(folder / "compare.png")
        text = json.dumps(to_dict(found), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        (folder / "compare.json").write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(
            f"output folder {folder}: {error.strerror}; choose another with --out"
        ) from error


def lines(found: Comparison) -> list[str]:
    """Return the comparison as lines of text for a terminal."""
    um = 1e6
    text = [
        f"compared   {found.amplitude_m.size} amplitudes from {found.amplitude_m[0] * um:.4g} to "
        f"{found.amplitude_m[-1] * um:.4g} um, model with mu {found.friction_coefficient:g} and "
        f"{found.preload_N:g} N"
    ]
    for band in found.bands:
        head = (
            f"misfit     {band.name:6} {band.least_amplitude_m * um:.4g} to "
            f"{band.greatest_amplitude_m * um:.4g} um: "
        )
        if band.rms_log_ratio is None or band.bias_log_ratio is None:
            text.append(f"{head}no points")
        else:
            text.append(
                f"{head}{band.points} points, model / measured {math.exp(band.bias_log_ratio):.3g} "
                f"on average, rms ln ratio {band.rms_log_ratio:.3g}"
            )
    one = found.identified
    if one is not None:
        text.append(
            f"identified mu {one.friction_coefficient:.4g} +- "
            f"{100 * one.friction_coefficient_log_std:.2g} %, preload {one.preload_N:.5g} N +- "
            f"{100 * one.preload_log_std:.2g} %, correlation {one.correlation:.3f}, "
            f"rms ln ratio {one.rms_log_ratio:.3g}"
        )
    return [*text, *(f"remark     {remark}" for remark in found.remarks)]
