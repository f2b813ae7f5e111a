"""The report in a real browser: the what-if panel equals Python, and the page holds together."""

import json
import re

import numpy as np
import output_cases
import pytest

from browser import CHROMIUM, ask_each, needs_chromium, picture, together
from capslip.analysis import analyze_once
from capslip.contact.slip import slip_curve
from capslip.output.report import write_report
from capslip.output.tables import write_result
from capslip.output.whatif import whatif_data
from capslip.settings import Question, load_settings
from capslip.structure.answer import answer_to
from capslip.structure.response import response
from scenes import caps_map


def pressed_map():
    surface = caps_map(
        [(3e-3, 3e-3, 2.0, 0.0), (9e-3, 3e-3, 2.0, -2e-8)],
        shape=(120, 240),
        pixel_size_m=(5e-5, 5e-5),
    )
    given = ("contact.model=boundary_elements", "contact.preload_N=4", "conditioning.form=none")
    joint = ("contact.alignment=as_levelled", "joint.area_m2=2e-4")
    return analyze_once(surface, load_settings(overrides=(*given, *joint)))


def interacting_caps():
    settings = output_cases.SETTINGS
    import msgspec

    contact = msgspec.structs.replace(settings.contact, model="interacting")
    return analyze_once(
        output_cases.several().surface, msgspec.structs.replace(settings, contact=contact)
    )


CASES = {"caps": output_cases.several, "interacting": interacting_caps, "map": pressed_map}
# Pages of caps look alike, whether they interact or not
either_look = pytest.mark.parametrize("case", ["caps", "map"], indirect=True, scope="module")


@pytest.fixture(scope="module", params=CASES)
def case(request, tmp_path_factory):
    analysis, folder = CASES[request.param](), tmp_path_factory.mktemp(request.param)
    write_result(analysis, folder)
    if request.param != "interacting":  # whose page nobody looks at
        (folder / "figures").mkdir()
        output_cases.write_figures(analysis, folder / "figures")
    return analysis, write_report(analysis, analysis.summary(), folder, "not rendered")


def states(analysis, tables, n=60):
    rng = np.random.default_rng(102)
    for _ in range(n):
        table = int(rng.integers(len(tables)))
        friction = float(rng.uniform(0.05, 0.8))
        K_m, K_s = (float(10 ** rng.uniform(6, 9)) for _ in range(2))
        share = float(10 ** rng.uniform(-4, 0))
        gross_m = friction * tables[table]["preload_N"] / K_s
        joints = int(rng.integers(1, 5))
        yield {
            "table": table,
            "friction": friction,
            "K_m": K_m,
            "K_s": K_s,
            "n": joints,
            "amplitude": share * gross_m,
        }


FRAMES = """const field = window.capslipWhatIf.inputs.friction;
        const text = () => document.querySelector("#whatif tbody").innerText;
        const give = (mu) => { field.value = mu; field.dispatchEvent(new Event("input")); };
        const before = text(), from = performance.now();
        for (let i = 0; i < 20; i++) give(0.2 + 0.01 * i);
        const took = (performance.now() - from) / 20, after = text();
        give(0.001);
        return [took, before, after, text()];"""
NO_NUMBERS = """const panel = window.capslipWhatIf, names = ["friction", "K_m", "K_s", "n"];
        const text = () => document.querySelector("#whatif tbody").innerText;
        const give = (name, text) => {
          const field = panel.inputs[name];
          field.value = text;
          for (const what of ["input", "change"]) field.dispatchEvent(new Event(what));
          return +field.value;
        };
        const was = names.map((name) => +panel.inputs[name].value), before = text();
        const now = names.map((name) => ["0", "-1", ""].map((one) => give(name, one)));
        const after = text(), kept = now.map((row, i) => row.every((one) => one === was[i]));
        return [kept, [give("n", "2.6"), panel.state.n], before, after];"""
GUESSES = """const panel = window.capslipWhatIf, at = (share) => {
          panel.inputs.share.value = Math.log10(share);
          panel.inputs.share.dispatchEvent(new Event("input"));
          return document.querySelector("#whatif tbody").innerText;
        };
        return [at(0.9), at(0.002)];"""
SORTED = """const table = document.querySelector("table.sorts");
        const head = table.tHead.rows[0].cells[0];
        head.querySelector("button").click(); head.querySelector("button").click();
        const rows = [...table.tBodies[0].rows].map((row) => +row.cells[0].textContent);
        return [head.getAttribute("aria-sort"), rows];"""
WORDS = """const one = window.capslipWhatIf, field = one.inputs.K_m, shown = +field.value;
        const loss = one.answer(one.state).loss;
        field.value = 2 * shown; field.dispatchEvent(new Event("input"));
        const words = document.querySelector("canvas.eta").getAttribute("aria-label");
        return [shown, loss, one.answer(one.state).loss, words];"""
WIDTH = "return document.documentElement.scrollWidth"


@pytest.fixture(scope="module")
def asked(case, tmp_path_factory):
    """Ask a page all at once."""
    analysis, page = case
    tables, slip = whatif_data(analysis)["tables"], analysis.slip
    given, tip_m = list(states(analysis, tables)), 0.6 * float(slip.total_slip_displacement_m)
    at_rest = f"""const panel = window.capslipWhatIf;
        return [{json.dumps(given)}.map(panel.answer),
                panel.loop({len(tables) - 1}, {slip.friction_coefficient}, {tip_m}, 41)];"""
    # What changes no field of the panel shares a page
    reads = {"at_rest": at_rest, "wide": WIDTH, "sorted": SORTED}
    scripts = {"reads": together(reads), "frames": FRAMES, "guesses": GUESSES}
    if (page.parent / "figures").is_dir():  # else nobody looks at the rest
        scripts |= {"no_numbers": NO_NUMBERS, "words": WORDS, "narrow": (WIDTH, 420)}
    found = ask_each(page, scripts, tmp_path_factory.mktemp("asked"))
    found |= found["reads"]
    answers, loop = found["at_rest"]
    return found | {"states": given, "answers": answers, "tip_m": tip_m, "loop": loop}


@pytest.mark.long
@needs_chromium
def test_panel_equals_python_to_a_millionth(case, asked):
    analysis, _ = case
    tables = whatif_data(analysis)["tables"]
    for state, one in zip(asked["states"], asked["answers"], strict=True):
        preload_N = tables[state["table"]]["preload_N"]
        kappa = analysis.slip.kappa
        slip = slip_curve(analysis.slip.curve, preload_N, state["friction"], kappa)
        damping = response(slip, state["K_m"], state["K_s"], state["n"])
        exact, _ = answer_to(Question(amplitude_m=state["amplitude"]), slip, damping)
        close = {"rel": 1e-6, "abs": 0.0}
        assert one["force"] == pytest.approx(exact.slip_force_N, **close)
        assert one["displacement"] == pytest.approx(exact.displacement_m, **close)
        assert one["energy"] == pytest.approx(exact.energy_J, **close)
        assert one["stiffness"] == pytest.approx(exact.tangential_stiffness_N_per_m, **close)
        assert one["joint_loss"] == pytest.approx(exact.joint_loss_factor, **close)
        assert one["shift"] == pytest.approx(exact.frequency_shift, rel=1e-6, abs=1e-9)
        for name, value in (("loss", exact.loss_factor), ("total_loss", exact.total_loss_factor)):
            assert one[name] == (None if value is None else pytest.approx(value, **close))
        if exact.loss_factor:
            assert one["total_loss"] < one["loss"]


@pytest.mark.long
@needs_chromium
def test_loop_of_the_panel_is_that_of_the_slip_curve(case, asked):
    analysis, _ = case
    tip_m, found = asked["tip_m"], np.array(asked["loop"])
    delta_m, force_N = analysis.slip.loop(tip_m, 41)
    np.testing.assert_allclose(found[:, 0], delta_m, atol=1e-12 * tip_m)
    np.testing.assert_allclose(found[:, 1], force_N, atol=1e-6 * force_N.max())


@pytest.mark.long
@needs_chromium
def test_panel_answers_within_a_frame_and_follows_its_inputs(asked):
    took_ms, before, after, beyond = asked["frames"]
    assert took_ms < 16.0
    assert before != after
    assert "Energy W lost per cycle" in after
    assert "as a decay shows it" in after
    assert "beyond gross slip" in beyond


@pytest.mark.long
@either_look
@needs_chromium
def test_what_is_no_number_above_0_is_not_taken_and_does_not_stay_in_its_field(asked):
    kept, joints, before, after = asked["no_numbers"]
    assert kept == [True] * 4
    assert joints == [3, 3]
    assert before == after


@pytest.mark.long
@needs_chromium
def test_what_the_pixels_do_not_resolve_is_called_a_guess(case, asked):
    analysis, _ = case
    unresolved = whatif_data(analysis)["unresolved"]
    above, below = asked["guesses"]
    assert "a guess" not in above
    assert ("a guess" in below) == (unresolved > 0.002)


@pytest.mark.long
@either_look
@needs_chromium
def test_report_fits_its_width_and_has_no_fault(asked):
    assert asked["wide"] <= 1400
    assert asked["narrow"] <= 420


@pytest.mark.long
@either_look
@needs_chromium
def test_columns_of_the_caps_sort(case, asked):
    analysis, _ = case
    column = asked["sorted"]
    assert column == ["ascending", list(range(1, len(analysis.caps) + 1))]


@pytest.mark.long
@either_look
@needs_chromium
def test_report_is_dark_where_the_reader_wants_it(case, tmp_path):
    _, page = case
    dark = ("--blink-settings=preferredColorScheme=0",)
    assert picture(page, tmp_path, flags=dark)[:, :20].mean() < 60.0
    assert picture(page, tmp_path)[:, :20].mean() > 240.0


@pytest.mark.long
@either_look
@needs_chromium
def test_print_holds_every_figure_and_leaves_no_page_half_empty(case, tmp_path):
    import subprocess

    _, page = case
    pdf = tmp_path / "report.pdf"
    flags = ("--no-sandbox", "--no-pdf-header-footer", f"--print-to-pdf={pdf}")
    subprocess.run([CHROMIUM, *flags, page.as_uri()], capture_output=True, timeout=120, check=True)
    pages = len(re.findall(rb"/Type\s*/Page\b", pdf.read_bytes()))
    assert 2 <= pages <= 10


@pytest.mark.long
def test_report_is_small(case):
    _, page = case
    assert page.stat().st_size < 4e6


@pytest.mark.long
@either_look
@needs_chromium
def test_fields_and_small_numbers_of_the_panel_can_be_read(case, asked):
    analysis, _ = case
    modal_N_per_m = analysis.damping.modal_stiffness_N_per_m
    shown, loss, other_loss, words = asked["words"]
    assert shown * 1e6 == pytest.approx(modal_N_per_m, rel=1e-5)
    assert other_loss == pytest.approx(loss / 2.0, rel=1e-5)
    assert "·10⁻" in words
    assert "0.0000" not in words
