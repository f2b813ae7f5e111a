"""Doubts about hills, caps and families: seen where they should be, and rarely by chance."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from capslip.caps.doubts import problems_of_bow, problems_of_caps, problems_of_families
from capslip.caps.families import group_families
from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.caps.table import CapFlag, CapTable
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

APPROACH_M = 2e-7


def caps_at(x_m, y_m, peak_height_m):
    n = len(x_m)
    every = {field.name: np.ones(n) for field in fields(CapTable)}
    every |= {"x_m": x_m, "y_m": y_m, "peak_height_m": peak_height_m}
    every["peak_height_se_m"] = np.full(n, np.nan)
    every["family"] = np.full(n, "", dtype="<U1")
    every["flags"] = np.zeros(n, np.uint16)
    return CapTable(**every)


def peaks(rng, spread_m, bow_m=0.0, slope=0.0, h_m=1e-6):
    """8 G-caps and 12 P-caps on a face of 60 mm x 40 mm, in their families."""
    x_m, y_m = rng.uniform(0.0, 60e-3, 20), rng.uniform(0.0, 40e-3, 20)
    peak_m = spread_m * rng.standard_normal(20) - h_m * (np.arange(20) >= 8)
    peak_m += bow_m * (x_m / 30e-3 - 1.0) ** 2 + slope * x_m
    return group_families(caps_at(x_m, y_m, peak_m))[0]


def says_bow(caps):
    return [problem.code for problem in problems_of_bow(caps, APPROACH_M)] == ["bow_left"]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_bow_of_the_peaks_is_seen_in_both_families_at_once(sign):
    rng = np.random.default_rng(0)
    assert sum(says_bow(peaks(rng, 1e-8, sign * 8e-8)) for _ in range(100)) >= 95


def test_scatter_alone_is_rarely_called_a_bow():
    rng = np.random.default_rng(1)
    # A test at 1 %: 5 of 500 expected, standard deviation 2.2
    assert sum(says_bow(peaks(rng, 3e-8)) for _ in range(500)) <= 13


def test_a_tilt_or_two_families_are_no_bow():
    rng = np.random.default_rng(2)
    assert sum(says_bow(peaks(rng, 1e-9, slope=1e-6)) for _ in range(100)) <= 5


def test_a_bow_below_a_tenth_of_the_approach_decides_nothing():
    rng = np.random.default_rng(3)
    assert not any(says_bow(peaks(rng, 1e-10, 1e-8)) for _ in range(20))


@pytest.mark.parametrize("n", [0, 1, 3, 6])
def test_few_peaks_lie_on_any_bow(n):
    rng = np.random.default_rng(n)
    caps = caps_at(rng.uniform(size=n), rng.uniform(size=n), rng.uniform(size=n))
    assert problems_of_bow(group_families(caps)[0], APPROACH_M) == []


SIX = [(x, y, 25.0, 0.0) for x in (5e-3, 14e-3, 23e-3) for y in (5e-3, 14e-3)]


def codes(change_hills=None, change_caps=None, material_ratio=0.1, spike_m=0.0):
    """Return the codes and severities for six clean caps, after some changes."""
    surface = caps_map(SIX)
    hills = find_hills(surface)
    caps = fit_caps(surface, hills, "pinned")
    assert len(caps) == 6
    hills = replace(hills, pruning_height_m=1e-12, **(change_hills or {}))
    caps = caps.with_columns(**(change_caps(caps) if change_caps else {}))
    height_m = surface.height_m.copy()
    height_m[100, 5] = spike_m * np.nanmax(caps.cap_height_m) + caps.peak_height_m.max()
    face = HeightMap(height_m, surface.pixel_size_m)
    return [(p.code, p.severity) for p in problems_of_caps(face, hills, caps, material_ratio)]


def test_six_clean_caps_are_not_doubtful():
    assert codes() == []


def flagged(n, flag):
    return lambda caps: {"flags": np.where(np.arange(6) < n, flag, 0).astype(np.uint16)}


@pytest.mark.parametrize("flag", [flag for flag in CapFlag if flag is not CapFlag.not_convex])
def test_flags_of_more_than_a_fifth_of_the_caps_are_a_warning(flag):
    few = "warning" if flag is CapFlag.plateau else "info"
    assert codes(change_caps=flagged(1, flag)) == [(f"caps_{flag.name}", few)]
    assert codes(change_caps=flagged(2, flag)) == [(f"caps_{flag.name}", "warning")]


@pytest.mark.parametrize(
    ("before", "beyond", "expected"),
    [
        (
            {"change_hills": {"n_hills_half_pruning": 7, "n_hills_double_pruning": 5}},
            {"change_hills": {"n_hills_half_pruning": 8}},
            ("pruning_decides", "warning"),
        ),
        (
            {"change_hills": {"largest_hill_share": 0.5}},  # three of six
            {"change_hills": {"largest_hill_share": 0.51}},
            ("connected_network", "warning"),
        ),
        (
            {"change_hills": {"prominence_m": np.array([0.0, 1, 1, 1, 1, 1])}},
            {"change_hills": {"prominence_m": np.array([0.0, 0, 1, 1, 1, 1])}},
            ("shallow_saddles", "warning"),
        ),
        (
            {"material_ratio": 0.0668},  # a tenth is kept
            {"material_ratio": 0.0664},
            ("plateau_at_cut", "warning"),
        ),
        ({"spike_m": 0.049}, {"spike_m": 0.051}, ("highest_point_on_no_cap", "warning")),
        (
            {"change_caps": lambda caps: {"residual_m": 0.249 * caps.fit_depth_m}},
            {"change_caps": lambda caps: {"residual_m": 0.251 * caps.fit_depth_m}},
            ("not_spherical", "warning"),
        ),
        (
            {},
            {"change_caps": lambda caps: {"cap_height_m": np.full(6, 9e-12)}},
            ("coarse_pruning", "info"),
        ),
    ],
)
def test_a_doubt_about_hills_is_raised_beyond_its_threshold(before, beyond, expected):
    assert codes(**before) == []
    assert expected in codes(**beyond)


def test_no_usable_cap_is_the_last_that_is_asked():
    none = np.full(6, CapFlag.not_convex, dtype=np.uint16)
    found = codes({"n_hills_half_pruning": 9}, lambda caps: {"flags": none}, spike_m=1.0)
    assert found == [("pruning_decides", "warning"), ("no_caps", "warning")]


def test_families_that_are_not_clear_are_named():
    x_m = np.linspace(0.0, 1e-2, 6)
    for heights, expected in (
        ([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], []),
        ([1.0] * 6, [("one_family", "info")]),
        (
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
            [("one_family", "info"), ("families_doubtful", "warning")],
        ),
    ):
        caps, families = group_families(caps_at(x_m, x_m, np.array(heights)))
        found = [(p.code, p.severity) for p in problems_of_families(caps, families)]
        assert found == expected
    three = replace(families, levels=families.levels * 3, separation=math.inf)
    found = [p.code for p in problems_of_families(caps, three)]
    assert found == ["one_family", "more_than_two_families"]
