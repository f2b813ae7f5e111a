"""What the filter of the detail leaves and takes, and how what it does is measured."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.contact.solvers import detail
from capslip.contact.solvers.detail import Detail, FirstLoading
from capslip.contact.solvers.elastic_face import elastic_face
from capslip.problems import Effect
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap

Y, X = np.mgrid[:40.0, :50.0]
INSIDE = (slice(4, -4),) * 2


def first(height_m, approach_m=1.0):
    return FirstLoading(elastic_face(HeightMap(height_m, (1.0, 1.0)), 1e11), approach_m)


def change_m(face, smooth):
    """Return by how much heights rose against the one in the corner, which no filter reaches."""
    rise_m = face.depth_m - smooth.depth_m
    return rise_m - rise_m[0, 0]


def test_shapes_of_the_third_degree_and_the_edge_stay_as_they_are():
    x, y = (X - 20.0) / 20.0, (Y - 15.0) / 20.0
    cubic = first(x**3 - 2.0 * x * y**2 + y**2 - x + 0.3 * y**3).face
    assert np.abs(change_m(cubic, detail._smoothed(cubic))).max() < 1e-12
    rough = first(np.random.default_rng(1).random(X.shape)).face
    moved_m = change_m(rough, detail._smoothed(rough))
    assert np.abs(moved_m[INSIDE]).max() > 0.1
    moved_m[INSIDE] = 0.0
    assert np.abs(moved_m).max() < 1e-12


def test_of_a_spike_the_filter_leaves_two_binomials_less_their_square():
    spike = np.zeros(X.shape)
    spike[20, 25] = 1.0
    face = first(spike).face
    left = spike + change_m(face, detail._smoothed(face))
    b = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
    once, twice = np.pad(np.outer(b, b), 2), np.outer(np.convolve(b, b), np.convolve(b, b))
    assert left[16:25, 21:30] == pytest.approx(2.0 * once - twice, abs=1e-12)
    # What that leaves of white noise, and takes off it
    assert np.sqrt(np.square(left).sum()) == pytest.approx(detail.WHITE_LEFT, abs=0.005)
    taken = spike - left
    assert np.sqrt(np.square(taken).sum()) == pytest.approx(detail.WHITE_TAKEN, abs=0.005)


def test_single_lost_points_are_filled_and_holes_are_not():
    lost = np.zeros(X.shape, dtype=bool)
    lost[20, 30] = lost[1, 1] = True
    lost[8:17, 8:17] = True
    face = first(np.where(lost, np.nan, 0.01 * X)).face
    smooth = detail._smoothed(face)
    filled = smooth.measured & ~face.measured
    assert filled[20, 30]
    assert not filled[1, 1]  # at the edge nothing is
    assert not smooth.measured[10:15, 10:15].any()
    assert smooth.depth_m[20, 30] == pytest.approx(face.depth_m[20, 29] - 0.01, abs=1e-9)
    assert (smooth.depth_m[~smooth.measured] == 0.0).all()


@pytest.mark.parametrize("wide", [1, 7])
def test_the_edge_of_what_was_measured_is_that_of_a_map(wide):
    """A rim of lost points changes nothing, and nothing is filled into it."""
    rough = np.random.default_rng(5).random(X.shape)
    alone = first(rough).face
    rimmed = first(np.pad(rough, wide, constant_values=np.nan)).face
    smooth, of_rimmed = detail._smoothed(alone), detail._smoothed(rimmed)
    assert np.array_equal(of_rimmed.measured, rimmed.measured)
    inner = of_rimmed.depth_m[wide:-wide, wide:-wide]
    assert inner == pytest.approx(smooth.depth_m, abs=1e-12)


def test_beside_lost_points_the_filter_weighs_what_there_is():
    rng = np.random.default_rng(4)
    lost = rng.random(X.shape) < 0.2
    face = first(np.where(lost, np.nan, rng.random(X.shape))).face
    b = np.array([1.0, 4.0, 6.0, 4.0, 1.0])

    def mean(values, y, x):
        at = (slice(y - 2, y + 3), slice(x - 2, x + 3))
        weight = np.outer(b, b) * face.measured[at]
        return (weight * values[at]).sum() / weight.sum()

    once = np.zeros(X.shape)
    once[2:-2, 2:-2] = [[mean(face.depth_m, y, x) for x in range(2, 48)] for y in range(2, 38)]
    left = once[20, 10:40] + [mean(face.depth_m - once, 20, x) for x in range(10, 40)]
    smooth = detail._smoothed(face).depth_m[20, 10:40]
    assert smooth - smooth[0] == pytest.approx(left - left[0], abs=1e-12)


def test_what_could_touch_and_stays_together_hardly_moves():
    rough = np.random.default_rng(2).random(X.shape)
    at = first(np.where(X < 25.0, -10.0 + 1e-3 * X, 0.0), approach_m=0.5)
    face = at.face
    away = replace(face, depth_m=face.depth_m + np.where(X < 25.0, rough, 0.0))
    assert detail._hardly_moves(at, away)  # too deep to touch
    assert detail._hardly_moves(at, replace(face, depth_m=face.depth_m + 0.1))  # all alike
    for moved, hardly in ((0.9e-3, True), (1.1e-3, False)):  # of 0.002 x 0.5
        one = face.depth_m + moved * (X == 30.0)
        assert detail._hardly_moves(at, replace(face, depth_m=one)) == hardly
    up = replace(face, depth_m=np.where(X == 10.0, 0.4, face.depth_m))
    assert not detail._hardly_moves(at, up)  # what comes within reach counts, too
    lost = first(np.where((X == 30.0) & (Y == 9.0), np.nan, -10.0 * (X < 25.0)), 0.5)
    assert not detail._hardly_moves(lost, detail._smoothed(lost.face))  # was filled


@pytest.mark.parametrize("turned", [False, True])
def test_of_white_noise_all_may_be_white_and_of_waves_next_to_nothing(turned):
    def share(height_m):
        one = first(height_m.T if turned else height_m, 100.0)
        return detail._white_share(one, detail._smoothed(one.face))

    noise = np.random.default_rng(3).standard_normal(X.shape)
    assert share(noise) > 0.9
    waves = np.sin(2.0 * np.pi * X / 6.0) + np.sin(2.0 * np.pi * Y / 6.0)
    # Their differences of order 10 are as they are; cos(pi / 6)^4 of them is left once
    left = np.cos(np.pi / 6.0) ** 4
    expected = 0.85 * math.sqrt(0.5 / math.comb(20, 10)) / (1.0 - left * (2.0 - left))
    assert share(waves) == pytest.approx(expected, rel=0.3)  # none is taken at the edge
    assert 0.2 < share(waves + 0.1 * noise) < 0.8
    assert share(waves + 0.1 * noise[:, :1]) > 0.2  # lines of noise: one axis tells
    assert share(np.where(X % 8.0 < 1.0, np.nan, waves)) == 1.0  # too few differences tell
    assert share(X) == 0.0


@pytest.mark.parametrize("times", [0.0, 0.3, 1.0, 3.0])
def test_on_a_self_affine_face_the_share_of_noise_is_bounded_from_above(times):
    """What the filter takes off the noise alone is known here; it is never more than is found."""

    def taken_m(height_m):
        mean_m = detail._binomial(height_m)
        return np.std((height_m - mean_m - detail._binomial(height_m - mean_m))[INSIDE])

    scene = Scene(
        (160, 240), (2e-4, 2e-4), seed=5, waviness_rms_m=4e-7, waviness_length_m=3e-3,
        waviness_spectrum="power_law", hurst_exponent=1.0,
    )  # fmt: skip
    face_m = synthetic_surface(scene)[0].height_m
    noise_m = np.random.default_rng(6).standard_normal(face_m.shape)
    noise_m *= times * taken_m(face_m) / taken_m(noise_m)
    one = first(face_m + noise_m)
    found = detail._white_share(one, detail._smoothed(one.face))
    true = taken_m(noise_m) / taken_m(face_m + noise_m)
    assert true - 0.03 < found < 0.65 + 0.45 * true


def test_what_was_filled_where_it_could_touch_is_no_shape_of_the_face():
    waves = np.sin(2.0 * np.pi * X / 9.0) + np.sin(2.0 * np.pi * Y / 9.0)
    for lost, share in ((waves < -1.9, False), (waves > 1.9, True)):  # valleys, tops
        one = first(np.where(lost & (X > 20.0) & (X < 30.0), np.nan, waves), 1.0)
        found = detail._white_share(one, detail._smoothed(one.face))
        assert found == 1.0 if share else found < 0.1


def test_the_contact_alone_is_stiffer_than_with_the_bulk_in_series():
    alone = np.array([1e8, 3e8])
    both = 1.0 / (1.0 / alone + 2e-9)
    assert detail._alone_N_per_m(both, 2e-9) == pytest.approx(alone)
    assert detail._alone_N_per_m(both, 0.0) == pytest.approx(both)
    stiff = np.array([0.4e9, 0.5e9, 0.6e9])  # no contact is as stiff as the last two
    assert detail._alone_N_per_m(stiff, 2e-9) == pytest.approx([2e9, 0.5e9, 0.6e9])


def test_changes_are_over_the_greater_of_both():
    before, after = np.array([1.0, 2.0, 3.0]), np.array([2.0, 1.0, 3.0])
    assert detail._relative(before, after).tolist() == [0.5, 0.5, 0.0]


def test_energies_are_read_by_powers_and_stiffnesses_as_secants():
    share = np.array([0.05, 0.15, 0.3, 0.6, 1.0])
    below = SimpleNamespace(
        load_N=40.0, load_drop_N=40.0 * share, loss_J=3.0 * share**3, withdrawal_m=2e-7 * share,
        stiffness_N_per_m=3e8,
    )  # fmt: skip
    assert detail._loss_J(below) == pytest.approx(3.0 * np.array(detail.FORCE_SHARES) ** 3)
    assert detail._stiffnesses_N_per_m(below) == pytest.approx([3e8, *[2e8] * 4])


def test_the_effect_from_a_share_on_is_the_greatest_of_those_forces():
    found = Detail(Effect(0.0, 0.4, 0.4), 0.0, (0.4, 0.1, 0.3, 0.2))
    shares = (0.05, 0.1, 0.2, 0.25, 0.5, 0.75)
    assert [found.energy_from(one) for one in shares] == [0.4, 0.4, 0.3, 0.3, 0.3, 0.2]
    nothing = Detail(Effect(0.0, 0.0, 0.0))
    assert (nothing.energy_from(0.1), nothing.white_share) == (0.0, 0.0)
