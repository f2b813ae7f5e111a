"""Finite elements of tops that are no spheres and yield, beside boundary elements of their maps.

`python -m capslip.studies.plastic_tops` prints the tables, in half an hour.

What a map knows of metal that yields it has from finite elements of spheres
(`capslip.contact.solvers.metal`, `capslip.contact.plastic_law`). Tops of a rough face are none.
Each top here is round, is pressed into the half-space of `plastic_sphere` until its contact has a
radius of 1, and is then a height map with the same load and the hardness H = 2.8 Y. Strains are
small, so how steep a top is has no part: only E* times its steepness over Y. That is told by the
mean pressure that the contact would have if it were elastic, over H.

Of an elastic contact of radius a the top f(r) has sunk by d and bears F (Sneddon 1965,
doi 10.1016/0020-7225(65)90019-4)::

    d(a) = a integral_0^(pi / 2) f'(a sin t) dt,    F(a) = 2 E* integral_0^a c d'(c) dc
"""

import argparse
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from capslip.contact.map_accuracy import error_of_map
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.rung import ModelError
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.yielding import HARDNESS_PER_YIELD
from capslip.errors import ContactError
from capslip.studies.page import table
from capslip.studies.plastic_sphere import (
    FAR,
    FORCE_SHARES,
    Body,
    Contact,
    Mesh,
    mesh_of,
    parabola,
    pressed,
    slipped,
)
from capslip.surface.heightmap import HeightMap

RINGS = 250
OVERLOADS = (0.35, 0.7, 1.4, 3.0, 8.0)  # elastic mean pressure over H
YIELDS = 0.5  # elastic mean pressure over Y, up to which the tops here stay elastic
BUMP = 0.1  # height, where the sphere falls by a half
PIXELS = 32  # along the radius of the contact by finite elements
UNKNOWN = 100.0  # times less, that a value may be too: then it may be any
OUTSIDE = 1.5  # of that radius, to where the map goes
ASIDE = 0.3  # of a pixel, that the axis lies beside one
E_STAR_PA, RADIUS_M, STEEP, MU, KAPPA = 1e11, 32e-6, 1e-3, 0.2, 1.2  # of the map: none matters


def cone(r: np.ndarray) -> np.ndarray:
    """Return how far below its top a cone is at radii."""
    return np.array(r)


def fourth_power(r: np.ndarray) -> np.ndarray:
    """Return the same of r^4, which is flat in its middle."""
    return np.asarray(r**4)


def rimmed(r: np.ndarray) -> np.ndarray:
    """Return the same of a flat of half the radius with a rim as round as a sphere."""
    return 0.5 * np.maximum(r - 0.5, 0.0) ** 2


def worn(r: np.ndarray) -> np.ndarray:
    """Return the same of a sphere that has lost its top, as far as half the radius."""
    return 0.5 * np.maximum(r**2 - 0.25, 0.0)


def bumpy(r: np.ndarray, radius: float) -> np.ndarray:
    """Return the same of a sphere with a small bump upon it."""
    inside = np.maximum(1.0 - (r / radius) ** 2, 0.0)
    return np.asarray(0.5 * r**2 + BUMP * (1.0 - inside**2))


@dataclass(frozen=True)
class Top:
    """A round top, and how it is pressed."""

    name: str
    height: Callable[[np.ndarray], np.ndarray]  # below the highest point
    flat: float = 0.0  # radius that touches at once
    overloads: tuple[float, ...] = OVERLOADS


TOPS = (
    Top("parabola", parabola),
    Top("cone", cone),
    Top("r^4", fourth_power),
    Top("flat with a rim", rimmed, 0.5),
    Top("worn sphere", worn, 0.5),
    Top("sphere with a bump", partial(bumpy, radius=0.4), 0.0, (0.35, 0.6, 1.0)),
    # The sphere would touch around it before the ring between does, for one or two rings
    Top("sphere with a tip", partial(bumpy, radius=0.2), 0.0, (0.25, 0.35, 0.5)),
)


@dataclass(frozen=True, eq=False)
class Answer:
    """What a contact under full load is, in units of E*, its radius and steepness."""

    depth: float  # since first touch, of a half-space without end
    area: float
    withdrawal: np.ndarray  # at `FORCE_SHARES`; at the same force 1 / K goes as it does
    energy: np.ndarray  # 4 integral (F de - e dF), at the same


def elastic(top: Top, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return depths and loads at which an elastic contact has radii, growing from nearly zero.

    Examples
    --------
    Those of a cone: pi / 2 a, and pi / 2 a^2.

    >>> depth, load = elastic(Top("cone", cone), np.linspace(0.01, 1.0, 100))
    >>> print(depth[-1].round(4), load[-1].round(4))
    1.5708 1.5708
    """
    step = 1e-6
    angle = (np.arange(2000) + 0.5) * np.pi / 4000
    r = np.outer(radii, np.sin(angle))
    below = np.maximum(r - step, 0.0)
    slope = (top.height(r + step) - top.height(below)) / (r + step - below)
    depth = radii * slope.mean(1) * np.pi / 2.0
    between = radii - 0.5 * np.diff(radii, prepend=0.0)
    return depth, 2.0 * np.cumsum(between * np.diff(depth, prepend=0.0))


def by_elements(top: Top, overload: float, mesh: Mesh) -> Contact:
    """Press a top in by finite elements.

    Parameters
    ----------
    top : Top
    overload : float
        Mean pressure over the hardness, were all elastic.
    mesh : Mesh

    Raises
    ------
    ContactError
        If no balance is found.
    """
    a = np.linspace(0.0, 1.0, 1001)[1:]
    mean = elastic(top, a)[1] / (np.pi * a**2)
    Y = float(mean[-1]) / (HARDNESS_PER_YIELD * overload)
    yields = np.append(a[mean > YIELDS * Y], 1.0)[0]
    if top.flat:  # the first ring that is not flat touches at once
        yields = np.nextafter(top.flat, 1.0)
    elif yields == a[0]:
        yields = 0.0
    return pressed(Body(mesh, Y, 0.0, top.height), float(yields))


def answer_of(contact: Contact) -> Answer:
    """Return what finite elements say."""
    depth = contact.depth + contact.load / (np.pi * FAR)
    e, W = slipped(contact.r, contact.pressure, contact.load, FORCE_SHARES)
    return Answer(depth, np.pi * contact.radius**2, e, W)


def by_map(top: Top, load: float, yield_stress: float) -> tuple[Answer, ModelError]:
    """Return what a map of the top says under this load, and the errors that it states."""
    reach = round(OUTSIDE * PIXELS)
    at = (np.arange(-reach, reach + 1) + ASIDE) / PIXELS
    height_m = -STEEP * RADIUS_M * top.height(np.hypot(at, at[:, None]))
    load_N = load * STEEP * E_STAR_PA * RADIUS_M**2
    surface = HeightMap(height_m, (RADIUS_M / PIXELS,) * 2)
    hardness_Pa = HARDNESS_PER_YIELD * yield_stress * STEEP * E_STAR_PA
    curve = boundary_elements(surface, E_STAR_PA, preload_N=load_N, hardness_Pa=hardness_Pa)
    slip = slip_curve(curve, load_N, MU, KAPPA)
    T, unit_m = MU * load_N * np.array(FORCE_SHARES), STEEP * RADIUS_M
    depth_m = curve.loaded_first_to(load_N).of_face_m - height_m.max()  # since the top touched
    e_m, W_J = slip.displacement_m(T) / (MU * KAPPA), slip.energy_at_force_J(T) / (MU**2 * KAPPA)
    area = curve.pressed(load_N).contact_area_m2 / RADIUS_M**2
    found = Answer(depth_m / unit_m, area, e_m / unit_m, W_J / (load_N / load * unit_m))
    errors, _ = error_of_map(curve, load_N, 0.1)
    assert errors is not None  # a map always states some
    return found, errors


def stated(errors: ModelError) -> np.ndarray:
    """Return the logarithms of map over truth that errors allow at 95 %, a pair for each share.

    Shape (2, 4, 2): of stiffness and energy.
    """
    pairs = []
    for share in FORCE_SHARES:
        half = np.array([[errors.stiffness, errors.energy_at(share)]])
        if errors.law is not None:
            half = np.vstack((half, errors.law.half_95(share)))
        wide = np.linalg.norm(half, axis=0)
        pairs.append(np.stack((-wide, wide), axis=1))
    return np.swapaxes(pairs, 0, 1)


def plastic_tops(
    tops: Iterable[Top] = TOPS,
    rings: int = RINGS,
    progress: Callable[[str], None] = lambda message: None,
) -> str:
    """Return in Markdown depths, stiffnesses and energies of maps, over those of finite elements.

    Parameters
    ----------
    tops : iterable of Top
    rings : int
        As in `plastic_sphere`.
    progress : callable, optional
        Called with one line a case. One without balance is named there, and has no row.
    """
    mesh = mesh_of(rings)
    rows: tuple[list[tuple[str, ...]], ...] = ([], [])
    for top in tops:
        for overload in top.overloads:
            try:
                contact = by_elements(top, overload, mesh)
            except ContactError as error:
                progress(f"{top.name} at {overload:g}: {error}")
                continue
            true, Y = answer_of(contact), contact.yield_stress
            found, errors = by_map(top, contact.load, Y)
            mean = contact.load / (true.area * HARDNESS_PER_YIELD * Y)
            name = top.name, f"{mean:.3f}"
            whole = f"{found.depth / true.depth:.3f}", f"{found.area / true.area:.3f}"
            stiff, energy = true.withdrawal / found.withdrawal, found.energy / true.energy
            allowed = stated(errors)
            rows[0].append((*name, *whole, *map(_cell, stiff, allowed[0])))
            rows[1].append((*name, *map(_cell, energy, allowed[1])))
            progress(f"{', '.join(rows[0][-1])} | {', '.join(rows[1][-1][2:])}")
    head = "top", "p_m / H"
    of_K, of_W = ([f"{one} at {share:g}" for share in FORCE_SHARES] for one in "KW")
    return (
        "Map over finite elements, and what the map states for that (! where it is not so):\n\n"
        f"{table((*head, 'depth', 'area', *of_K), rows[0])}\n\n"
        f"{table((*head, *of_W), rows[1])}"
    )


def _cell(ratio: float, allowed: np.ndarray) -> str:
    low, high = allowed
    held = "" if low <= np.log(ratio) <= high else " !"
    known = high - low < np.log(UNKNOWN)
    said = f"{np.exp(low):.2f} to {np.exp(high):.2f}" if known else "any"
    return f"{ratio:.3f} ({said}){held}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rings", type=int, default=RINGS)
    given = parser.parse_args()

    def tell(message: str) -> None:
        sys.stderr.write(f"{message}\n")

    sys.stdout.write(f"{plastic_tops(rings=given.rings, progress=tell)}\n")


if __name__ == "__main__":
    main()
