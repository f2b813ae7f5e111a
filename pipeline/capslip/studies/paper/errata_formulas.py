"""What is wrong in the formulas of Sec. 2, and the number that proves it."""

import math
from dataclasses import dataclass

import numpy as np

from capslip.studies.paper import printed as paper

CERTAINTY = {
    "proved": "wrong as printed",
    "inferred": "cannot all be true as printed",
    "wording": "words that the formulas contradict",
    "omitted": "missing in print",
    "numerical": "right, but not in double precision",
    "open": "not reproduced; the paper does not say enough",
}


@dataclass(frozen=True)
class Erratum:
    """One place of the paper, what is right there, and why."""

    where: str
    printed: str
    correct: str
    evidence: str
    certainty: str  # a key of CERTAINTY
    numbers: dict[str, float]


def formula_errata() -> tuple[Erratum, ...]:
    """Compute the evidence for every erratum of Sec. 2."""
    return (
        _factor_three(),
        _wording_of_the_limit(),
        _compliance_of_shear(),
        _cancellation(),
        _energy_past_slip(),
        _total_slip_phase(),
    )


def _factor_three() -> Erratum:
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
    numbers = {"delta_over_limit": at_limit_m / g.delta_lim, "loop_over_eq_8": loop_J / W_J}
    return Erratum(
        "Eqs. 4 to 6",
        "mu N / (16 a)",
        "3 mu N / (16 a)",
        f"At T = mu N the printed Eq. 4 gives {numbers['delta_over_limit']:.4f} of the limit "
        "3 mu N G* / (16 a) printed under Eq. 8, and also of Eq. 3 with c = 0. The loop of the "
        f"printed Eqs. 5 and 6 to 0.8 mu N has {numbers['loop_over_eq_8']:.4f} of the area that "
        "Eq. 8 gives for the same T.",
        "proved",
        numbers,
    )


def _wording_of_the_limit() -> Erratum:
    g, _ = paper.contacts(paper.joint(paper.REFERENCE))
    numbers = {"force_over_mu_N_at_limit": float(g.eq_11(np.array(g.delta_lim))) / (g.mu * g.N)}
    return Erratum(
        "Text under Eq. 8",
        'delta_lim is the passage "from the macro-slip phase to the total-slip one"',
        "from partial slip (micro-slip) to total slip (macro-slip)",
        "Eq. 3 reaches delta_lim at c = 0, where nothing sticks any more, and there T / (mu N) = "
        f"{numbers['force_over_mu_N_at_limit']:g}. Elsewhere the paper calls total slip macro-slip "
        "(Fig. 5).",
        "wording",
        numbers,
    )


def _compliance_of_shear() -> Erratum:
    nu = paper.POISSON_RATIO
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    # Cerruti: a tangential point load Q moves the surface by Q / (2 pi G r) times this.
    mean = float(np.mean(1 - nu + nu * np.cos(angle) ** 2))
    numbers = {"computed": 2 * mean, "right": 2 - nu, "printed": 2 - nu**2}
    excess = numbers["printed"] / numbers["right"] - 1
    numbers |= {"excess": excess}
    return Erratum(
        "G* (under Eq. 3)",
        "(2 - nu^2) / G, summed over both bodies",
        "(2 - nu) / G, summed over both bodies",
        "Mindlin. Cerruti's displacement under a tangential point load, averaged over all "
        "directions as under a circular contact, is proportional to "
        f"{numbers['computed']:.4f} / G at nu = {nu:g}; 2 - nu = {numbers['right']:.4f}, "
        f"2 - nu^2 = {numbers['printed']:.4f}. The printed form makes G*, delta_lim and the energy "
        f"lost at given force {100 * excess:.1f} % too great.",
        "proved",
        numbers,
    )


def _cancellation() -> Erratum:
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
    bound = 10.0 ** math.ceil(math.log10(numbers["factors_worst"]))
    return Erratum(
        "Eqs. 8, 14 and 15",
        "1 - (1-s)^(5/2) - 5/6 (1 - (1-s)^(3/2)) (2-s), with s = delta / delta_lim",
        "the same number as (1-q)^3 (1 + 3q + q^2) / 6, with q = sqrt(1-s) and 1-q = s / (1+q)",
        "Against sixty digits, in double precision: the relative error of the printed form is "
        f"{numbers['printed_1e-5']:.1g} at s = 1e-5 and {numbers['printed_1e-6']:.0e} at "
        f"s = 1e-6, that of the factors below {bound:.0e} from s = 1e-8 to 1.",
        "numerical",
        numbers,
    )


def _energy_past_slip() -> Erratum:
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
    numbers = {
        "eq_15_J": eq_15_J,
        "literal_over_eq_15": literal_J / eq_15_J,
        "joule_over_eq_15": joule_J / eq_15_J,
        "joule_with_n_over_eq_15": case.n * joule_J / eq_15_J,
        "right_over_eq_15": right_J / eq_15_J,
        "right_over_loop": float(paper.corrected_eq_16_J(case, p, np.array(beyond))) / loop_J,
        "joule_over_loop": float(p.mu * p.N * beyond) / loop_J,
        "unit_change": millimetre / (1 / millimetre),
    }
    return Erratum(
        "Eq. 16",
        "w_P = mu N_P delta, as a term of the sum in Eq. 13",
        "W_P = n [0.8 mu N_P delta_P + 4 mu N_P (delta - delta_P)], in joules, outside that sum",
        "Dimension: w_P of Eq. 15 is N^2 / a (N^2/m), that of Eq. 16 N m; with lengths in mm "
        f"instead of m their ratio changes by {numbers['unit_change']:.0e}. Continuity at "
        f"delta_P,lim, where Eq. 15 gives {eq_15_J:.3e} J: the printed form leaves "
        f"{numbers['literal_over_eq_15']:.1e} of it inside Eq. 13, "
        f"{numbers['joule_over_eq_15']:.4f} of it taken in joules, "
        f"{numbers['joule_with_n_over_eq_15']:.4f} with the missing n as well; the right form "
        f"{numbers['right_over_eq_15']:.4f}. Loop of Eqs. 11 and 12 to 2 delta_P,lim, integrated: "
        f"the right form gives {numbers['right_over_loop']:.6f} of its area, the printed one "
        f"{numbers['joule_over_loop']:.4f}.",
        "proved",
        numbers,
    )


def _total_slip_phase() -> Erratum:
    slip = paper.joint(paper.REFERENCE)
    g, _ = paper.contacts(slip)
    limit_m = slip.total_slip_displacement_m
    near = np.array([1.0, 1.1]) * limit_m
    slope = float(np.diff(slip.energy_J(near))[0] / np.diff(near)[0] / slip.total_slip_force_N)
    numbers = {"radicand_at_1.1": 1 - 1.1 * limit_m / g.delta_lim, "slope_over_mu_N": slope}
    return Erratum(
        "Eqs. 11 to 16",
        "the phase TS (total slip) has no formula; Eq. 14 is said to hold always",
        "past delta_G,lim: T = mu N, and W grows by 4 mu N a unit of displacement",
        f"At 1.1 delta_G,lim Eq. 14 takes the square root of {numbers['radicand_at_1.1']:.1f}. The "
        f"model with the right energies has dW/d delta = {slope:.4f} mu N there.",
        "omitted",
        numbers,
    )
