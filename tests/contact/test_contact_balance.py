"""A plane that turns until the moments of its contacts balance."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from capslip.contact.solvers.balance import press
from capslip.errors import ContactError

E_STAR_PA = 109.89e9
LOAD_N = 460.0


def hertz(radius_m):
    return 4 / 3 * E_STAR_PA * np.sqrt(np.asarray(radius_m, dtype=float))


def compliance(arm):
    r = np.hypot(*(arm[:, None] - arm).T)
    np.fill_diagonal(r, np.inf)
    return 1 / (np.pi * E_STAR_PA * r)


def face(seed, n=23, height_m=0.3e-6):
    """Caps of a face of 60 mm x 40 mm, none near another; places from its centre."""
    rng = np.random.default_rng(seed)
    cells = rng.permutation(96)[:n]
    arm = np.column_stack((cells % 12 - 5.5, cells // 12 - 3.5)) * 5e-3
    arm += rng.uniform(-1e-3, 1e-3, arm.shape)
    k = hertz(25.0 * np.exp(0.2 * rng.standard_normal(n)))
    return k, rng.uniform(0.0, height_m, n), compliance(arm), arm


def loads(k, rest):
    return k * np.maximum(rest.compression_m, 0.0) ** 1.5


def balance(k, h, C, arm, stiffness=0.0, start=None, load=LOAD_N):
    start = np.full(len(k), 1e-7) if start is None else start
    return press(k, h, C, start, load=load, arm=arm, turning_stiffness=stiffness)


@pytest.mark.parametrize("n", [3, 4])
def test_equal_spheres_in_a_ring_share_the_load_under_a_level_plane(n):
    angle = 2 * np.pi * np.arange(n) / n + 0.3
    arm = 0.02 * np.column_stack((np.cos(angle), np.sin(angle)))
    k, C = np.full(n, hertz(25.0)), compliance(arm)
    rest = balance(k, np.zeros(n), C, arm)
    each_N = LOAD_N / n
    level_m = (each_N / k[0]) ** (2 / 3) + each_N * C[0].sum()
    assert rest.level_m == pytest.approx(level_m, rel=1e-13)
    assert np.abs(rest.slope).max() * 0.02 < 1e-13 * level_m
    assert loads(k, rest) == pytest.approx(np.full(n, each_N), rel=1e-12)


def test_three_spheres_take_what_statics_gives_them_whatever_their_heights():
    arm = np.array([[-0.02, -0.01], [0.025, -0.005], [0.0, 0.015]])
    share = np.linalg.solve(np.vstack((np.ones(3), arm.T)), [1.0, 0.0, 0.0])
    k, h = hertz([20.0, 25.0, 30.0]), np.array([0.0, 3e-6, 1e-6])
    for C in (None, compliance(arm)):
        rest = balance(k, h, C, arm)
        assert loads(k, rest) == pytest.approx(LOAD_N * share, rel=1e-12)
        sunk_m = 0.0 if C is None else C @ loads(k, rest)
        height_m = (LOAD_N * share / k) ** (2 / 3) + sunk_m + h
        plane = np.linalg.solve(np.column_stack((np.ones(3), arm)), height_m)
        assert [rest.level_m, *rest.slope] == pytest.approx(plane, rel=1e-11)


def test_two_spheres_and_a_spring_follow_the_closed_form():
    """N_1 - N_2 = -K t / b with both compressions in closed form of the loads."""
    b, stiffness, k = 0.02, 2e5, hertz(25.0)
    arm = np.array([[b, 0.0], [-b, 0.0]])
    rest = balance(np.full(2, k), np.array([0.0, 5e-8]), None, arm, stiffness)
    right_N, left_N = loads(k, rest)
    slope = ((right_N / k) ** (2 / 3) - (left_N / k) ** (2 / 3) - 5e-8) / (2 * b)
    assert right_N + left_N == pytest.approx(LOAD_N, rel=1e-13)
    assert rest.slope[0] == pytest.approx(slope, rel=1e-9)
    assert (right_N - left_N) * b == pytest.approx(-stiffness * slope, rel=1e-9)
    assert right_N > left_N  # the higher one carries more


@pytest.mark.parametrize("seed", range(5))
def test_forces_and_moments_vanish_to_rounding(seed):
    k, h, C, arm = face(seed)
    rest = balance(k, h, C, arm)
    N = loads(k, rest)
    assert abs(N.sum() / LOAD_N - 1) < 1e-12
    assert np.abs(N @ arm).max() < 1e-12 * LOAD_N * 0.06
    gap_m = rest.level_m + arm @ np.array(rest.slope) - h - C @ N
    assert np.abs(gap_m - rest.compression_m).max() < 1e-12 * rest.level_m


@pytest.mark.long
@given(seed=st.integers(0, 50), which=st.integers(0, 22), size=st.integers(-9, -3))
def test_any_start_leads_to_the_same_rest_also_one_in_which_one_cap_touches(seed, which, size):
    k, h, C, arm = face(seed)
    start = np.full(len(k), -1e-6)
    start[which] = 10.0**size
    one, other = balance(k, h, C, arm), balance(k, h, C, arm, start=start)
    assert np.abs(one.compression_m - other.compression_m).max() < 1e-12 * abs(one.level_m)


@pytest.mark.parametrize("seed", range(5))
def test_a_plane_added_to_the_heights_comes_out_as_slope_and_changes_no_load(seed):
    k, h, C, arm = face(seed)
    slope = np.array([1e-4, -3e-4])  # 6 and 12 um over the face
    one, other = balance(k, h, C, arm), balance(k, h + arm @ slope, C, arm)
    assert loads(k, other) == pytest.approx(loads(k, one), rel=1e-9, abs=1e-9)
    assert np.array(other.slope) - slope == pytest.approx(np.array(one.slope), abs=1e-15)


def test_the_rest_is_the_least_energy_among_planes():
    """The convex energy of the plane: any other plane at the same load stores more."""
    k, h, C, arm = face(3)
    rest = balance(k, h, C, arm)

    def energy(level_m, slope):
        g = press(k, h - arm @ slope, C, np.full(len(k), 1e-7), level=level_m).compression_m
        N = k * np.maximum(g, 0.0) ** 1.5
        stored = N @ (0.4 * np.maximum(g, 0.0) + 0.5 * C @ N)
        return stored - LOAD_N * level_m

    least = energy(rest.level_m, np.array(rest.slope))
    for turn in ([1e-7, 0.0], [-1e-7, 0.0], [0.0, 1e-7], [0.0, -1e-7]):
        assert energy(rest.level_m, np.array(rest.slope) + turn) > least
    for rise in (-1e-9, 1e-9):
        assert energy(rest.level_m + rise, np.array(rest.slope)) > least


def test_the_hessian_is_the_slope_of_loads_and_moments():
    k, h, C, arm = face(4)
    rest = balance(k, h, C, arm)
    columns = np.column_stack((np.ones(len(k)), arm))
    D = np.diag(1.5 * k * np.sqrt(np.maximum(rest.compression_m, 0.0)))
    H = columns.T @ np.linalg.solve(np.eye(len(k)) + D @ C, D @ columns)
    for i, step in enumerate((1e-12, 1e-10, 1e-10)):
        ends = []
        for sign in (1.0, -1.0):
            moved = np.array([rest.level_m, *rest.slope])
            moved[i] += sign * step
            g = press(k, h - arm @ moved[1:], C, rest.compression_m, level=moved[0]).compression_m
            ends.append(columns.T @ (k * np.maximum(g, 0.0) ** 1.5))
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(H[:, i], rel=1e-4)
    assert np.linalg.eigvalsh(H).min() > 0.0


def test_the_spring_runs_from_balanced_to_as_levelled():
    k, h, C, arm = face(1)
    free, held = balance(k, h, C, arm), balance(k, h, C, arm, math.inf)
    assert held.slope == (0.0, 0.0)
    assert held.level_m == press(k, h, C, np.full(len(k), 1e-7), load=LOAD_N).level_m
    soft, stiff = balance(k, h, C, arm, 1e-3), balance(k, h, C, arm, 1e15)
    assert soft.slope == pytest.approx(free.slope, rel=1e-8)
    assert soft.level_m == pytest.approx(free.level_m, rel=1e-9)
    assert stiff.level_m == pytest.approx(held.level_m, rel=1e-8)
    between = balance(k, h, C, arm, 1e6)
    moment = loads(k, between) @ arm
    assert moment == pytest.approx(-1e6 * np.array(between.slope), rel=1e-9)
    assert np.hypot(*between.slope) < np.hypot(*free.slope)


@pytest.mark.parametrize(
    ("towards", "side"), [((1, 0), "+x"), ((-1, 0), "-x"), ((0, 1), "+y"), ((0, -1), "-y")]
)
def test_a_load_beside_all_peaks_tips_the_face_over_and_the_side_is_named(towards, side):
    k, h, C, arm = face(2)
    arm = arm - 0.1 * np.array(towards)
    with pytest.raises(ContactError, match=rf"tips_over.* on its \{side} side"):
        balance(k, h, C, arm)
    assert balance(k, h, C, arm, 1e6).level_m > 0.0  # held, it does not


def test_two_caps_carry_no_plane_that_turns_freely():
    arm = np.array([[0.02, 0.0], [-0.02, 0.0]])
    with pytest.raises(ContactError, match="tips_over"):
        balance(np.full(2, hertz(25.0)), np.zeros(2), None, arm)


@pytest.mark.parametrize("turn", [0.3, 0.922, 2.5])
def test_two_caps_opposite_each_other_leave_their_free_slope_as_it_is(turn):
    """They carry all, and no rounding turns the plane about the line between them."""
    along = np.array([math.cos(turn), math.sin(turn)])
    beside = np.array([-along[1], along[0]])
    arm = 0.02 * np.array([-along, along, 0.7 * beside, -0.9 * beside])
    h = np.array([0.0, 1e-8, 8e-7, 9e-7])
    k = hertz([20.0, 30.0, 25.0, 25.0])
    rest = balance(k, h, compliance(arm), arm)
    assert loads(k, rest) == pytest.approx([LOAD_N / 2, LOAD_N / 2, 0.0, 0.0], rel=1e-9)
    assert abs(beside @ rest.slope) * 0.02 < 1e-12 * rest.level_m


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_loads_just_beyond_where_a_cap_begins_to_touch_have_a_rest(seed):
    """Its first compression weighs less in the energy than rounding, so the misfit has to fall."""
    k, h, C, arm = face(seed, n=12)

    def touching(load_N):
        return int((balance(k, h, C, arm, load=load_N).compression_m > 0).sum())

    begins_N = []
    for low, high in itertools.pairwise(np.geomspace(20.0, 2000.0, 12).tolist()):
        before = touching(low)
        if touching(high) == before:
            continue
        for _ in range(50):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if touching(middle) == before else (low, middle)
        begins_N.append(high)
    assert len(begins_N) > 2
    for load_N in np.outer(begins_N, 1 + np.geomspace(1e-9, 1e-3, 25)).flat:
        N = loads(k, rest := balance(k, h, C, arm, load=load_N))
        gap_m = rest.level_m + arm @ np.array(rest.slope) - h - C @ N
        assert np.abs(gap_m - rest.compression_m).max() < 1e-12 * rest.level_m


def test_a_given_level_is_the_inverse_of_a_given_load():
    k, h, C, _ = face(5)
    start = np.full(len(k), 1e-7)
    at_load = press(k, h, C, start, load=LOAD_N)
    at_level = press(k, h, C, start, level=at_load.level_m)
    assert at_level.compression_m == pytest.approx(at_load.compression_m, rel=1e-10, abs=1e-18)


@pytest.mark.parametrize("goal", [{"load": LOAD_N}, {"level": 1e-6}])
@pytest.mark.parametrize("lost", ["depth", "compliance", "start"])
def test_what_is_no_number_is_no_equilibrium(goal, lost):
    """The start came back as the answer, at a level of NaN: no comparison told its error."""
    k, h, C, _ = face(1, 5)
    g = np.full(5, 1e-7)
    press(k, h, C, g, **goal)
    {"depth": h, "compliance": C[0], "start": g}[lost][1] = np.nan
    with pytest.raises(ContactError, match="no equilibrium of 5 caps"), np.errstate(all="ignore"):
        press(k, h, C, g, **goal)
