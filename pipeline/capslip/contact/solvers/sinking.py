"""How much deeper a contact that yields sinks than one bound on its pressures tells."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.metal import contacts_of, parts_of
from capslip.contact.solvers.pressed import Pressed

# By p0 / H of a sphere, how much deeper it sinks by Jackson and Green than where its pressures end
# at the hardness, over the radius of the contact so and H / E*: `docs/theory.md`, section 5
DEEPER_AT = (0.8, 0.85, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0)
DEEPER = np.array(
    (
        (0.0, 0.0107, 0.0223, 0.0494, 0.0792, 0.1183, 0.1611, 0.1768),
        (0.1703, 0.1075, -0.0034, -0.3267, -1.2714, -2.602, -6.329, -15.35),
    )
).ravel()
_SETTLED = 1e-4  # of what contacts sink deeper, that a turn still moves, over the loads
_NEARLY, _LESS = 0.02, 0.5  # from where on that must fall by so much
_AS_BEFORE = 1.01  # of what was left: a state that is pressed anew is itself within a tolerance
_MOST_TURNS = 8
_ENDS = 2.0  # radii from the rim of a contact: up to half of it all is lowered, beyond it nothing
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Sunk:
    """How much deeper contacts sink than their bound tells, of the shape of the face."""

    deeper_m: np.ndarray
    contact: np.ndarray  # where which contact is, from 1 on, 0 for none
    left: float  # of it, that one turn more would move


def sunk_in(
    face: ElasticFace,
    pressed: Pressed,
    again: Callable[[ElasticFace, Pressed], Pressed],
    known: Sunk | None = None,
) -> tuple[Pressed, Sunk | None]:
    """Return the state of a face whose contacts sink as deep as metal does, and how much deeper.

    One bound on the pressures lets a sphere sink 7 % less than finite elements do where p0 is 1.5
    times the hardness, and 13 % more at 6 times. A joint feels how deep its contacts sink beside
    one another: light ones bear what heavy ones leave them. So a contact is lowered by what it
    sinks deeper, with what is around it, and the face is pressed again, in turns.

    Parameters
    ----------
    face : ElasticFace
        With its hardness, before any load; where it tilts, under the tilt that `again` starts from.
    pressed : Pressed
        Its state under the load, lowered by what is known.
    again : callable
        Presses a lowered face, from a state near the one it finds.
    known : Sunk, optional
        From a state nearby, on the points of the face. Of the same state it stays.

    Returns
    -------
    Pressed, Sunk
        Of `face.lowered(sunk.deeper_m)`; None where nothing is near its hardness.
    """
    if known is None and pressed.max_pressure_Pa <= DEEPER_AT[0] * face.hardness_Pa:
        return pressed, None
    if known is None:
        none = np.zeros(face.shape)
        known = Sunk(none, none.astype(int), 0.0)
    deeper_m, contact, left = known.deeper_m, known.contact, known.left
    enough, last, part = max(_SETTLED, _AS_BEFORE * left), math.inf, 1.0
    for turn in range(_MOST_TURNS + 1):
        found_m, contact = sinks_deeper_m(face, pressed, contact)
        moved = _moved(found_m, deeper_m, pressed)
        stays = moved <= _NEARLY and moved > _LESS * last
        if moved <= enough or stays or turn == _MOST_TURNS:
            break
        if moved > last:
            part *= 0.5  # it swings to and fro
        deeper_m, last = deeper_m + part * (found_m - deeper_m), moved
        pressed = again(face.lowered(deeper_m), pressed)
    return pressed, Sunk(deeper_m, contact, moved)


def _moved(found_m: np.ndarray, known_m: np.ndarray, pressed: Pressed) -> float:
    """Return how much what contacts sink deeper has moved, over itself and weighed by pressures."""
    load = pressed.pressure_Pa
    moved, most = (float((load * np.abs(one)).sum()) for one in (found_m - known_m, found_m))
    return moved / max(most, _TINY)


def sinks_deeper_m(
    face: ElasticFace, pressed: Pressed, before: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how much deeper each contact sinks than the bound on its pressures tells.

    Contacts that touch each other as they grow stay what they were, and new ones come: else what is
    one contact in a turn and two in the next would never settle. What is further from a contact
    than it can grow stays where it is: a top there would be a contact of its own, and sink as that.

    Parameters
    ----------
    face : ElasticFace
        A map or points of one, with its hardness.
    pressed : Pressed
        Its state under the first load.
    before : int, of the shape of the face
        Where which contact was, from 1 on, 0 for none.

    Returns
    -------
    float64, int, of the shape of the face
        At each point, of the contact that is nearest; and where which contact is.
    """
    touching = pressed.pressure_Pa > 0.0
    contact = _contacts(face, pressed, touching)
    known = np.zeros(contact.max() + 1, dtype=bool)
    known[contact[before > 0]] = True
    kept = np.where(touching, before, 0)
    contact = np.where(known[contact] | ~touching, kept, contact + before.max())
    present = np.bincount(contact.reshape(-1)) > 0
    present[0] = True
    contact = (np.cumsum(present) - 1)[contact]
    nearest, away_m = _nearest(face, contact > 0)
    belongs = contact.reshape(-1)[nearest] - 1
    parts = parts_of(face, pressed, belongs)
    deeper = np.interp(parts.over_hardness, DEEPER_AT, DEEPER)
    deeper_m = parts.radius_m * face.hardness_Pa / face.E_star_Pa * deeper
    share = np.clip(_ENDS - away_m / parts.radius_m[belongs], 0.0, 1.0)
    return share * deeper_m[belongs], np.where(touching, belongs + 1, 0)


def _contacts(face: ElasticFace, pressed: Pressed, touching: np.ndarray) -> np.ndarray:
    """Return the number of the contact of each point, from 1 on, 0 for none."""
    if touching.ndim == 2:
        return pressed.region
    contact = np.zeros(touching.size, dtype=int)
    contact[touching] = contacts_of(face, np.flatnonzero(touching))
    return contact


def _nearest(face: ElasticFace, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the flat index of the point that is nearest of some, and how far away it is."""
    if points.ndim == 2:
        from scipy.ndimage import distance_transform_edt

        away_m, (row, column) = distance_transform_edt(
            ~points, face.pixel_size_m, return_indices=True
        )
        return np.asarray(row * face.shape[1] + column), np.asarray(away_m)
    from scipy.spatial import cKDTree

    at, place_m = np.flatnonzero(points), np.transpose(face.places_m)
    away_m, nearest = cKDTree(place_m[at]).query(place_m)
    return np.asarray(at[nearest]), np.asarray(away_m)
