"""The errata of the paper: every number in them is computed, none typed.

The words stand in `errata.toml`; the function of the same name computes the numbers in them.
"""

import math
import sys
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from capslip.settings import Structure
from capslip.structure.response import response
from capslip.studies.page import write
from capslip.studies.paper import printed as paper

CERTAINTY = {
    "proved": "wrong as printed",
    "inferred": "cannot all be true as printed",
    "wording": "words that the formulas contradict",
    "omitted": "missing in print",
    "numerical": "right, but not in double precision",
    "open": "not reproduced; the paper does not say enough",
}
UNITS = {"": 1.0, "%": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "mm^2": 1e-6, "cm^2": 1e-4}
UNITS["GPa"] = 1e9


@dataclass(frozen=True)
class Erratum:
    """One place of the paper, what is right there, and why."""

    where: str
    printed: str
    correct: str
    evidence: str
    certainty: str  # a key of CERTAINTY
    numbers: dict[str, float]


class _Number(float):
    """A number that is written by a format and, behind a stroke, in a unit: `{x:.2f/mm}`."""

    def __format__(self, spec: str) -> str:
        digits, _, unit = spec.partition("/")
        return format(float(self) / UNITS[unit], digits)


def errata() -> tuple[Erratum, ...]:
    """Compute the evidence for every erratum, in the order of the paper."""
    words = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    found = []
    for name, erratum in words.items():
        numbers = EVIDENCE[name]()
        written = {key: _Number(value) for key, value in numbers.items()}
        texts = {key: text.format_map(written) for key, text in erratum.items()}
        found.append(Erratum(**texts, numbers=numbers))
    return tuple(found)


def errata_markdown(found: tuple[Erratum, ...]) -> str:
    """Write the errata as a page of Markdown: `docs/errata.md`."""
    lines = [
        "# Errata of the source",
        "",
        "Peyret, Chevallier and Dion 2016, doi 10.1142/S1758825116500976. This page is written by",
        "`make reproduce`; every number in it is computed by `studies/paper/errata.py`, its words",
        "are those of `errata.toml` there. Edit these, not this page. The pictures are on the page",
        "of `capslip reproduce`.",
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


def _factor_three() -> dict[str, float]:
    g, _ = paper.contacts(paper.joint(paper.REFERENCE))
    limit_N = g.mu * g.N
    at_limit_m = float(g.printed_eq_4_to_6(np.array(limit_N), limit_N, 0))
    T_max = 0.8 * limit_N
    node, weight = np.polynomial.legendre.leggauss(200)
    T = T_max * node
    # The unloading branch lies above in delta: the area is the integral of the difference over T.
    unloading, loading = (g.printed_eq_4_to_6(T, T_max, phase) for phase in (1, 2))
    loop_J = float(T_max * weight @ (unloading - loading))
    W_J = float(g.eq_8(g.delta_lim * (1 - (1 - T_max / limit_N) ** (2 / 3))))
    return {"delta_over_limit": at_limit_m / g.delta_lim, "loop_over_eq_8": loop_J / W_J}


def _wording_of_the_limit() -> dict[str, float]:
    g, _ = paper.contacts(paper.joint(paper.REFERENCE))
    return {"force_over_mu_N_at_limit": float(g.eq_11(np.array(g.delta_lim))) / (g.mu * g.N)}


def _compliance_of_shear() -> dict[str, float]:
    nu = paper.POISSON_RATIO
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    # Cerruti: a tangential point load Q moves the surface by Q / (2 pi G r) times this.
    mean = float(np.mean(1 - nu + nu * np.cos(angle) ** 2))
    right, printed = 2 - nu, 2 - nu**2
    excess = printed / right - 1
    return {"nu": nu, "computed": 2 * mean, "right": right, "printed": printed, "excess": excess}


def _cancellation() -> dict[str, float]:
    def errors(s: float) -> tuple[float, float]:
        exact = paper.exact_bracket_of_eq_8(s)
        q = math.sqrt(1 - s)
        factors = (s / (1 + q)) ** 3 * (1 + 3 * q + q * q) / 6
        return (
            abs(float(paper.printed_bracket_of_eq_8(np.array(s))) / exact - 1),
            abs(factors / exact - 1),
        )

    numbers = {"printed_1e-5": errors(1e-5)[0], "printed_1e-6": errors(1e-6)[0]}
    numbers["factors_worst"] = max(errors(float(s))[1] for s in np.geomspace(1e-8, 0.999, 200))
    numbers["factors_below"] = 10.0 ** math.ceil(math.log10(numbers["factors_worst"]))
    return numbers


def _energy_past_slip() -> dict[str, float]:
    from scipy.integrate import quad

    case = paper.REFERENCE
    slip = paper.joint(case)
    _, p = paper.contacts(slip)
    at, beyond = np.array([p.delta_lim]), 2 * p.delta_lim
    eq_15_J = float(case.n * p.eq_8(at)[0])
    literal_J = float(0.9 * p.mu**2 * p.G_star * p.mu * p.N * p.delta_lim)
    joule_J = float(p.mu * p.N * p.delta_lim)
    right_J = float(paper.corrected_eq_16_J(case, p, at)[0])
    # Masing: the loop of n P-spheres to twice their limit, from Eqs. 11 and 12 alone.
    area, _ = quad(
        lambda x: float(p.eq_11(np.array(x))),
        0,
        beyond,
        points=[p.delta_lim],
        epsabs=0,
        epsrel=1e-11,
    )
    loop_J = case.n * (8 * area - 4 * beyond * p.mu * p.N)
    millimetre = 1e3  # lengths in mm are 1000 times the number, forces in N stay
    return {
        "eq_15_J": eq_15_J,
        "literal_over_eq_15": literal_J / eq_15_J,
        "joule_over_eq_15": joule_J / eq_15_J,
        "joule_with_n_over_eq_15": case.n * joule_J / eq_15_J,
        "right_over_eq_15": right_J / eq_15_J,
        "right_over_loop": float(paper.corrected_eq_16_J(case, p, np.array(beyond))) / loop_J,
        "joule_over_loop": float(p.mu * p.N * beyond) / loop_J,
        "unit_change": millimetre / (1 / millimetre),
    }


def _total_slip_phase() -> dict[str, float]:
    slip = paper.joint(paper.REFERENCE)
    g, _ = paper.contacts(slip)
    limit_m = slip.total_slip_displacement_m
    near = np.array([1.0, 1.1]) * limit_m
    slope = float(np.diff(slip.energy_J(near))[0] / np.diff(near)[0] / slip.total_slip_force_N)
    return {"radicand_past_limit": 1 - 1.1 * limit_m / g.delta_lim, "slope_over_mu_N": slope}


def _modulus_of_table_1() -> dict[str, float]:
    right_Pa, printed_Pa = paper.YOUNGS_MODULUS_OF_TABLE_1_PA, paper.YOUNGS_MODULUS_PA
    right, wrong = table_1_error(right_Pa), table_1_error(printed_Pa)
    E_star_Pa, half_Pa = paper.steel(right_Pa).E_star_Pa, printed_Pa / 2
    return {
        "printed_Pa": printed_Pa,
        "right_Pa": right_Pa,
        "loads": len(right),
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


def _phase_of_7d() -> dict[str, float]:
    cases = [case for case in paper.TABLE_1 if "7d" in case.figures]
    limits_m = np.array([paper.joint(case).limits_m for case in cases])
    share = limits_m[:, 1] / limits_m[:, 0]
    return {f"limit_ratio_{i}": float(x) for i, x in enumerate(share, 1)}


def _diameter_of_table_2() -> dict[str, float]:
    g, p = paper.TABLE_2
    half = 0.05e-6, 0.05e-2
    return {
        "D_m": g.diameter_m,
        "df_m": g.cap_height_m,
        "R_m": g.radius_m,
        "R_of_printed_D_m": paper.radius_of_eq_18_m(g.diameter_m, g.cap_height_m),
        "R_of_18_mm_m": paper.radius_of_eq_18_m(18e-3, g.cap_height_m),
        "D_of_printed_R_m": paper.diameter_of_eq_18_m(g.radius_m, g.cap_height_m),
        "greatest_R_within_rounding_m": paper.radius_of_eq_18_m(
            g.diameter_m + half[1], g.cap_height_m - half[0]
        ),
        "R_P_m": paper.radius_of_eq_18_m(p.diameter_m, p.cap_height_m),
    }


def _counts_of_table_2() -> dict[str, float]:
    case = paper.REFERENCE
    return {
        "printed_N": case.printed_N,
        "load_N": paper.joint(case).preload_N,
        "load_swapped_N": paper.joint(replace(case, m=case.n, n=case.m)).preload_N,
    }


def _heights_of_table_2() -> dict[str, float]:
    g, p = paper.TABLE_2
    difference_m = g.cap_height_m - p.cap_height_m
    return {
        "df_G_m": g.cap_height_m,
        "df_P_m": p.cap_height_m,
        "difference_m": difference_m,
        "least_m": difference_m - 1e-7,
        "h_m": paper.TABLE_2_H_M,
    }


def _footprint_of_table_2() -> dict[str, float]:
    g, p = paper.TABLE_2
    printed_m2, area_m2 = (
        math.pi / 4 * (g.count * D_G**2 + p.count * p.diameter_m**2)
        for D_G in (g.diameter_m, 18e-3)
    )
    face_m2 = area_m2 / 0.10 / 2
    return {
        "area_printed_m2": printed_m2,
        "area_m2": area_m2,
        "face_m2": face_m2,
        "side_m": math.sqrt(face_m2),
    }


def _small_amplitudes() -> dict[str, float]:
    slip = paper.joint(paper.REFERENCE)
    mode = paper.stand_in_beam()
    delta = 1e-4 * float(slip.limits_m[1]) * np.array([0.99, 1.01])
    v = 1e-4 * slip.total_slip_force_N / mode.joint_stiffness_N_per_m * np.array([0.99, 1.01])
    loss = response(
        slip, mode.modal_stiffness_N_per_m, mode.joint_stiffness_N_per_m, 1, v
    ).loss_factor
    return {
        "exponent_of_W": _slope(delta, slip.energy_J(delta)),
        "exponent_of_eta": _slope(v, loss),
        "W_at_1_nm_J": float(slip.energy_J(1e-9)),
    }


def _exponent() -> dict[str, float]:
    slip = paper.joint(paper.REFERENCE)
    p_m, g_m = float(slip.limits_m[1]), float(slip.total_slip_displacement_m)
    # The exponent has its bends where a family begins to slide as a whole, with an upright slope
    near = 1.0 - np.geomspace(1e-12, 0.5, 400)
    delta = np.concatenate([np.geomspace(1e-3 * p_m, g_m, 4001), p_m * near, g_m * near])
    # dW/d delta = 4 (T - T' delta) by Masing's rule, so the exponent needs no difference.
    lost, force = slip.energy_J(delta), slip.force_N(delta)
    exponent = 4 * (force - slip.stiffness_N_per_m(delta) * delta) * delta / lost
    exponent = exponent[delta > 1e-2 * p_m]  # below, T - T' delta cancels
    across = slip.energy_J(p_m * np.array([1 - 1e-9, 1 + 1e-9]))
    return {
        "least_exponent": float(exponent.min()),
        "greatest_exponent": float(exponent.max()),
        "jump_at_delta_P": float(np.diff(across)[0] / across[0]),
    }


def _who_governs() -> dict[str, float]:
    from scipy.optimize import brentq

    case = paper.REFERENCE
    slip = paper.joint(case)
    g, p = paper.contacts(slip)

    def excess_J(delta: float) -> float:
        x = np.array(delta)
        return float(paper.corrected_eq_16_J(case, p, x) - case.m * g.eq_8(x))

    equal_m = float(brentq(excess_J, 2 * p.delta_lim, g.delta_lim, xtol=1e-16))
    last_J = float(paper.corrected_eq_16_J(case, p, np.array(g.delta_lim)))
    return {
        "equal_at_m": equal_m,
        "delta_G_m": g.delta_lim,
        "share_of_P_at_total_slip": last_J / float(slip.energy_J(g.delta_lim)),
    }


def _large_amplitudes() -> dict[str, float]:
    slip = paper.joint(paper.REFERENCE)
    mode = paper.stand_in_beam()
    damping = response(
        slip,
        mode.modal_stiffness_N_per_m,
        mode.joint_stiffness_N_per_m,
        Structure().joints,
    )
    return {
        "loss_factor_at_gross_slip": float(damping.loss_factor[-1]),
        "gross_slip_amplitude_m": damping.gross_slip_amplitude_m,
    }


def _beam_shear() -> dict[str, float]:
    thin = paper.stand_in_beam(theory="euler_bernoulli")
    length_m = Structure().beam.length_m
    ratios = [
        paper.stand_in_beam(thickness_m=float(x) * length_m).quasi_static_ratio
        for x in np.geomspace(1 / 100, 1 / 4, 30)
    ]
    return {
        "euler_bernoulli_excess": thin.quasi_static_ratio - 1,
        "timoshenko_least_excess": min(ratios) - 1,
        "timoshenko_greatest_excess": max(ratios) - 1,
    }


def _slope(x: np.ndarray, y: np.ndarray) -> float:
    return float(np.diff(np.log(y))[0] / np.diff(np.log(x))[0])


EVIDENCE = {
    one.__name__[1:]: one
    for one in (
        _factor_three,
        _wording_of_the_limit,
        _compliance_of_shear,
        _cancellation,
        _energy_past_slip,
        _total_slip_phase,
        _modulus_of_table_1,
        _phase_of_7d,
        _diameter_of_table_2,
        _counts_of_table_2,
        _heights_of_table_2,
        _footprint_of_table_2,
        _small_amplitudes,
        _exponent,
        _who_governs,
        _large_amplitudes,
        _beam_shear,
    )
}


def write_errata(path: str | Path) -> None:
    """Write `docs/errata.md`; raises OutputError where it cannot be written."""
    path = Path(path)
    write(path.parent, {path.name: errata_markdown(errata())})


if __name__ == "__main__":
    write_errata(sys.argv[1] if len(sys.argv) > 1 else "docs/errata.md")
