"""What a result is worth for a joint: what nobody gave, and a sentence on what it is usable for."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from capslip.contact.joint import is_loaded
from capslip.problems import Problem
from capslip.settings import Settings
from capslip.structure.stiffness import is_given, structure_name

# What moves a number by more than itself: the loss of a joint is known to a factor of two at best
USELESS = 1.0


@dataclass(frozen=True)
class Assumption:
    """One thing that nobody gave, what stands in for it, and the numbers that it moves."""

    name: str  # of one word or two
    setting: str  # that would give it
    value: str  # what stands in for it
    moves: str
    option: str  # how to give it on the command line
    demonstrates: bool  # whether the numbers are those of no joint in particular without it


def assumptions(settings: Settings, noise_known: bool = False) -> tuple[Assumption, ...]:
    """Return what was assumed, not given, the most important first.

    Parameters
    ----------
    settings : Settings
        What was given.
    noise_known : bool
        Whether the scans themselves say their measurement noise.

    Examples
    --------
    >>> from capslip.settings import load_settings
    >>> given = load_settings(overrides=("contact.preload_N=460", "structure.beam.length_m=0.4"))
    >>> [one.name for one in assumptions(given)]
    ['material', 'friction', 'joint area', 'yield', 'normal load', 'spreads', 'noise', 'resolution']
    """
    contact, material, joint = settings.contact, settings.material, settings.joint
    mapped = joint.pressure_map is not None
    E_Pa, nu = material.youngs_modulus_Pa, material.poisson_ratio
    E = " and ".join(dict.fromkeys(f"{one / 1e9:g} GPa" for one in E_Pa))
    found = []
    if not is_loaded(settings):
        value, moves = f"{contact.preload_N:g} N", "every number of contact, slip and damping"
        found.append(("preload", "contact.preload_N", value, moves, "--preload N", True))
    if not settings.is_given("material.youngs_modulus_Pa"):
        value = f"E {E}, nu {' and '.join(dict.fromkeys(f'{one:g}' for one in nu))}"
        moves, key = "stiffness, displacements, energy, loss", "material.youngs_modulus_Pa"
        found.append(("material", key, value, moves, f"--set {key}=[E1,E2]", True))
    elif not settings.is_given("material.poisson_ratio"):
        value, key = " and ".join(dict.fromkeys(f"{one:g}" for one in nu)), "material.poisson_ratio"
        moves = "stiffness and displacements, by some per cent"
        found.append(("Poisson's ratio", key, value, moves, f"--set {key}=[nu1,nu2]", False))
    if not settings.is_given("material.friction_coefficient"):
        value, key = f"{material.friction_coefficient:g}", "material.friction_coefficient"
        moves = "slip limits, energy, loss; not the initial stiffness"
        found.append(("friction", key, value, moves, f"--set {key}=MU", True))
    if not is_given(settings):
        key, moves = "structure", "amplitudes, loss factor, frequency; nothing of the joint"
        option = (
            "--set structure.modal_stiffness_N_per_m=K --set structure.joint_stiffness_N_per_m=K"
        )
        found.append(("structure", key, structure_name(settings), moves, option, False))
    if joint.area_m2 is None and not mapped and settings.families.m is None:
        key, moves = "joint.area_m2", "nominal pressure, and with it forces, stiffness, energy"
        found.append(("joint area", key, "that of the scan", moves, "--area A", False))
    may_yield = yields(settings)
    if not may_yield:
        key, moves = "material.hardness_Pa", "pressures; stiffness and energy of rough faces"
        found.append(("yield", key, "none, elastic", moves, "--material steel", False))
    if settings.slip.normal_amplitude_ratio == 0.0:
        key, moves = "slip.normal_amplitude_ratio", "energy and loss, most at small amplitudes"
        found.append(("normal load", key, "constant", moves, f"--set {key}=R", False))
    spreads = {
        "friction": ("material.friction_spread", material.friction_spread),
        "preload": ("contact.preload_spread", contact.preload_spread),
        "modulus": ("material.modulus_spread", material.modulus_spread),
    }
    if may_yield:
        spreads["hardness"] = ("material.hardness_spread", material.hardness_spread)
    certain = [name for name, (_, spread) in spreads.items() if spread == 0.0]
    if certain:
        key, moves = spreads[certain[0]][0], "the intervals, which leave them out"
        value = f"{', '.join(certain)} as if known exactly"
        found.append(("spreads", key, value, moves, f"--set {key}=0.2", False))
    found += _of_instrument(settings, noise_known)
    return tuple(Assumption(*one) for one in found)


def _of_instrument(
    settings: Settings, noise_known: bool
) -> list[tuple[str, str, str, str, str, bool]]:
    """Return what of a scan was assumed, not given."""
    found: list[tuple[str, str, str, str, str, bool]] = []
    if settings.families.m is not None:
        return found
    if not noise_known and settings.instrument.noise_m is None:
        key = "instrument.noise_m"
        moves = "the stated error where the map itself is pressed; of a smooth one the energy, too"
        value = "white, as heights change from pixel to pixel"
        found.append(("noise", key, value, moves, f"--set {key}=N_M", False))
    if settings.instrument.lateral_period_limit_m is None:
        key = "instrument.lateral_period_limit_m"
        value = "that of the pixels"
        moves = "stiffness and energy: a blur of the optics does, and is not in the stated error"
        found.append(("resolution", key, value, moves, f"--set {key}=D_LIM", False))
    return found


def yields(settings: Settings) -> bool:
    """Tell whether the settings let the face yield."""
    material = settings.material
    return material.hardness_Pa is not None or material.yield_stress_Pa is not None


def verdict(
    settings: Settings,
    problems: Iterable[Problem],
    estimated_error: float | None,
    errors_of_answer: tuple[float, float] | None = None,
    scans: tuple[int, int] | None = None,
    noise_known: bool = False,
    part_within: float | None = None,
) -> str:
    """Return one sentence: usable for what, how accurate, why not, and what to do next.

    Parameters
    ----------
    settings : Settings
        What was given, and what was not.
    problems : iterable of Problem
        Of the whole result. The reason is, of the worst, one that spoils every number, else the
        one that moves most; where a number may be off by more than itself, it is said which.
    estimated_error : float or None
        Of energy at given force and of stiffness, against the face pressed exactly, elastic or with
        its hardness: the greatest from a tenth of gross slip on.
    errors_of_answer : (float, float) or None
        Those of stiffness and energy at the force that is answered, where they are known.
    scans : tuple of int, optional
        On how many scans of how many the joint rests, where there are several.
    noise_known : bool
        Whether the scans themselves say their measurement noise.
    part_within : float or None
        How far the energy of one scan may be off that of the joint that it is a part of.
    """
    assumed = assumptions(settings, noise_known)
    shown = [one for one in assumed if one.demonstrates]
    named = ", ".join(one.name for one in shown)
    begin = f"for the demonstration values ({named}): " if shown else ""
    begin += "" if scans is None else _from_scans(*scans)
    problems = tuple(problems)
    for severity, word in (("error", "not usable"), ("warning", "usable with care")):
        worst = [one for one in problems if one.severity == severity]
        if worst:
            # The first of the greatest; what spoils every number leads what moves some
            first = max(worst, key=lambda one: (one.kind.spoils_all, one.greatest_effect))
            more = f" (and {len(worst) - 1} more)" if len(worst) > 1 else ""
            some = severity == "warning" and not first.kind.spoils_all
            what = _left(worst, errors_of_answer) if some else ""
            return f"{begin}{word}{what}: {first.text}{more}; next: {first.advice}"
    accuracy = "to an accuracy that was not estimated"
    if estimated_error is not None:
        asked = estimated_error if errors_of_answer is None else max(errors_of_answer)
        here, most = (f"{max(100.0 * error, 0.1):.2g} %" for error in (asked, estimated_error))
        less = estimated_error > asked and most != here
        beside = f"; up to {most} from a tenth of gross slip on" if less else ""
        face = "face with its hardness" if yields(settings) else "elastic face"
        accuracy = f"within {here} of the same {face} pressed exactly (estimated{beside})"
    if part_within is not None:
        times = f"a factor of {1.0 + part_within:.2g}"
        within = times if part_within > 1.0 else f"about {part_within:.0%}"
        accuracy += f", as a part of its joint within {within} in the energy"
    use = "stiffness and slip of the joint"
    if is_given(settings):
        use += f" and the damping of the {structure_name(settings)}"
    steps = [one.option for one in shown] or [one.option for one in assumed[:1]]
    steps = steps or ["measure a loss factor, and capslip compare it"]
    return (
        f"{begin}usable for {use}, {accuracy}; the loss of a real joint is known to a factor of "
        f"two to three; next: {' '.join(steps)}"
    )


def reason_of(text: str) -> str:
    """Return a verdict without how many more problems there are.

    >>> reason_of("usable with care: clipped (and 2 more); next: scan again")
    'usable with care: clipped; next: scan again'
    """
    return re.sub(r" \(and \d+ more\)", "", text)


def _left(warnings: list[Problem], errors: tuple[float, float] | None) -> str:
    """Say for what a result is left usable, where a warning moves a number out of all use.

    Or where a number may be off by as much at the force that is answered, as a logarithm.
    """
    effects = [one.effect for one in warnings if one.effect is not None]
    stiffness, energy = (0.0, 0.0) if errors is None else errors
    most = math.log1p(USELESS)
    moved = max((one.tangential_stiffness or 0.0 for one in effects), default=0.0)
    if stiffness > most or moved > USELESS:
        return " as an order of magnitude"
    losses = (max(one.energy or 0.0, one.loss_factor or 0.0) for one in effects)
    useless = energy > most or max(losses, default=0.0) > USELESS
    return ", not for the energy" if useless else ""


def _from_scans(known: int, given: int) -> str:
    """Say on how many scans a joint rests, and its scatter."""
    of = "" if known == given else f" of {given}"
    if known < 2:
        return f"from {known}{of} scans, so without their scatter: "
    scatter = ", whose scatter rests on two" if known == 2 else ""
    return f"from {known}{of} scans{scatter}: "
