"""Figures of the loaded joint: normal curve, slip loop, energy and loss factor."""

from contextlib import suppress
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.contact.rung import resolved_share
from capslip.contact.varying_load import VaryingSlip
from capslip.errors import ContactError
from capslip.output.canvas import ACCENT, INK, blank, legend_beside, write_decades
from capslip.output.quantity import engineering, unit_on
from capslip.result import JointOfScans
from capslip.structure.response import MOST_LOSS_FACTOR
from capslip.structure.stiffness import structure_name

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from capslip.contact.curve import NormalCurve
    from capslip.contact.press import ContactState
    from capslip.contact.slip import SlipCurve
    from capslip.result import Analysis

LOOP_SHARES = (0.3, 0.6, 0.9)  # of the force at gross slip
LEAST_LOSS_FACTOR = 1e-6  # of the greatest: what a figure still shows
LEAST_ENERGY = 1e-7  # of that at gross slip: the same
UNRESOLVED_SLIP = "left of it: finer than the pixels resolve"
GREY, SCATTER = "#BDBDBD", "between the scans, each alone"
LOOP_COLOURS = ("#56B4E9", "#0072B2", "#003D66")
THINNEST = 0.004  # of what an axis shows: no eye finds a band as thin as this
PHASES = (  # of first loading, the paper's Sec. 2.3
    ("GPS: no contact slides as a whole", "#E8F3EC"),
    ("PPS: some contacts slide", "#FFF4D6"),
    ("TS: all contacts slide (gross slip)", "#F6DEDA"),
)

UNRESOLVED = ("GPS or PPS, not told apart", "#F1F1F1")


def normal_curve(analysis: "Analysis", axes: "Axes | None" = None) -> "Figure | None":
    """Load over normal approach, with the preload; of a face that yielded, its unloading."""
    contact = analysis.contact
    if contact is None:
        return None
    preload_N = contact.preload_N
    # Evenly spaced in the approach of a Hertz contact; the preload comes last.
    load_N = preload_N * np.append(1.5 * np.linspace(0.0, 1.0, 61) ** 1.5, 1.0)
    if contact.rung.solved_loads_N is not None:  # more loads would cost solutions
        load_N = np.append(contact.rung.solved_loads_N(contact.curve, preload_N), preload_N)
    elif contact.hardness_Pa or not np.array_equal(contact.use, analysis.caps.usable):
        load_N[:-1] /= 1.5  # the curve holds what can touch, and has yielded, up to the preload
    try:
        approach_m = np.asarray(contact.curve.approach_m(load_N))
    except ContactError:  # the caps carry the preload, but not half as much again
        load_N[:-1] /= 1.5
        approach_m = np.asarray(contact.curve.approach_m(load_N))
    bulk = contact.bulk_m / preload_N * (-1.0 if contact.bulk else 1.0)  # towards the other curve
    most_m = max(approach_m.max(), (approach_m + bulk * load_N).max())
    unit_m, unit = _unit_of_length(float(most_m), axes)
    unit_N, of_force = _unit_of_force(float(load_N.max()), axes)
    words = ("with", "without") if contact.bulk else ("without", "with")
    used, other = (f"{word} bulk term" for word in words)

    figure, axes = blank(f"Normal curve N(d), model: {contact.model}", axes=axes)
    label = f"{used} (used for slip)" if bulk else "N(d)"
    curve_N, curve_m = load_N[:-1], approach_m[:-1]
    if contact.rung.solved_loads_N is not None:
        axes.plot(curve_m / unit_m, curve_N / unit_N, ".", color=INK, label="_solved")
        curve_N, curve_m = _between(curve_N, curve_m)
    axes.plot(curve_m / unit_m, curve_N / unit_N, color=INK, linewidth=1.8, label=label)
    if bulk:
        there = (curve_m + bulk * curve_N) / unit_m, curve_N / unit_N
        axes.plot(*there, "--", color=INK, linewidth=1.2, label=other)
        with suppress(ContactError):  # a model of the map may carry what its caps do not
            alone_m = _caps_alone(analysis, contact).approach_m(curve_N)
            of_map = contact.rung.made_from == "map"
            label = "caps alone, not the map" if of_map else "caps without interaction"
            alone = alone_m / unit_m, curve_N / unit_N
            axes.plot(*alone, ":", color=INK, linewidth=1.2, label=label)
    touching = "whole face" if contact.rung.made_from == "nothing" else f"{contact.contacts}"
    part = analysis.slip is not None and not np.isclose(preload_N, analysis.joint.preload_N)
    of, on = (" of the scan", " on the scan") if part else ("", "")
    state = (
        f"{'load on the scan' if part else 'preload'} {engineering(preload_N, 'N', 4)}: "
        f"d = {engineering(approach_m[-1], 'm')}\n"
        f"{contact.rung.contact_name}: {touching}\n"
        f"normal stiffness{of}: {engineering(contact.stiffness_N_per_m, 'N/m')}"
    )
    if part and analysis.slip is not None:
        stiffness = analysis.slip.curve.stiffness_N_per_m(analysis.slip.approach_m)
        state += f"\nof the joint: {engineering(float(stiffness), 'N/m')}"
    point = approach_m[-1] / unit_m, preload_N / unit_N
    axes.plot(*point, "o", color=ACCENT, markersize=8, label=state, zorder=3)
    axes.set(
        xlabel=f"{_approach(contact)} [{unit}]",
        ylabel=f"normal load N{on} [{of_force}]",
    )
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    legend_beside(axes)
    return figure


def slip_loop(analysis: "Analysis", axes: "Axes | None" = None) -> "Figure | None":
    """First loading to gross slip with its phases, and cycles of three amplitudes.

    Where the normal load oscillates, the amplitudes of all steady cycles in place of the former.
    """
    slip = analysis.slip
    if slip is None or not slip.total_slip_displacement_m > 0.0:
        return None
    total_m = float(slip.total_slip_displacement_m)
    peaks_N = np.array(LOOP_SHARES) * slip.total_slip_force_N
    loops = [slip.loop(float(slip.displacement_m(peak_N))) for peak_N in peaks_N]
    end_m = 1.2 * max(total_m, *(np.abs(loop_m).max() for loop_m, _ in loops))
    unit_m, unit = _unit_of_length(end_m, axes)
    unit_N, of_force = _unit_of_force(float(slip.total_slip_force_N), axes)
    figure, axes = blank("Tangential force over slip displacement, one joint", axes=axes)
    displacement_m = np.union1d(np.linspace(0.0, end_m, 201), total_m)  # where it may end
    axes.plot(
        displacement_m / unit_m,
        slip.force_N(displacement_m) / unit_N,
        "--",
        color=INK,
        linewidth=1.2,
        label="amplitudes of steady cycles" if isinstance(slip, VaryingSlip) else "first loading",
    )
    _shade_scatter(
        axes,
        analysis,
        displacement_m / unit_m,
        lambda one: one.force_N(displacement_m) / unit_N,
    )
    drawn = zip(LOOP_SHARES, peaks_N, loops, LOOP_COLOURS, strict=True)
    for share, peak_N, (loop_m, loop_N), colour in drawn:
        axes.plot(
            loop_m / unit_m,
            loop_N / unit_N,
            color=colour,
            linewidth=1.6,
            label=f"{100.0 * share:.0f} % of gross slip: "
            f"W = {engineering(float(slip.energy_at_force_J(peak_N)), 'J')}",
        )
    _shade_phases(axes, slip, 0.0, end_m, unit_m)
    axes.set(
        xlim=(-end_m / unit_m, end_m / unit_m),
        xlabel=f"tangential displacement δ [{unit}]",
        ylabel=f"tangential force T [{of_force}]",
    )
    legend_beside(axes)
    return figure


def energy(analysis: "Analysis", axes: "Axes | None" = None) -> "Figure | None":
    """Energy lost in a cycle over its amplitude, both logarithmic."""
    slip = analysis.slip
    if slip is None or not slip.total_slip_displacement_m > 0.0:
        return None
    total_m = float(slip.total_slip_displacement_m)
    begin_m, end_m = 1e-3 * total_m, 3.0 * total_m
    displacement_m = np.geomspace(begin_m, end_m, 121)
    least_J = LEAST_ENERGY * float(slip.energy_at_force_J(slip.total_slip_force_N))
    shown = np.asarray(slip.energy_J(displacement_m)) > least_J
    if not shown.any():
        return None
    begin_m = float(displacement_m[shown][0])
    displacement_m = np.union1d(np.geomspace(begin_m, end_m, 121), total_m)  # where it may end
    energy_J = np.asarray(slip.energy_J(displacement_m))
    positive = energy_J > 0.0
    unit_m, unit = _unit_of_length(end_m, axes)
    figure, axes = blank("Energy lost per cycle, one joint", axes=axes)
    axes.loglog(
        displacement_m[positive] / unit_m, energy_J[positive], color=INK, linewidth=1.8, label="W"
    )
    _veil_unresolved(
        *(axes, analysis, begin_m / unit_m),
        lambda force_N: float(slip.displacement_m(force_N)) / unit_m,
    )
    _shade_scatter(
        axes, analysis, displacement_m / unit_m, lambda one: one.energy_J(displacement_m)
    )
    least_m = float(slip.displacement_m(_resolved_from_N(analysis)))
    resolved = positive & (displacement_m >= least_m)  # what the pixels draw has no slope
    first = int(np.argmax(resolved if resolved.any() else positive))
    guide_m = displacement_m[first] * np.array([1.0, 10.0])
    guide_J = energy_J[first] * np.array([1.0, 1000.0])
    axes.loglog(guide_m / unit_m, guide_J, ":", color=ACCENT, linewidth=1.8, label="slope 3")
    _shade_phases(axes, slip, begin_m, end_m, unit_m)
    answer = analysis.answer
    if answer is not None and answer.energy_J and begin_m < answer.displacement_m < end_m:
        place = answer.displacement_m / unit_m, answer.energy_J
        _mark_answer(axes, analysis, "energy_J", place, lambda one: engineering(one, "J"))
    axes.set(
        xlim=(begin_m / unit_m, end_m / unit_m),
        xlabel=f"amplitude of the tangential displacement δ [{unit}]",
        ylabel="energy lost per cycle W",
    )
    write_decades(axes.xaxis)
    write_decades(axes.yaxis, lambda energy_J: engineering(energy_J, "J"))
    legend_beside(axes)
    return figure


def loss_factor(analysis: "Analysis", axes: "Axes | None" = None) -> "Figure | None":
    """Loss factor of the mode over its amplitude, up to gross slip."""
    damping = analysis.damping
    if damping is None:
        return None
    defined = np.isfinite(damping.loss_factor) & (damping.loss_factor <= MOST_LOSS_FACTOR)
    if not defined.any():
        return None
    gross_m = damping.gross_slip_amplitude_m
    unit_m, unit = _unit_of_length(gross_m, axes)
    title = f"Loss factor from micro-slip: {structure_name(analysis.settings)}"
    figure, axes = blank(title, axes=axes)
    steady = np.isfinite(damping.loss_factor)
    amplitude_m, eta = damping.amplitude_m[steady], damping.loss_factor[steady]
    fine_m = np.geomspace(amplitude_m[0], amplitude_m[-1], 600)  # to end where it is not defined
    fine = _defined(np.interp(fine_m, amplitude_m, eta))
    axes.semilogx(fine_m / unit_m, fine, color=INK, linewidth=1.8, label="_loss factor")
    for i, scan in enumerate(_scans_of(analysis)):
        label = "_scan" if i else SCATTER
        alone = _defined(scan.damping.loss_factor)
        axes.plot(scan.damping.amplitude_m / unit_m, alone, color=GREY, linewidth=1.0, label=label)
    beyond = eta > MOST_LOSS_FACTOR
    if beyond.any():
        label = f"above {MOST_LOSS_FACTOR:g}: not lightly damped, not defined"
        axes.axhline(MOST_LOSS_FACTOR, color=ACCENT, linestyle="--", linewidth=1, label=label)
    elif damping.amplitude_at_peak_m is not None:
        where = engineering(damping.amplitude_at_peak_m, "m")
        if damping.peak_at_gross_slip:
            where += ", still growing there"
        label = f"greatest value {damping.peak_loss_factor:.3g} at {where}"
        axes.plot(
            damping.amplitude_at_peak_m / unit_m,
            damping.peak_loss_factor,
            "o",
            color=ACCENT,
            markersize=8,
            label=label,
        )
    first_m, first = damping.amplitude_at_first_peak_m, damping.first_peak_loss_factor
    if first_m is not None and first is not None and first <= MOST_LOSS_FACTOR:
        label = f"first maximum {first:.3g} at {engineering(first_m, 'm')}"
        axes.plot(first_m / unit_m, first, "o", color=INK, markersize=6, label=label)
    _mark_loss_factor(axes, analysis, unit_m)
    per_N = 1.0 / (damping.joint_stiffness_N_per_m * unit_m)
    least = damping.amplitude_m.min() / unit_m
    _veil_unresolved(axes, analysis, least, lambda force_N: force_N * per_N)
    colour = PHASES[2][1]
    gross = f"gross slip from {engineering(gross_m, 'm')}: no steady cycle"
    axes.axvspan(gross_m / unit_m, 3 * gross_m / unit_m, color=colour, label=gross, zorder=0)
    axes.set_xlim(least, 3 * gross_m / unit_m)
    write_decades(axes.xaxis)
    axes.set(xlabel=f"amplitude v at mid-span with rigid joints [{unit}]", ylabel="loss factor η")
    if (eta > 0.0).any():
        greatest = min(max(float(eta.max()), damping.peak_loss_factor), MOST_LOSS_FACTOR)
        axes.set_yscale("log")
        axes.set_ylim(max(eta[eta > 0.0].min(), LEAST_LOSS_FACTOR * greatest), 8.0 * greatest)
        write_decades(axes.yaxis)
    else:
        axes.set_ylim(bottom=0.0)
    axes.legend(loc="upper left", fontsize=9, framealpha=0.9, edgecolor="none")
    return figure


def _defined(loss_factor: np.ndarray) -> np.ndarray:
    """Return loss factors, NaN where the mode is no longer lightly damped."""
    return np.where(loss_factor <= MOST_LOSS_FACTOR, loss_factor, np.nan)


def _resolved_from_N(analysis: "Analysis") -> float:
    """Return the force below which less slips than the pixels of the map resolve; or zero."""
    contact, slip = analysis.contact, analysis.slip
    if contact is None or slip is None:
        return 0.0
    return resolved_share(contact) * float(slip.total_slip_force_N)


def _veil_unresolved(
    axes: "Axes", analysis: "Analysis", least: float, place: "Callable[[float], float]"
) -> None:
    """Whiten the curve, shown from the least on, where less slips than the pixels resolve."""
    end = place(_resolved_from_N(analysis))
    if end > least:  # else the legend would name a line that is not in view
        begin = min(axes.get_xlim()[0], end) / 10.0
        axes.axvspan(
            begin, end, color="white", alpha=0.65, linewidth=0.0, label="_veil", zorder=2.5
        )
        axes.axvline(end, color=INK, linewidth=0.8, linestyle=":", label=UNRESOLVED_SLIP)


def _between(load_N: np.ndarray, approach_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return loads and approaches between the few solved ones, as if of Hertz contacts."""
    from scipy.interpolate import PchipInterpolator

    fine_N = load_N[-1] * np.linspace(0.0, 1.0, 201) ** 1.5
    apart = np.diff(load_N, prepend=-1.0) > 1e-12 * load_N  # the share of a joint rounds loads
    curve = PchipInterpolator(load_N[apart] ** (2 / 3), approach_m[apart])
    return fine_N, curve(fine_N ** (2 / 3))


def _mark_loss_factor(axes: "Axes", analysis: "Analysis", unit_m: float) -> None:
    """Mark the loss factor that was asked for, or where it is not defined."""
    answer = analysis.answer
    if answer is not None and answer.loss_factor:
        place = answer.amplitude_m / unit_m, answer.loss_factor
        _mark_answer(axes, analysis, "loss_factor", place, "{:.3g}".format)
    elif answer is not None and answer.loss_factor is None:
        label = f"asked: {engineering(answer.amplitude_m, 'm')}, where it is not defined"
        axes.axvline(answer.amplitude_m / unit_m, color=LOOP_COLOURS[1], linewidth=1.2, label=label)


def _mark_answer(
    axes: "Axes",
    analysis: "Analysis",
    name: str,
    place: tuple[float, float],
    write: "Callable[[float], str]",
) -> None:
    """Mark a number of the answer, with its interval."""
    band, (x, value) = analysis.band, place
    if band is None:
        return
    low, high = band.interval[name]
    down, up = value - low, high - value
    axes.errorbar(
        [x],
        [value],
        yerr=[[max(down, 0.0)], [max(up, 0.0)]] if np.isfinite(high) else None,
        fmt="D",
        color=LOOP_COLOURS[1],
        capsize=4,
        label=f"answer {write(value)}"
        + (f", {write(low)} to {write(high)}" if np.isfinite(high) else f", at least {write(low)}"),
        zorder=3,
    )


def _approach(contact: "ContactState") -> str:
    """Return what the approach of the curve is: of a face that yielded, it unloads along that."""
    yielded = contact.first_loading_approach_m != contact.approach_m
    return "recovery d on unloading" if yielded else "normal approach d from first touch"


def _caps_alone(analysis: "Analysis", contact: "ContactState") -> "NormalCurve":
    """Return the normal curve of the same caps without interaction."""
    from capslip.contact.material import yield_law
    from capslip.contact.models.caps import caps as curve_of
    from capslip.contact.solvers.yielding import first_loading

    caps, E_star_Pa = analysis.caps, contact.composite.E_star_Pa
    peak_m = caps.peak_height_m[caps.usable]
    if not peak_m.size:  # a map needs none
        raise ContactError("no cap can carry")
    radius_m, depth_m = caps.radius_m[caps.usable], peak_m.max() - peak_m
    law = yield_law(analysis.settings.material)
    if law is not None:
        after = first_loading(law, radius_m, depth_m, E_star_Pa, contact.preload_N)
        radius_m, depth_m = after.radius_m, after.depth_m - after.depth_m.min()
    return curve_of(radius_m, depth_m, E_star_Pa)


def _unit_of_length(largest_m: float, axes: "Axes | None") -> tuple[float, str]:
    """Length of one unit that suits the largest value, or stands on the axis, and its name."""
    return unit_on(axes.get_xlabel() if axes else "", largest_m, "m")


def _unit_of_force(largest_N: float, axes: "Axes | None") -> tuple[float, str]:
    """Return the unit of force, as `_unit_of_length` does that of length."""
    return unit_on(axes.get_ylabel() if axes else "", largest_N, "N")


def _shade_phases(
    axes: "Axes", slip: "SlipCurve", begin_m: float, end_m: float, unit_m: float
) -> None:
    """Shade the phases of first loading; caps that are all loaded alike have no PPS."""
    total_m = float(slip.total_slip_displacement_m)
    limits_m = slip.limits_m[np.isfinite(slip.limits_m)]
    if isinstance(slip, VaryingSlip):  # they are those of the constant load
        limits_m = limits_m[:0]
    first_m = float(limits_m.min(initial=total_m))
    edges_m = [begin_m, max(begin_m, first_m), total_m, end_m]
    # A curve that does not know its limits has one band for both.
    phases = PHASES if limits_m.size else (UNRESOLVED, *PHASES[1:])
    at = np.log(edges_m) if begin_m > 0.0 else np.array(edges_m)  # as far as they are on the axis
    width = at[-1] - (at[0] if begin_m > 0.0 else -at[-1])
    thin = np.diff(at) < THINNEST * width
    for (label, colour), (left_m, right_m), hidden in zip(
        phases, pairwise(edges_m), thin, strict=True
    ):
        if not hidden:
            axes.axvspan(left_m / unit_m, right_m / unit_m, color=colour, label=label, zorder=0)


def _scans_of(analysis: "Analysis") -> "Sequence[Any]":
    """Return the scans of a joint of several, each with the result of a joint that is all alike."""
    return analysis.known if isinstance(analysis, JointOfScans) else ()


def _shade_scatter(
    axes: "Axes", analysis: "Analysis", x: np.ndarray, curve: "Callable[[SlipCurve], Any]"
) -> None:
    """Shade what lies between the curves of several scans."""
    each = np.array([curve(scan.slip) for scan in _scans_of(analysis)])
    if len(each):
        axes.fill_between(x, each.min(axis=0), each.max(axis=0), color=GREY, label=SCATTER)
