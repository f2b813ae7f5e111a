"""Slip of coupled contacts: the right answer or a named failure, wherever the search begins."""

import numpy as np
import pytest

from capslip.contact.models.interacting import interacting
from capslip.contact.solvers import shear as module
from capslip.contact.solvers.balance import press
from capslip.contact.solvers.hertz import load_drop_of_asperity, loss_of_asperity
from capslip.errors import ContactError

E = 110e9
SHARES = np.array([1e-6, 0.01, 0.25, 0.5, 0.9, 0.999, 1 - 1e-9])  # the last is all but gross slip
SQUARE = [(0.012, 0.012), (0.012, 0.036), (0.036, 0.012), (0.036, 0.036)]
# Radii, places, depths and load. A pixel that stands out is a punch: 2.25 r^2 over its compression
SCENES = {
    "one cap": ([20.0], [(0.0, 0.0)], [0.0], 100.0),
    "caps that touch": ([20.0] * 3, [(0.0, 0.0), (4.6e-3, 0.0), (2.3e-3, 4e-3)], [0.0] * 3, 150.0),
    "a small one between two": (
        [20.0, 20.0, 2.0],
        [(0.0, 0.0), (6e-3, 0.0), (3e-3, 1.5e-3)],
        [0.0, 0.0, 2e-8],
        200.0,
    ),
    "a flat punch beside caps": (
        [20.0] * 4 + [0.068],
        [*SQUARE, (0.0125, 0.0135)],
        [4e-7] * 4 + [0.0],
        200.0,
    ),
    "one pixel": ([0.01] + [20.0] * 4, [(0.0, 0.0), *SQUARE], [0.0] + [1e-7] * 4, 100.0),
}
GUESSES = {
    "at rest": lambda e, x, net: (0 * e, 0 * x),
    "backwards": lambda e, x, net: (-e, -x),
    "at total slip": lambda e, x, net: (net.e_total + 0 * e, net.e_total + 0 * x),
    "far beyond it": lambda e, x, net: (10 * net.e_total + 0 * e, 10 * net.e_total + 0 * x),
    "as of one contact": lambda e, x, net: _as_of_one(e, net),
    "no number": lambda e, x, net: (np.nan * e, x),
}


def _as_of_one(e, net):
    """All load on one contact: past the lift-off of a punch, where nothing has a stiffness."""
    e = net.e_total * (1 - np.cbrt(1 - SHARES) ** 2)
    return e, e[:, None] * (1 - net.C @ net.spread)


def scene(name):
    """Return coefficients, compliances and compressions of the contacts."""
    radius, place, depth, load = SCENES[name]
    x, y = np.array(place).T
    curve = interacting(radius, depth, x, y, E)
    g = curve._compression(curve.approach_m(load))
    on = g > 0
    return curve.coefficient[on], curve.pair_compliance_m_per_N[np.ix_(on, on)], g[on]


def begin_at(monkeypatch, guess):
    """Let the search begin somewhere else."""
    slide = module._slide

    def begun(net, goal, closing, e, x, todo):
        e_bad, x_bad = guess(e, x, net)
        e[todo], x[todo] = e_bad[todo], x_bad[todo]
        with np.errstate(all="ignore"):
            slide(net, goal, closing, e, x, todo)

    monkeypatch.setattr(module, "_slide", begun)


@pytest.mark.parametrize("guess", GUESSES)
@pytest.mark.parametrize("name", SCENES)
def test_any_first_guess_ends_in_the_state_at_the_smaller_load(monkeypatch, name, guess):
    """The theorem: what is left is the equilibrium under the load that is left, by `press`."""
    k, C, g = scene(name)
    N = k * g**1.5
    begin_at(monkeypatch, GUESSES[guess])
    e, x = module.shear(k, C, g, SHARES * N.sum(), (0.0, 1.0))
    loss = loss_of_asperity(k, g, x).sum(axis=1)
    assert (np.diff(e) > 0).all()
    level = (g + C @ N).max()
    for share, e_one, x_one, loss_one in zip(SHARES, e, x, loss, strict=True):
        load = (1 - share) * float(N.sum())
        left = press(k, level - g - C @ N, C, g, load=load)
        # `press` ends at 1e-14 of the heights
        assert e_one == pytest.approx(level - left.level_m, rel=1e-9, abs=3e-14 * g.max())
        np.testing.assert_allclose(x_one, g - left.compression_m, rtol=1e-7, atol=3e-13 * g.max())
        if share > 1e-3:
            other = loss_of_asperity(k, g, g - left.compression_m).sum()
            assert loss_one == pytest.approx(other, rel=1e-7)


def test_given_displacement_from_any_first_guess(monkeypatch):
    k, C, g = scene("a flat punch beside caps")
    spring = 2e-10
    e, x = module.shear(k, C, g, np.array([1e-8, 1e-7, 5e-7]), (1.0, spring))
    for guess in GUESSES.values():
        with monkeypatch.context() as patch:
            if guess is not GUESSES["as of one contact"]:
                begin_at(patch, guess)
            again = module.shear(k, C, g, np.array([1e-8, 1e-7, 5e-7]), (1.0, spring))
        np.testing.assert_allclose(again[0], e, rtol=1e-12)
        np.testing.assert_allclose(again[1], x, rtol=1e-9)
    t = load_drop_of_asperity(k, g, x)
    np.testing.assert_allclose(x + t @ C, e[:, None] + 0 * x, rtol=1e-12)
    np.testing.assert_allclose(e + spring * t.sum(axis=1), [1e-8, 1e-7, 5e-7], rtol=1e-12)


@pytest.mark.parametrize("wrong", [0.0, 1e-6, 1.0, np.nan])
def test_what_no_search_finds_is_a_failure(monkeypatch, wrong):
    """Neither a displacement nor a force may be off, all but gross slip included."""
    k, C, g = scene("caps that touch")
    goal = SHARES * (k * g**1.5).sum()
    found = module.shear(k, C, g, goal, (0.0, 1.0))
    monkeypatch.setattr(module, "_searched", lambda net, goal, closing: (net.e_total, net.g))
    for at in range(len(goal)):
        one = slice(at, at + 1)

        def missed(net, goal, closing, e, x, todo, one=one):
            e[:], x[:] = ((1 + wrong) * right[one] for right in found)

        monkeypatch.setattr(module, "_slide", missed)
        if wrong == 0.0:
            e, x = module.shear(k, C, g, goal[one], (0.0, 1.0))
            assert (e == found[0][one]).all()
            assert (x == found[1][one]).all()
            continue
        with pytest.raises(ContactError, match="slip of 3 contacts was not found at 1 of 1 points"):
            module.shear(k, C, g, goal[one], (0.0, 1.0))


def test_a_lift_off_that_is_not_found_is_none(monkeypatch):
    k, C, g = scene("caps that touch")
    e, _ = module.lift_off(k, C, g)
    assert np.isfinite(e).all()
    slide = module._slide

    def missed(net, goal, closing, e, x, todo, lifts):
        slide(net, goal, closing, e, x, todo, lifts)
        x[1] *= 1 + 1e-6

    monkeypatch.setattr(module, "_slide", missed)
    other, _ = module.lift_off(k, C, g)
    assert np.isnan(other[1])
    assert (other[[0, 2]] == e[[0, 2]]).all()


def test_contacts_that_have_more_than_one_answer_are_refused():
    """Two wide contacts almost at one place: what one loses the other may take."""
    k, g = np.full(2, 4 / 3 * E * np.sqrt(20.0)), np.full(2, 3e-7)
    for over, stable in ((0.99, True), (1.01, False)):
        C = over / (1.5 * k[0] * np.sqrt(g[0])) * np.array([[0.0, 1.0], [1.0, 0.0]])
        if stable:
            module.shear(k, C, g, np.array([1.0]), (0.0, 1.0))
            continue
        with pytest.raises(ContactError, match="overlap so far that they are unstable"):
            module.shear(k, C, g, np.array([1.0]), (0.0, 1.0))
        with pytest.raises(ContactError, match="overlap so far that they are unstable"):
            module.lift_off(k, C, g)
