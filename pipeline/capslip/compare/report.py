"""A comparison as JSON, as text for a terminal and as a folder."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from capslip.compare.comparison import Comparison
from capslip.disk import way_out, write_whole
from capslip.errors import OutputError
from capslip.output.quantity import engineering
from capslip.output.staging import SUMMARY, read_summary

SCHEMA = "capslip/compare/1"
OF_BATCH = ("batch.csv", "scans")  # stand together where results of many scans are


def to_dict(found: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON holds it: plain numbers, absent ones null."""
    identified = None
    if found.identified is not None and found.identified.missed is None:
        identified = {
            name: value if not isinstance(value, float) or math.isfinite(value) else None
            for name, value in asdict(found.identified).items()
        }
    return {
        "schema": SCHEMA,
        "friction_coefficient": found.friction_coefficient,
        "preload_N": found.preload_N,
        "resolved_from_m": found.resolved_from_m,
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


def check_place(folder: str | Path) -> None:
    """Refuse a folder in which a comparison would be a foreign file, in the way of an analysis.

    Raises
    ------
    OutputError
        If the folder, or one that it is in, is that of a result or of a batch.
    """
    place = Path(folder).resolve()
    for one in (place, *place.parents):
        of_batch = all((one / name).exists() for name in OF_BATCH)
        if of_batch or read_summary(one) is not None:
            holds = "results of a batch" if of_batch else f"a result ({SUMMARY})"
            raise OutputError(
                f"output folder {folder}: {one} holds {holds}, which no analysis could replace any "
                "more; nothing was written; choose one beside it with --out"
            )


def write_comparison(found: Comparison, folder: str | Path) -> None:
    """Write `compare.json` and `compare.png`; raises OutputError where that is impossible."""
    from capslip.compare.figure import comparison

    check_place(folder)
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / "compare.png", comparison(found).savefig)
        text = json.dumps(to_dict(found), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        write_whole(folder / "compare.json", lambda path: path.write_text(text, encoding="utf-8"))
    except OSError as error:
        step = way_out(error, "choose another with --out")
        raise OutputError(f"output folder {folder}: {error.strerror}; {step}") from error


def lines(found: Comparison) -> list[str]:
    """Return the comparison as lines of text for a terminal."""
    unit, per_m = found.amplitude_unit
    least, greatest = (per_m * float(found.amplitude_m[i]) for i in (0, -1))
    text = [
        f"compared   {found.amplitude_m.size} amplitudes from {least:.4g} to {greatest:.4g} "
        f"{unit}, model with mu {found.friction_coefficient:g} and "
        f"{engineering(found.preload_N, 'N', 5)}"
    ]
    for band in found.bands:
        head = (
            f"misfit     {band.name:6} {band.least_amplitude_m * per_m:.4g} to "
            f"{band.greatest_amplitude_m * per_m:.4g} {unit}: "
        )
        if band.rms_log_ratio is None or band.bias_log_ratio is None:
            text.append(f"{head}no points")
        else:
            text.append(
                f"{head}{band.points} points, model / measured {math.exp(band.bias_log_ratio):.3g} "
                f"on average, rms ln ratio {band.rms_log_ratio:.3g}"
            )
    one = found.identified
    if one is not None and one.missed is None:
        text.append(
            f"identified mu {one.friction_coefficient:.4g} +- "
            f"{100 * one.friction_coefficient_log_std:.2g} %, preload {one.preload_N:.5g} N +- "
            f"{100 * one.preload_log_std:.2g} %, correlation {one.correlation:.3f}, "
            f"rms ln ratio {one.rms_log_ratio:.3g}"
        )
    elif one is not None:
        text.append(
            "identified nothing: the model misses the points, whatever friction and preload"
        )
    return [*text, *(f"remark     {remark}" for remark in found.remarks)]
