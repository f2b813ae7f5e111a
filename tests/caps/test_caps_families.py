"""Families: two where there are two, one where there is one, a doubt where that is not clear."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from capslip.caps.clusters import cluster
from capslip.caps.families import group_families
from capslip.caps.fit import fit_caps
from capslip.caps.hills import find_hills
from capslip.caps.table import CapFlag, CapTable
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

ONE_FAMILY = {
    "normal": lambda rng, n: rng.normal(size=n),
    "uniform": lambda rng, n: rng.uniform(size=n),
    "exponential": lambda rng, n: rng.exponential(size=n),
    "exponential_down": lambda rng, n: -rng.exponential(size=n),
    "gamma": lambda rng, n: rng.gamma(2.0, size=n),
    "gumbel": lambda rng, n: rng.gumbel(size=n),
    "lognormal": lambda rng, n: rng.lognormal(sigma=0.5, size=n),
}


def table(peak_height_m, flags=None, **columns):
    n = len(peak_height_m)
    every = {f.name: np.ones(n) for f in fields(CapTable)}
    every["peak_height_m"] = np.asarray(peak_height_m, float)
    every["peak_height_se_m"] = np.full(n, np.nan)  # nothing known, unless given
    every["family"] = np.full(n, "", dtype="<U1")
    every["flags"] = np.zeros(n, np.uint16) if flags is None else np.asarray(flags, np.uint16)
    return CapTable(**every | {name: np.asarray(value, float) for name, value in columns.items()})


def families_of(peak_height_m, *args, **columns):
    return group_families(table(peak_height_m, **columns), *args)[1]


@pytest.mark.parametrize("seed", range(20))
def test_two_families_are_counted_exactly(seed):
    rng = np.random.default_rng(seed)
    heights = np.concatenate((rng.normal(0, 1e-8, 5), rng.normal(-2.4e-7, 1e-8, 18)))
    order = rng.permutation(23)
    caps, families = group_families(table(heights[order]))
    assert (families.m, families.n) == (5, 18)
    assert families.h_m == pytest.approx(2.4e-7, abs=4 * families.h_se_m)
    assert 2e-9 < families.h_se_m < 8e-9  # 1e-8 sqrt(1/5 + 1/18) = 5e-9
    assert set(order[caps.family == "G"]) == set(range(5))
    assert families.clear
    assert families.count_se < 0.01


def test_the_error_of_h_is_the_error_found():
    rng = np.random.default_rng(0)
    error, said = [], []
    for _ in range(400):
        families = families_of(np.append(rng.normal(25, 1, 3), rng.normal(0, 1, 9)))
        error.append(families.h_m - 25)
        said.append(families.h_se_m)
    assert np.std(error) == pytest.approx(np.sqrt(np.mean(np.square(said))), rel=0.1)


def test_the_error_of_the_count_is_about_the_error_found():
    rng = np.random.default_rng(1)
    error, said = [], []
    for _ in range(300):
        families = families_of(np.append(rng.normal(5, 1, 30), rng.normal(0, 1, 30)), 2)
        error.append(families.m - 30)
        said.append(families.count_se)
    assert 0.6 < np.sqrt(np.mean(np.square(said))) / np.std(error) < 1.1


def test_exact_repeats_are_two_families():
    families = families_of([0.0] * 5 + [-2.4e-7] * 18)
    assert (families.m, families.n) == (5, 18)
    assert families.h_m == pytest.approx(2.4e-7, rel=1e-12)
    assert families.separation == math.inf
    assert families.h_se_m == 0.0
    assert families.clear


@pytest.mark.parametrize("draw", ONE_FAMILY.values(), ids=ONE_FAMILY)
@pytest.mark.parametrize("n", [5, 23, 100])
def test_one_family_is_not_taken_for_two_without_a_doubt(draw, n):
    rng = np.random.default_rng(n)
    found = [families_of(draw(rng, n)) for _ in range(100)]
    assert sum(families.count == 2 for families in found) <= 20
    assert sum(families.count == 2 and families.clear for families in found) <= 4


@pytest.mark.parametrize(("m", "n", "at_least"), [(2, 9, 35), (5, 18, 70), (20, 80, 95)])
def test_two_families_at_six_spreads_are_never_denied_without_a_doubt(m, n, at_least):
    rng = np.random.default_rng(n)
    found = [families_of(np.append(rng.normal(6, 1, m), rng.normal(0, 1, n))) for _ in range(100)]
    assert sum(families.count == 2 for families in found) >= at_least
    assert sum(families.count == 1 and families.clear for families in found) <= 4


def test_a_scale_and_an_origin_change_nothing():
    heights = np.random.default_rng(5).gamma(2.0, size=30)
    here, there = families_of(heights), families_of(1e-8 * heights + 3e-6)
    assert there.m == here.m
    assert there.log_odds == pytest.approx(here.log_odds, rel=1e-6)
    assert there.separation == pytest.approx(here.separation, rel=1e-6)


@pytest.mark.parametrize(
    ("heights", "m", "clear"),
    [([], 0, True), ([1.0], 1, True), ([1.0] * 7, 7, True), ([1.0, 2.0], 2, False)],
)
def test_too_little_for_two_families_is_one(heights, m, clear):
    families = families_of(heights)
    assert (families.m, families.n, families.h_m, families.clear) == (m, 0, None, clear)


def test_two_can_be_asked_for_but_stay_in_doubt():
    families = families_of([1.0, 2.0], 2)
    assert (families.m, families.n, families.h_m, families.h_se_m) == (1, 1, 1.0, None)
    assert not families.clear
    families = families_of([0.0] * 5 + [1.0] * 3, 1)
    assert (families.m, families.n) == (8, 0)
    assert not families.clear


def test_three_levels_are_named_and_two_are_taken():
    rng = np.random.default_rng(2)
    heights = np.concatenate([rng.normal(level, 1.0, n) for level, n in ((90, 4), (60, 6), (0, 9))])
    families = families_of(heights)
    assert [family.count for family in families.levels] == [4, 6, 9]
    assert (families.m, families.n) == (10, 9)
    assert not families.clear


def test_caps_without_a_sphere_belong_to_no_family():
    caps, families = group_families(table([0.0, 1.0, 2.0], [0, CapFlag.not_convex, 0]), 2)
    assert (families.m, families.n) == (1, 1)
    assert list(caps.family) == ["P", "", "G"]


def test_families_by_radius_are_still_named_by_height():
    families = families_of([0.0, 1, 2, 7, 8, 9], 2, "radius", radius_m=[30.0, 31, 29, 10, 11, 9])
    assert families.G.mean_radius_m == pytest.approx(10.0)
    assert families.h_m == pytest.approx(7.0)


def test_the_radius_of_a_family_carries_the_load_of_its_caps():
    radius_m = np.array([10.0, 20.0, 40.0])
    family = families_of(np.zeros(3), 1, radius_m=radius_m).G
    assert 3 * math.sqrt(family.radius_m) == pytest.approx(np.sqrt(radius_m).sum(), rel=1e-14)
    assert family.mean_radius_m == pytest.approx(70 / 3)
    # With a spread s of the heights, 3/8 (s / x)^2 of the load is left
    height = np.random.default_rng(3).normal(size=2000)
    height -= height.mean()
    load = (10.0 + height) ** 1.5
    assert load.mean() / 10.0**1.5 - 1 == pytest.approx(3 / 8 / 100, rel=0.1)


def brute_force_within(z, count):
    """Least sum of squares over all contiguous splits, by recursion."""
    if count == 1:
        return ((z - z.mean()) ** 2).sum()
    return min(
        ((z[:i] - z[:i].mean()) ** 2).sum() + brute_force_within(z[i:], count - 1)
        for i in range(1, len(z) - count + 2)
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_splits_are_the_best_there_are(seed):
    z = np.sort(np.random.default_rng(seed).exponential(size=12))
    for count, sizes in enumerate(cluster(z).sizes, start=1):
        parts = np.split(z, np.cumsum(sizes)[:-1])
        within = sum(((part - part.mean()) ** 2).sum() for part in parts)
        assert (len(sizes), sizes.sum()) == (count, 12)
        assert within == pytest.approx(brute_force_within(z, count), rel=1e-9)


def test_the_evidence_is_the_integral_that_it_stands_for():
    """One normal or uniform shape, integrated over place and width by brute force."""
    z = np.array([0.0, 0.3, 0.45, 1.0])
    log_width = np.linspace(-4.0, 9.0, 801)
    width = np.exp(log_width)
    place = np.linspace(-1.0, 1.0, 1501)[:, None]
    at = 0.5 + 6.0 * width * place  # fine where the width is small
    normal = np.exp(-0.5 * sum(((x - at) / width) ** 2 for x in z)) / (2 * np.pi * width**2) ** 2
    covers = (np.abs(z[0] - at) <= width / 2) & (np.abs(z[-1] - at) <= width / 2)
    uniform = covers / width**4
    exponential = 0.0
    for tail in (z, -z):
        above = tail[:, None, None] - at
        exponential = exponential + np.where(
            (above >= 0).all(axis=0), np.exp(-np.maximum(above, 0).sum(axis=0) / width), 0
        ) / (width**4)
    # d(place) = 6 width d(share); d(width) / width = d(log width)
    integrand = (normal + uniform + exponential) / 4 * 6.0 * width
    step = (place[1, 0] - place[0, 0]) * (log_width[1] - log_width[0])
    assert cluster(z).log_evidence[0] == pytest.approx(math.log(integrand.sum() * step), abs=0.01)


@pytest.mark.parametrize(("noise", "within"), [(0.0, 0.02), (0.1, 0.05)])
@pytest.mark.parametrize(("m", "n", "h_m"), [(2, 9, 2.4e-7), (5, 18, 1.2e-7), (1, 4, 2.4e-7)])
def test_the_families_of_a_face_are_found(noise, within, m, n, h_m):
    """Noise as a share of the smallest cap's height, a tilt, and 2 % of the points lost."""
    scene = Scene(
        shape=(400, 600),
        pixel_size_m=(1e-4, 1e-4),
        seed=2,
        families=(CapFamily("G", m, 23.8), CapFamily("P", n, 26.7, h_m)),
        floor_m=4e-7,
        tilt=(2e-5, -3e-5),
        non_measured_fraction=0.02,
    )
    _, truth = synthetic_surface(scene)
    smallest_m = (truth.peak_height_m - truth.cut_height_m).min()
    face = condition(synthetic_surface(replace(scene, noise_rms_m=noise * smallest_m))[0]).surface
    _, families = group_families(fit_caps(face, find_hills(face)))
    assert (families.m, families.n) == (m, n)
    assert families.h_m == pytest.approx(h_m, rel=within)
    assert families.clear


def test_equal_caps_that_differ_by_rounding_are_one_family():
    x, y = np.meshgrid(0.002 + 0.004 * np.arange(6), 0.002 + 0.004 * np.arange(4))
    surface = caps_map([(*place, 2.0, 0.0) for place in zip(x.flat, y.flat, strict=True)])
    surface = HeightMap(surface.height_m[:160, :240] + 1e-10, surface.pixel_size_m)
    hills = find_hills(surface, 0.10)
    caps, families = group_families(fit_caps(surface, hills, "equation18"))
    assert len(caps) == 24
    assert 0 < np.ptp(caps.peak_height_m) < 1e-18
    assert (families.m, families.n, families.h_m) == (24, 0, None)
    assert families.clear


def heights_with_errors(rng, n, levels_m=(0.0,)):
    """Peaks of equal height, or of two, as fits would see them: with known standard errors."""
    error_m = 1e-9 * rng.uniform(0.5, 2.0, n)
    return rng.choice(levels_m, n) + error_m * rng.standard_normal(n), error_m


@pytest.mark.parametrize("n", [2, 3, 5, 12, 40])
def test_peaks_alike_within_their_errors_are_one_family_beyond_doubt(n):
    rng = np.random.default_rng(n)
    found = []
    for _ in range(200):
        peak_m, error_m = heights_with_errors(rng, n)
        found.append(families_of(peak_m, peak_height_se_m=error_m))
    settled = [families for families in found if families.alike]
    assert all((families.m, families.n, families.clear) == (n, 0, True) for families in settled)
    assert len(settled) >= 192  # 198 expected of a test at 1 %, with a standard deviation of 1.4


def test_peaks_that_differ_by_more_than_their_errors_are_not_alike():
    rng = np.random.default_rng(1)
    for n in (3, 5, 12):
        peak_m, error_m = heights_with_errors(rng, n)
        peak_m[0] += 2e-8  # ten times the greatest error
        assert not families_of(peak_m, peak_height_se_m=error_m).alike


def test_two_families_within_noise_are_not_declared_one():
    """Where noise is a visible part of the caps, equal within the errors says nothing."""
    peak_m, error_m = heights_with_errors(np.random.default_rng(3), 6)
    noisy = table(peak_m, [CapFlag.noisy_apex] * 6, peak_height_se_m=error_m)
    assert not group_families(noisy)[1].alike
    assert not families_of(peak_m).alike  # errors that are not known settle nothing


def test_a_hill_that_is_no_sphere_is_not_alike_for_its_great_error():
    peak_m, error_m = heights_with_errors(np.random.default_rng(4), 7)
    peak_m[:3] -= 2e-8
    error_m[:3] = 2e-8
    assert not families_of(peak_m, peak_height_se_m=error_m).alike
