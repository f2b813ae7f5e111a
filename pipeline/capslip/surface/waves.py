"""Waves that a map lacks: longer than its scan, by its spectrum, or taken off by an S-filter."""

import numpy as np

from capslip.problems import Problem
from capslip.surface.doubts import VISIBLE_RIPPLE
from capslip.surface.form import height_taken_off_m, remove_form
from capslip.surface.heightmap import HeightMap
from capslip.surface.rows import row_blocks

LONG, NEXT = 2, 4  # half waves on a side: up to these


def long_waves_m(surface: HeightMap) -> float:
    """Return by how much waves of the scan's length and longer stand out of its spectrum, rms.

    Over the mean plane the heights are a sum of cosines of p and q half waves along y and x,
    which have no ends to meet as a Fourier series has. Those with 0 < p^2 + q^2 <= 4 are the bow
    and the twist that a wave longer than the scan leaves in it, and one of just its length; those
    up to 16, of half that length, say how high the others would be if the spectrum went on evenly,
    as that of roughness does which is short against the scan. What they are more is returned.

    Parameters
    ----------
    surface : HeightMap
        At any level; points that were not measured count as in the plane, and a frame of such
        points is no part of the scan.

    Examples
    --------
    >>> x = (np.arange(200) + 0.5) / 200
    >>> waves = (np.cos(2.0 * np.pi * x / n)[None, :] * np.ones((50, 1)) for n in (1, 0.5))
    >>> [round(1e9 * long_waves_m(HeightMap(1e-6 * z, (4e-5, 1e-5)))) for z in waves]
    [707, 0]
    """
    rest, _ = remove_form(surface, "plane")
    y, x = surface.measured_window
    ny, nx = y.stop - y.start, x.stop - x.start
    along_y, along_x = _cosines(ny), _cosines(nx)
    sum_m = np.zeros((NEXT + 1, NEXT + 1))
    for rows in row_blocks((ny, nx)):
        of_scan = slice(y.start + rows.start, y.start + rows.stop)
        sum_m += along_y[:, rows] @ (np.nan_to_num(rest[of_scan, x]) @ along_x.T)
    square_m2 = (sum_m / (ny * nx)) ** 2
    p, q = np.indices(square_m2.shape)
    order = p**2 + q**2
    long, following = (order > 0) & (order <= LONG**2), (order > LONG**2) & (order <= NEXT**2)
    even_m2 = np.count_nonzero(long) * float(square_m2[following].mean())
    return float(np.sqrt(max(float(square_m2[long].sum()) - even_m2, 0.0)))


def _cosines(n: int) -> np.ndarray:
    """Return cosines of 0 to 4 half waves on n points, each with a mean square of one."""
    order = np.arange(NEXT + 1)[:, None]
    cosine = np.cos(np.pi * order * (np.arange(n) + 0.5) / n)
    return np.asarray(np.where(order == 0, 1.0, np.sqrt(2.0)) * cosine)


def problems_of_filters(
    surface: HeightMap,
    with_long: HeightMap | None,
    with_short: HeightMap | None,
    approach_m: float,
) -> list[Problem]:
    """Return whether filters took off waves that may be the face's own, and bear the load.

    Beside a plane, which a face finds for itself. Lower than a ripple that is seen they are none.
    Noise is among the short ones, which their effect leaves out.

    Parameters
    ----------
    surface : HeightMap
        After the filters.
    with_long, with_short : HeightMap or None
        The same face, on the same points, without the L-filter or the S-filter; None where there
        was none.
    approach_m : float
        With which the waves are compared.
    """
    problems = []
    for code, before, taken, decides in (
        (
            *("long_waves_filtered", with_long, "the L-filter took off long waves"),
            "where they are the face's own, they decide what touches",
        ),
        (
            *("short_waves_filtered", with_short, "the S-filter took off short waves, and noise,"),
            "what of them is the face's own decides how its tops touch",
        ),
    ):
        height_m = 0.0 if before is None else height_taken_off_m(before, surface)
        if height_m > VISIBLE_RIPPLE * approach_m:
            high = f"{taken} {height_m:.3g} m high, the approach is {approach_m:.3g} m"
            problems.append(Problem(code, "warning", f"{high}: {decides}"))
    return problems
