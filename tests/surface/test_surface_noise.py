"""The stencil of the noise: what it is blind to, what it passes, and its median."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.fft import dctn
from scipy.ndimage import gaussian_filter

from capslip.contact.solvers.elastic_face import elastic_face
from capslip.settings import Settings, load_settings
from capslip.stages import Clock, _conditioned, find_face
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface.between import Between
from capslip.surface.blocks import means_of_blocks
from capslip.surface.filters import gaussian_l_filter, gaussian_s_filter
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap
from capslip.surface.mating import composite_surface, place
from capslip.surface.noise import (
    known_noise_m,
    mixed_difference,
    noise_of_map_m,
    noise_spectrum,
    rms_of_noise_m,
)
from capslip.surface.resampling import resample


def on_map(height_m, step):
    """Differences about all inner points of a map."""
    (ny, nx), k = height_m.shape, step
    return mixed_difference(
        lambda i, j: height_m[k + k * i : ny - k + k * i, k + k * j : nx - k + k * j]
    )


@pytest.mark.parametrize("step", [1, 3])
def test_no_quadratic_surface_is_seen(step):
    y, x = np.mgrid[:12, :15].astype(float)
    quadratic = 3 + 2 * x - y + 5 * x**2 - 4 * x * y + 7 * y**2
    assert (on_map(quadratic, step) == 0.0).all()
    assert (on_map(quadratic + x**2 * y**2, step) == 4.0 * step**4).all()


@pytest.mark.parametrize("step", [1, 2])
def test_white_noise_passes_36_times_in_variance(step):
    white = np.random.default_rng(0).standard_normal((800, 900))
    assert on_map(white, step).var() == pytest.approx(36.0, rel=0.02)
    assert rms_of_noise_m(on_map(white, step)) == pytest.approx(1.0, rel=0.01)


def test_spikes_steps_and_missing_points_do_no_harm():
    rng = np.random.default_rng(1)
    height_m = 1e-9 * rng.standard_normal((400, 600))
    height_m[:, 300:] += 1e-5
    height_m[rng.random(height_m.shape) < 0.002] = 1e-3
    height_m[50:90, 100:200] = np.nan
    assert noise_of_map_m(height_m) == pytest.approx(1e-9, rel=0.05)


@pytest.mark.parametrize("shape", [(1, 1), (2, 40), (40, 2), (1, 40), (40, 1)])
def test_a_map_too_narrow_for_the_stencil_has_no_noise(shape):
    assert noise_of_map_m(np.random.default_rng(2).random(shape)) == 0.0
    assert noise_of_map_m(np.full((9, 9), np.nan)) == 0.0


FLAT = HeightMap(np.zeros((40, 50)), (1e-4, 1e-4))
NOISY = replace(FLAT, noise_m=3e-9)


@pytest.mark.parametrize(
    ("change", "noise_m", "faces"),
    [
        (lambda one: one, 3e-9, 1),
        (lambda one: remove_form(one, "quadratic")[0], 3e-9, 1),
        (lambda one: gaussian_l_filter(one, 1e-3), 3e-9, 1),  # leaves what pixels do not share
        (lambda one: gaussian_s_filter(one, 1e-3), None, 1),  # leaves less
        (lambda one: resample(one, (20, 25)), None, 1),
        (lambda one: composite_surface(one, replace(one, noise_m=4e-9), place(one, one)), 5e-9, 2),
        (lambda one: composite_surface(one, FLAT, place(one, FLAT)), None, 2),
    ],
)
def test_the_noise_of_a_map_stays_where_its_heights_keep_it(change, noise_m, faces):
    found = change(NOISY)
    assert found.noise_m == (None if noise_m is None else pytest.approx(noise_m))
    assert known_noise_m(found, Settings()) == found.noise_m
    assert change(FLAT).noise_m is None
    given = load_settings(overrides=("instrument.noise_m=1e-9",))
    # as somebody says, of one scan
    assert known_noise_m(found, given) == pytest.approx(1e-9 * np.sqrt(faces), rel=1e-12)


@pytest.mark.parametrize(("way", "scans"), [("composite", 2), ("together", 1)])
def test_two_faces_have_the_same_noise_whether_their_files_say_it_or_the_settings(way, scans):
    told = load_settings(overrides=(f"mating.way={way}", "contact.model=caps"))
    asked = load_settings(
        overrides=(f"mating.way={way}", "contact.model=caps", "instrument.noise_m=2e-9")
    )
    scene = Scene((60, 80), (4e-4, 4e-4), 3, families=(CapFamily("G", 4, 23.8),))
    known_m = []
    for settings, noise_m in ((told, 2e-9), (asked, None), (asked, 7e-9)):
        one, other = (
            replace(synthetic_surface(replace(scene, seed=seed))[0], noise_m=noise_m)
            for seed in (3, 4)
        )
        surface = find_face(one, settings, other, Clock()).conditioned.surface
        known_m.append(known_noise_m(surface, settings))
        assert elastic_face(surface, 1e11).faces == scans
    assert known_m == pytest.approx([2e-9 * np.sqrt(scans)] * 3, rel=1e-12)


@pytest.mark.parametrize(
    ("laid", "finer"), [(("[2e-4,2e-4]", "0"), 1.0), (("[0,0]", "0.3"), 1.0), (("[0,0]", "0"), 1.7)]
)
def test_what_interpolation_takes_off_is_taken_off_noise_that_the_settings_say(laid, finer):
    """Half a pixel aside 1.13 times as much was taken for noise as was there."""
    placed = (f"mating.offset_m={laid[0]}", f"mating.rotation_rad={laid[1]}")
    asked = load_settings(overrides=(*placed, "contact.model=caps", "instrument.noise_m=2e-9"))
    scene = Scene((60, 80), (4e-4, 4e-4), 3, families=(CapFamily("G", 4, 23.8),))
    first = synthetic_surface(scene)[0]
    shape, pixel_m = tuple(round(finer * n) for n in first.shape), 4e-4 / finer
    second = HeightMap(np.zeros(shape), (pixel_m, pixel_m))
    known_m = []
    for noise_m in (None, 2e-9):
        one, other = (replace(face, noise_m=noise_m) for face in (first, second))
        surface = find_face(one, asked, other, Clock()).conditioned.surface
        known_m.append(known_noise_m(surface, asked))
    told = surface.noise_m
    assert told < 0.97 * np.sqrt(2.0) * 2e-9
    assert known_m == pytest.approx([told, told], rel=1e-12)
    scans = (told / 2e-9) ** 2
    assert elastic_face(surface, 1e11).faces == pytest.approx(scans, rel=1e-12)


@pytest.mark.long
@pytest.mark.parametrize(
    ("shape", "pixel_m", "laid"),
    [
        ((1200, 1600), (2.5e-5, 2.5e-5), {}),  # a tenth is left
        ((600, 480), (5e-5, 1e-4), {}),  # finer along one axis alone
        ((520, 640), (8e-5, 7e-5), {}),
        ((240, 320), (1.3e-4, 1.3e-4), {}),  # coarser: interpolated alone
        ((300, 400), (7.7e-5, 1e-4), {}),  # finer: the first is interpolated
        ((300, 400), (1e-4, 1e-4), {"offset_m": (5e-5, 2e-5)}),
        ((300, 400), (1e-4, 1e-4), {"rotation_rad": 0.3}),
        ((1000, 900), (3e-5, 9e-5), {"rotation_rad": 1.3}),
        ((1000, 600), (3e-5, 6e-5), {"rotation_rad": np.pi / 2}),
    ],
)
def test_a_sum_has_the_noise_that_its_second_face_keeps_on_the_grid_of_the_first(
    shape, pixel_m, laid
):
    rng = np.random.default_rng(0)
    first, second = (
        HeightMap(noise_m * rng.standard_normal(n), size_m, noise_m=noise_m)
        for n, size_m, noise_m in (((300, 400), (1e-4, 1e-4), 1e-9), (shape, pixel_m, 1e-8))
    )
    both = composite_surface(first, second, place(first, second, **laid))
    assert both.noise_m == pytest.approx(np.nanstd(both.height_m), rel=0.012)
    swapped = replace(first, noise_m=None), second
    assert composite_surface(*swapped, place(*swapped, **laid)).noise_m is None


@pytest.mark.parametrize("apart", [1.0, 1.6, 2.5])
def test_the_noise_of_a_laid_face_has_the_spectrum_that_is_said(apart):
    """Mean power over twenty parts of the plane of waves, at places all over the pixels."""
    shape, rng = (240, 300), np.random.default_rng(4)
    face = Between(1.0, 0.0, 0.0, (0.0, 0.0), (apart, apart))
    said = noise_spectrum([face], 0.0, shape)
    assert said.mean() == pytest.approx(1.0, rel=1e-12)
    own = HeightMap(np.zeros(shape), (1e-5, 1e-5))
    z = rng.standard_normal([round(1.3 * n / apart) for n in shape])
    other = HeightMap(z, (1e-5 * apart, 1e-5 * apart))
    laid = place(own, other, offset_m=(3e-6, 1e-6), rotation_rad=0.01)
    both_m = composite_surface(own, other, laid).height_m
    power = dctn(both_m, norm="ortho") ** 2
    power, said = (means_of_blocks(one / one.mean(), 60, 1) for one in (power, said))
    np.testing.assert_allclose(power, said, rtol=0.12, atol=0.03)


INDEX_M = "conditioning.s_filter_nesting_index_m"


def white(seed, shape=(180, 240), noise_m=4e-9):
    """Return noise of an even map."""
    noise = np.random.default_rng(seed).standard_normal(shape)
    return HeightMap(noise_m * noise, (1e-4, 1.5e-4))


@pytest.mark.parametrize(
    "words",
    [
        (f"{INDEX_M}=6e-4",),
        (f"{INDEX_M}=1.5e-3",),
        ("conditioning.resample_to=[90,120]",),
        ("conditioning.resample_to=[70,240]",),
        ("conditioning.resample_to=[180,333]",),
        (f"{INDEX_M}=6e-4", "conditioning.resample_to=[90,120]"),
        (f"{INDEX_M}=6e-4", "conditioning.l_filter_nesting_index_m=9e-3"),
    ],
)
def test_what_filters_leave_of_white_noise_is_known(words):
    """As the settings say it, or its file: it counted whole, or not at all."""
    for seed in (0, 1):
        surface = white(seed)
        for noise_m, said in ((None, ("instrument.noise_m=4e-9",)), (4e-9, ())):
            settings = load_settings(overrides=(*words, *said))
            found = _conditioned(replace(surface, noise_m=noise_m), settings, Clock())
            for one in (found.surface, found.finer, found.with_short_waves):
                if one is not None:
                    left_m = np.std(one.height_m[5:-5, 5:-5])
                    assert known_noise_m(one, settings) == pytest.approx(left_m, rel=0.06)
            assert elastic_face(found.surface, 1e11).faces == pytest.approx(
                (known_noise_m(found.surface, settings) / 4e-9) ** 2, rel=1e-9
            )


@pytest.mark.parametrize("pixels", [1.5, 3.0])
def test_noise_that_neighbours_share_is_not_taken_for_less_than_a_filter_leaves(pixels):
    shared = gaussian_filter(white(2).height_m, pixels, mode="wrap")
    surface = HeightMap(4e-9 * shared / shared.std(), (1e-4, 1e-4))
    settings = load_settings(overrides=(f"{INDEX_M}=5e-4", "instrument.noise_m=4e-9"))
    found = _conditioned(surface, settings, Clock()).surface
    left_m = np.std(found.height_m)
    assert left_m > 0.6 * 4e-9
    assert 0.95 * left_m < known_noise_m(found, settings) < 1.01 * 4e-9


def test_the_sum_of_filtered_faces_has_the_noise_that_is_left_of_both():
    """Half a pixel aside, where a spline takes a third of what neighbours do not share."""
    settings = load_settings(
        overrides=(f"{INDEX_M}=9e-4", "instrument.noise_m=4e-9", "mating.offset_m=[5e-5,7.5e-5]")
    )
    first, second = (_conditioned(white(seed), settings, Clock()).surface for seed in (3, 4))
    both = composite_surface(first, second, place(first, second, offset_m=(5e-5, 7.5e-5)))
    left_m = np.nanstd(both.height_m[5:-5, 5:-5])
    assert known_noise_m(both, settings) == pytest.approx(left_m, rel=0.06)
