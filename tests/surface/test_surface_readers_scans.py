"""Heights of real scans, before any conditioning, against values from independent readers."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from capslip.surface.readers import load_surface

SCANS = Path(__file__).parents[3] / "shared" / "scans"
ORACLE = json.loads((SCANS / "oracle.json").read_text("utf-8")) if SCANS.is_dir() else {}
BUILT_IN = (".x3p", ".sdf", ".txt")
pytestmark = [
    pytest.mark.scans,
    pytest.mark.skipif(not SCANS.is_dir(), reason="no folder shared/scans beside the project"),
]


def without_plane(surface):
    y, x = np.indices(surface.shape)
    measured = surface.measured
    design = np.column_stack([np.ones(measured.sum()), x[measured], y[measured]])
    heights = surface.height_m[measured]
    return heights - design @ np.linalg.lstsq(design, heights, rcond=None)[0]


@pytest.mark.parametrize("name", ORACLE)
def test_scan_gives_the_documented_values(name, monkeypatch):
    if name.endswith(BUILT_IN):
        monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    else:
        pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    known = ORACLE[name]
    surface = load_surface(SCANS / name)
    residual = without_plane(surface)
    assert surface.shape == (known["ny"], known["nx"])
    assert np.count_nonzero(~surface.measured) == known["missing"]
    found = {
        "dy_m": surface.pixel_size_m[0],
        "dx_m": surface.pixel_size_m[1],
        "z_min_m": np.nanmin(surface.height_m),
        "z_max_m": np.nanmax(surface.height_m),
        "Sq_plane_m": np.sqrt(np.mean(residual**2)),
        "Sz_plane_m": np.ptp(residual),
        "Smc10_plane_m": np.quantile(residual, 0.9),
    }
    for key, value in found.items():
        assert value == pytest.approx(known[key], rel=1e-6), key
    assert surface.origin.notes == ()
