"""Normal curves: load against approach, the one function in which the contact models differ.

Theorem of Ciavarella and Jaeger: two uncoupled half-spaces that are pressed together and then
sheared at constant load slip as if that load were withdrawn. So slip, loop and energy need no more
than the normal curve N(d) of a model, and `slip` writes them once.
"""

import math
from dataclasses import replace
from typing import Any, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.flat import flat
from capslip.contact.hertz import HertzCurve
from capslip.errors import ContactError, SettingsError

__all__ = [
    "NormalCurve",
    "bulk_compliance_m_per_N",
    "caps",
    "families",
    "flat",
    "in_series",
    "mean_field",
]

Curve = TypeVar("Curve", bound="NormalCurve")


class NormalCurve(Protocol):
    """What slip, loop and energy need to know of a contact model.

    Approaches d, loads and withdrawals are arrays that broadcast against each other. A withdrawal e
    lowers the approach from d to d - e, and the load by the load drop N(d) - N(d - e). What is told
    apart by asperity has the asperities as an additional last axis.
    """

    @property
    def model(self) -> str:
        """Name of the model."""

    @property
    def count(self) -> np.ndarray:
        """Number of equal asperities in each row."""

    @property
    def radius_m(self) -> np.ndarray:
        """Composite radius of the asperities of each row."""

    @property
    def depth_m(self) -> np.ndarray:
        """How far the peaks lie below the plane from which the approach counts."""

    @property
    def touch_m(self) -> np.ndarray:
        """Approach of first touch; the load is zero up to here."""

    @property
    def compliance_m_per_N(self) -> Any:
        """Compliance of the linear spring in series, see `in_series`."""

    def load_N(self, approach_m: ArrayLike) -> np.ndarray:
        """N(d)."""

    def approach_m(self, load_N: ArrayLike) -> np.ndarray:
        """d(N), the inverse of `load_N`."""

    def stiffness_N_per_m(self, approach_m: ArrayLike, withdrawal_m: ArrayLike = 0.0) -> np.ndarray:
        """N'(d - e)."""

    def asperity_loads_N(self, approach_m: ArrayLike) -> np.ndarray:
        """Load of one asperity of each row."""

    def load_drop_N(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """N(d) - N(d - e), without cancellation however small e is."""

    def withdrawal_m(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Withdrawal, the inverse of `load_drop_N`."""

    def loss_integral_J(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """4 * integral from 0 to e of s (e - s) N''(d - s) ds."""

    def loss_integral_at_drop_J(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Return the same at given load drop; a spring in series plays no part in it."""

    def lift_off_m(self, approach_m: ArrayLike) -> np.ndarray:
        """Withdrawal at which each row loses its load; NaN where it has none, or if unknown."""

    def lifted(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Whether each row had a load and has lost it."""


def families(
    count: ArrayLike, radius_m: ArrayLike, depth_m: ArrayLike, E_star_Pa: float
) -> HertzCurve:
    """Return the normal curve of families of equal spheres, as many as wanted (Eqs. 2, 9, 10).

    Parameters
    ----------
    count : array_like, shape (..., n)
        Spheres in each family, zero allowed (m and n of the paper).
    radius_m : array_like, shape (..., n)
        Composite radius of the spheres.
    depth_m : array_like, shape (..., n)
        How far the peaks of the family lie below the highest ones: (0, h) for the paper's two.
        **The rows of the curve are sorted by depth.** A negative depth makes that family the
        highest, and the approach counts from it: h < 0 is the two families in the other order.
    E_star_Pa : float
        Composite modulus, see `composite`.

    Returns
    -------
    HertzCurve
        Leading axes are sets of parameters and broadcast against approaches and loads: 1e5 sets at
        64 approaches are arrays of shape (100000, 1, n) and an approach of shape (64,).

    Raises
    ------
    SettingsError
        If a value is out of bounds.

    Examples
    --------
    >>> curve = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> round(float(curve.load_N(2.5e-7)), 1)
    460.4
    """
    count, radius_m, depth_m = _checked(count, radius_m, depth_m, E_star_Pa)
    order = np.argsort(depth_m, axis=-1, kind="stable")
    count, radius_m, depth_m = (
        np.take_along_axis(array, order, axis=-1) for array in (count, radius_m, depth_m)
    )
    return HertzCurve("families", count, radius_m, depth_m, E_star_Pa)


def caps(radius_m: ArrayLike, depth_m: ArrayLike, E_star_Pa: float) -> HertzCurve:
    """Return the normal curve of caps that each have their own radius and depth.

    As `families` with one cap each, in the order given.

    Examples
    --------
    >>> curve = caps([23.8] * 5 + [26.7] * 18, [0] * 5 + [2.4e-7] * 18, 109.89e9)
    >>> round(float(curve.load_N(2.5e-7)), 1)
    460.4
    """
    count, radius_m, depth_m = _checked(1.0, radius_m, depth_m, E_star_Pa)
    return HertzCurve("caps", count, radius_m, depth_m, E_star_Pa)


def mean_field(
    radius_m: ArrayLike,
    depth_m: ArrayLike,
    E_star_Pa: float,
    side_m: tuple[float, float],
    preload_N: float,
) -> HertzCurve:
    """Return the normal curve of caps on a face that sinks as if the load were spread evenly.

    d(N) = d_caps(N) + c N (1 - 1 / sqrt(n)) / (E* sqrt(A)): the mean sinking of the face (see
    `bulk_compliance_m_per_N`) less the share of each contact in its own. The number n of caps in
    contact is that under the preload, at every load, so that d(N) has no steps. The approach
    becomes that of interacting caps to about 3 %, the stiffness to 20 %; the energy at given force
    stays that of `caps`.

    Parameters
    ----------
    radius_m, depth_m, E_star_Pa
        As for `caps`.
    side_m : (float, float)
        Sides of the face.
    preload_N : float
        Load at which the caps in contact are counted.
    """
    if not 0 < preload_N < np.inf:
        raise SettingsError(f"preload_N: got {preload_N:g}; expected a finite number > 0")
    curve = caps(radius_m, depth_m, E_star_Pa)
    in_contact = np.count_nonzero(curve.asperity_loads_N(curve.approach_m(preload_N)), axis=-1)
    share = 1 - 1 / np.sqrt(in_contact)
    sinking = share * bulk_compliance_m_per_N(side_m, E_star_Pa)
    return replace(curve, model="mean_field", compliance_m_per_N=sinking)


def in_series(curve: Curve, compliance_m_per_N: float) -> Curve:
    """Return the curve with a term linear in the load added to d(N).

    Positive: a linear spring in series. Negative: takes one away, as the bulk sinking of a
    half-space that the model of the structure already holds. The energy at given force stays as it
    is, because W = 4 T delta - 8 * integral of delta dT does not see what is linear in T.

    Parameters
    ----------
    curve : NormalCurve
        Any curve of this package.
    compliance_m_per_N : float
        c of d(N) + c N.

    Raises
    ------
    ContactError
        For `flat`, if the compliance becomes negative. For the others later, by the methods at an
        approach where it would fall with growing load; then the bulk term has to stay.

    Examples
    --------
    >>> curve = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> sunk = in_series(curve, bulk_compliance_m_per_N((0.04, 0.06), 109.89e9))
    >>> [round(float(c.approach_m(460.0)) * 1e9, 1) for c in (curve, sunk)]
    [249.9, 330.0]
    """
    total = curve.compliance_m_per_N + compliance_m_per_N
    return cast(Curve, replace(cast(Any, curve), compliance_m_per_N=total))


def bulk_compliance_m_per_N(side_m: tuple[float, float], E_star_Pa: float) -> float:
    """Return the mean sinking of a rectangular face under uniform pressure, a unit of load.

    c / (E* sqrt(A)) with the closed form of c for any aspect ratio: the integral of 1 / (pi r) over
    all pairs of points of an a x b rectangle (a >= b), over (a b)^1.5, where

        integral of 1/r = 2 a^2 b asinh(b/a) + 2 a b^2 asinh(a/b)
                          + 2/3 [a^3 + b^3 - (a^2 + b^2)^1.5]

    Parameters
    ----------
    side_m : (float, float)
        Sides of the face (ly, lx).
    E_star_Pa : float
        Composite modulus.

    Examples
    --------
    >>> round(bulk_compliance_m_per_N((1.0, 1.0), 1.0), 3)
    0.946
    >>> round(bulk_compliance_m_per_N((2.0, 3.0), 1.0) * 6**0.5, 3)
    0.937
    """
    b, a = sorted(side_m)
    if not 0 < b <= a < math.inf:
        raise SettingsError(f"side_m: got {side_m}; expected two finite lengths > 0")
    _check_modulus(E_star_Pa)
    t = b / a
    corner = t**3 - math.expm1(1.5 * math.log1p(t**2))
    integral = 2 * t * math.asinh(t) + 2 * t**2 * math.asinh(1 / t) + 2 / 3 * corner
    c = integral / (math.pi * t**1.5)
    return c / (E_star_Pa * math.sqrt(a * b))


def _check_modulus(E_star_Pa: float) -> None:
    if not 0 < E_star_Pa < math.inf:
        raise SettingsError(f"E_star_Pa: got {E_star_Pa:g}; expected a finite number > 0")


def _checked(
    count: ArrayLike, radius_m: ArrayLike, depth_m: ArrayLike, E_star_Pa: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the arrays, broadcast against each other, with no depth below zero."""
    _check_modulus(E_star_Pa)
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
