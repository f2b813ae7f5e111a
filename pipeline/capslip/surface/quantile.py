"""Quantiles of sizes that tell usual ones from great ones."""

import numpy as np

EVERY = 16  # of the sizes, by which those are left out that are clearly below
MARGIN = 0.03  # of the share: what such a sample may be off by


def quantile(sizes: np.ndarray, share: float) -> float:
    """Return the size that a share of sizes do not exceed, NaN left out; one of them, or NaN.

    The higher the share, the fewer are sorted: a sample says where to begin.

    Parameters
    ----------
    sizes : float64, shape (n,)
    share : float
        0 to 1.

    Examples
    --------
    >>> quantile(np.array([3.0, np.nan, 1.0, 2.0, 4.0]), 0.9)
    3.0
    """
    sample, n = sizes[::EVERY], sizes.size - int(np.count_nonzero(np.isnan(sizes)))
    first = max(0, int((share - MARGIN) * (sample.size - 1)))
    high = sizes[sizes >= np.partition(sample, first)[first]] if n else sizes
    nth = int(share * (n - 1)) - (n - high.size)
    if nth < 0:  # the sample led astray
        high, nth = sizes, int(share * (n - 1))
    return float(np.partition(high, nth)[nth]) if n else np.nan
