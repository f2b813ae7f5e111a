"""The law of a joint face per area: tables, and what other programs read of it."""

import csv
import inspect
import json
import math
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.caps_hold import caps_hold
from capslip.disk import hdf5_in_memory
from capslip.errors import ContactError
from capslip.output.export import Export, inexact, refuse_varying
from capslip.pressing import error_under, finding_caps_anew
from capslip.problems import Problem
from capslip.result import Analysis, JointOfScans
from capslip.structure import interpolation
from capslip.structure.interpolation import LOADS, tables_of
from capslip.structure.law import JENKINS_TOLERANCE, SCATTERS, Law, law
from capslip.structure.law_errors import ASKED_SHARE

if TYPE_CHECKING:
    from capslip.result import JointResult
    from capslip.settings import Settings

SCHEMA = "capslip/law/1"
UNITS = {
    "pressure_Pa": "Pa",
    "closure_m": "m",
    "normal_stiffness_Pa_per_m": "Pa/m",
    "tangential_stiffness_Pa_per_m": "Pa/m",
    "total_slip_displacement_m": "m",
    "displacement_m": "m",
    "shear_Pa": "Pa",
    "loss_J_per_m2": "J/m^2",
    "bed_closure_m": "m",
    "bed_stiffness_Pa_per_m": "Pa/m",
    "friction_coefficient": "1",
    "kappa": "1",
    "share": "1",
    "range_Pa": "Pa",
    "slider_stiffness_Pa_per_m": "Pa/m",
    "slider_shear_Pa": "Pa",
}
UNITS |= {column: UNITS[name] for name, column in SCATTERS.items()}
FILES = ("law.csv", "law.h5", "law.json", "law.py", "law_jenkins.csv")
NOTES: dict[str, list[str]] = {
    "calculix": [
        "** With CONTACT PAIR, TYPE=NODE TO SURFACE: version 2.20 carries nothing by a table in",
        "** face-to-face contact (measured on two blocks).",
    ],
    "abaqus": [],
}
BY_PRESSURE = (
    "pressure_Pa",
    "closure_m",
    "normal_stiffness_Pa_per_m",
    "tangential_stiffness_Pa_per_m",
    "total_slip_displacement_m",
)
OF_SCANS = (
    "Every scan bears the pressure p and all move by the same delta: stiffness, tau and w are the "
    "means over the scans, the columns of scatter their standard deviation. The scans "
    "close together, by dp over that stiffness; the displacement at gross slip is that of the one "
    "that goes last."
)
APPROACH, RECOVERY = (
    "the approach of the faces from first touch",
    "what the faces recover on unloading",
)
HOLDS = "Holds: "
UNUSABLE = 1.0  # relative error from which a law tells nothing; infinite where none is known
LEAST_LEFT = 1e-9  # of a pressure, of which a difference of two tells something
BY_BOTH = ("displacement_m", "shear_Pa", "loss_J_per_m2")
DECKS = {"calculix": "law_calculix.inp", "abaqus": "law_abaqus.inp"}


def write(result: "JointResult", folder: Path) -> tuple[Problem, ...]:
    """Write the law as `law.csv`, `law.h5`, `law.json`, and for other programs.

    Raises
    ------
    ContactError
        If there is no slip curve, see also `structure.law.law`.
    """
    if not result.parts:
        raise ContactError("it needs a slip curve, which this analysis does not have")
    if (reason := _ruled_out(result.settings)) is not None:
        raise ContactError(reason)

    def holds(factor: float) -> bool:
        return all(_holds(scan, factor) for scan in _scans(result))

    parts, scans = list(result.parts), _scans(result)
    for i, scan in enumerate(scans):  # of given families there are none
        contact = finding_caps_anew(scan.face, parts[i].contact, scan.settings)
        parts[i] = replace(parts[i], contact=contact)
    found = law(parts, result.settings.material.friction_coefficient, holds)
    problems = _inexact(found, result.settings.contact.tolerance)
    result = replace(result, problems=(*result.problems, *problems))
    doubts = [f"{p.code}: {p.message}" for p in result.problems if p.severity != "info"]
    of_least = float(found.pressure_Pa[0]) / found.scan_pressure_Pa
    doubts += _without_level(found)
    least = _error_at(result, of_least)
    if least is not None and not all(part.joint.is_even for part in result.parts):
        found = replace(found, model_error=_error_at(result, 1.0))  # not that of the joint
    write_law(found, folder, result.name, result.status, doubts, least)
    return problems


def _ruled_out(settings: "Settings") -> str | None:
    return refuse_varying(settings, "it is a law under a constant pressure")


def _inexact(found: Law, tolerance: float) -> tuple[Problem, ...]:
    """Return what `law.py` and the sliders are less good at than the contact model."""
    of_sliders = inexact("law_jenkins.csv", found.elements, JENKINS_TOLERANCE, tolerance)
    worst = max(found.shear_error, found.loss_error, found.stiffness_error)
    if worst <= tolerance:
        return of_sliders
    message = (
        f"law.py differs from the contact model {_off(found)}; take the pressures of law.csv where "
        "this is too much"
    )
    # What real joints lose is known no better than by a factor of two: less is for who uses it
    told = Problem("export_inexact", "warning" if worst >= UNUSABLE else "info", message)
    return (told, *of_sliders)


def _without_level(found: Law) -> list[str]:
    """Say where the face lies as it was analysed, as it finds no level of its own."""
    if not found.no_level_Pa:
        return []
    least, most = min(found.no_level_Pa), max(found.no_level_Pa)
    return [
        f"level: no level is found under {len(found.no_level_Pa)} of the {found.pressure_Pa.size} "
        f"pressures, from {least:.4g} to {most:.4g} Pa: there the face lies as under "
        f"{found.scan_pressure_Pa:.4g} Pa, and k_t and w may be off by a factor of two"
    ]


def _error_at(result: "JointResult", factor: float) -> float | None:
    """Return the error of the model under the load of its scans times a factor.

    None where it is not known of a scan under its own load; infinite where it is not under that.
    """
    errors = []
    for scan in _scans(result):
        contact = scan.contact
        if contact is None or (contact.errors is None and contact.rung.error is None):
            return None
        load_N = contact.preload_N * factor
        errors.append(error_under(scan.face, contact, load_N, result.settings))
    return max((math.inf if one is None else one.greatest for one in errors), default=None)


def _scans(result: "JointResult") -> tuple[Analysis, ...]:
    """Return the scans of the parts."""
    if isinstance(result, JointOfScans):
        return result.known
    return (result,) if isinstance(result, Analysis) else ()


def _holds(scan: Analysis, factor: float) -> bool:
    """Tell whether the caps of a scan are all that touches under its load times a factor."""
    contact = scan.contact
    if contact is None or contact.rung.made_from != "spheres":
        return True
    return caps_hold(scan.face, contact, contact.preload_N * factor, scan.settings)


def write_law(
    found: Law,
    folder: Path,
    name: str,
    status: str,
    doubts: list[str],
    least: float | None = None,
) -> None:
    """Write a law into a folder; the doubts of the analysis go with it, see `about`."""
    page = about(found, name, status, doubts, least)
    head = {"schema": SCHEMA, "about": page, "units": UNITS, "model": found.model}
    document: dict[str, Any] = {**head, "scans": found.scans, **_columns(found), **found.tables()}
    text = json.dumps(
        document, indent=1, ensure_ascii=False, allow_nan=False, default=np.ndarray.tolist
    )
    (folder / "law.json").write_text(f"{text}\n", encoding="utf-8")
    (folder / "law.py").write_text(inspect.getsource(interpolation), encoding="utf-8")
    for program, file in DECKS.items():
        (folder / file).write_text(deck(found, program, page), encoding="utf-8")
    _write_csv(folder / "law.csv", page, _rows(found))
    _write_csv(folder / "law_jenkins.csv", [*page, "", *_how_to_slide(found)], _sliders(found))
    _write_hdf5(found, page, folder / "law.h5")


def _columns(found: Law) -> dict[str, np.ndarray]:
    """Return all columns by name."""
    columns = {name: getattr(found, name) for name in (*BY_PRESSURE, *BY_BOTH)}
    return columns | found.scatter


def about(
    found: Law, name: str, status: str, doubts: list[str], least: float | None = None
) -> list[str]:
    """Return the page that goes with the numbers, in lines: what, how to use, how far it holds.

    `least` is the error of the model under the least pressure, where it is known for itself.
    """
    p, mu, D = found.pressure_Pa, found.friction_coefficient, found.total_slip_displacement_m
    error = "not known" if found.model_error is None else f"{found.model_error:.1%}"
    if least is not None:
        known = f"{least:.1%}" if math.isfinite(least) else "not known"
        error += f"; at {p[0]:.4g} Pa, where the least of the face touches: {known}"
    bulk = (
        "It HOLDS the sinking of a half-space of the size of the scan, which a finite-element body "
        "has already: taken twice, the joint is too soft."
        if found.holds_bulk
        else "The sinking of the bodies below it is not in it: the structure has that."
    )
    yields = (
        "elastic contacts. "
        if found.hardness_Pa is None
        else f"contacts that yielded at {found.hardness_Pa / 1e9:.3g} GPa when each pressure was "
        "reached for the first time, and unload and slip elastically: the closure and its "
        "stiffness are those of unloading, and a face that bore more before is stiffer. "
    )
    level = (
        "each pressure at the level that the face finds under it, which stays while it slips and "
        "unloads"
        if found.finds_levels
        else f"the tilt as under {found.scan_pressure_Pa:.4g} Pa"
    )
    closure = APPROACH if found.hardness_Pa is None else RECOVERY
    scanned = (
        f"scan of {found.area_m2:.6g} m2"
        if found.scans == 1
        else f"mean of {found.scans} scans by their areas ({found.area_m2:.6g} m2 in all)"
    )
    return [
        f"Law of the joint face {name} per nominal area, by capslip (status: {status}).",
        f"Contact model {found.model}, {scanned}, analysed under "
        f"{found.scan_pressure_Pa:.6g} Pa, friction coefficient {mu:g}.",
        *([] if found.scans == 1 else [OF_SCANS]),
        "",
        f"What: under each nominal pressure p {closure} (closure), "
        "the stiffness dp/d closure, the shear stiffness before slip, the shear stress tau on "
        "first loading over the relative displacement delta, and the energy w per area lost in a "
        "cycle between -delta and delta. SI; every column names its unit.",
        "How: times the area of a patch these are forces and energies. Unloading is twice the "
        "first loading at half the displacement (Masing). From the displacement D at gross slip on "
        "tau = mu p and w grows by 4 mu p per metre.",
        "law.csv and law.h5 hold these for some pressures and displacements; law.py (numpy alone) "
        "reads law.json and gives them for any. law_jenkins.csv: sliders "
        "for harmonic balance; law_calculix.inp, law_abaqus.inp: cards of a surface interaction.",
        f"{HOLDS}{p[0]:.4g} to {p[-1]:.4g} Pa, D from {D.min():.3g} to {D.max():.3g} m. It ends "
        f"there: {found.ends}.",
        f"Constant pressure and no turning during a cycle, one direction of slip, {level}, {yields}"
        f"{bulk}",
        f"Error: of the model, estimated at {found.scan_pressure_Pa:.4g} Pa: {error}. Of law.py "
        f"against the model, {_off(found)}, measured {_measured_at(found)}. The dissipation of "
        "real joints is known to a factor of two to three at best (Bureau, Caroli and Baumberger "
        "2003).",
        *(["", "What makes it doubtful:"] if doubts else []),
        *(f"- {doubt}" for doubt in doubts),
    ]


def _measured_at(found: Law) -> str:
    """Return where `law.py` was compared with the model."""
    if found.halfway:
        return (
            "between its pressures, solved there, too: contacts that touch in between are "
            "smeared, so take the pressures of law.csv where this is too much"
        )
    between = "" if found.has_beds_alone else " and at the quarters between them"
    return f"at the pressures of law.csv{between}"


def _off(found: Law) -> str:
    """Return by how much `law.py` may be off, and from which share of mu p on."""
    shear, loss, stiffness = (
        f"up to {one:.1%}" if np.isfinite(one) else "not known how much"
        for one in (found.shear_error, found.loss_error, found.stiffness_error)
    )
    before = f"{stiffness} of the stiffness before slip"
    low, high = found.resolved_share.min(), found.resolved_share.max()
    if high <= ASKED_SHARE:
        return f"{before}; from a tenth of mu p on: {shear} of tau and {loss} of w"
    return (
        f"{before}; from a tenth of mu p on: {shear} of tau; from {low:.0%} to {high:.0%} of mu p "
        f"on, differing with p: {loss} of w, while below that less slips than the pixels of the "
        "map resolve, and w may be off by more than its own value between two pressures"
    )


def deck(found: Law, program: str, page: Iterable[str]) -> str:
    """Return the cards of one surface interaction, in SI: metres, newtons, pascals.

    Both programs read pressure, overclosure and interpolate by straight lines. CalculiX takes a
    stick slope after the friction coefficient, one for all pressures; Abaqus the slip
    mu p / k_t up to which it is elastic, which makes the slope follow the pressure.
    """
    i = found.at_scan_pressure
    p, mu = float(found.pressure_Pa[i]), found.friction_coefficient
    stick = float(found.tangential_stiffness_Pa_per_m[i])
    cards = {
        "calculix": (
            "overclosures by 1e3 and divide the stick slope by 1e9.",
            "stick slope k_t in Pa/m",
            "*FRICTION",
            _card(mu, stick),
        ),
        "abaqus": (
            "overclosures and the elastic slip by 1e3.",
            "elastic slip mu p / k_t in m",
            f"*FRICTION, ELASTIC SLIP={_card(mu * p / stick)}",
            _card(mu),
        ),
    }
    in_mm, what, *friction = cards[program]
    table = _overclosure(found)
    # One range in one file: the page is that of law.csv, whose pressures may be others
    holds = f"{HOLDS}up to {table[-1][0]:.4g} Pa, where the table ends: keep to less."
    page = [holds if text.startswith(HOLDS) else text for text in page]
    lines = [
        *(f"** {line}".rstrip() for text in page for line in textwrap.wrap(text, 90) or [""]),
        "**",
        "** Metres, newtons and pascals; in mm, N and MPa divide pressures by 1e6, multiply",
        f"** {in_mm}",
        *NOTES[program],
        "*SURFACE INTERACTION, NAME=CAPSLIP",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR",
        _card(0.0, 0.0),
        *(_card(*row) for row in table),
        f"** {what}, at {p:.6g} Pa; take k_t of law.csv at another pressure",
        *friction,
    ]
    return "\n".join(lines) + "\n"


def _overclosure(found: Law) -> list[tuple[float, float]]:
    """Return pressures and closures: below the pressure of the scan alone, where each has its own.

    There it unloads, by p(d - e) = p - tau(mu kappa e) / mu, to where nothing is left of p; scans
    do so together.
    """
    if found.has_beds_alone:
        return list(zip(found.pressure_Pa.tolist(), found.closure_m.tolist(), strict=True))
    i, mu = found.at_scan_pressure, found.friction_coefficient
    most_Pa, most_m = float(found.pressure_Pa[i]), float(found.closure_m[i])
    if found.scans > 1:
        z = tables_of(found.tables()).closures_m(most_Pa)
        p, z = LOADS * most_Pa, most_m * z / z[-1]
        return list(zip(p.tolist(), z.tolist(), strict=True))
    tau, e = found.shear_Pa[i], found.displacement_m[i] / (mu * found.kappa)
    p, z = most_Pa - tau[::-1] / mu, most_m - e[::-1]
    left = p > LEAST_LEFT * most_Pa
    return [*zip(p[left].tolist(), z[left].tolist(), strict=True), (most_Pa, most_m)]


def _card(*values: float) -> str:
    """Return a data line; a field of more than 20 characters is cut off by its reader."""
    return ", ".join(f"{value:.12e}" for value in values)


def _how_to_slide(found: Law) -> list[str]:
    worst = max(elements.energy_error for elements in found.elements)
    return [
        "Each row is a spring in series with a Coulomb slider, all rows of one pressure in "
        "parallel. Times the area of a patch: stiffness in N/m, slip force in N.",
        "tmdsimpy: one JenkinsForce(Q, T, kt, Fs) a row, kt = area * stiffness, Fs = area * shear.",
        f"pyHarm: one Jenkins a row, k = area * stiffness, mu = {found.friction_coefficient:g}, "
        "N0 = area * shear / mu.",
        f"The energy of a cycle is within {worst:.2g} (asked: {JENKINS_TOLERANCE:g}) from a "
        "hundredth of the displacement at gross slip on; below it up to some two times as much "
        "is lost, and nothing in the end.",
    ]


def _rows(found: Law) -> tuple[list[str], Iterator[tuple[float, ...]]]:
    """Return names and rows of the long form: one row for each pressure and displacement."""
    columns = _columns(found)
    shape = found.shear_Pa.shape
    wide = (
        np.broadcast_to(one if one.ndim == 2 else one[:, None], shape) for one in columns.values()
    )
    return list(columns), zip(*(one.ravel().tolist() for one in wide), strict=True)


def _sliders(found: Law) -> tuple[list[str], Iterator[tuple[float, ...]]]:
    rows = (
        (p, stiffness, shear)
        for p, elements in zip(found.pressure_Pa.tolist(), found.elements, strict=True)
        for stiffness, shear in zip(
            elements.stiffness_N_per_m.tolist(), elements.slip_force_N.tolist(), strict=True
        )
    )
    return ["pressure_Pa", "slider_stiffness_Pa_per_m", "slider_shear_Pa"], rows


def _write_csv(
    path: Path, page: Iterable[str], table: tuple[list[str], Iterator[tuple[float, ...]]]
) -> None:
    names, rows = table
    with path.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {line}".rstrip() + "\n" for line in page)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([repr(value) for value in row] for row in rows)


def _write_hdf5(found: Law, page: Iterable[str], path: Path) -> None:
    names, rows = _sliders(found)
    with hdf5_in_memory(path) as file:
        file.attrs["schema"] = SCHEMA
        file.attrs["about"] = "\n".join(page)
        file.attrs["scans"] = found.scans
        columns = _columns(found) | found.tables()
        for i, scan in enumerate(columns.pop("of_scans", ())):
            columns |= {f"of_scans/{i}/{name}": values for name, values in scan.items()}
        for name, values in columns.items():
            file.create_dataset(name, data=values).attrs["unit"] = UNITS[name.rpartition("/")[2]]
        sliders = np.array(list(rows))
        for name, column in zip(names, sliders.T, strict=True):
            file.create_dataset(f"sliders/{name}", data=column).attrs["unit"] = UNITS[name]


EXPORT = Export((*FILES, *DECKS.values()), write, _ruled_out)
