"""Round contacts of metal that are withdrawn together, each from the pressures that it has."""

import math
from functools import cache

import numpy as np

from capslip.contact.solvers.metal import OF_METAL, OVER_HARDNESS, PLACES
from capslip.contact.solvers.shear import solve_coupled
from capslip.errors import ContactError

_RINGS = 240  # radii to which a contact shrinks, densest at its edge
_MOST_TURNS = 100
_SETTLED = 1e-9  # of the load


def withdrawn_together(
    over_hardness: np.ndarray,
    load_N: np.ndarray,
    radius_m: np.ndarray,
    shares: tuple[float, ...],
    pair_per_m: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return withdrawals and losses of contacts of one face, which come up together.

    So they do as they unload and as they slip: at a share of the whole load the light ones have
    lost far more of theirs, and the heavy ones less.

    Parameters
    ----------
    over_hardness : float64, shape (n,)
        p0 / H of round contacts; up to `OVER_HARDNESS[0]` they are Hertz's.
    load_N, radius_m : float64, shape (n,)
        What they carry, and how wide they are; at least one carries a load.
    shares : tuple of float
        Of the whole load, below 1, by which it drops.
    pair_per_m : float64, shape (n, n), optional
        By how much a load sinks the face elsewhere, times E*; nothing without it, as what sinks all
        alike is linear in the load and loses nothing.

    Returns
    -------
    float64, float64, shape (k,) each
        The withdrawals of the face times E*, in N/m, and the losses times E*, in N^2/m^2.

    Examples
    --------
    Hertz: the withdrawal is 3 N / (4 a E*) (1 - (1 - s)^(2/3)).

    >>> s = 0.25, 0.75
    >>> x, _ = withdrawn_together(np.zeros(1), np.ones(1), np.ones(1), s)
    >>> print((x / 0.75 / (1.0 - (1.0 - np.array(s)) ** (2 / 3))).round(4))
    [1. 1.]
    """
    carry = load_N > 0.0
    N, a_m, columns = load_N[carry], radius_m[carry], _unloading(over_hardness[carry])
    C = np.zeros((N.size, N.size)) if pair_per_m is None else pair_per_m[np.ix_(carry, carry)]
    found = []
    for share in shares:
        x, own = _at_drop(share * N.sum(), N, a_m, C, columns)
        found.append((x, float((N * N / a_m) @ _withdrawn(columns, own * a_m / N)[1])))
    withdrawal, loss = np.array(found).T
    return withdrawal, loss


def _at_drop(
    drop: float, N: np.ndarray, a_m: np.ndarray, C: np.ndarray, columns: tuple[np.ndarray, ...]
) -> tuple[float, np.ndarray]:
    """Return the withdrawal of a face at a drop of its load, and that of each contact.

    Newton's method for x_i + sum_j C_ij F_j(x_j) = x, sum_i F_i = drop, symmetric in the roots of
    the stiffnesses; contacts that slip as a whole have none.
    """
    x, own = 0.0, np.zeros(N.size)
    for _ in range(_MOST_TURNS):
        F, _, slope = _withdrawn(columns, own * a_m / N)
        F, D = N * F, a_m * slope
        root, sunk = np.sqrt(D), C @ F
        off = x - own - sunk
        missing = drop - float(F.sum())
        if abs(missing) + D @ np.abs(off) < _SETTLED * drop:
            return x, own
        right = root[:, None] * np.column_stack((-own - sunk, np.ones(N.size)))
        still, along = (root[:, None] * solve_coupled(root[None], C, right[None])[0]).T
        x = (missing - float(still.sum())) / float(along.sum())
        own = x - sunk - C @ (still + x * along)
    raise ContactError("contacts that are withdrawn together find no balance")


def _withdrawn(
    columns: tuple[np.ndarray, ...], x: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return load drop, loss and stiffness of each contact of load, radius and E* 1 at its own x.

    Beyond its last withdrawal it slips as a whole; before the first it sticks to the face.
    """
    e, F, L = columns
    own, each = np.clip(x, 0.0, e[:, -1]), np.arange(len(e))
    low, high = np.zeros(len(e), dtype=int), np.full(len(e), e.shape[1] - 1)
    while (high - low > 1).any():
        middle = (low + high) // 2
        above = e[each, middle] > own
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    width = e[each, high] - e[each, low]
    up = (own - e[each, low]) / width
    drop, loss = ((1.0 - up) * of[each, low] + up * of[each, high] for of in (F, L))
    slope = np.where(x < e[:, -1], (F[each, high] - F[each, low]) / width, 0.0)
    loss = loss + 4.0 * np.maximum(x - own, 0.0)
    return np.where(x < 0.0, 2.0 * x, drop), loss, slope


def _unloading(over_hardness: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return withdrawal, load drop and loss of contacts that shrink to nothing, (n, k) each.

    Of loads, radii and E* of 1. Abel's integral is linear in the pressures, so a contact between
    two of the table is between theirs::

        e(c) = 2 integral_c^1 r p(r) / sqrt(r^2 - c^2) dr
        F(c) = 2 c e + 2 G,  L = 8 integral G de  with  G(c) = integral_c^1 e dc

    the loss 8 integral F de - 4 F e without its cancellation.
    """
    c, of_rows, mean = _rows()
    row = np.interp(over_hardness, OVER_HARDNESS, np.arange(len(OVER_HARDNESS)))
    low = np.minimum(row.astype(int), len(OVER_HARDNESS) - 2)
    up = (row - low)[:, None]
    e = (1.0 - up) * of_rows[low] + up * of_rows[low + 1]
    e /= (1.0 - up) * mean[low, None] + up * mean[low + 1, None]
    none = np.zeros((len(e), 1))
    G = np.hstack((none, np.cumsum(0.5 * (e[:, 1:] + e[:, :-1]) * -np.diff(c), axis=1)))
    F = 2.0 * (c * e + G)
    L = 8.0 * np.cumsum(0.5 * (G[:, 1:] + G[:, :-1]) * np.diff(e), axis=1)
    return e, F / F[:, -1:], np.hstack((none, L))


@cache
def _rows() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return radii c, withdrawals to these for each row of `OF_METAL`, and its mean pressures.

    With r^2 = c^2 + (1 - c^2) cos^2 u the place is (1 - c^2) sin^2 u, in which the pressure over
    that of Hertz is a straight line between two of `PLACES`: all integrals are closed.
    """
    c = np.cos(0.5 * math.pi * np.linspace(0.0, 1.0, _RINGS) ** 2)
    q = 1.0 - c**2
    at = np.array((0.0, *PLACES))
    rows = np.hstack((OF_METAL[:, :1], OF_METAL))
    slope = np.diff(rows) / np.diff(at)
    level = rows[:, :-1] - slope * at[:-1]
    sine = np.sqrt(np.minimum(at / np.maximum(q, 1e-300)[:, None], 1.0))
    u = np.arcsin(sine)
    cosine = np.cos(u)
    square = 0.5 * (u - sine * cosine)  # integral of sin^2 u
    fourth = 0.75 * square - 0.25 * sine**3 * cosine
    of_rows = level @ np.diff(square).T + slope @ (q * np.diff(fourth).T)
    means = level @ np.diff(at**1.5) + 0.6 * slope @ np.diff(at**2.5)
    return c, 3.0 / math.pi * q * of_rows, means
