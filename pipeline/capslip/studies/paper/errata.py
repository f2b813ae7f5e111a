"""The errata of the paper: every number in them is computed, none typed."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from capslip.settings import Structure
from capslip.structure.response import response
from capslip.studies.page import write
from capslip.studies.paper import printed as paper
from capslip.studies.paper.errata_formulas import CERTAINTY, Erratum, formula_errata


def errata() -> tuple[Erratum, ...]:
    """Compute the evidence for every erratum, in the order of the paper."""
    return (
        *formula_errata(),
        _modulus_of_table_1(),
        _phase_of_7d(),
        _diameter_of_table_2(),
        _counts_of_table_2(),
        _heights_of_table_2(),
        _footprint_of_table_2(),
        _small_amplitudes(),
        _exponent(),
        _who_governs(),
        _large_amplitudes(),
        _beam_shear(),
    )


def errata_markdown(found: tuple[Erratum, ...]) -> str:
    """Write the errata as a page of Markdown: `docs/errata.md`."""
    lines = [
        "# Errata of the source",
        "",
        "Peyret, Chevallier and Dion 2016, doi 10.1142/S1758825116500976. This page is written by",
        "`make reproduce`; every number in it is computed by "
        "`pipeline/capslip/studies/paper/errata.py`. Edit",
        "that file, not this one. The pictures are on the page of `capslip reproduce`.",
        "",
    ]
    for i, one in enumerate(found, 1):
        lines += [
            f"## {i}. {one.where}",
            "",
            f"*{one.certainty}: {CERTAINTY[one.certainty]}*",
            "",
            f"- Printed: {one.printed}",
            f"- Right: {one.correct}",
            f"- Evidence: {one.evidence}",
            "",
        ]
    return "\n".join(lines)


def table_1_error(youngs_modulus_Pa: float) -> np.ndarray:
    """Return computed over printed load, less one, for the fourteen loads."""
    material = paper.steel(youngs_modulus_Pa)
    loads_N = [paper.joint(case, material).preload_N for case in paper.TABLE_1]
    return np.array(loads_N) / [case.printed_N for case in paper.TABLE_1] - 1


def outside_rounding(E_star_Pa: float, within_printed_radii: bool) -> int:
    """Count the loads of Table 1 that no rounding explains.

    Parameters
    ----------
    E_star_Pa : float
        Composite modulus.
    within_printed_radii : bool
        Let the radii take any values that print as they do, and keep the best; otherwise they are
        exact.
    """
    cases = paper.TABLE_1
    printed_N = np.array([case.printed_N for case in cases])
    steps = np.linspace(-0.05, 0.05, 21) if within_printed_radii else np.zeros(1)
    R_G = (paper.RADIUS_G_M + steps)[:, None, None]
    R_P = (paper.RADIUS_P_M + steps)[:, None]
    g = np.array([case.m * case.delta_n_m**1.5 for case in cases])
    p = np.array([case.n * (case.delta_n_m - case.h_m) ** 1.5 for case in cases])
    loads_N = 4 / 3 * E_star_Pa * (np.sqrt(R_G) * g + np.sqrt(R_P) * p)
    return int((np.abs(loads_N - printed_N) > 0.5 + 1e-9).sum(axis=-1).min())


def _modulus_of_table_1() -> Erratum:
    right_Pa, printed_Pa = paper.YOUNGS_MODULUS_OF_TABLE_1_PA, paper.YOUNGS_MODULUS_PA
    right, wrong = table_1_error(right_Pa), table_1_error(printed_Pa)
    E_star_Pa, half_Pa = paper.steel(right_Pa).E_star_Pa, printed_Pa / 2
    numbers = {
        "worst_at_200": float(np.abs(right).max()),
        "least_at_220": float(wrong.min()),
        "worst_at_220": float(wrong.max()),
        "E_star_at_200_Pa": E_star_Pa,
        "E_star_at_220_without_nu_Pa": half_Pa,
        "outside_at_200": outside_rounding(E_star_Pa, False),
        "outside_without_nu": outside_rounding(half_Pa, False),
        "outside_at_200_radii_rounded": outside_rounding(E_star_Pa, True),
        "outside_without_nu_radii_rounded": outside_rounding(half_Pa, True),
    }
    return Erratum(
        "Table 1, with E of Sec. 1",
        f"E = {printed_Pa / 1e9:g} GPa",
        f"the loads belong to E = {right_Pa / 1e9:g} GPa (or to 220 GPa with 1 - nu^2 forgotten)",
        f"With {right_Pa / 1e9:g} GPa all {len(right)} loads are within "
        f"{100 * numbers['worst_at_200']:.2f} %; with {printed_Pa / 1e9:g} GPa all are "
        f"{100 * numbers['least_at_220']:.1f} to {100 * numbers['worst_at_220']:.1f} % too great. "
        f"The loads fix E* alone: E = 220 GPa with E* = E / 2 = {half_Pa / 1e9:.2f} GPa is hard to "
        f"tell from {E_star_Pa / 1e9:.2f} GPa. With the radii as printed "
        f"{numbers['outside_without_nu']} loads then lie outside their rounding "
        f"(200 GPa: {numbers['outside_at_200']}); with radii anywhere inside theirs "
        f"{numbers['outside_without_nu_radii_rounded']} (200 GPa: "
        f"{numbers['outside_at_200_radii_rounded']}).",
        "proved",
        numbers,
    )


def _phase_of_7d() -> Erratum:
    cases = [case for case in paper.TABLE_1 if "7d" in case.figures]
    limits_m = np.array([paper.joint(case).limits_m for case in cases])
    share = limits_m[:, 1] / limits_m[:, 0]
    numbers = {f"limit_ratio_{i}": float(x) for i, x in enumerate(share, 1)}
    text = ", ".join(f"{x:.2f}" for x in share)
    return Erratum(
        "Sec. 2.4, Fig. 7(d)",
        'more delta_n at fixed h "no longer allows the phase of macro-slip" of the P-spheres',
        "the phase comes at greater displacements, but it is there",
        f"delta_P,lim / delta_G,lim = 1 - h / delta_n = {text} for the three loads: the P-spheres "
        "still slip totally before the G-spheres do.",
        "wording",
        numbers,
    )


def _diameter_of_table_2() -> Erratum:
    g, p = paper.TABLE_2
    half = 0.05e-6, 0.05e-2
    greatest_m = paper.radius_of_eq_18_m(g.diameter_m + half[1], g.cap_height_m - half[0])
    needed_m = paper.diameter_of_eq_18_m(g.radius_m, g.cap_height_m)
    numbers = {
        "R_of_printed_D_m": paper.radius_of_eq_18_m(g.diameter_m, g.cap_height_m),
        "R_of_18_mm_m": paper.radius_of_eq_18_m(18e-3, g.cap_height_m),
        "D_of_printed_R_m": needed_m,
        "greatest_R_within_rounding_m": greatest_m,
        "R_P_m": paper.radius_of_eq_18_m(p.diameter_m, p.cap_height_m),
    }
    return Erratum(
        "Table 2, G-spheres",
        f"D = {g.diameter_m * 1e3:g} mm beside df = {g.cap_height_m * 1e6:g} um and "
        f"R = {g.radius_m:g} m",
        "D = 18 mm",
        f"Eq. 18 gives R = {numbers['R_of_printed_D_m']:.2f} m for the printed D and df, at most "
        f"{greatest_m:.2f} m within their rounding; the printed R needs D = "
        f"{needed_m * 1e3:.2f} mm, and 18 mm gives {numbers['R_of_18_mm_m']:.2f} m. The row of the "
        f"P-spheres is right: {numbers['R_P_m']:.2f} m. The loads of Table 1 need the printed R.",
        "proved",
        numbers,
    )


def _counts_of_table_2() -> Erratum:
    case = paper.REFERENCE
    swapped_N = paper.joint(replace(case, m=case.n, n=case.m)).preload_N
    numbers = {"load_N": paper.joint(case).preload_N, "load_swapped_N": swapped_N}
    return Erratum(
        "Table 2, numbers",
        "G: n = 5; P: m = 18",
        "G: m = 5; P: n = 18",
        f"Text and Table 1. 5 G- and 18 P-spheres carry {numbers['load_N']:.1f} N (printed: "
        f"{case.printed_N:g} N), 18 G- and 5 P-spheres {swapped_N:.0f} N.",
        "proved",
        numbers,
    )


def _heights_of_table_2() -> Erratum:
    g, p = paper.TABLE_2
    difference_m = g.cap_height_m - p.cap_height_m
    numbers = {
        "difference_m": difference_m,
        "least_m": difference_m - 1e-7,
        "h_m": paper.TABLE_2_H_M,
    }
    return Erratum(
        "Table 2, heights",
        f"df = {g.cap_height_m * 1e6:g} and {p.cap_height_m * 1e6:g} um beside "
        f"h = {paper.TABLE_2_H_M * 1e6:g} um",
        "not known; the model uses R and h, and df only through R",
        "Caps that one plane cuts differ in height by h. The printed heights differ by "
        f"{difference_m * 1e6:.2f} um, at least {numbers['least_m'] * 1e6:.2f} um within their "
        f"rounding, not by {paper.TABLE_2_H_M * 1e6:.2f} um. So df does not count from one cut "
        "height, or h is not the difference of the mean peaks.",
        "inferred",
        numbers,
    )


def _footprint_of_table_2() -> Erratum:
    areas_m2 = {
        D_G: sum(
            row.count * math.pi / 4 * D**2
            for row, D in zip(paper.TABLE_2, (D_G, paper.TABLE_2[1].diameter_m), strict=True)
        )
        for D_G in (paper.TABLE_2[0].diameter_m, 18e-3)
    }
    numbers = {
        "area_printed_m2": areas_m2[paper.TABLE_2[0].diameter_m],
        "area_m2": areas_m2[18e-3],
        "face_m2": areas_m2[18e-3] / 0.10 / 2,
    }
    return Erratum(
        "Table 2 with Sec. 3",
        "D = 16 and 17 mm for caps found in the highest 10 % of the points",
        "the D printed is not that of the region at the cut; caps are extended below it",
        f"5 and 18 such discs (D_G = 18 mm) cover {numbers['area_m2'] * 1e6:.0f} mm^2 (printed "
        f"D_G: {numbers['area_printed_m2'] * 1e6:.0f} mm^2). As 10 % of two faces that asks for "
        f"{numbers['face_m2'] * 1e4:.0f} cm^2 a face, a square of "
        f"{math.sqrt(numbers['face_m2']) * 1e3:.0f} mm: too thick a section for a beam of 400 mm.",
        "inferred",
        numbers,
    )


def _small_amplitudes() -> Erratum:
    slip = paper.joint(paper.REFERENCE)
    mode = paper.stand_in_beam()
    delta = 1e-4 * float(slip.limits_m[1]) * np.array([0.99, 1.01])
    v = 1e-4 * slip.total_slip_force_N / mode.joint_stiffness_N_per_m * np.array([0.99, 1.01])
    loss = response(
        slip, mode.modal_stiffness_N_per_m, mode.joint_stiffness_N_per_m, 1, v
    ).loss_factor
    numbers = {
        "exponent_of_W": _slope(delta, slip.energy_J(delta)),
        "exponent_of_eta": _slope(v, loss),
        "W_at_1_nm_J": float(slip.energy_J(1e-9)),
    }
    return Erratum(
        "Sec. 4, Fig. 10",
        '"for small displacements W_diss is nil", "the loss-factor is first nil"',
        "W ~ delta^3 and eta ~ v: small, never nil",
        f"At 1e-4 delta_P,lim W grows as delta^{numbers['exponent_of_W']:.3f}, at 1e-4 of gross "
        f"slip eta as v^{numbers['exponent_of_eta']:.2f}. At 1 nm the reference joint loses "
        f"{numbers['W_at_1_nm_J']:.2e} J a cycle.",
        "proved",
        numbers,
    )


def _exponent() -> Erratum:
    slip = paper.joint(paper.REFERENCE)
    p_m, g_m = float(slip.limits_m[1]), float(slip.total_slip_displacement_m)
    delta = np.geomspace(1e-3 * p_m, g_m, 4001)
    # dW/d delta = 4 (T - T' delta) by Masing's rule, so the exponent needs no difference.
    lost, force = slip.energy_J(delta), slip.force_N(delta)
    exponent = 4 * (force - slip.stiffness_N_per_m(delta) * delta) * delta / lost
    exponent = exponent[delta > 1e-2 * p_m]  # below, T - T' delta cancels
    across = slip.energy_J(p_m * np.array([1 - 1e-9, 1 + 1e-9]))
    numbers = {
        "least_exponent": float(exponent.min()),
        "greatest_exponent": float(exponent.max()),
        "jump_at_delta_P": float(np.diff(across)[0] / across[0]),
    }
    return Erratum(
        "Sec. 4, Fig. 10",
        'W_diss is "a non-continuous polynomial function with an exponent between 0 and 2"',
        "continuous, with a continuous slope; the local exponent lies between 1.5 and 5",
        "d ln W / d ln delta runs from 3 at small displacements between "
        f"{numbers['least_exponent']:.2f} and {numbers['greatest_exponent']:.2f} up to "
        f"delta_G,lim. Across delta_P,lim (2e-9 of it) W changes by "
        f"{numbers['jump_at_delta_P']:.0e} of itself. The jump comes from the printed Eq. 16.",
        "proved",
        numbers,
    )


def _who_governs() -> Erratum:
    from scipy.optimize import brentq

    case = paper.REFERENCE
    slip = paper.joint(case)
    g, p = paper.contacts(slip)

    def excess_J(delta: float) -> float:
        x = np.array(delta)
        return float(paper.corrected_eq_16_J(case, p, x) - case.m * g.eq_8(x))

    equal_m = float(brentq(excess_J, 2 * p.delta_lim, g.delta_lim, xtol=1e-16))
    last_J = float(paper.corrected_eq_16_J(case, p, np.array(g.delta_lim)))
    numbers = {
        "equal_at_m": equal_m,
        "share_of_P_at_total_slip": last_J / float(slip.energy_J(g.delta_lim)),
    }
    return Erratum(
        "Sec. 4, Fig. 10",
        '"for high displacements W_diss is governed by Eq. (16) of the PPS"',
        "by Eq. 15 and the right Eq. 16 only at middle displacements, then by the G-spheres (14)",
        f"The G-spheres lose more than the P-spheres from {equal_m * 1e9:.1f} nm on; at "
        f"delta_G,lim ({g.delta_lim * 1e9:.1f} nm) the P-spheres have "
        f"{100 * numbers['share_of_P_at_total_slip']:.0f} % of the loss.",
        "wording",
        numbers,
    )


def _large_amplitudes() -> Erratum:
    slip = paper.joint(paper.REFERENCE)
    mode = paper.stand_in_beam()
    damping = response(
        slip,
        mode.modal_stiffness_N_per_m,
        mode.joint_stiffness_N_per_m,
        Structure().joints,
    )
    numbers = {
        "loss_factor_at_gross_slip": float(damping.loss_factor[-1]),
        "gross_slip_amplitude_m": damping.gross_slip_amplitude_m,
    }
    return Erratum(
        "Sec. 4, Fig. 7(a)",
        "the loss factor tends to zero when delta tends to infinity",
        "no steady cycle exists past gross slip, v = mu N / K_s, when the force is given",
        "The structure gives the force (T = K_s v), and T ends at mu N. With the stand-in beam the "
        f"loss factor falls after its first maximum and then grows to "
        f"{numbers['loss_factor_at_gross_slip']:.3g} at gross slip, "
        f"{numbers['gross_slip_amplitude_m'] * 1e6:.2f} um. A limit of zero needs delta in "
        "proportion to v, a link that the paper does not print.",
        "open",
        numbers,
    )


def _beam_shear() -> Erratum:
    thin = paper.stand_in_beam(theory="euler_bernoulli")
    length_m = Structure().beam.length_m
    ratios = [
        paper.stand_in_beam(thickness_m=float(x) * length_m).quasi_static_ratio
        for x in np.geomspace(1 / 100, 1 / 4, 30)
    ]
    numbers = {
        "euler_bernoulli": thin.quasi_static_ratio,
        "timoshenko_least": min(ratios),
        "timoshenko_greatest": max(ratios),
    }
    return Erratum(
        "Appendix B",
        "the shear at the joint is 20 % higher for the mode than under a static force",
        "about 16 % for a beam of constant rectangular section",
        f"Euler-Bernoulli: {100 * (thin.quasi_static_ratio - 1):.1f} %. Timoshenko, thickness from "
        f"1/100 to 1/4 of the length: {100 * (min(ratios) - 1):.1f} to "
        f"{100 * (max(ratios) - 1):.1f} %. The section of the paper's beam is not printed.",
        "open",
        numbers,
    )


def _slope(x: np.ndarray, y: np.ndarray) -> float:
    return float(np.diff(np.log(y))[0] / np.diff(np.log(x))[0])


def write_errata(path: str | Path) -> None:
    """Write `docs/errata.md`; raises OutputError where it cannot be written."""
    path = Path(path)
    write(path.parent, {path.name: errata_markdown(errata())})


if __name__ == "__main__":
    write_errata(sys.argv[1] if len(sys.argv) > 1 else "docs/errata.md")
