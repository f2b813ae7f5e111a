"""What a scan leaves open of a larger joint that it is a part of."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from capslip.contact.joint import Joint
from capslip.contact.press import ContactState
from capslip.contact.uneven_accuracy import by_energy

WHOLE = 0.99  # coverage from which a scan is taken for its joint
# Logarithms of stiffness and energy. One over the root of the contacts: as often a scan is stiffer
# and loses less than all of its face, as each part touches with its own highest hills
BY_CHOICE = 1.4, 1.7
# The logarithm of one and the long waves over the approach, and that of the sides of the joint over
# those of the scan, up to as many as were tried
BY_WAVES, MOST_SIDES = (0.2, 0.4), 6.0
# Standard deviations of what one scan is among others of its face, over the same root
STIFFNESS_BY_CHANCE, ENERGY_BY_CHANCE = 0.65, 1.3
NORMAL_90 = 1.645  # standard deviations on either side that hold 90 %
OF_BULK = 0.7  # standard deviation of the bulk of a part, where pressure goes on beyond its edges


class Moved(NamedTuple):
    """By how much a scan is too stiff for its joint, and loses too little under a given force.

    Of the logarithms of both, and their standard deviations, too: on some faces it is nothing.
    """

    stiffness: float
    energy: float


@dataclass(frozen=True)
class LeftOpen:
    """Of the logarithms of the energy and of the stiffness of a joint, from one scan of it."""

    coverage: float  # of the joint by the scan
    by_choice: Moved  # of the hills that touch
    by_waves: Moved  # longer than the scan
    energy_by_chance: float  # standard deviations of what is that of this scan alone
    stiffness_by_chance: float
    stiffness_by_bulk: float  # standard deviation of what the size of all scans leaves open

    @property
    def energy_up_to(self) -> float:
        """Relative error of the energy that one scan in twenty passes upwards."""
        each = self.by_choice.energy, self.by_waves.energy
        unsure = math.hypot(*each, self.energy_by_chance)
        return math.expm1(sum(each) + NORMAL_90 * unsure)


def few_contacts(joint: Joint, contact: ContactState) -> float | None:
    """Return one over the root of the contacts of a scan, by the energy of each patch.

    None where the scan is its joint, or nothing touches.
    """
    if not _is_part(joint) or contact.rung.made_from == "nothing":
        return None
    return by_energy(joint, contact, lambda one: 1.0 / math.sqrt(one.contacts))


def long_waves(joint: Joint, contact: ContactState) -> float | None:
    """Return the rms of waves that the scan does not hold, over the approach without bulk.

    By the energy of each patch; None where the scan is its joint, or nothing is approached.
    """
    if not _is_part(joint) or _approach_m(contact) <= 0.0:
        return None
    return by_energy(joint, contact, lambda one: joint.long_waves_m / _approach_m(one))


def left_open(joint: Joint, contact: ContactState) -> LeftOpen | None:
    """Return what a scan leaves open of its joint; None where it is the joint, or nothing touches.

    Each part of a face touches with its own highest hills, and which these are is chance: from part
    to part the energy scatters by about one over the root of its contacts, and all parts together
    are stiffer than the whole, and lose less. Caps that touch all have none to choose from. Waves
    longer than the scan do as much, see `docs/theory.md`, section 6. Of the stiffness the bulk of
    the scan was taken off, as if nothing were pressed beyond it.

    Parameters
    ----------
    joint : Joint
    contact : ContactState
        The scan under its preload, and its lightest patch that counts.
    """
    few = few_contacts(joint, contact)
    if few is None or joint.coverage is None:
        return None
    sides = 1.0 / math.sqrt(joint.coverage)
    chosen = by_energy(joint, contact, _chosen) * (1.0 - 1.0 / sides)
    waves = math.log1p(long_waves(joint, contact) or 0.0) * math.log(min(sides, MOST_SIDES))
    rest_m = contact.approach_m - contact.bulk_m
    of_bulk = contact.bulk_m / rest_m if rest_m > contact.bulk_m else 1.0
    return LeftOpen(
        joint.coverage,
        Moved(*(one * chosen for one in BY_CHOICE)),
        Moved(*(one * waves for one in BY_WAVES)),
        ENERGY_BY_CHANCE * few,
        STIFFNESS_BY_CHANCE * few,
        OF_BULK * of_bulk,
    )


def _is_part(joint: Joint) -> bool:
    return joint.coverage is not None and joint.coverage <= WHOLE


def _approach_m(contact: ContactState) -> float:
    return contact.approach_without_bulk_m or contact.approach_m


def _chosen(contact: ContactState) -> float:
    """Return one over the root of the contacts, less where they are most of the caps."""
    few, caps = 1.0 / math.sqrt(contact.contacts), int(contact.use.sum())
    return few * (1.0 - min(contact.contacts / caps, 1.0)) if caps else few
