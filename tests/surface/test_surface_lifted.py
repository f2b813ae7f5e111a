"""Grains on which the face goes on as around them go; hills, ridges and textures stay."""

import numpy as np
import pytest

from capslip.surface.heightmap import HeightMap
from capslip.surface.outliers import find_outliers

NY, NX = 200, 300
Y, X = np.mgrid[:NY, :NX].astype(float)
NOISE_M = 1e-9 * np.random.default_rng(2).standard_normal((NY, NX))


def hills(*places):
    """Make paraboloids on a level floor, whose rims fall by 60 nm a pixel."""
    z = np.zeros((NY, NX))
    for y, x in places or ((60, 70), (140, 90), (100, 220)):
        z = np.maximum(z, 9e-7 - 1e-9 * ((Y - y) ** 2 + (X - x) ** 2))
    return z + NOISE_M


def found(z):
    return find_outliers(HeightMap(z, (2e-4, 2e-4)))


def grain(z, row, col, width, step_m=1e-6):
    z = z.copy()
    z[row : row + width, col : col + width] += step_m
    inside = np.zeros(z.shape, dtype=bool)
    inside[row : row + width, col : col + width] = True
    return z, np.flatnonzero(inside)


@pytest.mark.parametrize("width", [2, 3, 6, 12])
@pytest.mark.parametrize("place", [(58, 66), (50, 60), (10, 250)])
def test_a_grain_on_a_hill_its_flank_or_the_floor_is_found(place, width):
    z, inside = grain(hills(), *place, width)
    outliers = found(z)
    np.testing.assert_array_equal(outliers.index, inside)
    assert outliers.n_lifted == inside.size
    assert outliers.step_m == pytest.approx(1e-6, rel=0.05)


def test_a_pit_stays():
    z, _ = grain(hills(), 58, 66, 6, -1e-6)
    assert found(z).index.size == 0


def test_many_grains_are_a_texture():
    z = hills()
    for row in range(20, 180, 50):
        for col in range(20, 280, 50):
            z, _ = grain(z, row, col, 4)
    assert found(z).index.size == 0


@pytest.mark.parametrize("shape", ["dome", "cone", "worn"])
def test_a_hill_with_a_top_of_its_own_stays(shape):
    """A worn one is level, where the flank it stands on falls by nearly its height."""
    z = hills()
    r = np.hypot(Y - 60, X - 84)
    top_m = {
        "dome": 4e-6 * (1.0 - (r / 9.0) ** 2),
        "cone": 4e-6 * (1.0 - r / 9.0),
        "worn": np.full(z.shape, 1.2e-6),
    }[shape]
    z = np.where(r < 7.0, top_m, z) if shape == "worn" else np.where(top_m > 0.0, z + top_m, z)
    assert found(z).n_lifted == 0


def test_a_ridge_and_a_scratch_stay():
    for step_m in (-1e-6, 1e-6):
        z = hills()
        z[10:13, 100:160] += step_m
        assert found(z).index.size == 0


def test_a_rough_grain_stays():
    z, inside = grain(hills(), 58, 66, 6)
    z.reshape(-1)[inside] += 3e-7 * np.random.default_rng(1).standard_normal(inside.size)
    assert found(z).n_lifted == 0
