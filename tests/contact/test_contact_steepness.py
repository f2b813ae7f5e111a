"""Contacts wide beside the radius of their caps: there is no hardness, and no half-space."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from capslip.cli import main
from capslip.contact.steepness import (
    hardness_left,
    problems_of_steep_caps,
    problems_of_steep_map,
)
from capslip.surface.heightmap import HeightMap

GIVEN = ("families", "--m", "5", "--n", "18", "--radius-G", "1e-4", "--radius-P", "1e-4")


def said(problems):
    return [(one.code, one.severity) for one in problems]


@pytest.mark.parametrize(
    ("ratio", "severity"),
    [
        (0.0999, None),
        (0.1001, "info"),
        (0.1999, "info"),
        (0.2001, "warning"),
        (0.5999, "warning"),
        (0.6001, "error"),
    ],
)
def test_contacts_are_doubted_by_how_wide_they_are(ratio, severity):
    found = problems_of_steep_caps(np.array([2.0 * ratio]), np.array([2.0]), np.array([3.0]))
    assert said(found) == ([] if severity is None else [("steep_contacts", severity)])


@pytest.mark.parametrize(("share", "severity"), [(0.049, "info"), (0.051, "error")])
def test_a_twentieth_of_the_load_is_no_doubt_about_a_face(share, severity):
    """Nor is what bears nothing, or is no cap."""
    radius_m, load_N = np.array([7.0, 9.0, 1.5, 5.0]), np.array([share, 0.0, 1.0 - share, np.nan])
    found = problems_of_steep_caps(radius_m, np.full(4, 10.0), load_N)
    assert said(found) == [("steep_contacts", severity)]
    assert problems_of_steep_caps(radius_m, np.full(4, 10.0), np.zeros(4)) == []


def test_less_of_the_hardness_is_left_as_finite_elements_of_hemispheres_say():
    """2.84 yield stresses on small contacts; Jackson and Green (2005)."""
    assert hardness_left(1e-3) == pytest.approx(1.0, abs=1e-9)
    assert 2.84 * hardness_left(0.412) == pytest.approx(2.23, abs=0.01)
    (found,) = problems_of_steep_caps(np.array([0.4]), np.ones(1), np.ones(1))
    assert found.effect is not None
    assert found.effect.tangential_stiffness == pytest.approx(hardness_left(0.4) ** -0.5 - 1.0)
    assert "keep 79% of it" in found.message


@pytest.mark.parametrize(
    ("preload", "status", "severity", "code"),
    [("2", "ok", None, 0), ("30", "check", "warning", 0), ("460", "failed", "error", 3)],
)
def test_given_caps_that_yield_beyond_a_half_space_are_refused(preload, status, severity, code):
    """Hertz alone says 0.03, 0.1 and 0.25 of the radius: by a hardness of 1 GPa it is up to 0.8."""
    more = ("--h", "2.4e-7", "--preload", preload, "--json")
    ran = CliRunner().invoke(main, [*GIVEN, *more, "--material", "steel"])
    assert ran.exit_code == code
    found = json.loads(ran.stdout)
    assert found["status"] == status
    told = [one["severity"] for one in found["problems"] if one["code"] == "steep_contacts"]
    assert told == ([] if severity is None else [severity])
    without = json.loads(CliRunner().invoke(main, [*GIVEN, *more]).stdout)  # its pressure tells
    assert "steep_contacts" not in {one["code"] for one in without["problems"]}


def paraboloid(radius_m, contact_m, hardness_Pa=1e9, made_from="map"):
    """Return a map of a paraboloid that touches within a circle, as it is pressed."""
    at_m = (np.arange(200) - 99.5) * 1e-6
    square_m2 = np.square(at_m)[:, None] + np.square(at_m)
    surface = HeightMap(-square_m2 / (2.0 * radius_m), (1e-6, 1e-6))
    pressed = SimpleNamespace(pressure_Pa=np.where(square_m2 < contact_m**2, 1.0, 0.0))
    state = SimpleNamespace(
        hardness_Pa=hardness_Pa,
        preload_N=1.0,
        rung=SimpleNamespace(made_from=made_from),
        normal=SimpleNamespace(pressed=lambda load_N: pressed),
    )
    return state, surface


@pytest.mark.parametrize(
    ("contact_m", "severity"), [(9e-6, None), (11e-6, "info"), (59e-6, "info"), (62e-6, "warning")]
)
def test_the_slope_of_what_touches_is_that_of_a_cap(contact_m, severity):
    found = problems_of_steep_map(*paraboloid(1e-4, contact_m))
    assert said(found) == ([] if severity is None else [("steep_contacts", severity)])
    assert problems_of_steep_map(*paraboloid(1e-4, contact_m, hardness_Pa=None)) == []
    assert problems_of_steep_map(*paraboloid(1e-4, contact_m, made_from="spheres")) == []


def test_points_that_are_not_measured_or_do_not_touch_have_no_slope():
    state, surface = paraboloid(1e-4, 50e-6)
    height_m = surface.height_m.copy()
    height_m[:40] = np.linspace(0.0, 1e-3, 40)[:, None]  # a wall beside the contact
    height_m[90:110, 90:110] = np.nan
    (one,) = problems_of_steep_map(state, HeightMap(height_m, (1e-6, 1e-6)))
    assert "a contact radius of 0.51 R" in one.message
    state.normal.pressed(1.0).pressure_Pa[:] = 0.0
    assert problems_of_steep_map(state, surface) == []
    assert problems_of_steep_map(state, HeightMap(height_m[:-1], (1e-6, 1e-6))) == []
