"""Patches around the contacts of a pressed face, on which what happens below its load is solved.

Below a load the contact only shrinks, so no point outside of it is needed any more.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.half_space import POINT_COST
from capslip.contact.solvers.patched_half_space import (
    KERNEL_ERROR,
    PatchedHalfSpace,
    node_counts,
)

_MARGIN = 2  # pixels around the contacts
_APART = (1.0, 0.5, 0.25, 0.1)  # half sides between two patches; nearer ones become one
_MOST_NODES = 3000  # of all patches
_MOST_POINTS = 300_000  # where refined
# Between refined patches of a face that yields, where there are more nodes than that: an error that
# leaves 1e-5 in the stiffness and 1e-4 in the energies, and the most nodes, of 160 MB
_ROUGHLY, _MOST_ROUGHLY = 1e-3, 4500
_MOST_SHARE = 0.5  # of the points of the map in patches; with more, the map itself is quicker
_SPLINE_MARGIN = 8  # pixels beyond a patch that its refinement sees
# Points along the longer side of a pixel of a map that is rough from pixel to pixel: its shortest
# wave, of two pixels, has four then. More would follow a spline where it no longer knows the face
MOST_OF_ROUGH = 2
ENDS_OF_ROUGH = 0.125  # pixels beyond its outermost heights, that its spline is followed
_OF_SLOPE = 1e-3  # weight of first differences beside second ones, where heights are lost


Spline = Literal["third", "fifth", "other"]


@dataclass(frozen=True, eq=False)
class PatchedFace(ElasticFace):
    """Parts of a face, made by `patched`: every array has one axis, patch after patch."""

    parent: np.ndarray  # (n,), flat index of the pixel of the whole map in which each point lies
    map_shape: tuple[int, int]
    per_pixel: tuple[int, int]  # points along the sides y and x of a pixel of the map
    at_m: tuple[np.ndarray, np.ndarray]  # (x, y) of the points, shape (n,) each
    spline: Spline = field(default="third", kw_only=True)  # what lies between pixels, see `patched`

    @property
    def shape(self) -> tuple[int, ...]:  # type: ignore[override]
        """(n,)."""
        return self.depth_m.shape

    @cached_property
    def coarser(self) -> None:
        """None: patches start from the whole map."""
        return

    @property
    def places_m(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates x and y of the points in the map, shape (n,) each."""
        return self.at_m

    @property
    def refinement(self) -> int:
        """Points along the longer side of a pixel of the map."""
        return max(self.per_pixel)

    @property
    def cost(self) -> int:
        """Work of one sinking, in products of two numbers."""
        return self.half_space.cost

    def gathered(self, values: np.ndarray) -> np.ndarray:
        """Return the values of a map (ny, nx) at the points of the patches, shape (n,)."""
        return np.asarray(values.reshape(-1)[self.parent])

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return the means over the pixels of the map, zero outside the patches, shape (ny, nx)."""
        n_points = self.map_shape[0] * self.map_shape[1]
        sums = np.bincount(self.parent, weights=values, minlength=n_points)
        return np.asarray(sums.reshape(self.map_shape) / math.prod(self.per_pixel))


def patched(
    face: ElasticFace,
    contact: np.ndarray,
    refinement: int = 1,
    single: bool = False,
    ways: list[np.ndarray] | None = None,
    spline: Spline = "third",
) -> PatchedFace | None:
    """Return patches around contacts, None where the whole map is no more work.

    Parameters
    ----------
    face : ElasticFace
        The whole map.
    contact : bool, shape (ny, nx)
        Where it touches.
    refinement : int
        Points along the longer side of a pixel, and along the other as many as make none longer
        there; between the heights of the map a spline. So a refined face goes on over points that
        were lost, too, where others stand on both sides of them.
    single : bool
        As for `PatchedHalfSpace`.
    ways : list of ndarray, optional
        What `boxes_around` finds around them, where it is known.
    spline : "third", "fifth" or "other"
        Its degree, or another guess at what lies between the heights than the fifth.
    """
    (dy_m, dx_m), per_pixel = face.pixel_size_m, _per_pixel(face.pixel_size_m, refinement)
    per_y, per_x = per_pixel
    size_m = dy_m / per_y, dx_m / per_x
    yields = not math.isinf(face.hardness_Pa)
    if ways is None:
        ways = boxes_around(contact, face.pixel_size_m)
    roughly = refinement > 1 and yields
    cheapest = _cheapest(ways, size_m, per_pixel, contact.size, roughly)
    if cheapest is None:
        return None
    boxes, of_points, counts = cheapest
    half_space = PatchedHalfSpace(of_points, counts, size_m, face.E_star_Pa, single)
    known = face.measured
    if refinement > 1 and face.unmeasured.size:
        known = known | _lost_singly(known)
    parents, depths, knowns, places = [], [], [], []
    for box, (y0, x0, y1, x1) in zip(boxes.tolist(), of_points.tolist(), strict=True):
        i, j = np.arange(y0, y1), np.arange(x0, x1)
        places.append(np.reshape(np.meshgrid(j + 0.5, i + 0.5), (2, -1)))
        i, j = i[:, None] // per_y, j // per_x
        parents.append((i * face.shape[1] + j).ravel())
        knowns.append(known[i, j].ravel())
        depths.append(_refined(face, box, per_pixel, spline).ravel())
    at, depth_m, measured = np.concatenate(places, axis=1), *map(np.concatenate, (depths, knowns))
    if refinement > 1:  # the approach counts from the highest of all points, now on the spline
        depth_m -= depth_m[measured].min()
    return PatchedFace(
        face.name,
        depth_m,
        measured,
        size_m,
        face.E_star_Pa,
        half_space,  # type: ignore[arg-type]
        np.concatenate(parents),
        face.shape,
        per_pixel,
        (at[0] * size_m[1], at[1] * size_m[0]),
        hardness_Pa=face.hardness_Pa,
        spline=spline,
    )


def boxes_around(
    contact: np.ndarray, pixel_size_m: tuple[float, float], tight: bool = False
) -> list[np.ndarray]:
    """Return boxes around contacts, in ways that merge the more of them the nearer they are.

    Patches that stay apart are small, and need many nodes between them.

    Parameters
    ----------
    contact : bool, shape (ny, nx)
        Where a map touches.
    pixel_size_m : tuple of float
        Along y and x.
    tight : bool
        Whether boxes end where contact does; else with a margin.

    Returns
    -------
    list of ndarray, shape (k, 4) each
        First row, first column, end row and end column, in pixels.
    """
    from scipy.ndimage import find_objects, label

    part = label(with_margin(contact), np.ones((3, 3)))[0]
    found = find_objects(part * contact if tight else part)
    single = np.array([(y.start, x.start, y.stop, x.stop) for y, x in found])
    size = np.divide(pixel_size_m, min(pixel_size_m))
    return [_boxes(single, apart, size) for apart in _APART]


def half_space_around(
    face: PatchedFace, points: np.ndarray, most_cost: float
) -> PatchedHalfSpace | None:
    """Return the half-space of some points of a face, on patches around them alone.

    None where the whole map is no more work.

    Parameters
    ----------
    face : PatchedFace
        With their places in the map.
    points : int, shape (n,)
        Those that are in contact, as indices into the face.
    most_cost : float
        Of one sinking: none, too, where it would be more.
    """
    contact = np.zeros(face.map_shape, dtype=bool)
    contact.reshape(-1)[face.parent[points]] = True
    dy_m, dx_m = np.multiply(face.pixel_size_m, face.per_pixel).tolist()
    ways = boxes_around(contact, (dy_m, dx_m), tight=True)
    cheapest = _cheapest(ways, face.pixel_size_m, face.per_pixel, contact.size)
    if cheapest is None:
        return None
    _, boxes, counts = cheapest
    if _cost(boxes, counts) > most_cost:
        return None
    half_space = PatchedHalfSpace(boxes, counts, face.pixel_size_m, face.E_star_Pa)
    row, column = face.lattice(points)
    place, first = np.full(len(points), -1), 0
    for y0, x0, y1, x1 in boxes.tolist():
        inside = (row >= y0) & (row < y1) & (column >= x0) & (column < x1)
        place[inside] = first + (row[inside] - y0) * (x1 - x0) + column[inside] - x0
        first += (y1 - y0) * (x1 - x0)
    return half_space.part(place)


def with_margin(contact: np.ndarray) -> np.ndarray:
    """Return the points of a map that lie within the margin of patches around a contact."""
    near = np.pad(contact, _MARGIN)
    for _ in range(2):  # down, then to the right
        whole, n = near, len(near) - 2 * _MARGIN
        near = whole[:n].copy()
        for first in range(1, 2 * _MARGIN + 1):
            near |= whole[first : first + n]
        near = near.T
    return near


def _per_pixel(pixel_size_m: tuple[float, float], refinement: int) -> tuple[int, int]:
    """Return the points along the sides of a pixel, so many along the longer one."""
    longer_m = max(pixel_size_m)
    # Sides that are one or two times each other but for rounding are so
    per_y, per_x = (math.ceil(refinement * (one_m / longer_m) - 1e-6) for one_m in pixel_size_m)
    return per_y, per_x


def _cheapest(
    ways: list[np.ndarray],
    size_m: tuple[float, float],
    per_pixel: tuple[int, int],
    n_pixels: int,
    roughly: bool = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the cheapest boxes around contacts, and nodes along their sides; None for the map.

    The boxes in pixels, of which the map has so many, and in points of this size. Where patches
    need too many nodes, `roughly` takes fewer.
    """
    n_fine = math.prod(per_pixel)
    most = _MOST_SHARE * n_pixels if n_fine == 1 else _MOST_POINTS / n_fine
    ways = [boxes for boxes in ways if (boxes[:, 2:] - boxes[:, :2]).prod(axis=1).sum() <= most]
    exact, fewer = (KERNEL_ERROR, _MOST_NODES), (_ROUGHLY, _MOST_ROUGHLY)
    for error, most_nodes in (exact, fewer) if roughly else (exact,):
        best, least = None, np.inf
        for boxes in ways:
            if len(boxes) > most_nodes / 16:
                continue
            of_points = boxes * np.tile(per_pixel, 2)
            counts = node_counts(of_points, size_m, error)
            cost = _cost(of_points, counts)
            if counts.prod(axis=1).sum() <= most_nodes and cost < least:
                best, least = (boxes, of_points, counts), cost
        if best is not None:
            return best
    return None


def _cost(boxes: np.ndarray, counts: np.ndarray) -> int:
    """Return the work of one sinking on patches that are not made yet."""
    n_points = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1).sum()
    return int(counts.prod(axis=1).sum()) ** 2 + POINT_COST * int(n_points)


def _boxes(boxes: np.ndarray, apart: float, size: np.ndarray) -> np.ndarray:
    """Return boxes, merged where they are near, of pixels of this size."""
    while True:
        low, high = boxes[:, :2] * size, boxes[:, 2:] * size
        half = (high - low).max(axis=1) / 2
        gap = np.maximum(low[:, None] - high, low - high[:, None]).max(axis=2)
        near = gap < apart * np.maximum(half[:, None], half)
        np.fill_diagonal(near, False)
        if not near.any():
            return boxes
        boxes = _merged(boxes, near)


def _merged(boxes: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return the boxes around all that hang together."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    n, group = connected_components(csr_array(near), directed=False)
    low, high = np.full((n, 2), np.iinfo(np.int64).max), np.zeros((n, 2), dtype=np.int64)
    np.minimum.at(low, group, boxes[:, :2])
    np.maximum.at(high, group, boxes[:, 2:])
    return np.concatenate((low, high), axis=1)


def _refined(
    face: ElasticFace, box: tuple[int, int, int, int], per_pixel: tuple[int, int], spline: Spline
) -> np.ndarray:
    """Return the depths of a box, on a spline through those of the map where refined."""
    y0, x0, y1, x1 = box
    if per_pixel == (1, 1):
        return face.depth_m[y0:y1, x0:x1]
    (rows, cols), m = face.measured_window, _SPLINE_MARGIN * (1 if spline == "third" else 2)
    first = max(y0 - m, rows.start), max(x0 - m, cols.start)
    last = min(y1 + m, rows.stop), min(x1 + m, cols.stop)
    window = np.s_[first[0] : last[0], first[1] : last[1]]
    depth_m = _filled(face.depth_m[window], face.measured[window])
    # Its ends go on as they are, as far as a map goes beyond its last point: half a pixel. Those of
    # a rough face half as far as its points: a spline may rise by more than all of its approach.
    beyond = ENDS_OF_ROUGH if max(per_pixel) <= MOST_OF_ROUGH else 0.5
    for axis, (start, end, n) in enumerate(((y0, y1, per_pixel[0]), (x0, x1, per_pixel[1]))):
        places = (np.arange(start * n, end * n) + 0.5) / n - 0.5
        places = np.clip(places, first[axis] - beyond, last[axis] - 1 + beyond)
        known = np.arange(depth_m.shape[axis]) + first[axis]
        depth_m = _between(known, depth_m, axis, places, spline)
    return depth_m


def _between(
    known: np.ndarray, depth_m: np.ndarray, axis: int, places: np.ndarray, spline: Spline
) -> np.ndarray:
    """Return depths at places along an axis, on a spline through those at known places.

    Beyond the last of these the third degree bends too little and the fifth too much (on waves of
    5 to 8 pixels a hill there moved the energy by -9 and +7 %, 7 and -3, -5 and +3), so with the
    fifth it is their mean. The other guess takes the third between them and the fifth beyond.
    """
    from scipy.interpolate import make_interp_spline

    def of_degree(degree: int, at: np.ndarray) -> np.ndarray:
        degree = degree if len(known) > degree else min(3, len(known) - 1)  # of few lines
        return np.asarray(make_interp_spline(known, depth_m, k=degree, axis=axis)(at))

    found_m = of_degree(5 if spline == "fifth" else 3, places)
    beyond = (places < known[0]) | (places > known[-1])
    if spline != "third" and beyond.any():
        at = (beyond, slice(None)) if axis == 0 else (slice(None), beyond)
        of_fifth_m = of_degree(5, places[beyond])
        if spline == "fifth":
            of_fifth_m = 0.5 * (of_fifth_m + of_degree(3, places[beyond]))
        found_m[at] = of_fifth_m
    return found_m


def _lost_singly(measured: np.ndarray) -> np.ndarray:
    """Return the points that were lost between others, on both sides along a row or a column."""
    from scipy.ndimage import binary_opening

    lost = np.pad(~measured, 1, constant_values=True)
    wide = binary_opening(lost, np.ones((2, 2)))
    return np.asarray((lost & ~wide)[1:-1, 1:-1])


def _filled(depth_m: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Return depths with those that are lost bent as little as the others let them.

    The least sum of squares of the second differences along both axes, and next to none of the
    first ones, which are all that is left where too few are known. A step beside a contact would
    make a spline swing in it. Further from all that is known than a refinement sees, the nearest.
    """
    if measured.all():
        return depth_m
    from numpy.lib.stride_tricks import sliding_window_view
    from scipy.ndimage import distance_transform_edt
    from scipy.sparse import csr_array, vstack
    from scipy.sparse.linalg import spsolve

    away, nearest = distance_transform_edt(~measured, return_indices=True)
    filled_m = depth_m[tuple(nearest)].ravel()
    far = away.ravel() > _SPLINE_MARGIN
    lost = (away.ravel() > 0) & ~far
    index, rows = np.arange(depth_m.size).reshape(depth_m.shape), []
    for weights in ((1.0, -2.0, 1.0), (-_OF_SLOPE, _OF_SLOPE)):
        for axis in (0, 1):
            at = sliding_window_view(index, min(len(weights), index.shape[axis]), axis)
            at = at.reshape(-1, at.shape[-1])
            at = at[lost[at].any(axis=1) & ~far[at].any(axis=1)]
            if at.shape[1] < len(weights):
                continue
            row = np.repeat(np.arange(len(at)), len(weights))
            entries = np.tile(weights, len(at)), (row, at.ravel())
            rows.append(csr_array(entries, shape=(len(at), index.size)))
    differences = vstack(rows).tocsc()
    of_lost, known_m = differences[:, lost], np.where(lost, 0.0, filled_m)
    filled_m[lost] = spsolve(of_lost.T @ of_lost, -(of_lost.T @ (differences @ known_m)))
    return filled_m.reshape(depth_m.shape)
