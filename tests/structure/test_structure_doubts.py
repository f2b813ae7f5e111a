"""Doubts about the damping, on both sides of each threshold."""

from dataclasses import replace

import msgspec
import pytest

from capslip.settings import Beam, Structure
from capslip.structure.doubts import problems_of_damping, problems_of_structure
from capslip.structure.response import response

GIVEN = {"modal_stiffness_N_per_m": 2e8, "joint_stiffness_N_per_m": 1e8}
OTHER_BEAM = msgspec.structs.replace(Beam(), length_m=2.0 * Beam().length_m)


@pytest.mark.parametrize(
    ("structure", "codes"),
    [
        (Structure(), []),
        (Structure(**GIVEN), []),
        (Structure(beam=OTHER_BEAM), []),
        (Structure(**GIVEN, beam=OTHER_BEAM), ["beam_ignored"]),
    ],
)
def test_a_beam_beside_given_stiffnesses_is_not_used(structure, codes):
    found = problems_of_structure(structure)
    assert [(one.code, one.severity) for one in found] == [(code, "warning") for code in codes]


@pytest.mark.parametrize(
    ("peak", "at_gross_slip", "expected"),
    [
        (0.3, False, []),
        (0.301, False, [("not_lightly_damped", "warning")]),
        (0.1, True, [("peak_at_gross_slip", "info")]),
        (0.7, True, [("not_lightly_damped", "warning"), ("peak_at_gross_slip", "info")]),
    ],
)
def test_damping_is_doubted_just_beyond_its_threshold(slip, peak, at_gross_slip, expected):
    damping = response(slip, 2e8, 1e8, 1)
    damping = replace(damping, peak_loss_factor=peak, peak_at_gross_slip=at_gross_slip)
    found = problems_of_damping(damping, "beam of mine", is_given=True)
    assert [(one.code, one.severity) for one in found] == expected
    assert all("beam of mine" in one.message for one in found if one.severity == "warning")
    notes = problems_of_damping(damping, "demonstration beam", is_given=False)
    assert [(one.code, one.severity) for one in notes] == [(code, "info") for code, _ in expected]
