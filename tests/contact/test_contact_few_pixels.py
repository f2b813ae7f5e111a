"""Maps with few pixels in contact: followed where a spline knows them, else from eight on."""

import numpy as np
import pytest

import capslip
from capslip.analysis import analyze_once
from capslip.contact.map_accuracy import LEAST_ERROR, STIFFNESS_95, error_of_map, left_by_pixels
from capslip.contact.material import composite
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.models.caps import caps
from capslip.contact.plastic_law import of_contact
from capslip.contact.solvers import detail
from capslip.errors import ContactError
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap

E, TOLERANCE = 110e9, 0.05


def found_and_true(seed, length_m, load_N):
    """Return the curve of a rough scan, and how far it is off one of a quarter of the pixel."""
    scene = Scene(
        (60, 90), (2e-4, 2e-4), seed=seed, roughness_rms_m=2e-7, roughness_length_m=length_m
    )
    scan, truth = (
        boundary_elements(synthetic_surface(scene, finer=finer)[0], E) for finer in (1, 4)
    )
    found, true = scan.unloading(load_N), truth.at_forces(detail.FORCE_SHARES).unloading(load_N)
    stiffness = found.stiffness_N_per_m / true.stiffness_N_per_m - 1
    return scan, abs(stiffness), detail._relative(*map(detail._loss_J, (found, true)))


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "length_m", "load_N"),
    [(41, 2e-3, 5.0), (44, 2e-3, 5.0), (43, 1e-3, 10.0), (45, 1e-3, 10.0)],
)
def test_a_spline_knows_the_contacts_of_few_pixels(seed, length_m, load_N):
    scan, stiffness, energy = found_and_true(seed, length_m, load_N)
    assert 20 <= np.count_nonzero(scan.pressed(load_N).pressure_Pa) < 50
    assert stiffness < 0.01
    assert (energy[1:] < (0.08, 0.02, 0.01)).all()
    stated, _ = error_of_map(scan, load_N, TOLERANCE)
    assert stiffness < stated.stiffness
    assert (energy < [stated.energy_at(share) for share in detail.FORCE_SHARES]).all()


@pytest.mark.parametrize("seed", [42, 43, 45])
def test_where_it_does_not_pixels_leave_in_the_stiffness_what_they_do_in_all_energy(seed):
    """Contacts of 2 pixels: of the stiffness 3 to 5 % is left, which no detail tells."""
    scan, stiffness, energy = found_and_true(seed, 6e-4, 20.0)
    stated, problems = error_of_map(scan, 20.0, TOLERANCE)
    assert LEAST_ERROR < stiffness < stated.stiffness < 0.1
    share = of_contact(scan, 20.0)  # in a compliance that holds the bulk as well
    assert 0.8 < share < 1.0
    of_pixels = STIFFNESS_95 * left_by_pixels(scan, 20.0)[0.75]
    assert stated.stiffness == pytest.approx(share * of_pixels)
    assert (energy < [stated.energy_at(share) for share in detail.FORCE_SHARES]).all()
    assert "warning" in {one.severity for one in problems}


@pytest.mark.long
@pytest.mark.parametrize(("seed", "load_N"), [(61, 2.0), (65, 0.6), (66, 0.2), (67, 2.0)])
def test_of_a_smooth_map_any_pixels_are_enough(seed, load_N):
    """Four to ten of them; on six points a pixel a tenth of mu N was 10 % off in the median."""
    scan, stiffness, energy = found_and_true(seed, 2e-3, load_N)
    assert 4 <= np.count_nonzero(scan.pressed(load_N).pressure_Pa) <= 10
    assert scan.unloading(load_N).refinement >= 20
    assert stiffness < 0.002
    assert (energy < (0.035, 0.005, 0.002, 0.002)).all()
    stated, problems = error_of_map(scan, load_N, TOLERANCE)
    assert stiffness < stated.stiffness
    assert (energy < [stated.energy_at(share) for share in detail.FORCE_SHARES]).all()
    assert stated.energy_at(0.25) <= 0.03
    assert "warning" not in {one.severity for one in problems}


@pytest.mark.parametrize("load_N", [14.0, 4.0, 0.5])
def test_a_sphere_that_touches_in_a_few_pixels_is_that_of_hertz(load_N):
    """21, 9 and 1 of them."""
    y, x = np.mgrid[-12:12, -12:12] * 1e-4
    sphere = HeightMap(-((x - 3e-5) ** 2 + (y - 4e-5) ** 2) / (2 * 0.1), (1e-4, 1e-4))
    curve = boundary_elements(sphere, E)
    assert np.count_nonzero(curve.pressed(load_N).pressure_Pa) <= 24
    hertz = caps([0.1], [0.0], E)
    d = hertz.approach_m(load_N)
    found = curve.unloading(load_N)
    assert found.stiffness_N_per_m == pytest.approx(hertz.stiffness_N_per_m(d), rel=2e-3)
    drop_N = load_N * np.array([0.25, 0.5, 0.75])
    at_drop_J = np.interp(drop_N, found.load_drop_N, found.loss_J)
    np.testing.assert_allclose(at_drop_J, hertz.loss_integral_at_drop_J(d, drop_N), rtol=0.02)


def test_fewer_than_eight_pixels_of_noise_are_too_few():
    noise_m = 1e-7 * np.random.default_rng(5).standard_normal((40, 40))
    curve = boundary_elements(HeightMap(noise_m, (1e-4, 1e-4)), E)
    enough_N, too_little_N = 10.0, 0.3
    assert np.count_nonzero(curve.pressed(enough_N).pressure_Pa) >= 8
    assert curve.unloading(enough_N).refinement == 1
    n = np.count_nonzero(curve.pressed(too_little_N).pressure_Pa)
    assert 1 < n < 4  # on halves of them as well
    with pytest.raises(ContactError, match=f"has {n} pixels; expected at least 8"):
        curve.unloading(too_little_N)


@pytest.mark.long
def test_what_a_few_pixels_of_a_rough_map_leave_is_stated():
    """Caps answered for them, with no error known: the stiffness up to twice too great."""
    for seed in range(3):
        scene = Scene((60, 90), (2e-4, 2e-4), seed, roughness_rms_m=2e-7, roughness_length_m=5e-4)
        scan, truth = (
            boundary_elements(synthetic_surface(scene, finer=finer)[0], E) for finer in (1, 4)
        )
        found, true = scan.unloading(8.0), truth.at_forces((0.25, 0.75)).unloading(8.0)
        assert 4 <= np.count_nonzero(scan.pressed(8.0).pressure_Pa) < 20
        assert found.refinement == 2
        stated, problems = error_of_map(scan, 8.0, TOLERANCE)
        off = abs(found.stiffness_N_per_m / true.stiffness_N_per_m - 1.0)
        assert off < stated.stiffness
        assert "warning" in {one.severity for one in problems}


def four_spheres(off_px, load_N):
    """Return an analysis of equal spheres, off corners of pixels by some of these, and its W."""
    pixel_m, radius_m = 2e-4, 1.0
    y_m, x_m = (np.mgrid[:100, :150] + 0.5) * pixel_m
    z_m, places_px = np.full(x_m.shape, -1.5e-7), [(35, 25), (115, 25), (35, 75), (115, 75)]
    for (x_px, y_px), (dx_px, dy_px) in zip(places_px, off_px, strict=True):
        dx_m, dy_m = x_m - (x_px + dx_px) * pixel_m, y_m - (y_px + dy_px) * pixel_m
        z_m = np.maximum(z_m, -(dx_m**2 + dy_m**2) / (2.0 * radius_m))
    sets = (f"contact.preload_N={load_N}", "contact.model=boundary_elements")
    found = capslip.analyze(
        HeightMap(z_m, (pixel_m, pixel_m)), capslip.load_settings(overrides=sets)
    )
    composite = found.contact.composite
    hertz = caps([radius_m] * 4, [0.0] * 4, composite.E_star_Pa)
    drop_N = found.answer.slip_force_N / 0.2
    loss_J = hertz.loss_integral_at_drop_J(hertz.approach_m(load_N), drop_N)
    return found, 0.2**2 * composite.kappa * float(loss_J)


@pytest.mark.parametrize(
    ("load_N", "off_px", "up_to"),
    [
        (19.2, np.zeros((4, 2)), (0.3, 0.45)),
        (1.0, np.zeros((4, 2)), (1.0, 1.0)),
        (19.2, np.array([(0.1, 0.2), (0.3, -0.1), (-0.2, 0.3), (0.4, 0.2)]), (0.0, 0.2)),
    ],
)
def test_where_no_pixel_lets_go_the_energy_is_anything_in_its_rectangle(load_N, off_px, up_to):
    """Pixels that lie alike about equal contacts hold or let go all at once: W was 1e-4 of it."""
    found, true_J = four_spheres(off_px, load_N)
    unknown_to = found.contact.errors.unknown_to
    assert up_to[0] <= unknown_to <= up_to[1]
    assert found.contact.curve.unloading(load_N).unknown_to_N == pytest.approx(unknown_to * load_N)
    low_J, high_J = found.band.interval["energy_J"]
    assert low_J < true_J < high_J
    said = [one.message for one in found.problems if one.code == "loss_between_loads"]
    if up_to[0] > 0.25:
        assert found.answer.energy_J < 1e-3 * true_J
        assert low_J == 0.0
        loop_J = 4.0 * found.answer.slip_force_N * found.answer.displacement_m
        assert high_J == pytest.approx(loop_J, rel=0.1 if load_N > 10.0 else 100.0)
        assert said[0].startswith("up to ")
        assert "rectangle" in said[0]
    else:
        assert low_J > 0.0
        assert not any("rectangle" in one for one in said)


@pytest.mark.long
@pytest.mark.parametrize("hardness", [None, 0.8])
@pytest.mark.parametrize(("across", "off"), [(1.5, 0.3), (4.0, 0.02)])
def test_area_and_greatest_pressure_of_few_pixels_are_those_of_hertz(across, off, hardness):
    pixel_m, radius_m, a_m = 5e-5, 0.05, 0.5 * across * 5e-5
    E_star_Pa = composite((200e9, 200e9), (0.3, 0.3)).E_star_Pa
    load_N = 4.0 * E_star_Pa * a_m**3 / (3.0 * radius_m)
    hertz_m2, greatest_Pa = np.pi * a_m**2, 1.5 * load_N / (np.pi * a_m**2)
    y, x = ((np.arange(60) - 30.0 - off) * pixel_m,) * 2
    sphere = HeightMap(-(x**2 + y[:, None] ** 2) / (2.0 * radius_m), (pixel_m, pixel_m))
    settings = [
        *("contact.model=boundary_elements", f"contact.preload_N={load_N}"),
        *("conditioning.form=none", "contact.alignment=as_levelled"),
    ]
    if hardness is not None:
        settings.append(f"material.hardness_Pa={hardness * greatest_Pa}")
    found = analyze_once(sphere, capslip.load_settings(overrides=tuple(settings))).contact
    assert found.max_pressure_Pa == pytest.approx((hardness or 1.0) * greatest_Pa, rel=0.03)
    assert found.contact_area_m2 == pytest.approx(hertz_m2, rel=0.05)
    if hardness is None:
        assert found.yielded_area_m2 is None
    else:  # more than where a Hertz pressure is above it: what that gives up rests beside it
        assert 1.0 - hardness**2 < found.yielded_area_m2 / hertz_m2 < 0.6


def test_a_worn_face_of_few_pixels_loses_what_eight_times_finer_ones_do():
    """Waves of 2 to 20 pixels rubbed to plateaus; other boundary elements lost 2.95 and 14.6 nJ.

    A spline that went on beyond its outermost points rose by two approaches there.
    """
    n, side_m, rng = 40, 4e-3, np.random.default_rng(1)
    y, x = (np.mgrid[:n, :n] + 0.5) * side_m / n
    way = rng.uniform(0.0, 2.0 * np.pi, 150)
    long_m = np.exp(rng.uniform(np.log(side_m / 20), np.log(side_m / 2), 150))
    phase, height = rng.uniform(0.0, 2.0 * np.pi, 150), long_m**0.8
    across = x[..., None] * np.cos(way) + y[..., None] * np.sin(way)
    wave_m = np.cos(2.0 * np.pi / long_m * across + phase) @ height
    wave_m *= 0.5e-6 / np.sqrt((height**2).sum() / 2.0)
    rubbed_m = 0.3e-6 + 0.1e-6 * np.tanh((wave_m - 0.3e-6) / 0.5e-6)
    face = HeightMap(np.where(wave_m > 0.3e-6, rubbed_m, wave_m), (side_m / n, side_m / n))
    slip = analyze_once(face, capslip.load_settings(overrides=("contact.preload_N=32",))).slip
    found_J = slip.energy_at_force_J(np.array([0.5, 0.75]) * 0.2 * 32.0)
    np.testing.assert_allclose(found_J, [2.95e-9, 14.6e-9], rtol=0.2)
