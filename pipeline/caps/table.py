"""The table of caps: one row a hill, with its fitted sphere, its family and its flags."""

from dataclasses import dataclass, fields, replace
from enum import IntFlag

import numpy as np


class CapFlag(IntFlag):
    """What makes a cap doubtful; the value is a bit, the name goes into `caps.csv`."""

    edge = 1  # the hill touches the edge of the map: part of the cap was not measured
    non_measured = 2  # the hill touches a patch of non-measured points
    plateau = 4  # several points share the greatest height: clipped sensor, or quantised heights
    not_convex = 8  # the fitted surface does not curve downwards: no radius
    noisy_apex = 16  # noise is more than a tenth of the cap's height
    apex_off_surface = 32  # the fitted apex left the hill; the highest point was taken

    def words(self) -> str:
        """Return the names of the flags that are set, joined by a blank."""
        return " ".join(flag.name or "" for flag in type(self) if flag in self)


UNUSABLE = CapFlag.not_convex

UNITS = {
    "x_m": "m",
    "y_m": "m",
    "peak_height_m": "m",
    "cap_height_m": "m",
    "diameter_m": "m",
    "radius_m": "m",
    "area_m2": "m^2",
    "residual_m": "m",
    "family": "",
    "load_N": "N",
    "contact_radius_m": "m",
    "flags": "",
}


@dataclass(frozen=True, eq=False)
class CapTable:
    """Caps as columns, each of shape (n,), in the order of the hills' labels 1 ... n.

    Heights count from the fitted form; positions from the corner of the map. A cap that has no
    usable sphere keeps its row: its radius is NaN, its family empty and a flag says why. Loads and
    contact radii are NaN until a contact model gave them.
    """

    x_m: np.ndarray  # apex
    y_m: np.ndarray
    peak_height_m: np.ndarray  # height of the apex
    cap_height_m: np.ndarray  # df of Eq. 18: apex above the cut
    diameter_m: np.ndarray  # D of Eq. 18
    radius_m: np.ndarray
    area_m2: np.ndarray  # measured area above the cut
    residual_m: np.ndarray  # rms distance of the hill's points from the sphere
    family: np.ndarray  # "G", "P" or ""
    load_N: np.ndarray
    contact_radius_m: np.ndarray
    flags: np.ndarray  # CapFlag bits, uint16

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def usable(self) -> np.ndarray:
        """Mask of the caps that have a sphere, shape (n,)."""
        return (self.flags & UNUSABLE) == 0

    def with_columns(self, **columns: np.ndarray) -> "CapTable":
        """Return the table with some columns replaced."""
        return replace(self, **columns)

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns by name, flags as words."""
        table = {f.name: getattr(self, f.name) for f in fields(self)}
        table["flags"] = np.array([CapFlag(int(bits)).words() for bits in self.flags], dtype=object)
        return table
