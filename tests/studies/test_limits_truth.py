"""The truth of the limits study is that of the face, not of the pixels of its scan."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from capslip.errors import SettingsError
from capslip.settings import load_settings
from capslip.studies.faces.finer import finer_places, finer_profile, finer_waves
from capslip.studies.faces.synthetic import synthetic_surface
from capslip.studies.limits import changes
from capslip.studies.limits.axes import axes
from capslip.studies.limits.case import Case
from capslip.studies.limits.known import energy_names, known_answers
from capslip.studies.limits.measure import measure
from capslip.studies.limits.of_face import LEFT, answers_of_face
from capslip.studies.limits.tries import (
    harmless_faces,
    paired_caps,
    rough,
    self_affine,
    wavy,
)


def settings_at(preload_N):
    return load_settings(overrides=(f"contact.preload_N={preload_N!r}",))


def answers(found):
    return np.array([found.approach_m, found.stiffness_N_per_m, *found.energy_J])


@pytest.mark.parametrize("shape", [(8, 12), (9, 7)])
def test_finer_waves_are_the_sinusoids_of_the_map(shape):
    (ny, nx), times = shape, 4
    phase = 2 * np.pi * (2 * finer_places(ny, times)[:, None] / ny + finer_places(nx, times) / nx)
    fine = np.sin(phase + 0.7) + np.cos(2 * np.pi * 3 * finer_places(nx, times) / nx)
    row, col = np.arange(ny)[:, None], np.arange(nx)
    wave = np.sin(2 * np.pi * (2 * row / ny + col / nx) + 0.7) + np.cos(2 * np.pi * 3 * col / nx)
    np.testing.assert_allclose(finer_waves(wave, times), fine, atol=1e-12)


def test_finer_waves_hold_nothing_shorter_than_two_pixels():
    noise = np.random.default_rng(3).standard_normal((16, 20))
    power = np.abs(np.fft.fft2(finer_waves(noise, 4))) ** 2
    inside = np.outer(
        np.abs(np.fft.fftfreq(64, 0.25)) <= 0.5, np.abs(np.fft.fftfreq(80, 0.25)) <= 0.5
    )
    assert power[~inside].max() < 1e-20 * power.max()


def test_a_profile_that_does_not_close_is_the_cosines_through_its_points():
    places = finer_places(12, 3)
    cosines = np.cos(np.pi * 5 * (places + 0.5) / 12) + 0.3 * np.cos(np.pi * (places + 0.5) / 12)
    np.testing.assert_allclose(finer_profile(cosines[1::3], 3), cosines, atol=1e-12)


@pytest.mark.parametrize(
    "scene",
    [
        wavy(1e-3, 50),
        self_affine(0.5, 60),
        replace(harmless_faces(0)["smaller caps"][0], **rough(1e-8)),
        paired_caps(1.0, 0),
    ],
)
@pytest.mark.parametrize(
    "change",
    [
        lambda surface, truth, finer: surface,
        partial(changes.with_lay, x=1e-7, seed=0),
        partial(changes.elongated, x=4.0, seed=0),
    ],
)
def test_a_face_on_finer_pixels_holds_the_points_of_its_scan(scene, change):
    scan = change(*synthetic_surface(scene), 1)
    fine = change(*synthetic_surface(scene, finer=3), 3)
    np.testing.assert_allclose(fine.height_m[1::3, 1::3], scan.height_m, atol=1e-18)
    assert fine.side_m == pytest.approx(scan.side_m)


def test_what_is_of_the_points_of_a_map_has_no_finer_one():
    with pytest.raises(SettingsError, match="between the points"):
        synthetic_surface(replace(wavy(5e-3, 50), noise_rms_m=1e-9), finer=2)


@pytest.mark.long
def test_separate_caps_pressed_answer_as_interacting_caps_do():
    scene, preload_N = harmless_faces(0)["smaller caps"]
    case, settings = Case("", 0.0, "caps", scene, preload_N), settings_at(preload_N)
    known = known_answers(case, settings, {})
    expected = [
        known.values[name] for name in ("approach", "stiffness", *energy_names(case.shares))
    ]
    np.testing.assert_allclose(answers(answers_of_face(case, settings)), expected, rtol=0.01)


@pytest.mark.long
def test_the_truth_does_not_know_the_pixels_of_the_scan():
    scene = paired_caps(1.4, 0)
    coarser = replace(scene, shape=(150, 225), pixel_size_m=(4e-2 / 150, 6e-2 / 225))
    found = [
        answers_of_face(Case("", 0.0, "caps", one, 460.0), settings_at(460.0))
        for one in (scene, coarser)
    ]
    assert {one.uncertainty for one in found} == {LEFT}
    np.testing.assert_allclose(answers(found[1]), answers(found[0]), rtol=2 * LEFT)


def test_the_truth_is_not_that_of_the_map():
    """The points of a scan miss the summits between them, from which the approach counts."""
    case = Case("", 0.0, "rough", self_affine(0.5, 60), 100.0)
    found = answers_of_face(case, settings_at(100.0))
    (scan, _), (fine, _) = synthetic_surface(case.scene), synthetic_surface(case.scene, finer=8)
    missed_m = fine.height_m.max() - scan.height_m.max()
    assert missed_m > 0.05 * found.approach_m


@pytest.mark.long
def test_a_hill_that_touches_between_the_last_pixels_and_the_edge_is_found():
    """On a map of 2 mm waves no pixel of it touches, and it takes 11 % of the energy at 0.25."""
    axis = next(axis for axis in axes() if axis.name == "wavy faces")
    case = next(case for case in axis.cases if case.name == "waves of 2 mm, 100 N, seed 50")
    run = measure([replace(axis, cases=(case,))], ("default",))["runs"][0]
    assert run["outcome"] == "right"
    assert max(abs(error) for error in run["errors"].values()) < 0.03
