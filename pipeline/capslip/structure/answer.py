"""The question asked: what joint and structure do at one amplitude, force or displacement."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from capslip.contact.slip import SlipCurve
from capslip.problems import Problem
from capslip.settings import Question
from capslip.structure.response import Damping, lightly_damped
from capslip.units import readable

DEFAULT_SHARE = 0.25  # of the force at total slip, where nothing was asked
LARGER = "--area ..., where the joint is larger than the scan"


@dataclass(frozen=True)
class Answer:
    """One state of a vibrating joint; None for what has no meaning there.

    The stiffness is the secant T / delta, which is the slope of the cycle from tip to tip, and the
    loss factor of the joint W / (2 pi U) with the energy U = T delta / 2 of a spring of that
    stiffness. With one energy that the secant stores it is defined up to total slip, however much
    is lost; those of the structure only as long as the mode is lightly damped. That over the
    energy of the structure with rigid joints is the paper's; a decay or a resonance shows that over
    all that is stored, joints as well, which is smaller by f^2 / f_0^2.
    """

    slip_force_N: float  # T, in one joint
    displacement_m: float  # delta, of one joint
    tangential_stiffness_N_per_m: float | None  # T / delta; None: rigid
    energy_J: float  # W, lost per cycle in one joint
    joint_loss_factor: float | None  # None: nothing moves
    amplitude_m: float  # v of the structure, without the displacement of the joints
    total_amplitude_m: float  # with it: what a sensor sees
    loss_factor: float | None  # of the structure; None: not lightly damped
    damping_ratio: float | None
    frequency_shift: float  # f / f_0 - 1, to the frequency with rigid joints
    total_loss_factor: float | None  # over what structure and joints store; None as `loss_factor`


def asked(question: Question, slip: SlipCurve | None) -> tuple[str, float | None]:
    """Return what was asked for and its value, or what is answered where nothing was."""
    for name in question.__struct_fields__:
        value = getattr(question, name)
        if value is not None:
            return name, value
    return "slip_force_N", None if slip is None else DEFAULT_SHARE * float(slip.total_slip_force_N)


def answer_to(
    question: Question, slip: SlipCurve, damping: Damping, area_given: bool = False
) -> tuple[Answer | None, tuple[Problem, ...]]:
    """Return what joint and structure do at what was asked for; by default at 0.25 mu N.

    Parameters
    ----------
    question : Question
        An amplitude of the structure, or a slip force or a displacement of one joint.
    slip : SlipCurve
        Of one joint.
    damping : Damping
        Of the structure; its stiffnesses count.
    area_given : bool
        Whether the area of the joint is known: else it may be larger than the scan.

    Returns
    -------
    Answer or None, tuple of Problem
        None beyond gross slip, where no force holds the joint, with the problem that says so.

    Notes
    -----
    Same equations as `structure.response.response`, at one point.
    """
    name, value = asked(question, slip)
    assert value is not None  # a slip curve has a force at total slip
    K_s = damping.joint_stiffness_N_per_m
    T_most, delta_most = float(slip.total_slip_force_N), float(slip.total_slip_displacement_m)
    most = {
        "amplitude_m": damping.gross_slip_amplitude_m,
        "slip_force_N": T_most,
        "displacement_m": delta_most,
    }[name]
    if value > most * (1.0 + 1e-12):
        quantity, _, unit = name.rpartition("_")
        of = " of the structure" if name == "amplitude_m" else ""  # not of the joint
        got, holds = f"{value:.4g} {unit}", f"{most:.4g} {unit}"
        alike = readable(got) == readable(holds)  # then digits hide what is wrong
        apart = f", {value - most:.2g} {unit} too much" if alike else ""
        message = (
            f"got {quantity.replace('_', ' ')} {got}{apart}; the joint slips as a "
            f"whole from {holds}{of} on and nothing holds it there, so no stiffness and no loss "
            "can be given"
        )
        less = readable(f"{0.5 * most:.2g} {unit}").replace(" ", "")
        option = quantity.replace("_", "-")
        step = f"--{option} {less}" + ("" if area_given else f"; or {LARGER}")
        return None, (Problem("beyond_gross_slip", "error", message, step=step),)
    if name == "displacement_m":
        delta, T, W = value, float(slip.force_N(value)), float(slip.energy_J(value))
    else:
        T = min(K_s * value if name == "amplitude_m" else value, T_most)
        delta, W = float(slip.displacement_m(T)), float(slip.energy_at_force_J(T))
    numbers: dict[str, Any] = {
        name: float(number) for name, number in numbers_of_state(T, delta, W, damping).items()
    }
    if delta <= 0.0:
        numbers |= dict.fromkeys(("tangential_stiffness_N_per_m", "joint_loss_factor"))
    if lightly_damped(numbers["loss_factor"]) is None:
        numbers |= dict.fromkeys(("loss_factor", "damping_ratio"))
    numbers["total_loss_factor"] = lightly_damped(numbers["total_loss_factor"])
    return Answer(**numbers), ()


def numbers_of_state(
    T: Any, delta: Any, W: Any, damping: Damping, stiffer: Any = 1.0
) -> dict[str, np.ndarray]:
    """Return the numbers of an `Answer` in any states of a joint, defined there or not.

    Parameters
    ----------
    T, delta, W : float or float64, shape (n,)
        Slip force, displacement, and energy lost per cycle in one joint.
    damping : Damping
        Of the structure; its stiffnesses count.
    stiffer : float or float64, shape (n,)
        Factor on both of these.
    """
    K_m = damping.modal_stiffness_N_per_m * stiffer
    K_s = damping.joint_stiffness_N_per_m * stiffer
    T, delta, W = (np.asarray(one, dtype=float) for one in (T, delta, W))
    v, joints = T / K_s, damping.joints
    v_total = v + joints * K_s / K_m * delta
    with np.errstate(divide="ignore", invalid="ignore"):
        loss_factor = joints * W / (math.pi * K_m * v * v)
        return {
            "slip_force_N": T,
            "displacement_m": delta,
            "tangential_stiffness_N_per_m": T / delta,
            "energy_J": W,
            "joint_loss_factor": W / (math.pi * T * delta),
            "amplitude_m": v,
            "total_amplitude_m": v_total,
            "loss_factor": loss_factor,
            "damping_ratio": loss_factor / 2.0,
            "frequency_shift": np.sqrt(v / v_total) - 1.0,
            "total_loss_factor": loss_factor * v / v_total,
        }
