"""What the model in use does not read of hills, caps and families is no warning."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.caps.table import CapFlag, CapTable
from capslip.contact.relevance import as_read
from capslip.problems import Problem

SHAPE = ["connected_network", "shallow_saddles", "pruning_decides", "not_spherical", "caps_ridge"]
COUNTS = ["families_doubtful", "more_than_two_families", "family_below_cut", "caps_noisy_apex"]
ELSE = ["highest_point_on_no_cap", "plateau_at_cut", "cut_too_high", "level_not_settled"]
ELSE += ["no_caps", "fit_not_settled"]
OTHERS = ["outliers", "spikes", "hole_may_hide_hills", "clipped"]


def caps(share, flag):
    """Return ten caps, of which the flagged first one carries that share of the load."""
    every = {field.name: np.ones(10) for field in fields(CapTable)}
    load_N = np.append(share, np.full(9, (1.0 - share) / 9.0))
    flags = np.where(np.arange(10) == 0, flag, 0).astype(np.uint16)
    return CapTable(**{**every, "load_N": load_N, "flags": flags})


def warned(codes, made_from="spheres", error=0.01, share=0.0, flag=CapFlag.edge):
    """Return the codes that stay warnings."""
    contact = SimpleNamespace(rung=SimpleNamespace(made_from=made_from), estimated_error=error)
    problems = [Problem(code, "warning", "") for code in codes]
    found = as_read(problems, contact, caps(share, flag), 0.05)
    assert [problem.code for problem in found] == codes
    return [problem.code for problem in found if problem.severity == "warning"]


@pytest.mark.parametrize("made_from", ["map", "nothing"])
def test_a_model_without_caps_reads_none(made_from):
    flagged = [f"caps_{flag.name}" for flag in (CapFlag.edge, CapFlag.ridge, CapFlag.outlier)]
    assert warned(SHAPE + COUNTS[:-1] + flagged, made_from, share=1.0) == []
    assert warned(ELSE + COUNTS[-1:], made_from) == []
    assert warned(OTHERS, made_from) == OTHERS


def test_what_the_cut_left_out_matters_to_a_model_of_caps():
    assert warned(ELSE) == ELSE


def test_the_estimated_error_counts_the_shape_of_the_hills():
    hills = SHAPE[:-1]
    assert warned(hills, error=0.01) == []
    assert warned(hills, error=0.051) == hills
    assert warned(hills, error=None) == hills
    assert warned(COUNTS + OTHERS, error=0.01) == COUNTS + OTHERS


@pytest.mark.parametrize(("share", "read"), [(0.19, False), (0.21, True)])
def test_flags_matter_by_the_load_on_their_caps(share, read):
    for flag in (CapFlag.edge, CapFlag.non_measured, CapFlag.outlier):
        code = f"caps_{flag.name}"
        assert warned([code], share=share, flag=flag) == [code] * read
        assert warned([code], share=share, flag=CapFlag.few_points) == []
    for error, known in ((None, False), (0.01, True)):
        found = warned(["caps_ridge"], share=share, flag=CapFlag.ridge, error=error)
        assert found == ["caps_ridge"] * (read and not known)


def test_a_flat_top_matters_as_soon_as_it_carries():
    for share in (0.0, 0.01):
        found = warned(["caps_plateau"], share=share, flag=CapFlag.plateau)
        assert found == ["caps_plateau"] * (share > 0.0)


def test_errors_and_information_stay():
    problems = [Problem("slope_suspect", "error", ""), Problem("caps_edge", "info", "")]
    contact = SimpleNamespace(rung=SimpleNamespace(made_from="map"), estimated_error=None)
    assert as_read(problems, contact, caps(1.0, CapFlag.edge), 0.05) == problems
