"""The parts of a band in closed form: covariances, quantiles, polynomials and shares."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm, t

from capslip.contact.joint import Joint
from capslip.contact.models.families import families
from capslip.contact.rung import ModelError
from capslip.contact.uneven import side_by_side
from capslip.settings import Settings, load_settings
from capslip.structure import band, band_causes, band_state
from capslip.structure.band_causes import NORMAL_95, PAIRS_SHARE


def part(coverage=None, error=0.1, made_from="spheres", lay=None, share=1.0, **contact):
    rung = SimpleNamespace(made_from=made_from)
    known = {"patch_errors": None, "light": None, **contact}
    contact = SimpleNamespace(estimated_error=error, rung=rung, lay=lay, moved=None, **known)
    return SimpleNamespace(joint=SimpleNamespace(coverage=coverage), contact=contact, share=share)


@pytest.mark.parametrize(
    ("parts", "left_out"),
    [
        ([part()], ()),
        ([part(error=None)], ("error of the model",)),
        ([part(made_from="map")], ("noise of the map that pixels share", "blur of the optics")),
        ([part(coverage=0.98)], ("scatter between scans",)),
        ([part(coverage=0.995)], ()),
        ([part(coverage=0.3), part(coverage=0.3)], ()),
        (
            [part(), part(error=None, made_from="map")],
            ("error of the model", "noise of the map that pixels share", "blur of the optics"),
        ),
    ],
)
def test_what_an_interval_does_not_hold_is_listed(parts, left_out):
    said = load_settings(overrides=("instrument.lateral_period_limit_m=2e-6",))
    for noise_known, settings, gone in (
        (False, Settings(), ()),
        (True, Settings(), ("noise",)),
        (False, said, ("blur",)),
        (True, said, ("noise", "blur")),
    ):
        state = SimpleNamespace(parts=parts, noise_known=noise_known, settings=settings)
        rest = tuple(one for one in left_out if not one.startswith(gone))
        assert band._left_out(state) == rest


def test_two_rows_have_the_covariance_of_many():
    changes = np.random.default_rng(0).normal(size=(7, 2)) * (1.0, 3.0)
    root = band_causes._root(changes)
    assert root.shape == (2, 2)
    assert root.T @ root == pytest.approx(changes.T @ changes, rel=1e-12)


def test_weights_are_those_of_the_polynomial_through_the_nodes():
    nodes, at = np.array([-0.5, 0.1, 0.7]), np.linspace(-1.0, 1.0, 9)
    weight = band_state._weights(nodes, at)
    assert weight.sum(axis=1) == pytest.approx(1.0)
    for power in (1, 2):
        assert weight @ nodes**power == pytest.approx(at**power, abs=1e-12)
    assert band_state._weights(nodes, nodes) == pytest.approx(np.eye(3), abs=1e-12)


def state_of(first=None, even=True, near=None, contacts=50, rows=50):
    rung = SimpleNamespace(near=near)
    contact = SimpleNamespace(
        first=first, rung=rung, yielded_share=1.0, contacts=contacts, row_family=[""] * rows
    )
    parts = (band_state.Part(SimpleNamespace(is_even=even), contact, 1.0),)
    return band_state.State(None, True, parts, load_settings())


def moved(**spreads):
    """Logarithms of factors on the inputs of which a spread is given."""
    z = np.random.default_rng(4).uniform(-1.0, 1.0, (50, 3))
    return {name: z[:, i] * spreads.get(name, 0.0) for i, name in enumerate(OF_CURVE)}


OF_CURVE = ("preload", "modulus", "hardness")


@pytest.mark.parametrize(("even", "states"), [(True, 5), (False, 3)])
@pytest.mark.parametrize("name", OF_CURVE)
def test_each_input_alone_is_followed_along_its_own_line(name, even, states):
    """Also where preload and hardness go together, as they do under another modulus."""
    log = moved(**{name: 0.2})
    nodes, weight = state_of(first="yields", even=even)._nodes(log)
    assert len(nodes) == states

    def of(N, H):
        beyond_three = (states > 3) * (20.0 * (N * H) ** 2 - 4.0 * N**3)
        return 1.0 + N - 2.0 * H + 30.0 * N * H + beyond_three

    expected = of(log["preload"] - log["modulus"], log["hardness"] - log["modulus"])
    assert weight @ of(*nodes.T) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize(
    ("even", "contacts", "rows", "states"),
    [(True, 49, 200, 17), (True, 900, 2, 17), (False, 49, 49, 9)],
)
@pytest.mark.parametrize("name", OF_CURVE)
def test_what_touches_in_turn_is_followed_by_straight_lines(name, even, contacts, rows, states):
    """Of few contacts, or of many in two families: kinks stay kinks."""
    log = moved(**{name: 0.2})
    nodes, weight = state_of("yields", even, contacts=contacts, rows=rows)._nodes(log)
    assert len(nodes) == states

    def of(N, H):
        return 1.0 + N + 3.0 * np.abs(N) - 7.0 * np.abs(H)

    expected = of(log["preload"] - log["modulus"], log["hardness"] - log["modulus"])
    assert weight @ of(*nodes.T) == pytest.approx(expected, abs=1e-10)


def test_the_only_input_has_all_of_the_variance():
    log_W = np.array([0.0, 0.0, 0.0, 0.1, 0.9, 1.0])  # no polynomial of the second degree
    normal = {"preload": np.linspace(-2.0, 2.0, 6)[:, None]}
    assert band._contributions(np.exp(log_W), normal) == {"preload": 1.0}


@pytest.mark.parametrize("first", [None, "yields"])
def test_preload_and_modulus_together_are_one_load_where_the_hardness_moves_nothing(first):
    log = moved(preload=0.2, modulus=0.3, hardness=0.1 if first else 0.0)
    nodes, weight = state_of(first=first)._nodes(log)
    N = log["preload"] - log["modulus"]
    assert weight @ (nodes[:, 0] - 3.0 * nodes[:, 0] ** 4) == pytest.approx(N - 3.0 * N**4)


@pytest.mark.parametrize(
    ("spreads", "solutions"),
    [
        ({}, 0),
        ({"preload": 0.2}, 2),
        ({"modulus": 0.2}, 2),
        ({"hardness": 0.2}, 2),
        ({"modulus": 0.2, "hardness": 0.2}, 4),
        ({"preload": 0.2, "modulus": 0.2, "hardness": 0.2}, 4),
    ],
)
def test_a_map_is_solved_for_few_states_beside_its_own(spreads, solutions):
    nodes, weight = state_of(first="yields", near="solves")._nodes(moved(**spreads))
    assert (nodes != 0.0).any(axis=1).sum() == solutions == len(nodes) - 1
    assert weight.sum(axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("freedom", [1, 2, 7])
def test_students_numbers_have_the_probability_of_normal_ones(freedom):
    normal = np.array([-2.0, -0.3, 0.0, 1.0, 2.5])
    expected = t.ppf(norm.cdf(normal), freedom)
    assert band._students(normal, freedom) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_an_interval_holds_nine_tenths_and_has_no_bound_beyond_light_damping():
    values = np.arange(1.0, 101.0)
    assert band._interval("energy_J", values) == (5.0, 95.0)
    assert band._interval("energy_J", values[::-1]) == (5.0, 95.0)
    few = np.where(values > 94.0, np.nan, values)
    assert band._interval("energy_J", few) == (5.0, np.inf)
    for name, most in (("loss_factor", 0.3), ("damping_ratio", 0.15), ("joint_loss_factor", 9.0)):
        at = values / 95.0 * most
        assert band._interval(name, at)[1] == pytest.approx(most)
        beyond = band._interval(name, 1.001 * at)[1]
        assert beyond == (np.inf if most < 1.0 else pytest.approx(1.001 * most)), name


def test_shares_are_those_of_the_variance_and_leave_out_what_inputs_do_together():
    one, other, third = (band._drawn({"a": 1, "b": 2})[name][:, [at]] for name, at in
                         (("a", 0), ("b", 0), ("b", 1)))  # fmt: skip
    normal = {"a": one, "b": np.hstack((other, third))}
    linear = np.exp(0.3 * one + 0.1 * other - 0.2 * third)[:, 0]
    shares = band._contributions(linear, normal)
    assert shares == pytest.approx({"a": 0.09 / 0.14, "b": 0.05 / 0.14}, abs=1e-6)
    square = np.exp(0.3 * one + 0.1 * (other**2 - 1.0))[:, 0]
    assert band._contributions(square, normal)["b"] == pytest.approx(0.02 / 0.11, abs=0.02)
    crossed = np.exp(0.3 * one + 0.4 * one * other)[:, 0]
    assert band._contributions(crossed, normal)["a"] == pytest.approx(0.09 / 0.25, abs=0.03)
    assert band._contributions(np.append(linear[1:], np.inf), normal) == {}
    assert band._contributions(np.append(linear[1:], 0.0), normal) == {}
    assert band._contributions(np.ones(len(linear)), normal) == {}
    assert band._contributions(np.array(2.0), normal) == {}


def of_force(by_force=True, parts=(), **overrides):
    texts = tuple(f"{name.replace('__', '.')}={value}" for name, value in overrides.items())
    answer = SimpleNamespace(slip_force_N=5.0, displacement_m=1e-8)
    return SimpleNamespace(
        by_force=by_force, parts=parts, settings=load_settings(overrides=texts), answer=answer
    )


def test_an_unknown_direction_leaves_the_covariance_of_all_directions():
    """Of kappa and of the energy, each a cosine of twice the angle, of two scans by their share."""

    def lay(*swings):
        return SimpleNamespace(left_open=lambda direction_rad: swings)

    of = [(0.3 + 0.1j, -0.2j, 0.25), (0.1 - 0.4j, 0.5 + 0.2j, 0.75)]
    parts = [part(lay=lay(a, b), share=share) for a, b, share in of] + [part(share=0.5)]
    a, b = (sum(one[i] * one[2] for one in of) for i in (0, 1))
    turn = np.exp(2j * np.pi * np.arange(360) / 360)  # e^(2 i phi)
    moved = np.stack([(a * turn).real, (b * turn).real])
    root = band_causes.of_direction(of_force(parts=parts, contact__tolerance=0.05))
    assert root.T @ root == pytest.approx(moved @ moved.T / 360, abs=1e-12)
    least = abs(np.array([a, b])).max()
    wide = of_force(parts=parts, contact__tolerance=1.01 * least)
    assert not band_causes.of_direction(wide).any()
    assert band_causes.of_direction(of_force(parts=parts, contact__tolerance=0.99 * least)).any()


def test_a_face_that_lies_another_way_has_the_same_root():
    """Mirrored, turned by a right angle, or by another: the numbers drawn meet the same rows."""

    def root(turn):
        swings = turn(np.array([0.3 + 0.1j, 0.15 - 0.2j]))
        lay = SimpleNamespace(left_open=lambda direction_rad: swings)
        return band_causes.of_direction(of_force(parts=[part(lay=lay)], contact__tolerance=0.05))

    for turn in (np.conj, np.negative, lambda swings: swings * np.exp(0.7j)):
        assert root(turn) == pytest.approx(root(np.array), abs=1e-12)


def test_at_a_given_displacement_a_direction_moves_what_the_slopes_of_the_curve_make_of_it():
    """T ~ e^0.5 and W ~ e^3: kappa by a factor moves e = delta / (mu kappa) by as much less."""
    lay = SimpleNamespace(left_open=lambda direction_rad: (0.3 + 0.1j, -0.2j))
    state = of_force(by_force=False, parts=[part(lay=lay)], contact__tolerance=0.05)
    asked = []
    state.kappa, state.preload_N = 1.25, 50.0
    state.curves = lambda factors: [SimpleNamespace(approach_m=lambda load_N: 2.0 * load_N)]
    state.response = lambda curve, approach_m, at: (
        asked.append((approach_m, at.mean())) or (7.0 * at**0.5, 5.0 * at**3)
    )
    root = band_causes.of_direction(state)
    a, b = -0.5 * (0.3 + 0.1j), -0.2j - 3.0 * (0.3 + 0.1j)
    expected = 0.5 * np.array([[abs(a) ** 2, (a * b.conjugate()).real], [0.0, abs(b) ** 2]])
    expected[1, 0] = expected[0, 1]
    assert root.T @ root == pytest.approx(expected, rel=1e-3)
    assert asked == [(100.0, pytest.approx(1e-8 / (0.2 * 1.25)))]


def test_a_model_without_caps_has_its_error_at_the_force_that_was_asked():
    known = ModelError(0.02, 0.4, ((0.1, 0.4), (0.4, 0.1), (1.0, 0.05)))
    state = of_force(material__friction_coefficient=0.25)
    state.preload_N = 50.0  # 5 N of 12.5 N: 0.4
    left = band_causes._of_one(state, part(errors=known))
    assert left.caps.tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert left.shift.tolist() == [0.0, 0.0]
    assert left.model == pytest.approx(np.diag((0.02, 0.1)) / NORMAL_95)
    state.preload_N = 1000.0  # 5 N of 250 N: 0.02, a fifth of the least that is known
    model = band_causes._of_one(state, part(errors=known)).model
    assert model == pytest.approx(np.diag((0.02, 5.0 * 0.4)) / NORMAL_95)
    state.preload_N = 10.0  # beyond gross slip: as at it
    model = band_causes._of_one(state, part(errors=known)).model
    assert model[1, 1] == pytest.approx(0.05 / NORMAL_95)
    assert not band_causes._of_one(state, part(errors=None)).model.any()


def test_what_few_solved_pressures_leave_comes_to_the_error_of_the_model():
    """Either of the two may be unknown."""
    state = of_force(material__friction_coefficient=0.25)
    state.preload_N = 50.0  # 5 N of 12.5 N: 0.4
    of_model, of_patches = ModelError(0.03, 0.08), ModelError(0.04, 0.3, ((0.1, 0.3), (0.4, 0.06)))
    for errors, patch_errors, expected in (
        (of_model, of_patches, (0.05, 0.1)),
        (None, of_patches, (0.04, 0.06)),
        (of_model, None, (0.03, 0.08)),
    ):
        left = band_causes._of_one(state, part(errors=errors, patch_errors=patch_errors))
        assert not left.caps.any()
        assert left.model == pytest.approx(np.diag(expected) / NORMAL_95)


@pytest.mark.parametrize(("by_force", "at"), [(True, 30.0), (False, 2.5e-8)])
def test_caps_that_were_moved_are_asked_at_the_state_of_their_scan(by_force, at):
    """A scan under six times the load of its joint has six times the load drop."""
    state = of_force(by_force, material__friction_coefficient=0.25)
    state.preload_N, asked = 20.0, []

    def response(curve, approach_m, where):
        asked.append((approach_m, float(where)))
        return np.exp(curve.log[..., 0]), np.exp(curve.log[..., 1])

    def curve(*log):
        return SimpleNamespace(log=np.array(log), approach_m=lambda load_N: 1e-9 * load_N)

    state.greatest, state.at_constant_load = 1.0, response
    moved = curve((1.0, 2.0), (1.2, 2.4), (0.8, 1.6), (1.01, 2.0))
    of = SimpleNamespace(
        found=curve(1.0, 2.0),
        moved=SimpleNamespace(log=moved.log, approach_m=moved.approach_m),
        by_pairs=curve(1.0, 2.04),
        by_level=curve(1.06, 2.0),
        yielded=0.1,
        of_contact=1.0,
        law=None,
        of_profiles=lambda share: (0.01, 0.16 * share),
    )
    one = part(preload_N=120.0, composite=SimpleNamespace(kappa=1.6), curve=curve(1.03, 2.0))
    one.contact.moved, one.contact.errors = of, None
    state.answer.slip_force_N = 0.25 * 5.0
    left = band_causes._of_one(state, one)
    assert np.array(asked) == pytest.approx(np.tile((1.2e-7, at), (5, 1)), rel=1e-12)
    random = np.array([[0.0, 0.0], [0.2, 0.4], [-0.2, -0.4]])
    assert left.caps.T @ left.caps == pytest.approx(random.T @ random / 3.0)
    assert left.shift == pytest.approx([-0.03, 0.0])  # to interacting caps, from those in use
    least = band_causes.LEAST_ERROR
    of_stiffness = band_causes.YIELDED_STIFFNESS * 0.1
    at_a_quarter = 0.04
    first = [[0.02, 0.0], [0.0, 0.02], [0.06, 0.0]]
    of_energy = band_causes.YIELDED_ENERGY * 0.1
    last = [[of_stiffness, -of_energy], [0.01, 0.0], [0.0, at_a_quarter]]
    others = np.array([*first, *last])
    expected = (others.T @ others + least**2 * np.eye(2)) / NORMAL_95**2
    assert left.model.T @ left.model == pytest.approx(expected)
    assert not left.law.any()


def test_one_scan_has_no_scatter():
    assert band_causes.of_scatter(of_force(parts=[part()])).tolist() == [[0.0, 0.0], [0.0, 0.0]]


def test_errors_of_caps_are_each_scans_own_and_those_of_the_model_go_together(monkeypatch):
    caps, model, law = (np.diag(of) for of in ((0.1, 0.2), (0.3, 0.4), (0.5, 0.6)))

    def left(state, one):
        return band_causes.Left(caps, model, one.share * np.array([0.1, 0.3]), law)

    monkeypatch.setattr(band_causes, "_of_one", left)
    alone = band_causes.of_caps_and_model(of_force(parts=[part()]))
    assert (alone.caps == caps).all()
    assert (alone.model == model).all()
    assert alone.shift == pytest.approx([0.1, 0.3])
    parts = [part(share=0.25), part(share=0.75)]
    both = band_causes.of_caps_and_model(of_force(parts=parts))
    assert both.caps.T @ both.caps == pytest.approx((0.25**2 + 0.75**2) * caps @ caps)
    assert both.model.T @ both.model == pytest.approx(model @ model)
    assert both.law.T @ both.law == pytest.approx(law @ law)
    assert both.shift == pytest.approx((0.25**2 + 0.75**2) * np.array([0.1, 0.3]))


E_STAR_PA = 1e11
LOAD_N, WEIGHT = np.array([1.0, 3.0, 8.0]), np.array([12.0, 3.0, 1.0])


def spheres(x=0.0):
    """Return a sphere whose radius is e^x times as large."""
    return families((1, 0), (20.0 * np.exp(x), 20.0), (0.0, 0.0), E_STAR_PA)


class Sets:
    """Curves of spheres with other radii, asked together."""

    def __init__(self, *log_radius):
        self.curves = [spheres(x) for x in log_radius]

    def __getattr__(self, name):
        def each(first, *rest):
            firsts = np.broadcast_to(first, len(self.curves))
            asked = zip(self.curves, firsts, strict=True)
            return np.array([getattr(one, name)(at, *rest) for one, at in asked])

        return each


def uneven_part(of_light, of_heavy, by_pairs=(0.0, 0.0), found=(0.0, 0.0)):
    """Part of a joint of three pressures, whose spheres may be as much wider or narrower.

    And be so with point loads alone, and as they are found, at the lightest and the heaviest.
    """
    curve, asked = spheres(), {}

    def state(load_N, spread, pairs, x):
        moved = SimpleNamespace(
            found=spheres(x),
            moved=Sets(x + spread, x - spread, x),
            by_pairs=spheres(x + pairs),
            by_level=None,
            yielded=0.0,
            of_contact=1.0,
            law=None,
            of_profiles=lambda share: asked.update({load_N: share}) or (0.0, 0.0),
        )
        composite = SimpleNamespace(kappa=1.25)
        known = {"moved": moved, "composite": composite, "curve": curve, "light": None}
        return SimpleNamespace(preload_N=load_N, errors=None, **known)

    heavy = state(8.0, of_heavy, by_pairs[1], found[1])
    light = state(1.0, of_light, by_pairs[0], found[0])
    heavy.light = light
    preload_N = float(LOAD_N @ WEIGHT)
    joint = Joint(1.0, 1.0, preload_N, LOAD_N, WEIGHT, 8.0)
    whole = side_by_side([curve] * 3, LOAD_N, WEIGHT)
    with_curve = SimpleNamespace(curve=lambda contact: whole, **vars(joint))
    about = {"share": 1.0, "kappa": heavy.composite.kappa, "asked": asked}
    one = SimpleNamespace(joint=with_curve, contact=heavy, **about)
    return one, whole


@pytest.mark.parametrize("share", [0.05, 0.25, 0.6, 0.85])
@pytest.mark.parametrize("by_force", [True, False])
def test_spheres_that_are_wider_in_all_patches_scale_all_lengths(share, by_force):
    """Of a radius e^x times as large under the same load all lengths are e^(-x/3) times as long."""
    x = 0.01
    one, whole = uneven_part(x, x)
    state = of_force(by_force, material__friction_coefficient=0.25)
    state.preload_N = one.joint.preload_N
    state.answer.slip_force_N = 0.25 * share * state.preload_N
    d = whole.preload_approach_m
    e = float(whole.withdrawal_m(d, share * state.preload_N))
    state.answer.displacement_m = 0.25 * 1.25 * e
    left = band_causes._of_one(state, one)
    expected = np.array([-x / 3.0, -x / 3.0])
    if not by_force:  # T and W / d are functions of e / d
        log = np.log(
            [whole.load_drop_N(d, e * f) for f in (0.999, 1.001)]
            + [whole.loss_integral_J(d, e * f) for f in (0.999, 1.001)]
        )
        slope = (log[[1, 3]] - log[[0, 2]]) / np.log(1.001 / 0.999)
        expected = np.array([slope[0] * x / 3.0, (slope[1] - 1.0) * x / 3.0])
    assert left.caps.T @ left.caps == pytest.approx(np.outer(expected, expected), rel=0.02)
    assert left.shift == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("by_force", [True, False])
def test_the_shift_of_patches_is_that_of_the_joint_of_interacting_caps(by_force):
    """Where these are wider by 4 % under the least load, and narrower by 2 % under the greatest."""
    one, whole = uneven_part(0.0, 0.0, found=(0.04, -0.02))
    state, share = of_force(by_force, material__friction_coefficient=0.25), 0.25
    state.preload_N = one.joint.preload_N
    at = share * state.preload_N
    state.answer.slip_force_N = 0.25 * at
    d = whole.preload_approach_m
    e = float(whole.withdrawal_m(d, at))
    state.answer.displacement_m = 0.25 * 1.25 * e
    left = band_causes._of_one(state, one)
    place = np.log(LOAD_N) / np.log(8.0)
    x = 0.04 + place * (-0.02 - 0.04)
    right = side_by_side([spheres(one) for one in x], LOAD_N, WEIGHT)
    assert left.shift == pytest.approx(moved_by(whole, right, by_force, at, e), rel=0.05, abs=3e-5)


def moved_by(before, after, by_force, drop_N, withdrawal_m):
    """Return what a joint answers otherwise with other curves, in logarithms."""
    found = []
    for one in (before, after):
        d = one.preload_approach_m
        if by_force:
            found.append((one.withdrawal_m(d, drop_N), one.loss_integral_at_drop_J(d, drop_N)))
        else:
            found.append((one.load_drop_N(d, withdrawal_m), one.loss_integral_J(d, withdrawal_m)))
    log = np.log(np.array(found, dtype=float))
    return log[1] - log[0]


@pytest.mark.parametrize("by_force", [True, False])
@pytest.mark.parametrize("share", [0.1, 0.4])
def test_what_ends_leave_counts_by_what_patches_lose_and_bear(share, by_force):
    """Radii that are wider by a power of the load between both ends, and all together."""
    of_light, of_heavy, pairs = 0.016, 0.001, (0.24, 0.04)
    one, whole = uneven_part(of_light, of_heavy, by_pairs=pairs)
    state = of_force(by_force, material__friction_coefficient=0.25)
    state.preload_N = one.joint.preload_N
    d, at = whole.preload_approach_m, share * state.preload_N
    state.answer.slip_force_N = 0.25 * at
    e = float(whole.withdrawal_m(d, at))
    state.answer.displacement_m = 0.25 * 1.25 * e
    left = band_causes._of_one(state, one)
    place = np.log(LOAD_N) / np.log(8.0)

    def wider(x_of_light, x_of_heavy):
        x = x_of_light ** (1.0 - place) * x_of_heavy**place
        wide = side_by_side([spheres(one) for one in x], LOAD_N, WEIGHT)
        return moved_by(whole, wide, by_force, at, e)

    # Sets at +x, -x and by nothing in the place of the shape, which is none of them
    expected = wider(of_light, of_heavy)
    assert left.caps.T @ left.caps == pytest.approx(np.outer(expected, expected), rel=0.03)
    expected = PAIRS_SHARE * wider(*pairs) / NORMAL_95
    least = (band_causes.LEAST_ERROR / NORMAL_95) ** 2
    found = left.model.T @ left.model
    assert found == pytest.approx(np.outer(expected, expected), rel=0.15, abs=4.0 * least)
    # Each end at its own part of its mu N
    for N in (1.0, 8.0):
        own = spheres().load_drop_N(spheres().approach_m(N), e) / N
        assert one.asked[N] == pytest.approx(own, rel=1e-3)


def test_near_gross_slip_patches_count_as_at_nine_tenths_of_it():
    """Where no patch sticks any more the slope of the joint tells nothing."""
    roots = []
    for share in (0.9, 0.97, 1.0):
        one, _ = uneven_part(0.01, 0.002)
        state = of_force(True, material__friction_coefficient=0.25)
        state.preload_N = one.joint.preload_N
        state.answer.slip_force_N = 0.25 * share * state.preload_N
        state.answer.displacement_m = 1e-6
        roots.append(band_causes._of_one(state, one).caps)
    assert roots[1] == pytest.approx(roots[0])
    assert roots[2] == pytest.approx(roots[0])
    assert roots[0].any()


def test_an_interval_holds_the_number_that_was_answered():
    assert band._with(3.0, (1.0, 2.0)) == (1.0, 3.0)
    assert band._with(0.5, (1.0, 2.0)) == (0.5, 2.0)
    assert band._with(1.5, (1.0, np.inf)) == (1.0, np.inf)


@pytest.mark.parametrize(
    ("value", "interval", "expected"),
    [
        (1e-12, (1.8e-109, 4e-11), (0.0, 4e-11)),
        (1e-12, (1.1e-18, 4e-11), (1.1e-18, 4e-11)),
        (0.3, (4.31e-168, 1.27), (0.0, 1.27)),
        (1e-12, (0.9e-18, np.inf), (0.0, np.inf)),
        (0.0, (0.0, 0.0), (0.0, 0.0)),
        (-0.61, (-0.9, -0.5), (-0.9, -0.5)),  # a shift of the frequency
    ],
)
def test_an_end_that_nobody_knows_is_zero(value, interval, expected):
    assert band._with(value, interval) == expected
