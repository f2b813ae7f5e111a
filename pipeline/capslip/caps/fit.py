"""Spherical caps fitted to hills, all hills at once."""

from dataclasses import dataclass

import numpy as np

from capslip.caps.apex import Apexes, find_apexes, on_hill
from capslip.caps.hills import Hills
from capslip.caps.noise import Noise, noise_on_hills
from capslip.caps.points import LIMIT_EDGE, LIMIT_PATCH, HillPoints, points_of_hills
from capslip.caps.quadric import MIN_POINTS, Quadrics, fit_quadrics
from capslip.caps.table import CapFlag, CapTable
from capslip.errors import SettingsError
from capslip.surface.heightmap import HeightMap

FITS = ("equation18", "pinned", "least_squares", "contact")
CONTACT_SHARE = 0.5  # of its own compression, at which `contact` wants each cap fitted
NEGLIGIBLE_NOISE = 1e-3  # of the depth of the fit
NOISY_APEX_RATIO = 0.1  # noise over cap height
APEX_TOLERANCE = 0.1  # of the depth of the fit
RIDGE_RATIO = 10.0  # of the principal radii
FILLED_ELLIPSE = 0.8  # share of the ellipse of their second moments that the points of a cap fill
PLATEAU_SHARE = 0.01  # of a hill's points that share the greatest height; and more than four
OUTLIER_SPREADS = 5.0  # robust standard deviations of ln R, and a factor of three
DEEP_NOISE = 20.0  # standard deviations of the noise: depth that a fit takes where there is as much


def equation18_radius_m(diameter_m: np.ndarray, cap_height_m: np.ndarray) -> np.ndarray:
    """Radius of a spherical cap from its base and height: R = (D^2/4 + df^2) / (2 df).

    Parameters
    ----------
    diameter_m, cap_height_m : array_like, any equal shape
        D and df, both positive.

    Notes
    -----
    Equation 18 of Peyret, Chevallier and Dion 2016. Written as a sum of two quotients it loses no
    digit where df << D.

    Examples
    --------
    >>> round(float(equation18_radius_m(18e-3, 1.7e-6)), 2)
    23.82
    """
    diameter_m, cap_height_m = np.asarray(diameter_m), np.asarray(cap_height_m)
    return diameter_m**2 / (8.0 * cap_height_m) + cap_height_m / 2.0


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
    1 + y^2/24 + y^4/3000 with y = ln(R1/R2) replaces the integrals to 0.1 % up to R1/R2 = 20.

    Examples
    --------
    >>> elliptic_factor(np.array([1.0, 2.0, 10.0])).round(3)
    array([1.  , 1.02, 1.23])
    """
    square = np.log(radius_ratio) ** 2
    return 1.0 + square / 24.0 + square**2 / 3000.0


def fit_caps(
    surface: HeightMap,
    hills: Hills,
    fit: str = "pinned",
    depth_m: np.ndarray | None = None,
    points: HillPoints | None = None,
) -> CapTable:
    """Fit one cap to each hill.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    hills : Hills
        Labelled hills of the same map.
    fit : {"equation18", "pinned", "least_squares", "contact"}
        `equation18` is the paper's rule: df is the hill's highest point above the cut, D the
        diameter of the circle that has the area of the hill.

        `pinned` takes the apex from a quadric through the top of the hill, which noise does not
        lift, and the radius of the sphere that has the volume of the hill within `depth_m` of it.
        That is Eq. 18 averaged over all cuts down to there.

        `least_squares` takes both from a quadric through all points within `depth_m`. Its apex must
        stay on the hill, and within a tenth of `depth_m` of the pinned one; where it does not, the
        cap is the pinned one, with a flag.

        `contact` is `pinned`, with the edge of the map taken as the edge of the face: a cap that
        it cuts gets the radius of the sphere that loads like what is there. Meant to be called
        again with `depth_m` = CONTACT_SHARE of the compression that contact found for each cap.
    depth_m : array_like, shape (n,), optional
        Depth below the apex down to which each hill is fitted; NaN leaves it to the fit, which
        takes half of the cap's height, and more where there is noise (`least_squares`: all of it).
        Held between what the noise and the pixels allow and the cut; the column `fit_depth_m` has
        the depths used. `equation18` knows no depth but the cut.
    points : HillPoints, optional
        What `points_of_hills` returned for the same map and hills, to save gathering it again.

    Returns
    -------
    CapTable
        One row a hill. Loads and contact radii are NaN, families empty. `radius_m` is the radius
        that Hertz theory wants: elliptic caps have sqrt(R1 R2) times `elliptic_factor`, except by
        `equation18`. Where the edge or a patch of non-measured points cuts a cap within the depth,
        its radius comes from the quadric through what is there (`contact`: see above).

    Raises
    ------
    SettingsError
        If `fit` is unknown, or the depths are not one for each hill, positive or NaN.

    Notes
    -----
    Standard errors follow from the scatter of the points about the quadric and from the correlation
    of the noise. They say nothing of how far a hill is from a sphere: the residual does.
    """
    if fit not in FITS:
        raise SettingsError(f"caps.fit: got {fit!r}; expected one of {', '.join(FITS)}")
    n = hills.n_hills
    depth_m = np.full(n, np.nan) if depth_m is None else np.asarray(depth_m, dtype=float)
    if depth_m.shape != (n,) or not (np.isnan(depth_m) | (depth_m > 0.0)).all():
        raise SettingsError(
            f"depth_m: shape {depth_m.shape}, least {np.min(depth_m, initial=np.inf):g}; expected "
            f"{n} depths > 0, one for each hill, NaN where the fit shall choose"
        )
    return _fit(surface, hills, fit, depth_m, points or points_of_hills(surface, hills))


@dataclass(frozen=True, eq=False)
class _Body:
    """What of each hill lies within the depth of its fit, shape (n,)."""

    depth_m: np.ndarray
    volume_m3: np.ndarray
    at_edge: np.ndarray  # whether the edge of the map cuts it
    at_patch: np.ndarray  # whether non-measured points do
    scattered: np.ndarray  # whether its points lie in several places
    quadric: Quadrics
    scatter_m: np.ndarray  # standard deviation of its points that is fit for errors of means

    @property
    def radius_ratio(self) -> np.ndarray:
        """R1 / R2, NaN where the quadric has no vertex."""
        return self.quadric.curvature_per_m[1] / self.quadric.curvature_per_m[0]


def _fit(
    surface: HeightMap, hills: Hills, fit: str, depth_m: np.ndarray, points: HillPoints
) -> CapTable:
    noise = noise_on_hills(surface, points)
    apexes = find_apexes(surface, hills, points, noise)
    area_m2 = surface.pixel_area_m2 * points.count
    diameter_m = 2.0 * np.sqrt(area_m2 / np.pi)
    body = _body(surface, hills, fit, depth_m, points, apexes, noise)
    x_m, y_m, apex_m = apexes.highest_m if fit == "equation18" else apexes.apex_m
    apex_se_m = apexes.apex_se_m
    on_surface = apexes.on_surface
    if fit == "equation18":
        on_surface, apex_se_m = np.ones_like(on_surface), apexes.highest_se_m
        radius_m, radius_se_m = _radius_by_area(
            diameter_m, apex_m - hills.cut_height_m, apex_se_m, points.count
        )
    else:
        radius_m, radius_se_m = _radius_by_volume(surface, noise.rms_m, body, apex_se_m)
        if fit == "contact":
            radius_m = radius_m * _edge_factor(surface, x_m, y_m, radius_m, body)
        by_quadric = body.at_patch | (body.at_edge & (fit != "contact"))
        if fit == "least_squares":
            vertex_m = np.where(body.quadric.exists, body.quadric.z_m, np.inf)
            stayed = np.abs(vertex_m - apex_m) <= APEX_TOLERANCE * body.depth_m
            stayed &= on_hill(surface, hills, body.quadric)
            x_m = np.where(stayed, body.quadric.x_m, x_m)
            y_m = np.where(stayed, body.quadric.y_m, y_m)
            apex_m = np.where(stayed, body.quadric.z_m, apex_m)
            vertex_se_m = body.scatter_m * body.quadric.height_gain(x_m, y_m)
            apex_se_m = np.where(stayed, vertex_se_m, apex_se_m)
            on_surface, by_quadric = stayed, by_quadric | stayed
        by_quadric &= body.quadric.exists
        surface_m, surface_se_m = _radius_by_quadric(body)
        radius_m = np.where(by_quadric, surface_m, radius_m)
        radius_se_m = np.where(by_quadric, surface_se_m, radius_se_m)

    cap_height_m = np.fmax(apex_m - hills.cut_height_m, 0.0)
    radius_m = np.where((cap_height_m > 0.0) & (radius_m > 0.0), radius_m, np.nan)
    flags = _flags(noise.rms_m, points, apexes, body, on_surface, cap_height_m, radius_m, apex_se_m)
    if fit != "equation18":
        part = (flags & (CapFlag.edge | CapFlag.non_measured).value) > 0
        whole_m = np.sqrt(np.maximum(cap_height_m * (2.0 * radius_m - cap_height_m), 0.0))
        diameter_m = np.where(part & np.isfinite(radius_m), 2.0 * whole_m, diameter_m)
    quartic_m, profile_residual_m = _profile(points, x_m, y_m, apex_m, radius_m, body)
    return CapTable(
        x_m=x_m,
        y_m=y_m,
        peak_height_m=apex_m,
        cap_height_m=cap_height_m,
        diameter_m=diameter_m,
        radius_m=radius_m,
        area_m2=area_m2,
        residual_m=_residual(points, x_m, y_m, apex_m, radius_m, body.depth_m),
        family=np.full(len(x_m), "", dtype="<U1"),
        load_N=np.full(len(x_m), np.nan),
        contact_radius_m=np.full(len(x_m), np.nan),
        flags=flags,
        radius_se_m=np.where(np.isfinite(radius_m), radius_se_m, np.nan),
        peak_height_se_m=apex_se_m,
        radius_major_m=1.0 / body.quadric.curvature_per_m[0],
        radius_minor_m=1.0 / body.quadric.curvature_per_m[1],
        orientation_rad=body.quadric.orientation_rad,
        fit_depth_m=body.depth_m,
        quartic_m=quartic_m,
        profile_residual_m=profile_residual_m,
        parent_region=hills.parent_region,
    )


def _body(
    surface: HeightMap,
    hills: Hills,
    fit: str,
    depth_m: np.ndarray,
    points: HillPoints,
    apexes: Apexes,
    noise: Noise,
) -> _Body:
    n, noise_m = points.n_hills, noise.rms_m
    height_m = np.fmax(apexes.apex_m[2] - hills.cut_height_m, 0.0)
    own_m = np.maximum(0.5 * height_m, np.minimum(DEEP_NOISE * noise_m, height_m - 3.0 * noise_m))
    if fit in ("equation18", "least_squares"):
        own_m = height_m
    depth_m = np.where(np.isnan(depth_m), own_m, np.maximum(depth_m, apexes.least_depth_m))
    depth_m = np.minimum(depth_m, height_m)
    level_m = apexes.apex_m[2] - depth_m

    seen_m = np.maximum(level_m, apexes.floor_m)
    quadric = fit_quadrics(points, seen_m, apexes.apex_m)
    # points that stand in for lost ones count here
    filled_m2 = surface.pixel_area_m2 * np.bincount(
        points.hill[points.z_m >= np.repeat(seen_m, points.count)], minlength=n
    )
    scattered = filled_m2 < FILLED_ELLIPSE * 4.0 * np.pi * quadric.spread_m2
    if noise_m > NEGLIGIBLE_NOISE * np.max(depth_m, initial=0.0):
        quadric = fit_quadrics(points, seen_m, apexes.apex_m, quadric, noise_m)

    rise_m = points.z_m - np.repeat(level_m, points.count)
    above = np.flatnonzero(rise_m > 0.0)
    hill, limit = points.hill[above], points.limit[above]
    at_edge, at_patch = (
        np.bincount(hill[(limit & bit) > 0], minlength=n) > 0 for bit in (LIMIT_EDGE, LIMIT_PATCH)
    )
    return _Body(
        depth_m=depth_m,
        volume_m3=surface.pixel_area_m2 * np.bincount(hill, rise_m[above], n),
        at_edge=at_edge,
        at_patch=at_patch,
        scattered=scattered,
        quadric=quadric,
        scatter_m=np.fmax(quadric.residual_m, noise_m) * noise.inflation,
    )


def _radius_by_area(
    diameter_m: np.ndarray, cap_height_m: np.ndarray, apex_se_m: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    height_m = np.where(cap_height_m > 0.0, cap_height_m, np.nan)
    radius_m = equation18_radius_m(diameter_m, height_m)
    pixels = 0.2 * (np.maximum(points, 1) / np.pi) ** -0.75  # rms error of points in a circle
    return radius_m, radius_m * np.hypot(apex_se_m / height_m, pixels)


def _radius_by_volume(
    surface: HeightMap, noise_m: float, body: _Body, apex_se_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Radius of the sphere that has the volume V above the level: V = pi t^2 (R - t/3).

    Noise that crosses the level adds half of its variance times the growth of the area, pi R
    sigma^2. An error of the apex moves the level with it and counts double; the mean error of the
    points within the cap, which both share, does not count.
    """
    t = np.where(body.depth_m > 0.0, body.depth_m, np.nan)
    radius_m = body.volume_m3 / (np.pi * (t**2 + noise_m**2)) + t / 3.0
    points = np.maximum(np.pi * radius_m * 2.0 * t / surface.pixel_area_m2, 1.0)
    scatter_m = np.fmax(body.scatter_m, 0.0)
    apex = 2.0 / t * np.sqrt(np.maximum(apex_se_m**2 - scatter_m**2 / points, 0.0))
    pixels = 0.2 * (points / np.pi) ** -1.25  # rms error of a lattice sum over a paraboloid
    factor = _elliptic_factor(body)
    return factor * radius_m, factor * radius_m * np.hypot(apex, pixels)


def _radius_by_quadric(body: _Body) -> tuple[np.ndarray, np.ndarray]:
    quadric = body.quadric
    radius_m = _elliptic_factor(body) / np.sqrt(quadric.curvature_per_m.prod(axis=0))
    return radius_m, radius_m * quadric.curvature_gain * body.scatter_m


def _elliptic_factor(body: _Body) -> np.ndarray:
    """Return the factor where the whole ellipse was seen, 1 elsewhere."""
    whole = ~body.at_edge & body.quadric.exists
    ratio = np.where(whole, np.minimum(body.radius_ratio, RIDGE_RATIO), 1.0)
    return elliptic_factor(ratio)


def _edge_factor(
    surface: HeightMap, x_m: np.ndarray, y_m: np.ndarray, radius_m: np.ndarray, body: _Body
) -> np.ndarray:
    """Return the radius that loads like a cap at the edge of the face, over that of its volume.

    Contact ends with the material, and yields less than the same contact inside the face: half a
    sphere loads like one of 0.60 R, a quarter in a corner like one of 0.32 R. Fitted to
    boundary-element solutions for spheres whose apex lies inside or outside an edge, to 1 % of R,
    or of both edges of a corner, to 5 %. Lengths are in radii of the cut at the fitted depth.
    """
    quadric = body.quadric
    reach_m = np.sqrt(2.0 * np.where(radius_m > 0.0, radius_m, np.nan) * body.depth_m)
    slope_m = np.sqrt(2.0 * body.depth_m / np.sqrt(quadric.curvature_per_m.prod(axis=0)))
    cut = []
    for place_m, vertex_m, side_m in (
        (y_m, quadric.y_m, surface.side_m[0]),
        (x_m, quadric.x_m, surface.side_m[1]),
    ):
        inside = np.fmin(np.minimum(place_m, side_m - place_m) / reach_m, 1.0)
        outside = np.fmax(np.maximum(-vertex_m, vertex_m - side_m) / slope_m, 0.0)
        cut.append(np.clip(1.0 - inside, 0.0, 1.0) ** 2.2 + 2.8 * np.minimum(outside, 1.0))
    return np.where(body.at_edge, 1.0 + 0.2 * np.hypot(*cut), 1.0)


def _residual(
    points: HillPoints,
    x_m: np.ndarray,
    y_m: np.ndarray,
    apex_m: np.ndarray,
    radius_m: np.ndarray,
    depth_m: np.ndarray,
) -> np.ndarray:
    """Return the rms distance of the measured points within the depth from the sphere."""
    level_m = apex_m - depth_m
    chosen = np.flatnonzero(points.measured & (points.z_m >= np.repeat(level_m, points.count)))
    hill = points.hill[chosen]
    square_m2 = (points.x_m[chosen] - x_m[hill]) ** 2 + (points.y_m[chosen] - y_m[hill]) ** 2
    under_m = np.sqrt(np.maximum(radius_m[hill] ** 2 - square_m2, 0.0))
    sphere_m = apex_m[hill] - square_m2 / (radius_m[hill] + under_m)
    sums = np.bincount(hill, (points.z_m[chosen] - sphere_m) ** 2, points.n_hills)
    count = np.bincount(hill, minlength=points.n_hills)
    return np.sqrt(sums / np.maximum(count, 1))


def _profile(
    points: HillPoints,
    x_m: np.ndarray,
    y_m: np.ndarray,
    apex_m: np.ndarray,
    radius_m: np.ndarray,
    body: _Body,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the quartic term of each hill's profile, and the rms distance of its points from it.

    The profile is a least-squares c0 + c1 t + c2 t^2 in the elliptic coordinate t, the square of
    the distance from the apex by the curvatures of the quadric, one at the fitted depth. So an
    ellipsoid has neither term nor residual. NaN where there are too few points.
    """
    quadric = body.quadric
    curvature_per_m = np.where(quadric.exists, quadric.curvature_per_m, 1.0 / radius_m)
    cos, sin = np.cos(quadric.orientation_rad), np.sin(quadric.orientation_rad)
    cos, sin = np.where(quadric.exists, (cos, sin), 0.5**0.5)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.sqrt(0.5 * curvature_per_m / body.depth_m)
    hill = points.hill
    along, across = points.x_m - x_m[hill], points.y_m - y_m[hill]
    along, across = cos[hill] * along + sin[hill] * across, cos[hill] * across - sin[hill] * along
    t = (scale[0][hill] * along) ** 2 + (scale[1][hill] * across) ** 2
    chosen = np.flatnonzero(points.measured & (t <= 1.0))
    hill, t = hill[chosen], t[chosen]
    fall_m = apex_m[hill] - points.z_m[chosen]

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(hill, values, points.n_hills)

    count = np.bincount(hill, minlength=points.n_hills)
    basis = np.stack([np.ones_like(t), 2.0 * t - 1.0, 6.0 * t * (t - 1.0) + 1.0])
    normal = np.array([[total(one * other) for other in basis] for one in basis]).transpose(2, 0, 1)
    right = np.array([total(one * fall_m) for one in basis]).T
    known = (count >= MIN_POINTS) & (np.linalg.matrix_rank(normal, hermitian=True) == len(basis))
    c = np.full((3, points.n_hills), np.nan)
    c[:, known] = np.linalg.solve(normal[known], right[known][..., None])[..., 0].T
    square_m2 = total((fall_m - (c[:, hill] * basis).sum(axis=0)) ** 2)
    return 6.0 * c[2], np.sqrt(square_m2 / np.maximum(count, 1))


def _flags(
    noise_m: float,
    points: HillPoints,
    apexes: Apexes,
    body: _Body,
    on_surface: np.ndarray,
    cap_height_m: np.ndarray,
    radius_m: np.ndarray,
    apex_se_m: np.ndarray,
) -> np.ndarray:
    n, count = points.n_hills, points.count
    few = count < MIN_POINTS
    uncertain_m = np.fmax(noise_m, 2.0 * apex_se_m)
    conditions = {
        CapFlag.edge: _touching(points, LIMIT_EDGE),
        CapFlag.non_measured: _touching(points, LIMIT_PATCH),
        CapFlag.plateau: (apexes.ties > 4) & (apexes.ties > PLATEAU_SHARE * count),
        CapFlag.not_convex: np.isnan(radius_m),
        CapFlag.noisy_apex: uncertain_m > NOISY_APEX_RATIO * cap_height_m,
        CapFlag.apex_off_surface: ~on_surface,
        CapFlag.few_points: few,
        CapFlag.ridge: ~few & ~(np.nan_to_num(body.radius_ratio, nan=np.inf) <= RIDGE_RATIO),
        CapFlag.several_peaks: body.scattered,
        CapFlag.outlier: _outliers(radius_m),
    }
    flags = np.zeros(n, dtype=np.uint16)
    for name, condition in conditions.items():
        flags[condition] |= np.uint16(name.value)
    return flags


def _touching(points: HillPoints, limit: int) -> np.ndarray:
    return np.bincount(points.hill[(points.limit & limit) > 0], minlength=points.n_hills) > 0


def _outliers(radius_m: np.ndarray) -> np.ndarray:
    """Tell which radii lie far from the median, in their logarithm and by a robust spread."""
    known = np.isfinite(radius_m)
    if known.sum() < MIN_POINTS:
        return np.zeros(len(radius_m), dtype=bool)
    logarithm = np.log(np.where(known, radius_m, 1.0))
    distance = np.abs(logarithm - np.median(logarithm[known]))
    spread = 1.4826 * np.median(distance[known])
    return known & (distance > max(OUTLIER_SPREADS * spread, np.log(3.0)))
