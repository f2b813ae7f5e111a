"""A second family below the cut: named where a deeper cut shows it beside the same first."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.analysis import analyze_once
from capslip.caps.below import caps_below_cut, family_below_cut, with_families
from capslip.caps.table import CapFlag, CapTable
from capslip.settings import load_settings
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap


def families(m, n):
    return SimpleNamespace(count=1 + (n > 0), m=m, n=n)


def found(n_of_cut, m_of_cut=lambda cut: 5, cut=0.10):
    """Return the problems of a face with so many caps above each cut."""

    def counted(ratio):
        return families(m_of_cut(ratio), n_of_cut(ratio))

    return family_below_cut(counted(cut), cut, counted)


def test_a_family_that_only_a_deeper_cut_shows_is_named():
    for least, cut in ((0.15, 0.10), (0.20, 0.10), (0.08, 0.04)):
        (problem,) = found(lambda ratio, least=least: 18 * (ratio >= least - 1e-9), cut=cut)
        assert (problem.code, problem.severity) == ("family_below_cut", "warning")
        assert f"a cut of {100 * least:g} % shows 18 P-caps beside the 5 G-caps" in problem.message


@pytest.mark.parametrize(
    ("n_of_cut", "m_of_cut"),
    [
        (lambda cut: 18, lambda cut: 5),  # nothing is hidden
        (lambda cut: 18 * (cut >= 0.25), lambda cut: 5),  # too deep to be of the same face
        (lambda cut: 1 * (cut >= 0.15), lambda cut: 5),  # one piece: the floor
        (lambda cut: 18 * (cut >= 0.15), lambda cut: 5 + 9 * (cut >= 0.15)),  # another G
    ],
)
def test_no_family_below_the_cut_where_there_is_none(n_of_cut, m_of_cut):
    assert found(n_of_cut, m_of_cut) == []


def test_the_whole_face_is_the_deepest_cut():
    def counted(ratio):
        assert ratio < 1.0
        return families(5, 0)

    assert family_below_cut(families(5, 0), 0.6, counted) == []


def table(**columns):
    n = len(next(iter(columns.values())))
    every = {field.name: np.ones(n) for field in fields(CapTable)}
    every |= {"family": np.full(n, ""), "flags": np.zeros(n, np.uint16)}
    return CapTable(**every | {name: np.asarray(column) for name, column in columns.items()})


def test_caps_of_the_pressed_face_have_the_families_of_the_hills_they_stand_on():
    """Pixels of 1 along y and 2 along x; one cap beyond the edge, one without a sphere.

    Two have their apex on no hill: one within the disc of a cap, and one beside all of them.
    """
    label = np.zeros((4, 5), dtype=np.int32)
    label[0, 0], label[2, 3], label[3, 4] = 1, 2, 3
    caps = table(
        x_m=[0.5, 7.9, 10.5, 5.0, 0.5, 5.2],
        y_m=[0.5, 2.1, 4.0, 2.5, 0.5, 1.9],
        flags=np.array([0, 0, 0, 0, CapFlag.not_convex, 0], dtype=np.uint16),
        family=["X"] * 6,
    )
    counted = table(
        x_m=[0.5, 7.0, 9.0], y_m=[0.5, 2.5, 3.5], family=["P", "G", "P"], diameter_m=[1.0, 3.9, 1.0]
    )
    surface = HeightMap(np.zeros((4, 5)), (1.0, 2.0))
    found = with_families(caps, surface, label, counted)
    assert found.family.tolist() == ["P", "G", "P", "", "", "G"]


def test_caps_that_only_a_deeper_cut_found_are_in_no_family_and_that_is_said():
    flags = np.array([0, 0, 0, CapFlag.edge, CapFlag.ridge, CapFlag.not_convex], np.uint16)
    caps = table(flags=flags, family=["G", "P", "", "", "", ""])
    (problem,) = caps_below_cut(caps, families(1, 1), 0.1)
    assert (problem.code, problem.severity) == ("family_below_cut", "warning")
    assert problem.message.startswith(
        "2 of 4 caps that the load may reach stand below the cut of 10"
    )
    assert problem.message.endswith("do not know them")
    assert caps_below_cut(caps, SimpleNamespace(count=0), 0.1) == []
    named = caps.with_columns(family=np.array(["G", "P", "P", "P", "", ""]))
    assert caps_below_cut(named, families(1, 3), 0.1) == []


def test_a_cap_whose_apex_was_not_measured_is_of_its_family():
    scene = Scene((200, 300), (2e-4, 2e-4), seed=2, families=PAPER, non_measured_fraction=0.2)
    found = analyze_once(synthetic_surface(scene)[0], load_settings())
    assert (found.families.m, found.families.n) == (5, 18)
    assert "" not in found.caps.family
    assert "family_below_cut" not in [problem.code for problem in found.problems]


def test_a_low_cap_of_a_family_below_the_cut_is_not_counted_and_that_is_said():
    """The P-caps scatter down to where the cut has hardly any of one left."""
    from capslip.studies.limits.tries import scattered_face

    found = analyze_once(synthetic_surface(scattered_face(1.8e-8, 200002))[0], load_settings())
    assert (found.families.m, found.families.n, len(found.caps)) == (8, 11, 20)
    (said,) = [one for one in found.problems if one.code == "family_below_cut"]
    assert said.message.startswith("1 of 20 caps")
    assert said.severity == "info"
