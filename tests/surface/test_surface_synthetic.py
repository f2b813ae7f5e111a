"""Synthetic faces: the truth that comes with them is true."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy import ndimage

from capslip.errors import SettingsError
from capslip.studies.faces.synthetic import Cap, CapFamily, Scene, synthetic_surface
from capslip.surface.conditioning import condition
from capslip.surface.form import remove_form
from scenes import in_filters

PAPER = Scene(families=(CapFamily("G", 2, 23.8), CapFamily("P", 9, 26.7, 0.24e-6)), seed=5)
SMALL = replace(PAPER, shape=(400, 600), pixel_size_m=(1e-4, 1e-4))


def discs(surface, truth):
    above = surface.height_m >= truth.cut_height_m
    return ndimage.label(above, structure=np.ones((3, 3)))


def test_every_cap_is_one_separate_disc_at_the_cut():
    surface, truth = synthetic_surface(PAPER)
    label, n = discs(surface, truth)
    assert n == len(truth.x_m) == 11
    at = label[(truth.y_m / 50e-6).astype(int), (truth.x_m / 50e-6).astype(int)]
    assert sorted(at) == list(range(1, 12))


def test_equation_18_gives_the_radius_back():
    surface, truth = synthetic_surface(PAPER)
    label, _ = discs(surface, truth)
    at = label[(truth.y_m / 50e-6).astype(int), (truth.x_m / 50e-6).astype(int)]
    diameter2_m2 = 4 / np.pi * np.bincount(label.ravel())[at] * surface.pixel_area_m2
    cap_height_m = truth.peak_height_m - truth.cut_height_m
    radius_m = (diameter2_m2 / 4 + cap_height_m**2) / (2 * cap_height_m)
    np.testing.assert_allclose(radius_m, truth.radius_m, rtol=3e-3)  # pixels along the rim


def test_peaks_are_where_the_truth_says():
    surface, truth = synthetic_surface(PAPER)
    rows, cols = (truth.y_m / 50e-6).astype(int), (truth.x_m / 50e-6).astype(int)
    below_m = truth.peak_height_m - surface.height_m[rows, cols]
    farthest_m2 = 2 * 25e-6**2
    assert (below_m >= 0).all()
    assert (below_m <= farthest_m2 / (2 * truth.radius_m) * (1 + 1e-6) + 1e-18).all()
    heights = {name: truth.peak_height_m[truth.family == name] for name in "GP"}
    assert heights["G"][0] - heights["P"][0] == pytest.approx(0.24e-6, rel=1e-9)
    assert np.ptp(heights["G"]) == np.ptp(heights["P"]) == 0


def test_discs_fill_the_material_ratio():
    _, truth = synthetic_surface(PAPER)
    f_m = truth.peak_height_m - truth.cut_height_m
    area_m2 = np.pi * (f_m * (2 * truth.radius_m - f_m)).sum()
    assert area_m2 / (60e-3 * 40e-3) == pytest.approx(0.10, rel=1e-4)


def test_removing_the_plane_restores_the_truth():
    surface, truth = synthetic_surface(replace(PAPER, tilt=(2e-5, -3e-5)))
    flat, _ = synthetic_surface(PAPER)
    result = condition(surface)
    np.testing.assert_allclose(result.surface.height_m, flat.height_m, atol=1e-14)
    smc_m = np.quantile(result.surface.height_m, 0.9)
    assert smc_m == pytest.approx(truth.cut_height_m, abs=1e-14)


def tilt_m(surface, **fit):
    """Rise of the plane over the face, corner to corner."""
    level, _ = remove_form(surface, "plane", **fit)
    return float(np.ptp(surface.height_m - level.height_m))


FAMILIES = {
    "one cap": (CapFamily("G", 1, 30.0),),
    "a large and a small one": (CapFamily("G", 1, 60.0), CapFamily("P", 1, 20.0, 0.2e-6)),
    "of the paper": (CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 0.24e-6)),
    "100 of many sizes": tuple(CapFamily("", 1, 3.0 + 0.05 * i, 1e-9 * i) for i in range(100)),
}


@pytest.mark.parametrize("families", FAMILIES.values(), ids=FAMILIES)
@pytest.mark.parametrize("seed", range(5))
def test_balanced_caps_stand_on_a_level_floor_and_their_plane_is_level(families, seed):
    scene = replace(SMALL, families=families, seed=seed, gap_m=0.5e-3, floor_m=0.2e-6)
    surface, truth = synthetic_surface(scene)
    assert tilt_m(surface) < 1e-14
    floor_m = surface.height_m.min()
    on_floor = surface.height_m <= floor_m + 1e-18
    assert on_floor.mean() > 0.5  # level from edge to edge, not bent
    assert tilt_m(surface, floor=True) < 1e-14
    if on_floor.mean() > 0.6:
        assert tilt_m(surface, robust=True) < 1e-14
    disc_m = np.sqrt((truth.peak_height_m - floor_m - 0.2e-6) * 2 * truth.radius_m)
    apart_m = np.hypot(truth.x_m[:, None] - truth.x_m, truth.y_m[:, None] - truth.y_m)
    apart_m -= disc_m[:, None] + disc_m
    np.fill_diagonal(apart_m, np.inf)
    assert apart_m.min() >= 0.5e-3 * (1 - 1e-5)
    for place_m, side_m in ((truth.x_m, 60e-3), (truth.y_m, 40e-3)):
        assert (np.minimum(place_m, side_m - place_m) - disc_m).min() >= 0.5e-3 * (1 - 1e-5)


def test_waves_of_the_floor_leave_the_plane_level():
    scene = replace(SMALL, waviness_rms_m=4e-8, waviness_length_m=4e-3)
    assert tilt_m(synthetic_surface(scene)[0]) < 1e-14
    assert tilt_m(synthetic_surface(replace(scene, families=()))[0]) < 1e-14


def test_caps_where_they_fall_tilt_the_least_squares_plane_alone():
    scene = replace(SMALL, balanced=False, floor_m=0.2e-6, seed=3)
    surface, truth = synthetic_surface(scene)
    f_m = truth.peak_height_m - surface.height_m.min()
    volume_m3 = np.pi * f_m**2 * truth.radius_m
    slope = [
        12 * volume_m3 @ (place_m - side_m / 2) / (40e-3 * 60e-3 * side_m**2)
        for place_m, side_m in ((truth.y_m, 40e-3), (truth.x_m, 60e-3))
    ]
    expected_m = abs(slope[0]) * 40e-3 + abs(slope[1]) * 60e-3
    assert expected_m > 2e-8
    assert tilt_m(surface) == pytest.approx(expected_m, rel=0.02)
    assert tilt_m(surface, robust=True) < 1e-14
    assert truth.peak_height_m.max() == pytest.approx(surface.height_m.max(), abs=1e-10)


def test_given_caps_stay_and_the_others_balance_them():
    given = Cap(10e-3, 20e-3, 26.7, 0.1e-6, "X")
    scene = replace(SMALL, caps=(given,))
    surface, truth = synthetic_surface(scene)
    assert tilt_m(surface) < 1e-14
    assert (truth.x_m[-1], truth.y_m[-1]) == (10e-3, 20e-3)
    alone, truth = synthetic_surface(replace(scene, families=()))
    assert tilt_m(alone) > 1e-9
    assert truth.peak_height_m[0] == pytest.approx(alone.height_m.max(), abs=1e-10)


def test_sphere_is_exact_where_the_paraboloid_is_not():
    cap = Cap(5.03e-3, 5.01e-3, radius_m=6e-3, height_m=2e-3)
    scene = Scene((100, 100), (1e-4, 1e-4), caps=(cap,), floor_m=1e-3)
    surface, truth = synthetic_surface(scene)
    level = truth.peak_height_m[0] - cap.height_m
    i, j = 62, 39
    with mpmath.workdps(40):
        square = mpmath.mpf((i + 0.5) * 1e-4 - cap.y_m) ** 2
        square += mpmath.mpf((j + 0.5) * 1e-4 - cap.x_m) ** 2
        exact = cap.height_m - (cap.radius_m - mpmath.sqrt(cap.radius_m**2 - square))
    assert surface.height_m[i, j] - level == pytest.approx(float(exact), rel=1e-13)


def test_flat_caps_lose_no_digit():
    scene = Scene((50, 50), (1e-4, 1e-4), caps=(Cap(2.55e-3, 2.55e-3, 25.0, 1e-6),))
    surface, truth = synthetic_surface(scene)
    drop_m = truth.peak_height_m[0] - surface.height_m[25, 26]
    assert drop_m == pytest.approx((1e-4) ** 2 / 50, rel=1e-6)


def test_same_seed_same_face_other_seed_other_face():
    scene = replace(SMALL, waviness_rms_m=5e-8, roughness_rms_m=1e-9, noise_rms_m=1e-9)
    first, again = (synthetic_surface(scene)[0].height_m for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, synthetic_surface(replace(scene, seed=6))[0].height_m)


@pytest.mark.parametrize("spectrum", ["gaussian", "power_law"])
def test_waves_have_the_rms_they_were_given(spectrum):
    scene = Scene(
        (300, 500), (1e-4, 1.2e-4), waviness_rms_m=0.4e-6, waviness_spectrum=spectrum, floor_m=0
    )
    surface, _ = synthetic_surface(scene)
    assert condition(surface, "none").sq_m == pytest.approx(0.4e-6, rel=0.02)


@pytest.mark.parametrize("axis", [0, 1])
def test_gaussian_waves_have_the_correlation_length_they_were_given(axis):
    scene = Scene(
        (1000, 1000), (1e-4, 2e-4), waviness_rms_m=1e-6, waviness_length_m=2e-3, floor_m=0
    )
    z = synthetic_surface(scene)[0].height_m
    lag = round(2e-3 / scene.pixel_size_m[axis])
    correlation = (z * np.roll(z, lag, axis)).mean() / (z**2).mean()
    assert correlation == pytest.approx(np.exp(-1), abs=0.02)


def test_defects_are_as_many_as_asked():
    scene = replace(SMALL, n_spikes=25, spike_m=1e-6)
    change = synthetic_surface(scene)[0].height_m - synthetic_surface(SMALL)[0].height_m
    assert np.count_nonzero(change) == 25
    np.testing.assert_allclose(np.abs(change[change != 0]), 1e-6, rtol=1e-9)
    holed = replace(SMALL, non_measured_fraction=0.03, n_patches=2, patch_radius_m=1e-3)
    share = 1 - synthetic_surface(holed)[0].measured.mean()
    assert 0.03 < share < 0.04


def test_form_is_removed_by_its_own_operator():
    bowed = replace(SMALL, bow_m=(2e-6, -1e-6), tilt=(1e-5, 0))
    difference = synthetic_surface(bowed)[0].height_m - synthetic_surface(SMALL)[0].height_m
    assert (
        condition(synthetic_surface(bowed)[0]).sq_m
        > 5 * condition(synthetic_surface(SMALL)[0]).sq_m / 2
    )
    left = condition(replace(synthetic_surface(SMALL)[0], height_m=difference), "quadratic")
    assert left.sz_m < 1e-18


def test_cylinder_sags_by_the_exact_amount():
    scene = replace(SMALL, cylinder_radius_m=2.0)
    sag = synthetic_surface(SMALL)[0].height_m - synthetic_surface(scene)[0].height_m
    x = 29.95e-3
    assert sag[7, -1] == pytest.approx(2 - np.sqrt(4 - x**2), rel=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"families": (CapFamily("G", 40, 23.8), CapFamily("P", 4, 26.7, 2e-6))}, "reach the cut"),
        ({"gap_m": 8e-3}, "no place left"),
        (
            {
                "families": (CapFamily("G", 1, 23.8),),
                "caps": (Cap(10e-3, 20e-3, 26.7, 0.2e-6), Cap(15e-3, 20e-3, 26.7, 0.3e-6)),
                "material_ratio": 0.05,
            },
            "set balanced to false",
        ),
        ({"material_ratio": 0.0}, "material_ratio"),
        ({"noise_rms_m": -1.0}, "noise_rms_m"),
        ({"roughness_length_m": 0.0}, "roughness_length_m"),
        ({"families": (CapFamily("G", 4, -1.0),)}, "positive radius"),
        ({"cylinder_radius_m": 1e-3}, "cylinder_radius_m"),
    ],
)
def test_impossible_scenes_are_refused(change, words):
    with pytest.raises(SettingsError, match=words):
        synthetic_surface(replace(SMALL, **change))


@pytest.mark.long
def test_paper_sized_face_is_made_quickly():
    scene = replace(PAPER, families=(CapFamily("G", 5, 23.8), CapFamily("P", 18, 26.7, 0.24e-6)))
    assert in_filters(lambda: synthetic_surface(replace(scene, seed=0))) < 40.0
