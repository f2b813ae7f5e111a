"""The report: one HTML file that opens offline and holds all that an analysis found."""

import base64
import io
import json
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.contact.rung import rung
from capslip.output import figures_sensitivity
from capslip.output.figures import FIGURES, OF_JOINT
from capslip.output.lead import (
    OF_FACES,
    answer_lines,
    assumed_lines,
    causes,
    effect_text,
    joint_line,
    mating_of,
    on_own_plane,
    oscillates,
)
from capslip.output.methods import citation, limits, methods_paragraph, references
from capslip.output.quantity import engineering, scaled
from capslip.output.rows import DASH, QUANTITIES, UNEVEN, approach_fact, write_text
from capslip.output.thumbnail import thumbnail
from capslip.output.view import read_view
from capslip.output.viewer import CELLS, viewer_block
from capslip.output.whatif import whatif_data
from capslip.output.zones import hill_loads_N
from capslip.result import JointOfScans
from capslip.surface.doubts import points_line
from capslip.units import percent

if TYPE_CHECKING:
    from jinja2 import Template

    from capslip.caps.table import CapTable
    from capslip.result import Analysis
    from capslip.surface.heightmap import HeightMap

MAX_ROWS = 200
SCATTER = (
    "Grey: what lies between the scans, each as if all of the joint were like it. Good: narrow, "
    "which several scans of the same machining are."
)
OF_SCANS = dict.fromkeys(("slip_loop", "energy", "loss_factor"), SCATTER)  # figures
OSCILLATING = {  # what figures show under a normal load that oscillates
    "slip_loop": "Tangential force over tangential displacement from the preloaded joint, under a "
    "normal load that oscillates: steady cycles up to three shares of the force at gross slip, and "
    "the amplitudes of all of them (dashed), force over half of the way to and fro. A cycle lies "
    "beside zero, so its tips lie beside that line. The area of a loop is the energy W lost per "
    "cycle. Good: slim loops that widen towards gross slip.",
    "energy": "Energy lost per cycle in one joint over half of the way to and fro, under a normal "
    "load that oscillates: where the amplitude is small it may be none, or grow with another than "
    "the third power, which is dotted. Pale: less slips than the pixels of the map resolve. "
    "Good: your amplitude right of what is pale.",
}
OF_CAPS = ("hills_and_caps", "cap_profile", "families", "scene")  # figures
HEAVY_BYTES = 200_000  # of a picture
JPEG_QUALITY = 90
SEVERITIES = ("error", "warning", "info")
OPTION = re.compile(r"((?<!\S)--[a-z][\w-]*|(?<==)[\d.]+(?:e[-+]?\d+)?)")  # and its number
MICRO = re.compile(r"(?<=\d )u(?=[mNJ]\b)")  # as the terminal writes it
UNIT = re.compile(r"(?<=\d) (?=(?:[fpnµmkMGT]?(?:N/m|[mNJs]|Pa|Hz)|[cmµ]?m²|%)(?![\w/]))")

Fact = str | tuple[str, str]  # a quantity of the one table, or a label and a text of several
OWN, OTHERS = ", on their own plane", "; on the pressed plane {caps}"
IN = {"Std_rad": ":°", "Spd_per_m2": ":1/mm²", "Spc_per_m": ":1/mm"}  # units without a prefix
ISO25178: tuple[Fact, ...] = (
    *(
        (one.label, f"{{{name}{IN.get(name, '')}}}")
        for name, one in QUANTITIES.items()
        if one.path.startswith("surface.iso25178")
    ),
    ("of", "the map as levelled; hills of the whole map, not those above the cut"),
)
FAMILY = (
    "{{count_{0}}}: mean R {{radius_{0}_m:4}}, D {{diameter_{0}_m}}, df {{height_{0}_m}}, "
    "peak height {{peak_height_{0}_m}}"
)

OF_THE_JOINT: tuple[Fact, ...] = (
    "nominal_pressure_Pa",
    "joint_area_m2",
    "coverage",
    "scan_load_N",
    "off_m",
    ("contact model", "{model}: {model_reason}"),
    "contact_area_m2",
    "max_pressure_Pa",
    "hardness_Pa",
    "yielded_area_m2",
    ("friction coefficient", "{friction_coefficient:g}"),
    ("gross slip, one joint", "{total_slip_force_N} at {total_slip_displacement_m}"),
    "limit_G_m",
    "limit_P_m",
    "structure",
    "modal_stiffness_N_per_m",
    "joint_stiffness_N_per_m",
    "joints",
)


def write_report(
    analysis: "Analysis",
    summary: dict[str, Any],
    folder: str | Path,
    render_message: str | None,
    panel: dict[str, Any] | None = None,
) -> Path:
    """Write `report.html`.

    Parameters
    ----------
    analysis : Analysis
        A finished analysis; or a joint of several scans, of which the page has no single face.
    summary : dict
        Its `summary.json`.
    folder : path
        The result's folder; the pictures are taken from `figures/*.png` in it.
    render_message : str or None
        Why there is no three-dimensional picture; None where there is one.
    panel : dict, optional
        What `whatif_data` finds, where that is known.

    Returns
    -------
    Path
        The file: pictures, data, styles and scripts inside, nothing to load from elsewhere. Where
        `result.h5` is in the folder, the face turns on the page.
    """
    import tomli_w

    folder = Path(folder)
    problems = sorted(summary["problems"], key=lambda one: SEVERITIES.index(one["severity"]))
    result, panel = folder / "result.h5", panel or whatif_data(analysis)
    scans = analysis.scans if isinstance(analysis, JointOfScans) else ()
    mating = mating_of(summary["surface"]["steps"]) if summary["surface"] else None
    page = template().render(
        summary=summary,
        mate=mating and mating["second"],
        style=_part("report.css"),
        script=_part("report.js"),
        answer=[text for _, text in answer_lines(summary, DASH)],
        joint=joint_line(summary, DASH),
        assumed=assumed_lines(summary),
        causes=causes(summary, most=None),
        problems=[{**one, "does": effect_text(one)} for one in problems],
        headlines=_headlines(summary),
        limits=limits(summary),
        figures=_figures(analysis, summary, folder / "figures", render_message),
        viewer=viewer_block(read_view(result, CELLS, summary)) if result.is_file() else "",
        whatif=panel and json.dumps(panel, allow_nan=False).replace("<", "\\u003c"),
        whatif_script=_part("whatif.js"),
        of_caps=bool(panel and panel["of_caps"]),
        error_known=bool(panel and panel.get("error_known")),
        caps=None if scans else _cap_rows(analysis.caps, hill_loads_N(analysis)),
        scans=_scan_rows(scans, summary),
        tables=_tables(summary, None if scans else _changed(analysis)),
        methods=methods_paragraph(summary, analysis.settings, analysis.error_of_answer),
        references=references(summary),
        citation=citation(summary),
        settings=tomli_w.dumps(analysis.settings.to_dict()),
    )
    path = folder / "report.html"
    path.write_text(page, "utf-8", "backslashreplace")
    return path


@cache
def template() -> "Template":
    """Return the page to be filled in; to compile it takes longer than all of a small one."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(options=_options, written=_written)
    return environment.from_string(_part("report.html.j2"))


def _options(text: str) -> list[tuple[str, bool]]:
    """Split a text at the options in it, which no line may break, and say which parts are such."""
    return [(part, i % 2 == 1) for i, part in enumerate(OPTION.split(_written(text)))]


def _written(text: str) -> str:
    """Write quantities as all of the page does: their prefix, and no line between the two."""
    return UNIT.sub("\u00a0", MICRO.sub("µ", text))


@cache
def _part(name: str) -> str:
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


def _fact(fact: Fact, summary: dict[str, Any]) -> tuple[str, str]:
    """Return label and text of one fact."""
    label, text = (QUANTITIES[fact].label, f"{{{fact}}}") if isinstance(fact, str) else fact
    return label, write_text(text, summary)


def _headlines(summary: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Return label, value and note of the numbers that come first."""
    contact = summary["contact"]
    name, whole, model = "caps in contact", False, contact["model"]
    if model is not None:
        name, whole = rung(model).contact_name, rung(model).made_from == "nothing"
    damping, peak = summary["damping"], "{structure}, at an amplitude of {amplitude_at_peak_m}"
    if damping["peak_loss_factor"] is None and damping["amplitude_at_peak_m"] is not None:
        peak = "not defined: the {structure} is no longer lightly damped"
    if damping["first_peak_loss_factor"] is not None:
        peak += "; a first maximum of {first_peak_loss_factor} at {amplitude_at_first_peak_m}"
    uneven = UNEVEN if contact["pressure_classes"] > 1 else ""
    of, others = summary["families"], OTHERS if on_own_plane(summary) else ""
    families: tuple[tuple[Fact, str], ...] = (
        (("G-caps m, P-caps n", "{m}, {n}"), f"families by peak height{others and OWN + others}"),
        ("h_m", "G-peaks above P-peaks"),
    )
    if of["n"] == 0 and of["m"]:
        note = f"on its own plane{others}; no gap h between their peaks"
        families = ((("caps of the one family", "{m}"), note),)
    numbers: tuple[tuple[Fact, str], ...] = (
        *families,
        approach_fact(contact),
        (
            (name, "whole face" if whole else "{contacts}"),
            "the scan at {scan_load_N:4}" + uneven + ", model {model}",
        ),
        ("stiffness_N_per_m", f"one joint, {'with' if contact['bulk'] else 'without'} bulk"),
        ("tangential_stiffness_N_per_m", "first loading, one joint"),
        (
            "peak_loss_factor",
            "no loss below gross slip" if damping["peak_loss_factor"] == 0.0 else peak,
        ),
        (
            "gross_slip_amplitude_m",
            "of the {structure}; {total_slip_force_N} in one joint",
        ),
    )
    found = []
    for fact, note in numbers:
        label, text = _fact(fact, summary)
        gone = set(text) <= set(f"{DASH}, ") and not note.startswith("not defined")
        note = "not available; see above" if gone else write_text(note, summary)
        if not (gone and summary["scans"]):  # what is of a face, and not of a joint of several
            found.append((label, text, note))
    return found


def _figures(
    analysis: "Analysis", summary: dict[str, Any], folder: Path, render_message: str | None
) -> list[dict[str, str | None]]:
    """Collect pictures and captions; a picture that is missing carries the reason."""
    figures = []
    of_scans, moves = isinstance(analysis, JointOfScans), oscillates(summary)
    for name in OF_JOINT if of_scans else FIGURES:
        entry = FIGURES[name]
        good = OF_SCANS.get(name, entry.good) if of_scans else entry.good
        words = f"{entry.caption} {good}"
        if moves:
            words = OSCILLATING.get(name, words)
        missing = f"It needs {entry.needs}, which this analysis does not have; see the problems."
        if entry.draw is figures_sensitivity.sensitivity and not analysis.settings.run.sensitivity:
            missing = "It was not asked for (--sensitivity)."
        if not analysis.settings.run.figures:
            missing = "Figures were switched off (run.figures)."
        failed = [p.message for p in analysis.problems if p.message.startswith(f"{name}.png")]
        missing = failed[0] if failed else missing
        figures.append(
            {
                "name": name,
                "title": entry.title,
                "caption": f"{words}{_of_caps_alone(name, summary)}",
                "alt": write_text(entry.alt, summary),
                "missing": missing,
                "data": _data(folder / f"{name}.png"),
            }
        )
    if of_scans:
        return figures
    scene: dict[str, str | None] = {
        "name": "scene",
        "title": "The face in three dimensions",
        "caption": "Spheres as fitted, down to the cut, on the face; holes are non-measured "
        "points. Heights are enlarged by the factor printed in the picture. Good: the spheres "
        "cover the tops of the hills, and no top is bare." + _of_caps_alone("scene", summary),
        "alt": write_text("The face with {caps} fitted caps, Sz {sz_m}.", summary),
        "missing": f"Reason: {render_message or 'the renderer left no picture'}.",
        "data": _data(folder / "scene.png"),
    }
    return [*figures[:2], scene, *figures[2:]]


def _of_caps_alone(name: str, summary: dict[str, Any]) -> str:
    """Say of a picture of caps that these do not answer, where the map itself was pressed."""
    model = summary["contact"]["model"]
    if name not in OF_CAPS or model is None or rung(model).made_from != "map":
        return ""
    return " Here the map itself was pressed: the caps describe the face, and no answer is theirs."


def _data(png: Path) -> str | None:
    """Return a picture as a data address; a heavy one, as of a rough map, as JPEG in full colour.

    The file beside the page stays as it is.
    """
    from PIL import Image

    if not png.is_file():
        return None
    data, kind = png.read_bytes(), "png"
    if len(data) > HEAVY_BYTES:
        packed = io.BytesIO()
        with Image.open(png) as picture:
            picture.convert("RGB").save(packed, "JPEG", quality=JPEG_QUALITY, subsampling=0)
        data, kind = packed.getvalue(), "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _scan_rows(scans: "tuple[Analysis, ...]", summary: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table of several scans: a stamp of the face, its share, its answer alone."""
    rows = []
    for scan, of in zip(scans, summary["scans"] or (), strict=True):
        stamp = base64.b64encode(thumbnail(scan.conditioned.surface.height_m)).decode("ascii")
        alone, error = of["answer"], of["estimated_error"]
        cells = (
            DASH if of["share"] is None else f"{100.0 * of['share']:.0f} %",
            engineering(of["sq_m"], "m"),
            str(of["caps"]),
            DASH if of["model"] is None else f"{of['contacts']} in {of['model'].replace('_', ' ')}",
            engineering(of["max_pressure_Pa"], "Pa"),
            engineering(alone["tangential_stiffness_N_per_m"], "N/m"),
            engineering(alone["energy_J"], "J"),
            DASH if error is None else percent(error),
        )
        whole = [cell.replace(" ", "\u00a0", 1) for cell in cells]  # a number and its unit
        numbers = (
            *(of[name] for name in ("share", "sq_m", "caps", "contacts", "max_pressure_Pa")),
            *(alone[name] for name in ("tangential_stiffness_N_per_m", "energy_J")),
            error,
        )
        row = {"name": of["name"], "status": of["status"], "cells": whole, "numbers": numbers}
        rows.append({**row, "stamp": f"data:image/png;base64,{stamp}"})
    return rows


def _cap_rows(caps: "CapTable", hill_N: np.ndarray | None = None) -> dict[str, Any]:
    """Rows of the table of caps, the most loaded first, then the highest.

    Where a map was pressed no cap bears anything: the load is what their hills bear of it.
    """
    load_N = caps.load_N if hill_N is None else hill_N
    known = np.isfinite(load_N)
    order = np.lexsort((-caps.peak_height_m, -np.where(known, load_N, -1.0)))[:MAX_ROWS]
    by = "by height: nothing was pressed"
    if known.any():
        by = "by load" if hill_N is None else "by what their hills bear of the pressed map"
    groups = [  # columns of one unit
        ("m", {"x": caps.x_m, "y": caps.y_m}),
        (
            "m",
            {
                "peak height": caps.peak_height_m,
                "df": caps.cap_height_m,
                "rms residual": caps.residual_m,
            },
        ),
        ("m", {"D": caps.diameter_m}),
        ("m", {"R": caps.radius_m}),
        ("N", {"load" if hill_N is None else "load on the hill": load_N}),
    ]
    if hill_N is None:
        groups.append(("m", {"contact radius": caps.contact_radius_m}))
    heads, cells = ["cap", "family"], [[str(i + 1) for i in order], list(caps.family[order])]
    for unit, columns in groups:
        values, unit = scaled(np.array(list(columns.values()))[:, order], unit)
        heads += [f"{head} [{unit}]" for head in columns]
        cells += [
            [f"{x:#.4g}".rstrip(".") if np.isfinite(x) else DASH for x in row] for row in values
        ]
    cells.append(list(caps.columns()["flags"][order]))
    rows = [list(row) for row in zip(*cells, strict=True)]
    total = {"total": len(caps), "more": len(caps) - len(rows)}
    return {"heads": heads, "rows": rows, "by": by, **total}


def _tables(
    summary: dict[str, Any], analysed: "HeightMap | None" = None
) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the remaining numbers of the summary, grouped, as label and text."""
    groups = {} if summary["scans"] else _groups_of_face(summary, analysed)
    uneven = summary["contact"]["pressure_classes"] > 1
    load: Fact = ("load of the scan", f"{{scan_load_N}}{UNEVEN}") if uneven else "scan_load_N"
    groups["Contact, slip and damping"] = tuple(
        load if one == "scan_load_N" else one for one in OF_THE_JOINT
    )
    tables = [(title, [_fact(fact, summary) for fact in facts]) for title, facts in groups.items()]
    if summary["scans"]:
        empty = set(f"{DASH}: ")  # a text of several quantities, too
        tables = [(title, [one for one in facts if set(one[1]) - empty]) for title, facts in tables]
    provenance = summary["provenance"].items()
    tables.append(
        ("Provenance", [(key.replace("_", " "), text or DASH) for key, text in provenance])
    )
    timings_s = summary["timings_s"].items()
    tables.append(("Time", [(stage, engineering(time_s, "s")) for stage, time_s in timings_s]))
    return tables


def _points(shape: tuple[int, int]) -> str:
    return f"{shape[1]} x {shape[0]} (x, y)"


def _pixel(size_m: tuple[float, float]) -> str:
    return f"{engineering(size_m[1], 'm', 4)} x {engineering(size_m[0], 'm', 4)}"


def _changed(analysis: "Analysis") -> "HeightMap | None":
    """Return the map as it was analysed, where its points are not those that were read."""
    seen = analysis.conditioned.surface
    return seen if points_line(seen) != points_line(analysis.surface) else None


def _files(surface: dict[str, Any], mating: dict[str, Any] | None) -> tuple[Fact, ...]:
    """Return the file of a face, or of both, which a text that is filled in takes as they are."""
    first = surface["path"] or "given as an array"
    if mating is None:
        return (("file", "{path}" if surface["path"] else first), "sha256")
    mate = surface["mate"]
    other = mate["path"] or f"{mating['second']}, given as an array"
    files = f"{first}; its mate {other}".replace("{", "{{").replace("}", "}}")
    return (("file", files), "sha256", ("SHA-256 of its mate", mate["sha256"] or DASH))


def _groups_of_face(
    summary: dict[str, Any], analysed: "HeightMap | None"
) -> dict[str, tuple[Fact, ...]]:
    surface, families = summary["surface"], summary["families"]
    (ny, nx), (dy_m, dx_m) = surface["shape"], surface["pixel_size_m"]
    of: tuple[Fact, ...] = ()
    if analysed is not None:
        missing = percent(1.0 - analysed.n_measured / analysed.size)
        points, pixel = _points(analysed.shape), _pixel(analysed.pixel_size_m)
        of = (("as analysed", f"{points}, pixels of {pixel}, {missing} non-measured"),)
    as_read = ", as read" if of else ""
    mating, of_faces = mating_of(surface["steps"]), ""
    each: tuple[Fact, ...] = ()
    if mating is not None:
        of_faces = f" {OF_FACES[mating['way']]}"
        both = " and ".join(engineering(one_m, "m") for one_m in mating["sq_of_faces_m"])
        each = (("Sq of each face", both),)
    rejected = ", ".join(f"{n} {reason}" for reason, n in summary["hills"]["rejected"].items())
    family = {name: FAMILY.format(name) if families[name] else "none" for name in "GP"}
    own = OWN if on_own_plane(summary) else ""
    of_families: tuple[Fact, ...] = (
        (f"G-caps{own}", family["G"]),
        (f"P-caps{own}", family["P"]),
    )
    if families["G"] and not families["P"]:
        of_families = ((f"caps of the one family{own.replace('their', 'its')}", family["G"]),)
    return {
        "Height map": (
            *_files(surface, mating),
            (f"points{as_read}", _points((ny, nx))),
            (f"pixel{as_read}", _pixel((dy_m, dx_m))),
            (f"face{as_read}", f"{engineering(nx * dx_m, 'm')} x {engineering(ny * dy_m, 'm')}"),
            (f"non-measured{as_read}", "{non_measured}"),
            *of,
            "form",
            (f"Sq{of_faces}", "{sq_m}"),
            (f"Sz{of_faces}", "{sz_m}"),
            *each,
        ),
        f"Surface parameters after ISO 25178-2{of_faces}": ISO25178,
        "Hills and families": (
            "alignment",
            "tilt_across_face_m",
            "cut_certified",
            "material_ratio",
            "cut_height_m",
            "kept_fraction",
            "regions",
            "largest_region_share",
            ("hills", "{hills}, {caps} of them with a sphere"),
            ("rejected", rejected.replace("_", " ") or "none"),
            *of_families,
        ),
    }
