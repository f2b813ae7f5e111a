"""Several scans of one joint on disk: the answer first, each scan, its curves and its exports."""

import csv
import errno
import json
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

import capslip
from browser import ask, needs_chromium
from capslip.analysis import analyze_scans
from capslip.contact.rung import ModelError
from capslip.output import report, staging
from capslip.output.figures import FIGURES, OF_JOINT
from capslip.output.folder import write_joint
from capslip.output.report import write_report
from capslip.structure.interpolation import LawTables
from scenes import caps_map

AS_IT_LIES = "contact.alignment=as_levelled"  # few caps carry no plane that turns
HIGH = [(6e-3, 5e-3, 10.0, 0.0), (22e-3, 13e-3, 10.0, 1e-8)]
LOW = [(14e-3, 6e-3, 4.0, 0.0), (24e-3, 5e-3, 4.0, 0.0)]


@pytest.fixture(scope="module")
def joint():
    settings = capslip.load_settings(
        overrides=("joint.area_m2=0.01", "contact.model=caps", "contact.preload_N=500", AS_IT_LIES)
    )
    return analyze_scans([caps_map(HIGH), caps_map([*HIGH, *LOW])], settings)


@pytest.mark.long
def test_the_page_has_the_answer_each_scan_and_every_figure_of_the_joint(joint, tmp_path):
    summary = write_joint(joint, tmp_path / "a", None)
    page = (tmp_path / "a" / "report.html").read_text("utf-8")
    assert [p["code"] for p in summary["problems"] if p["code"] == "output_missing"] == []
    assert page.index('id="answer"') < page.index('id="scans"') < page.index('id="figures"')
    assert page.count('alt="The heights of ') == 2
    for name in FIGURES:
        assert (f'<figure id="{name}">' in page) == (name in OF_JOINT)
    assert 'id="whatif"' in page
    assert "2 scans of one joint were analysed" in page
    assert 'href="#caps"' not in page


def test_on_a_full_disk_the_numbers_of_the_joint_are_kept(joint, tmp_path, monkeypatch):
    def full(work):
        assert (work / "report.html").is_file()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(staging, "check_room", full)
    no_figures = structs.replace(joint.settings.run, figures=False)
    light = replace(joint, settings=structs.replace(joint.settings, run=no_figures))
    summary = write_joint(light, tmp_path / "a", None)
    assert {one.name for one in (tmp_path / "a").iterdir()} == {"settings.toml", "summary.json"}
    (missing,) = (p["message"] for p in summary["problems"] if p["code"] == "output_missing")
    assert missing.startswith("report.html gave way")


def test_the_hardness_of_the_scans_is_said_and_no_row_is_empty(joint, tmp_path):
    given = structs.replace(joint.settings.material, hardness_Pa=2.5e9)
    yielding = replace(joint, settings=structs.replace(joint.settings, material=given))
    for one, hardness_Pa in ((joint, None), (yielding, 2.5e9)):
        summary = one.summary()
        assert summary["contact"]["hardness_Pa"] == hardness_Pa
        page = write_report(one, summary, tmp_path, None).read_text("utf-8")
        assert ("no hardness was given" in page) == (hardness_Pa is None)
        assert ("softer face is taken as 2.5 GPa" in page) == (hardness_Pa is not None)
        (rows,) = (facts for title, facts in report._tables(summary) if title.startswith("Contact"))
        labels = [label for label, _ in rows]
        assert "contact model" not in labels
        assert ("hardness" in labels) == (hardness_Pa is not None)
        assert {"friction coefficient", "gross slip, one joint", "joints"} <= set(labels)


def test_an_error_of_more_than_all_is_said_in_full(joint, tmp_path):
    summary = joint.summary()
    for scan, error in zip(summary["scans"], (1.049, 0.052), strict=True):
        scan["estimated_error"] = error
    page = write_report(joint, summary, tmp_path, None).read_text("utf-8").replace("\u00a0", " ")
    assert ">105 %</td>" in page
    assert ">5.2 %</td>" in page


@needs_chromium
def test_the_scans_sort_by_their_numbers_and_the_rest_of_the_page_answers(joint, tmp_path):
    summary = joint.summary()
    one, other = of = summary["scans"]
    one |= {"name": "one", "estimated_error": None}
    other |= {"name": "other", "estimated_error": 0.1}
    one["answer"]["energy_J"], other["answer"]["energy_J"] = 1e-6, 9e-7
    heads, orders, copied, closed = ask(
        write_report(joint, summary, tmp_path, None),
        """const table = document.querySelector("table.sorts"), orders = {};
        const heads = [...table.tHead.rows[0].cells], names = () =>
            [...table.tBodies[0].rows].map((row) => row.cells[1].textContent);
        for (const head of heads.slice(1)) {
            const button = head.querySelector("button");
            button.click();
            orders[head.textContent] = [names()];
            button.click();
            orders[head.textContent].push(names());
        }
        let copied = "";
        const clipboard = { writeText: (text) => copied = text };
        Object.defineProperty(navigator, "clipboard", { value: clipboard });
        document.querySelector("button.copy").click();
        dispatchEvent(new Event("beforeprint"));
        const closed = [...document.querySelectorAll("details")].filter((fold) => !fold.open);
        return [heads.map((head) => head.textContent), orders, copied, closed.length];""",
        tmp_path,
    )
    assert heads[0] == "face"
    assert len(orders) == 10
    assert "capslip" in copied
    assert closed == 0
    assert orders["model error"] == 2 * [["other", "one"]]  # what is not known comes last
    for head, key in {
        "Sq": lambda one: one["sq_m"],
        "caps": lambda one: one["caps"],
        "in contact": lambda one: one["contacts"],
        "peak pressure": lambda one: one["max_pressure_Pa"],
        "stiffness (secant)": lambda one: one["answer"]["tangential_stiffness_N_per_m"],
        "energy per cycle": lambda one: one["answer"]["energy_J"],
    }.items():
        growing = [one["name"] for one in sorted(of, key=key)]
        assert orders[head] == [growing[::-1], growing], head


@pytest.mark.parametrize("name", ["slip_loop", "energy"])
def test_grey_holds_the_joint_and_ends_at_its_scans(joint, name):
    axes = FIGURES[name].draw(joint).axes[0]
    grey = next(one for one in axes.collections if one.get_label().startswith("between"))
    corners = grey.get_paths()[0].vertices
    line = next(one for one in axes.lines if one.get_label() in ("first loading", "W"))
    x, y = line.get_data()
    for at in (30, 60, 100):
        of_x = np.isclose(corners[:, 0], x[at], rtol=1e-12)
        low, high = corners[of_x, 1].min(), corners[of_x, 1].max()
        assert low < y[at] < high
        # Each scan stands for half of the joint
        assert y[at] == pytest.approx(0.5 * (low + high), rel=1e-9)


@pytest.mark.long
def test_exports_are_of_the_joint_and_go_with_the_next_result(joint, tmp_path):
    folder = tmp_path / "a"
    write_joint(joint, folder, None, export="law")
    law, area_m2 = LawTables.read(folder / "law.json"), joint.settings.joint.area_m2
    at = {"displacement_m": 2e-8, "pressure_Pa": 500.0 / area_m2}
    expected = float(joint.slip.force_N(2e-8)) / area_m2
    assert float(law.shear_Pa(**at)) == pytest.approx(expected, rel=0.02)
    assert "law.json" in json.loads((folder / "summary.json").read_text())["outputs"]
    write_joint(joint, folder, None, export="jenkins")
    assert not (folder / "law.json").exists()
    with (folder / "jenkins.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    assert len(rows) > 3


def test_a_scan_stands_for_its_share_of_what_was_scanned_with_an_answer(joint):
    one, other = joint.scans
    thrice_m2 = 3.0 * other.joint.scan_area_m2
    wider = replace(one, joint=replace(one.joint, scan_area_m2=thrice_m2))
    without = replace(one, slip=None)
    found = replace(joint, scans=(wider, without, other))
    shares = [scan["share"] for scan in found.summary()["scans"]]
    assert shares == [pytest.approx(0.75), None, pytest.approx(0.25)]
    assert [part.share for part in found.parts] == pytest.approx([0.75, 0.25])


def test_the_error_of_a_joint_is_the_greatest_of_its_scans_where_each_is_known(joint):
    def of(*errors, without=()):
        scans = [
            replace(scan, contact=replace(scan.contact, errors=ModelError.of_either(error)))
            for scan, error in zip(2 * joint.scans, errors, strict=False)
        ]
        return replace(joint, scans=(*scans, *without)).estimated_error

    assert of(0.02, 0.05, 0.01) == 0.05
    assert of(0.02, None) is None
    assert of(None, None) is None
    assert of(0.02, without=[replace(joint.scans[0], slip=None)]) == 0.02  # no part of the joint
