"""What makes hills, caps and families doubtful."""

import math
from dataclasses import replace

import numpy as np

from capslip.caps.families import Families
from capslip.caps.hills import NOISE_FACTOR, Hills
from capslip.caps.levels import bow_terms, find_levels
from capslip.caps.pruning import MIN_POINTS, TOO_SMALL
from capslip.caps.table import DOUBTFUL, CapFlag, CapTable
from capslip.problems import Problem
from capslip.surface.flatness import bow_left, bow_of_form_m
from capslip.surface.form import ROUNDING
from capslip.surface.heightmap import HeightMap
from capslip.surface.holes import problems_of_holes
from capslip.surface.seams import Seams, levels_m

MANY_LOST = 0.1  # of the caps: hills of too few points
LEVEL_ODDS = 5.0  # 150 to 1 that peaks on both sides of a seam are level as they are
BOW_LEVEL = 0.01  # of the F-test that the peaks lie on a bow
MEANING = {  # of the flags of caps that hills can have
    CapFlag.edge: "touch the edge of the face: part of them was not measured",
    CapFlag.non_measured: "touch a patch of non-measured points",
    CapFlag.plateau: "have a flat top (clipped sensor or quantised heights)",
    CapFlag.noisy_apex: "have an apex that is uncertain by more than a tenth of their height: by "
    "noise, or as they are no spheres",
    CapFlag.apex_off_surface: "have no fitted apex on the hill: its highest place stands in",
    CapFlag.ridge: "are ridges rather than caps",
    CapFlag.several_peaks: "have several peaks",
    CapFlag.outlier: "are unlike all others in size",
}


def plane_of(counted: CapTable, pressed: CapTable) -> str:
    """Name the plane of caps that were counted beside those that are pressed, where it shows.

    Tables and pictures hold the latter: another number of caps without a word looks like an error.
    """
    alike = np.count_nonzero(counted.usable) == np.count_nonzero(pressed.usable)
    return "" if alike else " on the families' own plane"


def problems_of_caps(
    surface: HeightMap, hills: Hills, caps: CapTable, material_ratio: float, on: str = ""
) -> list[Problem]:
    """Return what makes the hills of a face, or their caps, doubtful, and holes that may hide some.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    hills : Hills
        Its hills.
    caps : CapTable
        Their caps.
    material_ratio : float
        Share of the measured points that was to be kept.
    on : str
        Names the plane of these caps: see `plane_of`.
    """
    found = _pruning(hills, on)
    if not caps.usable.any():
        message = (
            f"no usable cap: {hills.n_regions} regions above the cut, rejected "
            f"{hills.rejected or 'none'}, {len(caps)} without a sphere"
        )
        return [*found, Problem("no_caps", "warning", message)]
    return [
        *found,
        *_too_small(hills, caps, on),
        *_hills_that_run_together(hills, caps),
        *_cut(surface, hills, caps, material_ratio),
        *_flagged(caps, on),
        *_not_spherical(caps),
        *problems_of_holes(surface, 0.5 * float(np.median(caps.diameter_m[caps.usable]))),
    ]


def problems_of_families(caps: CapTable, families: Families, on: str = "") -> list[Problem]:
    """Return what makes the families of the caps doubtful."""
    found: list[Problem] = []
    if not caps.usable.any():
        return found
    if families.count == 1:
        message = (
            f"the peak heights of {families.m} caps{on} show one family: no P-caps, h is not "
            "defined"
        )
        found.append(Problem("one_family", "info", message))
    if len(families.levels) > 2:
        levels = ", ".join(f"{one.count} at {one.peak_height_m:.3g} m" for one in families.levels)
        message = (
            f"the caps lie on {len(families.levels)} levels ({levels}); the model knows two: m, n "
            "and h are those of the best split in two"
        )
        found.append(Problem("more_than_two_families", "warning", message))
    elif not families.clear:
        apart = families.separation
        odds = math.exp(min(families.log_odds or 0.0, 50.0))
        width = "" if apart is None else f"; the best split in two is {apart:.1f} spreads wide"
        message = (
            f"{families.m + families.n} caps{on} do not settle how many families there are: the "
            f"odds of {len(families.levels)} are {odds:.2g} to 1{width}; "
            "m, n and h are worth little"
        )
        found.append(Problem("families_doubtful", "warning", message))
    return found


def leaves_peaks(seams: Seams, caps: CapTable) -> bool:
    """Tell whether the peaks leave no doubt that all fields lie on one level as they are.

    Fields that were stitched wrongly took their peaks along. Where it is the floor that is stepped,
    as beside a recess, the fields on one level would have their peaks apart: these are families on
    a common plane as they are, at far better odds than they would be then. The plane is free, as a
    face that was pressed lies on its highest peaks, whatever their fields.
    """
    x_m, y_m, peak_m = (one[caps.usable] for one in (caps.x_m, caps.y_m, caps.peak_height_m))
    up_m = levels_m(seams)[seams.surface.pixel_at(x_m, y_m)]
    as_is, on_one_level = (
        find_levels(x_m, y_m, one_m).log_evidence for one_m in (peak_m, peak_m - up_m)
    )
    return as_is - on_one_level > LEVEL_ODDS


def problems_of_bow(caps: CapTable, approach_m: float) -> list[Problem]:
    """Return whether the peaks lie on a bow, of any height: what it moves is asked of the contact.

    A warning from a tenth of the approach on, where nobody knows that.
    """
    bow_m, chance = bow_of_peaks(caps)
    if chance > BOW_LEVEL or bow_m <= ROUNDING * float(np.abs(caps.peak_height_m).max()):
        return []
    return [bow_left("the peaks lie on a bow", bow_m, approach_m)]


def bow_of_peaks(caps: CapTable) -> tuple[float, float]:
    """Return the height of the bow on which the peaks lie, and the odds of one as clear by chance.

    Heights within each family are explained by a plane, then by a second-degree surface; an F-test
    says whether the latter explains more than chance would. No bow, (0, 1), with too few peaks.
    """
    bow_m, chance = _bow_and_chance(caps, caps.x_m, caps.y_m)
    member = caps.usable & (caps.family != "")
    return float(np.ptp(bow_m[member])) if member.any() else 0.0, chance


def without_bow(
    caps: CapTable, surface: HeightMap, peaks: CapTable, taken_off: int = 1
) -> tuple[CapTable, HeightMap]:
    """Return caps and their map less the bow on which peaks lie, or that of the map.

    That of the map where the peaks lie on none, or a form of a degree above 1 was taken off: see
    `bow_of_form_m`.
    """
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    at_y_m, at_x_m = (np.arange(ny) + 0.5) * dy_m, (np.arange(nx) + 0.5) * dx_m
    grid_m = np.tile(at_x_m, ny), np.repeat(at_y_m, nx)
    form_m, chance = _bow_and_chance(peaks, *grid_m)
    if chance <= BOW_LEVEL and taken_off <= 1:
        bow_m, _ = _bow_and_chance(peaks, caps.x_m, caps.y_m)
        form_m = form_m.reshape(surface.shape)
    else:
        form_m = bow_of_form_m(surface, taken_off)
        bow_m = np.nan_to_num(
            form_m[surface.pixel_at(caps.x_m, caps.y_m)], nan=float(np.nanmean(form_m))
        )
    straight = replace(surface, height_m=surface.height_m - form_m)
    return caps.with_columns(peak_height_m=caps.peak_height_m - bow_m), straight


def _bow_and_chance(
    peaks: CapTable, at_x_m: np.ndarray, at_y_m: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the bow of peaks at some places, and the odds of one as clear by chance."""
    from scipy.special import fdtrc

    member = np.flatnonzero(peaks.usable & (peaks.family != ""))
    peak_m = peaks.peak_height_m[member]
    families = np.unique(peaks.family[member])
    n_free = member.size - families.size - 5  # less two slopes and three curvatures
    if n_free < 1:
        return np.zeros(at_x_m.size), 1.0
    x_m, y_m = peaks.x_m[member], peaks.y_m[member]
    scale_m = float(np.hypot(np.ptp(x_m), np.ptp(y_m)))
    u, v = (x_m - x_m.mean()) / scale_m, (y_m - y_m.mean()) / scale_m
    plane = np.column_stack([*(peaks.family[member] == name for name in families), u, v])
    bowed = np.column_stack([plane, bow_terms(u, v)])
    by_plane, by_bow = (np.linalg.lstsq(model, peak_m, rcond=None)[0] for model in (plane, bowed))
    there = bow_terms((at_x_m - x_m.mean()) / scale_m, (at_y_m - y_m.mean()) / scale_m)
    bow_m = there @ by_bow[-3:]
    rest_m2 = float(np.square(peak_m - bowed @ by_bow).sum())
    gain_m2 = float(np.square(peak_m - plane @ by_plane).sum()) - rest_m2
    if rest_m2 == 0.0:
        return bow_m, 0.0
    return bow_m, float(fdtrc(3, n_free, (gain_m2 / 3.0) / (rest_m2 / n_free)))


def _pruning(hills: Hills, on: str = "") -> list[Problem]:
    if hills.pruning_sensitivity < 0.2:
        return []
    message = (
        f"{hills.n_hills} hills{on}; half the pruning height of {hills.pruning_height_m:.3g} m "
        f"gives {hills.n_hills_half_pruning}, double {hills.n_hills_double_pruning}: the "
        "count depends on the pruning; set hills.pruning_height_m or use an S-filter"
    )
    return [Problem("pruning_decides", "warning", message)]


def _too_small(hills: Hills, caps: CapTable, on: str = "") -> list[Problem]:
    """Return how many hills stand clear of the noise, on too few points to be counted."""
    n_lost, n_usable = hills.rejected.get(TOO_SMALL, 0), int(caps.usable.sum())
    if n_lost == 0:
        return []
    message = (
        f"{n_lost} of {n_lost + hills.n_hills} hills{on} that stand clear above the cut have "
        f"fewer than {MIN_POINTS} points, and are not counted: m and n may be too low; a finer "
        "scan tells"
    )
    many = n_lost > MANY_LOST * n_usable
    return [Problem("hills_too_small", "warning" if many else "info", message)]


def _hills_that_run_together(hills: Hills, caps: CapTable) -> list[Problem]:
    found, usable = [], caps.usable
    if hills.largest_hill_share > max(0.2, 3.0 / usable.sum()):
        message = (
            f"one hill holds {hills.largest_hill_share:.0%} of the points above the cut: hills run "
            "together there, and one sphere stands for many"
        )
        found.append(Problem("connected_network", "warning", message))
    shallow = float((hills.prominence_m < 0.1 * caps.cap_height_m)[usable].mean())
    if shallow > 0.25:
        message = (
            f"{shallow:.0%} of the caps stand less than a tenth of their height above a saddle: "
            "roughness on larger hills, or caps that touch; an S-filter tells which"
        )
        found.append(Problem("shallow_saddles", "warning", message))
    usual_m = float(np.median(caps.cap_height_m[usable]))
    if 0.1 * usual_m < hills.pruning_height_m < np.inf:
        message = (
            f"dents up to {hills.pruning_height_m:.3g} m count as noise, on caps usually "
            f"{usual_m:.3g} m high: caps that overlap more closely are one"
        )
        found.append(Problem("coarse_pruning", "info", message))
    return found


def _cut(surface: HeightMap, hills: Hills, caps: CapTable, material_ratio: float) -> list[Problem]:
    """Return what the cut left on no cap: a plateau, or the highest point."""
    found = []
    if hills.kept_fraction > 1.5 * material_ratio:
        message = f"{hills.kept_fraction:.0%} of the points lie at or above the cut"
        found.append(Problem("plateau_at_cut", "warning", message))
    above_m = surface.bounds_m[1] - float(caps.peak_height_m[caps.usable].max())
    if above_m > NOISE_FACTOR * hills.noise_m + 0.05 * np.nanmax(caps.cap_height_m):
        message = (
            f"the highest measured point stands {above_m:.3g} m above the highest cap: "
            "a spike, or a hill that was rejected"
        )
        found.append(Problem("highest_point_on_no_cap", "warning", message))
    return found


def _flagged(caps: CapTable, on: str = "") -> list[Problem]:
    found, n_usable = [], int(caps.usable.sum())
    for flag, meaning in MEANING.items():
        n_flagged = int((caps.usable & ((caps.flags & flag) != 0)).sum())
        if n_flagged:
            many = n_flagged / n_usable > 0.2 or flag is CapFlag.plateau
            many &= flag not in DOUBTFUL  # of which the load on them is asked
            message = f"{n_flagged} of {n_usable} caps{on} {meaning}"
            found.append(Problem(f"caps_{flag.name}", "warning" if many else "info", message))
    return found


def _not_spherical(caps: CapTable) -> list[Problem]:
    depth_m = np.where(caps.fit_depth_m > 0.0, caps.fit_depth_m, caps.cap_height_m)
    usual = float(np.median((caps.residual_m / depth_m)[caps.usable]))
    if not usual > 0.25:
        return []
    message = (
        f"half of the hills deviate from their sphere by more than {usual:.0%} "
        "of its height: ridges or rough hills rather than caps"
    )
    return [Problem("not_spherical", "warning", message)]
