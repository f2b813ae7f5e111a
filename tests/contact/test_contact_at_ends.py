"""A face that ends before its map does is that of a map that ends there."""

from functools import cache

import numpy as np
import pytest

import capslip
from capslip.caps.table import CapFlag
from scenes import caps_map

SHAPE, PIXEL_M, MARGIN = (200, 300), (2e-4, 2e-4), 20
MIDDLE_M = (0.03, 0.02)
CUT = [(0.0597, 0.013, 20.0, 0.0), (3e-4, 0.031, 20.0, -1e-8)]  # apexes 0.3 mm inside an edge
WHOLE = [
    (0.012 + 0.012 * (k % 4), 0.007 + 0.013 * (k // 4), 20.0, -1e-8 * (5 * k % 4))
    for k in range(12)
]


def face_m(hills):
    noise_m = np.random.default_rng(3).normal(0.0, 2e-10, SHAPE)
    return caps_map(hills, SHAPE, PIXEL_M, floor_m=-4e-7).height_m + noise_m


def analysed(height_m, *words):
    words = ("contact.preload_N=300", "contact.time_limit_s=60", *words)
    settings = capslip.load_settings(overrides=words)
    return capslip.analyze(capslip.HeightMap(height_m, PIXEL_M), settings)


@cache
def of_the_map(cut):
    return analysed(face_m((*CUT[:cut], *WHOLE)))


def at_ends(analysis):
    return np.count_nonzero(analysis.caps.flags & CapFlag.edge)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize(("cut", "non_measured"), [(0, "void"), (1, "unknown"), (2, "void")])
def test_a_margin_that_was_not_measured_changes_no_answer(cut, non_measured):
    around_m = np.pad(face_m((*CUT[:cut], *WHOLE)), MARGIN, constant_values=np.nan)
    whole, within = of_the_map(cut), analysed(around_m, f"joint.non_measured={non_measured}")
    assert whole.contact.rung.made_from == ("map" if cut else "spheres")
    assert within.contact.rung.name == whole.contact.rung.name
    assert at_ends(whole) == cut
    assert np.array_equal(within.caps.flags, whole.caps.flags)
    for name in ("tangential_stiffness_N_per_m", "energy_J", "slip_force_N"):
        assert getattr(within.answer, name) == pytest.approx(getattr(whole.answer, name), rel=2e-4)
        interval = whole.band.interval.get(name)
        if interval is not None:
            assert within.band.interval[name] == pytest.approx(interval, rel=5e-4)
    # Places are those of the map that was given
    move_m = MARGIN * PIXEL_M[0]
    assert within.caps.x_m == pytest.approx(whole.caps.x_m + move_m, rel=1e-6)
    assert within.caps.y_m == pytest.approx(whole.caps.y_m + move_m, rel=1e-6)
    expected = np.add(whole.contact.load_point_m, move_m)
    assert within.contact.load_point_m == pytest.approx(expected, rel=1e-9)


@pytest.mark.long
def test_the_choice_sees_where_the_rim_of_a_disc_cuts_a_contact():
    y_m, x_m = (np.mgrid[: SHAPE[0], : SHAPE[1]] + 0.5) * PIXEL_M[0]
    beyond = np.hypot(x_m - MIDDLE_M[0], y_m - MIDDLE_M[1]) > 0.0198
    hills = [(0.03 + 0.0105 * i, 0.02 + 0.0105 * j, 20.0, -1e-8 * (i * j + 1))
             for i in (-1, 0, 1) for j in (-1, 0, 1)]  # fmt: skip
    rim = (0.03 + 0.0196 * np.cos(0.9), 0.02 + 0.0196 * np.sin(0.9), 20.0, 0.0)
    models = []
    for more in ([], [rim]):
        found = analysed(np.where(beyond, np.nan, face_m([*hills, *more])))
        models.append(found.contact.rung.made_from)
        assert at_ends(found) == len(more)
    assert models == ["spheres", "map"]
