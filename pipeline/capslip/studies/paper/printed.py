"""What the paper prints: its tables, its formulas as they stand, its joint; and a stand-in beam.

Peyret, Chevallier and Dion, Int. J. Appl. Mech. 8 (2016) 1650097, doi 10.1142/S1758825116500976.
Nothing here is corrected; the right forms are in `contact` and `structure`.
"""

import math
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any, Literal, cast

import numpy as np

from capslip.contact.curve import AsperityCurve
from capslip.contact.material import Composite, composite
from capslip.contact.models.families import families
from capslip.contact.slip import SlipCurve, slip_curve
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.settings import Structure
from capslip.structure.beam import BeamMode, beam_mode

YOUNGS_MODULUS_PA = 220e9  # Sec. 1
YOUNGS_MODULUS_OF_TABLE_1_PA = 200e9  # the round value that gives the printed loads
POISSON_RATIO = 0.3
RADIUS_G_M, RADIUS_P_M = 23.8, 26.7  # Table 2; one body is flat, so rho = R (Sec. 3)


@dataclass(frozen=True)
class Case:
    """One set of parameters of Table 1."""

    m: int
    n: int
    delta_n_m: float
    h_m: float
    friction_coefficient: float
    printed_N: float
    figures: tuple[str, ...]  # parts of Fig. 7 that show it


REFERENCE = Case(5, 18, 2.5e-7, 2.4e-7, 0.2, 460.0, ("7a", "7e", "7f"))

TABLE_1 = (
    REFERENCE,
    *(
        replace(REFERENCE, n=n, printed_N=N, figures=("7b",))
        for n, N in ((4, 450.0), (9, 454.0), (36, 474.0), (72, 501.0))
    ),
    *(
        replace(REFERENCE, m=m, printed_N=N, figures=("7c",))
        for m, N in ((1, 103.0), (3, 282.0), (8, 728.0), (11, 997.0))
    ),
    *(
        replace(REFERENCE, delta_n_m=delta_n_m, printed_N=N, figures=("7d",))
        for delta_n_m, N in ((2.7e-7, 572.0), (2.9e-7, 710.0), (3.1e-7, 869.0))
    ),
    Case(3, 18, 2.3e-7, 2.2e-7, 0.2, 250.0, ("7e",)),
    Case(7, 18, 2.7e-7, 2.6e-7, 0.2, 716.0, ("7e",)),
)
"""The fourteen different loads; that of the reference stands in three rows of the table."""

FRICTION_OF_7F = (0.15, 0.18, 0.25, 0.3)  # at the load of the reference


@dataclass(frozen=True)
class Spheres:
    """One row of Table 2, as printed."""

    family: str
    count: int
    cap_height_m: float
    diameter_m: float
    radius_m: float


TABLE_2 = (
    Spheres("G", 5, 1.7e-6, 1.7e-2, RADIUS_G_M),
    Spheres("P", 18, 1.2e-6, 1.6e-2, RADIUS_P_M),
)
TABLE_2_H_M = 2.4e-7


def steel(youngs_modulus_Pa: float = YOUNGS_MODULUS_OF_TABLE_1_PA) -> Composite:
    """Return the composite constants of two bodies of the paper's steel."""
    return composite((youngs_modulus_Pa,) * 2, (POISSON_RATIO,) * 2)


def joint(case: Case, material: Composite | None = None) -> SlipCurve:
    """Return the corrected model of one joint, pressed to the approach of the case.

    Examples
    --------
    >>> slip = joint(REFERENCE)
    >>> round(slip.preload_N, 1), round(slip.total_slip_force_N, 1)
    (460.4, 92.1)
    """
    material = material if material is not None else steel()
    curve = families(
        (case.m, case.n), (RADIUS_G_M, RADIUS_P_M), (0.0, case.h_m), material.E_star_Pa
    )
    load_N = float(curve.load_N(case.delta_n_m))
    return slip_curve(curve, load_N, case.friction_coefficient, material.kappa)


def stand_in_beam(**changes: Any) -> BeamMode:
    """Return the mode of the stand-in beam of the default settings, with the steel of Table 1."""
    beam = Structure().beam
    given = {
        "length_m": beam.length_m,
        "width_m": beam.width_m,
        "thickness_m": beam.thickness_m,
        "density_kg_per_m3": beam.density_kg_per_m3,
        "youngs_modulus_Pa": YOUNGS_MODULUS_OF_TABLE_1_PA,
        "poisson_ratio": POISSON_RATIO,
        "theory": beam.theory,
    }
    return beam_mode(**(given | changes))


@dataclass(frozen=True)
class Contact:
    """One contact of a family in the paper's symbols."""

    N: float
    a: float  # contact radius in m
    delta_lim: float
    mu: float
    G_star: float

    def printed_eq_4_to_6(self, T: np.ndarray, T_max: float, phase: Literal[0, 1, 2]) -> np.ndarray:
        """Return delta(T) by Eqs. 4, 5 and 6 as printed, mu N / 16 a."""
        limit = self.mu * self.N
        if phase == 0:
            bracket = 1 - (1 - T / limit) ** (2 / 3)
        elif phase == 1:
            rest = (1 - T_max / limit) ** (2 / 3)
            bracket = 2 * (1 - (T_max - T) / (2 * limit)) ** (2 / 3) - rest - 1
        else:
            rest = (1 - T_max / limit) ** (2 / 3)
            bracket = -2 * (1 - (T_max + T) / (2 * limit)) ** (2 / 3) + rest + 1
        return limit / (16 * self.a) * self.G_star * bracket

    def eq_11(self, delta: np.ndarray) -> np.ndarray:
        """Return T of one contact by Eqs. 11 and 12, up to total slip and past it."""
        return self.mu * self.N * (1 - np.maximum(1 - delta / self.delta_lim, 0) ** 1.5)

    def eq_8(self, delta: np.ndarray) -> np.ndarray:
        """Return W of one contact by Eq. 8, up to total slip."""
        bracket = printed_bracket_of_eq_8(delta / self.delta_lim)
        return 0.9 * self.mu**2 * self.N**2 / self.a * self.G_star * bracket


def contacts(slip: SlipCurve, material: Composite | None = None) -> tuple[Contact, Contact]:
    """Return one G- and one P-contact of a joint of two families."""
    material = material if material is not None else steel()
    curve = cast(AsperityCurve, slip.curve)  # of `families`
    loads_N = curve.asperity_loads_N(slip.approach_m)
    g, p = (
        Contact(
            float(N),
            float(contact_radius_m(N, radius_m, material.E_star_Pa)),
            float(limit_m),
            slip.friction_coefficient,
            material.G_star_m2_per_N,
        )
        for N, radius_m, limit_m in zip(loads_N, curve.radius_m, slip.limits_m, strict=True)
    )
    return g, p


def printed_bracket_of_eq_8(s: np.ndarray) -> np.ndarray:
    """Return the bracket of Eq. 8 term by term as printed, s = delta / delta_lim <= 1.

    Half powers are products with a square root, so that every machine rounds alike.
    """
    rest = 1 - np.asarray(s, dtype=float)
    root = np.sqrt(rest)
    return 1 - rest * rest * root - 5 / 6 * (1 - rest * root) * (2 - s)


def exact_bracket_of_eq_8(s: float) -> float:
    """Return the same with forty digits more than a double holds."""
    from decimal import localcontext

    with localcontext() as context:
        context.prec = 60
        x = Decimal(s)
        root = (1 - x).sqrt()
        third = Decimal(5) / 6 * (1 - (1 - x) * root) * (2 - x)
        return float(1 - (1 - x) ** 2 * root - third)


def printed_energy_J(
    case: Case, slip: SlipCurve, displacement_m: np.ndarray, reading: Literal["eq_13", "joule"]
) -> np.ndarray:
    """Return the energy lost per cycle with Eq. 16 as printed; up to total slip of the G-spheres.

    Parameters
    ----------
    case, slip : Case, SlipCurve
        A set of parameters and its joint. G* and everything but Eq. 16 are right.
    displacement_m : ndarray
        Amplitude of the displacement of the joint.
    reading : {"eq_13", "joule"}
        What the printed w_P = mu N_P delta is taken for: a term of the sum in Eq. 13, whose
        dimension it lacks, or an energy by itself.
    """
    delta = np.asarray(displacement_m, dtype=float)
    g, p = contacts(slip)
    W_G = case.m * g.eq_8(np.minimum(delta, g.delta_lim))
    W_P_gps = case.n * p.eq_8(np.minimum(delta, p.delta_lim))
    w_P = p.mu * p.N * delta
    W_P_pps = w_P if reading == "joule" else 0.9 * p.mu**2 * p.G_star * w_P
    return W_G + np.where(delta < p.delta_lim, W_P_gps, W_P_pps)


def corrected_eq_16_J(case: Case, p: Contact, displacement_m: np.ndarray) -> np.ndarray:
    """Return W_P = n [0.8 mu N_P delta_P + 4 mu N_P (delta - delta_P)] of all P-spheres."""
    beyond = np.asarray(displacement_m) - p.delta_lim
    return case.n * p.mu * p.N * (0.8 * p.delta_lim + 4 * beyond)


def radius_of_eq_18_m(diameter_m: float, cap_height_m: float) -> float:
    """Return R = (D^2 / 4 + df^2) / (2 df)."""
    return (diameter_m**2 / 4 + cap_height_m**2) / (2 * cap_height_m)


def diameter_of_eq_18_m(radius_m: float, cap_height_m: float) -> float:
    """Return the D that gives R with df."""
    return 2 * math.sqrt(cap_height_m * (2 * radius_m - cap_height_m))
