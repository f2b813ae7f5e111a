"""The page of many scans in a real browser: what it shows, finds and sorts.

Without a browser on this machine the page itself is not looked at, and the tests say that they were
left out.
"""

import base64
import io
import json
import re
from functools import cache

import h5py
import numpy as np
import output_cases
import pytest

from browser import ask, ask_each, needs_chromium, picture, together
from capslip.output import overview
from capslip.output.overview import COLUMNS, error_of, row_of, write_overview
from capslip.output.tables import write_result
from capslip.output.thumbnail import COLOURS, RAMP, thumbnail

MANY = 10_000
PLANE = ("m on the families' own plane", "n on the families' own plane")
NASTY = 'bad </script><img src=x onerror="boom()">'


def failed(name, error="not a map; export it again"):
    return dict.fromkeys(COLUMNS) | {"scan": name, "status": "failed", "error": error}


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """Two results, one of them without families, and a scan that failed."""
    folder = tmp_path_factory.mktemp("batch")
    rows = []
    for name, analysis in (("several", output_cases.several()), ("one", output_cases.one())):
        home = folder / "scans" / name
        home.mkdir(parents=True)
        write_result(analysis, home)
        rows.append(row_of(analysis.summary()) | {"scan": name, "folder": f"scans/{name}"})
    (folder / "scans" / "several" / "report.html").touch()
    rows.append(failed(NASTY))
    write_overview(rows, folder)
    return folder, rows


def test_the_error_of_a_row_is_the_first_or_else_what_is_missing_and_no_warning():
    def problem(code, severity, message):
        return {"code": code, "severity": severity, "message": message}

    warned = problem("bow_left", "warning", "a bow")
    missing = problem("output_missing", "warning", "no caps.vtu")
    errors = [problem("no_caps", "error", "no caps"), problem("tips_over", "error", "it tips")]
    for problems, said in (
        ([warned], None),
        ([], None),
        ([warned, missing], "no caps.vtu"),
        ([missing, warned, *errors], "no caps"),
    ):
        assert error_of({"problems": problems}) == said


def data_of(folder):
    text = (folder / "index.html").read_text("utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])


@pytest.fixture(scope="module")
def many(tmp_path_factory, real):
    """Ten thousand rows, each with curves and a stamp, as the two results have them."""
    return page_of(MANY, tmp_path_factory.mktemp("many"), real)


@pytest.fixture(scope="module")
def some(tmp_path_factory, real):
    """More rows than a window shows."""
    return page_of(100, tmp_path_factory.mktemp("some"), real)


def page_of(n_rows, folder, real):
    source, rows = real
    (folder / "scans").symlink_to(source / "scans")
    rng = np.random.default_rng(1)
    found = []
    for i in range(n_rows):
        row = dict(rows[i % 2]) if i % 50 else failed("")
        row["scan"] = f"scan {i:05d}"
        if i % 50:
            row["tangential_stiffness_N_per_m"] = float(rng.lognormal(16.0, 1.0))
            row["status"] = "check" if i % 3 else "ok"
        found.append(row)
    with pytest.MonkeyPatch.context() as patch:  # two files are read, not ten thousand
        patch.setattr(overview, "_pictured", cache(overview._pictured))
        write_overview(found, folder)
    return folder / "index.html", found


def test_curves_and_stamps_are_those_of_the_results(real):
    folder, _ = real
    first = data_of(folder)["rows"][0]
    with h5py.File(folder / "scans" / "several" / "result.h5") as file:
        force_N, energy_J = file["slip/force_N"][:], file["slip/energy_J"][:]
    curve = np.array(first[7][1], dtype=float).reshape(2, -1)
    x, y = 10.0 ** (curve / 1000.0)
    np.testing.assert_allclose(x[[0, -1]], force_N[[0, -1]], rtol=2e-3)
    np.testing.assert_allclose(np.interp(x, force_N, energy_J), y, rtol=1e-2)
    assert base64.b64decode(first[8])[1:4] == b"PNG"


def test_a_row_leads_to_the_report_or_to_the_folder_that_has_none(real):
    folder, _ = real
    links = [row[4] for row in data_of(folder)["rows"]]
    assert links == ["scans/several/report.html", "scans/one", ""]


def test_causes_have_what_was_measured_first(real):
    _, rows = real
    summary = output_cases.several().summary()
    effect = {"tangential_stiffness": 0.2, "energy": None, "loss_factor": 0.4}
    problems = [
        {"code": "bow_left", "severity": "warning", "message": "a", "effect": None},
        {"code": "detail_decides", "severity": "warning", "message": "b", "effect": effect},
        {"code": "yielded", "severity": "info", "message": "c", "effect": None},
    ]
    row = row_of(summary | {"problems": problems})
    moved = "moves the stiffness by 20 %, the loss factor by 40 %"
    assert row["causes"] == [["warning", "detail_decides", moved], ["warning", "bow_left", ""]]
    assert set(rows[0]) - set(COLUMNS) == {"causes"}


def test_a_lost_result_keeps_its_row(real, tmp_path):
    _, rows = real
    write_overview([rows[0]], tmp_path)  # whose folder is not there
    row = data_of(tmp_path)["rows"][0]
    assert row[7:] == [[[], []], ""]
    assert row[5][0] == rows[0]["caps"]


def test_a_stamp_shows_heights_upwards_and_what_is_not_measured():
    from matplotlib import colormaps
    from PIL import Image

    height_m = np.broadcast_to(np.linspace(0.0, 1.0, 200)[:, None], (200, 300)).copy()
    height_m[:100, :150] = np.nan  # low y, low x
    with Image.open(io.BytesIO(thumbnail(height_m))) as image:
        level = np.asarray(image)
    assert level.shape == (40, 60)
    assert (level[20:, :30] == 0).all()  # the lower left
    assert (level[:, 30:] > 0).all()
    assert (np.diff(level[:, 45].astype(int)) <= 0).all()  # it falls downwards
    assert len(thumbnail(np.random.default_rng(0).normal(size=(900, 900)))) < 2000
    assert thumbnail(np.full((5, 5), np.nan))[1:4] == b"PNG"
    shades = 255 * colormaps["viridis"](np.linspace(0.0, 1.0, COLOURS))[:, :3]
    assert shades.astype(np.uint8).tobytes() == RAMP


def test_titles_say_that_caps_and_families_are_counted_on_two_planes(real):
    folder, _ = real
    page = (folder / "index.html").read_text("utf-8")
    at = [page.index(f'["{title}",') for title in ("caps on the map", *PLANE)]
    assert at == sorted(at)


@needs_chromium
def test_page_shows_every_scan_with_what_it_says(real, tmp_path):
    folder, rows = real
    found = ask(
        folder / "index.html",
        "return [[...document.querySelectorAll('#rows tr')].map((row) =>"
        "row.textContent.replace('</', '[')),"
        "[...document.querySelectorAll('#strip button')].map((one) => one.textContent),"
        "document.querySelectorAll('#rows img').length,"
        "document.querySelector('#rows a').getAttribute('href')]",
        tmp_path,
    )
    assert NASTY.replace("</", "[") in found[0][2]  # as text
    assert "export it again" in found[0][2]
    counted = dict.fromkeys(("ok", "check", "failed"), 0)
    for row in rows:
        counted[row["status"]] += 1
    assert found[1] == [f"{n} {status}" for status, n in counted.items() if n]
    assert found[2] == 2
    assert found[3] == "scans/several/report.html"


@needs_chromium
def test_long_names_and_paths_break_between_words(tmp_path):
    name = "plate_30x60mm_missing27percent-of-the-second_measurement.of_2026-11-23"
    error = f"/measured/joints/{name}.csv: zero bytes; expected a scan"
    write_overview([failed(name, error)], tmp_path)
    found = ask(
        tmp_path / "index.html",
        """const range = document.createRange(), lines = (one) => {
             range.selectNodeContents(one); return range.getClientRects().length; };
           return [...document.querySelectorAll('td.scan b, td.why div')].map((one) => [
             one.textContent, new Set([...one.childNodes].map((piece) => {
               range.selectNodeContents(piece);
               return range.getBoundingClientRect().top; })).size,
             ...[...one.childNodes].filter((piece) =>
               piece.textContent && !piece.textContent.includes(" ")).map(lines)])""",
        tmp_path,
    )
    assert [text for text, *_ in found] == [name, error]
    for _, n_tops, *pieces in found:
        assert n_tops > 1
        assert len(pieces) > 5
        assert set(pieces) == {1}


@pytest.fixture(scope="module")
def sides(some, tmp_path_factory):
    asked = "return [document.documentElement.scrollWidth, innerWidth]"
    return ask_each(
        some[0], {wide: (asked, wide) for wide in (420, 1400)}, tmp_path_factory.mktemp("sides")
    )


@pytest.mark.long
@needs_chromium
@pytest.mark.parametrize("width", [420, 1400])
def test_page_fits_and_draws(width, some, sides, tmp_path):
    page, _ = some
    assert sides[width][0] <= sides[width][1] == width
    dark = ("--blink-settings=preferredColorScheme=0",)
    light, night = (picture(page, tmp_path, size=(width, 900), flags=more) for more in ((), dark))
    blue = (light[..., 2] - light[..., 0] > 60).mean()
    assert blue > 0.01  # curves and bars
    assert light.mean() > 180.0 > 100.0 > night.mean()


ROWS = """
    const lines = () => [...document.querySelectorAll("#rows tr")];
    const first = () => lines()[0].querySelector(".scan").firstChild.textContent;
    const press = (text) => [...document.querySelectorAll("button")].find((one) =>
        one.textContent.includes(text)).click();
    const made = lines().length, said = [];
    for (const text of ["tangential stiffness", "tangential stiffness", " failed", " failed"]) {
        press(text);
        said.push([first(), document.getElementById("shown").textContent]);
    }
    document.getElementById("more").click();
    const grown = lines().length;
    return { made, grown, said };"""
FIND = """
    const find = document.getElementById("find");
    find.value = "00042";
    window.setTimeout = (what) => what();
    find.dispatchEvent(new Event("input"));
    const shown = [...document.querySelectorAll("#rows tr .scan")];
    return shown.map((one) => one.firstChild.textContent);
    """


@pytest.fixture(scope="module")
def asked(many, tmp_path_factory):
    """Ask the page of ten thousand rows all at once: it takes seconds to load."""
    scripts = together({"rows": ROWS, "find": FIND})
    return ask(many[0], scripts, tmp_path_factory.mktemp("asked"))


@pytest.mark.long
@needs_chromium
def test_ten_thousand_rows_are_filtered_and_sorted_and_few_are_made(many, asked):
    page, rows = many
    assert page.stat().st_size < 20e6
    found = asked["rows"]
    assert found["made"] <= 300  # of ten thousand; more as they are scrolled to
    assert found["grown"] > 100
    with_number = [row for row in rows if row["tangential_stiffness_N_per_m"] is not None]
    by = sorted(with_number, key=lambda row: row["tangential_stiffness_N_per_m"])
    everything, failures = f"{MANY} of {MANY}", sum(row["status"] == "failed" for row in rows)
    assert found["said"][0] == [by[-1]["scan"], everything]
    assert found["said"][1] == [by[0]["scan"], everything]
    assert found["said"][2][1] == f"{failures} of {MANY}"
    assert found["said"][3][1] == everything


@pytest.mark.long
@needs_chromium
def test_words_that_are_looked_for_leave_the_scans_that_have_them(many, asked):
    assert asked["find"] == [many[1][42]["scan"]]


@needs_chromium
def test_numbers_are_rounded_once_and_medians_are_of_all_scans(tmp_path):
    energies_J = [-3e-9, 0.0, 1e-9, 2.4494e-9, 8e-9, None]
    names = ["b", "d", "a", "f", "c", "e"]
    rows = [
        dict.fromkeys(COLUMNS) | {"scan": name, "status": "ok", "answer_energy_J": energy_J}
        for name, energy_J in zip(names, energies_J, strict=True)
    ]
    for row, N in zip(rows, [1234.6, 1235.4, 1224.96, 1234.96, 1235.04, 0.5], strict=True):
        row["preload_N"] = N
    rows[0]["caps"] = rows[1]["caps"] = 0
    write_overview(rows, tmp_path)
    script = """
    const head = (text) => [...document.querySelectorAll("#heads button")].find((one) =>
        one.textContent.includes(text));
    const names = () => [...document.querySelectorAll("#rows .scan")].map((one) =>
        one.firstChild.textContent);
    const cells = [...document.querySelectorAll('#rows [data-label^="preload"]')];
    const orders = [names()];
    for (let i = 0; i < 2; i++) {
        head("scan").click();
        orders.push([document.querySelector("[aria-sort]").getAttribute("aria-sort"), ...names()]);
    }
    return { cells: cells.map((one) => one.textContent), orders,
        said: [...document.querySelectorAll("#spread figcaption")].map((one) => one.textContent),
        told: [...document.querySelectorAll("#spread canvas")].map((one) => one.ariaLabel) };"""
    found = ask(tmp_path / "index.html", script, tmp_path)
    assert found["cells"] == ["1230", "1240", "1220", "1230", "1240", "0.5"]
    assert found["orders"] == [
        names,
        ["ascending", *sorted(names)],
        ["descending", *sorted(names, reverse=True)],
    ]
    (energy,) = (one for one in found["said"] if "energy" in one)
    assert energy.endswith("median 1; 2 of 5 at zero or below are not drawn")
    (energy,) = (one for one in found["told"] if "energy" in one)
    assert "of 5 scans: -3 to 8 nJ, median 1 nJ; 2 of 5 at" in energy
    (caps,) = (one for one in found["said"] if one.startswith("caps"))
    assert caps.endswith("median 0; 2 of 2 at zero or below are not drawn")


@needs_chromium
def test_counts_are_written_whole(tmp_path):
    counts = [1234, 98765, 12_345_678]
    rows = [
        dict.fromkeys(COLUMNS)
        | {"scan": str(caps), "status": "ok", "caps": caps, "m": 7, "n": 1001}
        for caps in counts
    ]
    write_overview(rows, tmp_path)
    script = """
    const texts = (one) => [...document.querySelectorAll(one)].map((cell) => cell.textContent);
    return { cells: texts("#rows .number"), said: texts("#spread figcaption"),
        told: [...document.querySelectorAll("#spread canvas")].map((one) => one.ariaLabel) };"""
    found = ask(tmp_path / "index.html", script, tmp_path)
    assert [cell for cell in found["cells"] if cell] == [
        *("1234", "7", "1001", "98765", "7", "1001", "12345678", "7", "1001")
    ]
    (caps,) = (one for one in found["said"] if one.startswith("caps"))
    assert caps.endswith("median 98765")
    assert any("of 3 scans: 1234 to 12345678" in one for one in found["told"])


@needs_chromium
def test_failed_scans_are_left_out_of_medians_and_curves_and_counted(real, tmp_path):
    source, rows = real
    (tmp_path / "scans").symlink_to(source / "scans")
    energies_J = [1e-9, 2e-9, 3e-9, *[1e-6] * 4]
    statuses = ["check", "ok", "ok", *["failed"] * 4]
    found = [
        rows[0] | {"scan": status, "status": status, "answer_energy_J": energy_J}
        for status, energy_J in zip(statuses, energies_J, strict=True)
    ]
    write_overview([*found, failed("without a number")], tmp_path)
    script = """
    const said = () => [document.getElementById("curve-note").textContent,
        [...document.querySelectorAll("#spread figcaption")].find((one) =>
            one.textContent.includes("energy")).textContent];
    const all = said();
    [...document.querySelectorAll("#strip button")].find((one) =>
        one.textContent.includes("check")).click();
    return [...all, ...said()];"""
    curves, energy, of_kept, energy_of_kept = ask(tmp_path / "index.html", script, tmp_path)
    assert curves.startswith("3 of 8 scans")
    assert curves.endswith(" 4 failed, left out.")
    assert energy.endswith("median 2; 4 failed left out")
    assert of_kept.startswith("1 of 1 scans")
    assert energy_of_kept.endswith("median 1")
    assert "failed" not in of_kept + energy_of_kept
