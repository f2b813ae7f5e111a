"""What the output says of each contact model: what it leaves out, and what its contacts are."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rung:
    """The words for one contact model."""

    misses: str  # what the model leaves out, one sentence
    contacts: str = "caps in contact"  # what the count of contacts counts
    whole_face: bool = False  # the face touches as one, so there is nothing to count


RUNGS = {
    "flat": Rung(
        "The interface is taken as perfectly plane: no energy is lost below total slip.",
        whole_face=True,
    ),
    "families": Rung(
        "Each family counts with its mean radius and height: the spread inside a family "
        "and the elastic interaction of the caps are left out."
    ),
    "caps": Rung(
        "Each cap stands alone: the elastic interaction of the caps is left out, which makes "
        "the joint too stiff and lets too many caps touch."
    ),
    "mean_field": Rung(
        "The elastic interaction of the caps enters the approach as a mean only; the "
        "share of the load between the caps is that of caps that stand alone."
    ),
    "interacting": Rung(
        "Caps are spheres and act on one another as point loads on a half-space: other "
        "shapes, contacts that merge and the edges of the face are left out."
    ),
    "boundary_elements": Rung(
        "The height map itself is pressed, without spheres: what its pixels do "
        "not resolve is left out, and the face sinks as part of a half-space that ends nowhere.",
        contacts="contact regions",
    ),
}
UNKNOWN = Rung("")  # an analysis that ended before the contact


def rung(model: str | None) -> Rung:
    """Return the words for a contact model; those of no model where there is none.

    Examples
    --------
    >>> rung("interacting").contacts, rung("boundary_elements").contacts
    ('caps in contact', 'contact regions')
    """
    return RUNGS.get(model or "", UNKNOWN)
