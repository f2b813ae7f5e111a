"""Sums of Hertz contacts, and the formulas of one contact on which every curve rests."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.material import check_modulus
from capslip.errors import ContactError, SettingsError

KEPT = 1024  # approaches whose compressions stay known: of a joint, or of the bed of a law
_AT_ONCE = 1_000_000  # pairs of rows


def contact_radius_m(load_N: ArrayLike, radius_m: ArrayLike, E_star_Pa: float) -> np.ndarray:
    """Return the contact radius a = (3 N R / (4 E*))^(1/3) (Johnson 1987, Eq. 4.22).

    Parameters
    ----------
    load_N, radius_m : array_like
        Load of one asperity, and its composite radius; they broadcast against each other.
    E_star_Pa : float
        Composite modulus.

    Examples
    --------
    >>> print(f"{contact_radius_m(100.0, 23.8, 109.89e9):.3g} m")
    0.00253 m
    """
    return np.cbrt(3.0 * np.asarray(load_N) * np.asarray(radius_m) / (4.0 * E_star_Pa))


def coefficient_of(radius_m: np.ndarray, E_star_Pa: float) -> np.ndarray:
    """Return k = 4/3 E* sqrt(R) in N/m^1.5 of spheres, whose load is k times compression^1.5."""
    return np.asarray(4 / 3 * E_star_Pa * np.sqrt(radius_m))


def load_drop_of_asperity(
    coefficient: np.ndarray, compression_m: np.ndarray, withdrawal_m: np.ndarray
) -> np.ndarray:
    """Return the load that a Hertz contact loses on withdrawal.

    k [g^1.5 - (g - x)_+^1.5] in the form k g^1.5 (1 - q) (1 + q + q^2) with q^2 = 1 - x/g and
    1 - q = (x/g) / (1 + q), which keeps all digits for x << g. Times mu, with
    x = delta / (mu kappa), this is the tangential force of the contact (Eq. 11), so it is odd in x.

    Parameters
    ----------
    coefficient : ndarray
        k = 4/3 E* sqrt(R) in N/m^1.5.
    compression_m : ndarray
        g; zero or negative for an asperity that does not touch.
    withdrawal_m : ndarray
        x, by which the compression falls.
    """
    g, size, q = _reduced(compression_m, withdrawal_m)
    drop = g * np.sqrt(g) * (size / g / (1 + q)) * (1 + q + q * q)
    return coefficient * np.where(compression_m > 0, np.copysign(drop, withdrawal_m), 0.0)


def loss_of_asperity(
    coefficient: np.ndarray, compression_m: np.ndarray, withdrawal_m: np.ndarray
) -> np.ndarray:
    """Return the loss integral of a Hertz contact: Eq. 8 and, past total slip, the right Eq. 16.

    4 * integral from 0 to x of s (x - s) N''(g - s) ds = 4/5 k g^2.5 (1 - q)^3 (1 + 3 q + q^2)
    + 4 k g^1.5 (x - g)_+ with q as in `load_drop_of_asperity`, whose parameters it shares; even in
    x. The product is the bracket of Eq. 8, which as printed loses all digits for x << g.
    """
    g, size, q = _reduced(compression_m, withdrawal_m)
    partial = 0.8 * g * (size / g / (1 + q)) ** 3 * (1 + 3 * q + q * q)
    total = 4 * (np.abs(withdrawal_m) - size)
    loss = g * np.sqrt(g) * (partial + total)
    return coefficient * np.where(compression_m > 0, loss, 0.0)


def _reduced(
    compression_m: np.ndarray, withdrawal_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return g (1 m for a gap, which keeps divisions quiet), |x| up to total slip, and q."""
    g = np.where(compression_m > 0, compression_m, 1.0)
    size = np.minimum(np.abs(withdrawal_m), g)
    return g, size, np.sqrt((g - size) / g)


@dataclass(frozen=True, eq=False)
class HertzCurve:
    """Spherical asperities that share one approach: a sum of Hertz terms (Eqs. 2, 9, 10).

    N(y) = sum_i 4/3 E* count_i sqrt(R_i) (y - h_i)^1.5 over the asperities in contact, where
    d = y + c N with the compliance c of a linear spring in series. Leading axes of the arrays are
    sets of parameters; they broadcast against approaches and loads.

    Made by `families`, `caps` and `mean_field`, which check the values.
    """

    model: str
    count: np.ndarray  # (..., n)
    radius_m: np.ndarray  # (..., n)
    depth_m: np.ndarray  # (..., n)
    E_star_Pa: float
    compliance_m_per_N: Any = 0.0
    # What `approach_m` returned: the preload is asked again and again
    _approach_m: dict[float, np.ndarray] = field(default_factory=dict, init=False, repr=False)
    # Compressions at the approaches that it returned, which the approach alone tells less exactly
    _solved: dict[float, np.ndarray] = field(default_factory=dict, init=False, repr=False)
    # The last solution of `_once`: withdrawal and loss at the same drops share it
    _slipped: dict[tuple[Any, ...], tuple[np.ndarray, np.ndarray]] = field(
        default_factory=dict, init=False, repr=False
    )

    @property
    def touch_m(self) -> np.ndarray:
        """Approach of first touch, shape (...)."""
        return np.where(self.count > 0, self.depth_m, np.inf).min(axis=-1)

    @property
    def coefficient(self) -> np.ndarray:
        """4/3 E* sqrt(R) in N/m^1.5, shape (..., n)."""
        return coefficient_of(self.radius_m, self.E_star_Pa)

    def load_N(self, approach_m: ArrayLike) -> np.ndarray:
        """N(d)."""
        return (self.count * self.asperity_loads_N(approach_m)).sum(axis=-1)

    def asperity_loads_N(self, approach_m: ArrayLike) -> np.ndarray:
        """Load of one asperity of each row, shape (..., n)."""
        return self._loads(self._compression(approach_m))

    def approach_m(self, load_N: ArrayLike) -> np.ndarray:
        """d(N).

        Raises
        ------
        SettingsError
            If a load is negative.
        ContactError
            If a contact would be wider than its asperity (a > R), where Hertz ends, or if the
            approach would fall with growing load.
        """
        load = np.asarray(load_N, dtype=float)
        if load.ndim == 0 and float(load) in self._approach_m:
            return self._approach_m[float(load)]
        if not (load >= 0).all():
            raise SettingsError(f"{self.model}: load_N: got {load.min():g}; expected loads >= 0")
        level, g = self._pressed(load)
        if np.any((g > self.radius_m) & (self.count > 0)):
            deepest = np.where(self.count > 0, self.depth_m + self.radius_m, np.inf).min(axis=-1)
            bound = (self.count * self._loads(deepest[..., None] - self.depth_m)).sum(axis=-1)
            raise ContactError(
                f"{self.model}: a load of {load.max():g} N makes a contact wider than its asperity;"
                f" expected less than {bound.min():g} N; check the units of load and radius"
            )
        self._total_slope(g)
        approach: np.ndarray = level + self.compliance_m_per_N * load
        if len(self._solved) > KEPT:
            self._solved.clear()
            self._approach_m.clear()
        if load.ndim == 0:
            self._approach_m[float(load)] = approach
        if self.radius_m.ndim == 1:  # of sets the approach of one is not that of the others
            rows = g.reshape(-1, g.shape[-1])
            self._solved.update(zip(np.ravel(approach).tolist(), rows, strict=True))
        return approach

    def stiffness_N_per_m(self, approach_m: ArrayLike, withdrawal_m: ArrayLike = 0.0) -> np.ndarray:
        """N'(d - e)."""
        g = self._compression(approach_m)
        if np.ndim(withdrawal_m) > 0 or withdrawal_m != 0.0:
            g = g - np.abs(self._withdrawn(g, withdrawal_m))
        stiffness = self._slope(g)
        return stiffness / (1 + self.compliance_m_per_N * stiffness)

    def load_drop_N(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """N(d) - N(d - e)."""
        g = self._compression(approach_m)
        return self._drop(g, self._withdrawn(g, withdrawal_m))

    def withdrawal_m(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Withdrawal for a load drop of at most N(d)."""
        drop = np.asarray(load_drop_N, dtype=float)
        withdrawal, _ = self._unloaded(self._compression(approach_m), drop)
        return withdrawal + self.compliance_m_per_N * drop

    def loss_integral_J(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """4 * integral of s (e - s) N''(d - s)."""
        g = self._compression(approach_m)
        return self._loss(g, self._withdrawn(g, withdrawal_m))

    def loss_integral_at_drop_J(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Return the same for a load drop of at most N(d)."""
        g = self._compression(approach_m)
        return self._loss(g, self._unloaded(g, np.asarray(load_drop_N, dtype=float))[1])

    def lift_off_m(self, approach_m: ArrayLike) -> np.ndarray:
        """Withdrawal at which each row loses its load, shape (..., n); NaN where it has none."""
        g = self._compression(approach_m)
        loaded = (g > 0) & (self.count > 0)
        at = np.flatnonzero(loaded.reshape(-1, g.shape[-1]).any(axis=0))  # the others have none
        count, k, drop = self.count[..., at], self.coefficient[..., at], np.zeros(g.shape)
        for part in np.array_split(at, -(-g.size * at.size // _AT_ONCE)) if at.size else ():
            x = np.maximum(g[..., part], 0)[..., None]
            one = count * load_drop_of_asperity(k, g[..., None, at], x)
            drop[..., part] = one.sum(axis=-1)
        spring = np.asarray(self.compliance_m_per_N)[..., None] * drop
        return np.where(loaded, g + spring, np.nan)

    def lifted(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Whether each row had a load and has lost it, shape (..., n)."""
        g = self._compression(approach_m)
        return (g > 0) & (self.count > 0) & (np.abs(self._withdrawn(g, withdrawal_m)) >= g)

    def _compression(self, approach_m: ArrayLike) -> np.ndarray:
        """Return how far each asperity is compressed at an approach, negative for a gap."""
        d = np.asarray(approach_m, dtype=float)
        known = [self._solved.get(value) for value in d.ravel()[:KEPT].tolist()]
        if d.size > KEPT or any(g is None for g in known):
            return self._compression_at_level(self._level(d))
        return np.reshape(np.array(known), (*d.shape, -1))

    def _compression_at_level(self, level: np.ndarray) -> np.ndarray:
        return level[..., None] - self.depth_m

    def _level(self, approach_m: ArrayLike) -> np.ndarray:
        """Return y, the approach less the spring's share c N."""
        d = np.asarray(approach_m, dtype=float)
        c = self.compliance_m_per_N
        if not np.any(c):
            return d

        def newton_step(y: np.ndarray) -> np.ndarray:
            g = self._compression_at_level(y)
            load = (self.count * self._loads(g)).sum(axis=-1)
            return (y + c * load - d) / self._total_slope(g)

        # y + c N(y) is convex for c > 0 and concave for c < 0: monotone from y = d either way.
        return _newton(newton_step, d)

    def _pressed(self, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return level and compressions at given load."""
        # In z = (y - touch)^1.5 the load is convex and, for one asperity, linear: Newton descends
        # monotonically from the level at which the highest asperities would carry all of it.
        touch = self.touch_m
        eta = self.depth_m - touch[..., None]
        k = self.count * self.coefficient

        def newton_step(z: np.ndarray) -> np.ndarray:
            y = np.cbrt(z) ** 2
            rest = np.maximum(y[..., None] - eta, 0)
            root = np.sqrt(rest)
            slope = (k * root).sum(axis=-1)
            excess = (k * rest * root).sum(axis=-1) - load
            return excess * np.sqrt(y) / np.where(slope > 0, slope, 1)

        highest = np.where(eta == 0, k, 0).sum(axis=-1)
        level = touch + np.cbrt(_newton(newton_step, load / highest)) ** 2
        return level, level[..., None] - self.depth_m

    def _withdrawn(self, g: np.ndarray, withdrawal_m: ArrayLike) -> np.ndarray:
        """Return by how much the compressions fall, from x + c drop(x) = e; shape (..., 1)."""
        e = np.asarray(withdrawal_m, dtype=float)
        c = self.compliance_m_per_N
        if not np.any(c):
            return e[..., None]

        def newton_step(x: np.ndarray) -> np.ndarray:
            slope = 1 + c * self._slope(g - x[..., None])
            return (x + c * self._drop(g, x[..., None]) - e) / slope

        # The drop is concave: monotone from the second iterate on, whatever the sign of c.
        return _newton(newton_step, e / self._total_slope(g))[..., None]

    def _unloaded(self, g: np.ndarray, drop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the withdrawal of the asperities' level, and of each, at given load drop."""
        return self._once((g.tobytes(), drop.tobytes(), drop.shape), self._drawn_by, g, drop)

    def _once(
        self,
        key: tuple[Any, ...],
        solve: Callable[..., tuple[np.ndarray, np.ndarray]],
        *given: Any,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the solution of a problem of slip, found before where it is the last one."""
        if key not in self._slipped:
            self._slipped.clear()  # sets of many caps fill memory
            self._slipped[key] = solve(*given)
        e, x = self._slipped[key]
        return e.copy(), x.copy()

    def _drawn_by(self, g: np.ndarray, drop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # With s = x / x0 for the highest asperity the drop is concave in t = 1 - (1 - s)^1.5 and,
        # for one asperity, linear: Newton rises monotonically from t = 0.
        eta = self.depth_m - self.touch_m[..., None]
        x0 = np.maximum(np.where(self.count > 0, g, 0).max(axis=-1), 0)
        k = self.count * self.coefficient
        drop = np.minimum(drop, self._drop(g, x0[..., None]))

        def withdrawal(t: np.ndarray) -> np.ndarray:
            root = np.cbrt(1 - t)
            return x0 * t * (1 + root) / (1 + root + root**2)

        def newton_step(t: np.ndarray) -> np.ndarray:
            root = np.cbrt(1 - t)
            rest = np.maximum((x0 * root**2)[..., None] - eta, 0)
            slope = (k * np.sqrt(rest)).sum(axis=-1) * x0
            missing = drop - self._drop(g, withdrawal(t)[..., None])
            return np.maximum(-missing * root / np.where(slope > 0, slope, 1), t - 1)

        shape = np.broadcast_shapes(drop.shape, x0.shape)
        x = withdrawal(_newton(newton_step, np.zeros(shape)))
        return x, x[..., None]

    def _loads(self, g: np.ndarray) -> np.ndarray:
        rest = np.maximum(g, 0)
        return self.coefficient * rest * np.sqrt(rest)

    def _slope(self, g: np.ndarray) -> np.ndarray:
        """Return dN/dy."""
        return (1.5 * self.count * self.coefficient * np.sqrt(np.maximum(g, 0))).sum(axis=-1)

    def _total_slope(self, g: np.ndarray) -> np.ndarray:
        """Return dd/dy; it must stay positive for the curve to be one."""
        if not np.any(self.compliance_m_per_N):
            return np.ones(g.shape[:-1])
        stiffness = self._slope(g)
        slope = 1 + self.compliance_m_per_N * stiffness
        if np.any(slope <= 0):
            raise ContactError(
                f"{self.model}: a compliance of {np.min(self.compliance_m_per_N):g} m/N in series "
                "makes the approach fall with growing load; expected more than "
                f"{-1 / np.max(stiffness):g} m/N, what the contacts themselves yield; keep the bulk"
            )
        return slope

    def _drop(self, g: np.ndarray, x: np.ndarray) -> np.ndarray:
        return (self.count * load_drop_of_asperity(self.coefficient, g, x)).sum(axis=-1)

    def _loss(self, g: np.ndarray, x: np.ndarray) -> np.ndarray:
        return (self.count * loss_of_asperity(self.coefficient, g, x)).sum(axis=-1)


def checked_asperities(
    count: ArrayLike, radius_m: ArrayLike, depth_m: ArrayLike, E_star_Pa: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the arrays, broadcast against each other, with no depth below zero; see `families`."""
    check_modulus(E_star_Pa)
    count, radius_m, depth_m = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(array, dtype=float)) for array in (count, radius_m, depth_m))
    )
    for name, array, good, expected in (
        ("radius_m", radius_m, (radius_m > 0) & (radius_m < np.inf), "finite lengths > 0"),
        ("depth_m", depth_m, np.isfinite(depth_m), "finite lengths"),
        ("count", count, (count >= 0) & (count < np.inf), "finite numbers >= 0"),
    ):
        if not good.all():
            raise SettingsError(f"{name}: got {array[~good][0]:g}; expected {expected}")
    if count.shape[-1] == 0 or not (count > 0).any(axis=-1).all():
        raise ContactError("no asperities: nothing can carry the load; expected at least one")
    return count, radius_m, depth_m - np.minimum(depth_m.min(axis=-1, keepdims=True), 0)


def _newton(step: Callable[[np.ndarray], np.ndarray], start: np.ndarray) -> np.ndarray:
    """Iterate x -= step(x); the callers see to it that the sequence is monotone."""
    x = np.asarray(start, dtype=float)
    for _ in range(100):
        dx = step(x)
        x = x - dx
        if np.all(np.abs(dx) <= 1e-14 * np.abs(x)):
            return x
    # Rounding can keep the last steps above the goal; a step that still counts is a failure.
    if np.all(np.abs(dx) <= 1e-10 * np.abs(x)):
        return x
    raise ContactError("the normal curve could not be inverted; check the units of all lengths")
