"""Where the outlines of elliptic contacts lie: over one another, and over the edge of the face."""

from dataclasses import dataclass

import numpy as np

from capslip.caps.spheres import LONGEST
from capslip.caps.table import CapTable
from capslip.contact.lay import axis_ratio
from capslip.surface.heightmap import HeightMap

POINTS = 128  # of an outline: closer than the width of the longest contact
RINGS = np.sqrt((np.arange(4) + 0.5) / 4.0)  # of equal area, over the outline


@dataclass(frozen=True)
class Outlines:
    """What the outlines of contacts say of them.

    Attributes
    ----------
    crossing_pairs : int
        Pairs of contacts that cross, and peaks without load inside a contact.
    beyond_share : float
        Share of the load whose part of the contact lies beyond the edge of the face.
    half_axis_m : float64, shape (c,)
        The longer one of each contact that carries load.
    """

    crossing_pairs: int
    beyond_share: float
    half_axis_m: np.ndarray


def outlines(
    caps: CapTable, use: np.ndarray, load_N: np.ndarray, a_m: np.ndarray, surface: HeightMap
) -> Outlines:
    """Lay the ellipses of contacts on the map.

    Parameters
    ----------
    caps : CapTable
        Where no fit told the principal radii, contacts are circles.
    use : bool, shape (n,)
        Those of them that may carry.
    load_N, a_m : float64, shape (m,)
        Their loads, and the radii of the circles with which the caps carry them.
    surface : HeightMap
        The face.

    Notes
    -----
    A cap of principal radii R1 >= R2 that carries N at the compression d has the table's radius
    a^2 / d; its contact has the half-axes a / M and k a / M, where M is the arithmetic-geometric
    mean of 1 and k, their ratio (Johnson 1985, Eqs. 4.24 and 4.30): M = pi / 2 K, with the complete
    elliptic integral K of 1 - k^2.
    """
    carry = load_N > 0.0
    at = np.flatnonzero(use)[carry]
    _, k, longer, turn = ellipses_of(caps, at)
    long_m = a_m[carry] * longer
    ellipses = np.stack((caps.x_m[at], caps.y_m[at], long_m, k * long_m, turn))
    idle = np.flatnonzero(use)[~carry]
    peaks_m = np.stack((caps.x_m[idle], caps.y_m[idle]))
    among = sum(
        _crosses(ellipses[:, i], ellipses[:, j]) for i, j in zip(*_near(ellipses), strict=True)
    )
    inside = int(_is_inside(ellipses[..., None], peaks_m[:, None]).sum())
    share = np.zeros(at.size)
    for i in np.flatnonzero(_is_near_edge(ellipses, surface)):
        share[i] = _share_beyond(ellipses[:, i], surface)
    beyond_share = float(share @ load_N[carry] / load_N[carry].sum())
    return Outlines(among + inside, beyond_share, long_m)


def ellipses_of(
    caps: CapTable, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return what the contacts of some caps look like, circles where no fit told, shape (m,) each.

    The ratio of the principal radii, that of the half-axes, the longer of these over the radius of
    the circle, and its direction, see `outlines`.
    """
    from scipy.special import ellipkm1

    flat_m, steep_m = caps.radius_major_m[at], caps.radius_minor_m[at]
    known = np.isfinite(flat_m * steep_m) & (steep_m > 0.0)
    flat_m, steep_m = (np.where(known, one_m, 1.0) for one_m in (flat_m, steep_m))
    ratio = np.clip(flat_m / steep_m, 1.0, LONGEST)
    k = axis_ratio(1.0 / ratio)
    turn = np.where(known, caps.orientation_rad[at], 0.0)
    return ratio, k, ellipkm1(k**2) * (2.0 / np.pi), turn


def _near(ellipses: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the pairs (i, j), i < j, of ellipses whose circles around them meet."""
    x_m, y_m, long_m = ellipses[:3]
    away_m = np.hypot(x_m[:, None] - x_m, y_m[:, None] - y_m)
    return np.nonzero(np.triu(away_m < long_m[:, None] + long_m, 1))


def _outline(ellipse: np.ndarray, part: float = 1.0) -> np.ndarray:
    """Return places on an outline, shape (2, POINTS), or at a part of it from the middle."""
    x_m, y_m, long_m, short_m, turn = ellipse
    around = 2.0 * np.pi * np.arange(POINTS) / POINTS
    u_m, v_m = part * long_m * np.cos(around), part * short_m * np.sin(around)
    cos, sin = np.cos(turn), np.sin(turn)
    return np.stack((x_m + cos * u_m - sin * v_m, y_m + sin * u_m + cos * v_m))


def _is_inside(ellipse: np.ndarray, place_m: np.ndarray) -> np.ndarray:
    x_m, y_m, long_m, short_m, turn = ellipse
    dx_m, dy_m = place_m[0] - x_m, place_m[1] - y_m
    cos, sin = np.cos(turn), np.sin(turn)
    along, across = (cos * dx_m + sin * dy_m) / long_m, (cos * dy_m - sin * dx_m) / short_m
    return np.asarray(along**2 + across**2 < 1.0)


def _crosses(one: np.ndarray, other: np.ndarray) -> bool:
    return bool(_is_inside(one, _outline(other)).any() or _is_inside(other, _outline(one)).any())


def _is_near_edge(ellipses: np.ndarray, surface: HeightMap) -> np.ndarray:
    """Tell which ellipses may reach beyond the edge of the face, were they circles."""
    if surface.ends_within:
        return np.ones(ellipses.shape[1], dtype=bool)
    side_y_m, side_x_m = surface.side_m
    x_m, y_m, long_m = ellipses[:3]
    to_edge_m = np.minimum(np.minimum(x_m, side_x_m - x_m), np.minimum(y_m, side_y_m - y_m))
    return np.asarray(to_edge_m < long_m)


def _share_beyond(ellipse: np.ndarray, surface: HeightMap) -> float:
    """Return the share of an ellipse's area beyond the edge of the face."""
    place_m, (dy_m, dx_m) = [_outline(ellipse, part) for part in RINGS], surface.pixel_size_m
    x_m, y_m = np.concatenate(place_m, axis=1)
    row, col = (np.floor(at).astype(int) for at in (y_m / dy_m, x_m / dx_m))
    return float(surface.is_outside(row, col).mean())
