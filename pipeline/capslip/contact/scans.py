"""Several scans of one joint: patches of equal pressure, each of which stands for its share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.curve import NormalCurve
from capslip.contact.scaled import with_ratio
from capslip.contact.uneven import PatchedCurve


def curve_of_scans(
    curves: Sequence[NormalCurve], preload_N: float, share: Sequence[float], ratio: Sequence[float]
) -> NormalCurve:
    """Return the normal curve of a joint whose patches are those of several scans.

    What two scans do not tell is how high one lies above the other, so none is pressed harder:
    every scan bears the nominal pressure, and under shear all share one displacement::

        T(delta) = sum_i s_i T_i(delta),  W(delta) = sum_i s_i W_i(delta)

    with T_i and W_i of the joint as it were if all of it were face as that of scan i. Where these
    have a kappa_i of their own, the withdrawal e of the joint, with a kappa of its own, is one of
    e kappa / kappa_i in scan i: so lengths and losses of scan i count kappa_i / kappa times.

    Parameters
    ----------
    curves : sequence of NormalCurve
        Of the joint as it were if all of it were face as that of one scan.
    preload_N : float
        Of the joint.
    share : sequence of float
        Of the joint for which each scan stands; their sum is 1.
    ratio : sequence of float
        Of kappa of each scan to that of the joint, which may be any, see `kappa_of_scans`.

    Raises
    ------
    ContactError
        If a curve cannot carry the preload.

    Examples
    --------
    >>> from capslip.contact.models.families import families
    >>> one = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> two = curve_of_scans([one, one], 460.0, [0.3, 0.7], [1.0, 1.0])
    >>> d, e = one.approach_m(460.0), 5e-8
    >>> [round(float(curve.load_drop_N(d, e)), 6) for curve in (one, two)]
    [140.5234, 140.5234]
    """
    own = [with_ratio(curve, r) for curve, r in zip(curves, ratio, strict=True)]
    if len(own) == 1:
        return own[0]
    approach_m = np.array([float(curve.approach_m(preload_N)) for curve in own])
    return SummedCurve(tuple(own), approach_m, np.asarray(share, dtype=float))


def joint_of_scans(
    curves: Sequence[NormalCurve], preload_N: float, share: Sequence[float], kappa: Sequence[float]
) -> tuple[NormalCurve, float]:
    """Return the normal curve of a joint of several scans, and its kappa, from those of each."""
    whole = kappa_of_scans(curves, preload_N, share, kappa)
    return curve_of_scans(curves, preload_N, share, [one / whole for one in kappa]), whole


def kappa_of_scans(
    curves: Sequence[NormalCurve],
    preload_N: float,
    share: Sequence[float],
    kappa: Sequence[float],
) -> float:
    """Return kappa of a joint of several scans, from that of each: their stiffnesses add up.

    sum s_i K_i / sum s_i K_i / kappa_i, so that the stiffness of their curve is the normal one.
    """
    if len(set(kappa)) == 1:
        return kappa[0]
    K = [float(curve.stiffness_N_per_m(curve.approach_m(preload_N))) for curve in curves]
    normal = np.multiply(share, K)
    return float(normal.sum() / (normal / kappa).sum())


@dataclass(frozen=True, eq=False)
class SummedCurve(PatchedCurve):
    """Few patches of curves of their own, summed wherever they are asked: no table in between.

    Made by `curve_of_scans`.
    """

    def load_drop_N(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """N(D) - N(D - e)."""
        return self._sum("load_drop_N", approach_m, withdrawal_m)

    def loss_integral_J(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """4 * integral of s (e - s) N''(D - s)."""
        return self._sum("loss_integral_J", approach_m, withdrawal_m)

    def _slope_N_per_m(self, withdrawal_m: np.ndarray) -> np.ndarray:
        """N'(D - e)."""
        return self.stiffness_N_per_m(self.preload_approach_m, withdrawal_m)
