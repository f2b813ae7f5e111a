"""Caps that push each other apart: each contact sinks the surface under its neighbours."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.models.caps import caps
from capslip.contact.rung import Contacts, Rung, Scene, contacts_of_caps, touching_caps
from capslip.contact.solvers.balance import Equilibrium, press, press_sets
from capslip.contact.solvers.hertz import (
    KEPT,
    HertzCurve,
    load_drop_of_asperity,
    loss_of_asperity,
)
from capslip.contact.solvers.near_field import NearField, near_field
from capslip.contact.solvers.shear import lift_off, shear, solve_coupled
from capslip.errors import ContactError, SettingsError

MAX_LIFT_OFFS = 300  # contacts
MANY_LOADS, MOST_TOGETHER = 8, 64  # loads that are worth solving together, and of how many contacts


@dataclass(frozen=True, eq=False)
class InteractingCurve(HertzCurve):
    """Hertz contacts whose levels differ: g_i = y - h_i - sum_j C_ij N_j, N_i = k_i g_i^1.5.

    C is constant and symmetric: a network of springs, which loses nothing. So the loss is the sum
    of Eq. 8 over the contacts, each with its own displacement, and what little the near field makes
    of it; nothing is interpolated. Where contacts overlap, a small one may grow when the load
    falls, or touch only then. Under shear, at constant load, the former is displaced backwards and
    the latter takes no part, and so they are counted; without them the load drop is
    N(d) - N(d - e).

    Made by `interacting`, which checks the values.
    """

    x_m: np.ndarray = field(kw_only=True)  # (n,)
    y_m: np.ndarray = field(kw_only=True)  # (n,)
    pair_compliance_m_per_N: np.ndarray = field(kw_only=True)  # (n, n), zero diagonal
    near: NearField | None = field(default=None, kw_only=True, repr=False)
    start_m: np.ndarray | None = field(default=None, kw_only=True, repr=False)  # of compressions
    # Level and compressions under the last load, which curves that differ by a spring share
    _equilibrium: dict[float, tuple[float, np.ndarray]] = field(
        default_factory=dict, kw_only=True, repr=False
    )
    # Slopes at single states: that under the preload is asked again and again
    _slopes: dict[bytes, np.ndarray] = field(default_factory=dict, init=False, repr=False)

    def overlapping_pairs(self, approach_m: float) -> int:
        """Count the pairs with a_i + a_j > r_ij: their contacts merge, and the model ends there.

        A cap that carries nothing has a = 0: it counts if its peak lies inside another's contact.
        """
        return self._overlapping(self._compression(approach_m))

    def _overlapping(self, g: np.ndarray) -> int:
        """Count them, of rows of compressions as if each contact were as wide as in its widest."""
        a = np.sqrt(self.radius_m * np.maximum(g, 0)).reshape(-1, g.shape[-1])
        a = a.max(axis=0, initial=0.0)
        touching = a > 0
        over_distance = (a[touching, None] + a) * self.pair_compliance_m_per_N[touching]
        overlap = np.pi * self.E_star_Pa * over_distance > 1.0
        if not overlap.any():
            return 0
        return int(overlap[:, touching].sum() // 2 + overlap[:, ~touching].sum())

    def lift_off_m(self, approach_m: ArrayLike) -> np.ndarray:
        """Withdrawal at which each cap loses its load, shape (..., n); solved when asked for.

        NaN where it has none, for a small cap between contacts that all but merge, which grows at
        first, and for all of more than 300 contacts: the time grows as their fourth power.
        """
        g = self._compression(approach_m)
        if np.count_nonzero(g > 0, axis=-1).max(initial=0) > MAX_LIFT_OFFS:
            return np.full(g.shape, np.nan)
        return np.array([self._lift_off(one) for one in g.reshape(-1, g.shape[-1])]).reshape(
            g.shape
        )

    def _compression_at_level(self, level: np.ndarray) -> np.ndarray:
        g = level[..., None] - self.depth_m
        start = None
        for index in np.ndindex(level.shape):
            y = float(level[index])
            if y <= self.touch_m:
                continue
            if start is None:
                mean = self.pair_compliance_m_per_N.mean()
                args = (self.count, self.radius_m, self.depth_m, self.E_star_Pa, mean)
                start = HertzCurve(self.model, *args)._compression(y)
            start = self._at_rest(start, level=y).compression_m
            g[index] = start
        return g

    def _pressed(self, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        level = np.full(load.shape, self.touch_m)
        g = level[..., None] - self.depth_m
        start, many = None, self._pressed_together(load[load > 0.0])
        for index in np.ndindex(load.shape):
            N = float(load[index])
            if N == 0:
                continue
            if N in self._equilibrium or N in many:
                level[index], g[index] = self._equilibrium.get(N) or many[N]
                continue
            if start is None:
                start = self.start_m
            if start is None:
                start = super()._pressed(np.asarray(N))[1]
            rest = self._at_rest(start, load=N)
            level[index], start = rest.level_m, rest.compression_m
            g[index] = start
        if load.ndim == 0 and load > 0.0:
            self._equilibrium.clear()
            self._equilibrium[float(load)] = float(level), g
        return level, g

    def _at_rest(
        self, start: np.ndarray, load: float | None = None, level: float | None = None
    ) -> Equilibrium:
        """Return the equilibrium: that of point loads where contacts run together."""
        if self.near is not None:
            try:
                rest = press(*self._system, start, load, level, near=self.near)
            except ContactError:  # far above the preload
                rest = None
            if rest is not None and not self._overlapping(rest.compression_m):
                return rest
        return press(*self._system, start, load, level)

    def _pressed_together(self, load: np.ndarray) -> dict[float, tuple[float, np.ndarray]]:
        """Return level and compressions under many loads; none where contacts are many or overlap.

        Under s N all heights are s times those of caps of h / s and R s under N. Without
        overlap there is one equilibrium, so it is no matter from where it is found.
        """
        if load.size < MANY_LOADS:
            return {}
        share = load / load.max()
        k, h, C = self._system
        start = HertzCurve._pressed(self, load)[1] / share[:, None]
        if np.count_nonzero((start > 0.0).any(axis=0)) > MOST_TOGETHER:
            return {}
        scaled = k * np.sqrt(share)[:, None], h / share[:, None]
        level, _, g = press_sets(*scaled, C, start, float(load.max()))
        if self._near(g * share[:, None]) is not None:
            level, _, g = press_sets(*scaled, C, g, float(load.max()), near=self.near)
        level, g = level * share, g * share[:, None]
        if self._overlapping(g):
            return {}
        return dict(zip(load.tolist(), zip(level.tolist(), g, strict=True), strict=True))

    @property
    def _system(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.coefficient, self.depth_m, self.pair_compliance_m_per_N

    def _withdrawn(self, g: np.ndarray, withdrawal_m: ArrayLike) -> np.ndarray:
        closing = (1.0, self.compliance_m_per_N)
        return self._sheared(g, np.asarray(withdrawal_m, dtype=float), closing)[1]

    def _unloaded(self, g: np.ndarray, drop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self._sheared(g, drop, (0.0, 1.0))

    def _sheared(
        self, g: np.ndarray, goal: np.ndarray, closing: tuple[float, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the level's withdrawal, shape (...), and that of each cap, shape (..., n)."""
        key = g.tobytes(), goal.tobytes(), goal.shape, closing
        return self._once(key, self._slid, g, goal, closing)

    def _slid(
        self, g: np.ndarray, goal: np.ndarray, closing: tuple[float, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        shape, n = np.broadcast_shapes(g.shape[:-1], goal.shape), g.shape[-1]
        near, on = self._near_of(g)
        k, g, goals = self.coefficient[..., on], g[..., on], np.broadcast_to(goal, shape)
        if g.ndim > 1:
            k, g = (np.broadcast_to(one, (*shape, on.size)).reshape(-1, on.size) for one in (k, g))
        x = np.zeros((goals.size, n))
        C = self.pair_compliance_m_per_N[on][:, on]
        e, x[:, on] = shear(k, C, g, goals.ravel(), closing, near)
        return e.reshape(shape), x.reshape(*shape, n)

    def _lift_off(self, g: np.ndarray) -> np.ndarray:
        withdrawal = np.full(len(g), np.nan)
        touching = g > 0
        if touching.any():
            k = self.coefficient[touching]
            C = self.pair_compliance_m_per_N[touching][:, touching]
            e, x = lift_off(k, C, g[touching], self._near_of(g)[0])
            drop = load_drop_of_asperity(k, g[touching], x).sum(axis=-1)
            withdrawal[touching] = e + self.compliance_m_per_N * drop
        return withdrawal

    def _loss(self, g: np.ndarray, x: np.ndarray) -> np.ndarray:
        loss, (near, on) = super()._loss(g, x), self._near_of(g)
        if near is None:
            return loss
        k, g, x = self.coefficient[..., on], g[..., on], x[..., on]
        slid = np.clip(x, -np.maximum(g, 0.0), np.maximum(g, 0.0))
        each = load_drop_of_asperity(k, g, slid), loss_of_asperity(k, g, slid)
        return loss + near.loss_J(k, g, slid, *each)

    def _near(self, g: np.ndarray) -> NearField | None:
        """Return the near field where no contacts run together."""
        return None if self.near is None or self._overlapping(g) else self.near

    def _near_of(self, g: np.ndarray) -> tuple[NearField | None, np.ndarray]:
        """Return the same for what touches in any of the rows of g, and what that is."""
        near, on = self._near(g), np.flatnonzero((g > 0).reshape(-1, g.shape[-1]).any(axis=0))
        return (None if near is None else near.of(on)), on

    def _slope(self, g: np.ndarray) -> np.ndarray:
        if g.ndim > 1:
            return self._implicit_slope(g)
        key = g.tobytes()
        if key not in self._slopes:
            if len(self._slopes) > KEPT:
                self._slopes.clear()
            self._slopes[key] = self._implicit_slope(g)
        return self._slopes[key].copy()

    def _implicit_slope(self, g: np.ndarray) -> np.ndarray:
        """dN/dy by the implicit derivative 1^T (1 + D C)^-1 D 1, D = diag(1.5 k sqrt(g)).

        With the near field C has some per cent more, K. Then the slope is the maximum over s of
        2 sum s - s (1 / D + K) s, which leaves but the square of what s is off.
        """
        near, touching = self._near_of(g)
        if not touching.size:
            return np.zeros(g.shape[:-1])
        held = np.maximum(g[..., touching], 0).reshape(-1, touching.size)
        k = np.broadcast_to(self.coefficient[..., touching], g[..., touching].shape)
        k = k.reshape(held.shape)
        S = np.sqrt(1.5 * k * np.sqrt(held))
        C = self.pair_compliance_m_per_N[touching][:, touching]
        s = S * solve_coupled(S, C, S[..., None])[..., 0]
        if near is None:
            return s.sum(axis=-1).reshape(g.shape[:-1])
        N, D = k * held * np.sqrt(held), np.square(S)

        def more_m(s: np.ndarray) -> np.ndarray:
            dg = np.divide(s, D, out=np.zeros_like(s), where=D > 0)
            return np.asarray(sum(near.changed_m(k, N, held, s, dg)))

        for _ in range(2):
            right = (S * (1.0 - more_m(s)))[..., None]
            s = S * solve_coupled(S, C, right)[..., 0]
        back = np.divide(s, D, out=np.zeros_like(s), where=D > 0) + s @ C + more_m(s)
        return (2.0 * s - s * back).sum(axis=-1).reshape(g.shape[:-1])


def interacting(
    radius_m: ArrayLike,
    depth_m: ArrayLike,
    x_m: ArrayLike,
    y_m: ArrayLike,
    E_star_Pa: float,
    preload_N: float | None = None,
    memory_limit_bytes: float = 4e9,
    start_m: np.ndarray | None = None,
) -> InteractingCurve:
    """Return the normal curve of caps with elastic interaction.

    A contact's load sinks the surface at distance r by N / (pi E* r), and near to it by some per
    cent more or less, see `near_field`. As a half-space does, the curve contains the bulk sinking
    of the face, see `bulk_compliance_m_per_N` and `in_series`.

    Parameters
    ----------
    radius_m, depth_m, E_star_Pa
        As for `caps.caps`.
    x_m, y_m : array_like, shape (n,)
        Places of the peaks.
    preload_N : float, optional
        Of the joint. Contacts that stand apart under it have the near field; without it all act on
        one another as point loads.
    memory_limit_bytes : float, optional
        The solver needs 56 n^2 bytes.
    start_m : float64, shape (n,), optional
        Compressions to start from: those under the preload, where there is one.

    Raises
    ------
    SettingsError
        If a value is out of bounds, or two caps are at the same place.
    ContactError
        If there are too many caps for the memory, or no cap at all.

    Notes
    -----
    Measured on two equal caps against boundary elements, as a share of N / (pi E* r): 1.006 at
    r = 3.3 a, 1.000 at 2.5 a and 0.989 at 2.1 a, where the contacts almost merge. The near field
    has 1.007, 1.002 and 0.992.

    Examples
    --------
    >>> pair = interacting([20.0, 20.0], [0.0, 0.0], [0.0, 0.02], [0.0, 0.0], 109.89e9)
    >>> alone = caps([20.0, 20.0], [0.0, 0.0], 109.89e9)
    >>> sunk = pair.approach_m(200.0) - alone.approach_m(200.0)
    >>> round(float(sunk * np.pi * 109.89e9 * 0.02 / 100.0), 9)
    1.0
    """
    plain = caps(radius_m, depth_m, E_star_Pa)
    x_m, y_m = np.asarray(x_m, dtype=float), np.asarray(y_m, dtype=float)
    shape = plain.radius_m.shape
    if len(shape) != 1 or x_m.shape != shape or y_m.shape != shape:
        raise SettingsError(
            f"interacting: shapes of x_m {x_m.shape}, y_m {y_m.shape} and of the caps {shape}; "
            "expected one axis of equal length"
        )
    if not np.isfinite(x_m + y_m).all():
        raise SettingsError("x_m, y_m: got a place that is not finite; expected metres")
    n = len(x_m)
    if 56.0 * n**2 > memory_limit_bytes:
        raise ContactError(
            f"interacting: {n} caps need {56e-9 * n**2:.3g} GB; expected at most "
            f"{memory_limit_bytes / 1e9:.3g} GB; use the mean_field model, or fewer caps"
        )
    r = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    np.fill_diagonal(r, np.inf)
    if n > 1 and r.min() == 0:
        i, j = np.unravel_index(int(r.argmin()), r.shape)
        raise SettingsError(
            f"interacting: caps {i} and {j} are both at x = {x_m[i]:g} m, y = {y_m[i]:g} m; "
            "expected caps at different places"
        )
    curve = InteractingCurve(
        *("interacting", plain.count, plain.radius_m, plain.depth_m, E_star_Pa),
        x_m=x_m,
        y_m=y_m,
        pair_compliance_m_per_N=1 / (np.pi * E_star_Pa * r),
        start_m=start_m,
    )
    return curve if preload_N is None else _with_near_field(curve, preload_N)


def _with_near_field(curve: InteractingCurve, preload_N: float) -> InteractingCurve:
    """Return the curve with the near field of its contacts, unless they run together.

    Those are the contacts that it starts from, where it does.
    """
    g = curve.start_m
    if g is None:
        try:
            _, g = curve._pressed(np.asarray(preload_N, dtype=float))
        except ContactError:
            return curve  # who asks for that load hears of it
    a_m = np.sqrt(curve.radius_m * np.maximum(g, 0.0))
    near = near_field(curve.x_m, curve.y_m, a_m, curve.E_star_Pa)
    return curve if near is None else replace(curve, near=near, start_m=g, _equilibrium={})


def _build(scene: Scene) -> InteractingCurve:
    caps, use = scene.caps, scene.use
    spheres = scene.radius_m, scene.depth_m, caps.x_m[use], caps.y_m[use]
    return interacting(*spheres, scene.E_star_Pa, scene.preload_N, start_m=scene.start_m)


def _contacts(scene: Scene, curve: InteractingCurve, approach_m: float) -> Contacts:
    return contacts_of_caps(scene, curve, approach_m, curve.overlapping_pairs(approach_m))


def _loads_N(curve: InteractingCurve, load_N: float) -> np.ndarray:
    apart = replace(curve, _equilibrium={})  # the curve keeps what it was asked last
    return apart.asperity_loads_N(float(apart.approach_m(load_N)))


RUNG = Rung(
    name="interacting",
    label="interacting",
    cost=4,
    made_from="spheres",
    automatic=True,
    holds_bulk=True,
    leaves_out="Caps are spheres and act on one another through a half-space: other shapes, "
    "contacts that merge and the edges of the face are left out.",
    colour="#0072B2",
    build=_build,
    contacts=_contacts,
    touching=touching_caps,
    interacts=True,
    coupled_loads_N=_loads_N,
)
