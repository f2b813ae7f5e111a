"""The parameters of ISO 25178-2, which metrologists look at first, each computed when asked for."""

from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import Any

from capslip.caps.features import FeatureParameters, feature_parameters
from capslip.surface.conditioning import Conditioned
from capslip.surface.heightmap import HeightMap
from capslip.surface.parameters import SurfaceParameters, surface_parameters
from capslip.surface.spectrum import Spectrum, line_spectrum

MOST_POINTS = 4_000_000  # of a map; the hills of a larger one take seconds and a gigabyte


@dataclass(frozen=True, eq=False)
class Iso25178:
    """Parameters of a conditioned map, each group found once, when it is first asked for.

    No other stage needs them, and the hills take as long as all stages together: so an analysis
    goes without, and a summary of a result without figures has no hills.

    Attributes
    ----------
    conditioned : Conditioned
        The map; its parameters are those before it was turned to its level under load.
    """

    conditioned: Conditioned

    @cached_property
    def field(self) -> SurfaceParameters:
        """Height parameters and texture."""
        return surface_parameters(self.conditioned.as_fitted())

    @cached_property
    def along_x(self) -> Spectrum:
        """Power spectrum of the rows."""
        surface = self.conditioned.as_fitted()
        return line_spectrum(surface.height_m, surface.pixel_size_m[1])

    @cached_property
    def along_y(self) -> Spectrum:
        """Power spectrum of the columns."""
        surface = self.conditioned.as_fitted()
        return line_spectrum(surface.height_m.T, surface.pixel_size_m[0])

    @cached_property
    def hills(self) -> FeatureParameters:
        """Feature parameters of the hills."""
        return feature_parameters(self.conditioned.as_fitted())

    @cached_property
    def dales(self) -> FeatureParameters:
        """Feature parameters of the dales: Spd is Svd, S5p is S5v, Sha is Sda, and so on."""
        surface = self.conditioned.as_fitted()
        return feature_parameters(HeightMap(-surface.height_m, surface.pixel_size_m))

    @property
    def few_points(self) -> bool:
        """Whether hills and dales are found: on a map that is not too large."""
        return self.conditioned.surface.size <= MOST_POINTS

    def features(self) -> dict[str, SurfaceParameters | FeatureParameters]:
        """Return the parameters of heights, hills and dales."""
        return {"field": self.field, "hills": self.hills, "dales": self.dales}

    def take(self, found: dict[str, SurfaceParameters | FeatureParameters]) -> None:
        """Keep the `features` that were found elsewhere."""
        vars(self).update(found)

    def to_dict(self, *, with_hills: bool) -> dict[str, Any]:
        """Return the numbers; those of hills and dales are None without, and on too large maps."""
        found: dict[str, Any] = asdict(self.field)
        with_hills &= self.few_points
        for one in fields(FeatureParameters):
            found[one.name] = getattr(self.hills, one.name) if with_hills else None
        found["S10z_m"] = self.hills.S5p_m + self.dales.S5p_m if with_hills else None
        found["Sda_m2"] = self.dales.Sha_m2 if with_hills else None
        return found
