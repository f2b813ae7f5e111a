"""From the map as measured to the one that is cut: every optional step, in its order."""

import math
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.problems import Problem
from capslip.surface.doubts import problems_of_map, problems_of_outliers, refuse_absurd
from capslip.surface.filling import fill_scattered
from capslip.surface.filters import gaussian_l_filter, gaussian_s_filter
from capslip.surface.form import Form, FormKind, remove_form
from capslip.surface.heightmap import HeightMap, Tops
from capslip.surface.noise import ScanNoise
from capslip.surface.outliers import NEIGHBOURS, Outliers, find_outliers
from capslip.surface.resampling import finer_than, problems_of_resampling, resample
from capslip.surface.rounding import problems_of_rounding, smooth_steps
from capslip.surface.rows import row_blocks
from capslip.surface.seams import Seams, find_seams
from capslip.surface.taken_form import TakenForm, taken_form
from capslip.surface.tops import restore_tops, without_lost_tops

OutlierRule = Literal["isolated", "none"]


@dataclass(frozen=True, eq=False)
class Conditioned:
    """A height map ready for the cut.

    Attributes
    ----------
    surface : HeightMap
        Heights relative to the fitted form; non-measured points and removed outliers are NaN.
    sq_m, sz_m : float
        Root mean square height and height range of `surface` (ISO 25178-2 Sq, Sz).
    steps : tuple of dict
        What was done, in order: `step` names it, the other keys are its numbers.
    problems : tuple of Problem
        What makes the map doubtful.
    removed_m : float64, shape (3, n)
        Place (x, y) of each outlier that was removed, and its height above the fitted form.
    removed : Outliers
        The same, by how far each stands off what is around it.
    second_m : float64, shape (ny, nx), or None
        Of the composite surface of two faces the part that is the second one's; NaN beside it.
    slope : (float, float)
        Of all planes that were added since, along x and y; see `turned`.
    tops_of_scans : tuple of (Tops or None)
        What was put back of each scan, in its own frame.
    finer : HeightMap, or None
        The same face on more points where it was resampled to fewer, see `finer_than`; without the
        planes that were added since.
    unfiltered : HeightMap, or None
        The same face with the long waves that a filter took off; without the planes that were added
        since.
    with_short_waves : HeightMap, or None
        The same face with the short waves that a filter took off; without the planes that were
        added since.
    form : TakenForm, or None
        What was taken off beside a plane; None of two faces.
    with_forms : HeightMap, or None
        The sum of two faces with their forms; without the planes that were added since.
    elsewhere : tuple of HeightMap
        The sum of two faces where least squares may have laid the second as well; without the
        planes that were added since.
    measured_shape : (int, int), or None
        (ny, nx) before it was resampled; None where nobody knows.
    """

    surface: HeightMap
    sq_m: float
    sz_m: float
    steps: tuple[dict[str, Any], ...]
    problems: tuple[Problem, ...]
    removed_m: np.ndarray = field(default_factory=lambda: np.empty((3, 0)))
    slope: tuple[float, float] = (0.0, 0.0)
    removed: Outliers = field(default_factory=Outliers)
    second_m: np.ndarray | None = None
    tops_of_scans: tuple[Tops | None, ...] = ()
    finer: HeightMap | None = None
    unfiltered: HeightMap | None = None
    with_short_waves: HeightMap | None = None
    form: TakenForm | None = None
    with_forms: HeightMap | None = None
    elsewhere: tuple[HeightMap, ...] = ()
    measured_shape: tuple[int, int] | None = None

    @cached_property
    def seams(self) -> Seams | None:
        """Straight seams of the map, for their doubt and for its effect; None without any."""
        return find_seams(self.surface)

    @property
    def finest(self) -> HeightMap:
        """Return the map as it was fitted on the most points there are."""
        return self.as_fitted() if self.finer is None else self.finer

    def turned(
        self,
        surface: HeightMap,
        slope: tuple[float, float],
        at_m: tuple[float, float],
        step: dict[str, Any],
    ) -> "Conditioned":
        """Return the same with a surface to which a plane of slopes (x, y) from a place was added.

        The step says so.
        """
        x_m, y_m, height_m = self.removed_m
        turned_m = height_m + slope[0] * (x_m - at_m[0]) + slope[1] * (y_m - at_m[1])
        removed_m = np.stack((x_m, y_m, turned_m))
        steps, added = (*self.steps, step), (self.slope[0] + slope[0], self.slope[1] + slope[1])
        return replace(self, surface=surface, steps=steps, removed_m=removed_m, slope=added)

    def as_fitted(self) -> HeightMap:
        """Return the map before planes were added, but for a constant."""
        return _sloped(self.surface, (-self.slope[0], -self.slope[1]))

    @property
    def whole(self) -> HeightMap:
        """Return the map as it was fitted, with the long waves that a filter took off."""
        return self.as_fitted() if self.unfiltered is None else self.unfiltered

    @property
    def rough(self) -> HeightMap:
        """Return the map as it was fitted, with the short waves that a filter took off."""
        return self.as_fitted() if self.with_short_waves is None else self.with_short_waves

    def finer_as_turned(self) -> HeightMap | None:
        """Return `finer` as the surface lies, but for a constant, and with its voids."""
        return self._as_turned(self.finer)

    def unfiltered_as_turned(self) -> HeightMap | None:
        """Return `unfiltered` as the surface lies, but for a constant, and with its voids."""
        return self._as_turned(self.unfiltered)

    def with_short_waves_as_turned(self) -> HeightMap | None:
        """Return the map with its short waves as it lies, but for a constant, with its voids."""
        return self._as_turned(self.with_short_waves)

    @property
    def formed(self) -> HeightMap:
        """Return the map as it was fitted, with the form that was taken off beside a plane."""
        return self.as_fitted() if self.form is None else self.form.put_back(self.as_fitted())

    def with_form_as_turned(self) -> HeightMap | None:
        """Return the map with its form as it lies, but for a constant, and with its voids."""
        if self.form is not None:
            return self.form.put_back(self.surface)
        return self._as_turned(self.with_forms)

    def elsewhere_as_turned(self) -> tuple[HeightMap, ...]:
        """Return `elsewhere` as the surface lies, but for constants, and with its voids."""
        return tuple(one for one in map(self._as_turned, self.elsewhere) if one is not None)

    def _as_turned(self, other: HeightMap | None) -> HeightMap | None:
        if other is None:
            return None
        return _sloped(other.as_void() if self.surface.void else other, self.slope)


def condition(
    surface: HeightMap,
    form: FormKind = "plane",
    *,
    form_degree: int | None = None,
    form_robust: bool = False,
    form_floor: bool = False,
    outliers: OutlierRule = "isolated",
    edge_trim_m: float | None = None,
    s_filter_nesting_index_m: float | None = None,
    l_filter_nesting_index_m: float | None = None,
    resample_to: tuple[int, int] | None = None,
    noise_m: float | None = None,
) -> Conditioned:
    """Trim, remove form and outliers, filter and resample, each on demand and in this order.

    Parameters
    ----------
    surface : HeightMap
        The map as measured. Tops that the range of the sensor cut off are put back first, see
        `restore_tops`. A non-measured point is only filled where those measured stand alone, see
        `fill_scattered`.
    form, form_degree, form_robust, form_floor
        See `remove_form`.
    outliers : {"isolated", "none"}
        Mark spikes and bad codes as non-measured (see `find_outliers`) and fit the form again
        without them, or keep them.
    edge_trim_m : float, optional
        Width of the margin to cut off on all four sides of what was measured. Places then count
        from the new corner.
    s_filter_nesting_index_m, l_filter_nesting_index_m : float, optional
        Nesting indices of the areal Gaussian filters that take off short and long waves. They come
        after the form, so that the edge of the map disturbs them least.
    resample_to : (int, int), optional
        (ny, nx) of the grid to resample to.
    noise_m : float, optional
        Measurement noise of the map as measured, where somebody says another than its file: how
        much of it filters and resampling leave follows from it and from what the map shows.

    Raises
    ------
    SettingsError
        If an option is unknown, out of bounds or too large for the face.
    UnusableSurfaceError
        If no point is measured, the measured points do not fix the form, or no unit makes the
        lengths plausible.

    Examples
    --------
    >>> y, x = np.mgrid[0:40, 0:60]
    >>> tilted = HeightMap(3e-6 * x - 2e-6 * y + 5e-3, (1e-4, 1e-4))
    >>> result = condition(tilted)
    >>> result.sz_m < 1e-15, [step["step"] for step in result.steps]
    (True, ['form', 'outliers'])
    """
    _check_rule(outliers)
    refuse_absurd(surface)
    steps: list[dict[str, Any]] = []
    if edge_trim_m is not None:
        surface, step = _trimmed(surface, edge_trim_m)
        steps.append(step)

    stored = restore_tops(surface)
    if stored.tops is not None:
        steps.append({"step": "tops", **stored.tops.counts})
    smooth = smooth_steps(stored)
    if smooth.rounding is not None:
        steps.append({"step": "rounding", **asdict(smooth.rounding)})
    fit: dict[str, Any] = {"degree": form_degree, "robust": form_robust, "floor": form_floor}
    surface, removed_form = remove_form(smooth, form, **fit)
    found = find_outliers(surface, stored)
    step = {"step": "outliers", "rule": outliers, "removed": 0}
    removed_m = np.empty((3, 0))
    if outliers == "isolated" and found.index.size:
        step["removed"] = found.index.size
        step["sq_before_m"], step["sz_before_m"] = sq_and_sz_m(surface)
        with_them, smooth = surface, smooth.without(found.index)
        surface, removed_form = remove_form(smooth, form, **fit)
        removed_m = _removed_m(with_them, surface, found)
        del with_them
        surface = without_lost_tops(surface)  # a code for missing data is no limit of a sensor
    also: dict[str, Any] = {"form": _beside_plane(smooth, surface, removed_form)}
    sq_m, sz_m = sq_and_sz_m(surface)
    steps += [{"step": "form", **asdict(removed_form), "residual_sq_m": sq_m}, step]
    problems = problems_of_rounding(smooth)
    problems += problems_of_outliers(surface, sq_m, found, kept=outliers == "none")
    del stored, smooth  # a map's worth of memory
    surface = fill_scattered(surface)
    if surface.filling is not None:
        steps.append({"step": "filling", **surface.filling.step})

    noise = ScanNoise.of(surface, noise_m)
    if s_filter_nesting_index_m is not None:
        also["with_short_waves"] = _without_long(surface, l_filter_nesting_index_m, resample_to)
        surface = gaussian_s_filter(surface, s_filter_nesting_index_m)
        steps.append({"step": "s_filter", "nesting_index_m": s_filter_nesting_index_m})
    if l_filter_nesting_index_m is not None:
        also["form"] = None  # it is one of the long waves
        also["unfiltered"] = _without_long(surface, None, resample_to)
        surface = gaussian_l_filter(surface, l_filter_nesting_index_m)
        steps.append({"step": "l_filter", "nesting_index_m": l_filter_nesting_index_m})
    if resample_to is not None:
        measured, surface = surface, resample(surface, resample_to)
        problems += problems_of_resampling(measured, surface)
        also |= {"finer": finer_than(surface, measured), "measured_shape": measured.shape}
        steps.append({"step": "resampling", "shape": list(surface.shape)})
    surface = _with_noise(surface, also, noise, s_filter_nesting_index_m)
    if steps[-1] is not step:
        sq_m, sz_m = sq_and_sz_m(surface)
    problems += problems_of_map(surface, sq_m, sz_m)
    also |= {"removed": found} if removed_m.size else {}
    known = surface, sq_m, sz_m, tuple(steps), problems, removed_m
    return Conditioned(*known, tops_of_scans=(surface.tops,), **also)


def _check_rule(outliers: str) -> None:
    if outliers not in get_args(OutlierRule):
        raise SettingsError(
            f"conditioning.outliers: got {outliers!r}; expected one of "
            f"{', '.join(get_args(OutlierRule))}"
        )


def _with_noise(
    surface: HeightMap, also: dict[str, Any], noise: ScanNoise, filtered_m: float | None
) -> HeightMap:
    """Return a map with what filters left of its noise; the others that are kept get theirs."""
    if filtered_m is None and surface.shape == noise.shape:
        return surface
    for name in ("finer", "unfiltered"):
        if also.get(name) is not None:
            also[name] = noise.left_in(also[name], filtered_m)
    if filtered_m is not None:
        also["with_short_waves"] = noise.left_in(also["with_short_waves"])
    return noise.left_in(surface, filtered_m)


def _without_long(
    surface: HeightMap, long_m: float | None, shape: tuple[int, int] | None
) -> HeightMap:
    """Return a map without waves longer than that, on so many points, each where it is asked."""
    short = surface if long_m is None else gaussian_l_filter(surface, long_m)
    return short if shape is None else resample(short, shape)


def _beside_plane(before: HeightMap, after: HeightMap, form: Form) -> TakenForm | None:
    """Return the form that was taken off, None where it is no more than a plane."""
    if form.kind in ("none", "plane") or form.degree == 1:
        return None
    return taken_form(before, after, form.degree)


def _sloped(surface: HeightMap, slope: tuple[float, float]) -> HeightMap:
    """Return a map with a plane of these slopes (x, y) added."""
    if slope == (0.0, 0.0):
        return surface
    (ny, nx), (dy_m, dx_m), (slope_x, slope_y) = surface.shape, surface.pixel_size_m, slope
    return surface.plus(slope_x * dx_m * np.arange(nx), slope_y * dy_m * np.arange(ny))


def _trimmed(surface: HeightMap, edge_trim_m: float) -> tuple[HeightMap, dict[str, Any]]:
    # From the edge of what was measured: a frame of other points is no part of the face
    scan_m, (dy_m, dx_m) = surface.height_m[surface.measured_window], surface.pixel_size_m
    ny, nx = scan_m.shape
    shorter_m = min(ny * dy_m, nx * dx_m)
    if 0.0 < edge_trim_m < 0.5 * shorter_m:
        trim_y, trim_x = (math.ceil(edge_trim_m / size_m - 1e-9) for size_m in (dy_m, dx_m))
    else:
        trim_y, trim_x = ny, nx
    if 2 * trim_y > ny - 3 or 2 * trim_x > nx - 3:
        raise SettingsError(
            f"conditioning.edge_trim_m: got {edge_trim_m:g}; expected above 0 and less than half "
            f"the shorter side ({shorter_m:g} m), so that three points are left"
        )
    inner = scan_m[trim_y : ny - trim_y, trim_x : nx - trim_x]
    return replace(surface, height_m=inner), {"step": "edge_trim", "points": [trim_y, trim_x]}


def _removed_m(before: HeightMap, after: HeightMap, outliers: Outliers) -> np.ndarray:
    """Return place (x, y) and height of the outliers above the form that was fitted without them.

    The two forms differ little from a point to its neighbours.
    """
    (ny, nx), (dy_m, dx_m) = after.shape, after.pixel_size_m
    row, col = np.divmod(outliers.index, nx)
    shift_m, known = np.zeros(row.size), np.zeros(row.size)
    for down, right in NEIGHBOURS:
        beside = np.clip(row + down, 0, ny - 1), np.clip(col + right, 0, nx - 1)
        change_m = after[beside] - before[beside]
        shift_m += np.nan_to_num(change_m)
        known += ~np.isnan(change_m)
    height_m = before[row, col] + shift_m / np.maximum(known, 1.0)
    return np.stack(((col + 0.5) * dx_m, (row + 0.5) * dy_m, height_m))


def sq_and_sz_m(surface: HeightMap) -> tuple[float, float]:
    """Return root mean square height and height range (ISO 25178-2 Sq, Sz), in metres.

    Raises
    ------
    UnusableSurfaceError
        If no point is measured.
    """
    n, total_m, square_m2 = surface.n_measured, 0.0, 0.0
    if n == 0:
        raise UnusableSurfaceError(
            f"{surface.origin.name}: all {surface.size} points are non-measured; expected "
            "heights; check the file's code for missing data"
        )
    lowest_m, highest_m = surface.bounds_m
    middle_m = 0.5 * (lowest_m + highest_m)  # from which heights count: their level costs no digits
    for rows in row_blocks(surface.shape):
        above_m = (surface[rows] - middle_m).reshape(-1)
        above_m[surface.lost_in(rows)] = 0.0
        total_m += float(above_m.sum())
        # BLAS would share so little among threads, which wait for one another on a busy machine
        square_m2 += float(np.einsum("i,i", above_m, above_m))
    return math.sqrt(max(square_m2 / n - (total_m / n) ** 2, 0.0)), highest_m - lowest_m
