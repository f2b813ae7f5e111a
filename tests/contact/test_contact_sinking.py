"""How deep contacts that yield sink beside one another: the law of spheres, and closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip.contact.models.boundary_elements import RUNG, boundary_elements
from capslip.contact.solvers.elastic_face import elastic_face
from capslip.contact.solvers.pixels import in_contact_alone
from capslip.contact.solvers.polonsky_keer import press
from capslip.contact.solvers.sinking import sinks_deeper_m, sunk_in
from capslip.contact.solvers.yielding import YieldLaw, first_loading
from capslip.surface.heightmap import HeightMap

E, R_M = 115e9, 2e-3
HERE_M = np.array([0.3, 0.2])  # pixels: no sphere has its top on one


def hertz(load_N, radius_m=R_M):
    """Return contact radius and greatest pressure of an elastic sphere."""
    a_m = np.cbrt(0.75 * load_N * radius_m / E)
    return a_m, 1.5 * load_N / (math.pi * a_m**2)


def spheres(radius_m, top_m, pixel_m, n=72):
    """Return a map of spheres side by side, n pixels apart."""
    y, x = np.mgrid[:n, : n * len(radius_m)] + 0.5
    height_m = np.full(x.shape, -np.inf)
    for i, (R, top) in enumerate(zip(radius_m, top_m, strict=True)):
        r2 = np.square(x - n * (i + 0.5) - HERE_M[0]) + np.square(y - 0.5 * n - HERE_M[1])
        height_m = np.maximum(height_m, top - r2 * pixel_m**2 / (2.0 * R))
    return HeightMap(height_m, (pixel_m, pixel_m))


@pytest.mark.parametrize("balanced", [False, True])
@pytest.mark.parametrize("over", [0.7, 0.9, 1.1, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0, 14.0])
def test_a_sphere_sinks_as_deep_as_jackson_and_green_say(over, balanced):
    """One bound on its pressures is off by 7 % at 1.5, and by 13 to 30 % from 6 on."""
    load_N, radius_m = 2.0, 1.0  # strains are small, as in the finite elements
    a_m, most_Pa = hertz(load_N, radius_m)
    hardness_Pa = most_Pa / over
    law = YieldLaw(hardness_Pa, E, 0.3)
    (deep_m,) = law.approach_m(np.array([load_N]), np.array([radius_m]))
    pixel_m = max(a_m, math.sqrt(load_N / hardness_Pa / math.pi)) / 25.0
    surface = spheres([radius_m], [0.0], pixel_m)
    point_m = tuple((36.0 + HERE_M) * pixel_m)
    curve = boundary_elements(
        *(surface, E), preload_N=load_N, hardness_Pa=hardness_Pa, balanced=balanced,
        load_point_m=point_m,
    )  # fmt: skip
    below_m = -surface.height_m.max()  # the highest point is not the top
    assert curve.first.of_face_m + below_m == pytest.approx(deep_m, rel=0.008)


def two_spheres(over, lower, pixel_m):
    """Return the loads of a sphere and a lower one by the law of caps, and those of their map.

    The lower one stands lower by so much of what the upper one sinks alone, whose p0 / H is given.
    """
    load_N, radius_m = 2.0, np.array([R_M, R_M])
    hardness_Pa = hertz(load_N)[1] / over
    law = YieldLaw(hardness_Pa, E, 0.3)
    depth_m = np.array([0.0, lower * law.approach_m(np.array([load_N]), radius_m[:1])[0]])
    beside = 1.0 / (math.pi * E * 72.0 * pixel_m)
    pairs_m_per_N = np.array([[0.0, beside], [beside, 0.0]])
    given = law, radius_m, depth_m, E, load_N
    caps_N = first_loading(*given, compliance_m_per_N=pairs_m_per_N).load_N
    surface = spheres(radius_m, -depth_m, pixel_m)
    curve = boundary_elements(surface, E, preload_N=load_N, hardness_Pa=hardness_Pa)
    pressure_Pa = curve.pressed(load_N).pressure_Pa
    return caps_N, pressure_Pa.reshape(72, 2, 72).sum(axis=(0, 2)) * pixel_m**2


@pytest.mark.parametrize("lower", [0.3, 0.8])
@pytest.mark.parametrize("over", [1.0, 1.5, 2.5, 4.0])
def test_light_spheres_bear_beside_heavy_ones_what_the_law_of_caps_says(over, lower):
    """By how far the heavy one has sunk, and its p0 / H; a bound alone: 0.2 to 1.5 times that."""
    caps_N, of_map_N = two_spheres(over, lower, 1.5e-6)
    assert of_map_N == pytest.approx(caps_N, rel=0.02)


@pytest.mark.parametrize(("over", "lower"), [(6.0, 0.97), (6.0, 1.05), (8.0, 1.05), (12.0, 1.1)])
def test_what_metal_does_not_reach_bears_nothing(over, lower):
    """Far beyond yield metal sinks less than a bound tells: that is of the contact alone.

    Where all that is nearest of it stood higher with it, tops touched that bore 0.4 to 1 % then.
    """
    caps_N, of_map_N = two_spheres(over, lower, 2.5e-6)
    assert caps_N[1] == 0.0
    assert of_map_N[1] == 0.0


def test_equal_spheres_share_a_load_as_if_none_of_them_sank_deeper():
    """They sink alike, and each bears half."""
    load_N, hardness_Pa = 2.0, hertz(1.0)[1] / 1.5
    surface = spheres([R_M] * 2, [0.0] * 2, 1.5e-6)
    face = replace(elastic_face(surface, E), hardness_Pa=hardness_Pa)
    bounded = press(face, load_N=load_N, tolerance=1e-8)

    def again(face, near):
        return press(face, load_N=load_N, tolerance=1e-8, start_Pa=near.pressure_Pa)

    pressed, sunk = sunk_in(face, bounded, again)
    deeper_m = sunk.deeper_m[pressed.pressure_Pa > 0.0]
    assert deeper_m.min() > 0.0
    assert np.ptp(deeper_m) < 3e-3 * deeper_m.max()
    assert pressed.region_loads_N == pytest.approx(bounded.region_loads_N, rel=2e-3)
    assert pressed.approach_m == pytest.approx(bounded.approach_m, rel=1e-3)
    # The next turn finds the same, and starts from there
    same, known = sunk_in(face, pressed, again, sunk)
    assert same is pressed
    assert known.deeper_m is sunk.deeper_m


def test_what_is_far_from_its_hardness_is_not_pressed_again():
    surface = spheres([R_M], [0.0], 1.5e-6)
    face = replace(elastic_face(surface, E), hardness_Pa=hertz(1.0)[1] / 0.75)
    pressed = press(face, load_N=1.0)
    again = lambda *_: pytest.fail("it is elastic")  # noqa: E731
    assert sunk_in(face, pressed, again) == (pressed, None)


def test_points_alone_sink_as_those_of_their_map_do():
    """What belongs to a contact is told by the grid that they are of, and by what is nearest."""
    surface = spheres([R_M, R_M, 0.5 * R_M], [0.0, -2e-8, 0.0], 1.5e-6)
    face = replace(elastic_face(surface, E), hardness_Pa=hertz(1.0)[1] / 1.5)
    pressed = press(face, load_N=2.0, tolerance=1e-8)
    of_map_m, _ = sinks_deeper_m(face, pressed, np.zeros(face.shape, dtype=int))
    assert len(np.unique(of_map_m[pressed.pressure_Pa > 0.0])) == 3
    alone = in_contact_alone(face, pressed.pressure_Pa + (face.depth_m < 1.5 * pressed.approach_m))
    given = {"pressure_Pa": pressed.pressure_Pa, "gap_m": pressed.gap_m}
    state = replace(pressed, **{name: alone.gathered(one) for name, one in given.items()})
    assert (state.pressure_Pa == 0.0).any()
    of_points_m, _ = sinks_deeper_m(alone, state, np.zeros(alone.shape, dtype=int))
    assert of_points_m == pytest.approx(alone.gathered(of_map_m), rel=1e-12)


@pytest.mark.parametrize("grown", [False, True])
def test_contacts_that_grow_into_one_another_stay_what_they_were(grown):
    """Unlike ones, of which two touch each other in the next turn, and all points alone touch."""
    surface = spheres([R_M, 0.3 * R_M], [0.0, 0.0], 1.5e-6)
    face = replace(elastic_face(surface, E), hardness_Pa=hertz(1.0)[1] / 1.5)
    pressed = press(face, load_N=1.5, tolerance=1e-8)
    of_map_m, contact = sinks_deeper_m(face, pressed, np.zeros(face.shape, dtype=int))
    assert len(np.unique(contact)) == 3
    if grown:  # a bridge that bears next to nothing
        bridge = np.where((np.arange(72) == 36)[:, None] & (pressed.pressure_Pa == 0.0), 1.0, 0.0)
        found = replace(pressed, pressure_Pa=pressed.pressure_Pa + bridge)
        assert found.region.max() == 1
        again_m, _ = sinks_deeper_m(face, found, contact)
        tops = (36, 36), (36, 108)
        assert [again_m[at] for at in tops] == pytest.approx([of_map_m[at] for at in tops], rel=0.3)
        return
    alone = in_contact_alone(face, pressed.pressure_Pa)
    given = {"pressure_Pa": pressed.pressure_Pa, "gap_m": pressed.gap_m}
    state = replace(pressed, **{name: alone.gathered(one) for name, one in given.items()})
    again_m, same = sinks_deeper_m(alone, state, alone.gathered(contact))
    assert (same == alone.gathered(contact)).all()
    assert again_m == pytest.approx(alone.gathered(of_map_m), rel=1e-12)


def test_a_lowered_face_counts_from_its_own_first_touch():
    face = elastic_face(spheres([R_M], [0.0], 1.5e-6, n=8), E)
    assert face.lowered(np.zeros(face.shape)) is face
    lowered = face.lowered(np.where(face.depth_m == 0.0, 1e-7, 2e-8))
    assert lowered.depth_m.min() == 0.0
    assert np.ptp(lowered.depth_m - face.depth_m) == pytest.approx(8e-8, rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_a_rough_face_under_the_same_load_again_is_as_it_was(seed):
    """Its contacts are what they were, and what has not quite settled stays."""
    waves = gaussian_filter(np.random.default_rng(seed).normal(size=(96, 96)), 2.0, mode="wrap")
    surface, load_N = HeightMap(2e-7 * waves / waves.std(), (1e-6, 1e-6)), 1.0
    curve = boundary_elements(surface, E, preload_N=load_N, hardness_Pa=1e9)
    curve = curve.at_forces((0.25, 0.75))
    again = RUNG.after(curve, load_N, 1.0, 1.0)
    known, found = (
        (one.first.of_face_m, float(one.stiffness_N_per_m(one.approach_m(load_N))),
         float(one.loss_integral_at_drop_J(one.approach_m(load_N), 0.25 * load_N)))
        for one in (curve, again)
    )  # fmt: skip
    assert curve.first.deeper.left > 1e-4
    assert found == pytest.approx(known, rel=0.01)


@pytest.mark.long
@pytest.mark.parametrize("hardness_Pa", [math.inf, 3e9])
def test_finer_points_turn_under_a_load_next_to_that_of_the_balance(hardness_Pa):
    """Under a billionth more load a face is what it was; the finer points find its balance."""
    waves = gaussian_filter(np.random.default_rng(7).normal(size=(64, 64)), 3.0, mode="wrap")
    surface, load_N = HeightMap(2e-7 * waves / waves.std(), (1e-6, 1e-6)), 0.05
    curve = boundary_elements(surface, E, preload_N=load_N, hardness_Pa=hardness_Pa, balanced=True)
    more_N = (1.0 + 1e-9) * load_N
    again = curve if math.isinf(hardness_Pa) else RUNG.after(curve, load_N, 1.0 + 1e-9, 1.0)
    known, found = (
        (float(one.stiffness_N_per_m(one.approach_m(N))),
         *one.loss_integral_at_drop_J(one.approach_m(N), np.array([0.25, 0.5, 0.75]) * N))
        for one, N in ((curve, load_N), (again, more_N))
    )  # fmt: skip
    assert curve.tilt_rad != (0.0, 0.0)
    assert curve.unloading(load_N).refinement > 1
    assert found == pytest.approx(known, rel=5e-3)
