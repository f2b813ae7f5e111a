"""The window on a display that nobody sees: what a mouse and keys do to it."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import output_cases
import pytest

from capslip.output.tables import write_result, write_summary

XVFB = shutil.which("Xvfb")


@pytest.fixture
def display():
    """Start a display that nobody sees; its name."""
    read, write = os.pipe()
    words = [XVFB, "-displayfd", str(write), "-screen", "0", "1600x1200x24", "-nolisten", "tcp"]
    server = subprocess.Popen(words, pass_fds=(write,), stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as pipe:
        number = pipe.readline().strip()
    yield f":{number}"
    server.terminate()
    server.wait()


@pytest.mark.skipif(XVFB is None, reason="no Xvfb on this machine")
def test_mouse_and_keys_reach_caps_sliders_and_parts(display, tmp_path):
    write_result(output_cases.several(), tmp_path)
    write_summary(output_cases.several().summary(), tmp_path)
    script = Path(__file__).with_name("window_events.py")
    done = subprocess.run(
        [sys.executable, script, str(tmp_path)],
        env=os.environ | {"DISPLAY": display, "PYVISTA_OFF_SCREEN": "false"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["screen"]
    assert found["clicked"] == list(range(len(found["clicked"])))
    assert found["beside"] is None
    assert found["load_share"] == pytest.approx(0.5, abs=0.05)
    assert found["force_share"] == pytest.approx(0.75, abs=0.05)
    assert found["zones_after_key"] is not found["zones"]
