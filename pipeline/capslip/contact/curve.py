"""Normal curves: load against approach, the one function in which the contact models differ.

Theorem of Ciavarella and Jaeger: two uncoupled half-spaces that are pressed together and then
sheared at constant load slip as if that load were withdrawn. So slip, loop and energy need no more
than the normal curve N(d) of a model, and `slip` writes them once.
"""

from dataclasses import replace
from typing import Any, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

Curve = TypeVar("Curve", bound="NormalCurve")
HIGHER = 1e-6  # of the approach: less is what the search for a withdrawal leaves


class NormalCurve(Protocol):
    """What slip, loop and energy need to know of a contact model.

    Approaches d, loads and withdrawals are arrays that broadcast against each other. A withdrawal e
    lowers the approach from d to d - e, and the load by the load drop N(d) - N(d - e). What is told
    apart by contact has the contacts as an additional last axis, the rows: asperities, the regions
    of a height map, or the whole of a plane face.
    """

    @property
    def model(self) -> str:
        """Name of the model."""

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


class AsperityCurve(NormalCurve, Protocol):
    """A curve whose rows are spheres, and what it knows of them; arrays of shape (..., n)."""

    @property
    def count(self) -> np.ndarray:
        """Number of equal asperities in each row."""

    @property
    def radius_m(self) -> np.ndarray:
        """Composite radius of the asperities of each row."""

    @property
    def depth_m(self) -> np.ndarray:
        """How far the peaks lie below the plane from which the approach counts."""

    def asperity_loads_N(self, approach_m: ArrayLike) -> np.ndarray:
        """Load of one asperity of each row."""


def withdrawal_to_lift_m(
    curve: NormalCurve, approach_m: ArrayLike, load_N: ArrayLike
) -> np.ndarray:
    """Return the withdrawal at which nothing touches any more, from an approach under its load.

    That of the approach from first touch; of a map, which counts it from its highest pixel, more
    where the face stands higher between the pixels.
    """
    from_touch_m = np.asarray(approach_m) - curve.touch_m
    to_lift_m = np.asarray(curve.withdrawal_m(approach_m, load_N))
    return np.where(to_lift_m > (1.0 + HIGHER) * from_touch_m, to_lift_m, from_touch_m)


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
    >>> from capslip.contact.bulk import bulk_compliance_m_per_N
    >>> from capslip.contact.models.families import families
    >>> curve = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> sunk = in_series(curve, bulk_compliance_m_per_N((0.04, 0.06), 109.89e9))
    >>> [round(float(c.approach_m(460.0)) * 1e9, 1) for c in (curve, sunk)]
    [249.9, 330.0]
    """
    total = curve.compliance_m_per_N + compliance_m_per_N
    return cast(Curve, replace(cast(Any, curve), compliance_m_per_N=total))
