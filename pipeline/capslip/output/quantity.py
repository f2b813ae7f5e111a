"""Numbers as an engineer writes them: three or four digits and a prefix."""

import numpy as np

PREFIX = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}


def engineering(value: float | None, unit: str, digits: int = 3) -> str:
    """Write a number with a prefix of its unit; an absent one is a dash.

    Parameters
    ----------
    value : float or None
        In the unit itself; None and NaN are absent.
    unit : str
        Unit that takes a prefix, such as "m", "N/m" or "Pa".
    digits : int
        Significant digits.

    Examples
    --------
    >>> engineering(3.07e-7, "m"), engineering(3.893e9, "N/m"), engineering(999.9, "N")
    ('307 nm', '3.89 GN/m', '1 kN')
    >>> engineering(None, "N"), engineering(0.0, "m")
    ('–', '0 m')
    """
    if value is None or not np.isfinite(value):
        return "–"
    rounded = float(f"{value:.{digits - 1}e}")  # first, so that 999.9 N becomes 1 kN
    power = _power(abs(rounded))
    return f"{rounded / 10.0**power:.{digits}g} {PREFIX[power]}{unit}"


def scaled(values: np.ndarray, unit: str) -> tuple[np.ndarray, str]:
    """Bring values to the prefix that suits the largest of them, for an axis or a column.

    Returns
    -------
    ndarray, str
        The values in the new unit, and its name.

    Examples
    --------
    >>> scaled(np.array([2e-8, 3e-7]), "m")
    (array([ 20., 300.]), 'nm')
    """
    values = np.asarray(values, dtype=float)
    finite = np.abs(values[np.isfinite(values)])
    power = _power(float(finite.max(initial=0.0)))
    return values / 10.0**power, f"{PREFIX[power]}{unit}"


def unit_on(label: str, largest: float, unit: str) -> tuple[float, str]:
    """Return one step of the unit that an axis has by its label already, else of one that suits.

    So a second curve on the same axes has the unit of the first.

    >>> unit_on("amplitude [µm]", 3e-9, "m"), unit_on("", 3e-9, "m")
    ((1e-06, 'µm'), (1e-09, 'nm'))
    """
    steps = {f"{prefix}{unit}": 10.0**power for power, prefix in PREFIX.items()}
    name = label.rpartition("[")[2].removesuffix("]")
    if name not in steps:
        name = scaled(np.array([largest]), unit)[1]
    return steps[name], name


def _power(largest: float) -> int:
    """Exponent of the prefix, a multiple of three."""
    if largest == 0.0:
        return 0
    return int(np.clip(3 * np.floor(np.log10(largest) / 3 + 1e-12), min(PREFIX), max(PREFIX)))
