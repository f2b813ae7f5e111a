"""Maps with few pixels in contact: followed from twenty on, with what that leaves."""

import numpy as np
import pytest

from capslip.contact.map_accuracy import LEAST_ERROR, STIFFNESS_95, error_of_map, left_by_pixels
from capslip.contact.models.boundary_elements import boundary_elements
from capslip.contact.solvers import detail
from capslip.errors import ContactError
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.heightmap import HeightMap

E, TOLERANCE = 110e9, 0.05


def found_and_true(seed, length_m, load_N):
    """Return the curve of a rough scan, and how far it is off one of a quarter of the pixel."""
    scene = Scene(
        (60, 90), (2e-4, 2e-4), seed=seed, roughness_rms_m=2e-7, roughness_length_m=length_m
    )
    scan, truth = (
        boundary_elements(synthetic_surface(scene, finer=finer)[0], E) for finer in (1, 4)
    )
    found, true = (one.unloading(load_N) for one in (scan, truth))
    stiffness = found.stiffness_N_per_m / true.stiffness_N_per_m - 1
    return scan, abs(stiffness), detail._relative(*map(detail._loss_J, (found, true)))


@pytest.mark.parametrize(
    ("seed", "length_m", "load_N"),
    [(41, 2e-3, 5.0), (44, 2e-3, 5.0), (43, 1e-3, 10.0), (45, 1e-3, 10.0)],
)
def test_a_spline_knows_the_contacts_of_few_pixels(seed, length_m, load_N):
    scan, stiffness, energy = found_and_true(seed, length_m, load_N)
    assert 20 <= np.count_nonzero(scan.pressed(load_N).pressure_Pa) < 50
    assert stiffness < 0.01
    assert (energy[1:] < (0.08, 0.02, 0.01)).all()
    stated, _ = error_of_map(scan, load_N, TOLERANCE)
    assert stiffness < stated.stiffness
    assert (energy < [stated.energy_at(share) for share in detail.FORCE_SHARES]).all()


@pytest.mark.parametrize("seed", [42, 43, 45])
def test_where_it_does_not_pixels_leave_in_the_stiffness_what_they_do_in_all_energy(seed):
    """Contacts of 2 pixels: of the stiffness 3 to 5 % is left, which no detail tells."""
    scan, stiffness, energy = found_and_true(seed, 6e-4, 20.0)
    stated, problems = error_of_map(scan, 20.0, TOLERANCE)
    assert LEAST_ERROR < stiffness < stated.stiffness < 0.1
    assert stated.stiffness == pytest.approx(STIFFNESS_95 * left_by_pixels(scan, 20.0)[0.75])
    assert (energy < [stated.energy_at(share) for share in detail.FORCE_SHARES]).all()
    assert "warning" in {one.severity for one in problems}


def test_fewer_than_twenty_pixels_are_too_few():
    y, x = np.mgrid[-12:12, -12:12] * 1e-4
    sphere = HeightMap(-(x**2 + y**2) / (2 * 0.1), (1e-4, 1e-4))
    curve = boundary_elements(sphere, E)
    enough_N, too_little_N = 14.0, 4.0
    assert np.count_nonzero(curve.pressed(enough_N).pressure_Pa) >= 20
    hertz = 2 * E * (3 * enough_N * 0.1 / (4 * E)) ** (1 / 3)
    assert curve.unloading(enough_N).stiffness_N_per_m == pytest.approx(hertz, rel=0.01)
    n = np.count_nonzero(curve.pressed(too_little_N).pressure_Pa)
    assert n < 20
    with pytest.raises(ContactError, match=f"has {n} pixels; expected at least 20"):
        curve.unloading(too_little_N)
