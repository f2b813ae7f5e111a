"""What hills have below their contacts beside their caps, and what that changes of the answers."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.caps.spheres import elliptic_factor
from capslip.contact.models.interacting import InteractingCurve
from capslip.contact.outlines import ellipses_of
from capslip.contact.rung import Scene
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.contact.solvers.refinement import SMOOTH
from capslip.contact.solvers.whiteness import MEDIAN, white_m2
from capslip.surface.rows import even_lines

# Of the preload: where what lies below the contacts is looked at
DROPS = np.array([0.0, 0.05, 0.1, 0.175, 0.25, 0.375, 0.5, 0.625, 0.75])
SECANT = 6  # of these, from which on the nearest sphere is asked for: at half of the load
NOTHING = 1e-4  # of the approach, that the profiles of all caps leave at most: spheres
BESIDE = 8  # pixels that a spline looks at beyond a contact
RINGS, ROUND = 4, 16  # of the points at which a mean is taken
LINES = 16  # across a contact, of which the noise is taken
ORDER = 8  # of the differences that tell noise from waves of a few pixels
MOST_STEEP = 0.9  # of the curvature of a cap, that a hill may lack


@dataclass(frozen=True, eq=False)
class Profiles:
    """What the hills of the caps in use have beside them, made by `profiles`.

    The first two are by how much the nearest sphere between the preload and half of it is higher,
    and the logarithm of by how much wider, shape (n,), NaN where nobody knows; `change` is that of
    the energies and of the stiffness, relative, shape (k + 1,).
    """

    up_m: np.ndarray
    log_radius: np.ndarray
    change: np.ndarray


def profiles(
    scene: Scene, curve: InteractingCurve, shares: tuple[float, ...], noise_m: float
) -> Profiles | None:
    """Return what the heights below the contacts change, to first order.

    Parameters
    ----------
    scene : Scene
        With the caps that can touch in use.
    curve : InteractingCurve
        Of these caps.
    shares : tuple of float
        Of mu N, at which the energies are asked for.
    noise_m : float
        Standard deviation of the noise of the map. Beside it counts what the heights below the
        contacts have of white noise: waves of a few pixels are as noise to lower differences.

    Returns
    -------
    Profiles or None
        None where noise hides it, and where all the caps are spheres.

    Notes
    -----
    A height r beside the cap does to the load of a contact what its mean h under the pressure of a
    flat punch does as a height of all of it. So the approach under a load N is less by the sum of
    h_i dN_i / dN over the contacts, and what is lost where s of it goes,
    L = 4 s x - 8 integral of x ds with the withdrawal x, more by the same of its change. A sphere
    that is higher by u and whose radius is greater by the share l has h = u + l m, where m is the
    mean depth of the cap under that pressure, a^2 / 3 R of a round one.
    """
    load_N = scene.preload_N
    approach_m = float(curve.approach_m(load_N))
    left_m = float(scene.caps.profile_residual_m[scene.use].max())
    most_m = SMOOTH * approach_m
    if left_m <= NOTHING * approach_m or (
        noise_m > most_m and _white_noise_m(scene, curve.asperity_loads_N(approach_m)) > most_m
    ):
        return None
    from scipy.interpolate import CubicSpline, PchipInterpolator

    drop_N = DROPS * load_N
    left_N = (load_N - drop_N).tolist()
    each_N = np.array([curve.asperity_loads_N(float(curve.approach_m(N))) for N in left_N])
    height_m, depth_m = _below(scene, each_N)
    share = -PchipInterpolator(drop_N, each_N)(drop_N, 1)
    total_m = (share * np.nan_to_num(height_m)).sum(axis=1)
    change_m = CubicSpline(drop_N, total_m - total_m[0])
    s = np.array(shares) * load_N
    change_J = 4.0 * s * change_m(s) - 8.0 * np.array([change_m.integrate(0.0, one) for one in s])
    loss_J = curve.loss_integral_at_drop_J(approach_m, s)
    of_stiffness = -change_m(0.0, 1) * float(curve.stiffness_N_per_m(approach_m))
    rise_m, run_m = (one[0] - one[SECANT] for one in (height_m, depth_m))
    more = rise_m / np.where(run_m > 0.0, run_m, np.nan)
    up_m = height_m[0] - more * depth_m[0]
    return Profiles(
        up_m, np.log1p(np.maximum(more, -MOST_STEEP)), np.append(change_J / loss_J, of_stiffness)
    )


def _white_noise_m(scene: Scene, each_N: np.ndarray) -> float:
    """Return the standard deviation of white noise below contacts; infinite where they are few."""
    caps, at = scene.caps, np.flatnonzero(scene.use)
    long_m = contact_radius_m(each_N, scene.radius_m, scene.E_star_Pa) * ellipses_of(caps, at)[2]
    sides, squares_m2 = np.array(scene.surface.pixel_size_m), [np.zeros(0)]
    for j in np.flatnonzero(each_N > 0.0):
        apex = np.array((caps.y_m[at[j]], caps.x_m[at[j]])) / sides - 0.5
        reach = long_m[j] / sides + ORDER // 2
        top, left = np.maximum(np.floor(apex - reach).astype(int), 0)
        bottom, right = np.maximum(np.ceil(apex + reach).astype(int) + 1, 0)
        near_m = scene.surface[top:bottom, left:right]
        rows, columns = (even_lines(n, min(near_m.shape) // LINES) for n in near_m.shape)
        lines_m = near_m[:, columns], near_m[rows].T
        squares_m2 += [white_m2(along_m, ORDER, 0).ravel() for along_m in lines_m]
    square_m2 = np.concatenate(squares_m2)
    known_m2 = square_m2[np.isfinite(square_m2)]
    return math.sqrt(float(np.median(known_m2)) / MEDIAN) if known_m2.size else math.inf


def _below(scene: Scene, each_N: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean heights beside the caps below their contacts, and depths of these, (k, n).

    The heights are NaN where the map does not know all of a contact, and without one.
    """
    caps, at = scene.caps, np.flatnonzero(scene.use)
    ratio, k, longer, turn = ellipses_of(caps, at)
    long_m = contact_radius_m(each_N, scene.radius_m, scene.E_star_Pa) * longer
    mean_m = scene.radius_m / elliptic_factor(ratio)
    root = np.sqrt(ratio)
    depth_m = long_m**2 * (1.0 / root + k**2 * root) / (6.0 * mean_m)
    height_m = np.full(long_m.shape, np.nan)
    for j in np.flatnonzero(each_N[0] > 0.0):
        i = at[j]
        axes_m = np.stack((long_m[:, j], k[j] * long_m[:, j]))
        place = caps.x_m[i], caps.y_m[i], turn[j]
        found_m = _means_m(scene, axes_m, *place)
        height_m[:, j] = found_m - (caps.peak_height_m[i] - depth_m[:, j])
    return np.where(each_N > 0.0, height_m, np.nan), depth_m


def _means_m(scene: Scene, axes_m: np.ndarray, x_m: float, y_m: float, turn: float) -> np.ndarray:
    """Return the means of the heights below ellipses under the pressure of a punch, shape (k,).

    NaN where a point was not measured, or lies beyond the edge of all that was.
    """
    from scipy.ndimage import map_coordinates

    surface = scene.surface
    dy_m, dx_m = surface.pixel_size_m
    u, weight = np.polynomial.legendre.leggauss(RINGS)
    out = np.sqrt(1.0 - (0.5 * (u + 1.0)) ** 2)  # of the rings, of equal load each
    around = 2.0 * np.pi * (np.arange(ROUND) + 0.5) / ROUND
    along_m, across_m = axes_m[:, :, None, None] * (
        out[:, None] * np.stack((np.cos(around), np.sin(around)))[:, None, None]
    )
    col = (x_m + np.cos(turn) * along_m - np.sin(turn) * across_m) / dx_m - 0.5
    row = (y_m + np.sin(turn) * along_m + np.cos(turn) * across_m) / dy_m - 0.5
    near = []
    for one, known in zip((row, col), surface.measured_window, strict=True):
        if one.min() < known.start or one.max() > known.stop - 1:
            return np.full(len(along_m), np.nan)
        first = max(int(one.min()) - BESIDE, known.start)
        near.append(slice(first, min(int(one.max()) + BESIDE + 2, known.stop)))
    top, left = (one.start for one in near)
    near_m = surface[near[0], near[1]]
    heights_m = map_coordinates(near_m, [row - top, col - left], order=3)
    return np.asarray(heights_m.mean(axis=2) @ (0.5 * weight))
