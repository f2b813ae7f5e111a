"""The normal curve of a height map that is pressed itself."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from time import thread_time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.as_metal import as_metal
from capslip.contact.at_holes import load_at_holes
from capslip.contact.bulk import bulk_of_face_m_per_N
from capslip.contact.curve import NormalCurve
from capslip.contact.plastic_law import LawError, law_of_map
from capslip.contact.scaled import ScaledCurve
from capslip.contact.solvers.detail import FirstLoading
from capslip.contact.solvers.nearby import Nearby, nearby
from capslip.contact.solvers.pressed import Pressed, hardly_yields
from capslip.contact.solvers.refinement import refinement
from capslip.contact.solvers.solutions import Solutions
from capslip.contact.solvers.unloading import SMALL_SLIP, Unloading
from capslip.contact.time_needed import more_time
from capslip.errors import ContactError, SettingsError
from capslip.problems import Effect, Problem
from capslip.units import percent

MIN_PIXELS_ACROSS = 10.0  # of the contacts that carry half of the load
MIN_REFINED_ACROSS = 6.0  # the same, where a spline knows what lies between the pixels
HIGHER = 0.05  # of the approach, that a face stands above its highest pixel: no less is noted
AT_HOLES = 0.05  # of the load: what a hole takes from less moves the answers by less than that
NEARLY_ALL = 0.95  # of a load: beyond that share contacts let go one by one


@dataclass(frozen=True, eq=False)
class BoundaryElementCurve:
    """The normal curve of a height map, see `models.boundary_elements`.

    Every load asked for is solved, and what happens below it (`Unloading`) when first needed. The
    rows of `lift_off_m` and `lifted` are the contact regions at the given approach, so their number
    changes with it, and these take a single approach.
    """

    solutions: Solutions
    model: str  # name of the rung that builds it
    compliance_m_per_N: float = 0.0
    tilt_rad: tuple[float, float] = (0.0, 0.0)  # slopes in x and y added to the map, and held
    yielded_area_m2: float | None = None  # of the contact on the first loading; None: all elastic
    first: FirstLoading | None = None  # of a map that is pressed under one preload
    as_solved: bool = False  # whether it unloads as its pixels do, whatever metal does
    # What metal does otherwise after a first loading, by its load and the spring in series
    metal: dict[tuple[float, float], tuple[LawError, Unloading] | None] = field(
        default_factory=dict, repr=False
    )

    @property
    def touch_m(self) -> np.ndarray:
        """Zero: the approach counts from first touch."""
        return np.zeros(())

    def solved_loads_N(self, most_N: float) -> np.ndarray:
        """Zero and the loads up to `most_N` whose approach costs no solution any more, growing."""
        solved = np.array(sorted(self.solutions.approach_m))
        return np.append(0.0, solved[solved <= most_N])

    def pressed(self, load_N: float) -> Pressed:
        """Return pressures, gaps, contact regions and certificate under a load."""
        return self.solutions.press(float(load_N))

    def tractions(self, load_N: float, later: float) -> tuple[np.ndarray, np.ndarray]:
        """Return how shear is shared before any slip, and when the stick zone bears that less.

        Shape (ny, nx), in no unit: the pressures of a punch on the contact under the load, and
        those that go when that falls to a share of itself; on patches around the contact.
        """
        return self.solutions.tractions(float(load_N), later)

    def at_forces(self, shares: tuple[float, ...]) -> "BoundaryElementCurve":
        """Return this curve, whose slip is followed at these shares of mu N alone, growing."""
        solutions, known = self.solutions, dict(self.solutions.approach_m)
        some = replace(solutions, force_shares=shares, unloading={}, approach_m=known)
        return replace(self, solutions=some, metal={})

    def loaded_first_to(self, load_N: float) -> FirstLoading:
        """Return the face before any load, and how far it came when it bore this one.

        A curve of a face that yields is good at and below its own load; an elastic one at any.
        """
        pressed = self.pressed(load_N)
        first = self.first or FirstLoading(self.solutions.face, pressed.approach_m)
        if math.isinf(first.face.hardness_Pa):
            return replace(first, approach_m=pressed.approach_m)
        return first

    def unloading(self, load_N: float) -> Unloading:
        """Return what happens below a preload, with the error to be expected of it."""
        of_metal = self._of_metal(float(load_N))
        return self.solutions.unload(float(load_N)) if of_metal is None else of_metal[1]

    def law(self, load_N: float) -> LawError | None:
        """Return what metal does otherwise after a first loading, which is in all answers."""
        of_metal = self._of_metal(float(load_N))
        return None if of_metal is None else of_metal[0]

    def _of_metal(self, load_N: float) -> tuple[LawError, Unloading] | None:
        """Return that, and how it unloads with it; None where it has not yielded, or not slipped.

        A load below that of the first loading is another state of the face that this has left.
        """
        pressed = self.solutions.pressed.get(load_N)
        if self.as_solved or pressed is None or pressed.over_hardness is None:
            return None
        key = load_N, self.compliance_m_per_N
        if key not in self.metal:
            solved, found = replace(self, as_solved=True), None
            try:
                below = solved.unloading(load_N)
            except ContactError:  # slip says why
                return None
            if (law := law_of_map(solved, load_N)) is not None:
                found = law, as_metal(below, law, self.compliance_m_per_N)
            self.metal[key] = found
        return self.metal[key]

    def near(
        self, load_N: float, changes: Sequence[tuple[float, float]], share: float
    ) -> list[NormalCurve]:
        """Return the curves after other first loadings, each as this one by factors.

        The factors of approach, withdrawal and loss are those where a share of the load is gone: of
        one sphere they are so at any share, as its curve keeps its form. They are ratios to the
        same at the load as it is, so what the pixels do to both is not in them.

        What hardly yields under the load is elastic, and was loaded along the curve on which it
        unloads: that costs no solution. Else each change costs two on the contact alone, and what
        would touch under more load at times one more.

        Parameters
        ----------
        load_N : float
            That is known.
        changes : sequence of (float, float)
            Factors on that load and on the hardness.
        share : float
            Of the load.

        Raises
        ------
        ContactError
            If a solution fails, or the spring in series leaves nothing of a withdrawal.
        """
        solved = replace(self, as_solved=True)  # as what is solved anew
        unloading = solved.unloading(load_N)
        share = min(max(share, SMALL_SLIP, unloading.smallest_drop_N / load_N), NEARLY_ALL)
        known = [of_load <= 1.0 and self._hardly_yields(load_N, H) for of_load, H in changes]
        others = [one for one, below in zip(changes, known, strict=True) if not below]
        anew = iter(solved._anew(load_N, others, share) if others else ())
        ratios = [
            solved._ratios_below(load_N, of_load, share) if below else next(anew)
            for (of_load, _), below in zip(changes, known, strict=True)
        ]
        return [
            ScaledCurve(self, of_load, *map(float, each))
            for (of_load, _), each in zip(changes, ratios, strict=True)
        ]

    def _hardly_yields(self, load_N: float, of_hardness: float) -> bool:
        """Tell whether next to none of a load rests on points at the hardness, or part of it."""
        if self.first is None:
            return True
        hardness_Pa = min(of_hardness, 1.0) * self.first.face.hardness_Pa
        return hardly_yields(self.pressed(load_N), hardness_Pa)

    def _anew(self, load_N: float, changes: list[tuple[float, float]], share: float) -> np.ndarray:
        """Return factors of approach, withdrawal and loss after other loadings, shape (n, 3).

        Refined points beside more contact are other ones: then the known state is solved on them.
        """
        pressed, punch = self.pressed(load_N), self.solutions.punch(load_N)
        first = self.loaded_first_to(load_N)
        finest = self.unloading(load_N).refinement
        again = [] if finest == 1 else [(1.0, 1.0)]
        states = nearby(first, pressed, punch, [*again, *changes], share, finest)
        known = [self._seen(load_N, 1.0, one) for one in states[: len(again)]]
        found = []
        for (of_load, _), one in zip(changes, states[len(again) :], strict=True):
            at = max(one.share, share)
            base = known[0] if known else self._below(load_N, 1.0, at)
            seen = self._seen(load_N, of_load, one)
            if at > one.share:
                seen = self._further(load_N, of_load, at, one.share, seen)
            found.append(self._relative(np.array((base, seen)))[0])
        return np.array(found)

    def _seen(self, load_N: float, of_load: float, one: Nearby) -> tuple[float, float, float]:
        """Return approach, withdrawal and loss of a state, with the spring in series."""
        spring_m = self.compliance_m_per_N * of_load * load_N
        return one.approach_m + spring_m, one.withdrawal_m + one.share * spring_m, one.loss_J

    def _further(
        self,
        load_N: float,
        of_load: float,
        share: float,
        known_share: float,
        seen: tuple[float, float, float],
    ) -> tuple[float, float, float]:
        """Return what is seen under more load where a share goes, beyond that of the known one."""
        d, x, L = seen
        s = of_load * load_N * np.array([known_share, share])
        approach_m, more_s = float(self.approach_m(load_N)), s[1] - s[0]
        more_x = float(self.withdrawal_m(approach_m, more_s))
        more_L = float(self.loss_integral_at_drop_J(approach_m, more_s))
        # As in `_below`: L_2 = L_1 + L_12 - 4 (s_2 x_1 - s_1 x_2)
        return d, x + more_x, L + more_L - 4.0 * (s[1] * x - s[0] * (x + more_x))

    def _ratios_below(self, load_N: float, of_load: float, share: float) -> np.ndarray:
        """Return the same of an elastic face under less load, shape (3,)."""
        both = [self._below(load_N, one, share) for one in (1.0, of_load)]
        return self._relative(np.array(both))[0]

    def _relative(self, found: np.ndarray) -> np.ndarray:
        """Return what was found over its first row, without it."""
        if not (found > 0.0).all():
            raise ContactError(f"{self.model}: nothing is left of a withdrawal without the bulk")
        return np.asarray(found[1:] / found[0])

    def _below(self, load_N: float, of_load: float, share: float) -> tuple[float, float, float]:
        """Return approach, withdrawal and loss of an elastic face where a share of less load goes.

        From drops s, withdrawals x and losses L of two places on its curve: L = 4 s x - 8 integral
        of x ds, so that from one to the other it is L_2 - L_1 + 4 (s_2 x_1 - s_1 x_2).
        """
        d = float(self.approach_m(load_N))
        s = load_N * np.array([1.0 - of_load, 1.0 - of_load * (1.0 - share)])
        x, L = self.withdrawal_m(d, s), self.loss_integral_at_drop_J(d, s)
        return d - x[0], x[1] - x[0], L[1] - L[0] + 4.0 * (s[1] * x[0] - s[0] * x[1])

    def problems(self, load_N: float) -> tuple[Problem, ...]:
        """Return where pixels end, notes, as `error_of_map` measures it, and where the map does."""
        pressed, unloading, found = self.pressed(load_N), self.unloading(load_N), []
        least = MIN_PIXELS_ACROSS if unloading.refinement == 1 else MIN_REFINED_ACROSS
        if pressed.pixels_across < least:
            message = (
                f"half of the load rests on contacts of at most {pressed.pixels_across:.1f} pixels "
                f"across; {least:g} are enough for any shape"
            )
            found.append(Problem("under_resolved", "info", message))
        share = unloading.smallest_drop_N / unloading.load_N
        message = (
            f"below {percent(share)} of the force at gross slip, less slips than the pixels of the "
            "map resolve: the energy per cycle may be off by more than 5 %, and follows the cube "
            "of the force in the end"
        )
        found.append(Problem("small_slip_extrapolated", "info", message))
        found += self._of_first_touch(pressed, unloading)
        at_holes = load_at_holes(pressed, self.solutions.face.measured)
        if at_holes > AT_HOLES:
            message = (
                f"{at_holes:.0%} of the preload rests on contacts that go on in a hole of the map: "
                "what lies there would carry, too, and is not counted"
            )
            effect = Effect(at_holes, at_holes, at_holes)
            found.append(Problem("contact_at_hole", "warning", message, effect))
        if unloading.cut_short:
            off = unloading.loss_error
            message = (
                f"{unloading.spent_s:.2g} s of the {self.solutions.time_limit_s:g} s of "
                f"contact.time_limit_s were spent after {len(unloading.solved_load_N) - 1} loads "
                f"below the preload: between them the energy per cycle may be off by {off:.1%}"
            )
            if self.solutions.leaves_none(unloading):
                message += ", and what the finest detail of the map decides is not known"
            more = more_time(pressed.gap_m.shape, self.solutions.time_limit_s)
            of = Effect(None, off, off), more
            found.append(Problem("time_limit_reached", "warning", message, *of))
        return tuple(found)

    def _of_first_touch(self, pressed: Pressed, unloading: Unloading) -> list[Problem]:
        """Return whether a spline to the edge of the map stands higher than where d counts from."""
        face, higher_m = self.solutions.face, unloading.approach_m - pressed.approach_m
        bulk_m = bulk_of_face_m_per_N(face, face.E_star_Pa) * pressed.load_N
        if abs(higher_m) <= HIGHER * (pressed.approach_m - bulk_m):
            return []
        message = (
            f"between its pixels, and from the outermost of them to its edge, the face stands "
            f"{higher_m:.2g} m higher than at the highest pixel, from which the approach of "
            f"{pressed.approach_m:.3g} m counts; stiffness and energy do not"
        )
        return [Problem("first_touch_decides", "info", message)]

    def least_share(self, load_N: float) -> float:
        """Return the least share of mu N that pixels resolve: asked below it, a warning says so."""
        return self.unloading(load_N).smallest_drop_N / load_N

    def load_N(self, approach_m: ArrayLike) -> np.ndarray:
        """N(d); one solution for each approach that was not met before."""
        d = np.asarray(approach_m, dtype=float)
        levels, where = np.unique(d, return_inverse=True)
        return np.array([self._load_at(level) for level in levels.tolist()])[where].reshape(d.shape)

    def approach_m(self, load_N: ArrayLike) -> np.ndarray:
        """d(N); more than a few loads at once are interpolated between solved ones (to 2e-4).

        Raises
        ------
        ContactError
            If a solution is not found.
        """
        load = np.asarray(load_N, dtype=float)
        if not np.all((load >= 0) & (load < np.inf)):
            raise SettingsError(
                f"load_N: got {load.min():g} to {load.max():g}; expected loads >= 0"
            )
        approach = np.zeros(load.shape)
        loaded = load > 0
        if loaded.any():
            approach[loaded] = self.solutions.approach_under(load[loaded])
        return approach + self.compliance_m_per_N * load

    def lift_off_m(self, approach_m: ArrayLike) -> np.ndarray:
        """Withdrawal at which each contact region at one approach loses its load, shape (n,)."""
        load_N = self._load_at(_single(approach_m))
        if load_N == 0:
            return np.zeros(0)
        unloading = self.unloading(load_N)
        lift_off_m = unloading.region_lift_off_m
        drop_N = _proportional(lift_off_m, unloading.withdrawal_m, unloading.load_drop_N)
        return lift_off_m + self.compliance_m_per_N * drop_N

    def lifted(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Whether each contact region at one approach has lost its load, shape (..., n)."""
        e = np.asarray(withdrawal_m, dtype=float)
        return np.asarray(np.abs(e)[..., None] >= self.lift_off_m(approach_m))

    def stiffness_N_per_m(self, approach_m: ArrayLike, withdrawal_m: ArrayLike = 0.0) -> np.ndarray:
        """N'(d - e); at e = 0 that of the pixels in contact, else of the unloading."""

        def stiffness(load_N: float, e: np.ndarray) -> np.ndarray:
            from_N = self.solutions.unloads_from_N(load_N)
            if from_N == load_N and not e.any():
                return np.full(e.shape, self._with_spring(self._stiffness_at(load_N)))
            unloading = self.unloading(from_N)
            x, total = unloading.withdrawal_m, self._withdrawals(unloading)
            e = e + _proportional(np.array(from_N - load_N), unloading.load_drop_N, total)
            slope = np.gradient(unloading.load_drop_N, x)
            log_e = np.log(np.maximum(e, 1e-300))
            at = np.interp(log_e, np.log(total), slope, left=unloading.stiffness_N_per_m)
            return np.where(e < total[-1], self._with_spring(at), 0.0)

        return self._each(approach_m, withdrawal_m, stiffness)

    def load_drop_N(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """N(d) - N(d - e)."""

        def drop(load_N: float, e: np.ndarray) -> np.ndarray:
            unloading = self.unloading(load_N)
            total = self._withdrawals(unloading)
            part = _proportional(np.minimum(e, total[-1]), total, unloading.load_drop_N)
            return np.where(e < total[-1], part, load_N)

        return self._each(approach_m, withdrawal_m, drop)

    def withdrawal_m(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Withdrawal for a load drop of at most N(d)."""

        def withdrawal(load_N: float, drop_N: np.ndarray) -> np.ndarray:
            unloading = self.unloading(load_N)
            return _proportional(drop_N, unloading.load_drop_N, self._withdrawals(unloading))

        return self._each(approach_m, load_drop_N, withdrawal)

    def loss_integral_J(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """4 * integral of s (e - s) N''(d - s)."""

        def beyond(load_N: float, e: np.ndarray) -> np.ndarray:
            total_m = self._withdrawals(self.unloading(load_N))[-1]
            return 4 * load_N * np.maximum(e - total_m, 0.0)

        drop_N = self.load_drop_N(approach_m, withdrawal_m)
        partial = self.loss_integral_at_drop_J(approach_m, drop_N)
        return partial + self._each(approach_m, withdrawal_m, beyond)

    def loss_integral_at_drop_J(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Return the same for a load drop of at most N(d)."""

        def loss(load_N: float, drop_N: np.ndarray) -> np.ndarray:
            unloading = self.unloading(load_N)
            return _proportional(drop_N, unloading.load_drop_N, unloading.loss_J, power=3)

        return self._each(approach_m, load_drop_N, loss)

    def _load_at(self, approach_m: float) -> float:
        """Return N(d), from y + c N(y) = d with the approach y of the face alone.

        All its solutions share one time limit, which counts for the load that is found.
        """
        c, begun_s = self.compliance_m_per_N, thread_time()
        if approach_m <= 0:
            return 0.0
        for load_N, level_m in self.solutions.approach_m.items():
            if abs(level_m + c * load_N - approach_m) <= 1e-13 * approach_m:
                return load_N
        level_m, before, slope = approach_m, None, 0.0
        for _ in range(50):
            pressed = self.solutions.press_to(level_m, thread_time() - begun_s)
            excess_m = level_m + c * pressed.load_N - approach_m
            # What comes no nearer is as near as the solver tells
            told_m = self.solutions.tolerance * pressed.approach_m
            no_nearer = before is not None and abs(before[1]) <= abs(excess_m) <= told_m
            if abs(excess_m) <= 1e-9 * approach_m or no_nearer:
                self.solutions.count(pressed.load_N, thread_time() - begun_s)
                return pressed.load_N
            if before is None:  # that of the pixels is near enough, and costs one solution
                stiffness = self._stiffness_of_pixels(pressed.load_N)
                slope = stiffness / self._with_spring(stiffness)
            elif excess_m != before[1]:  # N(y) is convex: secants come from one side
                slope = (excess_m - before[1]) / (level_m - before[0])
            before = level_m, excess_m
            level_m -= excess_m / slope
        raise ContactError(
            f"{self.solutions.face.name}: no load found at an approach of {approach_m:g} m"
        )

    def _stiffness_at(self, load_N: float) -> float:
        """Return the stiffness of the face alone."""
        if (of_metal := self._of_metal(load_N)) is not None:
            return of_metal[1].stiffness_N_per_m
        if load_N in self.solutions.unloading:
            return self.solutions.unloading[load_N].stiffness_N_per_m
        pressed = self.pressed(load_N)
        if refinement(self.solutions.face, pressed) > 1:
            return self.unloading(load_N).stiffness_N_per_m
        return self._stiffness_of_pixels(load_N)

    def _stiffness_of_pixels(self, load_N: float) -> float:
        return float(self.solutions.punch(load_N).sum()) * self.solutions.face.pixel_area_m2

    def _with_spring(self, stiffness_N_per_m: Any) -> Any:
        """Return the stiffness with the spring in series, which must leave it positive."""
        slope = 1 + self.compliance_m_per_N * stiffness_N_per_m
        if np.any(slope <= 0):
            raise ContactError(
                f"{self.model}: the compliance in series is {self.compliance_m_per_N:g} m/N; "
                f"expected more than {-1 / np.max(stiffness_N_per_m):g} m/N, what the face itself "
                "yields, or the approach would fall with growing load; keep the bulk term"
            )
        return stiffness_N_per_m / slope

    def _withdrawals(self, unloading: Unloading) -> np.ndarray:
        """Return the withdrawals of the table, with the spring in series."""
        self._with_spring(unloading.stiffness_N_per_m)
        return unloading.withdrawal_m + self.compliance_m_per_N * unloading.load_drop_N

    def _each(
        self,
        approach_m: ArrayLike,
        other: ArrayLike,
        function: Callable[[float, np.ndarray], np.ndarray],
    ) -> np.ndarray:
        """Call a function of load and array once for each approach; zero without load."""
        d, values = np.broadcast_arrays(
            np.asarray(approach_m, dtype=float), np.asarray(other, dtype=float)
        )
        result = np.zeros(d.shape)
        for level in np.unique(d).tolist():
            load_N = self._load_at(level)
            if load_N > 0:
                here = d == level
                result[here] = function(load_N, values[here])
        return result


def _proportional(x: np.ndarray, xs: np.ndarray, ys: np.ndarray, power: int = 1) -> np.ndarray:
    """Interpolate y(x) between growing rows, which it never leaves; below the first as x^power."""
    within = np.maximum(x, xs[0])
    y = np.exp(np.interp(np.log(within), np.log(xs), np.log(ys)))
    return np.asarray(y * (x / within) ** power)


def _single(approach_m: ArrayLike) -> float:
    if np.ndim(approach_m) != 0:
        raise SettingsError(
            f"approach_m: got an array of shape {np.shape(approach_m)}; expected one number: the "
            "contact regions differ from approach to approach"
        )
    return float(np.asarray(approach_m))
