"""Families of equal spheres, without interaction: the model of the paper."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from capslip.caps.families import Families, Family
from capslip.contact.rung import Contacts, Rung, Scene, contacts_of_rows, touching_caps
from capslip.contact.solvers.hertz import HertzCurve, checked_asperities
from capslip.errors import ContactError


def families(
    count: ArrayLike, radius_m: ArrayLike, depth_m: ArrayLike, E_star_Pa: float
) -> HertzCurve:
    """Return the normal curve of families of equal spheres, as many as wanted (Eqs. 2, 9, 10).

    Parameters
    ----------
    count : array_like, shape (..., n)
        Spheres in each family, zero allowed (m and n of the paper).
    radius_m : array_like, shape (..., n)
        Composite radius of the spheres.
    depth_m : array_like, shape (..., n)
        How far the peaks of the family lie below the highest ones: (0, h) for the paper's two.
        **The rows of the curve are sorted by depth.** A negative depth makes that family the
        highest, and the approach counts from it: h < 0 is the two families in the other order.
    E_star_Pa : float
        Composite modulus, see `composite`.

    Returns
    -------
    HertzCurve
        Leading axes are sets of parameters and broadcast against approaches and loads: 1e5 sets at
        64 approaches are arrays of shape (100000, 1, n) and an approach of shape (64,).

    Raises
    ------
    SettingsError
        If a value is out of bounds.

    Examples
    --------
    >>> curve = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> round(float(curve.load_N(2.5e-7)), 1)
    460.4
    """
    count, radius_m, depth_m = checked_asperities(count, radius_m, depth_m, E_star_Pa)
    order = np.argsort(depth_m, axis=-1, kind="stable")
    count, radius_m, depth_m = (
        np.take_along_axis(array, order, axis=-1) for array in (count, radius_m, depth_m)
    )
    return HertzCurve("families", count, radius_m, depth_m, E_star_Pa)


def curve_of(found: Families, E_star_Pa: float) -> HertzCurve:
    """Return the normal curve of the families of a face."""
    members = [family for _, family in _members(found)]
    if not members:
        raise ContactError("families: no cap belongs to a family; expected at least one")
    top_m = members[0].peak_height_m
    return families(
        [family.count for family in members],
        [family.radius_m for family in members],
        [top_m - family.peak_height_m for family in members],
        E_star_Pa,
    )


def _members(found: Families) -> list[tuple[str, Family]]:
    """Return the families and their names, the highest first: G may have been flattened below P."""
    both = (("G", found.G), ("P", found.P))
    members = [(name, family) for name, family in both if family is not None]
    return sorted(members, key=lambda member: -member[1].peak_height_m)


def contacts_of_families(
    found: Families, curve: HertzCurve, approach_m: float, E_star_Pa: float
) -> Contacts:
    """Return the contacts of the whole families; no cap is one of them."""
    one_N = curve.asperity_loads_N(approach_m)
    names = np.array([name for name, _ in _members(found)])
    return contacts_of_rows(E_star_Pa, curve, one_N, np.zeros(0), names)


def _build(scene: Scene) -> HertzCurve:
    return curve_of(scene.families, scene.E_star_Pa)


def _contacts(scene: Scene, curve: HertzCurve, approach_m: float) -> Contacts:
    found = contacts_of_families(scene.families, curve, approach_m, scene.E_star_Pa)
    load_N = np.full(len(scene.caps), np.nan)
    for name, N in zip(found.family, curve.asperity_loads_N(approach_m), strict=True):
        load_N[scene.caps.family == name] = N
    return replace(found, load_N=load_N)


RUNG = Rung(
    name="families",
    label="families",
    cost=1,
    made_from="spheres",
    automatic=True,
    holds_bulk=False,
    leaves_out="Each family counts with its mean radius and height: the spread inside a family "
    "and the elastic interaction of the caps are left out.",
    colour="#E69F00",
    build=_build,
    contacts=_contacts,
    touching=touching_caps,
    reads_families=True,
    knows_places=False,
)
