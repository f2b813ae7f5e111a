"""Outlines of elliptic contacts, on the map and against each other."""

import numpy as np
import pytest
from contact_cases import E_STAR_PA, table
from scipy.special import ellipe, ellipk

from capslip.contact.outlines import outlines
from capslip.surface.heightmap import HeightMap

FACE = HeightMap(np.zeros((20, 30)), (2e-3, 2e-3))  # 40 mm by 60 mm
MIDDLE_M = (0.03, 0.02)
SEGMENT = 1 / 3 - np.sqrt(3) / (4 * np.pi)  # of a circle, beyond half of its radius


def drawn(x_m, y_m, a_m, load_N=None, ratio=None, turn=0.0):
    n = len(x_m)
    radii = {} if ratio is None else {"radius_major_m": np.full(n, ratio * 10.0)}
    radii |= {} if ratio is None else {"radius_minor_m": np.full(n, 10.0)}
    caps = table(x_m, y_m, [20.0] * n, [0.0] * n, orientation_rad=np.full(n, turn), **radii)
    load_N = np.ones(n) if load_N is None else np.asarray(load_N)
    return outlines(caps, caps.usable, load_N, np.full(n, a_m), FACE)


@pytest.mark.parametrize("turn", [0.0, 0.7, np.pi / 2])
@pytest.mark.parametrize(("apart", "pairs"), [(1.99, 1), (2.01, 0)])
def test_circles_cross_where_they_are_closer_than_both_radii(apart, pairs, turn):
    x_m, y_m = MIDDLE_M
    more_m = apart * 1e-3 * np.array([np.cos(turn), np.sin(turn)])
    assert drawn([x_m, x_m + more_m[0]], [y_m, y_m + more_m[1]], 1e-3).crossing_pairs == pairs


@pytest.mark.parametrize("axis_ratio", [0.5, 0.1])
def test_the_half_axes_are_those_of_hertz(axis_ratio):
    """Two alike, end to end and side by side, with c^3 = (a b)^1.5 of Johnson's Eq. 4.29."""
    e2 = 1.0 - axis_ratio**2
    K, E = ellipk(e2), ellipe(e2)
    A, B = E / axis_ratio**2 - K, K - E
    ratio, load_N, mean_m = A / B, 50.0, 20.0
    F1 = (4.0 / (np.pi * e2) * axis_ratio**1.5 * np.sqrt(A * B)) ** (1 / 3)
    c_m = F1 * np.cbrt(0.75 * load_N * mean_m / E_STAR_PA)
    F2 = 2.0 / np.pi * np.sqrt(axis_ratio) / F1 * K
    a_m = np.cbrt(0.75 * load_N * mean_m / F2**3 / E_STAR_PA)  # of the table's radius
    x_m, y_m = MIDDLE_M
    for half_m, direction in (
        (c_m / np.sqrt(axis_ratio), (1.0, 0.0)),
        (c_m * np.sqrt(axis_ratio), (0.0, 1.0)),
    ):
        pairs = []
        for part in (0.85, 1.15):
            dx_m, dy_m = 2.0 * part * half_m * np.array(direction)
            found = drawn([x_m, x_m + dx_m], [y_m, y_m + dy_m], a_m, ratio=ratio)
            pairs.append(found.crossing_pairs)
        assert pairs == [1, 0]


def test_a_thin_ellipse_across_another_is_seen():
    x_m, y_m = MIDDLE_M
    caps = table([x_m, x_m + 1e-3], [y_m, y_m], [20.0, 20.0], [0.0, 0.0])
    long = {"radius_major_m": np.full(2, 640.0), "radius_minor_m": np.full(2, 10.0)}
    crossed = caps.with_columns(**long, orientation_rad=np.array([0.0, np.pi / 2]))
    found = outlines(crossed, caps.usable, np.ones(2), np.full(2, 1e-3), FACE)
    assert found.crossing_pairs == 1
    along = caps.with_columns(**long, orientation_rad=np.full(2, np.pi / 2))
    assert outlines(along, caps.usable, np.ones(2), np.full(2, 1e-3), FACE).crossing_pairs == 0


def test_a_peak_without_load_inside_a_contact_counts():
    x_m, y_m = MIDDLE_M
    assert drawn([x_m, x_m + 0.9e-3], [y_m, y_m], 1e-3, [1.0, 0.0]).crossing_pairs == 1
    assert drawn([x_m, x_m + 1.1e-3], [y_m, y_m], 1e-3, [1.0, 0.0]).crossing_pairs == 0


@pytest.mark.parametrize(
    ("x_m", "y_m", "share"),
    [
        *[(0.03, 0.02, 0.0), (0.0, 0.02, 0.5), (0.06, 0.02, 0.5), (0.03, 0.04, 0.5)],
        *[(0.0, 0.0, 0.75), (0.0005, 0.02, SEGMENT), (0.03, 0.0395, SEGMENT)],
    ],
)
def test_the_share_beyond_the_edge_is_that_of_the_area(x_m, y_m, share):
    assert drawn([x_m], [y_m], 1e-3).beyond_share == pytest.approx(share, abs=0.01)
    halved = drawn([x_m, 0.05], [y_m, 0.02], 1e-3, [1.0, 3.0]).beyond_share
    assert halved == pytest.approx(0.25 * share, abs=0.01)


SHARES = [(0.0, 0.5), (0.5, SEGMENT), (-0.5, 1.0 - SEGMENT), (1.01, 0.0)]  # by radii from the end


@pytest.mark.parametrize(("inside", "share"), SHARES)
@pytest.mark.parametrize("direction", [0.0, 0.6, 2.4, -2.0])
def test_the_share_beyond_is_that_beyond_the_outline_of_a_face(direction, inside, share):
    """A half-plane, at any angle, on fine pixels; the end of the map is far away."""
    cos, sin = np.cos(direction), np.sin(direction)
    y_m, x_m = (np.mgrid[:400, :600] + 0.5) * 1e-4 - np.array(MIDDLE_M[::-1])[:, None, None]
    outside = cos * x_m + sin * y_m > 0.0
    face = HeightMap(np.where(outside, np.nan, 0.0), (1e-4, 1e-4))
    a_m = 4e-3
    at = MIDDLE_M[0] - inside * a_m * cos, MIDDLE_M[1] - inside * a_m * sin
    caps = table([at[0]], [at[1]], [20.0], [0.0])
    found = outlines(caps, caps.usable, np.ones(1), np.full(1, a_m), face)
    assert found.beyond_share == pytest.approx(share, abs=0.012)


def test_a_hole_takes_its_share_where_nothing_is_in_it():
    height_m = np.zeros((400, 600))
    height_m[180:220, 300:340] = np.nan  # 4 mm wide, its left side in the middle
    face, caps = HeightMap(height_m, (1e-4, 1e-4)), table([0.03], [0.02], [20.0], [0.0])
    for surface, share in ((face, 0.0), (face.as_void(), 0.5)):
        found = outlines(caps, caps.usable, np.ones(1), np.full(1, 1e-3), surface)
        assert found.beyond_share == pytest.approx(share, abs=0.01)
