"""Equilibrium of Hertz contacts that are coupled by springs: under load, and when sheared.

Contact i carries N_i = k_i (g_i)_+^1.5 at compression g_i, and the load N_j of another one sinks it
by C_ij N_j; C is symmetric with zero diagonal. These are the solvers behind `interacting`.
"""

from dataclasses import dataclass

import numpy as np

from capslip.contact.solvers.hertz import load_drop_of_asperity
from capslip.errors import ContactError

_BATCH = 4_000_000  # numbers in the matrices that are solved at once: 32 MB


def press(
    k: np.ndarray,
    h: np.ndarray,
    C: np.ndarray,
    g: np.ndarray,
    load: float | None = None,
    level: float | None = None,
) -> tuple[float, np.ndarray]:
    """Solve g_i + sum_j C_ij N_j = y - h_i at given load sum N_i or at given level y.

    The solution is a minimum over N >= 0 of the energy
    sum_i [3/5 k_i^(-2/3) N_i^(5/3) + (h_i - y) N_i] + N C N / 2 (without y and of given sum, at
    given load). Newton's step on the active set, damped where the Hessian is not positive definite
    or the energy does not fall: it ends in a stable equilibrium from any start. As long as no
    contacts overlap the energy is convex and there is only one.

    Parameters
    ----------
    k, h : ndarray, shape (n,)
        Hertz coefficients in N/m^1.5 and depths in m.
    C : ndarray, shape (n, n)
        Pair compliances in m/N.
    g : ndarray, shape (n,)
        Compressions to start from; one at least positive.
    load, level : float
        One of them, so high that a cap touches.

    Returns
    -------
    float, ndarray
        Level and compressions, negative for a gap.

    Raises
    ------
    ContactError
        If no equilibrium is found.
    """
    state = _State.at(g, k, h, C, load, level)
    damping = 0.0
    for _ in range(200):
        if state.error <= 1e-14 * state.level:
            break
        active = state.active
        gap = state.gap[active]
        # A cap about to touch has no stiffness yet; that at its whole penetration serves.
        S = np.sqrt(1.5 * k[active] * np.sqrt(np.where(state.g > 0, state.g, -state.gap)[active]))
        matrix = S[:, None] * C[np.ix_(active, active)] * S
        while damping < 1e9:
            try:
                z = _solve_definite(matrix, 1 + damping, np.stack([S * gap, S], axis=1))
            except np.linalg.LinAlgError:
                damping = max(4 * damping, 0.25)
                continue
            rise = 0.0 if load is None else (S @ z[:, 0]) / (S @ z[:, 1])
            trial = np.where(active, state.g, -state.gap)
            trial[active] += (rise * z[:, 1] - z[:, 0]) / S
            new = _State.at(trial, k, h, C, load, level)
            if new.is_better_than(state):
                break
            damping = max(4 * damping, 0.25)
        else:
            break
        state = new
        damping = damping / 8 if damping > 0.1 else 0.0
    if state.error > 1e-10 * state.level:
        goal = f"approach {level:g} m" if load is None else f"load {load:g} N"
        raise ContactError(
            f"interacting: no equilibrium of {len(k)} caps at {goal}; the misfit is "
            f"{state.error:g} m, expected at most {1e-10 * state.level:g} m; use mean_field"
        )
    return state.level, np.where(state.g > 0, state.g, -state.gap)


@dataclass(frozen=True, eq=False)
class _State:
    """Compressions of all caps, and how far they are from equilibrium."""

    g: np.ndarray  # zero for a gap
    load: float
    level: float
    gap: np.ndarray  # in equilibrium zero in contact and not negative elsewhere
    active: np.ndarray
    error: float
    energy: float

    @classmethod
    def at(
        cls,
        g: np.ndarray,
        k: np.ndarray,
        h: np.ndarray,
        C: np.ndarray,
        load: float | None,
        level: float | None,
    ) -> "_State":
        """Return the state at given compressions, all shifted to the load if there is one."""
        if load is not None:
            g = _shifted_to_load(k, g, load)
        g = np.maximum(g, 0)
        N = k * g * np.sqrt(g)
        total = float(N.sum())
        sunk = C @ N
        energy = float(N @ (0.6 * g + 0.5 * sunk + h))
        if level is None:
            level = float(N @ (g + sunk + h)) / total
        else:
            energy -= level * total
        gap = g + sunk + h - level
        active = (g > 0) | (gap < 0)
        return cls(g, total, level, gap, active, float(np.abs(gap[active]).max()), energy)

    def is_better_than(self, other: "_State") -> bool:
        """Whether the energy fell or, where rounding hides that, the error did."""
        rounding = 1e-13 * self.level * self.load
        return self.energy < other.energy - rounding or (
            self.energy < other.energy + rounding and self.error < 0.5 * other.error
        )


def _shifted_to_load(k: np.ndarray, g: np.ndarray, load: float) -> np.ndarray:
    """Return g + s with sum k (g + s)_+^1.5 = load; convex in s, so Newton from the right."""
    highest = int(np.argmax(g))
    g = g - g[highest] + (load / k[highest]) ** (2 / 3)
    for _ in range(100):
        rest = np.maximum(g, 0)
        root = np.sqrt(rest)
        step = (k @ (rest * root) - load) / (1.5 * (k @ root))
        g = g - step
        if abs(step) <= 1e-15 * rest[highest]:
            break
    return g


def _solve_definite(matrix: np.ndarray, diagonal: float, right: np.ndarray) -> np.ndarray:
    """Solve with the matrix of that diagonal; LinAlgError if it is not positive definite."""
    from scipy.linalg import cho_factor, cho_solve

    matrix.flat[:: len(matrix) + 1] = diagonal
    return cho_solve(cho_factor(matrix, check_finite=False), right, check_finite=False)


def shear(
    k: np.ndarray,
    C: np.ndarray,
    g: np.ndarray,
    goal: np.ndarray,
    closing: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Solve x_i + sum_j C_ij t_j = e, t the load drops of the contacts, for many goals at once.

    Newton on x and e together. As long as no contacts overlap the problem is convex.

    Parameters
    ----------
    k, C
        As for `press`, of the contacts alone.
    g : ndarray, shape (n,)
        Their compressions, all positive.
    goal : ndarray, shape (m,)
        What closes the system: a e + b sum t = goal.
    closing : (float, float)
        a and b: (1, c) gives the withdrawal, with a spring c in series; (0, 1) the load drop.

    Returns
    -------
    ndarray, ndarray
        e, shape (m,), and x, shape (m, n).

    Raises
    ------
    ContactError
        If Newton does not converge.
    """
    a, b = closing
    e_total, spread = _extremes(k, C, g)
    e = goal / (a + b * spread.sum())
    if a == 0:
        e = np.minimum(e, 0.9 * e_total)
    x = e[:, None] * (1 - C @ spread)
    todo = np.arange(len(goal))
    if a == 0:
        N = k * g * np.sqrt(g)
        total = goal >= N.sum() * (1 - 4e-15)
        e[total], x[total] = e_total, e_total - C @ N
        todo = todo[~total]
    todo = _slide(k, C, g, goal, (a, np.full((1, len(k)), b)), e, x, todo)
    if todo.size:
        raise ContactError(
            f"interacting: the slip of {len(k)} contacts was not found at {todo.size} of "
            f"{len(goal)} points; use mean_field"
        )
    return e, x


def lift_off(k: np.ndarray, C: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find where each contact loses its load in the system of `shear`: x_i = g_i.

    As x_i = e - sum_j C_ij t_j, that is a goal linear in e and t like any other, one a contact,
    and all of them are found at once without a search along e.

    Parameters
    ----------
    k, C, g
        As for `shear`.

    Returns
    -------
    ndarray, ndarray
        e, shape (n,), and x, shape (n, n), one row a contact. NaN where other contacts are so wide
        and near that this one grows at first, or does not lift off on the way to total slip.
    """
    e_total, spread = _extremes(k, C, g)
    ahead = 1 - C @ spread  # dx / de before any slip
    forward = ahead > 0
    e = np.minimum(g / np.where(forward, ahead, 1), e_total)
    x = e[:, None] * ahead
    # The smallest first: neighbours in the batch have then lost about the same contacts.
    order = np.argsort(g)
    missed = _slide(k, C, g, g, (1.0, -C), e, x, order[forward[order]])
    unknown = ~forward | (e <= 0) | (e > e_total * (1 + 1e-12))
    unknown[missed] = True
    e[unknown], x[unknown] = np.nan, np.nan
    return e, x


def _extremes(k: np.ndarray, C: np.ndarray, g: np.ndarray) -> tuple[float, np.ndarray]:
    """Return e at total slip, and the load drops for a unit of e before any slip."""
    S = np.sqrt(1.5 * k * np.sqrt(g))
    spread = S * solve_coupled(S[None], C, S[None, :, None])[0, :, 0]
    return float((g + C @ (k * g * np.sqrt(g))).max()), spread


def _slide(
    k: np.ndarray,
    C: np.ndarray,
    g: np.ndarray,
    goal: np.ndarray,
    closing: tuple[float, np.ndarray],
    e: np.ndarray,
    x: np.ndarray,
    todo: np.ndarray,
) -> np.ndarray:
    """Improve the rows `todo` of e and x until a e + b . t = goal; return those that were not."""
    a, weights = closing
    e_total = (g + C @ (k * g * np.sqrt(g))).max()
    for _ in range(100):
        if todo.size == 0:
            break
        xt, et = x[todo], e[todo]
        b = weights[todo] if len(weights) > 1 else weights
        t = load_drop_of_asperity(k, g, xt)
        S = np.sqrt(1.5 * k * np.sqrt(np.maximum(g - np.abs(xt), 0)))
        misfit = xt + t @ C - et[:, None]
        missing = goal[todo] - a * et - (b * t).sum(axis=1)
        z = S[..., None] * solve_coupled(S, C, np.stack([S * misfit, S], axis=-1))
        back, stiffness = (b[..., None] * z).sum(axis=1).T
        slope = a + stiffness
        de = np.where(slope > 0, missing + back, 0) / np.where(slope > 0, slope, 1)
        if a == 0:
            rest = e_total - et
            # Straight steps in (e_total - e)^1.5, in which the load has a slope up to total slip
            u = np.minimum(1.5 * de / rest, 0.999)
            w = np.cbrt(1 - u)
            de = rest * u * (1 + w) / (1 + w + w * w)
        dt = de[:, None] * z[..., 1] - z[..., 0]
        dx = de[:, None] - misfit - dt @ C
        x[todo] += dx
        e[todo] += de
        size = np.abs(x[todo]).max(axis=1)
        solved = np.abs(dx).max(axis=1) <= 1e-13 * size
        solved |= (np.abs(misfit).max(axis=1) <= 1e-15 * size) & (
            np.abs(missing) <= 1e-15 * goal[todo]
        )
        todo = todo[~solved]
    return todo


def solve_coupled(S: np.ndarray, C: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve (1 + S C S) z = right for a batch of diagonals S, shape (batch, n).

    The matrix is positive definite as long as no contacts overlap. Contacts without stiffness,
    S = 0, are left out: their rows are those of the unit matrix.
    """
    n = S.shape[-1]
    z = np.array(right)
    step = max(1, _BATCH // max(n * n, 1))
    for first in range(0, len(S), step):
        part = slice(first, first + step)
        held = S[part].any(axis=0)
        rest = S[part][:, held]
        matrix = rest[:, :, None] * C[np.ix_(held, held)] * rest[:, None, :]
        diagonal = np.arange(rest.shape[1])
        matrix[:, diagonal, diagonal] = 1
        try:
            z[part, held] = np.linalg.solve(matrix, z[part, held])
        except np.linalg.LinAlgError as error:
            raise ContactError(
                "interacting: contacts overlap so far that they are unstable; expected a_i + a_j "
                "<= r_ij; lower the preload, or use mean_field"
            ) from error
    return z
