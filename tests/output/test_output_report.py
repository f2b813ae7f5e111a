"""Report: complete, self-contained, honest about what is missing."""

import base64
import io
import json
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import output_cases
import pytest
from PIL import Image

from capslip.analysis import analyze_families
from capslip.output import report
from capslip.output.figures import FIGURES
from capslip.output.lead import answer_lines
from capslip.output.quantity import engineering
from capslip.output.report import MAX_ROWS, _data, write_report
from capslip.problems import Effect, Problem
from capslip.settings import load_settings
from capslip.surface.heightmap import Origin


class Page(HTMLParser):
    """Tags with their attributes, and the visible text."""

    def __init__(self, path):
        super().__init__()
        self.tags, self.text, self.hidden = [], "", 0
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self.hidden += tag in ("style", "script")

    def handle_endtag(self, tag):
        self.hidden -= tag in ("style", "script")

    def handle_data(self, data):
        self.text += "" if self.hidden else data.replace("\u00a0", " ")

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def page(several, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    (folder / "figures").mkdir()
    output_cases.write_figures(several, folder / "figures")
    return Page(write_report(several, several.summary(), folder, "no OpenGL here"))


@pytest.mark.long
def test_report_needs_nothing_from_elsewhere(page):
    assert not page.all("link")
    addresses = [a[key] for _, a in page.tags for key in ("src", "href") if key in a]
    assert addresses
    within = ("data:image/png;base64,", "data:image/jpeg;base64,", "#")
    assert all(address.startswith(within) for address in addresses)
    assert "url(" not in page.source
    assert "http" not in page.source


@pytest.mark.long
def test_report_shows_every_figure_with_title_and_text(page, several):
    images = page.all("img")
    assert len(images) == len(FIGURES)
    said = {name: image["alt"] for name, image in zip(FIGURES, images, strict=True)}
    assert "h = 2" in said["families"]  # the values, not the title
    assert engineering(several.contact.stiffness_N_per_m, "N/m") in said["normal_curve"]
    assert page.all("html")[0]["lang"] == "en"
    assert "<title>" in page.source
    for entry in FIGURES.values():
        assert f"{entry.caption} {entry.good}" in page.text


@pytest.mark.long
def test_missing_picture_is_said(page):
    assert "no OpenGL here" in page.text


def test_report_without_caps_says_what_is_missing(none, tmp_path):
    (tmp_path / "figures").mkdir()
    drawn = output_cases.write_figures(none, tmp_path / "figures")
    page = Page(write_report(none, none.summary(), tmp_path, None))
    assert len(page.all("img")) == len(drawn)
    assert page.text.count("not shown") == len(FIGURES) - len(drawn) + 1  # and the scene
    assert "No cap was found" in page.text
    assert "nan" not in page.text.lower().replace("provenance", "")
    assert "None" not in page.text


def test_report_without_figures_says_they_are_off(several, tmp_path):
    analysis = replace(several, settings=load_settings(overrides=("run.figures=false",)))
    page = Page(write_report(analysis, analysis.summary(), tmp_path, "switched off"))
    assert page.text.count("switched off") == len(FIGURES) + 1


@pytest.mark.long
def test_report_says_the_numbers_of_the_summary(page, several):
    assert f"status {several.status}." in page.text
    assert f"{several.families.m}, {several.families.n}" in page.text
    assert f"{several.damping.peak_loss_factor:.3g}" in page.text
    assert f"{several.families.h_m * 1e9:.3g}\u00a0nm" in page.source
    assert "Bureau" in page.text
    assert several.settings.sha256() in page.text
    assert "preload_N = 150.0" in page.text


@pytest.mark.parametrize("bulk", [True, False])
def test_report_says_whether_the_bulk_is_in_the_stiffness(several, tmp_path, bulk):
    summary = several.summary()
    summary["contact"]["bulk"] = bulk
    page = Page(write_report(several, summary, tmp_path, None))
    assert f"one joint, {'with' if bulk else 'without'} bulk" in page.text
    assert ("does not hold the sinking" in page.text) is not bulk


def test_report_counts_contacts_only_where_there_are_some_to_count(several, tmp_path):
    summary = several.summary()
    contacts = f"<b>{summary['contact']['contacts']}</b>"
    assert contacts in Page(write_report(several, summary, tmp_path, None)).source
    summary["contact"]["model"] = "flat"
    page = Page(write_report(several, summary, tmp_path, None))
    assert "<b>whole face</b>" in page.source
    assert contacts not in page.source


def test_caps_without_load_follow_by_height(several, tmp_path):
    caps = several.caps.with_columns(load_N=np.full(len(several.caps), np.nan))
    page = Page(write_report(replace(several, caps=caps), several.summary(), tmp_path, None))
    body = page.source.split('class="sorts"')[1].split("<tbody>")[1].split("</tbody>")[0]
    shown = [int(row.split("</td>")[0]) - 1 for row in body.split("<tr><td>")[1:]]
    heights_m = several.caps.peak_height_m[shown]
    assert len(shown) == len(caps)
    assert (np.diff(heights_m) <= 0).all()


def test_what_a_file_says_cannot_break_the_page(several, tmp_path):
    nasty = '<script>alert("1")</script> & co'
    surface = replace(several.surface, origin=Origin(name=nasty))
    problems = (
        Problem("one_family", "info", nasty),
        Problem("contact_failed", "error", "5 < 6 & 7"),
    )
    analysis = replace(several, surface=surface, problems=problems)
    page = Page(write_report(analysis, analysis.summary(), tmp_path, nasty))
    assert "<script>alert" not in page.source
    assert page.text.count(nasty) >= 3
    assert page.text.index("contact_failed") < page.text.index("one_family")


def test_no_text_ends_the_data_of_the_panel(several, tmp_path):
    panel = {"of_caps": False, "structure": "a <!--<script> b </script>"}
    source = write_report(several, several.summary(), tmp_path, None, panel).read_text("utf-8")
    data = source.split('id="whatif-data">')[1].split("</script>")[0]
    assert "<" not in data
    assert json.loads(data) == panel


def test_long_table_is_cut_and_says_so(several, tmp_path):
    n = MAX_ROWS + 57
    rows = np.resize(np.arange(len(several.caps)), n)
    columns = {name: getattr(several.caps, name)[rows] for name in vars(several.caps)}
    columns["load_N"] = np.arange(n, dtype=float)
    analysis, panel = (
        replace(several, caps=several.caps.with_columns(**columns)),
        {"of_caps": False},
    )
    page = Page(write_report(analysis, several.summary(), tmp_path, None, panel))
    assert f"The first {MAX_ROWS} of {n} caps" in page.text
    assert "57 more are in caps.csv" in page.text
    body = page.source.split('class="sorts"')[1].split("<tbody>")[1].split("</tbody>")[0]
    assert body.count("<tr>") == MAX_ROWS
    assert body.startswith(f"\n<tr><td>{n}</td>")


def test_all_causes_come_first_errors_before_what_moves_most(several, tmp_path):
    def moving(code, message, energy):
        return Problem(code, "warning", message, Effect(0.01, energy, None))

    problems = (
        Problem("one_family", "info", "only a note"),
        moving("outliers", "moves little", 0.02),
        moving("spikes", "moves most", 3.0),
        moving("clipped", "moves some", 0.1),
        Problem("contact_failed", "error", "nothing holds at 2.82e-07 m"),
    )
    analysis = replace(several, problems=problems)
    page = Page(write_report(analysis, analysis.summary(), tmp_path, None))
    body = page.source.split('<ol class="causes">')[1].split("</ol>")[0].replace("\u00a0", " ")
    assert body.count("<li>") == 4
    assert (
        body.index("nothing holds at 282 nm")
        < body.index("moves most")
        < body.index("moves some")
        < body.index("moves little")
    )
    assert "moves the stiffness by 1 %, the energy by 300 %" in body
    assert body.count("Next: ") == 4
    assert "only a note" not in body
    assert page.text.index("moves some") < page.text.index("only a note")
    far = replace(several, problems=(moving("spikes", "moves", 108.9),))
    page = Page(write_report(far, far.summary(), tmp_path, None))
    assert "the energy by a factor of 110" in page.source


@pytest.mark.long
def test_answer_comes_before_everything_else(page, several):
    order = ["Answer", "Assumed, not given", "What limits it", "Figures", "Caps", "Problems"]
    places = [page.source.index("Verdict:")]
    places += [page.source.index(f">{words}</h2>") for words in order]
    assert places == sorted(places)
    assert several.settings.sha256()[:12] in page.text.split("Methods, to paste")[1]


@pytest.mark.long
def test_every_head_of_a_table_says_what_it_heads(page):
    heads = page.all("th")
    assert heads
    assert all(head.get("scope") in ("row", "col") for head in heads)


def test_a_heavy_picture_is_packed_and_still_the_same(tmp_path):
    rough = np.random.default_rng(4).integers(0, 255, (25, 40, 3), dtype=np.uint8)
    rough = rough.repeat(16, axis=0).repeat(16, axis=1)
    for name, pixels in (("heavy", rough), ("light", rough[:5])):
        Image.fromarray(pixels).save(tmp_path / f"{name}.png", compress_level=0)
        kind, _, text = _data(tmp_path / f"{name}.png").partition(";base64,")
        assert kind == f"data:image/{'jpeg' if name == 'heavy' else 'png'}"
        with Image.open(io.BytesIO(base64.b64decode(text))) as picture:
            seen = np.asarray(picture.convert("RGB"))
        assert seen.shape == pixels.shape
        assert np.abs(seen.astype(float) - pixels).mean() < (2.0 if name == "heavy" else 1e-9)


def test_quantities_have_one_spelling_of_their_prefix_and_numbers_of_options_stay_whole():
    text = "a bow of 1.2 um; next: --set conditioning.x_m=1.7e-05, or --amplitude 2nm"
    assert report._options(text) == [
        *[("a bow of 1.2\u00a0µm; next: ", False), ("--set", True), (" conditioning.x_m=", False)],
        *[("1.7e-05", True), (", or ", False), ("--amplitude", True), (" 2nm", False)],
    ]
    assert report._written("stored in um, 3 um and 4 uN/x of 2 umbrellas") == (
        "stored in um, 3\u00a0µm and 4 µN/x of 2 umbrellas"
    )


@pytest.mark.parametrize(
    "text", ["94.66 GN/m", "23 %", "3.6 kN", "15.6 cm²", "2 MPa", "5 m", "0.3 s", "40 mm"]
)
def test_no_line_of_the_page_parts_a_number_from_its_unit(text):
    assert report._written(f"as {text}, or so") == f"as {text.replace(' ', chr(0xA0))}, or so"
    assert report._written(f"{text}x") == f"{text}x"


def test_an_answer_without_an_interval_says_why():
    families = [f"families.{one}" for one in ("m=3", "n=2", "radius_G_m=24", "radius_P_m=26")]
    settings = load_settings(overrides=(*families, "families.h_m=1e-7"))
    found = analyze_families(settings)
    (said,) = (text for _, text in answer_lines(found.summary(), "-") if "interval" in text)
    assert said.startswith("no interval: ")
    assert "the error of the model is not known, and no spread was given" in said
    known = found.summary() | {"accuracy": {"estimated": 0.01}}
    (other,) = (text for _, text in answer_lines(known, "-") if "interval" in text)
    assert ("cannot carry each preload" in other) == ("not known" in said)
