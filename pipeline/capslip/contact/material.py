"""The elastic constants of two bodies in contact, and the hardness of the softer one."""

import math
from dataclasses import dataclass

from capslip.contact.solvers.yielding import HARDNESS_PER_YIELD, YieldLaw
from capslip.errors import SettingsError
from capslip.settings import Material


@dataclass(frozen=True)
class Composite:
    """Constants of a pair of half-spaces, as `composite` gives them."""

    E_star_Pa: float  # 1/E* = sum (1 - nu^2) / E
    G_star_m2_per_N: float  # G* = sum (2 - nu) / G: a compliance
    kappa: float  # tangential over normal compliance, E* G* / 4: of round contacts, see `lay`


def dundurs_beta(
    youngs_modulus_Pa: tuple[float, float], poisson_ratio: tuple[float, float]
) -> float:
    """Return Dundurs' second parameter: how much pressure moves the faces sideways.

    Johnson 1987, Eq. 5.3, with the shear moduli G = E / (2 (1 + nu))::

        beta = [(1 - 2 nu_1) / G_1 - (1 - 2 nu_2) / G_2]
               / (2 [(1 - nu_1) / G_1 + (1 - nu_2) / G_2])

    It is zero for equal bodies, and at most 0.5 in size for nu >= 0. Normal and tangential problem
    are coupled where it is not zero, which the theorem behind the slip curve leaves out.

    Parameters
    ----------
    youngs_modulus_Pa, poisson_ratio : (float, float)
        One value a body.

    Examples
    --------
    >>> dundurs_beta((200e9, 200e9), (0.3, 0.3))
    0.0
    >>> round(dundurs_beta((200e9, 3e9), (0.3, 0.4)), 3)
    -0.159
    """
    difference, total = 0.0, 0.0
    for sign, E, nu in zip((1, -1), youngs_modulus_Pa, poisson_ratio, strict=True):
        G = E / (2 * (1 + nu))
        difference += sign * (1 - 2 * nu) / G
        total += (1 - nu) / G
    return difference / (2 * total)


def composite(
    youngs_modulus_Pa: tuple[float, float], poisson_ratio: tuple[float, float]
) -> Composite:
    """Combine the elastic constants of both bodies.

    E* is that of Hertz (Johnson 1987, Eq. 4.2c; Eq. 2 of the paper). G* is that of Mindlin, with
    2 - nu where the paper prints 2 - nu^2 (which would change the slip limit by 12 % at nu = 0.3).
    For equal bodies kappa = (2 - nu) / (2 (1 - nu)).

    Parameters
    ----------
    youngs_modulus_Pa, poisson_ratio : (float, float)
        One value a body, E > 0 and -1 < nu < 0.5.

    Raises
    ------
    SettingsError
        If a value is out of bounds.

    Examples
    --------
    >>> steel = composite((200e9, 200e9), (0.3, 0.3))
    >>> round(steel.E_star_Pa / 1e9, 2), round(steel.kappa, 4)
    (109.89, 1.2143)
    """
    for E in youngs_modulus_Pa:
        if not 0 < E < math.inf:
            raise SettingsError(f"youngs_modulus_Pa: got {E:g}; expected a finite number > 0")
    for nu in poisson_ratio:
        if not -1 < nu < 0.5:
            raise SettingsError(f"poisson_ratio: got {nu:g}; expected -1 < nu < 0.5")
    bodies = list(zip(youngs_modulus_Pa, poisson_ratio, strict=True))
    E_star = 1 / sum((1 - nu**2) / E for E, nu in bodies)
    G_star = sum((2 - nu) * 2 * (1 + nu) / E for E, nu in bodies)
    return Composite(E_star, G_star, E_star * G_star / 4)


def hardness_Pa(material: Material) -> float | None:
    """Return the hardness of the softer body, None where the contact is to stay elastic.

    As given, else 2.8 times the yield stress (Tabor 1951, The Hardness of Metals, ch. 4: the mean
    pressure under a ball once the metal around it flows).

    Raises
    ------
    SettingsError
        If the material has a name that `load_settings` did not fill in.

    Examples
    --------
    >>> hardness_Pa(Material()) is None
    True
    >>> print(f"{hardness_Pa(Material(yield_stress_Pa=355e6)) / 1e9:.3f} GPa")
    0.994 GPa
    """
    if material.hardness_Pa is not None:
        return material.hardness_Pa
    if material.yield_stress_Pa is not None:
        return HARDNESS_PER_YIELD * material.yield_stress_Pa
    if material.preset is not None:
        raise SettingsError(
            f"material.preset: got {material.preset!r} without its values; expected settings from "
            "load_settings or settings_from, which fill them in"
        )
    return None


def yield_law(material: Material) -> YieldLaw | None:
    """Return how a cap of the softer body yields, None where the contact is to stay elastic."""
    hardness = hardness_Pa(material)
    if hardness is None:
        return None
    E_star_Pa = composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa
    return YieldLaw(hardness, E_star_Pa, min(material.poisson_ratio))


def check_modulus(E_star_Pa: float) -> None:
    """Raise a SettingsError unless a composite modulus is positive and finite."""
    if not 0 < E_star_Pa < math.inf:
        raise SettingsError(f"E_star_Pa: got {E_star_Pa:g}; expected a finite number > 0")
