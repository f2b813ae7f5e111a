"""Gwyddion's own format: the height map, a mask of non-measured points, the labels of the hills.

An object is its name, the number of its bytes and its components; a component is a name, a letter
for its type and a value (Gwyddion user guide, "Gwyddion native format"). Rows go from the top down.
"""

import struct
from pathlib import Path

import numpy as np

from capslip.output.convert import Face

WHOLE = True


def write(face: Face, path: Path) -> None:
    """Write the face; a non-measured point has the mean height and is masked."""
    measured = np.isfinite(face.height_m)
    mean_m = face.height_m[measured].mean() if measured.any() else 0.0
    channels = [("Height, form removed", np.where(measured, face.height_m, mean_m), "m")]
    if face.label is not None:
        channels.append(("Hills, by number", face.label, ""))
    parts = []
    for i, (title, values, unit) in enumerate(channels):
        parts += [_object(f"/{i}/data", "GwyDataField", _field(face, values, unit))]
        parts += [_text(f"/{i}/data/title", title)]
    if not measured.all():
        parts.append(_object("/0/mask", "GwyDataField", _field(face, ~measured, "")))
    path.write_bytes(b"GWYP" + _body("GwyContainer", parts))


def _field(face: Face, values: np.ndarray, unit: str) -> list[bytes]:
    ny, nx = values.shape
    dy_m, dx_m = face.pixel_size_m
    data = np.ascontiguousarray(values[::-1], dtype="<f8")  # our row 0 is the lowest
    return [
        _name("xres", "i") + struct.pack("<i", nx),
        _name("yres", "i") + struct.pack("<i", ny),
        _name("xreal", "d") + struct.pack("<d", nx * dx_m),
        _name("yreal", "d") + struct.pack("<d", ny * dy_m),
        _object("si_unit_xy", "GwySIUnit", [_text("unitstr", "m")]),
        _object("si_unit_z", "GwySIUnit", [_text("unitstr", unit)]),
        _name("data", "D") + struct.pack("<I", data.size) + data.tobytes(),
    ]


def _object(name: str, kind: str, parts: list[bytes]) -> bytes:
    return _name(name, "o") + _body(kind, parts)


def _body(kind: str, parts: list[bytes]) -> bytes:
    content = b"".join(parts)
    return kind.encode() + b"\0" + struct.pack("<I", len(content)) + content


def _text(name: str, text: str) -> bytes:
    return _name(name, "s") + text.encode() + b"\0"


def _name(name: str, kind: str) -> bytes:
    return name.encode() + b"\0" + kind.encode()
