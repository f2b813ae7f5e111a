"""The paper's rule: df is the hill's highest point above the cut, D the width of the hill there.

D is the diameter of the circle that has the area of the hill at the cut, and R follows from
Eq. 18 of Peyret, Chevallier and Dion 2016. Noise lifts the highest point, and with it the cap.
"""

import numpy as np

from capslip.caps.fitting import Fit, FitInput, Spheres
from capslip.caps.spheres import lattice_error


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


def _spheres(given: FitInput) -> Spheres:
    apexes, count = given.apexes, given.points.count
    x_m, y_m, apex_m = apexes.highest_m
    height_m = apex_m - given.hills.cut_height_m
    height_m = np.where(height_m > 0.0, height_m, np.nan)
    radius_m = equation18_radius_m(given.diameter_m, height_m)
    pixels = lattice_error(np.maximum(count, 1), given.surface.pixel_size_m, power=0)
    return Spheres(
        x_m=x_m,
        y_m=y_m,
        apex_m=apex_m,
        apex_se_m=apexes.highest_se_m,
        on_surface=np.ones(len(x_m), dtype=bool),
        radius_m=radius_m,
        radius_se_m=radius_m * np.hypot(apexes.highest_se_m / height_m, pixels),
        covariance_m2=-radius_m / height_m * apexes.highest_se_m**2,
    )


FIT = Fit(
    spheres=_spheres,
    label="Eq. 18, highest point and area at the cut",
    colour="#D55E00",
    marker="s",
    depth_share=1.0,
    at_cut_alone=True,
)
