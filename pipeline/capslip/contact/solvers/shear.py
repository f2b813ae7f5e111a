"""Contacts that are coupled by springs and sheared: slip of each, and where each lets go.

Contact i carries N_i = k_i (g_i)_+^1.5 at compression g_i, and the load N_j of another one sinks it
by C_ij N_j; C is symmetric with zero diagonal. Contacts that are near one another may sink by a
little more than that, see `near_field`: under shear by what the normal loads N less t leave of it.
These are the solvers behind `interacting`, from the equilibrium that `balance.press` finds on.

Every solution has a certificate. Shear t_i of a contact is a function of its slip x_i alone that
ends at its load and has the sign of x_i: Coulomb's bound and the direction of slip hold by
construction. What remains is that the face moves every contact by the same e, and that the closing
equation holds: both are evaluated from the x that is returned. In t the problem is the minimum of
a convex energy with, nearly, the Hessian 1 / D + C, D = diag(1.5 k sqrt(g - |x|)), which only grows
with slip: where it is positive definite at rest, and that is asked, there is one solution.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from capslip.contact.solvers.hertz import load_drop_of_asperity
from capslip.contact.solvers.near_field import NearField
from capslip.errors import ContactError

_BATCH = 4_000_000  # numbers in the matrices that are solved at once: 32 MB
_CERTIFIED = 1e-9  # most that the equations may be off, of the displacement and of the goal
_ROUNDING = 4e-15  # of a sum of loads
_TINY = 1e-300  # against division by zero
_NEARLY = 0.999  # of total slip: a first guess goes no further
_UNSTABLE = (
    "interacting: contacts overlap so far that they are unstable; expected a_i + a_j <= r_ij; "
    "lower the preload, or use mean_field"
)


def shear(
    k: np.ndarray,
    C: np.ndarray,
    g: np.ndarray,
    goal: np.ndarray,
    closing: tuple[float, float],
    near: NearField | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Solve x_i + sum_j C_ij t_j = e, t the load drops of the contacts, for many goals at once.

    Newton on x and e together; where that misses, a search along e, which does not.

    Parameters
    ----------
    k : ndarray, shape (n,) or (m, n)
        Hertz coefficients in N/m^1.5, of all goals or of each.
    C : ndarray, shape (n, n)
        As for `balance.press`.
    g : ndarray, shape (n,) or (m, n)
        Compressions, the same; what does not touch, g <= 0, takes no part and has x = 0.
    goal : ndarray, shape (m,)
        What closes the system: a e + b sum t = goal.
    closing : (float, float)
        a and b: (1, c) gives the withdrawal, with a spring c in series; (0, 1) the load drop.
    near : NearField, optional
        As for `balance.press`.

    Returns
    -------
    ndarray, ndarray
        e, shape (m,), and x, shape (m, n).

    Raises
    ------
    ContactError
        If contacts overlap so far that there is more than one solution, or none fulfils the
        equations to `_CERTIFIED`.
    """
    a, b = closing
    net = _Network.of(k, C, g, near)
    e, x = _first_guess(net, goal, closing)
    todo = np.arange(len(goal))
    if a == 0:
        total = goal >= net.total_N * (1 - _ROUNDING)
        e = np.where(total, net.e_total, e)
        x = np.where(total[:, None], np.expand_dims(net.e_total, -1) - net.sunk_m, x)
        todo = todo[~total]
    _slide(net, goal, (a, np.full((1, k.shape[-1]), b)), e, x, todo)
    missed = ~(net.misfit(goal, closing, e, x) <= _CERTIFIED)
    if missed.any():
        for row in np.flatnonzero(missed).tolist():
            one, on = net.alone(row)
            e[row], x[row, on] = _searched(one, float(goal[row]), closing)
            x[row, ~on] = 0.0
            x[row, ~on] = e[row] - net.risen_m(x[row], row)[~on]
        off = net.misfit(goal, closing, e, x)
        missed = ~(off <= _CERTIFIED)
    if missed.any():
        raise ContactError(
            f"interacting: the slip of {k.shape[-1]} contacts was not found at {missed.sum()} of "
            f"{len(goal)} points: its equations are off by {off.max():.2g}, expected "
            f"{_CERTIFIED:g}; use mean_field"
        )
    return e, np.where(g > 0, x, 0.0)


def lift_off(
    k: np.ndarray, C: np.ndarray, g: np.ndarray, near: NearField | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Find where each contact loses its load in the system of `shear`: x_i = g_i.

    As x_i = e - sum_j C_ij t_j, that is a goal linear in e and t like any other but for the near
    field, one a contact, and all of them are found at once without a search along e.

    Parameters
    ----------
    k, C, g, near
        As for `shear`.

    Returns
    -------
    ndarray, ndarray
        e, shape (n,), and x, shape (n, n), one row a contact. NaN where other contacts are so wide
        and near that this one grows at first, or does not lift off on the way to total slip, and
        where no solution fulfils the equations to `_CERTIFIED`.

    Raises
    ------
    ContactError
        If contacts overlap so far that there is more than one solution.
    """
    net = _Network.of(k, C, g, near)
    ahead = 1 - net.K @ net.spread  # dx / de before any slip
    forward = ahead > 0
    e = np.minimum(g / np.where(forward, ahead, 1), net.e_total)
    x = e[:, None] * ahead
    # The smallest first: neighbours in the batch have then lost about the same contacts.
    order = np.argsort(g)
    _slide(net, g, (1.0, -C), e, x, order[forward[order]], lifts=True)
    unknown = ~forward | ~((e > 0) & (e <= net.e_total * (1 + 1e-12)))
    unknown |= ~(net.misfit(g, (1.0, -C), e, x, lifts=True) <= _CERTIFIED)
    e[unknown], x[unknown] = np.nan, np.nan
    return e, x


@dataclass(frozen=True, eq=False)
class _Network:
    """Contacts before any slip, of all goals or, with a leading axis of rows, of each."""

    k: np.ndarray
    C: np.ndarray
    g: np.ndarray
    near: NearField | None
    K: np.ndarray  # C and, at rest, what the near field adds to it: for slopes
    N: np.ndarray  # their loads
    sunk_m: np.ndarray  # by the loads of the others
    total_N: np.ndarray
    e_total: np.ndarray  # e at total slip
    spread: np.ndarray  # the load drops for a unit of e

    @classmethod
    def of(cls, k: np.ndarray, C: np.ndarray, g: np.ndarray, near: NearField | None) -> "_Network":
        """Return it, where it is stable: at rest the energy of the problem is least convex."""
        held = np.maximum(g, 0)
        root = np.sqrt(held)
        S, N = np.sqrt(1.5 * k * root), k * held * root
        rows = S.reshape(-1, S.shape[-1])
        sunk_m, K = N @ C, C
        if near is not None:
            sunk_m += sum(near.sunk_m(k, N, held))
            K = C + near.slope_m_per_N(*(one.reshape(rows.shape).mean(axis=0) for one in (k, held)))
        try:
            for part in _parts(*rows.shape):
                np.linalg.cholesky(_coupled(rows[part], K))
        except np.linalg.LinAlgError as error:
            raise ContactError(_UNSTABLE) from error
        spread = (rows * solve_coupled(rows, K, rows[..., None])[..., 0]).reshape(S.shape)
        e_total = np.where(g > 0, g + sunk_m, -np.inf).max(axis=-1)
        return cls(k, C, g, near, K, N, sunk_m, N.sum(axis=-1), e_total, spread)

    def of_rows(self, rows: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return k, g and e at total slip of some goals."""
        if self.g.ndim == 1:
            return self.k, self.g, self.e_total
        return self.k[rows], self.g[rows], self.e_total[rows]

    def alone(self, row: int) -> tuple["_Network", np.ndarray]:
        """Return the network of what touches at one goal, and what that is."""
        k, g, _ = self.of_rows(row)
        on = g > 0
        near = None if self.near is None else self.near.of(on)
        return _Network.of(k[on], self.C[on][:, on], g[on], near), on

    def drop_N(self, x: np.ndarray) -> np.ndarray:
        """Return t at slips x, of their shape."""
        return load_drop_of_asperity(self.k, self.g, x)

    def risen_m(self, x: np.ndarray, rows: Any = slice(None)) -> np.ndarray:
        """Return by how much contacts sink less than at rest at slips x of some goals."""
        k, g, _ = self.of_rows(rows)
        t = load_drop_of_asperity(k, g, x)
        return t @ self.C + self.risen_near_m(x, t, rows)

    def risen_near_m(self, x: np.ndarray, t: np.ndarray, rows: Any = slice(None)) -> Any:
        """Return what the near field has of it, given the load drops t, too."""
        if self.near is None:
            return 0.0
        k, g, _ = self.of_rows(rows)
        held = np.maximum(g, 0)
        dg = np.clip(x, -held, held)
        N = k * held * np.sqrt(held) - 0.5 * t
        return sum(self.near.changed_m(k, N, held - 0.5 * dg, t, dg))

    def misfit(
        self,
        goal: np.ndarray,
        closing: tuple[float, float | np.ndarray],
        e: np.ndarray,
        x: np.ndarray,
        lifts: bool = False,
    ) -> np.ndarray:
        """Return by how much each row misses its equations, shape (m,): the certificate.

        Near total slip little force decides about much displacement, so a force is off by its
        share of the rest, and a displacement beyond total slip by all.
        """
        a, weights = closing
        t = self.drop_N(x)
        risen_m = self.risen_near_m(x, t)
        off_m = np.abs(x + t @ self.C + risen_m - e[:, None]).max(axis=1)
        off, scale = a * e + (weights * t).sum(axis=1) - goal, goal
        if lifts and self.near is not None:
            off -= risen_m.diagonal()
        off = np.abs(off)
        if a == 0:
            rest = np.maximum(self.total_N - goal, 0.0) + _ROUNDING / _CERTIFIED * self.total_N
            scale = np.minimum(goal, rest)
            off = np.where(e > self.e_total * (1 + 1e-12), np.inf, off)
        return np.asarray(np.maximum(off_m / np.maximum(e, _TINY), off / np.maximum(scale, _TINY)))


def _first_guess(
    net: _Network, goal: np.ndarray, closing: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return e and x to start from, right where slip begins and where all slips.

    Between them the rest of a load falls as a power of the rest of e, by its slope before any slip:
    1.5 for one contact alone.
    """
    a, b = closing
    stiffness, e_total = net.spread.sum(axis=-1), net.e_total
    e = goal / (a + b * stiffness)
    if a == 0:
        rest = np.log1p(-np.minimum(goal / net.total_N, _NEARLY))
        e = -e_total * np.expm1(net.total_N / (stiffness * e_total) * rest)
    rest = np.log1p(-np.minimum(e / e_total, _NEARLY))
    power = net.spread * np.expand_dims(e_total, -1) / np.maximum(net.N, _TINY)
    t = -net.N * np.expm1(np.minimum(power * rest[:, None], _NEARLY))  # not all advance
    return e, e[:, None] - t @ net.K


def _slide(
    net: _Network,
    goal: np.ndarray,
    closing: tuple[float, np.ndarray],
    e: np.ndarray,
    x: np.ndarray,
    todo: np.ndarray,
    lifts: bool = False,
) -> None:
    """Improve the rows `todo` of e and x until a e + b . t = goal, or steps lead nowhere.

    The near field has the slopes that it has at rest. In a contact's own lift-off, one a row, its
    share is not in b . t.
    """
    a, weights = closing
    C, K = net.C, net.K
    # Each step squares what the last one left, or takes it down to less than a per cent
    enough = 1e-8 if net.near is None else 1e-11
    for _ in range(100):
        if todo.size == 0:
            break
        xt, et = x[todo], e[todo]
        k, g, e_total = net.of_rows(todo)
        b = weights[todo] if len(weights) > 1 else weights
        t = load_drop_of_asperity(k, g, xt)
        S = np.sqrt(1.5 * k * np.sqrt(np.maximum(g - np.abs(xt), 0)))
        risen_m = net.risen_near_m(xt, t, todo)
        misfit = xt + t @ C + risen_m - et[:, None]
        missing = goal[todo] - a * et - (b * t).sum(axis=1)
        if lifts and net.near is not None:
            missing += risen_m[np.arange(todo.size), todo]
        z = S[..., None] * solve_coupled(S, K, np.stack([S * misfit, S], axis=-1))
        back, stiffness = (b[..., None] * z).sum(axis=1).T
        slope = a + stiffness
        de = np.where(slope > 0, missing + back, 0) / np.where(slope > 0, slope, 1)
        if a == 0:
            rest = np.maximum(e_total - et, _TINY)
            # Straight steps in (e_total - e)^1.5, in which the load has a slope up to total slip
            u = np.minimum(1.5 * de / rest, 0.999)
            w = np.cbrt(1 - u)
            de = rest * u * (1 + w) / (1 + w + w * w)
        dt = de[:, None] * z[..., 1] - z[..., 0]
        dx = de[:, None] - misfit - dt @ K
        x[todo] = xt = xt + dx
        e[todo] = et + de
        size = np.abs(xt).max(axis=1)
        solved = np.abs(dx).max(axis=1) <= enough * size
        solved |= (np.abs(misfit).max(axis=1) <= 1e-15 * size) & (
            np.abs(missing) <= 1e-15 * goal[todo]
        )
        todo = todo[~solved]


def _searched(net: _Network, goal: float, closing: tuple[float, float]) -> tuple[float, np.ndarray]:
    """Return e and x of one goal, searched between rest and total slip.

    a e + b sum t grows with e, and at given e damped steps end in the one solution.
    """
    from scipy.optimize import brentq

    a, b = closing
    x = np.zeros(len(net.k))

    def excess(e: float) -> float:
        nonlocal x
        x = _at_rest(net, e, x)
        return a * e + b * float(net.drop_N(x).sum()) - goal

    most = max(net.e_total, a * (goal - b * net.total_N))
    e = brentq(excess, 0.0, most, xtol=_TINY, rtol=1e-15, disp=False)
    return e, _at_rest(net, e, x)


def _at_rest(net: _Network, e: float, x: np.ndarray) -> np.ndarray:
    """Return x of one displacement e, by steps that are halved until the misfit falls."""
    k, g = net.k, net.g
    misfit = x + net.risen_m(x) - e
    off = float(np.linalg.norm(misfit))
    for _ in range(200):
        if off <= 1e-15 * e:
            break
        S = np.sqrt(1.5 * k * np.sqrt(np.maximum(g - np.abs(x), 0)))
        z = S * solve_coupled(S[None], net.K, (S * misfit)[None, :, None])[0, :, 0]
        step = net.K @ z - misfit
        share = 1.0
        while share > 1e-9:
            trial = x + share * step
            misfit = trial + net.risen_m(trial) - e
            if float(np.linalg.norm(misfit)) < (1 - 0.1 * share) * off:
                break
            share /= 2
        else:
            break
        x, off = trial, float(np.linalg.norm(misfit))
    return x


def solve_coupled(S: np.ndarray, C: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve (1 + S C S) z = right for a batch of diagonals S, shape (batch, n).

    The matrix is positive definite as long as no contacts overlap. Contacts without stiffness,
    S = 0, are left out: their rows are those of the unit matrix.
    """
    parts = _parts(*S.shape)
    try:
        if len(parts) == 1 and S.any(axis=0).all():
            return np.asarray(np.linalg.solve(_coupled(S, C), right))
        z = np.array(right)
        for part in parts:
            held = S[part].any(axis=0)
            matrix = _coupled(S[part][:, held], C[held][:, held])
            z[part, held] = np.linalg.solve(matrix, z[part, held])
    except np.linalg.LinAlgError as error:
        raise ContactError(_UNSTABLE) from error
    return z


def _parts(rows: int, n: int) -> list[slice]:
    """Return the rows in parts whose matrices are solved at once."""
    step = max(1, _BATCH // max(n * n, 1))
    return [slice(first, first + step) for first in range(0, rows, step)]


def _coupled(S: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return 1 + S C S, shape (batch, n, n)."""
    matrix = S[:, :, None] * C * S[:, None, :]
    diagonal = np.arange(S.shape[1])
    matrix[:, diagonal, diagonal] += 1
    return matrix
