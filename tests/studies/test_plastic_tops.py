"""Finite elements of tops that are no spheres: what is known of them, and of their maps."""

import math

import numpy as np
import pytest

from capslip.contact.plastic_law import LawError
from capslip.contact.rung import ModelError
from capslip.studies import plastic_sphere, plastic_tops
from capslip.studies.plastic_sphere import (
    EDGE,
    FAR,
    FORCE_SHARES,
    Body,
    advanced,
    mesh_of,
    pressed,
    withdrawn,
)
from capslip.studies.plastic_tops import (
    TOPS,
    answer_of,
    by_elements,
    by_map,
    elastic,
    stated,
)

PARABOLA, CONE, FOURTH, RIMMED, WORN, BUMPY, TIP = TOPS
SOFT = 1e-6  # mean pressure over the hardness: nothing yields
# Depth and load of a contact of radius 1 (Sneddon 1965), and the power of the radius with which the
# depth grows
CLOSED = {
    PARABOLA: (1.0, 4.0 / 3.0, 2),
    CONE: (math.pi / 2.0, math.pi / 2.0, 1),
    FOURTH: (8.0 / 3.0, 64.0 / 15.0, 4),
}


@pytest.fixture(scope="module")
def mesh():
    return mesh_of(50)


@pytest.mark.parametrize("top", CLOSED, ids=lambda top: top.name)
def test_elastic_tops_are_those_of_sneddon(mesh, top):
    depth, load, power = CLOSED[top]
    a = np.linspace(0.002, 1.0, 500)
    depths, loads = elastic(top, a)
    assert depths == pytest.approx(depth * a**power, rel=1e-3, abs=1e-6)
    assert loads[-1] == pytest.approx(load, rel=1e-3)
    contact = by_elements(top, SOFT, mesh)
    assert contact.load == pytest.approx(load * contact.radius ** (power + 1), rel=0.01)
    found = answer_of(contact)
    assert found.depth == pytest.approx(depth * contact.radius**power, rel=0.01)
    assert found.area == pytest.approx(np.pi * contact.radius**2)


@pytest.mark.parametrize("top", [RIMMED, WORN, BUMPY, TIP], ids=lambda top: top.name)
def test_elements_and_the_integral_agree_on_tops_without_a_closed_form(mesh, top):
    contact = by_elements(top, SOFT, mesh)
    depths, loads = elastic(top, np.linspace(0.0, contact.radius, 501)[1:])
    assert contact.load == pytest.approx(loads[-1], rel=0.015)
    assert answer_of(contact).depth == pytest.approx(depths[-1], rel=0.015)
    assert (contact.pressure[:-1] > 0.0).all()
    comes_nearer = np.diff(depths) >= 0.0  # else a ring would touch outside before
    assert comes_nearer.all() == (top is not TIP)


def test_a_worn_sphere_is_a_sphere_that_has_sunk_by_its_flat(mesh):
    """Its depth is a sqrt(a^2 - b^2) / R."""
    depths, _ = elastic(WORN, np.array([0.7, 1.0]))
    wanted = [0.7 * math.sqrt(0.7**2 - 0.25), math.sqrt(0.75)]
    assert depths == pytest.approx(wanted, rel=1e-3)


@pytest.mark.long
def test_the_parabola_is_that_of_the_study_of_spheres(mesh):
    contact = by_elements(PARABOLA, 1.4, mesh)
    again = pressed(Body(mesh, contact.yield_stress, 0.0))
    assert contact.load == pytest.approx(again.load, rel=2e-3)
    assert contact.depth == pytest.approx(again.depth, rel=2e-3)


@pytest.mark.long
@pytest.mark.parametrize("top", [CONE, FOURTH], ids=lambda top: top.name)
def test_all_tops_bear_about_the_hardness_in_the_end(mesh, top):
    contact = by_elements(top, 6.0, mesh)
    mean = contact.load / answer_of(contact).area / contact.yield_stress
    assert 2.6 < mean < 3.0
    assert contact.pressure.max() < 6.1 * contact.yield_stress
    assert contact.held_load == pytest.approx(contact.load, rel=1e-4)


@pytest.mark.long
def test_a_cone_that_yields_is_like_itself_at_any_size(mesh):
    """Its tip is blunted by the mesh, and that is soon forgotten: F ~ a^2 and d ~ a."""
    body, found = Body(mesh, 0.13, 0.0, CONE.height), {}
    state, r = body.start(), mesh.radius
    for rings in range(2, int(np.abs(r - 1.0).argmin()) + 1):
        state = advanced(body, state, rings)
        a = r[rings] - EDGE * (r[rings] - r[rings - 1])
        load = state.force[mesh.face[:rings]].sum()
        found[a] = load / a**2, (state.depth + load / (math.pi * FAR)) / a
    late = np.array([both for a, both in found.items() if a > 0.84])
    assert len(late) > 5
    assert late[:, 0] == pytest.approx(late[-1, 0], rel=4e-3)
    assert late[:, 1] == pytest.approx(late[-1, 1], rel=1e-3)
    assert late[-1, 0] < 0.6 * CLOSED[CONE][1]  # it yields


@pytest.mark.parametrize("top", [PARABOLA, FOURTH], ids=lambda top: top.name)
def test_an_elastic_map_says_what_the_closed_form_does(top):
    """As a contact shrinks to c it has come up by d(a) - d(c), and has lost F(a) - F(c)."""
    depth, load, power = CLOSED[top]
    found, errors = by_map(top, load, 1e3)
    assert errors.law is None
    assert found.depth == pytest.approx(depth, rel=3e-3)
    assert found.area == pytest.approx(np.pi, rel=0.02)
    lost = np.array(FORCE_SHARES)
    c = (1.0 - lost) ** (1.0 / (power + 1))
    assert found.withdrawal == pytest.approx(depth * (1.0 - c**power), rel=0.01)
    s = load * np.linspace(0.0, 1.0, 20001)
    x = depth * (1.0 - (1.0 - s / load) ** (power / (power + 1)))
    W = np.cumsum(4.0 * (s[:-1] * x[1:] - s[1:] * x[:-1]))
    assert found.energy[1:] == pytest.approx(np.interp(lost[1:] * load, s[1:], W), rel=0.01)


def test_what_is_stated_holds_what_the_law_leaves_open():
    """What it expects is in the answers: that moves nothing."""
    law = LawError(0.1, (0.02,) * 4, (-0.3,) * 4, (0.4,) * 4, ((0.07,) * 4,) * 2)
    stiffness, energy = stated(ModelError(0.03, 0.2, law=law))
    wide = math.hypot(0.03, 0.7 * 0.1, 0.25 * 0.02)
    assert stiffness == pytest.approx(np.tile([-wide, wide], (4, 1)))
    wide = math.hypot(0.2, 0.7 * 0.1, 0.4)
    assert energy == pytest.approx(np.tile([-wide, wide], (4, 1)))
    stiffness, energy = stated(ModelError(0.03, 0.2))
    assert stiffness == pytest.approx(np.tile([-0.03, 0.03], (4, 1)))
    assert energy == pytest.approx(np.tile([-0.2, 0.2], (4, 1)))


def test_pressures_of_a_cone_are_withdrawn_as_sneddon_says():
    """Of pressures acosh(a / r) / 2."""
    r = np.append(np.geomspace(1e-6, 0.5, 800), 1.0 - np.linspace(0.5**0.5, 0.0, 800)[1:] ** 2)
    c = np.linspace(1.0, 0.1, 500)
    e, lost = withdrawn(r, np.arccosh(1.0 / r) / 2.0, c)
    assert e == pytest.approx(math.pi / 2.0 * (1.0 - c), abs=1e-3)
    assert lost == pytest.approx(math.pi / 2.0 * (1.0 - c**2), abs=1e-3)


@pytest.mark.long
def test_the_tables_have_a_row_a_case_and_leave_out_what_finds_no_balance(monkeypatch):
    monkeypatch.setattr(plastic_tops, "PIXELS", 12)
    two = plastic_tops.Top("r^4", FOURTH.height, 0.0, (0.2, 0.3))
    told = []
    text = plastic_tops.plastic_tops([two], rings=50, progress=told.append)
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line[:5] == "| r^4"]
    assert [len(row) for row in rows] == [8, 8, 6, 6]
    assert float(rows[1][1]) == pytest.approx(0.3, rel=0.02)
    for ratio in rows[0][2:6]:
        assert float(ratio.split()[0]) == pytest.approx(1.0, abs=0.03)
    assert len(told) == 2
    monkeypatch.setattr(plastic_sphere, "MAX_TURNS", 1)
    text = plastic_tops.plastic_tops([two], rings=50, progress=told.append)
    assert "| r^4" not in text
    assert "r^4 at 0.3: no balance" in told[3]


@pytest.mark.long
@pytest.mark.parametrize(("power", "overload"), [(5, 0.75), (9, 0.7), (9, 1.0)])
def test_blunt_tops_lose_what_is_stated_before_the_bound_has_flattened_their_rim(power, overload):
    """Metal yields at the rim well below its hardness, and loses more far into slip."""
    top = plastic_tops.Top("blunt", lambda r: np.asarray(r**power))
    contact = by_elements(top, overload, mesh_of(100))
    found, errors = by_map(top, contact.load, contact.yield_stress)
    off = np.log(found.energy / answer_of(contact).energy)[1:]
    low, high = stated(errors)[1, 1:].T
    assert (low < off).all()
    assert (off < high).all()
    assert np.abs(off)[1:].max() < 0.1
    assert (high - low).max() < 0.8
