"""Spherical caps that yield as they are first loaded, and stay flatter for good.

A cap is elastic (Hertz) up to its yield load. Beyond, it follows the fit of Jackson and Green
(2005) to finite elements: one formula up to full plasticity, for steels of any strength. (That of
Kogut and Etsion 2002 has pieces that do not join, and ends at 110 times the compression at yield;
that of Brake 2012 joins elastic and fully plastic ends by a polynomial, without a fit.) At full
plasticity the contact area is N / H. When the load falls again a cap is elastic, with the
radius to which it was flattened (Johnson 1985, Sec. 6.4)::

    R' = 4 E* a^3 / (3 N),  compression a^2 / R',  peak lower by what is left of the approach

So a face that was loaded once is a face of other caps, and every elastic model takes those.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from capslip.contact.solvers.balance import Equilibrium, press
from capslip.contact.solvers.near_field import NearField, near_field
from capslip.errors import ContactError

HARDNESS_PER_YIELD = 2.8  # Tabor 1951; Jackson and Green have 2.84 for small contacts
_MOST_STRAIN = 0.02  # yield stress over E*, to which the exponent of the area was fitted, roughly
_MOST_W = 1e4  # of the yield compression: far beyond the greatest mean pressure of the fit
_MAX_TURNS = 40  # those that end take 15 at most; contacts that run together swing for ever
_MANY = 100  # caps, of which most touch nothing: they start from the balance without interaction
_NEAR = 0.05  # of the load, that the last turn may move before Newton's
_LEAST_PART = 0.1  # of the way that a turn goes at least
_SETTLED = 1e-12  # of the load, that the last turn may move
_ACCEPTED = 1e-8


@dataclass(frozen=True)
class YieldLaw:
    """How a sphere pressed on a plane yields, one of the two bodies being softer.

    With w the approach over R (pi p_c / 2 E*)^2, that at first yield, and f the load over that of
    Hertz at w = 1 (Jackson and Green 2005, doi 10.1115/1.1866166)::

        p_c = 1.295 exp(0.736 nu) Y            greatest pressure at which all is elastic
        f = w^1.5                              or, where that is less,
            exp(-w^(5/12) / 4) w^1.5 + 4 H / p_c (1 - exp(-w^(5/9) / 25)) w
        A = w (w / w_t)^B                      area over that at yield; B = 0.14 exp(23 Y / E*)

    w_t is where both loads are the same: 1.9 at nu = 0.3, which they print. The hardness H is a
    number of the material here (theirs falls once a > 0.1 R), and Y = H / 2.8.

    Their fits of load and area make a mean pressure that rises to 0.89 to 1.04 H for metals, and
    then falls slowly. It is stretched so that its greatest value is H, and stays there: A = N / H.

    Attributes
    ----------
    hardness_Pa : float
        H, of the softer body.
    E_star_Pa : float
        Composite modulus.
    poisson_ratio : float
        nu, the lower one of the bodies.

    Examples
    --------
    >>> law = YieldLaw(1e9, 115e9, 0.3)
    >>> load_N, radius_m = np.array([1e-3, 10.0]), np.array([1e-3, 1e-3])
    >>> law.yielded(load_N, radius_m)
    array([False,  True])
    >>> print(law.mean_pressure_Pa(load_N, radius_m).round(-6) / 1e9)
    [0.091 0.936]
    """

    hardness_Pa: float
    E_star_Pa: float
    poisson_ratio: float

    @property
    def critical_pressure_Pa(self) -> float:
        """p_c, the greatest pressure of a Hertz contact that is about to yield."""
        yield_Pa = self.hardness_Pa / HARDNESS_PER_YIELD
        return 1.295 * math.exp(0.736 * self.poisson_ratio) * yield_Pa

    def yielded(self, load_N: np.ndarray, radius_m: np.ndarray) -> np.ndarray:
        """Whether caps under these loads have yielded; False for NaN."""
        return np.asarray(load_N > self._load_at_w1_N(radius_m) * self._w_t**1.5)

    def approach_m(self, load_N: np.ndarray, radius_m: np.ndarray) -> np.ndarray:
        """Return how far the caps have come down on their first loading."""
        w = self._w(load_N / self._load_at_w1_N(radius_m))
        return np.asarray(w * self._approach_at_w1_m(radius_m))

    def mean_pressure_Pa(self, load_N: np.ndarray, radius_m: np.ndarray) -> np.ndarray:
        """Return load over contact area; at most the hardness."""
        return np.asarray(self._pressure(self._w(load_N / self._load_at_w1_N(radius_m))))

    def flattened(self, load_N: np.ndarray, radius_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the radii after these loads, and by how much the peaks are lower for good.

        A cap that has not yielded keeps its radius to the last digit.
        """
        at = self.yielded(load_N, radius_m)
        flat_m, left_m = np.array(radius_m, dtype=float), np.zeros(np.shape(radius_m))
        N, R = np.broadcast_to(load_N, at.shape)[at], flat_m[at]
        a = np.sqrt(N / (np.pi * self.mean_pressure_Pa(N, R)))
        flat_m[at] = 4.0 * self.E_star_Pa * a**3 / (3.0 * N)
        left_m[at] = self.approach_m(N, R) - a**2 / flat_m[at]
        return flat_m, left_m

    def like_hertz(
        self, load_N: np.ndarray, radius_m: np.ndarray, tangent: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return Hertz caps that have these loads where the caps on their first loading have them.

        Their radii, and by how much lower their peaks are: not at all, or so that the stiffnesses
        are the same, too (`tangent`). A cap that has not yielded is one.
        """
        at = self.yielded(load_N, radius_m)
        near_m, lower_m = np.array(radius_m, dtype=float), np.zeros(np.shape(radius_m))
        N, R = np.broadcast_to(load_N, at.shape)[at], near_m[at]
        w = self._w(N / self._load_at_w1_N(R))
        approach_m = w * self._approach_at_w1_m(R)
        g = 1.5 * approach_m / self._fit(w)[1] if tangent else approach_m  # 1.5 N over dN/dg
        near_m[at] = np.square(0.75 * N / (self.E_star_Pa * g**1.5))
        lower_m[at] = approach_m - g
        return near_m, lower_m

    def _approach_at_w1_m(self, radius_m: np.ndarray) -> np.ndarray:
        return radius_m * (0.5 * math.pi * self.critical_pressure_Pa / self.E_star_Pa) ** 2

    def _load_at_w1_N(self, radius_m: np.ndarray) -> np.ndarray:
        approach_m = self._approach_at_w1_m(radius_m)
        return 4.0 / 3.0 * self.E_star_Pa * np.sqrt(radius_m) * approach_m**1.5

    def _fit(self, w: Any) -> tuple[Any, Any]:
        """Return the load of Jackson and Green, and its exponent d ln f / d ln w."""
        x, y = w ** (5 / 12), w ** (5 / 9)
        elastic = np.exp(-x / 4) * w**1.5
        slope = 4.0 * self.hardness_Pa / self.critical_pressure_Pa * w
        decay = np.exp(-y / 25)
        f = elastic - slope * np.expm1(-y / 25)
        grown = elastic * (1.5 - 5 / 48 * x) - slope * np.expm1(-y / 25) + slope * decay * y / 45
        return f, grown / f

    @cached_property
    def _w_t(self) -> float:
        """Approach at which the cap yields, as w."""
        return _w_at_yield(self)

    def _w(self, f: np.ndarray) -> np.ndarray:
        """Return w under loads f; the exponent is 1 to 1.5, so Newton in logarithms contracts."""
        w = np.asarray(f, dtype=float) ** (2 / 3)
        at = w > self._w_t
        log_f, log_w = np.log(w[at]) * 1.5, np.log(w[at])
        for _ in range(100):
            fit, exponent = self._fit(np.exp(log_w))
            step = (np.log(fit) - log_f) / exponent
            log_w -= step
            if np.all(np.abs(step) < 1e-15 * (1.0 + np.abs(log_w))):
                break
        w[at] = np.exp(log_w)
        return w

    @cached_property
    def _greatest(self) -> tuple[float, float]:
        """Where the mean pressure of the fit is greatest, as w, and this pressure."""
        return _greatest_pressure(self)

    def _fitted_pressure_Pa(self, w: np.ndarray) -> np.ndarray:
        strain = min(self.hardness_Pa / HARDNESS_PER_YIELD / self.E_star_Pa, _MOST_STRAIN)
        exponent = 0.14 * math.exp(23 * strain)
        area = w * (w / self._w_t) ** exponent
        return np.asarray(2 / 3 * self.critical_pressure_Pa * self._fit(w)[0] / area)

    def _pressure(self, w: np.ndarray) -> np.ndarray:
        elastic_Pa = 2 / 3 * self.critical_pressure_Pa * np.sqrt(w)
        at_yield_Pa = 2 / 3 * self.critical_pressure_Pa * math.sqrt(self._w_t)
        w_full, full_Pa = self._greatest
        above = self._fitted_pressure_Pa(np.maximum(w, self._w_t)) - at_yield_Pa
        stretch = (self.hardness_Pa - at_yield_Pa) / (full_Pa - at_yield_Pa)
        plastic_Pa = np.minimum(at_yield_Pa + stretch * above, self.hardness_Pa)
        plastic_Pa = np.where(w < w_full, plastic_Pa, self.hardness_Pa)
        return np.where(w > self._w_t, plastic_Pa, elastic_Pa)


@lru_cache(maxsize=64)
def _w_at_yield(law: YieldLaw) -> float:
    """Return `_w_t` of a law: each stage makes its own, and nearly all are equal."""
    low, high = 1e-2, _MOST_W
    while low < (middle := math.sqrt(low * high)) < high:  # no number is between them in the end
        if law._fit(middle)[0] > middle**1.5:
            low = middle
        else:
            high = middle
    return low


@lru_cache(maxsize=64)
def _greatest_pressure(law: YieldLaw) -> tuple[float, float]:
    """Return `_greatest` of a law."""
    low, high = law._w_t, _MOST_W
    for _ in range(4):  # down to where rounding hides the top
        w = np.geomspace(low, high, 401)
        pressure_Pa = law._fitted_pressure_Pa(w)
        at = int(np.argmax(pressure_Pa))
        low, high = float(w[max(at - 1, 0)]), float(w[min(at + 1, 400)])
    return float(w[at]), float(pressure_Pa[at])


@dataclass(frozen=True, eq=False)
class FirstLoading:
    """Caps after their first loading; arrays of shape (n,), n rows of equal caps."""

    rest: Equilibrium  # its level is that of the plane over the peaks as they were
    load_N: np.ndarray  # of one cap
    radius_m: np.ndarray  # flattened where it yielded
    depth_m: np.ndarray  # of the peaks, with what flattening left
    width_m: np.ndarray  # a^2 / R with the radius as it was: how deep the contact reaches, twice
    compression_m: np.ndarray  # of the flattened caps; negative for a gap


def first_loading(
    law: YieldLaw | None,
    radius_m: np.ndarray,
    depth_m: np.ndarray,
    E_star_Pa: float,
    load_N: float,
    *,
    compliance_m_per_N: np.ndarray | None = None,
    near: NearField | None = None,
    count: np.ndarray | float = 1.0,
    start_m: np.ndarray | None = None,
    start_N: np.ndarray | None = None,
    **turning: Any,
) -> FirstLoading:
    """Press caps for the first time, to a load.

    In turns: Hertz caps that have the loads of the last turn where the yielding ones have them are
    pressed. As long as much moves they keep their peaks, which halves what is left in each turn at
    worst; then they have the same stiffness, too, which is Newton's iteration. The balance of the
    plane and the interaction are part of each turn.

    Parameters
    ----------
    law : YieldLaw or None
        None for caps that stay elastic.
    radius_m, depth_m : float64, shape (n,)
        Radii, and depths below a plane.
    E_star_Pa, load_N : float
        Composite modulus; the load.
    compliance_m_per_N : float64, shape (n, n), optional
        Between the caps, as for `balance.press`.
    near : NearField, optional
        The same. Of caps that yield it is that of the flattened ones, turn by turn. It needs a
        start at the equilibrium of the point loads, see `first_loading_at`.
    count : float64, shape (n,)
        Equal caps in each row, only of caps that do not interact.
    start_m, start_N : float64, shape (n,), optional
        Compressions to start from; with loads, too, caps that yielded under these start there.
    turning
        `arm`, `turning_stiffness` and `moment_Nm` of `balance.press`.

    Raises
    ------
    ContactError
        If no equilibrium is found, or the turns do not end.

    Examples
    --------
    >>> law, radius_m = YieldLaw(1e9, 115e9, 0.3), np.array([1e-3, 2e-3])
    >>> found = first_loading(law, radius_m, np.array([0.0, 1e-6]), 115e9, 20.0)
    >>> print(found.load_N.round(2), (1e3 * found.radius_m).round(1))
    [10.98  9.02] [3.2 3.7]
    """

    def pressed(
        radius_m: np.ndarray,
        depth_m: np.ndarray,
        start_m: np.ndarray | None,
        beside: NearField | None = None,
    ) -> tuple[Equilibrium, np.ndarray]:
        k = 4.0 / 3.0 * E_star_Pa * np.sqrt(radius_m)
        rows = k * count
        even_m = (load_N / len(k) / rows) ** (2 / 3)
        try:
            if start_m is None and compliance_m_per_N is not None and len(k) > _MANY:
                start_m = press(rows, depth_m, None, even_m, load_N, **turning).compression_m
            near_m = even_m if start_m is None else start_m
            rest = press(rows, depth_m, compliance_m_per_N, near_m, load_N, **turning, near=beside)
        except ContactError:
            if start_m is None or beside is not None:
                raise
            rest = press(rows, depth_m, compliance_m_per_N, even_m, load_N, **turning)
        return rest, k * np.maximum(rest.compression_m, 0.0) ** 1.5

    rest, one_N, gap_m, moved, part = None, start_N, start_m, 0.0, 1.0
    if law is None or one_N is None or not law.yielded(one_N, radius_m).any():
        moved = math.inf
        try:
            rest, one_N = pressed(radius_m, depth_m, start_m, near)
        except ContactError:
            if law is None or near is not None:
                raise
            one_N = np.full(len(radius_m), load_N / np.sum(count * np.ones(len(radius_m))))
    if rest is not None and (law is None or not law.yielded(one_N, radius_m).any()):
        g = rest.compression_m
        return FirstLoading(rest, one_N, radius_m, depth_m, np.maximum(g, 0.0), g)
    assert law is not None
    for _ in range(_MAX_TURNS):
        near_m, lower_m = law.like_hertz(one_N, radius_m, tangent=moved < _NEAR)
        near_start_m = None
        if gap_m is not None and moved < _NEAR:
            held_m = (0.75 * one_N / (E_star_Pa * np.sqrt(near_m))) ** (2 / 3)
            near_start_m = np.where(one_N > 0.0, held_m, gap_m)
        sunk_m = 0.0 if near is None else _sunk_near_m(near, law, one_N, radius_m, E_star_Pa)
        rest, new_N = pressed(near_m, depth_m + lower_m + sunk_m, near_start_m)
        gap_m = rest.compression_m
        last, moved = moved, float(np.abs(count * (new_N - one_N)).sum()) / load_N
        if moved < _SETTLED:
            one_N = new_N
            break
        if 0.0 < 0.8 * last < moved:
            part = max(0.5 * part, _LEAST_PART)  # it swings to and fro: half of the way
        elif moved < _NEAR:
            part = min(2.0 * part, 1.0)  # Newton's steps are best as a whole
        one_N = one_N + part * (new_N - one_N)
    if rest is None or not moved <= _ACCEPTED:
        raise ContactError(
            f"the caps that yield find no equilibrium under {load_N:g} N: the last turn still "
            f"moved {moved:.2g} of the load; expected {_ACCEPTED:g}; check preload and hardness"
        )
    flat_m, left_m = law.flattened(one_N, radius_m)
    a2_m2 = np.cbrt(0.75 * one_N * flat_m / E_star_Pa) ** 2
    g = np.where(one_N > 0.0, a2_m2 / flat_m, rest.compression_m)
    return FirstLoading(rest, one_N, flat_m, depth_m + left_m, a2_m2 / radius_m, g)


def first_loading_at(
    place_m: np.ndarray,
    law: YieldLaw | None,
    radius_m: np.ndarray,
    depth_m: np.ndarray,
    E_star_Pa: float,
    load_N: float,
    **given: Any,
) -> FirstLoading:
    """Press caps at their places for the first time, with their near field where they have one.

    The near field of wide contacts has equilibria of its own, on caps beside one another and no
    others, and from a load on all of them these are found, or none. So point loads come first: they
    say where to start, and whether the contacts, as wide as they yielded, stand apart at all. Where
    the near field finds no balance from there, they are the answer, as of an elastic face.

    Parameters
    ----------
    place_m : float64, shape (n, 2)
        Places (x, y).
    law, radius_m, depth_m, E_star_Pa, load_N, given
        As of `first_loading`. Without a compliance between the caps it is that alone.

    Raises
    ------
    ContactError
        As for `first_loading`, of the point loads.
    """
    face = law, radius_m, depth_m, E_star_Pa, load_N
    rest = first_loading(*face, **given)
    if given.get("compliance_m_per_N") is None:
        return rest
    a_m = np.sqrt(radius_m * rest.width_m)
    near = near_field(place_m[:, 0], place_m[:, 1], a_m, E_star_Pa)
    if near is None:
        return rest
    start = {"start_m": rest.compression_m, "start_N": rest.load_N}
    try:
        return first_loading(*face, **given | start, near=near)
    except ContactError:  # it holds about contacts that point loads find nearly as they are
        return rest


def _sunk_near_m(
    near: NearField, law: YieldLaw, load_N: np.ndarray, radius_m: np.ndarray, E_star_Pa: float
) -> Any:
    """Return how deep the near field of caps that yielded sinks them."""
    flat_m, _ = law.flattened(load_N, radius_m)
    k = 4.0 / 3.0 * E_star_Pa * np.sqrt(flat_m)
    return sum(near.sunk_m(k, load_N, (load_N / k) ** (2 / 3)))
