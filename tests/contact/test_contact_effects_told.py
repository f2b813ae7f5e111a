"""Which doubts are pressed, on what, and how severe an effect makes them; nothing is pressed."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from capslip.contact import effects
from capslip.contact.effects import (
    OF_FEWER_POINTS,
    _as_severe,
    _bent_m,
    _is_asked,
    _is_nothing,
    _Moved,
    with_effects,
)
from capslip.errors import ContactError
from capslip.problems import Problem
from capslip.settings import load_settings
from capslip.surface.heightmap import HeightMap, Tops

BY_CAPS, BY_MAP = "estimated with the caps", "found on the map with fewer points"


CAP_M, CONTACT_M = 1e-3, 4e-4  # where two caps stand (x = y), and the contact of the first


def caps(contact_m=CONTACT_M):
    """Return two caps, of which the second is none that may carry."""
    place_m = np.array([CAP_M, 2.0 * CAP_M])
    usable, a_m = np.array([True, False]), np.array([contact_m, CONTACT_M])
    return SimpleNamespace(x_m=place_m, y_m=place_m, usable=usable, contact_radius_m=a_m)


def tops(radius_m, up_m=0.0, at_m=CAP_M):
    """Return one top of a hill that was cut off, flat unless it stands up."""
    one = (np.array([value]) for value in (at_m, at_m, radius_m, up_m, 1e-9, 1.0))
    return Tops(*one, points=9)


def face(removed=0, both_ways=False, n_lifted=0, tops=None, few=False, filled_m=None):
    """Return a face of which so many points were removed, and so on."""
    height_m = np.linspace(0.0, 1.0, 100).reshape(10, 10)
    return SimpleNamespace(
        removed_m=np.zeros((3, removed)),
        removed=SimpleNamespace(both_ways=both_ways, n_lifted=n_lifted),
        seams=None,
        finer_as_turned=lambda: None,
        unfiltered_as_turned=lambda: None,
        with_short_waves_as_turned=lambda: None,
        with_form_as_turned=lambda: None,
        elsewhere_as_turned=lambda: (),
        surface=SimpleNamespace(
            height_m=height_m,
            tops=tops,
            rounding=SimpleNamespace(step_m=1.0 if few else 1e-4),
            filling=None if filled_m is None else SimpleNamespace(error_m=filled_m),
        ),
    )


def moved(energies=(0.0, 0.0, 0.0, 0.0), stiffness=0.0, least_share=0.25, approach=0.0):
    return _Moved.by(np.array([*energies, stiffness]), least_share, approach)


def test_a_bow_says_by_how_much_the_map_was_bent():
    """That of a map may be far higher than that of its peaks."""
    flat_m = np.array([[np.nan, 1e-6, 5e-6]] * 3)
    bows_m = np.array([0.0, 2e-9, -1e-9]), np.array([7.0, -2e-8, 2e-8])
    maps = tuple(HeightMap(flat_m + bow_m, (1.0, 1.0)) for bow_m in (0.0, *bows_m))
    assert _bent_m(maps[:2]) == pytest.approx(3e-9, rel=1e-9, abs=0.0)
    assert _bent_m(maps) == pytest.approx(4e-8, rel=1e-9, abs=0.0)


def test_what_is_asked_for_begins_at_the_least_share():
    change = (0.4, 0.3, 0.2, 0.1)
    for share, asked in ((0.1, 0.4), (0.11, 0.3), (0.25, 0.3), (0.5, 0.2), (0.75, 0.1)):
        found = moved(change, 0.05, share)
        assert (found.effect.energy, found.effect.loss_factor, found.asked) == (0.4, 0.4, asked)
        assert moved(change, 0.35, share).asked == max(asked, 0.35)
    assert moved(change, 0.05).effect.tangential_stiffness == 0.05


@pytest.mark.parametrize(
    ("code", "flatness_m", "noted"),
    [
        ("bow_left", 1e-9, False),
        ("bow_left", None, True),
        ("long_waves_filtered", None, False),
        ("short_waves_filtered", None, False),
        ("form_taken_off", None, False),
        ("mating_not_sure", None, False),
    ],
)
def test_what_is_no_sign_of_the_face_and_moves_nothing_is_not_noted(code, flatness_m, noted):
    surface = SimpleNamespace(faces=1)
    conditioning = SimpleNamespace(form="plane", form_degree=None)
    instrument = SimpleNamespace(flatness_deviation_m=flatness_m)
    of = SimpleNamespace(
        surface=surface,
        settings=SimpleNamespace(conditioning=conditioning, instrument=instrument),
    )
    assert _is_nothing(code, moved((9e-4,) * 4, 9e-4, approach=9e-4), of) == (not noted)
    assert not _is_nothing("seams", moved(), of)
    assert not _is_nothing(code, None, of)
    for one in (moved((1.1e-3, 0, 0, 0)), moved(stiffness=1.1e-3), moved(approach=1.1e-3)):
        assert not _is_nothing(code, one, of)


def severity(code, one, given="warning", conditioned=None, tolerance=0.05):
    problem = Problem(code, given, "it is so")
    return _as_severe(problem, one, 0.25, tolerance, "so", conditioned or face(), caps()).severity


def test_what_moves_more_than_the_tolerance_where_it_is_asked_is_a_warning():
    for given in ("info", "warning"):
        assert severity("bow_left", moved((0.9, 0.051, 0, 0)), given) == "warning"
        assert severity("bow_left", moved(stiffness=0.051), given) == "warning"
        assert severity("bow_left", moved((0.9, 0.05, 0, 0), 0.05), given) == "info"
        # steps of the heights are judged where it is asked, as the rest is
        assert severity("heights_in_steps", moved((0.9, 0.051, 0, 0)), given) == "warning"
        assert severity("heights_in_steps", moved((0.9, 0.05, 0, 0)), given) == "info"
        # a bow that is seen in the approach
        assert severity("bow_left", moved(approach=0.101), given) == "warning"
        assert severity("bow_left", moved(approach=0.1), given) == "info"


@pytest.mark.parametrize(
    ("code", "conditioned", "firm"),
    [
        ("outliers_removed", face(3), True),  # too many
        ("points_filled", face(), True),  # all too badly
        ("clipped", face(tops=tops(1.01e-4)), True),
        ("clipped", face(tops=tops(0.99e-4)), False),  # a quarter of the contact is 1e-4 m
        ("clipped", face(tops=tops(0.99e-4, at_m=2.0 * CAP_M)), True),  # on no cap
        ("clipped", face(tops=tops(1.01e-4, up_m=1e-9)), False),  # put back
        ("clipped", face(), False),
        ("heights_in_steps", face(few=True), True),
        ("heights_in_steps", face(), False),
        ("seams", face(tops=tops(1.01e-4), few=True), False),
    ],
)
def test_some_warnings_stay_whatever_they_move(code, conditioned, firm):
    assert severity(code, moved(), "warning", conditioned) == ("warning" if firm else "info")
    noted = firm and code in ("clipped", "heights_in_steps")
    assert severity(code, moved(), "info", conditioned) == ("warning" if noted else "info")


@pytest.mark.parametrize("contact_m", [np.nan, 0.0])
def test_a_flat_top_on_a_contact_that_is_not_known_may_hide_it(contact_m):
    problem, narrow = Problem("clipped", "info", "it is so"), face(tops=tops(1e-6))
    given = problem, moved(), 0.25, 0.05, "so", narrow
    assert _as_severe(*given, caps()).severity == "info"
    assert _as_severe(*given, caps(contact_m)).severity == "warning"


def test_an_effect_that_nobody_knows_leaves_a_doubt_as_it_is_but_for_lifted_patches():
    for given in ("info", "warning"):
        assert severity("outliers_removed", None, given, face(3)) == given
        assert severity("outliers_removed", None, given, face(3, n_lifted=1)) == "warning"
        assert severity("seams", None, given, face(n_lifted=1)) == given


@pytest.mark.parametrize("energy", [0.2, 0.02, None])
def test_fewer_points_are_a_warning_unless_more_of_them_answer_alike(energy):
    by_map = {} if energy is None else {"resampled_coarser": moved((energy,) * 4)}
    ((one,), _) = told([Problem("resampled_coarser", "warning", "x")], face(), {}, by_map)
    assert one.severity == ("info" if energy == 0.02 else "warning")
    if energy is None:
        assert one.message == "x; nobody knows what that moves: more points have no answer"
        assert one.effect is None
    else:
        assert one.message.endswith("(found on the map with more points)")
        assert one.effect.energy == energy


def test_a_message_tells_what_moves_and_where_it_is_less():
    problem = Problem("bow_left", "warning", "it is bowed")

    def told(one):
        return _as_severe(problem, one, 0.25, 0.05, "so", face(), caps()).message

    begin = "it is bowed; that moves the stiffness by 1.0%, the energy by 30.0%"
    assert told(moved((0.3, 0.02, 0, 0), 0.01)) == (
        f"{begin}, by no more than 2.0% from 25 % of gross slip on (so)"
    )
    assert told(moved((0.3, 0.2, 0, 0), 0.01)) == f"{begin} (so)"
    assert told(moved((0.3, 0.2, 0, 0), 0.01, approach=0.12)) == (
        f"{begin}, the approach by 12.0% (so)"
    )
    within = told(moved((0.04, 0.02, 0, 0), 0.01))
    assert within == "it is bowed; that moves the stiffness by 1.0%, the energy by 4.0% (so)"


@pytest.mark.parametrize(
    ("code", "given", "conditioned", "asked"),
    [
        ("seams", "warning", face(), True),
        ("seams", "info", face(), False),
        ("resampled_coarser", "warning", face(), True),
        ("long_waves_filtered", "warning", face(), True),
        ("short_waves_filtered", "warning", face(), True),
        ("form_taken_off", "warning", face(), True),
        ("form_taken_off", "info", face(), True),
        ("mating_not_sure", "warning", face(), True),
        ("bow_left", "info", face(), True),
        ("forms_of_scans_differ", "warning", face(), True),
        ("clipped", "warning", face(), True),
        ("load_on_doubtful_caps", "warning", face(), True),
        ("spikes", "warning", face(), False),
        ("outliers_removed", "info", face(removed=1), True),
        ("outliers_removed", "warning", face(removed=0), False),
        ("points_filled", "info", face(filled_m=2.1e-9), True),
        ("points_filled", "warning", face(filled_m=2.0e-9), False),
        ("points_filled", "warning", face(), False),
    ],
)
def test_who_has_an_effect_that_can_be_told(code, given, conditioned, asked):
    assert _is_asked(Problem(code, given, ""), conditioned, 2e-9) == asked


FINE, COARSE = ((n, n) for n in (100, 10))  # points of a map, and of what is thinned of it


def told(
    problems, conditioned, by_caps=None, by_map=None, made_from="map", share=0.25, errors=None
):
    """Return each problem with its effect, and the shares from which effects were asked for.

    `by_map` has them by code, or by code and points.
    """
    by_caps, by_map, shares = by_caps or {}, by_map or {}, []

    def of_caps(trials, code, least_share):
        shares.append(least_share)
        return by_caps.get(code)

    def of_map(code, contact, peaks, of_face, maps, least_share):
        shares.append(least_share)
        return by_map.get((code, maps[0].shape), by_map.get(code))

    contact = made_from and SimpleNamespace(
        rung=SimpleNamespace(made_from=made_from),
        approach_m=2e-7,
        errors=errors,
        stiffness_N_per_m=1e9,
    )

    def thinned(of_face, thinned):
        return (SimpleNamespace(shape=COARSE if thinned is effects.coarse_map else FINE),)

    fewer = dict.fromkeys(effects.OF_FEWER_POINTS, thinned)
    fine = SimpleNamespace(shape=FINE)
    settings = load_settings(overrides=("contact.tolerance=0.05",))
    with mock.patch.multiple(
        effects,
        FaceOfCaps=mock.Mock(return_value=SimpleNamespace(surface=fine, settings=settings)),
        Trials=mock.Mock(),
        OF_FEWER_POINTS=fewer,
        OF_THE_MAP=dict.fromkeys(effects.OF_THE_MAP, lambda _: (fine,)),
        _removed_or_not=lambda _: (fine,),
        _bent_m=lambda _: 3e-8,
        _effect=of_caps,
        _effect_on_map=of_map,
    ):
        found = with_effects(problems, None, None, conditioned, settings, contact, share)
    return found, shares


@pytest.mark.parametrize(
    ("made_from", "by_map", "how", "energy"),
    [
        ("map", True, BY_MAP, 0.2),
        ("map", False, BY_CAPS, 0.1),  # where the map has no answer
        ("spheres", True, BY_CAPS, 0.1),
        (None, True, BY_CAPS, 0.1),
    ],
)
def test_what_the_map_can_tell_is_told_by_it_where_it_answers(made_from, by_map, how, energy):
    caps, maps = {"seams": moved((0.1,) * 4)}, {"seams": moved((0.2,) * 4)} if by_map else {}
    other = Problem("spikes", "warning", "as it was")
    (one, same), _ = told([Problem("seams", "warning", "x"), other], face(), caps, maps, made_from)
    assert one.message.endswith(f"({how})")
    assert one.effect.energy == energy
    assert same is other


@pytest.mark.parametrize(
    ("energy", "made_from", "on_map"),
    [(0.0101, "map", True), (0.01, "map", False), (0.0101, "spheres", False)],
)
def test_removed_points_that_may_matter_are_put_back_on_the_map(energy, made_from, on_map):
    caps = {"outliers_removed": moved((energy, 0.0, 0.0, 0.0))}
    maps = {"outliers_removed": moved((0.0, 0.3, 0.0, 0.0))}
    problem = Problem("outliers_removed", "info", "x")
    ((one,), _) = told([problem], face(removed=2), caps, maps, made_from)
    assert one.severity == ("warning" if on_map else "info")
    assert one.message.endswith("(found on the map with them)" if on_map else f"({BY_CAPS})")
    ((one,), _) = told([problem], face(removed=2), caps, {}, made_from)  # it has no answer
    assert (one.severity, one.effect.energy) == ("info", energy)
    # errors stand off both ways: no burr of the face
    ((one,), _) = told([problem], face(removed=2, both_ways=True), caps, maps, made_from)
    assert (one.severity, one.effect.energy) == ("info", 0.3 if on_map else energy)


def test_points_filled_matter_from_a_fifth_of_the_tolerance_of_the_approach_on():
    problem = Problem("points_filled", "info", "x")
    for filled_m, asked in ((1.9e-9, False), (2.1e-9, True)):  # of 0.2 x 0.05 x 2e-7
        given = [problem], face(filled_m=filled_m), {"points_filled": moved((0.2,) * 4)}
        ((one,), _) = told(*given, made_from="spheres")
        assert (one.effect is not None) == asked
        ((one,), _) = told(*given, made_from=None)  # nothing answers: nothing that it would move
        assert one is problem


def test_forces_that_are_asked_for_end_between_a_tenth_and_a_quarter_of_gross_slip():
    for share, expected in ((1e-3, 0.1), (0.1, 0.1), (0.2, 0.2), (0.25, 0.25), (0.9, 0.25)):
        _, shares = told([Problem("seams", "warning", "")], face(), share=share)
        # of few points and of all of them, which do not know, and the caps
        assert shares == [expected] * 3


def hidden(energy, at_pixels, stiffness=0.01):
    return _Moved.by(np.array([*energy, stiffness]), 0.25, 0.0, np.array(at_pixels))


def test_what_pixels_leave_in_an_energy_is_no_change_of_it():
    found = hidden((0.9, 0.3, 0.2, 0.1), (1.0, 0.31, 0.1, 0.1))
    assert found.effect.energy == found.asked == 0.2
    assert found.hidden == 0.3  # at a tenth it is more, which nobody asks for
    assert hidden((1.2, 0, 0, 0), (1.0, 0, 0, 0)).effect.energy == 0.0  # and nobody asks for it
    assert hidden((1.2, 1.3, 0, 0), (1.0, 1.0, 0, 0)).effect.energy is None  # nobody knows
    assert hidden((0.99, 0, 0, 0), (0.98, 0, 0, 0)).effect.energy == 0.99
    for one, said in (
        (found, "20.0%, and by 30.0% where pixels leave as much (there)"),
        (hidden((0, 0.3, 0, 0), (0, 0.3, 0, 0)), "30.0% at most, no more than pixels leave in it"),
        (hidden((0.2, 0.05, 0, 0), (0, 0.05, 0, 0)), "20.0%, by no more than 1.0% from 25 %"),
    ):
        given = Problem("seams", "warning", "so"), one, 0.25, 0.05, "there", face(), caps()
        assert f"by 1.0%, the energy by {said}" in _as_severe(*given).message


def stated(energy):
    return SimpleNamespace(energy_at=lambda share: energy if share == 0.25 else 0.0)


@pytest.mark.parametrize(
    ("few", "errors", "on"),
    [
        (hidden((0, 0.3, 0, 0), (0, 0.4, 0, 0)), None, FINE),  # pixels hide it
        (hidden((0, 0.3, 0, 0), (0, 0.4, 0, 0)), stated(0.29), FINE),
        (hidden((0, 0.3, 0, 0), (0, 0.4, 0, 0)), stated(0.31), COARSE),  # no more than is said
        (hidden((0, 0.05, 0, 0), (0, 0.4, 0, 0)), None, COARSE),  # within the tolerance
        (hidden((0, 0.3, 0, 0), (0, 0.4, 0, 0), 0.06), None, COARSE),  # it matters anyway
        (None, stated(0.9), FINE),  # few points have no answer
        (replace(moved((0.3,) * 4), stiffness_N_per_m=0.94e9), None, FINE),  # or another stiffness
        (replace(moved((0.3,) * 4), stiffness_N_per_m=0.96e9), None, COARSE),
    ],
)
def test_few_points_that_do_not_tell_leave_it_to_all_of_them(few, errors, on):
    whole = moved((0.2,) * 4)
    by_map = {("bow_left", COARSE): few, ("bow_left", FINE): whole}
    ((one,), _) = told([Problem("bow_left", "warning", "x")], face(), {}, by_map, errors=errors)
    points = "all its points" if on == FINE else "fewer points"
    bow = "the bow of 3e-08 m that a form takes off its heights"
    assert one.message.endswith(f"(found on the map with {points}, without {bow})")
    assert one.effect == (whole if on == FINE else few).effect
    if few is not None:  # all of them have no answer
        by_map[("bow_left", FINE)] = None
        ((one,), _) = told([Problem("bow_left", "warning", "x")], face(), {}, by_map)
        assert one.effect == few.effect
        assert "fewer points" in one.message


SIZE_M = (2e-4, 3e-4)  # of pixels


def measured(heights, shape=(15, 30)):
    """Return a map of heights over y and x, with what says how it was levelled."""
    y_m, x_m = ((np.arange(n) + 0.5) * one_m for n, one_m in zip(shape, SIZE_M, strict=True))
    return HeightMap(heights(y_m[:, None], x_m), SIZE_M)


def of_face(surface, *words):
    return SimpleNamespace(surface=surface, settings=load_settings(overrides=words))


def tilted(y_m, x_m):
    return 3e-4 * y_m - 1e-4 * x_m


@pytest.mark.parametrize("apart", [(3, 5), (5, 3), (1, 2)])
def test_measured_points_of_an_interpolated_map_lie_where_they_lay(apart):
    face = of_face(measured(tilted))
    with mock.patch.object(effects, "pixels_apart", return_value=apart):
        every, points = effects._interpolated_or_not(face)
    assert every is face.surface
    assert points.pixel_size_m == (apart[0] * SIZE_M[0], apart[1] * SIZE_M[1])
    assert points.shape == (-(-15 // apart[0]), -(-30 // apart[1]))
    dy_m, dx_m = points.pixel_size_m
    y_m, x_m = (
        (np.arange(n) + 0.5) * one for n, one in zip(points.shape, (dy_m, dx_m), strict=True)
    )
    between = 0.0 if apart[1] % 2 else 0.5 * SIZE_M[1]  # the later one of two in the middle
    assert points.height_m == pytest.approx(tilted(y_m[:, None], x_m + between), abs=1e-18)


def test_removed_points_are_put_back_where_they_were():
    surface, at = measured(tilted), (np.array([2, 14]), np.array([29, 0]))
    removed_m = np.array([(at[1] + 0.5) * SIZE_M[1], (at[0] + 0.5) * SIZE_M[0], [1e-6, 2e-6]])
    before, after = effects._removed_or_not(SimpleNamespace(surface=surface, removed_m=removed_m))
    assert before is surface
    changed = np.argwhere(after.height_m != surface.height_m)
    assert changed.tolist() == [[2, 29], [14, 0]]
    assert after.height_m[at].tolist() == [1e-6, 2e-6]


def test_a_tilt_and_a_bow_are_taken_off_each_alone():
    def bow(y_m, x_m):
        return 0.5 * (x_m - 4.5e-3) ** 2 - 2.0 * (y_m - 1.5e-3) ** 2

    def hill(y_m, x_m):
        return 1e-7 * np.exp(-((x_m - 5e-3) ** 2 + (y_m - 2e-3) ** 2) / 1e-6)

    tilt_or_not, bow_or_not = (
        partial(OF_FEWER_POINTS[code], thinned=lambda one: one)
        for code in ("tilt_left", "bow_left")
    )
    flat, bowed = measured(hill), measured(lambda y_m, x_m: hill(y_m, x_m) + bow(y_m, x_m))
    sloped = measured(lambda y_m, x_m: hill(y_m, x_m) + tilted(y_m, x_m))
    (same, level), (_, of_flat) = map(tilt_or_not, map(of_face, (sloped, flat)))
    assert same.height_m == pytest.approx(sloped.height_m)
    assert level.height_m == pytest.approx(of_flat.height_m, abs=1e-18)
    (same, straight), (_, of_flat) = map(bow_or_not, map(of_face, (bowed, flat)))
    assert same.height_m == pytest.approx(bowed.height_m)
    left_m = straight.height_m - of_flat.height_m  # but for the plane, which stays as it was
    plane = np.linalg.lstsq(
        np.stack([np.ones(450), *(one.ravel() for one in np.indices((15, 30)))], axis=1),
        left_m.ravel(),
    )
    assert plane[1][0] ** 0.5 < 1e-12


@pytest.mark.parametrize("faces", [1, 2])
def test_bows_of_an_instrument_are_as_high_as_it_is_flat_over_the_whole_map(faces):
    """What it makes of each scan it makes of both alike, so of their sum twice as much."""
    level = replace(measured(lambda y_m, x_m: 0 * (y_m + x_m)), faces=faces)
    flat = of_face(level, f"instrument.flatness_deviation_m={1e-7 / faces}")
    coarse, *bowed = effects._bow_or_not(flat, effects.coarse_map)
    assert not coarse.height_m.any()
    assert len(bowed) == 6
    for one in bowed:
        height_m = one.height_m
        for mirrored_m in (height_m[::-1], height_m[:, ::-1]):
            assert np.allclose(height_m, mirrored_m, rtol=1e-9, atol=1e-20)
        highest = np.abs(height_m).max()  # half a pixel within the edge
        assert (1 - 1 / 15) ** 2 * 1e-7 <= highest * (1 + 1e-9) <= 1e-7
        assert np.abs(height_m).min() == pytest.approx(0.0, abs=2e-10)


ANSWERS = {  # energies at four forces, stiffness and approach
    "known": [1.0, 2.0, 4.0, 5.0, 10.0, 4e-7], 1: [1.1, 2.0, 4.0, 2.5, 10.0, 4e-7],
    2: [1.0, 1.0, 4.0, 5.0, 10.1, 3.6e-7],
}  # fmt: skip


def change(maps, unsolved=(), code="seams", rest_m=3e-7, left=None):
    """Return what maps of known answers change; the bulk sinks 1e-7 m where that is taken off."""
    curves = {
        name: SimpleNamespace(name=name, approach_m=lambda _, it=it: it[-1])
        for name, it in ANSWERS.items()
    }

    def told(curve, holds_bulk, surface, settings):
        if curve.name in unsolved:
            raise ContactError("no answer")
        return np.array(ANSWERS[curve.name][:-1])

    def scene_of(peaks, none, surface, settings, use, at_ease_rad):
        assert at_ease_rad == (1e-6, -2e-6)  # each map is held as the pressed one
        return surface

    rung = SimpleNamespace(build=curves.get, at_forces=None, holds_bulk=False, left_by_pixels=left)
    contact = SimpleNamespace(
        rung=rung,
        normal=curves["known"],
        bulk_m=1e-7,
        approach_without_bulk_m=rest_m,
        at_ease_rad=(1e-6, -2e-6),
    )
    scene = SimpleNamespace(of=scene_of)
    with mock.patch.multiple(effects, answers=told, Scene=scene):
        caps = SimpleNamespace(usable=None)
        return effects._effect_on_map(code, contact, caps, of_face("pressed"), maps, 0.25)


def test_an_effect_on_the_map_is_the_greatest_of_all_maps_over_the_first():
    """Of three maps; the pressed one is known."""
    assert change(("pressed", 1, 2)).effect.energy == pytest.approx(0.5)
    assert change(("pressed", 1, 2)).effect.tangential_stiffness == pytest.approx(0.01)
    assert change((1, 2)).effect.energy == pytest.approx(1.0)  # the first is the measure
    assert [change(maps).stiffness_N_per_m for maps in ((1, 2), (2, 1))] == [10.0, 10.1]
    one = change(("pressed", 2))
    assert (one.asked, one.approach) == (pytest.approx(0.5), 0.0)
    assert change(("pressed",)) is None  # nothing to compare
    assert change(("pressed", 1, 2), unsolved=(2,)) is None


def test_the_pixels_of_any_of_the_maps_hide_a_change():
    def left(curve, load_N):
        return {0.1: 0.0, 0.25: 0.6 if curve.name == 1 else 0.4, 0.5: 0.1, 0.75: 0.49, 1.0: 9.0}

    found = change(("pressed", 1, 2), left=left)
    assert (found.effect.energy, found.hidden) == (pytest.approx(0.5), pytest.approx(0.5))
    assert change(("pressed", 2), left=left).hidden == 0.0
    parts = change(("pressed", 1, 2), left=left, code="points_filled")
    assert parts.effect.energy == pytest.approx(0.1 / 2**0.5)
    assert parts.hidden == pytest.approx(0.5 / 2**0.5)


def test_of_maps_that_lack_a_part_each_the_standard_error_counts_that_of_the_approach_too():
    """sqrt((g - 1) / g sum d^2): of two parts, of which each moves one number."""
    found = change(("pressed", 1, 2), code="points_filled")
    assert found.effect.energy == pytest.approx(0.5 / 2**0.5)
    assert found.effect.tangential_stiffness == pytest.approx(0.01 / 2**0.5)
    assert found.approach == pytest.approx(0.4 / 3.0 / 2**0.5)  # without the bulk
    kept = change(("pressed", 1, 2), code="points_filled", rest_m=None)
    assert kept.approach == pytest.approx(0.1 / 2**0.5)
