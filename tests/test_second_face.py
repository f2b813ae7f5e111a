"""Two faces: each is doubted for itself, whichever comes first; a sum on unlike points."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.analysis import analyze_once
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap

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


@pytest.mark.long
def test_the_sum_of_faces_on_unlike_points_answers_as_the_sum_of_their_waves():
    """What touches at the edge of a map lies beside its outermost points: W was 15 % off."""

    def waves_m(seed, x_m, y_m, n=80):
        rng = np.random.default_rng(seed)
        angle, number = rng.uniform(0, 2 * np.pi, n), 2 * np.pi / 1.2e-3 * rng.uniform(0.6, 1.0, n)
        each = zip(number, angle, rng.uniform(0, 2 * np.pi, n), strict=True)
        along = (k * (np.cos(a) * x_m + np.sin(a) * y_m) + at for k, a, at in each)
        return 1e-6 * np.sqrt(2 / n) * sum(np.cos(one) for one in along)

    def points(pixel_m):
        y, x = ((np.arange(round(side_m / pixel_m)) + 0.5) * pixel_m for side_m in (1e-2, 1.1e-2))
        return np.meshgrid(x, y)

    x_m, y_m = points(1e-4)
    first, second = (HeightMap(waves_m(24430, x_m, y_m), (1e-4, 1e-4)), points(2e-4))
    second = HeightMap(waves_m(24431, *second), (2e-4, 2e-4))
    sum_m = first.height_m + waves_m(24431, 1.1e-2 - x_m, y_m)
    settings = load_settings(
        overrides=["contact.preload_N=200", "material.preset=steel", "slip.direction_rad=0"]
    )
    true = analyze_once(HeightMap(sum_m, (1e-4, 1e-4)), settings).answer
    for faces in ((first, second), (second, first)):
        found = analyze_once(faces[0], settings, faces[1]).answer
        assert found.energy_J == pytest.approx(true.energy_J, rel=0.03)
        assert found.tangential_stiffness_N_per_m == pytest.approx(
            true.tangential_stiffness_N_per_m, rel=0.02
        )
