"""The points of all hills as flat arrays, sorted by hill: gathered once, fitted many times."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from capslip.caps.hills import Hills
from capslip.surface.heightmap import HeightMap
from capslip.surface.rows import BLOCK_POINTS, row_blocks

LIMIT_EDGE, LIMIT_PATCH, LIMIT_HILL = 1, 2, 4
FILLED_NEIGHBOURS = 3  # measured neighbours that a single lost point needs to be filled


@dataclass(frozen=True, eq=False)
class HillPoints:
    """Points of the hills, shape (k,), sorted by hill.

    Single lost points inside a hill stand in with the mean height of their neighbours, so that
    areas stay whole, and on the quadric of the hill for its volume; `measured` tells them apart.
    """

    hill: np.ndarray  # 0 ... n_hills - 1; as few bytes as do, like the two below
    row: np.ndarray
    col: np.ndarray
    z_m: np.ndarray
    measured: np.ndarray  # bool
    limit: np.ndarray  # uint8: on the face's edge (1), beside a patch not measured (2), a hill (4)
    count: np.ndarray  # (n_hills,)
    pixel_size_m: tuple[float, float]

    @property
    def pixel_area_m2(self) -> float:
        """Area of one pixel."""
        return self.pixel_size_m[0] * self.pixel_size_m[1]

    def places_m(self, some: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return the places x, y of some points."""
        x_m, y_m = self.col[some] + 0.5, self.row[some] + 0.5
        x_m *= self.pixel_size_m[1]
        y_m *= self.pixel_size_m[0]
        return x_m, y_m

    @property
    def n_hills(self) -> int:
        """Number of hills."""
        return len(self.count)

    def count_of(self, chosen: np.ndarray) -> np.ndarray:
        """Return how many of some points, by rising index, are on each hill, shape (n_hills,)."""
        at = chosen.searchsorted(self._bounds)
        counts: np.ndarray = at[1:] - at[:-1]
        return counts

    @cached_property
    def _bounds(self) -> np.ndarray:
        return np.append(0, np.cumsum(self.count))

    def groups(self) -> Iterator[tuple[slice, slice]]:
        """Yield hills and their points, some at a time: what is computed of them stays small."""
        ends = self._bounds[1:]
        first = start = 0
        while first < self.n_hills:
            last = max(first + 1, int(np.searchsorted(ends, start + BLOCK_POINTS, "right")))
            end = int(ends[last - 1])
            yield slice(first, last), slice(start, end)
            first, start = last, end


def sums_by_hill(values: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the sums of values that are sorted by hill, `count` of them on each."""
    sums, some = np.zeros(len(count)), count > 0
    if values.size:
        sums[some] = np.add.reduceat(values, (np.cumsum(count) - count)[some])
    return sums


def points_of_hills(surface: HeightMap, hills: Hills) -> HillPoints:
    """Gather the points of all hills.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    hills : Hills
        Labelled hills of the same map.
    """
    ny, nx = surface.shape
    label, few_bytes = hills.label.reshape(-1), surface.lost.dtype
    found = [
        (np.flatnonzero(hills.label[rows] > 0) + rows.start * nx).astype(few_bytes)
        for rows in row_blocks(surface.shape)
    ]
    index = np.concatenate(found)
    lost = surface.lost_inside if index.size else index
    filled, filled_hill, filled_z_m, beside = _lost_points(surface, hills.label, lost)
    n, n_own = hills.n_hills, index.size
    hill = label[index]
    if filled.size:
        index = np.concatenate((index, filled.astype(few_bytes)))
        hill = np.concatenate((hill, filled_hill))
    # 16-bit keys are sorted by radix, ten times faster
    hill = hill.astype(np.uint16 if n < 2**16 else np.int32)
    hill -= hill.dtype.type(1)
    count, order = np.bincount(hill, minlength=n), np.argsort(hill, kind="stable")
    measured = order < n_own
    stands_in = filled_z_m[order[~measured] - n_own]
    index, hill = index[order], hill[order]
    del order
    z_m = surface.at(index)
    z_m[~measured] = stands_in
    of_lines = np.uint16 if max(ny, nx) < 2**16 else np.int32
    row = index // nx
    col = (index - nx * row).astype(of_lines)  # several times as fast as divmod
    row = row.astype(of_lines)
    limit = np.zeros(index.size, dtype=np.uint8)
    limit[(row == 0) | (row == ny - 1) | (col == 0) | (col == nx - 1)] = LIMIT_EDGE
    if surface.ends_within:
        limit[_beside_outside(surface.outside)[index]] = LIMIT_EDGE
    if beside.size:
        mask = np.zeros(label.size, dtype=bool)
        mask[beside] = True
        limit[mask[index]] |= LIMIT_PATCH
    limit[_beside_hills(label, index, hill + np.int32(1), col, nx)] |= LIMIT_HILL
    return HillPoints(
        hill=hill,
        row=row,
        col=col,
        z_m=z_m,
        measured=measured,
        limit=limit,
        count=count,
        pixel_size_m=surface.pixel_size_m,
    )


def _beside_outside(outside: np.ndarray) -> np.ndarray:
    """Tell which points, counted row by row, have a neighbour in row or column that is outside."""
    beside = np.zeros(outside.shape, dtype=bool)
    beside[1:] |= outside[:-1]
    beside[:-1] |= outside[1:]
    beside[:, 1:] |= outside[:, :-1]
    beside[:, :-1] |= outside[:, 1:]
    return beside.reshape(-1)


def _beside_hills(
    label: np.ndarray, index: np.ndarray, own: np.ndarray, col: np.ndarray, nx: int
) -> np.ndarray:
    """Tell which points have a neighbour in their row or column that belongs to another hill.

    A point that stands in for a lost one has no label of its own, but a hill.
    """
    beside, above = np.zeros(index.size, dtype=bool), index < label.size - nx
    for step, inside in ((-nx, index >= nx), (nx, above), (-1, col > 0), (1, col < nx - 1)):
        other = label.take(index + step, mode="clip")
        beside |= (other > 0) & (other != own) & inside
    return beside


def _lost_points(
    surface: HeightMap, label: np.ndarray, lost_at: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return index, label and height of the points to fill, and the index of points beside a patch.

    A patch is made of non-measured squares of 3 x 3 points; it cuts a hill. All else does no harm
    and is filled where most of its measured neighbours belong to hills.
    """
    none = np.empty(0, dtype=np.intp)
    if not lost_at.size:
        return none, none, np.empty(0), none
    (ny, nx), label_of = surface.shape, label.reshape(-1)
    width = nx + 2
    lost = np.zeros((ny + 2) * width, dtype=bool)
    index = lost_at + 2 * (lost_at // nx) + width + 1  # in the map with a frame
    lost[index] = True
    around = [down * width + right for down in (-1, 0, 1) for right in (-1, 0, 1)]
    core, beside = index, none
    for step in around:
        core = core[lost[core + step]]
    if core.size:
        patch, rim = np.zeros((2, lost.size), dtype=bool)
        for step in around:
            patch[core + step] = True
        lost[patch] = False
        patch[core] = False  # the rest has all that is beside the patch around it
        outline = np.flatnonzero(patch)
        for step in around:
            rim[outline + step] = True
        beside = np.flatnonzero(rim.reshape(ny + 2, width)[1:-1, 1:-1])
        beside = beside[label_of[beside] > 0]
        index = index[lost[index]]

    row, col = index // width - 1, index % width - 1
    index = row * nx + col
    greatest = np.zeros(index.size, dtype=label.dtype)
    known, on_hill = np.zeros((2, index.size), dtype=np.int8)
    sum_m = np.zeros(index.size)
    for down, right in ((a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b):
        inside = (row + down >= 0) & (row + down < ny) & (col + right >= 0) & (col + right < nx)
        at = np.where(inside, index + down * nx + right, index)  # the lost point itself outside
        z_m, here = surface.at(at), label_of[at]
        seen = ~np.isnan(z_m)
        known += seen
        on_hill += here > 0
        sum_m += np.where(seen, z_m, 0.0)
        np.maximum(greatest, here, out=greatest)
    fill = (known >= FILLED_NEIGHBOURS) & (2 * on_hill > known)
    return index[fill], greatest[fill], sum_m[fill] / known[fill], beside
