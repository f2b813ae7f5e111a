"""Which doubts about hills, caps and families the model that pressed the face has to share."""

import math
from dataclasses import replace

import numpy as np

from capslip.caps.table import CapFlag, CapTable
from capslip.contact.map_doubts import ASKED
from capslip.contact.press import ContactState
from capslip.problems import Problem
from capslip.surface.doubts import sizes_fit
from capslip.surface.heightmap import HeightMap
from capslip.surface.holes import HIDDEN

FLAGS = {f"caps_{flag.name}": flag for flag in CapFlag}
# What the estimated error of the model counts, hill by hill
SHAPE = {
    "connected_network",
    "shallow_saddles",
    "pruning_decides",
    "not_spherical",
    "caps_ridge",
    "caps_several_peaks",
    "contact_under_resolved",
}
COUNTS = {
    "families_doubtful",
    "more_than_two_families",
    "family_below_cut",
    "hills_too_small",
}
ELSE = {
    "highest_point_on_no_cap",
    "plateau_at_cut",
    "cut_too_high",
    "level_not_settled",
    "no_caps",
    "fit_not_settled",
}
FLAGGED_SHARE = 0.2  # of the load, on caps of one flag
# Of the height of the caps over the middle of the map: a face that turns so much comes down on that
TIPPED = 0.5
APEX = CapFlag.apex_off_surface | CapFlag.noisy_apex  # whose heights have a standard error
MISSING = CapFlag.edge | CapFlag.non_measured
LOAD_PLACES, GOLDEN_ANGLE = 400, math.pi * (3.0 - math.sqrt(5.0))  # of a contact, on a spiral


def as_read(
    problems: list[Problem],
    contact: ContactState,
    caps: CapTable,
    tolerance: float,
    surface: HeightMap,
) -> list[Problem]:
    """Return the problems, with what the model in use does not read as information.

    A model of no surface at all reads nothing of hills, caps and families, and one of the map
    itself neither; what noise, steps and spikes do to it, it measures. It finds its own balance,
    too, where hills alone would tip over: no doubt as long as it hardly turns for that.
    One of spheres reads the caps that carry load, and families only where it takes these for the
    caps. Where its estimated error, in which the shape of each hill is counted, and what families
    differ from the caps, is within the tolerance, neither is a doubt more. Nor are pixels that are
    many times as long as wide, where the texture of the map says that both sizes are true.

    Parameters
    ----------
    problems : list of Problem
        Of any kind; those of other things stay as they are.
    contact : ContactState
        The face under its preload.
    caps : CapTable
        With the loads of that state.
    tolerance : float
        Of the error that was asked for.
    surface : HeightMap
        The map that was pressed.
    """
    known, counted = _is_known(contact, tolerance), _is_counted(contact, tolerance)
    share = {code: _share(caps, flag) for code, flag in FLAGS.items()}

    def is_read(code: str) -> bool:
        if code in COUNTS | ELSE | SHAPE | FLAGS.keys() and contact.rung.made_from != "spheres":
            return False
        if code == "tips_over":
            return contact.rung.made_from != "map" or _tips(contact, caps, surface)
        if code in SHAPE and counted:
            return False
        if code == "non_square_pixels":
            return not (known and sizes_fit(surface))
        if code in COUNTS:
            return contact.rung.reads_families and not known
        if code not in FLAGS:
            return True
        return share[code] > (0.0 if FLAGS[code] is CapFlag.plateau else FLAGGED_SHARE)

    return [
        problem
        if problem.severity != "warning" or is_read(problem.code)
        else replace(problem, severity="info")
        for problem in problems
    ]


def still_doubtful(
    caps: CapTable, contact: ContactState, surface: HeightMap, tolerance: float
) -> CapTable:
    """Return the caps less those flags of which nothing is doubtful under this load.

    An edge or a hole of the map matters where it takes a part of the contact: what lies farther
    from all measured points than a quarter of its radius. Elsewhere the sphere is that of the
    measured part, with its standard errors. These, and those of apexes that noise or pixels hide,
    are counted in the estimated error of the model: within the tolerance they are no doubt more.

    Parameters
    ----------
    caps : CapTable
        With the loads and contact radii of that state; NaN for a model without caps.
    contact, tolerance
        As for `as_read`.
    surface : HeightMap
        The map that the caps were fitted to.
    """
    if contact.rung.made_from != "spheres" or not _is_counted(contact, tolerance):
        return caps
    flags = caps.flags & ~np.uint16(APEX.value)
    for i in np.flatnonzero(flags & np.uint16(MISSING.value)):
        if not _is_hidden(caps, int(i), surface):
            flags[i] &= ~np.uint16(MISSING.value)
    return caps.with_columns(flags=flags)


def _is_hidden(caps: CapTable, i: int, surface: HeightMap) -> bool:
    """Tell whether a part of the contact of a cap lies far from all measured points."""
    from scipy.ndimage import distance_transform_edt

    radius_m = float(caps.contact_radius_m[i])
    if not radius_m > 0.0:
        return False
    size_m, at_m = surface.pixel_size_m, (float(caps.y_m[i]), float(caps.x_m[i]))
    reach = [int((1.0 + HIDDEN) * radius_m / one_m) + 2 for one_m in size_m]
    first = [int(at / one_m) - n for at, one_m, n in zip(at_m, size_m, reach, strict=True)]
    window = [np.arange(start, start + 2 * n + 1) for start, n in zip(first, reach, strict=True)]
    inside = [(index >= 0) & (index < n) for index, n in zip(window, surface.shape, strict=True)]
    measured = np.zeros([index.size for index in window], dtype=bool)
    rows, cols = (index[one] for index, one in zip(window, inside, strict=True))
    measured[np.ix_(*inside)] = surface.measured[np.ix_(rows, cols)]
    if not measured.any():
        return True
    away_m = distance_transform_edt(~measured, sampling=size_m)
    y_m, x_m = (
        (index + 0.5) * one_m - at for index, one_m, at in zip(window, size_m, at_m, strict=True)
    )
    disc = np.square(y_m)[:, None] + np.square(x_m) <= radius_m**2
    return bool((away_m[disc] > max(HIDDEN * radius_m, *size_m)).any())


def _tips(contact: ContactState, caps: CapTable, surface: HeightMap) -> bool:
    """Tell whether the face turned until its peaks no longer stood as they had.

    Not by how far the caps stand above their cut: on waves that is a small part of their height,
    and the plane of a few of them turns by as much from one cut to the next.
    """
    of = caps.usable if caps.usable.any() else np.ones(caps.usable.size, dtype=bool)
    if not of.any():
        return True
    at_m = np.stack((caps.x_m, caps.y_m), axis=1)[of] - contact.load_point_m
    rise_m = float(np.fmax.reduce(np.abs(at_m @ np.array(contact.tilt_rad))))
    height_m = float(np.fmax.reduce(caps.peak_height_m[of]) - np.nanmedian(surface.height_m))
    return not rise_m <= TIPPED * height_m


def _is_known(contact: ContactState, tolerance: float) -> bool:
    """Tell whether the estimated error of the model is within the tolerance."""
    errors = contact.errors
    return errors is not None and errors.greatest <= tolerance


def _is_counted(contact: ContactState, tolerance: float) -> bool:
    """Tell the same of the forces that are asked for, at which the error may be less."""
    errors = contact.errors
    return errors is not None and errors.greatest_at(ASKED) <= tolerance


def _share(caps: CapTable, flag: CapFlag) -> float:
    """Return the share of the load on caps of a flag."""
    load_N = np.where(caps.load_N > 0.0, caps.load_N, 0.0)
    return float(load_N[(caps.flags & flag) != 0].sum() / max(load_N.sum(), 1e-300))


def load_seen(x_m: np.ndarray, y_m: np.ndarray, a_m: np.ndarray, surface: HeightMap) -> np.ndarray:
    """Return the share of the loads of Hertz contacts that rests on measured points.

    Each is made of as many places of equal load: within r are 1 - (1 - (r / a)^2)^1.5 of it.
    """
    place = (np.arange(LOAD_PLACES) + 0.5) / LOAD_PLACES
    r, angle = np.sqrt(1.0 - (1.0 - place) ** (2.0 / 3.0)), GOLDEN_ANGLE * np.arange(LOAD_PLACES)
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    row = np.floor((y_m[:, None] + a_m[:, None] * r * np.sin(angle)) / dy_m).astype(int)
    col = np.floor((x_m[:, None] + a_m[:, None] * r * np.cos(angle)) / dx_m).astype(int)
    inside = (row >= 0) & (row < ny) & (col >= 0) & (col < nx)
    seen = inside & surface.measured[np.clip(row, 0, ny - 1), np.clip(col, 0, nx - 1)]
    return np.asarray(seen.mean(axis=1))
