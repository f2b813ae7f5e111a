"""Families: two where there are two, one where there is one."""

import numpy as np
import pytest

from pipeline.caps.families import group_families
from pipeline.caps.table import CapFlag, CapTable


def table(peak_height_m, flags=None):
    n = len(peak_height_m)
    one = np.ones(n)
    return CapTable(
        x_m=one,
        y_m=one,
        peak_height_m=np.asarray(peak_height_m, float),
        cap_height_m=one,
        diameter_m=one,
        radius_m=one,
        area_m2=one,
        residual_m=one,
        family=np.full(n, "", dtype="<U1"),
        load_N=np.full(n, np.nan),
        contact_radius_m=np.full(n, np.nan),
        flags=np.zeros(n, np.uint16) if flags is None else np.asarray(flags, np.uint16),
    )


@pytest.mark.parametrize("seed", range(20))
def test_two_families_are_counted_exactly(seed):
    rng = np.random.default_rng(seed)
    heights = np.concatenate((rng.normal(0, 1e-8, 5), rng.normal(-2.4e-7, 1e-8, 18)))
    order = rng.permutation(23)
    caps, families = group_families(table(heights[order]))
    assert (families.m, families.n) == (5, 18)
    assert families.h_m == pytest.approx(2.4e-7, abs=2e-8)
    assert set(order[caps.family == "G"]) == set(range(5))


def test_exact_repeats_are_two_families():
    _, families = group_families(table([0.0] * 5 + [-2.4e-7] * 18))
    assert (families.m, families.n) == (5, 18)
    assert families.h_m == pytest.approx(2.4e-7, rel=1e-12)


@pytest.mark.parametrize("draw", ["normal", "uniform"])
def test_a_continuum_is_one_family(draw):
    wrong = 0
    for seed in range(50):
        heights = getattr(np.random.default_rng(seed), draw)(size=25)
        wrong += group_families(table(heights))[1].count != 1
    assert wrong <= 5


@pytest.mark.parametrize(
    ("heights", "m", "n"), [([], 0, 0), ([1.0], 1, 0), ([1.0] * 7, 7, 0), ([1.0, 2.0], 2, 0)]
)
def test_too_little_for_two_families_is_one(heights, m, n):
    _, families = group_families(table(heights))
    assert (families.m, families.n, families.h_m) == (m, n, None)


def test_two_can_be_asked_for():
    _, families = group_families(table([1.0, 2.0]), 2)
    assert (families.m, families.n, families.h_m) == (1, 1, 1.0)
    _, families = group_families(table([0.0, 0.0, 1.0]), 1)
    assert (families.m, families.n) == (3, 0)


def test_caps_without_a_sphere_belong_to_no_family():
    caps, families = group_families(table([0.0, 1.0, 2.0], [0, CapFlag.not_convex, 0]), 2)
    assert (families.m, families.n) == (1, 1)
    assert list(caps.family) == ["P", "", "G"]
