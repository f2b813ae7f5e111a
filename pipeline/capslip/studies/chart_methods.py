"""The methods of the chart: each is a name, a setting, and what it overrides in the settings."""

from dataclasses import dataclass

MODELS = ("families", "caps", "mean_field", "interacting")
FITS = ("equation18", "pinned", "least_squares", "contact")
SEPARATIONS = ("regions", "watershed")
CHOSEN = ("contact", "watershed")  # the fit and separation that the program chooses
PAPER = "the paper's way"
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
        """Return the overrides for a map, with those that coarsen or filter it."""
        found = self.overrides
        if self.coarsening > 1:
            ny, nx = (max(3, round(n / self.coarsening)) for n in shape)
            found = (*found, f"conditioning.resample_to=[{ny}, {nx}]")
        if self.filter_pixels:
            index_m = self.filter_pixels * max(pixel_size_m)
            found = (*found, f"conditioning.s_filter_nesting_index_m={index_m!r}")
        return found


def methods() -> tuple[Method, ...]:
    """Return all methods of the chart, cheap ones first.

    Examples
    --------
    >>> sorted({method.line.split(",")[0] for method in methods()})[:4]
    ['auto', 'boundary elements', 'caps', 'families']
    """
    found = [Method("flat", "any", ("contact.model=flat",))]
    paper = (*_caps("families", "equation18", "regions"), "families.count=2")
    found += _by_grid(PAPER, paper, COARSENINGS)
    for model in MODELS:
        for fit in FITS:
            for separation in SEPARATIONS:
                line = f"{model}, {fit}, {separation}"
                found += _by_grid(line, _caps(model, fit, separation), COARSENINGS)
    found += [
        Method("auto", f"{100 * tolerance:g} %", (f"contact.tolerance={tolerance:g}",))
        for tolerance in (0.01, 0.05, 0.20)
    ]
    boundary = ("contact.model=boundary_elements",)
    found += _by_grid("boundary elements, by grid", boundary, (2, 4))
    for line, overrides in (
        ("boundary elements, by filter", boundary),
        ("interacting, by filter", _caps("interacting", *CHOSEN)),
    ):
        found += [Method(line, f"{n} pixels", overrides, filter_pixels=n) for n in FILTERS_PIXELS]
    found += [
        Method(
            "boundary elements, by tolerance",
            f"{tolerance:g}",
            (*boundary, f"contact.solver_tolerance={tolerance:g}"),
        )
        for tolerance in (1e-3, 1e-5, 1e-9)
    ]
    return tuple(found)


def _caps(model: str, fit: str, separation: str) -> tuple[str, ...]:
    return (f"contact.model={model}", f"caps.fit={fit}", f"hills.separation={separation}")


def _by_grid(line: str, overrides: tuple[str, ...], coarsenings: tuple[int, ...]) -> list[Method]:
    full = Method(line, "1/1", overrides)
    return [full, *(Method(line, f"1/{c}", overrides, c) for c in coarsenings)]
