"""How sure friction and preload are that fit a measurement best."""

import math
from dataclasses import dataclass

import numpy as np

WIDER = 1.5  # than the points have it: from there on it is others that fit as well


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Standard uncertainties of ln mu, ln N0 and ln(mu N0^p), and of which of these p.

    Of all p it is that which the data fix best. Where ln mu moves with ln N0 by a slope, that is
    the negative of the slope, and what is left of ln mu is sqrt(1 - correlation^2) of it.
    """

    log_std: np.ndarray  # (3,)
    correlation: float  # of ln mu and ln N0
    exponent: float


def of_least_squares(jacobian: np.ndarray, squares: float) -> tuple[Uncertainty, float]:
    """Return what the points leave open, and the condition number.

    From the Jacobian (n, 2) of the residuals in ln mu and ln N0 and the sum of their squares: the
    covariance is s^2 (J^T J)^-1 with s^2 the sum over n - 2.
    """
    variance = squares / (len(jacobian) - 2)
    _, singular, direction = np.linalg.svd(jacobian, full_matrices=False)
    least = max(float(singular[1]), 1e-9 * float(singular[0]))  # blind to one of the two
    # A perfect fit has no variance; the correlation is that of the data all the same. So this is
    # the covariance without s^2, times the square of the greater singular value.
    shape = (direction.T / np.array([1.0, (least / singular[0]) ** 2])) @ direction
    log_std = np.sqrt(variance * np.diag(shape)) / float(singular[0])
    correlation = float(shape[0, 1] / math.sqrt(shape[0, 0] * shape[1, 1]))
    left = log_std[0] * math.sqrt(max(1.0 - correlation**2, 0.0))
    exponent = float(-shape[0, 1] / shape[1, 1])
    found = Uncertainty(np.append(log_std, left), correlation, exponent)
    return found, float(singular[0]) / least


def holding(
    of_points: Uncertainty, apart: np.ndarray, covariance: np.ndarray
) -> tuple[Uncertainty, bool]:
    """Return an uncertainty that holds others which fit as well, too, and whether they widen it.

    Parameters
    ----------
    of_points : Uncertainty
        What the points leave open beside the best.
    apart : float64, shape (k, 2)
        How far others are off in ln mu and ln N0, over how much less well they fit.
    covariance : float64, shape (2, 2)
        That of the model.
    """
    exponents = [of_points.exponent]
    if (far := float(apart[:, 1] @ apart[:, 1])) > 0.0:
        exponents.append(-float(apart[:, 0] @ apart[:, 1]) / far)
    found = []
    for one in exponents:
        both = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, one]])
        beside = of_points.log_std.copy()
        beside[2] = math.hypot(beside[2], (one - of_points.exponent) * beside[1])
        of_others = np.abs(apart @ both).max(axis=0, initial=0.0)
        of_model = np.sqrt(np.diag(both.T @ covariance @ both))
        wider = bool((of_others > WIDER * np.hypot(beside, of_model))[:2].any())
        log_std = np.hypot(np.maximum(beside, of_others), of_model)
        found.append((Uncertainty(log_std, of_points.correlation, one), wider))
    best, wider = min(found, key=lambda one: float(one[0].log_std[2]))
    if not wider:
        return best, False
    left = float(best.log_std[2] / best.log_std[0])
    correlation = -math.copysign(math.sqrt(max(1.0 - left**2, 0.0)), best.exponent)
    return Uncertainty(best.log_std, correlation, best.exponent), True
