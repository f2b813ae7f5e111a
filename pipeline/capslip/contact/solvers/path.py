"""A pressed height map at falling loads, each solved from its neighbours."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from time import thread_time

import numpy as np

from capslip.contact.solvers.losses import rates_per_m
from capslip.contact.solvers.metal import first_loading
from capslip.contact.solvers.patches import PatchedFace, Spline
from capslip.contact.solvers.pixels import around_contact, fewer, in_contact_alone
from capslip.contact.solvers.polonsky_keer import (
    ElasticFace,
    Pressed,
    press,
    punch,
)
from capslip.contact.solvers.refinement import refinement, spline_of, touches_between
from capslip.contact.solvers.starts import Known, start_Pa
from capslip.contact.solvers.tilting import press_about

FINEST = 1e-11  # tolerance of a solution, above rounding
_SHRUNK = 0.6  # of the points of a face, that are left where one of fewer points is sought
_LEFT, _LOOSEST = 3e-2, 1e-6  # of the loss, that gaps may be; tolerance that is enough for any
# Withdrawals, over that of the last contact, between which exact solutions tell no loss any more
CLOSEST = (8.0 * FINEST / _LEFT) ** (1 / 3)
_OFF = 1e-6  # of the approach: gaps that are left under the preload, and are taken for heights
_TRIED = 1e-3  # tolerance of a state that tells where a refined contact ends
_ROUGHLY = 1e-4  # tolerance of a punch
_FURTHER = 4  # pixels that a contact at the end of a patch is first taken to go on
_UNSETTLED = 1e-3  # of the loss: the most that a solution may leave open
# Relative error of the loss of a region times the square of the width, in longer sides of a pixel,
# of the ring that left it; seen on spheres for rings of 0.3 to 2.7 pixels
_RING_ERROR = 0.015


@dataclass(frozen=True, eq=False)
class Node:
    """One solved load, seen from the preload."""

    odd: float
    load_N: float
    withdrawal_m: float
    region_load_N: np.ndarray
    region_loss_J: np.ndarray
    region_least_gap_m: np.ndarray
    pixel_error: float  # relative, that pixels leave in the loss of the face
    contact: np.ndarray
    pressure_Pa: np.ndarray  # of the pixels in contact


class Path:
    """Solutions below a preload, each started from its neighbours."""

    def __init__(
        self,
        face: ElasticFace,
        pressed: Pressed,
        tolerance: float,
        on_patches: bool,
        punch_Pa_per_m: np.ndarray | None = None,  # of the map, where it is known
        around: PatchedFace | None = None,  # from `around_contact`, where it is known
        most: float = math.inf,  # points along the longer side of a pixel
        until_s: float = math.inf,  # of `thread_time`, when a solution is given up
        other: bool = False,  # whether what lies between smooth pixels is another guess
    ) -> None:
        region = pressed.region
        self.map, self.map_pressed, self.patches, self.until_s = face, pressed, None, until_s
        if on_patches:
            given = around, most, until_s, other
            self.patches, face, pressed, region = _on_patches(face, pressed, *given)
        at = np.flatnonzero(pressed.pressure_Pa)
        pressure_Pa = pressed.pressure_Pa.reshape(-1)[at]
        # Gaps that are left are taken for heights: of a face all but the same the state is exact,
        # from which the loss at small slip is a small difference
        face = in_contact_alone(face, pressed.pressure_Pa)
        left_m = face.half_space.sinking_m(pressure_Pa) + face.depth_m - pressed.approach_m
        self.face, self.tolerance = replace(face, depth_m=face.depth_m - left_m), tolerance
        yielded = None if pressed.yielded is None else pressed.yielded.reshape(-1)[at]
        none_m = np.zeros(len(at))
        self.pressed = replace(pressed, pressure_Pa=pressure_Pa, gap_m=none_m, yielded=yielded)
        # A region may be gone where the solution is finer than that of the preload.
        self.left, self.region = np.unique(region.reshape(-1)[at] - 1, return_inverse=True)
        self.n_regions, self.n_points = len(self.left), len(at)
        self.n_pixels = self._sums(np.ones(self.n_points))
        self.region_load_N = self.region_loads_N(pressure_Pa)
        # Slopes of the withdrawals t_i, which the first solved load would give less well.
        start = None if punch_Pa_per_m is None else self.face.gathered(punch_Pa_per_m)
        found = punch(self.face, self.pressed, start, _ROUGHLY)
        self.punch_Pa_per_m = found.pressure_Pa
        # What is left of its gaps counts twice: then its sum is off by the square of what it is
        stiffness = self._sums(found.pressure_Pa * (1.0 - found.gap_m)) * face.pixel_area_m2
        self.stiffness_N_per_m = float(stiffness.sum())
        self.slope_per_m = stiffness / self.region_load_N / 1.5
        self.nodes: list[Node] = []
        self._faces = [(np.arange(self.n_points), self.face)]  # fewer and fewer points

    def _sums(self, values: np.ndarray) -> np.ndarray:
        """Sum values at the points over the regions."""
        return np.bincount(self.region, weights=values, minlength=self.n_regions)

    def region_loads_N(self, pressure_Pa: np.ndarray) -> np.ndarray:
        """Return the loads of the regions, shape (n_regions,), of pressures at the points."""
        return self._sums(pressure_Pa) * self.face.pixel_area_m2

    def solve(self, odd: float) -> Node:
        """Solve at a withdrawal t with log(t / (1 - t)) = odd of a single Hertz contact."""
        load_N = self.pressed.load_N * (1 + np.exp(odd)) ** -1.5
        # The loss is about t^3 / 8 of load times approach, to which the tolerance refers: a
        # solution that only fulfils the tolerance may not have moved the edges of the contacts.
        # Nor from those of its neighbour, where that is near. Gaps that it leaves count times the
        # pressure that is gone alone: a tenth of a thousandth of the loss at most was seen.
        t, *others = 1 / (1 + np.exp(-np.array([odd, *(node.odd for node in self.nodes)])))
        apart = min([t, *np.abs(np.subtract(others, t)).tolist()])
        tolerance = min(max(self.tolerance, _LOOSEST), max(_LEFT * apart**3 / 8, FINEST))
        state = self._press(load_N, tolerance, self.start_Pa(load_N))
        node = self._node(odd, state)
        # A pixel that is about to let go may keep a wide gap under next to no pressure, and a start
        # that is good enough at once tells no more than the loads beside it.
        open_J = self._open_J(state)
        unsolved = (
            state.certificate.iterations == 0 or open_J > _UNSETTLED * node.region_loss_J.sum()
        )
        if tolerance > FINEST and unsolved:
            near_Pa = state.pressure_Pa
            state = self._press(load_N, FINEST, near_Pa)
            node = self._node(odd, state)
        self.nodes = sorted([*self.nodes, node], key=lambda each: each.withdrawal_m)
        return node

    def _press(self, load_N: float, tolerance: float, start_Pa: np.ndarray) -> Pressed:
        """Return the state under a load, solved on the points that touched under a larger one.

        All points that touch under the preload have their gap from its pressures in the end, and
        where one of them was left out wrongly, all of them are solved.
        """
        points, face = self._fewer(load_N)
        if face is not self.face:
            left_s, begin_Pa = self.until_s - thread_time(), start_Pa[points]
            state = press(
                face,
                load_N=load_N,
                tolerance=tolerance,
                start_Pa=begin_Pa,
                time_limit_s=left_s,
            )
            start_Pa = np.zeros(self.n_points)
            start_Pa[points] = state.pressure_Pa
            gap_m = self.face.half_space.sinking_m(start_Pa) + self.face.depth_m
            gap_m -= state.approach_m
            out = np.ones(self.n_points, dtype=bool)
            out[points] = False
            if np.min(gap_m, where=out, initial=np.inf) > -tolerance * state.approach_m:
                return replace(state, pressure_Pa=start_Pa, gap_m=gap_m)
        left_s = self.until_s - thread_time()
        return press(
            self.face,
            load_N=load_N,
            tolerance=tolerance,
            start_Pa=start_Pa,
            time_limit_s=left_s,
        )

    def _fewer(self, load_N: float) -> tuple[np.ndarray, PatchedFace]:
        """Return the points to solve on, and their face."""
        above = [node for node in self.nodes if node.load_N >= load_N]
        if not above:
            return self._faces[0]
        contact = above[-1].contact
        left = np.zeros(self.n_points, dtype=bool)
        left[contact] = True
        n_left = len(contact)
        holding = [one for one in self._faces if np.count_nonzero(left[one[0]]) == n_left]
        points, face = min(holding, key=lambda one: len(one[0]))
        if len(contact) < _SHRUNK * len(points):
            found = fewer(face, np.searchsorted(points, contact))
            if found is not None:
                points, face = contact, found
                self._faces.append((points, face))
        return points, face

    def at(self, share: float) -> Node:
        """Solve where a share of the load is gone."""
        return self.solve(math.log((1 - share) ** (-2 / 3) - 1))

    @cached_property
    def end(self) -> Node:
        """The state without load, which needs no solution: the gaps are the depths."""
        zero, depth_m = np.zeros(self.n_points), self.face.depth_m
        return self._seen(np.inf, 0.0, self.pressed.approach_m, zero, depth_m)

    def rates_per_m(self, nodes: list[Node]) -> np.ndarray:
        """Return the withdrawals of the regions, see `losses.rates_per_m`."""
        share = np.array([node.region_load_N for node in nodes]) / self.region_load_N
        gap_m = np.array([node.region_least_gap_m for node in nodes])
        return rates_per_m(np.array([node.withdrawal_m for node in nodes]), share, gap_m)

    def patch_error(self) -> float:
        """Return the worst gap, over the approach, that the whole map finds in the patches.

        Of the preload's own pressures, and of penetration anywhere at a quarter less.
        """
        patches = self.patches
        if patches is None or patches.refinement > 1:
            return 0.0
        preload = self.map_pressed
        sinking_m = patches.half_space.sinking_m(patches.gathered(preload.pressure_Pa))
        gap_m = sinking_m + patches.depth_m - preload.approach_m
        error = float(np.abs(gap_m - patches.gathered(preload.gap_m))[patches.measured].max())
        below = min(self.nodes, key=lambda node: abs(node.load_N / preload.load_N - 0.75))
        pressure_Pa = self.face.spread(self.known(below).pressure_Pa)
        gap_m = self.map.half_space.sinking_m(pressure_Pa) + self.map.depth_m
        gap_m -= self.pressed.approach_m - below.withdrawal_m
        out = self.map.measured & (pressure_Pa == 0)
        error = max(error, -float(np.min(gap_m, where=out, initial=np.inf)))
        return error / preload.approach_m

    def start_Pa(self, load_N: float) -> np.ndarray:
        """Return pressures near those under a load, from the solved loads around it."""
        k = sum(node.load_N >= load_N for node in self.nodes)
        below = self.known(self.nodes[k] if k < len(self.nodes) else self.end)
        preload = Known(0.0, self.pressed.pressure_Pa)
        above = self.known(self.nodes[k - 1]) if k > 0 else preload
        before = self.known(self.nodes[k - 2]) if k > 1 else preload
        total_Pa = load_N / self.face.pixel_area_m2
        return start_Pa(total_Pa, before if k > 0 else self.punch_Pa_per_m, above, below)

    def known(self, node: Node) -> Known:
        """Return withdrawal and pressures of a node, at all points."""
        pressure_Pa = np.zeros(self.n_points)
        pressure_Pa[node.contact] = node.pressure_Pa
        return Known(node.withdrawal_m, pressure_Pa)

    def _open_J(self, state: Pressed) -> float:
        """Return the loss of the gaps that a solution leaves under pressure."""
        gone_Pa = np.where(state.pressure_Pa > 0, self.pressed.pressure_Pa - state.pressure_Pa, 0.0)
        return abs(float(4 * gone_Pa @ state.gap_m * self.face.pixel_area_m2))

    def _node(self, odd: float, state: Pressed) -> Node:
        withdrawal_m = self.pressed.approach_m - state.approach_m
        return self._seen(odd, state.load_N, withdrawal_m, state.pressure_Pa, state.gap_m)

    def _seen(
        self,
        odd: float,
        load_N: float,
        withdrawal_m: float,
        pressure_Pa: np.ndarray,
        gap_m: np.ndarray,
    ) -> Node:
        """Integrate loads, losses and least gaps over the regions of the preload."""
        area_m2 = self.face.pixel_area_m2
        # Complementarity makes the residual gaps in contact zero.
        open_m = np.where(pressure_Pa > 0, 0.0, np.maximum(gap_m, 0.0))
        lost = self.pressed.pressure_Pa * open_m
        loss_J = 4 * self._sums(lost) * area_m2
        left = self._sums(pressure_Pa == 0)
        perimeter = 2 * np.sqrt(np.pi * self.n_pixels)
        longer_m, shorter_m = sorted(self.face.pixel_size_m, reverse=True)
        error_J = loss_J * _RING_ERROR * longer_m / shorter_m
        error_J *= np.square(perimeter / np.maximum(left, 1))
        least_gap_m = np.full(len(loss_J), np.inf)
        np.minimum.at(least_gap_m, self.region, gap_m)
        contact = np.flatnonzero(pressure_Pa)
        return Node(
            odd,
            load_N,
            withdrawal_m,
            self.region_loads_N(pressure_Pa),
            loss_J,
            np.maximum(least_gap_m, 0.0),
            float(np.linalg.norm(error_J) / loss_J.sum()) if loss_J.any() else np.inf,
            contact,
            pressure_Pa[contact],
        )


def _on_patches(
    face: ElasticFace,
    pressed: Pressed,
    around: PatchedFace | None,
    most: float,
    until_s: float,
    other: bool,
) -> tuple[PatchedFace | None, ElasticFace, Pressed, np.ndarray]:
    """Return patches around the contact, and face, state and regions under the preload on them.

    None, and those of the map, where that is no more work. Where a refined contact goes on at the
    end of a patch, that was too small.
    """
    finest, contact, further = refinement(face, pressed), pressed.region > 0, _FURTHER
    spline: Spline = "third"
    finest = int(min(finest, most))
    if finest > 1:  # its points may find a contact that no pixel of the map has
        contact, around = contact | touches_between(face, pressed), None
        spline = spline_of(face, pressed)
        spline = "other" if other and spline == "fifth" else spline
    patches = around or around_contact(face, contact, finest, spline=spline)
    near_Pa = pressed.pressure_Pa
    while patches is not None:
        begin_Pa = patches.gathered(near_Pa)
        for tolerance in (_OFF,) if patches.refinement == 1 else (_TRIED, _OFF):
            turned, state = _state_on(patches, pressed, tolerance, begin_Pa, until_s)
            begin_Pa, ends = state.pressure_Pa, _at_ends(patches, state)
            if len(ends):
                break
        else:
            if not math.isinf(turned.hardness_Pa):  # as it was before it yielded
                turned, state = first_loading(turned, state)
            elif pressed.yielded is not None:  # the points of the map, as it left them
                yielded, most_Pa = patches.gathered(pressed.yielded), pressed.bounded_Pa
                state = replace(state, yielded=yielded, bounded_Pa=most_Pa)
            return patches, turned, state, _regions(patches, pressed)
        contact, further = _with(contact, ends, further), 2 * further
        near_Pa = patches.spread(begin_Pa)
        patches = around_contact(face, contact, finest, spline=spline)
    return None, face, pressed, pressed.region


def _at_ends(patches: PatchedFace, pressed: Pressed) -> np.ndarray:
    """Return the pixels that touch at the ends of refined patches, off the edge of the map.

    Flat indices; none of unrefined patches, which hold all that touches on the map.
    """
    touching = patches.parent[pressed.pressure_Pa > 0]
    if patches.refinement == 1:
        return touching[:0]
    known = np.zeros(patches.map_shape, dtype=bool)
    known.reshape(-1)[patches.parent] = True
    known = np.pad(known, 1, constant_values=True)
    touching = np.unique(touching)
    y, x = np.divmod(touching, patches.map_shape[1])
    around = [known[y + i, x + j] for i in range(3) for j in range(3)]
    return touching[~np.all(around, axis=0)]


def _with(contact: np.ndarray, ends: np.ndarray, pixels: int) -> np.ndarray:
    """Return a contact, bool (ny, nx), that goes on by some pixels at its ends."""
    from scipy.ndimage import binary_dilation

    more = np.zeros_like(contact)
    more.reshape(-1)[ends] = True
    return np.asarray(contact | binary_dilation(more, iterations=pixels))


def _state_on(
    patches: PatchedFace, pressed: Pressed, tolerance: float, start_Pa: np.ndarray, until_s: float
) -> tuple[ElasticFace, Pressed]:
    """Return the patches and their state under the preload.

    A face in balance turns once more where it is refined: contacts that end at the edge of the map
    reach half a pixel further, and bear more.
    """
    load_N, left_s = pressed.load_N, until_s - thread_time()
    if pressed.turns and patches.refinement > 1:
        return press_about(patches, load_N, pressed.resultant_m, tolerance, start_Pa, left_s)
    return patches, press(
        patches, load_N=load_N, tolerance=tolerance, start_Pa=start_Pa, time_limit_s=left_s
    )


def _regions(patches: PatchedFace, pressed: Pressed) -> np.ndarray:
    """Return the contact region of each point; a refined one off them counts to the nearest."""
    from scipy.ndimage import distance_transform_edt

    region = pressed.region
    if patches.refinement > 1:
        nearest = distance_transform_edt(region == 0, return_distances=False, return_indices=True)
        region = region[tuple(nearest)]
    return patches.gathered(region)
