"""What a file says of its height map, and the way from there to metres."""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np

from capslip.errors import (
    SettingsError,
    UncalibratedError,
    UnreadableFileError,
    in_short,
    printable,
)
from capslip.surface.heightmap import HeightMap, Origin
from capslip.units import METRES, SPELLINGS

MAX_POINTS = 2**28  # 2 GiB of float64
# Packed data that grow more than this are no measured heights, whose noise does not pack.
MAX_GROWTH = 200
GROWTH_COUNTS_FROM_BYTES = 2**24
# Each is what zipfile raises on one kind of damaged bytes
DAMAGED_ZIP = (BadZipFile, zlib.error, RuntimeError, ValueError, OSError, EOFError)


@dataclass(frozen=True, eq=False)
class Stored:
    """A height map as stored; None is what the file does not say.

    Attributes
    ----------
    height : shape (ny, nx)
        In `unit`; NaN marks a non-measured point.
    unit : str or None
        Unit of the heights.
    pixel_size : (float, float) or None
        (dy, dx) in `lateral_unit`.
    lateral_unit : str or None
        Unit of the pixel size.
    notes : tuple of str
        What the reader did beyond reading: each a sentence for the user, a doubt where it is no
        `Statement`.
    top_row_first : bool or None
        Whether y falls with the row, as in a picture; None where the format leaves it open, and
        the first row then has the least y.
    dataset : str or None
        The one of several maps of the file that this is.
    noise_m : float or None
        Measurement noise, rms of a height in metres, whatever the unit of the heights.
    form_error_m : float or None
        Height of the bow that scans leave in their mean, in metres.
    mean_of : tuple of str
        Name and digest of each scan that an average is made of.
    column : str or None
        What a table calls its heights.
    """

    height: np.ndarray
    unit: str | None = None
    pixel_size: tuple[float, float] | None = None
    lateral_unit: str | None = None
    notes: tuple[str, ...] = ()
    top_row_first: bool | None = None
    dataset: str | None = None
    noise_m: float | None = None
    form_error_m: float | None = None
    mean_of: tuple[str, ...] = ()
    column: str | None = None


@dataclass(frozen=True)
class Calibration:
    """What the user says where the file is silent; `reading` of the settings without `dataset`.

    Attributes
    ----------
    unit, lateral_unit : str or None
        `lateral_unit` belongs to `pixel_size` where that is given, and to the file's own pixel size
        where it is not.
    pixel_size : (float, float) or None
        (dy, dx).
    scale : float or None
        Heights in `unit` a stored number; None means 1.
    top_row_first : bool or None
        Whether y falls with the row.
    invert : bool
        The numbers grow into the material: gaps or depths.
    """

    unit: str | None = None
    lateral_unit: str | None = None
    pixel_size: tuple[float, float] | None = None
    scale: float | None = None
    top_row_first: bool | None = None
    invert: bool = False


@dataclass(frozen=True)
class Request:
    """What the user asks of a reader, beside the file.

    Attributes
    ----------
    dataset : str or None
        Name of the dataset, variable or channel that holds the heights.
    pixel_size : (float, float) or None
        (dy, dx) in `lateral_unit`: the cells of a point cloud, which has no pixels of its own.
    lateral_unit : str or None
        Unit of `pixel_size`.
    lenient : bool
        Accept what a format names as its leniencies, each with a note.
    scale : float or None
        Heights a stored number, without which whole numbers are no heights in some formats.
    """

    dataset: str | None = None
    pixel_size: tuple[float, float] | None = None
    lateral_unit: str | None = None
    lenient: bool = False
    scale: float | None = None

    def pixel_size_in(self, unit: str | None) -> tuple[float, float] | None:
        """Return the pixel size in a unit of the file; None for `unit` means the user's own."""
        if self.pixel_size is None:
            return None
        dy, dx = _given_pair(self.pixel_size)
        if unit is None or self.lateral_unit is None:
            return dy, dx
        factor = METRES[_given_word(self.lateral_unit, "--lateral-unit")]
        factor /= METRES[_stored_word(unit, "pixel unit")]
        return dy * factor, dx * factor


@dataclass(frozen=True)
class Format:
    """One row of the registry.

    `recognises(head, path)` judges by the first bytes of the file, and looks into the file or at
    its extension only where those do not decide. `read(path, request)` returns what is stored.
    `named` says that a file can hold several maps, so that `Request.dataset` has a meaning.
    """

    name: str
    extensions: tuple[str, ...]
    reader: str
    note: str
    recognises: Callable[[bytes, Path], bool]
    read: Callable[[Path, Request], Stored]
    named: bool = False


def zip_holds(path: Path, is_wanted: Callable[[str], bool]) -> bool:
    """Tell whether a ZIP archive that is whole enough to say so holds an entry of such a name."""
    try:
        with ZipFile(path) as archive:
            return any(map(is_wanted, archive.namelist()))
    except DAMAGED_ZIP:
        return False


def read_head(path: Path, size: int) -> bytes:
    """Return the first bytes of a file."""
    with path.open("rb") as file:
        return file.read(size)


def check_shape(shape: tuple[int, ...], what: str) -> None:
    """Refuse, before memory is taken, a shape that is no height map or too large.

    Raises
    ------
    UnreadableFileError
        If the shape has not two axes, or more than `MAX_POINTS` points.
    """
    if len(shape) != 2 or min(shape) < 0:
        raise UnreadableFileError(
            f"{what}: shape {tuple(shape)}; expected two axes (ny, nx); choose the dataset that "
            "holds the height map"
        )
    if math.prod(shape) > MAX_POINTS:
        raise UnreadableFileError(
            f"{what}: {shape[0]} x {shape[1]} points; expected at most {MAX_POINTS}; "
            "cut a part of the scan or thin it"
        )


def check_real(dtype: np.dtype[Any], what: str) -> None:
    """Refuse a data type that holds no real numbers (UnreadableFileError)."""
    if dtype.kind not in "fiu":
        raise UnreadableFileError(
            f"{what}: data type {dtype}; expected real numbers; choose the dataset that holds "
            "the heights"
        )


def check_positive(value: float | str | None, name: str, where: str) -> float:
    """Return a factor of the heights; UnreadableFileError if it is missing or no positive number.

    Heights times zero are none, and a map times a negative number is upside down.
    """
    number = math.nan if value is None else float(value)
    if not 0.0 < number < math.inf:
        told = "missing" if value is None else f"{number:g}"
        raise UnreadableFileError(
            f"{where}: {name} is {told}; expected a positive number; export it again"
        )
    return number


def check_growth(packed_bytes: int, unpacked_bytes: int, what: str) -> None:
    """Refuse, before memory is taken, packed data that grow as no measured heights do.

    Raises
    ------
    UnreadableFileError
        If the data grow to more than `GROWTH_COUNTS_FROM_BYTES` and more than `MAX_GROWTH` times.
    """
    if unpacked_bytes > max(GROWTH_COUNTS_FROM_BYTES, MAX_GROWTH * packed_bytes):
        raise UnreadableFileError(
            f"{what}: {packed_bytes} bytes unpack to {unpacked_bytes}; expected at most "
            f"{MAX_GROWTH} times as many; measured heights do not pack like this: export the "
            "scan again"
        )


def calibrate(stored: Stored, origin: Origin, given: Calibration) -> HeightMap:
    """Bring a stored height map to metres, with y growing from row to row.

    Parameters
    ----------
    stored : Stored
        What the file says; an empty unit is a missing one.
    origin : Origin
        Name and digest; the units and the reader's notes are added here.
    given : Calibration
        What the user says.

    Raises
    ------
    UncalibratedError
        If a unit or the pixel size is neither stored nor given, or what is given contradicts the
        file.
    SettingsError
        If a unit that is given is no unit of length, the pixel size no pair of positive numbers,
        or the scale no positive number.
    """
    where = origin.path or origin.name
    unit, lateral_unit = ((word or "").strip() for word in (stored.unit, stored.lateral_unit))
    stored = replace(stored, unit=unit or None, lateral_unit=lateral_unit or None)
    _check_complete(stored, given, where)
    height_unit = _height_unit(stored.unit, given.unit, where)
    pixel_size_m, pixel_unit = _pixel_size_m(stored, given.lateral_unit, given.pixel_size, where)
    factor = METRES[height_unit] * _scale(stored, given.scale, where)
    factor = -factor if given.invert else factor
    with np.errstate(invalid="ignore", over="ignore"):  # odd NaN; infinity is refused later
        as_stored = factor == 1.0 and stored.height.dtype == np.float32  # half of the memory
        height_m = np.asarray(stored.height, dtype=None if as_stored else np.float64)
        if factor != 1.0:
            height_m = height_m * factor
    if _is_top_row_first(stored, given.top_row_first, where):
        height_m = height_m[::-1]
    height_m = np.ascontiguousarray(height_m)
    height_m.flags.writeable = False  # nobody else has it: a map keeps it without a copy
    origin = replace(
        origin,
        height_unit=height_unit,
        lateral_unit=pixel_unit,
        dataset=None if stored.dataset is None else printable(stored.dataset),
        notes=tuple(type(note)(printable(note)) for note in stored.notes),
        mean_of=tuple(map(printable, stored.mean_of)),
    )
    noise_m = _error_m(stored.noise_m, "a noise", where)
    form_error_m = _error_m(stored.form_error_m, "an error of the form", where)
    return HeightMap(height_m, pixel_size_m, origin, noise_m=noise_m, form_error_m=form_error_m)


def _error_m(error_m: float | None, what: str, where: str) -> float | None:
    if error_m is not None and not 0.0 < error_m < math.inf:
        raise UnreadableFileError(
            f"{where}: the file says {what} of {error_m:g} m; expected a positive number; "
            "correct the file"
        )
    return error_m


def _check_complete(stored: Stored, given: Calibration, where: str) -> None:
    """Ask at once for all that nobody says, where that is more than the unit of the heights."""
    if stored.unit is not None or given.unit is not None:
        return
    if stored.pixel_size is None and given.pixel_size is None:
        lacks, option = "its pixel size", "--pixel-size DY DX --lateral-unit UNIT"
    elif stored.lateral_unit is None and given.lateral_unit is None:
        lacks, option = "that of its pixel size", "--lateral-unit UNIT"
    else:
        return
    raise UncalibratedError(
        f"{where}: the file says neither the unit of its heights nor {lacks}; expected m, mm, um "
        f"or nm; add --unit UNIT {option}"
    )


def _scale(stored: Stored, given: float | None, where: str) -> float:
    if given is None:
        return 1.0
    if not 0.0 < given < math.inf:
        raise SettingsError(f"{where}: reading.scale: got {given:g}; expected a positive number")
    if stored.unit is not None:
        raise UncalibratedError(
            f"{where}: heights are stored in {stored.unit}, but reading.scale says {given:g} a "
            "stored number; a scale in the file is never overridden; leave reading.scale out"
        )
    return float(given)  # of single precision it would leave the map no other


def _is_top_row_first(stored: Stored, given: bool | None, where: str) -> bool:
    if stored.top_row_first is None:
        return bool(given)
    if given is not None and given != stored.top_row_first:
        first = "top" if stored.top_row_first else "bottom"
        raise UncalibratedError(
            f"{where}: the format has its {first} row first, but reading.top_row_first says "
            f"{str(given).lower()}; what a file says is never overridden; leave it out"
        )
    return stored.top_row_first


def _height_unit(stored: str | None, given: str | None, where: str) -> str:
    from_file = None if stored is None else _stored_word(stored, f"{where}: height unit")
    from_user = None if given is None else _given_word(given, "--unit")
    if from_file is None and from_user is None:
        raise UncalibratedError(
            f"{where}: the file does not say the unit of its heights; expected m, mm, um or nm; "
            "add --unit UNIT"
        )
    if from_file is not None and from_user is not None and from_file != from_user:
        raise UncalibratedError(
            f"{where}: heights are stored in {from_file}, but --unit says {from_user}; "
            "a unit in the file is never overridden; leave --unit out or correct the file"
        )
    return from_file or from_user or ""


def _pixel_size_m(
    stored: Stored, lateral_unit: str | None, pixel_size: tuple[float, float] | None, where: str
) -> tuple[tuple[float, float], str]:
    own_unit = (
        None
        if stored.lateral_unit is None
        else _stored_word(stored.lateral_unit, f"{where}: pixel unit")
    )
    given_unit = None if lateral_unit is None else _given_word(lateral_unit, "--lateral-unit")
    given = None if pixel_size is None else _given_pair(pixel_size)
    own = None if stored.pixel_size is None else _stored_pair(stored.pixel_size, where)

    if given is not None and given_unit is None:
        raise UncalibratedError(
            f"{where}: --pixel-size {given[0]:g} {given[1]:g} has no unit; "
            "add --lateral-unit m, mm, um or nm"
        )
    if own is None:
        if given is None or given_unit is None:
            raise UncalibratedError(
                f"{where}: the file does not say its pixel size; expected two lengths; "
                "add --pixel-size DY DX --lateral-unit UNIT"
            )
        return _in_metres(given, given_unit), given_unit
    if own_unit is None:
        if given_unit is None:
            raise UncalibratedError(
                f"{where}: the file says a pixel size of {own[0]:g} x {own[1]:g} but not its unit; "
                "add --lateral-unit m, mm, um or nm"
            )
        own_unit = given_unit
    elif given is None and given_unit is not None and given_unit != own_unit:
        raise UncalibratedError(
            f"{where}: the pixel size is stored in {own_unit}, but --lateral-unit says "
            f"{given_unit}; a unit in the file is never overridden; leave --lateral-unit out"
        )
    own_m = _in_metres(own, own_unit)
    if given is not None and given_unit is not None:
        given_m = _in_metres(given, given_unit)
        if not np.allclose(given_m, own_m, rtol=1e-4, atol=0.0):
            raise UncalibratedError(
                f"{where}: the file says a pixel of {own_m[0]:g} x {own_m[1]:g} m, but "
                f"--pixel-size says {given_m[0]:g} x {given_m[1]:g} m; a pixel size in the file "
                "is never overridden; leave --pixel-size out or correct the file"
            )
    return own_m, own_unit


def _in_metres(pair: tuple[float, float], unit: str) -> tuple[float, float]:
    return pair[0] * METRES[unit], pair[1] * METRES[unit]


def _word(text: str) -> str | None:
    text = text.strip()
    text = SPELLINGS.get(text, text)
    return text if text in METRES else None


def is_length(text: str) -> bool:
    """Say whether a word is a unit of length that is known."""
    return _word(text) is not None


def _stored_word(text: str, what: str) -> str:
    word = _word(text)
    if word is None:
        raise UncalibratedError(
            f"{what}: the file says {text!r}; expected a unit of length ({', '.join(METRES)}); "
            "convert the file"
        )
    return word


def in_one_unit(
    pair: tuple[float, float], units: tuple[str | None, str | None], where: str
) -> tuple[tuple[float, float], str | None]:
    """Return (dy, dx) in one unit, and that unit; both in m where the file says two.

    Raises
    ------
    UncalibratedError
        If the file says two, and one of them is no unit of length.
    """
    if units[0] == units[1]:
        return pair, units[0]
    dy_m, dx_m = (
        float(length) * METRES[_stored_word(str(unit), f"{where}: pixel unit")]
        for length, unit in zip(pair, units, strict=True)
    )
    return (dy_m, dx_m), "m"


def _given_word(text: str, option: str) -> str:
    word = _word(text)
    if word is None:
        raise SettingsError(
            f"{option} {text}: not a unit of length; expected one of {', '.join(METRES)}"
        )
    return word


def _stored_pair(pair: tuple[float, float], where: str) -> tuple[float, float]:
    dy, dx = float(pair[0]), float(pair[1])
    if not (0 < dy < math.inf and 0 < dx < math.inf):
        raise UnreadableFileError(
            f"{where}: the file says a pixel size of {dy:g} x {dx:g}; expected two positive "
            "numbers; correct the file"
        )
    return dy, dx


def _given_pair(pair: tuple[float, float]) -> tuple[float, float]:
    try:
        dy, dx = (float(v) for v in pair)
    except (TypeError, ValueError):
        dy = dx = math.nan
    if not (0 < dy < math.inf and 0 < dx < math.inf):
        raise SettingsError(
            f"--pixel-size {in_short(str(pair))}: expected two positive numbers DY DX"
        )
    return dy, dx
