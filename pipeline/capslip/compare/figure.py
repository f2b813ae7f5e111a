"""The figure of a measurement beside the model: the paper's Fig. 11."""

from typing import TYPE_CHECKING

from capslip.output.canvas import ACCENT, FAMILY_COLOUR, INK, NON_MEASURED, blank, write_decades

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from capslip.compare.comparison import Comparison


def comparison(found: "Comparison") -> "Figure":
    """Loss factor over amplitude: measured, plane and model, intrinsic loss added back."""
    figure, axes = blank("Loss factor: measured and computed", 9.0, 5.2)
    unit, per_m = found.amplitude_unit
    v = per_m * found.curve_amplitude_m
    intrinsic = found.curve_intrinsic
    axes.loglog(
        per_m * found.amplitude_m,
        found.measured_loss_factor,
        "o",
        color=INK,
        markersize=5,
        label="measured, assembly",
    )
    left_out = found.left_out
    if left_out.any():
        axes.loglog(
            per_m * found.amplitude_m[left_out],
            found.measured_loss_factor[left_out],
            "o",
            markerfacecolor="white",
            markeredgecolor=INK,
            markersize=5,
            label=f"{left_out.sum()} of these, left out of the misfit",
        )
    has_intrinsic = bool((intrinsic > 0).any())
    added = "intrinsic + " if has_intrinsic else ""
    if has_intrinsic:
        axes.loglog(
            v, intrinsic, color=NON_MEASURED, linewidth=3.0, label="intrinsic (monolithic beam)"
        )
        axes.loglog(
            v,
            intrinsic + found.curve_plane,
            "--",
            color=FAMILY_COLOUR["P"],
            linewidth=1.5,
            label=f"{added}plane interface",
        )
    axes.loglog(
        v,
        intrinsic + found.curve_model,
        color=FAMILY_COLOUR["G"],
        linewidth=1.8,
        label=f"{added}model, µ = {found.friction_coefficient:.3g}, N = {found.preload_N:.4g} N",
    )
    one = found.identified
    if one is not None and one.missed is None and found.curve_identified is not None:
        axes.loglog(
            v,
            intrinsic + found.curve_identified,
            "-.",
            color=ACCENT,
            linewidth=1.8,
            label=f"{added}model, identified: µ = {one.friction_coefficient:.3g}, "
            f"N = {one.preload_N:.4g} N",
        )
    write_decades(axes.xaxis)
    of = f"amplitude at mid-span, as a sensor sees it [{unit.replace('u', 'µ')}]"
    axes.set(xlabel=of, ylabel="loss factor η")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.14), ncols=2, fontsize=9, frameon=False)
    return figure
