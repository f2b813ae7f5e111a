"""Ticks of a figure that is drawn once, as few artists.

Matplotlib makes six artists of a tick and places each four times in a drawing, which is half of
what a figure costs. Here the lines of an axis are one collection, and a name is one text. They
stand in pixels: a figure that is drawn again at another size keeps Matplotlib's own.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

SIZE_pt, TITLE_pt = 10.0, 11.0  # of letters
MAJOR_pt, MINOR_pt = (3.5, 0.8), (2.0, 0.6)  # length and width of a mark
GAP_pt, LABEL_GAP_pt, TITLE_GAP_pt = 3.5, 4.0, 6.0  # from a mark to its name, to that of the axis
LINE = 1.3  # a line of text over the size of its letters
PAD_pt = 3.0  # around everything that is drawn
OVERHANG_pt = 18.0  # of the last name below an axis beyond its end


def fit(figure: "Figure") -> None:
    """Give the only axes of a page what names, title and legend leave of it."""
    (axes,), point = figure.axes, figure.dpi / 72.0
    page = np.asarray(figure.bbox.size)
    line_pt, marks_pt = LINE * SIZE_pt, PAD_pt + MAJOR_pt[0] + GAP_pt
    beside_pt = marks_pt + (line_pt + LABEL_GAP_pt) * bool(axes.get_ylabel())
    low = np.array([beside_pt, marks_pt + 2.0 * line_pt + LABEL_GAP_pt]) * point
    title_pt = LINE * TITLE_pt * (1 + axes.get_title(loc="left").count("\n"))
    high = page - np.array([PAD_pt + OVERHANG_pt, PAD_pt + TITLE_GAP_pt + title_pt]) * point
    legend = axes.get_legend()
    if legend is not None:
        beyond = legend.get_window_extent().x1 - axes.get_window_extent().x1
        high[0] = min(high[0], page[0] - PAD_pt * point - beyond)
    for _ in range(2):  # the height makes the ticks, whose names make the width
        axes.set_position((*(low / page), *((high - low) / page)))
        names = _ticks(axes.yaxis)[1]
        low[0] = beside_pt * point + max((_width(axes, name) for name in names), default=0.0)


def write_ticks(axes: "Axes") -> None:
    """Draw the ticks of axes where they are on the page, and hide those of Matplotlib."""
    locate: Any = axes.get_axes_locator()  # a colour bar leaves room for its pointed ends
    axes.apply_aspect(locate(axes, None) if locate else None)
    for along, axis in enumerate((axes.xaxis, axes.yaxis)):
        if axis.get_visible():
            place, names, small = _ticks(axis)
            _draw_lines(axes, axis, along, place, small)
            _write_names(axes, axis, along, place, names)
            axis.set_visible(False)


def are_plain(figure: "Figure") -> bool:
    """Tell whether nothing but large ticks has a name, and no axis a common factor."""
    from matplotlib.ticker import NullFormatter

    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            _ticks(axis)  # the formatter finds its factor with them
            unnamed = isinstance(axis.get_minor_formatter(), NullFormatter)
            if not unnamed or axis.get_major_formatter().get_offset():
                return False
    return True


def _ticks(axis: "Axis") -> tuple[np.ndarray, list[str], np.ndarray]:
    """Return places and names of the large ticks in view, and places of the small ones."""
    place = np.asarray(axis.get_majorticklocs(), float)
    names = axis.get_major_formatter().format_ticks(list(place))
    seen = _seen(axis, place)
    small = np.asarray(axis.get_minorticklocs(), float)
    return place[seen], [names[i] for i in np.flatnonzero(seen)], small[_seen(axis, small)]


def _seen(axis: "Axis", place: np.ndarray) -> np.ndarray:
    """Tell which places of an axis are in view, its ends included."""
    convert = axis.get_transform().transform
    low, high = sorted(convert(np.asarray(axis.get_view_interval(), float)))
    margin = 1e-9 * (high - low)
    at = convert(place)
    return (at >= low - margin) & (at <= high + margin)


def _at_px(axes: "Axes", along: int, place: np.ndarray) -> np.ndarray:
    """Return places along an axis in pixels of the page."""
    pairs = np.zeros((len(place), 2))
    pairs[:, along] = place
    blended = axes.get_yaxis_transform() if along else axes.get_xaxis_transform()
    return blended.transform(pairs)[:, along]


def _edge_px(axes: "Axes", axis: "Axis", along: int) -> tuple[float, float, float]:
    """Return the edge at which an axis has its marks, that across, and where outside is."""
    box = axes.get_window_extent()
    low, high = box.intervalx if along else box.intervaly
    beyond = axis.get_tick_params().get("labelright", False)
    return (high, low, 1.0) if beyond else (low, high, -1.0)


def _draw_lines(
    axes: "Axes", axis: "Axis", along: int, place: np.ndarray, small: np.ndarray
) -> None:
    """Draw marks and grid of an axis."""
    from matplotlib.collections import LineCollection
    from matplotlib.transforms import IdentityTransform

    look, point = axis.get_tick_params(), axes.figure.dpi / 72.0
    near, far, outward = _edge_px(axes, axis, along)
    groups = [
        (where, near + outward * length_pt * point, width_pt, "black")
        for where, (length_pt, width_pt) in ((place, MAJOR_pt), (small, MINOR_pt))
    ]
    if look.get("gridOn", False):
        groups.insert(0, (place, far, look["grid_linewidth"], look["grid_color"]))
    segments, widths, colours = [], [], []
    for where, end, width_pt, colour in groups:
        at = np.empty((len(where), 2, 2))
        at[:, :, along] = _at_px(axes, along, where)[:, None]
        at[:, :, 1 - along] = near, end
        segments += list(at)
        widths += [width_pt] * len(where)
        colours += [colour] * len(where)
    lines = LineCollection(segments, linewidths=widths, colors=colours, zorder=0.5, clip_on=False)
    lines.set_transform(IdentityTransform())
    axes.add_artist(lines)


def _write_names(
    axes: "Axes", axis: "Axis", along: int, place: np.ndarray, names: list[str]
) -> None:
    """Write the names of ticks, and that of their axis beyond them."""
    from matplotlib.transforms import IdentityTransform

    point = axes.figure.dpi / 72.0
    near, _, outward = _edge_px(axes, axis, along)
    at = near + outward * (MAJOR_pt[0] + GAP_pt) * point
    look: dict[str, Any] = {"transform": IdentityTransform(), "clip_on": False, "fontsize": SIZE_pt}
    if along:
        look |= {"ha": "left" if outward > 0.0 else "right", "va": "center_baseline"}
    else:
        look |= {"ha": "center", "va": "top"}
    for one, name in zip(_at_px(axes, along, place), names, strict=True):
        x, y = (at, one) if along else (one, at)
        axes.text(x, y, name, **look)
    room = LINE * SIZE_pt * point
    if along:
        room = max((_width(axes, name) for name in names), default=0.0)
    set_place = axis.label.set_x if along else axis.label.set_y  # in pixels across the axis
    set_place(at + outward * (room + LABEL_GAP_pt * point))
    axes.add_artist(axis.label)
    axis.label.set_clip_on(False)


def _width(axes: "Axes", text: str) -> float:
    """Return the width of a name in pixels."""
    from matplotlib.font_manager import FontProperties

    canvas: Any = axes.figure.canvas
    renderer = canvas.get_renderer()
    font = FontProperties(size=SIZE_pt)
    return float(renderer.get_text_width_height_descent(text, font, False)[0])
