"""Figures of the face: heights, hills and their caps, one cap, the families."""

from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.caps.table import CapFlag
from capslip.output.canvas import (
    FAMILY_COLOUR,
    INK,
    NON_MEASURED,
    blank,
    face_axes,
    family_names,
    has_page,
    height_limits,
    thinned,
    write_decades,
)
from capslip.output.quantity import engineering, scaled
from capslip.output.zones import hill_loads_N
from capslip.summary import alignment_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from capslip.result import Analysis

COLOURED_BEYOND = 0.1  # of the range of nearly all heights, that spikes and pits stand out of
CONTACT_pt2 = (5.0, 70.0)  # areas of the least and the most loaded contact on a map
CONTACT_COLOUR = "#E6007E"
NUMBERED = 60  # more numbers than this hide the picture
DF_AT = 1.45  # half diameters beside the apex: clear of the sphere
NUMBER_in = 0.16  # room of a number, inches


def height_map(analysis: "Analysis", axes: "Axes | None" = None) -> "Figure":
    """Heights after removal of the form, with the contour of the cut."""
    from matplotlib import colormaps

    surface, cut_m = analysis.conditioned.surface, analysis.hills.cut_height_m
    usable_peaks_m = analysis.caps.peak_height_m[analysis.caps.usable]
    low_m, high_m = height_limits(surface.height_m, usable_peaks_m, COLOURED_BEYOND)
    per_m, unit = height_unit(np.array([low_m, high_m]))
    heights = thinned(surface.height_m) * per_m
    low, high, cut = low_m * per_m, high_m * per_m, cut_m * per_m
    beyond = np.array([np.nanmin(heights) < low, np.nanmax(heights) > high])
    extend = ("neither", "min", "max", "both")[int(beyond @ [1, 2])]

    figure, axes = face_axes(_heights_over(analysis), surface.side_m, axes)
    extent = (0, surface.side_m[1] * 1e3, 0, surface.side_m[0] * 1e3)
    image = axes.imshow(
        np.ma.masked_invalid(heights),
        origin="lower",
        extent=extent,
        vmin=low,
        vmax=high,
        interpolation="nearest",
        cmap=colormaps["viridis"].with_extremes(bad=NON_MEASURED),
        aspect="equal",
    )
    outline = np.ma.masked_invalid(thinned(surface.height_m, 550) * per_m)
    if outline.min() < cut < outline.max():
        axes.contour(
            outline, levels=[cut], origin="lower", extent=extent, colors="k", linewidths=0.5
        )
    beside = _beside(figure, axes) if has_page(axes) else None
    bar = figure.colorbar(image, cax=beside, ax=axes, extend=extend, label=f"height [{unit}]")
    bar.ax.axhline(cut, color="k", linewidth=1.2)
    x_m, y_m, load_N = _contacts(analysis)
    if len(load_N):
        least, most = CONTACT_pt2
        size = np.maximum(most * load_N / load_N.max(), least)
        axes.scatter(
            x_m * 1e3,
            y_m * 1e3,
            s=size,
            facecolors="none",
            edgecolors=CONTACT_COLOUR,
            linewidths=1.0 if len(load_N) < 200 else 0.5,
        )
    entries = [("cut", "k")] + [("contacts, area as their load", CONTACT_COLOUR)] * bool(len(x_m))
    _face_legend(figure if has_page(axes) else axes, entries, bool(np.isnan(heights).any()))
    return figure


def _heights_over(analysis: "Analysis") -> str:
    """Say from what the heights of a map count."""
    if analysis.level is not None:
        return "Heights over the balanced plane"
    form = analysis.settings.conditioning.form
    title = (
        "Heights as measured" if form == "none" else f"Heights after removal of the form: {form}"
    )
    contact = analysis.contact
    if contact is not None and any(contact.tilt_rad):
        across_m = alignment_table(analysis)["tilt_across_face_m"]
        title += f"\npressed turned by {engineering(across_m, 'm')} across"
    return title


def _cap_to_show(analysis: "Analysis") -> tuple[int, str]:
    """Return the most loaded cap, or the highest where none is, and a title with its flags."""
    caps, hill_N = analysis.caps, hill_loads_N(analysis)
    load_N = np.nan_to_num(caps.load_N) if hill_N is None else hill_N
    loaded = (load_N > 0) & caps.usable
    merit = np.where(loaded, load_N, -np.inf) if loaded.any() else caps.peak_height_m
    i = int(np.argmax(np.where(caps.usable, merit, -np.inf)))
    most = "most loaded" if hill_N is None else "most loaded hill"
    title = (
        f"Cap {i + 1}, the {most if loaded.any() else 'highest'}: section along x through its apex"
    )
    flags = CapFlag(int(caps.flags[i])).words().replace(" ", ", ").replace("_", " ")
    return i, title + (f"\ndoubtful: {flags}" if flags else "")


def _contacts(analysis: "Analysis") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places and loads of what touches: caps, or regions of the map that was pressed."""
    contact, caps = analysis.contact, analysis.caps
    if contact is None or contact.rung.made_from != "map":
        loaded = np.nan_to_num(caps.load_N) > 0.0
        return caps.x_m[loaded], caps.y_m[loaded], caps.load_N[loaded]
    curve: Any = contact.normal
    pressed = curve.pressed(contact.preload_N)
    row, col = np.nonzero(pressed.region)
    number, weight = pressed.region[row, col] - 1, pressed.pressure_Pa[row, col]
    dy_m, dx_m = pressed.pixel_size_m
    total = np.bincount(number, weight)
    x_m = np.bincount(number, weight * (col + 0.5) * dx_m) / total
    y_m = np.bincount(number, weight * (row + 0.5) * dy_m) / total
    return x_m, y_m, pressed.region_loads_N


def hills_and_caps(analysis: "Analysis", axes: "Axes | None" = None) -> "Figure":
    """Hills in pale colours, each with the base circle of its fitted cap."""
    from matplotlib.collections import EllipseCollection
    from matplotlib.colors import ListedColormap

    surface, caps = analysis.conditioned.surface, analysis.caps
    figure, axes = face_axes("Hills and the base circles of their caps", surface.side_m, axes)
    label = thinned(analysis.hills.label)
    shade = np.where(label > 0, 2 + label % 6, thinned(surface.measured)).astype(np.uint8)
    pale = ["#D9EAD3", "#FFF2CC", "#E6DAF0", "#D5ECF2", "#F7DCE3", "#E4E8C8"]
    axes.imshow(
        shade,
        origin="lower",
        extent=(0, surface.side_m[1] * 1e3, 0, surface.side_m[0] * 1e3),
        vmin=-0.5,
        vmax=7.5,
        interpolation="nearest",
        cmap=ListedColormap([NON_MEASURED, "#F6F6F6", *pale]),
        aspect="equal",
    )
    entries, names = [], family_names(caps.family)
    for family in ("", "P", "G"):
        member = caps.usable & (caps.family == family)
        if not member.any():
            continue
        width = caps.diameter_m[member] * 1e3
        axes.add_collection(
            EllipseCollection(
                width,
                width,
                np.zeros_like(width),
                units="xy",
                offsets=np.column_stack([caps.x_m[member], caps.y_m[member]]) * 1e3,
                offset_transform=axes.transData,
                facecolors="none",
                edgecolors=FAMILY_COLOUR[family],
                linewidths=1.6 if member.sum() < 200 else 0.9,
            )
        )
        text = f"{names[family]} ({_counted(analysis, family, member)})"
        entries.append((text, FAMILY_COLOUR[family]))
    if len(caps) <= NUMBERED:
        _number_caps(axes, analysis)
    _face_legend(figure if has_page(axes) else axes, entries[::-1], bool((~surface.measured).any()))
    return figure


def cap_profile(analysis: "Analysis") -> "Figure | None":
    """Section along x through the apex of the most loaded cap (or the highest)."""
    caps, surface = analysis.caps, analysis.conditioned.surface
    if not caps.usable.any():
        return None
    i, title = _cap_to_show(analysis)

    dy_m, dx_m = surface.pixel_size_m
    row = int(np.clip(caps.y_m[i] // dy_m, 0, surface.shape[0] - 1))
    half_m = caps.diameter_m[i] / 2
    x_m = (np.arange(surface.shape[1]) + 0.5) * dx_m - caps.x_m[i]
    near = np.abs(x_m) <= 1.7 * half_m
    R_m = caps.radius_m[i]
    s_m = np.linspace(-1.0, 1.0, 281) * min(1.4 * half_m, R_m)  # the upper half alone touches
    sphere_m = caps.peak_height_m[i] - s_m**2 / (R_m + np.sqrt(R_m**2 - s_m**2))
    ends_m = (caps.peak_height_m[i], analysis.hills.cut_height_m, caps.cap_height_m[i])
    (per_m, unit), (per_x, along) = height_unit(np.array(ends_m)), height_unit(2.0 * half_m)

    figure, axes = blank(title)
    dots = ".-" if near.sum() < 120 else "-"
    measured = surface.height_m[row, near] * per_m
    axes.plot(x_m[near] * per_x, measured, dots, color="#8C8C8C", markersize=3, label="measured")
    inside = np.abs(s_m) <= half_m * (1 + 1e-9)  # the base of the cap
    colour = FAMILY_COLOUR[str(caps.family[i])]
    name = f"fitted sphere, R = {engineering(caps.radius_m[i], 'm', 4)}"
    axes.plot(s_m * per_x, sphere_m * per_m, "--", color=colour, linewidth=1)
    axes.plot(s_m[inside] * per_x, sphere_m[inside] * per_m, color=colour, linewidth=2, label=name)

    cut, peak = analysis.hills.cut_height_m * per_m, caps.peak_height_m[i] * per_m
    df, half = caps.cap_height_m[i] * per_m, half_m * per_x
    bottom, top = cut - 1.05 * df, peak + 0.55 * df
    axes.set(xlim=(-1.7 * half, 1.7 * half), ylim=(bottom, top))
    axes.axhline(cut, color=INK, linewidth=0.8, linestyle=":", label="cut")
    arrow = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0}
    level = cut - 0.3 * df
    axes.annotate("", (-half, level), (half, level), arrowprops=arrow)
    axes.vlines([-half, half], level, cut, color=INK, linewidth=0.6)
    axes.annotate("", (DF_AT * half, cut), (DF_AT * half, peak), arrowprops=arrow)
    axes.hlines(peak, 0, DF_AT * half, color=INK, linewidth=0.6)
    halo = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
    diameter = f"D = {engineering(2 * half_m, 'm', 4)}"
    axes.text(0, level, diameter, ha="center", va="center", bbox=halo)
    middle = (cut + peak) / 2
    axes.text(DF_AT * half, middle, "df", ha="center", va="center", bbox=halo)
    height = f"df = {engineering(caps.cap_height_m[i], 'm', 4)}"
    axes.plot([], [], " ", label=height)  # on the arrow it would hide the profile

    # Axes of a known size make the exaggeration exact.
    figure.set_layout_engine("none")
    axes.set_position((0.1, 0.12, 0.87, 0.8))
    width_in, height_in = figure.get_size_inches() * (0.87, 0.8)
    factor = (height_in / ((top - bottom) / per_m)) / (width_in / (3.4 * half_m))
    rounded = float(f"{factor:.2g}")
    factor_text = f"{rounded:,.0f}".replace(",", " ") if rounded >= 10 else f"{rounded:g}"
    note = f"heights drawn x {factor_text}"
    axes.text(0.01, 0.02, note, transform=axes.transAxes, bbox=halo)
    axes.set(xlabel=f"distance from the apex [{along}]", ylabel=f"height [{unit}]")
    axes.legend(loc="lower right", ncols=2, fontsize=9, framealpha=1.0, edgecolor="none")
    return figure


def _counted(analysis: "Analysis", name: str, member: np.ndarray) -> str:
    """Return how many caps of a family are drawn, and how many it has where those are others."""
    family = {"G": analysis.families.G, "P": analysis.families.P}.get(name)
    drawn = int(member.sum())
    if family is None or family.count == drawn:
        return f"{drawn}"
    return f"{drawn}; on its own plane {family.count}"


def family_scatter(analysis: "Analysis") -> "Figure | None":
    """Peak height against radius of every cap, with the means of the families."""
    caps, families = analysis.caps, analysis.families
    if not caps.usable.any():
        return None
    figure, axes = blank("Peak height and radius of the caps")
    radius, unit = scaled(caps.radius_m, "m")
    per_m, height = height_unit(caps.peak_height_m[caps.usable])
    names = family_names(caps.family)
    for name in ("", "P", "G"):
        member = caps.usable & (caps.family == name)
        if member.any():
            axes.plot(
                radius[member],
                caps.peak_height_m[member] * per_m,
                {"G": "o", "P": "^", "": "x"}[name],
                color=FAMILY_COLOUR[name],
                markersize=6 if member.sum() < 200 else 3,
                markeredgewidth=1.0 if name == "" else 0.0,
                alpha=0.85,
                label=f"{names[name]} ({_counted(analysis, name, member)})",
            )
    if radius[caps.usable].max() > 10 * radius[caps.usable].min():
        axes.set_xscale("log")
    mean: dict[str, float] = {}
    for name in "GP":
        member = caps.usable & (caps.family == name)
        if member.any():
            label = None if mean else "mean of a family"
            colour = FAMILY_COLOUR[name]
            mean[name] = float(caps.peak_height_m[member].mean()) * per_m
            axes.axhline(mean[name], color=colour, linewidth=1, linestyle="--", label=label)
    axes.margins(x=0.12, y=0.12)
    if axes.get_xscale() == "log":
        unit_m = 1.0 / height_unit(caps.radius_m)[0]
        write_decades(axes.xaxis, lambda value: engineering(value * unit_m, "m"))
        unit = ""
    high, low = mean.get("G"), mean.get("P")
    if high is not None and low is not None and families.h_m is not None:
        across = axes.get_yaxis_transform()  # x as a share of the width, y as a height
        text = f"h = {engineering(families.h_m, 'm')}"
        if abs(high - low - families.h_m * per_m) > 0.02 * families.h_m * per_m:
            text += " on their own plane"  # where they are counted, as the map was turned
        else:
            arrow = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0}
            ends = ((0.965, low), (0.965, high))
            axes.annotate("", *ends, xycoords=across, textcoords=across, arrowprops=arrow)
        axes.text(
            0.955,
            (low + high) / 2,
            text,
            transform=across,
            ha="right",
            va="center",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
        )
    axes.axhline(analysis.hills.cut_height_m * per_m, color=INK, linestyle=":", label="cut")
    of = f" [{unit}]" if unit else ""
    axes.set(xlabel=f"radius of the fitted sphere R{of}", ylabel=f"peak height [{height}]")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=9, frameon=False)
    return figure


def height_unit(heights_m: np.ndarray | float) -> tuple[float, str]:
    """Return how many of the unit that suits some heights make a metre, and its name.

    >>> height_unit(np.array([-25e-9, 3e-9]))
    (1000000000.0, 'nm')
    """
    largest_m = float(np.abs(heights_m).max(initial=0.0)) or 1e-6
    value, unit = scaled(np.array([largest_m]), "m")
    return float(f"{value[0] / largest_m:.6g}"), unit


def _beside(figure: "Figure", axes: "Axes") -> "Axes":
    """Return axes for a colour bar beside a map."""
    box, width_in = axes.get_position(), figure.get_figwidth()
    place = (box.x1 + 0.15 / width_in, box.y0 + 0.1 * box.height, 0.2 / width_in, 0.8 * box.height)
    return figure.add_axes(place)


def _face_legend(
    where: "Figure | Axes", entries: list[tuple[str, str]], non_measured: bool
) -> None:
    """Explain the colours below the map, or on axes that share their page."""
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = [
        Line2D([], [], color=colour, linewidth=1.5, label=name) for name, colour in entries
    ]
    if non_measured:
        handles.append(Patch(color=NON_MEASURED, label="non-measured"))
    if not handles:
        return
    if isinstance(where, Axes):
        where.legend(handles=handles, loc="upper right", fontsize=8, framealpha=0.9)
        return
    columns = len(handles) if where.get_figwidth() > 6 else 2
    where.legend(handles=handles, loc="lower center", ncols=columns, frameon=False, fontsize=9)


def _number_caps(axes: "Axes", analysis: "Analysis") -> None:
    from matplotlib.patheffects import withStroke

    caps = analysis.caps
    side_y_m, side_x_m = analysis.conditioned.surface.side_m
    apart_m = NUMBER_in * max(side_x_m / 8.0, side_y_m / 7.5)  # on the page of `face_axes`
    written = np.zeros((0, 2))
    for i in np.flatnonzero(caps.usable):
        place_m = np.array([caps.x_m[i], caps.y_m[i]])
        if caps.diameter_m[i] < apart_m:  # a number as large as its circle stands beside it
            beside_m = 0.5 * caps.diameter_m[i] + 0.5 * apart_m
            place_m += np.where(place_m + beside_m < (side_x_m, side_y_m), beside_m, -beside_m)
        if (np.hypot(*(written - place_m).T) < apart_m).any():
            continue
        written = np.vstack([written, place_m])
        axes.annotate(
            str(i + 1),
            tuple(place_m * 1e3),
            ha="center",
            va="center",
            fontsize=8,
            color=INK,
            annotation_clip=True,
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )
