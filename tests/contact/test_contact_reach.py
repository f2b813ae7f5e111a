"""The caps that can touch: none is missing, and few are taken in vain."""

import numpy as np
import pytest
from contact_cases import E_STAR_PA, table

from capslip.caps.table import CapFlag
from capslip.contact import reach as module
from capslip.contact.models.interacting import interacting
from capslip.contact.reach import reachable
from capslip.surface.heightmap import HeightMap

FACE, PRELOAD_N = HeightMap(np.zeros((4, 6)), (0.1, 0.1)), 100.0
PLACES = [(0.1, 0.1), (0.1, 0.5), (0.3, 0.3), (0.2, 0.2), (0.2, 0.4), (0.35, 0.1)]


def at_depths(*depth_m, places=PLACES):
    y_m, x_m = np.array(places[: len(depth_m)]).T
    return table(x_m, y_m, np.full(len(depth_m), 20.0), 1e-6 - np.array(depth_m))


def reach(caps):
    return reachable(caps, FACE, E_STAR_PA, PRELOAD_N)


def test_caps_down_to_a_quarter_more_than_the_approach_are_kept():
    approach_m = float(reach(at_depths(0.0, 0.0, 0.0)).mean.approach_m(PRELOAD_N))
    lower_m = np.array([1.24, 1.26, 2.0]) * approach_m
    found = reach(at_depths(0.0, 0.0, 0.0, *lower_m))
    assert found.use.tolist() == [True, True, True, True, False, False]
    assert found.curve is found.pairs
    assert len(found.pairs.radius_m) == 4
    assert float(found.mean.approach_m(PRELOAD_N)) == pytest.approx(approach_m)


def test_a_cap_without_a_sphere_neither_counts_nor_carries():
    caps = at_depths(-1e-6, 0.0, 0.0, 0.0)
    flags = np.array([CapFlag.not_convex, 0, 0, 0], dtype=np.uint16)
    found = reach(caps.with_columns(flags=flags))
    assert found.use.tolist() == [False, True, True, True]
    assert found.pairs.depth_m.tolist() == [0.0, 0.0, 0.0]


def test_where_neighbours_sink_a_cap_further_than_on_average_more_are_asked():
    """Caps side by side on a wide face: the mean field knows little of what they do."""
    places = [(0.1, 0.1), (0.1, 0.105), (0.105, 0.1), (0.105, 0.105), (0.3, 0.5)]
    mean_m = float(reach(at_depths(*[0.0] * 4, 1.0, places=places)).mean.approach_m(PRELOAD_N))
    caps = at_depths(*[0.0] * 4, 1.3 * mean_m, places=places)
    depth_m = caps.peak_height_m.max() - caps.peak_height_m
    every = interacting(caps.radius_m, depth_m, caps.x_m, caps.y_m, E_STAR_PA, PRELOAD_N)
    assert every.asperity_loads_N(every.approach_m(PRELOAD_N))[4] > 0.0
    found = reach(caps)
    assert found.use.all()
    assert float(found.curve.approach_m(PRELOAD_N)) == float(every.approach_m(PRELOAD_N))


@pytest.mark.parametrize(("most", "solved"), [(3, True), (2, False)])
def test_too_many_caps_are_left_to_the_mean_field(most, solved, monkeypatch):
    monkeypatch.setattr(module, "MAX_INTERACTING", most)
    found = reach(at_depths(0.0, 0.0, 0.0, 1e-3))
    assert (found.pairs is not None) == solved
    assert found.curve is (found.pairs if solved else found.mean)
    assert found.use.tolist() == [True, True, True, not solved]
