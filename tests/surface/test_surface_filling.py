"""Filling where the measured points stand alone: exact planes, stated errors, holes that stay."""

import numpy as np
import pytest

from capslip import load_settings
from capslip.analysis import analyze_once
from capslip.surface.filling import fill_scattered, filled_from_fewer
from capslip.surface.heightmap import Filling, HeightMap
from capslip.surface.holes import problems_of_filling, problems_of_holes
from capslip.surface.outliers import find_outliers, stand_alone

SHAPE, PIXEL_M = (120, 160), (1e-4, 1.5e-4)
Y_M, X_M = ((np.indices(SHAPE)[k] + 0.5) * PIXEL_M[k] for k in (0, 1))
RADIUS_M = 2.0


def lost(share, seed=0):
    return np.random.default_rng(seed).random(SHAPE) < share


def holed(z_m, mask):
    return HeightMap(np.where(mask, np.nan, z_m), PIXEL_M)


def spheres():
    """Return tops of paraboloids side by side, on a floor that they do not leave."""
    across_m = [(at_m % 4e-3) - 2e-3 for at_m in (X_M, Y_M)]
    return -(across_m[0] ** 2 + across_m[1] ** 2) / (2.0 * RADIUS_M)


@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
def test_a_plane_is_filled_exactly_and_measured_points_stay(share):
    plane_m, mask = 1e-3 * X_M - 2e-3 * Y_M, lost(share)
    filled = fill_scattered(holed(plane_m, mask)).height_m
    assert np.array_equal(filled[~mask], plane_m[~mask])
    known = ~np.isnan(filled)
    assert known[8:-8, 8:-8].all()
    assert np.abs(filled - plane_m)[known].max() < 1e-9 * np.ptp(plane_m)


def test_a_map_that_is_whole_around_its_holes_stays_as_it_is():
    for mask in (lost(0.0), lost(0.2), np.hypot(X_M - 8e-3, Y_M - 6e-3) < 5e-3, X_M > 1e-2):
        surface = holed(spheres(), mask)
        assert fill_scattered(surface) is surface


def test_a_hole_stays_where_points_stand_alone():
    away_m = np.hypot(X_M - 1.2e-2, Y_M - 6e-3)
    filled = fill_scattered(holed(spheres(), lost(0.6) | (away_m < 2.5e-3)))
    assert np.isnan(filled.height_m[away_m < 2e-3]).all()
    assert problems_of_holes(filled, 2e-3)
    assert not problems_of_holes(filled, 3e-3)


@pytest.mark.parametrize("share", [0.6, 0.8, 0.9])
@pytest.mark.parametrize("noise_m", [0.0, 2e-8])
def test_the_stated_error_is_that_of_what_was_filled(share, noise_m):
    """A point that is left out has fewer around it, and its own noise; so it is no less."""
    mask, true_m = lost(share), spheres()
    noise = noise_m * np.random.default_rng(1).standard_normal(SHAPE)
    filled = fill_scattered(holed(true_m + noise, mask))
    high = mask & (true_m > np.quantile(true_m, 0.9)) & ~np.isnan(filled.height_m)
    error_m = np.sqrt(np.mean((filled.height_m - true_m)[high] ** 2))
    assert 0.5 * filled.filling.error_m < error_m < 1.5 * filled.filling.error_m
    assert filled.filling.way == ("cubic" if noise_m == 0.0 else filled.filling.way)


def test_neighbours_are_near_in_metres_not_in_pixels():
    """On pixels eight times as long as wide, as on the same ones taken for square."""
    long_m = (8e-4, 1e-4)
    y_m, x_m = ((np.indices((60, 480))[k] + 0.5) * long_m[k] for k in (0, 1))
    waves_m = np.sin(2.0 * np.pi * x_m / 6e-3) * np.sin(2.0 * np.pi * y_m / 6e-3)
    mask = np.random.default_rng(0).random(waves_m.shape) < 0.6
    error_m = []
    for pixel_m in (long_m, (1e-4, 1e-4)):
        filled = fill_scattered(HeightMap(np.where(mask, np.nan, waves_m), pixel_m))
        off_m = (filled.height_m - waves_m)[mask]
        error_m.append(np.sqrt(np.nanmean(off_m**2)))
        assert filled.filling.error_m < 3.0 * error_m[-1]
    assert error_m[0] < 0.7 * error_m[1]


def test_steps_are_filled_by_planes_that_reach_no_further_than_the_points():
    steps_m = 1e-6 * np.round(np.random.default_rng(2).standard_normal((12, 16)))
    z_m = np.kron(steps_m, np.ones((10, 10)))
    filled = fill_scattered(holed(z_m, lost(0.7)))
    assert filled.filling.way == "linear"
    assert np.nanmax(np.abs(filled.height_m)) <= np.abs(z_m).max() * (1.0 + 1e-9)


def test_the_chance_to_miss_a_hill_is_that_of_a_disc_without_a_point():
    filling = fill_scattered(holed(spheres(), lost(0.9))).filling
    for radius_m in (2e-4, 5e-4):
        on_disc = np.pi * radius_m**2 / (PIXEL_M[0] * PIXEL_M[1])
        assert 1.0 <= filling.chance_to_miss(radius_m) / 0.9**on_disc < 1.6


def test_what_was_filled_is_a_warning_where_its_error_is_a_tenth_of_the_approach():
    filling = Filling(9, 0.9, "cubic", 1e-9, 1e6)
    surface = HeightMap(np.zeros((5, 5)), PIXEL_M, filling=filling)
    for approach_m, severity in ((2e-8, "info"), (9e-9, "warning"), (0.0, "info")):
        assert [p.severity for p in problems_of_filling(surface, approach_m)] == [severity]
    assert problems_of_filling(HeightMap(np.zeros((5, 5)), PIXEL_M), 1e-8) == []


@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
def test_outliers_are_found_among_points_that_stand_alone(share):
    mask, z_m = lost(share), spheres() + 1e-9 * np.random.default_rng(3).standard_normal(SHAPE)
    assert stand_alone(~mask)
    assert find_outliers(holed(z_m, mask)).index.size == 0
    bad = np.random.default_rng(4).choice(np.flatnonzero(~mask), 5, replace=False)
    z_m.reshape(-1)[bad] += 1e-5 * np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    assert set(find_outliers(holed(z_m, mask)).index) == set(bad)
    z_m.reshape(-1)[bad] = -32768.0
    assert set(find_outliers(holed(z_m, mask)).index) == set(bad)


def test_a_rough_face_has_no_outliers_where_its_points_stand_alone():
    rough_m = 1e-6 * np.random.default_rng(5).standard_normal(SHAPE)
    for z_m in (rough_m, rough_m.cumsum(axis=0).cumsum(axis=1)):
        assert find_outliers(holed(z_m, lost(0.8))).index.size == 0


def test_lost_points_do_not_change_the_answer():
    settings = load_settings(overrides=("contact.preload_N=50", "contact.model=caps"))
    whole = holed(spheres(), lost(0.0))
    stiffness = [
        analyze_once(surface, settings).slip.tangential_stiffness_N_per_m
        for surface in (whole, holed(spheres(), lost(0.8)))
    ]
    assert stiffness[1] == pytest.approx(stiffness[0], rel=0.02)


def test_fewer_points_fill_a_map_as_if_the_others_had_never_been_measured():
    """Each fifth in turn; beyond the points that are left the map stays as it was."""
    mask, true_m = lost(0.9), spheres()
    filled = fill_scattered(holed(true_m, mask))
    every = list(filled_from_fewer(filled))
    assert len(every) == 5
    measured, changed = np.flatnonzero(~mask), np.zeros(SHAPE, dtype=int)
    for one, again in enumerate(every):
        out = mask.copy()
        out.ravel()[measured[np.arange(measured.size) % 5 == one]] = True
        alone = fill_scattered(holed(true_m, out))
        known = out & ~np.isnan(alone.height_m)
        assert alone.filling.way == filled.filling.way
        assert np.abs(again.height_m - alone.height_m)[known].max() < 1e-9 * np.ptp(true_m)
        assert np.array_equal(np.isnan(again.height_m), np.isnan(filled.height_m))
        changed += (again.height_m != filled.height_m) & ~mask
    assert changed.max() == 1  # no measured point is left out twice
    assert list(filled_from_fewer(holed(true_m, mask))) == []
    other = Filling(9, 0.9, "cubic", 1e-9, 1e6, measured=np.ones((3, 3), dtype=bool))
    assert list(filled_from_fewer(HeightMap(true_m, PIXEL_M, filling=other))) == []
