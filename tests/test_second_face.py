"""Two maps whose caps are counted together: each is doubted for itself, whichever comes first."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.analysis import analyze_once
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface

SHAPE = (120, 160)
Y, X = np.indices(SHAPE)
AT_ONE_SIDE = X >= 80


def face(seed, **more):
    families = CapFamily("G", 6, 15.0), CapFamily("P", 6, 18.0, below_m=6e-8)
    return synthetic_surface(Scene(SHAPE, (2e-4, 2.2e-4), seed, families=families, **more))[0]


def without(surface, lost):
    return replace(surface, height_m=np.where(lost, np.nan, surface.height_m))


def doubted(first, second, *words):
    given = "contact.preload_N=100", "mating.way=together", *words
    found = analyze_once(first, load_settings(overrides=given), second)
    return {one.code: one for one in found.problems if one.severity == "warning"}


BAD = {
    "bow_left": lambda: face(21611, bow_m=(2e-7, 2e-7)),
    "seams": lambda: replace(face(21611), height_m=face(21611).height_m + 6e-8 * AT_ONE_SIDE),
    "outline_assumed": lambda: without(face(21611), Y / SHAPE[0] + X / SHAPE[1] < 0.5),
    "hole_may_hide_hills": lambda: without(face(21611), (abs(Y - 65) < 15) & (abs(X - 80) < 20)),
}


@pytest.mark.parametrize("code", BAD)
def test_a_doubt_of_one_map_is_said_whichever_comes_first(code):
    good = replace(face(21610), origin=replace(face(21610).origin, name="good"))
    bad = replace(BAD[code](), origin=replace(good.origin, name="bad"))
    same = replace(face(21611), origin=bad.origin)
    assert code not in doubted(good, same)
    assert code in doubted(bad, good)
    said = doubted(good, bad)
    assert code in said
    assert said[code].message.startswith("bad: ")


def test_a_bow_of_the_instrument_is_of_both_maps_and_is_said_once():
    good = face(21610)
    found = doubted(good, good, "instrument.flatness_deviation_m=1e-7")
    assert "bow_left" in found
    assert not found["bow_left"].message.startswith(f"{good.origin.name}: ")


def test_holes_that_are_void_hide_nothing_in_either_map():
    bad = BAD["hole_may_hide_hills"]()
    assert "hole_may_hide_hills" not in doubted(face(21610), bad, "joint.non_measured=void")
