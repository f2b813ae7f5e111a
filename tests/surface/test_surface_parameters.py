"""Parameters after ISO 25178-2: closed forms, another library's values, invariances, gaps."""

import json
import math
from dataclasses import asdict

import numpy as np
import pytest
from iso_maps import VALUES, maps
from scipy.ndimage import gaussian_filter

from capslip.caps.features import feature_parameters
from capslip.caps.iso25178 import Iso25178
from capslip.errors import UnusableSurfaceError
from capslip.surface import parameters
from capslip.surface import spectrum as spectrum_module
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from capslip.surface.parameters import material_ratio_curve, surface_parameters
from capslip.surface.spectrum import carried_waves_m, line_spectrum

MAPS, PEER = maps(), json.loads(VALUES.read_text(encoding="utf-8"))
HEIGHTS = ("Sa_m", "Sq_m", "Ssk", "Sku", "Sp_m", "Sv_m", "Sz_m")


def of(name):
    height_um, (dy_um, dx_um) = MAPS[name]
    return HeightMap(1e-6 * height_um, (1e-6 * dy_um, 1e-6 * dx_um))


@pytest.mark.parametrize("name", MAPS)
def test_height_parameters_are_those_of_another_library(name):
    ours = surface_parameters(of(name))
    for key in HEIGHTS:
        unit = 1e-6 if key.endswith("_m") else 1.0
        theirs = PEER[name][key.removesuffix("_m")] * unit
        assert getattr(ours, key) == pytest.approx(theirs, rel=1e-9, abs=1e-12 * unit)


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize(("sign", "v"), [(1.0, "p"), (-1.0, "v")])
def test_feature_parameters_are_those_of_another_library(name, sign, v):
    """Its densities are over (nx - 1) (ny - 1) pixels, so the counts are compared."""
    surface, peer = of(name), PEER[name]
    ours = feature_parameters(HeightMap(sign * surface.height_m, surface.pixel_size_m))
    assert ours.closed_hills == peer[f"S{v}d_count"]
    if name != "sine":  # whose crests are lines of equal points
        assert ours.hills_at_5_percent == peer[f"S{v}d_count_open"]
    area_m2 = surface.height_m.size * surface.pixel_area_m2
    assert ours.Spd_per_m2 * area_m2 == pytest.approx(ours.closed_hills)
    if ours.closed_hills:
        assert ours.Spc_per_m == pytest.approx(sign * peer[f"S{v}c"] * 1e6, rel=1e-6)
        assert ours.S5p_m == pytest.approx(peer[f"S5{v}"] * 1e-6, rel=1e-6)


@pytest.mark.parametrize("name", MAPS)
def test_texture_is_that_of_another_library_but_for_its_rounding(name):
    """It rounds Sal to its own grid of lags, and its direction, y downwards, to half a degree."""
    ours, peer = surface_parameters(of(name)), PEER[name]
    pixel_m = max(of(name).pixel_size_m)
    assert ours.Sal_m == pytest.approx(peer["Sal"] * 1e-6, abs=pixel_m)
    if peer["Str"] is None:
        assert math.isnan(ours.Str)
    elif name in ("isotropic", "lay"):  # periodic, as both take a map to be
        assert ours.Str == pytest.approx(peer["Str"], rel=0.1)
    if name in ("sine", "lay"):  # with a direction
        apart = math.degrees(ours.Std_rad) + peer["Std_deg"]
        assert abs((apart + 90.0) % 180.0 - 90.0) <= 5.0  # degrees, of 60 waves


def test_a_sine_has_the_parameters_of_the_books():
    x = np.arange(4000) + 0.5
    wave = HeightMap(np.tile(3e-6 * np.sin(2 * np.pi * x / 200), (40, 1)), (2e-6, 1e-6))
    found = surface_parameters(wave)
    assert found.Sq_m == pytest.approx(3e-6 / math.sqrt(2), rel=1e-12)
    assert found.Sa_m == pytest.approx(3e-6 * 2 / math.pi, rel=1e-4)
    assert found.Ssk == pytest.approx(0.0, abs=1e-12)
    assert found.Sku == pytest.approx(1.5, rel=1e-12)
    assert found.Sz_m == pytest.approx(6e-6, rel=1e-3)
    # The autocorrelation is cos(2 pi t / 200 um)
    assert found.Sal_m == pytest.approx(200e-6 * math.acos(0.2) / (2 * math.pi), rel=1e-3)
    assert found.Std_rad == 0.0
    assert math.isnan(found.Str)  # no decay along the crests


def test_a_tilted_plane_and_a_paraboloid_have_closed_forms():
    """Midpoint sums: uniform heights have Sku 9/5; a sum of two squares -12/7 and so on."""
    y, x = (np.mgrid[0:400, 0:400] + 0.5) / 200 - 1.0  # -1 ... 1
    plane = surface_parameters(HeightMap(1e-6 * x, (1e-6, 1e-6)))
    assert (plane.Sq_m, plane.Sa_m) == pytest.approx((1e-6 / math.sqrt(3), 0.5e-6), rel=1e-5)
    assert (plane.Ssk, plane.Sku) == pytest.approx((0.0, 1.8), abs=1e-4)
    # z = -(x^2 + y^2): variance 2 (1/5 - 1/9), third moment -2 (1/7 - 3/15 + 2/27)
    bowl = surface_parameters(HeightMap(-1e-6 * (x**2 + y**2), (1e-6, 1e-6)))
    variance, third = 2 * (1 / 5 - 1 / 9), -2 * (1 / 7 - 3 / 15 + 2 / 27)
    assert bowl.Sq_m == pytest.approx(1e-6 * math.sqrt(variance), rel=1e-4)
    assert bowl.Ssk == pytest.approx(third / variance**1.5, rel=1e-3)
    assert (bowl.Sp_m, bowl.Sv_m) == pytest.approx((2e-6 / 3, 4e-6 / 3), rel=0.02)


def test_spc_and_spd_of_spheres_are_their_radius_and_number():
    """The cross-check of caps per area and mean 1/R, on a face without noise."""
    from scenes import caps_map

    rng = np.random.default_rng(6)
    places = [((2 * j + 1) * 2.5e-3, (2 * i + 1) * 2.5e-3) for i in range(4) for j in range(6)]
    caps = [(x, y, rng.uniform(20.0, 30.0), 1e-8 * rng.uniform()) for x, y in places]
    face = caps_map(caps, pixel_size_m=(1e-4, 1e-4))
    found = feature_parameters(face)
    inner = [cap for cap in caps if 3e-3 < cap[0] < 27e-3 and 3e-3 < cap[1] < 17e-3]
    assert (found.hills_at_5_percent, found.closed_hills) == (24, 8)
    assert len(inner) == 8
    assert found.Spd_per_m2 == pytest.approx(8 / (30e-3 * 20e-3))
    assert found.Spc_per_m == pytest.approx(np.mean([1.0 / R for *_, R, _ in inner]), rel=1e-4)
    assert found.Sha_m2 == pytest.approx(5e-3**2, rel=0.1)
    highest_m = sorted(top_m for *_, top_m in inner)[-5:]
    # A grid point lies up to half a pixel off the apex, along both axes
    below_m = np.mean(highest_m) - face.height_m.mean() - found.S5p_m
    assert 0.0 <= below_m <= 2 * 5e-5**2 / (2 * 20.0)


def test_hills_beside_a_hole_are_closed_and_those_beside_the_outside_are_not():
    height_um, _ = MAPS["isotropic"]
    whole = HeightMap(1e-6 * height_um, (1e-6, 1e-6))
    row, column = np.unravel_index(np.argmax(height_um[20:-20, 20:-20]), (80, 120))
    holed = whole.height_m.copy()
    holed[row + 20, column + 23] = np.nan
    one = feature_parameters(HeightMap(holed, (1e-6, 1e-6)))
    assert one.closed_hills == feature_parameters(whole).closed_hills
    framed = np.full((140, 200), np.nan)
    framed[10:-10, 20:-20] = whole.height_m
    inside = asdict(feature_parameters(HeightMap(framed, (1e-6, 1e-6))))
    assert inside == pytest.approx(asdict(feature_parameters(whole)))


def test_non_measured_points_are_left_out_and_none_measured_is_an_error():
    surface = of("isotropic")
    height_m = surface.height_m.copy()
    lost = np.random.default_rng(0).random(height_m.shape) < 0.2
    height_m[lost] = np.nan
    found = surface_parameters(HeightMap(height_m, surface.pixel_size_m))
    left = surface.height_m[~lost]
    assert found.Sq_m == pytest.approx(left.std(), rel=1e-12)
    assert found.Sp_m == pytest.approx(left.max() - left.mean(), rel=1e-12)
    whole = surface_parameters(surface)
    assert found.Sal_m == pytest.approx(whole.Sal_m, rel=0.02)
    for function in (surface_parameters, feature_parameters):
        with pytest.raises(UnusableSurfaceError, match="all 9 points are non-measured"):
            function(HeightMap(np.full((3, 3), np.nan), (1.0, 1.0)))


def test_turning_scaling_and_lifting_the_map_change_what_they_should():
    height_um, (dy_um, dx_um) = MAPS["lay"]
    plain = surface_parameters(of("lay"))
    turned = HeightMap(1e-6 * height_um.T, (1e-6 * dx_um, 1e-6 * dy_um))
    other = surface_parameters(turned)
    assert other.Std_rad == pytest.approx(math.pi / 2 - plain.Std_rad, abs=0.02)
    assert (other.Sal_m, other.Str) == pytest.approx((plain.Sal_m, plain.Str), rel=1e-9)
    there, here = (Iso25178(condition(one, "none", outliers="none")) for one in (of("lay"), turned))
    np.testing.assert_allclose(here.along_x.density_m3, there.along_y.density_m3, 1e-9, 1e-27)
    lifted = HeightMap(3e-6 * height_um + 1.0, of("lay").pixel_size_m)
    assert surface_parameters(lifted).Sq_m == pytest.approx(3 * plain.Sq_m, rel=1e-8)
    assert surface_parameters(lifted).Sku == pytest.approx(plain.Sku, rel=1e-8)
    flat = surface_parameters(HeightMap(np.full((5, 6), 2.0), (1.0, 1.0)))
    assert (flat.Sq_m, flat.Sz_m) == (0.0, 0.0)
    assert math.isnan(flat.Ssk)
    assert math.isnan(flat.Sal_m)


def falls_to_a_fifth(correlation, pixel_um):
    """Distances at which the lobe around lag (0, 0) falls to 0.2, by walking over its points."""
    middle = tuple(n // 2 for n in correlation.shape)
    found, seen, todo = [], {middle}, [middle]
    while todo:
        at = todo.pop()
        for step in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            to = at[0] + step[0], at[1] + step[1]
            assert all(0 <= i < n for i, n in zip(to, correlation.shape, strict=True))
            if correlation[to] > 0.2:
                todo += [] if to in seen else [to]
                seen.add(to)
                continue
            share = (correlation[at] - 0.2) / (correlation[at] - correlation[to])
            lag = (np.array(at) + share * np.array(step) - middle) * pixel_um
            found.append(np.hypot(*lag))
    return np.array(found)


@pytest.mark.parametrize("shape", [(24, 31), (31, 24), (30, 32)])
@pytest.mark.parametrize("gaps", [0.0, 0.1])
@pytest.mark.parametrize("first_lags", [2, 32])
def test_sal_and_str_are_those_of_sums_over_shifted_maps(shape, gaps, first_lags, monkeypatch):
    """However far around the middle the lobe is looked for first."""
    monkeypatch.setattr(parameters, "FIRST_LAGS", first_lags)
    rng = np.random.default_rng(7)
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])
    waves = np.fft.rfft2(rng.normal(size=shape)) * np.exp(-((8.0 * fy) ** 2) - (6.0 * fx) ** 2)
    z = np.fft.irfft2(waves, s=shape)
    z[rng.random(shape) < gaps] = np.nan
    z -= np.nanmean(z)
    found = surface_parameters(HeightMap(1e-6 * z, (2e-6, 1e-6)))
    correlation = np.array(
        [
            [np.nanmean(z * np.roll(z, (i - shape[0] // 2, j - shape[1] // 2), (0, 1)))
             for j in range(shape[1])]
            for i in range(shape[0])
        ]
    )  # fmt: skip
    distance_um = falls_to_a_fifth(correlation / correlation.max(), (2.0, 1.0))
    assert found.Sal_m == pytest.approx(1e-6 * distance_um.min(), rel=1e-9)
    assert found.Str == pytest.approx(distance_um.min() / distance_um.max(), rel=1e-9)


def test_the_abbott_curve_holds_its_share_of_points_above_every_height():
    surface = of("spheres")
    ratio, height_m = material_ratio_curve(surface, 11)
    assert (ratio[0], ratio[-1]) == (0.0, 1.0)
    above = [(surface.height_m >= one_m).mean() for one_m in height_m]
    np.testing.assert_allclose(above, ratio, atol=1.0 / surface.height_m.size + 1e-12)


def test_the_integral_of_a_spectrum_is_the_mean_square():
    x_m = np.arange(1000) * 1e-6
    wave = 2e-9 * np.sin(2 * np.pi * x_m / 50e-6)
    seen = line_spectrum(np.tile(wave, (3, 1)), 1e-6)
    assert seen.density_m3.sum() * seen.frequency_per_m[0] == pytest.approx(2e-18, rel=1e-9)
    assert seen.frequency_per_m[np.argmax(seen.density_m3)] == pytest.approx(1 / 50e-6)
    assert seen.frequency_per_m[-1] == pytest.approx(0.5e6)
    gaps = np.tile(wave, (3, 1))
    gaps[:, [3, 4, 400, 999]] = np.nan
    gaps[2, :700] = np.nan  # this line is left out
    bridged = line_spectrum(gaps, 1e-6)
    assert bridged.density_m3.sum() * bridged.frequency_per_m[0] == pytest.approx(2e-18, rel=0.02)
    assert np.isnan(line_spectrum(np.full((3, 8), np.nan), 1.0).density_m3).all()


@pytest.mark.parametrize("n", [159, 160])
def test_the_spectrum_is_the_periodogram_of_scipy(n):
    from scipy.signal import periodogram

    height_m = of("isotropic").height_m[:, :n]
    frequency_per_m, density_m3 = periodogram(height_m, 1e6, window="hann", detrend="constant")
    ours = line_spectrum(height_m, 1e-6)
    np.testing.assert_allclose(ours.frequency_per_m, frequency_per_m[1:])
    mean_m3 = density_m3.mean(axis=0)[1:]
    np.testing.assert_allclose(ours.density_m3, mean_m3, 1e-9, 1e-12 * mean_m3.max())


def test_noise_ends_the_waves_that_a_map_carries():
    """The map has no waves shorter than some pixels: below them there is the noise alone."""
    rng = np.random.default_rng(5)
    height_um, _ = maps()["isotropic"]
    noisy = HeightMap(
        1e-6 * (height_um + 0.05 * rng.standard_normal(height_um.shape)), (1e-4, 1e-4)
    )
    shortest_m, longest_m = carried_waves_m(noisy, 5e-8)
    assert 2e-4 < shortest_m < 12e-4
    assert longest_m == pytest.approx(120e-4)
    spectrum = line_spectrum(noisy.height_m, 1e-4)
    below = spectrum.frequency_per_m > 1.5 / shortest_m
    level_m3 = 2.0 * 5e-8**2 * 1e-4
    assert spectrum.density_m3[below].mean() == pytest.approx(level_m3, rel=0.3)
    assert carried_waves_m(noisy, 0.0)[0] == pytest.approx(2e-4)  # the pixel alone
    assert carried_waves_m(noisy, 0.0, 3e-3, 5e-3) == pytest.approx((3e-3, 5e-3))
    for asked_m in (0.5 * shortest_m, shortest_m, 2.0 * shortest_m):  # the same answer to both
        enough = carried_waves_m(noisy, 5e-8, enough_m=asked_m)[0] <= asked_m
        assert enough == (shortest_m <= asked_m)


def test_waves_that_drown_along_one_axis_are_carried_along_the_other():
    """Grooves along x: noise hides what is along them, and none of what crosses them."""
    rng = np.random.default_rng(6)
    grooves_um = np.cumsum(rng.standard_normal((120, 1)), axis=0)
    noisy = HeightMap(1e-6 * (grooves_um + 0.01 * rng.standard_normal((120, 120))), (1e-4, 1e-4))
    assert carried_waves_m(noisy, 1e-8)[0] == pytest.approx(2e-4)
    turned = HeightMap(noisy.height_m.T, (1e-4, 1e-4))
    assert carried_waves_m(turned, 1e-8)[0] == pytest.approx(2e-4)


def test_a_map_that_was_turned_has_the_parameters_of_the_map_as_levelled():
    surface = of("lay")
    levelled = condition(surface, outliers="none")
    slope, at_m = (3e-3, -2e-3), (40e-6, 90e-6)
    y_m, x_m = (
        (np.arange(n) + 0.5) * d for n, d in zip(surface.shape, surface.pixel_size_m, strict=True)
    )
    plane_m = slope[0] * (x_m - at_m[0]) + (slope[1] * (y_m - at_m[1]))[:, None]
    map_m = HeightMap(levelled.surface.height_m + plane_m, surface.pixel_size_m)
    turned = levelled.turned(map_m, slope, at_m, {"step": "level"})
    found = Iso25178(turned)
    assert found.field.Sq_m == pytest.approx(levelled.sq_m, rel=1e-9)
    assert found.field.Sz_m == pytest.approx(levelled.sz_m, rel=1e-9)
    assert found.hills is found.hills  # found once
    assert asdict(found.hills) == pytest.approx(asdict(feature_parameters(levelled.surface)))
    upside_down = HeightMap(-levelled.surface.height_m, surface.pixel_size_m)
    assert asdict(found.dales) == pytest.approx(asdict(feature_parameters(upside_down)))
    numbers = found.to_dict(with_hills=True)
    assert numbers["Sq_m"] == found.field.Sq_m
    without = found.to_dict(with_hills=False)
    assert numbers["closed_hills"] == found.hills.closed_hills
    assert without == numbers | dict.fromkeys((*asdict(found.hills), "S10z_m", "Sda_m2"))


@pytest.mark.parametrize("name", MAPS)
def test_ten_point_height_and_the_area_of_dales_are_those_of_the_map_and_of_it_upside_down(name):
    surface, peer = of(name), PEER[name]
    upside_down = HeightMap(-surface.height_m, surface.pixel_size_m)
    as_it_is = {"form": "none", "outliers": "none"}
    found, other = (
        Iso25178(condition(one, **as_it_is)).to_dict(with_hills=True)
        for one in (surface, upside_down)
    )
    if found["closed_hills"]:
        assert found["S10z_m"] == pytest.approx((peer["S5p"] + peer["S5v"]) * 1e-6, rel=1e-6)
    for one, its in (("S10z_m", "S10z_m"), ("Sda_m2", "Sha_m2"), ("Sha_m2", "Sda_m2")):
        assert found[one] == pytest.approx(other[its], rel=1e-12, nan_ok=True)


def smooth_and_noisy_m(shape):
    rng = np.random.default_rng(6)
    smooth = gaussian_filter(rng.standard_normal(shape), 4)
    return 1e-7 * smooth + 1e-9 * rng.standard_normal(shape)


@pytest.mark.parametrize("turn", [np.s_[::-1], np.s_[:, ::-1]])
def test_a_mirrored_map_is_asked_for_its_waves_on_the_same_lines(turn, monkeypatch):
    """Some rows and some columns are looked at, every second and every third."""
    seen = []
    monkeypatch.setattr(
        spectrum_module,
        "line_spectrum",
        lambda lines_m, pixel_m: seen.append(lines_m) or line_spectrum(lines_m, pixel_m),
    )
    height_m = smooth_and_noisy_m((150, 200))
    for one_m in (height_m, height_m[turn]):
        assert carried_waves_m(HeightMap(one_m, (1e-5, 1e-5)), 1e-9)[0] > 3e-5  # noise decides
    rows, columns, rows_turned, columns_turned = seen
    assert len(rows) < 80
    assert len(columns) < 80
    of_columns = np.s_[:, ::-1] if isinstance(turn, slice) else np.s_[::-1]
    assert np.array_equal(rows_turned, rows[turn])
    assert np.array_equal(columns_turned, columns[of_columns])


def test_waves_are_carried_by_what_was_measured():
    height_m = smooth_and_noisy_m((150, 200))
    around_m = np.pad(height_m, ((40, 7), (3, 60)), constant_values=np.nan)
    found, within = (
        carried_waves_m(HeightMap(one_m, (1e-5, 1e-5)), 1e-9) for one_m in (height_m, around_m)
    )
    assert found[0] > 3e-5
    assert found[1] == pytest.approx(150e-5)
    assert within == pytest.approx(found, rel=1e-12)
