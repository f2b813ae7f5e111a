"""What doubts move: the face is pressed again as it may be as well, and the answers compared."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from capslip.caps.families import Families
from capslip.caps.table import CapTable
from capslip.contact.accuracy import FORCE_SHARES, answers
from capslip.contact.map_doubts import ASKED, BLURRED
from capslip.contact.press import ContactState
from capslip.contact.rung import Scene
from capslip.contact.solvers.elastic_face import elastic_face
from capslip.contact.solvers.noise import white_noise_m
from capslip.contact.trials import ELSEWHERE, LEFT_OUT, SMOOTHED, FaceOfCaps, Trials
from capslip.errors import CapslipError
from capslip.problems import Effect, Problem
from capslip.settings import Settings
from capslip.surface.blocks import coarse_map
from capslip.surface.conditioning import Conditioned
from capslip.surface.doubts import VISIBLE_FORM
from capslip.surface.filling import filled_from_fewer, standard_error
from capslip.surface.flatness import (
    BOWS,
    FORMS_OF_SCANS,
    bow_of_form_m,
    bows_m,
    degree_taken_off,
    given_bow_m,
)
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap, Tops
from capslip.surface.holes import HIDDEN
from capslip.surface.interpolated import pixels_apart
from capslip.surface.ripple import find_ripple, without_ripple
from capslip.surface.rounding import few_steps
from capslip.surface.seams import levels_m, tilts_m
from capslip.units import percent

OF_THE_HEIGHTS = (
    *("hole_may_hide_hills", "tops_in_holes", "outline_assumed"),
    *("clipped", "heights_in_steps"),
)
FIRM = ("outliers_removed", "points_filled")
JACKKNIFED = "points_filled"  # by maps that lack a part of its points each
COARSER, FILTERED, FORMED = "resampled_coarser", "long_waves_filtered", "form_taken_off"
ROUGHER = (COARSER, SMOOTHED)  # of which the other map has waves that the one that answers lacks
# Doubts that are warnings where nobody knows what they move, and why nobody does
UNKNOWN = {
    COARSER: "more points have no answer",
    FILTERED: "the face with them has no answer",
    SMOOTHED: "the face with them has no answer",
    FORMED: "the caps or the map without it do not tell",
    ELSEWHERE: "the faces as they may lie as well have no answer",
    BLURRED: "caps with one more blur have no answer",
}
# What was chosen or is of the optics, and no sign
NOT_OF_THE_FACE = FILTERED, SMOOTHED, FORMED, ELSEWHERE, BLURRED
LEAST_MOVED = 1e-3  # less is not noted of what is no sign of the face itself
ASK_MAP = 0.2  # of the tolerance: what may move more is pressed on the map, too
Thinned: TypeAlias = Callable[[HeightMap], HeightMap]  # what is pressed of a map: fewer points


@dataclass(frozen=True)
class _Moved:
    """What a doubt moves, relative: the answers at all forces, those asked for, the approach."""

    effect: Effect
    asked: float
    approach: float
    hidden: float  # by pixels: what may have moved, the most at forces that are asked for
    stiffness_N_per_m: float = math.nan  # of the map that was changed, where one was

    @classmethod
    def by(
        cls,
        change: np.ndarray,
        least_share: float,
        approach: float = 0.0,
        of_pixels: np.ndarray | float = 0.0,
    ) -> "_Moved":
        """Return it by the greatest changes of energies and stiffness, see `accuracy.answers`.

        Of an energy that changes by no more than pixels leave in it, or in which they leave all of
        it, nobody knows whether it does.
        """
        asked, stiffness = np.array(FORCE_SHARES) >= least_share, float(change[-1])
        energies, left = change[:-1], np.broadcast_to(of_pixels, len(FORCE_SHARES))
        hides = (energies <= left) | (left >= 1.0)
        moved = np.where(hides, 0.0, energies)
        hidden = float((energies - moved)[asked].max())
        energy = None if hidden > 0.0 and not moved.any() else float(moved.max())
        of_asked = max(stiffness, float(moved[asked].max()))
        return cls(Effect(stiffness, energy, energy), of_asked, approach, hidden)


def with_effects(
    problems: list[Problem],
    caps: CapTable,
    peaks: CapTable,
    conditioned: Conditioned,
    settings: Settings,
    contact: ContactState | None = None,
    least_share: float = ASKED,
) -> list[Problem]:
    """Return the problems, those about single caps with their effects, and as severe as these.

    Each is estimated by interacting caps, whatever model answers: flagged caps may carry nothing; a
    bow or the levels of stitched fields may not be the face's own; a hole may hold as many hills as
    the rest, and so may what is open to the edge of the map; points that were removed may have been
    there; long waves that a filter took off may be the face's own, and so may the form. Where the
    map itself answers, bow and levels are taken off it, and long waves and form put back, on points
    so far apart that this costs little, where these tell; removed points that may matter are put
    back; of one that was interpolated, the measured points alone are pressed, of one that was
    filled, fewer of them, of one that was resampled to fewer, more, and of one with a ripple, the
    same without it. Of optics that blur, what one more blur does to caps stands for what the first
    has done.
    Within `contact.tolerance` it is information, and nothing below a thousandth where it is no sign
    of the face but a filter or the bow of the instrument. So are removed points information that
    stand off both ways, as errors do; else it is a warning. What moves the energy at smaller forces
    alone than those that are asked for is only noted.

    Parameters
    ----------
    problems : list of Problem
        Of any kind; those of other kinds, and what is no warning, stay as they are. So does one
        whose effect is not known: caps that cannot be pressed have none.
    caps : CapTable
        At their heights over the face as it was pressed.
    peaks : CapTable
        Those that tell a bow, with their families.
    conditioned : Conditioned
        The face, and the points that were removed from it.
    settings : Settings
        `material` and `contact`, with the load of this face.
    contact : ContactState, optional
        What answers; without it caps tell.
    least_share : float
        Of mu N, the least force that is asked for; from a quarter on it is all the same.
    """
    before = conditioned.unfiltered_as_turned(), conditioned.with_form_as_turned()
    others = conditioned.seams, conditioned.finer_as_turned(), *before
    rough = conditioned.with_short_waves_as_turned()
    aside = conditioned.elsewhere_as_turned()
    face = FaceOfCaps(conditioned.surface, settings, *others, aside, with_short_waves=rough)
    tolerance = settings.contact.tolerance
    least_share = max(FORCE_SHARES[0], min(least_share, ASKED))
    filled_m = math.inf if contact is None else ASK_MAP * tolerance * contact.approach_m
    pressed = contact if contact is not None and contact.rung.made_from == "map" else None
    asked = {one.code for one in problems if _is_asked(one, conditioned, filled_m)}
    effects: dict[str, _Moved | None] = {}
    how = dict.fromkeys(asked, "estimated with the caps")
    for code in sorted(asked & (OF_FEWER_POINTS.keys() | OF_THE_MAP.keys())):
        if pressed is not None:
            by_map, on_map = _found_on_map(code, pressed, peaks, face, least_share)
            if by_map is not None:
                asked.remove(code)
                effects[code], how[code] = by_map, f"found on the map {on_map}"
    if asked:
        trials = Trials(face, caps, peaks, conditioned, of_map=pressed is not None)
        effects |= {code: _effect(trials, code, least_share) for code in asked}
    removed = effects.get("outliers_removed")
    matters = removed is not None and removed.effect.greatest > ASK_MAP * tolerance
    if pressed is not None and matters:
        maps = _removed_or_not(conditioned)
        by_map = _effect_on_map("outliers_removed", pressed, peaks, face, maps, least_share)
        if by_map is not None:
            effects["outliers_removed"] = by_map
            how["outliers_removed"] = "found on the map with them"
    errors = {"outliers_removed"} if conditioned.removed.both_ways else set()
    errors |= {one.code for one in problems if (one.code, one.severity) == (FORMED, "info")}
    limits = {code: math.inf if code in errors else tolerance for code in how}
    none = {code for code, one in effects.items() if _is_nothing(code, one, face)}
    return [
        _as_severe(
            *(one, effects.get(one.code), least_share, limits[one.code]),
            *(how[one.code], conditioned, caps),
        )
        if _is_asked(one, conditioned, filled_m)
        else one
        for one in problems
        if one.code not in none
    ]


def _is_nothing(code: str, moved: _Moved | None, face: FaceOfCaps) -> bool:
    """Tell whether what was only given, a filter, a bow or a blur of the optics, moves nothing."""
    given = code in BOWS and given_bow_m(code, face.surface, face.settings) is not None
    if moved is None or not (given or code in NOT_OF_THE_FACE):
        return False
    return max(moved.effect.greatest, moved.approach, moved.hidden) < LEAST_MOVED


def _found_on_map(
    code: str, contact: ContactState, peaks: CapTable, face: FaceOfCaps, least_share: float
) -> tuple[_Moved | None, str]:
    """Return what a doubt moves where the map answers, None where it does not, and on which maps.

    On as few points as tell: on all of them where fewer have no answer or another stiffness, or
    where their pixels hide more than the answer is said to be off by.
    """
    if code in OF_THE_MAP:
        found = _effect_on_map(code, contact, peaks, face, OF_THE_MAP[code](face), least_share)
        return found, HOW.get(code, "with fewer points")
    maps, which = OF_FEWER_POINTS[code](face, coarse_map), "with fewer points"
    found = _effect_on_map(code, contact, peaks, face, maps, least_share)
    tolerance = face.settings.contact.tolerance
    stated = 0.0 if contact.errors is None else contact.errors.energy_at(least_share)
    tells = (
        found is not None
        and (found.asked > tolerance or found.hidden <= max(tolerance, stated))
        and not abs(found.stiffness_N_per_m / contact.stiffness_N_per_m - 1.0) > tolerance
    )
    if not tells and maps[0].shape != face.surface.shape:
        whole = OF_FEWER_POINTS[code](face, _all_points)
        of_all = _effect_on_map(code, contact, peaks, face, whole, least_share)
        if of_all is not None:
            found, maps, which = of_all, whole, "with all its points"
    if code != "bow_left":
        return found, which
    bow_m = f"{_bent_m(maps):.3g} m"
    if given_bow_m("bow_left", face.surface, face.settings) is not None:
        return found, f"{which}, bent by {bow_m}"
    return found, f"{which}, without the bow of {bow_m} that a form takes off its heights"


def _all_points(surface: HeightMap) -> HeightMap:
    return surface


def _bent_m(maps: tuple[HeightMap, ...]) -> float:
    """Return how high the highest bow is that was put on the first of some maps."""
    first, *others = maps
    bent_m = [one.height_m - first.height_m for one in others]
    return max(float(np.nanmax(up_m) - np.nanmin(up_m)) for up_m in bent_m)


def _bow_or_not(face: FaceOfCaps, thinned: Thinned) -> tuple[HeightMap, ...]:
    """Return a thinned map, and what a form makes of it: of its floor, or a quadratic of all.

    Where the flatness deviation of the instrument is known, what bows of that height make of it.
    """
    coarse = thinned(face.surface)
    flatness_m = given_bow_m("bow_left", face.surface, face.settings)
    if flatness_m is not None:
        return _bent(coarse, flatness_m)
    bow_m = bow_of_form_m(coarse, degree_taken_off(face.settings.conditioning))
    return coarse, replace(coarse, height_m=coarse.height_m - bow_m)


def _mean_or_not(face: FaceOfCaps, thinned: Thinned) -> tuple[HeightMap, ...]:
    """Return a thinned map, and it with bows as high as scans leave in their mean."""
    surface, coarse = face.surface, thinned(face.surface)
    error_m = given_bow_m(FORMS_OF_SCANS, surface, face.settings)
    return (coarse,) if error_m is None else _bent(coarse, error_m)


def _bent(coarse: HeightMap, bow_m: float) -> tuple[HeightMap, ...]:
    (row, col), (dy_m, dx_m) = np.indices(coarse.shape), coarse.pixel_size_m
    bows = bows_m(coarse, bow_m, (col + 0.5) * dx_m, (row + 0.5) * dy_m)
    return coarse, *(replace(coarse, height_m=coarse.height_m + one_m) for one_m in bows)


def _tilt_or_not(face: FaceOfCaps, thinned: Thinned) -> tuple[HeightMap, ...]:
    """Return a thinned map, and the same without its least-squares plane."""
    coarse = thinned(face.surface)
    return coarse, remove_form(coarse, "plane")[0]


def _seams_or_not(face: FaceOfCaps, thinned: Thinned) -> tuple[HeightMap, ...]:
    """Return a thinned map, and those of the fields on one level, and without tilts, too."""
    surface, heights_m = face.surface, list[np.ndarray]()
    seams = face.seams  # along lines of fine pixels
    if seams is not None:
        heights_m = [surface.height_m - up_m for up_m in (levels_m(seams), tilts_m(seams))]
    maps = surface, *(replace(surface, height_m=one_m) for one_m in heights_m)
    return tuple(thinned(one) for one in maps)


def _filtered_or_not(face: FaceOfCaps, thinned: Thinned) -> tuple[HeightMap, ...]:
    """Return a thinned map, and the same with the long waves that a filter took off."""
    return tuple(map(thinned, _both(face.surface, face.unfiltered)))


def _formed_or_not(face: FaceOfCaps, thinned: Thinned) -> tuple[HeightMap, ...]:
    """Return a thinned map, and the same with the form that was taken off."""
    return tuple(map(thinned, _both(face.surface, face.with_form)))


def _both(surface: HeightMap, other: HeightMap | None) -> tuple[HeightMap, ...]:
    return (surface,) if other is None else (surface, other)


def _interpolated_or_not(face: FaceOfCaps) -> tuple[HeightMap, ...]:
    """Return a map, and that of its measured points alone."""
    surface = face.surface
    apart = pixels_apart(surface)
    (dy_m, dx_m), (every_y, every_x) = surface.pixel_size_m, apart
    height_m = surface[every_y // 2 :: every_y, every_x // 2 :: every_x]
    return surface, HeightMap(height_m, (every_y * dy_m, every_x * dx_m), surface.origin)


def _rippled_or_not(face: FaceOfCaps) -> tuple[HeightMap, ...]:
    """Return a map, and the same without its ripple."""
    ripple = find_ripple(face.surface)
    return face.surface, *([] if ripple is None else [without_ripple(face.surface, ripple)])


def _removed_or_not(conditioned: Conditioned) -> tuple[HeightMap, HeightMap]:
    """Return a map, and the same with the points that were removed from it."""
    surface, (x_m, y_m, height_m) = conditioned.surface, conditioned.removed_m
    with_them_m = surface.height_m.copy()
    with_them_m[surface.pixel_at(x_m, y_m)] = height_m
    return surface, replace(surface, height_m=with_them_m)


OF_FEWER_POINTS = {
    "tilt_left": _tilt_or_not,
    "bow_left": _bow_or_not,
    FORMS_OF_SCANS: _mean_or_not,
    "seams": _seams_or_not,
    FILTERED: _filtered_or_not,
    FORMED: _formed_or_not,
    ELSEWHERE: lambda face, thinned: tuple(map(thinned, (face.surface, *face.elsewhere))),
}
OF_THE_MAP = {
    "interpolated": _interpolated_or_not,
    "points_filled": lambda face: (face.surface, *filled_from_fewer(face.surface)),
    COARSER: lambda face: _both(face.surface, face.finer),
    SMOOTHED: lambda face: _both(face.surface, face.with_short_waves),
    "ripple": _rippled_or_not,
}
HOW = {
    COARSER: "with more points",
    SMOOTHED: "with them, but for white noise",
    "ripple": "without it",
}  # a map is pressed of these


def _effect_on_map(
    code: str,
    contact: ContactState,
    peaks: CapTable,
    face: FaceOfCaps,
    maps: tuple[HeightMap, ...],
    least_share: float,
) -> _Moved | None:
    """Return the most that other maps change of the first, None where one has no answer.

    Pixels lower the tops of hills alike on all of them, but contacts of few pixels let go of other
    ones: of what they leave in the energies no change is told. Where the others lack a part of its
    points each, the standard error, and that of the approach as well, which counts from the
    highest.
    """
    if len(maps) == 1:
        return None
    settings, model = face.settings, contact.rung
    none = Families(None, None, (), None, None, 0.0, alike=False)
    bulk_m = contact.bulk_m if contact.approach_without_bulk_m else 0.0
    preload_N = settings.contact.preload_N

    def answers_on(surface: HeightMap) -> tuple[np.ndarray, np.ndarray]:
        known = surface is face.surface
        scene = Scene.of(peaks, none, surface, settings, peaks.usable, contact.at_ease_rad)
        if code in ROUGHER and not known:
            scene = replace(scene, noise_m=_seen_noise_m(scene))
        curve = contact.normal if known else model.build(scene)
        followed = code in ROUGHER and known  # at more forces, to far less than waves move
        if model.at_forces is not None and not followed:
            curve = model.at_forces(curve, FORCE_SHARES)
        approach_m = curve.approach_m(preload_N) - bulk_m
        found = np.append(answers(curve, model.holds_bulk, surface, settings), approach_m)
        left = {} if model.left_by_pixels is None else model.left_by_pixels(curve, preload_N)
        return found, np.array([left.get(share, 0.0) for share in FORCE_SHARES])

    try:
        (before, *after), of_pixels = zip(*map(answers_on, maps), strict=True)
    except CapslipError:
        return None
    change, left = np.abs(np.array(after) / before - 1.0), np.max(of_pixels, axis=0)
    if code != JACKKNIFED:
        moved = _Moved.by(change.max(axis=0)[:-1], least_share, of_pixels=left)
    else:
        *of_each, approach = standard_error(change)
        moved = _Moved.by(np.array(of_each), least_share, approach, left)
    return replace(moved, stiffness_N_per_m=float(before[-2]))


def _seen_noise_m(scene: Scene) -> float | None:
    """Return the white noise that a map shows, no more than is known of it; None without any.

    Fewer points average over noise: what more of them have of it is nothing that was taken off.
    """
    seen_m = white_noise_m(elastic_face(scene.surface, scene.E_star_Pa), math.inf)
    return min(seen_m, math.inf if scene.noise_m is None else scene.noise_m) or None


def _is_asked(problem: Problem, conditioned: Conditioned, filled_m: float) -> bool:
    """Tell whether a problem has an effect that caps or maps tell; of points filled so well none.

    `filled_m` is the error of these from which they may matter.
    """
    if problem.code == "points_filled":
        filling = conditioned.surface.filling
        return filling is not None and filling.error_m > filled_m
    if problem.code == BLURRED:
        return problem.effect is None  # of a map that is pressed it is known
    if problem.code == "outliers_removed":
        return conditioned.removed_m.shape[1] > 0
    others = problem.code in (*OF_THE_HEIGHTS, *OF_FEWER_POINTS, *OF_THE_MAP, *LEFT_OUT)
    return others and (problem.severity == "warning" or problem.code in ("bow_left", FORMED))


def _is_firm(problem: Problem, conditioned: Conditioned, caps: CapTable) -> bool:
    """Tell whether a warning stays one whatever it does.

    Too many outliers; points filled all too badly; tops that stay flat, over which anything may
    have stood; steps of which a hill shows too few.
    """
    return (
        (problem.code in FIRM and problem.severity == "warning")
        or (problem.code == "clipped" and _flat_tops_hide(conditioned.surface.tops, caps))
        or (problem.code == "heights_in_steps" and few_steps(conditioned.surface))
    )


def _flat_tops_hide(tops: Tops | None, caps: CapTable) -> bool:
    """Tell whether tops that stay flat hide a part of the contact, as holes of that size would.

    Not one that is no wider than a quarter of the contact of its cap. Of a contact that is not
    known, or of a top without a cap, nobody knows.
    """
    if tops is None:
        return False
    flat = tops.up_m == 0.0
    for x_m, y_m, radius_m in zip(tops.x_m[flat], tops.y_m[flat], tops.radius_m[flat], strict=True):
        own = caps.usable & (np.hypot(caps.x_m - x_m, caps.y_m - y_m) <= radius_m)
        if not (radius_m <= HIDDEN * caps.contact_radius_m[own]).any():
            return True
    return False


def _as_severe(
    problem: Problem,
    moved: _Moved | None,
    least_share: float,
    tolerance: float,
    how: str,
    conditioned: Conditioned,
    caps: CapTable,
) -> Problem:
    """Return a problem with its effect, and as severe as that unless it is a firm warning.

    Patches that were lifted are a warning where nobody knows what they move, too; so are fewer
    points than were measured and a filter of long waves, and that is said.
    """
    firm = _is_firm(problem, conditioned, caps)
    unknown_matters = problem.code == "outliers_removed" and conditioned.removed.n_lifted > 0
    if moved is None and problem.code in UNKNOWN:
        message = f"{problem.message}; nobody knows what that moves: {UNKNOWN[problem.code]}"
        severity = problem.severity if math.isinf(tolerance) else "warning"
        return replace(problem, severity=severity, message=message)
    if moved is None:
        return replace(problem, severity="warning") if unknown_matters else problem
    effect = moved.effect
    moves = firm or moved.asked > tolerance or moved.approach > VISIBLE_FORM
    said = f"the stiffness by {effect.tangential_stiffness:.1%}, the energy by "
    if effect.energy is None:
        said += f"{moved.hidden:.1%} at most, no more than pixels leave in it"
    else:
        said += f"{effect.energy:.1%}"
    if moved.asked <= tolerance < effect.greatest:
        said += f", by no more than {moved.asked:.1%} from {percent(least_share)} of gross slip on"
    if effect.energy is not None and moved.hidden > max(moved.asked, tolerance):
        said += f", and by {moved.hidden:.1%} where pixels leave as much"
    said += f", the approach by {moved.approach:.1%}" if moved.approach else ""
    message = f"{problem.message}; that moves {said} ({how})"
    return replace(problem, severity="warning" if moves else "info", message=message, effect=effect)


def _effect(trials: Trials, code: str, least_share: float) -> _Moved | None:
    """Return the greatest changes by all trials of a doubt; unknown where one cannot be pressed.

    And that of the approach, which a bow moves before all else: it counts from the highest peaks.
    """
    change, approach, face = np.zeros(len(FORCE_SHARES) + 1), 0.0, trials.face
    pressed = trials.face_of(code)
    try:
        before_m = face.approach_m(trials.caps) if code in BOWS else math.nan
        for caps in trials.of(code):
            change = np.maximum(change, np.abs(pressed.answers(caps) / trials.before - 1.0))
            if code in BOWS:
                approach = max(approach, abs(face.approach_m(caps) / before_m - 1.0))
    except CapslipError:
        return None
    return _Moved.by(change, least_share, approach) if np.isfinite(change).all() else None
