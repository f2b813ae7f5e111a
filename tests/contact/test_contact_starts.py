"""Pressures to begin with at a load between two solved ones."""

import numpy as np
import pytest

from capslip.contact.solvers.starts import Known, start_Pa

y, x = np.mgrid[-20:20, -20:20] + 0.3
R2 = (x**2 + 1.7 * y**2).ravel() / 20.0**2


def ellipse(withdrawal):
    """Pressure of a Hertz contact, p^2 = d - r^2, at an approach of 0.9 less a withdrawal."""
    return Known(withdrawal, np.sqrt(np.maximum(0.9 - withdrawal - R2, 0.0)))


@pytest.mark.parametrize("withdrawal", [0.11, 0.2, 0.29])
def test_a_hertz_contact_begins_at_its_solution(withdrawal):
    truth_Pa = ellipse(withdrawal).pressure_Pa
    found_Pa = start_Pa(truth_Pa.sum(), ellipse(0.05), ellipse(0.1), ellipse(0.3))
    # A pixel that lets go in between does so on the line, as it fell before.
    assert np.abs(found_Pa - truth_Pa).max() < 1e-3
    assert found_Pa.sum() == pytest.approx(truth_Pa.sum(), rel=1e-5)


def test_below_the_preload_it_follows_the_slope_down_to_nothing():
    preload = ellipse(0.0)
    slope = np.where(preload.pressure_Pa > 0, 0.5 / np.maximum(preload.pressure_Pa, 1e-9), 0.0)
    touch = preload.pressure_Pa > 0
    end = Known(0.9, np.zeros(R2.shape))
    truth_Pa = ellipse(0.3).pressure_Pa
    found_Pa = start_Pa(truth_Pa.sum(), slope, preload, end)
    assert np.abs(found_Pa - truth_Pa)[touch].max() < 1e-3


def test_what_lets_go_all_at_once_still_has_its_load():
    """Two loads at one withdrawal, as under an even pressure."""
    above, below = Known(0.1, np.ones(9)), Known(0.1, np.full(9, 0.25))
    found_Pa = start_Pa(4.5, above, above, below)
    assert found_Pa.sum() == pytest.approx(4.5, rel=1e-5)
    assert np.ptp(found_Pa) == 0.0
