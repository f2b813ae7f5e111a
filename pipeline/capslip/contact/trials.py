"""The caps of a face as they may be as well: what is pressed instead where something is doubted."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from capslip.caps.doubts import without_bow
from capslip.caps.hidden import hidden_tops
from capslip.caps.table import DOUBTFUL, UNUSABLE, CapFlag, CapTable
from capslip.contact.accuracy import MOST_WIDE, answers
from capslip.contact.balanced import rebalanced
from capslip.contact.bulk import bulk_of_face_m_per_N, filled_outside
from capslip.contact.doubts import ELASTIC_STRAIN, TWO_SIDED
from capslip.contact.map_doubts import BLURRED
from capslip.contact.material import composite, yield_law
from capslip.contact.models.interacting import InteractingCurve
from capslip.contact.reach import reachable
from capslip.contact.relevance import MISSING, load_seen
from capslip.contact.rung import load_point_m, turning_stiffness
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.errors import ContactError
from capslip.settings import Settings
from capslip.surface.blocks import coarse_map
from capslip.surface.conditioning import Conditioned
from capslip.surface.filters import blurred, long_waves_at
from capslip.surface.flatness import BOWS, bows_m, degree_taken_off, given_bow_m
from capslip.surface.form import remove_form
from capslip.surface.frame import frameless
from capslip.surface.graph import connected_parts
from capslip.surface.heightmap import HeightMap
from capslip.surface.holes import depth_of_holes, holes
from capslip.surface.seams import Seams, levels_m, tilts_m

SMOOTHED, ELSEWHERE = "short_waves_filtered", "mating_not_sure"
OF_OTHER_MAPS = ("long_waves_filtered", "form_taken_off", BLURRED, SMOOTHED)
LEFT_OUT = {"load_on_doubtful_caps": DOUBTFUL}  # flags of caps that may carry nothing, or less
MOST_CAPS = 500  # more take longer than the face itself
MOST_POINTS = 100  # the highest of those that were removed: more do no less
PATCH = 3  # removed points that touch each other, from which they are one punch
DRAWS = 8  # of the hills in a hole
UNLIKELY = 0.1  # chance that any hill was not seen at all
DRAWS_OF_HEIGHTS = 16
LEAST_SEEN = 0.05  # of the load of a contact; below, its cap carries nothing


@dataclass(frozen=True, eq=False)
class FaceOfCaps:
    """A face of caps, whose answers to changes are asked for."""

    surface: HeightMap
    settings: Settings
    seams: Seams | None = None  # of the map
    finer: HeightMap | None = None  # the same map on more points, see `Conditioned`
    unfiltered: HeightMap | None = None  # the same with its long waves, see there
    with_form: HeightMap | None = None  # the same with its form
    elsewhere: tuple[HeightMap, ...] = ()  # the sum with another face that lies a little aside
    with_short_waves: HeightMap | None = None

    def other(self, code: str) -> HeightMap | None:
        """Return the map as it may be as well; None where nobody knows it.

        As the optics would show it once more. What an S-filter takes off once more is no noise, and
        of waves that it halves half of what it took off before: twice that is put back.
        """
        if code not in (BLURRED, SMOOTHED):
            return self.unfiltered if code == "long_waves_filtered" else self.with_form
        surface, settings = self.surface, self.settings
        filtered_m = settings.conditioning.s_filter_nesting_index_m
        period_m = settings.instrument.lateral_period_limit_m if code == BLURRED else filtered_m
        if period_m is None:
            return None
        height_m = surface.height_m
        once_more_m = blurred(height_m, surface.measured, surface.pixel_size_m, period_m)
        if code == SMOOTHED:
            once_more_m = height_m + 2.0 * (height_m - once_more_m)
        return replace(surface, height_m=once_more_m)

    def pressed(self, caps: CapTable) -> tuple[CapTable, InteractingCurve]:
        """Return the caps over the plane that balances them, and their curve with interaction."""
        settings, n_usable = self.settings, int(caps.usable.sum())
        if not 0 < n_usable <= MOST_CAPS:
            raise ContactError(f"{n_usable} caps; expected 1 to {MOST_CAPS}")
        if turning_stiffness(settings) == 0.0:
            at_m = load_point_m(self.surface, settings)
            caps, _ = rebalanced(caps, caps, caps.usable, at_m, settings)
        elif not math.isinf(turning_stiffness(settings)):
            raise ContactError("what holds the face upright was at ease with other caps")
        material, preload_N = settings.material, settings.contact.preload_N
        given = caps, self.surface, self.E_star_Pa, preload_N, yield_law(material)
        pairs = reachable(*given).pairs
        if pairs is None:
            raise ContactError("too many caps to solve for every pair")
        return caps, pairs

    def stands_up_m(
        self, caps: CapTable, x_m: np.ndarray, y_m: np.ndarray, height_m: np.ndarray
    ) -> np.ndarray:
        """Return how far points of a face stand above the plane that presses its caps, else -inf.

        Above that plane and what the loads of the caps have sunk it there.
        """
        turned, curve = self.pressed(caps)
        approach_m = float(curve.approach_m(self.settings.contact.preload_N))
        load_N = curve.asperity_loads_N(approach_m)
        places = np.column_stack((np.ones(len(caps)), caps.x_m, caps.y_m))[caps.usable]
        turned_m = (turned.peak_height_m - caps.peak_height_m)[caps.usable]
        level_m, slope_x, slope_y = np.linalg.lstsq(places, turned_m, rcond=None)[0]
        up_m = height_m + level_m + slope_x * x_m + slope_y * y_m
        up_m -= float(turned.peak_height_m[caps.usable].max()) - approach_m
        near = np.flatnonzero(up_m > 0.0)
        for at in np.array_split(near, 1 + near.size // MOST_CAPS):
            up_m[at] -= self.sunk_m(curve, load_N, x_m[at], y_m[at])
        return np.where(up_m > 0.0, up_m, -np.inf)

    def sunk_m(
        self, curve: InteractingCurve, load_N: np.ndarray, x_m: np.ndarray, y_m: np.ndarray
    ) -> np.ndarray:
        """Return how deep the loads of caps have sunk the surface at places outside of them."""
        r_m = np.hypot(x_m[:, None] - curve.x_m, y_m[:, None] - curve.y_m)
        sunk_m: np.ndarray = (load_N / r_m).sum(axis=1) / (math.pi * self.E_star_Pa)
        return sunk_m

    def approach_m(self, caps: CapTable) -> float:
        """Return the approach of the caps under the preload, less the bulk sinking."""
        preload_N = self.settings.contact.preload_N
        bulk_m = bulk_of_face_m_per_N(self.surface, self.E_star_Pa) * preload_N
        return float(self.pressed(caps)[1].approach_m(preload_N)) - bulk_m

    def answers(self, caps: CapTable) -> np.ndarray:
        """Return energies and stiffness, see `accuracy.answers`."""
        return answers(self.pressed(caps)[1], True, self.surface, self.settings)

    @property
    def E_star_Pa(self) -> float:
        """Composite modulus."""
        material = self.settings.material
        return composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa


@dataclass(frozen=True, eq=False)
class Trials:
    """The caps of a face as they may be as well."""

    face: FaceOfCaps
    caps: CapTable
    peaks: CapTable
    conditioned: Conditioned
    of_map: bool = False  # whether the map answers, which lacks what lies in its holes

    @cached_property
    def before(self) -> np.ndarray:
        """Energies and stiffness of the caps as they are."""
        return self.face.answers(self.caps)

    def face_of(self, code: str) -> FaceOfCaps:
        """Return the face that is pressed instead: as a whole, where its outline is in doubt."""
        if code != "outline_assumed":
            return self.face
        return replace(self.face, surface=filled_outside(self.face.surface))

    def of(self, code: str) -> Iterator[CapTable]:
        """Return what to press instead, for the problems of one code."""
        if code in BOWS:
            yield from self._bowed(code)
        elif code == "tilt_left":
            yield self._levelled()
        elif code == "seams":
            yield from self._in_one_field()
        elif code in OF_OTHER_MAPS:
            yield self._on(self.face.other(code))
        elif code == ELSEWHERE:
            yield from map(self._on, self.face.elsewhere)
        elif code in ("interpolated", "points_filled", "resampled_coarser", "ripple"):
            raise ContactError(f"{code}: caps do not tell")
        elif code == "hole_may_hide_hills":
            yield from self._with_hills(holes(self.face.surface))
        elif code == "tops_in_holes":
            yield from self._with_hidden_tops()
        elif code == "outline_assumed":
            yield self.caps
            yield from self._with_hills(self.face.surface.outside)
        elif code == "outliers_removed":
            yield from self._with_points()
        elif code == "clipped":
            yield from self._with_other_tops()
        elif code == "heights_in_steps":
            yield from self._with_rounding()
        else:
            yield self._without(LEFT_OUT[code])

    def _bowed(self, code: str) -> Iterator[CapTable]:
        """Return caps without a bow, or with those that the instrument, or a mean, may have.

        Not where a hill below the cut would touch as well without the bow.
        """
        caps, surface = self.caps, self.face.surface
        flatness_m = given_bow_m(code, surface, self.face.settings)
        if flatness_m is not None:
            for bow_m in bows_m(surface, flatness_m, caps.x_m, caps.y_m):
                yield caps.with_columns(peak_height_m=caps.peak_height_m + bow_m)
            return
        level = coarse_map(surface)
        taken_off = degree_taken_off(self.face.settings.conditioning)
        unbowed, straight = without_bow(caps, level, self.peaks, taken_off)
        self._refuse_others(unbowed, level, straight)
        yield unbowed

    def _refuse_others(self, moved: CapTable, level: HeightMap, other: HeightMap) -> None:
        """Refuse moved caps where a hill below the cut of a map would touch as the map is moved."""
        caps = self.caps
        cut_m = float((caps.peak_height_m - caps.cap_height_m)[caps.usable].min())
        row, col = np.nonzero(level.height_m < cut_m)
        dy_m, dx_m = level.pixel_size_m
        below_m = (col + 0.5) * dx_m, (row + 0.5) * dy_m, other.height_m[row, col]
        if (self.face.stands_up_m(moved, *below_m) > 0.0).any():
            raise ContactError("hills below the cut touch then, which are no caps yet")

    def _levelled(self) -> CapTable:
        """Return caps without the tilt of the least-squares plane; their radii stay."""
        caps, coarse = self.caps, coarse_map(self.face.surface)
        tilt_m = coarse.height_m - remove_form(coarse, "plane")[0].height_m
        nx, (dy_m, dx_m) = coarse.shape[1], coarse.pixel_size_m
        known = np.flatnonzero(np.isfinite(tilt_m))
        row, col = np.divmod(known, nx)
        plane = np.column_stack(((col + 0.5) * dx_m, (row + 0.5) * dy_m, np.ones(known.size)))
        slope_x, slope_y, up_m = np.linalg.lstsq(plane, tilt_m.reshape(-1)[known], rcond=None)[0]
        at_caps_m = slope_x * caps.x_m + slope_y * caps.y_m + up_m
        return caps.with_columns(peak_height_m=caps.peak_height_m - at_caps_m)

    def _in_one_field(self) -> Iterator[CapTable]:
        """Return caps whose fields lie on one level, and are not tilted either."""
        surface, caps = self.face.surface, self.caps
        seams = self.face.seams
        if seams is None:
            raise ContactError("there are no seams in the map that was pressed")
        at = surface.pixel_at(caps.x_m, caps.y_m)
        for up_m in (levels_m(seams), tilts_m(seams)):
            yield caps.with_columns(peak_height_m=caps.peak_height_m - up_m[at])

    def _on(self, other: HeightMap | None) -> CapTable:
        """Return caps on another map of the same points, as blunt as what it has more makes them.

        Not where a hill below the cut would touch as well on it.
        """
        caps, surface = self.caps, self.face.surface
        if other is None:
            raise ContactError("no other map")
        up_m, curvature_per_m = long_waves_at(surface, other, caps.x_m, caps.y_m)
        sharp = 1.0 - caps.radius_m * curvature_per_m
        if not (np.isfinite(up_m) & (sharp > 0.0))[caps.usable].all():
            raise ContactError("nobody knows what a cap is with what the other map has more")
        moved = caps.with_columns(
            peak_height_m=caps.peak_height_m + np.where(caps.usable, up_m, 0.0),
            radius_m=caps.radius_m / np.where(caps.usable, sharp, 1.0),
        )
        self._refuse_others(moved, coarse_map(surface), coarse_map(other))
        return moved

    def _without(self, flag: CapFlag) -> CapTable:
        """Return caps of which those with the flag carry nothing, or less.

        What lies over no measured point of a contact carries nothing where that is all that is
        doubted: of a load N = 4/3 E* R^0.5 d^1.5 the rest is that of a sharper cap.
        """
        caps = self.caps
        flagged = caps.usable & ((caps.flags & flag) != 0)
        if not flagged.any():
            raise ContactError("no cap has the flag that the problem is about")
        seen = 1.0 - flagged
        part = flagged & ((caps.flags & flag & ~MISSING) == 0)
        a_m = np.nan_to_num(caps.contact_radius_m)
        seen[part] = load_seen(caps.x_m[part], caps.y_m[part], a_m[part], self.face.surface)
        return caps.with_columns(
            radius_m=caps.radius_m * np.where(seen > LEAST_SEEN, seen, 1.0) ** 2,
            flags=np.where(seen > LEAST_SEEN, caps.flags, caps.flags | UNUSABLE),
        )

    def _with_other_tops(self) -> Iterator[CapTable]:
        """Return caps whose tops were cut off, moved by their standard errors.

        A top that is higher is sharper, too: the flanks hold its rim. Beside it the hill is that of
        the fit, so its radius counts for the share of the contact, or of what was fitted if that is
        less, see `_share_of_tops`.
        """
        tops, caps = self.face.surface.tops, self.caps
        if tops is None or tops.x_m.size == 0:
            raise ContactError("nobody knows which tops were cut off")
        height_se_m, log_radius_se, area_m2 = tops.errors_at(caps.x_m, caps.y_m)
        if not height_se_m[caps.usable].any():
            raise ContactError("no cap stands where tops were cut off")
        yield from _moved(caps, height_se_m, log_radius_se * _share_of_tops(caps, area_m2))

    def _with_rounding(self) -> Iterator[CapTable]:
        """Return caps whose heights are moved by the error of rounding, each for itself.

        What lifts a top and leaves the rim of its fit makes it sharper.
        """
        rounding, caps = self.face.surface.rounding, self.caps
        error_m = 0.0 if rounding is None else rounding.error_m
        with np.errstate(divide="ignore", invalid="ignore"):  # of few steps a cap may have no depth
            sharper = np.nan_to_num(error_m / caps.fit_depth_m)
        yield from _moved(caps, error_m, sharper)

    def _with_hills(self, hole: np.ndarray) -> Iterator[CapTable]:
        """Return caps with hills that were not seen; none where there hardly is one.

        Hills like those that were seen stand anywhere. One of them is not seen where all of its
        disc above the cut lies in a hole, or between points that stand alone; so for each that was
        seen there are as many that were not as the odds for its disc, and the greater hide less.
        Where the rim of a hole is half as high as the cut, it is taken for that of a lost hill.
        """
        caps = self.caps
        member = np.flatnonzero(caps.usable)
        disc_m = 0.5 * caps.diameter_m[member]
        cut_m = float((caps.peak_height_m - caps.cap_height_m)[member].min())
        inner, hole, corner_m = frameless(self.face.surface, hole)
        hidden, lost, places = _chance_to_hide(inner, hole, disc_m, cut_m)
        odds = hidden / np.maximum(1.0 - hidden, 1e-3)
        total = float(odds.sum())
        expected = max(total, lost) if total > 0.0 else 0.0
        if not expected > -math.log1p(-UNLIKELY):
            self.face.answers(caps)  # raises: of caps that cannot be pressed nothing is known
            return
        rng = np.random.default_rng(0)
        seen_m = list(zip(caps.x_m[member], caps.y_m[member], strict=True))
        for _ in range(DRAWS):
            stand_m, like = seen_m.copy(), []
            for one in rng.choice(member.size, max(1, rng.poisson(expected)), p=odds / total):
                x, y = places(rng, disc_m[one])
                place_m = corner_m[0] + x, corner_m[1] + y
                if min(math.dist(place_m, other_m) for other_m in stand_m) > disc_m[one]:
                    stand_m.append(place_m)
                    like.append(member[one])
            x_m, y_m = np.array(stand_m[len(seen_m) :]).reshape(-1, 2).T
            yield _joined(caps, x_m, y_m, caps.peak_height_m[like], caps.radius_m[like])

    def _with_hidden_tops(self) -> Iterator[CapTable]:
        """Return caps with the tops that lie in holes, as high as they are by their flanks.

        Those stand for what was fitted to the same flanks. A map has of them what was measured of
        their contacts, and so do caps of that much.
        """
        caps, surface = self.caps, self.face.surface
        tops = hidden_tops(surface)
        apart_m = np.hypot(caps.x_m[:, None] - tops.x_m, caps.y_m[:, None] - tops.y_m)
        own = (apart_m <= tops.flank_m).any(axis=1)
        others = caps.with_columns(flags=np.where(own, caps.flags | UNUSABLE, caps.flags))

        def with_tops(height_m: np.ndarray, seen: np.ndarray | float = 1.0) -> CapTable:
            radius_m = np.where(seen > LEAST_SEEN, tops.radius_m * seen**2, np.nan)
            return _joined(others, tops.x_m, tops.y_m, height_m, radius_m)

        for errors in (0.0, -TWO_SIDED, TWO_SIDED):
            yield with_tops(tops.height_m + errors * tops.height_se_m)
        if self.of_map:
            whole, curve = self.face.pressed(with_tops(tops.height_m))
            approach_m = float(curve.approach_m(self.face.settings.contact.preload_N))
            plane_m = float(whole.peak_height_m[whole.usable].max()) - approach_m
            up_m = np.maximum(whole.peak_height_m[len(caps) :] - plane_m, 0.0)
            a_m = np.sqrt(tops.radius_m * up_m)
            yield with_tops(tops.height_m, load_seen(tops.x_m, tops.y_m, a_m, surface))

    def _with_points(self) -> Iterator[CapTable]:
        """Return caps with the removed points that would touch, if there are any.

        A point is a flat punch of the area of a pixel, pressed in by what it stands above the
        surface that the caps have sunk, at most until it yields: the load is 2 E* a e. Its cap has
        that load at that compression e. Within a contact it counts as if it stood at its rim.
        Three points and more that touch each other are one punch, and so are punches that overlap.
        """
        surface, E_star_Pa = self.face.surface, self.face.E_star_Pa
        (x_m, y_m, height_m), n_points = _punches(self.conditioned.removed_m, surface)
        punch_m = np.sqrt(n_points * surface.pixel_area_m2 / math.pi)
        n = len(self.caps)
        asleep = _joined(self.caps, x_m, y_m, height_m, np.full(x_m.size, np.nan))
        caps, curve = self.face.pressed(asleep)
        preload_N = self.face.settings.contact.preload_N
        approach_m = float(curve.approach_m(preload_N))
        load_N = curve.asperity_loads_N(approach_m)
        x_m, y_m = _on_rims(x_m, y_m, curve, contact_radius_m(load_N, curve.radius_m, E_star_Pa))
        plane_m = float(caps.peak_height_m[:n][caps.usable[:n]].max()) - approach_m
        up_m = caps.peak_height_m[n:] - plane_m - self.face.sunk_m(curve, load_N, x_m, y_m)
        touch = np.argsort(-up_m, kind="stable")[: min(MOST_POINTS, int((up_m > 0.0).sum()))]
        if touch.size == 0:
            return
        apart_m = np.hypot(x_m[touch, None] - x_m[touch], y_m[touch, None] - y_m[touch])
        wider_m = np.maximum(punch_m[touch, None], punch_m[touch])
        over = np.tril(apart_m < wider_m, -1)  # a higher one stands there
        touch = touch[~over.any(axis=1)]
        punch_m = punch_m[touch]
        law = yield_law(self.face.settings.material)
        hardest_Pa = ELASTIC_STRAIN * E_star_Pa if law is None else law.hardness_Pa
        pressed_m = np.minimum(up_m[touch], 0.5 * math.pi * punch_m * hardest_Pa / E_star_Pa)
        top_m = height_m[touch] - up_m[touch] + pressed_m
        yield _joined(self.caps, x_m[touch], y_m[touch], top_m, 2.25 * punch_m**2 / pressed_m)


def _punches(points_m: np.ndarray, surface: HeightMap) -> tuple[np.ndarray, np.ndarray]:
    """Return places (x, y) and mean heights of removed points, and how many there are in each.

    Three and more that touch each other are one.
    """
    (dy_m, dx_m), n, width = surface.pixel_size_m, points_m.shape[1], surface.shape[1] + 2
    place = (points_m[1] / dy_m).astype(int) * width + (points_m[0] / dx_m).astype(int)
    order = np.argsort(place)
    beside = place[:, None] + np.array((1, width - 1, width, width + 1))
    at = np.minimum(np.searchsorted(place, beside, sorter=order), n - 1)
    one, neighbour = np.nonzero(place[order[at]] == beside)
    part = connected_parts(n, one, order[at[one, neighbour]])
    part = np.where(np.bincount(part)[part] >= PATCH, part, n + np.arange(n))
    _, part, n_points = np.unique(part, return_inverse=True, return_counts=True)
    return np.stack([np.bincount(part, one_m) / n_points for one_m in points_m]), n_points


def _moved(
    caps: CapTable, height_m: float | np.ndarray, log_radius: np.ndarray
) -> Iterator[CapTable]:
    """Return caps moved up or down, each for itself; those that are higher are sharper.

    The greatest of 16 changes is about that at 95 %.
    """
    rng = np.random.default_rng(0)
    log_radius = np.minimum(log_radius, MOST_WIDE)  # of shallow fits the factor would overflow
    for sign in rng.choice((-1.0, 1.0), (DRAWS_OF_HEIGHTS, len(caps))):
        yield caps.with_columns(
            peak_height_m=caps.peak_height_m + sign * height_m,
            radius_m=caps.radius_m * np.exp(-sign * log_radius),
        )


def _share_of_tops(caps: CapTable, area_m2: np.ndarray) -> np.ndarray:
    """Return the share that tops have of the contacts of caps, or of what these were fitted to.

    The greater of both, one where there is no contact: an upper bound for a top of radius b in a
    contact of radius a. Curved more by the share e it is e (b^2 - r^2) / 2R higher, as much as a
    cap that is all curved more by e (3/8) (b/a)^4, b << a, by the mean under a flat punch. A sphere
    fitted to depths that are spread evenly takes e s^2 (3 - 2 s) of a share s of the points.
    """
    fitted_m2 = 2.0 * np.pi * caps.radius_m * caps.fit_depth_m
    whole_m2 = np.fmin(np.pi * np.square(caps.contact_radius_m), fitted_m2)
    known = np.isfinite(caps.contact_radius_m) & (whole_m2 > 0.0)
    share = np.divide(area_m2, whole_m2, out=np.ones_like(area_m2), where=known)
    return np.minimum(share, 1.0)


def _chance_to_hide(
    surface: HeightMap, hole: np.ndarray, disc_m: np.ndarray, cut_m: float
) -> tuple[np.ndarray, float, Callable[[np.random.Generator, float], tuple[float, float]]]:
    """Return the chances that nothing of discs was measured, and where such a disc may lie.

    And 1 where a hole seems to be a hill of which the top was lost, else 0.
    """
    filling, (side_y_m, side_x_m) = surface.filling, surface.side_m
    if filling is not None:
        chance = np.array([filling.chance_to_miss(one_m) for one_m in disc_m])
        return chance, 0.0, lambda rng, _: (rng.uniform(0.0, side_x_m), rng.uniform(0.0, side_y_m))
    given = surface, float(np.median(disc_m)), hole
    x_m, y_m, depth_m, rim_m, area_m2 = depth_of_holes(*given)
    n_deep = np.array([np.count_nonzero(depth_m >= one_m) for one_m in disc_m])
    face_m2 = surface.measured_area_m2 + area_m2 * depth_m.size
    half_way_m = 0.5 * (cut_m + float(np.nanmedian(surface.height_m)))
    lost = (rim_m > half_way_m) & (depth_m >= disc_m.min())

    def place(rng: np.random.Generator, radius_m: float) -> tuple[float, float]:
        at = rng.choice(np.flatnonzero(depth_m >= radius_m))
        return float(x_m[at]), float(y_m[at])

    return area_m2 * n_deep / face_m2, float(lost.any()), place


def _on_rims(
    x_m: np.ndarray, y_m: np.ndarray, curve: InteractingCurve, a_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return places, those within a contact moved to its rim: point loads sink no deeper there."""
    off_m = np.stack((x_m[:, None] - curve.x_m, y_m[:, None] - curve.y_m))
    r_m = np.hypot(*off_m)
    point = np.arange(x_m.size)
    inmost = np.argmax(a_m - r_m, axis=1)
    a_m, r_m, off_m = a_m[inmost], r_m[point, inmost], off_m[:, point, inmost]
    out = np.where(r_m < a_m, a_m / np.maximum(r_m, 1e-300) - 1.0, 0.0)
    at_peak = (r_m == 0.0) * a_m
    return x_m + out * off_m[0] + at_peak, y_m + out * off_m[1]


def _joined(
    caps: CapTable, x_m: np.ndarray, y_m: np.ndarray, height_m: np.ndarray, radius_m: np.ndarray
) -> CapTable:
    """Return caps with more of them; one without a radius is not usable."""
    more = {"x_m": x_m, "y_m": y_m, "peak_height_m": height_m, "radius_m": radius_m}
    more["flags"] = np.where(np.isfinite(radius_m), 0, UNUSABLE).astype(caps.flags.dtype)
    columns = {}
    for one in fields(CapTable):
        column = getattr(caps, one.name)
        blank = "" if column.dtype.kind in "UO" else np.zeros(1, column.dtype)[0]
        added = more.get(one.name, np.full(x_m.shape, blank, column.dtype))
        columns[one.name] = np.concatenate((column, added))
    return CapTable(**columns)
