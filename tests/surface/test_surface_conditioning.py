"""The steps in order, what they say of themselves, and what makes a map suspect."""

import json
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from capslip.caps.families import group_families
from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface.conditioning import condition
from capslip.surface.doubts import sanity_line
from capslip.surface.filters import gaussian_s_filter
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap, Origin
from capslip.surface.readers import load_surface
from capslip.surface.resampling import resample
from scenes import in_filters

SAMPLES = Path(__file__).parents[2] / "sample_surfaces"
PIXEL_M = (60e-6, 50e-6)
SQUARE_M = (50e-6, 50e-6)
NY, NX = 120, 170
ROW, COL = np.mgrid[:NY, :NX]


def rough(seed=0, rms_m=1e-7):
    return rms_m * np.random.default_rng(seed).standard_normal((NY, NX))


def spiky(n=20, height_m=1e-5):
    z = rough()
    z.reshape(-1)[np.arange(1, n + 1) * 907] += height_m
    return z


def test_sq_and_sz_of_a_known_wave():
    z = 1e-6 * np.sin(2 * np.pi * (COL[:100, :100] + 0.5) / 25) + 5.0
    result = condition(HeightMap(z, PIXEL_M), "none")
    assert result.sq_m == pytest.approx(1e-6 / np.sqrt(2), rel=1e-6)
    assert result.sz_m == pytest.approx(2e-6, rel=1e-2)


def test_defaults_are_a_plane_and_no_outliers():
    surface = HeightMap(spiky() + 1e-6 * COL, PIXEL_M)
    result = condition(surface)
    form, outliers = result.steps
    assert (form["step"], form["kind"], form["degree"], form["robust"]) == (
        "form",
        "plane",
        1,
        False,
    )
    assert form["residual_sq_m"] == result.sq_m
    assert (outliers["step"], outliers["rule"], outliers["removed"]) == (
        "outliers",
        "isolated",
        20,
    )
    assert outliers["sz_before_m"] > 1e-5 > result.sz_m
    assert np.count_nonzero(~result.surface.measured) == 20


def test_the_form_is_that_of_the_points_that_stay():
    z, clean = spiky() + 1e-6 * COL, rough() + 1e-6 * COL
    clean[np.abs(z - clean) > 0] = np.nan
    found = condition(HeightMap(z, PIXEL_M)).surface.height_m
    expected = remove_form(HeightMap(clean, PIXEL_M))[0].height_m
    np.testing.assert_array_equal(found, expected)


def test_outliers_stay_on_demand():
    result = condition(HeightMap(spiky(), PIXEL_M), outliers="none")
    assert result.steps[1] == {"step": "outliers", "rule": "none", "removed": 0}
    assert result.surface.measured.all()


def test_every_step_is_stated_in_the_order_it_is_done():
    surface = HeightMap(spiky(), SQUARE_M)
    result = condition(
        surface,
        "polynomial",
        form_degree=3,
        form_robust=True,
        edge_trim_m=120e-6,
        s_filter_nesting_index_m=0.3e-3,
        l_filter_nesting_index_m=4e-3,
        resample_to=(57, 82),
    )
    names = [step["step"] for step in result.steps]
    assert names == ["edge_trim", "form", "outliers", "s_filter", "l_filter", "resampling"]
    trim, form, _, s, long, grid = result.steps
    assert trim["points"] == [3, 3]
    assert (form["degree"], form["robust"]) == (3, True)
    assert (s["nesting_index_m"], long["nesting_index_m"]) == (0.3e-3, 4e-3)
    assert grid["shape"] == [57, 82]
    assert result.surface.shape == (57, 82)
    assert result.surface.side_m == pytest.approx((114 * 50e-6, 164 * 50e-6))
    json.dumps(result.steps, allow_nan=False)


def test_steps_are_those_of_their_own_functions():
    z = rough()
    z[30:40, 50:80] = np.nan
    surface = HeightMap(z + 1e-6 * COL, PIXEL_M)
    result = condition(surface, s_filter_nesting_index_m=0.5e-3, resample_to=(60, 100))
    expected = resample(gaussian_s_filter(remove_form(surface)[0], 0.5e-3), (60, 100))
    np.testing.assert_array_equal(result.surface.height_m, expected.height_m)


@pytest.mark.parametrize(
    ("width_m", "margin"), [(50e-6, (1, 1)), (120e-6, (2, 3)), (51e-6, (1, 2))]
)
def test_the_margin_is_cut_off(width_m, margin):
    z = rough()
    inner = z[margin[0] : NY - margin[0], margin[1] : NX - margin[1]]
    found = condition(HeightMap(z, PIXEL_M), "none", edge_trim_m=width_m).surface
    np.testing.assert_array_equal(found.height_m, inner)
    framed = np.pad(z, ((4, 0), (1, 7)), constant_values=np.nan)  # its own margin is the scan's
    found = condition(HeightMap(framed, PIXEL_M), "none", edge_trim_m=width_m).surface
    np.testing.assert_array_equal(found.height_m, inner)


@pytest.mark.parametrize("width_m", [0.0, -1e-3, 3.6e-3, 1.0, np.nan, np.inf])
def test_an_impossible_margin_is_refused(width_m):
    framed = np.pad(rough(), 40, constant_values=np.nan)
    for z in (rough(), framed):
        with pytest.raises(SettingsError, match="edge_trim_m"):
            condition(HeightMap(z, PIXEL_M), edge_trim_m=width_m)


def test_unknown_rule_and_form_are_refused():
    with pytest.raises(SettingsError, match="median"):
        condition(HeightMap(rough(), PIXEL_M), outliers="median")
    with pytest.raises(SettingsError, match="cubic"):
        condition(HeightMap(rough(), PIXEL_M), "cubic")


@pytest.mark.parametrize("form", ["plane", "none"])
def test_a_map_without_a_height_is_refused(form):
    with pytest.raises(UnusableSurfaceError, match="non-measured"):
        condition(HeightMap(np.full((NY, NX), np.nan), PIXEL_M), form)


# What is said about a map


def codes(z, pixel_m=SQUARE_M, form="plane", **options):
    found = condition(HeightMap(z, pixel_m), form, **options).problems
    return {problem.code: problem.severity for problem in found}


def test_a_plausible_face_raises_no_doubt():
    assert codes(rough()) == {}


@pytest.mark.parametrize(
    ("pixel_m", "severity"),
    [(PIXEL_M, "info"), ((50e-6, 110e-6), "info"), ((50e-6, 500e-6), "warning")],
)
def test_non_square_pixels_are_mentioned(pixel_m, severity):
    assert codes(rough(), pixel_m) == {"non_square_pixels": severity}


def test_heights_beyond_the_face_are_a_unit_error():
    assert codes(1e6 * rough()) == {"slope_suspect": "error"}


def test_steep_heights_are_suspect():
    assert codes(3e2 * rough()) == {"slope_suspect": "warning"}


def test_heights_below_an_atom_and_a_face_of_ten_metres_are_suspect():
    assert codes(1e-5 * rough()) == {"scale_suspect": "warning"}
    assert codes(rough(), (0.1, 0.1)) == {"scale_suspect": "warning"}


def test_removed_outliers_are_counted_for_information():
    assert codes(spiky(3)) == {"outliers_removed": "info"}
    message = condition(HeightMap(spiky(3), SQUARE_M)).problems[0].message
    assert message.startswith("3 points")
    assert "3 of them upwards" in message


def test_many_outliers_are_a_warning():
    z = rough()
    z[2::6, 2::6] += 1e-5
    assert codes(z) == {"outliers_removed": "warning"}


def test_kept_spikes_matter_where_they_are_touched_or_move_the_form():
    up, down, deep = (rough() + 5e-7 * np.sin(COL / 20) for _ in range(3))
    up[40, 50] += 5e-6
    down[40, 50] -= 5e-6
    deep[40, 50] -= 1e-4
    assert codes(up, outliers="none") == {"spikes": "warning"}
    assert codes(down, outliers="none") == {"spikes": "info"}
    assert codes(deep, outliers="none") == {"spikes": "warning", "outliers": "info"}


def test_heights_far_from_the_rest_matter_where_they_are_touched():
    hill = np.exp(-((ROW - 60) ** 2 + (COL - 80) ** 2) / 8.0)
    assert codes(rough() + 1e-5 * hill) == {"outliers": "warning"}
    assert codes(rough() - 1e-5 * hill) == {"outliers": "info"}


def test_the_sanity_line_says_what_was_read():
    z = rough()
    z[:12] = np.nan
    surface = HeightMap(z, PIXEL_M, Origin(height_unit="um"))
    line = sanity_line(surface, 1e-7, 8.6e-6)
    assert line == (
        "170 x 120 points of 50 x 60 um (not square), 8.5 x 7.2 mm; heights stored in um; "
        "10 % non-measured; Sq 100 nm, Sz 8.6 um, Sz/Sq 86"
    )


# The whole way


def caps_of(surface):
    result = condition(surface)
    hills = find_hills(result.surface)
    caps, families = group_families(fit_caps(result.surface, hills, "pinned"))
    return result, caps, families


@pytest.mark.parametrize("name", ["paper_face_a", "paper_face_b"])
def test_tilt_missing_points_and_spikes_leave_the_caps_alone(name):
    clean = load_surface(SAMPLES / f"{name}.h5")
    rng = np.random.default_rng(4)
    nx = clean.shape[1]
    z = clean.height_m + 1e-3 * np.arange(nx) / nx
    at = rng.choice(z.size, 100, replace=False)
    z.reshape(-1)[at] += 2.1e-6 * rng.choice((-1.0, 1.0), 100)  # 1000 times the roughness
    z[rng.random(z.shape) < 0.05] = np.nan

    _, expected, families = caps_of(clean)
    result, caps, found = caps_of(replace(clean, height_m=z))
    assert result.steps[1]["removed"] == np.count_nonzero(~np.isnan(z.reshape(-1)[at]))
    assert (found.m, found.n) == (families.m, families.n)
    assert found.h_m == pytest.approx(families.h_m, rel=0.01)
    for one, other in ((found.G, families.G), (found.P, families.P)):
        for key in ("radius_m", "diameter_m", "height_m", "peak_height_m"):
            assert getattr(one, key) == pytest.approx(getattr(other, key), rel=0.01), key
    apart = np.hypot(caps.x_m[:, None] - expected.x_m, caps.y_m[:, None] - expected.y_m)
    pair = apart.argmin(axis=1)
    assert sorted(pair) == list(range(len(expected)))
    for key, within in (("peak_height_m", 0.01), ("diameter_m", 0.01), ("radius_m", 0.01)):
        values = getattr(caps, key), getattr(expected, key)[pair]
        np.testing.assert_allclose(*values, rtol=within, err_msg=key)
    np.testing.assert_allclose(caps.radius_m.mean(), expected.radius_m.mean(), rtol=0.01)


@pytest.mark.parametrize("shape", [None, (57, 82)])
@pytest.mark.parametrize("long_m", [None, 2e-3])
def test_what_a_filter_of_short_waves_took_off_is_kept(long_m, shape):
    """On the points of the surface, without the long waves, and turned with it."""
    more = {"l_filter_nesting_index_m": long_m, "resample_to": shape}
    whole, smooth = (
        condition(HeightMap(rough(), PIXEL_M), s_filter_nesting_index_m=index_m, **more)
        for index_m in (None, 0.5e-3)
    )
    assert whole.with_short_waves is None
    assert whole.with_short_waves_as_turned() is None
    assert whole.rough.shape == whole.surface.shape
    np.testing.assert_array_equal(smooth.with_short_waves.height_m, whole.surface.height_m)
    assert smooth.rough is smooth.with_short_waves
    assert smooth.surface.height_m.std() < 0.9 * smooth.rough.height_m.std()
    face = smooth.turned(smooth.surface, (1e-4, -3e-4), (0.0, 0.0), {"step": "level"})
    up_m = face.with_short_waves_as_turned().height_m - smooth.rough.height_m
    (dy_m, dx_m), (row, col) = smooth.surface.pixel_size_m, np.indices(smooth.surface.shape)
    assert np.ptp(up_m - 1e-4 * col * dx_m + 3e-4 * row * dy_m) < 1e-15


@pytest.mark.parametrize("shape", [None, (57, 82)])
def test_what_a_filter_of_long_waves_took_off_is_kept(shape):
    """On the points of the surface, and turned with it."""
    surface = HeightMap(rough(), PIXEL_M)
    whole, short = (
        condition(surface, l_filter_nesting_index_m=index_m, resample_to=shape)
        for index_m in (None, 2e-3)
    )
    assert whole.unfiltered is None
    assert whole.unfiltered_as_turned() is None
    assert whole.whole.shape == whole.surface.shape
    np.testing.assert_array_equal(short.unfiltered.height_m, whole.surface.height_m)
    assert short.whole is short.unfiltered
    (dy_m, dx_m), (row, col) = short.surface.pixel_size_m, np.indices(short.surface.shape)
    plane_m = 1e-4 * (col + 0.5) * dx_m - 3e-4 * (row + 0.5) * dy_m
    turned = replace(short.surface, height_m=short.surface.height_m + plane_m)
    face = short.turned(turned, (1e-4, -3e-4), (0.0, 0.0), {"step": "level"})
    level_m = face.unfiltered_as_turned().height_m - short.unfiltered.height_m - plane_m
    assert np.ptp(level_m) < 1e-15


@pytest.mark.parametrize("shape", [None, (57, 82)])
@pytest.mark.parametrize(
    "form", [{"form": "quadratic"}, {"form": "polynomial", "form_degree": 4}, {"form": "sphere"}]
)
def test_a_form_that_was_taken_off_is_known_beside_a_plane(form, shape):
    """Put back, the map is that which a plane alone was taken off; also as the surface turned."""
    y, x = np.indices(rough().shape) * 1e-4
    surface = HeightMap(rough() - (x - 2e-3) ** 2 / 3.0 - y**2 / 3.0, PIXEL_M)
    level, bent = (condition(surface, **one, resample_to=shape) for one in ({}, form))
    assert level.form is None
    assert level.with_form_as_turned() is None
    off_m = bent.formed.height_m - level.surface.height_m
    bow_m = np.ptp(bent.formed.height_m - bent.surface.height_m)
    within = 1e-4 if shape is None else 0.02  # filters bend a bow at the edges
    assert np.ptp(remove_form(HeightMap(off_m, PIXEL_M), "plane")[0].height_m) < within * bow_m
    assert bow_m > 1e-6
    ny, nx = bent.surface.shape
    tilted = bent.surface.plus(1e-7 * np.arange(nx), np.zeros(ny))
    turned = bent.turned(tilted, (1e-3, 0.0), (0.0, 0.0), {"step": "level"})
    np.testing.assert_allclose(
        turned.with_form_as_turned().height_m - turned.surface.height_m,
        bent.formed.height_m - bent.surface.height_m,
        atol=1e-15,
    )


def test_a_form_below_a_filter_of_long_waves_is_one_of_these():
    given = {"form": "quadratic", "l_filter_nesting_index_m": 2e-3}
    assert condition(HeightMap(rough(), PIXEL_M), **given).form is None


@pytest.mark.long
def test_condition_is_quick_and_small():
    scene = Scene(families=(CapFamily("G", 5, 23.8),), noise_rms_m=2e-9, tilt=(1e-3, 0.0))
    scene = replace(scene, n_spikes=100, spike_m=2e-6, non_measured_fraction=0.05)
    surface, _ = synthetic_surface(scene)
    assert in_filters(lambda: condition(surface)) < 12.0
    tracemalloc.start()
    condition(
        surface,
        "quadratic",
        edge_trim_m=1e-4,
        s_filter_nesting_index_m=0.3e-3,
        l_filter_nesting_index_m=20e-3,
        resample_to=(600, 900),
    )
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 6 * surface.height_m.nbytes
