"""A result folder against CSV files: reading, units, one-line errors."""

import errno
import json
from dataclasses import replace
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure
from scipy.ndimage import gaussian_filter

from capslip.analysis import analyze
from capslip.cli import main
from capslip.compare import compare_result, lines, to_dict, write_comparison
from capslip.compare.comparison import Band
from capslip.compare.figure import comparison
from capslip.compare.measurement import load_measurement
from capslip.compare.model import JointModel, _load_surface_and_caps, load_model
from capslip.contact.press import press
from capslip.errors import OutputError, UnreadableFileError
from capslip.output import tables
from capslip.settings import load_settings
from capslip.studies.faces.curve import (
    ASSEMBLY,
    FACE,
    FRICTION,
    MATERIAL_LOSS,
    MONOLITHIC,
    POINTS,
    PRELOAD_N,
    SCATTER,
    SEED,
)
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from scenes import caps_map

SAMPLES = Path(__file__).parents[2] / "sample_surfaces"
CAPS = [(5e-3, 5e-3, 20.0, 0.0), (15e-3, 6e-3, 22.0, -1e-8), (25e-3, 14e-3, 24.0, -5e-8)]


@pytest.fixture(scope="module")
def surface():
    rng = np.random.default_rng(0)
    flat = caps_map(CAPS, floor_m=-4e-7)
    return type(flat)(flat.height_m + rng.normal(0, 1e-10, flat.shape), flat.pixel_size_m)


# Three caps that all but lie in a line balance only where the floor helps them
CAPS_ALONE = ("contact.alignment=as_levelled", "contact.time_limit_s=1e-3")


def result_of(surface, folder, *overrides):
    analysis = analyze(surface, load_settings(overrides=("conditioning.form='none'", *overrides)))
    folder.mkdir()
    tables.write_result(analysis, folder)
    tables.write_summary(analysis.summary(), folder)
    return analysis


@pytest.fixture(scope="module")
def result(surface, tmp_path_factory):
    folder = tmp_path_factory.mktemp("compare") / "result"
    return folder, result_of(surface, folder, *CAPS_ALONE)


@pytest.fixture(scope="module")
def compared(result, tmp_path_factory):
    """Return the result beside a curve that it has not made, with what fits that best."""
    text = "amplitude_um,loss_factor\n" + "".join(f"0.{k},0.00{k}\n" for k in range(1, 8))
    path = tmp_path_factory.mktemp("measured") / "a.csv"
    return compare_result(result[0], write(path, text), identify=True)


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["families", "caps", "mean_field", "interacting", "flat"])
def test_model_of_a_result_is_that_of_its_analysis(surface, tmp_path, name):
    if name == "interacting":  # a fourth cap, so that they surround the load
        surface = caps_map([*CAPS, (8e-3, 15e-3, 21.0, -3e-8)], floor_m=-4e-7)
    alignment = "as_levelled" if name in ("caps", "mean_field") else "balanced"
    chosen = (f"contact.model={name}", f"contact.alignment={alignment}")
    analysis = result_of(surface, tmp_path / "result", *chosen)
    model, settings = load_model(tmp_path / "result")
    damping = analysis.damping
    got = model.loss_factor(
        damping.total_amplitude_m,
        settings.material.friction_coefficient,
        settings.contact.preload_N,
    )
    expected = damping.loss_factor * damping.frequency_ratio**2
    np.testing.assert_allclose(got, expected, rtol=5e-3, atol=1e-15)


def test_a_stored_sum_of_two_faces_is_known_as_one(surface, result, tmp_path):
    flat = HeightMap(np.zeros(surface.shape), surface.pixel_size_m)
    aside_m = [0.5 * one for one in surface.pixel_size_m]
    aside = load_settings(
        overrides=("conditioning.form='none'", *CAPS_ALONE, f"mating.offset_m={aside_m}")
    )
    sum_of_both = analyze(surface, aside, flat)
    tables.write_result(sum_of_both, tmp_path)
    scans = sum_of_both.conditioned.surface.scans_of_noise
    assert scans == pytest.approx(1.6997, abs=1e-3)  # so much is left of the variance of the second
    for folder, faces, of_noise in ((tmp_path, 2, scans), (result[0], 1, 1.0)):
        stored = _load_surface_and_caps(folder / "result.h5")[0]
        assert (stored.faces, stored.scans_of_noise) == (faces, of_noise)


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
def test_what_holds_a_face_upright_is_at_ease_as_in_its_analysis(tmp_path):
    """The face is stored at its level, which is not the one it was mounted at."""
    z_m = gaussian_filter(np.random.default_rng(7).standard_normal((64, 64)), 4, mode="wrap")
    z_m *= 1e-8 / np.sqrt(np.mean(np.gradient(z_m)[0] ** 2))
    face = HeightMap(z_m + 5e-9 * np.arange(64), (5e-5, 5e-5))
    given = ("contact.preload_N=10", "contact.alignment_stiffness_Nm_per_rad=3")
    analysis = result_of(face, tmp_path / "result", *given)
    assert analysis.contact.rung.made_from == "map"
    assert analysis.level is not None
    model, settings = load_model(tmp_path / "result")
    damping = analysis.damping
    amplitude_m = damping.total_amplitude_m[:-1]
    got = model.loss_factor(amplitude_m, settings.material.friction_coefficient, 10.0)
    expected = (damping.loss_factor * damping.frequency_ratio**2)[:-1]
    np.testing.assert_allclose(got, expected, rtol=5e-3)
    share = analysis.contact.rung.least_share(analysis.contact.normal, 10.0)
    from_m = model.resolved_from_m(settings.material.friction_coefficient, 10.0)
    force_N = np.interp(from_m, amplitude_m, damping.force_N[:-1])
    expected_N = share * analysis.slip.total_slip_force_N
    assert 0.0 < force_N == pytest.approx(expected_N, rel=2e-2)
    assert model.plane().resolved_from_m(0.2, 10.0) == 0.0


def test_a_face_that_yielded_under_an_oscillating_load_is_that_of_its_analysis(surface, tmp_path):
    """It was flattened by the greatest load of the cycle, not by the preload."""
    slip = ("slip.normal_amplitude_ratio=0.5", "slip.normal_phase_rad=1.2")
    chosen = ("contact.model=caps", "material.hardness_Pa=5e6", *slip, *CAPS_ALONE)
    analysis = result_of(surface, tmp_path / "result", *chosen)
    assert analysis.contact.yielded_area_m2 > 0.0
    model, settings = load_model(tmp_path / "result")
    damping, steady = analysis.damping, np.isfinite(analysis.damping.loss_factor)
    given = settings.material.friction_coefficient, settings.contact.preload_N
    got = model.loss_factor(damping.total_amplitude_m[steady], *given)
    expected = (damping.loss_factor * damping.frequency_ratio**2)[steady]
    np.testing.assert_allclose(got, expected, rtol=5e-3)


def test_a_pressure_map_that_changed_since_is_no_joint_to_compare(surface, tmp_path):
    pressures = write(tmp_path / "pressures.csv", "pressure_Pa,area_m2\n1e6,3e-4\n2e6,3e-4\n")
    result_of(surface, tmp_path / "result", f"joint.pressure_map={pressures}", *CAPS_ALONE)
    assert load_model(tmp_path / "result")[1].contact.preload_N == pytest.approx(900.0)
    write(pressures, "pressure_Pa,area_m2\n4e6,3e-4\n2e6,3e-4\n")
    with pytest.raises(UnreadableFileError, match=r"pressures\.csv holds something else now"):
        load_model(tmp_path / "result")


@pytest.mark.parametrize(("feature", "m"), [("peak_height", 1), ("radius", 2)])
def test_families_are_those_of_the_analysis(tmp_path, feature, m):
    four = [(5e-3, 5e-3, 20.0, 0.0), (15e-3, 6e-3, 30.0, -2e-7)]
    four += [(25e-3, 14e-3, 20.5, -2.1e-7), (8e-3, 15e-3, 31.0, -2.2e-7)]
    chosen = (f"families.feature={feature}", "families.count=2", "contact.model=families")
    chosen += ("contact.alignment=as_levelled",)
    analysis = result_of(caps_map(four), tmp_path / "result", *chosen)
    assert analysis.families.m == m
    model, _ = load_model(tmp_path / "result")
    got = model.curve(460.0)
    np.testing.assert_array_equal(got.count, analysis.contact.curve.count)
    approach_m = np.linspace(1e-8, 5e-7, 50)
    np.testing.assert_allclose(
        got.load_N(approach_m), analysis.contact.curve.load_N(approach_m), rtol=1e-12
    )


def test_contact_model_is_that_of_the_result_at_every_preload(surface, tmp_path):
    # at a tenth of the preload families are within this tolerance
    chosen = ("contact.tolerance=0.5", *CAPS_ALONE)
    analysis = result_of(surface, tmp_path / "result", *chosen)
    used = analysis.contact.model
    assert analysis.settings.contact.model == "auto"
    model, _ = load_model(tmp_path / "result")
    light = result_of(surface, tmp_path / "light", *chosen, "contact.preload_N=46.0")
    assert light.contact.model != used
    assert [model.curve(preload_N).model for preload_N in (46.0, 460.0, 1500.0)] == 3 * [used]
    load_N = np.geomspace(1.0, 460.0, 30)
    got, expected = (one.approach_m(load_N) for one in (model.curve(460.0), analysis.contact.curve))
    np.testing.assert_allclose(got, expected, rtol=1e-9)


def test_caps_that_cannot_touch_are_no_rows_of_a_chosen_model(surface, tmp_path):
    chosen = ("contact.tolerance=0.001", "contact.preload_N=1.0", *CAPS_ALONE)
    contact = result_of(surface, tmp_path / "result", *chosen).contact
    assert contact.model == "interacting"
    assert contact.use.sum() == 2
    model, _ = load_model(tmp_path / "result")
    assert [len(model.curve(preload_N).radius_m) for preload_N in (1.0, 460.0)] == [2, 3]


@pytest.mark.long
@pytest.mark.usefixtures("fewer_points")
def test_a_map_is_solved_at_every_preload_once(tmp_path, monkeypatch):
    surface = caps_map(CAPS, (50, 75), (4e-4, 4e-4), floor_m=-4e-7)
    chosen = ("contact.model=boundary_elements", "contact.alignment=as_levelled")
    analysis = result_of(surface, tmp_path / "result", *chosen)
    solved = []
    monkeypatch.setattr(
        "capslip.compare.model.press",
        lambda *given, **known: solved.append(given) or press(*given, **known),
    )
    model, _ = load_model(tmp_path / "result")
    one, same = model.curve(460.0), model.curve(460.0)
    assert one is same
    assert len(solved) == 1
    load_N = np.geomspace(1.0, 460.0, 30)
    expected_m = analysis.contact.curve.approach_m(load_N)
    np.testing.assert_allclose(one.approach_m(load_N), expected_m, rtol=1e-6)
    assert model.trials < JointModel.trials
    assert model.is_rough


# Unlike enough that the level moves as the load shifts among them
FIVE = [(5e-3, 5e-3, 12.0, 0.0), (24e-3, 5e-3, 30.0, -1e-7), (25e-3, 14e-3, 24.0, -2e-7)]
FIVE += [(6e-3, 15e-3, 18.0, 0.0), (15e-3, 9e-3, 15.0, -2e-7)]
HARD, SOFT = "material.hardness_Pa=5e9", "material.hardness_Pa=5e7"
UPRIGHT = "contact.alignment_stiffness_Nm_per_rad=3e5"  # turns the face back by most of its tilt
BESIDE = "contact.load_point_m=[0.013, 0.011]"


@pytest.fixture
def tilted():
    """Return a face that was not mounted level."""
    five = caps_map(FIVE)
    return HeightMap(five.height_m + 3e-6 * 1e-4 * np.arange(300), five.pixel_size_m)


@pytest.mark.long
@pytest.mark.parametrize("model", ["caps", "interacting", "auto"])
@pytest.mark.parametrize("given", [HARD, SOFT, UPRIGHT, BESIDE])
def test_caps_are_levelled_at_every_preload(tilted, tmp_path, model, given):
    chosen = (f"contact.model={model}", given, "contact.time_limit_s=1e-3")
    heavy = result_of(tilted, tmp_path / "heavy", *chosen)
    light = result_of(tilted, tmp_path / "light", *chosen, "contact.preload_N=230")
    assert heavy.contact.model == light.contact.model
    found = load_model(tmp_path / "heavy")[0].curve(230.0)
    load_N = np.geomspace(1.0, 230.0, 30)
    expected_m = light.contact.curve.approach_m(load_N)
    np.testing.assert_allclose(found.approach_m(load_N), expected_m, rtol=0.015)
    as_stored_m = heavy.contact.curve.approach_m(load_N)
    assert np.abs(as_stored_m / expected_m - 1.0).max() > 0.04


def test_an_uneven_joint_is_levelled_under_its_greatest_pressure(tilted, tmp_path):
    found = []
    for name, pressures_Pa in (("heavy", (8e5, 4e5)), ("light", (4e5, 2e5))):
        rows = "".join(f"{pressure_Pa},6e-4\n" for pressure_Pa in pressures_Pa)
        pressures = write(tmp_path / f"{name}.csv", f"pressure_Pa,area_m2\n{rows}")
        chosen = ("contact.model=interacting", f"joint.pressure_map={pressures}")
        found.append(result_of(tilted, tmp_path / name, *chosen))
    heavy, light = found
    assert heavy.joint.preload_N == pytest.approx(2.0 * light.joint.preload_N)
    load_N = np.geomspace(1.0, light.joint.preload_N, 30)
    expected_m = light.joint.curve(light.contact).approach_m(load_N)
    curve = load_model(tmp_path / "heavy")[0].curve(light.joint.preload_N)
    np.testing.assert_allclose(curve.approach_m(load_N), expected_m, rtol=0.01)
    as_stored_m = heavy.joint.under(light.joint.preload_N).curve(heavy.contact).approach_m(load_N)
    assert np.abs(as_stored_m / expected_m - 1.0).max() > 0.04


@pytest.mark.long
def test_friction_and_preload_of_a_face_that_levels_itself_are_found(tilted, tmp_path):
    chosen = ("contact.model=interacting",)
    result_of(tilted, tmp_path / "result", *chosen)
    truth = ("contact.preload_N=230", "material.friction_coefficient=0.3")
    damping = result_of(tilted, tmp_path / "truth", *chosen, *truth).damping
    eta = damping.loss_factor * damping.frequency_ratio**2
    rows = zip(damping.total_amplitude_m[-20:-1], eta[-20:-1], strict=True)
    text = "amplitude_m,loss_factor\n" + "".join(f"{v},{loss}\n" for v, loss in rows)
    measured = write(tmp_path / "measured.csv", text)
    found = compare_result(tmp_path / "result", measured, identify=True).identified
    assert found.friction_coefficient == pytest.approx(0.3, rel=0.02)
    assert found.preload_N == pytest.approx(230.0, rel=0.02)


@pytest.mark.long
def test_result_against_its_own_curve(result, tmp_path):
    folder, analysis = result
    damping = analysis.damping
    eta = damping.loss_factor * damping.frequency_ratio**2
    rows = zip(damping.total_amplitude_m[::4] * 1e6, eta[::4] / 2 * 100, strict=True)
    text = "amplitude_um,damping_ratio_percent\n" + "".join(f"{v},{xi}\n" for v, xi in rows)
    found = compare_result(folder, write(tmp_path / "own.csv", text), identify=True)
    assert all(band.rms_log_ratio < 3e-3 for band in found.bands)
    assert found.identified.friction_coefficient == pytest.approx(0.2, rel=0.05)
    assert found.identified.preload_N == pytest.approx(460.0, rel=0.05)
    write_comparison(found, tmp_path / "new" / "out")
    written = json.loads((tmp_path / "new" / "out" / "compare.json").read_text("utf-8"))
    assert written == to_dict(found)
    assert (tmp_path / "new" / "out" / "compare.png").stat().st_size > 10_000
    assert sum(line.startswith("misfit") for line in lines(found)) == 3


@pytest.mark.long
def test_half_a_comparison_takes_no_place(compared, tmp_path):
    out = tmp_path / "out"
    write_comparison(compared, out)
    names = ["compare.json", "compare.png"]
    before = [(out / name).read_bytes() for name in names]

    def half(*given, **_):
        path = next(one for one in given if isinstance(one, Path))
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    for kind in ((Path, "write_text"), (Figure, "savefig")):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(*kind, half)
            with pytest.raises(OutputError, match=r"device; make room on its disk, or choose"):
                write_comparison(compared, out)
        assert [(out / name).read_bytes() for name in names] == before
        assert sorted(one.name for one in out.iterdir()) == names


@pytest.mark.long
def test_the_sample_curves_are_those_of_their_joint_as_a_sensor_sees_it(tmp_path):
    given = (f"material.friction_coefficient={FRICTION}", f"contact.preload_N={PRELOAD_N}")
    analysis = result_of(load_surface(SAMPLES / f"{FACE}.h5"), tmp_path / "result", *given)
    model, _ = load_model(tmp_path / "result")
    curves = [load_measurement(SAMPLES / name) for name in (ASSEMBLY, MONOLITHIC)]
    amplitude_m = curves[0].amplitude_m
    joints = model.loss_factor(amplitude_m, FRICTION, PRELOAD_N)
    scatter = np.random.default_rng(SEED).normal(0.0, SCATTER, (2, POINTS))
    for curve, truth, noise in zip(curves, (joints, 0.0), scatter, strict=True):
        expected = (truth + MATERIAL_LOSS) * np.exp(noise)
        np.testing.assert_allclose(curve.loss_factor, expected, rtol=0.015)  # of its own grid
        np.testing.assert_array_equal(curve.amplitude_m, amplitude_m)
    gross_m = analysis.damping.total_amplitude_m[-1]
    np.testing.assert_allclose(amplitude_m[[0, -1]], [0.018 * gross_m, 0.9 * gross_m], rtol=1e-3)
    found = compare_result(
        tmp_path / "result", *(SAMPLES / name for name in (ASSEMBLY, MONOLITHIC)), identify=True
    ).identified
    off = np.log([found.friction_coefficient / FRICTION, found.preload_N / PRELOAD_N])
    assert (np.abs(off) < [found.friction_coefficient_log_std, found.preload_log_std]).all()


@pytest.mark.long
def test_the_figure_names_the_curves_of_the_model_as_such(compared):
    """A map that was pressed has no caps."""
    labels = [line.get_label() for line in comparison(compared).axes[0].get_lines()]
    assert "model, µ = 0.2, N = 460 N" in labels
    assert sum(one.startswith("model, identified: µ = ") for one in labels) == 1
    assert not any("caps" in one for one in labels)


def test_monolithic_file_and_points_outside_it(result, tmp_path):
    assembly = write(tmp_path / "a.csv", "amplitude_nm,loss_factor\n50,0.004\n100,0.006\n200,.01\n")
    monolithic = write(tmp_path / "m.csv", "loss_factor,amplitude_nm\n.001,90\n.001,300\n")
    found = compare_result(result[0], assembly, monolithic)
    np.testing.assert_allclose(found.joint_loss_factor, [np.nan, 0.005, 0.009], rtol=1e-12)
    assert to_dict(found)["points"]["joint_loss_factor"][0] is None
    write_comparison(found, tmp_path / "out")


def test_points_without_a_misfit_are_hollow_in_the_picture(result, tmp_path):
    """One beside the monolithic curve, two beyond gross slip, and one where nothing is lost."""
    text = "amplitude_nm,loss_factor\n50,0.004\n100,0.006\n200,.01\n1e7,.01\n2e7,.01\n"
    monolithic = write(tmp_path / "m.csv", "loss_factor,amplitude_nm\n.001,90\n.001,3e7\n")
    found = compare_result(result[0], write(tmp_path / "a.csv", text), monolithic)
    assert sum(band.points for band in found.bands) == 2
    for one, hollow_nm in (
        (found, [50, 1e7, 2e7]),
        (replace(found, model_loss_factor=np.array([1e-3, 0.0, 1e-3, np.nan, np.nan])),
         [50, 100, 1e7, 2e7]),
        (replace(found, joint_loss_factor=found.measured_loss_factor,
                 model_loss_factor=np.full(5, 1e-3)), []),
    ):  # fmt: skip
        drawn = {line.get_label(): line for line in comparison(one).axes[0].get_lines()}
        assert drawn["measured, assembly"].get_xdata() == pytest.approx(1e6 * found.amplitude_m)
        label = f"{len(hollow_nm)} of these, left out of the misfit"
        assert (label in drawn) == bool(hollow_nm)
        if hollow_nm:
            assert drawn[label].get_markerfacecolor() == "white"
            assert drawn[label].get_xdata() == pytest.approx(1e-3 * np.array(hollow_nm))
        else:
            assert not any("left out" in one for one in drawn)


def test_small_amplitudes_are_in_nanometres_and_named_as_those_of_a_sensor(result, tmp_path):
    for text, unit, greatest in (
        ("50,0.004\n90,.01\n", "nm", 90.0),
        ("50,.004\n2e3,.01\n", "µm", 2.0),
    ):
        measured = write(tmp_path / "a.csv", "amplitude_nm,loss_factor\n" + text)
        found = compare_result(result[0], measured)
        axes = comparison(found).axes[0]
        assert axes.get_xlabel() == f"amplitude at mid-span, as a sensor sees it [{unit}]"
        drawn = {line.get_label(): line for line in axes.get_lines()}
        assert drawn["measured, assembly"].get_xdata()[-1] == pytest.approx(greatest)
        assert all(len(line.get_xdata()) for line in drawn.values())  # no entry without a curve
        assert f"to {greatest:g} {unit.replace('µ', 'u')}, model" in lines(found)[0]


def test_a_structure_that_nobody_gave_is_said(surface, tmp_path):
    measured = write(tmp_path / "a.csv", "amplitude_nm,loss_factor\n50,0.004\n100,0.006\n")
    stiff = ("structure.modal_stiffness_N_per_m=2e8", "structure.joint_stiffness_N_per_m=1e8")
    for name, given in (("demonstration", ()), ("own", stiff)):
        result_of(surface, tmp_path / name, *CAPS_ALONE, *given)
        remarks = compare_result(tmp_path / name, measured).remarks
        assert any("the demonstration beam" in one for one in remarks) == (not given)


@pytest.mark.parametrize(
    ("header", "row", "amplitude_m", "loss_factor"),
    [
        ("amplitude_um,loss_factor", "1.5,0.01", 1.5e-6, 0.01),
        ("amplitude_m,damping_ratio_percent", "1.5e-6,0.5", 1.5e-6, 0.01),
        ("damping_ratio,amplitude_nm", "0.005,1500", 1.5e-6, 0.01),
        ("amplitude_mm, loss_factor_percent", "0.0015, 1", 1.5e-6, 0.01),
    ],
)
def test_units_of_the_header(tmp_path, header, row, amplitude_m, loss_factor):
    measured = load_measurement(write(tmp_path / "a.csv", f"\ufeff{header}\n{row}\n\n{row}\n"))
    np.testing.assert_allclose(measured.amplitude_m, amplitude_m, rtol=1e-12)
    np.testing.assert_allclose(measured.loss_factor, loss_factor, rtol=1e-12)


def test_greatest_values_are_allowed(tmp_path):
    path = write(tmp_path / "a.csv", "amplitude_m,loss_factor\n0.05,0.5\n0.1,1.0\n")
    measured = load_measurement(path)
    assert (measured.amplitude_m[1], measured.loss_factor[1]) == (0.1, 1.0)


@pytest.mark.long
def test_text_and_json_hold_what_was_found(compared):
    found = compared
    points = to_dict(found)["points"]
    for name, values in points.items():
        np.testing.assert_array_equal(np.array(values, dtype=float), getattr(found, name))
    assert {"joint_energy_J", "joint_loss_factor", "model_loss_factor"} < points.keys()
    identified = replace(
        found.identified,
        friction_coefficient=0.25,
        friction_coefficient_log_std=0.03,
        preload_N=512.0,
        preload_log_std=0.07,
        correlation=-0.5,
        rms_log_ratio=0.125,
    )
    band = Band("small", 1e-7, 3e-7, 4, 0.5, float(np.log(0.75)))
    given = replace(found, bands=(band,), identified=identified)
    _, misfit, fit, *_ = lines(given)
    assert "0.1 to 0.3 um: 4 points, model / measured 0.75 on average, rms ln ratio 0.5" in misfit
    assert "mu 0.25 +- 3 %, preload 512 N +- 7 %, correlation -0.500" in fit
    assert fit.endswith("rms ln ratio 0.125")


@pytest.mark.long
def test_nothing_is_said_to_be_identified_by_a_model_that_misses_the_points(compared):
    """Neither in text nor as numbers or a curve; the remarks say what was found out."""
    fit = replace(compared.identified, rms_log_ratio=float(np.log(3.0)) - 1e-9)
    for rms, missed in ((fit.rms_log_ratio, False), (fit.rms_log_ratio + 2e-9, True)):
        found = replace(compared, identified=replace(fit, rms_log_ratio=rms))
        (line,) = (one for one in lines(found) if one.startswith("identified"))
        assert ("mu" in line) != missed
        assert line.startswith("identified nothing") == missed
        assert (to_dict(found)["identified"] is None) == missed
        labels = comparison(found).axes[0].get_legend_handles_labels()[1]
        assert any("identified" in one for one in labels) != missed


GOOD = "amplitude_um,loss_factor\n1,0.01\n2,0.02\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["is empty"]),
        ("amplitude,loss_factor\n1,0.01\n", ["line 1", "column 1", "'amplitude'"]),
        ("amplitude_um\n1\n2\n", ["line 1", "expected one amplitude and one"]),
        ("amplitude_um,amplitude_nm\n1,2\n", ["line 1", "expected one amplitude and one"]),
        ("amplitude_um,loss_factor,damping_ratio\n1,2,3\n", ["expected one amplitude and one"]),
        ("amplitude_um;loss_factor\n1;0.01\n", ["line 1", "column 1", "by a comma"]),
        ("amplitude_um,loss_factor\n1,0.01\n", ["1 lines of values"]),
        (GOOD + "3,0.03,4\n", ["line 4", "3 values"]),
        (GOOD + "1,5,0,03\n", ["line 4", "4 values", "point in decimal"]),
        (GOOD + "3,x\n", ["line 4", "column loss_factor", "'x'"]),
        (GOOD + "3,\n", ["line 4", "column loss_factor", "''"]),
        (GOOD + "nan,0.1\n", ["line 4", "column amplitude_um", "'nan'"]),
        (GOOD + "-3,0.1\n", ["line 4", "column amplitude_um", "'-3'"]),
        (GOOD + "3,0\n", ["line 4", "column loss_factor", "'0'"]),
        (GOOD + "3,2.5\n", ["line 4", "column loss_factor", "2.5", "loss_factor_percent"]),
        ("amplitude_m,loss_factor\n1e-6,0.01\n2,0.01\n", ["line 3", "column amplitude_m", "unit"]),
    ],
)
def test_bad_csv_says_file_line_and_column(tmp_path, text, words):
    path = write(tmp_path / "bad.csv", text)
    with pytest.raises(UnreadableFileError) as caught:
        load_measurement(path)
    message = str(caught.value)
    assert "\n" not in message
    for word in [str(path), *words]:
        assert word in message


def test_an_amplitude_that_stands_twice(tmp_path):
    path = write(tmp_path / "m.csv", GOOD + "1,0.03\n")
    assert len(load_measurement(path).amplitude_m) == 3
    with pytest.raises(UnreadableFileError, match=r"line 4, column amplitude_um.*twice"):
        load_measurement(path, distinct=True)


def test_binary_and_missing_files(tmp_path):
    (tmp_path / "b.csv").write_bytes(b"\x89PNG\xff\x00")
    with pytest.raises(UnreadableFileError, match="not a CSV"):
        load_measurement(tmp_path / "b.csv")
    with pytest.raises(UnreadableFileError, match="give a CSV file"):
        load_measurement(tmp_path / "none.csv")


def test_a_folder_that_is_no_result(tmp_path):
    with pytest.raises(UnreadableFileError, match="no finished result"):
        load_model(tmp_path)


def test_a_damaged_result(result, tmp_path):
    copytree(result[0], tmp_path / "result")
    (tmp_path / "result" / "result.h5").unlink()
    with pytest.raises(UnreadableFileError, match=r"holds no result\.h5, and so no face"):
        load_model(tmp_path / "result")
    (tmp_path / "result" / "result.h5").write_bytes(b"nothing")
    with pytest.raises(UnreadableFileError, match="run the analysis again"):
        load_model(tmp_path / "result")


@pytest.mark.parametrize("table", ["contact", "families", "slip", "provenance"])
def test_a_summary_that_somebody_cut(result, tmp_path, table):
    copytree(result[0], tmp_path / "result")
    path = tmp_path / "result" / "summary.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), table: None}))
    with pytest.raises(UnreadableFileError, match=rf"summary\.json: no table {table}; .*again"):
        load_model(tmp_path / "result")


@pytest.mark.parametrize("place", ["", "deep/er", "../result", "link"])
def test_a_comparison_is_no_foreign_file_in_a_result(result, tmp_path, place):
    copytree(result[0], folder := tmp_path / "result")
    (folder / "link").symlink_to(folder)
    before = sorted(tmp_path.rglob("*"))
    data = write(tmp_path / "a.csv", GOOD)
    with pytest.raises(OutputError, match=r"holds a result \(summary\.json\), .* beside it with"):
        write_comparison(compare_result(folder, data), folder / place)
    given = [str(each) for each in (folder, "--assembly", data, "-o", folder / place)]
    ran = CliRunner().invoke(main, ["compare", *given, "-q"])
    assert (ran.exit_code, ran.stderr.count("\n")) == (2, 1)
    assert sorted(tmp_path.rglob("*")) == sorted([*before, data])


def test_a_comparison_is_no_foreign_file_in_a_batch_and_stands_beside_one(result, tmp_path):
    (tmp_path / "all" / "scans").mkdir(parents=True)
    (tmp_path / "all" / "batch.csv").touch()
    found = compare_result(result[0], write(tmp_path / "a.csv", GOOD))
    with pytest.raises(OutputError, match="all holds results of a batch, "):
        write_comparison(found, tmp_path / "all")
    write_comparison(found, tmp_path / "compared")
    write_comparison(found, tmp_path / "compared")  # in place of itself
    assert {one.name for one in (tmp_path / "compared").iterdir()} == {
        "compare.json",
        "compare.png",
    }


def test_a_folder_that_cannot_be_made(result, tmp_path):
    found = compare_result(result[0], write(tmp_path / "a.csv", GOOD))
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="choose another"):
        write_comparison(found, tmp_path / "file" / "out")
