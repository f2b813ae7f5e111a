"""Equilibrium of coupled Hertz contacts under a plane that may rise, sink and turn.

Contact i carries N_i = k_i (g_i)_+^1.5 at compression g_i, and the load N_j of another one sinks it
by C_ij N_j, so that g_i + sum_j C_ij N_j = y + t . r_i - h_i under a plane of level y at the load
point and slopes t; r_i counts from that point. Contacts that are near one another may sink by a
little more than that, see `near_field`. The plane has come to rest when its loads carry
the preload and their moments about the load point are those of the spring that holds it upright:
sum N_i = N, sum N_i r_i = -K t. K = 0 is a face that turns freely (balanced), K = inf one that does
not turn at all (as levelled).
"""

import math
from dataclasses import dataclass

import numpy as np

from capslip.contact.solvers.near_field import NearField, carrying
from capslip.errors import ContactError, TipsOverError

_TOLERANCE = 1e-14  # of the heights: misfit at which a state is an equilibrium
_ACCEPTED = 1e-12  # of the heights: misfit that rounding may leave
_MOST_STEPS = 30  # of Newton's method without damping
_LOOSE = 1e-15  # of the greatest pivot: two caps opposite each other leave a slope to rounding
_MOST_TOGETHER = 200  # contacts of sets that are solved at once; more are as fast alone


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A plane at rest on its contacts."""

    level_m: float  # y, at the load point
    slope: tuple[float, float]  # t, along x and y; positive: deeper where x or y is larger
    compression_m: np.ndarray  # g, shape (n,); negative for a gap


def press(
    k: np.ndarray,
    h: np.ndarray,
    C: np.ndarray | None,
    g: np.ndarray,
    load: float | None = None,
    level: float | None = None,
    arm: np.ndarray | None = None,
    turning_stiffness: float = math.inf,
    moment_Nm: np.ndarray | tuple[float, float] = (0.0, 0.0),
    near: NearField | None = None,
) -> Equilibrium:
    """Find the equilibrium under a given load, or under a plane at a given level.

    The loads of the equilibrium are a minimum over N >= 0 of the energy
    sum_i [3/5 k_i^(-2/3) N_i^(5/3) + h_i N_i] + N C N / 2 + K t . t / 2 among those that carry the
    load and its moments (at given level: of that less y sum N, among all). Newton's step on the
    active set, in which the plane's unknowns have the exact Hessian
    B^T (1 + D C)^-1 D B + diag(0, K, K) with B = [1, r], D = diag(1.5 k sqrt(g)); after each step
    the plane is moved to where it carries the load, which is a convex problem in its unknowns
    alone; and damped where the matrix is not positive definite or the energy does not fall. So it
    ends in a stable equilibrium from any start. As long as no contacts overlap the energy is convex
    and there is only one.

    Parameters
    ----------
    k, h : ndarray, shape (n,)
        Hertz coefficients in N/m^1.5 and depths in m.
    C : ndarray, shape (n, n), optional
        Pair compliances in m/N, symmetric with zero diagonal; None for caps that do not interact.
    g : ndarray, shape (n,)
        Compressions to start from.
    load, level : float
        One of them; the level so high that a cap touches. With a level the plane does not turn:
        take the slopes into the depths, h - t . r.
    arm : ndarray, shape (n, 2), optional
        r: places (x, y) of the contacts from the load point, in m. Needed by a plane that turns.
    turning_stiffness : float
        K in N m/rad.
    moment_Nm : (float, float)
        That the spring already pulls with where the slopes t are zero, along x and y: then
        sum N_i r_i = moment - K t.
    near : NearField, optional
        What the contacts do to one another beyond C, with its energy. Newton's steps leave it out,
        as it is some per cent of C where contacts do not run together.

    Returns
    -------
    Equilibrium

    Raises
    ------
    ContactError
        If no equilibrium is found, or the plane tips over: it turns freely and the load point lies
        outside the hull of the places.

    Notes
    -----
    A mean-field compliance c in series adds c N to the level and leaves the balance as it is.

    Examples
    --------
    A load at a quarter of the side of a square on four equal spheres; the plane turns freely:

    >>> k, arm = np.full(4, 1e12), np.array([[-1, -1], [3, -1], [-1, 3], [3, 3]]) * 0.01
    >>> rest = press(k, np.zeros(4), None, np.ones(4), load=160.0, arm=arm, turning_stiffness=0.0)
    >>> loads = k * np.maximum(rest.compression_m, 0.0) ** 1.5
    >>> bool(abs(loads.sum() - 160.0) < 1e-9), bool(np.abs(loads @ arm).max() < 1e-12)
    (True, True)
    """
    plane = _Plane.of(k, h, load, level, arm, turning_stiffness, moment_Nm, near)
    state = plane.state(C, g, np.zeros(plane.columns.shape[1]))
    damping = 0.0
    for _ in range(200):
        if state.error <= _TOLERANCE * state.scale:
            break
        while damping < 1e9:
            trial = plane.newton_step(C, state, damping)
            if trial is not None and trial.is_better_than(state):
                break
            damping = max(4 * damping, 0.25)
        else:
            break
        state = trial
        damping = damping / 8 if damping > 0.1 else 0.0
    if not state.error <= _ACCEPTED * state.scale:
        goal = f"approach {level:g} m" if load is None else f"load {load:g} N"
        raise ContactError(
            f"no equilibrium of {len(k)} caps at {goal}; the misfit is {state.error:g} m, expected "
            f"at most {_ACCEPTED * state.scale:g} m; use mean_field"
        )
    return plane.at_rest(state)


def press_sets(
    k: np.ndarray,
    h: np.ndarray,
    C: np.ndarray | None,
    g: np.ndarray,
    load: float,
    arm: np.ndarray | None = None,
    turning_stiffness: float = math.inf,
    moment_Nm: np.ndarray | tuple[float, float] = (0.0, 0.0),
    near: NearField | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the equilibria of many sets of contacts at the same places, near a known one.

    Newton's steps of `press` for all sets at once, undamped; a set that they do not settle is left
    to `press`.

    Parameters
    ----------
    k, h : ndarray, shape (s, n)
        Hertz coefficients in N/m^1.5 and depths in m of each set.
    g : ndarray, shape (s, n)
        Compressions to start from.
    C, load, arm, turning_stiffness, moment_Nm, near
        As for `press`, of all sets.

    Returns
    -------
    ndarray, ndarray, ndarray
        Levels, shape (s,), slopes, shape (s, 2), and compressions, shape (s, n); negative for a
        gap.

    Raises
    ------
    ContactError
        As for `press`.
    """
    turning = arm, turning_stiffness, moment_Nm
    plane = _Plane.of(k[0], h[0], load, None, *turning, near)
    start, g = g, g.copy()
    free = np.zeros((len(k), plane.columns.shape[1]))
    last, todo = np.full(len(k), np.inf), np.arange(len(k))
    for _ in range(_MOST_STEPS):
        with np.errstate(over="ignore", invalid="ignore"):  # steps may lead anywhere
            off, gap, missing = _misfits(plane, (k[todo], h[todo], C), g[todo], free[todo])
            settled = (off <= _TOLERANCE) | ((off <= _ACCEPTED) & (off > 0.5 * last[todo]))
            last[todo] = off
            rest = todo[settled]
            g[rest] = np.where(g[rest] > 0, g[rest], -gap[settled])
            todo = todo[~settled]
            if not todo.size:
                break
            steps = _newton_steps(plane, (k[todo], C), g[todo], gap[~settled], missing[~settled])
        if steps is None:
            break
        g[todo] += steps[0]
        free[todo] += steps[1]
    level, slope = free[:, 0], np.zeros((len(k), 2))
    slope[:, : free.shape[1] - 1] = free[:, 1:] / plane.reach_m
    for i in todo.tolist():
        alone = press(k[i], h[i], C, start[i], load, None, *turning, near)
        level[i], slope[i], g[i] = alone.level_m, alone.slope, alone.compression_m
    return level, slope, g


@dataclass(frozen=True, eq=False)
class _State:
    """Compressions that carry the load, and how far they are from equilibrium."""

    g: np.ndarray  # zero for a gap
    free: np.ndarray  # of the plane's unknowns, their values
    gap: np.ndarray  # in equilibrium zero in contact and not negative elsewhere
    active: np.ndarray
    error: float
    scale: float  # of the heights that were added up
    energy: float
    rounding: float  # of the energy

    def is_better_than(self, other: "_State") -> bool:
        """Whether the energy fell or, where rounding hides that, the error did."""
        return self.energy < other.energy - other.rounding or (
            self.energy < other.energy + other.rounding and self.error < 0.5 * other.error
        )


@dataclass(frozen=True, eq=False)
class _Plane:
    """Contacts, and the plane over them with its zero, one or three unknowns.

    Slopes count times `reach_m`, the largest distance from the load point, so that all unknowns are
    lengths and all rows of their Hessian N/m.
    """

    k: np.ndarray
    h: np.ndarray
    columns: np.ndarray  # B, shape (n, 0), (n, 1) or (n, 3)
    goal: np.ndarray  # what B^T N has to be, in N
    spring: np.ndarray  # stiffness of each unknown against the ground, in N/m
    reach_m: float
    level: float  # where it is given, else 0
    near: NearField | None

    @classmethod
    def of(
        cls,
        k: np.ndarray,
        h: np.ndarray,
        load: float | None,
        level: float | None,
        arm: np.ndarray | None,
        turning_stiffness: float,
        moment_Nm: np.ndarray | tuple[float, float],
        near: NearField | None,
    ) -> "_Plane":
        one = np.ones((len(k), 1))
        if load is None:
            return cls(k, h, one[:, :0], np.zeros(0), np.zeros(0), 1.0, float(level or 0.0), near)
        goal = np.array([load])
        if arm is None or math.isinf(turning_stiffness):
            return cls(k, h, one, goal, np.zeros(1), 1.0, 0.0, near)
        if turning_stiffness == 0.0:
            _refuse_tipping(arm)
        reach_m = float(np.hypot(*arm.T).max()) or 1.0
        columns = np.hstack((one, arm / reach_m))
        stiffness = turning_stiffness / reach_m**2
        return cls(
            *(k, h, columns, np.append(goal, np.divide(moment_Nm, reach_m))),
            *(np.array([0.0, stiffness, stiffness]), reach_m, 0.0, near),
        )

    def at_rest(self, state: _State) -> Equilibrium:
        """Return the state in the caller's units."""
        level, slope_x, slope_y = (*state.free, 0.0, 0.0, 0.0)[:3]
        g = np.where(state.g > 0, state.g, -state.gap)
        slope = float(slope_x) / self.reach_m, float(slope_y) / self.reach_m
        return Equilibrium(float(level) + self.level, slope, g)

    def state(self, C: np.ndarray | None, g: np.ndarray, free: np.ndarray) -> _State:
        """Return the state at given compressions, after moving the plane to carry the load."""
        B = self.columns
        if B.shape[1]:
            g, free = self._carrying(g, free)
        g = np.maximum(g, 0)
        N = self.k * g * np.sqrt(g)
        sunk = np.zeros_like(g) if C is None else _sunk_m(C, N)
        each = 0.5 * sunk  # of the energy, over the load
        if self.near is not None:
            by_width, by_slope = self.near.sunk_m(self.k, N, g)
            sunk = sunk + by_width + by_slope
            each += 3 / 8 * by_width + by_slope / 3
        height = g + sunk + self.h
        # Unknowns that no spring holds are multipliers: those that leave the least misfit.
        loose = self.spring == 0.0
        rest = height - self.level
        if loose.any():
            held = B[:, ~loose] @ free[~loose]
            columns = B if loose.all() else B[:, loose]
            weighted = columns.T * N
            free = free.copy()
            free[loose] = _solve(weighted @ columns, weighted @ (rest - held))
        moved = B @ free
        gap = rest - moved
        active = (g > 0) | (gap < 0)
        scale = float((np.abs(height) + np.abs(moved))[active].max(initial=0.0))
        energy = float(N @ (0.6 * g + each + self.h - self.level))
        energy += 0.5 * float(self.spring @ free**2)
        error = float(np.abs(gap[active]).max(initial=0.0))
        return _State(g, free, gap, active, error, scale, energy, 1e-13 * scale * float(N.sum()))

    def newton_step(self, C: np.ndarray | None, state: _State, damping: float) -> _State | None:
        """Return the state after one step; None where the matrix is not positive definite."""
        active, columns = state.active, self.columns
        g = np.where(state.g > 0, state.g, -state.gap)
        # A cap about to touch has no stiffness yet; that at its whole penetration serves.
        S = np.sqrt(1.5 * self.k[active] * np.sqrt(g[active]))
        right = S[:, None] * np.column_stack((state.gap[active], columns[active]))
        if C is None:
            z = right / (1 + damping)
        else:
            try:
                z = _solve_definite(S[:, None] * C[active][:, active] * S, 1 + damping, right)
            except np.linalg.LinAlgError:
                return None
        free, step = state.free, -z[:, 0]
        if columns.shape[1]:
            H = right[:, 1:].T @ z[:, 1:]
            H.flat[:: len(H) + 1] += self.spring
            moved = _solve(H, right[:, 1:].T @ z[:, 0])
            free, step = free + moved, step + z[:, 1:] @ moved
        # Its gap was taken at no compression, so that is where its step begins.
        g[active] = state.g[active] + step / S
        return self.state(C, g, free)

    def _carrying(self, g: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Move the plane until B^T N + spring free = goal, with no regard to what sinks.

        The energy sum 2/5 k g^2.5 + spring . free^2 / 2 - goal . free is convex in the plane's
        unknowns: damped Newton. Caps that do not touch lend their stiffness to the damping, so a
        plane that rests on one cap, or on none, knows how far to go.
        """
        B = self.columns
        moved = np.zeros(len(free))
        energy, missing, stiff = self._pulled(g, free, moved)
        damping = 0.0
        for _ in range(200):
            size = float(np.abs(missing).max())
            if size <= 4e-16 * self.goal[0]:
                break
            D = stiff * np.where(g > 0, 1.0, damping)
            H = (B.T * (D * (1 + damping))) @ B
            H.flat[:: len(H) + 1] += self.spring
            step = _solve(H, missing)
            trial = g + B @ step
            new_energy, new_missing, new_stiff = self._pulled(trial, free + step, moved + step)
            rounding = 1e-14 * (abs(energy) + abs(new_energy))
            fell = new_energy < energy - rounding
            if fell or (new_energy <= energy + rounding and np.abs(new_missing).max() < 0.5 * size):
                g, free, moved = trial, free + step, moved + step
                energy, missing, stiff = new_energy, new_missing, new_stiff
                damping = damping / 8 if damping > 1e-9 else 0.0
            elif damping > 1e6 or size <= _TOLERANCE * self.goal[0]:
                break
            else:
                damping = max(8 * damping, 1e-8)
        return g, free

    def _pulled(
        self, g: np.ndarray, free: np.ndarray, moved: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Return the energy of `_carrying`, the forces that miss, and stiffnesses, also of gaps."""
        root = self.k * np.sqrt(np.abs(g))
        rest = np.maximum(g, 0)
        N = root * rest
        energy = 0.4 * float(N @ rest) + 0.5 * float(self.spring @ free**2)
        energy -= float(self.goal @ moved)
        return energy, self.goal - N @ self.columns - self.spring * free, 1.5 * root


def _refuse_tipping(arm: np.ndarray) -> None:
    """Raise if no loads on these places can have their resultant at the load point."""
    angle = np.sort(np.arctan2(arm[:, 1], arm[:, 0]))
    opening = np.diff(angle, append=angle[0] + 2 * np.pi)
    widest = int(np.argmax(opening))
    if opening[widest] < np.pi - 1e-9:
        return
    towards = angle[widest] + 0.5 * opening[widest]
    along = math.cos(towards), math.sin(towards)
    axis = int(abs(along[1]) > abs(along[0]))
    side = ("+" if along[axis] > 0 else "-") + "xy"[axis]
    raise TipsOverError(
        f"tips_over: the load point lies outside the hull of the {len(arm)} peaks that can carry, "
        f"and the face turns over on its {side} side; expected peaks on all sides of the load"
    )


def _sunk_m(C: np.ndarray, N: np.ndarray) -> np.ndarray:
    """Return C N, from the rows of the caps that carry where these are few."""
    at = carrying(N)
    return N[at] @ C[at]


def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve for the plane's unknowns; the shortest solution where contacts do not fix them all."""
    if len(matrix) == 1:
        return right / matrix[0] if matrix[0, 0] > 0 else np.zeros(1)
    try:
        return _solved(matrix, right, _LOOSE)
    except np.linalg.LinAlgError:
        shortest: np.ndarray = np.linalg.pinv(matrix, rcond=1e-12, hermitian=True) @ right
        return shortest


def _solve_definite(matrix: np.ndarray, diagonal: float, right: np.ndarray) -> np.ndarray:
    """Solve with the matrix of that diagonal; LinAlgError if it is not positive definite."""
    matrix.flat[:: len(matrix) + 1] = diagonal
    return _solved(matrix, right)


def _solved(matrix: np.ndarray, right: np.ndarray, least: float = 0.0) -> np.ndarray:
    """Solve; LinAlgError too where the least pivot is less than a share of the greatest."""
    from scipy.linalg.lapack import dposv  # of few unknowns, five times as fast as its wrappers

    factor, x, failed = dposv(matrix, right)
    if not failed and least > 0.0:
        pivots = np.square(factor.diagonal()).tolist()
        failed = min(pivots) < least * max(pivots)
    if failed:
        raise np.linalg.LinAlgError("not positive definite")
    solution: np.ndarray = x
    return solution


def _misfits(
    plane: "_Plane",
    sets: tuple[np.ndarray, np.ndarray, np.ndarray | None],
    g: np.ndarray,
    free: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how far sets are from equilibrium, their gaps, and what their loads miss.

    How far is the greater of what the heights misfit and the loads miss, as shares of them.
    """
    k, h, C = sets
    B = plane.columns
    held = np.maximum(g, 0)
    N = k * held * np.sqrt(held)
    height = held + h + (0.0 if C is None else N @ C)
    if plane.near is not None:
        height += sum(plane.near.sunk_m(k, N, held))
    moved = free @ B.T
    gap = height - moved
    active = (g > 0) | (gap < 0)
    scale = np.where(active, np.abs(height) + np.abs(moved), 0.0).max(axis=1)
    missing = plane.goal - N @ B - plane.spring * free
    off = np.maximum(
        np.where(active, np.abs(gap), 0.0).max(axis=1) / np.maximum(scale, 1e-300),
        np.abs(missing).max(axis=1) / plane.goal[0],
    )
    return off, gap, missing


def _newton_steps(
    plane: "_Plane",
    sets: tuple[np.ndarray, np.ndarray | None],
    g: np.ndarray,
    gap: np.ndarray,
    missing: np.ndarray,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return Newton's steps of g and unknowns; None where a matrix is singular, or large."""
    (k, C), B = sets, plane.columns
    active = (g > 0) | (gap < 0)
    on = np.flatnonzero(active.any(axis=0))
    if on.size > _MOST_TOGETHER:
        return None
    active, B = active[:, on], B[on]
    depth = np.where(g > 0, g, np.maximum(-gap, 0))[:, on]
    S = np.where(active, np.sqrt(1.5 * k[:, on] * np.sqrt(depth)), 0.0)
    beside = np.broadcast_to(B, (*S.shape, B.shape[1]))
    right = S[..., None] * np.concatenate((gap[:, on, None], beside), axis=2)
    try:
        z = right
        if C is not None:
            matrix = S[:, :, None] * C[on][:, on] * S[:, None, :]
            diagonal = np.arange(on.size)
            matrix[:, diagonal, diagonal] = 1.0
            z = np.linalg.solve(matrix, right)
        weighted = right[..., 1:].transpose(0, 2, 1)
        H = weighted @ z[..., 1:] + np.diag(plane.spring)
        turn = np.linalg.solve(H, missing[..., None] + weighted @ z[..., :1])
    except np.linalg.LinAlgError:
        return None
    step = np.zeros_like(g)
    step[:, on] = ((z[..., 1:] @ turn)[..., 0] - z[..., 0]) / np.where(S > 0, S, np.inf)
    return step, turn[..., 0]
