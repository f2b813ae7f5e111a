"""What the model in use does not read of hills, caps and families is no warning."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.caps.table import UNUSABLE, CapFlag, CapTable
from capslip.contact.relevance import as_read, still_doubtful
from capslip.contact.rung import ModelError
from capslip.problems import Problem
from capslip.surface.heightmap import HeightMap

SHAPE = ["connected_network", "shallow_saddles", "pruning_decides", "not_spherical"]
SHAPE += ["contact_under_resolved", "caps_ridge"]
COUNTS = ["families_doubtful", "more_than_two_families", "family_below_cut", "hills_too_small"]
ELSE = ["highest_point_on_no_cap", "plateau_at_cut", "cut_too_high", "level_not_settled"]
ELSE += ["no_caps", "fit_not_settled"]
OTHERS = ["outliers", "spikes", "hole_may_hide_hills", "clipped"]


def waves(y_m, x_m):
    """Return a map of 64 x 64 points with a wave of such lengths along each axis."""
    at = np.arange(64)
    height_m = np.cos(2.0 * np.pi * at / (y_m / 4e-5))[:, None] + np.cos(
        2.0 * np.pi * at / (x_m / 2e-6)
    )
    return HeightMap(1e-7 * height_m, (4e-5, 2e-6))


FLAT = HeightMap(np.zeros((9, 9)), (1e-6, 1e-6))


def caps(share, flag):
    """Return ten caps, of which the flagged first one carries that share of the load."""
    every = {field.name: np.ones(10) for field in fields(CapTable)}
    load_N = np.append(share, np.full(9, (1.0 - share) / 9.0))
    flags = np.where(np.arange(10) == 0, flag, 0).astype(np.uint16)
    return CapTable(**{**every, "load_N": load_N, "flags": flags})


def state(made_from="spheres", error=0.01, reads_families=False):
    one = SimpleNamespace(made_from=made_from, reads_families=reads_families)
    errors = ModelError.of_either(error)
    return SimpleNamespace(rung=one, estimated_error=error, errors=errors)


def warned(codes, made_from="spheres", error=0.01, share=0.0, flag=CapFlag.edge, families=False):
    """Return the codes that stay warnings."""
    contact = state(made_from, error, families)
    problems = [Problem(code, "warning", "") for code in codes]
    found = as_read(problems, contact, caps(share, flag), 0.05, FLAT)
    assert [problem.code for problem in found] == codes
    return [problem.code for problem in found if problem.severity == "warning"]


@pytest.mark.parametrize("made_from", ["map", "nothing"])
def test_a_model_without_caps_reads_none(made_from):
    flagged = [f"caps_{flag.name}" for flag in (CapFlag.ridge, CapFlag.outlier)]
    assert warned(SHAPE + COUNTS + flagged, made_from, share=1.0) == []
    assert warned(ELSE, made_from) == []
    assert warned(OTHERS, made_from) == OTHERS


@pytest.mark.parametrize(
    ("made_from", "tilt_rad", "read"),
    [("map", 0.4e-3, False), ("map", 0.6e-3, True), ("spheres", 0.0, True)],
)
def test_hills_that_tip_over_matter_where_the_map_turns_by_half_their_height(
    made_from, tilt_rad, read
):
    """Ten caps of 1 m height, 1000 m from the load point along y."""
    contact = state(made_from)
    contact.tilt_rad, contact.load_point_m = (0.0, tilt_rad), (1.0, -999.0)
    given = [Problem("tips_over", "warning", "")]
    (problem,) = as_read(given, contact, caps(0.0, CapFlag.edge), 0.05, FLAT)
    assert problem.severity == ("warning" if read else "info")


@pytest.mark.parametrize("usable", [True, False])
@pytest.mark.parametrize(("tilt_rad", "read"), [(0.9e-3, False), (1.1e-3, True)])
def test_hills_of_waves_stand_higher_than_their_cut_shows(usable, tilt_rad, read):
    """The same caps, whose peaks stand 2 m over the middle of their map, counted as caps or not."""
    contact = state("map")
    contact.tilt_rad, contact.load_point_m = (0.0, tilt_rad), (1.0, -999.0)
    given = [Problem("tips_over", "warning", "")]
    few = caps(0.0, CapFlag.edge)
    few = few.with_columns(
        flags=np.where(np.arange(10) < usable, 0, int(UNUSABLE)).astype(np.uint16)
    )
    surface = HeightMap(np.full((9, 9), -1.0), (1e-6, 1e-6))
    (problem,) = as_read(given, contact, few, 0.05, surface)
    assert (problem.severity == "warning") == read


def test_what_the_cut_left_out_matters_to_a_model_of_caps():
    assert warned(ELSE) == ELSE


def test_the_estimated_error_counts_the_shape_of_the_hills():
    hills = SHAPE[:-1]
    assert warned(hills, error=0.01) == []
    assert warned(hills, error=0.051) == hills
    assert warned(hills, error=None) == hills
    assert warned(OTHERS, error=0.01) == OTHERS


@pytest.mark.parametrize(
    ("stiffness", "at_a_quarter", "doubted"),
    [(0.02, 0.04, False), (0.02, 0.06, True), (0.06, 0.04, True)],
)
def test_the_shape_is_counted_where_the_error_is_small_at_the_forces_asked_for(
    stiffness, at_a_quarter, doubted
):
    errors = ModelError(stiffness, 0.2, ((0.1, 0.2), (0.25, at_a_quarter)))
    contact = state(error=0.2)
    contact.errors = errors
    given = [Problem("not_spherical", "warning", "")]
    (found,) = as_read(given, contact, caps(0.0, CapFlag.edge), 0.05, FLAT)
    assert (found.severity == "warning") == doubted


@pytest.mark.parametrize(
    ("error", "surface", "doubted"),
    [
        (0.01, waves(4e-4, 5e-5), True),  # eight times as long along y, as with one size too great
        (0.01, FLAT, True),
        (0.01, waves(4e-4, 4e-4), True),  # not a whole wave on the map along x
        (0.01, waves(2.4e-4, 1.2e-4), False),
        (0.06, waves(2.4e-4, 1.2e-4), True),
    ],
)
def test_odd_pixels_matter_unless_texture_fits_them_and_the_answers_are_known(
    error, surface, doubted
):
    given = [Problem("non_square_pixels", "warning", "")]
    (found,) = as_read(given, state(error=error), caps(0.0, CapFlag.edge), 0.05, surface)
    assert (found.severity == "warning") == doubted


@pytest.mark.parametrize(("error", "known"), [(0.01, True), (0.06, False), (None, False)])
def test_families_matter_to_a_model_that_takes_them_for_the_caps(error, known):
    assert warned(COUNTS, error=error) == []
    assert warned(COUNTS, error=error, families=True) == COUNTS * (not known)


@pytest.mark.parametrize(("share", "read"), [(0.19, False), (0.21, True)])
def test_flags_matter_by_the_load_on_their_caps(share, read):
    for flag in (CapFlag.ridge, CapFlag.several_peaks, CapFlag.outlier):
        code = f"caps_{flag.name}"
        assert warned([code], share=share, flag=flag, error=None) == [code] * read
        assert warned([code], share=share, flag=CapFlag.few_points, error=None) == []
    for error, known in ((None, False), (0.01, True)):
        for flag in (CapFlag.several_peaks, CapFlag.ridge):
            code = f"caps_{flag.name}"
            assert warned([code], share=share, flag=flag, error=error) == [code] * (
                read and not known
            )


def test_a_flat_top_matters_as_soon_as_it_carries():
    for share in (0.0, 0.01):
        found = warned(["caps_plateau"], share=share, flag=CapFlag.plateau)
        assert found == ["caps_plateau"] * (share > 0.0)


def test_errors_and_information_stay():
    problems = [Problem("slope_suspect", "error", ""), Problem("caps_edge", "info", "")]
    found = as_read(problems, state("map", None), caps(1.0, CapFlag.edge), 0.05, FLAT)
    assert found == problems


PIXEL_M, RADIUS_M = 1e-4, 1e-3  # of a face of 8 mm, and of a contact on it


def flags_left(flag, x_m=4e-3, missing=None, error=0.01, made_from="spheres", radius_m=RADIUS_M):
    """Return what is left of the flag of a cap whose contact is known."""
    height_m = np.zeros((80, 80))
    if missing is not None:
        height_m[missing] = np.nan
    one = {field.name: np.ones(1) for field in fields(CapTable)}
    one |= {"x_m": np.array([x_m]), "y_m": np.array([4e-3]), "flags": np.uint16([flag])}
    one |= {"contact_radius_m": np.array([radius_m]), "load_N": np.ones(1)}
    surface = HeightMap(height_m, (PIXEL_M, PIXEL_M))
    found = still_doubtful(CapTable(**one), state(made_from, error), surface, 0.05)
    return CapFlag(int(found.flags[0]))


@pytest.mark.parametrize(("protrudes", "doubtful"), [(-0.1, False), (0.15, False), (0.4, True)])
def test_the_edge_matters_where_it_cuts_the_contact(protrudes, doubtful):
    found = flags_left(CapFlag.edge, x_m=(1.0 - protrudes) * RADIUS_M)
    assert found == (CapFlag.edge if doubtful else CapFlag(0))
    assert flags_left(CapFlag.edge, RADIUS_M - protrudes, radius_m=0.0) == CapFlag(0)


def test_a_hole_matters_where_it_hides_a_part_of_the_contact():
    flag, rng = CapFlag.non_measured, np.random.default_rng(0)
    assert flags_left(flag, missing=rng.uniform(size=(80, 80)) < 0.5) == CapFlag(0)
    row, col = np.mgrid[:80, :80] - 39.5
    away = np.hypot(row, col)
    assert flags_left(flag, missing=away < 4.0) == flag  # in the middle of the contact
    assert flags_left(flag, missing=away < 2.0) == CapFlag(0)  # among points on all sides
    assert flags_left(flag, missing=away > 15.0) == CapFlag(0)
    assert flags_left(flag, missing=away >= 0.0) == flag


def test_a_known_error_counts_apexes_that_noise_or_pixels_hide():
    for flag in (CapFlag.noisy_apex, CapFlag.apex_off_surface):
        assert flags_left(flag) == CapFlag(0)
        for unknown in ({"error": None}, {"error": 0.06}, {"made_from": "map"}):
            assert flags_left(flag, **unknown) == flag
    assert flags_left(CapFlag.plateau) == CapFlag.plateau
