"""A height map pressed against a rigid plane: pressures and gaps, with their certificate."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from capslip.contact.solvers.half_space import HalfSpace
from capslip.errors import ContactError, SettingsError, UnusableSurfaceError
from capslip.surface.heightmap import HeightMap

MAX_POINTS = 16_000_000  # of a map
BYTES_PER_POINT = 200  # of memory that a solution takes at its peak
_COARSEST = 48  # points along the shorter side at which nesting ends
_COARSE_TOLERANCE = 1e-3  # of the solutions that only start the next finer one
_MAX_ITERATIONS = 300


@dataclass(frozen=True)
class Certificate:
    """How well a solution fulfils the conditions of contact, from its pressures alone.

    Lengths are relative to the approach, pressures to the mean pressure in the contact.
    """

    load_balance: float  # |sum of p dA - N| / N; zero for a given approach
    least_gap: float  # over all points without pressure: below zero is penetration
    least_pressure: float  # below zero is tension
    complementarity: float  # sum of p |gap| / sum of p
    iterations: int  # on the finest grid


@dataclass(frozen=True, eq=False)
class Pressed:
    """A face under load, as `press` found it; arrays of shape (ny, nx)."""

    load_N: float
    approach_m: float
    pressure_Pa: np.ndarray  # zero where there is no contact
    gap_m: np.ndarray  # up to rounding and tolerance zero in contact; 0 at non-measured points
    pixel_size_m: tuple[float, float]
    certificate: Certificate

    @property
    def contact_area_m2(self) -> float:
        """Area of the pixels in contact."""
        dy_m, dx_m = self.pixel_size_m
        return float(np.count_nonzero(self.pressure_Pa) * dy_m * dx_m)

    @property
    def max_pressure_Pa(self) -> float:
        """Greatest pressure of any pixel."""
        return float(self.pressure_Pa.max())

    @cached_property
    def region(self) -> np.ndarray:
        """Number of the contact region of each pixel (8-connected), 0 without contact."""
        from scipy.ndimage import label

        return np.asarray(label(self.pressure_Pa > 0, structure=np.ones((3, 3)))[0])

    @property
    def region_loads_N(self) -> np.ndarray:
        """Load of each contact region, shape (n,)."""
        return self.sum_over_regions(self.pressure_Pa)

    @cached_property
    def region_pixels(self) -> np.ndarray:
        """Pixels of each contact region, shape (n,)."""
        return np.bincount(self.region.ravel())[1:]

    @property
    def pixels_across(self) -> float:
        """Pixels across the median unit of load: the diameter of the circle of its region's area.

        Half of the load rests on regions that are smaller than this.
        """
        order = np.argsort(self.region_pixels)
        share = np.cumsum(self.region_loads_N[order])
        middle = min(int(np.searchsorted(share, 0.5 * share[-1])), len(order) - 1)
        return float(np.sqrt(4 / np.pi * self.region_pixels[order[middle]]))

    def sum_over_regions(self, density: np.ndarray) -> np.ndarray:
        """Integrate an array (ny, nx) over each contact region, shape (n,)."""
        dy_m, dx_m = self.pixel_size_m
        return np.bincount(self.region.ravel(), weights=density.ravel())[1:] * (dy_m * dx_m)


@dataclass(frozen=True, eq=False)
class ElasticFace:
    """A height map on a half-space, ready to be pressed, made by `elastic_face`."""

    name: str
    depth_m: np.ndarray  # below the highest measured point; 0 at non-measured points
    measured: np.ndarray
    pixel_size_m: tuple[float, float]
    E_star_Pa: float
    half_space: HalfSpace

    @cached_property
    def coarser(self) -> "ElasticFace | None":
        """The same face on a grid of pixels twice as large, None where that is too coarse."""
        if min(self.shape) < 2 * _COARSEST:
            return None
        depth_m, measured = _block_means(self.depth_m, self.measured, 2)
        dy_m, dx_m = self.pixel_size_m
        size_m = (2 * dy_m, 2 * dx_m)
        half_space = HalfSpace(depth_m.shape, size_m, self.E_star_Pa)
        return ElasticFace(self.name, depth_m, measured, size_m, self.E_star_Pa, half_space)

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx)."""
        return self.depth_m.shape[0], self.depth_m.shape[1]

    @property
    def pixel_area_m2(self) -> float:
        """Area of one pixel."""
        return self.pixel_size_m[0] * self.pixel_size_m[1]


def elastic_face(surface: HeightMap, E_star_Pa: float) -> ElasticFace:
    """Prepare a height map for contact.

    Parameters
    ----------
    surface : HeightMap
        Non-measured points never touch.
    E_star_Pa : float
        Composite modulus.

    Raises
    ------
    SettingsError
        If the modulus is not positive and finite.
    UnusableSurfaceError
        If nothing was measured.
    ContactError
        If the map has more than `MAX_POINTS` points, which need `BYTES_PER_POINT` bytes each.
    """
    if not 0 < E_star_Pa < np.inf:
        raise SettingsError(f"E_star_Pa: got {E_star_Pa:g}; expected a finite number > 0")
    name, n_points = surface.origin.name, surface.height_m.size
    if n_points > MAX_POINTS:
        factor = int(np.ceil(np.sqrt(n_points / MAX_POINTS)))
        raise ContactError(
            f"{name}: boundary elements on {n_points} points need "
            f"{n_points * BYTES_PER_POINT / 1e9:.1f} GB; expected at most {MAX_POINTS} points; "
            f"coarsen the map {factor} times"
        )
    measured = surface.measured
    if not measured.any():
        raise UnusableSurfaceError(f"{name}: all points are non-measured; expected heights")
    depth_m = np.where(measured, np.nanmax(surface.height_m) - surface.height_m, 0.0)
    half_space = HalfSpace(surface.shape, surface.pixel_size_m, E_star_Pa)
    return ElasticFace(name, depth_m, measured, surface.pixel_size_m, E_star_Pa, half_space)


def press(
    face: ElasticFace,
    *,
    load_N: float | None = None,
    approach_m: float | None = None,
    tolerance: float = 1e-7,
    start_Pa: np.ndarray | None = None,
) -> Pressed:
    """Press a face against a rigid plane, to a given load or a given approach.

    Conjugate gradients on the pixels in contact (Polonsky and Keer, Wear 231 (1999) 206), with the
    inverse of the half-space's spectrum as the preconditioner and, without a start, solutions on
    coarser grids first.

    Parameters
    ----------
    face : ElasticFace
        From `elastic_face`.
    load_N, approach_m : float
        One of the two. The approach counts from first touch, at the highest measured point.
    tolerance : float
        Largest complementarity and penetration, see `Certificate`.
    start_Pa : ndarray, shape (ny, nx), optional
        Pressures near the solution, as those at a neighbouring load.

    Raises
    ------
    SettingsError
        If not exactly one of load and approach is given, or a number is not positive and finite.
    ContactError
        If no solution is found that fulfils the conditions of contact.

    Examples
    --------
    >>> y, x = np.mgrid[-32:32, -32:32] * 1e-4
    >>> sphere = HeightMap(-(x**2 + y**2) / (2 * 20.0), (1e-4, 1e-4))
    >>> pressed = press(elastic_face(sphere, 110e9), load_N=10.0)
    >>> print(f"{pressed.approach_m:.2e} m, {pressed.certificate.least_pressure:g}")
    6.15e-08 m, 0
    """
    if (load_N is None) == (approach_m is None):
        raise SettingsError("press: expected either load_N or approach_m")
    for name, value in (("load_N", load_N), ("approach_m", approach_m)):
        if value is not None and not 0 < value < np.inf:
            raise SettingsError(f"{name}: got {value:g}; expected a finite number > 0")
    if not 1e-12 <= tolerance <= 0.1:
        raise SettingsError(f"tolerance: got {tolerance:g}; expected 1e-12 to 0.1")
    total_Pa = None if load_N is None else load_N / face.pixel_area_m2
    if start_Pa is not None:
        start_Pa = np.where(face.measured, np.maximum(start_Pa, 0.0), 0.0)
    if start_Pa is None or not start_Pa.any():
        start_Pa = _nested_start(face, total_Pa, approach_m)
    state, iterations = _iterate(face, start_Pa, total_Pa, approach_m, tolerance)
    if not state.fulfils(tolerance):
        raise ContactError(
            f"{face.name}: boundary elements did not converge in {iterations} iterations: "
            f"complementarity {state.complementarity:.2g}, least gap {state.least_gap:.2g} of the "
            f"approach; expected {tolerance:g}; filter or coarsen the map, or allow more"
        )
    return _certified(face, state, load_N, iterations)


def stiffness_of_regions_N_per_m(face: ElasticFace, pressed: Pressed) -> np.ndarray:
    """Return dN_i/dd of each contact region, shape (n,); their sum is the stiffness dN/dd.

    As long as no pixel enters or leaves, more load is that of a flat punch on the same pixels.
    """
    region = pressed.region
    punch = replace(face, depth_m=np.zeros(face.shape), measured=region > 0)
    pressed_punch = press(punch, approach_m=1.0, start_Pa=pressed.pressure_Pa, tolerance=1e-6)
    return pressed.sum_over_regions(pressed_punch.pressure_Pa)


@dataclass(frozen=True, eq=False)
class _State:
    """Pressures, gaps and approach, and how far they are from contact."""

    pressure_Pa: np.ndarray
    gap_m: np.ndarray
    approach_m: float
    contact: np.ndarray  # flat indices of the pixels under pressure
    least_gap: float
    complementarity: float

    def fulfils(self, tolerance: float) -> bool:
        return self.complementarity <= tolerance and self.least_gap >= -tolerance


def _nested_start(
    face: ElasticFace, total_Pa: float | None, approach_m: float | None
) -> np.ndarray:
    """Return the solution on the next coarser grid, or something to begin with."""
    coarser = face.coarser
    if coarser is None:
        return face.measured.astype(float) if total_Pa else np.zeros(face.shape)
    total = None if total_Pa is None else total_Pa * face.pixel_area_m2 / coarser.pixel_area_m2
    start_Pa = _nested_start(coarser, total, approach_m)
    coarse, _ = _iterate(coarser, start_Pa, total, approach_m, _COARSE_TOLERANCE)
    finer_Pa = _finer(coarse.pressure_Pa)[: face.shape[0], : face.shape[1]]
    return np.where(face.measured, finer_Pa, 0.0)


def _iterate(
    face: ElasticFace,
    start_Pa: np.ndarray,
    total_Pa: float | None,
    approach_m: float | None,
    tolerance: float,
) -> tuple[_State, int]:
    """Run the iteration; return its last state and the number of steps.

    With a given load the pressures keep their sum, so residual and direction have no mean. With a
    given approach nothing is subtracted. A state that fulfils the tolerance is returned only with a
    sinking that was computed from its pressures, not updated along the way.
    """
    half_space = face.half_space
    shift = np.mean if total_Pa is not None else np.zeros_like
    p = start_Pa.copy()
    if total_Pa is not None:
        p *= total_Pa / p.sum()
    u, fresh = half_space.sinking_m(p), True
    residual, direction = np.zeros(face.shape), np.zeros(face.shape)
    slope = 0.0  # r z of the last step; zero begins anew
    for iteration in range(_MAX_ITERATIONS):
        state = _state(face, p, u, approach_m)
        if state.fulfils(tolerance):
            if fresh:
                return state, iteration
            u, fresh = half_space.sinking_m(p), True
            continue
        if state.contact.size == 0 and state.least_gap >= 0:
            return state, iteration  # too coarse a grid, on which nothing touches
        # Pixels that penetrate join those under pressure; the step itself gives them theirs.
        c = np.flatnonzero(
            (p > 0) | (face.measured & (state.gap_m < -tolerance * state.approach_m))
        )
        old_r, old_t = residual.flat[c], direction.flat[c]
        r = state.gap_m.flat[c]
        r = r - shift(r)
        residual.fill(0.0)
        residual.flat[c] = r
        z = half_space.pressure_Pa(residual).flat[c]
        z = z - shift(z)
        new_slope = float(r @ z)
        t = z
        if slope > 0:
            t = z + max(0.0, (new_slope - float(old_r @ z)) / slope) * old_t
            t = t - shift(t)
        direction.fill(0.0)
        direction.flat[c] = t
        slope = new_slope
        du = half_space.sinking_m(direction)
        work = float(t @ du.flat[c])
        step = float(r @ t) / work if work > 0 else 0.0
        p_c = p.flat[c] - step * t
        fresh = bool((p_c < 0).any())
        p.flat[c] = np.maximum(p_c, 0.0)
        if fresh:
            if total_Pa is not None:
                p *= total_Pa / p.sum()
            u = half_space.sinking_m(p)
        else:
            u -= step * du
    return _state(face, p, half_space.sinking_m(p), approach_m), _MAX_ITERATIONS


def _state(face: ElasticFace, p: np.ndarray, u: np.ndarray, approach_m: float | None) -> _State:
    """Return gaps and certificate of pressures and their sinking.

    Under a given load the approach is the mean of sinking + depth, weighted with the pressure.
    """
    contact = np.flatnonzero(p)
    p_c = p.flat[contact]
    gap_m = u + face.depth_m
    d = approach_m if approach_m is not None else float(p_c @ gap_m.flat[contact] / p_c.sum())
    gap_m -= d
    least_gap = float(np.min(gap_m, where=face.measured & (p == 0), initial=np.inf)) / d
    off = float(p_c @ np.abs(gap_m.flat[contact]) / p_c.sum()) / d if contact.size else np.inf
    return _State(p, gap_m, d, contact, least_gap, off)


def _certified(face: ElasticFace, state: _State, load_N: float | None, iterations: int) -> Pressed:
    """Return the solution with its certificate, all of it computed from the pressures returned."""
    p = state.pressure_Pa
    N = float(p.sum()) * face.pixel_area_m2
    certificate = Certificate(
        load_balance=0.0 if load_N is None else abs(N / load_N - 1),
        least_gap=state.least_gap,
        least_pressure=float(p.min() / p.flat[state.contact].mean()),
        complementarity=state.complementarity,
        iterations=iterations,
    )
    if certificate.load_balance > 1e-9 or certificate.least_pressure < 0:
        raise ContactError(f"{face.name}: a solution does not balance its load: {certificate}")
    gap_m = np.where(face.measured, state.gap_m, 0.0)
    approach_m = state.approach_m
    return Pressed(load_N or N, approach_m, p, gap_m, face.pixel_size_m, certificate)


def _block_means(
    values: np.ndarray, known: np.ndarray, factor: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return means over the known points of blocks (0 where there is none), and which have one."""
    pad = [(0, -n % factor) for n in values.shape]

    def sums(array: np.ndarray) -> np.ndarray:
        array = np.pad(array, pad)
        ny, nx = (n // factor for n in array.shape)
        return np.asarray(array.reshape(ny, factor, nx, factor).sum(axis=(1, 3)))

    count = sums(known.astype(float))
    return sums(np.where(known, values, 0.0)) / np.maximum(count, 1), count > 0


def _finer(values: np.ndarray) -> np.ndarray:
    """Interpolate linearly to pixels half as large, shape (2 ny, 2 nx)."""
    for _ in range(2):
        edged = np.pad(values, ((1, 1), (0, 0)), mode="edge")
        near = 0.75 * values
        pairs = np.stack((near + 0.25 * edged[:-2], near + 0.25 * edged[2:]), axis=1)
        values = pairs.reshape(-1, values.shape[1]).T
    return values
