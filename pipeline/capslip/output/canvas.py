"""The common look of all figures: sizes, colours, units."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

# Vermilion and blue of Okabe and Ito: told apart by colour-blind eyes, and in grey.
FAMILY_COLOUR = {"G": "#D55E00", "P": "#0072B2", "": "#707070"}
FAMILY_NAME = {"G": "G-caps", "P": "P-caps", "": "no family"}
INK = "#222222"
ACCENT = "#009E73"
NON_MEASURED = "#BDBDBD"
DPI = 130
PAD_in = 0.04  # around everything that is drawn
RUNS = 3  # the strategy of zlib that looks for runs alone: a noisy map in two thirds of the time
BESIDE_in = (0.75, 0.95, 1.2, 0.5)  # left, below, right and above a map: labels, bar, legend
SHORTEST, LONGEST = 0.9e-3, 1.1e4  # ticks between them are short as plain numbers
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
PAGE = "page"  # the name of axes that have a page of their own


def blank(
    title: str, width: float = 8.0, height: float = 5.0, axes: "Axes | None" = None
) -> "tuple[Figure, Axes]":
    """Return a figure (inches) with one pair of axes, outside of any window system.

    Axes that are given, of another figure, are dressed alike.
    """
    if axes is None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        axes.set_gid(PAGE)
    # At a given height: else every layout and drawing looks anew for room above the ticks
    axes.set_title(title, loc="left", y=1.0, fontsize=11, color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#E3E3E3", linewidth=0.6)
    axes.set_axisbelow(True)
    return cast("Figure", axes.figure), axes


def face_size(side_m: tuple[float, float]) -> tuple[float, float]:
    """Return width and height (inches) of a page that holds a map of the face and its legends."""
    side_y_m, side_x_m = side_m
    inch_per_m = min(8.0 / side_x_m, 7.5 / side_y_m)
    left, below, right, above = BESIDE_in
    width, height = (max(side * inch_per_m, 2.5) for side in (side_x_m, side_y_m))
    return width + left + right, height + below + above


def face_axes(
    title: str, side_m: tuple[float, float], axes: "Axes | None"
) -> "tuple[Figure, Axes]":
    """Return axes for a map of the face, in mm and at equal scale; those given, if they are."""
    side_y_m, side_x_m = side_m
    figure, axes = blank(title, *face_size(side_m), axes=axes)
    if has_page(axes):
        width, height = figure.get_size_inches()
        left, below, right, above = BESIDE_in
        inner = (width - left - right) / width, (height - below - above) / height
        figure.set_layout_engine("none")
        axes.set_position((left / width, below / height, *inner))
    axes.grid(False)
    axes.set(
        xlim=(0, side_x_m * 1e3),
        ylim=(0, side_y_m * 1e3),
        aspect="equal",
        xlabel="x [mm]",
        ylabel="y [mm]",
    )
    return figure, axes


def has_page(axes: "Axes") -> bool:
    """Tell whether axes have a page of their own, with room around them for a legend."""
    return axes.get_gid() == PAGE


def legend_beside(axes: "Axes") -> None:
    """Write the legend beside the axes, or inside where others stand there."""
    if has_page(axes):
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=9, frameon=False)
    else:
        axes.legend(fontsize=8, framealpha=0.9, edgecolor="none")


def height_limits(
    height_m: np.ndarray, peak_height_m: np.ndarray | None = None, beyond: float = 0.5
) -> tuple[float, float]:
    """Choose the heights that a picture spans: the bulk of the points and the caps.

    Lone spikes and pits, at most one point in a hundred on either side, count only as far as a
    share of the range of the bulk beyond it, and caps twice as far; without that, a single wrong
    point, or the cap fitted to it, hides the surface.
    """
    measured_m = height_m[np.isfinite(height_m)]
    low_m, high_m = np.quantile(measured_m, [0.01, 0.99])
    margin_m = beyond * (high_m - low_m)
    low_m = max(measured_m.min(), low_m - margin_m)
    peak_m = -np.inf if peak_height_m is None else peak_height_m.max(initial=-np.inf)
    top_m = min(peak_m, high_m + 2.0 * margin_m)
    high_m = max(min(measured_m.max(), high_m + margin_m), top_m)
    if not high_m > low_m:  # all but a few points are equal
        low_m, high_m = measured_m.min(), measured_m.max()
    return float(low_m), float(high_m)


def family_names(family: np.ndarray) -> dict[str, str]:
    """Return what the families of some caps are called: one alone is not the higher one."""
    if (family == "P").any():
        return FAMILY_NAME
    return {**FAMILY_NAME, "G": "one family" if (family == "").any() else "caps"}


def thinned(values: np.ndarray, points: int = 1100) -> np.ndarray:
    """Leave out rows and columns that a picture does not resolve."""
    step_y, step_x = (max(1, n // points) for n in values.shape)
    return values[::step_y, ::step_x]


def write_decades(axis: "Axis", write: Callable[[float], str] | None = None) -> None:
    """Write the ticks of a logarithmic axis in plain text, 2 and 5 among them where it is short.

    Over many decades what lies between them is left out: one tick costs a millisecond. All ticks
    of an axis are written alike: as numbers where those are short, else as powers of ten.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    low, high = axis.get_view_interval()
    if write is None:
        write = "{:g}".format if low > SHORTEST and high < LONGEST else power_of_ten
    if high < 100.0 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    if high > 1e4 * low:
        axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: write(value)))
    axis.set_minor_formatter(NullFormatter())


def power_of_ten(value: float) -> str:
    """Write a number by its power of ten, as text that any font of a figure has.

    >>> power_of_ten(1e-5), power_of_ten(2e6), power_of_ten(1.0)
    ('10⁻⁵', '2·10⁶', '1')
    """
    digit, exponent = f"{value:.0e}".split("e")
    if not int(exponent):
        return digit
    power = str(int(exponent)).translate(RAISED)
    return f"10{power}" if digit == "1" else f"{digit}·10{power}"


def save(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG, laid out and drawn once (`savefig` goes through it three times)."""
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):  # some figures have their places already
        if len(figure.axes) == 1 and not figure.legends:
            _fit(figure)
        else:
            engine.execute(figure)
        figure.set_layout_engine("none")
    figure.canvas.draw()
    write_png(np.asarray(figure.canvas.buffer_rgba()), path)  # type: ignore[attr-defined]


def write_png(pixels: np.ndarray, path: Path) -> None:
    """Write pixels, shape (rows, columns, 3), or with a fourth byte that is left out, as PNG."""
    from PIL import Image

    image = Image.fromarray(np.ascontiguousarray(pixels)).convert("RGB")
    image.save(path, "PNG", compress_type=RUNS)


def _fit(figure: "Figure") -> None:
    """Give the only axes what their ticks, labels and legend leave of the page."""
    axes, pad = figure.axes[0], PAD_in * figure.dpi
    inner, outer = axes.get_window_extent(), axes.get_tightbbox()
    assert outer is not None  # axes are visible
    page = np.asarray(figure.bbox.size)
    low = np.subtract(inner.min, outer.min) + pad
    room = page - low - (np.subtract(outer.max, inner.max) + pad)
    axes.set_position((*(low / page), *(room / page)))
