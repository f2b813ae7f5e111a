"""How far given families may be from a face whose caps stand somewhere on a known area."""

import math

import msgspec
import numpy as np

from capslip.contact.accuracy import answers_of
from capslip.contact.bulk import bulk_compliance_m_per_N, without_bulk
from capslip.contact.material import composite
from capslip.contact.models.caps import caps
from capslip.contact.models.interacting import interacting
from capslip.contact.rung import ModelError, pairs_in_balance, turning_stiffness
from capslip.contact.solvers.hertz import HertzCurve
from capslip.contact.solvers.yielding import first_loading_at
from capslip.errors import ContactError
from capslip.settings import Settings

FORCE_SHARES = (1e-3, 1e-2, 0.1, 0.25, 0.5, 0.75)  # T / (mu N) at which energies are compared
NO_SLIP = 1e-12  # of mu N: all energies go as the cube of a small force, and their ratio stays
FROM = 0.1  # of mu N, from which on the greatest error of the energy counts
DRAWS = 24
MOST_CAPS = 100  # of a draw; of more, a part of the area that holds so many is pressed
APART = 0.5  # of the mean distance of caps, that their peaks keep: each has a hill of its own
_TRIES = 50  # places that are tried for one cap
_ONE_MORE_95 = 2.11  # standard deviations of 24 draws that hold 95 % of others (Student)
_LEAST = 1e-4  # of an error: its logarithm is taken


def error_of_families(
    curve: HertzCurve, area_m2: float, preload_N: float, settings: Settings
) -> ModelError | None:
    """Return what families leave out of a joint of known area: where their caps stand.

    Neighbours push each other apart, and a face turns until it balances; m, n, R and h know
    neither. So the caps are put at random places of a square of that area, some times, each time
    balanced and pressed as interacting caps; the bulk, which grows with the square, is not counted.

    Parameters
    ----------
    curve : HertzCurve
        Of the families as they unload: flattened where they yielded.
    area_m2 : float
        Nominal area of the joint.
    preload_N : float
        Of the joint.
    settings : Settings
        `material` and `contact`.

    Returns
    -------
    ModelError or None
        At 95 %, as logarithms: the mean of what the draws change and 2.11 of its standard
        deviations. None where half of the draws find no answer, as on caps that tip over.
    """
    count = curve.count.astype(int)
    radius_m, depth_m = np.repeat(curve.radius_m, count), np.repeat(curve.depth_m, count)
    part = min(MOST_CAPS / radius_m.size, 1.0)
    contact = msgspec.structs.replace(
        settings.contact, model="auto", preload_N=part * preload_N, nominal_pressure_Pa=None
    )
    settings, side_m = msgspec.structs.replace(settings, contact=contact), math.sqrt(part * area_m2)
    rng, changes = np.random.default_rng(0), []
    for _ in range(DRAWS):
        some = rng.permutation(radius_m.size)[:MOST_CAPS]
        place_m = _places_m(rng, some.size, side_m)
        try:
            changes.append(_change(radius_m[some], depth_m[some], place_m, side_m, settings))
        except ContactError:
            continue
    if 2 * len(changes) < DRAWS:
        return None
    drawn = np.array(changes)
    spread = math.sqrt(part) * drawn.std(axis=0, ddof=1)  # parts of a face level it out
    error = np.maximum(np.abs(drawn.mean(axis=0)) + _ONE_MORE_95 * spread, _LEAST)
    # Of few draws it goes up and down with the force: what is said is no less than at greater ones
    energy = np.maximum.accumulate(error[-2::-1])[::-1].tolist()
    by_share = ((NO_SLIP, energy[0]), *zip(FORCE_SHARES, energy, strict=True))
    return ModelError(float(error[-1]), dict(by_share)[FROM], by_share)


def _places_m(rng: np.random.Generator, count: int, side_m: float) -> np.ndarray:
    """Return places (x, y) on a square, from its middle, shape (n, 2), none near another one."""
    least_m = APART * side_m / math.sqrt(count)
    place_m = np.empty((count, 2))
    for i in range(count):
        tried_m = rng.uniform(-0.5 * side_m, 0.5 * side_m, (_TRIES, 2))
        apart_m = np.linalg.norm(tried_m[:, None] - place_m[:i], axis=-1).min(axis=1, initial=1e300)
        free = np.flatnonzero(apart_m >= least_m)
        place_m[i] = tried_m[free[0] if free.size else apart_m.argmax()]
    return place_m


def _change(
    radius_m: np.ndarray,
    depth_m: np.ndarray,
    place_m: np.ndarray,
    side_m: float,
    settings: Settings,
) -> np.ndarray:
    """Return the logarithms of the energies and the stiffness of caps at places over those alone.

    The caps are elastic: those that yielded were flattened before, and unload.
    """
    material, preload_N = settings.material, settings.contact.preload_N
    E_star_Pa = composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa
    depth_m = depth_m - depth_m.min()
    alone = caps(radius_m, depth_m, E_star_Pa)
    held_Nm_per_rad = turning_stiffness(settings)
    if math.isfinite(held_Nm_per_rad):
        pressed = first_loading_at(
            place_m,
            None,
            radius_m,
            depth_m,
            E_star_Pa,
            preload_N,
            compliance_m_per_N=pairs_in_balance(place_m, E_star_Pa, settings),
            arm=place_m,
            turning_stiffness=held_Nm_per_rad,
        )
        depth_m = depth_m - place_m @ np.array(pressed.rest.slope)
        depth_m -= depth_m.min()
    there = interacting(radius_m, depth_m, place_m[:, 0], place_m[:, 1], E_star_Pa, preload_N)
    bulk_m_per_N = bulk_compliance_m_per_N((side_m, side_m), E_star_Pa)
    used, _ = without_bulk(there, bulk_m_per_N, preload_N)
    changed = answers_of(there, used, settings, FORCE_SHARES)
    return np.log(changed / answers_of(alone, alone, settings, FORCE_SHARES))
