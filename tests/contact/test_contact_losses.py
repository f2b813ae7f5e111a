"""The loss between solved loads against closed forms and loads that were solved for the test."""

import numpy as np
import pytest

from capslip.contact.solvers import unloading as module
from capslip.contact.solvers.hertz import load_drop_of_asperity, loss_of_asperity
from capslip.contact.solvers.losses import losses
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


def test_a_point_that_is_left_out_tells_the_error():
    found, _ = losses(1.5, caps([0.0], X)[0], X, caps([0.0], X)[1])
    fewer = np.delete(np.arange(len(X)), 3)
    rest, _ = losses(1.5, caps([0.0], X[fewer])[0], X[fewer], caps([0.0], X[fewer])[1])
    _, drop, loss = rest.table()
    at, exact = caps([0.0], X[3:4])
    off = np.interp(np.log(at), np.log(drop), np.log(loss)) - np.log(exact)
    assert found.off(3) == pytest.approx(float(abs(np.expm1(off)[0])), rel=0.05)


def test_a_flat_punch_loses_nothing_before_it_slips_as_a_whole():
    drop = np.array([0.1, 0.5, 0.9, 1.0])
    found, carries = losses(2.0, drop, drop / 2.0, np.zeros(4))
    assert not carries.any()
    x, s, loss = found.table()
    np.testing.assert_allclose(s, 2.0 * x)
    assert loss.max() < 1e-200


@pytest.mark.parametrize("correlation_px", [1.5, 5.0])
def test_a_rough_face_between_its_solved_loads(correlation_px):
    """Contacts of a few pixels, of which each by itself is no Hertz contact, and wide ones."""
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(5)
    height = gaussian_filter(rng.standard_normal((128, 128)), correlation_px, mode="wrap")
    face = elastic_face(HeightMap(1e-7 * height / height.std(), (1e-5, 1e-5)), 110e9)
    pressed = press(face, load_N=30.0 / correlation_px)
    unloading = module.unload(face, pressed, 1e-7)
    assert len(unloading.solved_load_N) - 1 < module.MAX_SOLUTIONS
    path = module._Path(face, pressed, 1e-7, True)
    least = max(unloading.smallest_drop_N / unloading.load_N, 0.1)
    for share in np.linspace(least, 0.9, 6):
        node = path.solve(float(np.log((1 - share) ** (-2 / 3) - 1)))
        drop_N = path.pressed.load_N - node.load_N
        table = np.log(unloading.load_drop_N), np.log(unloading.loss_J)
        loss_J = np.exp(np.interp(np.log(drop_N), *table))
        assert loss_J == pytest.approx(node.region_loss_J.sum(), rel=0.02)
