"""Contacts so wide beside the radius of their caps that the laws of a half-space leave them.

A cap is a paraboloid on a half-space, and the hardness a number of the material: both need a small
contact radius a over the radius R of the cap, which is the slope of the face at the edge of the
contact. Without a hardness the pressure tells, `pressure_beyond_elastic`: it is 2 E* a / (pi R).
"""

from typing import Any

import numpy as np

from capslip.contact.accuracy import BEYOND_SHARE
from capslip.contact.press import ContactState
from capslip.problems import Effect, Problem, Severity
from capslip.surface.heightmap import HeightMap

# a / R: the pressure of full plasticity falls from about the first on (Jackson and Green 2005), by
# 8 % at the second; ISO 6506-1 takes no hardness of an indentation wider than the last, its d / D
FALLS, SMALLER, NONE = 0.1, 0.2, 0.6


def hardness_left(ratio: float) -> float:
    """Return the mean pressure of full plasticity at a / R over that of a small contact.

    Jackson and Green (2005), fitted to their finite elements of hemispheres.

    Examples
    --------
    >>> print(", ".join(f"{hardness_left(ratio):.2f}" for ratio in (0.05, 0.1, 0.2, 0.4)))
    1.00, 0.98, 0.92, 0.79
    """
    return float(-np.expm1(-0.82 * ratio**-0.7))


def problems_of_steep_caps(
    contact_radius_m: np.ndarray, radius_m: np.ndarray, load_N: np.ndarray
) -> list[Problem]:
    """Return whether contacts of caps are wide beside the radii that the caps had before any load.

    By the greatest a / R that more than a twentieth of the load exceeds: one small grain is no
    doubt about a face.
    """
    loaded = load_N > 0.0
    if not loaded.any():
        return []
    ratio = contact_radius_m[loaded] / radius_m[loaded]
    order = np.argsort(ratio)[::-1]
    share = np.cumsum(load_N[loaded][order]) / load_N[loaded].sum()
    of_most = float(ratio[order][np.searchsorted(share, BEYOND_SHARE, side="right")])
    return _told(of_most, "contacts have a radius of {:.2g} R, R that of their caps", SMALLER, NONE)


def problems_of_steep_map(contact: ContactState, surface: HeightMap) -> list[Problem]:
    """Return whether a pressed map that yields is steep where it touches.

    On a paraboloid the rms slope of what touches is a / R over the root of two. Those of a map are
    the slopes of its noise, too, and of shorter waves than its contacts: they are less of a doubt.
    """
    if contact.hardness_Pa is None or contact.rung.made_from != "map":
        return []
    curve: Any = contact.normal
    touches = curve.pressed(contact.preload_N).pressure_Pa > 0.0
    if touches.shape != surface.shape:
        return []  # of fewer points
    square = 0.0
    for axis, size_m in enumerate(surface.pixel_size_m):
        rise_m = np.diff(surface.height_m, axis=axis)
        both = np.delete(touches, 0, axis) & np.delete(touches, -1, axis) & np.isfinite(rise_m)
        if both.any():
            square += float(np.square(rise_m[both]).mean()) / size_m**2
    what = "what touches of the map is as steep as a cap at a contact radius of {:.2g} R"
    return _told(float(np.sqrt(2.0 * square)), what, NONE, np.inf)


def _told(ratio: float, what: str, smaller: float, none: float) -> list[Problem]:
    if not ratio > FALLS:
        return []
    left = hardness_left(ratio)
    message = what.format(ratio) + (
        f": the hardness of a material is that of contacts up to about {FALLS:g} R, and by finite "
        f"elements of hemispheres so wide ones keep {left:.0%} of it"
    )
    if ratio > none:
        message += (
            f"; beyond {NONE:g} R no indentation tells a hardness (ISO 6506-1), nor is it one of a "
            "half-space: stiffness and energy are not to be used"
        )
        return [Problem("steep_contacts", "error", message)]
    # At full plasticity the area is load over hardness
    off = left**-0.5 - 1.0
    severity: Severity = "warning" if ratio > smaller else "info"
    return [Problem("steep_contacts", severity, message, Effect(off, off, off))]
