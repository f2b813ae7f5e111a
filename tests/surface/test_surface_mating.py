"""Two faces: the second is laid on the first as told, or where it fits."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface.conditioning import condition, sq_and_sz_m
from capslip.surface.form import floor_slopes
from capslip.surface.heightmap import Filling, HeightMap, Origin, Rounding
from capslip.surface.mating import _laid, composite_surface, mate, place, problems_of_mating
from capslip.surface.shifts import tells_apart

D_M = 50e-6
PIXEL_M = (D_M, D_M)


def waves(shape, seed=0, width=8, rms_m=1e-6):
    z = ndimage.gaussian_filter(np.random.default_rng(seed).standard_normal(shape), width)
    return rms_m * z / z.std()


def flat(surface):
    """Least-squares plane off, by a dense solver."""
    z = surface.height_m
    known = ~np.isnan(z)
    y, x = np.nonzero(known)
    matrix = np.stack((np.ones(y.size), y / z.shape[0], x / z.shape[1]), axis=1)
    level = z.copy()
    level[known] -= matrix @ np.linalg.lstsq(matrix, z[known], rcond=None)[0]
    return level


@pytest.mark.parametrize("mirror", ["x", "y"])
def test_without_a_shift_the_heights_of_the_mirrored_face_are_added(mirror):
    a, b = waves((60, 90), 1), waves((60, 90), 2)
    first, second = HeightMap(a, PIXEL_M), HeightMap(b, PIXEL_M)
    both = composite_surface(first, second, place(first, second, mirror=mirror))
    turned = b[:, ::-1] if mirror == "x" else b[::-1]
    np.testing.assert_allclose(both.height_m, flat(HeightMap(a + turned, PIXEL_M)), atol=1e-15)


def test_a_shift_moves_the_second_face_and_leaves_the_rest_non_measured():
    a, b = waves((60, 90), 1), waves((60, 90), 2)
    first, second = HeightMap(a, PIXEL_M), HeightMap(b, PIXEL_M)
    placement = place(first, second, offset_m=(4 * D_M, -7 * D_M))
    both = composite_surface(first, second, placement)
    expected = np.full((60, 90), np.nan)
    expected[4:, :-7] = a[4:, :-7] + b[:-4, ::-1][:, 7:]
    np.testing.assert_allclose(both.height_m, flat(HeightMap(expected, PIXEL_M)), atol=1e-15)


def test_half_a_turn_undoes_one_mirror_and_makes_the_other():
    a, b = waves((60, 90), 1), waves((60, 90), 2)
    first, second = HeightMap(a, PIXEL_M), HeightMap(b, PIXEL_M)
    turned = composite_surface(first, second, place(first, second, rotation_rad=np.pi))
    other = composite_surface(first, second, place(first, second, mirror="y"))
    np.testing.assert_allclose(turned.height_m, other.height_m, atol=1e-14)


@pytest.mark.parametrize("mirror", ["x", "y"])
def test_points_move_with_the_heights(mirror):
    """A peak of the second face stands on the composite where `on_first` says."""
    shape, other = (100, 140), (80, 160)
    y, x = (np.mgrid[: other[0], : other[1]] + 0.5) * D_M
    b = np.exp(-((y - 2.5e-3) ** 2 + (x - 5.2e-3) ** 2) / (2 * 3e-4**2))
    first, second = HeightMap(np.zeros(shape), PIXEL_M), HeightMap(b, PIXEL_M)
    placement = place(first, second, mirror=mirror, offset_m=(2e-4, -5e-4), rotation_rad=0.3)
    both = composite_surface(first, second, placement)
    x_m, y_m = placement.on_first(np.array([5.2e-3]), np.array([2.5e-3]))
    top = np.unravel_index(np.nanargmax(both.height_m), shape)
    assert (top[1] + 0.5) * D_M == pytest.approx(x_m[0], abs=D_M)
    assert (top[0] + 0.5) * D_M == pytest.approx(y_m[0], abs=D_M)
    mirrored = (second.side_m[1] - 5.2e-3, 2.5e-3) if mirror == "x" else (5.2e-3, 80 * D_M - 2.5e-3)
    u, v = mirrored[0] - second.side_m[1] / 2, mirrored[1] - second.side_m[0] / 2
    expected_x = u * np.cos(0.3) - v * np.sin(0.3) + first.side_m[1] / 2 - 5e-4
    expected_y = u * np.sin(0.3) + v * np.cos(0.3) + first.side_m[0] / 2 + 2e-4
    assert (x_m[0], y_m[0]) == pytest.approx((expected_x, expected_y), abs=1e-12)


def test_non_measured_points_of_either_face_are_those_of_the_sum():
    a, b = waves((60, 90), 1), waves((60, 90), 2)
    a[10:20, 30:40] = np.nan
    b[40:50, 5:15] = np.nan
    first, second = HeightMap(a, PIXEL_M), HeightMap(b, PIXEL_M)
    both = composite_surface(first, second, place(first, second))
    np.testing.assert_array_equal(both.measured, ~np.isnan(a) & ~np.isnan(b[:, ::-1]))


def test_a_finer_second_face_is_averaged_to_the_grid_of_the_first():
    fine = waves((240, 360), 3, width=16)
    noise = 1e-7 * np.random.default_rng(4).standard_normal(fine.shape)
    first = HeightMap(np.zeros((60, 90)), PIXEL_M)
    second = HeightMap(fine + noise, (D_M / 4, D_M / 4))
    laid_m = _laid(first, second, place(first, second), spline=True)
    blocks = fine[:, ::-1].reshape(60, 4, 90, 4).mean(axis=(1, 3))
    off = flat(HeightMap(laid_m, PIXEL_M)) - flat(HeightMap(blocks, PIXEL_M))
    assert np.abs(off[3:-3, 3:-3]).std() < 5e-8


def rough_m(x_m, y_m):
    """Return waves of 8 and 12 fine pixels, 4 and 6 coarse ones."""
    along_m = 0.6 * x_m + 0.8 * y_m
    return 1e-6 * (np.cos(2 * np.pi * x_m / (4 * D_M)) + np.cos(2 * np.pi * along_m / (6 * D_M)))


def face_of(height_m, shape, pixel_m):
    y_m, x_m = ((np.arange(n) + 0.5) * size_m for n, size_m in zip(shape, pixel_m, strict=True))
    return HeightMap(height_m(x_m[None, :], y_m[:, None]), pixel_m)


def nothing_m(x_m, y_m):
    return 0.0 * (x_m + y_m)


FINE, COARSE = ((120, 180), (D_M / 2, D_M / 2)), ((60, 90), PIXEL_M)


def test_a_coarse_first_face_keeps_all_of_a_finer_second_one():
    """W of a rough face was 11 % off where a flat one of pixels twice as large came first."""
    rough, coarse = face_of(rough_m, *FINE), face_of(nothing_m, *COARSE)
    both = composite_surface(coarse, rough, place(coarse, rough))
    expected = flat(HeightMap(rough.height_m[:, ::-1], rough.pixel_size_m))
    assert both.pixel_size_m == pytest.approx(rough.pixel_size_m, rel=1e-12)
    np.testing.assert_allclose(both.height_m, expected, atol=1e-14)


@pytest.mark.parametrize("long", [(120, 90), (60, 180)])
def test_a_sum_has_the_finer_pixels_of_both_whichever_comes_first(long):
    pixel_m = 60 * D_M / long[0], 90 * D_M / long[1]
    one, other = face_of(rough_m, *FINE), HeightMap(waves(long, 1), pixel_m)
    first_one = composite_surface(one, other, place(one, other))
    first_other = composite_surface(other, one, place(other, one))
    assert first_one.shape == first_other.shape == FINE[0]
    np.testing.assert_allclose(first_other.height_m[:, ::-1], first_one.height_m, atol=1e-12)


def test_pixels_that_hardly_differ_are_those_of_the_first():
    for times, shape in ((1.08, (60, 90)), (1.2, (72, 108))):
        first, second = (
            face_of(rough_m, *COARSE),
            HeightMap(waves((100, 150), 1), (D_M / times, D_M / times)),
        )
        assert composite_surface(first, second, place(first, second)).shape == shape


def test_a_tiny_second_face_makes_no_sum_of_more_points_than_both_have_use_for():
    first, second = (
        HeightMap(waves(n, 1), (size_m, size_m))
        for n, size_m in (((60, 90), D_M), ((200, 300), D_M / 12))
    )
    both = composite_surface(first, second, place(first, second))
    assert both.size == pytest.approx(4 * 200 * 300, rel=0.02)
    assert both.side_m == pytest.approx(first.side_m, rel=1e-12)


def test_on_finer_points_the_first_face_lies_still():
    """What is said of places holds: where the faces are, and the part of each in the sum."""
    first, second = (
        condition(
            face_of(
                lambda x_m, y_m: (
                    1e-6
                    * np.exp(-((x_m - 2.6e-3) ** 2 + (y_m - 0.9e-3) ** 2) / (2 * (4 * D_M) ** 2))
                ),
                *of,
            )
        )
        for of in (COARSE, FINE)
    )
    laid = place(first.surface, second.surface, offset_m=(3e-4, -2e-4), rotation_rad=0.3)
    both = mate(first, second, laid)
    assert both.surface.pixel_size_m == pytest.approx((D_M / 2, D_M / 2), rel=1e-12)
    x_m, y_m = laid.on_first(np.array([2.6e-3]), np.array([0.9e-3]))
    for height_m, at in (
        (both.second_m, (y_m[0], x_m[0])),
        (both.surface.height_m - both.second_m, (0.9e-3, 2.6e-3)),
    ):
        top = np.unravel_index(np.nanargmax(height_m), height_m.shape)
        assert (np.array(top) + 0.5) * D_M / 2 == pytest.approx(at, abs=0.4 * D_M)


def worn_pair(offset_m, rotation_rad, mirror, noise_m=3e-8, second_pixel_m=D_M):
    """Cut a face, and one that bears its print, out of a larger piece."""
    large = waves((460, 620), 0)
    first = HeightMap(large[30:430, 30:590], PIXEL_M)
    ny, nx = round(300 * D_M / second_pixel_m), round(480 * D_M / second_pixel_m)
    blank = HeightMap(np.zeros((ny, nx)), (second_pixel_m, second_pixel_m))
    truth = place(first, blank, mirror=mirror, offset_m=offset_m, rotation_rad=rotation_rad)
    y, x = (np.mgrid[:ny, :nx] + 0.5) * second_pixel_m
    on_x, on_y = truth.on_first(x.ravel(), y.ravel())
    places = on_y / D_M + 29.5, on_x / D_M + 29.5
    rng = np.random.default_rng(5)
    z = -ndimage.map_coordinates(large, places, order=3).reshape(ny, nx)
    z += noise_m * rng.standard_normal(z.shape)
    z[rng.random(z.shape) < 0.05] = np.nan
    return first, replace(blank, height_m=z), truth


@pytest.mark.long
@pytest.mark.parametrize(
    ("offset_m", "rotation_rad", "mirror", "second_pixel_m"),
    [
        ((0.0, 0.0), 0.0, "x", D_M),
        ((0.6e-3, -1.23e-3), 0.02, "x", D_M),
        ((-1.0e-3, 1.5e-3), -0.05, "y", D_M),
        ((0.3e-3, 0.2e-3), 0.03, "x", 0.8 * D_M),
    ],
)
def test_a_worn_pair_finds_its_place(offset_m, rotation_rad, mirror, second_pixel_m):
    first, second, truth = worn_pair(offset_m, rotation_rad, mirror, second_pixel_m=second_pixel_m)
    found = place(first, second, mirror=mirror, align="least_squares")
    assert found.offset_m == pytest.approx(offset_m, abs=0.05 * D_M)
    assert found.rotation_rad == pytest.approx(rotation_rad, abs=1e-4)
    assert found.correlation > 0.99
    both = composite_surface(first, second, found)
    assert np.nanstd(both.height_m) < 5e-8
    assert problems_of_mating(both, found, first, second) == ()
    assert truth.correlation is None


@pytest.mark.parametrize(("height", "unit"), [(0.4, 1.0), (2.5, 1.0), (0.4, 1e-6)])
def test_a_print_finds_its_place_however_high_it_and_the_faces_are(height, unit):
    """Where the second face is the smoother one, steps of the sum alone overshoot and end."""
    first_m = unit * waves((200, 300), width=4)
    second = HeightMap(-height * first_m[:, ::-1], PIXEL_M)
    found = place(HeightMap(first_m, PIXEL_M), second, align="least_squares")
    assert found.offset_m == pytest.approx((0.0, 0.0), abs=0.02 * D_M)
    assert found.rotation_rad == pytest.approx(0.0, abs=1e-4)
    assert found.correlation == pytest.approx(2 * height / (1 + height**2), rel=1e-3)


@pytest.mark.long
def test_faces_that_have_nothing_to_do_with_each_other_are_said_to():
    first = HeightMap(waves((120, 180), 1, width=4), PIXEL_M)
    second = HeightMap(waves((120, 180), 2, width=4), PIXEL_M)
    found = place(first, second, align="least_squares")
    problems = problems_of_mating(composite_surface(first, second, found), found, first, second)
    assert [p.code for p in problems] == ["mating_unrelated"]


def grooved_pair(cross, seed):
    """Grooves along y with so much of other waves, and the print of them at a place."""
    rng, (ny, nx) = np.random.default_rng(seed), (120, 160)
    length, phase = np.exp(rng.uniform(np.log(4.0), np.log(20.0), 40)), rng.uniform(0, 6.28, 40)
    wave = rng.uniform(7.5, 40.0, 60), rng.uniform(0, 6.28, 60), rng.uniform(0, 6.28, 60)

    def height_m(x, y):
        grooves = sum(
            np.cos(2 * np.pi * x / long + at) for long, at in zip(length, phase, strict=True)
        )
        others = sum(
            np.cos(2 * np.pi * (np.cos(turn) * x + np.sin(turn) * y) / long + at)
            for long, turn, at in zip(*wave, strict=True)
        )
        return 5e-8 * (grooves + cross * others)

    y, x = np.mgrid[:ny, :nx] + 0.5 - np.reshape((ny, nx), (2, 1, 1)) / 2
    turn, dy, dx = 0.01, 5.0, -10.0
    on_x = -np.cos(turn) * x - np.sin(turn) * y + dx
    on_y = -np.sin(turn) * x + np.cos(turn) * y + dy
    first, second = (HeightMap(z, PIXEL_M) for z in (height_m(x, y), -0.8 * height_m(on_x, on_y)))
    return first, second, (dy * D_M, dx * D_M)


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 6])
def test_grooved_faces_find_their_place_along_the_lay_too(seed):
    """Half a map off the grooves match on half of the points as well as on all of them."""
    first, second, offset_m = grooved_pair(0.1, seed)
    found = place(first, second, align="least_squares")
    assert found.offset_m == pytest.approx(offset_m, abs=0.1 * D_M)
    assert found.rotation_rad == pytest.approx(0.01, abs=2e-4)
    assert found.other is None or abs(found.other.offset_m[0] - offset_m[0]) > 5 * D_M


@pytest.mark.long
@pytest.mark.parametrize(("cross", "sure"), [(0.0, False), (0.01, False), (0.3, True)])
def test_places_along_a_lay_that_are_as_good_are_said(cross, sure):
    first, second, (dy_m, dx_m) = grooved_pair(cross, 3)
    found = place(first, second, align="least_squares")
    assert found.correlation > 0.9
    assert found.offset_m[1] == pytest.approx(dx_m, abs=0.1 * D_M)
    problems = problems_of_mating(composite_surface(first, second, found), found, first, second)
    assert [one.code for one in problems] == ([] if sure else ["mating_unrelated"])
    if sure:
        assert found.offset_m[0] == pytest.approx(dy_m, abs=0.1 * D_M)
    else:
        assert f"at offset_m = [{found.other.offset_m[0]:.3g}, " in problems[0].message


def test_a_difference_is_told_by_its_blocks():
    rng = np.random.default_rng(0)
    rest_m, more_m = rng.standard_normal((2, 100, 140))
    assert tells_apart(rest_m, rest_m + 0.5 * more_m)
    assert not tells_apart(rest_m + 0.5 * more_m, rest_m)
    assert not tells_apart(rest_m, more_m)
    # All of the difference in one block tells of no other one
    one = rest_m.copy()
    one[:12, :17] *= 3.0
    assert not tells_apart(rest_m, one)
    beside_m = rest_m.copy()
    beside_m[:, 12:] = np.nan
    assert tells_apart(beside_m, rest_m + 0.5 * more_m)
    beside_m[12:] = np.nan
    for few_m in (beside_m, np.full_like(rest_m, np.nan)):
        assert not tells_apart(few_m, rest_m + 0.5 * more_m)


def test_little_overlap_is_said_and_none_is_refused():
    face = HeightMap(waves((60, 90)), PIXEL_M)
    beside = place(face, face, offset_m=(0.0, 60 * D_M))
    problems = problems_of_mating(composite_surface(face, face, beside), beside, face, face)
    assert [p.code for p in problems] == ["mating_overlap"]
    for times, codes in ((5.0, []), (6.0, ["mating_overlap"])):  # 4 and 2.8 % of the larger one
        larger = HeightMap(face.height_m, (times * PIXEL_M[0], times * PIXEL_M[1]))
        laid = place(face, larger)
        problems = problems_of_mating(composite_surface(face, larger, laid), laid, face, larger)
        assert [p.code for p in problems] == codes
    barely = place(face, face, offset_m=(0.0, 0.99 * face.side_m[1]))
    with pytest.raises(UnusableSurfaceError, match=r"1.* % of the first face is measured"):
        composite_surface(face, face, barely)
    with pytest.raises(UnusableSurfaceError, match="overlap"):
        composite_surface(face, face, place(face, face, offset_m=(0.0, 1.0)))


@pytest.mark.parametrize("wide", [40, 300])
def test_a_frame_without_a_point_is_no_part_of_a_face_that_is_not_covered(wide):
    """All that was measured of either face lies on the other, as without the frames."""
    faces = [HeightMap(waves((60, 90), seed), PIXEL_M) for seed in (1, 2)]
    framed = [
        replace(one, height_m=np.pad(one.height_m, wide, constant_values=np.nan)) for one in faces
    ]
    bare, found = (mate(*map(condition, both), place(*both)) for both in (faces, framed))
    for one in (bare, found):
        assert not [p for p in one.problems if p.code == "mating_overlap"]
    inner_m = found.surface.height_m[found.surface.measured_window]
    np.testing.assert_allclose(inner_m, bare.surface.height_m, atol=1e-12)


def test_mated_faces_are_conditioned_and_tell_their_steps():
    spiky = waves((60, 90), 2)
    spiky[30, 40] += 1e-4
    first, second = (
        condition(HeightMap(z, PIXEL_M, Origin(name=name)))
        for z, name in ((waves((60, 90), 1), "a"), (spiky, "b"))
    )
    placement = place(first.surface, second.surface)
    both = mate(first, second, placement)
    expected = composite_surface(first.surface, second.surface, placement)
    np.testing.assert_array_equal(both.surface.height_m, expected.height_m)
    assert (both.sq_m, both.sz_m) == sq_and_sz_m(expected)
    assert [step["step"] for step in both.steps] == ["form", "outliers", "mating"]
    assert both.steps[2]["second_steps"][1]["removed"] == 1
    assert [problem.message[:9] for problem in both.problems] == ["b: 1 poin"]
    assert np.count_nonzero(~both.surface.measured) == 1
    less_the_second_m = both.surface.height_m - both.second_m
    less_the_second_m[~both.surface.measured] = first.surface.height_m[~both.surface.measured]
    np.testing.assert_allclose(less_the_second_m, first.surface.height_m, atol=1e-18)
    json.dumps(both.steps, allow_nan=False)


def test_the_sum_of_faces_less_their_forms_knows_that_of_faces_with_them():
    scans = [HeightMap(waves((60, 90), seed), PIXEL_M) for seed in (1, 2)]
    level, bent = ([condition(one, form) for one in scans] for form in ("plane", "quadratic"))
    placement = place(*(one.surface for one in level), offset_m=(3e-4, -7e-4))
    both, mixed = mate(*bent, placement), mate(level[0], bent[1], placement)
    assert mate(*bent, placement, way="together").form is None
    assert mate(*level, placement).with_forms is None
    of_level = [one.surface.height_m for one in level]
    expected = composite_surface(*(one.surface for one in level), placement).height_m
    apart_m = 1e-3 * np.ptp(of_level[0])
    for one in (both, mixed):
        np.testing.assert_allclose(one.with_form_as_turned().height_m, expected, atol=apart_m)
        assert np.nanmax(np.abs(one.surface.height_m - expected)) > 10 * apart_m


@pytest.mark.parametrize("way", ["composite", "together"])
def test_the_sum_of_two_means_has_the_forms_of_the_scans_of_both(way):
    scans = [condition(HeightMap(waves((60, 90), seed), PIXEL_M)) for seed in (1, 2)]
    placement = place(*(one.surface for one in scans), offset_m=(0.0, 0.0))
    for errors_m, expected_m in (((3e-8, 4e-8), 5e-8), ((None, 4e-8), 4e-8), ((None, None), None)):
        faces = [
            replace(one, surface=replace(one.surface, form_error_m=error_m))
            for one, error_m in zip(scans, errors_m, strict=True)
        ]
        found_m = mate(*faces, placement, way=way).surface.form_error_m
        assert found_m == (None if expected_m is None else pytest.approx(expected_m))


@pytest.mark.parametrize("filtered", [(True, True), (True, False), (False, True), (False, False)])
@pytest.mark.parametrize(
    ("kept", "filter_of", "index_m"),
    [
        ("with_short_waves", "s_filter_nesting_index_m", 6.0 * max(PIXEL_M)),
        ("unfiltered", "l_filter_nesting_index_m", 30.0 * min(PIXEL_M)),
    ],
)
def test_the_sum_of_filtered_faces_knows_that_of_faces_with_their_waves(
    kept, filter_of, index_m, filtered
):
    scans = [HeightMap(waves((60, 90), seed), PIXEL_M) for seed in (1, 2)]
    whole = [condition(one) for one in scans]
    faces = [
        condition(one, **({filter_of: index_m} if without else {}))
        for one, without in zip(scans, filtered, strict=True)
    ]
    placement = place(*(one.surface for one in faces), offset_m=(3e-4, -7e-4))
    both = mate(*faces, placement)
    assert getattr(mate(*faces, placement, way="together"), kept) is None
    if not any(filtered):
        assert getattr(both, kept) is None
        return
    expected = composite_surface(*(one.surface for one in whole), placement)
    np.testing.assert_allclose(getattr(both, kept).height_m, expected.height_m, atol=1e-20)


@pytest.mark.parametrize("fewer", [(True, True), (True, False), (False, True), (False, False)])
def test_the_sum_of_faces_of_fewer_points_knows_that_of_what_was_measured(fewer):
    """Whichever of both has fewer; caps of either keep their radii, and are held against none."""
    shape = (60, 90)
    whole = [condition(HeightMap(waves(shape, seed), PIXEL_M)) for seed in (1, 2)]
    faces = [
        condition(HeightMap(waves(shape, seed), PIXEL_M), resample_to=(30, 45) if less else shape)
        for seed, less in zip((1, 2), fewer, strict=True)
    ]
    placement = place(*(one.surface for one in faces), offset_m=(3e-4, -7e-4))
    both = mate(*faces, placement)
    assert mate(*faces, placement, way="together").finer is None
    if not any(fewer):
        assert both.finer is None
        return
    expected = composite_surface(*(one.surface for one in whole), placement)
    assert both.finer.pixel_size_m == pytest.approx(expected.pixel_size_m, rel=1e-12)
    np.testing.assert_allclose(both.finer.height_m, expected.height_m, atol=1e-20)
    assert np.nanstd(both.finer.height_m) > np.nanstd(both.surface.height_m)


@pytest.mark.parametrize(
    "options",
    [
        {"mirror": "z"},
        {"align": "best"},
        {"offset_m": (np.nan, 0.0)},
        {"offset_m": (0.0,)},
        {"rotation_rad": np.inf},
    ],
)
def test_impossible_placements_are_refused(options):
    face = HeightMap(waves((60, 90)), PIXEL_M)
    with pytest.raises(SettingsError, match="mating"):
        place(face, face, **options)


def test_the_sum_is_levelled_as_the_faces_are():
    """Hills on one side of one face tilt the least-squares plane of the sum, and no other."""
    scene = Scene(
        (200, 300), (2e-4, 2e-4), seed=3, families=(CapFamily("G", 6, 23.8),), balanced=False
    )
    hills = condition(synthetic_surface(scene)[0], form_floor=True)
    flat = replace(hills, surface=replace(hills.surface, height_m=np.zeros((200, 300))))
    placement = place(hills.surface, flat.surface)
    tilted, level = (mate(hills, flat, placement, floor=floor) for floor in (False, True))
    on_floor = hills.surface.height_m <= hills.surface.height_m.min() + 1e-15
    inside = np.isfinite(level.surface.height_m) & on_floor
    assert np.ptp(level.surface.height_m[inside]) < 1e-12
    assert np.ptp(tilted.surface.height_m[inside]) > 1e-8


@pytest.mark.parametrize(("ratio", "smoothed"), [(8.0, True), (1.5, True), (1.05, False)])
@pytest.mark.parametrize("axis", [0, 1])
def test_finer_pixels_are_smoothed_to_two_of_the_first_and_equal_ones_are_left(
    axis, ratio, smoothed
):
    """A Gaussian filter leaves 2^-(nesting index / wavelength)^2 of a wave."""
    own_m = [D_M, D_M]
    own_m[axis] = D_M / ratio
    shape = [40, 40]
    shape[axis] = round(40 * ratio)
    place_m = (np.arange(shape[axis]) + 0.5) * own_m[axis]
    from_middle_m = place_m - place_m.mean()  # even, so that levelling takes nothing of it
    wave_m = 1e-6 * np.cos(2.0 * np.pi * from_middle_m / (8.0 * D_M))
    height_m = np.broadcast_to(wave_m[:, None] if axis == 0 else wave_m, shape)
    first, second = HeightMap(np.zeros((40, 40)), PIXEL_M), HeightMap(height_m, tuple(own_m))
    both = _laid(first, second, place(first, second))[8:-8, 8:-8]
    # between two points of the second face a straight line cuts the wave a little
    left = both.std() / wave_m.std() / (2.0 ** -(1 / 16) if smoothed else 1.0)
    assert left == pytest.approx(1.0, abs=0.02 if ratio == 8.0 else 0.09)
    if ratio == 8.0:
        assert both.std() < 0.97 * wave_m.std()


LONG_M = (1e-4, 1e-5)  # pixels ten times as long along y


def laid_wave_m(wavelength_m, along, shape, pixel_m, rotation_rad):
    """Return the rms of a wave of 1 m of the second face on a first one of long pixels."""
    place_m = (np.arange(shape[along]) + 0.5) * pixel_m[along]
    wave = np.sin(2.0 * np.pi * place_m / wavelength_m)
    height_m = np.broadcast_to(wave[:, None] if along == 0 else wave, shape)
    first = HeightMap(np.zeros((100, 1000)), LONG_M)
    second = HeightMap(height_m, pixel_m)
    laid = place(first, second, rotation_rad=rotation_rad)
    return np.sqrt(2.0) * np.nanstd(_laid(first, second, laid, spline=True))


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_a_turned_face_is_smoothed_along_the_long_side_of_the_pixels_of_the_first(turn):
    """On x of the first a wave of ten pixels stays; on y it has the length of one and goes."""
    for along in (0, 1):
        on_x = (along == 1) == (turn % 2 == 0)
        left = laid_wave_m(1.1e-4, along, (1000, 1000), (1e-5, 1e-5), turn * np.pi / 2)
        expected = 1.0 if on_x else 2.0 ** -((2e-4 / 1.1e-4) ** 2)
        assert left == pytest.approx(expected, abs=0.02)


def test_faces_of_the_same_long_pixels_across_each_other_show_no_false_wave():
    left = laid_wave_m(1.1e-4, 1, (100, 1000), LONG_M, np.pi / 2)
    assert left == pytest.approx(2.0 ** -((2e-4 / 1.1e-4) ** 2), abs=0.03)
    assert laid_wave_m(1.1e-4, 1, (100, 1000), LONG_M, 0.0) == pytest.approx(1.0, abs=0.02)


@pytest.mark.long
def test_a_turn_brings_as_much_smoothing_as_the_pixels_of_the_first_lean():
    """A Gaussian leaves 2^-(nesting index / wavelength)^2, of the parts of a pixel on an axis."""
    for rotation_rad in (0.05, 0.1, 0.3, 1.2):
        seen_m = np.hypot(1e-5 * np.cos(rotation_rad), 1e-4 * np.sin(rotation_rad))
        left = laid_wave_m(8e-4, 1, (1000, 1000), (1e-5, 1e-5), rotation_rad)
        unturned = laid_wave_m(8e-4, 1, (1000, 1000), (1e-5, 1e-5), 0.0)
        assert left == pytest.approx(unturned * 2.0 ** -((2.0 * seen_m / 8e-4) ** 2), abs=0.02)


@pytest.mark.parametrize("way", ["composite", "together"])
@pytest.mark.parametrize(
    ("one", "other", "both"),
    [
        (Rounding(1e-9, 3e-10), Rounding(4e-9, 4e-10), Rounding(4e-9, 5e-10)),
        (Rounding(1e-9, 4e-10), Rounding(4e-9, 3e-10, False), Rounding(4e-9, 5e-10, False)),
        (Rounding(4e-9, 3e-10, False), Rounding(1e-9, 4e-10), Rounding(4e-9, 5e-10, False)),
        (Rounding(4e-9, 3e-10, False), None, Rounding(4e-9, 3e-10, False)),
        (None, None, None),
    ],
)
def test_two_faces_in_steps_are_in_the_coarser_ones_whichever_comes_first(one, other, both, way):
    faces = [
        condition(HeightMap(waves((60, 90), seed), PIXEL_M, Origin(name="ab"[seed])))
        for seed in (0, 1)
    ]
    first, second = (
        replace(face, surface=replace(face.surface, rounding=steps))
        for face, steps in zip(faces, (one, other), strict=True)
    )
    for pair in ((first, second), (second, first)):
        surfaces = [face.surface for face in pair]
        found = mate(*pair, place(*surfaces), way=way).surface.rounding
        assert (found is None) == (both is None)
        if both is not None:
            assert found.error_m == pytest.approx(both.error_m, rel=1e-12)
            assert replace(found, error_m=both.error_m) == both


@pytest.mark.parametrize("way", ["composite", "together"])
def test_two_filled_faces_are_as_doubtful_whichever_comes_first(way):
    of_one = Filling(70, 0.7, "cubic", 3e-9, 5e6, np.ones((60, 90), dtype=bool))
    of_other = Filling(90, 0.9, "linear", 4e-9, 8e6)
    faces = [condition(HeightMap(waves((60, 90), seed), PIXEL_M)) for seed in (0, 1, 2)]
    one, other, whole = (
        replace(face, surface=replace(face.surface, filling=filling))
        for face, filling in zip(faces, (of_one, of_other, None), strict=True)
    )
    for pair, expected in (
        ((one, other), Filling(90, 0.9, "linear", 5e-9, 5e6)),
        ((other, one), Filling(90, 0.9, "linear", 5e-9, 5e6)),
        ((one, whole), replace(of_one, measured=None)),
        ((whole, one), replace(of_one, measured=None)),
    ):
        surfaces = [face.surface for face in pair]
        found = mate(*pair, place(*surfaces), way=way).surface.filling
        assert replace(found, error_m=round(found.error_m, 15)) == expected
        assert found.measured is None  # those of one face are none of the sum
    assert mate(whole, whole, place(whole.surface, whole.surface), way=way).surface.filling is None


def test_caps_of_two_faces_have_the_floor_of_their_sum_whichever_comes_first():
    """Turned over, x points the other way."""
    first, second = (condition(HeightMap(waves((60, 90), seed), PIXEL_M)) for seed in (0, 1))
    laid = place(first.surface, second.surface)
    slope_y, slope_x = mate(first, second, laid, way="together").surface.floor_slope
    both = composite_surface(first.surface, second.surface, laid)
    assert (slope_y, slope_x) == floor_slopes(both)
    back = place(second.surface, first.surface)
    swapped = mate(second, first, back, way="together").surface.floor_slope
    assert laid.mirror == "x"
    assert swapped == pytest.approx((slope_y, -slope_x), rel=1e-6)
    assert mate(first, second, laid).surface.floor_slope is None
