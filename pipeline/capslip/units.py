"""The units that a file or a user can name: the one table of them."""

import math
import re
from typing import TYPE_CHECKING, Any, Literal, cast

from capslip.errors import SettingsError

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "pm": 1e-12, "inch": 0.0254}
SPELLINGS = {
    "µm": "um",  # micro sign
    "μm": "um",  # Greek mu
    "micron": "um",
    "in": "inch",
    "metre": "m",
    "meter": "m",
    "millimetre": "mm",
    "millimeter": "mm",
    "micrometre": "um",
    "micrometer": "um",
    "nanometre": "nm",
    "nanometer": "nm",
}
NEWTONS = {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "uN": 1e-6}
PASCALS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5, "N/mm2": 1e6}
SQUARE_METRES = {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6, "um2": 1e-12}
KNOWN = {  # of a quantity that a user writes, and how he may
    "m": (METRES, "0.5um"),
    "N": (NEWTONS, "20N"),
    "Pa": (PASCALS, "2MPa"),
    "m2": (SQUARE_METRES, "12cm2"),
}
WORDS = (*METRES, "µm")  # of options and settings

SiUnit = Literal["m", "N", "Pa", "m2"]  # of what a user writes
if TYPE_CHECKING:
    LengthUnit = str
else:
    LengthUnit = Literal[WORDS]


def in_si(text: str, si_unit: SiUnit, name: str) -> float:
    """Return a positive number that a user wrote with its unit, in SI.

    Raises
    ------
    SettingsError
        If the number is none, or the unit is missing or unknown: it is never guessed.

    Examples
    --------
    >>> in_si("0.5um", "m", "--amplitude"), in_si("2 kN", "N", "--slip-force")
    (5e-07, 2000.0)
    >>> in_si("2 MPa", "Pa", "--pressure"), in_si("12cm²", "m2", "--area")
    (2000000.0, 0.0012)
    """
    known, example = KNOWN[si_unit]
    match = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*([^\W\d][\w/]*)?\s*", text)
    number, unit = match.groups("") if match else ("", "")
    unit = unit.replace("µ", "u").replace("μ", "u").replace("²", "2")
    factor = known.get(SPELLINGS.get(unit, unit) if si_unit == "m" else unit)
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if factor is None or not 0.0 < value < math.inf:
        raise SettingsError(
            f"{name}: got {text!r}; expected a number > 0 and its unit, one of "
            f"{', '.join(known)}, as in {example}"
        )
    # By division, so that 0.5um is 5e-07 and no digit more
    return value / round(1.0 / factor) if factor < 1e-2 else value * factor


def as_named(value: Any, name: str) -> Any:
    """Return a value, that of a text with a unit in the unit in which the name of a setting ends.

    What is no such text stays as it is; lists hold values.

    Examples
    --------
    >>> as_named("30mm", "l_filter_nesting_index_m"), as_named(["200GPa", 3e9], "modulus_Pa")
    (0.03, [200000000000.0, 3000000000.0])
    >>> as_named("30mm", "stiffness_N_per_m"), as_named("30 miles", "length_m"), as_named(3, "x_m")
    ('30mm', '30 miles', 3)
    """
    if isinstance(value, list):
        return [as_named(one, name) for one in value]
    unit = unit_of(name)
    if not isinstance(value, str) or unit is None:
        return value
    try:
        return in_si(value, unit, name)
    except SettingsError:  # of which whoever knows the setting says what is expected
        return value


def unit_of(name: str) -> SiUnit | None:
    """Return the unit in which the name of a setting ends, where a user may write another."""
    before, _, unit = name.rpartition("_")
    return cast(SiUnit, unit) if unit in KNOWN and not before.endswith("_per") else None


PREFIXES = {-12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
AREAS = ((1e-3, 1e-4, "cm2"), (1e-9, 1e-6, "mm2"), (0.0, 1e-12, "um2"))  # from where on, in m2
QUANTITY = re.compile(
    r"(?<![\w.])(\d+(?:\.\d+)?(?:[eE][-+]?\d+)?) (x (\d\S*) )?(m|N|Pa|J|N/m|m2)(?![\w/^])"
)


MOVED = re.compile(r"\bby (\d+(?:\.\d+)?)%")
MOST_FACTOR = 1000  # beyond it nobody tells an error from another
TENFOLD = 9.0  # a change of 900 %
SHARE = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)%")


def percent(share: float) -> str:
    """Write a share in percent, as people do: two digits, and a space before the sign.

    Examples
    --------
    >>> percent(0.2407), percent(0.006), percent(3.087), percent(0.0)
    ('24 %', '0.6 %', '309 %', '0 %')
    """
    value = 100.0 * share
    return f"{value:.0f} %" if value >= 99.5 else f"{value:.2g} %"


def off_by(log: float) -> str:
    """Write an error that is known as half the width of an interval in logarithms.

    In percent of what it may add, from twofold on as the factor that lies to either side.

    Examples
    --------
    >>> off_by(0.02), off_by(0.3), off_by(2.98), off_by(50.0)
    ('2 %', '35 %', 'a factor of 20', 'more than a factor of 1000')
    """
    if log > math.log(MOST_FACTOR):
        return f"more than a factor of {MOST_FACTOR:g}"
    factor = math.exp(log)
    return percent(math.expm1(log)) if factor < 2.0 else f"a factor of {factor:.2g}"


def share_of(log: float) -> float:
    """Return the share that such an error may add, no more than is told apart."""
    return math.expm1(min(log, math.log(MOST_FACTOR)))


def change(share: float) -> str:
    """Write by how much a number moves: in percent, from tenfold on as a factor.

    Examples
    --------
    >>> change(0.24), change(3.0), change(108.9)
    ('24 %', '300 %', 'a factor of 110')
    """
    if share < TENFOLD:
        return percent(share)
    return f"a factor of {float(f'{1.0 + share:.2g}'):.0f}"


def readable(text: str) -> str:
    """Write the quantities of a message as people do: three or four digits and a prefix.

    Examples
    --------
    >>> readable("pixels of 1.90661e-06 x 1.63424e-06 m are not square")
    'pixels of 1.907 x 1.634 um are not square'
    >>> readable("2.82e-07 m at 3.12e+03 N, 0.00815 m and 5e-08 m2")
    '282 nm at 3.12 kN, 8.15 mm and 0.05 mm2'
    >>> readable("0.7769 N of 12000 N and 460 N")
    '776.9 mN of 12 kN and 460 N'
    >>> readable("2.39e-03 m2")
    '23.9 cm2'
    >>> readable("moves the energy by 308.7%")
    'moves the energy by 309 %'
    """
    text = QUANTITY.sub(_readable, text)
    text = MOVED.sub(lambda match: f"by {change(float(match[1]) / 100.0)}", text)
    return SHARE.sub(lambda match: percent(float(match[1]) / 100.0), text)


def _readable(match: "re.Match[str]") -> str:
    number, _, second, unit = match.groups()
    values = [float(number)] + ([float(second)] if second else [])
    least = min(abs(value) for value in values)
    plain = not re.search("[eE]", number)
    if not 1e-12 <= least < 1e12 or (plain and 1.0 <= least < 1e3):
        return match[0]  # reads well as it is
    given = len(re.sub(r"\.", "", number).lstrip("0")) if plain else 0
    digits = 4 if second or given > 3 else 3
    step = max(-12, min(9, 3 * math.floor(math.log10(least) / 3 + 1e-9)))
    scale, name = 10.0**step, f"{PREFIXES[step]}{unit}"
    if unit == "m2":  # prefixes of a square mislead
        scale, name = next(area[1:] for area in AREAS if least >= area[0])
    return f"{' x '.join(f'{value / scale:.{digits}g}' for value in values)} {name}"
