"""What a joint does with another preload, friction, structure or amplitude: a table for a page.

The normal curve alone decides: with the withdrawal e from the preload, its load drop D and its loss
integral L, T = mu D, delta = mu kappa e and W = mu^2 kappa L. So friction and structure need no
table, and each preload one of D and L over e; of another kappa it counts as of that of the joint.
It is read by cubics in the logarithms of e, D and L, whose slopes are known: e N' / D, and
4 e (D - e N') / L. The curve of a map is a table itself, and is read as it reads itself: D / e
over log e, e / D and L / D^3 over log D, by lines.
"""

import base64
import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.contact.curve import NormalCurve
from capslip.contact.rung import resolved_share
from capslip.contact.scaled import with_ratio
from capslip.contact.varying_load import VaryingSlip
from capslip.errors import ContactError
from capslip.pressing import knows_other_preloads, under_preload
from capslip.result import Analysis
from capslip.structure.response import MOST_LOSS_FACTOR

if TYPE_CHECKING:
    from capslip.contact.press import ContactState
    from capslip.result import JointResult

PRELOADS = (0.25, 0.5, 0.75)  # shares of the preload, beside it
FIRST = 24  # nodes of each end before the first look at the accuracy
ROUNDS = 24
MOST = 1500  # nodes
TOLERANCE = 2e-7  # relative, of D and L between the nodes
TIME_LIMIT_S = 1.0  # for all tables together
LEAST = 1e-6  # of the withdrawal at which nothing touches: below, D is linear and L cubic


def whatif_data(analysis: "JointResult") -> dict[str, Any] | None:
    """Return the tables and where the panel starts; None without a joint that gives way.

    None, too, where the normal load oscillates: these equations are those of a constant one.

    Parameters
    ----------
    analysis : JointResult
        A finished one.

    Notes
    -----
    Other preloads are those of caps that stay elastic, balanced anew; where the error of their
    model is known, those under which that is no more than is asked, or than under the preload
    itself. A map, and a face that yielded, would have to be pressed anew: they have one table.
    """
    slip, damping, answer = analysis.slip, analysis.damping, analysis.answer
    if slip is None or damping is None or isinstance(slip, VaryingSlip):
        return None
    if not slip.total_slip_displacement_m > 0.0:
        return None
    contact = analysis.contact  # None: that of a joint of several scans, which has no single one
    tables = []
    for load_N, curve in [*_under_others(analysis), (float(slip.preload_N), slip.curve)]:
        if contact and contact.rung.made_from == "map" and analysis.joint.is_even:
            columns, error = _columns_of_map(analysis, contact), 0.0
        else:
            columns, error = _columns(curve, load_N, TIME_LIMIT_S / (1 + len(PRELOADS)))
        text = base64.b64encode(columns.astype("<f8").tobytes()).decode("ascii")
        nodes = columns.shape[1]
        tables.append({"preload_N": load_N, "error": error, "nodes": nodes, "columns": text})
    return {
        "tables": tables,
        "cubic": len(columns) == 5,
        "friction": float(slip.friction_coefficient),
        "kappa": float(slip.kappa),
        "modal_stiffness_N_per_m": damping.modal_stiffness_N_per_m,
        "joint_stiffness_N_per_m": damping.joint_stiffness_N_per_m,
        "joints": damping.joints,
        "amplitude_m": None if answer is None else answer.amplitude_m,
        "most_loss_factor": MOST_LOSS_FACTOR,
        "unresolved": max((resolved_share(part.contact) for part in analysis.parts), default=0.0),
        "of_caps": knows_other_preloads(analysis.joint, contact),
        "error_known": _knows_errors(analysis),
    }


def _knows_errors(analysis: "JointResult") -> bool:
    """Tell whether the error under other preloads is known; of given families under none."""
    known = analysis.contact is not None and analysis.contact.errors is not None
    return known and isinstance(analysis, Analysis)


def _under_others(analysis: "JointResult") -> Iterator[tuple[float, NormalCurve]]:
    """Give smaller preloads of the joint, and its curve under each, that are known as well."""
    contact, slip = analysis.contact, analysis.slip
    if not knows_other_preloads(analysis.joint, contact) or contact is None or slip is None:
        return
    of_settings, most = analysis.settings.contact, math.inf
    if contact.errors is not None:
        most = max(of_settings.tolerance, contact.errors.greatest)
    for share in PRELOADS:
        load_N = share * float(slip.preload_N)
        if not isinstance(analysis, Analysis):  # families, which lie as they are given
            yield load_N, slip.curve
            continue
        try:
            given = analysis.face, contact, load_N, analysis.settings
            pressed, other = under_preload(*given)
        except ContactError:
            continue
        if pressed.errors is None or pressed.errors.greatest <= most:
            yield load_N, with_ratio(other.curve, float(other.kappa / slip.kappa))


def _columns_of_map(analysis: "JointResult", contact: "ContactState") -> np.ndarray:
    """Return e, D and L of the joint at the nodes of the map's own table, shape (3, n)."""
    curve: Any = contact.curve
    below, weight = curve.unloading(contact.preload_N), float(analysis.joint.weight[0])
    e = below.withdrawal_m + curve.compliance_m_per_N * below.load_drop_N
    return np.array([e, weight * below.load_drop_N, weight * below.loss_J])


def _columns(curve: NormalCurve, load_N: float, limit_s: float) -> tuple[np.ndarray, float]:
    """Return log e, log D, its slope, log L and its slope, shape (5, n), and the error between.

    Nodes are added where cubics miss the tolerance, as many as there is time for.
    """
    end = time.perf_counter() + limit_s
    approach_m = float(curve.approach_m(load_N))
    total_m = approach_m - float(curve.touch_m)

    def at(u: np.ndarray) -> np.ndarray:
        e = np.exp(u)
        D = np.asarray(curve.load_drop_N(approach_m, e))
        L = np.asarray(curve.loss_integral_J(approach_m, e))
        k = np.asarray(curve.stiffness_N_per_m(approach_m, e))
        return np.array([np.log(D), e * k / D, np.log(L), 4.0 * e * (D - e * k) / L])

    u = np.append(np.linspace(np.log(LEAST), np.log(0.05), FIRST), 0.0)
    u = np.union1d(u, np.log(np.linspace(0.05, 1.0, FIRST))) + np.log(total_m)
    values, error = at(u), 0.0
    left = np.arange(len(u) - 1)
    for _ in range(ROUNDS):
        middle = 0.5 * (u[left] + u[left + 1])
        exact = at(middle)
        wrong = np.abs(_middles(u, values, left) - exact[::2]).max(axis=0)
        split = wrong > TOLERANCE
        error = float(wrong.max(initial=0.0))
        if not split.any() or len(u) + split.sum() > MOST or time.perf_counter() > end:
            break
        # What is read well enough in its middle is read well in both halves
        at_new = left[split] + np.arange(1, split.sum() + 1)
        u = np.insert(u, left[split] + 1, middle[split])
        values = np.insert(values, left[split] + 1, exact[:, split], axis=1)
        left = np.union1d(at_new - 1, at_new)
    return np.vstack([u, values]), error


def _middles(u: np.ndarray, values: np.ndarray, left: np.ndarray) -> np.ndarray:
    """Return the cubics in the middle of intervals, log D and log L, shape (2, n)."""
    value, slope = values[::2], values[1::2]
    step = (u[left + 1] - u[left]) / 8.0
    middle = 0.5 * (value[:, left] + value[:, left + 1])
    return np.asarray(middle + step * (slope[:, left] - slope[:, left + 1]))
