"""Flags of caps: each is set just beyond its threshold, and not just before it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.caps.apex import find_apexes
from capslip.caps.body import body_of_hills
from capslip.caps.fit import fit_caps
from capslip.caps.fitting import FitInput, fit_named
from capslip.caps.flags import flags_of_caps, outliers
from capslip.caps.hills import find_hills
from capslip.caps.noise import noise_on_hills
from capslip.caps.points import points_of_hills
from capslip.caps.table import CapFlag
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

CLEAN = {
    "count": 1000,
    "ties": 1,
    "limit": 0,
    "radius_ratio": 1.0,
    "scattered": False,
    "noise_m": 0.0,
    "apex_se_m": 0.0,
    "on_surface": True,
    "radius_m": 25.0,
}


def flags(**changed):
    """Return the flags of one cap, 1 um high, on a hill of 1000 points."""
    hill = CLEAN | changed
    one = {name: np.array([value]) for name, value in hill.items()}
    points = SimpleNamespace(
        n_hills=1,
        count=one["count"],
        hill=np.zeros(3, dtype=int),
        limit=np.array([0, hill["limit"], 0], dtype=np.uint8),
    )
    given = SimpleNamespace(
        points=points,
        apexes=SimpleNamespace(ties=one["ties"]),
        body=SimpleNamespace(radius_ratio=one["radius_ratio"], scattered=one["scattered"]),
        noise=SimpleNamespace(rms_m=hill["noise_m"]),
    )
    spheres = SimpleNamespace(
        apex_se_m=one["apex_se_m"], on_surface=one["on_surface"], radius_m=one["radius_m"]
    )
    return CapFlag(int(flags_of_caps(given, spheres, np.array([1e-6]))[0]))


@pytest.mark.parametrize(
    ("before", "beyond", "flag"),
    [
        ({}, {"limit": 1}, CapFlag.edge),
        ({}, {"limit": 2}, CapFlag.non_measured),
        ({"count": 100, "ties": 4}, {"count": 100, "ties": 5}, CapFlag.plateau),
        ({"ties": 10}, {"ties": 11}, CapFlag.plateau),  # a hundredth of the points
        ({}, {"radius_m": np.nan}, CapFlag.not_convex),
        ({"noise_m": 0.0999e-6}, {"noise_m": 0.1001e-6}, CapFlag.noisy_apex),
        ({"apex_se_m": 0.0499e-6}, {"apex_se_m": 0.0501e-6}, CapFlag.noisy_apex),
        ({}, {"on_surface": False}, CapFlag.apex_off_surface),
        ({"count": 9}, {"count": 8}, CapFlag.few_points),
        ({"radius_ratio": 10.0}, {"radius_ratio": 10.001}, CapFlag.ridge),
        ({}, {"radius_ratio": np.nan}, CapFlag.ridge),
        ({}, {"scattered": True}, CapFlag.several_peaks),
    ],
)
def test_a_flag_is_set_beyond_its_threshold(before, beyond, flag):
    assert flags(**before) == CapFlag(0)
    assert flags(**beyond) == flag


def test_too_few_points_are_no_ridge():
    assert flags(count=8, radius_ratio=np.nan) == CapFlag.few_points


def test_an_outlier_is_five_robust_spreads_off():
    usual = np.linspace(-0.45, 0.45, 19)
    both = np.append(usual, 99.0)
    middle = np.median(both)
    spread = 1.4826 * np.median(np.abs(both - middle))
    assert 5 * spread > np.log(3)
    for share, found in ((4.99, 0), (5.01, 1)):
        for sign in (-1.0, 1.0):  # the median is the same, mirrored
            logarithm = sign * np.append(usual, middle + share * spread)
            assert outliers(np.exp(logarithm)).sum() == found
            assert outliers(np.exp(logarithm))[-1] == bool(found)


def test_an_outlier_among_equal_caps_is_three_times_as_large():
    same = np.full(12, 25.0)
    assert not outliers(np.append(same, [2.99 * 25, 25 / 2.99])).any()
    assert outliers(np.append(same, [3.01 * 25, 25 / 3.01]))[-2:].all()


def test_nine_radii_are_needed_for_an_outlier():
    eight = np.append(np.full(7, 25.0), 1.0)
    assert not outliers(np.append(eight, np.nan)).any()
    assert outliers(np.append(eight, 25.0)).tolist() == [False] * 7 + [True, False]


PIXEL_M = 1e-4
Y, X = (np.mgrid[:100, :100] + 0.5) * PIXEL_M
FROM_CENTRE = np.hypot(X - 5e-3, Y - 5e-3)


def hills_of(height_m, above):
    """One hill of any shape, and its map."""
    surface = HeightMap(height_m, (PIXEL_M, PIXEL_M))
    hills = replace(
        find_hills(caps_map([(6e-3, 5e-3, 24.0, 0.0)])),
        label=above.astype(np.int32),
        cut_height_m=float(height_m[above].min()),
        noise_m=0.0,
    )
    return surface, hills


@pytest.mark.parametrize(("hole", "flagged"), [(0.30, False), (0.37, True)])
def test_several_peaks_fill_less_than_four_fifths_of_their_ellipse(hole, flagged):
    """A ring fills (1 - r^2) / (1 + r^2) of the ellipse of its moments: 0.8 at r = 1/3."""
    above = (FROM_CENTRE <= 4e-3) & np.greater_equal(FROM_CENTRE, hole * 4e-3)
    table = fit_caps(*hills_of(-(FROM_CENTRE**2) / 50, above), "least_squares")
    assert bool(table.flags[0] & CapFlag.several_peaks) == flagged


@pytest.mark.parametrize(("ratio", "flagged"), [(9.9, False), (10.1, True)])
def test_a_ridge_is_ten_times_as_curved_across(ratio, flagged):
    height_m = -((X - 5e-3) ** 2 + (Y - 5e-3) ** 2 / ratio) / 5
    table = fit_caps(*hills_of(height_m, height_m >= -3e-7), "least_squares")
    assert bool(table.flags[0] & CapFlag.ridge) == flagged


@pytest.mark.parametrize(("share", "stays"), [(0.09, True), (-0.09, True), (0.11, False)])
def test_a_free_apex_stays_within_a_tenth_of_the_depth(share, stays):
    surface, hills = hills_of(-(FROM_CENTRE**2) / 50, FROM_CENTRE <= 4e-3)
    points = points_of_hills(surface, hills)
    noise = noise_on_hills(surface, points)
    apexes = find_apexes(surface, hills, points, noise)
    body = body_of_hills(hills.cut_height_m, points, apexes, noise, np.full(1, np.nan), 1.0)
    shift_m = np.array([[0.0], [0.0], [share * body.depth_m[0]]])
    moved = replace(apexes, apex_m=apexes.apex_m + shift_m)
    given = FitInput(surface, hills, points, noise, moved, body, False)
    found = fit_named("least_squares").spheres(given)
    assert found.on_surface.tolist() == [stays]
    expected_m = apexes.apex_m[2] if stays else moved.apex_m[2]
    assert found.apex_m == pytest.approx(expected_m, abs=1e-13)
