"""What a map that is pressed itself is unsure of: `error_of_map` of its curve."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from time import thread_time
from types import MappingProxyType

import numpy as np

from capslip.contact.map_curve import BoundaryElementCurve
from capslip.contact.map_doubts import (
    ASKED,
    doubted_of,
    less_noise,
    noisy,
    of_detail,
    of_resolution,
    unresolved,
)
from capslip.contact.plastic_law import LawError, of_contact
from capslip.contact.rung import ModelError
from capslip.contact.solvers.detail import (
    FORCE_SHARES,
    Detail,
    FirstLoading,
    effect_of_blur,
    effect_of_detail,
    effect_of_pixels,
    effect_of_refinement,
    effect_of_spline,
    until,
)
from capslip.contact.solvers.elastic_face import ElasticFace, TakenNoise
from capslip.contact.solvers.noise import (
    LENGTHS,
    loss_noise_per_m,
    noise_by_length_m,
    white_noise_m,
)
from capslip.contact.solvers.refinement import SMOOTH, WIDE_ENOUGH
from capslip.contact.solvers.unloading import SMALL_SLIP, Unloading, path_at
from capslip.contact.time_needed import more_time
from capslip.errors import OutOfTimeError
from capslip.problems import Effect, Problem
from capslip.surface.between import missed_of_all_m
from capslip.units import percent

# Over what pixels leave in the energy of spheres, by shares of mu N, so that nearly all are within
PIXELS_95 = {0.1: 3.0, 0.25: 6.0, 0.5: 6.0, 0.75: 6.0, 1.0: 6.0}
# What a spline leaves there by each point along a side of a pixel, from as many on, up to as many:
# the more there are, the fewer pixels tell of the contact; of fewer it is below `LEAST_ERROR`
SPLINE_95 = {0.1: 0.0015, 0.25: 0.001, 0.5: 0.0007, 0.75: 0.0007}
SPLINE_POINTS = 7, 30
# Of metal, the most that both say from a tenth on where other points were solved as well: they
# rest on spheres with wider rings, and rough faces and fully plastic spheres are off by less; what
# no points follow at small forces falls as round contacts of metal do, see `as_metal`
MOST_OF_RINGS = 1.0
STIFFNESS_95 = 0.75  # of what they leave in the energy at three quarters, in the stiffness
SMALL_NOISE = 0.05  # of the approach, up to which what is noise counts to first order
MOSTLY_WHITE = 0.7  # of the detail, from which on it is: rough faces with a Hurst exponent of 0.8
# and more have 0.65 at most
MOST_OF_NOISE = 1.0  # relative, of the energy: first order ends where all of it would go
NORMAL_95 = 1.96  # standard deviations of noise that hold 95 %
# Over what detail moves of stiffness and energy where noise is more than small: 95 % are within
STRONG_95 = 1.5, 1.3
# Over what one more blur moves of stiffness and energy: 95 % of what the first has moved are within
BLURRED_95 = 2.0, 2.5
OF_BLURRED = 3.0  # times what it moves of the stiffness: the energy moves 2 to 8 times as much
MOST_MOVED = 0.9  # of the greater of two values: beyond an order of magnitude none is known anyway
LEAST_ERROR = 0.01  # of stiffness and energy, by the pixels of contacts that are resolved
METAL_ERROR = 0.03  # the same of the energy of metal, whose pressures are known at the pixels alone
# Correlation length of what is missed, over how far the points lie apart: on rough faces of every
# other point the energy at 0.25 mu N is off by 0.5 to 0.85 standard deviations then
OF_APART = 0.3
STIFFNESS_MISSED = 0.4  # of what they miss in the energy at three quarters, in the stiffness
# It bounds the noise of the highest points, where that of all neighbours holds roughness as well
ALLOWED = "as much white noise as differences from pixel to pixel allow, {:.2g} m a point,"
NOTHING = 1e-12  # stands for an error of zero in a logarithm
NOTHING_MISSED = 2e-4  # of the approach: it moves the energy by a tenth of `LEAST_ERROR`
# Of mu N, at which the effect of given noise is solved: slopes of the pressures lie between them
NOISE_SHARES = (0.05, 0.1, 0.15, 0.25, 0.35, 0.5, 0.65, 0.75)


@dataclass(frozen=True)
class _Causes:
    """What moves the energy at a force more, the smaller it is."""

    unloading: Unloading
    noise_m: float  # white, that counts
    given: Mapping[float, float] | None = None  # by shares of mu N, what noise that is given does
    coarser: Mapping[float, float] | None = None  # the same, what coarser pixels move
    between: Mapping[float, float] | None = None  # the same, what laid faces miss
    law: LawError | None = None  # what the plastic law leaves, at any force
    of_contact: float = 1.0  # share of the contact in the compliance, with the bulk that is kept

    def at(self, share: float) -> tuple[float, float]:
        """Return what pixels and noise do to the energy at a share of mu N, relative, at 95 %."""
        near = min(share, FORCE_SHARES[-1])
        of_pixels = _of_pixels(self.unloading, share)
        if self.coarser:
            if self.law is not None and share >= SMALL_SLIP:
                of_pixels = min(of_pixels, MOST_OF_RINGS)
            of_pixels = max(of_pixels, self.coarser.get(near, 0.0))
        if self.given is not None:
            return of_pixels, self.given[near]
        drop_N = share * self.unloading.load_N
        of_noise = NORMAL_95 * self.noise_m * self.unloading.noise_per_m(drop_N)
        return of_pixels, min(of_noise, MOST_OF_NOISE)

    def at_any(self, share: float) -> tuple[float, float]:
        """Return what `at` does at any share, by powers between those known."""
        if share in PIXELS_95:
            return self.at(share)
        rows = np.log(np.maximum([self.at(one) for one in PIXELS_95], NOTHING))
        known = np.log(tuple(PIXELS_95))
        of_pixels, of_noise = (float(np.interp(math.log(share), known, one)) for one in rows.T)
        return math.exp(of_pixels), math.exp(of_noise)

    def missed_at(self, share: float) -> float:
        """Return what laid faces miss between their points does to the energy, at 95 %."""
        return (self.between or {}).get(min(share, FORCE_SHARES[-1]), 0.0)


@dataclass(frozen=True)
class _Seen:
    """What detail, pixels and noise of a map leave, and what there is to say of it."""

    causes: _Causes
    detail: Detail
    tolerance: float
    pixel_m: float
    noise_m: float | None  # of the instrument, where it is known
    taken: TakenNoise | None
    faces: float
    filtered: bool  # whether the settings have an S-filter: then no other one is a way out
    warned: bool  # of what other forces do not help
    blur: Detail | None = None  # what that of the optics leaves, where their period is given
    period_m: float = math.nan

    def doubts_at(self, asked: float) -> tuple[Problem, ...]:
        """Return it where a share of mu N is asked for, from a quarter on; at that, of all forces.

        Whoever asks at a greater force is not told what is left at a smaller one.
        """
        tolerance, noise_m = self.tolerance, self.noise_m
        of_pixels, of_noise = self.causes.at_any(asked)
        given = self.detail, of_pixels, tolerance, self.pixel_m, noise_m is not None
        found = of_detail(*given, asked, self.filtered)
        if self.blur is not None:
            found += of_resolution(self.blur, tolerance, self.period_m)
        if not any(one.severity == "warning" for one in found):
            if of_noise > tolerance:
                counted_m = self.causes.noise_m
                of = f"noise of {noise_m:.2g} m a point" if noise_m else ALLOWED.format(counted_m)
                white = None if noise_m else counted_m
                scan = self.taken, self.pixel_m, white, self.faces, self.filtered
                less = less_noise(of_noise / tolerance, *scan)
                found.append(noisy(of, of_noise, of_pixels, tolerance, less, asked))
            elif (of_either := math.hypot(of_pixels, of_noise)) > tolerance:
                found.append(unresolved("warning", asked, of_either))
        known = self.warned or any(one.severity == "warning" for one in found)
        if (of_both := math.hypot(*self.causes.at(SMALL_SLIP))) > tolerance and not known:
            found.append(unresolved("info", SMALL_SLIP, of_both))
        return tuple(found)


def error_of_map(
    curve: BoundaryElementCurve,
    load_N: float,
    tolerance: float,
    noise_m: float | None = None,
    filtered: bool = False,
    period_m: float | None = None,
) -> tuple[ModelError | None, tuple[Problem, ...]]:
    """Return the errors of stiffness and energy, and what takes them beyond the tolerance.

    What is left between the solved loads, what pixels and noise leave, what the finest detail of
    the map decides, and what is open of the law by which it yields, see `law_of_map`. Of the energy
    all but that fall with the force: they are no more than noted where they are beyond the
    tolerance below a quarter of mu N alone.

    Parameters
    ----------
    curve : BoundaryElementCurve
        As slip uses it: its stiffness is meant, with the bulk sinking or without.
    load_N : float
        Under which it is.
    tolerance : float
        Relative, beyond which an error is a problem.
    noise_m : float, optional
        Measurement noise of the instrument, which may be correlated over a few pixels. Where it is
        not known, as much as changes from pixel to pixel counts, and is white.
    filtered : bool
        Whether the settings have an S-filter: then none is advised.
    period_m : float, optional
        Lateral period limit of the instrument. Where it is not known, what the blur of the optics
        has moved is in no error.
    """
    law, unknown_to_N = curve.law(load_N), curve.unloading(load_N).unknown_to_N
    curve = replace(curve, as_solved=True)  # as what it is compared with
    unloading = replace(curve.unloading(load_N), unknown_to_N=unknown_to_N)
    pressed = curve.pressed(load_N)
    first = curve.loaded_first_to(load_N)
    taken = first.face.taken
    found = [] if taken is None else [_noise_taken(taken)]
    between = unloading.loss_error
    more = more_time(first.face.depth_m.shape, curve.solutions.time_limit_s)
    if between > tolerance or _unknown_to(unloading) > SMALL_SLIP:
        found.append(_between_loads(unloading, more))
    least = max(between, LEAST_ERROR if law is None else METAL_ERROR)
    white_m = white_noise_m(first.face, first.approach_m)
    counted_m = _counted_m(white_m, first.approach_m)
    causes = _Causes(unloading, counted_m, law=law, of_contact=of_contact(curve, load_N))
    if noise_m is not None:
        causes = replace(causes, given=_of_given(curve, load_N, first, noise_m))
    if (missed := _missed(curve, load_N, first, noise_m)) is not None:
        causes = replace(causes, between=missed)
        if (most := missed[ASKED]) > tolerance:
            found.append(_mate_coarse(first.face, noise_m, most))
    of_both = math.hypot(*causes.at(SMALL_SLIP))
    if curve.solutions.leaves_none(unloading):
        return _with_pixels(causes, max(least, of_both), least), tuple(found)
    try:
        with curve.solutions.counted(load_N):
            detail, changes = _pressed_again(curve, load_N, first)
            blur = None if period_m is None else _left_by_blur(curve, load_N, first, period_m)
    except OutOfTimeError:
        found.append(_out_of_time(curve.solutions.time_limit_s, more))
        return _with_pixels(causes, max(least, of_both), least), tuple(found)
    counted_m = _counted_m(white_m, first.approach_m, detail.white_share)
    causes = replace(causes, noise_m=counted_m, coarser=changes)
    if noise_m is not None and noise_m < white_m:  # the rest of it is the face's
        detail = replace(detail, white_share=detail.white_share * noise_m / white_m)
    warned = any(one.severity == "warning" and one.code != "loss_between_loads" for one in found)
    of_scan = max(pressed.pixel_size_m), noise_m, taken, first.face.faces
    of_optics = blur, math.nan if period_m is None else period_m
    seen = _Seen(causes, detail, tolerance, *of_scan, filtered, warned, *of_optics)
    found += seen.doubts_at(ASKED)
    factor = doubted_of(detail)
    # As what is left where nearly all of the contact slips: both are of all of it alike
    pixels_of_whole, noise_of_whole = causes.at(FORCE_SHARES[-1])
    strong = white_m > SMALL_NOISE * first.approach_m
    of_detail, energy = _left_by_detail(detail, factor, strong)
    of_points = causes.of_contact * max(noise_of_whole, STIFFNESS_95 * pixels_of_whole)
    stiffness = max(of_detail, of_points, LEAST_ERROR)
    errors = _with_blur(_with_pixels(causes, stiffness, least, energy), blur)
    return replace(errors, doubts_at=seen.doubts_at), tuple(found)


def left_by_pixels(curve: BoundaryElementCurve, load_N: float) -> dict[float, float]:
    """Return what pixels leave in the energy, by shares of mu N, relative, at 95 %."""
    unloading = curve.unloading(load_N)
    return {share: _of_pixels(unloading, share) for share in PIXELS_95}


def _of_pixels(unloading: Unloading, share: float) -> float:
    of_pixels = PIXELS_95[share] * unloading.pixel_error(share * unloading.load_N)
    (least, most), points = SPLINE_POINTS, unloading.refinement
    if points < least:
        return of_pixels
    return max(of_pixels, SPLINE_95.get(share, 0.0) * min(points, most))


def _pressed_again(
    curve: BoundaryElementCurve, load_N: float, first: FirstLoading
) -> tuple[Detail, dict[float, float]]:
    """Return what the finest detail does, and what coarser pixels move, by shares of mu N."""
    solutions, unloading = curve.solutions, curve.unloading(load_N)
    face, pressed, tolerance = solutions.face, curve.pressed(load_N), solutions.tolerance
    begun_s = thread_time()
    detail = effect_of_detail(first, *_asked_of_smoother(curve, load_N))
    changes: dict[float, float] = {}
    if unloading.refinement > 1:
        until_s = until(unloading, solutions.left_s(load_N) - (thread_time() - begun_s))
        given = (face, pressed, unloading, tolerance, until_s)
        each = [effect_of_refinement(*given)]
        if unloading.spline == "fifth":
            each.append(effect_of_spline(*given))
        changes = {at: max(one.get(at, 0.0) for one in each) for at in FORCE_SHARES}
    elif face.yielded or pressed.pixels_across >= WIDE_ENOUGH:
        left_s = solutions.left_s(load_N)
        changes = effect_of_pixels(first, unloading, tolerance, pressed.pressure_Pa, left_s)
    return detail, changes


def _asked_of_smoother(
    curve: BoundaryElementCurve, load_N: float
) -> tuple[Unloading, float, float, bool, float, np.ndarray]:
    """Return what a smoother map is pressed with, see `effect_of_detail`."""
    solutions, unloading = curve.solutions, curve.unloading(load_N)
    resolved = unloading.smallest_drop_N < SMALL_SLIP * load_N and all(
        problem.code != "under_resolved" for problem in curve.problems(load_N)
    )
    asked = unloading, solutions.tolerance, -curve.compliance_m_per_N, resolved
    return *asked, solutions.left_s(load_N), curve.pressed(load_N).pressure_Pa


def _left_by_blur(
    curve: BoundaryElementCurve, load_N: float, first: FirstLoading, period_m: float
) -> Detail:
    """Return what the blur of the optics may have moved: what one more moves, so many times.

    As logarithms, as `_left_by_detail`. Of the energies the greatest counts at each force, and no
    less than the stiffness tells: what a blur moves of them crosses zero between two forces, and
    for the first one elsewhere.
    """
    again = effect_of_blur(first, period_m, *_asked_of_smoother(curve, load_N)).effect
    moved = np.array((again.tangential_stiffness or 0.0, again.energy or 0.0))
    stiffer, more = (-np.log1p(-np.minimum(moved, MOST_MOVED))).tolist()
    stiffness, energy = BLURRED_95[0] * stiffer, BLURRED_95[1] * max(more, OF_BLURRED * stiffer)
    return Detail(Effect(stiffness, energy, energy), energy=(energy,) * len(FORCE_SHARES))


def _with_blur(errors: ModelError, blur: Detail | None) -> ModelError:
    """Return the errors with what the blur of the optics leaves, which is a cause of its own."""
    if blur is None:
        return errors
    by_share = tuple(
        (share, math.hypot(error, blur.energy_at(share))) for share, error in errors.energy_by_share
    )
    of_optics = blur.effect.tangential_stiffness or 0.0, blur.effect.energy or 0.0
    stiffness = math.hypot(errors.stiffness, of_optics[0])
    errors = replace(errors, stiffness=stiffness, energy=max(error for _, error in by_share))
    return replace(errors, energy_by_share=by_share, blur=of_optics)


def _counted_m(noise_m: float, approach_m: float, white_share: float = 0.0) -> float:
    """Return the noise that counts to first order.

    A little of it, whatever it is; more where the finest detail of the map may be little else, as
    roughness changes from pixel to pixel as well. Beyond that it is no small change, and what the
    map without its detail says is all there is.
    """
    most = SMALL_NOISE if white_share >= MOSTLY_WHITE else SMOOTH
    return noise_m if noise_m <= most * approach_m else 0.0


def _of_given(
    curve: BoundaryElementCurve, load_N: float, first: FirstLoading, noise_m: float
) -> dict[float, float]:
    """Return what noise of the instrument does to the energy, by shares of mu N, at 95 %."""
    solutions, pressed = curve.solutions, curve.pressed(load_N)
    with solutions.counted(load_N):
        path, _ = path_at(solutions.face, pressed, solutions.tolerance, NOISE_SHARES)
    drop_N, *per_m = loss_noise_per_m(path, LENGTHS)
    by_length_m = _by_length_m(first, noise_m)
    relative = NORMAL_95 * np.sqrt(np.square(by_length_m) @ np.square(per_m))
    at_N = np.array(FORCE_SHARES) * load_N
    relative = np.minimum(np.interp(at_N, drop_N, relative), MOST_OF_NOISE)
    return dict(zip(FORCE_SHARES, relative.tolist(), strict=True))


def _missed(
    curve: BoundaryElementCurve, load_N: float, first: FirstLoading, noise_m: float | None
) -> dict[float, float] | None:
    """Return what faces that were laid miss between their points, by shares of mu N, at 95 %.

    As noise of that rms, as long as the waves are that just go between these points.
    """
    missed_m = _missed_m(first.face, noise_m)
    if missed_m <= NOTHING_MISSED * first.approach_m:
        return None
    solutions, pressed = curve.solutions, curve.pressed(load_N)
    apart_m = max(one.apart_m for one in first.face.between)
    lengths = (OF_APART * apart_m / math.sqrt(first.face.pixel_area_m2),)
    with solutions.counted(load_N):
        path, _ = path_at(solutions.face, pressed, solutions.tolerance, NOISE_SHARES)
    drop_N, per_m = loss_noise_per_m(path, lengths)
    at_N = np.array(FORCE_SHARES) * load_N
    relative = np.interp(at_N, drop_N, NORMAL_95 * missed_m * per_m)
    return dict(zip(FORCE_SHARES, np.minimum(relative, MOST_OF_NOISE).tolist(), strict=True))


def _missed_m(face: ElasticFace, noise_m: float | None) -> float:
    """Return the rms that laid faces miss; the noise that is given is that of all scans."""
    of_scan_m = None if noise_m is None else noise_m / math.sqrt(face.faces)
    return missed_of_all_m(face.between, of_scan_m)


def _by_length_m(first: FirstLoading, noise_m: float) -> np.ndarray:
    """Return the noise of each of `LENGTHS`, with the white one that was taken off before."""
    if (taken := first.face.taken) is None:
        return noise_by_length_m(first.face, first.approach_m, noise_m)
    rest_m = math.sqrt(max(noise_m**2 - taken.noise_m**2, 0.0))
    by_length_m = noise_by_length_m(first.face, first.approach_m, rest_m)
    by_length_m[0] = taken.noise_m
    return by_length_m


def _left_by_detail(
    detail: Detail, factor: float, strong: bool
) -> tuple[float, dict[float, float]]:
    """Return the errors of stiffness and, by shares of mu N, of the energy that detail leaves.

    As logarithms, as which intervals take them: what a map without its detail has four times less
    of is no nearer than what it has four times more of. Strong noise moves the less, the more there
    is already, so what is left of it moves more than its share, and at each force as it may.
    """
    energies = np.array([detail.energy_from(0.0 if strong else at) for at in FORCE_SHARES])
    stiffness, left = (
        factor * -np.log1p(-np.minimum(moved, MOST_MOVED))
        for moved in (detail.effect.tangential_stiffness or 0.0, energies)
    )
    if strong:
        stiffness, left = STRONG_95[0] * stiffness, STRONG_95[1] * left
    return float(stiffness), dict(zip(FORCE_SHARES, left.tolist(), strict=True))


def _with_pixels(
    causes: _Causes,
    stiffness: float,
    energy: float,
    of_detail: Mapping[float, float] = MappingProxyType({}),
) -> ModelError:
    """Return errors, with what pixels and noise leave in the energy, which falls with the force.

    And what detail does to it, at shares of mu N; `energy` is the error at any of them.
    """
    by_share = []
    for share in PIXELS_95:
        of_both = math.hypot(*causes.at(share), causes.missed_at(share))
        by_share.append((share, max(of_both, energy, of_detail.get(share, 0.0))))
    greatest = max(error for _, error in by_share)
    missed = causes.of_contact * STIFFNESS_MISSED * causes.missed_at(FORCE_SHARES[-1])
    stiffness = max(stiffness, missed)
    unknown_to = _unknown_to(causes.unloading)
    return ModelError(stiffness, greatest, tuple(by_share), unknown_to, causes.law)


def _unknown_to(unloading: Unloading) -> float:
    return float(unloading.unknown_to_N / unloading.load_N)


def _between_loads(unloading: Unloading, more: str) -> Problem:
    """Return what is not known between the loads; where there was time, single pixels decide it."""
    error = unloading.loss_error
    message = (
        f"from a tenth of mu N on the energy per cycle may be off by {error:.1%} between "
        f"the {len(unloading.solved_load_N)} loads that were solved"
    )
    if (unknown_to := _unknown_to(unloading)) > SMALL_SLIP:
        error = max(error, 1.0)
        message = (
            f"up to {percent(unknown_to)} of mu N no pixel lets go, or single ones make all of the "
            "energy per cycle: it is anything up to the rectangle of its loop there"
        )
    step = more if unloading.cut_short else None
    return Problem("loss_between_loads", "warning", message, Effect(None, error, error), step)


def _mate_coarse(face: ElasticFace, noise_m: float | None, error: float) -> Problem:
    apart_m = max(one.apart_m for one in face.between)
    message = (
        f"between points {apart_m:.2g} m apart a face that was laid on the other may be "
        f"{_missed_m(face, noise_m):.2g} m off: up to {error:.1%} in the energy per cycle at "
        f"{percent(ASKED)} of the force at gross slip"
    )
    return Problem("mate_coarse", "warning", message, Effect(None, error, error))


def _out_of_time(limit_s: float, more: str) -> Problem:
    message = (
        f"{limit_s:g} s of contact.time_limit_s were over before the map was pressed without its "
        "finest detail: what that decides is not known"
    )
    return Problem("time_limit_reached", "warning", message, step=more)


def _noise_taken(taken: TakenNoise) -> Problem:
    message = (
        f"white noise of {taken.noise_m:.2g} m a point, as the instrument has, was taken off the "
        f"map before it was pressed: {taken.left_m:.2g} m of it are left"
    )
    return Problem("noise_taken_off", "info", message)
