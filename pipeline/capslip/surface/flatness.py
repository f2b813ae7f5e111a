"""Bows of a map or of its floor, and those that an instrument may make of a flat."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from capslip.errors import UnusableSurfaceError
from capslip.problems import Problem
from capslip.surface.blocks import block_means, few_lines
from capslip.surface.doubts import VISIBLE_FORM, VISIBLE_RIPPLE
from capslip.surface.form import FLOOR_SHARE, ROUNDING, level_and_straight, remove_form
from capslip.surface.heightmap import HeightMap
from capslip.surface.noise import MEDIAN_OF_NORMAL

if TYPE_CHECKING:
    from capslip.settings import Conditioning, Settings

FORMS_OF_SCANS = "forms_of_scans_differ"
BOWS = "bow_left", FORMS_OF_SCANS
MOSTLY_FORM = 0.8  # of the variance of the heights
PIT = 6.0  # robust standard deviations of what a bow leaves, below which a point carries nothing
FEW_PITS = 0.02  # of the points: more of them are the texture of a face
MOSTLY_BOWED = 0.95  # of that of the floor: a step between two floors looks 87 % like a bow
FEW_LINES = 50  # each way, that tell a bow of 5 % of the variance from none
CLEARLY_NO_BOW = 0.25  # of the same, that a bow leaves on some of the points: five times the most
BOWED_BY_FIT = 0.2  # of the variance of a floor: roughness may have the rest
LEVEL_FLOOR = 0.01  # of the variance of all heights; waves have a tenth and more in their lowest
BENT = 2.0  # times its variance: what the middle of a map has of a bow is less of it without
OF_THE_INSTRUMENT = "be of the instrument rather than of the face"
THE_FLOOR = "the floor between the hills"
OF_A_FLOOR = "--set conditioning.form_floor=true"


def known_flatness_m(surface: HeightMap, settings: "Settings") -> float | None:
    """Return the flatness deviation of a map, None where nobody says it, or its bow was taken off.

    What is said is that of one scan. It is no chance: a sum of two has it twice.
    """
    given_m = settings.instrument.flatness_deviation_m
    if given_m is None or degree_taken_off(settings.conditioning) > 1:
        return None
    return given_m * surface.faces


def error_of_form_m(surface: HeightMap, settings: "Settings") -> float | None:
    """Return the height of the bow that scans leave in their mean, None where it is none of it.

    The flatness deviation of the instrument, where that is given, holds it; and so does a form of a
    second degree that was taken off.
    """
    given = settings.instrument.flatness_deviation_m is not None
    return None if given or degree_taken_off(settings.conditioning) > 1 else surface.form_error_m


def mean_form_m(others_m: Sequence[np.ndarray]) -> tuple[np.ndarray, float | None]:
    """Return the mean of the forms of scans, and the height of the bow that they leave in it.

    Parameters
    ----------
    others_m : sequence of float64, shape (ny, nx)
        What the form of each other scan has over that of the first.

    Returns
    -------
    float64, shape (ny, nx)
        Over the form of the first, too.
    float or None
        Standard error: of n scans ``sqrt(sum h_i^2 / (n (n - 1)))``, h_i the height of what a form
        has over their mean. Of two it is half of the height of what they differ by: as much is
        left of a bow that one of them has. What all scans share shows in none. None of equal forms.

    Examples
    --------
    >>> bow_m = 1e-7 * np.linspace(-1.0, 1.0, 5)[None, :] ** 2
    >>> [f"{mean_form_m([0.0 * bow_m] * n + [bow_m])[1]:.2g}" for n in (0, 1, 2)]
    ['5e-08', '3.3e-08', '2.5e-08']
    """
    n = 1 + len(others_m)
    mean_m = np.asarray(sum(others_m) / n)
    heights_m = [np.ptp(one_m - mean_m) for one_m in (0.0, *others_m)]
    return mean_m, float(np.linalg.norm(heights_m)) / math.sqrt(n * (n - 1)) or None


def degree_taken_off(conditioning: "Conditioning") -> int:
    """Return the degree of the form that is taken off, 2 of spheres and cylinders: of low ones.

    Examples
    --------
    >>> from capslip.settings import Conditioning
    >>> [degree_taken_off(Conditioning(form=one)) for one in ("none", "plane", "sphere")]
    [0, 1, 2]
    """
    of_kind = {"none": 0, "plane": 1, "polynomial": conditioning.form_degree}
    return of_kind.get(conditioning.form) or 2 * (conditioning.form not in of_kind)


def given_bow_m(code: str, surface: HeightMap, settings: "Settings") -> float | None:
    """Return the height of the bows that a doubt is about, None where that follows from the map."""
    height_of = known_flatness_m if code == "bow_left" else error_of_form_m
    return height_of(surface, settings)


def bows_m(
    surface: HeightMap, flatness_m: float, x_m: np.ndarray, y_m: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return six bows of one height over a map: along x, along y and of a sphere, up and down.

    Parameters
    ----------
    surface : HeightMap
        Over which each bow rises or sinks by `flatness_m`.
    flatness_m : float
        Flatness deviation z_FLT (ISO 25178-600): the greatest difference of heights that the
        instrument shows of a flat.
    x_m, y_m : float64, of one shape
        Places where the bows are asked for, from the map's corner.

    Returns
    -------
    tuple of float64
        Heights, m, at the places.
    """
    height_m, width_m = (
        n * side_m for n, side_m in zip(surface.shape, surface.pixel_size_m, strict=True)
    )
    along_x, along_y = np.square(2.0 * x_m / width_m - 1.0), np.square(2.0 * y_m / height_m - 1.0)
    shapes = (along_x, along_y, 0.5 * (along_x + along_y))
    return tuple(sign * flatness_m * shape for shape in shapes for sign in (1.0, -1.0))


def problems_of_form(surface: HeightMap, approach_m: float, side: int = 1) -> list[Problem]:
    """Return whether most of the relief is a bow, of any height, see `bow_left`.

    Of the means of blocks with so many points a side.
    """
    few = few_lines(surface, FEW_LINES, side)  # they tell where there is clearly none
    for what, bow_of, least in (
        ("the heights", _bow, MOSTLY_FORM),
        (THE_FLOOR, _bow_of_floor, MOSTLY_BOWED),
    ):
        seen = few
        rest, bow_m = bow_of(seen)
        if rest <= CLEARLY_NO_BOW:
            seen = block_means(surface, side)
            rest, bow_m = bow_of(seen)
        if rest <= 1.0 - least and not _bends_middle(seen, bow_m):
            height_m = _range_m(bow_m)
            lies = f"{1.0 - rest:.0%} of the variance of {what} is a bow"
            step = (
                f"--set conditioning.form=quadratic {OF_A_FLOOR}, where the bow of {height_m:.2g} "
                "m is not the face's own; or --set instrument.flatness_deviation_m=..., what the "
                "instrument makes of a flat"
            )
            return [bow_left(lies, height_m, approach_m, step=step if what == THE_FLOOR else None)]
    return []


def problems_of_fit(surface: HeightMap, approach_m: float, degree: int) -> list[Problem]:
    """Return whether a form that was fitted to a floor and its hills bows that floor.

    Parameters
    ----------
    surface : HeightMap
        Heights over a form of that degree, 2 or more. The bow is a part of them where there is a
        floor. In waves without one, what a form through their lowest third takes off is none.
    approach_m : float
        With which the bow is compared.
    degree : int
        See `degree_taken_off`.
    """
    rest, bow_m, floor_m2 = _floor(surface, degree)
    relief_m2, bow_m2 = (float(np.nanvar(one_m)) for one_m in (surface.height_m, bow_m))
    if rest > 1.0 - BOWED_BY_FIT or floor_m2 > LEVEL_FLOOR * relief_m2 or bow_m2 > relief_m2:
        return []
    height_m = _range_m(bow_m)
    lies = f"{1.0 - rest:.0%} of the variance of {THE_FLOOR} is a bow"
    whose = "come of the form that was taken off, which was fitted to the hills as well"
    step = f"{OF_A_FLOOR}, which leaves no bow of {height_m:.2g} m in the floor"
    return [bow_left(lies, height_m, approach_m, whose, step)]


def bow_left(
    lies: str,
    bow_m: float,
    approach_m: float,
    whose: str = OF_THE_INSTRUMENT,
    step: str | None = None,
) -> Problem:
    """Return the doubt about a bow: no warning where it is low, unless it is found to matter."""
    decides = bow_m > VISIBLE_FORM * approach_m
    message = (
        f"{lies} of {bow_m:.3g} m, the approach is {approach_m:.3g} m: it "
        f"{'decides' if decides else 'may decide'} what touches, and may {whose}"
    )
    return Problem("bow_left", "warning" if decides else "info", message, step=step)


def problems_of_flatness(flatness_m: float, approach_m: float) -> list[Problem]:
    """Return that the map may hold what the instrument makes of a flat: its effect decides."""
    message = (
        f"the instrument bows a flat by {flatness_m:.3g} m, which may be in the map; the approach "
        f"is {approach_m:.3g} m"
    )
    step = (
        "--set conditioning.form=quadratic, where the bow is not the face's own, with "
        f"{OF_A_FLOOR} where a level floor lies between the hills; else an instrument that bows a "
        f"flat by less than {flatness_m:.2g} m"
    )
    return [Problem("bow_left", "warning", message, step=step)]


def problems_of_scans(error_m: float | None, approach_m: float) -> list[Problem]:
    """Return whether the forms of scans differ so much that what their mean has of it may decide.

    Lower than a ripple that is seen it does not.
    """
    if error_m is None or error_m <= VISIBLE_RIPPLE * approach_m:
        return []
    message = (
        f"the forms of the scans of which the map is the mean differ: a bow of {error_m:.3g} m "
        f"(standard error) may be left in it; the approach is {approach_m:.3g} m"
    )
    return [Problem(FORMS_OF_SCANS, "warning", message)]


def bow_of_form_m(surface: HeightMap, taken_off: int = 1) -> np.ndarray:
    """Return the bow of which `problems_of_form` or `problems_of_fit` speaks.

    Parameters
    ----------
    surface : HeightMap
        As there.
    taken_off : int
        Degree of the form that was taken off, see `degree_taken_off`.

    Returns
    -------
    float64, shape (ny, nx)
        What a quadratic, or a form of a higher degree that was taken off, takes off beyond a plane:
        fitted to the floor where that tells the bow, else to all; NaN where nothing was measured.
    """
    floor = taken_off > 1 or (
        _bow(surface)[0] > 1.0 - MOSTLY_FORM and _bow_of_floor(surface)[0] <= 1.0 - MOSTLY_BOWED
    )
    level, straight = level_and_straight(surface, floor, max(2, taken_off))
    return np.asarray(level.height_m - straight.height_m)


def _bends_middle(surface: HeightMap, bow_m: np.ndarray) -> bool:
    """Tell whether the middle of a map, of half its sides, is bent by what straightens the whole.

    Edges that are rounded, or worn, look like a bow, which the face between them does not have.
    """
    middle = tuple(slice(n // 4, n - n // 4) for n in surface.shape)
    bent_m = (surface.height_m - bow_m)[middle]
    as_is_m = np.where(np.isfinite(bent_m), surface.height_m[middle], np.nan)
    try:
        left_m2 = [
            float(np.nanvar(remove_form(replace(surface, height_m=one_m), "plane")[0].height_m))
            for one_m in (as_is_m, bent_m)
        ]
    except UnusableSurfaceError:  # hardly a point was measured there
        return False
    return left_m2[1] > BENT * left_m2[0]


def _bow(surface: HeightMap) -> tuple[float, np.ndarray]:
    """Return the share of the variance that a bow leaves, and that bow, NaN in pits.

    A few of these, far below all that touches, would hide in the variance what decides above them.
    """
    over_plane, over_bow = (one.height_m for one in level_and_straight(surface))
    pits = _pits(over_bow)
    if pits.any():
        others = replace(surface, height_m=np.where(pits, np.nan, surface.height_m))
        over_plane, over_bow = (one.height_m for one in level_and_straight(others))
    rest = float(np.nanvar(over_bow) / np.nanvar(over_plane))
    return rest, over_plane - over_bow


def _pits(height_m: np.ndarray) -> np.ndarray:
    """Tell which points lie far below the others, none where these are more than a few."""
    up_m = height_m - np.nanmedian(height_m)
    far_m = PIT * float(np.nanmedian(np.abs(up_m))) / MEDIAN_OF_NORMAL
    pits = np.asarray(up_m < -far_m)
    few = np.count_nonzero(pits) <= FEW_PITS * np.count_nonzero(np.isfinite(up_m))
    return pits & few & (far_m > 0.0)


def _bow_of_floor(surface: HeightMap) -> tuple[float, np.ndarray]:
    """Return the same of the lowest third of the points, over a level floor and a bowed one.

    Hills hide a bow in the variance of all heights, and it hides those that it lowers.
    """
    rest, bow_m, _ = _floor(surface)
    return rest, bow_m


def _floor(surface: HeightMap, degree: int = 2) -> tuple[float, np.ndarray, float]:
    """Return the share of the variance of a floor that its bow leaves, that bow, and what is left.

    No bow where the floor is level: 1, and a height of zero.
    """
    none = 1.0, np.zeros(1), 0.0
    try:
        over = [one.height_m for one in level_and_straight(surface, floor=True, degree=degree)]
    except UnusableSurfaceError:
        return none
    level_m2, bowed_m2 = (_variance_of_lowest_m2(one) for one in over)
    if level_m2 <= (ROUNDING * _range_m(over[0])) ** 2:
        return none
    bow, _ = remove_form(replace(surface, height_m=over[0] - over[1]), "plane")
    return bowed_m2 / level_m2, bow.height_m, bowed_m2


def _range_m(height_m: np.ndarray) -> float:
    return float(np.nanmax(height_m) - np.nanmin(height_m))


def _variance_of_lowest_m2(height_m: np.ndarray) -> float:
    known_m = height_m[np.isfinite(height_m)]
    lowest = max(1, int(FLOOR_SHARE * known_m.size))
    return float(np.partition(known_m, lowest - 1)[:lowest].var())
