"""The slip curve as a few parallel Jenkins elements, for finite-element codes."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.slip import SlipCurve
from capslip.contact.solvers.refined_spline import refined_spline
from capslip.contact.varying_load import VaryingSlip
from capslip.disk import way_out, write_whole
from capslip.errors import OutputError, SettingsError

# Of the tolerance, to which T / delta, W^(1/3) / delta and T' are known at any displacement. T' at
# the border of two cells only tells to which of them sliders belong that move there.
SOLVED = np.array((1e-4, 1e-4, 0.1))
DISPLACEMENTS, SMALL_DISPLACEMENTS = 64, 16  # at which it is solved first
TOLERANCE = 0.01  # of the energy per cycle, where nothing else is asked
LEAST_SLIP = 1e-3  # of the upper border of a cell, at which its sliders move

# Force, energy and stiffness over displacements
_Answers = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class JenkinsElements:
    """Parallel elements of one joint, each a spring in series with a slider; shape (n,).

    The slip forces add up to mu N0, the stiffnesses to the initial tangential stiffness, as near as
    a curve leaves it that is none of an Iwan model, see `jenkins`.
    """

    stiffness_N_per_m: np.ndarray
    slip_force_N: np.ndarray
    checked_m: np.ndarray  # (k,), displacements up to total slip, growing
    # (k,), relative, of the energy per cycle there: the greater one at it and at its force
    checked_error: np.ndarray

    @property
    def smallest_displacement_m(self) -> float:
        """Displacement from which on the energy was checked."""
        return float(self.checked_m[0])

    @property
    def energy_error(self) -> float:
        """Largest relative error of the energy per cycle that was found."""
        return float(self.checked_error.max())

    def energy_error_from(self, share: float) -> float:
        """Return the largest relative error of the energy per cycle from a share of mu N0 on."""
        asked = self.force_N(self.checked_m) >= share * self.slip_force_N.sum()
        return float(self.checked_error[asked].max(initial=0.0))

    def good_from_m(self, tolerance: float) -> float:
        """Return the displacement from which on the energy per cycle keeps to a tolerance."""
        off = np.flatnonzero(self.checked_error > tolerance)
        last = len(self.checked_m) - 1
        return float(self.checked_m[min(off[-1] + 1, last) if off.size else 0])

    @property
    def slip_displacement_m(self) -> np.ndarray:
        """Displacement at which each element starts to slide, shape (n,), increasing."""
        return self.slip_force_N / self.stiffness_N_per_m

    def force_N(self, displacement_m: ArrayLike) -> np.ndarray:
        """Tangential force on first loading, shape of the displacement."""
        return _force_N(
            self.stiffness_N_per_m, self.slip_displacement_m, np.asarray(displacement_m)
        )

    def energy_J(self, displacement_m: ArrayLike) -> np.ndarray:
        """Energy lost in a cycle between plus and minus a displacement, in its shape."""
        return _energy_J(
            self.stiffness_N_per_m, self.slip_displacement_m, np.asarray(displacement_m)
        )


def jenkins(
    slip: SlipCurve, tolerance: float = TOLERANCE, smallest_displacement_m: float | None = None
) -> JenkinsElements:
    """Replace a slip curve by parallel Jenkins elements that lose the same energy per cycle.

    The slip curve is an Iwan model whose density of sliders over the slip displacement s is -T''.
    The range of displacement is cut into cells, and the density in each cell is replaced by two
    sliders that keep its integral and its first two moments. Force, stiffness and energy are then
    exact at every border of a cell, and the error inside a cell depends on that cell alone. Where a
    curve is none of such a model, as that of a map may be between its solved loads, the moments are
    those of the energy, and the stiffness is as near as they leave it::

        T = integral of -T'' min(s, delta),  W = 4 integral of -T'' s max(delta - s, 0)

    So every cell is made as long as the tolerance allows, at given displacement and at given force.
    The first one starts at zero and holds all sliders that the range does not resolve.

    Parameters
    ----------
    slip : SlipCurve
        Slip curve of one joint.
    tolerance : float
        Allowed relative error of the energy per cycle, 0.005 to 0.5.
    smallest_displacement_m : float, optional
        The tolerance holds from here to total slip, and beyond. By default a hundredth of the
        displacement at total slip. Below it the elements lose up to some two times as much, and
        nothing below the least of their slip displacements.

    Returns
    -------
    JenkinsElements
        Stiffness and slip force of each element, and the errors found.

    Raises
    ------
    SettingsError
        If the tolerance or the smallest displacement is out of bounds, or the joint is rigid up to
        total slip.

    Notes
    -----
    Iwan, J. Appl. Mech. 33 (1966) 893. W is that of Masing's rule; Eqs. 4-8 of Peyret, Chevallier
    and Dion, Int. J. Appl. Mech. 8 (2016) 1650097, are the case of one spherical contact.

    Examples
    --------
    >>> from capslip.contact.models.families import families
    >>> from capslip.contact.slip import slip_curve
    >>> curve = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> elements = jenkins(slip_curve(curve, 460.4, 0.2, 1.2143), tolerance=0.05)
    >>> print(f"{len(elements.slip_force_N)} elements, {elements.slip_force_N.sum():.2f} N")
    20 elements, 92.08 N
    """
    if isinstance(slip, VaryingSlip):
        raise SettingsError(
            "jenkins: its elements slip at a constant force; expected a constant normal load "
            "(slip.normal_amplitude_ratio = 0)"
        )
    total_m = float(slip.total_slip_displacement_m)
    if not 0.005 <= tolerance <= 0.5:
        raise SettingsError(f"jenkins: tolerance: got {tolerance:g}; expected 0.005 to 0.5")
    if not total_m > 0:
        raise SettingsError(
            f"jenkins: the {slip.curve.model} contact model has no displacement before gross "
            "slip; expected one with caps; use one slider with the force at gross slip instead"
        )
    if smallest_displacement_m is None:
        smallest_displacement_m = 0.01 * total_m
    if not 0 < smallest_displacement_m < total_m:
        raise SettingsError(
            f"jenkins: smallest_displacement_m: got {smallest_displacement_m:g}; expected above 0 "
            f"and below {total_m:g} m, the displacement at gross slip"
        )
    answers = _answers(slip, smallest_displacement_m, total_m, tolerance)
    delta_m = _borders(smallest_displacement_m, total_m, tolerance)
    of_joint = float(slip.stiffness_N_per_m(0.0)), float(slip.total_slip_force_N)
    stiffness_N_per_m, slip_m = _sliders(answers, *of_joint, delta_m, tolerance)
    checked = _energy_errors(answers, stiffness_N_per_m, slip_m, delta_m)
    return JenkinsElements(stiffness_N_per_m, stiffness_N_per_m * slip_m, *checked)


def read_as(asked: float) -> float:
    """Return the error from which on two digits of it read as more than was asked for.

    Examples
    --------
    >>> round(read_as(0.01), 6), round(read_as(0.02), 6)
    (0.0105, 0.0205)
    """
    return asked + 0.05 * 10.0 ** math.floor(math.log10(asked))


def write_jenkins(
    elements: JenkinsElements, path: str | Path, tolerance: float = TOLERANCE
) -> None:
    """Write the elements as CSV, with the way to use them in comment lines at the top.

    Parameters
    ----------
    elements : JenkinsElements
        Elements of one joint.
    path : path
        File to write; an existing one is replaced.
    tolerance : float, optional
        That was asked for: the file says from where they keep to it.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    smallest_m, accuracy = elements.smallest_displacement_m, elements.energy_error
    within = f"within {accuracy:.2g} (relative) at amplitudes of u from"
    as_asked = read_as(tolerance)
    if accuracy >= as_asked:
        good_m = elements.good_from_m(as_asked)
        within = f"within {tolerance:g} (relative) at amplitudes of u from\n# {good_m:.6g} m to "
        within += f"gross slip and beyond, and within {accuracy:.2g} from"
    head = f"""\
# One joint under constant preload, along the direction of slip: {len(elements.slip_force_N)}
# parallel Jenkins elements. Each is a spring (stiffness_N_per_m, in N/m) in series with a
# Coulomb slider (slip_force_N, in N). Put all of them between the same two degrees of freedom,
# the motion of the two faces along the direction of slip.
# Couple the faces in the other directions; give the joint no other friction.
# Time stepping, with the relative displacement u and a memory z of each element, zero at first:
#   f = stiffness (u - z), cut off at plus or minus slip_force; then z = u - f / stiffness.
#   The force of the joint is the sum of f.
# Harmonic balance: the same over two periods of u; the second one is the steady cycle.
# The energy lost per cycle is {within}
# {smallest_m:.6g} m to gross slip and beyond; at smaller ones up to some two times as much is
# lost, and nothing up to {elements.slip_displacement_m[0]:.6g} m.
# The stiffnesses add up to the initial stiffness as near as the energy leaves it, the slip forces
# to friction times preload.
"""
    rows = zip(elements.stiffness_N_per_m.tolist(), elements.slip_force_N.tolist(), strict=True)
    table = "".join(f"{stiffness!r},{force!r}\n" for stiffness, force in rows)
    try:
        text = f"{head}stiffness_N_per_m,slip_force_N\n{table}"
        write_whole(Path(path), lambda unfinished: unfinished.write_text(text, encoding="utf-8"))
    except OSError as error:
        step = way_out(error, "choose another file")
        raise OutputError(
            f"Jenkins elements: {path} cannot be written: {error.strerror}; {step}"
        ) from error


def _borders(smallest_m: float, total_m: float, tolerance: float) -> np.ndarray:
    """Return displacements at which a cell may end, close enough to test the cells at.

    A cell of relative width q errs by about 0.1 q^2, so each gets some 20 points. They are as close
    seen from total slip, where the displacement at given force runs away.
    """
    per_e_fold = 9 / math.sqrt(tolerance)
    n_low = math.ceil(per_e_fold * math.log(total_m / smallest_m))
    n_high = math.ceil(per_e_fold * math.log(10 / tolerance))
    from_zero_m = np.geomspace(smallest_m, total_m, n_low + 1)
    from_total_m = total_m * (1 - np.geomspace(0.3, 0.03 * tolerance, n_high))
    return np.union1d(from_zero_m, from_total_m[from_total_m > smallest_m])


def _answers(slip: SlipCurve, smallest_m: float, total_m: float, tolerance: float) -> _Answers:
    """Return force, energy and stiffness over displacements between two.

    They are asked for at some 2,000, each of them one solution for caps that act on one another.
    T / delta, W^(1/3) / delta and T' are smooth in u = 1 - sqrt(1 - delta / total), from rest to
    total slip.
    """

    def u_of(delta_m: np.ndarray | float) -> np.ndarray:
        share = np.minimum(delta_m / total_m, 1.0)
        return np.asarray(share / (1.0 + np.sqrt(1.0 - share)))  # exact for the smallest, too

    def solved(u: np.ndarray) -> np.ndarray:
        delta_m = total_m * u * (2.0 - u)
        T_N, W_J = slip.force_N(delta_m), slip.energy_J(delta_m)
        return np.stack((T_N / delta_m, np.cbrt(W_J) / delta_m, slip.stiffness_N_per_m(delta_m))).T

    u = np.linspace(0.0, 1.0, DISPLACEMENTS + 1)
    small = np.geomspace(u_of(smallest_m), u[1], SMALL_DISPLACEMENTS)
    curve = refined_spline(solved, np.union1d(small, u[u > small[0]]), SOLVED * tolerance)

    def answers(delta_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        secant, root, slope = curve(u_of(delta_m)).T
        return secant * delta_m, (root * delta_m) ** 3, slope

    return answers


def _sliders(
    answers: _Answers,
    start_N_per_m: float,
    slip_force_N: float,
    delta_m: np.ndarray,
    tolerance: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and slip displacement of the sliders, two for each cell."""
    T_N, W_J, slope = (np.append(0.0, one) for one in answers(delta_m))
    border_m = np.append(0.0, delta_m)
    T_N[-1] = slip_force_N
    slope[[0, -1]] = start_N_per_m, 0.0  # at total slip every slider moves
    first, second = _moments(border_m, T_N, W_J, slope)
    moments = np.stack([slope[0] - slope, first, second])

    def fits(sliders: np.ndarray, start: int, stop: int, free_N_per_m: float) -> bool:
        """Whether the sliders of a cell lose the right energy all over it."""
        inside = slice(max(start, 1), stop)
        # Force is linear between borders and sliders, and exact at the borders.
        knot_m = np.concatenate([border_m[[start]], sliders[1], border_m[[stop]]])
        stuck_N_per_m = start_N_per_m - free_N_per_m - sliders[0].sum()
        knot_N = first[start] + stuck_N_per_m * knot_m + _force_N(sliders[0], sliders[1], knot_m)
        at_force_m = np.interp(T_N[inside], knot_N, knot_m)
        trial_m = np.stack([border_m[inside], at_force_m])
        below_J = 4 * (trial_m * first[start] - second[start])
        error_J = np.abs(below_J + _energy_J(sliders[0], sliders[1], trial_m) - W_J[inside])
        # The margin is for what happens between the points.
        return bool(np.all(error_J <= 0.7 * tolerance * W_J[inside]))

    cells, free_N_per_m = [], 0.0
    start, last = 0, len(delta_m)

    def longer(end: int) -> np.ndarray | None:
        """Return the sliders of a cell that ends there, if it may."""
        if end > last:
            return None
        sliders = _two_sliders(border_m, moments, start, end, free_N_per_m)
        return sliders if fits(sliders, start, end, free_N_per_m) else None

    while start < last:
        stop = start + 1
        cell = _two_sliders(border_m, moments, start, stop, free_N_per_m)
        more, grows = 1, True  # by how much longer the next trial is: doubled, then halved
        while more > 0:
            trial = longer(stop + more)
            if trial is not None:
                cell, stop = trial, stop + more
            grows = grows and trial is not None
            more = 2 * more if grows else more // 2
        if 0 < last - stop < (stop - start) // 2:  # of so short a cell rounding decides the moments
            halfway = (start + last) // 2
            trial = longer(halfway)
            if trial is not None:
                cell, stop = trial, halfway
        cells.append(cell)
        free_N_per_m += float(cell[0].sum())
        start = stop
    stiffness_N_per_m, slip_m = np.concatenate(cells, axis=1)
    return stiffness_N_per_m, slip_m


def _moments(
    border_m: np.ndarray, T_N: np.ndarray, W_J: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the integrals of -T'' s and -T'' s^2 from zero to every border, by parts.

    The energy comes first: no sliders lose one that is not convex over the displacement, as that of
    a map may be between its solved loads, so they lose the greatest convex one below it. Its slopes
    bound those of the force, and none is beyond the force at total slip.
    """
    keep, at_m, lost_J = [0], border_m.tolist(), W_J.tolist()
    for i in range(1, border_m.size):
        while len(keep) > 1:
            x, y = (at_m[one] for one in keep[-2:])
            w, z = (lost_J[one] for one in keep[-2:])
            if (z - w) * (at_m[i] - x) <= (lost_J[i] - w) * (y - x):
                break
            keep.pop()
        keep.append(i)
    step_m = np.diff(border_m)
    convex_J = np.interp(border_m, border_m[keep], W_J[keep])
    force_N = np.minimum(np.diff(convex_J) / step_m / 4, T_N[-1])
    convex_J = np.append(0.0, 4 * np.cumsum(force_N * step_m))
    first = T_N - border_m * slope
    first[1:-1] = np.clip(first[1:-1], force_N[:-1], force_N[1:])
    return first, border_m * first - convex_J / 4


def _two_sliders(
    border_m: np.ndarray, moments: np.ndarray, start: int, stop: int, free_N_per_m: float
) -> np.ndarray:
    """Return [stiffness, slip displacement] of the sliders that keep the moments of a cell.

    The stiffness as far as the other two leave it free: the next cells make up for the rest.
    """
    low_m, high_m = border_m[start], border_m[stop]
    first, second = moments[1:, stop] - moments[1:, start]
    if first <= 1e-13 * moments[0, -1] * high_m:
        return np.empty((2, 0))
    # At one place in the cell at least, and none at rest, where a slider would be no spring
    second = min(max(second, max(low_m, LEAST_SLIP * high_m) * first), high_m * first)
    least = first * first / second
    most = (first * (low_m + high_m) - second) / (low_m * high_m) if low_m > 0.0 else math.inf
    stiffness = max(min(moments[0, stop] - free_N_per_m, most), least)
    mean_m = min(max(first / stiffness, low_m), high_m)
    below_m, above_m = mean_m - low_m, high_m - mean_m
    # No density between two borders has a larger variance than their product.
    variance_m2 = min(second / stiffness - mean_m**2, below_m * above_m)
    if variance_m2 <= 1e-12 * mean_m**2:
        return np.array([[stiffness], [mean_m]])
    # Of all pairs with this mean and variance, the one that always lies inside the cell.
    spread_m, skew = math.sqrt(variance_m2), math.sqrt(below_m / above_m)
    slip_m = [mean_m - spread_m * skew, mean_m + spread_m / skew]
    return np.array([[above_m, below_m], slip_m]) * [[stiffness / (high_m - low_m)], [1.0]]


def _energy_errors(
    answers: _Answers,
    stiffness_N_per_m: np.ndarray,
    slip_m: np.ndarray,
    delta_m: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return displacements, growing, and the larger relative error at each and at its force.

    Between the points that the cells were tested at, too, and where a slider starts to move: there
    the errors peak.
    """
    delta_m = np.union1d(delta_m, slip_m[slip_m > delta_m[0]])
    delta_m = np.union1d(delta_m, (delta_m[1:] + delta_m[:-1]) / 2)
    exact_N, exact_J, _ = answers(delta_m)
    knot_m = np.concatenate([[0.0], slip_m])
    knot_N = _force_N(stiffness_N_per_m, slip_m, knot_m)
    at_force_m = np.interp(exact_N, knot_N, knot_m)
    wrong_J = np.abs(
        _energy_J(stiffness_N_per_m, slip_m, np.stack([delta_m, at_force_m])) - exact_J
    )
    error = np.zeros(delta_m.shape)
    np.divide(wrong_J.max(axis=0), exact_J, out=error, where=exact_J > 0)
    return delta_m, error


def _force_N(stiffness_N_per_m: np.ndarray, slip_m: np.ndarray, delta_m: np.ndarray) -> np.ndarray:
    """Sum over the sliders; shape of the displacement."""
    return np.asarray(np.minimum(delta_m[..., None], slip_m) @ stiffness_N_per_m)


def _energy_J(stiffness_N_per_m: np.ndarray, slip_m: np.ndarray, delta_m: np.ndarray) -> np.ndarray:
    """4 k s (delta - s) for each slider that moves; shape of the displacement."""
    slide_m = np.maximum(delta_m[..., None] - slip_m, 0.0)
    return np.asarray(4 * slide_m @ (stiffness_N_per_m * slip_m))
