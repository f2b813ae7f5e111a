"""The form of a face (ISO 25178-2 F-operator): plane, polynomial, sphere or cylinder."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, Literal, get_args

import numpy as np

from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.surface.blocks import few_lines
from capslip.surface.heightmap import HeightMap
from capslip.surface.rows import row_blocks

FormKind = Literal["plane", "quadratic", "polynomial", "cylinder", "sphere", "none"]
DEGREE = {"plane": 1, "quadratic": 2}
MAX_DEGREE = 10
MAX_CONDITION = 1e10  # of the normal equations; a map measured everywhere has below 1e3
BIWEIGHT_OVER_MEDIAN = 4.4478  # ISO 16610-71: 3 standard deviations of a normal distribution
MAX_REWEIGHTS = 50
FLOOR_SHARE = 1.0 / 3.0  # of the points, the lowest, that a floor is fitted to
FLOOR_LINES = 100  # rows and columns, at least, that tell slopes and bow of the floor
ROUNDING = 1e-12  # of the height range: a smaller spread has no meaning
SETTLED = 1e-4  # relative change of the spread between two reweighted fits
MAX_STEPS = 50
FEW_POINTS = 16384  # of a block of which a sphere or cylinder needs ten arrays
DIFFERENCE = 1e-5  # step of the central differences, in half diagonals and radians

Fitted = tuple[HeightMap, float | None, float | None]  # what is left, radius and direction
Fit = Callable[[np.ndarray | None], Fitted]
Model = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, list[np.ndarray]]]


@dataclass(frozen=True)
class Form:
    """What was taken off a map.

    Attributes
    ----------
    kind : str
        As asked for.
    degree : int or None
        Total degree of the polynomial; None for sphere, cylinder and none.
    robust : bool
        Whether peaks and outliers were weighted down.
    floor : bool
        Whether the lowest third of the points alone was fitted.
    radius_m : float or None
        Of sphere or cylinder; positive where the face is convex. None where it came out plane.
    axis_rad : float or None
        Direction of the cylinder's axis, from x towards y, in [0, pi).
    """

    kind: FormKind
    degree: int | None = None
    robust: bool = False
    radius_m: float | None = None
    axis_rad: float | None = None
    floor: bool = False


def remove_form(
    surface: HeightMap,
    kind: FormKind = "plane",
    *,
    degree: int | None = None,
    robust: bool = False,
    floor: bool = False,
) -> tuple[HeightMap, Form]:
    """Subtract the form that fits the measured points best in height.

    Parameters
    ----------
    surface : HeightMap
        Non-measured points take no part and stay non-measured.
    kind : {"plane", "quadratic", "polynomial", "cylinder", "sphere", "none"}
        Polynomials are of total degree 1, 2 or `degree`. Cylinder and sphere are exact, of any
        radius, curvature and (the cylinder) direction.
    degree : int, optional
        1 to 10; needed for a polynomial, refused elsewhere.
    robust : bool
        False: least squares. True: least squares with Tukey's biweight, renewed until it settles
        (the weights of ISO 16610-71), so that points farther than 4.4478 median deviations from
        the form, such as peaks, pits and spikes, have no say.
    floor : bool
        True: least squares through the lowest third of the points above the form, renewed until
        they stay the same (least trimmed squares, one-sided). Hills that stand on a floor then have
        no say, even where their flanks cover half of it. `robust` makes no difference.

    Returns
    -------
    HeightMap, Form
        Heights above the form, and its parameters.

    Raises
    ------
    SettingsError
        If the kind is unknown, or the degree missing, out of bounds or given without need.
    UnusableSurfaceError
        If no point is measured, the measured points do not fix the form, or no sphere or cylinder
        passes near them.

    Examples
    --------
    >>> y, x = np.mgrid[0:40, 0:60] * 1e-4
    >>> ball = HeightMap(np.sqrt(0.5**2 - (x - 2e-3) ** 2 - (y - 1e-3) ** 2), (1e-4, 1e-4))
    >>> flat, form = remove_form(ball, "sphere")
    >>> round(form.radius_m, 6), float(np.ptp(flat.height_m)) < 1e-14
    (0.5, True)
    """
    _check(kind, degree)
    if kind == "none":
        return surface, Form("none")
    degree = DEGREE.get(kind, degree)
    measured = _measured(surface)
    fit = _fit_of(surface, measured, kind, degree)
    if floor:
        rest, radius_m, axis_rad = _through_lowest(fit, measured)
    elif robust:
        rest, radius_m, axis_rad = _reweighted(fit, surface, measured)
    else:
        rest, radius_m, axis_rad = fit(None)
    return rest, Form(kind, degree, robust and not floor, radius_m, axis_rad, floor)


def height_taken_off_m(before: HeightMap, after: HeightMap) -> float:
    """Return how high that is by which one map of the same points differs, beside a plane."""
    taken = replace(after, height_m=before.height_m - after.height_m)
    return float(np.ptp(remove_form(taken, "plane")[0].height_m[after.measured]))


def level_and_straight(
    surface: HeightMap, floor: bool = False, degree: int = 2
) -> tuple[HeightMap, HeightMap]:
    """Return a map less its plane, and less its quadratic: between them lies its bow.

    Parameters
    ----------
    surface : HeightMap
        In which something was measured.
    floor : bool
        Whether both are fitted to the lowest third, see `remove_form`.
    degree : int
        Of the polynomial in place of the quadratic.
    """
    level, straight = (
        remove_form(surface, "polynomial", degree=one, floor=floor)[0] for one in (1, degree)
    )
    return level, straight


def floor_slopes(surface: HeightMap) -> tuple[float, float]:
    """Return the slopes along y and x of the floor of a map, from some of its points.

    Of a map levelled by least squares: how far peaks that are not balanced over the face tilted
    that plane against the rest of the face.

    Parameters
    ----------
    surface : HeightMap
        A hundred rows and columns of it, at least, are taken.

    Raises
    ------
    UnusableSurfaceError
        If no plane is fixed by them.

    Examples
    --------
    >>> height_m = np.zeros((40, 60)) + 1e-6 * np.arange(60)
    >>> height_m[:, 50:] += 1e-3
    >>> slope_y, slope_x = floor_slopes(HeightMap(height_m, (1e-4, 1e-4)))
    >>> round(slope_x, 6)
    0.01
    """
    few = few_lines(surface, FLOOR_LINES)
    dy_m, dx_m = few.pixel_size_m
    level, _ = remove_form(few, "plane", floor=True)
    row, col = np.nonzero(few.measured)
    plane_m = (few.height_m - level.height_m)[row, col]
    columns = np.stack([row * dy_m, col * dx_m, np.ones(len(row))], axis=1)
    slope_y, slope_x, _ = np.linalg.lstsq(columns, plane_m)[0]
    return float(slope_y), float(slope_x)


def _check(kind: FormKind, degree: int | None) -> None:
    if kind not in get_args(FormKind):
        raise SettingsError(
            f"conditioning.form: got {kind!r}; expected one of {', '.join(get_args(FormKind))}"
        )
    if kind == "polynomial":
        if degree is None or not 1 <= degree <= MAX_DEGREE:
            raise SettingsError(
                f"conditioning.form_degree: got {degree}; expected 1 to {MAX_DEGREE} for the form "
                "polynomial"
            )
    elif degree is not None:
        raise SettingsError(
            f"conditioning.form_degree: got {degree} for the form {kind}; expected none; leave it "
            "out or set conditioning.form to polynomial"
        )


def _measured(surface: HeightMap) -> np.ndarray | None:
    """Return the mask of the measured points, or None where all are."""
    if surface.n_measured == 0:
        raise UnusableSurfaceError(
            f"{surface.origin.name}: all {surface.size} points are non-measured; expected "
            "heights; check the file's code for missing data"
        )
    return None if surface.complete else surface.measured


def _fit_of(
    surface: HeightMap, measured: np.ndarray | None, kind: FormKind, degree: int | None
) -> Fit:
    """Return what fits a map with weights: what is left of it, and radius and direction if it has.

    Without weights all measured points count alike.
    """
    if degree is None:
        return lambda weight: _without_quadric(surface, weight, kind == "cylinder")
    polynomial = _Polynomial.of(surface, measured, degree)
    return lambda weight: (polynomial.taken_off(weight), None, None)


def _reweighted(fit: Fit, surface: HeightMap, measured: np.ndarray | None) -> Fitted:
    """Fit again with the weights that follow from the residuals, until their spread settles."""
    weight = None
    last_m = math.inf
    lowest_m, highest_m = surface.bounds_m
    rounding_m = ROUNDING * (highest_m - lowest_m)
    for step in range(MAX_REWEIGHTS + 1):
        rest, radius_m, axis_rad = fit(weight)
        residual_m = rest.height_m
        off_m = np.abs(residual_m if measured is None else residual_m[measured])
        spread_m = float(np.median(off_m, overwrite_input=True))
        settled = abs(last_m - spread_m) <= SETTLED * spread_m
        if settled or spread_m <= rounding_m or step == MAX_REWEIGHTS:
            break
        last_m = spread_m
        weight = _biweight(residual_m, BIWEIGHT_OVER_MEDIAN * spread_m)
        if measured is not None:
            weight[~measured] = 0.0
    return rest, radius_m, axis_rad


def _through_lowest(fit: Fit, measured: np.ndarray | None) -> Fitted:
    """Fit again to the lowest third of the residuals, until nearly the same points are lowest."""
    weight, before = None, None
    for _ in range(MAX_REWEIGHTS + 1):
        rest, radius_m, axis_rad = fit(weight)
        residual_m = rest.height_m
        known_m = residual_m.reshape(-1) if measured is None else residual_m[measured]
        # Where many points are equally low, as on a clean floor, all of them count
        last = math.ceil(FLOOR_SHARE * (known_m.size - 1))
        low = residual_m <= np.partition(known_m, last)[last]  # False where non-measured
        if before is not None and np.count_nonzero(low != before) <= SETTLED * low.size:
            break
        weight, before = low.astype(np.float64), low
    return rest, radius_m, axis_rad


def _biweight(residual_m: np.ndarray, reach_m: float) -> np.ndarray:
    """Return (1 - (r / reach)^2)^2 of residuals r, 0 beyond the reach."""
    weight = residual_m / reach_m
    np.square(weight, out=weight)
    np.minimum(weight, 1.0, out=weight)
    return np.square(np.subtract(1.0, weight, out=weight), out=weight)


@dataclass(frozen=True, eq=False)
class _Polynomial:
    """Least-squares polynomials of one total degree over one map, whatever the weights.

    The sums of the normal equations factorise into rows and columns: with V and U the Chebyshev
    polynomials of the scaled coordinates, sum(w T_i(v) T_j(u)) is one matrix product V^T W U, and
    so is the right side. Products of two polynomials are sums of single ones,
    2 T_i T_k = T_(i+k) + T_|i-k|. Coordinates run from -1 to 1 over the measured part and heights
    count from a measured one, so that neither the place nor the level of the face costs digits.
    """

    surface: HeightMap
    measured: np.ndarray | None
    degree: int
    level_m: float
    chebyshev_v: np.ndarray  # V, shape (ny, 2 degree + 1)
    chebyshev_u: np.ndarray  # U, shape (nx, 2 degree + 1)

    @classmethod
    def of(cls, surface: HeightMap, measured: np.ndarray | None, degree: int) -> "_Polynomial":
        level_m = _some_m(surface)
        if measured is None:
            v, u = (np.linspace(-1.0, 1.0, n) for n in surface.shape)
        else:
            v, u = _scaled(measured.any(axis=1)), _scaled(measured.any(axis=0))
        of_v, of_u = (np.polynomial.chebyshev.chebvander(at, 2 * degree) for at in (v, u))
        return cls(surface, measured, degree, level_m, of_v, of_u)

    def taken_off(self, weight: np.ndarray | None) -> HeightMap:
        """Return the map less the polynomial that fits it best with these weights."""
        surface, measured, terms = self.surface, self.measured, self.degree + 1
        all_v, all_u = self.chebyshev_v, self.chebyshev_u
        few_u, right = all_u[:, :terms], np.zeros((terms, terms))
        moment = np.zeros((all_u.shape[1], all_u.shape[1]))
        if weight is None and 2 * surface.lost.size < surface.size:
            moment = np.outer(all_v.sum(axis=0), all_u.sum(axis=0))  # less those of the lost
        else:
            weight = measured if weight is None else weight
        for rows in row_blocks(surface.shape):
            known_m, lost = surface[rows] - self.level_m, surface.lost_in(rows)
            known_m.reshape(-1)[lost] = 0.0
            if weight is None:
                row, col = np.divmod(lost, surface.shape[1])
                moment -= all_v[rows][row].T @ all_u[col]
            else:
                known_m *= weight[rows]
                moment += all_v[rows].T @ (weight[rows] @ all_u)
            right += all_v[rows, :terms].T @ (known_m @ few_u)
        less_m = -self._coefficients_m(moment, right)
        # A plane has no other terms than those of v or u alone
        along_v = all_v[:, 1:terms] @ less_m[1:]
        products = [(along_v[:, i], few_u[:, i]) for i in range(1, self.degree)]
        return surface.plus(few_u @ less_m[0], along_v[:, 0], tuple(products), self.level_m)

    def _coefficients_m(self, moment: np.ndarray, right: np.ndarray) -> np.ndarray:
        term, products = _terms(self.degree)
        normal = 0.25 * moment.take(products).sum(axis=0)
        size, modes = np.linalg.eigh(normal)
        if not size[-1] < MAX_CONDITION * size[0]:
            raise _loose(self.surface)
        coefficient_m = np.zeros_like(right)
        coefficient_m.flat[term] = modes @ (right.take(term) @ modes / size)
        return coefficient_m


@cache
def _terms(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the terms of total degree `degree` at most, and the four that products of two make.

    Places in flat tables of T_i(v) T_j(u), shapes (t,) and (4, t, t).
    """
    i, j = np.array([(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]).T
    of_i, of_j = ((one[:, None] + one, np.abs(one[:, None] - one)) for one in (i, j))
    products = [(2 * degree + 1) * in_v + in_u for in_v in of_i for in_u in of_j]
    return (degree + 1) * i + j, np.array(products)


def _scaled(holds: Any) -> np.ndarray:
    """Index along one axis, scaled to -1 ... 1 over the part that holds measured points."""
    first, last = np.flatnonzero(holds)[[0, -1]]
    half = max((last - first) / 2.0, 0.5)
    scaled: np.ndarray = (np.arange(len(holds)) - (first + last) / 2.0) / half
    return scaled


def _loose(surface: HeightMap) -> UnusableSurfaceError:
    return UnusableSurfaceError(
        f"{surface.origin.name}: the measured points lie along a line or are too few to fix the "
        "form; expected points spread over the face; set conditioning.form to none or scan more"
    )


def _some_m(surface: HeightMap) -> float:
    """Return a measured height, from which heights count."""
    return float(surface.at(0 if surface.complete else np.argmax(surface.measured)))


def _without_quadric(surface: HeightMap, weight: np.ndarray | None, cylinder: bool) -> Fitted:
    """Subtract the least-squares sphere or cylinder, by Gauss-Newton steps.

    Lengths count in half diagonals of the face, from its middle. The start is the curvature of the
    least-squares polynomial of degree 2.
    """
    unit_m = 0.5 * math.hypot(*surface.side_m)
    level_m = _some_m(surface)

    def sums(model: Model) -> tuple[np.ndarray, np.ndarray, float, float]:
        return _sums(surface, weight, unit_m, level_m, model)

    parameter = _start(*sums(_quadratic)[:2], cylinder)
    for _ in range(MAX_STEPS):
        normal, right, square, count = sums(partial(_linearised, parameter))
        step = _solve(normal, right)
        parameter = parameter + step
        change = math.sqrt(max(float(step @ normal @ step), 0.0) / count)
        if change <= 1e-9 * math.sqrt(square / count) + 1e-16:
            break
    else:
        raise UnusableSurfaceError(
            f"{surface.origin.name}: no {'cylinder' if cylinder else 'sphere'} settles on the "
            "heights; expected a face of that form; choose another conditioning.form"
        )
    residual_m = np.empty(surface.shape)
    for rows, z, x, y in _blocks(surface, unit_m, level_m):
        residual_m[rows] = unit_m * (z - _quadric(parameter, x, y))
    radius_m = float(unit_m / parameter[3]) if parameter[3] else None
    axis_rad = float(parameter[4] % math.pi) if cylinder else None
    return replace(surface, height_m=residual_m), radius_m, axis_rad


def _blocks(
    surface: HeightMap, unit_m: float, level_m: float
) -> Iterator[tuple[slice, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield rows, scaled heights and coordinates from the middle, a few rows at a time."""
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    y = (np.arange(ny) - 0.5 * (ny - 1)) * (dy_m / unit_m)
    x = (np.arange(nx) - 0.5 * (nx - 1)) * (dx_m / unit_m)
    n_rows = max(1, FEW_POINTS // nx)
    for first in range(0, ny, n_rows):
        rows = slice(first, first + n_rows)
        z = (surface[rows] - level_m) / unit_m
        yield rows, z, np.broadcast_to(x, z.shape), np.broadcast_to(y[rows, None], z.shape)


def _sums(
    surface: HeightMap, weight: np.ndarray | None, unit_m: float, level_m: float, model: Model
) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return normal matrix, right side, sum of squares and sum of weights about a model."""
    normal: Any = 0.0
    right: Any = 0.0
    square = count = 0.0
    for rows, z, x, y in _blocks(surface, unit_m, level_m):
        known = ~np.isnan(z)
        height, columns = model(x[known], y[known])
        off = z[known] - height
        w = np.ones_like(off) if weight is None else weight[rows][known]
        design = np.stack(columns)
        weighted = design * w
        normal = normal + weighted @ design.T
        right = right + weighted @ off
        square += float(off @ (w * off))
        count += float(w.sum())
    if count < 2 * len(right):
        raise _loose(surface)
    return normal, right, square, count


def _solve(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve scaled normal equations; what the points do not fix (the axis of a plane) stays."""
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    solution: np.ndarray = np.linalg.lstsq(
        normal / np.outer(scale, scale), right / scale, rcond=1 / MAX_CONDITION
    )[0]
    return solution / scale


def _quadratic(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    return np.zeros_like(x), [np.ones_like(x), x, y, 0.5 * x * x, x * y, 0.5 * y * y]


def _start(normal: np.ndarray, right: np.ndarray, cylinder: bool) -> np.ndarray:
    """Parameters of the quadric that has the curvature of a polynomial of degree 2."""
    a, b, c, xx, xy, yy = _solve(normal, right)
    if not cylinder:
        return np.array([a, b, c, -0.5 * (xx + yy)])
    curvature, direction = np.linalg.eigh([[xx, xy], [xy, yy]])
    across = int(np.argmax(np.abs(curvature)))
    along = direction[:, 1 - across]
    return np.array([a, b, c, -curvature[across], math.atan2(along[1], along[0])])


def _linearised(
    parameter: np.ndarray, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    columns = [np.ones_like(x)]
    for step in DIFFERENCE * np.eye(len(parameter))[1:]:
        higher, lower = _quadric(parameter + step, x, y), _quadric(parameter - step, x, y)
        columns.append((higher - lower) / (2.0 * DIFFERENCE))
    return _quadric(parameter, x, y), columns


def _quadric(parameter: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of a sphere or cylinder given by what it is at the middle of the face.

    The parameters are height a, slopes b and c along x and y, curvature k and, for a cylinder, the
    direction of its axis. With q from the middle to a point, n the normal and u the axis there
    (u = 0 for a sphere), every point obeys k (q.q - (q.u)^2) + 2 q.n = 0. Of the two roots this is
    the one that becomes the plane as k goes to 0, in the form that loses no digit.
    """
    a, b, c, k = parameter[:4]
    normal_z = 1.0 / math.sqrt(1.0 + b * b + c * c)
    along, axis_z = np.zeros_like(x), 0.0
    if len(parameter) == 5:
        cosine, sine = math.cos(parameter[4]), math.sin(parameter[4])
        rise = b * cosine + c * sine
        length = math.sqrt(1.0 + rise * rise)
        along, axis_z = (x * cosine + y * sine) / length, rise / length
    second = k * (1.0 - axis_z**2)
    first = normal_z - k * axis_z * along
    constant = k * (x * x + y * y - along * along) - 2.0 * normal_z * (b * x + c * y)
    # Beyond its rim a sphere has no height; there its equator stands in until the fit moves on.
    root = np.sqrt(np.maximum(first * first - second * constant, 0.0))
    height: np.ndarray = a - constant / (first + root)
    return height
