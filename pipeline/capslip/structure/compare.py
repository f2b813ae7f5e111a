"""The model against a measurement: share of the joints, misfit, identified friction and preload."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from capslip.contact.curve import NormalCurve
from capslip.contact.models.flat import flat
from capslip.contact.slip import slip_curve
from capslip.errors import SettingsError
from capslip.structure.response import response

N_CURVE = 160
LEAST_POINTS = 5  # two parameters and something left to tell the noise
GREATEST_CORRELATION = 0.98
GREATEST_CONDITION = 100.0
PRELOAD_RANGE = 10.0  # times and divided by: where the preload is looked for
BAND_NAMES = ("small", "middle", "great")


@dataclass(frozen=True, eq=False)
class Measurement:
    """Loss factor of one structure over its amplitude; arrays of one shape (n,)."""

    amplitude_m: np.ndarray  # at mid-span, as a sensor sees it
    loss_factor: np.ndarray

    def __post_init__(self) -> None:
        amplitude_m = np.asarray(self.amplitude_m, dtype=float)
        loss_factor = np.asarray(self.loss_factor, dtype=float)
        if amplitude_m.ndim != 1 or amplitude_m.shape != loss_factor.shape or not amplitude_m.size:
            raise SettingsError(
                f"measurement: {amplitude_m.shape} amplitudes and {loss_factor.shape} loss factors;"
                " expected one loss factor an amplitude, and at least one"
            )
        for name, values in (("amplitude_m", amplitude_m), ("loss_factor", loss_factor)):
            bad = values[~((values > 0) & (values < np.inf))]
            if bad.size:
                raise SettingsError(
                    f"measurement: {name}: got {bad[0]:g}; expected finite numbers > 0"
                )
        order = np.argsort(amplitude_m, kind="stable")
        object.__setattr__(self, "amplitude_m", amplitude_m[order])
        object.__setattr__(self, "loss_factor", loss_factor[order])


@dataclass(frozen=True)
class JointModel:
    """The loss that the joints add to one mode, for any friction coefficient and preload.

    The amplitude counts the displacement of the joints, and the loss factor the energy that they
    store: W / (2 pi F v_total / 2), which is what a decay or a resonance shows. It depends on
    v / mu and N0 alone, because displacements, forces and the root of the energy go with mu.
    """

    curve: Callable[[float], NormalCurve]  # of one joint, for a preload in N
    kappa: float
    modal_stiffness_N_per_m: float
    joint_stiffness_N_per_m: float
    joints: int

    def loss_factor(
        self, amplitude_m: np.ndarray, friction_coefficient: float, preload_N: float
    ) -> np.ndarray:
        """Return the loss factor at amplitudes (n,); NaN beyond gross slip.

        It is interpolated to about 0.2 % over a grid of five decades below gross slip. Further
        below it is in proportion to the amplitude.
        """
        return self.unit_curve(preload_N)(amplitude_m / friction_coefficient)

    def gross_slip_amplitude_m(self, friction_coefficient: float, preload_N: float) -> float:
        """Return the amplitude beyond which nothing holds the joint."""
        return friction_coefficient * self.unit_curve(preload_N).gross_slip_amplitude_m

    def unit_curve(self, preload_N: float, points: int = 800) -> "UnitCurve":
        """Return the loss factor over v / mu, on a grid of so many points."""
        slip = slip_curve(self.curve(preload_N), preload_N, 1.0, self.kappa)
        share = np.append(np.geomspace(1e-5, 0.97, points), 1 - np.geomspace(0.029, 1e-6, 60))
        damping = response(
            slip,
            self.modal_stiffness_N_per_m,
            self.joint_stiffness_N_per_m,
            self.joints,
            np.append(share, 1.0) * (slip.total_slip_force_N / self.joint_stiffness_N_per_m),
        )
        return UnitCurve(
            damping.total_amplitude_m, damping.loss_factor * damping.frequency_ratio**2
        )

    def plane(self) -> "JointModel":
        """Return the same structure with perfectly plane interfaces (Peyret et al. 2010)."""
        return replace(self, curve=flat)


@dataclass(frozen=True, eq=False)
class UnitCurve:
    """Loss factor over amplitude up to gross slip for mu = 1, see `JointModel`."""

    amplitude_m: np.ndarray
    loss_factor: np.ndarray

    @property
    def gross_slip_amplitude_m(self) -> float:
        """The last amplitude."""
        return float(self.amplitude_m[-1])

    def __call__(self, amplitude_m: np.ndarray) -> np.ndarray:
        """Interpolate; NaN beyond gross slip."""
        from scipy.interpolate import PchipInterpolator

        # eta / v is constant at small amplitudes, and so the smoothest thing to interpolate.
        ratio = PchipInterpolator(np.log(self.amplitude_m), self.loss_factor / self.amplitude_m)
        inside_m = np.clip(amplitude_m, self.amplitude_m[0], self.amplitude_m[-1])
        loss = amplitude_m * ratio(np.log(inside_m))
        # the bound itself belongs to the curve, whatever the rounding of v / mu
        held = amplitude_m <= self.amplitude_m[-1] * (1 + 1e-9)
        return np.asarray(np.where(held, loss, np.nan))


@dataclass(frozen=True)
class Band:
    """Misfit over a third of the logarithmic range of amplitudes; natural logarithms."""

    name: str
    least_amplitude_m: float
    greatest_amplitude_m: float
    points: int
    rms_log_ratio: float | None  # of model over measured share of the joints
    bias_log_ratio: float | None  # mean of the same: > 0, the model loses too much


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


@dataclass(frozen=True, eq=False)
class Comparison:
    """A measurement beside the model; arrays over the measured amplitudes (n,) or a curve (k,)."""

    amplitude_m: np.ndarray
    measured_loss_factor: np.ndarray  # assembly, all sources
    intrinsic_loss_factor: np.ndarray  # monolithic beam; NaN outside its range, 0 where not given
    joint_loss_factor: np.ndarray  # what is left for the joints; NaN where it cannot be told
    joint_energy_J: np.ndarray  # W_d2 = W_assembly - W_monolithic of a cycle
    model_loss_factor: np.ndarray  # of the joints; NaN beyond gross slip
    friction_coefficient: float
    preload_N: float
    bands: tuple[Band, ...]
    identified: Identified | None
    remarks: tuple[str, ...]
    curve_amplitude_m: np.ndarray
    curve_intrinsic: np.ndarray
    curve_model: np.ndarray
    curve_plane: np.ndarray
    curve_identified: np.ndarray | None


def compare(
    assembly: Measurement,
    model: JointModel,
    friction_coefficient: float,
    preload_N: float,
    monolithic: Measurement | None = None,
    identify: bool = False,
) -> Comparison:
    """Compare the loss measured on an assembly with that of the model.

    The other sources of loss are taken out as energies, at the same amplitude and so at the same
    W_ext = K_m v^2 / 2 (Eqs. 20 to 22)::

        W_d2(v) = W_assembly(v) - W_monolithic(v),  W = pi K_m v^2 eta

    which supposes that both structures have the same K_m and lose as much elsewhere. The monolithic
    curve is interpolated over ln v inside its range and never extrapolated: a point outside has no
    share of the joints.

    Parameters
    ----------
    assembly, monolithic : Measurement
        Loss factors of the assembled and of the monolithic structure. Without the latter all loss
        is taken for that of the joints.
    model : JointModel
        The joints and the structure.
    friction_coefficient, preload_N : float
        Values at which the model is compared, and from which the identification starts.
    identify : bool
        Fit friction coefficient and preload by least squares of ln(model / measured).

    Returns
    -------
    Comparison
        Misfit by thirds of the logarithmic range; `remarks` say what was left out and why.

    Raises
    ------
    SettingsError
        If fewer than five points are left to identify two parameters, or the model is `flat`.

    Notes
    -----
    Peyret, Chevallier and Dion, Int. J. Appl. Mech. 8 (2016) 1650097, Sec. 4 and Fig. 11.
    """
    v_m = assembly.amplitude_m
    remarks: list[str] = []
    intrinsic = _intrinsic(monolithic, v_m)
    joint = assembly.loss_factor - intrinsic
    if monolithic is None:
        remarks.append("no monolithic beam was given: all loss is taken for that of the joints")
    outside = int(np.isnan(joint).sum())
    if outside:
        remarks.append(
            f"{outside} of {v_m.size} points lie outside the amplitudes of the monolithic beam and "
            "were left out: its curve is not extrapolated"
        )
    lossless = joint <= 0
    if lossless.any():
        remarks.append(
            f"{int(lossless.sum())} of {v_m.size} points lose no more than the monolithic beam and "
            "were left out; what is left may be biased upwards"
        )
    joint = np.where(lossless, np.nan, joint)
    usable = np.isfinite(joint)
    predicted = model.loss_factor(v_m, friction_coefficient, preload_N)
    beyond = int((usable & np.isnan(predicted)).sum())
    if beyond:
        gross_m = model.gross_slip_amplitude_m(friction_coefficient, preload_N)
        remarks.append(
            f"{beyond} of {v_m.size} points lie beyond gross slip of the model "
            f"({gross_m:.3g} m), where it gives no loss factor"
        )
    if (usable & (predicted == 0)).any():
        remarks.append("the model loses nothing below gross slip: no misfit can be given there")
    curve_m = np.geomspace(v_m[0], v_m[-1], N_CURVE) if v_m[0] < v_m[-1] else v_m[:1]
    identified, curve_identified = None, None
    if identify:
        identified = _identify(v_m[usable], joint[usable], model, preload_N)
        remarks += _doubts(identified)
        curve_identified = model.loss_factor(
            curve_m, identified.friction_coefficient, identified.preload_N
        )
    return Comparison(
        amplitude_m=v_m,
        measured_loss_factor=assembly.loss_factor,
        intrinsic_loss_factor=intrinsic,
        joint_loss_factor=joint,
        joint_energy_J=math.pi * model.modal_stiffness_N_per_m * v_m**2 * joint,
        model_loss_factor=predicted,
        friction_coefficient=friction_coefficient,
        preload_N=preload_N,
        bands=_bands(v_m, np.log(np.where(predicted > 0, predicted, np.nan) / joint)),
        identified=identified,
        remarks=tuple(remarks),
        curve_amplitude_m=curve_m,
        curve_intrinsic=_intrinsic(monolithic, curve_m),
        curve_model=model.loss_factor(curve_m, friction_coefficient, preload_N),
        curve_plane=model.plane().loss_factor(curve_m, friction_coefficient, preload_N),
        curve_identified=curve_identified,
    )


def _intrinsic(monolithic: Measurement | None, amplitude_m: np.ndarray) -> np.ndarray:
    if monolithic is None:
        return np.zeros(amplitude_m.shape)
    return np.interp(
        np.log(amplitude_m),
        np.log(monolithic.amplitude_m),
        monolithic.loss_factor,
        left=np.nan,
        right=np.nan,
    )


def _bands(amplitude_m: np.ndarray, log_ratio: np.ndarray) -> tuple[Band, ...]:
    edges_m = np.geomspace(amplitude_m[0], amplitude_m[-1], len(BAND_NAMES) + 1)
    index = np.searchsorted(edges_m[1:-1], amplitude_m, side="right")
    bands = []
    for i, name in enumerate(BAND_NAMES):
        inside = log_ratio[(index == i) & np.isfinite(log_ratio)]
        rms = bias = None
        if inside.size:
            rms, bias = float(np.sqrt(np.mean(inside**2))), float(inside.mean())
        least_m, greatest_m = float(edges_m[i]), float(edges_m[i + 1])
        bands.append(Band(name, least_m, greatest_m, inside.size, rms, bias))
    return tuple(bands)


def _identify(
    amplitude_m: np.ndarray, joint: np.ndarray, model: JointModel, preload_N: float
) -> Identified:
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
    # With v_gross in place of mu the search stays where every point measured has a loss factor.
    greatest_m = float(amplitude_m[-1])

    def residual(x: np.ndarray) -> np.ndarray:
        unit = model.unit_curve(math.exp(x[1]))
        gross_m = greatest_m * math.exp(x[0])
        return np.log(unit(amplitude_m / gross_m * unit.gross_slip_amplitude_m) / joint)

    def log_of_friction(x: np.ndarray) -> float:
        unit = model.unit_curve(math.exp(x[1]))
        return math.log(greatest_m / unit.gross_slip_amplitude_m) + float(x[0])

    starts, bounds = _starts(amplitude_m, joint, model, preload_N)
    fits = [least_squares(residual, start, bounds=bounds, diff_step=1e-4) for start in starts]
    fit = min(fits, key=lambda one: one.cost)
    at_bound = _bound(fit.x, bounds)
    step = 1e-4
    shift = np.array([0.0, step])
    slope = (log_of_friction(fit.x + shift) - log_of_friction(fit.x - shift)) / (2 * step)
    # x = (ln v_gross, ln N0) as functions of (ln mu, ln N0)
    jacobian = fit.jac @ np.array([[1.0, -slope], [0.0, 1.0]])
    variance = 2 * fit.cost / (amplitude_m.size - 2)
    _, singular, direction = np.linalg.svd(jacobian, full_matrices=False)
    least = max(float(singular[1]), 1e-9 * float(singular[0]))  # blind to one of the two
    spread = math.sqrt(variance) * direction.T / np.array([singular[0], least])
    (var_mu, _), (_, var_N0) = spread @ spread.T
    # A perfect fit has no variance; the correlation is that of the data all the same.
    ((a, b), (_, c)) = (direction.T / np.array([1.0, (least / singular[0]) ** 2])) @ direction
    correlation = float(b / math.sqrt(a * c))
    condition = float(singular[0]) / least
    return Identified(
        friction_coefficient=math.exp(log_of_friction(fit.x)),
        preload_N=math.exp(fit.x[1]),
        friction_coefficient_log_std=math.sqrt(var_mu),
        preload_log_std=math.sqrt(var_N0),
        correlation=correlation,
        condition_number=condition,
        distinguishable=abs(correlation) <= GREATEST_CORRELATION
        and condition <= GREATEST_CONDITION,
        exponent=float(-b / c),
        exponent_log_std=math.sqrt(var_mu * max(1 - correlation**2, 0.0)),
        rms_log_ratio=math.sqrt(2 * fit.cost / amplitude_m.size),
        points=int(amplitude_m.size),
        at_bound=at_bound,
    )


def _starts(
    amplitude_m: np.ndarray, joint: np.ndarray, model: JointModel, preload_N: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return where to begin, (ln v_gross / v_greatest, ln N0), and the bounds of the search.

    Families make the misfit a narrow valley with others beside it, so the whole range is looked
    over first, on coarse curves: the lowest places along the preload, three at most.
    """
    middle, reach = math.log(preload_N), math.log(PRELOAD_RANGE)
    logs = np.linspace(middle - reach, middle + reach, 122)[1:-1]
    excess = np.append(0.01, np.geomspace(0.03, 8, 40))
    share = amplitude_m / amplitude_m[-1] * np.exp(-excess[:, None])  # of v_gross
    least, best = np.empty(logs.size), np.empty(logs.size)
    for i, log_N0 in enumerate(logs):
        unit = model.unit_curve(math.exp(log_N0), points=100)
        misfit = np.log(unit(share * unit.gross_slip_amplitude_m) / joint)
        squares = (misfit**2).sum(axis=1)
        least[i], best[i] = squares.min(), excess[squares.argmin()]
    padded = np.concatenate(([np.inf], least, [np.inf]))
    low = np.flatnonzero((least <= padded[:-2]) & (least <= padded[2:]))
    low = low[np.argsort(least[low])][:3]
    bounds = np.array([[0.0, middle - reach], [10.0, middle + reach]])
    return np.column_stack([best[low], logs[low]]), bounds


def _bound(x: np.ndarray, bounds: np.ndarray) -> str | None:
    if x[0] - bounds[0, 0] < 1e-6:
        return "gross slip at the greatest amplitude measured"
    if x[0] > bounds[1, 0] - 1e-6:
        return "gross slip far above every amplitude measured"
    if x[1] - bounds[0, 1] < 1e-6 or x[1] > bounds[1, 1] - 1e-6:
        return f"a preload {PRELOAD_RANGE:g} times off the one given"
    return None


def _doubts(found: Identified) -> list[str]:
    doubts = [
        "the uncertainties count the scatter of the points, not the errors of the model, of the "
        "caps or of the two stiffnesses"
    ]
    if not found.distinguishable:
        doubts.append(
            "the data cannot tell friction coefficient and preload apart (correlation "
            f"{found.correlation:.3f}, condition number {found.condition_number:.0f}); they fix "
            f"mu N0^{found.exponent:.2f} to {100 * found.exponent_log_std:.1f} %; give one of the "
            "two, or measure nearer to gross slip"
        )
    if found.at_bound is not None:
        doubts.append(
            f"the identification ended at a bound ({found.at_bound}): its uncertainties do not hold"
        )
    return doubts
