"""The joint that a scan stands for: shares of area and load, and patches under uneven pressure."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from contact_cases import E_STAR_PA
from scipy.ndimage import gaussian_filter

import capslip
from capslip.analysis import analyze_once
from capslip.compare.model import load_model
from capslip.contact.doubts import problems_of_preload
from capslip.contact.joint import Joint, curve_of_joint, joint_of
from capslip.contact.models.caps import caps
from capslip.contact.models.families import families
from capslip.contact.models.interacting import interacting
from capslip.contact.pressure_map import classes_of_pressure, read_pressure_map
from capslip.contact.slip import slip_curve
from capslip.contact.uneven_accuracy import problems_of_levels
from capslip.errors import ContactError, SettingsError
from capslip.settings import load_settings
from capslip.structure import band_state
from capslip.surface.heightmap import HeightMap
from scenes import caps_map

MU, KAPPA = 0.2, 1.2143
PLACES_M = [(5e-3, 5e-3), (25e-3, 6e-3), (15e-3, 15e-3), (8e-3, 16e-3), (22e-3, 14e-3)]
FACE = caps_map([(x, y, 20.0 + i, -4e-8 * i) for i, (x, y) in enumerate(PLACES_M)])
AREA_M2 = 0.02 * 0.03
YIELDING = ((1e5, 2e-4), (8e5, 1e-4))  # pressures and areas of patches
LIGHT = ("contact.alignment=as_levelled", "contact.model=interacting")


def run(*overrides, face=FACE):
    return capslip.analyze(face, capslip.load_settings(overrides=(*LIGHT, *overrides)))


def run_once(*overrides):
    return analyze_once(FACE, capslip.load_settings(overrides=(*LIGHT, *overrides)))


def scan_curve(model="interacting"):
    x_m, y_m = np.array(PLACES_M).T
    radius_m, depth_m = 20.0 + np.arange(5), 4e-8 * np.arange(5)
    if model == "caps":
        return caps(radius_m, depth_m, E_STAR_PA)
    return interacting(radius_m, depth_m, x_m, y_m, E_STAR_PA, 300.0)


@pytest.mark.parametrize(
    "absurd", ["contact.preload_N=1e-30", "contact.preload_N=5e10", "joint.area_m2=1e30"]
)
def test_what_is_absurd_but_finite_is_computed_without_a_word_of_numpy(absurd):
    run(absurd)  # a warning would be an error here
    with pytest.raises(SettingsError, match="out of range"):
        run(f"contact.preload_N={1.1e14 * AREA_M2}")  # a thousand times E*


def pressure_file(tmp_path, *rows, header="x_m,y_m,pressure_Pa,area_m2"):
    path = tmp_path / "pressure.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_twice_the_joint_is_twice_every_force_and_the_same_displacements():
    one, two = run("contact.preload_N=150"), run("contact.preload_N=300", "joint.area_m2=1.2e-3")
    first, second = one.summary(), two.summary()
    for table, key in (
        ("contact", "preload_N"),
        ("contact", "stiffness_N_per_m"),
        ("contact", "contact_area_m2"),
        ("slip", "total_slip_force_N"),
        ("slip", "tangential_stiffness_N_per_m"),
    ):
        assert second[table][key] == pytest.approx(2.0 * first[table][key], rel=1e-12)
    for table, key in (
        ("contact", "nominal_pressure_Pa"),
        ("contact", "approach_m"),
        ("contact", "max_pressure_Pa"),
        ("slip", "total_slip_displacement_m"),
        ("slip", "limit_G_m"),
    ):
        assert second[table][key] == pytest.approx(first[table][key], rel=1e-12)
    assert (first["contact"]["coverage"], second["contact"]["coverage"]) == pytest.approx((1, 0.5))
    force_N = np.array([0.01, 0.1, 0.5, 0.9]) * one.slip.total_slip_force_N
    assert two.slip.displacement_m(2 * force_N) == pytest.approx(
        one.slip.displacement_m(force_N), rel=1e-12
    )
    assert two.slip.energy_at_force_J(2 * force_N) == pytest.approx(
        2 * one.slip.energy_at_force_J(force_N), rel=1e-12
    )
    assert two.caps.load_N == pytest.approx(one.caps.load_N, rel=1e-9)


def test_the_nominal_pressure_acts_on_the_rectangle_that_was_scanned():
    given = run("contact.nominal_pressure_Pa=250e3", "joint.area_m2=3e-3").summary()["contact"]
    assert given["preload_N"] == pytest.approx(750.0)
    assert given["scan_load_N"] == pytest.approx(250e3 * AREA_M2)
    z = np.full((210, 320), np.nan)
    z[5:205, 10:310] = FACE.height_m
    z[100:110, 100:110] = np.nan  # a hole is face all the same; the lines around are none
    wide = capslip.HeightMap(z, FACE.pixel_size_m)
    joint = joint_of(capslip.load_settings(), wide)
    assert joint.area_m2 == pytest.approx(AREA_M2, rel=1e-12)
    assert (joint.scan_load_N, joint.coverage) == (460.0, 1.0)


def test_patches_of_one_pressure_are_the_nominal_pressure(tmp_path):
    rows = [f"{i},0,200e3,1e-4" for i in range(12)]
    mapped = run(f"joint.pressure_map={pressure_file(tmp_path, *rows)}")
    plain = run("contact.nominal_pressure_Pa=200e3", "joint.area_m2=1.2e-3")
    ours, theirs = mapped.summary(), plain.summary()
    for table in ("contact", "slip"):
        for key, value in theirs[table].items():
            if isinstance(value, str | bool | None):
                assert ours[table][key] == value
            else:
                assert ours[table][key] == pytest.approx(value, rel=1e-9, abs=1e-12), key
    assert ours["damping"]["loss_factor"] == pytest.approx(
        theirs["damping"]["loss_factor"], rel=1e-9
    )


def test_what_bears_nothing_is_area_of_the_joint_and_no_part_that_a_scan_stands_for(tmp_path):
    rows = [f"0,0,{460.0 / AREA_M2},{AREA_M2}", f"0,0,0,{3.0 * AREA_M2}"]
    whole, part, half = (
        run(f"joint.pressure_map={pressure_file(tmp_path, *some)}", "material.friction_spread=0.1")
        for some in (rows[:1], rows, (*rows, rows[0]))
    )
    assert part.joint.area_m2 == pytest.approx(4.0 * whole.joint.area_m2)
    assert part.joint.nominal_pressure_Pa == pytest.approx(0.25 * whole.joint.nominal_pressure_Pa)
    assert (whole.joint.coverage, part.joint.coverage) == pytest.approx((1.0, 1.0))
    assert [one.code for one in part.problems] == [one.code for one in whole.problems]
    assert part.band.left_out == whole.band.left_out
    assert "scatter between scans" in half.band.left_out
    assert half.joint.coverage == pytest.approx(0.5)


@pytest.mark.parametrize("model", ["caps", "interacting"])
def test_an_uneven_joint_is_the_sum_of_its_patches_at_one_displacement(model):
    load_N, weight = np.array([40.0, 130.0, 300.0]), np.array([0.7, 2.0, 0.4])
    curve = scan_curve(model)
    whole = slip_curve(curve_of_joint(curve, load_N, weight), load_N @ weight, MU, KAPPA)
    parts = [slip_curve(scan_curve(model), N, MU, KAPPA) for N in load_N]
    delta_m = np.array([1e-3, 0.02, 0.2, 0.5, 0.9, 1.0, 1.3]) * whole.total_slip_displacement_m
    for name in ("force_N", "energy_J", "stiffness_N_per_m"):
        expected = sum(
            w * getattr(part, name)(delta_m) for w, part in zip(weight, parts, strict=True)
        )
        assert getattr(whole, name)(delta_m) == pytest.approx(expected, rel=5e-4), name
    assert whole.total_slip_displacement_m == pytest.approx(
        max(part.total_slip_displacement_m for part in parts), rel=1e-12
    )
    inside_m = delta_m[:5]
    force_N = whole.force_N(inside_m)
    assert whole.displacement_m(force_N) == pytest.approx(inside_m, rel=1e-9)
    assert whole.energy_at_force_J(force_N) == pytest.approx(whole.energy_J(inside_m), rel=1e-9)


TILTED = caps_map(
    [(x, y, 20.0, 5e-8 * i - 1.6e-7) for i, (x, y) in enumerate([*PLACES_M, (15e-3, 4e-3)])]
)
LITTLE_IS_HEAVY = ((1e5, 1.2e-3), (4e5, 1.2e-6))  # on a thousandth of the area


def by_hand(pressures, shares, *given):
    """Return stiffness, and energies at forces, of faces that were each pressed alone."""
    parts = []
    for pressure_Pa, area_m2 in pressures:
        even = (f"contact.nominal_pressure_Pa={pressure_Pa}", f"joint.area_m2={area_m2}")
        parts.append(run("contact.alignment=balanced", *even, *given, face=TILTED).slip)
    delta_m = np.geomspace(1e-4, 1.0, 2000) * max(one.total_slip_displacement_m for one in parts)
    force_N, energy_J = (
        sum(getattr(one, name)(delta_m) for one in parts) for name in ("force_N", "energy_J")
    )
    asked_N = np.array(shares) * sum(one.total_slip_force_N for one in parts)
    stiffness = sum(float(one.tangential_stiffness_N_per_m) for one in parts)
    return np.append(np.interp(asked_N, force_N, energy_J), stiffness)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
@pytest.mark.parametrize("more", [(), ("material.hardness_Pa=2e8",)])
@pytest.mark.parametrize("model", ["interacting", "boundary_elements"])
def test_each_patch_lies_at_the_level_that_its_own_pressure_finds(tmp_path, model, more):
    """A thousandth of the area, pressed harder, does not tell how the rest lies."""
    shares, given = (0.25, 0.5, 0.75), (f"contact.model={model}", *more)
    rows = [f"{pressure_Pa},{area_m2}" for pressure_Pa, area_m2 in LITTLE_IS_HEAVY]
    pressures = pressure_file(tmp_path, *rows, header="pressure_Pa,area_m2")
    uneven = ("contact.alignment=balanced", f"joint.pressure_map={pressures}")
    found = run(*uneven, *given, face=TILTED)
    slip, joint, contact = found.slip, found.joint, found.contact

    def answers(curve):
        one = slip_curve(curve, joint.preload_N, MU, contact.composite.kappa)
        energies_J = one.energy_at_force_J(np.array(shares) * one.total_slip_force_N)
        return np.append(energies_J, one.tangential_stiffness_N_per_m)

    expected = by_hand(LITTLE_IS_HEAVY, shares, *given)
    assert answers(joint.curve(contact)) == pytest.approx(expected, rel=0.02)
    assert slip.tangential_stiffness_N_per_m == pytest.approx(expected[-1], rel=0.02)
    at_one_level = answers(joint.curve(replace(contact, at_level=None)))
    assert np.abs(at_one_level / expected - 1.0).max() > 0.1


def test_a_pressure_that_finds_no_level_is_named_with_the_load_that_rests_there():
    joint = Joint(3.0, 1.0, 110.0, np.array([10.0, 20.0, 80.0]), np.ones(3), 80.0)
    state = SimpleNamespace(preload_N=80.0, lacks_level=lambda N: N < 15.0)
    patches = [SimpleNamespace(preload_N=N) for N in (10.0, 20.0, 80.0)]
    (lost,) = problems_of_levels(joint, state, patches)
    assert (lost.code, lost.severity) == ("not_balanced", "warning")
    assert "under 12 % of the greatest pressure and less, where 9.1 %" in lost.message
    state.lacks_level = lambda N: False
    assert problems_of_levels(joint, state, patches) == []


@pytest.mark.parametrize("model", ["caps", "interacting"])
def test_each_patch_of_a_face_that_yields_is_flattened_by_its_own_pressure(tmp_path, model):
    """Not by the greatest one of the joint: they are joints side by side, each loaded alone."""
    rows = [f"0,0,{pressure!r},{area!r}" for pressure, area in YIELDING]
    given = (f"contact.model={model}", "material.hardness_Pa=5e6")
    joint = run_once(f"joint.pressure_map={pressure_file(tmp_path, *rows)}", *given)
    alone = [
        run_once(f"contact.nominal_pressure_Pa={pressure}", f"joint.area_m2={area}", *given)
        for pressure, area in YIELDING
    ]
    assert all(one.contact.yielded_area_m2 > 0.0 for one in alone)
    delta_m = np.array([0.01, 0.1, 0.5, 0.9]) * joint.slip.total_slip_displacement_m
    for name, accuracy in (("force_N", 1e-3), ("energy_J", 3e-3)):
        expected = sum(getattr(one.slip, name)(delta_m) for one in alone)
        np.testing.assert_allclose(getattr(joint.slip, name)(delta_m), expected, rtol=accuracy)


def test_an_interval_of_uneven_patches_that_yield_follows_their_answer(tmp_path):
    """At the preload itself, and at a hundredth more of it as if that had been given."""
    given = ("contact.model=caps", "material.hardness_Pa=5e6", "answer.slip_force_N=5")

    def found_under(factor):
        rows = [f"0,0,{factor * pressure!r},{area!r}" for pressure, area in YIELDING]
        return run_once(f"joint.pressure_map={pressure_file(tmp_path, *rows)}", *given)

    answers = [found_under(factor) for factor in (1.0, 1.01)]
    state = band_state.State(answers[0].answer, True, answers[0].parts, answers[0].settings)
    log = dict.fromkeys(("friction", "modulus", "hardness"), np.zeros(2))
    delta_m, energy_J = state.under({**log, "preload": np.log([1.0, 1.01])})
    for i, one in enumerate(answers):
        assert delta_m[i] == pytest.approx(one.answer.displacement_m, rel=1e-3)
        assert energy_J[i] == pytest.approx(one.answer.energy_J, rel=3e-3)


def test_the_loop_of_an_uneven_joint_encloses_its_energy():
    load_N, weight = np.array([40.0, 300.0]), np.array([1.0, 1.0])
    slip = slip_curve(curve_of_joint(scan_curve(), load_N, weight), 340.0, MU, KAPPA)
    delta_m, force_N = slip.loop(0.7 * slip.total_slip_displacement_m, 4001)
    area_J = 0.5 * np.sum((force_N[1:] + force_N[:-1]) * np.diff(delta_m))
    assert abs(area_J) == pytest.approx(
        float(slip.energy_J(0.7 * slip.total_slip_displacement_m)), rel=5e-4
    )


def test_an_uneven_joint_carries_no_more_than_its_preload():
    curve = curve_of_joint(scan_curve(), np.array([40.0, 300.0]), np.array([1.0, 1.0]))
    assert curve.load_N(curve.approach_m([10.0, 340.0])) == pytest.approx([10.0, 340.0], rel=1e-3)
    with pytest.raises(ContactError, match="expected at most its preload, 340 N"):
        curve.approach_m(350.0)


def test_classes_keep_area_load_and_spread_and_leave_out_what_bears_nothing():
    rng = np.random.default_rng(4)
    pressure_Pa = np.maximum(rng.normal(2e5, 1.5e5, 3000), 0.0)
    area_m2 = rng.uniform(1e-7, 5e-7, 3000)
    class_Pa, class_m2 = classes_of_pressure(pressure_Pa, area_m2)
    assert len(class_Pa) < 250
    assert class_Pa.min() > 0.0
    assert class_Pa.max() <= pressure_Pa.max()
    loaded = pressure_Pa > 0.0
    for power in range(3):
        expected = (area_m2 * pressure_Pa**power)[loaded].sum()
        assert (class_m2 * class_Pa**power).sum() == pytest.approx(expected, rel=1e-12)


def test_classes_lose_no_more_than_they_say():
    rng = np.random.default_rng(5)
    curve = families((5, 18), (23.8, 26.7), (0.0, 2.4e-7), E_STAR_PA)
    load_N, weight = rng.uniform(5.0, 500.0, 1000), rng.uniform(0.5, 2.0, 1000) * 1e-3
    few_N, few = classes_of_pressure(load_N, weight)
    every, classed = (
        slip_curve(curve_of_joint(curve, N, w), float(N @ w), MU, KAPPA)
        for N, w in ((load_N, weight), (few_N, few))
    )
    force_N = np.array([0.1, 0.25, 0.5, 0.75]) * every.total_slip_force_N
    off = classed.energy_at_force_J(force_N) / every.energy_at_force_J(force_N) - 1.0
    assert abs(off[0]) < 0.01
    assert np.abs(off[1:]).max() < 1e-3
    assert classed.tangential_stiffness_N_per_m == pytest.approx(
        every.tangential_stiffness_N_per_m, rel=1e-3
    )


@pytest.mark.parametrize("decades", [4.0, 6.0, 9.0, 12.0])
def test_patches_that_bear_next_to_nothing_are_as_stiff_as_they_are(decades):
    """Where the pressure of a bolt fades: little of the load, a part of the stiffness."""
    curve = families((5, 18), (23.8, 26.7), (0.0, 2.4e-7), E_STAR_PA)
    load_N, weight = 500.0 * 10 ** -np.linspace(0.0, decades, 1000), np.linspace(1e-3, 8e-3, 1000)
    few_N, few = classes_of_pressure(load_N, weight)
    assert len(few_N) <= 300
    every, classed = (
        slip_curve(curve_of_joint(curve, N, w), float(N @ w), MU, KAPPA)
        for N, w in ((load_N, weight), (few_N, few))
    )
    light = load_N < 1e-3 * load_N[0]
    assert load_N[light] @ weight[light] < 0.01 * every.preload_N
    assert classed.tangential_stiffness_N_per_m == pytest.approx(
        every.tangential_stiffness_N_per_m, rel=2e-4
    )
    delta_m = np.array([1e-3, 1e-2, 0.1, 0.5]) * every.total_slip_displacement_m
    for name, accuracy in (("force_N", 1e-3), ("energy_J", 0.01)):
        expected = getattr(every, name)(delta_m)
        np.testing.assert_allclose(getattr(classed, name)(delta_m), expected, rtol=accuracy)


@pytest.mark.parametrize(
    ("header", "row", "said"),
    [
        ("x,y,p,a", "1,2,3,4", "got the columns x, y, p, a; expected pressure_Pa and area_m2"),
        ("area_m2,pressure_Pa", "1e-4,high", "line 2: pressure_Pa: got 'high'; expected a pres"),
        ("area_m2,pressure_Pa", "1e-4,-3", "line 2: pressure_Pa: got '-3'; expected a pressure >"),
        ("area_m2,pressure_Pa", "0,3", "line 2: area_m2: got '0'; expected an area > 0"),
        ("area_m2,pressure_Pa", "1e-4", "line 2: pressure_Pa: got None; expected a pressure >= 0"),
        ("area_m2,pressure_Pa", "1e-4,0", "1 patches, none under pressure"),
        ("pressure_Pa,area_m2", "1,500000,1e-4", "line 2: got 3 cells; expected 2, as many"),
        ("pressure_Pa,area_m2,", "1,500000,1e-4,", "line 2: got 3 cells; expected 2, as many"),
        ("pressure_Pa,area_m2", "1e6,1e-4\n1,500000,,1e-4", "line 3: got 4 cells; expected 2"),
        (
            "pressure_Pa,area_m2,pressure_Pa",
            "1e6,1e-4,2",
            "got the columns pressure_Pa, area_m2, pressure_Pa; expected pressure_Pa and",
        ),
        ("area_m2,pressure_Pa,area_m2", "2e-4,1e6,1e-4", "expected pressure_Pa and area_m2, once"),
    ],
)
def test_a_bad_pressure_map_is_one_line_that_says_where(tmp_path, header, row, said):
    with pytest.raises(SettingsError) as error:
        read_pressure_map(pressure_file(tmp_path, row, header=header))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("pressure_Pa,area_m2", "1e6,1e-4,"),
        ("pressure_Pa,area_m2", "1e6,1e-4, ,"),
        ("pressure_Pa,area_m2,", "1e6,1e-4,"),
        ("pressure_Pa,area_m2,,", "1e6,1e-4"),
        (",pressure_Pa,area_m2", "0,1e6,1e-4"),  # the count of a table beside it
        ("x_m,x_m,pressure_Pa,area_m2", "0,1,1e6,1e-4"),  # doubled, and not needed
    ],
)
def test_separators_at_the_end_and_other_columns_are_left_alone(tmp_path, header, row):
    pressure_Pa, area_m2 = read_pressure_map(pressure_file(tmp_path, row, header=header))
    assert (pressure_Pa.tolist(), area_m2.tolist()) == ([1e6], [1e-4])


def test_unlike_pressures_under_a_load_that_oscillates_are_refused(tmp_path):
    """How the joint spreads more than its mean load is not known."""
    varies = "slip.normal_amplitude_ratio=0.1"
    face = capslip.HeightMap(np.eye(20), (1e-4, 1e-4))
    unlike, even = (("1e-4,1e5", "1e-4,3e5"), ("1e-4,2e5", "1e-4,2e5"))
    for rows in (unlike, even):
        path = pressure_file(tmp_path, *rows, header="area_m2,pressure_Pa")
        settings = capslip.load_settings(overrides=(f"joint.pressure_map={path}", varies))
        if rows == even:
            assert joint_of(settings, face).is_even
        else:
            with pytest.raises(SettingsError, match=r"ratio: got 0\.1 with a joint\.pressure"):
                joint_of(settings, face)


def test_pressures_that_no_number_holds_together_are_refused_and_those_beyond_rounding_are_none(
    tmp_path,
):
    path = pressure_file(tmp_path, "1e10,1e300", "1,1e-4", header="pressure_Pa,area_m2")
    with pytest.raises(SettingsError, match=r"2 patches of 1e\+300 m2 under inf N together"):
        read_pressure_map(path)
    path = pressure_file(tmp_path, *["0,1.7e308"] * 2, "1,1e-4", header="pressure_Pa,area_m2")
    with pytest.raises(SettingsError, match=r"3 patches of inf m2 under 0\.0001 N together"):
        read_pressure_map(path)
    rows = ("1e6,1e-4", "1e-300,1e-4", "2e-6,1e-4")
    path = pressure_file(tmp_path, *rows, header="pressure_Pa,area_m2")
    assert read_pressure_map(path)[0].tolist() == [1e6, 0.0, 2e-6]


def test_a_settings_file_names_the_pressure_map_beside_it(tmp_path, monkeypatch):
    """Another one of that name in the current folder is that of another joint."""
    texts = {"mine": "pressure_Pa,area_m2\n1e5,2e-3\n", "other": "pressure_Pa,area_m2\n5e5,2e-3\n"}
    for folder, text in texts.items():
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "map.csv").write_text(text)
    mine, other = tmp_path / "mine", tmp_path / "other"
    (mine / "my.toml").write_text('[joint]\npressure_map = "map.csv"\n')
    monkeypatch.chdir(other)
    found = capslip.load_settings("../mine/my.toml")
    assert read_pressure_map(found.joint.pressure_map)[0].tolist() == [1e5]
    given = capslip.load_settings("../mine/my.toml", ("joint.pressure_map=map.csv",))
    assert read_pressure_map(given.joint.pressure_map)[0].tolist() == [5e5]
    monkeypatch.chdir(tmp_path)  # both are found from anywhere, and one that was moved is the same
    assert read_pressure_map(given.joint.pressure_map)[0].tolist() == [5e5]
    (tmp_path / "map.csv").write_text(texts["mine"])
    moved = capslip.load_settings(overrides=("joint.pressure_map=map.csv",))
    assert moved.joint.pressure_map != found.joint.pressure_map
    assert moved.sha256() == found.sha256() != given.sha256()


def test_a_settings_file_may_begin_with_a_byte_order_mark(tmp_path):
    """As that of an editor of Windows does."""
    path = tmp_path / "my.toml"
    path.write_text("[contact]\npreload_N = 123.0\n", encoding="utf-8-sig")
    assert capslip.load_settings(path).contact.preload_N == 123.0


def test_a_missing_pressure_map_is_named():
    with pytest.raises(SettingsError, match=r"no\.csv: No such file"):
        read_pressure_map("no.csv")


@pytest.mark.parametrize(
    "overrides",
    [
        ("contact.preload_N=460", "contact.nominal_pressure_Pa=2e5"),
        ("contact.preload_N=460", "joint.pressure_map=p.csv"),
        ("joint.area_m2=1e-3", "joint.pressure_map=p.csv"),
    ],
)
def test_a_load_or_an_area_given_twice_is_refused(overrides):
    names = [override.partition("=")[0] for override in overrides]
    with pytest.raises(SettingsError, match="expected one of them") as error:
        capslip.load_settings(overrides=overrides)
    assert all(name in str(error.value) for name in names)


def test_the_bulk_of_a_scan_is_not_that_of_a_joint():
    with pytest.raises(SettingsError, match=r"contact\.bulk"):
        run("contact.bulk=true", "joint.area_m2=3e-3")


def test_what_was_written_loads_again_with_its_pressure(tmp_path):
    analysis = run("contact.nominal_pressure_Pa=250e3", "joint.area_m2=3e-3")
    capslip.write(analysis, tmp_path / "out", figures=False, render=False)
    again = capslip.load_settings(tmp_path / "out" / "settings.toml")
    assert again.sha256() == analysis.settings.sha256()
    assert again.contact.nominal_pressure_Pa == 250e3


@pytest.mark.long
def test_a_stored_joint_is_compared_as_it_was_analysed(tmp_path):
    rows = [f"{100e3 * (i + 1)},1e-4" for i in range(3)]
    mapped = pressure_file(tmp_path, *rows, header="pressure_Pa,area_m2")
    for overrides in (("joint.area_m2=3e-3",), (f"joint.pressure_map={mapped}",)):
        analysis = run(*overrides)
        capslip.write(analysis, tmp_path / "out", figures=False, render=False)
        model, settings = load_model(tmp_path / "out")
        assert settings.contact.preload_N == pytest.approx(analysis.joint.preload_N)
        damping = analysis.damping
        at = np.array([5, 30, 60])
        whole = damping.loss_factor * damping.frequency_ratio**2
        assert model.loss_factor(
            damping.total_amplitude_m[at], 0.2, settings.contact.preload_N
        ) == pytest.approx(whole[at], rel=3e-3)


@pytest.mark.long
def test_a_face_cut_in_four_loses_as_the_whole_but_for_what_its_contacts_leave_out():
    rng = np.random.default_rng(1)
    z = gaussian_filter(rng.standard_normal((240, 240)), 4, mode="wrap")
    z *= 2e-4 * 5e-5 / np.sqrt(np.mean(np.gradient(z)[0] ** 2))
    settings = capslip.load_settings(
        overrides=("contact.nominal_pressure_Pa=1e6", "contact.model=interacting")
    )
    whole, *parts = (
        analyze_once(capslip.HeightMap(part.copy(), (5e-5, 5e-5)), settings)
        for part in (z, *(half for rows in np.split(z, 2) for half in np.split(rows, 2, axis=1)))
    )
    n = np.mean([part.contact.contacts for part in parts])
    assert n > 25
    force_N = 0.25 * whole.slip.total_slip_force_N
    low, high = 0.0, float(whole.slip.total_slip_displacement_m)
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = sum(float(part.slip.force_N(middle)) for part in parts) > force_N
        low, high = (low, middle) if above else (middle, high)
    energy_J = sum(float(part.slip.energy_J(low)) for part in parts)
    ratio = energy_J / float(whole.slip.energy_at_force_J(force_N))
    assert abs(1.0 - ratio) < 1.5 / np.sqrt(n)


def test_another_pressure_in_the_same_file_is_another_key(tmp_path):
    keys = []
    for pressure in ("1e5,1e-4", "2e5,1e-4"):
        path = pressure_file(tmp_path, pressure, header="pressure_Pa,area_m2")
        settings = capslip.load_settings(overrides=(f"joint.pressure_map={path}",))
        keys.append(settings.sha256())
    assert keys[0] != keys[1]


def test_a_plane_joint_holds_all_of_its_load_however_that_is_spread(tmp_path):
    rows = ["1e5,1e-3", "3e5,2e-3", "0,5e-3"]
    path = pressure_file(tmp_path, *rows, header="pressure_Pa,area_m2")
    found = run(f"joint.pressure_map={path}", "contact.model=flat").summary()
    assert found["contact"]["preload_N"] == pytest.approx(700.0)
    assert found["contact"]["nominal_pressure_Pa"] == pytest.approx(700.0 / 8e-3)
    assert found["slip"]["total_slip_force_N"] == pytest.approx(0.2 * 700.0)
    assert found["slip"]["total_slip_displacement_m"] == 0.0
    assert found["answer"]["energy_J"] == 0.0


def test_an_uneven_joint_is_given_up_to_total_slip_and_there():
    load_N = np.array([40.0, 300.0])
    slip = slip_curve(curve_of_joint(scan_curve(), load_N, np.ones(2)), 340.0, MU, KAPPA)
    total_m = slip.total_slip_displacement_m
    assert float(slip.displacement_m(MU * 340.0)) == pytest.approx(total_m, rel=1e-12)
    assert float(slip.displacement_m(0.0)) == 0.0
    assert float(slip.displacement_m(1e-9)) == pytest.approx(
        1e-9 / slip.tangential_stiffness_N_per_m, rel=1e-4
    )
    beyond = slip.energy_J([total_m, 1.5 * total_m])
    assert np.diff(beyond) == pytest.approx(4 * MU * 340.0 * 0.5 * total_m, rel=1e-9)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((), True),
        (("joint.area_m2=9.1e-6",), True),
        (("joint.area_m2=9.3e-6",), False),
        (("contact.preload_N=460",), False),
        (("contact.nominal_pressure_Pa=4e8",), False),
    ],
)
def test_a_load_that_nobody_gave_and_no_joint_bears_is_said(given, said):
    """460 N on a field of view of 1 mm2; 50 MPa of it are 9.2 mm2."""
    face, settings = field_of_view(1e-3), load_settings(overrides=given)
    found = problems_of_preload(joint_of(settings, face), settings)
    assert [one.code for one in found] == said * ["preload_of_demonstration"]
    if found:
        of = "9.1e-06 m2 of the joint" if given else "1e-06 m2 of the scan"
        assert f"460 N of the demonstration on the {of} are " in found[0].message


def test_a_field_of_view_too_small_for_the_load_of_the_demonstration_asks_for_the_joint():
    face = field_of_view(1e-6)
    with pytest.raises(SettingsError, match="nobody gave the load, and the 460 N of the demonstra"):
        joint_of(load_settings(), face)
    with pytest.raises(SettingsError, match="far below the modulus; look at the units"):
        joint_of(load_settings(overrides=("contact.preload_N=460",)), face)


def field_of_view(side_m):
    rows, columns = np.indices((20, 20))
    return HeightMap(1e-9 * np.hypot(rows, columns), (side_m / 20, side_m / 20))
