"""Friction coefficient and preload from measured damping, with their uncertainties."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.compare.model import JointModel
from capslip.errors import ContactError, SettingsError
from capslip.waiting import Waiting

LEAST_POINTS = 5  # two parameters and something left to tell the noise
GREATEST_CORRELATION = 0.98
GREATEST_CONDITION = 100.0
PRELOAD_RANGE = 10.0  # times and divided by: where the preload is looked for
GREATEST_EXCESS = 10.0  # ln of gross slip over the greatest amplitude measured
MISSED = math.log(3.0)  # what is known of real joints at best: a model that misses by more is wrong
STEP = 1e-4  # of the logarithms, for differences


@dataclass(frozen=True)
class Identified:
    """Friction coefficient and preload that fit best, with standard uncertainties."""

    friction_coefficient: float
    preload_N: float
    friction_coefficient_log_std: float  # standard uncertainty of ln mu
    preload_log_std: float  # of ln N0
    correlation: float  # of ln mu and ln N0
    condition_number: float  # of the Jacobian in ln mu and ln N0
    distinguishable: bool  # whether the data tell the two apart
    exponent: float  # p: of all mu N0^p the one that the data fix best ...
    exponent_log_std: float  # ... with this standard uncertainty of its logarithm
    rms_log_ratio: float
    points: int
    at_bound: str | None  # which bound stopped the search; the uncertainties then do not hold


def friction_and_preload(
    amplitude_m: np.ndarray, joint_loss_factor: np.ndarray, model: JointModel, preload_N: float
) -> Identified:
    """Fit friction coefficient and preload by least squares of ln(model / measured).

    Parameters
    ----------
    amplitude_m, joint_loss_factor : float, shape (n,)
        Share of the joints in the loss, over increasing amplitudes.
    model : JointModel
        The joints and the structure.
    preload_N : float
        Middle of the range, a factor of ten to either side, in which the preload is looked for.

    Raises
    ------
    SettingsError
        If there are fewer than five points for two parameters, or the model loses nothing.

    Notes
    -----
    The search is over (ln v_gross / v_n, ln N0), v_n being the greatest amplitude: with v_gross in
    place of mu it stays where every point measured has a loss factor.
    """
    from scipy.optimize import least_squares

    if amplitude_m.size < LEAST_POINTS:
        raise SettingsError(
            f"identification: {amplitude_m.size} points have a share of the joints; expected at "
            f"least {LEAST_POINTS} for two parameters; measure more amplitudes"
        )
    if not (model.unit_curve(preload_N).loss_factor > 0).all():
        raise SettingsError(
            "identification: this model loses nothing below gross slip; choose a contact model "
            "with caps (contact.model)"
        )
    greatest_m = float(amplitude_m[-1])

    def residual(x: np.ndarray) -> np.ndarray:
        unit = model.unit_curve(math.exp(x[1]))
        gross_m = greatest_m * math.exp(x[0])
        return np.log(unit(amplitude_m / gross_m * unit.gross_slip_amplitude_m) / joint_loss_factor)

    def log_of_friction(x: np.ndarray) -> float:
        unit = model.unit_curve(math.exp(x[1]))
        return math.log(greatest_m / unit.gross_slip_amplitude_m) + float(x[0])

    starts, bounds = _starts(amplitude_m, joint_loss_factor, model, preload_N)
    waiting, fits = Waiting("identification", "fits"), []
    for start in starts:
        fits.append(least_squares(residual, start, bounds=bounds, diff_step=STEP))
        waiting.tell(len(fits), len(starts))
    fit = min(fits, key=lambda one: one.cost)
    shift = np.array([0.0, STEP])
    slope = (log_of_friction(fit.x + shift) - log_of_friction(fit.x - shift)) / (2 * STEP)
    # x as a function of (ln mu, ln N0)
    jacobian = fit.jac @ np.array([[1.0, -slope], [0.0, 1.0]])
    log_std, correlation, condition, exponent = _uncertainty(jacobian, 2 * fit.cost)
    return Identified(
        friction_coefficient=math.exp(log_of_friction(fit.x)),
        preload_N=math.exp(fit.x[1]),
        friction_coefficient_log_std=float(log_std[0]),
        preload_log_std=float(log_std[1]),
        correlation=correlation,
        condition_number=condition,
        distinguishable=abs(correlation) <= GREATEST_CORRELATION
        and condition <= GREATEST_CONDITION,
        exponent=exponent,
        exponent_log_std=float(log_std[0]) * math.sqrt(max(1 - correlation**2, 0.0)),
        rms_log_ratio=math.sqrt(2 * fit.cost / amplitude_m.size),
        points=int(amplitude_m.size),
        at_bound=_bound(fit.x, bounds),
    )


def remarks_on(found: Identified) -> list[str]:
    """Return what the uncertainties do not hold, and whether the two can be told apart."""
    remarks = [
        "the uncertainties count the scatter of the points, not the errors of the model, of the "
        "caps or of the two stiffnesses"
    ]
    if found.rms_log_ratio > MISSED:
        missed = math.exp(found.rms_log_ratio)
        remarks.append(
            f"even so the model misses the points by a factor of {missed:.2g} (rms): nothing is "
            "identified; look at structure, material and units first"
        )
    if not found.distinguishable:
        remarks.append(
            "the data cannot tell friction coefficient and preload apart (correlation "
            f"{found.correlation:.3f}, condition number {found.condition_number:.0f}); they fix "
            f"mu N0^{found.exponent:.2f} to {100 * found.exponent_log_std:.1f} %; give one of the "
            "two, or measure nearer to gross slip"
        )
    if found.at_bound is not None:
        remarks.append(
            f"the identification ended at a bound ({found.at_bound}): its uncertainties do not hold"
        )
    return remarks


def _uncertainty(jacobian: np.ndarray, squares: float) -> tuple[np.ndarray, float, float, float]:
    """Return standard uncertainties (2,), correlation, condition number and exponent.

    From the Jacobian (n, 2) of the residuals in ln mu and ln N0 and the sum of their squares: the
    covariance is s^2 (J^T J)^-1 with s^2 the sum over n - 2. Where ln mu moves with ln N0 by the
    slope cov / var(N0), mu N0^p with p the negative of that slope does not move with N0.
    """
    variance = squares / (len(jacobian) - 2)
    _, singular, direction = np.linalg.svd(jacobian, full_matrices=False)
    least = max(float(singular[1]), 1e-9 * float(singular[0]))  # blind to one of the two
    # A perfect fit has no variance; the correlation is that of the data all the same. So this is
    # the covariance without s^2, times the square of the greater singular value.
    shape = (direction.T / np.array([1.0, (least / singular[0]) ** 2])) @ direction
    log_std = np.sqrt(variance * np.diag(shape)) / float(singular[0])
    correlation = float(shape[0, 1] / math.sqrt(shape[0, 0] * shape[1, 1]))
    return log_std, correlation, float(singular[0]) / least, float(-shape[0, 1] / shape[1, 1])


def _starts(
    amplitude_m: np.ndarray, joint_loss_factor: np.ndarray, model: JointModel, preload_N: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return where to begin, (ln v_gross / v_greatest, ln N0), and the bounds of the search.

    Families make the misfit a narrow valley with others beside it, so the whole range is looked
    over first, on coarse curves: the lowest places along the preload, three at most. The range ends
    at the greatest preload that the caps carry.
    """
    middle, reach = math.log(preload_N), math.log(PRELOAD_RANGE)
    logs = np.linspace(middle - reach, middle + reach, model.trials + 2)[1:-1]
    excess = np.append(0.01, np.geomspace(0.03, 8, 40))
    share = amplitude_m / amplitude_m[-1] * np.exp(-excess[:, None])  # of v_gross
    least, best = np.empty(logs.size), np.empty(logs.size)
    waiting = Waiting("identification", "preloads")
    for i, log_N0 in enumerate(logs):
        try:
            unit = model.unit_curve(math.exp(log_N0), points=100)
        except ContactError:  # more than the caps can carry
            if log_N0 < middle:
                raise
            least[i:], best[i:] = np.inf, excess[0]
            break
        misfit = np.log(unit(share * unit.gross_slip_amplitude_m) / joint_loss_factor)
        squares = (misfit**2).sum(axis=1)
        least[i], best[i] = squares.min(), excess[squares.argmin()]
        waiting.tell(i + 1, logs.size)
    padded = np.concatenate(([np.inf], least, [np.inf]))
    carried = np.isfinite(least)
    low = np.flatnonzero(carried & (least <= padded[:-2]) & (least <= padded[2:]))
    low = low[np.argsort(least[low])][:3]
    greatest = middle + reach if carried.all() else logs[carried][-1] - STEP
    bounds = np.array([[0.0, middle - reach], [GREATEST_EXCESS, greatest]])
    return np.column_stack([best[low], np.minimum(logs[low], greatest)]), bounds


def _bound(x: np.ndarray, bounds: np.ndarray) -> str | None:
    if x[0] - bounds[0, 0] < 1e-6:
        return "gross slip at the greatest amplitude measured"
    if x[0] > bounds[1, 0] - 1e-6:
        return "gross slip far above every amplitude measured"
    if x[1] - bounds[0, 1] < 1e-6 or x[1] > bounds[1, 1] - 1e-6:
        return f"a preload {PRELOAD_RANGE:g} times off the one given, or the most the caps carry"
    return None
