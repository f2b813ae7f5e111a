"""The Python names that users rely on."""

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import tomli_w
from msgspec import structs

import capslip
from capslip.analysis import analyze_families, analyze_once, analyze_scans
from capslip.batch import run_batch
from capslip.contact.models.families import families
from capslip.contact.slip import slip_curve
from capslip.contact.varying_load import varying
from capslip.errors import CapslipError, SettingsError, UnusableSurfaceError
from capslip.settings import (
    Contact,
    FamilySettings,
    HillSettings,
    Material,
    Question,
    SlipSettings,
    Structure,
    checked,
    settings_from,
)
from capslip.sources import find_scans
from capslip.structure.law import law
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.average import average
from scenes import PROJECT, caps_map

CAPS = [(6e-3, 5e-3, 24.0, 0.0), (14e-3, 12e-3, 27.0, -1e-7), (24e-3, 8e-3, 25.0, -5e-8)]

# What is asked of the settings is answered by caps, and no map is pressed for it
ALONE = {"model": "caps", "alignment": "as_levelled"}


@cache
def plain():
    """Return the analysis of the caps with the settings as they are; no test changes it."""
    return capslip.analyze(caps_map(CAPS))


def test_the_public_names_are_what_they_say():
    from capslip.analysis import analyze  # loading the module must not hide the function

    assert capslip.analyze is analyze
    assert set(capslip.__all__) >= {
        "load_surface",
        "load_settings",
        "analyze",
        "HeightMap",
        "write",
    }
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = capslip.nothing


@pytest.mark.long
def test_analyze_is_pure(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    surface = caps_map(CAPS)
    before = surface.height_m.copy()
    first = capslip.analyze(surface, capslip.Settings())
    second = plain()
    assert np.array_equal(surface.height_m, before)
    assert capsys.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []
    for key in ("hills", "families", "contact", "slip", "damping", "problems"):
        assert first.summary()[key] == second.summary()[key]


@pytest.mark.parametrize("said", [{}, {"hardness_Pa": 1e9}, {"yield_stress_Pa": 3e8}])
def test_a_material_has_its_modulus_however_the_settings_were_made(said):
    """It kept that of steel where its class was given a hardness: K was 76 % too great."""
    lines = [f"material.{key}={value}" for key, value in said.items()]
    lines += [f"contact.{key}={value}" for key, value in ALONE.items()]
    read = capslip.load_settings(None, ("material.preset=aluminium", *lines))
    made = capslip.Settings(material=Material(preset="aluminium", **said), contact=Contact(**ALONE))
    assert checked(made) == checked(read) == read
    found, same = (analyze_once(caps_map(CAPS), one) for one in (made, read))
    assert found.settings == same.settings
    assert found.contact.composite == same.contact.composite
    assert found.slip.tangential_stiffness_N_per_m == same.slip.tangential_stiffness_N_per_m


def of_steel(*words):
    return capslip.load_settings(overrides=("material.preset=steel", *words))


def exchanged(settings, **said):
    """Name another material in settings that hold the numbers of one."""
    return structs.replace(settings, material=structs.replace(settings.material, **said))


@pytest.mark.parametrize("preset", ["aluminium", "stainless", ("steel", "titanium")])
def test_a_material_that_is_exchanged_keeps_no_number_of_the_one_before(preset):
    """Aluminium had the modulus and the yield stress of the steel that it took the place of."""
    lines = f"material.preset={list(preset) if isinstance(preset, tuple) else preset}"
    expected = capslip.load_settings(overrides=(lines,))
    before, own = of_steel(), {"preset": preset, "friction_coefficient": 0.3}
    for made in (
        exchanged(before, preset=preset),
        structs.replace(before, material=Material(preset=preset)),
        exchanged(checked(exchanged(before, preset="brass")), preset=preset),
        exchanged(of_steel("material.youngs_modulus_Pa=[210e9,210e9]"), preset=preset),
    ):
        assert checked(made) == expected
        assert checked(checked(made)) == expected
    assert checked(exchanged(before, **own)).material == structs.replace(
        expected.material, friction_coefficient=0.3
    )
    back = exchanged(checked(exchanged(before, preset=preset)), preset="steel")
    assert checked(back) == before


@pytest.mark.parametrize("mine", ["hardness_Pa=3e9", "youngs_modulus_Pa=[205e9,205e9]"])
def test_own_numbers_of_a_material_that_is_exchanged_may_be_of_either(mine):
    given = of_steel(f"material.{mine}")
    assert checked(given) == given
    says = f"'brass' in place of 'steel', and material.{mine.partition('=')[0]}, which may be"
    with pytest.raises(SettingsError, match=says) as raised:
        analyze_once(caps_map(CAPS), exchanged(given, preset="brass"))
    assert "\n" not in str(raised.value)
    of_both = Material(preset="brass", hardness_Pa=3e9)  # a material of its own says so
    assert (
        checked(structs.replace(given, material=of_both)).material
        == checked(capslip.Settings(material=of_both)).material
    )


def test_a_written_file_whose_material_is_named_anew_has_no_number_of_the_one_before(tmp_path):
    """In its text, or by an override, beside which a modulus may be said."""
    path, named = tmp_path / "settings.toml", 'preset = "aluminium"'
    text = tomli_w.dumps(of_steel("material.friction_spread=0.1").to_dict())
    path.write_text(text)
    assert capslip.load_settings(path) == of_steel("material.friction_spread=0.1")
    expected = capslip.load_settings(
        overrides=("material.preset=aluminium", "material.friction_spread=0.1")
    )
    assert capslip.load_settings(path, ("material.preset=aluminium",)).material == expected.material
    both = ("material.youngs_modulus_Pa=[71e9,71e9]", "material.preset=aluminium")
    assert capslip.load_settings(path, both).material.youngs_modulus_Pa == (71e9, 71e9)
    path.write_text(text.replace('preset = "steel"', named))
    assert capslip.load_settings(path).material == expected.material


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (lambda: capslip.Settings(hills=HillSettings(cut="x")), "hills.cut: got 'x'"),
        (lambda: capslip.Settings(hills=HillSettings(material_ratio=2)), "hills.material_ratio"),
        (lambda: capslip.Settings(contact=Contact(tolerance=2)), "contact.tolerance: got 2"),
        (lambda: capslip.Settings(contact=Contact(tolerance=1e-300)), "contact.tolerance"),
        (lambda: capslip.Settings(contact=Contact(preload_N="5")), "contact.preload_N: got '5'"),
        (lambda: capslip.Settings(contact={"preload": 5.0}), "unknown setting contact.preload"),
        (lambda: capslip.Settings(contact=Contact(load_point_m=(1, 2, 3))), "contact.load_point_m"),
        (lambda: capslip.Settings(families=FamilySettings(count=3)), "families.count: got 3"),
        (
            lambda: capslip.Settings(slip=SlipSettings(normal_amplitude_ratio=2)),
            "normal_amplitude_ratio",
        ),
        (lambda: capslip.Settings(structure=Structure(joints=10**400)), "structure.joints"),
        (lambda: capslip.Settings(material=Material(youngs_modulus_Pa=2e11)), "youngs_modulus_Pa"),
        (lambda: capslip.Settings(structure=Structure(modal_stiffness_N_per_m=1e8)), "structure"),
        (
            lambda: capslip.Settings(answer=Question(amplitude_m=1e-6, slip_force_N=1.0)),
            "answer",
        ),
    ],
)
def test_settings_made_by_their_classes_are_checked(made, says):
    with pytest.raises(SettingsError, match=re.escape(says)) as raised:
        analyze_once(caps_map(CAPS), made())
    assert "\n" not in str(raised.value)


def test_settings_of_numpy_numbers_and_dictionaries_are_what_they_say():
    made = capslip.Settings(
        contact={"preload_N": np.float64(300.0)},
        material=Material(youngs_modulus_Pa=np.array([7e10, 2e11])),
    )
    overrides = ("contact.preload_N=300", "material.youngs_modulus_Pa=[7e10, 2e11]")
    assert checked(made) == capslip.load_settings(None, overrides)


def test_the_summary_is_json_without_nan():
    summary = plain().summary()
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert summary["surface"]["path"] is None


def test_default_file_holds_the_defaults():
    from_file = capslip.load_settings(PROJECT / "configs" / "default.toml")
    assert from_file == capslip.Settings()
    assert from_file.sha256() == capslip.Settings().sha256()


def test_the_papers_settings_are_valid():
    settings = capslip.load_settings(PROJECT / "configs" / "peyret2016.toml")
    assert (settings.contact.model, settings.caps.fit) == ("families", "equation18")


def test_settings_take_numbers_of_numpy_and_paths(tmp_path):
    """As studies over a range give them; they are those of plain numbers."""
    given = {
        "contact": {"bulk": np.bool_(False)},
        "structure": {"joints": np.int64(3)},
        "mating": {"offset_m": np.array([1e-6, 2e-6])},
        "material": {"poisson_ratio": (np.float32(0.25), 0.3)},
        "joint": {"pressure_map": tmp_path / "map.csv"},
    }
    plain = {
        "contact": {"bulk": False},
        "structure": {"joints": 3},
        "mating": {"offset_m": [1e-6, 2e-6]},
        "material": {"poisson_ratio": [0.25, 0.3]},
        "joint": {"pressure_map": str(tmp_path / "map.csv")},
    }
    assert settings_from(given) == settings_from(plain)
    assert settings_from({"contact": {"preload_N": np.float64(3.0)}}).contact.preload_N == 3.0
    for bad in (np.float64("nan"), np.array([np.inf])):
        with pytest.raises(CapslipError, match="expected a finite number"):
            settings_from({"contact": {"preload_N": bad}})


@pytest.mark.parametrize(
    "angle", ["slip.direction_rad", "slip.normal_phase_rad", "mating.rotation_rad"]
)
def test_a_whole_turn_either_way_is_an_angle_and_more_is_none(angle):
    table, key = angle.split(".")
    for turn_rad in (-2.0 * np.pi, 2.0 * np.pi):
        assert getattr(getattr(settings_from({table: {key: turn_rad}}), table), key) == turn_rad
        with pytest.raises(CapslipError, match=f"{angle}: got "):
            settings_from({table: {key: np.nextafter(turn_rad, 2.0 * turn_rad)}})


def test_what_is_no_map_is_named_with_what_makes_one():
    surface = caps_map(CAPS)
    words = r"got {}; expected a HeightMap; .*capslip\.load_surface, .*capslip\.HeightMap"
    for given, name in (("scan.h5", "str"), (surface.height_m, "ndarray"), (None, "NoneType")):
        for call in (capslip.analyze, lambda one: analyze_once(one, capslip.Settings())):
            with pytest.raises(UnusableSurfaceError, match=f"^surface: {words.format(name)}"):
                call(given)
    for given, name in (("scan.h5", "str"), (surface.height_m, "ndarray"), ("", "str")):
        with pytest.raises(UnusableSurfaceError, match=f"^mate: {words.format(name)}"):
            capslip.analyze(surface, mate=given)


MAPS = [caps_map(CAPS)] * 2
SLIP = slip_curve(families((5, 18), (23.8, 26.7), (0, 2.4e-7), 1.1e11), 460.0, 0.2, 1.2)
VARYING = varying(SLIP, capslip.load_settings(overrides=("slip.normal_amplitude_ratio=0.1",)).slip)
WRONG = [  # what was called, and how its message begins
    (lambda: capslip.analyze(MAPS[0], {}), "settings: got dict; expected Settings; "),
    (lambda: capslip.analyze(MAPS[0], "x.toml"), "settings: got str; expected Settings; "),
    (lambda: analyze_once(MAPS[0], None), "settings: got NoneType; expected Settings; "),
    (lambda: analyze_families(None), "settings: got NoneType; expected Settings; "),
    (lambda: analyze_scans(MAPS, None), "settings: got NoneType; expected Settings; "),
    (lambda: analyze_scans(None, capslip.Settings()), "scans: got NoneType; expected a list"),
    (lambda: average(MAPS[0]), "scans: got HeightMap; expected a list of HeightMaps"),
    (lambda: average([*MAPS, None]), r"scans\[2\]: got NoneType; expected a HeightMap; "),
    (lambda: average(["a", MAPS[0]]), r"scans\[0\]: got str; expected a HeightMap; "),
    (lambda: capslip.write(MAPS[0], "x"), "analysis: got HeightMap; expected an Analysis; "),
    (lambda: capslip.HeightMap(np.eye(5), (1.0, 1.0), noise_m="a"), ".*: noise_m: got str; "),
    (lambda: SLIP.loop([]), r"amplitude_m: got \[\]; expected one finite number >= 0"),
    (lambda: SLIP.loop([-1, 1]), r"amplitude_m: got \[-1, 1\]; expected one finite number >= 0"),
    (lambda: SLIP.loop([1e-9]), r"amplitude_m: got \[1e-09\]; expected one finite number >= 0"),
    (lambda: SLIP.loop(np.inf), "amplitude_m: got inf; expected one finite number >= 0"),
    (lambda: SLIP.loop(-1e-9), "amplitude_m: got -1e-09; expected one finite number >= 0"),
    (lambda: VARYING.loop([]), r"amplitude_m: got \[\]; expected one finite number >= 0"),
    (lambda: SLIP.force_N("a"), "displacement_m: got 'a'; expected numbers"),
    (lambda: SLIP.energy_at_force_J(1j), "force_N: got 1j; expected numbers"),
    (lambda: slip_curve(SLIP.curve, [], 0.2, 1.2), r"preload_N: got \[\]; expected a finite"),
    (lambda: slip_curve(SLIP.curve, 460.0, "a", 1.2), "friction_coefficient: got 'a'; expected"),
    (lambda: synthetic_surface(None), "scene: got NoneType; expected a Scene"),
    (lambda: synthetic_surface(Scene((0, 0), (1, 1))), r"scene\.shape: got \(0, 0\); expected "),
    (lambda: synthetic_surface(Scene((60, 2))), r"scene\.shape: got \(60, 2\); expected "),
    (lambda: synthetic_surface(Scene((60,))), r"scene\.shape: got \(60,\); expected "),
    (lambda: synthetic_surface(Scene((9, 9), (0, 1))), r"scene\.pixel_size_m: got \(0, 1\); "),
    (lambda: synthetic_surface(Scene((9, 9), (1, np.nan))), r"scene\.pixel_size_m: got \(1, nan"),
    (lambda: synthetic_surface(Scene((9, 9), seed=-1)), r"scene\.seed: got -1; expected 0 or more"),
]


@pytest.mark.parametrize(("call", "message"), WRONG)
def test_a_wrong_argument_is_an_error_of_one_line(call, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CapslipError, match=f"^{message}") as caught:
        call()
    assert "\n" not in str(caught.value)
    assert not any(tmp_path.iterdir())


VALUES = (None, 1, 1.5, True, [], ["a"], (), {}, b"x", "x", np.eye(4), object(), MAPS[0], len)


def but(*kinds):
    """Return the values that are of none of these kinds."""
    return [one for one in VALUES if not isinstance(one, kinds)]


NO_PATH, NO_TRUTH = but(str), but(bool)
NO_TEXT, NO_TABLE = but(str, type(None)), but(dict, type(None))
NO_CALL = [one for one in VALUES if not callable(one)]
NO_LIST = [None, 1, 1.5, True, {}, b"x", "x", object(), len]
NO_DICT = but(dict)
ONLY_NUMBERS = {"figures": False, "render": False, "page": False}


def load(**given):
    np.save("a.npy", np.random.default_rng(0).normal(size=(30, 40)))
    known = {"unit": "um", "pixel_size": (1.0, 1.0), "lateral_unit": "um"}
    return capslip.load_surface("a.npy", **known | given)


def write(**given):
    return capslip.write(plain(), "result", **ONLY_NUMBERS | given)


def map_with(**given):
    return capslip.HeightMap(np.eye(5), (1.0, 1.0), **given)


ARGUMENTS = [  # the name of one, what takes it, and what it is not
    ("path", capslip.load_surface, NO_PATH),
    ("unit", lambda one: load(unit=one), NO_TEXT),
    ("lateral_unit", lambda one: load(lateral_unit=one), NO_TEXT),
    ("dataset", lambda one: load(dataset=one), NO_TEXT),
    ("scale", lambda one: load(scale=one), but(int, float, type(None))),
    ("top_row_first", lambda one: load(top_row_first=one), but(bool, type(None))),
    ("invert", lambda one: load(invert=one), NO_TRUTH),
    ("lenient", lambda one: load(lenient=one), NO_TRUTH),
    ("path", capslip.load_settings, but(str, type(None))),
    ("overrides", lambda one: capslip.load_settings(None, one), NO_LIST),
    ("overrides[0]", lambda one: capslip.load_settings(None, [one]), but(str)),
    ("settings", settings_from, NO_DICT),
    ("progress", lambda one: capslip.analyze(MAPS[0], progress=one), NO_CALL),
    ("folder", lambda one: capslip.write(plain(), one, **ONLY_NUMBERS), NO_PATH),
    ("command", lambda one: write(command=one), NO_TEXT),
    ("timings_s", lambda one: write(timings_s=one), NO_TABLE),
    ("page", lambda one: write(page=one), NO_TRUTH),
    ("export", lambda one: write(export=one), NO_TEXT),
    ("renderer", lambda one: write(renderer=one), but(type(None))),
    ("progress", lambda one: write(progress=one), NO_CALL),
    ("missing", lambda one: write(missing=one), NO_CALL),
    ("command", lambda one: plain().summary(one), NO_TEXT),
    ("timings_s", lambda one: plain().summary(None, one), NO_TABLE),
    ("ax", lambda one: plain().plot.loss_factor(one), but(type(None))),
    ("analysis", capslip.Plots, VALUES),
    ("analysis", capslip.Tables, VALUES),
    ("origin", lambda one: map_with(origin=one), VALUES),
    ("tops", lambda one: map_with(tops=one), but(type(None))),
    ("filling", lambda one: map_with(filling=one), but(type(None))),
    ("rounding", lambda one: map_with(rounding=one), but(type(None))),
    ("faces", lambda one: map_with(faces=one), but(int)),
    ("noise_scans", lambda one: map_with(noise_scans=one), but(int, float, type(None))),
    ("between", lambda one: map_with(between=one), but(tuple)),
    ("void", lambda one: map_with(void=one), NO_TRUTH),
    ("parts", lambda one: law(one, 0.2), [None, 1, 1.5, True, {}, np.eye(4), object(), len]),
    ("parts[0]", lambda one: law([one], 0.2), VALUES),
    ("friction_coefficient", lambda one: law(plain().parts, one), but(int, float)),
    ("holds", lambda one: law(plain().parts, 0.2, one), [1, "x", []]),
    ("sources", lambda one: find_scans(one, capslip.Settings()), NO_LIST),
    ("settings", lambda one: find_scans(["a.npy"], one), VALUES),
    ("folder", lambda one: run_batch(["a"], one, capslip.Settings(), print), NO_PATH),
    ("say", lambda one: run_batch(["a"], "x", capslip.Settings(), one), NO_CALL),
    (
        "options",
        lambda one: run_batch(["a"], "x", capslip.Settings(), print, options=one),
        VALUES,
    ),
]


@pytest.mark.parametrize(("name", "call", "values"), ARGUMENTS)
def test_an_argument_of_the_wrong_type_is_named(name, call, values, tmp_path, monkeypatch):
    """A traceback from deep within was the answer, or what is no truth counted as one."""
    monkeypatch.chdir(tmp_path)
    for value in values:
        with pytest.raises(SettingsError) as caught:
            call(value)
        message = str(caught.value)
        assert message.startswith(f"{name}: got {type(value).__name__}; expected "), value
        assert message.isprintable()
    assert {path.name for path in tmp_path.iterdir()} <= {"a.npy"}


@pytest.mark.parametrize(
    "call",
    [
        lambda: load(pixel_size=np.eye(4)),
        lambda: load(pixel_size=(MAPS[0], 1.0)),
        lambda: capslip.HeightMap(np.eye(5), MAPS[0]),
        lambda: capslip.HeightMap(np.eye(5), np.eye(5)),
        lambda: analyze_once(MAPS[0], capslip.Settings(material=Material(preset=MAPS[0]))),
        lambda: write(figures=MAPS[0]),
        lambda: SLIP.loop(np.eye(4)),
        lambda: SLIP.force_N(np.full((40, 4), "a")),
    ],
)
def test_what_was_found_is_told_on_one_short_line(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CapslipError) as caught:
        call()
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 200


def test_arguments_have_the_types_of_numpy_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plainly = load(top_row_first=True, invert=True, scale=2.0)
    given = {"top_row_first": np.bool_(True), "invert": np.bool_(True), "scale": np.float32(2.0)}
    np.testing.assert_array_equal(load(**given, unit=np.str_("um")).height_m, plainly.height_m)


@pytest.mark.parametrize(
    ("override", "name", "expected"),
    [
        ("conditioning.l_filter_nesting_index_m=30mm", "l_filter_nesting_index_m", 0.03),
        ("conditioning.s_filter_nesting_index_m=80 µm", "s_filter_nesting_index_m", 8e-5),
        ("contact.preload_N=1.2kN", "preload_N", 1200.0),
        ("joint.area_m2=12cm2", "area_m2", 1.2e-3),
        ("material.youngs_modulus_Pa=[200GPa,70GPa]", "youngs_modulus_Pa", (2e11, 7e10)),
        ("contact.load_point_m=[1mm,0.5mm]", "load_point_m", (1e-3, 5e-4)),
    ],
)
def test_an_override_takes_the_unit_in_which_its_name_ends(override, name, expected):
    settings = capslip.load_settings(overrides=(override,))
    table = getattr(settings, override.partition(".")[0])
    assert getattr(table, name) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "override",
    [
        "structure.modal_stiffness_N_per_m=30mm",
        "conditioning.l_filter_nesting_index_m=30N",
        "contact.preload_N=heavy",
        "material.friction_coefficient=2N",
    ],
)
def test_another_unit_is_refused_as_any_text_is(override):
    with pytest.raises(capslip.errors.SettingsError, match="expected a number"):
        capslip.load_settings(overrides=(override,))


def test_overrides_that_are_read_once_count():
    """A material that gives way to them takes a look at them first."""
    lines = ["contact.preload_N=230", "material.preset=aluminium"]
    assert capslip.load_settings(None, iter(lines)) == capslip.load_settings(None, tuple(lines))


def test_what_changes_no_number_is_not_in_the_key():
    plain = capslip.load_settings()
    assert capslip.load_settings(overrides=("run.workers=3",)).sha256() == plain.sha256()
    assert capslip.load_settings(overrides=("contact.preload_N=3",)).sha256() != plain.sha256()


def test_tilt_changes_nothing():
    surface = caps_map(CAPS)
    y, x = np.mgrid[: surface.shape[0], : surface.shape[1]]
    tilted = capslip.HeightMap(surface.height_m + 1e-6 * x - 2e-6 * y, surface.pixel_size_m)
    here, there = plain().summary(), analyze_once(tilted, capslip.Settings()).summary()
    assert there["families"]["m"] == here["families"]["m"]
    for table, key in (("contact", "approach_m"), ("damping", "peak_loss_factor")):
        assert there[table][key] == pytest.approx(here[table][key], rel=1e-6)


@pytest.mark.parametrize("model", ["flat", "families", "caps", "mean_field", "interacting"])
def test_every_model_gives_a_whole_summary(model):
    settings = capslip.load_settings(overrides=(f"contact.model={model}",))
    summary = capslip.analyze(caps_map(CAPS), settings).summary()
    assert summary["contact"]["model"] == model
    assert summary["slip"]["total_slip_force_N"] == pytest.approx(92.0)
    assert len(summary["damping"]["amplitude_m"]) >= 64
    if model == "flat":
        assert max(summary["damping"]["loss_factor"][:-1]) == 0.0
    else:
        assert summary["damping"]["peak_loss_factor"] > 0.0


def test_a_preload_that_no_face_can_carry_is_an_error_in_the_result():
    words = ("contact.preload_N=1e9", "material.hardness_Pa=1e9")  # 1.7e12 Pa on the face
    analysis = capslip.analyze(caps_map(CAPS), capslip.load_settings(overrides=words))
    failed = {p.code: p for p in analysis.problems}["contact_failed"]
    assert failed.severity == "error"
    assert analysis.status == "failed"
    assert analysis.slip is None
    assert analysis.summary()["damping"]["peak_loss_factor"] is None


@pytest.mark.parametrize(
    ("overrides", "code"),
    [
        (["material.youngs_modulus_Pa=[200e9,3e9]", "material.poisson_ratio=[0.3,0.4]"], "coupled"),
        (["material.friction_coefficient=50"], "friction_suspect"),
        (
            [
                "structure.modal_stiffness_N_per_m=2e8",
                "structure.joint_stiffness_N_per_m=1e8",
                "structure.beam.length_m=0.3",
            ],
            "beam_ignored",
        ),
        (["material.youngs_modulus_Pa=[200e9,70e9]", "material.poisson_ratio=[0.3,0.43]"], None),
        (["structure.modal_stiffness_N_per_m=2e8", "structure.joint_stiffness_N_per_m=1e8"], None),
        (["structure.beam.length_m=0.3", "material.friction_coefficient=1.2"], None),
    ],
)
def test_settings_that_are_hardly_meant_are_said(overrides, code):
    alone = (f"contact.{key}={value}" for key, value in ALONE.items())
    settings = capslip.load_settings(overrides=(*overrides, *alone))
    analysis = analyze_once(caps_map(CAPS), settings)
    said = {p.code for p in analysis.problems if p.severity == "warning"}
    silly = {"materials_coupled", "friction_suspect", "beam_ignored"} & said
    assert silly == ({"materials_coupled" if code == "coupled" else code} if code else set())


def test_a_plane_interface_has_no_caps_to_doubt():
    settings = capslip.load_settings(overrides=("contact.model=flat",))
    codes = {p.code for p in capslip.analyze(caps_map(CAPS), settings).problems}
    assert not codes & {"one_contact", "P_not_in_contact"}


def test_an_analysis_shows_itself_in_a_line_and_in_a_notebook():
    analysis = plain()
    summary = analysis.summary()
    fresh = capslip.analyze(caps_map(CAPS))
    line, _ = repr(fresh), fresh._repr_html_()
    assert set(vars(fresh.iso25178)) == {"conditioned"}  # what takes longest is not asked for
    assert "\n" not in line
    assert f"{summary['hills']['caps']} caps, {summary['contact']['model']} at 460 N" in line
    assert f"loss factor {summary['damping']['peak_loss_factor']:.3g}" in line
    one = analysis.problems[0]
    assert repr(replace(analysis, problems=(one,))).endswith(", 1 problem>")
    assert repr(replace(analysis, problems=(one, one))).endswith(", 2 problems>")
    page = analysis._repr_html_()
    assert f"<caption>{summary['name']}: {analysis.status}</caption>" in page
    assert f"<th>caps</th><td>{summary['hills']['caps']}</td>" in page
    for problem in analysis.problems:
        assert f"<th>{problem.code}</th>" in page
