"""White noise that is known is taken off a smooth map, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip.analysis import analyze
from capslip.contact.map_accuracy import error_of_map
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.solvers.denoising import AS_SAID, LEAST_KNOWN, without_noise
from capslip.contact.solvers.elastic_face import elastic_face
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap
from capslip.surface.mating import composite_surface, place

E_STAR_PA, LOAD_N, NOISE_M = 110e9, 100.0, 3e-9
SHARES = (0.1, 0.25, 0.75)
FEW_N = 56.0  # on a map of 60 x 75 points


def waves(seed=1, shape=(120, 160), **more):
    scene = Scene(
        shape, (1e-4, 1.25e-4), seed, waviness_rms_m=3e-7, waviness_length_m=1.2e-3, floor_m=0.0
    )
    return synthetic_surface(replace(scene, **more))[0]


def with_noise(surface, rms_m=NOISE_M, seed=1):
    noise_m = rms_m * np.random.default_rng((7, seed)).standard_normal(surface.shape)
    return replace(surface, height_m=surface.height_m + noise_m)


def taken(surface, noise_m=NOISE_M):
    return without_noise(elastic_face(surface, E_STAR_PA), noise_m)


def off_m(face, surface):
    """Return how far the depths of a face are off those of a surface, less a shift."""
    rest_m = (face.depth_m + surface.height_m)[face.measured]
    return rest_m - rest_m.mean()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_is_left_is_no_more_than_is_said_and_little_of_what_was_there(seed):
    true = waves(seed)
    face = taken(with_noise(true, seed=seed))
    left_m = np.std(off_m(face, true))
    said_m = face.taken.noise_m * np.sqrt(face.taken.left.mean())
    assert face.taken.noise_m == pytest.approx(NOISE_M, rel=0.05)
    assert left_m < 0.45 * NOISE_M
    assert 0.7 * said_m < left_m < 1.1 * said_m
    assert face.depth_m.min() == 0.0


def test_edges_of_the_map_are_as_near_as_its_middle():
    """A transform that turns there alone left twice as much on the outermost lines."""
    edge, off = np.ones((120, 160), dtype=bool), []
    edge[3:-3, 3:-3] = False
    for seed in range(6):
        true = waves(seed)
        here_m = off_m(taken(with_noise(true, seed=seed)), true).reshape(true.shape)
        off.append([np.mean(here_m[edge] ** 2), np.mean(here_m[~edge] ** 2)])
    of_edge_m, of_middle_m = np.sqrt(np.mean(off, axis=0))
    assert of_edge_m < 1.6 * of_middle_m


def test_a_plane_goes_through_and_a_mirrored_or_transposed_map_is_filtered_alike():
    noisy = with_noise(waves())
    y, x = np.indices(noisy.shape)
    found_m = off_m(taken(noisy), noisy)
    tilted = replace(noisy, height_m=noisy.height_m + 2e-8 * x - 1e-8 * y)
    np.testing.assert_allclose(off_m(taken(tilted), tilted), found_m, rtol=0.0, atol=1e-15)
    mirrored = replace(noisy, height_m=noisy.height_m[:, ::-1])
    back_m = taken(mirrored).depth_m[:, ::-1]
    np.testing.assert_allclose(back_m, taken(noisy).depth_m, rtol=0.0, atol=1e-15)
    across = HeightMap(noisy.height_m.T, noisy.pixel_size_m[::-1])
    np.testing.assert_allclose(taken(across).depth_m.T, taken(noisy).depth_m, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("surface", "noise_m"),
    [
        (waves(), NOISE_M),  # a map without noise
        (with_noise(waves()), 1.05 * NOISE_M / AS_SAID),  # of less than is said
        (with_noise(waves()), 0.95 * NOISE_M * AS_SAID),  # of more: the rest is the face's
        (with_noise(waves(waviness_spectrum="power_law")), NOISE_M),  # as rough as its noise
    ],
)
def test_what_is_not_known_to_be_noise_stays(surface, noise_m):
    face = elastic_face(surface, E_STAR_PA)
    assert without_noise(face, noise_m) is face


@pytest.mark.parametrize("said", [0.95, 1.15])
def test_no_more_is_taken_than_is_said_or_seen(said):
    face = taken(with_noise(waves()), said * NOISE_M)
    assert face.taken.noise_m == pytest.approx(min(said, 1.0) * NOISE_M, rel=0.03)
    assert face.taken.noise_m <= said * NOISE_M


def test_noise_that_neighbours_share_stays():
    noise_m = gaussian_filter(np.random.default_rng(3).standard_normal((120, 160)), 1.0)
    true = waves()
    noisy = replace(true, height_m=true.height_m + NOISE_M * noise_m / noise_m.std())
    face = elastic_face(noisy, E_STAR_PA)
    assert without_noise(face, NOISE_M) is face


def mated(pixel, aside, rms_m=NOISE_M, **more):
    """Return a sum of two faces with noise, and without, the second of pixels so much larger."""
    first = waves(1)
    second = waves(2, tuple(round(n / pixel) for n in first.shape), **more)
    second = replace(second, pixel_size_m=tuple(pixel * d_m for d_m in first.pixel_size_m))
    laid = place(first, second, offset_m=tuple(aside * d_m for d_m in first.pixel_size_m))
    noisy = (
        replace(with_noise(one, rms_m, seed=k), noise_m=NOISE_M)
        for k, one in enumerate((first, second))
    )
    return composite_surface(*noisy, laid), composite_surface(first, second, laid)


@pytest.mark.parametrize(("pixel", "aside"), [(1.0, 0.5), (1.3, 0.2), (1.6, 0.0), (0.7, 0.2)])
def test_the_noise_of_a_face_that_was_laid_is_taken_off_as_its_spline_passes_it(pixel, aside):
    """It is no white one, and was left on the map: pixels 1.3 times as large were enough."""
    noisy, true = mated(pixel, aside)
    face = taken(noisy, noisy.noise_m)
    left_m, said_m = np.std(off_m(face, true)), face.taken.left_m
    assert face.taken.noise_m == pytest.approx(noisy.noise_m, rel=0.08)
    assert left_m < 0.5 * noisy.noise_m
    assert 0.65 * said_m < left_m < 1.1 * said_m


@pytest.mark.parametrize(("less", "spectrum"), [(0.7, "gaussian"), (1.0, "power_law")])
def test_what_is_not_known_to_be_noise_stays_on_a_sum(less, spectrum):
    """Where it has less than is said, or a face is as rough as its noise."""
    noisy, _ = mated(1.6, 0.2, less * NOISE_M, waviness_spectrum=spectrum)
    face = elastic_face(noisy, E_STAR_PA)
    assert without_noise(face, noisy.noise_m) is face


@pytest.mark.parametrize("lost", [0.02, 0.15])
def test_lost_points_stay_lost_and_hardly_show_around_them(lost):
    true, noisy = waves(), with_noise(waves())
    holes = np.random.default_rng(2).random(true.shape) < lost
    holes[40:60, 70:95] = True
    face = taken(replace(noisy, height_m=np.where(holes, np.nan, noisy.height_m)))
    np.testing.assert_array_equal(face.measured, ~holes)
    assert (face.depth_m[holes] == 0.0).all()
    assert face.depth_m[~holes].min() == 0.0
    said_m = face.taken.noise_m * np.sqrt(face.taken.left.mean())
    assert np.std(off_m(face, true)) < 1.1 * said_m < 0.7 * NOISE_M


def test_of_a_map_with_too_many_lost_points_none_is_moved():
    noisy = with_noise(waves())
    holes = np.random.default_rng(2).random(noisy.shape) > 0.97 * LEAST_KNOWN
    face = elastic_face(replace(noisy, height_m=np.where(holes, np.nan, noisy.height_m)), E_STAR_PA)
    assert without_noise(face, NOISE_M) is face


def curve_of(surface, noise_m=None):
    return boundary_elements(surface, E_STAR_PA, preload_N=FEW_N, balanced=True, noise_m=noise_m)


def losses_J(curve):
    unloading, drop_N = curve.unloading(FEW_N), np.array(SHARES) * FEW_N
    relative = np.interp(drop_N, unloading.load_drop_N, unloading.loss_J / unloading.load_drop_N**3)
    return relative * drop_N**3


@pytest.mark.long
def test_energies_are_nearer_to_those_without_noise_and_within_what_is_said():
    """Of nine energies, 95 % of which are to be within."""
    off, as_it_was, said = [], [], []
    for seed in range(21, 24):
        true = waves(seed, (60, 75))
        noisy = with_noise(true, seed=seed)
        without, known, unknown = curve_of(true), curve_of(noisy, NOISE_M), curve_of(noisy)
        true_J, unknown_J = (losses_J(one.at_forces(SHARES)) for one in (without, unknown))
        off.append(losses_J(known) / true_J - 1.0)
        as_it_was.append(unknown_J / true_J - 1.0)
        stated, problems = error_of_map(known, FEW_N, 0.05, NOISE_M)
        assert "noise_taken_off" in {problem.code for problem in problems}
        said.append([stated.energy_at(share) for share in SHARES])
    rms, before = (np.sqrt(np.mean(np.square(one), axis=0)) for one in (off, as_it_was))
    assert (rms < 0.6 * before).all()
    assert np.mean(np.abs(off) <= said) >= 11 / 12
    assert (np.median(said, axis=0) < [0.2, 0.1, 0.05]).all()


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
def test_the_answer_of_a_scan_with_known_noise_is_narrower_and_holds_that_of_the_face():
    preload, known = f"contact.preload_N={LOAD_N}", f"instrument.noise_m={NOISE_M}"
    true = waves(5)
    answers = [
        analyze(surface, load_settings(overrides=settings))
        for surface, settings in (
            (true, (preload,)),
            (with_noise(true), (preload, known)),
            (with_noise(true), (preload,)),
        )
    ]
    whole, with_known, unknown = (one.summary()["answer"] for one in answers)
    low, high = with_known["interval"]["energy_J"]
    assert low < whole["energy_J"] < high
    below, above = unknown["interval"]["energy_J"]
    assert high - low < 0.5 * (above - below)
    assert "noise_taken_off" in {problem.code for problem in answers[1].problems}
