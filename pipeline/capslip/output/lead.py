"""What a reader sees first, on the terminal and in the report: answer, joint, what was assumed."""

from collections.abc import Iterable
from typing import Any

from capslip.output.rows import write_text
from capslip.problems import KINDS
from capslip.units import change

ASKED = {
    "amplitude_m": "amplitude {answer_amplitude_m:4} of the {answer_structure}",
    "slip_force_N": "slip force {answer_force_N:4}",
    "displacement_m": "displacement {answer_displacement_m:4} of the joint",
}
BY_DEFAULT = " (a quarter of gross slip: nothing was asked)"
STATE = "slip force {answer_force_N:4}, displacement {answer_displacement_m}"
LOSS = (
    "tangential stiffness {answer_stiffness_N_per_m} (secant), {answer_energy_J} lost per cycle, "
    "loss factor of the joint {answer_joint_loss_factor}"
)
NONE = "none: see the problems"
LIMITS = "gross slip at {total_slip_force_N:4}, {total_slip_displacement_m}"
STRUCTURE = (
    "{answer_structure}: loss factor {answer_loss_factor}, damping ratio {answer_damping_ratio}, "
    "frequency {answer_frequency_shift}, at amplitude {answer_amplitude_m} with rigid joints"
)
NOT_DEFINED = (
    "{answer_structure}: loss factor not defined at amplitude {answer_amplitude_m} with rigid "
    "joints, frequency {answer_frequency_shift}: the mode is no longer lightly damped"
)
OF_WHOLE = (
    "with all that the joints move and store, as a decay shows it: loss factor "
    "{answer_total_loss_factor} at amplitude {answer_total_amplitude_m}"
)
INTERVALS = {  # what a number is called, by its name; {0} is an end
    "tangential_stiffness_N_per_m": ("stiffness", "{{answer_stiffness_{0}_N_per_m:4}}"),
    "energy_J": ("energy", "{{answer_energy_{0}_J}}"),
    "joint_loss_factor": ("loss factor of the joint", "{{answer_joint_loss_factor_{0}}}"),
    "loss_factor": ("of the structure", "{{answer_loss_factor_{0}}}"),
}
LEAST = {"energy_J": (1e-15, "1 fJ")}  # that has a prefix, by the same names
MODEL_FORM = "beside it, dissipation of real joints is known to a factor of two to three at best"
NOTHING_KNOWN = (
    "no interval: the error of the model is not known, and no spread was given that it can carry"
)
TOO_MUCH = "no interval: the model cannot carry each preload that may be"
LEFT_OUT = "; it leaves out {0}"
JOINT = "preload {preload_N:4}"
PRESSURE = " on {joint_area_m2}: {nominal_pressure_Pa} nominal"
LOADED = 0.999  # of the joint: less is said
COVERAGE = "; scan {coverage} of it"
RESULTANT = ", resultant {off_m} off the load point"
ON_POINT = ", resultant through the load point"
# Whose heights a map has, by the way in which two faces were mated
OF_FACES = {"composite": "of the sum of both faces", "together": "of the first face"}
SCANS = "; {0} scans together {{coverage}} of it"


def answer_lines(summary: dict[str, Any], absent: str) -> list[tuple[str, str]]:
    """Return the answer, label and text of each line: the joint leads, then the structure.

    Parameters
    ----------
    summary : dict
        Of any analysis.
    absent : str
        Stands for a number that there is not.
    """
    answer = summary["answer"]
    if answer["energy_J"] is None:
        slips = summary["slip"]["total_slip_force_N"] is not None
        return [("answer", write_text(f"none; {LIMITS}" if slips else NONE, summary, absent))]
    at = ASKED[answer["asked"]["quantity"]]
    texts = [f"at {at}{BY_DEFAULT if answer['asked']['by_default'] else ''}", LOSS]
    if answer["asked"]["quantity"] != "slip_force_N":
        texts.append(f"{STATE}; {LIMITS}")
    else:
        texts.append(f"displacement {{answer_displacement_m}}; {LIMITS}")
    texts.append(NOT_DEFINED if answer["loss_factor"] is None else STRUCTURE)
    texts += [] if answer["total_loss_factor"] is None else [OF_WHOLE]
    texts += _interval_texts(summary)
    labels = ["answer", *[""] * (len(texts) - 1)]
    written = [write_text(text, summary, absent) for text in texts]
    return list(zip(labels, written, strict=True))


def _left_out(names: list[str]) -> str:
    """Say what an interval does not hold, the doubts among it by their codes in one list."""
    doubts = [
        one.removeprefix("what ").removesuffix(" moves") for one in names if one.endswith(" moves")
    ]
    others = [one for one in names if not one.endswith(" moves")]
    if doubts:
        listed = " and ".join(filter(None, (", ".join(doubts[:-1]), doubts[-1])))
        others.append(f"the effect of {listed}")
    return LEFT_OUT.format(" and ".join(others)) if others else ""


def _interval_texts(summary: dict[str, Any]) -> list[str]:
    """Return the interval and which input makes how much of that of the energy."""
    answer = summary["answer"]
    if answer["contributions"] is None:
        # Below mu times its amplitude nothing is lost under a load that oscillates in phase
        if answer["energy_J"] == 0.0 and not oscillates(summary):
            return []
        return [NOTHING_KNOWN if summary["accuracy"]["estimated"] is None else TOO_MUCH]
    ranges = []
    for name, (label, end) in INTERVALS.items():
        low, high = answer["interval"][name] or (None, None)
        if answer[name] is not None and (low is None or low != high):  # else nothing moves it
            ranges.append(f"{label} {_range(end, low, high, LEAST.get(name))}")
    shares = answer["contributions"]["energy_J"].items()
    shares = sorted(shares, key=lambda one: -one[1])
    parts = ", ".join(
        f"{name.replace('_', ' ')} {100.0 * share:.0f} %"
        for name, share in shares
        if share >= 0.005
    )
    left_out = _left_out(answer["not_in_interval"] or [])
    return [
        f"90 % interval: {', '.join(ranges)}",
        f"{_of_energy(parts, summary)}{left_out}; {MODEL_FORM}",
    ]


def _of_energy(parts: str, summary: dict[str, Any]) -> str:
    """Return what makes the interval of the energy, or why nobody can say."""
    if parts:
        return f"what makes that of the energy: {parts}"
    low, high = summary["answer"]["interval"]["energy_J"] or (None, None)
    if high is None:
        return "no upper bound"
    if high == 0.0:
        return "nothing slips under any friction that may be, and no energy is lost"
    if low == 0.0 and oscillates(summary):
        return "under some of what may be nothing slips, and no energy is lost"
    if low == 0.0:
        return (
            "of the energy nothing is known but that it is no more than the rectangle of its loop"
        )
    return "what makes that of the energy is not known: some of what may be is beyond gross slip"


def oscillates(summary: dict[str, Any]) -> bool:
    """Tell whether the normal load of a result oscillates."""
    return all(one["setting"] != "slip.normal_amplitude_ratio" for one in summary["assumed"])


def _range(
    end: str, low: float | None, high: float | None, least: tuple[float, str] | None = None
) -> str:
    """Return both ends of an interval as they are named; an absent one has no bound.

    A low one below the least that has a prefix is told as such.
    """
    if low is None or (low == 0.0 and high is None):
        return "without a bound"
    text = end.format("low")
    if high is not None and least is not None and 0.0 < low < least[0] <= high:
        return f"less than {least[1]} to {end.format('high')}"
    return f"above {text}, no upper bound" if high is None else f"{text} to {end.format('high')}"


def on_own_plane(summary: dict[str, Any]) -> bool:
    """Tell whether the families were counted on a plane that has other caps than the pressed one.

    Tables and pictures hold the latter.
    """
    families, hills = summary["families"], summary["hills"]
    return hills is not None and hills["caps"] not in (
        None,
        (families["m"] or 0) + (families["n"] or 0),
    )


def mating_of(steps: Iterable[dict[str, Any]]) -> dict[str, Any] | None:
    """Return what made one map of two faces; None where there is one face."""
    return next((step for step in steps if step["step"] == "mating"), None)


def joint_line(summary: dict[str, Any], absent: str) -> str:
    """Return preload, area and pressure of the joint, and what of it was scanned."""
    contact = summary["contact"]
    text = JOINT + (PRESSURE if contact["joint_area_m2"] is not None else "")
    scans = summary["scans"]
    if scans is None:
        of_scan = COVERAGE
    else:
        answer = sum(one["share"] is not None for one in scans)
        count = f"{answer} of {len(scans)}" if answer < len(scans) else f"{answer}"
        of_scan = SCANS.format(count)
    if contact["coverage"] is not None:
        loaded_m2 = contact["scan_area_m2"] / contact["coverage"]
        in_part = loaded_m2 < LOADED * contact["joint_area_m2"]
        text += of_scan.removesuffix("it") + "what bears it" if in_part else of_scan
    if scans is None and contact["resultant_off_load_point_m"] is not None:
        text += RESULTANT if contact["resultant_off_load_point_m"] else ON_POINT
    return write_text(text, summary, absent)


def assumed_lines(summary: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Return name, value and what it moves of all that nobody gave."""
    return [(one["name"], one["value"], one["moves"]) for one in summary["assumed"]]


MOST_CAUSES = 3
MOVED = {
    "tangential_stiffness": "the stiffness",
    "energy": "the energy",
    "loss_factor": "the loss factor",
}
IN_NUMBERS = "moves the stiffness by"  # a message that says it itself


def causes(summary: dict[str, Any], most: int | None = MOST_CAUSES) -> list[dict[str, Any]]:
    """Return the problems that a reader has to know first: errors, then warnings. None: all.

    Each with what it does to the numbers: as measured, or else what all of its kind do. Those that
    spoil every number come first, then those that move most.
    """
    serious = [one for one in summary["problems"] if one["severity"] != "info"]
    serious.sort(key=_rank)
    return [{**one, "does": effect_text(one)} for one in serious[:most]]


def _rank(problem: dict[str, Any]) -> tuple[bool, bool, float]:
    greatest = max((value or 0.0 for value in (problem["effect"] or {}).values()), default=0.0)
    return problem["severity"] != "error", not KINDS[problem["code"]].spoils_all, -greatest


def effect_text(problem: dict[str, Any]) -> str:
    """Return what a problem does to the numbers: as measured, or else what all of its kind do.

    Nothing where its message has said it already.
    """
    if IN_NUMBERS in problem["message"]:
        return ""
    return moved_by(problem) or KINDS[problem["code"]].effect


def moved_by(problem: dict[str, Any]) -> str:
    """Return by how much a problem moves the numbers; nothing where that was not measured."""
    moved = [
        f"{MOVED[name]} by {change(value)}"
        for name, value in (problem["effect"] or {}).items()
        if value is not None
    ]
    return f"moves {', '.join(moved)}" if moved else ""
