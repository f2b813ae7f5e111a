"""How far least squares lay one face aside of another, against faces whose place is known."""

import numpy as np
import pytest
from scipy import ndimage

from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.mating import mate, place
from capslip.surface.placing import MOST_OF_SIDE, moves_within_error, problems_of_place

D_M = 1e-4
PIXEL_M = (D_M, D_M)


def waves(seed, width, rms_m, shape=(90, 110)):
    z = ndimage.gaussian_filter(np.random.default_rng(seed).standard_normal(shape), width)
    return rms_m * z / z.std()


def worn_pair(seed, share, width=5.0):
    """Return a face, and its print with so much of the heights of its own."""
    common_m = waves(seed, 6.0, 1e-6)
    own_m = waves(seed + 1000, width, share * 1e-6)
    return HeightMap(common_m, PIXEL_M), HeightMap(own_m - common_m[:, ::-1], PIXEL_M)


def moves_of(first, second):
    middle_m = 0.5 * first.side_m[0], 0.5 * first.side_m[1]
    return np.array(moves_within_error(first, second.height_m[:, ::-1], middle_m))


def test_an_exact_print_lies_where_it_lies():
    first, second = worn_pair(0, 0.0)
    assert np.abs(moves_of(first, second)).max() < 1e-12
    assert moves_of(first, HeightMap(first.height_m[:, ::-1], PIXEL_M)).size == 0  # no print


def test_moves_grow_as_what_is_not_common_and_do_not_know_the_units():
    first, second = worn_pair(1, 0.02)
    moves = moves_of(first, second)
    twice = moves_of(first, worn_pair(1, 0.04)[1])
    size = np.linalg.norm(moves[:, :2])
    assert np.linalg.norm(twice[:, :2]) == pytest.approx(2.0 * size, rel=0.1)
    higher = (HeightMap(3.0 * one.height_m, PIXEL_M) for one in (first, second))
    np.testing.assert_allclose(np.abs(moves_of(*higher)), np.abs(moves), rtol=1e-9)
    longer = (HeightMap(one.height_m, (4.0 * D_M, 4.0 * D_M)) for one in (first, second))
    np.testing.assert_allclose(np.abs(moves_of(*longer)), np.abs(moves) * [4, 4, 1], rtol=1e-9)


@pytest.mark.long
def test_places_of_worn_pairs_are_off_as_far_as_is_said():
    """Half of the pairs lie within a third of what is said, and hardly one beyond."""
    distances = []
    for seed in range(2, 18):
        first, second = worn_pair(seed, 0.2)
        found = place(first, second, align="least_squares")
        moves, corner_m = np.array(found.moves), 0.5 * np.hypot(*first.side_m)
        off = np.array([*found.offset_m, found.rotation_rad]) * (1.0, 1.0, corner_m)
        axes = moves * (1.0, 1.0, corner_m)
        distances.append(np.sqrt(off @ np.linalg.solve(axes.T @ axes, off)))
    # Of three normal errors whose sigma is half of the moves the median is 0.77 of these
    assert 0.4 < np.median(distances) < 1.1
    assert np.quantile(distances, 0.9) < 2.0


def test_grooves_leave_the_place_along_them_open():
    """And no more than a twentieth of the side is looked at."""
    along_x = np.cos(2.0 * np.pi * np.arange(110) / 17.0) + 0.3 * np.sin(np.arange(110) / 3.1)
    first_m = 1e-6 * np.tile(along_x, (90, 1)) + waves(3, 6.0, 1e-10)
    first = HeightMap(first_m, PIXEL_M)
    second = HeightMap(waves(4, 5.0, 2e-8) - first_m[:, ::-1], PIXEL_M)
    dy_m, dx_m, _ = np.abs(moves_of(first, second)).max(axis=0)
    assert dy_m == pytest.approx(MOST_OF_SIDE * 90 * D_M, rel=0.01)
    assert dx_m < 0.5 * D_M


def test_a_sum_knows_where_its_second_face_may_lie_as_well():
    first, second = (condition(one) for one in worn_pair(5, 0.1))
    found = place(first.surface, second.surface, align="least_squares")
    both = mate(first, second, found)
    assert [one.code for one in both.problems] == ["mating_not_sure"]
    assert len(both.elsewhere_as_turned()) == 3
    for one, (dy_m, dx_m, turn_rad) in zip(both.elsewhere, found.moves, strict=True):
        offset_m = found.offset_m[0] + dy_m, found.offset_m[1] + dx_m
        turned_rad = found.rotation_rad + turn_rad
        laid = place(first.surface, second.surface, offset_m=offset_m, rotation_rad=turned_rad)
        np.testing.assert_allclose(one.height_m, mate(first, second, laid).surface.height_m)
    given = mate(first, second, place(first.surface, second.surface))
    assert given.problems == ()
    assert given.elsewhere == ()
    together = mate(first, second, found, way="together")
    assert "mating_not_sure" not in {one.code for one in together.problems}
    assert problems_of_place(()) == []
