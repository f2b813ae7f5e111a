"""The areal Gaussian filter."""

import math
from dataclasses import replace

import numpy as np

from pipeline.errors import SettingsError
from pipeline.surface.heightmap import HeightMap

# The weight exp(-pi (r / (alpha L))^2), alpha = sqrt(ln 2 / pi), halves a wave of length L.
SIGMA_PER_NESTING_INDEX = math.sqrt(math.log(2.0) / 2.0) / math.pi  # 0.18739
TRUNCATE_SIGMA = 5.0  # the weight left out is below 1e-6


def gaussian_s_filter(surface: HeightMap, nesting_index_m: float) -> HeightMap:
    """Smooth a height map with the areal Gaussian filter of ISO 16610-61.

    Parameters
    ----------
    surface : HeightMap
        Pixels need not be square.
    nesting_index_m : float
        The wavelength that is halved in amplitude.

    Returns
    -------
    HeightMap
        The weights are those of the measured points alone, made to sum to one (normalised
        convolution): a constant stays constant up to the edge and around holes. Non-measured
        points stay non-measured.

    Raises
    ------
    SettingsError
        If the nesting index is not positive, is below two pixels (the filter would do nothing that
        the grid can show), or exceeds the face.
    """
    shortest_m = 2.0 * max(surface.pixel_size_m)
    longest_m = min(surface.side_m)
    if not shortest_m <= nesting_index_m <= longest_m:
        raise SettingsError(
            f"conditioning.s_filter_nesting_index_m: got {nesting_index_m:g}; expected two pixels "
            f"({shortest_m:g} m) to the shorter side ({longest_m:g} m)"
        )
    return replace(surface, height_m=_smooth(surface, nesting_index_m))


def _smooth(surface: HeightMap, nesting_index_m: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter, gaussian_filter1d

    sigma = [SIGMA_PER_NESTING_INDEX * nesting_index_m / size for size in surface.pixel_size_m]
    height_m, measured = surface.height_m, surface.measured
    level_m = float(np.mean(height_m[measured])) if measured.any() else 0.0
    smooth_m: np.ndarray = gaussian_filter(
        np.where(measured, height_m - level_m, 0.0),
        sigma,
        mode="constant",
        truncate=TRUNCATE_SIGMA,
    )
    if measured.all():  # the weights of a full rectangle are a product
        along_y, along_x = (
            gaussian_filter1d(np.ones(n), s, mode="constant", truncate=TRUNCATE_SIGMA)
            for n, s in zip(surface.shape, sigma, strict=True)
        )
        smooth_m /= along_y[:, None]
        smooth_m /= along_x
    else:
        weight = gaussian_filter(
            measured.astype(np.float64), sigma, mode="constant", truncate=TRUNCATE_SIGMA
        )
        smooth_m[measured] /= weight[measured]
        smooth_m[~measured] = np.nan
    smooth_m += level_m
    return smooth_m
