"""The numbers of an analysis as tables: NumPy structured arrays, one field a column.

`result.h5` holds the same columns.
"""

from typing import TYPE_CHECKING

import numpy as np

from capslip.caps.table import UNITS as UNITS_OF_CAPS
from capslip.errors import check_kind

if TYPE_CHECKING:
    from capslip.contact.press import ContactState
    from capslip.result import Analysis

LOADS, FORCES = 80, 96  # points of the normal curve and of the slip curve
UNITS = {
    **UNITS_OF_CAPS,
    "approach_m": "m",
    "force_N": "N",
    "displacement_m": "m",
    "energy_J": "J",
    "amplitude_m": "m",
    "loss_factor": "1",
    "damping_ratio": "1",
    "frequency_ratio": "1",
}
OF_DAMPING = ("amplitude_m", "force_N", "loss_factor", "damping_ratio", "frequency_ratio")
OF_FAMILIES = ("count", "radius_m", "diameter_m", "height_m", "peak_height_m")


class Tables:
    """What `Analysis.tables` gives: structured arrays of shape (rows,), the unit in each name.

    `pandas.DataFrame(analysis.tables.caps)` makes a data frame of one. What the analysis does not
    have is a table without rows.

    Examples
    --------
    >>> y, x = np.mgrid[0:120, 0:180] * 1e-4
    >>> waves_m = 2e-7 * np.cos(2 * np.pi * x / 6e-3) * np.cos(2 * np.pi * y / 6e-3)
    >>> import capslip
    >>> analysis = capslip.analyze(capslip.HeightMap(waves_m, (1e-4, 1e-4)))
    >>> caps = analysis.tables.caps
    >>> bool((caps["radius_m"] > 0.0).all()), caps.dtype.names[:3]
    (True, ('x_m', 'y_m', 'peak_height_m'))
    """

    def __init__(self, analysis: "Analysis") -> None:
        from capslip.result import Analysis  # which opens this room when it is asked for tables

        check_kind("analysis", analysis, Analysis, "an Analysis; make one with capslip.analyze")
        self._analysis = analysis

    @property
    def caps(self) -> np.ndarray:
        """One row a cap, with the columns of `caps.csv`."""
        return table_of(self._analysis.caps.columns())

    @property
    def families(self) -> np.ndarray:
        """One row a family, the highest first: count, and means of its caps."""
        names = {"G": self._analysis.families.G, "P": self._analysis.families.P}
        found = {name: family for name, family in names.items() if family is not None}
        columns = {"family": np.array(list(found), dtype="U1")}
        for column in OF_FAMILIES:
            values = [getattr(family, column) for family in found.values()]
            columns[column] = np.array(values, dtype=int if column == "count" else float)
        return table_of(columns)

    @property
    def normal_curve(self) -> np.ndarray:
        """Load of the scan over its normal approach, up to the preload."""
        load_N, approach_m = np.empty(0), np.empty(0)
        if self._analysis.contact is not None:
            load_N = _loads_N(self._analysis.contact)
            approach_m = np.asarray(self._analysis.contact.normal.approach_m(load_N))
        return table_of({"approach_m": approach_m, "load_N": load_N})

    @property
    def slip(self) -> np.ndarray:
        """Tangential force, displacement and energy lost per cycle of the joint, up to mu N."""
        force_N = displacement_m = energy_J = np.empty(0)
        slip = self._analysis.slip
        if slip is not None:
            force_N = np.geomspace(1e-3, 1.0, FORCES) * slip.total_slip_force_N
            displacement_m = np.asarray(slip.displacement_m(force_N))
            energy_J = np.asarray(slip.energy_at_force_J(force_N))
        return table_of(
            {"force_N": force_N, "displacement_m": displacement_m, "energy_J": energy_J}
        )

    @property
    def damping(self) -> np.ndarray:
        """Loss factor of the structure over its amplitude; NaN from gross slip on."""
        damping = self._analysis.damping
        none = np.empty(0)
        return table_of({name: getattr(damping, name, none) for name in OF_DAMPING})

    @property
    def problems(self) -> np.ndarray:
        """One row a problem: code, severity, message."""
        rows = [(p.code, p.severity, p.text) for p in self._analysis.problems]
        words = np.array(rows, dtype=str).reshape(-1, 3).T
        return table_of(dict(zip(("code", "severity", "message"), words, strict=True)))


def table_of(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Put columns of one length into one structured array, words as text of a fixed width."""
    columns = {name: _plain(column) for name, column in columns.items()}
    n_rows = len(next(iter(columns.values())))
    table = np.empty(n_rows, dtype=[(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return table


def _plain(column: np.ndarray) -> np.ndarray:
    """Words as text that needs no Python object."""
    return column.astype(str) if column.dtype.kind == "O" else column


def _loads_N(contact: "ContactState") -> np.ndarray:
    """Return the loads of the normal curve; where each costs a solution, those at hand."""
    if contact.rung.solved_loads_N is not None:
        return contact.rung.solved_loads_N(contact.normal, contact.preload_N)
    return contact.preload_N * np.append(0.0, np.geomspace(1e-3, 1.0, LOADS))
