"""What a fit is: a function from hills to spheres, and what other stages must know of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from capslip import registry
from capslip.caps.apex import Apexes
from capslip.caps.body import Body
from capslip.caps.hills import Hills
from capslip.caps.noise import Noise
from capslip.caps.points import HillPoints
from capslip.errors import SettingsError, one_of
from capslip.surface.heightmap import HeightMap


@dataclass(frozen=True, eq=False)
class FitInput:
    """What is known of n hills before spheres are fitted to them."""

    surface: HeightMap
    hills: Hills
    points: HillPoints
    noise: Noise
    apexes: Apexes
    body: Body
    edge_of_face: bool  # as of the fit

    @property
    def area_m2(self) -> np.ndarray:
        """Area of each hill at the cut, shape (n,)."""
        return self.surface.pixel_area_m2 * self.points.count

    @property
    def diameter_m(self) -> np.ndarray:
        """Diameter of the circle of that area, shape (n,)."""
        return 2.0 * np.sqrt(self.area_m2 / np.pi)


@dataclass(frozen=True, eq=False)
class Spheres:
    """One sphere a hill, shape (n,); NaN where there is none."""

    x_m: np.ndarray
    y_m: np.ndarray
    apex_m: np.ndarray  # height of the apex
    apex_se_m: np.ndarray  # standard errors
    on_surface: np.ndarray  # False where another apex than the fit's own stands in
    radius_m: np.ndarray
    radius_se_m: np.ndarray
    covariance_m2: np.ndarray  # of both errors: noise that lifts an apex makes it sharper


@dataclass(frozen=True)
class Fit:
    """A way to fit a sphere to a hill; each file of `capslip.caps.fits` holds one as `FIT`.

    Attributes
    ----------
    spheres : callable
        Takes a `FitInput`, gives `Spheres`.
    label, colour, marker : str
        What figures write and draw.
    depth_share : float
        Share of a cap's height down to which it is fitted where no depth is asked for.
    compression_share : float or None
        Share of a cap's compression a^2 / R at which it wants to be fitted again, once contact has
        found that; None where one fit is all.
    edge_of_face : bool
        Whether contact ends with the material at the edge of the map, or of the face on it;
        else it is where the measurement ended, and a cap goes on beyond.
    at_cut_alone : bool
        Whether it knows the outline at the cut alone: no other depth, nothing beyond an edge.
    """

    spheres: Callable[[FitInput], Spheres]
    label: str
    colour: str
    marker: str
    depth_share: float = 0.5
    compression_share: float | None = None
    edge_of_face: bool = False
    at_cut_alone: bool = False


def fit_named(name: str) -> Fit:
    """Return the fit of a name, one file of `capslip.caps.fits`.

    Raises
    ------
    SettingsError
        If there is none.

    Examples
    --------
    >>> fit_named("equation18").at_cut_alone
    True
    """
    try:
        fit: Fit = registry.entry("caps.fits", name).FIT
    except KeyError:
        known = one_of(registry.names("caps.fits"), name)
        raise SettingsError(f"caps.fit: got {name!r}; {known}") from None
    return fit
