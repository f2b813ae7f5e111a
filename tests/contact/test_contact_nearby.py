"""A map near its preload: closed forms of a sphere, and the map that is loaded anew."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from capslip.contact.levelling import turned
from capslip.contact.models.boundary_elements import RUNG, boundary_elements
from capslip.contact.solvers import nearby as module
from capslip.contact.solvers import path, solutions
from capslip.surface.heightmap import HeightMap

E, N, SHARE, PIXEL_M = 110e9, 40.0, 0.25, 2e-5


def hills(summits, shape=(140, 180)):
    """Paraboloids of 0.5 to 1 m on one face: (row, column, radius, depth) of each."""
    y, x = (np.arange(n) * PIXEL_M for n in shape)
    rise = [
        -depth_m - ((y[:, None] - row * PIXEL_M) ** 2 + (x - column * PIXEL_M) ** 2) / (2 * R)
        for row, column, R, depth_m in summits
    ]
    return HeightMap(np.max(rise, axis=0), (PIXEL_M, PIXEL_M))


ONE = hills([(70.4, 89.3, 1.0, 0.0)])
FOUR = hills(
    [(36, 40, 1.0, 0.0), (101, 50, 0.6, 4e-8), (44, 132, 0.5, 1e-7), (104, 136, 0.8, 3e-8)]
)


def asked(curve, load_N):
    """Approach, withdrawal and loss where a share of a load is gone."""
    d = float(curve.approach_m(load_N))
    e = float(curve.withdrawal_m(d, SHARE * load_N))
    return np.array([d, e, float(curve.loss_integral_at_drop_J(d, SHARE * load_N))])


def test_a_sphere_keeps_the_form_of_its_curve():
    """Approach and withdrawal go as N^(2/3), the loss as N^(5/3)."""
    curve = boundary_elements(ONE, E)
    (less,) = curve.near(N, [(0.7, 1.0)], SHARE)
    powers = np.log([less.approach, less.withdrawal, less.loss]) / np.log(0.7)
    assert powers == pytest.approx([2 / 3, 2 / 3, 5 / 3], abs=0.02)
    assert asked(less, 0.7 * N) == pytest.approx(
        asked(curve, N) * (less.approach, less.withdrawal, less.loss), rel=1e-9
    )
    assert list(curve.solutions.unloading) == [N]  # nothing else was followed down


@cache
def loaded_first(hardness_Pa, balanced):
    """Return the curve of the four hills on fewer points, which keeps what was solved below N."""
    given = {"preload_N": N, "hardness_Pa": hardness_Pa, "balanced": balanced}
    return boundary_elements(FOUR, E, **given)


@cache
def asked_anew(load_N, hardness_Pa):
    """Return what is asked under a load that is the first one, once for each.

    As solved: near a load a map has its own factors, and metal what it does otherwise there.
    """
    given = {"preload_N": load_N, "hardness_Pa": hardness_Pa, "balanced": False}
    found = replace(boundary_elements(FOUR, E, **given), as_solved=True)
    return asked(found.at_forces((SHARE, 0.75)), load_N)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("hardness_Pa", [np.inf, 3e7])
@pytest.mark.parametrize(
    ("of_load", "of_hardness"), [(0.75, 1.0), (1.25, 1.0), (1.0, 1.3), (1.0, 0.8), (1.3, 0.8)]
)
def test_near_is_what_the_map_says_that_is_loaded_anew(hardness_Pa, of_load, of_hardness):
    first = loaded_first(hardness_Pa, balanced=False)
    assert (first.yielded_area_m2 is None) == np.isinf(hardness_Pa)
    assert first.yielded_area_m2 != 0.0
    (found,) = replace(first, as_solved=True).near(N, [(of_load, of_hardness)], SHARE)
    anew = asked_anew(of_load * N, of_hardness * hardness_Pa)
    assert asked(found, of_load * N) == pytest.approx(anew, rel=0.02)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize(
    ("of_load", "of_hardness"), [(0.1, 1.0), (1.0, 1.3), (1.0, 0.8), (1.4, 1.1)]
)
def test_another_first_load_is_that_of_the_turned_map_built_anew(of_load, of_hardness):
    given = {"tolerance": 1e-7, "hardness_Pa": 3e7 * of_hardness, "preload_N": of_load * N}
    first = loaded_first(3e7, balanced=True)
    assert first.tilt_rad != (0.0, 0.0)
    found = RUNG.after(first, N, of_load, of_hardness)
    anew = boundary_elements(turned(FOUR, first.tilt_rad, (0.0, 0.0)), E, **given)
    assert (found.yielded_area_m2, found.tilt_rad) == (anew.yielded_area_m2, first.tilt_rad)
    anew.solutions.keep(replace(anew.pressed(of_load * N), turns=True))  # on finer points
    assert asked(found, of_load * N) == pytest.approx(asked(anew, of_load * N), rel=3e-5)
    assert found.first.approach_m == pytest.approx(anew.first.approach_m, rel=1e-6)
    assert list(found.solutions.spent_s) == [of_load * N]


@pytest.mark.parametrize("hardness_Pa", [np.inf, 3e8])
def test_what_did_not_yield_is_near_without_a_solution(hardness_Pa, monkeypatch):
    """An elastic face unloads along the curve on which it was loaded, at any share."""
    first, anew = (
        boundary_elements(FOUR, E, preload_N=N_i, hardness_Pa=hardness_Pa) for N_i in (N, 0.8 * N)
    )
    first.unloading(N)
    monkeypatch.setattr("capslip.contact.map_curve.nearby", None)
    for share in (0.25, 0.5, 0.9):  # at a tenth pixels leave 3 % in what is loaded anew
        less, harder = first.near(N, [(0.8, 1.0), (1.0, 1.3)], share)
        assert (harder.approach, harder.withdrawal, harder.loss) == (1.0, 1.0, 1.0)
        now, then = (
            np.array([one.withdrawal_m(d, drop_N), one.loss_integral_at_drop_J(d, drop_N)])
            for one, load_N in ((first, N), (anew, 0.8 * N))
            for d, drop_N in [(one.approach_m(load_N), share * load_N)]
        )
        assert [less.withdrawal, less.loss] == pytest.approx(then / now, rel=0.01)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_an_elastic_sphere_has_its_powers_at_any_share(share):
    (less,) = boundary_elements(ONE, E).near(N, [(0.8, 1.0)], share)
    powers = np.log([less.approach, less.withdrawal]) / np.log(0.8)
    assert powers == pytest.approx(2 / 3, abs=1e-3)
    assert less.loss == pytest.approx(0.8 ** (5 / 3), rel=0.03)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_an_elastic_face_comes_back_to_the_known_state_from_more_load(share, monkeypatch):
    """One solution for the load; a tenth is less than what it has more, and counts as that."""
    first, more = boundary_elements(FOUR, E), boundary_elements(FOUR, E)
    monkeypatch.setattr("capslip.contact.solvers.nearby._unloaded", None)
    (found,) = first.near(N, [(1.3, 1.0)], share)
    now, then = (
        np.array([d, one.withdrawal_m(d, drop_N), one.loss_integral_at_drop_J(d, drop_N)])
        for one, load_N in ((first, N), (more, 1.3 * N))
        for d, drop_N in [(one.approach_m(load_N), share * load_N)]
    )
    factors = [found.approach, found.withdrawal, found.loss]
    assert factors == pytest.approx(then / now, rel=0.01 if share > 0.1 else 0.02)


def test_what_penetrates_beside_the_points_that_were_taken_joins_them(monkeypatch):
    curve, changes = boundary_elements(FOUR, E), [(1.3, 1.0)]
    (expected,) = curve.near(N, changes, SHARE)
    monkeypatch.setattr("capslip.contact.solvers.nearby._SPARE", 0.0)
    (found,) = curve.near(N, changes, SHARE)
    for name in ("approach", "withdrawal", "loss"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=3e-3)
    monkeypatch.setattr("capslip.contact.solvers.nearby._MOST_LOOKS", 1)
    (few,) = curve.near(N, changes, SHARE)
    assert few.withdrawal != pytest.approx(expected.withdrawal, rel=3e-3)


def test_few_points_are_solved_beside_those_that_touch(monkeypatch):
    solved, press = [], module.press

    def counted(face, **given):
        solved.append(int(np.prod(face.shape)))
        return press(face, **given)

    more = boundary_elements(FOUR, E).pressed(1.3 * N)
    touching = np.count_nonzero(more.pressure_Pa)
    first = boundary_elements(FOUR, E)
    first.unloading(N)
    monkeypatch.setattr(module, "press", counted)
    first.near(N, [(1.3, 1.0)], SHARE)
    assert touching <= max(solved) < 2 * touching < 0.5 * FOUR.size


def test_a_hill_that_only_more_load_reaches_carries_there():
    """Of three hills two touch under the load; the third is a little lower than the approach."""
    approach_m = float(boundary_elements(FOUR, E).approach_m(N))
    low = [(36, 40, 1.0, 0.0), (101, 50, 0.6, 0.0), (60, 132, 0.5, 1.02 * approach_m)]
    first = boundary_elements(hills(low), E)
    more = boundary_elements(hills(low), E)
    assert len(first.pressed(N).region_loads_N) == 2
    assert len(more.pressed(1.3 * N).region_loads_N) == 3
    (found,) = first.near(N, [(1.3, 1.0)], SHARE)
    assert asked(found, 1.3 * N) == pytest.approx(asked(more, 1.3 * N), rel=0.03)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
def test_a_hill_that_only_more_load_reaches_carries_there_where_most_yields():
    def pressed(summits, load_N):
        found = boundary_elements(
            hills(summits), E, preload_N=load_N, hardness_Pa=3e7, balanced=False
        )
        return replace(found, as_solved=True)

    two = [(36, 40, 1.0, 0.0), (101, 50, 0.6, 0.0)]
    low = [*two, (60, 132, 0.5, 0.9 * pressed(two, N).first.approach_m)]
    first, more = pressed(low, N), pressed(low, 1.3 * N)
    p = first.pressed(N).pressure_Pa
    assert p[p > 0.0].mean() > 0.8 * 3e7
    assert len(first.pressed(N).region_loads_N) == 2
    assert len(more.pressed(1.3 * N).region_loads_N) == 3
    (found,) = first.near(N, [(1.3, 1.0)], SHARE)
    anew = asked(more.at_forces((SHARE, 0.75)), 1.3 * N)
    assert asked(found, 1.3 * N) == pytest.approx(anew, rel=0.01)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
def test_loads_on_either_side_are_found_as_each_for_itself():
    first = loaded_first(3e7, balanced=False)
    changes = [(0.8, 1.0), (1.2, 1.0), (1.0, 1.2)]
    together = first.near(N, changes, SHARE)
    for one, change in zip(together, changes, strict=True):
        (alone,) = first.near(N, [change], SHARE)
        factors = [[of.approach, of.withdrawal, of.loss] for of in (one, alone)]
        assert factors[0] == pytest.approx(factors[1], rel=2e-3)


@pytest.mark.parametrize(("gone", "enough"), [(0.1, 6.25e-6), (0.05, 7.8125e-7), (0.5, 1e-4)])
def test_gaps_that_are_left_open_are_a_twentieth_of_a_hertz_loss_at_most(gone, enough):
    """A loss that begins as the cube of the approach that is gone, over eight."""
    share = 1.0 - (1.0 - gone) ** 1.5
    assert module._enough(share) == pytest.approx(enough, rel=1e-9)
    assert module._enough(1e-6) == module._FINEST


def test_a_large_contact_is_made_once_for_stiffness_and_slip_and_not_kept(monkeypatch):
    """Where shear goes needs no more than single precision afterwards."""
    curve = boundary_elements(FOUR, E, preload_N=N, hardness_Pa=1e12)
    alike, made, around = curve.tractions(N, 0.5)[1], [], solutions.around_contact
    curve.solutions.around = curve.solutions.alone = None
    curve.solutions.punch_Pa_per_m.clear()

    def counted(*args, single):
        made.append(single)
        return around(*args, single=single)

    monkeypatch.setattr(solutions, "_SMALL", 0)
    monkeypatch.setattr(solutions, "around_contact", counted)
    monkeypatch.setattr(path, "around_contact", None)
    curve.solutions.punch(N)
    assert curve.unloading(N).refinement == 1
    assert curve.solutions.around is curve.solutions.alone is None
    later = curve.tractions(N, 0.5)[1]
    assert made == [False, True]
    np.testing.assert_allclose(later, alike, atol=1e-3 * alike.max())
