"""A height map pressed against a rigid plane: pressures and gaps, with their certificate."""

import math
from dataclasses import replace
from time import thread_time

import numpy as np

from capslip.contact.solvers.closing import Closing, GivenApproach, GivenLoad
from capslip.contact.solvers.elastic_face import MOST_PRESSURE, ElasticFace, elastic_face, finer
from capslip.contact.solvers.patches import patched
from capslip.contact.solvers.pixels import some_points
from capslip.contact.solvers.pressed import Certificate, Pressed, State
from capslip.contact.solvers.steps import bounded, moving, searched_step, tried_step
from capslip.errors import ContactError, OutOfTimeError, SettingsError

__all__ = [
    "Certificate",
    "ElasticFace",
    "Pressed",
    "elastic_face",
    "press",
    "punch",
    "punch_pressure_Pa_per_m",
]

PUNCH_TOLERANCE = 1e-6
_WORTH_PATCHES = 50_000  # points of a map from which a first solution is sought on patches
_COARSE_TOLERANCE = 1e-3  # of the solutions that only start the next finer one
_MOST_LOOKS = 4  # at what penetrates beside patches
_MAX_ITERATIONS = 300
_ROUGH_START = 1e-6  # tolerance from which single precision does for the sinking to begin with
_LEAST_S = 5.0  # that a solution has in any case: less is a lost result for next to no time
_MAX_YIELDING = 2000  # iterations where points yield: each step finds a few more of them


def press(
    face: ElasticFace,
    *,
    load_N: float | None = None,
    approach_m: float | None = None,
    tolerance: float = 1e-7,
    start_Pa: np.ndarray | None = None,
    time_limit_s: float = np.inf,
    sinks_once: bool = False,
) -> Pressed:
    """Press a face against a rigid plane, to a given load or a given approach.

    Conjugate gradients on the pixels in contact (Polonsky and Keer, Wear 231 (1999) 206), with
    `RoughInverse` as the preconditioner and, without a start, solutions on coarser grids first.
    Where a face has a hardness, pressures end there: such a point sinks for good, as far as it must
    (Almqvist et al., Wear 262 (2007) 1370).

    Parameters
    ----------
    face : ElasticFace
        From `elastic_face`.
    load_N, approach_m : float
        One of the two. The approach counts from first touch, at the highest measured point.
    tolerance : float
        Largest complementarity and penetration, see `Certificate`.
    start_Pa : ndarray, shape (ny, nx), optional
        Pressures near the solution, as those at a neighbouring load.
    time_limit_s : float
        Of the processor; `_LEAST_S` where it is less.
    sinks_once : bool
        Whether steps from a start are tried, see `tried_step`: half of the work for a tolerance,
        within which the edges of contacts are three times as far off.

    Raises
    ------
    SettingsError
        If not exactly one of load and approach is given, or a number is not positive and finite.
    ContactError
        If no solution is found that fulfils the conditions of contact; `OutOfTimeError` if that
        takes too long.

    Examples
    --------
    >>> from capslip.surface.heightmap import HeightMap
    >>> y, x = np.mgrid[-32:32, -32:32] * 1e-4
    >>> sphere = HeightMap(-(x**2 + y**2) / (2 * 20.0), (1e-4, 1e-4))
    >>> pressed = press(elastic_face(sphere, 110e9), load_N=10.0)
    >>> print(f"{pressed.approach_m:.2e} m, {pressed.certificate.least_pressure:g}")
    6.15e-08 m, 0
    """
    if (load_N is None) == (approach_m is None):
        raise SettingsError("press: expected either load_N or approach_m")
    for name, value in (("load_N", load_N), ("approach_m", approach_m)):
        if value is not None and not 0 < value < np.inf:
            raise SettingsError(f"{name}: got {value:g}; expected a finite number > 0")
    if not 1e-12 <= tolerance <= 0.1:
        raise SettingsError(f"tolerance: got {tolerance:g}; expected 1e-12 to 0.1")
    closing: Closing = GivenApproach(approach_m or 0.0)
    if load_N is not None:
        refuse_to_crush(face, load_N)
        closing = GivenLoad(load_N / face.pixel_area_m2)
    until_s = end_s(time_limit_s)
    state, iterations = solve(face, closing, tolerance, start_Pa, until_s, sinks_once)
    return certified(face, state, load_N, iterations)


def end_s(time_limit_s: float) -> float:
    """Return when a solution that begins now is given up, on the clock of `thread_time`."""
    return thread_time() + max(time_limit_s, _LEAST_S)


def refuse_to_crush(face: ElasticFace, load_N: float) -> None:
    """Raise a ContactError where all points together do not carry the load.

    Each carries its hardness, or, where it has none, a pressure of `MOST_PRESSURE` moduli: no face
    is half-space then, and much greater ones overflow.
    """
    most_Pa, what = min(
        (face.hardness_Pa, "its hardness of"),
        (MOST_PRESSURE * face.E_star_Pa, f"{MOST_PRESSURE:g} times its modulus,"),
    )
    bears_N = most_Pa * face.pixel_area_m2 * np.count_nonzero(face.measured)
    if load_N >= bears_N:
        raise ContactError(
            f"{face.name}: {load_N:g} N are more than all of the face bears at {what} "
            f"{most_Pa:.3g} Pa; expected less than {bears_N:.3g} N; check preload and units"
        )


def punch_pressure_Pa_per_m(face: ElasticFace, pressed: Pressed) -> np.ndarray:
    """Return dp/dd, in the shape of the face.

    As long as no pixel enters or leaves, more load is that of a flat punch on the same pixels.
    """
    return punch(face, pressed, None, PUNCH_TOLERANCE).pressure_Pa


def punch(
    face: ElasticFace, pressed: Pressed, start_Pa_per_m: np.ndarray | None, tolerance: float
) -> Pressed:
    """Return the state of a flat punch on the pixels in contact, that sinks by one metre."""
    contact = pressed.pressure_Pa > 0
    flat = replace(face, depth_m=np.zeros(face.shape), measured=contact)
    start_Pa = pressed.pressure_Pa if start_Pa_per_m is None else start_Pa_per_m
    return press(flat, approach_m=1.0, start_Pa=start_Pa, tolerance=tolerance)


def solve(
    face: ElasticFace,
    closing: Closing,
    tolerance: float,
    start_Pa: np.ndarray | None,
    until_s: float = np.inf,
    sinks_once: bool = False,
    from_patches: bool = False,
) -> tuple[State, int]:
    """Return the state that fulfils the tolerance, and the number of steps on the finest grid.

    From a start that is not near, as another load leaves it, on patches around it first.

    Raises
    ------
    ContactError
        If it is not found; `OutOfTimeError` if it is not by `until_s`, see `end_s`.
    """
    _refuse_late(face, 0, until_s)  # of several solutions, those before may have taken it all
    if start_Pa is not None:
        start_Pa = np.where(face.measured, np.maximum(start_Pa, 0.0), 0.0)
    if start_Pa is None or not start_Pa.any():
        state, iterations = _nested(face, closing, tolerance, until_s)
    elif from_patches:
        state, iterations = _from_patches(face, start_Pa, closing, tolerance, until_s)
    else:
        state, iterations = _iterate(face, start_Pa, closing, tolerance, until_s, sinks_once)
    if not state.fulfils(tolerance):
        raise ContactError(
            f"{face.name}: boundary elements did not converge in {iterations} iterations: "
            f"complementarity {state.complementarity:.2g}, least gap {state.least_gap:.2g} of the "
            f"approach; expected {tolerance:g}; filter or coarsen the map, or allow more"
        )
    return state, iterations


def _nested(
    face: ElasticFace, closing: Closing, tolerance: float, until_s: float
) -> tuple[State, int]:
    """Solve from the solution on the next coarser grid, or from something to begin with."""
    coarser = face.coarser
    if coarser is None:
        given = isinstance(closing, GivenApproach)
        start_Pa = np.zeros(face.shape) if given else face.measured.astype(float)
    else:
        on_coarser = closing.on_grid(coarser.places_m, face.pixel_area_m2 / coarser.pixel_area_m2)
        found, _ = _nested(coarser, on_coarser, _COARSE_TOLERANCE, until_s)
        start_Pa = _on_finer(face, coarser, found)
    return _from_patches(face, start_Pa, closing, tolerance, until_s)


def _from_patches(
    face: ElasticFace, start_Pa: np.ndarray, closing: Closing, tolerance: float, until_s: float
) -> tuple[State, int]:
    """Solve on patches around what touches in a start, then on the whole map.

    And around what that finds to penetrate beside them; what is left of the kernel between them, is
    a step or two on the whole map.
    """
    iterations = 0
    if face.depth_m.size >= _WORTH_PATCHES and start_Pa.any():
        start_Pa, state, iterations = _patched(face, start_Pa, closing, tolerance, until_s)
        if state is not None and state.fulfils(tolerance):
            return state, iterations
    state, more = _iterate(face, start_Pa, closing, tolerance, until_s)
    return state, iterations + more


def _on_finer(face: ElasticFace, coarser: ElasticFace, found: State) -> np.ndarray:
    """Return the pressures of a state on the coarser grid, each point moved by its own detail.

    Heights that the coarser grid did not have are gaps; a point alone closes its own, or leaves.
    """
    ny, nx = face.shape
    gap_m = finer(found.gap_m - coarser.depth_m)[:ny, :nx] + face.depth_m
    p = finer(found.pressure_Pa)[:ny, :nx]
    touches = face.measured & (p > 0)
    if found.pressure_Pa.max() < face.hardness_Pa:
        p = np.maximum(p - gap_m / face.half_space.pixel_compliance_m_per_Pa, 0.0)
    return np.where(touches, p, 0.0)


def _patched(
    face: ElasticFace, start_Pa: np.ndarray, closing: Closing, tolerance: float, until_s: float
) -> tuple[np.ndarray, State | None, int]:
    """Return pressures solved on patches, the state of the whole map under them, and the steps.

    What the map finds to penetrate beside the patches gets some, too. No state where the contact
    needs no patches.
    """
    around, state, iterations = start_Pa > 0, None, 0
    for _ in range(_MOST_LOOKS):
        patches = patched(face, around)
        if patches is None:
            break
        on_patches = closing.on_grid(patches.places_m, 1.0)
        start = patches.gathered(start_Pa)
        solved, more = _iterate(patches, start, on_patches, tolerance / 2, until_s)
        start_Pa, iterations = patches.spread(solved.pressure_Pa), iterations + more
        state = _state(face, start_Pa, face.half_space.sinking_m(start_Pa), closing)
        joins = (state.gap_m < -tolerance * state.approach_m) & face.measured
        joins.reshape(-1)[patches.parent] = False
        if not joins.any():
            break
        around = joins | (start_Pa > 0)
    return start_Pa, state, iterations


def _iterate(
    face: ElasticFace,
    start_Pa: np.ndarray,
    closing: Closing,
    tolerance: float,
    until_s: float,
    sinks_once: bool = False,
) -> tuple[State, int]:
    """Look at the whole face and take steps in turns; return the last state and the steps.

    A look finds the sinking from the pressures, steps that of the changes. Those of a map are on
    the points alone that touch, or stand clear by less than contact is off, and end when what the
    sinking of changes leaves off may be as much as what they still have to find. A state that
    fulfils the tolerance is returned only with a sinking in double precision.
    """
    half_space = face.half_space
    most = _MAX_ITERATIONS if np.isinf(face.hardness_Pa) else _MAX_YIELDING
    p, steps, aim = _allowed(face, start_Pa, closing), 0, tolerance
    while True:
        rough = aim >= _ROUGH_START
        u = half_space.sinking_roughly_m(p).astype(float) if rough else half_space.sinking_m(p)
        state = _state(face, p, u, closing)
        if state.fulfils(tolerance) or steps >= most:
            if not rough:
                return state, steps
            aim = 0.0
            continue
        if state.touches_nowhere:
            return state, steps  # too coarse a grid
        aim, left = tolerance, range(steps, most)
        # Where all contact is at the hardness, the others tell the level
        free = bool((p.reshape(-1)[state.contact] < face.hardness_Pa).any())
        off = min(state.complementarity, 1.0) if free else 1.0
        may_touch = (p > 0) | ((state.gap_m < off * state.approach_m) & face.measured)
        points = np.flatnonzero(may_touch)
        found = some_points(face, points)
        if found is None:
            p, steps = _steps(face, state, u, closing, aim, left, until_s, sinks_once)
            aim = 0.0  # steps that are as rough as a rough look have fulfilled the tolerance
        else:
            few, change_error = found
            aim = max(tolerance / 2, change_error * off)
            on_few = closing.on_grid(few.places_m, 1.0)
            start_Pa, sunk_m = p.reshape(-1)[points], u.reshape(-1)[points]
            start = _state(few, start_Pa, sunk_m, on_few)
            p = np.zeros(face.shape)
            p.reshape(-1)[points], steps = _steps(few, start, sunk_m, on_few, aim, left, until_s)


def _refuse_late(face: ElasticFace, steps: int, until_s: float) -> None:
    """Raise an OutOfTimeError where the time of a solution is over."""
    if thread_time() > until_s:
        raise OutOfTimeError(
            f"{face.name}: boundary elements on {face.depth_m.size} points had found no "
            f"solution after {steps} iterations when contact.time_limit_s was over; allow "
            "more, or coarsen the map"
        )


def _refuse_no_numbers(face: ElasticFace, *values: float) -> None:
    """Raise a ContactError where one is NaN: no comparison tells it, and no step leaves it."""
    if any(math.isnan(value) for value in values):
        raise ContactError(
            f"{face.name}: boundary elements: pressures or gaps are no numbers any more; check "
            "heights, units, preload and moduli"
        )


def _allowed(face: ElasticFace, start_Pa: np.ndarray, closing: Closing) -> np.ndarray:
    """Return the pressures to begin with on the conditions of the closing."""
    p, hardness_Pa = start_Pa.copy(), face.hardness_Pa
    at = np.flatnonzero(p)
    restored = bounded(p.reshape(-1)[at], at, closing, hardness_Pa)
    if restored is None:  # the start lies to one side of the resultant, or bears too little
        p = face.measured.astype(float)
        at = np.flatnonzero(p)
        if not np.isinf(hardness_Pa):
            p *= 1e-3 * hardness_Pa
        restored = bounded(p.reshape(-1)[at], at, closing, hardness_Pa)
    if restored is None:
        raise ContactError(
            f"{face.name}: no pressures up to the hardness have this load and these moments; "
            "expected a load point well within the measured points; check preload and load point"
        )
    p.reshape(-1)[at] = restored
    return p


def _steps(
    face: ElasticFace,
    state: State,
    u: np.ndarray,
    closing: Closing,
    tolerance: float,
    numbers: range,
    until_s: float,
    sinks_once: bool = False,
) -> tuple[np.ndarray, int]:
    """Take at least one step from a state and its sinking; return pressures, and the steps.

    The pressures stay on the conditions of the closing, so residual and direction are projected on
    them. The sinking is updated by that of the changes, in single precision.
    """
    half_space, p = face.half_space, state.pressure_Pa
    residual, direction = np.zeros(face.shape), np.zeros(face.shape)
    slope, length = 0.0, 1.0  # r z of the last step: zero begins anew; as the rough inverse has it
    for steps in numbers:
        _refuse_late(face, steps, until_s)
        off_m = tolerance * state.approach_m
        c = moving(face, state, off_m)
        project = closing.projector(c)
        old_r, old_t = residual.reshape(-1)[c], direction.reshape(-1)[c]
        r = project(state.gap_m.reshape(-1)[c])
        residual.fill(0.0)
        residual.reshape(-1)[c] = r
        z = project(half_space.pressure_Pa(r, c))
        new_slope = float(r @ z)
        t = z
        if slope > 0:
            t = project(z + max(0.0, (new_slope - float(old_r @ z)) / slope) * old_t)
        direction.fill(0.0)
        direction.reshape(-1)[c] = t
        slope = new_slope
        if sinks_once:
            p, du, length = tried_step(face, state, c, t, length, closing)
        else:
            p, du = searched_step(face, state, c, direction, r, closing)
        u = u + du
        state = _state(face, p, u, closing)
        if state.fulfils(tolerance) or state.touches_nowhere:
            return p, steps + 1
    return p, numbers.stop


def _state(face: ElasticFace, p: np.ndarray, u: np.ndarray, closing: Closing) -> State:
    """Return gaps and certificate of pressures and their sinking."""
    _refuse_no_numbers(face, float(p.sum()) * 0.0)
    contact = np.flatnonzero(p > 0)
    p_c = p.reshape(-1)[contact]
    gap_m = u + face.depth_m
    gaps_m = gap_m.reshape(-1)
    at_most = p_c >= face.hardness_Pa  # these have sunk as far as the plane wants
    all_at_most = contact.size > 0 and bool(at_most.all())
    tells = slice(None) if all_at_most or not at_most.any() else ~at_most
    plane = closing.plane(p_c[tells], gaps_m[contact[tells]], contact[tells])
    if all_at_most and not isinstance(closing, GivenApproach):
        plane[0] += _between(face, gap_m - closing.over(plane), contact)
    plane_m = closing.over(plane)
    gap_m -= plane_m
    d = float(plane[0])
    if np.ndim(plane_m):
        d = float(np.max(plane_m - face.depth_m, where=face.measured, initial=-np.inf))
    if d == 0.0:
        raise ContactError(
            "boundary elements: the approach is less than numbers tell beside the heights; check "
            "the load and the moduli"
        )
    off_m = gaps_m[contact]
    # Set aside for the moment, which is faster than a mask
    gaps_m[contact] = np.inf
    if face.unmeasured.size:
        kept_m = gaps_m[face.unmeasured]
        gaps_m[face.unmeasured] = np.inf
    least_gap = float(gaps_m.min()) / d
    if face.unmeasured.size:
        gaps_m[face.unmeasured] = kept_m
    gaps_m[contact] = off_m
    off_m = np.where(at_most, np.maximum(off_m, 0.0), np.abs(off_m))
    off = float(p_c @ off_m / p_c.sum()) / d if contact.size else np.inf
    _refuse_no_numbers(face, least_gap, off)
    return State(p, gap_m, d, (float(plane[1]), float(plane[2])), contact, least_gap, off)


def _between(face: ElasticFace, gap_m: np.ndarray, contact: np.ndarray) -> float:
    """Return the level where all contact is at the hardness, and so none tells it.

    It lies above the highest of them and below the lowest of the others, where both can be.
    """
    others = face.measured.copy()
    others.reshape(-1)[contact] = False
    highest_m = float(gap_m.reshape(-1)[contact].max())
    lowest_m = float(np.min(gap_m, where=others, initial=np.inf))
    return highest_m if np.isinf(lowest_m) else 0.5 * (highest_m + lowest_m)


def certified(
    face: ElasticFace,
    state: State,
    load_N: float | None,
    iterations: int,
    moments: tuple[float, float] = (0.0, 0.0),
) -> Pressed:
    """Return the solution with its certificate, all of it computed from the pressures returned."""
    p = state.pressure_Pa
    N = float(p.sum()) * face.pixel_area_m2
    certificate = Certificate(
        load_balance=0.0 if load_N is None else abs(N / load_N - 1),
        least_gap=state.least_gap,
        least_pressure=float(p.min() / p.reshape(-1)[state.contact].mean()),
        complementarity=state.complementarity,
        iterations=iterations,
        moments=moments,
    )
    balanced = all(abs(off) <= 1e-9 for off in (certificate.load_balance, *moments))
    if not (balanced and certificate.least_pressure >= 0):
        raise ContactError(f"{face.name}: a solution does not balance its load: {certificate}")
    gap_m = np.where(face.measured, state.gap_m, 0.0)
    approach_m = state.approach_m
    return Pressed(load_N or N, approach_m, p, gap_m, face.pixel_size_m, certificate)
