"""A height map that is free to tilt under its load, until the moment of its contacts vanishes."""

from dataclasses import dataclass, replace

import numpy as np

from capslip.contact.solvers.closing import GivenResultant
from capslip.contact.solvers.polonsky_keer import (
    ElasticFace,
    Pressed,
    certified,
    end_s,
    press,
    refuse_to_crush,
    solve,
)
from capslip.contact.solvers.pressed import State
from capslip.errors import ContactError, SettingsError

_MAX_TURNS = 30  # solutions that settle the moments against a rotational stiffness
_SETTLED = 1e-7  # change of the resultant's place at which they are, over the side
_UNBALANCED = 1e-6  # moment left over, over load times side, that is an error


def press_balanced(
    face: ElasticFace,
    load_N: float,
    load_point_m: tuple[float, float] | None = None,
    *,
    rotational_stiffness_Nm_per_rad: float = 0.0,
    at_ease_rad: tuple[float, float] = (0.0, 0.0),
    tolerance: float = 1e-7,
    start_tilt_rad: tuple[float, float] | None = None,
    start_Pa: np.ndarray | None = None,
    time_limit_s: float = np.inf,
) -> Pressed:
    """Press a face with a load along a line of action, about which it turns into balance.

    Approach and two tilts are the multipliers of sum p = N, sum p (x - x_P) = 0 and
    sum p (y - y_P) = 0, in the same iteration as `press`. The problem is convex, and has exactly
    one solution as soon as the load point lies inside the hull of the measured points.

    Parameters
    ----------
    face : ElasticFace
        From `elastic_face`; any plane may lie in it.
    load_N : float
        The load.
    load_point_m : (float, float), optional
        Where its line of action meets the map, (x, y); the centre of the map where None.
    rotational_stiffness_Nm_per_rad : float
        Of the parts, against tilting out of the plane of the map: the moments are then this times
        the tilt. 0 is balanced, infinite as levelled.
    at_ease_rad : (float, float)
        Slopes in x and y at which the parts exert no moment, where that is not as the map lies.
    tolerance : float
        As in `press`.
    start_tilt_rad : (float, float), optional
        Slopes in x and y to begin with; those that level the least-squares plane where None. They
        change the way and not the answer.
    start_Pa : ndarray, shape (ny, nx), optional
        Pressures near the solution.
    time_limit_s : float
        Of the processor, for all of it, as in `press`.

    Returns
    -------
    Pressed
        With `tilt_rad`, the slopes added to the map. `face.tilted(pressed.tilt_rad)` is the face
        with that tilt held, whose approach counts from the same first touch: what is to be
        unloaded, since slip needs one gap.

    Raises
    ------
    SettingsError
        If a number is not what it should be.
    ContactError
        `tips_over`, if the load point lies outside the hull of the measured points; or if no
        solution is found.

    Examples
    --------
    >>> from capslip.contact.solvers.polonsky_keer import elastic_face
    >>> from capslip.surface.heightmap import HeightMap
    >>> y, x = np.mgrid[-32:32, -32:32] * 1e-4
    >>> sphere = HeightMap(-(x**2 + y**2) / (2 * 20.0), (1e-4, 1e-4))
    >>> pressed = press_balanced(elastic_face(sphere, 110e9), 10.0, (3.3e-3, 3.2e-3))
    >>> print(", ".join(f"{x:.1e}" for x in pressed.resultant_m))
    3.3e-03, 3.2e-03
    """
    stiffness = rotational_stiffness_Nm_per_rad
    if not 0 < load_N < np.inf:
        raise SettingsError(f"load_N: got {load_N:g}; expected a finite number > 0")
    if not stiffness >= 0:
        raise SettingsError(f"rotational_stiffness_Nm_per_rad: got {stiffness:g}; expected >= 0")
    if not 1e-12 <= tolerance <= 0.1:
        raise SettingsError(f"tolerance: got {tolerance:g}; expected 1e-12 to 0.1")
    (dy_m, dx_m), (ny, nx) = face.pixel_size_m, face.shape
    point_m = load_point_m or (nx * dx_m / 2, ny * dy_m / 2)
    refuse_to_crush(face, load_N)
    _refuse_to_tip_over(face, point_m)
    if stiffness == np.inf:
        return press(
            face,
            load_N=load_N,
            tolerance=tolerance,
            start_Pa=start_Pa,
            time_limit_s=time_limit_s,
        )
    base_rad = start_tilt_rad or _level(face)
    turned = _Turned(face.tilted(base_rad), load_N, tolerance, base_rad, end_s(time_limit_s))
    if stiffness == 0:
        state, iterations = turned.at(np.array(point_m), start_Pa)
        place_m = np.array(point_m)
    else:
        held = (stiffness, np.array(at_ease_rad))
        state, iterations, place_m = turned.held(np.array(point_m), start_Pa, *held)
    tilt_rad = turned.tilt_rad(state)
    pressed = certified(face, state, load_N, iterations)
    moments = (pressed.resultant_m - place_m) / (nx * dx_m, ny * dy_m)
    certificate = replace(pressed.certificate, moments=(float(moments[0]), float(moments[1])))
    if not np.abs(moments).max() < _UNBALANCED:
        raise ContactError(f"{face.name}: a solution does not balance its moments: {certificate}")
    slopes = float(tilt_rad[0]), float(tilt_rad[1])
    turns = stiffness == 0
    return replace(pressed, tilt_rad=slopes, certificate=certificate, turns=turns)


def press_about(
    face: ElasticFace,
    load_N: float,
    resultant_m: tuple[float, float],
    tolerance: float,
    start_Pa: np.ndarray,
) -> tuple[ElasticFace, Pressed]:
    """Turn a face, from a state near balance, until its pressures have their resultant at a place.

    Parameters
    ----------
    face : ElasticFace
        A map, or patches of it.
    load_N : float
        The load.
    resultant_m : (float, float)
        The place, (x, y) in the map.
    tolerance, start_Pa
        As in `press`.

    Returns
    -------
    ElasticFace, Pressed
        The face with its tilt held, and its state.

    Raises
    ------
    ContactError
        If no solution is found.
    """
    closing = GivenResultant(load_N / face.pixel_area_m2, face.places_m, resultant_m)
    state, iterations = solve(face, closing, tolerance, start_Pa)
    return face.tilted(state.tilt_rad), certified(face, state, load_N, iterations)


@dataclass(frozen=True, eq=False)
class _Turned:
    """A face from which a plane is off, under a load that acts at a given place."""

    face: ElasticFace
    load_N: float
    tolerance: float
    base_rad: tuple[float, float]
    until_s: float  # on the clock of `thread_time`

    def at(self, resultant_m: np.ndarray, start_Pa: np.ndarray | None) -> tuple[State, int]:
        """Return the state whose resultant acts at a place (x, y), and the steps to it."""
        total_Pa = self.load_N / self.face.pixel_area_m2
        place = float(resultant_m[0]), float(resultant_m[1])
        closing = GivenResultant(total_Pa, self.face.places_m, place)
        return solve(self.face, closing, self.tolerance, start_Pa, self.until_s)

    def tilt_rad(self, state: State) -> np.ndarray:
        """Return the slopes added to the map as it was given, shape (2,)."""
        return np.add(self.base_rad, state.tilt_rad)

    def held(
        self,
        point_m: np.ndarray,
        start_Pa: np.ndarray | None,
        stiffness: float,
        at_ease_rad: np.ndarray,
    ) -> tuple[State, int, np.ndarray]:
        """Return the state whose resultant acts off the load point by -K tilt / N, from at ease.

        Also the steps to it, and where the resultant should be: where K is large, it follows from
        the tilt only with the help of the contact's own stiffness. Broyden's steps, from the
        rotational stiffness that N / d on every unit of the load makes.
        """
        place_m, scale = point_m, stiffness / self.load_N
        state, iterations = self.at(place_m, start_Pa)
        weight = state.pressure_Pa.flat[state.contact] / state.pressure_Pa.sum()
        shape = self.face.shape
        arms_m = np.stack(
            [np.broadcast_to(x, shape).flat[state.contact] for x in self.face.places_m]
        )
        arms_m -= (arms_m @ weight)[:, None]
        spread_m2 = (arms_m * weight) @ arms_m.T
        jacobian = np.eye(2) + scale * state.approach_m * np.linalg.pinv(spread_m2)
        side_m = float(np.ptp(arms_m))
        off_m = scale * (self.tilt_rad(state) - at_ease_rad)
        for _ in range(_MAX_TURNS):
            step_m = -np.linalg.solve(jacobian, off_m)
            while _outside_m(self.face, place_m + step_m)[0] > 0:
                step_m /= 2
            place_m = place_m + step_m
            state, more = self.at(place_m, state.pressure_Pa)
            iterations += more
            new_m = place_m - point_m + scale * (self.tilt_rad(state) - at_ease_rad)
            change = (new_m - off_m - jacobian @ step_m) / float(step_m @ step_m)
            off_m = new_m
            if float(np.abs(np.linalg.solve(jacobian, off_m)).max()) < _SETTLED * side_m:
                break
            jacobian = jacobian + np.outer(change, step_m)
        return state, iterations, place_m - np.linalg.solve(jacobian, off_m)


def _level(face: ElasticFace) -> tuple[float, float]:
    """Return the slopes that level the least-squares plane through the measured points."""
    x_m, y_m = (
        np.broadcast_to(place - place.mean(), face.shape)[face.measured] for place in face.places_m
    )
    basis = np.stack((np.ones(len(x_m)), x_m, y_m))
    scale = np.sqrt(np.square(basis).sum(axis=1)).clip(min=1e-300)
    basis /= scale[:, None]
    inverse = np.linalg.pinv(basis @ basis.T, hermitian=True)
    slopes = (inverse @ (basis @ face.depth_m[face.measured]) / scale)[1:]
    return float(slopes[0]), float(slopes[1])


def _outside_m(
    face: ElasticFace, point_m: tuple[float, float] | np.ndarray
) -> tuple[float, np.ndarray]:
    """Return how far a point lies outside the hull of the measured points, and over which side.

    The side is its outward normal; the distance is negative inside, and infinite where the hull has
    no area.
    """
    from scipy.spatial import ConvexHull, QhullError

    rows = np.flatnonzero(face.measured.any(axis=1))
    first = face.measured[rows].argmax(axis=1)
    last = face.shape[1] - 1 - face.measured[rows, ::-1].argmax(axis=1)
    x_m, y_m = face.places_m
    ends_m = np.stack((x_m[0, np.append(first, last)], y_m[np.append(rows, rows), 0]), axis=1)
    try:
        sides = ConvexHull(ends_m).equations
    except QhullError:
        return np.inf, np.zeros(2)
    outside_m = sides @ (*point_m, 1.0)
    worst = int(np.argmax(outside_m))
    return float(outside_m[worst]), sides[worst, :2]


def _refuse_to_tip_over(face: ElasticFace, point_m: tuple[float, float]) -> None:
    """Raise if the line of action does not pass through the hull of what can touch."""
    outside_m, normal = _outside_m(face, point_m)
    where = f"{face.name}: tips_over: the load at ({point_m[0]:.4g}, {point_m[1]:.4g}) m"
    advice = "move contact.load_point_m, or choose contact.alignment = as_levelled"
    if outside_m == np.inf:
        raise ContactError(
            f"{where} cannot be balanced by measured points on one line; expected an area; {advice}"
        )
    if outside_m > -1e-6 * np.hypot(*face.pixel_size_m):
        along = int(np.argmax(np.abs(normal)))
        side = f"{'great' if normal[along] > 0 else 'small'} {'xy'[along]}"
        raise ContactError(
            f"{where} lies {max(outside_m, 0.0):.3g} m outside the hull of the measured points, "
            f"and the face tips over its side at {side}; expected a point inside; {advice}"
        )
