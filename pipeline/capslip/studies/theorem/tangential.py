"""A pressed height map that is sheared: tractions under Coulomb's law, solved for directly."""

from dataclasses import dataclass

import numpy as np

from capslip.contact.material import Composite
from capslip.contact.solvers.polonsky_keer import Pressed
from capslip.errors import ContactError, SettingsError
from capslip.studies.theorem.cerruti import ShearedHalfSpace

_MAX_ITERATIONS = 1000
_ON_THE_BOUND = 1 - 1e-12  # of mu p


@dataclass(frozen=True)
class ShearCertificate:
    """How well a solution fulfils Coulomb's law, from its tractions alone.

    Displacements are relative to that of the face, tractions to the mean of mu p in the contact.
    The complementarity is the duality gap: the energy is above its least value by no more.
    """

    force_balance: float  # |sum of q dA - T| / (mu N)
    greatest_excess: float  # of |q| over mu p
    stick_residual: float  # sum of p |slip| where |q| < mu p, over sum of p
    misdirection: float  # the same for slip that is not along q, where |q| = mu p
    complementarity: float  # sum of (mu p |slip| - q slip) / sum of |q| (|slip| + |u|)
    iterations: int


@dataclass(frozen=True, eq=False)
class Sheared:
    """A pressed face under a tangential force, as `shear` found it.

    Vectors in the surface are complex numbers, x + i y; arrays have the shape (ny, nx).
    """

    force_N: complex
    displacement_m: complex  # of the one body as a whole against the other
    traction_Pa: np.ndarray  # on the body that is pushed back; zero where there is no contact
    surface_displacement_m: np.ndarray  # elastic, both bodies; zero where there is no contact
    slip_m: np.ndarray  # since `since`; up to the tolerance zero where |q| < mu p
    work_J: float  # that friction takes since `since`
    sticking: np.ndarray  # of bool: pixels in contact below mu p
    certificate: ShearCertificate


def shear(
    pressed: Pressed,
    joint: Composite,
    friction_coefficient: float,
    force_N: complex,
    *,
    since: Sheared | None = None,
    tolerance: float = 1e-8,
) -> Sheared:
    """Shear a pressed face at constant pressure, with Cerruti's kernel and without the theorem.

    The tractions minimise the complementary energy

        1/2 sum of q u(q) dA    under    |q| <= mu p,    sum of q dA = T

    which is convex, so its minimum is one. The displacement delta of the face is the multiplier of
    the force, and the slip is delta - u(q): zero below mu p, along q on the bound (Kalker 1990,
    Ch. 4). It is found by conjugate gradients on the stick area and along the bound, with steps
    back into the bounds; a step that does not lower the energy is replaced by a projected gradient,
    which always does.

    From rest in one step, the work of friction D = sum of q slip dA is exact as long as the
    direction of q does not turn while the force grows; as dU/dT = delta for the least energy U, it
    is D = T delta - 2 U = T delta - 2 * integral of delta dT. With Masing's rule a cycle between -T
    and T loses W = 4 D, see `docs/theory.md`. A path of many steps, each `since` the last one,
    needs neither assumption.

    Parameters
    ----------
    pressed : Pressed
        From `polonsky_keer.press`.
    joint : Composite
        Constants of both bodies, without elastic coupling (equal ones).
    friction_coefficient : float
        mu.
    force_N : complex
        T_x + i T_y, |T| < mu N. There is no rotation, and no displacement is held.
    since : Sheared, optional
        State of the same pressed face from which the slip counts. Without it, from rest.
    tolerance : float
        Largest complementarity, see `ShearCertificate`.

    Raises
    ------
    SettingsError
        If the friction coefficient, the tolerance or `since` cannot be.
    ContactError
        If the force is none that friction holds, or no solution is found that fulfils the law.

    Examples
    --------
    >>> from capslip.contact.material import composite
    >>> from capslip.contact.solvers.polonsky_keer import elastic_face, press
    >>> from capslip.surface.heightmap import HeightMap
    >>> y, x = np.mgrid[-32:32, -32:32] * 1e-4
    >>> steel = composite((200e9, 200e9), (0.3, 0.3))
    >>> sphere = HeightMap(-(x**2 + y**2) / (2 * 20.0), (1e-4, 1e-4))
    >>> pressed = press(elastic_face(sphere, steel.E_star_Pa), load_N=10.0)
    >>> sheared = shear(pressed, steel, 0.2, 1.0)
    >>> print(f"{sheared.displacement_m.real:.2e} m")
    5.53e-09 m
    """
    if not 0 < friction_coefficient < np.inf:
        raise SettingsError(
            f"friction_coefficient: got {friction_coefficient:g}; expected a finite number > 0"
        )
    if not 1e-14 <= tolerance <= 1e-2:
        raise SettingsError(f"tolerance: got {tolerance:g}; expected 1e-14 to 0.01")
    if since is not None:
        _check_same_face(since, friction_coefficient * pressed.pressure_Pa)
    force = complex(force_N)
    held_N = friction_coefficient * pressed.load_N
    if not 0 <= abs(force) < held_N or (force == 0 and since is None):
        raise ContactError(
            f"force_N: got {abs(force):g} N; expected more than 0 and less than {held_N:g} N, "
            "which friction holds under this load"
        )
    problem = _Problem(pressed, joint, friction_coefficient, force, since)
    state, iterations = _iterate(problem, tolerance)
    return _certified(problem, state, iterations, tolerance)


def _check_same_face(since: Sheared, bound_Pa: np.ndarray) -> None:
    same = since.traction_Pa.shape == bound_Pa.shape
    if not same or np.any(np.abs(since.traction_Pa) > bound_Pa + 1e-9 * bound_Pa.max()):
        raise SettingsError(
            f"since: got a state of shape {since.traction_Pa.shape}, or with tractions above mu p; "
            f"expected one of the same pressed face, {bound_Pa.shape}"
        )


class _Problem:
    """The pixels in contact and what holds for them; vectors have one entry for each."""

    def __init__(
        self,
        pressed: Pressed,
        joint: Composite,
        friction_coefficient: float,
        force_N: complex,
        since: Sheared | None,
    ) -> None:
        pressure_Pa, (dy_m, dx_m) = pressed.pressure_Pa, pressed.pixel_size_m
        self.shape = (pressure_Pa.shape[0], pressure_Pa.shape[1])
        self.half_space = ShearedHalfSpace(
            self.shape, pressed.pixel_size_m, joint.E_star_Pa, joint.kappa
        )
        self.contact = np.flatnonzero(pressure_Pa)
        self.bound_Pa = friction_coefficient * pressure_Pa.flat[self.contact]
        self.area_m2, self.force_N = dy_m * dx_m, force_N
        self.total_Pa = force_N / self.area_m2
        at_rest = np.zeros(len(self.contact), complex)
        before_Pa, self.before_m, self.before_delta_m = at_rest, at_rest, 0j
        if since is not None:
            before_Pa = since.traction_Pa.flat[self.contact]
            self.before_m = since.surface_displacement_m.flat[self.contact]
            self.before_delta_m = since.displacement_m
        more = (self.total_Pa - before_Pa.sum()) / self.bound_Pa.sum()
        self.start_Pa = self.admissible(before_Pa + more * self.bound_Pa)

    def displacement_m(self, traction_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement of the pixels in contact."""
        field = self.half_space.displacement_m(self.map_of(traction_Pa))
        return np.asarray(field.flat[self.contact])

    def preconditioned(self, displacement_m: np.ndarray) -> np.ndarray:
        """Return roughly the tractions that make a displacement."""
        field = self.half_space.traction_Pa(self.map_of(displacement_m))
        return np.asarray(field.flat[self.contact])

    def map_of(self, values: np.ndarray) -> np.ndarray:
        """Return an array of shape (ny, nx), zero where there is no contact."""
        field = np.zeros(self.shape, values.dtype)
        field.flat[self.contact] = values
        return field

    def admissible(self, traction_Pa: np.ndarray) -> np.ndarray:
        """Return the nearest tractions that keep to the bound and balance the force.

        They are those of the nearest point of each disc after one shift c for all, which makes the
        sum right: two equations in c, the gradient of a convex function, solved by Newton's method.
        """
        shift, clipped, missing = 0j, *self._clipped(traction_Pa, 0j)
        enough = 1e-14 * self.bound_Pa.sum()
        for _ in range(100):
            if abs(missing) <= enough:
                return clipped
            moved = traction_Pa + shift
            size = np.abs(moved)
            outside = size > self.bound_Pa
            across = 1j * moved / np.where(size > 0, size, 1.0)
            along = np.where(outside, self.bound_Pa / np.where(outside, size, 1.0), 1.0)
            step = _solved(np.where(outside, 0.0, along), along, across, missing)
            for _ in range(60):
                clipped, rest = self._clipped(traction_Pa, shift + step)
                if abs(rest) < abs(missing):
                    break
                step /= 2
            else:
                break
            shift, missing = shift + step, rest
        if abs(missing) <= 1e-10 * self.bound_Pa.sum():
            return clipped
        raise ContactError("shear: no tractions within mu p balance the force; lower the force")

    def _clipped(self, traction_Pa: np.ndarray, shift: complex) -> tuple[np.ndarray, complex]:
        moved = traction_Pa + shift
        size = np.abs(moved)
        clipped = np.where(
            size > self.bound_Pa, self.bound_Pa * moved / np.maximum(size, 1e-300), moved
        )
        return clipped, self.total_Pa - complex(clipped.sum())


@dataclass(frozen=True, eq=False)
class _State:
    """Tractions, what they do, and the directions in which they may still change."""

    traction_Pa: np.ndarray
    displacement_m: np.ndarray
    delta_m: complex  # since the state before, as slip
    slip_m: np.ndarray
    across: np.ndarray  # unit vectors across the traction
    sliding: np.ndarray  # of bool: on the bound, and slip does not pull back
    complementarity: float
    rounding_J_per_m2: float  # energies are no more exact than this

    def free(self, vectors: np.ndarray) -> np.ndarray:
        """Return what of the vectors keeps to the bound: all of it, or the part along it."""
        along_bound = (vectors * self.across.conj()).real * self.across
        return np.where(self.sliding, along_bound, vectors)

    def balanced(self, vectors: np.ndarray) -> np.ndarray:
        """Return the free part of the vectors less a common one, such that their sum is zero."""
        free = self.free(vectors)
        common = _solved(np.where(self.sliding, 0.0, 1.0), 1.0, self.across, complex(free.sum()))
        return free - self.free(np.full(len(free), common))


def _state(problem: _Problem, traction_Pa: np.ndarray, displacement_m: np.ndarray) -> _State:
    """Classify the pixels; delta is the mean of the displacement over what does not slip."""
    size = np.abs(traction_Pa)
    moved_m = displacement_m - problem.before_m
    direction = traction_Pa / np.where(size > 0, size, 1.0)
    across = 1j * direction
    along_bound = (moved_m * across.conj()).real * across
    bound = size >= _ON_THE_BOUND * problem.bound_Pa
    sliding = bound
    for _ in range(2):  # what slip pulls back from the bound is known with delta only
        total_m = complex(np.where(sliding, along_bound, moved_m).sum())
        delta_m = _solved(np.where(sliding, 0.0, 1.0), 1.0, across, total_m)
        slip_m = delta_m - moved_m
        sliding = bound & ((slip_m * direction.conj()).real >= 0)
    gap = float((problem.bound_Pa * np.abs(slip_m) - (slip_m * traction_Pa.conj()).real).sum())
    scale = float((size * (np.abs(slip_m) + np.abs(moved_m))).sum())
    return _State(
        traction_Pa, displacement_m, delta_m, slip_m, across, sliding, gap / scale, 1e-14 * scale
    )


def _iterate(problem: _Problem, tolerance: float) -> tuple[_State, int]:
    """Run the iteration; return its last state and the number of steps."""
    half_space = problem.half_space
    q = problem.start_Pa
    state = _state(problem, q, problem.displacement_m(q))
    direction, old_r, slope = np.zeros_like(q), np.zeros_like(q), 0.0  # zero begins anew
    for iteration in range(_MAX_ITERATIONS):
        if state.complementarity <= tolerance:
            return state, iteration
        r = state.free(state.slip_m)
        # The bound is curved: slip has to turn with the traction, which is stiff where mu p is low
        turning = np.where(state.sliding, np.abs(state.slip_m) / problem.bound_Pa, 0.0)
        scale = 1 / np.sqrt(1 + turning / half_space.pixel_compliance_m_per_Pa)
        z = state.balanced(scale * problem.preconditioned(scale * r))
        new_slope = _dot(r, z)
        beta = max(0.0, (new_slope - _dot(old_r, z)) / slope) if slope > 0 else 0.0
        direction = z + beta * state.balanced(direction)
        old_r, slope = r, new_slope
        work = _dot(direction, problem.displacement_m(direction) + turning * direction)
        new = None
        if work > 0:
            new = _moved(problem, state, q + _dot(r, direction) / work * direction)
        if new is None:
            slope = 0.0
            safe_Pa_per_m = 1 / half_space.greatest_compliance_m_per_Pa
            new = _moved(problem, state, q + safe_Pa_per_m * state.slip_m)
        if new is None:
            return state, iteration
        q, state = new.traction_Pa, new
    return state, _MAX_ITERATIONS


def _moved(problem: _Problem, state: _State, traction_Pa: np.ndarray) -> _State | None:
    """Return the state of the nearest admissible tractions, None if the energy would rise."""
    q = problem.admissible(traction_Pa)
    u = problem.displacement_m(q)
    # Both tractions have the same sum, so delta drops out: no large numbers are subtracted
    mean_slip_m = state.slip_m - (u - state.displacement_m) / 2
    if _dot(q - state.traction_Pa, mean_slip_m) < -state.rounding_J_per_m2:
        return None
    return _state(problem, q, u)


def _certified(problem: _Problem, found: _State, iterations: int, tolerance: float) -> Sheared:
    """Return the solution with its certificate, all of it computed from the tractions returned."""
    q, bound_Pa = found.traction_Pa, problem.bound_Pa
    state = _state(problem, q, problem.displacement_m(q))
    size, slip_m = np.abs(q), np.abs(state.slip_m)
    sticks = size < _ON_THE_BOUND * bound_Pa
    along_m = (state.slip_m * (q / np.where(size > 0, size, 1.0)).conj()).real
    off_m = np.where(sticks, slip_m, np.abs(state.slip_m - np.maximum(along_m, 0.0) * q / size))
    weight = bound_Pa / (bound_Pa.sum() * abs(state.delta_m))
    certificate = ShearCertificate(
        force_balance=abs(complex(q.sum()) - problem.total_Pa) / float(bound_Pa.sum()),
        greatest_excess=float((size - bound_Pa).max() / bound_Pa.mean()),
        stick_residual=float((weight * off_m)[sticks].sum()),
        misdirection=float((weight * off_m)[~sticks].sum()),
        complementarity=state.complementarity,
        iterations=iterations,
    )
    if (
        certificate.force_balance > 1e-9
        or certificate.greatest_excess > 1e-9
        or not certificate.complementarity <= tolerance
    ):
        raise ContactError(
            f"shear: the tractions do not fulfil Coulomb's law after {iterations} iterations: "
            f"{certificate}; expected a complementarity of {tolerance:g}; allow more"
        )
    return Sheared(
        force_N=problem.force_N,
        displacement_m=problem.before_delta_m + state.delta_m,
        traction_Pa=problem.map_of(q),
        surface_displacement_m=problem.map_of(state.displacement_m),
        slip_m=problem.map_of(state.slip_m),
        work_J=_dot(q, state.slip_m) * problem.area_m2,
        sticking=problem.map_of(sticks),
        certificate=certificate,
    )


def _solved(
    first: np.ndarray, second: np.ndarray | float, across: np.ndarray, right: complex
) -> complex:
    """Solve sum_i [first_i (1 - t t^T) + second_i t t^T] c = right, with t = across_i.

    Where all pixels slip the same way nothing tells c along it: the least c then.
    """
    t_x, t_y, extra = across.real, across.imag, second - first
    xx = float((first + extra * t_x**2).sum())
    yy = float((first + extra * t_y**2).sum())
    xy = float((extra * t_x * t_y).sum())
    c_x, c_y = np.linalg.pinv([[xx, xy], [xy, yy]], rcond=1e-12) @ [right.real, right.imag]
    return complex(c_x, c_y)


def _dot(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.vdot(one, other).real)
