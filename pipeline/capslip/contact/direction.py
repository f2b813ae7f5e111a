"""Slip in one direction: kappa of a face whose contacts are long, or lie in rows."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from capslip.caps.table import CapTable
from capslip.contact.bulk import energies_of_outline
from capslip.contact.curve import NormalCurve
from capslip.contact.lay import (
    LATER,
    Energies,
    Lay,
    axis_ratio,
    deviator_of_ellipse,
    energies_of_contacts,
    energies_of_map,
)
from capslip.contact.material import yield_law
from capslip.contact.press import ContactState
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.problems import Effect, Problem
from capslip.settings import Settings
from capslip.surface.heightmap import HeightMap


def with_direction(
    contact: ContactState, caps: CapTable, surface: HeightMap, settings: Settings
) -> ContactState:
    """Return a pressed face with kappa of the direction of slip, and how that depends on it.

    Parameters
    ----------
    contact : ContactState
        Under its preload.
    caps : CapTable
        With the loads and contact radii of that state.
    surface : HeightMap
        That was pressed.
    settings : Settings
        `slip.direction_rad`, absent for the mean over all directions; `contact.tolerance`.

    Returns
    -------
    ContactState
        With `lay`, and kappa of the direction in its composite, under other loads as well: what
        touches there is as long, and lies in rows, in its own way. Where the direction, or that the
        energy has the same kappa, moves more than the tolerance, a problem says so.

    Notes
    -----
    Caps are ellipses by their principal radii. The contact of boundary elements is taken as it is,
    under the tractions of a punch and of partial slip. Either is exact for one ellipse, before any
    slip and in partial slip (Mindlin, J. Appl. Mech. 16 (1949) 259; Vermeulen and Johnson, J. Appl.
    Mech. 31 (1964) 338), and has an error of second order for others: `docs/theory.md`, section 2.
    """
    joint, direction_rad = contact.composite, settings.slip.direction_rad
    lay = _lay(contact, caps, surface)
    problem = _problem(lay, direction_rad, settings.contact.tolerance)
    problems = contact.problems if problem is None else (*contact.problems, problem)
    directed = replace(joint, kappa=lay.kappa(direction_rad))
    kappa_along = None
    if direction_rad is not None and not _is_alike(contact):
        kappa_along = _kappa_along(contact, caps, surface, settings)
    found = replace(contact, composite=directed, lay=lay, problems=problems)
    return replace(found, kappa_along=kappa_along)


def _is_alike(contact: ContactState) -> bool:
    """Tell whether kappa is the same in all directions, whatever touches."""
    return contact.rung.made_from == "nothing" or contact.composite.kappa == 1.0


def _kappa_along(
    contact: ContactState, caps: CapTable, surface: HeightMap, settings: Settings
) -> Callable[..., float]:
    """Return what finds kappa of the direction along a curve of the same face, under any load."""

    @cache  # answer and band ask again
    def kappa_along(curve: NormalCurve, load_N: float) -> float:
        state = contact.under(load_N, curve)
        loaded = caps
        if state.rung.made_from == "spheres":
            loaded = _under(caps, state, settings)
        return _lay(state, loaded, surface).kappa(settings.slip.direction_rad)

    return kappa_along


def _under(caps: CapTable, state: ContactState, settings: Settings) -> CapTable:
    """Return caps, as they were before any load, with loads and contact radii of a state."""
    normal: Any = state.normal
    if state.rung.coupled_loads_N is not None:
        row_N = state.rung.coupled_loads_N(normal, state.preload_N)
    else:
        row_N = normal.asperity_loads_N(normal.approach_m(state.preload_N))
    load_N, radius_m, law = np.zeros(len(caps)), caps.radius_m, yield_law(settings.material)
    if state.rung.knows_places:
        load_N[state.use] = row_N
    else:
        for name, N in zip(state.row_family, row_N, strict=True):
            load_N[caps.family == name] = N
    if law is not None:
        radius_m, _ = law.flattened(load_N, radius_m)
    a_m = contact_radius_m(load_N, radius_m, state.composite.E_star_Pa)
    return caps.with_columns(load_N=load_N, contact_radius_m=a_m)


def _lay(contact: ContactState, caps: CapTable, surface: HeightMap) -> Lay:
    joint, model = contact.composite, contact.rung
    none = Lay(joint.kappa, 0j, 0j)
    if _is_alike(contact):
        return none
    if model.tractions is not None:
        tractions = model.tractions(contact.normal, contact.preload_N, LATER)
        punch, later = energies_of_map(tractions, surface.pixel_size_m)
    else:
        loaded = np.flatnonzero(caps.load_N > 0.0)
        if not loaded.size:
            return none
        punch, later = _of_caps(contact, caps, loaded)
    bulk = 0j
    if model.interacts and not contact.bulk:
        bulk = energies_of_outline(surface).deviator
    curve, load_N = contact.curve, contact.preload_N
    stiffness_N_per_m = float(curve.stiffness_N_per_m(curve.approach_m(load_N)))
    return punch.lay(later, joint.kappa, bulk, joint.E_star_Pa / stiffness_N_per_m)


def _of_caps(
    contact: ContactState, caps: CapTable, loaded: np.ndarray
) -> tuple[Energies, Energies]:
    ratio = caps.radius_minor_m[loaded] / caps.radius_major_m[loaded]
    known = (ratio > 0.0) & (ratio < 1.0)
    own = deviator_of_ellipse(axis_ratio(np.where(known, ratio, 1.0)))
    turn = np.exp(2j * np.where(known, caps.orientation_rad[loaded], 0.0))
    later_N, places_m = None, None
    if contact.rung.coupled_loads_N is not None:
        later = np.zeros(len(caps))
        later[contact.use] = contact.rung.coupled_loads_N(contact.normal, LATER * contact.preload_N)
        later_N, places_m = later[loaded], np.stack((caps.x_m[loaded], caps.y_m[loaded]))
    given = caps.contact_radius_m[loaded], caps.load_N[loaded], later_N
    return energies_of_contacts(*given, own * turn, places_m, contact.composite.E_star_Pa)


def _problem(lay: Lay, direction_rad: float | None, tolerance: float) -> Problem | None:
    """Return what the direction does to stiffness and energy, where it is beyond the tolerance."""
    _, open_energy = lay.left_open(direction_rad)
    energy_off = abs(open_energy)
    if direction_rad is not None:
        if energy_off <= tolerance:
            return None
        message = (
            f"kappa of slip at {round(math.degrees(direction_rad))} degrees from x is "
            f"{lay.kappa(direction_rad):.3f} before any slip; the energy would want another one, "
            f"and is off by {energy_off:.1%}"
        )
        effect = Effect(None, energy_off, energy_off)
        return Problem("slip_direction_matters", "info", message, effect)
    if max(lay.swing, energy_off) <= tolerance:
        return None
    least, greatest = lay.kappa_range
    stiffer = lay.round_kappa / least - 1.0  # across, where more is open than along: K ~ 1 / kappa
    message = (
        f"contacts are long or lie in rows: kappa is {greatest:.3f} where slip is at "
        f"{round(math.degrees(lay.softest_rad))} degrees from x, {least:.3f} across that, and "
        f"{lay.round_kappa:.3f} was taken, the mean over all directions: the stiffness is off by "
        f"up to {stiffer:.1%}, the energy by {energy_off:.1%}"
    )
    effect = Effect(stiffer, energy_off, energy_off)
    return Problem("slip_direction_matters", "info", message, effect)
