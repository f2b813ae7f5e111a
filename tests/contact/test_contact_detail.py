"""What the finest detail decides: nothing on smooth caps, and then the map is not pressed again."""

from dataclasses import replace

import numpy as np
import pytest

from capslip.contact.bulk import bulk_of_face_m_per_N
from capslip.contact.curve import in_series
from capslip.contact.map_accuracy import (
    ALLOWED,
    LEAST_ERROR,
    PIXELS_95,
    _left_by_detail,
    error_of_map,
)
from capslip.contact.map_doubts import ASKED, doubted_of, less_noise, noisy, of_detail
from capslip.contact.models import boundary_elements as bem
from capslip.contact.solvers import detail
from capslip.contact.solvers.detail import FirstLoading
from capslip.contact.solvers.elastic_face import TakenNoise, elastic_face
from capslip.contact.solvers.polonsky_keer import press
from capslip.contact.solvers.refinement import refinement
from capslip.contact.solvers.unloading import TOLERANCE as BETWEEN_LOADS
from capslip.contact.solvers.unloading import unload
from capslip.problems import Effect
from capslip.studies.faces.finer import finer_waves
from capslip.studies.faces.synthetic import Cap, Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap

E_STAR_PA, LOAD_N, TOLERANCE, TIGHT = 110e9, 200.0, 0.05, 1e-7
CAPS = Scene(
    (120, 180), (2e-4, 2e-4),
    caps=(
        Cap(6e-3, 6e-3, 20.0, 3e-7), Cap(30e-3, 6e-3, 22.0, 2.8e-7), Cap(18e-3, 18e-3, 24.0, 3e-7)
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def surface():
    return synthetic_surface(CAPS)[0]


def solved(surface):
    curve = bem.boundary_elements(surface, E_STAR_PA, preload_N=LOAD_N, balanced=True)
    curve.unloading(LOAD_N)
    return curve


def test_smooth_caps_are_not_pressed_again(surface, monkeypatch):
    curve = solved(surface)
    monkeypatch.setattr(detail, "press", None)
    stated, problems = error_of_map(curve, LOAD_N, TOLERANCE)
    assert problems == ()
    assert stated.stiffness == LEAST_ERROR
    assert stated.energy < TOLERANCE


@pytest.mark.long
def test_roughness_that_the_map_resolves_is_followed_and_taken_for_the_face_s_own():
    """Against the same waves on half the pixels. Solved on its pixels alone the map is 19 % off."""
    scene = Scene((200, 300), (2e-4, 2e-4), seed=4, roughness_rms_m=2e-7, roughness_length_m=2e-3)
    coarse = replace(
        (every := synthetic_surface(scene)[0]),
        height_m=every.height_m[::2, ::2],
        pixel_size_m=(4e-4, 4e-4),
    )
    fine = replace(
        coarse, height_m=finer_waves(coarse.height_m, 2), pixel_size_m=every.pixel_size_m
    )
    rough, truth = (
        bem.boundary_elements(one, E_STAR_PA, preload_N=300.0) for one in (coarse, fine)
    )
    truth = truth.at_forces(detail.FORCE_SHARES)
    stiffness, loss = (
        detail._relative(*(read(one.unloading(300.0)) for one in (rough, truth)))
        for read in (detail._stiffnesses_N_per_m, detail._loss_J)
    )
    assert stiffness.max() < 0.02
    assert loss[1:].max() < 0.01
    assert loss[0] < 0.05  # at a tenth of mu N, of hills that just touch beside the edge of the map
    stated, (said,) = error_of_map(rough, 300.0, TOLERANCE)
    assert (said.code, said.severity) == ("detail_decides", "info")
    assert stated.greatest < TOLERANCE < said.effect.energy


@pytest.mark.long
def test_a_map_that_is_rough_from_pixel_to_pixel_is_pressed_on_halves_of_them():
    """Contacts of 2.5 pixels: on whole ones the energy at a quarter of mu N is 33 % off."""
    scene = Scene((80, 120), (2e-4, 2e-4), seed=3, roughness_rms_m=2e-7, roughness_length_m=6e-4)
    scan, truth = (
        bem.boundary_elements(synthetic_surface(scene, finer=finer)[0], E_STAR_PA)
        .at_forces(detail.FORCE_SHARES)
        .unloading(100.0)
        for finer in (1, 3)
    )
    assert scan.refinement == 2
    assert detail._relative(*(detail._loss_J(one) for one in (scan, truth))).max() < 0.07


@pytest.mark.parametrize(("stands_m", "refinement"), [(0.0, 2), (3e-7, 1)])
def test_no_spline_goes_through_a_step_in_the_contact(stands_m, refinement):
    """Its edges would ring, and nobody knows what lies between its pixels."""
    surface, _ = synthetic_surface(
        Scene((80, 120), (2e-4, 2e-4), seed=4, roughness_rms_m=2e-7, roughness_length_m=6e-4)
    )
    row, column = np.unravel_index(np.argmax(surface.height_m), surface.shape)
    height_m = surface.height_m.copy()
    height_m[row - 2 : row + 3, column - 2 : column + 3] += stands_m
    stands = replace(surface, height_m=height_m)
    assert bem.boundary_elements(stands, E_STAR_PA).unloading(140.0).refinement == refinement


@pytest.mark.long
def test_detail_that_is_smooth_from_pixel_to_pixel_is_a_note_where_the_force_asked_for_is_known():
    """Pixels leave more than half the tolerance at a tenth of mu N, less than it at a quarter."""
    scene = Scene((100, 150), (2e-4, 2e-4), seed=2, roughness_rms_m=2e-7, roughness_length_m=1e-3)
    scan, truth = (
        bem.boundary_elements(synthetic_surface(scene, finer=finer)[0], E_STAR_PA, preload_N=100.0)
        for finer in (1, 4)
    )
    truth = truth.at_forces(detail.FORCE_SHARES)
    stated, said = error_of_map(scan, 100.0, TOLERANCE)
    assert {(one.code, one.severity) for one in said} == {
        ("detail_decides", "info"), ("small_slip_extrapolated", "info")
    }  # fmt: skip
    off = detail._relative(*(detail._loss_J(one.unloading(100.0)) for one in (scan, truth)))
    errors = dict(stated.energy_by_share)
    assert errors[0.1] > 0.5 * TOLERANCE
    assert (off <= [errors[share] for share in detail.FORCE_SHARES]).all()


@pytest.mark.parametrize(("share", "severity"), [(1.0, "warning"), (0.7, "info")])
def test_of_detail_as_much_is_doubted_as_may_be_of_noise(share, severity):
    """Noise that the filter takes off by 0.63 moves 1 / 0.63 as much, and no more is noise."""
    effect = Effect(0.01, 0.2, 0.2)
    of_map = detail.Detail(effect, share, (0.2, 0.04, 0.03, 0.02))
    (said,), factor = of_detail(of_map, 0.0, TOLERANCE, 1e-4, True), doubted_of(of_map)
    assert (said.code, said.severity, said.effect) == ("detail_decides", severity, effect)
    assert factor == pytest.approx(share / 0.63)
    assert (factor * 0.04 > TOLERANCE) == (severity == "warning")
    assert ("up to 4.4%" in said.message) == (severity == "info")


@pytest.mark.parametrize(
    ("of_pixels", "told", "energy"),
    [(0.31, "36 %", np.expm1(0.31)), (0.06, "6.2 %", 0.2), (0.05, None, 0.2)],
)
def test_a_doubt_of_detail_tells_the_pixels_that_leave_more_than_it_moves(of_pixels, told, energy):
    """Whoever reads of 4 % would not know why the interval has 36."""
    of_map = detail.Detail(Effect(0.2, 0.2, 0.2), 1.0, (0.2, 0.055, 0.03, 0.02))
    (said,) = of_detail(of_map, of_pixels, TOLERANCE, 1e-4, of_pixels < 0.1)
    assert (said.severity, said.effect) == ("warning", Effect(0.2, energy, energy))
    assert ("pixels leave up to" in said.message) == (told is not None)
    assert ("instrument.noise_m" in said.step) == (of_pixels > 0.1)  # where it is not known
    assert "s_filter_nesting_index_m=0.0005, if the detail is noise" in said.step
    assert said.step.startswith("scan with smaller pixels") == (told is not None)
    assert said.step.endswith("; else a finer scan") == (told is None)
    assert told is None or f"pixels leave up to {told} in the energy at 25 %" in said.message


@pytest.mark.parametrize(("of_pixels", "finer"), [(0.04, False), (0.08, False), (0.3, True)])
def test_a_doubt_of_noise_tells_the_pixels_and_asks_for_what_helps_most(of_pixels, finer):
    less = less_noise(0.1 / TOLERANCE, None, 1e-4)
    said = noisy("noise of 2e-09 m a point", 0.1, of_pixels, TOLERANCE, less)
    assert (
        said.effect.energy
        == said.effect.loss_factor
        == pytest.approx(np.expm1(np.hypot(0.1, of_pixels)))
    )
    assert "a point leaves up to 11 %" in said.message
    allowed = noisy(ALLOWED.format(4.1e-9), 0.1, of_pixels, TOLERANCE, less).message
    assert allowed.startswith(
        "as much white noise as differences from pixel to pixel allow, 4.1e-09 m a point, leaves up"
    )
    assert ("its pixels up to" in said.message) == (of_pixels > TOLERANCE)
    assert ("smaller pixels" in said.step) == finer
    assert ("=0.0005" in said.step) != finer  # a filter of five pixels


def test_of_what_was_filtered_the_mean_of_enough_scans_is_asked_for():
    """The noise of a mean falls with the root of their number, and what it does with the noise."""
    taken = TakenNoise(2e-9, np.full((3, 4), 0.1))
    assert less_noise(2.9, taken, 1e-4) == (
        "average 9 scans (capslip average), with --set instrument.noise_m=6.7e-10"
    )
    assert less_noise(1.1, taken, 1e-4).startswith("average 2 scans (")


def test_noise_that_nobody_knows_is_asked_for_before_a_filter_is():
    asked = "--set instrument.noise_m=3e-09, if the instrument has as much; else --set "
    assert less_noise(2.0, None, 1e-4, 3e-9).startswith(asked)
    assert "instrument" not in less_noise(2.0, None, 1e-4)


def test_the_noise_that_is_asked_for_is_that_of_one_scan_of_two_faces():
    taken = TakenNoise(2e-9, np.full((3, 4), 0.1))
    assert less_noise(2.0, None, 1e-4, 3e-9, faces=2).startswith("--set instrument.noise_m=2.1e-09")
    assert less_noise(2.9, taken, 1e-4, faces=2).endswith("--set instrument.noise_m=4.7e-10")


@pytest.mark.long
def test_pixels_that_leave_more_than_the_tolerance_at_a_quarter_of_mu_N_are_warned_of(surface):
    """No filter moves smooth caps: what is said is what their pixels leave."""
    curve = solved(surface)
    left = PIXELS_95[ASKED] * curve.unloading(LOAD_N).pixel_error(ASKED * LOAD_N)
    assert left > 0.0
    for tolerance, warned in ((0.9 * left, True), (1.1 * left, False)):
        _, problems = error_of_map(curve, LOAD_N, tolerance)
        said = [one for one in problems if one.code == "small_slip_extrapolated"]
        assert [one.severity for one in said] == ["warning" if warned else "info"]
        assert said[0].effect.energy == pytest.approx(np.expm1(left)) or not warned


@pytest.mark.long
def test_noise_on_them_is_warned_and_its_error_stated(surface):
    """At each force, on each of four draws; an energy that one force hardly moves, others do."""
    clean, times = detail._loss_J(solved(surface).unloading(LOAD_N)), []
    for seed in (1, 2, 4, 7):
        noise_m = np.random.default_rng(seed).normal(0.0, 4e-8, surface.shape)
        noisy = solved(replace(surface, height_m=surface.height_m + noise_m))
        stated, problems = error_of_map(noisy, LOAD_N, TOLERANCE)
        assert [one.code for one in problems] == ["detail_decides"]
        off = detail._relative(clean, detail._loss_J(noisy.unloading(LOAD_N)))
        assert off.max() > TOLERANCE
        assert (off <= [stated.energy_at(share) for share in detail.FORCE_SHARES]).all()
        times.append(stated.energy / off.max())
    assert np.median(times) < 4.0  # to first order noise would say 40 times


def test_half_of_a_value_is_as_far_off_as_twice_of_it_and_strong_noise_moves_all_forces():
    of_map = detail.Detail(Effect(0.5, 0.5, 0.5), 1.0, (0.2, 0.5, 0.1, 1.0 - 1.0 / 3.0))
    stiffness, energy = _left_by_detail(of_map, 0.5, strong=False)
    assert stiffness == pytest.approx(0.5 * np.log(2.0))
    assert list(energy.values()) == pytest.approx([0.5 * np.log(3.0)] * 4)
    of_map = replace(of_map, energy=(0.5, 0.2, 0.1, 0.2))
    _, energy = _left_by_detail(of_map, 1.0, strong=False)
    assert list(energy.values()) == pytest.approx(np.log([2.0, 1.25, 1.25, 1.25]))
    stiffness, energy = _left_by_detail(of_map, 1.0, strong=True)
    assert stiffness > np.log(2.0)
    assert list(energy) == list(detail.FORCE_SHARES)
    assert min(energy.values()) == max(energy.values()) > np.log(2.0)
    everything = replace(of_map, energy=(1.0,) * 4)
    assert np.isfinite(list(_left_by_detail(everything, 1.0, strong=True)[1].values())).all()


def test_a_lost_point_on_a_contact_is_filled_and_looked_at(surface):
    height_m = surface.height_m.copy()
    height_m[30, 30] = np.nan
    curve = solved(replace(surface, height_m=height_m))
    first = curve.first
    assert detail._smoothed(first.face).measured.all()
    assert not detail._hardly_moves(first, detail._smoothed(first.face))


def test_a_shape_that_the_filter_leaves_has_no_detail_whatever_its_pixels_leave():
    """A paraboloid on its pixels alone: what a spline on finer ones moves is said of pixels."""
    y_m, x_m = (np.indices((60, 60)) - 29.7) * 2e-4
    face = elastic_face(HeightMap(-(x_m**2 + y_m**2) / 40.0, (2e-4, 2e-4)), E_STAR_PA)
    pressed = press(face, load_N=20.0)
    assert refinement(face, pressed) > 1
    unloading = unload(face, pressed, TIGHT, on_patches=False)
    first = FirstLoading(face, pressed.approach_m)
    found = detail.effect_of_detail(first, unloading, TIGHT, 0.0, resolved=False)
    assert found.effect.greatest < BETWEEN_LOADS
    finer = unload(face, pressed, TIGHT)
    off = detail._relative(*(detail._loss_J(one) for one in (unloading, finer)))
    left = [PIXELS_95[at] * unloading.pixel_error(at * 20.0) for at in detail.FORCE_SHARES]
    assert off[0] > 0.5
    assert (off <= left).all()


def test_where_a_filter_is_set_no_other_one_is_a_way_out():
    """It was tried, and a wider one takes more of the face."""
    of_map = detail.Detail(Effect(0.2, 0.2, 0.2), 1.0, (0.2, 0.055, 0.03, 0.02))
    for of_pixels in (0.31, 0.05):
        for known in (True, False):
            (said,) = of_detail(of_map, of_pixels, TOLERANCE, 1e-4, known, filtered=True)
            assert "s_filter" not in said.step
            assert ("instrument.noise_m" in said.step) != known
            assert said.step.lower().startswith("scan with smaller pixels") == (
                known or of_pixels > 0.3
            )
    assert _no_filter_in(less_noise(2.0, None, 1e-4, filtered=True))
    assert _no_filter_in(less_noise(2.0, None, 1e-4, 3e-9, filtered=True))


def _no_filter_in(step):
    return "average 4 scans" in step and "s_filter" not in step


def test_what_is_doubted_at_a_force_is_what_is_left_there_and_no_more_is_asked_beyond_gross_slip():
    of_map = detail.Detail(Effect(0.02, 0.5, 0.5), 0.63, (0.5, 0.4, 0.2, 0.04))
    told = {}
    for share in (0.25, 0.4, 0.5, 0.75, 1.0):
        (said,) = of_detail(of_map, 0.0, TOLERANCE, 1e-4, True, share)
        told[share] = said.severity, said.effect.energy
    assert told[0.25] == ("warning", 0.5)  # from a tenth on, as where nothing is asked
    assert told[0.5] == ("warning", 0.2)
    assert told[0.75] == told[1.0] == ("info", 0.04)
    at = np.log((0.25, 0.4, 0.5))
    assert told[0.4] == ("warning", pytest.approx(np.interp(at[1], at[::2], (0.4, 0.2))))
    for share in (0.7, 1.0):
        (said,) = of_detail(of_map, 0.9, 0.001, 1e-4, True, share)
        assert f"at {100 * share:.0f} % of gross slip" in said.message
        assert ("ask at a greater force" in said.step) == (share < 1.0)


@pytest.mark.long
def test_errors_of_a_map_tell_what_is_left_at_any_force(surface):
    """Pixels of smooth caps leave less, the more slips: at a greater force it is no warning."""
    curve = solved(surface)
    known = {
        share: PIXELS_95[share] * curve.unloading(LOAD_N).pixel_error(share * LOAD_N)
        for share in PIXELS_95
    }
    assert known[0.5] < known[0.25]
    stated, found = error_of_map(curve, LOAD_N, 0.99 * known[0.25])
    assert stated.doubts_at(ASKED) == found[-1:]  # before it, what is left between the loads
    said = found[-1]
    assert (said.code, said.severity) == ("small_slip_extrapolated", "warning")
    assert [one.severity for one in stated.doubts_at(0.5)] == ["info"]  # of a tenth, as ever
    between, _ = error_of_map(curve, LOAD_N, 0.5 * min(known[0.25], known[0.5]))
    (said,) = between.doubts_at(0.4)
    low, high = sorted(np.expm1([known[0.25], known[0.5]]))
    assert low < said.effect.energy < high
    assert "at 40 % of the force at gross slip" in said.message


def with_the_bulk_and_without(surface, noise_m, load_N):
    """Return stiffness, errors and the effect of detail of a noisy map, of the whole and alone."""
    height_m = surface.height_m + np.random.default_rng(0).normal(0.0, noise_m, surface.shape)
    noisy = replace(surface, height_m=height_m)
    whole = bem.boundary_elements(noisy, E_STAR_PA, preload_N=load_N)
    for curve in (whole, in_series(whole, -bulk_of_face_m_per_N(surface, E_STAR_PA))):
        stated, said = error_of_map(curve, load_N, TOLERANCE)
        effect = next(one.effect for one in said if one.code == "detail_decides")
        yield float(curve.stiffness_N_per_m(curve.approach_m(load_N))), stated, effect


def test_the_stiffness_with_the_bulk_in_series_errs_by_the_share_of_the_contact(surface):
    """1 / K = c + 1 / K_contact: d ln K = (K / K_contact) d ln K_contact, and W is the same."""
    (K, stated, effect), (alone, of_contact, decides) = with_the_bulk_and_without(
        surface, 2e-8, LOAD_N
    )
    share = K / alone
    assert share == pytest.approx(1.0 - K * bulk_of_face_m_per_N(surface, E_STAR_PA))
    # A secant, of which the contact has more, moves by more
    moved = effect.tangential_stiffness / decides.tangential_stiffness
    assert share < 1.02 * moved < 1.02
    assert share < stated.stiffness / of_contact.stiffness < 1.0
    assert (stated.energy, effect.energy) == (of_contact.energy, decides.energy)


def test_however_stiff_the_contact_may_be_the_bulk_in_series_bounds_the_stiffness():
    """A face that closes: K < 1 / c."""
    scene = Scene((80, 120), (2e-4, 2e-4), seed=4, roughness_rms_m=2e-7, roughness_length_m=1.5e-3)
    rough, _ = synthetic_surface(scene)
    (K, stated, _), (_, of_contact, _) = with_the_bulk_and_without(rough, 3e-8, 1500.0)
    most_N_per_m = 1.0 / bulk_of_face_m_per_N(rough, E_STAR_PA)
    assert 0.9 * most_N_per_m < K < K * np.exp(stated.stiffness) < most_N_per_m
    assert K * np.exp(of_contact.stiffness) > most_N_per_m
