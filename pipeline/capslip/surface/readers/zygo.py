"""Zygo's text export: the header of MetroPro in lines, then intensities, then phases.

Heights are phases times S lambda O / R: scale factor, wavelength, obliquity factor, and the
resolution of the phase (MetroPro Reference Guide, OMP-0347, "Data format"). The first row is the
top.
"""

from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.readers.stored import Format, Request, Stored, check_positive, check_shape
from capslip.surface.readers.table import decoded, parse_numbers, read_text

MAGIC = b"Zygo ASCII Data File"
RESOLUTIONS = {0: 4096, 1: 32768, 2: 131072}
INVALID = 2147483640  # and beyond
# Lines of the header, counted from 0, and the places of what is used in them
PHASE, OPTICS, RESULT = 3, 7, 10
WIDTH, HEIGHT = 2, 3
SCALE, WAVELENGTH, OBLIQUITY, LATERAL = 1, 2, 4, 6
RESOLUTION, SIGN = 0, 7


def _recognises(head: bytes, path: Path) -> bool:
    return head.startswith(MAGIC)


def _read(path: Path, request: Request) -> Stored:
    header, *blocks = read_text(path).split(b"\n#")
    lines = [decoded(line) for line in header.split(b"\n")]
    try:
        nx, ny = (int(lines[PHASE].split()[at]) for at in (WIDTH, HEIGHT))
        optics, result = lines[OPTICS].split(), lines[RESULT].split()
        scale, wavelength_m, obliquity, lateral_m = (
            float(optics[at]) for at in (SCALE, WAVELENGTH, OBLIQUITY, LATERAL)
        )
        step_m = scale * wavelength_m * obliquity / RESOLUTIONS[int(result[RESOLUTION])]
        upside_down = int(result[SIGN]) != 0
    except (IndexError, KeyError, ValueError) as error:
        raise UnreadableFileError(
            f"{path}: damaged header ({type(error).__name__}: {error}); expected 14 lines as "
            "MetroPro writes them; export it again"
        ) from error
    # What lies upside down has the sign for that
    check_positive(scale, "scale factor", str(path))
    check_positive(wavelength_m, "wavelength", str(path))
    check_positive(obliquity, "obliquity factor", str(path))
    check_shape((ny, nx), str(path))
    if len(blocks) < 2:
        raise UnreadableFileError(
            f"{path}: {len(blocks)} blocks behind the header; expected intensities and phases; the "
            "file is truncated: copy it again"
        )
    phase = parse_numbers(blocks[1], str(path))
    if phase.size != nx * ny:
        raise UnreadableFileError(
            f"{path}: {phase.size} phases; expected {ny} rows of {nx} as the header says; copy or "
            "export it again"
        )
    with np.errstate(invalid="ignore", over="ignore"):  # infinity is refused later
        z = np.where(phase >= INVALID, np.nan, phase * step_m).reshape(ny, nx)
    return Stored(
        -z if upside_down else z,
        "m",
        (lateral_m, lateral_m) if lateral_m > 0 else None,
        "m" if lateral_m > 0 else None,
        top_row_first=True,
    )


FORMAT = Format(
    name="zygo",
    extensions=(".asc", ".txt"),
    reader="built in",
    note="text export of MetroPro; needs --pixel-size where the lateral scale is unknown",
    recognises=_recognises,
    read=_read,
)
