"""Long waves of a scan against waves of known length and height, and roughness without any."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from capslip.surface.heightmap import HeightMap
from capslip.surface.waves import long_waves_m

N, SIDE_M = 180, 9e-3
Y, X = (np.mgrid[:N, : 2 * N] + 0.5) / N  # of a scan of two sides by one


def of(height_m):
    return HeightMap(height_m, (SIDE_M / N, SIDE_M / N))


def rough(seed, n=N, width=2):
    z = gaussian_filter(np.random.default_rng(seed).standard_normal((n, n)), width, mode="wrap")
    return 1e-7 * z / z.std()


def test_a_wave_of_just_the_scans_length_is_as_high_as_it_is():
    for wave in (np.cos(2.0 * np.pi * Y), np.cos(np.pi * X), np.cos(2.0 * np.pi * Y) * 3.0):
        expected = 1e-7 * np.sqrt(np.mean(wave**2))
        assert long_waves_m(of(1e-7 * wave)) == pytest.approx(expected, rel=1e-3)


def test_a_longer_wave_leaves_its_bow():
    """Over the mean plane z = x^2 on (-1/2, 1/2): all but what 4 and more half waves hold of it."""
    bow = (Y - 0.5) ** 2
    a_2, a_4 = (1.0 / (np.pi * k) ** 2 for k in (1, 2))  # of cos(2 k pi y): (-1)^k / (k pi)^2
    square = 0.5 * a_2**2 - 5.0 / 9.0 * 0.5 * a_4**2  # 5 long modes, 9 that follow
    assert long_waves_m(of(1e-7 * bow)) == pytest.approx(1e-7 * np.sqrt(square), rel=1e-2)


def test_no_tilt_no_level_and_no_short_wave_changes_it():
    wave = 1e-7 * np.cos(2.0 * np.pi * Y)
    expected = long_waves_m(of(wave))
    for more in (1e-5 * X - 3e-6 * Y + 1e-3, 1e-6 * np.cos(10.0 * np.pi * X), 0.0 * X):
        assert long_waves_m(of(wave + more)) == pytest.approx(expected, rel=1e-6)
    assert long_waves_m(of(1e-7 * np.cos(8.0 * np.pi * Y))) < 1e-12
    assert long_waves_m(of(1e-7 * (X + Y))) < 1e-12


def test_short_roughness_shows_none_and_with_a_wave_that():
    """White below its own length: long modes stand out by a fifth of Sq in one scan of ten."""
    faces = [rough(seed) for seed in range(40)]
    assert np.mean([long_waves_m(of(z)) > 0.2e-7 for z in faces]) < 0.1
    wave = 1e-7 * np.sqrt(2.0) * np.cos(2.0 * np.pi * Y[:, :N])
    found = [long_waves_m(of(z + wave)) for z in faces]
    assert found == pytest.approx([1e-7] * 40, rel=0.15)


@pytest.mark.parametrize(("length", "share"), [(1.5, 0.9), (2.0, 0.9)])
def test_most_parts_of_a_face_show_a_wave_longer_than_they_are(length, share):
    """Of the height of the roughness, in nine parts, on faces of six seeds."""
    at = 2.0 * np.pi * ((np.arange(3 * N) + 0.5) / N - 1.5) / length
    wave = -1e-7 * (np.cos(at)[:, None] + np.cos(at)[None, :])
    seen = [
        long_waves_m(of(part.copy())) > 0.2e-7
        for seed in range(6)
        for rows in np.split(rough(seed, 3 * N) + wave, 3)
        for part in np.split(rows, 3, axis=1)
    ]
    assert np.mean(seen) >= share


def test_points_that_were_not_measured_are_as_the_plane():
    z = 1e-7 * np.cos(2.0 * np.pi * Y) + 1e-5 * X
    z[60:70, 100:130] = np.nan
    assert long_waves_m(of(z)) == pytest.approx(1e-7 / np.sqrt(2.0), rel=0.03)


@pytest.mark.parametrize("frame", [((0, 0), (0, 60)), ((3, 17), (17, 3)), ((0, 90), (0, 0))])
def test_a_frame_that_was_not_measured_changes_nothing(frame):
    z = 1e-7 * np.cos(2.0 * np.pi * Y) + rough(3, 2 * N)[:N] + 1e-5 * X
    framed = np.pad(z, frame, constant_values=np.nan)
    expected = long_waves_m(of(z))
    assert expected > 0.5e-7
    assert long_waves_m(of(framed)) == pytest.approx(expected, rel=1e-9)
