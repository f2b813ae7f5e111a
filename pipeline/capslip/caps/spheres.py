"""Spheres by the volume of a hill below its apex, or by the curvature of its quadric."""

import math

import numpy as np

from capslip.caps.body import Body
from capslip.caps.fitting import FitInput, Spheres

RIDGE_RATIO = 10.0  # of the principal radii
LONGEST = 100.0  # such ratio that the summit of a hill is taken to keep up over its whole contact
# Of the outline of a cap, along other hills: a chord of 2 pi a s with sin(u) = pi s leaves out
# 0.17 u^5 of a crown, 0.06 % at the first and 2 % at the second, from where on its volume says less
# than the quadric through what is there
LITTLE_CUT, MUCH_CUT = 0.1, 0.2
WAVES = 8  # of the pixels along each axis, of which a lattice sum takes the discs' share
MOST_HIDDEN = 2.0  # times the radius by volume: a hill beside the apex hides less than half a crown


def spheres_by_volume(given: FitInput) -> Spheres:
    """Return the spheres at the apexes of the crowns that have the volumes of the hills.

    Where a patch of non-measured points cuts a cap within the depth, or the edge where it is not
    that of the face, the radius comes from the quadric through what is there. The more of its
    outline lies along other hills, too, the more it counts: a level is found on what does not jump.
    """
    body, edge_of_face = given.body, given.edge_of_face
    x_m, y_m, apex_m = given.apexes.apex_m
    apex_se_m = given.apexes.apex_se_m
    radius_m, radius_se_m, covariance_m2 = _radius_by_volume(given)
    if edge_of_face:
        radius_m = radius_m * _edge_factor(given, radius_m)
    cut = body.at_patch | (body.at_edge & (not edge_of_face))
    beside = np.clip((body.beside_hills - LITTLE_CUT) / (MUCH_CUT - LITTLE_CUT), 0.0, 1.0)
    surface_m, surface_se_m, surface_m2 = radius_by_quadric(body, x_m, y_m)
    # A hill that is no cap has a quadric that is next to flat
    within = np.where(cut, 1.0, np.fmin(MOST_HIDDEN * radius_m / surface_m, 1.0))
    part = np.where(body.quadric.exists, np.where(cut, 1.0, beside), 0.0)

    def mixed(by_volume: np.ndarray, by_quadric: np.ndarray) -> np.ndarray:
        found = np.where(part > 0.0, part * within * by_quadric, 0.0)
        return found + np.where(part < 1.0, (1.0 - part) * by_volume, 0.0)

    return Spheres(
        x_m=x_m,
        y_m=y_m,
        apex_m=apex_m,
        apex_se_m=apex_se_m,
        on_surface=given.apexes.on_surface,
        radius_m=mixed(radius_m, surface_m),
        radius_se_m=mixed(radius_se_m, surface_se_m),
        covariance_m2=mixed(covariance_m2, surface_m2),
    )


def radius_by_quadric(
    body: Body, x_m: np.ndarray, y_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the radius that Hertz theory wants of each quadric, and its standard error.

    And the covariance of that error with the error of an apex at (x, y), by a quadric through the
    same points or some of them: as least squares have the least variance, what an estimate from
    some of the points has in common with that from all is all that the latter errs by.
    """
    quadric = body.quadric
    radius_m = _elliptic_factor(body) / np.sqrt(quadric.curvature_per_m.prod(axis=0))
    common = -quadric.height_and_curvature_gain(x_m, y_m) * body.scatter_m**2
    return radius_m, radius_m * quadric.curvature_gain * body.scatter_m, radius_m * common


def elliptic_factor(radius_ratio: np.ndarray) -> np.ndarray:
    """Radius of the sphere that Hertz loads like an elliptic cap, over sqrt(R1 R2).

    A cap of principal radii R1 >= R2 follows N = 4/3 E* sqrt(R) d^1.5 with R = sqrt(R1 R2) / F2^3
    (Johnson 1985, Contact Mechanics, Sec. 4.2; F2 is made of elliptic integrals).

    Parameters
    ----------
    radius_ratio : array_like
        R1 / R2.

    Notes
    -----
    1 + y^2/24.1 + y^4/3040 + y^6/307700 with y = ln(R1/R2) replaces the integrals to 0.03 % up to
    R1/R2 = 1000.

    Examples
    --------
    >>> elliptic_factor(np.array([1.0, 2.0, 10.0])).round(3)
    array([1.  , 1.02, 1.23])
    """
    square = np.log(radius_ratio) ** 2
    return 1.0 + square / 24.085 + square**2 / 3041.0 + square**3 / 307700.0


def edge_factor(inside: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Radius that loads like a cap at the edge of the face, over that of its volume.

    Contact ends with the material, and yields less than the same contact inside the face: half a
    sphere loads like one of 0.60 R, a quarter in a corner like one of 0.32 R. Fitted to
    boundary-element solutions for spheres whose apex lies inside or outside an edge, to 1 % of R,
    or of both edges of a corner, to 5 %.

    Parameters
    ----------
    inside : float64, shape (2, n)
        Distance of each apex from the nearer edge along y and along x, over sqrt(2 R t) with the
        radius by volume R and the fitted depth t; one or more where no edge is near.
    outside : float64, shape (2, n)
        Distance by which the vertex of the whole cap lies beyond it, over the same with R from the
        curvatures; 0 inside.

    Examples
    --------
    >>> edge_factor(np.array([[0.0, 0.0], [1.0, 0.0]]), np.zeros((2, 2))).round(3)
    array([1.2  , 1.283])
    """
    lost = np.clip(1.0 - inside, 0.0, 1.0) ** 2.2 + 2.8 * np.minimum(outside, 1.0)
    return 1.0 + 0.2 * np.hypot(*lost)


def lattice_error(points: np.ndarray, pixel_size_m: tuple[float, float], power: int) -> np.ndarray:
    """Return by how much sums over pixels miss integrals over discs that lie anywhere, rms.

    Relative, of (1 - r^2 / rho^2)^power over a disc of radius rho: its area (0), a cap (1).

    Parameters
    ----------
    points : float64, shape (n,)
        Pixels on each disc, 1 at least.
    pixel_size_m : (float, float)
        (dy, dx).
    power : int
        Of the function.

    Notes
    -----
    By Poisson's sum the error is that of the waves k of the lattice: over the integral, with
    z = 2 pi |k| rho and q = power + 1, it is 2^q q! J_q(z) / z^q of each, at phases of any kind,
    and J_q^2 is 1 / (pi z) in the mean.

    Examples
    --------
    >>> lattice_error(np.array([100 * np.pi]), (1.0, 1.0), 0).round(5)
    array([0.00655])
    >>> lattice_error(np.array([100 * np.pi]), (1.0, 1.0), 1).round(5)
    array([0.00033])
    """
    q, aspect = power + 1, pixel_size_m[0] / pixel_size_m[1]
    wave = np.arange(-WAVES, WAVES + 1.0)
    square = wave**2 * aspect + wave[:, None] ** 2 / aspect  # k^2 times the area of a pixel
    total = float((square[square > 0.0] ** -(q + 0.5)).sum())
    of_one = 2.0**q * math.factorial(q) / math.sqrt(math.pi) * (2.0 * math.pi) ** -(q + 0.5)
    return np.asarray(of_one * math.sqrt(total) * (points / math.pi) ** -(0.5 * q + 0.25))


def _radius_by_volume(given: FitInput) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radius of the sphere that has the volume V above the level: V = pi t^2 (R - t/3).

    Noise that crosses the level adds half of its variance times the growth of the area, pi R
    sigma^2. An error of the apex moves the level with it and counts double; the mean error m of
    the points within the cap, which both share, does not count::

        d log R = -2 (dz - m) / t,  <m dz> = <m^2> = sigma^2 / points

    The latter as the apex is a weighted mean of some of these points. So the covariance of dz and
    d log R is -t / 2 times the variance of d log R. Of a quadric through n points of a whole disc
    the variances of dz, d log R are 4 sigma^2 / n, 12 sigma^2 / (n t^2), the correlation -0.87.
    """
    body, apex_se_m = given.body, given.apexes.apex_se_m
    t = np.where(body.depth_m > 0.0, body.depth_m, np.nan)
    radius_m = body.volume_m3 / (np.pi * (t**2 + given.noise.rms_m**2)) + t / 3.0
    points = np.maximum(np.pi * radius_m * 2.0 * t / given.surface.pixel_area_m2, 1.0)
    scatter_m = np.fmax(body.scatter_m, 0.0)
    own_m2 = np.maximum(apex_se_m**2 - scatter_m**2 / points, 0.0)  # of the apex alone
    apex = 2.0 / t * np.sqrt(own_m2)
    pixels = lattice_error(points, given.surface.pixel_size_m, power=1)
    radius_m = _elliptic_factor(body) * radius_m
    return radius_m, radius_m * np.hypot(apex, pixels), -2.0 / t * radius_m * own_m2


def _elliptic_factor(body: Body) -> np.ndarray:
    """Return the factor where the whole ellipse was seen, 1 elsewhere."""
    whole = ~body.at_edge & body.quadric.exists
    ratio = np.where(whole, np.minimum(body.radius_ratio, LONGEST), 1.0)
    return elliptic_factor(ratio)


def _edge_factor(given: FitInput, radius_m: np.ndarray) -> np.ndarray:
    """Return the factor where the edge of the face cuts the cap, 1 elsewhere."""
    body, quadric = given.body, given.body.quadric
    place_m, vertex_m = given.apexes.apex_m[1::-1], np.stack([quadric.y_m, quadric.x_m])
    reach_m = np.sqrt(2.0 * np.where(radius_m > 0.0, radius_m, np.nan) * body.depth_m)
    slope_m = np.sqrt(2.0 * body.depth_m / np.sqrt(quadric.curvature_per_m.prod(axis=0)))
    begin_m, end_m = _ends_m(given)
    inside = np.fmin(np.minimum(place_m - begin_m, end_m - place_m) / reach_m, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):  # a hill without height
        outside = np.fmax(np.maximum(begin_m - vertex_m, vertex_m - end_m) / slope_m, 0.0)
    return np.where(body.at_edge, edge_factor(inside, outside), 1.0)


def _ends_m(given: FitInput) -> tuple[np.ndarray, np.ndarray]:
    """Return where the face begins and ends along y and along x of each apex, shape (2, n) each.

    On its column and on its row: at the edge of the map, or at what is outside of the face.
    """
    surface, (x_m, y_m, _) = given.surface, given.apexes.apex_m
    begin_m = np.zeros((2, x_m.size))
    end_m = begin_m + np.array(surface.side_m)[:, None]
    if surface.ends_within:
        cut = np.flatnonzero(given.body.at_edge)
        row, col = surface.pixel_at(x_m[cut], y_m[cut])
        lines = (surface.outside[:, col].T, row), (surface.outside[row], col)
        for axis, (outside, at) in enumerate(lines):
            place, size_m = np.arange(surface.shape[axis]), surface.pixel_size_m[axis]
            before, after = (outside & (sign * (place - at[:, None]) > 0) for sign in (-1, 1))
            begin_m[axis, cut] = size_m * np.where(before, place + 1, 0).max(axis=1)
            end_m[axis, cut] = size_m * np.where(after, place, place.size).min(axis=1)
    return begin_m, end_m
