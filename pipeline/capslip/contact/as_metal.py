"""A map that has yielded, as metal unloads it: what the plastic law expects, in its answers."""

from dataclasses import replace

import numpy as np

from capslip.contact.plastic_law import SHARES, SMALL_SHARES, LawError
from capslip.contact.solvers.unloading import Unloading

# Of mu N, below which pixels are left: up to so many times the force that they resolve, and no more
# than a quarter, at which their error is known
RESOLVED, MOST = 2.0, SMALL_SHARES[-1]
_ROWS, _FAR = 80, 0.1  # of the table below that, and as far down as this at least


def as_metal(unloading: Unloading, law: LawError, spring_m_per_N: float) -> Unloading:
    """Return what happens below a first load, with what metal does otherwise than a map.

    The energy at a force is that of the map, times what the law expects. Below what pixels resolve
    it falls as that of round contacts of metal: before a pixel lets go, a map loses nothing, and
    metal the rim of its contacts. The withdrawal follows from both, as L = 4 s x - 8 integral of x
    ds is::

        x / s = 1 / K + integral of dL / (4 s^2)

    with the stiffness K of contacts as wide as those of metal are.

    Parameters
    ----------
    unloading : Unloading
        Of a map whose pressures end at the hardness.
    law : LawError
        What `law_of_map` finds there.
    spring_m_per_N : float
        In series with the map, as slip uses it: the stiffness that the law moves is that of both.

    Returns
    -------
    Unloading
        Without the spring, as the first. Solved loads and what is known of their errors stay.
    """
    s, x, L = unloading.load_drop_N, unloading.withdrawal_m, unloading.loss_J
    from_N = _from_N(unloading)
    k = max(int(np.searchsorted(s, from_N, side="right")) - 1, 0)
    more = np.interp(np.log(s / unloading.load_N), np.log(SHARES), law.energy) - law.stiffness
    metal_J = L * np.exp(more)
    least_N = min(SMALL_SHARES[0] * unloading.load_N, _FAR * float(s[k]))
    small_N = np.geomspace(least_N, s[k], _ROWS)[:-1]
    fall = law.small_energy(np.append(small_N, s[k]) / unloading.load_N)
    small_J = metal_J[k] * fall[:-1] / fall[-1]
    # The compliance before slip, then with what slips of the rims, then as the map has it
    whole = 1.0 / unloading.stiffness_N_per_m + spring_m_per_N
    begin = whole * np.exp(-law.stiffness) - spring_m_per_N
    drop_N, loss_J = np.append(small_N, s[k]), np.append(small_J, metal_J[k])
    slipped = np.cumsum(np.diff(loss_J) / (4.0 * drop_N[1:] * drop_N[:-1]))
    small = begin + 0.75 * loss_J[0] / drop_N[0] ** 2 + np.append(0.0, slipped)
    with np.errstate(divide="ignore", invalid="ignore"):
        of_map = np.where(np.diff(L[k:]) > 0.0, np.diff(metal_J[k:]) / np.diff(L[k:]), 1.0)
    further = small[-1] + np.cumsum(np.diff(x[k:] / s[k:]) * of_map)
    drop_N = np.append(drop_N, s[k + 1 :])
    withdrawal_m = drop_N * np.append(small, further)
    lift_off_N = np.interp(unloading.region_lift_off_m, x, s)
    return replace(
        unloading,
        stiffness_N_per_m=1.0 / begin,
        withdrawal_m=withdrawal_m,
        load_drop_N=drop_N,
        loss_J=np.append(loss_J, metal_J[k + 1 :]),
        region_lift_off_m=np.interp(lift_off_N, drop_N, withdrawal_m),
        unknown_to_N=unloading.unknown_to_N if unloading.unknown_to_N > from_N else 0.0,
    )


def _from_N(unloading: Unloading) -> float:
    """Return the load drop from which on the pixels of a map are followed."""
    return min(RESOLVED * unloading.smallest_drop_N, MOST * unloading.load_N)
