"""All axes along which the method is driven until it breaks."""

from capslip.studies.limits_cases import Axis
from capslip.studies.limits_faces import axes_of_faces
from capslip.studies.limits_levelling import axes_of_levelling
from capslip.studies.limits_scans import axes_of_scans


def axes(seed: int = 0) -> tuple[Axis, ...]:
    """Return all axes.

    Parameters
    ----------
    seed : int
        Another one gives other faces, and other noise, of the same kinds.

    Examples
    --------
    >>> found = axes()
    >>> len(found) >= 16, sum(len(axis.cases) for axis in found) >= 400
    (True, True)
    """
    return (*axes_of_faces(seed), *axes_of_scans(seed), *axes_of_levelling(seed))
