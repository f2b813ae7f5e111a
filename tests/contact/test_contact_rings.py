"""A turned ridge is a line contact: which of its equal points is highest must decide nothing."""

import numpy as np
import pytest

from capslip.analysis import analyze_once
from capslip.settings import load_settings
from capslip.surface.heightmap import HeightMap

N, PIXEL_M = 96, 5e-4
Y_M, X_M = (np.mgrid[:N, :N] + 0.5) * PIXEL_M
SIDE_M = N * PIXEL_M
SHARES = np.array([0.25, 0.5, 0.75])


def ring_m(x_m, y_m, crest_m, radius_m):
    """Return heights of a ring-shaped ridge of a parabolic section about a place."""
    return -((np.hypot(X_M - x_m, Y_M - y_m) - crest_m) ** 2) / (2.0 * radius_m)


def one_ring():
    return np.maximum(ring_m(0.5 * SIDE_M + 1.3e-5, 0.5 * SIDE_M - 2.1e-5, 12e-3, 20.0), -1e-6)


def nine_rings():
    """Hills with a crater, each a ring of its own height."""
    z = np.full((N, N), -1e-6)
    for i in range(9):
        x_m, y_m = (8e-3 + 16e-3 * (i % 3) + 1.3e-5 * i), (8e-3 + 16e-3 * (i // 3) - 2.1e-5 * i)
        z = np.maximum(z, ring_m(x_m, y_m, 2e-3, 5.0) - 2e-8 * (i * i % 5))
    return z


def answers(height_m, *words):
    surface = HeightMap(np.ascontiguousarray(height_m), (PIXEL_M, PIXEL_M))
    found = analyze_once(surface, load_settings(overrides=("contact.preload_N=300", *words)))
    slip = found.slip
    energy_J = slip.energy_at_force_J(SHARES * slip.total_slip_force_N)
    return found, np.append(energy_J, found.contact.stiffness_N_per_m)


@pytest.mark.long
@pytest.mark.parametrize("alignment", ["balanced", "as_levelled"])
@pytest.mark.parametrize("scene", [one_ring, nine_rings])
def test_a_ring_is_pressed_as_a_map_and_the_same_in_any_view(scene, alignment):
    height_m = scene()
    word = f"contact.alignment={alignment}"
    found, at = answers(height_m, word)
    assert found.contact.rung.made_from == "map", found.contact.model_reason
    other_m = height_m[:, ::-1].T.astype(np.float32).astype(float)
    again, numbers = answers(other_m, word)
    assert again.contact.model == found.contact.model
    assert numbers == pytest.approx(at, rel=0.01)


def test_where_there_is_no_time_for_the_map_a_ring_is_doubted():
    for scene in (one_ring, nine_rings):
        found, _ = answers(scene(), "contact.alignment=as_levelled", "contact.time_limit_s=1e-9")
        said = {problem.code for problem in found.problems if problem.severity == "warning"}
        assert "boundary_elements_needed" in said
