"""Steps of boundary elements: which points move, along a direction, and how far within bounds."""

import numpy as np

from capslip.contact.solvers.closing import Closing
from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.pressed import State

_MAX_HALVINGS = 60  # of a step: what is left of it is less than rounding


def moving(face: ElasticFace, state: State, off_m: float) -> np.ndarray:
    """Return the points whose pressure changes, as indices.

    Those that penetrate join those under pressure; the step itself gives them theirs. Those at the
    hardness rest until a gap opens.
    """
    moving = state.contact
    if not np.isinf(face.hardness_Pa):
        at_most = state.pressure_Pa.reshape(-1)[moving] >= face.hardness_Pa
        moving = moving[~at_most | (state.gap_m.reshape(-1)[moving] > off_m)]
    if state.least_gap * state.approach_m >= -off_m:
        return moving
    joins = (state.gap_m < -off_m) & face.measured
    flat = joins.reshape(-1)
    flat[state.contact] = False
    flat[moving] = True
    return np.flatnonzero(flat)


def searched_step(
    face: ElasticFace,
    state: State,
    c: np.ndarray,
    direction: np.ndarray,
    r: np.ndarray,
    closing: Closing,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pressures after the step that is best without bounds, and what it makes sink.

    Parameters
    ----------
    face : ElasticFace
        That is pressed.
    state : State
        From which the step goes.
    c : int, shape (n,)
        The points that move, from `moving`.
    direction : float64, of the shape of the face
        Zero beside these; pressures go against it.
    r : float64, shape (n,)
        The gaps at the points, projected.
    closing : Closing
        Its conditions.
    """
    half_space, p, t = face.half_space, state.pressure_Pa, direction.reshape(-1)[c]
    work, du = half_space.work(direction)
    step = float(r @ t) / work if work > 0 else 0.0
    stepped, cut = _stepped(p, c, t, step, closing, face.hardness_Pa)
    if cut or du is None:
        return stepped, half_space.sinking_roughly_m(stepped - p)
    return stepped, -step * du


def tried_step(
    face: ElasticFace, state: State, c: np.ndarray, t: np.ndarray, length: float, closing: Closing
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the pressures after a step of a given length, what it makes sink, and the next length.

    Where contact changes, nearly every step is cut off at bounds, so that the length that is best
    without them is none. Here the sinking of the change as it is tells how much of it to take: of
    the energy, a parabola in that part, the least; beyond all of it only within the bounds. The
    next step is told by the points that this one leaves between the bounds.

    Parameters
    ----------
    face, state, c, closing
        As for `searched_step`.
    t : float64, shape (n,)
        The direction at the points.
    length : float
        Of the step, in this direction.
    """
    p, hardness_Pa = state.pressure_Pa, face.hardness_Pa
    stepped, _ = _stepped(p, c, t, length, closing, hardness_Pa)
    change = stepped - p
    du = face.half_space.sinking_roughly_m(change)
    at = np.flatnonzero(change)
    to_Pa, more_Pa = stepped.reshape(-1)[at], change.reshape(-1)[at]
    down, up = -state.gap_m.reshape(-1)[at] * more_Pa, du.reshape(-1)[at] * more_Pa
    between = (to_Pa > 0) & (to_Pa < hardness_Pa)
    part, longer = _least(down, up), _least(down[between], up[between])
    if part > 1.0:
        beyond_Pa = to_Pa + (part - 1.0) * more_Pa
        if beyond_Pa.min() < 0 or beyond_Pa.max() > hardness_Pa:
            part = 1.0
    if 0.0 < part != 1.0:
        stepped, du = p + part * change, part * du
    return stepped, du, length * min(max(longer, 0.5), 2.0)


def _least(down: np.ndarray, up: np.ndarray) -> float:
    """Return where a parabola is least that falls and bends by so much; 1 where it bends not."""
    bends = float(up.sum())
    return float(down.sum()) / bends if bends > 0 else 1.0


def _stepped(
    p: np.ndarray, c: np.ndarray, t: np.ndarray, step: float, closing: Closing, hardness_Pa: float
) -> tuple[np.ndarray, bool]:
    """Return the pressures after a step, and whether some would have left their bounds.

    These are cut off, which moves load and moments; a step after which the pressures left cannot
    be brought back onto them is halved, and none is taken where halves of it end nowhere else.
    """
    for _ in range(_MAX_HALVINGS):
        p_c = p.reshape(-1)[c] - step * t
        fresh = bool(p_c.min() < 0 or p_c.max() > hardness_Pa)
        stepped = p.copy()
        stepped.reshape(-1)[c] = np.maximum(p_c, 0.0)
        if not fresh:
            return stepped, False
        under = np.flatnonzero(stepped > 0)
        restored = bounded(stepped.reshape(-1)[under], under, closing, hardness_Pa)
        if restored is not None:
            stepped.reshape(-1)[under] = restored
            return stepped, True
        step /= 2
    return p.copy(), True


def bounded(
    pressure_Pa: np.ndarray, points: np.ndarray, closing: Closing, hardness_Pa: float
) -> np.ndarray | None:
    """Return pressures > 0, at most the hardness, moved onto load and moments; None if impossible.

    What is at the hardness stays there, and the others carry the rest; some of them may get there.
    """
    if not len(points):
        return pressure_Pa
    if np.isinf(hardness_Pa):
        return closing.restored(pressure_Pa, points)
    p = np.minimum(pressure_Pa, hardness_Pa)
    while True:  # each turn holds at least one point more
        held = p >= hardness_Pa
        rest = closing.less(p[held], points[held]) if held.any() else closing
        if held.all() or rest is None:
            return None
        free = np.flatnonzero(~held)
        restored = rest.restored(p[free], points[free])
        if restored is None:
            return None
        p[free] = np.minimum(restored, hardness_Pa)
        if not (restored > hardness_Pa).any():
            return p
