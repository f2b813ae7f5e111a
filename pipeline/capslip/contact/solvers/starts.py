"""Pressures to begin with at a load, from those at neighbouring loads."""

from typing import NamedTuple

import numpy as np

_CLOSE = 1e-6  # of the withdrawal between the loads: where the sum is sought


class Known(NamedTuple):
    """One solved load of a face that unloads."""

    withdrawal_m: float  # from the preload
    pressure_Pa: np.ndarray  # of the pixels in contact at the preload, shape (n,)


def start_Pa(total_Pa: float, before: Known | np.ndarray, above: Known, below: Known) -> np.ndarray:
    """Return pressures of a given sum between two solved loads, shape (n,).

    The squared pressure in a Hertz contact, c^2 (a^2 - r^2) with a^2 = R d, is linear in the
    approach; so that of every pixel is interpolated over the withdrawal, by a parabola. Where a
    pixel has let go at the load below, it falls as it did before, and at least to zero there.

    Parameters
    ----------
    total_Pa : float
        Sum of the pressures, between those of the two loads.
    before : Known or ndarray, shape (n,)
        The next load above `above`; where that is the preload, dp/dd there in Pa/m.
    above, below : Known
        The neighbours; at the load below nothing may touch.
    """
    from scipy.optimize import brentq

    q, q_below = np.square(above.pressure_Pa), np.square(below.pressure_Pa)
    # What lets go at once does so over no withdrawal
    least_m = 1e-9 * below.withdrawal_m
    width_m = max(below.withdrawal_m - above.withdrawal_m, least_m)
    chord = (q_below - q) / width_m
    if isinstance(before, Known):
        back_m = max(above.withdrawal_m - before.withdrawal_m, least_m)
        slope = (q - np.square(before.pressure_Pa)) / back_m
        bend = (chord - slope) / (width_m + back_m)
    else:
        slope = -2 * above.pressure_Pa * before
        bend = (chord - slope) / width_m
    holds = q_below > 0
    rate = np.where(holds, chord, np.minimum(slope, chord))
    bend = np.where(holds, bend, 0.0)

    def found_Pa(x_m: float) -> np.ndarray:
        return np.sqrt(np.maximum(q + x_m * (rate + (x_m - width_m) * bend), 0.0))

    def off_Pa(x_m: float) -> float:
        return float(found_Pa(x_m).sum()) - total_Pa

    if off_Pa(0.0) <= 0.0:
        return found_Pa(0.0)
    if off_Pa(width_m) >= 0.0:
        return found_Pa(width_m)
    return found_Pa(brentq(off_Pa, 0.0, width_m, xtol=_CLOSE * width_m))
