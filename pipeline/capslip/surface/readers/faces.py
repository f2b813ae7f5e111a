"""The faces of a joint from their files, as the settings say that they are read."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import asdict

from capslip.errors import CapslipError, SettingsError, UncalibratedError
from capslip.settings import Reading
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from capslip.units import METRES, SPELLINGS

OF_ONE_FILE = ("unit", "lateral_unit", "pixel_size")  # that another one may say itself
MOVING = ("dataset", "scale", "top_row_first", "invert")  # unseen in a map that was read without


def load_faces(
    path: Path, mate: Path | None, reading: Reading
) -> tuple[HeightMap, HeightMap | None]:
    """Read a face, and the other one if there is one.

    Parameters
    ----------
    path, mate : Path
        Their files.
    reading : Reading
        What the files do not say. Units and the size of pixels are for the file that lacks them;
        all else is for both.

    Raises
    ------
    CapslipError
        As `load_surface` does; where units or pixels contradict all of the files, too.
    """
    given, faces, contradicted = asdict(reading), list[HeightMap](), False
    for file in (path,) if mate is None else (path, mate):
        try:
            faces.append(load_surface(file, **given))
        except UncalibratedError as error:
            if mate is None or contradicted:
                raise
            contradicted = True
            try:
                faces.append(load_surface(file, **{**given, **dict.fromkeys(OF_ONE_FILE)}))
            except CapslipError:
                raise error from None
    return faces[0], faces[1] if mate is not None else None


def check_reading(surface: HeightMap, reading: Reading, *, alone: bool = True) -> None:
    """Refuse settings that say of a map how it is read where it was read otherwise.

    Parameters
    ----------
    surface : HeightMap
    reading : Reading
    alone : bool
        Whether there is no other face, for whose file units and pixels may be meant.

    Raises
    ------
    SettingsError
        Of a sign, a factor, an order of rows or a dataset that settings hold and the map does not,
        or of a unit or a size of pixels that it was read with otherwise, or whose file says another
        one. A map that was made of an array is in metres, whatever files lack.
    """
    told, wanted, unsaid = dict(surface.origin.read_with), asdict(reading), asdict(Reading())
    for name in MOVING:
        if wanted[name] not in (unsaid[name], told.get(name, unsaid[name])):
            raise SettingsError(
                f"{surface.origin.name}: the settings say reading.{name} = {wanted[name]!r}, and "
                f"the map was made without; load_surface(path, {name}={wanted[name]!r}) reads it so"
            )
    if told:
        _check_lengths(surface, told, wanted, alone)


def _check_lengths(
    surface: HeightMap, told: dict[str, Any], wanted: dict[str, Any], alone: bool
) -> None:
    origin = surface.origin
    of_file = dict(zip(OF_ONE_FILE, (origin.height_unit, origin.lateral_unit), strict=False))
    read_m, own_m = _in_metres(told), _in_metres(of_file)
    own_m["pixel_size"] = list(surface.pixel_size_m)
    for name, one_m in _in_metres(wanted).items():
        other_m = read_m[name] or (own_m[name] if alone else None)
        if one_m and other_m and not np.allclose(one_m, other_m, rtol=1e-4, atol=0.0):
            here, there = (" x ".join(f"{one:g}" for one in of_m) for of_m in (one_m, other_m))
            raise SettingsError(
                f"{origin.name}: the settings say reading.{name} = {wanted[name]!r} ({here} m), "
                f"and the map was read with {there} m; read it as the settings say, or leave it "
                "out of them"
            )


def _in_metres(said: Mapping[str, Any]) -> dict[str, list[float]]:
    """Return what is said of units and pixels, these in metres; empty is what is not said."""
    unit, lateral, pixel = (said.get(name) for name in OF_ONE_FILE)
    across = [] if lateral is None else [METRES[SPELLINGS.get(lateral, lateral)]]
    return {
        "unit": [] if unit is None else [METRES[SPELLINGS.get(unit, unit)]],
        "lateral_unit": across if pixel is None else [],  # else it is the unit of that
        "pixel_size": []
        if pixel is None
        else [one * float(size) for size in pixel for one in across],
    }
