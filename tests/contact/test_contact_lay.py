"""Slip along and across long contacts and rows, against closed forms and the direct solution."""

import base64
import math
from dataclasses import replace

import numpy as np
import pytest

from capslip import write
from capslip.analysis import analyze, analyze_families, analyze_once, analyze_scans
from capslip.compare.model import load_model
from capslip.contact.direction import with_direction
from capslip.contact.lay import (
    axis_ratio,
    deviator_of_ellipse,
    energies_of_contacts,
    energies_of_map,
)
from capslip.contact.material import composite
from capslip.contact.slip import slip_curve
from capslip.contact.solvers.half_space import HalfSpace
from capslip.contact.solvers.polonsky_keer import (
    elastic_face,
    press,
    punch_pressure_Pa_per_m,
)
from capslip.output.whatif import whatif_data
from capslip.pressing import press_face
from capslip.settings import load_settings
from capslip.stages import Clock, find_face
from capslip.structure.band_state import State
from capslip.structure.law import law
from capslip.studies.theorem.tangential import shear
from capslip.surface.heightmap import HeightMap

STEEL = composite((200e9, 200e9), (0.3, 0.3))
MU, PIXEL_M = 0.2, 2e-4
ACROSS = math.pi / 2
INPUTS = ("friction", "modulus", "preload", "hardness")


def caps_of(ratio, turn_rad=0.0, shape=(120, 180)):
    """Twelve caps in three rows, their larger radius `ratio` times the other and along an angle."""
    y, x = (np.mgrid[: shape[0], : shape[1]] + 0.5) * PIXEL_M
    z, peak_m = np.full(shape, -6e-7), 3e-9 * np.random.default_rng(2).standard_normal((3, 4))
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    for i in range(3):
        for j in range(4):
            dx, dy = x - (4.5e-3 + 9e-3 * j), y - (4e-3 + 8e-3 * i)
            u, v = cos * dx + sin * dy, cos * dy - sin * dx
            fall = (u**2 / math.sqrt(ratio) + v**2 * math.sqrt(ratio)) / (2 * 24.0)
            z = np.maximum(z, peak_m[i, j] - 1e-7 * ((i + j) % 2) - fall)
    return HeightMap(z, (PIXEL_M, PIXEL_M))


def wide(turn_rad):
    """Return three long caps with contacts of 40 pixels, which boundary elements solve at once."""
    y, x = (np.mgrid[:110, :160] + 0.5) * 5e-5
    z, (cos, sin) = np.full(x.shape, -1e-6), (math.cos(turn_rad), math.sin(turn_rad))
    for x0, y0 in ((1.8e-3, 1.6e-3), (5.9e-3, 1.9e-3), (3.8e-3, 3.9e-3)):
        u, v = cos * (x - x0) + sin * (y - y0), cos * (y - y0) - sin * (x - x0)
        z = np.maximum(z, -(u**2 / 1.7 + v**2 * 1.7) / (2 * 3.0))
    return HeightMap(z, (5e-5, 5e-5))


SOLVED = ("contact.model=boundary_elements", "contact.alignment=as_levelled", "contact.bulk=true")
SOLVED = (*SOLVED, "contact.preload_N=150.0")


# What caps err by on such faces is not known, and a direction alone is no interval then
HARDLY_SPREAD = "material.friction_spread=1e-6"


def found(surface, *overrides, direction=None):
    if direction is not None:
        overrides = (*overrides, f"slip.direction_rad={direction!r}")
    return analyze(surface, load_settings(overrides=overrides))


def kappa_of(surface, *overrides, direction=None):
    """Return kappa of the pressed face, without what follows from it."""
    if direction is not None:
        overrides = (*overrides, f"slip.direction_rad={direction!r}")
    settings = load_settings(overrides=overrides)
    face = find_face(surface, settings, None, Clock())
    return press_face(face, settings, Clock())[2].kappa


def of_ellipse(ratio):
    """Kappa along and across an ellipse of that b/a, by elliptic integrals."""
    from scipy.special import ellipe, ellipk

    m = 1 - ratio**2
    share = (ellipk(m) - ellipe(m)) / (m * ellipk(m))  # the mean of cos^2
    extra = 2 * (STEEL.kappa - 1)
    return 1 + extra * share, 1 + extra * (1 - share)


def test_the_deviator_of_an_ellipse_is_that_of_elliptic_integrals():
    from scipy.special import ellipe, ellipk

    ratio = np.array([0.95, 0.5, 0.1, 1e-3])
    m = 1 - ratio**2
    exact = 2 * (ellipk(m) - ellipe(m)) / (m * ellipk(m)) - 1
    assert deviator_of_ellipse(ratio) == pytest.approx(exact, rel=1e-10)
    assert deviator_of_ellipse(np.array([1.0])) == 0.0
    # Johnson 1987, Eq. 4.28
    radii = np.array([0.9, 0.3, 0.01])
    b_over_a = axis_ratio(radii)
    K, E = ellipk(1 - b_over_a**2), ellipe(1 - b_over_a**2)
    assert (K - E) / (E / b_over_a**2 - K) == pytest.approx(radii, rel=1e-10)


@pytest.mark.parametrize("power", [-0.5, 0.0, 0.5])
def test_any_traction_on_an_ellipse_has_its_deviator(power):
    y, x = np.mgrid[-64:64, -64:64] + 0.5
    u, v = (x + y) / math.sqrt(2), (y - x) / math.sqrt(2)
    for along, across, turn in ((x, y, 1.0), (y, x, -1.0), (u, v, 1j)):
        rho = (along / 60) ** 2 + (across / 20) ** 2
        q = np.where(rho < 1, np.maximum(1 - rho, 1e-9) ** power, 0.0)
        q = np.minimum(q, 10.0)
        (energies,) = energies_of_map([q], (1.0, 1.0))
        sinking_m = HalfSpace(q.shape, (1.0, 1.0), 1.0).sinking_m(q)
        assert energies.mean == pytest.approx((q * sinking_m).sum() / q.sum() ** 2, rel=1e-9)
        exact = turn * deviator_of_ellipse(np.array([1 / 3]))[0]
        assert abs(energies.deviator / energies.mean - exact) < 3e-3


def test_contacts_are_as_the_map_that_holds_them():
    # Four punches of few pixels; their pairs alone make a deviator where they lie in a row
    at = np.array([[30.0, 90.0, 150.0, 230.0], [30.0, 42.0, 20.0, 30.0]])
    radius = np.array([6.0, 8.0, 6.0, 7.0])
    load_N = 4 / 3 * radius**3 / 100.0  # g = a^2 / 100, E* = 1
    punch, _ = energies_of_contacts(radius, load_N, None, np.zeros(4), at, 1.0)
    y, x = np.mgrid[:60, :260] + 0.5
    height = np.full(x.shape, -1.0)
    inside = np.zeros(x.shape, dtype=bool)
    for place, a in zip(at.T, radius, strict=True):
        inside |= np.hypot(x - place[0], y - place[1]) < a
    face = replace(
        elastic_face(HeightMap(height, (1.0, 1.0)), 1.0), depth_m=0 * height, measured=inside
    )
    pressure = press(face, approach_m=1.0, tolerance=1e-8).pressure_Pa
    (exact,) = energies_of_map([pressure], (1.0, 1.0))
    assert punch.mean == pytest.approx(exact.mean, rel=0.02)
    assert abs(punch.deviator - exact.deviator) < 0.02 * abs(exact.deviator)


@pytest.mark.long
@pytest.mark.parametrize("ratio", [1.0, 4.0])
def test_caps_along_x_have_the_kappa_of_their_ellipse(ratio):
    surface = caps_of(ratio)
    none = found(surface, "contact.model=caps")
    along = found(surface, "contact.model=caps", direction=0.0)
    across = found(surface, "contact.model=caps", direction=ACROSS)
    assert none.slip.kappa == STEEL.kappa
    table = along.caps
    b_over_a = axis_ratio(table.radius_minor_m / table.radius_major_m)
    exact = of_ellipse(float(b_over_a.mean())) if ratio > 1 else (STEEL.kappa,) * 2
    assert along.slip.kappa == pytest.approx(exact[0], rel=2e-3)
    assert across.slip.kappa == pytest.approx(exact[1], rel=2e-3)
    normal_N_per_m = none.slip.tangential_stiffness_N_per_m * STEEL.kappa
    tangential_N_per_m = along.slip.tangential_stiffness_N_per_m
    assert tangential_N_per_m * along.slip.kappa == pytest.approx(normal_N_per_m, rel=1e-12)
    assert law(along.parts, MU).kappa == along.slip.kappa
    # W at given force goes with kappa
    force_N = 0.25 * none.slip.total_slip_force_N
    energies = [one.slip.energy_at_force_J(force_N) for one in (none, along)]
    assert energies[1] / energies[0] == pytest.approx(along.slip.kappa / STEEL.kappa, rel=1e-12)


def test_a_cap_that_is_a_sphere_has_the_kappa_of_a_circle():
    surface = caps_of(1.0)
    analysis = found(surface, "contact.model=caps")
    round_caps = analysis.caps.with_columns(radius_minor_m=analysis.caps.radius_major_m)
    settings = load_settings(overrides=("slip.direction_rad=0.3", "contact.model=caps"))
    given = with_direction(analysis.contact, round_caps, analysis.conditioned.surface, settings)
    assert given.composite.kappa == pytest.approx(STEEL.kappa, rel=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("model", ["interacting", "boundary_elements"])
def test_symmetries(model):
    surface, given, close = caps_of(3.0, 0.4), ("contact.model=interacting",), 1e-9
    if model == "boundary_elements":
        surface, given, close = wide(0.4), SOLVED, 1e-6
    pixel_size_m = surface.pixel_size_m
    one = kappa_of(surface, *given, direction=0.7)
    assert abs(one / STEEL.kappa - 1) > 0.01
    opposite = kappa_of(surface, *given, direction=0.7 + math.pi)
    assert opposite == pytest.approx(one, rel=1e-12)
    # By 90 degrees, and in a mirror: y grows with the row
    turned = HeightMap(surface.height_m.T[:, ::-1].copy(), pixel_size_m)
    of_turned = kappa_of(turned, *given, direction=0.7 + ACROSS)
    assert of_turned == pytest.approx(one, rel=close)
    mirrored = HeightMap(surface.height_m[:, ::-1].copy(), pixel_size_m)
    assert kappa_of(mirrored, *given, direction=-0.7) == pytest.approx(one, rel=close)
    # Two directions at right angles have the mean of all
    other = kappa_of(surface, *given, direction=0.7 + ACROSS)
    assert 0.5 * (one + other) == pytest.approx(STEEL.kappa, rel=1e-12)


@pytest.mark.parametrize("given", [SOLVED, ("contact.model=caps",), ("contact.model=interacting",)])
def test_without_poissons_effect_no_direction_counts(given):
    surface = wide(0.4) if given == SOLVED else caps_of(4.0)
    given = (*given, "material.poisson_ratio=[0.0,0.0]")
    kappas = [kappa_of(surface, *given, direction=d) for d in (None, 0.0, ACROSS)]
    assert kappas == pytest.approx([1.0] * 3, rel=1e-12)


def paraboloid(ratio, n_pixels=96):
    pixel_m = 6.4e-3 / n_pixels
    x = (np.arange(n_pixels) - n_pixels / 2 + 0.5) * pixel_m
    depth_m = (x**2 / ratio + x[:, None] ** 2) * np.sqrt(ratio) / (2 * 20.0)
    return HeightMap(-depth_m, (pixel_m, pixel_m)), 20.0


def ridge():
    """Return a flat-topped bar with a rounded rim: a contact that is no ellipse."""
    y, x = np.mgrid[:48, :160] + 0.5
    off = np.maximum(abs(x - 80) - 55, 0.0) ** 2 + np.maximum(abs(y - 24) - 8, 0.0) ** 2
    return HeightMap(-off * (5e-5) ** 2 / (2 * 1.0), (5e-5, 5e-5)), 60.0


def row():
    """Return three spheres in a row along x."""
    y, x = (np.mgrid[:60, :160] + 0.5) * 1e-4
    z = np.full(x.shape, -1e-6)
    for at in (3e-3, 8e-3, 13e-3):
        z = np.maximum(z, -((x - at) ** 2 + (y - 3e-3) ** 2) / (2 * 10.0))
    return HeightMap(z, (1e-4, 1e-4)), 60.0


@pytest.mark.parametrize("face", [lambda: paraboloid(3.0), lambda: paraboloid(8.0), ridge, row])
@pytest.mark.parametrize("along", [1.0, 1j])
def test_the_direct_solution_that_sticks(face, along):
    surface, load_N = face()
    elastic = elastic_face(surface, STEEL.E_star_Pa)
    loaded = press(elastic, load_N=load_N, tolerance=1e-9)
    punch = punch_pressure_Pa_per_m(elastic, loaded)
    (energies,) = energies_of_map([punch], surface.pixel_size_m)
    normal_N_per_m = float(punch.sum()) * surface.pixel_area_m2
    deviator = energies.deviator * normal_N_per_m / STEEL.E_star_Pa
    kappa = STEEL.kappa + (STEEL.kappa - 1) * (deviator * np.conj(along**2)).real
    # The same by its own way: a pressure that holds everywhere, and Cerruti's kernel in full
    touches = loaded.pressure_Pa > 0
    held = replace(loaded, pressure_Pa=touches * loaded.pressure_Pa[touches].mean())
    force_N = 0.01 * MU * load_N * along
    stuck = shear(held, STEEL, MU, force_N, tolerance=1e-9)
    direct = normal_N_per_m * (stuck.displacement_m / force_N).real
    assert kappa == pytest.approx(direct, rel=2e-3)
    assert abs(STEEL.kappa / direct - 1) > 0.02  # what the mean over all directions leaves


@pytest.mark.parametrize("along", [1.0, 1j])
def test_partial_slip_of_an_ellipse_has_the_same_kappa(along):
    surface, load_N = paraboloid(3.0)
    direction = 0.0 if along == 1.0 else ACROSS
    given = ("contact.model=boundary_elements", f"contact.preload_N={load_N}", "contact.bulk=true")
    given = (*given, "contact.alignment=as_levelled", "conditioning.form=none")
    analysis = found(surface, *given, direction=direction)
    loaded = press(elastic_face(surface, STEEL.E_star_Pa), load_N=load_N, tolerance=1e-9)
    force_N = 0.5 * MU * load_N
    direct = shear(loaded, STEEL, MU, force_N * along)
    displacement_m = float(analysis.slip.displacement_m(force_N))
    assert displacement_m == pytest.approx((direct.displacement_m / along).real, rel=4e-3)
    assert float(analysis.slip.energy_at_force_J(force_N)) == pytest.approx(
        4 * direct.work_J, rel=0.015
    )
    lay = analysis.contact.lay
    # A difference of two states: its pixels leave a sixth of it
    assert abs(lay.energy_deviator - lay.deviator) < 0.2 * abs(lay.deviator)


def test_what_no_direction_leaves_open_is_said_and_in_the_interval():
    surface = caps_of(9.0)
    none = found(surface, "contact.model=caps", HARDLY_SPREAD)
    problem = next(p for p in none.problems if p.code == "slip_direction_matters")
    ends = [found(surface, "contact.model=caps", direction=d) for d in (0.0, ACROSS)]
    assert not any(p.code == "slip_direction_matters" for end in ends for p in end.problems)
    low, high = none.contact.lay.kappa_range
    assert sorted(end.slip.kappa for end in ends) == pytest.approx([low, high], rel=1e-4)
    assert problem.effect.energy == pytest.approx(high / STEEL.kappa - 1, rel=0.01)
    across = max(end.contact.stiffness_N_per_m / end.slip.kappa for end in ends)  # K of slip
    stiffer = across * STEEL.kappa / none.contact.stiffness_N_per_m - 1.0
    assert problem.effect.tangential_stiffness == pytest.approx(stiffer)
    assert f"the stiffness is off by up to {stiffer:.1%}, the energy by" in problem.message
    table = none.summary()["slip"]
    assert table["kappa_range"] == [low, high]
    assert table["softest_direction_rad"] == pytest.approx(0.0, abs=0.02)
    assert table["direction_rad"] is None
    assert table["kappa"] == STEEL.kappa
    for name in ("energy_J", "displacement_m"):
        least, greatest = none.band.interval[name]
        values = [getattr(end.answer, name) for end in ends]
        given = [end.settings.slip.direction_rad for end in ends]
        # At the same force, so that only the direction differs
        assert least < min(values) < max(values) < greatest, (name, given)
    assert none.band.contributions["energy_J"]["direction"] > 0.5
    assert all(end.band is None or "direction" not in end.band.contributions for end in ends)


def test_at_a_given_displacement_the_interval_holds_both_directions():
    surface = caps_of(9.0)
    given = ("contact.model=caps", "answer.displacement_m=1e-8", HARDLY_SPREAD)
    none = found(surface, *given)
    for direction in (0.0, ACROSS):
        end = found(surface, *given, direction=direction)
        for name in ("slip_force_N", "energy_J"):
            low, high = none.band.interval[name]
            assert low < getattr(end.answer, name) < high


def test_scans_of_one_joint_have_the_kappa_of_their_stiffness():
    long, circles = caps_of(6.0), caps_of(1.0)
    overrides = ("contact.model=caps", "joint.area_m2=3e-3", "slip.direction_rad=0.0")
    settings = load_settings(overrides=(*overrides, "contact.nominal_pressure_Pa=3e5"))
    both = analyze_scans([long, circles], settings)
    alone = [scan.slip.tangential_stiffness_N_per_m for scan in both.scans]
    # Springs side by side, to second order in how far the two differ
    assert both.slip.tangential_stiffness_N_per_m == pytest.approx(np.mean(alone), rel=5e-3)
    kappas = [scan.slip.kappa for scan in both.scans]
    assert min(kappas) < both.slip.kappa < max(kappas)


@pytest.mark.long
def test_a_stored_result_keeps_its_direction(tmp_path):
    analysis = found(caps_of(6.0), "contact.model=caps", "run.render=false", direction=0.0)
    write(analysis, tmp_path / "face")
    model, settings = load_model(tmp_path / "face")
    assert model.kappa == analysis.slip.kappa > 1.02 * STEEL.kappa
    assert settings.slip.direction_rad == 0.0


def test_given_families_are_round():
    given = {"m": 5, "n": 18, "radius_G_m": 23.8, "radius_P_m": 26.7, "h_m": 2.4e-7}
    sets = (f"families.{name}={value}" for name, value in given.items())
    settings = load_settings(overrides=(*sets, "slip.direction_rad=0.5"))
    assert analyze_families(settings).slip.kappa == STEEL.kappa


def crossed(ratio=6.0, pixel_m=1e-4, shape=(100, 140)):
    """Return long caps along x, and lower ones along y that only the greater pressure reaches."""
    y, x = (np.mgrid[: shape[0], : shape[1]] + 0.5) * pixel_m
    z, (ly, lx) = np.full(shape, -6e-7), np.array(shape) * pixel_m
    along = [(0.25, 0.2), (0.75, 0.2), (0.25, 0.8), (0.75, 0.8)]
    across = [(0.07, 0.5), (0.36, 0.5), (0.64, 0.5), (0.93, 0.5)]
    for places, peak_m, R_x, R_y in ((along, 0.0, ratio, 1.0), (across, -4e-8, 1.0, ratio)):
        for at_x, at_y in places:
            fall = (x - at_x * lx) ** 2 / R_x + (y - at_y * ly) ** 2 / R_y
            z = np.maximum(z, peak_m - fall / (2 * 4.0))
    return HeightMap(z, (pixel_m, pixel_m))


CROSSED = crossed()
PRESSURES = ((1e5, 0.6), (4e5, 0.3), (2e6, 0.1))  # and shares of the area of the scan
AS_LEVELLED = ("contact.alignment=as_levelled", "conditioning.form=none")
ALL = tuple(
    f"contact.model={name}" for name in ("boundary_elements", "caps", "interacting", "families")
)


def pressure_map(folder):
    area_m2 = CROSSED.measured_area_m2
    rows = "".join(f"{p!r},{share * area_m2!r}\n" for p, share in PRESSURES)
    (folder / "map.csv").write_text(f"pressure_Pa,area_m2\n{rows}")
    return folder / "map.csv"


def under(pressure_Pa, *given):
    """Return the analysis of the crossed caps that slip along x, as if alone under a pressure."""
    nominal = f"contact.nominal_pressure_Pa={pressure_Pa!r}"
    settings = load_settings(overrides=(nominal, "slip.direction_rad=0.0", *given))
    return analyze_once(CROSSED, settings)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("given", [(one, *AS_LEVELLED) for one in ALL] + [ALL[:1], ALL[2:3]])
@pytest.mark.parametrize("hardness", [(), ("material.hardness_Pa=1.5e9",)])
def test_each_patch_of_a_joint_slips_with_the_kappa_of_its_own_pressure(tmp_path, given, hardness):
    """The joint is the sum of its patches at one displacement, each as an analysis alone has it."""
    given = (*given, *hardness)
    mapped = f"joint.pressure_map={pressure_map(tmp_path)}"
    directed = load_settings(overrides=(mapped, "slip.direction_rad=0.0", *given))
    joint = analyze_once(CROSSED, directed)
    parts = [(share, under(p, *given)) for p, share in PRESSURES]
    kappas = [one.slip.kappa for _, one in parts]
    assert max(kappas) > 1.03 * min(kappas)  # else nothing would be told
    assert min(kappas) < joint.slip.kappa < max(kappas)

    def of_parts(name, *at):
        return sum(share * np.asarray(getattr(one.slip, name)(*at)) for share, one in parts)

    delta_m = np.array([0.01, 0.1, 0.3, 0.6]) * joint.slip.total_slip_displacement_m
    for name in ("force_N", "energy_J"):
        expected = of_parts(name, delta_m)
        assert getattr(joint.slip, name)(delta_m) == pytest.approx(expected, rel=2e-3), name
    K = sum(share * one.slip.tangential_stiffness_N_per_m for share, one in parts)
    assert joint.slip.tangential_stiffness_N_per_m == pytest.approx(K, rel=1e-3)
    normal = sum(share * one.contact.stiffness_N_per_m for share, one in parts)
    assert joint.summary()["contact"]["stiffness_N_per_m"] == pytest.approx(normal, rel=1e-3)
    # What the interval starts from is the answer
    for by_force in (True, False):
        state = State(joint.answer, by_force, joint.parts, directed)
        found, energy_J = state.under(dict.fromkeys(INPUTS, np.zeros(1)))
        answer = joint.answer.displacement_m if by_force else joint.answer.slip_force_N
        assert found[0] == pytest.approx(answer, rel=1e-6)
        assert energy_J[0] == pytest.approx(joint.answer.energy_J, rel=1e-6)


def test_a_stored_joint_slips_with_the_kappa_of_each_pressure(tmp_path):
    """Those of its patches, and under another preload that of the contacts there."""
    given = ("slip.direction_rad=0.0", "run.render=false", "run.figures=false", ALL[2])
    for name, load in (
        ("even", "contact.nominal_pressure_Pa=2e6"),
        ("uneven", f"joint.pressure_map={pressure_map(tmp_path)}"),
    ):
        found = analyze_once(CROSSED, load_settings(overrides=(load, *given)))
        write(found, tmp_path / name)
        model, _ = load_model(tmp_path / name)
        for one in (found,) if name == "uneven" else (found, under(2e5, ALL[2])):
            load_N = one.joint.preload_N
            slip = slip_curve(model.curve(load_N), load_N, MU, model.kappa)
            force_N = np.array([0.1, 0.3, 0.7]) * MU * load_N
            for of in ("displacement_m", "energy_at_force_J"):
                expected = getattr(one.slip, of)(force_N)
                assert getattr(slip, of)(force_N) == pytest.approx(expected, rel=2e-3), (name, of)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("given", [ALL[:1], (ALL[1], *AS_LEVELLED), (ALL[2], *AS_LEVELLED)])
def test_each_pressure_of_a_law_slips_with_the_kappa_of_an_analysis_there(given):
    analysis = under(2e6, *given)
    found, area_m2 = law(analysis.parts, MU), analysis.joint.area_m2
    p = found.pressure_Pa
    for i in (0, len(p) // 3, len(p) - 1):
        alone = under(float(p[i]), *given).slip
        K = alone.tangential_stiffness_N_per_m / area_m2
        assert found.tangential_stiffness_Pa_per_m[i] == pytest.approx(K, rel=5e-3)
        force_N = np.array([0.2, 0.5, 0.8]) * MU * p[i] * area_m2
        tau = np.interp(alone.displacement_m(force_N), found.displacement_m[i], found.shear_Pa[i])
        assert tau * area_m2 == pytest.approx(force_N, rel=0.01)


@pytest.mark.parametrize("given", [(ALL[1], *AS_LEVELLED), ALL[2:3]])
def test_another_preload_of_the_panel_slips_with_the_kappa_of_an_analysis_there(given):
    analysis = under(2e6, *given)
    *tables, _ = whatif_data(analysis)["tables"]
    assert len(tables) == 3
    for table in tables:
        N = table["preload_N"]
        alone = under(N / analysis.joint.area_m2, *given).slip
        u, log_N = np.frombuffer(base64.b64decode(table["columns"])).reshape(5, -1)[:2]
        e_m = np.exp(np.interp(np.log(0.25 * N), log_N, u))
        expected = float(alone.displacement_m(0.25 * MU * N))
        assert MU * analysis.slip.kappa * e_m == pytest.approx(expected, rel=3e-3)
