"""What makes the damping of the structure doubtful."""

from capslip.problems import Problem
from capslip.settings import Beam, Structure
from capslip.structure.response import Damping


def problems_of_structure(structure: Structure) -> list[Problem]:
    """Return what in the settings of the structure is hardly meant."""
    if structure.modal_stiffness_N_per_m is None or structure.beam == Beam():
        return []
    message = (
        "structure.beam is not used: the structure's two stiffnesses are given; leave out the "
        "one or the other"
    )
    return [Problem("beam_ignored", "warning", message)]


def problems_of_damping(damping: Damping) -> list[Problem]:
    """Return what makes the damping doubtful."""
    found: list[Problem] = []
    if damping.peak_loss_factor > 0.3:
        message = (
            f"the loss factor reaches {damping.peak_loss_factor:.2g}: the mode is no longer "
            "lightly damped there, and the amplitudes do not follow from its stiffness alone"
        )
        found.append(Problem("not_lightly_damped", "warning", message))
    if damping.peak_at_gross_slip:
        message = "the loss factor still grows where gross slip begins"
        found.append(Problem("peak_at_gross_slip", "info", message))
    return found
