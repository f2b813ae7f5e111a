"""Spikes as low as the steps of a slope go; peaks, and groups that chance did not put, stay."""

import numpy as np
import pytest
from scipy import ndimage

from capslip.surface.heightmap import HeightMap
from capslip.surface.small_spikes import find_small_spikes

NY, NX = 200, 300
Y, X = np.mgrid[:NY, :NX].astype(float)
SPIKE_M = 1e-7
NONE = np.empty(0, dtype=int)


def hills(seed=0):
    """Make paraboloids of 4 nm a pixel^2 on a level floor, whose rims fall by 60 nm a pixel."""
    rng = np.random.default_rng(seed)
    z = np.zeros((NY, NX))
    for y, x in rng.uniform((0, 0), (NY, NX), (12, 2)):
        z = np.maximum(z, 9e-7 - 1e-9 * ((Y - y) ** 2 + (X - x) ** 2))
    return z


def found(z, known=NONE):
    return np.sort(find_small_spikes(HeightMap(z, (1e-4, 1e-4)), np.asarray(known))[0])


def spiked(z, share, seed=1, height_m=SPIKE_M):
    at = np.sort(np.random.default_rng(seed).choice(z.size, int(share * z.size), replace=False))
    z = z.copy()
    z.reshape(-1)[at] += height_m * np.random.default_rng(seed + 1).choice((-1.0, 1.0), at.size)
    return z, at


@pytest.mark.parametrize("seed", range(3))
def test_a_face_of_hills_holds_none(seed):
    assert found(hills(seed)).size == 0


@pytest.mark.parametrize("seed", range(3))
def test_a_spike_as_high_as_two_steps_of_the_slope_is_found(seed):
    z = hills(seed)
    high = np.argsort(-z, axis=None)[:: z.size // 400][:40]
    inside = high[(high // NX % (NY - 1) > 0) & (high % NX % (NX - 1) > 0)]
    for place in inside:
        one = z.copy()
        one.reshape(-1)[place] += SPIKE_M
        index, off_m = find_small_spikes(HeightMap(one, (1e-4, 1e-4)), NONE)
        if index.size == 0:
            # Only a kink hides one: its own neighbours are no plane there
            assert np.abs(ndimage.laplace(z)).reshape(-1)[place] > 5e-9
            continue
        assert index.tolist() == [place]
        assert off_m[0] == pytest.approx(SPIKE_M, rel=0.1)


@pytest.mark.parametrize("height_m", [3e-7, 1e-4])
@pytest.mark.parametrize("share", [3e-4, 0.01, 0.05])
def test_as_many_spikes_as_chance_puts_side_by_side_go(share, height_m):
    z = hills()
    spiky, at = spiked(z, share, height_m=height_m)
    index = found(spiky)
    assert np.isin(index, at).all()
    left = np.setdiff1d(at, index)
    corners = [0, NX - 1, (NY - 1) * NX, NY * NX - 1]
    if height_m > 1e-6:
        assert np.isin(left, corners).all()
    else:
        assert left.size < 0.02 * at.size  # at kinks of their own size


def test_a_group_of_three_stays_among_few_spikes_and_goes_among_many():
    z = hills(5)
    top = np.unravel_index(np.argmax(ndimage.minimum_filter(z, 15)), z.shape)
    three = np.ravel_multi_index(
        (np.array([0, 0, 1]) + top[0], np.array([0, 1, 0]) + top[1]), z.shape
    )
    for share, goes in ((5e-5, False), (0.02, True)):
        spiky, _ = spiked(z, share, seed=4)
        spiky[top[0] - 3 : top[0] + 5, top[1] - 3 : top[1] + 5] = z[
            top[0] - 3 : top[0] + 5, top[1] - 3 : top[1] + 5
        ]
        spiky.reshape(-1)[three] += SPIKE_M
        assert np.isin(three, found(spiky)).all() == goes


def test_more_groups_than_chance_puts_side_by_side_stay():
    z, _ = spiked(hills(), 0.002, seed=8)
    rows, cols = np.mgrid[10 : NY - 10 : 10, 10 : NX - 10 : 10]
    for down, right in ((0, 0), (0, 1), (1, 0), (1, 1)):
        z[rows + down, cols + right] += 3e-7
    assert not np.isin((rows * NX + cols).reshape(-1), found(z)).any()


@pytest.mark.parametrize("edge", [(0, 120), (NY - 1, 40), (77, 0), (31, NX - 1)])
def test_a_spike_at_the_edge_is_found(edge):
    z = 1e-10 * ((Y - 100.0) ** 2 + (X - 100.0) ** 2)
    z[edge] += SPIKE_M
    assert found(z).tolist() == [edge[0] * NX + edge[1]]


def test_missing_points_and_known_outliers_are_no_neighbours():
    z = hills()
    z[50, 60] += SPIKE_M
    z[50, 61] = 1.0
    z[49, 59] = np.nan
    assert found(z, [50 * NX + 61]).tolist() == [50 * NX + 60]


@pytest.mark.parametrize("width", [0.0, 0.7, 3.0])
def test_noise_and_waves_hold_none(width):
    waves = ndimage.gaussian_filter(np.random.default_rng(3).standard_normal((400, 600)), width)
    assert found(1e-8 * waves).size == 0


def test_a_pit_on_a_cliff_between_two_terraces_stays():
    """The plane through both is as steep as the cliff, and half of its height is no pit."""
    z = 1e-10 * np.random.default_rng(0).standard_normal((NY, NX))
    z[100:] += 1e-6
    z[99, 100:140:7] += 3e-7
    assert found(z).size == 0


@pytest.mark.parametrize("change", [lambda z: z + 2.0e-3, lambda z: 1e-3 * z, lambda z: -z])
def test_level_and_scale_and_side_change_nothing(change):
    z, _ = spiked(hills(), 0.01)
    assert np.array_equal(found(change(z)), found(z))


def test_turning_the_face_turns_the_spikes():
    z, _ = spiked(hills(), 0.01)
    mask = np.zeros(z.shape, dtype=bool)
    mask.reshape(-1)[found(z)] = True
    assert np.array_equal(found(np.rot90(z).copy()), np.flatnonzero(np.rot90(mask)))
