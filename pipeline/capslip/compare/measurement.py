"""Measured damping: its CSV file, and the share of the joints in it."""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capslip.errors import SettingsError, UnreadableFileError

AMPLITUDES = {"amplitude_m": 1.0, "amplitude_mm": 1e-3, "amplitude_um": 1e-6, "amplitude_nm": 1e-9}
LOSSES = {  # each as a loss factor: eta = 2 xi
    "loss_factor": 1.0,
    "loss_factor_percent": 1e-2,
    "damping_ratio": 2.0,
    "damping_ratio_percent": 2e-2,
}
GREATEST_AMPLITUDE_M = 0.1
GREATEST_LOSS_FACTOR = 1.0


@dataclass(frozen=True, eq=False)
class Measurement:
    """Loss factor of one structure over its amplitude; arrays of one shape (n,)."""

    amplitude_m: np.ndarray  # at mid-span, as a sensor sees it
    loss_factor: np.ndarray

    def __post_init__(self) -> None:
        amplitude_m = np.asarray(self.amplitude_m, dtype=float)
        loss_factor = np.asarray(self.loss_factor, dtype=float)
        if amplitude_m.ndim != 1 or amplitude_m.shape != loss_factor.shape or not amplitude_m.size:
            raise SettingsError(
                f"measurement: {amplitude_m.shape} amplitudes and {loss_factor.shape} loss factors;"
                " expected one loss factor an amplitude, and at least one"
            )
        for name, values in (("amplitude_m", amplitude_m), ("loss_factor", loss_factor)):
            bad = values[~((values > 0) & (values < np.inf))]
            if bad.size:
                raise SettingsError(
                    f"measurement: {name}: got {bad[0]:g}; expected finite numbers > 0"
                )
        order = np.argsort(amplitude_m, kind="stable")
        object.__setattr__(self, "amplitude_m", amplitude_m[order])
        object.__setattr__(self, "loss_factor", loss_factor[order])

    def at(self, amplitude_m: np.ndarray) -> np.ndarray:
        """Interpolate the loss factor over ln v, shape (k,); NaN outside the range measured."""
        return np.interp(
            np.log(amplitude_m),
            np.log(self.amplitude_m),
            self.loss_factor,
            left=np.nan,
            right=np.nan,
        )


def joint_share(
    assembly: Measurement, monolithic: Measurement | None
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Take the loss that is not that of the joints out of a measurement.

    The losses are subtracted as energies, at the same amplitude and so at the same stored energy U
    (Eqs. 20 to 22)::

        W_d2(v) = W_assembly(v) - W_monolithic(v),  W = 2 pi U eta

    which supposes that both structures have the same K_m and lose as much elsewhere. The monolithic
    curve is interpolated over ln v inside its range and never extrapolated: a point outside has no
    share of the joints.

    Parameters
    ----------
    assembly : Measurement
        The structure with its joints, (n,) amplitudes.
    monolithic : Measurement, optional
        The structure without them. Where absent all loss is taken for that of the joints.

    Returns
    -------
    ndarray, ndarray, list of str
        Loss factor (n,) of the monolithic structure, NaN outside its range, 0 where it is not
        given; that of the joints (n,), NaN where it cannot be told; what was left out and why.

    Notes
    -----
    Peyret, Chevallier and Dion, Int. J. Appl. Mech. 8 (2016) 1650097, Sec. 4.
    """
    points = assembly.amplitude_m.size
    if monolithic is None:
        remark = "no monolithic beam was given: all loss is taken for that of the joints"
        return np.zeros(points), assembly.loss_factor, [remark]
    intrinsic = monolithic.at(assembly.amplitude_m)
    joint = assembly.loss_factor - intrinsic
    remarks = []
    outside = int(np.isnan(joint).sum())
    if outside:
        remarks.append(
            f"{outside} of {points} points lie outside the amplitudes of the monolithic beam and "
            "were left out: its curve is not extrapolated"
        )
    lossless = joint <= 0
    if lossless.any():
        remarks.append(
            f"{int(lossless.sum())} of {points} points lose no more than the monolithic beam and "
            "were left out; what is left may be biased upwards"
        )
    return intrinsic, np.where(lossless, np.nan, joint), remarks


def load_measurement(path: str | Path, distinct: bool = False) -> Measurement:
    """Read a damping curve: a header of two names with units, then one line an amplitude.

    Parameters
    ----------
    path : path
        CSV, separated by commas. One column is `amplitude_m`, `amplitude_mm`, `amplitude_um` or
        `amplitude_nm`; the other `loss_factor`, `damping_ratio`, or one of them in per cent
        (`loss_factor_percent`). The amplitude is that of the displacement at mid-span. Lines that
        begin with # are remarks.
    distinct : bool
        Refuse an amplitude that stands twice, as a curve to be interpolated must.

    Raises
    ------
    UnreadableFileError
        If a name or a value is not what it must be; the message names file, line and column.
    """
    path = Path(path)
    lines = _lines(path)
    header = [name.strip() for name in lines[0][1]]
    factors = _factors(path, lines[0][0], header)
    rows = [_row(path, line, header, cells) for line, cells in lines[1:]]
    if len(rows) < 2:
        raise UnreadableFileError(f"{path}: {len(rows)} lines of values; expected at least 2")
    values = np.array(rows) * factors
    numbers = [line for line, _ in lines[1:]]
    amplitude_column = [name in AMPLITUDES for name in header].index(True)
    loss_column = 1 - amplitude_column
    amplitude_m, loss_factor = values[:, amplitude_column], values[:, loss_column]
    amplitude_name, loss_name = header[amplitude_column], header[loss_column]
    for name, array, most, unit, advice in (
        (amplitude_name, amplitude_m, GREATEST_AMPLITUDE_M, " m", "check its unit"),
        (
            loss_name,
            loss_factor,
            GREATEST_LOSS_FACTOR,
            " as a loss factor",
            "if the values are per cent, name the column so (loss_factor_percent)",
        ),
    ):
        high = np.flatnonzero(array > most)
        if high.size:
            raise UnreadableFileError(
                f"{path}, line {numbers[high[0]]}, column {name}: got {array[high[0]]:g}"
                f"{unit}; expected at most {most:g}; {advice}"
            )
    if distinct:
        order = np.argsort(amplitude_m, kind="stable")
        again = np.flatnonzero(np.diff(amplitude_m[order]) == 0)
        if again.size:
            raise UnreadableFileError(
                f"{path}, line {numbers[order[again[0] + 1]]}, column {amplitude_name}: an "
                "amplitude that stands twice; expected one value an amplitude, to interpolate "
                "between them"
            )
    return Measurement(amplitude_m, loss_factor)


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """Return number and cells of every line but blank ones and remarks (#), at least one."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, strict=True)
            lines = [(reader.line_num, row) for row in reader if row and row[0][:1] != "#"]
    except OSError as error:
        raise UnreadableFileError(f"{path}: {error.strerror}; give a CSV file") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise UnreadableFileError(f"{path}: not a CSV file in UTF-8: {error}") from error
    if not lines:
        raise UnreadableFileError(
            f"{path}: is empty; expected a header such as amplitude_um,loss_factor and values"
        )
    return lines


def _factors(path: Path, line: int, header: list[str]) -> np.ndarray:
    """Return what brings each column to m or to a loss factor."""
    known = AMPLITUDES | LOSSES
    for i, name in enumerate(header, 1):
        if name not in known:
            raise UnreadableFileError(
                f"{path}, line {line}, column {i}: unknown name {name!r}; expected one of "
                f"{', '.join(AMPLITUDES)} and one of {', '.join(LOSSES)}, "
                "separated by a comma"
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
