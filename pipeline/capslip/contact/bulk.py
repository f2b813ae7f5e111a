"""The bulk sinking of the half-space under a face: how much it is, and a curve without it."""

import math
from dataclasses import replace
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np

from capslip.contact.curve import NormalCurve, in_series
from capslip.contact.lay import Energies, energies_of_map
from capslip.contact.material import check_modulus
from capslip.contact.solvers.elastic_face import ElasticFace
from capslip.errors import ContactError, SettingsError
from capslip.problems import Effect, Problem
from capslip.surface.frame import without_frame
from capslip.surface.heightmap import HeightMap
from capslip.surface.holes import disc_within_m, outside_as_made

_MOST_SLIP = 0.75  # of mu N, up to which errors count
MOSTLY_BULK, BULK_ERROR = 0.9, 0.02  # share of the compliance; error that any bulk may have
_BLOCKS = 64  # along the longer side of an outline
# An analysis asks dozens of times for the same face, and a law for it at a hundred levels
_known: WeakKeyDictionary[HeightMap | ElasticFace, Energies] = WeakKeyDictionary()


def bulk_of_face_m_per_N(face: HeightMap | ElasticFace, E_star_Pa: float) -> float:
    """Return the mean sinking of what was measured of a face, under even pressure, a unit of load.

    That of the rectangle, where all within was measured. Else by the same integral over all pairs
    of blocks, see `energies_of_outline`: so a disc or a washer on its map is one, and points lost
    here and there change nothing.

    Parameters
    ----------
    face : HeightMap or ElasticFace
        Its outline counts, not its heights.
    E_star_Pa : float
        Composite modulus.
    """
    check_modulus(E_star_Pa)
    return energies_of_outline(face).mean / E_star_Pa


def energies_of_outline(face: HeightMap | ElasticFace) -> Energies:
    """Return twice the energy of an even pressure on what was measured of a face, times E*, in 1/m.

    Of blocks, about 64 along the longer side, each with its measured share of the pressure; the
    mean of a rectangle that was measured as a whole is that of the rectangle.
    """
    if face not in _known:
        _known[face] = _of_outline(face)
    return _known[face]


def filled_outside(surface: HeightMap) -> HeightMap:
    """Return a face that goes on, at its lowest, where it is open to the edge of what was measured.

    Not in a frame of lines around it on which nothing was measured.
    """
    height_m, window = surface.height_m.copy(), surface.measured_window
    height_m[window][surface.outside[window]] = surface.bounds_m[0]
    return replace(surface, height_m=height_m)


def problems_of_outline(surface: HeightMap, hill_radius_m: float) -> list[Problem]:
    """Say that what was measured was taken for the outline of the face.

    Parameters
    ----------
    surface : HeightMap
        The face.
    hill_radius_m : float
        Radius of the disc that a usual hill covers above the cut.

    Returns
    -------
    list of Problem
        `outline_assumed` where such a disc lies outside: info where the outside is on both sides
        alike, as that of a disc or a washer; else a warning, whose effect decides. Lines along the
        edges without any point say nothing of that: only where all else is whole, they are a note.
    """
    if surface.complete:
        return []
    inner = without_frame(surface)
    if disc_within_m(inner.outside, inner, hill_radius_m) == 0.0:
        if inner is surface or disc_within_m(surface.outside, surface, hill_radius_m) == 0.0:
            return []
        message = (
            f"{surface.outside.mean():.1%} of the map was not measured and is open to its edge, "
            "in lines without any point: it is taken for outside of the face"
        )
        return [Problem("outline_assumed", "info", message)]
    more = energies_of_outline(inner).mean / energies_of_outline(filled_outside(inner)).mean
    whole = "the map" if inner is surface else "the map within its lines without any point"
    message = (
        f"{inner.outside.mean():.1%} of {whole} was not measured and is open to its edge: it is "
        f"taken for outside of the face, whose even pressure sinks it {more - 1.0:.2%} deeper than "
        "that of the whole map"
    )
    if outside_as_made(inner):
        return [Problem("outline_assumed", "info", message)]
    message += "; a part of the face that was lost would carry load and is not counted"
    return [Problem("outline_assumed", "warning", message)]


def _of_outline(face: HeightMap | ElasticFace) -> Energies:
    lost = face.lost if isinstance(face, HeightMap) else face.unmeasured
    window, (dy_m, dx_m) = face.measured_window, face.pixel_size_m
    (top, left), (ny, nx) = zip(*((one.start, one.stop - one.start) for one in window), strict=True)
    row, col = lost // face.shape[1] - top, lost % face.shape[1] - left
    within = (row >= 0) & (row < ny) & (col >= 0) & (col < nx)
    block = -(-max(ny, nx) // _BLOCKS)
    rows, columns = (np.diff(np.arange(0, n, block), append=n) for n in (ny, nx))
    at = (row // block * columns.size + col // block)[within]
    missing = np.bincount(at, minlength=rows.size * columns.size).reshape(rows.size, -1)
    share = (np.outer(rows, columns) - missing).astype(float)
    found = _of_blocks(share.tobytes(), share.shape, (block * dy_m, block * dx_m))
    if at.size:
        return found
    return replace(found, mean=bulk_compliance_m_per_N((ny * dy_m, nx * dx_m), 1.0))


@lru_cache(maxsize=64)
def _of_blocks(share: bytes, shape: tuple[int, ...], size_m: tuple[float, float]) -> Energies:
    (found,) = energies_of_map([np.frombuffer(share).reshape(shape)], size_m)
    return found


def bulk_compliance_m_per_N(side_m: tuple[float, float], E_star_Pa: float) -> float:
    """Return the mean sinking of a rectangular face under uniform pressure, a unit of load.

    c / (E* sqrt(A)) with the closed form of c for any aspect ratio: the integral of 1 / (pi r) over
    all pairs of points of an a x b rectangle (a >= b), over (a b)^1.5, where

        integral of 1/r = 2 a^2 b asinh(b/a) + 2 a b^2 asinh(a/b)
                          + 2/3 [a^3 + b^3 - (a^2 + b^2)^1.5]

    Parameters
    ----------
    side_m : (float, float)
        Sides of the face (ly, lx).
    E_star_Pa : float
        Composite modulus.

    Examples
    --------
    >>> round(bulk_compliance_m_per_N((1.0, 1.0), 1.0), 3)
    0.946
    >>> round(bulk_compliance_m_per_N((2.0, 3.0), 1.0) * 6**0.5, 3)
    0.937
    """
    b, a = sorted(side_m)
    if not 0 < b <= a < math.inf:
        raise SettingsError(f"side_m: got {side_m}; expected two finite lengths > 0")
    check_modulus(E_star_Pa)
    t = b / a
    corner = t**3 - math.expm1(1.5 * math.log1p(t**2))
    integral = 2 * t * math.asinh(t) + 2 * t**2 * math.asinh(1 / t) + 2 / 3 * corner
    c = integral / (math.pi * t**1.5)
    return c / (E_star_Pa * math.sqrt(a * b))


def without_bulk(
    curve: NormalCurve, bulk_m_per_N: float, load_N: float
) -> tuple[NormalCurve, bool]:
    """Take the bulk sinking out of a curve, unless nothing would be left of its compliance.

    Parameters
    ----------
    curve : NormalCurve
    bulk_m_per_N : float
        Compliance of the bulk.
    load_N : float
        The greatest at which the curve is asked.

    Returns
    -------
    NormalCurve, bool
        The curve, and whether it still holds the bulk term; of many sets of parameters all or none.
    """
    rest = in_series(curve, -bulk_m_per_N)
    try:
        # The compliance falls with the load: what holds under the greatest holds below it.
        approach_m = rest.approach_m(load_N)
        stiffness_N_per_m = rest.stiffness_N_per_m(approach_m)
        left = bool(np.all((approach_m > rest.touch_m) & (stiffness_N_per_m > 0.0)))
    except ContactError:
        left = False
    return (rest, False) if left else (curve, True)


def share_of_contact(
    curve: NormalCurve, kept_m_per_N: float, load_N: float, own_N_per_m: float
) -> float:
    """Return by which share of itself a stiffness moves with that of the contacts alone.

    Where the bulk sinking was taken off, by all. Where a curve holds it, by the share of the rest
    in its compliance, the greatest of which is that of the secant at three quarters of mu N. And by
    no less than the share of what contacts far from each other yield: of a single one, which is a
    bulk of its own, that is all.

    Parameters
    ----------
    curve : NormalCurve
        As slip uses it.
    kept_m_per_N : float
        Compliance of the bulk that it holds.
    load_N : float
        Under which it is.
    own_N_per_m : float
        Sum of the stiffnesses that its contacts have far from each other, 2 E* a.

    Examples
    --------
    >>> from capslip.contact.models.families import families
    >>> curve = families((5, 18), (23.8, 26.7), (0, 2.4e-7), 109.89e9)
    >>> sunk = in_series(curve, 1e-9)
    >>> own_N_per_m = float(curve.stiffness_N_per_m(curve.approach_m(460.0)))
    >>> each = (curve, 0.0), (sunk, 1e-9)
    >>> [round(share_of_contact(*one, 460.0, own_N_per_m), 3) for one in each]
    [1.0, 0.301]
    """
    if kept_m_per_N <= 0.0:
        return 1.0
    approach_m, drop_N = curve.approach_m(load_N), _MOST_SLIP * load_N
    rest = 1.0 - kept_m_per_N * drop_N / float(curve.withdrawal_m(approach_m, drop_N))
    of_own = float(curve.stiffness_N_per_m(approach_m)) / own_N_per_m
    return min(max(rest, of_own), 1.0)


def problems_of_bulk(
    bulk_m_per_N: float, curve: NormalCurve, preload_N: float, greatest: float, kept: bool
) -> list[Problem]:
    """Return whether the bulk could not be taken off, or what is left is a small difference.

    Parameters
    ----------
    bulk_m_per_N : float
        Compliance of the bulk.
    curve : NormalCurve
        As slip uses it: what `without_bulk` found.
    preload_N : float
    greatest : float
        Times the preload, to which a load that oscillates goes: what is left there counts.
    kept : bool
        Whether that curve holds the bulk.
    """
    if kept:
        return [_bulk_kept(bulk_m_per_N, curve, greatest * preload_N)]
    rest_m_per_N = 1.0 / float(curve.stiffness_N_per_m(curve.approach_m(preload_N)))
    share = bulk_m_per_N / (bulk_m_per_N + rest_m_per_N)
    if share <= MOSTLY_BULK:
        return []
    moved = BULK_ERROR * share / (1.0 - share)
    message = (
        f"{share:.0%} of the compliance is the bulk's, which is taken off: what is left moves by "
        f"{moved:.0%} with each {BULK_ERROR:.0%} of it, and no block is quite a half-space"
    )
    return [Problem("bulk_dominates", "warning", message, Effect(moved, None, moved))]


def _bulk_kept(bulk_m_per_N: float, curve: NormalCurve, load_N: float) -> Problem:
    """Return why nothing would be left without the bulk, and how much of the compliance it is.

    That is what fails, where the approach is greater than the sinking of the bulk as well: the
    face becomes stiffer while it closes, the bulk does not.
    """
    approach_m = float(curve.approach_m(load_N))
    stiffness_N_per_m, bulk_m = float(curve.stiffness_N_per_m(approach_m)), bulk_m_per_N * load_N
    share = bulk_m_per_N * stiffness_N_per_m
    message = (
        "nothing would be left of the compliance without the bulk sinking of the half-space, "
        f"which is {share:.0%} of it under {load_N:.4g} N"
    )
    if approach_m <= bulk_m:
        message += f"; nor of the approach: {bulk_m:.3g} m of {approach_m:.3g} m are the bulk's"
    message += (
        "; the contact is spread over the face, or lies near its edges; the bulk was kept, so "
        "stiffness and displacement are those of the half-space under the scan rather than of the "
        "contact"
    )
    return Problem("bulk_kept", "warning", message, Effect(share, None, share))
