"""A result in three dimensions on a page: one file with its data, no server, nothing to load.

The page draws the thinned mesh itself (`viewer.js`, WebGL2), with text as text beside it. It shows
the same as the window, from the same table of zones.
"""

import base64
import json
import math
import os
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from capslip.disk import way_out, write_whole
from capslip.errors import OutputError
from capslip.output.canvas import height_limits
from capslip.output.picture import SLIP, STICK, Look
from capslip.output.view import (
    OF_CONTACTS,
    View,
    cap_profiles,
    check_result,
    colouring,
    read_view,
    result_file,
)
from capslip.output.zones import compression_at

CELLS = 70_000  # of the face
PIXELS = 50_000  # of a map's contacts
LEVELS = 33  # of the loads, evenly in their power 2/3
PROFILES = 120  # caps, the most loaded
SAMPLES = 81  # of a profile
LEAST = 65535  # of 16 bits: no value


def write_viewer(result: str | Path, page: Path, look: Look | None = None) -> None:
    """Write a page that shows a result.

    Parameters
    ----------
    result : path
        `result.h5`, or the folder that holds it.
    page : path
        `.html` or `.htm`; one that is there stays until this one is whole.
    look : Look, optional
        What is shown first.

    Raises
    ------
    OutputError
        If there is no result, it knows no contacts that the look asks for, or the page has another
        ending or cannot be written.
    """
    from jinja2 import Environment, StrictUndefined

    look = look or Look()
    check_page(result, page, look)
    view = read_view(result, CELLS)
    template = files("capslip.output").joinpath("viewer.html.j2").read_text("utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    block = viewer_block(view, look)
    text = environment.from_string(template).render(name=view.name, viewer=block)
    try:
        place = Path(os.path.realpath(page))  # a link stays one
        write_whole(place, lambda unfinished: unfinished.write_text(text, encoding="utf-8"))
    except OSError as error:
        step = way_out(error, "give another name")
        raise OutputError(f"{page}: {error.strerror}; {step}") from error


def check_page(result: str | Path, page: Path, look: Look) -> None:
    """Refuse a page that cannot show a result so, before anything is written.

    Raises
    ------
    OutputError
        As `write_viewer`.
    """
    if page.suffix.lower() not in (".html", ".htm"):  # what is there may be a scan
        raise OutputError(f"{page}: got {page.suffix or 'no suffix'}; expected .html or .htm")
    if not page.absolute().parent.is_dir():
        raise OutputError(f"{page}: No such file or directory; give another name")
    known, coloured = check_result(result), look.colour in OF_CONTACTS
    if not known and (look.zones or look.mate or coloured):
        state = ["--load, --force or --mate"] if look.zones or look.mate else []
        got = [*state, *([f"--colour {look.colour}"] if coloured else [])]
        raise OutputError(
            f"{page}: got {' and '.join(got)}; {result_file(result)} knows no single "
            f"contacts to show so; leave {'them' if state else 'it'} out"
        )


def viewer_block(view: View, look: Look | None = None) -> str:
    """Return what shows a result inside a page: elements, data, style and script."""
    room = files("capslip.output")
    data = json.dumps(viewer_data(view, look), allow_nan=False).replace("<", "\\u003c")
    parts = (
        *("<style>", room.joinpath("viewer.css").read_text("utf-8"), "</style>"),
        '<div class="viewer" id="viewer"></div>',
        f'<script type="application/json" id="viewer-data">{data}</script>',
        *("<script>", room.joinpath("viewer.js").read_text("utf-8"), "</script>"),
    )
    return "\n".join(parts)


def viewer_data(view: View, look: Look | None = None) -> dict[str, Any]:
    """Return what the script needs, plain; long arrays are packed, see `_packed`."""
    look = look or Look()
    low_m, high_m = view.limits_m
    of = view.columns
    depth_m = np.minimum(of["cap_height_m"], of["radius_m"])
    base_m = np.minimum(np.sqrt(depth_m * (2.0 * of["radius_m"] - depth_m)), of["diameter_m"] / 2)
    shown = np.lexsort((-of["peak_height_m"], -view.cap_load_N))[:PROFILES]
    return {
        "name": view.name,
        "side": list(view.side_m),
        "factor": view.exaggeration(view.limits_m),
        "low": low_m,
        "high": high_m,
        "x": _packed(view.x_m, "f4"),
        "y": _packed(view.y_m, "f4"),
        "z": _levels(view.height_m.ravel(), low_m, high_m),
        "second": _second(view),
        "caps": {
            "number": (view.cap + 1).tolist(),
            "family": list(of["family"]),
            "flags": [words.replace("_", " ") for words in of["flags"]],
            "x": _packed(of["x_m"], "f4"),
            "y": _packed(of["y_m"], "f4"),
            "peak": _packed(of["peak_height_m"], "f4"),
            "df": _packed(of["cap_height_m"], "f4"),
            "D": _packed(of["diameter_m"], "f4"),
            "R": _packed(of["radius_m"], "f4"),
            "a": _packed(np.nan_to_num(of["contact_radius_m"]), "f4"),
            "base": _packed(base_m, "f4"),
            "load": _packed(view.cap_load_N, "f4"),
            "loss": _packed(view.cap_loss_share, "f4"),
        },
        "colours": {by: _colours(view, by) for by in view.colours},
        "zones": _zones(view),
        "profiles": _profiles(view, shown),
        "stick": STICK,
        "slip": SLIP,
        "load_name": view.load_name,
        "preload_N": None if view.zones is None else float(view.zones.load_N[-1]),
        "first": {
            "colour": look.colour,
            "load": look.load_share,
            "force": look.force_share,
            "zones": look.zones or (view.zones is not None and view.zones.of_map),  # no caps answer
            "mate": look.mate,
        },
    }


def _colours(view: View, by: str) -> dict[str, Any]:
    found = colouring(view, by)
    return {
        "title": found.title,
        "value": _packed(found.value, "f4"),
        "names": [list(name) for name in found.names],
        "limits": list(found.limits),
    }


def _second(view: View) -> dict[str, Any] | None:
    if view.second_m is None:
        return None
    low_m, high_m = height_limits(view.second_m)
    first_low_m, first_high_m = view.first_limits_m
    return {
        "low": low_m,
        "high": high_m,
        "z": _levels(view.second_m.ravel(), low_m, high_m),
        "first_low": first_low_m,
        "first_high": first_high_m,
        "factor": view.exaggeration(view.first_limits_m),
    }


def _zones(view: View) -> dict[str, Any] | None:
    zones = view.zones
    if zones is None:
        return None
    shares = np.linspace(0.0, 1.0, LEVELS) ** 1.5
    table = np.array([compression_at(zones, share) for share in shares])
    every = max(1, -(-len(zones.pixel) // PIXELS))
    kept = slice(None, None, every)
    approach_m = [view.approach_at(share) for share in shares]
    place_m = view.pixel_m[kept]
    row = np.full(int(max(view.cap.max(initial=0), zones.cap.max(initial=0))) + 1, -1)
    row[view.cap] = np.arange(len(view.cap))
    low_m, high_m = view.limits_m
    return {
        "levels": LEVELS,
        "count": len(zones),
        "of_map": zones.of_map,
        "compression": _levels(table.ravel(), 0.0, 1.0),
        "approach": approach_m,
        "load": _packed(zones.contact_load_N, "f4"),
        "cap": _packed(np.where(zones.cap >= 0, row[zones.cap], -1), "i4"),
        "radius": _packed(zones.radius_m, "f4"),
        "every": every,
        "pixel_area": float(zones.pixel_area_m2.sum()) * every,
        "point_side": view.point_side_m * math.sqrt(every),  # all drawn cover as much as all
        "enlarged": view.enlarged_points,
        "pixel_x": _levels(place_m[:, 0], 0.0, view.side_m[1]),
        "pixel_y": _levels(place_m[:, 1], 0.0, view.side_m[0]),
        "pixel_z": _levels(place_m[:, 2], low_m, high_m),
        "pixel_contact": _packed(zones.pixel_contact[kept], "i4"),
        "pixel_reach": _levels(zones.pixel_reach[kept], 0.0, 1.0),
    }


def _profiles(view: View, shown: np.ndarray) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for i, (s_m, height_m, _) in zip(shown.tolist(), cap_profiles(view, shown), strict=True):
        if len(s_m) > SAMPLES:
            pick = np.rint(np.linspace(0, len(s_m) - 1, SAMPLES)).astype(int)
            s_m, height_m = s_m[pick], height_m[pick]
        if not np.isfinite(height_m).any():
            continue
        low_m, high_m = float(np.nanmin(height_m)), float(np.nanmax(height_m))
        found[str(i)] = {
            "s": [float(s_m[0]), float(s_m[-1])],
            "low": low_m,
            "high": high_m,
            "z": _levels(height_m, low_m, high_m),
        }
    return found


def _packed(values: np.ndarray, kind: str) -> str:
    """Return numbers as text: base64 of their bytes, the least significant first."""
    return base64.b64encode(np.asarray(values).astype(f"<{kind}").tobytes()).decode("ascii")


def _levels(values: np.ndarray, low: float, high: float) -> str:
    """Return numbers between two limits in 16 bits; the greatest level is no value."""
    span = high - low if high > low else 1.0
    level = np.rint(np.clip((values - low) / span, 0.0, 1.0) * (LEAST - 1))
    return _packed(np.where(np.isfinite(values), level, LEAST), "u2")
