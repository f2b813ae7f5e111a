"""Points of hills, gathered in one pass, against masks of the whole map."""

import numpy as np
import pytest
from hill_cases import hills_of
from scipy.ndimage import binary_dilation, binary_erosion, generic_filter

from capslip.caps.points import points_of_hills

SQUARE = np.ones((3, 3), dtype=bool)


def scene(seed, lost_share):
    """Boxes of labels over one another, single lost points and a patch of them."""
    rng = np.random.default_rng(seed)
    height_m = rng.standard_normal((31, 44))
    height_m[rng.random(height_m.shape) < lost_share] = np.nan
    if lost_share:
        height_m[3:9, 30:36] = np.nan
    label = np.zeros(height_m.shape, dtype=int)
    for hill in range(1, 7):
        i, j, h, w = (*rng.integers(0, 30, 2), *rng.integers(2, 25, 2))
        label[i : i + h, j : j + w] = hill
    label[np.isnan(height_m)] = 0
    label = np.searchsorted(np.unique(np.append(0, label)), label)
    return height_m, label


def mean_beside(height_m):
    """Mean of the measured points around each, and how many they are."""
    around = SQUARE.copy()
    around[1, 1] = False

    def of(function):
        return generic_filter(height_m, function, footprint=around, mode="constant", cval=np.nan)

    known = of(lambda some: np.count_nonzero(~np.isnan(some)))
    return of(np.nansum) / np.maximum(known, 1), known


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("lost_share", [0.0, 0.03, 0.3])
def test_points_are_those_of_the_labels_and_of_single_holes(seed, lost_share):
    height_m, label = scene(seed, lost_share)
    points = hills_of(height_m, label)[2]
    own = points.measured
    at = points.row[own].astype(int), points.col[own].astype(int)
    assert np.array_equal(points.count, np.bincount(points.hill, minlength=label.max()))
    assert np.array_equal(label[at] - 1, points.hill[own])
    assert np.count_nonzero(own) == np.count_nonzero(label)
    assert np.array_equal(points.z_m[own], height_m[at])
    for hill in range(points.n_hills):
        assert (np.diff(44 * at[0] + at[1])[np.diff(points.hill[own]) == 0] > 0).all(), hill

    lost = np.isnan(height_m)
    core = binary_erosion(lost, SQUARE)
    patch = binary_dilation(core, SQUARE)
    mean_m, known = mean_beside(height_m)
    on_hill = mean_beside(np.where(label > 0, 1.0, np.nan))[1]
    filled = lost & ~patch & (known >= 3) & (2 * on_hill > known)
    there = points.row[~own].astype(int), points.col[~own].astype(int)
    assert np.count_nonzero(~own) == np.count_nonzero(filled)
    assert filled[there].all()
    assert points.z_m[~own] == pytest.approx(mean_m[there], rel=1e-13)

    beside = binary_dilation(patch, SQUARE) & (label > 0)
    assert np.array_equal((points.limit[own] & 2) > 0, beside[at])


@pytest.mark.parametrize("seed", range(6))
def test_a_point_knows_the_edge_and_other_hills(seed):
    height_m, label = scene(seed, 0.0)
    points = hills_of(height_m, label)[2]
    at = points.row.astype(int), points.col.astype(int)
    framed = np.pad(label, 1)
    edge = np.pad(np.zeros((29, 42), dtype=bool), 1, constant_values=True)
    other = np.zeros(label.shape, dtype=bool)
    for i, j in ((0, 1), (2, 1), (1, 0), (1, 2)):
        beside = framed[i : i + 31, j : j + 44]
        other |= (beside > 0) & (beside != label)
    assert np.array_equal(points.limit, edge[at] + 4 * other[at])


def test_the_corner_of_the_map_lies_beside_no_point_of_its_last_row():
    label = np.zeros((5, 6))
    label[4, 1], label[4, 5] = 1, 2
    assert hills_of(np.zeros((5, 6)), label)[2].limit.tolist() == [1, 1]


def test_no_hills_have_no_points():
    points = hills_of(np.zeros((5, 6)), np.zeros((5, 6)))[2]
    assert (points.n_hills, points.z_m.size, points.count.size) == (0, 0, 0)


@pytest.mark.parametrize("wide", [1, 2, 7])
@pytest.mark.parametrize("seed", range(3))
def test_points_in_a_margin_that_was_not_measured_are_those_of_the_map_without_it(seed, wide):
    height_m, label = scene(seed, 0.03)
    _, _, points = hills_of(height_m, label)
    around = np.pad(height_m, wide, constant_values=np.nan)
    _, _, within = hills_of(around, np.pad(label, wide))
    for name in ("count", "hill", "z_m", "measured", "limit"):
        assert np.array_equal(getattr(within, name), getattr(points, name)), name
    for name in ("row", "col"):
        assert np.array_equal(getattr(within, name), getattr(points, name) + wide), name


def test_a_hole_limits_a_hill_as_a_patch_or_as_an_edge_where_nothing_is():
    height_m, label = np.zeros((9, 12)), np.ones((9, 12), dtype=int)
    height_m[3:6, 4:7] = np.nan
    height_m[7, 9] = np.nan  # a single one is filled all the same
    label[np.isnan(height_m)] = 0
    surface, hills, patched = hills_of(height_m, label)
    void = points_of_hills(surface.as_void(), hills)
    inner = (slice(1, -1), slice(1, -1))

    def limits(points):
        found = np.zeros(height_m.shape, dtype=int)
        found[points.row, points.col] = points.limit
        return found[inner]

    hole = np.zeros((9, 12), dtype=bool)
    hole[3:6, 4:7] = True
    cross = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=bool)
    assert np.array_equal(limits(patched), 2 * (binary_dilation(hole, SQUARE) & ~hole)[inner])
    assert np.array_equal(limits(void), (binary_dilation(hole, cross) & ~hole)[inner])
    assert patched.count == void.count == 9 * 12 - 9
