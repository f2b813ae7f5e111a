"""The half-space under pressures on patches, which are far less than all of a map.

Each patch has its own small transform. Between two patches the kernel is smooth, and is
interpolated between Chebyshev nodes of both: moments of the pressures at the nodes of one, times
the kernel between the nodes, interpolated to the pixels of the other. Patches of about one size lie
in one array, and are done together.
"""

import math
from copy import copy
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from capslip.contact.solvers.half_space import (
    POINT_COST,
    even_spectrum,
    love_kernel,
    love_kernel_at,
    padded_shape,
)
from capslip.contact.solvers.rough_inverse import RoughInverse, by_shape, quick_shape
from capslip.contact.solvers.waves import MOST_BY_PRODUCTS, apart, of_real_waves, together

KERNEL_ERROR = 1e-6  # aimed at between patches, relative
_AT_ONCE = 25_000  # points transformed together: what stays in the cache
_FAR = 1e9  # how fast interpolation converges to the kernel of nothing


class PatchedHalfSpace:
    """Sinking of a half-space under pressures on patches, as `HalfSpace` on a map.

    Parameters
    ----------
    boxes : int, shape (n, 4)
        First row and column of each patch, and those after the last, in pixels.
    counts : int, shape (n, 2)
        Nodes along the sides of each patch, from `node_counts`.
    pixel_size_m : (float, float)
        (dy, dx).
    E_star_Pa : float
        Composite modulus.
    single : bool
        Whether the kernel between patches, which is most of the memory, is in single precision
        alone: that leaves less than the interpolation.
    """

    def __init__(
        self,
        boxes: np.ndarray,
        counts: np.ndarray,
        pixel_size_m: tuple[float, float],
        E_star_Pa: float,
        single: bool = False,
    ) -> None:
        sides = boxes[:, 2:] - boxes[:, :2]
        ends = np.append(0, np.cumsum(sides.prod(axis=1))).tolist()
        points = [slice(begin, end) for begin, end in pairwise(ends)]
        self.count, self.n_points = len(boxes), int(ends[-1])
        self.n_nodes = int(counts.prod(axis=1).sum())
        self._place = np.empty(self.n_points, dtype=np.intp)  # of each point in all arrays
        self._n_places = 0
        groups, order = [], []
        shapes = [_array_shape(*side) for side in sides.tolist()]
        for shape, members in by_shape(shapes).items():
            kernel = love_kernel(shape, pixel_size_m, E_star_Pa)
            groups.append(_Group.of(self._n_places, kernel, sides[members], counts[members]))
            order += members
            for k in members:
                row, column = (np.arange(n) for n in sides[k])
                place = self._n_places + row[:, None] * shape[1] + column
                self._place[points[k]] = place.reshape(-1)
                self._n_places += math.prod(shape)
        between = None
        if self.count > 1:
            dtype = np.float32 if single else np.float64
            between = _between(boxes[order], counts[order], pixel_size_m, E_star_Pa, dtype)
        self._parts = _Parts(groups, between)
        self._rough_parts = self._parts.roughly()
        maps = [(at, ny, nx) for at, (ny, nx) in zip(points, sides.tolist(), strict=True)]
        near = love_kernel((2, 2), pixel_size_m, E_star_Pa)
        self._rough_inverse = RoughInverse(maps, near, pixel_size_m, E_star_Pa)

    @property
    def cost(self) -> int:
        """Work of one sinking, in products of two numbers."""
        return self.n_nodes**2 + POINT_COST * self.n_points

    def part(self, points: np.ndarray) -> "PatchedHalfSpace":
        """Return that of some of the points, by the same transforms."""
        one = copy(self)
        one._place = self._place[points]
        one._rough_inverse = self._rough_inverse.part(points)
        return one

    def sinking_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement into the half-space, shape (n,)."""
        return self._parts.sinking_m(self._placed(pressure_Pa, np.float64))[self._place]

    def sinking_roughly_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the same in single precision and half of the time: for small changes."""
        return self._rough_parts.sinking_m(self._placed(pressure_Pa, np.float32))[self._place]

    def work(self, pressure_Pa: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of pressures times their own sinking, and that as well, roughly."""
        sinking_m = self.sinking_roughly_m(pressure_Pa)
        return float(pressure_Pa @ sinking_m), sinking_m

    def pressure_Pa(self, sinking_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return roughly the pressures at points alone that make a displacement, by patches."""
        return self._rough_inverse.pressure_Pa(sinking_m, points)

    def _placed(self, values: np.ndarray, dtype: type[np.floating]) -> np.ndarray:
        """Return values at the points in the arrays of all groups, one after the other."""
        placed = np.zeros(self._n_places, dtype=dtype)
        placed[self._place] = values
        return placed


def node_counts(
    boxes: np.ndarray, pixel_size_m: tuple[float, float], error: float = KERNEL_ERROR
) -> np.ndarray:
    """Return how many nodes along its sides a patch needs for the nearest other one.

    Parameters
    ----------
    boxes : int, shape (n, 4)
        As for `PatchedHalfSpace`.
    pixel_size_m : (float, float)
        (dy, dx).
    error : float
        Aimed at between patches, relative.

    Returns
    -------
    ndarray of int, shape (n, 2)

    Examples
    --------
    >>> boxes = np.array([[0, 0, 20, 20], [0, 30, 20, 50], [0, 900, 20, 904]])
    >>> node_counts(boxes, (1e-5, 1e-5))
    array([[14, 10],
           [14, 10],
           [ 3,  2]])
    """
    low, high = boxes[:, :2], boxes[:, 2:] - 1
    n = high - low + 1
    gaps = np.maximum(low - high[:, None], low[:, None] - high).clip(min=0)
    half = np.maximum((n - 1) / 2, 0.5)
    size = np.divide(pixel_size_m, min(pixel_size_m))
    along, across = gaps / half[:, None], (gaps * size)[:, :, ::-1] / (half * size)[:, None]
    # Foci of the ellipse through the singularity: how fast interpolation converges
    z = np.where(along > 0, 1 + along, 0) + 1j * across
    rate = np.abs(z + np.sqrt(z - 1) * np.sqrt(z + 1))
    rate[np.diag_indices(len(n))] = _FAR
    enough = np.ceil(math.log(1 / error) / np.log(rate.min(axis=1)))
    return np.minimum(n, np.maximum(enough, 2).astype(n.dtype))


def _array_shape(ny: int, nx: int) -> tuple[int, int]:
    """Return the sides of arrays for a patch, in steps of an eighth so that patches share them."""
    steps = [max(1, 2 ** (n.bit_length() - 4)) for n in (ny, nx)]
    return quick_shape((-(-ny // steps[0]) * steps[0], -(-nx // steps[1]) * steps[1]))


@dataclass(frozen=True, eq=False)
class _Parts:
    """All patches in groups, and what is between them, in one precision."""

    groups: list["_Group"]
    between: np.ndarray | None  # from each node to each other one, group after group

    def roughly(self) -> "_Parts":
        """Return the same in single precision."""
        between = None if self.between is None else self.between.astype(np.float32, copy=False)
        return _Parts([group.roughly() for group in self.groups], between)

    def sinking_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the sinking at all places under the pressures there."""
        sinking_m = np.empty_like(pressure_Pa)
        for group in self.groups:
            group.convolved(pressure_Pa, sinking_m)
        if self.between is not None:
            moments = np.concatenate([group.moments(pressure_Pa) for group in self.groups])
            far, first = self.between @ moments.astype(self.between.dtype, copy=False), 0
            for group in self.groups:
                last = first + len(group.nodes)
                group.interpolated(far[first:last], sinking_m)
                first = last
        return sinking_m


@dataclass(frozen=True, eq=False)
class _Group:
    """Patches that fit into arrays of one shape, done together.

    Values of all groups are one row, of which those of this one are a slice.
    """

    places: slice
    shape: tuple[int, int, int]  # (m, ny, nx) of m patches
    padded: tuple[int, int]
    spectrum: np.ndarray  # over waves of a transform, or of `real_waves` where these are quicker
    by_products: bool
    y: np.ndarray  # (m, ny, k), the values of the polynomials of nodes at the rows of each patch
    x: np.ndarray  # (m, nx, l)
    nodes: np.ndarray  # those that a patch has among (m, k, l), as indices

    @classmethod
    def of(
        cls,
        first: int,
        kernel: np.ndarray,
        sides: np.ndarray,
        counts: np.ndarray,
    ) -> "_Group":
        """Return patches of these sides, with as many nodes along them, both of shape (m, 2).

        The kernel is `love_kernel` of an array that holds any of them.
        """
        shape = kernel.shape[0], kernel.shape[1]
        m, most = len(sides), counts.max(axis=0)
        y, x = (np.zeros((m, n, k)) for n, k in zip(shape, most, strict=True))
        for one_y, one_x, (ny, nx), (ky, kx) in zip(y, x, sides, counts, strict=True):
            one_y[:ny, :ky], one_x[:nx, :kx] = _nodes(ny, ky)[1], _nodes(nx, kx)[1]
        own = np.arange(most[0])[:, None] < counts[:, 0, None, None]
        nodes = np.flatnonzero(own & (np.arange(most[1]) < counts[:, 1, None, None]))
        places = slice(first, first + m * math.prod(shape))
        by_products = max(shape) <= MOST_BY_PRODUCTS
        padded = (2 * shape[0] - 1, 2 * shape[1] - 1) if by_products else padded_shape(shape)
        spectrum = even_spectrum(kernel, padded)
        if by_products:
            spectrum = of_real_waves(spectrum, padded)
        return cls(places, (m, *shape), padded, spectrum, by_products, y, x, nodes)

    def roughly(self) -> "_Group":
        """Return the same in single precision."""
        spectrum, y, x = (one.astype(np.float32) for one in (self.spectrum, self.y, self.x))
        return replace(self, spectrum=spectrum, y=y, x=x)

    def convolved(self, values: np.ndarray, out: np.ndarray) -> None:
        """Write what the patches themselves make sink."""
        from scipy import fft

        padded = self.padded
        array, out = self._array(values), self._array(out)
        at_once = max(1, _AT_ONCE // math.prod(self.shape[1:]))
        for begin in range(0, len(array), at_once):
            some = slice(begin, begin + at_once)
            if self.by_products:
                waves = apart(array[some], padded)
                waves *= self.spectrum
                out[some] = together(waves, self.shape[1:])
                continue
            rows = fft.rfft(array[some], n=padded[1], axis=2)
            waves = fft.fft(rows, n=padded[0], axis=1)
            waves *= self.spectrum
            rows = fft.ifft(waves, axis=1, overwrite_x=True)[:, : self.shape[1]]
            out[some] = fft.irfft(rows, n=padded[1], axis=2)[:, :, : self.shape[2]]

    def moments(self, values: np.ndarray) -> np.ndarray:
        """Return the moments of values at the nodes."""
        found = self.y.swapaxes(1, 2) @ self._array(values) @ self.x
        return np.asarray(found.reshape(-1)[self.nodes])

    def interpolated(self, at_nodes: np.ndarray, out: np.ndarray) -> None:
        """Add what is known at the nodes."""
        values = np.zeros((self.shape[0], self.y.shape[2], self.x.shape[2]), at_nodes.dtype)
        values.reshape(-1)[self.nodes] = at_nodes
        array = self._array(out)
        array += self.y @ values @ self.x.swapaxes(1, 2)

    def _array(self, values: np.ndarray) -> np.ndarray:
        return values[self.places].reshape(self.shape)


@lru_cache(maxsize=256)
def _nodes(n: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Chebyshev nodes of n points, and the values of their polynomials at these.

    The nodes in points from the first, shape (count,), the values of shape (n, count).
    """
    if count == n:
        return np.arange(n, dtype=float), np.eye(n)
    at, angle = np.linspace(-1.0, 1.0, n), (np.arange(count) + 0.5) * np.pi / count
    nodes, weight = np.cos(angle), np.sin(angle) * (-1.0) ** np.arange(count)
    off = at[:, None] - nodes
    exact = np.abs(off) < 1e-14
    terms = weight / np.where(exact, 1.0, off)
    on_node = np.asarray(exact.any(axis=1))[:, None]
    values = np.where(on_node, exact, terms / terms.sum(axis=1)[:, None])
    return (nodes + 1.0) * 0.5 * (n - 1), values


def _between(
    boxes: np.ndarray,
    counts: np.ndarray,
    pixel_size_m: tuple[float, float],
    E_star_Pa: float,
    dtype: type[np.floating],
) -> np.ndarray:
    """Return the sinking at each node under unit pressure in a pixel around each other one."""
    grids = []
    for (y0, x0, y1, x1), (ky, kx) in zip(boxes.tolist(), counts.tolist(), strict=True):
        along = y0 + _nodes(y1 - y0, ky)[0], x0 + _nodes(x1 - x0, kx)[0]
        grids.append(np.reshape(np.meshgrid(*along, indexing="ij"), (2, -1)))
    y, x = np.concatenate(grids, axis=1)
    kernel, first = np.zeros((len(y), len(y)), dtype), 0
    for grid in grids:
        last = first + grid.shape[1]
        rows, columns = slice(first, last), slice(last, None)
        offsets = np.abs(y[rows, None] - y[columns]), np.abs(x[rows, None] - x[columns])
        kernel[rows, columns] = love_kernel_at(offsets, pixel_size_m, E_star_Pa)
        kernel[columns, rows] = kernel[rows, columns].T
        first = last
    return kernel
