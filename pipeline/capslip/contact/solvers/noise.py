"""What white noise of a map does to the energy that it loses, to first order."""

import math
from itertools import product

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.path import Path
from capslip.contact.solvers.whiteness import white_m2

_ORDER = 10  # of the differences that know noise: what is 5 pixels long gives them 1e-4 of itself
_ENOUGH = 20  # of these differences, of which a median says something
_MEDIAN = 0.4549  # of the squares of a normal distribution, over its variance
_KEYS = -0.75  # of the kernel, about as a spline through all pixels has it
_LOOKED_AT = 500_000  # points, on whole lines: as many tell a standard deviation to 1 %


def loss_noise_per_m(path: Path) -> np.ndarray:
    """Return what white noise of one metre a pixel would do to the loss at each solved load.

    The loss at a load drop F is `8 (U_0 - U_F) - 4 F (d_0 + d_F)` with U the energy that a load
    stores less what the depths h of the face take, the least over all pressures p. So its change
    by a small change of h is that with the pressures held, dU = sum(p dh), d = dU / dN::

        dL = sum(w dh)    w = 8 (p_0 - p_F) - 4 F (p_0' + p_F')    p' = dp / dN

    and for independent dh of standard deviation s that of L is s sqrt(sum(w^2)). w is a ring around
    each contact, of slip; a shift of the whole face has no part in it. p' at the preload is that of
    a punch, elsewhere the quotient of the differences to the loads beside it: 30 % of the result.

    Parameters
    ----------
    path : Path
        With its nodes.

    Returns
    -------
    float64, shape (2, k)
        Load drops, N, growing, and standard deviations of the loss over itself, 1/m.
    """
    area_m2, load_N = path.face.pixel_area_m2, path.pressed.load_N
    pixel, part = _pixels_around(path)
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
        of_pixel = np.bincount(pixel.reshape(-1), (part * weight * area_m2).reshape(-1))
        if loss_J > 0.0:
            found.append((drop_N, float(np.linalg.norm(of_pixel)) / loss_J))
    return np.array(found).T if found else np.array([[load_N], [0.0]])


def _pixels_around(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels of the map that each point takes its depth from, and its part of each.

    Refined points lie on a spline through the pixels around them, and have no noise of their own.
    """
    if path.patches is None or path.patches.refinement == 1:
        return np.arange(path.n_points)[None], np.ones((1, path.n_points))
    (ny, nx), (dy_m, dx_m), (x_m, y_m) = path.map.shape, path.map.pixel_size_m, path.face.places_m
    row, col = y_m / dy_m - 0.5, x_m / dx_m - 0.5
    up, right = np.floor(row).astype(np.intp), np.floor(col).astype(np.intp)
    pixel, part = [], []
    for i, j in product(range(-1, 3), repeat=2):
        pixel.append(np.clip(up + i, 0, ny - 1) * nx + np.clip(right + j, 0, nx - 1))
        part.append(_cubic(row - up - i) * _cubic(col - right - j))
    pixels, seen = np.array(pixel), np.zeros(ny * nx, dtype=bool)
    seen[pixels] = True
    return (np.cumsum(seen) - 1)[pixels], np.array(part)


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
    every = max(1, face.depth_m.size // _LOOKED_AT)
    depth_m = np.where(face.measured, face.depth_m, np.nan)
    noise_m = []
    for axis, lines_m in ((0, depth_m[:, ::every]), (1, depth_m[::every])):
        if lines_m.shape[axis] <= _ORDER:
            continue
        square_m2 = white_m2(lines_m, _ORDER, axis)
        square_m2 = square_m2[np.isfinite(square_m2) & (lines_m < reach_m)]
        if square_m2.size >= _ENOUGH:
            noise_m.append(math.sqrt(float(np.median(square_m2)) / _MEDIAN))
    return max(noise_m, default=0.0)
