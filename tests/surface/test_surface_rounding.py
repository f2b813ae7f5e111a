"""Heights in steps: what was rounded comes back within its error, and what was not stays."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip import Settings, load_settings
from capslip.analysis import analyze, analyze_once
from capslip.stages import Clock, find_face
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap
from capslip.surface.rounding import (
    _error_of_hills_m,
    few_steps,
    problems_of_rounding,
    smooth_steps,
)

SHAPE, PIXEL_M = (120, 150), (1e-4, 1e-4)
Y_M, X_M = ((np.indices(SHAPE)[k] + 0.5) * 1e-4 for k in (0, 1))
CENTRES_M = [(0.3e-2 + dy, 0.3e-2 + dx) for dy in (0.0, 6e-3) for dx in (0.0, 4.5e-3, 9e-3)]
FLOOR_M = -5e-7


def caps_m(seed=0):
    """Return six spheres of 5 m on a floor, each of its own height."""
    z = np.full(SHAPE, FLOOR_M)
    for (y, x), top_m in zip(
        CENTRES_M, np.random.default_rng(seed).uniform(0, 6e-8, 6), strict=True
    ):
        z = np.maximum(z, top_m - ((X_M - x) ** 2 + (Y_M - y) ** 2) / 10.0)
    return z


def rounded(z, step_m):
    return HeightMap(np.round(z / step_m) * step_m, PIXEL_M)


@pytest.mark.parametrize("step_m", [5e-9, 1e-8, 3e-8, 6e-8])
def test_no_height_moves_by_more_than_half_a_step_and_tops_come_back(step_m):
    surface, true_m = rounded(caps_m(), step_m), caps_m()
    found = smooth_steps(surface)
    assert np.abs(found.height_m - surface.height_m).max() <= 0.5 * step_m * (1 + 1e-6)
    top = true_m > -5e-8
    before, after = (np.std((one.height_m - true_m)[top]) for one in (surface, found))
    assert after < 0.4 * before


@pytest.mark.parametrize("step_m", [1e-8, 3e-8, 6e-8])
def test_the_stated_error_is_that_of_tops(step_m):
    off_m, stated_m = [], []
    for seed in range(4):
        true_m = caps_m(seed)
        found = smooth_steps(rounded(true_m, step_m))
        stated_m.append(found.rounding.error_m)
        for y, x in CENTRES_M:
            top = np.hypot(X_M - x, Y_M - y) < 5e-4
            off_m.append(np.mean((found.height_m - true_m)[top]))
    assert found.rounding.step_m == pytest.approx(step_m)
    true_error_m = np.sqrt(np.mean(np.square(off_m)))
    assert 0.5 < np.sqrt(np.mean(np.square(stated_m))) / true_error_m < 2.5


def test_what_is_in_no_steps_stays_as_it_is():
    rng = np.random.default_rng(1)
    rough_m = gaussian_filter(rng.standard_normal(SHAPE), 2.0)
    for surface in (
        HeightMap(caps_m(), PIXEL_M),  # a floor of one height is no step
        HeightMap(rough_m, PIXEL_M),
        HeightMap(np.zeros(SHAPE), PIXEL_M),
        HeightMap(np.full(SHAPE, np.nan), PIXEL_M),
    ):
        assert smooth_steps(surface) is surface
        assert problems_of_rounding(surface) == ()


@pytest.mark.long
@pytest.mark.parametrize("step_m", [2e-7, 6e-7])
def test_steps_that_are_too_few_to_smooth_are_told_and_doubted(step_m):
    """Of four levels and of two: nobody sees what lies between."""
    surface = rounded(caps_m(), step_m)
    found = smooth_steps(surface)
    assert np.array_equal(found.height_m, surface.height_m)
    assert few_steps(found)
    assert found.rounding.error_m == pytest.approx(
        np.std(np.random.default_rng(0).uniform(-0.5 * step_m, 0.5 * step_m, 10**6)), rel=1e-2
    )
    analysis = analyze(surface, load_settings(overrides=("contact.preload_N=30",)))
    (said,) = (one for one in analysis.problems if one.code == "heights_in_steps")
    assert said.severity == "warning"
    assert f"steps of {step_m:.3g} m, on so few levels" in said.message


@pytest.mark.parametrize("noise", [0.5, 1.0, 3.0])
def test_noise_beside_the_rounding_stays(noise):
    step_m = 1e-8
    noise_m = noise * step_m * np.random.default_rng(2).standard_normal(SHAPE)
    surface = rounded(caps_m() + noise_m, step_m)
    assert smooth_steps(surface) is surface


def test_lost_points_stay_lost_and_cost_nothing_around_them():
    step_m, true_m = 1e-8, caps_m()
    surface = rounded(np.where(np.hypot(X_M - 5e-3, Y_M - 6e-3) < 1e-3, np.nan, true_m), step_m)
    found = smooth_steps(surface)
    assert np.array_equal(found.measured, surface.measured)
    top = true_m > -5e-8
    assert np.std((found.height_m - true_m)[top]) < 0.1 * step_m


def test_a_mirrored_face_is_smoothed_alike():
    surface = rounded(caps_m(), 1e-8)
    mirrored = replace(surface, height_m=surface.height_m[::-1, ::-1])
    there, back = smooth_steps(surface).height_m, smooth_steps(mirrored).height_m[::-1, ::-1]
    assert np.abs(there - back).max() < 1e-9 * np.ptp(there)


def test_few_steps_are_fewer_than_four_above_the_cut():
    for step_m, few in ((1e-8, False), (6e-8, True)):
        assert few_steps(smooth_steps(rounded(caps_m(), step_m))) is few


def test_steps_do_not_change_the_answer():
    settings = load_settings(overrides=("contact.preload_N=30",))
    stiffness = [
        analyze_once(surface, settings).slip.tangential_stiffness_N_per_m
        for surface in (HeightMap(caps_m(), PIXEL_M), rounded(caps_m(), 1e-8))
    ]
    assert stiffness[1] == pytest.approx(stiffness[0], rel=0.03)


@pytest.mark.parametrize("along", [0, 1])
def test_steps_of_grooves_are_seen_whichever_way_they_run(along):
    smooth = (40.0, 5.0) if along == 0 else (5.0, 40.0)
    true_m = gaussian_filter(np.random.default_rng(0).standard_normal((200, 200)), smooth)
    true_m *= 3e-7 / true_m.std()
    found = smooth_steps(rounded(true_m, 1e-8))
    assert found.rounding.step_m == pytest.approx(1e-8)
    assert np.std(found.height_m - true_m) < 0.95 * np.std(rounded(true_m, 1e-8).height_m - true_m)


@pytest.mark.long
def test_the_lower_family_counts_as_well():
    """On the faces of the paper the highest places are those of five caps of 23."""
    stated_m, off_m = [], []
    for seed in (3, 4, 5):
        scene = Scene((200, 300), (2e-4, 2e-4), seed, families=PAPER, gap_m=5e-4)
        exact, _ = synthetic_surface(scene)
        stored = replace(exact, height_m=np.round(exact.height_m / 5e-8) * 5e-8)
        caps, others = (find_face(one, Settings(), None, Clock()).caps for one in (exact, stored))
        off_m += list(moved_m(caps, others))
        stated_m.append(smooth_steps(stored).rounding.error_m)
    true_error_m = np.sqrt(np.mean(np.square(off_m)))
    assert 0.7 < np.sqrt(np.mean(np.square(stated_m))) / true_error_m < 2.5


def moved_m(caps, others):
    """Return by how much the tops of caps that both have are moved against each other."""
    away_m = np.hypot(caps.x_m[:, None] - others.x_m, caps.y_m[:, None] - others.y_m)
    away_m[~caps.usable] = away_m[:, ~others.usable] = np.inf
    same = away_m.min(axis=1) < 1e-3
    off_m = others.peak_height_m[away_m.argmin(axis=1)] - caps.peak_height_m
    return off_m[same] - off_m[same].mean()


@pytest.mark.parametrize(("side", "expected"), [(0, 10.0 / 2.0), (1, 2510.0 / 3.0)])
def test_the_error_is_that_of_the_upper_half_of_each_hill_that_has_nine_points(side, expected):
    """Two pyramids are off by 3 and -1 in their upper halves; a plateau counts from nine on."""
    height_m, off_m = np.zeros((41, 61)), np.full((41, 61), 7.0)
    y, x = np.ogrid[:41, :61]
    for row, above_m in ((10, 3.0), (30, -1.0)):
        pyramid_m = np.maximum(9.0 - np.maximum(abs(y - row), abs(x - 30)), 0.0)
        height_m = np.maximum(height_m, pyramid_m)
        off_m[pyramid_m >= 4.0] = above_m  # 121 points, 48 are at 3
    plateau = np.maximum(abs(y - 20), abs(x - 5)) <= side
    height_m[plateau], off_m[plateau] = 9.0, 50.0
    error_m = _error_of_hills_m(HeightMap(height_m, PIXEL_M), off_m)
    assert error_m == pytest.approx(np.sqrt(expected), rel=1e-12)


@pytest.mark.parametrize("way", ["composite", "together"])
def test_the_doubt_of_two_faces_is_that_of_the_coarser_steps_whichever_comes_first(way):
    gentle = rounded(4e-8 * np.sin(Y_M / 5e-3) * np.cos(X_M / 6e-3), 1e-9)
    coarse = rounded(caps_m(), 6e-8)
    settings = load_settings(overrides=("contact.preload_N=30", f"mating.way={way}"))
    said = [
        [one for one in found.problems if one.code == "heights_in_steps"]
        for found in (
            analyze_once(gentle, settings, coarse),
            analyze_once(coarse, settings, gentle),
        )
    ]
    for first, second in said:
        assert first.severity == second.severity == "warning"
        assert first.effect.energy == second.effect.energy > 0.05
    (one, _), (other, _) = said
    assert one.effect.energy == pytest.approx(other.effect.energy, rel=0.2)
