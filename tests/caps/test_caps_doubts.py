"""Doubts about hills, caps and families: seen where they should be, and rarely by chance."""

from dataclasses import fields

import numpy as np
import pytest

from capslip.caps.doubts import problems_of_bow
from capslip.caps.families import group_families
from capslip.caps.table import CapTable

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
