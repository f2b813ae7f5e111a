"""Sets of caps at once: what each of them is when it is pressed and sheared alone."""

from dataclasses import replace

import numpy as np
import pytest
from contact_cases import E_STAR_PA, scene_of, table

from capslip.contact.balanced import rebalanced
from capslip.contact.flattening import flattened
from capslip.contact.material import yield_law
from capslip.contact.models.interacting import RUNG, interacting
from capslip.contact.moved import moved_caps
from capslip.contact.rung import turning_stiffness
from capslip.contact.solvers.balance import press, press_sets
from capslip.contact.solvers.shear import shear
from capslip.errors import ContactError
from capslip.settings import load_settings

PRELOAD_N, SIDE_M = 300.0, (0.04, 0.06)
WAYS = {
    "balanced": (),
    "as levelled": ("contact.alignment=as_levelled",),
    "held": ("contact.alignment_stiffness_Nm_per_rad=1e6",),
    "without pairs": ("contact.model=caps",),
    "yielding": ("material.hardness_Pa=2e8",),
}


def chosen(way):
    given = f"contact.preload_N={PRELOAD_N}"
    return load_settings(overrides=(given, *WAYS[way]))


def face(way):
    """Return a face of twelve caps, of which the last two never touch, and how it is pressed."""
    rng = np.random.default_rng(5)
    x_m, y_m = (np.mgrid[0:4, 0:3].reshape(2, -1) + rng.uniform(0.1, 0.9, (2, 12))) * 0.0133
    height_m = -np.append(rng.uniform(0.0, 1.5e-7, 8), [3.5e-7, 4e-7, 2e-6, 3e-6])
    settings = chosen(way)
    scene = scene_of(table(x_m, y_m, rng.uniform(5.0, 30.0, 12), height_m), PRELOAD_N, SIDE_M)
    point_m = (0.03, 0.02)
    scene = replace(scene, load_point_m=point_m, turning_stiffness=turning_stiffness(settings))
    return replace(scene, law=yield_law(settings.material)), settings, rng


@pytest.mark.parametrize("way", WAYS)
def test_each_set_is_what_it_is_alone(way):
    scene, settings, rng = face(way)
    up_m, wide = 2e-8 * rng.normal(size=(5, 12)), 0.2 * rng.normal(size=(5, 12))
    curve = RUNG.build(flattened(RUNG, scene))
    found = moved_caps(scene, curve, up_m, wide, settings)
    approach_m = found.approach_m(PRELOAD_N)
    drop_N = np.array([0.01, 0.3, 0.9])[:, None] * PRELOAD_N
    sets = zip(up_m, wide, strict=True)
    for at, (up, wider) in enumerate(sets):
        caps = scene.caps.with_columns(
            peak_height_m=scene.caps.peak_height_m + up,
            radius_m=scene.caps.radius_m * np.exp(wider),
        )
        if settings.contact.alignment == "balanced":
            caps, _ = rebalanced(caps, scene.caps, scene.use, scene.load_point_m, settings)
        alone = RUNG.build(flattened(RUNG, replace(scene, caps=caps)))
        d = float(alone.approach_m(PRELOAD_N))
        assert approach_m[at] == pytest.approx(d, rel=1e-10)
        for name in ("withdrawal_m", "loss_integral_at_drop_J"):
            several = getattr(found, name)(approach_m, drop_N)[:, at]
            assert several == pytest.approx(getattr(alone, name)(d, drop_N[:, 0]), rel=1e-9)
        slope = alone.stiffness_N_per_m(d)
        assert found.stiffness_N_per_m(approach_m)[at] == pytest.approx(float(slope), rel=1e-10)


def test_sets_of_a_face_that_turns_have_no_moment():
    scene, settings, rng = face("balanced")
    up_m, wide = 2e-8 * rng.normal(size=(5, 12)), 0.2 * rng.normal(size=(5, 12))
    found = moved_caps(scene, RUNG.build(scene), up_m, wide, settings)
    load_N = found.asperity_loads_N(found.approach_m(PRELOAD_N))
    arm_m = np.stack((scene.caps.x_m, scene.caps.y_m)) - np.array(scene.load_point_m)[:, None]
    assert load_N.sum(axis=1) == pytest.approx(PRELOAD_N, rel=1e-12)
    assert np.abs(load_N @ arm_m.T).max() < 1e-10 * PRELOAD_N * SIDE_M[0]


def test_as_levelled_caps_are_as_high_and_wide_as_they_were_made():
    scene, settings, rng = face("as levelled")
    up_m, wide = 2e-8 * rng.normal(size=(5, 12)), 0.2 * rng.normal(size=(5, 12))
    found = moved_caps(scene, RUNG.build(scene), up_m, wide, settings)
    peak_m = scene.caps.peak_height_m + up_m
    assert found.radius_m == pytest.approx(scene.caps.radius_m * np.exp(wide))
    assert found.depth_m == pytest.approx(peak_m.max(axis=1)[:, None] - peak_m, abs=1e-20)
    with pytest.raises(ContactError, match="known under 300 N; got 299"):
        found.approach_m(299.0)


@pytest.mark.parametrize("start_m", [1e-12, 1e-9, 1e-5])
def test_a_start_far_away_ends_in_the_same_equilibria(start_m):
    scene, _, rng = face("balanced")
    curve = RUNG.build(scene)
    h = scene.depth_m + 3e-8 * rng.normal(size=(3, 12))
    h -= h.min(axis=1, keepdims=True)
    k = np.broadcast_to(curve.coefficient, h.shape)
    C, g = curve.pair_compliance_m_per_N, np.full(h.shape, start_m)
    arm_m = np.column_stack((scene.caps.x_m, scene.caps.y_m)) - scene.load_point_m
    level_m, slope, found_m = press_sets(k, h, C, g, PRELOAD_N, arm_m, 0.0)
    for at in range(3):
        rest = press(k[at], h[at], C, np.full(12, 1e-7), PRELOAD_N, None, arm_m, 0.0)
        assert level_m[at] == pytest.approx(rest.level_m, rel=1e-10)
        assert slope[at] == pytest.approx(np.array(rest.slope), rel=1e-9, abs=1e-14)
        assert found_m[at] == pytest.approx(rest.compression_m, rel=1e-9, abs=1e-17)


def test_sets_that_are_at_rest_are_solved_for_no_further_step(monkeypatch):
    scene, _, _ = face("balanced")
    curve = RUNG.build(scene)
    k, h, C = curve.coefficient[None], scene.depth_m[None], curve.pair_compliance_m_per_N
    level_m, _, g = press_sets(k, h, C, np.full(h.shape, 1e-7), PRELOAD_N)
    solved, solve = [], np.linalg.solve
    monkeypatch.setattr(np.linalg, "solve", lambda *of: solved.append(of) or solve(*of))
    again_m, _, _ = press_sets(k, h, C, g, PRELOAD_N)
    assert again_m == pytest.approx(level_m, rel=1e-12)
    assert len(solved) == 2  # contacts and plane, once: the level is not handed on


def test_contacts_of_several_sets_are_sheared_as_each_alone():
    """One set lacks a contact that the others have."""
    rng = np.random.default_rng(2)
    x_m, y_m = np.array([0.0, 0.01, 0.02, 0.0]), np.array([0.0, 0.0, 0.01, 0.02])
    k = 4 / 3 * E_STAR_PA * np.sqrt(rng.uniform(5.0, 30.0, (3, 4)))
    g = rng.uniform(1e-8, 2e-7, (3, 4))
    g[1, 2] = -1e-8
    C = interacting(np.ones(4), np.zeros(4), x_m, y_m, E_STAR_PA).pair_compliance_m_per_N
    goal = 0.6 * (k * np.maximum(g, 0.0) ** 1.5).sum(axis=1)
    e, x = shear(k, C, g, goal, (0.0, 1.0))
    for at in range(3):
        on = g[at] > 0.0
        one = shear(k[at, on], C[np.ix_(on, on)], g[at, on], goal[at : at + 1], (0.0, 1.0))
        assert e[at] == pytest.approx(one[0][0], rel=1e-12)
        assert x[at, on] == pytest.approx(one[1][0], rel=1e-10)
        assert (x[at, ~on] == 0.0).all()
