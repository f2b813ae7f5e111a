"""The two stiffnesses: as given, or of the beam in the settings."""

import pytest

from capslip.settings import load_settings
from capslip.structure.beam import beam_mode
from capslip.structure.stiffness import stiffnesses, structure_name

MATERIAL = ("material.youngs_modulus_Pa=[70e9, 210e9]", "material.poisson_ratio=[0.34, 0.28]")
SIZES = {
    "length_m": 0.3,
    "width_m": 0.05,
    "thickness_m": 0.03,
    "density_kg_per_m3": 2700.0,
    "joint_position_m": 0.04,
}


def test_given_stiffnesses_are_taken_as_they_are():
    given = ("modal_stiffness_N_per_m=2e8", "joint_stiffness_N_per_m=7e7")
    settings = load_settings(overrides=tuple(f"structure.{one}" for one in given))
    assert stiffnesses(settings) == (None, 2e8, 7e7)


@pytest.mark.parametrize("theory", ["timoshenko", "euler_bernoulli"])
def test_beam_is_that_of_the_settings_and_of_the_first_body(theory):
    beam = (*SIZES.items(), ("theory", f"'{theory}'"))
    overrides = (*MATERIAL, *(f"structure.beam.{name}={value}" for name, value in beam))
    expected = beam_mode(**SIZES, theory=theory, youngs_modulus_Pa=70e9, poisson_ratio=0.34)
    found, modal, joint = stiffnesses(load_settings(overrides=overrides))
    assert found == expected
    assert (modal, joint) == (expected.modal_stiffness_N_per_m, expected.joint_stiffness_N_per_m)
    assert modal != joint


def test_a_joint_stands_where_the_moment_vanishes_by_default():
    found, *_ = stiffnesses(load_settings())
    assert found.joint_position_m == found.zero_moment_position_m


def test_a_beam_of_two_materials_says_the_modulus_of_its_own():
    """It is made of the first of them."""
    both = load_settings(overrides=("material.youngs_modulus_Pa=[210e9,70e9]",))
    assert structure_name(both) == "demonstration beam 400 x 60 x 40 mm, E 210 GPa"
    assert (
        stiffnesses(both)[1:]
        == stiffnesses(load_settings(overrides=("material.youngs_modulus_Pa=[210e9,210e9]",)))[1:]
    )
