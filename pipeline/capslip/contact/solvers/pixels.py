"""The pixels of a pressed face that touch, alone: below a load the contact only shrinks.

A face that is pressed anew at lower and lower loads needs no other points. Where these are some
hundreds, or a few thousand all over the map, a matrix between them is far less work than the
transforms of patches around them or of the map.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.half_space import POINT_COST, HalfSpace, love_kernel
from capslip.contact.solvers.patched_half_space import PatchedHalfSpace
from capslip.contact.solvers.patches import (
    PatchedFace,
    Spline,
    boxes_around,
    half_space_around,
    patched,
    with_margin,
)
from capslip.contact.solvers.pressed import Pressed

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_MOST_PIXELS = 6000  # 450 MB
_FEW = 3000  # pixels of a matrix between what is left of a contact: 110 MB
_LESS = 4  # times the work of a matrix, of what it takes the place of: to build it takes time, too
_WORTH = 0.7  # of the work, that patches around what is left may be
SINGLE = 1e-6  # tolerance from which kernels in single precision do
_SUMMED = 256  # of its columns are summed at once
_QUICK = 2_000_000  # work of a sinking on patches that take the time of some dozens to be made anew
_ROWS = 64  # of a matrix that are filled at once
_LARGE = 50_000  # points of a map from which its changes are found apart
_OfPoints: TypeAlias = "MatrixHalfSpace | GatheredHalfSpace | PatchedHalfSpace"
_TILE = 16  # pixels along the side of a tile, whose pixels are inverted with each other


def around_contact(
    face: ElasticFace,
    contact: np.ndarray,
    finest: int = 1,
    single: bool = False,
    spline: Spline = "third",
) -> PatchedFace | None:
    """Return the face of least work that holds a contact, None for the map itself.

    A refined one of a face with flats is that before the load that left them, with its hardness: a
    spline would round their edges.

    Parameters
    ----------
    face : ElasticFace
        The whole map.
    contact : bool, shape (ny, nx)
        Where it touches.
    finest : int
        Points along the longer side of a pixel, as many of them as patches have room for.
    single : bool
        Whether single precision does: see `MatrixHalfSpace` and `PatchedHalfSpace`.
    spline : "third", "fifth" or "other"
        What lies between the pixels of a refined one, see `patched`.
    """
    ways = boxes_around(contact, face.pixel_size_m) if finest > 1 else None
    for refinement in range(finest, 1, -1):
        patches = patched(face.before or face, contact, refinement, single, ways, spline)
        if patches is not None:
            return patches
    n_pixels = np.count_nonzero(contact)
    if n_pixels <= _MOST_PIXELS:
        n_points = np.count_nonzero(with_margin(contact))  # patches have no fewer
        if n_pixels**2 <= POINT_COST * n_points:
            return pixels_alone(face, contact, None, single)
    patches = patched(face, contact, single=single, ways=ways)
    return pixels_alone(face, contact, patches, single) or patches


def on_contact(
    face: ElasticFace, pressed: Pressed, around: PatchedFace | None
) -> tuple[PatchedFace, Pressed]:
    """Return the points of a map that touch, alone, and their state; from `around_contact`."""
    alone = alone_on(face, pressed.pressure_Pa, around)
    pressure_Pa, gap_m = (alone.gathered(one) for one in (pressed.pressure_Pa, pressed.gap_m))
    return alone, replace(pressed, pressure_Pa=pressure_Pa, gap_m=gap_m)


def alone_on(face: ElasticFace, touches: np.ndarray, around: PatchedFace | None) -> PatchedFace:
    """Return the points of a map where an array is not zero, alone; from `around_contact`."""
    if around is None:
        return in_contact_alone(face, touches)
    return in_contact_alone(around, around.gathered(touches))


def pixels_alone(
    face: ElasticFace, contact: np.ndarray, patches: PatchedFace | None, single: bool = False
) -> PatchedFace | None:
    """Return a face of the pixels in contact with a matrix between them, None where that is slow.

    Parameters
    ----------
    face : ElasticFace
        The whole map.
    contact : bool, shape (ny, nx)
        Where it touches.
    patches : PatchedFace, optional
        Around the same contacts: what else would be solved on; the map where None.
    single : bool
        As for `around_contact`.
    """
    parent = np.flatnonzero(contact)
    else_on = face.half_space.cost if patches is None else patches.cost
    if len(parent) > _MOST_PIXELS or len(parent) ** 2 > else_on:
        return None
    return _alone(face, parent, _matrix_of(face, parent, face.shape, single))


def in_contact_alone(face: ElasticFace, pressure_Pa: np.ndarray) -> PatchedFace:
    """Return a face of the points under pressure alone, which sink as those of the whole one do.

    Parameters
    ----------
    face : ElasticFace
        A map, or patches of it.
    pressure_Pa : ndarray
        On it.
    """
    points = np.flatnonzero(pressure_Pa)
    if len(points) == face.depth_m.size and isinstance(face, PatchedFace):
        return face
    half_space = _around(face, points) if isinstance(face, PatchedFace) else None
    return points_alone(face, points) if half_space is None else _alone(face, points, half_space)


def points_alone(face: ElasticFace, points: np.ndarray) -> PatchedFace:
    """Return some points of a face, which sink by the transforms of all of it.

    Parameters
    ----------
    face : ElasticFace
        A map, or patches of it.
    points : int, shape (n,)
        Growing.
    """
    half_space: _OfPoints
    if isinstance(face.half_space, PatchedHalfSpace):
        half_space = face.half_space.part(points)
    else:
        half_space = GatheredHalfSpace(points, face.half_space, face.shape)
    return _alone(face, points, half_space)


def fewer(face: PatchedFace, contact: np.ndarray) -> PatchedFace | None:
    """Return a face of some of the points of another, None where it would be hardly less work.

    Parameters
    ----------
    face : PatchedFace
        From `pixels_alone`, `in_contact_alone` or this.
    contact : int, shape (n,)
        The points that are left, growing.
    """
    half_space: _OfPoints | None
    if isinstance(face.half_space, MatrixHalfSpace):
        half_space = face.half_space.part(contact)
    elif (
        face.refinement == 1
        and len(contact) <= _FEW
        and _LESS * len(contact) ** 2 <= face.half_space.cost
    ):
        half_space = _matrix_of(face, face.parent[contact], face.map_shape)
    elif isinstance(face.half_space, PatchedHalfSpace) and face.half_space.cost <= _QUICK:
        half_space = face.half_space.part(contact)
    else:
        half_space = _around(face, contact)
    return None if half_space is None else _alone(face, contact, half_space)


def some_points(face: ElasticFace, points: np.ndarray) -> tuple[PatchedFace, float] | None:
    """Return some points of a large map, to change the pressures on them; None for others.

    Also the share of the sinking of these changes that is left off.

    Parameters
    ----------
    face : ElasticFace
        Any.
    points : int, shape (n,)
        Indices into it, growing.
    """
    half_space = face.half_space
    if not isinstance(half_space, HalfSpace) or face.depth_m.size < _LARGE:
        return None
    changes = half_space.of_changes
    alone = _alone(face, points, GatheredHalfSpace(points, changes, face.shape))  # type: ignore[arg-type]
    return alone, changes.change_error


def _around(face: PatchedFace, points: np.ndarray) -> PatchedHalfSpace | None:
    """Return the half-space on patches around some points, None where it is hardly less work."""
    return half_space_around(face, points, _WORTH * face.half_space.cost)


def _matrix_of(
    face: ElasticFace, parent: np.ndarray, map_shape: tuple[int, ...], single: bool = False
) -> "MatrixHalfSpace":
    row, column = np.unravel_index(parent, map_shape)
    shape = int(np.ptp(row)) + 1, int(np.ptp(column)) + 1
    if isinstance(face.half_space, HalfSpace):
        quadrant = face.half_space.quadrant[: shape[0], : shape[1]]
    else:
        quadrant = love_kernel(shape, face.pixel_size_m, face.E_star_Pa)
    tile = row // _TILE * map_shape[1] + column // _TILE
    kernel = quadrant.astype(np.float32 if single else np.float64).reshape(-1)
    matrix = np.empty((len(parent), len(parent)), kernel.dtype)
    row, column = row.astype(np.int32), column.astype(np.int32)
    for begin in range(0, len(parent), _ROWS):  # whose offsets stay in the cache
        some = np.s_[begin : begin + _ROWS]
        offset = np.abs(row[some, None] - row) * np.int32(shape[1])
        offset += np.abs(column[some, None] - column)
        kernel.take(offset, out=matrix[some], mode="clip")
    return MatrixHalfSpace(matrix, tile)


def _alone(face: ElasticFace, points: np.ndarray, half_space: _OfPoints) -> PatchedFace:
    """Return some points of a face."""
    x_m, y_m = face.places_m
    row, column = np.divmod(points, x_m.size) if x_m.ndim > 1 else (points, points)
    x_m, y_m = x_m.reshape(-1)[column], y_m.reshape(-1)[row]
    patches = face if isinstance(face, PatchedFace) else None
    return PatchedFace(
        face.name,
        face.depth_m.reshape(-1)[points],
        face.measured.reshape(-1)[points],
        face.pixel_size_m,
        face.E_star_Pa,
        half_space,  # type: ignore[arg-type]
        points if patches is None else patches.parent[points],
        face.shape if patches is None else patches.map_shape,
        (1, 1) if patches is None else patches.per_pixel,
        (x_m, y_m),
        hardness_Pa=face.hardness_Pa,
    )


class GatheredHalfSpace:
    """Sinking of some points of a face under pressures on them, with the transforms of the face."""

    def __init__(
        self,
        points: np.ndarray,
        half_space: "HalfSpace | MatrixHalfSpace",
        shape: tuple[int, ...],
    ) -> None:
        self._half_space = half_space
        self._points = points
        self._everywhere = np.zeros(shape)  # zero but at the points

    @property
    def cost(self) -> int:
        """Work of one sinking, in products of two numbers."""
        return self._half_space.cost

    def sinking_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement into the half-space, shape (n,)."""
        return self._gathered(self._half_space.sinking_m(self._spread(pressure_Pa)))

    def sinking_roughly_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the same as the face does it roughly."""
        return self._gathered(self._half_space.sinking_roughly_m(self._spread(pressure_Pa)))

    def work(self, pressure_Pa: np.ndarray) -> tuple[float, np.ndarray | None]:
        """Return the sum of pressures times their own sinking, as the face does it."""
        work, sinking_m = self._half_space.work(self._spread(pressure_Pa))
        return work, None if sinking_m is None else self._gathered(sinking_m)

    def pressure_Pa(self, sinking_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return roughly the pressures at points alone that make a displacement, shape (n,)."""
        return self._half_space.pressure_Pa(sinking_m, self._points[points])

    def _spread(self, values: np.ndarray) -> np.ndarray:
        self._everywhere.reshape(-1)[self._points] = values
        return self._everywhere

    def _gathered(self, values: np.ndarray) -> np.ndarray:
        return np.asarray(values.reshape(-1)[self._points])


class MatrixHalfSpace:
    """Sinking of a half-space under pressures on single pixels, as `HalfSpace` on a map.

    A matrix in single precision alone takes a third of the memory, which costs most of the time to
    make one. It does for states to 1e-6 of the approach: summed in double precision, a few columns
    at a time, it leaves a tenth of that.

    Parameters
    ----------
    matrix_m_per_Pa : ndarray, shape (n, n)
        In single or double precision.
    tile : int, shape (n,)
        Of each pixel, the tile in which it lies.
    """

    def __init__(self, matrix_m_per_Pa: np.ndarray, tile: np.ndarray) -> None:
        self._matrix, self._tile = matrix_m_per_Pa, tile
        self._rough_matrix = self._matrix.astype(np.float32, copy=False)
        self._tiles = self._inverted(tile)

    @property
    def cost(self) -> int:
        """Work of one sinking, in products of two numbers."""
        return self._matrix.size

    def part(self, points: np.ndarray) -> "MatrixHalfSpace":
        """Return that of some of the pixels."""
        return MatrixHalfSpace(self._matrix[np.ix_(points, points)], self._tile[points])

    def sinking_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the displacement into the half-space, shape (n,)."""
        if self._matrix.dtype == np.float64:
            return np.asarray(self._matrix @ pressure_Pa)
        sinking_m, p = np.zeros(len(pressure_Pa)), pressure_Pa.astype(np.float32)
        for begin in range(0, len(p), _SUMMED):
            some = slice(begin, begin + _SUMMED)
            sinking_m += self._matrix[:, some] @ p[some]
        return sinking_m

    def sinking_roughly_m(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the same in single precision and half of the time: for small changes."""
        return np.asarray(self._rough_matrix @ pressure_Pa.astype(np.float32))

    def work(self, pressure_Pa: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the sum of pressures times their own sinking, and that as well, roughly."""
        sinking_m = self.sinking_roughly_m(pressure_Pa)
        return float(pressure_Pa @ sinking_m), sinking_m

    def pressure_Pa(self, sinking_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return roughly the pressures at points alone that make a displacement: tile by tile."""
        everywhere = np.zeros(len(self._tile))
        everywhere[points] = sinking_m
        return np.asarray((self._tiles @ everywhere)[points])

    def _inverted(self, tile: np.ndarray) -> "csr_array":
        """Return the inverse of the matrix between the pixels of each tile, shape (n, n)."""
        from scipy.sparse import block_diag, csr_array

        order = np.argsort(tile, kind="stable")
        members = np.split(order, np.flatnonzero(np.diff(tile[order])) + 1)
        blocks = block_diag([np.linalg.inv(self._matrix[np.ix_(at, at)]) for at in members], "coo")
        at = order[blocks.row], order[blocks.col]
        return csr_array((blocks.data, at), shape=self._matrix.shape)
