"""What to do next about a problem, where what all of its kind are told does not help."""

from collections.abc import Sequence
from dataclasses import replace

from capslip.contact.choice import WHY
from capslip.contact.joint import Joint
from capslip.contact.rung import Rung, rung
from capslip.contact.time_needed import TIME_LIMIT
from capslip.problems import Problem
from capslip.settings import Settings

OF_THE_MAP = ("boundary_elements_needed", "contact_failed")  # which may know their own step
PRESS_THE_MAP, PRESSED = "--model boundary_elements", "Nothing: the map itself was pressed."
SEPARATE = "--set hills.separation=watershed"
# The rule takes off what stands alone; what it left is wider than that
LEFT_BY_RULE = "Look at figures/height_map.png: points that stand alone are removed already."
TAKE_ANOTHER = (
    "--model auto, which looks for one that carries it; or check the load, --area and units."
)
# Of a load that nobody gave and no joint bears: any other step is for a load that one has
OF_THE_LOAD = ("pressure_beyond_elastic", "steep_contacts", "contact_failed", "face_closes")
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
        if one.code in OF_THE_MAP and one.step is not None:
            instead = one.step  # they fail, have no time, or there are two maps
    own = _of_settings(settings, pressed)
    known = {one.code for one in problems if one.code in OF_THE_MAP and one.step is not None}
    taken = own.keys() - known
    found = [replace(one, step=own[one.code]) if one.code in taken else one for one in problems]
    if instead is not None:
        found = [_without_the_map(one, instead) for one in found]
    if not joint.is_scan:
        found = [replace(one, step=OF_THE_PARTS.get(one.code, one.step)) for one in found]
    nobodys = [one for one in problems if one.code == "preload_of_demonstration"]
    if nobodys:
        step = nobodys[0].remedy
        found = [replace(one, step=step) if one.code in OF_THE_LOAD else one for one in found]
    return tuple(found)


def _of_settings(settings: Settings, pressed: Rung | None) -> dict[str, str]:
    """Return the steps, by code, in place of those that the settings have taken already."""
    steps = {}
    if settings.conditioning.outliers == "isolated":
        steps["outliers"] = LEFT_BY_RULE
    if pressed is not None and pressed.made_from == "map":
        steps["connected_network"] = PRESSED
    elif settings.hills.separation == "regions":
        steps["connected_network"] = f"{SEPARATE}; or {PRESS_THE_MAP}."
    if settings.contact.model != "auto":
        steps["contact_failed"] = TAKE_ANOTHER
    return steps


def _without_the_map(problem: Problem, instead: str) -> Problem:
    """Return a problem whose next step is the other one that it names, or one instead.

    Where time is all that the map lacks, more of it stands beside the other one.
    """
    other, presses, _ = problem.remedy.partition(PRESS_THE_MAP)
    if not presses:
        return problem
    if instead.startswith(f"--set {TIME_LIMIT}"):
        step = problem.remedy.replace(PRESS_THE_MAP, instead.partition(";")[0])
        return replace(problem, step=step.removesuffix("."))
    return replace(problem, step=other.removesuffix("or ").rstrip(" ,;") or instead)
