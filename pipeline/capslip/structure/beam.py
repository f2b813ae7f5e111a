"""First bending mode of a clamped-clamped beam: what it asks of a joint across its section."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from capslip.errors import SettingsError


@dataclass(frozen=True)
class BeamMode:
    """First bending mode, scaled to unit displacement at mid-span.

    Positions count from a clamped end. A second joint at the mirrored position has the same
    stiffness and moment.
    """

    frequency_Hz: float
    modal_stiffness_N_per_m: float  # K_m = omega^2 (integral of rho A w^2 + rho I psi^2)
    joint_stiffness_N_per_m: float  # K_s: shear force at the joint for unit displacement
    joint_moment_N: float  # bending moment at the joint for unit displacement, in N m per m
    joint_position_m: float
    zero_moment_position_m: float
    quasi_static_ratio: float  # K_s over that of the beam bent by a static force at mid-span


def beam_mode(
    *,
    length_m: float,
    width_m: float,
    thickness_m: float,
    youngs_modulus_Pa: float,
    density_kg_per_m3: float,
    poisson_ratio: float,
    shear_correction: float | None = None,
    joint_position_m: float | None = None,
    theory: Literal["timoshenko", "euler_bernoulli"] = "timoshenko",
) -> BeamMode:
    """Compute the first bending mode of a clamped-clamped beam of constant rectangular section.

    The Timoshenko equations are solved in closed form. The Euler-Bernoulli beam is the same
    solution without shear and rotary inertia, so it is the exact limit of a thin beam.

    Parameters
    ----------
    length_m, width_m, thickness_m : float
        Length between the clamps and the section; the beam bends in the direction of its
        thickness. The length is at least twice the thickness.
    youngs_modulus_Pa, density_kg_per_m3, poisson_ratio : float
        Material of the beam; -1 < nu < 0.5.
    shear_correction : float, optional
        Share of the section that carries shear, above 0 and at most 1. By default Cowper's value
        for a rectangle, 10 (1 + nu) / (12 + 11 nu).
    joint_position_m : float, optional
        Distance of the joint from a clamped end. By default where the bending moment of the mode
        vanishes, so that the bending does not open the joint (Appendix B of the source).
    theory : {"timoshenko", "euler_bernoulli"}
        Beam theory.

    Returns
    -------
    BeamMode
        Frequency, modal stiffness K_m, joint stiffness K_s and where the moment vanishes.

    Raises
    ------
    SettingsError
        If a size or a material constant is out of bounds, or the joint lies outside the beam or
        at mid-span, where the shear force of the mode vanishes.

    Notes
    -----
    Cowper, J. Appl. Mech. 33 (1966) 335, for the shear correction; Appendix B of Peyret,
    Chevallier and Dion, Int. J. Appl. Mech. 8 (2016) 1650097, for the place of the joints. The
    beam is solved without joints: their compliance belongs to the response.

    Examples
    --------
    The Euler-Bernoulli beam: zero moment at 0.22416 L, K_m = 198.46 EI/L^3, K_s = 111.3 EI/L^3.

    >>> mode = beam_mode(length_m=1.0, width_m=0.12, thickness_m=0.1, youngs_modulus_Pa=1e5,
    ...                  density_kg_per_m3=1.0, poisson_ratio=0.3, theory="euler_bernoulli")
    >>> print(f"{mode.zero_moment_position_m:.5f} {mode.modal_stiffness_N_per_m:.2f}")
    0.22416 198.46
    >>> print(f"{mode.joint_stiffness_N_per_m:.1f} {mode.quasi_static_ratio:.2f}")
    111.3 1.16
    """
    for name, value in (
        ("length_m", length_m),
        ("width_m", width_m),
        ("thickness_m", thickness_m),
        ("youngs_modulus_Pa", youngs_modulus_Pa),
        ("density_kg_per_m3", density_kg_per_m3),
    ):
        if not 0 < value < math.inf:
            raise SettingsError(f"beam: {name}: got {value:g}; expected a positive finite number")
    if length_m < 2 * thickness_m:
        raise SettingsError(
            f"beam: length_m: got {length_m:g}; expected at least twice the thickness "
            f"({2 * thickness_m:g} m): a shorter block is no beam; give the two stiffnesses instead"
        )
    if not -1 < poisson_ratio < 0.5:
        raise SettingsError(f"beam: poisson_ratio: got {poisson_ratio:g}; expected -1 < nu < 0.5")
    if theory not in ("timoshenko", "euler_bernoulli"):
        raise SettingsError(
            f"beam: theory: got {theory!r}; expected 'timoshenko' or 'euler_bernoulli'"
        )
    if shear_correction is None:
        shear_correction = 10 * (1 + poisson_ratio) / (12 + 11 * poisson_ratio)
    if not 0 < shear_correction <= 1:
        raise SettingsError(
            f"beam: shear_correction: got {shear_correction:g}; expected above 0 and at most 1"
        )
    if joint_position_m is not None and not 0 < joint_position_m < length_m:
        raise SettingsError(
            f"beam: joint_position_m: got {joint_position_m:g}; expected inside the beam, "
            f"between 0 and {length_m:g} m"
        )
    rotary = (thickness_m / length_m) ** 2 / 12 if theory == "timoshenko" else 0.0
    shear = rotary * 2 * (1 + poisson_ratio) / shear_correction  # EI / (k G A L^2)
    shape = _first_mode(rotary, shear)
    zero_moment = _zero_moment_position(shape)

    # Distance from mid-span, in lengths: the mode is symmetric, so either half will do.
    xi = 0.5 - zero_moment if joint_position_m is None else abs(0.5 - joint_position_m / length_m)
    joint_shear, clamp_shear = abs(shape.shear(xi)), abs(shape.shear(0.5))
    if joint_shear < 1e-9 * clamp_shear:
        raise SettingsError(
            f"beam: joint_position_m: got {joint_position_m:g}, the middle of the beam, where the "
            f"shear force of the mode vanishes; expected away from {length_m / 2:g} m"
        )
    bending_stiffness_Nm2 = youngs_modulus_Pa * width_m * thickness_m**3 / 12
    unit_N_per_m = bending_stiffness_Nm2 / length_m**3
    mass_kg = density_kg_per_m3 * width_m * thickness_m * length_m
    return BeamMode(
        frequency_Hz=math.sqrt(shape.b2 * unit_N_per_m / mass_kg) / (2 * math.pi),
        modal_stiffness_N_per_m=shape.modal_stiffness() * unit_N_per_m,
        joint_stiffness_N_per_m=joint_shear * unit_N_per_m,
        joint_moment_N=shape.moment(xi) * unit_N_per_m * length_m,
        joint_position_m=zero_moment * length_m if joint_position_m is None else joint_position_m,
        zero_moment_position_m=zero_moment * length_m,
        # A static force P gives v = P L^3 / (192 EI) + P L / (4 k G A) and the shear P / 2.
        quasi_static_ratio=joint_shear * (1 + 48 * shear) / 96,
    )


@dataclass(frozen=True)
class _Mode:
    """Mode shape for unit length and EI; xi = x / L counts from mid-span, w(0) = 1.

    w = A cos(alpha xi) + B cosh(beta xi), and from the balance of transverse forces the rotation
    psi = -a A sin(alpha xi) + b B sinh(beta xi).
    """

    rotary: float  # I / (A L^2)
    b2: float  # omega^2 rho A L^4 / EI
    alpha: float
    beta: float
    a: float
    b: float
    A: float
    B: float

    def displacement(self, xi: np.ndarray) -> np.ndarray:
        return self.A * np.cos(self.alpha * xi) + self.B * np.cosh(self.beta * xi)

    def rotation(self, xi: np.ndarray | float) -> np.ndarray:
        return np.asarray(
            -self.a * self.A * np.sin(self.alpha * xi) + self.b * self.B * np.sinh(self.beta * xi)
        )

    def moment(self, xi: float) -> float:
        """Bending moment, psi'; positive at the clamps."""
        wave = self.a * self.alpha * self.A * math.cos(self.alpha * xi)
        return self.b * self.beta * self.B * math.cosh(self.beta * xi) - wave

    def shear(self, xi: float) -> float:
        """Shear force by the balance of moments: no division by a vanishing shear compliance."""
        wave = self.a * self.alpha**2 * self.A * math.sin(self.alpha * xi)
        moment_slope = wave + self.b * self.beta**2 * self.B * math.sinh(self.beta * xi)
        return -moment_slope - self.b2 * self.rotary * float(self.rotation(xi))

    def modal_stiffness(self) -> float:
        node, weight = np.polynomial.legendre.leggauss(24)
        xi = (node + 1) / 4  # half the beam
        density = self.displacement(xi) ** 2 + self.rotary * self.rotation(xi) ** 2
        return self.b2 * float(weight @ density) / 2


def _first_mode(rotary: float, shear: float) -> _Mode:
    def wave(alpha: float) -> tuple[float, float, float, float]:
        """Return b^2, beta, a and b for a wave number, from the lower branch of dispersion."""
        p = 1 + (rotary + shear) * alpha**2
        b2 = 2 * alpha**4 / (p + math.sqrt(p**2 - 4 * rotary * shear * alpha**4))
        beta = math.sqrt(b2 * (1 - b2 * rotary * shear)) / alpha
        return b2, beta, alpha - b2 * shear / alpha, beta + b2 * shear / beta

    def clamped(alpha: float) -> float:
        _, beta, a, b = wave(alpha)
        return a * math.sin(alpha / 2) + b * math.tanh(beta / 2) * math.cos(alpha / 2)

    # a and b are positive, so the tangent of alpha / 2 is negative: the root lies between pi and
    # 2 pi. There beta is real as long as 1 / rotary > (2 pi)^2, hence for L >= 2 h.
    alpha = _root(clamped, math.pi, 2 * math.pi)
    b2, beta, a, b = wave(alpha)
    ratio = -math.cos(alpha / 2) / math.cosh(beta / 2)
    return _Mode(rotary, b2, alpha, beta, a, b, 1 / (1 + ratio), ratio / (1 + ratio))


def _zero_moment_position(shape: _Mode) -> float:
    return 0.5 - _root(shape.moment, 0.0, 0.5)


def _root(of: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function changes its sign, by halves down to the last digit."""
    starts_above = of(low) > 0.0
    while low < (middle := 0.5 * (low + high)) < high:
        if (of(middle) > 0.0) == starts_above:
            low = middle
        else:
            high = middle
    return middle
