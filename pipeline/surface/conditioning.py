"""From the map as measured to the one that is cut: form off, short waves off, doubts said."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.errors import SettingsError, UnusableSurfaceError
from pipeline.problems import Problem
from pipeline.surface.filters import gaussian_s_filter
from pipeline.surface.heightmap import HeightMap
from pipeline.surface.plausibility import doubts_of_surface

Form = Literal["plane", "quadratic", "none"]
DEGREE = {"plane": 1, "quadratic": 2}
MAX_CONDITION = 1e10  # of the normal equations; a map measured everywhere has about 10


@dataclass(frozen=True, eq=False)
class Conditioned:
    """A height map ready for the cut.

    Attributes
    ----------
    surface : HeightMap
        Heights relative to the fitted form; non-measured points stay non-measured.
    sq_m, sz_m : float
        Root mean square height and height range of `surface` (ISO 25178-2 Sq, Sz).
    problems : tuple of Problem
        What makes the map doubtful.
    """

    surface: HeightMap
    sq_m: float
    sz_m: float
    problems: tuple[Problem, ...]


def condition(
    surface: HeightMap,
    form: Form = "plane",
    *,
    s_filter_nesting_index_m: float | None = None,
) -> Conditioned:
    """Remove the form and, on demand, the shortest waves.

    Parameters
    ----------
    surface : HeightMap
        The map as measured.
    form : {"plane", "quadratic", "none"}
        What the F-operator removes: the least-squares polynomial of total degree 1 or 2 through
        the measured points, or nothing.
    s_filter_nesting_index_m : float, optional
        Nesting index (cut-off wavelength) of an areal Gaussian S-filter, applied after the form is
        off, where the edge of the map disturbs it least.

    Raises
    ------
    SettingsError
        If `form` is unknown or the nesting index is not positive and finite.
    UnusableSurfaceError
        If no point is measured, or the measured points do not fix the form.

    Examples
    --------
    >>> y, x = np.mgrid[0:40, 0:60]
    >>> tilted = HeightMap(3e-6 * x - 2e-6 * y + 5e-3, (1e-4, 1e-4))
    >>> condition(tilted).sz_m < 1e-15
    True
    """
    if form != "none" and form not in DEGREE:
        raise SettingsError(
            f"conditioning.form: got {form!r}; expected one of plane, quadratic, none"
        )
    height_m = surface.height_m
    if form != "none":
        height_m = _without_form(height_m, DEGREE[form], surface.origin.name)
    if s_filter_nesting_index_m is not None:
        height_m = gaussian_s_filter(
            replace(surface, height_m=height_m), s_filter_nesting_index_m
        ).height_m
    result = replace(surface, height_m=height_m)
    measured_m = _measured(height_m, surface.origin.name)
    deviation_m = measured_m - measured_m.mean()
    sq_m = float(np.sqrt(deviation_m @ deviation_m / deviation_m.size))
    sz_m = float(measured_m.max() - measured_m.min())
    return Conditioned(result, sq_m, sz_m, doubts_of_surface(result, sq_m, sz_m))


def _measured(height_m: np.ndarray, name: str) -> np.ndarray:
    """Return the measured heights as one row, without a copy where all are."""
    flat_m: np.ndarray = height_m.reshape(-1)
    if not np.isnan(flat_m.sum()):
        return flat_m
    flat_m = flat_m[~np.isnan(flat_m)]
    if flat_m.size == 0:
        raise UnusableSurfaceError(
            f"{name}: all {height_m.size} points are non-measured; expected heights; "
            "check the file's code for missing data"
        )
    return flat_m


def _without_form(height_m: np.ndarray, degree: int, name: str) -> np.ndarray:
    """Subtract the least-squares polynomial of total degree `degree`.

    The sums of the normal equations factorise into rows and columns: with V and U the powers of
    the scaled coordinates, sum(w v^i u^j) is one matrix product V^T W U, and so is the right side.
    Coordinates run from -1 to 1 over the measured part and heights count from a measured one, so
    that neither the place nor the level of the face costs digits.
    """
    measured = None if not np.isnan(height_m.sum()) else ~np.isnan(height_m)
    if measured is None:
        count_y, count_x = (np.ones(n) for n in height_m.shape)
        level_m = height_m[0, 0]
    else:
        count_y, count_x = measured.sum(axis=1), measured.sum(axis=0)
        level_m = _measured(height_m, name)[0]
    v, u = _scaled(count_y), _scaled(count_x)
    powers = np.arange(2 * degree + 1)
    v_powers, u_powers = v[:, None] ** powers, u[:, None] ** powers

    relative_m = height_m - level_m
    if measured is None:
        moments = np.outer(v_powers.sum(axis=0), u_powers.sum(axis=0))
        known_m = relative_m
    else:
        moments = v_powers.T @ (measured @ u_powers)
        known_m = np.where(measured, relative_m, 0.0)
    right = v_powers[:, : degree + 1].T @ (known_m @ u_powers[:, : degree + 1])

    i, j = np.array([(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]).T
    normal = moments[i[:, None] + i, j[:, None] + j]
    if np.linalg.cond(normal) > MAX_CONDITION:
        raise UnusableSurfaceError(
            f"{name}: the measured points lie along a line or are too few to fix the form; "
            "expected points spread over the face; set conditioning.form to none or scan more"
        )
    coefficients = np.zeros((degree + 1, degree + 1))
    coefficients[i, j] = np.linalg.solve(normal, right[i, j])
    relative_m -= (v_powers[:, : degree + 1] @ coefficients) @ u_powers[:, : degree + 1].T
    return relative_m


def _scaled(count: np.ndarray) -> np.ndarray:
    """Index along one axis, scaled to -1 ... 1 over the part that holds measured points."""
    first, last = np.flatnonzero(count)[[0, -1]]
    half = max((last - first) / 2.0, 0.5)
    scaled: np.ndarray = (np.arange(len(count)) - (first + last) / 2.0) / half
    return scaled
