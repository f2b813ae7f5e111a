"""Mouse and keys on the window of a result, on whatever display there is: `FOLDER`, JSON out."""

import json
import sys

from capslip.output.picture import Look
from capslip.output.view import read_view
from capslip.output.window import Window

SLIDERS = {"factor": 0.36, "load_share": 0.56, "force_share": 0.76}
FIRST, LENGTH, HEIGHT = 0.0125, 0.145, 0.94  # of the way of a bead, from the left end of a slider


class Hand:
    """Presses, moves and clicks on the interactor of a window."""

    def __init__(self, window):
        self.window, self.plotter = window, window.plotter
        self.interactor = self.plotter.iren.interactor

    def at(self, x, y, *events):
        """Call the events of the mouse at a pixel."""
        self.interactor.SetEventInformation(round(x), round(y), 0, 0, "\0", 0, None)
        for event in events:
            self.interactor.InvokeEvent(event)

    def click(self, x, y):
        """Click at a pixel."""
        self.at(x, y, "MouseMoveEvent", "LeftButtonPressEvent")
        self.at(x, y, "LeftButtonReleaseEvent")

    def drag(self, x, y, to_x):
        """Drag along a row of pixels."""
        self.at(x, y, "MouseMoveEvent", "LeftButtonPressEvent")
        for share in (0.5, 1.0):
            self.at(x + share * (to_x - x), y, "MouseMoveEvent")
        self.at(to_x, y, "LeftButtonReleaseEvent")

    def key(self, key):
        """Press a key."""
        self.interactor.SetKeyEventInformation(0, 0, key, 0, key)
        for event in ("KeyPressEvent", "CharEvent", "KeyReleaseEvent"):
            self.interactor.InvokeEvent(event)

    def apex(self, i):
        """Return the pixel of the apex of a cap."""
        of = self.window.view.columns
        return self.pixel(of["x_m"][i], of["y_m"][i], of["peak_height_m"][i])

    def pixel(self, x_m, y_m, height_m):
        """Return the pixel of a point of the face."""
        view, look = self.window.view, self.window.look
        renderer = self.plotter.renderer
        renderer.SetWorldPoint(x_m, y_m, (height_m - view.limits_m[0]) * look.factor_of(view), 1.0)
        renderer.WorldToDisplay()
        return renderer.GetDisplayPoint()[:2]

    def slide(self, name, before, after):
        """Drag the bead of a slider from one share of its way to another."""
        width, height = self.plotter.window_size
        x = [(SLIDERS[name] + FIRST + LENGTH * share) * width for share in (before, after)]
        self.drag(x[0], HEIGHT * height, x[1])
        return getattr(self.window.look, name)


def main(folder):
    window = Window(read_view(folder), Look(), off_screen=False)
    window.plotter.show(interactive=False, auto_close=False)
    hand, found = Hand(window), {"screen": not window.plotter.off_screen}
    found["clicked"] = []
    for i in range(len(window.view.cap)):
        hand.click(*hand.apex(i))
        found["clicked"].append(window.selected)
    hand.click(*hand.pixel(0.029, 0.001, window.view.limits_m[0]))  # a corner of the face
    found["beside"] = window.selected
    found["load_share"] = hand.slide("load_share", 1.0, 0.5)
    found["force_share"] = hand.slide("force_share", window.look.force_share, 0.75)
    found["zones"] = window.look.zones
    hand.key("z")
    found["zones_after_key"] = window.look.zones
    window.plotter.close()
    print(json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1])
