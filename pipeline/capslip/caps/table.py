"""The table of caps: one row a hill, with its fitted sphere, its family and its flags."""

from dataclasses import dataclass, field, fields, replace
from enum import IntFlag

import numpy as np


class CapFlag(IntFlag):
    """What makes a cap doubtful; the value is a bit, the name goes into `caps.csv`."""

    edge = 1  # the hill touches the edge of the face: part of the cap was not measured
    non_measured = 2  # the hill touches a patch of non-measured points
    plateau = 4  # a flat top: clipped sensor, or quantised heights
    not_convex = 8  # the hill has no height above the cut: no radius
    noisy_apex = 16  # noise, or the error of the apex, is a visible part of the cap's height
    apex_off_surface = 32  # the fitted apex left the hill; a safer one was taken
    few_points = 64  # too few points for a fitted surface
    ridge = 128  # not curved downwards in all directions, or ten times as much in one
    several_peaks = 256  # the points that were fitted do not fill one ellipse
    outlier = 512  # the radius is far from that of the other caps

    def words(self) -> str:
        """Return the names of the flags that are set, joined by a blank."""
        return " ".join(flag.name or "" for flag in type(self) if flag in self)


UNUSABLE = CapFlag.not_convex
DOUBTFUL = CapFlag.edge | CapFlag.non_measured | CapFlag.apex_off_surface | CapFlag.noisy_apex

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
    "radius_se_m": "m",
    "peak_height_se_m": "m",
    "peak_radius_correlation": "",
    "radius_major_m": "m",
    "radius_minor_m": "m",
    "orientation_rad": "rad",
    "fit_depth_m": "m",
    "quartic_m": "m",
    "profile_residual_m": "m",
    "parent_region": "",
}


def _unknown() -> np.ndarray:
    return np.array(np.nan)


def _none() -> np.ndarray:
    return np.array(0, dtype=np.int32)


@dataclass(frozen=True, eq=False)
class CapTable:
    """Caps as columns, each of shape (n,), in the order of the hills' labels 1 ... n.

    Heights count from the fitted form; positions from the corner of the map. A cap that has no
    usable sphere keeps its row: its radius is NaN, its family empty and a flag says why. Loads and
    contact radii are NaN until a contact model gave them; the last columns where a table was not
    made by a fit, or where a hill has too few points or no curvature for them.
    """

    x_m: np.ndarray  # apex
    y_m: np.ndarray
    peak_height_m: np.ndarray  # height of the apex
    cap_height_m: np.ndarray  # df of Eq. 18: apex above the cut
    diameter_m: np.ndarray  # D of Eq. 18
    radius_m: np.ndarray
    area_m2: np.ndarray  # measured area above the cut
    residual_m: np.ndarray  # rms distance of the fitted points from the sphere
    family: np.ndarray  # "G", "P" or ""
    load_N: np.ndarray
    contact_radius_m: np.ndarray
    flags: np.ndarray  # CapFlag bits, uint16
    radius_se_m: np.ndarray = field(default_factory=_unknown)  # standard errors
    peak_height_se_m: np.ndarray = field(default_factory=_unknown)
    peak_radius_correlation: np.ndarray = field(default_factory=_unknown)  # of both errors
    radius_major_m: np.ndarray = field(
        default_factory=_unknown
    )  # principal radii of the fitted points
    radius_minor_m: np.ndarray = field(default_factory=_unknown)
    orientation_rad: np.ndarray = field(
        default_factory=_unknown
    )  # of the flatter direction, from x towards y
    fit_depth_m: np.ndarray = field(default_factory=_unknown)  # depth of the fit below the apex
    # Over t, the depth below the apex of the quadric over fit_depth_m, the hill falls like
    # A t + quartic_m t^2, with the rms distance profile_residual_m of its points
    quartic_m: np.ndarray = field(default_factory=_unknown)
    profile_residual_m: np.ndarray = field(default_factory=_unknown)
    parent_region: np.ndarray = field(default_factory=_none)  # connected region, 1 ...; 0: unknown

    def __post_init__(self) -> None:
        for column in fields(self):
            values = getattr(self, column.name)
            if values.ndim == 0:
                object.__setattr__(self, column.name, np.full(len(self), values))

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def usable(self) -> np.ndarray:
        """Mask of the caps that have a sphere, shape (n,)."""
        return (self.flags & UNUSABLE) == 0

    @property
    def contact_diameter_m(self) -> float | None:
        """Contacts of at most this width carry half of the load; None where none is loaded."""
        loaded = self.load_N > 0
        if not loaded.any():
            return None
        radius_m = self.contact_radius_m[loaded]
        order = np.argsort(radius_m)
        carried_N = np.cumsum(self.load_N[loaded][order])
        return 2.0 * float(radius_m[order][np.searchsorted(carried_N, 0.5 * carried_N[-1])])

    def with_columns(self, **columns: np.ndarray) -> "CapTable":
        """Return the table with some columns replaced."""
        return replace(self, **columns)

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns by name, flags as words."""
        table = {f.name: getattr(self, f.name) for f in fields(self)}
        bits, row = np.unique(self.flags, return_inverse=True)
        words = [CapFlag(int(some)).words() for some in bits]
        table["flags"] = np.array(words, dtype=object)[row]
        return table
