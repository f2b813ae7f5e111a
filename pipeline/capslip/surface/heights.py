"""Heights as a map stores them, and which of its points were not measured."""

import math
from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np

from capslip.errors import SettingsError, UnusableSurfaceError, check_kind, in_short
from capslip.surface.rows import row_blocks

MOST_OF_FEW_BYTES = 2**30  # points of a map, with a frame around it too
SMALL = 2**21  # points of a map whose heights are computed once and kept


def stored_of(given: Any, name: str) -> np.ndarray:
    """Return heights that nobody else can write to; what a mask hides was not measured."""
    try:
        given = np.asanyarray(given)
        if given.dtype.kind in "cmM":
            raise TypeError(f"they are of type {given.dtype}")
        kept = np.float32 if given.dtype == np.float32 else np.float64
        if isinstance(given, np.ma.MaskedArray):
            given = np.ma.filled(given.astype(kept), np.nan)
        stored_m = np.ascontiguousarray(given, dtype=kept)
    except (TypeError, ValueError) as error:
        raise UnusableSurfaceError(
            f"{name}: heights are no real numbers on a grid ({error}); expected an array of two "
            "axes"
        ) from None
    if stored_m.flags.writeable and np.may_share_memory(stored_m, given):
        stored_m = stored_m.copy()
    stored_m.flags.writeable = False
    return stored_m


def lost_of(stored_m: np.ndarray, name: str) -> np.ndarray:
    """Return the points that were not measured; refuse infinite ones."""
    found, infinite, nx = [], 0, stored_m.shape[1]
    for rows in row_blocks(stored_m.shape):
        finite = np.isfinite(stored_m[rows])
        if not finite.all():
            infinite += int(np.count_nonzero(np.isinf(stored_m[rows])))
            found.append(np.flatnonzero(~finite) + rows.start * nx)
    if infinite:
        raise UnusableSurfaceError(
            f"{name}: {infinite} infinite heights; expected finite "
            "heights or NaN for non-measured points; mark them as non-measured"
        )
    return np.concatenate([np.empty(0, dtype=np.intp), *found]).astype(index_type(stored_m.size))


def ends_m(height_m: np.ndarray) -> tuple[float, float]:
    """Return the least and the greatest of heights, some of which may be NaN."""
    low_m, high_m = height_m.min(), height_m.max()  # several times as fast as those without NaN
    if np.isnan(low_m):
        low_m, high_m = np.fmin.reduce(height_m, axis=None), np.fmax.reduce(height_m, axis=None)
    return low_m, high_m


def index_type(n_points: int) -> type:
    """Return the numbers that count the points of a map: of large ones those of fewer bytes."""
    return np.int32 if SMALL < n_points < MOST_OF_FEW_BYTES else np.intp


def slopes_of(given: Any, name: str) -> tuple[float, float]:
    """Return two slopes of a floor; SettingsError if they are none, or not finite."""
    numbers = list(given) if isinstance(given, Sequence | np.ndarray) else []
    if any(not isinstance(one, Real) or not math.isfinite(one) for one in numbers):
        numbers = []
    if len(numbers) != 2:
        got = f"{name}: floor_slope: got {in_short(repr(given))}"
        raise SettingsError(f"{got}; expected two finite numbers, along y and x")
    return float(numbers[0]), float(numbers[1])


def check_error(name: str, what: str, error_m: object) -> None:
    """Refuse an error of heights that is neither a positive number of metres nor None."""
    if error_m is None:
        return
    check_kind(f"{name}: {what}_m", error_m, Real, "a positive number in metres")
    assert isinstance(error_m, Real)
    if not 0.0 < float(error_m) < math.inf:
        got = f"{name}: {what.replace('_', ' of ')} of {float(error_m):g} m"
        raise SettingsError(f"{got}; expected a positive number")
