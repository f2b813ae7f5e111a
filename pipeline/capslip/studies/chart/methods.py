"""The methods of the chart: each is a name, a setting, and what it overrides in the settings."""

from dataclasses import dataclass
from itertools import product

from capslip import registry
from capslip.caps.fitting import fit_named
from capslip.contact.rung import ladder, rung
from capslip.settings import CapSettings, HillSettings
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap

# Rungs and fits from the cheapest on; the paper's come first, those that the program chooses last.
LADDER = ladder()
FITS = tuple(
    sorted(
        registry.names("caps.fits"),
        key=lambda name: (
            not fit_named(name).at_cut_alone,
            fit_named(name).compression_share is not None,
        ),
    )
)
SEPARATIONS = ("regions", "watershed")
MODELS = tuple(rung.name for rung in LADDER if rung.automatic)
FLAT, GRID = (next(r for r in LADDER if r.made_from == what) for what in ("nothing", "map"))
AUTO = "auto"
PAPERS = (MODELS[0], FITS[0], SEPARATIONS[0])
CHOSEN = (CapSettings().fit, HillSettings().separation)

PAPER = "the paper's way"
CAPS, MEAN, BEST = (", ".join((model, *CHOSEN)) for model in MODELS[1:])  # lines of the page
BOUNDARY = GRID.label
AS_LEVELLED = "as levelled"
BY_GRID, BY_FILTER = f"{BOUNDARY}, by grid", f"{BOUNDARY}, by filter"
TOLERANCES = (0.01, 0.05, 0.20)
AUTO_DEFAULT = "5 %"  # the setting of the line `auto` that the program has by default
COARSENINGS = (2, 4, 8, 16)
FILTERS_PIXELS = (5, 10)


@dataclass(frozen=True)
class Method:
    """One point of the chart."""

    line: str  # points of one line differ in one setting
    setting: str
    overrides: tuple[str, ...]  # as of --set
    coarsening: int = 1  # of the map, along each axis
    filter_pixels: int = 0  # nesting index of an S-filter, in pixels of the map

    def overrides_on(
        self, shape: tuple[int, int], pixel_size_m: tuple[float, float]
    ) -> tuple[str, ...]:
        """Return the overrides for a map, with those that filter it."""
        found = self.overrides
        if self.filter_pixels:
            index_m = self.filter_pixels * max(pixel_size_m)
            found = (*found, f"conditioning.s_filter_nesting_index_m={index_m!r}")
        return found

    def scan_of(self, measured: HeightMap) -> HeightMap:
        """Return the scan that is analysed: one on fewer points, of which no finer one is known."""
        if self.coarsening == 1:
            return measured
        ny, nx = (max(3, round(n / self.coarsening)) for n in measured.shape)
        return condition(measured, resample_to=(ny, nx)).surface


def methods() -> tuple[Method, ...]:
    """Return all methods of the chart, cheap ones first.

    Examples
    --------
    >>> sorted({method.line.split(",")[0] for method in methods()})[:4]
    ['auto', 'boundary elements', 'caps', 'families']
    """
    found = [Method(FLAT.name, "any", (f"contact.model={FLAT.name}",))]
    levelled = ("contact.alignment=as_levelled",)
    paper = (*_caps(*PAPERS), "families.count=2", "hills.cut=fixed", *levelled)
    found += _by_grid(PAPER, paper, COARSENINGS)
    for combination in product(MODELS, FITS, SEPARATIONS):
        found += _by_grid(", ".join(combination), _caps(*combination), COARSENINGS)
    found += [
        Method(AUTO, f"{100 * tolerance:g} %", (f"contact.tolerance={tolerance:g}",))
        for tolerance in TOLERANCES
    ]
    grid = (f"contact.model={GRID.name}",)
    found.append(Method(f"{AUTO}, {AS_LEVELLED}", AUTO_DEFAULT, levelled))
    found += _by_grid(BY_GRID, grid, (2, 4))
    found += _by_grid(f"{BOUNDARY}, {AS_LEVELLED}", (*grid, *levelled), ())
    best = _caps(MODELS[-1], *CHOSEN)
    for line, overrides in ((BY_FILTER, grid), (f"{MODELS[-1]}, by filter", best)):
        found += [Method(line, f"{n} pixels", overrides, filter_pixels=n) for n in FILTERS_PIXELS]
    found += [
        Method(f"{BOUNDARY}, by tolerance", f"{x:g}", (*grid, f"contact.solver_tolerance={x:g}"))
        for x in (1e-3, 1e-5, 1e-9)
    ]
    return tuple(found)


def _caps(model: str, fit: str, separation: str) -> tuple[str, ...]:
    chosen = (f"contact.model={model}", f"caps.fit={fit}", f"hills.separation={separation}")
    return chosen if rung(model).knows_places else (*chosen, "contact.alignment=as_levelled")


def _by_grid(line: str, overrides: tuple[str, ...], coarsenings: tuple[int, ...]) -> list[Method]:
    full = Method(line, "1/1", overrides)
    return [full, *(Method(line, f"1/{c}", overrides, c) for c in coarsenings)]
