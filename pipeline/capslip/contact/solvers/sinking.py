"""How much deeper a contact that yields sinks than one bound on its pressures tells."""

import math
from collections.abc import Callable

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
_NEARLY, _LESS = 0.05, 0.5  # from where on that must fall by so much
MOST_TURNS = 8
_TINY = 1e-300


def sunk_in(
    face: ElasticFace,
    pressed: Pressed,
    again: Callable[[ElasticFace, Pressed], Pressed],
    deeper_m: np.ndarray | None = None,
) -> tuple[Pressed, np.ndarray | None]:
    """Return the state of a face whose contacts sink as deep as metal does, and how much deeper.

    One bound on the pressures lets a sphere sink 7 % less than finite elements do where p0 is 1.5
    times the hardness, and 13 % more at 6 times. A joint feels how deep its contacts sink beside
    one another: light ones bear what heavy ones leave them. So all that belongs to a contact is
    lowered by what it sinks deeper, and the face is pressed again, in turns. A point belongs to the
    contact that is nearest.

    Parameters
    ----------
    face : ElasticFace
        With its hardness, before any load; where it tilts, under the tilt that `again` starts from.
    pressed : Pressed
        Its state under the load, lowered by what is known.
    again : callable
        Presses a lowered face, from a state near the one it finds.
    deeper_m : float64, shape (ny, nx), optional
        Known from a state nearby.

    Returns
    -------
    Pressed, float64, shape (ny, nx)
        Of `face.lowered(deeper_m)`; None where nothing is near its hardness.
    """
    if deeper_m is None and pressed.max_pressure_Pa <= DEEPER_AT[0] * face.hardness_Pa:
        return pressed, None
    known_m = np.zeros(face.shape) if deeper_m is None else deeper_m
    last = math.inf
    for _ in range(MOST_TURNS):
        found_m = sinks_deeper_m(face, pressed)
        moved = moved_share(found_m, known_m, pressed)
        if settled(moved, last):
            break
        known_m, last = found_m, moved
        pressed = again(face.lowered(known_m), pressed)
    return pressed, known_m


def moved_share(found_m: np.ndarray, known_m: np.ndarray, pressed: Pressed) -> float:
    """Return how much what contacts sink deeper has moved, over itself and weighed by pressures."""
    load = pressed.pressure_Pa
    moved, most = (float((load * np.abs(one)).sum()) for one in (found_m - known_m, found_m))
    return moved / max(most, _TINY)


def settled(moved: float, last: float) -> bool:
    """Tell whether a turn has moved next to nothing, or little and no less than the one before.

    Contacts that touch in a bridge of few points now and then leave such a rest.
    """
    return moved <= _SETTLED or (moved <= _NEARLY and moved > _LESS * last)


def sinks_deeper_m(face: ElasticFace, pressed: Pressed) -> np.ndarray:
    """Return how much deeper each contact sinks than the bound on its pressures tells.

    Each of its parts as a sphere does; of the contact the mean over their loads.

    Parameters
    ----------
    face : ElasticFace
        A map or points of one, with its hardness.
    pressed : Pressed
        Its state under the first load.

    Returns
    -------
    float64, of the shape of the face
        At each point that of the contact that is nearest.
    """
    parts, belongs = parts_of(face, pressed), _nearest_contact(face, pressed)
    deeper = np.interp(parts.over_hardness, DEEPER_AT, DEEPER)
    deeper_m = parts.radius_m * face.hardness_Pa / face.E_star_Pa * deeper
    number, load_Pa = belongs.reshape(-1)[parts.at], pressed.pressure_Pa.reshape(-1)[parts.at]
    of_load, weighed = (
        np.bincount(number, weights=one) for one in (load_Pa, load_Pa * deeper_m[parts.part])
    )
    return np.asarray((weighed / np.maximum(of_load, 1e-300))[belongs])


def _nearest_contact(face: ElasticFace, pressed: Pressed) -> np.ndarray:
    """Return the number of the contact that is nearest to each point, of the shape of the face."""
    if pressed.pressure_Pa.ndim == 2:
        from scipy.ndimage import distance_transform_edt

        region = pressed.region
        at = distance_transform_edt(
            region == 0, face.pixel_size_m, return_distances=False, return_indices=True
        )
        return np.asarray(region[tuple(at)])
    from scipy.spatial import cKDTree

    at = np.flatnonzero(pressed.pressure_Pa)
    place_m = np.transpose(face.places_m)
    _, nearest = cKDTree(place_m[at]).query(place_m)
    return contacts_of(face, at)[nearest]
