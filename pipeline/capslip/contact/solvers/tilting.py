"""A height map that is free to tilt under its load, until the moment of its contacts vanishes."""

from dataclasses import dataclass, replace

import numpy as np

from capslip.contact.solvers.closing import GivenLoad, GivenResultant
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

_MAX_TURNS, _MAX_TRIALS = 40, 25  # directions that are turned in, and solutions along each
_MAX_PLACES = 10  # of the resultant, in the end
_SETTLED = 1e-7  # moment left over, over load times side, at which a face has turned
_UNBALANCED = 1e-6  # the same, that is an error
_LESS = 0.5  # of the moment: a trial that leaves no more has gone far enough
_FLAT = 1e-9  # cosine of change of tilt and of moment, below which they tell no stiffness


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
        Pressures to begin with, as under another load: what touches under them is solved alone
        first, on patches.
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
    place_m = np.array(point_m)
    if stiffness == 0:
        state, iterations = turned.at(place_m, start_Pa)
        tilt_rad = np.add(base_rad, state.tilt_rad)
    else:
        held = (stiffness, np.array(at_ease_rad))
        state, iterations, tilt_rad = turned.held(place_m, start_Pa, *held)
        place_m = place_m - stiffness / load_N * (tilt_rad - at_ease_rad)
    pressed = certified(face, state, load_N, iterations)
    moments = (pressed.resultant_m - place_m) / (nx * dx_m, ny * dy_m)
    certificate = replace(pressed.certificate, moments=(float(moments[0]), float(moments[1])))
    if not (left := np.abs(moments).max()) < _UNBALANCED:
        raise ContactError(
            f"{face.name}: boundary elements leave a moment of {left:.1e} of load times side; "
            f"expected at most {_UNBALANCED:g}; give another rotational stiffness, or choose "
            "contact.alignment = as_levelled"
        )
    slopes = float(tilt_rad[0]), float(tilt_rad[1])
    turns = stiffness == 0
    return replace(pressed, tilt_rad=slopes, certificate=certificate, turns=turns)


def press_about(
    face: ElasticFace,
    load_N: float,
    resultant_m: tuple[float, float],
    tolerance: float,
    start_Pa: np.ndarray,
    time_limit_s: float = np.inf,
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
    tolerance, start_Pa, time_limit_s
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
    state, iterations = solve(face, closing, tolerance, start_Pa, end_s(time_limit_s))
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
        given = self.face, closing, self.tolerance, start_Pa, self.until_s
        return solve(*given, from_patches=True)

    def held(
        self,
        point_m: np.ndarray,
        start_Pa: np.ndarray | None,
        stiffness: float,
        at_ease_rad: np.ndarray,
    ) -> tuple[State, int, np.ndarray]:
        """Return the state under the tilt at which load and rotational stiffness balance.

        Also the steps to it, and that tilt, of the map as it was given. The moment

            M = N (place of the resultant - load point) + K (tilt - at ease)

        is the slope of the energy of springs, contact and load over the tilt, which is convex. So
        it falls along quasi-Newton directions (BFGS) until it is zero, from the face at ease on: at
        first with the stiffness that N / d on every unit of the load makes. At any K: a stiff one
        hardly lets it turn, and under a soft one the contact is the stiffer of the two.
        """
        iterations, tilt_rad = 0, at_ease_rad

        def under(tilt_rad: np.ndarray, near_Pa: np.ndarray | None) -> tuple[State, np.ndarray]:
            nonlocal iterations
            state, of_contact_Nm, more = self._under(tilt_rad, point_m, near_Pa)
            iterations += more
            return state, of_contact_Nm + stiffness * (tilt_rad - at_ease_rad)

        state, moment_Nm = under(tilt_rad, start_Pa)
        jacobian = stiffness * np.eye(2) + self._stiffness_of_contact(state)
        for _ in range(_MAX_TURNS):
            if self._left(moment_Nm) < _SETTLED:
                break
            step_rad = -np.linalg.solve(jacobian, moment_Nm)
            slope, part = float(moment_Nm @ step_rad), 1.0
            low, high = (0.0, slope), None
            for _ in range(_MAX_TRIALS):
                turned_rad = tilt_rad + part * step_rad
                found, new_Nm = under(turned_rad, state.pressure_Pa)
                along = float(new_Nm @ step_rad)
                less = self._left(new_Nm) < _LESS * self._left(moment_Nm)
                if less or abs(along) <= -_LESS * slope:
                    break
                low, high = ((part, along), high) if along < 0 else (low, (part, along))
                part = 2.0 * part if high is None else _between(low, high)
            else:
                break  # what is left is what the tolerance leaves
            jacobian = _updated(jacobian, part * step_rad, new_Nm - moment_Nm)
            tilt_rad, state, moment_Nm = turned_rad, found, new_Nm
        for _ in range(_MAX_PLACES):
            if self._left(moment_Nm) < _SETTLED:
                break
            # Under a soft one counts what a solution leaves of its resultant: that is put in place
            place_m = point_m - stiffness / self.load_N * (tilt_rad - at_ease_rad)
            state, more = self.at(place_m, state.pressure_Pa)
            iterations += more
            turned_rad = np.add(self.base_rad, state.tilt_rad)
            tilt_rad, moment_Nm = turned_rad, stiffness * (turned_rad - tilt_rad)
        return state, iterations, tilt_rad

    def _under(
        self, tilt_rad: np.ndarray, point_m: np.ndarray, start_Pa: np.ndarray | None
    ) -> tuple[State, np.ndarray, int]:
        """Return the state under a tilt, its moment about a place, and the steps to it."""
        x_rad, y_rad = (tilt_rad - self.base_rad).tolist()
        closing = GivenLoad(self.load_N / self.face.pixel_area_m2)
        face = self.face.tilted((x_rad, y_rad))
        state, iterations = solve(face, closing, self.tolerance, start_Pa, self.until_s)
        weight, places_m = self._weighted(state)
        return state, self.load_N * (places_m @ weight - point_m), iterations

    def _weighted(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return the shares of the load on the points that touch, and their places, (2, n)."""
        shape, contact = self.face.shape, state.contact
        places_m = [np.broadcast_to(x, shape).flat[contact] for x in self.face.places_m]
        pressure_Pa = state.pressure_Pa.flat[contact]
        return pressure_Pa / pressure_Pa.sum(), np.stack(places_m)

    def _stiffness_of_contact(self, state: State) -> np.ndarray:
        """Return the rotational stiffness that N / d on every unit of the load makes, (2, 2)."""
        weight, arms_m = self._weighted(state)
        arms_m = arms_m - (arms_m @ weight)[:, None]
        return self.load_N / state.approach_m * ((arms_m * weight) @ arms_m.T)

    def _left(self, moment_Nm: np.ndarray) -> float:
        """Return a moment over load times side, the larger of two."""
        sides_m = [np.ptp(x_m) for x_m in self.face.places_m]
        return float((np.abs(moment_Nm) / sides_m).max()) / self.load_N


def _between(low: tuple[float, float], high: tuple[float, float]) -> float:
    """Return where a slope is zero between two places, (place, slope): not too near either."""
    share = low[1] / (low[1] - high[1])
    return low[0] + (high[0] - low[0]) * min(max(share, 0.1), 0.9)


def _updated(jacobian: np.ndarray, turn_rad: np.ndarray, change_Nm: np.ndarray) -> np.ndarray:
    """Return the stiffness that a turn has told (BFGS), or the same where it tells none."""
    work = float(turn_rad @ change_Nm)
    if work <= _FLAT * float(np.linalg.norm(turn_rad) * np.linalg.norm(change_Nm)):
        return jacobian
    known_Nm = jacobian @ turn_rad
    loss = np.outer(known_Nm, known_Nm) / float(turn_rad @ known_Nm)
    return np.asarray(jacobian - loss + np.outer(change_Nm, change_Nm) / work)


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
