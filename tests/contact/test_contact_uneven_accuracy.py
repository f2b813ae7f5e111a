"""Errors of a joint that is pressed unevenly: each patch counts by what rests on it."""

from dataclasses import fields, replace
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from contact_cases import state_of
from scipy.optimize import brentq

import capslip
from capslip import analysis, pressing
from capslip.contact import joint as joints
from capslip.contact.doubts import problems_of_share, problems_of_waves
from capslip.contact.models.boundary_elements import RUNG
from capslip.contact.models.families import families
from capslip.contact.part_of_joint import ENERGY_BY_CHANCE
from capslip.contact.rung import ModelError, rung
from capslip.contact.scaled import ScaledCurve
from capslip.contact.uneven import side_by_side
from capslip.contact.uneven_accuracy import error_against, shares_of_patches
from capslip.errors import ContactError
from capslip.problems import Effect, Problem
from capslip.stages import Clock, Face
from capslip.surface.heightmap import HeightMap
from capslip.units import off_by, percent
from scenes import caps_map, noisy_waves

E_STAR_PA = 1e11
SPHERE = families((1, 0), (20.0, 20.0), (0.0, 0.0), E_STAR_PA)
HEAVY, LIGHT = ModelError(0.02, 0.1), ModelError(0.2, 0.6)
# Of a map, whose pixels know nothing of forces below a quarter of mu N
SMALL_ALONE = ModelError(0.01, 0.9, ((0.1, 0.9), (0.25, 0.03), (1.0, 0.01)))
OF_HEAVY = (
    Problem("detail_decides", "info", "of the heavy one", Effect(0.02, 0.1, 0.1)),
    Problem("contact_at_hole", "warning", "another thing"),
)
OF_LIGHT = (
    Problem("detail_decides", "warning", "a pixel decides", Effect(0.2, 0.6, 0.6), "look"),
    Problem("small_slip_extrapolated", "info", "no matter"),
)


def joint_of(load_N, weight):
    load_N, weight = np.array(load_N, dtype=float), np.array(weight, dtype=float)
    preload_N = float(load_N @ weight)
    joint = joints.Joint(1.0, 1.0, preload_N, load_N, weight, float(load_N.max()))
    return joint, side_by_side([SPHERE] * len(load_N), load_N, weight)


def states(load_N, found=LIGHT, says=OF_LIGHT):
    asked = []

    def error(curve, load_N, tolerance, noise_m, filtered, period_m):
        assert (filtered, period_m) == (False, None)
        asked.append((load_N, tolerance, noise_m))
        if found is None:
            raise ContactError("too few pixels")
        return found, says

    asked_rung = replace(RUNG, error=error, problems=None, touching=None)
    given = {"rung": asked_rung, "curve": SPHERE, "errors": HEAVY, "bulk_m": 0.0}
    known = [state_of(preload_N=N, **given) for N in load_N]
    return known, asked


def error_of(joint_and_curve, known, problems, tolerance=0.05, noise_m=None):
    """Errors and problems of a joint whose patches are known."""
    joint, curve = joint_and_curve
    face = SimpleNamespace(joint=joint, conditioned=SimpleNamespace(surface=None))
    sets = ("contact.model=boundary_elements", f"contact.tolerance={tolerance}")
    pressed = replace(known[-1], problems=problems)
    with mock.patch("capslip.pressing.known_noise_m", return_value=noise_m):
        given = face, pressed, curve, known, capslip.load_settings(overrides=sets)
        found, dearer = pressing._with_errors_of_joint(*given)
    assert dearer is None
    return found.errors, found.problems


def shares_of_spheres(load_N, weight, share):
    """Of the stiffness, and of the energy where all of them are moved by as much."""
    d = SPHERE.approach_m(load_N)

    def moved(e):
        """Of one sphere N ~ d^1.5, with x = 1 - s / d: 4 int s (e - s) N'' ds = 3 N d J."""
        x = 1.0 - np.minimum(e / d, 1.0)
        # int (1 - x)(x - x_e) / sqrt(x) dx from x_e to 1, over which e - s = d (x - x_e)
        x_e = 1.0 - e / d

        def inner(x):
            root = np.sqrt(x)
            return root * (-2.0 * x_e + 2.0 / 3.0 * (1.0 + x_e) * x - 0.4 * x**2)

        return load_N * (1.0 - x**1.5), 3.0 * load_N * d * (inner(1.0) - inner(x))

    e = brentq(lambda e: weight @ moved(e)[0] - share * (weight @ load_N), 0.0, d.max())
    drop_N, loss_J = moved(e)
    K = weight * load_N ** (1 / 3)
    return K / K.sum(), weight * loss_J / (weight @ loss_J), drop_N / load_N


def test_each_patch_counts_by_its_share_of_stiffness_and_energy():
    load_N, weight = np.array([1.0, 8.0**0.5, 8.0]), np.array([4.0, 2.0, 1.0])
    known, asked = states([1.0, 8.0])
    found, said = error_of(joint_of(load_N, weight), known, OF_HEAVY, 0.05, 2e-9)
    assert asked == [(1.0, 0.05, 2e-9)]
    between = np.sqrt(HEAVY.stiffness * LIGHT.stiffness), np.sqrt(HEAVY.energy * LIGHT.energy)
    for share in (0.1, 0.25, 0.75):
        K, W, _ = shares_of_spheres(load_N, weight, share)
        expected = W @ (LIGHT.energy, between[1], HEAVY.energy)
        assert found.energy_at(share) == pytest.approx(expected, rel=1e-3), share
    assert found.stiffness == pytest.approx(K @ (LIGHT.stiffness, between[0], HEAVY.stiffness))
    kept, light = said
    assert kept is OF_HEAVY[1]
    assert light.code == "detail_decides"
    K, W, _ = shares_of_spheres(load_N, weight, 0.25)
    assert K[0] != pytest.approx(W[0], abs=0.02)  # nor of the area, 4 / 7, or of the load
    assert light.message == (
        f"under 1 N on the scan, and patches that bear no more have {percent(K[0])} of the "
        f"stiffness of the joint and {percent(W[0])} of its energy at 25 % of mu N, a pixel decides"
    )
    # What all of them move of the joint, where one alone moves more of the light one
    W = found.energy_at(0.25)
    assert light.effect == Effect(found.stiffness, W, W)
    assert light.step == "look"
    for own, of_joint in (
        (Effect(0.01, 0.02, None), Effect(0.01, 0.02, None)),
        (Effect(None, 0.0, 0.9), Effect(None, 0.0, W)),
        (None, Effect(found.stiffness, W, W)),
    ):
        says = (Problem("contact_at_hole", "warning", "a hole", own),)
        known, _ = states([1.0, 8.0], LIGHT, says)
        _, said = error_of(joint_of(load_N, weight), known, OF_HEAVY, 0.05, 2e-9)
        assert [one.code for one in said] == ["detail_decides", "contact_at_hole"]
        assert said[1].effect == of_joint


def test_where_nothing_is_known_of_the_heaviest_patch_nothing_is_of_the_joint():
    load_N, weight = [1.0, 8.0], [4.0, 1.0]
    known, _ = states(load_N)
    known[-1] = replace(known[-1], errors=replace(HEAVY, unknown_to=0.3))
    assert error_of(joint_of(load_N, weight), known, ())[0].unknown_to == 0.3


def test_the_energy_of_a_patch_has_the_error_of_its_own_share_of_slip():
    """Where the joint bears a tenth of mu N, the lighter one bears more of its own."""
    load_N, weight = np.array([1.0, 8.0]), np.array([8.0, 1.0])
    by_share = ((0.1, 0.9), (0.5, 0.3), (1.0, 0.01))
    light = ModelError(0.1, 0.9, by_share)
    known, _ = states([1.0, 8.0], light)
    found, _ = error_of(joint_of(load_N, weight), known, (), 0.05)
    _, W, slipped = shares_of_spheres(load_N, weight, 0.25)
    assert slipped[0] > 0.3
    expected = W @ (light.energy_at(slipped[0]), HEAVY.energy)
    assert found.energy_at(0.25) == pytest.approx(expected, rel=1e-3)
    assert found.energy == pytest.approx(found.energy_at(0.1))
    _, W, slipped = shares_of_spheres(load_N, weight, 1.0)
    assert slipped == pytest.approx(1.0)
    assert found.energy_at(1.0) == pytest.approx(W @ (0.01, HEAVY.energy), rel=1e-3)


def test_patches_on_which_little_rests_are_not_asked():
    known, asked = states([1.0, 8.0])
    few = error_of(joint_of([1.0, 8.0], [0.01, 1.0]), known, OF_HEAVY, 0.05)
    assert few == (HEAVY, OF_HEAVY)
    assert asked == []
    known, asked = states([1.0, 4.0, 8.0])
    error_of(joint_of([1.0, 4.0, 8.0], [0.01, 1.0, 1.0]), known, OF_HEAVY, 0.05)
    assert [N for N, *_ in asked] == [4.0]


def test_what_is_within_the_tolerance_says_nothing():
    known, _ = states([1.0, 8.0])
    found, said = error_of(joint_of([1.0, 8.0], [4.0, 1.0]), known, OF_HEAVY, 0.7)
    assert found.energy > HEAVY.energy
    assert said == OF_HEAVY


@pytest.mark.parametrize("beyond", [ModelError(0.2, 1e-3), ModelError(1e-3, 0.2)])
def test_either_of_stiffness_and_energy_beyond_the_tolerance_is_said(beyond):
    known, _ = states([1.0, 8.0], beyond)
    known = [replace(one, errors=ModelError(1e-3, 1e-3)) for one in known]
    _, said = error_of(joint_of([1.0, 8.0], [4.0, 1.0]), known, (), 0.05)
    assert [one.code for one in said] == ["detail_decides"]


def test_a_patch_whose_error_is_not_found_counts_as_a_whole_and_is_said():
    known, _ = states([1.0, 8.0], None)
    found, said = error_of(joint_of([1.0, 8.0], [4.0, 1.0]), known, (), 0.05)
    K, W, _ = shares_of_spheres(np.array([1.0, 8.0]), np.array([4.0, 1.0]), 0.25)
    assert found.stiffness == pytest.approx(K @ (1.0, HEAVY.stiffness))
    assert found.energy_at(0.25) == pytest.approx(W @ (1.0, HEAVY.energy), rel=1e-3)
    (one,) = said
    assert one.code == "pressures_interpolated"
    assert one.severity == "warning"
    assert "too few pixels" in one.message


def test_a_model_that_knows_no_error_and_an_even_joint_keep_what_they_have():
    known, asked = states([1.0, 8.0])
    joint, curve = joint_of([1.0, 8.0], [4.0, 1.0])
    of_none = [replace(one, errors=None) for one in known]
    assert error_of((joint, curve), of_none, OF_HEAVY) == (None, OF_HEAVY)
    assert error_of((joint, SPHERE), known[1:], OF_HEAVY) == (HEAVY, OF_HEAVY)
    assert asked == []


def uneven_state(**of_both):
    """Joint of three pressures with what is known of its heaviest and its lightest patch."""
    load_N, weight = np.array([1.0, 8.0**0.5, 8.0]), np.array([4.0, 2.0, 1.0])
    joint, curve = joint_of(load_N, weight)
    no_caps = {"use": np.zeros(0, dtype=bool), "contacts": 100, "approach_m": 1e-6, "bulk_m": 0.0}
    given = no_caps | {name: of[0] for name, of in of_both.items()}
    light = state_of(preload_N=1.0, curve=SPHERE, rung=RUNG, **given)
    given = no_caps | {name: of[1] for name, of in of_both.items()}
    heavy = state_of(preload_N=8.0, curve=SPHERE, rung=RUNG, light=light, **given)
    _, energy, _ = shares_of_patches(joint, curve, (0.25,))
    joint = SimpleNamespace(coverage=0.1, **vars(joint))
    _, W, _ = shares_of_spheres(load_N, weight, 0.25)
    return joint, replace(heavy, energy_share=energy[0]), W


def test_few_contacts_are_those_of_the_patches_that_lose():
    joint, heavy, W = uneven_state(contacts=(4, 100))
    (one,) = problems_of_share(joint, heavy)
    assert one.code == "few_contacts_in_scan"
    assert "contact regions, with 4 under 1 N on the scan" in one.message
    off = W @ (0.5, np.sqrt(0.5 * 0.1), 0.1)
    expected = np.expm1(ENERGY_BY_CHANCE * off)
    assert one.effect.energy == pytest.approx(expected, rel=1e-3)
    joint, heavy, _ = uneven_state(contacts=(26, 100))
    assert problems_of_share(joint, heavy) == []


def test_long_waves_count_over_the_approach_of_the_patches_that_lose():
    joint, heavy, W = uneven_state(approach_m=(1e-7, 4e-7), bulk_m=(0.0, 0.0))
    most_m = 0.1 / (W @ (1e7, np.sqrt(1e7 / 4e-7), 1 / 4e-7))
    for long_m, said in ((0.998 * most_m, []), (1.002 * most_m, ["waves_longer_than_scan"])):
        joint.long_waves_m = long_m
        assert [one.code for one in problems_of_waves(joint, heavy)] == said


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
def test_a_lighter_patch_has_its_own_contacts_and_approach():
    """Under a load that the heaviest has not: the same as a scan under that alone."""
    surface = few_caps(1e-9)
    given = (*AS_IT_LIES, "caps.fit=least_squares")  # which no load changes
    for model in ("caps", "interacting", "boundary_elements"):
        found = {}
        for N in (100.0, 5.0):
            sets = (*given, f"contact.model={model}", f"contact.preload_N={N}")
            settings = capslip.load_settings(overrides=sets)
            found[N] = analysis.analyze_once(surface, settings).contact
        light, alone = found[100.0].under(5.0), found[5.0]
        assert light.contacts == alone.contacts < found[100.0].contacts
        assert light.approach_m == pytest.approx(alone.approach_m, rel=1e-6)
        without_m = light.approach_without_bulk_m
        assert without_m == pytest.approx(alone.approach_without_bulk_m, rel=1e-6)


HEAVY_PA, LIGHT_PA = 2e5, 1e4
AS_IT_LIES = ("contact.alignment=as_levelled", "conditioning.form=none")


def few_caps(noise_m=0.0, spread_m=1e-7):
    """Map of 12 caps, in mm apart and of unlike heights, with white noise on it."""
    rng = np.random.default_rng(3)
    places = [(x * 5e-3 + 5e-3, y * 5e-3 + 5e-3) for x in range(4) for y in range(3)]
    caps = [(*at, 1.5 * rng.uniform(0.8, 1.25), -spread_m * rng.random()) for at in places]
    scene = caps_map(caps, shape=(200, 250), floor_m=-1.5e-6)
    noise = np.random.default_rng(4).standard_normal(scene.shape)
    return HeightMap(scene.height_m + noise_m * noise, scene.pixel_size_m)


def of_caps_and_model(band, name):
    """Return the variance of a logarithm, but for a factor, that is of caps and model."""
    low, high = band.interval[name]
    share = band.contributions[name]
    return (share["caps"] + share["model"]) * np.log(high / low) ** 2


def pressed(surface, path, areas_m2, *sets):
    """Analyse a joint of a pressure for each area."""
    lines = "".join(f"{p!r},{area!r}\n" for p, area in areas_m2.items())
    path.write_text("pressure_Pa,area_m2\n" + lines)
    given = (f"joint.pressure_map={path}", *AS_IT_LIES, *sets)
    return capslip.analyze(surface, capslip.load_settings(overrides=given))


@pytest.mark.parametrize("model", ["auto", "interacting"])
def test_caps_of_a_joint_that_rests_on_light_patches_are_as_unsure_as_these(tmp_path, model):
    """Noise of some nm decides which caps touch where the pressure is low."""
    path, area_m2 = tmp_path / "pressures.csv", 1e-2
    sets = (f"contact.model={model}",)
    light = pressed(few_caps(6e-9), path, {LIGHT_PA: area_m2}, *sets)
    heavy = pressed(few_caps(6e-9), path, {HEAVY_PA: area_m2}, *sets)
    both = pressed(few_caps(6e-9), path, {HEAVY_PA: area_m2 / 500, LIGHT_PA: area_m2}, *sets)
    true = pressed(few_caps(), path, {HEAVY_PA: area_m2 / 500, LIGHT_PA: area_m2}, *sets)
    assert both.contact.model == heavy.contact.model == true.contact.model == "interacting"
    assert heavy.contact.errors.energy_at(0.25) < 0.05
    of_light = light.contact.errors.energy_at(0.25)
    assert of_light > 0.05
    assert 0.5 * of_light < both.contact.errors.energy_at(0.25) < 1.2 * of_light
    code = "noise_decides" if model == "auto" else "model_doubtful"
    assert code not in [one.code for one in heavy.problems]
    (said,) = (one for one in both.problems if one.code == code)
    assert said.message.startswith(f"under {LIGHT_PA * few_caps().measured_area_m2:.3g} N on the")
    for name in ("energy_J", "tangential_stiffness_N_per_m"):
        low, high = both.band.interval[name]
        assert low < getattr(true.answer, name) < high, name
        assert of_caps_and_model(both.band, name) > 2.0**2 * of_caps_and_model(heavy.band, name)
    spread = ("contact.preload_spread=0.2", "material.friction_spread=0.2")
    areas_m2 = {HEAVY_PA: area_m2 / 500, LIGHT_PA: area_m2}
    wider = pressed(few_caps(6e-9), path, areas_m2, *sets, *spread)
    causes = {"caps", "model", "part_of_joint", "friction", "preload"}
    assert set(wider.band.contributions["energy_J"]) == causes
    assert wider.band.interval["energy_J"][1] > both.band.interval["energy_J"][1]
    low, high = np.array(both.band.interval["energy_J"]) / both.answer.energy_J
    wide = np.array(light.band.interval["energy_J"]) / light.answer.energy_J
    assert 0.5 < np.log(high / low) / np.log(wide[1] / wide[0]) < 1.2


def test_the_model_is_one_that_is_within_the_tolerance_where_the_joint_is_light(tmp_path):
    path, areas_m2 = tmp_path / "pressures.csv", {2e4: 1e-5, 2e2: 1e-2}
    surface = few_caps(1e-9, spread_m=1e-9)
    heavy = pressed(surface, path, {2e4: 1e-2})
    both = pressed(surface, path, areas_m2)
    assert rung(heavy.contact.model).cost < rung(both.contact.model).cost
    assert both.contact.model_reason.startswith("lighter patches of the joint need it: under ")
    # As near as the caps themselves, which the model of the heavy patch is not
    interacting = pressed(surface, path, areas_m2, "contact.model=interacting")
    cheaper = pressed(surface, path, areas_m2, f"contact.model={heavy.contact.model}")
    W = interacting.answer.energy_J
    assert both.answer.energy_J == pytest.approx(W, rel=1e-6)
    assert abs(cheaper.answer.energy_J / W - 1.0) > 1e-3
    assert both.contact.errors.energy_at(0.25) == pytest.approx(
        interacting.contact.errors.energy_at(0.25), rel=0.5
    )


def test_a_model_that_is_forced_counts_by_patches_as_one_that_is_chosen(tmp_path):
    path, areas_m2 = tmp_path / "pressures.csv", {2e5: 1e-5, 2e2: 1e-2}
    chosen = pressed(few_caps(), path, areas_m2)
    forced = pressed(few_caps(), path, areas_m2, f"contact.model={chosen.contact.model}")
    for code in ("few_contacts_in_scan", "waves_longer_than_scan"):
        said, again = (
            [(one.message, one.effect, one.step) for one in found.problems if one.code == code]
            for found in (chosen, forced)
        )
        assert said == again
    (few,) = (one for one in forced.problems if one.code == "few_contacts_in_scan")
    assert " N on the scan: which these are is chance" in few.message


@pytest.mark.parametrize(
    ("of_map", "said"),
    [
        (ModelError(0.01, 0.02), None),
        (SMALL_ALONE, None),
        (ModelError(0.5, 0.9), "may be off by a factor of 2.5"),
        (None, "does not know how far it is off"),
        ("fails", "fails: no solution"),
    ],
)
def test_a_map_that_light_patches_want_answers_only_where_it_knows_better(
    monkeypatch, of_map, said
):
    """A choice of the map for the lightest patch is tried, and compared with the caps."""
    needed = Problem("boundary_elements_needed", "warning", "they are needed")
    problems = (OF_HEAVY[1], needed)
    caps = state_of(errors=ModelError(0.1, 0.3), curve=SPHERE, problems=problems)
    other = replace(caps, errors=None if of_map == "fails" else of_map)
    dearer = SimpleNamespace(model="boundary_elements")

    def pressed_as(choice, face, settings):
        assert choice is dearer
        if of_map == "fails":
            raise ContactError("no solution")
        return other, "table of the map"

    monkeypatch.setattr(pressing, "_pressed", lambda *_: (caps, "table"))
    monkeypatch.setattr(pressing, "_pressed_as", pressed_as)
    monkeypatch.setattr(
        pressing, "_sheared", lambda face, one, *_: (one, "slip", dearer if one is caps else None)
    )
    surface = SimpleNamespace(shape=(10, 10))
    face = SimpleNamespace(conditioned=SimpleNamespace(surface=surface))
    found, table, _ = pressing.press_face(face, capslip.load_settings(), Clock())
    if said is None:
        assert (found, table) == (other, "table of the map")
        return
    assert table == "table"
    assert found.errors is caps.errors
    kept, one = found.problems
    assert kept is OF_HEAVY[1]
    assert one.code == needed.code
    assert one.message == f"they are needed; the map was pressed as well, and {said}"
    assert "average several scans" in one.step


def test_caps_are_off_by_what_lies_between_them_and_a_dearer_model_and_by_what_that_leaves():
    """Of a sphere whose withdrawal is 5 % greater, and which loses 20 % more."""
    d, drop_N = SPHERE.approach_m(8.0), np.array([0.8, 2.0, 4.0])
    dearer = ScaledCurve(SPHERE, 1.0, withdrawal=1.05, loss=1.2)
    left = ModelError(0.01, 0.4, ((0.1, 0.4), (0.25, 0.1), (1.0, 0.02)))
    caps, other = (state_of(preload_N=8.0, curve=one) for one in (SPHERE, dearer))
    assert error_against(caps, replace(other, errors=None)) is None
    found = error_against(caps, replace(other, errors=left))
    assert found.stiffness == pytest.approx(np.log(1.05) + 0.01)
    of_loss = dearer.loss_integral_at_drop_J(d, drop_N) / SPHERE.loss_integral_at_drop_J(d, drop_N)
    for share, ratio in zip((0.1, 0.25, 0.5), of_loss, strict=True):
        assert found.energy_at(share) == pytest.approx(np.log(ratio) + left.energy_at(share))
    assert found.energy == pytest.approx(np.log(of_loss[0]) + 0.4)
    assert found.energy_at(1.0) == pytest.approx(np.log(1.2) + 0.02)
    # Either may be the greater one
    back = error_against(replace(other, errors=None), replace(caps, errors=left))
    assert back.energy == pytest.approx(found.energy)


@pytest.mark.parametrize(
    ("of_map", "then"),
    [
        (ModelError(0.01, 0.04), "map"),  # most of what lies between them is of the caps
        (SMALL_ALONE, "map"),
        (ModelError(0.01, 0.4), f"may be off by {off_by(0.4)}"),
        (None, "unknown"),
        ("fails", "unknown"),
    ],
)
def test_the_map_is_tried_under_the_light_load_alone_before_all_others(monkeypatch, of_map, then):
    needed = Problem("boundary_elements_needed", "warning", "they are needed")
    light = state_of(preload_N=1.0, curve=SPHERE, rung=rung("interacting"))
    dearer = SimpleNamespace(
        model="boundary_elements",
        reason="",
        caps=None,
        model_errors=None,
        problem=needed,
        moved=None,
        estimates={},
    )
    joint, _ = joint_of([1.0, 8.0], [4.0, 1.0])
    face = Face(**dict.fromkeys((one.name for one in fields(Face)), None) | {"joint": joint})

    def pressed_as(choice, face, settings):
        assert (face.joint.preload_N, face.joint.is_scan) == (1.0, True)
        if of_map == "fails":
            raise ContactError("no solution")
        return state_of(curve=ScaledCurve(SPHERE, 1.0, loss=1.1), errors=of_map), "table"

    monkeypatch.setattr(pressing, "_pressed_as", pressed_as)
    found, doubts, chosen = pressing._tried_alone(
        *(dearer, face, light, (needed,), capslip.load_settings())
    )
    assert chosen is (None if then.startswith("may") else dearer)
    if then == "unknown":
        assert found is light
        assert doubts == (needed,)
        return
    assert found.errors.energy_at(0.25) == pytest.approx(np.log(1.1) + of_map.energy_at(0.25))
    (said,) = doubts
    if then == "map":
        assert said is needed
    else:
        assert said.message == f"they are needed; the map was pressed as well, and {then}"


def test_no_dearer_model_is_asked_for_where_the_joint_is_within_the_tolerance(monkeypatch):
    """The light patch alone is beyond it: so little rests on it that it moves nothing."""
    known, _ = states([1.0, 8.0])
    known = [replace(one, rung=rung("interacting")) for one in known]
    needed = Problem("boundary_elements_needed", "warning", "they are needed")
    light = replace(known[0], errors=ModelError(0.01, 0.07))
    monkeypatch.setattr(pressing, "_as_chosen", lambda *_: (light, (needed,), "dearer"))
    monkeypatch.setattr(pressing, "_lying", lambda face, *_: face)
    for weight, dearer in (([0.3, 1.0], None), ([400.0, 1.0], "dearer")):
        joint, curve = joint_of([1.0, 8.0], weight)
        heavy = replace(known[-1], errors=ModelError(0.01, 0.01), problems=())
        given = SimpleNamespace(joint=joint), heavy, curve, known, capslip.load_settings()
        found, chosen = pressing._with_errors_of_joint(*given)
        assert chosen == dearer, found.errors
        assert (found.errors.greatest <= 0.05) is (dearer is None)
        assert bool(found.problems) is (dearer is not None)


@pytest.mark.parametrize("hardness", [(), ("material.hardness_Pa=4e8",)])
def test_a_joint_that_rests_on_light_patches_is_as_unsure_as_these(tmp_path, hardness):
    """Of a noisy map: one heavy patch of many does not make it sure."""
    answers = {}
    for name, pressures_Pa in (
        ("heavy", [1e6]),
        ("light", [5e4]),
        ("both", [1e6, *([5e4] * 400)]),
        ("mostly heavy", [1e6] * 100 + [5e4]),
    ):
        path = tmp_path / "pressures.csv"
        lines = "".join(f"{p!r},1e-5\n" for p in pressures_Pa)
        path.write_text("pressure_Pa,area_m2\n" + lines)
        given = ("contact.model=boundary_elements", f"joint.pressure_map={path}", *hardness)
        given = (*given, "contact.alignment=as_levelled")
        found = capslip.analyze(noisy_waves(2e-9), capslip.load_settings(overrides=given))
        answers[name] = found.contact.errors
    heavy, light, both, mostly = answers.values()
    assert light.stiffness > 1.5 * heavy.stiffness
    assert both.stiffness == pytest.approx(light.stiffness, rel=0.1)
    assert both.energy_at(0.25) == pytest.approx(light.energy_at(0.25), rel=0.25)
    assert mostly.energy_at(0.25) == heavy.energy_at(0.25)
