"""Numbers that mark non-measured points where the file does not say so."""

import numpy as np

# Written by map, instrument and image software in place of a height
CODES = (-9999.0, -99999.0, -32768.0, -2147483648.0)
MARKS = 2  # of different size in one map; more are heights that some mistake made large
BEYOND = 1e37  # 1.7e38 and 3.4e38 mark blanks; no height is as large in any unit
SHARED = 25  # pairs of neighbours that have one height
OFTEN = 20  # times as many as have any other: of a mark, but for heights in few steps
ROWS = 256  # that tell how much heights scatter
WALL = 5.0  # usual steps from a mark to what was measured beside it: a floor has none
NOISY = 0.2  # of second differences turn their sign in what was measured; not in what was designed


def without_marks(height: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Turn what are marks and no heights to NaN.

    Parameters
    ----------
    height : shape (ny, nx)
        Numbers as stored.

    Returns
    -------
    shape (ny, nx), tuple of str
        One or two different numbers beyond 1e37 are marks. The least number is one where it is a
        code that software writes for blanks, and stands several times or lies farther below the
        next one than half the range of the others. Any number but the greatest is one, a zero say,
        that 25 pairs of neighbours share with walls around them, and hardly one of another height,
        where heights scatter as those measured do. A note says what was turned; without marks the
        array is the same.

    Examples
    --------
    >>> z, notes = without_marks(np.array([[1.0, 2.0], [-9999.0, 3.0]]))
    >>> z.tolist(), notes[0][:30]
    ([[1.0, 2.0], [nan, 3.0]], '1 points with -9999, which mar')
    """
    if height.size == 0:
        return height, ()
    notes: list[str] = []
    with np.errstate(invalid="ignore"):
        low, high = float(np.fmin.reduce(height, None)), float(np.fmax.reduce(height, None))
        if max(-low, high) >= BEYOND:
            beyond = np.isfinite(height) & (np.abs(height.astype(np.float64)) >= BEYOND)
            if np.unique(height[beyond]).size <= MARKS:
                height = _blanked(height, beyond, "numbers beyond 1e37", notes)
                low = float(np.fmin.reduce(height, None))
        if low in CODES:
            marked = height == low
            if _is_mark(height, marked, low):
                height = _blanked(height, marked, f"{low:.10g}", notes)
        for shared in _shared(height):
            height = _blanked(height, height == shared, f"{shared:.10g}", notes)
    return height, tuple(notes)


def _shared(height: np.ndarray) -> list[float]:
    """Return the numbers that stand for no height: many neighbours have them, and few another."""
    turned = height, height.T
    equal = [one[:, 1:] == one[:, :-1] for one in turned]
    some = np.concatenate([one[:, 1:][same] for one, same in zip(turned, equal, strict=True)])
    values, counts = np.unique(some, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    most = np.append(counts[order], np.zeros(MARKS + 1))
    stands_out = most[:MARKS] >= np.maximum(SHARED, OFTEN * most[1 : MARKS + 1])
    if not stands_out.any():
        return []
    often = values[order[: 1 + int(np.flatnonzero(stands_out)[-1])]]
    known = np.isfinite(height) & ~np.isin(height, often)
    few = np.s_[:: max(1, len(height) // ROWS)]
    step, beside = np.diff(height[few].astype(float), axis=1), known[few, 1:] & known[few, :-1]
    if not _scatters(step, beside):
        return []
    wall = WALL * float(np.median(np.abs(step[beside])))
    low, high = float(height[known].min()), float(height[known].max())
    return [
        mark
        for mark in often.tolist()
        if _rim(height, mark, known) > wall and (mark < high or mark - high > 0.5 * (high - low))
    ]


def _scatters(step: np.ndarray, beside: np.ndarray) -> bool:
    """Tell whether steps along rows turn as those of measured heights do, where two are known."""
    bend = np.diff(step, axis=1)
    four = beside[:, :-2] & beside[:, 1:-1] & beside[:, 2:]
    turns = four & (np.signbit(bend[:, 1:]) != np.signbit(bend[:, :-1]))
    return int(np.count_nonzero(turns)) > NOISY * int(np.count_nonzero(four))


def _rim(height: np.ndarray, mark: float, known: np.ndarray) -> float:
    """Return the usual step between points with a mark and known ones beside them; 0 for none."""
    marked, rim = height == mark, []
    for z, at, beside in ((height, marked, known), (height.T, marked.T, known.T)):
        rim += [z[:, :-1][beside[:, :-1] & at[:, 1:]], z[:, 1:][at[:, :-1] & beside[:, 1:]]]
    step = np.abs(np.concatenate(rim).astype(float) - mark)
    return float(np.median(step)) if step.size else 0.0


def _is_mark(height: np.ndarray, marked: np.ndarray, low: float) -> bool:
    others = height[~marked & np.isfinite(height)]
    if others.size == 0:
        return False
    if np.count_nonzero(marked) > 1:
        return True
    next_low, high = float(others.min()), float(others.max())
    return next_low - low > 0.5 * (high - next_low)


def _blanked(height: np.ndarray, marked: np.ndarray, what: str, notes: list[str]) -> np.ndarray:
    count = int(np.count_nonzero(marked))
    if count == 0:
        return height
    notes.append(f"{count} points with {what}, which marks blanks, are non-measured")
    return np.where(marked, np.nan, height)
