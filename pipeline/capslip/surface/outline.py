"""Where a face ends on its map: what was not measured and is no part of it."""

import numpy as np

HOLE = np.ones((3, 3), dtype=bool)  # of lost points, from which they are no single ones
RUNS = HOLE[:1], HOLE[:, :1]


def outside_of(measured: np.ndarray, void: bool, window: tuple[slice, slice]) -> np.ndarray:
    """Return which points are outside of a face, shape (ny, nx): lost, and open to the edge.

    So is a margin of one line, but no point that was lost alone in a corner: three in a row are
    outside. Where nothing is that was not measured (`void`), every hole of 3 x 3 is outside, too.
    Within the least rectangle that holds all measured points (`window`) it is what it is without
    the margin around.
    """
    out = np.ones(measured.shape, dtype=bool)
    if out[window].size:
        out[window] = _open_to_edge(measured[window], void)
    return out


def _open_to_edge(measured: np.ndarray, void: bool) -> np.ndarray:
    from scipy.ndimage import binary_opening

    lost = ~measured
    out: np.ndarray = lost & ~between(measured)
    if out.any():
        along, across = (binary_opening(out, run) for run in RUNS)
        out = along | across
    return out | binary_opening(lost, HOLE) if void else out


def window_of(lost: np.ndarray, shape: tuple[int, int]) -> tuple[slice, slice]:
    """Return rows and columns of the least rectangle that holds all points that are not lost.

    Of a map of a shape, on which points are counted row by row; nothing where all are lost.
    """
    (ny, nx), window = shape, []
    for line, n, points in ((lost // nx, ny, nx), (lost % nx, nx, ny)):
        some = np.flatnonzero(np.bincount(line, minlength=n) < points)
        window.append(slice(int(some[0]), int(some[-1]) + 1) if some.size else slice(0, 0))
    return window[0], window[1]


def between(measured: np.ndarray) -> np.ndarray:
    """Return which points are not measured and lie between two that are, shape (ny, nx)."""
    mask: np.ndarray = ~measured
    # Outside are points of rows and of columns that begin or end with one: of most maps few
    rows, cols = (np.flatnonzero(mask.take((0, -1), axis).any(axis)) for axis in (1, 0))
    if 2 * min(rows.size, cols.size) > min(mask.shape):
        mask &= _enclosed(measured, 0) | _enclosed(measured, 1)
    elif rows.size and cols.size:
        along, across = _enclosed(measured[rows], 1), _enclosed(measured[:, cols], 0)
        mask[np.ix_(rows, cols)] &= along[:, cols] | across[rows]
    return mask


def _enclosed(measured: np.ndarray, axis: int) -> np.ndarray:
    """Tell which points have measured ones on both sides along an axis, or are measured."""
    lines = np.moveaxis(measured, axis, 1)
    n_lines, length = lines.shape
    first, last = (np.full((n_lines, 1), end, dtype=np.int32) for end in (0, length - 1))
    if not lines[:, 0].all():
        open_ = np.flatnonzero(~lines[:, 0])
        some = lines[open_].any(axis=1)
        first[open_, 0] = np.where(some, lines[open_].argmax(axis=1), length)
    if not lines[:, -1].all():
        open_ = np.flatnonzero(~lines[:, -1])
        last[open_, 0] -= lines[open_, ::-1].argmax(axis=1).astype(np.int32)
    place = np.arange(length, dtype=np.int32)
    if axis == 0:
        first, last, place = first.T, last.T, place[:, None]
    both: np.ndarray = (place >= first) & (place <= last)
    return both
