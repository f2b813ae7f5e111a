"""Form removal, the Gaussian filter, and what makes a map suspect."""

import numpy as np
import pytest

from pipeline.errors import SettingsError, UnusableSurfaceError
from pipeline.surface.conditioning import condition
from pipeline.surface.filters import SIGMA_PER_NESTING_INDEX, gaussian_s_filter
from pipeline.surface.heightmap import HeightMap

PIXEL_M = (60e-6, 50e-6)
NY, NX = 120, 170


def axes(shape=(NY, NX), pixel_m=PIXEL_M):
    y, x = np.mgrid[: shape[0], : shape[1]]
    return (y + 0.5) * pixel_m[0], (x + 0.5) * pixel_m[1]


def rough(seed=0, rms_m=1e-7):
    return rms_m * np.random.default_rng(seed).standard_normal((NY, NX))


def holes(seed=1, share=0.2):
    missing = np.random.default_rng(seed).random((NY, NX)) < share
    missing[:40, :90] = True
    return missing


def polynomial(degree):
    y, x = axes()
    z = 3e-3 + 2e-5 * x - 4e-5 * y
    return z if degree == 1 else z + 1e-2 * x**2 - 2e-2 * y**2 + 1.5e-2 * x * y


@pytest.mark.parametrize(("form", "degree"), [("plane", 1), ("quadratic", 2)])
@pytest.mark.parametrize("masked", [False, True])
def test_the_form_itself_leaves_nothing(form, degree, masked):
    z = polynomial(degree)
    if masked:
        z[holes()] = np.nan
    result = condition(HeightMap(z, PIXEL_M), form)
    assert result.sz_m < 1e-12 * 3e-3
    np.testing.assert_array_equal(result.surface.measured, ~np.isnan(z))


@pytest.mark.parametrize(("form", "degree"), [("plane", 1), ("quadratic", 2)])
@pytest.mark.parametrize("masked", [False, True])
def test_adding_the_form_changes_nothing(form, degree, masked):
    z = rough()
    if masked:
        z[holes()] = np.nan
    bare = condition(HeightMap(z, PIXEL_M), form).surface.height_m
    bent = condition(HeightMap(z + polynomial(degree), PIXEL_M), form).surface.height_m
    np.testing.assert_allclose(bent, bare, atol=1e-14)


@pytest.mark.parametrize(("form", "degree"), [("plane", 1), ("quadratic", 2)])
@pytest.mark.parametrize("masked", [False, True])
def test_form_is_that_of_dense_least_squares(form, degree, masked):
    z = rough(3) + polynomial(2)
    if masked:
        z[holes()] = np.nan
    y, x = (a / a.max() for a in axes())
    terms = [x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)]
    matrix = np.stack(terms, axis=-1)
    known = ~np.isnan(z)
    solution = np.linalg.lstsq(matrix[known], z[known], rcond=None)[0]
    found = condition(HeightMap(z, PIXEL_M), form).surface.height_m
    np.testing.assert_allclose(found, z - matrix @ solution, atol=1e-15)


def test_turning_the_face_turns_the_result():
    z = rough(4) + polynomial(2)
    z[holes()] = np.nan
    turned = condition(HeightMap(np.rot90(z), PIXEL_M[::-1]), "quadratic").surface.height_m
    straight = condition(HeightMap(z, PIXEL_M), "quadratic").surface.height_m
    np.testing.assert_allclose(turned, np.rot90(straight), atol=1e-16)


def test_a_high_level_costs_no_digits():
    z = rough(5, 1e-9)
    low = condition(HeightMap(z, PIXEL_M)).surface.height_m
    high = condition(HeightMap(z + 0.05, PIXEL_M)).surface.height_m
    np.testing.assert_allclose(high, low, atol=2e-17)  # 0.05 m has an ulp of 7e-18 m


def test_a_small_measured_part_far_off_the_middle_is_well_conditioned():
    z = polynomial(2) + rough(6, 1e-12)
    z[5:, :] = np.nan
    z[:, :160] = np.nan
    assert condition(HeightMap(z, PIXEL_M), "quadratic").sq_m < 1.1e-12


def test_sq_and_sz_of_a_known_wave():
    x = axes((100, 100))[1]
    z = 1e-6 * np.sin(2 * np.pi * x / (100 * PIXEL_M[1]) * 4) + 5.0
    result = condition(HeightMap(z, PIXEL_M), "none")
    assert result.sq_m == pytest.approx(1e-6 / np.sqrt(2), rel=1e-6)
    assert result.sz_m == pytest.approx(2e-6, rel=1e-2)


@pytest.mark.parametrize("keep", [np.s_[0:0], np.s_[7], np.s_[:, 9], np.s_[3:5, 3:5]])
def test_too_few_measured_points_are_refused(keep):
    z = np.full((NY, NX), np.nan)
    z[keep] = rough()[keep]
    with pytest.raises(UnusableSurfaceError, match=r"non-measured|along a line"):
        condition(HeightMap(z, PIXEL_M), "quadratic")


def test_points_along_a_diagonal_fix_no_plane():
    z = np.full((50, 50), np.nan)
    np.fill_diagonal(z, 1e-6)
    with pytest.raises(UnusableSurfaceError, match="along a line"):
        condition(HeightMap(z, PIXEL_M))


def test_unknown_form_is_refused():
    with pytest.raises(SettingsError, match="cubic"):
        condition(HeightMap(rough(), PIXEL_M), "cubic")


def test_sigma_is_that_of_the_standard():
    assert pytest.approx(0.1874, abs=5e-5) == SIGMA_PER_NESTING_INDEX
    # transmission of a Gaussian of that width at a wave as long as the nesting index
    assert np.exp(-2 * (np.pi * SIGMA_PER_NESTING_INDEX) ** 2) == pytest.approx(0.5, rel=1e-14)


@pytest.mark.parametrize("masked", [False, True])
def test_filter_leaves_a_constant_alone(masked):
    z = np.full((NY, NX), 0.0123)
    if masked:
        z[holes()] = np.nan
    smooth = gaussian_s_filter(HeightMap(z, PIXEL_M), 1e-3).height_m
    np.testing.assert_allclose(smooth, z, rtol=1e-15)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0, 4.0])
def test_filter_transmits_waves_as_the_standard_says(axis, ratio):
    index_m = 0.8e-3
    wave = np.cos(2 * np.pi * (axes((160, 160))[axis] - 4e-3) / (ratio * index_m))
    middle = np.s_[60:100, 60:100]
    smooth = gaussian_s_filter(HeightMap(wave, PIXEL_M), index_m).height_m
    expected = 0.5 ** (1 / ratio**2)
    np.testing.assert_allclose(smooth[middle], expected * wave[middle], atol=2e-6)


def test_filter_ignores_what_was_not_measured():
    z = rough(8)
    z[holes()] = np.nan
    smooth = gaussian_s_filter(HeightMap(z, PIXEL_M), 0.5e-3).height_m
    np.testing.assert_array_equal(np.isnan(smooth), np.isnan(z))
    y, x = axes()
    i, j = 80, 100
    sigma_m = SIGMA_PER_NESTING_INDEX * 0.5e-3
    weight = np.exp(-((y - y[i, j]) ** 2 + (x - x[i, j]) ** 2) / (2 * sigma_m**2))
    weight[np.isnan(z)] = 0
    assert smooth[i, j] == pytest.approx(np.nansum(weight * z) / weight.sum(), rel=1e-4)


@pytest.mark.parametrize("index_m", [0.0, -1e-3, 1e-4, 1.0, np.nan, np.inf])
def test_filter_refuses_a_nesting_index_the_grid_cannot_show(index_m):
    with pytest.raises(SettingsError, match="nesting_index"):
        condition(HeightMap(rough(), PIXEL_M), s_filter_nesting_index_m=index_m)


def codes(z, pixel_m=(50e-6, 50e-6), form="plane"):
    return {p.code: p.severity for p in condition(HeightMap(z, pixel_m), form).problems}


def test_a_plausible_face_raises_no_doubt():
    assert codes(rough()) == {}


def test_non_square_pixels_are_mentioned():
    assert codes(rough(), PIXEL_M) == {"non_square_pixels": "info"}


def test_heights_beyond_the_face_are_a_unit_error():
    assert codes(1e6 * rough()) == {"slope_suspect": "error"}


def test_steep_heights_are_suspect():
    assert codes(3e2 * rough()) == {"slope_suspect": "warning"}


def test_a_spike_is_counted_once_and_kept():
    z = rough()
    z[40, 50] += 5e-6
    z[0:3, 9] = np.nan
    result = condition(HeightMap(z, (50e-6, 50e-6)))
    assert [p.code for p in result.problems] == ["outliers", "spikes"]
    assert result.problems[1].message.startswith("1 single")
    assert np.nanargmax(result.surface.height_m) == 40 * NX + 50


def test_a_smooth_cap_is_no_spike():
    y, x = axes()
    assert "spikes" not in codes(-((y - 3e-3) ** 2 + (x - 4e-3) ** 2) / 50, form="none")
