"""The pressed face: what it says of a model that was forced, and of the bulk term."""

import math
from dataclasses import replace

import numpy as np
import pytest
from contact_cases import E_STAR_PA, table

from capslip import load_settings
from capslip.analysis import analyze, analyze_once
from capslip.caps.families import group_families
from capslip.contact import choice as module
from capslip.contact.press import press
from capslip.errors import ContactError, SettingsError
from capslip.problems import Effect, Problem
from capslip.studies.faces.synthetic import synthetic_surface
from capslip.studies.limits.tries import harmless_faces
from capslip.surface.heightmap import HeightMap
from capslip.verdict import verdict
from scenes import caps_map

PIXEL_M = (2e-4, 2e-4)
SHAPE = (200, 300)
CAPS = [
    (0.010, 0.010, 20.0, 0.50e-6),
    (0.030, 0.012, 24.0, 0.46e-6),
    (0.050, 0.010, 18.0, 0.48e-6),
    (0.012, 0.030, 22.0, 0.44e-6),
    (0.048, 0.031, 25.0, 0.47e-6),
]


def run(*overrides, caps=CAPS, mate=None, by=analyze):
    surface = caps_map(caps, SHAPE, PIXEL_M)
    settings = load_settings(overrides=("conditioning.form=none", *overrides))
    return by(surface, settings, mate)


def messages(analysis):
    return {p.code: p.message for p in analysis.problems if p.severity == "warning"}


def test_a_flat_interface_is_no_answer_without_a_warning():
    analysis = run("contact.model=flat", "contact.preload_N=100")
    assert analysis.damping.peak_loss_factor == 0.0
    assert "model_doubtful" in messages(analysis)
    assert analysis.status == "check"


@pytest.mark.parametrize("model", ["caps", "interacting"])
def test_a_forced_model_has_the_estimate_that_the_choice_would_give_it(model):
    analysis = run(f"contact.model={model}", "contact.preload_N=100")
    found = analysis.caps, analysis.families, analysis.conditioned.surface, analysis.hills.label
    choice = module.choose_model(*found, analysis.hills.noise_m, analysis.settings)
    estimate = analysis.summary()["accuracy"]["estimated"]
    assert estimate == pytest.approx(choice.estimates[model])
    assert (estimate > 0.05) == ("model_doubtful" in messages(analysis)) == (model == "caps")


def test_caps_counted_together_do_not_silence_the_doubt():
    mate = caps_map([(0.035, 0.022, 20.0, 0.5e-6)], SHAPE, PIXEL_M)
    forced = ("mating.way=together", "contact.model=caps", "contact.preload_N=100")
    assert "model_doubtful" in messages(run(*forced, mate=mate))


def test_boundary_elements_do_not_press_two_maps_as_one():
    forced = ("mating.way=together", "contact.model=boundary_elements")
    with pytest.raises(SettingsError, match="composite"):
        run(*forced, mate=caps_map(CAPS, SHAPE, PIXEL_M))


def test_where_interacting_caps_fail_the_error_of_a_lower_rung_is_not_known(monkeypatch):
    def fails(*_):
        raise ContactError("no equilibrium")

    monkeypatch.setattr(module, "reachable", fails)
    analysis = run("contact.model=caps", "contact.preload_N=100")
    assert analysis.contact.estimated_error is None
    assert "not known (no equilibrium)" in messages(analysis)["model_doubtful"]


# 150 contacts spread over the face are stiffer than the half-space under an even pressure
SPREAD = [(2e-3 + 4e-3 * i, 2e-3 + 4e-3 * j, 2.0, 0.0) for i in range(15) for j in range(10)]


def of_bulk(analysis):
    (found,) = (one for one in analysis.problems if one.code == "bulk_kept")
    return found


@pytest.mark.long
def test_a_bulk_term_that_the_greatest_load_of_a_cycle_leaves_nothing_of_is_kept():
    given = ("contact.preload_N=11000", "contact.model=interacting")
    constant = run(*given, caps=SPREAD, by=analyze_once)
    assert not constant.contact.bulk
    varied = run(*given, "slip.normal_amplitude_ratio=0.5", caps=SPREAD, by=analyze_once)
    kept = of_bulk(varied)
    assert varied.contact.approach_m > varied.contact.bulk_m
    assert "approach" not in kept.message  # that is not what fails
    # 1.5 times the load is 1.5^(1/3) times as stiff where contacts feel little of each other
    of_mean = varied.contact.bulk_m / 11000 * varied.contact.stiffness_N_per_m
    assert 1.0 <= kept.effect.tangential_stiffness < 1.5 ** (1 / 3) * of_mean
    assert math.isfinite(varied.summary()["slip"]["total_slip_displacement_m"])


@pytest.mark.long
def test_a_bulk_term_that_cannot_be_taken_out_is_said():
    given = ("contact.preload_N=60000", "contact.model=interacting")
    kept = run(*given, caps=SPREAD, by=analyze_once)
    assert kept.contact.bulk
    said = of_bulk(kept)
    share = kept.contact.bulk_m / 60000 * kept.contact.stiffness_N_per_m
    assert share > 1.0
    assert said.effect == Effect(pytest.approx(share), None, pytest.approx(share))
    assert f"which is {share:.0%} of it under 6e+04 N; nor of the approach: " in said.message
    small = Problem("bow_left", "warning", "said", Effect(0.5, 0.9, 0.9))
    leads = verdict(kept.settings, [small, said], None)
    assert "usable with care as an order of magnitude: nothing would be left of the comp" in leads
    assert kept.contact.approach_m < kept.contact.bulk_m
    assert kept.summary()["contact"]["approach_without_bulk_m"] is None
    asked = run(*given, "contact.bulk=true", caps=SPREAD, by=analyze_once)
    assert "bulk_kept" not in messages(asked)
    without = run("contact.preload_N=100")
    assert not without.contact.bulk
    assert "bulk_kept" not in messages(without)
    rest_m = without.contact.approach_m - without.contact.bulk_m
    assert without.contact.approach_without_bulk_m == pytest.approx(rest_m)


@pytest.mark.parametrize("model", ["caps", "interacting", "mean_field", "families"])
def test_area_and_greatest_pressure_are_those_of_hertz(model):
    """Three caps far apart: two equal ones, and a sharper and lower one that bears little."""
    # the third one stands so low that it is pressed by a quarter of what the others are
    caps = table([0.0, 1e3, 2e3], [0.0, 0.0, 0.0], [20.0, 20.0, 5.0], [0.0, 0.0, -7.5e-8])
    caps = caps.with_columns(family=np.array(["G", "G", "P"]))
    caps, families = group_families(caps)
    face = HeightMap(np.zeros((20, 30)), (2e4, 2e4))
    compression_m = np.array([1e-7, 1e-7, 2.5e-8])
    a_m = np.sqrt(caps.radius_m * compression_m)
    load_N = 4 / 3 * E_STAR_PA * np.sqrt(caps.radius_m) * compression_m**1.5
    settings = load_settings(
        overrides=(f"contact.model={model}", f"contact.preload_N={float(load_N.sum())!r}")
    )
    state, loaded = press(caps, families, face, settings)
    assert state.contacts == 3
    assert state.contact_area_m2 == pytest.approx((np.pi * a_m**2).sum(), rel=1e-3)
    pressure_Pa = 1.5 * load_N / (np.pi * a_m**2)
    assert pressure_Pa[2] == pytest.approx(pressure_Pa[0], rel=1e-9)  # E* sqrt(d / R) alike
    assert state.max_pressure_Pa == pytest.approx(pressure_Pa.max(), rel=1e-3)
    assert loaded.load_N == pytest.approx(load_N, rel=1e-3)
    assert loaded.contact_radius_m == pytest.approx(a_m, rel=1e-3)
    assert state.approach_m == pytest.approx(1e-7, rel=1e-3)
    stiffness = (1.5 * load_N / compression_m).sum()
    assert state.stiffness_N_per_m == pytest.approx(stiffness, rel=1e-3)
    assert state.row_family.tolist() == (["G", "P"] if model == "families" else ["G", "G", "P"])
    assert state.use.all()


def test_the_greatest_pressure_is_that_of_the_hardest_pressed_contact():
    caps = table([0.0, 1e3], [0.0, 0.0], [20.0, 5.0], [0.0, 0.0])
    face = HeightMap(np.zeros((20, 30)), (2e4, 2e4))
    settings = load_settings(overrides=("contact.model=caps", "contact.preload_N=100"))
    caps, families = group_families(caps)
    state, loaded = press(caps, families, face, settings)
    a_m = np.sqrt(caps.radius_m * state.approach_m)
    pressure_Pa = 1.5 * loaded.load_N / (np.pi * a_m**2)
    assert pressure_Pa[1] == pytest.approx(2.0 * pressure_Pa[0], rel=1e-9)  # as 1 / sqrt(R)
    assert state.max_pressure_Pa == pytest.approx(pressure_Pa[1], rel=1e-9)
    assert state.max_pressure_Pa > 1.5 * 100.0 / state.contact_area_m2
    assert state.overlapping_pairs == 0


def test_a_map_that_closes_is_refused_before_its_slip_is_followed(monkeypatch):
    def followed(*given, **more):
        raise AssertionError("unloaded")

    monkeypatch.setattr("capslip.contact.solvers.solutions.unload", followed)
    small = caps_map([(4e-3, 4e-3, 20.0, 0.0)], (40, 40), PIXEL_M)
    given = "contact.model=boundary_elements", "contact.preload_N=1e7", "conditioning.form=none"
    found = analyze(small, load_settings(overrides=given))
    (said,) = (p for p in found.problems if p.code == "contact_failed")
    assert "need a contact area of" in said.message


def test_a_contact_area_beyond_the_face_is_an_error():
    caps, families = group_families(table([0.0, 1.0], [0.0, 0.0], [20.0, 20.0], [0.0, 0.0]))
    settings = load_settings(overrides=("contact.model=caps", "contact.preload_N=100"))
    state, _ = press(caps, families, HeightMap(np.zeros((4, 4)), (1.0, 1.0)), settings)
    side_m = np.sqrt(state.contact_area_m2)

    def face(share):
        return HeightMap(np.zeros((4, 5)), (share * side_m / 4, side_m / 5))

    press(caps, families, face(1.001), settings)
    said = r"need a contact area of \S+ m2 as the face lies; expected less than the \S+ m2 measured"
    with pytest.raises(ContactError, match=said):
        press(caps, families, face(0.999), settings)


def test_the_approach_without_bulk_is_absent_where_it_would_be_negative():
    state = run("contact.model=interacting", "contact.preload_N=100").contact
    assert 0.0 < state.bulk_m < state.approach_m
    rest = {share: replace(state, bulk_m=share * state.approach_m) for share in (0.25, 1.0, 1.01)}
    assert rest[0.25].approach_without_bulk_m == 0.75 * state.approach_m
    assert rest[1.0].approach_without_bulk_m == 0.0
    assert rest[1.01].approach_without_bulk_m is None


@pytest.mark.long
def test_caps_answer_where_noise_decides_on_the_map():
    """Fits average over noise that the map's own contacts feel: they are nearer to the face."""
    clean, noise = caps_map(CAPS, SHAPE, PIXEL_M), np.random.default_rng(2)
    noisy = replace(clean, height_m=clean.height_m + noise.normal(0.0, 1.5e-7, SHAPE))
    words = ("conditioning.form=none", "contact.preload_N=400")
    truth, found, of_map = (
        analyze_once(face, load_settings(overrides=(*words, f"contact.model={model}")))
        for face, model in ((clean, "interacting"), (noisy, "auto"), (noisy, "boundary_elements"))
    )
    assert found.contact.rung.made_from == "spheres"
    (doubt,) = (p for p in found.problems if p.code == "detail_decides")
    assert doubt.severity == "warning"
    assert doubt.effect.energy == found.contact.estimated_error > 0.05
    errors = [
        abs(one.slip.energy_at_force_J(0.25 * one.slip.total_slip_force_N)
            / truth.slip.energy_at_force_J(0.25 * truth.slip.total_slip_force_N) - 1.0)
        for one in (found, of_map)
    ]  # fmt: skip
    assert errors[0] < found.contact.estimated_error
    assert errors[0] < 0.5 * errors[1]


def test_caps_that_are_off_at_small_forces_alone_answer_with_a_note():
    """Noise moves what touches last, which slips first: from a quarter of mu N on it is little."""
    scene, preload_N = harmless_faces(100)["caps of some spread"]
    words = ("contact.model=interacting", f"contact.preload_N={preload_N}")
    truth = analyze_once(synthetic_surface(scene)[0], load_settings(overrides=words))
    face = synthetic_surface(replace(scene, noise_rms_m=2e-9))[0]
    found = analyze(face, load_settings(overrides=words[1:]))
    errors, tolerance = found.contact.errors, found.settings.contact.tolerance
    assert "the noise of the map leaves" in found.contact.model_reason
    assert errors.energy_at(0.25) < tolerance < errors.energy_at(0.1) <= errors.greatest
    (doubt,) = (p for p in found.problems if p.code == "noise_decides")
    assert (doubt.severity, found.status) == ("info", "ok")
    assert "from 25 % of gross slip on" in doubt.message
    for share in (0.1, 0.25, 0.5, 0.75):
        one, other = (
            slip.energy_at_force_J(share * slip.total_slip_force_N)
            for slip in (found.slip, truth.slip)
        )
        assert abs(one / other - 1.0) < errors.energy_at(share)
    small = f"answer.slip_force_N={0.1 * float(found.slip.total_slip_force_N)}"
    asked = analyze(face, load_settings(overrides=(*words[1:], small)))
    assert "small_slip_extrapolated" in messages(asked)
    assert asked.status == "check"


def test_slip_that_overlapping_caps_have_no_end_of_is_told_and_all_before_it_kept(monkeypatch):
    def unstable(*given, **more):
        raise ContactError("contacts overlap so far that they are unstable")

    monkeypatch.setattr("capslip.contact.slip.withdrawal_to_lift_m", unstable)
    surface = caps_map([(4e-3, 4e-3, 20.0, 0.0), (11e-3, 5e-3, 20.0, 0.0)], (60, 90), PIXEL_M)
    given = "contact.model=interacting", "contact.preload_N=1", "contact.alignment=as_levelled"
    found = analyze(surface, load_settings(overrides=given))
    assert found.slip is None
    assert found.status == "failed"
    assert found.summary()["hills"]["caps"] == len(found.caps) > 0
    (said,) = (p for p in found.problems if p.code == "contact_failed")
    assert "unstable" in said.message
