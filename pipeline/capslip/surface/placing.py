"""How sure the place is at which least squares lay one face on another."""

import math

import numpy as np

from capslip.problems import Problem
from capslip.surface.heightmap import HeightMap

BLOCKS = 6  # along each side: parts of the overlap, whose detail is that of no other part
# By which the face is moved: two hold 95 %, and places are off by some 1.4 times what is said here,
# 2.1 with white noise of a tenth of the waves (root mean squares, 0.9 to 2.7 by the kind of pair)
STANDARD_ERRORS = 3.0
MOST_OF_SIDE = 0.05  # beyond, as along grooves, no slope of here says what moves
LEAST_CURVED = 1e-9  # of the sharpest direction; a flat one is found nowhere

Move = tuple[float, float, float]  # dy [m], dx [m], turn [rad]


def moves_within_error(
    first: HeightMap, second_m: np.ndarray, about_m: tuple[float, float]
) -> tuple[Move, ...]:
    """Return moves of the second face, as far as its place may be off, in three unlike directions.

    Parameters
    ----------
    first : HeightMap
        The face that lies still.
    second_m : float64, shape (ny, nx)
        Heights of the second one at the points of the first, at the place where the sum of both
        varies least; NaN beside it.
    about_m : (float, float)
        (y, x) on the first face, about which the second one turns.

    Notes
    -----
    With heights a and b, b moved by p_k along fields v_k (two shifts and a turn), the sum of
    (a + b)^2 / 2 is least where g_k = -sum (a + b) v_k . grad b vanishes. What the faces do not
    have in common, a + b at the true place, is as good as random, so p is off by H^-1 g, with
    H_kl = -sum (v_k . grad a) (v_l . grad b), which is the second derivative of the sum by two
    partial integrations: neither noise nor detail of one face alone counts in it. The covariance of
    g is that of its sums over 6 x 6 parts of the overlap. The moves are the principal axes of
    H^-1 cov(g) H^-1, with the turn as the length that it moves the corners.

    Examples
    --------
    >>> y, x = np.mgrid[0:60, 0:80] * 1e-4
    >>> first = HeightMap(1e-6 * np.sin(3e3 * x) * np.cos(2e3 * y), (1e-4, 1e-4))
    >>> exact = moves_within_error(first, -first.height_m, (3e-3, 4e-3))
    >>> bool(np.abs(exact).max() < 1e-9)
    True
    """
    (dy_m, dx_m), (ny, nx) = first.pixel_size_m, first.shape
    y_m = ((np.arange(ny) + 0.5) * dy_m - about_m[0])[:, None]
    x_m = (np.arange(nx) + 0.5) * dx_m - about_m[1]
    corner_m = 0.5 * math.hypot(*first.side_m)

    def along(height_m: np.ndarray) -> np.ndarray:
        slope_y, slope_x = np.gradient(height_m, dy_m, dx_m)
        return np.stack((slope_y, slope_x, (x_m * slope_y - y_m * slope_x) / corner_m))

    rest_m = first.height_m + second_m
    of_first, of_second = along(first.height_m), along(second_m)
    known = np.isfinite(rest_m) & np.isfinite(of_first + of_second).all(axis=0)
    if np.count_nonzero(known) < BLOCKS**2:
        return ()
    rest_m = np.where(known, rest_m - np.mean(rest_m, where=known), 0.0)
    of_first, of_second = (np.where(known, one, 0.0) for one in (of_first, of_second))
    part = [np.arange(n) * BLOCKS // n for n in (ny, nx)]
    number = (part[0][:, None] * BLOCKS + part[1]).reshape(-1)
    score = np.array(
        [np.bincount(number, (rest_m * one).reshape(-1), BLOCKS**2) for one in of_second]
    )
    curved = -np.einsum("kyx,lyx->kl", of_first, of_second)
    size, axes = np.linalg.eigh(0.5 * (curved + curved.T))
    if not size[-1] > 0.0:
        return ()
    back = axes / np.maximum(size, LEAST_CURVED * size[-1]) @ axes.T
    square_m2, axes = np.linalg.eigh(back @ (score @ score.T) @ back)
    length_m = STANDARD_ERRORS * np.sqrt(np.maximum(square_m2, 0.0))
    moves = axes * np.minimum(length_m, MOST_OF_SIDE * min(first.side_m))
    moves[2] /= corner_m
    return tuple((float(dy), float(dx), float(turn)) for dy, dx, turn in moves.T)


def problems_of_place(moves: tuple[Move, ...]) -> list[Problem]:
    """Return how far the second face may lie aside, where its place was looked for."""
    if not moves:
        return []
    dy_m, dx_m, turn_rad = np.sqrt(np.square(moves).sum(axis=0))
    message = (
        f"least squares may have laid the second face aside by {dy_m:.2g} m along y, "
        f"{dx_m:.2g} m along x and {turn_rad:.2g} rad"
    )
    return [Problem("mating_not_sure", "warning", message)]
