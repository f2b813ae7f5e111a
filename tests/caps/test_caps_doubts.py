"""Doubts about hills, caps and families: seen where they should be, and rarely by chance."""

import math
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.caps import doubts
from capslip.caps.doubts import (
    bow_of_peaks,
    leaves_peaks,
    plane_of,
    problems_of_bow,
    problems_of_caps,
    problems_of_families,
    without_bow,
)
from capslip.caps.families import group_families
from capslip.caps.fit import fit_caps
from capslip.caps.hills import NOISE_FACTOR, find_hills
from capslip.caps.pruning import TOO_SMALL
from capslip.caps.table import DOUBTFUL, UNUSABLE, CapFlag, CapTable
from capslip.surface.heightmap import HeightMap
from capslip.surface.seams import Seams, find_seams
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


def test_peaks_are_not_asked_for_a_bow_after_a_form_that_took_bows_off():
    """On a floor that is level they keep theirs: it is the face's own."""
    bowed = peaks(np.random.default_rng(5), 1e-10, 8e-8)
    level = HeightMap(np.zeros((40, 60)), (1e-3, 1e-3))
    for taken_off, keeps in ((1, False), (2, True)):
        less = without_bow(bowed, level, bowed, taken_off)[0]
        moved_m = np.ptp(less.peak_height_m - bowed.peak_height_m)
        assert (moved_m < 1e-9) == keeps


@pytest.mark.long
def test_scatter_alone_is_rarely_called_a_bow():
    rng = np.random.default_rng(1)
    # A test at 1 %: 5 of 500 expected, standard deviation 2.2
    assert sum(says_bow(peaks(rng, 3e-8)) for _ in range(500)) <= 13


def test_a_tilt_or_two_families_are_no_bow():
    rng = np.random.default_rng(2)
    assert sum(says_bow(peaks(rng, 1e-9, slope=1e-6)) for _ in range(100)) <= 5


@pytest.mark.parametrize(("bow_m", "severity"), [(1e-8, "info"), (8e-8, "warning")])
def test_a_bow_of_any_height_is_asked_about_where_the_peaks_tell_it(bow_m, severity):
    """Below a tenth of the approach it is no warning unless the contact finds that it matters."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        (problem,) = problems_of_bow(peaks(rng, 1e-10, bow_m), APPROACH_M)
        assert (problem.code, problem.severity) == ("bow_left", severity)


def test_rounding_is_no_bow():
    rng = np.random.default_rng(4)
    one_family = group_families(caps_at(*rng.uniform(0.0, 60e-3, (2, 20)), np.full(20, 1e-6)))[0]
    y, x = np.divmod(np.arange(20.0), 5.0)
    bent = one_family.with_columns(
        x_m=x, y_m=y, peak_height_m=1e-6 + 1e-20 * x**2, family=np.full(20, "G")
    )
    for caps in (one_family, bent):
        assert problems_of_bow(caps, APPROACH_M) == []


@pytest.mark.parametrize("n", [0, 1, 3, 6])
def test_few_peaks_lie_on_any_bow(n):
    rng = np.random.default_rng(n)
    caps = caps_at(rng.uniform(size=n), rng.uniform(size=n), rng.uniform(size=n))
    assert problems_of_bow(group_families(caps)[0], APPROACH_M) == []


def test_counts_of_caps_name_their_plane_where_the_pressed_one_has_another_number():
    surface = caps_map(SIX)
    hills = replace(find_hills(surface), rejected={TOO_SMALL: 4})
    caps = fit_caps(surface, hills, "equation18")
    counted = caps.with_columns(flags=np.full(len(caps), CapFlag.ridge, np.uint16))
    fewer = caps.with_columns(flags=np.where(np.arange(6) < 5, 0, UNUSABLE).astype(np.uint16))
    assert (counted.usable.sum(), fewer.usable.sum()) == (6, 5)
    assert plane_of(counted, counted) == ""
    on = plane_of(counted, fewer)
    of = {
        one.code: one.message
        for one in (
            *problems_of_caps(surface, hills, counted, 0.1, on),
            *problems_of_families(counted, group_families(counted, count=1)[1], on),
        )
    }
    assert of["caps_ridge"] == "6 of 6 caps on the families' own plane are ridges rather than caps"
    assert "4 of 10 hills on the families' own plane that stand clear" in of["hills_too_small"]
    assert "the peak heights of 6 caps on the families' own plane show one" in of["one_family"]
    assert not any(
        "own plane" in one.message for one in problems_of_caps(surface, hills, caps, 0.1)
    )


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


@pytest.mark.parametrize("flag", list(doubts.MEANING))
def test_flags_of_more_than_a_fifth_of_the_caps_are_a_warning(flag):
    few = "warning" if flag is CapFlag.plateau else "info"
    many = "info" if flag in DOUBTFUL else "warning"  # the load on those is asked, not their number
    assert codes(change_caps=flagged(1, flag)) == [(f"caps_{flag.name}", few)]
    assert codes(change_caps=flagged(2, flag)) == [(f"caps_{flag.name}", many)]


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


def twenty_caps(usable=20, **columns):
    """Caps 1 high with their peaks at 3, on no map."""
    places = np.arange(20.0)
    flags = np.where(np.arange(20) < usable, 0, CapFlag.not_convex).astype(np.uint16)
    caps = caps_at(places, places**2, np.full(20, 3.0))
    return caps.with_columns(flags=flags, residual_m=np.zeros(20), **columns)


def hills_of_twenty(**changes):
    clean = {
        "n_hills": 20,
        "pruning_sensitivity": 0.0,
        "largest_hill_share": 0.0,
        "prominence_m": np.ones(20),
        "pruning_height_m": 0.0,
        "kept_fraction": 0.0,
        "noise_m": 0.0,
        "n_hills_half_pruning": 20,
        "n_hills_double_pruning": 20,
        "n_regions": 20,
        "rejected": {},
    }
    return SimpleNamespace(**(clean | changes))


def one_in(n, low, high=1.0):
    return np.where(np.arange(20) < n, low, high)


@pytest.mark.parametrize(
    ("code", "hills", "caps", "highest_m"),
    [
        (None, {"pruning_sensitivity": 0.199}, {}, 3.0),
        ("pruning_decides", {"pruning_sensitivity": 0.2}, {}, 3.0),
        (None, {"rejected": {"within_noise": 9}}, {}, 3.0),
        ("hills_too_small", {"rejected": {"too_few_points": 1}}, {}, 3.0),
        (None, {"largest_hill_share": 0.2}, {}, 3.0),
        ("connected_network", {"largest_hill_share": 0.201}, {}, 3.0),
        (None, {"largest_hill_share": 0.3}, {"usable": 10}, 3.0),  # three of ten
        ("connected_network", {"largest_hill_share": 0.301}, {"usable": 10}, 3.0),
        # a quarter of the caps, less than a tenth of their height above a saddle
        (None, {"prominence_m": one_in(20, 0.1)}, {}, 3.0),
        (None, {"prominence_m": one_in(5, 0.099)}, {}, 3.0),
        ("shallow_saddles", {"prominence_m": one_in(6, 0.099)}, {}, 3.0),
        (None, {"prominence_m": one_in(14, 1.0, 0.0)}, {"usable": 14}, 3.0),  # of the usable ones
        # a tenth of a usual cap
        (None, {"pruning_height_m": 0.1}, {}, 3.0),
        ("coarse_pruning", {"pruning_height_m": 0.101}, {}, 3.0),
        (None, {"pruning_height_m": np.inf}, {}, 3.0),  # hills are regions
        (None, {"kept_fraction": 1.5 * 0.1}, {}, 3.0),
        ("plateau_at_cut", {"kept_fraction": 0.151}, {}, 3.0),
        # a twentieth of the highest cap, and five spreads of the noise
        (None, {}, {"cap_height_m": one_in(1, 5.0)}, 3.25),
        ("highest_point_on_no_cap", {}, {"cap_height_m": one_in(1, 5.0)}, 3.251),
        (None, {"noise_m": 0.01}, {}, 3.0 + 0.05 + 0.01 * NOISE_FACTOR - 1e-9),
        ("highest_point_on_no_cap", {"noise_m": 0.01}, {}, 3.0 + 0.0501 + 0.01 * NOISE_FACTOR),
        # half of the caps deviate by a quarter of the fitted depth
        (None, {}, {"residual_m": np.full(20, 0.25)}, 3.0),
        ("not_spherical", {}, {"residual_m": one_in(11, 0.251, 0.0)}, 3.0),
        (None, {}, {"residual_m": np.full(20, 0.3), "fit_depth_m": np.full(20, 2.0)}, 3.0),
        ("not_spherical", {}, {"residual_m": np.full(20, 0.3), "fit_depth_m": np.zeros(20)}, 3.0),
        (None, {}, {"residual_m": np.full(20, 0.3), "fit_depth_m": np.zeros(20),
                    "cap_height_m": np.full(20, 2.0)}, 3.0),
    ],
)  # fmt: skip
def test_a_doubt_about_caps_is_raised_just_beyond_its_threshold(code, hills, caps, highest_m):
    columns = dict(caps)
    table = twenty_caps(columns.pop("usable", 20)).with_columns(**columns)
    height_m = np.zeros((3, 3))
    height_m[1, 1] = highest_m
    face = HeightMap(height_m, (1.0, 1.0))
    found = problems_of_caps(face, hills_of_twenty(**hills), table, 0.1)
    assert [problem.code for problem in found] == ([] if code is None else [code])


@pytest.mark.parametrize(("n", "severity"), [(1, "info"), (2, "warning")])
def test_more_than_a_tenth_of_hills_of_too_few_points_are_a_warning(n, severity):
    hills = hills_of_twenty(rejected={"too_few_points": n})
    face = HeightMap(np.full((3, 3), 3.0), (1.0, 1.0))
    (found,) = problems_of_caps(face, hills, twenty_caps(10), 0.1)
    assert found.severity == severity
    assert found.message.startswith(f"{n} of {20 + n} hills")


@pytest.mark.parametrize("n", [4, 5])
def test_a_fifth_of_flagged_caps_is_a_note_and_more_a_warning(n):
    flags = np.where(np.arange(20) < n, CapFlag.ridge, 0).astype(np.uint16)
    flags[-1] = CapFlag.ridge | CapFlag.not_convex  # of which nothing is made, nor said
    found = problems_of_caps(
        HeightMap(np.full((3, 3), 3.0), (1.0, 1.0)),
        hills_of_twenty(),
        twenty_caps().with_columns(flags=flags),
        0.1,
    )
    share = n / 19
    assert [p.severity for p in found] == ["warning" if share > 0.2 else "info"]
    assert found[0].message.startswith(f"{n} of 19 caps")


@pytest.mark.parametrize(("n", "families"), [(7, 1), (12, 1), (8, 2), (20, 2)])
@pytest.mark.parametrize("scale", [1e-5, 1.0])
def test_a_bow_has_its_height_in_any_direction_and_unit(n, families, scale):
    x, y = np.random.default_rng(5).uniform(-1.0, 1.0, (2, n))
    u, v = x - x.mean(), y - y.mean()  # a bow off the middle tilts the plane, too
    of = np.arange(n) % families
    for bow_m in (u * u, u * v, -v * v):
        caps = caps_at(scale * x, scale * y, 7.0 - 3.0 * of + 0.3 * x + bow_m)
        found_m, chance = bow_of_peaks(caps.with_columns(family=np.array(["G", "P"])[of]))
        assert found_m == pytest.approx(np.ptp(bow_m), rel=1e-6)
        assert chance < 1e-6


def two_fields(step_m):
    """Return a face of 60 mm x 40 mm whose half on the right lies higher."""
    surface = HeightMap(np.zeros((40, 60)), (1e-3, 1e-3))
    offset_m = np.array([[-0.5, 0.5]]) * step_m
    return Seams(surface, np.array([0, 40]), np.array([0, 30, 60]), offset_m)


@pytest.mark.parametrize("slope", [0.0, 1e-5, -4e-6])
@pytest.mark.parametrize("spread_m", [0.0, 1e-8])
@pytest.mark.parametrize("step_m", [9e-8, 1e-6, -1e-4])
def test_peaks_tell_whose_step_a_seam_has_however_the_face_lies(step_m, spread_m, slope):
    """A floor that is stepped leaves them on their levels, fields that were stitched do not."""
    rng = np.random.default_rng(3)
    for h_m in (0.0, 2e-7):
        own = peaks(rng, spread_m, slope=slope, h_m=h_m)
        taken_m = own.peak_height_m + step_m * (own.x_m > 30e-3)
        assert leaves_peaks(two_fields(step_m), own)
        assert not leaves_peaks(two_fields(step_m), own.with_columns(peak_height_m=taken_m))


@pytest.mark.parametrize("lost", [0.0, 0.05])
@pytest.mark.parametrize("step_m", [1e-7, 1e-5])
def test_a_floor_that_is_stepped_between_equal_tops_is_no_stitched_map(step_m, lost):
    """Caps of one height on both sides, found on the map as its seam is: fields took none along."""
    row, column = np.mgrid[:120, :200]
    caps_m = np.maximum(2e-6 - 4e-8 * ((row % 30 - 15) ** 2 + (column % 40 - 20) ** 2), 0.0)
    right = column >= 110
    floor_m = np.where(caps_m > 0.0, caps_m, -step_m * right)
    noise_m = np.random.default_rng(8).normal(0.0, 1e-9, caps_m.shape)
    missing = np.random.default_rng(5).random(caps_m.shape) < lost
    for height_m, expected in ((floor_m, True), (caps_m + step_m * right, False)):
        surface = HeightMap(np.where(missing, np.nan, height_m + noise_m), (1e-4, 1e-4))
        seams = find_seams(surface)
        assert seams.columns.tolist() == [0, 110, 200]
        caps = fit_caps(surface, find_hills(surface, 0.2), "least_squares")
        assert leaves_peaks(seams, caps) == expected


@pytest.mark.long
def test_peaks_that_scatter_more_than_a_seam_or_stand_on_one_side_do_not_tell():
    rng = np.random.default_rng(4)
    told = [leaves_peaks(two_fields(9e-8), peaks(rng, 2e-7)) for _ in range(50)]
    assert sum(told) <= 1
    own = peaks(rng, 1e-8)
    aside = own.with_columns(x_m=0.5 * own.x_m)
    assert not leaves_peaks(two_fields(9e-8), aside)
    on_both = np.where(np.arange(20) < 3, 0, CapFlag.not_convex).astype(np.uint16)
    assert not leaves_peaks(two_fields(9e-8), own.with_columns(flags=on_both))


def test_too_few_or_equal_peaks_lie_on_no_bow():
    rng = np.random.default_rng(6)
    six = caps_at(*rng.uniform(size=(3, 6))).with_columns(family=np.full(6, "G"))
    assert bow_of_peaks(six) == (0.0, 1.0)
    equal = caps_at(*rng.uniform(size=(2, 9)), np.zeros(9)).with_columns(family=np.full(9, "G"))
    assert bow_of_peaks(equal) == (0.0, 0.0)


@pytest.mark.long
def test_the_chance_of_a_bow_is_that_of_the_f_distribution():
    """Without a bow, one in ten sets of peaks has a chance below a tenth."""
    rng = np.random.default_rng(7)
    chances = [bow_of_peaks(peaks(rng, 1e-8))[1] for _ in range(300)]
    assert np.quantile(chances, [0.1, 0.5, 0.9]) == pytest.approx([0.1, 0.5, 0.9], abs=0.08)


@pytest.mark.parametrize(
    ("bow_m", "chance", "says"),
    [(1.0, 0.0, ["info"]), (1.001, 0.0, ["warning"]), (2.0, 0.01, ["warning"]), (2.0, 0.0101, [])],
)
def test_a_bow_is_said_just_beyond_its_thresholds(bow_m, chance, says, monkeypatch):
    monkeypatch.setattr(doubts, "bow_of_peaks", lambda _: (bow_m, chance))
    assert [one.severity for one in problems_of_bow(twenty_caps(), 10.0)] == says


@pytest.mark.parametrize(
    ("log_odds", "text"), [(None, "are 1 to 1"), (2.0, "are 7.4 to 1"), (60.0, "are 5.2e+21 to 1")]
)
def test_the_odds_of_the_families_are_told(log_odds, text):
    x_m = np.linspace(0.0, 1e-2, 6)
    caps, families = group_families(caps_at(x_m, x_m, np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])))
    unclear = replace(families, log_odds=log_odds, separation=4.5)
    (found,) = problems_of_families(caps, unclear)
    assert found.code == "families_doubtful"
    assert text in found.message
    assert found.message.startswith("6 caps")
    assert "4.5 spreads" in found.message


def test_an_apex_that_noise_or_a_misfit_leaves_uncertain_is_not_called_low():
    """High caps that are no spheres have the flag as low ones under noise do."""
    caps = caps_at(*(np.arange(4.0) for _ in range(3)))
    caps = caps.with_columns(flags=np.array([CapFlag.noisy_apex] * 3 + [0], np.uint16))
    (found,) = doubts._flagged(caps)
    assert found.code == "caps_noisy_apex"
    for text in (found.message, found.kind.meaning):
        assert "uncertain by more than a tenth of their height" in text
        assert "by noise, or as they are no spheres" in text
    assert found.message.startswith("3 of 4 caps have")
    assert "boundary_elements" in found.remedy
    assert "average" in found.remedy
