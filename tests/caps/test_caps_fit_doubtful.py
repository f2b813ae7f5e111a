"""Caps: what is doubtful keeps its row, gets a flag, and never a silent or missing number."""

from dataclasses import replace

import numpy as np
import pytest

from capslip import registry
from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.caps.quadric import _inverse, _normal_equations
from capslip.caps.table import CapFlag
from capslip.errors import SettingsError
from capslip.surface.heightmap import HeightMap
from scenes import caps_map, in_filters

FITS = registry.names("caps.fits")
PIXEL_M = 1e-4
Y, X = (np.mgrid[:60, :60] + 0.5) * PIXEL_M
FROM_CENTRE2 = (X - 3e-3) ** 2 + (Y - 3e-3) ** 2


def given_hills(label, cut_height_m):
    """Hills of any shape: the points that carry a label."""
    hills = find_hills(caps_map([(6e-3, 5e-3, 24.0, 0.0)]))
    n = int(label.max())
    return replace(
        hills,
        label=label.astype(np.int32),
        parent_region=np.ones(n, dtype=np.int32),
        prominence_m=np.full(n, 1e-7),
        cut_height_m=cut_height_m,
        noise_m=0.0,
    )


def one_hill(height_m, cut_height_m, fit, **options):
    hills = given_hills(height_m >= cut_height_m, cut_height_m)
    table = fit_caps(HeightMap(height_m, (PIXEL_M, PIXEL_M)), hills, fit, **options)
    return table, CapFlag(int(table.flags[0]))


def assert_no_silent_nan(table):
    ok = table.usable
    for name in ("x_m", "y_m", "peak_height_m", "cap_height_m", "diameter_m", "radius_m"):
        assert np.isfinite(getattr(table, name)[ok]).all(), name
    for name in ("area_m2", "residual_m", "radius_se_m", "peak_height_se_m", "fit_depth_m"):
        assert np.isfinite(getattr(table, name)[ok]).all(), name
    assert (table.radius_m[ok] > 0).all()
    assert np.isnan(table.radius_m[~ok]).all()
    no_surface = CapFlag.ridge | CapFlag.few_points
    assert ((table.flags[np.isnan(table.radius_major_m)] & no_surface) > 0).all()


SHAPES = {
    "ridge": (-((X - 3e-3) ** 2) / 50, CapFlag.ridge),
    "slope to the edge": (X * 1e-4, CapFlag.edge | CapFlag.ridge | CapFlag.apex_off_surface),
    "saddle": (((X - 3e-3) ** 2 - (Y - 3e-3) ** 2) / 50, CapFlag.ridge | CapFlag.edge),
    "bowl": (FROM_CENTRE2 / 50, CapFlag.ridge | CapFlag.edge | CapFlag.several_peaks),
    "plateau": (-np.maximum(FROM_CENTRE2 - 1e-6, 0) / 50, CapFlag.plateau),
    "long ellipse": (-((X - 3e-3) ** 2 + (Y - 3e-3) ** 2 / 20) / 5, CapFlag.ridge),
    "two peaks": (
        -np.minimum((X - 1e-3) ** 2, (X - 5e-3) ** 2) / 50 - (Y - 3e-3) ** 2 / 50,
        CapFlag.several_peaks,
    ),
}


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize("shape", SHAPES)
def test_what_is_no_cap_is_flagged(shape, fit):
    height_m, expected = SHAPES[shape]
    table, flags = one_hill(height_m, float(np.quantile(height_m, 0.6)), fit)
    if fit == "equation18":
        expected &= ~CapFlag.apex_off_surface
    assert expected in flags
    assert_no_silent_nan(table)


@pytest.mark.parametrize("fit", FITS)
def test_a_clean_cap_has_no_flag(fit):
    table, flags = one_hill(-FROM_CENTRE2 / 50, -2e-6 / 50, fit)
    assert flags == CapFlag(0)
    assert table.radius_m[0] == pytest.approx(25, rel=0.02)
    assert table.parent_region[0] == 1


@pytest.mark.parametrize("fit", FITS)
def test_no_height_above_the_cut_is_no_cap(fit):
    table, flags = one_hill(np.zeros((60, 60)), 0.0, fit)
    assert CapFlag.not_convex in flags
    assert CapFlag.plateau in flags
    assert not table.usable.any()
    assert_no_silent_nan(table)


@pytest.mark.parametrize("fit", FITS)
def test_hills_of_a_few_points(fit):
    label = np.zeros((60, 60))
    label[10, 10] = 1
    label[20, 20:22] = 2
    label[30, 30:39] = 3  # on a line
    label[40:43, 40:43] = 4
    height_m = 1e-9 + 1e-6 * np.random.default_rng(0).random((60, 60))
    table = fit_caps(HeightMap(height_m, (PIXEL_M, PIXEL_M)), given_hills(label, 0.0), fit)
    few = (table.flags & CapFlag.few_points) > 0
    assert few.tolist() == [True, True, False, False]
    assert (table.flags[2] & CapFlag.ridge) > 0
    assert_no_silent_nan(table)


@pytest.mark.parametrize("fit", FITS)
def test_no_hills_is_an_empty_table(fit):
    table = fit_caps(caps_map([]), given_hills(np.zeros((200, 300)), 0.0), fit)
    assert len(table) == 0
    assert all(len(column) == 0 for column in table.columns().values())


@pytest.mark.parametrize("fit", ["pinned", "least_squares", "contact"])
def test_half_of_the_points_missing(fit):
    rng = np.random.default_rng(0)
    surface = caps_map([(6e-3, 5e-3, 24.0, 0.0), (14e-3, 12e-3, 27.0, -1e-7)])
    height_m = np.where(rng.random(surface.shape) < 0.5, np.nan, surface.height_m)
    surface = HeightMap(height_m, surface.pixel_size_m)
    table = fit_caps(surface, find_hills(surface), fit)
    big = np.argsort(-table.area_m2)[:2]
    assert np.sort(table.radius_m[big]) == pytest.approx([24, 27], rel=0.02)
    assert_no_silent_nan(table)


@pytest.mark.parametrize("fit", ["pinned", "least_squares"])
def test_a_cap_cut_by_a_patch_is_fitted_on_what_is_there(fit):
    surface = caps_map([(6e-3, 5e-3, 24.0, 0.0), (14e-3, 12e-3, 27.0, -1e-7)])
    height_m = surface.height_m.copy()
    height_m[30:70, 63:80] = np.nan  # begins 0.3 mm beside the apex of the first
    surface = HeightMap(height_m, surface.pixel_size_m)
    table = fit_caps(surface, find_hills(surface), fit)
    first = int(np.argmin(table.x_m))
    assert CapFlag.non_measured in CapFlag(int(table.flags[first]))
    assert table.radius_m[first] == pytest.approx(24, rel=0.02)
    # D is that of the whole cap: R = D^2 / 8 df
    assert table.diameter_m[first] ** 2 / (8 * table.cap_height_m[first]) == pytest.approx(
        24, rel=0.02
    )


def test_one_dust_grain_among_caps_is_an_outlier():
    places = [(x, y, 25.0, 0.0) for x in (5e-3, 12e-3, 19e-3, 26e-3) for y in (4e-3, 10e-3, 16e-3)]
    table = fit_caps(s := caps_map([*places, (8.5e-3, 7e-3, 1.5, 0.0)]), find_hills(s), "pinned")
    outlier = (table.flags & CapFlag.outlier) > 0
    assert outlier.sum() == 1
    assert table.radius_m[outlier][0] == pytest.approx(1.5, rel=0.1)


def test_a_least_squares_apex_that_leaves_the_surface_is_not_taken():
    # a flat dome with a sharp tip beside its middle
    height_m = -FROM_CENTRE2 / 50 + 5e-8 * np.exp(-((X - 3.4e-3) ** 2 + (Y - 3e-3) ** 2) / 4e-8)
    cut_m = float(np.quantile(height_m, 0.6))
    free, flags = one_hill(height_m, cut_m, "least_squares")
    pinned, _ = one_hill(height_m, cut_m, "pinned")
    assert CapFlag.apex_off_surface in flags
    assert free.peak_height_m[0] == pinned.peak_height_m[0]
    assert free.peak_height_m[0] == pytest.approx(height_m.max(), abs=2e-9)


@pytest.mark.parametrize("depth", [np.array([1e-9, 1e-9]), np.array([0.0]), np.array([-1e-9])])
def test_depths_must_fit_the_hills(depth):
    with pytest.raises(SettingsError, match="1 depths > 0"):
        one_hill(-FROM_CENTRE2 / 50, -2e-8, "contact", depth_m=depth)


def test_an_unknown_fit_is_refused():
    with pytest.raises(
        SettingsError, match="expected one of contact, equation18, least_squares, pinned"
    ):
        one_hill(-FROM_CENTRE2 / 50, -2e-8, "sphere")


@pytest.mark.long
def test_very_many_hills_take_bounded_time():
    label = np.kron(np.arange(1, 50001).reshape(200, 250), np.ones((3, 4)))
    height_m = 1e-6 * np.random.default_rng(0).standard_normal(label.shape)
    surface, hills = HeightMap(height_m, (PIXEL_M, PIXEL_M)), given_hills(label, -1e-5)
    assert in_filters(lambda: fit_caps(surface, hills, "pinned")) < 150.0
    table = fit_caps(surface, hills, "pinned")
    assert len(table) == 50000
    assert_no_silent_nan(table)


def test_points_in_two_rows_are_no_quadric_and_no_crash():
    """One such hill, of pixels 128 times as long as wide, has a pivot of exactly zero."""
    step = 0.04045053984490594
    u = -step * np.append(np.arange(10.0, -1.0, -1.0), np.arange(19.0, 0.0, -1.0))
    v = np.repeat([0.0, 5.1776691001485275], [11, 19])
    found = []
    for shrunk in np.linspace(1.0, 0.99, 200):
        places = (np.append(shrunk * u, 0.0), np.append(v, 0.0), np.zeros(31))
        normal, _, _ = _normal_equations(np.array([30]), *places)
        found.append(_inverse(normal, np.array([True])))
    assert not any(solvable[0] for solvable, _ in found)
    assert all(np.isfinite(inverse).all() for _, inverse in found)
