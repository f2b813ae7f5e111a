"""The greatest steps and bends of a map: what needs no closer look for cliffs and spikes."""

import numpy as np

from capslip.surface.heightmap import HeightMap
from capslip.surface.rows import BLOCK_POINTS, row_blocks


def greatest_steps_m(surface: HeightMap) -> np.ndarray:
    """Return the greatest step and bend that some rows of a map can have, shape (2, n_blocks).

    Of the rows of each of `row_blocks` and the next: a step is that from a point to one of its
    eight neighbours, a bend the sum of those to both neighbours along a row or column. A point that
    was not measured counts as high as the one before it, so no step or bend of a map is greater.

    Parameters
    ----------
    surface : HeightMap

    Examples
    --------
    >>> z = np.zeros((5, 6))
    >>> z[2, 3] = 1e-6
    >>> greatest_steps_m(HeightMap(z, (1e-4, 1e-4)))
    array([[2.e-06],
           [2.e-06]])
    """
    nx, found_m = surface.shape[1], []
    steps_m, bends_m = np.empty((2, (BLOCK_POINTS // nx + 3) * nx))
    for rows in row_blocks(surface.shape):
        rows = slice(rows.start, min(rows.stop + 2, surface.shape[0]))
        z, lost = surface[rows].reshape(-1), surface.lost_in(rows)
        if lost.size:
            z, begin = z.copy(), np.flatnonzero(np.diff(lost, prepend=-2) != 1)
            z[lost] = np.repeat(z[lost[begin] - 1], np.diff(begin, append=lost.size))
            # Where none is before, which may be more than a row: as high as the first
            first_m = np.nan_to_num(z[np.isfinite(z).argmax()])
            np.nan_to_num(z, copy=False, nan=first_m)
        step_m, bend_m = 0.0, 0.0
        for stride in (1, nx):  # of flat arrays: several times as fast as rows less a point
            step = np.subtract(z[stride:], z[:-stride], out=steps_m[: z.size - stride])
            if stride == 1:
                step[nx - 1 :: nx] = 0.0
            step_m += _greatest(step)
            bend = bends_m[: max(step.size - stride, 0)]
            np.subtract(step[stride:], step[:-stride], out=bend)
            if stride == 1:
                bend[nx - 2 :: nx] = bend[nx - 1 :: nx] = 0.0
            bend_m = max(bend_m, _greatest(bend))
        found_m.append((step_m, bend_m))
    return np.array(found_m).T


def _greatest(values: np.ndarray) -> float:
    return max(float(values.max(initial=0.0)), -float(values.min(initial=0.0)))
