"""What the blur of the optics moves of a map: not in its error, until one more blur tells."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from capslip.analysis import _open, analyze_once
from capslip.contact import map_accuracy
from capslip.contact.map_accuracy import BLURRED_95, OF_BLURRED, _left_by_blur, error_of_map
from capslip.contact.map_doubts import LEAST_MOVED, of_resolution
from capslip.contact.models import boundary_elements as bem
from capslip.contact.press import _by_detail
from capslip.contact.rung import ModelError, asked_of_error
from capslip.contact.solvers import detail
from capslip.contact.trials import FaceOfCaps, Trials
from capslip.errors import ContactError
from capslip.problems import Effect, Problem
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import Cap, Scene, synthetic_surface
from capslip.surface.filters import SIGMA_PER_NESTING_INDEX, blurred

E_STAR_PA, TOLERANCE, LOAD_N, PIXEL_M = 110e9, 0.05, 120.0, 2e-4
FINER = 3
PERIOD_M = 4.8 * PIXEL_M  # a standard deviation of 0.9 pixels
WAVES = Scene((60, 90), (PIXEL_M, PIXEL_M), seed=4, roughness_rms_m=2e-7, roughness_length_m=1.6e-3)
CAPS = Scene(
    (80, 120), (PIXEL_M, PIXEL_M),
    caps=(Cap(4e-3, 4e-3, 20.0, 3e-7), Cap(20e-3, 4e-3, 22.0, 3e-7), Cap(12e-3, 12e-3, 24.0, 3e-7)),
)  # fmt: skip


def pressed(surface):
    return bem.boundary_elements(surface, E_STAR_PA, preload_N=LOAD_N)


def blurred_face(surface):
    everywhere = np.isfinite(surface.height_m)
    height_m = blurred(surface.height_m, everywhere, surface.pixel_size_m, PERIOD_M)
    return replace(surface, height_m=height_m)


@pytest.fixture(scope="module")
def faces():
    """Return a face on pixels of a third, and what optics show of it on whole ones."""
    face, _ = synthetic_surface(WAVES, finer=FINER)
    middle = np.s_[FINER // 2 :: FINER, FINER // 2 :: FINER]
    seen = blurred_face(face)
    size_m = (PIXEL_M, PIXEL_M)
    scan = replace(seen, height_m=seen.height_m[middle], pixel_size_m=size_m)
    return face, scan


@pytest.mark.long
def test_what_a_blur_has_moved_is_in_the_error_once_the_optics_are_known(faces):
    """Of a map that is smooth, and so thought to be a good one."""
    truth, scan = (pressed(one) for one in faces)
    truth = truth.at_forces(detail.FORCE_SHARES)
    off = detail._relative(*(detail._loss_J(one.unloading(LOAD_N)) for one in (scan, truth)))
    without, said_without = error_of_map(scan, LOAD_N, TOLERANCE)
    stated, said = error_of_map(scan, LOAD_N, TOLERANCE, period_m=PERIOD_M)
    before, after = (
        np.array([one.energy_at(share) for share in detail.FORCE_SHARES])
        for one in (without, stated)
    )
    assert (np.log1p(-off) < -2.0 * before)[1:].any()
    assert (-np.log1p(-off) <= after).all()
    assert "resolution_decides" not in {one.code for one in said_without}
    (of_optics,) = [one for one in said if one.code == "resolution_decides"]
    assert of_optics.severity == "warning"
    assert "halve waves of 0.00096 m" in of_optics.message
    assert [one for one in said if one is not of_optics] == list(said_without)


@pytest.mark.long
def test_what_the_blur_leaves_is_a_cause_of_its_own(faces):
    curve = pressed(faces[1])
    without, _ = error_of_map(curve, LOAD_N, TOLERANCE)
    stated, _ = error_of_map(curve, LOAD_N, TOLERANCE, period_m=PERIOD_M)
    first = curve.loaded_first_to(LOAD_N)
    blur = _left_by_blur(curve, LOAD_N, first, PERIOD_M)
    for (share, error), (_, of_others) in zip(
        stated.energy_by_share, without.energy_by_share, strict=True
    ):
        assert error == pytest.approx(np.hypot(of_others, blur.energy_at(share)), rel=1e-9)
    stiffness = np.hypot(without.stiffness, blur.effect.tangential_stiffness)
    assert stated.stiffness == pytest.approx(stiffness, rel=1e-9)
    assert stated.energy == max(error for _, error in stated.energy_by_share)


@pytest.mark.long
def test_what_is_left_is_so_many_times_what_one_more_blur_moves(faces):
    """The blurred map pressed as any other has the stiffness from which that is counted."""
    scan = faces[1]
    curve, again = pressed(scan), pressed(blurred_face(scan))
    loss = [detail._loss_J(one.unloading(LOAD_N)) for one in (curve, again)]
    stiffness = [detail._stiffnesses_N_per_m(one.unloading(LOAD_N)) for one in (curve, again)]
    blur = _left_by_blur(curve, LOAD_N, curve.loaded_first_to(LOAD_N), PERIOD_M)
    stiffer, more = (np.abs(np.log(one[0] / one[1])).max() for one in (stiffness, loss))
    assert blur.effect.tangential_stiffness == pytest.approx(BLURRED_95[0] * stiffer, rel=0.15)
    assert blur.effect.energy == pytest.approx(BLURRED_95[1] * more, rel=0.25)
    assert blur.energy == (blur.effect.energy,) * len(detail.FORCE_SHARES)


def test_the_energy_moves_so_many_times_as_much_as_the_stiffness_at_least(monkeypatch):
    """What a blur moves of it may cross zero at each force that is looked at."""
    curve = SimpleNamespace(solutions=None)
    monkeypatch.setattr(map_accuracy, "_asked_of_smoother", lambda *_: ())
    for energy, expected in ((0.01, OF_BLURRED * 0.1), (0.4, -np.log1p(-0.4))):
        again = detail.Detail(Effect(1.0 - np.exp(-0.1), energy, energy))
        monkeypatch.setattr(map_accuracy, "effect_of_blur", lambda *_, found=again: found)
        effect = _left_by_blur(curve, LOAD_N, None, PERIOD_M).effect
        assert effect.tangential_stiffness == pytest.approx(BLURRED_95[0] * 0.1)
        assert effect.energy == pytest.approx(BLURRED_95[1] * expected)


@pytest.mark.long
def test_of_round_tops_optics_take_nothing_and_nothing_is_said():
    """A blur lowers a sphere, and leaves its curvature."""
    curve = pressed(synthetic_surface(CAPS)[0])
    without, said = error_of_map(curve, LOAD_N, TOLERANCE)
    assert error_of_map(curve, LOAD_N, TOLERANCE, period_m=3.0 * PIXEL_M) == (without, said)
    assert "resolution_decides" not in {one.code for one in said}


def test_what_moves_less_than_the_tolerance_is_a_note_and_less_than_a_thousandth_none():
    def said(stiffness, energy):
        blur = detail.Detail(Effect(stiffness, energy, energy))
        return [(one.severity, one.effect) for one in of_resolution(blur, TOLERANCE, 1e-6)]

    assert said(0.9 * LEAST_MOVED, 0.9 * LEAST_MOVED) == []
    ((severity, _),) = said(0.9 * TOLERANCE, 0.9 * TOLERANCE)
    assert severity == "info"
    ((severity, effect),) = said(1.1 * TOLERANCE, 0.01)
    assert severity == "warning"
    assert effect.tangential_stiffness == pytest.approx(np.expm1(1.1 * TOLERANCE))
    ((severity, effect),) = said(0.01, 1.1 * TOLERANCE)
    assert (severity, effect.energy) == ("warning", pytest.approx(np.expm1(1.1 * TOLERANCE)))


def test_the_optics_are_those_of_the_settings():
    given = load_settings(overrides=("instrument.lateral_period_limit_m=3um",))
    assert asked_of_error(given, None)[-1] == pytest.approx(3e-6)
    assert asked_of_error(load_settings(), None)[-1] is None


SHARP_AND_BLUNT = Scene(
    (80, 120), (PIXEL_M, PIXEL_M),
    caps=(
        Cap(4e-3, 4e-3, 4.0, 3.04e-7), Cap(20e-3, 4e-3, 24.0, 3e-7), Cap(12e-3, 12e-3, 24.0, 3e-7),
        Cap(5e-3, 12e-3, 4.0, 3.0e-7), Cap(19e-3, 12e-3, 8.0, 3e-7),
    ),
)  # fmt: skip


def found(surface, *overrides):
    words = ("contact.preload_N=10", "contact.model=interacting", *overrides)
    return analyze_once(surface, load_settings(overrides=words))


OPTICS = f"instrument.lateral_period_limit_m={PERIOD_M}"


def test_a_cap_sinks_by_the_variance_of_a_blur_over_its_radius_which_stays():
    scan = synthetic_surface(SHARP_AND_BLUNT)[0]
    one = found(scan, OPTICS)
    trials = Trials(FaceOfCaps(scan, one.settings), one.caps, one.caps, one.conditioned)
    (moved,) = trials.of("resolution_decides")
    of_caps = one.caps.usable
    sunk_m = (one.caps.peak_height_m - moved.peak_height_m)[of_caps]
    variance_m2 = (SIGMA_PER_NESTING_INDEX * PERIOD_M) ** 2
    assert of_caps.sum() == 5
    assert sunk_m == pytest.approx(variance_m2 / one.caps.radius_m[of_caps], rel=0.02)
    assert moved.radius_m[of_caps] == pytest.approx(one.caps.radius_m[of_caps], rel=0.01)
    unsaid = found(scan)
    nobody = Trials(FaceOfCaps(scan, unsaid.settings), *(one.caps,) * 2, one.conditioned)
    with pytest.raises(ContactError, match="no other map"):
        list(nobody.of("resolution_decides"))


def test_caps_say_what_the_optics_took_off_them():
    """Sharp tops sink more than blunt ones: W is 11 % off, the stiffness by a thousandth."""
    face = synthetic_surface(SHARP_AND_BLUNT)[0]
    truth, scan = found(face), found(blurred_face(face), OPTICS)
    (said,) = [one for one in scan.problems if one.code == "resolution_decides"]
    stiffness, *energies = (
        abs(read(scan.slip) / read(truth.slip) - 1.0)
        for read in (
            lambda slip: slip.tangential_stiffness_N_per_m,
            *(
                lambda slip, share=share: slip.energy_at_force_J(share * slip.total_slip_force_N)
                for share in detail.FORCE_SHARES
            ),
        )
    )
    assert 0.0 < stiffness <= said.effect.tangential_stiffness
    assert said.effect.energy == pytest.approx(max(energies), rel=0.2)
    assert "(estimated with the caps)" in said.message
    assert "resolution_decides" not in {one.code for one in found(blurred_face(face)).problems}
    tiny = found(blurred_face(face), "instrument.lateral_period_limit_m=0.1um")
    assert "resolution_decides" not in {one.code for one in tiny.problems}


def test_caps_do_not_answer_for_a_map_because_both_are_blurred():
    of_blur = Problem("resolution_decides", "warning", "")
    of_detail = Problem("detail_decides", "warning", "")
    errors = ModelError(0.05, 0.5, ((0.25, 0.5), (1.0, 0.4)), blur=(0.03, 0.3))
    assert _by_detail(errors, (of_blur,)) == 0.0
    assert _by_detail(errors, (of_blur, of_detail)) == pytest.approx(0.4)
    less = errors.without_blur
    assert (less.stiffness, less.energy, less.blur) == (pytest.approx(0.04), 0.4, (0.0, 0.0))
    assert less.energy_at(1.0) == pytest.approx(np.sqrt(0.4**2 - 0.3**2))


def test_an_interval_of_caps_names_what_the_optics_move_and_that_of_a_map_holds_it():
    of_blur = Problem("resolution_decides", "warning", "", Effect(0.1, 0.1, 0.1))
    assert _open([of_blur], of_map=False) == ("what resolution_decides moves",)
    assert _open([of_blur], of_map=True) == ()
    assert _open([replace(of_blur, severity="info")], of_map=False) == ()
