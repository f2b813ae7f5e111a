"""capslip as its users meet it: what an import costs, what a type checker and the Tab key see."""

import subprocess
import sys

import pytest

import capslip
from scenes import PROJECT

MOST_MS = 50.0
HEAVY = ("matplotlib", "pyvista", "vtk", "vtkmodules", "meshio", "pandas", "scipy", "h5py", "PIL")
LOADED = f"""
import sys, time
import numpy
start = time.process_time()
import capslip
spent = time.process_time() - start
assert "capslip.result" not in sys.modules
capslip.analyze, capslip.load_surface, capslip.load_settings, capslip.write, capslip.Analysis
print(spent, *(name for name in {HEAVY!r} if name in sys.modules))
"""


def test_the_import_is_quick_and_loads_no_heavy_library():
    done = subprocess.run(
        [sys.executable, "-c", LOADED], capture_output=True, text=True, check=True, cwd=PROJECT
    )
    spent_s, *heavy = done.stdout.split()
    assert heavy == []
    assert 1e3 * float(spent_s) < MOST_MS


def test_the_tab_key_finds_the_public_names():
    assert set(capslip.__all__) <= set(dir(capslip))


@pytest.mark.long
def test_a_users_script_is_typed_throughout(tmp_path, monkeypatch):
    """The flags of `mypy --strict` stand in it, so that it shares the cache of `make lint`."""
    api = pytest.importorskip("mypy.api")
    monkeypatch.chdir(PROJECT)
    script = PROJECT / "tests" / "user" / "script.py"
    said, error, status = api.run([str(script)])
    assert (status, error) == (0, ""), said
    wrong = tmp_path / "wrong.py"
    wrong.write_text(
        script.read_text("utf-8") + "\ncapslip.analyse\ntext: str = capslip.analyze\n", "utf-8"
    )
    said, _, status = api.run([str(wrong)])
    assert status == 1
    assert '"analyse"' in said
    assert "Incompatible types" in said
