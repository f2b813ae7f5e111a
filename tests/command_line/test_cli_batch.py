"""Many scans: a bad one is named and never the end of the rest; done work is kept."""

import csv
import json
import shutil
import subprocess

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from capslip.cli import main


def scan(path, seed):
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:60, :80] * 1.0
    height = -5.0 + np.zeros((60, 80))
    for cx, cy in ((15, 15), (40, 40), (65, 20)):
        height = np.maximum(height, -((x - cx) ** 2 + (y - cy) ** 2) / 50)
    with h5py.File(path, "w") as file:
        file["height"] = height + rng.normal(0, 1e-3, height.shape)
        file["height"].attrs.update(unit="um", pixel_size=[50.0, 50.0], pixel_unit="um")


@pytest.fixture(scope="module")
def batch(tmp_path_factory):
    folder = tmp_path_factory.mktemp("batch")
    scans = folder / "scans in"
    scans.mkdir()
    scan(scans / "one.h5", 1)
    scan(scans / "two.h5", 2)
    (scans / "bad.x3p").write_bytes(b"PK\x03\x04 not really")
    np.save(scans / "one.npy", np.zeros((3, 3)))  # no unit, and the stem of another
    arguments = ["batch", str(scans), "-o", str(folder / "out"), "--no-figures", "--no-render"]
    first = CliRunner().invoke(main, arguments)
    return folder, arguments, first


def rows(folder):
    with (folder / "out" / "batch.csv").open() as file:
        return {row["scan"]: row for row in csv.DictReader(file)}


def test_every_scan_has_a_row(batch):
    folder, _, first = batch
    assert first.exit_code == 3, first.output
    table = rows(folder)
    assert set(table) == {"one.h5", "one.npy", "two", "bad"}
    assert table["bad"]["status"] == "failed"
    assert "bad.x3p" in table["bad"]["error"]
    assert "--unit" in table["one.npy"]["error"]
    assert table["two"]["status"] in ("ok", "check")
    assert float(table["two"]["peak_loss_factor"]) > 0
    assert "bad.x3p" in (folder / "out" / "index.html").read_text()


def test_done_work_is_kept_and_the_rest_done_again(batch):
    folder, arguments, _ = batch
    before = {
        path: path.stat().st_mtime_ns for path in (folder / "out" / "scans").glob("*/summary.json")
    }
    assert len(before) == 2
    old = rows(folder)
    assert CliRunner().invoke(main, arguments).exit_code == 3
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert rows(folder) == old
    # other settings are other work
    assert CliRunner().invoke(main, [*arguments, "--preload", "100"]).exit_code == 3
    assert all(path.stat().st_mtime_ns > time for path, time in before.items())
    assert rows(folder)["two"]["preload_N"] == "100.0"


def test_all_good_scans_end_with_code_0(batch, tmp_path):
    folder, arguments, _ = batch
    (tmp_path / "in").mkdir()
    shutil.copy(folder / "scans in" / "two.h5", tmp_path / "in")
    ran = CliRunner().invoke(
        main, ["batch", str(tmp_path / "in" / "*.h5"), "-o", str(tmp_path / "out"), *arguments[4:]]
    )
    assert ran.exit_code == 0, ran.output


def test_pictures_that_were_left_out_are_made_when_wanted(batch, tmp_path):
    folder, _, _ = batch
    (tmp_path / "in").mkdir()
    shutil.copy(folder / "scans in" / "two.h5", tmp_path / "in")
    source = ["batch", str(tmp_path / "in"), "-o", str(tmp_path / "out"), "--no-render"]
    assert CliRunner().invoke(main, [*source, "--no-figures"]).exit_code == 0
    summary = tmp_path / "out" / "scans" / "two" / "summary.json"
    assert CliRunner().invoke(main, source).exit_code == 0
    assert (summary.parent / "figures" / "height_map.png").is_file()
    written = summary.stat().st_mtime_ns
    assert CliRunner().invoke(main, [*source, "--no-figures"]).exit_code == 0
    assert summary.stat().st_mtime_ns == written


def test_an_analysis_that_fails_is_counted_and_keeps_its_numbers(batch, tmp_path):
    folder, arguments, _ = batch
    (tmp_path / "in").mkdir()
    shutil.copy(folder / "scans in" / "two.h5", tmp_path / "in")
    arguments = ["batch", str(tmp_path / "in"), "-o", str(tmp_path / "out"), *arguments[4:]]
    for _ in range(2):  # done, and found done
        ran = CliRunner().invoke(main, [*arguments, "--preload", "1e12"])
        assert ran.exit_code == 3
        assert "1 of 1 scans failed" in ran.stderr
        row = rows(tmp_path)["two"]
        assert row["status"] == "failed"
        assert row["caps"] == "3"
        assert "1e+12 N" in row["error"]
        assert row["folder"] == "scans/two"
        assert (tmp_path / "out" / "scans" / "two" / "summary.json").is_file()


def test_a_result_that_lacks_a_part_keeps_its_row_and_is_told(batch, tmp_path, monkeypatch):
    folder, arguments, _ = batch
    summary = (folder / "out" / "scans" / "two" / "summary.json").read_text()
    ended = subprocess.CompletedProcess([], 1, summary, "error: internal error: energy.png\n")
    monkeypatch.setattr("capslip.batch.subprocess.run", lambda *_, **__: ended)
    source = str(folder / "scans in" / "two.h5")
    ran = CliRunner().invoke(main, ["batch", source, "-o", str(tmp_path / "out"), *arguments[4:]])
    assert ran.exit_code == 1
    assert "1 of 1 results lack a part" in ran.stderr
    row = rows(tmp_path)["two"]
    assert row["status"] == json.loads(summary)["status"]
    assert row["error"] == "internal error: energy.png"
    assert float(row["peak_loss_factor"]) > 0
