"""Families: two where there are two, one where there is one, a doubt where that is not clear."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from capslip.caps.clusters import Clusters, cluster
from capslip.caps.families import _supported, group_families, surface_of_families
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


@pytest.mark.long
def test_the_error_of_h_is_the_error_found():
    rng = np.random.default_rng(0)
    error, said = [], []
    for _ in range(400):
        families = families_of(np.append(rng.normal(25, 1, 3), rng.normal(0, 1, 9)))
        error.append(families.h_m - 25)
        said.append(families.h_se_m)
    assert np.std(error) == pytest.approx(np.sqrt(np.mean(np.square(said))), rel=0.1)


@pytest.mark.long
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


@pytest.mark.long
@pytest.mark.parametrize("draw", ONE_FAMILY.values(), ids=ONE_FAMILY)
@pytest.mark.parametrize("n", [5, 100])
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
    _, families = group_families(fit_caps(face, find_hills(face), "pinned"))
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


@pytest.mark.long
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


def test_alike_is_a_chi_square_test_at_one_per_cent():
    # Two peaks of equal error: 2.5758 of the error of their difference
    for share, alike in ((2.57, True), (2.58, False)):
        peak_m = [0.0, share * np.sqrt(2.0)]
        assert families_of(peak_m, peak_height_se_m=[1.0, 1.0]).alike == alike
    # Three, two of them equal: sum of squares 2/3 d^2, 9.2103 at two degrees of freedom
    for apart, alike in ((3.71, True), (3.72, False)):
        assert families_of([0.0, 0.0, apart], peak_height_se_m=[1.0] * 3).alike == alike
    # An error of ten counts as twice the median, with a quarter of the weight: 2/9 d^2
    for apart, alike in ((6.43, True), (6.45, False)):
        assert families_of([0.0, 0.0, apart], peak_height_se_m=[1.0, 1.0, 10.0]).alike == alike


def test_the_error_of_the_count_is_that_of_its_odds():
    """Each cap is a draw from the odds of two normal families, of the sizes and width found."""
    from scipy.stats import norm

    low, high = np.array([0.0, 0.5, 1.0, 1.2, 1.9, 2.4]), np.array([4.1, 4.8, 5.0])
    families = families_of(np.concatenate((low, high)), 2)
    assert (families.m, families.n) == (3, 6)
    squares = ((low - low.mean()) ** 2).sum() + ((high - high.mean()) ** 2).sum()
    spread = np.sqrt(squares / 7)
    values = np.concatenate((low, high))
    density = [len(part) * norm.pdf(values, part.mean(), spread) for part in (low, high)]
    share = density[0] / (density[0] + density[1])
    assert families.count_se == pytest.approx(np.sqrt((share * (1 - share)).sum()), rel=1e-9)
    assert families.count_se > 0.1


@pytest.mark.long
def test_two_standard_errors_of_the_count_hold_the_truth_nine_times_in_ten():
    rng = np.random.default_rng(7)
    held = []
    for _ in range(300):
        families = families_of(np.append(rng.normal(5.5, 1, 30), rng.normal(0, 1, 30)), 2)
        held.append(abs(families.m - 30) <= 2.0 * families.count_se)
    assert 0.85 < np.mean(held) < 0.99


def test_the_numbers_of_a_family_are_those_of_its_caps():
    columns = {
        "diameter_m": [4.0, 6.0, 1.0, 1.5, 2.0],
        "cap_height_m": [7.0, 8.0, 2.0, 2.5, 3.0],
        "radius_m": [9.0, 16.0, 4.0, 4.0, 4.0],
    }
    families = families_of([100.0, 101.0, 0.0, 1.0, 2.0], 2, **columns)
    G, P = families.G, families.P
    assert (G.count, P.count) == (2, 3)
    assert (G.diameter_m, P.diameter_m) == (5.0, 1.5)
    assert (G.height_m, P.height_m) == (7.5, 2.5)
    assert (G.peak_height_m, P.peak_height_m) == (100.5, 1.0)
    assert G.radius_m == pytest.approx(3.5**2)
    # pooled: squares 0.5 + 2 of the peaks, 24.5 of the radii, three degrees of freedom
    assert G.peak_height_se_m == pytest.approx(np.sqrt(2.5 / 3 / 2))
    assert P.peak_height_se_m == pytest.approx(np.sqrt(2.5 / 3 / 3))
    assert P.radius_se_m == pytest.approx(np.sqrt(24.5 / 3 / 3))
    assert families.h_se_m == pytest.approx(np.sqrt(2.5 / 3 * (1 / 2 + 1 / 3)))


def test_the_separation_is_in_pooled_spreads():
    # squares 2 + 2, six numbers less two means: a spread of one
    assert cluster(np.array([0.0, 1, 2, 10, 11, 12])).separation[1] == pytest.approx(10.0)
    narrow = cluster(np.array([0.0, 1e-4, 1.0, 1.0 + 1e-4]))
    assert narrow.separation[1] == pytest.approx(1.0 / np.sqrt(0.5e-8), rel=1e-6)
    three = cluster(np.array([0.0, 1, 2, 10, 11, 12, 30, 31, 32]))
    assert three.separation[2] == pytest.approx(10.0)
    assert np.isnan(three.separation[0])


def test_the_evidence_of_two_is_the_integral_that_it_stands_for():
    """Two normal clusters of one width, their means and it integrated out by brute force."""
    z = np.array([0.0, 0.2, 0.9, 1.0])
    log_sigma, step = np.linspace(-12.0, 12.0, 4001, retstep=True)
    sigma = np.exp(log_sigma)
    total = 0.0
    for size in (1, 2, 3):
        parts = z[:size], z[size:]
        members = math.comb(4, size) * 3 / 2  # which are in it; three sizes; no names
        for ratio, odds in ((50.0, 4 / 7), (5e3, 2 / 7), (5e5, 1 / 7)):
            # given the middle of the means, each cluster is normal with a common shift
            covariance = np.zeros((4, 4))
            for at, part in ((0, parts[0]), (size, parts[1])):
                covariance[at : at + len(part), at : at + len(part)] = ratio
            covariance += np.eye(4)
            inverse = np.linalg.inv(covariance)
            one = np.ones(4)
            # a flat prior of the middle integrates to this
            within = z @ inverse @ z - (one @ inverse @ z) ** 2 / (one @ inverse @ one)
            scale = (2 * np.pi) ** -1.5 / np.sqrt(np.linalg.det(covariance) * (one @ inverse @ one))
            density = scale * sigma**-3.0 * np.exp(-0.5 * within / sigma**2)
            total += odds / members * density.sum() * step
    assert cluster(z).log_evidence[1] == pytest.approx(math.log(total), abs=1e-4)


def test_three_clusters_among_many_numbers_are_cut_where_they_part():
    parts = [np.linspace(level, level + 1.0, n) for level, n in ((0.0, 33), (5.0, 27), (12.0, 40))]
    assert cluster(np.concatenate(parts)).sizes[2].tolist() == [33, 27, 40]


def evidence_by_covariance(z, sizes):
    """Take the numbers as one normal vector: within a cluster they share a part of their variance.

    Place and width integrated out; the sizes at equal odds, any member in any cluster.
    """
    n, count = len(z), len(sizes)
    of = np.repeat(np.arange(count), sizes)
    one, total = np.ones(n), 0.0
    for ratio, odds in ((50.0, 4 / 7), (5e3, 2 / 7), (5e5, 1 / 7)):
        V = np.eye(n) + ratio * (of[:, None] == of)
        inverse = np.linalg.inv(V)
        weight = one @ inverse @ one
        rest = z @ inverse @ z - (one @ inverse @ z) ** 2 / weight
        scale = math.gamma((n - 1) / 2) / 2 / math.sqrt(np.linalg.det(V) * weight)
        total += odds * scale * (math.pi * rest) ** (-(n - 1) / 2)
    members = math.factorial(n) / math.prod(math.factorial(size) for size in sizes)
    return total * math.factorial(count) / math.comb(n - 1, count - 1) / members


def test_the_evidence_of_clusters_is_that_of_their_covariance():
    z = np.array([0.0, 0.1, 0.35, 0.4, 0.75, 1.0])
    found = cluster(2.0 * z - 3.0)
    for count in (3, 4):
        expected = evidence_by_covariance(z, found.sizes[count - 1])
        assert found.log_evidence[count - 1] == pytest.approx(math.log(expected), rel=1e-6)
    two = sum(evidence_by_covariance(z, (i, 6 - i)) for i in range(1, 6))
    assert found.log_evidence[1] == pytest.approx(math.log(two), rel=1e-6)
    # the least distance of neighbouring means over the pooled spread
    low, high = z[: found.sizes[1][0]], z[found.sizes[1][0] :]
    pooled = ((low - low.mean()) ** 2).sum() + ((high - high.mean()) ** 2).sum()
    apart = (high.mean() - low.mean()) / math.sqrt(pooled / 4)
    assert found.separation[1] == pytest.approx(apart, rel=1e-9)
    assert math.isnan(found.separation[0])


@pytest.mark.parametrize("factor", [1e-170, 1e-9, 1e150])
def test_numbers_around_zero_and_of_any_size_are_split_alike(factor):
    values = np.array([-1.0, -0.9, -0.77, 0.75, 0.93, 1.0])
    here, there = cluster(values + 1.0), cluster(factor * values)
    assert [sizes.tolist() for sizes in there.sizes] == [sizes.tolist() for sizes in here.sizes]
    assert there.log_evidence == pytest.approx(here.log_evidence, rel=1e-6)
    assert there.separation[1:] == pytest.approx(here.separation[1:], rel=1e-6)


STRAYS = (5.0, 5.6, 6.1)  # spread twice as far as two families below them are apart


def test_two_families_below_spread_peaks_are_told_apart_by_their_own_width():
    rng = np.random.default_rng(3)
    low = np.sort(rng.normal(0.0, 0.005, 10)), np.sort(rng.normal(0.24, 0.005, 5))
    found = cluster(np.concatenate((*low, STRAYS)))
    assert found.sizes[1].tolist() == [15, 3]
    assert found.sizes[2].tolist() == [10, 5, 3]
    inside = cluster(np.concatenate(low))
    gain = inside.log_evidence[1] - inside.log_evidence[0] - math.log(2.0)
    assert found.log_evidence[2] - found.log_evidence[1] == pytest.approx(gain)
    assert found.separation[2] == pytest.approx(min(found.separation[1], inside.separation[1]))
    assert _supported(found, False)[0] == 3
    upside_down = cluster(-np.concatenate((*low, STRAYS))[::-1])
    assert upside_down.sizes[2].tolist() == [3, 5, 10]
    assert upside_down.log_evidence == pytest.approx(found.log_evidence)


@pytest.mark.parametrize("scatter", [0.1, 1e-2, 1e-5])
def test_one_family_below_spread_peaks_is_hardly_ever_two(scatter):
    """Odds of 20 to 1 are wrong once in twenty at most."""
    rng = np.random.default_rng(3)
    low = [np.sort(rng.normal(0.0, scatter, 15)) for _ in range(100)]
    splits = [cluster(np.append(one, STRAYS)).sizes[2] for one in low]
    assert sum(sizes[-1] == 3 for sizes in splits) <= 5


@pytest.mark.parametrize(("step", "low"), [(1e-12, [15]), (0.24, [10, 5])])
def test_what_rounding_tells_apart_is_no_family(step, low):
    found = cluster(np.array([0.0] * 10 + [step] * 4 + [1.01 * step, *STRAYS]))
    assert [*found.sizes[2]][: len(low)] == low


@pytest.mark.parametrize("values", [[], [1.0], [2.0, 2.0, 2.0]])
def test_equal_numbers_are_one_cluster_of_no_evidence(values):
    found = cluster(np.array(values))
    assert [sizes.tolist() for sizes in found.sizes] == [[len(values)]]
    assert found.log_evidence.tolist() == [0.0]
    assert np.isnan(found.separation).tolist() == [True]


def test_more_clusters_are_cut_at_four_hundred_places_of_many_numbers():
    rng = np.random.default_rng(9)
    sizes = (400, 300, 500)
    values = [rng.normal(10.0 * i, 0.1, size) for i, size in enumerate(sizes)]
    found = cluster(np.sort(np.concatenate(values)))
    assert found.sizes[2] == pytest.approx(sizes, abs=3)
    assert found.sizes[2].sum() == 1200
    assert (found.sizes[2] % 3 == 0).all()


@pytest.mark.parametrize(
    ("changes", "clear"),
    [
        ({"separation": 5.0, "log_odds": 3.0}, True),
        ({"separation": 4.999, "log_odds": 3.0}, False),
        ({"separation": 5.0, "log_odds": 2.999}, False),
        ({"separation": None, "log_odds": 9.0}, False),
        ({"separation": 9.0, "log_odds": None}, False),
        ({"P": None, "separation": 1.0, "log_odds": 3.0}, False),  # two levels, one was taken
        ({"P": None, "levels": (None,), "separation": 1.0, "log_odds": 3.0}, True),
        ({"P": None, "levels": (None,), "separation": 1.0, "log_odds": 2.9}, False),
        ({"P": None, "levels": (None,), "log_odds": None}, True),
        ({"P": None, "levels": (None,), "log_odds": -9.0, "alike": True}, True),
        ({"levels": (None,), "log_odds": -9.0, "alike": True}, False),
    ],
)
def test_families_are_clear_at_five_spreads_and_odds_of_twenty(changes, clear):
    two = families_of([0.0, 0.1, 0.2, 5.0, 5.1, 5.2])
    assert two.count == 2
    assert replace(two, **changes).clear == clear


@pytest.mark.parametrize(
    ("log_evidence", "separation", "expected"),
    [
        ([0.0, 1.0], [np.nan, 4.0], (2, 1.0)),
        ([0.0, 1.0], [np.nan, 3.99], (1, -1.0)),
        ([1.0, 1.0], [np.nan, 9.0], (1, 0.0)),
        ([0.0, 1.0, 4.0], [np.nan, 9.0, 5.0], (3, 3.0)),
        ([0.0, 1.0, 3.99], [np.nan, 9.0, 5.0], (2, pytest.approx(-2.99))),
        ([0.0, 1.0, 9.0], [np.nan, 9.0, 4.99], (2, 1.0)),
        ([0.0, 1.0, 4.0, 8.0], [np.nan, 9.0, 5.0, 5.0], (4, 4.0)),
        ([0.0, 1.0, 4.0, 6.0], [np.nan, 9.0, 5.0, 5.0], (3, -2.0)),
        ([0.0, 1.0, 4.0, 8.0], [np.nan, 9.0, 2.0, 5.0], (4, 7.0)),
    ],
)
def test_the_number_supported_at_its_thresholds(log_evidence, separation, expected):
    found = Clusters((), np.array(log_evidence), np.array(separation))
    assert _supported(found, False) == expected
    assert _supported(found, True) == (1, log_evidence[0] - log_evidence[1])


@pytest.mark.parametrize("h_m", [0.0, 3e-7])
def test_the_slope_of_families_is_that_of_their_plane(h_m):
    """Nine caps of one family, or four of them lower, on a plane that is no level."""
    rng = np.random.default_rng(4)
    x_m, y_m = rng.uniform(0.0, 0.06, 9), rng.uniform(0.0, 0.04, 9)
    peak_m = 3e-5 * x_m - 7e-5 * y_m - h_m * (np.arange(9) % 2) + 1e-10 * rng.standard_normal(9)
    caps = table(peak_m, x_m=x_m, y_m=y_m, peak_height_se_m=np.full(9, 1e-10))
    found = surface_of_families(caps, (0.03, 0.02))
    assert found.slope == pytest.approx([3e-5, -7e-5], abs=2e-8)
    assert not found.bow.any()
    assert found.count == (2 if h_m else 1)
    flags = np.where(np.arange(9) < 4, 0, CapFlag.not_convex).astype(np.uint16)
    few = surface_of_families(caps.with_columns(flags=flags), (0.03, 0.02))
    assert (few.slope.tolist(), few.bow.tolist(), few.count) == ([0.0, 0.0], [0.0, 0.0, 0.0], 1)


def test_the_slope_of_families_is_not_that_of_caps_without_apex():
    """Three of twelve caps, at the edges, are ridges whose heights are up to 1 um off."""
    rng = np.random.default_rng(4)
    x_m, y_m = rng.uniform(0.0, 0.06, 12), rng.uniform(0.0, 0.04, 12)
    x_m[:3], y_m[:3] = (0.0, 0.06, 0.06), (0.0, 0.0, 0.04)
    peak_m = -2.4e-7 * (np.arange(12) % 2) + 1e-10 * rng.standard_normal(12)
    peak_m[:3] += (-1e-6, 7e-7, 3e-7)
    flags = np.zeros(12, dtype=np.uint16)
    columns = {"x_m": x_m, "y_m": y_m, "peak_height_se_m": np.full(12, 1e-10)}
    tilted = surface_of_families(table(peak_m, flags=flags, **columns), (0.0, 0.0))
    flags[:3] = CapFlag.edge | CapFlag.ridge
    caps = table(peak_m, flags=flags, **columns)
    found = surface_of_families(caps, (0.0, 0.0))
    assert np.abs(found.slope).max() < 2e-8
    assert found.count == 2
    assert np.abs(tilted.slope).max() > 1e-6
    # Families of all twelve are not those of the nine
    for known in (tilted, found):
        assert (
            group_families(caps, own_plane=True, known=known)[1]
            == group_families(caps, own_plane=True)[1]
        )


def test_families_on_a_known_surface_are_those_that_find_it():
    """Wherever the coordinates of that surface begin."""
    rng = np.random.default_rng(4)
    x_m, y_m = rng.uniform(0.0, 0.06, 15), rng.uniform(0.0, 0.04, 15)
    peak_m = 3e-5 * x_m - 2.4e-7 * (np.arange(15) % 3 > 0) + 1e-9 * rng.standard_normal(15)
    caps = table(peak_m, x_m=x_m, y_m=y_m, peak_height_se_m=np.full(15, 1e-9))
    known = surface_of_families(caps, (0.03, 0.02))
    (one, on_known), (other, anew) = (
        group_families(caps, own_plane=True, known=surface) for surface in (known, None)
    )
    assert (on_known.m, on_known.n, one.family.tolist()) == (5, 10, other.family.tolist())
    assert on_known.h_m == pytest.approx(anew.h_m, rel=1e-9)
    assert on_known.log_odds == pytest.approx(anew.log_odds, rel=1e-9)


def test_the_slope_of_families_is_not_that_of_a_few_spread_peaks():
    rng = np.random.default_rng(4)
    x_m, y_m = rng.uniform(0.0, 0.06, 26), rng.uniform(0.0, 0.04, 26)
    peak_m = 3e-6 * x_m - 7e-6 * y_m + 1e-9 * rng.standard_normal(26)
    peak_m += np.repeat((1e-6, 1.1e-6, 1.2e-6, 2.4e-7, 0.0), (1, 1, 1, 5, 18))
    found = surface_of_families(table(peak_m, x_m=x_m, y_m=y_m), (0.0, 0.0))
    assert found.slope == pytest.approx([3e-6, -7e-6], abs=1e-7)  # 1 nm over 23 caps: 2e-8
    assert found.count == 3


@pytest.mark.parametrize(("n", "turns"), [(4, False), (5, True), (12, True)])
def test_peaks_are_levels_on_their_own_plane_from_five_caps_on(n, turns):
    rng = np.random.default_rng(8)
    x_m, y_m = rng.uniform(0.0, 0.06, n), rng.uniform(0.0, 0.04, n)
    caps = table(4e-5 * x_m - 6e-5 * y_m, x_m=x_m, y_m=y_m)
    grouped, families = group_families(caps, 1, own_plane=True)
    # over the plane of one family all peaks are as high as their mean
    same = (families.G.peak_height_se_m or 0.0) < 1e-12
    assert same == turns
    assert grouped.peak_height_m.tolist() == caps.peak_height_m.tolist()
    assert group_families(caps, 1)[1].G.peak_height_se_m > 1e-8
    assert group_families(caps, 1, "radius", own_plane=True)[1].G.peak_height_se_m > 1e-8


@pytest.mark.parametrize(("gap", "clear"), [(0.2, True), (0.6, False)])
def test_one_family_with_a_gap_as_wide_as_between_two_is_no_clear_one(gap, clear):
    """Two halves of uniform heights; of a width w each and a gap g they split by (1 + g / w)."""
    half = np.linspace(0.0, 1.0, 10)
    spreads = (1.0 + gap) / half.std(ddof=1)
    families = families_of(np.concatenate((half, 1.0 + gap + half)))
    one = replace(families, G=families.levels[0], P=None, levels=families.levels[:1], log_odds=5.0)
    assert families.separation == pytest.approx(spreads, rel=0.1)
    assert one.clear == clear


@pytest.mark.parametrize(("error_m", "clear"), [(1e-8, True), (1e-7, False)])
def test_two_heights_within_the_errors_of_their_fits_are_not_clear(error_m, clear):
    """Three peaks that hardly fit a sphere, and five that do, 0.1 um below, each level exact."""
    heights = np.repeat((0.0, -1e-7), (3, 5))
    errors = np.repeat((error_m, 1e-16), (3, 5))
    families = families_of(heights, peak_height_se_m=errors)
    assert (families.m, families.n) == (3, 5)
    assert families.h_fit_se_m == pytest.approx(error_m / math.sqrt(3.0))
    assert families.clear == clear
