"""The report: one HTML file that opens offline and holds all that an analysis found."""

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.output.figures import FIGURES
from capslip.output.quantity import contact_name, engineering, scaled

if TYPE_CHECKING:
    from capslip.caps.table import CapTable
    from capslip.result import Analysis

MAX_ROWS = 200
DASH = "–"
SEVERITIES = ("error", "warning", "info")

MISSES = {
    "flat": "The interface is taken as perfectly plane: no energy is lost below total slip.",
    "families": "Each family counts with its mean radius and height: the spread inside a family "
    "and the elastic interaction of the caps are left out.",
    "caps": "Each cap stands alone: the elastic interaction of the caps is left out, which makes "
    "the joint too stiff and lets too many caps touch.",
    "mean_field": "The elastic interaction of the caps enters the approach as a mean only; the "
    "share of the load between the caps is that of caps that stand alone.",
    "interacting": "Caps are spheres and act on one another as point loads on a half-space: other "
    "shapes, contacts that merge and the edges of the face are left out.",
    "boundary_elements": "The height map itself is pressed, without spheres: what its pixels do "
    "not resolve is left out, and the face sinks as part of a half-space that ends nowhere.",
}


def write_report(
    analysis: "Analysis", summary: dict[str, Any], folder: str | Path, render_message: str | None
) -> Path:
    """Write `report.html`.

    Parameters
    ----------
    analysis : Analysis
        A finished analysis.
    summary : dict
        Its `summary.json`.
    folder : path
        The result's folder; the pictures are taken from `figures/*.png` in it.
    render_message : str or None
        Why there is no three-dimensional picture; None where there is one.

    Returns
    -------
    Path
        The file: pictures and styles inside, no script, nothing to load from elsewhere.
    """
    import tomli_w
    from jinja2 import Environment, StrictUndefined

    folder = Path(folder)
    template = Path(__file__).with_name("report.html.j2").read_text(encoding="utf-8")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    problems = sorted(summary["problems"], key=lambda one: SEVERITIES.index(one["severity"]))
    page = environment.from_string(template).render(
        name=summary["name"],
        status=summary["status"],
        version=summary["provenance"]["version"],
        started=summary["provenance"]["started"],
        problems=problems,
        headlines=_headlines(summary),
        limits=_limits(summary, analysis),
        figures=_figures(analysis, folder / "figures", render_message),
        caps=_cap_rows(analysis.caps),
        tables=_tables(summary),
        settings=tomli_w.dumps(analysis.settings.to_dict()),
    )
    path = folder / "report.html"
    path.write_text(page, encoding="utf-8")
    return path


def _headlines(summary: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Return label, value and note of the numbers that come first."""
    families, contact = summary["families"], summary["contact"]
    slip, damping = summary["slip"], summary["damping"]
    peak_loss = damping["peak_loss_factor"]
    at_peak = f"at an amplitude of {engineering(damping['amplitude_at_peak_m'], 'm')}"
    numbers = [
        ("G-caps m, P-caps n", f"{families['m']}, {families['n']}", "families by peak height"),
        ("height difference h", engineering(families["h_m"], "m"), "G-peaks above P-peaks"),
        (
            "normal approach",
            engineering(contact["approach_without_bulk_m"], "m"),
            f"without bulk; {engineering(contact['approach_m'], 'm')} with it",
        ),
        (
            contact_name(contact["model"]),
            _in_contact(contact),
            f"at {contact['preload_N']:.4g} N, model {contact['model'] or DASH}",
        ),
        (
            "normal stiffness",
            engineering(contact["stiffness_N_per_m"], "N/m"),
            "one joint, with bulk" if contact["bulk"] else "one joint, without bulk",
        ),
        (
            "tangential stiffness",
            engineering(slip["tangential_stiffness_N_per_m"], "N/m"),
            "first loading, one joint",
        ),
        (
            "greatest loss factor",
            DASH if peak_loss is None else f"{peak_loss:.3g}",
            at_peak if peak_loss else "no loss below gross slip",
        ),
        (
            "gross slip",
            engineering(damping["gross_slip_amplitude_m"], "m"),
            f"amplitude; {engineering(slip['total_slip_force_N'], 'N')} in one joint",
        ),
    ]
    return [(*one[:2], "not available; see above") if one[1] == DASH else one for one in numbers]


def _limits(summary: dict[str, Any], analysis: "Analysis") -> list[str]:
    """Say in plain words what the model leaves out."""
    material = analysis.settings.material
    limits = [
        "The loss factor is for comparing faces, preloads and designs. Bureau, Caroli and "
        "Baumberger (2003) report that a model of many Mindlin contacts describes the elastic "
        "response of a real interface, but not its dissipation quantitatively. An absolute value "
        "needs a measurement.",
        "Slip follows from the normal curve by the theorem of Ciavarella and Jaeger: constant "
        "preload, one direction of slip, no rotation, equal materials (or no coupling between "
        "normal and tangential deformation), Coulomb friction with one coefficient. Poisson's "
        "effect alone (at 0.3) changes displacement and energy by 0.1 and 0.4 % for one round "
        "contact, by up to 5 and 11 % for waves that leave few contacts.",
    ]
    model = summary["contact"]["model"]
    if model is not None:
        limits.append(f"Contact model {model}: {MISSES[model]}")
        how = "holds" if summary["contact"]["bulk"] else "does not hold"
        limits.append(
            f"The stiffness used {how} the sinking of the half-space as a whole (the bulk term). A "
            "structural model of the parts counts that sinking itself."
        )
    if material.yield_stress_Pa is None:
        limits.append(
            "The model is elastic. No yield stress was given, so plastic flow was not checked."
        )
    limits.append(
        "Only the loss in the joints is counted: not that in the material, at "
        "the clamps or in the air."
    )
    return limits


def _figures(
    analysis: "Analysis", folder: Path, render_message: str | None
) -> list[dict[str, str | None]]:
    """Collect pictures and captions; a picture that is missing carries the reason."""
    figures = []
    for name, entry in FIGURES.items():
        missing = f"It needs {entry.needs}, which this analysis does not have; see the problems."
        if not analysis.settings.run.figures:
            missing = "Figures were switched off (run.figures)."
        failed = [p.message for p in analysis.problems if p.message.startswith(f"{name}.png")]
        missing = failed[0] if failed else missing
        figures.append(_picture(folder, name, entry.title, entry.caption, missing))
    caption = (
        "The face with its fitted caps, slightly lifted. Holes are non-measured points. Heights "
        "are enlarged by the factor printed in the picture."
    )
    missing = f"Reason: {render_message or 'the renderer left no picture'}."
    scene = _picture(folder, "scene", "The face in three dimensions", caption, missing)
    return [*figures[:2], scene, *figures[2:]]


def _picture(
    folder: Path, name: str, title: str, caption: str, missing: str
) -> dict[str, str | None]:
    png = folder / f"{name}.png"
    data = base64.b64encode(png.read_bytes()).decode("ascii") if png.is_file() else None
    return {"name": name, "title": title, "caption": caption, "missing": missing, "data": data}


def _cap_rows(caps: "CapTable") -> dict[str, Any]:
    """Rows of the table of caps, the most loaded first, then the highest."""
    load_N = np.where(np.isfinite(caps.load_N), caps.load_N, -1.0)
    order = np.lexsort((-caps.peak_height_m, -load_N))[:MAX_ROWS]
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
        ("N", {"load": caps.load_N}),
        ("m", {"contact radius": caps.contact_radius_m}),
    ]
    heads, cells = ["cap", "family"], [[str(i + 1) for i in order], list(caps.family[order])]
    for unit, columns in groups:
        values, unit = scaled(np.array(list(columns.values()))[:, order], unit)
        heads += [f"{head} [{unit}]" for head in columns]
        cells += [
            [f"{x:#.4g}".rstrip(".") if np.isfinite(x) else DASH for x in row] for row in values
        ]
    cells.append(list(caps.columns()["flags"][order]))
    rows = [list(row) for row in zip(*cells, strict=True)]
    return {"heads": heads, "rows": rows, "total": len(caps), "more": len(caps) - len(rows)}


def _tables(summary: dict[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the remaining numbers of the summary, grouped, as label and text."""
    surface, hills, families = summary["surface"], summary["hills"], summary["families"]
    contact, slip = summary["contact"], summary["slip"]
    damping, accuracy = summary["damping"], summary["accuracy"]
    (ny, nx), (dy_m, dx_m) = surface["shape"], surface["pixel_size_m"]
    rejected = ", ".join(f"{count} {reason}" for reason, count in hills["rejected"].items())

    def percent(share: float) -> str:
        return f"{100 * share:.3g} %"

    return [
        (
            "Height map",
            [
                ("file", surface["path"] or "given as an array"),
                ("SHA-256", surface["sha256"] or DASH),
                ("points", f"{nx} x {ny} (x, y)"),
                ("pixel", f"{engineering(dx_m, 'm', 4)} x {engineering(dy_m, 'm', 4)}"),
                ("face", f"{engineering(nx * dx_m, 'm')} x {engineering(ny * dy_m, 'm')}"),
                ("non-measured", percent(surface["non_measured_fraction"])),
                ("form removed", surface["form"]),
                ("Sq", engineering(surface["sq_m"], "m")),
                ("Sz", engineering(surface["sz_m"], "m")),
            ],
        ),
        (
            "Hills and families",
            [
                ("material ratio of the cut", percent(hills["material_ratio"])),
                ("cut height", engineering(hills["cut_height_m"], "m")),
                ("points kept", percent(hills["kept_fraction"])),
                ("regions above the cut", str(hills["regions"])),
                ("share of the largest region", percent(hills["largest_region_share"])),
                ("hills", f"{hills['hills']}, {hills['caps']} of them with a sphere"),
                ("rejected", rejected.replace("_", " ") or "none"),
                ("G-caps", _family(families["G"])),
                ("P-caps", _family(families["P"])),
            ],
        ),
        (
            "Contact, slip and damping",
            [
                (
                    "contact model",
                    f"{contact['model'] or DASH}: {accuracy['model_reason'] or DASH}",
                ),
                ("contact area", _area(contact["contact_area_m2"])),
                ("greatest pressure", engineering(contact["max_pressure_Pa"], "Pa")),
                ("friction coefficient", f"{slip['friction_coefficient']:g}"),
                ("total slip, one joint", _total_slip(slip)),
                ("limit of the G-caps", engineering(slip["limit_G_m"], "m")),
                ("limit of the P-caps", engineering(slip["limit_P_m"], "m")),
                ("modal stiffness", engineering(damping["modal_stiffness_N_per_m"], "N/m")),
                ("joint stiffness", engineering(damping["joint_stiffness_N_per_m"], "N/m")),
                ("joints", str(damping["joints"])),
            ],
        ),
        (
            "Provenance",
            [
                (name.replace("_", " "), text or DASH)
                for name, text in summary["provenance"].items()
            ],
        ),
        (
            "Time",
            [(stage, engineering(time_s, "s")) for stage, time_s in summary["timings_s"].items()],
        ),
    ]


def _in_contact(contact: dict[str, Any]) -> str:
    if contact["contacts"] is None:
        return DASH
    return "whole face" if contact["model"] == "flat" else str(contact["contacts"])


def _family(family: dict[str, Any] | None) -> str:
    if family is None:
        return "none"
    return (
        f"{family['count']}: mean R {engineering(family['radius_m'], 'm', 4)}, "
        f"D {engineering(family['diameter_m'], 'm')}, df {engineering(family['height_m'], 'm')}, "
        f"peak height {engineering(family['peak_height_m'], 'm')}"
    )


def _area(area_m2: float | None) -> str:
    """Write an area in mm^2: prefixes of a square mislead."""
    return DASH if area_m2 is None else f"{area_m2 * 1e6:.3g} mm²"


def _total_slip(slip: dict[str, Any]) -> str:
    force = engineering(slip["total_slip_force_N"], "N")
    return f"{force} at {engineering(slip['total_slip_displacement_m'], 'm')}"
