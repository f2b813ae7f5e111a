"""How well two maps of the same pixels match at every shift of one of them."""

import numpy as np

LEAST_OVERLAP = 0.5  # of the points of the smaller one


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
