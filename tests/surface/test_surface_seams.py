"""Seams between fields of view: found where they were put, and not in what smooth or ground is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface import seams as seams_module
from capslip.surface.conditioning import Conditioned
from capslip.surface.doubts import problems_of_seams
from capslip.surface.heightmap import HeightMap
from capslip.surface.seams import LEAST_POINTS, _jumps_m, find_seams, levels_m, tilts_m

SHAPE, PIXEL_M = (120, 200), (1e-4, 1e-4)
ROW, COLUMN = np.mgrid[: SHAPE[0], : SHAPE[1]]


def waves_m(seed=3, width=6.0, rms_m=3e-7):
    z = gaussian_filter(np.random.default_rng(seed).standard_normal(SHAPE), width)
    return rms_m * z / z.std()


def of(height_m):
    return HeightMap(height_m, PIXEL_M)


def noise_m(rms_m, shape=SHAPE):
    return np.random.default_rng(8).normal(0.0, rms_m, shape)


@pytest.mark.parametrize("rms_m", [0.0, 4e-9])
@pytest.mark.parametrize("lost", [0.0, 0.1])
def test_fields_of_view_are_found_with_their_levels(rms_m, lost):
    """The offsets are exact but for what noise and the surface leave in the medians."""
    true_m = np.array([[0.0, 9e-8, -6e-8], [5e-8, 2e-8, -1e-7]])
    level_m = true_m[ROW // 60, np.searchsorted([70, 150], COLUMN, side="right")]
    height_m = waves_m() + noise_m(rms_m) + level_m
    height_m[np.random.default_rng(1).random(SHAPE) < lost] = np.nan
    seams = find_seams(of(height_m))
    assert seams.rows.tolist() == [0, 60, 120]
    assert seams.columns.tolist() == [0, 70, 150, 200]
    assert seams.offset_m == pytest.approx(true_m - true_m.mean(), abs=3e-9 + 0.6 * rms_m)
    found_m = levels_m(seams)
    assert found_m[[59, 60], [0, 150]].tolist() == [seams.offset_m[0, 0], seams.offset_m[1, 2]]
    assert np.std(found_m - level_m) < 3e-9 + 0.6 * rms_m


def caps_on_a_floor_m():
    return np.maximum(2e-6 - 4e-8 * ((ROW % 30 - 15) ** 2 + (COLUMN % 40 - 20) ** 2), 0.0)


def test_seams_and_tilts_are_found_once_for_their_doubt_and_for_its_effect(monkeypatch):
    surface = of(caps_on_a_floor_m() + np.where(COLUMN >= 80, 2e-7, 0.0))
    conditioned, found = Conditioned(surface, 0.0, 0.0, (), ()), []
    slopes = seams_module.floor_slopes
    monkeypatch.setattr(seams_module, "floor_slopes", lambda f: found.append(f) or slopes(f))
    assert problems_of_seams(conditioned.seams, 1e-9)
    tilts_m(conditioned.seams)
    assert len(found) == conditioned.seams.offset_m.size == 2


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize("rise_m", [8e-7, -8e-7, 1e-5, 0.0])
def test_tilts_of_fields_are_those_of_their_floors_as_far_as_overlaps_let_them(along, rise_m):
    """Both rise by as much against the mean, 80 x 120 / 200 times the slope: by ten steps at most.

    The step is that between fields, half a pixel from the lines beside it.
    """
    step_m, up = 2e-7, np.clip((COLUMN - 80) / 119, 0.0, None)
    tilted_m = caps_on_a_floor_m() + np.where(COLUMN >= 80, step_m + rise_m * up, 0.0)
    surface = of(tilted_m)
    if along:
        surface = HeightMap(tilted_m.T.copy(), PIXEL_M)
    seams = find_seams(surface)
    found_m = tilts_m(seams).T if along else tilts_m(seams)
    slopes = [(found_m[:, a] - found_m[:, b]).mean() / (a - b) for a, b in ((79, 0), (199, 80))]
    between_m = step_m - 0.5 * rise_m / 119
    assert seams.span_m == pytest.approx(abs(between_m), rel=1e-9)
    expected = min(rise_m / 119, 10.0 * between_m / 48)
    assert slopes[1] - slopes[0] == pytest.approx(expected, rel=0.02, abs=1e-12)
    # The mean of all has none, and there is no step left
    assert 80 * slopes[0] + 120 * slopes[1] == pytest.approx(0.0, abs=1e-11)
    left_m = tilted_m - found_m
    assert np.median(left_m[:, 80] - left_m[:, 79]) == pytest.approx(
        0.0, abs=0.02 * abs(rise_m) + 1e-12
    )


@pytest.mark.parametrize("seed", [1001, 18001, 23001, 112001])
def test_the_straight_valleys_between_caps_are_no_seams(seed):
    """Two that cross would have a field with a step on one side alone."""
    families = CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 2.4e-7)
    scene = Scene((200, 300), (2e-4, 2e-4), seed, families, gap_m=1e-3, balanced=True, floor_m=5e-7)
    seams = find_seams(synthetic_surface(scene)[0])
    assert seams is None or seams.span_m < 1e-15  # lines that jump by nothing on the whole


@pytest.mark.parametrize("seed", [6, 20, 36, 59])
def test_rims_of_caps_on_a_rough_floor_are_no_seams(seed):
    """A rim lies in one part of a line; a seam steps in more of them."""
    families = CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 2.4e-7)
    rough = {"roughness_rms_m": 1e-8, "roughness_length_m": 8e-4, "noise_rms_m": 5e-10}
    scene = Scene((200, 300), (2e-4, 2e-4), seed, families, **rough)
    surface = synthetic_surface(scene)[0]
    assert find_seams(surface) is None
    height_m = surface.height_m + 1e-8 * (np.arange(300) >= 150)
    assert find_seams(replace(surface, height_m=height_m)).columns.tolist() == [0, 150, 300]


def test_seams_do_not_hide_one_another():
    """What a strong one jumps by counts in nothing that a weak one is held against."""
    level_m = np.array([0.0, 1e-6, 9.8e-7, 0.0])[np.searchsorted([30, 62, 94], ROW, side="right")]
    height_m = waves_m() + noise_m(1e-9)
    seams = find_seams(of(height_m + level_m))
    assert seams.rows.tolist() == [0, 30, 62, 94, 120]
    assert seams.offset_m[:, 0] == pytest.approx([-4.95e-7, 5.05e-7, 4.85e-7, -4.95e-7], abs=5e-9)


@pytest.mark.parametrize("seed", range(4))
def test_neither_a_lay_nor_lines_of_their_own_hide_a_seam(seed):
    """Both let one expect how a line lies by those beside it."""
    rng = np.random.default_rng(seed)
    lay_m = gaussian_filter(rng.standard_normal(SHAPE), (40.0, 1.5))
    lay_m *= 1.5e-7 / lay_m.std()
    lines_m = rng.normal(0.0, 1e-8, (1, SHAPE[1]))
    for hiding_m, step_m in ((lay_m, 4e-8), (waves_m(seed) + lines_m, 1.5e-7)):
        assert find_seams(of(hiding_m)) is None
        seams = find_seams(of(hiding_m + step_m * (COLUMN >= 110)))
        assert seams.columns.tolist() == [0, 110, 200]
        assert seams.rows.tolist() == [0, 120]


def test_edges_of_a_boss_on_one_floor_are_no_seams():
    """They jump along a quarter of a line, and the floor beside it goes on."""
    between = (COLUMN >= 70) & (COLUMN < 150)
    boss_m = 1e-7 * between * np.cos(np.pi / 80 * np.minimum(ROW, 40)) ** 2
    assert find_seams(of(boss_m)) is None
    assert find_seams(of(boss_m + 1e-8 * between)).span_m == pytest.approx(1e-8)


def test_fields_that_are_tilted_against_one_another_have_seams():
    """No level of each explains all of the jumps."""
    tilted_m = waves_m() + 3e-9 * (ROW - 60) * (COLUMN >= 70) + 6e-8 * (ROW >= 60)
    seams = find_seams(of(tilted_m))
    assert seams.rows.tolist() == [0, 60, 120]
    assert seams.columns.tolist() == [0, 70, 200]


@pytest.mark.parametrize(("column", "found"), [(15, False), (16, True), (184, True), (185, False)])
def test_a_seam_bounds_fields_of_16_lines_and_more(column, found):
    seams = find_seams(of(waves_m() + 9e-8 * (column <= COLUMN)))
    assert (seams is not None and seams.columns.tolist() == [0, column, 200]) == found


@pytest.mark.parametrize(("other_m", "found"), [(4e-8, True), (6e-8, False)])
def test_a_seam_is_alone_but_for_what_jumps_by_less_than_half_of_it(other_m, found):
    """As lines of a lay are not, and rims of hills are."""
    seams = find_seams(of(1e-7 * (COLUMN >= 100) + other_m * (COLUMN >= 120) + noise_m(1e-10)))
    assert (seams is not None and seams.columns.tolist() == [0, 100, 200]) == found


@pytest.mark.parametrize(("rise_m", "apart"), [(0.0, 1.0), (2e-7, 3.0)])
def test_fields_that_differ_by_more_than_a_tenth_of_the_approach_are_doubted(rise_m, apart):
    """By their levels, or their tilts: of two floors."""
    up = np.clip((COLUMN - 100) / 99, 0.0, None)
    surface = of(caps_on_a_floor_m() + np.where(COLUMN >= 100, 5e-8 + rise_m * up, 0.0))
    height_m = float(np.ptp(tilts_m(find_seams(surface))))
    assert height_m == pytest.approx(apart * 5e-8, rel=0.2)
    assert [one.code for one in problems_of_seams(find_seams(surface), 9.9 * height_m)] == ["seams"]
    assert problems_of_seams(find_seams(surface), 10.1 * height_m) == []
    assert find_seams(of(waves_m())) is None


def test_the_jump_between_lines_is_the_median_of_what_is_known():
    lines_m = np.random.default_rng(6).random((16, 21))
    lines_m[7, : 21 - LEAST_POINTS] = lines_m[11, : 22 - LEAST_POINTS] = np.nan
    lines_m[3, 0] = np.nan
    step_m = np.diff(lines_m, axis=0)
    expected = np.nanmedian(step_m[1:-1] - 0.5 * (step_m[:-2] + step_m[2:]), axis=1)
    expected[8:12] = np.nan  # of seven points
    assert _jumps_m(lines_m) == pytest.approx(expected, rel=1e-12, nan_ok=True)
    assert np.isfinite(expected).sum() == 9


def test_rows_and_columns_are_alike():
    height_m = waves_m() + 5e-8 * (COLUMN >= 110)
    one, other = find_seams(of(height_m)), find_seams(of(height_m.T.copy()))
    assert one.columns.tolist() == other.rows.tolist() == [0, 110, 200]
    assert np.abs(one.offset_m.T - other.offset_m).max() < 1e-19


@pytest.mark.parametrize(
    "height_m",
    [
        waves_m(),
        waves_m(width=2.0),
        noise_m(1e-8),
        waves_m() + noise_m(2e-8, (1, SHAPE[1])),  # each line of its own
        waves_m() + np.cumsum(noise_m(5e-9, (SHAPE[0], 1)), axis=0),  # a drift
        waves_m() - 1e-6 * ((COLUMN >= 80) & (COLUMN < 90)),  # a groove
        waves_m() + 1e-6 * (COLUMN == 80),  # a line
        2e-7 * np.sin(COLUMN * 0.1) + 0.0 * ROW,  # ridges
        1e-7 * np.floor(waves_m() / 1e-7),  # terraces
        waves_m() + 2e-7 * (COLUMN > ROW),  # a step that runs along no axis
        1e-9 * COLUMN + 2e-9 * ROW,
        np.zeros(SHAPE),
        waves_m()[:20, :20] + 1e-6 * (COLUMN[:20, :20] > 10),  # too small to tell
    ],
)
def test_what_is_no_seam_is_none(height_m):
    assert find_seams(of(height_m)) is None


def bend_m(place, power):
    """Return a slope, or a curvature, that begins at a place and goes on to the first column.

    It falls by 10 nm over the first pixel.
    """
    return -1e-8 * np.clip(place - COLUMN, 0.0, None) ** power


def lines_between(height_m, along):
    """Return the seams across the columns, of a map of these or one that was turned."""
    seams = find_seams(of(height_m.T.copy() if along else height_m))
    if seams is None:
        return []
    across, others = (seams.rows, seams.columns) if along else (seams.columns, seams.rows)
    assert others.size == 2
    return across[1:-1].tolist()


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize(
    ("place", "power"), [(40.0, 1), (40.25, 1), (40.75, 1), (40.25, 2), (40.5, 2), (40.75, 2)]
)
def test_an_edge_that_begins_at_a_line_is_no_seam(place, power, along):
    """Chamfers have a kink, rounded edges the onset of a curvature: nothing steps."""
    bent_m = waves_m() + bend_m(place, power)
    assert lines_between(bent_m, along) == []
    assert lines_between(bent_m[:, ::-1], along) == []


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize(("place", "power"), [(40.25, 1), (40.25, 2)])
def test_a_step_where_an_edge_begins_is_a_seam(place, power, along):
    """That on the one side alone, not what the edges of both sides have without it."""
    bent_m = waves_m() + bend_m(place, power) + bend_m(place, power)[:, ::-1]
    assert lines_between(bent_m, along) == []
    assert lines_between(bent_m + 3e-8 * (COLUMN >= 160), along) == [160]
    assert lines_between(bent_m + 3e-8 * (COLUMN >= 40), along) == [40]


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3])
def test_a_step_that_a_resampled_map_shares_between_two_lines_is_a_seam(share):
    """A line within it makes two kinks, of which each alone would explain much."""
    step_m = 9e-8 * np.clip(COLUMN - 109 - share, 0.0, 1.0)
    for along in (0, 1):
        assert lines_between(waves_m() + step_m, along) == [110]


def test_a_form_changes_nothing():
    """A plane has no jumps, a bow only those of its curvature, which all lines share."""
    height_m = waves_m() + 4e-8 * (ROW >= 50)
    form_m = 1e-6 * COLUMN + 2e-5 * (ROW / 120) ** 2
    one, other = find_seams(of(height_m)), find_seams(of(height_m + form_m))
    assert one.rows.tolist() == other.rows.tolist()
    assert one.offset_m == pytest.approx(other.offset_m, abs=1e-10)


@pytest.mark.parametrize(("n_points", "found"), [(31, False), (32, True)])
def test_a_seam_is_told_by_four_parts_of_eight_points(n_points, found):
    lines_m = (waves_m() + 9e-8 * (COLUMN >= 110))[:n_points]
    for height_m in (lines_m, lines_m.T.copy()):
        seams = find_seams(of(height_m))
        assert (seams is not None and seams.offset_m.size == 2) == found


def test_a_height_that_all_points_share_takes_no_digit_of_a_seam():
    height_m = waves_m() + 5e-8 * (COLUMN >= 110)
    one, other = find_seams(of(height_m)), find_seams(of(height_m + 1.0))
    assert other.columns.tolist() == one.columns.tolist() == [0, 110, 200]
    assert other.offset_m == pytest.approx(one.offset_m, abs=1e-13)


def test_lines_that_are_lost_whole_or_in_part_hide_no_seam_beside_them():
    height_m = waves_m() + 5e-8 * (COLUMN >= 110)
    height_m[:, 40:44] = np.nan
    height_m[:85, 105:115] = np.nan  # three of four parts
    assert find_seams(of(height_m)).columns.tolist() == [0, 110, 200]


def fields(found, shape, turn):
    """Return seams and levels as of the map before it was turned."""
    rows, columns, offset_m = found.rows, found.columns, found.offset_m
    if turn[0]:
        rows, offset_m = shape[0] - rows[::-1], offset_m[::-1]
    if turn[1]:
        columns, offset_m = shape[1] - columns[::-1], offset_m[:, ::-1]
    return rows.tolist(), columns.tolist(), offset_m


@pytest.mark.parametrize("turn", [(True, False), (False, True), (True, True)])
def test_the_lines_that_are_compared_are_those_of_the_mirrored_map(turn, monkeypatch):
    """What of each part is looked at decides on a seam that hardly stands off."""
    shape = (701, 963)  # two and three lines apart, and nothing that divides
    height_m = np.random.default_rng(2).standard_normal(shape)
    seen, jumps_m = [], seams_module._jumps_m
    monkeypatch.setattr(
        seams_module, "_jumps_m", lambda lines: seen.append(jumps_m(lines)) or seen[-1]
    )
    turned_m = height_m[tuple(np.s_[::-1] if one else np.s_[:] for one in turn)]
    for one_m in (height_m, turned_m):
        find_seams(of(one_m))
    whole, mirrored = seen[:8], seen[-8:]
    assert len(seen) == 16
    for axis in (0, 1):  # jumps along an axis, of four parts along the other
        parts, others = (one[4 * axis : 4 * axis + 4] for one in (whole, mirrored))
        others = others[::-1] if turn[1 - axis] else others
        for part, other in zip(parts, others, strict=True):
            assert np.array_equal(part, -other[::-1] if turn[axis] else other)


@pytest.mark.parametrize(("first", "found"), [(15, False), (16, True)])
def test_a_margin_that_was_not_measured_is_no_field(first, found):
    """Fields count from what was measured, at either side, and so do their tilts."""
    frame = ((25, 30), (40, 18))
    for turn in ((False, False), (False, True)):
        height_m = waves_m() + 9e-8 * (first <= COLUMN) + 3e-9 * (ROW - 60) * (ROW >= 60)
        height_m += 6e-8 * (ROW >= 60)
        height_m = height_m[:, ::-1] if turn[1] else height_m
        around = find_seams(of(np.pad(height_m, frame, constant_values=np.nan)))
        whole = find_seams(of(height_m))
        expected = [0, first, 200] if found else [0, 200]
        assert fields(whole, SHAPE, turn)[:2] == ([0, 60, 120], expected)
        assert (around.rows[1:-1] - 25).tolist() == whole.rows[1:-1].tolist()
        assert (around.columns[1:-1] - 40).tolist() == whole.columns[1:-1].tolist()
        assert around.offset_m == pytest.approx(whole.offset_m, rel=1e-9)
        assert tilts_m(around)[25:-30, 40:-18] == pytest.approx(tilts_m(whole), rel=1e-9, abs=1e-18)
        assert np.ptp(tilts_m(around)) == pytest.approx(np.ptp(tilts_m(whole)), rel=1e-9)
