"""Steps of boundary elements that are tried, and kernels in single precision."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.contact.solvers import steps
from capslip.contact.solvers.closing import GivenApproach, GivenLoad
from capslip.contact.solvers.patches import PatchedFace, patched
from capslip.contact.solvers.pixels import SINGLE, pixels_alone
from capslip.contact.solvers.polonsky_keer import _state, elastic_face, press
from capslip.surface.heightmap import HeightMap

E, PIXEL_M, LOAD_N = 110e9, 2e-5, 20.0


def rough_face(hardness_Pa=np.inf, shape=(60, 80)):
    """Return a sphere of 0.5 m with a roughness of 20 nm."""
    y, x = (np.mgrid[: shape[0], : shape[1]] - np.reshape(shape, (2, 1, 1)) / 2) * PIXEL_M
    rough_m = 2e-8 * np.random.default_rng(2).normal(size=shape)
    face = elastic_face(HeightMap(-(x**2 + y**2) / 1.0 + rough_m, (PIXEL_M, PIXEL_M)), E)
    return replace(face, hardness_Pa=hardness_Pa) if hardness_Pa < np.inf else face


@pytest.mark.parametrize("goal", [{"load_N": LOAD_N}, {"approach_m": 3e-7}])
@pytest.mark.parametrize("hardness_Pa", [np.inf, 3e8])
def test_steps_that_are_tried_end_where_those_do_that_are_searched(goal, hardness_Pa):
    face = rough_face(hardness_Pa)
    start_Pa = press(face, load_N=0.7 * LOAD_N).pressure_Pa
    tried, searched = (
        press(face, **goal, tolerance=1e-10, start_Pa=start_Pa, sinks_once=once)
        for once in (True, False)
    )
    assert tried.approach_m == pytest.approx(searched.approach_m, rel=1e-8)
    assert tried.load_N == pytest.approx(searched.load_N, rel=1e-8)
    most_Pa = float(searched.pressure_Pa.max())
    np.testing.assert_allclose(tried.pressure_Pa, searched.pressure_Pa, atol=1e-5 * most_Pa)
    assert np.isinf(hardness_Pa) or most_Pa == hardness_Pa


@pytest.mark.parametrize("hardness_Pa", [np.inf, 4e8])
@pytest.mark.parametrize("length", [1e-2, 1.0, 30.0])
def test_a_step_that_is_tried_keeps_load_and_bounds_and_leaves_less_energy(length, hardness_Pa):
    """However long it is tried; its energy is 1/2 p A p + p h, from the sinking by itself."""
    face = rough_face(hardness_Pa)
    half_space, start = face.half_space, press(rough_face(), load_N=LOAD_N)
    closing = GivenLoad(0.8 * LOAD_N / face.pixel_area_m2)
    p = np.minimum(start.pressure_Pa, 0.9 * hardness_Pa)
    p *= closing.total_Pa / p.sum()
    assert p.max() < hardness_Pa
    state = _state(face, p, half_space.sinking_m(p), closing)
    c = steps.moving(face, state, 1e-6 * state.approach_m)
    project = closing.projector(c)
    t = project(half_space.pressure_Pa(project(state.gap_m.reshape(-1)[c]), c))
    stepped, du, following = steps.tried_step(face, state, c, t, length, closing)
    assert stepped.sum() == pytest.approx(p.sum(), rel=1e-12)
    assert stepped.min() >= 0.0
    assert stepped.max() <= hardness_Pa
    exact_m = half_space.sinking_m(stepped - p)
    np.testing.assert_allclose(du, exact_m, atol=1e-5 * np.abs(exact_m).max())
    energy = [
        float((q * (0.5 * half_space.sinking_m(q) + face.depth_m)).sum()) for q in (p, stepped)
    ]
    assert energy[1] < energy[0]
    assert 0.5 <= following / length <= 2.0


def test_a_step_within_the_bounds_is_as_long_as_is_best():
    """Along one direction the energy is a parabola: however short or long the step is tried."""
    face = rough_face()
    half_space, start = face.half_space, press(face, load_N=LOAD_N)
    closing = GivenApproach(start.approach_m)
    p = 0.9 * start.pressure_Pa
    state = _state(face, p, half_space.sinking_m(p), closing)
    c, t = state.contact, -p.reshape(-1)[state.contact]
    found = [steps.tried_step(face, state, c, t, length, closing)[0] for length in (0.01, 0.3)]
    direction = np.zeros(face.shape)
    direction.reshape(-1)[c] = -t
    best = -float((direction * state.gap_m).sum()) / float(
        (direction * half_space.sinking_m(direction)).sum()
    )
    for one in found:
        np.testing.assert_allclose(one, p + best * direction, rtol=1e-5)


def test_single_precision_leaves_a_tenth_of_the_tolerance_it_is_for():
    """Between pixels, and between patches, where the kernel is interpolated anyway."""
    face = rough_face(shape=(120, 160))
    rng = np.random.default_rng(4)
    y, x = np.mgrid[:120, :160]
    around = ((y - 20) ** 2 + (x - 25) ** 2 < 60) | ((y - 90) ** 2 + (x - 130) ** 2 < 90)
    scattered = rng.random(face.shape) < 0.04
    for made, contact in ((pixels_alone, scattered), (patched, around)):
        given = {"patches": None} if made is pixels_alone else {}
        double, single = (made(face, contact, **given, single=one) for one in (False, True))
        assert isinstance(double, PatchedFace)
        p = rng.random(double.shape)
        exact_m, sinking_m = (one.half_space.sinking_m(p) for one in (double, single))
        off = np.abs(sinking_m - exact_m).max() / exact_m.max()
        assert 0.0 < off < 0.1 * SINGLE
