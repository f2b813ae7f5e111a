"""Roughly the pressures under which points sink as asked: what preconditions an iteration."""

import math
from copy import copy

import numpy as np

from capslip.contact.solvers.waves import MOST_BY_PRODUCTS, apart, of_real_waves, together

_CALL = 1500  # points that are transformed in the time that it takes to ask for another transform
_DENSE = 2 / 3  # of a block, from which on contact has no gaps


class RoughInverse:
    """What points in contact bear, where the others bear nothing.

    Where contact has no gaps, pressure is E* q / 2 times the sinking at wave number q. Of contact
    that is scattered this is no inverse: zeros beside a point look like waves of one pixel, as
    which it is stiff. There a field on the points is taken apart into its means over blocks of two
    by two pixels and what is left. A mean over the share rho of each block sinks by what a point
    makes of itself and what waves of pressure rho make, (1 - rho) S_0 + rho 2 / (E* q); what is
    left by the difference of two neighbours. Blocks count by the root of their points, which leaves
    the inverse symmetric, and rho is what the points see on average.

    Parameters
    ----------
    maps : list of (slice, int, int)
        Points, rows and columns of maps that are taken as periodic, each by itself.
    quadrant : ndarray, shape (ny, nx)
        The kernel, from `love_kernel`.
    pixel_size_m, E_star_Pa
        As for `HalfSpace`.
    """

    def __init__(
        self,
        maps: list[tuple[slice, int, int]],
        quadrant: np.ndarray,
        pixel_size_m: tuple[float, float],
        E_star_Pa: float,
    ) -> None:
        self._blocks = _Blocks(2, maps, pixel_size_m, E_star_Pa)
        self._points = _Blocks(1, maps, pixel_size_m, E_star_Pa)
        near = [quadrant[at] for at in ((1, 0), (0, 1)) if np.all(np.less(at, quadrant.shape))]
        self._alone_m_per_Pa = float(quadrant[0, 0])
        self._left_m_per_Pa = self._alone_m_per_Pa - (float(np.mean(near)) if near else 0.0)

    def part(self, points: np.ndarray) -> "RoughInverse":
        """Return that of some of the points, in the maps of all."""
        one = copy(self)
        one._blocks, one._points = self._blocks.part(points), self._points.part(points)
        return one

    def pressure_Pa(self, sinking_m: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the pressures at points under which they sink so, both shape (m,)."""
        block = self._blocks.of_point[points]
        number = np.bincount(block, minlength=self._blocks.count)
        rho = float(np.square(number).sum()) / (4 * len(points))
        if rho > _DENSE:
            values = np.zeros(self._points.count, dtype=np.float32)
            place = self._points.of_point[points]
            values[place] = sinking_m
            self._points.solve(values, 0.0, 1.0)
            return values[place].astype(float)
        root = np.sqrt(np.maximum(number, 1))
        mean_m = np.bincount(block, sinking_m, self._blocks.count) / root
        values = mean_m.astype(np.float32)
        self._blocks.solve(values, (1.0 - rho) * self._alone_m_per_Pa, rho)
        left_m = sinking_m - (mean_m / root)[block]
        return np.asarray(left_m / self._left_m_per_Pa + (values / root)[block])


class _Blocks:
    """Maps in blocks of so many pixels along a side, those of one shape as one array."""

    def __init__(
        self,
        side: int,
        maps: list[tuple[slice, int, int]],
        pixel_size_m: tuple[float, float],
        E_star_Pa: float,
    ) -> None:
        self.of_point = np.empty(sum(ny * nx for _, ny, nx in maps), dtype=np.intp)
        self.count, self._stacks = 0, []
        size_m = (side * pixel_size_m[0], side * pixel_size_m[1])
        shapes = [quick_shape((-(-ny // side), -(-nx // side))) for _, ny, nx in maps]
        for shape, members in by_shape(shapes).items():
            first = self.count
            for points, ny, nx in (maps[k] for k in members):
                row, column = np.arange(ny)[:, None] // side, np.arange(nx) // side
                self.of_point[points] = (self.count + row * shape[1] + column).reshape(-1)
                self.count += shape[0] * shape[1]
            spectrum = (2 / E_star_Pa / wave_numbers_per_m(shape, size_m)).astype(np.float32)
            if max(shape) <= MOST_BY_PRODUCTS:
                spectrum = of_real_waves(spectrum, shape)
            self._stacks.append((slice(first, self.count), (len(members), *shape), spectrum))

    def part(self, points: np.ndarray) -> "_Blocks":
        """Return the blocks with some of the points."""
        one = copy(self)
        one.of_point = self.of_point[points]
        return one

    def solve(self, values: np.ndarray, alone_m_per_Pa: float, share: float) -> None:
        """Replace sinking, float32 of shape (count,), by the pressures that make it."""
        from scipy import fft

        for part, stack, spectrum in self._stacks:
            maps, by_products = values[part].reshape(stack), max(stack[1:]) <= MOST_BY_PRODUCTS
            waves = apart(maps, stack[1:]) if by_products else fft.rfft2(maps)
            waves /= np.float32(alone_m_per_Pa) + np.float32(share) * spectrum
            if by_products:
                maps = together(waves, stack[1:])
            else:
                maps = fft.irfft2(waves, s=stack[1:], overwrite_x=True)
            values[part] = maps.reshape(-1)


def by_shape(shapes: list[tuple[int, int]]) -> dict[tuple[int, int], list[int]]:
    """Return which maps share a shape; few small ones take the least that holds them.

    Examples
    --------
    >>> by_shape([(4, 4), (30, 30), (5, 6)])
    {(30, 30): [1], (5, 6): [2, 0]}
    """
    found: dict[tuple[int, int], list[int]] = {}
    for k, shape in enumerate(shapes):
        found.setdefault(shape, []).append(k)
    for shape in sorted(found, key=math.prod):
        ny, nx = shape
        wider = [one for one in found if one[0] >= ny and one[1] >= nx and one != shape]
        least = min(wider, key=math.prod, default=shape)
        more = len(found[shape]) * (math.prod(least) - ny * nx)
        if 0 < more < _CALL:
            found[least] += found.pop(shape)
    return found


def quick_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Return the next shape whose transform is quick: sides of large prime factors are not."""
    from scipy import fft

    qy, qx = (int(fft.next_fast_len(n, real=True)) for n in shape)
    return qy, qx


def wave_numbers_per_m(shape: tuple[int, int], pixel_size_m: tuple[float, float]) -> np.ndarray:
    """Return the wave numbers of a real transform, with half of the least in place of zero."""
    from scipy import fft

    (ny, nx), (dy_m, dx_m) = shape, pixel_size_m
    k_y, k_x = fft.fftfreq(ny, dy_m)[:, None], fft.rfftfreq(nx, dx_m)
    waves = 2 * np.pi * np.hypot(k_y, k_x)
    waves[0, 0] = np.pi / max(ny * dy_m, nx * dx_m)
    return np.asarray(waves)
