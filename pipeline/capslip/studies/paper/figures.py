"""The paper's Figs. 5, 6, 7 and 10, drawn from the corrected equations."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from capslip.output.canvas import ACCENT, FAMILY_COLOUR, INK, blank
from capslip.output.quantity import engineering, scaled
from capslip.settings import Structure
from capslip.structure.response import Damping, response
from capslip.studies.paper import printed as paper

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from capslip.contact.slip import SlipCurve

SIZE = (6.4, 4.4)  # inches; two fit beside each other on the page
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9")  # Okabe and Ito
PRINTED = "#777777"
NM = 1e9


def figures() -> "dict[str, tuple[Callable[[], Figure], str]]":
    """Return the drawing and the caption of every picture, by the name of its file."""
    one_sphere = (
        "One G-sphere of the reference case (the paper does not say whose parameters it drew). "
    )
    sevens = (
        "Solid: corrected equations, up to gross slip. Dashed: Eq. 16 as printed inside Eq. 13; "
        "the loss of the P-spheres then vanishes as soon as they slip."
    )
    return {
        "fig05_partial": (
            lambda: fig_5(0.8),
            one_sphere + "Cycle in partial slip, to 0.8 µN. Dashed: Eqs. 4 to 6 as printed, a "
            "third of the displacement.",
        ),
        "fig05_total": (lambda: fig_5(None), one_sphere + "Cycle that passes total slip."),
        "fig06": (
            lambda: fig_6(0.9),
            "Reference case to 0.9 of total slip of the G-spheres. The knees are the P-spheres: "
            "they have slipped totally from there on.",
        ),
        "fig06_small": (
            lambda: fig_6(0.16),
            "The same joint to four times the limit of the P-spheres. They slip totally at δ_P,lim "
            "on first loading and twice as far from each tip.",
        ),
        "fig07a": (lambda: fig_7("7a"), "Reference. " + sevens),
        "fig07b": (lambda: fig_7("7b"), "Number n of P-spheres. " + sevens),
        "fig07c": (lambda: fig_7("7c"), "Number m of G-spheres at given approach. " + sevens),
        "fig07d": (lambda: fig_7("7d"), "Approach at given h. " + sevens),
        "fig07e": (lambda: fig_7("7e"), "Approach, h and m together. " + sevens),
        "fig07f": (
            lambda: fig_7("7f"),
            "Friction coefficient: it stretches the amplitude and leaves the height. " + sevens,
        ),
        "fig10": (
            fig_10,
            "Reference case, one joint. Dashed and dotted: Eq. 16 as printed, in its two readings; "
            "both jump at δ_P,lim.",
        ),
    }


def cases_of(figure: str) -> list[paper.Case]:
    """Return the sets of parameters of a part of Fig. 7, the reference first."""
    others = [c for c in paper.TABLE_1 if figure in c.figures and c is not paper.REFERENCE]
    if figure == "7f":
        others = [
            replace(paper.REFERENCE, friction_coefficient=mu, figures=("7f",))
            for mu in paper.FRICTION_OF_7F
        ]
    return [paper.REFERENCE, *others]


def loss_factors(case: paper.Case) -> tuple[Damping, np.ndarray]:
    """Return the response of the stand-in beam and the loss factor with the printed Eq. 16."""
    slip, mode, joints = paper.joint(case), paper.stand_in_beam(), Structure().joints
    K_m, K_s = mode.modal_stiffness_N_per_m, mode.joint_stiffness_N_per_m
    gross_m = slip.total_slip_force_N / K_s
    phase_m = float(slip.force_N(slip.limits_m[1])) / K_s
    amplitude_m = np.union1d(
        np.geomspace(1e-3 * gross_m, gross_m, 400), phase_m * np.array([1 - 1e-6, 1 + 1e-6])
    )
    damping = response(slip, K_m, K_s, joints, amplitude_m)
    printed_J = joints * paper.printed_energy_J(case, slip, damping.displacement_m, "eq_13")
    return damping, printed_J / (np.pi * K_m * amplitude_m**2)


def fig_5(share: float | None) -> "Figure":
    """Cycle of one spherical contact: to a share of mu N, or through total slip."""
    case = replace(paper.REFERENCE, m=1, n=0)
    slip = paper.joint(case)
    limit_N, limit_m = slip.total_slip_force_N, slip.total_slip_displacement_m
    amplitude_m = 1.5 * limit_m if share is None else float(slip.displacement_m(share * limit_N))
    title = "partial slip" if share is not None else "through total slip"
    figure, axes = blank(f"Fig. 5: one spherical contact, {title}", *SIZE)
    _cycle(axes, slip, amplitude_m)
    if share is not None:
        g, _ = paper.contacts(paper.joint(paper.REFERENCE))
        T_max = share * limit_N
        first_N, branch_N = np.linspace(0, T_max, 101), np.linspace(-T_max, T_max, 201)
        for delta_m, T_N, label in (
            (g.printed_eq_4_to_6(first_N, T_max, 0), first_N, "Eqs. 4 to 6 as printed"),
            (g.printed_eq_4_to_6(branch_N, T_max, 1), branch_N, None),
            (g.printed_eq_4_to_6(branch_N, T_max, 2), branch_N, None),
        ):
            axes.plot(NM * delta_m, T_N, "--", color=PRINTED, linewidth=1.3, label=label)
    else:
        axes.axvline(NM * limit_m, color=ACCENT, linestyle=":", label="δ_lim")
    _axes_of_force(axes)
    return figure


def fig_6(share: float) -> "Figure":
    """Cycle of the reference joint to a share of the displacement at total slip."""
    slip = paper.joint(paper.REFERENCE)
    figure, axes = blank("Fig. 6: cycle of the joint, m = 5 and n = 18", *SIZE)
    _cycle(axes, slip, share * slip.total_slip_displacement_m)
    limit_m = float(slip.limits_m[1])
    axes.axvspan(0, NM * limit_m, color="#E8F3EC", zorder=0, label="GPS (first loading)")
    axes.axvspan(
        NM * limit_m,
        NM * share * slip.total_slip_displacement_m,
        color="#FFF4D6",
        zorder=0,
        label="PPS (first loading)",
    )
    _axes_of_force(axes)
    return figure


def fig_7(part: str) -> "Figure":
    """Loss factor over the amplitude v at mid-span."""
    figure, axes = blank(f"Fig. {part[0]}({part[1]}): loss factor of the beam", *SIZE)
    highest = 0.0
    for case, colour in zip(cases_of(part), (INK, *COLOURS), strict=False):
        damping, printed = loss_factors(case)
        v_um = damping.amplitude_m * 1e6
        load_N = paper.joint(case).preload_N
        axes.plot(
            v_um,
            100 * damping.loss_factor,
            color=colour,
            linewidth=1.7,
            label=f"{_label(part, case)} ({load_N:.0f} N)",
        )
        axes.plot(v_um, 100 * printed, "--", color=colour, linewidth=1.0)
        axes.plot(v_um[-1], 100 * damping.loss_factor[-1], "o", color=colour, markersize=4)
        highest = max(highest, float(100 * damping.loss_factor[-1]))
    axes.plot([], [], "--", color=PRINTED, linewidth=1.0, label="Eq. 16 as printed")
    axes.plot([], [], "o", color=PRINTED, markersize=4, label="gross slip")
    axes.set(xlabel="amplitude v at mid-span [µm]", ylabel="loss factor η [%]")
    axes.set_xscale("log")
    axes.set_xlim(left=1e-2)
    axes.set_ylim(0, 1.08 * highest)
    axes.legend(loc="upper left", fontsize=8, framealpha=0.9, edgecolor="none")
    return figure


def fig_10() -> "Figure":
    """Energy lost per cycle over the displacement of the joint."""
    case = paper.REFERENCE
    slip = paper.joint(case)
    limit_m = float(slip.limits_m[1])
    delta = np.union1d(
        np.geomspace(2e-10, slip.total_slip_displacement_m, 400),
        limit_m * np.array([1 - 1e-6, 1 + 1e-6]),
    )
    figure, axes = blank("Fig. 10: energy lost per cycle, one joint", *SIZE)
    axes.loglog(NM * delta, slip.energy_J(delta), color=INK, linewidth=1.8, label="corrected")
    for printed_J, style, label in (
        (
            paper.printed_energy_J(case, slip, delta, "joule"),
            "--",
            "Eq. 16 as printed, taken in joules",
        ),
        (
            paper.printed_energy_J(case, slip, delta, "eq_13"),
            ":",
            "Eq. 16 as printed, inside Eq. 13",
        ),
    ):
        axes.loglog(
            NM * delta,
            np.where(delta > limit_m, printed_J, np.nan),
            style,
            color=FAMILY_COLOUR["G"],
            linewidth=1.4,
            label=label,
        )
    axes.axvline(
        NM * limit_m, color=ACCENT, linewidth=1.0, label=f"δ_P,lim = {engineering(limit_m, 'm')}"
    )
    axes.set(xlabel="amplitude of the displacement δ [nm]", ylabel="W [J]")
    axes.legend(loc="upper left", fontsize=8, framealpha=0.9, edgecolor="none")
    return figure


def _cycle(axes: "Axes", slip: "SlipCurve", amplitude_m: float) -> None:
    loop_m, loop_N = slip.loop(amplitude_m)
    first_m = np.linspace(0, amplitude_m, 201)
    axes.plot(NM * loop_m, loop_N, color=INK, linewidth=1.7, label="corrected")
    axes.plot(NM * first_m, slip.force_N(first_m), color=INK, linewidth=1.0)


def _axes_of_force(axes: "Axes") -> None:
    axes.set(xlabel="displacement δ [nm]", ylabel="tangential force T [N]")
    axes.legend(loc="upper left", fontsize=8, framealpha=0.9, edgecolor="none")


def _label(part: str, case: paper.Case) -> str:
    approach, unit = scaled(np.array(case.delta_n_m), "m")
    return {
        "7a": f"m = {case.m}, n = {case.n}",
        "7b": f"n = {case.n}",
        "7c": f"m = {case.m}",
        "7d": f"$δ_n$ = {approach:.0f} {unit}",
        "7e": f"m = {case.m}, $δ_n$ = {approach:.0f} {unit}",
        "7f": f"µ = {case.friction_coefficient:g}",
    }[part]
