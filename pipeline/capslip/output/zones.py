"""Where a pressed face touches, sticks and slips, at any load and tangential force.

A contact that is sheared by T at the load N slips where it would not touch at N - T / mu: the
theorem of Ciavarella and Jaeger. So one table, the load of every contact over the load of the face,
tells touch, stick and slip alike. Of caps the table is that of their model, which is exact; of the
contact regions of a map it is that of the loads that were solved below the preload, and near it
between them.
"""

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from capslip.contact.solvers.hertz import loss_of_asperity
from capslip.output.datasets import write_dataset

if TYPE_CHECKING:
    from capslip.contact.press import ContactState
    from capslip.result import Analysis

MAX_CONTACTS = 20_000  # the most loaded


@dataclass(frozen=True, eq=False)
class Zones:
    """The contacts of a face under its load; k loads, n contacts, p pixels.

    Contacts of caps have a radius and no pixels; those of a map have pixels and no radius.
    """

    load_N: np.ndarray  # (k,), of the face, growing from zero to its share of the preload
    withdrawal_m: np.ndarray  # (k,), of the face from the preload, without the bulk term
    share: np.ndarray  # (k, n), load of each contact over that under the preload
    contact_load_N: np.ndarray  # (n,), under the preload
    closing_m: np.ndarray  # (n,), how far each is compressed there
    cap: np.ndarray  # (n,), row in the table of caps, from 0, of the hill it is on; -1: on none
    radius_m: np.ndarray  # (n,), of the contact; zero for a region
    pixel: np.ndarray  # (p,), flat number of each point of the map in contact
    pixel_contact: np.ndarray  # (p,), the contact it belongs to
    # (p,), the radius of its contact when it lets go, over that under the preload
    pixel_reach: np.ndarray
    # (1,) of a map, what touches under the preload over its pixels in contact; (0,) of caps
    pixel_area_m2: np.ndarray

    def __len__(self) -> int:
        return len(self.contact_load_N)

    @property
    def of_map(self) -> bool:
        """Whether the contacts are regions of the map."""
        return bool(len(self.pixel))


@dataclass(frozen=True, eq=False)
class Zone:
    """One state of every contact, shape (n,): over the radius that it has under the preload."""

    contact: np.ndarray  # what touches lies within; 0: does not touch
    stick: np.ndarray  # what sticks lies within; 0: slips as a whole

    @property
    def word(self) -> np.ndarray:
        """One of "apart", "sticks", "slips in part", "slips"."""
        whole = np.where(self.stick < self.contact, "slips in part", "sticks")
        word = np.where(self.stick > 0.0, whole, "slips")
        return np.where(self.contact > 0.0, word, "apart")


def zone_at(zones: Zones, load_share: float, force_share: float) -> Zone:
    """Return what touches, sticks and slips.

    Parameters
    ----------
    zones : Zones
        Of a face.
    load_share : float
        Normal load over the preload, 0 to 1.
    force_share : float
        Tangential force over that at gross slip under this load, 0 to 1.

    Notes
    -----
    A Hertz contact has a^3 over its load, so radii go with the cube root of the share.
    """
    load = float(np.clip(load_share, 0.0, 1.0))
    force = float(np.clip(force_share, 0.0, 1.0))
    contact = np.sqrt(compression_at(zones, load))
    stick = np.sqrt(compression_at(zones, load * (1.0 - force)))
    return Zone(contact, np.minimum(stick, contact))


def pixels_at(zones: Zones, zone: Zone) -> tuple[np.ndarray, np.ndarray]:
    """Return whether each pixel of a map touches, and whether it sticks, shape (p,) each."""
    contact, stick = (
        (radius > 0.0) & (zones.pixel_reach <= radius * (1.0 + 1e-9))
        for radius in (zone.contact[zones.pixel_contact], zone.stick[zones.pixel_contact])
    )
    return contact, stick


def compression_at(zones: Zones, load_share: float) -> np.ndarray:
    """Return the compression of each contact, shape (n,), over that under the preload.

    In between it is linear in the load to the power 2/3, as that of a single Hertz contact.
    """
    known = (zones.load_N / zones.load_N[-1]) ** (2 / 3)
    at = load_share ** (2 / 3)
    i = int(np.clip(np.searchsorted(known, at) - 1, 0, len(known) - 2))
    low, high = np.cbrt(zones.share[i : i + 2].astype(float)) ** 2
    weight = (at - known[i]) / (known[i + 1] - known[i])
    return np.asarray(np.clip(low + weight * (high - low), 0.0, None))


def loss_shares(zones: Zones, force_share: float) -> np.ndarray:
    """Return the share of each contact in the energy of a cycle, shape (n,), in all 1.

    Parameters
    ----------
    zones : Zones
        Of a face.
    force_share : float
        Tangential force over that at gross slip under the preload, 0 to 1.

    Notes
    -----
    Each contact loses as a Hertz contact (Eq. 8) that is withdrawn by what its load says, and
    slides with the face once it slips as a whole.
    """
    rest = np.minimum(compression_at(zones, 1.0 - force_share), 1.0)
    at_N = (1.0 - force_share) * zones.load_N[-1]
    slid_m = float(np.interp(at_N, zones.load_N, zones.withdrawal_m))
    closing_m = zones.closing_m
    x_m = np.where(rest > 0.0, closing_m * (1.0 - rest), np.maximum(closing_m, slid_m))
    coefficient = zones.contact_load_N / np.where(closing_m > 0.0, closing_m, np.inf) ** 1.5
    loss = loss_of_asperity(coefficient, closing_m, x_m)
    total = float(loss.sum())
    return loss / total if total > 0.0 else np.zeros(len(zones))


def hill_loads_N(analysis: "Analysis") -> np.ndarray | None:
    """Return what the hill of each cap bears of a map that was pressed; None where none was.

    A contact may reach over several hills: each bears the pressure on its own points, and what lies
    beside all hills is nobody's.
    """
    contact = analysis.contact
    if contact is None or contact.rung.made_from != "map":
        return None
    curve: Any = contact.normal
    pressed, n = curve.pressed(contact.preload_N), len(analysis.caps)
    pixel_N = pressed.pressure_Pa.ravel() * math.prod(pressed.pixel_size_m)
    return np.bincount(analysis.hills.label.ravel(), pixel_N, minlength=n + 1)[1 : n + 1]


def zones_of(analysis: "Analysis", load_N: np.ndarray, approach_m: np.ndarray) -> Zones | None:
    """Return the zones of a pressed face; None where its model knows no single contacts.

    Parameters
    ----------
    analysis : Analysis
        A finished one.
    load_N, approach_m : ndarray, shape (k,)
        Growing loads from zero to the preload, and what the normal curve was just solved for there.
    """
    contact = analysis.contact
    if contact is None:
        return None
    if contact.rung.made_from == "spheres":
        return _of_caps(analysis, contact, load_N, approach_m)
    return _of_map(analysis, contact) if contact.rung.made_from == "map" else None


def _of_caps(
    analysis: "Analysis", contact: "ContactState", load_N: np.ndarray, approach_m: np.ndarray
) -> Zones:
    """Return the zones of caps, or of the caps of pressed families."""
    caps = analysis.caps
    curve: Any = contact.normal  # of spheres
    row_N = curve.asperity_loads_N(approach_m)
    cap = np.flatnonzero(np.nan_to_num(caps.load_N) > 0.0)
    cap = cap[np.argsort(-caps.load_N[cap], kind="stable")][:MAX_CONTACTS]
    if contact.rung.knows_places:
        row = np.cumsum(contact.use)[cap] - 1
    else:
        names = list(contact.row_family)
        row = np.array([names.index(name) for name in caps.family[cap]], dtype=int)
    # Either of two caps whose contacts merge can hold their load: the curve may choose the other
    held = row_N[-1, row] > 0.0
    cap, row = cap[held], row[held]
    below_m = approach_m - contact.bulk_m * load_N / contact.preload_N
    one_N, radius_m = caps.load_N[cap], caps.contact_radius_m[cap]
    return Zones(
        load_N=load_N,
        withdrawal_m=below_m[-1] - below_m,
        share=row_N[:, row] / row_N[-1, row],
        contact_load_N=one_N,
        closing_m=0.75 * one_N / (contact.composite.E_star_Pa * radius_m),  # Hertz
        cap=cap,
        radius_m=radius_m,
        pixel=np.zeros(0, dtype=np.int64),
        pixel_contact=np.zeros(0, dtype=np.int32),
        pixel_reach=np.zeros(0),
        pixel_area_m2=np.zeros(0),
    )


def _of_map(analysis: "Analysis", contact: "ContactState") -> Zones:
    """Return the zones of the regions of a map, as far as they touch where it was unloaded."""
    curve: Any = contact.normal
    preload_N = contact.preload_N
    pressed, left = curve.pressed(preload_N), curve.unloading(preload_N).letting_go
    assert left is not None  # that of the heaviest patch alone is shown
    region_N = pressed.region_loads_N
    kept = np.argsort(-region_N, kind="stable")[:MAX_CONTACTS]
    load_N, share = left.load_N, left.region_share[:, kept].astype(float)
    below_m = np.asarray(curve.withdrawal_m(contact.approach_m, preload_N - load_N))
    lift_m = curve.lift_off_m(contact.approach_m)
    lift_m = np.where(np.isfinite(lift_m), lift_m, below_m[0])[kept]
    number = np.full(len(region_N) + 1, -1, dtype=np.int32)
    number[1 + kept] = np.arange(len(kept))
    pixel = np.flatnonzero(pressed.region)
    of = number[pressed.region.ravel()[pixel]]
    pixel, of, first = (each[of >= 0] for each in (pixel, of, left.first.astype(np.intp)))
    # Between two loads it is not known when: halfway
    compression = np.cbrt(share) ** 2
    reach = np.sqrt(0.5 * (compression[first, of] + compression[first - 1, of]))
    order = np.argsort(pressed.pressure_Pa.ravel()[pixel], kind="stable")
    top = np.zeros(len(kept), dtype=np.int64)
    top[of[order]] = pixel[order]  # the last written has the greatest pressure
    return Zones(
        load_N=load_N,
        withdrawal_m=below_m - contact.bulk_m * (1.0 - load_N / preload_N),
        share=share,
        contact_load_N=region_N[kept],
        closing_m=np.maximum(lift_m, 0.0),
        cap=analysis.hills.label.ravel()[top].astype(np.int64) - 1,
        radius_m=np.zeros(len(kept)),
        pixel=pixel,
        pixel_contact=of,
        pixel_reach=reach,
        pixel_area_m2=np.array([contact.contact_area_m2]) / np.count_nonzero(pressed.region),
    )


def write_zones(zones: Zones, group: Any) -> None:
    """Write the zones into a group of an HDF5 file."""
    for field in fields(zones):
        values = getattr(zones, field.name)
        if values.dtype.kind == "f" and field.name in ("share", "pixel_reach"):
            values = values.astype(np.float32)
        packed = {"compression": "gzip", "compression_opts": 1} if values.size > 1000 else {}
        unit = {"N": "N", "m": "m", "m2": "m^2"}.get(field.name.rpartition("_")[2], "")
        write_dataset(group, field.name, values, unit, **packed)


def read_zones(group: Any) -> Zones | None:
    """Read what `write_zones` wrote; None of one that did not know the area of pixels."""
    if "pixel_area_m2" not in group:
        return None
    return Zones(**{field.name: group[field.name][:] for field in fields(Zones)})
