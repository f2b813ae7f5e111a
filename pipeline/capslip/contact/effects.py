"""What doubts move: the face is pressed again as it may be as well, and the answers compared."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import msgspec
import numpy as np

from capslip.caps.doubts import without_bow
from capslip.caps.families import Families
from capslip.caps.table import DOUBTFUL, UNUSABLE, CapFlag, CapTable
from capslip.contact.accuracy import answers
from capslip.contact.doubts import ELASTIC_STRAIN
from capslip.contact.levelling import coarse_map, rebalanced
from capslip.contact.material import composite, yield_law
from capslip.contact.models.interacting import InteractingCurve
from capslip.contact.reach import reachable
from capslip.contact.rung import Rung, Scene, load_point_m, turning_stiffness
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.errors import CapslipError, ContactError
from capslip.problems import Effect, Problem
from capslip.settings import Settings
from capslip.surface.conditioning import Conditioned
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap
from capslip.surface.holes import holes
from capslip.surface.interpolated import pixels_apart
from capslip.surface.rounding import few_steps
from capslip.surface.seams import find_seams, without_seams

LEFT_OUT = {  # flags of the caps that may carry nothing
    "load_on_doubtful_caps": DOUBTFUL,
}
MOST_CAPS = 500  # more take longer than the face itself
MOST_POINTS = 100  # the highest of those that were removed: more do no less
DRAWS = 8  # of the hills in a hole
DRAWS_OF_HEIGHTS = 16
OF_THE_HEIGHTS = ("hole_may_hide_hills", "clipped", "heights_in_steps")
LOOSE = 1e-5  # tolerance of a solution that is only compared with another


@dataclass(frozen=True, eq=False)
class _Face:
    """A face of caps, whose answers to changes are asked for."""

    surface: HeightMap
    settings: Settings

    def pressed(self, caps: CapTable) -> tuple[CapTable, InteractingCurve]:
        """Return the caps over the plane that balances them, and their curve with interaction."""
        settings, n_usable = self.settings, int(caps.usable.sum())
        if not 0 < n_usable <= MOST_CAPS:
            raise ContactError(f"{n_usable} caps; expected 1 to {MOST_CAPS}")
        if turning_stiffness(settings) == 0.0:
            at_m = load_point_m(self.surface, settings)
            caps, _ = rebalanced(caps, caps, caps.usable, at_m, settings)
        elif not math.isinf(turning_stiffness(settings)):
            raise ContactError("what holds the face upright was at ease with other caps")
        material, preload_N = settings.material, settings.contact.preload_N
        given = caps, self.surface, self.E_star_Pa, preload_N, yield_law(material)
        pairs = reachable(*given).pairs
        if pairs is None:
            raise ContactError("too many caps to solve for every pair")
        return caps, pairs

    def answers(self, caps: CapTable) -> np.ndarray:
        """Return energies and stiffness, see `accuracy.answers`."""
        return answers(self.pressed(caps)[1], True, self.surface, self.settings)

    @property
    def E_star_Pa(self) -> float:
        """Composite modulus."""
        material = self.settings.material
        return composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa


def with_effects(
    problems: list[Problem],
    caps: CapTable,
    peaks: CapTable,
    conditioned: Conditioned,
    settings: Settings,
    model: Rung[Any] | None = None,
) -> list[Problem]:
    """Return the problems, those about single caps with their effects, and as severe as these.

    Each is estimated by interacting caps, whatever model answers: flagged caps may carry nothing; a
    bow or the levels of stitched fields may not be the face's own; a hole may hold as many hills as
    the rest; points that were removed may have been there. Where the map itself answers, bow and
    levels are taken off it, on points so far apart that this costs little; of one that was
    interpolated, the measured points alone are pressed. Within `contact.tolerance` it is
    information, else a warning.

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
    model : Rung, optional
        Which answers.
    """
    face, tolerance = _Face(conditioned.surface, settings), settings.contact.tolerance
    asked = {one.code for one in problems if _is_asked(one, conditioned)}
    effects: dict[str, Effect | None] = {}
    how = dict.fromkeys(asked, "estimated with the caps")
    for code in sorted(asked & OF_THE_MAP.keys()):
        if model is not None and model.made_from == "map":
            by_map = _effect_on_map(model, peaks, face, OF_THE_MAP[code](face.surface))
            if by_map is not None:
                asked.remove(code)
                effects[code], how[code] = by_map, "found on the map with fewer points"
    if asked:
        try:
            before = face.answers(caps)
            trials = _Trials(face, caps, peaks, conditioned)
            effects |= {code: _effect(trials, code, before) for code in asked}
        except CapslipError:
            pass  # what cannot be pressed has no effect, and stays as it is
    return [
        _as_severe(one, effects.get(one.code), tolerance, how[one.code], _is_firm(one, conditioned))
        if _is_asked(one, conditioned)
        else one
        for one in problems
    ]


def _bow_or_not(surface: HeightMap) -> tuple[HeightMap, HeightMap]:
    """Return a coarse map, and what `conditioning.form` = quadratic makes of it."""
    coarse = coarse_map(surface)
    level_m, straight_m = (remove_form(coarse, form)[0].height_m for form in ("plane", "quadratic"))
    return coarse, replace(coarse, height_m=coarse.height_m - (level_m - straight_m))


def _seams_or_not(surface: HeightMap) -> tuple[HeightMap, HeightMap]:
    """Return a coarse map, and that of the fields on one level; seams are lines of fine pixels."""
    seams = find_seams(surface)
    level = surface if seams is None else without_seams(surface, seams)
    return coarse_map(surface), coarse_map(level)


def _interpolated_or_not(surface: HeightMap) -> tuple[HeightMap, HeightMap]:
    """Return a map, and that of its measured points alone."""
    apart = pixels_apart(surface)
    (dy_m, dx_m), (every_y, every_x) = surface.pixel_size_m, apart
    height_m = surface[every_y // 2 :: every_y, every_x // 2 :: every_x]
    return surface, HeightMap(height_m, (every_y * dy_m, every_x * dx_m), surface.origin)


OF_THE_MAP = {
    "bow_left": _bow_or_not,
    "seams": _seams_or_not,
    "interpolated": _interpolated_or_not,
}


def _effect_on_map(
    model: Rung[Any], peaks: CapTable, face: _Face, maps: tuple[HeightMap, HeightMap]
) -> Effect | None:
    """Return what another map changes, None where it has no answer.

    Pixels lower the tops of hills alike on both maps.
    """
    settings = face.settings
    contact = settings.contact
    loose = max(contact.solver_tolerance, LOOSE)
    quick = msgspec.structs.replace(
        settings, contact=msgspec.structs.replace(contact, solver_tolerance=loose)
    )
    none = Families(None, None, (), None, None, 0.0, alike=False)
    try:
        before, after = (
            answers(
                model.build(Scene.of(peaks, none, one, quick, peaks.usable)),
                model.holds_bulk,
                one,
                quick,
            )
            for one in maps
        )
    except CapslipError:
        return None
    change = np.abs(after / before - 1.0)
    energy = float(change[:-1].max())
    return Effect(float(change[-1]), energy, energy)


def _is_asked(problem: Problem, conditioned: Conditioned) -> bool:
    """Tell whether a problem has an effect that caps tell."""
    if problem.code == "outliers_removed":
        return conditioned.removed_m.shape[1] > 0
    others = problem.code in (*OF_THE_HEIGHTS, *OF_THE_MAP, *LEFT_OUT)
    return others and problem.severity == "warning"


def _is_firm(problem: Problem, conditioned: Conditioned) -> bool:
    """Tell whether a warning stays one whatever it does.

    One that may be no information; too many outliers; tops that stay flat, over which anything may
    have stood; steps of which a hill shows too few.
    """
    tops = conditioned.surface.tops
    return (
        "info" not in problem.kind.severities
        or (problem.code == "outliers_removed" and problem.severity == "warning")
        or (problem.code == "clipped" and tops is not None and tops.left > 0)
        or (problem.code == "heights_in_steps" and few_steps(conditioned.surface))
    )


def _as_severe(
    problem: Problem, effect: Effect | None, tolerance: float, how: str, firm: bool
) -> Problem:
    """Return a problem with its effect, and as severe as that unless it is a firm warning."""
    if effect is None:
        return problem
    greatest = max(effect.tangential_stiffness or 0.0, effect.energy or 0.0)
    moves = firm or greatest > tolerance
    said = f"; that moves the stiffness by {effect.tangential_stiffness:.1%}, the energy by "
    message = f"{problem.message}{said}{effect.energy:.1%} ({how})"
    return replace(problem, severity="warning" if moves else "info", message=message, effect=effect)


def _effect(trials: "_Trials", code: str, before: np.ndarray) -> Effect | None:
    """Return the greatest changes by all trials of a doubt; None where one cannot be pressed."""
    change = np.zeros(len(before))
    try:
        for caps in trials.of(code):
            change = np.maximum(change, np.abs(trials.face.answers(caps) / before - 1.0))
    except CapslipError:
        return None
    energy = float(change[:-1].max())
    return Effect(float(change[-1]), energy, energy)


@dataclass(frozen=True, eq=False)
class _Trials:
    """The caps of a face as they may be as well."""

    face: _Face
    caps: CapTable
    peaks: CapTable
    conditioned: Conditioned

    def of(self, code: str) -> Iterator[CapTable]:
        """Return what to press instead, for the problems of one code."""
        if code == "bow_left":
            yield self._unbowed()
        elif code == "seams":
            yield self._on_one_level()
        elif code in OF_THE_MAP:
            raise ContactError(f"{code}: caps do not tell")
        elif code == "hole_may_hide_hills":
            yield from self._with_hills()
        elif code == "outliers_removed":
            yield from self._with_points()
        elif code == "clipped":
            yield from self._with_other_tops()
        elif code == "heights_in_steps":
            yield from self._with_rounding()
        else:
            yield self._without(LEFT_OUT[code])

    def _unbowed(self) -> CapTable:
        caps, span_m = without_bow(self.caps, coarse_map(self.face.surface), self.peaks)
        if span_m > np.nanmax(self.caps.cap_height_m):
            raise ContactError("the bow may hold hills below the cut, which are no caps yet")
        return caps

    def _on_one_level(self) -> CapTable:
        surface, caps = self.face.surface, self.caps
        seams, (dy_m, dx_m) = find_seams(surface), surface.pixel_size_m
        if seams is None:
            raise ContactError("there are no seams in the map that was pressed")
        offset_m = seams.offset_at_m(caps.y_m / dy_m, caps.x_m / dx_m)
        return caps.with_columns(peak_height_m=caps.peak_height_m - offset_m)

    def _without(self, flag: CapFlag) -> CapTable:
        caps = self.caps
        flagged = caps.usable & ((caps.flags & flag) != 0)
        if not flagged.any():
            raise ContactError("no cap has the flag that the problem is about")
        return caps.with_columns(flags=np.where(flagged, caps.flags | UNUSABLE, caps.flags))

    def _with_other_tops(self) -> Iterator[CapTable]:
        """Return caps whose tops were cut off, moved by their standard errors.

        A top that is higher is sharper, too: the flanks hold its rim.
        """
        tops, caps = self.face.surface.tops, self.caps
        if tops is None or tops.x_m.size == 0:
            raise ContactError("nobody knows which tops were cut off")
        height_se_m, log_radius_se, _ = tops.errors_at(caps.x_m, caps.y_m)
        if not height_se_m[caps.usable].any():
            raise ContactError("no cap stands where tops were cut off")
        yield from _moved(caps, height_se_m, log_radius_se)

    def _with_rounding(self) -> Iterator[CapTable]:
        """Return caps whose heights are moved by the error of rounding, each for itself.

        What lifts a top and leaves the rim of its fit makes it sharper.
        """
        rounding, caps = self.face.surface.rounding, self.caps
        error_m = 0.0 if rounding is None else rounding.error_m
        yield from _moved(caps, error_m, np.nan_to_num(error_m / caps.fit_depth_m))

    def _with_hills(self) -> Iterator[CapTable]:
        """Return caps with those that the hole would hold if it were like the rest of the face."""
        surface, caps = self.face.surface, self.caps
        row, col = np.nonzero(holes(surface))
        if surface.filling is not None or not row.size:
            raise ContactError("nobody knows where points that were filled hide hills")
        member = np.flatnonzero(caps.usable)
        n_known = surface.n_measured
        n_more = max(1, round(member.size * row.size / n_known))
        dy_m, dx_m = surface.pixel_size_m
        rng = np.random.default_rng(0)
        for _ in range(DRAWS):
            at = rng.choice(row.size, n_more, replace=False)
            like = rng.choice(member, n_more)
            place_m = (col[at] + 0.5) * dx_m, (row[at] + 0.5) * dy_m
            yield _joined(caps, *place_m, caps.peak_height_m[like], caps.radius_m[like])

    def _with_points(self) -> Iterator[CapTable]:
        """Return caps with the removed points that would touch, if there are any.

        A point is a flat punch of the area of a pixel, pressed in by what it stands above the
        surface that the caps have sunk, at most until it yields: the load is 2 E* a e. Its cap has
        that load at that compression e. Within a contact it counts as if it stood at its rim.
        """
        surface, E_star_Pa = self.face.surface, self.face.E_star_Pa
        x_m, y_m, height_m = self.conditioned.removed_m
        n = len(self.caps)
        asleep = _joined(self.caps, x_m, y_m, height_m, np.full(x_m.size, np.nan))
        caps, curve = self.face.pressed(asleep)
        preload_N = self.face.settings.contact.preload_N
        approach_m = float(curve.approach_m(preload_N))
        load_N = curve.asperity_loads_N(approach_m)
        x_m, y_m = _on_rims(x_m, y_m, curve, contact_radius_m(load_N, curve.radius_m, E_star_Pa))
        plane_m = float(caps.peak_height_m[:n][caps.usable[:n]].max()) - approach_m
        r_m = np.hypot(x_m[:, None] - curve.x_m, y_m[:, None] - curve.y_m)
        sunk_m = (load_N / r_m).sum(axis=1) / (math.pi * E_star_Pa)
        up_m = caps.peak_height_m[n:] - plane_m - sunk_m
        touch = np.argsort(-up_m, kind="stable")[: min(MOST_POINTS, int((up_m > 0.0).sum()))]
        if touch.size == 0:
            return
        punch_m = math.sqrt(surface.pixel_area_m2 / math.pi)
        law = yield_law(self.face.settings.material)
        hardest_Pa = ELASTIC_STRAIN * E_star_Pa if law is None else law.hardness_Pa
        pressed_m = np.minimum(up_m[touch], 0.5 * math.pi * punch_m * hardest_Pa / E_star_Pa)
        top_m = height_m[touch] - up_m[touch] + pressed_m
        yield _joined(self.caps, x_m[touch], y_m[touch], top_m, 2.25 * punch_m**2 / pressed_m)


def _moved(
    caps: CapTable, height_m: float | np.ndarray, log_radius: np.ndarray
) -> Iterator[CapTable]:
    """Return caps moved up or down, each for itself; those that are higher are sharper.

    The greatest of 16 changes is about that at 95 %.
    """
    rng = np.random.default_rng(0)
    for sign in rng.choice((-1.0, 1.0), (DRAWS_OF_HEIGHTS, len(caps))):
        yield caps.with_columns(
            peak_height_m=caps.peak_height_m + sign * height_m,
            radius_m=caps.radius_m * np.exp(-sign * log_radius),
        )


def _on_rims(
    x_m: np.ndarray, y_m: np.ndarray, curve: InteractingCurve, a_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return places, those within a contact moved to its rim: point loads sink no deeper there."""
    off_m = np.stack((x_m[:, None] - curve.x_m, y_m[:, None] - curve.y_m))
    r_m = np.hypot(*off_m)
    point = np.arange(x_m.size)
    inmost = np.argmax(a_m - r_m, axis=1)
    a_m, r_m, off_m = a_m[inmost], r_m[point, inmost], off_m[:, point, inmost]
    out = np.where(r_m < a_m, a_m / np.maximum(r_m, 1e-300) - 1.0, 0.0)
    at_peak = (r_m == 0.0) * a_m
    return x_m + out * off_m[0] + at_peak, y_m + out * off_m[1]


def _joined(
    caps: CapTable, x_m: np.ndarray, y_m: np.ndarray, height_m: np.ndarray, radius_m: np.ndarray
) -> CapTable:
    """Return caps with more of them; one without a radius is not usable."""
    more = {"x_m": x_m, "y_m": y_m, "peak_height_m": height_m, "radius_m": radius_m}
    more["flags"] = np.where(np.isfinite(radius_m), 0, UNUSABLE).astype(caps.flags.dtype)
    columns = {}
    for one in fields(CapTable):
        column = getattr(caps, one.name)
        blank = "" if column.dtype.kind in "UO" else np.zeros(1, column.dtype)[0]
        added = more.get(one.name, np.full(x_m.shape, blank, column.dtype))
        columns[one.name] = np.concatenate((column, added))
    return CapTable(**columns)
