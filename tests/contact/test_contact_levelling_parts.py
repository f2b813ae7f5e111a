"""What one turn of a face hands to the next, each part by itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from capslip.contact.levelling import _Search, _Start, turned
from capslip.contact.turns import deeper_fits, run_together, same_relief_m, turn_points
from capslip.settings import Settings
from capslip.surface.heightmap import HeightMap

PIXEL_M = (2e-6, 1e-6)  # along y and x
AT_M = (7e-6, 3e-6)  # x and y


def face(shape=(4, 6)):
    return HeightMap(np.random.default_rng(2).normal(0.0, 1e-8, shape), PIXEL_M)


def search(surface):
    return _Search(surface, Settings(), AT_M, (0.0, 0.0), False, 1e-3)


def places_m(shape):
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    return PIXEL_M[1] * x - AT_M[0], PIXEL_M[0] * y - AT_M[1]


@pytest.mark.parametrize("bow", [None, (3.0, 0.0, 5.0), (3.0, -4.0, 5.0)])
def test_a_turned_map_has_a_plane_more_that_vanishes_at_its_place(bow):
    surface = face()
    x_m, y_m = places_m(surface.shape)
    xx, xy, yy = bow or (0.0, 0.0, 0.0)
    added_m = 2e-3 * x_m - 1e-3 * y_m + xx * x_m**2 + xy * x_m * y_m + yy * y_m**2
    found = turned(surface, (2e-3, -1e-3), AT_M, None if bow is None else np.array(bow))
    assert found.height_m - surface.height_m == pytest.approx(added_m, abs=1e-18)


def test_points_of_hills_turn_as_their_map_does():
    x_m, y_m = (one.reshape(-1) for one in places_m((4, 6)))
    points = SimpleNamespace(
        z_m=np.zeros(24),
        groups=lambda: [(0, slice(0, 10)), (1, slice(10, 24))],
        places_m=lambda some: (x_m[some] + AT_M[0], y_m[some] + AT_M[1]),
    )
    turn_points(points, np.array([2e-3, -1e-3]), AT_M)
    assert points.z_m == pytest.approx(2e-3 * x_m - 1e-3 * y_m, abs=1e-18)


@pytest.mark.parametrize(
    ("slope", "across_m"), [((1e-3, 0.0), 6e-9), ((0.0, -1e-3), 8e-9), ((-2e-3, 1e-3), 12e-9)]
)
def test_a_slope_stands_across_the_side_on_which_it_is_higher(slope, across_m):
    """The face is 6 um along x and 8 um along y."""
    assert search(face())._across_m(np.array(slope)) == pytest.approx(across_m)


def test_depths_go_a_part_of_the_way_and_change_by_load():
    use, own_m = np.array([0, 2, 3]), np.array([2.0, 6.0, 9.0])
    load_N = np.array([1.0, 0.0, 3.0, 0.0])
    first_m, change = deeper_fits(None, use, own_m, load_N, 1.0)
    assert first_m == pytest.approx([2.0, np.nan, 6.0, np.nan], nan_ok=True)
    assert change == 1.0
    before_m = np.array([1.0, 5.0, 8.0, 4.0])
    half_m, change = deeper_fits(before_m, use, own_m, load_N, 0.5)
    assert half_m == pytest.approx([1.5, np.nan, 7.0, np.nan], nan_ok=True)
    assert change == pytest.approx((1.0 * 1.0 + 3.0 * 0.25) / 4.0)
    new_m, change = deeper_fits(np.array([1.0, 5.0, np.nan, 4.0]), use, own_m, load_N, 0.5)
    assert new_m == pytest.approx([1.5, np.nan, 6.0, np.nan], nan_ok=True)
    assert change == pytest.approx(1.0)  # without any so far as a whole


def test_hills_are_told_apart_anew_where_the_approach_is_another_one():
    assert same_relief_m(None, 3e-8) == 3e-8
    for near in (1.0 / 1.08, 1.0, 1.08):
        assert same_relief_m(3e-8, near * 3e-8) == 3e-8
    for other in (1.0 / 1.1, 1.1):
        assert same_relief_m(3e-8, other * 3e-8) == other * 3e-8
    assert _Start(np.zeros(2), 0.1).relief_m is None


def test_depths_are_handed_to_the_hills_on_which_their_caps_stand_now():
    """Two caps on hills of other numbers, one on none any more, one beyond the edge."""
    label = np.zeros((4, 6), dtype=np.intp)
    label[0, 4:], label[3, 0:2], label[1, 1] = 2, 1, 3
    hills = SimpleNamespace(label=label, n_hills=3)
    place_m = np.array([[4.5e-6, 0.2e-6, 3.5e-6, 99e-6], [1e-6, 7e-6, 5e-6, -1e-6]])
    depth_m = np.array([0.1, 0.2, 0.3, 0.4])
    start = _Start(np.zeros(2), 0.1, 1e-7, place_m[:, :3], depth_m[:3])
    surface = face()
    found = search(surface)._carried(start, hills, surface)
    assert found == pytest.approx([0.2, 0.1, np.nan], nan_ok=True)
    beyond = _Start(np.zeros(2), 0.1, 1e-7, place_m[:, 3:], depth_m[3:])
    found = search(surface)._carried(beyond, hills, surface)
    assert found == pytest.approx([np.nan, 0.4, np.nan], nan_ok=True)  # the nearest pixel
    none = _Start(np.zeros(2), 0.1, 1e-7, np.zeros((2, 0)), np.zeros(0))
    assert search(surface)._carried(none, hills, surface) is None
    assert search(surface)._carried(_Start(np.zeros(2), 0.1), hills, surface) is None


def test_a_search_hands_on_the_caps_whose_depth_it_knows():
    spheres = SimpleNamespace(x_m=np.array([1.0, 2.0, 3.0]), y_m=np.array([4.0, 5.0, 6.0]))
    depth_m = np.array([0.1, np.nan, 0.3])
    rest = SimpleNamespace(
        spheres=spheres, depth_m=depth_m, slope=np.array([1e-3, 2e-3]), approach_m=1e-7
    )
    found = search(face())._next(_Start(np.zeros(2), 0.15), rest)
    assert (found.slope is rest.slope, found.ratio, found.relief_m) == (True, 0.15, 1e-7)
    assert found.place_m.tolist() == [[1.0, 3.0], [4.0, 6.0]]
    assert found.depth_m.tolist() == [0.1, 0.3]
    rest.depth_m = None
    found = search(face())._next(_Start(np.zeros(2), 0.15), rest)
    assert (found.place_m.shape, found.depth_m) == ((2, 0), None)


@pytest.mark.parametrize(("apart_m", "light_N", "together"), [
    (2.9e-3, 1.0, True), (3.1e-3, 1.0, False), (2.9e-3, 0.09, False), (2.9e-3, 0.0, False),
])  # fmt: skip
def test_contacts_run_together_that_overlap_and_carry_a_twentieth_of_the_load(
    apart_m, light_N, together
):
    """Contacts of 1 and 2 mm, beside one far away that carries the rest; a cap that is not used."""
    spheres = SimpleNamespace(
        x_m=np.array([0.0, 5e-2, apart_m, 0.0]),
        y_m=np.zeros(4),
        radius_m=np.array([10.0, 10.0, 40.0, 10.0]),
    )
    pressed = SimpleNamespace(
        width_m=np.array([1e-7, 1e-7, 1e-7]),  # of a^2 / R
        load_N=np.array([light_N / 2.0, 2.0, light_N / 2.0]),
    )
    assert run_together(spheres, np.array([0, 1, 2]), pressed) == together
