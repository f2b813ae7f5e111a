"""The tables of real scans hold what the analysis says, and leave out what is no scan."""

import json

import numpy as np
import pytest

from capslip.studies.real_scans import HEAD, real_scans
from scenes import caps_map

CAPS = [(0.003, 0.004, 20.0, 0.0), (0.012, 0.015, 25.0, 2e-8), (0.024, 0.006, 22.0, 1e-8)]
AS_METRES = ("reading.unit='m'", "reading.lateral_unit='m'", "reading.pixel_size=[2e-4,2e-4]")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scans")
    face = caps_map(CAPS, shape=(100, 150), pixel_size_m=(2e-4, 2e-4)).height_m
    np.save(folder / "face.npy", face)
    (folder / "README.md").write_text("no scan")
    (folder / "below").mkdir()
    (folder / "oracle.json").write_text(json.dumps({"no": "scan"}))
    return real_scans(folder, (*AS_METRES, "contact.model='families'", "contact.preload_N=50"))


def test_one_row_a_scan_and_none_for_other_files(page):
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    assert [row.split("`")[1] for row in rows] == ["face.npy"]


def test_a_row_says_what_the_analysis_says(page):
    row = next(line for line in page.splitlines() if line.startswith("| `"))
    cells = dict(zip(HEAD, [cell.strip() for cell in row.strip("|").split("|")], strict=True))
    assert cells["points"] == "150 x 100"
    assert cells["side [mm]"] == "30 x 20"
    assert cells["caps"] == cells["contacts"] == "3"
    least, most = cells["stiffness [MN/m]"].split("(")[1].strip(")").split(" to ")
    assert float(least) <= float(cells["stiffness [MN/m]"].split()[0]) <= float(most)


def test_every_warning_stands_below_the_verdict(page):
    row = next(line for line in page.splitlines() if line.startswith("| `"))
    count = int(row.strip("|").split("|")[HEAD.index("warnings")])
    assert page.count("\n- `") == count > 0
    assert "\n`face.npy`: " in page


def test_a_scan_without_an_answer_is_named(tmp_path):
    np.save(tmp_path / "flat.npy", np.zeros((30, 30)))
    assert "`flat.npy`" in real_scans(tmp_path, AS_METRES)
