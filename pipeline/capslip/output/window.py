"""The window in which a result is looked at: sliders, keys, and a click on a cap."""

from dataclasses import replace
from typing import Any

import numpy as np

from capslip.output.drawing import Drawing
from capslip.output.picture import WINDOW, Look, draw, picture_of
from capslip.output.quantity import scaled
from capslip.output.view import View, cap_at, cap_lines, cap_profiles

KEYS = (  # those that VTK leaves free
    ("b", "face", "the face"),
    ("g", "caps", "the caps"),
    ("n", "labels", "numbers of caps"),
    ("z", "zones", "what touches, sticks, slips"),
    ("m", "mate", "mate, level unbalanced"),
)
HELP = "\n".join(
    [
        *(f"{key}  {what}" for key, _, what in KEYS),
        "k  next colour of the caps",
        "h  these keys",
        "r  whole face,  q  quit",
        "click on a cap: its row and profile",
    ]
)
BEAD = 0.012  # length of that of a slider, over the width of the window
MOST_FACTOR = 4.0  # of the round exaggeration


class Window:
    """A window on one result; every change goes through `change`.

    Parameters
    ----------
    view : View
        What there is to be seen.
    look : Look
        What is shown first.
    off_screen : bool
        Without a window, as tests want it.
    """

    def __init__(self, view: View, look: Look, off_screen: bool = False) -> None:
        self.view, self.look = view, look
        self.plotter = _plotter(off_screen)
        self.drawing = picture_of(view, look, Drawing(self.plotter.renderer))
        self.plotter.camera_set = True  # or PyVista looks from a place of its own
        self.chart: Any = None
        self.selected: int | None = None
        self.with_help = False
        self.plotter.camera.SetWindowCenter(0.22, 0.0)  # room for what is said of a cap
        self.plotter.camera.zoom(0.8)
        self._add_sliders()
        for key, name, _ in KEYS:
            self.plotter.add_key_event(key, lambda name=name: self.toggle(name))
        self.plotter.add_key_event("k", self.next_colour)
        self.plotter.add_key_event("h", self.toggle_help)
        self.plotter.enable_surface_point_picking(
            callback=lambda point: self.select(float(point[0]), float(point[1])),
            left_clicking=True,
            tolerance=1e-10,  # of the window, against true heights: beyond them nearer ones win
            show_message=False,
            show_point=False,
        )
        self.toggle_help()

    def change(self, **what: Any) -> None:
        """Show something else of the result, or another state."""
        before, self.look = self.look, replace(self.look, **what)
        draw(self.drawing, self.view, self.look, before)
        self._write_row()
        self.plotter.render()

    def toggle(self, name: str) -> None:
        """Show or hide a part; two faces and their sum have each their round factor."""
        what: dict[str, Any] = {name: not getattr(self.look, name)}
        look = replace(self.look, **what)
        if look.two_faces(self.view) != self.look.two_faces(self.view):
            what["factor"] = None
            self._reset_factor(replace(look, factor=None).factor_of(self.view))
        self.change(**what)

    def next_colour(self) -> None:
        """Colour the caps by the next of their columns."""
        colours = self.view.colours
        at = colours.index(self.look.colour)
        self.change(colour=colours[(at + 1) % len(colours)], caps=True)

    def toggle_help(self) -> None:
        """Show or hide the keys."""
        self.with_help = not self.with_help
        self._write("help", HELP if self.with_help else "h  keys", (0.76, 0.69), 9)

    def select(self, x_m: float, y_m: float) -> None:
        """Show row and profile of the cap at a place, or none."""
        self.selected = cap_at(self.view, x_m, y_m)
        if self.chart is not None:
            self.plotter.remove_chart(self.chart)
            self.chart = None
        self._write_row()
        if self.selected is not None:
            self._draw_profile(self.selected)
        self.plotter.render()

    def show(self) -> None:
        """Open the window; returns when it is closed."""
        self.plotter.show(title=f"capslip: {self.view.name}")

    def _add_sliders(self) -> None:
        def slider(name: str, title: str, most: float, value: float, x: float) -> Any:
            widget = self.plotter.add_slider_widget(
                lambda value: self.change(**{name: value}),
                (1.0 if name == "factor" else 0.0, most),
                value=value,
                title=title,
                pointa=(x, 0.94),
                pointb=(x + 0.17, 0.94),
                title_height=0.017,
                slider_width=0.02,
                tube_width=0.004,
                color="black",
                fmt="%.0f" if name == "factor" else "%.2f",
                interaction_event="always",
            )
            widget.GetRepresentation().SetSliderLength(BEAD)
            return widget

        round_factor = self.look.factor_of(self.view)
        self.factor = slider("factor", "heights x", MOST_FACTOR * round_factor, round_factor, 0.36)
        if self.view.zones is not None:
            slider("load_share", "load / preload", 1.0, self.look.load_share, 0.56)
            slider("force_share", "force / gross slip", 1.0, self.look.force_share, 0.76)

    def _reset_factor(self, round_factor: float) -> None:
        bead = self.factor.GetRepresentation()
        bead.SetMaximumValue(MOST_FACTOR * round_factor)
        bead.SetValue(round_factor)

    def _write(self, name: str, text: str, place: tuple[float, float], size: int) -> None:
        self.plotter.add_text(
            text,
            position=place,
            viewport=True,
            font_size=size,
            color="black",
            name=name,
            render=False,
        )

    def _write_row(self) -> None:
        lines = []
        if self.selected is not None:
            state = self.look.load_share, self.look.force_share
            lines = cap_lines(self.view, self.selected, *state)
        self._write("row", "\n".join(lines) or " ", (0.76, 0.5), 10)

    def _draw_profile(self, i: int) -> None:
        import pyvista

        s_m, height_m, sphere_m = next(cap_profiles(self.view, [i]))
        s, unit = scaled(s_m, "m")
        (z, sphere), z_unit = scaled(np.stack([height_m, sphere_m]), "m")
        chart = pyvista.Chart2D(
            size=(0.27, 0.3),
            loc=(0.72, 0.17),
            x_label=f"from the apex [{unit}]",
            y_label=f"height [{z_unit}]",
        )
        chart.background_color = "white"
        chart.line(s, z, color="#808080", width=2.0, label="measured")
        chart.line(s, sphere, color="#D55E00", width=2.0, label="fitted sphere")
        chart.legend_visible = True
        self.chart = chart
        self.plotter.add_chart(chart)


def _plotter(off_screen: bool) -> Any:
    import pyvista

    return pyvista.Plotter(off_screen=off_screen, window_size=list(WINDOW))
