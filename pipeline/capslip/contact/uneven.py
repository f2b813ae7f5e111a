"""A joint that is pressed unevenly: patches of one scan, each under its own load, side by side."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.curve import NormalCurve, withdrawal_to_lift_m
from capslip.contact.scaled import ScaledCurve
from capslip.errors import ContactError

LEAST_SHARE = 1e-5  # of the withdrawal at total slip that the table of uneven patches resolves
LIGHT = 0.05  # of the greatest load: what is lighter counts as much where loads are chosen
MOST_FOR = 50.0  # times what it bears, at most, that a light one counts there
SEEN_AT = 0.25  # of the load of a patch that is gone, where a curve under another load is scaled
MAX_STEPS = 60  # of a search: for a withdrawal bisection alone needs no more
CONVERGED = 1e-14  # of the withdrawal, or of an approach
OF_A_SPHERE = np.array([2.0, 2.0, 5.0]) / 3.0  # powers of the load in what `seen` returns


def side_by_side(
    curves: Sequence[NormalCurve], load_N: np.ndarray, weight: np.ndarray
) -> "PatchedCurve":
    """Return the normal curve of patches, each with its own curve and under its own load.

    Parameters
    ----------
    curves : sequence of NormalCurve, k
        Of a scan in each patch.
    load_N : ndarray, shape (k,)
        Loads > 0 of the scan in each patch.
    weight : ndarray, shape (k,)
        How many scans make the patch, any number > 0.
    """
    # One by one, so that a curve that solves its loads interpolates none
    pairs = zip(curves, load_N, strict=True)
    approach_m = np.array([float(curve.approach_m(N)) for curve, N in pairs])
    return PatchedCurve(tuple(curves), approach_m, weight)


def seen(curve: NormalCurve, load_N: float) -> tuple[float, float, float]:
    """Return approach from first touch, withdrawal and loss where a quarter of a load is gone.

    Raises
    ------
    ContactError
        If the curve does not know what happens below the load: a map may have too few pixels.
    """
    d, drop_N = float(curve.approach_m(load_N)), SEEN_AT * load_N
    loss_J = float(curve.loss_integral_at_drop_J(d, drop_N))
    return d - float(curve.touch_m), float(curve.withdrawal_m(d, drop_N)), loss_J


def standing_for(load_N: np.ndarray, weight: np.ndarray, count: int) -> np.ndarray:
    """Return few loads that stand for many: where most of the preload is, and the greatest.

    Each stands for those that are nearest by ratio. The sum of the squares of these logarithms,
    times what each bears, is made small: a load is added where it takes the most off it, and all
    are then moved to the middle of those that they stand for. Light ones count for more than they
    bear, as they slip first: they decide what is lost at small forces. The lightest, of which there
    may be decades, count for next to nothing all the same: their contacts have hardly any pixels.

    Parameters
    ----------
    load_N : ndarray, shape (k,)
        Loads > 0, k > count.
    weight : ndarray, shape (k,)
        How many scans are under each.
    count : int
        How many to choose.

    Returns
    -------
    ndarray, shape (count,)
        Growing.

    Examples
    --------
    >>> standing_for(np.array([1.0, 1.1, 1.2, 50.0, 90.0, 99.0, 100.0]), np.ones(7), 3)
    array([  1.1,  50. , 100. ])
    """
    x, counts = np.log(load_N), np.maximum(load_N, LIGHT * load_N.max())
    counts = np.minimum(counts, MOST_FOR * load_N) * weight
    apart = np.square(x[:, None] - x)
    chosen = [int(load_N.argmax())]
    while len(chosen) < count:
        nearest = apart[:, chosen].min(axis=1)
        chosen.append(int(np.argmin(counts @ np.minimum(apart, nearest[:, None]))))
    for _ in range(MAX_STEPS):
        mine, before = apart[:, chosen].argmin(axis=1), list(chosen)
        for i in range(1, count):
            of_mine = (counts * (mine == i)) @ apart
            chosen[i] = int(np.argmin(np.where(mine == i, of_mine, np.inf)))
        if chosen == before:
            break
    return np.sort(load_N[chosen])


def scaled_between(
    curves: Sequence[NormalCurve], at_N: np.ndarray, load_N: np.ndarray
) -> list[NormalCurve]:
    """Return curves under any loads, each that of the nearest known load by factors.

    Approach, withdrawal and loss, the latter two where a quarter of a load is gone, are monotone
    cubics of the load between the known ones, in logarithms. Below the least of them they follow
    the power that fits all best, or that of a sphere where one alone is known.

    Parameters
    ----------
    curves : sequence of NormalCurve, k
        Each of them good at and below its load.
    at_N : ndarray, shape (k,)
        These loads > 0, growing.
    load_N : ndarray, shape (n,)
        Loads > 0, the greatest of them at most that of `at_N`.

    Examples
    --------
    A sphere under any load is a sphere.

    >>> from capslip.contact.models.families import families
    >>> one = families((1, 0), (23.8, 26.7), (0.0, 0.0), 109.89e9)
    >>> (other,) = scaled_between([one, one], np.array([1.0, 64.0]), np.array([8.0]))
    >>> ratio = other.loss_integral_J(other.approach_m(8.0), 1e-8)
    >>> f"{ratio / one.loss_integral_J(one.approach_m(8.0), 1e-8):.9f}"
    '1.000000000'
    """
    x, at = np.log(at_N), np.log(load_N)
    known = np.log([seen(curve, N) for curve, N in zip(curves, at_N.tolist(), strict=True)])
    nearest = np.abs(at[:, None] - x).argmin(axis=1)
    factors = np.exp(_between(x, known, at) - known[nearest])
    return [
        ScaledCurve(curves[i], float(N / at_N[i]), *each)
        for i, N, each in zip(nearest, load_N, factors.tolist(), strict=True)
    ]


def _between(x: np.ndarray, known: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return columns between growing places, and below the first by a straight line, (n, 3)."""
    from scipy.interpolate import PchipInterpolator

    slope = OF_A_SPHERE
    if len(x) > 1:
        from_mean = x - x.mean()
        slope = from_mean @ known / (from_mean @ from_mean)
    within = np.clip(at, x[0], x[-1])
    inside = PchipInterpolator(x, known)(within) if len(x) > 1 else known
    return np.asarray(inside + (at - within)[:, None] * slope)


@dataclass(frozen=True, eq=False)
class PatchedCurve:
    """Patches that are pressed unevenly and move together: N(D) = sum_k w_k N_k(d_k - (D_0 - D)).

    A patch that carries less lies lower, so this is a normal curve as any other: the approach D
    counts as that of the patch that is pressed deepest, and is D_0 under the preload. Under
    shear all patches share one withdrawal e, and T = mu sum_k w_k [N_k(d_k) - N_k(d_k - e)], which
    is what the theorem gives for each patch under the common displacement mu kappa e.

    What happens below the preload is summed once, at some withdrawals, and interpolated in between
    (to 5e-4, where a contact lets go): so withdrawals from any other approach than D_0 are refused.

    Made by `side_by_side`.
    """

    curves: tuple[NormalCurve, ...]  # (k,)
    patch_approach_m: np.ndarray  # (k,), under the preload
    weight: np.ndarray  # (k,)
    compliance_m_per_N: float = 0.0  # none in series with the whole

    @property
    def model(self) -> str:
        """Name of the model, of each where they differ."""
        return ", ".join(dict.fromkeys(curve.model for curve in self.curves))

    @property
    def preload_approach_m(self) -> float:
        """D_0, that of the patch that is pressed deepest."""
        return float(self.patch_approach_m[self._deepest])

    @property
    def touch_m(self) -> np.ndarray:
        """Approach of first touch."""
        return np.asarray(self.curves[self._deepest].touch_m)

    def load_N(self, approach_m: ArrayLike) -> np.ndarray:
        """N(D)."""
        below_m = self.preload_approach_m - np.asarray(approach_m, dtype=float)
        return np.asarray(sum(w * one.load_N(d - below_m) for one, d, w in self._patches))

    def approach_m(self, load_N: ArrayLike) -> np.ndarray:
        """D(N) of loads up to the preload.

        Raises
        ------
        ContactError
            If a load exceeds it.
        """
        # What a map lets go until it lifts off is its load to one in a hundred thousand alone
        preload_N = float(self.load_N(self.preload_approach_m))
        drop_N = preload_N - np.asarray(load_N, dtype=float)
        if (drop_N < -1e-9 * preload_N).any():
            raise ContactError(
                f"{self.model}: got a load of {np.max(load_N):g} N on a joint of unevenly pressed "
                f"patches; expected at most its preload, {preload_N:g} N"
            )
        drop_N = np.where(drop_N < 1e-9 * preload_N, 0.0, drop_N)
        return np.asarray(self.preload_approach_m - self._withdrawal_m(drop_N))

    def stiffness_N_per_m(self, approach_m: ArrayLike, withdrawal_m: ArrayLike = 0.0) -> np.ndarray:
        """N'(D - e)."""
        return self._sum("stiffness_N_per_m", approach_m, withdrawal_m)

    def load_drop_N(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """N(D) - N(D - e)."""
        self._check(approach_m)
        return self._at(withdrawal_m, 1, power=1)

    def withdrawal_m(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Withdrawal for a load drop of at most N(D)."""
        self._check(approach_m)
        return self._withdrawal_m(np.asarray(load_drop_N, dtype=float))

    def loss_integral_J(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """4 * integral of s (e - s) N''(D - s)."""
        self._check(approach_m)
        known_m, known_N, _ = self._below
        beyond_m = np.maximum(np.asarray(withdrawal_m, dtype=float) - known_m[-1], 0.0)
        return self._at(withdrawal_m, 2, power=3) + 4.0 * known_N[-1] * beyond_m

    def loss_integral_at_drop_J(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Return the same at given load drop."""
        return self.loss_integral_J(approach_m, self.withdrawal_m(approach_m, load_drop_N))

    def lift_off_m(self, approach_m: ArrayLike) -> np.ndarray:
        """Withdrawal at which each row of the scan loses its load, patch by patch."""
        self._check(approach_m)
        rows = [one.lift_off_m(d) for one, d, _ in self._patches]
        return np.concatenate(rows, axis=-1)

    def lifted(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Whether each row of the scan had a load and has lost it, patch by patch."""
        self._check(approach_m)
        rows = [one.lifted(d, withdrawal_m) for one, d, _ in self._patches]
        return np.concatenate(rows, axis=-1)

    @property
    def _patches(self) -> Iterator[tuple[NormalCurve, float, float]]:
        """Yield curve, approach under the preload, and weight of each patch."""
        return zip(self.curves, self.patch_approach_m, self.weight, strict=True)

    @cached_property
    def _deepest(self) -> int:
        """Return the patch that is the last to lose its load."""
        touch_m = [float(curve.touch_m) for curve in self.curves]
        return int(np.argmax(self.patch_approach_m - touch_m))

    @cached_property
    def _below(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return withdrawals from the preload, with their load drops and loss integrals."""
        share = np.geomspace(LEAST_SHARE, 0.5, 140)
        share = np.concatenate([share, 1.0 - np.geomspace(0.49, 1e-6, 60), [1.0]])
        to_lift_m = [withdrawal_to_lift_m(one, d, one.load_N(d)) for one, d, _ in self._patches]
        e = share * float(max(to_lift_m))
        drop_N, loss_J = np.zeros(e.shape), np.zeros(e.shape)
        for one, d, w in self._patches:  # both of one patch share what its curve solves
            drop_N += w * one.load_drop_N(d, e)
            loss_J += w * one.loss_integral_J(d, e)
        return e, drop_N, loss_J

    @cached_property
    def _ratios(self) -> Any:
        """Return load drop over e and loss over e^3, as a smooth function of log e."""
        from scipy.interpolate import PchipInterpolator

        e, drop_N, loss_J = self._below
        return PchipInterpolator(np.log(e), np.stack([e, drop_N / e, loss_J / e**3], axis=1))

    def _at(self, withdrawal_m: ArrayLike, column: int, power: int) -> np.ndarray:
        """Return a column of the table at any withdrawal up to the last, or at that."""
        known_m = self._below[0]
        e = np.minimum(np.asarray(withdrawal_m, dtype=float), known_m[-1])
        ratio = self._ratios(np.log(np.maximum(e, known_m[0])))[..., column]
        return np.asarray(ratio * e**power)

    def _withdrawal_m(self, drop_N: np.ndarray) -> np.ndarray:
        """Return the inverse of the load drop: Newton's steps, halved where they leave a bracket.

        Nothing is lost to the drop being flat where the last contact lets go: the bracket closes.
        """
        known_m, known_N = (np.concatenate([[0.0], one]) for one in self._below[:2])
        last = np.clip(np.searchsorted(known_N, drop_N), 1, len(known_m) - 1)
        low, high = known_m[last - 1], known_m[last]
        between_N = np.maximum(known_N[last] - known_N[last - 1], np.finfo(float).tiny)
        e = low + (high - low) * np.minimum((drop_N - known_N[last - 1]) / between_N, 1.0)
        for _ in range(MAX_STEPS):
            missing_N = drop_N - self.load_drop_N(self.preload_approach_m, e)
            low, high = np.where(missing_N >= 0.0, e, low), np.where(missing_N <= 0.0, e, high)
            with np.errstate(divide="ignore", invalid="ignore"):
                newton = e + missing_N / self._slope_N_per_m(e)
            inside = (newton >= low) & (newton <= high)
            better = np.where(inside, newton, 0.5 * (low + high))
            if (np.abs(better - e) <= CONVERGED * known_m[-1]).all():
                return np.asarray(better)
            e = better
        return np.asarray(e)

    def _slope_N_per_m(self, withdrawal_m: np.ndarray) -> np.ndarray:
        """Return how the load drop of the table grows: its ratio to e is a function of log e."""
        known_m = self._below[0]
        at = np.log(np.clip(withdrawal_m, known_m[0], known_m[-1]))
        grows = self._ratios(at, 1)[..., 1] * (withdrawal_m >= known_m[0])
        return np.asarray(self._ratios(at)[..., 1] + grows)

    def _sum(self, method: str, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Sum a method of the patches' curves under the preload."""
        self._check(approach_m)
        return np.asarray(
            sum(w * getattr(one, method)(d, withdrawal_m) for one, d, w in self._patches)
        )

    def _check(self, approach_m: ArrayLike) -> None:
        D = self.preload_approach_m
        if np.any(np.abs(np.asarray(approach_m) - D) > CONVERGED * abs(D)):  # or rounded by factors
            raise ContactError(
                f"{self.model}: unevenly pressed patches are withdrawn from their preload alone; "
                f"got an approach of {np.max(approach_m):g} m; expected "
                f"{D:g} m"
            )
