"""What to do next about a problem, where what all of its kind are told does not help."""

from collections.abc import Sequence
from dataclasses import replace

from capslip.contact.choice import WHY
from capslip.contact.joint import Joint
from capslip.contact.rung import Rung, rung
from capslip.problems import Problem
from capslip.settings import Settings

PRESS_THE_MAP, PRESSED = "--model boundary_elements", "Nothing: the map itself was pressed."
# Where the joint is larger than its scan, whose bulk is not that of the joint, see `joint_of`
OF_THE_PARTS = {
    "bulk_dominates": "Take the stiffness of the parts as the joint's: the face adds next to none.",
    "bulk_kept": "Take the stiffness of the parts as the joint's, and W at a given force alone.",
}


def with_next_steps(
    problems: Sequence[Problem], joint: Joint, settings: Settings, pressed: Rung | None
) -> tuple[Problem, ...]:
    """Return the problems, each with a next step that can be taken and was not taken already.

    Parameters
    ----------
    problems : sequence of Problem
    joint : Joint
        Keeping the bulk is refused where it is larger than its scan.
    settings : Settings
        With which they were found.
    pressed : Rung or None
        The model that answers. None: boundary elements failed, where they were asked for.
    """
    model, instead = settings.contact.model, None
    if pressed is not None and pressed.made_from == "map":
        instead = PRESSED
    elif pressed is None and (model == "auto" or rung(model).made_from == "map"):
        instead = WHY
    for one in problems:
        if one.code == "boundary_elements_needed" and one.step is not None:
            instead = one.step  # they fail, or there are two maps
    found = problems
    if instead is not None:
        found = [_without_the_map(one, instead) for one in found]
    if not joint.is_scan:
        found = [replace(one, step=OF_THE_PARTS.get(one.code, one.step)) for one in found]
    return tuple(found)


def _without_the_map(problem: Problem, instead: str) -> Problem:
    """Return a problem whose next step is the other one that it names, or one instead."""
    other, presses, _ = problem.remedy.partition(PRESS_THE_MAP)
    if not presses:
        return problem
    return replace(problem, step=other.removesuffix("or ").rstrip(" ,;") or instead)
