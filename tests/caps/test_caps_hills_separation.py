"""Hills that run together: peaks, saddles, pruning, and what bad maps make of them."""

import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from capslip.caps.hills import find_hills
from capslip.caps.separation import change_tree, region_tree
from capslip.errors import SettingsError
from capslip.studies.faces.synthetic import Cap, CapFamily, Scene, synthetic_surface
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from scenes import caps_map, in_filters

EIGHT = np.ones((3, 3))
PIXEL_M = (1e-4, 1e-4)
FACE = Scene(
    shape=(400, 600),
    pixel_size_m=PIXEL_M,
    families=(CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 0.2e-6)),
    gap_m=5e-4,
    floor_m=0.6e-6,
    waviness_rms_m=0.03e-6,
)


def pair(depth, cap_height_m=0.25e-6, radius_m=24.0):
    """Two equal caps on a floor, the saddle `depth` of their height below the peaks."""
    apart_m = 2.0 * np.sqrt(2.0 * radius_m * cap_height_m * depth)
    caps = [(12e-3 - apart_m / 2, 10e-3, radius_m, 0.0), (12e-3 + apart_m / 2, 10e-3, radius_m, 0)]
    surface = caps_map(caps, shape=(200, 300), pixel_size_m=PIXEL_M)
    return surface, float((surface.height_m >= -cap_height_m).mean())


def tree_of(height_m, above, build=change_tree):
    framed = np.pad(np.where(above, height_m, 0.0), 1)
    point = np.flatnonzero(np.pad(above, 1))
    return build(point, framed.ravel()[point], framed.shape)


def assert_every_cap_is_one_hill(hills, surface, truth):
    dy_m, dx_m = surface.pixel_size_m
    rows, cols = (truth.y_m / dy_m).astype(int), (truth.x_m / dx_m).astype(int)
    near = []
    for row, col in zip(rows, cols, strict=True):
        here = hills.label[row - 2 : row + 3, col - 2 : col + 3]
        near.append(np.bincount(here[here > 0]).argmax())
    assert sorted(near) == list(range(1, len(rows) + 1))
    assert hills.n_hills == len(rows)


# The tree ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 1.0])
def test_regions_are_the_hills_with_all_of_a_region_joined(share):
    rng = np.random.default_rng(104)
    height_m = rng.integers(40, size=(37, 53)).astype(float)  # with peaks that are equally high
    above = rng.random(height_m.shape) < share
    tree, regions = tree_of(height_m, above), tree_of(height_m, above, region_tree)
    joined = tree.join(np.full(len(tree.peak_m), True))
    highest, of_hill = np.unique(joined, return_inverse=True)
    np.testing.assert_array_equal(regions.hill, of_hill[tree.hill])
    np.testing.assert_array_equal(regions.peak_m, tree.peak_m[highest])
    assert (regions.prominence_m == np.inf).all()


@given(
    arrays(np.int8, (7, 9), elements=st.integers(0, 6)),
    arrays(np.bool_, (7, 9)),
    st.integers(0, 6),
)
def test_the_tree_counts_the_components_of_every_level_set(height, above, level):
    # At any level the hills that have risen and not yet met a higher one are the components.
    tree = tree_of(height.astype(float), above)
    alive = (tree.peak_m >= level) & (tree.saddle_m < level)
    assert alive.sum() == ndimage.label(above & (height >= level), EIGHT)[1]


@given(arrays(np.int8, (8, 8), elements=st.integers(0, 9)), arrays(np.bool_, (8, 8)))
def test_joined_over_every_saddle_hills_are_connected_regions(height, above):
    tree = tree_of(height.astype(float), above)
    group = tree.join(np.ones(len(tree.peak_m), dtype=bool))[tree.hill]
    label = np.pad(ndimage.label(above, EIGHT)[0], 1).ravel()[tree.point]
    assert (
        len(np.unique(group))
        == len(np.unique(label))
        == len(set(zip(group.tolist(), label.tolist(), strict=True)))
    )


def test_a_long_chain_of_rising_peaks_and_falling_saddles_takes_no_time():
    step = np.arange(40_000)
    height_m = np.zeros((3, step.size))
    height_m[1] = np.where(step % 2, -1.0, 1.0) * step
    above = np.zeros(height_m.shape, dtype=bool)
    above[1] = True
    begin = time.process_time()
    tree = tree_of(height_m, above)
    assert time.process_time() - begin < 1.0
    # each peak ends where it meets the next one
    np.testing.assert_array_equal(np.sort(tree.saddle_m[1:]), np.sort(height_m[1, 1::2])[1:])


# Caps -------------------------------------------------------------------------------------------


def test_a_saddle_a_tenth_below_the_lower_peak_separates_hills():
    surface, ratio = pair(0.10)
    hills = find_hills(surface, ratio)
    assert (hills.n_regions, hills.n_hills) == (1, 2)
    assert find_hills(surface, ratio, "regions").n_hills == 1
    np.testing.assert_array_equal(hills.parent_region, [1, 1])
    # 25 nm, less what the mean of 3 x 3 points takes from a crease
    assert 0.6 * 25e-9 < hills.prominence_m[1] < 25e-9
    assert hills.prominence_m[0] == pytest.approx(0.25e-6, rel=0.02)
    halves = np.bincount(hills.label.ravel())[1:]
    assert halves[0] == pytest.approx(halves[1], rel=0.1)


def test_pruning_joins_what_is_less_prominent():
    surface, ratio = pair(0.10)
    sz_m = np.ptp(surface.height_m)
    assert find_hills(surface, ratio, pruning_height_m=10e-9).n_hills == 2
    assert find_hills(surface, ratio, pruning_height_m=30e-9).n_hills == 1
    assert find_hills(surface, ratio, pruning_percent_Sz=100 * 10e-9 / sz_m).n_hills == 2
    coarse = find_hills(surface, ratio, pruning_percent_Sz=100 * 30e-9 / sz_m)
    assert (coarse.n_hills, coarse.n_hills_half_pruning) == (1, 2)
    assert coarse.pruning_sensitivity == 1.0


@pytest.mark.parametrize("noise", [0.0, 0.03, 0.10])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_cap_is_found_and_none_invented(noise, seed):
    _, truth = synthetic_surface(replace(FACE, seed=seed))
    lowest_m = (truth.peak_height_m - truth.cut_height_m).min()
    scene = replace(
        FACE,
        seed=seed,
        noise_rms_m=noise * lowest_m,
        tilt=(2e-5, -3e-5),
        non_measured_fraction=0.02 if noise else 0.0,
    )
    surface = condition(synthetic_surface(scene)[0]).surface
    hills = find_hills(surface)
    assert_every_cap_is_one_hill(hills, surface, truth)
    assert hills.pruning_sensitivity == 0.0


@pytest.mark.parametrize(
    ("families", "floor_m"), [((1, 0), 3e-6), ((1, 1), 3e-6), ((60, 0), 0.6e-6)]
)
def test_one_two_and_many_noisy_caps(families, floor_m):
    given_families = [CapFamily("G", families[0], 10.0), CapFamily("P", families[1], 10.0, 0.3e-6)]
    scene = replace(
        FACE,
        families=tuple(family for family in given_families if family.count),
        floor_m=floor_m,
        gap_m=3e-4,
        seed=4,
    )
    _, truth = synthetic_surface(scene)
    lowest_m = (truth.peak_height_m - truth.cut_height_m).min()
    surface = condition(synthetic_surface(replace(scene, noise_rms_m=0.1 * lowest_m))[0]).surface
    assert_every_cap_is_one_hill(find_hills(surface), surface, truth)


@pytest.mark.long
def test_half_of_the_points_lost_split_no_hill():
    surface = condition(synthetic_surface(replace(FACE, non_measured_fraction=0.5))[0]).surface
    truth = synthetic_surface(FACE)[1]
    assert_every_cap_is_one_hill(find_hills(surface), surface, truth)


def test_a_lost_stripe_splits_no_cap():
    cap = Cap(30e-3, 20e-3, 10.0, 0.5e-6)
    surface = synthetic_surface(replace(FACE, families=(), caps=(cap,), waviness_rms_m=0.0))[0]
    height_m = surface.height_m.copy()
    height_m[:, 295:307] = np.nan
    ratio = np.mean(height_m >= np.nanmax(height_m) - 0.4e-6)
    hills = find_hills(HeightMap(height_m, PIXEL_M), float(ratio))
    assert hills.n_hills == 1
    assert (hills.label[:, 295:307] == 0).all()


def test_single_spikes_make_no_hills():
    surface = synthetic_surface(replace(FACE, n_spikes=100, spike_m=0.3e-6))[0]
    assert find_hills(condition(surface).surface).n_hills == 23


def test_noise_alone_has_no_hills_and_says_what_it_rejected():
    height_m = np.random.default_rng(7).normal(size=(300, 400))
    hills = find_hills(HeightMap(height_m, PIXEL_M))
    assert hills.n_hills == 0
    assert hills.label.max() == 0
    assert sum(hills.rejected.values()) == hills.n_regions > 1000


def test_labels_regions_and_prominences_fit_together():
    height_m = ndimage.gaussian_filter(np.random.default_rng(2).normal(size=(300, 400)), 5)
    hills = find_hills(HeightMap(height_m, PIXEL_M))
    region, _ = ndimage.label(height_m >= hills.cut_height_m, EIGHT)
    assert set(np.unique(hills.label)) == set(range(hills.n_hills + 1))
    pairs = {tuple(p) for p in np.c_[hills.label.ravel(), region.ravel()][hills.label.ravel() > 0]}
    assert len(pairs) == hills.n_hills  # no hill in two regions
    of_hill = dict(pairs)
    same = [of_hill[i + 1] for i in range(hills.n_hills)]
    assert len(set(zip(same, hills.parent_region.tolist(), strict=True))) == len(set(same))
    assert (hills.prominence_m >= hills.pruning_height_m).sum() >= hills.n_hills - len(set(same))
    top_m = ndimage.maximum(height_m, hills.label, np.arange(1, hills.n_hills + 1))
    assert top_m[0] == height_m.max()
    assert (hills.n_hills_half_pruning >= hills.n_hills) & (
        hills.n_hills >= hills.n_hills_double_pruning
    )


@pytest.mark.parametrize("separation", ["watershed", "regions"])
def test_hills_do_not_depend_on_units_or_direction(separation):
    height_m = ndimage.gaussian_filter(np.random.default_rng(5).normal(size=(150, 200)), 4) * 1e-6
    hills = find_hills(HeightMap(height_m, PIXEL_M), separation=separation)
    for other_m, back in (
        (height_m * 1e3, lambda label: label),
        (height_m[::-1], lambda label: label[::-1]),
        (height_m.T, lambda label: label.T),
    ):
        other = find_hills(HeightMap(other_m, PIXEL_M), separation=separation)
        np.testing.assert_array_equal(back(other.label), hills.label)


# Bad maps ---------------------------------------------------------------------------------------

Y, X = np.mgrid[0:300, 0:400].astype(float)
NOISE = np.random.default_rng(1).random((300, 400))
SMOOTH = ndimage.gaussian_filter(NOISE, 10)


@pytest.mark.parametrize(
    ("height_m", "ratio", "n_hills"),
    [
        (np.minimum(SMOOTH, np.quantile(SMOOTH, 0.93)), 0.1, range(5, 60)),  # clipped sensor
        ((X % 100 < 10) * 1.0, 0.1, [4]),  # all heights above the cut are equal
        (X + 0.1 * Y, 0.1, [1]),  # a slope up to the edge
        (np.sin(X / 10.0) + 0.0 * Y, 0.1, range(6, 8)),  # ridges
        ((X + Y) % 2, 0.1, [0]),  # a checkerboard of points
        ((X // 5 + Y // 5) % 2, 0.1, [2400]),  # a checkerboard of squares
        (np.where(NOISE < 0.05, 1.0 + NOISE, 0.0), 0.02, [0]),  # hills of one point
        (np.round(SMOOTH / SMOOTH.std() * 4), 0.1, range(5, 60)),  # quantised heights
        (1e6 + SMOOTH, 0.1, range(5, 60)),
    ],
)
def test_odd_maps_get_an_answer(height_m, ratio, n_hills):
    hills = find_hills(HeightMap(height_m, PIXEL_M), ratio)
    assert hills.n_hills in n_hills
    assert hills.n_hills > 0 or hills.rejected


def test_two_hundred_thousand_regions_take_little_time():
    height_m = np.zeros((900, 900))
    height_m[::2, ::2] = 1.0 + NOISE.ravel()[0] * np.arange(202_500).reshape(450, 450)
    surface = HeightMap(height_m, PIXEL_M)
    assert in_filters(lambda: find_hills(surface, 0.249)) < 25.0
    hills = find_hills(surface, 0.249)
    assert hills.n_regions > 200_000
    assert hills.rejected == {"within_noise": hills.n_regions}  # each is a single point


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"separation": "watersheds"}, "got 'watersheds'; expected one of watershed, regions"),
        ({"pruning_height_m": 0.0}, "pruning_height_m: got 0.0; expected a positive number"),
        ({"pruning_percent_Sz": np.nan}, "pruning_percent_Sz: got nan"),
        ({"pruning_percent_Sz": 5.0, "pruning_height_m": 1e-9}, "give one of them, or none"),
    ],
)
def test_senseless_options_are_refused(options, message):
    with pytest.raises(SettingsError, match=message):
        find_hills(HeightMap(SMOOTH, PIXEL_M), **options)


# Real scans -------------------------------------------------------------------------------------


@pytest.mark.scans
@pytest.mark.parametrize(
    ("name", "form", "region_share"),
    [
        ("ski_base_stone_ground_alicona.x3p", "plane", 0.19),
        ("bullet_land_B1L1_nanofocus.x3p", "quadratic", 0.54),
    ],
)
def test_large_regions_of_real_scans_come_apart(scans, name, form, region_share):
    hills = find_hills(condition(load_surface(scans / name), form).surface)
    assert hills.largest_region_share == pytest.approx(region_share, abs=0.01)
    assert hills.largest_hill_share < 0.25 * region_share
    assert hills.n_hills > 100


@pytest.mark.scans
def test_the_count_of_hills_on_the_ski_base_hardly_depends_on_the_pruning(scans):
    surface = condition(load_surface(scans / "ski_base_stone_ground_alicona.x3p")).surface
    hills = find_hills(surface)
    assert hills.pruning_sensitivity < 0.05
    for factor, n_hills in ((0.5, hills.n_hills_half_pruning), (2, hills.n_hills_double_pruning)):
        again = find_hills(surface, pruning_height_m=factor * hills.pruning_height_m)
        assert again.n_hills == n_hills
