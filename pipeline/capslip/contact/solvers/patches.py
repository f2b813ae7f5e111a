"""Patches around the contacts of a pressed face, on which what happens below its load is solved.

Below a load the contact only shrinks, so no point outside of it is needed any more. Each patch has
its own small transform. Between two patches the kernel is smooth, and is interpolated between
Chebyshev nodes of both: moments of the pressures at the nodes of one, times the kernel between the
nodes, interpolated to the pixels of the other.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.half_space import (
    POINT_COST,
    even_spectrum,
    love_kernel,
    love_kernel_at,
    padded_shape,
    work_of,
)
from capslip.contact.solvers.rough_inverse import RoughInverse

KERNEL_ERROR = 1e-6  # aimed at between patches, relative
_MARGIN = 2  # pixels around the contacts
_APART = (1.0, 0.5, 0.25, 0.1)  # half sides between two patches; nearer ones become one
_MOST_NODES = 3000  # of all patches
_MOST_POINTS = 300_000  # where refined
_MOST_SHARE = 0.5  # of the points of the map in patches; with more, the map itself is quicker
_AT_ONCE = 25_000  # points transformed together: what stays in the cache
_SPLINE_MARGIN = 8  # pixels beyond a patch that its refinement sees


@dataclass(frozen=True, eq=False)
class PatchedFace(ElasticFace):
    """Parts of a face, made by `patched`: every array has one axis, patch after patch."""

    parent: np.ndarray  # (n,), flat index of the pixel of the whole map in which each point lies
    map_shape: tuple[int, int]
    refinement: int  # points along the side of a pixel of the map
    at_m: tuple[np.ndarray, np.ndarray]  # (x, y) of the points, shape (n,) each

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
        return np.asarray(sums.reshape(self.map_shape) / self.refinement**2)


def patched(face: ElasticFace, contact: np.ndarray, refinement: int = 1) -> PatchedFace | None:
    """Return patches around contacts, None where the whole map is no more work.

    Parameters
    ----------
    face : ElasticFace
        The whole map.
    contact : bool, shape (ny, nx)
        Where it touches.
    refinement : int
        Points along the side of a pixel; between the heights of the map a cubic spline.
    """
    cheapest = _cheapest(contact, refinement)
    if cheapest is None:
        return None
    boxes, nodes = cheapest
    size_m = face.pixel_size_m[0] / refinement, face.pixel_size_m[1] / refinement
    half_space = PatchedHalfSpace(boxes * refinement, nodes, size_m, face.E_star_Pa)
    parents, depths, knowns, places = [], [], [], []
    for y0, x0, y1, x1 in boxes.tolist():
        i, j = (
            np.arange(first * refinement, last * refinement) // refinement
            for first, last in ((y0, y1), (x0, x1))
        )
        fine = np.meshgrid(
            np.arange(x0 * refinement, x1 * refinement) + 0.5,
            np.arange(y0 * refinement, y1 * refinement) + 0.5,
        )
        places.append(np.reshape(fine, (2, -1)))
        parents.append((i[:, None] * face.shape[1] + j).ravel())
        knowns.append(face.measured[i[:, None], j].ravel())
        depths.append(_refined(face, (y0, x0, y1, x1), refinement).ravel())
    at, depth_m = np.concatenate(places, axis=1), np.concatenate(depths)
    if refinement > 1:  # the approach counts from the highest of all points, now on the spline
        depth_m -= depth_m.min()
    return PatchedFace(
        face.name,
        depth_m,
        np.concatenate(knowns),
        size_m,
        face.E_star_Pa,
        half_space,  # type: ignore[arg-type]
        np.concatenate(parents),
        face.shape,
        refinement,
        (at[0] * size_m[1], at[1] * size_m[0]),
        hardness_Pa=face.hardness_Pa,
    )


def half_space_around(
    face: PatchedFace, points: np.ndarray
) -> tuple["PatchedHalfSpace", np.ndarray] | None:
    """Return the half-space on patches around some points of a face, and their places there.

    None where the whole map is no more work.

    Parameters
    ----------
    face : PatchedFace
        With their places in the map.
    points : int, shape (n,)
        Those that are in contact, as indices into the face.
    """
    contact = np.zeros(face.map_shape, dtype=bool)
    contact.reshape(-1)[face.parent[points]] = True
    cheapest = _cheapest(contact, face.refinement, tight=True)
    if cheapest is None:
        return None
    boxes, nodes = cheapest
    boxes = boxes * face.refinement
    half_space = PatchedHalfSpace(boxes, nodes, face.pixel_size_m, face.E_star_Pa)
    column, row = (
        np.rint(at_m[points] / size_m - 0.5).astype(np.intp)
        for at_m, size_m in zip(face.at_m, face.pixel_size_m[::-1], strict=True)
    )
    place, first = np.full(len(points), -1), 0
    for y0, x0, y1, x1 in boxes.tolist():
        inside = (row >= y0) & (row < y1) & (column >= x0) & (column < x1)
        place[inside] = first + (row[inside] - y0) * (x1 - x0) + column[inside] - x0
        first += (y1 - y0) * (x1 - x0)
    return half_space, place


class PatchedHalfSpace:
    """Sinking of a half-space under pressures on patches, as `HalfSpace` on a map.

    Parameters
    ----------
    boxes : int, shape (n, 4)
        First row and column of each patch, and those after the last, in pixels.
    nodes : list
        Of each patch.
    pixel_size_m : (float, float)
        (dy, dx).
    E_star_Pa : float
        Composite modulus.
    """

    def __init__(
        self,
        boxes: np.ndarray,
        nodes: list["_Nodes"],
        pixel_size_m: tuple[float, float],
        E_star_Pa: float,
    ) -> None:
        sides = boxes[:, 2:] - boxes[:, :2]
        self._ends = np.append(0, np.cumsum(sides.prod(axis=1)))
        self._groups = _grouped(sides, self._ends, pixel_size_m, E_star_Pa)
        self._nodes = nodes
        self._node_ends = np.append(0, np.cumsum([nodes.count for nodes in self._nodes]))
        self.n_nodes = int(self._node_ends[-1])
        if len(boxes) > 1:
            self._between = self._kernel(pixel_size_m, E_star_Pa)
        maps = [one for group in self._groups for one in group.members]
        near = love_kernel((2, 2), pixel_size_m, E_star_Pa)
        self._rough_inverse = RoughInverse(maps, near, pixel_size_m, E_star_Pa)

    def sinking_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement into the half-space, shape (n,)."""
        return self._sinking_m(np.asarray(pressure_Pa, dtype=float), rough=False)

    def sinking_roughly_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the same in single precision and half of the time: for small changes."""
        return self._sinking_m(pressure_Pa.astype(np.float32), rough=True)

    def _sinking_m(self, pressure_Pa: np.ndarray, rough: bool) -> np.ndarray:
        sinking_m = np.empty_like(pressure_Pa)
        for group in self._groups:
            group.convolved(
                *(pressure_Pa, sinking_m, group.rough_spectrum if rough else group.spectrum)
            )
        if len(self._nodes) > 1:
            nodes, between = self._rough if rough else (self._nodes, self._between)
            far = between @ self._moments(pressure_Pa, nodes)
            for k, (one, first, last) in enumerate(self._each(nodes)):
                at = far[self._node_ends[k] : self._node_ends[k + 1]]
                at = at.reshape(one.y.shape[1], one.x.shape[1])
                sinking_m[first:last] += (one.y @ at @ one.x.T).ravel()
        return sinking_m

    def work(self, pressure_Pa: np.ndarray) -> tuple[float, None]:
        """Return the sum of pressures times their own sinking, roughly; that is not found here."""
        pressure_Pa = pressure_Pa.astype(np.float32)
        work = sum(group.work_of(pressure_Pa) for group in self._groups)
        if len(self._nodes) > 1:
            nodes, between = self._rough
            moments = self._moments(pressure_Pa, nodes)
            work += float(moments @ (between @ moments))
        return work, None

    def pressure_Pa(self, sinking_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return roughly the pressures at points alone that make a displacement, by patches."""
        return self._rough_inverse.pressure_Pa(sinking_m, points)

    def _moments(self, pressure_Pa: np.ndarray, nodes: list["_Nodes"]) -> np.ndarray:
        """Return the moments of pressures at all nodes."""
        return np.concatenate(
            [
                (one.y.T @ pressure_Pa[first:last].reshape(one.shape) @ one.x).ravel()
                for one, first, last in self._each(nodes)
            ]
        )

    @cached_property
    def _rough(self) -> tuple[list["_Nodes"], np.ndarray]:
        """The nodes and the kernel between them in single precision."""
        return [nodes.roughly() for nodes in self._nodes], self._between.astype(np.float32)

    @property
    def n_points(self) -> int:
        """Number of points of all patches."""
        return int(self._ends[-1])

    @property
    def cost(self) -> int:
        """Work of one sinking, in products of two numbers."""
        return self.n_nodes**2 + POINT_COST * self.n_points

    @property
    def count(self) -> int:
        """Number of patches."""
        return len(self._nodes)

    def _each(self, nodes: list["_Nodes"]) -> "Iterator[tuple[_Nodes, int, int]]":
        return zip(nodes, self._ends[:-1].tolist(), self._ends[1:].tolist(), strict=True)

    def _kernel(self, pixel_size_m: tuple[float, float], E_star_Pa: float) -> np.ndarray:
        """Return the sinking at each node under unit pressure in a pixel around each other one."""
        y, x = (
            np.concatenate([np.array(nodes.places[axis]).ravel() for nodes in self._nodes])
            for axis in (0, 1)
        )
        kernel = np.zeros((self.n_nodes, self.n_nodes))
        for first, last in zip(self._node_ends[:-1], self._node_ends[1:], strict=True):
            rows, columns = slice(first, last), slice(last, None)
            offsets = np.abs(y[rows, None] - y[columns]), np.abs(x[rows, None] - x[columns])
            kernel[rows, columns] = love_kernel_at(offsets, pixel_size_m, E_star_Pa)
            kernel[columns, rows] = kernel[rows, columns].T
        return kernel


@dataclass(frozen=True, eq=False)
class _Group:
    """Patches that fit into arrays of one shape, transformed some at once."""

    shape: tuple[int, int]
    padded: tuple[int, int]
    spectrum: np.ndarray
    rough_spectrum: np.ndarray  # in single precision
    members: list[tuple[slice, int, int]]  # points of each patch, rows and columns

    def convolved(self, values: np.ndarray, out: np.ndarray, spectrum: np.ndarray) -> None:
        """Write what the members have of a convolution into `out`, both shape (n,)."""
        from scipy import fft

        for members, array in self._arrays(values):
            rows = fft.rfft(array, n=self.padded[1], axis=2)
            waves = fft.fft(rows, n=self.padded[0], axis=1)
            waves *= spectrum
            rows = fft.ifft(waves, axis=1, overwrite_x=True)[:, : self.shape[0]]
            array = fft.irfft(rows, n=self.padded[1], axis=2)
            for part, (points, ny, nx) in zip(array, members, strict=True):
                out[points] = part[:ny, :nx].reshape(-1)

    def work_of(self, pressure_Pa: np.ndarray) -> float:
        """Return the sum of pressures (n,) of the members times what each sinks by its own."""
        from scipy import fft

        work = 0.0
        for _, array in self._arrays(pressure_Pa):
            waves = fft.fft(fft.rfft(array, n=self.padded[1], axis=2), n=self.padded[0], axis=1)
            work += work_of(waves, self.rough_spectrum, self.padded)
        return work

    def _arrays(
        self, values: np.ndarray
    ) -> Iterator[tuple[list[tuple[slice, int, int]], np.ndarray]]:
        """Return some of the members at once, and their values."""
        at_once = max(1, _AT_ONCE // math.prod(self.shape))
        for begin in range(0, len(self.members), at_once):
            members = self.members[begin : begin + at_once]
            array = np.zeros((len(members), *self.shape), dtype=values.dtype)
            for part, (points, ny, nx) in zip(array, members, strict=True):
                part[:ny, :nx] = values[points].reshape(ny, nx)
            yield members, array


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Chebyshev nodes of one patch, and the values of their polynomials at its pixels."""

    y: np.ndarray  # (ny, n)
    x: np.ndarray  # (nx, m)
    places: tuple[np.ndarray, np.ndarray]  # of all nodes in the map, in pixels, shape (n, m)

    @property
    def count(self) -> int:
        return self.y.shape[1] * self.x.shape[1]

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.y), len(self.x)

    def roughly(self) -> "_Nodes":
        """Return the values in single precision."""
        return _Nodes(self.y.astype(np.float32), self.x.astype(np.float32), self.places)

    @classmethod
    def of(cls, boxes: np.ndarray, k: int) -> "_Nodes":
        """Return as many nodes along each side of patch k as the nearest other patch needs."""
        low, high = boxes[:, :2], boxes[:, 2:] - 1
        others = np.arange(len(boxes)) != k
        gaps = np.maximum(low[others] - high[k], low[k] - high[others]).clip(min=0)
        bases, places = [], []
        for axis in (0, 1):
            n = int(high[k, axis] - low[k, axis]) + 1
            half = max((n - 1) / 2, 0.5)
            along, across = gaps[:, axis] / half, gaps[:, 1 - axis] / half
            # Foci of the ellipse through the singularity: how fast interpolation converges
            z = np.where(along > 0, 1 + along, 0) + 1j * across
            rate = np.abs(z + np.sqrt(z - 1) * np.sqrt(z + 1)).min(initial=1e9)
            n_nodes = min(n, max(2, math.ceil(math.log(1 / KERNEL_ERROR) / math.log(rate))))
            at = np.arange(n) / half - 1 if n > 1 else np.zeros(1)
            if n_nodes == n:
                nodes, basis = at, np.eye(n)
            else:
                angle = (np.arange(n_nodes) + 0.5) * np.pi / n_nodes
                nodes = np.cos(angle)
                weight = np.sin(angle) * (-1.0) ** np.arange(n_nodes)
                off = at[:, None] - nodes
                exact = np.abs(off) < 1e-14
                terms = weight / np.where(exact, 1.0, off)
                on_node = np.asarray(exact.any(axis=1))[:, None]
                basis = np.where(on_node, exact, terms / terms.sum(axis=1)[:, None])
            bases.append(np.ascontiguousarray(basis))
            places.append(low[k, axis] + (nodes + 1) * half if n > 1 else low[k, axis] + nodes)
        y, x = np.meshgrid(*places, indexing="ij")
        return cls(bases[0], bases[1], (y, x))


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


def _cheapest(
    contact: np.ndarray, refinement: int, tight: bool = False
) -> tuple[np.ndarray, list[_Nodes]] | None:
    """Return the cheapest boxes around contacts, with their nodes; None if the map is cheaper.

    Patches that stay apart are small, and need many nodes. Tight ones end where the contact does.
    """
    from scipy.ndimage import find_objects, label

    part = label(with_margin(contact), np.ones((3, 3)))[0]
    found = find_objects(part * contact if tight else part)
    single = np.array([(y.start, x.start, y.stop, x.stop) for y, x in found])
    best, least = None, np.inf
    for apart in _APART:
        boxes = _boxes(single, apart)
        n_points = int((boxes[:, 2:] - boxes[:, :2]).prod(axis=1).sum())
        most = _MOST_SHARE * contact.size if refinement == 1 else _MOST_POINTS / refinement**2
        if n_points > most or len(boxes) > _MOST_NODES / 16:
            continue
        nodes = [_Nodes.of(boxes * refinement, k) for k in range(len(boxes))]
        n_nodes = sum(each.count for each in nodes)
        cost = n_nodes**2 + POINT_COST * n_points * refinement**2
        if n_nodes <= _MOST_NODES and cost < least:
            best, least = (boxes, nodes), cost
    return best


def _boxes(boxes: np.ndarray, apart: float) -> np.ndarray:
    """Return boxes (first row, first column, end row, end column), merged where they are near."""
    while True:
        low, high = boxes[:, :2], boxes[:, 2:]
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


def _grouped(
    sides: np.ndarray, ends: np.ndarray, pixel_size_m: tuple[float, float], E_star_Pa: float
) -> list[_Group]:
    """Return the patches by the shape of their transforms."""
    from scipy import fft

    shapes: dict[tuple[int, int], list[int]] = {}
    for k, (ny, nx) in enumerate(sides.tolist()):
        # Steps of an eighth, so that patches share shapes
        shape = tuple(int(fft.next_fast_len(_rounded(n), real=True)) for n in (ny, nx))
        shapes.setdefault((shape[0], shape[1]), []).append(k)
    groups = []
    for shape, members in shapes.items():
        padded = padded_shape(shape)
        spectrum = even_spectrum(love_kernel(shape, pixel_size_m, E_star_Pa), padded)
        found = [(slice(ends[k], ends[k + 1]), *sides[k].tolist()) for k in members]
        groups.append(_Group(shape, padded, spectrum, spectrum.astype(np.float32), found))
    return groups


def _rounded(n: int) -> int:
    step = max(1, 2 ** (n.bit_length() - 4))
    return -(-n // step) * step


def _refined(face: ElasticFace, box: tuple[int, int, int, int], refinement: int) -> np.ndarray:
    """Return the depths of a box, on a cubic spline through those of the map where refined."""
    y0, x0, y1, x1 = box
    if refinement == 1:
        return face.depth_m[y0:y1, x0:x1]
    from scipy.interpolate import make_interp_spline
    from scipy.ndimage import distance_transform_edt

    (ny, nx), m = face.shape, _SPLINE_MARGIN
    first, last = (max(y0 - m, 0), max(x0 - m, 0)), (min(y1 + m, ny), min(x1 + m, nx))
    window = np.s_[first[0] : last[0], first[1] : last[1]]
    depth_m, measured = face.depth_m[window], face.measured[window]
    if not measured.all():
        nearest = distance_transform_edt(~measured, return_distances=False, return_indices=True)
        depth_m = depth_m[tuple(nearest)]
    # Its ends go on as they are, since a map ends half a pixel beyond its last point.
    for axis, (start, end) in enumerate(((y0, y1), (x0, x1))):
        places = (np.arange(start * refinement, end * refinement) + 0.5) / refinement - 0.5
        known = np.arange(depth_m.shape[axis]) + first[axis]
        depth_m = make_interp_spline(known, depth_m, k=3, axis=axis)(places)
    return np.asarray(depth_m)
