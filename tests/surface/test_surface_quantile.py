"""Quantiles against sorting all sizes."""

import numpy as np
import pytest

from capslip.surface.quantile import EVERY, quantile


def sorted_at(sizes, share):
    known = np.sort(sizes[~np.isnan(sizes)])
    return known[int(share * (known.size - 1))]


@pytest.mark.parametrize("share", [0.0, 0.5, 0.9, 0.99, 1.0])
@pytest.mark.parametrize("n", [1, 2, 15, 16, 17, 1000, 50_000])
def test_a_quantile_is_that_of_all_sorted(n, share):
    rng = np.random.default_rng(n)
    for sizes in (rng.random(n), np.abs(rng.standard_cauchy(n)), np.round(3.0 * rng.random(n))):
        assert quantile(sizes, share) == sorted_at(sizes, share)


@pytest.mark.parametrize("lost", [0.01, 0.5, 0.99])
def test_what_is_not_known_is_left_out(lost):
    rng = np.random.default_rng(1)
    sizes = rng.random(20_000)
    sizes[rng.random(sizes.size) < lost] = np.nan
    assert quantile(sizes, 0.9) == sorted_at(sizes, 0.9)


def test_a_sample_that_leads_astray_changes_nothing():
    sizes = np.arange(1.0, 4001.0)
    for far in (0.0, 1e6, np.nan):
        sizes[::EVERY] = far
        assert quantile(sizes, 0.9) == sorted_at(sizes, 0.9)


def test_of_nothing_known_there_is_none():
    assert np.isnan(quantile(np.full(40, np.nan), 0.9))
    assert np.isnan(quantile(np.empty(0), 0.9))
