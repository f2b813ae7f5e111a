"""The loss between solved loads against closed forms and loads that were solved for the test."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from capslip.contact.solvers import detail, path
from capslip.contact.solvers import unloading as module
from capslip.contact.solvers.hertz import load_drop_of_asperity, loss_of_asperity
from capslip.contact.solvers.losses import Losses, left_out, losses, region_losses
from capslip.contact.solvers.metal import first_loading
from capslip.contact.solvers.path import CLOSEST, FINEST, Path
from capslip.contact.solvers.polonsky_keer import elastic_face, press
from capslip.surface.heightmap import HeightMap

X = np.array([0.02, 0.08, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0])


def caps(depth, x):
    """Return load drops and losses of equal caps at depths below a unit compression."""
    g = 1.0 - np.asarray(depth)
    on = x[:, None]
    drop = load_drop_of_asperity(np.ones(len(g)), g, on)
    return drop.sum(axis=1), loss_of_asperity(np.ones(len(g)), g, on).sum(axis=1)


@pytest.mark.parametrize(("depth", "within"), [([0.0], 4e-3), ([0.0, 0.5], 0.05)])
def test_contacts_in_closed_form(depth, within):
    """One cap, and two of which one lifts off on the way: a kink."""
    stiffness = 1.5 * np.sqrt(1.0 - np.array(depth)).sum()
    found, carries = losses(stiffness, caps(depth, X)[0], X, caps(depth, X)[1])
    assert carries.all()
    x, drop, loss = found.table()
    for column in (x, drop, loss):
        assert (np.diff(column) > 0).all()
    fine = np.geomspace(0.02, 1.0, 400)
    true_drop, true_loss = caps(depth, fine)
    np.testing.assert_allclose(np.interp(true_drop, drop, x), fine, rtol=within)
    got = np.exp(np.interp(np.log(true_drop), np.log(drop), np.log(loss)))
    np.testing.assert_allclose(got, true_loss, rtol=within)
    assert (x[-1], drop[-1]) == (1.0, pytest.approx(caps(depth, X)[0][-1]))
    least = np.array([1e-5])
    assert np.interp(least, x, drop) == pytest.approx(caps(depth, least)[0], rel=0.01)


@pytest.mark.parametrize("rows", [3, 4, 5, 9])
def test_what_is_left_out_is_read_off_a_monotone_cubic_through_its_neighbours(rows):
    from scipy.interpolate import PchipInterpolator

    rng = np.random.default_rng(rows)
    x = np.cumsum(rng.uniform(0.1, 2.0, rows))
    # Growing, of any sign, and with steps of none, where slopes are zero
    y = np.cumsum(rng.random((rows, 2, 5)), axis=0)
    for values in (y, rng.standard_normal(y.shape), np.round(y), y[:, 0, 0]):
        expected = []
        for k in range(2, rows - 1):
            others = [i for i in range(k - 2, min(k + 3, rows)) if i != k]
            expected.append(PchipInterpolator(x[others], values[others])(x[k]))
        found = left_out(x, values)
        assert found.shape == (max(rows - 3, 0), *values.shape[1:])
        np.testing.assert_allclose(found, np.reshape(expected, found.shape), rtol=1e-12, atol=1e-14)


def test_a_steep_begin_leaves_the_other_loads():
    """Of a loss that rounding hides at the first load, all else is as it was."""
    drop, loss = caps([0.0], X)
    hidden = loss * np.append(0.04, np.ones(len(X) - 1))
    x, s, L = losses(1.5, drop, X, hidden)[0].table()
    assert (x[-1], s[-1], L[-1]) == pytest.approx((1.0, drop[-1], loss[-1]), rel=1e-12)
    for column in (x, s, L):
        assert (np.diff(column) > 0).all()
    assert np.interp(X[1:], x, s) == pytest.approx(drop[1:], rel=1e-3)
    assert np.interp(X[1:], x, L) == pytest.approx(loss[1:], rel=5e-3)


def test_a_face_that_all_but_lets_go_at_once_has_losses_that_are_numbers():
    """Its first loss grows by a power of hundreds: begun with, it lies below all numbers."""
    x = np.array([1.0, 1.0 + 1e-3, 1.0 + 5e-3, 1.1, 1.5])
    s, loss = np.array([0.999, 0.9995, 0.9998, 0.99999, 1.0]), np.geomspace(1e-6, 1.0, 5)
    table = losses(1.0 / 0.99, s, x, loss)[0].table()
    for column in table:
        assert np.isfinite(np.log(column)).all()
        assert (np.diff(column) > 0).all()
    assert table[2][-1] == pytest.approx(1.0)


def test_a_first_load_that_loses_next_to_nothing_is_no_overflow():
    """Its cubic rises beyond all numbers before the next load: these points are none."""
    z, log_loss = np.log([1.0, 1.0001, 2.0, 3.0]), np.log([1e-20, 1e-6, 1.0, 4.0])
    table = Losses(1.0, z, log_loss, np.array([6e12, 7e3, 3.0, 3.0]), (5.0, 40.0)).table()
    for column in table:
        assert np.isfinite(np.log(column)).all()
        assert (np.diff(column) > 0).all()
    assert table[2][-1] == pytest.approx(4.0)


def test_a_point_that_is_left_out_tells_the_error():
    found, _ = losses(1.5, caps([0.0], X)[0], X, caps([0.0], X)[1])
    fewer = np.delete(np.arange(len(X)), 3)
    rest, _ = losses(1.5, caps([0.0], X[fewer])[0], X[fewer], caps([0.0], X[fewer])[1])
    _, drop, loss = rest.table()
    at, exact = caps([0.0], X[3:4])
    off = np.interp(np.log(at), np.log(drop), np.log(loss)) - np.log(exact)
    assert found.offs()[2] == pytest.approx(float(abs(np.expm1(off)[0])), rel=0.05)


@pytest.mark.parametrize("n_places", [2, 3, 4, 5, 12])
def test_rows_left_out_are_as_scipy_interpolates_the_others(n_places):
    from scipy.interpolate import PchipInterpolator

    rng = np.random.default_rng(n_places)
    for _ in range(20):
        x = np.cumsum(rng.uniform(0.01, 1.0, n_places))
        y = rng.normal(size=(n_places, 4)).cumsum(axis=0) * (1.0, 0.1, 5.0, 0.0)
        found = left_out(x, y)
        assert found.shape == (max(n_places - 3, 0), 4)
        for row, k in zip(found, range(2, n_places - 1), strict=True):
            others = np.arange(n_places) != k
            exact = PchipInterpolator(x[others], y[others])(x[k])
            np.testing.assert_allclose(row, exact, rtol=1e-12, atol=1e-13)


def test_a_load_that_is_left_out_tells_the_error_of_regions():
    """As the table that is made without it, at its load drop, where the loss is cubic at first."""
    load_N, rate = np.array([1.0, 3.0]), np.array([[1.0, 0.7], [1.05, 0.72], [1.2, 0.8]])
    rate = np.concatenate((rate, [[1.3, 0.9], [1.4, 1.0], [1.5, 1.0]]))
    withdrawal_m = np.array([0.05, 0.2, 0.4, 0.6, 0.8, 1.0])
    loss_J = load_N * loss_of_asperity(np.ones(()), np.ones(()), withdrawal_m[:, None] * rate)
    loss_J *= np.linspace(1.0, 1.4, 6)[:, None]
    given = load_N, rate[0], withdrawal_m, rate, loss_J
    found = region_losses(*given)
    for k, off in enumerate(found.offs(), start=1):
        rest = region_losses(*given[:2], *(np.delete(each, k, axis=0) for each in given[2:]))
        x, *columns = np.log(rest.table())
        at = np.log(withdrawal_m[k])
        drop_N, without_J = (np.exp(np.interp(at, x, column)) for column in columns)
        expected = without_J / found.loss_J[k] * (found.load_drop_N[k] / drop_N) ** 3 - 1
        assert off == pytest.approx(abs(expected), abs=3e-5)  # of the table


def test_a_flat_punch_loses_nothing_before_it_slips_as_a_whole():
    drop = np.array([0.1, 0.5, 0.9, 1.0])
    found, carries = losses(2.0, drop, drop / 2.0, np.zeros(4))
    assert not carries.any()
    x, s, loss = found.table()
    np.testing.assert_allclose(s, 2.0 * x)
    assert loss.max() < 1e-200


@pytest.mark.long
@pytest.mark.parametrize("correlation_px", [1.5, 5.0])
def test_a_rough_face_between_its_solved_loads(correlation_px):
    """Contacts of a few pixels, of which each by itself is no Hertz contact, and wide ones."""
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(5)
    height = gaussian_filter(rng.standard_normal((96, 96)), correlation_px, mode="wrap")
    face = elastic_face(HeightMap(1e-7 * height / height.std(), (1e-5, 1e-5)), 110e9)
    pressed = press(face, load_N=17.0 / correlation_px)
    unloading = module.unload(face, pressed, 1e-7)
    assert len(unloading.solved_load_N) - 1 < module.MAX_SOLUTIONS
    path = Path(face, pressed, 1e-7, True)
    least = max(unloading.smallest_drop_N / unloading.load_N, 0.1)
    for share in np.linspace(least, 0.9, 6):
        node = path.solve(float(np.log((1 - share) ** (-2 / 3) - 1)))
        drop_N = path.pressed.load_N - node.load_N
        table = np.log(unloading.load_drop_N), np.log(unloading.loss_J)
        loss_J = np.exp(np.interp(np.log(drop_N), *table))
        assert loss_J == pytest.approx(node.region_loss_J.sum(), rel=0.02)


def test_a_first_load_at_which_less_slips_than_its_compliance_says_moves_no_other():
    """A hundredth of the loss of a Hertz contact: a cubic from there on would rise to 10^20."""
    from scipy.interpolate import PchipInterpolator

    one, x = np.ones(()), np.array([0.007, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.8, 1.0])
    loss_J = loss_of_asperity(one, one, x)
    loss_J[0] /= 100.0
    found, carries = losses(1.5, load_drop_of_asperity(one, one, x), x, loss_J)
    assert carries.tolist() == [False] + [True] * 8
    withdrawal_m, _, table_J = found.table()
    finer = np.linspace(0.02, 1.0, 200)
    found_J = np.exp(PchipInterpolator(*np.log((withdrawal_m, table_J)))(np.log(finer)))
    assert found_J == pytest.approx(loss_of_asperity(one, one, finer), rel=5e-3)


def rough_face(seed, correlation_px):
    from scipy.ndimage import gaussian_filter

    height = np.random.default_rng(seed).standard_normal((64, 64))
    if correlation_px > 0:
        height = gaussian_filter(height, correlation_px, mode="wrap")
    return elastic_face(HeightMap(1e-7 * height / height.std(), (1e-5, 1e-5)), 110e9)


def solved_at(path, share):
    node = path.solve(float(np.log((1 - share) ** (-2 / 3) - 1)))
    return path.pressed.load_N - node.load_N, node.region_loss_J.sum()


@pytest.mark.long
def test_the_error_holds_where_few_pixels_slip():
    """Faces of 100 to 200 pixels in contact, most of which no force below 0.3 mu N resolves.

    All but noise are refined, which resolves forces of the smoother ones down to a tenth.
    """
    beyond = []
    for seed, correlation_px, load_N in [
        *((seed, 0.0, 4.5) for seed in (1, 2, 7)),
        (1, 1.0, 4.5),
        (2, 1.5, 4.0),
        (1, 3.0, 1.5),
    ]:
        face = rough_face(seed, correlation_px)
        pressed = press(face, load_N=load_N)
        unloading = module.unload(face, pressed, 1e-7)
        assert unloading.refinement > 1 or unloading.smallest_drop_N > 0.1 * load_N
        assert (unloading.refinement > 1) == (correlation_px > 0.0)
        assert len(unloading.solved_load_N) - 1 < module.MAX_SOLUTIONS
        path = Path(face, pressed, 1e-7, True)
        drop_N, loss_J = np.array([solved_at(path, share) for share in np.linspace(0.1, 0.9, 9)]).T
        table = np.log(unloading.load_drop_N), np.log(unloading.loss_J)
        off = np.abs(np.exp(np.interp(np.log(drop_N), *table)) / loss_J - 1)
        assert unloading.loss_error < 0.15
        beyond.extend(off / unloading.loss_error)
    assert np.quantile(beyond, 0.95) < 1
    assert max(beyond) < 2


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_one_of_many_patches_is_followed_no_closer_than_its_pixels_tell(seed, monkeypatch):
    monkeypatch.setattr(path, "refinement", lambda *_: 1)  # as of a face of noise
    load_N, soft = 3.0, replace(rough_face(seed, 1.5), hardness_Pa=1e8)
    face, pressed = first_loading(soft, press(soft, load_N=load_N))
    every, few = (module.unload(face, pressed, 1e-7, as_pixels=one) for one in (False, True))
    assert len(few.solved_load_N) <= 0.85 * len(every.solved_load_N)
    drops_N = np.linspace(0.1, 0.9, 17) * load_N
    tables = [np.log((one.load_drop_N, one.loss_J)) for one in (every, few)]
    off = np.expm1(np.subtract(*(np.interp(np.log(drops_N), *table) for table in tables)))
    left = np.array([few.pixel_error(drop_N) for drop_N in drops_N])
    assert (np.abs(off) < module._OF_PIXELS * left + module._STEPS).all()


def test_the_bend_between_two_loads_bounds_their_loss():
    """However few pixels let go: the one whose two loads are halved may be off by no more."""
    face = rough_face(3, 3.0)
    path = Path(face, press(face, load_N=2.25), 1e-7, True)
    shares = np.linspace(0.11, 0.9, 9)
    drop_N, loss_J = np.array([solved_at(path, share) for share in shares]).T
    found, _ = losses(
        path.stiffness_N_per_m,
        np.append(drop_N, path.pressed.load_N),
        np.array([*(node.withdrawal_m for node in path.nodes), path.end.withdrawal_m]),
        np.append(loss_J, path.end.region_loss_J.sum()),
    )
    _, s_N, table_J = found.table()
    nodes = list(path.nodes)
    for low, high in pairwise(nodes):
        n_pixels = max(len(low.contact) - len(high.contact), 1)
        most = module._steps(path, low, high) * np.sqrt(n_pixels)
        share = 1 - np.sqrt(low.load_N * high.load_N) / path.pressed.load_N
        at_N, between_J = solved_at(path, share)
        off = np.exp(np.interp(np.log(at_N), np.log(s_N), np.log(table_J))) / between_J - 1
        assert 0 < abs(off) < most


@pytest.mark.long
def test_a_pixel_that_is_about_to_let_go_leaves_no_loss_out():
    """At 0.15 mu N a solution to 1e-7 keeps two pixels, and would lose 7 % of the loss."""
    face = rough_face(1, 1.5)
    path = Path(face, press(face, load_N=4.0), 1e-7, True)
    for share in (0.1406, 0.1593):
        solved_at(path, share)
    fine = Path(face, path.map_pressed, FINEST, True)
    assert solved_at(path, 0.15)[1] == pytest.approx(solved_at(fine, 0.15)[1], rel=1e-3)


def test_the_stiffness_whose_change_detail_is_asked_for_is_that_at_first_and_of_the_secants():
    """Of one sphere, T = 1 - (1 - x)^1.5 over the load and the approach; the bulk is taken off."""
    size_m = (2e-6, 2e-6)
    y, x = np.mgrid[-32:32, -32:32] * size_m[0]
    sphere = elastic_face(HeightMap(-(x**2 + y**2) / 2e-3, size_m), 1e11)
    pressed = press(sphere, load_N=0.2)
    found = module.unload(sphere, pressed, 1e-7)
    share = np.array(detail.FORCE_SHARES)
    secant = share / (1.0 - (1.0 - share) ** (2 / 3))
    expected = np.append(1.5, secant) * pressed.load_N / pressed.approach_m
    before = detail._stiffnesses_N_per_m(found)
    got = detail._alone_N_per_m(before, 0.0)
    np.testing.assert_allclose(got, expected, rtol=0.02)
    bulk_m_per_N = 0.1 / expected[0]
    less = detail._alone_N_per_m(before, bulk_m_per_N)
    np.testing.assert_allclose(1.0 / got - 1.0 / less, bulk_m_per_N, rtol=1e-9)


def test_no_loads_are_solved_that_are_too_close_to_tell_a_loss():
    """Where all points hold up to some load, the loss begins there with no bend to be found."""
    y, x = np.mgrid[:24, :24] / 24
    height_m = 1e-8 * np.cos(2 * np.pi * x) * np.cos(2 * np.pi * y)
    face = elastic_face(HeightMap(height_m, (1e-4, 1e-4)), 110e9)
    found = module.unload(face, press(face, load_N=300.0, tolerance=1e-7), 1e-7)
    withdrawal = 1 - (found.solved_load_N / 300.0) ** (2 / 3)  # of one round contact
    assert np.abs(np.diff(np.sort(withdrawal))).min() > 0.49 * CLOSEST


@pytest.mark.long
@pytest.mark.parametrize(("seed", "correlation_px"), [(0, 2.0), (1, 8.0)])
def test_four_forces_alone_take_four_solutions(seed, correlation_px):
    """A loss follows from the states at its ends, not from those between."""
    face, load_N = rough_face(seed, correlation_px), 5.0
    pressed = press(face, load_N=load_N)
    every = module.unload(face, pressed, 1e-7)
    four = module.unload(face, pressed, 1e-7, force_shares=detail.FORCE_SHARES)
    assert len(four.solved_load_N) == 5
    assert four.refinement == every.refinement
    assert four.stiffness_N_per_m == pytest.approx(every.stiffness_N_per_m, rel=1e-3)
    assert detail._loss_J(four) == pytest.approx(detail._loss_J(every), rel=0.01)
    assert detail._loss_J(four)[0] < 0.1 * detail._loss_J(four)[-1]
