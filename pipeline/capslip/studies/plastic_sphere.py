"""Finite elements of a sphere that yields: its pressures, what it loses below, its radius.

`python -m capslip.studies.plastic_sphere` prints the tables, in ten minutes.

A rigid parabola r^2 / 2 R is pressed into an elastic-plastic half-space, which is what a sphere of
small a / R and a plane are, whichever yields. Strains are small; Y is the yield stress. All follows
from E* a / (R Y), or from the pressure p0 of an elastic sphere under the load, over the hardness
H = 2.8 Y. So E* = R = 1 here, the contact ends about a radius of 1, and Y sets how far it yields.

Elements are rings of four nodes whose change of volume is the mean of the element (Hughes 1980,
doi 10.1002/nme.1620150914); stresses return radially to the yield surface of Mises, with linear
isotropic hardening and the tangent that belongs to it (Simo and Taylor 1985,
doi 10.1016/0045-7825(85)90070-2). The contact grows by rings of nodes: those inside lie on the
parabola, and its depth is such that the next one is touched without a force.

Unloading is elastic: the pressures p at full load are those of flat punches of radii c up to a,
and as the contact shrinks to c it has come up by e and has lost F of its load (Johnson 1985,
Sec. 5.3; an integral of Abel)::

    e(c) = 2 / E* integral_c^a r p(r) / sqrt(r^2 - c^2) dr
    F(c) = 2 E* (c e + integral_c^a e dc)

The energy of a cycle of slip up to the share F / N of mu N goes as W = 4 integral (F de - e dF)
(docs/theory.md). For a Hertz contact it is 3 N^2 / (4 E* a) times the series of Mindlin and
Deresiewicz (1953) in F / N.
"""

import argparse
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from capslip.contact.solvers.yielding import HARDNESS_PER_YIELD, YieldLaw
from capslip.errors import ContactError
from capslip.studies.page import table

# p0 / H by the law; in the body 0.695, 0.839, 0.994, 1.242, 1.482, 1.957, 2.924, 3.925 and 5.985.
OVERLOADS = (0.7, 0.849, 0.998, 1.244, 1.491, 1.983, 2.967, 3.956, 5.935)
PLACES = (0.005, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.7, 0.85, 1.0)  # 1 - (r / a)^2
FORCE_SHARES = (0.1, 0.25, 0.5, 0.75)  # T / (mu N)
RINGS = 500
POISSON_RATIO = 0.3
YOUNG = 1.0 - POISSON_RATIO**2  # over E*, the parabola being rigid
SHEAR = YOUNG / (2.0 * (1.0 + POISSON_RATIO))
BULK = YOUNG / (3.0 * (1.0 - 2.0 * POISSON_RATIO))
TRACE = np.array([1.0, 1.0, 1.0, 0.0])  # of (rr, zz, tt, rz)
DEVIATOR = np.diag([1.0, 1.0, 1.0, 0.5]) - np.outer(TRACE, TRACE) / 3.0  # of strains with 2 e_rz
TWICE = np.array([1.0, 1.0, 1.0, 2.0])  # rz counts as zr, too
ROOT = np.sqrt(2.0 / 3.0)  # radius of the yield surface over Y
FAR = 70.0  # radii to where nothing moves: the face sinks by N / (70 pi E*) less, as a whole
EDGE = 0.35  # of the last ring, that the contact ends before it: an elastic one is Hertz's so
ELASTIC = 2.2  # E* a / (R Y) up to which nothing yields, and one step is enough
MAX_TURNS = 40
TOLERANCE = 1e-6  # of the load, that a node may be out of balance
NEARLY = 3e-3  # the same, from where on the depth is corrected
STRAIN = 1e-6  # Y / E* for which the law is asked: a / R is small


@dataclass(frozen=True, eq=False)
class Mesh:
    """Rings of elements, n of them with four integration points and eight displacements each."""

    radius: np.ndarray  # (n_r,), of the nodes of the face
    area: np.ndarray  # (n_r,), of the face, that pressures at the nodes act on
    face: np.ndarray  # (n_r,), displacements into the body
    held: np.ndarray  # bool (n_displacements,)
    of_element: np.ndarray  # int (n, 8), displacements along r and z by turns
    strain: np.ndarray  # (n, 4, 4, 8), of a displacement, as (rr, zz, tt, 2 rz)
    volume: np.ndarray  # (n, 4)
    elastic: np.ndarray  # (n, 8, 8), stiffness
    rows: np.ndarray  # of the entries of the stiffness, by columns
    columns: np.ndarray
    entry: np.ndarray  # (64 n,), where those of the elements go

    def matrix(self, of_elements: np.ndarray) -> Any:
        """Return the stiffness of the body as a sparse matrix, of (n, 8, 8) of the elements."""
        from scipy.sparse import csc_matrix

        size = len(self.held)
        data = np.bincount(self.entry, of_elements.ravel(), len(self.rows))
        start = np.searchsorted(self.columns, np.arange(size + 1))
        return csc_matrix((data, self.rows, start), shape=(size, size))


@dataclass(frozen=True, eq=False)
class State:
    """A body in balance; strains of shape (n, 4, 4) as (rr, zz, tt, rz) at integration points."""

    displacement: np.ndarray
    depth: float  # of the parabola
    plastic: np.ndarray  # strains
    flowed: np.ndarray  # (n, 4), equivalent plastic strain
    force: np.ndarray  # on the nodes; not zero at those that are held or touch
    stiffness: np.ndarray  # (n, 8, 8)
    rings: int  # of nodes that touch


@dataclass(frozen=True, eq=False)
class Contact:
    """A contact under full load, in units of E* and R."""

    yield_stress: float
    radius: float
    load: float
    depth: float
    r: np.ndarray  # (m,), from the axis to the first ring that carries nothing
    pressure: np.ndarray  # (m,)
    held_load: float  # that the body is held with, far away

    @property
    def overload(self) -> float:
        """p0 / H, p0 the greatest pressure of an elastic sphere under the load."""
        p0 = np.cbrt(6.0 * self.load) / np.pi
        return float(p0 / (HARDNESS_PER_YIELD * self.yield_stress))


def mesh_of(rings: int) -> Mesh:
    """Return the mesh whose elements at the edge of the contact are 1 / rings wide and deep."""
    width, coarse = 1.0 / rings, np.sqrt(250.0 / rings)
    inner, outer = 1.0 - 10.0 * width, 1.0 + 2.0 * width
    inward = _widening(width, 0.15 * coarse, 0.04 * coarse, inner)
    outward = _widening(width, 0.15 * coarse, FAR, FAR)
    within, edge = inner * (1.0 - inward[:0:-1] / inward[-1]), np.linspace(inner, outer, 13)
    r = np.concatenate([within, edge, outer + outward[1:]])
    z = _widening(width, 0.13 * coarse, FAR, FAR)
    node = np.arange(len(r) * len(z)).reshape(len(r), len(z))
    corner = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], -1)
    of_element = np.stack([2 * corner, 2 * corner + 1], -1).reshape(-1, 8)
    left, _ = np.meshgrid(r[:-1], z[:-1], indexing="ij")
    wide, deep = np.meshgrid(np.diff(r), np.diff(z), indexing="ij")
    strain, volume = _strain(left.ravel(), wide.ravel(), deep.ravel())
    moduli = BULK * np.outer(TRACE, TRACE) + 2.0 * SHEAR * DEVIATOR
    held = np.zeros((len(r), len(z), 2), dtype=bool)
    held[0, :, 0] = held[-1] = held[:, -1] = True
    key = np.tile(of_element, (1, 8)).ravel() * held.size + np.repeat(of_element, 8, 1).ravel()
    entries, entry = np.unique(key, return_inverse=True)
    area, step = np.zeros(len(r)), 2.0 * np.pi * np.diff(r) / 6.0
    area[:-1] += step * (2.0 * r[:-1] + r[1:])
    area[1:] += step * (r[:-1] + 2.0 * r[1:])
    elastic = _stiffness(strain, volume, moduli)
    elements = of_element, strain, volume, elastic
    columns, rows = np.divmod(entries, held.size)
    return Mesh(r, area, 2 * node[:, 0] + 1, held.ravel(), *elements, rows, columns, entry)


def _widening(first: float, growth: float, widest: float, length: float) -> np.ndarray:
    """Return places from 0 to `length` or beyond, by steps that grow from `first`."""
    places = [0.0]
    while places[-1] < length:
        places.append(places[-1] + min(widest, first + growth * places[-1]))
    return np.array(places)


def _strain(left: Any, wide: Any, deep: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return strains of displacements of elements, and volumes of their integration points."""
    x, y = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])  # of the corners
    strain, volume = np.zeros((len(left), 4, 4, 8)), np.zeros((len(left), 4))
    for point, (at_x, at_y) in enumerate(np.stack([x, y], 1) / np.sqrt(3.0)):
        shape = (1 + x * at_x) * (1 + y * at_y) / 4
        along_r = x * (1 + y * at_y) / 2 / wide[:, None]
        along_z = y * (1 + x * at_x) / 2 / deep[:, None]
        radius = left + wide * (1 + at_x) / 2
        strain[:, point, 0, 0::2] = strain[:, point, 3, 1::2] = along_r
        strain[:, point, 1, 1::2] = strain[:, point, 3, 0::2] = along_z
        strain[:, point, 2, 0::2] = shape / radius[:, None]
        volume[:, point] = 2.0 * np.pi * radius * wide * deep / 4.0
    grown = strain[:, :, :3].sum(2)
    mean = np.average(grown, axis=1, weights=np.broadcast_to(volume[..., None], grown.shape))
    strain[:, :, :3] += ((mean[:, None] - grown) / 3.0)[:, :, None]
    return strain, volume


def _stiffness(strain: np.ndarray, volume: np.ndarray, moduli: np.ndarray) -> np.ndarray:
    stress = (moduli @ strain) * volume[:, :, None, None]
    return np.asarray(np.swapaxes(strain.reshape(-1, 16, 8), 1, 2) @ stress.reshape(-1, 16, 8))


def parabola(r: np.ndarray) -> np.ndarray:
    """Return how far below its top the parabola is at radii."""
    return 0.5 * r**2


@dataclass(frozen=True, eq=False)
class Body:
    """A half-space, what it is made of, and what is pressed into it."""

    mesh: Mesh
    yield_stress: float
    hardening: float  # growth of the yield stress over plastic strain
    top: Callable[[np.ndarray], np.ndarray] = parabola  # rises nowhere from the axis outwards

    def start(self) -> State:
        """Return the body as it is before it is touched."""
        shape = self.mesh.strain.shape[:3]
        nothing, plastic = np.zeros(len(self.mesh.held)), np.zeros(shape)
        return State(nothing, 0.0, plastic, plastic[..., 0], nothing, self.mesh.elastic, 0)

    def moved(self, start: State, displacement: np.ndarray, stiff: bool = True) -> State:
        """Return what displacements make of a state in balance, if not in balance themselves.

        Stresses beyond the yield surface return to it along its normal n, by the flow g::

            |s| - sqrt(2/3) (Y + h flowed) = g (2 G + 2/3 h)

        With `stiff` the stiffness is the derivative of the forces, else that of the start.
        """
        mesh = self.mesh
        moves = displacement[mesh.of_element][:, :, None]
        total = (mesh.strain.reshape(-1, 16, 8) @ moves).reshape(start.plastic.shape)
        grown = total @ TRACE
        tensor = total / TWICE - grown[..., None] / 3.0 * TRACE
        stress = 2.0 * SHEAR * (tensor - start.plastic)
        size = np.maximum(np.sqrt(stress**2 @ TWICE), 1e-300)
        over = size - ROOT * (self.yield_stress + self.hardening * start.flowed)
        flows = over > 1e-9 * self.yield_stress
        flow = np.where(flows, over, 0.0) / (2.0 * SHEAR + 2.0 / 3.0 * self.hardening)
        normal = stress / size[..., None]
        stress += BULK * grown[..., None] * TRACE - 2.0 * SHEAR * flow[..., None] * normal
        acts = (stress * mesh.volume[..., None]).reshape(-1, 1, 16) @ mesh.strain.reshape(-1, 16, 8)
        force = np.bincount(mesh.of_element.ravel(), acts.ravel(), len(mesh.held))
        plastic, flowed = start.plastic + flow[..., None] * normal, start.flowed + ROOT * flow
        stiffness = self._tangent(flows, flow, size, normal) if stiff else start.stiffness
        return State(displacement, start.depth, plastic, flowed, force, stiffness, start.rings)

    def _tangent(self, flows: Any, flow: Any, size: Any, normal: Any) -> np.ndarray:
        stiffness, at = self.mesh.elastic.copy(), np.flatnonzero(flows.any(1))
        turned = 1.0 - 2.0 * SHEAR * flow[at] / size[at]
        along = turned - 1.0 + 1.0 / (1.0 + self.hardening / (3.0 * SHEAR))
        along = np.where(flows[at], along, 0.0)[..., None, None]
        normal = normal[at]
        moduli = BULK * np.outer(TRACE, TRACE) + 2.0 * SHEAR * (
            turned[..., None, None] * DEVIATOR - along * normal[..., None] * normal[..., None, :]
        )
        stiffness[at] = _stiffness(self.mesh.strain[at], self.mesh.volume[at], moduli)
        return stiffness


def advanced(body: Body, start: State, rings: int, depth: float | None = None) -> State | None:
    """Return the balance with so many rings that touch; None where Newton's steps find none.

    Parameters
    ----------
    body : Body
    start : State
        In balance with fewer rings.
    rings : int
        Of nodes on the parabola; the next one is touched.
    depth : float, optional
        To start from.
    """
    mesh = body.mesh
    gap = body.top(mesh.radius[: rings + 1])
    under, edge = mesh.face[:rings], mesh.face[rings]
    free = ~mesh.held
    free[under] = False
    together = np.zeros(len(free))
    together[under] = 1.0
    d, near, residual = start.depth, NEARLY, 1.0
    now = body.moved(start, start.displacement, stiff=False)  # what flowed may flow on
    for turn in range(MAX_TURNS):
        matrix, u = mesh.matrix(now.stiffness), now.displacement
        down = np.zeros(len(u))
        down[under] = d - gap[:-1] - u[under]
        right = np.stack([-now.force - matrix @ down, -(matrix @ together)], axis=1)
        own, by_depth = _solved(matrix, free, right).T
        whole, sinks = turn == 0 or residual < near, 0.0
        if turn == 0 and depth is not None:
            sinks = depth - d
        elif whole:
            sinks = (u[edge] + own[edge] - d + gap[-1]) / (1.0 - by_depth[edge])
        move = own + down + sinks * (by_depth + together)
        part = 1.0 if whole else _part(partial(body.moved, start, stiff=False), now, move, free)
        now, d = body.moved(start, u + part * move), d + part * sinks
        near = max(0.3 * near, TOLERANCE) if whole else near  # lest whole steps swing for ever
        residual = np.abs(now.force[free]).max() / abs(now.force[under].sum())
        off = abs(now.displacement[edge] - d + gap[-1])
        if turn and residual < TOLERANCE and off < TOLERANCE * d:
            return replace(now, depth=float(d), rings=rings)
    return None


def _solved(matrix: Any, free: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the displacements of free nodes under forces; the others are zero."""
    from scipy.sparse.linalg import splu

    among = matrix[free][:, free]
    options = {"SymmetricMode": True}
    factors = splu(among, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    moves = np.zeros(right.shape)
    moves[free] = factors.solve(right[free])
    return moves


def _part(moved: Callable[[np.ndarray], State], now: State, move: Any, free: Any) -> float:
    """Return the part of a step at whose end the forces do little work on it any more."""
    first = float(move[free] @ now.force[free])
    part, low, work_low, high, work_high = 1.0, 0.0, first, 0.0, 0.0
    for turn in range(7):
        work = float(move[free] @ moved(now.displacement + part * move).force[free])
        if abs(work) <= (0.5 if turn < 3 else 0.8) * abs(first) or part > 4.0:
            break
        if work > 0.0:
            high, work_high = part, work
        else:
            low, work_low = part, work
        if not high:
            part *= 2.0
        else:
            share = -work_low / (work_high - work_low)
            part = low + (high - low) * min(max(share, 0.15), 0.85)
    return part


def pressed(body: Body, elastic: float | None = None) -> Contact:
    """Press the top in until the contact has a radius of about 1.

    Ring by ring: in longer steps the strains next to the edge go straight where they should turn,
    and W comes out up to 5 % higher. Quarters of these steps take off another 2 % at
    p0 / H = 1.96 and F / N = 0.25, and 1.5 % at a half and three quarters (250 rings).
    Up to a radius `elastic` nothing yields, by default that of the parabola.

    Raises
    ------
    ContactError
        If no balance is found.
    """
    r, gap = body.mesh.radius, body.top(body.mesh.radius)
    begin = ELASTIC * body.yield_stress if elastic is None else elastic
    first = max(2, int(np.searchsorted(r, min(begin, 0.95))))
    state, passed = body.start(), list[tuple[int, float]]()
    for rings in range(first, int(np.abs(r - 1.0).argmin()) + 1):
        depth = None
        if len(passed) > 1:
            (before, before_d), (last, last_d) = passed[-2:]
            grown = (gap[rings] - gap[last]) / (gap[last] - gap[before])
            depth = last_d + (last_d - before_d) * grown
        found = advanced(body, state, rings, depth)
        if found is None:
            raise ContactError(
                f"no balance of the ring at {r[rings]:.4g} of the radius at Y = "
                f"{body.yield_stress:.3g} E*; expected one out of balance by {TOLERANCE:g}; "
                "choose fewer rings or more hardening"
            )
        state = found
        passed.append((rings, found.depth))
    m = state.rings
    force = state.force[body.mesh.face[:m]]
    p = np.append(force / body.mesh.area[:m], 0.0)
    a = r[m] - EDGE * (r[m] - r[m - 1])
    held = -state.force[1::2][body.mesh.held[1::2]].sum()
    load = force.sum()
    return Contact(body.yield_stress, float(a), load, state.depth, r[: m + 1], p, held)


def withdrawn(r: np.ndarray, pressure: np.ndarray, to: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much a contact has come up, and the load lost, as it shrinks to radii.

    Parameters
    ----------
    r, pressure : float64, shape (m,)
        At full load, between two radii a straight line.
    to : float64, shape (n,)
        Radii c, falling from the last of `r`.

    Examples
    --------
    A uniform pressure has e = 2 p sqrt(a^2 - c^2) / E*.

    >>> e, F = withdrawn(np.array([0.0, 1.0]), np.array([1.0, 1.0]), np.array([1.0, 0.8, 0.6]))
    >>> print(e.round(6), F.round(6)[0])
    [0.  1.2 1.6] 0.0
    """
    slope = np.diff(pressure) / np.diff(r)
    level = pressure[:-1] - slope * r[:-1]
    c = to[:, None]
    root = np.sqrt(np.maximum(r**2 - c**2, 0.0))
    square = 0.5 * (r * root + c**2 * np.arccosh(np.maximum(r / c, 1.0)))
    e = 2.0 * (np.diff(root) @ level + np.diff(square) @ slope)
    below = np.append(0.0, np.cumsum(0.5 * (e[1:] + e[:-1]) * -np.diff(to)))
    return e, 2.0 * (to * e + below)


def slipped(
    r: np.ndarray, pressure: np.ndarray, load: float, shares: Iterable[float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much a contact has come up where shares F / N of its load are gone, and W."""
    to = r[-1] * (1.0 - np.append(0.0, np.geomspace(1e-6, 0.995, 2000)))
    e, F = withdrawn(r, pressure, to)
    W = np.append(0.0, np.cumsum(4.0 * (F[:-1] * e[1:] - F[1:] * e[:-1])))
    gone = load * np.array(list(shares))
    return np.interp(gone, F, e), np.interp(gone, F, W)


def losses(
    r: np.ndarray, pressure: np.ndarray, load: float, radius: float, shares: Iterable[float]
) -> np.ndarray:
    """Return W at shares F / N, over that of a Hertz contact of this load and radius."""
    f = np.array(list(shares))
    series = 1.0 - (1.0 - f) ** (5 / 3) - 5.0 * f / 6.0 * (1.0 + (1.0 - f) ** (2 / 3))
    hertz = 3.0 * load**2 / (4.0 * radius) * 24.0 / 5.0 * series
    return slipped(r, pressure, load, f)[1] / hertz


def over_hertz(contact: Contact) -> np.ndarray:
    """Return the pressures at `PLACES` over those of Hertz under the same load and radius.

    Each is that of a line in the root of the place, from half way to the place before to half way
    to the next: rings at the edge scatter.
    """
    inside = contact.r <= contact.radius
    place = 1.0 - (contact.r[inside] / contact.radius) ** 2
    mean = contact.load / (np.pi * contact.radius**2)
    bounds = 0.5 * (np.append(0.0, PLACES) + np.append(PLACES, 1.0))
    found = []
    for at, low, high in zip(PLACES, bounds[:-1], bounds[1:], strict=True):
        near = np.linspace(low, high, 400)
        p = np.interp(near, place[::-1], contact.pressure[inside][::-1]) / mean
        _, there = np.polyfit(np.sqrt(near) - np.sqrt(at), p, 1)
        found.append(there / (1.5 * np.sqrt(at)))
    return np.array(found)


def radius_of_law(load: float, yield_stress: float) -> float:
    """Return the radius of a contact by `YieldLaw`, where a / R is small."""
    law = YieldLaw(HARDNESS_PER_YIELD * STRAIN, 1.0, POISSON_RATIO)
    load_N = np.array([load * (STRAIN / yield_stress) ** 3])
    (mean_Pa,) = law.mean_pressure_Pa(load_N, np.ones(1))
    return float(np.sqrt(load_N[0] / (np.pi * mean_Pa)) * yield_stress / STRAIN)


def yield_stress_of(overload: float) -> float:
    """Return Y for which a radius of 1 has a p0 / H, by `YieldLaw`."""
    load = (np.pi * HARDNESS_PER_YIELD * overload) ** 3 / 6.0  # at Y = 1
    return 1.0 / radius_of_law(load, 1.0)


def plastic_sphere(
    overloads: Iterable[float] = OVERLOADS,
    hardening: float = 0.0,
    rings: int = RINGS,
    progress: Callable[[str], None] = lambda message: None,
) -> str:
    """Return in Markdown pressures, energies and radii of spheres that yielded.

    Parameters
    ----------
    overloads : iterable of float
        p0 / H; that of the tables is what the finite elements come to, within a few per cent.
    hardening : float
        Growth of the yield stress over plastic strain, over E.
    rings : int
        Elements that the radius would have, were all as wide as those at the edge.
    progress : callable, optional
        Called with one line a case. One without balance is named there, and has no row.
    """
    mesh = mesh_of(rings)
    pressures, energies = [], []
    for overload in overloads:
        Y = yield_stress_of(overload)
        try:
            contact = pressed(Body(mesh, Y, hardening * YOUNG))
        except ContactError as error:
            progress(f"p0 / H = {overload:g}: {error}")
            continue
        a, N, name = contact.radius, contact.load, f"{contact.overload:.3f}"
        W = losses(contact.r, contact.pressure, N, a, FORCE_SHARES)
        mean, of_law = N / (np.pi * a**2 * Y), a / radius_of_law(N, Y)
        pressures.append((name, *(f"{one:.3g}" for one in over_hertz(contact))))
        numbers = f"{a / Y:.4g}", f"{mean:.3f}", *(f"{one:.3f}" for one in (*W, of_law))
        energies.append((name, *numbers))
        progress(f"p0 / H = {name}: " + ", ".join(numbers))
    head = "E* a / (R Y)", "p_m / Y", *(f"W, F / N = {share:g}" for share in FORCE_SHARES)
    of_places = table(("p0 / H", *map(str, PLACES)), pressures)
    of_loads = table(("p0 / H", *head, "a"), energies)
    return (
        f"Pressure over that of Hertz at 1 - (r / a)^2:\n\n{of_places}\n\n"
        f"Energy over that of Hertz, radius over that of the law:\n\n{of_loads}"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rings", type=int, default=RINGS)
    parser.add_argument("--hardening", type=float, default=0.0)
    given = parser.parse_args()

    def tell(message: str) -> None:
        sys.stderr.write(f"{message}\n")

    tables = plastic_sphere(hardening=given.hardening, rings=given.rings, progress=tell)
    sys.stdout.write(f"{tables}\n")


if __name__ == "__main__":
    main()
