"""Which doubts about hills, caps and families the model that pressed the face has to share."""

from dataclasses import replace

import numpy as np

from capslip.caps.table import CapFlag, CapTable
from capslip.contact.press import ContactState
from capslip.problems import Problem

FLAGS = {f"caps_{flag.name}": flag for flag in CapFlag}
# What the estimated error of the model counts, hill by hill
SHAPE = {
    "connected_network",
    "shallow_saddles",
    "pruning_decides",
    "not_spherical",
    "caps_ridge",
    "caps_several_peaks",
}
COUNTS = {"families_doubtful", "more_than_two_families", "family_below_cut", "caps_noisy_apex"}
ELSE = {
    "highest_point_on_no_cap",
    "plateau_at_cut",
    "cut_too_high",
    "level_not_settled",
    "no_caps",
    "fit_not_settled",
}
FLAGGED_SHARE = 0.2  # of the load, on caps of one flag


def as_read(
    problems: list[Problem], contact: ContactState, caps: CapTable, tolerance: float
) -> list[Problem]:
    """Return the problems, with what the model in use does not read as information.

    A model of no surface at all reads nothing of hills, caps and families, and one of the map
    itself neither; what noise, steps and spikes do to it, it measures.
    One of spheres reads the caps that carry load; and where its estimated error, in which the
    shape of each of their hills is counted, is within the tolerance, that shape is no doubt more.

    Parameters
    ----------
    problems : list of Problem
        Of any kind; those of other things stay as they are.
    contact : ContactState
        The face under its preload.
    caps : CapTable
        With the loads of that state.
    tolerance : float
        Of the error that was asked for.
    """
    error = contact.estimated_error
    known = error is not None and error <= tolerance
    share = {code: _share(caps, flag) for code, flag in FLAGS.items()}

    def is_read(code: str) -> bool:
        if code in COUNTS | ELSE | SHAPE | FLAGS.keys() and contact.rung.made_from != "spheres":
            return False
        if code in SHAPE and known:
            return False
        if code in COUNTS or code not in FLAGS:
            return True
        return share[code] > (0.0 if FLAGS[code] is CapFlag.plateau else FLAGGED_SHARE)

    return [
        problem
        if problem.severity != "warning" or is_read(problem.code)
        else replace(problem, severity="info")
        for problem in problems
    ]


def _share(caps: CapTable, flag: CapFlag) -> float:
    """Return the share of the load on caps of a flag."""
    load_N = np.where(caps.load_N > 0.0, caps.load_N, 0.0)
    return float(load_N[(caps.flags & flag) != 0].sum() / max(load_N.sum(), 1e-300))
