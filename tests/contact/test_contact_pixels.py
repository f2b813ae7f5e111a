"""Pixels in contact alone, each with each: the same as the whole map."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.analysis import analyze_once
from capslip.contact.solvers import path as paths
from capslip.contact.solvers import pixels
from capslip.contact.solvers.elastic_face import elastic_face
from capslip.contact.solvers.patches import patched
from capslip.contact.solvers.path import Path
from capslip.contact.solvers.pixels import around_contact, fewer, in_contact_alone, pixels_alone
from capslip.contact.solvers.polonsky_keer import press
from capslip.contact.solvers.unloading import unload
from capslip.settings import load_settings
from capslip.surface.heightmap import HeightMap

E_STAR_PA = 110e9


@pytest.fixture(scope="module")
def rough():
    height_m = np.random.default_rng(3).normal(0, 1e-7, (90, 130))
    return elastic_face(HeightMap(height_m, (2e-6, 3e-6)), E_STAR_PA)


@pytest.fixture(scope="module")
def pressed(rough):
    return press(rough, load_N=5.0, tolerance=1e-10)


def test_they_sink_as_on_the_map(rough, pressed):
    few = pixels_alone(rough, pressed.pressure_Pa > 0, None)
    assert few.shape == (np.count_nonzero(pressed.pressure_Pa),)
    sinking_m = few.half_space.sinking_m(few.gathered(pressed.pressure_Pa))
    expected_m = few.gathered(rough.half_space.sinking_m(pressed.pressure_Pa))
    np.testing.assert_allclose(sinking_m, expected_m, rtol=1e-12)
    assert np.array_equal(few.spread(few.gathered(pressed.pressure_Pa)), pressed.pressure_Pa)
    x, y = few.places_m
    i, j = np.nonzero(pressed.pressure_Pa)
    np.testing.assert_allclose((x, y), ((j + 0.5) * 3e-6, (i + 0.5) * 2e-6), rtol=1e-12)


def test_they_unload_as_the_map_does(rough, pressed, monkeypatch):
    monkeypatch.setattr(pixels, "patched", lambda *given: None)
    alone, whole = (unload(rough, pressed, 1e-8, on_patches=one) for one in (True, False))
    assert alone.patch_error > 0.0  # the map was asked what it says of them
    assert whole.patch_error == 0.0
    assert alone.stiffness_N_per_m == pytest.approx(whole.stiffness_N_per_m, rel=1e-6)
    loss_J = np.interp(alone.withdrawal_m, whole.withdrawal_m, whole.loss_J)
    np.testing.assert_allclose(alone.loss_J[200:], loss_J[200:], rtol=1e-3)


def test_too_many_are_no_less_work_than_the_map(rough):
    assert pixels_alone(rough, np.ones(rough.shape, dtype=bool), None) is None


@pytest.mark.parametrize("seed", range(8))
def test_patches_that_are_not_looked_at_would_not_have_been_taken(rough, seed, monkeypatch):
    """What is within the margin of a contact is in patches, however they are cut."""
    rng = np.random.default_rng(seed)
    contact = rng.random(rough.shape) < 10 ** rng.uniform(-3.0, -0.5)
    contact &= np.hypot(*np.indices(rough.shape)) < rng.uniform(30.0, 200.0)  # up to two edges
    contact[3, 4] = True
    quick = around_contact(rough, contact)
    monkeypatch.setattr(pixels, "with_margin", np.zeros_like)
    careful = around_contact(rough, contact)
    if quick is None or careful is None:
        assert quick is careful
    else:
        assert quick.half_space.cost == careful.half_space.cost
        assert np.array_equal(quick.parent, careful.parent)


def test_a_tile_is_inverted_exactly(rough):
    """All pixels in one tile: what sinks them follows from how they sink."""
    contact = np.zeros(rough.shape, dtype=bool)
    contact[33:47, 18:31] = np.random.default_rng(5).random((14, 13)) < 0.4
    few = pixels_alone(rough, contact, None)
    pressure_Pa = np.random.default_rng(6).random(few.shape)
    sinking_m = few.half_space.sinking_m(pressure_Pa)
    np.testing.assert_allclose(
        few.half_space.pressure_Pa(sinking_m, np.arange(len(sinking_m))), pressure_Pa, rtol=1e-8
    )


@pytest.mark.parametrize("refined", [1, 2])
def test_points_in_contact_alone_sink_as_on_the_patches_they_are_of(rough, refined):
    contact = np.zeros(rough.shape, dtype=bool)
    contact[20:26, 30:41] = contact[70:75, 100:104] = True
    patches = patched(rough, contact, refined)
    rng = np.random.default_rng(7)
    pressure_Pa = np.where(rng.random(patches.shape) < 0.3, rng.random(patches.shape), 0.0)
    few, at = in_contact_alone(patches, pressure_Pa), np.flatnonzero(pressure_Pa)
    expected_m = patches.half_space.sinking_m(pressure_Pa)[at]
    for _ in range(2):  # nothing is left over from the first time
        assert np.array_equal(few.half_space.sinking_m(pressure_Pa[at]), expected_m)
    assert np.array_equal(few.spread(pressure_Pa[at]), patches.spread(pressure_Pa))
    assert np.array_equal(few.depth_m, patches.depth_m[at])
    assert in_contact_alone(few, np.ones(few.shape)) is few


@pytest.mark.parametrize("refined", [1, 3])
def test_what_touches_alone_needs_no_margin_around_it(rough, refined):
    """Boxes that end where the contact does are less work, and it sinks in them as in the wider."""
    contact = np.zeros(rough.shape, dtype=bool)
    contact[20:32, 30:41] = contact[60:75, 100:115] = True
    patches = patched(rough, contact, refined)
    points = np.flatnonzero(patches.gathered(contact))
    few = in_contact_alone(patches, patches.gathered(contact.astype(float)))
    assert few.half_space.cost < 0.7 * patches.half_space.cost
    pressure_Pa = np.zeros(patches.shape)
    pressure_Pa[points] = np.random.default_rng(8).random(len(points))
    expected_m = patches.half_space.sinking_m(pressure_Pa)[points]
    sinking_m = few.half_space.sinking_m(pressure_Pa[points])
    np.testing.assert_allclose(sinking_m, expected_m, rtol=2e-6)


def test_lines_and_single_points_that_touch_sink_as_on_the_map(rough, monkeypatch):
    contact = np.zeros(rough.shape, dtype=bool)
    contact[10, 20:30] = contact[40:52, 90] = contact[75, 30] = contact[60:68, 40:45] = True
    monkeypatch.setattr(pixels, "_WORTH", np.inf)
    patches = patched(rough, contact)
    pressure_Pa = np.where(contact, np.random.default_rng(9).random(rough.shape), 0.0)
    few = in_contact_alone(patches, patches.gathered(pressure_Pa))
    assert few.half_space.cost < patches.half_space.cost
    given_Pa = few.gathered(pressure_Pa)
    expected_m = few.gathered(rough.half_space.sinking_m(pressure_Pa))
    np.testing.assert_allclose(few.half_space.sinking_m(given_Pa), expected_m, rtol=2e-6)
    assert (
        float(given_Pa @ few.half_space.pressure_Pa(given_Pa, np.arange(len(given_Pa)))) > 0.0
    )  # it preconditions


@pytest.mark.parametrize("kind", ["matrix", "patches", "refined patches", "map"])
def test_fewer_points_sink_as_all_of_them(rough, kind, monkeypatch):
    """What is left of contacts, at their own places, whatever the half-space of them all was."""
    contact = np.zeros(rough.shape, dtype=bool)
    contact[3:20, 5:30] = contact[60:85, 90:125] = contact[10:14, 100:103] = True
    if kind == "matrix":
        whole = pixels_alone(rough, contact, None)
    elif kind == "map":
        whole = in_contact_alone(rough, contact.astype(float))
    else:
        patches = patched(rough, contact, 2 if "refined" in kind else 1)
        whole = in_contact_alone(patches, patches.gathered(contact.astype(float)))
        monkeypatch.setattr(pixels, "_FEW", 0)
        monkeypatch.setattr(pixels, "_QUICK", 0)
    x_m, y_m = whole.places_m
    left = np.flatnonzero(np.hypot(x_m - 320e-6, y_m - 145e-6) + 1e-6 * np.sin(1e9 * x_m) < 25e-6)
    few = fewer(whole, left)
    assert few.half_space.cost < 0.7 * whole.half_space.cost
    pressure_Pa = np.zeros(whole.shape)
    pressure_Pa[left] = np.random.default_rng(4).random(len(left))
    expected_m = whole.half_space.sinking_m(pressure_Pa)[left]
    np.testing.assert_allclose(few.half_space.sinking_m(pressure_Pa[left]), expected_m, rtol=1e-6)
    roughly_m = few.half_space.sinking_roughly_m(pressure_Pa[left])
    np.testing.assert_allclose(roughly_m, expected_m, rtol=1e-5)
    for found, given in zip(few.places_m, whole.places_m, strict=True):
        assert np.array_equal(found, given[left])


def test_small_patches_stay_as_they_are_around_fewer_points(rough):
    contact = np.zeros(rough.shape, dtype=bool)
    contact[60:75, 90:110] = True
    patches = patched(rough, contact, 2)
    whole = in_contact_alone(patches, patches.gathered(contact.astype(float)))
    left = np.arange(0, whole.depth_m.size, 7)
    few = fewer(whole, left)
    assert few.half_space.cost == whole.half_space.cost
    pressure_Pa = np.zeros(whole.shape)
    pressure_Pa[left] = np.random.default_rng(4).random(len(left))
    expected_m = whole.half_space.sinking_m(pressure_Pa)[left]
    np.testing.assert_allclose(few.half_space.sinking_m(pressure_Pa[left]), expected_m, rtol=1e-12)
    assert np.array_equal(few.depth_m, whole.depth_m[left])


def test_loads_that_fewer_points_carry_are_those_of_all(rough, pressed, monkeypatch):
    shares = (0.3, 0.6, 0.9, 0.97, 0.8)
    alone = Path(rough, pressed, 1e-8, True)
    nodes = [alone.at(share) for share in shares]
    sizes = [len(points) for points, _ in alone._faces]
    assert len(sizes) > 2
    assert sizes[-1] < 0.4 * sizes[0]
    monkeypatch.setattr(paths, "_SHRUNK", 0.0)
    whole = Path(rough, pressed, 1e-8, True)
    for share, node in zip(shares, nodes, strict=True):
        expected = whole.at(share)
        assert node.withdrawal_m == pytest.approx(expected.withdrawal_m, rel=1e-6)
        loss_J = expected.region_loss_J.sum()
        assert node.region_loss_J.sum() == pytest.approx(loss_J, rel=1e-4)
        assert np.array_equal(node.contact, expected.contact)


def test_a_point_that_was_left_out_wrongly_is_noticed(rough, pressed):
    """All are solved then; so a face of too few points costs time and no accuracy."""
    path, expected = (Path(rough, pressed, 1e-8, True) for _ in range(2))
    path.at(0.3)
    contact, pressure_Pa = (
        each[::2] for each in (path.nodes[0].contact, path.nodes[0].pressure_Pa)
    )
    path.nodes[0] = replace(path.nodes[0], contact=contact, pressure_Pa=pressure_Pa)
    expected.at(0.3)
    one, other = path.at(0.6), expected.at(0.6)
    assert np.array_equal(one.contact, other.contact)
    assert one.withdrawal_m == pytest.approx(other.withdrawal_m, rel=1e-6)


@pytest.mark.parametrize("lines", [3, 7])
def test_a_map_of_few_lines_is_pressed_as_it_lies_or_turned(lines):
    """No difference of a high order fits across it, nor a cubic on three points."""
    height_m = 1e-8 * np.random.default_rng(3).standard_normal((lines, 150)).cumsum(axis=1)
    settings = load_settings(overrides=("contact.preload_N=460",))
    lies, turned = (
        analyze_once(HeightMap(one_m, (4e-4, 4e-4)), settings) for one_m in (height_m, height_m.T)
    )
    assert lies.contact.rung.made_from == "map"
    assert lies.answer.energy_J == pytest.approx(turned.answer.energy_J, rel=1e-6)
    assert lies.contact.approach_m == pytest.approx(turned.contact.approach_m, rel=1e-9)
