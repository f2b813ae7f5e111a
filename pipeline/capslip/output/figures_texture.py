"""Figure of the texture: the material ratio curve with the cut, and the power spectra."""

from typing import TYPE_CHECKING

import numpy as np

from capslip.output.canvas import ACCENT, INK, blank, write_decades
from capslip.output.quantity import engineering, unit_on
from capslip.surface.parameters import material_ratio_curve
from capslip.surface.spectrum import carried_waves_m

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from capslip.result import Analysis

AXES = (("x", "#0072B2"), ("y", "#E69F00"))
NOT_CARRIED = "#EFEFEF"
PLACES = ((0.075, 0.12, 0.405, 0.8), (0.575, 0.12, 0.41, 0.8))  # on the page
UM3 = 1e18  # in a cubic metre
FEW = 4e-3  # of the points, that may lie beyond the heights drawn
SMALLEST = 1e-12  # of the greatest density that is drawn


def texture(analysis: "Analysis") -> "Figure":
    """Both side by side."""
    figure, left = blank("", 11.0, 4.8)
    figure.set_layout_engine("none")  # to lay out two axes takes as long as to draw them
    left.set_position(PLACES[0])
    right = figure.add_axes(PLACES[1])
    abbott(analysis, left)
    spectrum(analysis, right)
    return figure


def abbott(analysis: "Analysis", axes: "Axes | None" = None) -> "Figure":
    """Areal material ratio curve (Abbott) of the map that is cut, with the cut."""
    ratio, height_m = material_ratio_curve(analysis.conditioned.surface)
    cut_m, kept = analysis.hills.cut_height_m, 100.0 * analysis.hills.kept_fraction
    high_m, low_m = np.interp((FEW, 1.0 - FEW), ratio, height_m)
    most_m = float(max(abs(high_m), abs(low_m), abs(cut_m)))
    unit_m, unit = unit_on(axes.get_ylabel() if axes else "", most_m, "m")
    figure, axes = blank("Areal material ratio curve (Abbott)", axes=axes)
    named = "Smc(mr)"
    if np.ptp(height_m) > 2.0 * (high_m - low_m) > 0.0:  # a few points would leave a flat line
        ends = (engineering(one, "m") for one in (height_m.max(), height_m.min()))
        named += f", from {' to '.join(ends)}"
        margin_m = 0.1 * (high_m - low_m)
        axes.set_ylim((low_m - margin_m) / unit_m, (high_m + margin_m) / unit_m)
    axes.plot(100.0 * ratio, height_m / unit_m, color=INK, linewidth=1.8, label=named)
    label = f"cut: {kept:.3g} % above {engineering(cut_m, 'm')}"
    corner = [0.0, kept, kept], [cut_m / unit_m, cut_m / unit_m, height_m[-1] / unit_m]
    axes.plot(*corner, "--", color=ACCENT, linewidth=1.2, label=label)
    axes.plot(kept, cut_m / unit_m, "o", color=ACCENT, markersize=7)
    axes.set(xlim=(0.0, 100.0), xlabel="material ratio mr [%]", ylabel=f"height [{unit}]")
    axes.legend(loc="upper right", fontsize=9, framealpha=0.9, edgecolor="none")
    return figure


def spectrum(analysis: "Analysis", axes: "Axes | None" = None) -> "Figure":
    """Power spectra of rows and columns, with the waves that the map carries and its contacts."""
    found, surface = analysis.iso25178, analysis.conditioned.surface
    filters, noise_m = analysis.settings.conditioning, analysis.hills.noise_m
    shortest_m, longest_m = carried_waves_m(
        surface, noise_m, filters.s_filter_nesting_index_m, filters.l_filter_nesting_index_m
    )
    figure, axes = blank("Power spectral density of the profiles, one-sided", axes=axes)
    ends = []
    for (name, colour), one in zip(AXES, (found.along_x, found.along_y), strict=True):
        seen = one.smoothed()
        per_mm = seen.frequency_per_m * 1e-3
        axes.loglog(
            per_mm, seen.density_m3 * UM3, color=colour, linewidth=1.6, label=f"along {name}"
        )
        ends += [per_mm[0], per_mm[-1]]
    if noise_m > 0.0:
        noise_m3 = 2.0 * noise_m**2 * min(surface.pixel_size_m)
        # Of the whole map, roughness of a few pixels with it; what is noise of it no one scan tells
        label = f"neighbours differ as by noise of {engineering(noise_m, 'm')}"
        axes.axhline(noise_m3 * UM3, color=INK, linewidth=1.0, linestyle=":", label=label)
    low, high = min(ends), max(ends)
    for left, right in ((low, 1e-3 / longest_m), (1e-3 / shortest_m, high)):
        if right > left * (1.0 + 1e-9):
            axes.axvspan(left, right, color=NOT_CARRIED, zorder=0)
    label = f"carried: waves of {engineering(shortest_m, 'm')} to {engineering(longest_m, 'm')}"
    axes.plot([], [], "s", color="white", markeredgecolor=INK, label=label)
    contact_m = analysis.caps.contact_diameter_m
    if contact_m is not None:
        label = f"contacts, {engineering(contact_m, 'm')} across"
        axes.axvline(1e-3 / contact_m, color=ACCENT, linewidth=1.4, linestyle="--", label=label)
    greatest_m3 = max(
        np.nanmax(one.density_m3, initial=0.0) for one in (found.along_x, found.along_y)
    )
    if greatest_m3 > 0.0:  # waves along one axis alone leave digits along the other
        axes.set_ylim(bottom=max(axes.get_ylim()[0], SMALLEST * greatest_m3 * UM3))
    axes.set(xlim=(low, high), xlabel="spatial frequency [1/mm]", ylabel="density W [µm³]")
    write_decades(axes.xaxis)
    write_decades(axes.yaxis)
    axes.legend(loc="upper right", fontsize=9, framealpha=0.9, edgecolor="none")
    return figure
