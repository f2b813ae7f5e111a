"""The benchmark's bookkeeping; what it measures is not tested."""

import cProfile
import json
import pstats
import sys
import time
from dataclasses import asdict

import h5py
import numpy as np
import pytest

from capslip.analysis import analyze
from capslip.errors import CapslipError, OutputError
from capslip.output.folder import write
from capslip.output.picture import Look
from capslip.output.scene import save_picture
from capslip.output.view import read_view
from capslip.settings import load_settings
from capslip.studies.bench import fleet, study, timings
from capslip.surface.readers import load_surface
from capslip.surface.readers.hdf5 import write_hdf5


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(study, "SHAPE", (160, 240))
    monkeypatch.setattr(study, "REPEATS", 2)
    monkeypatch.setattr(study, "N_SETS", 50)
    monkeypatch.setattr(study, "FINER", 2)
    monkeypatch.setattr(study, "STUDIES", {"of one stage": lambda: "| scene | ms |\n"})
    monkeypatch.setattr(timings, "_run", lambda command, until="": (0.1, 0.4, 0.2))
    monkeypatch.setattr(timings, "_peak_bytes", lambda command: 700_000_000)


def test_files_and_rows(small, tmp_path):
    result = study.run_bench(tmp_path / "new" / "folder")
    written = json.loads((tmp_path / "new" / "folder" / "bench.json").read_text(encoding="utf-8"))
    assert written["timings"] == result["timings"]
    page = (tmp_path / "new" / "folder" / "bench.md").read_text(encoding="utf-8")
    assert page == study.bench_markdown(written)
    rows = result["timings"]
    assert {row["group"] for row in rows} == {"command", "stage", "contact"}
    for row in rows:
        assert 0 < row["least_s"] <= row["median_s"] <= row["greatest_s"]
    peer = next(row for row in rows if row["by"].startswith("scipy lstsq"))
    own = next(row for row in rows if row["what"] == peer["what"])
    assert own["by"] == "capslip"
    assert peer["ratio"] == pytest.approx(peer["median_s"] / own["median_s"])
    large = next(row for row in rows if row["what"].startswith("inspect"))
    assert "480 x 320 points" in large["what"]
    assert not large["missed"]
    assert "| 0.2 s | 0.7 GB | < 5 s, < 2 GB |" in page
    assert "## of one stage\n\n| scene | ms |\n" in page
    assert result["machine"]["numpy"] in page


@pytest.mark.long
def test_a_large_result_is_one_of_its_map_and_is_drawn(small, tmp_path):
    scan, out = tmp_path / "face.h5", tmp_path / "large"
    write_hdf5(study._face(), scan)
    (row,) = timings.inspect_large(scan, out, 5, 1)
    assert row.what == "inspect, 1200 x 800 points: a picture"
    save_picture(out, tmp_path / "seen.png", Look())  # what is timed
    view = read_view(out)
    assert (view.shape, view.side_m) == ((800, 1200), pytest.approx((0.04, 0.06)))
    apex = view.columns["y_m"] / view.pixel_size_m[0], view.columns["x_m"] / view.pixel_size_m[1]
    with h5py.File(out / "result.h5") as file:
        label = file["hills/labels"][:][tuple(np.array(apex, dtype=int))]
    assert len(view.cap) > 3
    assert (label == view.cap + 1).mean() > 0.8  # an apex may lie beside a hill with noise


@pytest.mark.parametrize(
    ("seconds", "held_bytes", "missed"),
    [(4.9, 1.9e9, False), (5.1, 0.1e9, True), (0.1, 2.1e9, True)],
)
def test_a_goal_that_is_missed_is_marked(seconds, held_bytes, missed):
    goals = {"goal_s": 5.0, "peak_bytes": int(held_bytes), "goal_bytes": 2e9}
    row = timings.Timing("command", "", "capslip", seconds, seconds, seconds, None, 1.0, **goals)
    assert row.missed is missed
    assert ("(missed)" in study._goal(asdict(row) | {"missed": row.missed})) is missed


def test_the_memory_is_that_of_the_command_not_of_who_asks():
    mine = np.ones(60_000_000)  # 480 MB
    few, many = (
        timings._peak_bytes([sys.executable, "-c", f"held = b'1' * {n}"]) for n in (1, 200_000_000)
    )
    assert few < 60e6 < mine.nbytes
    assert many - few == pytest.approx(200e6, rel=0.05)
    # of a process that the command starts, too
    starts = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]])"
    held = "held = b'1' * 200_000_000"
    assert timings._peak_bytes([sys.executable, "-c", starts, held]) > 190e6
    with pytest.raises(CapslipError, match="exit code 3"):
        timings._peak_bytes([sys.executable, "-c", "raise SystemExit(3)"])


def test_clock_of_a_command():
    code = "import time; print('status ok', flush=True); time.sleep(0.2); print('end')"
    seen_s, end_s, worked_s = timings._run([sys.executable, "-c", code], "status")
    assert seen_s > 0
    assert end_s - seen_s > 0.15
    assert worked_s > 0


@pytest.mark.parametrize("code", ["raise SystemExit(3)", "print('nothing of the kind')"])
def test_a_command_that_fails_is_an_error(code):
    with pytest.raises(CapslipError, match="expected 0 and a line 'status'"):
        timings._run([sys.executable, "-c", code], "status")


def test_peers_take_turns_and_the_first_turn_does_not_count():
    calls = []

    def absent():
        raise ImportError

    def slow():
        calls.append("peer")
        time.sleep(0.02)

    peers = {"absent": absent, "slow": lambda: slow}
    rows = list(timings._in_turns("stage", "nothing", lambda: calls.append("own"), peers, 2))
    assert calls == ["own", "peer"] * 3
    assert [row.by for row in rows] == ["capslip", "slow"]
    assert rows[1].ratio > 1


def test_a_folder_that_cannot_be_made_is_said_at_once(small, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="choose another"):
        study.run_bench(tmp_path / "file" / "folder")


def test_a_scan_of_a_fleet_takes_few_calls(tmp_path):
    """Of Python functions: on a small map nearly all time is theirs, on whatever machine."""
    fleet._write_scans(tmp_path / "scans", (100, 150), 1)
    settings = load_settings(overrides=fleet.WAYS["numbers"])

    def numbers(name):
        (scan,) = (tmp_path / "scans").iterdir()
        write(analyze(load_surface(scan), settings), tmp_path / name, page=False)

    numbers("first")  # loads what all scans need
    profile = cProfile.Profile()
    profile.runcall(numbers, "second")
    assert pstats.Stats(profile).total_calls < 100_000
