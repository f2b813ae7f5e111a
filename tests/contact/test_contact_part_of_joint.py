"""What a scan leaves open of the joint that it is a part of."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.contact.part_of_joint import left_open
from capslip.structure import band_causes


def joint(coverage):
    return SimpleNamespace(coverage=coverage)


def pressed(contacts, bulk_m=0.0, made_from="spheres"):
    rung = SimpleNamespace(made_from=made_from)
    return SimpleNamespace(contacts=contacts, bulk_m=bulk_m, approach_m=1e-6, rung=rung, light=None)


@pytest.mark.parametrize(
    ("of", "contact"),
    [
        (joint(None), pressed(9)),
        (joint(0.995), pressed(9)),  # all of it but for rounding
        (joint(2.0), pressed(9)),
        (joint(0.1), pressed(1, made_from="nothing")),
    ],
)
def test_a_scan_that_is_its_joint_leaves_nothing_open(of, contact):
    assert left_open(of, contact) is None


@pytest.mark.parametrize("contacts", [4, 100])
def test_what_is_left_open_falls_with_the_root_of_the_contacts(contacts):
    found, one = left_open(joint(0.98), pressed(contacts)), left_open(joint(0.98), pressed(1))
    for name in ("lost", "unsure", "energy_by_chance", "stiffness_by_chance"):
        assert getattr(one, name) > 0.0
        assert getattr(found, name) == pytest.approx(getattr(one, name) / math.sqrt(contacts))
    assert found.stiffness_by_bulk == 0.0
    spread = math.hypot(found.unsure, found.energy_by_chance)
    assert found.energy_up_to == pytest.approx(math.exp(found.lost + 1.645 * spread) - 1.0)


def test_the_stiffness_is_as_unsure_as_the_bulk_that_was_taken_off():
    """Of a third of the approach that is bulk half as much as what is left is unsure."""
    half, third, most, all_of_it = (
        left_open(joint(0.1), pressed(9, share * 1e-6)).stiffness_by_bulk
        for share in (0.5, 1.0 / 3.0, 0.9, 1.2)
    )
    assert third == pytest.approx(0.5 * half)
    assert half == most == all_of_it


def test_chance_is_that_of_one_scan_alone():
    """Of several their scatter tells it; what all have in common is their mean by their shares."""
    parts = [
        SimpleNamespace(joint=joint(0.1), contact=pressed(16, 0.5e-6), share=0.25),
        SimpleNamespace(joint=joint(0.1), contact=pressed(64), share=0.75),
    ]
    each = [left_open(part.joint, part.contact) for part in parts]
    root, shift = band_causes.of_parts(SimpleNamespace(parts=parts))
    spread = [0.25 * each[0].stiffness_by_bulk, 0.25 * each[0].unsure + 0.75 * each[1].unsure]
    np.testing.assert_allclose(root.T @ root, np.diag(np.square(spread)), atol=1e-15)
    assert shift.tolist() == pytest.approx([0.0, 0.25 * each[0].lost + 0.75 * each[1].lost])
    alone = SimpleNamespace(joint=parts[0].joint, contact=parts[0].contact, share=1.0)
    root, shift = band_causes.of_parts(SimpleNamespace(parts=[alone]))
    variance = [
        each[0].stiffness_by_bulk ** 2 + each[0].stiffness_by_chance ** 2,
        each[0].unsure ** 2 + each[0].energy_by_chance ** 2,
    ]
    np.testing.assert_allclose(root.T @ root, np.diag(variance), atol=1e-15)
    assert shift.tolist() == pytest.approx([0.0, each[0].lost])


def test_a_joint_that_is_scanned_as_a_whole_has_no_part():
    whole = [SimpleNamespace(joint=joint(None), contact=pressed(9), share=1.0)]
    root, shift = band_causes.of_parts(SimpleNamespace(parts=whole))
    assert not root.any()
    assert not shift.any()
