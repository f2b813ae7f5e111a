"""What a scan leaves open of the joint that it is a part of."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.contact.part_of_joint import left_open, long_waves
from capslip.structure import band_causes


def joint(coverage, long_waves_m=0.0):
    return SimpleNamespace(coverage=coverage, long_waves_m=long_waves_m)


def pressed(contacts, bulk_m=0.0, made_from="map", caps=0):
    return SimpleNamespace(
        contacts=contacts,
        bulk_m=bulk_m,
        approach_m=1e-6,
        approach_without_bulk_m=1e-6 - bulk_m,
        rung=SimpleNamespace(made_from=made_from),
        use=np.ones(caps, dtype=bool),
        light=None,
    )


def state(*parts, by_force=True):
    return SimpleNamespace(parts=parts, by_force=by_force)


def part(share, *of_joint, **of_scan):
    return SimpleNamespace(joint=joint(*of_joint), contact=pressed(**of_scan), share=share)


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
    found, one = left_open(joint(0.25), pressed(contacts)), left_open(joint(0.25), pressed(1))
    for name in ("by_choice", "energy_by_chance", "stiffness_by_chance"):
        assert np.all(np.array(getattr(one, name)) > 0.0)
        expected = np.array(getattr(one, name)) / math.sqrt(contacts)
        np.testing.assert_allclose(getattr(found, name), expected)
    assert found.stiffness_by_bulk == 0.0
    assert found.by_waves == (0.0, 0.0)
    spread = math.hypot(found.by_choice.energy, found.energy_by_chance)
    expected = math.exp(found.by_choice.energy + 1.645 * spread) - 1.0
    assert found.energy_up_to == pytest.approx(expected)


def test_the_larger_the_joint_the_more_hills_it_has_to_choose_from():
    """Half of what all of a face has to a joint of twice the sides, and nothing to the scan."""
    twice, most, hardly = (
        left_open(joint(coverage), pressed(9)).by_choice for coverage in (0.25, 1e-12, 0.98)
    )
    np.testing.assert_allclose(np.multiply(twice, 2.0), most, rtol=1e-5)
    assert 0.0 < hardly.energy < 0.02 * most.energy


@pytest.mark.parametrize(("caps", "left"), [(9, 0.0), (8, 0.0), (18, 0.5), (900, 0.99)])
def test_caps_that_all_touch_have_none_to_choose_from(caps, left):
    of_map, of_caps = (left_open(joint(0.25), pressed(9, caps=n)) for n in (0, caps))
    np.testing.assert_allclose(of_caps.by_choice, np.multiply(left, of_map.by_choice))
    assert of_caps.energy_by_chance == of_map.energy_by_chance


def test_waves_longer_than_the_scan_grow_with_the_joint_up_to_what_was_tried():
    """With the logarithm of its sides; of waves as high as the approach, and three times that."""

    def moved(coverage, long_waves_m):
        return np.array(left_open(joint(coverage, long_waves_m), pressed(9, 0.5e-6)).by_waves)

    once = moved(1 / 4, 0.5e-6)
    assert (once > 0.0).all()
    np.testing.assert_allclose(moved(1 / 16, 0.5e-6), 2.0 * once)
    np.testing.assert_allclose(moved(1 / 4, 1.5e-6), 2.0 * once)
    np.testing.assert_allclose(moved(1 / 37, 1e-6), moved(1 / 1e6, 1e-6))
    assert (moved(1 / 35, 1e-6) < moved(1 / 37, 1e-6)).all()
    assert long_waves(joint(0.1, 1e-6), pressed(9, 0.5e-6)) == pytest.approx(2.0)
    assert long_waves(joint(0.995, 1e-6), pressed(9)) is None


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
    parts = (
        part(0.25, 0.1, 1e-6, contacts=16, bulk_m=0.5e-6),
        part(0.75, 0.1, contacts=64),
    )
    each = [left_open(one.joint, one.contact) for one in parts]
    by_choice = 0.25 * np.array(each[0].by_choice) + 0.75 * np.array(each[1].by_choice)
    by_waves = 0.25 * np.array(each[0].by_waves)
    root, shift = band_causes.of_parts(state(*parts))
    rows = np.array([by_choice, by_waves, [0.25 * each[0].stiffness_by_bulk, 0]])
    np.testing.assert_allclose(root.T @ root, rows.T @ rows, atol=1e-15)
    np.testing.assert_allclose(shift, by_choice + by_waves)
    alone = part(1.0, 0.1, contacts=16)
    found = left_open(alone.joint, alone.contact)
    root, shift = band_causes.of_parts(state(alone))
    rows = np.array(
        [
            found.by_choice,
            [found.stiffness_by_chance, 0.0],
            [0.0, found.energy_by_chance],
        ]
    )
    np.testing.assert_allclose(root.T @ root, rows.T @ rows, atol=1e-15)
    np.testing.assert_allclose(shift, found.by_choice)


def test_a_joint_that_is_scanned_as_a_whole_has_no_part():
    whole = part(1.0, None, contacts=9)
    root, shift = band_causes.of_parts(state(whole))
    assert not root.any()
    assert not shift.any()


def test_at_a_given_displacement_a_softer_joint_is_one_of_a_smaller_displacement():
    """Force and energy go with powers of the displacement here, which is shorter by the softness.

    Of scans that are stiffer by a factor the force falls with that to its power, and the energy,
    which is greater under a given force, along the curve.
    """
    mu, kappa, of_force, of_energy = 0.2, 1.5, 0.7, 2.5
    alone = part(1.0, 0.1, contacts=16)
    given = SimpleNamespace(
        parts=(alone,),
        by_force=False,
        answer=SimpleNamespace(displacement_m=1e-7),
        settings=SimpleNamespace(material=SimpleNamespace(friction_coefficient=mu)),
        kappa=kappa,
        preload_N=10.0,
        curves=lambda factors: [SimpleNamespace(approach_m=lambda load_N: 1e-6)],
        response=lambda curve, approach_m, e: (e**of_force, e**of_energy),
    )
    softer, more = left_open(alone.joint, alone.contact).by_choice
    _, shift = band_causes.of_parts(given)
    np.testing.assert_allclose(shift, (-of_force * softer, more - of_energy * softer), rtol=1e-3)
    root, _ = band_causes.of_parts(given)
    by_force, _ = band_causes.of_parts(state(alone))
    along = np.array([[-of_force, -of_energy], [0.0, 1.0]])
    rows = by_force @ along
    np.testing.assert_allclose(root.T @ root, rows.T @ rows, rtol=1e-3)


@pytest.mark.parametrize(("coverage", "freedom"), [(0.1, 4), (None, 1)])
def test_what_contacts_let_expect_counts_as_scans_more(coverage, freedom):
    parts = [part(share, coverage, contacts=25) for share in (0.25, 0.75)]
    assert band_causes.degrees_of_freedom(state(*parts)) == freedom
    found = band_causes._by_chance(state(*parts))
    if coverage is None:
        assert found is None
        return
    one = left_open(parts[0].joint, parts[0].contact)
    of_mean = np.hypot(0.25, 0.75) * np.array([one.stiffness_by_chance, one.energy_by_chance])
    np.testing.assert_allclose(found, np.diag(of_mean))
