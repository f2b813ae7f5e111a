"""Tops that a sensor cut off: put back where the flanks tell them, left where nothing does."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from capslip.analysis import analyze_once
from capslip.settings import load_settings
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.conditioning import condition
from capslip.surface.heightmap import HeightMap, Tops
from capslip.surface.mating import mate, place
from capslip.surface.tops import _Surface, clipped_points, floor_points, restore_tops
from scenes import caps_map

PIXEL_M = (2e-4, 1e-4)
SHAPE = (150, 300)
PEAKS = [
    (6e-3 + 9e-3 * i, 6e-3 + 9e-3 * j, 20.0 + i, -1e-8 * j) for i in range(3) for j in range(3)
]
TILT_M = 3e-5 * PIXEL_M[0] * np.arange(SHAPE[0])[:, None]  # 0.9 um, three caps high


def face(noise_m=0.0, seed=1):
    whole = caps_map(PEAKS, SHAPE, PIXEL_M, -0.4e-6)
    noise = noise_m * np.random.default_rng(seed).standard_normal(SHAPE)
    return replace(whole, height_m=whole.height_m + noise)


def clipped(surface, limit_m=-1.2e-7):
    return replace(surface, height_m=np.minimum(surface.height_m, limit_m))


@pytest.mark.parametrize("limit_m", [-3e-8, -1.2e-7, -2.4e-7])
@pytest.mark.parametrize("tilt", [0.0, 1e-6])
def test_paraboloids_come_back_as_they_were(limit_m, tilt):
    noise_m = 5e-11
    tilted_m = face().height_m + tilt * TILT_M / 3e-5
    measured_m = tilted_m + noise_m * np.random.default_rng(1).standard_normal(SHAPE)
    found = restore_tops(clipped(HeightMap(measured_m, PIXEL_M), limit_m))
    np.testing.assert_allclose(found.height_m, tilted_m, rtol=0.0, atol=5.0 * noise_m)
    assert found.tops.left == 0
    assert (found.tops.height_se_m < 5.0 * noise_m).all()


def test_flat_tops_of_a_computed_map_are_meant():
    worn = clipped(face())
    found = restore_tops(worn)
    np.testing.assert_array_equal(found.height_m, worn.height_m)
    assert (found.tops.left, found.tops.counts["restored"]) == (9, 0)


def test_a_flat_top_is_as_uncertain_as_a_paraboloid_on_its_rim_is_high():
    """Up to twice that, with its place and half width, on pixels twice as long as wide."""
    tops = restore_tops(clipped(face())).tops
    for x_m, y_m, radius_m, peak_m in PEAKS:
        i = np.argmin(np.hypot(tops.x_m - x_m, tops.y_m - y_m))
        assert np.hypot(tops.x_m[i] - x_m, tops.y_m[i] - y_m) < 1e-4
        rim_m = np.sqrt(2.0 * radius_m * (peak_m + 1.2e-7))
        assert tops.radius_m[i] == pytest.approx(rim_m, rel=0.05)
        assert 1.0 < tops.height_se_m[i] / (peak_m + 1.2e-7) < 2.0
    assert (tops.up_m == 0.0).all()


def test_what_was_not_clipped_stays_to_the_bit():
    cut = clipped(face(2e-9))
    found = restore_tops(cut)
    kept = cut.height_m < -1.2e-7
    np.testing.assert_array_equal(found.height_m[kept], cut.height_m[kept])
    assert (found.height_m >= cut.height_m).all()
    assert found.tops.points == np.count_nonzero(~kept) == clipped_points(cut).size


@pytest.mark.long
@pytest.mark.parametrize("noise_m", [1e-9, 4e-9])
def test_standard_errors_are_those_of_the_noise(noise_m):
    """Nine caps on eight faces: their tops stand at the places of the table."""
    z = []
    for seed in range(8):
        tops = restore_tops(clipped(face(noise_m, seed))).tops
        assert tops.x_m.size == 9
        for x_m, y_m, radius_m, peak_m in PEAKS:
            i = np.argmin(np.hypot(tops.x_m - x_m, tops.y_m - y_m))
            off_m2 = (tops.x_m[i] - x_m) ** 2 + (tops.y_m[i] - y_m) ** 2
            true_m = peak_m - off_m2 / (2.0 * radius_m) + 1.2e-7
            z.append((tops.up_m[i] - true_m) / tops.height_se_m[i])
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.5
    assert np.mean(np.abs(z) > 1.96) < 0.1


def test_standard_errors_hold_on_hills_that_are_no_paraboloids():
    """Tops of waves, of which some hide several peaks: what is put back is as good as it says."""
    z, left = [], 0
    for seed in range(150, 154):
        scene = Scene((200, 300), (2e-4, 2e-4), seed=seed, waviness_rms_m=0.4e-6,
                      waviness_length_m=3e-3)  # fmt: skip
        whole = synthetic_surface(scene)[0]
        noise_m = 1e-9 * np.random.default_rng(seed).standard_normal(whole.shape)
        measured = replace(whole, height_m=whole.height_m + noise_m)
        found = restore_tops(clipped(measured, np.quantile(whole.height_m, 0.97)))
        tops, back = found.tops, found.tops.up_m > 0.0
        row, col = (tops.y_m[back] / 2e-4).astype(int), (tops.x_m[back] / 2e-4).astype(int)
        error_m = found.height_m[row, col] - whole.height_m[row, col]
        z += list(error_m / tops.height_se_m[back])
        left += tops.left
        assert (tops.height_se_m[back] <= 0.5 * tops.up_m[back]).all()
        assert (tops.height_se_m[~back] > 0.0).all()
    assert len(z) > 5
    assert left > 5
    assert np.sqrt(np.mean(np.square(z))) < 1.5


@pytest.mark.parametrize("how", ["noise", "tilt", "steps", "steps and noise"])
def test_a_worn_plateau_is_not_put_back(how):
    """Hills worn to one plane: the instrument adds its noise, its steps and how the face lay."""
    worn_m = np.minimum(face().height_m, -1.2e-7)
    noise_m = 1e-9 * np.random.default_rng(2).standard_normal(SHAPE)
    step_m = 5e-9
    measured_m = {
        "noise": worn_m + noise_m,
        "tilt": worn_m + TILT_M,
        "steps": np.round(worn_m / step_m) * step_m,
        "steps and noise": np.round((worn_m + noise_m) / step_m) * step_m,
    }[how]
    surface = HeightMap(measured_m, PIXEL_M)
    np.testing.assert_array_equal(restore_tops(surface).height_m, measured_m)


@pytest.mark.parametrize("step_m", [1e-10, 1e-9, 1e-8, 5e-8])
@pytest.mark.parametrize("noise_m", [0.0, 1e-9])
def test_heights_in_steps_are_not_put_back(step_m, noise_m):
    height_m = np.round(face(noise_m).height_m / step_m) * step_m
    np.testing.assert_array_equal(restore_tops(HeightMap(height_m, PIXEL_M)).height_m, height_m)


def test_steps_that_noise_is_seen_through_are_no_obstacle():
    """As most instruments store heights: finer than their noise."""
    cut = clipped(face(2e-9))
    stored = replace(cut, height_m=np.round(cut.height_m / 5e-10) * 5e-10)
    tops = restore_tops(stored).tops
    assert (tops.x_m.size, tops.left) == (9, 0)


def test_a_grain_without_flanks_stays_flat():
    height_m = face().height_m.copy()
    height_m[60:75, 135:165] = 5e-7
    found = restore_tops(HeightMap(height_m, PIXEL_M))
    np.testing.assert_array_equal(found.height_m, height_m)
    assert (found.tops.x_m.size, found.tops.left) == (1, 1)


def test_a_map_without_clipped_points_is_the_same_object():
    for whole in (face(), face(1e-9), HeightMap(np.zeros((9, 9)), PIXEL_M)):
        assert restore_tops(whole) is whole


def test_a_floor_is_the_top_of_the_face_upside_down():
    cut = clipped(face(1e-9))
    floor = floor_points(replace(cut, height_m=-cut.height_m))
    np.testing.assert_array_equal(floor, clipped_points(cut))
    assert floor.size > 9


def test_a_floor_that_was_designed_or_is_a_step_or_a_few_points_is_no_limit():
    noisy_m = np.maximum(face(1e-9).height_m, -2e-7)
    few_m = noisy_m.copy()
    few_m[few_m == -2e-7] += 1e-9 * np.arange(1, np.count_nonzero(few_m == -2e-7) + 1)
    few_m.flat[:8] = -3e-7
    for height_m in (face().height_m, 2e-8 * np.round(noisy_m / 2e-8 + 0.2), few_m):
        assert floor_points(HeightMap(height_m, PIXEL_M)) is None
    assert floor_points(HeightMap(noisy_m, PIXEL_M)) is not None
    few = slice(18, 43), slice(40, 80)  # around a peak
    assert (noisy_m[few] == -2e-7).sum() > 9
    assert floor_points(HeightMap(noisy_m[few], PIXEL_M)) is not None
    assert floor_points(HeightMap(noisy_m[few][1:], PIXEL_M)) is None


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("model", ["interacting", "boundary_elements"])
def test_a_clipped_face_answers_as_the_whole(model):
    settings = load_settings(overrides=("contact.preload_N=60", f"contact.model={model}"))
    whole = face(1e-10)
    whole, cut = (analyze_once(one, settings) for one in (whole, clipped(whole)))
    assert cut.contact.stiffness_N_per_m == pytest.approx(whole.contact.stiffness_N_per_m, rel=1e-3)
    (said,) = [one for one in cut.problems if one.code == "clipped"]
    assert said.severity == "info"
    assert said.effect.energy < 1e-3
    step = next(one for one in cut.conditioned.steps if one["step"] == "tops")
    assert (step["restored"], step["left"]) == (9, 0)


def test_the_errors_of_tops_are_those_of_their_caps():
    cut = clipped(face(4e-9))
    tops = condition(cut).surface.tops
    found = analyze_once(cut, load_settings(overrides=("contact.preload_N=60",)))
    at_least_m, _, _ = tops.errors_at(found.caps.x_m, found.caps.y_m)
    assert (at_least_m > 0.0).all()
    assert (found.caps.peak_height_se_m >= at_least_m).all()


def test_a_code_for_missing_data_is_no_top():
    height_m = face(1e-9).height_m.copy()
    height_m[40:44, 60:64] = 1e-5
    height_m[39, 60:64] = np.nan
    tops = condition(HeightMap(height_m, PIXEL_M)).surface.tops
    assert tops.points == 16
    assert tops.x_m.size == 0


def test_a_place_that_stays_flat_is_a_warning_with_its_effect():
    """Two peaks under one plateau: no cap carries on."""
    whole = caps_map([*PEAKS, (16e-3, 6e-3, 21.0, 0.0)], SHAPE, PIXEL_M, -0.4e-6)
    steps_m = 4e-9 * np.round(clipped(whole).height_m / 4e-9)
    words = ("contact.preload_N=60", "contact.model=interacting")
    found = analyze_once(HeightMap(steps_m, PIXEL_M), load_settings(overrides=words))
    (said,) = [one for one in found.problems if one.code == "clipped"]
    assert found.conditioned.surface.tops.left > 0
    assert said.severity == "warning"
    assert said.effect.energy > 0.05


@pytest.mark.parametrize(
    ("xx", "xy", "yy", "determinant"),
    [(-2.0, 1.0, -3.0, 5.0), (-2.0, 3.0, -3.0, 0.0), (2.0, 1.0, 3.0, 0.0), (-2.0, 0.0, 3.0, 0.0)],
)
def test_a_surface_curves_by_the_determinant_of_its_second_derivatives(xx, xy, yy, determinant):
    """Of z = xx u^2 / 2 + xy u v + yy v^2 / 2, and none where that is no hill."""
    c = np.array([7.0, 0.3, -0.2, 0.5 * xx, xy, 0.5 * yy])
    found = _Surface((0.0, 0.0), 1.0, c, np.zeros((6, 6)), 0.0)
    assert found.determinant == pytest.approx(determinant)


def test_what_moves_the_curvatures_moves_the_mean_radius_as_their_determinant_says():
    """R ~ det^-1/2, by differences: of coefficients that are off together along one direction."""
    c, off = np.array([7.0, 0.3, -0.2, -1.0, 1.0, -1.5]), np.array([0.1, 0.2, 0.3, 0.4, -0.5, 0.6])
    given = (0.0, 0.0), 1.0
    found = _Surface(*given, c, np.outer(off, off), 0.0)
    ends = [_Surface(*given, c + s * off, np.zeros((6, 6)), 0.0) for s in (-1e-6, 1e-6)]
    log_radius = [-0.5 * np.log(one.determinant) for one in ends]
    assert found.log_radius_se == pytest.approx(abs(np.diff(log_radius)[0]) / 2e-6, rel=1e-6)


def test_a_transposed_map_has_the_same_tops_though_deviations_run_along_one_axis():
    shared_m = gaussian_filter1d(np.random.default_rng(2).standard_normal(SHAPE), 3.0, axis=1)
    measured_m = face(1e-9).height_m + 4e-9 * shared_m
    cut = clipped(HeightMap(measured_m, PIXEL_M))
    along, across = restore_tops(cut), restore_tops(HeightMap(cut.height_m.T, PIXEL_M[::-1]))
    np.testing.assert_allclose(across.height_m.T, along.height_m, rtol=0.0, atol=1e-15)
    order, other = np.argsort(along.tops.x_m), np.argsort(across.tops.y_m)
    assert (along.tops.up_m > 0.0).any()
    for name in ("up_m", "height_se_m", "log_radius_se"):
        found, same = getattr(along.tops, name)[order], getattr(across.tops, name)[other]
        np.testing.assert_allclose(found, same, rtol=1e-6)


def pressed_with(first, second, *more):
    given = ("contact.preload_N=60", "contact.alignment=as_levelled", *more)
    return analyze_once(first, load_settings(overrides=given), second)


def said_of_clipped(found):
    return [one for one in found.problems if one.code == "clipped"]


@pytest.mark.long
@pytest.mark.parametrize(("way", "mirror"), [("composite", "x"), ("together", "y")])
def test_tops_of_the_second_face_are_put_back_and_doubted_as_those_of_the_first(way, mirror):
    cut = clipped(face(4e-9))
    gentle = HeightMap(1e-10 * np.random.default_rng(2).standard_normal(SHAPE), PIXEL_M)
    placed = (f"mating.way={way}", f"mating.mirror={mirror}")
    first, second = pressed_with(cut, gentle, *placed), pressed_with(gentle, cut, *placed)
    (one,), (other,) = said_of_clipped(first), said_of_clipped(second)
    assert one.message.count("9 tops were put back") == 1
    assert other.message.split("; that moves")[0] == one.message.split("; that moves")[0]
    assert other.severity == one.severity
    assert other.effect.energy == pytest.approx(one.effect.energy, rel=0.5)
    a, b = (found.caps for found in (first, second))
    assert len(a) == len(b) == 9
    least_m = condition(cut).surface.tops.height_se_m.min()
    assert a.peak_height_se_m.min() >= least_m
    np.testing.assert_allclose(np.sort(b.peak_height_se_m), np.sort(a.peak_height_se_m), rtol=1e-2)


@pytest.mark.long
def test_each_of_two_scans_tells_of_its_own_tops():
    one, other = clipped(face(1e-9)), clipped(face(1e-9, seed=2), -3e-8)
    found = pressed_with(one, other, "mating.mirror=y")
    alone = [
        said_of_clipped(analyze_once(scan, load_settings(overrides=("contact.preload_N=60",))))
        for scan in (one, other)
    ]
    told = [said.message.split("; that moves")[0] for said in said_of_clipped(found)]
    assert told == [said.message.split("; that moves")[0] for (said,) in alone]
    assert told[0] != told[1]


def test_errors_of_tops_that_meet_add_up_and_others_stay():
    columns = np.array([[1e-3, 1e-3, 5e-3], [1e-3, 1e-3, 1e-3], [2e-4, 3e-4, 2e-4]])
    errors = np.array([[3e-9, 4e-9, 6e-9], [0.06, 0.08, 0.2]])
    tops = Tops(*columns, np.full(3, 1e-8), *errors, 50)
    height_se_m, log_radius_se, area_m2 = tops.errors_at(
        np.array([1e-3, 1e-3, 5e-3, 3e-3]), np.array([1e-3, 1.25e-3, 1e-3, 1e-3])
    )
    assert height_se_m == pytest.approx([5e-9, 4e-9, 6e-9, 0.0], rel=1e-12)
    assert log_radius_se == pytest.approx([0.1, 0.08, 0.2, 0.0], rel=1e-12)
    assert area_m2 == pytest.approx(np.pi * np.square([3e-4, 3e-4, 2e-4, 0.0]), rel=1e-12)


def test_tops_lie_where_the_second_face_does_and_none_beside_the_sum():
    cut, whole = condition(clipped(face(1e-10))), condition(face(1e-10))
    placement = place(whole.surface, cut.surface, offset_m=(-8e-3, 1.5e-3), rotation_rad=0.02)
    own = cut.surface.tops
    x_m, y_m = placement.on_first(own.x_m, own.y_m)
    both = mate(whole, cut, placement)
    inside = (x_m > 0.0) & (x_m < 30e-3) & (y_m > 0.0) & (y_m < 30e-3)
    assert 0 < np.count_nonzero(inside) < 9
    np.testing.assert_allclose(both.surface.tops.x_m, x_m[inside], rtol=1e-12)
    np.testing.assert_allclose(both.surface.tops.y_m, y_m[inside], rtol=1e-12)
    assert both.tops_of_scans == (None, own)
    # of two they are joined: those of the first that the second covers, then those of the second
    print_of_it = mate(cut, cut, placement).surface.tops
    assert print_of_it.x_m.size > both.surface.tops.x_m.size
    assert print_of_it.points == 2 * own.points
    together = mate(cut, cut, placement, way="together").surface.tops
    np.testing.assert_allclose(together.x_m, [*own.x_m, *x_m], rtol=1e-12)
    np.testing.assert_array_equal(together.height_se_m, np.tile(own.height_se_m, 2))
