"""Figures: what is drawn, and that it is true."""

import subprocess
import sys
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import output_cases
import pytest
from PIL import Image

from capslip.analysis import analyze, analyze_once
from capslip.caps.table import CapFlag
from capslip.contact.varying_load import varying
from capslip.output import figures_contact
from capslip.output.canvas import blank, height_limits, save, write_decades, write_png
from capslip.output.figures import FIGURES
from capslip.output.figures_contact import _between, normal_curve
from capslip.output.quantity import engineering, unit_on
from capslip.sensitivity import ANSWERS
from capslip.settings import SlipSettings, load_settings, settings_from
from capslip.surface.readers.hdf5 import write_hdf5
from scenes import caps_map

NEED_NO_CAP = {"height_map", "hills_and_caps", "texture"}


def curve(figure, label):
    """Return the data of one line of a figure."""
    lines = [line for axes in figure.axes for line in axes.get_lines()]
    return next(line for line in lines if line.get_label().startswith(label)).get_data()


def visible_texts(axes):
    """Return the texts inside and around a pair of axes, tick labels out of view left out."""
    texts = [*axes.texts, axes.xaxis.label, axes.yaxis.label, axes.title, axes._left_title]
    for axis in (axes.xaxis, axes.yaxis):
        low, high = sorted(axis.get_view_interval())
        texts += [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
        texts += [tick.label2 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    if axes.get_legend():
        texts += axes.get_legend().get_texts()
    return [text for text in texts if text.get_visible() and text.get_text()]


@pytest.mark.long
@pytest.mark.parametrize("model", ["flat", "families", "interacting", "mean_field"])
def test_every_model_can_be_drawn(model, several, tmp_path):
    """What others read too, the sensitivity, is drawn of the first, which lacks most."""
    rigid = model == "flat"
    texts = (f"contact.model={model}", "contact.preload_N=150")
    settings = load_settings(overrides=(*texts, f"run.sensitivity={str(rigid).lower()}"))
    analysis = analyze(output_cases.coarse(several.surface, 2), settings)
    drawn = {path.stem for path in output_cases.write_figures(analysis, tmp_path)}
    lacks = {"slip_loop", "energy", "contributions"} if rigid else {"sensitivity"}
    assert drawn == set(FIGURES) - lacks


@pytest.fixture(scope="module")
def page(several, tmp_path_factory):
    """Return a function that gives a figure as it was saved, and its file."""
    folder = tmp_path_factory.mktemp("pages")

    @cache
    def saved(name):
        figure = FIGURES[name].draw(several)
        save(figure, folder / f"{name}.png")
        return figure, folder / f"{name}.png"

    return saved


@pytest.mark.long
@pytest.mark.parametrize("name", ["none", "one", "several"])
def test_what_exists_is_drawn_and_nothing_else(name, page, tmp_path):
    if name == "several":
        paths = [page(figure)[1] for figure in FIGURES]
    else:
        paths = output_cases.write_figures(getattr(output_cases, name)(), tmp_path)
    drawn = {path.stem for path in paths}
    assert drawn == (NEED_NO_CAP if name == "none" else set(FIGURES))
    for path in paths:
        assert path.read_bytes().startswith(b"\x89PNG")
        assert path.stat().st_size > 5000


@pytest.mark.parametrize("name", [name for name in FIGURES if name != "hills_and_caps"])
def test_no_text_lies_on_another(name, page):
    figure, _ = page(name)
    texts = [text for axes in figure.axes for text in visible_texts(axes)]
    boxes = [(text.get_text(), text.get_window_extent().padded(-1)) for text in texts]
    assert len(boxes) > 10
    for (one, box), (other, other_box) in combinations(boxes, 2):
        assert not box.overlaps(other_box), f"{one!r} lies on {other!r}"


@pytest.mark.parametrize("name", FIGURES)
def test_what_is_written_lies_on_the_page(name, page):
    figure, file = page(name)
    with Image.open(file) as picture:
        assert picture.size == tuple(figure.bbox.size.astype(int))
    texts = [text for axes in figure.axes for text in visible_texts(axes)]
    texts += [text for legend in figure.legends for text in legend.get_texts()]
    for text in texts:
        box = text.get_window_extent()
        inside = (box.min >= 0.0).all() and (box.max <= figure.bbox.size).all()
        assert inside, f"{text.get_text()!r} leaves the page"


def test_a_picture_is_written_as_it_is(tmp_path):
    pixels = np.random.default_rng(4).integers(0, 256, (31, 17, 3), dtype=np.uint8)
    write_png(pixels, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(picture), pixels)


def test_a_cap_on_a_spike_does_not_set_the_colours():
    height_m = np.random.default_rng(2).uniform(-1e-6, 1e-6, (100, 100))
    assert 2.5e-6 < height_limits(height_m, np.array([2e-5]))[1] < 3.1e-6
    assert height_limits(height_m, np.array([2e-5]), 0.1)[1] < 1.5e-6


def test_loads_that_differ_by_rounding_alone_are_drawn_as_one():
    load_N = np.array([0.0, 1.0, 2.0, np.nextafter(2.0, 3.0), 3.0])
    fine_N, fine_m = _between(load_N, load_N ** (2 / 3))
    np.testing.assert_allclose(fine_m, fine_N ** (2 / 3), rtol=1e-9)


def test_one_point_in_a_thousand_leaves_the_map_its_colours(several):
    surface = several.conditioned.surface
    height_m = surface.height_m.copy()
    height_m[0, :3] = 5.0 * np.nanmax(height_m)
    spiked = replace(several.conditioned, surface=replace(surface, height_m=height_m))
    with_spike, without = (
        FIGURES["height_map"].draw(one).axes[0].get_images()[0].get_clim()
        for one in (replace(several, conditioned=spiked), several)
    )
    assert np.ptp(with_spike) < 1.25 * np.ptp(without)


def test_the_map_shows_what_touches_with_areas_as_its_loads(several):
    (circles,) = FIGURES["height_map"].draw(several).axes[0].collections[-1:]
    caps = several.caps
    loaded = np.nan_to_num(caps.load_N) > 0.0
    places_m = np.column_stack([caps.x_m, caps.y_m])[loaded]
    np.testing.assert_allclose(circles.get_offsets(), places_m * 1e3)
    size, load_N = circles.get_sizes(), caps.load_N[loaded]
    large = size > size.min()
    np.testing.assert_allclose(size[large] / size.max(), load_N[large] / load_N.max())


def test_dashed_means_are_those_of_the_points_drawn(several):
    up = several.caps.with_columns(peak_height_m=several.caps.peak_height_m + 5e-7)
    axes = FIGURES["families"].draw(replace(several, caps=up)).axes[0]
    lines = {line.get_label(): line.get_ydata() for line in axes.get_lines()}
    dashed = [line.get_ydata()[0] for line in axes.get_lines() if line.get_linestyle() == "--"]
    for name, mean in zip(("G-caps", "P-caps"), dashed, strict=True):
        (peaks,) = (y for label, y in lines.items() if label.startswith(name))
        assert mean == pytest.approx(np.mean(peaks))
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert words.count("mean of a family") == 1


@pytest.mark.long
def test_an_extrapolated_loss_is_drawn_pale():
    analysis = output_cases.pressed_map()
    least = analysis.contact.rung.least_share(analysis.contact.normal, analysis.contact.preload_N)
    force_N = least * float(analysis.slip.total_slip_force_N)
    axes = FIGURES["energy"].draw(analysis).axes[0]
    (end,) = (line.get_xdata()[0] for line in axes.get_lines() if "pixels" in line.get_label())
    (axes_of_loss,) = FIGURES["loss_factor"].draw(analysis).axes
    (veil,) = (p for p in axes_of_loss.patches if p.get_label() == "_veil")
    assert end * 1e-9 == pytest.approx(float(analysis.slip.displacement_m(force_N)))
    unit_m = {"nm": 1e-9, "µm": 1e-6}[axes_of_loss.get_xlabel().partition("[")[2].rstrip("]")]
    stiffness = analysis.damping.joint_stiffness_N_per_m
    assert veil.get_extents().width > 0.0
    assert veil.get_x() + veil.get_width() == pytest.approx(force_N / stiffness / unit_m)


@pytest.mark.parametrize(("factor", "named"), [(0.9, False), (1.1, True)])
def test_the_end_of_what_pixels_resolve_is_named_where_it_is_in_view(
    factor, named, several, monkeypatch
):
    axes = FIGURES["energy"].draw(several).axes[0]
    unit_m = {"nm": 1e-9, "µm": 1e-6}[axes.get_xlabel().partition("[")[2].rstrip("]")]
    end_N = float(several.slip.force_N(factor * axes.get_xlim()[0] * unit_m))
    monkeypatch.setattr(figures_contact, "_resolved_from_N", lambda analysis: end_N)
    axes = FIGURES["energy"].draw(several).axes[0]
    assert any("pixels" in line.get_label() for line in axes.get_lines()) == named


def test_map_has_equal_scale_and_one_grey_patch(several):
    axes = FIGURES["height_map"].draw(several).axes[0]
    assert axes.get_aspect() == 1.0
    heights_um = axes.get_images()[0].get_array()
    surface = several.conditioned.surface
    np.testing.assert_allclose(heights_um.compressed(), surface.height_m[surface.measured] * 1e6)
    assert heights_um.mask.sum() == (~surface.measured).sum()
    side_y_mm, side_x_mm = (1e3 * side_m for side_m in surface.side_m)
    assert axes.get_images()[0].get_extent() == pytest.approx([0.0, side_x_mm, 0.0, side_y_mm])


def test_a_wrong_point_does_not_set_the_colours():
    height_m = np.random.default_rng(1).uniform(-1e-6, 1e-6, (100, 100))
    height_m[3, 4], height_m[5, 6], height_m[0, 0] = 1e-3, -1e-3, np.nan
    low_m, high_m = height_limits(height_m, np.array([2.5e-6]))
    assert -2.1e-6 < low_m < -1.5e-6
    assert high_m == 2.5e-6
    flat_m = np.zeros((20, 20))
    flat_m[0, 0] = 1e-6
    assert height_limits(flat_m, np.array([])) == (0.0, 1e-6)


def test_swept_answers_are_drawn_in_the_unit_that_is_written(several):
    sweeps = several.sensitivity.sweeps
    figure = FIGURES["sensitivity"].draw(several)
    columns = len(sweeps)
    for label, name in (("approach\nwith bulk", "approach_m"), ("W", "energy_J")):
        row = next(k for k, axes in enumerate(figure.axes) if axes.get_ylabel().startswith(label))
        unit = figure.axes[row].get_ylabel().partition("[")[2].rstrip("]")
        factor = {"n": 1e9, "µ": 1e6, "m": 1e3}[unit[0]]
        for sweep, axes in zip(sweeps, figure.axes[row : row + columns], strict=True):
            answer = sweep.answer[:, ANSWERS.index(name)]
            line = axes.get_lines()[1]
            np.testing.assert_allclose(line.get_ydata(), answer * factor)
            np.testing.assert_array_equal(line.get_xdata(), sweep.value)


def test_profile_states_its_true_exaggeration(several, tmp_path):
    figure = FIGURES["cap_profile"].draw(several)
    save(figure, tmp_path / "a.png")
    axes = figure.axes[0]
    (x0, y0), (x1, y1) = axes.transData.transform([(0.0, 0.0), (1.0, 1.0)])
    unit = axes.get_ylabel().partition("[")[2].rstrip("]")
    true = ((y1 - y0) / {"nm": 1e-9, "µm": 1e-6}[unit]) / ((x1 - x0) / 1e-3)
    note = next(text.get_text() for text in axes.texts if "heights drawn" in text.get_text())
    stated = float(note.removeprefix("heights drawn x").replace(" ", ""))
    assert stated == float(f"{true:.2g}")


def test_profile_shows_the_most_loaded_cap(several):
    i = int(np.nanargmax(several.caps.load_N))
    figure = FIGURES["cap_profile"].draw(several)
    assert f"Cap {i + 1}," in figure.axes[0].get_title(loc="left")
    x_mm, z_nm = curve(figure, "fitted sphere")
    assert figure.axes[0].get_ylabel() == "height [nm]"
    caps = several.caps
    assert z_nm.max() == pytest.approx(caps.peak_height_m[i] * 1e9)
    sag_nm = z_nm.max() - np.interp(0.4 * caps.diameter_m[i] * 1e3, x_mm, z_nm)
    expected = (0.4 * caps.diameter_m[i]) ** 2 / (2 * caps.radius_m[i]) * 1e9
    assert sag_nm == pytest.approx(expected, rel=1e-3)


def test_profile_of_a_pressed_map_shows_the_cap_whose_hill_carries_most():
    analysis = output_cases.pressed_map()
    contact, caps = analysis.contact, analysis.caps
    assert not (np.nan_to_num(caps.load_N) > 0.0).any()
    pressed = contact.normal.pressed(contact.preload_N)
    carried = [pressed.pressure_Pa[analysis.hills.label == i + 1].sum() for i in range(len(caps))]
    title = FIGURES["cap_profile"].draw(analysis).axes[0].get_title(loc="left")
    assert title.startswith(f"Cap {int(np.argmax(carried)) + 1}, the most loaded")
    highest = analysis.caps.with_columns(peak_height_m=-caps.peak_height_m)
    again = FIGURES["cap_profile"].draw(replace(analysis, caps=highest)).axes[0]
    assert again.get_title(loc="left") == title


def test_loop_encloses_the_energy_it_states(several):
    slip = several.slip
    figure = FIGURES["slip_loop"].draw(several)
    x, y = curve(figure, "60 %")
    peak_N = 0.6 * slip.total_slip_force_N
    unit_N = unit_on(figure.axes[0].get_ylabel(), 0.0, "N")[0]
    y = y * unit_N
    assert y.max() == pytest.approx(peak_N)
    unit_m = slip.displacement_m(peak_N) / x.max()
    area_J = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2 * unit_m
    assert area_J == pytest.approx(float(slip.energy_at_force_J(peak_N)), rel=2e-3)


@pytest.mark.parametrize("name", ["slip_loop", "energy"])
def test_bands_end_where_the_first_and_the_last_cap_slip_fully(name, several):
    slip = several.slip
    axes = FIGURES[name].draw(several).axes[0]
    bands = {patch.get_label()[:3]: patch for patch in axes.patches}
    total_m = float(slip.total_slip_displacement_m)
    unit_m = total_m / bands["TS:"].get_x()
    ends = bands["PPS"].get_x(), bands["PPS"].get_x() + bands["PPS"].get_width()
    assert ends == pytest.approx((np.nanmin(slip.limits_m) / unit_m, total_m / unit_m))
    middle_m = np.array([0.999 * ends[0], 1.001 * ends[0], 0.999 * ends[1]]) * unit_m
    assert list(slip.phase(middle_m)) == ["GPS", "PPS", "PPS"]


def test_unknown_limits_are_not_called_gps(several):
    class Curve:
        def __getattr__(self, name):
            return getattr(several.slip, name)

        limits_m = np.full(5, np.nan)

    figure = FIGURES["slip_loop"].draw(replace(several, slip=Curve()))
    labels = [patch.get_label() for patch in figure.axes[0].patches]
    assert labels == ["GPS or PPS, not told apart", "TS: all contacts slide (gross slip)"]


@pytest.mark.long
def test_energy_starts_with_slope_three(one):
    x, y = curve(FIGURES["energy"].draw(one), "W")
    slope = np.diff(np.log(y)) / np.diff(np.log(x))
    assert slope[0] == pytest.approx(3.0, abs=0.01)


def oscillating(analysis, ratio=0.1, phase_rad=0.7):
    """Return the analysis as it is under a normal load that oscillates."""
    given = SlipSettings(normal_amplitude_ratio=ratio, normal_phase_rad=phase_rad)
    return replace(analysis, slip=varying(analysis.slip, given))


@pytest.mark.parametrize("name", ["slip_loop", "energy"])
def test_under_a_load_that_oscillates_lines_end_at_gross_slip(name, several):
    for analysis, ends in ((several, False), (oscillating(several), True)):
        axes = FIGURES[name].draw(analysis).axes[0]
        x, y = axes.get_lines()[0].get_data()
        (band,) = [patch for patch in axes.patches if patch.get_label().startswith("TS")]
        last = x[np.isfinite(y)].max()
        assert last == pytest.approx(band.get_x() if ends else axes.get_xlim()[1], rel=1e-12)


@pytest.mark.parametrize(("ratio", "phase_rad"), [(0.1, 0.7), (0.6, 0.0)])
def test_loops_under_a_load_that_oscillates_lie_beside_the_amplitudes(ratio, phase_rad, several):
    moved = oscillating(several, ratio, phase_rad)
    axes = FIGURES["slip_loop"].draw(moved).axes[0]
    dashed, *loops = axes.get_lines()
    assert dashed.get_label() == "amplitudes of steady cycles"
    for loop in loops:
        x, y = loop.get_data()
        assert np.ptp(x) / 2 == pytest.approx(
            np.interp(y.max(), *dashed.get_data()[::-1]), rel=1e-2
        )
        assert x.max() + x.min() < -0.05 * np.ptp(x)
        assert axes.get_xlim()[0] < x.min() < x.max() < axes.get_xlim()[1]
    # what a constant load would slip as a whole first is not known here
    assert axes.patches[0].get_label() == "GPS or PPS, not told apart"
    still = FIGURES["slip_loop"].draw(several).axes[0].get_lines()[0]
    assert still.get_label() == "first loading"


def test_loss_factor_ends_at_gross_slip(several):
    axes = FIGURES["loss_factor"].draw(several).axes[0]
    x, y = axes.get_lines()[0].get_data()
    assert np.isfinite(y).all()
    damping = several.damping
    steady = damping.amplitude_m[np.isfinite(damping.loss_factor)]
    assert axes.get_xlim()[1] > x[-1]
    assert x[-1] / x[0] == pytest.approx(steady[-1] / steady[0])


def test_loss_factor_shows_small_amplitudes_and_kinks(several):
    axes = FIGURES["loss_factor"].draw(several).axes[0]
    assert axes.get_yscale() == "log"
    y = axes.get_lines()[0].get_ydata()
    low, high = axes.get_ylim()
    assert low <= y.min() * (1 + 1e-12)
    assert y.max() < high
    assert y.max() / y.min() > 100  # what a linear axis would show as zero


@pytest.mark.long
def test_matplotlib_is_imported_only_to_draw(tmp_path):
    code = (
        "import sys, capslip.output.figures, capslip.output.scene\n"
        "from capslip.cli import main\n"
        "main(sys.argv[1:], standalone_mode=False)\n"
        "heavy = {'matplotlib', 'pyvista', 'meshio', 'vtkmodules'} & set(sys.modules)\n"
        "sys.exit(f'imported: {heavy}' if heavy else 0)"
    )
    write_hdf5(caps_map([(8e-3, 10e-3, 10.0, 0.0)]), tmp_path / "face.h5")
    words = ["analyze", tmp_path / "face.h5", "-o", tmp_path / "out", "--no-figures", "--no-render"]
    command = [sys.executable, "-c", code, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "report.html").is_file()


def test_a_face_that_yielded_is_drawn_as_it_unloads():
    caps = [(8e-3, 10e-3, 10.0, 0.0), (22e-3, 10e-3, 10.0, -1e-7)]
    tables = output_cases.SETTINGS.to_dict()
    tables["contact"] |= {"model": "interacting"}
    tables["material"] |= {"hardness_Pa": 3e6}
    analysis = analyze_once(caps_map(caps), settings_from(tables))
    assert analysis.contact.yielded_area_m2 > 0
    assert normal_curve(analysis).axes[0].get_xlabel() == "recovery d on unloading [nm]"
    elastic = normal_curve(output_cases.several()).axes[0]
    assert elastic.get_xlabel() == "normal approach d from first touch [nm]"
    lines = normal_curve(analysis).axes[0].lines
    assert len(lines) == 4  # with and without the bulk, caps alone, and the preload
    for line in lines:
        assert max(line.get_ydata()) <= 150.0
        assert min(line.get_xdata()) >= 0.0


def test_the_normal_curve_of_a_map_without_caps_has_none_beside_it():
    found = output_cases.pressed_map()
    flags = np.full(len(found.caps), CapFlag.not_convex, dtype=np.uint16)
    without = replace(found, caps=found.caps.with_columns(flags=flags))
    assert not without.caps.usable.any()
    for analysis, n_alone in ((found, 1), (without, 0)):
        labels = [line.get_label() for line in normal_curve(analysis).axes[0].lines]
        assert labels.count("caps alone, not the map") == n_alone


def test_the_normal_curve_of_a_part_says_whose_load_and_stiffness_it_shows():
    surface = caps_map([(8e-3, 10e-3, 10.0, 0.0), (22e-3, 10e-3, 10.0, -1e-7)])
    tables = output_cases.SETTINGS.to_dict()
    tables["joint"] |= {"area_m2": float(4.0 * np.prod(surface.side_m))}
    analysis = analyze_once(surface, settings_from(tables))
    axes = normal_curve(analysis).axes[0]
    assert axes.get_ylabel() == "normal load N on the scan [N]"
    (state,) = (t.get_text() for t in axes.get_legend().get_texts() if "stiffness" in t.get_text())
    assert state.startswith("load on the scan 37.5 N")
    stiffness = analysis.summary()["contact"]["stiffness_N_per_m"]
    assert stiffness == pytest.approx(4.0 * analysis.contact.stiffness_N_per_m)
    assert state.endswith(f"of the joint: {engineering(stiffness, 'N/m')}")


def test_no_loss_factor_is_drawn_where_the_mode_is_not_lightly_damped(several):
    damping = several.damping
    heavy = replace(damping, loss_factor=100.0 * damping.loss_factor)
    figure = FIGURES["loss_factor"].draw(replace(several, damping=heavy))
    _, eta = curve(figure, "_loss factor")
    assert np.nanmax(eta) <= 0.3
    assert np.isnan(eta).any()
    names = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert any("not lightly damped" in name for name in names)
    assert not any("greatest value" in name for name in names)


def test_numbers_of_caps_do_not_hide_each_other(several):
    caps = several.caps
    close = caps.with_columns(x_m=caps.x_m[0] + 1e-6 * np.arange(len(caps)), y_m=0.0 * caps.y_m)
    for one, numbers in ((several, len(caps)), (replace(several, caps=close), 1)):
        figure = FIGURES["hills_and_caps"].draw(one)
        assert sum(text.get_text().isdecimal() for text in figure.axes[0].texts) == numbers


def test_one_family_alone_is_not_called_the_higher(one, several):
    for analysis, name in ((one, "caps (1)"), (several, "G-caps (2)")):
        texts = FIGURES["hills_and_caps"].draw(analysis).legends[0].get_texts()
        assert name in [text.get_text() for text in texts]


def marked(axes, word):
    """Return place and interval of what a diamond marks."""
    handles, labels = axes.get_legend_handles_labels()
    at = next(i for i, label in enumerate(labels) if label.startswith(word))
    x, y = handles[at].lines[0].get_data()
    (bar,) = handles[at].lines[2][0].get_segments()
    return float(x[0]), float(y[0]), bar[:, 1]


def test_energy_and_loss_factor_mark_the_answer_on_their_curves(several):
    found, band = several.answer, several.band.interval
    for name, x_m, value, interval in (
        ("energy", found.displacement_m, found.energy_J, band["energy_J"]),
        ("loss_factor", found.amplitude_m, found.loss_factor, band["loss_factor"]),
    ):
        axes = FIGURES[name].draw(several).axes[0]
        x, y, bar = marked(axes, "answer")
        assert y == pytest.approx(value)
        assert bar == pytest.approx(interval)
        assert x * unit_on(axes.get_xlabel(), 0.0, "m")[0] == pytest.approx(x_m)
        line = axes.get_lines()[0]
        on_curve = np.exp(np.interp(np.log(x), *np.log(line.get_data())))
        assert on_curve == pytest.approx(value, rel=0.01)


def test_an_amplitude_without_a_loss_factor_is_shown_where_it_was_asked(several):
    asked = replace(several, answer=replace(several.answer, loss_factor=None, amplitude_m=2e-7))
    axes = FIGURES["loss_factor"].draw(asked).axes[0]
    line = next(one for one in axes.get_lines() if str(one.get_label()).startswith("asked"))
    assert line.get_label() == "asked: 200 nm, where it is not defined"
    unit_m = unit_on(axes.get_xlabel(), 0.0, "m")[0]
    assert line.get_xdata()[0] * unit_m == pytest.approx(2e-7)


@pytest.mark.parametrize("name", ["slip_loop", "energy"])
@pytest.mark.parametrize(("share", "seen"), [(1e-4, False), (0.1, True)])
def test_a_band_too_thin_to_be_seen_has_no_name(name, share, seen, several):
    class Curve:
        def __getattr__(self, name):
            return getattr(several.slip, name)

        limits_m = share * several.slip.total_slip_displacement_m * np.array([1.0, 2.0])

    figure = FIGURES[name].draw(replace(several, slip=Curve()))
    labels = [patch.get_label()[:3] for patch in figure.axes[0].patches]
    assert labels == (["GPS"] if seen else []) + ["PPS", "TS:"]


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(0.002, 20.0, ["0.01", "0.1", "1", "10"]), (2e-6, 2e-2, ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²"])],
)
def test_ticks_of_an_axis_are_written_alike(low, high, expected):
    figure, axes = blank("")
    axes.loglog([low, high], [1.0, 1.0])
    axes.set_xlim(low, high)
    write_decades(axes.xaxis)
    figure.canvas.draw()
    texts = [text.get_text() for text in axes.get_xticklabels()]
    assert [text for text in texts if text in expected] == expected
    assert not any("e" in text for text in texts)


def test_a_legend_says_where_a_family_has_other_caps_than_are_drawn(several):
    other = replace(several.families, G=replace(several.families.G, count=7))
    for name in ("families", "hills_and_caps"):
        figure = FIGURES[name].draw(replace(several, families=other))
        legend = (figure.legends or [figure.axes[0].get_legend()])[0]
        words = [text.get_text() for text in legend.get_texts()]
        assert "G-caps (2; on its own plane 7)" in words
        assert "P-caps (3)" in words


def test_the_line_of_what_neighbours_differ_by_is_named_and_not_hidden(several):
    hills = replace(several.hills, noise_m=2e-9)
    axes = FIGURES["texture"].draw(replace(several, hills=hills)).axes[1]
    axes.figure.canvas.draw()
    (line,) = (one for one in axes.get_lines() if "neighbours" in one.get_label())
    assert line.get_label() == "neighbours differ as by noise of 2 nm"
    box = axes.get_legend().get_window_extent()
    y = axes.transData.transform((1.0, line.get_ydata()[0]))[1]
    assert not box.y0 <= y <= box.y1
