"""Contacts of a pressed map that go on where nothing was measured."""

import numpy as np
import pytest

from capslip.contact.at_holes import load_at_holes
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.solvers.pressed import Pressed
from capslip.surface.heightmap import HeightMap

E, PIXEL_M, RADIUS_M, LOAD_N = 110e9, 2e-5, 0.5, 5.0
Y_M, X_M = (np.mgrid[:80, :160] - 39.5) * PIXEL_M
APART_M = 80 * PIXEL_M  # two equal spheres, each of which carries half


def two_spheres(lost, turned=False):
    """Press two spheres on a map that lost some points; return the curve and its load at holes."""
    r2_m2 = np.minimum(X_M**2, (X_M - APART_M) ** 2) + Y_M**2
    height_m = np.where(lost, np.nan, -r2_m2 / (2.0 * RADIUS_M))
    height_m = height_m.T if turned else height_m
    curve = boundary_elements(HeightMap(height_m, (PIXEL_M, PIXEL_M)), E, preload_N=LOAD_N)
    return curve, load_at_holes(curve.pressed(LOAD_N), curve.solutions.face.measured)


def half_lost(from_m):
    """Lose all beyond some distance from the first apex, as far as beyond the contact."""
    return (from_m < X_M) & (from_m + 30 * PIXEL_M > X_M) & (abs(Y_M) < 25 * PIXEL_M)


def test_half_of_a_contact_in_a_hole_is_the_load_of_the_other_half_less_and_said():
    whole, none = two_spheres(np.zeros(X_M.shape, dtype=bool))
    halved, share = two_spheres(half_lost(0.0))
    assert none == 0.0
    assert 0.2 < share < 0.5  # half a sphere bears less than a whole one
    off = halved.unloading(LOAD_N).loss_J[-1] / whole.unloading(LOAD_N).loss_J[-1]
    assert abs(off - 1.0) > 0.02
    (said,) = [one for one in halved.problems(LOAD_N) if one.code == "contact_at_hole"]
    assert said.effect.energy == pytest.approx(share)
    assert not [one for one in whole.problems(LOAD_N) if one.code == "contact_at_hole"]


@pytest.mark.parametrize(
    "lost",
    [
        half_lost(25 * PIXEL_M),  # beside the contact
        (abs(X_M) < 0.6 * PIXEL_M) & (abs(Y_M) < 8 * PIXEL_M),  # two lines of points
        X_M < 0.0,  # open to the edge: outside of the face
    ],
)
def test_what_hides_nothing_of_a_contact_is_no_doubt(lost):
    assert two_spheres(lost)[1] == 0.0


def test_a_map_that_is_turned_says_the_same():
    lost = half_lost(0.0)
    assert two_spheres(lost, turned=True)[1] == pytest.approx(two_spheres(lost)[1], rel=1e-6)


TURNS = (np.s_[:, :], np.s_[:, ::-1], np.s_[::-1, :])


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("wide", "away", "hides"),
    [
        (9, 0, False),  # its middle is 5 pixels from what was measured, a quarter of 21 is 5.25
        (11, 0, True),  # 6 pixels
        (11, 5, True),  # which are 11 from the contact; half of the radius and a pixel are 11.5
        (11, 6, False),
    ],
)
def test_what_lies_beside_a_contact_hides_it_by_its_depth_and_its_distance(
    wide, away, hides, turned, turn
):
    """Discs of 21 and 12 pixels; the first begins a hole, a strip on a line that leads there."""
    y, x = np.mgrid[:64, :150]
    discs = [np.hypot(y - 28, x - at) <= radius for at, radius in ((28, 21.0), (120, 12.0))]
    first = 50 + away
    hole = (abs(y - 28) < 20) & (first <= x) & (x < first + wide)
    hole |= (y == 28) & (x >= 50) & (x < first)
    pressure_Pa = 1.0 * discs[0] + 3.0 * discs[1]

    def seen(values):
        return np.ascontiguousarray(values.T[turn] if turned else values[turn])

    pressed = Pressed(1.0, 1.0, seen(pressure_Pa), 0.0 * seen(pressure_Pa), (2e-5, 2e-5), None)
    expected = discs[0].sum() / pressure_Pa.sum() if hides else 0.0
    assert load_at_holes(pressed, seen(~hole)) == pytest.approx(expected)
