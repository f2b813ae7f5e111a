"""The pressed face: what it says of a model that was forced, and of the bulk term."""

import pytest

from capslip import load_settings
from capslip.analysis import analyze
from capslip.contact import choice as module
from capslip.errors import ContactError, SettingsError
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


def run(*overrides, caps=CAPS, mate=None):
    surface = caps_map(caps, SHAPE, PIXEL_M)
    settings = load_settings(overrides=("conditioning.form=none", *overrides))
    return analyze(surface, settings, mate)


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
    found = analysis.caps, analysis.families, analysis.surface, analysis.hills.label
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

    monkeypatch.setattr(module, "choose_model", fails)
    analysis = run("contact.model=caps", "contact.preload_N=100")
    assert analysis.contact.estimated_error is None
    assert "not known (no equilibrium)" in messages(analysis)["model_doubtful"]


def test_a_bulk_term_that_cannot_be_taken_out_is_said():
    # 150 contacts spread over the face are stiffer than the half-space under an even pressure
    grid = [(2e-3 + 4e-3 * i, 2e-3 + 4e-3 * j, 2.0, 0.0) for i in range(15) for j in range(10)]
    kept = run("contact.preload_N=60000", caps=grid)
    assert kept.contact.bulk
    assert "bulk_kept" in messages(kept)
    assert kept.contact.approach_m < kept.contact.bulk_m
    assert kept.summary()["contact"]["approach_without_bulk_m"] is None
    asked = run("contact.preload_N=60000", "contact.bulk=true", caps=grid)
    assert "bulk_kept" not in messages(asked)
    without = run("contact.preload_N=100")
    assert not without.contact.bulk
    assert "bulk_kept" not in messages(without)
    rest_m = without.contact.approach_m - without.contact.bulk_m
    assert without.contact.approach_without_bulk_m == pytest.approx(rest_m)
