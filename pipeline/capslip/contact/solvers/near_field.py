"""What contacts that are near do to one another beyond point loads.

The load N_j of a contact sinks the surface around it like a point load, G N_j with G = 1 / (pi E*
r), and more, as it is spread over the contact: by a_j^2 / (10 r^2) of that. A contact i feels the
mean over itself under the pressure of a flat punch, which is more again by a_i^2 / (6 r^2), and it
feels the slope v_i = sum_j N_j grad_i G: on a slope the place where a sphere touches moves away by
R_i v_i, and by half of what that gains the sphere comes nearer, R_i |v_i|^2 / 2. A contact that has
moved away sinks its neighbours less. All this is the gradient of one energy in the loads N, with
a^2 = R g and N = k g^1.5 of each contact:

    1/20 sum_ij N_i N_j G_ij (a_i^2 + a_j^2) / r_ij^2 - 1/2 sum_i N_i R_i |v_i|^2

Two equal caps so sink one another by 1 + 4/15 (a / r)^2 - 2 / pi (a / r)^3 of a point load.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

FEW = 0.2  # of the contacts that carry: below, a copy of their rows costs less than the others
SMALL = 64  # contacts: of no more, all rows cost less than to look for those that carry


@dataclass(frozen=True, eq=False)
class NearField:
    """Contacts at their places; made by `near_field`."""

    per_N: np.ndarray  # G / r^2, dG_ij / dx_i and dG_ij / dy_i, shape (3, n, n), zero diagonals
    E_star_Pa: float

    def of(self, on: Any) -> "NearField":
        """Return that of some of the contacts, by their numbers or a mask."""
        return NearField(self.per_N[:, on][..., on], self.E_star_Pa)

    def sunk_m(self, k: np.ndarray, N: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how deep loads sink the surface at each contact, see `changed_m`.

        From no load on, where the means are halves of the differences: half of the products.
        Of the first part 3/8, of the second 1/3 is its energy over the loads: they grow as N^(5/3)
        and N^2.
        """
        at, radius_m = carrying(N), self._radius_m(k)
        spread, *slopes = self.per_N[:, at]
        by_spread, *by_slopes = self._felt(N, at)
        a2, moved = radius_m * g, radius_m * N
        by_width = a2 * by_spread / 6.0 + (N * a2)[..., at] @ spread / 10.0
        by_slope = np.zeros_like(by_width)
        for slope, v in zip(slopes, by_slopes, strict=True):
            by_slope += (moved * v)[..., at] @ slope - 0.5 * radius_m * np.square(v)
        return by_width, by_slope

    def changed_m(
        self, k: np.ndarray, N: np.ndarray, g: np.ndarray, dN: np.ndarray, dg: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much contacts sink more under more load.

        Exact between two states, as all terms are products of what changes: no digits are lost
        where they hardly differ. With small changes it is the derivative.

        Parameters
        ----------
        k : float64, shape (n,) or (..., n)
            Hertz coefficients in N/m^1.5.
        N, g : float64, shape (..., n)
            Loads and compressions, not negative: the means of those of the two states.
        dN, dg : float64, shape (..., n)
            Their differences.

        Returns
        -------
        ndarray, ndarray
            By widths, and by slopes.
        """
        at = carrying(N, dN)
        radius_m, (spread, *slopes) = self._radius_m(k), self.per_N[:, at]
        a2, da2 = radius_m * g, radius_m * dg
        felt, dfelt = self._felt(N, at), self._felt(dN, at)
        by_width = (da2 * felt[0] + a2 * dfelt[0]) / 6.0
        by_width += (dN * a2 + N * da2)[..., at] @ spread / 10.0
        by_slope = np.zeros_like(by_width)
        for slope, v, dv in zip(slopes, felt[1:], dfelt[1:], strict=True):
            moved = radius_m * (dN * v + N * dv)
            by_slope += moved[..., at] @ slope - radius_m * v * dv
        return by_width, by_slope

    def _radius_m(self, k: np.ndarray) -> np.ndarray:
        return np.square(0.75 * k / self.E_star_Pa)

    def _felt(self, N: np.ndarray, at: Any) -> np.ndarray:
        """Return what loads do by each of `per_N`, shape (3, ..., n)."""
        if N.ndim > 2:
            return np.stack([N[..., at] @ one for one in self.per_N[:, at]])
        felt: np.ndarray = N[..., at] @ self.per_N[:, at]
        return felt

    def slope_m_per_N(self, k: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Return the derivatives of what contacts sink by the loads, shape (n, n)."""
        one_N = np.eye(len(g)) * (g > 0.0)
        each_m = np.divide(one_N, 1.5 * k * np.sqrt(g), out=np.zeros_like(one_N), where=one_N > 0)
        N = np.broadcast_to(k * g * np.sqrt(g), one_N.shape)
        return np.asarray(sum(self.changed_m(k, N, np.broadcast_to(g, N.shape), one_N, each_m)))

    def loss_J(
        self, k: np.ndarray, g: np.ndarray, x: np.ndarray, t: np.ndarray, own_J: np.ndarray
    ) -> np.ndarray:
        """Return what the loss of sheared contacts has beside that of each alone.

        A coupling that is not linear, h(t) under load drops t, leaves 8 int t dh - 4 t h of
        8 int T de - 4 T e (Eq. 8). With q^2 = 1 - x / g, L the loss of one contact up to lift-off,
        w = k g^2.5 (1 - q)^2 (3 + 6 q + 4 q^2 + 2 q^3) that is

            1/6 sum_i R_i L_i sum_j H_ij N_j - 2/15 sum_i R_i w_i sum_j H_ij t_j
            + 2 sum_i R_i t_i |sum_j t_j grad_i G|^2

        with H = G / r^2, in which no digits are lost at small slip.

        Parameters
        ----------
        k : float64, shape (n,)
            Hertz coefficients in N/m^1.5.
        g, x : float64, shape (..., n)
            Compressions, and what they lose of them at the greatest displacement, at most all.
        t, own_J : float64, shape (..., n)
            Load drop and L of each.

        Returns
        -------
        ndarray
            Shape (...).
        """
        held = np.maximum(g, 0.0)
        slid = np.abs(x)
        share = np.divide(slid, held, out=np.zeros(slid.shape), where=held > 0.0)
        q = np.sqrt(1.0 - share)
        squared = np.square(share / (1.0 + q)) * (3.0 + q * (6.0 + q * (4.0 + 2.0 * q)))
        radius_m = self._radius_m(k)
        N = k * held * np.sqrt(held)
        by_drop, *v = self._felt(t, slice(None))
        lost = own_J * (N @ self.per_N[0]) / 6.0
        lost -= N * held * squared * np.sign(x) * by_drop * (2.0 / 15.0)
        v2 = np.square(v[0]) + np.square(v[1])
        return np.asarray((radius_m * (lost + 2.0 * np.abs(t) * v2)).sum(axis=-1))


def near_field(
    x_m: np.ndarray, y_m: np.ndarray, a_m: np.ndarray, E_star_Pa: float
) -> NearField | None:
    """Return what contacts do to one another beyond point loads.

    Parameters
    ----------
    x_m, y_m : float64, shape (n,)
        Places.
    a_m : float64, shape (n,)
        Contact radii at the preload; 0 without contact.
    E_star_Pa : float
        Composite modulus.

    Returns
    -------
    NearField or None
        None where contacts run together or a peak lies in one: there nothing of this holds.
    """
    dx_m, dy_m = x_m[:, None] - x_m, y_m[:, None] - y_m
    r_m = np.hypot(dx_m, dy_m)
    np.fill_diagonal(r_m, np.inf)
    on = a_m > 0.0
    if (a_m[on, None] + a_m > r_m[on]).any():
        return None
    spread = 1.0 / (np.pi * E_star_Pa * r_m**3)
    return NearField(np.stack((spread, -dx_m * spread, -dy_m * spread)), E_star_Pa)


def carrying(*loads: np.ndarray) -> Any:
    """Return the contacts with any load where these are few of many, else all."""
    n = loads[0].shape[-1]
    if n <= SMALL:
        return slice(None)
    loaded = np.any([(one != 0.0).reshape(-1, n).any(axis=0) for one in loads], axis=0)
    on = np.flatnonzero(loaded)
    return on if on.size <= FEW * n else slice(None)
