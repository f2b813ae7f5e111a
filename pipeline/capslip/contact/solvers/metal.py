"""What a first load leaves of a face that yields, and with which pressures metal bears it."""

from dataclasses import dataclass, replace

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.pressed import Pressed

# By the greatest pressure p0 that a contact would have if it were elastic, over the hardness
OVER_HARDNESS = (0.6, 0.696, 0.839, 0.995, 1.244, 1.485, 1.961, 2.929, 3.931, 5.993)
# Places in a contact, from its edge (0) to its middle (1): t (2 t_max - t) / t_max^2 at a distance
# t from the edge, which is 1 - r^2 / a^2 of a round one
PLACES = (0.005, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.7, 0.85, 1.0)
# The pressure of a sphere there by finite elements, over that of an elastic contact of the same
# load and radius; a row for each p0 / H: `docs/theory.md`, section 5
OF_METAL = np.array(
    (
        (1.0,) * 12,
        (1.02, 1.03, 1.03, 1.03, 1.03, 1.03, 1.03, 1.03, 1.02, 1.0, 0.969, 0.928),
        (1.12, 1.13, 1.13, 1.13, 1.13, 1.12, 1.11, 1.09, 1.03, 0.966, 0.908, 0.855),
        (1.28, 1.29, 1.29, 1.28, 1.27, 1.25, 1.19, 1.11, 1.01, 0.929, 0.862, 0.802),
        (1.7, 1.72, 1.74, 1.56, 1.44, 1.35, 1.21, 1.11, 0.987, 0.893, 0.814, 0.744),
        (3.13, 2.43, 1.96, 1.67, 1.51, 1.39, 1.23, 1.11, 0.975, 0.872, 0.785, 0.706),
        (3.99, 2.86, 2.27, 1.86, 1.62, 1.47, 1.25, 1.11, 0.961, 0.845, 0.746, 0.654),
        (5.78, 3.9, 2.76, 2.07, 1.74, 1.53, 1.26, 1.1, 0.931, 0.812, 0.711, 0.603),
        (7.41, 4.46, 2.97, 2.16, 1.78, 1.54, 1.26, 1.08, 0.913, 0.795, 0.701, 0.602),
        (8.33, 4.71, 3.03, 2.14, 1.74, 1.51, 1.23, 1.06, 0.903, 0.796, 0.714, 0.645),
    )
)
# p0 / H up to which a contact has the pressures of an elastic one, and from which on it is taken
# for round: the bound has cut them off
_AS_SOLVED, _AS_ROUND = 0.8, 1.2
# What tells p0 / H of a sphere whose pressures end at the hardness: their mean, weighed by them,
# over H; and where nearly all is at H by how much it has sunk for good, the same mean, over the
# radius of the contact and H / E*
PRESSURE = (0.0, 0.75, 0.786, 0.8185, 0.8466, 0.8915, 0.924)
PRESSURE_AT = (0.0, 1.0, 1.05, 1.1, 1.15, 1.25, 1.35)
SUNK = (0.0, 0.0064, 0.0449, 0.162, 0.312, 0.4785, 0.84, 1.239, 2.137, 4.284, 6.826, 12.89, 28.23)
SUNK_AT = (1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0)
_BY_PRESSURE, _BY_DEPTH = 0.86, 0.92  # of that mean pressure
# How high it stands in its contact: the rms of its heights about their mean, over its radius and
# H / E*, times 8 sqrt(3) / pi, which is p0 / H of an elastic one
HEIGHT = (0.0, 1.0, 1.104, 1.267, 1.574, 1.93, 2.33, 3.24, 4.25, 6.54, 12.0, 18.5, 33.9, 73.0)
HEIGHT_AT = (0.0, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0, 12.0, 20.0)
_MOST_BLUNT = 3.0
# Points of a part, of which fewer do not tell how blunt it is: spheres seem 0.3 to 3 times as blunt
# as they are on up to ten, 0.73 to 0.89 times on 16 and 0.88 to 0.97 times on 30
_FEW = (12.0, 40.0)
_SLENDER = 1.25  # of how far the middle of a part is from the edge: its radius at most, by its area


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts of contacts, k of them, and the n points that touch, made by `parts_of`."""

    at: np.ndarray  # (n,), flat indices of the points
    part: np.ndarray  # (n,), in which each lies
    to_edge_m: np.ndarray  # (n,), how far each is from the edge
    widest_m: np.ndarray  # (k,), the same in the middle of a part
    radius_m: np.ndarray  # (k,)
    load_Pa: np.ndarray  # (k,), sum of the pressures
    over_hardness: np.ndarray  # (k,), p0 / H
    blunt: np.ndarray  # (k,), that over p0 / H of the sphere that is as high in its contact


def first_loading(face: ElasticFace, pressed: Pressed) -> tuple[ElasticFace, Pressed]:
    """Return the face that a first load has left, and its state under that load still.

    Where the pressure is the hardness, the point has sunk by what it would penetrate. With that in
    its heights, the same pressures are the elastic solution of the face. It unloads from those that
    metal has there, see `metal_pressure_Pa`, in the same gaps: by what these sink it otherwise, it
    has sunk for good as well.

    Parameters
    ----------
    face : ElasticFace
        With its hardness, under the tilt of the state.
    pressed : Pressed
        Its state under the load.

    Returns
    -------
    ElasticFace, Pressed
        Elastic; the approach counts from its own first touch.
    """
    yielded, sunk_m = pressed.pressure_Pa >= face.hardness_Pa, sunk_for_good_m(face, pressed)
    gap_m = pressed.gap_m + sunk_m
    pressure_Pa, over_hardness, blunt = metal_pressure_Pa(face, pressed)
    if pressure_Pa is not pressed.pressure_Pa:
        sunk_m = sunk_m + face.half_space.sinking_m(pressed.pressure_Pa - pressure_Pa)
    lower_m = float(np.min(face.depth_m + sunk_m, where=face.measured, initial=np.inf))
    left = replace(
        pressed,
        pressure_Pa=pressure_Pa,
        gap_m=gap_m,
        approach_m=pressed.approach_m - lower_m,
        yielded=yielded,
        over_hardness=over_hardness,
        blunt=blunt,
        bounded_Pa=pressed.max_pressure_Pa,
    )
    return face.flattened(sunk_m), left


def sunk_for_good_m(face: ElasticFace, pressed: Pressed) -> np.ndarray:
    """Return by how much points at the hardness have sunk for good, of the shape of the face."""
    yielded = pressed.pressure_Pa >= face.hardness_Pa
    return np.where(yielded, np.maximum(-pressed.gap_m, 0.0), 0.0)


def metal_pressure_Pa(face: ElasticFace, pressed: Pressed) -> tuple[np.ndarray, ...]:
    """Return pressures as metal has them after a first load, and what the parts of contacts are.

    One bound on the pressures gives the area of a contact, but not where in it the load is: metal
    yields below its surface before, and is flatter in its middle then, and where the bound makes a
    flat of even pressure to the very edge, it bears less there. What a contact loses as it unloads
    hangs on its edge. So each part of it keeps its load, and gets the pressures that a sphere has
    by finite elements at the same p0 / H, by how far each point is from the edge. Where a contact
    narrows and widens again another part begins.

    Parameters
    ----------
    face : ElasticFace
        With its hardness.
    pressed : Pressed
        Its state under the first load.

    Returns
    -------
    float64, three of the shape of the face
        Pressures; and `Parts.over_hardness` and `Parts.blunt` where each point lies, 0 and 1 where
        there is no contact, and where none of the face is near its hardness.
    """
    over_hardness, blunt = np.zeros(face.shape), np.ones(face.shape)
    found_Pa = pressed.pressure_Pa
    if pressed.max_pressure_Pa <= OVER_HARDNESS[0] * face.hardness_Pa:
        return found_Pa, over_hardness, blunt
    parts = parts_of(face, pressed)
    part, pressure_Pa = parts.part, found_Pa.reshape(-1)[parts.at]
    over = parts.over_hardness[part]
    over_hardness.reshape(-1)[parts.at] = over
    blunt.reshape(-1)[parts.at] = parts.blunt[part]
    inside = parts.to_edge_m / parts.widest_m[part]
    place = inside * (2.0 - inside)
    hertz_Pa = 1.5 * (parts.load_Pa / np.bincount(part))[part] * np.sqrt(place)
    as_round = np.clip((over - _AS_SOLVED) / (_AS_ROUND - _AS_SOLVED), 0.0, 1.0)
    # A pixel that is touched in part alone bears little, wherever it lies
    round_Pa = np.where(pressure_Pa < face.hardness_Pa, np.minimum(pressure_Pa, hertz_Pa), hertz_Pa)
    metal_Pa = (1.0 - as_round) * pressure_Pa + as_round * round_Pa
    metal_Pa *= _of_metal(over, place)
    metal_Pa *= (parts.load_Pa / np.bincount(part, weights=metal_Pa))[part]
    found_Pa = found_Pa.copy()
    found_Pa.reshape(-1)[parts.at] = metal_Pa
    return found_Pa, over_hardness, blunt


def parts_of(face: ElasticFace, pressed: Pressed, group: np.ndarray | None = None) -> Parts:
    """Return the parts of contacts, and p0 / H of each.

    It is that of the sphere that bears its load as evenly, or, where the pressure is the hardness
    nearly all over, that has sunk as deep. Neither hangs on the pixels of the rim, nor on one point
    in the middle. The radius is that of a circle of its area; of a slender one its half width.

    Parameters
    ----------
    face : ElasticFace
        With its hardness.
    pressed : Pressed
        Its state under the first load.
    group : int, of the shape of the face, optional
        What else to take for a part: the points of each number there, from 0 on.
    """
    at = np.flatnonzero(pressed.pressure_Pa)
    pressure_Pa = pressed.pressure_Pa.reshape(-1)[at]
    sunk_m = sunk_for_good_m(face, pressed).reshape(-1)[at]
    found, known, to_edge_m = _to_edge(face, at)
    part = _uphill(found, known, to_edge_m) if group is None else group.reshape(-1)[at]
    n_points, load_Pa = np.bincount(part), np.bincount(part, weights=pressure_Pa)
    widest_m = np.zeros(n_points.size)
    np.maximum.at(widest_m, part, to_edge_m)
    radius_m = np.sqrt(n_points * face.pixel_area_m2 / np.pi)
    radius_m = np.minimum(radius_m, _SLENDER * widest_m)
    mean_Pa, mean_m = (
        np.bincount(part, weights=pressure_Pa * one) / load_Pa for one in (pressure_Pa, sunk_m)
    )
    even = mean_Pa / face.hardness_Pa
    sunk = mean_m * face.E_star_Pa / (face.hardness_Pa * radius_m)
    by_depth = np.clip((even - _BY_PRESSURE) / (_BY_DEPTH - _BY_PRESSURE), 0.0, 1.0)
    over = (1.0 - by_depth) * np.interp(even, PRESSURE, PRESSURE_AT)
    over += by_depth * np.interp(sunk, SUNK, SUNK_AT)
    height_m = face.depth_m.reshape(-1)[at]
    mean_m = np.bincount(part, weights=height_m) / n_points
    rms_m = np.sqrt(np.bincount(part, weights=np.square(height_m - mean_m[part])) / n_points)
    high = 8.0 * np.sqrt(3.0) / np.pi * rms_m / radius_m * (face.E_star_Pa / face.hardness_Pa)
    blunt = over / np.maximum(np.interp(high, HEIGHT, HEIGHT_AT), over / _MOST_BLUNT)
    blunt = np.maximum(blunt, 1.0 / _MOST_BLUNT) ** np.interp(n_points, _FEW, (0.0, 1.0))
    return Parts(at, part, to_edge_m, widest_m, radius_m, load_Pa, over, blunt)


def _of_metal(over: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Interpolate `OF_METAL` at p0 / H and the place of each point."""
    rows = np.interp(over, OVER_HARDNESS, np.arange(len(OVER_HARDNESS)))
    columns = np.interp(place, PLACES, np.arange(len(PLACES)))
    row, column = (
        np.minimum(one.astype(int), n - 2)
        for one, n in zip((rows, columns), OF_METAL.shape, strict=True)
    )
    down, along = rows - row, columns - column
    upper, lower = (
        (1.0 - along) * OF_METAL[at, column] + along * OF_METAL[at, column + 1]
        for at in (row, row + 1)
    )
    return np.asarray((1.0 - down) * upper + down * lower)


def contacts_of(face: ElasticFace, at: np.ndarray) -> np.ndarray:
    """Return the contact in which each point lies, from 1 on: points beside one another, 8 ways.

    Parameters
    ----------
    face : ElasticFace
        Any points of a grid.
    at : int, shape (n,)
        Flat indices of those that touch.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    _, number, beside = _grid(face, at)
    found, known = _found(number, beside)
    one = np.broadcast_to(np.arange(at.size), beside.shape)[known]
    pairs = coo_matrix((np.ones(one.size, dtype=bool), (one, found[known])), shape=(at.size,) * 2)
    return np.asarray(connected_components(pairs, directed=False)[1]) + 1


def _to_edge(face: ElasticFace, at: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return how far points that touch are from the edge, after what `_found` says of them.

    Of points as flat indices. Their distance is that to the next one outside, less half of one.
    """
    from scipy.spatial import cKDTree

    width, number, beside = _grid(face, at)
    found, known = _found(number, beside)
    outside = np.unique(beside[~known])
    edge = np.transpose(np.divmod(outside, width)) * face.pixel_size_m
    place_m = np.transpose(np.divmod(number, width)) * face.pixel_size_m
    apart_m, _ = cKDTree(edge).query(place_m)
    return found, known, apart_m - 0.5 * min(face.pixel_size_m)


def _uphill(found: np.ndarray, known: np.ndarray, to_edge_m: np.ndarray) -> np.ndarray:
    """Return the part of a contact in which each point lies.

    The way up along their distance to the edge, from neighbour to neighbour, ends in its middle.
    """
    height = np.argsort(np.argsort(to_edge_m, kind="stable"))  # equal ones in one order
    up = np.where(known, height[found], -1)
    highest = up.argmax(axis=0), np.arange(to_edge_m.size)
    end = np.where(up[highest] > height, found[highest], highest[1])
    while (end[end] != end).any():
        end = end[end]
    return np.unique(end, return_inverse=True)[1]


def _grid(face: ElasticFace, at: np.ndarray) -> tuple[int, np.ndarray, np.ndarray]:
    """Return the width of a grid about points, their numbers in it, and of all beside, (8, n)."""
    row, column = face.lattice(at)
    row, column = row - row.min() + 1, column - column.min() + 1
    width = int(column.max()) + 2
    number = row * width + column
    steps = np.array([1, width - 1, width, width + 1])[:, None]
    return width, number, np.concatenate((number - steps, number + steps))


def _found(number: np.ndarray, beside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which of the points has each number of the grid, and whether one has."""
    order = np.argsort(number)
    found = order[np.minimum(np.searchsorted(number, beside, sorter=order), order.size - 1)]
    return found, number[found] == beside
