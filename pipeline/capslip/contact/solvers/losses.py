"""The loss of a cycle between the loads at which an unloading face was solved, in two ways."""

from dataclasses import dataclass

import numpy as np

from capslip.contact.solvers.hertz import load_drop_of_asperity, loss_of_asperity

_POINTS = 60  # of the table in an interval
_TABLE = 2000  # points of that of the regions
_ROWS = 50  # of it at once
_FAR = 1e-5  # first withdrawal of the table, as a share of the last
# What the loss may be off over the difference between two ways to interpolate it: with that, none
# of 24 faces of waves at five loads was off by more than said. Up to this share of the load, there
_APART, _MOST_SLIP, _LOOKS = 2.0, 0.95, 60
_SMALL = 0.1  # of the load, below which a solved one may be left out
RIGID = 1e-9  # of the compliance before any slip: less is rounding


@dataclass(frozen=True, eq=False)
class Losses:
    """Withdrawal x and loss L against the load drop s, made by `losses`.

    L = 4 s x - 8 integral of x ds, so that over the secant compliance c = x / s it has the slope
    dL/dc = 4 s^2: known wherever L is, and where L is known between, so is s. With c_0 before any
    slip, log L is a cubic in z = log(c - c_0) through the values and the slopes
    4 s^2 (c - c_0) / L. A power is met exactly, as that of 3 with which slip begins.
    """

    compliance_m_per_N: float  # c_0
    log_more: np.ndarray  # z, shape (n,), growing
    log_loss: np.ndarray  # (n,)
    slope: np.ndarray  # (n,)
    end: tuple[float, float]  # s and x where nothing touches any more

    def table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return withdrawals, load drops and losses, shape (m,), growing up to the end.

        Below the first point the slope goes to 3 on the way to a tenth of its z and stays.
        """
        end_N, end_m = self.end
        if len(self.slope) < 2:  # all lets go at once, and nothing slips before
            s_N = end_N * np.geomspace(_FAR, 1.0, _POINTS)
            return self.compliance_m_per_N * s_N, s_N, np.full(_POINTS, 1e-300)
        first, second = self.slope[0], np.log(10.0)
        z = np.append(self.log_more[0] - second, self.log_more)
        log_loss = np.append(self.log_loss[0] - 0.5 * (first + 3.0) * second, self.log_loss)
        slope = np.append(3.0, self.slope)
        rows = [_cubic(z, log_loss, slope, k) for k in range(len(slope) - 1)]
        at, value, rate = (np.concatenate(part) for part in zip(*rows, strict=True))
        # No cubic may rise above the point it leads to, which would then be lost, nor fall; where
        # nearly all lets go at once it begins with losses that are no numbers any more.
        with np.errstate(over="ignore", invalid="ignore"):
            more, loss_J = np.exp(at), np.exp(value)
            s_N = 0.5 * np.sqrt(np.maximum(rate, 0.0) * np.exp(value - at))
            x_m = (self.compliance_m_per_N + more) * s_N
        most_N = 0.5 * np.sqrt(slope[1:] * np.exp(log_loss[1:] - z[1:]))
        most_m = (self.compliance_m_per_N + np.exp(z[1:])) * most_N
        below = (s_N < np.repeat(most_N, _POINTS)) & (x_m < np.repeat(most_m, _POINTS))
        below &= (s_N > 0.0) & (loss_J > np.finfo(float).tiny)
        s_N, x_m, loss_J, more = (column[below] for column in (s_N, x_m, loss_J, more))
        # Begins with slip that is all but none, L = a s^3
        far = min(_FAR * end_m / x_m[0], 1.0)  # the rows may begin farther down already
        begin = np.geomspace(far, 1.0, _POINTS, endpoint=False)
        rest = more[0] * begin
        s_N = np.concatenate((s_N[0] * begin, s_N, [end_N]))
        x_m = np.concatenate((s_N[:_POINTS] * (self.compliance_m_per_N + rest), x_m, [end_m]))
        loss_J = np.concatenate((loss_J[0] * begin**3, loss_J, np.exp(self.log_loss[-1:])))
        grows = (np.diff(np.maximum.accumulate(x_m), prepend=-1.0) > 0) & (
            np.diff(np.maximum.accumulate(s_N), prepend=-1.0) > 0
        )
        return x_m[grows], s_N[grows], loss_J[grows]

    def offs(self) -> np.ndarray:
        """Return by how much the loss at each inner point is off without it, shape (n - 2,)."""
        return np.array([self._off(k) for k in range(1, len(self.slope) - 1)])

    def _off(self, k: int) -> float:
        """Return that of one point, relative."""
        keep = np.array((k - 1, k + 1))
        z, log_loss, slope = self.log_more[keep], self.log_loss[keep], self.slope[keep]
        at, value, rate = _cubic(z, log_loss, slope, 0)
        log_s = np.maximum.accumulate(np.log(np.maximum(rate, 1e-300)) + value - at)
        here = np.log(self.slope[k]) + self.log_loss[k] - self.log_more[k]
        return float(abs(np.expm1(np.interp(here, log_s, value) - self.log_loss[k])))


def losses(
    stiffness_N_per_m: float, load_drop_N: np.ndarray, withdrawal_m: np.ndarray, loss_J: np.ndarray
) -> tuple[Losses, np.ndarray]:
    """Return the losses between solved loads, and which of these carry it, shape (n,).

    Parameters
    ----------
    stiffness_N_per_m : float
        At the preload, before any slip.
    load_drop_N, withdrawal_m, loss_J : ndarray, shape (n,)
        Of the solved loads, growing; at the last nothing touches any more. Those at which nothing
        has slipped yet, so that their compliance is that before any slip but for rounding, are left
        out, and so are the first where less slips than the compliance is known to.

    Examples
    --------
    One Hertz contact of unit load and compression, at five loads:

    >>> from capslip.contact.solvers.hertz import load_drop_of_asperity, loss_of_asperity
    >>> one, x = np.ones(()), np.array([0.05, 0.2, 0.5, 0.8, 1.0])
    >>> hertz = load_drop_of_asperity(one, one, x), x, loss_of_asperity(one, one, x)
    >>> x, s, L = losses(1.5, *hertz)[0].table()
    >>> bool(np.abs(L / loss_of_asperity(one, one, x) - 1).max() < 1e-2)
    True
    """
    c_0 = 1 / stiffness_N_per_m
    more = withdrawal_m / load_drop_N - c_0
    least = np.minimum.accumulate(np.append(more[1:], np.inf)[::-1])[::-1]
    grows = (more > RIGID * c_0) & (more < least) & (loss_J > 0)
    s, more, loss = load_drop_N[grows], more[grows], loss_J[grows]
    slope = 4 * s**2 * more / loss
    while len(s) > 2 and s[0] < _SMALL * load_drop_N[-1] and _overshoots(more, loss, slope):
        grows[np.argmax(grows)] = False
        s, more, loss, slope = s[1:], more[1:], loss[1:], slope[1:]
    end = float(load_drop_N[-1]), float(withdrawal_m[-1])
    return Losses(c_0, np.log(more), np.log(loss), slope, end), grows


def _overshoots(more: np.ndarray, loss_J: np.ndarray, slope: np.ndarray) -> bool:
    """Tell whether the first cubic rises beyond its end: no slope of it may be three secants."""
    return bool(slope[0] * np.log(more[1] / more[0]) > 3.0 * np.log(loss_J[1] / loss_J[0]))


@dataclass(frozen=True, eq=False)
class RegionLosses:
    """Every contact region as a Hertz contact between the solved loads.

    Its withdrawal t_i, as a share of its compression, and its loss per load follow from its own
    N_i and L_i and are interpolated over the withdrawal of the face: a region that lifts off puts a
    kink into N(d), and that comes into the right place. Where regions are of a few pixels or change
    their shape, they are no Hertz contacts, and `Losses` is better.
    """

    load_N: np.ndarray  # of the regions at the preload, shape (n,)
    withdrawal_m: np.ndarray  # of the face, shape (m,), growing to the end
    rate_per_m: np.ndarray  # t / x, shape (m + 1, n), the first before any slip
    length_m: np.ndarray  # of each region, (m, n): its loss over that of unit load and length
    load_drop_N: np.ndarray  # of the face, (m,)
    loss_J: np.ndarray  # (m,)

    def table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return withdrawals, load drops and losses, as `Losses.table`."""
        from scipy.interpolate import PchipInterpolator

        x = self.withdrawal_m[-1] * np.geomspace(_FAR, 1.0, _TABLE)
        of_regions = PchipInterpolator(*self._of_regions())
        parts = [
            self._sums(rows, of_regions(rows)) for rows in np.split(x, range(_ROWS, _TABLE, _ROWS))
        ]
        drop_N, loss_J = np.concatenate(parts, axis=1)
        return x, drop_N, loss_J

    def offs(self) -> np.ndarray:
        """Return by how much the loss at each inner point is off without it, shape (m - 2,).

        At its load drop, relative.
        """
        inner = np.s_[1:-1]
        found = self._sums(self.withdrawal_m[inner], left_out(*self._of_regions()))
        drop, loss = found / (self.load_drop_N[inner], self.loss_J[inner])
        return np.abs(loss / drop**3 - 1)

    def _of_regions(self) -> tuple[np.ndarray, np.ndarray]:
        """Return withdrawals from zero on, (m + 1,), and what is interpolated, (m + 1, 2, n)."""
        length_m = np.concatenate((self.length_m[:1], self.length_m))
        return np.append(0.0, self.withdrawal_m), np.stack((self.rate_per_m, length_m), axis=1)

    def _sums(self, withdrawal_m: np.ndarray, of_regions: np.ndarray) -> np.ndarray:
        """Return load drops and losses of the face from rates and lengths, shape (2, m)."""
        one, t = np.ones(()), withdrawal_m[:, None] * of_regions[:, 0]
        drop_N = load_drop_of_asperity(self.load_N, one, t).sum(axis=-1)
        loss_J = (of_regions[:, 1] * loss_of_asperity(self.load_N, one, t)).sum(axis=-1)
        return np.array((drop_N, loss_J))


def rates_per_m(withdrawal_m: np.ndarray, share: np.ndarray, gap_m: np.ndarray) -> np.ndarray:
    """Return t / x of contact regions, shape (m, n).

    t = 1 - (N_i1 / N_i)^(2/3) in contact; afterwards x over that at which the gap opened. A region
    of one pixel, or of even pressure, opens everywhere at once.

    Parameters
    ----------
    withdrawal_m : ndarray, shape (m,)
        Of the face.
    share : ndarray, shape (m, n)
        Loads of the regions over those at the preload.
    gap_m : ndarray, shape (m, n)
        Their least gaps.
    """
    x, lifted = withdrawal_m[:, None], share <= 0
    t = -np.expm1(2 / 3 * np.log(np.where(lifted, 1.0, np.minimum(share, 1.0))))
    return np.asarray(np.where(lifted, 1 / np.maximum(x - gap_m, 1e-6 * x), t / x))


def region_losses(
    load_N: np.ndarray,
    slope_per_m: np.ndarray,
    withdrawal_m: np.ndarray,
    rate_per_m: np.ndarray,
    loss_J: np.ndarray,
) -> RegionLosses:
    """Return the losses between solved loads from those of the contact regions.

    Parameters
    ----------
    load_N, slope_per_m : ndarray, shape (n,)
        At the preload; t / x before any slip.
    withdrawal_m : ndarray, shape (m,)
        Of the face at the solved loads, growing; at the last nothing touches any more.
    rate_per_m, loss_J : ndarray, shape (m, n)
        From `rates_per_m`; losses of the regions.
    """
    one, t = np.ones(()), withdrawal_m[:, None] * rate_per_m
    unit = loss_of_asperity(one, one, t)
    length_m = loss_J / load_N / np.where(unit > 0, unit, 1.0)
    return RegionLosses(
        *(load_N, withdrawal_m, np.concatenate((slope_per_m[None], rate_per_m)), length_m),
        load_drop_of_asperity(load_N, one, t).sum(axis=1),
        loss_J.sum(axis=1),
    )


def apart(
    one: tuple[np.ndarray, np.ndarray, np.ndarray],
    other: tuple[np.ndarray, np.ndarray, np.ndarray],
    least_N: float,
) -> float:
    """Return what the loss may be off where two ways to interpolate it differ, relative.

    Parameters
    ----------
    one, other : (ndarray, ndarray, ndarray)
        Withdrawals, load drops and losses, from `Losses.table` or `RegionLosses.table`.
    least_N : float
        Load drop from which on they are compared.
    """
    log_N = np.log(np.geomspace(least_N, _MOST_SLIP * one[1][-1], _LOOKS))
    log_J = [np.interp(log_N, np.log(drop_N), np.log(J)) for _, drop_N, J in (one, other)]
    return _APART * float(np.abs(np.expm1(log_J[0] - log_J[1])).max())


def left_out(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return rows at inner places, each as a monotone cubic through all the others has it.

    Of the others only the two neighbours on either side count.

    Parameters
    ----------
    x : ndarray, shape (m,)
        Growing.
    y : ndarray, shape (m, ...)
        Rows.

    Returns
    -------
    ndarray, shape (m - 3, ...)
        At all places but the first two and the last.

    Examples
    --------
    >>> left_out(np.arange(6.0), 3.0 * np.arange(6.0))
    array([ 6.,  9., 12.])
    """
    k = np.arange(2, len(x) - 1)
    columns = (-1, *(1,) * (y.ndim - 1))  # of lengths beside rows
    low, high = x[k - 1], x[k + 1]
    before_m, width_m = (each.reshape(columns) for each in (low - x[k - 2], high - low))
    before, chord = (y[k - 1] - y[k - 2]) / before_m, (y[k + 1] - y[k - 1]) / width_m
    slope_low = _slope_between(before_m, width_m, before, chord)
    slope_high = _slope_at_end(width_m, before_m, chord, before)
    after_m = (x[4:] - x[3:-1]).reshape(columns)  # beyond all but the last of them
    after = (y[4:] - y[3:-1]) / after_m
    slope_high[:-1] = _slope_between(width_m[:-1], after_m, chord[:-1], after)
    t = ((x[k] - low) / (high - low)).reshape(columns)
    rise = (3.0 - 2.0 * t) * t * chord + (1.0 - t) * ((1.0 - t) * slope_low - t * slope_high)
    return np.asarray(y[k - 1] + t * width_m * rise)


def _slope_between(
    width_m: np.ndarray, next_m: np.ndarray, slope: np.ndarray, next_slope: np.ndarray
) -> np.ndarray:
    """Return the slope of a monotone cubic between two intervals, from their widths and chords.

    Their harmonic mean, weighted; zero where they differ in sign (Fritsch and Butland, SIAM J. Sci.
    Stat. Comput. 5 (1984) 300).
    """
    same = slope * next_slope > 0.0
    one, other = (np.where(same, each, 1.0) for each in (slope, next_slope))
    weight, next_weight = width_m + 2.0 * next_m, 2.0 * width_m + next_m
    mean = (weight + next_weight) / (weight / one + next_weight / other)
    return np.where(same, mean, 0.0)


def _slope_at_end(
    width_m: np.ndarray, next_m: np.ndarray, slope: np.ndarray, next_slope: np.ndarray
) -> np.ndarray:
    """Return that at the end of an interval, of the parabola through it and the next one.

    Zero where that falls against the chord, and no more than three chords where it bends back.
    """
    end = ((2.0 * width_m + next_m) * slope - width_m * next_slope) / (width_m + next_m)
    end = np.where(end * slope > 0.0, end, 0.0)
    bent = (slope * next_slope <= 0.0) & (np.abs(end) > 3.0 * np.abs(slope))
    return np.where(bent, 3.0 * slope, end)


def _cubic(
    z: np.ndarray, value: np.ndarray, slope: np.ndarray, k: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places, values and slopes from point k to before the next one."""
    t = np.arange(_POINTS) / _POINTS
    h = z[k + 1] - z[k]
    rise = value[k + 1] - value[k]
    bend = 3 * rise - h * (2 * slope[k] + slope[k + 1])
    twist = h * (slope[k] + slope[k + 1]) - 2 * rise
    values = value[k] + t * (h * slope[k] + t * (bend + t * twist))
    return z[k] + t * h, values, slope[k] + t * (2 * bend + 3 * t * twist) / h
