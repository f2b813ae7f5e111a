"""A ripple is found wherever it runs, and not in what is rough, ground or scanned in rows."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.doubts import VISIBLE_RIPPLE, problems_of_ripple
from capslip.surface.heightmap import HeightMap
from capslip.surface.ripple import LEAST_SIDE, MOST_M, MOST_OF_RELIEF, find_ripple, without_ripple

SHAPE, PIXEL_M = (200, 300), (2e-4, 2.5e-4)
ROW, COLUMN = np.mgrid[: SHAPE[0], : SHAPE[1]]
CAPS_M = synthetic_surface(Scene(SHAPE, PIXEL_M, 4, families=PAPER, gap_m=1e-3))[0].height_m
HEIGHT_M = 1.5e-8


def of(height_m):
    return HeightMap(height_m, PIXEL_M)


def ripple_m(per_row, per_column, amplitude_m=HEIGHT_M):
    return amplitude_m * np.cos(2.0 * np.pi * (per_row * ROW + per_column * COLUMN) + 0.4)


def white_m(seed, rms_m, shape=SHAPE):
    return rms_m * np.random.default_rng(seed).standard_normal(shape)


@pytest.mark.parametrize("lost", [np.s_[:0], np.s_[60:90, 100:160]])
@pytest.mark.parametrize("tilt", [0.0, 1e-8])
@pytest.mark.parametrize("waves", [(0.12, 0.0), (0.0, 0.2), (0.11, 0.15), (0.1, -0.3), (0.4, 0.4)])
def test_a_ripple_is_found_with_its_height_and_length_and_taken_off(waves, tilt, lost):
    """Within half of a line of the spectrum, of which 200 are a wave a row, 256 one a column."""
    height_m = CAPS_M + ripple_m(*waves) + white_m(1, 1e-9) + tilt * COLUMN
    height_m[lost] = np.nan
    found = find_ripple(of(height_m))
    assert (found.per_row, found.per_column) == pytest.approx(waves, abs=2.6e-3)
    assert 0.72 * HEIGHT_M < found.amplitude_m < 1.2 * HEIGHT_M  # by window and hole
    length_m = 1.0 / np.hypot(waves[0] / PIXEL_M[0], waves[1] / PIXEL_M[1])
    assert found.wavelength_m == pytest.approx(length_m, rel=0.03)
    left_m = without_ripple(of(height_m), found).height_m - (height_m - ripple_m(*waves))
    assert np.nanstd(left_m[10:-10, 10:-10]) < 0.25 * HEIGHT_M


def test_the_middle_of_a_large_map_tells_of_all_of_it():
    row, column = np.mgrid[:400, :500]
    face_m = 3e-7 * np.cos(row / 90.0) * np.cos(column / 70.0)
    wave_m = HEIGHT_M * np.cos(2.0 * np.pi * (0.1003 * row - 0.2004 * column))
    surface = HeightMap(face_m + wave_m, PIXEL_M)
    left_m = without_ripple(surface, find_ripple(surface)).height_m - face_m
    assert np.std(left_m[20:-20, 20:-20]) < 0.25 * HEIGHT_M


@pytest.mark.parametrize(
    "height_m",
    [
        CAPS_M,
        CAPS_M + white_m(1, 1e-8),
        CAPS_M + white_m(2, 1e-8, (SHAPE[0], 1)),  # rows that lie at heights of their own
        CAPS_M + white_m(3, 1e-8, (1, SHAPE[1])),
        CAPS_M + gaussian_filter1d(white_m(4, 5e-8, (SHAPE[0], 1)), 2.0, axis=0),  # a ground lay
        gaussian_filter(white_m(5, 1e-6), 3.0),
        gaussian_filter(white_m(6, 1e-6), (1.0, 20.0)),
        CAPS_M + ripple_m(0.015, 0.0),  # three waves: nobody knows whose
        CAPS_M + ripple_m(0.12, 0.0, 1.2 * MOST_M),  # feed marks
        1e-9 * CAPS_M / CAPS_M.std() + ripple_m(0.12, 0.0, 1e-9),  # the relief of the face
        np.zeros(SHAPE),
        np.full(SHAPE, np.nan),
        (CAPS_M + ripple_m(0.12, 0.0))[: LEAST_SIDE - 1],
        np.where(np.arange(SHAPE[1]) < 160, np.nan, CAPS_M + ripple_m(0.12, 0.0)),
    ],
)
def test_what_no_clock_made_is_no_ripple(height_m):
    assert find_ripple(of(height_m)) is None


def lattice_m(directions_rad, height_m=HEIGHT_M):
    """Waves of one length in some directions: hills in rows, of a texture that was made so."""
    return sum(
        height_m * np.cos(2.0 * np.pi * 0.12 * (np.sin(one) * ROW + np.cos(one) * COLUMN))
        for one in directions_rad
    )


@pytest.mark.parametrize("turn_rad", [0.0, 0.2])
def test_a_lattice_of_hills_is_the_faces_own_and_two_waves_are_none(turn_rad):
    six, square = (np.arange(n) * np.pi / n + turn_rad for n in (3, 4))
    for directions_rad in (six, square):
        assert find_ripple(of(CAPS_M + lattice_m(directions_rad))) is None
        assert find_ripple(of(CAPS_M + lattice_m(directions_rad[:2]))) is not None
    low = lattice_m(six[1:], 0.3 * HEIGHT_M)  # what an instrument leaves beside a ripple
    assert find_ripple(of(CAPS_M + lattice_m(six[:1]) + low)) is not None


def test_a_ripple_counts_up_to_a_tenth_of_a_wave_of_light_and_on_the_relief_of_a_face():
    assert find_ripple(of(CAPS_M + ripple_m(0.12, 0.1, 0.8 * MOST_M))) is not None
    low_m = 1e-8 * CAPS_M / CAPS_M[:, 22:278].std()
    assert find_ripple(of(low_m + ripple_m(0.12, 0.1, 0.7 * MOST_OF_RELIEF * 1e-8))) is not None
    few_rows = find_ripple(of((CAPS_M + ripple_m(0.0, 0.2))[:LEAST_SIDE]))
    assert (few_rows.per_row, few_rows.per_column) == pytest.approx((0.0, 0.2), abs=2.6e-3)


def test_a_ripple_is_a_doubt_from_a_fiftieth_of_the_approach_on():
    surface = of(CAPS_M + ripple_m(0.12, 0.0))
    height_m = 2.0 * find_ripple(surface).amplitude_m
    (found,) = problems_of_ripple(surface, 0.99 * height_m / VISIBLE_RIPPLE)
    assert (found.code, found.severity) == ("ripple", "warning")
    assert "m high and 0.00167 m long" in found.message
    assert problems_of_ripple(surface, 1.01 * height_m / VISIBLE_RIPPLE) == []
    assert problems_of_ripple(of(CAPS_M), 1e-12) == []
