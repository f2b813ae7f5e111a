"""All axes along which the method is driven until it breaks."""

from pipeline.studies.limits_cases import Axis
from pipeline.studies.limits_faces import axes_of_faces
from pipeline.studies.limits_levelling import axes_of_levelling
from pipeline.studies.limits_scans import axes_of_scans


def axes() -> tuple[Axis, ...]:
    """Return all axes.

    Examples
    --------
    >>> found = axes()
    >>> len(found) >= 16, sum(len(axis.cases) for axis in found) >= 400
    (True, True)
    """
    return (*axes_of_faces(), *axes_of_scans(), *axes_of_levelling())
