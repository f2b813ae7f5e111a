"""Real scans against values from independent readers."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from capslip.surface.conditioning import condition
from capslip.surface.readers import load_surface

SCANS = Path(__file__).parents[3] / "shared" / "scans"
BUILT_IN = (".x3p", ".sdf", ".txt")
OPEN = (
    "bullet_land_B1L1_nanofocus.x3p",
    "bullet_land_B1L2_nanofocus.x3p",
    "ski_base_stone_ground_alicona.x3p",
    "conformance/rubber_alicona.x3p",
    "conformance/x3p_iso_sample1_ascii_4x4.x3p",
    "conformance/x3p_iso_sample1_bin_validbits_4x4.x3p",
)
VENDOR = (
    "laser_textured_grooves_leica_dcm3d.plu",
    "milled_like_arcs_1.opd",
    "plate_30x60mm_missing27pct.frt",
    "polished_disc_with_tracks.sur",
    "wafer_piece_30pct_missing.frt",
    "conformance/gwyddion_ascii_matrix_nonsquare.txt",
    "conformance/iso25178-71_ascii_tiny.sdf",
    "conformance/zygo_metropro_phase_res1.dat",
)
pytestmark = [
    pytest.mark.scans,
    pytest.mark.skipif(not SCANS.is_dir(), reason="no folder shared/scans beside the project"),
]


def over_plane(surface):
    """Heights of the measured points over their least-squares plane."""
    y, x = np.nonzero(surface.measured)
    design = np.column_stack([np.ones(len(y)), x, y])
    heights = surface.height_m[surface.measured]
    return heights - design @ np.linalg.lstsq(design, heights, rcond=None)[0]


@pytest.mark.parametrize("name", OPEN + VENDOR)
def test_scan_gives_the_documented_values(name, monkeypatch):
    if name.endswith(BUILT_IN):
        monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    else:
        pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    oracle = json.loads((SCANS / "oracle.json").read_text(encoding="utf-8"))
    assert set(oracle) == {*OPEN, *VENDOR}
    known, surface = oracle[name], load_surface(SCANS / name)
    conditioned = condition(surface, "plane", outliers="none")
    assert surface.shape == (known["ny"], known["nx"])
    assert np.count_nonzero(~surface.measured) == known["missing"]
    assert surface.origin.notes == ()
    found = {
        "dy_m": surface.pixel_size_m[0],
        "dx_m": surface.pixel_size_m[1],
        "z_min_m": np.nanmin(surface.height_m),
        "z_max_m": np.nanmax(surface.height_m),
        "Sq_plane_m": conditioned.sq_m,
        "Sz_plane_m": conditioned.sz_m,
        "Smc10_plane_m": np.nanquantile(conditioned.surface.height_m, 0.9),
    }
    for key, value in found.items():
        assert value == pytest.approx(known[key], rel=1e-9), key
    residual_m = over_plane(surface)
    assert np.sqrt(np.mean(residual_m**2)) == pytest.approx(known["Sq_plane_m"], rel=1e-6)
    assert np.ptp(residual_m) == pytest.approx(known["Sz_plane_m"], rel=1e-6)


def test_the_two_forms_of_the_iso_sample_give_equal_maps():
    text, binary = (load_surface(SCANS / name) for name in OPEN[-2:])
    np.testing.assert_array_equal(text.height_m, binary.height_m)


@pytest.mark.parametrize("name", OPEN[:4])
def test_x3p_agrees_point_by_point_with_another_reader(name):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    from SurfaceTopography import open_topography

    with open_topography(str(SCANS / name)) as reader:
        other = np.ma.filled(reader.topography().heights().astype(float), np.nan).T
    np.testing.assert_array_equal(load_surface(SCANS / name).height_m, other)


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("polished_disc_with_tracks.sur", "outliers"),
        ("plate_30x60mm_missing27pct.frt", "outliers_removed"),
        ("milled_like_arcs_1.opd", "non_square_pixels"),
        ("laser_textured_grooves_leica_dcm3d.plu", "slope_suspect"),
    ],
)
def test_what_is_odd_about_a_scan_is_said(name, code):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    assert code in [p.code for p in condition(load_surface(SCANS / name)).problems]


@pytest.mark.parametrize("name", VENDOR)
def test_half_a_vendor_file_is_refused_in_one_line(name, tmp_path, capfd):
    pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    from capslip.errors import CapslipError

    content = (SCANS / name).read_bytes()
    half = tmp_path / Path(name).name
    half.write_bytes(content[: len(content) // 2])
    with pytest.raises(CapslipError) as caught:
        load_surface(half)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")
