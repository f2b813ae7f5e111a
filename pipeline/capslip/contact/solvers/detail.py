"""What the finest detail of a map and its pixels decide.

The map is pressed and unloaded again, once smoothed, and on fewer points: on coarser refinements
where it was refined, on every other of its pixels where it yielded or its contacts are wide.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from time import thread_time

import numpy as np

from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.contact.solvers.half_space import HalfSpace
from capslip.contact.solvers.metal import first_loading
from capslip.contact.solvers.polonsky_keer import Pressed, press
from capslip.contact.solvers.sinking import Sunk
from capslip.contact.solvers.unloading import Unloading, path_at
from capslip.contact.solvers.whiteness import white_m2
from capslip.errors import ContactError, OutOfTimeError
from capslip.problems import Effect
from capslip.surface.filters import blurred

FORCE_SHARES = (0.1, 0.25, 0.5, 0.75)  # T / (mu N) at which the energies are compared
# Of what pixels move of the energies of metal at a force, what they do at the next greater one: at
# least, as contacts of few pixels are too even there, on all maps alike
_OF_SMALLER = 2.0 / 3.0
_FLATS_95 = 2.0  # of what half the points move of the loss of flats: 95 % are off by no more
FEW_SLIP = FORCE_SHARES[:2]  # those at which so few points slip that it matters where they lie
WHITE_LEFT = 0.37  # of the rms of white noise, by the filter: noise itself moves the more
WHITE_TAKEN = 0.85  # of the same: the rms of what is taken off, as the parts overlap
_KERNEL = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0  # binomial, a standard deviation of one pixel
_FRAME = 4  # pixels that two passes of the filter reach
_LEAST_WEIGHT = 0.1  # of the filter on measured points, from which a lost point is filled
_TOLERANCE = 1e-4  # of the first look
_NO_EFFECT = 2e-3  # of the approach
_ORDER = 10  # of the differences that know noise: what is 5 pixels long gives them 1e-4 of itself
_ENOUGH = 20  # of these differences, of which a root mean square says something


@dataclass(frozen=True, eq=False)
class FirstLoading:
    """A face as it was before it was pressed, and how far it came when it was."""

    face: ElasticFace  # with its hardness, and the tilt that its balance found
    approach_m: float  # of `sunk`, from its own first touch
    turns: bool = False  # see `Pressed`
    deeper: Sunk | None = None  # see `sunk_in`

    @cached_property
    def sunk(self) -> ElasticFace:
        """The face as it was pressed: with what metal sinks deeper than its bound tells."""
        return self.lowered(self.face)

    def lowered(self, face: ElasticFace) -> ElasticFace:
        """Return another face of these points, with what metal sinks deeper."""
        return face if self.deeper is None else face.lowered(self.deeper.deeper_m)

    @property
    def of_face_m(self) -> float:
        """Approach from the first touch of the face as it was."""
        if self.deeper is None:
            return self.approach_m
        depth_m = self.face.depth_m + self.deeper.deeper_m
        return self.approach_m + float(np.min(depth_m, where=self.face.measured, initial=np.inf))


@dataclass(frozen=True)
class Detail:
    """What the filter of `effect_of_detail` takes off a map: what it does, and what it is."""

    effect: Effect
    white_share: float = 0.0  # of its rms, that may come of white noise, see `_white_share`
    energy: tuple[float, ...] = (0.0,) * len(FORCE_SHARES)  # the effect on it at each of these

    def energy_from(self, share: float) -> float:
        """Return the greatest effect on the energy at these forces from a share of mu N on."""
        return max(one for at, one in zip(FORCE_SHARES, self.energy, strict=True) if at >= share)

    def energy_at(self, share: float) -> float:
        """Return the same from any share on, between and beyond those forces, too."""
        share = min(max(share, FORCE_SHARES[0]), FORCE_SHARES[-1])
        here = np.interp(math.log(share), np.log(FORCE_SHARES), self.energy)
        return max(float(here), self.energy_from(share))


def effect_of_detail(
    first: FirstLoading,
    unloading: Unloading,
    tolerance: float,
    bulk_m_per_N: float,
    resolved: bool,
    time_limit_s: float = math.inf,
    start_Pa: np.ndarray | None = None,
) -> Detail:
    """Return what the detail of one or two pixels does to stiffness and energy.

    Noise, spikes of single pixels, lost points and roughness that the map hardly resolves look
    alike: nobody knows from the map which of them the face has. So the same load is carried by the
    map after a filter that fills single lost points: B + B (1 - B), where B is binomial with a
    standard deviation of one pixel. It leaves every shape of the third degree as it is, so what is
    much wider than a pixel does not feel it; B alone would lower sharp summits more than others.

    What it leaves is solved on no finer pixels than the map: what pixels leave is stated by itself
    (`Unloading.pixel_error`), and a shape that the filter leaves as it is has no detail.

    It takes a part of what is 4 to 8 pixels long as well, which the map resolves. Differences of
    the tenth order hold next to nothing of that, and all of what changes from pixel to pixel: they
    tell which of both was taken.

    Parameters
    ----------
    first : FirstLoading
        The face under the preload.
    unloading : Unloading
        What happened below the preload.
    tolerance : float
        Of each solution, see `press`.
    bulk_m_per_N : float
        Compliance of the bulk, which all maps of these sides share and slip does not count.
    resolved : bool
        Whether the pixels follow contacts and slip: then detail that hardly moves the approach
        moves nothing, and is not followed further.
    time_limit_s : float
        Of the preload that is solved again, see `press`.
    start_Pa : float64, shape (ny, nx), optional
        Pressures of the face under the preload.

    Returns
    -------
    Detail
        With changes over the greater of both values; of the energy those at four forces and the
        greatest of them, of the stiffness that where slip begins and of the secants at these.
    """
    smoothed = _smoothed(first.face)
    least_m = _NO_EFFECT * first.approach_m if resolved else 0.0
    given = unloading, tolerance, bulk_m_per_N, resolved, time_limit_s, start_Pa
    found = _effect_of(smoothed, first, *given, least_m=least_m)
    return replace(found, white_share=_white_share(first, smoothed))


def effect_of_blur(
    first: FirstLoading,
    period_m: float,
    unloading: Unloading,
    tolerance: float,
    bulk_m_per_N: float,
    resolved: bool,
    time_limit_s: float = math.inf,
    start_Pa: np.ndarray | None = None,
) -> Detail:
    """Return what one more blur by the optics does to stiffness and energy.

    What they took off a map is not in it, and no map without a blur can be made of it that does not
    hold its noise many times over. What they take off it once more stands for that.

    Parameters are those of `effect_of_detail`, and the length of the waves that the optics halve.
    """
    face = first.face
    depth_m = blurred(face.depth_m, face.measured, face.pixel_size_m, period_m)
    lowest_m = np.min(depth_m, where=face.measured, initial=np.inf)
    again = replace(face, depth_m=np.where(face.measured, depth_m - lowest_m, 0.0))
    given = unloading, tolerance, bulk_m_per_N, resolved, time_limit_s, start_Pa
    return _effect_of(again, first, *given)


def _effect_of(
    smooth: ElasticFace,
    first: FirstLoading,
    unloading: Unloading,
    tolerance: float,
    bulk_m_per_N: float,
    resolved: bool,
    time_limit_s: float,
    start_Pa: np.ndarray | None,
    least_m: float = 0.0,
) -> Detail:
    """Return what a smoother face changes under the same load; nothing where it hardly moves.

    Nor where the approach moves by less than a least: it may stay where tops sink alike.
    """
    load_N = unloading.load_N
    if resolved and _hardly_moves(first, smooth):
        return Detail(Effect(0.0, 0.0, 0.0))
    begun_s, smooth = thread_time(), first.lowered(smooth)
    again = press(
        smooth,
        load_N=load_N,
        tolerance=_TOLERANCE,
        start_Pa=start_Pa,
        time_limit_s=time_limit_s,
    )
    moved_m = abs(again.approach_m - first.approach_m)
    if moved_m < least_m:
        return Detail(Effect(0.0, 0.0, 0.0))
    left_s = max(time_limit_s - (thread_time() - begun_s), 0.0)
    again = press(
        smooth,
        load_N=load_N,
        tolerance=tolerance,
        start_Pa=again.pressure_Pa,
        time_limit_s=left_s,
    )
    again = replace(again, turns=first.turns)
    until_s = until(unloading, time_limit_s - (thread_time() - begun_s))
    stiffness_N_per_m, loss_J = _below(smooth, again, tolerance, unloading.refinement, until_s)
    before = _stiffnesses_N_per_m(unloading)
    stiffness = (_alone_N_per_m(one, bulk_m_per_N) for one in (before, stiffness_N_per_m))
    stiffer = float(_relative(*stiffness).max())
    energy = _relative(_loss_J(unloading), loss_J).tolist()
    more = max(energy)
    return Detail(Effect(stiffer, more, more), energy=tuple(energy))


def until(unloading: Unloading, left_s: float) -> float:
    """Return when solutions below the preload are given up, by `thread_time`.

    Never where all loads below it were solved in their half of the time: these are far fewer.
    """
    return thread_time() + left_s if unloading.cut_short else math.inf


def effect_of_pixels(
    first: FirstLoading,
    unloading: Unloading,
    tolerance: float,
    start_Pa: np.ndarray,
    time_limit_s: float = math.inf,
) -> dict[float, float]:
    """Return by how much the energy moves on every other pixel, by shares of mu N.

    What pixels leave of a smooth contact that shrinks is known (`Unloading.pixel_error`). Where a
    load has left flats, their edges let go pixel by pixel, and a spline rounds them: then twice the
    pixels tell, which move the energy by no less than the pixels leave, as long as that falls with
    them in proportion or faster. Of the four maps with twice the pixels two are solved, that of the
    highest point and the one a diagonal apart, as finely as each of them is followed, where points
    yield no more finely than those of the face; returned is the root of the mean square.

    Parameters
    ----------
    first : FirstLoading
        The face under the preload.
    unloading : Unloading
        What happened below the preload.
    tolerance : float
        Of each solution, see `press`.
    start_Pa : float64, shape (ny, nx)
        Pressures of the face under the preload.
    time_limit_s : float
        Of all that is solved, see `press`.

    Returns
    -------
    dict of float to float
        Change over the greater of both values; empty where a thinned map does not carry the load.

    Raises
    ------
    OutOfTimeError
        After the time limit.
    """
    begun_s, moved = thread_time(), []
    most = math.inf if math.isinf(first.face.hardness_Pa) else unloading.refinement
    highest = np.unravel_index(np.nanargmin(first.face.known_m), first.face.shape)
    row, col = (int(at) % 2 for at in highest)
    for top, left in ((row, col), (1 - row, 1 - col)):
        every_other = np.s_[top::2, left::2]
        face = _thinned(first.sunk, every_other)
        try:
            pressed = press(
                face,
                load_N=unloading.load_N,
                tolerance=tolerance,
                start_Pa=start_Pa[every_other],
                time_limit_s=max(time_limit_s - (thread_time() - begun_s), 0.0),
            )
        except OutOfTimeError:
            raise
        except ContactError:
            return {}
        until_s = until(unloading, time_limit_s - (thread_time() - begun_s))
        _, loss_J = _below(face, replace(pressed, turns=first.turns), tolerance, most, until_s)
        moved.append(_relative(_loss_J(unloading), loss_J))
    energy = np.sqrt(np.mean(np.square(moved), axis=0))
    if not math.isinf(first.face.hardness_Pa):
        for i in range(1, len(energy)):
            energy[i] = max(energy[i], _OF_SMALLER * energy[i - 1])
    return dict(zip(FORCE_SHARES, energy.tolist(), strict=True))


def effect_of_refinement(
    face: ElasticFace,
    pressed: Pressed,
    unloading: Unloading,
    tolerance: float,
    until_s: float = math.inf,
) -> dict[float, float]:
    """Return by how much the energy at small forces moves on coarser refinements.

    Rings of round contacts let go of pixels in all directions, and most of their errors cancel
    (`Unloading.pixel_error`). The edge of a ridge along a row lets go of the whole row at once:
    what that leaves depends on where the points lie. With one point fewer along the side of a
    pixel, and with half as many, they lie elsewhere; returned is the root of the mean square of
    what both move.

    What the edge of a flat leaves falls in proportion to the points, so half as many of them move
    as much, and at any force.

    Parameters
    ----------
    face, pressed : ElasticFace, Pressed
        A face after its first load, and its state under the preload.
    unloading : Unloading
        What happened below the preload, on a refinement of two or more.
    tolerance : float
        Of each solution, see `press`.
    until_s : float
        When a solution is given up, by `thread_time`.

    Returns
    -------
    dict of float to float
        Change over the greater of both values, by shares of mu N; of flats, so much more that 95 %
        are within.
    """
    finest, moved = unloading.refinement, []
    half = (finest + 1) // 2
    flats = face.yielded
    shares, points, factor = (
        (FORCE_SHARES, {half}, _FLATS_95) if flats else (FEW_SLIP, {finest - 1, half}, 1.0)
    )
    for coarser in points:
        path, _ = path_at(face, pressed, tolerance, shares, most=coarser, until_s=until_s)
        loss_J = np.array([node.region_loss_J.sum() for node in path.nodes])
        moved.append(_relative(_loss_J(unloading, shares), loss_J))
    energy = factor * np.sqrt(np.mean(np.square(moved), axis=0))
    return dict(zip(shares, energy.tolist(), strict=True))


def effect_of_spline(
    face: ElasticFace,
    pressed: Pressed,
    unloading: Unloading,
    tolerance: float,
    until_s: float = math.inf,
) -> dict[float, float]:
    """Return by how much the energy moves with another guess at what lies between the pixels.

    A spline of the third degree instead of the fifth, which is far closer inside a smooth face:
    what the two differ by holds what the fifth leaves. In the half of a pixel beyond the last
    points of a map, where a hill may rise that touches nowhere else, the fifth instead of the mean.

    Parameters are those of `effect_of_refinement`; of the fifth degree was what happened below.

    Returns
    -------
    dict of float to float
        Change over the greater of both values, by shares of mu N.
    """
    most = unloading.refinement
    given = (face, pressed, tolerance, FORCE_SHARES)
    path, _ = path_at(*given, most=most, until_s=until_s, other=True)
    loss_J = np.array([node.region_loss_J.sum() for node in path.nodes])
    moved = _relative(_loss_J(unloading), loss_J).tolist()
    return dict(zip(FORCE_SHARES, moved, strict=True))


def _thinned(face: ElasticFace, every_other: tuple[slice, slice]) -> ElasticFace:
    """Return the face on every other row and column."""
    measured = face.measured[every_other]
    depth_m = face.depth_m[every_other]
    depth_m = depth_m - np.min(depth_m, where=measured, initial=np.inf)
    dy_m, dx_m = face.pixel_size_m
    size_m = (2.0 * dy_m, 2.0 * dx_m)
    return replace(
        face,
        depth_m=np.where(measured, depth_m, 0.0),
        measured=measured,
        pixel_size_m=size_m,
        half_space=HalfSpace(depth_m.shape, size_m, face.E_star_Pa),
    )


def _below(
    face: ElasticFace, pressed: Pressed, tolerance: float, most: float, until_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is compared of a face after its first load, from the loads that takes alone."""
    if not math.isinf(face.hardness_Pa):
        face, pressed = first_loading(face, pressed)
    path, _ = path_at(face, pressed, tolerance, FORCE_SHARES, most=most, until_s=until_s)
    secant = [
        share * pressed.load_N / node.withdrawal_m
        for share, node in zip(FORCE_SHARES, path.nodes, strict=True)
    ]
    loss_J = [float(node.region_loss_J.sum()) for node in path.nodes]
    return np.array([path.stiffness_N_per_m, *secant]), np.array(loss_J)


def _hardly_moves(first: FirstLoading, smooth: ElasticFace) -> bool:
    """Tell whether no point that could touch has moved against the others, or was filled."""
    depth_m, reach_m = first.face.depth_m, first.approach_m
    near = (np.minimum(depth_m, smooth.depth_m) < reach_m) & smooth.measured
    if not first.face.measured[near].all():
        return False
    return bool(np.ptp(smooth.depth_m[near] - depth_m[near]) < _NO_EFFECT * reach_m)


def _white_share(first: FirstLoading, smoothed: ElasticFace) -> float:
    """Return how much of what a filter took, where the face could touch, may be of white noise.

    The greater of rows and columns; 1 where too few differences lie between measured points, and
    where points were filled, as no difference knows of these.
    """
    face = first.face
    depth_m = face.known_m
    near = (np.fmin(depth_m, smoothed.depth_m) < first.approach_m) & smoothed.measured
    if not face.measured[near].all():
        return 1.0
    taken_m = np.std((smoothed.depth_m - face.depth_m)[near])
    most_m2 = 0.0
    for axis in (0, 1):
        noise_m2 = white_m2(depth_m, _ORDER, axis)[near]
        noise_m2 = noise_m2[np.isfinite(noise_m2)]
        if noise_m2.size < _ENOUGH:
            return 1.0
        most_m2 = max(most_m2, float(noise_m2.mean()))
    white_m = WHITE_TAKEN * math.sqrt(most_m2)
    return white_m / max(taken_m, white_m) if white_m > 0.0 else 0.0


def _smoothed(face: ElasticFace) -> ElasticFace:
    """Return the filtered face; non-measured points count for nothing, single ones are filled.

    At the edge of what was measured, where the filter has one side alone, the heights stay as they
    are; holes of up to two points are within it.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    # Closed, and what is far from its edge: one axis after the other, five times as fast so
    closed = minimum_filter(maximum_filter(face.measured, 3, mode="constant"), 3, mode="constant")
    inside = minimum_filter(face.measured | closed, 2 * _FRAME + 1, mode="constant")
    known = face.measured.astype(float)
    weight = _binomial(known)
    measured = face.measured | (inside & (weight > _LEAST_WEIGHT))
    weight = np.maximum(weight, 1e-300)
    mean_m = _binomial(face.depth_m * known) / weight
    rest_m = _binomial((face.depth_m - mean_m) * known) / weight
    filtered_m = face.depth_m.copy()
    filtered_m[inside] = (mean_m + rest_m)[inside]
    depth_m = np.where(measured, filtered_m, np.inf)
    depth_m = np.where(measured, depth_m - depth_m.min(), 0.0)
    return replace(face, depth_m=depth_m, measured=measured)


def _binomial(array: np.ndarray) -> np.ndarray:
    from scipy.ndimage import correlate1d

    for axis in (0, 1):
        array = correlate1d(array, _KERNEL, axis, mode="constant")
    return array


def _stiffnesses_N_per_m(unloading: Unloading) -> np.ndarray:
    """Return the stiffness at first, and the secants."""
    drop_N = np.array(FORCE_SHARES) * unloading.load_N
    secant = drop_N / np.interp(drop_N, unloading.load_drop_N, unloading.withdrawal_m)
    return np.append(unloading.stiffness_N_per_m, secant)


def _alone_N_per_m(stiffness_N_per_m: np.ndarray, bulk_m_per_N: float) -> np.ndarray:
    """Return the stiffness of the contact alone, where that is positive."""
    rest = 1.0 / stiffness_N_per_m - bulk_m_per_N
    return np.where(rest > 0.0, 1.0 / np.where(rest > 0.0, rest, 1.0), stiffness_N_per_m)


def _loss_J(unloading: Unloading, shares: tuple[float, ...] = FORCE_SHARES) -> np.ndarray:
    drop_N = np.array(shares) * unloading.load_N
    return np.exp(np.interp(np.log(drop_N), *np.log((unloading.load_drop_N, unloading.loss_J))))


def _relative(before: float | np.ndarray, after: float | np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(np.subtract(before, after)) / np.maximum(before, after))
