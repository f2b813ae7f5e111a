"""The faces of a joint from their files, as the settings say that they are read."""

from pathlib import Path

from msgspec.structs import asdict

from capslip.errors import CapslipError, SettingsError, UncalibratedError
from capslip.settings import Reading
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface

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


def check_reading(surface: HeightMap, reading: Reading) -> None:
    """Refuse settings that say of a map how it is read where it was read otherwise.

    Raises
    ------
    SettingsError
        Of a sign, a factor, an order of rows or a dataset that settings hold and the map does not.
    """
    told, wanted, unsaid = dict(surface.origin.read_with), asdict(reading), asdict(Reading())
    for name in MOVING:
        if wanted[name] not in (unsaid[name], told.get(name, unsaid[name])):
            raise SettingsError(
                f"{surface.origin.name}: the settings say reading.{name} = {wanted[name]!r}, and "
                f"the map was made without; load_surface(path, {name}={wanted[name]!r}) reads it so"
            )
