"""The comparison with published backbones recovers a known joint, and says where data lack."""

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from capslip.contact.models.families import families
from capslip.contact.slip import slip_curve
from capslip.studies import validation
from capslip.studies.validation import Backbone, bed, predict, read_backbone, response_of

JOINT = Path(__file__).parents[3] / "shared" / "joint"
SPHERE = slip_curve(families(3, 2.0, 0.0, 110e9), 50.0, 0.3, 1.2143)
OTHER = slip_curve(families((1, 30), (2.0, 2.0), (0.0, 1e-7), 110e9), 50.0, 0.3, 1.2143)


def mode_of(slip, C=2.4e-19, a=3.0, w_0=1100.0):
    """Return the backbone of a mode that holds a joint; about a third softer in the end."""
    share, compliance, loss = response_of(slip)
    C = 0.3 / w_0**2 / compliance[-1]
    w = (w_0**-2.0 + C * compliance) ** -0.5
    zeta = 1e-3 * w_0 / w + C * w**2 * loss
    q = share * slip.total_slip_force_N / (a * w**2)
    w, zeta = np.append(w_0, w), np.append(1e-3, zeta)
    return Backbone(np.append(1e-3 * q[0], q), w, zeta)


@pytest.mark.parametrize("slip", [SPHERE, OTHER])
def test_the_joint_of_a_made_mode_is_recovered(slip):
    found = predict("made", slip, mode_of(slip))
    assert found.frequency_error < 5e-3
    np.testing.assert_allclose(found.factor, 1.0, rtol=0.02)
    assert found.force_share[-1] == pytest.approx(validation.MOST_FORCE, rel=5e-3)


def test_another_joint_is_told_apart():
    found = predict("made", SPHERE, mode_of(OTHER))
    assert found.frequency_error > 0.02
    assert np.abs(np.log(found.factor)).max() > 0.05


def test_small_slip_of_a_sphere_in_closed_form():
    """delta_s = k T^2 for little slip, whose loop W = 4/3 T delta_s holds 2 / (3 pi) of it."""
    _, compliance, loss = response_of(SPHERE)
    assert loss[0] / compliance[0] == pytest.approx(2 / (3 * np.pi), rel=2e-3)
    mode = mode_of(SPHERE)
    np.testing.assert_allclose(mode.loss_over_softening[50:], (loss / compliance)[49:], rtol=1e-6)
    assert validation.exponents(mode)[40] == pytest.approx(3.0, abs=0.02)


def test_without_the_data_it_says_what_is_expected(tmp_path, monkeypatch):
    said = []
    monkeypatch.setattr(sys, "argv", ["validation", str(tmp_path)])
    validation.main(said.append)
    assert said[0].startswith("skipped")
    for name in (validation.SURFACE, *validation.BACKBONES.values()):
        assert name in said[0]


@pytest.mark.long
def test_the_lap_joint_beside_its_backbones(monkeypatch):
    if not JOINT.is_dir():
        pytest.skip("the data of the lap joint are not beside the project")
    monkeypatch.setattr(validation, "bed", cache(bed))  # which the report asks for, too
    curve = validation.bed(JOINT, False)
    assert curve.count.sum() == pytest.approx(1.371e6, rel=1e-3)
    assert curve.radius_m.max() == pytest.approx(1.365e-3, rel=1e-3)
    text = validation.report(JOINT)
    page = (Path(__file__).parents[2] / "docs" / "validation.md").read_text(encoding="utf-8")
    for line in text.splitlines():
        assert line in page  # the page is what the script prints
    for file in validation.BACKBONES.values():
        mode = read_backbone(JOINT / file)
        assert mode.joint_damping_ratio[0] == pytest.approx(0.0, abs=1e-12)
