"""The parts of a page, to the letter: each number under its head, each sentence where it holds."""

import json
import re
from dataclasses import fields, replace
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest
from output_cases import coarse, two_faces
from output_cases import several as several_of

from browser import ask, needs_chromium
from capslip.analysis import analyze_once
from capslip.caps.table import CapFlag, CapTable
from capslip.output import report
from capslip.output.figures import FIGURES, OF_JOINT
from capslip.output.methods import (
    OF_MAP,
    OF_YIELD,
    citation,
    conditioned,
    limits,
    methods_paragraph,
    references,
)
from capslip.output.quantity import engineering
from capslip.output.report import DASH, OF_SCANS, SCATTER, write_report
from capslip.output.terminal import result_lines
from capslip.problems import Problem
from capslip.result import JointOfScans
from capslip.settings import load_settings
from capslip.surface.heightmap import Origin

NBSP = "\u00a0"
SUMMARY = {
    "families": {"m": 4, "n": 9, "h_m": 2.4e-7},
    "contact": {
        "model": "caps",
        "contacts": 12,
        "approach_m": 5e-7,
        "approach_without_bulk_m": 3e-7,
        "first_loading_approach_m": 5e-7,
        "first_loading_approach_without_bulk_m": 3e-7,
        "scan_load_N": 150.0,
        "stiffness_N_per_m": 8e8,
        "bulk": False,
        "pressure_classes": 1,
        "hardness_Pa": None,
        "coverage": 1.0,
    },
    "slip": {"tangential_stiffness_N_per_m": 7e8, "total_slip_force_N": 30.0},
    "damping": {
        "structure": "beam",
        "peak_loss_factor": 0.04,
        "amplitude_at_peak_m": 2e-6,
        "first_peak_loss_factor": None,
        "amplitude_at_first_peak_m": None,
        "gross_slip_amplitude_m": 6e-6,
    },
    "hills": None,
    "scans": None,
    "assumed": [{"setting": "slip.normal_amplitude_ratio"}],
}


def changed(**tables):
    """Return the summary above with some numbers of its tables others."""
    return SUMMARY | {name: {**(SUMMARY[name] or {}), **of} for name, of in tables.items()}


def headlines(**tables):
    return report._headlines(changed(**tables))


def test_the_headlines():
    assert headlines() == [
        ("G-caps m, P-caps n", "4, 9", "families by peak height"),
        ("height difference h", "240 nm", "G-peaks above P-peaks"),
        ("normal approach", "300 nm", "without bulk; 500 nm with it"),
        ("caps in contact", "12", "the scan at 150 N, model caps"),
        ("normal stiffness", "800 MN/m", "one joint, without bulk"),
        ("tangential stiffness", "700 MN/m", "first loading, one joint"),
        ("greatest loss factor", "0.04", "beam, at an amplitude of 2 µm"),
        ("amplitude at gross slip", "6 µm", "of the beam; 30 N in one joint"),
    ]


@pytest.mark.parametrize(
    ("place", "tables", "line"),
    [
        (0, {"families": {"m": 7, "n": 0, "h_m": None}},
         ("caps of the one family", "7", "on its own plane; no gap h between their peaks")),
        (0, {"families": {"m": 0, "n": 0}}, ("G-caps m, P-caps n", "0, 0",
                                             "families by peak height")),
        (0, {"hills": {"caps": 13}}, ("G-caps m, P-caps n", "4, 9", "families by peak height")),
        (0, {"hills": {"caps": 12}}, ("G-caps m, P-caps n", "4, 9", "families by peak height, on "
                                      "their own plane; on the pressed plane 12")),
        (0, {"hills": {"caps": 12}, "families": {"m": 7, "n": 0, "h_m": None}},
         ("caps of the one family", "7",
          "on its own plane; on the pressed plane 12; no gap h between their peaks")),
        (2, {"contact": {"first_loading_approach_m": 9e-7,
                         "first_loading_approach_without_bulk_m": 7e-7}},
         ("approach on first loading", "700 nm", "without bulk; 900 nm with it; recovers 300 nm")),
        (2, {"contact": {"first_loading_approach_m": None,
                         "first_loading_approach_without_bulk_m": None}},
         ("recovery on unloading", "300 nm", "without bulk; 500 nm with it")),
        (3, {"contact": {"pressure_classes": 2}},
         ("caps in contact", "12", "the scan at 150 N, under the greatest pressure, model caps")),
        (3, {"contact": {"model": "flat"}}, ("caps in contact", "whole face",
                                             "the scan at 150 N, model flat")),
        (3, {"contact": {"model": None, "contacts": None}},
         ("caps in contact", DASH, "not available; see above")),
        (4, {"contact": {"bulk": True}},
         ("normal stiffness", "800 MN/m", "one joint, with bulk")),
        (6, {"damping": {"peak_loss_factor": None}},
         ("greatest loss factor", DASH, "not defined: the beam is no longer lightly damped")),
        (6, {"damping": {"peak_loss_factor": None, "amplitude_at_peak_m": None}},
         ("greatest loss factor", DASH, "not available; see above")),
        (6, {"damping": {"peak_loss_factor": 0.0}},
         ("greatest loss factor", "0", "no loss below gross slip")),
        (6, {"damping": {"first_peak_loss_factor": 0.03, "amplitude_at_first_peak_m": 9e-7}},
         ("greatest loss factor", "0.04",
          "beam, at an amplitude of 2 µm; a first maximum of 0.03 at 900 nm")),
    ],
)  # fmt: skip
def test_a_headline_says_what_its_number_is_of(place, tables, line):
    assert headlines(**tables)[place] == line


def test_a_joint_of_scans_has_no_headlines_of_a_face():
    none = {"families": dict.fromkeys(SUMMARY["families"]), "contact": {"model": None}}
    several = changed(**none) | {"scans": [1, 2]}
    labels = [label for label, _, _ in report._headlines(several)]
    assert labels[:2] == ["normal approach", "caps in contact"]
    assert len(headlines(**none)) == len(labels) + 2


@pytest.mark.parametrize(
    ("contact", "said", "unsaid"),
    [
        ({}, ["Contact model caps: ", "stiffness used does not hold the sinking",
              "no hardness was given"], ["stands for a larger joint", "GPa everywhere"]),
        ({"bulk": True}, ["stiffness used holds the sinking"], ["does not hold"]),
        ({"model": None}, ["no hardness"], ["Contact model", "sinking of the half-space"]),
        ({"hardness_Pa": 2.5e9}, ["softer face is taken as 2.5 GPa everywhere"],
         ["no hardness was given"]),
        ({"coverage": 0.98}, ["stands for a larger joint"], []),
        ({"coverage": 0.99}, [], ["stands for a larger joint"]),
        ({"coverage": None}, [], ["stands for a larger joint"]),
    ],
)  # fmt: skip
def test_what_the_numbers_leave_out_is_said_where_it_is_so(contact, said, unsaid):
    found = limits(changed(contact=contact))
    text = "\n".join(found)
    assert all(one in text for one in said)
    assert not any(one in text for one in unsaid)
    assert "Bureau" in found[0]
    assert found[-1].startswith("Only the loss in the joints is counted")


def test_no_text_calls_a_load_constant_that_oscillates(several, tmp_path):
    still = several.summary()
    moved = still | {"assumed": []}
    for summary, constant in ((still, True), (moved, False)):
        slip = next(one for one in limits(summary) if one.startswith("Slip follows"))
        assert ("a constant preload" in slip) == constant
        assert ("a normal load that oscillates" in slip) != constant
        assert ("by Masing's rule" in methods_paragraph(summary, several.settings)) == constant
        assert (
            "a normal load that oscillates" in methods_paragraph(summary, several.settings)
        ) != constant
        figures = report._figures(several, summary, tmp_path, None)
        captions = {one["name"]: one["caption"] for one in figures}
        assert ("constant preload" in captions["slip_loop"]) == constant
        assert ("first loading" in captions["slip_loop"]) == constant
        assert ("grows with the third power" in captions["energy"]) == constant
        assert captions["families"].startswith(FIGURES["families"].caption)


UNITS = {"nm": 1e-9, "µm": 1e-6, "mm": 1e-3, "m": 1.0, "mN": 1e-3, "N": 1.0, "kN": 1e3}


def caps(n=5):
    """Caps of which every column is other than every other one."""
    columns = {field.name: np.full(n, np.nan) for field in fields(CapTable)}
    scale_m = {"x_m": 3e-3, "y_m": 5e-3, "peak_height_m": 2e-7, "cap_height_m": 1e-7}
    scale_m |= {"residual_m": 3e-8, "diameter_m": 4e-4, "radius_m": 2.0, "contact_radius_m": 6e-5}
    for name, size_m in scale_m.items():
        columns[name] = size_m * (1.0 + 0.1 * np.arange(n))
    columns["load_N"] = np.array([0.0, 2.0, np.nan, 8.0, 0.0])
    columns["family"] = np.array(["G", "P", "", "G", "P"])
    columns["flags"] = np.zeros(n, np.uint16)
    columns["flags"][1] = CapFlag.edge
    return CapTable(**columns)


HEADS = {
    "x": "x_m",
    "y": "y_m",
    "peak height": "peak_height_m",
    "df": "cap_height_m",
    "rms residual": "residual_m",
    "D": "diameter_m",
    "R": "radius_m",
    "load": "load_N",
    "contact radius": "contact_radius_m",
}


def test_every_number_of_the_table_of_caps_is_of_its_head_and_unit():
    of, found = caps(), report._cap_rows(caps())
    assert (found["total"], found["more"]) == (5, 0)
    assert [row[0] for row in found["rows"]] == ["4", "2", "5", "1", "3"]  # by load, by height
    at = np.array([3, 1, 4, 0, 2])
    for head, *cells in zip(found["heads"], *found["rows"], strict=False):
        label, _, unit = head.partition(" [")
        if label in HEADS:
            values = [np.nan if one == DASH else float(one) for one in cells]
            expected = getattr(of, HEADS[label])[at]
            seen = np.array(values) * UNITS[unit.rstrip("]")]
            assert seen == pytest.approx(expected, rel=1e-3, nan_ok=True), head
        elif label == "family":
            assert cells == ["G", "P", "P", "G", ""]
    assert [head.partition(" [")[0] for head in found["heads"]] == ["cap", "family", *HEADS]
    assert [row[-1] for row in found["rows"]] == ["", "edge", "", "", ""]


def test_the_table_of_caps_goes_by_what_the_hills_bear_where_the_map_was_pressed():
    of, hill_N = caps(), np.array([3.0, 0.0, 1.0, 0.5, 7.0])
    found = report._cap_rows(of, hill_N)
    assert [row[0] for row in found["rows"]] == ["5", "1", "3", "4", "2"]
    assert found["by"] == "by what their hills bear of the pressed map"
    at = found["heads"].index("load on the hill [N]")
    assert [float(row[at]) for row in found["rows"]] == [7.0, 3.0, 1.0, 0.5, 0.0]
    assert report._cap_rows(of)["by"] == "by load"
    bare = of.with_columns(load_N=np.full(len(of), np.nan))
    assert report._cap_rows(bare)["by"] == "by height: nothing was pressed"


def test_the_row_of_a_scan_holds_its_own_numbers():
    of = {
        "name": "left",
        "status": "check",
        "share": 0.25,
        "sq_m": 3e-7,
        "caps": 17,
        "model": "boundary_elements",
        "contacts": 11,
        "max_pressure_Pa": 2e9,
        "estimated_error": 0.034,
        "answer": {"tangential_stiffness_N_per_m": 7e8, "energy_J": 4e-9},
    }
    none = of | dict.fromkeys(("share", "model", "estimated_error", "max_pressure_Pa"))
    none["answer"] = dict.fromkeys(of["answer"])
    surface = SimpleNamespace(height_m=np.arange(12.0).reshape(3, 4))
    scan = SimpleNamespace(conditioned=SimpleNamespace(surface=surface))
    found, empty = report._scan_rows((scan, scan), {"scans": [of, none]})
    assert (found["name"], found["status"]) == ("left", "check")
    cells = ["25 %", "300 nm", "17", "11 in boundary elements", "2 GPa", "700 MN/m", "4 nJ"]
    assert found["cells"] == [one.replace(" ", NBSP, 1) for one in [*cells, "3.4 %"]]
    assert found["numbers"] == (0.25, 3e-7, 17, 11, 2e9, 7e8, 4e-9, 0.034)
    assert empty["cells"] == [DASH, f"300{NBSP}nm", "17", *[DASH] * 5]
    assert found["stamp"].startswith("data:image/png;base64,iVBOR")


def test_the_tables_of_a_face(several):
    summary = several.summary()
    summary["surface"] |= {"shape": [200, 300], "pixel_size_m": [1e-4, 2e-4], "path": None}
    summary["hills"] |= {"rejected": {"too_few_points": 3, "no_sphere": 2}, "hills": 9, "caps": 7}
    summary["families"]["P"] = None
    of = dict(zip(("count", "radius_m", "diameter_m"), (3, 12.0, 5e-4), strict=True))
    summary["families"]["G"] |= of | {"height_m": 2e-7, "peak_height_m": 7e-7}
    summary["timings_s"] = {"read": 0.25, "hills": 3.0}
    tables = {title: dict(rows) for title, rows in report._tables(summary)}
    face = tables["Height map"]
    assert face["file"] == "given as an array"
    assert (face["points"], face["pixel"]) == ("300 x 200 (x, y)", "200 µm x 100 µm")
    assert face["face"] == "60 mm x 20 mm"
    hills = tables["Hills and families"]
    assert (hills["hills"], hills["rejected"]) == (
        "9, 7 of them with a sphere",
        "3 too few points, 2 no sphere",
    )
    of_one = "3: mean R 12 m, D 500 µm, df 200 nm, peak height 700 nm"
    assert hills["caps of the one family, on its own plane"] == of_one
    assert not any("G-caps" in label or "P-caps" in label for label in hills)
    summary["families"] |= {"m": 3, "n": 4, "P": summary["families"]["G"]}
    both = dict(dict(report._tables(summary))["Hills and families"])
    assert (both["G-caps"], both["P-caps"]) == (of_one, of_one)  # 7 caps on either plane
    assert tables["Time"] == {"read": "250 ms", "hills": "3 s"}
    assert tables["Provenance"]["settings sha256"] == several.settings.sha256()
    assert tables["Provenance"]["command"] == DASH
    contact = tables["Contact, slip and damping"]
    assert contact["load of the scan"] == "150 N"
    slip = summary["slip"]
    assert contact["friction coefficient"] == "0.2"
    assert contact["gross slip, one joint"].startswith(f"{slip['total_slip_force_N']:.3g} N at ")


def test_the_load_of_the_scan_in_the_table_is_named_for_what_it_is(several):
    """Beside a preload of the joint that is less, of which the scan is all."""
    summary = several.summary()
    summary["contact"] |= {"pressure_classes": 2}
    tables = {title: dict(rows) for title, rows in report._tables(summary)}
    assert tables["Contact, slip and damping"]["load of the scan"] == (
        "150 N, under the greatest pressure"
    )


def test_a_picture_that_is_missing_says_why(several, tmp_path):
    told = Problem("output_missing", "warning", "energy.png could not be drawn: no ink")
    broken = replace(several, problems=(told,), sensitivity=None)
    found = report._figures(broken, several.summary(), tmp_path, "no OpenGL")
    by_name = {one["name"]: one for one in found}
    assert list(by_name) == [*list(FIGURES)[:2], "scene", *list(FIGURES)[2:]]
    assert by_name["energy"]["missing"] == told.message
    assert by_name["scene"]["missing"] == "Reason: no OpenGL."
    for name in set(FIGURES) - {"energy"}:
        assert by_name[name]["missing"].startswith(f"It needs {FIGURES[name].needs}"), name
        assert by_name[name]["title"] == FIGURES[name].title
    assert {one["data"] for one in found} == {None}
    silent = report._figures(broken, several.summary(), tmp_path, None)
    assert silent[2]["missing"] == "Reason: the renderer left no picture."
    assert set(OF_JOINT) <= set(FIGURES)


@pytest.mark.parametrize(
    ("name", "model", "said"),
    [
        ("families", "boundary_elements", True),
        ("scene", "boundary_elements", True),
        ("energy", "boundary_elements", False),
        ("families", "caps", False),
        ("families", None, False),
    ],
)
def test_pictures_of_caps_say_where_these_do_not_answer(name, model, said, several, tmp_path):
    summary = several.summary()
    summary["contact"]["model"] = model
    found = {one["name"]: one for one in report._figures(several, summary, tmp_path, None)}
    assert ("no answer is theirs" in found[name]["caption"]) == said


def test_the_panel_on_the_page_is_the_one_that_was_found(several, tmp_path):
    panel = {"of_caps": True, "numbers": [1.5, None]}
    page = write_report(several, several.summary(), tmp_path, None, panel).read_text("utf-8")
    (text,) = re.findall(r'id="whatif-data">(.*?)</script>', page)
    assert json.loads(text) == panel


@pytest.mark.parametrize("known", [True, False])
def test_the_panel_says_whether_the_error_of_other_preloads_is_known(known, several, tmp_path):
    panel = {"of_caps": True, "error_known": known}
    text = write_report(several, several.summary(), tmp_path, None, panel).read_text("utf-8")
    assert ("it is left out." in text) == known
    assert ("how far they may be off is not known." in text) == (not known)


def test_figures_of_several_scans_say_what_lies_between_these(several, tmp_path):
    of = {"settings": several.settings, "joint": several.joint, "problems": (), "scans": ()}
    joint = JointOfScans(**of, timings_s={}, started="now")
    found = report._figures(joint, several.summary(), tmp_path, None)
    assert [one["name"] for one in found] == list(OF_JOINT)
    for one in found:
        entry = FIGURES[one["name"]]
        good = SCATTER if one["name"] in OF_SCANS else entry.good
        assert one["caption"] == f"{entry.caption} {good}"
    assert set(OF_SCANS) < set(OF_JOINT)


@needs_chromium
def test_a_long_setting_in_the_verdict_stays_on_a_narrow_page(several, tmp_path):
    step = "--set conditioning.s_filter_nesting_index_m_of_the_other_face=9.5e-06"
    summary = several.summary() | {"verdict": f"usable with care: too fine; next: {step}"}
    page = write_report(several, summary, tmp_path, None)
    wide = ask(page, "return document.documentElement.scrollWidth", tmp_path, (400, 900))
    assert wide <= 400


def test_what_is_to_be_pasted_is_under_its_head(several, tmp_path):
    summary = several.summary()
    page = write_report(several, summary, tmp_path, None).read_text("utf-8")
    page = unescape(page).replace(NBSP, " ")
    after = page.partition("Methods, to paste")[2]
    marks = [
        methods_paragraph(summary, several.settings)[:60],
        *references(summary),
        citation(summary)[:40],
    ]
    marks.append("preload_N = 150.0")
    places = [after.index(one) for one in marks]
    assert places == sorted(places)


def test_the_paragraph_of_methods_gives_the_error_at_the_force_asked_for(several):
    summary = several.summary()
    summary["accuracy"]["estimated"] = 1.01
    most = "to within 101 % from a tenth of gross slip on"
    said = methods_paragraph(summary, several.settings, 0.083)
    assert said.endswith(f"are estimated to within 8.3 % at the force asked for ({most}).")
    for same in (None, 1.01):
        said = methods_paragraph(summary, several.settings, same)
        assert said.endswith(f"are estimated {most}.")


def test_the_paper_of_the_solver_is_named_where_a_map_was_pressed_and_of_yield_where_it_yields():
    def found(model, hardness_Pa):
        return references({"contact": {"model": model, "hardness_Pa": hardness_Pa}})

    of_caps, of_map = found("interacting", None), found("boundary_elements", None)
    assert [one for one in of_map if one not in of_caps] == list(OF_MAP)
    assert [one for one in found("interacting", 1e9) if one not in of_caps] == list(OF_YIELD)
    assert set(found("boundary_elements", 1e9)) == {*of_caps, *OF_MAP, *OF_YIELD}
    assert found(None, None) == of_caps


REGIONS = "Hills above the cut are its connected regions (eight neighbours), not pruned, and 5 sph"
WATERSHED = "were separated by a watershed, where those that rise by less than "
FILTER = "taken off by an areal Gaussian filter (ISO 16610-61) with a nesting index of"


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (("hills.separation=regions",), [REGIONS]),
        ((), [WATERSHED, "nm (from the map) above", "the form removed was none. Hills"]),
        (("hills.pruning_height_m=3e-9",), [WATERSHED + "3 nm (given) above"]),
        (("hills.pruning_percent_Sz=5.0",), [WATERSHED, "(5 % of Sz) above"]),
        (
            ("conditioning.s_filter_nesting_index_m=2e-3",),
            [f"none; short waves were {FILTER} 2 mm. H"],
        ),
        (
            ("conditioning.l_filter_nesting_index_m=1.5e-2",),
            [f"none; long waves were {FILTER} 15 mm."],
        ),
        (
            ("conditioning.edge_trim_m=7e-4",),
            ["; 2 columns and 2 rows were cut off at each edge; the"],
        ),
        (("conditioning.resample_to=[45, 70]",), ["; heights were resampled to 70 x 45 points."]),
        (
            ("conditioning.form=polynomial", "conditioning.form_degree=3"),
            ["polynomial of degree 3."],
        ),
        (("conditioning.form=plane", "conditioning.form_robust=true"), ["plane, fitted robustly."]),
        (("conditioning.form=plane", "conditioning.form_floor=true"), ["to the lowest third."]),
    ],
)
def test_methods_say_what_was_done_to_the_map_and_nothing_else(overrides, said):
    surface = coarse(several_of().surface, 4)
    surface = replace(surface, height_m=np.where(np.isnan(surface.height_m), 0.0, surface.height_m))
    settings = load_settings(
        overrides=(
            "contact.preload_N=150",
            "contact.model=caps",
            "conditioning.form=none",
            "conditioning.outliers=none",
            *overrides,
        )
    )
    text = methods_paragraph(analyze_once(surface, settings).summary(), settings)
    assert "A scan of 75 x 50 points at 400 µm x 400 µm was analysed with capslip" in text
    assert all(one in text for one in said)
    for one in (REGIONS[:40], WATERSHED, "short waves", "long waves", "cut off at", "resampled"):
        assert (one in text) == (
            any(one in other for other in said) or (one == WATERSHED and REGIONS not in said)
        )
    assert not any(
        one in text for one in ("its mate", "second", "both", "outliers", "filled", "tops")
    )


def test_methods_name_the_steps_that_the_map_itself_called_for():
    steps = [
        {"step": "edge_trim", "points": [3, 5]},
        {"step": "tops", "points": 9, "restored": 2, "left": 1},
        {"step": "rounding", "step_m": 1e-9, "error_m": 1e-10, "smoothed": True},
        {"step": "outliers", "rule": "isolated", "removed": 7},
        {"step": "filling", "points": 12},
        {"step": "level", "tilt_rad": [0.0, 0.0]},
    ]
    said = [
        "5 columns and 3 rows were cut off at each edge",
        "2 tops that the range of the sensor had cut off were put back",
        "stored steps of 1 nm were smoothed",
        "7 points were removed as outliers",
        "12 points between measured ones were filled",
    ]
    assert conditioned(steps) == "; ".join(said)
    steps[1]["restored"], steps[2]["smoothed"], steps[3]["removed"] = 0, False, 0
    assert conditioned(steps) == f"{said[0]}; {said[4]}"


@pytest.mark.long
@pytest.mark.parametrize("align", ["given", "least_squares"])
@pytest.mark.parametrize("way", ["composite", "together"])
def test_methods_of_two_faces_name_the_second_and_what_was_made_of_both(way, align):
    first, settings = two_faces().surface, two_faces().settings
    second = replace(first, height_m=first.height_m[::-1, ::-1], origin=Origin(name="other.x3p"))
    settings = load_settings(
        overrides=(
            *("contact.preload_N=150", "contact.model=caps", "conditioning.form=none"),
            *(f"mating.way={way}", f"mating.align={align}", "mating.offset_m=[1e-3, 2e-3]"),
            *("mating.rotation_rad=0.01", "conditioning.s_filter_nesting_index_m=2e-3"),
        )
    )
    analysis = analyze_once(first, settings, second)
    text = methods_paragraph(analysis.summary(), settings)
    assert "A scan of 75 x 50 points at 400 µm x 400 µm was analysed with its mate" in text
    assert (
        f"Of the second scan, other.x3p: the form removed was none; short waves were {FILTER}"
        in text
    )
    given = "mirrored in x, turned by 0.573 degrees and shifted by 2 mm along x and 1 mm along y;"
    assert (given in text) == (align == "given")
    assert ("where the sum of both varies least" in text) == (align == "least_squares")
    assert ("the heights of both were added" in text) == (way == "composite")
    assert ("the caps of both were counted" in text) == (way == "together")
    assert ("spherical caps of both faces were fitted" in text) == (way == "together")
    assert ("(from the map, of the first)" in text) == (way == "together")


@pytest.mark.parametrize(
    ("way", "whose"),
    [("composite", "of the sum of both faces"), ("together", "of the first face")],
)
def test_page_and_terminal_of_two_faces_name_both_and_whose_heights_are_told(way, whose, tmp_path):
    first, settings = two_faces().surface, two_faces().settings
    at = Origin("one.x3p", "/scans/{one}.x3p", "abc")
    first = replace(first, origin=at)
    height_m = 2.0 * first.height_m[::-1, ::-1]
    second = replace(first, height_m=height_m, origin=Origin("other.x3p", "/scans/other.x3p", "de"))
    settings = load_settings(
        overrides=("contact.preload_N=150", "contact.model=caps", f"mating.way={way}")
    )
    analysis = analyze_once(first, settings, second)
    summary = analysis.summary()
    page = write_report(analysis, summary, tmp_path, None).read_text("utf-8")
    assert "<h1>one.x3p with its mate other.x3p</h1>" in page
    assert "<title>one.x3p with its mate other.x3p – capslip report</title>" in page
    assert "From scans of both faces of a joint to their damping" in page
    assert "From a scan" not in page
    tables = dict(report._tables(summary))
    face = dict(tables["Height map"])
    assert face["file"] == "/scans/{one}.x3p; its mate /scans/other.x3p"
    assert (face["SHA-256"], face["SHA-256 of its mate"]) == ("abc", "de")
    (step,) = (one for one in summary["surface"]["steps"] if one["step"] == "mating")
    each = [engineering(one_m, "m") for one_m in step["sq_of_faces_m"]]
    sq = engineering(analysis.conditioned.sq_m, "m")
    assert len({*each, sq}) == (3 if way == "composite" else 2)
    assert (face[f"Sq {whose}"], face["Sq of each face"]) == (sq, " and ".join(each))
    assert {"Sq", "Sz"}.isdisjoint(face)
    assert f"Surface parameters after ISO 25178-2 {whose}" in tables
    said = f"{whose}: with its mate other.x3p, Sq of each {', '.join(each)}\n"
    lines = result_lines(analysis)
    assert said.replace("µ", "u") in lines
    assert lines.index("; Sq ") < lines.index(whose)
    alone = analyze_once(first, settings)
    page = write_report(alone, alone.summary(), tmp_path, None).read_text("utf-8")
    assert "<h1>one.x3p</h1>" in page
    assert "From a scan of a joint face to its damping" in page
    face = dict(dict(report._tables(alone.summary()))["Height map"])
    assert (face["file"], face["Sq"]) == (at.path, engineering(alone.conditioned.sq_m, "m"))
    assert "its mate" not in result_lines(alone)
