"""Caps on a face that sinks as if the load were spread evenly."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.bulk import bulk_of_face_m_per_N
from capslip.contact.models.caps import caps
from capslip.contact.rung import Rung, Scene, contacts_of_caps, touching_caps
from capslip.contact.solvers.hertz import HertzCurve
from capslip.errors import ContactError, SettingsError


def mean_field(
    radius_m: ArrayLike,
    depth_m: ArrayLike,
    E_star_Pa: float,
    bulk_m_per_N: float,
    preload_N: float,
) -> HertzCurve:
    """Return the normal curve of caps on a face that sinks as if the load were spread evenly.

    d(N) = d_caps(N) + c N (1 - 1 / sqrt(n)) / (E* sqrt(A)): the mean sinking of the face (see
    `bulk_of_face_m_per_N`) less the share of each contact in its own. The number n of caps in
    contact is that under the preload, at every load, so that d(N) has no steps. The approach
    becomes that of interacting caps to about 3 %, the stiffness to 20 %; the energy at given force
    stays that of `caps`.

    Parameters
    ----------
    radius_m, depth_m, E_star_Pa
        As for `caps`.
    bulk_m_per_N : float
        Of the face, see `bulk_of_face_m_per_N`.
    preload_N : float
        Load at which the caps in contact are counted.

    Raises
    ------
    ContactError
        If none is in contact at the resolution of floating-point numbers.
    """
    if not 0 < preload_N < np.inf:
        raise SettingsError(f"preload_N: got {preload_N:g}; expected a finite number > 0")
    curve = caps(radius_m, depth_m, E_star_Pa)
    in_contact = np.count_nonzero(curve.asperity_loads_N(curve.approach_m(preload_N)), axis=-1)
    if not np.all(in_contact):  # so little, or so soft, that it is lost beside the depths
        raise ContactError(
            f"mean_field: no cap bears {np.min(preload_N):g} N at E* = {E_star_Pa:g} Pa; expected "
            "a load that presses the caps together; check preload, hardness and units"
        )
    share = 1 - 1 / np.sqrt(in_contact)
    sinking = share * bulk_m_per_N
    return replace(curve, model="mean_field", compliance_m_per_N=sinking)


def _build(scene: Scene) -> HertzCurve:
    bulk_m_per_N = bulk_of_face_m_per_N(scene.surface, scene.E_star_Pa)
    spheres = scene.radius_m, scene.depth_m
    return mean_field(*spheres, scene.E_star_Pa, bulk_m_per_N, scene.preload_N)


RUNG = Rung(
    name="mean_field",
    label="mean field",
    cost=3,
    made_from="spheres",
    automatic=True,
    holds_bulk=True,
    leaves_out="The elastic interaction of the caps enters the approach as a mean only; the "
    "share of the load between the caps is that of caps that stand alone.",
    colour="#56B4E9",
    build=_build,
    contacts=contacts_of_caps,
    touching=touching_caps,
)
