"""What noise of a map does to the energy that it loses, to first order: white or correlated."""

import math
from itertools import product

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.path import Path
from capslip.contact.solvers.whiteness import MEDIAN, white_m2
from capslip.surface.rows import even_lines

ORDER = 10  # of the differences that know noise: what is 5 pixels long gives them 1e-4 of itself
_WIDER_ORDER = 4  # the same between points that are not neighbours: ten of them leave the hill
# Correlation lengths in pixels that are told apart: noise of each is seen at twice the spacing
LENGTHS = (0, 1, 2, 4, 8)
_ENOUGH = 20  # of these differences, of which a median says something
_KEYS = -0.75  # of the kernel, about as a spline through all pixels has it
_LOOKED_AT = 500_000  # points, on whole lines: as many tell a standard deviation to 1 %


def loss_noise_per_m(path: Path, lengths: tuple[float, ...] = LENGTHS[:1]) -> np.ndarray:
    """Return what noise of one metre a pixel would do to the loss at each solved load.

    The loss at a load drop F is `8 (U_0 - U_F) - 4 F (d_0 + d_F)` with U the energy that a load
    stores less what the depths h of the face take, the least over all pressures p. So its change
    by a small change of h is that with the pressures held, dU = sum(p dh), d = dU / dN::

        dL = sum(w dh)    w = 8 (p_0 - p_F) - 4 F (p_0' + p_F')    p' = dp / dN

    and for independent dh of standard deviation s that of L is s sqrt(sum(w^2)). w is a ring around
    each contact, of slip; a shift of the whole face has no part in it. p' at the preload is that of
    a punch, elsewhere the quotient of the differences to the loads beside it: 30 % of the result.
    For dh whose correlation falls with the distance r as exp(-r^2 / (2 l^2)), w is replaced by its
    convolution with a Gaussian of standard deviation l / sqrt(2) and of unit norm. Of white noise
    that was taken off the face counts what is left in each wave of w.

    Parameters
    ----------
    path : Path
        With its nodes.
    lengths : tuple of float, optional
        Correlation lengths l of the noise, in pixels; 0: white.

    Returns
    -------
    float64, shape (1 + len(lengths), k)
        Load drops, N, growing, and standard deviations of the loss over itself, 1/m.
    """
    area_m2, load_N = path.face.pixel_area_m2, path.pressed.load_N
    at, place, part = _pixels_around(path)
    states = [(load_N, path.pressed.pressure_Pa)]
    states += [(node.load_N, path.known(node).pressure_Pa) for node in path.nodes]
    states.append((0.0, np.zeros(path.n_points)))
    punch = path.punch_Pa_per_m / path.stiffness_N_per_m
    found = []
    for above, (at_N, at_Pa), below, node in zip(
        states, states[1:], states[2:], path.nodes, strict=False
    ):
        drop_N, loss_J = load_N - at_N, float(node.region_loss_J.sum())
        beside = (above[1] - below[1]) / (above[0] - below[0])
        weight = 8.0 * (states[0][1] - at_Pa) - 4.0 * drop_N * (punch + beside)
        of_pixel = np.bincount(place.reshape(-1), (part * weight * area_m2).reshape(-1))
        if loss_J > 0.0:
            norms = (_norm(of_pixel, at, path.map, length) for length in lengths)
            found.append((drop_N, *(norm / loss_J for norm in norms)))
    return np.array(found).T if found else np.array([[load_N], *[[0.0]] * len(lengths)])


def _norm(weight: np.ndarray, at: np.ndarray, face: ElasticFace, length: float) -> float:
    """Return the norm of weights at pixels of a map, convolved as for a correlation length."""
    if length == 0.0:
        return _norm_of_left(weight, at, face)
    from scipy.ndimage import gaussian_filter

    spread = length / math.sqrt(2.0)
    around = math.ceil(6.0 * spread)
    row, col = np.unravel_index(at, face.shape)
    row, col = row - row.min() + around, col - col.min() + around
    image, one = (
        np.zeros((row.max() + around + 1, col.max() + around + 1)),
        np.zeros(2 * around + 1),
    )
    image[row, col], one[around] = weight, 1.0
    unit = float(np.square(gaussian_filter(one, spread)).sum())  # along either axis
    return float(np.linalg.norm(gaussian_filter(image, spread, mode="constant"))) / unit


def _norm_of_left(weight: np.ndarray, at: np.ndarray, face: ElasticFace) -> float:
    """Return the norm of weights at pixels of a map, for what is left of its white noise."""
    if face.taken is None:
        return float(np.linalg.norm(weight))
    from scipy.fft import dctn

    image, left = np.zeros(face.shape), face.taken.left
    image.reshape(-1)[at] = weight
    wave = dctn(np.pad(image, (len(left) - len(image)) // 2), norm="ortho")
    return float(np.linalg.norm(np.sqrt(left) * wave))


def _pixels_around(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pixels of the map, in which of them each point has its depth, and its part of each.

    Refined points lie on a spline through the pixels around them, and have no noise of their own.
    """
    (ny, nx), (dy_m, dx_m), (x_m, y_m) = path.map.shape, path.map.pixel_size_m, path.face.places_m
    row, col = y_m / dy_m - 0.5, x_m / dx_m - 0.5
    if path.patches is None or path.patches.refinement == 1:
        at = np.rint(row).astype(np.intp) * nx + np.rint(col).astype(np.intp)
        return at, np.arange(path.n_points)[None], np.ones((1, path.n_points))
    up, right = np.floor(row).astype(np.intp), np.floor(col).astype(np.intp)
    pixel, part = [], []
    for i, j in product(range(-1, 3), repeat=2):
        pixel.append(np.clip(up + i, 0, ny - 1) * nx + np.clip(right + j, 0, nx - 1))
        part.append(_cubic(row - up - i) * _cubic(col - right - j))
    pixels, seen = np.array(pixel), np.zeros(ny * nx, dtype=bool)
    seen[pixels] = True
    return np.flatnonzero(seen), (np.cumsum(seen) - 1)[pixels], np.array(part)


def _cubic(apart: np.ndarray) -> np.ndarray:
    """Return the part of a pixel so many pixels apart: Keys' cubic convolution, 0 beyond two."""
    t, far = np.abs(apart), np.abs(apart) >= 1.0
    near = (_KEYS + 2.0) * t**3 - (_KEYS + 3.0) * t**2 + 1.0
    return np.where(far, _KEYS * (t**3 - 5.0 * t**2 + 8.0 * t - 4.0), near)


def white_noise_m(face: ElasticFace, reach_m: float) -> float:
    """Return the standard deviation of what changes from pixel to pixel where a face may touch.

    By the median, as noise is everywhere; spikes and edges are elsewhere. 0 where too few points
    lie side by side.

    Parameters
    ----------
    face : ElasticFace
        Before it was pressed.
    reach_m : float
        Depth down to which it may touch.
    """
    return _seen_m(_lines_m(face), reach_m, 1, ORDER) or 0.0


def noise_by_length_m(face: ElasticFace, reach_m: float, noise_m: float) -> np.ndarray:
    """Return the standard deviations of the noise of each of `LENGTHS` that a map may hold.

    No more in all than the instrument makes, and as much of it as the map shows: each from what
    points twice a length apart show more than nearer ones. What differs from point to point of a
    smooth hill counts as well, so the longer ones are bounds. Where too few points lie so far apart
    on what touches, the rest of the noise may be as long.

    Parameters
    ----------
    face : ElasticFace
        Before it was pressed.
    reach_m : float
        Depth down to which it may touch.
    noise_m : float
        Measurement noise N_M (ISO 25178-600), rms of a height.

    Returns
    -------
    float64, shape (len(LENGTHS),)
    """
    lines_m = _lines_m(face)
    seen_m = [_seen_m(lines_m, reach_m, 1, ORDER)]
    seen_m += [_seen_m(lines_m, reach_m, 2 * length, _WIDER_ORDER) for length in LENGTHS[1:]]
    up_to_m = [noise_m if one is None else min(one, noise_m) for one in seen_m]
    in_all_m2 = np.square(np.maximum.accumulate(up_to_m))
    return np.sqrt(np.diff(in_all_m2, prepend=0.0))


def _lines_m(face: ElasticFace) -> tuple[np.ndarray, np.ndarray]:
    """Return depths on some columns and on some rows, each line along the first axis."""
    known_m = face.known_m
    rows, columns = (even_lines(n, known_m.size // _LOOKED_AT) for n in known_m.shape)
    return known_m[:, columns], known_m[rows].T


def _seen_m(
    lines_m: tuple[np.ndarray, np.ndarray], reach_m: float, spacing: int, order: int
) -> float | None:
    """Return the noise that differences between points show; None where these are too few."""
    noise_m = []
    for along_m in lines_m:
        squares_m2 = []
        for points_m in (along_m[start::spacing] for start in range(spacing)):
            one_m2 = white_m2(points_m, order, 0)
            squares_m2.append(one_m2[np.isfinite(one_m2) & (points_m < reach_m)])
        square_m2 = np.concatenate(squares_m2)
        if square_m2.size >= _ENOUGH:
            noise_m.append(math.sqrt(float(np.median(square_m2)) / MEDIAN))
    return max(noise_m, default=None)
