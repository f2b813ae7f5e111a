"""White noise of an instrument, taken off a smooth map before it is pressed."""

import math
from dataclasses import replace

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace, TakenNoise, coarse, finer
from capslip.contact.solvers.noise import ORDER, white_noise_m
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap
from capslip.surface.noise import AS_SAID, noise_spectrum

# Of the rms of noise: where more is left, the face is as rough, or the map has 1.25 times as much
MOST_LEFT = 0.6
LEAST_KNOWN = 0.8  # of the points
_AROUND = 3.0  # waves, standard deviation of the Gaussian over which the power is averaged
_ALONE = 1.3  # of the noise, power up to which waves may be noise alone
_BEYOND = 16  # points beyond the edges, so that the transform, which turns there, bends none of it
_TURNS = 5  # in which what stands there and for lost points follows what is found around them


def without_noise(face: ElasticFace, noise_m: float) -> ElasticFace:
    """Return a smooth face without its white noise, where the map has as much as is said.

    A Wiener filter in the cosine transform of the map over its least-squares plane: of each wave
    the share 1 - s^2 / P is kept, with s the noise and P the mean power of the waves around it. No
    linear filter leaves less of the noise and of what it takes from the face together, the same
    share of s^2 (Wiener 1949, Extrapolation, Interpolation, and Smoothing of Stationary Time
    Series). What may be noise alone is taken whole. Of a face that was laid on other points s^2
    falls with the waves as `noise_spectrum` says.

    Parameters
    ----------
    face : ElasticFace
        Before it is pressed.
    noise_m : float
        Measurement noise N_M (ISO 25178-600), rms of a height.

    Returns
    -------
    ElasticFace
        With `taken`. The same where heights change from pixel to pixel by less than that, since
        noise that neighbours share is no white one; where they change by more, or the face is as
        rough as its noise, since the filter would smooth the face; and where more than a fifth of
        the points is lost.
    """
    white_m, known = white_noise_m(face, math.inf), face.measured
    seen_of_noise = _seen_of_noise(face)
    if white_m < AS_SAID * seen_of_noise * noise_m or known.mean() < LEAST_KNOWN:
        return face
    noise_m = min(noise_m, white_m / seen_of_noise)
    level_m = remove_form(HeightMap(face.known_m, face.pixel_size_m), "plane")[0].height_m
    beyond = min(_BEYOND, *(n - 1 for n in face.shape))
    ny, nx = face.shape
    wide = ny + 2 * beyond, nx + 2 * beyond
    of_map, of_wide = (
        noise_m**2 * noise_spectrum(face.between, face.faces, shape) for shape in ((ny, nx), wide)
    )
    smooth_m, _ = _filtered(_filled(level_m), known, of_map)
    wide_m = np.pad(smooth_m, beyond, mode="reflect", reflect_type="odd")
    seen, seen_m = np.pad(known, beyond), np.pad(level_m, beyond)
    for _ in range(_TURNS):
        wide_m, left = _filtered(np.where(seen, seen_m, wide_m), seen, of_wide)
    taken = TakenNoise(noise_m, left * of_wide / noise_m**2)
    if taken.left_m > MOST_LEFT * noise_m:
        return face
    smooth_m = wide_m[beyond:-beyond, beyond:-beyond]
    depth_m = face.depth_m + np.where(known, smooth_m - level_m, 0.0)
    depth_m[known] -= depth_m[known].min()
    return replace(face, depth_m=depth_m, taken=taken)


def _filtered(
    height_m: np.ndarray, seen: np.ndarray, noise_m2: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return heights without their noise, and the share of its power that is left in each wave.

    What was not seen has none, and so each wave has as much less of it.
    """
    from scipy.fft import dctn, idctn
    from scipy.ndimage import gaussian_filter

    wave_m = dctn(height_m, norm="ortho")
    power_m2 = gaussian_filter(np.square(wave_m), _AROUND, mode="reflect")
    noise = seen.mean() * noise_m2 / power_m2
    kept = np.maximum(1.0 - _ALONE * noise, 0.0)
    return idctn(kept * wave_m, norm="ortho"), np.maximum(1.0 - noise, 0.0)


def _seen_of_noise(face: ElasticFace) -> float:
    """Return how much of the noise of a map changes from pixel to pixel, as `white_noise_m` sees.

    1 where it is white; the noise of a face that was laid on points closer than its own does less.
    """
    spectrum = noise_spectrum(face.between, face.faces, face.shape)
    seen = []
    for axis, n in enumerate(face.shape):
        passed = (2.0 * np.sin(0.5 * np.pi * np.arange(n) / n)) ** (2 * ORDER)
        along = spectrum.mean(axis=1 - axis)
        seen.append(float((along * passed).sum() / passed.sum()))
    return math.sqrt(max(seen))


def _filled(height_m: np.ndarray) -> np.ndarray:
    """Return heights with those that are lost from the means of ever larger blocks around them."""
    lost = np.isnan(height_m)
    if not lost.any():
        return height_m
    around_m = finer(_filled(coarse(height_m)))[: len(height_m), : height_m.shape[1]]
    return np.where(lost, around_m, height_m)
