"""The figures of the report on Matplotlib axes, one call each: `analysis.plot.loss_factor()`."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from capslip.errors import OutputError, check_kind
from capslip.output import figures_contact, figures_surface, figures_texture
from capslip.output.canvas import DPI, PAGE, face_size
from capslip.output.figures import FIGURES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from capslip.result import Analysis

    Draw = Callable[[Analysis, Axes], Figure | None]

SIZE_in = (8.0, 5.0)


class Plots:
    """What `Analysis.plot` gives: one method a figure.

    Each takes the axes to draw on, new ones of pyplot by default, and returns them. On axes that
    hold another analysis already, units and limits go with what is there, so that two faces can be
    laid over each other. An analysis that lacks what a figure needs raises `OutputError`.

    Examples
    --------
    >>> import numpy as np, capslip
    >>> y, x = np.mgrid[0:120, 0:180] * 1e-4
    >>> waves_m = 2e-7 * np.cos(2 * np.pi * x / 6e-3) * np.cos(2 * np.pi * y / 6e-3)
    >>> analysis = capslip.analyze(capslip.HeightMap(waves_m, (1e-4, 1e-4)))
    >>> axes = analysis.plot.loss_factor()
    >>> axes.get_ylabel()
    'loss factor η'
    >>> import matplotlib.pyplot as plt; plt.close(axes.figure)
    """

    def __init__(self, analysis: "Analysis") -> None:
        from capslip.result import Analysis  # which opens this room when it is asked for plots

        check_kind("analysis", analysis, Analysis, "an Analysis; make one with capslip.analyze")
        self._analysis = analysis

    def height_map(self, ax: "Axes | None" = None) -> "Axes":
        """Heights after removal of the form, with the contour of the cut."""
        return self._drawn("height_map", figures_surface.height_map, ax, self._page_in())

    def caps(self, ax: "Axes | None" = None) -> "Axes":
        """Hills above the cut, each with the base circle of its cap."""
        return self._drawn("hills_and_caps", figures_surface.hills_and_caps, ax, self._page_in())

    def abbott(self, ax: "Axes | None" = None) -> "Axes":
        """Areal material ratio curve of the map that is cut, with the cut."""
        return self._drawn("texture", figures_texture.abbott, ax)

    def spectrum(self, ax: "Axes | None" = None) -> "Axes":
        """Power spectra of rows and columns, with the waves that the map carries."""
        return self._drawn("texture", figures_texture.spectrum, ax)

    def normal_curve(self, ax: "Axes | None" = None) -> "Axes":
        """Load of one joint over its normal approach, with the preload."""
        return self._drawn("normal_curve", figures_contact.normal_curve, ax)

    def loop(self, ax: "Axes | None" = None) -> "Axes":
        """First loading to gross slip, and steady cycles of three amplitudes, of one joint.

        Where the load oscillates, the amplitudes of all steady cycles in place of the former.
        """
        return self._drawn("slip_loop", figures_contact.slip_loop, ax)

    def energy(self, ax: "Axes | None" = None) -> "Axes":
        """Energy that one joint loses in a cycle, over the amplitude of its displacement."""
        return self._drawn("energy", figures_contact.energy, ax)

    def loss_factor(self, ax: "Axes | None" = None) -> "Axes":
        """Loss factor of the structure over its amplitude."""
        return self._drawn("loss_factor", figures_contact.loss_factor, ax)

    def _page_in(self) -> tuple[float, float]:
        return face_size(self._analysis.conditioned.surface.side_m)

    def _drawn(
        self,
        name: str,
        draw: "Draw",
        ax: "Axes | None",
        size_in: tuple[float, float] = SIZE_in,
    ) -> "Axes":
        """Draw on the axes, or on new ones of that size; name is that of the report's figure."""
        new = None
        if ax is None:
            import matplotlib.pyplot as plt

            new, ax = plt.subplots(figsize=size_in, dpi=DPI, layout="constrained")
            ax.set_gid(PAGE)
        else:
            from matplotlib.axes import Axes

            check_kind("ax", ax, Axes, "axes of Matplotlib, or None")
        seen = (ax.get_xlim(), ax.get_ylim()) if ax.has_data() else None
        if draw(self._analysis, ax) is None:
            if new is not None:
                plt.close(new)
            entry, status = FIGURES[name], self._analysis.status
            raise OutputError(
                f"{self._analysis.name}: no figure {entry.title.lower()!r}; got an analysis with "
                f"status {status}; expected {entry.needs}; see analysis.problems"
            )
        if seen is not None:
            (left, right), (bottom, top) = seen
            ax.set_xlim(min(left, ax.get_xlim()[0]), max(right, ax.get_xlim()[1]))
            ax.set_ylim(min(bottom, ax.get_ylim()[0]), max(top, ax.get_ylim()[1]))
        return ax
