"""How the tangential compliance depends on the direction of slip: long contacts, and rows of them.

A force in x on the surface moves it by 1 / (pi E* r) [1 + 2 (kappa - 1) x^2 / r^2] in x (Cerruti;
Johnson 1987, Eq. 3.75), and x^2 / r^2 = (1 + cos 2 theta) / 2. The mean over all directions is what
kappa stands for. What is left, cos 2 (theta - phi) for a force at phi, is one complex number of the
whole contact, its deviator: the mean of exp(2 i theta) / (pi E* r) over all pairs of tractions.
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from capslip.contact.solvers.half_space import padded_shape

_TURNS = 3  # of the search for an axis ratio: from 3 % off each squares the error
_MEANS = 8  # steps of the arithmetic-geometric mean: axis ratios down to 1e-9
_MOST_PAIRED = 4000  # contacts whose pairs are summed; beyond, rows of them are left out
_ROWS = 500  # of pairs at once
_SOLVED = 1e-4  # residual of the shares of the contacts, whose error counts squared
_LEAST_SLIP = 1e-6  # of the energy of a punch, below which partial slip adds none of its own
LATER = 0.5  # of the preload, to which it goes down for the energy of partial slip


@dataclass(frozen=True)
class Lay:
    """Ratio of tangential to normal compliance over the direction of slip.

    What is long in range and linear in the force counts in the compliance before any slip, and not
    in the energy at a given force; so each has a deviator of its own, as shares of what it is at
    `round_kappa`. The slip curve has one kappa, that of the compliance.
    """

    round_kappa: float  # of round contacts that lie in no rows: the mean over all directions
    deviator: complex  # of the compliance before any slip
    energy_deviator: complex  # of the energy at half of the force at total slip

    def kappa(self, direction_rad: float | None) -> float:
        """Return kappa of slip in a direction, from x towards y; the mean where there is none.

        Examples
        --------
        >>> lay = Lay(1.2, 0.5 + 0.0j, 0.4 + 0.0j)
        >>> lay.kappa(None), round(lay.kappa(0.0), 12), round(lay.kappa(math.pi / 2), 12)
        (1.2, 1.3, 1.1)
        """
        return self._kappa(self.deviator, direction_rad)

    @property
    def kappa_range(self) -> tuple[float, float]:
        """The least and the greatest kappa of all directions."""
        swing = self.round_kappa * self.swing
        return self.round_kappa - swing, self.round_kappa + swing

    @property
    def swing(self) -> float:
        """Greatest relative change of kappa by the direction, either way."""
        return abs((1.0 - 1.0 / self.round_kappa) * self.deviator)

    def left_open(self, direction_rad: float | None) -> tuple[complex, complex]:
        """Return what `kappa` leaves open: relative swings of displacement and energy at a force.

        Where no direction is given, over twice its angle; else that the energy has a kappa of its
        own.
        """
        if direction_rad is None:
            scale = 1.0 - 1.0 / self.round_kappa
            return scale * self.deviator, scale * self.energy_deviator
        own = self._kappa(self.energy_deviator, direction_rad)
        return 0j, complex(own / self.kappa(direction_rad) - 1.0)

    @property
    def softest_rad(self) -> float:
        """Direction of the greatest kappa, from x towards y, within a right angle of x."""
        return 0.5 * cmath.phase(self.deviator * (self.round_kappa - 1.0) + 0.0)

    def _kappa(self, deviator: complex, direction_rad: float | None) -> float:
        if direction_rad is None:
            return self.round_kappa
        along = (deviator * cmath.exp(-2j * direction_rad)).real
        return self.round_kappa + (self.round_kappa - 1.0) * along


@dataclass(frozen=True)
class Energies:
    """Twice the elastic energy of tractions of a unit force in sum, times E*, in 1/m."""

    mean: float  # over all directions, at kappa = 1
    deviator: complex  # what a direction adds, over kappa - 1

    def lay(self, later: "Energies", round_kappa: float, bulk: complex, unit_per_m: float) -> Lay:
        """Return the lay from the energies of a punch and of partial slip later.

        Parameters
        ----------
        later : Energies
            Of the tractions at a larger share of the force at total slip.
        round_kappa : float
            Of round contacts.
        bulk : complex
            Deviator of what was taken off the curve.
        unit_per_m : float
            E* times the compliance of the curve.
        """
        of_slip = later.mean - self.mean
        before = (self.deviator - bulk) / unit_per_m
        after = before
        if of_slip > _LEAST_SLIP * self.mean:
            after = (later.deviator - self.deviator) / of_slip
        return Lay(round_kappa, _bounded(before), _bounded(after))


def _bounded(deviator: complex) -> complex:
    """Return a deviator, at most 1 in size: that of a line, which is the longest contact."""
    return deviator / max(1.0, abs(deviator))


def deviator_of_ellipse(axis_ratio: np.ndarray) -> np.ndarray:
    """Return the deviator of an elliptic contact along its longer axis, over its compliance.

    2 (K - E) / (e^2 K) - 1 with the complete elliptic integrals K and E of e^2 = 1 - (b/a)^2
    (Mindlin 1949; Johnson 1987, Sec. 7.2), for any traction that is a function of x^2/a^2 + y^2/b^2
    alone: so before any slip and in partial slip alike. By the arithmetic-geometric mean, in which
    nothing cancels.

    Parameters
    ----------
    axis_ratio : float64, shape (n,)
        b / a, above 0 and at most 1.

    Examples
    --------
    >>> deviator_of_ellipse(np.array([1.0, 0.5, 0.1])).round(4)
    array([0.    , 0.1691, 0.4648])
    """
    mean, geometric = np.ones_like(axis_ratio), axis_ratio
    share = 0.25 * (1.0 - axis_ratio) / (1.0 + axis_ratio)  # c_1^2 / e^2, then c_n^2 / e^2
    total = np.zeros_like(axis_ratio)
    for n in range(1, _MEANS):
        total = total + 2.0**n * share
        off = 0.5 * (mean - geometric)
        mean, geometric = 0.5 * (mean + geometric), np.sqrt(mean * geometric)
        share = share * (0.5 * off / (mean + geometric)) ** 2
    return np.asarray(total)


def axis_ratio(radius_ratio: np.ndarray) -> np.ndarray:
    """Return b / a of the contact of a cap from the ratio of its principal radii.

    Hertz (Johnson 1987, Eq. 4.28): R2 / R1 = (b/a)^2 (1 + s) / (1 - s) with the deviator s of the
    ellipse, solved for the logarithm of b / a in turns that leave a quarter of the error, and by
    Steffensen's rule from each two of these.

    Parameters
    ----------
    radius_ratio : float64, shape (n,)
        R2 / R1 of the smaller to the larger radius, above 0 and at most 1.

    Examples
    --------
    >>> axis_ratio(np.array([1.0, 0.5, 0.1])).round(4)
    array([1.    , 0.6306, 0.2222])
    """
    goal = np.log(radius_ratio)

    def turn(log_ratio: np.ndarray) -> np.ndarray:
        s = deviator_of_ellipse(np.exp(log_ratio))
        return np.asarray(0.5 * (goal + np.log1p(-s) - np.log1p(s)))

    found = goal * (2.0 / 3.0)
    for _ in range(_TURNS):
        first = turn(found)
        second = turn(first)
        step, bend = first - found, second - 2.0 * first + found
        found = np.where(bend == 0.0, second, found - step**2 / np.where(bend == 0.0, 1.0, bend))
    return np.exp(np.minimum(found, 0.0))


def energies_of_contacts(
    width_m: np.ndarray,
    load_N: np.ndarray,
    later_N: np.ndarray | None,
    own: np.ndarray,
    places_m: np.ndarray | None,
    E_star_Pa: float,
) -> tuple[Energies, Energies]:
    """Return the energies of Hertz contacts that move together: as a punch, and in partial slip.

    Parameters
    ----------
    width_m, load_N : float64, shape (n,)
        Contact radii and loads, above 0; each contact has the compliance 1 / (2 E* a).
    later_N : float64, shape (n,), optional
        Loads of the same contacts under half of the load; without it all go down by the same.
    own : complex128, shape (n,)
        Deviators of the single contacts, over their compliance, turned by twice their angle.
    places_m : float64, shape (2, n), optional
        x and y; without them no contact moves another.
    E_star_Pa : float
        Composite modulus.
    """
    if not 1 < len(load_N) <= _MOST_PAIRED:
        places_m = None
    alone = 0.5 / width_m
    share = width_m / width_m.sum() if places_m is None else _shares(alone, places_m)
    compression_m = 0.75 * load_N / (E_star_Pa * width_m)
    if later_N is None:
        later_N = _later_N(compression_m, load_N)
    drop_N = load_N - later_N
    left_m = compression_m * np.cbrt(later_N / load_N) ** 2
    # 2 * integral of x dt over the load drop t of a Hertz contact
    twice_J = 2.0 * (compression_m * drop_N - 0.6 * (compression_m * load_N - left_m * later_N))
    total_N = float(drop_N.sum())
    return (
        _energies(share, share**2 * alone, own, places_m),
        _energies(drop_N / total_N, twice_J * (E_star_Pa / total_N**2), own, places_m),
    )


def _energies(
    share: np.ndarray, alone: np.ndarray, own: np.ndarray, places_m: np.ndarray | None
) -> Energies:
    """Return the energies of shares in a force: of each contact alone, and of their pairs."""
    mean, deviator = float(alone.sum()), complex(alone @ own)
    if places_m is None:
        return Energies(mean, deviator)
    for rows in _blocks(len(share)):
        apart, near_per_m = _apart(places_m, rows)
        mean += float(share[rows] @ near_per_m @ share) / math.pi
        deviator += complex(share[rows] @ (apart**2 * near_per_m**3) @ share) / math.pi
    return Energies(mean, deviator)


def _later_N(compression_m: np.ndarray, load_N: np.ndarray) -> np.ndarray:
    """Return the loads under half of the load of contacts that do not feel each other."""
    low, high = 0.0, float(compression_m.max())
    for _ in range(60):
        x = 0.5 * (low + high)
        left_N = load_N * np.maximum(1.0 - x / compression_m, 0.0) ** 1.5
        low, high = (x, high) if left_N.sum() > LATER * load_N.sum() else (low, x)
    return np.asarray(left_N)


def _shares(alone: np.ndarray, places_m: np.ndarray) -> np.ndarray:
    """Return the share of each contact in the force of a punch, by conjugate gradients."""
    n = len(alone)
    pairs = np.empty((n, n), dtype=np.float32)
    for rows in _blocks(n):
        pairs[rows] = _apart(places_m, rows)[1] / math.pi
    t, r = np.zeros(n), np.ones(n)
    direction, slope = np.zeros(n), 0.0
    for _ in range(n):
        z = r / alone  # what contacts that stand alone would take
        new = float(r @ z)
        if new <= _SOLVED**2 * float((1.0 / alone).sum()):
            break
        direction = z + (new / slope if slope else 0.0) * direction
        slope = new
        moved = alone * direction + pairs @ direction.astype(np.float32)
        work = float(direction @ moved)
        if work <= 0.0:  # contacts that overlap: no punch holds them apart
            break
        t = t + (slope / work) * direction
        r = r - (slope / work) * moved
    return t / t.sum()


def _apart(places_m: np.ndarray, rows: slice) -> tuple[np.ndarray, np.ndarray]:
    """Return x + i y from some contacts to all, and one over the distance; 0 at the same place."""
    at_m = places_m[0] + 1j * places_m[1]
    apart = at_m - at_m[rows, None]
    r_m = np.abs(apart)
    return apart, np.where(r_m > 0.0, 1.0 / np.where(r_m > 0.0, r_m, 1.0), 0.0)


def _blocks(n: int) -> list[slice]:
    return [slice(first, min(first + _ROWS, n)) for first in range(0, n, _ROWS)]


def energies_of_map(
    tractions: Sequence[np.ndarray], pixel_size_m: tuple[float, float]
) -> list[Energies]:
    """Return the energies of tractions on a map.

    sum of q_i K_ij q_j over (sum of q)^2 and the area of a pixel, with K the integrals of
    1 / (pi r) and exp(2 i theta) / (pi r) over a pixel, of which x asinh(y / |x|) +
    y asinh(x / |y|) and y asinh(x / |y|) - x asinh(y / |x|) - 2 i r are the primitives. All pairs
    at once by the autocorrelation of q.

    Parameters
    ----------
    tractions : sequence of float64, shape (ny, nx)
        Any unit; the first is nowhere zero where another one is not.
    pixel_size_m : (float, float)
        (dy, dx).

    Examples
    --------
    >>> strip = np.ones((1, 20))
    >>> found = [energies_of_map([q], (1.0, 1.0))[0] for q in (strip, strip.T, np.eye(9))]
    >>> [complex(round(q.deviator.real, 4), round(q.deviator.imag, 4)) for q in found]
    [(0.077+0j), (-0.077+0j), 0.0886j]
    """
    from scipy import fft

    rows, columns = (np.flatnonzero(tractions[0].any(axis=axis)) for axis in (1, 0))
    inside = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    (ny, nx), (dy, dx) = tractions[0][inside].shape, pixel_size_m
    # All distances in y, those in x that are not negative: the others are the same turned round
    x = (np.arange(nx + 1) - 0.5)[None, :] * dx
    y = (np.arange(2 * ny) - ny + 0.5)[:, None] * dy
    along, across = y * np.arcsinh(x / np.abs(y)), x * np.arcsinh(y / np.abs(x))
    primitives = along + across, along - across, -2.0 * np.hypot(x, y)
    kernels = [np.diff(np.diff(one, axis=0), axis=1) for one in primitives]
    for kernel in kernels:
        kernel[:, 1:] *= 2.0
    found, padded = [], padded_shape((ny, nx))
    for traction in tractions:
        q = traction[inside]
        pairs = fft.irfft2(np.square(np.abs(fft.rfft2(q, s=padded))), s=padded)
        pairs = np.concatenate((pairs[len(pairs) - ny + 1 :, :nx], pairs[:ny, :nx]))
        unit = math.pi * dy * dx * float(q.sum()) ** 2
        mean, real, imaginary = (float(np.vdot(pairs, kernel)) / unit for kernel in kernels)
        found.append(Energies(mean, complex(real, imaginary)))
    return found
