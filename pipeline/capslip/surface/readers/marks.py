"""Numbers that mark non-measured points where the file does not say so."""

import numpy as np

# Written by map, instrument and image software in place of a height
CODES = (-9999.0, -99999.0, -32768.0, -2147483648.0)
MARKS = 2  # of different size in one map; more are heights that some mistake made large
BEYOND = 1e37  # 1.7e38 and 3.4e38 mark blanks; no height is as large in any unit


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
        next one than half the range of the others. A note says what was turned; without marks the
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
    return height, tuple(notes)


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
