"""What a scan leaves open of a larger joint that it is a part of, by how many contacts it has."""

import math
from dataclasses import dataclass

from capslip.contact.joint import Joint
from capslip.contact.press import ContactState
from capslip.contact.uneven_accuracy import by_energy

WHOLE = 0.99  # coverage from which a scan is taken for its joint
# Over one over the root of the contacts, in logarithms: by how much a joint of such patches loses
# less than one of the same face in one piece, and the standard deviations of that, of what one scan
# loses among others of its face, and of how stiff it is among these
LOST, UNSURE, ENERGY_BY_CHANCE, STIFFNESS_BY_CHANCE = 0.9, 0.5, 1.0, 0.65
NORMAL_90 = 1.645  # standard deviations on either side that hold 90 %
OF_BULK = 0.7  # standard deviation of the bulk of a part, where pressure goes on beyond its edges


@dataclass(frozen=True)
class LeftOpen:
    """Of the logarithms of the energy and of the stiffness of a joint, from one scan of it."""

    lost: float  # by how much the energy is too low
    unsure: float  # the standard deviation of that
    energy_by_chance: float  # standard deviations of what is that of this scan alone
    stiffness_by_chance: float
    stiffness_by_bulk: float  # standard deviation of what the size of all scans leaves open

    @property
    def energy_up_to(self) -> float:
        """Relative error of the energy that one scan in twenty passes upwards."""
        return math.expm1(self.lost + NORMAL_90 * math.hypot(self.unsure, self.energy_by_chance))


def few_contacts(joint: Joint, contact: ContactState) -> float | None:
    """Return one over the root of the contacts of a scan, by the energy of each patch.

    None where the scan is its joint, or nothing touches.
    """
    if joint.coverage is None or joint.coverage > WHOLE or contact.rung.made_from == "nothing":
        return None
    return by_energy(joint, contact, lambda one: 1.0 / math.sqrt(one.contacts))


def left_open(joint: Joint, contact: ContactState) -> LeftOpen | None:
    """Return what a scan leaves open of its joint; None where it is the joint, or nothing touches.

    Each part of a face touches with its own highest hills, and which these are is chance: from part
    to part the energy scatters by one over the root of its contacts, and all parts together lose
    less than the whole, see `docs/theory.md`, section 6. Of the stiffness the bulk of the scan was
    taken off, as if nothing were pressed beyond it.

    Parameters
    ----------
    joint : Joint
    contact : ContactState
        The scan under its preload, and its lightest patch that counts.
    """
    few = few_contacts(joint, contact)
    if few is None:
        return None
    rest_m = contact.approach_m - contact.bulk_m
    of_bulk = contact.bulk_m / rest_m if rest_m > contact.bulk_m else 1.0
    return LeftOpen(
        LOST * few,
        UNSURE * few,
        ENERGY_BY_CHANCE * few,
        STIFFNESS_BY_CHANCE * few,
        OF_BULK * of_bulk,
    )
