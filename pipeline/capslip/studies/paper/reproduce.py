"""The paper again: its tables and figures from the corrected equations, on one page."""

import base64
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from capslip.output.quantity import engineering
from capslip.settings import Structure
from capslip.studies.page import png, write
from capslip.studies.paper import printed as paper
from capslip.studies.paper.errata import CERTAINTY, errata, errata_markdown
from capslip.studies.paper.figures import cases_of, figures, loss_factors

SCHEMA = "capslip/reproduce/1"
PARAMETERS = ("m", "n", "delta_n_m", "h_m", "friction_coefficient")


def reproduce(folder: str | Path) -> dict[str, Any]:
    """Compute the paper's numbers and write `reproduce.html`, `.json`, `errata.md` and pictures.

    Parameters
    ----------
    folder : path
        Made where absent; files of the same names are replaced.

    Returns
    -------
    dict
        What `reproduce.json` holds.

    Raises
    ------
    OutputError
        If the folder cannot be made or written.
    """
    found = errata()
    numbers = {
        "schema": SCHEMA,
        "table1": table_1(),
        "table2": _table_2(),
        "loss_factor": _loss_factor(),
        "beam": _beam(),
        "stand_ins": _stand_ins(),
        "errata": [asdict(one) for one in found],
    }
    drawn = {name: (png(draw()), caption) for name, (draw, caption) in figures().items()}
    pictures = {
        name: {"caption": caption, "data": base64.b64encode(data).decode("ascii")}
        for name, (data, caption) in drawn.items()
    }
    texts = {
        "errata.md": errata_markdown(found),
        "reproduce.html": _page(numbers, pictures),
        "reproduce.json": json.dumps(numbers, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
    }
    write(folder, {**texts, **{f"{name}.png": data for name, (data, _) in drawn.items()}})
    return numbers


def table_1() -> list[dict[str, Any]]:
    """Return the fourteen printed loads beside those computed.

    `computed_N` has E = 200 GPa, `computed_220_N` the printed 220 GPa, and
    `computed_220_without_nu_N` the printed modulus with E* = E / 2.

    Examples
    --------
    >>> max(abs(row["relative_error"]) for row in table_1()) < 0.0012
    True
    """
    rows = []
    right, printed = paper.steel(), paper.steel(paper.YOUNGS_MODULUS_PA)
    for case in paper.TABLE_1:
        computed_N = paper.joint(case, right).preload_N
        printed_modulus_N = paper.joint(case, printed).preload_N
        half_N = computed_N * paper.YOUNGS_MODULUS_PA / 2 / right.E_star_Pa  # N is linear in E*
        rows.append(
            {
                **asdict(case),
                "figures": list(case.figures),
                "computed_N": computed_N,
                "relative_error": computed_N / case.printed_N - 1,
                "computed_220_N": printed_modulus_N,
                "relative_error_220": printed_modulus_N / case.printed_N - 1,
                "computed_220_without_nu_N": half_N,
                "relative_error_220_without_nu": half_N / case.printed_N - 1,
            }
        )
    return rows


def _table_2() -> list[dict[str, Any]]:
    return [
        {
            "family": row.family,
            "count": row.count,
            "cap_height_m": row.cap_height_m,
            "diameter_m": row.diameter_m,
            "printed_radius_m": row.radius_m,
            "computed_radius_m": paper.radius_of_eq_18_m(row.diameter_m, row.cap_height_m),
            "diameter_for_printed_radius_m": paper.diameter_of_eq_18_m(
                row.radius_m, row.cap_height_m
            ),
        }
        for row in paper.TABLE_2
    ]


def _loss_factor() -> list[dict[str, Any]]:
    """First maximum, and the end at gross slip, of every curve of Fig. 7."""
    rows = []
    for part in ("7a", "7b", "7c", "7d", "7e", "7f"):
        for case in cases_of(part)[0 if part == "7a" else 1 :]:
            damping, printed = loss_factors(case)
            eta = damping.loss_factor
            inner = np.flatnonzero((eta[1:-1] > eta[:-2]) & (eta[1:-1] > eta[2:])) + 1
            first = int(inner[0]) if inner.size else None
            jump = int(np.argmax(printed[:-1] / printed[1:]))
            rows.append(
                {
                    "figure": part,
                    **{name: getattr(case, name) for name in PARAMETERS},
                    "first_peak_amplitude_m": None
                    if first is None
                    else float(damping.amplitude_m[first]),
                    "first_peak_loss_factor": None if first is None else float(eta[first]),
                    "gross_slip_amplitude_m": damping.gross_slip_amplitude_m,
                    "gross_slip_loss_factor": float(eta[-1]),
                    "printed_eq_16_jump_amplitude_m": float(damping.amplitude_m[jump]),
                    "printed_eq_16_before_jump": float(printed[jump]),
                    "printed_eq_16_after_jump": float(printed[jump + 1]),
                }
            )
    return rows


def _beam() -> dict[str, Any]:
    """Appendix B: where the moment vanishes, and modal over quasi-static shear."""
    thicknesses_m = (0.01, 0.02, 0.03, 0.04, 0.06, 0.1)
    rows = [
        ("euler_bernoulli", None, paper.stand_in_beam(theory="euler_bernoulli")),
        *(
            ("timoshenko", x, paper.stand_in_beam(theory="timoshenko", thickness_m=x))
            for x in thicknesses_m
        ),
    ]
    # Every thickness from 1/80 to 1/4 of the length, and those whose place rounds to the printed.
    scanned_m = np.arange(0.005, 0.1001, 0.0005)
    scanned = [paper.stand_in_beam(theory="timoshenko", thickness_m=float(x)) for x in scanned_m]
    place_m = np.array([mode.zero_moment_position_m for mode in scanned])
    agreeing_m = scanned_m[np.abs(place_m - 0.0896) < 0.5e-4]
    return {
        "agreeing_thickness_m": [float(agreeing_m.min()), float(agreeing_m.max())],
        "greatest_shear_ratio": max(mode.quasi_static_ratio for mode in scanned),
        "printed_zero_moment_position_m": 0.0896,
        "printed_shear_ratio": 1.20,
        "rows": [
            {
                "theory": theory,
                "thickness_m": thickness_m,
                "zero_moment_position_m": mode.zero_moment_position_m,
                "shear_ratio": mode.quasi_static_ratio,
            }
            for theory, thickness_m, mode in rows
        ],
    }


def _stand_ins() -> list[dict[str, str]]:
    structure, mode = Structure(), paper.stand_in_beam()
    beam = structure.beam
    K_m = engineering(mode.modal_stiffness_N_per_m, "N/m")
    K_s = engineering(mode.joint_stiffness_N_per_m, "N/m")
    rows = [
        (
            "section of the beam",
            f"{beam.width_m * 1e3:g} x {beam.thickness_m * 1e3:g} mm (width x thickness), constant",
        ),
        ("length", f"{beam.length_m * 1e3:g} mm (the cuts are printed at 89.6 and 310.4 mm)"),
        ("density", f"{beam.density_kg_per_m3:g} kg/m3"),
        ("theory", beam.theory.replace("_", "-").capitalize()),
        ("modal stiffness K_m", f"{K_m}, of that beam"),
        ("shear in a joint a unit of v, K_s (K_mcis)", f"{K_s}, of that beam"),
        ("joints that count", f"{structure.joints} (the paper has two and does not say)"),
        ("v", "mid-span displacement of the beam, without that of the joints"),
        ("from v to delta", "T = K_s v, then delta(T) of the joint; the paper prints no link"),
        ("preload", "that of delta_n printed, so 460.4 N where the table rounds to 460 N"),
        ("steel", "E = 200 GPa, nu = 0.3, see the erratum on Table 1"),
    ]
    return [{"quantity": name, "value": value} for name, value in rows]


def _page(numbers: dict[str, Any], pictures: dict[str, dict[str, str]]) -> str:
    from jinja2 import Environment, StrictUndefined

    from capslip import __version__

    template = Path(__file__).with_name("reproduce.html.j2").read_text(encoding="utf-8")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["quantity"] = engineering
    return environment.from_string(template).render(
        **numbers,
        version=__version__,
        certainty=CERTAINTY,
        pictures=pictures,
        worst_percent=100 * max(abs(row["relative_error"]) for row in numbers["table1"]),
    )
