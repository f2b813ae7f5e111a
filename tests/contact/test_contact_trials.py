"""Where caps and points stand that are pressed instead of those that were found."""

from types import SimpleNamespace

import numpy as np
import pytest
from contact_cases import E_STAR_PA, table

from capslip.contact.trials import FaceOfCaps, _chance_to_hide, _on_rims
from capslip.settings import load_settings
from capslip.surface.heightmap import HeightMap

LOAD_N, RADIUS_M, TOP_M = 50.0, 5.0, 3e-7


def test_a_point_stands_as_far_up_as_the_plane_of_contact_and_what_the_load_sinks_leave():
    """Of one sphere of Hertz: u(r) = N / (pi E* r) far from it."""
    settings = load_settings(
        overrides=(
            f"contact.preload_N={LOAD_N}",
            "contact.alignment=as_levelled",
            "material.youngs_modulus_Pa=[200e9, 200e9]",
        )
    )
    surface = HeightMap(np.zeros((20, 30)), (2e-3, 2e-3))
    caps = table([0.02], [0.03], [RADIUS_M], [TOP_M])
    approach_m = (0.75 * LOAD_N / (E_STAR_PA * np.sqrt(RADIUS_M))) ** (2 / 3)
    x_m, y_m, up_m = np.array([0.05, 0.02, 0.02]), np.array([0.03, 0.01, 0.01]), 2e-8
    sunk_m = LOAD_N / (np.pi * E_STAR_PA * np.hypot(x_m - 0.02, y_m - 0.03))
    height_m = TOP_M - approach_m + sunk_m + up_m * np.array([1.0, 1.0, -1.0])
    found_m = FaceOfCaps(surface, settings).stands_up_m(caps, x_m, y_m, height_m)
    assert found_m == pytest.approx([up_m, up_m, -np.inf], rel=1e-6)


def test_a_point_within_a_contact_goes_straight_out_to_its_rim():
    curve = SimpleNamespace(x_m=np.array([1.0, 9.0]), y_m=np.array([2.0, 5.0]))
    a_m = np.array([0.5, 2.0])
    x_m, y_m = np.array([1.3, 9.0, 9.6, 4.0]), np.array([2.4, 5.0, 4.2, 4.0])
    at_x_m, at_y_m = _on_rims(x_m, y_m, curve, a_m)
    assert at_x_m == pytest.approx([1.3, 11.0, 10.2, 4.0])
    assert at_y_m == pytest.approx([2.4, 5.0, 3.4, 4.0])


def test_a_hill_that_was_not_seen_stands_within_a_hole():
    """As many places as the hole has room for; of a disc that is wider than it, none."""
    height_m = np.zeros((60, 140))
    height_m[10:30, 100:130] = np.nan
    surface = HeightMap(height_m, (1e-3, 1e-3))
    chance, lost, place = _chance_to_hide(
        surface, ~surface.measured, np.array([1e-3, 5e-3, 11e-3]), 1e-6
    )
    assert chance[0] > chance[1] > chance[2] == 0.0
    # centres that stand 5 mm and more from what was measured, over the whole face
    assert chance[1] == pytest.approx(20.0 * 10.0 / (60.0 * 140.0), rel=0.3)
    assert lost == 0.0
    rng = np.random.default_rng(1)
    at_m = np.array([place(rng, 5e-3) for _ in range(50)])
    assert (np.abs(at_m - [0.115, 0.02]) <= [0.0105, 0.0055]).all()
    assert np.ptp(at_m, axis=0)[0] > 0.01
