"""Repeated scans: what stays is the face, what changes is noise, wherever each scan lies."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates, rotate, shift

from capslip.errors import SettingsError, UnusableSurfaceError
from capslip.surface import average as surface_average
from capslip.surface.average import average, problems_of_places
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap, Origin

SHAPE, PIXEL_M, NOISE_M = (120, 180), (2e-4, 1e-4), 4e-9
Y, X = np.ix_(np.linspace(-1.0, 1.0, SHAPE[0]), np.linspace(-1.0, 1.0, SHAPE[1]))


def waves(seed=0, shape=SHAPE, width=8.0):
    z = gaussian_filter(np.random.default_rng(seed).standard_normal(shape), width, mode="wrap")
    return 3e-7 * z / z.std()


def noise(seed, shape=SHAPE):
    return NOISE_M * np.random.default_rng((5, seed)).standard_normal(shape)


def scans_of(face_m, n=3, noise_of=noise):
    return [HeightMap(face_m + noise_of(k, face_m.shape), PIXEL_M) for k in range(n)]


def rms(z):
    return np.sqrt(np.nanmean(np.square(z - np.nanmean(z))))


@pytest.mark.parametrize("n", [2, 3, 8])
def test_noise_is_what_changes_and_the_mean_has_it_over_the_root_of_their_number(n):
    face_m = waves()
    found = average(scans_of(face_m, n))
    assert found.noise_m == pytest.approx(NOISE_M, rel=0.05)  # of a tenth of the points
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.015)
    assert found.white_m == pytest.approx(NOISE_M, rel=0.06)
    assert found.surface.noise_m == pytest.approx(found.noise_m / np.sqrt(n), rel=1e-12)
    assert rms(found.surface.height_m - face_m) == pytest.approx(NOISE_M / np.sqrt(n), rel=0.02)
    assert (found.spikes, found.fewer, len(found.moved_pixels)) == (0, 0, n)
    assert np.abs(found.moved_pixels).max() < 0.02


def test_of_two_scans_it_is_the_rms_of_their_difference_over_the_root_of_two():
    """The subtraction technique; the 9 numbers that are fitted take next to nothing of it."""
    first, second = scans_of(waves(), 2)
    found = average([first, second])
    apart_m = second.height_m - first.height_m
    assert found.everywhere_m == pytest.approx(rms(apart_m) / np.sqrt(2.0), rel=1e-3)


def test_noise_that_neighbours_share_is_noise_and_no_white_one():
    def shared(seed, shape):
        z = gaussian_filter(noise(seed, shape), 2.0, mode="wrap")
        return NOISE_M * z / z.std()

    found = average(scans_of(waves(), 3, shared))
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.03)
    assert found.white_m < 0.2 * NOISE_M


def test_the_noise_that_counts_is_that_of_what_touches():
    face_m = remove_form(HeightMap(waves(), PIXEL_M), "plane")[0].height_m
    high = face_m > np.quantile(face_m, 0.88)
    found = average(scans_of(face_m, 3, lambda k, _: np.where(high, 1.0, 4.0) * noise(k)))
    assert found.noise_m == pytest.approx(NOISE_M, rel=0.06)
    assert found.everywhere_m == pytest.approx(NOISE_M * np.sqrt(0.12 + 0.88 * 16.0), rel=0.02)


@pytest.mark.parametrize("moved", [(3, -7), (-12, 5), (0.3, -0.4), (2.7, 4.2)])
def test_scans_that_lie_aside_are_found_and_their_move_is_no_noise(moved):
    wide_m = waves(1, (200, 260))
    inside = slice(40, 160), slice(40, 220)
    there_m = shift(wide_m, moved, order=5)[inside]
    found = average(
        [HeightMap(z + noise(k), PIXEL_M) for k, z in enumerate((wide_m[inside], there_m, there_m))]
    )
    assert found.moved_pixels[1:] == pytest.approx(np.tile(moved, (2, 1)), abs=0.05)
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.03)
    whole = np.rint(moved).astype(int)
    assert found.surface.shape == tuple(np.array(SHAPE) - np.abs(whole))
    start = np.maximum(-whole, 0)
    own_m = wide_m[inside][tuple(map(slice, start, start + found.surface.shape))]
    assert rms(found.surface.height_m - own_m) < 1.05 * NOISE_M / np.sqrt(3.0)


@pytest.mark.parametrize("smooth", [0.0, 1.0])
@pytest.mark.parametrize("moved", [(0.45, 0.42), (-0.2, 0.45)])
def test_a_fraction_of_a_pixel_neither_blurs_a_fine_face_nor_is_noise(moved, smooth):
    """The noise of a scan is known to the scatter of the points, that of the mean is what it has.

    The waves are four pixels wide, on a slope along which they would be found beside themselves.
    """

    def shared(seed, shape):
        z = gaussian_filter(noise(seed, shape), smooth, mode="wrap")
        return NOISE_M * z / z.std()

    wide_m = waves(1, (200, 260), 2.0) + 2e-8 * np.arange(260.0)
    inside = slice(40, 160), slice(40, 220)
    there_m = shift(wide_m, moved, order=5)[inside] + 1e-6 * X
    scans = [HeightMap(z + shared(k, SHAPE), PIXEL_M) for k, z in
             enumerate((wide_m[inside], there_m, wide_m[inside], there_m))]  # fmt: skip
    found = average(scans)
    assert found.noise_m == pytest.approx(NOISE_M, rel=0.06)
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.03)
    off_m = remove_form(replace(found.surface, height_m=found.surface.height_m - wide_m[inside]))[0]
    assert rms(off_m.height_m[2:-2, 2:-2]) == pytest.approx(found.surface.noise_m, rel=0.06)
    assert rms(off_m.height_m) < 1.2 * found.surface.noise_m  # less is known at its edge
    if smooth == 0.0:
        assert found.white_m == pytest.approx(NOISE_M, rel=0.08)
        assert found.surface.noise_m < 0.97 * NOISE_M / np.sqrt(4.0)  # splines took some of it


def test_spikes_holes_and_edges_of_scans_that_lie_aside_stay_where_they_are():
    """Nothing of them is drawn over its neighbours, whichever scan has them."""
    wide_m, moved = waves(1, (200, 260), 3.0), (0.45, -0.4)
    inside = slice(40, 160), slice(40, 220)
    face_m, there_m = wide_m[inside], shift(wide_m, moved, order=5)[inside] + 1e-6 * X
    tilted_m = face_m - 3e-6 * Y  # and so is the mean
    heights_m = [z + noise(k) for k, z in enumerate((tilted_m, there_m, face_m, there_m))]
    place = np.s_[10:110:25, 10:170:40]
    for i, one_m in enumerate(heights_m[:2]):
        one_m[place[0], place[1]][i::2, :] += 3e-6
        one_m[place[0].start + 5 :: 25, 15 + i : 170 : 40] = np.nan
    found = average([HeightMap(z, PIXEL_M) for z in heights_m])
    off_m = found.surface.height_m - tilted_m
    assert found.spikes == 16
    assert found.noise_m == pytest.approx(NOISE_M, rel=0.06)
    off_m -= off_m.mean()
    assert np.abs(off_m).max() < 5.5 * NOISE_M / np.sqrt(2.0)  # where two scans are known
    assert rms(off_m[:, :2]) < 2.0 * NOISE_M / np.sqrt(4.0)
    assert rms(off_m[-2:]) < 2.0 * NOISE_M / np.sqrt(4.0)


@pytest.mark.parametrize("holed", [0, 1])
def test_a_spike_of_one_scan_is_left_out_where_another_has_a_hole(holed):
    heights_m = [waves() + noise(k) for k in range(4)]
    heights_m[holed][60, 80] = np.nan
    heights_m[2][60, 80] += 1e-6
    found = average([HeightMap(z, PIXEL_M) for z in heights_m])
    assert found.spikes == 1
    assert abs(found.surface.height_m[60, 80] - waves()[60, 80]) < 5.0 * NOISE_M


def test_the_mean_has_no_step_where_a_scan_of_another_bow_ends():
    face_m, bow_m = waves(), 2e-7 * (X * X + Y * Y)
    heights_m = [face_m + noise(0), face_m + noise(1), face_m + bow_m + noise(2)]
    heights_m[2][40:60, 50:90] = np.nan
    rest_m = (
        average([HeightMap(z, PIXEL_M) for z in heights_m]).surface.height_m - face_m - bow_m / 3.0
    )
    assert abs(rest_m[40:60, 50:90].mean() - rest_m.mean()) < 0.2 * NOISE_M


def test_a_turn_that_is_allowed_is_taken_back():
    """Pixels are not square; at a corner it moves a face by two thirds of a pixel."""
    wide_m, turn_rad = waves(1, (200, 260), 2.0), 0.005
    inside = slice(40, 160), slice(40, 220)
    square = PIXEL_M[1] / PIXEL_M[0]
    y, x = np.mgrid[0.0:200.0, 0.0:260.0] - np.array([99.5, 129.5])[:, None, None]
    turned_m = map_coordinates(
        wide_m, [99.5 + y + turn_rad * square * x, 129.5 + x - turn_rad / square * y], order=5
    )
    found = average(
        [HeightMap(z[inside] + noise(k), PIXEL_M) for k, z in enumerate((wide_m, turned_m))]
    )
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.03)
    assert rms(found.surface.height_m - wide_m[inside]) < 1.05 * NOISE_M / np.sqrt(2.0)


@pytest.mark.parametrize("moved", [(31, -44), (-30, -40.5)])
def test_scans_that_lie_farther_aside_than_their_hills_are_wide_are_found(moved):
    wide_m = waves(2, (200, 260), 4.0)
    inside = slice(40, 160), slice(40, 220)
    there_m = shift(wide_m, moved, order=5, mode="wrap")[inside] + 1e-6 * X
    there_m[20:30, 50:90] = np.nan
    found = average([HeightMap(wide_m[inside] + noise(0), PIXEL_M),
                     HeightMap(there_m + noise(1), PIXEL_M)])  # fmt: skip
    assert found.moved_pixels[1] == pytest.approx(moved, abs=0.02)
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.03)


def test_a_grating_is_not_moved_by_a_period():
    """As well as here it matches a period farther on, but for what only the nearest place has."""
    face_m = 3e-7 * np.sin(np.pi * 18.0 * X) + 0.0 * Y
    found = average(scans_of(face_m, 2))
    assert np.abs(found.moved_pixels[1]).max() < 0.1
    assert found.surface.shape == SHAPE


def test_a_search_that_ends_some_pixels_away_goes_on(monkeypatch):
    """Beyond the pixels that all have nothing is known: they are taken anew where it ends."""
    wide_m, moved = waves(1, (200, 260)), (3, -7)
    inside = slice(40, 160), slice(40, 220)
    heights_m = wide_m[inside], np.roll(wide_m, moved, axis=(0, 1))[inside]
    scans = [HeightMap(z + noise(k), PIXEL_M) for k, z in enumerate(heights_m)]
    direct = average(scans)
    search = surface_average._shift
    monkeypatch.setattr(
        surface_average, "_shift", lambda *given: search(*given) + np.array((5, -4))
    )
    found = average(scans)
    assert found.moved_pixels[1] == pytest.approx(moved, abs=0.02)
    assert np.array_equal(found.surface.height_m, direct.surface.height_m)


@pytest.mark.long
def test_the_mean_has_the_standard_error_of_the_forms_of_its_scans():
    """Of a bow that one of n scans has the mean has 1 / n, which is what is said."""
    y, x = (np.linspace(-1.0, 1.0, n) for n in SHAPE)
    for shape in (x[None, :] ** 2, y[:, None] ** 2, y[:, None] ** 2 - x**2):
        for n in (2, 3, 5):
            scans = scans_of(waves(), n)
            bow_m = 3e-7 * np.broadcast_to(shape, SHAPE)
            for one in (scans[0], scans[-1]):  # whichever it is
                bent = [
                    replace(scan, height_m=scan.height_m + bow_m * (scan is one)) for scan in scans
                ]
                error_m = average(bent).surface.form_error_m
                assert error_m == pytest.approx(np.ptp(bow_m) / n, rel=0.02)
    assert average(scans_of(waves())).surface.form_error_m < 0.1 * NOISE_M


def test_planes_and_bows_between_scans_are_no_noise():
    face_m, bow_m = waves(), 5e-8
    plane, bow = 1e-6 * X - 3e-7 * Y, bow_m * (X * Y - X * X)
    found = average([
        one if k == 0 else replace(one, height_m=one.height_m + plane + bow)
        for k, one in enumerate(scans_of(face_m, 2))
    ])  # fmt: skip
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.02)
    assert found.bow_m == pytest.approx(np.std(bow), rel=0.01)
    rest_m = found.surface.height_m - face_m - 0.5 * bow  # the mean has half of it, and no plane
    columns = np.stack([np.broadcast_to(one, SHAPE).reshape(-1) for one in (X, Y)], axis=1)
    slopes = np.linalg.lstsq(columns, rest_m.reshape(-1), rcond=None)[0]
    assert np.abs(slopes).max() < 0.05 * bow_m
    assert rms(rest_m) < 1.05 * NOISE_M / np.sqrt(2.0)


def test_what_one_scan_alone_has_is_left_out():
    face_m, (a, b, c) = waves(), scans_of(waves(), 3)
    height_m = np.array(b.height_m)
    height_m[50, 60] += 1e-6
    spiked = replace(b, height_m=height_m)
    found = average([a, spiked, c])
    assert found.spikes == 1
    assert abs(found.surface.height_m[50, 60] - face_m[50, 60]) < 4.0 * NOISE_M
    found = average([spiked, a, c])
    assert found.spikes == 1
    assert abs(found.surface.height_m[50, 60] - face_m[50, 60]) < 4.0 * NOISE_M
    found = average([a, spiked])  # of which nobody knows the right one
    assert found.spikes == 2
    assert np.argwhere(np.isnan(found.surface.height_m)).tolist() == [[50, 60]]


@pytest.mark.parametrize("share", [0.1, 0.45])
@pytest.mark.parametrize("n", [2, 4])
def test_where_scans_lost_points_the_mean_has_more_noise_and_says_so(n, share):
    face_m = waves()
    lost = np.random.default_rng((8, n)).random((n, *SHAPE)) < share
    scans = [
        replace(one, height_m=np.where(lost[k], np.nan, one.height_m))
        for k, one in enumerate(scans_of(face_m, n))
    ]
    found = average(scans)
    off_m = remove_form(replace(found.surface, height_m=found.surface.height_m - face_m))[0]
    over = found.noise_m**2 / found.surface.noise_m**2
    assert over == pytest.approx(NOISE_M**2 / rms(off_m.height_m) ** 2, rel=0.04)
    assert found.surface.noise_m == pytest.approx(
        rms(off_m.height_m), rel=0.07
    )  # as few are in all
    assert found.scans_a_point == pytest.approx(over, rel=1e-9)
    count = n - lost.sum(axis=0)
    assert found.fewer == ((count < n) & (count >= 0.5 * n)).sum()


def test_points_that_are_lost_count_where_the_face_is_highest():
    face_m = remove_form(HeightMap(waves(), PIXEL_M), "plane")[0].height_m
    high = face_m > np.quantile(face_m, 0.8)
    odd = np.broadcast_to(np.arange(SHAPE[1]) % 2 == 1, SHAPE)
    for lost, scans in ((~high, 3.0), (high & odd, 1.0 / np.mean([1 / 2, 1 / 3]))):
        first, *others = scans_of(face_m, 3)
        holed = replace(first, height_m=np.where(lost, np.nan, first.height_m))
        for given in ([holed, *others], [*others, holed]):
            found = average(given)
            assert found.fewer == lost.sum()
            assert found.scans_a_point == pytest.approx(scans, rel=0.01)


def test_many_far_heights_are_noise_of_long_tails_and_stay():
    def tails(seed, shape):
        rng = np.random.default_rng((6, seed))
        return noise(seed, shape) * np.where(rng.random(shape) < 0.1, 40.0, 1.0)

    found = average(scans_of(waves(), 2, tails))
    assert (found.spikes, found.surface.n_measured) == (0, np.prod(SHAPE))


def test_half_of_the_scans_are_enough_for_a_point():
    face_m = waves()
    lost = np.zeros((3, *SHAPE), dtype=bool)
    lost[0, 10, 10] = lost[:2, 20, 20] = lost[:, 30, 30] = True
    three = [
        replace(one, height_m=np.where(lost[k], np.nan, one.height_m))
        for k, one in enumerate(scans_of(face_m, 3))
    ]
    found = average(three).surface.height_m
    assert np.argwhere(np.isnan(found)).tolist() == [[20, 20], [30, 30]]
    assert abs(found[10, 10] - face_m[10, 10]) < 4.0 * NOISE_M
    found = average(three[1:]).surface.height_m  # of two, one is
    assert np.argwhere(np.isnan(found)).tolist() == [[30, 30]]


@pytest.mark.parametrize("n", [2, 3])
def test_points_that_stand_alone_tell_noise_and_no_part_of_it(n):
    face_m = waves()
    lost = np.random.default_rng(8).random((n, *SHAPE)) < 0.5
    scans = [
        replace(one, height_m=np.where(lost[k], np.nan, one.height_m))
        for k, one in enumerate(scans_of(face_m, n))
    ]
    found = average(scans)
    assert found.white_m is None
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.05)
    assert np.abs(found.moved_pixels).max() < 0.05
    known = np.sum([one.measured for one in scans], axis=0) >= 0.5 * n
    assert np.array_equal(found.surface.measured, known)


@pytest.mark.parametrize("noise_m", [1e-9, 8e-9])
def test_rounded_heights_change_by_whole_steps(noise_m):
    """By as much as rounding makes of the noise; of most points nothing changes."""
    step_m, face_m = 4e-8, waves(2)
    scans = [
        HeightMap(np.round((face_m + noise(k) * noise_m / NOISE_M) / step_m) * step_m, PIXEL_M)
        for k in range(3)
    ]
    found = average(scans)
    stack_m = np.stack([one.height_m for one in scans])
    assert found.everywhere_m == pytest.approx(
        np.sqrt(stack_m.var(axis=0, ddof=1).mean()), rel=0.01
    )
    assert found.spikes == 0
    assert np.allclose(found.surface.height_m, stack_m.mean(axis=0), atol=0.02 * step_m)


@pytest.mark.parametrize("turned", [np.transpose, np.fliplr, np.flipud])
def test_turned_maps_have_the_same_noise_and_the_turned_mean(turned):
    scans = [HeightMap(one.height_m, (1e-4, 1e-4)) for one in scans_of(waves(), 3)]
    found = average(scans)
    other = average([replace(one, height_m=turned(one.height_m)) for one in scans])
    for name in ("noise_m", "white_m", "everywhere_m"):
        assert getattr(other, name) == pytest.approx(getattr(found, name), rel=1e-3)
    off_m = other.surface.height_m - turned(found.surface.height_m)
    assert np.abs(off_m).max() < 1e-3 * NOISE_M


def test_a_face_of_grooves_is_not_moved_along_them():
    face_m = np.broadcast_to(waves(2)[60:61], SHAPE)
    found = average(scans_of(face_m, 3))
    assert np.abs(found.moved_pixels).max() < 0.2
    assert found.surface.shape == SHAPE
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.02)


def named(surface, name):
    return replace(surface, origin=Origin(name=name))


def test_what_is_no_repeat_is_refused():
    face_m = waves()
    a, b = (named(one, name) for one, name in zip(scans_of(face_m, 2), "ab", strict=True))
    with pytest.raises(SettingsError, match="got 1; expected two"):
        average([a])
    with pytest.raises(SettingsError, match=r"c: pixels of 0\.0002 x 0\.000101 m, and of"):
        average([a, named(HeightMap(b.height_m, (2e-4, 1.01e-4)), "c")])
    with pytest.raises(SettingsError, match="a and c: hold the same heights"):
        average([a, b, named(HeightMap(a.height_m + 1e-6 * X, PIXEL_M), "c")])
    elsewhere = named(HeightMap(waves(7) + noise(7), PIXEL_M), "c")
    with pytest.raises(UnusableSurfaceError, match="a and c: less than 50 % of the variance"):
        average([a, elsewhere])
    lost = named(HeightMap(np.full(SHAPE, np.nan), PIXEL_M), "c")
    with pytest.raises(UnusableSurfaceError, match="a and c: less than 50 %"):
        average([a, lost])
    flat = named(HeightMap(np.zeros(SHAPE), PIXEL_M), "a")
    with pytest.raises(SettingsError, match="a and c: hold the same heights"):
        average([flat, named(flat, "c")])
    with pytest.raises(UnusableSurfaceError, match=r"c: heights of up to 1\.\S+e\+144 m"):
        average([a, named(HeightMap(1e150 * b.height_m, PIXEL_M), "c")])
    with pytest.raises(UnusableSurfaceError, match="a and b: less than 50 % of the rows or col"):
        average([a, named(HeightMap(b.height_m[:, :80], PIXEL_M), "b")])


def test_averages_in_memory_that_share_a_scan_are_refused():
    """Arrays are known by their heights; maps of one file by their datasets, too."""
    a, b, c, d = (named(one, name) for one, name in zip(scans_of(waves(), 4), "abcd", strict=True))
    ab, ba, bc, cd = (average(two).surface for two in ((a, b), (b, a), (b, c), (c, d)))
    for scans, both in (([ab, bc], "b"), ([ab, ba], "a, b"), ([c, d, ab, a], "a"), ([bc, b], "b")):
        with pytest.raises(SettingsError, match=f": {both} in both, and so the noise of it; exp"):
            average(scans)
    assert average([ab, cd]).surface.noise_m == pytest.approx(NOISE_M / 2.0, rel=0.05)
    of_file = [
        replace(one, origin=Origin(one.origin.name, "scans.h5", "abc", dataset=f"scan {i}"))
        for i, one in enumerate((a, b, c, d))
    ]
    ab, bc, cd = (average(of_file[i : i + 2]).surface for i in range(3))
    assert average([ab, cd]).surface.origin.mean_of[1] == "scans.h5 (SHA-256 abc, scan 0)"
    with pytest.raises(SettingsError, match=r": scans\.h5 in both"):
        average([ab, bc])


@pytest.mark.parametrize("moved", [(0, 0), (2, -3), (0.45, 0.4)])
def test_no_two_scans_are_one_whichever_they_are_and_however_they_are_levelled(moved):
    wide_m, inside = waves(1, (200, 260)), np.s_[40:160, 40:220]
    there_m = shift(wide_m, moved, order=5)
    a, b, c = (
        named(HeightMap((wide_m, there_m, there_m)[k][inside] + noise(k), PIXEL_M), name)
        for k, name in enumerate("abc")
    )
    holed_m = np.array(b.height_m)
    holed_m[30:40, 50:60] = np.nan
    b = replace(b, height_m=holed_m)
    again = named(replace(b, height_m=holed_m + 3e-7 * (Y - X)), "again")
    assert len(average([a, b, c]).moved_pixels) == 3
    for scans in ([a, b, again], [a, b, c, again]):
        with pytest.raises(SettingsError, match=r"^b and again: hold the same heights; expected"):
            average(scans)
    with pytest.raises(SettingsError, match=r"^again and b: hold the same heights"):
        average([a, again, c, b])


@pytest.mark.parametrize("offset_m", [0.0, 2e-6])
def test_a_scan_that_was_stored_with_seven_digits_as_well_is_one_scan(offset_m):
    """It had a noise of 30 fm, which the mean knew as its own."""
    a = named(HeightMap(scans_of(waves(), 1)[0].height_m + offset_m, PIXEL_M), "a")
    stored_m = a.height_m.astype(np.float32).astype(np.float64)
    assert not np.array_equal(stored_m, a.height_m)
    with pytest.raises(SettingsError, match=r"^a and b: hold the same heights"):
        average([a, named(HeightMap(stored_m, PIXEL_M), "b")])
    codes = [
        replace(one, height_m=np.where(X + Y > -1.9, one.height_m, 1.0))
        for one in scans_of(waves(), 2)
    ]
    assert average(codes).noise_m == pytest.approx(NOISE_M, rel=0.05)  # of bad codes, not of these


def test_half_of_the_variance_is_in_scans_of_one_place():
    face_m = remove_form(HeightMap(waves(), PIXEL_M), "quadratic")[0].height_m
    less_m, more_m = 0.8 * face_m.std(), 1.25 * face_m.std()  # 0.39 and 0.61 of the variance
    scans = scans_of(face_m, 2, lambda k, shape: less_m / NOISE_M * noise(k, shape))
    assert average(scans).everywhere_m == pytest.approx(less_m, rel=0.02)
    scans = scans_of(face_m, 2, lambda k, shape: more_m / NOISE_M * noise(k, shape))
    with pytest.raises(UnusableSurfaceError, match="less than 50 % of the variance"):
        average(scans)


def turned(angle_rad):
    """Waves of PIXEL_M, whose sides differ, turned about the middle of the map."""
    y, x = np.ix_(
        *((np.arange(n) - 0.5 * (n - 1)) * d for n, d in zip(SHAPE, PIXEL_M, strict=True))
    )
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    v, u = c * y - s * x, s * y + c * x
    return 3e-7 * np.sin(4e3 * u + 1.0) * np.cos(2.5e3 * v) + 1e-7 * np.sin(3e3 * v)


def test_a_small_turn_is_no_noise_on_pixels_that_are_not_square():
    corner = 0.5 * np.hypot(120 * 2e-4, 180 * 1e-4) / 1e-4
    scans = [HeightMap(turned(a) + noise(k), PIXEL_M) for k, a in enumerate((0.0, 0.8 / corner))]
    assert average(scans).everywhere_m == pytest.approx(NOISE_M, rel=0.03)
    scans[1] = HeightMap(turned(1.2 / corner) + noise(1), PIXEL_M)
    with pytest.raises(UnusableSurfaceError, match=r"a corner by 1\.2 pixels"):
        average(scans)


def test_a_scan_that_is_turned_is_refused_with_its_angle():
    wide_m = waves(3, (300, 300))
    pair = [
        HeightMap(z[90:210, 60:240] + noise(k), (1e-4, 1e-4))
        for k, z in enumerate((wide_m, rotate(wide_m, 1.0, reshape=False, order=3)))
    ]
    with pytest.raises(UnusableSurfaceError, match=r"by 0\.017 rad .* a corner by 1\.9 pixels"):
        average(pair)


def other_place(k, shape=SHAPE):
    return HeightMap(
        waves((9, k), shape, width=15.0) + noise(k, shape), PIXEL_M, Origin(name=f"p{k}")
    )


def test_a_place_that_counts_twice_in_a_joint_is_warned_of():
    places = [other_place(k) for k in range(8)]
    assert problems_of_places(places) == ()
    again = HeightMap(np.roll(places[3].height_m, 1, 1) + noise(20), PIXEL_M, Origin(name="again"))
    (said,) = problems_of_places([*places, again])
    assert (said.code, said.severity) == ("scans_of_one_place", "warning")
    assert said.message.startswith("p3 and again match by 0.9")


def test_what_tells_no_place_is_no_match():
    known = other_place(1)
    lost = HeightMap(np.full(SHAPE, np.nan), PIXEL_M)
    flat = HeightMap(np.zeros(SHAPE), PIXEL_M)
    half = np.where(np.arange(SHAPE[1]) < 90, known.height_m, np.nan)
    for scans in ([lost, lost], [flat, flat], [known, lost], [known, flat]):
        assert problems_of_places(scans) == ()
    left, right = (HeightMap(one, PIXEL_M) for one in (half, half[:, ::-1]))
    assert problems_of_places([left, right]) == ()  # nothing is known of both
    assert problems_of_places([known, other_place(1, (120, 150))]) == ()
    bow_m = 1e-6 * (X * X + Y * Y - X * Y**3)  # as each place of a domed face has it
    bowed = [HeightMap(other_place(k).height_m + bow_m, PIXEL_M) for k in range(3)]
    assert problems_of_places(bowed) == ()


@pytest.mark.parametrize("shape", [(7, 30), (14, 12), (8, 1500), (1500, 9)])
def test_maps_of_few_points_or_lines_are_averaged_as_well(shape):
    """Of fewer than eight lines no move is looked for."""
    face_m = waves(4, shape, width=2.0)
    found = average(scans_of(face_m, 4))
    assert found.surface.shape == shape
    assert found.everywhere_m == pytest.approx(NOISE_M, rel=0.15)
    assert rms(found.surface.height_m - face_m) < 0.7 * NOISE_M
