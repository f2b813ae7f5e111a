"""Spikes and bad codes go; peaks, ridges, steps and rough patches stay."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap
from capslip.surface.outliers import find_outliers
from capslip.surface.readers import load_surface

SCANS = Path(__file__).parents[3] / "shared" / "scans"
PIXEL_M = (50e-6, 50e-6)
NY, NX = 200, 300
Y, X = np.mgrid[:NY, :NX].astype(float)
FLOORS = {
    "flat": np.zeros((NY, NX)),
    "waves": 1e-7 * np.sin(Y / 9) * np.cos(X / 13),
    "noise": 2e-9 * np.random.default_rng(7).standard_normal((NY, NX)),
}


def found(z, pixel_m=PIXEL_M):
    return find_outliers(HeightMap(z, pixel_m)).index


def rough(seed=0, rms_m=2e-9, shape=(NY, NX), width=1.5):
    waves = ndimage.gaussian_filter(np.random.default_rng(seed).standard_normal(shape), width)
    return rms_m * waves / waves.std()


def with_spikes(z, n=100, height_m=2e-6, seed=3):
    rng = np.random.default_rng(seed)
    grid = rng.permutation((z.shape[0] // 4) * (z.shape[1] // 4))[:n]  # no two side by side
    row, col = np.divmod(grid, z.shape[1] // 4)
    at = np.sort((4 * row + 1) * z.shape[1] + 4 * col + 2)
    z = z.copy()
    z.reshape(-1)[at] += height_m * rng.choice((-1.0, 1.0), n)
    return z, at


@pytest.mark.parametrize("floor", FLOORS)
def test_every_spike_and_nothing_else_is_found(floor):
    z, at = with_spikes(FLOORS[floor])
    np.testing.assert_array_equal(found(z), at)


def test_spikes_among_non_measured_points_are_found():
    z, at = with_spikes(rough())
    missing = np.random.default_rng(5).random(z.shape) < 0.05
    missing.reshape(-1)[at] = False
    z[missing] = np.nan
    assert set(found(z)) == set(at)


def test_one_point_in_thirty_may_be_a_spike():
    z, at = with_spikes(rough(), n=2000)
    np.testing.assert_array_equal(found(z), at)


def test_a_spike_is_told_with_its_height_over_what_is_around_it():
    z = rough() + 5.0
    z[60, 70] -= 1e-6
    outliers = find_outliers(HeightMap(z, PIXEL_M))
    assert outliers.index.tolist() == [60 * NX + 70]
    assert outliers.step_m[0] == pytest.approx(-1e-6, abs=2e-8)


def test_two_spikes_side_by_side_are_found():
    z = rough()
    z[60, 70] += 2e-6
    z[61, 71] += 2e-6
    z[90, 70] += 2e-6
    z[90, 71] -= 1e-6
    assert found(z).tolist() == [60 * NX + 70, 61 * NX + 71, 90 * NX + 70, 90 * NX + 71]


@pytest.mark.parametrize("corner", [(0, 50), (199, 7), (90, 0), (33, 299), (0, 0), (199, 299)])
def test_a_spike_at_the_edge_is_found(corner):
    z = rough()
    z[corner] += 2e-6
    assert found(z).tolist() == [corner[0] * NX + corner[1]]


@pytest.mark.parametrize("second", [(1, 51), (1, 50)])
def test_spikes_at_the_edge_with_four_neighbours_left_are_found(second):
    z = rough()
    z[0, 50] += 2e-6
    z[second] -= 1e-6
    assert found(z).tolist() == [50, second[0] * NX + second[1]]


def test_a_narrow_peak_in_a_corner_stays():
    z = rough()
    z += 1e-6 * np.maximum(1 - (np.hypot(Y, X) / 2.5) ** 2, 0)
    assert found(z).size == 0


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("width", [0.0, 0.7, 3.0])
def test_noise_and_waves_hold_no_outlier(seed, width):
    assert found(rough(seed, shape=(400, 600), width=width)).size == 0


PEAKS = {
    "paraboloid": lambda r: 1 - r**2,
    "hemisphere": lambda r: np.sqrt(np.maximum(1 - r**2, 0)),
    "bell": lambda r: np.exp(-2 * r**2),
    "cone": lambda r: 1 - r,
    "pillar": lambda r: (r <= 1).astype(float),
}


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("place", ["anywhere", "pixel", "corner"])
@pytest.mark.parametrize("width", [3.0, 4.0, 5.0, 9.0])
@pytest.mark.parametrize("shape", PEAKS)
def test_narrow_peaks_stay(shape, width, place, floor):
    rng = np.random.default_rng(int(width))
    part = np.s_[:120, :180]
    z, y, x = np.zeros((120, 180)), Y[part], X[part]
    for height_m in rng.uniform(3e-7, 2e-6, 25):
        centre = rng.uniform((5, 5), (115, 175))
        if place != "anywhere":
            centre = np.floor(centre) + (0.5 if place == "corner" else 0.0)
        r = np.hypot(y - centre[0], x - centre[1]) / (width / 2)
        z = np.maximum(z, height_m * PEAKS[shape](r))
    assert found(z + FLOORS[floor][part]).size == 0


@pytest.mark.parametrize("angle", [0, 7, 26.57, 45, 80, 90, 135])
@pytest.mark.parametrize("width", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("sign", [-1, 1])
def test_ridges_and_scratches_stay(angle, width, sign):
    phi = np.radians(angle)
    across = (X - NX / 2) * np.sin(phi) - (Y - NY / 2) * np.cos(phi)
    along = (X - NX / 2) * np.cos(phi) + (Y - NY / 2) * np.sin(phi)
    ridge = np.maximum(1 - (2 * across / (width + 1)) ** 2, 0) * (np.abs(along) < 60)
    assert found(rough() + sign * 1e-6 * ridge).size == 0


def test_steps_corners_and_terraces_stay():
    z = rough()
    z[50:120, 60:200] += 1e-6
    z[80:82, 90:95] -= 3e-6
    z[(Y + X).astype(int) > 400] += 5e-7
    assert found(z).size == 0


def test_a_chequerboard_and_sharp_lays_stay():
    board = 1e-6 * ((Y.astype(int) // 2 + X.astype(int) // 2) % 2)
    lay = 1e-6 * (X % 7 == 0)
    assert found(board + FLOORS["noise"]).size == 0
    assert found(lay + FLOORS["noise"]).size == 0


def test_coarse_steps_of_the_instrument_are_no_outliers():
    smooth = 5e-8 * np.sin(Y / 20) * np.cos(X / 25) + 3e-10 * rough(1, 1.0)
    assert found(np.round(smooth / 1e-9) * 1e-9).size == 0


def coded(seed=0):
    """Make a face with a hole that holds codes: single, in small groups and along a line."""
    z = rough(seed, 1e-7)
    z[60:120, 80:200] = np.nan
    bad = np.zeros(z.shape, dtype=bool)
    for rows, cols in ((70, 100), (slice(80, 82), slice(120, 123)), (60, slice(150, 152))):
        bad[rows, cols] = True
    bad[119, 100:160] = True
    z[bad] = -70e-6
    z[100, 130] = 230e-6
    bad[100, 130] = True
    return z, np.flatnonzero(bad)


def test_bad_codes_are_found_in_groups_and_lines():
    z, bad = coded()
    np.testing.assert_array_equal(found(z), bad)


def test_a_line_of_one_code_is_known_by_its_stored_height():
    z, bad = coded()
    stored = HeightMap(z, PIXEL_M)
    tilted = HeightMap(z + 1e-7 * X, PIXEL_M)
    assert set(bad) - set(find_outliers(tilted).index)
    assert set(find_outliers(tilted, stored).index) == set(bad)


def test_a_flat_terrace_beside_a_hole_is_no_code():
    z = np.where((Y > 50) & (Y < 120) & (X > 60), 1e-6, 0.0)
    z[::9, ::7] = np.nan
    stored = HeightMap(z, PIXEL_M)
    assert find_outliers(remove_form(stored)[0], stored).index.size == 0


def test_a_peak_beside_a_hole_stays():
    z, _ = with_spikes(rough(), 0)
    z += 1e-6 * np.maximum(1 - (np.hypot(Y - 90, X - 90) / 2.5) ** 2, 0)
    z[91, 88:93] = np.nan
    assert found(z).size == 0


@pytest.mark.parametrize(
    "change",
    [
        lambda z: z + 3.0,
        lambda z: 1e3 * z,
        lambda z: 1e-3 * z,
        lambda z: -z,
    ],
)
def test_level_and_scale_and_side_change_nothing(change):
    z, bad = coded()
    np.testing.assert_array_equal(found(change(z)), bad)


def test_turning_the_face_turns_the_outliers():
    z, bad = coded()
    mask = np.zeros(z.shape, dtype=bool)
    mask.reshape(-1)[bad] = True
    np.testing.assert_array_equal(found(np.rot90(z)), np.flatnonzero(np.rot90(mask)))


@pytest.mark.scans
@pytest.mark.skipif(not SCANS.is_dir(), reason="no folder shared/scans beside the project")
@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("plate_30x60mm_missing27pct.frt", 269, 275),  # 269 codes, far off 70 ... 76 um
        ("wafer_piece_30pct_missing.frt", 501, 900),  # a line of 500 zeros, and spikes
        ("ski_base_stone_ground_alicona.x3p", 0, 0),
        ("laser_textured_grooves_leica_dcm3d.plu", 0, 0),
        ("milled_like_arcs_1.opd", 0, 0),
        ("conformance/rubber_alicona.x3p", 0, 0),
        ("bullet_land_B1L1_nanofocus.x3p", 0, 10),
    ],
)
def test_real_scans_lose_what_is_wrong_and_no_more(name, least, most):
    if not name.endswith(".x3p"):
        pytest.importorskip("SurfaceTopography", reason="extra `vendor`", exc_type=ImportError)
    scan = load_surface(SCANS / name)
    level, _ = remove_form(scan)
    index = find_outliers(level, scan).index
    assert least <= index.size <= most
    if name.startswith("plate"):
        z = scan.height_m.copy()
        z.reshape(-1)[index] = np.nan
        assert np.nanmin(z) > 69e-6
        assert np.nanmax(z) < 77e-6
        clean, _ = remove_form(replace(scan, height_m=z))
        assert np.nanmax(clean.height_m) - np.nanmin(clean.height_m) < 5e-6
