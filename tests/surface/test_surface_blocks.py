"""Maps are worked on some rows at a time; how many changes neither a number nor a label."""

import tracemalloc
from dataclasses import fields

import numpy as np
import pytest
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from capslip.caps import hills, separation
from capslip.caps.hills import find_hills
from capslip.surface import blocks, rows
from capslip.surface.conditioning import condition, sq_and_sz_m
from capslip.surface.form import remove_form
from capslip.surface.graph import connected_parts
from capslip.surface.heightmap import HeightMap
from capslip.surface.outliers import _runs_between, find_outliers
from capslip.surface.rows import even_lines

PIXEL_M = (2e-5, 3e-5)
LOST = ("none", "single", "patches")


def face(seed, lost, shape=(83, 121)):
    rng = np.random.default_rng(seed)
    height_m = 1e-6 * ndimage.gaussian_filter(rng.standard_normal(shape), 3.0)
    height_m += 2e-9 * rng.standard_normal(shape)
    spike = rng.random(shape) < 2e-3
    height_m[spike] += 1e-5 * rng.choice([-1.0, 1.0], spike.sum())
    if lost != "none":
        height_m[rng.random(shape) < 0.03] = np.nan
    if lost == "patches":
        height_m[20:31, 40:55] = height_m[60:, :6] = height_m[:, 100] = np.nan
    return HeightMap(height_m, PIXEL_M)


def in_blocks_of(points, monkeypatch):
    for module in (blocks, hills, separation, rows):
        monkeypatch.setattr(module, "BLOCK_POINTS", points)


@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("way", ["watershed", "regions"])
def test_hills_do_not_depend_on_the_size_of_the_blocks(way, lost, monkeypatch):
    surface = face(100, lost)
    whole = find_hills(surface, 0.25, way)
    in_blocks_of(1, monkeypatch)
    parts = find_hills(surface, 0.25, way)
    for one in fields(whole):
        np.testing.assert_array_equal(getattr(parts, one.name), getattr(whole, one.name))


@pytest.mark.parametrize("lost", LOST)
def test_outliers_do_not_depend_on_the_size_of_the_blocks(lost, monkeypatch):
    surface = face(101, lost)
    whole = find_outliers(surface)
    in_blocks_of(1, monkeypatch)
    parts = find_outliers(surface)
    assert whole.index.size > 5
    np.testing.assert_array_equal(parts.index, whole.index)
    np.testing.assert_array_equal(parts.step_m, whole.step_m)


@pytest.mark.parametrize("lost", LOST)
def test_the_plane_and_sq_do_not_depend_on_the_size_of_the_blocks(lost, monkeypatch):
    surface = face(102, lost)
    whole = remove_form(surface, "plane")[0]
    in_blocks_of(1, monkeypatch)
    parts = remove_form(surface, "plane")[0]
    np.testing.assert_allclose(parts.height_m, whole.height_m, rtol=0.0, atol=1e-18)
    assert sq_and_sz_m(parts) == pytest.approx(
        (np.nanstd(whole.height_m), np.nanmax(whole.height_m) - np.nanmin(whole.height_m)), rel=1e-9
    )


@pytest.mark.parametrize("share", [0.0, 0.02, 0.4, 0.7, 1.0])
def test_runs_hang_together_as_their_points_do(share):
    left_out = np.random.default_rng(103).random((37, 53)) < share
    runs = _runs_between(left_out.shape, np.flatnonzero(left_out))
    label, n_parts = ndimage.label(~left_out, np.ones((3, 3)))
    of_run = label.reshape(-1)[runs.first - runs.first // runs.width]
    assert (runs.last - runs.first + 1).sum() == np.count_nonzero(~left_out)
    point = np.flatnonzero(~left_out)
    np.testing.assert_array_equal(
        of_run[runs.holding(point + point // 53)], label.reshape(-1)[point]
    )
    one, other = runs.pairs()
    np.testing.assert_array_equal(of_run[one], of_run[other])
    # as many joints as it takes, and none too few
    part = connected_parts(of_run.size, one, other)
    assert np.unique(part).size == n_parts
    graph = coo_array((np.ones(one.size), (one, other)), shape=(of_run.size, of_run.size))
    if of_run.size:
        np.testing.assert_array_equal(part, connected_components(graph, directed=False)[1])


@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.5, 0.97])
@pytest.mark.parametrize("lost", LOST)
def test_the_cut_is_the_quantile_of_all_measured_heights(lost, ratio):
    height_m = face(104, lost, (61, 203)).height_m.copy()
    height_m[::8, ::8] -= 1e-5  # what a few points tell of the rest may be wrong
    found = find_hills(HeightMap(height_m, PIXEL_M), ratio)
    assert found.cut_height_m == np.quantile(height_m[~np.isnan(height_m)], 1.0 - ratio)


def test_conditioning_and_hills_hold_few_maps_at_a_time():
    shape = (1500, 4000)
    y, x = np.ogrid[: shape[0], : shape[1]]
    surface = HeightMap(1e-7 * np.sin(y / 90.0) * np.cos(x / 130.0) + 1e-9 * x, PIXEL_M)
    condition(face(105, "patches"))  # what is loaded stays out of it
    tracemalloc.start()
    try:
        conditioned = condition(surface)
        assert tracemalloc.get_traced_memory()[1] < 1.5 * surface.height_m.nbytes
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        find_hills(conditioned.surface, 0.1)
        assert tracemalloc.get_traced_memory()[1] - before < 1.5 * surface.height_m.nbytes
    finally:
        tracemalloc.stop()


TURNS = {"fliplr": np.fliplr, "flipud": np.flipud, "transpose": np.transpose}


def turned_map(surface, turn):
    size_m = surface.pixel_size_m[::-1] if turn == "transpose" else surface.pixel_size_m
    return HeightMap(np.ascontiguousarray(TURNS[turn](surface.height_m)), size_m)


@pytest.mark.parametrize("side", [2, 3, 4, 7])
@pytest.mark.parametrize("n", [28, 83, 84, 121, 122])
def test_blocks_of_lines_are_the_same_from_both_ends_and_leave_none_out(n, side):
    edges = blocks.symmetric_edges(n, side)
    assert (edges[0], edges[-1]) == (0, n)
    np.testing.assert_array_equal(edges, n - edges[::-1])
    sizes = np.diff(edges)
    assert sizes.min() >= side
    assert sizes.max() <= side + 2


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("lost", LOST)
@pytest.mark.parametrize("shape", [(83, 121), (84, 121), (83, 120), (84, 120)])
def test_means_of_blocks_and_some_lines_lie_as_their_map_does(shape, lost, turn):
    surface = face(106, lost, shape)
    mirrored = turned_map(surface, turn)
    for fewer in (
        lambda one: blocks.block_means(one, 3),
        lambda one: blocks.block_means(one, 4),
        lambda one: blocks.few_lines(one, 10),
        lambda one: blocks.few_lines(one, 10, 2),
    ):
        found, expected = fewer(mirrored), turned_map(fewer(surface), turn)
        assert found.pixel_size_m == pytest.approx(expected.pixel_size_m)
        np.testing.assert_allclose(found.height_m, expected.height_m, rtol=0, atol=1e-18)


@pytest.mark.parametrize("shape", [(83, 121), (84, 120)])
def test_means_of_blocks_cover_the_map_with_all_its_points(shape, monkeypatch):
    surface = face(107, "none", shape)
    coarse = blocks.block_means(surface, 4)
    assert coarse.side_m == pytest.approx(surface.side_m)
    points = [np.diff(blocks.symmetric_edges(n, 4)) for n in shape]
    mean_m = np.average(coarse.height_m, weights=np.outer(*points))
    assert mean_m == pytest.approx(surface.height_m.mean(), rel=1e-9)
    in_blocks_of(1, monkeypatch)
    np.testing.assert_allclose(
        blocks.block_means(surface, 4).height_m, coarse.height_m, rtol=0, atol=1e-18
    )


@pytest.mark.parametrize("side", [2, 3, 5, 10])
def test_a_block_with_just_as_many_points_as_are_asked_for_has_a_mean(side):
    """Whatever rounding a share of the block would have."""
    for least in range(1, side**2 + 1):
        block = np.full(side**2, np.nan)
        block[:least] = 1.0
        for asked, mean in ((least, 1.0), (least + 1, np.nan)):
            found = blocks.means_of_blocks(block.reshape(side, side), side, asked)
            np.testing.assert_array_equal(found, [[mean]])


def test_blocks_lie_where_their_map_says():
    """A ramp of one a metre: the mean of a block is its place, to half a point of the map."""
    ramp_m = np.broadcast_to((np.arange(121) + 0.5) * PIXEL_M[1], (83, 121))
    coarse = blocks.block_means(HeightMap(np.ascontiguousarray(ramp_m), PIXEL_M), 4)
    place_m = (np.arange(coarse.shape[1]) + 0.5) * coarse.pixel_size_m[1]
    assert np.abs(coarse.height_m - place_m).max() <= 0.51 * PIXEL_M[1]


@pytest.mark.parametrize("n", [1, 2, 9, 10, 101, 250])
@pytest.mark.parametrize("every", [0, 1, 2, 3, 8])
def test_some_lines_are_even_and_the_same_from_both_ends(n, every):
    chosen = np.arange(n)[even_lines(n, every)]
    np.testing.assert_array_equal(chosen, n - 1 - chosen[::-1])
    assert chosen.size >= max(1, n // max(1, every) - 1)
    apart = np.diff(chosen)
    assert np.unique(apart).size <= 1
    assert apart.max(initial=0) <= max(1, every)
