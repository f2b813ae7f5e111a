"""The benchmark's bookkeeping; what it measures is not tested."""

import json
import sys
import time

import pytest

from capslip.errors import CapslipError, OutputError
from capslip.studies.bench import study, timings


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(study, "SHAPE", (160, 240))
    monkeypatch.setattr(study, "REPEATS", 2)
    monkeypatch.setattr(study, "N_SETS", 50)
    monkeypatch.setattr(study, "STUDIES", {"of one stage": lambda: "| scene | ms |\n"})
    monkeypatch.setattr(timings, "_run", lambda command, until="": (0.1, 0.4, 0.2))


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
    assert "## of one stage\n\n| scene | ms |\n" in page
    assert result["machine"]["numpy"] in page


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
