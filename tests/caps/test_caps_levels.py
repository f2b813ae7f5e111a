"""Families on a common plane that is found with them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from capslip.analysis import analyze_once
from capslip.caps import planes
from capslip.caps.levels import find_levels
from capslip.caps.planes import Scaled
from capslip.caps.simplex import minimum
from capslip.settings import load_settings
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Scene, synthetic_surface

H_M = 2.4e-7


def peaks(seed, m, n, scatter_m):
    """Return m caps of a family and n of one h below it, on a face of 60 mm x 40 mm."""
    rng = np.random.default_rng(seed)
    x_m, y_m = rng.uniform(0.0, 0.06, m + n), rng.uniform(0.0, 0.04, m + n)
    height_m = np.where(np.arange(m + n) < m, H_M, 0.0)
    return x_m, y_m, height_m + scatter_m * rng.standard_normal(m + n)


def two_found(levels):
    """Return whether two families are likelier than one, and apart."""
    clusters = levels.clusters
    odds = clusters.log_evidence[1] - clusters.log_evidence[0]
    return len(clusters.sizes) > 1 and odds > 0.0 and clusters.separation[1] >= 4.0


def h_of(levels):
    size = levels.clusters.sizes[1]
    sorted_m = np.sort(levels.heights_m(2))
    return sorted_m[size[0] :].mean() - sorted_m[: size[0]].mean()


@pytest.mark.parametrize(("m", "n"), [(5, 18), (2, 9), (10, 50), (20, 20), (100, 400)])
def test_two_families_are_found_under_a_tilt_much_larger_than_h(m, n):
    x_m, y_m, height_m = peaks(3, m, n, 0.05 * H_M)
    slope = np.array([2e-4, -5e-4])  # 12 and 20 um over the face
    levels = find_levels(x_m, y_m, height_m + slope[0] * x_m + slope[1] * y_m)
    assert two_found(levels)
    assert levels.clusters.sizes[1].tolist() == [n, m]
    error = 0.05 * H_M / np.sqrt(m + n) / (0.04 / np.sqrt(12))  # of the slope along y
    assert levels.slope[1] == pytest.approx(slope, abs=4 * error)
    assert h_of(levels) == pytest.approx(H_M, rel=0.1)


@pytest.mark.parametrize("stray_m", [1e-6, 5e-6])
@pytest.mark.parametrize("seed", range(4))
def test_families_below_a_few_spread_peaks_keep_their_plane(seed, stray_m):
    """Three peaks that differ by a tenth of their height take the plane of two families along."""
    x_m, y_m, height_m = peaks(seed, 8, 18, 0.01 * H_M)
    height_m[:3] += stray_m * np.array([1.0, 1.1, 1.2])
    slope = np.array([3e-6, -2e-6])
    levels = find_levels(x_m, y_m, height_m + slope[0] * x_m + slope[1] * y_m)
    assert levels.clusters.sizes[2].tolist() == [18, 5, 3]
    odds = levels.clusters.log_evidence[2] - levels.clusters.log_evidence[:2].max()
    assert odds > 3.0
    assert levels.clusters.separation[2] > 5.0
    error = 0.01 * H_M / np.sqrt(23) / (0.04 / np.sqrt(12))  # of the slope along y
    assert levels.slope[2] == pytest.approx(slope, abs=4 * error)
    family = np.argsort(-levels.heights_m(3), kind="stable")
    assert set(family[:3]) == {0, 1, 2}
    assert set(family[3:8]) == {3, 4, 5, 6, 7}


@pytest.mark.parametrize("stray_m", [1e-6, 5e-6])
@pytest.mark.parametrize("seed", [3, 4, 10])
def test_stray_hills_are_said_to_be_a_level_of_their_own(seed, stray_m):
    """On a face of 5 G- and 18 P-caps; up to two may lie under a stray hill."""
    scene = Scene(
        shape=(200, 300),
        pixel_size_m=(2e-4, 2e-4),
        seed=seed,
        families=PAPER,
        gap_m=5e-4,
        noise_rms_m=2e-9,
    )
    scan, _ = synthetic_surface(scene)
    rng, height_m = np.random.default_rng(seed + 5), scan.height_m
    y, x = np.mgrid[:200, :300]
    top_m = height_m.max()
    for k in range(3):
        row, col = rng.integers(15, 185), rng.integers(15, 285)
        fall_m = ((y - row) ** 2 + (x - col) ** 2) / 16.0 * stray_m
        height_m = np.maximum(height_m, top_m + stray_m * (1.0 + 0.1 * k) - fall_m)
    face = analyze_once(
        replace(scan, height_m=height_m), load_settings(overrides=("contact.model=caps",))
    )
    assert "more_than_two_families" in {problem.code for problem in face.problems}
    strays, G, P = face.families.levels
    assert (strays.count, G.count) == (3, 5)
    assert P.count in (16, 17, 18)
    assert G.peak_height_m - P.peak_height_m == pytest.approx(H_M, rel=0.02)


@cache
def as_they_lie(seed):
    x_m, y_m, height_m = peaks(seed, 4, 9, 0.1 * H_M)
    return x_m, y_m, height_m, find_levels(x_m, y_m, height_m)


@pytest.mark.long
@settings(deadline=None)  # of another load on the machine
@given(
    seed=st.integers(0, 20),
    slope_x=st.floats(-1e-3, 1e-3),
    slope_y=st.floats(-1e-3, 1e-3),
    rise_m=st.floats(-1e-5, 1e-5),
)
def test_a_plane_added_to_the_heights_moves_the_slopes_and_nothing_else(
    seed, slope_x, slope_y, rise_m
):
    x_m, y_m, height_m, one = as_they_lie(seed)
    other = find_levels(x_m, y_m, height_m + slope_x * x_m + slope_y * y_m + rise_m)
    for a, b in zip(one.clusters.sizes, other.clusters.sizes, strict=True):
        assert a.tolist() == b.tolist()
    assert other.clusters.log_evidence == pytest.approx(one.clusters.log_evidence, abs=1e-5)
    assert other.slope - [slope_x, slope_y] == pytest.approx(one.slope, abs=1e-12)


def test_the_order_of_the_caps_and_the_axes_play_no_part():
    x_m, y_m, height_m = peaks(1, 5, 18, 0.1 * H_M)
    one = find_levels(x_m, y_m, height_m)
    order = np.random.default_rng(0).permutation(23)
    shuffled = find_levels(x_m[order], y_m[order], height_m[order])
    assert np.array_equal(one.clusters.log_evidence, shuffled.clusters.log_evidence)
    mirrored = find_levels(0.06 - x_m, y_m, height_m)
    transposed = find_levels(y_m, x_m, height_m)
    for other, slope in ((mirrored, one.slope[1] * [-1, 1]), (transposed, one.slope[1][::-1])):
        assert other.slope[1] == pytest.approx(slope, rel=1e-6)
        assert other.clusters.log_evidence[1] == pytest.approx(one.clusters.log_evidence[1])


def test_a_row_of_caps_along_an_edge_is_no_worse_than_the_same_face_turned():
    """The four caps that lie farthest out stand on one line, and hold no plane."""
    rng = np.random.default_rng(0)
    x_m = np.concatenate((np.linspace(0.0, 0.06, 8), rng.uniform(0.02, 0.04, 20)))
    y_m = np.concatenate((np.full(8, 0.04), rng.uniform(0.01, 0.03, 20)))
    height_m = 1e-7 * rng.standard_normal(28)
    along = find_levels(x_m, y_m, height_m).clusters.log_evidence
    cos, sin = np.cos(0.5), np.sin(0.5)
    turned = find_levels(cos * x_m - sin * y_m, sin * x_m + cos * y_m, height_m)
    assert along[0] == pytest.approx(turned.clusters.log_evidence[0])


def test_the_evidence_is_the_integral_that_it_says():
    """One family of five caps: the integral over level, slopes and width by quadrature."""
    x_m, y_m, height_m = peaks(5, 0, 5, 1.0)
    scaled = Scaled.of(np.column_stack((x_m, y_m)), height_m)
    places = np.column_stack((np.ones(5), scaled.place))
    z = scaled.z
    # With the plane integrated out: (2 pi)^-1 |P^T P|^-1/2 w^-2 exp(-rest / 2 w^2) dw / w
    w = np.geomspace(1e-3, 1e4, 200_001)
    rest = z @ z
    density = np.exp(-rest / (2 * w**2)) / (2 * np.pi * w**2)
    integral = np.trapezoid(density, np.log(w)) / np.sqrt(np.linalg.det(places.T @ places))
    found = scaled.log_evidence_of_normal
    assert found == pytest.approx(np.log(integral), abs=1e-6)


def test_families_that_cannot_be_two_are_not_asked_for_other_shapes(monkeypatch):
    """Those shapes but add to the evidence of one."""
    asked = []
    monkeypatch.setattr(planes, "minimum", lambda *of: asked.append(of) or minimum(*of))
    x_m, y_m, height_m = peaks(1, 5, 18, 1e-9)
    levels = find_levels(x_m, y_m, height_m)
    assert levels.clusters.sizes[1].tolist() == [18, 5]
    assert len(asked) == 3  # of all peaks: an edge below them, one above, and a slab
    scaled = Scaled.of(np.column_stack((x_m, y_m)), height_m)
    assert scaled.log_evidence_of_one > scaled.log_evidence_of_normal - np.log(4.0)


@pytest.mark.parametrize("shape", ["normal", "uniform", "exponential"])
def test_one_family_stays_one(shape):
    """Splits of a single family where none is: at most one in twenty, from five caps up."""
    rng = np.random.default_rng(7)
    false = 0
    for _ in range(60):
        n = int(rng.integers(8, 61))
        x_m, y_m = rng.uniform(0.0, 0.06, n), rng.uniform(0.0, 0.04, n)
        height_m = {
            "normal": rng.standard_normal(n),
            "uniform": rng.uniform(-2.0, 2.0, n),
            "exponential": -rng.exponential(1.0, n),
        }[shape]
        false += two_found(find_levels(x_m, y_m, 3e-8 * height_m + 1e-4 * x_m))
    assert false <= 3


def test_few_caps_and_caps_in_a_line_are_one_family():
    x_m, y_m, height_m = peaks(0, 2, 2, 1e-9)
    assert len(find_levels(x_m, y_m, height_m).clusters.sizes) == 1
    x_m, y_m, height_m = peaks(0, 5, 10, 1e-9)
    in_line = find_levels(x_m, 0.5 * x_m, height_m)
    assert len(in_line.clusters.sizes) == 1
    none = find_levels(x_m[:0], y_m[:0], height_m[:0])
    assert none.clusters.sizes[0].tolist() == [0]
    flat = find_levels(x_m, y_m, 3e-4 * x_m - 1e-4 * y_m)
    assert len(flat.clusters.sizes) == 1
    assert flat.slope[0] == pytest.approx([3e-4, -1e-4])


def test_caps_of_one_height_to_the_last_digit_are_one_family():
    """As steps of a coarse sensor make them: what rounding leaves of a plane is no family."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        x_m, y_m = rng.uniform(-0.02, 0.03, (2, int(rng.integers(5, 25))))
        found = find_levels(x_m, y_m, np.full(x_m.size, rng.uniform(1e-7, 1e-6)))
        assert [one.tolist() for one in found.clusters.sizes] == [[x_m.size]]
        assert np.abs(found.slope).max() < 1e-15


@settings(deadline=None)  # of another load on the machine
@given(seed=st.integers(0, 200))
def test_the_simplex_finds_what_a_linear_programme_has(seed):
    rng = np.random.default_rng(seed)
    places = np.column_stack((np.ones(30), rng.uniform(-1.0, 1.0, (30, 2))))
    places[:3, 1:] = [[-1.0, -1.0], [2.0, -1.0], [-1.0, 2.0]]  # around the origin
    height, goal = rng.standard_normal(30), np.array([1.0, 0.0, 0.0])
    found = minimum(places, height, goal, np.arange(3), 1e-13)
    known = linprog(goal, -places, -height, bounds=(None, None))
    assert goal @ found.unknowns == pytest.approx(known.fun, abs=1e-9)
    assert (found.weight >= -1e-12).all()


def bowed(x_m, y_m, rise_m):
    """Return a bow that rises so far along x, and half of it along y, from the middle."""
    return rise_m * ((x_m / 0.03 - 1.0) ** 2 + 0.5 * (y_m / 0.02 - 1.0) ** 2)


@pytest.mark.parametrize("rise_m", [5e-8, -2e-7, 6e-7])
@pytest.mark.parametrize("seed", range(4))
def test_two_families_on_a_bow_as_high_as_they_differ_are_found_with_it(seed, rise_m):
    x_m, y_m, height_m = peaks(seed, 6, 17, 0.01 * H_M)
    levels = find_levels(x_m, y_m, height_m + bowed(x_m, y_m, rise_m) + 3e-4 * x_m)
    assert two_found(levels)
    assert levels.clusters.sizes[1].tolist() == [17, 6]
    assert h_of(levels) == pytest.approx(H_M, rel=0.03)
    error_m = 0.01 * H_M
    assert levels.bow[0] == pytest.approx(rise_m / 0.03**2, abs=3 * error_m / 0.03**2)
    assert levels.bow[2] == pytest.approx(0.5 * rise_m / 0.02**2, abs=3 * error_m / 0.02**2)


@pytest.mark.parametrize(("m", "n"), [(0, 17), (0, 60), (4, 13), (6, 17)])
def test_peaks_on_planes_are_given_no_bow(m, n):
    # At odds of 150 to 1, one face in a hundred at most
    rise = [find_levels(*peaks(seed, m, n, 0.05 * H_M)).bow.any() for seed in range(60)]
    assert sum(rise) <= 1


def test_a_bow_owes_nothing_to_a_tilt():
    x_m, y_m, height_m = peaks(7, 6, 17, 0.02 * H_M)
    height_m = height_m + bowed(x_m, y_m, 3e-7)
    one, other = (find_levels(x_m, y_m, height_m + tilt * y_m) for tilt in (0.0, 5e-4))
    assert other.bow == pytest.approx(one.bow, rel=1e-6)
    assert other.slope[1] - one.slope[1] == pytest.approx([0.0, 5e-4], abs=1e-9)


@pytest.mark.parametrize(("across", "lower"), [(4, 0), (4, 1), (4, 2), (6, 0), (6, 1)])
def test_rounding_does_not_choose_among_levels_of_three_rows(across, lower):
    """One row of three may be lower, or the plane tilted, or bent: any of these is exact."""
    row, col = np.divmod(np.arange(3 * across), across)
    x_m, y_m, height_m = 0.012 * col, 0.016 * row, np.where(row == lower, -1e-7, 0.0)
    rng, slopes = np.random.default_rng(2), []
    for scale in (0.0, *np.full(20, 1e-22)):
        levels = find_levels(x_m, y_m, height_m + scale * rng.standard_normal(3 * across))
        assert np.ptp(levels.heights_m(2)[row == lower]) < 1e-20
        assert not levels.bow.any()
        slopes.append(levels.slope[1])
    assert np.ptp(slopes, axis=0).max() < 1e-17
    if across == 4:  # all planes through three caps are tried: the least turn counts
        assert np.abs(slopes).max() < 1e-17


def test_few_peaks_are_given_no_bow():
    x_m, y_m, height_m = peaks(1, 3, 8, 0.01 * H_M)
    assert not find_levels(x_m, y_m, height_m + bowed(x_m, y_m, 1e-7)).bow.any()


def test_the_evidence_of_heights_is_a_density_of_metres():
    """Heights that are c times as large are c^(n - 3) times less dense, beside any plane."""
    rng = np.random.default_rng(7)
    x_m, y_m = rng.uniform(0.0, 0.06, 20), rng.uniform(0.0, 0.04, 20)
    height_m = 2e-7 * (np.arange(20) < 6) + 1e-8 * rng.standard_normal(20)
    one = find_levels(x_m, y_m, height_m).log_evidence
    more = find_levels(x_m, y_m, 30.0 * height_m + 1e-4 * x_m).log_evidence
    assert one - more == pytest.approx(17 * np.log(30.0), abs=1e-6)
    assert find_levels(x_m, y_m, 1e-4 * x_m - 2e-5 * y_m).log_evidence == np.inf
    assert find_levels(x_m[:4], y_m[:4], height_m[:4]).log_evidence == np.inf
