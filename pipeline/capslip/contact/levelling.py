"""The level that a pressed face finds: it turns until its contacts balance about the load.

A preload has a line of action, and a face turns under it until the moments of its contacts about
that line vanish. So the tilt of the map is an unknown with an equation of its own. It is found in
turns: take the tilt off the map, cut, fit caps at the depth at which they are compressed, press
them under a plane that may turn. The start owes nothing to any plane that was taken off before:
the face rests on three points under a load of no size.
"""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from capslip.caps.apex import limited_by_cut
from capslip.caps.fit import Fitted, fit_spheres
from capslip.caps.fitting import Spheres, fit_named
from capslip.caps.hills import Hills, find_hills
from capslip.caps.noise import Noise, noise_at_rest
from capslip.caps.points import points_of_hills
from capslip.caps.resting import RestingPlane, resting_plane
from capslip.caps.table import CapTable
from capslip.contact.balanced import press_balanced
from capslip.contact.certificate import certify_cut
from capslip.contact.material import composite, yield_law
from capslip.contact.rung import load_point_m, turning_stiffness
from capslip.contact.solvers.yielding import FirstLoading
from capslip.contact.turns import deeper_fits, run_together, same_relief_m, turn_points
from capslip.errors import CapslipError, ContactError, TipsOverError, UnusableSurfaceError
from capslip.settings import Settings
from capslip.surface.blocks import coarse_map
from capslip.surface.heightmap import HeightMap

RATIOS = (0.10, 0.15, 0.20, 0.25, 0.30, 0.40, 0.55)  # cuts to try, where one is not deep enough
DEEP = 0.40  # cut from which on fits that it limits are taken: a deeper one sees what never touches
MAX_CUTS = 4  # at one material ratio
MAX_TURNS = 25  # of fit and contact on the hills of one cut
# Of tilt over approach and of depths, that the last turn may leave: fitted anew, caps then move
# less than a twentieth of it of the load
SETTLED = 2e-3
NEARLY_SETTLED = 1e-2  # the same on a map that only tells the next one where to start
SETTLED_LOAD = 1e-4  # of the preload, that pixels may move in it
AWAKE = 0.25  # of what a turn left, in load: where the next one moves more, it is pixels that do
SETTLED_TILT = 3e-5  # across the face, of the approach, that the last turn may leave then
HELD_LOAD = 3e-4  # of the preload: below, depths are held, else a pixel may flip for ever
LEAST_PART = 0.2  # of a turn: a face that swings to and fro goes only so far each time
# What turns that do not settle may leave all the same, of the preload and of the approach
NEARLY_LOAD, NEARLY_TILT = 1e-3, 3e-3
UNSETTLED = 0.01  # of the preload: a level whose last turn still moves more is none
SHALLOW_LOAD = 1e-3  # of the preload, on hills whose fit the cut may limit
FEW_HILLS = 200  # whose near field costs next to nothing in each turn
EARLY = 0.05  # of load and approach: by then the cut can be tried
SAME_CUT = 0.1  # of the approach: a face that turned less since it was cut is cut well


@dataclass(frozen=True, eq=False)
class Level:
    """A face at the level at which it is pressed.

    Attributes
    ----------
    surface : HeightMap
        Heights over the plane of the balanced face.
    coarse : HeightMap
        The same on fewer points, see `coarse_map`.
    coarse_noise : Noise
        Of what can touch of it.
    hills_at_rest : Hills
        Of the coarse map over the plane on which it rests, at the ratio of the settings.
    hills, caps : Hills, CapTable
        What stands above the cut on this surface; caps without loads.
    slope : (float, float)
        Of the plane that was added to the map, along x and y.
    rest_slope : (float, float)
        Of the plane on which the map rests under a load of no size.
    load_point_m : (float, float)
        Place (x, y) of the line of action.
    material_ratio : float
        Of the cut.
    missed_area_m2 : float
        Area outside the hills that the pressed plane reaches; 0 where the cut is deep enough.
    moved : float
        Share of the load that the last turn still moved; 0 where the turns came to rest.
    given_up : bool
        Whether the turns ended early, as contacts run together and the map can be pressed instead.
    """

    surface: HeightMap
    coarse: HeightMap
    coarse_noise: Noise
    hills_at_rest: Hills
    hills: Hills
    caps: CapTable
    slope: tuple[float, float]
    rest_slope: tuple[float, float]
    load_point_m: tuple[float, float]
    material_ratio: float
    missed_area_m2: float
    moved: float
    given_up: bool


def find_level(surface: HeightMap, settings: Settings, needs_no_caps: bool = False) -> Level:
    """Find the level of a face under its preload, and the cut that holds all that touches.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form; their own level does not matter.
    settings : Settings
        `hills`, `caps`, `material` and `contact`.
    needs_no_caps : bool
        Whether the map can be pressed where the caps do not hold: then nobody waits for their rest.

    Raises
    ------
    TipsOverError
        If the load point lies outside the hull of what can touch.
    ContactError
        If the caps cannot carry the preload, or the turns come to no rest.
    TogetherError
        If contacts run together and `needs_no_caps`.
    UnusableSurfaceError
        If fewer than 9 points lie above the cut.

    Notes
    -----
    A large map is first levelled on the means of blocks, which costs a tenth. The cut grows until
    nothing outside the hills stands in the pressed plane, unless `hills.cut` is fixed. Hills are
    told apart by saddles of a hundredth of the approach: two peaks in one contact are better two
    caps than one. A cut too high for the noise of the whole map is passed over on the blocks.
    """
    at_m, coarse = load_point_m(surface, settings), coarse_map(surface)
    try:
        rest = resting_plane(surface, at_m)
    except UnusableSurfaceError as error:
        raise TipsOverError(f"tips_over: {error}") from error
    start = _Start(np.array(rest.slope), settings.hills.material_ratio)
    given = settings, at_m, rest.slope, needs_no_caps
    first = whole = _Search(surface, *given, SETTLED)
    if coarse is not surface:
        first = _Search(coarse, *given, NEARLY_SETTLED, whole.noise.rms_m)
        with suppress(ContactError, UnusableSurfaceError):  # small contacts need the whole map
            start = first.run(start, DEEP).next
    return whole.run(start).level(rest, first)


def turned(
    surface: HeightMap,
    slope: np.ndarray | tuple[float, float],
    at_m: tuple[float, float],
    bow: np.ndarray | None = None,
) -> HeightMap:
    """Return the map with a plane of slopes (x, y) added that vanishes at a place (x, y).

    With a bow, the terms of x^2, x y and y^2 from that place too.
    """
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    x_m, y_m = (np.arange(nx) + 0.5) * dx_m - at_m[0], (np.arange(ny) + 0.5) * dy_m - at_m[1]
    xx, xy, yy = (0.0, 0.0, 0.0) if bow is None else bow
    twist = ((xy * y_m, x_m),) if xy else ()
    return surface.plus((slope[0] + xx * x_m) * x_m, (slope[1] + yy * y_m) * y_m, twist)


@dataclass(frozen=True, eq=False)
class _Start:
    """What one search hands to the next."""

    slope: np.ndarray  # (2,), of the plane to be taken off the map
    ratio: float
    relief_m: float | None = None  # that tells hills apart, None where no approach is known
    place_m: np.ndarray | None = None  # (2, m), of the caps that carried load
    depth_m: np.ndarray | None = None  # (m,), at which they were fitted


@dataclass(frozen=True, eq=False)
class _Rest:
    """The end of the turns on the hills of one cut: where the last one leads."""

    spheres: Spheres
    use: np.ndarray  # (m,), the caps that were pressed
    at_cut: np.ndarray  # (m,), whether the cut limits their fits
    load_N: np.ndarray  # (m,)
    plane_m: float  # height of the pressed plane at the load point, in the frame of `slope`
    depth_m: np.ndarray | None  # (n,), at which to fit the caps
    slope: np.ndarray
    turn: np.ndarray  # (2,), slope of it that the caps were not fitted at, but turned by
    approach_m: float
    moved: float  # share of the load; 0 where the turns came to rest
    given_up: bool = False


@dataclass(frozen=True, eq=False)
class _Found:
    """What a search found, and what one on a finer map can start from."""

    rest: _Rest
    hills: Hills
    fitted: Fitted
    surface: HeightMap  # over the plane of the balanced face
    missed_area_m2: float
    next: _Start

    def level(self, resting: RestingPlane, first: "_Search") -> Level:
        """Return it as a level, given the search that was the first, on fewer points."""
        rest, caps, at_m = self.rest, self.fitted.table, resting.load_point_m
        small = first.surface.shape == self.surface.shape
        arm_m = np.column_stack((caps.x_m, caps.y_m)) - at_m
        slope_x, slope_y = (-rest.slope).tolist()
        return Level(
            surface=self.surface,
            coarse=self.surface if small else turned(first.surface, -rest.slope, at_m),
            coarse_noise=first.noise,
            hills_at_rest=first.hills_at_rest,
            hills=self.hills,
            # A sphere stays one when it is turned; its apex moves by far less than a pixel
            caps=caps.with_columns(peak_height_m=caps.peak_height_m + arm_m @ rest.turn),
            slope=(slope_x, slope_y),
            rest_slope=resting.slope,
            load_point_m=at_m,
            material_ratio=self.next.ratio,
            missed_area_m2=self.missed_area_m2,
            moved=rest.moved,
            given_up=rest.given_up,
        )


class TogetherError(CapslipError):
    """Contacts run together, and the caps are far from a level that the map would find."""


class _LostCapsError(ContactError):
    """More caps balanced the face before some lost their sphere."""


class _MissedError(Exception):
    """The cut was too high: something outside its hills stands in the pressed plane."""

    def __init__(self, slope: np.ndarray, approach_m: float) -> None:
        super().__init__()
        self.slope, self.approach_m = slope, approach_m


@dataclass(frozen=True, eq=False)
class _Search:
    """The search for the level of one map."""

    surface: HeightMap
    settings: Settings
    at_m: tuple[float, float]
    rest_slope: tuple[float, float]
    needs_no_caps: bool
    settled: float
    finer_noise_m: float = 0.0  # of the map that is searched next, on the cut that is found here

    @cached_property
    def noise(self) -> Noise:
        """Noise of what can touch."""
        return noise_at_rest(self.surface, self.rest_slope)

    @cached_property
    def hills_at_rest(self) -> Hills:
        """Hills at the ratio of the settings as the map rests, where no approach is known."""
        surface = turned(self.surface, -np.array(self.rest_slope), self.at_m)
        return self._hills(surface, self.settings.hills.material_ratio, None)

    def _hills(self, surface: HeightMap, ratio: float, relief_m: float | None) -> Hills:
        chosen, noise_m = self.settings.hills, self.noise.neighbours_m
        pruning = (chosen.pruning_height_m, chosen.pruning_percent_Sz)
        return find_hills(surface, ratio, chosen.separation, *pruning, relief_m, noise_m)

    def run(self, start: _Start, deepest: float = RATIOS[-1]) -> _Found:
        """Search from cuts at the ratio of the start on, down to the deepest."""
        tipped: TipsOverError | None = None
        lost: ContactError | None = None
        trouble: ContactError | None = None
        deepest = 0.0 if self.settings.hills.cut == "fixed" else deepest
        ratios = [start.ratio, *(r for r in RATIOS if start.ratio + 1e-9 < r <= deepest)]
        for ratio in ratios:
            last = ratio == ratios[-1]
            try:
                return self._at_ratio(replace(start, ratio=ratio), last)
            except _MissedError as missed:
                trouble = trouble or ContactError(
                    f"the face finds no level: it balances on what stands above a cut at "
                    f"{ratio:.0%}, and on no deeper cut that holds all that touches"
                )
                start = _Start(missed.slope, ratio, missed.approach_m)
            except TipsOverError as error:
                tipped, start = error.with_traceback(None), _Start(np.array(self.rest_slope), ratio)
            except _LostCapsError as error:
                lost, start = error.with_traceback(None), _Start(np.array(self.rest_slope), ratio)
            except ContactError as error:
                trouble = trouble or error.with_traceback(None)
                start = _Start(np.array(self.rest_slope), ratio)
        # A face tips over where it does so on every cut on which its hills are caps; else it is the
        # search that failed.
        raise trouble or tipped or lost or ContactError("the face finds no level")

    def _at_ratio(self, start: _Start, last: bool) -> _Found:
        found: _Found | None = None
        for _ in range(MAX_CUTS):
            slope, relief_m = start.slope, start.relief_m
            found = None  # as much memory as a map
            found = self._on_one_cut(start, last)
            start = found.next
            same = self._across_m(start.slope - slope) < SAME_CUT * found.rest.approach_m
            enough = self.settled > SETTLED and found.missed_area_m2 == 0.0  # for a finer map's cut
            enough = (enough and relief_m is not None) or found.rest.given_up
            if enough or (same and relief_m == start.relief_m):
                break
        assert found is not None
        rest, peak_m = found.rest, found.rest.spheres.apex_m[found.rest.use]
        noisy = limited_by_cut(peak_m, found.hills.cut_height_m, self.finer_noise_m)
        shallow_N = float(rest.load_N[rest.at_cut | noisy].sum())
        shallow = shallow_N > SHALLOW_LOAD * self.settings.contact.preload_N and start.ratio < DEEP
        if (found.missed_area_m2 > 0.0 or shallow) and not (last or rest.given_up):
            raise _MissedError(rest.slope, rest.approach_m)
        return found

    def _on_one_cut(self, start: _Start, last: bool) -> _Found:
        surface, relief_m = turned(self.surface, -start.slope, self.at_m), start.relief_m
        at_rest = relief_m is None and start.ratio == self.settings.hills.material_ratio
        hills = self.hills_at_rest if at_rest else self._hills(surface, start.ratio, relief_m)
        rest, fitted = self._turns(surface, hills, start, last)
        # A table asks for the grid alone: nobody holds the map that was cut
        fitted = replace(fitted, given=replace(fitted.given, surface=self.surface))
        surface = turned(self.surface, -rest.slope, self.at_m)
        missed_area_m2 = self._missed_area_m2(surface, hills, rest)
        return _Found(rest, hills, fitted, surface, missed_area_m2, self._next(start, rest))

    def _turns(
        self, surface: HeightMap, hills: Hills, start: _Start, last: bool
    ) -> tuple[_Rest, Fitted]:
        """Fit and press the hills of one cut until the plane over them comes to rest."""
        fit, points = self.settings.caps.fit, points_of_hills(surface, hills)
        share = fit_named(fit).compression_share
        slope, depth_m = start.slope, self._carried(start, hills, surface)
        before: tuple[np.ndarray, FirstLoading] | None = None
        before_N: np.ndarray = np.zeros(hills.n_hills)
        tried, history, part, near = last, list[float](), 1.0, self._few(hills)
        # A coarse map tells its hills apart anew once it knows the approach
        rough = self.settled > SETTLED and start.relief_m is None
        watched, together = self.needs_no_caps and start.relief_m is not None, 0
        least, restless, left, awake, ahead = math.inf, math.inf, math.inf, False, np.zeros(2)
        for _ in range(MAX_TURNS):
            turn_points(points, ahead, self.at_m)
            fitted = fit_spheres(surface, hills, fit, depth_m, points, self.noise)
            use, pressed, depths_m = self._press(fitted, slope, before, near)
            rest, load_N, turn = pressed.rest, pressed.load_N, np.array(pressed.rest.slope)
            all_N: np.ndarray = np.bincount(use, load_N, hills.n_hills)
            change = float(np.abs(all_N - before_N).sum() / (2.0 * load_N.sum()))
            moved = 1.0 if before is None else change / part
            span_m, before, before_N = self._across_m(turn), (use, pressed), all_N
            approach_m = rest.level_m - float(depths_m.min())
            plane_m = float(fitted.spheres.apex_m[use].max()) - rest.level_m
            loads = fitted.spheres, use, fitted.given.apexes.at_cut[use], load_N
            deeper_m, deeper = depth_m, 0.0
            if share is not None and (moved > HELD_LOAD or depth_m is None):
                deeper_m, deeper = deeper_fits(depth_m, use, share * pressed.width_m, all_N, part)
            found = _Rest(*loads, plane_m, deeper_m, slope - turn, turn, approach_m, 0.0)
            left, left_before = max(span_m / approach_m, deeper), left
            awake |= moved > max(AWAKE * left_before, SETTLED_LOAD)
            settles = moved <= max(EARLY * left_before, SETTLED_LOAD) and (
                span_m < SETTLED_TILT * approach_m
                or (left < (EARLY if rough else self.settled) and not awake)
            )
            early = not tried and moved < EARLY and span_m < EARLY * approach_m
            if early and (not settles or (rough and left >= self.settled)):
                tried = True
                if self._missed_area_m2(surface, hills, found) > 0.0:
                    raise _MissedError(slope, approach_m)
            if settles and (near or self.settled > SETTLED):
                return found, fitted
            near = settles or (self._few(hills) and (not history or moved < EARLY))
            together = together + 1 if watched and run_together(*loads[:2], pressed) else 0
            if together == 2:
                return _given_up(found, moved), fitted
            history.append(moved)
            if len(history) > 4 and moved > HELD_LOAD and moved > 0.5 * history[-3]:
                if part == 1.0:
                    restless = float(max(history[-3:]))
                elif min(history) > least and restless < UNSETTLED:
                    return replace(found, moved=restless), fitted  # pixels come and go
                if part < LEAST_PART or (moved > EARLY and not last):
                    break
                # It swings to and fro: half of the way.
                least, part, history = min(history), 0.5 * part, []
            depth_m, ahead, slope = deeper_m, part * turn, slope - part * turn
        nearly = moved < NEARLY_LOAD and span_m < NEARLY_TILT * approach_m
        if last or nearly:
            return replace(found, moved=0.0 if nearly else moved), fitted
        turns = f"{MAX_TURNS} turns of fit and contact {moved:.1%} of the load still move"
        why = f"the face finds no level: after {turns}; set contact.alignment to as_levelled"
        raise ContactError(why)

    def _few(self, hills: Hills) -> bool:
        """Whether all turns have their near field; that of more hills waits for the last one."""
        return self.settled <= SETTLED and hills.n_hills <= FEW_HILLS

    def _press(
        self,
        fitted: Fitted,
        slope: np.ndarray,
        before: tuple[np.ndarray, FirstLoading] | None,
        near: bool,
    ) -> tuple[np.ndarray, FirstLoading, np.ndarray]:
        """Return the caps that were pressed, how, and their depths below the plane.

        They start as they were pressed before, where these were the same caps.

        The plane is that of the highest peak, turned with the face. What holds the parts upright is
        at ease where no slope is taken off the map.
        """
        use, spheres = np.flatnonzero(fitted.usable), fitted.spheres
        if not use.size:
            raise ContactError("no cap stands above the cut; raise hills.material_ratio")
        arm_m = np.column_stack((spheres.x_m[use], spheres.y_m[use])) - self.at_m
        peak_m = spheres.apex_m[use]
        stiffness = turning_stiffness(self.settings)
        held = (stiffness, stiffness * slope)
        start = None
        if before is not None and np.array_equal(before[0], use):
            start = before[1].compression_m, before[1].load_N
        radius_m = spheres.radius_m[use]
        try:
            pressed = press_balanced(arm_m, peak_m, radius_m, self.settings, held, start, near)
        except TipsOverError as error:
            if before is None or fitted.usable.all():
                raise
            raise _LostCapsError(
                f"the face finds no level: fitted as deep as they are compressed, {use.size} of "
                f"{len(fitted.usable)} hills are left as caps, and they do not surround the load; "
                "check preload and units"
            ) from error
        area_m2 = float(math.pi * (radius_m * pressed.width_m).sum())
        if area_m2 > math.prod(self.surface.side_m):
            raise ContactError(
                "the face finds no level: turned until balanced, its caps need a contact area of "
                f"{area_m2:.3g} m2; expected less than its {math.prod(self.surface.side_m):.3g} m2"
            )
        depth_m = peak_m.max() - peak_m - arm_m @ np.array(pressed.rest.slope)
        if not pressed.compression_m.max() > np.spacing(np.abs(peak_m).max()):
            raise ContactError(
                f"the face finds no level: {self.settings.contact.preload_N:g} N compress its caps "
                "by less than numbers tell; check contact.preload_N and "
                "contact.alignment_stiffness_Nm_per_rad"
            )
        return use, pressed, depth_m

    def _across_m(self, slope: np.ndarray) -> float:
        """Return the greater height that slopes (x, y) make along a side of the face."""
        ly_m, lx_m = self.surface.side_m
        return float(np.abs(slope * (lx_m, ly_m)).max())

    def _next(self, start: _Start, rest: _Rest) -> _Start:
        known = np.zeros(0, dtype=np.intp)
        if rest.depth_m is not None:
            known = np.flatnonzero(np.isfinite(rest.depth_m))
        spheres = rest.spheres
        place_m = np.stack((spheres.x_m[known], spheres.y_m[known]))
        depth_m = rest.depth_m[known] if rest.depth_m is not None else None
        relief_m = same_relief_m(start.relief_m, rest.approach_m)
        return _Start(rest.slope, start.ratio, relief_m, place_m, depth_m)

    def _carried(self, start: _Start, hills: Hills, surface: HeightMap) -> np.ndarray | None:
        """Return the depths of the last cut for the hills that its caps stand on now."""
        if start.place_m is None or start.depth_m is None or not start.depth_m.size:
            return None
        label = hills.label[surface.pixel_at(*start.place_m)]
        depth_m = np.full(hills.n_hills, np.nan)
        depth_m[label[label > 0] - 1] = start.depth_m[label > 0]
        return depth_m

    def _missed_area_m2(self, surface: HeightMap, hills: Hills, rest: _Rest) -> float:
        on = rest.load_N > 0.0
        hill = rest.use[on]
        material, spheres = self.settings.material, rest.spheres
        law, radius_m = yield_law(material), spheres.radius_m[hill]
        if law is not None:
            radius_m, _ = law.flattened(rest.load_N[on], radius_m)
        return certify_cut(
            surface,
            hills.label,
            rest.plane_m,
            np.stack([spheres.x_m[hill], spheres.y_m[hill], radius_m]),
            rest.load_N[on],
            composite(material.youngs_modulus_Pa, material.poisson_ratio).E_star_Pa,
            hills.noise_m,
        )


def _given_up(rest: _Rest, moved: float) -> _Rest:
    """Return the rest of contacts that run together, near which the face of the map lies."""
    if moved > EARLY:
        raise TogetherError("the contacts of the caps run together before their face comes to rest")
    return replace(rest, moved=moved, given_up=True)
