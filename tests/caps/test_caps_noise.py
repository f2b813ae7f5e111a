"""Noise on hills: one stencil by hand, and the correlation that makes it grow with its spacing."""

import itertools

import numpy as np
import pytest

from capslip.caps.noise import Noise, _inflation, noise_at, noise_at_rest
from capslip.surface.heightmap import HeightMap

MEDIAN_OF_NORMAL = 0.6744897501960817
STENCIL = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0])


@pytest.mark.parametrize(("row", "col"), [(1, 1), (1, 5), (3, 1), (3, 5), (2, 3)])
def test_one_stencil_is_seen_up_to_the_rim_of_the_map(row, col):
    height_m = np.random.default_rng(3).normal(size=(5, 7))
    at_1 = (STENCIL * height_m[row - 1 : row + 2, col - 1 : col + 2]).sum()
    seen_m = [abs(at_1) / 6.0 / MEDIAN_OF_NORMAL, 0.0]
    if (row, col) == (2, 3):  # the only one with room for a spacing of two
        seen_m[1] = abs((STENCIL * height_m[::2, 1:6:2]).sum()) / 6.0 / MEDIAN_OF_NORMAL
    assert seen_m[1] < 2.5 * seen_m[0]
    found = noise_at(HeightMap(height_m, (1.0, 1.0)), np.array([row]), np.array([col]))
    assert found.rms_m == pytest.approx(max(seen_m))


@pytest.mark.parametrize("place", [(0, 3), (4, 3), (2, 0), (2, 6)])
def test_no_stencil_fits_on_the_rim(place):
    height_m = np.random.default_rng(3).normal(size=(5, 7))
    found = noise_at(HeightMap(height_m, (1.0, 1.0)), *(np.array([at]) for at in place))
    assert found.rms_m == 0.0


@pytest.mark.parametrize(("growth", "levelled"), [(2.49, True), (2.51, False)])
def test_growth_of_two_and_a_half_is_that_of_noise(growth, levelled):
    """Stencils of one map: what a spacing sees, over what the one before it saw."""
    height_m = np.zeros((33, 33))
    y, x = np.mgrid[-16:17, -16:17]
    for spacing, seen in ((1, 1.0), (2, growth), (4, growth**2), (8, growth**3)):
        corner = (np.abs(y) == spacing) & (np.abs(x) == spacing)
        height_m[corner] = seen
    found = noise_at(HeightMap(height_m, (1.0, 1.0)), np.array([16]), np.array([16]))
    unit_m = 4.0 / 6.0 / MEDIAN_OF_NORMAL
    if levelled:
        assert found.rms_m == pytest.approx(growth * unit_m)
        assert found.inflation > 1.0
    else:
        assert found == Noise(pytest.approx(unit_m), 1.0, pytest.approx(unit_m))


@pytest.mark.parametrize(
    ("correlation", "lags"),
    [
        ([0.0, 0.0], 0.0),
        ([0.3, 0.0, 0.0], 0.3),
        ([0.6, 0.2, 0.0, 0.0], 0.6 + 0.2 + 0.1),
        ([0.8, 0.5, 0.2], None),
    ],
)
def test_the_inflation_is_the_sum_of_the_correlations(correlation, lags):
    """At spacing k the stencil passes (6 - 8 r(k) + 2 r(2k))^2; between spacings r is a line."""
    r = [*correlation, 0.0]
    seen_m = [7e-9 * (6.0 - 8.0 * one + 2.0 * two) / 6.0 for one, two in itertools.pairwise(r)]
    if lags is None:  # still correlated at the last: taken as seen in full there
        assert _inflation(seen_m) < 1.0 + 2.0 * (0.8 + 0.5 + 0.35 + 0.2)
    else:
        assert _inflation(seen_m) == pytest.approx(1.0 + 2.0 * lags)


def test_neighbours_show_little_of_noise_that_is_correlated():
    """Of what repeats over two pixels a spacing of one sees less than one of two."""
    height_m = np.repeat(np.repeat(np.random.default_rng(5).normal(size=(150, 150)), 2, 0), 2, 1)
    row, col = (at.ravel() for at in np.mgrid[20:280, 20:280])
    found = noise_at(HeightMap(height_m, (1.0, 1.0)), row, col)
    assert found.neighbours_m < 0.7 * found.rms_m
    assert found.rms_m == pytest.approx(1.0, rel=0.15)
    assert found.inflation > 1.2


@pytest.mark.parametrize("slope", [(0.0, 0.0), (3e-3, 0.0), (0.0, 3e-3), (-2e-3, 5e-3)])
def test_the_noise_of_a_face_at_rest_is_that_of_what_is_highest_then(slope):
    """Noise on a plateau alone, on pixels that are twice as long as wide."""
    rng, size_m = np.random.default_rng(6), (2e-4, 1e-4)
    height_m = np.zeros((120, 200))
    height_m[40:90, 60:130] = 1e-6 + 1e-8 * rng.normal(size=(50, 70))
    row, col = np.mgrid[:120, :200]
    tilted_m = height_m + slope[1] * size_m[0] * row + slope[0] * size_m[1] * col
    found = noise_at_rest(HeightMap(tilted_m, size_m), slope)
    assert found.rms_m == pytest.approx(1e-8, rel=0.1)
