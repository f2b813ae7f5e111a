"""Caps of two faces in one table: the paper's way to treat a joint."""

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np

from capslip.caps.table import CapTable

Place = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def join_faces(first: CapTable, second: CapTable, on_first: Place, rotation_rad: float) -> CapTable:
    """Join the caps of two mated faces, as if one plane met them all.

    The paper counts the caps of both faces and takes one face as flat (its section 3). Heights
    stay those above each face's own form.

    Parameters
    ----------
    first, second : CapTable
        Caps of each face.
    on_first : callable
        Takes x and y on the second face, in metres, and gives the place on the first one.
    rotation_rad : float
        Angle by which the second face is turned, for the orientation of its caps.

    Returns
    -------
    CapTable
        The caps of the first face, then those of the second.
    """
    x_m, y_m = on_first(second.x_m, second.y_m)
    second = replace(
        second,
        x_m=x_m,
        y_m=y_m,
        orientation_rad=(rotation_rad - second.orientation_rad) % np.pi,
        parent_region=second.parent_region + first.parent_region.max(initial=0),
    )
    columns = {
        field.name: np.concatenate((getattr(first, field.name), getattr(second, field.name)))
        for field in fields(CapTable)
    }
    return CapTable(**columns)
