"""Whether a second family lies below the cut at which the caps were counted."""

from collections.abc import Callable

from capslip.caps.families import Families
from capslip.problems import Problem

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
