"""Contacts that are coupled by springs and sheared: slip of each, and where each lets go.

Contact i carries N_i = k_i (g_i)_+^1.5 at compression g_i, and the load N_j of another one sinks it
by C_ij N_j; C is symmetric with zero diagonal. These are the solvers behind `interacting`, from the
equilibrium that `balance.press` finds on.
"""

import numpy as np

from capslip.contact.solvers.hertz import load_drop_of_asperity
from capslip.errors import ContactError

_BATCH = 4_000_000  # numbers in the matrices that are solved at once: 32 MB


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
        As for `balance.press`, of the contacts alone.
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
        all_held = bool(held.all())
        rest = S[part] if all_held else S[part][:, held]
        between = C if all_held else C[np.ix_(held, held)]
        matrix = rest[:, :, None] * between * rest[:, None, :]
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
