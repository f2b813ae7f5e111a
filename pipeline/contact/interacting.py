"""Caps that push each other apart: each contact sinks the surface under its neighbours."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from pipeline.contact.curves import caps
from pipeline.contact.hertz import HertzCurve, load_drop_of_asperity
from pipeline.errors import ContactError, SettingsError

_BATCH = 4_000_000  # numbers in the matrices that are solved at once: 32 MB


@dataclass(frozen=True, eq=False)
class InteractingCurve(HertzCurve):
    """Hertz contacts whose levels differ: g_i = y - h_i - sum_j C_ij N_j, N_i = k_i g_i^1.5.

    C is constant and symmetric: a network of springs that loses nothing. So the loss is the sum of
    Eq. 8 over the contacts, each with its own displacement; nothing is interpolated or integrated.
    Made by `interacting`.
    """

    x_m: np.ndarray = field(kw_only=True)  # (n,)
    y_m: np.ndarray = field(kw_only=True)  # (n,)
    pair_compliance_m_per_N: np.ndarray = field(kw_only=True)  # (n, n), zero diagonal
    _solved: dict[float, np.ndarray] = field(default_factory=dict, init=False, repr=False)

    def overlapping_pairs(self, approach_m: float) -> int:
        """Count the pairs with a_i + a_j > r_ij: their contacts merge, and the model ends there.

        A cap that carries nothing has a = 0; it counts if its peak lies inside another's contact.
        """
        g = np.maximum(self._compression(approach_m), 0)
        return _overlapping_pairs(np.sqrt(self.radius_m * g), self.x_m, self.y_m)

    def lift_off_m(self, approach_m: ArrayLike) -> np.ndarray:
        """NaN: no closed form."""
        return np.full_like(self._compression(approach_m), np.nan)

    def _compression(self, approach_m: ArrayLike) -> np.ndarray:
        d = np.asarray(approach_m, dtype=float)
        known = [self._solved.get(value) for value in d.ravel().tolist()]
        if any(g is None for g in known):
            return super()._compression(d)
        return np.reshape(np.array(known), (*d.shape, -1))

    def _compression_at_level(self, level: np.ndarray) -> np.ndarray:
        g = np.empty((level.size, len(self.radius_m)))
        start = None
        for i, y in enumerate(level.ravel().tolist()):
            if y <= self.touch_m:
                g[i] = y - self.depth_m
                continue
            if start is None:
                sunk = caps(self.radius_m, self.depth_m, self.E_star_Pa)
                mean = self.pair_compliance_m_per_N.mean()
                start = replace(sunk, compliance_m_per_N=mean)._compression(y)
            g[i] = start = self._equilibrium(start, level=y)[1]
        return g.reshape(*level.shape, -1)

    def _pressed(self, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        level = np.empty(load.size)
        g = np.empty((load.size, len(self.radius_m)))
        start = None
        for i, N in enumerate(load.ravel().tolist()):
            if N == 0:
                level[i], g[i] = self.touch_m, self.touch_m - self.depth_m
                continue
            if start is None:
                start = super()._pressed(np.asarray(N))[1]
            level[i], start = self._equilibrium(start, load=N)
            g[i] = start
        approach = level + self.compliance_m_per_N * load.ravel()
        self._solved.clear()  # kept for the methods that are asked at this approach next
        self._solved.update(zip(approach.tolist(), g, strict=True))
        return level.reshape(load.shape), g.reshape(*load.shape, -1)

    def _withdrawn(self, g: np.ndarray, withdrawal_m: ArrayLike) -> np.ndarray:
        e = np.asarray(withdrawal_m, dtype=float)
        return self._sheared(g, e, (1.0, self.compliance_m_per_N))[1]

    def _unloaded(self, g: np.ndarray, drop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._sheared(g, drop, (0.0, 1.0))

    def _slope(self, g: np.ndarray) -> np.ndarray:
        touching = (g > 0).reshape(-1, g.shape[-1]).any(axis=0)
        D = 1.5 * self.coefficient[touching] * np.sqrt(np.maximum(g[..., touching], 0))
        C = self.pair_compliance_m_per_N[np.ix_(touching, touching)]
        S = np.sqrt(D).reshape(-1, D.shape[-1])
        z = _solve_coupled(S, C, S[..., None])[..., 0]
        return (S * z).sum(axis=-1).reshape(g.shape[:-1])

    def _sheared(
        self, g: np.ndarray, goal: np.ndarray, closing: tuple[float, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the level's withdrawal e, shape (...), and that of each cap x, shape (..., n).

        Solves x + C t(x) = e with t = `load_drop_of_asperity`, and a e + b sum(t) = goal for
        closing = (a, b). Caps that do not touch take no part and keep x = 0. Where a neighbour's
        unloading lifts the surface more than the withdrawal lowers it, x < 0: that contact is
        sheared backwards.
        """
        shape = np.broadcast_shapes(goal.shape, g.shape[:-1])
        goal = np.broadcast_to(goal, shape)
        e, x = np.empty(shape), np.zeros((*shape, g.shape[-1]))
        states = np.broadcast_to(g, (*shape, g.shape[-1])) if g.ndim > 1 else None
        for index in np.ndindex(shape) if states is not None else [...]:
            one = g if states is None else states[index]
            touching = one > 0
            e_, x_ = _shear(
                self.coefficient[touching],
                self.pair_compliance_m_per_N[np.ix_(touching, touching)],
                one[touching],
                np.atleast_1d(goal[index]).ravel(),
                *closing,
            )
            e[index] = e_.reshape(np.shape(e[index]))
            x[index][..., touching] = x_.reshape(*np.shape(e[index]), -1)
        return e, x

    def _equilibrium(
        self, g: np.ndarray, load: float | None = None, level: float | None = None
    ) -> tuple[float, np.ndarray]:
        """Return level and compressions at given load or level, starting from compressions g.

        The equilibrium is a minimum of the energy
        sum_i 3/5 k_i^(-2/3) N_i^(5/3) + N C N / 2 + (h - y) N over N >= 0 (of given sum, without y,
        at given load). Newton's step, damped where the Hessian is not positive definite or the
        energy does not fall, so that it ends in a stable equilibrium from any start.
        """
        k, h, C = self.coefficient, self.depth_m, self.pair_compliance_m_per_N
        state = _State.at(g, k, h, C, load, level)
        damping = 0.0
        for _ in range(200):
            if state.error <= 1e-14 * state.level:
                break
            active = state.active
            N, g, gap = state.loads[active], state.g[active], state.gap[active]
            # a cap that is about to touch has no stiffness yet: half of its penetration serves
            S = np.sqrt(1.5 * k[active] * np.sqrt(np.where(N > 0, g, -gap)))
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
            raise ContactError(
                f"{self.model}: no equilibrium of {len(k)} caps at "
                + (f"approach {level:g} m" if load is None else f"load {load:g} N")
                + f"; misfit {state.error:g} m; expected at most {1e-10 * state.level:g} m; choose the "
                "mean_field model"
            )
        return state.level, np.where(state.loads > 0, state.g, -state.gap)


@dataclass(frozen=True, eq=False)
class _State:
    """Loads of all caps, and how far they are from equilibrium."""

    g: np.ndarray
    loads: np.ndarray
    level: float
    gap: np.ndarray  # zero in contact and positive outside, in equilibrium
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
        if load is not None:
            g = _shifted_to_load(k, g, load)
        g = np.maximum(g, 0)
        N = k * g * np.sqrt(g)
        sunk = C @ N
        energy = N @ (0.6 * g + 0.5 * sunk + h)
        if level is None:
            level = float(N @ (g + sunk + h) / N.sum())
        else:
            energy -= level * N.sum()
        gap = g + sunk + h - level
        active = (N > 0) | (gap < 0)
        return cls(g, N, level, gap, active, np.abs(gap[active]).max(), energy)

    def is_better_than(self, other: "_State") -> bool:
        """Whether the energy fell or, where rounding hides that, the error did."""
        rounding = 1e-13 * self.level * self.loads.sum()
        return self.energy < other.energy - rounding or (
            self.energy < other.energy + rounding and self.error < 0.5 * other.error
        )


def _solve_definite(matrix: np.ndarray, diagonal: float, right: np.ndarray) -> np.ndarray:
    """Solve with the matrix of that diagonal; LinAlgError if it is not positive definite."""
    from scipy.linalg import cho_factor, cho_solve

    matrix.flat[:: len(matrix) + 1] = diagonal
    return cho_solve(cho_factor(matrix, check_finite=False), right, check_finite=False)


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


def _shear(
    k: np.ndarray, C: np.ndarray, g: np.ndarray, goal: np.ndarray, a: float, b: float
) -> tuple[np.ndarray, np.ndarray]:
    """Solve x + C t(x) = e, a e + b sum t(x) = goal by Newton, for all goals at once.

    Given the sum (a = 0), the steps are straight in (e_total - e)^1.5, in which the sum has a finite
    slope up to total slip.
    """
    N = k * g * np.sqrt(g)
    e_total = (g + C @ N).max()
    S = np.sqrt(1.5 * k * np.sqrt(g))
    spread = S * _solve_coupled(S[None], C, S[None, :, None])[0, :, 0]
    e = goal / (a + b * spread.sum())
    x = e[:, None] * (1 - C @ spread)
    todo = np.arange(len(goal))
    if a == 0:
        total = goal >= N.sum() * (1 - 1e-15)
        e[total], x[total] = e_total, e_total - C @ N
        todo = todo[~total]
    for _ in range(100):
        if todo.size == 0:
            return e, x
        xt, et = x[todo], e[todo]
        t = load_drop_of_asperity(k, g, xt)
        S = np.sqrt(1.5 * k * np.sqrt(np.maximum(g - np.abs(xt), 0)))
        misfit = xt + t @ C - et[:, None]
        missing = goal[todo] - a * et - b * t.sum(axis=1)
        z = S[..., None] * _solve_coupled(S, C, np.stack([S * misfit, S], axis=-1))
        back, stiffness = z.sum(axis=1).T
        slope = a + b * stiffness
        de = np.where(slope > 0, missing + b * back, 0) / np.where(slope > 0, slope, 1)
        if a == 0:
            rest = e_total - et
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
    print('not', todo.size, len(goal), goal[todo]/ (k*g**1.5).sum() if a==0 else goal[todo])
    return e, x


def _solve_coupled(S: np.ndarray, C: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve (1 + S C S) z = right for a batch of diagonals S, shape (batch, n)."""
    n = S.shape[-1]
    z = np.empty(right.shape)
    step = max(1, _BATCH // max(n * n, 1))
    for first in range(0, len(S), step):
        part = slice(first, first + step)
        matrix = S[part, :, None] * C * S[part, None, :]
        matrix[:, np.arange(n), np.arange(n)] = 1
        z[part] = np.linalg.solve(matrix, right[part])
    return z


def _overlapping_pairs(a: np.ndarray, x: np.ndarray, y: np.ndarray) -> int:
    touching = a > 0
    distance = np.hypot(x[touching, None] - x, y[touching, None] - y)
    overlap = a[touching, None] + a > distance
    within = np.count_nonzero(overlap[:, touching]) - np.count_nonzero(touching)
    return within // 2 + np.count_nonzero(overlap[:, ~touching])


def interacting(
    radius_m: ArrayLike,
    depth_m: ArrayLike,
    x_m: ArrayLike,
    y_m: ArrayLike,
    E_star_Pa: float,
) -> InteractingCurve:
    """Return."""
    plain = caps(radius_m, depth_m, E_star_Pa)
    x_m, y_m = np.asarray(x_m, dtype=float), np.asarray(y_m, dtype=float)
    r = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    np.fill_diagonal(r, np.inf)
    C = 1 / (np.pi * E_star_Pa * r)
    return InteractingCurve(
        "interacting", plain.count, plain.radius_m, plain.depth_m, E_star_Pa,
        x_m=x_m, y_m=y_m, pair_compliance_m_per_N=C,
    )

