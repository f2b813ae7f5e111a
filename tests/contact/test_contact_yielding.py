"""Caps that yield: against closed forms, published finite elements and equilibrium itself."""

import numpy as np
import pytest
from contact_cases import table

from capslip import load_settings
from capslip.analysis import analyze_families, analyze_once
from capslip.caps.families import group_families
from capslip.contact.material import hardness_Pa, yield_law
from capslip.contact.models.interacting import interacting
from capslip.contact.press import press
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.hertz import contact_radius_m
from capslip.contact.solvers.near_field import near_field
from capslip.contact.solvers.yielding import YieldLaw, first_loading, first_loading_at
from capslip.errors import ContactError, SettingsError
from capslip.materials import MATERIALS
from capslip.settings import Material, settings_from
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

E = 115e9
STEEL = YieldLaw(2.8 * 355e6, E, 0.3)
LAWS = [YieldLaw(H, E, nu) for H in (1e8, 1e9, 4e9) for nu in (0.0, 0.26, 0.3, 0.34, 0.5)]
RADIUS_M = np.array([1e-3])


def load_N(law, w, radius_m=RADIUS_M):
    """Load at w times the approach at first yield, the latter from its own formula."""
    critical_m = approach_at_yield_m(law, radius_m)
    low, high = np.full(radius_m.shape, 1e-30), np.full(radius_m.shape, 1e30)
    for _ in range(400):
        middle = np.sqrt(low * high)
        less = law.approach_m(middle, radius_m) < w * critical_m
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    return low


def approach_at_yield_m(law, radius_m=RADIUS_M):
    C = 1.295 * np.exp(0.736 * law.poisson_ratio)
    return radius_m * (np.pi * C * law.hardness_Pa / 2.8 / (2 * law.E_star_Pa)) ** 2


def test_equal_laws_are_searched_for_their_yield_once(monkeypatch):
    """Each stage makes its own law, and 200 halvings of it cost more than what it is asked for."""
    asked, fit = [], YieldLaw._fit
    monkeypatch.setattr(YieldLaw, "_fit", lambda law, w: asked.append(law) or fit(law, w))
    given = 1.234e9, 1.1e11, 0.31
    pressures = [YieldLaw(*given).mean_pressure_Pa(np.ones(1), RADIUS_M) for _ in range(2)]
    first = len(asked)
    assert pressures[0] == pressures[1] == YieldLaw(*given).mean_pressure_Pa(np.ones(1), RADIUS_M)
    assert len(asked) - first < 0.2 * first
    harder = YieldLaw(2.0 * given[0], *given[1:])
    assert harder.mean_pressure_Pa(np.ones(1), RADIUS_M) > pressures[0]
    # Where it yields, both formulas have one load
    assert fit(harder, harder._w_t)[0] == pytest.approx(harder._w_t**1.5, rel=1e-13)


@pytest.mark.long
@pytest.mark.parametrize("law", LAWS)
def test_load_area_and_mean_pressure_rise_without_a_jump(law):
    loads_N = np.geomspace(1e-9, 1e9, 400_001)
    radius_m = np.full(loads_N.shape, 1e-3)
    approach_m = law.approach_m(loads_N, radius_m)
    pressure_Pa = law.mean_pressure_Pa(loads_N, radius_m)
    step = np.log(loads_N[1] / loads_N[0])
    for values, least, most in ((approach_m, 0.6, 1.1), (loads_N / pressure_Pa, 0.6, 1.2)):
        exponent = np.diff(np.log(values)) / step
        assert exponent.min() > least
        assert exponent.max() < most
    assert np.diff(pressure_Pa).min() >= -1e-9 * law.hardness_Pa
    assert pressure_Pa.max() == law.hardness_Pa


@pytest.mark.parametrize("law", LAWS)
def test_far_beyond_yield_the_area_is_load_over_hardness(law):
    N = load_N(law, 2000.0)
    flat_m, _ = law.flattened(N, RADIUS_M)
    a_m = contact_radius_m(N, flat_m, E)
    assert np.pi * a_m**2 == pytest.approx(N / law.hardness_Pa, rel=1e-12)


@pytest.mark.parametrize("w", [2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 50.0, 80.0, 110.0])
def test_load_and_area_are_those_of_finite_elements(w):
    """Kogut and Etsion 2002, J. Appl. Mech. 69, 657: their own fits, whose pieces jump by 2 %."""
    found_N = load_N(STEEL, w)
    critical_m = approach_at_yield_m(STEEL)
    area_m2 = found_N / STEEL.mean_pressure_Pa(found_N, RADIUS_M)
    elastic_N = 4 / 3 * E * np.sqrt(RADIUS_M) * critical_m**1.5
    load, area = (1.03 * w**1.425, 0.93 * w**1.136) if w < 6 else (1.40 * w**1.263, 0.94 * w**1.146)
    assert found_N / elastic_N == pytest.approx(load, rel=0.04)
    assert area_m2 / (np.pi * RADIUS_M * critical_m) == pytest.approx(area, rel=0.04)


@pytest.mark.parametrize("w", [2.0, 5.0, 10.0, 20.0, 50.0, 110.0])
def test_a_flattened_cap_unloads_as_stiffly_as_finite_elements_say(w):
    """Etsion, Kligerman and Kadin 2005, Int. J. Solids Struct. 42, 3716.

    The load falls as ((w - w_r) / (w_max - w_r))^n with n = 1.5 w_max^-0.0331 and
    w_r / w_max = (1 - w_max^-0.28) (1 - w_max^-0.69).
    """
    N = load_N(STEEL, w)
    flat_m, left_m = STEEL.flattened(N, RADIUS_M)
    recovered_m = STEEL.approach_m(N, RADIUS_M) - left_m
    published = 1.5 * w**-0.0331 / (1 - (1 - w**-0.28) * (1 - w**-0.69))
    assert 1.5 * w * approach_at_yield_m(STEEL) / recovered_m == pytest.approx(published, rel=0.08)
    assert 4 / 3 * E * np.sqrt(flat_m) * recovered_m**1.5 == pytest.approx(N, rel=1e-12)


def test_a_cap_that_does_not_yield_keeps_every_digit():
    law, N = YieldLaw(1e13, E, 0.3), np.array([1e-3, 1.0, 30.0])
    radius_m = np.array([1e-3, 2e-3, 5e-3])
    flat_m, left_m = law.flattened(N, radius_m)
    assert (flat_m == radius_m).all()
    assert not left_m.any()
    assert law.approach_m(N, radius_m) == pytest.approx(
        (0.75 * N / (E * np.sqrt(radius_m))) ** (2 / 3), rel=1e-14
    )
    a_m = contact_radius_m(N, radius_m, E)
    assert law.mean_pressure_Pa(N, radius_m) == pytest.approx(N / (np.pi * a_m**2), rel=1e-14)
    missing = np.array([np.nan, np.nan, 30.0])
    assert law.yielded(missing, radius_m).tolist() == [False, False, False]


def random_caps(n, seed):
    rng = np.random.default_rng(seed)
    radius_m, down_m = np.exp(rng.normal(size=n)) * 1e-4, np.abs(rng.normal(size=n)) * 1e-6
    place_m = rng.uniform(size=(n, 2)) * 5e-3
    r_m = np.hypot(*(place_m[:, None] - place_m).T)
    np.fill_diagonal(r_m, np.inf)
    return radius_m, down_m - down_m.min(), place_m - place_m.mean(axis=0), 1 / (np.pi * E * r_m)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("preload_N", [1e-3, 0.3, 20.0])
@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("pairs", [False, True])
def test_the_first_loading_is_an_equilibrium_of_caps_that_yield(seed, preload_N, turns, pairs):
    radius_m, depth_m, arm_m, C = random_caps(60, seed)
    C = C if pairs else None
    turning = {"arm": arm_m, "turning_stiffness": 0.0} if turns else {}
    after = first_loading(STEEL, radius_m, depth_m, E, preload_N, compliance_m_per_N=C, **turning)
    N, rest = after.load_N, after.rest
    assert N.sum() == pytest.approx(preload_N, rel=1e-12)
    if turns:
        assert np.abs(N @ arm_m).max() < 1e-12 * preload_N
    sunk_m = 0.0 if C is None else C @ N
    gap_m = rest.level_m + arm_m @ np.array(rest.slope) - depth_m - sunk_m
    on = N > 0
    approach_m = STEEL.approach_m(N[on], radius_m[on])
    assert gap_m[on] == pytest.approx(approach_m, rel=1e-8, abs=1e-10 * abs(gap_m).max())
    assert gap_m[~on].max(initial=-1.0) <= 1e-10 * abs(gap_m).max()
    # ... and of the flattened caps, elastic, under the same plane
    elastic_m = gap_m - (after.depth_m - depth_m)
    flat_N = 4 / 3 * E * np.sqrt(after.radius_m) * np.maximum(elastic_m, 0) ** 1.5
    assert flat_N == pytest.approx(N, rel=1e-7, abs=1e-12 * preload_N)


@pytest.mark.parametrize("law", [None, STEEL])
@pytest.mark.parametrize("preload_N", [1e-3, 0.3])
def test_where_a_first_loading_starts_changes_nothing(law, preload_N):
    # More than a hundred caps begin with the balance without interaction; others where they were
    radius_m, depth_m, arm_m, C = random_caps(150, 105)
    given = {"compliance_m_per_N": C, "arm": arm_m, "turning_stiffness": 0.0}
    found = first_loading(law, radius_m, depth_m, E, preload_N, **given)
    even_m = (preload_N / 150 / (4 / 3 * E * np.sqrt(radius_m))) ** (2 / 3)
    evenly = first_loading(law, radius_m, depth_m, E, preload_N, start_m=even_m, **given)
    before = first_loading(law, radius_m, 0.9 * depth_m, E, 1.2 * preload_N, **given)
    start = {"start_m": before.compression_m, "start_N": before.load_N}
    again = first_loading(law, radius_m, depth_m, E, preload_N, **start, **given)
    for other in (evenly, again):
        assert other.load_N == pytest.approx(found.load_N, rel=1e-9, abs=1e-12 * preload_N)
        assert other.rest.slope == pytest.approx(found.rest.slope, rel=1e-9)
    assert law is None or law.yielded(before.load_N, radius_m).any()


def test_turns_that_swung_at_first_end_as_newton_s_do(monkeypatch):
    # Soft caps, each of which yields far: half of each turn, kept to the end, would need forty
    turns, like_hertz = [], YieldLaw.like_hertz
    monkeypatch.setattr(
        YieldLaw, "like_hertz", lambda *of, **how: turns.append(of) or like_hertz(*of, **how)
    )
    rng = np.random.default_rng(0)
    x_m, y_m = rng.uniform(0.0, 3.6e-3, (2, 10))
    depth_m, radius_m = rng.uniform(0.0, 23e-6, 10), np.full(10, 3.5e-3)
    C = interacting(radius_m, depth_m, x_m, y_m, E).pair_compliance_m_per_N
    soft = YieldLaw(58e6, E, 0.3)
    after = first_loading(soft, radius_m, depth_m, E, 460.0, compliance_m_per_N=C)
    assert soft.yielded(after.load_N, radius_m).all()
    assert len(turns) <= 12
    approach_m = soft.approach_m(after.load_N, radius_m)
    assert after.rest.level_m - depth_m - C @ after.load_N == pytest.approx(approach_m, rel=1e-9)


def test_turns_that_begin_with_what_is_no_number_end_in_an_error():
    radius_m, depth_m, _, C = random_caps(8, 3)
    found = first_loading(STEEL, radius_m, depth_m, E, 300.0, compliance_m_per_N=C)
    assert STEEL.yielded(found.load_N, radius_m).sum() > 1
    start_N = found.load_N.copy()
    start_N[start_N.argmin()] = np.nan
    start = {"start_m": found.compression_m, "start_N": start_N}
    with pytest.raises(ContactError, match="no equilibrium"), np.errstate(all="ignore"):
        first_loading(STEEL, radius_m, depth_m, E, 300.0, compliance_m_per_N=C, **start)


RUNGS = ("families", "caps", "mean_field", "interacting")


def pressed(model, *overrides, preload_N=100.0, scale=1.0):
    """Two sharp caps and two blunt ones a little lower, far apart."""
    x_m, y_m = [0.0, 0.1, 0.0, 0.1], [0.0, 0.0, 0.1, 0.1]
    radius_m = scale * np.array([2e-3, 2e-3, 8e-3, 8e-3])
    caps = table(x_m, y_m, radius_m, [0.0, 0.0, -1e-6, -1e-6])
    caps = caps.with_columns(family=np.array(["G", "G", "P", "P"]))
    caps, families = group_families(caps)
    settings = load_settings(
        overrides=(f"contact.model={model}", f"contact.preload_N={preload_N!r}", *overrides)
    )
    return press(caps, families, HeightMap(np.zeros((20, 30)), (0.1, 0.1)), settings)


@pytest.mark.parametrize("model", RUNGS)
def test_without_yield_a_hardness_changes_nothing(model):
    elastic, caps = pressed(model)
    hard, same = pressed(model, "material.hardness_Pa=1e13")
    shares = np.array([0.1, 0.5, 0.9])
    for one, other in ((elastic.curve, hard.curve), (hard.curve, elastic.curve)):
        approach_m = one.approach_m(100.0)
        withdrawal_m = shares * approach_m
        assert one.load_drop_N(approach_m, withdrawal_m) == pytest.approx(
            other.load_drop_N(approach_m, withdrawal_m), rel=1e-12
        )
    assert hard.stiffness_N_per_m == pytest.approx(elastic.stiffness_N_per_m, rel=1e-12)
    assert hard.max_pressure_Pa == pytest.approx(elastic.max_pressure_Pa, rel=1e-12)
    assert same.load_N == pytest.approx(caps.load_N, rel=1e-12)
    assert (elastic.hardness_Pa, elastic.yielded_area_m2) == (None, None)
    assert (hard.hardness_Pa, hard.yielded_area_m2) == (1e13, 0.0)


def side_by_side(preload_N, *overrides):
    """Press two caps far apart, and a little lower two that are 0.19 mm from each other."""
    x_m, y_m = [0.05, 0.01, 0.03, 0.03015], [0.01, 0.03, 0.02, 0.02011]
    caps = table(x_m, y_m, [24.0, 24.0, 27.0, 22.0], [0.0, -56e-9, -155e-9, -155e-9])
    caps, families = group_families(caps)
    given = ("contact.model=interacting", f"contact.preload_N={preload_N!r}", *overrides)
    return press(
        caps, families, HeightMap(np.zeros((20, 30)), (2e-3, 2e-3)), load_settings(overrides=given)
    )


@pytest.mark.parametrize("preload_N", [1.0, 4.7, 22.4, 63.3, 106.0, 300.0])
def test_without_yield_caps_side_by_side_are_the_elastic_ones_to_the_last_digit(preload_N):
    # Under the greater loads either of the two may carry: two equilibria, of which one is chosen
    elastic, caps = side_by_side(preload_N)
    hard, same = side_by_side(preload_N, "material.hardness_Pa=1e15")
    assert hard.stiffness_N_per_m == elastic.stiffness_N_per_m
    assert hard.approach_m == elastic.approach_m
    assert same.load_N.tolist() == caps.load_N.tolist()
    one, other = (state.curve_after(9.7) for state in (elastic, hard))
    assert other.approach_m(9.7) == pytest.approx(float(one.approach_m(9.7)), rel=1e-12)


@pytest.mark.parametrize("preload_N", [1.5, 4.7, 13.4, 22.4, 37.7, 63.3])
@pytest.mark.parametrize("hardness", [2e6, 3e6])
def test_caps_side_by_side_yield_in_equilibrium_under_light_loads(preload_N, hardness):
    state, caps = side_by_side(preload_N, f"material.hardness_Pa={hardness!r}")
    law, radius_m = yield_law(Material(hardness_Pa=hardness)), caps.radius_m
    place_m, depth_m = np.column_stack((caps.x_m, caps.y_m)), -caps.peak_height_m
    r_m = np.hypot(*(place_m[:, None] - place_m).T)
    np.fill_diagonal(r_m, np.inf)
    C = 1 / (np.pi * law.E_star_Pa * r_m)
    face = law, radius_m, depth_m, law.E_star_Pa, preload_N
    after = first_loading_at(place_m, *face, compliance_m_per_N=C)
    N, on = after.load_N, after.load_N > 0.0
    assert caps.load_N == pytest.approx(N, rel=1e-6)
    assert law.yielded(N, radius_m).any() == (preload_N > 4.0 or hardness < 3e6)
    assert N.sum() == pytest.approx(preload_N, rel=1e-9)
    assert N[:2].sum() > 0.95 * preload_N
    near = near_field(caps.x_m, caps.y_m, caps.contact_radius_m, law.E_star_Pa)
    # As wide as they yielded, contacts run together earlier: then all are point loads
    assert (near is None) == (state.overlapping_pairs > 0) == (preload_N > 60.0)
    sunk_m = C @ N
    if near is not None:
        k = 4 / 3 * law.E_star_Pa * np.sqrt(law.flattened(N, radius_m)[0])
        sunk_m += sum(near.sunk_m(k, N, (N / k) ** (2 / 3)))
    level_m = law.approach_m(N, radius_m) + sunk_m + depth_m
    assert level_m[on] == pytest.approx(after.rest.level_m, rel=1e-9)
    assert level_m[~on].min(initial=np.inf) >= after.rest.level_m


@pytest.mark.parametrize("model", RUNGS)
@pytest.mark.parametrize("hardness", [1e8, 1e9, 3e9])
def test_every_rung_slips_along_the_unloading_of_its_flattened_caps(model, hardness):
    state, caps = pressed(model, f"material.hardness_Pa={hardness!r}")
    law = yield_law(Material(hardness_Pa=hardness))
    N, radius_m = caps.load_N, caps.radius_m
    assert N.sum() == pytest.approx(100.0, rel=1e-9)
    assert radius_m == pytest.approx([2e-3, 2e-3, 8e-3, 8e-3])  # the caps as they were fitted
    flat_m, _ = law.flattened(N, radius_m)
    a_m = np.sqrt(N / (np.pi * law.mean_pressure_Pa(N, radius_m)))
    assert caps.contact_radius_m == pytest.approx(a_m, rel=1e-9)
    assert state.contact_area_m2 == pytest.approx(np.pi * (a_m**2).sum(), rel=1e-6)
    assert state.max_pressure_Pa <= hardness
    assert state.yielded_area_m2 == pytest.approx(
        np.pi * (a_m[law.yielded(N, radius_m)] ** 2).sum(), rel=1e-6
    )
    # One spring a contact, 2 E* a; what the contacts share is in series and small this far apart
    joint = state.composite
    alone = (2 * joint.E_star_Pa * a_m).sum()
    assert state.stiffness_N_per_m == pytest.approx(alone, rel=2e-3 if hardness > 1e8 else 0.02)
    slip = slip_curve(state.curve, 100.0, 0.2, joint.kappa)
    deepest_m = (a_m**2 / flat_m).max()
    assert slip.total_slip_displacement_m == pytest.approx(
        0.2 * joint.kappa * deepest_m, rel=0.01 if hardness > 1e8 else 0.05
    )


@pytest.mark.parametrize("model", RUNGS)
@pytest.mark.parametrize("bulk", [False, True])
def test_a_face_may_be_loaded_anew_to_any_load_at_any_hardness(model, bulk):
    with_bulk = f"contact.bulk={str(bulk).lower()}"
    state, _ = pressed(model, with_bulk, "material.hardness_Pa=1e9")
    assert state.curve_after(100.0) is state.curve
    for load_N, hardness in ((30.0, 1e9), (100.0, 5e8), (180.0, 2e9)):
        other, _ = pressed(model, with_bulk, f"material.hardness_Pa={hardness}", preload_N=load_N)
        found = state.curve_after(load_N, hardness / 1e9)
        approach_m = found.approach_m(load_N)
        opens_m = float(other.curve.approach_m(load_N))
        assert float(approach_m - found.touch_m) == pytest.approx(opens_m, rel=1e-9)
        assert found.touch_m > 0.0  # the peak as it was stood higher
        assert float(found.touch_m) == pytest.approx(other.left_m, rel=1e-9)
        assert found.stiffness_N_per_m(approach_m) == pytest.approx(
            other.stiffness_N_per_m, rel=1e-9
        )
    elastic, _ = pressed(model, with_bulk)
    assert elastic.curve_after(30.0) is elastic.curve


def test_the_first_load_of_caps_that_share_one_approach_is_a_sum_of_their_loads():
    state, caps = pressed("caps", "material.hardness_Pa=1e9")
    law = yield_law(Material(hardness_Pa=1e9))
    approach_m = law.approach_m(caps.load_N, caps.radius_m) - caps.peak_height_m
    assert approach_m == pytest.approx(approach_m[0], rel=1e-9)
    assert state.eccentricity_m is not None


@pytest.mark.parametrize("bulk", [False, True])
@pytest.mark.parametrize("model", RUNGS)
def test_the_approach_of_the_first_loading_is_that_of_the_caps_as_they_yielded(model, bulk):
    state, caps = pressed(model, "material.hardness_Pa=2e8", f"contact.bulk={str(bulk).lower()}")
    law = yield_law(Material(hardness_Pa=2e8))
    N, R = caps.load_N, caps.radius_m
    comes_m = state.first_loading_approach_m + caps.peak_height_m  # of each cap, far apart
    assert comes_m == pytest.approx(law.approach_m(N, R), rel=1e-9 if model == "caps" else 0.1)
    highest_m = np.max(caps.peak_height_m - law.flattened(N, R)[1])
    left_m = state.first_loading_approach_m - state.approach_m
    assert left_m == pytest.approx(-highest_m, rel=1e-6)
    assert left_m > 3.0 * state.approach_m  # little of it is elastic
    without_m = state.first_loading_approach_without_bulk_m
    assert state.first_loading_approach_m - without_m == pytest.approx(state.bulk_m, rel=1e-6)
    assert state.under(30.0).first_loading_approach_without_bulk_m is None


@pytest.mark.parametrize("model", [*RUNGS, "flat"])
def test_the_approach_of_a_face_that_did_not_yield_is_that_of_its_first_loading(model):
    for given in ((), ("material.hardness_Pa=1e13",)):
        state, _ = pressed(model, *given)
        assert state.first_loading_approach_m == state.approach_m
        assert state.first_loading_approach_without_bulk_m == state.approach_without_bulk_m


def test_a_family_that_was_flattened_below_the_other_keeps_its_name():
    state, caps = pressed("families", "material.hardness_Pa=2e8")
    assert sorted(state.row_family.tolist()) == ["G", "P"]
    for name, radius_m in (("G", 2e-3), ("P", 8e-3)):
        N = caps.load_N[caps.family == name][0]
        flat_m, _ = yield_law(Material(hardness_Pa=2e8)).flattened(
            np.array([N]), np.array([radius_m])
        )
        row = state.row_family.tolist().index(name)
        assert state.curve.radius_m[row] == pytest.approx(flat_m[0], rel=1e-6)
    assert state.row_family.tolist() == ["P", "G"]


def test_families_that_are_given_yield_like_those_of_a_scan():
    given = {"m": 2, "n": 2, "radius_G_m": 2e-3, "radius_P_m": 8e-3, "h_m": 1e-6}
    sets = [f"families.{name}={value!r}" for name, value in given.items()]
    sets += ["material.hardness_Pa=1e9", "contact.preload_N=100"]
    found = analyze_families(load_settings(overrides=tuple(sets)))
    state, _ = pressed("families", "material.hardness_Pa=1e9")
    alike = "stiffness_N_per_m", "contact_area_m2", "yielded_area_m2", "approach_m", "left_m"
    for name in alike:
        assert getattr(found.contact, name) == pytest.approx(getattr(state, name), rel=1e-6)
    assert found.contact.max_pressure_Pa == state.max_pressure_Pa
    assert found.contact.first_loading_approach_m > 1.1 * found.contact.approach_m
    assert "yielded" in {problem.code for problem in found.problems}
    with pytest.raises(SettingsError, match="preload_N"):
        analyze_families(load_settings(overrides=(*sets[:-1], "families.approach_m=1e-6")))


@pytest.mark.parametrize("of_most", [0.999, 1.001])
@pytest.mark.parametrize("model", [*RUNGS, None])
def test_a_cap_that_yields_is_no_wider_than_it_was_a_sphere(model, of_most):
    """At full plasticity a^2 = N / (pi H): pi R^2 H is the load of a = R."""
    H, R = 1e7, 2e-3
    load_N = 2.0 * of_most * np.pi * R**2 * H
    given = (f"material.hardness_Pa={H!r}", f"contact.preload_N={load_N!r}")
    wider = rf"a load of {load_N:g} N makes a contact wider than its asperity: of 0\.002 m on"

    def contact():
        if model is None:
            sets = ("families.m=2", f"families.radius_G_m={R!r}", *given)
            return analyze_families(load_settings(overrides=sets)).contact
        caps, families = group_families(table([0.0, 0.1], [0.0, 0.0], [R, R], [0.0, 0.0]))
        settings = load_settings(overrides=(f"contact.model={model}", *given))
        return press(caps, families, HeightMap(np.zeros((20, 30)), (0.1, 0.1)), settings)[0]

    if of_most > 1.0:
        with pytest.raises(ContactError, match=wider):
            contact()
    else:
        assert contact().contact_area_m2 == pytest.approx(load_N / H, rel=1e-3)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("alignment", ["balanced", "as_levelled"])
def test_a_soft_face_is_wider_in_contact_and_loses_less_at_given_force(alignment):
    caps = [
        (x, y, 2.0, up)
        for x, y, up in ((0.006, 0.006, 0.0), (0.024, 0.006, -1e-7), (0.015, 0.015, -2e-7))
    ]
    found = []
    for hardness in (None, 1.7e7, 1e7):
        more = () if hardness is None else (f"material.hardness_Pa={hardness!r}",)
        settings = load_settings(
            overrides=(
                "contact.preload_N=30",
                "contact.load_point_m=[0.015, 0.009]",
                f"contact.alignment={alignment}",
                "hills.cut=fixed",
                *more,
            )
        )
        analysis = analyze_once(caps_map(caps), settings)
        state = analysis.contact
        assert state is not None, [p.message for p in analysis.problems]
        codes = {p.code for p in analysis.problems}
        assert ("yielded" in codes) == (hardness is not None)
        if hardness is not None:
            assert state.max_pressure_Pa <= hardness
        if alignment == "balanced":
            assert np.abs(state.eccentricity_m).max() < 2e-5
        energy_J = analysis.slip.energy_at_force_J(np.array([0.5 * 0.2 * 30.0]))[0]
        found.append((state.contact_area_m2, state.stiffness_N_per_m, 1 / energy_J))
        summary = analysis.summary()["contact"]
        assert summary["hardness_Pa"] == hardness
        assert (summary["yielded_area_m2"] or 0.0) == (state.yielded_area_m2 or 0.0)
    assert (np.diff(np.array(found), axis=0) > 0).all()


ROUND = [
    (x, y, radius_m, up_m)
    for x, y, radius_m, up_m in (
        (0.0041, 0.0038, 2.0, -1e-7),
        (0.0108, 0.0042, 2.8, 0.0),
        (0.0193, 0.0039, 1.7, -5e-8),
        (0.0262, 0.0041, 2.2, -2e-7),
        (0.0042, 0.0157, 2.5, -1.5e-7),
        (0.0113, 0.0160, 1.6, -1e-7),
        (0.0188, 0.0163, 2.4, -2.5e-7),
        (0.0258, 0.0158, 3.0, -5e-8),
    )
]


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize(("hardness", "off"), [(None, 0.01), (5e6, 0.06)])
def test_a_face_of_caps_finds_the_level_and_stiffness_of_its_map(hardness, off):
    more = () if hardness is None else (f"material.hardness_Pa={hardness!r}",)
    found = []
    for model in ("interacting", "boundary_elements"):
        settings = load_settings(
            overrides=(f"contact.model={model}", "contact.preload_N=100", *more)
        )
        analysis = analyze_once(caps_map(ROUND, floor_m=-1.5e-6), settings)
        contact = analysis.contact
        turned = (0.0, 0.0) if analysis.level is None else analysis.level.slope
        tilt_m = np.add(contact.tilt_rad, turned) * (0.03, 0.02)
        found.append((contact.stiffness_N_per_m, contact.contact_area_m2, tilt_m))
    (caps_N_per_m, caps_m2, caps_m), (map_N_per_m, map_m2, map_m) = found
    assert caps_N_per_m == pytest.approx(map_N_per_m, rel=off)
    assert caps_m2 == pytest.approx(map_m2, rel=0.05)
    assert np.abs(map_m).max() > 3e-8
    assert caps_m == pytest.approx(map_m, abs=2e-9 if hardness is None else 1.5e-8)


@pytest.mark.long
def test_the_estimated_error_holds_how_yielded_caps_unload():
    estimates = {}
    for hardness in (3e6, 1e9):
        settings = load_settings(
            overrides=(
                "contact.preload_N=100",
                f"material.hardness_Pa={hardness!r}",
                "contact.time_limit_s=1e-3",  # for the map itself
            )
        )
        contact = analyze_once(caps_map(ROUND, floor_m=-1.5e-6), settings).contact
        estimates[hardness] = contact.estimated_error
    assert estimates[1e9] < 0.05
    assert estimates[3e6] > 0.5


def test_a_hardness_follows_from_the_yield_stress_and_beats_it():
    assert hardness_Pa(Material()) is None
    assert hardness_Pa(Material(yield_stress_Pa=1e8)) == pytest.approx(2.8e8)
    assert hardness_Pa(Material(yield_stress_Pa=1e8, hardness_Pa=5e8)) == 5e8
    with pytest.raises(SettingsError, match="load_settings"):
        hardness_Pa(Material(preset="steel"))


@pytest.mark.parametrize("name", MATERIALS)
def test_a_preset_fills_in_what_is_not_given(name):
    body = MATERIALS[name]
    assert 0 < body.softest_yield_stress_Pa <= body.yield_stress_Pa < 0.01 * body.youngs_modulus_Pa
    found = load_settings(overrides=(f"material.preset={name}",)).material
    assert found.youngs_modulus_Pa == (body.youngs_modulus_Pa,) * 2
    assert found.poisson_ratio == (body.poisson_ratio,) * 2
    assert hardness_Pa(found) == pytest.approx(2.8 * body.yield_stress_Pa)
    own = load_settings(
        overrides=(
            f"material.preset={name}",
            "material.hardness_Pa=7e9",
            "material.poisson_ratio=[0.1, 0.2]",
        )
    )
    assert hardness_Pa(own.material) == 7e9
    assert own.material.poisson_ratio == (0.1, 0.2)
    assert settings_from(own.to_dict()) == own  # a result's own settings give the same again
    soft = load_settings(overrides=(f"material.preset={name}", "material.yield_stress_Pa=1e8"))
    assert hardness_Pa(soft.material) == pytest.approx(2.8e8)
    assert settings_from(soft.to_dict()) == soft


@pytest.mark.parametrize("known", ["hardness_Pa=1e9", "yield_stress_Pa=3e8", "preset=steel"])
def test_a_spread_of_the_hardness_goes_with_a_hardness(known):
    spread = "material.hardness_spread=0.1"
    for sets in ((spread, f"material.{known}"), (f"material.{known}", spread)):
        assert load_settings(overrides=sets).material.hardness_spread == 0.1
    with pytest.raises(SettingsError, match="got 1e-06 without a hardness"):
        load_settings(overrides=("material.hardness_spread=1e-6",))
    load_settings(overrides=("material.hardness_spread=0",))  # as in a file that holds every value


@pytest.mark.parametrize("pair", ['["titanium", "aluminium"]', "[titanium,aluminium]"])
def test_two_presets_are_one_for_each_face_and_the_softer_yields(pair):
    """A shell takes the quotes of such a list away."""
    found = load_settings(overrides=(f"material.preset={pair}",)).material
    assert found.youngs_modulus_Pa == (114e9, 70e9)
    assert found.poisson_ratio == (0.34, 0.3)
    assert hardness_Pa(found) == pytest.approx(2.8 * 250e6)


@pytest.mark.parametrize(
    ("preset", "got"),
    [
        ("steeel", "'steeel'.*did you mean steel"),
        ("steel,aluminium", "'steel,aluminium'"),
        ('["steel", "wood"]', "'wood'"),
        ("[steel, wood]", "'wood'"),
        ('["steel"]', "\\['steel'\\]"),
        ("[[1], [2]]", "'\\[1\\]'"),
        ("3", "3; expected one"),
    ],
)
def test_an_unknown_preset_is_refused(preset, got):
    with pytest.raises(SettingsError, match=rf"material\.preset: got {got}.*\[steel, aluminium\]"):
        load_settings(overrides=(f"material.preset={preset}",))
