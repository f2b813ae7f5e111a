"""The pressure on a joint as another program wrote it: patches of area, each under its pressure."""

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np

from capslip.errors import SettingsError

COLUMNS = ("pressure_Pa", "area_m2")
# Of the pressures in one cell. W keeps to 1 % at 0.1 mu N and to 0.1 % from 0.25 mu N on; it is the
# patches in which further contacts have just touched that tell.
CELL_RATIO = 1.06
DECADES = 3.0  # below the greatest pressure
# Of what bears less: little of the load, but much of the stiffness, which goes with its cube root
LIGHT_CELL_RATIO = 2.0
NOTHING = 1e-12  # of the greatest pressure: what bears less bears nothing


def read_pressure_map(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Read a CSV file of patches with the columns `pressure_Pa` and `area_m2`.

    Other columns, such as `x_m` and `y_m`, are left alone: patches share one tangential
    displacement, so their places do not matter.

    Returns
    -------
    ndarray, ndarray
        Pressures >= 0 and areas > 0, shape (n,); what is beyond rounding beside the greatest is 0.

    Raises
    ------
    SettingsError
        If the file cannot be read, a column is missing or there twice, a line has more cells than
        there are columns, a value is no number or out of bounds, no patch bears any pressure, or
        all together more than a number holds.
    """
    where = f"joint.pressure_map: {path}"
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            rows = csv.DictReader(file, skipinitialspace=True)
            rows.fieldnames = names = _up_to_last([one.strip() for one in rows.fieldnames or ()])
            if any(names.count(name) != 1 for name in COLUMNS):
                raise SettingsError(
                    f"{where}: got the columns {', '.join(names) or 'none'}; expected "
                    f"{' and '.join(COLUMNS)}, once each, x_m and y_m beside them or not; write a "
                    "first line with these names"
                )
            values = [_numbers(row, where, rows.line_num) for row in rows]
    except OSError as error:
        raise SettingsError(f"{where}: {error.strerror}; give a CSV file") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise SettingsError(f"{where}: no CSV text: {error}; give a CSV file") from error
    pressure_Pa, area_m2 = np.array(values).reshape(-1, 2).T
    if not pressure_Pa.any():
        raise SettingsError(
            f"{where}: {len(values)} patches, none under pressure; expected a pressure_Pa > 0"
        )
    with np.errstate(over="ignore"):
        preload_N, whole_m2 = float((pressure_Pa * area_m2).sum()), float(area_m2.sum())
    if not (math.isfinite(preload_N) and math.isfinite(whole_m2)):
        raise SettingsError(
            f"{where}: got {len(values)} patches of {whole_m2:g} m2 under {preload_N:g} N "
            "together; expected those of a joint; check their units, Pa and m2"
        )
    return np.where(pressure_Pa < NOTHING * pressure_Pa.max(), 0.0, pressure_Pa), area_m2


def _up_to_last(cells: list[str]) -> list[str]:
    """Leave out empty cells at the end, which separators at the end of a line make."""
    while cells and not cells[-1].strip():
        cells = cells[:-1]
    return cells


def _numbers(row: dict[Any, Any], where: str, line: int) -> list[float]:
    beyond = _up_to_last(row.pop(None, []))
    if beyond:  # such as 1,500 for 1500
        raise SettingsError(
            f"{where}, line {line}: got {len(row) + len(beyond)} cells; expected {len(row)}, as "
            "many as there are columns; write numbers without a comma"
        )
    return [_number(row[name], where, line, name) for name in COLUMNS]


def _number(text: str | None, where: str, line: int, name: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    good = math.isfinite(value) and (value >= 0.0 if name == COLUMNS[0] else value > 0.0)
    if not good:
        expected = "a pressure >= 0" if name == COLUMNS[0] else "an area > 0"
        raise SettingsError(f"{where}, line {line}: {name}: got {text!r}; expected {expected}")
    return value


def classes_of_pressure(
    pressure_Pa: np.ndarray, area_m2: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return few classes of pressure that stand for many patches; what bears nothing is left out.

    The pressures are cut into cells 6 % wide, below a thousandth of the greatest into such as are
    twice as high as low; each cell becomes two classes that keep its area, its load and the spread
    of its pressures, inside the cell. Patches of few different pressures become one class each, and
    nothing is lost.

    Parameters
    ----------
    pressure_Pa, area_m2 : ndarray, shape (n,)
        Of the patches, at least one under pressure.

    Returns
    -------
    ndarray, ndarray
        Pressures > 0 and areas of the classes, shape (k,).

    Examples
    --------
    >>> classes_of_pressure(np.array([2e6, 0.0, 2e6]), np.array([1e-4, 5e-4, 3e-4]))
    (array([2000000.]), array([0.0004]))
    """
    area_m2, pressure_Pa = area_m2[pressure_Pa > 0.0], pressure_Pa[pressure_Pa > 0.0]
    distinct_Pa, which = np.unique(pressure_Pa, return_inverse=True)
    last = math.ceil(DECADES * math.log(10.0) / math.log(CELL_RATIO))
    if distinct_Pa.size <= last:
        return distinct_Pa, np.bincount(which, area_m2)
    place = np.log(pressure_Pa.max() / pressure_Pa) / math.log(CELL_RATIO)
    beyond = (place - last) * (math.log(CELL_RATIO) / math.log(LIGHT_CELL_RATIO))
    cell = np.floor(np.where(place < last, place, last + beyond))
    cells, which = np.unique(cell, return_inverse=True)
    A = np.bincount(which, area_m2)
    mean = np.bincount(which, area_m2 * pressure_Pa) / A
    variance = np.bincount(which, area_m2 * (pressure_Pa - mean[which]) ** 2) / A
    low, high = np.full(cells.size, np.inf), np.zeros(cells.size)
    np.minimum.at(low, which, pressure_Pa)
    np.maximum.at(high, which, pressure_Pa)
    # Of all pairs with this mean and variance, the one that always lies between low and high
    below, above = np.maximum(mean - low, 0.0), np.maximum(high - mean, 0.0)
    wide = (below > 1e-9 * mean) & (above > 1e-9 * mean)
    below, above = np.where(wide, below, 1.0), np.where(wide, above, 1.0)
    spread = np.where(wide, np.sqrt(variance), 0.0)
    lower, upper = mean - spread * np.sqrt(below / above), mean + spread * np.sqrt(above / below)
    share = above / (below + above)
    found = np.concatenate([lower, upper]), np.concatenate([A * share, A * (1.0 - share)])
    order = np.argsort(found[0], kind="stable")
    return found[0][order], found[1][order]
