"""How well two maps of the same pixels match at every shift of one of them."""

import numpy as np

LEAST_OVERLAP = 0.5  # of the points of the smaller one
_RIVAL = 1.5  # times what the best place leaves: what a coarse one may leave more of a better one
_BLOCKS, _FEWEST = 8, 8  # along a side, and with points, from which a difference is told
_SURE = 3.0  # standard errors


def match_by_shift(first_m: np.ndarray, second_m: np.ndarray) -> np.ndarray:
    """Return how well the faces match for every shift of the second, -inf without overlap.

    The match is 1 - var(h1 + h2) / (var h1 + var h2) over the overlap: least squares, made
    independent of how rough the overlap is.
    """
    from scipy import fft

    shape = [
        fft.next_fast_len(n + m, real=True)
        for n, m in zip(first_m.shape, second_m.shape, strict=True)
    ]

    def waves(z: np.ndarray, conjugate: bool) -> list[np.ndarray]:
        known = ~np.isnan(z)
        z = np.where(known, (z - np.mean(z[known])) / np.std(z[known]), 0.0)
        transforms = [fft.rfft2(part, shape) for part in (known.astype(float), z, z * z)]
        return [np.conj(wave) for wave in transforms] if conjugate else transforms

    scale = np.nanstd(first_m), np.nanstd(second_m)
    (w1, z1, q1), (w2, z2, q2) = waves(first_m, False), waves(second_m, True)
    n, s1, s2, ss1, ss2, s12 = (
        fft.irfft2(product, shape)
        for product in (w1 * w2, z1 * w2, w1 * z2, q1 * w2, w1 * q2, z1 * z2)
    )
    enough = n >= LEAST_OVERLAP * min(np.sum(~np.isnan(first_m)), np.sum(~np.isnan(second_m)))
    n = np.where(enough, n, 1.0)
    s1, s2 = s1 / n, s2 / n
    variance = scale[0] ** 2 * (ss1 / n - s1**2) + scale[1] ** 2 * (ss2 / n - s2**2)
    covariance = scale[0] * scale[1] * (s12 / n - s1 * s2)
    variance = np.where(enough & (variance > 0.0), variance, 1.0)
    return np.where(enough, -2.0 * covariance / variance, -np.inf)


def best_shifts(match: np.ndarray, apart: int, most: int) -> list[tuple[int, int]]:
    """Return the best shifts of each neighbourhood that may be as good as the best of all.

    Parameters
    ----------
    match : ndarray, shape (ny, nx)
        From `match_by_shift`, -inf where none is looked for.
    apart : int
        Pixels to each side within which a shift is the best.
    most : int
        Of them, the best first.

    Returns
    -------
    list of (int, int)
        Rows and columns; those that leave more than `_RIVAL` times what the best leaves of the
        heights are none.

    Examples
    --------
    >>> match = np.full((20, 30), -np.inf)
    >>> match[:, 3] = 0.8 + 0.1 * np.cos(np.arange(20))
    >>> best_shifts(match, 2, 3)
    [(0, 3), (6, 3), (13, 3)]
    """
    from scipy.ndimage import maximum_filter

    least = 1.0 - _RIVAL * (1.0 - float(match.max()))
    highest = maximum_filter(match, 2 * apart + 1, mode="wrap") == match
    places = np.argwhere(highest & np.isfinite(match) & (match >= least))
    order = np.argsort(-match[tuple(places.T)], kind="stable")
    return [(int(y), int(x)) for y, x in places[order[:most]]]


def tells_apart(rest_m: np.ndarray, other_m: np.ndarray) -> bool:
    """Tell whether what is left of the heights at one place is surely less than at another.

    What both leave at a point has much in common, as of the same grooves: so the difference of the
    squares is averaged, and its means over blocks tell how sure that is.

    Parameters
    ----------
    rest_m, other_m : ndarray, shape (ny, nx)
        Sums of the heights, from whose means they count; NaN beside either face.
    """
    both = np.isfinite(rest_m + other_m)
    more_m2 = np.where(both, np.square(other_m) - np.square(rest_m), 0.0)
    row, column = (np.arange(n) * _BLOCKS // n for n in both.shape)
    block = (row[:, None] * _BLOCKS + column).reshape(-1)
    n = np.bincount(block, both.reshape(-1), _BLOCKS**2)
    means_m2 = np.bincount(block, more_m2.reshape(-1), _BLOCKS**2)[n > 0] / n[n > 0]
    weight = n[n > 0] / n.sum() if n.any() else n[:0]
    if len(means_m2) < _FEWEST:
        return False
    mean_m2 = float(weight @ means_m2)
    spread_m2 = np.sqrt(float(np.square(weight * (means_m2 - mean_m2)).sum()))
    return bool(mean_m2 > _SURE * spread_m2)
