"""The beds of springs that stand for a joint face under any pressure: stiffness over closure."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from capslip.contact.slip import SlipCurve
from capslip.structure.interpolation import BED, LOADS, ROWS, closures_together_m

SAME_CURVE = 1e-6  # of a closure, by which a curve is another
POINTS, LEAST_LOAD = 800, 1e-4  # of the bed of springs; of the load of the scan
POINTS_OF_OWN = 400  # of each of many beds
LEAST_DROP = 1e-3  # of a pressure, that the bed along which a map unloads from it resolves
LOAD_SHARES = np.union1d(
    np.geomspace(LEAST_LOAD, 0.5, POINTS_OF_OWN),
    1.0 - np.append(np.geomspace(0.49, LEAST_DROP, POINTS_OF_OWN // 2), 0.0),
)
# Of an interval, of the loads above the lower of its pressures
BEYOND = np.append(np.linspace(0.01, 0.99, 99), 1.0 - np.append(np.geomspace(9e-3, 1e-3, 20), 0.0))
Bed = tuple[np.ndarray, np.ndarray]  # closures and stiffnesses
# A law that is refined asks at each turn, and in the end, for beds that it had: by pressures
_known: WeakKeyDictionary[SlipCurve, dict[bytes, Bed]] = WeakKeyDictionary()


def serves_all(slip: SlipCurve, rows: dict[str, np.ndarray]) -> bool:
    """Tell whether the curve of the greatest pressure is that of the lower ones, too."""
    curve = slip.curve
    closure_m = np.asarray(curve.approach_m(rows[ROWS[0]])) - float(curve.touch_m)
    return bool((np.abs(closure_m / rows[ROWS[1]] - 1.0) <= SAME_CURVE).all())


def kappa_of(slips: Sequence[SlipCurve]) -> dict[str, Any]:
    """Return kappa under all pressures, or that of each where slip has a direction."""
    each = [slip.kappa for slip in slips]
    if len(set(each)) == 1:
        return {"kappa": each[0]}
    return {"kappa": np.array(each), ROWS[0]: np.array([float(slip.preload_N) for slip in slips])}


def bed_of_curve(slip: SlipCurve, least_Pa: float) -> dict[str, np.ndarray]:
    """Return the one bed of a curve that serves all pressures up to that of a slip curve."""
    p = np.geomspace(least_Pa, float(slip.preload_N), POINTS)
    return dict(zip(BED, _bed_of_curve(slip, p), strict=True))


def bed_of_solutions(rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return one bed between solved pressures: a cubic in log-log with closures and slopes."""
    from scipy.interpolate import CubicHermiteSpline

    p, d, K = (rows[name] for name in ROWS[:3])
    curve = CubicHermiteSpline(np.log(p), np.log(d), p / (K * d))
    fine = np.linspace(np.log(p[0]), np.log(p[-1]), POINTS)
    z = np.exp(curve(fine))
    # Below the least pressure the power law that its closure and slope make
    exponent = p[0] / (K[0] * d[0])
    below = np.geomspace(LEAST_LOAD * p[-1], p[0], POINTS // 2, endpoint=False)
    z_below = d[0] * (below / p[0]) ** exponent
    all_p, all_z = np.append(below, np.exp(fine)), np.append(z_below, z)
    slope = np.append(np.full(below.size, exponent), curve(fine, 1))
    bed = _from_touch(all_p, all_z, all_p / (slope * all_z))
    return dict(zip(BED, bed, strict=True))


def beds_at_loads(slips: Sequence[SlipCurve], least_Pa: float) -> dict[str, np.ndarray]:
    """Return the bed of caps that each pressure leaves, at the same loads of all.

    It is known up to the next pressure. Beyond, it goes on in the form of the next one: what
    touches there first, touches at one load in both.
    """
    pressure_Pa = np.array([float(slip.preload_N) for slip in slips])
    p = np.union1d(np.geomspace(least_Pa, pressure_Pa[-1], POINTS_OF_OWN), pressure_Pa)
    p = p[np.append(np.diff(p) > SAME_CURVE * p[:-1], True)]
    most_Pa = np.append(pressure_Pa[1:], pressure_Pa[-1])
    beds: list[Bed] = []
    for slip, most in zip(slips[::-1], most_Pa[::-1], strict=True):
        bed = _bed_of_curve(slip, p[p <= most * (1.0 + SAME_CURVE)])
        beds.append(_going_on(bed, beds[-1]) if beds else bed)
    columns = zip(BED, map(np.array, zip(*beds[::-1], strict=True)), strict=True)
    return {ROWS[0]: pressure_Pa, **dict(columns)}


def beds_between(slips: Sequence[SlipCurve], at_shares: Sequence[bool]) -> dict[str, np.ndarray]:
    """Return the beds along which a map unloads from both ends of each interval, (p - 1, 2, n).

    At the same loads, where what touches first does so at one load in both: the lower one is known
    up to its pressure, and goes on in the form of the other. Or, in the intervals that are so, at
    the same shares of the two pressures: where most of a map yields, more load makes more of the
    same contacts. What lets go at a share of one pressure lets go at that of another one, and what
    is left at a load is not alike.
    """
    p = np.array([float(slip.preload_N) for slip in slips])
    intervals = zip(pairwise(slips), pairwise(p.tolist()), at_shares, strict=True)
    beds = []
    for (low, high), (low_Pa, high_Pa), alike_at_shares in intervals:
        loads_Pa = np.append(low_Pa * LOAD_SHARES, low_Pa + (high_Pa - low_Pa) * BEYOND)
        upper = _bed_of_unloading(high, loads_Pa)
        if alike_at_shares:
            lower = _bed_of_unloading(low, loads_Pa * (low_Pa / high_Pa))
        else:
            lower = _going_on(_bed_of_unloading(low, low_Pa * LOAD_SHARES), upper)
        beds.append([np.array(ends) for ends in zip(lower, upper, strict=True)])
    columns = zip(BED, map(np.array, zip(*beds, strict=True)), strict=True)
    return {ROWS[0]: p, **dict(columns)}


def _going_on(bed: Bed, upper: Bed) -> Bed:
    """Return a bed that goes on beyond what is known of it in the form of one of more loads."""
    (z, K), (next_z, next_K) = bed, upper
    n = z.size
    stiffer = K[-1] / next_K[n - 1]
    z = np.append(z, z[-1] + (next_z[n:] - next_z[n - 1]) / stiffer)
    return z, np.append(K, stiffer * next_K[n:])


def closure_together_m(slips: Sequence[SlipCurve], share: Sequence[float]) -> float:
    """Return the closure of patches that bear one pressure, from where none touches.

    It is what they recover as the pressure falls: a map stands higher between its pixels than at
    the highest of them, from which its approach counts.
    """
    p, each = float(slips[0].preload_N), []
    for slip in slips:
        drop_Pa = np.append(p * (1.0 - LOADS), p)
        *e, whole_m = slip.curve.withdrawal_m(slip.approach_m, drop_Pa)
        each.append(whole_m - np.array(e))
    return float(closures_together_m(each, share)[-1])


def _bed_of_unloading(slip: SlipCurve, p: np.ndarray) -> Bed:
    """Return closures and stiffnesses at growing pressures up to that from which a map unloads."""
    most_Pa, d = float(slip.preload_N), float(slip.approach_m)
    whole_m, *e = slip.curve.withdrawal_m(d, np.append(most_Pa, np.maximum(most_Pa - p, 0.0)))
    z = whole_m - np.array(e)
    K = np.gradient(p, z)
    K[-1] = float(slip.curve.stiffness_N_per_m(d))
    return _from_touch(p, z, K)


def _bed_of_curve(slip: SlipCurve, p: np.ndarray) -> Bed:
    """Return closures and stiffnesses of a whole curve at growing pressures, and at its touch.

    Not to be written to.
    """
    beds, pressures = _known.setdefault(slip, {}), p.tobytes()
    if pressures not in beds:
        curve = slip.curve
        approach_m = np.asarray(curve.approach_m(p))
        K = np.asarray(curve.stiffness_N_per_m(approach_m))
        beds[pressures] = _from_touch(p, approach_m - float(curve.touch_m), K)
    return beds[pressures]


def _from_touch(p: np.ndarray, z: np.ndarray, K: np.ndarray) -> Bed:
    """Add the touch, with the springs there that bear the first pressure."""
    at_touch = max(2.0 * p[0] / z[0] - K[0], 0.0)
    return np.append(0.0, z), np.append(at_touch, K)
