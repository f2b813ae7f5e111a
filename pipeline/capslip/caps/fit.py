"""Spherical caps fitted to hills, all hills at once."""

from dataclasses import dataclass, replace

import numpy as np

from capslip.caps.apex import find_apexes
from capslip.caps.body import body_of_hills
from capslip.caps.fitting import Fit, FitInput, Spheres, fit_named
from capslip.caps.flags import flags_of_caps
from capslip.caps.hills import Hills
from capslip.caps.noise import Noise, noise_on_hills
from capslip.caps.points import HillPoints, points_of_hills
from capslip.caps.profile import quartic_profile, rms_from_sphere_m
from capslip.caps.table import CapFlag, CapTable
from capslip.errors import SettingsError
from capslip.surface.heightmap import HeightMap


def fit_caps(
    surface: HeightMap,
    hills: Hills,
    fit: str,
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
    fit : str
        A file of `capslip.caps.fits`, which says what it does.
    depth_m : array_like, shape (n,), optional
        Depth below the apex down to which each hill is fitted; NaN leaves it to the fit, which
        takes a share of the cap's height, and more where there is noise. Held between what the
        noise and the pixels allow and the cut; the column `fit_depth_m` has the depths used. A fit
        that knows the cut alone takes no other depth.
    points : HillPoints, optional
        What `points_of_hills` returned for the same map and hills, to save gathering it again.

    Returns
    -------
    CapTable
        One row a hill. Loads and contact radii are NaN, families empty. `radius_m` is the radius
        that Hertz theory wants: elliptic caps have sqrt(R1 R2) times `elliptic_factor`, unless the
        fit knows the cut alone. Where the edge or a patch of non-measured points cuts a cap within
        the depth, its radius comes from the quadric through what is there, or from the fit.

    Raises
    ------
    SettingsError
        If `fit` is unknown, or the depths are not one for each hill, positive or NaN.

    Notes
    -----
    Standard errors follow from the scatter of the points about the quadric and from the correlation
    of the noise. They say nothing of how far a hill is from a sphere: the residual does.
    """
    return fit_spheres(surface, hills, fit, depth_m, points).table


@dataclass(frozen=True, eq=False)
class Fitted:
    """Spheres of the hills, shape (n,), and all that a table of caps tells of them."""

    fit: Fit
    given: FitInput
    spheres: Spheres  # without radius where there is no usable one

    @property
    def usable(self) -> np.ndarray:
        """Mask of the hills that have a sphere, as of the table."""
        return ~np.isnan(self.spheres.radius_m)

    @property
    def table(self) -> CapTable:
        """The caps."""
        quartic_m, profile_residual_m = quartic_profile(self.given, self.spheres)
        profile = {"quartic_m": quartic_m, "profile_residual_m": profile_residual_m}
        return self.counted.with_columns(**profile)

    @property
    def counted(self) -> CapTable:
        """The caps without the profiles of their hills, which only contact asks for."""
        return _table(self.fit, self.given, self.spheres)


def fit_spheres(
    surface: HeightMap,
    hills: Hills,
    fit: str,
    depth_m: np.ndarray | None = None,
    points: HillPoints | None = None,
    noise: Noise | None = None,
) -> Fitted:
    """Fit one sphere to each hill; its flags and how well it fits wait until they are asked for.

    Parameters and errors are those of `fit_caps`; `noise` is what `noise_on_hills` returned for the
    same map and hills, to save measuring it again.
    """
    chosen, n = fit_named(fit), hills.n_hills
    depth_m = np.full(n, np.nan) if depth_m is None else np.asarray(depth_m, dtype=float)
    if depth_m.shape != (n,) or not (np.isnan(depth_m) | (depth_m > 0.0)).all():
        raise SettingsError(
            f"depth_m: shape {depth_m.shape}, least {np.min(depth_m, initial=np.inf):g}; expected "
            f"{n} depths > 0, one for each hill, NaN where the fit shall choose"
        )
    if chosen.at_cut_alone:
        depth_m = np.full(n, np.nan)
    points = points or points_of_hills(surface, hills)
    noise = noise or noise_on_hills(surface, points)
    apexes = find_apexes(surface, hills, points, noise, depth_m)
    body = body_of_hills(hills.cut_height_m, points, apexes, noise, depth_m, chosen.depth_share)
    given = FitInput(surface, hills, points, noise, apexes, body, chosen.edge_of_face)
    spheres = chosen.spheres(given)
    # No sphere where there is no height above the cut, or no positive radius
    usable = (spheres.apex_m > hills.cut_height_m) & (spheres.radius_m > 0.0)
    radius_m = np.where(usable, spheres.radius_m, np.nan)
    radius_se_m = np.where(np.isfinite(radius_m), spheres.radius_se_m, np.nan)
    return Fitted(chosen, given, replace(spheres, radius_m=radius_m, radius_se_m=radius_se_m))


def _table(fit: Fit, given: FitInput, spheres: Spheres) -> CapTable:
    cap_height_m = np.fmax(spheres.apex_m - given.hills.cut_height_m, 0.0)
    radius_m = spheres.radius_m
    flags = flags_of_caps(given, spheres, cap_height_m)
    diameter_m = given.diameter_m
    if not fit.at_cut_alone:
        part = (flags & (CapFlag.edge | CapFlag.non_measured).value) > 0
        whole_m = np.sqrt(np.maximum(cap_height_m * (2.0 * radius_m - cap_height_m), 0.0))
        diameter_m = np.where(part & np.isfinite(radius_m), 2.0 * whole_m, diameter_m)
    apex_se_m, radius_se_m, covariance_m2 = _errors_with_tops(given, spheres)
    with np.errstate(divide="ignore", invalid="ignore"):  # an error of zero has nothing in common
        correlation = np.clip(covariance_m2 / (apex_se_m * radius_se_m), -1.0, 1.0)
    n, quadric = len(radius_m), given.body.quadric
    return CapTable(
        x_m=spheres.x_m,
        y_m=spheres.y_m,
        peak_height_m=spheres.apex_m,
        cap_height_m=cap_height_m,
        diameter_m=diameter_m,
        radius_m=radius_m,
        area_m2=given.area_m2,
        residual_m=rms_from_sphere_m(given, spheres),
        family=np.full(n, "", dtype="<U1"),
        load_N=np.full(n, np.nan),
        contact_radius_m=np.full(n, np.nan),
        flags=flags,
        radius_se_m=radius_se_m,
        peak_height_se_m=apex_se_m,
        peak_radius_correlation=correlation,
        radius_major_m=1.0 / quadric.curvature_per_m[0],
        radius_minor_m=1.0 / quadric.curvature_per_m[1],
        orientation_rad=quadric.orientation_rad,
        fit_depth_m=given.body.depth_m,
        parent_region=given.hills.parent_region,
    )


def _errors_with_tops(
    given: FitInput, spheres: Spheres
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the standard errors of apex and radius, and their covariance, with those of tops.

    The error of a top that was put back counts in the radius for its share of what was fitted; a
    top that is higher is sharper.
    """
    tops, radius_m = given.surface.tops, spheres.radius_m
    if tops is None:
        return spheres.apex_se_m, spheres.radius_se_m, spheres.covariance_m2
    height_se_m, log_radius_se, area_m2 = tops.errors_at(spheres.x_m, spheres.y_m)
    with np.errstate(divide="ignore", invalid="ignore"):  # a hill without sphere or depth
        share = np.fmin(area_m2 / (2.0 * np.pi * radius_m * given.body.depth_m), 1.0)
    of_top_m = radius_m * log_radius_se * np.nan_to_num(share)
    apex_se_m, radius_se_m = spheres.apex_se_m, spheres.radius_se_m
    covariance_m2 = spheres.covariance_m2 - height_se_m * of_top_m
    return np.hypot(apex_se_m, height_se_m), np.hypot(radius_se_m, of_top_m), covariance_m2
