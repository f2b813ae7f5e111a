"""Finite elements of a sphere that yields: what is known of them, and of what is made of them."""

import numpy as np
import pytest

from capslip.errors import ContactError
from capslip.studies import plastic_sphere as study
from capslip.studies.plastic_sphere import (
    FORCE_SHARES,
    PLACES,
    YOUNG,
    Body,
    losses,
    mesh_of,
    over_hertz,
    plastic_sphere,
    pressed,
    radius_of_law,
    withdrawn,
    yield_stress_of,
)

COARSE = 125  # rings
YIELDED = 1.242  # p0 / H


@pytest.fixture(scope="module")
def mesh():
    return mesh_of(COARSE)


@pytest.fixture(scope="module")
def elastic(mesh):
    return pressed(Body(mesh, 1e9, 0.0))


@pytest.fixture(scope="module")
def yielded(mesh):
    return pressed(Body(mesh, yield_stress_of(YIELDED), 0.0))


def losses_of(contact):
    given = contact.r, contact.pressure, contact.load, contact.radius
    return losses(*given, FORCE_SHARES)


@pytest.mark.long
def test_an_elastic_half_space_is_that_of_hertz(elastic):
    """The ring at the edge is a part of the outermost place, which is left out."""
    assert elastic.radius == pytest.approx(np.cbrt(0.75 * elastic.load), rel=2e-3)
    assert over_hertz(elastic)[1:] == pytest.approx(1.0, rel=0.01)
    assert losses_of(elastic) == pytest.approx(1.0, rel=0.015)
    assert elastic.overload == pytest.approx(0.0, abs=1e-8)


@pytest.mark.long
def test_a_sphere_that_yielded_loses_what_finer_elements_lose(yielded):
    assert yielded.overload == pytest.approx(YIELDED, rel=5e-3)
    assert losses_of(yielded)[1:] == pytest.approx([0.561, 0.616, 0.661], rel=0.04)
    law = radius_of_law(yielded.load, yielded.yield_stress)
    assert yielded.radius == pytest.approx(law, rel=0.02)


@pytest.mark.long
def test_no_pressure_is_beyond_what_the_yield_stress_bears(elastic, yielded):
    """Under a flat punch, which is the most confined, it is 6.1 Y at most (Eason and Shield)."""
    assert elastic.pressure[:-1].min() > 0.0
    assert yielded.pressure[:-1].min() > 0.0
    assert yielded.pressure.max() < 6.1 * yielded.yield_stress


@pytest.mark.long
def test_what_presses_is_what_holds_the_body_and_the_mean_pressure_over_the_area(elastic, yielded):
    for contact in elastic, yielded:
        assert contact.held_load == pytest.approx(contact.load, rel=1e-4)
        r, s, p, q = contact.r[:-1], contact.r[1:], contact.pressure[:-1], contact.pressure[1:]
        rings = np.pi * (s - r) / 3.0 * (2 * r * p + 2 * s * q + r * q + s * p)
        assert rings.sum() == pytest.approx(contact.load, rel=1e-5)
        to = contact.r[-1] * np.linspace(1.0, 1e-3, 1000)
        _, lost = withdrawn(contact.r, contact.pressure, to)
        assert lost[-1] == pytest.approx(contact.load, rel=2e-3)
        over_mean = 1.5 * np.sqrt(PLACES) * over_hertz(contact)
        mean = np.trapezoid([0.0, *over_mean], [0.0, *PLACES])
        assert mean == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("hardening", [0.0, 0.02])
def test_flow_ends_at_the_yield_surface_and_the_stiffness_is_the_slope_of_forces(mesh, hardening):
    body = Body(mesh, 0.1, hardening)
    rng = np.random.default_rng(0)
    u = 3e-2 * rng.standard_normal(len(mesh.held))
    move = 1e-7 * rng.standard_normal(len(u))
    start = body.start()
    now = body.moved(start, u)
    assert 0.2 < (now.flowed > 0.0).mean() < 1.0
    again = body.moved(now, u)
    assert again.flowed == pytest.approx(now.flowed, rel=1e-9)
    slope = (body.moved(start, u + move).force - body.moved(start, u - move).force) / 2.0
    wanted = mesh.matrix(now.stiffness) @ move
    assert np.abs(slope - wanted).max() < 1e-4 * np.abs(slope).max()


@pytest.mark.long
def test_a_body_that_hardens_bears_more(mesh, yielded):
    harder = pressed(Body(mesh, yielded.yield_stress, 0.02 * YOUNG / 0.98))
    assert 1.002 < harder.load / yielded.load < 1.03  # 2 % of E as the slope of a tensile test
    assert np.all(losses_of(harder) > losses_of(yielded))


def test_a_uniform_pressure_loses_what_flat_punches_say():
    r = np.linspace(0.0, 1.0, 11)
    found = losses(r, np.ones(11), np.pi, 1.0, (0.25, 0.5, 0.75))
    assert found == pytest.approx([0.199, 0.352, 0.481], abs=1e-3)


def test_pressures_of_hertz_are_withdrawn_as_hertz_says():
    r = 1.0 - np.linspace(1.0, 0.0, 500) ** 2
    c = np.linspace(1.0, 0.1, 1000)
    load, pressure = 4.0 / 3.0, 2.0 / np.pi * np.sqrt(1.0 - r**2)
    e, lost = withdrawn(r, pressure, c)
    assert e == pytest.approx(1.0 - c**2, abs=1e-4)
    assert lost == pytest.approx(load * (1.0 - c**3), abs=1e-4)
    found = losses(r, pressure, load, 1.0, FORCE_SHARES)
    assert found == pytest.approx(1.0, rel=2e-3)


def test_the_law_has_the_radius_for_which_the_yield_stress_is_asked():
    Y = yield_stress_of(2.0)
    load = (np.pi * 2.8 * Y * 2.0) ** 3 / 6.0
    assert radius_of_law(load, Y) == pytest.approx(1.0, rel=1e-9)
    assert radius_of_law(1.0, 1e9) == pytest.approx(np.cbrt(0.75), rel=1e-9)


def test_the_tables_have_a_row_a_case_and_leave_out_what_finds_no_balance(monkeypatch):
    told = []
    text = plastic_sphere((0.4,), rings=60, progress=told.append)
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| 0.")]
    assert [len(row) for row in rows] == [1 + len(PLACES), 4 + len(FORCE_SHARES)]
    assert float(rows[0][0].strip("| ")) == pytest.approx(0.4, rel=0.01)
    assert float(rows[1][-1].strip(" |")) == pytest.approx(1.0, rel=0.01)
    assert len(told) == 1
    monkeypatch.setattr(study, "MAX_TURNS", 1)
    with pytest.raises(ContactError, match="no balance of the ring"):
        pressed(Body(mesh_of(60), 1e9, 0.0))
    text = plastic_sphere((0.4,), rings=60, progress=told.append)
    assert [line[:5] for line in text.splitlines() if line[0:1] == "|"] == ["| p0 ", "| ---"] * 2
    assert "no balance" in told[1]
