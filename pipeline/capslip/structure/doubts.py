"""What makes the damping of the structure doubtful."""

from capslip.problems import Problem, Severity
from capslip.settings import Beam, Structure
from capslip.structure.response import Damping, lightly_damped


def problems_of_structure(structure: Structure) -> list[Problem]:
    """Return what in the settings of the structure is hardly meant."""
    if structure.modal_stiffness_N_per_m is None or structure.beam == Beam():
        return []
    message = (
        "structure.beam is not used: the structure's two stiffnesses are given; leave out the "
        "one or the other"
    )
    return [Problem("beam_ignored", "warning", message)]


def problems_of_damping(damping: Damping, structure: str, is_given: bool) -> list[Problem]:
    """Return what makes the damping of a structure doubtful; of one that nobody gave it is a note.

    Parameters
    ----------
    damping : Damping
        Of the structure.
    structure : str
        What it is called.
    is_given : bool
        Whether someone gave it.
    """
    found: list[Problem] = []
    if lightly_damped(damping.peak_loss_factor) is None:
        message = (
            f"the loss factor of the {structure} is not defined near its peak: W over the energy "
            f"of the mode would be {damping.peak_loss_factor:.2g} there, the mode is no longer "
            "lightly damped, and the amplitudes do not follow from its stiffness alone"
        )
        severity: Severity = "warning" if is_given else "info"
        found.append(Problem("not_lightly_damped", severity, message))
    if damping.peak_at_gross_slip:
        message = "the loss factor still grows where gross slip begins"
        found.append(Problem("peak_at_gross_slip", "info", message))
    return found
