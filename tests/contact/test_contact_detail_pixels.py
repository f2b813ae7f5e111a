"""What pixels leave of a face that yields: the same on every other of its pixels."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip.contact import map_accuracy
from capslip.contact.map_accuracy import PIXELS_95, error_of_map
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.solvers import detail, path
from capslip.contact.solvers.elastic_face import elastic_face
from capslip.contact.solvers.unloading import Unloading
from capslip.errors import ContactError, OutOfTimeError
from capslip.surface.heightmap import HeightMap

E, LOAD_N, TOLERANCE = 115e9, 1.0, 0.05
FINER = 3  # pixels of a half of every other one


def waves(seed, n=132, pixel_m=1e-6):
    """Return a face whose shortest wave of note has thirty pixels."""
    z = gaussian_filter(np.random.default_rng(seed).normal(size=(n, n)), 9, mode="wrap")
    return HeightMap(1e-7 * z / z.std(), (pixel_m, pixel_m))


def pixels_of(surface, every):
    """Return the face on pixels that are larger, as an instrument samples it."""
    size_m = every * surface.pixel_size_m[0]
    return HeightMap(surface.height_m[every // 2 :: every, every // 2 :: every], (size_m, size_m))


@pytest.fixture
def on_pixels(monkeypatch):
    """No face is refined, as those that a spline does not know."""
    monkeypatch.setattr(path, "refinement", lambda *_: 1)


def solved(surface, hardness_Pa=0.8e9):
    curve = boundary_elements(surface, E, preload_N=LOAD_N, hardness_Pa=hardness_Pa)
    curve.unloading(LOAD_N)
    return curve


def at_asked_forces(surface):
    """Return the curve of a face that is followed at the forces asked for alone."""
    curve = boundary_elements(surface, E, preload_N=LOAD_N, hardness_Pa=0.8e9)
    return curve.at_forces(detail.FORCE_SHARES)


@cache
def of_half(hardness_Pa=0.8e9):
    """Return the curve of a face on every other pixel: for tests on pixels alone."""
    return solved(pixels_of(waves(2), 2), hardness_Pa)


@cache
def asked_of_half():
    return asked(at_asked_forces(pixels_of(waves(1), 2)))


def asked(curve):
    unloading = curve.unloading(LOAD_N)
    return curve.first, unloading, 1e-6, curve.pressed(LOAD_N).pressure_Pa


def test_every_other_pixel_is_that_of_the_face():
    face = elastic_face(waves(0, 40), E)
    face = replace(face, measured=face.depth_m < np.quantile(face.depth_m, 0.9))
    for every_other in (np.s_[::2, ::2], np.s_[1::2, ::2]):
        thin = detail._thinned(face, every_other)
        assert thin.pixel_size_m == (2e-6, 2e-6)
        assert thin.half_space.shape == thin.shape == (20, 20)
        np.testing.assert_array_equal(thin.measured, face.measured[every_other])
        same = (thin.depth_m - face.depth_m[every_other])[thin.measured]
        assert np.ptp(same) < 1e-20
        assert thin.depth_m[thin.measured].min() == 0.0
        assert not thin.depth_m[~thin.measured].any()


def test_a_map_that_lies_another_way_is_thinned_to_the_same(monkeypatch):
    """Of the four maps of every other pixel, a mirrored one has the other two in the corners."""
    face, loss_J = elastic_face(waves(1, 40), E), np.ones(len(detail.FORCE_SHARES))
    pressed = detail.FirstLoading(face, 1e-7)  # whatever has turns
    monkeypatch.setattr(detail, "press", lambda *_, **__: pressed)
    monkeypatch.setattr(detail, "_loss_J", lambda _: loss_J)
    monkeypatch.setattr(
        detail, "_below", lambda one, *_: (None, loss_J * (1.0 + 1e6 * one.depth_m.mean()))
    )
    unloading = SimpleNamespace(load_N=LOAD_N, refinement=1, cut_short=False)

    def effect(turn):
        maps = {name: turn(getattr(face, name)) for name in ("depth_m", "measured")}
        first = detail.FirstLoading(replace(face, **maps), 1e-7)
        return detail.effect_of_pixels(first, unloading, 1e-6, np.zeros(face.shape))

    as_it_lies = effect(np.array)
    for turn in (np.fliplr, np.flipud, np.transpose, np.rot90):
        assert effect(turn) == pytest.approx(as_it_lies, rel=1e-9)


@pytest.mark.long
def test_both_thinned_maps_count_as_the_root_of_their_mean_square(monkeypatch):
    given = asked_of_half()
    below, of_each = detail._below, []

    def kept(*given):
        found = below(*given)
        of_each.append(found[1])
        return found

    monkeypatch.setattr(detail, "_below", kept)
    found = detail.effect_of_pixels(*given)
    before = detail._loss_J(given[1])
    moved = [np.abs(one - before) / np.maximum(one, before) for one in of_each]
    assert len(moved) == 2
    assert not np.allclose(*moved)
    expected = np.sqrt(0.5 * (moved[0] ** 2 + moved[1] ** 2))
    for i in range(1, len(expected)):  # of metal no less than two thirds of what it was before
        expected[i] = max(expected[i], 2.0 / 3.0 * expected[i - 1])
    assert list(found.values()) == pytest.approx(expected)
    assert tuple(found) == detail.FORCE_SHARES


@pytest.mark.long
@pytest.mark.usefixtures("on_pixels")
def test_energies_of_faces_that_yield_are_within_what_is_said_of_their_pixels():
    """Against a third of the pixels; the ring of a smooth contact alone says too little."""
    off, said, ring = [], [], []
    for seed in range(3):
        fine = waves(seed)
        curve, truth = solved(pixels_of(fine, FINER)), at_asked_forces(fine)
        assert curve.solutions.face.yielded
        errors, _ = error_of_map(curve, LOAD_N, TOLERANCE)
        unloading = curve.unloading(LOAD_N)
        off.append(detail._relative(*(detail._loss_J(one.unloading(LOAD_N))
                                      for one in (curve, truth))))  # fmt: skip
        said.append([errors.energy_at(share) for share in detail.FORCE_SHARES])
        ring.append([
            max(PIXELS_95[at] * unloading.pixel_error(at * LOAD_N), 0.01)
            for at in detail.FORCE_SHARES
        ])  # fmt: skip
    assert np.mean(np.array(off) <= said) >= 0.9
    assert np.mean(np.array(off) <= ring) < 0.9
    assert np.median(np.array(said) / np.maximum(off, 0.003)) < 8.0


@pytest.mark.usefixtures("on_pixels")
@pytest.mark.parametrize(("hardness_Pa", "most"), [(0.8e9, 1), (1e12, np.inf)])
def test_flats_on_pixels_are_compared_with_flats_on_pixels(hardness_Pa, most, monkeypatch):
    """A spline tells what larger pixels leave of elastic contacts, which are wide, by itself."""
    given = asked(of_half(hardness_Pa))
    below, finest = detail._below, []
    if hardness_Pa > 1e11:
        face = replace(given[0].face, hardness_Pa=np.inf)
        given = (replace(given[0], face=face), *given[1:])

    def kept(*args):
        finest.append(args[3])
        return below(*args)

    monkeypatch.setattr(detail, "_below", kept)
    detail.effect_of_pixels(*given)
    assert finest == [most, most]


@pytest.mark.long
def test_energies_of_refined_flats_are_nearer_and_within_what_half_the_points_tell():
    """Against a third of the pixels, refined as well; half of mu N was 7 to 50 % off on pixels."""
    fine = waves(4)
    curve, truth = solved(pixels_of(fine, FINER)), at_asked_forces(fine)
    unloading, finer = (replace(one, as_solved=True).unloading(LOAD_N) for one in (curve, truth))
    assert curve.solutions.face.yielded
    assert unloading.refinement > 1
    errors, _ = error_of_map(curve, LOAD_N, TOLERANCE)
    off = detail._relative(detail._loss_J(unloading), detail._loss_J(finer))
    said = np.array([errors.energy_at(share) for share in detail.FORCE_SHARES])
    stiffness = unloading.stiffness_N_per_m / finer.stiffness_N_per_m
    assert stiffness == pytest.approx(1.0, abs=0.003)
    assert errors.stiffness < TOLERANCE
    assert (off < (0.035, 0.06, 0.02, 0.03)).all()
    assert (off <= said).all()
    assert np.median(said / np.maximum(off, 0.003)) < 8.0


@pytest.mark.usefixtures("on_pixels")
def test_pixels_of_flats_count_where_they_are_more_and_a_load_has_left_any(monkeypatch):
    told = dict(zip(detail.FORCE_SHARES, (2.0, 0.8, 0.6, 0.4), strict=True))
    monkeypatch.setattr(map_accuracy, "effect_of_pixels", lambda *_: told)
    errors, problems = error_of_map(of_half(), LOAD_N, TOLERANCE)
    for share, error in told.items():
        assert errors.energy_at(share) == pytest.approx(error, rel=1e-3)
    assert errors.energy_at(1.0) == pytest.approx(0.4, rel=1e-3)
    (one,) = (one for one in problems if one.code == "small_slip_extrapolated")
    as_share = pytest.approx(np.expm1(0.8), rel=1e-3)  # of that logarithm
    assert (one.severity, one.effect.energy) == ("warning", as_share)
    elastic, _ = error_of_map(of_half(1e12), LOAD_N, TOLERANCE)
    assert elastic.energy_at(0.75) < 0.1


@pytest.mark.usefixtures("on_pixels")
def test_a_few_points_that_let_go_leave_what_others_tell_of_metal(monkeypatch):
    """The rule of spheres, which have rings of points, says any factor for a few."""
    monkeypatch.setattr(Unloading, "pixel_error", lambda *_: 5.0)
    for told, most in ((0.4, 1.0), (1.7, 1.7)):
        by_others = dict.fromkeys(detail.FORCE_SHARES, told)
        monkeypatch.setattr(map_accuracy, "effect_of_pixels", lambda *_, by=by_others: by)
        errors, _ = error_of_map(of_half(), LOAD_N, TOLERANCE)
        assert errors.energy_at(0.25) == pytest.approx(most, rel=0.01)
        assert errors.energy_at(0.1) == pytest.approx(most, rel=0.01)
    monkeypatch.setattr(map_accuracy, "effect_of_pixels", lambda *_: {})  # nothing else tells
    errors, _ = error_of_map(of_half(), LOAD_N, TOLERANCE)
    assert errors.energy_at(0.25) == pytest.approx(PIXELS_95[0.25] * 5.0, rel=1e-3)


@pytest.mark.long
def test_a_thinned_map_that_does_not_carry_the_load_tells_nothing(monkeypatch):
    given = asked_of_half()

    def fails(error):
        def press(*_, **__):
            raise error("too much")

        return press

    monkeypatch.setattr(detail, "press", fails(ContactError))
    assert detail.effect_of_pixels(*given) == {}
    monkeypatch.setattr(detail, "press", fails(OutOfTimeError))
    with pytest.raises(OutOfTimeError):
        detail.effect_of_pixels(*given)


def ridge(offset, finer=1, shape=(33, 61), pixel_m=1e-6):
    """Return a ridge along the rows, so many pixels off the middle: its edges let go row by row."""
    y_m, x_m = (
        pixel_m * ((np.arange(n * finer) + 0.5) / finer - 0.5 * n - off)
        for n, off in zip(shape, (offset, 0.0), strict=True)
    )
    height_m = -(y_m[:, None] ** 2) / 8e-4 - 2e-9 * (x_m / 24e-6) ** 4
    return HeightMap(height_m, (pixel_m / finer,) * 2)


@pytest.mark.long
@pytest.mark.parametrize(("load_N", "refined"), [(0.1, True), (1.0, False)])
def test_energies_of_a_ridge_along_the_rows_are_within_what_is_said_of_its_pixels(load_N, refined):
    """Wherever it lies between the rows; the ring of round contacts says less than they are off."""

    def energy_of(surface):
        curve = boundary_elements(surface, E, preload_N=load_N)
        unloading = curve.unloading(load_N)
        assert (unloading.refinement > 1) == (refined and surface.shape[0] == 33)
        return curve, detail._loss_J(unloading, (0.25,))[0]

    _, true_J = energy_of(ridge(0.13, 5))
    off, said, ring = [], [], []
    for offset in (0.0, 0.0833, 0.1667, 0.25, 0.3333):
        curve, energy_J = energy_of(ridge(offset))
        off.append(abs(energy_J / true_J - 1.0))
        said.append(error_of_map(curve, load_N, TOLERANCE)[0].energy_at(0.25))
        drop_N = 0.25 * load_N
        ring.append(PIXELS_95[0.25] * curve.unloading(load_N).pixel_error(drop_N))
    assert np.all(np.array(off) <= 1.1 * np.array(said))
    assert max(off) > 1.5 * max(ring)
