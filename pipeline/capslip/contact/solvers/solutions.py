"""What was solved on one map already, for all that is asked of its normal curve."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from time import thread_time

import numpy as np

from capslip.contact.solvers.patches import PatchedFace
from capslip.contact.solvers.pixels import around_contact, on_contact
from capslip.contact.solvers.polonsky_keer import (
    ElasticFace,
    Pressed,
    press,
    punch_pressure_Pa_per_m,
)
from capslip.contact.solvers.starts import Known, start_Pa
from capslip.contact.solvers.unloading import Unloading, unload
from capslip.errors import OutOfTimeError

_SOLVED_ONE_BY_ONE = 8  # loads; more are interpolated
_ROUGHLY = 1e-4  # tolerance of tractions
_KEPT = 3  # pressure maps in memory
_SMALL = 4_000_000  # numbers, of what is kept of a contact
_ROUNDING = 1e-13  # of a load


@dataclass(eq=False)
class Solutions:
    """What was solved already: curves that differ by a spring in series share it."""

    face: ElasticFace
    tolerance: float
    time_limit_s: float  # of the processor, for each preload
    spent_s: dict[float, float] = field(default_factory=dict)  # of that, by preload
    approach_m: dict[float, float] = field(default_factory=dict)  # by load
    pressed: dict[float, Pressed] = field(default_factory=dict)  # by load, the first and the last
    unloading: dict[float, Unloading] = field(default_factory=dict)  # by preload
    punch_Pa_per_m: dict[float, np.ndarray] = field(default_factory=dict)  # by load, the last
    around: tuple[Pressed, PatchedFace | None] | None = None  # a state, and what holds its contact
    alone: tuple[Pressed, PatchedFace, Pressed] | None = None  # a state, and what touches in it
    as_pixels: bool = False  # whether slip is followed no closer than pixels tell, see `unload`
    force_shares: tuple[float, ...] = ()  # of mu N, at which alone slip is asked for; none: at any

    def left_s(self, load_N: float) -> float:
        """Return the seconds of the time limit that are left for a preload."""
        return max(self.time_limit_s - self.spent_s.get(load_N, 0.0), 0.0)

    def leaves_none(self, unloading: Unloading) -> bool:
        """Tell whether the loads below a preload, cut short, left no time for its detail."""
        return unloading.cut_short and unloading.spent_s >= self.time_limit_s

    @contextmanager
    def counted(self, load_N: float) -> Iterator[None]:
        """Count what is done inside as done for a preload."""
        begun_s = thread_time()
        try:
            yield
        finally:
            self.count(load_N, thread_time() - begun_s)

    def count(self, load_N: float, seconds: float) -> None:
        """Count seconds of the processor as spent for a preload."""
        self.spent_s[load_N] = self.spent_s.get(load_N, 0.0) + seconds

    def press(self, load_N: float) -> Pressed:
        """Return the state under a load, solved from a neighbouring one where there is one."""
        if load_N not in self.pressed:
            near = [N for N in self.pressed if 0.8 * load_N < N < 1.25 * load_N]
            start_Pa = self.pressed[near[0]].pressure_Pa if near else None
            with self.counted(load_N):
                pressed = press(
                    self.face,
                    load_N=load_N,
                    tolerance=self.tolerance,
                    start_Pa=start_Pa,
                    time_limit_s=self.left_s(load_N),
                )
            if self.pressed:  # its tilt is that of the pixels: finer points find theirs
                pressed = replace(pressed, turns=next(iter(self.pressed.values())).turns)
            self.keep(pressed)
        return self.pressed[load_N]

    def punch(self, load_N: float) -> np.ndarray:
        """Return dp/dd under a load, shape (ny, nx), see `punch_pressure_Pa_per_m`."""
        if load_N not in self.punch_Pa_per_m:
            pressed = self.press(load_N)
            with self.counted(load_N):
                face, on_face = self._on_contact(pressed, single=False)
                found = face.spread(punch_pressure_Pa_per_m(face, on_face))
            self.punch_Pa_per_m = {load_N: found}
        return self.punch_Pa_per_m[load_N]

    def tractions(self, load_N: float, later: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the pressures of a punch and those that go with a part of the load, as maps.

        The second to a thousandth: they are asked for where slip goes to, not for its energy.
        """
        pressed, punch = self.press(load_N), self.punch(load_N)
        with self.counted(load_N):
            face, on_face = self._on_contact(pressed, single=True)
            above = Known(0.0, on_face.pressure_Pa)
            end = Known(pressed.approach_m, np.zeros(face.shape))
            total_Pa = later * load_N / face.pixel_area_m2
            begin_Pa = start_Pa(total_Pa, face.gathered(punch), above, end)
            left = press(
                face,
                load_N=later * load_N,
                tolerance=_ROUGHLY,
                start_Pa=begin_Pa,
                time_limit_s=self.left_s(load_N),
            )
        return punch, np.maximum(pressed.pressure_Pa - face.spread(left.pressure_Pa), 0.0)

    def _on_contact(self, pressed: Pressed, single: bool) -> tuple[PatchedFace, Pressed]:
        """Return the points that touch, alone, and their state.

        Those in double precision are kept for the slip, which lets go of large ones (`unload`).
        """
        if self.alone is not None and self.alone[0] is pressed:
            return self.alone[1:]
        around = around_contact(self.face, pressed.pressure_Pa > 0, single=single)
        face, on_face = on_contact(self.face, pressed, around)
        if not single:
            self.around, self.alone = (pressed, around), (pressed, face, on_face)
        return face, on_face

    def press_to(self, approach_m: float, spent_s: float) -> Pressed:
        """Return the state at an approach, after some seconds of the time limit are spent on it.

        Raises
        ------
        OutOfTimeError
            If the limit is over.
        """
        limit_s, tolerance = self.time_limit_s - spent_s, self.tolerance
        # Any solution has some seconds, however many there are
        if spent_s > 0.0 and limit_s <= 0.0:
            raise OutOfTimeError(
                f"{self.face.name}: no load found at an approach of {approach_m:g} m when "
                "contact.time_limit_s was over; allow more, or coarsen the map"
            )
        return self.keep(
            press(self.face, approach_m=approach_m, tolerance=tolerance, time_limit_s=limit_s)
        )

    def unload(self, load_N: float) -> Unloading:
        """Return what happens below a load."""
        if load_N not in self.unloading:
            pressed = self.press(load_N)
            # The other half is for what detail decides, see `error_of_map`
            half_s = 0.5 * self.left_s(load_N)
            known, around = self.around or (None, None)
            with self.counted(load_N):
                found = unload(
                    self.face,
                    pressed,
                    self.tolerance,
                    time_limit_s=half_s,
                    give_up_s=2.0 * half_s,
                    punch_Pa_per_m=self.punch_Pa_per_m.get(load_N),
                    around=around if known is pressed else None,
                    force_shares=self.force_shares,
                    as_pixels=self.as_pixels,
                )
            if around is not None and around.cost > _SMALL:
                self.around = self.alone = None
            found = replace(found, spent_s=self.spent_s[load_N])
            self.unloading[load_N] = found
            pairs = zip(found.solved_load_N.tolist(), found.solved_approach_m.tolist(), strict=True)
            self.approach_m = dict(pairs) | self.approach_m
        return self.unloading[load_N]

    def unloads_from_N(self, load_N: float) -> float:
        """Return the load from which a face came to another one: that of its first loading.

        Finer points are loaded for the first time once more, and would know nothing of a greater
        load than the one they are asked about. All the same where nothing has a hardness.
        """
        first_N = next(iter(self.pressed), load_N)
        return load_N if self.face.before is None else max(first_N, load_N)

    def approach_under(self, load_N: np.ndarray) -> np.ndarray:
        """Return the approach under loads > 0, solved or interpolated between solved ones."""
        load_N = self._as_solved(load_N)
        new = [N for N in np.unique(load_N).tolist() if N not in self.approach_m]
        if len(new) <= _SOLVED_ONE_BY_ONE:
            for N in new:
                self.press(N)
            solved = self.approach_m
            return np.array([solved[N] for N in load_N.ravel().tolist()]).reshape(load_N.shape)
        from scipy.interpolate import PchipInterpolator

        # Both ends, and no two neighbours further apart than a quarter.
        for end in (load_N.max(), load_N.min()):
            if float(end) not in self.approach_m:
                self.press(float(end))
        nodes = np.array([N for N in sorted(self.approach_m) if load_N.min() <= N <= load_N.max()])
        for low, high in pairwise(nodes):
            n_between = int(np.ceil(np.log(high / low) / np.log(1.25) - 1e-9)) - 1
            for N in np.geomspace(high, low, n_between + 2)[1:-1].tolist():
                self.press(N)
        table = np.array(sorted(self.approach_m.items())).T
        curve = PchipInterpolator(*np.log(table))
        return np.exp(np.asarray(curve(np.log(load_N))))

    def _as_solved(self, load_N: np.ndarray) -> np.ndarray:
        """Return loads with those that differ from a solved one by rounding alone as that."""
        if not self.approach_m:
            return load_N
        solved_N = np.array(sorted(self.approach_m))
        place = np.searchsorted(solved_N, load_N * (1.0 - _ROUNDING)).clip(max=len(solved_N) - 1)
        near_N = solved_N[place]
        return np.where(np.abs(near_N - load_N) <= _ROUNDING * load_N, near_N, load_N)

    def keep(self, pressed: Pressed) -> Pressed:
        """Remember a solution, and its approach.

        The first one under a load stays: it was given away, and another start has other roundings.
        """
        self.approach_m.setdefault(pressed.load_N, pressed.approach_m)
        self.pressed[pressed.load_N] = pressed
        while len(self.pressed) > _KEPT:
            _, second, *_ = self.pressed  # the first is that of the preload, asked for to the end
            del self.pressed[second]
        return pressed
