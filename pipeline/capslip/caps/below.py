"""Whether caps that are of a family lie below the cut at which the families were counted."""

from collections.abc import Callable

import numpy as np

from capslip.caps.families import ODD, Families
from capslip.caps.table import CapTable
from capslip.problems import Problem
from capslip.surface.heightmap import HeightMap

DEEPER = (1.5, 2.0)  # times the share of the points above the cut


def family_below_cut(
    families: Families, material_ratio: float, counted: Callable[[float], Families]
) -> list[Problem]:
    """Return whether more of the face shows lower caps as a second family beside the same first.

    One cap is no family: the floor between the hills often comes up as one piece.

    Parameters
    ----------
    families : Families
        Of the caps above the cut.
    material_ratio : float
        Of that cut.
    counted : callable
        Finds the families above the cut at another material ratio.
    """
    if families.count != 1:
        return []
    for deeper in DEEPER:
        ratio = deeper * material_ratio
        if ratio >= 1.0:
            break
        found = counted(ratio)
        if found.m == families.m and found.n >= 2:
            message = (
                f"a cut of {100 * ratio:.3g} % shows {found.n} P-caps beside the {found.m} G-caps: "
                f"a second family lies below the cut of {100 * material_ratio:.3g} %, and m, n and "
                "h do not know it"
            )
            return [Problem("family_below_cut", "warning", message)]
    return []


def with_families(
    caps: CapTable, surface: HeightMap, label: np.ndarray, counted: CapTable
) -> CapTable:
    """Return the caps of a pressed face with the families of the hills that they stand on.

    Where their apex was not measured, with that of the nearest cap that they stand within.

    Parameters
    ----------
    caps : CapTable
        Of the pressed face.
    surface : HeightMap
        That face.
    label : int, shape (ny, nx)
        Hills of the caps that were counted, 1 ... n; 0 elsewhere.
    counted : CapTable
        These caps, with their families.
    """
    name = np.append("", counted.family)[label[surface.pixel_at(caps.x_m, caps.y_m)]]
    for i in np.flatnonzero(caps.usable & (name == "") & (len(counted) > 0)):
        away_m = np.hypot(counted.x_m - caps.x_m[i], counted.y_m - caps.y_m[i])
        near = int(np.argmin(away_m))
        name[i] = counted.family[near] if away_m[near] < 0.5 * counted.diameter_m[near] else ""
    return caps.with_columns(family=np.where(caps.usable, name, ""))


def caps_below_cut(caps: CapTable, families: Families, material_ratio: float) -> list[Problem]:
    """Return whether caps that a deeper cut found for the pressed face are in no family.

    Parameters
    ----------
    caps : CapTable
        Of the pressed face, with the families of the hills that they stand on.
    families : Families
        Of the caps above the cut.
    material_ratio : float
        Of that cut.
    """
    standing = caps.usable & ((caps.flags & ODD) == 0)  # whose apexes lie on their own hills
    below = int(np.count_nonzero(standing & (caps.family == "")))
    if below == 0 or families.count == 0:
        return []
    message = (
        f"{below} of {np.count_nonzero(standing)} caps that the load may reach stand below the cut "
        f"of {100 * material_ratio:.3g} % at which families are counted: m, n and h do not know "
        f"{'it' if below == 1 else 'them'}"
    )
    return [Problem("family_below_cut", "warning", message)]
