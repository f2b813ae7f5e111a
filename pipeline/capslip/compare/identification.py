"""Friction coefficient and preload from measured damping, with their uncertainties."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np

from capslip.compare.model import JointModel, UnitCurve
from capslip.compare.uncertainty import holding, of_least_squares
from capslip.errors import ContactError, SettingsError
from capslip.units import readable
from capslip.waiting import Waiting

LEAST_POINTS = 5  # two parameters and something left to tell the noise
GREATEST_CORRELATION = 0.98
GREATEST_CONDITION = 100.0
PRELOAD_RANGE = 10.0  # times and divided by: where the preload is looked for
GREATEST_EXCESS = 10.0  # ln of gross slip over the greatest amplitude measured
EXCESS = np.append(0.01, np.geomspace(0.03, 8, 40))  # of it, that are looked at first
MISSED = math.log(3.0)  # what is known of real joints at best: a model that misses by more is wrong
STEP = 1e-4  # of ln v_gross and ln N0, for differences; of a map that of ln N0 is the model's
SAME = 1e-6  # relative, of squares
STEPS = np.array([1, -1, 4, -4, 16, -16])  # of these, where the face carries none at the first
PARTS = 6, 3, 3  # of the way between trials, then of the parts
NEIGHBOURS = 4  # preloads to either side of the one that fits, whose scatter counts
ALIKE = 3.0  # standard uncertainties of the points, within which another preload fits as well
CLOSE = STEP * 2.0 ** np.arange(9)  # of ln N0, from the best: valleys closer than the trials
TURNS = 4  # to the lowest of what was tried


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
    points: int  # that were fitted
    unresolved: int  # that were not: less slips there than the model resolves
    resolved_from_m: float  # amplitude from which it does
    at_bound: str | None  # which bound stopped the search; the uncertainties then do not hold
    # Least and greatest preload that fit as well, where they lie farther than least squares tell
    alike_N: tuple[float, float] | None = None

    @property
    def missed(self) -> float | None:
        """By which factor (rms) the points are missed where that is too much to identify by."""
        return math.exp(self.rms_log_ratio) if self.rms_log_ratio > MISSED else None


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
        If there are fewer than five resolved points for two parameters, or the model loses nothing
        at some amplitudes or all.
    ContactError
        If the face cannot carry the preload in the middle.

    Notes
    -----
    The search is over (ln v_gross / v_n, ln N0), v_n being the greatest amplitude: with v_gross in
    place of mu it stays where every point measured has a loss factor.

    The curve of a map jumps by some percent from one preload to the next, as contacts and pixels
    come and go, and least squares end in any of its dips. So more and more preloads are tried about
    the lowest, each with its best friction, and the uncertainties hold how far solutions beside it
    are off a smooth curve.

    Caps that touch under one preload and not under the next leave several valleys, whose own width
    says nothing of the others. So the uncertainties hold every preload that was tried: where the
    squares S with the best friction are sqrt((S - S_min) / s^2) = k standard uncertainties of the
    points above the least, that is k of its own away at least. In one valley least squares say so.

    A map resolves no slip below some share of mu N0, and tells nothing of the points there. They
    are left out, and as the share is of what is found, the others are fitted anew until it agrees.
    """
    if amplitude_m.size < LEAST_POINTS:
        raise SettingsError(
            f"identification: {amplitude_m.size} points have a share of the joints; expected at "
            f"least {LEAST_POINTS} for two parameters; measure more amplitudes"
        )
    loses = model.unit_curve(preload_N).loss_factor > 0
    if loses.any() and not loses.all():
        raise SettingsError(
            "identification: this model loses nothing at some amplitudes below gross slip, as "
            "under a normal load that oscillates; expected a loss at all, whose ratio is fitted; "
            "compare without --identify, or give no slip.normal_amplitude_ratio"
        )
    if not loses.any():
        raise SettingsError(
            "identification: this model loses nothing below gross slip; choose a contact model "
            "with caps (contact.model)"
        )
    # At least those that would be resolved if the greatest amplitude were at gross slip
    least_mu = float(amplitude_m[-1]) / model.gross_slip_amplitude_m(1.0, preload_N)
    from_m, tried = model.resolved_from_m(least_mu, preload_N), set[int]()
    first = int(np.searchsorted(amplitude_m, from_m))
    while True:
        _check_resolved(amplitude_m, first, from_m)
        found = _fitted(amplitude_m[first:], joint_loss_factor[first:], model, preload_N)
        from_m = model.resolved_from_m(found.friction_coefficient, found.preload_N)
        tried.add(first)
        again = int(np.searchsorted(amplitude_m, from_m))
        if again == first or (again < first and again in tried):
            return replace(found, unresolved=first, resolved_from_m=from_m)
        first = again


def _check_resolved(amplitude_m: np.ndarray, first: int, from_m: float) -> None:
    if amplitude_m.size - first < LEAST_POINTS:
        above = readable(f"{from_m:.3g} m")
        raise SettingsError(
            f"identification: {amplitude_m.size - first} of {amplitude_m.size} points lie above "
            f"{above}, below which less slips than the pixels of the map resolve; expected at "
            f"least {LEAST_POINTS} for two parameters; measure at greater amplitudes, or scan on "
            "finer pixels"
        )


def _fitted(
    amplitude_m: np.ndarray, joint_loss_factor: np.ndarray, model: JointModel, preload_N: float
) -> Identified:
    """Return what fits all of these points best."""
    starts, trials, bounds = _starts(amplitude_m, joint_loss_factor, model, preload_N)
    search = _Search(amplitude_m, joint_loss_factor, model, bounds)
    if model.is_rough:
        x = search.scanned(starts[:, 1], 2 * math.log(PRELOAD_RANGE) / (model.trials + 1))
        search.try_all(trials)
    else:
        x = search.lowest(starts, trials)
    jacobian, covariance = search.near(x)
    squares = float(np.square(search.residual(x)).sum())
    of_points, condition = of_least_squares(jacobian, squares)
    alike, apart = search.alike(x, squares)
    known, wider = holding(of_points, apart, covariance)
    return Identified(
        friction_coefficient=math.exp(search.log_of_friction(x)),
        preload_N=math.exp(x[1]),
        friction_coefficient_log_std=float(known.log_std[0]),
        preload_log_std=float(known.log_std[1]),
        correlation=known.correlation,
        condition_number=condition,
        distinguishable=abs(known.correlation) <= GREATEST_CORRELATION
        and condition <= GREATEST_CONDITION,
        exponent=known.exponent,
        exponent_log_std=float(known.log_std[2]),
        rms_log_ratio=math.sqrt(squares / amplitude_m.size),
        points=int(amplitude_m.size),
        unresolved=0,
        resolved_from_m=0.0,
        at_bound=_bound(x, bounds),
        alike_N=alike if wider else None,
    )


@dataclass(frozen=True, eq=False)
class _Search:
    """The misfit over x = (ln v_gross / v_greatest, ln N0)."""

    amplitude_m: np.ndarray
    joint_loss_factor: np.ndarray
    model: JointModel
    bounds: np.ndarray  # (2, 2)
    # Least squares, excess and ln v_gross / v_greatest for mu = 1 at each ln N0 that was tried
    tried: dict[float, tuple[float, float, float]] = field(default_factory=dict)

    @cached_property
    def _unit_curve(self) -> Callable[[float], UnitCurve]:
        """That of the model, kept: a residual and its slope over ln v_gross are of one preload."""
        return cache(self.model.unit_curve)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Return ln(model / measured); infinite where the face cannot carry the preload."""
        try:
            return self._of_curve(self._unit_curve(math.exp(x[1])), x[0])
        except ContactError:
            return np.full(self.amplitude_m.size, np.inf)

    def carried(self, x: np.ndarray) -> np.ndarray | None:
        """Return x, or one beside it, with a preload that the face carries; None without one."""
        for step in (0.0, *(STEP * STEPS)):
            beside = np.array([x[0], np.clip(x[1] + step, *self.bounds[:, 1])])
            if np.isfinite(self.residual(beside)).all():
                return beside
        return None

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Return the Jacobian of the residuals (n, 2) over x, by differences.

        To the first side on which the face carries the preload, in steps that grow: one at which it
        finds no equilibrium is no end of the search.
        """
        at, jacobian = self.residual(x), np.zeros((self.amplitude_m.size, 2))
        for i, (low, high) in enumerate(self.bounds.T):
            for step in STEP * STEPS:
                beside = x.copy()
                beside[i] += step
                if not low <= beside[i] <= high:
                    continue
                difference = self.residual(beside) - at
                if np.isfinite(difference).all():
                    jacobian[:, i] = difference / step
                    break
        return jacobian

    def log_of_friction(self, x: np.ndarray) -> float:
        """Return ln mu."""
        unit = self._unit_curve(math.exp(x[1]))
        return math.log(self.amplitude_m[-1] / unit.gross_slip_amplitude_m) + float(x[0])

    def lowest(self, starts: np.ndarray, trials: np.ndarray) -> np.ndarray:
        """Return the x of least misfit, by least squares from several starts (k, 2).

        Again from the lowest of what was tried beside, where that is lower.
        """
        self.try_all(trials)
        for _ in range(TURNS):
            x = self._along_slopes(starts)
            self.try_all(np.clip(x[1] + np.append(-CLOSE, CLOSE), *self.bounds[:, 1]))
            best = min(self.tried, key=lambda one: self.tried[one][0])
            if self.tried[best][0] > (1.0 - SAME) * float(np.square(self.residual(x)).sum()):
                break
            starts = np.array([[self.tried[best][1], best]])
        return x

    def _along_slopes(self, starts: np.ndarray) -> np.ndarray:
        from scipy.optimize import least_squares

        waiting, fits = Waiting("identification", "fits"), []
        for i, start in enumerate(starts):
            if (begin := self.carried(start)) is not None:
                # a step to where the face carries nothing is taken back, as that is infinite
                fits.append(least_squares(self.residual, begin, self.slopes, self.bounds))
                self._least(float(fits[-1].x[1]))  # the lowest of its valley
            waiting.tell(i + 1, len(starts))
        if not fits:
            raise ContactError(
                f"identification: got a face that carries none of the {len(starts)} preloads from "
                "which to begin; expected one; look at its level and material"
            )
        return np.asarray(min(fits, key=lambda one: one.cost).x)

    def try_all(self, log_N0: np.ndarray) -> None:
        """Look for the least squares at preloads."""
        for one in log_N0.tolist():
            self._least(one)

    def alike(self, x: np.ndarray, squares: float) -> tuple[tuple[float, float], np.ndarray]:
        """Return least and greatest preload that fits as well as x, and how far off each is.

        In ln mu and ln N0, (k, 2), over the standard uncertainties by which it fits less well.
        """
        logs = np.array(list(self.tried))
        least, excess, log_gross = np.array(list(self.tried.values())).T
        variance = squares / (self.amplitude_m.size - 2)
        with np.errstate(divide="ignore"):
            k = np.sqrt(np.maximum(least - squares, 0.0) / np.float64(variance))
        apart = np.column_stack([excess - log_gross - self.log_of_friction(x), logs - x[1]])
        held = k <= ALIKE  # none of a perfect fit
        N0 = np.exp(np.append(logs[held], x[1]))
        return (float(N0.min()), float(N0.max())), apart[held] / np.maximum(k[held], 1.0)[:, None]

    def scanned(self, log_N0: np.ndarray, way: float) -> np.ndarray:
        """Return the x of least misfit of preloads about those given, which lie a way apart."""
        tried, waiting = self.tried, Waiting("identification", "preloads beside")
        for parts in PARTS:
            way /= parts
            beside = log_N0[:, None] + way * np.arange(1 - parts, parts)
            new = [one for one in np.clip(beside, *self.bounds[:, 1]).flat if one not in tried]
            for i, one in enumerate(new):
                self._least(one)
                waiting.tell(i + 1, len(new))
            log_N0 = np.array([min(tried, key=lambda one: tried[one][0])])
        return np.array([tried[log_N0[0]][1], log_N0[0]])

    def near(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the Jacobian of the residuals (n, 2) in ln mu and ln N0, and a covariance (2, 2).

        That of ln mu and ln N0 between two solutions about x, by what each is off parabolas over
        ln N0 through them all.
        """
        way, n = NEIGHBOURS * self.model.step, self.amplitude_m.size
        low, high = np.clip([x[1] - way, x[1] + way], *self.bounds[:, 1])
        logs = np.linspace(low, high, 2 * NEIGHBOURS + 1)
        values = np.full((logs.size, 1 + n), np.inf)
        for i, one in enumerate(logs):
            _, excess, log_gross = self._least(one)
            values[i] = excess - log_gross, *self.residual(np.array([excess, one]))
        held = np.isfinite(values).all(axis=1)
        if held.sum() <= NEIGHBOURS:
            raise ContactError(
                f"identification: got a face that carries {math.exp(x[1]):.5g} N, but few preloads "
                "beside it; expected all; look at its level and material"
            )
        smooth = np.vander((logs[held] - x[1]) / self.model.step, 3, increasing=True)
        coefficients = np.linalg.lstsq(smooth, values[held])[0]
        rough = values[held] - smooth @ coefficients
        mu_by_N0, by_N0 = (
            coefficients[1, 0] / self.model.step,
            coefficients[1, 1:] / self.model.step,
        )
        # Each is best at that ln N0 at which its residuals have nothing of the slope of all in them
        off = -rough[:, 1:] @ by_N0 / (by_N0 @ by_N0)
        apart = np.column_stack([rough[:, 0] + mu_by_N0 * off, off])
        # that of the data and that of the solution which fits them
        covariance = 2.0 * apart.T @ apart / (held.sum() - 3)
        low, high = np.clip([x[0] - STEP, x[0] + STEP], *self.bounds[:, 0])
        by_mu = self.residual(np.array([high, x[1]])) - self.residual(np.array([low, x[1]]))
        by_mu /= high - low
        # along the parabolas the best ln mu moves with ln N0; here it is held
        return np.column_stack([by_mu, by_N0 - mu_by_N0 * by_mu]), covariance

    def _least(self, log_N0: float) -> tuple[float, float, float]:
        """Return the least squares at a preload, their ln v_gross / v_greatest, and that of mu = 1.

        Infinite where the face cannot carry it.
        """
        if log_N0 not in self.tried:
            self.tried[log_N0] = self._looked_for(log_N0)
        return self.tried[log_N0]

    def _looked_for(self, log_N0: float) -> tuple[float, float, float]:
        from scipy.optimize import minimize_scalar

        try:
            unit = self._unit_curve(math.exp(log_N0))
        except ContactError:
            return math.inf, 0.0, math.inf

        def squares(excess: float) -> float:
            return float(np.square(self._of_curve(unit, excess)).sum())

        grid = np.concatenate(([0.0], EXCESS, [GREATEST_EXCESS]))
        least = 1 + int(np.argmin([squares(one) for one in EXCESS]))
        around, options = (grid[least - 1], grid[least + 1]), {"xatol": 1e-10}
        found = minimize_scalar(squares, bounds=around, method="bounded", options=options)
        log_gross = math.log(unit.gross_slip_amplitude_m / self.amplitude_m[-1])
        return float(found.fun), float(found.x), log_gross

    def _of_curve(self, unit: UnitCurve, excess: float) -> np.ndarray:
        gross_m = float(self.amplitude_m[-1]) * math.exp(excess)
        loss_factor = unit(self.amplitude_m / gross_m * unit.gross_slip_amplitude_m)
        return np.asarray(np.log(loss_factor / self.joint_loss_factor))


def not_resolved(count: int, of: int, from_m: float) -> str:
    """Say how many points lie below the amplitude from which the slip of a map is resolved."""
    return (
        f"{count} of {of} points lie below {readable(f'{from_m:.3g} m')}, where less slips than "
        "the pixels of the map resolve"
    )


def remarks_on(found: Identified) -> list[str]:
    """Return what the uncertainties do not hold, and whether the two can be told apart."""
    remarks = [
        "the uncertainties count the scatter of the points and the jumps of a map, not the errors "
        "of the model, of the two stiffnesses or of caps, whose fits are those of the result: "
        "where it had another preload, analyse at the one found and compare again"
    ]
    if found.unresolved:
        counts = found.unresolved, found.unresolved + found.points
        below = not_resolved(*counts, found.resolved_from_m)
        remarks.append(f"{below}: they were left out of the identification")
    if found.missed is not None:
        remarks.append(
            f"even so the model misses the points by a factor of {found.missed:.2g} (rms): nothing "
            "is identified; look at structure, material and units first"
        )
    elif not found.distinguishable:
        remarks.append(
            "the data cannot tell friction coefficient and preload apart (correlation "
            f"{found.correlation:.3f}, condition number {found.condition_number:.0f}); they fix "
            f"mu N0^{found.exponent:.2f} to {100 * found.exponent_log_std:.1f} %; give one of the "
            "two, or measure nearer to gross slip"
        )
    if found.missed is None and found.alike_N is not None:
        least, greatest = (readable(f"{one:.3g} N") for one in found.alike_N)
        remarks.append(
            f"other preloads from {least} to {greatest} fit the points as well, within "
            f"{ALIKE:g} standard uncertainties of them: contacts touch or part between them; the "
            "uncertainties hold these; give one of the two, or measure more amplitudes"
        )
    if found.at_bound is not None:
        remarks.append(
            f"the identification ended at a bound ({found.at_bound}): its uncertainties do not hold"
        )
    return remarks


def _starts(
    amplitude_m: np.ndarray, joint_loss_factor: np.ndarray, model: JointModel, preload_N: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where to begin, (ln v_gross / v_greatest, ln N0), all ln N0 tried, and the bounds.

    Families make the misfit a narrow valley with others beside it, so the whole range is looked
    over first, on coarse curves: the lowest places along the preload, three at most, and the one
    given. The range is that about its middle in which the caps carry every preload that is tried.
    """
    middle, reach = math.log(preload_N), math.log(PRELOAD_RANGE)
    logs = np.linspace(middle - reach, middle + reach, model.trials + 2)[1:-1]
    share = amplitude_m / amplitude_m[-1] * np.exp(-EXCESS[:, None])  # of v_gross
    least, best = np.full(logs.size, np.inf), np.full(logs.size, EXCESS[0])
    waiting = Waiting("identification", "preloads")
    for i, log_N0 in enumerate(logs):
        try:
            unit = model.unit_curve(math.exp(log_N0), points=100)
        except ContactError:  # more than the caps can carry, or they find no level
            if log_N0 > middle:
                break
            least[:i] = np.inf
            continue
        misfit = np.log(unit(share * unit.gross_slip_amplitude_m) / joint_loss_factor)
        squares = (misfit**2).sum(axis=1)
        least[i], best[i] = squares.min(), EXCESS[squares.argmin()]
        waiting.tell(i + 1, logs.size)
    carried = np.append(logs[np.isfinite(least)], middle)
    padded = np.concatenate(([np.inf], least, [np.inf]))
    low = np.flatnonzero(np.isfinite(least) & (least <= padded[:-2]) & (least <= padded[2:]))
    # A valley about the preload that was given may be narrower than any step: it is looked at, too
    given = np.isfinite(least) & (np.abs(logs - middle) < STEP)
    low = np.union1d(low[np.argsort(least[low])][:3], np.flatnonzero(given))
    ends = [middle - reach, middle + reach]
    if np.isinf(least[0]):
        ends[0] = carried.min()
    if np.isinf(least[-1]):
        ends[1] = carried.max()
    bounds = np.array([[0.0, ends[0]], [GREATEST_EXCESS, ends[1]]])
    # a search starts inside
    inside = np.clip(logs[low], ends[0] + STEP, ends[1] - STEP)
    return np.column_stack([best[low], inside]), logs[np.isfinite(least)], bounds


def _bound(x: np.ndarray, bounds: np.ndarray) -> str | None:
    if x[0] - bounds[0, 0] < 1e-6:
        return "gross slip at the greatest amplitude measured"
    if x[0] > bounds[1, 0] - 1e-6:
        return "gross slip far above every amplitude measured"
    if x[1] - bounds[0, 1] < 1e-6 or x[1] > bounds[1, 1] - 1e-6:
        return f"a preload {PRELOAD_RANGE:g} times off the one given, or the end of those carried"
    return None
