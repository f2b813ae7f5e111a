"""Apex and radius from a quadric through all points within the depth of the fit.

The apex must stay on the hill, and within a tenth of the depth of that of the crown. Where it does
not, the cap is the one by volume, with a flag.
"""

import numpy as np

from capslip.caps.apex import on_hill
from capslip.caps.fitting import Fit, FitInput, Spheres
from capslip.caps.spheres import radius_by_quadric, spheres_by_volume

APEX_TOLERANCE = 0.1  # of the depth of the fit


def _spheres(given: FitInput) -> Spheres:
    crown, body, quadric = spheres_by_volume(given), given.body, given.body.quadric
    vertex_m = np.where(quadric.exists, quadric.z_m, np.inf)
    stayed = np.abs(vertex_m - crown.apex_m) <= APEX_TOLERANCE * body.depth_m
    stayed &= on_hill(given.surface, given.hills, quadric)
    x_m = np.where(stayed, quadric.x_m, crown.x_m)
    y_m = np.where(stayed, quadric.y_m, crown.y_m)
    radius_m, radius_se_m, covariance_m2 = radius_by_quadric(body, x_m, y_m)
    return Spheres(
        x_m=x_m,
        y_m=y_m,
        apex_m=np.where(stayed, quadric.z_m, crown.apex_m),
        apex_se_m=np.where(stayed, body.scatter_m * quadric.height_gain(x_m, y_m), crown.apex_se_m),
        on_surface=stayed,
        radius_m=np.where(stayed, radius_m, crown.radius_m),
        radius_se_m=np.where(stayed, radius_se_m, crown.radius_se_m),
        covariance_m2=np.where(stayed, covariance_m2, crown.covariance_m2),
    )


FIT = Fit(
    spheres=_spheres,
    label="quadric by least squares",
    colour="#56B4E9",
    marker="D",
    depth_share=1.0,
)
