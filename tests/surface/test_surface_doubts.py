"""Doubts about a height map, on both sides of each threshold."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip.errors import UnusableSurfaceError
from capslip.surface import doubts
from capslip.surface.doubts import (
    points_line,
    problems_of_map,
    problems_of_outliers,
    problems_of_scan,
    problems_of_tilt,
    refuse_absurd,
    sanity_line,
    sizes_fit,
)
from capslip.surface.flatness import _floor, bow_of_form_m, problems_of_fit, problems_of_form
from capslip.surface.form import level_and_straight, remove_form
from capslip.surface.heightmap import HeightMap, Origin
from capslip.surface.outliers import Outliers


def codes(problems):
    return {problem.code: problem.severity for problem in problems}


def heights(*values, pixel_m=(1.0, 1.0)):
    """Return a map of 3 x 3 points with these heights first, the rest zero."""
    height_m = np.zeros(9)
    height_m[: len(values)] = values
    return HeightMap(height_m.reshape(3, 3), pixel_m)


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        (heights(1e6, pixel_m=(1e5, 1e5)), None),
        (heights(1.001e6), "heights of up to"),
        (heights(-1.001e6), "heights of up to"),
        (heights(6e5, -6e5), "a height range of"),
        (heights(9e-21), "heights of up to"),
        (heights(1.1e-20), None),
        (HeightMap(np.full((3, 3), 1.0), (1.0, 1.0)), None),  # equal heights
        (HeightMap(np.full((3, 3), np.nan), (1.0, 1.0)), None),
        (heights(pixel_m=(1.0, 3.4e5)), "a side of"),
        (heights(pixel_m=(3.4e5, 1.0)), "a side of"),
        (heights(pixel_m=(3e-21, 1.0)), "a side of"),
        (heights(pixel_m=(1.0, 3e-21)), "a side of"),
        (heights(), None),
    ],
)
def test_lengths_that_no_unit_makes_plausible_are_refused(surface, said):
    if said is None:
        refuse_absurd(surface)
    else:
        with pytest.raises(UnusableSurfaceError, match=said):
            refuse_absurd(surface)


@pytest.mark.parametrize(
    ("n_top", "n_next", "clipped"),
    [(9, 2, True), (8, 1, False), (9, 3, False), (8, 2, False), (12, 3, False), (13, 3, True)],
)
def test_nine_points_at_the_top_and_four_times_the_next_level_are_clipped(n_top, n_next, clipped):
    height_m = np.zeros(100)
    height_m[:n_top], height_m[n_top : n_top + n_next] = 2.0, 1.0
    height_m[-1] = np.nan
    found = problems_of_scan(HeightMap(height_m.reshape(10, 10), (1.0, 1.0)), None)
    assert codes(found) == ({"clipped": "warning"} if clipped else {})


@pytest.mark.parametrize("height_m", [np.zeros((4, 4)), np.full((4, 4), np.nan)])
def test_a_flat_or_an_empty_map_is_not_clipped(height_m):
    assert problems_of_scan(HeightMap(height_m, (1.0, 1.0)), None) == []


@pytest.mark.parametrize(
    ("restored", "left", "said"),
    [
        (0, 4, "cut the peaks off, and the caps are higher than they look"),
        (2, 0, "; 2 tops were put back as their flanks carry on, the highest by 5e-07 m with a "
         "standard error of 3e-08 m"),
        (2, 4, "3e-08 m; 4 stay flat: their flanks do not tell"),
    ],
)  # fmt: skip
def test_tops_that_were_put_back_are_told_with_the_error_of_the_highest(restored, left, said):
    height_m = np.zeros(100)
    height_m[:9], height_m[9:11] = 2.0, 1.0
    tops = SimpleNamespace(
        counts={"restored": restored},
        up_m=np.array([2e-7, 5e-7, 1e-7]),
        height_se_m=np.array([1e-8, 3e-8, 9e-8]),
        left=left,
    )
    (found,) = problems_of_scan(HeightMap(height_m.reshape(10, 10), (1.0, 1.0)), tops)
    assert found.message.startswith("9 points share the greatest height")
    assert found.message.endswith(said)


def test_points_between_those_that_were_measured_are_told_along_their_own_axes(monkeypatch):
    surface = HeightMap(np.zeros((4, 4)), (1e-6, 5e-6))
    monkeypatch.setattr(doubts, "pixels_apart", lambda surface: (3, 2))
    (found,) = doubts.problems_of_points(surface)
    assert (found.code, found.severity) == ("interpolated", "warning")
    assert "every 3. row and every 2. column was measured" in found.message
    assert "pixels of 3e-06 x 1e-05 m (dy x dx)" in found.message
    for apart, said in (((1, 7), "every 7. column was"), ((7, 1), "every 7. row was")):
        monkeypatch.setattr(doubts, "pixels_apart", lambda surface, apart=apart: apart)
        assert doubts.problems_of_points(surface)[0].message.startswith(said)
    monkeypatch.setattr(doubts, "pixels_apart", lambda surface: (1, 1))
    assert doubts.problems_of_points(surface) == []


def ramp(slope_y, slope_x, pixel_m, shape=(40, 30)):
    y_m, x_m = (np.arange(n) * size_m for n, size_m in zip(shape, pixel_m, strict=True))
    return HeightMap(slope_y * y_m[:, None] + slope_x * x_m, pixel_m)


@pytest.mark.parametrize(("slope_y", "slope_x"), [(3.0, 0.0), (0.0, 3.0), (3.0, 4.0)])
def test_slopes_are_those_along_both_axes_by_their_own_pixels(slope_y, slope_x):
    """Lines of 39 steps along y and 29 along x: 30 and 40 of them."""
    surface = ramp(slope_y, slope_x, (1e-6, 1.0005e-6))
    n_y, n_x = 39 * 30, 29 * 40
    rms = np.sqrt((n_y * slope_y**2 + n_x * slope_x**2) / (n_y + n_x))
    steep = (n_y * (slope_y > 1) + n_x * (slope_x > 1)) / (n_y + n_x)
    found = problems_of_map(surface, 1e-5, 2e-5)
    assert codes(found) == {"slope_suspect": "warning"}
    assert f"rms slope {rms:.2g}, {100 * steep:.1f} %" in found[0].message


def test_oblong_pixels_have_their_own_slopes():
    # 1.2 along y, 0.3 along x; with the sizes of the pixels exchanged, 0.6 each
    surface = ramp(1.2, 0.3, (1e-6, 2e-6), (30, 30))
    (found,) = (one for one in problems_of_map(surface, 1e-5, 2e-5) if one.code == "slope_suspect")
    assert f"rms slope {np.sqrt((1.2**2 + 0.3**2) / 2):.2g}, 50.0 %" in found.message


@pytest.mark.parametrize(
    ("slope", "n_steep", "said"), [(0.999, 0, False), (1.001, 0, True), (0.0, 1, False)]
)
def test_slopes_beyond_one_are_doubted(slope, n_steep, said):
    surface = ramp(slope, slope, (1e-6, 1e-6))
    height_m = surface.height_m.copy()
    height_m[:n_steep, :] += 1.5e-6
    found = problems_of_map(HeightMap(height_m, (1e-6, 1e-6)), 1e-5, 2e-5)
    assert ("slope_suspect" in codes(found)) == said


@pytest.mark.parametrize(("n_steps", "said"), [(2, False), (4, True)])
def test_more_than_a_twentieth_of_steep_slopes_is_doubted(n_steps, said):
    """Steps of 1.5 along x in 30 of 40 x 29 + 39 x 40 slopes each, the rest flat."""
    height_m = np.zeros((40, 40))
    for at in range(n_steps):
        height_m[:, 8 * (at + 1) :] += 1.5e-6 * (-1) ** at
    share = n_steps * 40 / (2 * 39 * 40)
    assert (share > 0.05) == said
    found = problems_of_map(HeightMap(height_m, (1e-6, 1e-6)), 1e-6, 1.5e-6)
    assert ("slope_suspect" in codes(found)) == said


@pytest.mark.parametrize(("n_steep", "said"), [(2, False), (3, True)])
def test_a_twentieth_of_steep_slopes_is_none(n_steep, said):
    """Of 40 slopes; a corner has two of them, another point on the edge three."""
    height_m = np.zeros((5, 5))
    height_m[0, n_steep - 2] = 1.5
    found = problems_of_map(HeightMap(height_m, (1.0, 1.0)), 1.0, 1.5)
    assert ("slope_suspect" in codes(found)) == said


def test_every_line_of_a_small_map_has_its_slopes():
    height_m = np.zeros((9, 11))
    height_m[:, 5] = 40e-6  # two steep steps of ten along x, none along y
    found = problems_of_map(HeightMap(height_m, (1e-6, 1e-6)), 40e-6, 4e-6)
    assert f"{100 * 18 / (9 * 10 + 8 * 11):.1f} % of the slopes" in found[0].message
    assert f"rms slope {40 * np.sqrt(18 / (9 * 10 + 8 * 11)):.2g}" in found[0].message


def test_slopes_are_sampled_on_a_hundred_lines_and_need_no_measured_point():
    surface = ramp(2.0, 0.0, (1e-6, 1e-6), (20, 400))
    height_m = surface.height_m.copy()
    height_m[:, 1::2] = np.nan  # between the lines along y; none is left along x
    found = problems_of_map(HeightMap(height_m, (1e-6, 1e-6)), 1e-5, 1e-5)
    assert "rms slope 2, 100.0 %" in found[0].message
    lost = np.full((4, 4), np.nan)
    lost[1, 1] = 0.0
    assert problems_of_map(HeightMap(lost, (1e-6, 1e-6)), 1e-5, 2e-6) == ()


@pytest.mark.parametrize(
    ("of_limit", "steep_top", "severity"),
    [(0.99, False, "info"), (1.01, False, "warning"), (0.99, True, "warning")],
)
def test_walls_are_noted_where_the_face_is_touched_on_gentle_slopes(of_limit, steep_top, severity):
    """Ninety columns of a deep zigzag, and a ramp on which a quarter of its rms slope is left."""
    n_y, n_x, n_top, step = 50, 100, 10, 4.0
    n_all, n_of_top = n_y * (n_x - 1) + n_x * (n_y - 1), n_y * (n_top - 1) + n_top * (n_y - 1)
    along_ramp = n_y * (n_top - 1)
    walls = n_y * (n_x - n_top) * step**2 / n_all  # in the mean square slope
    limit = np.sqrt(walls / (along_ramp / n_of_top / 0.25**2 - along_ramp / n_all))
    ramp = 1.5 * (np.arange(n_top) > 4) if steep_top else of_limit * limit * np.arange(n_top)
    columns = np.append(step * (np.arange(n_x - n_top) % 2 - 2.0), ramp)
    height_m = 1e-6 * np.tile(columns, (n_y, 1))
    found = problems_of_map(HeightMap(height_m, (1e-6, 1e-6)), 1e-5, 2e-5)
    assert codes(found) == {"slope_suspect": severity}
    assert ("deep walls" in found[0].message) == (severity == "info")


FLAT = np.zeros((10, 20))


@pytest.mark.parametrize(
    ("pixel_m", "sz_m", "expected"),
    [
        ((1e-3, 1e-3), 1e-2, {}),  # as high as the shorter side
        ((1e-3, 1e-3), 1.01e-2, {"slope_suspect": "error"}),
        ((1e-3, 1e-3), 1e-10, {}),
        ((1e-3, 1e-3), 0.99e-10, {"scale_suspect": "warning"}),
        ((1e-3, 1e-3), 0.0, {}),
        ((0.05, 0.05), 1e-6, {}),  # 1 m
        ((0.0501, 0.0501), 1e-6, {"scale_suspect": "warning"}),
        ((1e-3, 1.0009e-3), 1e-6, {}),
        ((1e-3, 1.002e-3), 1e-6, {"non_square_pixels": "info"}),
        ((1.002e-3, 1e-3), 1e-6, {"non_square_pixels": "info"}),
        ((9.9e-4, 1e-4), 1e-6, {"non_square_pixels": "info"}),
        ((1e-4, 9.9e-4), 1e-6, {"non_square_pixels": "info"}),
        ((1e-3, 1e-4), 1e-6, {"non_square_pixels": "warning"}),
        ((1e-4, 1e-3), 1e-6, {"non_square_pixels": "warning"}),
    ],
)
def test_a_doubt_about_units_is_raised_just_beyond_its_threshold(pixel_m, sz_m, expected):
    assert codes(problems_of_map(HeightMap(FLAT, pixel_m), sz_m, sz_m)) == expected


@pytest.mark.parametrize(
    ("stated_m", "length_m", "fit"),
    [
        ((1.6e-3, 1e-4), (5e-3, 5e-3), True),
        ((1.6e-3, 1e-4), (8e-3, 4e-3), True),
        ((1.6e-3, 1e-4), (0.5e-3, 0.5e-3), False),  # less than a pixel along y: not seen there
        ((1.6e-3, 1e-5), (5e-3, 5e-3), False),  # one of both ten times too small
        ((1.6e-2, 1e-4), (5e-3, 5e-3), False),
    ],
)
def test_texture_as_long_along_both_axes_says_that_odd_pixels_are_true(stated_m, length_m, fit):
    """White noise under a Gauss of deviation s has half of its correlation left at 2 s ln(2)^.5."""
    true_m = np.array([1.6e-3, 1e-4])
    deviation = np.array(length_m) / (2.0 * np.sqrt(np.log(2.0))) / true_m
    white = np.random.default_rng(0).standard_normal((200, 1600))
    surface = HeightMap(1e-7 * gaussian_filter(white, deviation), stated_m)
    assert sizes_fit(surface) == fit
    if fit:
        assert doubts._half_lengths_m(surface) == pytest.approx(length_m, rel=0.15)


@pytest.mark.parametrize(
    ("highest_m", "sz_m", "expected"),
    [
        (15.0, 30.0, {}),
        (15.0, 30.1, {"outliers": "info"}),
        (14.9, 30.1, {"outliers": "info"}),
        (15.1, 30.1, {"outliers": "warning"}),
    ],
)
def test_a_range_of_thirty_spreads_is_doubted_where_peaks_make_it(highest_m, sz_m, expected):
    height_m = np.zeros((3, 4))
    height_m[0, :2] = highest_m, -highest_m  # a mean of zero
    height_m[2, 3] = np.nan
    found = problems_of_map(HeightMap(height_m, (1e3, 1e3)), 1.0, sz_m)
    found = [one for one in found if one.code == "outliers"]
    assert codes(found) == expected
    if expected:
        length_m = highest_m if "warning" in expected.values() else sz_m - highest_m
        assert f" {length_m:.3g} m " in found[0].message


def outliers(index, step_m):
    return Outliers(np.array(index, dtype=np.int64), np.array(step_m, dtype=float))


@pytest.mark.parametrize(("n", "severity"), [(2, "info"), (3, "warning")])
def test_removed_points_are_too_many_beyond_a_fiftieth(n, severity):
    height_m = np.zeros(100)
    height_m[:n] = np.nan  # removed, as they are now
    surface = HeightMap(height_m.reshape(10, 10), (1.0, 1.0))
    (found,) = problems_of_outliers(surface, 1.0, outliers(range(n), [1.0, 0.0, -1.0][:n]), False)
    assert (found.code, found.severity) == ("outliers_removed", severity)
    assert found.message.startswith(f"{n} points ({n:.2g} %)")
    assert " 1 of them upwards" in found.message
    assert problems_of_outliers(surface, 1.0, outliers([], []), False) == ()


def test_removed_points_are_told_with_those_of_lifted_patches():
    height_m = np.zeros(100)
    height_m[:2] = np.nan
    surface, removed = HeightMap(height_m.reshape(10, 10), (1.0, 1.0)), outliers([0, 1], [1.0, 1.0])
    (found,) = problems_of_outliers(surface, 1.0, removed, False)
    assert found.message.endswith("2 of them upwards, and were marked as non-measured")
    (found,) = problems_of_outliers(surface, 1.0, replace(removed, n_lifted=1), False)
    assert f"; 1 of them {doubts.LIFTED}" in found.message
    errors = outliers(range(20), [1.0, -1.0] * 10)
    height_m[:20] = np.nan
    surface = HeightMap(height_m.reshape(10, 10), (1.0, 1.0))
    (found,) = problems_of_outliers(surface, 1.0, errors, False)
    assert "; as many stand off downwards, as far: errors, no burrs" in found.message
    many = outliers(range(20), [1.0] * 20)
    (found,) = problems_of_outliers(surface, 1.0, many, False)
    assert found.message.endswith("non-measured: too many for spikes")


@pytest.mark.parametrize(
    ("wide", "signs", "severity"),
    [(1, (-1.0, 1.0), "info"), (1, (1.0, 1.0), "warning"), (2, (-1.0, 1.0), "warning")],
)
def test_many_removed_points_are_errors_where_each_is_for_itself_and_up_is_like_down(
    wide, signs, severity
):
    """Points and pairs of them at random places, 6 % of the map; pillars stand up or are wide."""
    rng = np.random.default_rng(6)
    step_m = np.zeros((100, 101))
    row, col = np.divmod(rng.choice(99 * 100, 600 // wide, replace=False), 100)
    step_m[row, col] = step_m[row + wide - 1, col] = rng.choice(signs, row.size)
    index = np.flatnonzero(step_m)
    height_m = np.where(step_m == 0.0, 0.0, np.nan)
    surface = HeightMap(height_m, (1.0, 1.0))
    removed = outliers(index, step_m.reshape(-1)[index])
    (found,) = problems_of_outliers(surface, 1.0, removed, False)
    assert found.severity == severity
    assert ("too many" in found.message) == (severity == "warning")


@pytest.mark.parametrize(
    ("index", "step_m", "severity"),
    [
        ([50], [0.1], "info"),
        ([89], [0.1], "info"),
        ([90], [0.1], "warning"),  # the highest tenth
        ([50], [14.2], "info"),  # a plane follows by 7 / 100 of the step, 1 % of Sq is 1
        ([50], [14.3], "warning"),
        ([50, 51], [-10.0, 10.0], "warning"),
        ([50, 90], [0.1, 0.1], "warning"),
    ],
)
def test_kept_points_matter_at_the_top_or_where_they_move_the_form(index, step_m, severity):
    height_m = np.append(np.arange(100.0), np.full(10, np.nan)).reshape(11, 10)
    surface = HeightMap(height_m, (1.0, 1.0))
    (found,) = problems_of_outliers(surface, 100.0, outliers(index, step_m), True)
    assert (found.code, found.severity) == ("spikes", severity)
    assert f"; {sum(i >= 90 for i in index)} of them lie in the highest 10 %" in found.message
    assert f"{0.07 * np.abs(step_m).sum():.2g} m" in found.message


@pytest.mark.parametrize(("approach_m", "said"), [(2.0, False), (0.19, False), (0.1899, True)])
def test_a_tilt_beyond_a_tenth_of_the_approach_is_said(approach_m, said):
    # 20 points along x: the plane rises by 0.019 over the middles of the pixels
    surface = ramp(0.0, 0.001, (1.0, 1.0), (10, 20))
    found = problems_of_tilt(surface, approach_m * (1 + 1e-9 * (approach_m == 0.19)))
    assert codes(found) == ({"tilt_left": "warning"} if said else {})
    if said:
        assert "tilted by 0.019 m" in found[0].message


def test_a_tilt_of_a_tenth_is_none(monkeypatch):
    surface = ramp(0.0, 0.001, (1.0, 1.0), (10, 20))
    flat = HeightMap(np.zeros((10, 20)), (1.0, 1.0))
    monkeypatch.setattr(doubts, "remove_form", lambda *_: (flat, None))
    assert problems_of_tilt(surface, float(np.ptp(surface.height_m)) / 0.1) == []


def test_the_line_for_a_glance():
    height_m = np.zeros((10, 20))
    height_m[0, 0] = np.nan
    surface = HeightMap(height_m, (2e-6, 1e-6), Origin(height_unit="nm"))
    assert sanity_line(surface, 2e-6, 9e-6) == (
        "20 x 10 points of 1 x 2 um (not square), 20 x 20 um; heights stored in nm; "
        "0.5 % non-measured; Sq 2 um, Sz 9 um, Sz/Sq 4.5"
    )
    assert sanity_line(surface, 2e-6, 9e-6).startswith(f"{points_line(surface)}; Sq")
    square = HeightMap(height_m, (1e-6, 1.0005e-6))
    line = sanity_line(square, 0.0, 0.0)
    assert "(not square)" not in line
    assert "20.01 x 10 um; heights stored in an unnamed unit" in line
    assert line.endswith("Sz/Sq -")


def test_slopes_of_one_are_not_yet_steep():
    stairs = np.add.outer(np.arange(20.0), np.arange(20.0))  # exactly 1 along both axes
    assert "slope_suspect" not in codes(problems_of_map(HeightMap(stairs, (1.0, 1.0)), 10.0, 19.0))


def hills_on(floor_m):
    """Return paraboloids that cover 40 % of a floor, and hide it in the variance of all."""
    y, x = np.mgrid[:60, :90] + 0.5
    tops = [20.0 - ((x - at_x) ** 2 + (y - at_y) ** 2) / 8.0
            for at_x in (12.0, 40.0, 70.0) for at_y in (14.0, 44.0)]  # fmt: skip
    return HeightMap(floor_m(x, y) + np.maximum(0.0, np.max(tops, axis=0)), (1.0, 1.0))


@pytest.mark.parametrize(
    ("floor_m", "bow_m"),
    [
        (lambda x, y: 0.0 * x, None),
        (lambda x, y: 0.01 * x, None),
        (lambda x, y: -5.0 * (x > 45.0), None),  # a step is no bow
        (lambda x, y: 5.0 * (x / 45.0 - 1.0) ** 2, 5.0),
        (lambda x, y: 0.01 * x - 5.0 * (y / 30.0 - 1.0) ** 2, 5.0),
    ],
)
def test_a_bow_of_the_floor_is_said_where_hills_hide_it(floor_m, bow_m):
    surface = hills_on(floor_m)
    rough = replace(surface, height_m=surface.height_m + np.random.default_rng(0).normal(
        0.0, 0.05, surface.shape))  # fmt: skip
    for one in (surface, rough):
        low = problems_of_form(one, 1e3)  # far less than the approach
        assert [problem.severity for problem in low] == (["info"] if bow_m else [])
        found = problems_of_form(one, 1.0)
        assert codes(found) == ({} if bow_m is None else {"bow_left": "warning"})
        if bow_m is not None:
            said_m = float(re.search(r"bow of (\S+) m", found[0].message)[1])
            assert said_m == pytest.approx(bow_m, rel=0.05)
            low = replace(one, height_m=1e-3 * one.height_m)
            bow = replace(one, height_m=1e3 * bow_of_form_m(low))  # the peaks may keep it
            assert np.ptp(remove_form(bow, "plane")[0].height_m) == pytest.approx(bow_m, rel=0.05)


def polished(seed, bow, n_pits, deep):
    """Return a face with a bow, in standard deviations of its roughness, and single pits in it."""
    rng = np.random.default_rng(seed)
    z, (y, x) = rng.standard_normal((120, 160)), np.mgrid[-1.0:1.0:120j, -1.0:1.0:160j]
    z += bow * (x**2 + y**2)
    z.flat[rng.choice(z.size, n_pits, replace=False)] -= deep
    return HeightMap(1e-8 * z, (1e-5, 1e-5))


@pytest.mark.parametrize("seed", range(3))
def test_pits_that_carry_nothing_hide_no_bow(seed):
    for n_pits in (0, 20, 200):
        (said,) = problems_of_form(polished(seed, 6.0, n_pits, 80.0), 1e-8)
        assert re.search(r"8\d% of the variance of the heights", said.message)
        assert problems_of_form(polished(seed, 0.5, n_pits, 80.0), 1e-8) == []
    # What goes down in many places is the texture of the face: who knows what lies beside it
    assert problems_of_form(polished(seed, 6.0, 1000, 80.0), 1e-8) == []


@pytest.mark.parametrize("seed", range(11200, 11230))
def test_worn_waves_caps_and_lays_have_no_bow(seed):
    rng, kind = np.random.default_rng(seed), seed % 5
    width, n = rng.uniform(2.0, 10.0), (120, 160)

    def waves(*lengths):
        z = gaussian_filter(rng.standard_normal(n), lengths)
        return z / z.std()

    rough = 0.02 * waves(1.0, 1.0)
    y, x = np.mgrid[: n[0], : n[1]]
    tops = [(x - rng.uniform(8, 150)) ** 2 + (y - rng.uniform(8, 110)) ** 2 for _ in range(9)]
    faces = (
        waves(width, width),
        np.minimum(w := waves(width, width), np.quantile(w, rng.uniform(0.02, 0.5))),
        np.maximum(0.0, 1.0 - np.min(tops, axis=0) / 150.0),
        waves(width, 5.0 * width),
        np.where(rng.random(n) < 1e-3, -9.0, 0.1 * waves(width, width)),
    )
    assert problems_of_form(HeightMap(1e-7 * (faces[kind] + rough), (1e-5, 1e-5)), 1e-8) == []


FORMS = [("quadratic", None), ("sphere", None), ("polynomial", 2), ("polynomial", 5)]


@pytest.mark.parametrize(("form", "degree"), FORMS)
@pytest.mark.parametrize("rough_m", [0.0, 0.05, 0.2, 0.6])
def test_a_form_that_follows_the_hills_is_told_by_the_floor_that_it_bows(form, degree, rough_m):
    """The map less that bow is the level floor, and the form fitted to the floor leaves none."""
    level = hills_on(lambda x, y: 0.0 * x)
    rough = rough_m * np.random.default_rng(1).standard_normal(level.shape)
    high = replace(level, height_m=level.height_m + rough)
    left, _ = remove_form(high, form, degree=degree)
    found = problems_of_fit(left, 1.0, degree or 2)
    assert codes(found) == {"bow_left": "warning"}
    assert codes(problems_of_fit(left, 1e3, degree or 2)) == {"bow_left": "info"}
    made_m, _ = remove_form(replace(level, height_m=left.height_m - high.height_m), "plane")
    said_m = float(re.search(r"bow of (\S+) m", found[0].message)[1])
    assert said_m == pytest.approx(np.ptp(made_m.height_m), rel=0.02 + rough_m)
    assert "may come of the form that was taken off" in found[0].message
    assert found[0].remedy.startswith("--set conditioning.form_floor=true")
    straight = replace(left, height_m=left.height_m - bow_of_form_m(left, degree or 2))
    over_m = remove_form(straight, "plane", floor=True)[0].height_m
    floor = level.height_m == 0.0
    assert np.std(over_m[floor]) == pytest.approx(rough_m, abs=0.02 * said_m)
    fitted, _ = remove_form(high, form, degree=degree, floor=True)
    assert rough_m or problems_of_fit(fitted, 1.0, degree or 2) == []


@pytest.mark.parametrize(("form", "degree"), FORMS)
@pytest.mark.parametrize("width", [1.0, 3.0, 6.0, 15.0])
def test_waves_have_no_floor_that_a_form_could_bow(form, degree, width):
    for seed in range(5):
        z = gaussian_filter(np.random.default_rng(seed).standard_normal((90, 120)), width)
        left, _ = remove_form(HeightMap(z / z.std(), (1.0, 1.0)), form, degree=degree)
        assert problems_of_fit(left, 1e-3, degree or 2) == []


def test_what_is_higher_than_the_relief_is_no_bow_of_a_floor():
    """Few waves, through whose lowest third a form of eight degrees runs off."""
    z = gaussian_filter(np.random.default_rng(0).standard_normal((90, 120)), 16.0)
    left, _ = remove_form(HeightMap(z / z.std(), (1.0, 1.0)), "polynomial", degree=8)
    rest, bow_m, floor_m2 = _floor(left, 8)
    assert rest < 0.8
    assert floor_m2 < 0.01 * left.height_m.var()
    assert bow_m.var() > left.height_m.var()
    assert problems_of_fit(left, 1e-3, 8) == []


def test_the_bow_of_waves_without_a_floor_is_that_of_all_heights():
    z = gaussian_filter(np.random.default_rng(2).standard_normal((90, 120)), 4.0)
    waves = HeightMap(z / z.std() + np.linspace(-1.0, 1.0, 120) ** 2, (1.0, 1.0))
    level, straight = level_and_straight(waves)
    np.testing.assert_array_equal(bow_of_form_m(waves), level.height_m - straight.height_m)


def test_the_next_step_of_a_bow_is_the_form_of_what_shows_it():
    """One that is fitted to hills as well would follow these; of most heights nobody knows it."""
    (of_floor,) = problems_of_form(hills_on(lambda x, y: 5.0 * (x / 45.0 - 1.0) ** 2), 1.0)
    assert of_floor.remedy.startswith(
        "--set conditioning.form=quadratic --set conditioning.form_floor=true"
    )
    bow = np.linspace(-1.0, 1.0, 60)[:, None] ** 2 * np.ones(90)
    (of_all,) = problems_of_form(HeightMap(bow, (1.0, 1.0)), 1.0)
    assert "the heights" in of_all.message
    assert of_all.step is None
    for setting in ("form=quadratic", "form_floor=true", "flatness_deviation_m"):
        assert setting in of_all.remedy


@pytest.mark.parametrize("axes", [(0,), (1,), (0, 1)])
@pytest.mark.parametrize("seed", [1, 2])
def test_rounded_edges_are_no_bow_and_a_bow_with_them_is_one(seed, axes):
    """The face between the edges is as level as before: what straightens the whole bends it."""
    shape, pixel_m = (180, 240), (1e-5, 1e-5)
    waves_m = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), 8.0)
    waves_m *= 1e-7 / waves_m.std()
    edge_m, across_m = np.zeros(shape), np.zeros(shape)
    for axis in axes:
        n = shape[axis]
        place = np.arange(n).reshape((-1, 1) if axis == 0 else (1, -1))
        within = np.clip(n // 15 - np.minimum(place, n - 1 - place), 0, None) * pixel_m[axis]
        edge_m = edge_m - within**2 / (2.0 * 2e-4)
        across_m = across_m + (2.0 * place / (n - 1) - 1.0) ** 2
    for height_m, said in (
        (waves_m + edge_m, []),
        (waves_m - 2e-6 * across_m, ["bow_left"]),
    ):
        found = problems_of_form(HeightMap(height_m, pixel_m), 1e-7)
        assert [one.code for one in found] == said
